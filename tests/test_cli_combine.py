"""`combine` and what `simulate` does with its result, on runs of the samples."""

import json
import shutil
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import pandas as pd
import pytest

from auvident.schema.combined import CombinedModel
from tests.command_line import SAMPLES, Called, call

VEHICLE = SAMPLES / "remus100.toml"


def made(folder: Path, trial: str, plane: str) -> Path:
    """A run up to its model, if it is not there."""
    run = folder / trial.removesuffix("_trial")
    if (run / "identify" / "model.json").exists():
        return run
    steps = (
        ("ingest", SAMPLES / trial, "--vehicle", VEHICLE, "--run", run),
        ("segment", run),
        ("ase", run),
        ("identify", run, "--plane", plane),
    )
    for step in steps:
        called = call(*step)
        assert called.code == 0, called.err
    return run


@pytest.fixture(scope="module")
def runs(common_folder: Callable[[str], AbstractContextManager[Path]]) -> dict[str, Path]:
    trials = {"horizontal": "harbour_trial", "vertical": "dive_trial"}
    with common_folder("to-combine") as folder:
        return {plane: made(folder, trial, plane) for plane, trial in trials.items()}


@pytest.fixture(scope="module")
def model_file(runs: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("combined") / "whole.json"
    called = call("combine", *runs.values(), "--output", file)
    assert called.code == 0, called.err
    assert "identified, both" in called.err
    return file


def test_the_file_is_a_combined_model_with_its_sources(
    runs: dict[str, Path], model_file: Path
) -> None:
    model = CombinedModel.model_validate_json(model_file.read_text())
    assert model.schema_ == "auvident/combined/1"
    assert [source.file for source in model.models] == [
        str(run / "identify/model.json") for run in runs.values()
    ]
    origins = {e.origin for e in model.entries}
    assert origins == {
        "identified, both",
        "identified, horizontal",
        "identified, vertical",
        "identified, roll",
        "geometry",
        "vehicle file",
    }


def test_the_model_is_flown_from_the_inputs_of_a_log(
    auvident: Callable[..., Called], model_file: Path, tmp_path: Path
) -> None:
    window = ("--from", 800, "--to", 830)
    log = SAMPLES / "dive_trial"
    file = tmp_path / "flight.parquet"
    called = auvident("simulate", model_file, "--inputs", log, *window, "--output", file)
    assert called.code == 0, called.err
    table = pd.read_parquet(file)
    assert {"w_mps", "p_radps", "q_radps", "roll_rad", "pitch_rad", "depth_m"} <= set(table)
    assert (table.pitch_rad_low <= table.pitch_rad_high).all()
    again = auvident("simulate", model_file, "--inputs", log, *window, "--json")
    found = json.loads(again.out)
    assert found["columns"]["q_radps"] == pytest.approx(table.q_radps.tolist())
    assert found["extrapolation"] == {}
    begun = ("--inputs", log, "--speed", "0.2", *window, "--json")
    slow = json.loads(auvident("simulate", model_file, *begun).out)
    known = json.loads(model_file.read_text())["flown"]
    lowest = min(flown["u_low"] for flown in known.values())
    assert slow["extrapolation"]["u_low"]["identified"] == pytest.approx(lowest)
    assert set(known) == {"horizontal", "vertical"}


def test_a_model_elsewhere_takes_the_signs_of_its_runs(
    auvident: Callable[..., Called], model_file: Path, tmp_path: Path
) -> None:
    arguments = ("--inputs", SAMPLES / "dive_trial", "--from", 800, "--to", 805, "--json")
    assert "assumed" not in auvident("simulate", model_file, *arguments).err
    tree = json.loads(model_file.read_text())
    for source in tree["models"]:
        source["file"] = ""
    (tmp_path / "alone.json").write_text(json.dumps(tree))
    called = auvident("simulate", tmp_path / "alone.json", *arguments)
    assert called.code == 0, called.err
    assert "assumed" in called.err


def test_the_signs_are_not_those_of_another_vehicle_at_the_same_path(
    auvident: Callable[..., Called], model_file: Path, tmp_path: Path
) -> None:
    """A run of that name may be of another vehicle by now, whose rudder turns the other way."""
    arguments = ("--inputs", SAMPLES / "dive_trial", "--from", 800, "--to", 805, "--json")
    tree = json.loads(model_file.read_text())
    runs = [Path(source["file"]).parents[1] for source in tree["models"]]
    for k, (run, source) in enumerate(zip(runs, tree["models"], strict=True)):
        other = tmp_path / f"run{k}"
        (other / "ingest").mkdir(parents=True)
        (other / "run.json").write_bytes((run / "run.json").read_bytes())
        vehicle = json.loads((run / "ingest/vehicle.json").read_text())
        vehicle["vehicle"]["name"] = "another"
        (other / "ingest/vehicle.json").write_text(json.dumps(vehicle))
        source["file"] = str(other / "identify/model.json")
    (tmp_path / "moved.json").write_text(json.dumps(tree))
    assert "assumed" in auvident("simulate", tmp_path / "moved.json", *arguments).err


def test_what_no_flight_begins_with_is_refused(
    auvident: Callable[..., Called], model_file: Path
) -> None:
    arguments = ("simulate", model_file, "--inputs", SAMPLES / "dive_trial")
    assert auvident(*arguments, "--speed", "-1").code == 2
    assert auvident(*arguments, "--speed", "nan").code == 2
    assert auvident(*arguments, "--samples", "-1").code == 2
    called = auvident(*arguments, "--plane", "vertical")
    assert called.code == 2 and "as a whole" in called.err


def test_a_vehicle_file_is_flown_from_its_geometry(auvident: Callable[..., Called]) -> None:
    arguments = ("--inputs", SAMPLES / "dive_trial", "--from", 800, "--to", 805, "--json")
    called = auvident("simulate", VEHICLE, *arguments)
    assert called.code == 0, called.err
    columns = json.loads(called.out)["columns"]
    wide = columns["pitch_rad_high"][-1] - columns["pitch_rad_low"][-1]
    assert wide > 0.0
    assert "95 % of the sampled models, not of the readings" in called.err
    assert json.loads(called.out)["band"]["of_readings"] == []


def test_one_run_takes_the_other_plane_from_geometry(
    auvident: Callable[..., Called], runs: dict[str, Path]
) -> None:
    called = auvident("combine", runs["vertical"], "--json")
    assert called.code == 0, called.err
    model = CombinedModel.model_validate_json(called.out)
    origin = {e.symbol: e.origin for e in model.entries}
    assert (origin["Y_uv"], origin["Z_uw"]) == ("geometry", "identified, vertical")
    assert "horizontal plane" in called.err


def test_a_vehicle_file_is_not_combined(auvident: Callable[..., Called]) -> None:
    called = auvident("combine", VEHICLE)
    assert called.code == 3
    assert "is a vehicle file, not a run or a model" in called.err and "--vehicle" in called.err


def test_a_run_of_both_planes_serves_alone(
    auvident: Callable[..., Called], runs: dict[str, Path], tmp_path: Path
) -> None:
    both = tmp_path / "both"
    shutil.copytree(runs["horizontal"], both)
    (both / "identify/vertical").mkdir()
    shutil.copy(runs["vertical"] / "identify/model.json", both / "identify/vertical/model.json")
    model = CombinedModel.model_validate_json(auvident("combine", both, "--json").out)
    assert [source.plane for source in model.models] == ["horizontal", "vertical"]


def test_two_runs_of_one_plane_are_wrong_usage(
    auvident: Callable[..., Called], runs: dict[str, Path]
) -> None:
    called = auvident("combine", runs["horizontal"], runs["horizontal"])
    assert called.code == 2
    told = " ".join(called.err.split())
    assert "two models of the horizontal plane" in told
    assert "one of the vertical plane" in told
    assert "RUN/refine/vertical/model.json is the vertical one alone" in told


def test_runs_of_different_vehicles_are_refused(
    auvident: Callable[..., Called], runs: dict[str, Path], tmp_path: Path
) -> None:
    other = tmp_path / "other"
    shutil.copytree(runs["vertical"], other)
    vehicle = json.loads((other / "ingest/vehicle.json").read_text())
    vehicle["hull"]["length_m"] *= 1.2
    (other / "ingest/vehicle.json").write_text(json.dumps(vehicle))
    called = auvident("combine", runs["horizontal"], other)
    assert called.code == 3
    assert "different vehicles" in called.err
    assert "[hull]" in called.err


def test_a_model_file_alone_needs_a_vehicle_file(
    auvident: Callable[..., Called], runs: dict[str, Path], tmp_path: Path
) -> None:
    shutil.copy(runs["horizontal"] / "identify/model.json", tmp_path / "m.json")
    called = auvident("combine", tmp_path / "m.json", "--json")
    assert called.code == 3
    assert "--vehicle" in called.err
    given = auvident("combine", tmp_path / "m.json", "--vehicle", VEHICLE, "--json")
    assert given.code == 0, given.err


def test_a_run_without_a_model_is_a_missing_stage(
    auvident: Callable[..., Called], tmp_path: Path
) -> None:
    assert auvident("combine", tmp_path / "nothing").code in (3, 4)
