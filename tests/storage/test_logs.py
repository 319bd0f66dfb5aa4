"""Layouts and dialects of logs: what is written is what is read, in SI units."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from log_world import sensor_tables, wide_table, write_folder, write_gzip

from auvident.errors import InputError
from auvident.schema.logs import UNITS
from auvident.storage.logs import read_trials

EXACT = 1e-12  # a conversion is one multiplication: the last digits of a float


def only(path, column_map=None):
    (trial,) = read_trials([path], column_map)
    return trial


def same_values(a, b, tolerance=EXACT):
    assert set(a.sensors) == set(b.sensors)
    for name, sensor in a.sensors.items():
        other = b.sensors[name]
        np.testing.assert_allclose(sensor.time_s, other.time_s, rtol=0, atol=1e-9)
        assert set(sensor.values) == set(other.values)
        for column, values in sensor.values.items():
            np.testing.assert_allclose(values, other.values[column], rtol=tolerance, atol=1e-15)


def test_folder_of_sensor_files(tmp_path):
    trial = only(write_folder(tmp_path / "run7"))
    assert trial.name == "run7"
    tables = sensor_tables()
    np.testing.assert_array_equal(trial.sensors["dvl"].time_s, tables["dvl"]["time_s"])
    np.testing.assert_allclose(
        trial.sensors["gyro"].values["r_radps"], np.radians(tables["gyro"]["r_degps"]), rtol=EXACT
    )
    assert trial.sensors["dvl"].rows[0] == 2  # line 1 names the columns


@pytest.mark.parametrize("ending", [".csv", ".csv.gz", ".parquet"])
def test_every_format_reads_the_same(tmp_path, ending):
    reference = only(write_folder(tmp_path / "a"))
    folder = tmp_path / "b"
    folder.mkdir()
    for sensor, table in sensor_tables().items():
        path = folder / (sensor + ending)
        if ending == ".parquet":
            table.to_parquet(path)
        else:
            table.to_csv(path, index=False)
    same_values(only(folder), reference)


def test_numbers_that_parquet_stores_as_text_are_read_as_those_of_a_csv(tmp_path):
    reference = only(write_folder(tmp_path / "a"))
    (tmp_path / "b").mkdir()
    for sensor, table in sensor_tables().items():
        table.astype(str).to_parquet(tmp_path / "b" / f"{sensor}.parquet")
    same_values(only(tmp_path / "b"), reference)
    worded = sensor_tables()["gyro"].astype(str)
    worded.loc[3, "time_s"] = "noon"
    worded.to_parquet(tmp_path / "b" / "gyro.parquet")
    with pytest.raises(InputError, match="column time_s, row 4: 'noon' is not an ISO 8601"):
        only(tmp_path / "b")


def test_wide_file_and_its_name(tmp_path):
    path = write_gzip(tmp_path / "zig20.csv.gz", wide_table().to_csv(index=False))
    trial = only(path)
    assert trial.name == "zig20"
    assert set(trial.sensors) == {"dvl", "gyro", "rudder", "rpm"}
    np.testing.assert_allclose(
        trial.sensors["rudder"].values["rudder_rad"], np.radians(wide_table()["rudder_deg"])
    )


def test_folder_of_wide_files_and_folder_of_folders(tmp_path):
    wide_table().to_csv(tmp_path / "b.csv", index=False)
    wide_table().to_parquet(tmp_path / "a.parquet")
    (tmp_path / "hull.csv").write_text("x_from_nose_m,radius_m\n0,0\n1,0.1\n")
    (tmp_path / "notes.txt").write_text("calm")
    write_folder(tmp_path / "deep" / "c")
    assert [t.name for t in read_trials([tmp_path])] == ["a", "b", "c"]


def test_sensor_files_given_one_by_one_are_one_trial(tmp_path):
    folder = write_folder(tmp_path / "run")
    trial = only(folder)
    (same,) = read_trials(sorted(folder.iterdir()))
    assert same.name == "run"
    same_values(same, trial)


def test_columns_of_other_files_are_found(tmp_path):
    tables = sensor_tables()
    act = tables.pop("rudder").merge(tables.pop("rpm"), on="time_s", how="outer")
    folder = write_folder(tmp_path / "run", tables)
    act.to_csv(folder / "actuators.csv", index=False)
    trial = only(folder)
    assert trial.sensors["rpm"].file.endswith("actuators.csv")


def test_same_name_twice_is_refused_but_lone_files_take_their_folders(tmp_path):
    for name in ("x", "y"):
        (tmp_path / name).mkdir()
        wide_table().to_csv(tmp_path / name / "log.csv", index=False)
    assert [t.name for t in read_trials([tmp_path / "x", tmp_path / "y"])] == ["x", "y"]
    wide_table().to_csv(tmp_path / "x" / "more.csv", index=False)
    wide_table().to_csv(tmp_path / "y" / "more.csv", index=False)
    with pytest.raises(InputError, match="two trials are named"):
        read_trials([tmp_path / "x", tmp_path / "y"])


DIALECTS = {
    "semicolon": lambda t: t.to_csv(index=False, sep=";"),
    "tab": lambda t: t.to_csv(index=False, sep="\t"),
    "decimal comma": lambda t: t.to_csv(index=False, sep=";", decimal=","),
    "tab and decimal comma": lambda t: t.to_csv(index=False, sep="\t", decimal=","),
    "bom": lambda t: "\ufeff" + t.to_csv(index=False),
    "crlf": lambda t: t.to_csv(index=False).replace("\n", "\r\n"),
    "blanks": lambda t: t.to_csv(index=False).replace(",", " , "),
    "fixed width": lambda t: t.to_string(index=False, na_rep="nan"),
    "quoted": lambda t: t.to_csv(index=False, quoting=1),
    "preamble": lambda t: (
        "Vehicle: X, boat 3\nOperator, Smith\nDepth, 12.3\n\n" + t.to_csv(index=False)
    ),
    "comments": lambda t: "# made by a logger\n// v2\n% x, y\n" + t.to_csv(index=False),
    "commented header": lambda t: "# " + t.to_csv(index=False),
    "comment within": lambda t: t.to_csv(index=False).replace("\n2.0,", "\n# mark, here\n2.0,"),
    "units row": lambda t: t.to_csv(index=False).replace("\n", "\ns,m/s,m/s,rad/s,deg,rpm\n", 1),
    "units in brackets": lambda t: (
        t.to_csv(index=False).replace("u_mps", "u [m/s]").replace("r_radps", "r (rad/s)")
    ),
    "trailing delimiter": lambda t: t.to_csv(index=False).replace("\n", ",\n"),
    "no line end": lambda t: t.to_csv(index=False).rstrip("\n"),
    "upper case": lambda t: t.to_csv(index=False).replace("u_mps", "U_mps"),
    "repeated header": lambda t: t.to_csv(index=False).replace(
        "\n2.0,", "\n" + ",".join(t.columns) + "\n2.0,"
    ),
    "blank lines": lambda t: t.to_csv(index=False).replace("\n2.0,", "\n\n2.0,"),
    "old mac": lambda t: t.to_csv(index=False).replace("\n", "\r"),
    "latin-1": lambda t: "# 5 \xb0C\n" + t.to_csv(index=False),
}


@pytest.mark.parametrize("dialect", DIALECTS)
def test_dialects_read_the_same(tmp_path, dialect):
    plain = tmp_path / "plain" / "run.csv"
    plain.parent.mkdir()
    wide_table().to_csv(plain, index=False)
    path = tmp_path / "run.csv"
    encoding = "latin-1" if dialect == "latin-1" else "utf-8"
    path.write_bytes(DIALECTS[dialect](wide_table()).encode(encoding))
    same_values(only(path), only(plain))


def test_utf16(tmp_path):
    (tmp_path / "a.csv").write_bytes(wide_table().to_csv(index=False).encode("utf-16"))
    wide_table().to_csv(tmp_path / "b.csv", index=False)
    same_values(only(tmp_path / "a.csv"), only(tmp_path / "b.csv"))


@pytest.mark.parametrize("marker", ["", "nan", "NaN", "n/a", "-", "null", " ", '""', "inf"])
def test_missing_markers_are_nan(tmp_path, marker):
    lines = wide_table().to_csv(index=False).split("\n")
    fields = lines[5].split(",")
    fields[1] = marker
    lines[5] = ",".join(fields)
    path = tmp_path / "run.csv"
    path.write_text("\n".join(lines))
    u = only(path).sensors["dvl"].values["u_mps"]
    assert np.flatnonzero(np.isnan(u)).tolist() == [4]


def test_valid_zero_is_dropped_and_counted(tmp_path):
    tables = sensor_tables()
    tables["dvl"]["valid"] = 1
    tables["dvl"].loc[[3, 7], "valid"] = 0
    dvl = only(write_folder(tmp_path / "run", tables)).sensors["dvl"]
    assert dvl.dropped == {"marked_invalid": 2}
    assert dvl.dropped_rows == {"marked_invalid": (5, 9)}
    assert dvl.time_s.size == len(tables["dvl"]) - 2
    assert dvl.rows_read == len(tables["dvl"])


def test_valid_of_nmea(tmp_path):
    tables = sensor_tables()
    tables["dvl"]["valid"] = "A"
    tables["dvl"].loc[[3, 7], "valid"] = ["V", ""]
    (trial,) = read_trials([write_folder(tmp_path / "log", tables)])
    assert trial.sensors["dvl"].dropped == {"marked_invalid": 1}
    assert trial.findings == ()


@pytest.mark.parametrize(
    ("values", "shown", "count", "invalid"),
    [((4, 2, 0, -1), "4, 2, -1", 3, 1), (("ok", "Q3", "bad", "V"), "q3, v", 2, 1)],
)
def test_valid_that_is_neither_true_nor_false_is_said(tmp_path, values, shown, count, invalid):
    tables = sensor_tables()
    tables["dvl"]["valid"] = values[0] if isinstance(values[0], str) else 1
    tables["dvl"].loc[range(10, 10 + len(values)), "valid"] = values
    (trial,) = read_trials([write_folder(tmp_path / "log", tables)])
    (said,) = trial.findings
    assert said.code == "valid_not_understood"
    assert f"{count} values of valid" in said.message
    assert f"({shown})" in said.message
    assert said.remedy
    assert trial.sensors["dvl"].dropped == {"marked_invalid": invalid}


def test_valid_of_a_wide_file_is_the_dvls(tmp_path):
    table = wide_table().assign(valid=["false"] + ["true"] * (len(wide_table()) - 1))
    table.to_csv(tmp_path / "run.csv", index=False)
    trial = only(tmp_path / "run.csv")
    assert trial.sensors["dvl"].dropped == {"marked_invalid": 1}
    assert trial.sensors["gyro"].dropped == {}


@pytest.mark.parametrize("cut", range(1, 30, 4))
def test_a_tail_cut_off_loses_at_most_the_last_row(tmp_path, cut):
    text = wide_table().to_csv(index=False, float_format="%.5f")
    (tmp_path / "run.csv").write_text(text[:-cut])
    whole = wide_table()
    rpm = only(tmp_path / "run.csv").sensors["rpm"]
    assert rpm.time_s.size in (len(whole) - 1, len(whole))
    np.testing.assert_allclose(rpm.values["rpm"], 1200.0)  # no half number is taken for one
    if rpm.time_s.size < len(whole):
        assert rpm.dropped == {"incomplete_last_row": 1}


def test_cut_gzip_and_zero_filled_tail_keep_what_is_there(tmp_path):
    text = wide_table().to_csv(index=False)
    packed = write_gzip(tmp_path / "a.csv.gz", text)
    packed.write_bytes(packed.read_bytes()[:-60])
    assert 10 < only(packed).sensors["dvl"].time_s.size < len(wide_table())
    (tmp_path / "b.csv").write_bytes(text.encode() + b"\0" * 500)
    assert only(tmp_path / "b.csv").sensors["dvl"].time_s.size == len(wide_table())


def test_a_few_ragged_rows_are_dropped_and_counted(tmp_path):
    lines = wide_table().to_csv(index=False).split("\n")
    lines[50] = lines[50][:9]
    (tmp_path / "run.csv").write_text("\n".join(lines))
    dvl = only(tmp_path / "run.csv").sensors["dvl"]
    assert dvl.dropped == {"wrong_number_of_fields": 1}
    assert dvl.dropped_rows == {"wrong_number_of_fields": (51,)}
    assert dvl.rows[48] == 50
    assert dvl.rows[49] == 52


INSTANT = 1_714_557_600.25  # 2024-05-01T10:00:00.25Z
STAMPS = {
    "iso": lambda t: pd.to_datetime(t * 1e9, unit="ns", utc=True).dt.strftime(
        "%Y-%m-%dT%H:%M:%S.%fZ"
    ),
    "iso with blank": lambda t: pd.to_datetime(t * 1e9, unit="ns").astype(str),
    "iso with zone": lambda t: (
        pd.to_datetime(t * 1e9, unit="ns", utc=True).dt.tz_convert("Asia/Tokyo").astype(str)
    ),
    "seconds": lambda t: t.round(6),
    "milliseconds": lambda t: (t * 1e3).round().astype("int64"),
    "microseconds": lambda t: (t * 1e6).round().astype("int64"),
    "nanoseconds": lambda t: (t * 1e9).round().astype("int64"),
}


@pytest.mark.parametrize("kind", STAMPS)
def test_absolute_time_stamps(tmp_path, kind):
    tables = {
        sensor: table.rename(columns={"time_s": "timestamp"})
        for sensor, table in sensor_tables(0.0).items()
    }
    for table in tables.values():
        table["timestamp"] = STAMPS[kind](table["timestamp"] + INSTANT)
    trial = only(write_folder(tmp_path / "run", tables))
    assert trial.origin == "2024-05-01T10:00:00Z"
    expected = sensor_tables(0.25)["gyro"]["time_s"]
    # a float of seconds since 1970 resolves 0.24 us, the text is cut to 1 us
    np.testing.assert_allclose(trial.sensors["gyro"].time_s, expected, rtol=0, atol=1.5e-6)


def test_time_s_is_left_as_the_user_counts_it(tmp_path):
    trial = only(write_folder(tmp_path / "run", sensor_tables(1_700_000_000.0)))
    assert trial.sensors["dvl"].time_s[0] == 1_700_000_000.0
    assert trial.origin == ""


@settings(max_examples=25, deadline=None)
@given(
    unit=st.sampled_from(sorted(UNITS)),
    values=st.lists(st.floats(-50, 50, width=32), min_size=3, max_size=8),
)
def test_units_through_the_reader_change_nothing(tmp_path_factory, unit, values):
    dimension, factor = UNITS[unit]
    stem, sensor, column = {
        "m/s": ("u", "dvl", "u_mps"),
        "rad": ("rudder", "rudder", "rudder_rad"),
        "rad/s": ("r", "gyro", "r_radps"),
        "1/min": ("n", "rpm", "rpm"),
        "m": ("depth", "depth", "depth_m"),
    }[dimension]
    si = np.asarray(values)
    table = pd.DataFrame({"time_s": np.arange(si.size) / 10, f"{stem}_{unit}": si / factor})
    folder = tmp_path_factory.mktemp("units")
    table.to_csv(folder / "log.csv", index=False)
    (trial,) = read_trials([folder / "log.csv"], needed=(column,))
    np.testing.assert_allclose(trial.sensors[sensor].values[column], si, rtol=1e-12, atol=1e-300)


@settings(max_examples=20, deadline=None)
@given(order=st.permutations(range(6)))
def test_order_of_columns_does_not_matter(tmp_path_factory, order):
    folder = tmp_path_factory.mktemp("order")
    table = wide_table()
    table.to_csv(folder / "a.csv", index=False)
    table[[table.columns[k] for k in order]].to_csv(folder / "b.csv", index=False)
    a, b = read_trials([folder / "a.csv", folder / "b.csv"])
    same_values(a, b)


@settings(max_examples=20, deadline=None)
@given(values=st.lists(st.floats(-1e3, 1e3) | st.just(float("nan")), min_size=2, max_size=20))
@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_write_then_read_is_identity(tmp_path_factory, ending, values):
    path = tmp_path_factory.mktemp("identity") / f"log.{ending}"
    table = pd.DataFrame({"time_s": np.arange(len(values)) * 0.1, "u_mps": values})
    table.to_csv(path, index=False) if ending == "csv" else table.to_parquet(path)
    (trial,) = read_trials([path], needed=("u_mps",))
    np.testing.assert_array_equal(trial.sensors["dvl"].values["u_mps"], values)
    np.testing.assert_array_equal(trial.sensors["dvl"].time_s, table["time_s"])


def test_a_million_rows_take_seconds_at_most(tmp_path):
    import time

    t = np.arange(1_000_000) / 50.0
    table = pd.DataFrame({"time_s": t, "r_radps": np.sin(t)})
    (tmp_path / "gyro.csv").write_text(table.to_csv(index=False, float_format="%.4f"))
    start = time.process_time()
    (trial,) = read_trials([tmp_path / "gyro.csv"], needed=("r_radps",))
    assert trial.sensors["gyro"].time_s.size == t.size
    assert time.process_time() - start < 10.0  # takes 0.5 s, of all threads together
