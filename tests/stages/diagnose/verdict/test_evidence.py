"""What a diagnosis says of its evidence: what was accepted stands, a remainder beside it."""

from dataclasses import replace
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvident.schema.diagnosis import Diagnosis
from auvident.schema.effects import parameter_of
from auvident.schema.mattering import share_that_matters
from auvident.stages.diagnose.checks.waves import Wave
from auvident.stages.diagnose.fit.fits import first_colours, fit_with, log_gain
from auvident.stages.diagnose.score.first_order import joint_about
from auvident.stages.diagnose.score.free_forces import FreeForce
from auvident.stages.diagnose.score.left_out import Helped
from auvident.stages.diagnose.select.candidates import Round, Traced, Tried
from auvident.stages.diagnose.select.healthy import SHARES
from auvident.stages.diagnose.select.records import Account
from auvident.stages.diagnose.select.rule import Refusal
from auvident.stages.diagnose.verdict import effects
from auvident.stages.diagnose.verdict.carried import carried
from auvident.stages.diagnose.verdict.document import _remainder, diagnosis_of
from auvident.stages.diagnose.verdict.evidence import (
    Evidence,
    remainders,
)
from tests.stages.diagnose.loop_chain import loop, small_case, small_fit

SEEN = ("rudder_offset", "gyro_bias")
BIAS = np.radians(1.0)  # far beyond what is left of it in a healthy trial


@cache
def evidence() -> Evidence:
    """The gyro's bias accepted beside everything else, made up in a healthy trial."""
    case, before = small_case(), small_fit()
    effects = ("gyro_bias",)
    found = fit_with(case, effects, before.parameters, before.colours)
    joint = joint_about(case, before, SEEN)
    assert found is not None and joint is not None
    there = found.parameters.copy()
    there[case.position("gyro_bias.bias_degps")] = BIAS
    found = replace(found, log_likelihood=before.log_likelihood + 1000.0, parameters=there)
    falls = {"u": 0.0, "v": 0.0, "r": 0.5}
    helped = Helped(900.0, 1.0, strength=9.0)
    gain = log_gain(before, found)
    account = Account(
        "gyro_bias",
        gain,
        gain,
        1,
        3.0,
        falls,
        tuple(found.rms),
        False,
        True,
        gain,
        len(case.records),
        helped,
    )
    tried = Tried(found, account)
    done = Round(before, joint, (tried,), {"gyro_bias": 1000.0}, accepted="gyro_bias")
    traced = Traced(case, before, found, (done,))
    return Evidence(traced, SEEN, (), None, (), None, ())


def force(gain: float, helps: float = 5.0) -> FreeForce:
    return FreeForce("delayed u r", "N", 0.3, gain, np.array([0.0, 0.0, 0.3]), helps)


def said(found: Evidence) -> Diagnosis:
    made = loop("harbour_trial")
    return diagnosis_of(found, made.model)


def test_an_effect_that_stands_alone_is_found() -> None:
    found = said(evidence())
    assert (found.verdict, [e.id for e in found.effects]) == ("effect_found", ["gyro_bias"])
    assert (found.unexplained, found.remaining) == ({}, {})
    assert found.without_effects == "none_found"  # the healthy trial leaves nothing that matters
    assert found.false_alarm_p == pytest.approx(SHARES[-1])


def without_a_size() -> Evidence:
    """The same with next to no bias, so that its interval contains zero."""
    whole, there = evidence(), evidence().traced.final.parameters.copy()
    there[whole.traced.case.position("gyro_bias.bias_degps")] = 1e-6
    final = replace(whole.traced.final, parameters=there)
    return replace(whole, traced=replace(whole.traced, final=final))


def test_an_effect_whose_interval_contains_zero_is_tried_and_not_claimed() -> None:
    found = said(without_a_size())
    assert (found.verdict, found.effects, found.false_alarm_p) == ("none_found", (), None)
    assert [e.id for e in found.not_confirmed] == ["gyro_bias"]
    assert found.to_try == found.not_confirmed and "gyro_bias.bias_degps" in found.carried["start"]
    assert "Fits the data better, but not confirmed because its interval" in found.statement
    assert found.candidates[0].rejected.startswith("not confirmed")
    assert found.candidates[0].refusal and found.candidates[0].refusal.code == "not-confirmed"


def test_an_effect_that_is_told_from_zero_and_does_not_matter_is_not_claimed(monkeypatch) -> None:
    """A DVL that was 5 mm abeam for sure, and may be 0.1 m ahead or not (odd seed 8153)."""
    small = parameter_of("gyro_bias.bias_degps").practical / 4.0
    whole, there = evidence(), evidence().traced.final.parameters.copy()
    there[whole.traced.case.position("gyro_bias.bias_degps")] = small
    final = replace(whole.traced.final, parameters=there)
    monkeypatch.setattr(effects, "spreads", lambda case, *_: np.full(len(case.names), 1e-9))
    found = said(replace(whole, traced=replace(whole.traced, final=final)))
    assert (found.verdict, found.effects) == ("none_found", ())
    assert [e.id for e in found.not_confirmed] == ["gyro_bias"]
    assert "because what is told from zero is too small to matter" in found.statement
    assert "too small to matter" in found.candidates[0].rejected


def test_what_only_an_effect_in_doubt_takes_away_is_unexplained() -> None:
    whole = without_a_size()
    before = replace(whole.traced.baseline, rms=10.0 * whole.traced.baseline.rms)
    found = said(replace(whole, traced=replace(whole.traced, baseline=before)))
    assert (found.verdict, found.unexplained["nearest"]) == ("unexplained", "gyro_bias")
    assert found.unexplained["channels"] == ["u", "v", "r"]


@pytest.mark.parametrize(
    "more",
    [
        {"rival": force(1300.0)},  # a free force in its place gains more
        {"rival": force(10.0), "free": (force(700.0),)},  # ... or beside it more than half as much
    ],
)
def test_what_was_accepted_stands_beside_what_remains(more) -> None:
    found = said(replace(evidence(), **more))
    assert found.verdict == "partly_explained"
    assert [e.id for e in found.effects] == ["gyro_bias"]
    assert found.carried["prior_std"]["gyro_bias.bias_degps"] > 0.0  # and is used
    assert found.unexplained["nearest"] == "gyro_bias"
    assert found.remaining["correlates"][0]["regressor"] == "delayed u r"
    assert "lacks a gyro bias" in found.statement
    assert "An unexplained residual remains" in found.statement


def test_what_every_model_is_allowed_is_kept_as_that_where_it_was_adjusted_along() -> None:
    """The model before has a servo of finite rate; a little play it has not."""
    along, traced = ("rudder_rate_limit", "rudder_deadband"), evidence().traced
    final = replace(traced.final, effects=(*traced.final.effects, *along))
    found = carried(replace(traced, final=final, unclaimed=along))
    rate = traced.case.position("rudder_rate_limit.rate_degps")
    kept = found["prior_std"]["rudder_rate_limit.rate_degps"]
    assert kept == traced.case.nuisance_std[rate] < traced.case.setup.prior_std[rate]
    assert not any(name.startswith("rudder_deadband") for name in found["start"])
    assert "rudder_rate_limit.rate_degps" not in found["expected"]


def test_a_residual_beside_what_was_accepted_makes_it_partly_an_explanation() -> None:
    whole = evidence()
    final = replace(whole.traced.final, rms=10.0 * whole.traced.final.rms)
    found = said(replace(whole, traced=replace(whole.traced, final=final)))
    assert (found.verdict, found.remaining["channels"]) == ("partly_explained", ["u", "v", "r"])
    assert [e.id for e in found.effects] == ["gyro_bias"]


def test_a_straight_run_alone_is_not_blamed_for_the_rate_it_does_not_have() -> None:
    """Its rate varies by little more than what turbulence and the gyro make of it."""
    straight = next(r for r in small_case().records if "straight" in r.id)
    alone = replace(small_case(), records=(straight,))
    p = alone.at_rest(alone.identified)
    fitted = fit_with(alone, (), p, first_colours(alone, p))
    assert fitted is not None
    rate = float(np.nanstd(straight.measured[:, 2]))
    assert fitted.rms[2] > share_that_matters("r") * rate
    length = loop("harbour_trial").model.length_m
    assert remainders(alone, fitted, length) == []
    left = remainders(alone, replace(fitted, rms=5.0 * fitted.rms), length)
    assert [(r.channel, r.matters) for r in left] == [("u", True), ("v", True), ("r", True)]


def test_a_remainder_beyond_a_good_sensor_is_nothing_where_a_prediction_is_none_the_worse() -> None:
    """Sway off by five times the noise of its DVL, and by three hundredths of what it varies."""
    whole = evidence()
    case, before = whole.traced.case, whole.traced.baseline
    varies = np.nanstd(np.concatenate([r.measured[:, 1] for r in case.records]))
    noise, rms = case.setup.sensor_std.copy(), before.rms.copy()
    rms[1] = 0.6 * share_that_matters("v") * varies
    noise[1] = rms[1] / 5.0
    quiet = replace(case, setup=replace(case.setup, sensor_std=noise))
    fitted = replace(before, rms=rms)
    traced = replace(whole.traced, case=quiet, baseline=fitted, final=fitted)
    bare = replace(traced.rounds[0], accepted=None)
    found = said(replace(whole, traced=replace(traced, rounds=(bare,))))
    assert (found.verdict, found.unexplained) == ("none_found", {})
    assert [row["channel"] for row in found.remaining["sizes"]] == ["v"]
    assert "v is off by 5.0 times the noise of its sensor, 3.0% of" in found.statement


def test_what_a_wave_leaves_is_the_wave() -> None:
    whole = evidence()
    final = replace(whole.traced.final, rms=10.0 * whole.traced.final.rms)
    wave = Wave(1.0, 0.0, 40.0, "v", {"v": 40.0}, 10.0)
    found = said(replace(whole, traced=replace(whole.traced, final=final), wave=wave))
    assert found.verdict == "effect_found"
    assert [e.id for e in found.effects] == ["wave", "gyro_bias"]


def test_without_any_effect_a_remainder_is_unexplained_and_none_is_nothing() -> None:
    whole = evidence()
    bare = replace(whole.traced.rounds[0], accepted=None)
    traced = replace(whole.traced, final=whole.traced.baseline, rounds=(bare,))
    nothing = replace(whole, traced=traced)
    assert said(nothing).verdict == "none_found"
    assert said(nothing).false_alarm_p is None  # no alarm, so none that could be false
    assert (said(nothing).remaining, "Closest" in said(nothing).statement) == ({}, False)
    something = said(replace(nothing, free=(force(700.0),)))
    assert (something.verdict, something.effects) == ("unexplained", ())
    overfitted = said(replace(nothing, free=(force(700.0, helps=-1.0),)))
    assert overfitted.verdict == "none_found"


@pytest.mark.parametrize(("code", "named"), [("evidence", True), ("small", False)])
def test_what_came_closest_is_told_where_nothing_is_named(code: str, named: bool) -> None:
    """If it was refused for the maneuvers left out alone, and not for its size."""
    whole = evidence()
    refused = replace(whole.traced.rounds[0].tried[0], refusal=Refusal(code, ""))
    bare = replace(whole.traced.rounds[0], tried=(refused,), accepted=None)
    traced = replace(whole.traced, final=whole.traced.baseline, rounds=(bare,))
    quiet = said(replace(whole, traced=traced))
    assert quiet.verdict == "none_found"
    assert ("Closest came gyro bias, on evidence too weak" in quiet.statement) == named
    assert (quiet.remaining.get("nearest") == "gyro_bias") == named
    loud = said(replace(whole, traced=traced, free=(force(700.0),)))
    assert (loud.verdict, loud.unexplained["nearest"] == "gyro_bias") == ("unexplained", named)


def test_what_is_left_follows_each_thing_once_and_nothing_of_a_few_nats() -> None:
    forces = [force(930.0), replace(force(500.0), axis="Y"), replace(force(3.0), axis="X")]
    traced: Any = SimpleNamespace(case=SimpleNamespace(channels=("u", "v", "r")))
    evidence: Any = SimpleNamespace(rival=force(700.0), free=forces, traced=traced)
    rows = _remainder(evidence, ["r"], None)["correlates"]
    assert [(r["axis"], r["gain"]) for r in rows] == [("N", 700.0), ("Y", 500.0)]


def test_what_is_taken_along_without_a_claim_is_not_beaten_by_a_free_force() -> None:
    whole = evidence()
    along = replace(whole.traced, unclaimed=("gyro_bias",))
    assert whole.traced.claimed and not along.claimed
    found = said(replace(whole, traced=along, rival=force(1300.0)))
    assert (found.verdict, found.effects) == ("none_found", ())


def test_a_noisy_gyro_leaves_nothing_of_the_rate() -> None:
    """A residual that is all noise of the sensor, however large beside what the rate varies."""
    whole = evidence().traced
    noise = whole.case.setup.sensor_std.copy()
    loud = replace(whole.final, rms=np.array([0.0, 0.0, 50.0 * noise[2]]))
    assert [r.channel for r in remainders(whole.case, loud, 1.6)] == ["r"]
    noise[2] *= 50.0
    setup = replace(whole.case.setup, sensor_std=noise)
    assert remainders(replace(whole.case, setup=setup), loud, 1.6) == []
