"""Process noise by likelihood: long memory where the model is right, short where it is not."""

from dataclasses import replace

import numpy as np
import pytest

from auvident.engines.estimator import OBSERVER_TIMES_S, filter_pass, run_stage, task_of
from auvident.engines.noise import effective_noise
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


def likelihoods(setup: Setup) -> dict[float, float]:
    """Log-likelihood of the innovations by observer time, with noise as large as they are."""
    task = task_of(setup, EVERYTHING)
    noise = effective_noise(task.output, setup.prior, setup.sensor_std)
    passes = [filter_pass(task, setup.prior, noise, t).passed for t in OBSERVER_TIMES_S]
    found = [most_likely(passed.whitened, passed.log_likelihood) for passed in passes if passed]
    return dict(zip(OBSERVER_TIMES_S, found, strict=True))


def test_where_the_model_is_right_the_filter_trusts_it_as_long_as_readings_can_tell() -> None:
    setup = with_noise(1.0, 0.0)
    by_time = likelihoods(setup)
    longest = by_time[OBSERVER_TIMES_S[-1]]
    # process noise over 10 s and more is lost in that of the readings: in twelve draws of it these
    # times were within 0.8 nats of each other, and which was the most likely was chance; a filter
    # that follows its readings within 1 s lost 64 to 90 nats, one within 3 s 1.4 to 10
    assert by_time[1.0] < longest - 30.0
    assert by_time[3.0] < longest - 0.5
    assert max(by_time.values()) < longest + 1.0
    chosen = run_stage(setup, setup.prior, EVERYTHING).observer_time_s
    assert chosen == max(by_time, key=by_time.__getitem__) >= 10.0


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
