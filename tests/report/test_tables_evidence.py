"""What a coefficient rests on: its parts after GUM, the way to its value, the three beside it."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from auvident.pipeline.given import Given
from auvident.report.numbers import PAGE
from auvident.report.tables import written
from auvident.report.tables_evidence import (
    FITTED,
    Way,
    convergence,
    convergence_words,
    evidence,
    rounds,
    uncertainty,
    uncertainty_parts,
    ways,
)
from auvident.schema.artifacts import IdentifiedModel
from auvident.storage.run_directory import RunDirectory


@pytest.fixture(scope="module")
def given(completed: Path) -> Given:
    run = RunDirectory(completed / "runs/demo")
    return Given(run, run.manifest())


@pytest.fixture(scope="module")
def model(given: Given) -> IdentifiedModel:
    return given.model


def test_type_b_is_what_the_prior_gives_the_estimate(model: IdentifiedModel) -> None:
    """Of a linear fit: P = (S + D)^-1, and P D P + P S P = P."""
    rng = np.random.default_rng(4)
    a = rng.standard_normal((6, 3))
    information, scale = a.T @ a, np.array([0.5, 2.0, 1.0])
    prior = np.diag(1.0 / scale**2)
    posterior = np.linalg.inv(information + prior)
    symbols = [c.symbol for c in model.coefficients[:3]]
    own = {
        "symbols": symbols,
        "matrix": (posterior + np.diag([1.0, 2.0, 3.0])).tolist(),  # widened
        "fitted_variance": np.diag(posterior).tolist(),
        "scale": scale.tolist(),
    }
    rows = tuple(c.model_copy(update={"std_jackknife": 0.3}) for c in model.coefficients[:3])
    found = uncertainty_parts(model.model_copy(update={"covariance": own, "coefficients": rows}))
    expected = np.sqrt(np.diag(posterior @ prior @ posterior))
    assert [found[s].prior for s in symbols] == pytest.approx(expected)
    assert found[symbols[0]].combined == pytest.approx(np.hypot(0.3, expected[0]))


def test_only_what_is_known_is_told(model: IdentifiedModel) -> None:
    """No scatter between maneuvers, or no covariance of the fit: no row."""
    alone = tuple(c.model_copy(update={"std_jackknife": None}) for c in model.coefficients)
    without = model.model_copy(update={"coefficients": alone, "constants": ()})
    assert uncertainty(without).rows == []
    assert uncertainty(model.model_copy(update={"covariance": {}})).rows == []
    row = written(uncertainty(model), PAGE).rows[1]
    assert row[0] == "X_uu" and row[-1].endswith(" %")


def test_expanded_is_twice_the_combined(model: IdentifiedModel) -> None:
    parts = uncertainty_parts(model)
    table = written(uncertainty(model), PAGE)
    at = table.heads.index("expanded, k = 2")
    for row in table.rows:
        assert row[at] == PAGE.number(2.0 * parts[row[0]].combined, 2)


def test_a_way_ends_at_the_value_of_the_model(given: Given, model: IdentifiedModel) -> None:
    found = ways(model, given.table("identify/history.parquet"))
    heads = rounds(model)
    assert heads[0] == "EKF, cycle 1" and heads[-1] == FITTED
    assert {w.symbol for w in found} >= {"X_uu", "Y_uv", "N_ur"}
    for way in found:
        assert len(way.values) == len(heads) and way.values[-1] == way.final.value
    rows = written(convergence(found, heads), PAGE).rows
    assert rows[0][-1] in ("settled", "nearly settled", "moved in the last round")


def test_a_way_takes_the_end_of_every_cycle(model: IdentifiedModel) -> None:
    """Of two passes of a cycle the last, and what a cycle leaves alone stays."""
    record = model.stages[0].model_copy(update={"fitted_noise": {}})
    stages = tuple(record.model_copy(update={"cycle": c}) for c in (1, 1, 2))
    rows = [
        (0, 0.0, "X_uu", -5.0),
        (0, 0.0, "T_nn", 0.3),
        (1, 0.0, "X_uu", -6.0),
        (1, 1.0, "X_uu", -7.0),
        (2, 0.0, "X_uu", -8.0),
    ]
    history = pd.DataFrame(rows, columns=["order", "time_s", "symbol", "value"])
    found = {w.symbol: w.values for w in ways(model.model_copy(update={"stages": stages}), history)}
    assert found == {"X_uu": (-7.0, -8.0), "T_nn": (0.3, 0.3)}


def test_what_still_moves_is_named(model: IdentifiedModel) -> None:
    c = model.coefficients[1].model_copy(update={"std": 2.0})
    still = Way("X_uu", (1.0, 3.5), c)
    quiet = Way("T_nn", (1.0, 1.5), c)
    assert still.moved == 1.25
    words = convergence_words([quiet, still])
    assert words == "1 of 2 coefficients have settled; moved in the last round: X_uu."
    assert convergence_words([quiet]).startswith("Every coefficient has settled")
    assert convergence_words([]) == ""


def test_the_three_stand_beside_each_other(model: IdentifiedModel) -> None:
    assert model.prior_against_data
    alone = {row.symbol: row for row in model.prior_against_data.coefficients}
    table = written(evidence(model, model), PAGE)
    assert table.heads[3:7] == ("final", "before refine", "prior", "data alone")
    for row, c in zip(table.rows, model.estimates, strict=True):
        assert row[3].removesuffix(" !") == row[4] == PAGE.with_std(c.value, c.std)
        known = alone.get(c.symbol)
        assert row[6] == (PAGE.with_std(known.data, known.data_std) if known else "says nothing")
    assert "before refine" not in written(evidence(model), PAGE).heads
