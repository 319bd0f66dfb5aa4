"""Maneuvers that a next trial is asked for."""

import pytest

from auvident.engines.carried import structure_behind
from auvident.errors import NumericsError
from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.trial import Trial
from auvident.stages.plan_trial import candidates, expected_information, rpm_levels
from tests.engines.chain import sample
from tests.session import once


def test_a_trial_at_one_propeller_rate_is_asked_for_another() -> None:
    """Thrust steps are what it lacks; the same maneuver twice would tell nothing more."""
    found = sample("harbour_trial")
    (trial,) = found.trials
    one = Trial.from_table(trial.name, trial.table.assign(rpm=614.0), trial.rate_hz)
    levels = rpm_levels([one], found.maneuvers.maneuvers)
    assert levels == pytest.approx((0.8 * 614.0, 614.0, 614.0))
    asked = [c.what for c in candidates("horizontal", *levels)]
    assert len(set(asked)) == len(asked)
    assert any("amidships, 614, 491, 614 rpm" in what for what in asked)


def test_a_trial_at_several_rates_keeps_within_them() -> None:
    found = sample("harbour_trial")
    low, middle, high = rpm_levels(found.trials, found.maneuvers.maneuvers)
    rpm = found.trials[0].table["rpm"]
    assert rpm[rpm > 0].min() <= low < middle < high <= rpm.max()


@pytest.mark.parametrize("turned", [-1.0, 0.0])
def test_a_propeller_that_never_turns_ahead_has_no_rate_to_plan_at(turned: float) -> None:
    """As in a log whose rpm has the other sign, which is told and not refused."""
    found = sample("harbour_trial")
    (trial,) = found.trials
    astern = Trial.from_table(
        trial.name, trial.table.assign(rpm=turned * trial.table["rpm"]), trial.rate_hz
    )
    with pytest.raises(NumericsError, match="never turns ahead") as caught:
        rpm_levels([astern], [m for m in found.maneuvers.maneuvers if m.kind == "turn"])
    assert "--fix rpm_sign" in (caught.value.remedy or "")


def test_forces_of_effects_act_in_the_maneuvers_that_are_judged() -> None:
    """A model that damps by an effect is not flown without its damping."""
    model = IdentifiedModel.model_validate_json(harbour_model())
    names = [n for n in model.covariance["symbols"] if n in model.values()]
    stds, (zigzag, *_) = dict.fromkeys(names, 1.0), candidates("horizontal", 400.0, 600.0, 700.0)
    damped = with_damping(model, Y_v=-40.0, N_r=-20.0)
    free, own = (
        expected_information(m, structure_behind(m), stds, zigzag, 0.1) for m in (model, damped)
    )
    again = with_damping(model, Y_v=0.0, N_r=0.0)
    same = expected_information(again, structure_behind(again), stds, zigzag, 0.1)
    assert free is not None and own is not None
    assert same == pytest.approx(free, rel=1e-9)
    k = names.index("N_r|r|")  # a hull that damps turns less
    assert own[k, k] < 0.5 * free[k, k]


def with_damping(model: IdentifiedModel, **values: float) -> IdentifiedModel:
    """The model with linear damping as an effect."""
    internal = {f"linear_damping.{name}": value for name, value in values.items()}
    row = {"id": "linear_damping", "parameters": [], "internal": internal}
    return model.model_copy(update={"effects": (row,)})


@once
def harbour_model() -> str:
    return sample("harbour_trial").identify().model.model_dump_json(by_alias=True)
