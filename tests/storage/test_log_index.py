"""Logs that pandas wrote with the time in an index that has no name."""

import numpy as np
import pandas as pd
import pytest
from log_world import sensor_tables, write_folder

from auvident.errors import InputError
from auvident.schema.logs import ColumnMap
from auvident.storage.log_inspect import inspect_log
from auvident.storage.logs import read_trials

STARTED_S = 1_714_564_800
INDICES = {
    "instants": lambda s: pd.DatetimeIndex(pd.to_datetime(STARTED_S + s, unit="s", utc=True)),
    "durations": lambda s: pd.TimedeltaIndex(pd.to_timedelta(s, unit="s")),
    "seconds": pd.Index,
}


def indexed(folder, ending, kind, **columns):
    folder.mkdir()
    for sensor, table in sensor_tables().items():
        own = table.drop(columns="time_s").assign(**columns)
        own.index = INDICES[kind](table["time_s"].to_numpy())
        if ending == "csv":
            own.to_csv(folder / f"{sensor}.csv")
        else:
            own.to_parquet(folder / f"{sensor}.parquet")
    return folder


def same_intervals(folder, tmp_path, column_map=None):
    (trial,) = read_trials([folder], column_map)
    (plain,) = read_trials([write_folder(tmp_path / "plain")])
    for sensor, other in plain.sensors.items():
        own = trial.sensors[sensor]
        np.testing.assert_allclose(np.diff(own.time_s), np.diff(other.time_s), atol=1e-6)
        for column, values in other.values.items():
            np.testing.assert_allclose(own.values[column], values)


@pytest.mark.parametrize(
    ("ending", "kind"),
    [("parquet", "instants"), ("parquet", "durations"), ("csv", "instants")],
)
def test_an_index_of_times_is_the_time(tmp_path, ending, kind):
    folder = indexed(tmp_path / "run", ending, kind)
    same_intervals(folder, tmp_path)
    assert inspect_log(folder).proposed_map == ""


@pytest.mark.parametrize(
    ("ending", "kind", "name"),
    [
        ("parquet", "seconds", "__index_level_0__"),
        ("csv", "seconds", "index"),
        ("csv", "durations", "index"),
    ],
)
def test_an_index_that_may_be_the_time_is_proposed(tmp_path, ending, kind, name):
    folder = indexed(tmp_path / "run", ending, kind)
    if kind == "seconds":
        with pytest.raises(InputError) as caught:
            read_trials([folder])
        assert f'time = "{name}"' in (caught.value.remedy or "")
        assert f'time = "{name}"' in inspect_log(folder).proposed_map
    tables = {sensor: {"time": name} for sensor in sensor_tables()}
    same_intervals(folder, tmp_path, ColumnMap.model_validate(tables))


@pytest.mark.parametrize("ending", ["parquet", "csv"])
def test_a_column_called_time_counts_before_an_index(tmp_path, ending):
    folder = tmp_path / "run"
    folder.mkdir()
    for sensor, table in sensor_tables().items():
        table.index = INDICES["instants"](table["time_s"].to_numpy() + 7.0)
        if ending == "csv":
            table.to_csv(folder / f"{sensor}.csv")
        else:
            table.to_parquet(folder / f"{sensor}.parquet")
    same_intervals(folder, tmp_path)
    (trial,) = read_trials([folder])
    assert {s.time_column for s in trial.sensors.values()} == {"time_s"}


def test_a_count_of_rows_is_no_time(tmp_path):
    folder = tmp_path / "run"
    folder.mkdir()
    for sensor, table in sensor_tables().items():
        table.to_csv(folder / f"{sensor}.csv")  # with the index 0, 1, 2
    same_intervals(folder, tmp_path)
    for sensor, table in sensor_tables().items():
        table.drop(columns="time_s").to_csv(folder / f"{sensor}.csv")
    with pytest.raises(InputError) as caught:
        read_trials([folder])
    assert "index" not in (caught.value.remedy or "")
