"""Steps and drifts in drawn series: found with their size, and no more alarms than stated."""

import numpy as np
import pytest

from auvident.estimation.change import DRAWS, Scattering, search, search_from, series_along
from auvident.estimation.pooling import TrialData, between_neighbours

N = 4


def series(rng, count, change=lambda k: np.zeros(N)):
    """What trials say that each see other combinations well."""
    truth, found = rng.normal(size=N), []
    for k in range(count):
        design = rng.normal(size=(6, N)) * np.array([5.0, 3.0, 2.0, 1.0])
        information = design.T @ design
        noise = design.T @ rng.normal(size=6)
        found.append(TrialData(information, information @ (truth + change(k)) + noise))
    return found


def looked(trials, rng, false_alarms=0.01):
    return search(trials, np.eye(N), np.arange(len(trials)) * 1.0, rng, false_alarms)[0]


def test_false_alarms_are_as_rare_as_stated() -> None:
    rng = np.random.default_rng(1)
    alarms = sum(bool(looked(series(rng, 8), rng, 0.1).found) for _ in range(60))
    assert 1 <= alarms <= 13  # 6 expected; 99.8 % of cases


def test_scatter_estimated_from_few_trials_is_no_change() -> None:
    """Taken as known, it alarms in a third of the series at a stated 5 %."""
    rng, count, known, alarms = np.random.default_rng(5), 10, 0, 0
    times, certain = np.arange(count) * 1.0, 1.0e9
    for _ in range(40):
        moved = rng.uniform(0.3, 1.0) * rng.normal(size=(count, N))
        told = series(rng, count, lambda k, moved=moved: moved[k])
        taken = Scattering(told, between_neighbours(told), certain)
        known += bool(search_from(taken, np.eye(N), times, rng, 0.05).found)
        alarms += bool(looked(told, rng, 0.05).found)
    assert known >= 8
    assert alarms <= 5  # 2 expected; 98.6 % of cases


@pytest.mark.parametrize("size", [0.8, -1.2])
def test_a_step_is_found_with_its_trial_and_its_size(size: float) -> None:
    rng, squares = np.random.default_rng(2), []
    for _ in range(10):
        trials = series(rng, 16, lambda k: np.array([0.0, size * (k >= 9), 0.0, 0.0]))
        (found,) = looked(trials, rng).found
        assert (found.kind, found.direction) == ("step", 1)
        assert found.between[0] <= 9 <= found.between[1]
        assert found.p < 0.01
        squares.append(((found.size - size) / found.std) ** 2)
    assert np.mean(squares) < 2.0


def test_what_no_drawn_series_reaches_has_the_least_probability_and_not_none() -> None:
    rng = np.random.default_rng(7)
    (found,) = looked(series(rng, 16, lambda k: 5.0 * (k >= 9) * np.eye(N)[0]), rng).found
    assert found.p == 1.0 / (1 + DRAWS)


def test_a_drift_is_told_from_a_step() -> None:
    rng = np.random.default_rng(3)
    trials = series(rng, 20, lambda k: np.array([1.5 * k / 19, 0.0, 0.0, 0.0]))
    found = looked(trials, rng).found[0]
    assert (found.kind, found.direction) == ("drift", 0)
    assert found.size == pytest.approx(1.5, abs=3.0 * found.std)


def test_two_changes_are_found_one_after_the_other() -> None:
    rng = np.random.default_rng(4)

    def change(k):
        return np.array([1.0 * (k >= 5), 0.0, -2.0 * (k >= 12), 0.0])

    found = looked(series(rng, 18, change), rng).found
    assert {(f.direction, f.first) for f in found} == {(0, 5), (2, 12)}


def test_along_the_series_every_trial_shows_the_change() -> None:
    rng = np.random.default_rng(5)
    trials = series(rng, 12, lambda k: np.array([0.0, 3.0 * (k >= 6), 0.0, 0.0]))
    theta = looked(trials, rng).theta
    sizes = np.array([size for size, _ in series_along(trials, np.eye(N)[1], theta)])
    assert sizes[6:].mean() - sizes[:6].mean() == pytest.approx(3.0, abs=0.3)
    blind = TrialData(np.zeros((N, N)), np.zeros(N))
    assert series_along([blind], np.eye(N)[0], theta) == [(0.0, np.inf)]


def test_two_trials_are_no_series() -> None:
    rng = np.random.default_rng(6)
    assert looked(series(rng, 2), rng).found == ()
