"""Effects in the filters and in the fit: planted ones come back; a new one is a row of a table."""

from collections.abc import Iterator

import numpy as np
import pytest

from auvident.engines.estimator import free_positions, run_stage
from auvident.engines.prediction import At, readings_with_slopes
from auvident.physics import terms
from auvident.physics.terms import structure_of
from auvident.schema import effects
from auvident.schema.coefficients import expand
from auvident.schema.effects import Effect, EffectParameter, in_plane
from tests.command_line import call
from tests.engines.effects_world import COURSE, NOISE, World, recorded, setup_for
from tests.engines.test_prediction import held

METHODS = [("filter", "ekf"), ("filter", "ukf"), ("output_error", "ekf")]
COEFFICIENTS = ("X_uu", "Y_uv", "Y_uud", "N_ur", "N_uud", "T_nn")


def estimated(world: World, method: str, kind: str, engine: str = "compiled"):
    """Estimated effects and their standard deviations, from four short records."""
    names = [*COEFFICIENTS, *world.every_effect()]
    records = [recorded(world, 400, seed, NOISE) for seed in range(4)]
    setup = setup_for(world, records, names, kind, engine)
    stage = setup.plan.stage[0]
    out = run_stage(setup, setup.start, stage.model_copy(update={"method": "output_error"}))
    if method == "filter":  # which begins near the truth, as the diagnosis hands effects on
        out = run_stage(setup, out.parameters, stage)
    std = np.sqrt(np.diag(out.covariance)) * setup.prior_std[out.free]
    columns = [list(out.free).index(world.index(n)) for n in world.every_effect()]
    return out.parameters[out.free][columns], std[columns]


PLANTED = {
    "current": {"current.north_mps": 0.15, "current.east_mps": -0.1},
    "drifting current": {
        "current.north_mps": 0.15,
        "current.east_mps": -0.1,
        "current_drift.north_early_mps_per_1000_s": 0.25,
        "current_drift.east_early_mps_per_1000_s": -0.2,
        "current_drift.north_late_mps_per_1000_s": -0.3,
        "current_drift.east_late_mps_per_1000_s": 0.15,
    },
    "linear damping": {"linear_damping.Y_v": -30.0, "linear_damping.N_r": -10.0},
    "offset and asymmetry": {"rudder_offset.offset_deg": 2.0, "rudder_asymmetry.gain": 0.15},
    "servo": {"rudder_lag.lag_s": 0.5},
    "gyro": {"gyro_bias.bias_degps": 0.5},
    "mounting": {"dvl_misalignment.yaw_deg": 3.0},
    "late DVL": {"dvl_delay.delay_s": 0.3},
    "side force": {"propeller_side_force.Y_nn": 0.006, "propeller_side_force.N_nn": -0.002},
    "sag": {"thrust_sag.fraction_per_1000_s": 0.4},
}


@pytest.mark.parametrize(("method", "kind"), METHODS)
@pytest.mark.parametrize("name", PLANTED)
def test_a_planted_effect_comes_back(name, method, kind) -> None:
    world = World.of(PLANTED[name])
    found, std = estimated(world, method, kind)
    truth = world.p[[world.index(n) for n in world.every_effect()]]
    assert (np.abs(found - truth) < 4.0 * std).all()
    assert (std < 0.3 * np.abs(truth)).all()  # it is seen


# --- a new effect --------------------------------------------------------------------------

WAKE = Effect(
    "wake_drag",
    "hydrodynamics",
    "force",
    ("horizontal",),
    (
        EffectParameter("Y_v", "kg/s", 0.02, 0.005, -1.0, 1.0, powers=(1, 2, 1, 0)),
        EffectParameter("N_rvv", "kg s", 0.05, 0.02, -5.0, 5.0, powers=(1, 4, -1, 0)),
    ),
    "Y + Y_v v, N + N_rvv r v v",
    "drift dies faster at low speed",
)
FORCES = (
    ("wake_drag.Y_v", "A", +1, ("a", "x")),
    ("wake_drag.N_rvv", "B", +1, ("b", "x"), ("a", "x^2")),
)


@pytest.fixture
def wake(monkeypatch) -> Iterator[World]:
    """The vehicle with an effect that the program has never heard of."""
    monkeypatch.setattr(effects, "EFFECTS", (*effects.EFFECTS, WAKE))
    monkeypatch.setitem(effects.BY_ID, WAKE.id, WAKE)
    monkeypatch.setattr(terms, "EFFECT_FORCES", (*terms.EFFECT_FORCES, *FORCES))
    structure_of.cache_clear()
    yield World.of({"wake_drag.Y_v": -40.0, "wake_drag.N_rvv": -60.0})
    structure_of.cache_clear()


def test_a_new_effect_is_listed(wake) -> None:
    assert in_plane("horizontal")[-1] is WAKE
    assert WAKE not in in_plane("vertical")
    assert wake.frame.structure.parameters[-2:] == ("wake_drag.Y_v", "wake_drag.N_rvv")


def test_a_new_effect_stands_in_the_prediction_with_its_slopes(wake) -> None:
    record, free = recorded(wake), wake.free(wake.every_effect())
    found = readings_with_slopes(At(wake.frame, wake.p, free), record, COURSE)
    assert found is not None
    away = np.abs(found.readings - held(wake.without().p, record, wake))
    assert away[:, :3].max() > 0.02
    for k, at in enumerate(free.positions):
        ends, h = [], 1e-4
        for sign in (1.0, -1.0):
            p = wake.p.copy()
            p[at] += sign * h * free.scale[k]
            ends.append(held(p, record, wake))
        expected = (ends[0] - ends[1])[:, :3] / (2 * h)
        slope = found.slopes[:, :3, 4 + k]
        # second order in h, and the few kinks of |v| and |r| within h of the course
        np.testing.assert_allclose(slope, expected, atol=2e-5 * np.abs(slope).max())


@pytest.mark.parametrize(("method", "kind"), METHODS)
def test_a_new_effect_is_estimated(wake, method, kind) -> None:
    found, std = estimated(wake, method, kind)
    truth = wake.p[-2:]
    assert (np.abs(found - truth) < 4.0 * std).all()
    assert std[0] < 0.3 * abs(truth[0])


@pytest.mark.parametrize("kind", ["ekf", "ukf"])
def test_a_new_effect_is_in_both_engines(wake, kind) -> None:
    found, expected = (estimated(wake, "filter", kind, e) for e in ("compiled", "filterpy"))
    # the same arithmetic in another order over 400 steps, see test_agreement
    np.testing.assert_allclose(found, expected, rtol=1e-7)


def test_effects_of_the_lateral_motion_are_not_freed_by_the_surge_equation(wake) -> None:
    setup = setup_for(wake, [], [*COEFFICIENTS, *wake.every_effect()])
    surge = setup.plan.stage[0].model_copy(update={"system": "surge"})
    names = setup.structure.parameters
    assert not any("." in names[i] for i in free_positions(setup, surge))
    coupled = {names[i] for i in free_positions(setup, setup.plan.stage[0])}
    assert coupled == {*COEFFICIENTS, *wake.every_effect()}
    assert coupled - set(expand(["all"], "horizontal")) == set(wake.every_effect())


def test_a_new_effect_is_in_the_table_for_users(wake) -> None:
    shown = call("effects", "--json")
    assert shown.code == 0
    assert "wake_drag" in shown.out
