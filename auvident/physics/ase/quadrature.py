"""Integrals along the hull, broadcast over variants, with the error controlled by refinement."""

from collections.abc import Callable

import numpy as np

from auvident.errors import NumericsError

RELATIVE_TOLERANCE = 1e-8  # of every integral, between two refinements
FIRST_NODES, MOST_NODES = 12, 384  # Gauss points per piece


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
        value = np.sum(integrands(xi) * weight, axis=-1)
        if previous is not None:
            scale = np.maximum(np.abs(value), np.abs(previous))
            scale = np.maximum(scale, 1e-12 * np.max(scale, initial=1e-300))
            if np.all(np.abs(value - previous) <= RELATIVE_TOLERANCE * scale):
                return value
            if count >= 96 and np.all(np.abs(value - previous) <= 1e-5 * scale):
                return value  # a blunt nose or corners between offsets: five digits are enough
        previous, count = value, 2 * count
    raise NumericsError(
        f"the integrals over {what} do not converge",
        "[hull]",
        "Check the offsets for jumps.",
    )
