"""The prior against the data, on linear problems."""

import numpy as np
import pytest
from scipy.stats import kstest

from auvident.estimation.prior_data import compared


def problem(rng: np.random.Generator, truth: np.ndarray, at: np.ndarray | None = None):
    """A linear problem with a direction that the data do not see; looked at somewhere."""
    slopes = rng.normal(size=(60, 3)) * np.array([1.0, 0.3, 0.05])
    slopes = np.column_stack([slopes, slopes[:, 0]])  # only the sum of the first and last is seen
    prior = np.diag([1.0, 1.0, 4.0, 1.0])
    reads = slopes @ truth + rng.normal(size=60)
    at = np.zeros(4) if at is None else at
    return at, slopes.T @ (slopes @ at - reads), slopes.T @ slopes, prior


def drawn(rng: np.random.Generator) -> np.ndarray:
    return rng.normal(size=4) / np.sqrt([1.0, 1.0, 4.0, 1.0])


def test_a_right_prior_is_contradicted_as_often_as_chance_has_it() -> None:
    rng, own = np.random.default_rng(1), np.arange(4)
    found = [compared(*problem(rng, drawn(rng)), own) for _ in range(1500)]
    away = np.array([f.away for f in found])
    np.testing.assert_allclose(away.std(axis=0), 1.0, atol=0.05)
    assert kstest([f.p for f in found], "uniform").pvalue > 0.01
    assert {f.directions for f in found} <= {1, 2, 3}


def test_one_coefficient_against_its_own_estimate_by_hand() -> None:
    """Ten readings of one parameter: 1/10 is the variance of their mean, 1 that of the prior."""
    reads = np.full(10, 3.0)
    found = compared(
        np.zeros(1), np.array([-reads.sum()]), np.array([[10.0]]), np.eye(1), np.array([0])
    )
    assert found.data[0] == pytest.approx(3.0)
    assert found.data_std[0] == pytest.approx(np.sqrt(0.1))
    assert found.away[0] == pytest.approx(3.0 / np.sqrt(1.1))
    assert found.chi_square == pytest.approx(9.0 / 1.1) and found.directions == 1


def test_it_does_not_matter_where_the_data_are_looked_at() -> None:
    rng = np.random.default_rng(2)
    truth, at = drawn(rng), rng.normal(size=4)
    here = compared(*problem(np.random.default_rng(3), truth), np.arange(4))
    there = compared(*problem(np.random.default_rng(3), truth, at), np.arange(4))
    np.testing.assert_allclose(here.away, there.away, atol=1e-9)
    assert here.chi_square == pytest.approx(there.chi_square)


def test_what_the_data_do_not_see_is_not_compared() -> None:
    rng = np.random.default_rng(4)
    at, gradient, information, prior = problem(rng, drawn(rng))
    gradient[2], information[2], information[:, 2] = 0.0, 0.0, 0.0
    found = compared(at, gradient, information, prior, np.arange(4))
    assert found.away[2] == 0.0 and found.share[2] == 0.0
    assert found.directions <= 2
    blind = compared(at, 0.0 * gradient, 0.0 * information, prior, np.arange(4))
    assert (blind.directions, blind.chi_square, blind.p) == (0, 0.0, 1.0)
