"""Where fits of candidates begin: at what sensors held against each other say."""

from dataclasses import replace

import numpy as np
import pytest

from auvident.stages.diagnose.checks.kinematics import SensorCheck
from auvident.stages.diagnose.select.starts import known_to_sensors
from tests.stages.diagnose.loop_chain import small_case

SCALE, BIAS = "dvl_scale.fraction", "gyro_bias.bias_degps"


def told(*values: tuple[float, float]) -> tuple[float, float]:
    """What is known of a scale that each check has with a mean and a standard deviation."""
    checks = tuple(
        SensorCheck((SCALE,), np.array([mean]), np.array([[std**2]]), 100, 0.001, f"check {k}")
        for k, (mean, std) in enumerate(values)
    )
    return known_to_sensors(replace(small_case(), checks=checks), ("dvl_scale",))[SCALE]


def test_of_two_checks_each_counts_for_what_it_knows() -> None:
    assert told((0.05, 0.01)) == pytest.approx((0.05, 0.01))
    assert told((0.05, 0.003), (0.06, 0.03)) == pytest.approx((0.0501, 0.002985), rel=1e-3)
    assert told((0.06, 0.03), (0.05, 0.003)) == pytest.approx((0.0501, 0.002985), rel=1e-3)


def test_checks_that_disagree_know_less() -> None:
    """Pitch scales of -10.5 ± 0.5 and -12.3 ± 0.7 % of one that is -11.5 (even seed 6212)."""
    mean, std = told((-0.1051, 0.0053), (-0.1233, 0.0071))
    assert mean == pytest.approx(-0.1116, abs=1e-4)
    assert std == pytest.approx(0.0087, abs=2e-4)
    assert told((0.01, 0.01), (0.01, 0.01))[1] == pytest.approx(0.01 / 2.0**0.5)


def test_nothing_is_known_without_a_check() -> None:
    assert known_to_sensors(small_case(), ("dvl_scale",)) == {}
