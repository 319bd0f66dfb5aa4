"""What the sensors read: from the states at the origin to the readings in the log.

The output side of the prediction. In the presence of a steady uniform current the equations of
motion hold for the velocity through the water, and the log over ground adds the current (Fossen
2021, 10.3); hence a current stands here, and one that changes slowly. The DVL measures at its own
position, in axes turned by its mounting angle. Readings may be late and off by a scale or a bias.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.physics.vector import values_of
from auvident.schema.artifacts import Sensing
from auvident.schema.coefficients import Plane

Array = npt.NDArray[Any]

N_CHANNELS = 4
# parameters in the order in which the functions take them
READING = (
    "current.north_mps",
    "current.east_mps",
    "dvl_misalignment.yaw_deg",
    "dvl_scale.fraction",
    "dvl_lever_arm.dx_m",
    "dvl_lever_arm.dy_m",
    "dvl_height.dz_m",
    "gyro_bias.bias_degps",
    "gyro_scale.fraction",
    "dvl_delay.delay_s",
    "gyro_delay.delay_s",
    "current_drift.north_early_mps_per_1000_s",
    "current_drift.east_early_mps_per_1000_s",
    "current_drift.north_late_mps_per_1000_s",
    "current_drift.east_late_mps_per_1000_s",
)
NORTH, EAST, YAW, SCALE, DX, DY, DZ, BIAS, GYRO_SCALE, DVL_DELAY, GYRO_DELAY = range(11)
EARLY, LATER = slice(11, 13), slice(13, 15)  # rates of the current, north and east
DRIFT_PERIOD_S = 1000.0  # the current changes by its rates in this time
ROLL_RATE, PITCH_RATE = range(2)


def reading_values(parameters: tuple[str, ...], p: Array) -> Array:
    """Values in the order of `READING` from a parameter vector; absent ones are zero."""
    return values_of(READING, parameters, p)


def sensor_matrix(plane: Plane, sensing: Sensing, e: Array | None = None) -> Array:
    """Readings (DVL u, DVL v or w, rate gyro, angle) as linear functions of the state.

    Theory 2.3: velocity of the DVL's position in the axes of the DVL, which is turned by the
    mounting angle (positive to starboard).

    Parameters
    ----------
    plane : str
    sensing : Sensing
    e : (15,) array, optional
        Effects in the order of `READING`.

    Returns
    -------
    (4, 4) array
        Reading = matrix @ (u, a, b, angle).
    """
    e = np.zeros(len(READING)) if e is None else e
    matrix = np.eye(N_CHANNELS)
    matrix[2, 2] = 1.0 + e[GYRO_SCALE]
    if plane == "vertical":
        matrix[0, 2], matrix[1, 2] = sensing.dvl_z_m, -sensing.dvl_x_m
        matrix[:2] *= 1.0 + e[SCALE]
        return matrix
    matrix[0, 2], matrix[1, 2] = -(sensing.dvl_y_m + e[DY]), sensing.dvl_x_m + e[DX]
    matrix[:2] = (1.0 + e[SCALE]) * _turn(sensing, e) @ matrix[:2]
    return matrix


def _turn(sensing: Sensing, e: Array) -> Array:
    """Rotation (2, 2) from vehicle axes to those of the DVL."""
    yaw = sensing.dvl_mounting_yaw_rad + e[YAW]
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, s], [-s, c]])


def current(e: Array, from_middle_s: Array) -> Array:
    """Velocity (n, 2) of the water, north and east, at times from the middle of the trial (n,).

    A current that changes over hours changes the motion through the water by nothing that
    matters: 0.2 m/s in 1000 s is 2e-4 m/s^2.
    """
    before, after = np.minimum(from_middle_s, 0.0), np.maximum(from_middle_s, 0.0)
    changed = np.outer(before, e[EARLY]) + np.outer(after, e[LATER])
    return np.asarray(e[[NORTH, EAST]] + changed / DRIFT_PERIOD_S)


def offsets(
    plane: Plane,
    sensing: Sensing,
    e: Array,
    angle: Array,
    rates: Array,
    from_middle_s: Array | None = None,
) -> Array:
    """Part (n, 4) of the readings that does not depend on velocities.

    Parameters
    ----------
    angle : (n,) array
        Heading.
    rates : (n, 2) array
        Roll and pitch rate, zero where not logged.
    from_middle_s : (n,) array, optional
        Time from the middle of the trial, which only a drifting current asks for.
    """
    out = np.zeros((len(angle), N_CHANNELS))
    out[:, 2] = e[BIAS]
    if plane == "vertical":
        return out
    if from_middle_s is None:
        from_middle_s = np.zeros(len(angle))
    water = current(e, from_middle_s)
    if e[DZ] == 0.0 and not water.any():
        return out
    ahead, aside = rates[:, PITCH_RATE] * e[DZ], -rates[:, ROLL_RATE] * e[DZ]
    if water.any():
        c, s = np.cos(angle), np.sin(angle)
        ahead = ahead + water[:, 0] * c + water[:, 1] * s
        aside = aside + water[:, 1] * c - water[:, 0] * s
    turn = (1.0 + e[SCALE]) * _turn(sensing, e)
    out[:, 0] = turn[0, 0] * ahead + turn[0, 1] * aside
    out[:, 1] = turn[1, 0] * ahead + turn[1, 1] * aside
    return out


def late(values: Array, e: Array, dt: float) -> Array:
    """Values (n, 4, ...) as the late sensors show them: those of a while ago.

    Linear between rows; before the first row the first one is held.
    """
    dvl, gyro = e[DVL_DELAY] / dt, e[GYRO_DELAY] / dt
    if dvl == 0.0 and gyro == 0.0:
        return values
    out = values.copy()
    if dvl != 0.0:
        out[:, :2] = _shifted(values[:, :2], dvl)
    if gyro != 0.0:
        out[:, 2] = _shifted(values[:, 2], gyro)
    return out


def _shifted(values: Array, steps: float) -> Array:
    n, whole = len(values), math.floor(steps)
    share = steps - whole
    rows = np.arange(n) - whole
    return (1.0 - share) * values[np.clip(rows, 0, n - 1)] + share * values[
        np.clip(rows - 1, 0, n - 1)
    ]


def unknown_rows(e: Array, n: int, dt: float) -> Array:
    """Rows (n, 4) whose late reading stems from before the first or after the last row."""
    rows = np.arange(n)[:, None]
    steps = np.array([e[DVL_DELAY], e[DVL_DELAY], e[GYRO_DELAY], 0.0]) / dt
    return (rows - steps < 0.0) | (rows - steps > n - 1.0)


def readings(
    plane: Plane,
    sensing: Sensing,
    e: Array,
    states: Array,
    angle: Array,
    rates: Array,
    dt: float,
    from_middle_s: Array | None = None,
) -> Array:
    """Readings (n, 4) of the states (n, 4); see `offsets` and `late` for the rest."""
    at_once = states @ sensor_matrix(plane, sensing, e).T
    return late(at_once + offsets(plane, sensing, e, angle, rates, from_middle_s), e, dt)


def states_behind(
    plane: Plane,
    sensing: Sensing,
    e: Array,
    measured: Array,
    rates: Array,
    dt: float,
    from_middle_s: Array | None = None,
) -> Array:
    """States (n, 4) that would give these readings: `readings` the other way round.

    Of the current, which is turned by the heading as read.
    """
    early = e.copy()
    early[DVL_DELAY], early[GYRO_DELAY] = -e[DVL_DELAY], -e[GYRO_DELAY]
    at_once = late(measured, early, dt)
    at_once = at_once - offsets(plane, sensing, e, measured[:, 3], rates, from_middle_s)
    return at_once @ np.linalg.inv(sensor_matrix(plane, sensing, e)).T
