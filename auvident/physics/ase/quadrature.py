"""Integrals along the hull, broadcast over variants, with the error controlled by refinement."""

from collections.abc import Callable

import numpy as np

from auvident.errors import NumericsError

RELATIVE_TOLERANCE = 1e-8  # of every integral, between two refinements
FIRST_NODES, MOST_NODES = 12, 384  # Gauss points per piece
LATE_NODES, LATE_TOLERANCE = 96, 1e-5  # a nose blunter than an ellipsoid converges slowly


def nodes_and_weights(edges: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Gauss-Legendre nodes on the pieces between `edges`, crowded towards their ends.

    The map (1 - cos(pi t))/2 of each piece turns the square-root ends of a rounded nose or tail
    into smooth ones.

    Parameters
    ----------
    edges : ndarray, shape (..., k)
        Ascending; pieces of zero length contribute nothing.
    count : int
        Nodes per piece.

    Returns
    -------
    nodes, weights : ndarray, shape (..., (k-1)*count)
    """
    gauss, weight = np.polynomial.legendre.leggauss(count)
    t = 0.5 * (gauss + 1.0)
    place = 0.5 * (1.0 - np.cos(np.pi * t))
    density = 0.25 * np.pi * np.sin(np.pi * t) * weight
    start, width = edges[..., :-1, None], np.diff(edges, axis=-1)[..., None]
    shape = (*edges.shape[:-1], -1)
    return (start + width * place).reshape(shape), (width * density).reshape(shape)


def integrate(
    integrands: Callable[[np.ndarray], np.ndarray], edges: np.ndarray, what: str = "the hull"
) -> np.ndarray:
    """Integrals of several functions over the same pieces, refined until they stand still.

    Parameters
    ----------
    integrands : callable
        ``xi (..., n) -> (m, ..., n)``: m functions at the nodes.
    edges : ndarray, shape (..., k)
        Ascending stations between which the functions are smooth.
    what : str
        Named in the error.

    Returns
    -------
    ndarray, shape (m, ...)

    Raises
    ------
    NumericsError
        When the finest rule still disagrees with the one before.
    """
    previous = None
    count = FIRST_NODES
    while count <= MOST_NODES:
        xi, weight = nodes_and_weights(edges, count)
        pieces = integrands(xi) * weight
        value = np.sum(pieces, axis=-1)
        if previous is not None:
            # of the integral of the magnitude: a first moment may vanish by symmetry
            change = np.abs(value - previous)
            scale = np.sum(np.abs(pieces), axis=-1)
            tolerance = RELATIVE_TOLERANCE if count < LATE_NODES else LATE_TOLERANCE
            if np.all(change <= tolerance * scale):
                return value
        previous, count = value, 2 * count
    raise NumericsError(
        f"the integrals over {what} do not converge",
        "[hull]",
        "Check the offsets for jumps.",
    )
