"""Roll at a DVL below the axis: the generator's vehicles roll, and its DVL has a height."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from ingest_world import calm, sensor, vehicle, with_sensor

from auvident.stages.ingest import ingest
from auvident.storage.logs import read_trials
from auvident.storage.vehicle_file import load_vehicle
from tests.engines.chain import SAMPLES

if str(SAMPLES) not in sys.path:
    sys.path.insert(0, str(SAMPLES))

HEIGHT_M = 0.4  # of a DVL in a keel
MANEUVERS = {"straights": 1, "turns": 1, "zigzags_10": 1, "zigzags_20": 1}


@pytest.fixture(scope="module")
def sailed(tmp_path_factory):
    """Log folder of a Tern with a deep keel, and its true states, with their times."""
    from seatrial.logs import write_logs
    from seatrial.sensors import measure_all
    from seatrial.simulate import STEP_S
    from seatrial.trial import sail, stream
    from seatrial.vehicles import load_vehicle as plant_of

    own = plant_of("tern180")
    own = replace(own, plant=replace(own.plant, dvl_z=HEIGHT_M))
    record, *_ = sail({"name": "keel", "seed": 6, "schedule": MANEUVERS}, own, {})
    folder = tmp_path_factory.mktemp("keel")
    measured = measure_all(record, own, {}, lambda name: stream(6, name))
    write_logs(measured, own.file["signs"], 0.0, folder, lambda n: stream(6, n), "none")
    return folder, STEP_S * np.arange(len(record)), record


def ingested(folder, **dvl):
    tern = load_vehicle(SAMPLES / "tern180.toml")
    tern = tern.model_copy(update={"dvl": tern.dvl.model_copy(update=dvl)})
    [raw] = read_trials([folder])
    return ingest(raw, tern)


def aside_error(trial, time, record, dvl_x_m):
    """RMS error of the readings aside against v + x r of the truth, m/s."""
    table = trial.table[trial.table["dvl_sampled"]]
    true = np.interp(table["time_s"], time, record[:, 1] + dvl_x_m * record[:, 5])
    return float(np.sqrt(np.nanmean((table["v_mps"] - true) ** 2)))


def test_height_and_roll_rate_leave_the_sway_of_the_axis(sailed):
    folder, time, record = sailed
    x = load_vehicle(SAMPLES / "tern180.toml").dvl.x_m
    plain, none = ingested(folder)
    found, done = ingested(folder, z_m=HEIGHT_M)
    rolling = HEIGHT_M * float(np.std(record[:, 3]))
    assert aside_error(plain, time, record, x) > 0.8 * rolling > 0.01
    # what remains is the noise of the DVL, 5 mm/s, and of the interpolation onto the rows
    assert aside_error(found, time, record, x) < 0.4 * aside_error(plain, time, record, x)
    [line] = [f for f in done.findings if f.code == "dvl_roll_removed"]
    assert "0.4 m below the origin" in line.message
    # at five readings a second the largest of the roll rates may be missed
    assert rolling < line.value < 1.05 * HEIGHT_M * np.abs(record[:, 3]).max()
    assert "dvl_roll_removed" not in {f.code for f in none.findings}
    assert np.array_equal(found.table["u_mps"], plain.table["u_mps"], equal_nan=True)


def rolling(yaw_deg=0.0, **dvl):
    """A straight run on which only roll moves, and the vehicle whose DVL reads it."""
    raw = calm(duration_s=60.0)
    log, t = raw.sensors["dvl"], raw.sensors["dvl"].time_s
    roll_rate, yaw = 0.3 * np.sin(2.0 * t), np.radians(yaw_deg)
    aside = -0.2 * roll_rate
    values = {"u_mps": log.values["u_mps"] + np.sin(yaw) * aside}
    values["v_mps"] = log.values["v_mps"] + np.cos(yaw) * aside
    raw = with_sensor(raw, sensor("dvl", t, **values))
    gyro = sensor("gyro", t, r_radps=raw.sensors["gyro"].values["r_radps"], p_radps=roll_rate)
    own = vehicle(dvl={"z_m": 0.2, "mounting_yaw_deg": yaw_deg, **dvl})
    return with_sensor(raw, gyro), own, log


@pytest.mark.parametrize("yaw_deg", [0.0, 10.0, -90.0])
def test_turned_dvl_reads_roll_in_its_own_axes(yaw_deg):
    raw, own, still = rolling(yaw_deg)
    table = ingest(raw, own)[0].table
    inside = slice(1, -1)
    for column in ("u_mps", "v_mps"):
        expected = np.interp(table["time_s"], still.time_s, still.values[column])
        assert table[column].to_numpy()[inside] == pytest.approx(expected[inside], abs=1e-9)


def test_nothing_is_said_or_done_without_roll_rate_or_height():
    raw, own, _ = rolling()
    gyro = raw.sensors["gyro"]
    silent = with_sensor(raw, sensor("gyro", gyro.time_s, r_radps=gyro.values["r_radps"]))
    for log, made in ((silent, own), (raw, vehicle())):
        trial, quality = ingest(log, made)
        assert "dvl_roll_removed" not in {f.code for f in quality.findings}
        v = trial.table["v_mps"].to_numpy()
        read = raw.sensors["dvl"]
        assert v == pytest.approx(
            np.interp(trial.table["time_s"], read.time_s, read.values["v_mps"])
        )


def test_readings_in_a_gap_of_the_roll_rate_stay_as_logged():
    raw, own, still = rolling()
    gyro = raw.sensors["gyro"]
    keep = (gyro.time_s < 20.0) | (gyro.time_s > 40.0)
    other = {"p_radps": np.where(keep, gyro.values["p_radps"], np.nan)}
    log = with_sensor(raw, sensor("gyro", gyro.time_s, **{**gyro.values, **other}))
    trial, quality = ingest(log, own)
    [line] = [f for f in quality.findings if f.code == "dvl_roll_removed"]
    assert "without a roll rate are as logged" in line.message
    t, v = trial.table["time_s"].to_numpy(), trial.table["v_mps"].to_numpy()
    read = raw.sensors["dvl"]
    within, away = (t > 21.0) & (t < 39.0), (t < 19.0) | (t > 41.0)
    logged = np.interp(t, read.time_s, read.values["v_mps"])
    assert v[within] == pytest.approx(logged[within], abs=1e-9)
    expected = np.interp(t, still.time_s, still.values["v_mps"])
    assert v[away] == pytest.approx(expected[away], abs=1e-9)


def test_a_sway_that_never_changes_is_told_and_not_made_to_move():
    raw, own, _ = rolling()
    dvl = raw.sensors["dvl"]
    stuck = sensor("dvl", dvl.time_s, **{**dvl.values, "v_mps": np.full(dvl.time_s.size, 0.02)})
    trial, quality = ingest(with_sensor(raw, stuck), own)
    assert "constant_channel" in {f.code for f in quality.findings}
    assert set(trial.table["v_mps"].dropna()) == {0.02}
