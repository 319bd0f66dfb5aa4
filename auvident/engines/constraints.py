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
from auvident.schema.artifacts import ConstraintState

Array = npt.NDArray[Any]

# Of drift and turn. Coefficients of a sample trial that were pushed by five standard deviations and
# moved inside again then gained energy in at most 5 % of all samples (60 draws).
STATES = 40
OUTERMOST = 0.99  # quantile of the samples that is the edge of the envelope: no stray reading is
SPEEDS = (0.05, 0.5, 0.95)  # quantiles of the speed, straight ahead


def envelope(records: Iterable[Record]) -> Array:
    """States (k, 3) spread over the envelope flown: straight ahead, and samples of drift and turn.

    Each sample is the one farthest from those before it (Gonzalez 1985), port and starboard alike.
    """
    given = [r.given[:, :3] for r in records]
    states = np.concatenate(given) if given else np.zeros((0, 3))
    states = states[np.isfinite(states).all(axis=1)]
    if not len(states):
        return np.zeros((0, 3))
    straight = np.zeros((len(SPEEDS), 3))
    straight[:, 0] = np.quantile(states[:, 0], SPEEDS)
    states[:, 1:] *= np.where(states[:, 2:] < 0.0, -1.0, 1.0)
    edge = np.maximum(np.quantile(np.abs(states), OUTERMOST, axis=0), np.finfo(float).tiny)
    states = states[(np.abs(states) <= edge).all(axis=1)]
    return np.concatenate([straight, _spread(states, edge)])


def _spread(states: Array, unit: Array) -> Array:
    """Some states, each the farthest in units from those before it."""
    distance, chosen = np.full(len(states), np.inf), [0] if len(states) else []
    for _ in range(min(STATES, len(states)) - 1):
        away = ((states - states[chosen[-1]]) / unit) ** 2
        distance = np.minimum(distance, away.sum(axis=1))
        chosen.append(int(np.argmax(distance)))
    return states[chosen]


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


def states_at(
    constraints: Constraints, parameters: Array, costs: Mapping[str, float]
) -> tuple[ConstraintState, ...]:
    """Where a model stands to each constraint; of several states flown to the worst.

    Parameters
    ----------
    parameters : (n_parameters,) array
    costs : mapping
        As of `by_constraint`; what is not there costs nothing.
    """
    value, _ = constraints(parameters)
    least: dict[str, float] = {}
    for name, g in zip(constraints.ids, value.tolist(), strict=True):
        least[name] = min(g, least.get(name, g))
    told = {name: costs.get(name, 0.0) for name in least}
    return tuple(
        ConstraintState(id=name, value=g, active=told[name] > 0.0, cost_nats=told[name])
        for name, g in least.items()
    )
