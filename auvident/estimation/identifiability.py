"""What the data told: shares, correlations, and the directions they left to the prior."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

# A direction is called unidentifiable when the data add less than this to the prior's
# information about it: its standard deviation then fell by less than a fifth.
UNSEEN_INFORMATION = 0.5
SMALL_WEIGHT = 0.15  # components of a direction below this share of the largest are not named
REPORTED_CORRELATION = 0.3


def data_shares(covariance: Array) -> Array:
    """Share of the final certainty of each parameter that came from the data.

    Parameters
    ----------
    covariance : (n, n) array
        Posterior, in units of the prior standard deviations.

    Returns
    -------
    (n,) array
        1 - posterior variance / prior variance, between 0 and 1.
    """
    return np.clip(1.0 - np.diag(covariance), 0.0, 1.0)


def correlations(covariance: Array, symbols: Sequence[str]) -> dict[str, dict[str, float]]:
    """Posterior correlations worth naming, by symbol."""
    spread = np.sqrt(np.diag(covariance))
    matrix = covariance / np.outer(spread, spread)
    return {
        a: {
            b: round(float(matrix[i, j]), 4)
            for j, b in enumerate(symbols)
            if j != i and abs(matrix[i, j]) >= REPORTED_CORRELATION
        }
        for i, a in enumerate(symbols)
    }


def combinations(
    covariance: Array, symbols: Sequence[str]
) -> list[tuple[list[str], list[float], float]]:
    """Directions in units of the prior that the data cannot see, least seen first.

    Eigenvectors of the data's information relative to the prior's.

    Returns
    -------
    list of (symbols, weights, information)
        Weights are in prior standard deviations, the largest is +1; information is the data's
        over the prior's.
    """
    information = np.linalg.inv(covariance) - np.eye(len(symbols))
    values, vectors = np.linalg.eigh(0.5 * (information + information.T))
    found = []
    for value, vector in zip(values, vectors.T, strict=True):
        if value >= UNSEEN_INFORMATION:
            break
        weights = vector / vector[np.argmax(np.abs(vector))]
        named = [i for i in np.argsort(-np.abs(weights)) if abs(weights[i]) >= SMALL_WEIGHT]
        found.append(
            (
                [symbols[i] for i in named],
                [round(float(weights[i]), 3) for i in named],
                max(float(value), 0.0),
            )
        )
    return found
