"""Motion of the whole vehicle: right-hand side, step and simulation, compiled.

State (13): u v w [m/s], p q r [rad/s], attitude as a unit quaternion (e0, e1, e2, e3) from body to
north-east-down, north east depth [m]. A quaternion, because no attitude is singular (a vehicle
with little righting moment may stand on its tail), and because gravity in body axes, all that the
forces need of the attitude, is a polynomial of it; `angles_of` gives roll, pitch and heading.

Inputs, held over a step: rudder, elevator [rad], propeller rate [rev/s], factor on the thrust;
then, where effects need them, the thrust [N] and the part of a change of weight that has been made.
The velocities are through the water, and so is the track.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from auvident.errors import NumericsError
from auvident.jit import kernel
from auvident.physics.batch import ADVANCE, N_POINTS, SHARE, place_powers
from auvident.physics.dynamics import SPEED_LIMIT
from auvident.physics.six_dof_terms import AXES, INPUTS, VARIABLES, VELOCITIES, SixDofStructure
from auvident.physics.term_tables import N_POWERS
from auvident.physics.terms import POWER_OF

Array = npt.NDArray[Any]

N_STATES, N_VELOCITIES, N_INPUTS = 13, len(VELOCITIES), len(INPUTS)
ATTITUDE, POSITION = slice(6, 10), slice(10, 13)
N_VARIABLES = len(VARIABLES)
ONE = N_VARIABLES * N_POWERS  # place of the factor 1, after the powers of all variables
FIRST_INPUT = N_VARIABLES - N_INPUTS
VW, QR, SIN, SIDE, COS, HEADING_SIN, HEADING_COS, ROLL_ANGLE, PITCH_ANGLE, DEPTH = range(
    N_VELOCITIES, FIRST_INPUT
)
# of a step of the log: the roll of a vehicle of the size of REMUS swings at 5 rad/s
SUBSTEPS = 2


class SixDofSystem(NamedTuple):
    """The equations at one parameter vector, as the kernels take them.

    Attributes
    ----------
    equation : (n,) int array
        Equation of each term.
    places : (n, 4) int array
        Places of its factors among the powers of the variables.
    size : (n,) array
        Weight times parameter.
    inverse : (6, 6) array
        Inverse mass matrix; zero in the rows and columns of velocities that are held.
    """

    equation: Array
    places: Array
    size: Array
    inverse: Array


def system_of(
    structure: SixDofStructure, p: Array, active: tuple[str, ...] = VELOCITIES
) -> SixDofSystem:
    """The equations at a parameter vector.

    Parameters
    ----------
    structure : SixDofStructure
    p : (n_parameters,) array
    active : tuple of str
        Velocities that move, the others stay as they are: u, v and r fly the horizontal plane.

    Raises
    ------
    NumericsError
        The mass matrix is not positive definite.
    """
    used = np.flatnonzero(p[structure.terms[:, 1]] != 0.0)
    terms = structure.terms[used]
    variables, powers = terms[:, 2::2], terms[:, 3::2]
    return SixDofSystem(
        terms[:, 0].copy(),
        np.where(powers >= 0, variables * N_POWERS + powers, ONE),
        structure.weights[used] * p[terms[:, 1]],
        _inverse(mass_matrix(structure, p), active),
    )


def mass_matrix(structure: SixDofStructure, p: Array) -> Array:
    """Mass matrix (6, 6) of rigid body and added mass."""
    mass = np.zeros((N_VELOCITIES, N_VELOCITIES))
    rows, columns, parameters = structure.mass.T
    np.add.at(mass, (rows, columns), structure.mass_weights * p[parameters])
    return mass


def _inverse(mass: Array, active: tuple[str, ...]) -> Array:
    """Inverse among the active velocities, zero elsewhere."""
    on = [VELOCITIES.index(name) for name in active]
    kept = mass[np.ix_(on, on)]
    if not np.linalg.eigvalsh(0.5 * (kept + kept.T)).min(initial=np.inf) > 0.0:
        weak = [AXES[i] for i in on if not mass[i, i] > 0.0]
        raise NumericsError(
            "the mass matrix of six degrees of freedom is not positive definite",
            ", ".join(weak),
            "The added masses are too large or of the wrong sign: see the coefficients that end "
            "in dot.",
        )
    inverse = np.zeros_like(mass)
    inverse[np.ix_(on, on)] = np.linalg.inv(kept)
    return inverse


@kernel
def _place_attitude(x, value):
    """Direction of gravity in body axes (third row of the rotation matrix), angles, depth."""
    a, b, c, d = x[6], x[7], x[8], x[9]
    heading = math.atan2(2.0 * (b * c + a * d), 1.0 - 2.0 * (c * c + d * d))
    place_powers(HEADING_SIN, math.sin(heading), value)
    place_powers(HEADING_COS, math.cos(heading), value)
    place_powers(DEPTH, x[12], value)
    sine = 2.0 * (a * c - b * d)
    side, cosine = 2.0 * (c * d + a * b), a * a - b * b - c * c + d * d
    place_powers(SIN, sine, value)
    place_powers(SIDE, side, value)
    place_powers(COS, cosine, value)
    place_powers(ROLL_ANGLE, math.atan2(side, cosine), value)
    place_powers(PITCH_ANGLE, math.asin(min(max(sine, -1.0), 1.0)), value)


@kernel
def six_dof_rates(x, system, value, force, out):
    """Time derivative (13,) of the state; the inputs are placed in `value` already."""
    for i in range(N_VELOCITIES):
        place_powers(i, x[i], value)
        force[i] = 0.0
    place_powers(VW, math.sqrt(x[1] * x[1] + x[2] * x[2]), value)
    place_powers(QR, math.sqrt(x[4] * x[4] + x[5] * x[5]), value)
    _place_attitude(x, value)
    equation, places, size = system.equation, system.places, system.size
    for k in range(size.shape[0]):
        f = size[k] * value[places[k, 0]] * value[places[k, 1]]
        force[equation[k]] += f * value[places[k, 2]] * value[places[k, 3]]
    for i in range(N_VELOCITIES):
        out[i] = 0.0
        for j in range(N_VELOCITIES):
            out[i] += system.inverse[i, j] * force[j]
    _kinematics(x, out)


@kernel
def _kinematics(x, out):
    """Rates of attitude and position (Fossen 2011, eqs. 2.60 and 2.67)."""
    u, v, w, p, q, r = x[0], x[1], x[2], x[3], x[4], x[5]
    a, b, c, d = x[6], x[7], x[8], x[9]
    out[6] = 0.5 * (-b * p - c * q - d * r)
    out[7] = 0.5 * (a * p - d * q + c * r)
    out[8] = 0.5 * (d * p + a * q - b * r)
    out[9] = 0.5 * (-c * p + b * q + a * r)
    out[10] = (1.0 - 2.0 * (c * c + d * d)) * u + 2.0 * (b * c - a * d) * v
    out[10] += 2.0 * (b * d + a * c) * w
    out[11] = 2.0 * (b * c + a * d) * u + (1.0 - 2.0 * (b * b + d * d)) * v
    out[11] += 2.0 * (c * d - a * b) * w
    out[12] = 2.0 * (b * d - a * c) * u + 2.0 * (c * d + a * b) * v
    out[12] += (1.0 - 2.0 * (b * b + c * c)) * w


@kernel
def six_dof_step(x, inputs, dt, system, value, work):
    """One RK4 step of the state x (13,) in place; work (4, 13)."""
    for i in range(inputs.shape[0]):
        place_powers(FIRST_INPUT + i, inputs[i], value)
    stage, rate, total, force = work[0], work[1], work[2], work[3]
    for i in range(N_STATES):
        stage[i], total[i] = x[i], 0.0
    for node in range(N_POINTS):
        six_dof_rates(stage, system, value, force, rate)
        ahead = dt * ADVANCE[node]
        for i in range(N_STATES):
            total[i] += SHARE[node] * rate[i]
            stage[i] = x[i] + ahead * rate[i]
    for i in range(N_STATES):
        x[i] += dt / 6.0 * total[i]
    length = math.sqrt(x[6] * x[6] + x[7] * x[7] + x[8] * x[8] + x[9] * x[9])
    for i in range(6, 10):
        x[i] /= length


@kernel
def _workspace():
    """Powers with the factor 1 at their end, and rows for a step."""
    value = np.zeros(ONE + 1)
    value[ONE] = 1.0
    return value, np.zeros((4, N_STATES))


@kernel
def fly(x0, inputs, dt, substeps, system, out):
    """States over a whole record from the first one and the inputs alone.

    Parameters
    ----------
    x0 : (13,) array
    inputs : (n, 4) or (n, 12) array
        Held until the next row.
    dt : float
        [s]
    substeps : int
    system : SixDofSystem
    out : (n, 13) array, filled
        Not touched from the row on at which the simulation ran away.

    Returns
    -------
    bool
        False when it ran away.
    """
    value, work = _workspace()
    x = x0.copy()
    for i in range(N_STATES):
        out[0, i] = x[i]
    for k in range(inputs.shape[0] - 1):
        for _ in range(substeps):
            six_dof_step(x, inputs[k], dt / substeps, system, value, work)
        for i in range(N_VELOCITIES):
            if not abs(x[i]) < SPEED_LIMIT:
                return False
        for i in range(N_STATES):
            out[k + 1, i] = x[i]
    return True


def simulate_six_dof(
    x0: Array, inputs: Array, dt: float, system: SixDofSystem, substeps: int = SUBSTEPS
) -> Array:
    """States (n, 13) over a record, NaN from where the simulation ran away; see `fly`."""
    out = np.full((len(inputs), N_STATES), np.nan)
    fly(np.asarray(x0, float), np.asarray(inputs, float), dt, substeps, system, out)
    return out


def rates_six_dof(x: Array, inputs: Array, system: SixDofSystem) -> Array:
    """Time derivative (13,) of a state under inputs (4,)."""
    value, work = _workspace()
    for i, y in enumerate(inputs):
        place_powers(FIRST_INPUT + i, float(y), value)
    out = np.zeros(N_STATES)
    six_dof_rates(np.asarray(x, float), system, value, work[3], out)
    return out


def variables_of(velocities: Array, angles: Array, inputs: Array) -> Array:
    """Variables (n, k) of the terms along a log: velocities (n, 6), roll and pitch (n, 2), inputs.

    Rudder, elevator and propeller rate are the inputs (n, 3); no effects act, and what goes with
    heading and depth is zero.
    """
    _, v, w, _, q, r = velocities.T
    roll, pitch = angles.T
    return np.column_stack(
        [
            velocities,
            np.hypot(v, w),
            np.hypot(q, r),
            np.sin(pitch),
            np.cos(pitch) * np.sin(roll),
            np.cos(pitch) * np.cos(roll),
            np.zeros((len(velocities), 2)),
            angles,
            np.zeros(len(velocities)),
            inputs,
            np.ones(len(velocities)),
            np.zeros((len(velocities), N_INPUTS - 4)),
        ]
    )


def balance(structure: SixDofStructure, axis: str, variables: Array, accelerations: Array) -> Array:
    """What each parameter is multiplied by in one equation, inertia less forces (n, n_parameters).

    Multiplied with the parameters it is zero where the equation holds: for regression along a log.
    """
    out = np.zeros((len(variables), len(structure.parameters)))
    powers = np.stack([of(variables) for of in POWER_OF.values()])
    equation = AXES.index(axis)
    for term, weight in zip(structure.terms, structure.weights, strict=True):
        if term[0] == equation:
            pairs = zip(term[2::2], term[3::2], strict=True)
            factors = [powers[power, :, variable] for variable, power in pairs if power >= 0]
            out[:, term[1]] -= weight * np.prod(factors, axis=0)
    for (row, column, parameter), weight in zip(
        structure.mass, structure.mass_weights, strict=True
    ):
        if row == equation:
            out[:, parameter] += weight * accelerations[:, column]
    return out


def quaternion(roll: float, pitch: float, heading: float) -> Array:
    """Unit quaternion (4,) of roll, pitch and heading [rad] (Fossen 2011, eq. 2.72)."""
    (cr, sr), (cp, sp), (ch, sh) = (
        (math.cos(0.5 * angle), math.sin(0.5 * angle)) for angle in (roll, pitch, heading)
    )
    return np.array(
        [
            cr * cp * ch + sr * sp * sh,
            sr * cp * ch - cr * sp * sh,
            cr * sp * ch + sr * cp * sh,
            cr * cp * sh - sr * sp * ch,
        ]
    )


def angles_of(attitude: Array) -> Array:
    """Roll, pitch and heading (n, 3) [rad] of quaternions (n, 4); roll and heading unwrapped."""
    a, b, c, d = np.atleast_2d(attitude).T
    roll = np.arctan2(2.0 * (c * d + a * b), 1.0 - 2.0 * (b * b + c * c))
    pitch = np.arcsin(np.clip(2.0 * (a * c - b * d), -1.0, 1.0))
    heading = np.arctan2(2.0 * (b * c + a * d), 1.0 - 2.0 * (c * c + d * d))
    angles = np.column_stack([roll, pitch, heading])
    there = np.isfinite(angles).all(axis=1)
    angles[there] = np.unwrap(angles[there], axis=0)
    return angles


def state_of(velocities: Array, angles: Array, position: Array | None = None) -> Array:
    """State (13,) of velocities (6,), roll, pitch and heading (3,), and position (3,)."""
    place = np.zeros(3) if position is None else np.asarray(position, float)
    return np.concatenate([velocities, quaternion(*angles), place])
