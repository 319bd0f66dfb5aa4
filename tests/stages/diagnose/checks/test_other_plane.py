"""What one plane found of an effect, told to the other."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvident.pipeline import steps
from auvident.pipeline.observer import Observer
from auvident.schema.artifacts import Maneuver, Maneuvers
from auvident.schema.diagnosis import Diagnosis, EffectFound, ParameterValue
from auvident.schema.effects import BY_ID, EFFECTS, parameter_of
from auvident.schema.planes import PLANES
from auvident.stages.diagnose import told_by
from tests.loop_world import CURRENT, LAG, STATEMENT


def flown(*trials: tuple[str, str]) -> Maneuvers:
    """A maneuver of each (trial, plane)."""
    rows = [
        Maneuver(
            id=f"{trial}-{k}",
            trial=trial,
            kind="zigzag",
            plane=plane,
            role="identify",
            t_start_s=100.0 * k,
            t_end_s=100.0 * k + 90.0,
        )
        for k, (trial, plane) in enumerate(trials)
    ]
    return Maneuvers(maneuvers=tuple(rows))


TOGETHER = flown(("a", "horizontal"), ("a", "vertical"))
APART = flown(("a", "horizontal"), ("b", "vertical"))


def found(*effects: EffectFound) -> Diagnosis:
    return Diagnosis(
        verdict="effect_found", statement=STATEMENT, plane="horizontal", effects=effects
    )


def effect(id_: str, **values: float) -> EffectFound:
    rows = [parameter_of(f"{id_}.{symbol}") for symbol in values]
    return EffectFound(
        id=id_,
        family=BY_ID[id_].family,
        parameters=tuple(
            ParameterValue(symbol=p.symbol, value=v, std=0.1 * abs(v), unit=p.unit)
            for p, v in zip(rows, values.values(), strict=True)
        ),
    )


def test_a_current_is_told_with_its_standard_deviations() -> None:
    (check,) = told_by(found(CURRENT), TOGETHER)
    assert check.names == ("current.north_mps", "current.east_mps")
    np.testing.assert_allclose(check.mean, [-0.121, 0.083])
    np.testing.assert_allclose(check.covariance, np.diag([0.004**2, 0.005**2]))


def test_sizes_are_told_in_internal_units() -> None:
    late = effect("gyro_delay", delay_s=0.4)
    (check,) = told_by(found(late), TOGETHER)
    declared = parameter_of("gyro_delay.delay_s")
    assert check.mean[0] * declared.factor == pytest.approx(0.4)
    assert check.covariance[0, 0] ** 0.5 * declared.factor == pytest.approx(0.04)


def test_what_belongs_to_a_trial_stays_with_its_trial() -> None:
    scale = effect("dvl_scale", fraction=0.03)
    told = told_by(found(CURRENT, scale), APART)
    assert [c.names for c in told] == [("dvl_scale.fraction",)]


def test_what_the_other_plane_does_not_have_is_not_told() -> None:
    offset = effect("rudder_offset", offset_deg=2.0)
    step = effect("thrust_step", fraction=0.1, time_s=500.0)
    arm = effect("dvl_lever_arm", dx_m=0.2, dy_m=0.1)
    told = told_by(found(offset, step, arm), TOGETHER)
    names = {n for c in told for n in c.names}
    assert names == {"dvl_lever_arm.dx_m"}


def test_a_size_known_to_one_side_and_a_direction_without_north_are_not_told() -> None:
    at_bound = LAG.model_copy(update={"bound": "at least"})
    lag = effect("propeller_lag", lag_s=0.04).model_copy(update={"parameters": (at_bound,)})
    by_bow = CURRENT.model_copy(update={"frame": "bow"})
    assert told_by(found(lag, by_bow), TOGETHER) == []


def test_every_effect_of_the_table_can_be_told() -> None:
    for row in EFFECTS:
        one = effect(row.id, **{p.symbol: 0.5 for p in row.parameters})
        for check in told_by(found(one), TOGETHER):
            assert set(check.names) <= set(row.names("vertical"))
            assert np.isfinite(check.mean).all() and np.all(np.diag(check.covariance) > 0.0)


@pytest.mark.parametrize(("first", "told", "with_prior"), [((CURRENT,), 1, False), ((), 0, True)])
def test_the_second_plane_is_told_and_takes_no_drag_of_a_model_that_lacks_it(
    monkeypatch: pytest.MonkeyPatch, first: tuple[EffectFound, ...], told: int, with_prior: bool
) -> None:
    seen: dict[str, Any] = {}

    def prepared(*args: Any, **options: Any) -> str:
        seen["shared"] = options["shared"]
        return "setup"

    def traced(*args: Any, **options: Any) -> Any:
        seen["told"] = options["told"]
        return SimpleNamespace(diagnosis="", residuals="")

    monkeypatch.setattr("auvident.stages.identify.prepare", prepared)
    monkeypatch.setattr("auvident.stages.diagnose.diagnose", traced)
    monkeypatch.setattr(steps, "identifying_plan", lambda given: "plan")
    monkeypatch.setattr(steps, "_shared", lambda model: model)
    given = SimpleNamespace(
        trials=[],
        maneuvers=TOGETHER,
        ase="",
        vehicle="",
        model=SimpleNamespace(plane=PLANES[1], filter="ekf", engine="compiled"),
        noise=lambda: "",
        observer=Observer(),
        is_beside=True,
        planes=PLANES,
        former={"diagnose/diagnosis.json": found(*first)},
        within=lambda plane: SimpleNamespace(model="the model of the first plane"),
    )
    steps.diagnose(given)  # type: ignore[arg-type]
    assert len(seen["told"]) == told
    assert (seen["shared"] is not None) == with_prior
