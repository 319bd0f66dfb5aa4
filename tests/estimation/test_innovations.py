"""Residual analysis, on series of known statistics."""

import numpy as np
import pytest
from scipy import stats

from auvident.estimation.coloured import Colour, at_least, colour_of, colours_without_each, whitened
from auvident.estimation.innovations import (
    consistency,
    correlation_of,
    cross_correlation,
    lagged,
    normality,
    whiteness,
)

DT_S = 0.1


def ar1(rng: np.random.Generator, n: int, keep: float, std: float = 1.0) -> np.ndarray:
    """Ornstein-Uhlenbeck series with its stationary start."""
    x = np.empty(n)
    x[0] = rng.normal()
    for k in range(1, n):
        x[k] = keep * x[k - 1] + np.sqrt(1.0 - keep**2) * rng.normal()
    return std * x


def with_gaps(x: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return np.where(rng.random(len(x)) < 0.1, np.nan, x)


# --- Kolmogorov-Smirnov --------------------------------------------------------------------


def test_the_distance_and_its_probability_are_those_of_scipy() -> None:
    x = np.random.default_rng(1).normal(0.05, 1.0, 4000)
    found, expected = normality(x, 4000.0), stats.kstest(x, "norm", method="asymp")
    assert found.distance == pytest.approx(expected.statistic, rel=1e-12)
    assert found.p == pytest.approx(expected.pvalue, rel=1e-6)


def test_correlated_innovations_are_rejected_as_often_as_they_should_with_effective_samples() -> (
    None
):
    rng = np.random.default_rng(2)
    honest, naive = [], []
    for _ in range(300):
        pieces = [ar1(rng, 600, 0.8) for _ in range(4)]
        values = np.concatenate(pieces)
        effective = len(values) / correlation_of(pieces, 200)
        honest.append(normality(values, effective).p < 0.05)
        naive.append(normality(values, len(values)).p < 0.05)
    assert np.mean(naive) > 0.4
    # a sum of the autocorrelation is the longest time of any function of the series
    assert np.mean(honest) < 0.07


# --- whiteness -----------------------------------------------------------------------------


def test_lagged_products_by_hand() -> None:
    x = [np.array([1.0, np.nan, 3.0]), np.array([2.0])]
    y = [np.array([5.0, 7.0, np.nan]), np.array([1.0])]
    products, pairs = lagged(x, y, 2)
    # lag 0: 1*5 and 2*1; lag 1: x[2] y[1]; lag 2: x[2] y[0]
    np.testing.assert_allclose(products, [7.0, 21.0, 15.0], atol=1e-12)
    np.testing.assert_array_equal(pairs, [2.0, 1.0, 1.0])


def test_white_noise_has_one_lag_of_twenty_outside_its_band() -> None:
    rng = np.random.default_rng(3)
    found = [
        whiteness([with_gaps(rng.normal(size=500), rng) for _ in range(5)], 50) for _ in range(200)
    ]
    assert np.mean([f.outside for f in found]) == pytest.approx(0.05, abs=0.01)
    assert np.mean([f.p < 0.05 for f in found]) == pytest.approx(0.05, abs=0.04)


def test_a_coloured_series_is_not_white_and_its_largest_lag_is_told() -> None:
    rng = np.random.default_rng(4)
    found = whiteness([ar1(rng, 2000, 0.6) for _ in range(3)], 30)
    assert found.lag == 1 and found.largest == pytest.approx(0.6, abs=0.05)
    assert found.p < 1e-6 and found.outside > 0.1


def test_a_sensor_at_every_other_row_has_no_odd_lags() -> None:
    x = np.random.default_rng(5).normal(size=1000)
    x[::2] = np.nan
    found = whiteness([x], 20)
    assert found is not None and found.lag % 2 == 0
    assert whiteness([np.full(10, np.nan)], 5) is None


# --- correlation with an input -------------------------------------------------------------


def test_two_series_that_have_nothing_to_do_with_each_other_stay_within_the_band() -> None:
    rng = np.random.default_rng(6)
    beyond = []
    for _ in range(300):
        residual = [ar1(rng, 800, 0.95) for _ in range(4)]
        given = [ar1(rng, 800, 0.97) for _ in range(4)]
        found = cross_correlation(residual, given, 100)
        beyond.append(abs(found.largest) > found.band)
    # of the largest over all lags; that of one lag of white noise would be left in nearly all
    assert 0.01 < np.mean(beyond) < 0.09


def test_a_late_answer_to_an_input_is_found_at_its_lag() -> None:
    rng = np.random.default_rng(7)
    given = [ar1(rng, 1500, 0.95) for _ in range(3)]
    left = [np.concatenate([np.zeros(17), -0.5 * g[:-17]]) for g in given]
    residual = [with_gaps(x + 0.2 * rng.normal(size=1500), rng) for x in left]
    found = cross_correlation(residual, given, 100)
    assert found.lag == 17 and found.largest < -found.band < 0.0


def test_a_constant_input_correlates_with_nothing() -> None:
    x = [np.random.default_rng(8).normal(size=100)]
    assert cross_correlation(x, [np.full(100, 1500.0 / 60.0)], 10) is None


# --- size ----------------------------------------------------------------------------------


def test_inflated_noise_is_corrected_and_coloured_noise_is_not() -> None:
    rng = np.random.default_rng(9)
    pieces = [ar1(rng, 5000, 0.9) for _ in range(4)]
    time = correlation_of(pieces, 600)
    inflated = consistency([p / np.sqrt(time) for p in pieces], 600)
    assert inflated.corrected == pytest.approx(1.0, abs=0.15)
    assert inflated.normality.distance < 0.05
    plain = consistency(pieces, 600, inflated=False)
    assert plain.corrected == plain.mean == pytest.approx(1.0, abs=0.15)


def test_the_noise_of_the_others_whitens_a_record_and_shows_one_that_is_unlike_them() -> None:
    rng = np.random.default_rng(10)
    keep = np.exp(-DT_S / 2.0)
    pieces = [ar1(rng, 3000, keep, 3.0) + rng.normal(size=3000) for _ in range(4)]
    colours = colours_without_each(pieces, DT_S, 0.0)
    for k, colour in enumerate(colours):
        assert colour == colour_of(pieces[:k] + pieces[k + 1 :], DT_S)[0]
    white = [whitened(p, c, DT_S) for p, c in zip(pieces, colours, strict=True)]
    assert whiteness(white, 50).outside < 0.2
    found = consistency(white, 600, inflated=False)
    assert found.mean == pytest.approx(1.0, abs=0.1)
    # a record three times as noisy: its own noise would make it fit
    loud = [*pieces[:3], 3.0 * pieces[3]]
    colours = colours_without_each(loud, DT_S, 0.0)
    assert np.mean(whitened(loud[3], colours[3], DT_S) ** 2) > 5.0


def test_a_single_record_has_its_own_noise_and_none_is_below_the_least() -> None:
    x = np.random.default_rng(11).normal(size=500)
    (colour,) = colours_without_each([x], DT_S, 0.0)
    assert colour == colour_of([x], DT_S)[0]
    assert colours_without_each([np.zeros(50), np.zeros(50)], DT_S, 0.1)[0].white == 0.1
    assert at_least(Colour(1.0, 2.0, 3.0), 0.5) == Colour(1.0, 2.0, 3.0)
