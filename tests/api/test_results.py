"""A run as an object says what its files say."""

import json
import shutil
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes

import auvident
from auvident.pipeline.given import Given
from auvident.pipeline.reporting import report_data
from auvident.report.figures import svg
from auvident.report.taken import taken
from auvident.storage.run_directory import RunDirectory

FIGURES = (
    "held_out",
    "coefficients",
    "correlations",
    "history",
    "trial",
    "track",
    "residuals",
    "forces",
    "candidates",
)


@pytest.fixture(scope="module")
def run(completed: Path) -> auvident.Run:
    return auvident.load_run(completed / "runs/demo")


def artifact(run: auvident.Run, name: str) -> dict:
    return dict(json.loads((run.path / name).read_text()))


def test_coefficients_are_those_of_the_final_model(run: auvident.Run) -> None:
    final = {c["symbol"]: c for c in artifact(run, "refine/model.json")["coefficients"]}
    table = run.coefficients
    assert run.model.plane == "horizontal" and (table["plane"] == "horizontal").all()
    for column in ("value", "std", "unit", "prior", "prior_std", "prime", "data_share"):
        assert table[column].loc[list(final)].to_dict() == {s: c[column] for s, c in final.items()}
    assert table.loc["Y_uud", "status"] == "well identified"
    assert table.loc["Y_uud", "source"] == "identified"
    assert table.loc["Y_uud", "regressor"] and table.loc["Y_uud", "description"]
    assert run.coefficients is table  # read once


def test_correlations_have_a_diagonal_of_ones(run: auvident.Run) -> None:
    table = run.model.correlations
    np.testing.assert_allclose(np.diag(table), 1.0)
    told = artifact(run, "refine/model.json")["correlations"]
    for a, row in told.items():
        for b, value in row.items():
            assert table.loc[a, b] == pytest.approx(value, abs=6e-5)  # of four decimals
    image = np.asarray(run.plot.correlations()[0].images[0].get_array())
    apart = ~np.eye(len(table), dtype=bool)
    np.testing.assert_array_equal(image[apart], table.to_numpy()[apart])


def test_held_out_errors_are_those_of_the_artifacts(run: auvident.Run) -> None:
    metrics = artifact(run, "validate/metrics.json")
    table, own = run.heldout, metrics["summary"]["validate"]
    assert list(table.index) == list(own)
    for channel, told in own.items():
        row = table.loc[channel]
        assert row["unit"] == told["unit"]
        assert row["rmse_identified"] == told["rmse"]
        assert row["nrmse_identified"] == told["nrmse"]
        assert row["rmse_ase"] == metrics["ase"]["summary"]["validate"][channel]["rmse"]
        assert row["r2"] == told["r2"] == pytest.approx(1.0 - told["nrmse"] ** 2)
        assert row["coverage"] == metrics["coverage"][channel]["covered"]
    assert table["rmse_refined"].isna().all()  # nothing was lacking


def test_a_run_without_its_refined_model_warns(demo: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert auvident.load_run(demo).model.plane == "horizontal"
    shutil.rmtree(demo / "refine")
    with pytest.warns(UserWarning, match="the identified model is taken"):
        assert auvident.load_run(demo).model.plane == "horizontal"


def test_a_refined_model_stands_beside_the_identified_one(demo: Path) -> None:
    """As if something had been added: the report and the interface tell the same of it."""
    file = demo / "refine/comparison.json"
    told = json.loads(file.read_text())
    told["coefficients"][0]["after"] *= 1.01
    told["held_out"]["after"]["u"] |= {"rmse": 0.002}
    file.write_text(json.dumps(told))
    model = json.loads((demo / "refine/model.json").read_text())
    model["coefficients"][0]["value"] *= 1.01
    (demo / "refine/model.json").write_text(json.dumps(model))
    accept(demo, "refine/comparison.json", "refine/model.json")
    run = auvident.load_run(demo)
    models = run.models["horizontal"]
    assert models.refined is models.final and models.refined is not None
    symbol = model["coefficients"][0]["symbol"]
    change = models.refined.coefficients["value"] / models.identified.coefficients["value"]
    assert change[symbol] == pytest.approx(1.01) and (change.drop(symbol) == 1.0).all()
    row = run.heldout.loc["u"]
    assert row["rmse_refined"] == 0.002 < row["rmse_identified"]
    assert row["r2"] == pytest.approx(1.0 - row["nrmse_refined"] ** 2)


def accept(run: Path, *names: str) -> None:
    """Let the manifest know of files as they are now."""
    directory = RunDirectory(run)
    manifest = json.loads((run / "run.json").read_text())
    for stage in manifest["stages"].values():
        for part in ("inputs", "outputs"):
            stage[part] |= {n: directory.sha256(n) for n in names if n in stage[part]}
    (run / "run.json").write_text(json.dumps(manifest))


def test_maneuvers_and_findings_are_complete(run: auvident.Run) -> None:
    maneuvers = json.loads((run.path / "segment/maneuvers.json").read_text())
    assert list(run.maneuvers.index) == [m["id"] for m in maneuvers]
    assert run.maneuvers["role"].to_list() == [m["role"] for m in maneuvers]
    found = {
        (stage, f["code"])
        for stage, name in (
            ("ase", "ase/coefficients.json"),
            ("identify", "identify/model.json"),
            ("validate", "validate/metrics.json"),
            ("diagnose", "diagnose/diagnosis.json"),
            ("refine", "refine/comparison.json"),
        )
        for f in artifact(run, name)["findings"]
    }
    assert found and found <= set(zip(run.findings["stage"], run.findings["code"], strict=True))
    assert run.diagnosis.verdict == artifact(run, "diagnose/diagnosis.json")["verdict"]
    assert run.comparison.statement == artifact(run, "refine/comparison.json")["statement"]
    assert run.quality.vehicle == run.vehicle.body.name == "REMUS 100"


def test_signals_have_the_smoothed_states_where_they_belong(run: auvident.Run) -> None:
    states = pd.read_parquet(run.path / "identify/states.parquet")
    table = run.signals
    there = table[table["u_mps_smoothed"].notna()]
    assert len(there) == len(states)
    for column in ("time_s", "maneuver"):
        assert there[column].to_list() == pytest.approx(states[column].to_list())
    np.testing.assert_array_equal(there["r_radps_smoothed"], states["r_radps"])
    np.testing.assert_array_equal(there["r_radps_smoothed_std"], states["std_r_radps"])
    logged = pd.read_parquet(run.path / "ingest/harbour_trial.parquet")
    pd.testing.assert_frame_equal(table[list(logged.columns)], logged)
    # smoothing only takes the noise of the sensor off
    away = (there["r_radps_smoothed"] - there["r_radps"]).std()
    assert 0.0 < away < 0.2 * there["r_radps"].std()


def test_predictions_are_those_of_the_files(run: auvident.Run) -> None:
    told = pd.read_parquet(run.path / "validate/simulation.parquet")
    pd.testing.assert_frame_equal(run.prediction[list(told.columns)], told)


# --- figures ------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FIGURES)
def test_every_figure_comes_as_axes(run: auvident.Run, name: str) -> None:
    panels = getattr(run.plot, name)()
    assert len(panels) and all(isinstance(axes, Axes) for axes in panels)
    assert all(axes.figure is panels.figure for axes in panels)
    assert panels[0].has_data() or len(panels) > 1


def test_a_notebook_shows_a_figure_and_nothing_has_to_be_closed(run: auvident.Run) -> None:
    panels = run.plot.track()
    assert panels._repr_png_().startswith(b"\x89PNG")
    assert not hasattr(panels.figure, "number")  # which pyplot gives, and keeps until it is closed


def test_the_figure_is_that_of_the_report(run: auvident.Run) -> None:
    """The same lines: of the held-out maneuver all channels, of each what the report draws."""
    held = run.maneuvers.index[run.maneuvers["role"] == "validate"]
    panels = run.plot.held_out(held[-1])
    rows = run.prediction[run.prediction["maneuver"] == held[-1]]
    lines = [np.asarray(line.get_ydata(), float) for line in panels[1].get_lines()]
    drawn = [y[np.isfinite(y)] for y in lines]  # a line breaks where the readings pause
    measured = rows["u_mps_measured"].dropna().to_numpy()
    assert any(len(y) == len(measured) and np.array_equal(y, measured) for y in drawn)


def test_taking_a_figure_leaves_the_report_as_it_is(run: auvident.Run) -> None:
    panels = run.plot.track()
    with taken() as figures:
        assert svg(panels.figure, "a", "b") == "" and figures == [panels.figure]
    assert "<svg" in svg(panels.figure, "a", "b")


@pytest.mark.parametrize("name", ["held_out", "trial", "coefficients"])
def test_what_is_not_there_is_said(run: auvident.Run, name: str) -> None:
    with pytest.raises(auvident.UsageError, match="Known: "):
        getattr(run.plot, name)("nothing")


# --- report, state of the run -------------------------------------------------------------


def test_the_report_is_written_where_it_is_not_up_to_date(demo: Path) -> None:
    run = auvident.load_run(demo)
    before = run.report().stat().st_mtime_ns
    assert run.report().stat().st_mtime_ns == before
    assert run.status.loc["report", "state"] == "done"
    data = report_data(Given(RunDirectory(demo), planes=run.planes), plans=False)
    assert data.plan is None and data.model == run.model.artifact


@pytest.mark.parametrize(
    ("lost", "asked"),
    [
        ("identify", "model"),
        ("validate", "heldout"),
        ("diagnose", "diagnosis"),
        ("refine", "comparison"),
    ],
)
def test_a_result_that_is_missing_names_the_command(lost: str, asked: str, demo: Path) -> None:
    shutil.rmtree(demo / lost)
    if lost == "identify":
        with pytest.raises(auvident.StageError, match="auvident identify"):
            _ = auvident.load_run(demo).model
        return
    run = auvident.load_run(demo)
    assert len(run.coefficients)
    with pytest.raises(auvident.StageError, match=f"auvident {lost}"):
        getattr(run, asked)
