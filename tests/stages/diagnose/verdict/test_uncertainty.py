"""Sizes of effects as the artifact has them."""

import numpy as np
import pytest

from auvident.stages.diagnose.verdict.uncertainty import effect_values
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
