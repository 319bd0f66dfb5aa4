"""Maximum a posteriori fit of a free-running prediction; it knows no vehicle."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.errors import NumericsError
from auvident.estimation import inequalities as within
from auvident.estimation.inequalities import Inequalities

Array = npt.NDArray[Any]

MAX_ITERATIONS = 40
COST_TOLERANCE = 1.0e-7  # relative fall of the cost below which the fit has converged
RIDGE = 1.0e-5  # relative; where the curvature is nearly singular
# [prior standard deviations] of a step. Of first reaches of 1 and 2, and of damping in place of a
# reach, 2 left the fits nearest to the best of all (ten generated trials, seeds 1601 to 1618).
FIRST_REACH, LEAST_REACH = 2.0, 1.0e-6
WORTH_A_TRIAL = 0.5  # [of the tolerance] a step that promises less is not tried
# Usual choices (Conn, Gould and Toint 2000, 6.1 and 17.1): shares of the promised fall below and
# above which the reach changes, and the reach then, in lengths of the step that was tried.
BROKEN, KEPT = 0.25, 0.75
AFTER_AWAY, AFTER_BROKEN, AFTER_KEPT = 0.125, 0.25, 2.0
MOST_SETS = 30  # guesses at what is held at a bound; a few do
SMALLEST = 1.0e-12  # room that a bound leaves, so that a parameter may lie at it


@dataclass(frozen=True)
class Fit:
    """Result of `fit`.

    Attributes
    ----------
    theta : (n,) array
        Deviations from the base, in prior standard deviations.
    information : (n, n) array
        Of the data alone (Gauss-Newton curvature of the likelihood).
    covariance : (n, n) array
        Of theta, from likelihood and prior.
    cost : float
        Negative log posterior up to a constant.
    iterations : int
    prices : (m,) array
        What each inequality costs in nats, see `inequalities.prices`.
    """

    theta: Array
    information: Array
    covariance: Array
    cost: float
    iterations: int
    prices: Array


# theta -> half the sum of squared whitened residuals, its gradient, its Gauss-Newton curvature
Likelihood = Callable[[Array], tuple[float, Array, Array]]


def fit(
    likelihood: Likelihood,
    start: Array,
    prior_mean: Array,
    prior_information: Array,
    bounds: tuple[Array, Array] | None = None,
    iterations: int = MAX_ITERATIONS,
    tolerance: float = COST_TOLERANCE,
    inequalities: Inequalities = within.none,
    ceiling: float = np.inf,
) -> Fit:
    """Minimise whitened residuals and distance from the prior together.

    Gauss-Newton on the normal equations in a trust region, which is a box as the bounds are
    (Conn, Gould and Toint 2000): the curvature is accumulated while simulating, so that memory
    does not grow with the length of the data.

    Parameters
    ----------
    likelihood : callable
        theta (n,) -> (half sum of squares, gradient (n,), curvature (n, n)); not finite where
        the prediction ran away.
    start, prior_mean : (n,) array
    prior_information : (n, n) array
        Inverse prior covariance of theta.
    bounds : pair of (n,) arrays, optional
        Least and largest values; no step leaves them.
    iterations : int
        At most so many steps are tried.
    tolerance : float
        Relative fall of the cost below which the fit has converged.
    inequalities : callable, optional
        Concave, at least zero in the set that no step leaves; a start outside is moved into it.
    ceiling : float, optional
        A fit is given up where the whole first step, within the bounds, promises no cost below it.

    Raises
    ------
    NumericsError
        The prediction already runs away at the start, the curvature is singular, or the start
        leads nowhere.
    """
    low, high = bounds or (np.full(len(start), -np.inf), np.full(len(start), np.inf))
    theta = within.nearest(inequalities, start.copy(), prior_information, low, high)
    inequalities = within.from_where_it_stands(inequalities, theta)
    cost, gradient, curvature = _posterior(likelihood, theta, prior_mean, prior_information)
    if not np.isfinite(cost):
        raise NumericsError(
            "the prediction diverges with the initial coefficients of the fit",
            remedy="Run the filter stages first, or check the priors and the mass properties.",
        )
    if np.isfinite(ceiling):
        step = bounded_step(curvature, gradient, low - theta, high - theta)
        if cost - _promised(curvature, gradient, step) > ceiling:
            raise NumericsError("the start of the fit leads nowhere")
    iteration, reach = 0, FIRST_REACH
    while iteration < iterations and reach > LEAST_REACH:
        ridge = RIDGE * np.diag(np.maximum(np.diag(curvature), np.diag(prior_information)))
        room = np.maximum(low - theta, -reach), np.minimum(high - theta, reach)
        step = bounded_step(curvature + ridge, gradient, *room)
        step = within.kept(inequalities, theta, step, curvature + ridge, gradient, *room)
        trial = np.clip(theta + step, low, high)
        step = trial - theta
        promised = _promised(curvature, gradient, step)
        if promised < WORTH_A_TRIAL * tolerance * max(cost, 1.0):
            break
        iteration += 1
        attempt = _posterior(likelihood, trial, prior_mean, prior_information)
        fall = cost - attempt[0]
        reach = _next_reach(reach, float(np.abs(step).max()), fall / promised)
        if not fall > 0.0:
            continue
        settled = fall < tolerance * max(cost, 1.0)
        theta, (cost, gradient, curvature) = trial, attempt
        if settled:
            break
    covariance = _solved(curvature, np.eye(len(theta)))
    prices = within.prices(inequalities, theta, curvature, gradient, low, high)
    return Fit(theta, curvature - prior_information, covariance, cost, iteration, prices)


def _promised(curvature: Array, gradient: Array, step: Array) -> float:
    """Fall of the cost that a step promises."""
    return -float(gradient @ step + 0.5 * step @ curvature @ step)


def _next_reach(reach: float, size: float, kept: float) -> float:
    """Longest step to try after one of a size that kept a share of the fall it promised."""
    if not np.isfinite(kept):  # it ran away
        return AFTER_AWAY * size
    if kept < BROKEN:
        return AFTER_BROKEN * size
    return max(reach, AFTER_KEPT * size) if kept > KEPT else reach


def bounded_step(curvature: Array, gradient: Array, low: Array, high: Array) -> Array:
    """Step (n,) to the least value of a quadratic function within bounds.

    A Newton step that is cut off at a bound may lead uphill, as the other parameters still move
    by what goes with the whole of it; here they take what suits them best. What is held at a bound
    is guessed and put right where it leaves the bounds or pulls inwards (primal-dual active sets,
    Hintermueller, Ito and Kunisch 2002).

    Parameters
    ----------
    curvature : (n, n) array
    gradient : (n,) array
    low, high : (n,) array
        Bounds of the step; zero lies between them.

    Raises
    ------
    NumericsError
        The curvature is not positive definite.
    """
    step = -_solved(curvature, gradient)
    held = (step > high).astype(np.int64) - (step < low)  # 1 at the high bound, -1 at the low one
    if not held.any():
        return step
    for _ in range(MOST_SETS - 1):
        step = np.where(held < 0, low, np.where(held > 0, high, 0.0))
        free = held == 0
        pull = gradient[free] + curvature[np.ix_(free, ~free)] @ step[~free]
        step[free] = -_solved(curvature[np.ix_(free, free)], pull)
        beyond = (step > high).astype(np.int64) - (step < low)
        slope = gradient + curvature @ step
        wrong = (held != 0) & (held * slope > 0.0)
        if not beyond.any() and not wrong.any():
            return step
        held = np.where(wrong, 0, held) + beyond
    return _bounded_by_descent(curvature, gradient, low, high)


def _bounded_by_descent(curvature: Array, gradient: Array, low: Array, high: Array) -> Array:
    """`bounded_step` where guesses at what is held go round in circles."""
    # rarely needed, and a quarter of a second to import
    from scipy.linalg import solve_triangular
    from scipy.optimize import lsq_linear

    try:
        factor = np.linalg.cholesky(curvature)
    except np.linalg.LinAlgError:
        raise _singular() from None
    room = np.minimum(low, 0.0) - SMALLEST, np.maximum(high, 0.0) + SMALLEST
    right = -solve_triangular(factor, gradient, lower=True)
    return np.asarray(lsq_linear(factor.T, right, room, method="bvls").x)


def _solved(curvature: Array, right: Array) -> Array:
    try:
        return np.linalg.solve(curvature, right)
    except np.linalg.LinAlgError:
        raise _singular() from None


def _singular() -> NumericsError:
    return NumericsError(
        "the information matrix of the fit is singular",
        remedy="Free fewer coefficients, or set priors for them.",
    )


def _posterior(
    likelihood: Likelihood, theta: Array, mean: Array, information: Array
) -> tuple[float, Array, Array]:
    half, gradient, curvature = likelihood(theta)
    away = information @ (theta - mean)
    return half + 0.5 * float(away @ (theta - mean)), gradient + away, curvature + information


def correlation_time(residual: Array, longest: int) -> float:
    """Integral correlation time of a residual, in samples.

    Sum of the autocorrelation over both sides up to its first crossing of zero.

    Parameters
    ----------
    residual : (n,) array
        One record, NaN where nothing was measured.
    longest : int
        Longest lag looked at, in samples.

    Returns
    -------
    float
        At least 1 (white); 1 where nothing was measured.
    """
    if not np.isfinite(residual).any():
        return 1.0
    x = np.where(np.isfinite(residual), residual, 0.0)
    size = 1 << (2 * len(x) - 1).bit_length()
    spectrum = np.fft.rfft(x, size)
    correlation = np.fft.irfft(np.abs(spectrum) ** 2, size)[: min(longest, len(x))]
    if correlation[0] <= 0.0:
        return 1.0
    correlation = correlation / correlation[0]
    below = np.flatnonzero(correlation <= 0.0)
    end = below[0] if below.size else len(correlation)
    return float(1.0 + 2.0 * correlation[1:end].sum())
