"""Pooled models of trials that were simulated from known coefficients by equations of their own."""

import json
import math
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.linalg import block_diag

from auvident.engines.carried import (
    claimed_covariance,
    fitted_covariance,
    internal_values,
    vector_behind,
)
from auvident.engines.predictive import pushes_behind
from auvident.errors import InputError
from auvident.estimation.change import FoundChange
from auvident.estimation.pooling import Pooled, TrialData, pooled
from auvident.report.figures_campaign import over_trials
from auvident.report.tables import Number
from auvident.report.tables_campaign import changes as changes_table
from auvident.report.tables_campaign import pooled_parameters
from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.effects import BY_ID, EFFECTS, parameter_of
from auvident.schema.outcome import severity
from auvident.schema.pooled import PooledModel
from auvident.stages.pool import PoolResult, PoolTrial, changes_of, pool
from auvident.stages.pool.carry import about_common, carrier, map_of
from auvident.stages.pool.changes import LEAST_SHARE, ShareOf, _Teller, of_shares, quantities
from auvident.stages.pool.collect import collect, refuse_others
from auvident.stages.pool.model import Together, model_of_all
from auvident.stages.pool.stage import strangers
from auvident.stages.pool.structural import structural_covariance
from tests.bench import pool as bench
from tests.session import once

PLAN, PART = "together", 3
DAY = "2026-05-{:02d}T08:00:00"
OF_THE_TRIAL = {
    "current", "current_drift", "wave", "vertical_current", "one_off_event", "rudder_offset",
    "elevator_offset", "thrust_sag", "thrust_step", "dvl_delay", "gyro_delay", "gyro_bias",
    "q_bias", "pitch_bias", "weight_change", "buoyancy_gradient", "weight_excess",
}  # fmt: skip


@once
def one_vehicle() -> tuple[dict[str, float], list[str]]:
    """The truth, and the models of four trials of it."""
    truth, found = bench.trials_of_one(2, 4, PART, PLAN)
    return truth, [t.model.model_dump_json(by_alias=True) for t in found]


@once
def another_vehicle() -> str:
    """The model of a trial of another one."""
    return bench.trials_of_one(4, 1, PART, PLAN)[1][0].model.model_dump_json(by_alias=True)


def models() -> list[IdentifiedModel]:
    return [IdentifiedModel.model_validate_json(text) for text in one_vehicle()[1]]


def result_value(result: PoolResult, name: str) -> float:
    """Value of a parameter in the pooled model, internal."""
    return {**result.model.values(), **internal_values(result.model.effects)}[name]


def trials(found: list[IdentifiedModel]) -> list[PoolTrial]:
    return [PoolTrial(f"trial-{k}", m, DAY.format(k + 1)) for k, m in enumerate(found)]


def test_the_claims_of_the_pooled_model_hold() -> None:
    truth, found = one_vehicle()[0], pool(trials(models())).model
    rows = [c for c in found.coefficients if c.origin == "identified" and c.data_share > 0.5]
    z = np.array([(c.value - truth[c.symbol]) / c.std for c in rows])
    assert len(z) > 10
    assert np.mean(z**2) < 2.5  # its errors hang together through the scales that nobody sees
    along = np.array(bench.along_seen(trials(models()), truth))
    assert 0.5 < np.mean(along**2) < 1.8  # 99.9 % of chi-square over its 18 directions
    assert found.pooling.p > 1e-3


def test_all_trials_see_more_than_any_of_them() -> None:
    found = pool(trials(models())).model
    for p in found.pooling.parameters:
        assert p.share >= p.share_best - 0.05
    left = [(1.0 - p.share) / (1.0 - p.share_best) for p in found.pooling.parameters]
    assert sum(ratio < 0.95 for ratio in left) > 5


def test_no_scale_is_seen_that_no_trial_sees() -> None:
    own = collect(trials(models()))
    n = len(own.names)
    common = about_common(own)
    hidden = np.linalg.eigvalsh(sum(t.information for t in common.told))[:4]
    added = np.linalg.eigvalsh(sum(t.information for t in own.told))[:4]
    assert np.all(np.abs(hidden) < 1e-3)
    assert added[-1] > 1.0  # each about its own coefficients: a scale that is not there
    theta = pooled(common.told, np.zeros(n), np.ones(n)).mean
    again = carrier(own)(theta)
    assert again[0].information == pytest.approx(common.told[0].information, rel=1e-2, abs=1.0)


def test_one_trial_pooled_is_itself() -> None:
    """In all that motions tell; of the scales they do not, the most probable ones are taken."""
    (first, *_) = models()
    result = pool([PoolTrial("only", first)])
    motions = map_of(result.data)
    own = result.data.means[0]
    theta = np.array([result_value(result, name) for name in result.data.names])
    theta = (theta - result.data.origin) / result.data.unit
    slopes = motions.slopes(own)
    fitted = fitted_covariance(first) / np.outer(result.data.unit, result.data.unit)
    std = np.sqrt(np.einsum("qi,ij,qj->q", slopes, fitted, slopes))
    away = np.abs(motions.at(theta) - motions.at(own))[std > 1e-9] / std[std > 1e-9]
    assert away.max() < 0.5
    for c in first.coefficients:
        mine = next(m for m in result.model.coefficients if m.symbol == c.symbol)
        assert mine.value == pytest.approx(c.value, abs=c.prior_std)
        assert mine.std_filter == pytest.approx(c.std_filter, rel=0.15)
    assert {row[-1] for row in pooled_parameters(result.model).rows} == {""}  # with whom?
    both = pooled_parameters(pool(trials(models())).model).rows
    assert any(isinstance(row[-1], Number) for row in both)


def test_the_order_of_trials_does_not_matter() -> None:
    rows = trials(models())
    one, other = pool(rows).model, pool(rows[::-1]).model
    for a, b in zip(one.coefficients, other.coefficients, strict=True):
        assert a.value == pytest.approx(b.value, abs=1e-3 * a.prior_std)
        assert a.std == pytest.approx(b.std, rel=1e-3)


def test_a_scatter_between_maneuvers_counts_in_as_many_trials_as_chance_makes_of_it() -> None:
    """Beyond chance in one maneuver set of twenty: not in one trial of four (18 %), in two."""
    rows = models()

    def structural(wide: int) -> float:
        own = [scattered_more(m, "Y_uud", 0.3) for m in rows[:wide]] + rows[wide:]
        found = pool(trials(own)).model.pooling.parameters
        return next(p.structural_std / p.prior_std for p in found if p.symbol == "Y_uud")

    none = structural(0)
    assert structural(1) == pytest.approx(none, abs=1e-6)
    assert structural(2) == pytest.approx(np.sqrt(0.5) * 0.3, rel=0.1)
    assert structural(4) == pytest.approx(0.3, rel=0.1)


def scattered_more(model: IdentifiedModel, symbol: str, by: float) -> IdentifiedModel:
    """The model with one variance widened by the square of a share of the prior's deviation."""
    covariance = json.loads(json.dumps(model.covariance))
    k = covariance["symbols"].index(symbol)
    covariance["matrix"][k][k] += (by * covariance["scale"][k]) ** 2
    return model.model_copy(update={"covariance": covariance})


def test_a_hull_that_hardly_keeps_its_course_is_pushed_in_the_pooled_model_too() -> None:
    """Else its band is that of a stable one, with errors judged beside pushes."""
    own = models()
    assert pushes_behind(pool(trials(own)).model) is None
    sizes = (0.03, 0.04)
    for k, size in enumerate(sizes):
        left = own[k].left_out
        assert left is not None
        told = left.model_copy(update={"push": {"v": size, "r": 2.0 * size}})
        own[k] = own[k].model_copy(update={"left_out": told})
    pushes = pushes_behind(pool(trials(own)).model)
    assert pushes is not None
    rms = float(np.sqrt(np.mean(np.square(sizes))))
    assert pushes.std == pytest.approx([0.0, rms, 2.0 * rms, 0.0])


def test_a_channel_that_the_first_trial_did_not_measure_is_pooled_of_the_others() -> None:
    own = models()[:3]
    left = own[0].left_out
    assert left is not None and {"u", "v"} <= set(left.spread)
    without_v = {name: s for name, s in left.spread.items() if name != "v"}
    own[0] = own[0].model_copy(update={"left_out": left.model_copy(update={"spread": without_v})})
    found = pool(trials(own)).model.left_out
    assert found is not None
    others = [m.left_out.spread["v"] for m in own[1:] if m.left_out is not None]
    assert found.spread["v"] == pytest.approx(np.sqrt(np.mean(np.square(others))))


def test_a_scatter_of_zero_is_not_told_as_one_that_the_claim_contains() -> None:
    first, second = models()[:2]
    rows = (
        c.model_copy(update={"value": c.value + 8.0 * c.std}) if c.symbol == "N_uud" else c
        for c in second.coefficients
    )
    found = pool(trials([first, second.model_copy(update={"coefficients": tuple(rows)})])).model
    scatter = {p.symbol: p.between_std for p in found.pooling.parameters}
    told = disagreeing(found)
    assert 0.0 in {scatter[name] for name in told}
    assert all(("contains that" in text) == (scatter[name] > 0.0) for name, text in told.items())


def disagreeing(found: PooledModel) -> dict[str, str]:
    """What is said of each coefficient in which trials disagree."""
    rows = [f for f in found.findings if f.code == "trials-disagree" and f.where]
    return {name: f.message for f in rows for name in f.where.split(", ")}


def test_it_is_a_model_like_any_other_within_what_physics_allows() -> None:
    found = pool(trials(models())).model
    read = IdentifiedModel.model_validate_json(found.model_dump_json(by_alias=True))
    assert np.isfinite(vector_behind(read)).all()
    assert np.linalg.eigvalsh(claimed_covariance(read)).min() > -1e-9
    assert all(c.value >= -1e-9 for c in read.constraints)
    assert {c.symbol for c in read.coefficients} == {c.symbol for c in models()[0].coefficients}
    leader, follower = (read.values()[s] for s in ("Y_rdot", "N_vdot"))
    assert leader == follower


def test_trials_of_different_vehicles_are_refused_with_what_differs() -> None:
    first, second = models()[:2]
    heavier = second.rigid_body.model_copy(update={"mass_kg": 99.0})
    other = second.model_copy(update={"rigid_body": heavier})
    with pytest.raises(InputError, match=r"mass_kg is 99\.0, there 30\.48"):
        pool([PoolTrial("a", first), PoolTrial("b", other)])
    rows = tuple(
        c.model_copy(update={"prior": c.prior + c.prior_std}) if c.symbol == "Y_uud" else c
        for c in second.coefficients
    )
    other = second.model_copy(update={"coefficients": rows})
    with pytest.raises(InputError, match="its prior of Y_uud"):
        pool([PoolTrial("a", first), PoolTrial("b", other)])


def test_a_trial_of_another_vehicle_is_named_and_left_out() -> None:
    stranger = IdentifiedModel.model_validate_json(another_vehicle())
    rows = trials([*models()[:2], stranger, *models()[2:]])
    found = pool(rows).model
    assert [t.trial for t in found.pooling.trials if not t.used] == ["trial-2"]
    (finding,) = [f for f in found.findings if f.code == "trial-fits-no-other"]
    assert finding.where == "trial-2"
    without = pool([r for k, r in enumerate(rows) if k != 2]).model
    for a, b in zip(found.coefficients, without.coefficients, strict=True):
        assert a.value == pytest.approx(b.value, abs=1e-3 * a.prior_std)
    kept = pool(rows, keep=True).model
    assert all(t.used for t in kept.pooling.trials)
    assert kept.pooling.p < 1e-6


def test_an_estimate_much_more_certain_than_that_of_the_others_is_of_another_vehicle() -> None:
    first, second = models()[:2]
    (row, *rest) = second.coefficients
    for factor in (1.4, 1.0 / 1.4):
        wider = row.model_copy(update={"prior_std": factor * row.prior_std})
        refuse_others(trials([first, second.model_copy(update={"coefficients": (wider, *rest)})]))
    for factor in (1.6, 1.0 / 1.6):
        wider = row.model_copy(update={"prior_std": factor * row.prior_std})
        with pytest.raises(InputError, match=f"its prior of {row.symbol} is "):
            other = second.model_copy(update={"coefficients": (wider, *rest)})
            refuse_others(trials([first, other]))


def test_what_all_coefficients_scatter_together_is_not_counted_for_one_of_them_again() -> None:
    """Squares three times those of noise: two parts of the noise are in what all have."""
    claim = SimpleNamespace(ratio=3.0, freedom=100.0)
    blind = TrialData(np.zeros((1, 1)), np.zeros(1))  # so that nothing else is added here
    data = SimpleNamespace(
        trials=[SimpleNamespace(model=SimpleNamespace(noise_claim=claim))] * 3,
        told=(blind,) * 3,
        widened=np.full((3, 1), 0.5),
        widened_variance=np.array([0.5]),
        expected=np.full((3, 1), 0.1),
    )
    found = structural_covariance(data, Pooled(np.zeros(1), np.eye(1)), np.zeros(1))
    assert found == pytest.approx(np.array([[0.5 - 2.0 * 0.1]]))


def test_no_parameter_is_known_worse_than_its_prior_whatever_the_equations_lack() -> None:
    found = Pooled(np.zeros(2), np.diag([0.5, 0.5]))
    together = Together(collect(trials(models()[:1])), found, np.zeros(2), np.diag([1.5, 0.0]))
    assert together.claimed == pytest.approx(np.diag([1.0, 0.5]))


def test_an_effect_of_one_sign_is_not_pooled_to_the_other() -> None:
    """Trials in which a lag is next to none may add up to less than none."""
    rows = trials(models()[:2])
    data, pooling = collect(rows), pool(rows).model.pooling
    found = pooled(data.told, np.zeros(len(data.names)), np.ones(len(data.names)))
    i = next(k for k, n in enumerate(data.names) if "." in n and parameter_of(n).low == 0.0)
    mean = found.mean.copy()
    mean[i] = -data.origin[i] / data.unit[i] - 0.5
    nothing = np.zeros(len(mean))
    together = Together(data, Pooled(mean, found.covariance), nothing, np.diag(nothing))
    effects = model_of_all(together, pooling, ()).effects
    assert internal_values(effects)[data.names[i]] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("kind", "share"), [("step", 2.0 / 8.0), ("drift", 2.0 / 7.0)])
def test_a_share_is_one_of_the_value_before_the_change(kind, share) -> None:
    """Of a pooled 10: 8 before a step of 2, or 8 amid a drift by 2 that began at 7."""
    data = SimpleNamespace(names=("Y_uud",), unit=np.array([4.0]))
    known = np.eye(1), np.zeros((1, 1))
    teller = _Teller(data, (), np.array([10.0]), np.array([8.0]), dated=False, levels=known)
    found = FoundChange(kind, 0, 1, (1, 1), 0.2, 0.02, 9.0, 0.001, ())
    size, std = teller._of_before(found, 0.2, 0.02)
    assert size == pytest.approx(share)
    change = 1.0e-6  # the standard deviation goes with the slope
    more, _ = teller._of_before(found, 0.2 + change, 0.02)
    assert std == pytest.approx(0.02 * (more - size) / change, rel=1e-4)
    slope, level = 3.0, 3.0 * 10.0 / 4.0  # its acceleration, known to a tenth
    unknown = np.eye(1) * slope, np.array([[(0.1 * level) ** 2]])
    _, wider = replace(teller, levels=unknown)._of_before(found, 0.2, 0.02)
    assert wider == pytest.approx(np.hypot(std, 0.1 * size))


def strangers_among(*estimates: np.ndarray) -> set[int]:
    """Trials that fit no other, of such as know every parameter to a tenth of its prior."""
    information = 100.0 * np.eye(len(estimates[0]))
    told = tuple(TrialData(information, information @ estimate) for estimate in estimates)
    return set(strangers(SimpleNamespace(told=told), range(len(told))))


def test_a_last_trial_that_differs_in_one_parameter_stays_as_the_vehicle_may_have_changed() -> None:
    same, other = np.zeros(10), 3.0 * np.eye(10)[0]
    assert strangers_among(same, other, same, same, same) == {1}
    assert strangers_among(same, same, same, same, other) == set()
    assert strangers_among(same, same, same, same, other + 3.0) == {4}  # in all of them


def test_a_trial_a_little_farther_than_chance_stays() -> None:
    """Of 120 parameters chance makes 180 squares in one of five thousand; 240 are asked for."""
    same, unit = np.zeros(120), np.sqrt(1.0 / 100.0 + 1.0 / 401.0)  # of its own and the others'
    near, far = (np.full(120, root * unit) for root in np.sqrt((1.75, 2.25)))
    assert strangers_among(same, near, same, same, same) == set()
    assert strangers_among(same, far, same, same, same) == {1}


def test_a_trial_that_is_given_twice_counts_once() -> None:
    rows = trials(models())
    found = pool([*rows, replace(rows[1], name="copy")]).model
    (last,) = [t for t in found.pooling.trials if not t.used]
    assert (last.trial, last.reason) == ("copy", "it is the same as trial-1")
    assert found.values() == pytest.approx(pool(rows).model.values(), rel=1e-3)


def test_a_log_that_two_runs_have_counts_once() -> None:
    """The run with more logs has the other one's as well, though it comes later."""
    rows = trials(models())
    rows[1] = replace(rows[1], logs={"aa": "first_log"})
    rows[2] = replace(rows[2], logs={"aa": "first_log", "bb": "second_log"})
    rows[3] = replace(rows[3], logs={"cc": "first_log"})  # another log of the same name
    found = pool(rows).model
    (last,) = [t for t in found.pooling.trials if not t.used]
    assert (last.trial, last.reason) == ("trial-1", "its log first_log is in trial-2 too")
    (finding,) = [f for f in found.findings if f.code == "same-log"]
    assert finding.where == "trial-1" and "no log in common" in finding.remedy
    without = pool([rows[0], *rows[2:]]).model
    assert found.values() == pytest.approx(without.values(), rel=1e-3)


def test_a_log_that_counts_once_brings_no_effect_with_it() -> None:
    """Two runs of a log, one without effects: the model is as that of the first run alone."""
    (first, *_) = models()
    bare = first.model_copy(
        update={
            "effects": (),
            "covariance": without(first.covariance, [s for s in symbols_of(first) if "." in s]),
        }
    )
    rows = [
        PoolTrial("bare", bare, logs={"aa": "log"}),
        PoolTrial("full", first, logs={"aa": "log"}),
    ]
    found = pool(rows)
    assert [t.used for t in found.model.pooling.trials] == [True, False]
    assert found.model.effects == () and not any("." in name for name in found.data.names)


def symbols_of(model: IdentifiedModel) -> list[str]:
    return list(model.covariance["symbols"])


def without(covariance: dict, names: list[str]) -> dict:
    """A covariance without some parameters."""
    keep = [k for k, s in enumerate(covariance["symbols"]) if s not in names]
    square = {"matrix", "scatter"} & covariance.keys()
    rows = {k: [v[i] for i in keep] for k, v in covariance.items() if k not in square}
    return rows | {k: [[covariance[k][i][j] for j in keep] for i in keep] for k in square}


@pytest.mark.parametrize(
    ("what", "sentence"),
    [
        ("fin", r"since 6 May 2026 the rudder gives \d+ % less \(\d+ to \d+ %\)"),
        ("thrust", r"since 6 May 2026 the propeller gives \d+ % less thrust"),
    ],
)
def test_a_step_is_told_in_a_sentence_with_its_size(what: str, sentence: str) -> None:
    result = series()
    data = result.data
    (group,) = [g for g in quantities(data) if g.id == what]
    values = np.array([result_value(result, name) for name in data.names])
    along = np.array(
        [v if n in group.symbols else 0.0 for n, v in zip(data.names, values, strict=True)]
    )
    moved = [
        replace(t, score=t.score - 0.4 * (k >= 5) * t.information @ (along / data.unit))
        for k, t in enumerate(data.told)
    ]
    found = changes_of(
        replace(result, data=replace(data, told=tuple(moved))), np.random.default_rng(0)
    )
    change = found.changes[0]
    assert change.trial == "trial-5" and change.p < 0.01
    if change.what == what:  # else a coefficient of the group alone
        assert re.match(sentence, change.sentence), change.sentence
        assert change.size == pytest.approx(-0.4, abs=max(0.05, 3.0 * change.std))
    else:
        assert what in change.rivals or set(change.symbols) <= set(group.symbols)


def test_an_interval_of_shares_that_holds_zero_is_not_told_without_it() -> None:
    """Found beside another change, a small one may be left that is none."""
    assert of_shares(-0.05, -0.01) == "1 to 5 %"
    assert of_shares(0.01, 0.05) == "1 to 5 %"
    assert of_shares(-0.05, 0.01) == "-5 to +1 %"


def series() -> PoolResult:
    """Twelve trials that say what the four do, with errors of their own."""
    result = pool(trials(models()))
    data, rng = result.data, np.random.default_rng(5)
    told = []
    for one in (data.told[k % 4] for k in range(12)):
        values, vectors = np.linalg.eigh(one.information)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        theta = (np.array([result_value(result, n) for n in data.names]) - data.origin) / data.unit
        told.append(replace(one, score=one.information @ theta + root @ rng.normal(size=len(root))))
    own = [
        replace(data.trials[k % 4], name=f"trial-{k}", date=DAY.format(k + 1)) for k in range(12)
    ]
    return replace(result, data=replace(data, told=tuple(told), trials=tuple(own)))


def with_dvl_scale(result: PoolResult, fractions: list[float], std: float) -> PoolResult:
    """The same trials with a DVL scale error, of which each knows a size of its own."""
    return with_effect(result, "dvl_scale.fraction", 0.03, fractions, std)


def with_effect(
    result: PoolResult, name: str, unit: float, fractions: list[float], std: float
) -> PoolResult:
    """The same trials with an effect, of which each knows a size of its own."""
    row = {"id": name.partition(".")[0], "internal": {name: float(np.mean(fractions))}}
    information = (unit / std) ** 2
    told = tuple(
        replace(
            t,
            information=block_diag(t.information, information),
            score=np.append(t.score, information * fraction / unit),
        )
        for t, fraction in zip(result.data.told, fractions, strict=True)
    )
    data = replace(
        result.data,
        names=(*result.data.names, name),
        unit=np.append(result.data.unit, unit),
        origin=np.append(result.data.origin, 0.0),
        told=told,
        effects=(*result.data.effects, row["id"]),
    )
    was = result.model.covariance
    wide = {k: block_diag(was[k], 0.0).tolist() for k in ("matrix", "scatter")}
    flat = {k: [*was[k], 0.0] for k in ("fitted_variance", "scale", "prior")}
    told_of = {"symbols": [*was["symbols"], name], **wide, **flat}
    effects = (*result.model.effects, row)
    model = result.model.model_copy(update={"effects": effects, "covariance": told_of})
    values, anew = (np.append(v, np.mean(fractions)) for v in (result.values, result.again))
    return replace(result, model=model, data=data, values=values, again=anew)


def test_a_scale_error_changes_by_a_difference_though_it_has_no_unit() -> None:
    """0.01 to 0.03 is 0.02 more, not two hundred per cent, nor a share of a share."""
    noise = 0.001 * np.random.default_rng(3).normal(size=12)
    fractions = [float(0.01 + 0.02 * (k >= 6) + noise[k]) for k in range(12)]
    found = changes_of(with_dvl_scale(series(), fractions, 0.001), np.random.default_rng(0))
    (change,) = [c for c in found.changes if c.what == "dvl_scale.fraction"]
    assert (change.unit, change.share, change.trial) == ("-", False, "trial-6")
    assert change.size == pytest.approx(0.02, abs=3.0 * change.std)
    # noise alone leaves 0.0006; the scatter between neighbours has the step in it
    assert 0.0005 < change.std < 0.003
    told = r"since 7 May 2026 dvl_scale\.fraction is 0\.0\d+ larger \(\+0\.0\d+ to \+0\.0\d+\)"
    assert re.fullmatch(told, change.sentence), change.sentence
    row = changes_table(found).rows[0]
    assert re.fullmatch(r"\+0\.0\d+", str(row[1])) and "%" not in str(row[2])
    figure = over_trials(found)
    assert "difference" in figure and "% of common" in figure


def test_a_limit_changes_in_its_own_unit_and_not_by_its_inverse() -> None:
    """A limit of a rate was told as "0.13 internal smaller", of a servo that got faster."""
    name, noise = "rudder_rate_limit.rate_degps", np.random.default_rng(3).normal(size=12)
    inverses = [math.degrees(1.0) / (20.0 - 4.0 * (k >= 6) + 0.1 * noise[k]) for k in range(12)]
    found = changes_of(with_effect(series(), name, 2.6, inverses, 0.02), np.random.default_rng(0))
    (said,) = [f.message for f in found.findings if f.code == "small-changes"]
    told = r"since 7 May 2026 rudder_rate_limit.rate_degps is (\d.?\d*) deg/s smaller \(-[^+]+\)"
    (size,) = re.findall(told, said)
    assert float(size) == pytest.approx(4.0, abs=0.3)


def test_what_changed_by_too_little_to_matter_is_a_note_and_no_change() -> None:
    """A DVL whose scale changes by 1 %, of which 1.5 are worth a word."""
    noise = 0.0005 * np.random.default_rng(3).normal(size=12)
    fractions = [float(0.01 + 0.01 * (k >= 6) + noise[k]) for k in range(12)]
    found = changes_of(with_dvl_scale(series(), fractions, 0.0005), np.random.default_rng(0))
    assert "dvl_scale.fraction" not in {c.what for c in found.changes}
    (finding,) = [f for f in found.findings if f.code == "small-changes"]
    assert finding.where == "dvl_scale.fraction" and severity(finding) == "note"
    assert "since 7 May 2026 dvl_scale.fraction is 0.01 larger" in finding.message


def test_a_change_matters_from_its_practical_size_on() -> None:
    """Of what every model is allowed the unit is that allowance, of others the effect's prior."""
    names = ("Y_uud", "rudder_delay.delay_s", "dvl_scale.fraction", "Y_v|v|")
    model = models()[0].model_copy(update={"flown": {"u": 2.0, "u_low": 0.5}})
    unit, values = np.array([4.0, 0.02, 0.03, 9.0]), np.array([10.0, 0.0, 0.0, 1.0])
    told = (TrialData(np.eye(4), np.zeros(4)),)
    trial = SimpleNamespace(model=model)
    data = SimpleNamespace(names=names, unit=unit, told=told, trials=(trial,))
    fin = ShareOf("fin", ("Y_uud",), "")
    teller = _Teller(data, (fin,), values, values, True, (np.eye(4), np.eye(4)))

    def least(direction: int) -> float:
        return teller.least(FoundChange("step", direction, 6, (6, 6), 0.1, 0.01, 9.0, 0.0, ()))

    delay = parameter_of(names[1]).practical * model.length_m  # at 1 m/s
    assert least(1) * unit[1] == pytest.approx(delay)
    assert least(2) * unit[2] == pytest.approx(parameter_of(names[2]).practical)
    assert least(4) == LEAST_SHARE
    assert least(3) == 0.0  # hardly known, so that it has no share
    trial.model = model.model_copy(update={"flown": {}})
    assert least(1) == 0.0  # of an earlier version, or written by hand


def test_nothing_changed_and_that_is_said_with_its_rate_of_false_alarms() -> None:
    found = changes_of(series(), np.random.default_rng(0))
    assert found.changes == ()
    assert (found.false_alarms, found.dated, len(found.trials)) == (0.01, True, 12)
    assert found.tests > 50 and found.threshold is not None and found.threshold > 3.0
    json.loads(found.model_dump_json())


def test_of_several_trials_on_a_day_the_time_is_told() -> None:
    """Else a change "since 6 May" might be before or after most of them."""
    noise = 0.001 * np.random.default_rng(3).normal(size=12)
    fractions = [float(0.01 + 0.02 * (k >= 6) + noise[k]) for k in range(12)]
    result = with_dvl_scale(series(), fractions, 0.001)
    data = result.data
    own = [
        replace(t, date=f"2026-05-06T{8 + k:02d}:30:00+00:00") for k, t in enumerate(data.trials)
    ]
    result = replace(result, data=replace(data, trials=tuple(own)))
    found = changes_of(result, np.random.default_rng(0))
    (change,) = [c for c in found.changes if c.what == "dvl_scale.fraction"]
    assert change.sentence.startswith("since 6 May 2026 14:30 dvl_scale")


def test_that_the_order_is_not_that_of_the_dates_is_told() -> None:
    """One log without dates leaves all of them in the order in which they were given."""
    result = series()
    undated = [t.model_copy(update={"date": ""}) for t in result.model.pooling.trials[:1]]
    rows = (*undated, *result.model.pooling.trials[1:])
    pooling = result.model.pooling.model_copy(update={"trials": rows})
    model = result.model.model_copy(update={"pooling": pooling})
    found = changes_of(replace(result, model=model), np.random.default_rng(0))
    (finding,) = [f for f in found.findings if f.code == "order-as-given"]
    assert finding.where == "trial-0"
    assert changes_of(result, np.random.default_rng(0)).findings == ()


def test_the_last_trial_is_told_where_it_fits_no_other() -> None:
    stranger = IdentifiedModel.model_validate_json(another_vehicle())
    last = changes_of(pool(trials([*models(), stranger])), np.random.default_rng(0))
    assert last.left_out_last.startswith("trial-4: it fits no other trial")
    first = changes_of(pool(trials([stranger, *models()])), np.random.default_rng(0))
    assert (first.left_out_last, len(first.findings)) == ("", 2)  # one is left out, four are few


def test_a_scatter_is_told_in_the_unit_of_its_parameter_and_only_where_there_is_one() -> None:
    """Angles are radians inside; what others explain has no scatter to be contained."""
    rows = models()
    moved = [
        m.model_copy(
            update={
                "coefficients": tuple(
                    c.model_copy(update={"value": c.value + (-1) ** k * c.prior_std})
                    if c.symbol == "Y_uud"
                    else c
                    for c in m.coefficients
                )
            }
        )
        for k, m in enumerate(rows)
    ]
    found = pool(trials(moved), keep=True).model
    told = disagreeing(found)
    assert told
    for p in found.pooling.parameters:
        if p.symbol in told and p.between_std > 0.0:
            assert f"(scatter {p.between_std:.2g} {p.unit})" in told[p.symbol]
        elif p.symbol in told:
            assert "none of its own" in told[p.symbol]
    assert any("none of its own" in text for text in told.values())
    assert any("scatter" in text and "contains that" in text for text in told.values())


def test_of_few_trials_nothing_is_said() -> None:
    found = changes_of(pool(trials(models())), np.random.default_rng(0))
    assert (found.changes, [f.code for f in found.findings]) == ((), ["few-trials"])


def test_the_table_of_effects_says_what_belongs_to_a_trial() -> None:
    assert {e.id for e in EFFECTS if e.of_trial} == OF_THE_TRIAL
    for effect in EFFECTS:
        if effect.twin in BY_ID:
            assert effect.of_trial == BY_ID[effect.twin].of_trial
