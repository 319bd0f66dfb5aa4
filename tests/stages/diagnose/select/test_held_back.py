"""What the sensors say of each other beside the maneuvers that are left out."""

import numpy as np
import pytest

from auvident.stages.diagnose.score.left_out import LEAST_CHANCE, Helped
from auvident.stages.diagnose.select import held_back
from tests.stages.diagnose.select.test_rules_at_work import BEFORE, CASE, fitted


@pytest.mark.parametrize(("gained", "p"), [(1e5, 2.0 * LEAST_CHANCE), (15.0, 2.0 * LEAST_CHANCE)])
def test_a_chance_is_never_less_than_signs_can_show(monkeypatch, gained, p) -> None:
    """The tail of a Gaussian at 1e5 nats is zero; that no alarm is ever false nobody can tell."""
    costs = iter([gained, 0.0])
    monkeypatch.setattr(held_back, "check_cost", lambda *_: next(costs))
    found = held_back.with_sensors(CASE, BEFORE, fitted(1.0, "current"), Helped(1.0, 0.5, 0.0))
    assert found.p == p
    assert np.isfinite(found.t)
