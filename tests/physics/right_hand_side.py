"""The right-hand side at one state, from the kernels that the steps use."""

import numpy as np

from auvident.physics.batch import place_inputs, point_system, point_work, rates
from auvident.physics.term_tables import N_INPUTS
from auvident.physics.terms import Structure


def right_hand_side(
    structure: Structure,
    active: np.ndarray,
    x: np.ndarray,
    inputs: np.ndarray,
    p: np.ndarray,
    inverse: np.ndarray,
) -> np.ndarray:
    """Time derivative (4,) of the state; zero where it is not active."""
    nothing = np.zeros(len(p), dtype=np.bool_), np.zeros(N_INPUTS, dtype=np.bool_)
    system, work = point_system(active, *nothing, structure.equations), point_work(p, 1)
    work.inverse[:, 0], work.stage[:, 0], work.rate[:] = inverse.ravel(), x, 0.0
    place_inputs(inputs, system.used, work.scalars)
    rates(1, 0.0, x, x, system, work)
    return work.rate[:, 0]
