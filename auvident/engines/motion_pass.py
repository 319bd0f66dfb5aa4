"""The pass of an extended Kalman filter over one record: its motion, and forces that walk.

The model is known; what is followed is what the readings say beside it. The system is that of
`passes`, with one record and with forces in the place of the parameters; but it is linear about
the forces as they are at each step, which come and go and are no constants to be learned.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.engines.passes import (
    Logs,
    Parameters,
    PassInput,
    Sensors,
    ekf_work,
    predict_ekf,
    reading_work,
    row_work,
    take_readings,
)
from auvident.estimation.kalman import ProcessNoise
from auvident.estimation.smoother import Passed
from auvident.jit import borrowing, loop
from auvident.physics.actuation import FORCE
from auvident.physics.sensitivity import step_work, system_at
from auvident.physics.term_tables import N_INPUTS, N_STATES
from auvident.physics.terms import Equations

Array = npt.NDArray[Any]


def motion_pass(
    x: Array,
    P: Array,
    inputs: Array,
    measured_states: Array,
    z: Array,
    H: Array,
    R: Array,
    Q: Array,
    dt: float,
    p: Array,
    active: Array,
    equations: Equations,
) -> Passed | None:
    """What `estimation.smoother.smooth` takes; None where the motion could not be followed.

    Parameters
    ----------
    x : (m + k,) array
        Mean of the m active states, and of k forces on surge, sway and yaw [N, N, N m], at the
        first row.
    P : (m + k, m + k) array
        Its covariance.
    inputs : (n, 15) or, without forces, (n, 3) array
        The first k forces are those that are followed.
    measured_states : (n, 4) array
        Values of the inactive states.
    z : (n, 4) array
        Readings; NaN where there is none.
    H : (4, 4) array
        Readings by states.
    R : (4,) array
        Variance of the readings.
    Q : (m + k,) array
        Variance that a step adds.
    dt : float
        [s]
    p, active, equations :
        As `physics.dynamics.simulate_states` takes them.

    Returns
    -------
    Passed
        In the order of x.
    """
    n, size, n_x = len(z), len(x), int(np.count_nonzero(active))
    forces_first = np.roll(np.arange(size), size - n_x)  # the kernels have [forces, states]
    states_first = np.argsort(forces_first)
    data = _input_of(inputs, measured_states, z, H, R, Q[forces_first], dt, p, active, equations)
    means, covariances = np.empty((2, n, size)), np.zeros((3, n, size, size))
    passed = Passed(means[0], covariances[0], means[1], covariances[1], covariances[2])
    moving = np.zeros(N_INPUTS, dtype=np.bool_)
    moving[FORCE : FORCE + size - n_x] = True
    theta = data.parameters
    system, determinant = system_at(
        p, active, theta.column, theta.scale, moving, theta.input_columns, equations
    )
    if not determinant > 0.0:
        return None
    x, P, fault = x[forces_first], P[np.ix_(forces_first, forces_first)], np.zeros(4, np.int64)
    work = reading_work(data, size), row_work(data), step_work(1), ekf_work(data, size)
    _follow(x, P, data, system, *work, np.empty(data.logs.z.shape), passed, fault)
    if fault[3] > 0:
        return None
    return Passed(
        *(
            a[:, states_first] if a.ndim == 2 else a[:, states_first][:, :, states_first]
            for a in passed
        )
    )


def _input_of(
    inputs: Array,
    measured_states: Array,
    z: Array,
    H: Array,
    R: Array,
    Q: Array,
    dt: float,
    p: Array,
    active: Array,
    equations: Equations,
) -> PassInput:
    """The problem of `passes` with one record, and with forces as parameters that inputs follow."""
    n, n_x = len(z), int(np.count_nonzero(active))
    k = len(Q) - n_x
    slopes = np.zeros((1, n, N_INPUTS, k))
    slopes[:, :, FORCE : FORCE + k] = np.eye(k)
    none = np.zeros(0, dtype=np.int64)
    return PassInput(
        active,
        np.flatnonzero(active),
        Logs(
            np.array([n]),
            np.array(inputs)[None],
            slopes,
            np.ascontiguousarray(measured_states)[None],
            np.ascontiguousarray(z)[None],
            dt,
        ),
        Sensors(
            np.ones(N_STATES, dtype=np.bool_),
            H,
            R,
            np.zeros((1, 0, N_STATES)),
            np.zeros((1, n, N_STATES, 0)),
            none,
        ),
        Parameters(p, np.full(len(p), -1), np.ones(k), np.arange(k)),
        ProcessNoise(Q[:k], Q[k:]),
        equations,
    )


@loop
def _follow(x, P, data, system, reading, row, step, work, whitened, passed, fault):
    """Fill `passed`, or `fault` where the motion is lost."""
    _, index, logs, sensors, _, Q, _ = data
    mean, covariance, mean_predicted, covariance_predicted, F = passed
    n, n_forces, inputs, theta0 = logs.lengths[0], Q.theta.shape[0], logs.inputs, work.theta0
    for t in range(n):
        _keep(t, x, P, mean_predicted, covariance_predicted)
        take_readings(
            t, n_forces, x.shape[0], 0, x, P, index, logs, sensors, whitened, fault, reading
        )
        _keep(t, x, P, mean, covariance)
        if fault[3] > 0 or t == n - 1:
            break
        for c in range(n_forces):
            theta0[c] = x[c]
            inputs[0, t, FORCE + c] = x[c]
        predict_ekf(t, 1, x, P, index, logs, Q, system, row, step, work, fault)
        if fault[3] > 0:
            break
        _keep_transition(t, work.F, n_forces, F)


@borrowing
def _keep(t, x, P, mean, covariance):
    """Copy mean and covariance to row t."""
    for i in range(x.shape[0]):
        mean[t, i] = x[i]
        for c in range(x.shape[0]):
            covariance[t, i, c] = P[i, c]


@borrowing
def _keep_transition(t, rows, n_forces, F):
    """The whole derivative of a step, zeros before, from the rows that `kalman.predict` takes."""
    n_x = rows.shape[0]
    for c in range(n_forces):
        F[t, c, c] = 1.0
    for i in range(n_x):
        for c in range(n_forces):
            F[t, n_forces + i, c] = rows[i, n_x + c]
        for c in range(n_x):
            F[t, n_forces + i, n_forces + c] = rows[i, c]
