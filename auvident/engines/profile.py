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
from auvident.engines.map_fit import Prior
from auvident.engines.setup import Outcome, Setup
from auvident.estimation.output_error import bounded_step
from auvident.schema.plan import PlanStage

Array = npt.NDArray[Any]

# [posterior standard deviations] held in turn, outwards, each from where the last one ended
MOVES = (1.0, 2.0, 3.0)


@dataclass(frozen=True)
class Profile:
    """Profile of one parameter.

    Attributes
    ----------
    best : float
        Most probable value of the parameter.
    values : (k,) array
        Of it, rising.
    root : (k,) array
        Signed root of twice the rise of the cost.
    low, high : float
        95 % interval; beyond the grid by the line through its last two points, within the bounds.
    """

    best: float
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
    task = task_about(setup, outcome, stage)
    middle = _refitted(task, outcome.parameters, np.ones(len(outcome.free), dtype=bool))
    if middle is None:
        return None
    position, scale = outcome.free[column], float(task.free.scale[column])
    best, std = middle[0], float(np.sqrt(outcome.covariance[column, column]))
    bounds = tuple(float(b[column]) for b in setup.bounds(outcome.free))
    points = {0.0: 0.0}
    for side in (-1.0, 1.0):
        points |= _outwards(task, middle, side * outcome.covariance[:, column] / std, column)
    moves = np.array(sorted(points))
    root, values = np.array([points[m] for m in moves]), best[position] + moves * std * scale
    if len(moves) <= len(MOVES) or np.any(np.diff(root) <= 0.0):
        return None
    low, high = (_crossing(values, root, side * NORMAL_95) for side in (-1.0, 1.0))
    return Profile(float(best[position]), values, root, max(low, bounds[0]), min(high, bounds[1]))


def _outwards(
    task: Task, middle: tuple[Array, float], along: Array, column: int
) -> dict[float, float]:
    """Signed roots at the moves to one side, as far as the bounds and the prediction go.

    `along` is the move (n,) of all parameters with one standard deviation of the one that is held.
    """
    (p, bottom), side, before = middle, np.sign(along[column]), 0.0
    found: dict[float, float] = {}
    for move in MOVES:
        start = task.free.moved(p, (move - before) * along)
        room = task.prior_about(start)
        inside = room.low[column] <= 0.0 <= room.high[column]
        ended = _refitted(task, start, np.arange(len(along)) != column) if inside else None
        if ended is None:
            return found
        p, cost = ended
        found[float(side * move)] = float(side * np.sqrt(2.0 * max(cost - bottom, 0.0)))
        before = move
    return found


def _refitted(task: Task, p: Array, moving: npt.NDArray[np.bool_]) -> tuple[Array, float] | None:
    """The others after a step of Gauss and Newton, and the cost there; None: it runs away."""
    found = _cost(task, p)
    if found is None:
        return None
    _, gradient, curvature = found
    room, step = task.prior_about(p), np.zeros(len(moving))
    low, high = np.minimum(room.low, 0.0)[moving], np.maximum(room.high, 0.0)[moving]
    step[moving] = bounded_step(curvature[np.ix_(moving, moving)], gradient[moving], low, high)
    p = task.free.moved(p, step)
    half = likelihood(task.output, p, task.output.no_parameter)[0]  # a third of the time
    return (p, half + _away(task.prior_about(p))) if np.isfinite(half) else None


def _cost(task: Task, p: Array) -> Normal | None:
    """Cost, gradient and curvature of likelihood and prior; None where it runs away."""
    half, gradient, curvature = likelihood(task.output, p, task.free)
    if not np.isfinite(half):
        return None
    prior = task.prior_about(p)
    pull = prior.information @ prior.mean
    return half + _away(prior), gradient - pull, curvature + prior.information


def _away(prior: Prior) -> float:
    """What the distance from the prior costs."""
    return 0.5 * float(prior.mean @ (prior.information @ prior.mean))


def _crossing(values: Array, root: Array, level: float) -> float:
    """Value at which the root reaches a level; on the line through the last two beyond them."""
    i = int(np.clip(np.searchsorted(root, level), 1, len(root) - 1))
    share = (level - root[i - 1]) / (root[i] - root[i - 1])
    return float(values[i - 1] + share * (values[i] - values[i - 1]))
