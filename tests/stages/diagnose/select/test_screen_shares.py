"""What a candidate may gain as the by-product of another."""

from types import SimpleNamespace
from typing import Any

import pytest

from auvident.stages.diagnose.select import screen
from auvident.stages.diagnose.select.screen import Screen

LIKENESS = {
    frozenset({"current", "gyro_bias"}): 0.9,
    frozenset({"current", "linear_drag"}): 0.1,
    frozenset({"gyro_bias", "linear_drag"}): 0.0,
}
CASE = SimpleNamespace(positions=lambda effect: effect)
JOINT: Any = SimpleNamespace(case=CASE)


@pytest.fixture
def shares(monkeypatch: pytest.MonkeyPatch) -> Screen:
    monkeypatch.setattr(screen, "cosine", lambda joint, a, b: LIKENESS[frozenset({a, b})])
    return Screen(JOINT, {}, ())


def test_what_looks_like_another_may_be_its_by_product(shares: Screen) -> None:
    found = shares.by_others({"current": 1000.0, "gyro_bias": 800.0, "linear_drag": 60.0})
    assert found == pytest.approx({"current": 648.0, "gyro_bias": 810.0, "linear_drag": 10.0})


def test_a_limit_may_stand_for_anything(shares: Screen) -> None:
    found = shares.by_others({"rudder_rate_limit": 500.0, "linear_drag": 60.0})
    assert found == {"rudder_rate_limit": 60.0, "linear_drag": 500.0}


def test_what_is_alone_is_no_by_product(shares: Screen) -> None:
    assert shares.by_others({"linear_drag": 60.0}) == {"linear_drag": 0.0}
    assert shares.by_others({}) == {}
