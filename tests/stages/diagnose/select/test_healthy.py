"""Strength of a candidate, and how often a healthy vehicle has one as strong."""

from itertools import pairwise

import pytest

from auvident.stages.diagnose.score.left_out import Helped
from auvident.stages.diagnose.select.healthy import (
    SHARES,
    STRENGTHS,
    share_of_healthy,
    standing,
    strength,
)
from auvident.stages.diagnose.select.rules import LEAST_EXPLAINED, LEAST_SHARE, LEAST_T

GOOD = Helped(gain=50.0, share=1.0, t=4.0, explained=0.5)


def helped(**other: float) -> Helped:
    return Helped(**{**vars(GOOD), **other})


def test_what_meets_all_that_is_asked_has_its_standard_errors() -> None:
    assert strength(GOOD) == 4.0
    assert strength(helped(share=0.1, deciding=1.0)) == 4.0


@pytest.mark.parametrize(
    ("other", "left"),
    [
        ({"share": 0.5 * LEAST_SHARE}, 0.5),
        ({"explained": 0.5 * LEAST_EXPLAINED}, 0.5),
        ({"share": 0.5 * LEAST_SHARE, "explained": 0.5 * LEAST_EXPLAINED}, 0.25),
        ({"explained": -0.2}, 0.0),
    ],
)
def test_it_counts_less_where_too_few_are_helped_or_too_little_is_explained(other, left) -> None:
    assert strength(helped(**other)) == pytest.approx(4.0 * left)


def test_where_fewer_standard_errors_do_they_count_as_many_as_are_needed() -> None:
    assert strength(helped(t=2.1, explained=0.6)) == LEAST_T
    assert strength(helped(t=0.7, explained=0.9)) == LEAST_T
    assert strength(helped(t=0.7, explained=0.9, share=0.0)) == 0.0


def test_what_helps_nothing_that_was_left_out_is_ordered_by_what_it_gains() -> None:
    assert standing(helped(strength=0.3), 500.0) == 0.3
    assert standing(None, 0.0) == standing(None, -4.0) == -1.0  # no less than every vehicle has
    useless = helped(strength=0.0)
    assert -1.0 < standing(useless, 4.0) == standing(None, 4.0) < standing(None, 400.0) < 0.0


def test_stronger_ones_are_rarer_and_none_is_rarer_than_the_count_tells() -> None:
    shares = [share_of_healthy(0.1 * k) for k in range(-10, 60)]
    assert all(b <= a for a, b in pairwise(shares))
    assert (shares[0], shares[-1]) == (pytest.approx(1.0), pytest.approx(SHARES[-1]))
    assert share_of_healthy(STRENGTHS[4]) == pytest.approx(SHARES[4])
    assert all(b > a for a, b in pairwise(STRENGTHS))
