"""Other seeds for every test: one that holds for its own alone is found so.

``AUVIDENT_TEST_SEED=1000 pytest`` adds 1000 to every seed that code of the tests gives to a
generator of random numbers; those that the program gives stay as they are.
"""

import os
import random
import sys
from pathlib import Path
from typing import Any

import numpy as np

VARIABLE = "AUVIDENT_TEST_SEED"
HERE = str(Path(__file__).resolve().parent)
_generator = np.random.default_rng


def _moved(seed: Any) -> Any:
    """The seed as it is, or moved where the caller's caller is a test."""
    caller = sys._getframe(2).f_code.co_filename
    moves = isinstance(seed, int | np.integer) and caller.startswith(HERE)
    return int(seed) + int(os.environ.get(VARIABLE, "0")) if moves else seed


def default_rng(seed: Any = None) -> np.random.Generator:
    return _generator(_moved(seed))


class Random(random.Random):
    """`random.Random` from another seed."""

    def __init__(self, x: Any = None) -> None:
        super().__init__(_moved(x))


def move_all() -> None:
    """From now on, where the environment asks for it."""
    if os.environ.get(VARIABLE, "0") != "0":
        np.random.default_rng = default_rng  # type: ignore[assignment]
        random.Random = Random  # type: ignore[misc]
