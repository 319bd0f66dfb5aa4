"""Profile of the posterior: a straight line of a linear problem, within bounds, of effects."""

import numpy as np
import pytest

from auvident.engines import estimator
from auvident.engines.carried import Carried
from auvident.engines.estimator import run_stage
from auvident.engines.noise import white
from auvident.engines.profile import MOVES, _crossing, profile_of
from auvident.engines.setup import Setup
from auvident.schema.artifacts import ProfileInterval
from auvident.schema.effects import BY_ID, parameter_of
from auvident.stages.identify.profiles import _finding, _shown, profiles_of
from tests.engines.chain import setup_of
from tests.engines.test_estimator import linear_setup, stage

EVERY = {"maneuvers": ("straight", "turn", "zigzag"), "method": "output_error"}

NAMED = ("gyro_bias", "rudder_backlash")


@pytest.fixture
def steady_noise(monkeypatch):
    monkeypatch.setattr(estimator, "effective_noise", lambda output, p, std: 20.0 * std)
    monkeypatch.setattr(estimator, "coloured_noise", lambda output, p, std: white(20.0 * std))


def test_the_profile_of_a_linear_problem_is_its_gaussian(steady_noise) -> None:
    setup, how = linear_setup(), stage(**EVERY)
    found = run_stage(setup, setup.prior, how)
    for column in range(len(found.free)):
        profile = profile_of(setup, found, how, column)
        std = np.sqrt(found.covariance[column, column]) * setup.prior_std[found.free[column]]
        moves = [-m for m in MOVES[::-1]] + [0.0, *MOVES]
        # the forces are linear in the coefficients, the drag they meet through u is not quite
        np.testing.assert_allclose(profile.root, moves, atol=0.02)
        np.testing.assert_allclose(profile.values, profile.best + std * np.array(moves), rtol=1e-9)
        assert profile.high - profile.best == pytest.approx(1.96 * std, rel=0.02)
        assert profile.best - profile.low == pytest.approx(1.96 * std, rel=0.02)


def test_an_interval_ends_at_the_bound_of_its_parameter(steady_noise, monkeypatch) -> None:
    setup, how = linear_setup(), stage(**EVERY)
    found = run_stage(setup, setup.prior, how)
    std = np.sqrt(found.covariance[0, 0]) * setup.prior_std[found.free[0]]
    low, high = setup.bounds(found.free)
    low[0] = found.parameters[found.free[0]] - 1.5 * std
    monkeypatch.setattr(Setup, "bounds", lambda self, positions: (low, high))
    profile = profile_of(setup, found, how, 0)
    assert profile.low == low[0]
    assert profile.high - profile.best == pytest.approx(1.96 * std, rel=0.02)


def test_ends_lie_on_the_lines_between_the_points() -> None:
    values, root = np.array([0.0, 1.0, 3.0]), np.array([-1.0, 0.0, 1.5])
    assert _crossing(values, root, -0.5) == pytest.approx(0.5)
    assert _crossing(values, root, 1.96) == pytest.approx(1.0 + 2.0 * 1.96 / 1.5)
    assert _crossing(values, root, -1.96) == pytest.approx(-0.96)


def test_sizes_of_named_effects_and_the_surge_scale_have_a_profile() -> None:
    stds = {n: parameter_of(n).practical for e in NAMED for n in BY_ID[e].names()}
    carried = Carried(NAMED, start=stds, prior=dict.fromkeys(stds, 0.0), prior_std=stds)
    setup, how = setup_of(carried=carried), stage(**EVERY | {"system": "coupled", "free": ("all",)})
    found = run_stage(setup, setup.start, how)
    rows, _ = profiles_of(setup, found, how, NAMED)
    # play has no slope of its own
    assert {row.symbol for row in rows} == {"X_uu", *BY_ID["gyro_bias"].names()}
    for row in rows:
        assert row.low < row.gaussian_high and row.gaussian_low < row.high
        assert len(row.values) == len(row.root) == 2 * len(MOVES) + 1
    assert [r.symbol for r in profiles_of(setup, found, how, ())[0]] == ["X_uu"]


def interval(low: float, high: float) -> ProfileInterval:
    return ProfileInterval(
        symbol="X_uu", low=low, high=high, gaussian_low=-2.0, gaussian_high=2.0, values=(), root=()
    )


def test_an_interval_that_differs_by_more_than_a_third_is_told() -> None:
    assert _finding(interval(-2.6, 1.5)) is None
    told = _finding(interval(-2.8, 2.0))
    assert told.code == "not-gaussian" and told.value == pytest.approx(0.4)
    assert "-2.8 to 2 kg/m, not -2 to 2 kg/m" in told.message


@pytest.mark.parametrize(
    ("symbol", "low", "high", "words"),
    [
        ("rudder_offset.offset_deg", 0.01, 0.04, "0.573 to 2.292 deg"),
        ("rudder_rate_limit.rate_degps", 1.0, 2.0, "28.65 to 57.3 deg/s"),
        ("dvl_scale.fraction", -0.01, 0.02, "-0.01 to 0.02"),
    ],
)
def test_an_interval_of_an_effect_is_told_in_its_unit(symbol, low, high, words) -> None:
    """Internal values are radians and, of a limit, its inverse."""
    assert _shown(symbol, low, high) == words
