"""From tables on one clock to the arrays of a filter pass or a simulation."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import VehicleTime
from auvident.engines.problem import Records
from auvident.engines.smoothing import smoothed
from auvident.physics.actuation import NO_PAST, turning_points
from auvident.physics.dynamics import N_STATES
from auvident.physics.sensing import sensor_matrix
from auvident.schema.artifacts import Maneuver
from auvident.schema.channels import RECORD_COLUMN, TIME_COLUMN, sampled_flag
from auvident.schema.planes import CONTROL_COLUMNS, STATE_COLUMNS, Plane
from auvident.schema.trial import Trial

Array = npt.NDArray[Any]

__all__ = [
    "CONTROL_COLUMNS",
    "STATE_COLUMNS",
    "Record",
    "Source",
    "record_of",
    "sensor_matrix",
    "stack",
]

# inputs before a maneuver, for what remembers them: lags and delays
LEAD_IN_S: VehicleTime = 20.0
NORTH = "north"  # what a logged heading counts from
BOW = "bow of {}"  # what another one does: no trial is so called that it passes for `NORTH`
HEADING, ANGLE = "heading_rad", 3  # the angle of the horizontal plane, and its place
AUXILIARY = ("p_radps", "q_radps", "roll_rad", "pitch_rad", "depth_m", HEADING)
START_BEFORE_S: VehicleTime = 1.0  # window of the line that gives the state at the start ...
START_AFTER_S: VehicleTime = 0.5  # ... and after it
LINE_READINGS = 3  # through fewer no line is drawn
# control angles [rad] and propeller rate [1/s] within these, and this share, are the same input
SAME_INPUT, SAME_SHARE = np.array([0.017, 0.017, 0.1]), np.array([0.0, 0.0, 0.03])


@dataclass(frozen=True)
class Source:
    """What effects need of the log beside a record of n rows; m more rows of inputs lead in.

    Attributes
    ----------
    raw : (m + n, 3) array
        Logged inputs: own control, other control [rad], propeller rate [rev/s].
    elapsed_s : (m + n,) array
        Time since the start of the trial.
    speed : (m + n,) array
        Measured surge velocity, smoothed.
    roll, pitch : (m + n,) array
        Zero where not logged.
    rates : (n, 2) array
        Roll and pitch rate, zero where not logged.
    bridged : (n, 4) array
        Readings, gaps bridged.
    start : (4,) array
        Readings at the start, from a line.
    free_force : (n, 3) array or None
        Forces X, A, B that act in addition.
    from_middle_s : (n,) array or None
        Time from the middle of the trial; None counts as zero.
    depth : (m + n,) array or None
        Zero where not logged; None counts as zero.
    past : (p,) array or None
        Own control [rad] before all of these rows: its turning points, as far as a play remembers
        them; None counts as none.
    heading : (n,) array or None
        Zero where not logged. None in the horizontal plane, where it is a reading.
    frame : str
        What the heading counts from: `NORTH`, or where it is not logged the bow (`BOW`) at the
        start of the trial; of the maneuver where the yaw rate has gaps.
    """

    raw: Array
    elapsed_s: Array
    speed: Array
    roll: Array
    pitch: Array
    rates: Array
    bridged: Array
    start: Array
    free_force: Array | None = None
    from_middle_s: Array | None = None
    depth: Array | None = None
    past: Array | None = None
    heading: Array | None = None
    frame: str = NORTH


@dataclass(frozen=True)
class Record:
    """One maneuver as arrays; see `Records` for shapes without the leading axis.

    Attributes
    ----------
    moved : (4,) array
        How far a fit has moved the start from the line through the readings.
    """

    id: str
    time_s: Array
    inputs: Array
    given: Array
    measured: Array
    start: Array
    source: Source | None = None
    moved: Array = field(default_factory=lambda: np.zeros(N_STATES))

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.time_s)


def record_of(maneuver: Maneuver, trial: Trial, plane: Plane, sensor: Array) -> Record:
    """Cut one maneuver out of its trial.

    Parameters
    ----------
    maneuver, trial : Maneuver, Trial
    plane : str
    sensor : (4, 4) array
        From `sensor_matrix`.
    """
    columns, half = trial.columns, 0.5 / trial.rate_hz
    time = columns[TIME_COLUMN]
    # the row at its end is the first of a maneuver that follows at once
    first, last = np.searchsorted(time, [maneuver.t_start_s - half, maneuver.t_end_s - half])
    readings = np.zeros((last - first, N_STATES))
    measured = np.full_like(readings, np.nan)
    for i, column in enumerate(STATE_COLUMNS[plane]):
        if column in columns:
            readings[:, i] = columns[column][first:last]
            sampled = columns[sampled_flag(column)][first:last]
            measured[:, i] = np.where(sampled, readings[:, i], np.nan)
    start, frame = _reading_at(trial, plane, int(first)), frame_of(maneuver, trial, plane)
    if frame != NORTH and trial.turned_rad is not None:
        readings[:, ANGLE] = trial.turned_rad[first:last]
        start[ANGLE] = trial.turned_rad[first]
    inverse, bridged = np.linalg.inv(sensor), np.nan_to_num(readings)
    lead = min(round(LEAD_IN_S * trial.rate_hz), int(first))
    begin, end = int(first) - lead, int(last)
    raw = _raw_inputs(trial, plane, begin, end)
    p, q, roll, pitch, depth, heading = _columns(trial, AUXILIARY, begin, end).T
    source = Source(
        raw,
        time[begin:end] - time[0],
        _speed(trial, begin, end),
        roll,
        pitch,
        np.column_stack([p, q])[lead:],
        bridged,
        start,
        from_middle_s=time[first:last] - 0.5 * (time[0] + time[-1]),
        depth=depth,
        past=_past_of(trial, plane, begin),
        heading=heading[lead:] if plane == "vertical" else None,
        frame=frame,
    )
    return Record(
        maneuver.id,
        time[first:last],
        raw[lead:].copy(),
        bridged @ inverse.T,
        measured,
        inverse @ start,
        source,
    )


def frame_of(maneuver: Maneuver, trial: Trial, plane: Plane) -> str:
    """What the heading of a record counts from, see `Source.frame`."""
    if plane == "vertical" or trial.has_heading:
        return NORTH
    return BOW.format(maneuver.id if trial.turned_rad is None else trial.name)


def in_one_frame(frames: Iterable[str]) -> bool:
    """Whether headings that are not logged can be held against each other: all from one bow."""
    different = set(frames)
    return len(different) == 1 and NORTH not in different


def _speed(trial: Trial, first: int, last: int) -> Array:
    """Surge velocity (n,), smoothed, gaps bridged; zero where it is not logged.

    The thrust follows from it, and that moves a fin in its race: noise in it is noise in the yaw.
    """
    column = STATE_COLUMNS["horizontal"][0]
    values = trial.columns[column][first:last] if column in trial.columns else None
    if values is None or not (seen := np.isfinite(values)).any():
        return np.zeros(last - first)
    rows = np.arange(len(values))
    bridged = np.interp(rows, rows[seen], values[seen])
    return smoothed(bridged[:, None], 1.0 / trial.rate_hz)[:, 0]


def _raw_inputs(trial: Trial, plane: Plane, first: int, last: int) -> Array:
    """Logged inputs (n, 3), zero where there are none."""
    columns = (*CONTROL_COLUMNS[plane], "rpm")
    return _columns(trial, columns, first, last) / np.array([1.0, 1.0, 60.0])


def _past_of(trial: Trial, plane: Plane, end: int) -> Array:
    """Turning points of the own control before a row: a play remembers them however long ago."""
    column = CONTROL_COLUMNS[plane][0]
    if column not in trial.columns:
        return NO_PAST
    return turning_points(trial.columns[column][:end])


def _columns(trial: Trial, names: Sequence[str], first: int, last: int) -> Array:
    """Columns (n, k) of a trial, zero where there is no value."""
    out = np.zeros((last - first, len(names)))
    for i, column in enumerate(names):
        if column in trial.columns:
            out[:, i] = trial.columns[column][first:last]
    return np.nan_to_num(out)


def _reading_at(trial: Trial, plane: Plane, row: int) -> Array:
    """Readings (4,) at a row, from a line through the readings around it in the same record.

    A line bends where a helm is laid or the propeller takes another rate, and there maneuvers
    begin: only readings under the inputs before the row count.
    """
    columns, reading = trial.columns, np.zeros(N_STATES)
    near, same = _rows_near(trial, plane, row)
    for i, column in enumerate(STATE_COLUMNS[plane]):
        if column not in columns:
            continue
        values = columns[column][near]
        good = np.isfinite(values)
        good = good & same if (good & same).any() else good
        if good.any():
            degree = 1 if good.sum() >= LINE_READINGS else 0
            reading[i] = np.polynomial.polynomial.polyfit(near[good] - row, values[good], degree)[0]
    return reading


def is_read_at(trial: Trial, plane: Plane, time_s: float) -> bool:
    """Whether every velocity of a plane has a reading from which a motion can begin at a time."""
    times = trial.columns[TIME_COLUMN]
    near, _ = _rows_near(trial, plane, int(np.searchsorted(times, time_s - 0.5 / trial.rate_hz)))
    velocities = STATE_COLUMNS[plane][:3]
    return all(
        column in trial.columns and bool(np.isfinite(trial.columns[column][near]).any())
        for column in velocities
    )


def _rows_near(
    trial: Trial, plane: Plane, row: int
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.bool_]]:
    """Rows of the same record around a row; which of them the inputs before it led to."""
    before, after = (round(s * trial.rate_hz) for s in (START_BEFORE_S, START_AFTER_S))
    near = np.arange(max(row - before, 0), min(row + after + 1, len(trial)))
    piece = trial.columns[RECORD_COLUMN]
    near = near[piece[near] == piece[row]]
    inputs = _raw_inputs(trial, plane, int(near[0]), int(near[-1]) + 1)
    usual = inputs[max(row - 1 - near[0], 0)]
    apart = np.abs(inputs - usual) > SAME_INPUT + SAME_SHARE * np.abs(usual)
    other = near[apart.any(axis=1)]  # they act on the states of the rows after them
    first = other[other < row].max(initial=near[0] - 1) + 1
    last = other[other >= row].min(initial=near[-1])
    return near, (near >= first) & (near <= last)


def stack(maneuvers: Sequence[Record], dt_s: float) -> tuple[Records, Array]:
    """Put records side by side, longest first; also returns their start states (k, 4)."""
    ordered = sorted(maneuvers, key=lambda record: (-len(record.time_s), record.id))
    lengths = np.array([len(record.time_s) for record in ordered], dtype=np.int64)
    records = Records(
        ids=tuple(record.id for record in ordered),
        lengths=lengths,
        inputs=_padded([record.inputs for record in ordered]),
        given=_padded([record.given for record in ordered]),
        measured=_padded([record.measured for record in ordered]),
        dt_s=dt_s,
    )
    return records, np.array([record.start for record in ordered])


def _padded(blocks: Sequence[Array]) -> Array:
    """Blocks (n_j, width), longest first, as one array (k, n_0, width) padded with NaN."""
    padded = np.full((len(blocks), *blocks[0].shape), np.nan)
    for j, block in enumerate(blocks):
        padded[j, : len(block)] = block
    return padded
