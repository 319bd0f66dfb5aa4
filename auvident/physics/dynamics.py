"""The one right-hand side, one step of it and the exact derivative of the step, compiled.

Simulation, EKF, UKF and residuals all evaluate the arrays of `terms.Structure`, so that compiled
code is cached once for every model: `batch` the rates, at one point or many, and `sensitivity` a
step with its derivative. Here are both for one state at a time.
States are (u, a, b, angle); a state that is not active is held at the value given, which is how
the surge system takes v and r from the measurements and the yaw-sway system takes u.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.jit import borrowing, kernel
from auvident.physics.batch import point_system, point_work, step_points
from auvident.physics.sensitivity import propagate_sensitivities, step_work, system_at
from auvident.physics.term_tables import LEAD, N_INPUTS, N_STATES, N_VELOCITIES
from auvident.physics.terms import Equations

Array = npt.NDArray[Any]

ALL_STATES = np.ones(N_STATES, dtype=bool)  # they move: none is taken as logged
SPEED_LIMIT = 1.0e3  # [m/s, rad/s] a velocity beyond this ran away, whatever the vehicle


@kernel
def _still():
    """No input depends on a free parameter."""
    return np.zeros(N_INPUTS, np.bool_)


@kernel
def step(x, inputs, inactive0, inactive1, dt, p, inverse, active, equations, out):
    """One RK4 step of the active states.

    Parameters
    ----------
    x : (4,) array
        u, a [m/s], b [rad/s], angle [rad].
    inputs : (15,) array
        Constant over the step: step means.
    inactive0, inactive1 : (4,) array
        Values of the inactive states at the beginning and the end of the step.
    dt : float
        [s]
    p : (n_parameters,) array
    inverse : (3, 3) array
        Inverse mass matrix from `inverse_mass`.
    active : (4,) bool array
    equations : terms.Equations
    out : (4,) array, filled
    """
    system = point_system(active, np.zeros(p.shape[0], np.bool_), _still(), equations)
    work = point_work(p, 1)
    for i in range(9):
        work.inverse[i, 0] = inverse[i // 3, i % 3]
    for i in range(N_STATES):
        out[i] = x[i]
    step_points(1, inputs, inactive0, inactive1, dt, system, work, out.reshape((N_STATES, 1)))
    for i in range(N_STATES):
        if not active[i]:
            out[i] = inactive1[i]


@kernel
def step_with_sensitivities(
    x,
    inputs,
    inactive0,
    inactive1,
    dt,
    p,
    active,
    equations,
    column,
    input_slopes,
    input_columns,
    s_x,
    out,
):
    """One RK4 step and the exact derivative of the step; arguments as of `step`.

    `input_slopes` (15, k) are the derivatives of the inputs by the free parameters
    `input_columns` (k,).

    `s_x` (4, 4 + n_free) comes in as d x/d(x_start, p_free) and leaves as the same after the
    step; with ``[I, 0]`` it returns the transition matrix and the parameter sensitivity.
    """
    scale, columns = np.ones(s_x.shape[1] - N_STATES), 1 + s_x.shape[1]
    moving = np.full(N_INPUTS, input_columns.shape[0] > 0)
    system, _ = system_at(p, active, column, scale, moving, input_columns, equations)
    z, reached = np.zeros((N_STATES, columns)), np.zeros((columns, N_STATES))
    for i in range(N_STATES):
        z[i, 0] = x[i]
        if active[i]:
            for c in range(s_x.shape[1]):
                z[i, 1 + c] = s_x[i, c]
    propagate_sensitivities(
        z, inputs, inactive0, inactive1, dt, input_slopes, system, step_work(columns), reached
    )
    for i in range(N_STATES):
        out[i] = z[i, 0]
        if active[i]:
            for c in range(s_x.shape[1]):
                s_x[i, c] = z[i, 1 + c]


@kernel
def _ran_away(x):
    """Whether a velocity of x (4, >= 1) is not finite or beyond any vehicle's."""
    for i in range(N_VELOCITIES):  # noqa: SIM110 (compiled: no generator)
        if not abs(x[i, 0]) < SPEED_LIMIT:
            return True
    return False


@kernel
def _moving(input_slopes):
    """Inputs (15,) that have a slope anywhere; only the first ones may be given."""
    moving = np.zeros(N_INPUTS, np.bool_)
    for i in range(input_slopes.shape[1]):
        for k in range(input_slopes.shape[0]):
            for c in range(input_slopes.shape[2]):
                if input_slopes[k, i, c] != 0.0:
                    moving[i] = True
                    break
            if moving[i]:
                break
    return moving


@kernel
def simulate_with_sensitivities(
    x0,
    inputs,
    input_slopes,
    input_columns,
    measured_states,
    gain,
    dt,
    p,
    active,
    equations,
    column,
    scale,
    z,
):
    """States over a whole record with their derivatives by the start and the free parameters.

    Parameters
    ----------
    x0 : (4,) array
    inputs : (n, 15) or (n, 3) array
    input_slopes : (n, l, k) array
        Derivatives of the first l inputs by the parameters in the columns `input_columns` (k,),
        counted among the free ones; in units of `scale`.
    measured_states : (n, 4) array
        Values of the inactive states; of the active ones where the gain pulls them.
    gain : (4,) array
        Observer gain: share of the distance to the measured value that each active state is moved
        by after every step. Zero runs free.
    dt : float
        [s]
    p : (n_parameters,) array
    active : (4,) bool array
    equations : terms.Equations
    column : (n_parameters,) int array
        Column of each parameter among the free ones, or -1.
    scale : (n_free,) array
        Unit of each free parameter.
    z : (n, 4, 1 + 4 + n_free) array, filled
        State, its derivatives by the start state, by the free parameters; not touched from the
        row on at which the simulation ran away.

    Returns
    -------
    bool
        False when the simulation ran away or the mass matrix is not positive definite.
    """
    moving = _moving(input_slopes)
    system, determinant = system_at(p, active, column, scale, moving, input_columns, equations)
    if not determinant > 0.0:
        return False
    now, reached = np.zeros((N_STATES, z.shape[2])), np.zeros((z.shape[2], N_STATES))
    for i in range(N_STATES):
        now[i, 0] = x0[i]
        if active[i]:
            now[i, 1 + i] = 1.0
    work = step_work(z.shape[2])
    return _simulate(inputs, input_slopes, measured_states, gain, dt, system, work, now, reached, z)


@borrowing
def _simulate(inputs, input_slopes, measured_states, gain, dt, system, work, now, reached, z):
    """Fill z from the start in `now` (4, 5 + n_free); False where the simulation ran away."""
    active = system.active
    _keep(now, 0, z)
    for k in range(inputs.shape[0] - 1):
        propagate_sensitivities(
            now,
            inputs[k],
            measured_states[k],
            measured_states[k + 1],
            dt,
            input_slopes[k],
            system,
            work,
            reached,
        )
        if _ran_away(now):
            return False
        for i in range(N_STATES):
            if active[i] and gain[i] > 0.0:
                now[i, 0] += gain[i] * (measured_states[k + 1, i] - now[i, 0])
                for c in range(1, now.shape[1]):
                    now[i, c] *= 1.0 - gain[i]
        _keep(now, k + 1, z)
    return True


@borrowing
def _keep(now, k, z):
    """Copy the state and its derivatives to row k of z."""
    for i in range(now.shape[0]):
        for c in range(now.shape[1]):
            z[k, i, c] = now[i, c]


def simulate_states(
    x0: Array,
    inputs: Array,
    measured_states: Array,
    dt: float,
    p: Array,
    active: Array,
    equations: Equations,
) -> Array:
    """States over a whole record from its initial state and inputs alone.

    Parameters
    ----------
    x0 : (4,) array
    inputs : (n, 15) or (n, 3) array
    measured_states : (n, 4) array
        Values of the inactive states (ignored for active ones).
    dt, p, active, equations :
        As `simulate_with_sensitivities` takes them.

    Returns
    -------
    (n, 4) array
        NaN from the row on at which the simulation ran away; all NaN when the mass matrix is
        not positive definite.
    """
    z = np.full((len(inputs), N_STATES, LEAD), np.nan)
    simulate_with_sensitivities(
        x0,
        inputs,
        np.zeros((len(inputs), N_INPUTS, 0)),
        np.zeros(0, dtype=np.int64),
        measured_states,
        np.zeros(N_STATES),
        dt,
        p,
        active,
        equations,
        np.full(len(p), -1),
        np.zeros(0),
        z,
    )
    states: Array = z[:, :, 0].copy()
    return states
