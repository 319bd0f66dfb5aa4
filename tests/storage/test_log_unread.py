"""Columns under other names that hold what a trial can do without: told, not guessed."""

import numpy as np
import pandas as pd
import pytest
from log_world import sensor_tables, wide_table, write_folder

from auvident.schema.logs import ColumnMap
from auvident.storage.logs import read_trials

TIME_S = np.arange(100.0, 130.0, 0.1)


def told(path, column_map=None):
    (trial,) = read_trials([path], column_map)
    return [f.message for f in trial.findings if f.code == "columns_not_read"]


def attitude(**columns):
    wave = np.sin(TIME_S)
    return pd.DataFrame({"time_s": TIME_S, **{name: f * wave for name, f in columns.items()}})


def test_a_heading_under_another_name_is_told(tmp_path):
    table = attitude(roll_deg=1.0, pitch_deg=2.0, yaw_deg=90.0)
    folder = write_folder(tmp_path / "run", sensor_tables() | {"attitude": table})
    (message,) = told(folder)
    assert message.startswith("not read in attitude.csv") and "yaw_deg (heading" in message


def test_latitude_and_longitude_without_a_unit_are_told(tmp_path):
    table = wide_table().assign(lat=48.0, lon=11.0)
    table.to_csv(tmp_path / "run.csv", index=False)
    (message,) = told(tmp_path / "run.csv")
    assert "lat (position north), lon (position east)" in message
    chosen = ColumnMap.model_validate({"dvl": {"u": {"column": "u_mps", "unit": "mps"}}})
    assert told(tmp_path / "run.csv", chosen) == []  # whoever wrote a map has seen them


def test_columns_of_other_things_are_not_told(tmp_path):
    table = wide_table().assign(x=1.0, battery_v=24.0, mode="auto", ax=0.1, z=0.0)
    table.to_csv(tmp_path / "run.csv", index=False)
    assert told(tmp_path / "run.csv") == []
    assert told(write_folder(tmp_path / "folder")) == []


@pytest.mark.parametrize("base", ["q", "quat_", "orientation."])
def test_a_quaternion_is_told_with_what_to_write(tmp_path, base):
    table = wide_table().assign(**{f"{base}{axis}": 0.5 for axis in "wxyz"})
    table.to_csv(tmp_path / "run.csv", index=False)
    (message,) = told(tmp_path / "run.csv")
    assert f"{base.removesuffix('.')} (a quaternion: write roll_deg" in message
