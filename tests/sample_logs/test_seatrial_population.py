"""Drawn vehicles: what is drawn, whether it is physical, and whether an effect shows."""

import math
import tomllib

import numpy as np
import pytest
from seatrial import helm
from seatrial.effects import EFFECTS, LATER, draw_effects
from seatrial.helm import commands, leg_is_over, leg_row, moved
from seatrial.plant import STATES, PlantEffects, derivative, rk4_step, workspace
from seatrial.population import CLASSES, Refused, draw, half_of, visible
from seatrial.population import drawn as draw_module
from seatrial.population.checks import DIAMETERS, MOST_ROLL_DEG, check, loses_energy, stability
from seatrial.population.form import FINENESS, LENGTH_M, RPM, SPEED_MPS, Size
from seatrial.population.hull import FAMILIES, draw_hull
from seatrial.population.schedule import CIRCLE_DEG, REMUS_TIME_S
from seatrial.population.sizes import OUTSIDE, RANGES, SINGLES, STRENGTH, Scales, draw_sizes
from seatrial.population.stated import write_stated
from seatrial.simulate import STEP_S
from seatrial.vehicles import load_vehicle

from auvident.schema.hull_shape import hull_shape
from auvident.schema.vehicle import Hull
from auvident.schema.vehicle_checks import contradictions
from auvident.storage.vehicle_file import load_vehicle as read_vehicle

SEEDS = range(100, 120)
SMALL = 0  # a seed whose trial is short
DEGREE = math.pi / 180.0


@pytest.fixture(scope="module")
def drawn():
    return {seed: draw(seed) for seed in SEEDS}


@pytest.fixture(scope="module")
def small():
    """A clean trial with a perfect servo, sailed."""
    trial = draw(SMALL, planted=())
    return trial, trial.sail()


# --- what is drawn ------------------------------------------------------------------------


def test_a_seed_gives_one_trial_and_another_seed_another(drawn):
    again = draw(SEEDS[0])
    assert again.plant == drawn[SEEDS[0]].plant and again.stated == drawn[SEEDS[0]].stated
    assert np.array_equal(again.legs, drawn[SEEDS[0]].legs, equal_nan=True)
    assert len({d.size.length for d in drawn.values()}) == len(SEEDS)


def test_vehicles_stay_within_their_ranges(drawn):
    for trial in drawn.values():
        size = trial.size
        assert LENGTH_M[0] <= size.length <= LENGTH_M[1]
        assert FINENESS[0] * 0.99 < size.length / size.diameter < FINENESS[1] * 1.01
        assert SPEED_MPS[0] <= size.speed <= SPEED_MPS[1]
        assert RPM[0] <= trial.plant.cruise_rpm <= RPM[1]
        assert 0.0 < trial.facts["net_buoyancy"] < 0.005


def test_whole_vehicle_drag_is_between_that_of_a_bare_hull_and_a_tank_test(drawn):
    """Prestero 2001: 0.125 computed for the bare hull, 0.267 in the tow tank, on the frontal area.

    Slender vehicles have more, all of it friction on more surface.
    """
    found = []
    for trial in drawn.values():
        size, body = trial.size, trial.vehicle.body
        drag = draw_module.thrust_at_speed(trial.vehicle, size)
        found.append(drag / (0.5 * size.density * size.speed**2 * body.frontal_area))
    assert 0.1 < min(found) < max(found) < 0.7
    assert 0.15 < np.median(found) < 0.4


def test_the_population_has_every_class_and_a_damping_of_every_order(drawn):
    found = {name for trial in drawn.values() for name in trial.classes}
    assert found <= set(CLASSES) and len(found) >= 6
    damping = np.array([trial.plant.damping for trial in drawn.values()])
    assert np.all(damping >= 0.0)
    assert np.all((damping > 0.0).any(axis=0)) and (damping == 0.0).all(axis=(1, 2)).any()


def test_reasons_of_refused_draws_are_kept(monkeypatch):
    calls = []

    def fails_once(vehicle, size, gains):
        calls.append(size)
        if len(calls) == 1:
            raise Refused("no reason")
        return check(vehicle, size, gains)

    monkeypatch.setattr(draw_module, "check", fails_once)
    trial = draw(SEEDS[0])
    assert trial.refused[0] == "no reason"
    assert calls[0] != calls[1]


def test_even_seeds_tune_and_odd_seeds_report():
    assert [half_of(seed) for seed in (0, 1, 2, 13)] == ["tune", "report", "tune", "report"]


def test_kinds_are_mixed_and_names_known():
    rng = np.random.default_rng(0)
    kinds = [draw_module.draw_names(rng) for _ in range(300)]
    share = {k: sum(kind == k for kind, _ in kinds) / 300 for k in draw_module.KINDS}
    assert all(abs(share[k] - p) < 0.09 for k, p in draw_module.KINDS.items())
    assert {n for _, names in kinds for n in names} <= {*SINGLES, *OUTSIDE}
    assert all(len(set(names)) == len(names) for _, names in kinds)


# --- the hull and the vehicle file --------------------------------------------------------


@pytest.mark.parametrize("seed", range(12))
def test_hulls_are_those_of_the_vehicle_file(seed):
    """The program's own reading of the keys gives the radii that the plant has."""
    hull = draw_hull(2.0, 0.3, np.random.default_rng(seed))
    shape = hull_shape(Hull(**hull.keys))
    radius = shape.radius_m(hull.station)
    # offsets are a table of 61 points, joined in another way
    close = 0.004 * 0.3 if shape.edges_m.size > 10 else 1e-6
    assert np.abs(radius - hull.radius)[1:-1].max() < close


def test_every_hull_family_is_drawn():
    found = [Hull(**draw_hull(2.0, 0.3, np.random.default_rng(s)).keys) for s in range(20)]
    assert {hull.family for hull in found} == set(FAMILIES)


def test_the_vehicle_file_is_read_and_wrong_by_what_people_are_wrong_by(drawn, tmp_path):
    masses, drags = [], 0
    for seed, trial in drawn.items():
        path = tmp_path / f"{seed}.toml"
        write_stated(trial.stated, path)
        vehicle = read_vehicle(path)
        assert not list(contradictions(vehicle))
        true = trial.vehicle.file
        masses.append(vehicle.body.mass_kg / true["vehicle"]["mass_kg"] - 1.0)
        drags += "coefficients" in tomllib.loads(path.read_text())
        assert vehicle.body.origin_from_nose_m == pytest.approx(
            true["vehicle"]["origin_from_nose_m"], rel=1e-5
        )
        assert [f.x_m for f in vehicle.fin] == [f["x_m"] for f in true["fin"]]
    assert 0.005 < np.std(masses) < 0.04
    assert 0 < drags < len(drawn)


def test_nothing_hydrodynamic_is_in_the_vehicle_file(drawn):
    known = {"vehicle", "hull", "fin", "propeller", "dvl", "gyro", "fluid", "signs", "coefficients"}
    for trial in drawn.values():
        assert set(trial.stated) <= known
        assert set(trial.stated.get("coefficients", {})) <= {"X_uu"}


# --- the plant ----------------------------------------------------------------------------


def test_checks_of_the_plants(drawn):
    for trial in drawn.values():
        facts = trial.facts
        assert facts["steady_speed_mps"] == pytest.approx(trial.size.speed, rel=0.15)
        assert all(DIAMETERS[0] < d < DIAMETERS[1] for d in facts["turning_diameters"])
        assert facts["heel_deg"] < MOST_ROLL_DEG
        assert loses_energy(trial.vehicle.body, trial.size)
        assert np.linalg.eigvalsh(trial.vehicle.body.mass).min() > 0


def even_sided(trial) -> dict:
    """Changes of a body that take torque and list away."""
    mass = trial.vehicle.body.mass.copy()
    mass[0, 5] = mass[5, 0] = mass[2, 3] = mass[3, 2] = 0.0
    return {"kq": np.zeros(3), "y_g": 0.0, "mass": mass, "mass_inverse": np.linalg.inv(mass)}


def _turned(trial, side: float, **changes) -> np.ndarray:
    body = trial.vehicle.body._replace(**changes)
    state, work = np.zeros(STATES), workspace()
    state[0], state[8] = trial.size.speed, 500.0
    for _ in range(1500):
        revs = trial.plant.cruise_rpm / 60.0
        rk4_step(state, 0.01, side * 0.2, 0.0, revs, 1.0, np.zeros(6), body, PlantEffects(), work)
    return state


def test_port_and_starboard_mirror_where_the_vehicle_does(drawn):
    mirror = np.ones(STATES)
    mirror[[1, 3, 5, 7, 9, 11, 12, 13, 14]] = -1
    for trial in [d for d in drawn.values() if d.plant.sail_slope == 0.0][:4]:
        even = even_sided(trial)
        port, starboard = _turned(trial, 1.0, **even), _turned(trial, -1.0, **even)
        scale = np.maximum(np.abs(port), 1.0)
        assert (np.abs(port - mirror * starboard) / scale).max() < 1e-6
        lopsided = _turned(trial, 1.0), _turned(trial, -1.0)
        assert abs(lopsided[0][9] + lopsided[1][9]) > 1e-6


def test_the_stability_index_tells_whether_a_push_dies_out(drawn):
    for trial in drawn.values():
        index = stability(trial.vehicle, trial.size)["index"]
        body = trial.vehicle.body._replace(**even_sided(trial))
        if abs(index) < 0.1 or body.fins.shape[0] > 4:
            continue
        state, work = np.zeros(STATES), workspace()
        state[0], state[1], state[8] = trial.size.speed, 1e-6, 500.0
        step, sizes = 0.004 * trial.size.time, []
        for _ in range(1500):
            revs = trial.plant.cruise_rpm / 60.0
            rk4_step(state, step, 0.0, 0.0, revs, 1.0, np.zeros(6), body, PlantEffects(), work)
            sizes.append(math.hypot(state[1], state[5] * trial.size.length))
        assert (sizes[-1] < sizes[500]) == (index < 0.0), trial.seed


def test_damping_of_each_order_is_what_the_plant_table_says():
    vehicle = load_vehicle("remus100")
    damping = np.zeros((4, 3))
    damping[0], damping[3] = (1.0, 2.0, 3.0), (4.0, 5.0, 6.0)
    state = np.zeros(STATES)
    state[[0, 1, 5, 8]] = 1.0, -0.2, 0.3, 50.0
    forces = []
    for rows in (damping, np.zeros((4, 3))):
        body, out = vehicle.body._replace(damping=rows), np.zeros(STATES)
        derivative(state, 0.0, 0.0, 15.0, 1.0, np.zeros(6), body, PlantEffects(), np.zeros(6), out)
        forces.append(body.mass @ out[:6])
    sway = (1.0 + 2.0 * 0.2 + 3.0 * 0.04) * 0.2
    yaw = -(4.0 + 5.0 * 0.3 + 6.0 * 0.09) * 0.3
    assert forces[0] - forces[1] == pytest.approx([0, sway, 0, 0, 0, yaw], abs=1e-9)


def test_a_centre_of_gravity_off_centre_lists_and_trims(drawn):
    """At rest the vehicle hangs with its centre of gravity below that of buoyancy."""
    trial = drawn[SEEDS[0]]
    body = trial.vehicle.body
    roll = math.atan2(body.y_g, body.z_g)
    pitch = math.atan2(-body.x_g, math.hypot(body.y_g, body.z_g))
    state, out = np.zeros(STATES), np.zeros(STATES)
    state[[8, 9, 10]] = 50.0, roll, pitch
    still = body._replace(buoyancy=body.weight, kt=np.zeros(3), kq=np.zeros(3))
    derivative(state, 0.0, 0.0, 0.0, 1.0, np.zeros(6), still, PlantEffects(), np.zeros(6), out)
    moments = (body.mass @ out[:6])[3:]
    assert np.abs(moments).max() < 1e-9 * body.weight * body.z_g


# --- the day ------------------------------------------------------------------------------


def test_days_have_the_maneuvers_in_several_ways(drawn):
    notes = [note for trial in drawn.values() for note in trial.notes]
    for trial in drawn.values():
        kinds = [note["kind"] for note in trial.notes]
        assert kinds.count("straight") >= 2 and kinds.count("turn") >= 3
        assert kinds.count("zigzag") >= 4
        sides = {np.sign(n["rudder_deg"]) for n in trial.notes if n["kind"] == "turn"}
        assert sides == {-1, 1}
    around = [n["heading_deg"] for n in notes if n["kind"] == "turn"]
    assert CIRCLE_DEG[0] <= min(around) < 250 and 350 < max(around) <= CIRCLE_DEG[1]
    zigzags = [n for n in notes if n["kind"] == "zigzag"]
    assert len({(abs(n["rudder_deg"]), n["heading_deg"]) for n in zigzags}) >= 5
    assert {n["other"] == 1.0 for n in zigzags} == {True, False}
    rates = [trial.gains.helm_rate * trial.size.time for trial in drawn.values()]
    assert min(rates) == 0.0 < max(rates) < 40.0 * DEGREE * REMUS_TIME_S * 1.01


def test_every_maneuver_of_a_trial_is_sailed(small):
    trial, sailed = small
    truth = trial.truth(sailed)
    assert len(truth["maneuvers"]) == len(trial.notes)
    zigzags = np.flatnonzero(trial.legs[:, helm.KIND] == helm.ZIGZAG)
    took = np.diff(sailed.starts)[zigzags]
    assert np.all(took < trial.legs[zigzags, helm.LONGEST])


def test_the_helm_moves_at_its_rate_and_zigzags_may_be_unequal():
    gains = helm.Gains(helm_rate=0.1)
    assert moved(0.0, 0.2, gains, 0.05) == pytest.approx(0.005)
    assert moved(0.0, -0.2, helm.Gains(), 0.05) == -0.2
    leg = np.array(leg_row(helm.ZIGZAG, 20.0, 900.0, fin=0.2, switch=0.1, other=0.5))
    memory = np.zeros(helm.MEMORY)
    memory[helm.SIGN] = 1.0
    first, _ = commands(memory, leg, (0.0, 0.0, 0.0, 0.0, 0.0), gains, 0.05)
    second, _ = commands(memory, leg, (-0.11, 0.0, 0.0, 0.0, 0.0), gains, 0.05)
    assert (first, second) == pytest.approx((0.2, -0.1))


def test_a_turn_that_does_not_come_round_ends_at_its_longest():
    usual = np.array(leg_row(helm.TURN, 20.0, 900.0, fin=0.2, switch=6.0))
    patient = np.array(leg_row(helm.TURN, 20.0, 900.0, fin=0.2, switch=6.0, longest=100.0))
    memory = np.zeros(helm.MEMORY)
    memory[helm.LEG_TIME] = 41.0
    assert leg_is_over(memory, usual, 1.0, 0.0) and not leg_is_over(memory, patient, 1.0, 0.0)
    memory[helm.LEG_TIME] = 101.0
    assert leg_is_over(memory, patient, 1.0, 0.0)


# --- equipment and logs -------------------------------------------------------------------


def test_sensors_differ_in_quality_and_rate(drawn):
    noises = [trial.equipment.noise for trial in drawn.values()]
    for name, low, high in (("dvl_mps", 0.002, 0.02), ("gyro_radps", 0.0002, 0.005)):
        values = [getattr(noise, name) for noise in noises]
        assert low <= min(values) < max(values) <= high
        assert max(values) > 3.0 * min(values)
    for sensor, low, high in (("dvl", 2.0, 10.0), ("gyro", 10.0, 100.0)):
        rates = [noise.rates_hz[sensor] for noise in noises]
        assert low <= min(rates) < max(rates) <= high
    missing = {name for trial in drawn.values() for name in trial.equipment.missing}
    assert missing == {"attitude", "depth", "position"}


def test_a_log_has_the_files_and_the_rates_of_its_equipment(small, tmp_path):
    trial, sailed = small
    trial.write(sailed, tmp_path / "log", tmp_path / "vehicle.toml")
    logged = {path.stem for path in (tmp_path / "log").iterdir()}
    every = {"dvl", "gyro", "rudder", "elevator", "rpm", "attitude", "depth", "position"}
    assert logged == every - set(trial.equipment.missing)
    data = trial.measure(sailed)["dvl"]["time_s"]
    rate = trial.equipment.noise.rates_hz["dvl"]
    assert 1.0 / np.median(np.diff(data)) == pytest.approx(rate, rel=0.02)
    again = tmp_path / "again"
    trial.write(trial.sail(), again / "log", again / "vehicle.toml")
    for path in (tmp_path / "log").iterdir():
        assert path.read_bytes() == (again / "log" / path.name).read_bytes()


# --- effects ------------------------------------------------------------------------------

REMUS = Size(1.33, 0.191, 1.5, 1026.0)
REMUS_SCALES = Scales(REMUS, 15.0, 8.3, 1000.0)


@pytest.mark.parametrize("effect", (*SINGLES, *LATER, *OUTSIDE))
def test_sizes_have_the_parameters_of_the_generator_and_its_range_on_a_remus(effect):
    """Within 20 % (the ranges are rounded) of the strengths times what is drawn for it there."""
    drawn_there = [draw_effects([{"id": effect}], s, 1.0, 15.0)[effect] for s in range(60)]
    drawn_here = [
        draw_sizes((effect,), REMUS_SCALES, np.random.default_rng(s))[effect] for s in range(60)
    ]
    assert set(drawn_here[0]) == set(EFFECTS[effect].units)
    for symbol in drawn_here[0]:
        there = np.abs([d[symbol] for d in drawn_there])
        here = np.abs([d[symbol] for d in drawn_here])
        assert there.max() * STRENGTH[1] * 1.2 > here.max()
        assert here.min() > there.min() * STRENGTH[0] * 0.8 or symbol in ANY_SIZE


# Directions, and parts of a vector: nothing keeps them from zero.
ANY_SIZE = {"north_mps", "east_mps", "direction_rad", "maneuver_fraction", "time_s"}
ANY_SIZE |= {
    f"{axis}_{half}_mps_per_1000_s" for axis in ("north", "east") for half in ("early", "late")
}


def test_every_effect_that_can_be_planted_has_a_size():
    known = {e.id for e in EFFECTS.values() if not e.id.startswith("elevator_")}
    assert {*SINGLES, *LATER, *OUTSIDE} == known == {"current", *RANGES}


@pytest.mark.parametrize(
    ("effect", "symbol", "by"),
    [
        ("rudder_lag", "lag_s", 3.0),
        ("current", "north_mps", 3.0),
        ("rudder_rate_limit", "rate_degps", 1.0 / 3.0),
        ("rudder_stall", "angle_deg", 1.0),
        ("thrust_step", "time_s", 1.0),
    ],
)
def test_what_is_planted_in_a_multiple_of_its_size_is_the_same_otherwise(effect, symbol, by):
    usual, more = (
        draw_sizes((effect,), REMUS_SCALES, np.random.default_rng(5), times=times)[effect]
        for times in (1.0, 3.0)
    )
    assert more[symbol] == pytest.approx(by * usual[symbol], rel=1e-12)


def test_sizes_grow_with_the_vehicle():
    large = Size(5.32, 0.764, 3.0, 1026.0)  # four times the length, twice the speed
    for effect, power in (("rudder_lag", 2.0), ("wave", 64.0), ("gyro_bias", 0.5)):
        small, big = (
            draw_sizes((effect,), Scales(size, 15.0, 8.3, 1000.0), np.random.default_rng(3))[effect]
            for size in (REMUS, large)
        )
        first = next(iter(small))
        assert big[first] / small[first] == pytest.approx(power, rel=1e-6)


def test_faults_are_planted_in_the_servo_that_was_drawn(drawn):
    trial = drawn[SEEDS[0]]
    servo = trial.rudder({"rudder_lag": {"lag_s": 0.7}})
    assert servo.lag == 0.7 and servo.rate_limit == trial.equipment.rudder.rate_limit
    assert trial.rudder({}) == trial.equipment.rudder


# --- visible ------------------------------------------------------------------------------


def test_following_the_record_with_the_same_vehicle_gives_the_record(small):
    trial, sailed = small
    same = visible.motion(trial, sailed, visible.variant(trial, trial.planted))
    # the play of the servo is not in the record: it is guessed at the start of every window,
    # and wrong by no more than the play where the fin is on its way
    below = slice(int(sailed.starts[4] / STEP_S), int(sailed.starts[-3] / STEP_S))
    off = np.abs(same[below, :6] - sailed.record[below, :6])
    assert off.max() < 1e-3 and np.median(off) < 1e-6
    window = round(visible.WINDOW * trial.size.time / STEP_S)
    assert np.abs(same[:window, :6] - sailed.record[:window, :6]).max() < 1e-9


@pytest.mark.parametrize(
    ("effect", "size", "shows"),
    [
        ("rudder_offset", {"offset_deg": 0.001}, False),
        ("rudder_offset", {"offset_deg": 4.0}, True),
        ("gyro_bias", {"bias_degps": 1e-4}, False),
        ("gyro_bias", {"bias_degps": 3.0}, True),
        ("dvl_misalignment", {"yaw_deg": 6.0}, True),
    ],
)
def test_an_effect_is_visible_by_its_size(effect, size, shows):
    trial = draw(SMALL, planted=())
    trial.planted[effect] = size
    found = visible.visibility(trial, trial.sail())[effect]
    assert found["visible"] is shows
    assert (found["ratio"] >= visible.VISIBLE) is shows


def test_an_event_does_not_make_another_effect_visible():
    trial = draw(SMALL, planted=("one_off_event",))
    trial.planted["rudder_offset"] = {"offset_deg": trial.equipment.rudder.offset / DEGREE + 1e-3}
    found = visible.visibility(trial, trial.sail())
    assert found["one_off_event"]["visible"] and not found["rudder_offset"]["visible"]


def test_what_the_vehicle_has_of_itself(small):
    trial, sailed = small
    asked = {"linear_damping": {}, "rudder_lag": {"lag_s": 1.0}, "current": {}}
    found = visible.own_effects(trial, sailed, asked)
    assert set(found) == {"linear_damping", "rudder_lag"}
    assert found["linear_damping"]["visible"]  # of this vehicle: its class says so
    assert "linear damping" in trial.classes


def test_a_stated_size_is_held_against_what_the_vehicle_has(small):
    """The servo of the plant is a little slow: as slow as it is stands for it, thrice so not."""
    trial, sailed = small
    lag = trial.equipment.rudder.lag

    def explained(said: dict) -> float | None:
        return visible.own_effects(trial, sailed, said)[next(iter(said))]["explained"]

    quick = trial.equipment.rudder.rate_limit / DEGREE
    late = {"rudder_delay": {"delay_s": trial.equipment.rudder.delay}}
    whole = {"rudder_lag": {"lag_s": lag}, "rudder_rate_limit": {"rate_degps": quick}} | late
    assert explained(whole) == pytest.approx(1.0, abs=1e-6)
    slow = {"rudder_lag": {"lag_s": 3.0 * lag}, "rudder_rate_limit": {"rate_degps": quick / 3.0}}
    assert explained(slow) < 0.0 < explained({"rudder_lag": {"lag_s": lag}}) < 1.0
    assert explained({"yaw_cross_flow": {"N_r|v|": 1.0}}) is None  # not a size of the recipe


def test_a_push_changes_sway_and_yaw_by_its_size():
    trial = draw(SMALL, planted=("one_off_event",))
    found = visible.sudden(trial, trial.sail())
    trial.planted["one_off_event"] = {
        k: v * (0.5 if k in ("force_n", "moment_nm") else 1.0)
        for k, v in trial.planted["one_off_event"].items()
    }
    half = visible.sudden(trial, trial.sail())
    assert set(found) == {"v_mps", "r_radps"}
    for channel, size in found.items():
        assert 0.35 * size < half[channel] < 0.65 * size
    assert visible.sudden(draw(SMALL, planted=()), None) == {}
