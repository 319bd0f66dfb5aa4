"""`auvident ingest` on folders that hold what is no log, or one log twice."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.command_line import SAMPLES, Called

VEHICLE = ("--vehicle", SAMPLES / "remus100.toml")


@pytest.fixture
def logs(tmp_path: Path) -> Path:
    """A folder with the log of one trial."""
    shutil.copytree(SAMPLES / "harbour_trial", tmp_path / "logs" / "harbour_trial")
    return tmp_path / "logs"


def quality(run: Path) -> dict:
    found: dict = json.loads((run / "ingest" / "quality.json").read_text())
    return found


def test_a_run_directory_inside_the_log_folder_is_no_log_of_the_next_run(
    logs: Path, auvident: Callable[..., Called]
) -> None:
    run = logs / "run1"
    first = auvident("ingest", logs, *VEHICLE, "--run", run)
    assert first.code == 0, first.err
    content = (run / "ingest" / "quality.json").read_bytes()
    again = auvident("ingest", logs, *VEHICLE, "--run", run)
    assert again.code == 0, again.err
    assert [p.name for p in (run / "ingest").glob("*.parquet")] == ["harbour_trial.parquet"]
    assert [t["trial"] for t in quality(run)["trials"]] == ["harbour_trial"]
    other = logs.parent / "run2"
    assert auvident("ingest", logs, *VEHICLE, "--run", other).code == 0
    (finding,) = quality(other)["findings"]
    assert finding["code"] == "own_outputs_left_out"
    assert finding["value"] == 1
    assert finding["where"] == f"{logs.name}/{run.name}"  # however the path was typed
    assert b"own_outputs" not in content  # the first run had nothing to leave out


def wide(log: Path) -> pd.DataFrame:
    """The sensors on the clock of the gyro, the latest value of each held."""
    tables = {
        sensor: pd.read_csv(log / f"{sensor}.csv").sort_values("time_s")
        for sensor in ("gyro", "dvl", "rudder", "rpm")
    }
    table = tables.pop("gyro")
    for other in tables.values():
        table = pd.merge_asof(table, other, on="time_s")
    return table


def shifted(log: Path, seconds: float) -> None:
    for path in log.glob("*.csv"):
        table = pd.read_csv(path)
        table["time_s"] = (table["time_s"] + seconds).round(4)
        table.to_csv(path, index=False)


def cut(log: Path, share: float) -> None:
    for path in log.glob("*.csv"):
        table = pd.read_csv(path)
        start = table["time_s"].iloc[0]
        table[table["time_s"] < start + share * np.ptp(table["time_s"])].to_csv(path, index=False)


def again(logs: Path, form: str) -> Path:
    """The log of the trial once more, in another form."""
    first, second = logs / "harbour_trial", logs / "again"
    if form == "wide":
        wide(first).to_csv(logs / "again.csv", index=False)
        return logs / "again.csv"
    if form == "wide Parquet":
        wide(first).to_parquet(logs / "again.parquet")
        return logs / "again.parquet"
    shutil.copytree(first, second)
    if form == "shifted":
        shifted(second, 3600.0)
    elif form == "a part":
        cut(second, 0.4)
    return second


FORMS = ("copy", "shifted", "a part", "wide", "wide Parquet")


@pytest.mark.parametrize("form", FORMS)
def test_a_trial_given_twice_is_refused(
    logs: Path, auvident: Callable[..., Called], form: str
) -> None:
    second = again(logs, form)
    run = logs.parent / "run"
    called = auvident("ingest", logs / "harbour_trial", second, *VEHICLE, "--run", run)
    assert called.code == 3
    assert "Traceback" not in called.err
    said = " ".join(called.err.split())
    for word in ("trial again", "trial harbour_trial", str(second), "Leave one of them out"):
        assert word in said
    assert not run.exists()


def test_keep_going_sets_the_second_aside(logs: Path, auvident: Callable[..., Called]) -> None:
    second, run = again(logs, "copy"), logs.parent / "run"
    arguments = (logs / "harbour_trial", second, *VEHICLE, "--run", run, "--keep-going")
    called = auvident("ingest", *arguments)
    assert called.code == 3
    assert [p.name for p in (run / "ingest").glob("*.parquet")] == ["harbour_trial.parquet"]
    (finding,) = quality(run)["findings"]
    assert finding["code"] == "log_refused"
    assert "again" in finding["message"]
    assert "harbour_trial" in finding["message"]


def test_keep_going_does_not_write_one_trial_over_another_of_its_name(
    logs: Path, auvident: Callable[..., Called]
) -> None:
    other = logs / "more" / "harbour_trial"
    shutil.copytree(SAMPLES / "sound_trial", other)
    arguments = (logs / "harbour_trial", other, *VEHICLE, "--run", logs.parent / "run")
    called = auvident("ingest", *arguments, "--keep-going")
    assert called.code == 3
    assert "two trials are named 'harbour_trial'" in called.err
    (trial,) = quality(logs.parent / "run")["trials"]
    assert trial["sensors"][0]["file"].startswith(f"{logs.name}/harbour_trial/")


@pytest.mark.parametrize(
    ("names", "vehicle"), [(("harbour", "dive"), "remus100"), (("bay", "sound"), "tern180")]
)
def test_trials_of_one_vehicle_are_different_ones(
    tmp_path: Path, auvident: Callable[..., Called], names: tuple[str, ...], vehicle: str
) -> None:
    trials = [SAMPLES / f"{name}_trial" for name in names]
    file = SAMPLES / f"{vehicle}.toml"
    called = auvident("ingest", *trials, "--vehicle", file, "--run", tmp_path / "run")
    assert called.code == 0, called.err
