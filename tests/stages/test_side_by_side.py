"""Which of two predictions is the better one, by more than chance."""

import numpy as np
import pytest
from scipy import stats

from auvident.stages.validate.side_by_side import worse_by_chance


def test_the_probability_is_that_of_students_test() -> None:
    away = np.random.default_rng(1).normal(0.3, 1.0, 16)
    test = stats.ttest_1samp(away, 0.0, alternative="greater")
    assert worse_by_chance(away) == pytest.approx(test.pvalue)
    assert worse_by_chance(-away) == pytest.approx(1.0 - test.pvalue)


def test_where_there_is_no_difference_nothing_is_worse() -> None:
    assert worse_by_chance(np.zeros(16)) == 0.5
    assert worse_by_chance(np.array([0.2])) == 0.5


def test_it_is_as_often_low_as_it_says() -> None:
    rng = np.random.default_rng(2)
    low = np.mean([worse_by_chance(rng.normal(size=16)) < 0.05 for _ in range(2000)])
    assert 0.035 < low < 0.066  # 3 standard errors
