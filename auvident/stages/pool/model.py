"""The pooled model: as `identify` writes it, so that everything that takes a model takes it."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from auvident.constants import BEYOND_CHANCE_NATS, NOT_MOVED, USUAL_SPEED_MPS
from auvident.engines.carried import LEADERS, effect_rows, free_behind
from auvident.engines.constraints import by_constraint, in_units, states_at
from auvident.engines.flown import joined
from auvident.estimation.identifiability import correlations
from auvident.estimation.inequalities import nearest
from auvident.estimation.pooling import Pooled
from auvident.physics.consistency import BY_CONSTRAINT, Basis, Constraints, constraints_of
from auvident.physics.terms import Structure, parameter_vector, structure_of
from auvident.schema.artifacts import (
    Finding,
    IdentifiedModel,
    LeftOutSummary,
    ModelCoefficient,
    ModelConstant,
    ModelError,
)
from auvident.schema.coefficients import BY_SYMBOL, prime_unit
from auvident.schema.effects import parameter_of
from auvident.schema.pooled import POOLED, PooledModel, Pooling
from auvident.stages.pool.collect import Collected, shown

Array = npt.NDArray[Any]
T = TypeVar("T")

# Drift a / u and turn b L / u of moderate maneuvers, in which no hull gains energy; ahead at first.
# The states that were flown stand in the logs, which are not read again.
MODERATE = ((0.0, 0.0), (0.1, 0.3), (-0.1, 0.3), (0.1, -0.3), (-0.1, -0.3))


@dataclass(frozen=True)
class Together:
    """What trials say together, in units of the prior.

    Attributes
    ----------
    data : Collected
    found : Pooled
    between : (n,) array
        Variance between trials.
    structural : (n, n) array
        Covariance of what the equations lack in every trial.
    """

    data: Collected
    found: Pooled
    between: Array
    structural: Array

    @cached_property
    def claimed(self) -> Array:
        """Covariance with what the equations lack; no variance is larger than the prior's."""
        whole = self.found.covariance + self.structural
        kept = np.minimum(1.0, 1.0 / np.sqrt(np.diag(whole)))
        return whole * np.outer(kept, kept)


def model_of_all(together: Together, pooling: Pooling, findings: Sequence[Finding]) -> PooledModel:
    """The model of all trials, within what physics knows."""
    first = _model(together, together.found.mean, pooling, findings)
    basis, constraints = _constraints(first, together)
    moved, cost = _inside(first, together, basis, constraints)
    if not moved.any():
        return _with_states(first, constraints, {})
    costs = by_constraint(constraints, cost)
    told = [*findings, *_against_physics(costs)]
    model = _model(together, together.found.mean + moved, pooling, told)
    return _with_states(model, constraints, dict(costs))


def _model(t: Together, mean: Array, pooling: Pooling, findings: Sequence[Finding]) -> PooledModel:
    """The model with a mean in units of the prior."""
    data = t.data
    newest = data.trials[-1].model
    values = dict(zip(data.names, (data.origin + data.unit * mean).tolist(), strict=True))
    rows = tuple(_rows(newest, t, values))
    structure = structure_of(newest.plane, data.effects)
    vector = _vector(newest, structure, values)
    parameters = tuple(
        p.model_copy(update={"value": shown(p.symbol, values[p.symbol])[0]})
        for p in pooling.parameters
    )
    return PooledModel(
        vehicle=newest.vehicle,
        plane=newest.plane,
        filter=newest.filter,
        engine=newest.engine,
        plan=POOLED,
        length_m=newest.length_m,
        density_kgpm3=newest.density_kgpm3,
        rigid_body=newest.rigid_body,
        sensing=newest.sensing,
        flown=joined([t.model.flown for t in data.trials if t.model.flown]),
        coefficients=tuple(r for r in rows if isinstance(r, ModelCoefficient)),
        constants=tuple(r for r in rows if not isinstance(r, ModelCoefficient)),
        effects=effect_rows(structure, vector, _stds(t), {}, named(data)),
        covariance=_covariance(t),
        correlations=correlations(t.found.covariance, data.names),
        left_out=_left_out(data),
        findings=(*findings, *_not_seen(rows)),
        pooling=pooling.model_copy(update={"parameters": parameters}),
    )


def _vector(model: IdentifiedModel, structure: Structure, values: dict[str, float]) -> Array:
    own = {s: v for s, v in values.items() if "." not in s}
    own |= {f: own[lead] for f, lead in LEADERS.items() if lead in own}
    effects = {s: v for s, v in values.items() if "." in s}
    return parameter_vector(model.plane, own, model.rigid_body, effects, structure)


def _stds(t: Together) -> dict[str, float]:
    spread = t.data.unit * np.sqrt(np.diag(t.claimed))
    return dict(zip(t.data.names, spread.tolist(), strict=True))


def named(data: Collected) -> tuple[str, ...]:
    """Effects that at least half of the trials which carry them have by name."""
    found = []
    for name in data.effects:
        rows = [e for t in data.trials for e in t.model.effects if e["id"] == name]
        if 2 * sum(not e.get("nuisance") for e in rows) >= len(rows):
            found.append(name)
    return tuple(found)


def _rows(
    newest: IdentifiedModel, t: Together, values: dict[str, float]
) -> Iterator[ModelConstant]:
    """Coefficients and constants; what no trial estimated stays as the newest model has it."""
    data = t.data
    for c in newest.estimates:
        name = LEADERS.get(c.symbol, c.symbol) if c.origin == "kinematic" else c.symbol
        if name not in data.names:
            yield c
            continue
        i = data.names.index(name)
        unit, share = float(data.unit[i]), float(1.0 - t.found.covariance[i, i])
        update: dict[str, Any] = {
            "value": values[name],
            "std": unit * float(np.sqrt(t.claimed[i, i])),
            "prior": float(data.origin[i]) if c.symbol == name else c.prior,
            "prior_std": unit if c.symbol == name else c.prior_std,
            "data_share": float(np.clip(share, 0.0, 1.0)),
            "std_filter": unit * float(np.sqrt(t.found.covariance[i, i])),
            "std_jackknife": None,
        }
        if c.origin in ("ase", "given"):  # held in the newest trial, estimated in another
            update["origin"] = "identified"
        if c.symbol in BY_SYMBOL:
            unit_of_prime = prime_unit(c.symbol, newest.density_kgpm3, newest.length_m)
            update["prime"] = values[name] / unit_of_prime
        yield c.model_copy(update=update)


def _covariance(t: Together) -> dict[str, Any]:
    """As `identify` writes it: the scatter is what the equations lack."""
    scale, data = t.data.unit, t.data
    wide = t.found.covariance + np.diag(np.diag(t.claimed) - np.diag(t.found.covariance))
    unit = np.outer(scale, scale)
    return {
        "symbols": list(data.names),
        "matrix": (wide * unit).tolist(),
        "fitted_variance": (np.diag(t.found.covariance) * scale**2).tolist(),
        "scale": scale.tolist(),
        "prior": data.origin.tolist(),
        "scatter": ((t.claimed - t.found.covariance) * unit).tolist(),
    }


def _left_out(data: Collected) -> LeftOutSummary | None:
    """Maneuvers left out in each trial, all together: bands are made of their errors.

    Where some of the hulls hardly keep their course, so may the pooled one: its band then has
    their pushes (`auvident.engines.falling`), which their errors were judged with.
    """
    found = [t.model.left_out for t in data.trials if t.model.left_out is not None]
    if not found:
        return None
    errors = _by_channel([s.model_error for s in found])
    spreads = _by_channel([s.spread for s in found])
    pushes = _by_channel([s.push for s in found])
    return LeftOutSummary(
        maneuvers=tuple(m for s in found for m in s.maneuvers),
        spread={c: float(np.sqrt(np.mean(np.square(v)))) for c, v in spreads.items()},
        model_error={
            c: ModelError(
                std=float(np.sqrt(np.mean([e.std**2 for e in rows]))),
                growth=rows[0].growth,
                factor=float(np.mean([e.factor for e in rows])),
            )
            for c, rows in errors.items()
        },
        push={c: float(np.sqrt(np.mean(np.square(v)))) for c, v in pushes.items()},
    )


def _by_channel(rows: Sequence[Mapping[str, T]]) -> dict[str, list[T]]:
    """What each trial has of a channel, of all channels that some of them have."""
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: [row[name] for row in rows if name in row] for name in names}


# --- physics -------------------------------------------------------------------------------


def _constraints(model: PooledModel, t: Together) -> tuple[Array, Constraints]:
    """The vector behind the model, and what physics asks of it."""
    structure = structure_of(model.plane, t.data.effects)
    prior = _vector(model, structure, dict(zip(t.data.names, t.data.origin, strict=True)))
    std = np.zeros(len(prior))
    for name, unit in zip(t.data.names, t.data.unit, strict=True):
        std[structure.index(name)] = unit
    speed, length = USUAL_SPEED_MPS, model.length_m
    flown = np.array([[speed, a * speed, b * speed / length] for a, b in MODERATE])
    return prior, constraints_of(Basis(structure, prior, std, flown))


def _inside(
    model: PooledModel, t: Together, prior: Array, constraints: Constraints
) -> tuple[Array, Array]:
    """Move of the mean (n,) to the most probable one that physics allows; cost by constraint."""
    free, _ = free_behind(model)
    within = in_units(constraints, free, prior, t.data.origin)
    names = t.data.names
    low = np.full(len(names), -np.inf)
    for i, name in enumerate(names):
        if "." in name and parameter_of(name).low == 0.0:
            low[i] = -t.data.origin[i] / t.data.unit[i]
    high = np.full(len(names), np.inf)
    mean = np.maximum(t.found.mean, low)
    information = np.linalg.inv(t.found.covariance)
    best = nearest(within, mean, information, low, high)
    value, _ = within(mean)
    moved = best - mean
    cost = 0.5 * float(moved @ information @ moved)
    broken = np.maximum(-value, 0.0)
    return best - t.found.mean, cost * broken / max(float(broken.sum()), np.finfo(float).tiny)


def _with_states(
    model: PooledModel, constraints: Constraints, costs: dict[str, float]
) -> PooledModel:
    """The model with where it stands to what physics knows."""
    structure = structure_of(model.plane, tuple(str(e["id"]) for e in model.effects))
    effects = {n: float(v) for e in model.effects for n, v in e["internal"].items()}
    vector = _vector(model, structure, {**model.values(), **effects})
    return model.model_copy(update={"constraints": states_at(constraints, vector, costs)})


def _against_physics(costs: Any) -> Iterator[Finding]:
    for name, cost in costs.items():
        if cost > BEYOND_CHANCE_NATS:
            yield Finding(
                code="against-physics",
                where=name,
                value=cost,
                threshold=BEYOND_CHANCE_NATS,
                message=f"the trials ask for {BY_CONSTRAINT[name].asks} (cost {cost:.0f} nats): "
                f"{BY_CONSTRAINT[name].lacks}",
                remedy="The model keeps what physics allows; look for the effect in the trials.",
            )


def _not_seen(rows: Sequence[ModelConstant]) -> Iterator[Finding]:
    for row in rows:
        if row.origin == "identified" and row.data_share < NOT_MOVED:
            yield Finding(
                code="not-seen",
                where=row.symbol,
                value=row.data_share,
                threshold=NOT_MOVED,
                message="not identified: all trials together hardly show it, so its value comes "
                "from the prior",
            )
