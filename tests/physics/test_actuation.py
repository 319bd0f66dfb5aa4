"""What becomes of a command: closed forms, a reference loop, and invariants of the servo."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from auvident.physics.actuation import (
    COMMAND,
    FLOW,
    FORCE,
    NO_STEP,
    NOWHERE,
    PITCH,
    RACED,
    REACH,
    ROLL,
    SUBSTEPS,
    THRUST,
    acting_inputs,
    acting_with_steps,
    command_values,
    follow,
    play_after,
    race_flow,
    servo_parts,
    turning_points,
    unequal,
)
from auvident.physics.terms import structure_of
from auvident.schema.effects import parameter_of

DT = 0.1
T_NN, T_NU = 0.03, -0.3
seeds = st.integers(0, 2**32 - 1)


def effects(**shown: float) -> np.ndarray:
    """Effects in the order of `COMMAND`; sizes as shown: rudder_lag__lag_s=0.3."""
    e = np.zeros(len(COMMAND))
    e[COMMAND.index("T_nn")], e[COMMAND.index("T_nu")] = T_NN, T_NU
    for key, value in shown.items():
        name = key.replace("__", ".")
        e[COMMAND.index(name)] = parameter_of(name).internal(value) if "." in name else value
    return e


def acting(raw: np.ndarray, dt: float = DT, start_s: float = 0.0, **shown: float) -> np.ndarray:
    n = len(raw)
    elapsed, speed = start_s + dt * np.arange(n), np.linspace(1.0, 1.5, n)
    return acting_inputs(raw, elapsed, speed, np.zeros(n), np.zeros(n), dt, effects(**shown))


def inputs(own: np.ndarray, revs: float = 15.0) -> np.ndarray:
    return np.column_stack([own, np.full(len(own), 0.03), np.full(len(own), revs)])


def rudder(own: np.ndarray, dt: float = DT, **shown: float) -> np.ndarray:
    """Angle that acts for a command."""
    return acting(inputs(own), dt, **shown)[:, 0]


def helms(seed: int, n: int = 120) -> np.ndarray:
    """A command of held angles, zero at both ends, as step means."""
    rng = np.random.default_rng(seed)
    held = np.repeat(rng.uniform(-0.4, 0.4, n // 8), 8)
    held[:16], held[-24:] = 0.0, 0.0
    return held


# --- nothing -------------------------------------------------------------------------------


@settings(max_examples=30, deadline=None)
@given(seeds)
def test_without_effects_the_inputs_pass_to_the_last_bit(seed) -> None:
    rng = np.random.default_rng(seed)
    n = 50
    raw = rng.normal(size=(n, 3)) * [0.3, 0.3, 20.0]
    roll, pitch, speed = 0.1 * rng.normal(size=(3, n))
    out = acting_inputs(raw, DT * np.arange(n), speed, roll, pitch, DT, effects())
    np.testing.assert_array_equal(out[:, :3], raw)
    np.testing.assert_array_equal(out[:, THRUST], 1.0)
    np.testing.assert_array_equal(out[:, ROLL], roll)
    np.testing.assert_array_equal(out[:, PITCH], pitch)
    np.testing.assert_array_equal(out[:, FORCE:], 0.0)


def test_values_come_by_name_and_absent_ones_are_zero() -> None:
    structure = structure_of("horizontal", ("rudder_lag", "current"))
    p = np.arange(1.0, len(structure.parameters) + 1.0)
    found = dict(zip(COMMAND, command_values("horizontal", structure.parameters, p), strict=True))
    there = {
        name: p[structure.index(name)] for name in ("rudder_lag.lag_s", "T_nn", "T_nu", "x_fin")
    }
    assert found == dict.fromkeys(COMMAND, 0.0) | there


# --- delay ---------------------------------------------------------------------------------


@pytest.mark.parametrize("steps", [1, 4, -2])
def test_a_delay_of_whole_steps_shifts(steps) -> None:
    command = np.random.default_rng(1).normal(size=60)
    found = rudder(command, rudder_delay__delay_s=steps * DT)
    rows = np.clip(np.arange(60) - steps, 0, 59)  # the ends are held
    # the share of the neighbour is the rounding of delay over step
    np.testing.assert_allclose(found, command[rows], atol=1e-14)


@settings(max_examples=40, deadline=None)
@given(seeds, st.floats(-1.0, 1.5))
def test_a_delay_by_fractions_conserves_the_mean(seed, delay) -> None:
    command = helms(seed)
    found = rudder(command, rudder_delay__delay_s=delay)
    assert found.sum() == pytest.approx(command.sum(), abs=1e-12)  # zero at both ends
    centre = DT * np.arange(len(command))
    moved = centre @ (found - command) * DT  # first moment: all of it arrives `delay` later
    assert moved == pytest.approx(delay * command.sum() * DT, abs=1e-11)


@pytest.mark.parametrize("delay", [0.03, 0.27, -0.14])
def test_a_delay_by_fractions_is_the_mean_of_the_delayed_command(delay) -> None:
    """Against the command held on a grid a hundred times finer, shifted and averaged."""
    command = helms(3)
    fine = np.roll(np.repeat(command, 100), round(1000 * delay))
    expected = fine.reshape(-1, 100).mean(axis=1)
    np.testing.assert_allclose(rudder(command, rudder_delay__delay_s=delay), expected, atol=1e-14)


# --- lag and slew limit --------------------------------------------------------------------


def lagged(command: np.ndarray, lag: float, dt: float) -> np.ndarray:
    """Exact step means of d' = (c - d) / lag for a held command."""
    now, out = command[0], np.empty(len(command))
    for k, c in enumerate(command):
        after = c + (now - c) * math.exp(-dt / lag)
        out[k] = c - lag * (after - now) / dt  # integral of the equation over the step
        now = after
    return out


@pytest.mark.parametrize("lag", [0.1, 0.3, 1.5])
def test_a_lag_of_the_rudder_is_the_exact_solution(lag) -> None:
    command = helms(4)
    found = rudder(command, rudder_lag__lag_s=lag)
    np.testing.assert_allclose(found, lagged(command, lag, DT), atol=1e-12)
    assert np.abs(found - command).max() > 0.1


@pytest.mark.parametrize("lag", [0.1, 0.7, 4.0])
def test_a_lag_of_the_propeller_is_the_exact_solution(lag) -> None:
    rate = np.repeat([10.0, 20.0, 5.0], 40)
    raw = np.column_stack([np.zeros(120), np.zeros(120), rate])
    found = acting(raw, propeller_lag__lag_s=lag)
    np.testing.assert_allclose(found[:, 2], lagged(rate, lag, DT), rtol=1e-12)
    np.testing.assert_array_equal(found[:, :2], raw[:, :2])


@pytest.mark.parametrize(("limit", "reached_s"), [(20.0, 0.5), (5.0, 2.0)])
def test_a_slew_limit_takes_the_exact_time(limit, reached_s) -> None:
    """A helm of 10 degrees; both times are whole steps."""
    command = np.where(np.arange(60) < 10, 0.0, np.radians(10.0))
    found = rudder(command, rudder_rate_limit__rate_degps=limit)
    since = DT * (np.arange(60) - 10) + 0.5 * DT  # middle of each step, where a ramp has its mean
    ramp = np.radians(np.clip(limit * since, 0.0, 10.0))
    np.testing.assert_allclose(found, ramp, atol=1e-12)
    assert found[10 + round(reached_s / DT)] == pytest.approx(np.radians(10.0), abs=1e-12)


@settings(max_examples=30, deadline=None)
@given(seeds, st.floats(2.0, 60.0), st.floats(0.0, 1.0))
def test_no_rudder_is_faster_than_its_limit_or_overshoots(seed, limit, lag) -> None:
    command = helms(seed)
    found = rudder(command, rudder_rate_limit__rate_degps=limit, rudder_lag__lag_s=lag)
    assert np.abs(np.diff(found)).max() <= np.radians(limit) * DT * (1 + 1e-12)
    assert np.abs(found).max() <= np.abs(command).max() + 1e-12


@settings(max_examples=20, deadline=None)
@given(seeds, st.floats(3.0, 400.0))
def test_a_slew_limit_gives_the_means_of_the_ramp(seed, limit) -> None:
    """Against the ramp followed in steps of a thousandth, also where a helm ends within a step."""
    command, fine = helms(seed), 1000
    found, most = rudder(command, rudder_rate_limit__rate_degps=limit), np.radians(limit) * DT
    expected, angle = np.empty(len(command)), command[0]
    for k, target in enumerate(command):
        away = target - angle
        way = np.sign(away) * np.minimum(most * (np.arange(fine) + 0.5) / fine, abs(away))
        expected[k] = angle + way.mean()
        angle += np.sign(away) * min(most, abs(away))
    # of a step in which the helm ends, one piece is off by its own way at most
    np.testing.assert_allclose(found, expected, atol=most / fine**2 + 1e-12)


@pytest.mark.parametrize(
    "effects",
    [
        {"rudder_rate_limit__rate_degps": 1e8},
        {"rudder_lag__lag_s": 1e-7},
        {"rudder_rate_limit__rate_degps": 1e8, "rudder_lag__lag_s": 1e-7},
    ],
)
def test_what_is_almost_off_is_almost_nothing(effects) -> None:
    """A fit that comes from the one has to find the other."""
    command = helms(6)
    np.testing.assert_allclose(rudder(command, **effects), command, atol=1e-5)


def test_a_limit_that_is_never_reached_changes_nothing() -> None:
    command = helms(5)
    fast = {"rudder_rate_limit__rate_degps": 1e6}
    np.testing.assert_array_equal(
        rudder(command, rudder_lag__lag_s=0.3), rudder(command, rudder_lag__lag_s=0.3, **fast)
    )


# --- play, dead band, gain, offset, stall --------------------------------------------------


def play(command: np.ndarray, half_width: float) -> np.ndarray:
    """A slot that is pushed along by a pin: it moves only where the pin touches an end."""
    at, out = command[0], []
    for pin in command:
        if pin - at > half_width:
            at = pin - half_width
        elif at - pin > half_width:
            at = pin + half_width
        out.append(at)
    return np.array(out)


@settings(max_examples=30, deadline=None)
@given(seeds, st.floats(0.1, 8.0))
def test_backlash_is_the_reference_loop(seed, degrees) -> None:
    command = np.cumsum(np.random.default_rng(seed).normal(size=200)) * 0.03
    found = rudder(command, rudder_backlash__half_width_deg=degrees)
    np.testing.assert_allclose(found, play(command, math.radians(degrees)), atol=1e-14)


def test_backlash_opens_a_loop_of_its_width() -> None:
    """A slow sweep up and down: in the middle the two ways are twice the half width apart."""
    up = np.linspace(-0.3, 0.3, 61)
    command = np.concatenate([np.zeros(5), up[31:], up[::-1], up])
    found = rudder(command, rudder_backlash__half_width_deg=3.0)
    width = math.radians(3.0)
    down, again = found[35:96], found[96:]
    np.testing.assert_allclose(down[20:], up[::-1][20:] + width, atol=1e-12)
    np.testing.assert_allclose(again[20:], up[20:] - width, atol=1e-12)
    assert found.max() == pytest.approx(0.3 - width, abs=1e-12)


@given(seeds, st.floats(0.0, 20.0), st.floats(0.0, 3.0))
@settings(max_examples=60, deadline=None)
def test_turning_points_are_all_that_a_play_remembers(seed, degrees, dead) -> None:
    rng = np.random.default_rng(seed)
    past = np.round(rng.normal(scale=0.2, size=rng.integers(1, 300)), 2)
    past[rng.random(len(past)) < 0.1] = np.nan
    points, whole = turning_points(past), past[np.isfinite(past)]
    e = effects(rudder_backlash__half_width_deg=degrees, rudder_deadband__deadband_deg=dead)
    assert play_after(points, 0.1, e) == play_after(whole, 0.1, e)
    assert len(points) <= 40  # of up to 300: swings that shrink to 0.01 from some 0.6


@pytest.mark.parametrize("delay_s", [0.0, 0.15])
def test_a_play_is_where_the_orders_before_the_record_left_it(delay_s) -> None:
    """A rudder that was last put back from starboard stays to starboard, however long ago."""
    command = np.concatenate([np.zeros(5), np.full(50, 0.2), np.zeros(400), helms(3)])
    shown = {"rudder_backlash__half_width_deg": 3.0, "rudder_delay__delay_s": delay_s}
    whole, first = rudder(command, **shown), 300
    assert whole[first] == pytest.approx(math.radians(3.0))
    raw, zero = inputs(command[first:]), np.zeros(len(command) - first)
    given = (raw, zero, zero + 1.0, zero, zero, DT, effects(**shown), 0.0, 0, NOWHERE, NO_STEP)
    found, _ = acting_with_steps(*given, turning_points(command[:first]))
    np.testing.assert_allclose(found[:, 0], whole[first:], atol=1e-14)
    forgotten, _ = acting_with_steps(*given)
    assert forgotten[0, 0] == 0.0


def test_commands_within_the_play_or_the_dead_band_move_nothing() -> None:
    small = np.radians(2.0) * np.sin(np.arange(100))
    small[0] = 0.0
    np.testing.assert_array_equal(rudder(small, rudder_backlash__half_width_deg=2.1), 0.0)
    np.testing.assert_array_equal(rudder(small, rudder_deadband__deadband_deg=2.1), 0.0)


STATIC = {
    "dead band": (
        {"rudder_deadband__deadband_deg": 2.0},
        lambda d: np.sign(d) * np.maximum(np.abs(d) - np.radians(2.0), 0.0),
    ),
    "asymmetry": ({"rudder_asymmetry__gain": 0.2}, lambda d: d * np.where(d > 0, 1.2, 0.8)),
    "offset": ({"rudder_offset__offset_deg": -1.5}, lambda d: d - np.radians(1.5)),
    "stall": (
        {"rudder_stall__angle_deg": 15.0},
        lambda d: d / np.sqrt(1.0 + (d / np.radians(15.0)) ** 2),
    ),
}


@pytest.mark.parametrize("name", STATIC)
def test_what_has_no_memory_is_its_closed_form(name) -> None:
    shown, expected = STATIC[name]
    command = np.linspace(-0.5, 0.5, 101)
    found = rudder(command, **shown)
    np.testing.assert_allclose(found, expected(command), atol=1e-14)
    assert np.abs(found - command).max() > 0.02


def test_a_stalled_rudder_at_its_angle_acts_as_one_laid_by_seven_tenths() -> None:
    found = rudder(np.full(3, np.radians(20.0)), rudder_stall__angle_deg=20.0)
    np.testing.assert_allclose(found, np.radians(20.0) / math.sqrt(2.0), rtol=1e-14)


# --- propeller: race, sag, step ------------------------------------------------------------


@pytest.mark.parametrize("speed", [1.3, -0.8, 0.05])
def test_the_race_adds_the_thrust_to_the_square_of_the_flow(speed) -> None:
    n, revs, c = 5, 15.0, 0.02
    raw = inputs(np.full(n, 0.2), revs)
    zero = np.zeros(n)
    e = effects(propeller_race__c_m2ps2pn=c, thrust_step__fraction=0.25, x_fin=-0.7)
    found = acting_inputs(raw, zero, np.full(n, speed), zero, zero, DT, e)
    thrust = 0.75 * (T_NN * revs**2 + T_NU * revs * speed)
    flow = math.sqrt(speed**2 + c * thrust) - abs(speed)
    np.testing.assert_array_equal(found[:, 0], 0.2)
    np.testing.assert_allclose(found[:, RACED], c * thrust, rtol=1e-13)
    np.testing.assert_allclose(found[:, FLOW], flow, rtol=1e-12)
    np.testing.assert_allclose(found[:, REACH], -0.7 * flow, rtol=1e-12)


def test_a_race_that_would_turn_the_flow_stops_it() -> None:
    assert race_flow(-5.0, 1.3) == -1.3


def test_the_thrust_sags_through_the_trial_and_steps_once() -> None:
    raw = inputs(np.zeros(100))
    shown = {"thrust_sag__fraction_per_1000_s": 0.3, "thrust_step__fraction": 0.1}
    found = acting(raw, start_s=500.0, thrust_step__time_s=504.95, **shown)
    elapsed = 500.0 + DT * np.arange(100)
    expected = 1.0 - 0.3 * elapsed / 1000.0 - 0.1 * (np.arange(100) >= 50)
    np.testing.assert_allclose(found[:, THRUST], expected, rtol=1e-14)
    np.testing.assert_array_equal(found[:, :3], raw)


def test_a_step_of_which_an_interval_is_known_is_the_mean_of_all_steps_in_it() -> None:
    shown = {"thrust_step__fraction": 0.2, "thrust_step__time_s": 504.95}
    raw = inputs(np.zeros(100))
    found = acting(raw, start_s=500.0, thrust_step__over_s=4.0, **shown)[:, THRUST]
    times = 502.95 + 4.0 * (np.arange(400) + 0.5) / 400
    steps = [acting(raw, start_s=500.0, **shown | {"thrust_step__time_s": t}) for t in times]
    np.testing.assert_allclose(found, np.mean(steps, axis=0)[:, THRUST], atol=0.2 / 400)
    assert found.min() == 0.8 and found.max() == 1.0


# --- together ------------------------------------------------------------------------------

ALL = {
    "rudder_deadband__deadband_deg": 1.0,
    "rudder_backlash__half_width_deg": 1.5,
    "rudder_asymmetry__gain": 0.1,
    "rudder_lag__lag_s": 0.3,
    "rudder_rate_limit__rate_degps": 15.0,
    "rudder_stall__angle_deg": 25.0,
}


@settings(max_examples=20, deadline=None)
@given(seeds, st.integers(1, 9))
def test_a_delayed_servo_does_the_same_later(seed, steps) -> None:
    command = helms(seed)
    found = rudder(command, **ALL, rudder_delay__delay_s=steps * DT)
    at_once = rudder(command, **ALL)
    np.testing.assert_allclose(found[steps:], at_once[:-steps], atol=1e-13)


@settings(max_examples=20, deadline=None)
@given(seeds)
def test_the_mirrored_command_gives_the_mirrored_rudder(seed) -> None:
    command = helms(seed)
    mirrored = ALL | {"rudder_asymmetry__gain": -0.1}
    np.testing.assert_array_equal(rudder(-command, **mirrored), -rudder(command, **ALL))


def test_the_servo_does_not_care_for_the_step_of_the_log() -> None:
    """The same angle at 10 and at 20 Hz, but for the substeps of the servo."""
    command = helms(6)
    coarse = rudder(command, **ALL)
    fine = rudder(np.repeat(command, 2), dt=DT / 2, **ALL).reshape(-1, 2).mean(axis=1)
    # where the limit ends within a substep: at most half a substep of the slewing
    np.testing.assert_allclose(coarse, fine, atol=0.5 * DT / SUBSTEPS * np.radians(15.0))


@pytest.mark.parametrize("delay_s", [0.01, 0.04, 0.05, 0.099, 0.1, 0.13, 0.37])
@pytest.mark.parametrize(
    "servo", [{}, {"rudder_lag__lag_s": 0.3}, {"rudder_rate_limit__rate_degps": 20.0}]
)
def test_a_servo_is_as_late_as_its_order(delay_s: float, servo: dict[str, float]) -> None:
    """The area lost is the step times the delay, also where the servo turns as fast as it can.

    A servo that went after the mean of the orders in a step would turn as far in it with a small
    delay as without: the likelihood had an edge at every whole number of steps.
    """
    own = np.r_[np.zeros(20), np.full(100, 0.35)]
    lost = DT * np.sum(rudder(own, **servo) - rudder(own, rudder_delay__delay_s=delay_s, **servo))
    assert lost == pytest.approx(0.35 * delay_s, rel=1e-6)


def test_a_delay_has_a_slope_on_both_sides() -> None:
    """Where it is a whole number of steps as anywhere else."""
    own, limit = helms(3), {"rudder_rate_limit__rate_degps": 30.0}

    def angle(delay_s: float) -> np.ndarray:
        return rudder(own, rudder_delay__delay_s=delay_s, **limit)

    small = 1e-3
    before, after = angle(0.2) - angle(0.2 - small), angle(0.2 + small) - angle(0.2)
    assert np.abs(np.convolve(after - before, np.ones(8))).max() < 0.02 * np.abs(before).max() * 8


EVERY = {
    "rudder_delay__delay_s": 0.13,
    "rudder_deadband__deadband_deg": 1.0,
    "rudder_backlash__half_width_deg": 1.0,
    "rudder_asymmetry__gain": 0.1,
    "rudder_lag__lag_s": 0.3,
    "rudder_rate_limit__rate_degps": 20.0,
    "rudder_offset__offset_deg": 1.0,
    "rudder_stall__angle_deg": 25.0,
    "propeller_race__c_m2ps2pn": 0.02,
    "propeller_lag__lag_s": 0.4,
    "thrust_sag__fraction_per_1000_s": 0.1,
}


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("at_work", [True, False])
def test_all_slopes_together_are_the_differences_one_at_a_time(seed: int, at_work: bool) -> None:
    raw = inputs(helms(seed), revs=14.0)
    raw[40:, 2] = 20.0
    e, n = effects(**(EVERY if at_work else {})), len(raw)
    places = np.flatnonzero(effects(**EVERY))
    steps = np.column_stack([1.0e-2 * (1.0 + np.abs(e[places])), np.full(len(places), 0.5)])
    log = raw, DT * np.arange(n), np.linspace(1.0, 1.5, n), np.zeros(n), np.zeros(n), DT
    whole, slopes = acting_with_steps(*log, e, 0.0, n, places, steps)
    assert (whole == acting_inputs(*log, e)).all()
    for k, place in enumerate(places):
        moved = e.copy()
        moved[place] += steps[k, 0]
        there = acting_inputs(*log, moved)
        assert (slopes[:, :, k] == (there - whole)[:, : slopes.shape[1]] / steps[k, 1]).all()


@pytest.mark.parametrize("delay_s", [0.0, 0.07, 0.2, 0.33])
def test_servos_side_by_side_turn_as_one_alone(delay_s: float) -> None:
    e = effects(**{**EVERY, "rudder_delay__delay_s": delay_s, "rudder_offset__offset_deg": 0.0})
    e[COMMAND.index("rudder_stall.angle_deg")] = 0.0
    order, whole = helms(7), math.floor(e[0] / DT)
    share, parts = e[0] / DT - whole, np.ones((2, 4))
    servo_parts(e, DT, share, parts)
    late = np.concatenate([np.full(whole + 1, order[0]), order])
    taken = play_after(np.zeros(0), order[0], e)
    angle, alone = unequal(taken, e[COMMAND.index("rudder_asymmetry.gain")]), []
    half_width = e[COMMAND.index("rudder_backlash.half_width_deg")]
    for k in range(len(order)):
        mean, taken, angle = follow(late[k], late[k + 1], share, parts, e, half_width, taken, angle)
        alone.append(mean)
    n = len(order)
    log = inputs(order), DT * np.arange(n), np.ones(n), np.zeros(n), np.zeros(n), DT
    assert acting_inputs(*log, e)[:, 0] == pytest.approx(np.array(alone), abs=1e-15)
