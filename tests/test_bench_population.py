"""The study of drawn vehicles: its halves, its scoring and its tables."""

import json
import math

import numpy as np
import pandas as pd
import pytest

from auvident.errors import InputError
from auvident.schema.effects import BY_ID
from tests import loop_world
from tests.bench import __main__ as bench
from tests.bench import halves, population
from tests.bench.effects_truth import RATES, SPEEDS, cross_flow, planted_of
from tests.bench.population_bars import bars
from tests.bench.population_score import (
    STATES,
    chance_row,
    clean_state,
    is_wrong,
    last_line,
    scored,
    tables,
)
from tests.bench.population_trial import (
    CHANNELS,
    PASSED,
    band_coverage,
    chain,
    from_the_bow,
    held_out,
    key_of,
    outcome,
    segmentation,
)

CLASSES = ("with sail", "plain")
LAG = {
    "id": "rudder_lag",
    "family": "actuation",
    "exact": True,
    "time_s": [],
    "parameters": {"lag_s": 0.5},
}


def outcome_with(seed=4, planted=(), classes=("plain",), found=loop_world.diagnosis, **changes):
    """An outcome with hand-made artifacts, in which the program names a current."""
    said = found()
    ids = [p["id"] for p in planted]
    kind = "single" if ids else "none"
    case = {"key": str(seed), "seed": seed, "vehicle": "drawn", "kind": kind, "planted": ids}
    return {
        "case": case,
        "truth": {"planted": list(planted), "classes": list(classes), "refused": ["rolls over"]},
        "visible": {name: {"visible": True, "ratio": 3.0, "channel": "u"} for name in ids},
        "own": {},
        "diagnosis": said.model_dump(mode="json", by_alias=True),
        "comparison": loop_world.comparison(said).model_dump(mode="json", by_alias=True),
        "segmentation": {"true": {"zigzag": 2}, "missed": [], "extra": []},
        "nrmse": {"u": 0.1, "v": 0.4, "r": 0.1},
        "nrmse_ase": {"u": 0.2, "v": 0.3, "r": 0.2},
        "seconds": {},
    } | changes


def named(outcome) -> str:
    return scored(outcome).loop.named[0]


# --- the halves ---------------------------------------------------------------------------


def test_halves_never_meet():
    tune, report = (halves.seeds(3, 5, half) for half in halves.HALVES)
    assert tune == [4, 6, 8, 10, 12] and report == [3, 5, 7, 9, 11]


def test_single_trials_are_told_of_the_half_that_may_be_looked_at():
    wrong = [scored(outcome_with())]
    assert "trials that went wrong" in tables(wrong, CLASSES, with_seeds=True)
    assert "trials that went wrong" not in tables(wrong, CLASSES, with_seeds=False)


def test_what_likelihood_alone_would_name_is_counted_without_what_the_vehicle_has():
    clean = outcome_with()  # a current gains 812 nats, a misalignment 220, a lag 3
    both = {name: {"visible": True} for name in ("current", "dvl_misalignment")}
    its_own = outcome_with(own=both)
    assert (scored(clean).likelihood, scored(its_own).likelihood) == (812.4, 3.1)
    assert chance_row([scored(clean), scored(its_own)])["gain > 10 nats"] == 1


@pytest.mark.parametrize("half", halves.HALVES)
def test_outcomes_of_the_other_half_are_not_scored(half, tmp_path, capsys):
    path, table = tmp_path / "kept.jsonl", tmp_path / "tables.json"
    for seed in (0, 1, 2, 3):
        population.append(path, outcome_with(seed))
    arguments = ["--half", half, "--count", "2", "--score", str(path), "--json", str(table)]
    bench.main(["population", *arguments])
    shown = capsys.readouterr().out
    assert f"({half}, 2 trials)" in shown
    found = json.loads(table.read_text())
    seeds = [row["seed"] for row in found.get("trials that went wrong", [])]
    assert seeds == ([0, 2] if half == "tune" else [])


def test_trials_of_the_same_program_are_not_sailed_again(tmp_path, monkeypatch, capsys):
    sailed = []

    def outcome(seed, short, until, plane, planted=None, shown=(), times=1.0):
        sailed.append(seed)
        return outcome_with(seed)

    monkeypatch.setattr(population, "outcome", outcome)
    monkeypatch.setattr(population, "side_by_side", lambda sail, seeds, workers: map(sail, seeds))
    path = tmp_path / "kept.jsonl"
    for count in (1, 2):
        population.main(["--count", str(count), "--resume", str(path)], lambda *_: None)
    assert sailed == [0, 2]
    assert "1/1" in capsys.readouterr().err


# --- what the study is held to ------------------------------------------------------------


def bar(what, *outcomes):
    """The row of a bar whose name begins so."""
    return next(r for r in bars([scored(o) for o in outcomes]) if r["what"].startswith(what))


def taken(balance, interval):
    """Changes to an outcome: an attempt taken, and the interval of the named size."""
    made = outcome_with()
    effect = made["comparison"]["effects"][0]
    for parameter in effect["parameters"]:
        parameter["interval"] = interval
    made["comparison"]["attempts"] = [
        {"effects": ["x"], "taken": True, "balance": balance, "balance_se": 0.2}
    ]
    return made


def test_a_bar_is_told_with_what_so_many_trials_allow():
    found = bar("nothing planted: a name", *[outcome_with(seed) for seed in (0, 2)])
    assert (found["n"], found["found"], found["met"]) == (2, "100.0%", "NO")
    low, high = (float(x.rstrip("%")) for x in found["95 %"].split(" to "))
    assert low == pytest.approx(34.2, abs=0.1) and high == 100.0


def test_every_written_model_counts_in_what_breaks_physics():
    written = {"identify/model.json": [], "refine/model.json": ["thrust"]}
    found = bar("models that break", outcome_with(broken=written))
    assert (found["n"], found["found"], found["met"]) == (2, "50.0%", "NO")


def test_a_bar_without_trials_is_neither_met_nor_missed():
    found = bar("visible pairs", outcome_with())
    assert (found["n"], found["found"], found["met"]) == (0, "-", "")


def test_a_name_that_the_vehicle_has_is_not_false():
    name = named(outcome_with())
    own = outcome_with(own={name: {"visible": True}})
    assert bar("nothing planted: a name", own)["met"] == "yes"


def test_a_drift_counts_where_the_log_has_the_heading_to_look_for_one():
    """Whether one rate alone would be seen or not; another name than its own is none."""
    drift = {"id": "current_drift", "family": "environment", "exact": True, "time_s": []}
    planted = [drift | {"parameters": {"north_late_mps_per_1000_s": 0.1}}]
    found, partly, missed, other, blind, hidden = (outcome_with(planted=planted) for _ in range(6))
    found["comparison"]["effects"][0]["id"] = "current_drift"
    partly["comparison"]["verdict"] = "partly_explained"
    for one in (missed, blind):
        one["comparison"] |= {"effects": [], "ambiguous": [], "verdict": "unexplained"}
    blind["diagnosis"]["missing"] = ["heading_rad"]
    hidden["visible"]["current_drift"]["visible"] = False
    row = bar("drift of the current", found, partly, missed, other, blind, hidden)
    assert named(other) == "current" and (row["n"], row["found"]) == (4, "50.0%")


def test_what_refine_ships_is_held_against_what_was_left_out():
    worse, better = taken(0.1, [0.1, 0.2]), taken(-0.1, [-0.1, 0.2])
    assert bar("refined model worse", worse, better)["found"] == "50.0%"
    assert bar("... by more than", worse, better)["found"] == "0.0%"
    assert bar("named, and zero", worse, better)["found"] == "50.0%"


def test_an_interval_covers_too_little_and_too_much():
    current = {**LAG, "id": "current", "family": "environment"}
    truth = {
        p["symbol"]: p["value"] for p in outcome_with()["comparison"]["effects"][0]["parameters"]
    }
    right = outcome_with(planted=({**current, "parameters": truth},))
    found = bar("size within", right)
    assert (found["found"], found["bar"], found["met"]) == ("100.0%", ">= 90% and <= 98%", "NO")


def test_a_band_is_held_to_the_mean_share_of_its_samples():
    """Three trials in four are covered whole, one by half: no median tells that."""
    shares = (1.0, 1.0, 1.0, 0.5)
    found = bar("band of r", *(outcome_with(coverage={"u": 0.9, "r": share}) for share in shares))
    assert (found["n"], found["found"], found["met"]) == (4, "87.5%", "NO")
    assert found["95 %"] == "63.0% to 100.0%"
    assert bar("band of u", *(outcome_with(coverage={"u": 0.95}) for _ in shares))["met"] == "yes"
    assert bar("band of u", outcome_with(coverage={"u": 0.95}))["found"] == "-"


# --- one trial ----------------------------------------------------------------------------


def test_a_refusal_is_told_with_its_stage_and_code(tmp_path):
    def run(stage, directory, options, observer):
        if stage == "segment":
            raise InputError("no maneuver", str(tmp_path / "trial"), "sail again")

    found = chain(tmp_path, run)
    assert (found["stage"], found["exit_code"]) == ("segment", 3)
    assert found["error"] == "no maneuver (/trial)"
    failed = scored(outcome_with(diagnosis=None, comparison=None, **{k: found[k] for k in REFUSED}))
    assert failed.clean == "failed" and is_wrong(failed)


REFUSED = ("stage", "exit_code", "error")


def test_of_a_bug_the_last_line_is_told(tmp_path):
    def run(stage, directory, options, observer):
        raise ZeroDivisionError("by what")

    found = chain(tmp_path, run)
    assert found["stage"] == "ingest" and "exit_code" not in found
    assert last_line(found["error"]) == "ZeroDivisionError: by what"


def test_found_and_missed_maneuvers(tmp_path):
    def row(kind, start, end, **more):
        return {"kind": kind, "t_start_s": start, "t_end_s": end, "role": "identify", **more}

    found = [
        row("turn", 10, 40),
        row("zigzag", 100, 130),  # less than half of the true one
        row("straight", 300, 350),
        row("straight", 10, 40, features={"plane": "vertical"}),
    ]
    refused = {"t_start_s": 150, "t_end_s": 160, "reason": "zigzag: no", "value": 2.0}
    (tmp_path / "segment").mkdir()
    (tmp_path / "segment/maneuvers.json").write_text(json.dumps(found))
    rejected = {"rejected": [{**refused, "threshold": 3.0}]}
    (tmp_path / "segment/rejected.json").write_text(json.dumps(rejected))
    truth = {"maneuvers": [row("turn", 12, 41), row("zigzag", 100, 180, other=0.7)]}
    told = segmentation(tmp_path, truth)
    assert told["true"] == {"turn": 1, "zigzag": 1}
    assert [m["why"] for m in told["missed"]] == [["zigzag: no: 2 against 3"]]
    assert [m["kind"] for m in told["extra"]] == ["straight", "depth_step"]
    rows = tables([scored(outcome_with(segmentation=told))], CLASSES, with_seeds=False)
    assert rows["why maneuvers were missed"] == [{"what": "zigzag of unequal executes: no", "n": 1}]


def test_maneuvers_of_the_vertical_plane_by_their_kinds(tmp_path):
    def row(kind, start, end, plane=None):
        features = {"plane": plane} if plane else {}
        times = {"t_start_s": start, "t_end_s": end}
        return {"kind": kind, **times, "role": "identify", "features": features}

    found = [
        row("zigzag", 0, 50, "vertical"),
        row("straight", 60, 90, "vertical"),
        row("straight", 100, 150),
        row("zigzag", 200, 250),
    ]
    (tmp_path / "segment").mkdir()
    (tmp_path / "segment/maneuvers.json").write_text(json.dumps(found))
    true = [row("zigzag", 0, 50), row("depth_step", 58, 92), row("straight", 100, 150)]
    true.append({**row("zigzag", 200, 250), "about": "kept"})
    told = segmentation(tmp_path, {"maneuvers": true}, "vertical")
    assert told["true"] == {"zigzag": 2, "depth_step": 1, "straight": 1}
    assert [m["t_start_s"] for m in told["missed"]] == [200]  # found in the other plane
    (why,) = tables([scored(outcome_with(segmentation=told))], CLASSES, False)[
        "why maneuvers were missed"
    ]
    assert why["what"] == "zigzag about an elevator kept: nothing said"


def test_a_depth_step_that_nobody_flew_is_invented_where_the_vehicle_turns(tmp_path):
    times = {"t_start_s": 10.0, "t_end_s": 20.0, "role": "identify"}
    step = {"kind": "straight", **times, "features": {"plane": "vertical"}}
    for folder in ("segment", "ingest"):
        (tmp_path / folder).mkdir()
    (tmp_path / "segment/maneuvers.json").write_text(json.dumps([step]))
    log = pd.DataFrame({"time_s": np.arange(0.0, 30.0, 0.1)})
    for rate, invented in ((0.0, 0), (0.05, 1), (-0.05, 1)):
        log.assign(r_radps=rate).to_parquet(tmp_path / "ingest/trial.parquet")
        assert len(segmentation(tmp_path, {"maneuvers": []}, "vertical")["extra"]) == invented
    log.assign(r_radps=0.0).to_parquet(tmp_path / "ingest/trial.parquet")
    assert len(segmentation(tmp_path, {"maneuvers": []})["extra"]) == 1  # of a horizontal trial


def test_trials_of_the_planes_are_kept_apart():
    keys = {key_of(4, True, until, plane) for until in ("refine", "validate") for plane in CHANNELS}
    assert keys == {"4", "4-vertical", "4-validate", "4-vertical-validate"}


def test_predictions_of_the_vertical_plane_are_told_by_its_channels():
    row = outcome_with(nrmse={"u": 0.1, "w": 0.3, "q": 0.2}, nrmse_ase={})
    (told,) = tables([scored(row)], (), False)["prediction"]
    assert (told["nrmse w"], told["nrmse q"]) == (0.3, 0.2) and "nrmse r" not in told


def test_planted_parameters_of_the_vertical_plane_are_those_of_the_program():
    from seatrial.effects import draw_effects
    from seatrial.population.sizes import SINGLES_OF
    from seatrial.vehicles import load_vehicle

    vehicle = load_vehicle("tern180")
    known = [n for n in SINGLES_OF["vertical"] if n in BY_ID and "vertical" in BY_ID[n].planes]
    assert "propeller_lag" in known
    for name in known:
        drawn = draw_effects([{"id": name}], 3, vehicle.scale, 11.0, "vertical")[name]
        truth = {"plane": "vertical", "effects": [{"id": name, "parameters": drawn}]}
        (planted,) = planted_of(truth, vehicle)
        declared = {p.symbol for p in BY_ID[name].parameters}
        assert set(planted.parameters) <= declared, name
        assert planted.family == BY_ID[name].family, name


def test_strips_of_the_vertical_plane_are_those_of_the_plant():
    """Least squares over the same grid of what the plant adds for a factor of one."""
    import numpy as np
    from seatrial.plant import STATES, PlantEffects, derivative
    from seatrial.vehicles import load_vehicle

    body, out = load_vehicle("tern180").body, np.zeros(STATES)
    w, q = (grid.ravel() for grid in np.meshgrid(SPEEDS, RATES))
    parts = ({}, {"heave_cross_flow": 1.0, "pitch_cross_flow": 1.0})
    forces = np.zeros((2, w.size, 6))
    for part, effects in enumerate(parts):
        for i in range(w.size):
            state = np.zeros(STATES)
            state[2], state[4], state[8] = w[i], q[i], 50.0
            more = PlantEffects(**effects)
            derivative(state, 0.0, 0.0, 0.0, 1.0, np.zeros(6), body, more, np.zeros(6), out)
            forces[part, i] = body.mass @ out[:6]
    added = forces[1] - forces[0]
    terms = np.column_stack([w * np.abs(w), q * np.abs(q), w * np.abs(q), q * np.abs(w)])
    fitted = np.linalg.lstsq(terms, added[:, [2, 4]], rcond=None)[0]
    strips = cross_flow(body)
    assert [strips["Z_w|q|"], strips["Z_q|w|"]] == pytest.approx(list(fitted[2:, 0]))
    assert [strips["M_w|q|"], strips["M_q|w|"]] == pytest.approx(list(fitted[2:, 1]))


def test_coverage_is_taken_where_the_artifacts_have_it(tmp_path):
    import pandas as pd

    assert held_out(tmp_path) == {} and band_coverage(tmp_path / "none.parquet") == {}
    (tmp_path / "validate").mkdir()
    error = {"nrmse": 0.3}
    metrics = {
        "summary": {"validate": {"u": error}},
        "ase": {"summary": {"validate": {"u": error}}},
    }
    (tmp_path / "validate/metrics.json").write_text(json.dumps(metrics))
    table = pd.DataFrame({"u_mps_measured": [1.0, 2.0], "role": "validate"})
    table = table.assign(u_mps_lo=0.5, u_mps_hi=1.5)
    table.to_parquet(tmp_path / "validate/simulation.parquet")
    found = held_out(tmp_path)
    assert found["coverage"] == {"u": 0.5}
    assert found["nrmse"] == found["nrmse_ase"] == {"u": 0.3}
    metrics["coverage"] = {"u": {"nominal": 0.95, "covered": 0.9, "width": 0.1}}
    (tmp_path / "validate/metrics.json").write_text(json.dumps(metrics))
    assert held_out(tmp_path)["coverage"] == {"u": 0.9}


def test_a_survey_of_the_first_stages_tells_of_maneuvers_alone(tmp_path):
    ran = []

    def run(stage, directory, options, observer):
        ran.append(stage)

    chain(tmp_path, run, "segment")
    assert ran == ["ingest", "segment"]
    keys = [key_of(4, short, until) for short in (True, False) for until in ("segment", "refine")]
    assert keys == ["4-segment", "4", "4-long-segment", "4-long"]
    missed = {"true": {"zigzag": 2}, "missed": [{"kind": "zigzag", "why": []}], "extra": []}
    rows = [scored(outcome_with()), scored(outcome_with(6, segmentation=missed))]
    found = tables(rows, CLASSES, with_seeds=True, whole=False)
    assert "nothing planted" not in found
    assert [row["seed"] for row in found["trials that went wrong"]] == [6]


# --- scores -------------------------------------------------------------------------------


def test_trials_with_an_effect_that_is_asked_for_are_others():
    def refused(stage: str, *_: object, **more: object) -> None:
        raise InputError(stage)

    drift = ("current_drift",)
    assert key_of(4, True, "refine") != key_of(4, True, "refine", planted=drift)
    found = outcome(4, until="refine", planted=drift, run=refused)
    assert found["case"]["planted"] == ["current_drift"] and found["case"]["kind"] == "single"


@pytest.mark.parametrize("shows", [True, False])
def test_of_planted_effects_those_that_show_may_be_looked_at_alone(shows, monkeypatch):
    """Judged by the generator before the program sees anything of it."""

    def refused(stage: str, *_: object, **more: object) -> None:
        raise InputError(stage)

    told = {"gyro_bias": {"visible": shows}}
    monkeypatch.setattr("seatrial.population.visible.visibility", lambda *_: told)
    planted, ways = ("gyro_bias",), {"until": "ingest", "planted": ("gyro_bias",)}
    found = outcome(4, **ways, shown=("single",), run=refused)
    assert found["case"]["key"] == key_of(4, True, "ingest", planted=planted, shown=("single",))
    assert found["case"]["key"] != key_of(4, True, "ingest", planted=planted)
    assert found["stage"] == ("ingest" if shows else PASSED)
    assert outcome(4, **ways, shown=("pair",), run=refused)["stage"] == PASSED
    assert outcome(40032, until="ingest", shown=("single",), run=refused)["stage"] == PASSED
    kinds = [("single",), ("pair",), ("single", "pair")]  # what one passes another looks at
    keys = {key_of(4, True, "refine", shown=s, times=times) for s in kinds for times in (1.0, 2.0)}
    assert len(keys) == 2 * len(kinds)


@pytest.mark.parametrize("seed", [40000, 40010, 40032])
def test_the_kind_of_a_trial_is_known_before_its_vehicle(seed):
    from seatrial.population import draw, kind_of

    assert kind_of(seed) == draw(seed).kind
    assert kind_of(seed, ("gyro_bias", "current")) == "pair"


def test_a_name_that_is_the_vehicles_own_is_no_false_alarm():
    alarm = outcome_with()
    name = named(alarm)
    assert scored(alarm).clean == "named" and scored(alarm).false == (name,)
    own = scored(outcome_with(own={name: {"visible": True}}))
    assert own.clean == "own" and own.false == () and not is_wrong(own)
    faint = scored(outcome_with(own={name: {"visible": False, "explained": None}}))
    assert faint.clean == "named"


@pytest.mark.parametrize(("explained", "is_own"), [(0.9, True), (0.4, False), (-2.0, False)])
def test_what_stands_for_a_part_of_the_vehicle_is_its_own_however_faint(explained, is_own):
    name = named(outcome_with())
    found = scored(outcome_with(own={name: {"visible": False, "explained": explained}}))
    assert (found.own, found.faint) == (((name,), (name,)) if is_own else ((), ()))
    assert bool(found.false) is not is_own


def test_states_of_a_clean_trial():
    loop = scored(outcome_with()).loop
    assert clean_state(loop, True, (), ()) == "failed"
    assert clean_state(loop, False, (), ()) == "unexplained"  # nothing named, and not "none"
    assert clean_state(loop, False, ("x",), ("y",)) == "named"
    assert {"failed", "none", "own", "named", "unexplained"} == set(STATES)


def test_tables_count_by_class():
    rows = [
        scored(outcome_with(0)),
        scored(outcome_with(2, classes=("with sail",), planted=(LAG,))),
    ]
    found = tables(rows, CLASSES, with_seeds=True)
    clean = {row["class"]: row for row in found["nothing planted"]}
    assert (clean["all"]["n"], clean["all"]["named"], clean["with sail"]["n"]) == (1, 1, 0)
    planted = {row["class"]: row for row in found["planted"]}
    assert (planted["all"]["shown"], planted["plain"]["shown"]) == (1, 0)
    assert planted["with sail"]["wrong"] == 1  # a current is named, a lag was planted
    assert found["prediction"][0]["worse than ase"] == 2
    assert found["refused draws"] == [{"what": "rolls over", "n": 2}]
    assert json.loads(json.dumps(found)) == found


def test_a_model_that_runs_away_predicts_worse_than_the_estimate():
    better = {"nrmse": {"u": 0.1}, "nrmse_ase": {"u": 0.9}}
    away = {**better, "nrmse": {}}
    rows = [scored(outcome_with(0, **better)), scored(outcome_with(2, **away))]
    found = tables(rows, CLASSES, with_seeds=False)["prediction"][0]
    assert (found["worse than ase"], found["nrmse u"]) == (1, 0.1)


def test_what_the_generator_could_not_sail_is_no_trial():
    lost = {**outcome_with(4), "stage": "generator", "error": "Traceback\nRefused: rolls over"}
    found = tables([scored(outcome_with(0)), scored(lost)], CLASSES, with_seeds=True)
    assert found["could not be sailed"] == [{"what": "Refused: rolls over", "n": 1}]
    assert found["nothing planted"][0]["n"] == found["maneuvers and failures"][0]["trials"] == 1
    assert "generator" not in json.dumps(found)


def test_what_the_generator_could_not_sail_is_in_no_bar_of_a_file_that_is_scored(tmp_path, capsys):
    path, table = tmp_path / "kept.jsonl", tmp_path / "tables.json"
    population.append(path, outcome_with(0))
    lost = {"stage": "generator", "error": "Traceback\nRefused: rolls over"}
    population.append(path, {**outcome_with(2), **lost})
    bench.main(["population", "--count", "2", "--score", str(path), "--json", str(table)])
    assert "(tune, 1 trials)" in capsys.readouterr().out
    found = json.loads(table.read_text())
    assert found["could not be sailed"] == [{"what": "Refused: rolls over", "n": 1}]
    (ended,) = (row for row in found["bars"] if row["what"] == "the chain did not end")
    assert (ended["n"], ended["found"]) == (1, "0.0%")


def test_a_hidden_effect_is_not_missed():
    quiet = outcome_with(planted=(LAG,), found=loop_world.diagnosis)
    quiet["diagnosis"] |= {"effects": [], "verdict": "none_found"}
    quiet["comparison"] |= {"effects": [], "ambiguous": [], "verdict": "none_found"}
    assert is_wrong(scored(quiet))
    quiet["visible"]["rudder_lag"]["visible"] = False
    assert not is_wrong(scored(quiet))


def test_without_a_heading_the_truth_counts_from_the_bow():
    """A current to the east is ahead of a vehicle that heads east."""
    planted = {"id": "current", "parameters": {"north_mps": 0.0, "east_mps": 0.3}}
    found = from_the_bow(planted, math.pi / 2.0)["parameters"]
    assert found == pytest.approx({"north_mps": 0.3, "east_mps": 0.0}, abs=1e-12)
    drift = {"parameters": {"north_late_mps_per_1000_s": 0.2, "east_late_mps_per_1000_s": 0.0}}
    behind = from_the_bow(drift, math.pi)["parameters"]
    assert behind["north_late_mps_per_1000_s"] == pytest.approx(-0.2)
