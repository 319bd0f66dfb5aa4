"""What the data told: shares, correlations, and the directions they left to the prior."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

# A direction is called unseen when the data add less than this to the prior's information
# about it: its standard deviation then fell by less than a fifth.
UNSEEN_INFORMATION = 0.5
# Eigenvalues this small beside the largest are zero to rounding: no data of any length or
# quality would see the direction, it follows from the equations.
STRUCTURAL_RATIO = 1.0e-10
ROUNDED = 6  # decimals of shares that are compared: rounding must not choose
SMALL_WEIGHT = 0.1  # components of a direction below this share of the largest are not named
REPORTED_CORRELATION = 0.3


@dataclass(frozen=True)
class Direction:
    """A direction in parameter space, in units of the prior standard deviations.

    Attributes
    ----------
    weights : (n,) array
        The largest component is +1.
    information : float
        The data's information over the prior's.
    structural : bool
        Whether the equations alone hide it.
    """

    weights: Array
    information: float
    structural: bool

    def named(self, symbols: Sequence[str]) -> list[tuple[str, float]]:
        """Symbols and weights worth naming, largest first."""
        order = np.argsort(-np.abs(self.weights), kind="stable")
        return [
            (symbols[i], round(float(self.weights[i]), 3))
            for i in order
            if abs(self.weights[i]) >= SMALL_WEIGHT
        ]


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


def unseen_directions(information: Array, blocks: Sequence[Sequence[int]]) -> list[Direction]:
    """Directions that the data cannot see, structural ones first, then least seen first.

    Parameters
    ----------
    information : (n, n) array
        Fisher information of the data, in units of the prior standard deviations.
    blocks : sequence of index sequences
        Parameters of each set of equations. A direction that the equations hide lies within one
        (a null vector of a principal block, padded with zeros, is one of the whole), so it is
        looked for there and not mixed with the others'.

    Returns
    -------
    list of Direction
        Those with less than `UNSEEN_INFORMATION`.
    """
    symmetric = 0.5 * (information + information.T)
    values, vectors = np.linalg.eigh(symmetric)
    floor = STRUCTURAL_RATIO * max(float(values[-1]), 0.0)
    found = []
    for block in blocks:
        part, directions = np.linalg.eigh(symmetric[np.ix_(block, block)])
        for vector in _reduced(directions[:, part <= floor]).T:
            whole = np.zeros(len(symmetric))
            whole[list(block)] = vector
            found.append(_direction(whole, 0.0, True))
    for value, vector in zip(values, vectors.T, strict=True):
        if floor < value < UNSEEN_INFORMATION:
            found.append(_direction(vector, float(value), False))
    return found


def _reduced(basis: Array) -> Array:
    """Of all bases of a space the one (n, k) with 1 in k chosen rows where the others have 0.

    Eigenvectors of equal eigenvalues are any basis: rounding turns them. Chosen are, one after the
    other, the rows that have most of the space, the first of equal ones.
    """
    projector, rows = basis @ basis.T, []
    rest = projector.copy()
    for _ in range(basis.shape[1]):
        row = int(np.argmax(np.round(np.diag(rest), ROUNDED)))
        rows.append(row)
        rest -= np.outer(rest[:, row], rest[row]) / rest[row, row]
    reduced: Array = projector[:, rows] @ np.linalg.inv(projector[np.ix_(rows, rows)])
    return reduced


def _direction(vector: Array, information: float, structural: bool) -> Direction:
    return Direction(vector / vector[np.argmax(np.abs(vector))], information, structural)
