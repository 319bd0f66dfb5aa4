"""Swell in the residual: power at the encounter frequency of one wave, pooled over maneuvers.

A regular wave of frequency omega meets a moving vehicle with the phase omega t - k (way made good
along the wave), k = omega^2 / g in deep water (Fossen 2021, 10.2), which sweeps with heading and
speed: a spectral line test misses it, a periodogram along this phase does not. The force goes with
the cosine (surge), sine (sway) and sine of twice (yaw) the angle between wave and heading
(Froude-Krylov, slender hull), so the residual is weighted so. It is whitened per maneuver first,
and each maneuver counts alike, whatever happened in one of them. In the vertical plane the heave
force is alike from all sides, and the pitch moment goes with the cosine.

The statistic is the power over that of white noise, averaged over maneuvers and channels, at its
largest over frequency and direction. On residuals of identified models, before any refit, on
generated trials of two vehicles (7 or 8 maneuvers): 61 clean 2.2 to 7.3, 96 with other effects up
to 13.7 (median 4.2), 27 with waves 42 to 69, frequency right to 0.01 rad/s and direction to 3
degrees; waves of a tenth of that force 16 to 17, of a fifth 19 to 22. After a refit with
nuisances clean ones reach 7, a current that is not yet accepted 14, and waves keep their power.
One maneuver alone reaches 34 by chance when clean, 48 with other effects.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import GRAVITY_OF_WAVES_MPS2
from auvident.schema.planes import HORIZONTAL, Plane, PlaneRow

Array = npt.NDArray[Any]

THRESHOLD = 14.0  # with many maneuvers; see `threshold_of`
# Residuals are averaged over it, or over a step where that is longer: the fastest wave sought has
# eight bins a period. A log so slow that a wave has fewer than `LEAST_A_PERIOD` does not show it:
# bins average it away, and met from ahead it has half as many.
BIN_S = 0.4
LEAST_A_PERIOD = 4
LONGEST_S = 120.0  # longer maneuvers are cut: an unknown phase each, less to ask of the track
LEAST_BINS = 40
FREQUENCIES_RADPS = np.arange(0.4, 2.0001, 0.025)
DIRECTIONS_RAD = 2.0 * math.pi * np.arange(32) / 32.0
FINE = 11  # steps of the finer grid around the best point, per axis
HIGHEST_AR = 0.98
# how the force in each channel goes with the angle between wave and heading
WEIGHTS: dict[Plane, tuple[Callable[[Array], Array], ...]] = {
    "horizontal": (np.cos, np.sin, lambda bearing: np.sin(2.0 * bearing)),
    "vertical": (np.cos, np.ones_like, np.cos),
}


@dataclass(frozen=True)
class Residual:
    """What a model leaves of one maneuver.

    Attributes
    ----------
    maneuver : str
        Identifier.
    time_s : (n,) array
        Of the log, uniform.
    values : (n, 4) array
        Measured minus predicted u, v (m/s), r (rad/s), heading (rad), or those of the vertical
        plane; NaN where not measured.
    u_mps, heading_rad : (n,) array
        Measured, gaps bridged; the heading is the integrated gyro where none is logged (the
        direction of a wave then counts from the heading at the start).
    angle_rad : (n,) array, optional
        Angle of the plane, where that is not the heading.
    """

    maneuver: str
    time_s: Array
    values: Array
    u_mps: Array
    heading_rad: Array
    angle_rad: Array | None = None

    @property
    def angle(self) -> Array:
        """Angle of the plane."""
        return self.heading_rad if self.angle_rad is None else self.angle_rad


@dataclass(frozen=True)
class Wave:
    """The wave that explains most.

    Attributes
    ----------
    frequency_radps : float
        As seen by one who rests.
    direction_rad : float
        Towards which it travels, from north, clockwise, in [0, 2 pi).
    power_ratio : float
        Power over white noise's, mean over maneuvers and channels.
    channel : str
        Where it shows most.
    by_channel : dict of str to float
        Power ratio of each channel at that frequency and direction.
    threshold : float
        Above which it is a wave.
    """

    frequency_radps: float
    direction_rad: float
    power_ratio: float
    channel: str
    by_channel: dict[str, float]
    threshold: float

    @property
    def found(self) -> bool:
        """Whether it is no accident."""
        return self.power_ratio > self.threshold


@dataclass(frozen=True)
class RunInBins:
    """One maneuver in bins: time (n,), way made good (n, 2), heading (n,), white (n, 3)."""

    time_s: Array
    way_m: Array
    heading_rad: Array
    white: Array


def find_wave(
    pieces: Sequence[Residual],
    channels: Sequence[str] | None = None,
    plane: PlaneRow = HORIZONTAL,
) -> Wave | None:
    """Search for the wave that explains most of the residual.

    Parameters
    ----------
    pieces : sequence of Residual
        Of the identifying maneuvers, from the model that explains them best so far.
    channels : sequence of str, optional
        Of u, v, r (u, w, q); all of them without.
    plane : PlaneRow

    Returns
    -------
    Wave or None
        The strongest one, to be asked whether it is `Wave.found`; None with too little data, or
        at a rate that shows no wave.
    """
    runs = [run for piece in pieces for run in _runs(piece)]
    sought = _shown(pieces)
    if not runs or not sought.size:
        return None
    channels, weights = channels or plane.velocities, WEIGHTS[plane.name]
    columns = [plane.velocities.index(c) for c in channels]
    power = wave_power(runs, sought, DIRECTIONS_RAD, columns, weights)
    i, j = np.unravel_index(int(power.mean(axis=2).argmax()), power.shape[:2])
    step_w, step_b = np.diff(FREQUENCIES_RADPS)[0], np.diff(DIRECTIONS_RAD)[0]
    frequencies = sought[i] + np.linspace(-step_w, step_w, FINE)
    directions = DIRECTIONS_RAD[j] + np.linspace(-step_b, step_b, FINE)
    power = wave_power(runs, frequencies, directions, columns, weights)
    i, j = np.unravel_index(int(power.mean(axis=2).argmax()), power.shape[:2])
    best = dict(zip(channels, (float(x) for x in power[i, j]), strict=True))
    return Wave(
        frequency_radps=float(frequencies[i]),
        direction_rad=float(directions[j] % (2.0 * math.pi)),
        power_ratio=float(power[i, j].mean()),
        channel=max(best, key=lambda c: best[c]),
        by_channel=best,
        threshold=threshold_of(len(runs)),
    )


def threshold_of(runs: int) -> float:
    """Power ratio from which on it is a wave: chance has it easier with few maneuvers."""
    return THRESHOLD * (1.0 + 2.0 / runs)


def wave_power(
    runs: Sequence[RunInBins],
    frequencies: Array,
    directions: Array,
    columns: Sequence[int],
    weights: Sequence[Callable[[Array], Array]] = WEIGHTS["horizontal"],
) -> Array:
    """Mean power ratio over the runs for every wave, (frequencies, directions, channels)."""
    power = np.zeros((len(frequencies), len(directions), len(columns)))
    for run in runs:
        clock = np.exp(-1j * np.outer(frequencies, run.time_s))
        for j, direction in enumerate(directions):
            ahead = run.way_m @ np.array([math.cos(direction), math.sin(direction)])
            phase = clock * np.exp(1j * np.outer(frequencies**2 / GRAVITY_OF_WAVES_MPS2, ahead))
            bearing = direction - run.heading_rad
            weight = np.column_stack([of(bearing) for of in weights])
            weighted = (weight * run.white)[:, columns]
            size = np.sum(weight[:, columns] ** 2 * (run.white[:, columns] != 0.0), axis=0)
            power[:, j] += np.abs(phase @ weighted) ** 2 / np.maximum(size, 1.0)
    return power / len(runs)


def _bin_s(piece: Residual) -> float:
    """Length of a bin: none may be empty, or the way made good is lost in it."""
    return max(BIN_S, float(np.median(np.diff(piece.time_s)))) if len(piece.time_s) > 1 else BIN_S


def _shown(pieces: Sequence[Residual]) -> Array:
    """Frequencies of waves that the rate of all the logs shows."""
    longest_s = max(map(_bin_s, pieces), default=BIN_S)
    return FREQUENCIES_RADPS[LEAST_A_PERIOD * longest_s * FREQUENCIES_RADPS <= 2.0 * math.pi]


def _runs(piece: Residual) -> list[RunInBins]:
    """A maneuver in parts of about equal length, each averaged over bins."""
    bin_s = _bin_s(piece)
    bins = np.floor((piece.time_s - piece.time_s[0]) / bin_s).astype(np.int64)
    count = max(math.ceil((bins[-1] + 1) * bin_s / LONGEST_S), 1)
    part = bins * count // (bins[-1] + 1)
    found = [_run(piece, part == k, bin_s) for k in range(count)]
    return [run for run in found if run is not None]


def _run(piece: Residual, rows: Array, bin_s: float) -> RunInBins | None:
    time, u, heading = piece.time_s[rows], piece.u_mps[rows], piece.heading_rad[rows]
    bins = np.floor((time - time[0]) / bin_s + 1e-6).astype(np.int64)
    velocity = u[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
    ahead, aside = binned(np.cos(heading), bins), binned(np.sin(heading), bins)
    way = np.cumsum(np.column_stack([binned(x, bins) for x in velocity.T]), axis=0) * bin_s
    white = np.column_stack([_whitened(binned(x, bins)) for x in piece.values[rows, :3].T])
    if len(white) < LEAST_BINS or not white.any():
        return None
    return RunInBins(np.arange(len(white)) * bin_s, way, np.arctan2(aside, ahead), white)


def binned(values: Array, bins: Array) -> Array:
    """Mean of the known values in each bin, NaN in empty ones."""
    seen = np.isfinite(values)
    size = int(bins[-1]) + 1
    count = np.bincount(bins[seen], minlength=size)
    total = np.bincount(bins[seen], values[seen], minlength=size)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _whitened(values: Array) -> Array:
    """Values without what the one before predicts (AR(1)), unit variance; zero where unknown."""
    values = values - (np.nanmean(values) if np.isfinite(values).any() else 0.0)
    pairs = np.isfinite(values[1:]) & np.isfinite(values[:-1])
    x, y = values[:-1][pairs], values[1:][pairs]
    energy = float(np.sqrt(np.sum(x**2) * np.sum(y**2)))
    if energy == 0.0:
        return np.zeros(len(values))
    keep = min(max(float(np.sum(x * y)) / energy, 0.0), HIGHEST_AR)
    white = np.zeros(len(values))
    white[1:][pairs] = y - keep * x
    spread = float(np.sqrt(np.mean(white[1:][pairs] ** 2)))
    return white / spread if spread > 0.0 else white
