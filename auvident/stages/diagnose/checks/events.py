"""One-off events: residual energy in a few hull lengths of one maneuver and nowhere else.

A knock, a tow line or a gust of a passing ship pushes the vehicle for some L/U. An effect the
model lacks acts again at the next helm or on the next heading, so what tells an event is how far
it stands out from the second worst place of the trial, in sway and in yaw, not its size. Surge
does not count: one change of thrust is an effect of its own (`thrust_step`).

What is compared is the part of the residual that the L/U before does not predict (AR(1) on
means over it), since a slow residual of a turn is no push. Where energy reaches back to the
start of the maneuver it is the start state's; where the prediction runs away the maneuver says
nothing.

Ratio after a refit with nuisances, on generated trials of even seeds: 251 with nothing or another
effect planted, of vehicles with L/U from 0.5 to 5 s, up to 5.0 (four above 4); of thirteen pushes
in maneuvers that identify eleven 12 to 514, two below 2. With means over a second, whatever the
vehicle, four of the eleven had none at all.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import MEDIAN_OF_ABS_TO_STD
from auvident.schema.planes import HORIZONTAL, PlaneRow
from auvident.stages.diagnose.checks.waves import Residual, binned

Array = npt.NDArray[Any]

N_CHANNELS = 3
DECISIVE = (1, 2)  # sway and yaw, heave and pitch
BIN = 1.0  # [L/U]
WINDOW_BINS = 4  # a push and the answer of the vehicle
GUARD_BINS = 12  # this near to an event its own wake is not held against it
START_BINS, START_LONGEST = 3, 8  # windows from which a start state is away, at least, at most
START_SHARE = 0.2  # of the energy of the worst window: the start is not over yet
LEAST_BINS = 10
THRESHOLD = 6.0
PAIR_THRESHOLD = 16.0  # of the lesser of two events: two bad places are less of an exception
LEAST_OVER_NOISE = 2.0  # rms of the unpredicted means over the noise of one sample
MOST_EVENTS = 2
LOST, SLOW = 3.0, 0.05  # residual rate of turn over the measured one, of slow turns over this [U/L]
CALM = 3.0  # robust standard deviations within which a residual is back to usual
CALM_SHARE = 0.1  # ... or this share of its peak
LONGEST_BINS = 15  # what lasts longer is no push


@dataclass(frozen=True)
class Event:
    """A push that happened once.

    Attributes
    ----------
    maneuver : str
    time_s, duration_s : float
        Window to mask, on the clock of the log, until the velocities are back to usual. The
        heading is not: the vehicle goes on another way than without the push, by `angle_rad`.
    ratio : float
        Energy over that of the second worst place; geometric mean of sway and yaw.
    channels : tuple of str
        Of u, v, r (u, w, q), those that stand out.
    angle_rad : float
        Residual of the heading (pitch) after the window minus before; NaN where not logged.
    resolution_s : float
        To which its times are known: L/U.
    """

    maneuver: str
    time_s: float
    duration_s: float
    ratio: float
    channels: tuple[str, ...]
    angle_rad: float
    resolution_s: float = 1.0


@dataclass(frozen=True)
class Track:
    """Residual of one maneuver in bins (n, 4) and its energy (n, 3) in windows starting there."""

    means: Array
    energy: Array


def find_events(
    pieces: Sequence[Residual],
    noise: Array,
    plane: PlaneRow = HORIZONTAL,
    hull_time_s: float = 1.0,
) -> list[Event]:
    """Events, the clearest first.

    Parameters
    ----------
    pieces : sequence of Residual
        Of the identifying maneuvers, from the model that explains them best so far.
    noise : (3,) or (4,) array
        Standard deviation of one sample of u, v (m/s), r (rad/s): a push must exceed it.
    plane : PlaneRow
    hull_time_s : float
        L/U of the vehicle [s].

    Returns
    -------
    list of Event
        At most `MOST_EVENTS`; empty with fewer than two maneuvers that can be used.
    """
    bin_s = _bin_s(pieces, hull_time_s)
    tracks = _tracks(pieces, bin_s)
    if not _can_be_compared(tracks):
        return []
    places = _places(tracks)
    for count in range(min(MOST_EVENTS, len(places) - 1), 0, -1):
        ratios = [_ratios(tracks, place, places[:count]) for place in places[:count]]
        sizes = [float(np.exp(np.mean(np.log(x[list(DECISIVE)])))) for x in ratios]
        loud = all(_is_loud(tracks[k], a, noise) for k, a in places[:count])
        if loud and min(sizes) > (THRESHOLD if count == 1 else PAIR_THRESHOLD):
            events = [
                _event(pieces[k], tracks[k], a, size, ratio, plane.velocities, bin_s)
                for (k, a), size, ratio in zip(places[:count], sizes, ratios, strict=True)
            ]
            return [event for event in events if event.duration_s < LONGEST_BINS * bin_s]
    return []


def smallest_push(
    pieces: Sequence[Residual], noise: Array, hull_time_s: float = 1.0
) -> tuple[float, float] | None:
    """Changes of sway (heave) and yaw (pitch) within L/U that would be an event together.

    They stand out from the worst place in this residual, in each channel, even where half of the
    change falls into either of two bins: a window then has an eighth of its square.

    Parameters
    ----------
    pieces : sequence of Residual
        As `find_events` takes them, the rows of events that were found not known.
    noise : (3,) or (4,) array
        Standard deviation of one sample of u, v (m/s), r (rad/s).
    hull_time_s : float
        L/U of the vehicle [s].

    Returns
    -------
    (float, float) or None
        In m/s and rad/s; None where no two maneuvers can be compared.
    """
    tracks = _tracks(pieces, _bin_s(pieces, hull_time_s))
    if not _can_be_compared(tracks):
        return None
    highest = np.max([t.energy.max(axis=0) for t in tracks if len(t.energy)], axis=0)
    audible = (LEAST_OVER_NOISE * np.asarray(noise)[:N_CHANNELS]) ** 2
    sway, yaw = np.sqrt(2 * WINDOW_BINS * np.maximum(THRESHOLD * highest, audible))[list(DECISIVE)]
    return float(sway), float(yaw)


def _bin_s(pieces: Sequence[Residual], hull_time_s: float) -> float:
    dt_s = float(np.diff(pieces[0].time_s[:2])[0]) if pieces else 1.0
    return max(round(BIN * hull_time_s / dt_s), 1) * dt_s


def _can_be_compared(tracks: Sequence[Track]) -> bool:
    return sum(len(t.energy) > 0 for t in tracks) >= 2


def _tracks(pieces: Sequence[Residual], bin_s: float) -> list[Track]:
    means = [_means(piece, bin_s) for piece in pieces]
    useful = [
        len(mean) >= LEAST_BINS and not _is_lost(piece, mean[:, 2], bin_s)
        for piece, mean in zip(pieces, means, strict=True)
    ]
    good = [mean for mean, use in zip(means, useful, strict=True) if use]
    keep = np.array([_memory([m[:, c] for m in good]) for c in range(N_CHANNELS)])
    tracks = []
    for mean, use in zip(means, useful, strict=True):
        energy = _windowed((mean[1:, :3] - keep * mean[:-1, :3]) ** 2)
        tracks.append(Track(mean, energy if use else energy[:0]))
    return [_without_start(track) for track in tracks]


def _places(tracks: Sequence[Track]) -> list[tuple[int, int]]:
    """Maneuver and window of the worst places, each a guard away from those before."""
    left = [np.sqrt(t.energy[:, DECISIVE[0]] * t.energy[:, DECISIVE[1]]) for t in tracks]
    places: list[tuple[int, int]] = []
    for _ in range(MOST_EVENTS + 1):
        place = _highest(left)
        if place is None:
            break
        places.append(place)
        left[place[0]][_near(place[1], len(left[place[0]]))] = 0.0
    return places


def _means(piece: Residual, bin_s: float) -> Array:
    """Means over bins; unknown where a drop-out or the end takes half of the usual samples."""
    bins = np.floor((piece.time_s - piece.time_s[0]) / bin_s + 1e-6).astype(np.int64)
    seen = np.isfinite(piece.values)
    count = np.column_stack([np.bincount(bins, x) for x in seen.T.astype(float)])
    means = np.column_stack([binned(x, bins) for x in piece.values.T])
    return np.where(count > 0.5 * np.median(count, axis=0), means, np.nan)


def _is_lost(piece: Residual, rate: Array, bin_s: float) -> bool:
    """Whether the prediction ran away: it turns far faster than the vehicle, or ends early."""
    known = np.isfinite(rate)
    if not known.any() or len(known) - int(np.flatnonzero(known)[-1]) > WINDOW_BINS + 1:
        return True
    turned = np.abs(np.diff(piece.angle[:: round(bin_s / np.diff(piece.time_s)[0])]))
    fastest = float(np.nanmax(turned)) / bin_s
    return bool(np.nanmax(np.abs(rate)) > LOST * max(fastest, SLOW * BIN / bin_s))


def _memory(series: Sequence[Array]) -> float:
    """Correlation of successive means of one channel, over all maneuvers."""
    before = np.concatenate([x[:-1] for x in series] or [np.zeros(0)])
    after = np.concatenate([x[1:] for x in series] or [np.zeros(0)])
    known = np.isfinite(before) & np.isfinite(after)
    energy = math.sqrt(float(np.sum(before[known] ** 2) * np.sum(after[known] ** 2)))
    return float(np.sum(before[known] * after[known])) / energy if energy > 0.0 else 0.0


def _windowed(energy: Array) -> Array:
    """Mean over `WINDOW_BINS` bins of what is known of them; zero where that is under half."""
    known, box = np.isfinite(energy), np.ones(WINDOW_BINS)
    if len(energy) < WINDOW_BINS:
        return np.zeros((0, energy.shape[1]))
    total = np.column_stack([np.convolve(x, box, "valid") for x in np.where(known, energy, 0.0).T])
    count = np.column_stack([np.convolve(x, box, "valid") for x in known.T.astype(float)])
    return np.where(count >= WINDOW_BINS / 2, total / np.maximum(count, 1.0), 0.0)


def _without_start(track: Track) -> Track:
    """No energy in the windows that are joined to the start: there the start state is wrong."""
    energy = track.energy.copy()
    energy[:START_BINS] = 0.0
    product = np.sqrt(track.energy[:, 1] * track.energy[:, 2])
    if len(product):
        loud = np.append(product[:START_LONGEST] > START_SHARE * product.max(), False)
        energy[: int(np.argmin(loud))] = 0.0
    return Track(track.means, energy)


def _highest(left: Sequence[Array]) -> tuple[int, int] | None:
    """Maneuver and window of the highest energy; None where nothing is left."""
    peaks = [float(x.max()) if len(x) else 0.0 for x in left]
    k = int(np.argmax(peaks))
    return (k, int(left[k].argmax())) if peaks[k] > 0.0 else None


def _near(window: int, size: int) -> slice:
    return slice(max(window - GUARD_BINS, 0), min(window + GUARD_BINS + 1, size))


def _ratios(
    tracks: Sequence[Track], place: tuple[int, int], events: Sequence[tuple[int, int]]
) -> Array:
    """Energy of a place over the highest one elsewhere, (3,) by channel."""
    others = [t.energy.copy() for t in tracks]
    for k, a in events:
        others[k][_near(a, len(others[k]))] = 0.0
    highest = np.max([x.max(axis=0) for x in others if len(x)], axis=0)
    k, a = place
    return np.asarray(tracks[k].energy[a] / np.maximum(highest, 1e-30))


def _is_loud(track: Track, window: int, noise: Array) -> bool:
    rms = np.sqrt(track.energy[window, list(DECISIVE)])
    return bool(np.all(rms > LEAST_OVER_NOISE * np.asarray(noise)[list(DECISIVE)]))


def _event(
    piece: Residual,
    track: Track,
    window: int,
    ratio: float,
    ratios: Array,
    names: Sequence[str],
    bin_s: float,
) -> Event:
    first, last = _extent(track.means[:, :3], window)
    angle = track.means[:, 3]
    before, after = angle[max(first - 3, 0) : first], angle[last : last + 3]
    known = np.isfinite(before).any() and np.isfinite(after).any()
    return Event(
        maneuver=piece.maneuver,
        time_s=float(piece.time_s[0] + first * bin_s),
        duration_s=float((last - first) * bin_s),
        ratio=ratio,
        channels=tuple(c for c, x in zip(names, ratios, strict=True) if x > THRESHOLD),
        angle_rad=float(np.nanmean(after) - np.nanmean(before)) if known else math.nan,
        resolution_s=bin_s,
    )


def _extent(means: Array, window: int) -> tuple[int, int]:
    """First bin and the one after the last that are out of the usual around a window.

    The window of innovations that starts at row a covers bins a + 1 to a + `WINDOW_BINS`.
    """
    size = np.abs(means - np.nanmedian(means, axis=0))
    usual = MEDIAN_OF_ABS_TO_STD * np.nanmedian(size, axis=0)
    inside = slice(window, window + WINDOW_BINS + 1)
    peak = np.nanmax(np.nan_to_num(size[inside]), axis=0)
    loud = (size > np.maximum(CALM * usual, CALM_SHARE * peak)).any(axis=1)
    first, last = window + 1, window + WINDOW_BINS + 1
    while first > 0 and loud[max(first - 2, 0) : first].any() and last - first < LONGEST_BINS:
        first -= 1
    while last < len(loud) and loud[last : last + 2].any() and last - first < LONGEST_BINS:
        last += 1
    return first, last
