"""The linear algebra of the filters against plain numpy, filterpy and closed forms."""

import math

import numpy as np
import pytest
from filterpy.kalman import MerweScaledSigmaPoints
from hypothesis import given, settings
from hypothesis import strategies as st

from auvident.estimation.kalman import (
    GainWork,
    ProcessNoise,
    ReadingRow,
    predict,
    unscented_weights,
    update,
    upper_cholesky,
)
from tests.estimation.linear_system import LinearSystem, make_system, simulate, textbook

seeds = st.integers(0, 2**32 - 1)


def random_covariance(rng: np.random.Generator, n: int, condition: float = 1e3) -> np.ndarray:
    q, _ = np.linalg.qr(rng.normal(size=(n, n)))
    covariance = (q * np.geomspace(1.0, 1.0 / condition, n)) @ q.T
    return 0.5 * (covariance + covariance.T)  # symmetric to the last bit


def update_scalar(mean, covariance, n, first, gradient, innovation, variance) -> float:
    """An update that reads one block; returns the innovation covariance."""
    row = ReadingRow(first, gradient, np.zeros(0, np.int64), np.zeros(0))
    return update(mean, covariance, n, n, row, innovation, variance, GainWork(*np.empty((3, n))))


def predict_blocks(covariance, system: LinearSystem, alive: int, q_theta, q_x) -> None:
    """Prediction of the first blocks of a linear system."""
    n, rows = system.size(alive), alive * system.n_x
    F = np.concatenate([system.transition[:alive], system.sensitivity[:alive]], axis=2)
    F = F.reshape(rows, system.n_x + system.n_theta)
    predict(covariance, F, ProcessNoise(q_theta, q_x), alive, n, np.empty((rows, n)))


def scalar_by_scalar(system: LinearSystem, z, mean, covariance):
    """The functions of the package, put together as a filter with blocks dropping out."""
    mean, covariance = mean.copy(), covariance.copy()
    history, log_likelihood = [], 0.0
    for t in range(int(system.lengths[0])):
        alive = system.alive(t)
        n = system.size(alive)
        for j in range(alive):
            first = system.block(j).start
            for c, gradient in enumerate(system.gradient):
                if np.isnan(z[j, t, c]):
                    continue
                innovation = z[j, t, c] - gradient @ mean[system.block(j)]
                S = update_scalar(
                    mean, covariance, n, first, gradient, innovation, system.variance[c]
                )
                log_likelihood -= 0.5 * (innovation**2 / S + math.log(2 * math.pi * S))
        history.append((mean[:n].copy(), covariance[:n, :n].copy()))
        alive = system.alive(t + 1)
        n = system.size(alive)
        mean[:n] = system.whole_transition(alive) @ mean[:n]
        predict_blocks(covariance, system, alive, system.q_theta, system.q_x)
    return history, log_likelihood


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("missing", [0.0, 0.4])
def test_filter_is_the_textbook_kalman_filter(seed, missing) -> None:
    rng = np.random.default_rng(seed)
    system = make_system(rng)
    n = system.size(3)
    z, mean, covariance = simulate(system, rng, missing), rng.normal(size=n), np.eye(n)
    expected, expected_likelihood = textbook(system, z, mean, covariance)
    found, likelihood = scalar_by_scalar(system, z, mean, covariance)
    assert [len(m) for m, _ in found] == [9] * 20 + [7] * 25 + [5] * 15
    for (m, p), (m_expected, p_expected) in zip(found, expected, strict=True):
        # double precision times the condition of the innovation covariance (some hundred)
        np.testing.assert_allclose(m, m_expected, rtol=1e-9, atol=1e-10)
        np.testing.assert_allclose(p, p_expected, rtol=1e-8, atol=1e-12)
    assert likelihood == pytest.approx(expected_likelihood, rel=1e-10)


def test_a_block_that_dropped_out_is_not_touched() -> None:
    rng = np.random.default_rng(1)
    system = make_system(rng, lengths=(5, 3))
    covariance = random_covariance(rng, 7)
    before, mean = covariance.copy(), rng.normal(size=7)
    kept = mean.copy()
    update_scalar(mean, covariance, 5, 3, system.gradient[0], 0.7, 0.1)
    predict_blocks(covariance, system, 1, system.q_theta, system.q_x)
    np.testing.assert_array_equal(covariance[5:], before[5:])
    np.testing.assert_array_equal(covariance[:, 5:], before[:, 5:])
    np.testing.assert_array_equal(mean[5:], kept[5:])


@settings(max_examples=50, deadline=None)
@given(seeds, st.floats(1e-6, 1e3))
def test_one_update_is_the_closed_form(seed, variance) -> None:
    rng = np.random.default_rng(seed)
    covariance, mean, gradient = random_covariance(rng, 6), rng.normal(size=6), rng.normal(size=2)
    h = np.concatenate([np.zeros(3), gradient, np.zeros(1)])
    expected_S = h @ covariance @ h + variance
    gain = covariance @ h / expected_S
    expected = covariance - np.outer(gain, gain) * expected_S
    moved = mean + 0.4 * gain
    found = update_scalar(mean, covariance, 6, 3, gradient, 0.4, variance)
    assert found == pytest.approx(expected_S, rel=1e-12)
    np.testing.assert_allclose(mean, moved, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(covariance, expected, atol=1e-12)  # of a covariance of size 1
    np.testing.assert_array_equal(covariance, covariance.T)


@pytest.mark.parametrize("variance", [1e30, 1e300])
def test_infinite_noise_tells_nothing(variance) -> None:
    rng = np.random.default_rng(2)
    covariance, mean = random_covariance(rng, 5), rng.normal(size=5)
    before, kept = covariance.copy(), mean.copy()
    update_scalar(mean, covariance, 5, 3, np.ones(2), 2.0, variance)
    np.testing.assert_allclose(mean, kept, atol=1e-15)
    np.testing.assert_allclose(covariance, before, atol=1e-15)


@pytest.mark.parametrize(
    "covariance", [np.diag([1.0, -2.0]), np.array([[1.0, np.nan], [np.nan, 1.0]]), -np.eye(2)]
)
def test_a_covariance_that_is_not_positive_is_reported_and_left_alone(covariance) -> None:
    mean, kept, before = np.zeros(2), np.zeros(2), covariance.copy()
    assert update_scalar(mean, covariance, 2, 0, np.array([0.0, 1.0]), 1.0, 0.5) < 0.0
    np.testing.assert_array_equal(mean, kept)
    np.testing.assert_array_equal(covariance, before)


def information_at_rest(system: LinearSystem, n: int, variance: float, q_x: float) -> np.ndarray:
    """Of n readings of the first channel on constant inputs, once the states have settled."""
    information = np.zeros((system.n_theta, system.n_theta))
    for transition, sensitivity in zip(system.transition, system.sensitivity, strict=True):
        by_state = system.gradient[0] @ np.linalg.inv(np.eye(system.n_x) - transition)
        response = by_state @ sensitivity
        information += n * np.outer(response, response) / (variance + q_x * by_state @ by_state)
    return information


def test_covariance_stays_symmetric_and_positive_over_an_hour_at_10_hz() -> None:
    """Directions far apart in certainty, no drift: the hardest case for rounding."""
    rng = np.random.default_rng(3)
    system = make_system(rng, lengths=(36_000, 36_000), n_theta=4)
    covariance, mean = np.eye(8), np.zeros(8)
    no_drift, small = np.zeros(4), 1e-8 * np.ones(2)
    lowest = np.inf
    for t in range(36_000):
        for j in range(2):
            found = update_scalar(
                mean, covariance, 8, 4 + 2 * j, system.gradient[0], rng.normal(), 1e-4
            )
            assert found > 1e-4
        predict_blocks(covariance, system, 2, no_drift, small)
        if t % 1000 == 999:
            np.testing.assert_array_equal(covariance, covariance.T)
            lowest = min(lowest, float(np.linalg.eigvalsh(covariance)[0]))
    assert lowest > 0.0
    # two constant inputs are learned as well as the readings at rest tell them, some to 1e-8; the
    # other two directions stay with the prior
    learned = np.linalg.eigvalsh(covariance[:4, :4])
    told = np.linalg.eigvalsh(information_at_rest(system, 36_000, 1e-4, 1e-8))
    assert learned[1] < 1.01 / told[2] < 1e-4 < 1e-2 < learned[2]


# --- Cholesky factor and sigma points ------------------------------------------------------


@settings(max_examples=30, deadline=None)
@given(seeds, st.integers(1, 12))
def test_cholesky_is_numpys(seed, n) -> None:
    matrix = random_covariance(np.random.default_rng(seed), n + 2)
    factor = np.full((n + 2, n + 2), 7.0)  # what stood there before does not matter
    assert upper_cholesky(matrix, n, factor) == -1
    expected = np.linalg.cholesky(matrix[:n, :n]).T
    np.testing.assert_allclose(np.triu(factor[:n, :n]), expected, atol=1e-12)  # condition 1e3
    assert (factor[n:] == 7.0).all() and (factor[np.tril_indices(n, -1)] == 7.0).all()


@pytest.mark.parametrize("bad", [-1e-9, 0.0, np.nan])
@pytest.mark.parametrize("place", [0, 1, 2])
def test_cholesky_names_the_pivot_that_is_not_positive(bad, place) -> None:
    matrix = np.diag([1.0, 2.0, 3.0])
    matrix[place, place] = bad
    assert upper_cholesky(matrix, 3, np.zeros((3, 3))) == place


@pytest.mark.parametrize("scaling", [0.5, 1.0, math.sqrt(3.0)])
@pytest.mark.parametrize("n", [1, 2, 5, 25])
def test_unscented_weights_are_merwes(n, scaling) -> None:
    centre, centre_covariance, other = unscented_weights(n, scaling)
    merwe = MerweScaledSigmaPoints(n, alpha=scaling / math.sqrt(n), beta=2.0, kappa=0.0)
    # 1 - n / scaling^2 loses the digits of n / scaling^2
    assert centre == pytest.approx(merwe.Wm[0], rel=1e-12, abs=1e-12)
    assert centre_covariance == pytest.approx(merwe.Wc[0], rel=1e-12, abs=1e-12)
    np.testing.assert_allclose(merwe.Wm[1:], other, rtol=1e-12)
    np.testing.assert_allclose(merwe.Wc[1:], other, rtol=1e-12)


@pytest.mark.parametrize("scaling", [0.7, 1.0, 2.0])
@pytest.mark.parametrize("seed", range(3))
def test_sigma_points_reproduce_the_moments_of_a_gaussian(seed, scaling) -> None:
    """Mean and covariance, hence linear functions exactly and the mean of quadratic ones."""
    rng, n = np.random.default_rng(seed), 6
    mean, covariance = rng.normal(size=n), random_covariance(rng, n)
    factor = np.zeros((n, n))
    upper_cholesky(covariance, n, factor)
    centre, centre_covariance, other = unscented_weights(n, scaling)
    points = np.vstack([mean, mean + scaling * factor, mean - scaling * factor])
    w_mean = np.array([centre] + [other] * 2 * n)
    w_covariance = np.array([centre_covariance] + [other] * 2 * n)
    np.testing.assert_allclose(w_mean @ points, mean, atol=1e-12)
    away = points - mean
    np.testing.assert_allclose((away.T * w_covariance) @ away, covariance, atol=1e-12)
    a = rng.normal(size=(n, n))
    quadratic = np.einsum("ki,ij,kj->k", points, a, points)
    # E[x'Ax] = m'Am + trace(A P)
    assert w_mean @ quadratic == pytest.approx(mean @ a @ mean + np.trace(a @ covariance))
    assert w_mean.sum() == pytest.approx(1.0, abs=1e-12)
