"""Profile of the posterior: how far a parameter may go while the others follow it.

Half the squared error and half the squared distance from the prior make the cost. Held at some
values, a parameter leaves the others to be fitted again: twice the rise of the cost has its root,
with the sign of the move, where a Gaussian would have the move in standard deviations. The 95 %
interval ends where that root is 1.96.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import NORMAL_95
from auvident.engines.estimator import Task, task_about
from auvident.engines.free_run import Normal, likelihood
from auvident.engines.setup import Outcome, Setup
from auvident.estimation.output_error import bounded_step
from auvident.schema.plan import PlanStage

Array = npt.NDArray[Any]

# [posterior standard deviations] held in turn, outwards, each from where the last one ended
MOVES = (0.75, 1.5, 2.25, 3.0)
STEPS = 2  # of Gauss and Newton for the others at each


@dataclass(frozen=True)
class Profile:
    """Profile of one parameter.

    Attributes
    ----------
    values : (k,) array
        Of the parameter, rising; the middle one is the most probable.
    root : (k,) array
        Signed root of twice the rise of the cost.
    low, high : float
        95 % interval; beyond the grid by the line through its last two points.
    """

    values: Array
    root: Array
    low: float
    high: float


def profile_of(setup: Setup, outcome: Outcome, stage: PlanStage, column: int) -> Profile | None:
    """Profile of a free parameter about an outcome; None where the prediction runs away.

    Parameters
    ----------
    column : int
        Position among the free parameters.
    """
    task, n = task_about(setup, outcome, stage), len(outcome.free)
    middle = _refitted(task, outcome.parameters, np.ones(n, dtype=bool))
    if middle is None:
        return None
    best, bottom = middle
    std = float(np.sqrt(outcome.covariance[column, column]))
    points = {0.0: 0.0}
    for side in (-1.0, 1.0):
        p, before = best, 0.0
        for move in MOVES:
            by = np.zeros(n)
            by[column] = side * (move - before) * std
            found = _refitted(task, task.free.moved(p, by), np.arange(n) != column)
            if found is None:
                break
            p, cost = found
            points[side * move] = side * np.sqrt(2.0 * max(cost - bottom, 0.0))
            before = move
    moves = np.array(sorted(points))
    root = np.array([points[move] for move in moves])
    if len(moves) < len(MOVES) or np.any(np.diff(root) <= 0.0):
        return None
    scale = float(task.free.scale[column])
    values = float(best[outcome.free[column]]) + moves * std * scale
    low, high = (_crossing(values, root, side * NORMAL_95) for side in (-1.0, 1.0))
    return Profile(values, root, low, high)


def _refitted(task: Task, p: Array, moving: npt.NDArray[np.bool_]) -> tuple[Array, float] | None:
    """The others fitted again from p on, and the cost there; None where it runs away."""
    for _ in range(STEPS):
        found = _cost(task, p)
        if found is None:
            return None
        _, gradient, curvature = found
        bounds = task.prior_about(p)
        step = np.zeros(len(moving))
        low, high = np.minimum(bounds.low, 0.0)[moving], np.maximum(bounds.high, 0.0)[moving]
        step[moving] = bounded_step(curvature[np.ix_(moving, moving)], gradient[moving], low, high)
        p = task.free.moved(p, step)
    found = _cost(task, p)
    return None if found is None else (p, found[0])


def _cost(task: Task, p: Array) -> Normal | None:
    """Cost, gradient and curvature of likelihood and prior; None where it runs away."""
    half, gradient, curvature = likelihood(task.output, p, task.free)
    if not np.isfinite(half):
        return None
    prior = task.prior_about(p)
    pull = prior.information @ prior.mean
    return half + 0.5 * float(prior.mean @ pull), gradient - pull, curvature + prior.information


def _crossing(values: Array, root: Array, level: float) -> float:
    """Value at which the root reaches a level; on the line through the last two beyond them."""
    i = int(np.clip(np.searchsorted(root, level), 1, len(root) - 1))
    share = (level - root[i - 1]) / (root[i] - root[i - 1])
    return float(values[i - 1] + share * (values[i] - values[i - 1]))
