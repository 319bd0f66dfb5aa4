"""Each planted effect does what its row says, on both vehicles: seen in the record and the logs."""

import math

import numpy as np
import pytest
from seatrial import helm
from seatrial.effects import EFFECTS, draw_effects
from seatrial.plant import PlantEffects, derivative, propeller
from seatrial.planting import plant_effects
from seatrial.sensors import body_over_ground, measure_all
from seatrial.simulate import REVS, RPM_COMMAND, RUDDER, RUDDER_COMMAND, STEP_S
from seatrial.trial import generate, sail, stream
from seatrial.vehicles import PLANTS, load_vehicle

VEHICLES = sorted(PLANTS)
DEGREE = math.pi / 180.0
SHORT = {"straights": 1, "turns": 2, "zigzags_10": 1, "zigzags_20": 1}
SEED = 5


@pytest.fixture(scope="module")
def trial():
    """Record, leg starts and legs of a short trial, sailed once for every set of effects."""
    kept: dict = {}

    def of(name: str, **effects):
        key = (name, str(effects))
        if key not in kept:
            vehicle = load_vehicle(name)
            recipe = {"name": "short", "vehicle": name, "seed": SEED, "schedule": SHORT}
            kept[key] = sail(recipe, vehicle, effects)[:3]
        return kept[key]

    return of


def steady(trial, name, kind, **effects):
    """Mean record rows of every leg of a kind below the surface, its first half left out."""
    record, starts, legs = trial(name, **effects)
    rows = []
    for leg in np.flatnonzero((legs[:, helm.KIND] == kind) & (legs[:, helm.DEPTH] > 1.0)):
        first, last = int(starts[leg] / STEP_S), int(starts[leg + 1] / STEP_S)
        rows.append(record[(first + last) // 2 : last].mean(axis=0))
    return np.array(rows)


def first_order(record, output, wanted):
    """Time constant of a first-order response, by least squares over the record."""
    rate = np.diff(record[:, output]) / STEP_S
    behind = (wanted - record[:, output])[:-1]
    moving = np.abs(behind) > 1e-6
    return float((behind[moving] @ behind[moving]) / (behind[moving] @ rate[moving]))


# --- actuation ----------------------------------------------------------------------------


@pytest.mark.parametrize("name", VEHICLES)
def test_lags_are_time_constants(trial, name):
    record, *_ = trial(name, rudder_lag={"lag_s": 0.6}, propeller_lag={"lag_s": 1.5})
    # the step of 0.01 s holds its input: half a step in 0.6 s
    assert first_order(record, RUDDER, record[:, RUDDER_COMMAND]) == pytest.approx(0.6, rel=0.02)
    assert first_order(record, REVS, record[:, RPM_COMMAND] / 60) == pytest.approx(1.5, rel=0.02)


@pytest.mark.parametrize("name", VEHICLES)
def test_the_servo_is_as_fast_as_its_limit(trial, name):
    for limit, effects in ((120.0, {}), (12.0, {"rudder_rate_limit": {"rate_degps": 12.0}})):
        rate = np.abs(np.diff(trial(name, **effects)[0][:, RUDDER])).max() / STEP_S / DEGREE
        assert rate == pytest.approx(limit, rel=1e-6)


@pytest.mark.parametrize("delay", [0.0, 0.4])
def test_a_late_command_moves_the_rudder_later(trial, delay):
    record, *_ = trial(VEHICLES[0], rudder_delay={"delay_s": delay})
    jumps = np.flatnonzero(np.abs(np.diff(record[:, RUDDER_COMMAND])) > 8 * DEGREE) + 1
    waited = []
    for at in jumps:
        moved = np.abs(record[at:, RUDDER] - record[at, RUDDER]) > 1 * DEGREE
        waited.append(np.flatnonzero(moved)[0] * STEP_S)
    assert len(waited) > 10
    assert np.median(waited) == pytest.approx(delay + 0.01, abs=0.011)


@pytest.mark.parametrize("name", VEHICLES)
def test_play_dead_band_and_unequal_gain_show_in_turns(trial, name):
    def lost(**effects):
        rows = steady(trial, name, helm.TURN, **effects)
        command, angle = rows[:, RUDDER_COMMAND], rows[:, RUDDER]
        return command / DEGREE, (np.abs(command) - np.abs(angle)) / DEGREE

    assert np.abs(lost()[1]).max() < 1e-6
    assert lost(rudder_deadband={"deadband_deg": 2.0})[1] == pytest.approx(2.0)
    assert lost(rudder_backlash={"half_width_deg": 2.0})[1] == pytest.approx(2.0)
    command, short = lost(rudder_asymmetry={"gain": 0.2})
    assert {-1.0, 1.0} == set(np.sign(command))
    assert short == pytest.approx(-0.2 * command)


@pytest.mark.parametrize("name", VEHICLES)
def test_an_offset_is_steered_against(trial, name):
    """The autopilot keeps the heading: its mean rudder takes the offset back."""
    clean = steady(trial, name, helm.TRANSIT)[:, RUDDER_COMMAND]
    turned = steady(trial, name, helm.TRANSIT, rudder_offset={"offset_deg": 2.0})
    change = np.median(turned[:, RUDDER_COMMAND] - clean) / DEGREE
    assert change == pytest.approx(-2.0, abs=0.4)  # its slow sum has not quite settled


@pytest.mark.parametrize("name", VEHICLES)
def test_a_stalling_rudder_turns_as_one_laid_less(trial, name):
    """Yaw rate over rudder in turns falls as the felt angle does, a little less than one to one."""
    clean, stalled = (
        steady(trial, name, helm.TURN, **e) for e in ({}, {"rudder_stall": {"angle_deg": 14.0}})
    )
    share = 1.0 / np.sqrt(1.0 + (clean[:, RUDDER] / (14.0 * DEGREE)) ** 2)
    fall = np.abs(stalled[:, 5] / clean[:, 5])
    assert np.all(fall < 1.0 - 0.5 * (1.0 - share)) and np.all(fall > share - 0.05)


@pytest.mark.parametrize("name", VEHICLES)
def test_thrust_falls_when_it_should(trial, name):
    clean, *_ = trial(name)
    step, *_ = trial(name, thrust_step={"fraction": 0.2, "time_s": 300.0})
    assert np.array_equal(step[:30000], clean[:30000])
    assert np.all(step[30300:30600, 0] < clean[30300:30600, 0])
    sag, *_ = trial(name, thrust_sag={"fraction_per_1000_s": 0.2})
    gone = 1.0 - sag[[6000, 30000], 0] / clean[[6000, 30000], 0]
    assert 0.0 < gone[0] < 0.02 and 0.01 < gone[1] < 0.06  # 6 % of thrust is some 3 % of speed


# --- sensing and environment --------------------------------------------------------------


def logged(trial, name, **effects):
    """The same motion, logged by flawed sensors with the same noise."""
    vehicle = load_vehicle(name)
    return measure_all(trial(name)[0], vehicle, effects, lambda sensor: stream(SEED, sensor))


def between(trial, name, column, **effects):
    """Flawed minus clean reading, and the clean one."""
    sensor = "gyro" if column in "pqr" else "dvl"
    clean, flawed = logged(trial, name)[sensor], logged(trial, name, **effects)[sensor]
    assert np.array_equal(clean["time_s"], flawed["time_s"])
    good = np.isfinite(clean[column])
    return (flawed[column] - clean[column])[good], clean[column][good]


def test_bias_and_scales(trial):
    difference, _ = between(trial, "tern180", "r", gyro_bias={"bias_degps": 0.3})
    assert difference == pytest.approx(0.3 * DEGREE)
    for column, effect in (("r", "gyro_scale"), ("u_mps", "dvl_scale"), ("v_mps", "dvl_scale")):
        difference, clean = between(trial, "tern180", column, **{effect: {"fraction": 0.03}})
        # what is scaled is the truth; the noise is not, and is independent of it
        assert (difference @ difference) / (difference @ clean) == pytest.approx(0.03, rel=0.02)


@pytest.mark.parametrize("column, state", [("r", 5), ("u_mps", 0)])
def test_late_sensors_show_what_was(trial, column, state):
    effect, sensor = ("gyro_delay", "gyro") if column == "r" else ("dvl_delay", "dvl")
    record, *_ = trial("remus100")
    readings = logged(trial, "remus100")[sensor]
    times = readings["time_s"][np.isfinite(readings[column])]
    grid = np.arange(len(record)) * STEP_S
    now, was = (np.interp(times - late, grid, record[:, state]) for late in (0.0, 0.4))
    difference, _ = between(trial, "remus100", column, **{effect: {"delay_s": 0.4}})
    # the DVL below the axis sees some of the pitch rate as well
    assert np.median(np.abs(difference - (was - now))) < 0.1 * np.std(difference)


def test_a_turned_dvl_sees_sway_where_there_is_surge(trial):
    difference, _ = between(trial, "remus100", "v_mps", dvl_misalignment={"yaw_deg": 3.0})
    _, surge = between(trial, "remus100", "u_mps")
    assert np.median(difference[surge > 1.0] / surge[surge > 1.0]) == pytest.approx(
        -math.sin(3.0 * DEGREE),
        rel=0.05,  # turned to starboard: the flow comes from port
    )


def test_a_dvl_elsewhere_sees_the_yaw_rate(trial):
    arm = {"dx_m": 0.25, "dy_m": 0.08}
    record, *_ = trial("tern180")
    times = logged(trial, "tern180")["dvl"]
    good = np.isfinite(times["u_mps"])
    r = np.interp(times["time_s"][good], np.arange(len(record)) * STEP_S, record[:, 5])
    for column, expected in (("u_mps", -0.08 * r), ("v_mps", 0.25 * r)):
        difference, _ = between(trial, "tern180", column, dvl_lever_arm=arm)
        assert difference == pytest.approx(expected, abs=2e-3)  # r between steps


def test_a_current_carries_the_log_and_the_track_alike(trial):
    drift = {"current": {"north_mps": 0.2, "east_mps": -0.1}}
    clean, *_ = trial("remus100")
    carried, *_ = trial("remus100", **drift)
    assert carried[:, :6] == pytest.approx(clean[:, :6], abs=1e-9)  # the water does not know it
    hours = np.arange(len(clean)) * STEP_S
    assert carried[:, 6] - clean[:, 6] == pytest.approx(0.2 * hours, abs=1e-6)
    assert carried[:, 7] - clean[:, 7] == pytest.approx(-0.1 * hours, abs=1e-6)
    track = np.gradient(carried[:, 6:8], STEP_S, axis=0)
    heading = carried[:, 11]
    ahead = track[:, 0] * np.cos(heading) + track[:, 1] * np.sin(heading)
    # pitch and heel are small: what the DVL sees ahead is what the track shows ahead
    assert np.median(np.abs(ahead - body_over_ground(carried, drift)[:, 0])) < 0.003


def test_a_current_that_changes_carries_the_log_and_the_track_alike(trial):
    """Zero at mid-trial, with one rate before it and another after; the motion is the same."""
    rates = {"north_early": 0.2, "east_early": -0.1, "north_late": -0.3, "east_late": 0.25}
    planted = {"current_drift": {f"{k}_mps_per_1000_s": x for k, x in rates.items()}}
    clean, *_ = trial("remus100")
    carried, *_ = trial("remus100", **planted)
    assert np.array_equal(carried[:, :6], clean[:, :6])
    time = (np.arange(len(clean)) - 0.5 * (len(clean) - 1)) * STEP_S / 1000.0
    water = np.gradient(carried[:, 6:8] - clean[:, 6:8], STEP_S, axis=0)[1:-1]
    for i, axis in enumerate(("north", "east")):
        expected = np.where(time < 0, rates[f"{axis}_early"], rates[f"{axis}_late"]) * time
        assert water[:, i] == pytest.approx(expected[1:-1], abs=1e-5)
        steady = {"current": {"north_mps": float(i == 0), "east_mps": float(i == 1)}}
        here = body_over_ground(clean, steady) - clean[:, :3]
        alone = {k: x if k.startswith(axis) else 0.0 for k, x in planted["current_drift"].items()}
        seen = body_over_ground(clean, {"current_drift": alone}) - clean[:, :3]
        assert seen == pytest.approx(here * expected[:, None], abs=1e-12)


@pytest.mark.parametrize("name", VEHICLES)
def test_an_event_starts_at_its_time_on_the_log_clock(trial, name):
    recipe = {
        "name": "x",
        "vehicle": name,
        "seed": SEED,
        "schedule": SHORT,
        "effect": [{"id": "one_off_event"}],
    }
    truth = generate(recipe, None)
    begin, end = (t - truth["time_origin_s"] for t in truth["effects"][0]["log_time_s"])
    clean, bumped = (
        trial(name, **e) for e in ({}, {"one_off_event": truth["effects"][0]["parameters"]})
    )
    n = min(len(clean[0]), len(bumped[0]))
    apart = np.abs(clean[0][:n, 1] - bumped[0][:n, 1])
    assert np.flatnonzero(apart > 1e-9)[0] * STEP_S == pytest.approx(begin, abs=0.05)
    assert apart[int(begin / STEP_S) : int(end / STEP_S)].max() > 0.05


def test_swell_acts_at_the_encounter_frequency(trial):
    wave = {"force_n": 4.0, "moment_nm": 0.5, "omega_radps": 1.0, "direction_rad": 0.3}
    record, starts, legs = trial("remus100", wave=wave)
    straight = np.isin(legs[:, helm.KIND], (helm.FIXED, helm.STRAIGHT)) & (
        legs[:, helm.MANEUVER] >= 0
    )
    leg = int(np.flatnonzero(straight)[0])
    rows = slice(int(starts[leg] / STEP_S) + 500, int(starts[leg + 1] / STEP_S))
    time = np.arange(len(record))[rows] * STEP_S
    u, heading = record[rows, 0].mean(), record[rows, 11].mean()
    met = 1.0 - 1.0 / 9.81 * u * math.cos(heading - 0.3)
    tried = np.arange(0.6, 1.5, 0.01)
    side = record[rows, 1] - np.polyval(np.polyfit(time, record[rows, 1], 1), time)
    power = [abs(np.exp(1j * w * time) @ side) for w in tried]
    # half the width of a line of a run so long
    assert abs(tried[int(np.argmax(power))] - met) < math.pi / (time[-1] - time[0]) + 0.01


# --- hydrodynamics ------------------------------------------------------------------------

STATE = np.array([1.4, -0.2, 0.02, 0.0, 0.0, 0.25, 0, 0, 8.0, 0.06, 0.0, 0.7, 0.05, 0.1, 0.0])
N = 15.0  # rev/s
u, v, r, ROLL, HEADING, MEMORY, MODE = (STATE[i] for i in (0, 1, 5, 9, 11, 12, 13))
FORCES = {
    "propeller_side_force": ({"Y_nn": 0.004, "N_nn": -0.001}, (0, 0.004 * N**2, -0.001 * N**2)),
    "hull_asymmetry": ({"Y_0": 0.5, "N_0": 0.2}, (0, 0.5 * u**2, 0.2 * u**2)),
    "cubic_damping": ({"N_vvr": -60.0, "N_rrr": -15.0}, (0, 0, -60.0 * v * v * r - 15.0 * r**3)),
    "turning_drag": ({"X_vv": -40.0, "X_rr": -10.0}, (-40.0 * v * v - 10.0 * r * r, 0, 0)),
    "linear_drag": ({"X_u": -2.0}, (-2.0 * u, 0, 0)),
    "linear_damping": ({"Y_v": -20.0, "N_r": -6.0}, (0, -20.0 * v, -6.0 * r)),
    "roll_coupling": (
        {"Y_uuphi": 15.0, "N_uuphi": -5.0},
        (0, 15.0 * u * u * ROLL, -5.0 * u * u * ROLL),
    ),
    "heading_force": (
        {"force_n": 2.0, "moment_nm": 0.4},
        (0, 2.0 * math.cos(2 * HEADING), 0.4 * math.cos(2 * HEADING)),
    ),
    "memory_force": (
        {"Y_vr": 90.0, "N_vr": 20.0, "time_s": 4.0},
        (0, 90.0 * MEMORY, 20.0 * MEMORY),
    ),
    "roll_mode": ({"Y_phi": 9.0, "omega_radps": 2.0, "damping": 0.05}, (0, 9.0 * MODE, 0)),
}


# what acts in the plant and is no force of its own: tests below and above
OTHERWISE = {"current", "propeller_race", "sway_cross_flow", "yaw_cross_flow"}


def test_every_force_of_the_generator_has_its_equation_here():
    assert {e.id for e in EFFECTS.values() if e.into == "plant"} == {*FORCES, *OTHERWISE}


def force(name: str, effects: PlantEffects, rudder: float = 0.0, state=STATE) -> np.ndarray:
    """Surge force, side force, yaw moment on the body."""
    body, out, tau = load_vehicle(name).body, np.zeros(15), np.zeros(6)
    derivative(state, rudder, 0.0, N, 1.0, np.zeros(6), body, effects, tau, out)
    return (body.mass @ out[:6])[[0, 1, 5]]


@pytest.mark.parametrize("name", VEHICLES)
@pytest.mark.parametrize("effect", FORCES)
def test_forces_are_those_of_the_row(name, effect):
    parameters, expected = FORCES[effect]
    planted = plant_effects({effect: parameters})
    added = force(name, planted) - force(name, PlantEffects())
    assert added == pytest.approx(np.array(expected), abs=1e-9)


@pytest.mark.parametrize("name", VEHICLES)
def test_drags_slow_a_trial_down(trial, name):
    """Through the whole loop: a stale compiled one would show here."""
    clean, *_ = trial(name)
    scale = load_vehicle(name).scale
    straight, *_ = trial(name, linear_drag={"X_u": -2.0 * scale})
    turning, *_ = trial(name, turning_drag={"X_vv": -45.0 * scale, "X_rr": -13.0 * scale**2})
    for braked, least in ((straight, 0.1), (turning, 0.01)):
        n = min(len(clean), len(braked))
        assert clean[10000:n, 0].mean() - braked[10000:n, 0].mean() > least


@pytest.mark.parametrize("name", VEHICLES)
def test_extra_cross_flow_is_a_share_of_that_of_the_hull(name):
    body = load_vehicle(name).body
    bare = PlantEffects(sway_cross_flow=-1.0, yaw_cross_flow=-1.0)
    hull = force(name, PlantEffects()) - force(name, bare)
    for field, part in (("sway_cross_flow", 1), ("yaw_cross_flow", 2)):
        added = force(name, PlantEffects(**{field: 2.5})) - force(name, PlantEffects())
        assert added[part] == pytest.approx(2.5 * hull[part])
        assert np.delete(added, part) == pytest.approx(0.0, abs=1e-9)
    assert body.cross_flow > 0.0 and abs(hull[1]) > 0.1


@pytest.mark.parametrize("name", VEHICLES)
def test_the_race_multiplies_what_a_deflection_does(name):
    """Rudder force at small angles goes with the square of the speed that the fins see."""
    c, d, ahead = 0.1, 1.0 * DEGREE, np.zeros(15)
    ahead[[0, 8]] = 1.4, 8.0
    thrust, _ = propeller(1.4, N, load_vehicle(name).body)
    raced, calm = (
        (force(name, e, d, ahead) - force(name, e, -d, ahead))[2]
        for e in (PlantEffects(race=c), PlantEffects())
    )
    assert raced / calm == pytest.approx(1.0 + c * thrust / 1.4**2, rel=1e-3)


# --- sizes --------------------------------------------------------------------------------

MOVING = [e.id for e in EFFECTS.values() if e.into != "sensors" and "elevator" not in e.id]


@pytest.mark.parametrize("name", VEHICLES)
@pytest.mark.parametrize("effect", MOVING)
def test_a_drawn_size_still_leaves_a_sea_trial(trial, name, effect):
    """Zigzags switch, turns come round, and the vehicle neither stops nor rolls over."""
    scale, revs = load_vehicle(name).scale, PLANTS[name].cruise_rpm / 60
    record, starts, legs = trial(name, **draw_effects([{"id": effect}], SEED, scale, revs))
    working = record[int(starts[6] / STEP_S) : int(starts[-6] / STEP_S)]
    assert 0.5 < working[:, 0].min() < working[:, 0].max() < 2.4
    assert np.abs(working[:, 9]).max() < 15 * DEGREE
    took = np.diff(starts)
    assert took[legs[:, helm.KIND] == helm.ZIGZAG].max() < helm.LONGEST_ZIGZAG_S
    turns = legs[:, helm.KIND] == helm.TURN
    assert np.all(took[turns] < helm.TURN_STRETCH * legs[turns, helm.DURATION])
