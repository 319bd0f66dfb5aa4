"""The smoother against the least-squares solution of the whole record."""

import numpy as np

from auvident.estimation.smoother import smooth


def random_walk(n: int, q: float, r: float, seed: int):
    """Kalman filter of an AR(1) state in one dimension, and its readings."""
    rng, f = np.random.default_rng(seed), 0.95
    truth = np.zeros(n)
    for k in range(1, n):
        truth[k] = f * truth[k - 1] + np.sqrt(q) * rng.normal()
    z = truth + np.sqrt(r) * rng.normal(size=n)
    filtered, covariance, predicted, before = (np.zeros(n) for _ in range(4))
    x, p = 0.0, 1.0
    for k in range(n):
        predicted[k], before[k] = x, p
        gain = p / (p + r)
        x, p = x + gain * (z[k] - x), (1 - gain) * p
        filtered[k], covariance[k] = x, p
        x, p = f * x, f * f * p + q
    return truth, z, f, filtered, covariance, predicted, before


def test_smoothing_is_the_least_squares_solution_of_the_record() -> None:
    n, q, r = 40, 0.3, 0.5
    _, z, f, filtered, covariance, predicted, before = random_walk(n, q, r, 3)
    found = smooth(
        filtered[:, None],
        covariance[:, None, None],
        predicted[:, None],
        before[:, None, None],
        np.full((n, 1, 1), f),
    )
    information = np.eye(n) / r  # readings, prior of the first state, every step
    information[0, 0] += 1.0
    for k in range(n - 1):
        step = np.zeros(n)
        step[k], step[k + 1] = -f, 1.0
        information += np.outer(step, step) / q
    expected = np.linalg.inv(information)
    # the same linear algebra in another order: rounding
    np.testing.assert_allclose(found.mean[:, 0], expected @ z / r, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.covariance[:, 0, 0], np.diag(expected), rtol=1e-10)


def test_smoothing_is_never_less_certain_than_filtering() -> None:
    n = 60
    _, _, f, filtered, covariance, predicted, before = random_walk(n, 0.1, 1.0, 5)
    found = smooth(
        filtered[:, None],
        covariance[:, None, None],
        predicted[:, None],
        before[:, None, None],
        np.full((n, 1, 1), f),
    )
    assert (found.covariance[:, 0, 0] <= covariance * (1 + 1e-12)).all()
    assert found.covariance[n // 2, 0, 0] < 0.9 * covariance[n // 2]
