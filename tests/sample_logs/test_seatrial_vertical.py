"""Planted effects of the vertical plane: each does what its row says."""

import math
from dataclasses import replace

import numpy as np
import pytest
from seatrial import helm
from seatrial.effects import EFFECTS, PLANTED, VERTICAL, draw_effects
from seatrial.plant import PlantEffects, derivative, propeller
from seatrial.planting import plant_effects
from seatrial.population import draw, visible
from seatrial.population.checks_vertical import MOST_UNSTABLE, response
from seatrial.population.form import Size
from seatrial.population.schedule_vertical import TRIMS
from seatrial.population.sizes import OUTSIDE_OF, SINGLES_OF, Scales, draw_sizes
from seatrial.population.stated import LEAST_HEIGHT_M, mistaken_ballast, write_stated
from seatrial.sensors import body_over_ground, lagged, measure_all
from seatrial.simulate import ELEVATOR, ELEVATOR_COMMAND, STEP_S
from seatrial.trial import generate, sail, stream
from seatrial.vehicles import load_vehicle

from auvident.storage.vehicle_file import load_vehicle as read_vehicle

DEGREE = math.pi / 180.0
NAME, SEED = "remus100", 5
SHORT = {"straights": 1, "depth_steps": 1, "vertical_zigzags": 2}
NEW = [name for name in VERTICAL if VERTICAL[name] is not EFFECTS.get(name)]


@pytest.fixture(scope="module")
def trial():
    """Record, leg starts and legs of a short trial, sailed once for every set of effects."""
    kept: dict = {}

    def of(**effects):
        if str(effects) not in kept:
            recipe = {"name": "short", "vehicle": NAME, "seed": SEED, "plane": "vertical"}
            kept[str(effects)] = sail({**recipe, "schedule": SHORT}, load_vehicle(NAME), effects)[
                :3
            ]
        return kept[str(effects)]

    return of


def drawn(name: str, seed: int = SEED) -> dict:
    """Parameters of an effect as a recipe of the vertical plane has them drawn."""
    return draw_effects([{"id": name}], seed, 1.0, 15.0, "vertical")


# --- the table ----------------------------------------------------------------------------


@pytest.mark.parametrize("name", VERTICAL)
def test_drawn_parameters_have_the_declared_names_and_depend_on_the_seed(name):
    one, same, other = (drawn(name, seed)[name] for seed in (1, 1, 2))
    assert set(one) == set(VERTICAL[name].units)
    assert one == same != other


def test_a_recipe_of_the_plane_has_its_symbols_and_others_keep_theirs():
    assert set(drawn("cubic_damping")["cubic_damping"]) == {"M_wwq", "M_qqq"}
    for plane in ("horizontal", "both"):
        assert PLANTED[plane]["cubic_damping"] is EFFECTS["cubic_damping"]
    assert "pitch_bias" in PLANTED["both"] and "pitch_bias" not in PLANTED["horizontal"]


CHANNELS = (("dvl", "u_mps"), ("dvl", "w_mps"), ("gyro", "q"), ("attitude", "pitch"))


@pytest.mark.parametrize("name", NEW)
def test_each_effect_changes_the_log(trial, name):
    effects = drawn(name)
    if name == "weight_change":
        effects[name]["time_s"] = 200.0  # the trial is short
    both = [logged(trial, **e) for e in ({}, effects)]
    sizes = []
    for sensor, column in (*CHANNELS, ("depth", "depth")):
        logs = [log[sensor][column] for log in both]
        n = min(map(len, logs))
        difference = logs[0][:n] - logs[1][:n]
        sizes.append(np.sqrt(np.nanmean(difference**2)) / np.nanstd(logs[0]))
    assert max(sizes) > 0.005, sizes


@pytest.mark.parametrize("name", [n for n in NEW if VERTICAL[n].into != "sensors"])
def test_a_drawn_size_still_leaves_a_sea_trial(trial, name):
    record, starts, legs = trial(**drawn(name))
    working = record[int(starts[6] / STEP_S) : int(starts[-6] / STEP_S)]
    assert 0.5 < working[:, 0].min() < working[:, 0].max() < 2.4
    assert np.abs(working[:, 10]).max() < 30 * DEGREE and working[:, 8].min() > 1.0
    took = np.diff(starts)
    assert took[legs[:, helm.KIND] == helm.VERTICAL_ZIGZAG].max() < helm.LONGEST_ZIGZAG_S


def logged(trial, **effects):
    """Measured channels of the trial with effects in motion and sensors."""
    record, vehicle = trial(**effects)[0], load_vehicle(NAME)
    return measure_all(record, vehicle, effects, lambda sensor: stream(SEED, sensor))


def between(trial, sensor, column, **effects):
    """Flawed minus clean reading of the same motion, and the clean one."""
    record, vehicle = trial()[0], load_vehicle(NAME)
    clean, flawed = (
        measure_all(record, vehicle, e, lambda name: stream(SEED, name))[sensor][column]
        for e in ({}, effects)
    )
    good = np.isfinite(clean)
    return (flawed - clean)[good], clean[good]


# --- actuation ----------------------------------------------------------------------------


def test_faults_of_the_elevator_servo(trial):
    record, *_ = trial(elevator_deadband={"deadband_deg": 1.0})
    held = np.abs(np.diff(record[:, ELEVATOR_COMMAND])) < 1e-9
    still = np.convolve(held, np.ones(100), "full")[: held.size] > 99.0  # for a second
    command, angle = record[:-1][still][:, [ELEVATOR_COMMAND, ELEVATOR]].T
    large = np.abs(command) > 2 * DEGREE
    assert large.sum() > 1000
    assert np.abs(command[large]) - np.abs(angle[large]) == pytest.approx(DEGREE, abs=1e-6)
    record, *_ = trial(elevator_asymmetry={"gain": 0.2})
    command, angle = record[:-1][still[: len(record) - 1]][:, [ELEVATOR_COMMAND, ELEVATOR]].T
    for sign, gain in ((1, 1.2), (-1, 0.8)):
        large = sign * command > 3 * DEGREE
        assert np.median(angle[large] / command[large]) == pytest.approx(gain, rel=1e-3)


def test_a_stuck_elevator_stands_still_and_comes_free(trial):
    effects = {"stuck_elevator": {"maneuver_fraction": 0.5, "after_s": 5.0, "duration_s": 10.0}}
    record, starts, legs = trial(**effects)
    leg = int(np.flatnonzero(legs[:, helm.MANEUVER] == 2)[0])
    first = int((starts[leg] + 5.0) / STEP_S) + 1
    angle, command = record[:, ELEVATOR], record[:, ELEVATOR_COMMAND]
    assert np.ptp(angle[first : first + 990]) == 0.0
    assert np.ptp(command[first : first + 990]) > 0.5 * DEGREE
    assert np.ptp(angle[first + 1000 : first + 3000]) > 0.5 * DEGREE


# --- sensing ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("sensor", "column", "effect"),
    [
        ("attitude", "pitch", "pitch_scale"),
        ("gyro", "q", "q_scale"),
        ("depth", "depth", "depth_scale"),
    ],
)
def test_scales(trial, sensor, column, effect):
    difference, clean = between(trial, sensor, column, **{effect: {"fraction": 0.05}})
    # what is scaled is the truth; the noise is not, and is independent of it
    assert (difference @ difference) / (difference @ clean) == pytest.approx(0.05, rel=0.02)


def test_biases(trial):
    difference, _ = between(trial, "attitude", "pitch", pitch_bias={"bias_deg": 2.0})
    assert difference == pytest.approx(2.0 * DEGREE)
    difference, _ = between(trial, "gyro", "q", q_bias={"bias_degps": -0.3})
    assert difference == pytest.approx(-0.3 * DEGREE)


def test_a_slow_depth_sensor_is_behind_by_its_lag(trial):
    difference, _ = between(trial, "depth", "depth", depth_lag={"lag_s": 1.5})
    times, true = logged(trial)["depth"]["time_s"], trial()[0][:, 8]
    slow = lagged(true, 1.5)
    behind = np.interp(times, np.arange(true.size) * STEP_S, slow - true)
    assert difference == pytest.approx(behind, abs=1e-9)
    # of a first-order lag: what it lacks is the lag times its own rate
    rate = np.diff(slow) / STEP_S
    assert (true - slow)[1:] == pytest.approx(1.5 * rate, abs=2e-3)


def test_a_dvl_turned_bow_up_sees_heave_where_there_is_surge(trial):
    difference, _ = between(trial, "dvl", "w_mps", dvl_pitch={"pitch_deg": 3.0})
    surge = between(trial, "dvl", "u_mps")[1]
    ahead = surge > 1.0
    assert np.median(difference[ahead] / surge[ahead]) == pytest.approx(
        math.sin(3.0 * DEGREE), rel=0.05
    )


def test_a_dvl_elsewhere_sees_the_pitch_rate(trial):
    arm = {"dx_m": 0.25, "dz_m": 0.08}
    times = logged(trial)["dvl"]
    record, good = trial()[0], np.isfinite(times["u_mps"])
    q = np.interp(times["time_s"][good], np.arange(len(record)) * STEP_S, record[:, 4])
    for column, expected in (("u_mps", 0.08 * q), ("w_mps", -0.25 * q)):
        difference, _ = between(trial, "dvl", column, dvl_lever_arm=arm)
        assert difference == pytest.approx(expected, abs=2e-3)  # q between steps


# --- environment --------------------------------------------------------------------------


@pytest.mark.parametrize(
    "effects",
    [
        {"vertical_current": {"down_mps": 0.06}},
        {"internal_wave": {"down_mps": 0.08, "period_s": 100.0}},
    ],
)
def test_sinking_water_carries_the_depth_and_the_log_alike(trial, effects):
    record, starts, _ = trial(**effects)
    seen = body_over_ground(record, effects)
    roll, pitch = record[:, 9], record[:, 10]
    down = -np.sin(pitch) * seen[:, 0] + np.cos(pitch) * (
        np.sin(roll) * seen[:, 1] + np.cos(roll) * seen[:, 2]
    )
    rate = np.gradient(record[:, 8], STEP_S)
    working = slice(int(starts[6] / STEP_S), int(starts[-6] / STEP_S))
    assert np.median(np.abs(down - rate)[working]) < 5e-4
    through = -np.sin(pitch) * record[:, 0] + np.cos(pitch) * record[:, 2]
    water = (rate - through)[working]
    assert np.abs(water).max() == pytest.approx(0.07, abs=0.02)


def test_weight_comes_at_its_time(trial):
    clean, changed = (
        trial(**e)[0]
        for e in ({}, {"weight_change": {"weight_n": 2.0, "x_m": 0.2, "time_s": 200.0}})
    )
    assert np.array_equal(changed[:20000], clean[:20000])
    assert changed[20050, 2] > clean[20050, 2] + 0.005  # it begins to sink
    mass = load_vehicle(NAME).body.mass[[2, 4]][:, [2, 4]]
    expected = np.linalg.solve(mass, [2.0, -0.2 * 2.0])  # weight ahead of O: bow down
    gained = (changed[20003] - clean[20003])[[2, 4]]  # before anything answers
    assert gained / 0.03 == pytest.approx(expected, rel=0.1)


# --- forces -------------------------------------------------------------------------------

STATE = np.array([1.4, 0.0, -0.2, 0.0, 0.25, 0.0, 0, 0, 9.5, 0.0, 0.1, 0.7, 0.05, 0.0, 0.0])
N = 15.0  # rev/s
u, w, q, DEPTH, PITCH, MEMORY = (STATE[i] for i in (0, 2, 4, 8, 10, 12))
THRUST = propeller(u, N, load_vehicle(NAME).body)[0]
LOST = 0.8 * (DEPTH - 8.0)
FORCES = {
    "hull_asymmetry": ({"Z_0": 0.5, "M_0": 0.2}, (0, 0.5 * u**2, 0.2 * u**2)),
    "cubic_damping": ({"M_wwq": -60.0, "M_qqq": -15.0}, (0, 0, -60.0 * w * w * q - 15.0 * q**3)),
    "turning_drag": ({"X_ww": -40.0, "X_qq": -10.0}, (-40.0 * w * w - 10.0 * q * q, 0, 0)),
    "linear_damping": ({"Z_w": -20.0, "M_q": -6.0}, (0, -20.0 * w, -6.0 * q)),
    "thrust_line_moment": ({"z_m": 0.04}, (0, 0, 0.04 * THRUST)),
    "buoyancy_gradient": (
        {"gradient_npm": 0.8, "ballasted_at_m": 8.0},
        (-LOST * math.sin(PITCH), LOST * math.cos(PITCH), 0),
    ),
    "memory_force": (
        {"Z_wq": 90.0, "M_wq": 20.0, "time_s": 4.0},
        (0, 90.0 * MEMORY, 20.0 * MEMORY),
    ),
}
CROSS_FLOW = {"heave_cross_flow": 1, "pitch_cross_flow": 2}


def force(effects: PlantEffects) -> np.ndarray:
    """Surge force, heave force, pitch moment on the body."""
    body, out, tau = load_vehicle(NAME).body, np.zeros(15), np.zeros(6)
    derivative(STATE, 0.0, 0.0, N, 1.0, np.zeros(6), body, effects, tau, out)
    return (body.mass @ out[:6])[[0, 2, 4]]


def test_every_force_of_the_plane_has_its_equation_here():
    assert {n for n in NEW if VERTICAL[n].into == "plant"} == {*FORCES, *CROSS_FLOW}


@pytest.mark.parametrize("effect", FORCES)
def test_forces_are_those_of_the_row(effect):
    parameters, expected = FORCES[effect]
    added = force(plant_effects({effect: parameters})) - force(PlantEffects())
    assert added == pytest.approx(np.array(expected), abs=1e-9)


@pytest.mark.parametrize(("effect", "part"), CROSS_FLOW.items())
def test_extra_cross_flow_is_a_share_of_that_of_the_hull(effect, part):
    hull = force(PlantEffects()) - force(PlantEffects(**dict.fromkeys(CROSS_FLOW, -1.0)))
    added = force(plant_effects({effect: {"factor": 2.5}})) - force(PlantEffects())
    assert added[part] == pytest.approx(2.5 * hull[part])
    assert np.delete(added, part) == pytest.approx(0.0, abs=1e-9) and abs(hull[1]) > 0.1


def test_the_memory_is_driven_by_heave_and_pitch():
    effects = plant_effects({"memory_force": FORCES["memory_force"][0]})
    out = np.zeros(15)
    body = load_vehicle(NAME).body
    derivative(STATE, 0.0, 0.0, N, 1.0, np.zeros(6), body, effects, np.zeros(6), out)
    assert out[12] == pytest.approx((abs(w) * q - MEMORY) / 4.0)


def test_event_and_swell_of_a_vertical_trial_act_in_heave_and_pitch(trial):
    event = {"maneuver_fraction": 0.3, "after_s": 8.0, "duration_s": 3.0}
    clean, bumped = (
        trial(**e)[0] for e in ({}, {"one_off_event": {**event, "force_n": 15.0, "moment_nm": 3.0}})
    )
    n = min(len(clean), len(bumped))
    apart = np.abs(bumped[:n] - clean[:n])
    first = np.flatnonzero(apart[:, 2] > 1e-9)[0]
    soon = slice(first, first + 300)
    assert apart[soon, 2].max() > 10 * apart[soon, 1].max()


# --- trim ---------------------------------------------------------------------------------


def test_a_zigzag_about_the_trim_starts_from_what_kept_the_depth():
    leg = np.array(leg_row_of(trim=np.nan))
    memory = np.zeros(helm.MEMORY)
    memory[helm.SIGN], memory[helm.MEAN_ELEVATOR] = 1.0, 0.06
    calm = (0.0, 0.0, 0.0, 0.0, 0.0)
    assert helm.commands(memory, leg, calm, helm.Gains(), 0.05)[1] == pytest.approx(0.26)
    given = np.array(leg_row_of(trim=-0.05))
    assert helm.commands(memory, given, calm, helm.Gains(), 0.05)[1] == pytest.approx(0.15)


def leg_row_of(**more):
    return helm.leg_row(helm.VERTICAL_ZIGZAG, 20.0, 900.0, fin=0.2, switch=0.1, **more)


def test_times_of_what_happens_once_are_on_the_log_clock():
    effects = [{"id": "weight_change"}, {"id": "stuck_elevator"}]
    recipe = {"name": "x", "vehicle": NAME, "seed": SEED, "plane": "vertical", "effect": effects}
    truth = generate({**recipe, "schedule": SHORT}, None)
    weight, stuck = truth["effects"]
    assert weight["log_time_s"][0] - truth["time_origin_s"] == pytest.approx(
        weight["parameters"]["time_s"], abs=0.01
    )
    assert len(stuck["log_time_s"]) == 2


# --- drawn vehicles -----------------------------------------------------------------------

TUNED = range(200, 212, 2)


@pytest.fixture(scope="module")
def population():
    return {seed: draw(seed, plane="vertical") for seed in TUNED}


def test_a_seed_gives_one_vertical_trial_and_leaves_the_horizontal_one(population):
    first = population[TUNED[0]]
    again = draw(TUNED[0], plane="vertical")
    assert np.array_equal(again.legs, first.legs, equal_nan=True) and again.stated == first.stated
    flat = draw(TUNED[0])
    assert flat.size == first.size and "pitch_per_elevator" not in flat.facts


def test_days_have_zigzags_about_several_elevator_angles_and_depth_steps(population):
    notes = [note for trial in population.values() for note in trial.notes]
    for trial in population.values():
        kinds = [note["kind"] for note in trial.notes]
        assert kinds.count("straight") >= 2 and kinds.count("depth_step") >= 2
        own = [n for n in trial.notes if n["kind"] == "zigzag"]
        assert len(own) >= 4 and len({n["rpm"] for n in own}) >= 2
        assert {"attitude", "depth"}.isdisjoint(trial.equipment.missing)
    zigzags = [note for note in notes if note["kind"] == "zigzag"]
    assert {note["about"] for note in zigzags} == set(TRIMS)
    assert len({abs(note["elevator_deg"]) for note in zigzags}) >= 3
    assert all(note.get("plane") == "vertical" for note in notes if note["kind"] != "straight")


def test_the_linear_answer_to_the_elevator_is_that_of_the_plant(population):
    for trial in population.values():
        index, authority = response(trial.vehicle, trial.size)
        assert index == trial.facts["vertical_index"] < MOST_UNSTABLE
        slow = response(trial.vehicle, trial.size, 0.75)[1]
        assert authority > slow > 0.0  # restoring moments weigh more at low speed


@pytest.fixture(scope="module")
def nothing_planted():
    """The first trial without an effect; its draw takes as long as the rest of a test."""
    return draw(TUNED[0], planted=(), plane="vertical")


def test_a_vertical_trial_is_sailed_and_its_autopilot_holds_it(nothing_planted):
    trial = nothing_planted
    sailed = trial.sail()
    truth = trial.truth(sailed)
    assert truth["plane"] == "vertical" and len(truth["maneuvers"]) == len(trial.notes)
    for m in truth["maneuvers"]:
        rows = slice(*(int((m[k] - trial.origin) / STEP_S) for k in ("t_start_s", "t_end_s")))
        part = sailed.record[rows]
        assert part[:, 8].min() > 2.0 and np.abs(part[:, 10]).max() < 35 * DEGREE
        if m["kind"] == "zigzag":
            assert np.ptp(part[:, 10]) > 1.5 * m["pitch_deg"] * DEGREE
    same = visible.motion(trial, sailed, visible.variant(trial, {}))
    below = slice(int(sailed.starts[4] / STEP_S), int(sailed.starts[-3] / STEP_S))
    off = np.abs(same[below, :6] - sailed.record[below, :6])
    assert off.max() < 2e-3 and np.median(off) < 1e-6


@pytest.mark.parametrize(
    ("effect", "size", "shows"),
    [
        ("elevator_offset", {"offset_deg": 0.001}, False),
        ("elevator_offset", {"offset_deg": 4.0}, True),
        ("pitch_bias", {"bias_deg": 0.001}, False),
        ("pitch_bias", {"bias_deg": 5.0}, True),
        ("depth_lag", {"lag_s": 5.0}, True),
    ],
)
def test_an_effect_is_visible_by_its_size(nothing_planted, effect, size, shows):
    trial = replace(nothing_planted, planted={effect: size})
    found = visible.visibility(trial, trial.sail())[effect]
    assert found["visible"] is shows


def test_every_effect_of_the_plane_has_a_size_with_its_parameters():
    assert set(SINGLES_OF["vertical"]) | set(OUTSIDE_OF["vertical"]) == set(VERTICAL)
    scales = Scales(Size(1.33, 0.191, 1.5, 1026.0), 15.0, 8.3, 1000.0)
    for name in VERTICAL:
        sizes = draw_sizes((name,), scales, np.random.default_rng(3), "vertical")[name]
        assert set(sizes) == set(VERTICAL[name].units), name


def test_the_ballast_is_stated_with_the_errors_people_make(population, tmp_path):
    for seed, trial in population.items():
        write_stated(trial.stated, tmp_path / f"{seed}.toml")
        body, true = read_vehicle(tmp_path / f"{seed}.toml").body, trial.vehicle.file["vehicle"]
        assert abs(body.mass_kg / true["mass_kg"] - 1.0) < 0.06
        assert abs(body.x_g_m - true["x_g_m"]) < 0.02
        assert body.z_g_m >= LEAST_HEIGHT_M


def test_half_of_the_owners_say_how_well_they_know_the_ballast(nothing_planted):
    vehicle = nothing_planted.vehicle
    true, weight = vehicle.file["vehicle"], vehicle.body.weight
    said, errors = [], []
    for seed in range(400):
        rngs = [np.random.default_rng([seed, i]) for i in (0, 1)]
        table = mistaken_ballast(vehicle, {"vehicle": true}, *rngs)["vehicle"]
        again = mistaken_ballast(
            vehicle, {"vehicle": true}, np.random.default_rng([seed, 0]), rngs[1]
        )
        assert {k: again["vehicle"][k] for k in true} == {k: table[k] for k in true}
        said.append("buoyancy_std_n" in table)
        if said[-1]:
            off = (table["mass_kg"] / true["mass_kg"] - 1.0) * weight
            off -= table["buoyancy_n"] - true["buoyancy_n"]
            errors.append(off / table["buoyancy_std_n"])
            assert 0.0007 < table["x_g_std_m"] < 0.007 and table["z_g_std_m"] > 0.0
    assert 0.4 < np.mean(said) < 0.6  # 4 standard deviations of 400 draws
    assert 0.8 < np.std(errors) < 1.4  # of some 200, each rated 0.7 to 1.4 of the true one


def test_a_push_changes_heave_and_pitch_while_it_pushes():
    trial = draw(2, True, ("one_off_event",), plane="vertical")
    found = visible.sudden(trial, trial.sail())
    assert found == pytest.approx({"w_mps": 0.160, "q_radps": 0.097}, abs=0.001)
