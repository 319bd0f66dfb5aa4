"""From tables on one clock to the arrays of a filter pass or a simulation."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.engines.problem import Records
from auvident.physics.dynamics import N_STATES
from auvident.schema.artifacts import Maneuver, Sensing
from auvident.schema.channels import RECORD_COLUMN, TIME_COLUMN, sampled_flag
from auvident.schema.coefficients import Plane
from auvident.schema.trial import Trial

Array = npt.NDArray[Any]

# column of each state (u, a, b, angle), of the own and of the other control surface
STATE_COLUMNS: dict[Plane, tuple[str, str, str, str]] = {
    "horizontal": ("u_mps", "v_mps", "r_radps", "heading_rad"),
    "vertical": ("u_mps", "w_mps", "q_radps", "pitch_rad"),
}
CONTROL_COLUMNS: dict[Plane, tuple[str, str]] = {
    "horizontal": ("rudder_rad", "elevator_rad"),
    "vertical": ("elevator_rad", "rudder_rad"),
}
START_BEFORE_S, START_AFTER_S = 1.0, 0.5  # window of the line that gives the state at the start


@dataclass(frozen=True)
class Record:
    """One maneuver as arrays; see `Records` for shapes without the leading axis."""

    id: str
    time_s: Array
    inputs: Array
    given: Array
    measured: Array
    start: Array


def sensor_matrix(plane: Plane, sensing: Sensing) -> Array:
    """Readings (DVL u, DVL v or w, rate gyro, angle) as linear functions of the state.

    Theory 2.3: velocity of the DVL's position in the axes of the DVL, which is turned by the
    mounting angle (positive to starboard).

    Returns
    -------
    (4, 4) array
        Reading = matrix @ (u, a, b, angle).
    """
    matrix = np.eye(N_STATES)
    if plane == "vertical":
        matrix[0, 2], matrix[1, 2] = sensing.dvl_z_m, -sensing.dvl_x_m
        return matrix
    matrix[0, 2], matrix[1, 2] = -sensing.dvl_y_m, sensing.dvl_x_m
    c, s = math.cos(sensing.dvl_mounting_yaw_rad), math.sin(sensing.dvl_mounting_yaw_rad)
    matrix[:2] = np.array([[c, s], [-s, c]]) @ matrix[:2]
    return matrix


def record_of(maneuver: Maneuver, trial: Trial, plane: Plane, sensor: Array) -> Record:
    """Cut one maneuver out of its trial.

    Parameters
    ----------
    maneuver, trial : Maneuver, Trial
    plane : str
    sensor : (4, 4) array
        From `sensor_matrix`.
    """
    table, half = trial.table, 0.5 / trial.rate_hz
    time = table[TIME_COLUMN].to_numpy()
    # the row at its end is the first of a maneuver that follows at once
    first, last = np.searchsorted(time, [maneuver.t_start_s - half, maneuver.t_end_s - half])
    readings = np.zeros((last - first, N_STATES))
    measured = np.full_like(readings, np.nan)
    for i, column in enumerate(STATE_COLUMNS[plane]):
        if column in table:
            readings[:, i] = table[column].to_numpy()[first:last]
            sampled = table[sampled_flag(column)].to_numpy()[first:last]
            measured[:, i] = np.where(sampled, readings[:, i], np.nan)
    inverse = np.linalg.inv(sensor)
    inputs = np.zeros((last - first, 3))
    for i, column in enumerate(CONTROL_COLUMNS[plane]):
        if column in table:
            inputs[:, i] = table[column].to_numpy()[first:last]
    inputs[:, 2] = table["rpm"].to_numpy()[first:last] / 60.0
    given = np.nan_to_num(readings) @ inverse.T
    return Record(
        maneuver.id, time[first:last], np.nan_to_num(inputs), given, measured,
        _state_at(trial, plane, int(first), inverse),
    )  # fmt: skip


def _state_at(trial: Trial, plane: Plane, row: int, inverse: Array) -> Array:
    """State at a row, from a line through the readings around it in the same record."""
    table = trial.table
    before, after = (round(s * trial.rate_hz) for s in (START_BEFORE_S, START_AFTER_S))
    rows = np.arange(max(row - before, 0), min(row + after + 1, len(table)))
    piece = table[RECORD_COLUMN].to_numpy()
    rows = rows[piece[rows] == piece[row]]
    reading = np.zeros(N_STATES)
    for i, column in enumerate(STATE_COLUMNS[plane]):
        if column not in table:
            continue
        values = table[column].to_numpy()[rows]
        good = np.isfinite(values)
        if good.sum() >= 3:
            reading[i] = np.polynomial.polynomial.polyfit(rows[good] - row, values[good], 1)[0]
        elif good.any():
            reading[i] = values[good][0]
    return inverse @ reading


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
