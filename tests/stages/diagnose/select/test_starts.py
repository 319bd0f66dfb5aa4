"""Where fits of candidates begin: at what sensors held against each other say."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from auvident.stages.diagnose.checks.kinematics import SensorCheck
from auvident.stages.diagnose.fit.case import Case
from auvident.stages.diagnose.fit.fits import Fitted
from auvident.stages.diagnose.select import starts
from auvident.stages.diagnose.select.starts import baseline_of, known_to_sensors
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


def test_a_fit_that_diverges_with_a_small_change_is_none_to_search_from(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The likelier of the two fits is left; where both do so it is taken, and the screen tells."""
    case, seen = small_case(), []

    def slopes(lost: int) -> Callable[..., object]:
        def of(case: Case, fitted: Fitted, effects: tuple[str, ...]) -> object:
            seen.append(fitted)
            return None if len(seen) <= lost else object()

        return of

    monkeypatch.setattr(starts, "joint_about", slopes(0))
    best = baseline_of(case)
    identified, estimate = seen
    assert best.log_likelihood == max(f.log_likelihood for f in seen)
    for lost, left in ((1, estimate), (2, best)):
        seen.clear()
        monkeypatch.setattr(starts, "joint_about", slopes(lost))
        assert baseline_of(case).log_likelihood == left.log_likelihood
    assert identified.log_likelihood != estimate.log_likelihood
