"""Maneuvers that a next trial is asked for."""

import pytest

from auvident.schema.trial import Trial
from auvident.stages.plan_trial import candidates, rpm_levels
from tests.engines.chain import sample


def test_a_trial_at_one_propeller_rate_is_asked_for_another() -> None:
    """Thrust steps are what it lacks; the same maneuver twice would tell nothing more."""
    found = sample("harbour_trial")
    (trial,) = found.trials
    one = Trial(trial.name, trial.table.assign(rpm=614.0), trial.rate_hz)
    levels = rpm_levels([one], found.maneuvers.maneuvers)
    assert levels == pytest.approx((0.8 * 614.0, 614.0, 614.0))
    asked = [c.what for c in candidates("horizontal", *levels)]
    assert len(set(asked)) == len(asked)
    assert any("614, 614, 491, 614 rpm" in what for what in asked)


def test_a_trial_at_several_rates_keeps_within_them() -> None:
    found = sample("harbour_trial")
    low, middle, high = rpm_levels(found.trials, found.maneuvers.maneuvers)
    rpm = found.trials[0].table["rpm"]
    assert rpm[rpm > 0].min() <= low < middle < high <= rpm.max()
