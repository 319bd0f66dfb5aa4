"""Maximum a posteriori fit of a free-running prediction; it knows no vehicle."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.errors import NumericsError

Array = npt.NDArray[Any]

MAX_ITERATIONS = 40
COST_TOLERANCE = 1.0e-5  # relative fall of the cost below which the fit has converged
DAMPING_START, DAMPING_UP, DAMPING_DOWN = 1.0e-3, 8.0, 4.0  # Levenberg-Marquardt, in prior units
DAMPING_CEILING = 1.0e8


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
    """

    theta: Array
    information: Array
    covariance: Array
    cost: float
    iterations: int


# theta -> half the sum of squared whitened residuals, its gradient, its Gauss-Newton curvature
Likelihood = Callable[[Array], tuple[float, Array, Array]]


def fit(
    likelihood: Likelihood, start: Array, prior_mean: Array, prior_information: Array,
    bounds: tuple[Array, Array] | None = None, iterations: int = MAX_ITERATIONS,
    tolerance: float = COST_TOLERANCE, damping: float = DAMPING_START,
) -> Fit:  # fmt: skip
    """Minimise whitened residuals and distance from the prior together.

    Levenberg-Marquardt on the normal equations: the curvature is accumulated while simulating,
    so that memory does not grow with the length of the data.

    Parameters
    ----------
    likelihood : callable
        theta (n,) -> (half sum of squares, gradient (n,), curvature (n, n)); not finite where
        the prediction ran away.
    start, prior_mean : (n,) array
    prior_information : (n, n) array
        Inverse prior covariance of theta.
    bounds : pair of (n,) arrays, optional
        Least and largest values; a parameter at its bound that the gradient pushes outwards is
        held.
    iterations : int
        At most so many steps are tried.
    tolerance : float
        Relative fall of the cost below which the fit has converged.
    damping : float
        Of the first step. Little of it goes through narrow valleys faster, much of it is safer
        far from the solution.

    Raises
    ------
    NumericsError
        The prediction already runs away at the start, or the curvature is singular.
    """
    theta = start.copy()
    cost, gradient, curvature = _posterior(likelihood, theta, prior_mean, prior_information)
    if not np.isfinite(cost):
        raise NumericsError(
            "the prediction runs away with the coefficients the fit starts from",
            remedy="Run the filter stages first, or check the priors and the mass properties.",
        )
    iteration = 0
    low, high = bounds or (np.full(len(theta), -np.inf), np.full(len(theta), np.inf))
    while iteration < iterations and damping < DAMPING_CEILING:
        iteration += 1
        scale = np.diag(np.maximum(np.diag(curvature), np.diag(prior_information)))
        held = ((theta <= low) & (gradient > 0.0)) | ((theta >= high) & (gradient < 0.0))
        step = _step(curvature + damping * scale, gradient, ~held)
        trial = np.clip(theta - step, low, high)
        attempt = _posterior(likelihood, trial, prior_mean, prior_information)
        if not attempt[0] < cost:
            damping *= DAMPING_UP
            continue
        fall = (cost - attempt[0]) / max(cost, 1.0)
        theta, (cost, gradient, curvature) = trial, attempt
        damping /= DAMPING_DOWN
        if fall < tolerance:
            break
    covariance = _solved(curvature, np.eye(len(theta)))
    return Fit(theta, curvature - prior_information, covariance, cost, iteration)


def _step(curvature: Array, gradient: Array, moves: Array) -> Array:
    """Newton step of the parameters that move; zero for the others."""
    step = np.zeros(len(gradient))
    step[moves] = _solved(curvature[np.ix_(moves, moves)], gradient[moves])
    return step


def _solved(curvature: Array, right: Array) -> Array:
    try:
        return np.linalg.solve(curvature, right)
    except np.linalg.LinAlgError:
        raise NumericsError(
            "the curvature of the fit is singular",
            remedy="Free fewer coefficients, or give them priors.",
        ) from None


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
        At least 1 (white).
    """
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
