"""The study of the residual loop: its list of trials, its scoring and its tables."""

import json
import math
import subprocess
import sys
from collections import Counter
from itertools import islice

import pytest

from auvident.schema.effects import BY_ID, EFFECTS, in_plane
from auvident.schema.planes import HORIZONTAL
from auvident.stages.diagnose.verdict.observability import detectable_push
from tests import loop_world
from tests.bench import __main__ as bench
from tests.bench import effects
from tests.bench.effects_bars import (
    affected_ratio,
    bars,
    clean_errors,
    rises_surely,
    worst_rise,
)
from tests.bench.effects_cases import (
    DEVELOPMENT,
    LATER,
    OUTSIDE,
    REPORTED,
    SINGLES,
    VEHICLES,
    Case,
    cases,
    endless,
)
from tests.bench.effects_score import compared, is_visible, least_chance, score, uniformity
from tests.bench.effects_summary import as_json, by_effect, confusion, failures, is_good, tables
from tests.bench.effects_trial import outcome
from tests.bench.effects_truth import cross_flow, planted_of, translate
from tests.command_line import ENVIRONMENT

CURRENT = {
    "id": "current",
    "family": "environment",
    "exact": True,
    "time_s": [],
    "parameters": {"north_mps": -0.12, "east_mps": 0.1},
}
LAG = {
    "id": "rudder_lag",
    "family": "actuation",
    "exact": True,
    "time_s": [],
    "parameters": {"lag_s": 0.5},
}


def outcome_with(planted=(CURRENT,), found=loop_world.diagnosis, kind="single", **update):
    """An outcome with hand-made artifacts; `update` goes into the diagnosis."""
    said = found().model_copy(update=update)
    ids = tuple(p["id"] for p in planted)
    case = Case(1, "remus100", kind, ids)
    return {
        "case": {"key": case.key, "vehicle": case.vehicle, "kind": kind, "planted": list(ids)},
        "truth": {"planted": list(planted)},
        "diagnosis": said.model_dump(mode="json", by_alias=True),
        "comparison": loop_world.comparison(said).model_dump(mode="json", by_alias=True),
        "seconds": {"diagnose": 12.0, "refine": 3.0},
        "peak_mb": 400.0,
    }


# --- the list -----------------------------------------------------------------------------


def test_the_list_covers_every_effect_on_both_vehicles() -> None:
    found = cases()
    kinds = Counter(c.kind for c in found)
    assert len(found) > 200 and kinds["none"] >= 40 and kinds["pair"] >= 24
    count = Counter((c.label, c.vehicle) for c in found)
    for label in (*SINGLES, *LATER, *OUTSIDE):
        assert min(count[label, vehicle] for vehicle in VEHICLES) >= 2
    assert {c.label for c in found if c.kind == "outside"} == set(OUTSIDE)


def test_pairs_are_of_different_families() -> None:
    from seatrial.effects import EFFECTS as PLANTED

    pairs = {c.planted for c in cases() if c.kind == "pair"}
    assert len(pairs) >= 12
    assert all(PLANTED[a].family != PLANTED[b].family for a, b in pairs)


def test_a_trial_keeps_its_seed_whatever_else_is_left_out() -> None:
    whole = {c.key: c for c in cases()}
    some = cases(only=["current", "pair"], vehicles=["tern180"])
    assert some and all(whole[c.key] == c and c.vehicle == "tern180" for c in some)
    assert cases(trials=7) == list(islice(endless(DEVELOPMENT), 7))
    assert [c.label for c in cases(trials=3, only=["dvl_scale"])] == ["dvl_scale"] * 3


def test_seeds_of_development_and_report_never_meet() -> None:
    last = max(c.seed for c in endless(DEVELOPMENT))
    assert last < REPORTED == min(c.seed for c in cases(REPORTED))
    assert len({c.seed for c in cases()}) == len(cases())


# --- the truth ----------------------------------------------------------------------------


def test_every_planted_parameter_is_one_of_the_program() -> None:
    from seatrial.effects import draw_effects
    from seatrial.vehicles import load_vehicle

    vehicle = load_vehicle("tern180")
    for name in (*SINGLES, *LATER):
        drawn = draw_effects([{"id": name}], 3, vehicle.scale, 11.0)[name]
        truth = {"effects": [{"id": name, "parameters": drawn}]}
        (planted,) = planted_of(truth, vehicle)
        declared = {p.symbol for p in BY_ID[name].parameters}
        assert set(planted.parameters) <= declared and planted.family == BY_ID[name].family


def test_only_the_nuisances_of_the_program_are_never_planted() -> None:
    horizontal = {e.id for e in EFFECTS if "horizontal" in e.planes}
    assert horizontal - {*SINGLES, *LATER} == {"dvl_height", "weight_excess"}


def test_angles_are_translated() -> None:
    wave = translate("wave", {"omega_radps": 1.1, "direction_rad": math.pi / 2})
    assert wave == {"omega_radps": 1.1, "direction_deg": pytest.approx(90.0)}


def test_strips_of_one_station_have_the_closed_form() -> None:
    class Body:
        density, cross_flow = 1000.0, 1.0
        strip_x, strip_area = 0.0, 0.2

    import numpy as np

    body = Body()
    body.strip_x, body.strip_area = np.array([0.0]), np.array([0.2])
    # at the origin the force is -100 v|v|: nothing is left for the cross terms
    assert all(abs(value) < 1e-9 for value in cross_flow(body).values())


# --- the score ----------------------------------------------------------------------------


def test_a_right_name() -> None:
    found = score(outcome_with())
    assert found.declared and found.right_id and found.right_family and found.visible
    assert not (found.wrong_name or found.extra)
    assert found.held_out["u"] == (loop_world.BEFORE["u"], loop_world.AFTER["u"])


def test_sizes_are_held_against_their_intervals() -> None:
    north, east = score(outcome_with()).sizes
    assert north.inside and north.z == pytest.approx((-0.121 + 0.12) / 0.004)
    assert east.inside is False and east.value == 0.083  # no interval stated: 1.96 deviations
    assert not is_good(score(outcome_with()))


def test_a_direction_comes_round() -> None:
    stated = {"value": 179.0, "std": 2.0}
    found = compared("direction_deg", -180.0, stated)
    assert found.inside and found.z == pytest.approx(-0.5)


def test_a_wrong_name() -> None:
    found = score(outcome_with([LAG]))
    assert found.declared and found.wrong_name and found.extra == ("current",)
    assert not (found.right_family or found.right_or_group)


def test_a_group_counts_when_one_of_it_is_named() -> None:
    group = {"verdict": "ambiguous", "ambiguous": (("current", "rudder_lag"),)}
    found = score(outcome_with([LAG], **group))
    assert found.right_or_group and found.right_family and not found.right_id
    assert not (found.wrong_name or found.extra)
    other = score(outcome_with([LAG], ambiguous=(("gyro_bias", "rudder_lag"),)))
    assert not other.right_or_group


def test_another_name_of_the_family_is_no_wrong_one() -> None:
    delay = {**LAG, "id": "wave", "family": "environment", "parameters": {}}
    found = score(outcome_with([delay]))
    assert found.right_family and not found.wrong_name and not found.right_or_group


def test_visible_is_what_the_program_says_it_sees() -> None:
    sees = [row.model_dump() for row in loop_world.sees()]
    assert is_visible(LAG, sees)
    assert not is_visible({**LAG, "parameters": {"lag_s": 0.06}}, sees)
    limit = {"id": "rudder_rate_limit", "parameters": {"rate_degps": 20.0}}
    assert is_visible(limit, sees)
    assert not is_visible({**limit, "parameters": {"rate_degps": 40.0}}, sees)
    arm = {"id": "dvl_lever_arm", "parameters": {"dx_m": 0.01, "dy_m": 2.0}}
    assert not is_visible(arm, sees)  # dy would be large enough, but is not visible at all
    assert is_visible({"id": "one_off_event", "parameters": {}}, sees)
    assert not is_visible({"id": "dvl_scale", "parameters": {"fraction": 0.9}}, sees)


def test_nothing_planted() -> None:
    good = score(outcome_with([], found=loop_world.nothing, kind="none"))
    assert is_good(good) and good.visible is None and not good.wrong_name
    bad = score(outcome_with([], kind="none"))
    assert bad.wrong_name and not is_good(bad)


def test_outside_of_the_library_a_doubtful_name_is_allowed() -> None:
    force = {**LAG, "id": "heading_force", "family": "outside", "parameters": {}}
    doubt = {"verdict": "unexplained", "unexplained": {"nearest": "current"}}
    assert is_good(score(outcome_with([force], kind="outside", **doubt)))
    assert not is_good(score(outcome_with([force], kind="outside")))


def test_a_finding_on_the_coefficients_counts() -> None:
    found = outcome_with(
        [
            {
                **LAG,
                "id": "sway_cross_flow",
                "family": "hydrodynamics",
                "exact": False,
                "parameters": {"Y_v|r|": -50.0},
            }
        ],
        found=loop_world.nothing,
    )
    assert not score(found).by_finding
    found["diagnosis"]["findings"] = [{"code": "cross-flow"}]
    assert score(found).by_finding and is_good(score(found))


def test_the_time_of_an_event() -> None:
    event = {"id": "one_off_event", "family": "environment", "exact": False, "parameters": {}}
    told = {"effects": (loop_world.EVENT,)}
    assert score(outcome_with([{**event, "time_s": [430.0, 433.0]}], **told)).off_s == 0.0
    assert score(outcome_with([{**event, "time_s": [400.0, 403.0]}], **told)).off_s == 28.5


def test_an_event_elsewhere_is_no_good_one() -> None:
    event = {"id": "one_off_event", "family": "environment", "exact": False, "parameters": {}}
    for begin, good in ((430.0, True), (300.0, False)):
        planted = [{**event, "time_s": [begin, begin + 3.0]}]
        assert is_good(score(outcome_with(planted, effects=(loop_world.EVENT,)))) is good


def test_the_table_of_effects_has_the_error_of_the_size() -> None:
    row = by_effect([score(outcome_with())])[0]
    # north off by 0.001 of 0.12, east by 0.017 of 0.1: the median is their mean
    assert row["error"] == pytest.approx((0.001 / 0.12 + 0.17) / 2) and row["in_95"] == "1/2"


def test_an_event_between_the_maneuvers_that_identify_cannot_be_seen() -> None:
    event = {**CURRENT, "id": "one_off_event", "parameters": {}, "time_s": (50.0, 53.0)}
    outcome = outcome_with([event])
    for spans, visible in (([[40.0, 51.0]], True), ([[10.0, 49.0], [54.0, 60.0]], False)):
        assert score({**outcome, "identifying_s": spans}).visible is visible
    assert score(outcome).visible  # of a study that did not keep the maneuvers


def test_a_push_is_seen_where_it_shows_in_sway_and_yaw() -> None:
    rows = detectable_push((0.08, 0.02), HORIZONTAL)
    sees = [row.model_dump() for row in rows]
    event = {**CURRENT, "id": "one_off_event"}
    for v, r, seen in ((0.2, 3, True), (0.2, 1, False), (0.05, 3, False)):
        assert is_visible({**event, "parameters": {"v_mps": v, "r_degps": r}}, sees) is seen
    assert is_visible({**event, "parameters": {}}, sees)  # its size is not known
    none = [row.model_dump() for row in detectable_push(None, HORIZONTAL)]
    assert not is_visible({**event, "parameters": {"v_mps": 9.0, "r_degps": 90.0}}, none)


def test_what_flows_is_seen_as_a_whole() -> None:
    sees = [row.model_dump() for row in loop_world.sees()]  # 0.011 north, 0.014 east
    for north, east, seen in ((0.008, 0.01, True), (-0.008, 0.01, True), (0.008, 0.009, False)):
        flow = {**CURRENT, "parameters": {"north_mps": north, "east_mps": east}}
        assert is_visible(flow, sees) is seen
    hidden = [{**row, "visible": False} for row in sees]
    assert not is_visible(CURRENT, hidden)


def test_both_of_a_pair_are_asked_for() -> None:
    assert not score(outcome_with([CURRENT, LAG], kind="pair")).right_family
    lag = loop_world.EffectFound(id="rudder_delay", family="actuation", parameters=())
    both = {"effects": (loop_world.CURRENT, lag)}
    found = score(outcome_with([CURRENT, LAG], kind="pair", **both))
    assert found.right_family and not found.right_or_group and found.extra == ("rudder_delay",)


def test_a_trial_that_failed() -> None:
    failed = {**outcome_with(), "diagnosis": None, "comparison": None, "error": "no maneuver"}
    found = score(failed)
    assert (found.verdict, found.why) == ("failed", "no maneuver") and not is_good(found)
    assert found.visible and not found.declared


# --- the tables ---------------------------------------------------------------------------


def some_scores():
    clean = outcome_with([], found=loop_world.nothing, kind="none")
    return [score(o) for o in (outcome_with(), outcome_with([LAG]), clean)]


def test_the_bars_count_what_they_say() -> None:
    rows = {row["what"]: row for row in bars(some_scores())}
    assert rows["visible effects declared"]["found"] == "100.0%"
    assert rows["right family"] == {
        "what": "right family",
        "n": 2,
        "found": "50.0%",
        "bar": ">= 92%",
        "met": "NO",
    }
    assert rows["nothing planted: anything stated"]["met"] == "yes"
    assert rows["pairs: both families"]["met"] == ""


def test_the_confusion_table_counts_names() -> None:
    rows = {row["planted"]: row["named"] for row in confusion(some_scores())}
    assert rows == {"current": "current 1", "rudder_lag": "current 1", "none": "none_found 1"}


def test_the_most_affected_channel_is_the_one_worst_against_clean_trials() -> None:
    found = score(outcome_with())
    clean = {("remus100", c): rmse for c, rmse in (("u", 0.046), ("v", 0.01), ("r", 0.006))}
    assert affected_ratio(found, clean) == pytest.approx(0.0055 / 0.041)
    assert worst_rise(found) == pytest.approx(0.006 / 0.0062 - 1.0)
    assert worst_rise(found, ("heading",)) is None
    assert clean_errors(some_scores())["remus100", "r"] == loop_world.BEFORE["r"]


def test_a_rise_that_chance_explains_is_told_from_one_that_it_does_not() -> None:
    outcome = outcome_with()
    held_out = outcome["comparison"]["held_out"]
    held_out["after"]["r"]["rmse"] = 1.1 * held_out["before"]["r"]["rmse"]
    assert worst_rise(score(outcome)) == pytest.approx(0.1) and not rises_surely(score(outcome))
    held_out["difference"]["r"] = {"value": 0.0006, "low": 0.0001, "high": 0.001}
    assert score(outcome).surely_up == ("r",) and rises_surely(score(outcome))


def test_failed_trials_are_listed_with_the_reason() -> None:
    (size, wrong) = failures(some_scores())
    assert size["sizes"][1][-1] is False
    assert wrong["named"] == ["current"] and "as likely by chance" in wrong["why"]
    assert set(json.loads(as_json(some_scores()))) == {*tables(some_scores()), "failed trials"}


# --- the command --------------------------------------------------------------------------


def test_an_interrupted_study_is_taken_up_again(monkeypatch, tmp_path, capsys) -> None:
    sailed: list[str] = []

    def sail(outcome, wanted, workers):
        for case in wanted:
            sailed.append(case.key)
            planted = [] if case.kind == "none" else [{**LAG, "id": case.label, "parameters": {}}]
            yield {
                **outcome_with(planted, kind=case.kind),
                "case": {
                    "key": case.key,
                    "vehicle": case.vehicle,
                    "kind": case.kind,
                    "planted": list(case.planted),
                },
            }

    monkeypatch.setattr(effects, "side_by_side", sail)
    kept, found = tmp_path / "kept.jsonl", tmp_path / "found.json"
    command = ["effects", "--only", "none,rudder_lag", "--resume", str(kept)]
    bench.main([*command, "--trials", "3"])
    kept.write_text(kept.read_text()[:-40])  # killed in the middle of a line
    bench.main([*command, "--trials", "5", "--json", str(found)])
    assert Counter(sailed)[sailed[2]] == 2 and len(set(sailed)) == 5 and len(sailed) == 6
    assert "planted against named" in capsys.readouterr().out
    assert sum(row["n"] for row in json.loads(found.read_text())["by planted effect"]) == 5


def test_outcomes_of_another_program_are_sailed_again_and_can_be_scored(
    monkeypatch, tmp_path, capsys
) -> None:
    kept, case = tmp_path / "kept.jsonl", cases(only=["none"])[0]
    old = outcome_with([], found=loop_world.nothing, kind="none")
    old["case"] |= {"key": case.key, "vehicle": case.vehicle}
    monkeypatch.setattr(
        effects, "side_by_side", lambda outcome, wanted, workers: [dict(old) for _ in wanted]
    )
    for version in ("old", "new", "new"):
        monkeypatch.setattr(effects, "program", lambda v=version: v)
        bench.main(["effects", "--only", "none", "--trials", "1", "--resume", str(kept)])
    assert len(kept.read_text().splitlines()) == 2
    capsys.readouterr()
    monkeypatch.setattr(effects, "side_by_side", lambda *_: pytest.fail("nothing is to sail"))
    bench.main(["effects", "--only", "none", "--trials", "1", "--score", str(kept)])
    assert "none_found 1" in capsys.readouterr().out


def test_what_shows_artifacts_is_no_part_of_the_program_that_makes_them(tmp_path) -> None:
    for name in ("auvident/stages/a.py", "auvident/report/b.py", "sample_logs/c.py"):
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).touch()

    def changed(name: str) -> tuple[bool, bool]:
        before = [effects.program(whole, tmp_path) for whole in (False, True)]
        (tmp_path / name).write_text("x")
        after = [effects.program(whole, tmp_path) for whole in (False, True)]
        return before[0] != after[0], before[1] != after[1]

    assert changed("auvident/report/b.py") == (False, True)
    assert changed("auvident/stages/a.py") == (True, True)
    assert changed("sample_logs/c.py") == (True, True)


def test_trials_that_met_a_bug_are_sailed_again_and_scored_where_asked(tmp_path) -> None:
    path = tmp_path / "kept.jsonl"
    for stage in ("generator", "diagnose", "refine"):
        bug = "Traceback ..." if stage != "refine" else ""
        effects.append(path, {"case": {"key": stage}, "stage": stage, "error": bug})
    assert set(effects.read_outcomes(path)) == {"refine"}
    every = {"generator", "diagnose", "refine"}
    assert set(effects.read_outcomes(path, with_bugs=True)) == every


def test_unknown_effects_are_refused(capsys) -> None:
    with pytest.raises(SystemExit):
        bench.main(["effects", "--only", "curent"])
    assert "curent" in capsys.readouterr().err


def test_a_trial_goes_through_the_program(monkeypatch) -> None:
    made = loop_world.put_in_place(monkeypatch)
    found = outcome(next(c for c in cases(only=["rudder_lag"])))
    assert set(made.calls) == {"diagnose", "refine"} and "error" not in found
    assert found["truth"]["planted"][0]["parameters"].keys() == {"lag_s"}
    assert score(found).wrong_name and found["seconds"]["refine"] >= 0.0


def test_a_refusal_of_the_program_is_an_outcome() -> None:
    from auvident.errors import NumericsError

    def refuse(*_, **__):
        raise NumericsError("no excitation", "turn-1", "sail more")

    found = outcome(Case(1, "remus100", "none", ()), refuse)
    assert found["error"] == "no excitation (turn-1)" and found["diagnosis"] is None


def test_the_program_knows_the_symbols_that_are_compared() -> None:
    names = {name for e in in_plane("horizontal") for name in e.names()}
    assert {"current.north_mps", "rudder_lag.lag_s"} <= names


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux ends them")
def test_workers_end_with_the_bench_that_is_killed() -> None:
    """They hold its standard output as long as they are there; these would for a minute."""
    bench_at_work = (
        "import os, time; from tests.bench.effects import processes\n"
        "pool = processes(1); print(pool.submit(os.getpid).result(), flush=True)\n"
        "pool.submit(time.sleep, 60).result()"
    )
    command = [sys.executable, "-c", bench_at_work]
    first = subprocess.Popen(command, env=ENVIRONMENT, stdout=subprocess.PIPE)
    assert first.stdout is not None and int(first.stdout.readline()) != first.pid
    first.kill()
    first.communicate(timeout=30)


def test_the_least_chance_is_that_of_a_false_name_that_is_large_enough() -> None:
    rows = [
        {"id": "current", "p": 0.001},
        {"id": "dvl_delay", "p": 0.01, "strength": 9.0, "refusal": {"code": "small"}},
        {"id": "gyro_bias", "p": 0.2, "refusal": {"code": "steady"}},
        {"id": "wave", "p": None},
    ]
    assert least_chance({"candidates": rows}) == 0.001
    assert least_chance({"candidates": rows}, own=["current"]) == 0.2
    assert least_chance({"candidates": rows[3:]}) == least_chance({}) == 1.0


def test_chances_that_are_too_small_too_often_are_not_uniform() -> None:
    even = [(i + 0.5) / 40 for i in range(40)]
    assert uniformity(even)["p"] > 0.5
    cautious = uniformity([1.0] * 40)
    assert cautious["p"] < 0.05 < 0.5 < cautious["p of excess"]
    small = uniformity([0.01] * 10 + even)
    assert max(small["p"], small["p of excess"]) < 0.05
    assert (small["n"], small["below 0.05"]) == (50, 12)
    assert uniformity([])["n"] == 0
