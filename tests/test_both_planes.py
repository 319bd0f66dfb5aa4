"""A run of both planes: its artifacts, what the planes share, and the commands that look at it."""

import contextlib
import json
import shutil
from collections.abc import Callable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import auvident
from auvident.errors import GateError, NumericsError, UsageError
from auvident.pipeline.gates import Judged, check_planes, predicted
from auvident.pipeline.planes import wanted_planes
from auvident.schema.artifacts import Maneuver, Metrics
from auvident.schema.manifest import can_be_output
from auvident.storage.artifacts import TEMPORARY_SUFFIX
from auvident.storage.run_directory import RunDirectory
from tests import loop_world
from tests.command_line import SAMPLES, Called, call

RUN = Path("runs/both")
COMMAND = ("run", "sample_logs/harbour_trial", "sample_logs/dive_trial", "--vehicle")
COMMAND = (*COMMAND, "sample_logs/remus100.toml", "--run", RUN)
SHARED = {"X_udot", "X_uu", "T_nn", "T_nu"}
# of the RMSE that separate runs have: as good means within the scatter of a few maneuvers
AS_GOOD = 1.05


@pytest.fixture(scope="module")
def made(
    common_folder: Callable[[str], contextlib.AbstractContextManager[Path]],
) -> tuple[Path, Called]:
    """A folder with the run of a horizontal and a vertical trial of one vehicle."""
    with common_folder("both") as folder:
        said = folder / "said.json"
        if not said.exists():
            said.write_text(json.dumps(asdict(run_of_both(folder))))
        return folder, Called(**json.loads(said.read_text()))


def run_of_both(folder: Path) -> Called:
    (folder / "sample_logs").symlink_to(SAMPLES)
    with pytest.MonkeyPatch.context() as patch, contextlib.chdir(folder):
        loop_world.put_in_place(patch, loop_world.nothing)
        called = call(*COMMAND, "--json")
    assert called.code == 0, called.err
    return called


@pytest.fixture(scope="module")
def whole(made: tuple[Path, Called]) -> Path:
    """The run; not to be written to."""
    return made[0] / RUN


@pytest.fixture
def run(made: tuple[Path, Called], tmp_path: Path) -> Iterator[Path]:
    """A copy of the run to work on."""
    (tmp_path / "sample_logs").symlink_to(SAMPLES)
    shutil.copytree(made[0] / "runs", tmp_path / "runs")
    with contextlib.chdir(tmp_path):
        yield RUN


def read(path: Path) -> Any:
    return json.loads(path.read_text())


def coefficients(model: Path) -> dict[str, dict[str, Any]]:
    return {c["symbol"]: c for c in read(model)["coefficients"]}


def test_the_second_plane_stands_beside_the_first(whole: Path) -> None:
    assert read(whole / "identify/model.json")["plane"] == "horizontal"
    assert read(whole / "identify/vertical/model.json")["plane"] == "vertical"
    for stage in ("identify", "validate"):
        own = {p.name for p in (whole / stage).iterdir() if p.is_file()}
        assert {p.name for p in (whole / stage / "vertical").iterdir()} == own
        listed = read(whole / "run.json")["stages"][stage]["outputs"]
        assert set(listed) == {f"{stage}/{sub}{n}" for n in own for sub in ("", "vertical/")}
    assert set(read(whole / "validate/vertical/metrics.json")["summary"]["validate"]) >= {"w", "q"}


def test_nothing_is_stale_after_it(whole: Path) -> None:
    states = {
        s["stage"]: s["state"] for s in json.loads(call("status", whole, "--json").out)["stages"]
    }
    assert set(states.values()) == {"done"}


def test_json_has_the_second_plane_under_its_name(made: tuple[Path, Called], run: Path) -> None:
    tree = json.loads(made[1].out)
    assert tree["identify"]["plane"] == "horizontal"
    assert tree["identify"]["planes"]["vertical"]["plane"] == "vertical"
    assert set(tree["validate"]["planes"]["vertical"]["summary"]["validate"]) >= {"w", "q"}
    metrics = json.loads(call("validate", run, "--json").out)
    assert metrics["planes"]["vertical"] == read(run / "validate/vertical/metrics.json")


def test_each_plane_predicts_as_well_as_by_itself(whole: Path, run: Path) -> None:
    for plane, folder in (("horizontal", "."), ("vertical", "vertical")):
        assert call("identify", run, "--plane", plane, "--quiet").code == 0
        assert call("validate", run, "--quiet").code == 0
        alone, both = (
            read(p / "metrics.json") for p in (run / "validate", whole / "validate" / folder)
        )
        for role in ("validate", "identify"):
            for channel, error in alone["summary"][role].items():
                assert both["summary"][role][channel]["rmse"] <= AS_GOOD * error["rmse"], channel
        if plane == "horizontal":
            assert both == alone


def test_one_plane_leaves_nothing_of_the_other_behind(run: Path) -> None:
    assert call("identify", run, "--plane", "horizontal", "--quiet").code == 0
    assert not (run / "identify/vertical").exists()
    assert (run / "validate/vertical").exists()  # stale, and known to be
    assert call("validate", run, "--quiet").code == 0
    assert not (run / "validate/vertical").exists()
    assert "planes" not in json.loads(call("validate", run, "--json").out)


def test_what_both_planes_identify_says_so(whole: Path) -> None:
    first, other = (
        coefficients(whole / "identify" / n) for n in ("model.json", "vertical/model.json")
    )
    assert {s for s, c in other.items() if c["shared_with"] == "horizontal"} == SHARED
    assert not any(c["shared_with"] for c in first.values())
    for symbol in SHARED:
        c, estimate = other[symbol], first[symbol]
        assert (c["prior"], c["prior_std"]) == (estimate["prior"], estimate["prior_std"])
        apart = np.hypot(c["std"], estimate["std"])
        assert abs(c["value"] - estimate["value"]) < 2.0 * apart  # one vehicle


def test_the_speed_of_a_straight_run_counts_once(whole: Path, run: Path) -> None:
    """What both planes identify from loses the speed in the second, and nothing else."""
    assert call("identify", run, "--plane", "vertical", "--quiet").code == 0
    alone, both = (
        read(p)["stages"][-1]
        for p in (run / "identify/model.json", whole / "identify/vertical/model.json")
    )
    counted = set(read(whole / "identify/model.json")["stages"][-1]["maneuvers"])
    shared = counted & set(both["maneuvers"])
    assert shared == {"dive_trial-straight-1", "dive_trial-straight-2", "harbour_trial-straight-1"}
    assert sorted(alone["maneuvers"]) == sorted(both["maneuvers"])
    spans = {m["id"]: m["t_end_s"] - m["t_start_s"] for m in read(run / "segment/maneuvers.json")}
    less = alone["samples"] - both["samples"]
    per_second = less / sum(spans[name] for name in shared)
    assert 2.0 < per_second < 10.0  # readings of a DVL


def judged(whole: Path) -> list[Judged]:
    files = [whole / "validate" / p / "metrics.json" for p in (".", "vertical")]
    return [predicted(Metrics.model_validate(read(file))) for file in files]


def test_gates_take_the_plane_that_has_the_channel(whole: Path) -> None:
    planes = judged(whole)
    check_planes(planes, {"w": 9.0, "r": 9.0})
    for channel in ("w", "r"):
        with pytest.raises(GateError, match=f"{channel}: RMSE"):
            check_planes(planes, {"u": 9.0, channel: 1e-6})
    with pytest.raises(UsageError, match="no channel 'z'"):
        check_planes(planes, {"z": 1.0})


def test_a_gate_of_both_planes_holds_in_both(whole: Path) -> None:
    planes = judged(whole)
    low, high = sorted(p.found["u"].rmse for p in planes)
    check_planes(planes, {"u": 1.01 * high})
    for order in (planes, planes[::-1]):
        with pytest.raises(GateError, match="u: RMSE"):
            check_planes(order, {"u": 0.5 * (low + high)})


def test_the_command_line_asks_both_planes(run: Path) -> None:
    assert call("validate", run, "--fail-above", "w=1e-6", "--fail-above", "r=9").code == 1


def test_commands_look_at_the_plane_that_is_named(whole: Path, tmp_path: Path) -> None:
    for plane in ("horizontal", "vertical"):
        text = call("export", whole, "--plane", plane, "--format", "json").out
        assert json.loads(text)["plane"] == plane
        asked = call("plan-trial", whole, "--plane", plane, "--json")
        assert json.loads(asked.out)["plane"] == plane
        assert "of a run of both" not in asked.err
    unasked = call("plan-trial", whole)
    assert "the horizontal plane, of a run of both: --plane vertical" in " ".join(
        unasked.err.split()
    )
    log, table = SAMPLES / "dive_trial", tmp_path / "predicted.csv"
    window = ("--from", "770", "--to", "790", "--samples", "4")
    done = call(
        "simulate", whole, "--inputs", log, "--plane", "vertical", *window, "--output", table
    )
    assert done.code == 0, done.err
    assert "q_radps" in table.read_text().splitlines()[0]
    file = whole / "identify/vertical/model.json"
    assert call("export", file, "--plane", "horizontal").code == 3


FLOWN = ("simulate", RUN, "--from", "770", "--to", "780", "--samples", "4", "--inputs")


def test_a_log_is_flown_by_the_whole_vehicle(run: Path) -> None:
    done = call(*FLOWN, "sample_logs/dive_trial")
    assert done.code == 0, done.err
    assert f"The whole vehicle is flown ({run}/combine/model.json)" in done.err
    table = pd.read_parquet(run / "simulate/dive_trial-whole.parquet")
    assert {"q_radps_low", "r_radps_low", "roll_rad"} <= set(table)
    assert (
        "p_radps, roll_rad: the band holds 95 % of the sampled models, not of the readings"
        in done.err
    )
    tree = json.loads(call(*FLOWN, "sample_logs/dive_trial", "--json").out)
    assert tree["band"]["of_sampled_models"] == ["p_radps", "roll_rad"]
    assert tree["band"]["share"] == 0.95 and "q_radps" in tree["band"]["of_readings"]


def test_a_log_without_an_elevator_is_flown_in_the_first_plane(run: Path, tmp_path: Path) -> None:
    log = tmp_path / "bare"
    shutil.copytree(SAMPLES / "dive_trial", log, ignore=shutil.ignore_patterns("elevator*"))
    done = call(*FLOWN, log)
    assert done.code == 0, done.err
    assert "The log has no elevator_rad" in done.err and "whole vehicle is flown" not in done.err
    assert "r_radps" in pd.read_parquet(run / "simulate/bare.parquet")


def test_a_whole_vehicle_out_of_date_is_not_flown(run: Path) -> None:
    file = run / "combine/model.json"
    file.write_text(file.read_text() + "\n")
    done = call(*FLOWN, "sample_logs/dive_trial")
    assert done.code == 0, done.err
    assert "combine/model.json is out of date" in done.err
    assert (run / "simulate/dive_trial.parquet").exists()


@pytest.mark.parametrize("form", ["json", "toml", "csv", "python", "matlab", "c"])
def test_a_form_of_one_plane_says_that_there_is_another(whole: Path, form: str) -> None:
    """In the file as well, which goes to somebody who has not seen the terminal."""
    called = call("export", whole, "--format", form)
    said = "This is the horizontal plane alone, of a run of both: --plane vertical"
    assert called.code == 0 and said in " ".join(called.err.split())
    assert form in ("json", "csv") or said in called.out
    assert "horizontal" in called.out
    asked = call("export", whole, "--format", form, "--plane", "vertical")
    assert asked.code == 0 and said not in asked.err + asked.out and "vertical" in asked.out


def test_a_simulator_that_gets_one_plane_of_two_is_told(run: Path) -> None:
    said = "This is the horizontal plane alone, of a run of both"
    assert said not in call("export", run, "--format", "pvs").err
    shutil.rmtree(run / "combine")
    called = call("export", run, "--format", "pvs")
    assert called.code == 0 and said in " ".join(called.err.split())
    assert "`auvident run --run runs/both` makes the whole vehicle's" in " ".join(
        called.err.split()
    )


def test_a_plane_that_a_run_has_not_is_refused(run: Path) -> None:
    assert call("identify", run, "--plane", "vertical", "--quiet").code == 0
    for command in ("export", "plan-trial"):
        done = call(command, run, "--plane", "horizontal")
        assert done.code == 4 and "--plane both" in done.err


def test_runs_of_both_planes_are_compared_in_both(whole: Path, run: Path) -> None:
    assert call("identify", run, "--plane", "vertical", "--quiet").code == 0
    assert call("validate", run, "--quiet").code == 0
    found = json.loads(call("compare", whole, run, "--json").out)
    assert [r["plane"] for r in found["runs"]] == ["horizontal", "vertical"]
    (drag, fin) = (
        next(r for r in found["coefficients"] if r["symbol"] == s) for s in ("X_uu", "X_uudd")
    )
    assert drag["apart"] is not None and None not in fin["value"]
    assert fin["apart"] is None  # that of the rudder, and that of the elevator
    assert "The runs are of different planes" in call("compare", whole, run).err
    beside = found["planes"]["vertical"]
    assert [r["plane"] for r in beside["runs"]] == ["vertical", "vertical"]
    (row,) = (r for r in beside["coefficients"] if r["symbol"] == "M_uq")
    assert None not in row["value"] and row["apart"] < 1.0


def test_the_report_has_a_section_for_each_plane(whole: Path) -> None:
    page = (whole / "report/report.html").read_text()
    assert page.count('class="plane" id="horizontal"') == 1
    assert page.count('class="plane" id="vertical"') == 1
    for symbol in ("Z_uw", "Y_uv"):
        assert f"<td>{symbol}</td>" in page
    assert "identified, both planes" in page
    assert "<code>auvident simulate RUN --inputs LOG</code> flies it" in page
    ids = [part.split('"')[0] for part in page.split(' id="')[1:]]
    assert len(ids) == len(set(ids))
    assert page.count("a heading that turned round and round") == 1  # in one plane alone


def test_both_planes_make_one_model_of_six_degrees_of_freedom(whole: Path, run: Path) -> None:
    model = read(whole / "combine/model.json")
    assert [m["plane"] for m in model["models"]] == ["horizontal", "vertical"]
    assert [m["file"] for m in model["models"]][1].endswith("/vertical/model.json")
    shared = {c["symbol"]: c for c in model["coefficients"] if c["symbol"] in SHARED}
    assert {c["origin"] for c in shared.values()} == {"identified, both"}
    other = coefficients(whole / "identify/vertical/model.json")
    assert {s: c["value"] for s, c in shared.items()} == {s: other[s]["value"] for s in SHARED}
    assert call("identify", run, "--plane", "vertical", "--quiet").code == 0
    said = call("status", run).err
    assert "combine" in said and "stale" in said


def test_roll_is_identified_from_the_logs_of_the_run(whole: Path) -> None:
    """From the maneuvers that identify, as `auvident combine RUN` does it."""
    model = read(whole / "combine/model.json")
    origin = {e["symbol"]: e["origin"] for e in (*model["coefficients"], *model["constants"])}
    assert {origin[s] for s in ("I_xx", "K_up", "K_nn")} == {"identified, roll"}
    done = call("combine", whole, "--json")
    again = json.loads(done.out)
    assert again["coefficients"] == model["coefficients"]
    assert again["constants"] == model["constants"]
    listed = read(whole / "run.json")["stages"]["combine"]["inputs"]
    assert {"ingest/dive_trial.parquet", "segment/maneuvers.json"} <= set(listed)


def test_each_fin_has_the_drag_that_its_plane_found(whole: Path) -> None:
    rows = {c["symbol"]: c for c in read(whole / "combine/model.json")["coefficients"]}
    assert rows["X_uudrdr"]["origin"] == "identified, horizontal"
    assert rows["X_uudede"]["origin"] == "identified, vertical"
    assert "X_uudd" not in rows
    own = coefficients(whole / "identify/vertical/model.json")["X_uudd"]
    assert rows["X_uudede"]["value"] == pytest.approx(own["value"])


def test_report_and_terminal_tell_of_the_whole_vehicle(
    made: tuple[Path, Called], whole: Path
) -> None:
    said = " ".join(made[1].err.split())
    page = (whole / "report/report.html").read_text()
    model = read(whole / "combine/model.json")
    entries = [*model["coefficients"], *model["constants"]]
    number = sum(e["origin"] == "identified, vertical" for e in entries)
    assert f"{number} identified, vertical" in said and f"{number} identified, vertical" in page
    assert "combine/model.json" in said
    section = page.partition(' id="whole"')[2].partition("<h2")[0]
    assert section.count("<tr>") == len(entries) + 1
    for text in ("X_uudrdr", "K_up", "identified, roll", "vehicle file"):
        assert f"<td>{text}</td>" in section


def test_a_run_of_one_plane_says_nothing_of_a_whole_vehicle(run: Path) -> None:
    assert call("identify", run, "--plane", "horizontal", "--quiet").code == 0
    for stage in ("validate", "report"):
        assert call(stage, run, "--quiet").code == 0
    assert ' id="whole"' not in (run / "report/report.html").read_text()


def test_terminal_tables_show_both(run: Path) -> None:
    said = call("validate", run).err
    assert said.index("track") < said.index("Vertical plane") < said.index("pitch")


def test_a_plane_that_nobody_asked_for_may_fail(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import auvident.stages.identify as stage

    known = stage.identify

    def fails(*given: Any, plane: str, **named: Any) -> Any:
        if plane == "vertical":
            raise NumericsError("the filter diverged", "somewhere")
        return known(*given, plane=plane, **named)

    monkeypatch.setattr(stage, "identify", fails)
    assert call("identify", run, "--plane", "both").code == 5
    done = call("identify", run)
    assert done.code == 0
    assert "the vertical plane was not identified: the filter diverged" in done.err
    assert not (run / "identify/vertical").exists()


def test_the_folder_of_a_plane_is_kept_like_that_of_a_stage(tmp_path: Path) -> None:
    run, name = RunDirectory(tmp_path / "run"), "identify/vertical/model.json"
    (run / "identify/vertical").mkdir(parents=True)
    run.refuse_foreign("identify", [name], ())
    (run / name).write_text("mine")
    with pytest.raises(UsageError, match="was not written by auvident"):
        run.refuse_foreign("identify", [name], ())
    run.refuse_foreign("identify", [name], [name])
    shutil.rmtree(run / "identify/vertical")
    (run / "identify/vertical").write_text("mine as well")
    with pytest.raises(UsageError, match="was not written by auvident"):
        run.refuse_foreign("identify", [name], ())
    (run / "identify/vertical").unlink()
    (run / "identify/vertical").symlink_to(tmp_path)
    with pytest.raises(UsageError, match="symbolic link"):
        run.refuse_foreign("identify", [name], ())


def test_what_a_killed_process_left_in_the_folder_of_a_plane_goes(tmp_path: Path) -> None:
    run = RunDirectory(tmp_path / "run")
    left = run / f"identify/vertical/.model.json.1{TEMPORARY_SUFFIX}"
    left.parent.mkdir(parents=True)
    left.write_text("half")
    with run.lock():
        assert not left.exists()


@pytest.mark.parametrize(
    ("stage", "name", "can"),
    [
        ("identify", "identify/model.json", True),
        ("identify", "identify/vertical/model.json", True),
        ("identify", "identify/vertical", True),  # a file of that name
        ("identify", "identify/vertical/", False),
        ("identify", "identify/vertical/..", False),
        ("identify", "identify/other/model.json", False),
        ("identify", "identify/vertical/vertical/model.json", False),
        ("ingest", "ingest/vertical/model.json", False),
    ],
)
def test_outputs_stand_in_the_folder_of_a_stage_or_of_its_plane(
    stage: str, name: str, can: bool
) -> None:
    assert can_be_output(stage, name) is can


def maneuver(kind: str, plane: str, role: str = "identify") -> Maneuver:
    return Maneuver.model_validate(
        {"id": f"{plane}-{kind}", "trial": "t", "kind": kind, "role": role, "plane": plane}
        | {"t_start_s": 0.0, "t_end_s": 60.0, "planes": (plane,)}
    )


@pytest.mark.parametrize(
    ("found", "planes"),
    [
        ([("straight", "horizontal")], ("horizontal",)),
        ([("straight", "horizontal"), ("turn", "horizontal")], ("horizontal",)),
        ([("straight", "horizontal"), ("zigzag", "vertical")], ("vertical",)),
        ([("straight", "vertical")], ("vertical",)),  # depth steps
        ([("zigzag", "horizontal"), ("straight", "vertical")], ("horizontal",)),
        ([("zigzag", "horizontal"), *[("straight", "vertical")] * 2], ("horizontal", "vertical")),
        ([("turn", "horizontal"), ("zigzag", "vertical")], ("horizontal", "vertical")),
        ([("zigzag", "horizontal"), ("zigzag", "vertical", "validate")], ("horizontal",)),
        ([("zigzag", "horizontal", "validate")], ("horizontal",)),
    ],
)
def test_planes_are_those_with_maneuvers_of_their_own(found, planes) -> None:
    maneuvers = [maneuver(*row) for row in found]
    assert wanted_planes("found", maneuvers) == planes
    assert wanted_planes("both", maneuvers) == ("horizontal", "vertical")
    assert wanted_planes("vertical", maneuvers) == ("vertical",)


def test_the_interface_reads_the_whole_model_of_a_run_as_load_model_does_that_of_a_plane(
    run: Path,
) -> None:
    found = auvident.load_whole_model(run)
    assert found.artifact == auvident.load_run(run).whole.artifact
    assert found.path == run / "combine/model.json"
