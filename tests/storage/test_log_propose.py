"""Maps that `inspect` proposes from values: knots by the position, files named after a sensor."""

import re

import numpy as np
import pandas as pd
import pytest
from log_world import sensor_tables, wide_table, write_folder

from auvident.errors import InputError
from auvident.storage.log_inspect import inspect_log
from auvident.storage.logs import read_column_map, read_trials
from tests import foreign_log

KNOT = 1852.0 / 3600.0  # m/s


def tracked(scale, current_mps=0.0):
    """A vehicle on a wide circle for ten minutes: velocity in units of 1/`scale` m/s, position."""
    t = np.arange(0.0, 600.0, 0.2)
    heading = 2 * np.pi * t / 300.0
    north, east = (np.cumsum(1.6 * f(heading) * 0.2) for f in (np.cos, np.sin))
    tables = sensor_tables(0.0)
    tables["dvl"] = pd.DataFrame({"t": t, "surge": 1.6 / scale, "sway": 0.02 * np.sin(t)})
    fixes = {"t": t[::5], "x": north[::5] + current_mps * t[::5], "y": east[::5]}
    return tables | {"position": pd.DataFrame(fixes)}


@pytest.mark.parametrize(
    ("scale", "current_mps", "unit"),
    [
        (1.0, 0.0, "mps"),
        (KNOT, 0.0, "kn"),
        (KNOT, 0.15, "kn"),
        (1.0, 0.3, "mps"),
        (0.8, 0.0, "mps"),
    ],
)
def test_a_speed_twice_that_of_the_position_is_in_knots(tmp_path, scale, current_mps, unit):
    folder = write_folder(tmp_path / "run", tracked(scale, current_mps))
    text = inspect_log(folder).proposed_map
    for column in ("surge", "sway"):
        assert f'{{ column = "{column}", unit = "{unit}" }}' in text
    assert ("knots" in text) == (unit == "kn")


def test_a_column_called_value_has_the_name_of_its_file(tmp_path):
    tables = sensor_tables(0.0)
    names = {"dvl": ["t", "u", "v"], "gyro": ["t", "r"], "rudder": ["t", "angle"]}
    for sensor, columns in (names | {"rpm": ["t", "value"]}).items():
        tables[sensor].columns = columns
    rpm = tables.pop("rpm").assign(state="running")
    folder = write_folder(tmp_path / "run", tables)
    rpm.to_csv(folder / "Rpm.csv", index=False)
    report = inspect_log(folder)
    assert report.unassigned == ()
    (tmp_path / "MAP.toml").write_text(report.proposed_map)
    (trial,) = read_trials([folder], read_column_map(tmp_path / "MAP.toml"))
    assert set(trial.sensors["rpm"].values["rpm"]) == {1200.0}
    assert np.abs(trial.sensors["rudder"].values["rudder_rad"]).max() == pytest.approx(
        np.radians(10)
    )


def test_milliseconds_since_1970(tmp_path):
    tables = sensor_tables(0.0)
    for table in tables.values():
        stamps = 1_700_000_000_000 + np.rint(table["time_s"] * 1e3).astype(np.int64)
        table.insert(0, "clock", stamps)
        del table["time_s"]
    folder = write_folder(tmp_path / "run", tables)
    report = inspect_log(folder)
    assert 'time_unit = "ms"' in report.proposed_map
    (tmp_path / "MAP.toml").write_text(report.proposed_map)
    (trial,) = read_trials([folder], read_column_map(tmp_path / "MAP.toml"))
    assert trial.origin == "2023-11-14T22:13:20Z"
    assert trial.sensors["gyro"].time_s[1] == pytest.approx(0.05, abs=2.5e-7)  # floats


def test_a_name_of_another_quantity_is_not_taken_for_a_misspelt_one(tmp_path):
    tables = sensor_tables(0.0)
    tables["rudder"]["rudder_command"] = 30.0
    tables["rudder"]["delta"] = np.radians(tables["rudder"].pop("rudder_deg"))
    tables["rudder"]["rudder"] = np.degrees(tables["rudder"]["delta"])
    text = inspect_log(write_folder(tmp_path / "run", tables)).proposed_map
    assert 'rudder = { column = "rudder", unit = "deg" }' in text
    assert "[elevator]" not in text


@pytest.mark.parametrize("name", ["IMU Yaw Rate [deg/s]", "ahrs.yaw_rate_degps", "INS-Turn Rate"])
def test_a_yaw_rate_with_its_instrument_before_it_is_recognised(tmp_path, name):
    """Beside a pitch rate and a roll rate, which are not taken for it."""
    tables = sensor_tables()
    rate = tables["gyro"].pop("r_degps")
    for other in ("IMU Roll Rate", "IMU Pitch Rate"):
        tables["gyro"][f"{other} [deg/s]"] = 0.1 * rate
    tables["gyro"][name] = rate
    (trial,) = read_as_proposed(write_folder(tmp_path / "run", tables), tmp_path)
    found = trial.sensors["gyro"].values
    np.testing.assert_allclose(found["r_radps"], np.radians(rate))
    np.testing.assert_allclose(found["q_radps"], 0.1 * np.radians(rate))


def test_needed_channels_without_a_column_are_lines_to_be_finished(tmp_path) -> None:
    """Taken out of their comments, with the columns named, the map reads the log."""
    foreign_log.write(tmp_path / "trial.csv")
    report = inspect_log(tmp_path / "trial.csv")
    assert report.unassigned == ("u_mps", "v_mps", "rpm")
    recognised, _, missing = report.proposed_map.partition("# No column was recognised for ")
    head, *lines = missing.splitlines()
    assert head.startswith("u_mps, v_mps, rpm.")
    named = iter(["Log fwd", "Log stbd", "Motor"])
    finished = [
        re.sub(r"\?", lambda _: next(named), line.removeprefix("# ")).replace("mps", "kn")
        for line in lines[: lines.index("")]
    ]
    (tmp_path / "map.toml").write_text(recognised + "\n".join(finished))
    (trial,) = read_trials([tmp_path / "trial.csv"], read_column_map(tmp_path / "map.toml"))
    assert {"u_mps", "v_mps"} <= trial.sensors["dvl"].values.keys()
    assert np.nanmax(trial.sensors["rpm"].values["rpm"]) == 1170.0


def test_the_file_and_the_clock_of_a_sensor_without_a_column_are_asked_for(tmp_path):
    tables = sensor_tables(0.0)
    tables["motor"] = tables.pop("rpm").rename(columns={"rpm": "Motor"})
    tables["motor"]["Motor"] = 0.0  # of which nothing can be guessed
    tables["dvl"] = tables["dvl"].rename(columns={"u_mps": "vx", "v_mps": "vy"})
    text = inspect_log(write_folder(tmp_path / "run", tables)).proposed_map
    missing = text.partition("# No column was recognised for rpm.")[2]
    asked = [line.removeprefix("# ") for line in missing.splitlines()[1:] if line]
    time = next(c for c in tables["motor"] if c.startswith("time"))
    assert asked == [
        "[rpm]",
        'file = "?"',
        f'time = "{time}"',
        'rpm = { column = "?", unit = "rpm" }',
    ]


@pytest.mark.parametrize("name", ["ok", "Bottom_Lock"])
def test_a_column_that_marks_lost_bottom_is_proposed_as_valid(tmp_path, name):
    tables = sensor_tables(0.0)
    lost = np.arange(len(tables["dvl"])) % 7 == 3
    tables["dvl"] = tables["dvl"].rename(columns={"u_mps": "vx", "v_mps": "vy"})
    tables["dvl"][name] = (~lost).astype(int)
    text = inspect_log(write_folder(tmp_path / "run", tables)).proposed_map
    assert f'valid = "{name}"' in text
    tables["dvl"][name] = np.arange(len(lost)) % 5  # a count of beams
    text = inspect_log(write_folder(tmp_path / "other", tables)).proposed_map
    assert "valid" not in text


def test_a_mark_of_lost_bottom_under_another_name_is_not_passed_over(tmp_path):
    """Where all else has the program's names: no map was proposed, and nothing told of it."""
    tables = sensor_tables()
    lost = np.arange(len(tables["dvl"])) % 7 == 3
    tables["dvl"]["bt_valid"] = (~lost).astype(int)
    folder = write_folder(tmp_path / "run", tables)
    (plain,) = read_trials([folder])
    assert [f.code for f in plain.findings] == ["columns_not_read"]
    assert "bt_valid (which readings of the DVL are valid)" in plain.findings[0].message
    (trial,) = read_as_proposed(folder, tmp_path)
    assert trial.sensors["dvl"].dropped == {"marked_invalid": int(lost.sum())}
    assert not trial.findings
    tables["dvl"] = tables["dvl"].rename(columns={"bt_valid": "valid"})
    folder = write_folder(tmp_path / "own", tables)
    assert inspect_log(folder).proposed_map == ""
    assert not read_trials([folder])[0].findings


def test_an_input_that_may_be_written_on_change_is_proposed_so(tmp_path):
    columns = {"dvl": "u_mps,v_mps", "gyro": "r_degps", "rudder": "rudder_deg"}
    for name, heads in columns.items():
        values = ",".join(["1.5"] * len(heads.split(",")))
        rows = "".join(f"{k / 5},{values}\n" for k in range(3000))
        (tmp_path / f"{name}.csv").write_text(f"time_s,{heads}\n{rows}")
    times = (1, 21, 81, 116, 196, 221, 266, 356, 386, 456, 496, 551, 579)
    rows = "".join(f"{t},{600 + 100 * (k % 3)}\n" for k, t in enumerate(times))
    (tmp_path / "rpm.csv").write_text("time_s,rpm\n" + rows)
    text = inspect_log(tmp_path).proposed_map
    assert text.count("on_change = true") == 1
    assert "on_change = true" in text.split("[rpm]")[1]
    (tmp_path / "MAP.toml").write_text(text)
    assert read_column_map(tmp_path / "MAP.toml").rpm.on_change is True


def test_a_column_of_zeros_is_not_proposed_for_a_guess(tmp_path):
    table = pd.DataFrame({"time": np.arange(50.0), "speed": 2.0, "thruster": 0.0})
    table.to_csv(tmp_path / "run.csv", index=False)
    text = inspect_log(tmp_path / "run.csv").proposed_map
    assert "thruster" not in text
    assert "speed" in text


def test_an_input_without_a_clock_is_proposed_without_one(tmp_path):
    pd.DataFrame({"vx": [0.0, 0.5, 1.0], "delta": [1.0, 1.5, 2.0]}).to_csv(
        tmp_path / "run.csv", index=False
    )
    text = inspect_log(tmp_path / "run.csv").proposed_map
    assert 'time = "?"' in text
    assert "on_change" not in text


def written(folder, tables):
    """Tables by the names of their files, in a folder of their own."""
    folder.mkdir()
    for name, table in tables.items():
        table.to_csv(folder / f"{name}.csv", index=False)
    return folder


def read_as_proposed(folder, tmp_path):
    (tmp_path / "MAP.toml").write_text(inspect_log(folder).proposed_map)
    return read_trials([folder], read_column_map(tmp_path / "MAP.toml"))


def test_trials_told_apart_by_what_their_files_begin_with_get_patterns(tmp_path):
    """Although every column has the program's own name: without a map each file is a trial."""
    tables = {f"{run}_{s}": t for run in ("a1", "b2") for s, t in sensor_tables().items()}
    found = read_as_proposed(written(tmp_path / "logs", tables), tmp_path)
    assert [trial.name for trial in found] == ["a1", "b2"]
    assert found[1].sensors["gyro"].file.endswith("b2_gyro.csv")


@pytest.mark.parametrize("parts", [("001", "002"), ("20240611_100000", "20240611_101000")])
def test_files_told_apart_by_what_they_end_with_get_patterns(tmp_path, parts):
    """A recording that its logger split: a map for the first part alone read ten minutes of it."""
    tables = {f"{s}_{part}": t for part in parts for s, t in sensor_tables().items()}
    found = read_as_proposed(written(tmp_path / "logs", tables), tmp_path)
    assert [trial.name for trial in found] == list(parts)
    assert found[1].sensors["gyro"].file.endswith(f"gyro_{parts[1]}.csv")


def test_no_pattern_where_one_trial_has_other_columns(tmp_path):
    tables = {f"{run}_{s}": t for run in ("a1", "b2") for s, t in sensor_tables().items()}
    tables["b2_gyro"] = np.radians(tables["b2_gyro"]).rename(columns={"r_degps": "r_radps"})
    text = inspect_log(written(tmp_path / "logs", tables)).proposed_map
    assert "*" not in text
    assert 'file = "a1_gyro.csv"' in text


def test_a_wide_file_beside_others_that_hold_the_rest_of_it_needs_a_map(tmp_path):
    wide = wide_table()
    angles = pd.DataFrame({"time_s": wide["time_s"], "heading_deg": 10.0 + wide.index / 100})
    fixes = pd.DataFrame({"time_s": wide["time_s"], "north_m": 1.0 * wide.index, "east_m": 2.0})
    tables = {"control": wide, "ahrs": angles, "usbl": fixes}
    (trial,) = read_as_proposed(written(tmp_path / "run", tables), tmp_path)
    assert {"dvl", "gyro", "rudder", "rpm", "attitude", "position"} == set(trial.sensors)


def test_wide_files_that_are_trials_of_their_own_need_none(tmp_path):
    """One of them has a depth as well; a map would mix the two."""
    tables = {"one": wide_table(), "two": wide_table().assign(depth_m=2.0)}
    folder = written(tmp_path / "day", tables)
    assert inspect_log(folder).proposed_map == ""
    assert [trial.name for trial in read_trials([folder])] == ["one", "two"]


def test_a_map_to_finish_where_one_column_has_another_name(tmp_path):
    """Two rudders of which neither is called rudder, in a log that is right otherwise."""
    tables = sensor_tables()
    upper = tables["rudder"].rename(columns={"rudder_deg": "upper_deg"})
    folder = write_folder(tmp_path / "run", tables | {"rudder": upper.assign(lower_deg=1.0)})
    report = inspect_log(folder)
    assert report.unassigned == ("rudder_rad",)
    assert "No column was recognised for rudder_rad" in report.proposed_map


def printed(folder):
    """The small log as `rostopic echo -p` prints it: one file for each topic, axes of REP 103."""
    names = {
        "u_mps": ("field.twist.twist.linear.x", 1.0),
        "v_mps": ("field.twist.twist.linear.y", -1.0),
        "r_degps": ("field.angular_velocity.z", -np.pi / 180.0),
        "rudder_deg": ("field.data", np.pi / 180.0),
        "rpm": ("field.data", 1.0),
    }
    files = {"dvl": "dvl_twist", "gyro": "imu_data", "rudder": "rudder_angle", "rpm": "shaft_rpm"}
    tables = {}
    for sensor, table in sensor_tables().items():
        ns = np.rint(table["time_s"].to_numpy() * 1e9).astype(np.int64) + 1_714_564_800 * 10**9
        columns = {"%time": ns, "field.header.seq": np.arange(ns.size), "field.header.stamp": ns}
        own = {names[c][0]: names[c][1] * table[c] for c in table if c != "time_s"}
        tables[files[sensor]] = pd.DataFrame(columns | own)
    return write_folder(folder, tables)


def test_messages_that_ros_printed_get_a_map_with_its_axes(tmp_path):
    folder = printed(tmp_path / "run")
    report = inspect_log(folder)
    assert report.unassigned == ()
    assert 'v = { column = "field.twist.twist.linear.y", unit = "mps", sign = -1 }' in (
        report.proposed_map
    )
    path = tmp_path / "map.toml"
    path.write_text(report.proposed_map)
    (trial,) = read_trials([folder], read_column_map(path))
    (plain,) = read_trials([write_folder(tmp_path / "plain")])
    for sensor, other in plain.sensors.items():
        for column, values in other.values.items():
            np.testing.assert_allclose(trial.sensors[sensor].values[column], values, atol=1e-9)


@pytest.mark.parametrize(
    ("sensor", "name", "factor", "proposed", "words"),
    [
        ("rudder", "rudder_pct", 4.0, 'unit = "percent"', ("degrees of one percent",)),
        ("rpm", "rpm_percent", 0.05, 'unit = "percent"', ("rpm of one percent",)),
    ],
)
def test_a_share_of_the_range_is_proposed_without_a_unit_it_has_not(
    tmp_path, sensor, name, factor, proposed, words
):
    """As degrees, a rudder of 60 % would have been read without a word."""
    tables = sensor_tables()
    column = tables[sensor].columns[1]
    tables[sensor] = tables[sensor].assign(**{column: factor * tables[sensor][column]})
    tables[sensor] = tables[sensor].rename(columns={column: name})
    folder = write_folder(tmp_path / "run", tables)
    assert proposed in inspect_log(folder).proposed_map
    with pytest.raises(InputError) as caught:
        read_as_proposed(folder, tmp_path)
    assert all(word in str(caught.value) for word in words)
    with pytest.raises(InputError, match="In place of the scale 0 put what 1 of the column is"):
        read_trials([folder])


def test_a_shaft_in_radians_per_second_is_proposed_with_its_scale(tmp_path):
    tables = sensor_tables()
    rate = tables["rpm"].pop("rpm")
    tables["rpm"]["shaft_radps"] = rate * np.pi / 30.0
    (trial,) = read_as_proposed(write_folder(tmp_path / "run", tables), tmp_path)
    np.testing.assert_allclose(trial.sensors["rpm"].values["rpm"], rate, rtol=1e-5)
