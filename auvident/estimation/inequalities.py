"""Inequalities that parameters keep: g(theta) >= 0 with every g concave; it knows no vehicle.

Sets of such theta are convex: matrices that are positive semi-definite, half-spaces, and what they
have in common. A step that leaves the set is taken again with the tangents it broke as linear
inequalities, until it ends inside (cutting planes, Kelley 1960); as g is concave, a tangent cuts
off nothing of the set. A step that stays inside is the one without inequalities, to the last digit.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]
# theta (n,) -> g (m,), its slopes (m, n)
Inequalities = Callable[[Array], tuple[Array, Array]]

INSIDE = 1.0e-8  # a step that is cut off ends so far inside, in the units of g
AT_THE_EDGE = 1.0e-4  # nearer than this an inequality may hold a parameter
MOST_CUTS = 20  # rounds of tangents; two or three do
HALVINGS = 50


def none(theta: Array) -> tuple[Array, Array]:
    """No inequality."""
    return np.zeros(0), np.zeros((0, len(theta)))


def from_where_it_stands(inequalities: Inequalities, theta: Array) -> Inequalities:
    """Inequalities that theta keeps: those it breaks are only not to be broken any further."""
    floor = np.minimum(inequalities(theta)[0], 0.0)

    def raised(at: Array) -> tuple[Array, Array]:
        value, slopes = inequalities(at)
        return value - floor, slopes

    return raised if floor.any() else inequalities


def kept(
    inequalities: Inequalities,
    theta: Array,
    step: Array,
    curvature: Array,
    gradient: Array,
    low: Array,
    high: Array,
) -> Array:
    """The step (n,), or the best one that keeps the inequalities.

    Parameters
    ----------
    inequalities : callable
    theta : (n,) array
        Where the step begins.
    step : (n,) array
        To the least value of a quadratic function within bounds.
    curvature, gradient : (n, n) array, (n,) array
        Of that function.
    low, high : (n,) array
        Bounds of the step; zero lies between them.
    """
    whole, slopes = inequalities(theta + step)
    if (whole >= 0.0).all():
        return step
    value, tangents = inequalities(theta)
    least = INSIDE - value
    for _ in range(MOST_CUTS):
        broken = whole < 0.0
        tangents = np.vstack([tangents, slopes[broken]])
        least = np.concatenate([least, INSIDE - whole[broken] + slopes[broken] @ step])
        step, _ = quadratic_step(curvature, gradient, low, high, tangents, least)
        whole, slopes = inequalities(theta + step)
        if (whole >= 0.0).all():
            return step
    return _shortened(inequalities, theta, step)


def _shortened(inequalities: Inequalities, theta: Array, step: Array) -> Array:
    """The longest of halved steps that ends inside; none where theta itself is at the edge."""
    for _ in range(HALVINGS):
        step = 0.5 * step
        if (inequalities(theta + step)[0] >= 0.0).all():
            return step
    return np.zeros_like(step)


def nearest(
    inequalities: Inequalities, theta: Array, information: Array, low: Array, high: Array
) -> Array:
    """The point (n,) inside that is nearest to theta, measured with its inverse covariance.

    For an estimate with this covariance it is the most probable one that keeps the inequalities
    (Simon 2010, IET Control Theory Appl. 4: projection of an estimate).
    """
    still = np.zeros_like(theta)
    room = np.minimum(low - theta, 0.0), np.maximum(high - theta, 0.0)
    moved = kept(inequalities, theta, still, information, still, *room)
    return theta + moved if moved.any() else theta


def prices(
    inequalities: Inequalities,
    theta: Array,
    curvature: Array,
    gradient: Array,
    low: Array,
    high: Array,
) -> Array:
    """What each inequality costs (m,) at the most probable theta that keeps them, in nats.

    Half its multiplier times how far the step without inequalities breaks it: the sum is what
    a quadratic log posterior would gain. Zero for one that does not hold theta.

    Parameters
    ----------
    inequalities, theta, curvature, gradient :
        As of `kept`.
    low, high : (n,) array
        Bounds of theta.
    """
    value, slopes = inequalities(theta)
    cost, rows = np.zeros(len(value)), np.flatnonzero(value < AT_THE_EDGE)
    if not rows.size:
        return cost
    room = np.minimum(low - theta, 0.0), np.maximum(high - theta, 0.0)
    step, _ = quadratic_step(curvature, gradient, *room, *none(theta)[::-1])
    _, pull = quadratic_step(
        curvature, gradient, *room, slopes[rows], np.minimum(-value[rows], 0.0)
    )
    cost[rows] = 0.5 * pull * np.maximum(-(value + slopes @ step)[rows], 0.0)
    return cost


def quadratic_step(
    curvature: Array, gradient: Array, low: Array, high: Array, tangents: Array, least: Array
) -> tuple[Array, Array]:
    """Step (n,) to the least value of a quadratic function within linear inequalities.

    Least distance programming on the factor of the curvature, which is one non-negative least
    squares (Lawson and Hanson 1974, chapter 23).

    Parameters
    ----------
    curvature, gradient : (n, n) array, (n,) array
        The curvature is positive definite.
    low, high : (n,) array
    tangents, least : (k, n) array, (k,) array
        tangents @ step >= least.

    Returns
    -------
    step : (n,) array
        Zero where the inequalities contradict each other.
    multipliers : (k,) array
        Of the tangents, at least zero.
    """
    # not needed to identify where no constraint is near, and a quarter of a second to import
    from scipy.linalg import cholesky, solve_triangular
    from scipy.optimize import nnls

    n, k = len(gradient), len(least)
    below, above = np.isfinite(low), np.isfinite(high)
    rows = np.vstack([tangents, np.eye(n)[below], -np.eye(n)[above]])
    right = np.concatenate([least, low[below], -high[above]])
    factor = cholesky(curvature, lower=True)
    white = solve_triangular(factor, gradient, lower=True)
    if not len(right):
        return solve_triangular(factor.T, -white, lower=False), right
    away = solve_triangular(factor, rows.T, lower=True)
    distance = right + white @ away
    size = max(float(np.abs(distance).max()), np.finfo(float).tiny)
    matrix = np.vstack([away, distance / size])
    length = np.linalg.norm(matrix, axis=0)
    length[length == 0.0] = 1.0  # an inequality that nothing free has a part in, at its edge
    matrix = matrix / length
    aim = np.zeros(n + 1)
    aim[n] = 1.0
    weights, _ = nnls(matrix, aim, maxiter=30 * len(right))
    left = matrix @ weights - aim
    if not left[n] < -np.finfo(float).eps:
        return np.zeros(n), np.zeros(k)
    shift = -size * left[:n] / left[n]
    step = solve_triangular(factor.T, shift - white, lower=False)
    return step, -size * (weights / length)[:k] / left[n]
