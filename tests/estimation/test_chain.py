"""The smoother of a chain against the Kalman filter with Rauch-Tung-Striebel, and closed forms."""

import numpy as np
import pytest
from scipy.linalg import expm

from auvident.estimation.chain import (
    FIRST_STD,
    Intensities,
    Motion,
    chain_of,
    course,
    driven,
    most_likely,
    white_equal,
)
from auvident.estimation.smoother import smooth

MOTIONS = [Motion(1), Motion(2), Motion(1, 2.0), Motion(2, 3.0)]


def readings(motion, n=40, q=0.3, r=0.04, seed=1, dt=0.5):
    """A chain that follows its own law, read at each of its states."""
    rng = np.random.default_rng(seed)
    F, Q = driven(motion, np.full(n - 1, dt))
    x = np.zeros((n, motion.order + 1))
    for k in range(n - 1):
        x[k + 1] = F[k] @ x[k] + np.linalg.cholesky(q * Q[k]) @ rng.standard_normal(len(F[k]))
    values = x[:, 0] + np.sqrt(r) * rng.standard_normal(n)
    rows = np.zeros((n, motion.order + 1))
    rows[:, 0] = 1.0
    starts = np.arange(n) == 0
    source = (np.linalg.inv(Q), np.linalg.slogdet(Q)[1], Q.shape[1])
    return x, F, Q, chain_of(F, [source], starts, (rows, np.arange(n), values))


@pytest.mark.parametrize("motion", MOTIONS)
def test_a_step_is_the_matrix_exponential_of_its_equation(motion):
    size = motion.order + 1
    A = np.diag(np.ones(motion.order), 1)
    A[-1, -1] = -1.0 / motion.back_s
    push = np.zeros((size, size))
    push[-1, -1] = 1.0
    both = expm(0.1 * np.block([[-A, push], [np.zeros((size, size)), A.T]]))  # Van Loan 1978
    F, Q = driven(motion, np.array([0.1]))
    np.testing.assert_allclose(F[0], both[size:, size:].T, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(Q[0], F[0] @ both[:size, size:], rtol=1e-9, atol=1e-17)


@pytest.mark.parametrize("motion", MOTIONS)
def test_course_is_that_of_filter_and_smoother(motion):
    _, F, Q, chain = readings(motion)
    q, r, n, d = 0.3, 0.04, len(F) + 1, F.shape[1]
    x, P = np.zeros((n, d)), np.zeros((n, d, d))
    before, spread = np.zeros((n, d)), np.zeros((n, d, d))
    spread[0] = FIRST_STD**2 * np.eye(d)
    for k in range(n):
        if k:
            before[k], spread[k] = F[k - 1] @ x[k - 1], F[k - 1] @ P[k - 1] @ F[k - 1].T
            spread[k] += q * Q[k - 1]
        gain = spread[k][:, 0] / (spread[k][0, 0] + r)
        x[k] = before[k] + gain * (chain.values[k] - before[k][0])
        keep = np.eye(d)
        keep[:, 0] -= gain
        P[k] = keep @ spread[k] @ keep.T + r * np.outer(gain, gain)
    expected = smooth(x, P, before, spread, np.concatenate((F, F[-1:])))
    found = course(chain, Intensities((q,), r, 0.0))
    np.testing.assert_allclose(found.mean, expected.mean, atol=1e-6)
    np.testing.assert_allclose(found.covariance, expected.covariance, atol=1e-6)


def test_likelihood_is_that_of_the_readings():
    """Differences between two chains, of different size, as by the density of the readings."""
    told = []
    for motion in (Motion(1), Motion(2)):
        values = readings(Motion(1), n=12)[3].values
        d, n = motion.order + 1, values.size
        F, Q = driven(motion, np.full(n - 1, 0.5))
        rows = np.eye(d)[np.zeros(n, dtype=int)]
        source = (np.linalg.inv(Q), np.linalg.slogdet(Q)[1], d)
        chain = chain_of(F, [source], np.arange(n) == 0, (rows, np.arange(n), values))
        best = most_likely(chain, (0.1,), 0.1)
        state = [FIRST_STD**2 * np.eye(d)]
        reach = [np.eye(d)]
        for k in range(n - 1):
            state.append(F[k] @ state[-1] @ F[k].T + best.theta[0] * Q[k])
            reach.append(F[k] @ reach[-1])
        cov = np.zeros((n, n))
        for i in range(n):
            for j in range(i, n):
                cov[i, j] = cov[j, i] = (reach[j] @ np.linalg.inv(reach[i]) @ state[i])[0, 0]
        cov += best.r * np.eye(n)
        exact = -0.5 * (values @ np.linalg.solve(cov, values) + np.linalg.slogdet(cov)[1])
        told.append((best.log_likelihood, exact))
    (a, exact_a), (b, exact_b) = told
    assert a - b == pytest.approx(exact_a - exact_b, abs=1e-3)


def test_intensities_are_found_again():
    found = []
    for seed in range(4):
        _, _, _, chain = readings(Motion(1), n=1000, seed=seed)
        best = most_likely(chain, (1.0,), 1.0)
        found.append([best.theta[0] / 0.3, best.r / 0.04])
    np.testing.assert_allclose(np.mean(found, axis=0), 1.0, atol=0.15)  # of 4: std 0.05


def test_errors_are_as_large_as_claimed():
    ratios = []
    for seed in range(6):
        x, _, _, chain = readings(Motion(2), n=300, seed=seed)
        found = course(chain, Intensities((0.3,), 0.04, 0.0))
        std = np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2))
        ratios.append(np.mean(((found.mean - x) / std) ** 2, axis=0))
    np.testing.assert_allclose(np.mean(ratios, axis=0), 1.0, atol=0.2)


@pytest.mark.parametrize("motion", MOTIONS)
def test_white_noise_in_its_place_is_nowhere_less(motion):
    q, density = 0.02, 0.3
    w = np.geomspace(1e-4, 1e3, 4000)
    drives = q / (w ** (2 * motion.order - 2) * (w**2 + motion.back_s**-2))
    error = 1.0 / (1.0 / drives + 1.0 / (w**2 * density))
    assert white_equal(motion, q, density) == pytest.approx(error.max(), rel=1e-3)
