"""The fit and the correlation time against closed forms."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from auvident.errors import NumericsError
from auvident.estimation.output_error import MAX_ITERATIONS, bounded_step, correlation_time, fit


def linear(seed: int, rows: int = 200, n: int = 5):
    """A linear least-squares problem with a prior, and its closed form."""
    rng = np.random.default_rng(seed)
    design, data = rng.normal(size=(rows, n)), rng.normal(size=rows) * 3
    root = rng.normal(size=(n, n))
    information, mean = root @ root.T + 0.1 * np.eye(n), rng.normal(size=n)

    def likelihood(theta):
        r = design @ theta - data
        return 0.5 * float(r @ r), design.T @ r, design.T @ design

    covariance = np.linalg.inv(design.T @ design + information)
    best = covariance @ (design.T @ data + information @ mean)
    return likelihood, mean, information, best, covariance, design


@pytest.mark.parametrize("seed", range(5))
def test_fit_of_a_linear_problem_is_the_closed_form(seed) -> None:
    likelihood, mean, information, best, covariance, design = linear(seed)
    start = np.random.default_rng(seed + 100).normal(size=5) * 10
    found = fit(likelihood, start, mean, information, tolerance=1e-12)
    away = (found.theta - best) / np.sqrt(np.diag(covariance))
    assert np.abs(away).max() < 1e-4
    np.testing.assert_allclose(found.covariance, covariance, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.information, design.T @ design, rtol=1e-9, atol=1e-9)
    half = likelihood(best)[0] + 0.5 * (best - mean) @ information @ (best - mean)
    assert found.cost == pytest.approx(half, rel=1e-6)
    assert found.iterations < 10


def test_without_data_the_fit_is_the_prior() -> None:
    mean, information = np.array([1.0, -2.0]), np.diag([4.0, 0.25])
    nothing = lambda theta: (0.0, np.zeros(2), np.zeros((2, 2)))  # noqa: E731
    found = fit(nothing, np.zeros(2), mean, information)
    # the same 1e-5 of a cost of at least 1
    np.testing.assert_allclose(found.theta, mean, atol=0.01)
    np.testing.assert_allclose(found.covariance, np.diag([0.25, 4.0]), rtol=1e-12)
    np.testing.assert_allclose(found.information, 0.0, atol=1e-12)


def test_start_at_the_optimum_stays_there() -> None:
    likelihood, mean, information, best, *_ = linear(1)
    found = fit(likelihood, best, mean, information)
    np.testing.assert_allclose(found.theta, best, rtol=1e-9)


def test_a_curved_valley_is_followed() -> None:
    """Rosenbrock's residuals with a prior too weak to move the minimum at (1, 1)."""

    def likelihood(theta):
        r = np.array([10 * (theta[1] - theta[0] ** 2), 1 - theta[0]])
        j = np.array([[-20 * theta[0], 10.0], [-1.0, 0.0]])
        return 0.5 * float(r @ r), j.T @ r, j.T @ j

    found = fit(likelihood, np.array([-1.2, 1.0]), np.ones(2), 1e-6 * np.eye(2))
    assert found.iterations < MAX_ITERATIONS
    # 1e-5 of the cost scale 1, curvature along the valley about 0.2
    np.testing.assert_allclose(found.theta, 1.0, atol=0.02)


# --- bounds and reach ----------------------------------------------------------------------


def boxed(seed: int):
    """A linear problem with bounds, of which some hold; and scipy's solution."""
    likelihood, mean, information, best, covariance, _ = linear(seed)
    rng = np.random.default_rng(seed + 50)
    reach = np.sqrt(np.diag(covariance))
    low = best - reach * rng.uniform(-2.0, 4.0, 5)
    high = low + reach * rng.uniform(1.0, 6.0, 5)
    root = np.linalg.cholesky(np.linalg.inv(covariance)).T
    exact = lsq_linear(root, root @ best, (low, high), tol=1e-14).x
    return likelihood, mean, information, exact, (low, high), reach


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("start", ["low", "high", "middle"])
def test_fit_within_bounds_is_scipys(seed, start) -> None:
    likelihood, mean, information, exact, (low, high), reach = boxed(seed)
    first = {"low": low, "high": high, "middle": 0.5 * (low + high)}[start]
    found = fit(likelihood, first, mean, information, (low, high), tolerance=1e-12)
    assert ((found.theta >= low) & (found.theta <= high)).all()
    # costs alike to 1e-12 of some hundred: 1e-5 standard deviations
    np.testing.assert_allclose(found.theta / reach, exact / reach, atol=1e-4)


def test_some_bounds_hold_and_some_do_not() -> None:
    """Or the test above would show nothing."""
    held = [np.isclose(x, b).any() for s in range(8) for *_, x, b, _ in [boxed(s)]]
    assert sum(held) >= 4
    free = [
        ((x > low + 1e-9) & (x < high - 1e-9)).any()
        for s in range(8)
        for *_, x, (low, high), _ in [boxed(s)]
    ]
    assert sum(free) >= 4


def test_wide_bounds_change_nothing() -> None:
    likelihood, mean, information, *_ = linear(2)
    start = np.full(5, 3.0)
    wide = (np.full(5, -1e9), np.full(5, 1e9))
    found, plain = (fit(likelihood, start, mean, information, b) for b in (wide, None))
    np.testing.assert_array_equal(found.theta, plain.theta)
    assert found.cost == plain.cost


def test_a_start_within_reach_takes_one_step_on_a_linear_problem() -> None:
    likelihood, mean, information, best, *_ = linear(4)
    near, far = (
        fit(likelihood, best + away, mean, information, tolerance=1e-10) for away in (0.5, 50.0)
    )
    assert near.iterations <= 2 < far.iterations
    np.testing.assert_allclose(far.theta, best, atol=1e-6)


def test_a_bound_does_not_make_a_step_lead_uphill() -> None:
    """Two parameters that trade against each other, and a bound on one of them.

    A step along the valley that is cut off at the bound would leave the other far up its side.
    """
    design = np.array([[1.0, 1.0], [0.0, 0.01]])
    data = np.array([1.0, 1.0])

    def likelihood(theta):
        r = 100.0 * (design @ theta - data)
        return 0.5 * float(r @ r), 100.0 * design.T @ r, 1e4 * design.T @ design

    bounds = (np.full(2, -200.0), np.array([200.0, 0.2]))
    found = fit(
        likelihood, np.array([1.0, 0.0]), np.zeros(2), 1e-9 * np.eye(2), bounds, tolerance=1e-10
    )
    np.testing.assert_allclose(found.theta, [0.8, 0.2], atol=1e-4)
    assert found.iterations <= 2


@pytest.mark.parametrize("seed", range(6))
def test_bounded_step_meets_the_conditions_of_a_least_value(seed) -> None:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(6, 6))
    curvature, gradient = root @ root.T + 0.01 * np.eye(6), 3.0 * rng.normal(size=6)
    low, high = -rng.uniform(0.0, 1.0, 6), rng.uniform(0.0, 1.0, 6)
    step = bounded_step(curvature, gradient, low, high)
    at_low, at_high = step < low + 1e-9, step > high - 1e-9
    assert (at_low | at_high).any()
    assert ((step > low - 1e-9) & (step < high + 1e-9)).all()
    slope = gradient + curvature @ step
    assert np.abs(slope[~at_low & ~at_high]).max(initial=0.0) < 1e-8
    assert (slope[at_low] > -1e-8).all() and (slope[at_high] < 1e-8).all()


def test_no_more_steps_than_allowed() -> None:
    calls = []
    likelihood, mean, information, *_ = linear(5)

    def counted(theta):
        calls.append(theta)
        return likelihood(theta)

    found = fit(counted, np.full(5, 5.0), mean, information, iterations=2, tolerance=0.0)
    assert found.iterations == 2
    assert len(calls) == 3  # and the one at the start


def test_a_parameter_is_let_go_when_the_gradient_turns() -> None:
    """In a bent valley the minimum is inside, but the way begins along the bound."""

    def likelihood(theta):
        r = np.array([10 * (theta[1] - theta[0] ** 2), 1 - theta[0]])
        j = np.array([[-20 * theta[0], 10.0], [-1.0, 0.0]])
        return 0.5 * float(r @ r), j.T @ r, j.T @ j

    bounds = (np.array([-2.0, 0.5]), np.array([2.0, 3.0]))
    found = fit(
        likelihood, np.array([0.2, 0.5]), np.ones(2), 1e-6 * np.eye(2), bounds, tolerance=1e-10
    )
    np.testing.assert_allclose(found.theta, 1.0, atol=1e-3)


def test_steps_to_where_the_prediction_runs_away_are_taken_back() -> None:
    """The likelihood is infinite beyond 1.2; Gauss-Newton's first step would go to 3."""

    def likelihood(theta):
        if theta[0] > 1.2:
            return np.inf, np.full(1, np.nan), np.full((1, 1), np.nan)
        r = theta**3 - 1.0
        j = 3 * theta**2
        return 0.5 * float(r @ r), j * r, np.outer(j, j)

    found = fit(likelihood, np.array([0.35]), np.zeros(1), 1e-9 * np.eye(1))
    assert found.theta[0] == pytest.approx(1.0, abs=0.01)


def test_a_start_that_runs_away_is_an_error() -> None:
    away = lambda theta: (np.inf, np.zeros(1), np.zeros((1, 1)))  # noqa: E731
    with pytest.raises(NumericsError, match="diverges") as caught:
        fit(away, np.zeros(1), np.zeros(1), np.eye(1))
    assert caught.value.exit_code == 5


def test_a_start_that_leads_to_no_less_than_asked_for_is_given_up() -> None:
    """Of a linear problem the first step knows the least cost there is."""
    likelihood, mean, information, best, *_ = linear(2)
    start, least = best + 10.0, fit(likelihood, best, mean, information).cost
    with pytest.raises(NumericsError, match="leads nowhere"):
        fit(likelihood, start, mean, information, ceiling=least - 0.01)
    free, found = (
        fit(likelihood, start, mean, information, ceiling=c) for c in (np.inf, least + 0.01)
    )
    np.testing.assert_array_equal(found.theta, free.theta)  # and no other digit changes


def test_a_singular_curvature_is_an_error() -> None:
    """The second parameter has neither data nor prior."""

    def likelihood(theta):
        return 0.5 * (theta[0] - 1) ** 2, np.array([theta[0] - 1, 0.0]), np.diag([1.0, 0.0])

    with pytest.raises(NumericsError, match="singular"):
        fit(likelihood, np.zeros(2), np.zeros(2), np.zeros((2, 2)))


# --- correlation time ----------------------------------------------------------------------


def autoregressive(a: float, n: int, rng: np.random.Generator) -> np.ndarray:
    from scipy.signal import lfilter

    x, _ = lfilter([1.0], [1.0, -a], rng.normal(size=n), zi=[a * rng.normal() / np.sqrt(1 - a * a)])
    return x


@pytest.mark.parametrize("a", [0.5, 0.8, 0.95])
def test_correlation_time_of_an_autoregression(a) -> None:
    closed = (1 + a) / (1 - a)
    ratio = np.array(
        [
            correlation_time(autoregressive(a, 20_000, np.random.default_rng(seed)), 600) / closed
            for seed in range(60)
        ]
    )
    # The sum ends at the first zero of a noisy autocorrelation: it scatters (19 % at a = 0.95,
    # where the record holds 500 correlation times) and is some percent high, since positive
    # excursions are counted and negative ones not (measured +1, +3, +8 %).
    assert 0.95 < ratio.mean() < 1.15
    assert ratio.std() < 0.25


def test_correlation_time_of_white_noise_is_about_one() -> None:
    found = [
        correlation_time(np.random.default_rng(seed).normal(size=20_000), 600) for seed in range(20)
    ]
    assert min(found) >= 1.0
    # only positive lags up to the first zero count: a bias of about 2 / sqrt(n) = 0.014
    assert np.mean(found) < 1.03
    # a lag above zero adds 1.6 / sqrt(n); 17 in a row come once in 100 000 records
    assert max(found) < 1.2


def test_correlation_time_of_a_constant_is_all_lags_looked_at() -> None:
    n, longest = 2000, 50
    # autocorrelation of a box: 1 - k / n
    closed = 1 + 2 * sum(1 - k / n for k in range(1, longest))
    assert correlation_time(np.ones(n), longest) == pytest.approx(closed, rel=1e-9)


@pytest.mark.parametrize("residual", [np.zeros(10), np.full(10, np.nan)])
def test_nothing_to_correlate_counts_as_white(residual) -> None:
    assert correlation_time(residual, 5) == 1.0


@pytest.mark.parametrize("residual", [np.zeros(0), np.full(7, np.nan)])
def test_correlation_time_of_nothing_is_that_of_white_noise(residual) -> None:
    assert correlation_time(residual, 5) == 1.0


def test_correlation_time_does_not_depend_on_the_unit() -> None:
    x = autoregressive(0.7, 3000, np.random.default_rng(0))
    assert correlation_time(1e-9 * x, 300) == pytest.approx(correlation_time(x, 300), rel=1e-9)
