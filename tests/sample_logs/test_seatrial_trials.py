"""The committed trials, their truth, and what each effect does to a log."""

import ast
import json
import re

import numpy as np
import pytest
from seatrial import trial as trial_module
from seatrial.effects import EFFECTS
from seatrial.sensors import measure_all
from seatrial.trial import generate, sail, stream
from seatrial.vehicles import load_vehicle

HORIZONTAL = ["bay_trial", "harbour_trial", "sound_trial"]
VERTICAL = ["dive_trial", "shelf_trial"]
TRIALS = [*HORIZONTAL, *VERTICAL]


@pytest.mark.parametrize("trial", TRIALS)
def test_recipe_gives_the_committed_files_to_the_byte(
    trial, recipe, samples, truth_folder, tmp_path
):
    truth = generate(recipe(trial), tmp_path)
    committed = sorted(p.name for p in (samples / trial).iterdir())
    assert sorted(p.name for p in tmp_path.iterdir()) == committed
    for name in committed:
        assert (tmp_path / name).read_bytes() == (samples / trial / name).read_bytes(), name
    kept = json.loads((truth_folder / f"{trial}.json").read_text(encoding="utf-8"))
    assert kept == json.loads(json.dumps(truth))


@pytest.mark.parametrize("trial", HORIZONTAL)
def test_trial_has_the_maneuvers_an_identification_needs(trial, truth_folder):
    truth = json.loads((truth_folder / f"{trial}.json").read_text(encoding="utf-8"))
    maneuvers = truth["maneuvers"]
    kinds = [m["kind"] for m in maneuvers]
    assert 15 * 60 < truth["duration_s"] < 25 * 60
    assert kinds.count("turn") >= 4
    assert kinds.count("straight") >= 2
    for angle in (10, 20):
        zigzags = [m for m in maneuvers if m.get("heading_deg") == angle]
        assert len(zigzags) >= 2
        assert len({m["rpm"] for m in zigzags}) >= 2
    sides = {np.sign(m["rudder_deg"]) for m in maneuvers if m["kind"] == "turn"}
    assert sides == {-1, 1}
    ends = [m["t_end_s"] for m in maneuvers]
    assert all(a <= m["t_start_s"] for a, m in zip(ends, maneuvers[1:], strict=False))


def test_dive_trial_has_vertical_maneuvers(truth_folder):
    truth = json.loads((truth_folder / "dive_trial.json").read_text(encoding="utf-8"))
    assert truth["plane"] == "vertical"
    kinds = [m["kind"] for m in truth["maneuvers"]]
    assert kinds.count("straight") >= 2
    assert kinds.count("depth_step") >= 2
    zigzags = [m for m in truth["maneuvers"] if m["kind"] == "zigzag"]
    assert all(m["plane"] == "vertical" for m in zigzags)
    assert len({m["elevator_deg"] for m in zigzags}) >= 2
    assert len({m["rpm"] for m in zigzags}) >= 2


@pytest.mark.parametrize("trial", TRIALS)
def test_committed_trial_is_small(trial, samples):
    assert sum(p.stat().st_size for p in (samples / trial).iterdir()) < 5e6


def test_motion_of_the_trials_is_plausible(recipe):
    for name in HORIZONTAL:
        r = recipe(name)
        vehicle = load_vehicle(r["vehicle"])
        record, starts, *_ = sail(r, vehicle, {})
        working = record[int(starts[6] * 100) : int(starts[-6] * 100)]
        assert 0.7 < working[:, 0].min() < working[:, 0].max() < 2.2
        assert np.abs(np.degrees(working[:, 9])).max() < 10
        assert np.ptp(working[3000:, 8]) < 1.5  # depth
        assert np.abs(np.degrees(working[:, 5])).max() < 30


def test_generator_does_not_know_the_program(samples):
    for path in samples.rglob("*.py"):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        imported = {a.name for n in ast.walk(tree) if isinstance(n, ast.Import) for a in n.names}
        imported |= {n.module or "" for n in ast.walk(tree) if isinstance(n, ast.ImportFrom)}
        assert not any(name.split(".")[0] == "auvident" for name in imported), path


def test_nothing_beside_the_logs_tells_what_was_planted(samples, recipe):
    planted = [e["id"] for t in TRIALS for e in recipe(t).get("effect", [])]
    assert planted
    for path in [*samples.glob("*.toml"), *samples.glob("*.md")]:
        text = path.read_text(encoding="utf-8")
        assert not any(re.search(rf"\b{effect}\b", text) for effect in planted), path


CHANNELS = (("dvl", "u_mps"), ("dvl", "v_mps"), ("gyro", "r"), ("gyro", "q"))


@pytest.fixture(scope="module")
def clean_log():
    return log_of([])


def log_of(effects):
    """Measured channels of a short trial of the sailed vehicle, every sensor stacked."""
    recipe = {
        "name": "short",
        "vehicle": "tern180",
        "seed": 5,
        "schedule": {"straights": 1, "turns": 1, "zigzags_10": 0, "zigzags_20": 1},
    }
    vehicle = load_vehicle("tern180")
    planted = trial_module.draw_effects(effects, 5, vehicle.scale, 11.0)
    record, *_ = sail(recipe, vehicle, planted)
    return measure_all(record, vehicle, planted, lambda name: stream(5, name)), len(record)


@pytest.mark.parametrize("effect", EFFECTS)
def test_each_effect_changes_the_log(effect, clean_log):
    early = {"time_s": 200.0} if effect == "thrust_step" else {}  # the trial here is short
    changed, _ = log_of([{"id": effect, **early}])
    clean, _ = clean_log
    sizes = []
    for sensor, column in CHANNELS:
        n = min(clean[sensor][column].size, changed[sensor][column].size)
        difference = clean[sensor][column][:n] - changed[sensor][column][:n]
        sizes.append(np.sqrt(np.nanmean(difference**2)) / np.nanstd(clean[sensor][column]))
    assert max(sizes) > 0.005, sizes


@pytest.mark.parametrize("effect", EFFECTS)
def test_drawn_parameters_have_the_declared_names_and_depend_on_the_seed(effect):
    draw = [trial_module.draw_effects([{"id": effect}], s, 1.0, 15.0)[effect] for s in (1, 1, 2)]
    assert set(draw[0]) == set(EFFECTS[effect].units)
    assert draw[0] == draw[1] != draw[2]


def test_several_effects_and_given_parameters():
    wanted = [{"id": "rudder_lag", "lag_s": 0.5}, {"id": "gyro_bias"}]
    planted = trial_module.draw_effects(wanted, 3, 1.0, 15.0)
    assert planted["rudder_lag"] == {"lag_s": 0.5}
    assert set(planted) == {"rudder_lag", "gyro_bias"}


def maneuvers_of(**more):
    """Record and maneuvers on the clock of the record, of a trial of both planes."""
    recipe = {"name": "both", "vehicle": "remus100", "seed": 4, "plane": "both", **more}
    record, starts, legs, notes = sail(recipe, load_vehicle("remus100"), {})
    return record, trial_module.maneuver_list(legs, starts, notes, 0.0)


def test_a_trial_of_both_planes_has_the_maneuvers_of_each():
    record, found = maneuvers_of()
    assert 20 * 60 < record.shape[0] / 100 < 40 * 60
    of_each = {
        plane: [m["kind"] for m in found if m.get("plane", "horizontal") == plane]
        for plane in ("horizontal", "vertical")
    }
    assert of_each["horizontal"].count("turn") == of_each["horizontal"].count("zigzag") == 4
    assert of_each["horizontal"].count("straight") == 2
    assert of_each["vertical"].count("zigzag") == 4
    assert of_each["vertical"].count("depth_step") == 2
    assert "coupled" not in of_each["horizontal"]


def test_coupled_maneuvers_turn_and_dive_at_once():
    few = {"turns": 0, "zigzags_10": 0, "zigzags_20": 0, "vertical_zigzags": 0, "depth_steps": 0}
    record, found = maneuvers_of(schedule={**few, "straights": 0, "coupled": 4})
    assert [m["kind"] for m in found] == ["coupled"] * 4
    assert sorted(m["way"] for m in found) == ["helix"] * 2 + ["turning dive"] * 2
    for m in found:
        rows = record[int(m["t_start_s"] * 100) : int(m["t_end_s"] * 100)]
        assert np.ptp(rows[:, 10]) > np.radians(8.0)  # pitch
        assert np.abs(rows[:, 5]).max() > np.radians(5.0)  # yaw rate
        assert rows[:, 8].min() > 5.0 and np.abs(rows[:, 10]).max() < np.radians(25.0)
        if m["way"] == "helix":
            assert np.ptp(rows[:, 11]) > 2 * np.pi and rows[-1, 8] > rows[0, 8] + 4.0


def test_shelf_trial_is_short_and_has_zigzags_of_two_sizes_and_speeds(truth_folder):
    truth = json.loads((truth_folder / "shelf_trial.json").read_text(encoding="utf-8"))
    assert truth["plane"] == "vertical" and truth["duration_s"] < 16 * 60
    zigzags = [m for m in truth["maneuvers"] if m["kind"] == "zigzag"]
    assert len({m["elevator_deg"] for m in zigzags}) == 2
    assert max(m["rpm"] for m in zigzags) > 1.2 * min(m["rpm"] for m in zigzags)
    assert {m["kind"] for m in truth["maneuvers"]} == {"straight", "depth_step", "zigzag"}


def test_the_ballast_of_the_plant_may_be_another_than_that_of_the_file(recipe):
    wrong = recipe("shelf_trial")["ballast"]
    told, true = load_vehicle("tern180"), load_vehicle("tern180", ballast=wrong)
    assert true.body.weight == pytest.approx(wrong["mass_kg"] * 9.81)
    assert (true.body.x_g, true.body.z_g) == (wrong["x_g_m"], wrong["z_g_m"])
    assert true.body.buoyancy == told.body.buoyancy
    with pytest.raises(ValueError, match="no ballast"):
        load_vehicle("tern180", ballast={"ballast_kg": 1.0})


def test_unknown_names_in_a_recipe_are_refused():
    with pytest.raises(ValueError, match="no such plane: sideways"):
        generate({"name": "x", "vehicle": "tern180", "seed": 1, "plane": "sideways"}, None)
    with pytest.raises(ValueError, match="spred"):
        generate({"name": "x", "vehicle": "tern180", "seed": 1, "spred": 0.2}, None)
    with pytest.raises(ValueError, match="has no parameter"):
        trial_module.draw_effects([{"id": "rudder_lag", "lag": 1}], 1, 1.0, 15.0)
