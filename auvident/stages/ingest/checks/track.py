"""The track by position against that by the DVL: scale, turn and current in one fit.

Over pieces of some time, displacement = g (velocity turned by the heading) + current x time, as
complex numbers, north + i east. The absolute value of g is the scale of the position over that of
the DVL, its angle that by which the DVL is turned. A current and a scale are told apart by pieces
on different headings.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from auvident.stages.ingest.checks.row import Figure
from auvident.stages.ingest.checks.seen import Seen

PIECE_S = 20.0  # long against the noise of a position fix
LEAST_PIECES = 8
LEAVE_OUT = 8  # blocks of the jackknife
LEVEL_RAD = 0.15  # mean pitch of a piece: steeper ones are left out
LEAST_EXPLAINED = 0.5  # of the variance of the displacements: less is no track of this vehicle
LEAST_TURNED = 0.3  # rad between two pieces that shows the scale of a yaw rate
COURSE_LENGTHS = 3.0  # of way, least between two positions that a course is taken from


@dataclass(frozen=True)
class TrackFit:
    """Scale of the position over the DVL, angle of the DVL in rad, share of variance explained."""

    scale: Figure
    turned: float
    explained: float


def track(seen: Seen, mirrored: bool = False) -> TrackFit | None:
    """Fit of scale, angle and current; None without position, heading or enough way.

    `mirrored` takes the other sign of east.
    """
    moved, way, _, seconds = _pieces(seen)
    moved = np.conj(moved) if mirrored else moved
    if moved.size < LEAST_PIECES:
        return None
    gain, current = _fit(moved, way, seconds)
    blocks = np.array_split(np.arange(moved.size), LEAVE_OUT)
    kept = [np.setdiff1d(np.arange(moved.size), block) for block in blocks]
    others = np.array([_fit(moved[k], way[k], seconds[k])[0] for k in kept])
    size = np.abs(others)
    std = float(np.sqrt((LEAVE_OUT - 1) / LEAVE_OUT * np.sum((size - size.mean()) ** 2)))
    rest = moved - gain * way - current * seconds
    drift = np.mean(moved / seconds)
    total = float(np.sum(np.abs(moved - drift * seconds) ** 2))
    explained = 1.0 - float(np.sum(np.abs(rest) ** 2)) / max(total, np.finfo(float).tiny)
    return TrackFit(Figure(float(abs(gain)), std), float(np.angle(gain)), explained)


def _fit(moved: npt.NDArray, way: npt.NDArray, seconds: npt.NDArray) -> tuple[complex, complex]:
    """Gain of the way through the water and current."""
    x = np.column_stack((way, seconds.astype(complex)))
    found, *_ = np.linalg.lstsq(x, moved, rcond=None)
    return complex(found[0]), complex(found[1])


def sway_gain(seen: Seen) -> Figure | None:
    """Sway by position over that of the DVL, as read; None where nothing shows it."""
    moved, way, sideways, seconds = _pieces(seen)
    if moved.size < LEAST_PIECES:
        return None
    x = np.column_stack((way - sideways, sideways, seconds.astype(complex)))

    def gain(rows: npt.NDArray) -> float:
        found, *_ = np.linalg.lstsq(x[rows], moved[rows], rcond=None)
        return float(np.real(found[1] / found[0])) if found[0] else np.nan

    return _jackknife(gain, moved.size)


def _jackknife(estimate: Callable[[npt.NDArray], float], size: int) -> Figure:
    """An estimate from all rows, with its standard deviation from leaving out blocks of them."""
    rows = np.arange(size)
    blocks = np.array_split(rows, LEAVE_OUT)
    others = np.array([estimate(np.setdiff1d(rows, block)) for block in blocks])
    std = np.sqrt((LEAVE_OUT - 1) / LEAVE_OUT * np.sum((others - others.mean()) ** 2))
    return Figure(estimate(rows), float(std))


def _pieces(seen: Seen) -> tuple[npt.NDArray, npt.NDArray, npt.NDArray, npt.NDArray]:
    """Displacement by position, way by the DVL, that of sway alone, and time of each piece."""
    names = ("u_mps", "v_mps", "r_radps", "heading_rad", "north_m", "east_m")
    if not seen.has(*names):
        return (np.empty(0, complex),) * 3 + (np.empty(0),)
    u, v, r, heading, north, east = (seen.whole(name) for name in names)
    pitch = np.nan_to_num(seen.whole("pitch_rad"))
    dvl = seen.vehicle.dvl
    body = (u + dvl.y_m * r) * np.cos(pitch) + 1j * (v - dvl.x_m * r)
    step = round(PIECE_S * seen.trial.rate_hz)
    first = np.arange(0, u.size - step, step)
    ahead = np.exp(1j * heading) / seen.trial.rate_hz
    way, sideways = (_summed(x, first, step) for x in (body * ahead, 1j * v * ahead))
    level = np.array([abs(pitch[k : k + step].mean()) < LEVEL_RAD for k in first])
    place = north + 1j * east
    moved = place[first + step] - place[first] if first.size else np.empty(0, complex)
    good = np.isfinite(way) & np.isfinite(moved) & level if first.size else np.empty(0, bool)
    return moved[good], way[good], sideways[good], np.full(int(good.sum()), PIECE_S)


def _summed(x: npt.NDArray, first: npt.NDArray, step: int) -> npt.NDArray:
    """Sums over pieces, half of each end: a sum of all rows but the last lags by half a row."""
    ends = 0.5 * (x[first] + x[first + step])
    return np.array([x[k : k + step + 1].sum() for k in first]) - ends


def course_gain(seen: Seen) -> Figure | None:
    """Turn of the course by position over that of the yaw rate; None where nothing shows it."""
    if not seen.has("r_radps", "north_m", "east_m") or not np.isfinite(seen.passage_s):
        return None
    turned, course = _courses(seen)
    if turned.size < LEAST_PIECES:
        return None

    def slope(rows: npt.NDArray) -> float:
        return float(turned[rows] @ course[rows] / (turned[rows] @ turned[rows]))

    return _jackknife(slope, turned.size)


def _courses(seen: Seen) -> tuple[npt.NDArray, npt.NDArray]:
    """Angle turned by the gyro and change of the course between neighbouring pieces."""
    r, place = seen.whole("r_radps"), seen.whole("north_m") + 1j * seen.whole("east_m")
    rate = seen.trial.rate_hz
    step = max(round(COURSE_LENGTHS * seen.passage_s * rate), round(_fix_s(seen) * rate), 1)
    marks = np.arange(0, r.size - step, step)
    chord = place[marks + step] - place[marks]
    yaw = np.concatenate(([0.0], np.cumsum(np.nan_to_num(r)) / rate))
    known = np.add.accumulate(np.isfinite(r).astype(int))
    middle = marks + step // 2
    turned = yaw[middle[1:]] - yaw[middle[:-1]]
    course = np.angle(chord[1:] * np.conj(chord[:-1]))
    course = turned + np.angle(np.exp(1j * (course - turned)))
    far = np.abs(chord) > COURSE_LENGTHS / 2 * seen.length_m
    good = far[1:] & far[:-1] & (np.abs(turned) > LEAST_TURNED) & (np.abs(turned) < 2.0)
    good &= np.isfinite(course) & (known[middle[1:]] - known[middle[:-1]] == np.diff(middle))
    return turned[good], course[good]


def _fix_s(seen: Seen) -> float:
    """Time between two fixes."""
    time = seen.raw.sensors["position"].time_s
    return float(np.median(np.diff(np.sort(time[np.isfinite(time)]))))
