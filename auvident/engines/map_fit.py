"""The maximum a posteriori fit of the free-running prediction.

The likelihood is that of `free_run`, the prior N(m, P) within bounds. The noise is as large as the
residual says, so that a fit runs in rounds: the parameters with the noise held, the noise with the
parameters held. Identification and diagnosis run the same rounds; what they differ in is data: the
prior, what is free, and the policy by which the noise is brought up to date.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.engines.constraints import in_units
from auvident.engines.free_run import Colours, OutputError, likelihood, well_started
from auvident.engines.noise import Noise
from auvident.engines.prediction import Free
from auvident.estimation.output_error import COST_TOLERANCE, MAX_ITERATIONS, Fit, fit
from auvident.physics.consistency import UNCONSTRAINED, Constraints

Array = npt.NDArray[Any]


@dataclass(frozen=True)
class Prior:
    """Prior of free parameters, in units of their scale from an origin on.

    Attributes
    ----------
    mean : (n,) array
    information : (n, n) array
        Inverse covariance.
    low, high : (n,) array
        Bounds that no fit leaves.
    origin : (n,) array or None
        None counts from zero: a parameter that ends at a bound of zero is off to the last digit.
        From where a fit begins on, what the data do not show keeps its digits.
    constraints : Constraints
        What physics knows of the parameters; no fit leaves it.
    """

    mean: Array
    information: Array
    low: Array
    high: Array
    origin: Array | None = None
    constraints: Constraints = UNCONSTRAINED


@dataclass(frozen=True)
class NoisePolicy:
    """How parameters and noise take turns.

    Attributes
    ----------
    update : callable
        Likelihood and parameters to the noise that they leave; raises `NumericsError` where the
        prediction runs away.
    rounds : int
        At most so many.
    settled : float or None
        Relative change of the noise below which another round would change nothing; None runs
        every round.
    steps : int
        Of the parameters in each round, at most.
    tolerance : float
        Relative fall of the cost at which a round ends.
    ceiling : float
        Cost at which a start is given up, see `estimation.output_error.fit`.
    """

    update: Callable[[OutputError, Array], Noise]
    rounds: int
    settled: float | None = None
    steps: int = MAX_ITERATIONS
    tolerance: float = COST_TOLERANCE
    ceiling: float = np.inf


@dataclass(frozen=True)
class FitRound:
    """Where a round ends: parameters, the fit that led there, the noise that they leave."""

    parameters: Array
    fit: Fit
    noise: Noise


@dataclass(frozen=True)
class Estimate:
    """Parameters found by a fit or by a filter.

    Attributes
    ----------
    parameters : (n_parameters,) array
    free : (n_free,) int array
        Positions of those that were estimated.
    colours : tuple of Colour
        Noise of each channel with these parameters.
    log_likelihood : float
    """

    parameters: Array
    free: npt.NDArray[np.int64]
    colours: Colours
    log_likelihood: float


def map_rounds(
    output: OutputError,
    free: Free,
    prior: Callable[[Array], Prior],
    start: Array,
    policy: NoisePolicy,
) -> Iterator[FitRound]:
    """Rounds of a fit from a start, each with the noise that the last one left.

    Each begins its records where the last one had come to.

    Parameters
    ----------
    output : OutputError
    free : Free
    prior : callable
        Parameters where a round begins to the prior, with the origin of its own choice.
    start : (n_parameters,) array
    policy : NoisePolicy

    Raises
    ------
    NumericsError
        The prediction runs away where a round begins or ends, the curvature is singular, or a
        start leads nowhere.
    """
    p = start
    output = well_started(output, p)
    for _ in range(policy.rounds):
        p, found = map_fit(
            output, free, prior(p), p, policy.steps, policy.tolerance, policy.ceiling
        )
        noise = policy.update(output, p)
        yield FitRound(p, found, noise)
        if policy.settled is not None and _settled(output.colours, noise.colours, policy.settled):
            return
        output = replace(well_started(output, p, noise.residuals), colours=noise.colours)


def map_fit(
    output: OutputError,
    free: Free,
    prior: Prior,
    start: Array,
    steps: int,
    tolerance: float,
    ceiling: float = np.inf,
) -> tuple[Array, Fit]:
    """Most probable parameters with the noise held, and the fit in the units of the prior."""
    origin = _origin(free, prior)

    def at(theta: Array) -> Array:
        return free.at(start, origin + free.scale * theta)

    found = fit(
        lambda theta: likelihood(output, at(theta), free),
        _begin(free, prior, start),
        prior.mean,
        prior.information,
        (prior.low, prior.high),
        steps,
        tolerance,
        in_units(prior.constraints, free, start, origin),
        ceiling,
    )
    return at(found.theta), found


def beginning(free: Free, prior: Prior, start: Array) -> Array:
    """Parameters at which a fit begins, where the constraints have nothing against them."""
    return free.at(start, _origin(free, prior) + free.scale * _begin(free, prior, start))


def _origin(free: Free, prior: Prior) -> Array:
    return np.zeros(len(free.positions)) if prior.origin is None else prior.origin


def _begin(free: Free, prior: Prior, start: Array) -> Array:
    begin = (start[free.positions] - _origin(free, prior)) / free.scale
    return np.asarray(np.clip(begin, prior.low, prior.high))


def _settled(before: Colours, after: Colours, share: float) -> bool:
    """Whether the noise of every channel changed so little that another round changes nothing."""
    if any(a.time_s != b.time_s for a, b in zip(before, after, strict=True)):
        return False
    old, new = (np.array([(c.white, c.slow) for c in colours]) for colours in (before, after))
    return bool(np.allclose(new, old, rtol=share, atol=0.0))
