"""Times as other loggers write them: in two columns, as times of day, under a comment."""

import numpy as np
import pandas as pd
import pytest
from log_world import sensor_tables, wide_table, write_folder

from auvident.errors import InputError
from auvident.schema.logs import ColumnMap
from auvident.storage.log_inspect import inspect_log
from auvident.storage.logs import read_trials

STARTED_S = 1_714_564_800
TIMED = ("dvl", "gyro", "rudder", "rpm")


def retimed(folder, columns_of):
    """The small log with other columns in the place of its time."""
    tables = {}
    for sensor, table in sensor_tables().items():
        columns = columns_of(table["time_s"].to_numpy())
        tables[sensor] = pd.concat([pd.DataFrame(columns), table.drop(columns="time_s")], axis=1)
    return write_folder(folder, tables)


def in_parts(names):
    def columns(time_s):
        ns = np.rint(time_s * 1e3).astype(np.int64) * 10**6 + STARTED_S * 10**9
        return dict(zip(names, (ns // 10**9, ns % 10**9), strict=True))

    return columns


def mapped(time):
    return ColumnMap.model_validate({sensor: {"time": time} for sensor in TIMED})


@pytest.mark.parametrize(
    "names",
    [
        ("header.stamp.secs", "header.stamp.nsecs"),
        ("header.stamp.sec", "header.stamp.nanosec"),
        ("Sec", "NSec"),
    ],
)
def test_whole_seconds_take_the_nanoseconds_beside_them(tmp_path, names):
    folder = retimed(tmp_path / "run", in_parts(names))
    (trial,) = read_trials([folder], mapped(names[0]))
    (plain,) = read_trials([write_folder(tmp_path / "plain")])
    for sensor in TIMED:
        own, other = trial.sensors[sensor].time_s, plain.sensors[sensor].time_s
        np.testing.assert_allclose(np.diff(own), np.diff(other), atol=1e-6)
    report = inspect_log(folder)
    assert f'time = "{names[0]}"' in report.proposed_map
    assert max(file.rate_hz for file in report.files) == pytest.approx(20.0, rel=1e-3)


def test_seconds_with_a_fraction_stay_as_they_are(tmp_path):
    def columns(time_s):
        return {"sec": time_s, "nsec": np.zeros(time_s.size)}

    (trial,) = read_trials([retimed(tmp_path / "run", columns)], mapped("sec"))
    np.testing.assert_allclose(trial.sensors["dvl"].time_s, sensor_tables()["dvl"]["time_s"])


def test_times_of_day_count_on_past_midnight(tmp_path):
    def columns(time_s):
        day_s = (86400.0 - 115.0 + time_s) % 86400.0
        days = pd.Timestamp(0) + pd.to_timedelta(np.rint(day_s * 1e3), unit="ms")
        return {"timestamp": [day.strftime("%H:%M:%S.%f") for day in days]}

    (trial,) = read_trials([retimed(tmp_path / "run", columns)])
    own = trial.sensors["gyro"].time_s
    np.testing.assert_allclose(np.diff(own), 0.05, atol=1e-6)


def test_digits_of_a_clock_are_not_seconds(tmp_path):
    time_s = 80000.0 + np.arange(0.0, 300.0, 0.5)
    digits = 1e4 * (time_s // 3600) + 1e2 * (time_s % 3600 // 60) + time_s % 60
    wide = wide_table().iloc[:1].loc[np.zeros(time_s.size, dtype=int)].assign(time_s=digits)
    wide.to_csv(tmp_path / "wide.csv", index=False)
    with pytest.raises(InputError, match="hhmmss"):
        read_trials([tmp_path / "wide.csv"])


@pytest.mark.parametrize("mark", ["%", "# "])
def test_names_in_a_comment_right_above_the_data(tmp_path, mark):
    table = wide_table().rename(columns={"time_s": "time"})
    file = tmp_path / "wide.csv"
    file.write_text("# written by a logger\n" + mark + table.to_csv(index=False))
    (trial,) = read_trials([file], mapped("time"))
    np.testing.assert_allclose(trial.sensors["dvl"].time_s, table["time"])
    assert trial.sensors["dvl"].rows[0] == 3


def counted(per_second):
    def columns(time_s):
        return {"timestamp": np.rint(time_s * per_second).astype(np.int64)}

    return columns


@pytest.mark.parametrize(("unit", "per_second"), [("ms", 1e3), ("us", 1e6)])
def test_counts_since_switch_on_get_a_unit_proposed(tmp_path, unit, per_second):
    text = inspect_log(retimed(tmp_path / "run", counted(per_second))).proposed_map
    assert text.count(f'time_unit = "{unit}"') == len(TIMED)


@pytest.mark.parametrize(
    ("name", "per_second"), [("time_usec", 1e6), ("TimeUS", 1e6), ("time_boot_ms", 1e3)]
)
def test_names_of_counts_say_their_unit(tmp_path, name, per_second):
    def columns(time_s):
        return {name: np.rint(time_s * per_second).astype(np.int64)}

    folder = retimed(tmp_path / "run", columns)
    assert f'time = "{name}"\n' in inspect_log(folder).proposed_map
    (trial,) = read_trials([folder], mapped(name))
    np.testing.assert_allclose(trial.sensors["dvl"].time_s, sensor_tables()["dvl"]["time_s"])


@pytest.mark.parametrize("written", ["%d.%m.%Y %H:%M:%S.%f", "%Y/%m/%d %H:%M:%S.%f"])
def test_dates_that_can_be_read_one_way_only(tmp_path, written):
    def columns(time_s):
        days = pd.Timestamp(STARTED_S, unit="s") + pd.to_timedelta(time_s, unit="s")
        return {"timestamp": [day.strftime(written) for day in days]}

    (trial,) = read_trials([retimed(tmp_path / "run", columns)])
    assert trial.origin == "2024-05-01T12:01:40Z"


@pytest.mark.parametrize(
    ("names", "ns"), [(("tv_sec", "tv_usec"), 10**3), (("secs", "msecs"), 10**6)]
)
def test_microseconds_and_milliseconds_beside_whole_seconds(tmp_path, names, ns):
    def columns(time_s):
        whole, beyond = in_parts(("whole", "beyond"))(time_s).values()
        return dict(zip(names, (whole, beyond // ns), strict=True))

    folder = retimed(tmp_path / "run", columns)
    (trial,) = read_trials([folder], mapped(names[0]))
    steps = np.diff(sensor_tables()["dvl"]["time_s"])
    np.testing.assert_allclose(np.diff(trial.sensors["dvl"].time_s), steps, atol=1e-6)
    assert f'time = "{names[0]}"' in inspect_log(folder).proposed_map
