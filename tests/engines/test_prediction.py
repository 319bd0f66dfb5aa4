"""The one prediction with every effect in it: its slopes, and what the filters take of it."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import savgol_filter

from auvident.engines.carried import predicted_course
from auvident.engines.prediction import (
    READING_STEP,
    SMALL_STEP,
    At,
    at_effects,
    input_slopes,
    linear_about,
    readings,
    readings_with_slopes,
    seen_rows,
    simulated,
)
from auvident.engines.records import Record
from auvident.engines.smoothing import local_parabolas, smoothed
from auvident.physics.actuation import COMMAND
from auvident.physics.sensing import READING
from auvident.schema.effects import in_plane, parameter_of
from tests.engines.effects_world import COEFFICIENTS, COURSE, World, recorded

# every effect of the horizontal plane at some practical sizes
SHOWN = {
    "current.north_mps": 0.12,
    "current.east_mps": -0.2,
    "current_drift.north_early_mps_per_1000_s": 0.2,
    "current_drift.east_early_mps_per_1000_s": -0.1,
    "current_drift.north_late_mps_per_1000_s": 0.15,
    "current_drift.east_late_mps_per_1000_s": 0.25,
    "rudder_offset.offset_deg": 1.0,
    "rudder_lag.lag_s": 0.34,
    "rudder_rate_limit.rate_degps": 60.0,
    "rudder_delay.delay_s": 0.13,
    "rudder_backlash.half_width_deg": 1.0,
    "rudder_deadband.deadband_deg": 0.8,
    "rudder_asymmetry.gain": 0.1,
    "rudder_stall.angle_deg": 25.0,
    "propeller_lag.lag_s": 0.6,
    "propeller_race.c_m2ps2pn": 0.01,
    "thrust_sag.fraction_per_1000_s": 0.2,
    "thrust_step.fraction": 0.1,
    "thrust_step.time_s": 215.0,
    "thrust_step.over_s": 20.0,
    "dvl_delay.delay_s": 0.24,
    "gyro_delay.delay_s": -0.13,
    "dvl_misalignment.yaw_deg": 1.5,
    "dvl_scale.fraction": 0.02,
    "dvl_lever_arm.dx_m": 0.1,
    "dvl_lever_arm.dy_m": 0.05,
    "gyro_bias.bias_degps": 0.2,
    "gyro_scale.fraction": -0.02,
    "propeller_side_force.Y_nn": 0.004,
    "propeller_side_force.N_nn": -0.001,
    "hull_asymmetry.Y_0": 0.4,
    "hull_asymmetry.N_0": 0.1,
    "sway_cross_flow.Y_v|r|": -15.0,
    "sway_cross_flow.Y_r|v|": 10.0,
    "yaw_cross_flow.N_v|r|": -4.0,
    "yaw_cross_flow.N_r|v|": -6.0,
    "cubic_damping.N_vvr": -20.0,
    "cubic_damping.N_rrr": -3.0,
    "turning_drag.X_vvu": -10.0,
    "turning_drag.X_rru": -2.0,
    "linear_drag.X_u": -0.8,
    "linear_damping.Y_v": -15.0,
    "linear_damping.N_r": -5.0,
    "roll_coupling.Y_uuphi": 8.0,
    "roll_coupling.N_uuphi": 2.0,
    "dvl_height.dz_m": 0.1,
    "weight_excess.W-B_n": 2.0,
}
WORLD = World.of(SHOWN)
TRUTH = recorded(WORLD)
DELAYS = ("dvl_delay.delay_s", "gyro_delay.delay_s")
NAMES = [*COEFFICIENTS, *WORLD.every_effect()]
FREE = WORLD.free(NAMES)


def test_every_effect_is_tried() -> None:
    assert set(WORLD.frame.structure.effects) == {e.id for e in in_plane("horizontal")}


def held(p: np.ndarray, record: Record = TRUTH, world: World = WORLD) -> np.ndarray:
    """Predicted readings at p, start and heading held as they are at the world's own parameters."""
    there, here = at_effects(world.frame, p, record), at_effects(world.frame, world.p, record)
    there = replace(there, start=here.start, given=here.given)
    states = simulated(world.frame, p, there, COURSE)
    return readings(world.frame, p, record, states)


def moved(name: str, by: float) -> np.ndarray:
    p = WORLD.p.copy()
    p[WORLD.index(name)] += by * FREE.scale[NAMES.index(name)]
    return p


def slopes_of(name: str, fitted: np.ndarray) -> np.ndarray:
    return fitted[:, :3, 4 + NAMES.index(name)]


@pytest.fixture(scope="module")
def fitted() -> np.ndarray:
    found = readings_with_slopes(At(WORLD.frame, WORLD.p, FREE), TRUTH, COURSE)
    assert found is not None
    np.testing.assert_allclose(found.readings, held(WORLD.p), atol=1e-12)
    return found.slopes


@pytest.mark.parametrize("gain", [None, np.array([0.1, 0.1, 0.1, 0.0])])
def test_a_prediction_follows_the_states_behind_the_readings(gain) -> None:
    at, acting = At(WORLD.frame, WORLD.p, FREE), at_effects(WORLD.frame, WORLD.p, TRUTH)
    assert not np.allclose(acting.given, TRUTH.given)
    found = readings_with_slopes(at, TRUTH, COURSE, gain)
    given = readings_with_slopes(at, replace(acting, source=None), COURSE, gain)
    assert found is not None and given is not None
    np.testing.assert_array_equal(found.states, given.states)


# --- slopes --------------------------------------------------------------------------------

EXACT = [n for n in NAMES if n not in COMMAND and n not in READING]


@pytest.mark.parametrize("name", EXACT)
def test_slopes_by_coefficients_and_forces_are_differences(fitted, name) -> None:
    h = 1e-5
    expected = (held(moved(name, h)) - held(moved(name, -h))) / (2 * h)
    found = slopes_of(name, fitted)
    assert np.abs(found).max() > 1e-5
    # second order in h: 1e-8 of the slope, and kinks of |v| and |r| of which a few are within h
    np.testing.assert_allclose(found, expected[:, :3], atol=2e-5 * np.abs(found).max())


@pytest.mark.parametrize("name", [n for n in NAMES if n in READING])
def test_slopes_by_sensing_effects_are_differences(fitted, name) -> None:
    h = READING_STEP
    expected = (held(moved(name, h)) - held(moved(name, -h))) / (2 * h)
    found = slopes_of(name, fitted)
    assert np.abs(found).max() > 1e-4
    # one-sided where the central difference is not: half a step of the second derivative, which
    # is that of an angle of 0.04 rad or of an interpolation in time, linear but at its knots
    np.testing.assert_allclose(found, expected[:, :3], atol=1e-3 * np.abs(found).max())


@pytest.mark.parametrize("name", [n for n in NAMES if n in COMMAND])
def test_slopes_by_effects_on_the_command_are_differences(fitted, name) -> None:
    """The inputs by a difference with this step, what they lead to exactly."""
    expected = (held(moved(name, SMALL_STEP)) - held(WORLD.p)) / SMALL_STEP
    found = slopes_of(name, fitted)
    assert np.abs(found).max() > 1e-4
    # half a step (0.01 of the prior) of the second derivative by inputs and states
    np.testing.assert_allclose(found, expected[:, :3], atol=0.01 * np.abs(found).max())


def test_slopes_by_the_start_are_differences(fitted) -> None:
    h = 1e-5
    for i in range(3):
        ends = []
        for sign in (1.0, -1.0):
            start = TRUTH.start.copy()
            start[i] += sign * h
            record = replace(TRUTH, start=start)
            acting = at_effects(WORLD.frame, WORLD.p, record)
            states = simulated(WORLD.frame, WORLD.p, acting, COURSE)
            ends.append(readings(WORLD.frame, WORLD.p, record, states))
        expected = (ends[0] - ends[1]) / (2 * h)
        # kinks of |v| and |r| crossed within h of the course
        np.testing.assert_allclose(fitted[:, :3, i], expected[:, :3], atol=2e-4)


def test_effects_that_are_off_take_the_step_to_be_expected() -> None:
    """Play, dead band and limits do nothing when they are small."""
    names = [
        "rudder_backlash.half_width_deg",
        "rudder_deadband.deadband_deg",
        "rudder_rate_limit.rate_degps",
        "rudder_lag.lag_s",
    ]
    without = WORLD.without()
    free = without.free(names)
    acting = at_effects(without.frame, without.p, TRUTH)
    slopes, columns = input_slopes(without.frame, without.p, acting, free)
    assert columns.tolist() == [0, 1, 2, 3]
    base = acting.inputs
    for k, name in enumerate(names):
        step, p = parameter_of(name).step, without.p.copy()
        p[without.index(name)] += step * free.scale[k]
        there = at_effects(without.frame, p, TRUTH).inputs
        np.testing.assert_allclose(slopes[:, :, k], (there - base) / step, atol=1e-12)
        assert np.abs(slopes[:, 0, k]).max() > 0.01


# --- the record as the effects make it -----------------------------------------------------


def test_the_truth_predicts_its_own_record() -> None:
    """Start, acting inputs, motion and readings belong together; without late sensors exactly."""
    at_once = {name: v for name, v in SHOWN.items() if not name.endswith("delay_s")}
    world, freely = World.of(at_once), np.ones(4, dtype=bool)
    record = recorded(world)
    found = predicted_course(world.frame, world.p, record, freely).readings
    # the race acts with the speed of a first prediction, which is off by the race's own doing;
    # the rest is rounding, grown over 30 s
    np.testing.assert_allclose(found, record.measured, atol=1e-6)
    blind = predicted_course(world.frame, world.without().p, record, freely).readings
    assert np.abs(blind - record.measured).max() > 0.2


def test_a_start_that_a_fit_moved_stays_moved() -> None:
    away = np.array([0.1, -0.05, 0.02, 0.0])
    record = replace(TRUTH, start=TRUTH.start + away)
    found = at_effects(WORLD.frame, WORLD.p, record).start
    expected = at_effects(WORLD.frame, WORLD.p, TRUTH).start + away
    np.testing.assert_allclose(found, expected, atol=1e-14)


def test_without_effects_a_record_passes_as_it_is() -> None:
    plain = World.of({})
    assert at_effects(plain.frame, plain.p, TRUTH) is TRUTH


def test_effects_at_zero_change_nothing() -> None:
    """A structure with every effect at zero predicts what the plain one does."""
    plain, off = World.of({}), WORLD.without()
    expected = predicted_course(plain.frame, plain.p, TRUTH, COURSE)
    found = predicted_course(off.frame, off.p, TRUTH, COURSE)
    # more terms, each of them zero, in another order of the sum
    np.testing.assert_allclose(found.readings, expected.readings, atol=1e-11)


# --- to first order, for the filters -------------------------------------------------------


def linear_readings(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Readings to first order, and exact, of the smoothed states behind the log."""
    acting = at_effects(WORLD.frame, WORLD.p, TRUTH)
    linear, matrix = linear_about(WORLD.frame, WORLD.p, [acting], FREE, len(TRUTH.time_s))
    states = smoothed(acting.given, WORLD.frame.dt_s)
    first = states @ matrix.T + linear.offset[0]
    first = first + linear.reading_slopes[0] @ theta[linear.reading_columns]
    p = WORLD.p.copy()
    p[FREE.positions] += FREE.scale * theta
    return first, readings(WORLD.frame, p, TRUTH, states)


def test_linear_readings_are_exact_where_they_are_taken() -> None:
    first, exact = linear_readings(np.zeros(len(NAMES)))
    np.testing.assert_allclose(first, exact, atol=1e-13)


def between_the_knots(theta: np.ndarray, farthest: float) -> np.ndarray:
    """Directions along which, as far as that, no delay of a sensor leaves its sampling interval.

    Late readings are interpolated linearly. Within an interval of the log they are smooth in the
    delay; where a delay goes beyond it, the slope jumps, and what is missing is of first order.
    """
    theta = theta.copy()
    for name in DELAYS:
        k = NAMES.index(name)
        steps = WORLD.p[WORLD.index(name)] / WORLD.frame.dt_s
        room = min(steps - np.floor(steps), np.ceil(steps) - steps) * WORLD.frame.dt_s
        most = room / (farthest * FREE.scale[k])
        theta[k] = np.clip(theta[k], -most, most)
    return theta


def test_linear_readings_are_right_to_first_order() -> None:
    theta = between_the_knots(np.random.default_rng(4).normal(size=len(NAMES)), 0.2)
    far, near = (np.abs(np.subtract(*linear_readings(s * theta))).max() for s in (0.2, 0.1))
    change = np.abs(np.subtract(linear_readings(0.2 * theta)[1], linear_readings(0 * theta)[1]))
    assert far < 0.05 * change.max()
    assert near < 0.3 * far  # a quarter, but for the step of the slopes and terms of third order


def test_linear_inputs_are_right_to_first_order() -> None:
    smooth = ("rudder_offset", "rudder_asymmetry", "rudder_stall", "thrust_sag", "propeller_race")
    theta = np.random.default_rng(5).normal(size=len(NAMES))
    theta *= [n.split(".")[0] in smooth for n in NAMES]
    acting = at_effects(WORLD.frame, WORLD.p, TRUTH)
    linear, _ = linear_about(WORLD.frame, WORLD.p, [acting], FREE, len(TRUTH.time_s))

    def apart(scale: float) -> float:
        p = WORLD.p.copy()
        p[FREE.positions] += scale * FREE.scale * theta
        first = acting.inputs + linear.input_slopes[0] @ (scale * theta[linear.input_columns])
        return float(np.abs(at_effects(WORLD.frame, p, TRUTH).inputs - first).max())

    assert apart(0.0) == 0.0
    assert apart(0.1) < 0.4 * apart(0.2)
    changed = np.abs(linear.input_slopes[0] @ theta[linear.input_columns]).max()
    assert apart(0.1) < 0.05 * 0.1 * changed


def test_padding_of_the_linear_form_is_zero() -> None:
    acting = at_effects(WORLD.frame, WORLD.p, TRUTH)
    n = len(TRUTH.time_s)
    linear, _ = linear_about(WORLD.frame, WORLD.p, [acting], FREE, n + 40)
    for array in (linear.input_slopes, linear.offset, linear.reading_slopes):
        assert array.shape[1] == n + 40
        assert not array[:, n:].any()
        assert array[:, :n].any()


def test_readings_from_before_the_record_are_not_compared() -> None:
    measured = TRUTH.measured.copy()
    measured[50:60, 0] = np.nan
    found = seen_rows(At(WORLD.frame, WORLD.p, FREE), replace(TRUTH, measured=measured), COURSE)
    rows = np.arange(len(measured))
    np.testing.assert_array_equal(found[:, 0], (rows >= 3) & ((rows < 50) | (rows >= 60)))
    np.testing.assert_array_equal(found[:, 1], rows >= 3)  # 0.24 s: nothing before row 2.4
    np.testing.assert_array_equal(found[:, 2], rows <= rows[-1] - 2)  # 0.13 s early
    assert not found[:, 3].any()


@pytest.mark.parametrize(("rows", "window"), [(15, 15), (16, 15), (400, 5), (400, 31)])
def test_local_parabolas_are_those_of_savitzky_and_golay(rows, window) -> None:
    values = np.random.default_rng(rows).normal(size=(rows, 4))
    expected = savgol_filter(values, window, 2, axis=0)
    np.testing.assert_allclose(local_parabolas(values, window), expected, atol=1e-12)
