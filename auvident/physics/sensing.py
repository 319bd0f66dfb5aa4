"""What the sensors read: from the states at the origin to the readings in the log.

The output side of the prediction. In the presence of a steady uniform current the equations of
motion hold for the velocity through the water, and the log over ground adds the current (Fossen
2021, 10.3); hence a current stands here, and one that changes slowly. The DVL measures at its own
position, in axes turned by its mounting angle. Readings may be late and off by a scale or a bias.
The depth is no state: its lag and scale stand in no reading, and only its log against the other
sensors tells of them.
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
    "vertical_current.down_mps",
    "dvl_pitch.pitch_deg",
    "dvl_lever_arm.dz_m",
    "q_bias.bias_degps",
    "q_scale.fraction",
    "pitch_bias.bias_deg",
    "pitch_scale.fraction",
    "depth_lag.lag_s",  # in no reading of a state: only the log of the depth shows these two
    "depth_scale.fraction",
)
NORTH, EAST, YAW, SCALE, DX, DY, DZ, BIAS, GYRO_SCALE, DVL_DELAY, GYRO_DELAY = range(11)
EARLY, LATER = slice(11, 13), slice(13, 15)  # rates of the current, north and east
DOWN, DVL_PITCH, BELOW, Q_BIAS, Q_SCALE, PITCH_BIAS, PITCH_SCALE = range(15, 22)
GYRO = {"horizontal": (BIAS, GYRO_SCALE), "vertical": (Q_BIAS, Q_SCALE)}  # that of the plane
DRIFT_PERIOD_S = 1000.0  # the current changes by its rates in this time
ROLL_RATE, PITCH_RATE = range(2)


def reading_values(parameters: tuple[str, ...], p: Array) -> Array:
    """Values in the order of `READING` from a parameter vector; absent ones are zero."""
    return values_of(READING, parameters, p)


def sensor_matrix(plane: Plane, sensing: Sensing, e: Array | None = None) -> Array:
    """Readings (DVL u, DVL v or w, rate gyro, angle) as linear functions of the state.

    Theory 2.3: velocity of the DVL's position in the axes of the DVL, which is turned by the
    mounting angle (positive to starboard; in the vertical plane bow up).

    Parameters
    ----------
    plane : str
    sensing : Sensing
    e : (24,) array, optional
        Effects in the order of `READING`.

    Returns
    -------
    (4, 4) array
        Reading = matrix @ (u, a, b, angle).
    """
    e = np.zeros(len(READING)) if e is None else e
    matrix = np.eye(N_CHANNELS)
    matrix[2, 2], matrix[3, 3] = 1.0 + e[GYRO[plane][1]], 1.0 + e[PITCH_SCALE]
    matrix[0, 2], matrix[1, 2] = -(sensing.dvl_y_m + e[DY]), sensing.dvl_x_m + e[DX]
    if plane == "vertical":
        matrix[0, 2], matrix[1, 2] = sensing.dvl_z_m + e[BELOW], -(sensing.dvl_x_m + e[DX])
    matrix[:2] = (1.0 + e[SCALE]) * _turn(plane, sensing, e) @ matrix[:2]
    return matrix


def _turn(plane: Plane, sensing: Sensing, e: Array) -> Array:
    """Rotation (2, 2) from vehicle axes to those of the DVL."""
    if plane == "vertical":  # from z, which points down, to x
        c, s = math.cos(e[DVL_PITCH]), math.sin(e[DVL_PITCH])
        return np.array([[c, -s], [s, c]])
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
    heading: Array | None = None,
) -> Array:
    """Part (n, 4) of the readings that does not depend on velocities.

    Parameters
    ----------
    angle : (n,) array
        Heading; in the vertical plane pitch.
    rates : (n, 2) array
        Roll and pitch rate, zero where not logged.
    from_middle_s : (n,) array, optional
        Time from the middle of the trial, which only a drifting current asks for.
    heading : (n,) array, optional
        In the vertical plane, where only a current over the ground asks for it.
    """
    out = np.zeros((len(angle), N_CHANNELS))
    out[:, 2], out[:, 3] = e[GYRO[plane][0]], e[PITCH_BIAS]
    if plane == "vertical":
        turn = (1.0 + e[SCALE]) * _turn(plane, sensing, e)
        out[:, :2] = water_in_vertical(e, angle, heading) @ turn.T
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
    turn = (1.0 + e[SCALE]) * _turn(plane, sensing, e)
    out[:, 0] = turn[0, 0] * ahead + turn[0, 1] * aside
    out[:, 1] = turn[1, 0] * ahead + turn[1, 1] * aside
    return out


def water_in_vertical(e: Array, pitch: Array, heading: Array | None) -> Array:
    """Velocity (n, 2) of the water ahead and below, in the axes of the vehicle."""
    if not e[[NORTH, EAST, DOWN]].any():
        return np.zeros((len(pitch), 2))
    ahead, c, s = np.zeros(len(pitch)), np.cos(pitch), np.sin(pitch)
    if heading is not None:
        ahead = e[NORTH] * np.cos(heading) + e[EAST] * np.sin(heading)
    return np.column_stack([ahead * c - e[DOWN] * s, ahead * s + e[DOWN] * c])


def water_by_pitch(sensing: Sensing, e: Array, pitch: Array, heading: Array | None) -> Array:
    """Slope (n, 2) by the pitch of what moving water adds to the DVL in the vertical plane."""
    ahead, below = water_in_vertical(e, pitch, heading).T
    turn = (1.0 + e[SCALE]) * _turn("vertical", sensing, e)
    return np.asarray(np.column_stack([-below, ahead]) @ turn.T)


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
    heading: Array | None = None,
) -> Array:
    """Readings (n, 4) of the states (n, 4); see `offsets` and `late` for the rest."""
    at_once = states @ sensor_matrix(plane, sensing, e).T
    return late(at_once + offsets(plane, sensing, e, angle, rates, from_middle_s, heading), e, dt)


def states_behind(
    plane: Plane,
    sensing: Sensing,
    e: Array,
    measured: Array,
    rates: Array,
    dt: float,
    from_middle_s: Array | None = None,
    heading: Array | None = None,
) -> Array:
    """States (n, 4) that would give these readings: `readings` the other way round.

    Of the current, which is turned by the angle as read, less its own errors.
    """
    early = e.copy()
    early[DVL_DELAY], early[GYRO_DELAY] = -e[DVL_DELAY], -e[GYRO_DELAY]
    at_once = late(measured, early, dt)
    angle = (measured[:, 3] - e[PITCH_BIAS]) / (1.0 + e[PITCH_SCALE])
    at_once = at_once - offsets(plane, sensing, e, angle, rates, from_middle_s, heading)
    return at_once @ np.linalg.inv(sensor_matrix(plane, sensing, e)).T
