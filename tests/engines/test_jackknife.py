"""Leave one maneuver out by one Newton step, against leaving it out."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from auvident.engines import estimator
from auvident.engines.estimator import run_stage
from auvident.engines.jackknife import (
    Scatter,
    expected_variance,
    information_by_maneuver,
    jackknife_covariance,
    largest_by_chance,
    moves_without,
)
from auvident.engines.noise import white
from auvident.engines.setup import Setup
from auvident.schema.plan import Tuning
from auvident.stages.identify.result import widening
from tests.engines.test_estimator import linear_setup, stage

EVERY = {"maneuvers": ("straight", "turn", "zigzag"), "method": "output_error"}


@pytest.fixture(autouse=True)
def steady_noise(monkeypatch):
    monkeypatch.setattr(estimator, "effective_noise", lambda output, p, std: 20.0 * std)
    monkeypatch.setattr(estimator, "coloured_noise", lambda output, p, std: white(20.0 * std))


def left_out(setup: Setup, name: str) -> Setup:
    return replace(setup, records={k: v for k, v in setup.records.items() if k != name})


@pytest.mark.parametrize("tuning", [{}, {"all": Tuning(prior=0.3)}])
def test_a_newton_step_without_a_maneuver_of_a_linear_problem_is_leaving_it_out(tuning) -> None:
    setup, how = linear_setup(**tuning), stage(**EVERY)
    whole = run_stage(setup, setup.prior, how)
    whole = run_stage(setup, whole.parameters, how)  # to the bottom: the moves suppose it
    moves = moves_without(*information_by_maneuver(setup, whole, how))
    assert set(moves) == set(setup.records)
    for name, move in moves.items():
        rest = left_out(setup, name)
        without = run_stage(rest, whole.parameters, how)
        without = run_stage(rest, without.parameters, how)
        scale = setup.prior_std[whole.free]
        moved = (without.parameters - whole.parameters)[whole.free] / scale
        posterior = np.sqrt(np.diag(whole.covariance))
        # exact for a linear problem but for where the two fits stop (1e-5 of the cost)
        np.testing.assert_allclose(move / posterior, moved / posterior, atol=0.02)
    largest = max(
        np.abs(move / np.sqrt(np.diag(whole.covariance))).max() for move in moves.values()
    )
    assert largest > 0.5  # some maneuver does matter


def test_scatter_of_the_moves_by_hand() -> None:
    moves = {"a": np.array([1.0, 0.0]), "b": np.array([-1.0, 0.0]), "c": np.array([3.0, 6.0])}
    # means 1 and 2; (F - 1)/F of the sums of squares 0 + 4 + 4, 4 + 4 + 16, product 0 + 4 + 8
    expected = 2 / 3 * np.array([[8.0, 12.0], [12.0, 24.0]])
    np.testing.assert_allclose(jackknife_covariance(moves), expected, rtol=1e-12)


def test_jackknife_of_a_mean_is_its_standard_error() -> None:
    """Leaving x_i out of a mean moves it by (mean - x_i) / (n - 1): the classic identity."""
    x = np.random.default_rng(0).normal(size=12)
    moves = {str(i): np.array([(x.mean() - v) / (len(x) - 1)]) for i, v in enumerate(x)}
    assert jackknife_covariance(moves)[0, 0] == pytest.approx(x.var(ddof=1) / len(x), rel=1e-12)


def test_two_maneuvers_say_nothing_about_scatter() -> None:
    assert jackknife_covariance({"a": np.ones(2), "b": np.zeros(2)}) is None


def drawn(
    rng: np.random.Generator, apart: float = 0.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Jackknife variances of a linear problem of eight unequal maneuvers, expected, freedom.

    The coefficients are drawn from the prior; those of each maneuver lie `apart` from them.
    """
    n, prior = 3, np.diag([1.0, 4.0, 1.0])
    slopes = [rng.normal(size=(20, n)) * rng.uniform(0.1, 2.0, size=n) for _ in range(8)]
    truth = rng.normal(size=n) / np.sqrt(np.diag(prior))
    own = [truth + apart * rng.normal(size=n) for _ in slopes]
    reads = [j @ t + rng.normal(size=20) for j, t in zip(slopes, own, strict=True)]
    whole = prior + sum(j.T @ j for j in slopes)
    best = np.linalg.solve(whole, sum(j.T @ y for j, y in zip(slopes, reads, strict=True)))
    moves = {
        str(i): np.linalg.solve(whole - j.T @ j, j.T @ (j @ best - y))
        for i, (j, y) in enumerate(zip(slopes, reads, strict=True))
    }
    expected, freedom = expected_variance([j.T @ j for j in slopes], prior)
    return np.diag(jackknife_covariance(moves)), expected, freedom


def test_the_scatter_of_noise_alone_has_the_expected_mean_and_is_rarely_beyond_chance() -> None:
    rng = np.random.default_rng(11)
    found = [drawn(rng) for _ in range(1500)]
    ratio = np.array([variance / expected for variance, expected, _ in found])
    beyond = np.array([v > e * largest_by_chance(f) for v, e, f in found])
    assert ratio.mean() == pytest.approx(1.0, abs=0.07)
    assert 0.02 < beyond.mean() < 0.08


def test_maneuvers_of_different_vehicles_scatter_beyond_chance() -> None:
    rng = np.random.default_rng(12)
    found = [drawn(rng, apart=1.0) for _ in range(200)]
    beyond = np.array([v > e * largest_by_chance(f) for v, e, f in found])
    assert beyond.mean() > 0.8


def test_the_limit_of_chance_is_that_of_chi_square() -> None:
    freedom = np.array([1.0, 2.0, 4.0, 10.0, 40.0])
    np.testing.assert_allclose(
        largest_by_chance(freedom), chi2.ppf(0.95, freedom) / freedom, rtol=0.03
    )


def test_only_a_scatter_beyond_chance_widens_and_never_beyond_the_prior() -> None:
    covariance = np.diag([0.04, 0.04, 0.04, 0.04])
    scatter = Scatter(np.array([0.6, 0.6, 5.0, 0.1]), np.array([True, False, True, True]))
    np.testing.assert_allclose(widening(covariance, scatter), [3.0, 1.0, 5.0, 1.0], rtol=1e-12)
    np.testing.assert_array_equal(widening(covariance, None), np.ones(4))
