"""The standard maneuvers: which are flown, how far, and what becomes of those that cannot be."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from auvident.pipeline.given import Given
from auvident.schema.desk import StandardManeuvers
from auvident.schema.planes import Plane
from auvident.stages.desk import standard_maneuvers
from auvident.stages.desk.standard import greatest_laid_deg, orders_of
from auvident.storage.artifacts import read_model
from auvident.storage.run_directory import RunDirectory


def laid(degrees: float, role: str = "identify") -> pd.DataFrame:
    return pd.DataFrame({"role": [role] * 200, "control_rad": np.radians(degrees)})


@pytest.mark.parametrize(
    ("plane", "degrees", "is_ship", "flown"),
    [
        ("horizontal", 20.0, False, ["turning-circle:20", "zigzag:10/10", "zigzag:20/20"]),
        ("horizontal", 19.4, False, ["turning-circle:19", "zigzag:10/10", "zigzag:20/20"]),
        ("horizontal", 15.0, False, ["turning-circle:15", "zigzag:10/10"]),
        ("horizontal", 5.0, False, ["turning-circle:5", "zigzag:10/10"]),
        ("horizontal", 60.0, False, ["turning-circle:35", "zigzag:10/10", "zigzag:20/20"]),
        ("horizontal", 10.0, True, ["turning-circle:35", "zigzag:10/10", "zigzag:20/20"]),
        ("horizontal", 0.0, False, ["zigzag:10/10"]),
        ("vertical", 12.0, False, ["vertical-zigzag:10/5"]),
    ],
)
def test_maneuvers_are_flown_at_angles_that_were_laid(
    plane: Plane, degrees: float, is_ship: bool, flown: list[str]
) -> None:
    assert [order.text for order in orders_of(plane, degrees, is_ship)] == flown


def test_the_angle_laid_is_that_of_the_identifying_maneuvers() -> None:
    both = pd.concat([laid(-12.0), laid(30.0, "validate")])
    assert greatest_laid_deg(both) == pytest.approx(12.0)
    assert greatest_laid_deg(laid(30.0, "validate")) == 0.0


def test_a_run_has_them_of_its_model(completed: Path) -> None:
    run = RunDirectory(completed / "runs/demo")
    given = Given(run, run.manifest())
    kept = read_model(run / "validate/standard.json", StandardManeuvers, "")
    names = [m.maneuver for m in kept.maneuvers]
    assert names == ["turning-circle", "zigzag", "zigzag"] and not kept.findings
    laid_deg = greatest_laid_deg(given.table("validate/simulation.parquet"))
    again = standard_maneuvers(given.model, given.ase.speed_mps, laid_deg)
    assert again == kept
    for result in kept.maneuvers:
        for figure in result.figures:
            assert figure.low is not None and figure.high is not None
            assert figure.low <= figure.high


def test_a_maneuver_that_cannot_be_flown_is_said(completed: Path) -> None:
    """A model whose rudder does nothing has none to steer with."""
    run = RunDirectory(completed / "runs/demo")
    model = Given(run, run.manifest()).model
    dead = tuple(
        c.model_copy(update={"value": 0.0}) if c.symbol.endswith("_uud") else c
        for c in model.coefficients
    )
    found = standard_maneuvers(model.model_copy(update={"coefficients": dead}), 1.5, 10.0)
    assert found.maneuvers == ()
    assert {f.code for f in found.findings} == {"standard-not-flown"}
    assert [f.where for f in found.findings] == ["turning-circle:10", "zigzag:10/10"]
