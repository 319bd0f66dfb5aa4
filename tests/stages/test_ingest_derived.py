"""Velocities and yaw rate from position and heading, against the DVL and gyro left out.

The truth is what the independent generator's DVL (0.005 m/s) and gyro (0.05 deg/s) read.
"""

from dataclasses import replace

import numpy as np
import pytest
from pyarrow import parquet

from auvident.errors import InputError
from auvident.schema.logs import Derive
from auvident.stages.identify.setup import sensing_of
from auvident.stages.ingest import ingest, stated_noise_for
from auvident.stages.ingest.derived import with_derived
from auvident.storage.logs import read_trials
from auvident.storage.vehicle_file import load_vehicle
from tests.command_line import SAMPLES
from tests.session import once
from tests.stages.ingest_world import maneuvers, sensor, vehicle, with_sensor

ALL = Derive(u=True, v=True, r=True)
COLUMNS = ("u_mps", "v_mps", "r_radps")


def without(raw, *names):
    return replace(raw, sensors={k: s for k, s in raw.sensors.items() if k not in names})


@once
def harbour_both_ways():
    """The harbour trial as it is, and with u, v and r from position and heading alone."""
    remus = load_vehicle(SAMPLES / "remus100.toml")
    (raw,) = read_trials([SAMPLES / "harbour_trial"])
    poor = replace(without(raw, "dvl", "gyro"), derive=ALL)
    measured, _ = ingest(raw, remus)
    derived, quality = ingest(poor, remus)
    both = measured.table.set_index(np.round(10 * measured.table["time_s"]).astype(int)).join(
        derived.table.set_index(np.round(10 * derived.table["time_s"]).astype(int)),
        how="inner",
        suffixes=("", "_derived"),
    )
    known = (both["record"] >= 0) & (both["record_derived"] >= 0)
    return both[known & both["dvl_sampled_derived"]], quality


@pytest.fixture(scope="module")
def harbour():
    return harbour_both_ways()


def test_errors_are_as_large_as_claimed(harbour):
    """Over all between 0.8 and 1.3 of what is claimed; none above what counts."""
    both, quality = harbour
    told = quality.checks["derived"]
    errors = {c: float(np.sqrt(np.mean((both[f"{c}_derived"] - both[c]) ** 2))) for c in COLUMNS}
    ratios = np.array([errors[c] / told[c]["std"] for c in COLUMNS])
    assert 0.8 < np.sqrt(np.mean(ratios**2)) < 1.3
    assert np.all((ratios > 0.6) & (ratios < 1.4)), ratios
    assert all(errors[c] < told[c]["std_counted"] for c in COLUMNS)
    assert errors["u_mps"] < 0.05
    assert errors["r_radps"] < 0.008


def test_nothing_is_off_on_the_whole(harbour):
    both, quality = harbour
    for column in COLUMNS:
        off = float(np.mean(both[f"{column}_derived"] - both[column]))
        assert abs(off) < 0.1 * quality.checks["derived"][column]["std"]


def test_noise_of_the_sensors_is_found(harbour):
    _, quality = harbour
    told = quality.checks["derived"]
    assert told["position_noise_m"] == pytest.approx(0.3, rel=0.1)
    assert told["heading_noise_rad"] == pytest.approx(np.deg2rad(0.3), rel=0.05)


def test_what_is_derived_is_marked(harbour):
    _, quality = harbour
    marked = {
        c.column: (c.source, c.noise_std)
        for s in quality.sensors
        for c in s.channels
        if c.source != "logged"
    }
    told = quality.checks["derived"]
    assert marked == {c: ("derived", told[c]["std_counted"]) for c in COLUMNS}
    (said,) = [f for f in quality.findings if f.code == "derived_channels"]
    assert "correlated" in said.message
    remus = load_vehicle(SAMPLES / "remus100.toml")
    kept = stated_noise_for(remus, [quality])
    assert kept.dvl.x_m == remus.dvl.x_m
    noise = {c.column: c.noise_std for s in quality.sensors for c in s.channels if c.noise_std}
    counted = sensing_of(kept, noise, "horizontal").noise_std
    assert {c: counted[c] for c in COLUMNS} == {c: told[c]["std_counted"] for c in COLUMNS}


def straight_circle(std_m=0.05, arm=(0.0, 0.0)):
    """Circles at 2 m/s and 0.2 rad/s; the position is taken at an arm from the origin."""
    rng = np.random.default_rng(3)
    t = np.arange(0.0, 100.0, 0.25)
    psi = 0.3 + 0.2 * t
    r, u, v = 0.2, 2.0, -0.15
    at = u - arm[1] * r, v + arm[0] * r
    north = (at[0] * np.sin(psi) + at[1] * np.cos(psi)) / r
    east = (-at[0] * np.cos(psi) + at[1] * np.sin(psi)) / r
    fix = std_m * rng.standard_normal((2, t.size))
    raw = maneuvers(duration_s=100.0)
    raw = with_sensor(raw, sensor("position", t, north_m=north + fix[0], east_m=east + fix[1]))
    heading = np.mod(psi + 0.005 * rng.standard_normal(t.size), 2 * np.pi)
    raw = with_sensor(raw, sensor("attitude", t, heading_rad=heading))
    return without(raw, "dvl", "gyro"), (u, v, r)


def test_velocities_are_those_at_the_dvl_from_an_antenna_elsewhere():
    raw, (u, v, r) = straight_circle(arm=(-0.5, 0.3))
    own = vehicle(dvl={"x_m": 0.4, "y_m": -0.1, "mounting_yaw_deg": 30.0})
    raw = replace(raw, derive=Derive(u=True, v=True, r=True, x_m=-0.5, y_m=0.3))
    found, _ = with_derived(raw, own, 10.0, 5.0)
    turn, at = np.deg2rad(30.0), (u + 0.1 * r, v + 0.4 * r)
    expected = at[0] * np.cos(turn) + at[1] * np.sin(turn)
    aside = -at[0] * np.sin(turn) + at[1] * np.cos(turn)
    dvl = found.sensors["dvl"].values
    assert np.median(dvl["u_mps"]) == pytest.approx(expected, abs=0.005)
    assert np.median(dvl["v_mps"]) == pytest.approx(aside, abs=0.005)
    assert np.median(found.sensors["gyro"].values["r_radps"]) == pytest.approx(r, abs=0.001)


@pytest.mark.parametrize("where", [{"x_m": 1e300}, {"y_m": -40.0}])
def test_an_antenna_that_is_not_on_the_vehicle_is_refused(where):
    raw = replace(straight_circle()[0], derive=Derive(u=True, v=True, r=True, **where))
    with pytest.raises(InputError, match="the position is taken") as told:
        with_derived(raw, vehicle(), 10.0, 5.0)
    assert "[derive] x_m" in told.value.where


def test_a_gap_stays_a_gap():
    raw, (u, _, _) = straight_circle()
    position = raw.sensors["position"]
    keep = (position.time_s < 40.0) | (position.time_s > 60.0)
    raw = with_sensor(
        raw,
        replace(
            position,
            time_s=position.time_s[keep],
            rows=position.rows[keep],
            values={c: x[keep] for c, x in position.values.items()},
        ),
    )
    found, _ = with_derived(replace(raw, derive=ALL), vehicle(), 10.0, 5.0)
    dvl = found.sensors["dvl"]
    known = dvl.time_s[np.isfinite(dvl.values["u_mps"])]
    assert not np.any((known > 40.0) & (known < 60.0))
    assert np.nanmax(np.abs(dvl.values["u_mps"] - u)) < 0.2


def test_copies_of_a_held_fix_count_once():
    raw, (u, _, _) = straight_circle()
    position = raw.sensors["position"]
    held = {c: np.repeat(x[::5], 5) for c, x in position.values.items()}
    raw = replace(with_sensor(raw, replace(position, values=held)), derive=ALL)
    found, facts = with_derived(raw, vehicle(), 10.0, 5.0)
    assert facts["derived"]["position_noise_m"] == pytest.approx(0.05, rel=0.3)
    assert np.nanmedian(found.sensors["dvl"].values["u_mps"]) == pytest.approx(u, abs=0.02)


def test_a_logged_speed_stays_beside_a_derived_drift():
    raw, (_, v, _) = straight_circle()
    t = np.arange(1.0, 99.0, 0.5)
    raw = with_sensor(raw, sensor("dvl", t, u_mps=np.full(t.size, 7.0)))
    found, _ = with_derived(replace(raw, derive=Derive(v=True, r=True)), vehicle(), 10.0, 5.0)
    dvl = found.sensors["dvl"]
    assert np.all(dvl.values["u_mps"] == 7.0)
    assert dvl.not_logged == {"v_mps": "derived"}
    assert np.nanmedian(dvl.values["v_mps"]) == pytest.approx(v, abs=0.02)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda raw: without(raw, "attitude"), ("heading_rad", "[derive]")),
        (lambda raw: without(raw, "position"), ("north_m", "not in the log")),
        (
            lambda raw: with_sensor(
                raw, sensor("position", [0.0, 1.0], north_m=[0.0, 1.0], east_m=[0.0, 0.0])
            ),
            ("at least 20", "found 2"),
        ),
    ],
)
def test_without_what_it_takes_it_is_refused(change, words):
    raw, _ = straight_circle()
    with pytest.raises(InputError) as caught:
        ingest(replace(change(raw), derive=ALL), vehicle())
    for word in words:
        assert word in str(caught.value)


def test_velocities_through_water_are_not_derived():
    raw, _ = straight_circle()
    with pytest.raises(InputError, match="over ground"):
        ingest(replace(raw, derive=ALL), vehicle(dvl={"reference": "water"}))


def test_the_table_and_the_list_of_sensors_say_what_was_derived(tmp_path, auvident):
    """Through the program: map, metadata of the file, and what is printed."""
    folder = tmp_path / "harbour"
    folder.mkdir()
    for name in ("rudder", "attitude", "position"):
        lines = (SAMPLES / "harbour_trial" / f"{name}.csv").read_text().splitlines()
        (folder / f"{name}.csv").write_text("\n".join(lines[: len(lines) // 5]) + "\n")
    text = "[derive]\nu = true\nv = true\nr = true\n[rpm]\nrpm = { constant = 1200 }\n"
    (tmp_path / "map.toml").write_text(text)
    options = ("--vehicle", SAMPLES / "remus100.toml", "--map", tmp_path / "map.toml")
    done = auvident("ingest", folder, *options, "--run", tmp_path / "run")
    assert done.code == 0, done.err
    for words in (
        "dvl (derived)",
        "gyro (derived)",
        "rpm (constant)",
        "thrust and drag cannot be separated",
    ):
        assert words in " ".join(done.err.split()), words
    about = parquet.read_schema(tmp_path / "run" / "ingest" / "harbour.parquet").metadata
    assert about[b"not_logged"] == (
        b"u_mps: derived, v_mps: derived, r_radps: derived, rpm: constant"
    )
