"""Shares, correlations and unseen directions of made covariances."""

import numpy as np
import pytest

from auvident.estimation.identifiability import (
    SMALL_WEIGHT,
    UNSEEN_INFORMATION,
    correlations,
    data_shares,
    unseen_directions,
)


def test_data_share_is_what_the_variance_lost() -> None:
    covariance = np.diag([1.0, 0.25, 1e-6, 1.3])
    # 1.3: drift can leave a parameter less certain than its prior; no share is negative
    np.testing.assert_allclose(data_shares(covariance), [0.0, 0.75, 1 - 1e-6, 0.0], atol=1e-15)


def test_correlations_are_named_both_ways_from_a_threshold_on() -> None:
    matrix = np.array([[1.0, 0.9, 0.1], [0.9, 1.0, -0.4], [0.1, -0.4, 1.0]])
    spread = np.array([2.0, 0.1, 30.0])
    found = correlations(matrix * np.outer(spread, spread), ["a", "b", "c"])
    assert found == {"a": {"b": 0.9}, "b": {"a": 0.9, "c": -0.4}, "c": {"b": -0.4}}


def rotated(values, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Information with given eigenvalues, and its eigenvectors as columns."""
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(len(values), len(values))))
    return (q * np.array(values)) @ q.T, q


def test_unseen_directions_are_the_eigenvectors_of_little_information() -> None:
    information, q = rotated([0.2, 100.0, 0.01, 40.0])
    found = unseen_directions(information, [range(len(information))])
    assert [d.information for d in found] == pytest.approx([0.01, 0.2], rel=1e-9)
    for direction, column in zip(found, (2, 0), strict=True):
        # the largest component is +1, the others in proportion
        expected = q[:, column] / q[np.argmax(np.abs(q[:, column])), column]
        np.testing.assert_allclose(direction.weights, expected, atol=1e-9)
        assert direction.weights.max() == 1.0
        assert not direction.structural


def test_a_direction_that_was_seen_is_not_named() -> None:
    assert unseen_directions(np.eye(3) * UNSEEN_INFORMATION * 1.01, [range(3)]) == []
    assert len(unseen_directions(np.eye(3) * UNSEEN_INFORMATION * 0.99, [range(3)])) == 3


def test_the_common_scale_of_an_equation_is_structural() -> None:
    """A regression that is homogeneous in its parameters: A theta = 0 also at the truth."""
    rng = np.random.default_rng(4)
    truth = np.array([2.0, -1.0, 0.5])
    design = rng.normal(size=(500, 3))
    design -= np.outer(design @ truth, truth) / (truth @ truth)
    found = unseen_directions(design.T @ design, [range(3)])
    assert len(found) == 1
    assert found[0].structural
    # rounding of an eigenvalue of 500: information is never negative
    assert 0.0 <= found[0].information < 1e-9
    np.testing.assert_allclose(found[0].weights, [1.0, -0.5, 0.25], atol=1e-9)


def test_no_data_at_all_is_structural_in_every_direction() -> None:
    found = unseen_directions(np.zeros((2, 2)), [range(2)])
    assert [(d.information, d.structural) for d in found] == [(0.0, True)] * 2


def test_names_of_a_direction_start_with_the_largest_and_leave_out_the_small() -> None:
    weights = np.array([0.5, SMALL_WEIGHT / 2, 1.0, -0.7])
    weights /= np.linalg.norm(weights)
    information = 100.0 * (np.eye(4) - np.outer(weights, weights))
    (direction,) = unseen_directions(information, [range(len(information))])
    assert direction.named(["a", "b", "c", "d"]) == [("c", 1.0), ("d", -0.7), ("a", 0.5)]


def test_structural_directions_of_two_sets_of_equations_are_not_mixed() -> None:
    """Both have eigenvalue zero, so that the eigenvectors of the whole are any mixture."""
    a, b = np.array([3.0, 4.0]) / 5.0, np.array([1.0, -1.0]) / np.sqrt(2.0)
    information = np.zeros((4, 4))
    information[:2, :2] = 50.0 * (np.eye(2) - np.outer(a, a))
    information[2:, 2:] = 50.0 * (np.eye(2) - np.outer(b, b))
    first, second = unseen_directions(information, [[0, 1], [2, 3]])
    assert first.structural and second.structural
    np.testing.assert_allclose(first.weights, [0.75, 1.0, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(np.abs(second.weights), [0.0, 0.0, 1.0, 1.0], atol=1e-12)


def test_rounding_does_not_turn_the_structural_directions() -> None:
    rng = np.random.default_rng(4)
    hidden, _ = np.linalg.qr(rng.normal(size=(6, 3)))
    seen = np.eye(6) - hidden @ hidden.T
    found = []
    for scale in (1.0, 3.0):  # another rounding of the same information
        noise = 1e-14 * rng.normal(size=(6, 6))
        directions = unseen_directions(scale * (seen + noise), [range(6)])
        found.append(np.array([d.weights for d in directions]))
    assert found[0].shape == (3, 6)
    np.testing.assert_allclose(found[0], found[1], atol=1e-9)
    np.testing.assert_allclose(seen @ found[0].T, 0.0, atol=1e-9)
