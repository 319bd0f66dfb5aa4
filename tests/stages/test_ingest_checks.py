"""Units, scales, signs and axes of trials at sea: right ones agree, damaged ones contradict."""

import pickle
import re
import sys
import tomllib
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from auvident.errors import InputError, UsageError
from auvident.report.check_words import contradictions, untested
from auvident.report.html_words import SERIOUS
from auvident.schema.logs import DEG, CheckMade, RawTrial, TrialQuality
from auvident.schema.trial import Trial
from auvident.stages.ingest import ingest, ingest_fixed, refuse_unproposed
from auvident.stages.ingest.checks import (
    CHECKS,
    Seen,
    averaging,
    corrected,
    rudder,
    run_checks,
    throttle,
)
from auvident.stages.ingest.checks.correction import mixed, scaled
from auvident.stages.ingest.still import OF_MOTION
from auvident.storage.logs import read_trials
from auvident.storage.vehicle_file import load_vehicle
from tests.session import once

Change = Callable[[np.ndarray], np.ndarray]
SAMPLES = Path(__file__).resolve().parents[2] / "sample_logs"
NAMES = [check.name for check in CHECKS]
VELOCITIES = ("u_mps", "v_mps", "w_mps")


@once
def sailed() -> RawTrial:
    """A trial of the independent generator, with all sensors."""
    sys.path.insert(0, str(SAMPLES))
    from seatrial.trial import generate

    schedule = {"straights": 2, "turns": 5, "zigzags_10": 0, "zigzags_20": 1}
    with TemporaryDirectory() as folder:
        place = Path(folder) / "trial"
        recipe = {"name": "trial", "vehicle": "remus100", "seed": 21, "schedule": schedule}
        generate(recipe, place)
        (found,) = read_trials([place])
    return found


BOAT = load_vehicle(SAMPLES / "remus100.toml")


@cache
def ingested() -> tuple[Trial, TrialQuality]:
    return ingest(sailed(), BOAT)


@pytest.fixture(scope="module")
def clean() -> TrialQuality:
    return ingested()[1]


def changed(raw: RawTrial, **changes: Callable[[np.ndarray], np.ndarray]) -> RawTrial:
    """The trial with channels changed."""
    sensors = dict(raw.sensors)
    for name, sensor in raw.sensors.items():
        own = {c: f(sensor.values[c]) for c, f in changes.items() if c in sensor.values}
        sensors[name] = replace(sensor, values={**sensor.values, **own})
    return replace(raw, sensors=sensors)


def without(raw: RawTrial, *names: str) -> RawTrial:
    return replace(raw, sensors={k: s for k, s in raw.sensors.items() if k not in names})


def rows(raw: RawTrial) -> dict[str, CheckMade]:
    return {c.name: c for c in ingest(raw, BOAT)[1].checks_made}


def on_the_grid(*absent: str, **changes: Change) -> dict[str, CheckMade]:
    """Rows of the ingested trial with channels changed, without the relations between sensors."""
    trial = ingested()[0]
    known = trial.table.drop(columns=list(absent))
    table = known.assign(**{c: f(known[c].to_numpy()) for c, f in changes.items() if c in known})
    return {c.name: c for c in run_checks(Seen(sailed(), trial.with_table(table), BOAT))[0]}


def times(factor: float, *columns: str) -> dict[str, Callable[[np.ndarray], np.ndarray]]:
    return {c: lambda x: factor * x for c in columns}


def earthly(raw: RawTrial) -> RawTrial:
    """u and v as north and east."""
    dvl, attitude = raw.sensors["dvl"], raw.sensors["attitude"]
    known = np.isfinite(attitude.values["heading_rad"])
    time, first = np.unique(attitude.time_s[known], return_index=True)
    heading = np.unwrap(attitude.values["heading_rad"][known][first])
    at = np.interp(dvl.time_s, time, heading)
    u, v = dvl.values["u_mps"], dvl.values["v_mps"]
    turned = {"u_mps": u * np.cos(at) - v * np.sin(at), "v_mps": u * np.sin(at) + v * np.cos(at)}
    new = replace(dvl, values={**dvl.values, **turned})
    return replace(raw, sensors={**raw.sensors, "dvl": new})


def stuck(raw: RawTrial, seconds: float = 40.0) -> RawTrial:
    """The rudder as it was, for so long where it moves most."""
    s = raw.sensors["rudder"]
    values = s.values["rudder_rad"].copy()
    starts = np.arange(s.time_s[0], s.time_s[-1] - seconds, 5.0)
    pieces = [(s.time_s >= t) & (s.time_s < t + seconds) for t in starts]
    worst = max(pieces, key=lambda rows: np.nanstd(values[rows]))
    values[worst] = values[worst][0]
    new = replace(s, values={"rudder_rad": values})
    return replace(raw, sensors={**raw.sensors, "rudder": new})


# --- what is right ------------------------------------------------------------------------


def test_a_right_trial_contradicts_nothing_and_most_is_tested(clean):
    assert [c.name for c in clean.checks_made][: len(NAMES)] == NAMES  # clocks stand behind
    assert not contradictions([clean])
    tested = {c.name for c in clean.checks_made if c.outcome == "agrees"}
    vertical = {n for n in NAMES if n.startswith(("elevator", "heave", "pitch"))}
    assert tested >= set(NAMES) - vertical - {"rudder_cut"}


def test_every_row_says_something(clean):
    for made in clean.checks_made:
        assert made.message and made.what and made.against
        assert not made.fix


def test_what_nothing_tests_is_said():
    quality = ingest(without(sailed(), "attitude", "position", "depth"), BOAT)[1]
    line = untested([quality])
    assert line.startswith("Not tested: ")
    assert "scale and sign of the yaw rate (no heading, and no turns with positions)" in line
    assert "scale of the speed within 5 % (no position log, or too short; no heave, no" in line
    assert "scale of the speed (" not in line  # thrust and drag test it, roughly
    (row,) = [c for c in quality.checks_made if c.name == "speed_scale"]
    assert "% only" in row.message


def test_every_contradiction_is_serious_in_the_report():
    assert {check.finding for check in CHECKS} - SERIOUS == {"rudder_sign"}  # refused before


# --- what is wrong ------------------------------------------------------------------------

KNOTS = 1.0 / 0.514444
DAMAGED = {
    "knots logged as m/s": (times(KNOTS, *VELOCITIES), "speed_by_position", True),
    "m/s logged as knots": (times(1 / KNOTS, *VELOCITIES), "speed_scale", True),
    "DVL x 1.1": (times(1.1, *VELOCITIES), "speed_by_position", True),
    "rpm of the motor": (times(2.0, "rpm"), "rpm_scale", True),
    "half of the rpm": (times(0.5, "rpm"), "rpm_scale", True),
    "rpm negative": (times(-1.0, "rpm"), "rpm_sign", True),
    "rpm constant": ({"rpm": lambda x: 0 * x + np.nanmedian(x)}, "rpm_constant", False),
    "rpm in rev/s": (times(1 / 60, "rpm"), "advance_ratio", False),
    "rpm in rad/s": (times(np.pi / 30, "rpm"), "rpm_scale", True),
    "rev/s, by speed": (times(1 / 60, "rpm"), "rpm_scale", True),
    "pulses about 1500 us": ({"rpm": lambda x: 1500.0 + 0.2 * x}, "rpm_scale", False),
    "per cent of a throttle": (times(0.05, "rpm"), "rpm_scale", False),
    "m/s as cm/s": (times(0.01, *VELOCITIES), "advance_ratio", False),
    "v x 0.4": (times(0.4, "v_mps"), "sway_by_position", False),
    "v of the wrong sign, by position": (times(-1.0, "v_mps"), "sway_by_position", True),
    "gyro x 1.1": (times(1.1, "r_radps"), "yaw_rate_scale", True),
    "gyro x 1.05": (times(1.05, "r_radps"), "yaw_rate_scale", True),
    "gyro x 1.3": (times(1.3, "r_radps"), "yaw_rate_scale", True),
    "gyro + 2 deg/s": ({"r_radps": lambda x: x + 2 * DEG}, "yaw_rate_offset", True),
    "rudder + 4 deg": ({"rudder_rad": lambda x: x + 4 * DEG}, "rudder_offset", True),
    "rudder x 4": (times(4.0, "rudder_rad"), "rudder_unit", False),
    "rudder / 57": (times(DEG, "rudder_rad"), "rudder_unit", True),
    "rudder / 4": (times(0.25, "rudder_rad"), "rudder_scale", False),
    "rudder cut at 8 degrees": (
        {"rudder_rad": lambda x: np.clip(x, -8 * DEG, 8 * DEG)},
        "rudder_cut",
        False,
    ),
    "u of the wrong sign": (times(-1.0, "u_mps"), "surge_sign", True),
    "v of the wrong sign": (times(-1.0, "v_mps"), "sway_sign", True),
    "DVL turned by 180 degrees": (times(-1.0, "u_mps", "v_mps"), "surge_sign", True),
    "pitch of the wrong sign": (times(-1.0, "pitch_rad"), "pitch_sign", True),
    "depth in feet": (times(3.281, "depth_m"), "pitch_sign", False),
}


@pytest.mark.parametrize("damage", DAMAGED)
def test_a_damaged_trial_contradicts(damage):
    changes, name, has_fix = DAMAGED[damage]
    whole = name in ("yaw_rate_scale", "yaw_rate_offset", "rudder_scale", "rudder_offset")
    made = (rows(changed(sailed(), **changes)) if whole else on_the_grid(**changes))[name]
    assert made.outcome == "contradicts", made.message
    assert bool(made.fix) == has_fix
    assert made.remedy


def test_a_unit_that_fits_is_named():
    for damage, words in {
        "rpm in rad/s": "rad/s in an rpm column?",
        "depth in feet": "feet logged as metres?",
        "half of the rpm": "Or another vehicle's file?",
    }.items():
        changes, name, _ = DAMAGED[damage]
        assert words in on_the_grid(**changes)[name].message
    pressure = on_the_grid(**times(9.9, "depth_m"))["pitch_sign"]
    assert "pressure in kPa logged as depth?" in pressure.message


def entry_offered(remedy: str) -> dict[str, object]:
    """The line of a map that is offered, under [rpm], as a map reads it."""
    assert "under [rpm] in a map (--map)" in remedy
    found = re.search(r"rpm = \{.*?\}", remedy)
    assert found is not None, remedy
    return tomllib.loads(found[0])["rpm"]


@pytest.mark.parametrize("rest", [1000.0, 1100.0, 1500.0])
@pytest.mark.parametrize("begins", [0.0, 0.5])
def test_pulses_of_a_throttle_are_told_from_a_rate(rest, begins):
    """Also where the log begins under way: steady speeds point to the pulse of no speed."""
    trial, _ = ingested()
    table = trial.table.copy()
    table["rpm"] = rest + 0.2 * table["rpm"]
    table = table[table["u_mps"] > begins].reset_index(drop=True)
    rows_of = {
        made.name: made for made in run_checks(Seen(sailed(), trial.with_table(table), BOAT))[0]
    }
    made = rows_of["rpm_scale"]
    assert made.outcome == "contradicts" and not made.fix
    assert "where the vehicle stands still: microseconds" in made.message
    entry = entry_offered(made.remedy)
    assert (entry["column"], entry["unit"], entry["scale"]) == ("rpm", "rpm", 2)
    assert entry["offset"] == pytest.approx(-2.0 * rest, abs=120.0)
    assert rows_of["speed_scale"].outcome != "contradicts"
    assert made.value == pytest.approx(rest, abs=60.0)


def test_radians_of_a_slow_propeller_may_be_per_cent(monkeypatch):
    monkeypatch.setattr(throttle, "MOST_PERCENT", 200.0)
    slow = on_the_grid(**times(np.pi / 30, "rpm"))["rpm_scale"]
    assert "per cent" in slow.message and "or rad/s in an rpm column" in slow.message
    assert not slow.fix


def test_a_throttle_is_named_and_a_rate_that_is_held_is_none():
    share = on_the_grid(**times(0.05, "rpm"))
    for name in ("rpm_scale", "advance_ratio"):
        assert "per cent of a throttle in an rpm column" in share[name].message
    entry = entry_offered(share["rpm_scale"].remedy)
    assert entry == {"column": "rpm", "unit": "percent", "scale": 12.5}
    assert "a throttle of 0 to 1" in on_the_grid(**times(5e-4, "rpm"))["rpm_constant"].message
    held = on_the_grid(rpm=lambda x: 0.0 * x + 1200.0)["rpm_scale"]
    assert "microseconds" not in held.message


@pytest.mark.parametrize(
    ("north", "east", "words"),
    [
        (("east_m", 1.0), ("north_m", 1.0), "north and east are swapped?"),
        (("north_m", 1.0), ("east_m", -1.0), "east has the other sign?"),
        (("north_m", -1.0), ("east_m", 1.0), "north has the other sign?"),
        (("east_m", -1.0), ("north_m", -1.0), "north and east are swapped and have the other"),
    ],
)
def test_a_position_in_a_mirror_is_told(north, east, words):
    trial, _ = ingested()
    table = trial.table.assign(
        north_m=north[1] * trial.table[north[0]], east_m=east[1] * trial.table[east[0]]
    )
    made = run_checks(Seen(sailed(), trial.with_table(table), BOAT))[0]
    (row,) = [c for c in made if c.name == "speed_by_position"]
    assert row.outcome == "contradicts" and words in row.message


def reckoned(raw: RawTrial, gyro: float) -> RawTrial:
    """Heading and position computed from gyro and DVL, as a vehicle without aids does."""
    dvl, attitude, gyros, fixes = (
        raw.sensors[name] for name in ("dvl", "attitude", "gyro", "position")
    )
    rate = gyro * np.nan_to_num(gyros.values["r_radps"])
    time, first = np.unique(gyros.time_s, return_index=True)
    heading = np.concatenate(([0.0], np.cumsum(np.diff(time) * rate[first][1:])))
    new = np.interp(attitude.time_s, time, heading)
    known = np.isfinite(dvl.values["u_mps"] + dvl.values["v_mps"])
    at, first = np.unique(dvl.time_s[known], return_index=True)
    u, v = (dvl.values[c][known][first] for c in ("u_mps", "v_mps"))
    velocity = (u + 1j * v) * np.exp(1j * np.interp(at, time, heading))
    place = np.concatenate(([0.0], np.cumsum(np.diff(at) * velocity[1:])))
    track = np.interp(fixes.time_s, at, place.real), np.interp(fixes.time_s, at, place.imag)
    sensors = {
        "attitude": replace(attitude, values={**attitude.values, "heading_rad": new}),
        "gyro": replace(gyros, values={**gyros.values, "r_radps": gyro * gyros.values["r_radps"]}),
        "position": replace(fixes, values=dict(zip(("north_m", "east_m"), track, strict=True))),
    }
    return replace(raw, sensors={**raw.sensors, **sensors})


def test_what_is_computed_from_a_sensor_does_not_test_it():
    slow = changed(sailed(), **times(0.8, *VELOCITIES))
    made = rows(reckoned(slow, 1.2))
    for name, source in {
        "speed_by_position": "the position is computed from the DVL",
        "sway_by_position": "the position is computed from the DVL",
        "yaw_rate_scale": "the heading is computed from the gyro",
        "yaw_rate_offset": "the heading is computed from the gyro",
    }.items():
        assert (made[name].outcome, made[name].message) == ("untested", source)


def test_one_rate_throughout_tells_no_thrust():
    made = on_the_grid(rpm=lambda x: 0 * x + 900.0)["rpm_constant"]
    assert made.outcome == "contradicts"
    assert "differ by a factor" in made.message
    level = on_the_grid(rpm=lambda x: 0 * x + 900.0, u_mps=lambda x: 0 * x + 1.5)["rpm_constant"]
    assert level.outcome == "untested"
    assert level.message == "rpm never changes: thrust and drag cannot be told apart"


@pytest.mark.parametrize(("most", "told"), [(0.0, "stands at 0"), (0.5, "stands within 0.5")])
def test_rpm_that_stays_at_zero_under_way_looks_stuck(most, told):
    made = on_the_grid(rpm=lambda x: most * np.cos(x))
    assert made["rpm_constant"].outcome == "contradicts"
    assert f"m/s although rpm {told} throughout" in made["rpm_constant"].message
    assert "looks stuck, or is not connected" in made["rpm_constant"].message
    assert made["advance_ratio"].message == "the propeller hardly turns"
    still = on_the_grid(rpm=lambda x: 0 * x, u_mps=lambda x: 0 * x, v_mps=lambda x: 0 * x)
    assert still["rpm_constant"].outcome == "untested"
    assert still["advance_ratio"].message == "the vehicle hardly moves"


def test_what_is_tested_coarsely_is_said(clean):
    line = untested([clean])
    assert "Tested only coarsely: scale and sign of v (to a factor of " in line
    assert "scale of the rudder (to a factor of 2.5), clock of the rudder (to 1.9 s and" in line
    assert "clock of the attitude" not in line
    coarse = {c.name: c.within for c in clean.checks_made if c.only}
    assert coarse["clock_rudder"] == pytest.approx(1.9, abs=0.05)
    assert coarse["drift_rudder"] == pytest.approx(588.0, abs=50.0)
    assert {c.within for c in clean.checks_made if not c.only} == {None}


def test_a_heading_of_radians_in_a_column_of_degrees():
    assert rows(sailed())["heading_unit"].value == pytest.approx(1.0, abs=0.05)
    attitude = sailed().sensors["attitude"]
    heading = attitude.values["heading_rad"] * DEG
    wrong = replace(attitude, values=attitude.values | {"heading_rad": heading})
    raw = replace(sailed(), sensors={**sailed().sensors, "attitude": wrong})
    made = rows(raw)["heading_unit"]
    assert made.outcome == "contradicts" and "radians logged as degrees?" in made.message
    back = corrected(raw, made.fix).sensors["attitude"].values["heading_rad"]
    assert np.allclose(back, attitude.values["heading_rad"], equal_nan=True)


def test_a_log_of_gentle_turns_is_not_told_to_be_short():
    sensors = dict(sailed().sensors)
    for name, column in (("gyro", "r_radps"), ("attitude", "heading_rad")):
        values = sensors[name].values
        known = np.isfinite(values[column])
        gentle = np.full(known.size, np.nan)
        gentle[known] = 0.02 * np.unwrap(values[column][known], period=2.0 * np.pi)
        sensors[name] = replace(sensors[name], values=values | {column: gentle})
    made = rows(replace(sailed(), sensors=sensors))["heading_unit"]
    assert (made.outcome, made.message) == (
        "untested",
        "over the whole log the vehicle turns too little",
    )


@pytest.mark.parametrize("degrees", [10.0, -25.0])
def test_a_dvl_that_is_turned_is_told_without_a_position(degrees):
    """A DVL turned to starboard reads a v to port on straight ways, whatever the course."""
    c, s = np.cos(degrees * DEG), np.sin(degrees * DEG)
    turned = {"u_mps": (c, s), "v_mps": (-s, c)}
    dvl = sailed().sensors["dvl"]
    u, v = dvl.values["u_mps"], dvl.values["v_mps"]
    values = dvl.values | {n: a * u + b * v for n, (a, b) in turned.items()}
    raw = replace(sailed(), sensors={**sailed().sensors, "dvl": replace(dvl, values=values)})
    made = rows(without(raw, "position"))
    assert made["dvl_yaw"].outcome == "contradicts"
    assert made["dvl_yaw"].value == pytest.approx(degrees, abs=0.5)
    assert f"(here {made['dvl_yaw'].value:.1f}, positive to starboard)" in made["dvl_yaw"].remedy
    assert made["speed_by_drift"].outcome == "untested"  # nothing else is accused of it
    stated = BOAT.model_copy(
        update={"dvl": BOAT.dvl.model_copy(update={"mounting_yaw_deg": degrees})}
    )
    quality = ingest(without(raw, "position"), stated)[1]
    assert {c.name: c.outcome for c in quality.checks_made}["dvl_yaw"] == "agrees"


def test_one_course_does_not_tell_a_turned_dvl_from_a_current():
    made = on_the_grid(heading_rad=lambda x: 0 * x + 0.3)["dvl_yaw"]
    assert (made.outcome, made.message) == (
        "untested",
        "needs straight stretches on several courses",
    )


AXES = {
    "u and v swapped": {"u_mps": (1.0, "v_mps"), "v_mps": (1.0, "u_mps")},
    "v and w swapped": {"w_mps": (1.0, "v_mps"), "v_mps": (1.0, "w_mps")},
    "turned by 90 degrees": {"u_mps": (1.0, "v_mps"), "v_mps": (-1.0, "u_mps")},
    "turned by -90 degrees": {"u_mps": (-1.0, "v_mps"), "v_mps": (1.0, "u_mps")},
}


@pytest.mark.parametrize("damage", AXES)
def test_axes_are_named_and_the_correction_restores_them(damage):
    wrong = corrected(sailed(), mixed(AXES[damage]))
    made = rows(wrong)["dvl_axes"]
    assert made.outcome == "contradicts"
    back = corrected(wrong, made.fix).sensors["dvl"].values
    for column in VELOCITIES:
        np.testing.assert_array_equal(back[column], sailed().sensors["dvl"].values[column])


def test_velocities_of_the_earth_are_turned_back():
    made = rows(earthly(sailed()))["dvl_axes"]
    assert made.value == pytest.approx(1.0, abs=0.1)
    back = corrected(earthly(sailed()), made.fix).sensors["dvl"].values
    here = np.isfinite(back["u_mps"]) & np.isfinite(sailed().sensors["dvl"].values["u_mps"])
    np.testing.assert_allclose(
        back["u_mps"][here], sailed().sensors["dvl"].values["u_mps"][here], atol=1e-9
    )


def test_a_heave_of_the_wrong_sign():
    (dive,) = read_trials([SAMPLES / "dive_trial"])
    made = rows(changed(dive, **times(-1.0, "w_mps")))["heave_sign"]
    assert made.outcome == "contradicts"
    assert made.fix == scaled(-1.0, "w_mps")


@pytest.mark.parametrize("seconds", [15.0, 40.0])
def test_a_rudder_that_is_stuck(seconds):
    made = rows(stuck(sailed(), seconds))["rudder_stuck"]
    assert made.outcome == "contradicts"
    assert "looks stuck" in made.message


def test_moments_of_yaw_show_a_rudder_that_is_stuck_and_no_settled_turn(monkeypatch):
    monkeypatch.setattr(rudder, "SWING", np.inf)
    assert rows(sailed())["rudder_stuck"].outcome == "agrees"
    made = rows(stuck(sailed(), 15.0))["rudder_stuck"]
    assert made.outcome == "contradicts" and "turns as if the rudder were at" in made.message
    monkeypatch.setattr(rudder, "LEAST_BALANCED", 1.0)  # a balance that explains little
    assert rows(stuck(sailed(), 15.0))["rudder_stuck"].outcome == "agrees"


@pytest.mark.parametrize("side", ["port", "starboard"])
def test_a_rudder_whose_zero_is_off_is_set_right_by_its_fix(side):
    signs = BOAT.signs.model_copy(update={"rudder_positive_turns": side})
    boat = BOAT.model_copy(update={"signs": signs})
    own = times(float(boat.rudder_sign * BOAT.rudder_sign), "rudder_rad")
    off = changed(changed(sailed(), **own), rudder_rad=lambda x: x - 4 * DEG)
    made = {m.name: m for m in ingest(off, boat)[1].checks_made}
    found = made["rudder_offset"]
    assert found.outcome == "contradicts" and found.value == pytest.approx(-4.0, abs=0.3)
    assert made["rudder_cut"].message == "see rudder_offset"
    right = ingest(corrected(off, found.fix), boat)[1].checks_made
    assert {m.outcome for m in right if m.name == "rudder_offset"} == {"agrees"}


def test_a_small_scale_of_the_gyro_needs_roll_and_pitch():
    slow = times(1.05, "r_radps")
    assert rows(changed(sailed(), **slow))["yaw_rate_scale"].value == pytest.approx(1 / 1.05, 0.01)
    flat = {c: lambda x: np.full_like(x, np.nan) for c in ("roll_rad", "q_radps")}
    assert rows(changed(sailed(), **slow, **flat))["yaw_rate_scale"].outcome == "agrees"
    turned = changed(sailed(), **times(-1.0, "roll_rad"))
    assert rows(turned)["yaw_rate_scale"].outcome == "agrees"


@pytest.mark.parametrize("course", [0.0, 90 * DEG])
def test_a_heading_that_stands_still_corrects_no_gyro(course):
    made = rows(changed(sailed(), heading_rad=lambda x: np.full_like(x, course)))
    assert made["heading_unit"].outcome == "contradicts"
    for name in ("yaw_rate_scale", "yaw_rate_offset"):
        assert (made[name].message, made[name].fix) == ("see heading_unit", "")


# --- a DVL that averages ------------------------------------------------------------------


def averaged(count: int) -> RawTrial:
    """u and v as means of the last samples."""
    kernel = np.ones(count) / count

    def mean(x: np.ndarray) -> np.ndarray:
        known = np.isfinite(x)
        whole = np.interp(np.arange(x.size), np.flatnonzero(known), x[known])
        return np.convolve(np.pad(whole, (count - 1, 0), mode="edge"), kernel, mode="valid")

    return changed(sailed(), u_mps=mean, v_mps=mean)


def of_the_dvl(raw: RawTrial) -> CheckMade:
    """The check of its samples; the trial on the grid is that of the log as it was."""
    found = run_checks(Seen(raw, ingested()[0], BOAT))[0]
    return {c.name: c for c in found}["dvl_averaged"]


@pytest.mark.parametrize("count", [5, 10, 25])
def test_a_dvl_that_averages_is_told_with_its_delay(count):
    period = float(np.median(np.diff(sailed().sensors["dvl"].time_s)))
    made = of_the_dvl(averaged(count))
    assert made.outcome == "contradicts"
    assert f"averages over {count} samples" in made.message
    assert made.value == pytest.approx(0.5 * (count - 1) * period, rel=1e-3)
    assert f"time_offset_s = {-made.value:.2f}" in made.remedy


def test_a_short_average_and_copies_are_no_delay():
    assert of_the_dvl(sailed()).outcome == "agrees"
    long_boat = BOAT.model_copy(update={"hull": BOAT.hull.model_copy(update={"length_m": 60.0})})
    seen = Seen(averaged(10), ingested()[0], long_boat)
    assert averaging.dvl_averaged(seen).outcome == "agrees"
    dvl = sailed().sensors["dvl"]
    period = float(np.median(np.diff(dvl.time_s)))
    again = replace(
        dvl,
        time_s=np.repeat(dvl.time_s, 5) + np.tile(np.arange(5) * period / 5, dvl.time_s.size),
        values={c: np.repeat(x, 5) for c, x in dvl.values.items()},
    )
    assert of_the_dvl(replace(sailed(), sensors={**sailed().sensors, "dvl": again})).outcome == (
        "agrees"
    )


def test_velocities_from_the_track_and_coarse_ones_have_no_noise_to_tell_by():
    dvl = sailed().sensors["dvl"]
    derived = replace(dvl, not_logged={"u_mps": "derived"})
    coarse = replace(dvl, values={c: np.round(x) for c, x in dvl.values.items()})
    for sensor in (derived, coarse):
        raw = replace(sailed(), sensors={**sailed().sensors, "dvl": sensor})
        assert of_the_dvl(raw).outcome == "untested"


def test_without_position_the_drift_in_turns_tells_speed_from_rpm():
    absent = ("north_m", "east_m")
    fast = on_the_grid(*absent, **times(KNOTS, *VELOCITIES))
    assert fast["speed_scale"].outcome == "contradicts"
    assert fast["rpm_scale"].outcome == "agrees"
    geared = on_the_grid(*absent, **times(2.0, "rpm"))
    assert geared["rpm_scale"].outcome == "contradicts"
    assert geared["speed_scale"].outcome == "agrees"


@pytest.mark.parametrize("factor", [KNOTS, 1 / KNOTS])
def test_a_dvl_far_from_the_origin_does_not_put_the_blame_on_rpm(factor):
    dvl = BOAT.dvl.model_copy(update={"x_m": 0.3 * BOAT.hull.length_m})
    far = BOAT.model_copy(update={"dvl": dvl})
    table = ingested()[0].table.drop(columns=["north_m", "east_m"])
    moved = {"v_mps": table["v_mps"] + (far.dvl.x_m - BOAT.dvl.x_m) * table["r_radps"]}
    table = table.assign(**moved)
    table = table.assign(**{c: factor * table[c] for c in VELOCITIES if c in table})
    trial = ingested()[0].with_table(table)
    made = {c.name: c for c in run_checks(Seen(sailed(), trial, far))[0]}
    assert made["speed_scale"].outcome == "contradicts"


@pytest.mark.parametrize("other", ["p_radps", "q_radps"])
def test_axes_of_the_gyro_that_are_exchanged(other):
    table = ingested()[0].table
    table = table.assign(r_radps=table[other], **{other: table["r_radps"]})
    seen = Seen(sailed(), ingested()[0].with_table(table), BOAT)
    made = {c.name: c for c in run_checks(seen)[0]}["gyro_axes"]
    assert made.outcome == "contradicts"
    assert made.fix == mixed({"r_radps": (1.0, other), other: (1.0, "r_radps")})


def test_a_gyro_that_does_not_follow_the_heading():
    overflows = {"r_radps": lambda x: (x + 0.1) % 0.2 - 0.1}
    made = on_the_grid(**overflows)["gyro_axes"]
    assert made.outcome == "contradicts"
    assert "overflows" in made.message and not made.fix


def test_a_gyro_that_stands_still_does_not_follow_the_heading():
    made = on_the_grid(r_radps=lambda x: np.full_like(x, 0.01))["gyro_axes"]
    assert made.outcome == "contradicts" and made.value == 0.0


@pytest.mark.parametrize("column", OF_MOTION)
@pytest.mark.parametrize("value", [0.0, 0.1])
def test_a_channel_that_stands_still_corrects_no_other(column, value):
    made = rows(changed(sailed(), **{column: lambda x: np.full_like(x, value)}))
    assert {c.name: c.fix for c in made.values() if c.outcome == "contradicts"} == {}


@pytest.mark.parametrize(
    ("column", "name"), [("r_radps", "yaw_rate_unit"), ("rudder_rad", "rudder_unit")]
)
def test_what_is_not_connected_has_no_wrong_unit(column, name):
    found = on_the_grid(**times(0.0, column))[name]
    assert found.outcome == "contradicts" and "not connected" in found.message
    assert not found.fix


def test_a_wrong_sign_of_u_is_not_told_as_one_of_pitch():
    found = on_the_grid(**times(-1.0, "u_mps"))
    assert found["surge_sign"].fix and found["pitch_sign"].outcome == "untested"


@pytest.mark.parametrize("absent", [(), ("w_mps", "q_radps")])
def test_a_depth_that_is_negative_throughout_is_a_height_and_the_pitch_is_right(absent):
    """The trial is level: neither heave nor pitch rate tells which of them is wrong."""
    found = on_the_grid(*absent, **times(-1.0, "depth_m"))["pitch_sign"]
    assert found.outcome == "contradicts" and found.fix == scaled(-1.0, "depth_m")
    assert "looks like a height" in found.message


def test_without_turns_either_may_be_off():
    straight = times(1e-3, "r_radps", "rudder_rad") | times(2.0, "rpm")
    found = on_the_grid("north_m", "east_m", "heading_rad", "depth_m", **straight)
    assert found["speed_scale"].outcome == found["rpm_scale"].outcome == "contradicts"
    assert "or the rpm is off" in found["speed_scale"].message


def test_without_turns_and_positions_a_dive_tells_which():
    straight = times(1e-3, "r_radps", "rudder_rad") | times(2.0, "rpm")
    found = on_the_grid("north_m", "east_m", "heading_rad", **straight)
    assert found["speed_by_depth"].outcome == found["speed_scale"].outcome == "agrees"
    assert found["rpm_scale"].outcome == "contradicts"


# --- corrections --------------------------------------------------------------------------


def test_a_correction_is_applied_and_recorded():
    raw = changed(without(sailed(), "position"), **times(KNOTS, *VELOCITIES))
    done = ingest_fixed(raw, BOAT, ["speed_scale"])
    assert done.proposed == {"speed_scale"}
    assert set(done.quality.fixed) == {"speed_scale"}
    assert "fixed" in [f.code for f in done.quality.findings]
    assert not contradictions([done.quality])
    right = ingest(without(sailed(), "position"), BOAT)[0].table["u_mps"]
    np.testing.assert_allclose(done.trial.table["u_mps"], right, rtol=2e-5, atol=1e-6)


@pytest.mark.parametrize("offset", [-2 * DEG, 3 * DEG])
def test_an_offset_of_the_gyro_is_taken_off(offset):
    raw = changed(sailed(), r_radps=lambda x: x + offset)
    done = ingest_fixed(raw, BOAT, ["yaw_rate_offset"])
    assert set(done.quality.fixed) == {"yaw_rate_offset"}
    right = ingest(sailed(), BOAT)[0].table["r_radps"]
    np.testing.assert_allclose(done.trial.table["r_radps"], right, atol=0.05 * DEG)


def test_a_rudder_of_the_wrong_sign_is_refused_until_it_is_fixed(clean):
    raw = changed(sailed(), **times(-1.0, "rudder_rad"))
    with pytest.raises(InputError, match="--fix rudder_sign"):
        ingest_fixed(raw, BOAT)
    done = ingest_fixed(raw, BOAT, ["rudder_sign"])
    assert done.quality.fixed == {"rudder_sign": scaled(-1.0, "rudder_rad")}
    assert done.quality.checks == clean.checks


def test_a_correction_that_nothing_proposes_is_wrong_usage():
    done = ingest_fixed(without(sailed(), "position"), BOAT, ["rpm_scale"])
    assert not done.proposed and not done.quality.fixed
    with pytest.raises(UsageError, match="rpm_scale") as refused:
        refuse_unproposed(["rpm_scale"], done.proposed, [done.quality])
    assert refused.value.remedy.startswith("Leave it out")


def test_a_misspelt_correction_is_told_what_there_is():
    off = changed(sailed(), r_radps=lambda x: x + 3 * DEG)
    done = ingest_fixed(off, BOAT, ["yaw_rate_ofset"])
    with pytest.raises(UsageError) as refused:
        refuse_unproposed(["yaw_rate_ofset"], done.proposed, [done.quality])
    assert refused.value.remedy == "Of these logs they propose yaw_rate_offset."
    with pytest.raises(InputError, match="rudder_sgn names no correction; this one is rudder_sign"):
        ingest_fixed(changed(sailed(), **times(-1.0, "rudder_rad")), BOAT, ["rudder_sgn"])


def test_raw_trials_are_left_as_they_are():
    raw = sailed()
    before = pickle.dumps(raw)
    corrected(raw, scaled(2.0, "rpm"))
    assert pickle.dumps(raw) == before
