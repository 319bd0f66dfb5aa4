"""What the sensors read: from the states at the origin to the readings in the log.

The output side of the prediction. In the presence of a steady uniform current the equations of
motion hold for the velocity through the water, and the log over ground adds the current (Fossen
2021, 10.3); hence a current stands here, and one that changes slowly. The DVL measures at its own
position, in axes turned by its mounting angle. Readings may be late and off by a scale or a bias.
The depth is no state: its lag and scale stand in no reading, and only its log against the other
sensors tells of them.

Equations of one moment take numbers or arrays: `readings` compiles them and goes through records.
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
NORTH_EARLY, EAST_EARLY, NORTH_LATE, EAST_LATE = range(11, 15)  # rates of the current
DOWN, DVL_PITCH, BELOW, Q_BIAS, Q_SCALE, PITCH_BIAS, PITCH_SCALE = range(15, 22)
DRIFT_PERIOD_S = 1000.0  # the current changes by its rates in this time
ROLL_RATE, PITCH_RATE = range(2)


def reading_values(parameters: tuple[str, ...], p: Array) -> Array:
    """Values in the order of `READING` from a parameter vector; absent ones are zero."""
    return values_of(READING, parameters, p)


def place_sensor(vertical: bool, mount: Array, e: Array, turn: Array, matrix: Array) -> None:
    """Fill the sensor matrix (4, 4), and the part (2, 2) of it that is the DVL's.

    Parameters
    ----------
    vertical : bool
        The plane.
    mount : (4,) array
        Position of the DVL [m] and its mounting angle to starboard [rad], see `mount_of`.
    e : (24,) array
        Effects in the order of `READING`.
    turn : (2, 2) array, filled
        From vehicle axes to those of the DVL, scaled as its readings are.
    matrix : (4, 4) array, filled
    """
    scale = 1.0 + e[SCALE]
    if vertical:  # from z, which points down, to x
        c, s = math.cos(e[DVL_PITCH]), -math.sin(e[DVL_PITCH])
        ahead, aside = mount[2] + e[BELOW], -(mount[0] + e[DX])
    else:
        yaw = mount[3] + e[YAW]
        c, s = math.cos(yaw), math.sin(yaw)
        ahead, aside = -(mount[1] + e[DY]), mount[0] + e[DX]
    turn[0, 0], turn[0, 1], turn[1, 0], turn[1, 1] = scale * c, scale * s, -scale * s, scale * c
    for i in range(N_CHANNELS):
        for j in range(N_CHANNELS):
            matrix[i, j] = 0.0
    for i in range(2):
        matrix[i, 0], matrix[i, 1] = turn[i, 0], turn[i, 1]
        matrix[i, 2] = turn[i, 0] * ahead + turn[i, 1] * aside
    matrix[2, 2] = 1.0 + (e[Q_SCALE] if vertical else e[GYRO_SCALE])
    matrix[3, 3] = 1.0 + e[PITCH_SCALE]


def water_over_ground(e: Array, from_middle: Any) -> tuple[Any, Any]:
    """Velocity of the water, north and east, at times from the middle of the trial."""
    before, after = np.minimum(from_middle, 0.0), np.maximum(from_middle, 0.0)
    north = e[NORTH] + (before * e[NORTH_EARLY] + after * e[NORTH_LATE]) / DRIFT_PERIOD_S
    east = e[EAST] + (before * e[EAST_EARLY] + after * e[EAST_LATE]) / DRIFT_PERIOD_S
    return north, east


def water_below(e: Array, along: Any, pitch: Any) -> tuple[Any, Any]:
    """Velocity of the water ahead and below, of which so much is along the heading."""
    c, s = np.cos(pitch), np.sin(pitch)
    return along * c - e[DOWN] * s, along * s + e[DOWN] * c


def water_along(e: Array, heading: Any) -> Any:
    """Velocity of a steady current along a heading."""
    return e[NORTH] * np.cos(heading) + e[EAST] * np.sin(heading)


def water_abreast(north: Any, east: Any, heading: Any) -> tuple[Any, Any]:
    """Velocity of the water ahead and to starboard."""
    c, s = np.cos(heading), np.sin(heading)
    return north * c + east * s, east * c - north * s


def is_known(k: Any, n: int, steps: Any) -> Any:
    """Whether a late reading stems from the rows of its record."""
    return (k - steps >= 0.0) & (k - steps <= n - 1.0)


def mount_of(sensing: Sensing) -> Array:
    """Position of the DVL [m] and its mounting angle [rad], as the kernels take them."""
    place = sensing.dvl_x_m, sensing.dvl_y_m, sensing.dvl_z_m
    return np.array([*place, sensing.dvl_mounting_yaw_rad])


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
    return _sensor(plane, sensing, np.zeros(len(READING)) if e is None else e)[1]


def _sensor(plane: Plane, sensing: Sensing, e: Array) -> tuple[Array, Array]:
    """What `place_sensor` fills."""
    turn, matrix = np.empty((2, 2)), np.empty((N_CHANNELS, N_CHANNELS))
    place_sensor(plane == "vertical", mount_of(sensing), e, turn, matrix)
    return turn, matrix


def current(e: Array, from_middle_s: Array) -> Array:
    """Velocity (n, 2) of the water, north and east, at times from the middle of the trial (n,).

    A current that changes over hours changes the motion through the water by nothing that
    matters: 0.2 m/s in 1000 s is 2e-4 m/s^2.
    """
    return np.column_stack(water_over_ground(e, from_middle_s))


def water_in_vertical(e: Array, pitch: Array, heading: Array | None) -> Array:
    """Velocity (n, 2) of the water ahead and below, in the axes of the vehicle."""
    if not e[[NORTH, EAST, DOWN]].any():
        return np.zeros((len(pitch), 2))
    along = 0.0 if heading is None else water_along(e, heading)
    return np.column_stack(water_below(e, along, pitch))


def water_by_pitch(sensing: Sensing, e: Array, pitch: Array, heading: Array | None) -> Array:
    """Slope (n, 2) by the pitch of what moving water adds to the DVL in the vertical plane."""
    ahead, below = water_in_vertical(e, pitch, heading).T
    turn, _ = _sensor("vertical", sensing, e)
    return np.asarray(np.column_stack([-below, ahead]) @ turn.T)


def unknown_rows(e: Array, n: int, dt: float) -> Array:
    """Rows (n, 4) whose late reading stems from before the first or after the last row."""
    rows, unknown = np.arange(n), np.zeros((n, N_CHANNELS), np.bool_)
    for channel, delay in enumerate((e[DVL_DELAY], e[DVL_DELAY], e[GYRO_DELAY])):
        if delay != 0.0:
            unknown[:, channel] = np.logical_not(is_known(rows, n, delay / dt))
    return unknown
