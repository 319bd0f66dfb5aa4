"""What the sensors say of each other beside the maneuvers that are left out."""

import pytest

from auvident.stages.diagnose.score.left_out import Helped
from auvident.stages.diagnose.select import held_back
from tests.stages.diagnose.select.test_rules_at_work import BEFORE, CASE, fitted


@pytest.mark.parametrize("gained", [1e5, 15.0])
def test_sensors_that_agree_again_count_in_standard_errors(monkeypatch, gained) -> None:
    costs = iter([2.0 * gained, gained])
    monkeypatch.setattr(held_back, "check_cost", lambda *_: next(costs))
    found = held_back.with_sensors(CASE, BEFORE, fitted(1.0, "current"), Helped(1.0, 0.5))
    assert (found.gain, found.share, found.explained) == (1.0 + gained, 1.0, 0.5)
    assert found.t == pytest.approx((2.0 * gained) ** 0.5)
