"""What one filter pass takes and returns, the same for every engine."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from auvident.errors import NumericsError
from auvident.physics.dynamics import N_STATES
from auvident.physics.term_tables import N_INPUTS
from auvident.physics.terms import Structure

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Records:
    """Maneuvers side by side, longest first, padded with NaN to one length.

    Attributes
    ----------
    ids : tuple of str
        Maneuver ids.
    lengths : (k,) int array
        Samples of each, descending.
    inputs : (k, n, 3) array
        Own control angle, other control angle [rad], propeller rate [rev/s]; step means.
    given : (k, n, 4) array
        u, a, b, angle at the origin from the measurements, gaps bridged; used where inactive.
    measured : (k, n, 4) array
        Sensor readings of the same four; NaN where no sample stands behind the row.
    dt_s : float
    """

    ids: tuple[str, ...]
    lengths: npt.NDArray[np.int64]
    inputs: Array
    given: Array
    measured: Array
    dt_s: float


@dataclass(frozen=True)
class Linear:
    """Inputs and readings to first order in the free parameters, records as in `Records`.

    Attributes
    ----------
    input_columns : (a,) int array
        Free parameters that the inputs depend on.
    input_slopes : (k, n, 15, a) array
        In units of the free parameters' scale.
    offset : (k, n, 4) array
        Reading = sensor @ state + offset + slopes @ theta.
    reading_columns : (b,) int array
        Free parameters that the readings depend on.
    reading_slopes : (k, n, 4, b) array
    """

    input_columns: npt.NDArray[np.int64]
    input_slopes: Array
    offset: Array
    reading_columns: npt.NDArray[np.int64]
    reading_slopes: Array


def no_effects(k: int) -> Linear:
    """The `Linear` of a problem whose inputs and readings depend on no parameter."""
    none = np.zeros(0, dtype=np.int64)
    return Linear(
        none, np.zeros((k, 0, N_INPUTS, 0)), np.zeros((k, 0, 4)), none, np.zeros((k, 0, 4, 0))
    )


@dataclass(frozen=True)
class FilterProblem:
    """One pass of a filter over all records of a stage in one augmented state.

    Attributes
    ----------
    structure : Structure
    records : Records
    parameters : (n_parameters,) array
        Parameter vector at the start of the pass.
    free : (n_free,) int array
        Positions in the parameter vector that the filter estimates.
    followers : (m, 2) int array
        (position, position of the free parameter it follows): moves by the same amount.
    scale : (n_free,) array
        Unit of each free parameter inside the filter (its prior standard deviation).
    theta_covariance : (n_free, n_free) array
        Covariance at the start, in units of `scale`.
    theta_noise : (n_free,) array
        Variance added per step, in units of scale squared (the method's tuning factors).
    active : (4,) bool array
        States the system estimates; the others are given.
    channels : (4,) bool array
        Measured channels it uses.
    sensor : (4, 4) array
        Reading = sensor @ state.
    process_std : (4,) array
        Process noise of each state, per square root of a second.
    sensor_std : (4,) array
        Measurement noise of each channel.
    start : (k, 4) array
        Initial states.
    start_std : (4,) array
        Their standard deviation.
    linear : Linear, optional
        How inputs and readings depend on the free parameters.
    """

    structure: Structure
    records: Records
    parameters: Array
    free: npt.NDArray[np.int64]
    followers: npt.NDArray[np.int64]
    scale: Array
    theta_covariance: Array
    theta_noise: Array
    active: npt.NDArray[np.bool_]
    channels: npt.NDArray[np.bool_]
    sensor: Array
    process_std: Array
    sensor_std: Array
    start: Array
    start_std: Array
    linear: "Linear | None" = None

    @property
    def active_index(self) -> npt.NDArray[np.int64]:
        """Indices of the active states."""
        return np.flatnonzero(self.active).astype(np.int64)

    @property
    def column(self) -> npt.NDArray[np.int64]:
        """For each parameter its place among the free ones (also for followers), or -1."""
        column = np.full(len(self.parameters), -1, dtype=np.int64)
        column[self.free] = np.arange(len(self.free))
        for follower, leader in self.followers:
            column[follower] = column[leader]
        return column

    def parameters_at(self, theta: Array) -> Array:
        """Parameter vector for deviations `theta` (n_free,) in units of `scale`."""
        column = self.column
        p = self.parameters.copy()
        moved = column >= 0
        p[moved] += (self.scale * theta)[column[moved]]
        return p


@dataclass(frozen=True)
class FilterResult:
    """The complete record of one pass.

    Attributes
    ----------
    parameters : (n_parameters,) array
        At the end of the pass.
    theta_covariance : (n_free, n_free) array
        At the end, in units of the problem's scale.
    history, history_std : (n, n_free) array
        Free parameters and their standard deviation after the updates of each time step.
    whitened : (k, n, 4) array
        Innovation over its standard deviation; NaN where nothing was measured.
    states : (k, n, 4) array
        Filtered states; NaN after the end of a record.
    log_likelihood : float
        Of the innovations.
    samples : int
        Scalar measurements used.
    """

    parameters: Array
    theta_covariance: Array
    history: Array
    history_std: Array
    whitened: Array
    states: Array
    log_likelihood: float
    samples: int


def initial_covariance(problem: FilterProblem) -> Array:
    """Covariance P_0 of the augmented state at the start of a pass."""
    n_theta, n_x = len(problem.free), len(problem.active_index)
    n = n_theta + n_x * len(problem.records.ids)
    covariance = np.zeros((n, n))
    covariance[:n_theta, :n_theta] = problem.theta_covariance
    block = problem.start_std[problem.active_index] ** 2
    for j in range(len(problem.records.ids)):
        at = n_theta + j * n_x + np.arange(n_x)
        covariance[at, at] = block
    return covariance


def empty_states(problem: FilterProblem) -> Array:
    """NaN-filled array for the states of every record."""
    k, n, _ = problem.records.inputs.shape
    return np.full((k, n, N_STATES), np.nan)


def singular_mass(problem: FilterProblem, filter_: str = "the filter") -> NumericsError:
    """The error of a mass matrix that is not positive definite: of no maneuver, but of masses."""
    added = ", ".join(n for n in problem.structure.parameters if n.endswith("dot"))
    return NumericsError(
        f"{filter_} stopped: the mass matrix is not positive definite",
        f"{problem.structure.plane} plane, added masses {added}",
        "Check mass, inertia and x_g_m of the vehicle file, and value and std of the added masses "
        "that its [coefficients] give.",
    )
