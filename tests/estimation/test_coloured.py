"""Coloured residuals against the dense Gaussian, and in the statistics of long series."""

import math

import numpy as np
import pytest
from scipy.stats import chi2, multivariate_normal

from auvident.estimation.coloured import TIMES_S, Colour, colour_of, whiten

DT = 0.1
COLOUR = Colour(white=0.5, slow=1.2, time_s=2.0)


def keep_of(colour: Colour) -> float:
    return math.exp(-DT / colour.time_s)


def dense(n: int, colour: Colour) -> np.ndarray:
    """Covariance of white noise and an Ornstein-Uhlenbeck process on a grid."""
    apart = DT * np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    slow = colour.slow**2 * np.exp(-apart / colour.time_s)
    return colour.white**2 * np.eye(n) + slow


def series(n: int, colour: Colour, seed: int = 0) -> np.ndarray:
    """Such a series, step by step."""
    rng, keep = np.random.default_rng(seed), keep_of(colour)
    kicks = rng.normal(size=n) * colour.slow * math.sqrt(1.0 - keep**2)
    slow = np.empty(n)
    slow[0] = colour.slow * rng.normal()
    for k in range(1, n):
        slow[k] = keep * slow[k - 1] + kicks[k]
    return slow + colour.white * rng.normal(size=n)


def gaps(n: int) -> np.ndarray:
    """Rows with a reading: single drop-outs, a start and an end without, and a long gap."""
    seen = np.random.default_rng(1).random(n) > 0.2
    seen[:3], seen[-2:], seen[n // 2 : n // 2 + n // 5] = False, False, False
    return seen


def white(values: np.ndarray, seen: np.ndarray, colour: Colour) -> tuple[np.ndarray, float]:
    out = np.where(seen[:, None], values, 0.0)
    total = whiten(out, seen, keep_of(colour), colour.white, colour.slow)
    return out, total


@pytest.mark.parametrize("missing", [False, True], ids=["whole", "with gaps"])
def test_whitening_is_the_cholesky_factor_of_the_dense_covariance(missing) -> None:
    n = 80
    seen = gaps(n) if missing else np.ones(n, dtype=bool)
    values = np.random.default_rng(2).normal(size=(n, 4))
    found, logs = white(values, seen, COLOUR)
    factor = np.linalg.cholesky(dense(n, COLOUR)[np.ix_(seen, seen)])
    # 80 steps of rounding with a covariance of condition 200
    np.testing.assert_allclose(found[seen], np.linalg.solve(factor, values[seen]), atol=1e-11)
    assert not found[~seen].any()
    assert logs == pytest.approx(2.0 * np.log(np.diag(factor)).sum(), abs=1e-10)


def test_innovations_of_such_a_series_are_unit_and_white() -> None:
    n = 20000
    found, _ = white(series(n, COLOUR)[:, None], np.ones(n, dtype=bool), COLOUR)
    z = found[:, 0]
    low, high = chi2.ppf([0.001, 0.999], n) / n
    assert low < np.mean(z**2) < high
    for lag in (1, 2, 5, 20, 100):  # 1/sqrt(n) is one standard deviation
        assert abs(np.mean(z[lag:] * z[:-lag])) < 4.0 / math.sqrt(n)
    raw = series(n, COLOUR)
    assert np.mean(raw[1:] * raw[:-1]) / np.mean(raw**2) > 0.7  # before, they were not


def test_without_a_disturbance_whitening_divides_by_the_noise() -> None:
    values = np.random.default_rng(3).normal(size=(50, 2))
    found, logs = white(values, np.ones(50, dtype=bool), Colour(0.2, 0.0, 1.0))
    np.testing.assert_allclose(found, values / 0.2, rtol=1e-13)
    assert logs == pytest.approx(50 * math.log(0.04))


@pytest.mark.parametrize("missing", [False, True], ids=["whole", "with gaps"])
def test_the_log_likelihood_is_that_of_the_dense_gaussian(missing) -> None:
    pieces = [series(120, COLOUR, seed) for seed in range(3)]
    if missing:
        pieces = [np.where(gaps(120), piece, np.nan) for piece in pieces]
    colour, value = colour_of(pieces, DT)
    expected = 0.0
    for piece in pieces:
        seen = np.isfinite(piece)
        covariance = dense(120, colour)[np.ix_(seen, seen)]
        expected += multivariate_normal.logpdf(piece[seen], cov=covariance)
    assert value == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize(("ratio", "time"), [(1.0, 0.6), (3.0, 2.0), (9.0, 4.0)])
@pytest.mark.parametrize("seed", range(3))
def test_the_noise_is_recovered(ratio, time, seed) -> None:
    truth = Colour(0.01, ratio * 0.01, time)
    pieces = [series(1500, truth, 10 * seed + k) for k in range(6)]
    for piece in pieces:
        piece[300:350] = np.nan
    found, _ = colour_of(pieces, DT)
    near = TIMES_S[max(TIMES_S.index(time) - 1, 0) : TIMES_S.index(time) + 2]
    assert found.time_s in near  # of a coarse grid, one place to either side
    # where time and size trade against each other, the grid leaves a quarter; the variance of
    # the increments, which both give, is known far better
    assert found.white == pytest.approx(truth.white, rel=0.25)
    rate, expected = (c.slow / math.sqrt(c.time_s) for c in (found, truth))
    assert rate == pytest.approx(expected, rel=0.25)


def test_the_likelihood_is_highest_with_the_truth() -> None:
    pieces = [series(800, Colour(0.01, 0.03, 1.0), k) for k in range(4)]
    found, best = colour_of(pieces, DT)
    assert found.time_s == 1.0
    whites = sum(
        np.log(np.std(np.concatenate(pieces))) + 0.5 * np.log(2 * np.pi) + 0.5
        for piece in pieces
        for _ in piece
    )
    assert best > -whites + 1000.0  # all of it for white noise


def test_scale_goes_into_the_noise_and_nothing_else() -> None:
    pieces = [series(400, COLOUR, 5)]
    (one, first), (ten, second) = (colour_of([s * p for p in pieces], DT) for s in (1.0, 10.0))
    assert (ten.white, ten.slow) == pytest.approx((10 * one.white, 10 * one.slow))
    assert ten.time_s == one.time_s
    assert second == pytest.approx(first - 400 * math.log(10.0))


def test_where_nothing_was_measured_there_is_no_evidence() -> None:
    colour, value = colour_of([np.full(20, np.nan)], DT)
    assert (colour, value) == (Colour(1.0, 0.0, 1.0), 0.0)
    some = [series(200, COLOUR, 6)]
    assert colour_of([*some, np.full(20, np.nan)], DT) == colour_of(some, DT)


def test_a_residual_of_zero_is_no_infinity() -> None:
    colour, value = colour_of([np.zeros(100)], DT)
    assert math.isfinite(value)
    assert colour.white == 0.0


def test_white_noise_is_taken_for_hardly_anything_else() -> None:
    """Slow power 2 T slow^2 over that of the noise, DT white^2: by as much it widens a claim."""
    shares = []
    for seed in range(10):
        colour, _ = colour_of([np.random.default_rng(seed).normal(size=16_000)], DT)
        shares.append(2.0 * colour.time_s * colour.slow**2 / (DT * colour.white**2))
    # 400 correlation times of the slowest: its share has a standard deviation of
    # sqrt(8 T / duration) = 0.14, and 0.54, the least before, is nearly four of them
    assert np.median(shares) < 0.2 and max(shares) < 0.54
