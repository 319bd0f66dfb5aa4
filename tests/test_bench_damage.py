"""The generator of damage, the judge of what becomes of it, and the page."""

import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.bench import __main__ as bench
from tests.bench import damage, damage_page, damage_trial, written
from tests.bench.damage_names import (
    ACCUSING,
    DOUBTS,
    NAMES,
    SENSOR_WORDS,
    TESTED_BY,
    any_of,
    names_it,
)
from tests.bench.damage_score import OUTCOMES, QUIETLY_WRONG, WELL, false_alarms, judge
from tests.engines.chain import SAMPLES
from tests.session import once

if str(SAMPLES) not in sys.path:
    sys.path.insert(0, str(SAMPLES))
from seatrial.damage import BEST, CASES, KINDS, Log
from seatrial.damage import damage as damaged
from seatrial.damage.axes import turned
from seatrial.damage.log import with_key

FAMILIES = tuple(dict.fromkeys(kind.family for kind in KINDS))
FEW_ROWS = 700  # of a file: enough for every kind
OF_THE_SAME_VEHICLE = ("vehicle-remus100",)  # the file that the sample has anyway


@once
def small_log() -> dict[str, str]:
    """Text of the sensor files of a sample trial, thinned out."""
    found = {}
    for path in sorted((SAMPLES / "harbour_trial").glob("*.csv")):
        head, *rows = path.read_text(encoding="utf-8").splitlines()
        found[path.name] = "\n".join([head, *rows[:: 1 + len(rows) // FEW_ROWS]]) + "\n"
    return found


def log_in(folder: Path) -> Log:
    """The thinned trial and its vehicle file, written."""
    (folder / "trial").mkdir(parents=True)
    for name, text in small_log().items():
        (folder / "trial" / name).write_text(text, encoding="utf-8")
    shutil.copy(SAMPLES / "remus100.toml", folder / "vehicle.toml")
    return Log(folder / "trial", folder / "vehicle.toml")


def content(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


# --- the table ----------------------------------------------------------------------------


def test_the_table_is_whole() -> None:
    assert len(KINDS) >= 120 and len({kind.id for kind in KINDS}) == len(KINDS)
    assert all(kind.best in BEST and kind.family and kind.does for kind in KINDS)
    assert all(("{}" in kind.does) == bool(kind.sizes) for kind in KINDS)
    assert {kind.sensor for kind in KINDS} - {""} <= set(SENSOR_WORDS)


def test_every_fault_has_names_and_every_name_a_fault() -> None:
    assert {kind.fault for kind in KINDS} == set(NAMES)


@pytest.mark.parametrize("family", FAMILIES)
def test_every_kind_changes_the_log(family: str, tmp_path: Path) -> None:
    same = []
    for case in (c for c in CASES.values() if c.kind.family == family):
        folder = tmp_path / re.sub(r"\W", "_", case.id)
        log = log_in(folder)
        before = content(folder)
        damaged(log, (case,), seed=4)
        if content(folder) == before:
            same.append(case.id)
        shutil.rmtree(folder)
    assert set(same) <= set(OF_THE_SAME_VEHICLE)


def test_damage_is_the_same_for_a_seed(tmp_path: Path) -> None:
    logs = [log_in(tmp_path / name) for name in ("one", "two", "three")]
    cases = (CASES["spikes-dvl:0.1"], CASES["zeros:0.03"])
    for log, seed in zip(logs, (2, 2, 4), strict=True):
        damaged(log, cases, seed)
    one, two, three = (content(log.folder) for log in logs)
    assert one == two != three and logs[0].lost > 10


# --- what the kinds do --------------------------------------------------------------------


@pytest.mark.parametrize("angle", [-90.0, 10.0, 180.0])
def test_a_turned_dvl_reads_the_same_speed(angle: float, tmp_path: Path) -> None:
    log, clean = log_in(tmp_path / "a"), log_in(tmp_path / "b")
    turned(log, angle)
    u, v = (log.values("dvl", q) for q in "uv")
    u0, v0 = (clean.values("dvl", q) for q in "uv")
    known = np.isfinite(u0 + v0)
    np.testing.assert_allclose(np.hypot(u, v)[known], np.hypot(u0, v0)[known], atol=2e-4)
    back = np.radians(angle)
    np.testing.assert_allclose((u * np.cos(back) - v * np.sin(back))[known], u0[known], atol=2e-4)


def test_velocities_in_earth_axes_follow_the_position(tmp_path: Path) -> None:
    """North and east speeds add up to the track that the position log has, but for a current."""
    log = log_in(tmp_path)
    damaged(log, (CASES["earth-axes"],), 0)
    time, north = log.time("dvl"), log.values("dvl", "u")
    known = np.isfinite(north)
    track = np.interp(
        log.time("position"), time[known], np.cumsum(north[known] * np.gradient(time[known]))
    )
    fixes = log.values("position", "north")
    inside = np.isfinite(fixes)
    assert np.corrcoef(track[inside], fixes[inside])[0, 1] > 0.99


def test_a_clock_drifts_from_the_start_on(tmp_path: Path) -> None:
    log = log_in(tmp_path)
    before, (begin, end) = log.time("dvl"), log.span()
    damaged(log, (CASES["drift-dvl:1000"],), 0)
    gained = log.time("dvl") - before
    assert gained[0] == pytest.approx(0.0, abs=2e-3)
    assert gained[-1] == pytest.approx((end - begin) * 1e-3, rel=0.02)


def test_a_frozen_rudder_stands_still_where_it_would_move_most(tmp_path: Path) -> None:
    log = log_in(tmp_path)
    rows = log.busy("rudder", 40.0)
    before = log.values("rudder", "rudder")[rows]
    damaged(log, (CASES["rudder-frozen:40"],), 0)
    after = log.values("rudder", "rudder")[rows]
    assert np.ptp(before[np.isfinite(before)]) > 5.0 and np.ptp(after) == 0.0


def test_cells_that_are_not_touched_keep_their_digits(tmp_path: Path) -> None:
    log = log_in(tmp_path)
    before = log.read("dvl")
    damaged(log, (CASES["v-scale:2"],), 0)
    after = log.read("dvl")
    assert after.drop(columns="v_mps").equals(before.drop(columns="v_mps"))
    v = before["v_mps"].replace("", "nan").astype(float).to_numpy()
    np.testing.assert_allclose(log.values("dvl", "v"), 2.0 * v, atol=1e-9)


def test_keys_are_changed_in_their_own_table() -> None:
    text = "[a]\nx = 1\n[[b]]\nx = 2 # two\n[[b]]\nx = 3\n"
    assert with_key(text, "b", "x", lambda old: old[:1] + "0").count("0") == 2
    assert with_key(text, "a", "x", None) == "[a]\n[[b]]\nx = 2 # two\n[[b]]\nx = 3\n"
    assert with_key(text, "a", "y", "7").startswith("[a]\ny = 7\nx = 1\n")


# --- through the program ------------------------------------------------------------------

# Case -> what becomes of it, as far as the ingest goes.
INGESTED = {
    "decimal-comma": "read",
    "windows-lines": "read",
    "utf-16": "read",
    "preamble": "read",
    "iso": "read",
    "gzip": "read",
    "wide": "read",
    "no-dvl": "refused",
    "cm-per-s": "refused",
    "rudder-sign-vehicle": "refused",
    "no-mass": "refused",
    "map-no-column": "refused",
    "twice": "refused",
    "gear:4": "read",
}


@pytest.mark.parametrize("name", INGESTED)
def test_through_the_ingest(name: str, tmp_path: Path) -> None:
    log = log_in(tmp_path)
    damaged(log, (CASES[name],), 4)
    found = damage_trial.chain(tmp_path, log.logs, log.map, "ingest")
    if INGESTED[name] == "refused":
        assert found["exit_code"] == 3 and found["remedy"] and found["error"]
    else:
        assert "error" not in found and found["dropped"]["gyro"]


def test_findings_are_those_that_the_terminal_shows(tmp_path: Path) -> None:
    log = log_in(tmp_path)
    damaged(log, (CASES["mps-as-knots"],), 4)
    found = damage_trial.chain(tmp_path, log.logs, log.map, "ingest")
    (ratio,) = [t for t in found["told"] if t["code"] == "speed_position_ratio"]
    assert ratio["shown"] and ratio["stage"] == "ingest"
    assert names_it(ratio, CASES["mps-as-knots"].kind.fault, "dvl")


def test_a_bug_and_a_generator_that_fails_are_evidence(tmp_path: Path, monkeypatch) -> None:
    def broken(*_: object) -> None:
        raise ZeroDivisionError("by what")

    log = log_in(tmp_path)
    found = damage_trial.chain(tmp_path, log.logs, None, "ingest", broken)
    assert "exit_code" not in found and "by what" in found["error"]
    assert judged(found).outcome == "failed"


# --- the judge ----------------------------------------------------------------------------

COEFFICIENTS = {"X_uu": [-10.0, 1.0, 0.9], "Y_uv": [-5.0, 1.0, 0.6], "N_rr": [3.0, 0.1, 0.2]}
KNOTS, ZEROS, TERN = (CASES[n] for n in ("knots", "zeros:0.03", "vehicle-tern180"))


def telling(code: str, message: str = "", **more: object) -> dict:
    base = {"stage": "ingest", "kind": "finding", "where": "", "value": None, "shown": True}
    return {**base, "code": code, "message": message or code, **more}


def evidence(off: float = 0.0, **more: object) -> dict:
    """Of a trial in which one informed coefficient is off by so many standard deviations."""
    moved = {s: [v + off * std * (s == "Y_uv"), std, d] for s, (v, std, d) in COEFFICIENTS.items()}
    case = {"key": "0/x", "seed": 0, "damage": ["knots"]}
    base = {"case": case, "told": [], "dropped": {"dvl": {"outlier": 6}}, "gaps": {"dvl": 3.0}}
    return {**base, "coefficients": moved, "effects": [], "lost": 0, "ratio": 1.0, **more}


def judged(found: dict, case: object = KNOTS, clean: dict | None = None):
    return judge({**evidence(), "coefficients": {}, **found}, clean or evidence(), [case])


@pytest.mark.parametrize(
    ("found", "outcome"),
    [
        (evidence(1.9), "right"),
        (evidence(1.9, ratio=1.4), "quiet"),
        (evidence(1.9, ratio=None), "quiet"),
        (evidence(0.0, ratio=None), "right"),
        (evidence(2.1), "near"),
        (evidence(2.1, ratio=1.4), "quiet"),
        (evidence(4.1), "quiet"),
        (evidence(9.0, told=[telling("speed_position_ratio")]), "said"),
        (evidence(9.0, told=[telling("speed_position_ratio", shown=False)]), "quiet"),
        (evidence(9.0, told=[telling("speed_scale", kind="check")]), "said"),
        (evidence(9.0, told=[telling("dvl_lags_gyro")]), "misnamed"),
        (evidence(9.0, told=[telling("speed_by_position", kind="untested")]), "untested"),
        (evidence(9.0, told=[telling("rudder_cut", kind="untested")]), "quiet"),
        (evidence(9.0, told=[telling("prior-contradicted", stage="identify")]), "quiet"),
        (evidence(9.0, told=[telling("priors-contradicted", stage="identify")]), "doubted"),
        (evidence(9.0, told=[telling("many_rows_dropped", "9 rows of dvl")]), "said"),
        (evidence(9.0, told=[telling("many_rows_dropped", "9 rows of gyro")]), "quiet"),
        (evidence(9.0, told=[telling("held_copies")]), "quiet"),
        ({"stage": "ingest", "exit_code": 3, "error": "x (y)", "remedy": "do"}, "refused"),
        ({"stage": "ingest", "exit_code": 3, "error": "x (y)", "remedy": ""}, "gave up"),
        ({"stage": "identify", "exit_code": 5, "error": "x (y)", "remedy": "do"}, "gave up"),
        ({"stage": "ingest", "error": "Traceback:\n  there\nKeyError: 'u'"}, "failed"),
    ],
)
def test_outcomes(found: dict, outcome: str) -> None:
    assert judged(found).outcome == outcome


def test_what_is_said_of_the_clean_log_as_well_names_nothing() -> None:
    clean = evidence(told=[telling("advance_ratio", "u / (n D) is 2.1", value=2.1)])
    near = evidence(9.0, told=[telling("advance_ratio", "u / (n D) is 2.3", value=2.3)])
    far = evidence(9.0, told=[telling("advance_ratio", "u / (n D) is 4.2", value=4.2)])
    assert judged(near, clean=clean).outcome == "quiet"
    assert judged(far, clean=clean).outcome == "said"


SWAY, LATE, DRIFTS = (CASES[n] for n in ("v-scale:0.5", "shift-rpm:5", "drift-rpm:2000"))


def coarse(code: str, within: float | None) -> dict:
    return telling(code, kind="coarse", value=within)


@pytest.mark.parametrize(
    ("case", "told", "outcome"),
    [
        (SWAY, coarse("sway_by_position", 2.4), "untested"),
        (SWAY, coarse("sway_by_position", None), "untested"),
        (SWAY, coarse("sway_by_position", 1.8), "quiet"),
        (SWAY, coarse("rudder_scale", 2.4), "quiet"),
        (LATE, coarse("clock_rpm", 6.0), "untested"),
        (LATE, coarse("clock_rpm", 4.0), "quiet"),
        (LATE, coarse("drift_rpm", 6000.0), "quiet"),
        (DRIFTS, coarse("drift_rpm", 3000.0), "untested"),
        (DRIFTS, coarse("drift_rpm", 1000.0), "quiet"),
        (DRIFTS, coarse("drift_rudder", 3000.0), "quiet"),
        (DRIFTS, coarse("clock_rpm", 3000.0), "quiet"),
        (KNOTS, {**coarse("speed_scale", 4.0), "shown": False}, "quiet"),
    ],
)
def test_a_fault_within_what_a_coarse_test_leaves_open_is_said(case, told, outcome) -> None:
    """The first line says so of the clean log as well: what a log can test hangs on no fault."""
    clean = evidence(told=[told])
    assert judged(evidence(9.0, told=[told]), case, clean).outcome == outcome
    assert judged(evidence(1.0, told=[told]), case, clean).outcome == "right"


@pytest.mark.parametrize(
    ("here", "of_clean", "outcome"),
    [(5.0, 1.9, "quiet"), (5.0, 2.1, "untested"), (1.9, 2.1, "quiet"), (None, 1.9, "quiet")],
)
def test_a_fault_does_not_widen_what_is_left_open(here, of_clean, outcome) -> None:
    clean = evidence(told=[coarse("sway_by_position", of_clean)])
    found = evidence(9.0, told=[coarse("sway_by_position", here)])
    assert judged(found, SWAY, clean).outcome == outcome


@pytest.mark.parametrize("kind", ["v-offset:0.3", "rudder-offset:0.2"])
def test_an_offset_of_the_gyro_that_nothing_tests_leaves_no_other_open(kind) -> None:
    where = "offset of the yaw rate against heading"
    told = telling("yaw_rate_offset", kind="untested", where=where)
    assert judged(evidence(9.0, told=[told]), CASES[kind]).outcome == "quiet"


def test_a_pattern_with_words_counts_where_the_message_has_them() -> None:
    sign = CASES["v-sign"]
    for words, outcome in (("v of the other sign, or x_m?", "said"), ("[dvl] x_m?", "misnamed")):
        found = evidence(9.0, told=[telling("speed_by_drift", words)])
        assert judged(found, sign).outcome == outcome


def test_checks_that_test_a_fault_are_those_of_the_table() -> None:
    from auvident.stages.ingest.checks import CHECKS
    from auvident.stages.ingest.clocks import DRIFT_PREFIX, LIMITS, PREFIX

    known = {c.name for c in CHECKS} | {p + s for p in (PREFIX, DRIFT_PREFIX) for s in LIMITS}
    assert {name.rstrip("@") for names in TESTED_BY.values() for name in names} <= known
    assert set(TESTED_BY) <= {case.kind.fault for case in CASES.values()}


def test_rows_that_are_lost_have_to_be_counted() -> None:
    assert judged(evidence(lost=100), ZEROS).outcome == "uncounted"
    dropped = {"dvl": {"outlier": 6, "fill_value": 60}}
    assert judged(evidence(lost=100, dropped=dropped), ZEROS).outcome == "right"
    assert judged(evidence(lost=100, gaps={"dvl": 9.0}), ZEROS).outcome == "right"
    assert judged(evidence(9.0, lost=100, dropped=dropped), ZEROS).outcome == "counted"
    few = {"dvl": {"outlier": 6, "fill_value": 40}}
    assert judged(evidence(lost=100, dropped=few), ZEROS).outcome == "uncounted"


def test_only_what_the_data_inform_is_compared() -> None:
    found = evidence()
    found["coefficients"]["N_rr"] = [99.0, 0.1, 0.2]
    assert judged(found).outcome == "right"


def test_a_log_that_knows_less_may_be_farther_off_but_not_by_any_amount() -> None:
    found = evidence(3.5)
    found["coefficients"]["Y_uv"][1] = 10.0  # of which twice the clean log's counts
    assert judged(found).stds == pytest.approx(1.75)


def test_a_wrong_vehicle_is_named_by_the_contradiction() -> None:
    told = [telling("priors-contradicted", stage="identify")]
    assert judged(evidence(9.0, told=told), TERN).outcome == "said"


def test_an_effect_that_the_clean_log_has_not_is_news() -> None:
    lag = CASES["averaged-dvl:10"]
    assert judged(evidence(9.0, effects=["dvl_delay"]), lag).outcome == "said"
    assert judged(evidence(9.0, effects=["gyro_bias"]), lag).outcome == "misnamed"
    clean = evidence(effects=["dvl_delay"])
    assert judged(evidence(9.0, effects=["dvl_delay"]), lag, clean).outcome == "quiet"


@pytest.mark.parametrize(("value", "outcome"), [(-4.3, "said"), (1.4, "misnamed")])
def test_an_offset_has_to_be_told_with_its_figure(value: float, outcome: str) -> None:
    told = [telling("dvl_lags_gyro", value=value)]
    assert judged(evidence(9.0, told=told), CASES["shift-dvl:5"]).outcome == outcome


def test_no_doubt_and_no_remark_is_an_accusation() -> None:
    silent = ("channels_absent", "not-seen", "correlated", "own_outputs_left_out")
    assert not [code for code in silent if any_of(code, ACCUSING) or any_of(code, DOUBTS)]


def test_false_alarms_are_checks_accusations_and_new_reasons() -> None:
    told = [telling("dvl_lags_gyro"), telling("channels_absent"), telling("x", kind="check")]
    found = evidence(told=told, dropped={"gyro": {"outlier": 9, "stuck": 3}})
    assert false_alarms(found) == ["dropped:stuck", "dvl_lags_gyro", "x"]


@pytest.mark.parametrize(
    ("remedy", "code"),
    [("Turn it, or give --fix rudder_sign; or not.", "rudder_sign"), ("", "refused")],
)
def test_a_clean_log_that_is_refused_is_a_false_alarm(remedy, code) -> None:
    found = {**evidence(), "error": "the rudder contradicts", "remedy": remedy}
    assert false_alarms(found) == [code]


# --- the study ----------------------------------------------------------------------------


def test_kinds_are_chosen_by_name_size_and_family() -> None:
    first = damage.chosen((), all_sizes=False)
    assert len(first) == len(KINDS) and len(damage.chosen((), all_sizes=True)) == len(CASES)
    assert damage.chosen(("gear:2", "knots*"), all_sizes=False) == [
        "knots",
        "knots-no-position",
        "gear:2",
    ]
    assert {CASES[n].kind.family for n in damage.chosen(("map",), True)} == {"map"}
    with pytest.raises(SystemExit, match="no kind"):
        damage.chosen(("nothing",), True)


def test_fours_end_with_the_text_and_are_the_same_for_a_seed() -> None:
    names = damage.chosen((), all_sizes=True)
    sets = damage.fours(names, 5, 2)
    assert sets == damage.fours(names, 5, 2) != damage.fours(names, 5, 4)
    assert all(len(set(s)) == 4 and CASES[s[3]].kind.family in FAMILIES[5:] for s in sets)


def test_evidence_in_a_file_is_judged_anew(tmp_path: Path, monkeypatch, capsys) -> None:
    kept, page = tmp_path / "kept.jsonl", tmp_path / "damaged-logs.md"
    monkeypatch.setattr(damage_page, "PAGE", page)
    benchmarks = tmp_path / "benchmarks.md"
    benchmarks.write_text("<!-- begin damage -->\n<!-- end damage -->\n", encoding="utf-8")
    monkeypatch.setattr(written, "PAGE", benchmarks)
    clean = {"key": "2/clean", "seed": 2, "damage": ["clean"]}
    drawn = {"key": "2/as drawn", "seed": 2, "damage": ["as drawn"]}
    for found in (
        evidence(case=drawn, told=[telling("dvl_lags_gyro"), coarse("clock_dvl", 2.0)]),
        evidence(case=clean),
        evidence(9.0, case=case_of("knots")),
        evidence(case=case_of("tabs")),
    ):
        damage.append(kept, found)
    arguments = ["damage", "--seeds", "2", "--score", str(kept), "--write", "--clean", "2"]
    bench.main(arguments)
    assert "by family (2 trials)" in capsys.readouterr().out
    text = page.read_text(encoding="utf-8")
    assert "## Quietly wrong" in text and "| knots | speeds in knots" in text
    assert text.count("\n## ") == 6  # outcomes, quietly wrong, two families, checks and clean logs
    assert "| `speed_scale` | 1 | 0 | 0 | 0 | 1 | 0 |" in text  # knots, that nothing was said of
    assert "| `clock_dvl` | 0 | 0 | 0 | 0 | 0 | 0 |" in text
    for file in (page, benchmarks):
        assert "| dvl_lags_gyro | 1 | 1 | 2 |" in file.read_text(encoding="utf-8")
    assert "| all | 2 | 1 | 1 | 50 | 50 | 50 |" in benchmarks.read_text(encoding="utf-8")


def test_kinds_that_exclude_each_other_are_no_outcome(tmp_path: Path) -> None:
    kept = {"2/clean": evidence(case=damage_trial.case_of(2, "clean"))}
    kept["2/west"] = {"case": case_of("west"), "stage": "generator", "error": "Traceback: x"}
    assert damage.judged(kept) == []


def test_a_bug_stays_in_the_evidence_and_a_line_cut_short_does_not(tmp_path: Path) -> None:
    path = tmp_path / "kept.jsonl"
    damage.append(path, evidence(case=case_of("tabs"), error="Traceback: there"))
    with path.open("a", encoding="utf-8") as stream:
        stream.write('{"case": {"key": "2/kno')
    assert list(damage.evidence_in(path)) == ["2/tabs"]


def case_of(name: str) -> dict:
    return damage_trial.case_of(2, name)


def test_both_halves_of_the_seeds_are_told_apart() -> None:
    found = [{"program": "p", "case": {"seed": seed, "damage": ["knots"]}} for seed in (16, 16, 1)]
    even, odd, *vehicles = damage.studied_as(found).split(". ")
    assert "2 trials, even" in even and "1 trials, odd" in odd
    assert vehicles == ["Seed 16: units and scales 2", "Seed 1: units and scales 1."]


def test_the_page_explains_every_outcome() -> None:
    text = damage_page.page([judged(evidence(1.0))], [], "how")
    assert all(f"| `{outcome}` |" in text for outcome in OUTCOMES)
    assert {*WELL, *QUIETLY_WRONG} <= set(OUTCOMES)
