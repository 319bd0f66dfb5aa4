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

from auvident.engines.free_run import Colours, OutputError, likelihood
from auvident.engines.noise import Noise
from auvident.engines.prediction import Free
from auvident.estimation.output_error import COST_TOLERANCE, MAX_ITERATIONS, Fit, fit

Array = npt.NDArray[Any]


@dataclass(frozen=True)
class Prior:
    """Prior of free parameters.

    Attributes
    ----------
    mean : (n,) array
    information : (n, n) array
        Inverse covariance, in units of their scale.
    low, high : (n,) array
        Bounds that no fit leaves.
    """

    mean: Array
    information: Array
    low: Array
    high: Array


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
    """

    update: Callable[[OutputError, Array], Noise]
    rounds: int
    settled: float | None = None
    steps: int = MAX_ITERATIONS
    tolerance: float = COST_TOLERANCE


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
    output: OutputError, free: Free, prior: Prior, start: Array, policy: NoisePolicy
) -> Iterator[FitRound]:
    """Rounds of a fit from a start, each with the noise that the last one left.

    Raises
    ------
    NumericsError
        The prediction runs away where a round begins or ends, or the curvature is singular.
    """
    p = start
    for _ in range(policy.rounds):
        p, found = map_fit(output, free, prior, p, policy)
        noise = policy.update(output, p)
        yield FitRound(p, found, noise)
        if policy.settled is not None and _settled(output.colours, noise.colours, policy.settled):
            return
        output = replace(output, colours=noise.colours)


def map_fit(
    output: OutputError, free: Free, prior: Prior, start: Array, policy: NoisePolicy
) -> tuple[Array, Fit]:
    """Most probable parameters with the noise held, and the fit in deviations from its start."""
    at, begun = free.positions, start.copy()
    begun[at] = np.clip(start[at], prior.low, prior.high)
    bounds = (prior.low - begun[at]) / free.scale, (prior.high - begun[at]) / free.scale
    found = fit(
        lambda by: likelihood(output, free.moved(begun, by), free),
        np.zeros(len(at)),
        (prior.mean - begun[at]) / free.scale,
        prior.information,
        bounds,
        policy.steps,
        policy.tolerance,
    )
    p = free.moved(begun, found.theta)
    for reached, bound in (
        (found.theta <= bounds[0], prior.low),
        (found.theta >= bounds[1], prior.high),
    ):
        p[at[reached]] = bound[reached]  # to the last digit: what is off leaves no trace
    return p, found


def _settled(before: Colours, after: Colours, share: float) -> bool:
    """Whether the noise of every channel changed so little that another round changes nothing."""
    if any(a.time_s != b.time_s for a, b in zip(before, after, strict=True)):
        return False
    old, new = (np.array([(c.white, c.slow) for c in colours]) for colours in (before, after))
    return bool(np.allclose(new, old, rtol=share, atol=0.0))
