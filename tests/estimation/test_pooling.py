"""Pooling against a joint fit of all readings, and its claims against drawn truths."""

import numpy as np
import pytest

from auvident.estimation.pooling import (
    TrialData,
    agreement,
    agreements,
    between_neighbours,
    between_trials,
    distance,
    for_few,
    pooled,
    scattered,
    shrunk,
    spread_over,
    told_by,
    without_prior,
)

N, OWN = 5, 2  # parameters of the vehicle, and of each trial


def posterior(design, readings, variance):
    """Mean and covariance of a linear model with unit noise and the prior N(0, variance)."""
    covariance = np.linalg.inv(design.T @ design + np.diag(1.0 / variance))
    return covariance @ design.T @ readings, covariance


def trials_of(rng, count, between=None, rows=12, truth=None):
    """Linear trials: what each design has of the vehicle and of itself, and its readings."""
    truth = rng.normal(size=N) if truth is None else truth
    scatter = np.zeros(N) if between is None else between
    found = []
    for _ in range(count):
        design = rng.normal(size=(rows, N + OWN)) * np.array([3.0, 2.0, 1.0, 1.0, 0.3, 1.0, 1.0])
        p = np.concatenate([truth + np.sqrt(scatter) * rng.normal(size=N), rng.normal(size=OWN)])
        found.append((design, design @ p + rng.normal(size=rows)))
    return truth, found


def told(design, readings, variance=None):
    variance = np.ones(N + OWN) if variance is None else variance
    mean, covariance = posterior(design, readings, variance)
    return told_by(mean[:N], covariance[:N, :N], np.zeros(N), variance[:N])


def test_trials_add_up_to_the_fit_of_all_readings_with_their_own_parameters() -> None:
    rng = np.random.default_rng(1)
    _, trials = trials_of(rng, 4)
    found = pooled([told(*t) for t in trials], np.zeros(N), np.ones(N))
    blocks = [np.zeros((len(y), N + OWN * len(trials))) for _, y in trials]
    for k, ((design, _), block) in enumerate(zip(trials, blocks, strict=True)):
        block[:, :N] = design[:, :N]
        block[:, N + OWN * k : N + OWN * (k + 1)] = design[:, N:]
    joint = np.vstack(blocks)
    mean, covariance = posterior(
        joint, np.concatenate([y for _, y in trials]), np.ones(joint.shape[1])
    )
    assert found.mean == pytest.approx(mean[:N], rel=1e-9)
    assert found.covariance == pytest.approx(covariance[:N, :N], rel=1e-9, abs=1e-12)


def test_the_unit_and_the_prior_of_each_trial_do_not_matter() -> None:
    rng = np.random.default_rng(2)
    _, trials = trials_of(rng, 3)
    wide = np.array([4.0, 1.0, 9.0, 1.0, 2.0, 1.0, 1.0])
    same = [told(*t, np.concatenate([wide[:N], np.ones(OWN)])) for t in trials]
    plain = [told(*t) for t in trials]
    for a, b in zip(same, plain, strict=True):
        assert a.information == pytest.approx(b.information, rel=1e-8, abs=1e-10)
        assert a.score == pytest.approx(b.score, rel=1e-8, abs=1e-10)


def test_from_where_parameters_count_does_not_matter() -> None:
    """The same posterior about another origin: the prior's mean moves along, the data do not."""
    covariance, shift = np.array([[0.3, 0.1], [0.1, 0.2]]), np.array([5.0, -2.0])
    there = told_by(np.array([1.0, 2.0]) + shift, covariance, shift, np.ones(2))
    here = told_by(np.array([1.0, 2.0]), covariance, np.zeros(2), np.ones(2))
    assert there.information == pytest.approx(here.information)
    assert there.score == pytest.approx(here.score + here.information @ shift)


def test_a_posterior_wider_than_its_prior_counts_as_no_data_and_is_told() -> None:
    covariance = np.diag([0.5, 1.25])
    found = told_by(np.array([1.0, 2.0]), covariance, np.zeros(2), np.ones(2))
    assert found.clipped == pytest.approx(0.2)
    assert found.information == pytest.approx(np.diag([1.0, 0.0]))
    assert found.score == pytest.approx([2.0, 0.0])


def test_what_a_trial_lacks_is_left_to_the_others() -> None:
    rng = np.random.default_rng(3)
    _, trials = trials_of(rng, 2)
    whole, partial = told(*trials[0]), told_by(np.ones(2), np.eye(2) * 0.1, np.zeros(2), np.ones(2))
    found = pooled([whole, spread_over(partial, [1, 3], N)], np.zeros(N), np.ones(N))
    alone = pooled([whole], np.zeros(N), np.ones(N))
    assert found.covariance[1, 1] < alone.covariance[1, 1]
    assert np.all(np.diag(found.covariance) <= np.diag(alone.covariance) + 1e-12)


def test_scatter_between_trials_takes_from_a_trial_what_it_says_of_the_vehicle() -> None:
    rng = np.random.default_rng(4)
    one = told(*trials_of(rng, 1)[1][0])
    between = np.array([0.0, 0.3, 0.0, 2.0, 0.0])
    found = scattered(one, between)
    expected = np.linalg.inv(np.linalg.inv(one.information) + np.diag(between))
    assert found.information == pytest.approx(expected, rel=1e-8, abs=1e-10)
    estimate = np.linalg.solve(one.information, one.score)
    assert found.score == pytest.approx(expected @ estimate, rel=1e-8, abs=1e-9)


@pytest.mark.parametrize("between", [0.0, 0.2], ids=["trials agree", "trials differ"])
def test_errors_are_as_large_as_claimed(between: float) -> None:
    rng, squares = np.random.default_rng(5), []
    scatter = np.array([between, 0.0, between, 0.0, 0.0])
    for _ in range(100):
        truth, trials = trials_of(rng, 6, scatter)
        own = [told(*t) for t in trials]
        found = pooled(own, np.zeros(N), np.ones(N), for_few(between_trials(own), 6))
        values, vectors = np.linalg.eigh(found.covariance)
        squares.append((vectors.T @ (found.mean - truth)) ** 2 / values)
    assert 0.8 < np.mean(squares) < 1.25


@pytest.mark.parametrize(("size", "trials"), [(4, 6), (22, 12)])
def test_errors_are_as_large_as_claimed_where_every_parameter_scatters(
    size: int, trials: int
) -> None:
    """Of moments alone the squared errors were 5.9 and 2.3 times as large as claimed."""
    rng, squares = np.random.default_rng(8), []
    for _ in range(60):
        truth, rows = rng.normal(size=size), []
        for _ in range(trials):
            design = 20.0 * rng.normal(size=(size + 2, size))
            information = design.T @ design
            own = truth + np.sqrt(0.25) * rng.normal(size=size)
            noise = design.T @ rng.normal(size=size + 2)
            rows.append(TrialData(information, information @ own + noise))
        between = for_few(between_trials(rows), trials)
        found = pooled(rows, np.zeros(size), np.ones(size), between)
        squares.append((found.mean - truth) ** 2 / np.diag(found.covariance))
    assert 0.8 < np.mean(squares) < 1.25


def test_scatter_between_trials_is_found_where_it_is() -> None:
    rng, found, near = np.random.default_rng(6), [], []
    scatter = np.array([0.0, 0.5, 0.0, 0.5, 0.0])
    for _ in range(30):
        _, trials = trials_of(rng, 12, scatter, rows=30)
        own = [told(*t) for t in trials]
        found.append(between_trials(own))
        near.append(between_neighbours(own))
    assert np.mean(found, axis=0) == pytest.approx(scatter, abs=0.1)
    assert np.mean(near, axis=0) == pytest.approx(scatter, abs=0.15)


def test_one_parameter_that_scatters_is_seen_among_many_that_do_not() -> None:
    """Twenty agree to the last digit, so that all together scatter less than chance has them."""
    information, away = 100.0 * np.eye(20), 0.4 * np.eye(20)[0]
    own = [TrialData(information, information @ (side * away)) for side in (-1.0, 0.0, 1.0)]
    assert agreement(own).p > 0.5 and agreements(own)[0].p < 1.0e-4
    between = between_trials(own)
    assert between[0] > 0.05 and not between[1:].any()


def test_neighbours_do_not_take_a_step_for_scatter() -> None:
    rng = np.random.default_rng(7)
    truth = rng.normal(size=N)
    before = trials_of(rng, 10, rows=30, truth=truth)[1]
    after = trials_of(rng, 10, rows=30, truth=truth + np.array([0.0, 2.0, 0.0, 0.0, 0.0]))[1]
    own = [told(*t) for t in (*before, *after)]
    assert between_trials(own)[1] > 0.5
    assert between_neighbours(own)[1] < 0.1


def test_trials_of_one_vehicle_agree_and_those_of_two_do_not() -> None:
    rng = np.random.default_rng(8)
    p, each = [], []
    for _ in range(60):
        own = [told(*t) for t in trials_of(rng, 5)[1]]
        p.append(agreement(own).p)
        each.append([a.p for a in agreements(own)])
    assert 0.35 < np.mean(p) < 0.65
    assert 0.35 < np.mean(each) < 0.65
    truth = np.zeros(N)
    other = [told(*t) for t in trials_of(rng, 1, truth=truth + 3.0, rows=30)[1]]
    same = [told(*t) for t in trials_of(rng, 6, truth=truth, rows=30)[1]]
    found = distance(other[0], same, np.zeros(N))
    assert found.p < 1e-6 and found.rest > 0.1 * found.square
    assert distance(same[0], same[1:], np.zeros(N)).p > 1e-3


def test_one_parameter_that_differs_is_named() -> None:
    rng, truth = np.random.default_rng(9), np.zeros(N)
    moved = np.array([0.0, 0.0, 3.0, 0.0, 0.0])
    other = told(*trials_of(rng, 1, truth=truth + moved, rows=30)[1][0])
    same = [told(*t) for t in trials_of(rng, 6, truth=truth, rows=30)[1]]
    found = distance(other, same, np.zeros(N))
    assert found.parameters[0] == 2
    assert found.rest < 0.2 * found.square


def test_a_trial_leans_on_the_others_where_it_sees_nothing_itself() -> None:
    rng = np.random.default_rng(10)
    _, trials = trials_of(rng, 8, rows=30)
    own = [told(*t) for t in trials]
    blind = TrialData(np.diag([50.0, 0.0, 0.0, 0.0, 0.0]), np.array([50.0, 0.0, 0.0, 0.0, 0.0]))
    others = pooled(own, np.zeros(N), np.ones(N))
    between = np.array([4.0, 0.0, 0.0, 0.0, 0.0])
    found = shrunk(blind, others, between)
    assert found.mean[0] == pytest.approx(1.0, abs=0.05)  # its own value, as trials differ there
    assert found.mean[1:] == pytest.approx(others.mean[1:], abs=0.1)
    assert without_prior(own).mean == pytest.approx(others.mean, abs=0.3)
