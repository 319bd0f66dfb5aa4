"""A log whose speed is in knots: said first, corrected by ``--fix``, and recorded."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

from tests.command_line import SAMPLES, Called

VEHICLE = ("--vehicle", SAMPLES / "remus100.toml")
KNOTS = 1.0 / 0.514444


@pytest.fixture
def knots(tmp_path: Path) -> Path:
    """The harbour trial without positions, its speeds in knots under the names of m/s."""
    log = tmp_path / "harbour_trial"
    shutil.copytree(SAMPLES / "harbour_trial", log)
    (log / "position.csv").unlink()
    dvl = pd.read_csv(log / "dvl.csv", on_bad_lines="skip")
    for column in ("u_mps", "v_mps", "w_mps"):
        dvl[column] *= KNOTS
    dvl.to_csv(log / "dvl.csv", index=False)
    return log


def test_the_contradiction_comes_first_and_its_fix_is_recorded(
    knots: Path, auvident: Callable[..., Called]
) -> None:
    run = knots.parent / "run"
    called = auvident("ingest", knots, *VEHICLE, "--run", run)
    assert called.code == 0, called.err
    said = " ".join(called.err.split())
    assert said.startswith("ingest: started Scale of the speed contradicted: u is 1.9")
    assert "knots logged as m/s?" in said
    assert "Fix: --fix speed_scale." in said

    fixed = auvident("ingest", knots, *VEHICLE, "--run", run, "--fix", "speed_scale")
    assert fixed.code == 0, fixed.err
    assert "contradicted" not in fixed.err
    (trial,) = json.loads((run / "ingest" / "quality.json").read_text())["trials"]
    assert set(trial["fixed"]) == {"speed_scale"}
    manifest = json.loads((run / "run.json").read_text())
    assert manifest["stages"]["ingest"]["options"]["fix"] == ["speed_scale"]


def test_a_fix_that_no_check_proposes_is_wrong_usage(
    knots: Path, auvident: Callable[..., Called]
) -> None:
    run = knots.parent / "run"
    called = auvident("ingest", knots, *VEHICLE, "--run", run, "--fix", "rudder_scale")
    assert called.code == 2
    assert "rudder_scale" in called.err
    assert not (run / "ingest").exists()
