"""Named entries of a parameter vector."""

from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


def values_of(wanted: tuple[str, ...], parameters: tuple[str, ...], p: Array) -> Array:
    """Values of some parameters from a vector of all; absent ones are zero."""
    there, places = _places(wanted, parameters)
    found = np.zeros(len(wanted))
    found[there] = p[places]
    return found


@cache
def _places(wanted: tuple[str, ...], parameters: tuple[str, ...]) -> tuple[Array, Array]:
    """Which of the wanted are there, and where."""
    there = [i for i, name in enumerate(wanted) if name in parameters]
    places = [parameters.index(wanted[i]) for i in there]
    return np.array(there, dtype=np.int64), np.array(places, dtype=np.int64)
