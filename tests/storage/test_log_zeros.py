"""Zeros that stand for no reading, in tables with a row for the reading of any sensor."""

import numpy as np
import pandas as pd
import pytest
from log_world import sensor_tables, write_folder

from auvident.storage.log_zeros import zeros_between
from auvident.storage.logs import read_trials


def of_any_sensor(fill):
    """The small log in one table, with what stands where a sensor has no reading."""
    wide = None
    for k, table in enumerate(sensor_tables().values()):
        own = table.assign(time_s=(table["time_s"] + 0.003 * k).round(3))  # never at one time
        wide = own if wide is None else wide.merge(own, on="time_s", how="outer")
    table = wide.sort_values("time_s")
    table.loc[table["time_s"].between(110.0, 115.0) & table["rudder_deg"].notna(), "rudder_deg"] = (
        0.0
    )
    return table.fillna(fill)


def read(path, table):
    table.to_csv(path, index=False)
    (trial,) = read_trials([path])
    return trial


def test_zeros_between_readings_are_read_as_empty_cells_are(tmp_path):
    zeros = read(tmp_path / "zeros.csv", of_any_sensor(0.0))
    empty = read(tmp_path / "empty.csv", of_any_sensor(np.nan))
    for sensor, column in (("dvl", "u_mps"), ("dvl", "v_mps"), ("gyro", "r_radps")):
        own, other = zeros.sensors[sensor], empty.sensors[sensor]
        known = other.values[column] != 0.0
        known &= np.isfinite(other.values[column])
        place = np.searchsorted(own.time_s, other.time_s[known])
        np.testing.assert_array_equal(own.time_s[place], other.time_s[known])
        np.testing.assert_array_equal(own.values[column][place], other.values[column][known])
    assert zeros.sensors["dvl"].time_s.size == len(sensor_tables()["dvl"])
    assert [f.code for f in zeros.findings] == ["zeros_for_empty"] * 4
    assert zeros.sensors["dvl"].dropped == {"zero_for_empty": len(of_any_sensor(0.0)) - 150}


def test_a_rudder_amidships_keeps_its_zeros_in_its_rhythm(tmp_path):
    own = read(tmp_path / "zeros.csv", of_any_sensor(0.0)).sensors["rudder"]
    amidships = (own.time_s > 110.5) & (own.time_s < 114.5)
    assert np.all(own.values["rudder_rad"][amidships] == 0.0)
    assert np.diff(own.time_s[amidships]).max() < 0.25  # readings come every 0.1 s
    assert np.diff(own.time_s).max() < 0.25


@pytest.mark.parametrize("share", [0.05, 0.1, 0.2, 0.5, 0.8])
def test_zeros_of_a_log_with_a_row_for_each_reading_are_left(share):
    """A coarse gyro, a lost bottom that comes and goes, a rudder in steps."""
    rng = np.random.default_rng(4)
    time = 0.2 * np.arange(3000)
    coarse = np.where(rng.random(3000) < share, 0.0, rng.normal(size=3000))
    assert not zeros_between(time, [coarse]).any()
    lost = np.where(
        np.sin(time / 20.0) > 1.0 - 2.0 * share, 0.0, 1.5 + 0.01 * rng.normal(size=3000)
    )
    assert not zeros_between(time, [lost, 0.1 * lost]).any()
    steps = 10.0 * np.repeat(rng.integers(-1, 2, 60), 50)
    assert not zeros_between(time, [steps]).any()


def test_the_small_log_has_none(tmp_path):
    (trial,) = read_trials([write_folder(tmp_path)])
    assert not trial.findings
    assert pd.Series([s.dropped for s in trial.sensors.values()]).map(len).sum() == 0
