"""A trial in the files of other loggers gives the channels that its CSV files give."""

import json

import numpy as np
import pytest
from container_world import (
    DATAFLASH_MAP,
    DEG,
    ROS_MAP,
    ULOG_MAP,
    tables,
    write_csv,
    write_dataflash,
    write_ros,
    write_ulog,
)

from auvident.schema.channels import BY_COLUMN
from auvident.storage.log_inspect import inspect_log
from auvident.storage.logs import read_column_map, read_trials
from tests.command_line import SAMPLES

FORMATS = {
    "bag": ("rosbags", lambda f: write_ros(f / "trial.bag"), ROS_MAP),
    "bag-bz2": ("rosbags", lambda f: write_ros(f / "trial.bag", "", "BZ2"), ROS_MAP),
    "db3": ("rosbags", lambda f: write_ros(f / "trial", "sqlite3"), ROS_MAP),
    "db3-zstd": ("rosbags", lambda f: write_ros(f / "trial", "sqlite3", "MESSAGE"), ROS_MAP),
    "mcap": ("rosbags", lambda f: write_ros(f / "trial", "mcap"), ROS_MAP),
    "mcap-zstd": ("rosbags", lambda f: write_ros(f / "trial", "mcap", "STORAGE"), ROS_MAP),
    "ulog": ("pyulog", lambda f: write_ulog(f / "trial.ulg"), ULOG_MAP),
    "dataflash": ("numpy", lambda f: write_dataflash(f / "trial.bin"), DATAFLASH_MAP),
}
ROUNDING = 1e-12  # of angles through quaternions and of conversions between degrees and radians


@pytest.fixture(scope="module", params=FORMATS)
def foreign(request, tmp_path_factory):
    """A file of the trial, and its map."""
    library, write, text = FORMATS[request.param]
    pytest.importorskip(library, reason=f"needs {library}")
    folder = tmp_path_factory.mktemp("foreign")
    (folder / "MAP.toml").write_text(text)
    return write(folder), read_column_map(folder / "MAP.toml")


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """The trial from its CSV files."""
    (trial,) = read_trials([write_csv(tmp_path_factory.mktemp("plain") / "trial")])
    return trial


def test_channels_are_those_of_the_csv_files(foreign, plain):
    (trial,) = read_trials([foreign[0]], foreign[1])
    assert_same(trial, plain)


def assert_same(trial, plain):
    """Two trials have the same channels at the same times, from whichever whole second."""
    assert trial.sensors.keys() == plain.sensors.keys()
    whole = round(plain.sensors["gyro"].time_s[0] - trial.sensors["gyro"].time_s[0])
    for name, sensor in plain.sensors.items():
        other = trial.sensors[name]
        np.testing.assert_allclose(other.time_s + whole, sensor.time_s, rtol=0, atol=1e-9)
        assert other.values.keys() == sensor.values.keys()
        for column, values in sensor.values.items():
            off = other.values[column] - values
            if BY_COLUMN[column].is_angle:
                off = (off + np.pi) % (2 * np.pi) - np.pi
            same = np.where(np.isnan(values), np.nan, 0.0)
            np.testing.assert_allclose(off, same, rtol=0, atol=ROUNDING, err_msg=column)


def test_the_map_that_inspect_proposes_reads_it(foreign, plain, tmp_path):
    path, column_map = foreign
    report = inspect_log(path)
    assert report.unassigned == ()
    (tmp_path / "MAP.toml").write_text(report.proposed_map)
    (trial,) = read_trials([path], read_column_map(tmp_path / "MAP.toml"))
    assert_same(trial, plain)
    (gyro,) = [f for f in report.files if f.file.endswith(f"topic {column_map.of('gyro').topic}")]
    name = column_map.of("gyro").entries()["r"].column
    (rate,) = [c for c in gyro.columns if c.name == name]
    assert gyro.rate_hz == pytest.approx(50.0, rel=1e-3)
    assert gyro.rows == len(tables()["gyro"])
    largest = tables()["gyro"]["r_degps"].abs().max() * DEG
    assert max(-rate.minimum, rate.maximum) == pytest.approx(largest)


def test_from_the_recording_to_the_ingested_trial(tmp_path, auvident):
    path, run, named = (
        write_dataflash(tmp_path / "night.bin"),
        tmp_path / "run",
        tmp_path / "m.toml",
    )
    assert auvident("inspect", path, "--output", named).code == 0
    vehicle = SAMPLES / "remus100.toml"
    without = auvident("ingest", path, "--vehicle", vehicle, "--run", run)
    assert without.code == 3
    assert "auvident inspect" in without.err
    called = auvident("ingest", path, "--vehicle", vehicle, "--run", run, "--map", named)
    assert called.code == 0, called.err
    (trial,) = json.loads((run / "ingest" / "quality.json").read_text())["trials"]
    assert trial["trial"] == "night"
    files = {sensor["sensor"]: sensor["file"] for sensor in trial["sensors"]}
    assert files["gyro"] == f"{path.parent.name}/night.bin, topic IMU[1]"
