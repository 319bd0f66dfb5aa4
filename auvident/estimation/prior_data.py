"""What the data alone say of parameters, against their prior; it knows no vehicle.

With S the information of the data, g the slope of their half squared error and d the distance from
the mean of the prior N(0, P), the most probable distance is d* = d - C (g + P^-1 d) with the
posterior covariance C = (S + P^-1)^-1. Before the data d* had the covariance P - C. That is the
score test of the prior, and needs no estimate of what the data do not see. Of one parameter, the
others held by data and prior, it is the distance between the estimate of the data and the prior
over the standard deviation of both::

    d* / (P - C)^(1/2) = (theta_data - prior) / (P + P_data)^(1/2),   1/P_data = 1/C - 1/P
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.estimation.chances import chi_square_above
from auvident.estimation.identifiability import UNSEEN_INFORMATION

Array = npt.NDArray[Any]

# share of the certainty along a direction that comes from data with so much information
SEEN_SHARE = UNSEEN_INFORMATION / (1.0 + UNSEEN_INFORMATION)


@dataclass(frozen=True)
class DataAgainstPrior:
    """The prior against the data.

    Attributes
    ----------
    away : (n,) array
        Distance between data and prior over the standard deviation of both; zero where the data
        say nothing.
    data, data_std : (n,) array
        What the data alone say, from the mean of the prior on; not finite where nothing.
    share : (n,) array
        Share of the posterior certainty that comes from the data.
    chi_square : float
        Sum of squares along the directions that the data see.
    directions : int
        Their number.
    p : float
        Probability of a larger sum.
    """

    away: Array
    data: Array
    data_std: Array
    share: Array
    chi_square: float
    directions: int
    p: float


def compared(
    distance: Array, gradient: Array, information: Array, prior: Array, own: Array
) -> DataAgainstPrior:
    """Compare some parameters; the others are nuisance parameters with a prior.

    Parameters
    ----------
    distance : (n,) array
        Of where the data were looked at from the mean of the prior.
    gradient : (n,) array
        Of half the squared error there.
    information, prior : (n, n) array
        Of the data; inverse covariance of the prior.
    own : (k,) int array
        Parameters that are compared.
    """
    within = np.ix_(own, own)
    before, after = np.linalg.inv(prior), np.linalg.inv(information + prior)
    best = (distance - after @ (gradient + prior @ distance))[own]
    told = (before - after)[within]
    before, after = np.diag(before)[own], np.diag(after)[own]
    share = np.clip(1.0 - after / before, 0.0, 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        data, data_std = best / share, np.sqrt(after / share)
        away = np.where(share > 0.0, best / np.sqrt(share * before), 0.0)
    chi_square, directions = _along_seen(best, told, np.sqrt(before))
    p = chi_square_above(directions, chi_square) if directions else 1.0
    return DataAgainstPrior(away, data, data_std, share, chi_square, directions, p)


def _along_seen(best: Array, covariance: Array, scale: Array) -> tuple[float, int]:
    """Sum of squares over their variance along what the data see, and the number of directions."""
    shares, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    seen = shares > SEEN_SHARE
    along = vectors[:, seen].T @ (best / scale)
    return float(np.sum(along**2 / shares[seen])), int(seen.sum())
