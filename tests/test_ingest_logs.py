"""`auvident ingest` on folders that hold what is no log, or one log twice."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

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
    assert str(run) in finding["where"]
    assert b"own_outputs" not in content  # the first run had nothing to leave out
