"""`simulate --inputs` with logs that have gaps, steps that are long, runs that are only read."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from auvident.cli import results
from tests.command_line import Called


def inputs(name: str, **columns: object) -> Path:
    """A minute of a zigzag of the rudder, in a file of this name."""
    time = np.arange(600) * 0.1
    table = pd.DataFrame({"time_s": time, "rudder_deg": 10.0 * np.sign(np.sin(time / 3.0))})
    file = Path(name)
    table.assign(rpm=900.0, **columns).to_csv(file, index=False)
    return file


def test_stretches_of_a_log_with_a_gap_are_told(
    demo: Path, auvident: Callable[..., Called]
) -> None:
    command = ("simulate", demo, "--samples", "0", "--output", "out.csv", "--inputs")
    assert "stretches" not in auvident(*command, inputs("whole.csv")).err
    rudder = pd.read_csv("whole.csv")["rudder_deg"].mask(np.arange(600) // 100 == 2)
    called = auvident(*command, inputs("gap.csv", rudder_deg=rudder))
    told = " ".join(called.err.split())
    assert called.code == 0 and "predicted in 2 stretches, which begin anew at 0.0, 30" in told
    assert pd.read_csv("out.csv")["stretch"].nunique() == 2


def test_long_steps_are_named_where_a_simulation_diverges(
    demo: Path, auvident: Callable[..., Called]
) -> None:
    called = auvident(
        "simulate", demo, "--samples", "0", "--inputs", inputs("i.csv"), "--rate", 0.2
    )
    told = " ".join(called.err.split())
    assert called.code == 5 and "steps of 5 s are too long for the vehicle" in told
    assert "--rate" in told


def test_a_run_that_is_only_read_is_told_with_output(
    demo: Path, auvident: Callable[..., Called], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(table: pd.DataFrame, file: Path) -> None:
        raise OSError(30, "Read-only file system", str(file))

    monkeypatch.setattr(results, "write_table", refused)
    called = auvident("simulate", demo, "--samples", "0", "--inputs", inputs("i.csv"))
    assert called.code == 3 and "--output FILE" in called.err
    assert "Read-only file system" in called.err


def test_a_column_in_degrees_is_not_said_to_look_like_radians(
    demo: Path, auvident: Callable[..., Called]
) -> None:
    called = auvident("simulate", demo, "--inputs", inputs("i.csv", rudder_deg=200.0))
    told = " ".join(called.err.split())
    assert called.code == 3 and "looks like another unit or another quantity" in told
    assert "_rad column" not in told
