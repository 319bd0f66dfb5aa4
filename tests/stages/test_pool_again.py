"""Trials told again by their maneuvers, at the coefficients that all have together."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from auvident.engines.carried import internal_values
from auvident.estimation.pooling import WIDE, TrialData, pooled
from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.changes import VehicleChange
from auvident.stages.identify import identify, replay_in
from auvident.stages.pool import PoolTrial, pool
from auvident.stages.pool.again import _apart, again
from auvident.stages.pool.carry import about_common
from auvident.stages.pool.collect import collect
from auvident.stages.pool.stage import changed_since
from tests.bench.pool import trials_of_one, world_of
from tests.bench.recovery import NOISE, vehicle_and_prior
from tests.bench.world import World
from tests.engines.chain import plan_named
from tests.session import once

SEED, COUNT, PART = 3, 4, 3
SERVO = "rudder_rate_limit.rate_degps"


@once
def of_one_vehicle() -> tuple[dict[str, float], list[str]]:
    """The truth, and models of trials."""
    truth, found = trials_of_one(SEED, COUNT, PART)
    return truth, [t.model.model_dump_json(by_alias=True) for t in found]


def trials() -> list[PoolTrial]:
    truth, texts = of_one_vehicle()
    found = []
    for k, text in enumerate(texts):
        model = IdentifiedModel.model_validate_json(text)
        world = world_of(truth, 1000 * SEED + k, PART)
        replay = partial(replay_in, [world.trial], world.maneuvers, model)
        found.append(PoolTrial(f"trial-{k}", model, replay=replay))
    return found


def cost_of(model: IdentifiedModel, of: Sequence[PoolTrial] = ()) -> float:
    """Of all maneuvers, or those of some trials, by a model's coefficients; and to their prior."""
    told = model.covariance
    scale = np.array(told["scale"])
    values = {**model.values(), **internal_values(model.effects)}
    own = [k for k, s in enumerate(told["symbols"]) if "." not in s]
    common = {told["symbols"][k]: values[told["symbols"][k]] for k in own}
    away = (np.array(list(common.values())) - np.array(told["prior"])[own]) / scale[own]
    replays = [t.replay() for t in of or trials()]
    return sum(r.about(common, scale[own]).cost for r in replays) + 0.5 * float(away @ away)


def test_the_maneuvers_of_all_are_predicted_better_than_by_the_models_of_each() -> None:
    by_maneuvers = cost_of(pool(trials()).model)
    by_models = cost_of(pool([replace(t, replay=None) for t in trials()]).model)
    assert by_maneuvers < by_models + 0.1
    one_by_one = min(cost_of(t.model) for t in trials())
    assert by_maneuvers < one_by_one - 10.0


def test_its_errors_are_those_of_the_models_alone_where_these_are_near_each_other() -> None:
    """Equations and world are alike: it claims as much, and is as right."""
    truth = of_one_vehicle()[0]
    errors = []
    for found in (pool(trials()).model, pool([replace(t, replay=None) for t in trials()]).model):
        rows = [c for c in found.coefficients if c.origin == "identified" and c.data_share > 0.5]
        errors.append([(c.value - truth[c.symbol]) / c.std for c in rows])
    by_maneuvers, by_models = (np.mean(np.square(z)) for z in errors)
    assert len(errors[0]) > 10
    assert by_maneuvers < 1.3 * by_models


def test_what_nobody_claims_stays_the_trials_own() -> None:
    """Its prior counts in each, and the pooled model has the mean."""
    data = about_common(collect(trials()))
    apart, together = again(data, ()), again(data, ("rudder_rate_limit",))
    (i,) = apart.unclaimed
    assert data.names[i] == SERVO
    assert not together.unclaimed.size
    assert all(not t.information[i].any() and not t.score[i] for t in apart.data.told)
    assert all(t.information[i, i] > 0.0 for t in together.data.told)
    found = pool(trials()).model
    mean = float(apart.mean[0] * data.unit[i] + data.origin[i])
    assert internal_values(found.effects)[SERVO] == pytest.approx(mean, rel=1e-9)
    row = next(p for p in found.pooling.parameters if p.symbol == SERVO)
    assert (row.freedom, row.between_std) == (0.0, 0.0)
    assert found.covariance["fitted_variance"][i] < data.unit[i] ** 2


def test_of_what_changed_the_estimate_is_no_evidence_in_each_trial() -> None:
    """Many trials before a change know the rest as well as one that has nothing of its own."""
    information = np.array([[400.0, -396.0], [-396.0, 400.0]])
    told = TrialData(information, information @ np.array([3.0, 1.0]))  # 3: its own, before
    own, nowhere = np.array([0]), np.zeros(2)
    found = {}
    for width in (1.0, WIDE):
        trials = [_apart(told, own, np.array([width]), nowhere)[0]] * 60
        found[width] = pooled(trials, nowhere, np.ones(2)).mean[1]
    assert found[WIDE] == pytest.approx(1.0, abs=0.1)
    assert found[1.0] < 0.7  # each would hold it to the estimate, and what goes with it
    values = _apart(told, own, np.array([WIDE]), np.array([0.0, 1.0]))[1]
    assert values == pytest.approx([3.0], abs=0.01)


FIN = ("Y_uud", "N_uud")
SINCE = VehicleChange(
    kind="step",
    what="fin",
    symbols=FIN,
    sentence="since trial-2 the rudder gives 30 % less (28 to 32 %)",
    trial="trial-2",
    earliest="trial-2",
    latest="trial-2",
    size=-0.3,
    std=0.01,
    low=-0.32,
    high=-0.28,
    unit="-",
    share=True,
    score=-20.0,
    p=0.001,
)


@once
def bent() -> list[str]:
    """Models of the same trials, of which the last two have a rudder that gives 30 % less."""
    vehicle, ase = vehicle_and_prior()
    found = [t.model for t in trials()[:2]]
    for world in bent_worlds():
        made = identify(
            [world.trial], world.maneuvers, ase, vehicle, NOISE, plan=plan_named("refined")
        )
        found.append(made.model)
    return [m.model_dump_json(by_alias=True) for m in found]


def bent_worlds() -> list[World]:
    truth = dict(of_one_vehicle()[0])
    truth |= {name: 0.7 * truth[name] for name in FIN}
    return [world_of(truth, 1000 * SEED + k, PART) for k in (2, 3)]


def bent_trials() -> list[PoolTrial]:
    models = [IdentifiedModel.model_validate_json(text) for text in bent()]
    pairs = zip(models[2:], bent_worlds(), strict=True)
    since = [
        PoolTrial(f"trial-{k}", m, replay=partial(replay_in, [w.trial], w.maneuvers, m))
        for k, (m, w) in enumerate(pairs, 2)
    ]
    return [*trials()[:2], *since]


def test_what_changed_is_as_it_is_since_then() -> None:
    """Not the mean of a straight fin and a bent one; all else is that of all trials."""
    rows = bent_trials()
    now = pool(rows, changes=[SINCE]).model
    mean, last = pool(rows).model, pool(rows[2:]).model
    costs = [cost_of(model, rows[2:]) for model in (now, mean, last)]
    assert costs[0] < costs[1] - 50.0
    assert costs[0] < costs[2] + 10.0
    of_now, of_last = ({c.symbol: c.data_share for c in m.coefficients} for m in (now, last))
    assert all(of_now[name] < of_last[name] + 0.05 for name in FIN)
    assert of_now["T_nn"] > of_last["T_nn"]


def test_it_is_so_by_the_models_alone_too() -> None:
    rows = [replace(t, replay=None) for t in bent_trials()]
    now, mean = (pool(rows, changes=c).model for c in ([SINCE], []))
    costs = [cost_of(model, bent_trials()[2:]) for model in (now, mean)]
    assert costs[0] < 0.05 * costs[1]


def test_that_it_is_as_it_is_since_then_is_told() -> None:
    (told,) = (
        f
        for f in pool([replace(t, replay=None) for t in trials()], changes=[SINCE]).model.findings
        if f.code == "as-since-change"
    )
    assert told.where == "Y_uud, N_uud"
    assert told.message.startswith(SINCE.sentence) and "before trial-2" in told.message


def test_of_a_step_the_trials_before_are_different_and_of_a_drift_all_but_the_last() -> None:
    data = about_common(collect(trials()))
    late = SINCE.model_copy(update={"latest": "trial-3"})
    drift = SINCE.model_copy(update={"kind": "drift", "symbols": ("X_uu",)})
    assert changed_since(data, ()) == [set()] * 4
    assert changed_since(data, [SINCE]) == [set(FIN), set(FIN), set(), set()]
    assert changed_since(data, [late]) == [set(FIN), set(FIN), set(FIN), set()]
    both = changed_since(data, [SINCE, drift])
    assert both == [{*FIN, "X_uu"}, {*FIN, "X_uu"}, {"X_uu"}, set()]


def test_what_nobody_claims_and_changed_is_the_mean_of_the_trials_since() -> None:
    data = about_common(collect([replace(t, replay=None) for t in trials()]))
    *before, last = data.told
    slower = replace(last, score=last.score + last.information[:, data.names.index(SERVO)])
    data = replace(data, told=(*before, slower))
    since, whole = (again(data, (), [{SERVO}] * n + [()] * (4 - n)).mean[0] for n in (3, 0))
    assert since == pytest.approx(again(data.among([3]), ()).mean[0], abs=0.05)
    assert since > whole + 0.1


def test_coefficients_that_do_not_settle_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    assert not any(f.code == "pool-unsettled" for f in pool(trials()).model.findings)
    monkeypatch.setattr("auvident.stages.pool.again.ROUNDS", 1)
    monkeypatch.setattr("auvident.stages.pool.again.SETTLED", 0.0)
    monkeypatch.setattr("auvident.stages.pool.stage.SETTLED", 0.0)
    (told,) = (f for f in pool(trials()).model.findings if f.code == "pool-unsettled")
    assert told.value is not None and told.value > 0.0


def test_trials_without_maneuvers_count_as_their_models_tell_them_and_are_named() -> None:
    first, *others = trials()
    found = pool([replace(first, replay=None), *others]).model
    (told,) = (f for f in found.findings if f.code == "pooled-by-model")
    assert (told.where, told.value) == ("trial-0", 1.0)
    assert "1 of 4 trials" in told.message
    assert not any(f.code == "pooled-by-model" for f in pool(trials()).model.findings)


def test_a_pooled_model_may_be_pooled_with_what_came_since() -> None:
    """Its own maneuvers are told already: nothing of it is missed."""
    first = pool(trials()[:3]).model
    both = pool([PoolTrial("before", first), trials()[3]]).model
    whole = pool(trials()).model
    assert not any(f.code == "pooled-by-model" for f in both.findings)
    for a, b in zip(both.coefficients, whole.coefficients, strict=True):
        assert a.value == pytest.approx(b.value, abs=0.5 * b.std + 0.05 * b.prior_std)
