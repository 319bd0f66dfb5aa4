"""A trial in the files of other loggers gives the channels that its CSV files give."""

import numpy as np
import pytest
from container_world import (
    DATAFLASH_MAP,
    ROS_MAP,
    ULOG_MAP,
    write_csv,
    write_dataflash,
    write_ros,
    write_ulog,
)

from auvident.schema.channels import BY_COLUMN
from auvident.storage.logs import read_column_map, read_trials

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


@pytest.fixture(params=FORMATS)
def foreign(request, tmp_path):
    """A file of the trial, and its map."""
    library, write, text = FORMATS[request.param]
    pytest.importorskip(library, reason=f"needs {library}")
    (tmp_path / "MAP.toml").write_text(text)
    return write(tmp_path), read_column_map(tmp_path / "MAP.toml")


def test_channels_are_those_of_the_csv_files(foreign, tmp_path):
    path, column_map = foreign
    (trial,) = read_trials([path], column_map)
    (plain,) = read_trials([write_csv(tmp_path / "plain")])
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
