"""The whole diagnosis on the sample trials: one lacks a current, one lacks nothing."""

import math
from dataclasses import replace

import numpy as np
import pytest

from auvident.schema.diagnosis import Diagnosis
from auvident.schema.effects import BY_ID, parameter_of
from auvident.stages.diagnose.select.candidates import Traced
from auvident.stages.diagnose.verdict.taken_up import coefficient_findings
from auvident.storage.artifacts import json_bytes
from tests.stages.diagnose.loop_chain import diagnosed, diagnosis, loop, small_case, small_fit

SAMPLES = ("bay_trial", "harbour_trial")


@pytest.fixture(scope="module")
def bay() -> Diagnosis:
    return diagnosis("bay_trial")


@pytest.fixture(scope="module")
def harbour() -> Diagnosis:
    return diagnosis("harbour_trial")


def test_nuisances_are_carried_to_be_estimated_with_the_effects(bay) -> None:
    allowed = {n for n in bay.carried["start"] if "." in n and not n.startswith("current.")}
    assert "rudder_rate_limit.rate_degps" in allowed
    assert all(bay.carried["prior_std"][name] > 0.0 for name in allowed)


# --- verdicts ------------------------------------------------------------------------------


def test_the_current_in_the_bay_is_found(bay) -> None:
    assert bay.verdict == "effect_found"
    assert [e.id for e in bay.effects] == ["current"]
    assert bay.candidates[0].id == "current"
    assert bay.candidates[0].rejected == ""
    assert not bay.ambiguous
    assert "current" in bay.statement


def test_nothing_is_found_with_the_second_vehicle_either() -> None:
    found = diagnosis("sound_trial")
    assert (found.verdict, found.effects) == ("none_found", ())


def test_nothing_is_found_in_the_harbour(harbour) -> None:
    assert harbour.verdict == "none_found"
    assert not harbour.effects
    assert all(c.rejected for c in harbour.candidates)
    assert not harbour.unexplained
    assert harbour.statement.startswith("The model lacks nothing that these maneuvers would show.")


def test_adding_the_current_makes_the_residuals_smaller(bay) -> None:
    rows = [r for r in bay.residuals if r.channel in ("u", "v")]
    before, after = (sum(getattr(r, k) ** 2 for r in rows) for k in ("rms", "rms_after"))
    assert after < 0.25 * before  # half of the rms at least
    assert {r.maneuver for r in bay.residuals} == set(bay.identify_maneuvers)


# --- what stands in the artifact -----------------------------------------------------------


@pytest.mark.parametrize("name", SAMPLES)
def test_every_candidate_and_every_size_is_of_the_table(name) -> None:
    found = diagnosis(name)
    ids = [c.id for c in found.candidates]
    assert len(set(ids)) == len(ids)
    assert {e.id for e in found.effects if BY_ID[e.id].enters != "disturbance"} <= set(ids)
    for c in found.candidates:
        assert BY_ID[c.id].enters != "disturbance"
        assert not BY_ID[c.id].nuisance
        assert c.family == BY_ID[c.id].family
        assert math.isfinite(c.gain)
        assert all(p.std is None for p in c.parameters)  # not worked out, which is not zero
    assert all(p.std for e in found.effects for p in e.parameters)
    pushes = [row for row in found.sees if row.id == "one_off_event"]
    assert [(row.symbol, row.unit) for row in pushes] == [("v_mps", "m/s"), ("r_degps", "deg/s")]
    assert all(0.0 < row.size < 60.0 for row in pushes)
    for row in found.sees:
        assert 0.0 <= row.kept <= 1.0
        assert row.visible == (row.why == "")
    for row in (row for row in found.sees if row not in pushes):
        declared = parameter_of(f"{row.id}.{row.symbol}")
        assert row.unit == declared.unit
        if declared.form == "plain" and not any(declared.powers):
            assert row.size >= declared.practical * declared.factor * (1 - 1e-9)


@pytest.mark.parametrize("name", SAMPLES)
def test_what_a_refined_model_takes_along_is_within_bounds(name) -> None:
    carried = diagnosis(name).carried
    named = {e.id for e in diagnosis(name).effects}
    assert set(carried["prior"]) == set(carried["prior_std"])
    assert named <= {n.partition(".")[0] for n in carried["prior_std"]}
    for key, value in carried["start"].items():
        if "." in key and not any(parameter_of(key).powers):
            assert parameter_of(key).low <= value <= parameter_of(key).high


@pytest.mark.parametrize("name", SAMPLES)
def test_held_out_maneuvers_are_not_among_those_used(name) -> None:
    maneuvers = loop(name).chain.maneuvers.maneuvers
    used = set(diagnosis(name).identify_maneuvers)
    assert used == {m.id for m in maneuvers if m.role == "identify" and m.shows("horizontal")}
    assert used == set(diagnosed(name).residuals["maneuver"])


@pytest.mark.parametrize("name", SAMPLES)
def test_residuals_are_measured_minus_predicted(name) -> None:
    table = diagnosed(name).residuals
    for row in diagnosis(name).residuals:
        column = {"u": "u_mps", "v": "v_mps", "r": "r_radps"}[row.channel]
        part = table["maneuver"] == row.maneuver
        for when, rms in (("before", row.rms), ("after", row.rms_after)):
            error = (table[f"{column}_measured"] - table[f"{column}_{when}"])[part]
            assert np.sqrt(np.nanmean(error**2)) == pytest.approx(rms, rel=1e-9)


@pytest.mark.parametrize("name", SAMPLES)
def test_the_artifact_is_plain_and_read_back_the_same(name) -> None:
    text = json_bytes(diagnosis(name), "diagnosis.json")  # refuses what is not finite
    assert json_bytes(Diagnosis.model_validate_json(text), "again") == text


@pytest.mark.parametrize(("estimate", "codes"), [(0.5, ["cross-flow"]), (0.0, [])])
def test_cross_flow_is_a_multiple_of_its_estimate_where_there_is_one(estimate, codes) -> None:
    case, fitted = small_case(), small_fit()
    prior, p = case.setup.prior.copy(), fitted.parameters.copy()
    for symbol in ("Y_v|v|", "N_r|r|"):
        i = case.position(symbol)
        p[i] = prior[i] - 4.0 * case.setup.prior_std[i]
        prior[i] = estimate * p[i]
    own = replace(case, setup=replace(case.setup, prior=prior))
    traced = Traced(own, fitted, replace(fitted, parameters=p), (), (), ())
    assert [f.code for f in coefficient_findings(traced)] == codes
