"""Process noise by likelihood: long memory where the model is right, short where it is not."""

from dataclasses import replace

import numpy as np
import pytest

from auvident.engines.estimator import OBSERVER_TIMES_S, run_stage
from auvident.engines.setup import Setup
from auvident.estimation.coloured import Colour
from auvident.estimation.innovations import most_likely
from auvident.schema.plan import PlanStage
from tests.engines.chain import plan_named, setup_of
from tests.engines.test_free_run import noisy

EVERYTHING = PlanStage(name="all", system="coupled", free=("all",))


def with_noise(size: float, slow: float) -> Setup:
    """Readings of the prior's vehicle with white noise and, in units of it, a disturbance."""
    plan = plan_named("likely")
    setup = setup_of(plan=plan)
    colours = [Colour(size * s, slow * size * s, 0.6) for s in setup.sensor_std[:3]]
    return noisy(setup, colours)


def test_where_the_model_is_right_the_filter_trusts_it_longest() -> None:
    setup = with_noise(1.0, 0.0)
    outcome = run_stage(setup, setup.prior, EVERYTHING)
    assert outcome.observer_time_s == OBSERVER_TIMES_S[-1]


def test_where_the_motion_is_disturbed_the_filter_follows_it() -> None:
    setup = with_noise(1.0, 20.0)
    outcome = run_stage(setup, setup.prior, EVERYTHING)
    assert outcome.observer_time_s == OBSERVER_TIMES_S[0]


def test_a_plan_that_names_a_time_has_it() -> None:
    setup = with_noise(1.0, 20.0)
    fixed = setup.plan.model_copy(update={"observer_time_s": 12.5})
    assert run_stage(replace(setup, plan=fixed), setup.prior, EVERYTHING).observer_time_s == 12.5


def test_the_best_pass_is_the_result() -> None:
    setup = with_noise(1.0, 20.0)
    found = run_stage(setup, setup.prior, EVERYTHING)
    fixed = setup.plan.model_copy(update={"observer_time_s": found.observer_time_s})
    expected = run_stage(replace(setup, plan=fixed), setup.prior, EVERYTHING)
    np.testing.assert_array_equal(found.parameters, expected.parameters)
    np.testing.assert_array_equal(found.covariance, expected.covariance)


def gaussian(values: np.ndarray, std: np.ndarray) -> float:
    """Log-likelihood of independent values (k, n, c) with standard deviations (c,)."""
    size = values / std
    own = np.broadcast_to(std, values.shape)[np.isfinite(values)]
    return float(
        -0.5 * np.nansum(size**2) - np.log(own).sum() - 0.5 * own.size * np.log(2.0 * np.pi)
    )


def test_the_likelihood_with_the_best_noise_is_the_highest_of_all() -> None:
    rng = np.random.default_rng(0)
    values = rng.normal(size=(2, 300, 2)) * np.array([0.3, 5.0])
    values[0, 250:, :] = np.nan
    claimed = np.array([1.0, 1.0])
    found = most_likely(values / claimed, gaussian(values, claimed))
    best = np.sqrt(np.nanmean(values**2, axis=(0, 1)))
    assert found == pytest.approx(gaussian(values, best), rel=1e-12)
    for factor in (0.9, 1.1):
        assert found > gaussian(values, factor * best)


def test_a_channel_without_readings_has_no_part_in_it() -> None:
    values = np.random.default_rng(1).normal(size=(1, 50, 2))
    values[:, :, 1] = np.nan
    alone = most_likely(values[:, :, :1], -10.0)
    assert most_likely(values, -10.0) == alone
