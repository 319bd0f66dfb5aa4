"""Pool the models of trials: which fit each other, what they say together, as a model."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from auvident.errors import InputError
from auvident.estimation.pooling import (
    Agreement,
    Distance,
    Pooled,
    TrialData,
    agreement,
    agreements,
    between_trials,
    distance,
    for_few,
    pooled,
    shrunk,
)
from auvident.schema.artifacts import ESTIMATE_CONTRADICTED, Finding
from auvident.schema.changes import VehicleChange
from auvident.schema.pooled import (
    DISAGREE,
    PooledModel,
    PooledParameter,
    PooledTrial,
    PooledValue,
    Pooling,
)
from auvident.stages.pool.again import SETTLED, again
from auvident.stages.pool.carry import about_common
from auvident.stages.pool.collect import Collected, PoolTrial, collect, shown, unit_of
from auvident.stages.pool.model import Together, model_of_all, named
from auvident.stages.pool.structural import maneuvers_of, structural_covariance

Array = npt.NDArray[Any]

LEAST_TO_JUDGE = 4  # trials: of three nobody can say which one is off
FITS_NONE = 1.0e-3  # probability of so large a distance by chance, over all trials
FAR = 2.0  # mean square distance of a trial that fits no other, along what it sees
MOST_LEFT_OUT = 1 / 3  # of the trials
FEW_TRIALS = 5  # fewer say little of the scatter between trials
CLIPPED = 0.1  # of the prior's information that was cut off, from which on it is told
SHOWN = 5  # names
FITS_NO_OTHER = "trial-fits-no-other"  # code of a finding
LAST_CHANGED = (
    "Was it logged by another vehicle, or is the log damaged? It is left out of the pooled model."
)


class Copy(NamedTuple):
    """Why the data of a trial are those of another one, and if they are so as a whole."""

    reason: str
    whole: bool


@dataclass(frozen=True)
class PoolResult:
    """The pooled model, and what trials that went in say of what near their own (for changes).

    Attributes
    ----------
    model : PooledModel
    data : Collected
        As the models of the trials tell them: one that changed is far from the others.
    values : (n,) array
        Of all together, in the units of the equations, as the models tell them.
    again : (n,) array
        The same as their maneuvers do, predicted again.
    """

    model: PooledModel
    data: Collected
    values: Array
    again: Array


def pool(
    trials: Sequence[PoolTrial], *, keep: bool = False, changes: Sequence[VehicleChange] = ()
) -> PoolResult:
    """Pool trials of one vehicle.

    Parameters
    ----------
    trials : sequence of PoolTrial
        In the order of their dates.
    keep : bool
        Whether a trial that fits no other goes in all the same.
    changes : sequence of VehicleChange
        As `changes_of` finds them among these trials. What changed is as it is since then: of it
        the trials before say nothing.

    Raises
    ------
    InputError
        They are not of one vehicle.
    """
    if not trials:
        raise InputError("there is no trial to pool", "", "Give run directories with a model.")
    twice = copies(trials)
    first = [k for k in range(len(trials)) if k not in twice]
    own = collect(trials, first)
    whole = about_common(own, first)
    out = {} if keep else strangers(whole, first)
    inside = [k for k in first if k not in out]
    whole = about_common(own, inside) if out else whole
    by_models = whole.among(inside)
    scatter = for_few(between_trials(by_models.told), len(by_models.told))
    told_again = again(by_models, named(by_models), changed_since(by_models, changes))
    data = told_again.data
    between = for_few(between_trials(data.told), len(data.told))
    found = told_again.together(between)
    together = Together(data, found, between, structural_covariance(data, found, between))
    agree, each = agreement(data.told), agreements(data.told)
    told = tuple(_trials(whole, out, twice, scatter))
    findings = (
        *_strange(told, twice),
        *_since(changes),
        *_findings(together, agree, each),
        *_by_model(told_again.by_model, len(data.trials)),
        *_unsettled(told_again.moved),
    )
    pooling = Pooling(
        trials=told,
        parameters=tuple(_parameters(together, by_models, each)),
        q=agree.q,
        freedom=agree.freedom,
        p=agree.p,
        clipped=max(t.clipped for t in data.told),
    )
    n = len(data.names)
    near = pooled(by_models.told, np.zeros(n), np.ones(n), scatter).mean
    values, anew = (by_models.origin + by_models.unit * mean for mean in (near, found.mean))
    return PoolResult(model_of_all(together, pooling, findings), by_models, values, anew)


def changed_since(data: Collected, changes: Sequence[VehicleChange]) -> list[set[str]]:
    """Parameters that each trial has otherwise than the last one.

    A step is over from the latest trial on that it may have come with, a drift with the last one.
    """
    names = [t.name for t in data.trials]
    ends = [names.index(c.latest) if c.kind == "step" else len(names) - 1 for c in changes]
    return [
        {s for c, end in zip(changes, ends, strict=True) if k < end for s in c.symbols}
        for k in range(len(names))
    ]


def copies(trials: Sequence[PoolTrial]) -> dict[int, Copy]:
    """Trials with the model of another one, or with a log of it: their data count once.

    Of two runs with a log in common the one with more logs stays, else the first.
    """
    models: dict[str, str] = {}
    logs: dict[str, str] = {}
    found = {}
    for k in sorted(range(len(trials)), key=lambda k: -len(trials[k].logs)):
        trial, key = trials[k], str(sorted(trials[k].model.values().items()))
        common = next((log for log in trial.logs if log in logs), None)
        if key in models:
            found[k] = Copy(f"it is the same as {models[key]}", whole=True)
        elif common is not None:
            found[k] = Copy(f"its log {trial.logs[common]} is in {logs[common]} too", whole=False)
        else:
            models[key] = trial.name
            logs |= dict.fromkeys(trial.logs, trial.name)
    return found


def strangers(data: Collected, candidates: Sequence[int]) -> dict[int, Distance]:
    """Trials that fit no other, with their distance from those that stay.

    The farthest one goes first, until none is farther than chance lets it be. Of the last trial
    that differs in no more than two parameters nobody can say yet whether the vehicle changed:
    it stays.
    """
    out: dict[int, Distance] = {}
    count = len(candidates)
    while count - len(out) >= LEAST_TO_JUDGE and len(out) + 1 <= MOST_LEFT_OUT * count:
        inside = [k for k in candidates if k not in out]
        between = between_trials([data.told[k] for k in inside])
        far = {k: f for k in inside if (f := _far(data, inside, k, between)) is not None}
        if not far:
            break
        worst = max(far, key=lambda k: far[k].square / far[k].directions)
        out[worst] = far[worst]
    return out


def _far(data: Collected, inside: Sequence[int], k: int, between: Array) -> Distance | None:
    """Distance of a trial from the others, if it is one that none of them explains.

    ``between`` is the variance between all of them, from which that of the others is climbed.
    """
    others = [data.told[j] for j in inside if j != k]
    scatter = for_few(between_trials(others, between), len(others))
    found = distance(data.told[k], others, scatter)
    least = max(_least(found.directions, FITS_NONE / len(data.told)), FAR * found.directions)
    square = found.rest if k == inside[-1] else found.square
    return found if found.directions and square > least else None


def _least(directions: int, p: float) -> float:
    from scipy.special import chdtri

    return float(chdtri(directions, p)) if directions else 0.0


def _parameters(
    t: Together, by_models: Collected, each: Sequence[Agreement]
) -> Iterator[PooledParameter]:
    """What is told of each parameter together, and by single models."""
    data = t.data
    shares = np.array([_share(one) for one in by_models.told])
    for i, name in enumerate(data.names):
        unit = float(data.unit[i])
        own = data.origin[i] + unit * t.found.mean[i]
        value, std = shown(name, own, unit * float(np.sqrt(t.claimed[i, i])))
        prior, prior_std = shown(name, float(data.origin[i]), unit)
        yield PooledParameter(
            symbol=name,
            unit=unit_of(name),
            value=value,
            std=std,
            prior=prior,
            prior_std=prior_std,
            share_alone=float(shares[:, i].mean()),
            share_best=float(shares[:, i].max()),
            share=float(np.clip(1.0 - t.found.covariance[i, i], 0.0, 1.0)),
            between_std=_scatter_of(t, i)[0],
            structural_std=shown(name, own, unit * float(np.sqrt(t.structural[i, i])))[1],
            q=each[i].q,
            freedom=each[i].freedom,
            p=each[i].p,
        )


def _share(told: TrialData) -> Array:
    """Share of the data in what a single trial knows."""
    n = len(told.score)
    return np.clip(1.0 - np.diag(np.linalg.inv(np.eye(n) + told.information)), 0.0, 1.0)


def _trials(
    whole: Collected, out: dict[int, Distance], twice: dict[int, Copy], between: Array
) -> Iterator[PooledTrial]:
    """Every trial with its distance from the others that stay."""
    inside = [k for k in range(len(whole.told)) if k not in out and k not in twice]
    n = len(whole.names)
    for k, trial in enumerate(whole.trials):
        others = [whole.told[j] for j in inside if j != k]
        far = out.get(k) or (distance(whole.told[k], others, between) if others else None)
        rest = pooled(others, np.zeros(n), np.ones(n), between)
        alone = pooled([whole.told[k]], np.zeros(n), np.ones(n))
        yield PooledTrial(
            trial=trial.name,
            date=trial.date,
            file=trial.file,
            logs=dict(trial.logs),
            maneuvers=maneuvers_of(trial.model),
            used=k in inside,
            reason=_reason(k, whole, out, twice),
            square=far.square if far else 0.0,
            directions=far.directions if far else 0,
            p=far.p if far else 1.0,
            clipped=whole.told[k].clipped,
            own=_own(trial),
            alone=_values(whole, alone),
            shrunk=_values(whole, shrunk(whole.told[k], rest, between)),
        )


def _reason(k: int, data: Collected, out: Mapping[int, Distance], twice: Mapping[int, Copy]) -> str:
    """Why a trial is left out; empty where it is not."""
    if k in twice:
        return twice[k].reason
    if k not in out:
        return ""
    far, findings = out[k], data.trials[k].model.findings
    most = ", ".join(data.names[i] for i in far.parameters)
    times = np.sqrt(far.square / far.directions)
    text = f"it fits no other trial: {times:.1f} times as far from them as chance lets it be, most "
    text += f"in {most}"
    if any(f.code == ESTIMATE_CONTRADICTED for f in findings):
        text += "; it contradicts the vehicle file as well"
    last = k == len(data.trials) - 1
    return text + ("; a change of the vehicle would be another reason" if last else "")


def _own(trial: PoolTrial) -> dict[str, PooledValue]:
    """Effects of a trial's own, and those of the vehicle, as its model has them."""
    return {
        f"{effect['id']}.{row['symbol']}": PooledValue(
            value=row["value"], std=row["std"], unit=row["unit"]
        )
        for effect in trial.model.effects
        if not effect.get("nuisance")
        for row in effect["parameters"]
    }


def _values(data: Collected, found: Pooled) -> dict[str, PooledValue]:
    stds = np.sqrt(np.maximum(np.diag(found.covariance), 0.0))
    rows = {}
    for i, name in enumerate(data.names):
        value, std = shown(
            name,
            float(data.origin[i] + data.unit[i] * found.mean[i]),
            float(data.unit[i] * stds[i]),
        )
        rows[name] = PooledValue(value=value, std=std, unit=unit_of(name))
    return rows


# --- findings ------------------------------------------------------------------------------


def _strange(trials: Sequence[PooledTrial], twice: Mapping[int, Copy]) -> Iterator[Finding]:
    for k, t in enumerate(trials):
        if k in twice and twice[k].whole:
            yield Finding(code="same-trial", where=t.trial, message=f"{t.reason} and counts once")
        elif k in twice:
            yield Finding(
                code="same-log",
                where=t.trial,
                message=f"{t.reason} and counts once: this run is left out",
                remedy="Pool runs that have no log in common; run by themselves the logs that only "
                "this one has.",
            )
        elif not t.used:
            yield Finding(
                code=FITS_NO_OTHER,
                where=t.trial,
                value=t.square,
                threshold=_least(t.directions, FITS_NONE / len(trials)),
                message=t.reason,
                remedy=LAST_CHANGED,
            )


def _since(changes: Sequence[VehicleChange]) -> Iterator[Finding]:
    """That what changed is as it is since then."""
    for change in changes:
        before = f"before {change.latest}" if change.kind == "step" else "but the last"
        yield Finding(
            code="as-since-change",
            where=", ".join(change.symbols),
            value=change.size,
            message=f"{change.sentence}; the pooled model has it as it is since then, of which the "
            f"trials {before} say nothing",
            remedy="Pool the runs of before by themselves for a model of the vehicle as it was.",
        )


def _findings(t: Together, agree: Agreement, each: Sequence[Agreement]) -> Iterator[Finding]:
    """What to know of the pooled coefficients."""
    data = t.data
    if 1 < len(data.trials) < FEW_TRIALS:
        yield Finding(
            code="few-trials",
            value=float(len(data.trials)),
            threshold=float(FEW_TRIALS),
            message="so few trials say little of how much the vehicle differs between them; the "
            "standard deviations may be too small where it does",
        )
    scattering = [i for i, one in enumerate(each) if one.p < DISAGREE / len(each)]
    for i in (i for i in scattering if t.between[i] > 0.0):
        scatter, unit = _scatter_of(t, i)
        yield Finding(
            code="trials-disagree",
            where=data.names[i],
            value=each[i].p,
            threshold=DISAGREE / len(each),
            message=f"differs between trials by more than their errors (scatter {scatter:.2g} "
            f"{unit}); its standard deviation contains that",
            remedy="From five trials on `changes.json` says whether it changed at one time.",
        )
    rest = [i for i in scattering if t.between[i] <= 0.0]  # with the others held, that is
    if rest:
        yield Finding(
            code="trials-disagree",
            where=", ".join(data.names[i] for i in rest),
            value=min(each[i].p for i in rest),
            threshold=DISAGREE / len(each),
            message="differs between trials by more than their errors; the scatter of others "
            "explains that, and it is taken to have none of its own",
        )
    if agree.p < DISAGREE and not scattering:
        yield Finding(
            code="trials-disagree",
            value=agree.p,
            threshold=DISAGREE,
            message="the trials differ by more than their errors, in no single coefficient",
        )
    for effect, names in data.partly.items():
        yield Finding(
            code="effect-in-some-trials",
            where=effect,
            message=f"was found in {len(names)} of {len(data.trials)} trials alone "
            f"({', '.join(names[:SHOWN])}); the pooled model is without it",
        )
    for told, trial in zip(data.told, data.trials, strict=True):
        if told.clipped > CLIPPED:
            yield Finding(
                code="wider-than-prior",
                where=trial.name,
                value=told.clipped,
                threshold=CLIPPED,
                message="its model knows a combination of coefficients worse than the prior; its "
                "data count as none there",
            )


def _by_model(names: Sequence[str], count: int) -> Iterator[Finding]:
    """Trials whose maneuvers could not be predicted again."""
    if names:
        yield Finding(
            code="pooled-by-model",
            where=", ".join(names[:SHOWN]) + (", ..." if len(names) > SHOWN else ""),
            value=float(len(names)),
            message=f"{len(names)} of {count} trials went in as their models tell them, near their "
            "own coefficients: their maneuvers are not there or not those of the model any more, "
            "the plan ended with a filter, the other plane has told a part of them, or they run "
            "away with the pooled coefficients",
            remedy="Give run directories with their ingested trials, in which all stages are up to "
            "date (`auvident status RUN`).",
        )


def _unsettled(moved: float) -> Iterator[Finding]:
    """Common coefficients that still moved in the last round."""
    if moved >= SETTLED:
        yield Finding(
            code="pool-unsettled",
            value=moved,
            threshold=SETTLED,
            message="the common coefficients still moved when the rounds of predicting all "
            "maneuvers with them ended (standard deviations)",
            remedy="See which trial is far from the others: without it they may settle.",
        )


def _scatter_of(t: Together, i: int) -> tuple[float, str]:
    """Standard deviation between trials, and its unit, as artifacts have them."""
    name, unit = t.data.names[i], float(t.data.unit[i])
    own = float(t.data.origin[i]) + unit * float(t.found.mean[i])
    return shown(name, own, unit * float(np.sqrt(t.between[i])))[1], unit_of(name)
