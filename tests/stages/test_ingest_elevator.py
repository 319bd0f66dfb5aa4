"""The sign of the elevator, from trials of the independent generator."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from auvident.errors import ContradictionError, InputError
from auvident.schema.channels import BY_COLUMN
from auvident.schema.logs import RawTrial
from auvident.stages.ingest import ingest, ingest_fixed
from auvident.stages.ingest.held import Votes, held_steps
from auvident.stages.ingest.response import Relation
from auvident.stages.ingest.signs import LEAST_STEPS, refuse_elevator_sign
from auvident.storage.logs import read_trials
from auvident.storage.vehicle_file import load_vehicle

SAMPLES = Path(__file__).resolve().parents[2] / "sample_logs"
INPUTS = ("rudder", "elevator", "rpm")


def reversed_elevator(raw: RawTrial) -> RawTrial:
    s = raw.sensors["elevator"]
    turned = replace(s, values={"elevator_rad": -s.values["elevator_rad"]})
    return replace(raw, sensors=raw.sensors | {"elevator": turned})


def held(raw: RawTrial) -> RawTrial:
    """The same where each row of an input is said to be a change."""
    inputs = {n: replace(s, on_change=True) for n, s in raw.sensors.items() if n in INPUTS}
    return replace(raw, sensors=raw.sensors | inputs)


def test_vertical_maneuvers_show_the_sign():
    (raw,) = read_trials([SAMPLES / "dive_trial"])
    boat = load_vehicle(SAMPLES / "remus100.toml")
    _, quality = ingest(raw, boat)
    assert quality.checks["elevator_sign"]["response_1pm2"] < 0
    with pytest.raises(InputError, match="elevator sign contradicts"):
        ingest(reversed_elevator(raw), boat)


def test_the_scale_is_tested_without_an_inertia_in_pitch():
    """It went untested as if there were no fins, while the fit took the inertia in yaw."""
    (raw,) = read_trials([SAMPLES / "dive_trial"])
    boat = load_vehicle(SAMPLES / "remus100.toml")
    bare = boat.model_copy(update={"body": boat.body.model_copy(update={"iyy_kgm2": None})})
    made = {c.name: c for c in ingest(raw, bare)[1].checks_made}
    assert made["elevator_scale"].outcome == "agrees"


@pytest.mark.parametrize("seed", [95, 227])
def test_an_autopilot_on_a_lively_vehicle_is_not_taken_for_a_reversed_elevator(seed, tmp_path):
    sys.path.insert(0, str(SAMPLES))
    from seatrial.population import draw

    drawn = draw(seed)
    drawn.write(drawn.sail(), tmp_path / "trial", tmp_path / "vehicle.toml")
    (raw,) = read_trials([tmp_path / "trial"])
    vehicle = load_vehicle(tmp_path / "vehicle.toml")
    seen = ingest(raw, vehicle)[1].checks["elevator_sign"]
    assert seen["response_1pm2"] < -4 * seen["std"]
    seen = ingest(held(raw), vehicle)[1].checks["elevator_sign"]
    assert seen["response_1pm2"] > 4 * seen["std"]  # the half period later does look like one


def test_only_an_elevator_that_is_stepped_shows_its_sign():
    (dive,) = read_trials([SAMPLES / "dive_trial"])
    (harbour,) = read_trials([SAMPLES / "harbour_trial"])
    boat = load_vehicle(SAMPLES / "remus100.toml")
    length = boat.hull.length_m
    steps = [held_steps(ingest(r, boat)[0], "elevator_rad", length, 0.3) for r in (dive, harbour)]
    assert steps[0] > 5 * LEAST_STEPS
    assert steps[1] < LEAST_STEPS


def test_an_elevator_that_is_not_stepped_is_not_refused():
    """Where every relation says the opposite, but the autopilot may be the cause of it."""
    (raw,) = read_trials([SAMPLES / "dive_trial"])
    boat = load_vehicle(SAMPLES / "remus100.toml")
    opposite = Relation(0.1, 0.1, np.array([2.0]), np.array([0.1]), 0.9, np.array([0.6]), False)
    with pytest.raises(InputError, match="elevator sign contradicts"):
        refuse_elevator_sign(raw, boat, opposite, opposite, LEAST_STEPS, Votes())
    (told,) = refuse_elevator_sign(raw, boat, opposite, opposite, LEAST_STEPS - 1, Votes())
    assert (told.name, told.outcome) == ("elevator_sign", "untested")


@pytest.mark.parametrize(
    ("contrary", "seconds", "outcome"),
    [(90, 30.0, "refused"), (40, 30.0, "untested"), (2, 10.0, "untested"), (2, 30.0, "right")],
)
def test_what_follows_its_steps_decides(contrary, seconds, outcome):
    (raw,) = read_trials([SAMPLES / "dive_trial"])
    boat = load_vehicle(SAMPLES / "remus100.toml")
    opposite = Relation(0.1, 0.1, np.array([2.0]), np.array([0.1]), 0.9, np.array([0.6]), False)
    held = Votes(rows=100, contrary=contrary, holds=5, seconds=seconds)
    if outcome == "refused":
        with pytest.raises(InputError, match="elevator sign contradicts"):
            refuse_elevator_sign(raw, boat, opposite, opposite, LEAST_STEPS, held)
        return
    made = refuse_elevator_sign(raw, boat, opposite, opposite, LEAST_STEPS, held)
    assert [check.outcome for check in made] == ([outcome] if outcome == "untested" else [])


def test_a_hull_that_answers_slowly_is_not_taken_for_a_reversed_elevator(tmp_path):
    """Its pitch acceleration goes with the elevator, its pitch rate after every step does not."""
    sys.path.insert(0, str(SAMPLES))
    from seatrial.population import draw

    drawn = draw(222, planted=(), plane="vertical")
    drawn.write(drawn.sail(), tmp_path / "trial", tmp_path / "vehicle.toml")
    (raw,) = read_trials([tmp_path / "trial"])
    boat = load_vehicle(tmp_path / "vehicle.toml")
    _, quality = ingest(raw, boat)
    assert quality.checks["elevator_sign"]["response_1pm2"] > 0.0
    with pytest.raises(InputError, match="elevator sign contradicts"):
        ingest(reversed_elevator(raw), boat)


def reversed_channels(raw: RawTrial, *columns: str) -> RawTrial:
    sensors = dict(raw.sensors)
    for column in columns:
        s = sensors[BY_COLUMN[column].sensor]
        sensors[s.sensor] = replace(s, values={**s.values, column: -s.values[column]})
    return replace(raw, sensors=sensors)


Q, PITCH, W, DEPTH = "q_radps", "pitch_rad", "w_mps", "depth_m"


@pytest.mark.parametrize(
    ("turned", "absent", "name", "said"),
    [
        ((Q,), (), "pitch_rate_scale", "q_degps looks positive bow down"),
        ((Q,), ("depth",), "pitch_rate_scale", "q_degps looks positive bow down"),
        ((Q, PITCH), (), "pitch_sign", "pitch and q_degps look positive bow down"),
        ((Q, PITCH, W, DEPTH), (), "pitch_sign", "pitch, q, w and depth look like"),
        ((Q, PITCH, DEPTH), (), "pitch_sign", "pitch, q and depth look like"),
    ],
)
def test_a_gyro_of_the_other_sign_is_not_told_as_the_elevator(turned, absent, name, said):
    """The one correction that is named leaves nothing that contradicts, and all as it was."""
    (raw,) = read_trials([SAMPLES / "dive_trial"])
    raw = replace(raw, sensors={k: s for k, s in raw.sensors.items() if k not in absent})
    boat = load_vehicle(SAMPLES / "remus100.toml")
    wrong = reversed_channels(raw, *turned)
    with pytest.raises(ContradictionError, match=said) as refused:
        ingest(wrong, boat)
    assert f"--fix {name}" in refused.value.remedy and "q_degps" in refused.value.where
    done = ingest_fixed(wrong, boat, [name])
    assert not [c.name for c in done.quality.checks_made if c.outcome == "contradicts"]
    assert done.trial.table.equals(ingest(raw, boat)[0].table)


def test_a_pitch_that_contradicts_the_pitch_rate_is_turned_where_the_elevator_fits_the_rate():
    """Without a depth q was turned, and the elevator refused from then on."""
    (raw,) = read_trials([SAMPLES / "dive_trial"])
    raw = replace(raw, sensors={k: s for k, s in raw.sensors.items() if k != "depth"})
    boat = load_vehicle(SAMPLES / "remus100.toml")
    done = ingest_fixed(reversed_channels(raw, PITCH), boat, ["pitch_rate_scale"])
    assert done.quality.fixed == {"pitch_rate_scale": "pitch_rad = -1 pitch_rad"}
    assert not [c.name for c in done.quality.checks_made if c.outcome == "contradicts"]


def test_where_elevator_and_depth_disagree_on_the_pitch_none_is_turned():
    (raw,) = read_trials([SAMPLES / "dive_trial"])
    boat = load_vehicle(SAMPLES / "remus100.toml")
    _, quality = ingest(reversed_channels(raw, "elevator_rad", Q), boat)
    (made,) = (c for c in quality.checks_made if c.outcome == "contradicts")
    assert made.name == "pitch_rate_scale" and not made.fix
    assert "the elevator fits the pitch rate, but the depth the pitch" in made.message


def test_a_dive_that_is_negative_throughout_is_told_though_all_agrees():
    """Forward-left-up, with an elevator that fits: the weight in water has the other sign."""
    (raw,) = read_trials([SAMPLES / "dive_trial"])
    boat = load_vehicle(SAMPLES / "remus100.toml")
    upward = reversed_channels(raw, "elevator_rad", Q, PITCH, W, DEPTH)
    made = {c.name: c for c in ingest(upward, boat)[1].checks_made}["pitch_sign"]
    assert made.outcome == "contradicts" and "negative throughout" in made.message
    assert not made.fix
