"""From the most probable parameters to their mean, where data leave a direction to the prior.

Readings that show ratios alone - of the forces of an equation to its inertia - hold the parameters
in a wedge: as sharp everywhere in the ratios, it is the wider in the parameters the larger their
common scale. The most probable scale does not see that and is too small on average, by half a
standard deviation where half a dozen parameters share it. The mean of the posterior is not.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.estimation.output_error import Likelihood

Array = npt.NDArray[Any]

UNHELD = 0.2  # [prior variances] directions that keep more are looked at; others hardly move
# [prior standard deviations] of the differences, which are taken to one side: far above rounding,
# and fifty of them to the standard deviation over which the information changes
STEP = 0.02
# [posterior standard deviations] the expansion tells no larger move; those seen are up to one
FARTHEST = 2.0


def move_to_mean(likelihood: Likelihood, prior_information: Array, columns: Sequence[int]) -> Array:
    """Move from the mode of the posterior to its mean, by Laplace's approximation.

    To first order in the inverse of the information H, minus half H^-1 times the gradient of
    log det H (Lindley 1980; Tierney and Kadane 1986), here along the directions that the prior
    holds.

    Parameters
    ----------
    likelihood : callable
        Of deviations from the mode in prior standard deviations; see `output_error.fit`.
    prior_information : (n, n) array
    columns : sequence of int
        Parameters that may move; the information of the others may not be smooth.

    Returns
    -------
    (n,) array
        In prior standard deviations; zero where the prediction runs away a step aside.
    """
    n, own, place = len(prior_information), np.ix_(columns, columns), list(columns)

    def log_det(along: Array) -> float:
        theta = np.zeros(n)
        theta[place] = along
        half, _, curvature = likelihood(theta)
        if not np.isfinite(half):
            return np.nan
        return float(np.linalg.slogdet((curvature + prior_information)[own])[1])

    held = (likelihood(np.zeros(n))[2] + prior_information)[own]
    variances, vectors = np.linalg.eigh(np.linalg.inv(held))
    unheld = variances > UNHELD
    move = np.zeros(n)
    if unheld.any():
        slope = _slope_within(log_det, float(np.linalg.slogdet(held)[1]), vectors[:, unheld])
        move[place] = vectors[:, unheld] @ _limited(-0.5 * slope, variances[unheld])
    return move


def _slope_within(function: Callable[[Array], float], here: float, space: Array) -> Array:
    """Slopes (k,) of a function of (n,) along the columns of an orthonormal (n, k) array.

    `here` is its value at zero.

    Differences are taken along a basis of the space that is no chance: many variances are equal,
    and their vectors any rotation of each other. Zero where the function has no value.
    """
    basis = _basis_of(space @ space.T, space.shape[1])
    slopes = np.nan_to_num(np.array([function(STEP * b) - here for b in basis.T]) / STEP)
    along: Array = space.T @ (basis @ slopes)
    return along


def _basis_of(projection: Array, count: int) -> Array:
    """An orthonormal basis (n, count) of what a projection (n, n) leaves.

    That of a QR decomposition with pivoting, of which `scipy.linalg` takes longer to import.
    """
    left, chosen = projection.copy(), []
    for _ in range(count):
        length = np.linalg.norm(left, axis=0)
        chosen.append(int(length.argmax()))
        along = left[:, chosen[-1]] / length[chosen[-1]]
        left -= np.outer(along, along @ left)
    return np.linalg.qr(projection[:, chosen])[0]


def _limited(pull: Array, variances: Array) -> Array:
    """Variances times pull, shortened where it is farther than the expansion tells."""
    distance = float(np.sqrt(np.sum(pull**2 * variances)))
    return variances * pull * min(1.0, FARTHEST / max(distance, FARTHEST))
