"""What the search works on: the pieces of a trial between long gaps, and what is found in them."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auvident.constants import BRIDGED_S, VehicleTime
from auvident.physics.maneuvers.plateaus import (
    Array,
    odd_samples,
    running_mean,
    running_median,
)
from auvident.physics.maneuvers.track import integral_of
from auvident.schema.artifacts import ManeuverKind, Rejected
from auvident.schema.channels import CHANNELS, NEEDED, RECORD_COLUMN, TIME_COLUMN
from auvident.schema.planes import BY_PLANE, CONTROL_COLUMNS, PLANES, STATE_COLUMNS, STATES, Plane
from auvident.schema.trial import Trial

SHORTEST_PIECE_S: VehicleTime = 5.0  # no maneuver fits into less
MEDIAN_WINDOW_S = 0.5  # spikes of the fin log up to half of it disappear, edges stay
MEAN_WINDOW_S: VehicleTime = 2.0  # waves and sensor noise average out, a swing of a zigzag does not


@dataclass(frozen=True)
class Piece:
    """A piece of a trial without a long gap, in one plane.

    `record` is the number of the uninterrupted record of each sample, -1 in a bridged gap.

    `v`, `fin`, `rate` and `angle` are sway, rudder, yaw rate and heading, or heave, elevator,
    pitch rate and pitch; `fin` and `rpm` are free of spikes, `fin_logged` and `rpm_logged` are
    as they came; `speed` and `rate_mean` are running means. `depth` is NaN in gaps too long to
    bridge, None where the trial has none; `descent` is the rate of sinking by surge, heave and
    pitch, None where they are not logged.
    """

    trial: str
    number: int
    is_first: bool
    is_last: bool
    rate_hz: float
    record: NDArray[np.int64]
    t: Array
    u: Array
    v: Array
    rpm: Array
    rpm_logged: Array
    fin: Array
    fin_logged: Array
    rate: Array
    angle: Array
    depth: Array | None
    descent: Array | None
    speed: Array
    rate_mean: Array

    @property
    def size(self) -> int:
        """Number of samples."""
        return int(self.t.size)

    def samples(self, seconds: float) -> int:
        """Number of samples in a time span."""
        return round(seconds * self.rate_hz)

    def time(self, index: int) -> float:
        """Time of a sample; the end of a half-open range may lie one beyond the last."""
        return float(self.t[min(max(index, 0), self.size - 1)])

    def seconds(self, start: int, stop: int) -> float:
        """Length of a half-open range."""
        return self.time(stop) - self.time(start)

    def rejected(
        self, start: int, stop: int, reason: str, value: float, threshold: float
    ) -> Rejected:
        """Why this range is no maneuver."""
        return Rejected(
            trial=self.trial,
            t_start_s=round(self.time(start), 3),
            t_end_s=round(self.time(stop), 3),
            reason=reason,
            value=round(float(value), 4),
            threshold=round(float(threshold), 4),
        )


@dataclass(frozen=True)
class Found:
    """A maneuver in samples of its piece, half-open."""

    kind: ManeuverKind
    piece: Piece
    start: int
    stop: int
    level_rad: float = 0.0
    plane: Plane = "horizontal"
    notes: dict[str, Any] = field(default_factory=dict)

    @property
    def planes(self) -> tuple[Plane, ...]:
        """In which it may identify: a run with thrust steps is one of either plane."""
        runs = self.kind == "straight" and self.plane == "horizontal"
        return PLANES if runs else (self.plane,)

    @property
    def seconds(self) -> float:
        """Its length."""
        return self.piece.seconds(self.start, self.stop)


def planes_logged(trial: Trial, found: Found) -> tuple[Plane, ...]:
    """In which a maneuver identifies: its trial has the motion, and the fin all along.

    What is not logged would count as zero, at which no elevator stays.
    """
    columns = trial.columns
    time = columns[TIME_COLUMN]
    rows = (time >= found.piece.time(found.start)) & (time < found.piece.time(found.stop))
    if RECORD_COLUMN in columns:
        rows &= columns[RECORD_COLUMN] >= 0

    def has(plane: Plane) -> bool:
        row = BY_PLANE[plane]
        fin = row.control_columns[0]
        return not trial.lacking(row.needed) and not np.isnan(columns[fin][rows]).any()

    return tuple(p for p in found.planes if p == found.plane or has(p))


def pieces_of(trial: Trial, plane: Plane = "horizontal") -> list[Piece]:
    """Pieces of a trial without a long gap, in time order; too short ones are left out.

    Short gaps of a sensor are bridged so that a maneuver is recognised as a whole; `record`
    remembers them.
    """
    needed = {*NEEDED, *BY_PLANE[plane].needed}
    if any(column not in trial.columns for column in needed):
        return []
    columns = {c: values.astype(float) for c, values in trial.columns.items() if c in _READ}
    record = trial.columns.get(RECORD_COLUMN, np.zeros(len(trial)))
    usable = np.all([np.isfinite(columns[c]) for c in needed], axis=0) & (record >= 0)
    label = np.where(usable, record, -1).astype(np.int64)
    for column in needed:
        _bridge(columns[column], held=column in _INPUTS)
    if "depth_m" in columns:
        _bridge_short(columns["depth_m"], round(BRIDGED_S * trial.rate_hz))
    ranges = [
        (a, b)
        for a, b in _without_long_gaps(usable, round(BRIDGED_S * trial.rate_hz))
        if b - a >= SHORTEST_PIECE_S * trial.rate_hz
    ]
    last = len(ranges) - 1
    return [
        _piece(trial, plane, columns, label, slice(a, b), number, last)
        for number, (a, b) in enumerate(ranges)
    ]


_INPUTS = tuple(c.column for c in CHANNELS if c.kind == "input")
_READ = {TIME_COLUMN, *_INPUTS, *(s.column for s in STATES), "depth_m"}


def _bridge(values: Array, held: bool) -> None:
    """Fill the missing values of a channel in place: an input is held, a motion interpolated."""
    good = np.flatnonzero(np.isfinite(values))
    missing = np.flatnonzero(~np.isfinite(values))
    if good.size == 0 or missing.size == 0:
        return
    if held:
        before = np.maximum(np.searchsorted(good, missing) - 1, 0)
        values[missing] = values[good[before]]
    else:
        values[missing] = np.interp(missing, good, values[good])


def _bridge_short(values: Array, longest: int) -> None:
    """Fill gaps of at most `longest` rows between two readings of a motion in place."""
    for start, stop in true_ranges(~np.isfinite(values)):
        if start > 0 and stop < values.size and stop - start <= longest:
            _bridge(values[start - 1 : stop + 1], held=False)


def true_ranges(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Half-open ranges in which a mask holds."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], mask.astype(np.int8), [0]))))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _without_long_gaps(usable: NDArray[np.bool_], longest: int) -> list[tuple[int, int]]:
    """Half-open ranges of rows that begin and end usable, with gaps of at most `longest` rows."""
    rows = np.flatnonzero(usable)
    if rows.size == 0:
        return []
    cuts = np.flatnonzero(np.diff(rows) > longest + 1)
    first = np.concatenate(([rows[0]], rows[cuts + 1]))
    last = np.concatenate((rows[cuts], [rows[-1]]))
    return [(int(a), int(b) + 1) for a, b in zip(first, last, strict=True)]


def _piece(
    trial: Trial,
    plane: Plane,
    columns: dict[str, Array],
    label: NDArray[np.int64],
    rows: slice,
    number: int,
    last: int,
) -> Piece:
    """One piece; an angle that is missing or broken is the integral of its rate."""
    _, of_v, of_rate, of_angle = STATE_COLUMNS[plane]
    t = columns[TIME_COLUMN][rows]
    fin = columns[CONTROL_COLUMNS[plane][0]][rows]
    rate = columns[of_rate][rows]
    angle = columns.get(of_angle, np.array([]))[rows]
    if angle.size != t.size or not np.isfinite(angle).all():
        angle = integral_of(t, rate)
    deep = columns.get("depth_m", np.array([]))
    depth = deep[rows] if np.isfinite(deep).any() else None
    narrow = odd_samples(MEDIAN_WINDOW_S, trial.rate_hz)
    wide = odd_samples(MEAN_WINDOW_S, trial.rate_hz)
    u, rpm = columns["u_mps"][rows], columns["rpm"][rows]
    v = columns[of_v][rows]
    return Piece(
        trial=trial.name,
        number=number,
        is_first=number == 0,
        is_last=number == last,
        rate_hz=trial.rate_hz,
        record=label[rows],
        t=t,
        u=u,
        v=v,
        rpm=running_median(rpm, narrow),
        rpm_logged=rpm,
        fin=running_median(fin, narrow),
        fin_logged=fin,
        rate=rate,
        angle=angle,
        depth=depth,
        descent=_descent(columns, rows),
        speed=running_mean(u, wide),
        rate_mean=running_mean(rate, wide),
    )


def _descent(columns: dict[str, Array], rows: slice) -> Array | None:
    """Rate of sinking by the motion over the ground (positive down), if it is logged [m/s]."""
    if "pitch_rad" not in columns or "w_mps" not in columns:
        return None
    u, w, pitch = (columns[c][rows] for c in ("u_mps", "w_mps", "pitch_rad"))
    return np.asarray(w * np.cos(pitch) - u * np.sin(pitch))
