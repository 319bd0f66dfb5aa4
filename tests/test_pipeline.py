"""What runs, what is skipped and why; what a stage leaves in the run directory."""

import contextlib
import hashlib
import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

from auvident.errors import InputError, NumericsError
from auvident.pipeline import STAGES, status, steps
from auvident.pipeline.table import BY_NAME, before
from tests.command_line import SAMPLES, Called

NAMES = [stage.name for stage in STAGES]
ONE_PLANE = [stage.name for stage in STAGES if not stage.needs_both]
RUN = ("run", "sample_logs/harbour_trial", "--vehicle", "sample_logs/remus100.toml", "--run")


def decisions(called: Called) -> dict[str, str]:
    """Sentence of each stage."""
    lines = [line.split(": ", 1) for line in called.err.splitlines() if ": " in line]
    return {line[0]: line[1] for line in reversed(lines) if line[0] in NAMES}  # the first of each


def states(run: Path) -> dict[str, str]:
    return {d.stage: d.state for d in status(run)[0]}


def test_a_run_of_one_plane_needs_no_stage_of_both(
    demo: Path, auvident: Callable[..., Called]
) -> None:
    (decision,) = (d for d in status(demo)[0] if d.stage == "combine")
    assert (decision.state, decision.reason) == ("not needed", "the run has one plane")
    assert set(states(demo).values()) == {"done", "not needed"}
    assert "not needed" in auvident("status", demo).err
    (demo / "identify/model.json").unlink()
    assert states(demo)["combine"] == "missing"  # no one knows which planes it will have


def test_the_manifest_has_the_hash_of_every_artifact(demo: Path) -> None:
    manifest = json.loads((demo / "run.json").read_text())
    assert list(manifest["stages"]) == ONE_PLANE
    for name, entry in manifest["stages"].items():
        assert entry["outputs"], name
        options = set(BY_NAME[name].options) - {"interactive"}  # no default: only where given
        assert options == set(entry["options"])
        assert entry["started_at"] <= entry["ended_at"]
        for path, digest in (entry["inputs"] | entry["outputs"]).items():
            assert hashlib.sha256((demo / path).read_bytes()).hexdigest() == digest
    files = {Path(name).name for name in manifest["stages"]["ingest"]["inputs"]}
    assert files >= {"remus100.toml", "dvl.csv", "rudder.csv"}
    assert list(manifest["stages"]["identify"]["program_files"]) == [
        "plans/refined.toml",
        "plans/spiral.toml",
    ]


def test_every_file_of_the_run_is_in_the_manifest(demo: Path) -> None:
    manifest = json.loads((demo / "run.json").read_text())
    known = {p for entry in manifest["stages"].values() for p in entry["outputs"]}
    there = {p.relative_to(demo).as_posix() for p in demo.rglob("*") if p.is_file()}
    assert there == known | {"run.json"}


def test_a_second_run_skips_everything(demo: Path, auvident: Callable[..., Called]) -> None:
    before = {p: p.stat().st_mtime_ns for p in demo.rglob("*")}
    called = auvident(*RUN, demo)
    left_out = dict.fromkeys(NAMES, "skipped, it needs both planes")
    assert decisions(called) == left_out | dict.fromkeys(ONE_PLANE, "up to date")
    assert {p: p.stat().st_mtime_ns for p in demo.rglob("*")} == before


@pytest.mark.usefixtures("quick_report")  # its bytes: tests/report/test_html.py
def test_a_run_in_another_folder_gives_the_same_bytes(
    demo: Path, auvident: Callable[..., Called]
) -> None:
    assert auvident(*RUN, "runs/again", "--quiet").code == 0
    for path in demo.rglob("*.*"):
        if path.suffix in (".parquet", ".json") and path.name != "run.json":
            assert path.read_bytes() == (Path("runs/again") / path.relative_to(demo)).read_bytes()


@pytest.mark.usefixtures("quick_loop", "quick_report")
def test_a_changed_option_runs_its_stage_and_says_why(
    demo: Path, auvident: Callable[..., Called]
) -> None:
    said = decisions(auvident(*RUN, demo, "--filter", "ukf"))
    assert said["identify"] == "runs again because option filter changed from ekf to ukf"
    assert said["ingest"] == said["segment"] == said["ase"] == "up to date"


@pytest.mark.usefixtures("quick_loop", "quick_report")
def test_without_logs_the_last_options_hold(demo: Path, auvident: Callable[..., Called]) -> None:
    auvident("segment", demo, "--hold-out", "harbour_trial-turn-4")
    called = auvident("run", "--run", demo)
    assert decisions(called)["segment"] == "up to date"
    assert decisions(called)["identify"].startswith("runs again because segment/maneuvers.json")
    said = decisions(auvident(*RUN, demo))
    assert said["segment"].endswith("option hold_out changed from harbour_trial-turn-4 to none")


@pytest.mark.usefixtures("quick_loop", "quick_report")
def test_a_changed_vehicle_file_makes_the_estimate_stale_but_not_the_maneuvers(
    demo: Path, auvident: Callable[..., Called]
) -> None:
    vehicle = Path("vehicle.toml")
    text = Path("sample_logs/remus100.toml").read_text()
    vehicle.write_text(text)
    run = ("run", "sample_logs/harbour_trial", "--vehicle", vehicle, "--run", demo)
    said = decisions(auvident(*run))
    assert "option vehicle changed" in said["ingest"]
    assert said["ase"] == said["identify"] == "up to date"  # the same vehicle elsewhere
    vehicle.write_text(text.replace("mass_kg = 30.48", "mass_kg = 30.6"))
    assert states(demo)["ingest"] == "stale"
    said = decisions(auvident(*run))
    assert said["ingest"].endswith("vehicle.toml changed")
    assert said["segment"] == "up to date"
    assert said["ase"].endswith("ingest/vehicle.json changed")
    assert said["identify"].startswith("runs again")


@pytest.mark.usefixtures("quick_loop", "quick_report")
def test_a_damaged_artifact_is_made_again(demo: Path, auvident: Callable[..., Called]) -> None:
    whole = (demo / "identify" / "model.json").read_bytes()
    (demo / "identify" / "model.json").write_bytes(whole[:100])
    (demo / "ase" / "coefficients.json").unlink()
    assert states(demo) | {"ase": "stale", "identify": "stale"} == states(demo)
    said = decisions(auvident("run", "--run", demo))
    assert said["ase"].endswith("ase/coefficients.json is missing")
    assert said["identify"].endswith("identify/model.json was changed after it was written")
    assert (demo / "identify" / "model.json").read_bytes() == whole
    assert set(states(demo).values()) == {"done", "not needed"}


def test_another_program_version_runs_everything_again(
    demo: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("auvident.pipeline.freshness.__version__", "9.9.9")
    assert {d.reason for d in status(demo)[0]} >= {"the program changed from 0.1.0 to 9.9.9"}


def test_logs_that_are_gone_do_not_make_a_run_stale(tmp_path: Path, demo: Path) -> None:
    (tmp_path / "sample_logs").unlink()
    assert set(states(demo).values()) == {"done", "not needed"}


@pytest.mark.parametrize("name", [n for n in NAMES if n != "ingest"])
def test_a_stage_without_what_it_needs_names_the_command(
    demo: Path, auvident: Callable[..., Called], name: str
) -> None:
    called = auvident(name, "runs/nothing")
    assert called.code == 4
    assert "auvident ingest LOG... --vehicle V.toml --run runs/nothing" in called.err
    assert not Path("runs/nothing").exists()
    needed = before(name)[-1].name
    manifest = json.loads((demo / "run.json").read_text())
    shutil.rmtree(demo / needed)
    called = auvident(name, demo)
    assert called.code == 4
    if needed == "ingest":
        assert "auvident ingest sample_logs/harbour_trial --vehicle" in called.err
    else:
        assert f"auvident {needed} {demo}" in called.err
    assert json.loads((demo / "run.json").read_text()) == manifest


def test_a_failure_of_the_numbers_is_kept_and_the_artifacts_stay(
    demo: Path, auvident: Callable[..., Called], monkeypatch: pytest.MonkeyPatch
) -> None:
    def diverge(given: object) -> None:
        raise NumericsError("the filter diverged", "zigzag-1, 12.3 s", "Use another plan.")

    model = (demo / "identify" / "model.json").read_bytes()
    monkeypatch.setitem(BY_NAME, "identify", _with_function(BY_NAME["identify"], diverge))
    called = auvident("identify", demo)
    assert called.code == 5
    assert "zigzag-1, 12.3 s: the filter diverged" in called.err
    assert (demo / "identify" / "model.json").read_bytes() == model
    assert status(demo)[1].failed["identify"].problem == "the filter diverged"
    monkeypatch.undo()
    assert auvident("identify", demo, "--quiet").code == 0
    assert status(demo)[1].failed == {}


def test_why_a_stage_found_nothing_to_work_with_is_told_by_status(
    demo: Path, auvident: Callable[..., Called], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(given: object) -> None:
        raise InputError("no maneuver was found", "harbour_trial")

    for stage in ("ingest", "segment"):
        monkeypatch.setitem(BY_NAME, stage, _with_function(BY_NAME[stage], refuse))
    assert auvident("segment", demo).code == 3
    assert "no maneuver was found" in " ".join(auvident("status", demo).err.split())
    before = (demo / "run.json").read_bytes()
    log = ("sample_logs/harbour_trial", "--vehicle", "sample_logs/remus100.toml")
    assert auvident("ingest", *log, "--run", demo).code == 3
    assert (demo / "run.json").read_bytes() == before  # a log that is refused leaves all as it was
    monkeypatch.undo()
    assert auvident("segment", demo, "--quiet").code == 0
    assert status(demo)[1].failed == {}


def _with_function(stage: object, function: object) -> object:
    import dataclasses

    return dataclasses.replace(stage, function=function)  # type: ignore[type-var]


def test_maneuvers_are_a_plain_list(demo: Path) -> None:
    maneuvers = json.loads((demo / "segment" / "maneuvers.json").read_text())
    assert {"id", "trial", "kind", "t_start_s", "t_end_s", "role", "features"} <= set(maneuvers[0])
    assert {m["role"] for m in maneuvers} == {"identify", "validate"}


def test_two_trials_stand_side_by_side(tmp_path: Path, auvident: Callable[..., Called]) -> None:
    second = tmp_path / "second_trial"
    shutil.copytree(SAMPLES / "dive_trial", second)
    logs = (SAMPLES / "harbour_trial", second)
    vehicle, run = SAMPLES / "remus100.toml", tmp_path / "run"
    assert auvident("ingest", *logs, "--vehicle", vehicle, "--run", run, "--quiet").code == 0
    assert auvident("segment", run, "--hold-out", "second_trial", "--quiet").code == 0
    maneuvers = json.loads((run / "segment" / "maneuvers.json").read_text())
    assert {(m["trial"], m["role"]) for m in maneuvers} == {
        ("harbour_trial", "identify"),
        ("second_trial", "validate"),
    }
    assert auvident("ingest", logs[0], "--vehicle", vehicle, "--run", run, "--quiet").code == 0
    assert [p.name for p in (run / "ingest").glob("*.parquet")] == ["harbour_trial.parquet"]


def test_a_log_without_a_compass_runs_to_the_end(
    tmp_path: Path, auvident: Callable[..., Called]
) -> None:
    log, run = tmp_path / "trial", tmp_path / "run"
    shutil.copytree(SAMPLES / "harbour_trial", log)
    (log / "attitude.csv").unlink()
    vehicle = SAMPLES / "remus100.toml"
    assert auvident("run", log, "--vehicle", vehicle, "--run", run, "--quiet").code == 0
    effects = json.loads((run / "refine" / "along.json").read_text())["effects"]
    assert "current" in {e["id"] for e in effects}  # by the yaw rate of one trial, summed up


def test_cruising_speed_is_the_median_under_way() -> None:
    from auvident.schema.trial import Trial

    table = pd.DataFrame({"u_mps": [0.0, 0.1, float("nan"), 1.0, 1.2, 1.4]})
    assert steps.cruising_speed([Trial.from_table("a", table, 10.0)]) == 1.2
    assert steps.cruising_speed([Trial.from_table("a", table[:2], 10.0)]) is None


def test_noise_is_the_root_mean_square_over_the_trials(demo: Path) -> None:
    from auvident.pipeline.given import Given
    from auvident.storage.run_directory import RunDirectory

    noise = Given(RunDirectory(demo)).noise()
    assert 0.001 < noise["u_mps"] < 0.05
    assert "rudder_rad" not in noise


def test_a_run_directory_in_use_is_refused(demo: Path, auvident: Callable[..., Called]) -> None:
    from auvident.storage.run_directory import RunDirectory

    with RunDirectory(demo).lock():
        called = auvident("segment", demo)
    assert called.code == 6
    assert "another auvident process" in called.err
    assert auvident("status", demo).code == 0


@pytest.mark.parametrize("option", ["--json", "--fail-above=u=9"])
def test_what_a_run_says_is_what_it_left_whoever_comes_next(
    demo: Path, auvident: Callable[..., Called], monkeypatch: pytest.MonkeyPatch, option: str
) -> None:
    """Everything is read before another process can have the directory."""
    import auvident.pipeline as pipeline

    run_all = pipeline.run_all

    def run_and_lose(path: Path, *arguments: object, **options: object) -> object:
        result = run_all(path, *arguments, **options)  # type: ignore[arg-type]
        shutil.rmtree(path)
        return result

    before = auvident("run", "--run", demo, option)
    monkeypatch.setattr(pipeline, "run_all", run_and_lose)
    after = auvident("run", "--run", demo, option)
    assert after.code == 0
    assert after == before


def test_a_run_directory_that_cannot_be_written_is_named(
    demo: Path, auvident: Callable[..., Called]
) -> None:
    Path("file").write_text("")
    called = auvident(*RUN, "file/run")
    assert called.code == 3
    assert "file/run" in called.err
    assert auvident(*RUN, "file").code == 2


@pytest.mark.usefixtures("quick_loop", "quick_report")
def test_a_plan_of_the_user_is_an_input(demo: Path, auvident: Callable[..., Called]) -> None:
    import auvident as package

    plan = Path("mine.toml")
    text = (Path(package.__file__).parent / "plans" / "together.toml").read_text()
    plan.write_text(text)
    said = decisions(auvident("run", "--run", demo, "--plan", plan))
    assert said["identify"].endswith("option plan changed from refined to ../../mine.toml")
    plan.write_text(text + "# a remark\n")
    assert {d.stage: d.reason for d in status(demo)[0]}["identify"] == "mine.toml changed"
    with contextlib.chdir(demo):  # the plan is found from anywhere
        said = decisions(auvident("run", "--run", "."))
    assert said["identify"].endswith("mine.toml changed")


@pytest.fixture
def with_own_logs(tmp_path: Path, demo: Path, auvident: Callable[..., Called]) -> Path:
    """A run of a folder of logs that a test may change; ingested alone."""
    logs = tmp_path / "logs" / "harbour_trial"
    shutil.copytree(SAMPLES / "harbour_trial", logs)
    (logs / "notes.md").write_text("Calm, no current.\n")
    vehicle = ("--vehicle", SAMPLES / "remus100.toml")
    called = auvident("ingest", logs.parent, *vehicle, "--run", "runs/own", "--quiet")
    assert called.code == 0, called.err
    assert states(Path("runs/own"))["ingest"] == "done"
    return logs


def told(run: str = "runs/own") -> str:
    """Why its logs are to be read again, as `status` says."""
    return next(d.reason for d in status(Path(run))[0] if d.stage == "ingest")


def test_a_log_that_came_or_went_makes_a_run_stale(
    with_own_logs: Path, auvident: Callable[..., Called]
) -> None:
    depth = with_own_logs / "depth.csv"
    content = depth.read_bytes()
    depth.unlink()
    assert told() == "harbour_trial/depth.csv is missing"
    called = auvident("segment", "runs/own")
    assert called.code == 4
    assert "depth.csv is missing" in called.err
    depth.write_bytes(content)
    assert told() == ""
    shutil.copytree(with_own_logs, with_own_logs.with_name("second_trial"))
    assert told() == "second_trial/attitude.csv is new"
    assert auvident("segment", "runs/own").code == 4


def test_what_is_no_log_makes_no_run_stale(with_own_logs: Path, demo: Path) -> None:
    """Notes, hidden files, a table that the program wrote, a run directory."""
    (with_own_logs / "hull.txt").write_text("x_m,radius_m\n0,1\n")
    (with_own_logs / ".dvl.csv").write_text("time_s,u_mps\n0,1\n")
    pd.DataFrame({"time_s": [0.0], "u_mps_low": 1.0, "u_mps_high": 1.0, "v_mps_low": 1.0}).assign(
        v_mps_high=1.0
    ).to_csv(with_own_logs / "simulated.csv", index=False)
    shutil.copytree(demo, with_own_logs / "run")
    assert told() == ""


def test_a_run_need_not_keep_its_logs(with_own_logs: Path) -> None:
    """Whether their folder is left or not."""
    for file in with_own_logs.iterdir():
        file.unlink()
    assert told() == ""
    shutil.rmtree(with_own_logs.parent)
    assert told() == ""


def test_the_logs_of_a_run_are_not_opened_to_see_that_none_came(
    with_own_logs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("auvident.pipeline.ingesting.log_files", None)
    assert told() == ""
