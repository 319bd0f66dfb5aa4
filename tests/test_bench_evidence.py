"""Scores of evidence on trials made by hand; what a trial records of its candidates."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from auvident.stages.diagnose.fit.fits import fit_with
from auvident.stages.diagnose.select import rules
from auvident.stages.diagnose.select.candidates import Tried
from tests.bench import evidence, evidence_score, evidence_trial
from tests.bench.evidence_score import KINDS, chance_of, named, outcome_of, share, tables, what_is
from tests.bench.evidence_trial import wald
from tests.stages.diagnose.loop_chain import small_case, small_fit
from tests.stages.diagnose.select.test_rules import GOOD

BLOCKS = [[3.0, 2.0, 4.0], [1.0, 3.0, 2.0, 2.0], [2.0, -0.5, 5.0, 3.0]]


def candidate(name: str = "current", **changes: Any) -> dict[str, Any]:
    """A candidate that helps wherever it is left out and explains half of v."""
    power = [[[1.0, 4.0, 1.0]] * 3, [[1.0, 2.0, 1.0]] * 3]
    return {
        "id": name,
        "gain": 60.0,
        "by_others": 60.0,
        "size": 2.0,
        "parameters": 2,
        "falls": {"u": 0.0, "v": 0.3, "r": 0.0},
        "checks": [0.0, 0.0],
        "wald": {"maneuver": 32.0, "block": 18.0},
        "noise": [[0.1] * 6, [0.1] * 6],
        "sensor_std": [0.1, 0.1, 0.1],
        "readings": [100, 100, 100],
        "blocks_own": BLOCKS,
        "power_own": power,
        "among": 28,
    } | changes


def trial(*candidates: dict[str, Any], seed: int = 2, planted: tuple[str, ...] = ()) -> Any:
    kind = "single" if planted else "none"
    case = {"key": str(seed), "seed": seed, "kind": kind, "planted": list(planted)}
    shown = {name: {"visible": True} for name in planted}
    return {"case": case, "visible": shown, "own": {}, "candidates": list(candidates)}


def negative(**changes: Any) -> dict[str, Any]:
    return candidate(blocks_own=[[-g for g in block] for block in BLOCKS], **changes)


def test_each_kind_of_evidence() -> None:
    gains = np.concatenate(BLOCKS)
    told = {name: kind({**candidate(), "chance": 0.01}) for name, kind in KINDS.items()}
    assert told == {
        "gain, nats": 60.0,
        "t over maneuvers left out": pytest.approx(
            26.5 / 3.0 / np.std([9.0, 8.0, 9.5], ddof=1) * 3**0.5
        ),
        "t over blocks left out": pytest.approx(gains.sum() / np.sqrt(gains @ gains)),
        "-log10 of the chance of the best": pytest.approx(2.0),
        "robust Wald by maneuver": 4.0,
        "robust Wald by block": 3.0,
        "fall of the rms": 0.3,
        "explained share": pytest.approx(6.0 / 11.0),
    }
    sensed = candidate(checks=[40.0, 10.0])
    assert share(sensed) == 0.75
    assert KINDS["t over blocks left out"](sensed) == pytest.approx(60.0**0.5)


def test_the_first_that_passes_is_named_and_told_from_what_was_planted() -> None:
    gain = [(KINDS["gain, nats"], 50.0)]
    late = trial(candidate("gyro_bias", size=0.5), candidate("rudder_lag"), planted=("rudder_lag",))
    assert what_is(late, named(late, gain)) == "right"
    assert what_is(late, named(late, [(KINDS["gain, nats"], 70.0)])) == "none"
    assert what_is(late, candidate("rudder_delay")) == "alike"
    assert what_is(late, candidate("current")) == "false"
    own = {**late, "own": {"current": {"visible": True}}}
    assert what_is(own, candidate("current")) == "own"
    for refused in (negative(), candidate(gain=25.0), candidate(impossible=True)):
        assert named(trial(refused), [(KINDS["gain, nats"], 0.0)]) is None


def test_a_threshold_names_nothing_false_but_once() -> None:
    clean = [trial(candidate(gain=g, by_others=g), seed=2 * k) for k, g in enumerate((40.0, 90.0))]
    found = [trial(candidate(gain=80.0, by_others=80.0), planted=("current",))]
    threshold = evidence_score.least([*clean, *found], KINDS["gain, nats"])
    assert threshold == pytest.approx(40.0, rel=1e-3)
    assert outcome_of([*clean, *found], [(KINDS["gain, nats"], threshold)]) == {
        "empty": 2,
        "false": 1,
        "visible": 1,
        "right": 1,
        "right or alike": 1,
        "wrong": 0,
    }


def test_the_tables_have_every_kind_and_the_rules_of_the_search() -> None:
    told = tables(
        [trial(candidate(), planted=("current",)), trial(negative()), trial(), {"error": "x"}]
    )
    assert [row["evidence"] for row in told["evidence by kind"]] == list(KINDS)
    old, new = told["by the rules as they are"]
    assert (old["right"], new["right"]) == (0, 1)  # 60 nats, and 2.9 standard errors
    assert len(told["chance in clean trials"]) == 2
    assert tables([]) == {}


def test_the_chance_of_clean_trials_is_held_against_a_uniform_one() -> None:
    rng = np.random.default_rng(3)
    rows = [trial(candidate(blocks_own=[rng.normal(size=12)])) for _ in range(40)]
    common, program = tables(rows)["chance in clean trials"]
    assert common["p"] > 0.01 and program["excess"] < common["excess"] + 1e-12
    always = [trial(candidate()) for _ in range(40)]
    assert tables(always)["chance in clean trials"][0]["p"] < 1e-6


# --- what is recorded ----------------------------------------------------------------------


def test_the_robust_wald_statistic_is_that_of_the_sandwich() -> None:
    """Of an effect that is there it is large, of one made up small."""
    case, before = small_case(), small_fit()
    found = {}
    for effect in ("gyro_bias", "current"):
        fitted = fit_with(case, (effect,), before.parameters, before.colours)
        assert fitted is not None
        found[effect] = wald(case, fitted, True)
        at = case.positions(effect)
        off = fitted.parameters.copy()
        off[at] = case.setup.prior[at]
        assert wald(case, replace(fitted, parameters=off), True) == pytest.approx(0.0, abs=1e-12)
    assert all(w is not None and w > 0.0 for w in found.values())


def test_evidence_of_a_candidate_is_recorded_raw() -> None:
    case, before = small_case(), small_fit()
    fitted = fit_with(case, ("gyro_bias",), before.parameters, before.colours)
    assert fitted is not None
    tried = Tried(fitted, replace(GOOD, id="gyro_bias"))
    without = np.tile(before.parameters, (len(case.records), 1))
    row = evidence_trial._left_out(case, before, without, tried)
    assert [len(m) for m in row["blocks_own"]] == [len(m) for m in row["blocks_before"]]
    assert np.array(row["power_own"]).shape == (2, len(case.records), 3)
    assert row["readings"] == [
        sum(int(np.isfinite(r.measured[:, c]).sum()) for r in case.records) for c in range(3)
    ]


def test_outcomes_are_kept_and_scored_again(tmp_path, monkeypatch) -> None:
    made = []

    def outcome(seed: int) -> Any:
        made.append(seed)
        return {**trial(candidate(), seed=seed, planted=("current",)), "seconds": 1.0}

    monkeypatch.setattr(evidence_trial, "outcome", outcome)
    kept, shown = tmp_path / "kept.jsonl", dict[str, Any]()
    for _ in range(2):
        wanted = ["--first", "3", "--count", "2", "--resume", str(kept)]
        evidence.main(wanted, lambda title, rows: shown.update({title: rows}))
    assert made == [4, 6]
    assert "evidence by kind (tune, 2 trials)" in shown
    assert rules.LEAST_T == 2.5


def test_an_effect_that_means_nothing_is_found_out_by_chance() -> None:
    """What is observed and what is drawn are one statistic: p is uniform where signs are chance."""
    rng = np.random.default_rng(11)
    found = [chance_of(rng.standard_t(3, size=60), rng, 199) for _ in range(200)]
    # Kolmogorov-Smirnov with 200 draws: 0.115 at 1 %; p comes in steps of 1/200
    assert np.abs(np.sort(found) - (np.arange(200) + 0.5) / 200).max() < 0.115


def test_an_effect_that_always_helps_has_the_least_p() -> None:
    rng = np.random.default_rng(0)
    assert chance_of(rng.uniform(1.0, 30.0, size=60), rng, 999) == pytest.approx(1e-3)
    assert chance_of(-rng.uniform(1.0, 30.0, size=60), rng, 999) == 1.0
    assert chance_of(np.ones(3), rng, 9999) == pytest.approx(0.125, abs=0.02)  # too few blocks
