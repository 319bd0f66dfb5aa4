"""Which of two predictions is the better one, by more than chance."""

import numpy as np
import pytest
from scipy import stats

from auvident.engines.records import Record
from auvident.stages.validate.side_by_side import side_by_side, worse_by_chance
from auvident.stages.validate.stage import Prediction


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


def predictions(*errors: float) -> list[Prediction]:
    """Maneuvers at rest that are predicted with these errors in every channel; NaN ran away."""
    found = []
    for error in errors:
        still, time = np.zeros((80, 4)), 0.1 * np.arange(80.0)
        record = Record("m", time, np.zeros((80, 3)), still, still, np.zeros(4))
        measured = still.copy()
        measured[::2] = np.nan
        wrong = still + error * np.sign(np.sin(time))[:, None]
        found.append(Prediction(None, record, measured, wrong, wrong))  # type: ignore[arg-type]
    return found


def test_errors_are_those_of_what_was_measured() -> None:
    found = side_by_side(predictions(0.3, 0.3), predictions(0.1, 0.2), "vertical")
    assert found["w"].one == pytest.approx(0.3, rel=0.02)
    assert found["w"].other == pytest.approx(np.sqrt(0.025), rel=0.02)
    assert found["w"].p < 1e-3


def test_a_prediction_that_runs_away_is_the_worse_one() -> None:
    lost, kept = predictions(0.1, np.nan), predictions(0.1, 0.2)
    worse, better, none = (
        side_by_side(*pair, "vertical")["w"] for pair in ((lost, kept), (kept, lost), (lost, lost))
    )
    assert (worse.one, worse.p) == (np.inf, 0.0)
    assert (better.other, better.p) == (np.inf, 1.0)
    assert (none.one, none.other, none.p) == (np.inf, np.inf, 0.5)
