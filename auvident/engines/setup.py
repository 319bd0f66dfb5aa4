"""What stays the same through an identification, and what a stage of it leaves."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.engines.constraints import envelope
from auvident.engines.map_fit import Estimate
from auvident.engines.prediction import Frame, Free
from auvident.engines.problem import FilterResult
from auvident.engines.records import Record
from auvident.physics.consistency import Basis, Constraints, constraints_of
from auvident.physics.sensing import sensor_matrix
from auvident.physics.terms import Structure
from auvident.schema.artifacts import Sensing
from auvident.schema.effects import parameter_of
from auvident.schema.plan import ACTIVE, Plan, System

Array = npt.NDArray[Any]


@dataclass(frozen=True)
class Correlated:
    """Parameters that the prior knows together: names, and correlations (n, n)."""

    names: tuple[str, ...]
    correlation: Array


@dataclass(frozen=True)
class Setup:
    """All that stays the same from stage to stage.

    Attributes
    ----------
    structure : Structure
    plan : Plan
    records : dict
        Record and maneuver kind by maneuver id; only those that identify.
    dt_s : float
    sensing : Sensing
    sensor_std : (4,) array
        Accuracy of each channel; sets the relative weights of the channels.
    prior, prior_std : (n_parameters,) array
    followers : (m, 2) int array
        (position, position it moves with), see `FilterProblem`.
    filter, engine : str
    start : (n_parameters,) array
        Where the first stage starts.
    friction : float
        Share of the drag of the estimate that falls with the Reynolds number.
    joint : Correlated or None
        Correlations of the prior; None where all is independent.
    own_starts : bool
        Whether the noise of a fit is what is left from fitted starts, see `Carried`.
    """

    structure: Structure
    plan: Plan
    records: Mapping[str, tuple[str, Record]]
    dt_s: float
    sensing: Sensing
    sensor_std: Array
    prior: Array
    prior_std: Array
    followers: npt.NDArray[np.int64]
    filter: str
    engine: str
    start: Array
    friction: float = 1.0
    joint: Correlated | None = None
    own_starts: bool = False

    @property
    def frame(self) -> Frame:
        """Structure, sensors and step of the prediction."""
        return Frame(self.structure, self.sensing, self.dt_s)

    @property
    def sensor(self) -> Array:
        """Reading = sensor @ state, without effects."""
        return sensor_matrix(self.structure.plane, self.sensing)

    @cached_property
    def constraints(self) -> Constraints:
        """What physics knows of the parameters, over the envelope of the records."""
        flown = envelope(record for _, record in self.records.values())
        return constraints_of(Basis(self.structure, self.prior, self.prior_std, flown))

    def prior_covariance(self, positions: Array, factors: Array) -> Array:
        """Covariance (n, n) of the prior in units of its standard deviations before the factors."""
        covariance = np.diag(factors**2)
        if self.joint is None:
            return covariance
        names = self.names(positions)
        own = [k for k, name in enumerate(self.joint.names) if name in names]
        at = [names.index(self.joint.names[k]) for k in own]
        together = self.joint.correlation[np.ix_(own, own)]
        covariance[np.ix_(at, at)] = together * np.outer(factors[at], factors[at])
        return covariance

    def prior_information(self, positions: Array, factors: Array) -> Array:
        """Inverse of `prior_covariance`."""
        if self.joint is None:
            return np.diag(1.0 / factors**2)
        return np.linalg.inv(self.prior_covariance(positions, factors))

    def names(self, positions: Array) -> list[str]:
        """Names of parameters."""
        return [self.structure.parameters[i] for i in positions]

    def free(self, positions: Array) -> Free:
        """Parameters that move, with those that follow them."""
        followers = live_followers(self, positions)
        return Free.among(len(self.prior), positions, self.prior_std[positions], followers)

    def bounds(self, positions: Array) -> tuple[Array, Array]:
        """Least and largest values of parameters, see `bounds_of`."""
        return bounds_of(self.names(positions))


@dataclass(frozen=True, kw_only=True)
class Outcome(Estimate):
    """What a stage leaves.

    Attributes
    ----------
    covariance : (n_free, n_free) array
        Posterior covariance in units of the prior standard deviations.
    noise : (4,) array
        Effective standard deviation of each channel (see `noise.effective_noise`).
    ids : tuple of str
        Records that were used.
    samples : int
        Readings that were used.
    passed : FilterResult or None
        The record of the filter pass; None for a refinement.
    observer_time_s : float or None
        Of the filter pass: the time over which it trusted the model.
    prices : mapping
        What each constraint costs by its id [nats], see `estimation.inequalities.prices`.
    """

    covariance: Array
    noise: Array
    ids: tuple[str, ...]
    samples: int
    passed: FilterResult | None = field(default=None, repr=False)
    observer_time_s: float | None = None
    prices: Mapping[str, float] = field(default_factory=dict)


def bounds_of(names: Sequence[str]) -> tuple[Array, Array]:
    """Least and largest values (n,) of parameters.

    Of what scales with the vehicle only that it has one sign: the bounds are wide.
    """
    low, high = np.full(len(names), -np.inf), np.full(len(names), np.inf)
    for column, name in enumerate(names):
        if "." in name:
            declared = parameter_of(name)
            if not any(declared.powers):
                low[column], high[column] = declared.low, declared.high
            elif declared.low == 0.0:
                low[column] = 0.0
    return low, high


def active_states(system: System, plane: str) -> npt.NDArray[np.bool_]:
    """Which of (u, a, b, angle) a system estimates; the pitch moves with the coupled plane."""
    return np.array([*ACTIVE[system], system == "coupled" and plane == "vertical"])


def live_followers(setup: Setup, free: Array) -> npt.NDArray[np.int64]:
    """Followers whose leader is free."""
    return setup.followers[np.isin(setup.followers[:, 1], free)]
