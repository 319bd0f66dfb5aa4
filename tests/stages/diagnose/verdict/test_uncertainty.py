"""Sizes of effects as the artifact has them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from auvident.stages.diagnose.verdict.uncertainty import effect_values, lent
from tests.stages.diagnose.loop_chain import small_case


@pytest.mark.parametrize(
    ("name", "end", "bound"),
    [
        ("gyro_delay.delay_s", "high", "at least"),
        ("gyro_delay.delay_s", "low", "at most"),
        ("rudder_stall.angle_deg", "high", "at most"),  # stored as its inverse
        ("rudder_lag.lag_s", "low", None),  # off is no bound
    ],
)
def test_a_parameter_at_its_bound_is_known_to_one_side(name, end, bound) -> None:
    case, effect = small_case(), name.partition(".")[0]
    p, stds = case.identified.copy(), np.full(len(case.names), 0.01)
    p[case.position(name)] = getattr(case, end)[case.position(name)]
    (found,) = effect_values(case, effect, p, stds)
    assert found.bound == bound
    assert (found.low is None, found.high is None) == (bound == "at most", bound == "at least")


def test_what_a_servo_may_lend_to_another_delay_is_a_share_of_the_time_for_a_length() -> None:
    """Not a fixed time: a delay of 0.10 s with 1,252 nats was lost on a hull with L/U of 0.9 s."""
    case = small_case()
    stds = [case.nuisance_std[case.position(f"rudder_{n}")] for n in ("lag.lag_s", "delay.delay_s")]
    assert lent(case) == pytest.approx(math.hypot(*stds))
    slower = replace(case, nuisance_std=3.0 * case.nuisance_std)  # as of L/U three times as long
    assert lent(slower) == pytest.approx(3.0 * lent(case))
    assert 0.02 < lent(case) / (1.3327 / 1.5) < 0.06
