"""From mode to mean: a common scale that the data cannot see, against the integral."""

import numpy as np
import pytest
from scipy.linalg import qr

from auvident.estimation.output_error import fit
from auvident.estimation.posterior_mean import FARTHEST, _basis_of, move_to_mean

PRIOR = np.array([12.0, -8.0, 6.0, 9.0, -10.0, 7.0])  # means, in prior standard deviations
N, SHARP = len(PRIOR), 1e-3
EVERYTHING = range(N)


def ratios_of(values: np.ndarray) -> np.ndarray:
    return values[1:] / values[0]


def likelihood_of_ratios(seen: np.ndarray, base: np.ndarray):
    """Ratios to the first parameter, seen with a sharp eye; theta are deviations from `base`."""

    def likelihood(theta):
        p = base + theta
        error = (ratios_of(p) - seen) / SHARP
        slopes = np.zeros((N - 1, N))
        slopes[:, 0] = -p[1:] / p[0] ** 2 / SHARP
        slopes[np.arange(N - 1), np.arange(1, N)] = 1.0 / p[0] / SHARP
        return 0.5 * float(error @ error), slopes.T @ error, slopes.T @ slopes

    return likelihood


def mode_of(seen: np.ndarray) -> np.ndarray:
    found = fit(
        likelihood_of_ratios(seen, PRIOR), np.zeros(N), np.zeros(N), np.eye(N), tolerance=1e-12
    )
    return PRIOR + found.theta


def mean_of(seen: np.ndarray) -> np.ndarray:
    """By the integral over the scale; the volume of the wedge grows with its power n - 1."""
    along = np.concatenate([[1.0], seen])
    scale = np.linspace(0.01, 3.0, 20001) * PRIOR[0]
    away = scale[:, None] * along - PRIOR
    log_density = -0.5 * (away**2).sum(axis=1) + (N - 1) * np.log(scale)
    weight = np.exp(log_density - log_density.max())
    return float(weight @ scale / weight.sum()) * along


def moved_from(mode: np.ndarray, seen: np.ndarray, columns=EVERYTHING) -> np.ndarray:
    return move_to_mean(likelihood_of_ratios(seen, mode), np.eye(N), columns)


@pytest.mark.parametrize("seed", range(6))
def test_the_move_is_from_the_mode_to_the_mean_of_the_integral(seed) -> None:
    truth = PRIOR + np.random.default_rng(seed).normal(size=N)
    seen = ratios_of(truth)
    mode, mean = mode_of(seen), mean_of(seen)
    wanted = float(np.linalg.norm(mean - mode))
    assert wanted > 0.1  # [prior standard deviations] there is something to find
    # Laplace: to first order; the next is (n - 1) over the squared length of the prior, 1 %
    apart = np.linalg.norm(mode + moved_from(mode, seen) - mean)
    assert apart < 0.05 * wanted


def test_over_many_truths_the_mode_is_too_small_and_the_mean_is_not() -> None:
    rng, modes, means = np.random.default_rng(7), [], []
    for _ in range(1000):
        truth = PRIOR + rng.normal(size=N)
        seen = ratios_of(truth)
        mode = mode_of(seen)
        modes.append(mode[0] / truth[0] - 1.0)
        means.append((mode + moved_from(mode, seen))[0] / truth[0] - 1.0)
    error = np.std(means) / np.sqrt(len(means))
    assert np.mean(modes) < -5.0 * error
    assert abs(np.mean(means)) < 3.0 * error


def test_the_ratios_stay() -> None:
    truth = PRIOR + np.random.default_rng(3).normal(size=N)
    seen = ratios_of(truth)
    mode = mode_of(seen)
    after = mode + moved_from(mode, seen)
    np.testing.assert_allclose(ratios_of(after), ratios_of(mode), atol=3 * SHARP)


def test_where_the_information_is_the_same_everywhere_nothing_moves() -> None:
    design = np.random.default_rng(0).normal(size=(3, 5))

    def linear(theta):
        r = design @ theta
        return 0.5 * float(r @ r), design.T @ r, design.T @ design

    np.testing.assert_allclose(move_to_mean(linear, np.eye(5), range(5)), 0.0, atol=1e-9)


def test_only_the_columns_named_move() -> None:
    """A parameter beside them, whose information jumps from one place to the next."""
    truth = PRIOR + np.random.default_rng(4).normal(size=N)
    mode = mode_of(ratios_of(truth))
    ratios, jumps = likelihood_of_ratios(ratios_of(truth), mode), np.random.default_rng(0)

    def likelihood(theta):
        half, gradient, curvature = ratios(theta[:N])
        whole = np.zeros((N + 1, N + 1))
        whole[:N, :N], whole[N, N] = curvature, jumps.uniform(0.0, 10.0)
        return half, np.append(gradient, 0.0), whole

    move = move_to_mean(likelihood, np.eye(N + 1), EVERYTHING)
    assert move[N] == 0.0
    np.testing.assert_allclose(move[:N], moved_from(mode, ratios_of(truth)), atol=1e-6)


def test_beside_a_place_where_the_prediction_runs_away_nothing_moves() -> None:
    truth = PRIOR + np.random.default_rng(5).normal(size=N)
    mode, calm = mode_of(ratios_of(truth)), likelihood_of_ratios(ratios_of(truth), PRIOR)

    def runs_away(theta):
        if theta.any():
            return np.inf, np.zeros(N), np.zeros((N, N))
        return calm(mode - PRIOR)

    assert not move_to_mean(runs_away, np.eye(N), EVERYTHING).any()


def test_no_move_is_longer_than_the_expansion_can_tell() -> None:
    def steep(theta):  # an information that doubles with every thousandth of a deviation
        return 0.0, np.zeros(1), np.array([[0.01 * 2.0 ** float(1000.0 * theta[0])]])

    move = move_to_mean(steep, np.eye(1), [0])
    assert abs(move[0]) == pytest.approx(FARTHEST, rel=0.01)
    assert move[0] < 0.0


@pytest.mark.parametrize("count", [1, 4, 9])
def test_the_basis_of_a_space_is_that_of_a_pivoted_decomposition(count: int) -> None:
    drawn = np.random.default_rng(count).normal(size=(12, count))
    space = np.linalg.qr(drawn)[0]
    projection = space @ space.T
    expected = qr(projection, pivoting=True)[0][:, :count]
    assert _basis_of(projection, count) == pytest.approx(expected, abs=1e-12)
