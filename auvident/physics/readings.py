"""The readings of whole records: the equations of `sensing`, compiled, and the way back."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.jit import borrowing, kernel
from auvident.physics import sensing
from auvident.physics.sensing import (
    BIAS,
    DVL_DELAY,
    DZ,
    EAST,
    EAST_EARLY,
    EAST_LATE,
    GYRO_DELAY,
    N_CHANNELS,
    NORTH,
    NORTH_EARLY,
    NORTH_LATE,
    PITCH_BIAS,
    PITCH_RATE,
    PITCH_SCALE,
    Q_BIAS,
    ROLL_RATE,
    mount_of,
)
from auvident.schema.artifacts import Sensing
from auvident.schema.coefficients import Plane

Array = npt.NDArray[Any]

NOWHERE = np.zeros(0, dtype=np.int64)

_place_sensor = kernel(sensing.place_sensor)
_over_ground = kernel(sensing.water_over_ground)
_below = kernel(sensing.water_below)
_along = kernel(sensing.water_along)
_abreast = kernel(sensing.water_abreast)
known_row = kernel(sensing.is_known)


@borrowing
def _water(vertical, e, angle, from_middle, heading, k):
    """Velocity of the water in row k in the axes of the vehicle."""
    if vertical:
        return _below(e, _along(e, heading[k]) if heading.shape[0] > 0 else 0.0, angle)
    north, east = _over_ground(e, from_middle[k] if from_middle.shape[0] > 0 else 0.0)
    if north == 0.0 and east == 0.0:
        return 0.0, 0.0
    return _abreast(north, east, angle)


@borrowing
def add_offsets(vertical, turn, e, angle, rates, from_middle, heading, out):
    """Add the part of the readings that does not depend on velocities; see `offsets`.

    Times (0,) and a heading (0,) are none.
    """
    bias, height = e[Q_BIAS] if vertical else e[BIAS], 0.0 if vertical else e[DZ]
    still = not vertical and height == 0.0
    for i in (NORTH, EAST, NORTH_EARLY, EAST_EARLY, NORTH_LATE, EAST_LATE):
        still = still and e[i] == 0.0
    for k in range(out.shape[0]):
        if not still:
            ahead, aside = _water(vertical, e, angle[k], from_middle, heading, k)
            ahead += rates[k, PITCH_RATE] * height
            aside -= rates[k, ROLL_RATE] * height
            out[k, 0] += turn[0, 0] * ahead + turn[0, 1] * aside
            out[k, 1] += turn[1, 0] * ahead + turn[1, 1] * aside
        out[k, 2] += bias
        out[k, 3] += e[PITCH_BIAS]


@borrowing
def rows_of(k, n, steps):
    """Rows of n that a reading so many steps late lies between, and the share of the second."""
    whole = math.floor(steps)
    row = k - int(whole)
    return min(max(row, 0), n - 1), min(max(row - 1, 0), n - 1), steps - whole


@borrowing
def _late(values, dvl, gyro, out):
    """Values (n, 4) as sensors show them that are so many steps late."""
    n = values.shape[0]
    for i in range(N_CHANNELS):
        steps = dvl if i < 2 else (gyro if i == 2 else 0.0)
        for k in range(n):
            row, before, share = rows_of(k, n, steps)
            out[k, i] = values[row, i]
            if share != 0.0:
                out[k, i] = (1.0 - share) * values[row, i] + share * values[before, i]


@kernel
def _read(vertical, mount, e, states, angle, rates, dt, from_middle, heading, work, out):
    """Readings of the states; see `readings`. `work` is of the shape of `out`."""
    turn, matrix = np.empty((2, 2)), np.empty((N_CHANNELS, N_CHANNELS))
    _place_sensor(vertical, mount, e, turn, matrix)
    late = e[DVL_DELAY] != 0.0 or e[GYRO_DELAY] != 0.0
    into = work if late else out
    for k in range(out.shape[0]):
        for i in range(N_CHANNELS):
            total = 0.0
            for j in range(N_CHANNELS):
                total += matrix[i, j] * states[k, j]
            into[k, i] = total
    add_offsets(vertical, turn, e, angle, rates, from_middle, heading, into)
    if late:
        _late(into, e[DVL_DELAY] / dt, e[GYRO_DELAY] / dt, out)


@kernel
def read_steps(
    vertical, mount, e, places, steps, over, states, angle, rates, dt, from_middle, heading,
    out, slopes,
):  # fmt: skip
    """Readings, and their slopes by differences, one effect moved at a time.

    Parameters
    ----------
    vertical, mount, e :
        See `place_sensor`.
    places : (k,) int array
        Of the effects to move.
    steps : (k,) array
        How far each is moved.
    over : float
        What the differences are divided by.
    states, angle, rates, dt, from_middle, heading :
        See `readings`; times (0,) and a heading (0,) are none.
    out : (n, 4) array, filled
    slopes : (n, 4, k) array, filled
    """
    work = np.empty(out.shape)
    args = (states, angle, rates, dt, from_middle, heading, work)
    _read(vertical, mount, e, *args, out)
    there, moved = np.empty(out.shape), e.copy()
    for j in range(places.shape[0]):
        moved[places[j]] += steps[j]
        _read(vertical, mount, moved, *args, there)
        moved[places[j]] = e[places[j]]
        for k in range(out.shape[0]):
            for i in range(N_CHANNELS):
                slopes[k, i, j] = (there[k, i] - out[k, i]) / over


@kernel
def place_behind(vertical, mount, e, measured, rates, dt, from_middle, heading, out):
    """States (n, 4) that would give these readings; see `states_behind`."""
    n, turn, matrix = out.shape[0], np.empty((2, 2)), np.empty((N_CHANNELS, N_CHANNELS))
    _place_sensor(vertical, mount, e, turn, matrix)
    at_once, offset, angle = np.empty((n, 4)), np.zeros((n, 4)), np.empty(n)
    _late(measured, -e[DVL_DELAY] / dt, -e[GYRO_DELAY] / dt, at_once)
    for k in range(n):
        angle[k] = (measured[k, 3] - e[PITCH_BIAS]) / (1.0 + e[PITCH_SCALE])
    add_offsets(vertical, turn, e, angle, rates, from_middle, heading, offset)
    determinant = turn[0, 0] * turn[1, 1] - turn[0, 1] * turn[1, 0]
    for k in range(n):
        b = (at_once[k, 2] - offset[k, 2]) / matrix[2, 2]
        ahead = at_once[k, 0] - offset[k, 0] - matrix[0, 2] * b
        aside = at_once[k, 1] - offset[k, 1] - matrix[1, 2] * b
        out[k, 0] = (turn[1, 1] * ahead - turn[0, 1] * aside) / determinant
        out[k, 1] = (turn[0, 0] * aside - turn[1, 0] * ahead) / determinant
        out[k, 2], out[k, 3] = b, (at_once[k, 3] - offset[k, 3]) / matrix[3, 3]


@kernel
def place_start(vertical, mount, e, begun, start, rates, dt, from_middle, heading, out):
    """Where a record begins (4,) that began at `begun` without effects; see `start_behind`."""
    none, here, without = np.zeros(e.shape[0]), np.empty((1, 4)), np.empty((1, 4))
    place_behind(vertical, mount, e, start, rates, dt, from_middle, heading, here)
    place_behind(vertical, mount, none, start, rates, dt, from_middle, heading, without)
    for i in range(out.shape[0]):
        out[i] = begun[i] + here[0, i] - without[0, i]


# --- what Python calls ---------------------------------------------------------------------


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
    still = np.zeros((len(angle), N_CHANNELS))
    at_once = e.copy()
    at_once[[DVL_DELAY, GYRO_DELAY]] = 0.0
    return readings(plane, sensing, at_once, still, angle, rates, 1.0, from_middle_s, heading)


def late(values: Array, e: Array, dt: float) -> Array:
    """Values (n, 4) as the late sensors show them: those of a while ago.

    Linear between rows; before the first row the first one is held.
    """
    out = np.empty(values.shape)
    _late(np.ascontiguousarray(values), e[DVL_DELAY] / dt, e[GYRO_DELAY] / dt, out)
    return out


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
    args = (states, angle, rates, dt, from_middle_s, heading)
    return readings_with_steps(plane, sensing, e, NOWHERE, np.zeros(0), 1.0, *args)[0]


def readings_with_steps(
    plane: Plane,
    sensing: Sensing,
    e: Array,
    places: Array,
    steps: Array,
    over: float,
    states: Array,
    angle: Array,
    rates: Array,
    dt: float,
    from_middle_s: Array | None = None,
    heading: Array | None = None,
) -> tuple[Array, Array]:
    """Readings (n, 4), and their slopes (n, 4, k) by differences; see `read_steps`."""
    n, k = len(states), len(places)
    out, slopes = np.empty((n, N_CHANNELS)), np.empty((n, N_CHANNELS, k))
    read_steps(
        plane == "vertical",
        mount_of(sensing),
        e,
        places,
        steps,
        over,
        np.ascontiguousarray(states),
        np.ascontiguousarray(angle),
        np.ascontiguousarray(rates),
        dt,
        _or_none(from_middle_s),
        _or_none(heading),
        out,
        slopes,
    )
    return out, slopes


def _or_none(values: Array | None) -> Array:
    """A series as the kernels take it, (0,) where there is none."""
    return np.zeros(0) if values is None else np.ascontiguousarray(values)


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
    out = np.empty((len(measured), N_CHANNELS))
    place_behind(
        plane == "vertical",
        mount_of(sensing),
        e,
        np.ascontiguousarray(measured),
        np.ascontiguousarray(rates),
        dt,
        _or_none(from_middle_s),
        _or_none(heading),
        out,
    )
    return out


def start_behind(
    plane: Plane,
    sensing: Sensing,
    e: Array,
    begun: Array,
    start: Array,
    rates: Array,
    dt: float,
    from_middle_s: Array | None = None,
    heading: Array | None = None,
) -> Array:
    """State (4,) where a record begins, as the effects move it; see `states_behind`.

    Parameters
    ----------
    begun : (4,) array
        State where it begins without effects.
    start : (4,) array
        Readings there.
    rates, from_middle_s, heading : (n, 2), (n,), (n,) array
        Of the whole record; the first row counts.
    """
    out = np.empty(N_CHANNELS)
    place_start(
        plane == "vertical",
        mount_of(sensing),
        e,
        begun,
        np.ascontiguousarray(start)[None],
        np.ascontiguousarray(rates[:1]),
        dt,
        _or_none(from_middle_s)[:1],
        _or_none(heading)[:1],
        out,
    )
    return out
