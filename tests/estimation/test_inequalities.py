"""Steps within inequalities: optimal, nearest points in closed form, nothing moved inside."""

import numpy as np
import pytest

from auvident.estimation.inequalities import (
    INSIDE,
    from_where_it_stands,
    kept,
    nearest,
    none,
    prices,
    quadratic_step,
)
from auvident.estimation.output_error import fit

EVERYWHERE = np.full(3, -np.inf), np.full(3, np.inf)
ROOT = np.sqrt(0.5)  # (a, b, c) has the Frobenius norm of [[a, b ROOT], [b ROOT, c]]


def semi_definite(theta):
    """Least eigenvalue of [[a, b ROOT], [b ROOT, c]] and its slopes."""
    a, b, c = theta
    values, vectors = np.linalg.eigh([[a, b * ROOT], [b * ROOT, c]])
    x, y = vectors[:, 0]
    return values[:1], np.array([[x * x, 2.0 * x * y * ROOT, y * y]])


def clipped(theta):
    """The nearest positive semi-definite matrix (Higham 1988): negative eigenvalues made zero."""
    a, b, c = theta
    values, vectors = np.linalg.eigh([[a, b * ROOT], [b * ROOT, c]])
    matrix = vectors @ np.diag(np.maximum(values, 0.0)) @ vectors.T
    return np.array([matrix[0, 0], matrix[0, 1] / ROOT, matrix[1, 1]])


def problem(seed: int):
    """A quadratic function of up to 25 parameters within bounds and five inequalities."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(5, 26))
    rows = rng.normal(size=(2 * n, n))
    curvature = rows.T @ rows * 10.0 ** rng.uniform(-2, 5) + np.eye(n)
    gradient = rng.normal(size=n) * 10.0 ** rng.uniform(0, 5)
    low, high = -np.abs(rng.normal(size=n)), np.abs(rng.normal(size=n))
    return (
        curvature,
        gradient,
        low,
        high,
        rng.normal(size=(5, n)),
        -0.1 * np.abs(rng.normal(size=5)),
    )


@pytest.mark.parametrize("least", [0.0, -1e-9])
def test_an_inequality_without_anything_free_holds_nothing(least) -> None:
    """At its edge the row is all zeros."""
    gradient, free = np.array([1.0, -2.0, 0.0]), np.full(3, np.inf)
    tangents = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
    bound = np.array([least, 0.0])
    step, pull = quadratic_step(np.eye(3), gradient, -free, free, tangents, bound)
    np.testing.assert_allclose(step, [0.0, 2.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(pull, [0.0, 1.0], atol=1e-12)


@pytest.mark.parametrize("seed", range(40))
def test_a_quadratic_step_fulfils_the_conditions_of_optimality(seed) -> None:
    curvature, gradient, low, high, tangents, least = problem(seed)
    step, pull = quadratic_step(curvature, gradient, low, high, tangents, least)
    assert (tangents @ step >= least - 1e-9).all()
    assert (step >= low - 1e-9).all() and (step <= high + 1e-9).all()
    slope = (curvature @ step + gradient - tangents.T @ pull) / np.abs(gradient).max()
    below, above = step < low + 1e-7, step > high - 1e-7
    # rounding: the factor of a curvature with a condition of 1e6
    assert np.abs(slope[~below & ~above]).max(initial=0.0) < 1e-6
    assert slope[below].min(initial=0.0) > -1e-6 and slope[above].max(initial=0.0) < 1e-6
    assert (pull >= 0.0).all()
    assert np.abs(pull * (tangents @ step - least)).max() < 1e-6 * np.abs(gradient).max()


def test_without_a_row_the_step_is_newtons() -> None:
    curvature, gradient, *_ = problem(1)
    free = np.full(len(gradient), np.inf)
    step, _ = quadratic_step(curvature, gradient, -free, free, *none(gradient)[::-1])
    np.testing.assert_allclose(step, -np.linalg.solve(curvature, gradient), rtol=1e-8)


@pytest.mark.parametrize("seed", range(40))
def test_the_nearest_semi_definite_matrix(seed) -> None:
    theta = np.random.default_rng(seed).normal(size=3)
    found = nearest(semi_definite, theta, np.eye(3), *EVERYWHERE)
    assert semi_definite(found)[0] >= 0.0
    np.testing.assert_allclose(found, clipped(theta), atol=5.0 * np.sqrt(INSIDE))


def test_what_is_inside_does_not_move_at_all() -> None:
    theta, step = np.array([2.0, 0.1, 1.0]), np.array([0.3, -0.2, -0.5])
    assert nearest(semi_definite, theta, np.eye(3), *EVERYWHERE) is theta
    assert kept(semi_definite, theta, step, np.eye(3), -step, *EVERYWHERE) is step
    assert not prices(semi_definite, theta, np.eye(3), np.zeros(3), *EVERYWHERE).any()


def towards(aim, curvature):
    """Likelihood of a measurement of theta itself."""
    return lambda theta: (
        0.5 * float((theta - aim) @ curvature @ (theta - aim)),
        curvature @ (theta - aim),
        curvature,
    )


@pytest.mark.parametrize("seed", range(20))
def test_a_fit_whose_optimum_is_outside_ends_inside_at_the_best_point(seed) -> None:
    rng = np.random.default_rng(seed)
    aim = np.array([1.0 + rng.uniform(), 0.3 * rng.normal(), -rng.uniform(0.1, 2.0)])
    data = towards(aim, 1e4 * np.eye(3))
    start, weak = np.array([1.0, 0.0, 1.0]), 1e-6 * np.eye(3)
    found = fit(data, start, aim, weak, tolerance=1e-12, inequalities=semi_definite)
    assert semi_definite(found.theta)[0] >= 0.0
    # along its edge the set bends away with the square of the distance
    np.testing.assert_allclose(found.theta, clipped(aim), atol=5.0 * np.sqrt(INSIDE))
    # a quadratic posterior: the price is all that the constraint costs, up to its curved edge
    lost = data(found.theta)[0]
    assert found.prices.sum() == pytest.approx(lost, rel=0.05)


def test_a_fit_that_stays_inside_is_the_one_without_inequalities() -> None:
    aim, start, prior = np.array([1.0, 0.2, 0.5]), np.array([2.0, 0.0, 2.0]), np.eye(3)
    data = towards(aim, 50.0 * np.eye(3))
    plain, within = (
        fit(data, start, aim, prior, inequalities=rows) for rows in (none, semi_definite)
    )
    np.testing.assert_array_equal(plain.theta, within.theta)
    np.testing.assert_array_equal(plain.covariance, within.covariance)
    assert not within.prices.any()


def test_a_start_outside_is_moved_inside() -> None:
    aim = np.array([1.0, 0.0, 0.4])
    found = fit(
        towards(aim, np.eye(3)),
        np.array([1.0, 0.0, -3.0]),
        aim,
        np.eye(3),
        inequalities=semi_definite,
    )
    np.testing.assert_allclose(found.theta, aim, atol=1e-4)


def test_what_cannot_be_kept_is_not_broken_any_further() -> None:
    def half_plane(theta):
        return theta[:1] - 1.0, np.array([[1.0, 0.0, 0.0]])

    there = from_where_it_stands(half_plane, np.array([0.5, 0.0, 0.0]))
    assert there(np.array([0.5, 3.0, 0.0]))[0] == pytest.approx(0.0)
    assert there(np.array([0.4, 0.0, 0.0]))[0] < 0.0
    assert from_where_it_stands(half_plane, np.array([2.0, 0.0, 0.0])) is half_plane
