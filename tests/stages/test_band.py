"""Coverage and cross-validation by hand, and on a sample."""

import numpy as np
import pytest

from auvident.engines.carried import claimed_covariance, frame_of, free_behind, vector_behind
from auvident.engines.falling import growth_of_push
from auvident.engines.jackknife import (
    information_by_maneuver,
    scatter_of,
    structural_covariance,
)
from auvident.schema.artifacts import LeftOutError, LeftOutManeuver, LeftOutSummary
from auvident.stages.identify import stage
from auvident.stages.identify.left_out import course_findings, left_out_of
from auvident.stages.validate.band import coverage_of, cross_validation_of
from tests.engines.chain import identified, plan_named, sample, setup_of, validated

COLUMNS = {"u": "u_mps", "v": "v_mps", "r": "r_radps", "heading": "heading_rad"}


def test_coverage_by_hand() -> None:
    measured = np.array([0.0, 1.0, np.nan, 3.0])
    pairs = [("u", "m/s", measured, np.array([0.5, 1.0, 9.0, 5.0]))]
    lost = [("u", "m/s", measured[:2], np.full(2, np.nan))]
    half = {"u": np.array([1.0, 1.0, 1.0, 3.0])}
    found = coverage_of([(pairs, half), (lost, {"u": np.full(2, np.nan)})])["u"]
    assert found.covered == pytest.approx(3 / 5)  # of what ran away nothing is within
    assert found.width == pytest.approx(2.0 * (1.0 + 1.0 + 3.0) / 3)
    assert (found.nominal, found.unit, found.samples) == (0.95, "m/s", 5)
    assert coverage_of([(pairs, {})]) == {}


def test_a_track_is_covered_within_a_circle() -> None:
    measured, simulated = np.zeros((2, 2)), np.array([[3.0, 4.0], [3.0, 5.0]])
    pairs = [("track", "m", measured, simulated)]
    assert coverage_of([(pairs, {"track": np.full(2, 5.0)})])["track"].covered == 0.5


def test_cross_validation_by_hand() -> None:
    rows = [("a", 1.0, 100), ("b", 2.0, 100), ("c", 3.0, 200)]
    maneuvers = [
        LeftOutManeuver(id=i, channels={"u": LeftOutError(rmse=x, samples=n)}) for i, x, n in rows
    ]
    away = LeftOutManeuver(id="d", channels={})
    told = LeftOutSummary(maneuvers=(*maneuvers, away), spread={"u": 4.0}, model_error={})
    model = identified("harbour_trial").model.model_copy(update={"left_out": told})
    found = cross_validation_of(model)["u"]
    mean = (1.0 + 4.0 + 2 * 9.0) / 4
    assert found.rmse == pytest.approx(mean**0.5)
    assert found.nrmse == pytest.approx(mean**0.5 / 4.0)
    away_from_it = np.array([1.0 - mean, 4.0 - mean, 2 * (9.0 - mean)]) / 4
    assert found.se == pytest.approx(np.sqrt(1.5 * np.sum(away_from_it**2)) / (2 * mean**0.5))
    assert cross_validation_of(model.model_copy(update={"left_out": None})) == {}


def test_a_maneuver_that_runs_away_when_left_out_is_named() -> None:
    setup = setup_of("harbour_trial")
    found, told = left_out_of(setup, dict.fromkeys(setup.records), None)
    assert found is not None
    assert not found.model_error
    assert all(not m.channels for m in found.maneuvers)
    assert [f.code for f in told] == ["left-out-ran-away"]
    few = dict.fromkeys(list(setup.records)[:2])
    assert left_out_of(setup, few, None) == (None, [])


def test_a_hull_that_hardly_keeps_its_course_is_told() -> None:
    model = identified("harbour_trial").model
    structure, p = frame_of(model, 0.1).structure, vector_behind(model)
    assert course_findings(structure, p, model.length_m) == []
    assert "hardly-keeps-course" not in [finding.code for finding in model.findings]
    for munk, says in ((4.0, "dies away by only"), (10.0, "grows by")):
        q = p.copy()
        q[structure.index("N_uv")] *= munk
        (told,) = course_findings(structure, q, model.length_m)
        assert (told.code, told.where) == ("hardly-keeps-course", "course")
        assert told.value == growth_of_push(structure, q, model.length_m)
        assert says in told.message and "righting" not in told.message


def test_a_dive_is_told_of_its_pitch() -> None:
    model = identified("dive_trial", "vertical").model
    structure, p = frame_of(model, 0.1).structure, vector_behind(model)
    assert course_findings(structure, p, model.length_m) == []
    p[structure.index("M_uw")] *= 10.0
    (told,) = course_findings(structure, p, model.length_m)
    assert told.where == "pitch" and "righting moment aside" in told.message


def test_coverage_is_that_of_the_table() -> None:
    validation = validated("harbour_trial")
    held = validation.simulation[validation.simulation["role"] == "validate"]
    for name, column in COLUMNS.items():
        told = validation.metrics.coverage[name]
        ends = held[[f"{column}_measured", f"{column}_lo", f"{column}_hi"]].dropna().to_numpy()
        inside = (ends[:, 0] >= ends[:, 1]) & (ends[:, 0] <= ends[:, 2])
        assert told.covered == pytest.approx(inside.mean(), abs=1e-3)
        assert told.width == pytest.approx((ends[:, 2] - ends[:, 1]).mean(), rel=1e-9)
        assert told.covered > 0.85


@pytest.mark.parametrize("name", ["harbour_trial", "bay_trial"])
def test_a_maneuver_left_out_is_predicted_worse_than_one_that_identified(name) -> None:
    chain = sample(name)
    model = chain.identify(plan=plan_named("refined")).model  # it ends at the least error
    metrics = chain.validate(model).metrics
    for channel, errors in metrics.summary["identify"].items():
        # the fit weighs the channels, and sees no track: one may gain a little
        assert 0.98 < metrics.cross_validation[channel].rmse / errors.rmse < 3.0
    pairs = [(metrics.cross_validation[c].rmse, metrics.summary["identify"][c].rmse) for c in "uvr"]
    assert np.prod([left_out / fitted for left_out, fitted in pairs]) > 1.0


def test_the_errors_of_a_maneuver_left_out_are_those_of_an_identification_without_it() -> None:
    chain, left_out = sample("harbour_trial"), identified("harbour_trial").model.left_out
    turn = "harbour_trial-turn-1"
    rows = tuple(
        m.model_copy(update={"role": "validate"}) if m.id == turn else m
        for m in chain.maneuvers.maneuvers
    )
    without = chain.identify(maneuvers=chain.maneuvers.model_copy(update={"maneuvers": rows}))
    errors = {m.id: m.channels for m in chain.validate(without.model).metrics.maneuvers}[turn]
    assert left_out is not None
    told = {m.id: m.channels for m in left_out.maneuvers}[turn]
    for channel in ("u", "v", "r", "heading"):  # one step is not the end: some percent
        assert told[channel].rmse == pytest.approx(errors[channel].rmse, rel=0.05)


def test_the_scatter_between_maneuvers_stands_beside_the_covariance(monkeypatch) -> None:
    """That of the moves themselves: where the prior pulls, they scatter more than the maneuvers."""
    parts = []

    def by_maneuver(*args):
        parts.append(information_by_maneuver(*args))
        return parts[-1]

    monkeypatch.setattr(stage, "information_by_maneuver", by_maneuver)
    model = sample("harbour_trial").identify().model
    symbols, scale = model.covariance["symbols"], np.array(model.covariance["scale"])
    # a limit is a secant: the step without a maneuver means nothing along it
    unit = np.where([s == "rudder_rate_limit.rate_degps" for s in symbols], 0.0, scale)
    assert (unit == 0.0).sum() == 1
    kinds = {name: name.split("-")[1] for name in parts[0][0]}
    assert set(kinds.values()) == {"straight", "turn", "zigzag"}
    expected = structural_covariance(*parts[0], kinds)
    np.testing.assert_allclose(
        np.array(model.covariance["scatter"]), expected * np.outer(unit, unit), rtol=1e-9
    )
    # a coefficient by itself is told how its maneuvers disagree with each other alone
    rows = {c.symbol: c for c in model.coefficients}
    centred = scatter_of(*parts[0]).std * scale
    told = {s: float(x) for s, x in zip(symbols, centred, strict=True)}
    assert told["X_uu"] == pytest.approx(rows["X_uu"].std_jackknife)
    _, fitted = free_behind(model)
    _, claimed = free_behind(model, claimed_covariance)
    assert np.linalg.eigvalsh(claimed - fitted).min() > -1e-9
