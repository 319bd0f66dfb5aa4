"""How fits and filters keep what physics knows: in the units of a fit, and after a filter.

`physics.consistency` has the constraints, `estimation.inequalities` the steps that keep them.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.engines.prediction import Free
from auvident.engines.records import Record
from auvident.estimation.inequalities import Inequalities
from auvident.physics.consistency import Constraints

Array = npt.NDArray[Any]

DIRECTIONS = 12  # half a circle of drift and turn; the hull is the same to both sides
OUTERMOST = 0.99  # quantile of the samples that is the edge of the envelope: no stray reading is
SPEEDS = (0.05, 0.5, 0.95)  # quantiles of the speed, straight ahead


def envelope(records: Iterable[Record]) -> Array:
    """States (k, 3) about the envelope flown: straight ahead, and the farthest of drift and turn.

    Those of drift and turn are samples, with the speed that they had.
    """
    given = [r.given[:, :3] for r in records]
    states = np.concatenate(given) if given else np.zeros((0, 3))
    states = states[np.isfinite(states).all(axis=1)]
    if not len(states):
        return np.zeros((0, 3))
    lateral = np.abs(states[:, 1:])
    unit = np.maximum(np.quantile(lateral, OUTERMOST, axis=0), np.finfo(float).tiny)
    rank = int(OUTERMOST * (len(states) - 1))
    found = [(float(u), 0.0, 0.0) for u in np.quantile(states[:, 0], SPEEDS)]
    for angle in np.arange(DIRECTIONS) * np.pi / DIRECTIONS:
        along = np.abs(states[:, 1:] / unit @ np.array([np.cos(angle), np.sin(angle)]))
        found.append(tuple(states[np.argpartition(along, rank)[rank]]))
    return np.array(found)


def in_units(
    constraints: Constraints, free: Free, start: Array, origin: Array | None = None
) -> Inequalities:
    """The constraints on free parameters that count in units of their scale.

    Parameters
    ----------
    constraints : Constraints
    free : Free
    start : (n_parameters,) array
        Values of the others.
    origin : (n_free,) array, optional
        From where they count; without it from the start.
    """
    moved, zero = free.column >= 0, start[free.positions] if origin is None else origin
    units = np.zeros((len(free.column), len(free.positions)))
    units[moved, free.column[moved]] = free.scale[free.column[moved]]

    def inequalities(theta: Array) -> tuple[Array, Array]:
        value, slopes = constraints(free.at(start, zero + free.scale * theta))
        return value, slopes @ units

    return inequalities


def by_constraint(constraints: Constraints, costs: Array) -> Mapping[str, float]:
    """Cost of each constraint, its rows together [nats]."""
    found = dict.fromkeys(constraints.ids, 0.0)
    for name, cost in zip(constraints.ids, costs, strict=True):
        found[name] += float(cost)
    return found
