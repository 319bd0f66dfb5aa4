"""Effects of the vertical plane: forces by hand, water that moves, slopes, and what is planted."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from auvident.engines.carried import allowed, predicted_course, with_speed
from auvident.engines.estimator import run_stage
from auvident.engines.prediction import (
    READING_STEP,
    SMALL_STEP,
    At,
    at_effects,
    readings,
    readings_with_slopes,
    simulated,
)
from auvident.engines.records import Record
from auvident.errors import StageError
from auvident.physics.actuation import CHANGED, COMMANDS, DEPTH, DRIVE
from auvident.physics.batch import inverse_mass
from auvident.physics.sensing import READING
from auvident.physics.term_tables import N_INPUTS
from auvident.schema.artifacts import IdentifiedModel, Sensing
from auvident.schema.effects import BY_ID, in_plane, parameter_of
from auvident.storage.artifacts import as_model
from tests.engines.chain import identified
from tests.engines.effects_world import (
    COURSE,
    FREELY,
    LEAD,
    NOISE,
    World,
    blank,
    integrated,
    recorded,
    setup_for,
)
from tests.physics.plane_equations import stable_values, vertical
from tests.physics.right_hand_side import right_hand_side

# every effect of the vertical plane at some practical sizes
SHOWN = {
    "current.north_mps": 0.12,
    "current.east_mps": -0.2,
    "vertical_current.down_mps": 0.05,
    "elevator_offset.offset_deg": 1.0,
    "elevator_lag.lag_s": 0.34,
    "elevator_rate_limit.rate_degps": 60.0,
    "elevator_delay.delay_s": 0.13,
    "elevator_backlash.half_width_deg": 1.0,
    "elevator_deadband.deadband_deg": 0.8,
    "elevator_asymmetry.gain": 0.1,
    "elevator_stall.angle_deg": 25.0,
    "propeller_lag.lag_s": 0.6,
    "propeller_race.c_m2ps2pn": 0.01,
    "thrust_sag.fraction_per_1000_s": 0.2,
    "thrust_step.fraction": 0.1,
    "thrust_step.time_s": 215.0,
    "thrust_step.over_s": 20.0,
    "dvl_delay.delay_s": 0.24,
    "gyro_delay.delay_s": -0.13,
    "dvl_pitch.pitch_deg": 1.5,
    "dvl_scale.fraction": 0.02,
    "dvl_lever_arm.dx_m": 0.1,
    "dvl_lever_arm.dz_m": 0.05,
    "q_bias.bias_degps": 0.2,
    "q_scale.fraction": -0.02,
    "pitch_bias.bias_deg": 1.2,
    "pitch_scale.fraction": 0.04,
    "depth_lag.lag_s": 1.0,
    "depth_scale.fraction": 0.03,
    "thrust_line_moment.z_m": 0.03,
    "hull_asymmetry.Z_0": 0.4,
    "hull_asymmetry.M_0": 0.1,
    "heave_cross_flow.Z_w|q|": -15.0,
    "heave_cross_flow.Z_q|w|": 10.0,
    "pitch_cross_flow.M_w|q|": -4.0,
    "pitch_cross_flow.M_q|w|": -6.0,
    "cubic_damping.M_wwq": -20.0,
    "cubic_damping.M_qqq": -3.0,
    "turning_drag.X_wwu": -10.0,
    "turning_drag.X_qqu": -2.0,
    "linear_drag.X_u": -0.8,
    "linear_damping.Z_w": -15.0,
    "linear_damping.M_q": -5.0,
    "weight_change.weight_n": 1.0,
    "weight_change.moment_nm": -0.1,
    "weight_change.time_s": 215.0,
    "weight_change.over_s": 20.0,
    "buoyancy_gradient.gradient_npm": 0.1,
}
COEFFICIENTS = ("X_uu", "T_nn", "Z_uw", "Z_uud", "M_uq", "M_uud", "M_q|q|", "Z_wdot")
WORLD = World.of(SHOWN, plane="vertical")
TRUTH = recorded(WORLD)
NAMES = [*COEFFICIENTS, *WORLD.every_effect()]
FREE = WORLD.free(NAMES)
UNSEEN = ("depth_lag.lag_s", "depth_scale.fraction")  # in no reading of a state
ORIGIN = Sensing(dvl_x_m=0.0, dvl_y_m=0.0, dvl_z_m=0.0, dvl_mounting_yaw_rad=0.0, noise_std={})
C = stable_values("vertical")


def test_every_effect_is_tried() -> None:
    assert set(WORLD.frame.structure.effects) == {e.id for e in in_plane("vertical")}


# --- forces --------------------------------------------------------------------------------

Force = Callable[[np.ndarray, np.ndarray], tuple[float, float, float]]
# X, Z, M for a parameter of one, from the state and the inputs
BY_HAND: dict[str, Force] = {
    "thrust_line_moment.z_m": lambda x, i: (0.0, 0.0, i[DRIVE]),
    "hull_asymmetry.Z_0": lambda x, i: (0.0, x[0] * abs(x[0]), 0.0),
    "hull_asymmetry.M_0": lambda x, i: (0.0, 0.0, x[0] * abs(x[0])),
    "heave_cross_flow.Z_w|q|": lambda x, i: (0.0, x[1] * abs(x[2]), 0.0),
    "heave_cross_flow.Z_q|w|": lambda x, i: (0.0, x[2] * abs(x[1]), 0.0),
    "pitch_cross_flow.M_w|q|": lambda x, i: (0.0, 0.0, x[1] * abs(x[2])),
    "pitch_cross_flow.M_q|w|": lambda x, i: (0.0, 0.0, x[2] * abs(x[1])),
    "cubic_damping.M_wwq": lambda x, i: (0.0, 0.0, x[1] ** 2 * x[2]),
    "cubic_damping.M_qqq": lambda x, i: (0.0, 0.0, x[2] ** 3),
    "turning_drag.X_wwu": lambda x, i: (x[1] ** 2 * x[0], 0.0, 0.0),
    "turning_drag.X_qqu": lambda x, i: (x[2] ** 2 * x[0], 0.0, 0.0),
    "linear_drag.X_u": lambda x, i: (x[0], 0.0, 0.0),
    "linear_damping.Z_w": lambda x, i: (0.0, x[1], 0.0),
    "linear_damping.M_q": lambda x, i: (0.0, 0.0, x[2]),
    # one newton more of weight at the origin pulls down: ahead when the bow is down
    "weight_change.weight_n": lambda x, i: (
        -i[CHANGED] * np.sin(x[3]),
        i[CHANGED] * np.cos(x[3]),
        0.0,
    ),
    "weight_change.moment_nm": lambda x, i: (0.0, 0.0, -i[CHANGED] * np.cos(x[3])),
    "buoyancy_gradient.gradient_npm": lambda x, i: (
        -i[DEPTH] * np.sin(x[3]),
        i[DEPTH] * np.cos(x[3]),
        0.0,
    ),
}
FORCES = [n for e in in_plane("vertical") if e.enters == "force" for n in e.names("vertical")]


def test_every_force_is_written_by_hand() -> None:
    times = {"weight_change.time_s", "weight_change.over_s"}
    assert set(FORCES) - times == set(BY_HAND)


@pytest.mark.parametrize("name", BY_HAND)
@pytest.mark.parametrize("seed", range(3))
def test_forces_are_those_written_by_hand(name: str, seed: int) -> None:
    world = World.of({name: 2.5}, plane="vertical")
    rng, structure, inverse = np.random.default_rng(seed), world.frame.structure, np.empty((3, 3))
    x, inputs = rng.uniform(-1.0, 1.0, 4), rng.uniform(-1.0, 1.0, N_INPUTS)
    inverse_mass(world.p, structure.mass, structure.mass_weights, FREELY, inverse)
    found = right_hand_side(structure, FREELY, x, inputs, world.p, inverse)
    mass, force = vertical(x, inputs[:3], C)
    extra = 2.5 * np.array(BY_HAND[name](x, inputs))
    expected = np.append(np.linalg.solve(mass.astype(float), force.astype(float) + extra), x[2])
    np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-12)


def test_thrust_and_the_part_of_a_weight_are_inputs() -> None:
    """T = T_nn n|n| + T_nu |n| u at the measured speed, after lag, sag and step."""
    shown = {"thrust_line_moment.z_m": 0.03, "thrust_step.fraction": 0.2} | {
        "thrust_step.time_s": 210.0,
        "weight_change.weight_n": 1.0,
        "weight_change.time_s": 220.0,
        "weight_change.over_s": 4.0,
    }
    world, record = World.of(shown, plane="vertical"), blank(300)
    source = record.source
    assert source is not None and source.depth is not None
    inputs = at_effects(world.frame, world.p, record).inputs
    n, elapsed, speed = source.raw[LEAD:, 2], source.elapsed_s[LEAD:], source.speed[LEAD:]
    thrust = C["T_nn"] * n**2 + C["T_nu"] * n * speed
    fallen = np.where(elapsed < 210.0 - 1e-9, 1.0, 0.8)
    np.testing.assert_allclose(inputs[:, DRIVE], thrust * fallen, rtol=1e-12)
    part = np.clip((elapsed - 218.0) / 4.0, 0.0, 1.0)
    np.testing.assert_allclose(inputs[:, CHANGED], part, atol=1e-9)
    np.testing.assert_array_equal(inputs[:, DEPTH], source.depth[LEAD:])


# --- water that moves ----------------------------------------------------------------------


def over_ground(x: np.ndarray, inputs: np.ndarray, water: tuple[float, float]) -> np.ndarray:
    """Rate of (u, w, q, pitch), u and w over ground; water ahead and down, in level axes.

    Newton's law for the rigid body with its velocity over ground, the forces of the water (added
    mass among them) with the velocity through it.
    """
    c, s, q = np.cos(x[3]), np.sin(x[3]), x[2]
    ahead, below = water[0] * c - water[1] * s, water[0] * s + water[1] * c
    through = x - [ahead, below, 0.0, 0.0]
    body = {name: 0.0 if "_" in name and name[0] in "XZMT" else v for name, v in C.items()}
    mass, force = vertical(through, inputs, C)
    rigid, there = vertical(x, inputs, body)
    _, here = vertical(through, inputs, body)  # differs by the velocity over ground alone
    turning = np.array([-q * below, q * ahead, 0.0])  # rate of the water in the vehicle's axes
    added = (mass - rigid).astype(float)
    total = force + there - here
    return np.append(np.linalg.solve(mass.astype(float), total + added @ turning), q)


@pytest.mark.parametrize("water", [(0.0, 0.08), (0.3, 0.0), (-0.2, -0.05)])
def test_the_prediction_in_moving_water_is_the_motion_over_ground(water) -> None:
    """On a heading of north, a current to the north comes from astern."""
    shown = {"current.north_mps": water[0], "vertical_current.down_mps": water[1]}
    world, record = World.of(shown, ORIGIN, "vertical"), blank(300, start=(1.4, 0.02, 0.01, 0.05))
    assert record.source is not None
    record = replace(record, source=replace(record.source, heading=np.zeros(300)))
    found = predicted_course(world.frame, world.p, record, FREELY)
    assert record.source is not None
    expected = integrated(
        lambda x, held: over_ground(x, held, water), record.source.start, record.source.raw[LEAD:]
    )
    # RK4 at 0.1 s: (dt/tau)^5/120 of a change of 0.5 at each helm, tau of 0.3 s at least: 2e-5,
    # and remembered for a few steps
    np.testing.assert_allclose(found.readings, expected, atol=1e-4)
    np.testing.assert_allclose(found.over_ground, found.readings, atol=1e-12)
    still = predicted_course(world.frame, world.without().p, record, FREELY)
    assert np.abs(still.readings - expected).max() > 0.03


# --- slopes --------------------------------------------------------------------------------


def held(p: np.ndarray, record: Record = TRUTH) -> np.ndarray:
    """Predicted readings at p, the start held as it is at the world's own parameters."""
    there = at_effects(WORLD.frame, p, record)
    here = at_effects(WORLD.frame, WORLD.p, record)
    there = replace(there, start=here.start, given=here.given)
    return readings(WORLD.frame, p, record, simulated(WORLD.frame, p, there, FREELY))


def moved(name: str, by: float) -> np.ndarray:
    p = WORLD.p.copy()
    p[WORLD.index(name)] += by * FREE.scale[NAMES.index(name)]
    return p


@pytest.fixture(scope="module")
def fitted() -> np.ndarray:
    found = readings_with_slopes(At(WORLD.frame, WORLD.p, FREE), TRUTH, FREELY)
    assert found is not None
    np.testing.assert_allclose(found.readings, held(WORLD.p), atol=1e-12)
    return found.slopes


def test_a_pitch_that_is_as_logged_is_the_one_behind_its_bias_and_scale() -> None:
    at, acting = At(WORLD.frame, WORLD.p, FREE), at_effects(WORLD.frame, WORLD.p, TRUTH)
    found = readings_with_slopes(at, TRUTH, COURSE)
    given = readings_with_slopes(at, replace(acting, source=None), COURSE)
    assert found is not None and given is not None
    np.testing.assert_array_equal(found.states, given.states)


COMMANDED = [n for n in NAMES if n in COMMANDS["vertical"] and "." in n]
READ = [n for n in NAMES if n in READING and n not in UNSEEN]
EXACT = [n for n in NAMES if n not in (*COMMANDED, *READING)]


@pytest.mark.parametrize("name", EXACT)
def test_slopes_by_coefficients_and_forces_are_differences(fitted, name) -> None:
    h = 1e-4
    expected = (held(moved(name, h)) - held(moved(name, -h))) / (2 * h)
    found = fitted[:, :, 4 + NAMES.index(name)]
    assert np.abs(found).max() > 1e-5
    if name == "T_nn":  # thrust as an input, for its moment and the race, is held
        tolerance = 0.1
    else:  # second order in h, and the few kinks of |w| and |q| within h of the course
        tolerance = 2e-5
    np.testing.assert_allclose(found, expected, atol=tolerance * np.abs(found).max())


@pytest.mark.parametrize("name", READ)
def test_slopes_by_sensing_effects_are_differences(fitted, name) -> None:
    h = READING_STEP
    expected = (held(moved(name, h)) - held(moved(name, -h))) / (2 * h)
    found = fitted[:, :, 4 + NAMES.index(name)]
    assert np.abs(found).max() > 1e-4
    # one-sided where the central difference is not: half a step of the second derivative
    np.testing.assert_allclose(found, expected, atol=1e-3 * np.abs(found).max())


@pytest.mark.parametrize("name", UNSEEN)
def test_what_only_a_log_of_depth_shows_is_in_no_reading(fitted, name) -> None:
    assert not fitted[:, :, 4 + NAMES.index(name)].any()
    assert "depth_m" in BY_ID[name.split(".")[0]].needs


@pytest.mark.parametrize("name", COMMANDED)
def test_slopes_by_effects_on_the_command_are_differences(fitted, name) -> None:
    """The inputs by a difference with this step, what they lead to exactly."""
    expected = (held(moved(name, SMALL_STEP)) - held(WORLD.p)) / SMALL_STEP
    found = fitted[:, :, 4 + NAMES.index(name)]
    assert np.abs(found).max() > 1e-4
    # half a step (0.01 of the prior) of the second derivative by inputs and states
    np.testing.assert_allclose(found, expected, atol=0.01 * np.abs(found).max())


def test_the_truth_predicts_its_own_record() -> None:
    at_once = {name: v for name, v in SHOWN.items() if not name.endswith("delay_s")}
    world = World.of(at_once, plane="vertical")
    record = recorded(world)
    found = predicted_course(world.frame, world.p, record, FREELY).readings
    # race and moment act with the speed of a first prediction, which is off by their own doing
    np.testing.assert_allclose(found, record.measured, atol=1e-6)
    blind = predicted_course(world.frame, world.without().p, record, FREELY).readings
    assert np.abs(blind - record.measured).max() > 0.2


def test_effects_at_zero_change_nothing() -> None:
    plain, off = World.of({}, plane="vertical"), WORLD.without()
    expected = predicted_course(plain.frame, plain.p, TRUTH, FREELY)
    found = predicted_course(off.frame, off.p, TRUTH, FREELY)
    # more terms, each of them zero, in another order of the sum
    np.testing.assert_allclose(found.readings, expected.readings, atol=1e-11)


# --- planted -------------------------------------------------------------------------------

PLANTED = {
    "offset": {"elevator_offset.offset_deg": 2.0},
    "servo": {"elevator_lag.lag_s": 0.5},
    "play": {"elevator_backlash.half_width_deg": 2.0},
    "thrust line": {"thrust_line_moment.z_m": 0.06},
    "pitch": {"pitch_bias.bias_deg": 2.0, "pitch_scale.fraction": 0.1},
    "gyro": {"q_bias.bias_degps": 0.5, "q_scale.fraction": 0.08},
    "mounting": {"dvl_pitch.pitch_deg": 3.0},
    "lever": {"dvl_lever_arm.dx_m": 0.3, "dvl_lever_arm.dz_m": 0.2},
    "late DVL": {"dvl_delay.delay_s": 0.3},
    "water": {"vertical_current.down_mps": 0.08},
    "current": {"current.north_mps": 0.15, "current.east_mps": -0.1},
    "linear damping": {"linear_damping.Z_w": -30.0, "linear_damping.M_q": -10.0},
    "gradient": {"buoyancy_gradient.gradient_npm": 0.5},
}


@pytest.mark.parametrize("method", ["output_error", "filter"])
@pytest.mark.parametrize("name", PLANTED)
def test_a_planted_effect_comes_back(name: str, method: str) -> None:
    """From four short records at several headings, depths and rates of the propeller."""
    world = World.of(PLANTED[name], plane="vertical")
    names = ["X_uu", "Z_uw", "Z_uud", "M_uq", "M_uud", "T_nn", *world.every_effect()]
    records = [recorded(world, 400, seed, NOISE) for seed in range(4)]
    records = [with_speed(r, r.measured[:, 0]) for r in records]  # on which the thrust depends
    setup = setup_for(world, records, names)
    stage = setup.plan.stage[0]
    out = run_stage(setup, setup.start, stage.model_copy(update={"method": "output_error"}))
    if method == "filter":  # which begins near the truth, as the diagnosis hands effects on
        out = run_stage(setup, out.parameters, stage)
    std = np.sqrt(np.diag(out.covariance)) * setup.prior_std[out.free]
    at = [world.index(n) for n in world.every_effect()]
    columns = [list(out.free).index(i) for i in at]
    assert (np.abs(out.parameters[at] - world.p[at]) < 4.0 * std[columns]).all()
    assert (std[columns] < 0.3 * np.abs(world.p[at])).all()  # it is seen


# --- the fin of the plane ------------------------------------------------------------------


@pytest.mark.parametrize("fin", ["rudder", "elevator"])
@pytest.mark.parametrize(("plane", "own"), [("horizontal", "rudder"), ("vertical", "elevator")])
def test_a_plan_allows_the_fin_of_the_plane_by_either_name(plane, own, fin) -> None:
    found = allowed((f"{fin}_lag", f"{fin}_rate_limit", "propeller_lag"), plane, 2.0, 1.0)
    expected = {f"{own}_lag.lag_s", f"{own}_rate_limit.rate_degps", "propeller_lag.lag_s"}
    assert set(found.start) == set(found.prior_std) == expected
    # 0.035 L/U
    assert found.prior_std[f"{own}_lag.lag_s"] == pytest.approx(0.07)
    assert found.ids(plane) == tuple(e for e in BY_ID if f"{e}." in " ".join(expected))
    assert parameter_of(f"{own}_lag.lag_s").nuisance_std == 0.035


def test_both_names_of_a_fin_are_one_nuisance() -> None:
    found = allowed(("rudder_lag", "elevator_lag"), "vertical", 2.0)
    assert set(found.start) == {"elevator_lag.lag_s"}


def model(plane: str, effect: str) -> dict:
    """A model with one effect, as it stands in a file."""
    return {
        "vehicle": "any",
        "plane": plane,
        "filter": "ekf",
        "length_m": 1.6,
        "density_kgpm3": 1025.0,
        "rigid_body": {
            "mass_kg": 30.0,
            "x_g_m": 0.0,
            "z_g_m": 0.02,
            "inertia_kgm2": 3.0,
            "weight_n": 300.0,
            "buoyancy_n": 301.0,
        },
        "sensing": ORIGIN.model_dump(),
        "coefficients": [],
        "effects": [{"id": effect, "internal": {}}],
    }


def test_a_model_of_an_earlier_version_whose_elevator_was_a_rudder_is_refused() -> None:
    for plane, effect in (("horizontal", "rudder_lag"), ("vertical", "elevator_lag")):
        kept = as_model(model(plane, effect), IdentifiedModel, Path("model.json"))
        assert kept.effects[0]["id"] == effect
    with pytest.raises(StageError, match="'rudder_lag' does not act in the vertical plane") as told:
        as_model(model("vertical", "rudder_lag"), IdentifiedModel, Path("model.json"))
    assert "it is 'elevator_lag' now" in told.value.problem
    assert "identify it again" in told.value.problem


def test_a_model_in_which_something_stands_twice_is_refused() -> None:
    """Changed by hand it may: no export has room for two values (found by the fuzzer)."""
    sound = model("vertical", "elevator_lag")
    twice = {**sound, "effects": [*sound["effects"], *sound["effects"]]}
    with pytest.raises(StageError, match="'elevator_lag' stands in it twice"):
        as_model(twice, IdentifiedModel, Path("model.json"))
    row = identified("dive_trial", "vertical").model.coefficients[0].model_dump()
    with pytest.raises(StageError, match=f"'{row['symbol']}' stands in it twice"):
        as_model({**sound, "coefficients": [row, row]}, IdentifiedModel, Path("model.json"))
