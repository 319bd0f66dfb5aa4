"""What the models of several trials say of the parameters that are the vehicle's."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.engines.carried import fitted_covariance, internal_values, prior_behind
from auvident.engines.replay import Replay
from auvident.errors import InputError
from auvident.estimation.pooling import TrialData, spread_over, told_by
from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.coefficients import ESTIMATED
from auvident.schema.effects import BY_ID, parameter_of

Array = npt.NDArray[Any]

# Standard deviations of a prior: an estimate from geometry goes with the speed of the trial (by the
# Reynolds number), and that much (drag by a tenth of its standard deviation per knot) may differ.
PRIOR_APART = 0.5
PRIOR_WIDER = 1.5  # ratio of standard deviations
LEAST_SHARE = 0.5  # of the trials that have an effect: from which on it is the vehicle's
SAME = ("vehicle", "length_m", "density_kgpm3", "rigid_body")
ONE_PLANE = (
    "Pool trials of one plane, with --plane where runs have both; `auvident combine` makes one "
    "model of both planes."
)
ONE_VEHICLE = (
    "Pool trials of one vehicle with the same vehicle file; leave the others out, or run them "
    "again with it."
)


@dataclass(frozen=True)
class PoolTrial:
    """A trial to be pooled: its name and model, when it was (ISO 8601) and where its model is.

    ``logs`` are the names of the logs behind it by what tells each from all others (a hash).
    ``replay`` loads the maneuvers behind the model, see `auvident.engines.replay`.
    """

    name: str
    model: IdentifiedModel
    date: str = ""
    file: str = ""
    logs: Mapping[str, str] = field(default_factory=dict)
    replay: Callable[[], Replay | None] | None = None


@dataclass(frozen=True)
class Collected:
    """Trials over common parameters.

    Attributes
    ----------
    trials : tuple of PoolTrial
    names : tuple of str
        Parameters of the vehicle that trials estimated: coefficients, then those of effects.
    unit : (n,) array
        Standard deviation of the prior, the widest of the trials.
    origin : (n,) array
        Mean of the prior.
    told : tuple of TrialData
        What each trial's data say, in this unit from this origin on.
    means : tuple of (n,) array
        Where each trial was identified; zero where it has no such parameter.
    at : tuple of int array
        Places of the parameters that each trial estimated.
    widened : (trials, n) array
        Variance that each trial's model added to a coefficient for its scatter between maneuvers.
    expected : (trials, n) array
        Variance of each trial's estimates by noise.
    effects : tuple of str
        Effects of the vehicle that the pooled model carries.
    partly : mapping
        Effects of the vehicle in fewer trials, with the names of those.
    """

    trials: tuple[PoolTrial, ...]
    names: tuple[str, ...]
    unit: Array
    origin: Array
    told: tuple[TrialData, ...]
    means: tuple[Array, ...]
    at: tuple[npt.NDArray[np.int64], ...]
    widened: Array
    expected: Array
    effects: tuple[str, ...]
    partly: dict[str, tuple[str, ...]]

    @property
    def widened_variance(self) -> Array:
        """Mean (n,) of what the models added."""
        return np.asarray(self.widened.mean(axis=0))

    def among(self, kept: Sequence[int]) -> "Collected":
        """Some of the trials."""
        return replace(
            self,
            trials=tuple(self.trials[k] for k in kept),
            told=tuple(self.told[k] for k in kept),
            means=tuple(self.means[k] for k in kept),
            at=tuple(self.at[k] for k in kept),
            widened=self.widened[list(kept)],
            expected=self.expected[list(kept)],
        )


def collect(trials: Sequence[PoolTrial], counted: Sequence[int] | None = None) -> Collected:
    """Trials over common parameters.

    Parameters
    ----------
    trials : sequence of PoolTrial
    counted : sequence of int, optional
        Those that say which effects are the vehicle's: a trial that is given twice says it once.

    Raises
    ------
    InputError
        They are not of one vehicle, with what differs.
    """
    refuse_others(trials)
    shared, partly = vehicle_effects([trials[k] for k in counted or range(len(trials))])
    names = _names(trials, shared)
    posteriors = [_posterior(t, names) for t in trials]
    unit = np.max([p.std_of_prior for p in posteriors], axis=0)
    weights = np.array([p.std_of_prior > 0.0 for p in posteriors], dtype=float)
    means = np.array([p.prior for p in posteriors])
    origin = (weights * means).sum(axis=0) / np.maximum(weights.sum(axis=0), 1.0)
    found = [_told(p, unit, origin) for p in posteriors]
    return Collected(
        tuple(trials),
        names,
        unit,
        origin,
        tuple(f.told for f in found),
        tuple(f.mean for f in found),
        tuple(p.at for p in posteriors),
        np.array([f.widened for f in found]),
        np.array([f.expected for f in found]),
        shared,
        partly,
    )


def refuse_others(trials: Sequence[PoolTrial]) -> None:
    """Refuse trials of another vehicle, plane or estimate than the first one."""
    first = trials[0]
    for other in trials[1:]:
        if other.model.plane != first.model.plane:
            raise InputError(
                f"its model is of the {other.model.plane} plane, that of {first.name} of the "
                f"{first.model.plane} plane",
                other.name,
                ONE_PLANE,
            )
        differs = next(_differences(first.model, other.model), "")
        if differs:
            raise InputError(
                f"is not of the same vehicle as {first.name}: {differs}", other.name, ONE_VEHICLE
            )


def other_vehicle(a: IdentifiedModel, b: IdentifiedModel) -> Iterator[str]:
    """In what the vehicle of a model ``b`` is another one than that of ``a``."""
    for key in SAME:
        one, other = getattr(a, key), getattr(b, key)
        if one != other:
            if key == "rigid_body":
                pairs = zip(one.model_dump().items(), other.model_dump().values(), strict=True)
                key, one, other = next((k, v, w) for (k, v), w in pairs if v != w)
            yield f"{key} is {other}, there {one}"


def _differences(a: IdentifiedModel, b: IdentifiedModel) -> Iterator[str]:
    yield from other_vehicle(a, b)
    rows = {c.symbol: c for c in a.estimates}
    for c in b.estimates:
        if c.symbol not in rows:
            yield f"it has {c.symbol}, which is not there"
            continue
        old = rows[c.symbol]
        wide, narrow = max(old.prior_std, c.prior_std), min(old.prior_std, c.prior_std)
        if abs(c.prior - old.prior) > PRIOR_APART * wide or wide > PRIOR_WIDER * narrow:
            yield (
                f"its prior of {c.symbol} is {c.prior:.4g} ± {c.prior_std:.2g} {c.unit}, "
                f"there {old.prior:.4g} ± {old.prior_std:.2g}"
            )


def vehicle_effects(
    trials: Sequence[PoolTrial],
) -> tuple[tuple[str, ...], dict[str, tuple[str, ...]]]:
    """Effects of the vehicle in at least `LEAST_SHARE` of the trials, and those in fewer."""
    of: dict[str, list[str]] = {}
    for t in trials:
        estimated = {s.partition(".")[0] for s in t.model.covariance["symbols"] if "." in s}
        for effect in t.model.effects:
            name = str(effect["id"])
            if name in estimated and not BY_ID[name].of_trial:
                of.setdefault(name, []).append(t.name)
    most = LEAST_SHARE * len(trials)
    shared = tuple(e for e in BY_ID if len(of.get(e, ())) >= max(most, 1.0))
    return shared, {e: tuple(names) for e, names in of.items() if e not in shared}


def _names(trials: Sequence[PoolTrial], effects: Sequence[str]) -> tuple[str, ...]:
    told = dict.fromkeys(s for t in trials for s in t.model.covariance["symbols"])
    own = [s for s in told if "." not in s]
    return (*own, *(s for s in told if "." in s and s.partition(".")[0] in effects))


@dataclass(frozen=True)
class _Posterior:
    """Dimensional; ``at`` are the places of what the trial estimated among all names."""

    at: Array
    mean: Array
    covariance: Array
    widened: Array
    prior: Array
    std_of_prior: Array


def _posterior(trial: PoolTrial, names: Sequence[str]) -> _Posterior:
    """Posterior of the shared parameters: rows and columns of the trial's own are left out."""
    model, told = trial.model, list(trial.model.covariance["symbols"])
    at = np.array([k for k, name in enumerate(names) if name in told], dtype=np.int64)
    rows = np.array([told.index(names[k]) for k in at])
    values = {**model.values(), **internal_values(model.effects)}
    scale = dict(zip(told, model.covariance["scale"], strict=True))
    covariance = fitted_covariance(model)
    wide = np.diag(np.array(model.covariance["matrix"])) - np.diag(covariance)
    own, before = {c.symbol: c.prior_std for c in model.estimates}, prior_behind(model)
    prior, std = np.zeros(len(names)), np.zeros(len(names))
    for k in at:
        prior[k], std[k] = before[names[k]], own.get(names[k], float(scale[names[k]]))
    return _Posterior(
        at,
        np.array([values[names[k]] for k in at]),
        covariance[np.ix_(rows, rows)],
        wide[rows],
        prior,
        std,
    )


@dataclass(frozen=True)
class _InUnits:
    told: TrialData
    mean: Array
    widened: Array
    expected: Array


def _told(p: _Posterior, unit: Array, origin: Array) -> _InUnits:
    """What the data say, in common units; what was added for scatter, and the variance by noise."""
    n, own = len(unit), unit[p.at]
    covariance = p.covariance / np.outer(own, own)
    variance = (p.std_of_prior[p.at] / own) ** 2
    mean, prior = (p.mean - origin[p.at]) / own, (p.prior - origin)[p.at] / own
    told = spread_over(told_by(mean, covariance, prior, variance), p.at.tolist(), n)
    widened, expected, whole = np.zeros(n), np.zeros(n), np.zeros(n)
    whole[p.at] = mean
    widened[p.at] = p.widened / own**2
    expected[p.at] = np.diag(covariance) - (covariance**2 / variance).sum(axis=1)
    return _InUnits(told, whole, widened, np.maximum(expected, 0.0))


def unit_of(name: str) -> str:
    """Unit of a parameter as artifacts have it."""
    return parameter_of(name).unit if "." in name else ESTIMATED[name].unit


def shown(name: str, value: float, std: float = 0.0) -> tuple[float, float]:
    """Value and standard deviation as artifacts have them: effects in the unit of their table."""
    return parameter_of(name).shown(value, std) if "." in name else (value, std)
