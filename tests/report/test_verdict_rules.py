"""The words of the verdict at the edges of their rules, and the share of an angle that spins."""

import math

import pytest

from auvident.report.numbers import PAGE, TERMINAL
from auvident.report.tables import Nrmse, Rmse, written
from auvident.report.verdict_rules import BAND, ERROR, GAIN, LAGS, SETTLED, Called, table, worst
from auvident.schema.diagnosis import ChannelError
from auvident.schema.spin import ONCE_ROUND_RAD, share


@pytest.mark.parametrize(
    ("rule", "value", "grade"),
    [
        (ERROR, 0.0, "good"),
        (ERROR, 0.1, "good"),
        (ERROR, 0.1001, "fair"),
        (ERROR, 0.3, "fair"),
        (ERROR, 0.3001, "poor"),
        (ERROR, 7.0, "poor"),
        (BAND, 0.75, "poor"),
        (BAND, 0.7501, "fair"),
        (BAND, 0.9, "fair"),
        (BAND, 0.9001, "good"),
        (GAIN, 0.95, "poor"),
        (GAIN, 1.0, "fair"),
        (GAIN, 1.0501, "good"),
        (SETTLED, 0.5, "good"),
        (SETTLED, 1.0, "fair"),
        (SETTLED, 1.0001, "poor"),
        (LAGS, 0.1, "good"),
        (LAGS, 0.1001, "poor"),
    ],
)
def test_a_limit_belongs_to_the_word_before_it(rule: Called, value: float, grade: str) -> None:
    assert rule.of(value).grade == grade


def test_every_rule_stands_in_the_table_with_its_limits() -> None:
    rows = dict(written(table("from 80 %: well identified"), PAGE).rows)
    told = rows[ERROR.figure]
    assert told == (
        "up to 0.1: well; up to 0.3: fairly well; up to 1: poorly; "
        "above: worse than a constant would"
    )
    assert len(rows) == 6


def test_the_worst_grade_decides() -> None:
    assert worst(["good", "poor", "fair"]) == "poor"
    assert worst(["good", "good"]) == "good"


def test_a_heading_that_turns_round_has_no_share() -> None:
    """Evenly once round its standard deviation is 2 pi over the root of twelve."""
    assert pytest.approx(math.radians(103.923), rel=1e-5) == ONCE_ROUND_RAD
    assert share("heading", 0.05, 0.05 / (0.99 * ONCE_ROUND_RAD)) is not None
    assert share("heading", 0.05, 0.05 / (1.01 * ONCE_ROUND_RAD)) is None
    assert share("r", 0.05, 0.001) == 0.001
    assert share("heading", None, None) is None


def test_the_share_of_a_window_is_judged_by_the_whole_maneuver() -> None:
    window = ChannelError(rmse=0.02, nrmse=0.005, unit="rad")
    whole = ChannelError(rmse=0.05, nrmse=0.02, unit="rad")
    assert Nrmse("heading", window).text(PAGE) == "–"
    assert Nrmse("heading", window, whole).text(PAGE) == "–"
    assert Nrmse("r", window, whole).text(PAGE) == "0.00500"


def test_a_heading_is_in_degrees_wherever_it_is_read() -> None:
    error = ChannelError(rmse=math.radians(3.0), nrmse=0.1, unit="rad")
    assert Rmse(error).text(PAGE) == "3.00" and Rmse(error).text(TERMINAL) == "3"
    assert TERMINAL.unit("rad") == "deg" and TERMINAL.unit("rad/s") == "rad/s"
