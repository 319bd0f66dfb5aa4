"""Instants without a time zone beside others with one."""

import pandas as pd
import pytest
from log_world import sensor_tables

from auvident.errors import InputError
from auvident.storage.logs import read_trials

EPOCH = pd.Timestamp("2024-05-01T12:00:00", tz="UTC")


def written(folder, local=("gyro",), hours=2.0, as_text=False, zone="Europe/Berlin"):
    """A trial whose sensors have a zone, but some, which were written in local time."""
    folder.mkdir()
    for sensor, table in sensor_tables().items():
        time = EPOCH + pd.to_timedelta(table.pop("time_s"), unit="s")
        if sensor in local:
            time = (time + pd.Timedelta(hours=hours)).dt.tz_localize(None)
        else:
            time = time.dt.tz_convert(zone)
        if as_text:
            table["timestamp"] = time.map(pd.Timestamp.isoformat)
            table.to_csv(folder / f"{sensor}.csv", index=False)
        else:
            table.assign(timestamp=time).to_parquet(folder / f"{sensor}.parquet")
    return folder


@pytest.mark.parametrize("as_text", [False, True])
@pytest.mark.parametrize("zone", ["UTC", "Europe/Berlin"])
def test_a_file_without_a_zone_beside_others_with_one_is_named(tmp_path, as_text, zone):
    folder = written(tmp_path / "run", as_text=as_text, zone=zone)
    with pytest.raises(InputError, match="never overlap in time") as caught:
        read_trials([folder])
    file = folder / f"gyro.{'csv' if as_text else 'parquet'}"
    assert f"{file} have no time zone and are taken for UTC" in caught.value.remedy
    assert "time_offset_s" in caught.value.remedy
    assert f"{file} 72" in caught.value.problem


def test_sensors_that_overlap_are_read_with_and_without_a_zone(tmp_path):
    (trial,) = read_trials([written(tmp_path / "run", hours=0.0)])
    assert trial.sensors["gyro"].time_s[0] == trial.sensors["dvl"].time_s[0]


def test_where_none_has_a_zone_the_clocks_are_told_of_later(tmp_path):
    every = ("dvl", "gyro", "rudder", "rpm")
    folder = written(tmp_path / "run", local=every, hours=0.0)
    table = pd.read_parquet(folder / "gyro.parquet")
    table["timestamp"] += pd.Timedelta(hours=2)
    table.to_parquet(folder / "gyro.parquet")
    assert len(read_trials([folder])) == 1


def test_a_command_that_is_written_on_change_goes_on(tmp_path):
    folder = written(tmp_path / "run", local=("rpm",), hours=-1.0)
    table = pd.read_parquet(folder / "rpm.parquet").iloc[:1]
    table.to_parquet(folder / "rpm.parquet")
    assert len(read_trials([folder])) == 1
