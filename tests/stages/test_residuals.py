"""Residual analysis of predictions, and what the identification says of its own residuals."""

import numpy as np
import pytest

from auvident.pipeline.steps import DEFAULT_PLAN
from auvident.stages.validate.residuals import Compared, residuals_of, theil
from tests.engines.chain import identified, plan_named, sample, validated
from tests.session import once

HARBOUR, DIVE = ("harbour_trial", "horizontal"), ("dive_trial", "vertical")
SENSORS = {"u_mps": 0.005, "v_mps": 0.005, "r_radps": 0.001}


# --- Theil ---------------------------------------------------------------------------------


def test_shares_of_the_squared_error_by_hand() -> None:
    m = np.array([1.0, 3.0, np.nan])
    # means 2 and 5, standard deviations 1 and 2, correlation 1: errors -2 and -4
    found = theil([(m, np.array([3.0, 7.0, 9.0]))])
    square = (4.0 + 16.0) / 2.0
    assert found.coefficient == pytest.approx(
        np.sqrt(square) / (np.sqrt((1.0 + 9.0) / 2.0) + np.sqrt((9.0 + 49.0) / 2.0))
    )
    assert found.bias == pytest.approx(9.0 / square)
    assert found.variance == pytest.approx(1.0 / square)
    assert found.covariance == pytest.approx(0.0, abs=1e-12)
    assert theil([(np.full(3, np.nan), np.zeros(3))]) is None
    assert theil([(m, m)]).covariance == 1.0


@pytest.mark.parametrize("trial", [HARBOUR, DIVE], ids=lambda t: t[0])
def test_the_shares_of_every_channel_add_up_to_one(trial) -> None:
    metrics = validated(*trial).metrics
    assert set(metrics.residuals) == {"identify", "validate"}
    for role, channels in metrics.residuals.items():
        assert set(channels) == set(metrics.summary[role]) - {"track"}
        for name, tests in channels.items():
            t = tests.theil
            assert t.bias + t.variance + t.covariance == pytest.approx(1.0, abs=1e-9)
            assert t.coefficient == pytest.approx(metrics.summary[role][name].theil, rel=1e-9)


# --- by channel ----------------------------------------------------------------------------


def compared(rng: np.random.Generator, role: str, scale: float = 1.0) -> Compared:
    """A maneuver of 200 s with rudder steps; u lags the propeller, v and r are noise."""
    n = 2000
    rudder, rpm = (np.repeat(rng.normal(size=n // 100), 100) for _ in range(2))
    late = np.concatenate([np.zeros(20), rpm[:-20]])
    noise = {"u": 0.5 * late, "v": np.zeros(n), "r": np.zeros(n), "heading": np.zeros(n)}
    channels = {k: (x + scale * rng.normal(size=n), np.zeros(n)) for k, x in noise.items()}
    return Compared(role, channels, {"rudder": rudder, "rpm": rpm})


def test_noise_is_white_normal_and_as_large_as_that_of_the_others_and_a_lag_is_found() -> None:
    rng = np.random.default_rng(1)
    rows = [compared(rng, role) for role in ("identify",) * 5 + ("validate",) * 3]
    found = residuals_of(rows, "horizontal", 0.1, SENSORS)
    for role in ("identify", "validate"):
        for channel in ("v", "r"):
            tests = found[role][channel]
            assert tests.noise.white_std == pytest.approx(1.0, abs=0.05)
            assert tests.nis.mean == pytest.approx(1.0, abs=0.1)
            assert tests.nis.ks < 0.05
            assert tests.autocorrelation.outside < 0.2
        u = found[role]["u"].inputs
        assert u["rpm"].largest > u["rpm"].band
        assert u["rpm"].lag_s == pytest.approx(2.0, abs=0.5)
        assert abs(u["rudder"].largest) < u["rudder"].band
        # a heading is a sum of errors: it has shares and nothing else
        assert found[role]["heading"].nis is None and found[role]["heading"].theil is not None


def test_a_held_out_maneuver_twice_as_noisy_shows() -> None:
    rng = np.random.default_rng(2)
    rows = [compared(rng, "identify") for _ in range(5)] + [compared(rng, "validate", 2.0)]
    found = residuals_of(rows, "horizontal", 0.1, SENSORS)
    assert found["validate"]["v"].nis.mean == pytest.approx(4.0, rel=0.15)
    assert found["identify"]["v"].nis.mean == pytest.approx(1.0, abs=0.1)


def test_a_maneuver_that_identifies_is_held_against_the_noise_of_the_others() -> None:
    """Three times as noisy as they are: with a noise to which it gave a share it would be less."""
    rng = np.random.default_rng(3)
    quiet, loud = [compared(rng, "identify") for _ in range(2)], compared(rng, "identify", 3.0)
    found = residuals_of([*quiet, loud], "horizontal", 0.1, SENSORS)["identify"]["v"]
    assert found.noise.white_std**2 == pytest.approx((1.0 + 1.0 + 9.0) / 3.0, rel=0.1)
    # one of the quiet ones is held against 1 and 9, the loud one against 1 alone
    assert found.nis.mean == pytest.approx((1.0 / 5.0 + 1.0 / 5.0 + 9.0) / 3.0, rel=0.15)


# --- what the identification says of itself ------------------------------------------------


@once
def by_default(name: str, plane: str, buoyancy: float = 1.0):
    """The model of the default plan, or with a buoyancy that is wrong by a factor and held."""
    c = sample(name)
    if buoyancy == 1.0:
        return c.identify(plane, plan=plan_named(DEFAULT_PLAN)).model
    wrong = {"buoyancy_n": buoyancy * c.vehicle.body.buoyancy_n, "buoyancy_std_n": 0.0}
    c = c.with_body(**wrong)
    return c.identify(plane, plan=plan_named(DEFAULT_PLAN)).model


def codes(model) -> set[str]:
    return {f.code for f in model.findings}


@pytest.mark.parametrize("trial", [HARBOUR, DIVE], ids=lambda t: t[0])
def test_every_stage_of_the_default_plan_is_tested_and_good_ones_pass(trial) -> None:
    model = by_default(*trial)
    columns = {"surge": {"u_mps"}}
    for stage in model.stages:
        assert stage.nis, stage.stage
        assert set(stage.nis) >= columns.get(stage.system, set())
        for test in stage.nis.values():
            assert 0.0 <= test.ks <= 1.0 and 0.0 <= test.ks_p <= 1.0
            assert 1.0 <= test.effective_samples <= stage.samples
    last = model.stages[-1]
    assert not last.observer_time_s and {"u_mps"} < set(last.nis)
    assert model.noise_claim.freedom > 10.0
    failed = {"nis-outside", "innovations-not-normal", "noise-underclaimed", "channel-ignored"}
    assert not codes(model) & failed


def test_buoyancy_held_off_by_two_percent_is_a_channel_that_the_fit_ignores() -> None:
    model = by_default(*DIVE, 1.02)
    first = model.findings[0]
    assert (first.code, first.where) == ("channel-ignored", "w_mps")
    assert first.value > first.threshold == 1.0
    assert "buoyancy_n" in first.remedy
    # that of the fit: a noise of more than a meter per second for a sensor of millimeters
    assert model.stages[-1].noise_std["w_mps"] > 1.0 > 100 * model.sensing.noise_std["w_mps"]


# --- prior against data --------------------------------------------------------------------


def test_a_drag_estimated_far_too_small_is_contradicted_with_a_remedy() -> None:
    c = sample("harbour_trial")
    sure = [
        r.model_copy(update={"value": 0.2 * r.value, "std": 0.15 * abs(r.value)})
        if r.symbol == "X_uu"
        else r
        for r in c.ase.coefficients
    ]
    model = c.identify(ase=c.ase.model_copy(update={"coefficients": tuple(sure)})).model
    found = {f.where: f for f in model.findings if f.code == "prior-contradicted"}
    row = {r.symbol: r for r in model.prior_against_data.coefficients}["X_uu"]
    assert found["X_uu"].value == pytest.approx(abs(row.away)) and abs(row.away) > 2.5
    assert row.data < row.prior  # more drag than estimated
    assert "drag, thrust and mass" in found["X_uu"].remedy
    assert f"contradict the estimate of X_uu by {abs(row.away):.1f}" in found["X_uu"].message


def test_distances_are_those_between_the_data_and_the_prior() -> None:
    told = identified(*HARBOUR).model.prior_against_data
    assert told.directions > 5 and 0.0 <= told.p <= 1.0
    for row in told.coefficients:
        expected = (row.data - row.prior) / np.hypot(row.data_std, row.prior_std)
        assert row.away == pytest.approx(expected, rel=1e-9)
