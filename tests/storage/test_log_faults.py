"""Each wrong input ends in one clear message: file, row, column, what to do, exit code 3."""

import os

import numpy as np
import pytest
from log_world import sensor_tables, wide_table, write_folder
from pydantic import ValidationError

from auvident.errors import InputError
from auvident.schema.logs import ColumnMap
from auvident.storage.log_inspect import inspect_log
from auvident.storage.logs import read_trials


def refused(path, *words):
    """The message of a refusal, in which every word must occur."""
    with pytest.raises(InputError) as caught:
        read_trials([path] if not isinstance(path, list) else path)
    message = str(caught.value)
    assert caught.value.exit_code == 3
    assert caught.value.remedy
    for word in words:
        assert str(word) in message, f"{word!r} not in: {message}"
    return message


def wide_file(tmp_path, change=lambda text: text):
    path = tmp_path / "run.csv"
    path.write_text(change(wide_table().to_csv(index=False)))
    return path


def test_no_such_path_with_the_nearest_name(tmp_path):
    wide_file(tmp_path)
    refused(tmp_path / "rum.csv", "rum.csv", "no such file", "run.csv")


def test_missing_sensor_file(tmp_path):
    tables = sensor_tables()
    tables["servo"] = tables.pop("rudder").rename(columns={"rudder_deg": "delta_cmd"})
    folder = write_folder(tmp_path / "run", tables)
    refused(
        folder,
        folder,
        "rudder_deg",
        "servo.csv: time_s, delta_cmd",
        '\n    [rudder]\n    file = "servo.csv"',
        '\n    rudder = { column = "delta_cmd", unit = "deg" }',
    )


def test_missing_column(tmp_path):
    tables = sensor_tables()
    tables["dvl"] = tables["dvl"].rename(columns={"v_mps": "vel_y_mps"})
    folder = write_folder(tmp_path / "run", tables)
    refused(
        folder,
        folder / "dvl.csv",
        "v_mps",
        "time_s, u_mps, vel_y_mps",
        'v = { column = "vel_y_mps", unit = "mps" }',
    )


def test_all_that_is_wrong_with_the_columns_of_a_log_is_told_at_once(tmp_path):
    """Four runs of the program were needed to hear of what is missing in this log."""
    path = tmp_path / "run.csv"
    table = wide_table()[["time_s", "u_mps", "v_mps"]]
    table.rename(columns={"u_mps": "u", "v_mps": "v"}).to_csv(path, index=False)
    message = refused(
        path,
        "column u (surge velocity of the DVL) has no unit; column v (sway velocity of the DVL)",
        "no column r_radps or r_degps (yaw rate) for gyro, none rudder_rad or rudder_deg",
        "\n  Name it v_mps or v_kn or v_cmps or v_mmps or v_kmph or v_ftps, or state the unit",
        '\n    [gyro]\n    r = { column = "your_column", unit = "degps" }\n    [rudder]\n',
        '\n    [rpm]\n    rpm = { column = "your_column", unit = "rpm" }\n  Where nothing ',
        "\n  Where rpm was not logged but held, instead:\n    [rpm]\n    rpm = { constant = 600 }",
    )
    assert message.count("found run.csv: time_s, u, v") == message.count(str(path)) == 1


def test_a_log_of_hundreds_of_columns_does_not_bury_what_to_do(tmp_path):
    path = tmp_path / "run.csv"
    names = ["time_s", *(f"channel_{i}" for i in range(300))]
    rows = [names, *([str(k)] * len(names) for k in range(9))]
    path.write_text("\n".join(",".join(row) for row in rows))
    message = refused(path, "channel_38, ...", "[rudder]\n    rudder = {")
    assert "channel_39" not in message and len(message) < 2000


def test_columns_of_several_files_are_told_with_their_files(tmp_path):
    tables = sensor_tables()
    tables["dvl"] = tables["dvl"].rename(columns={"u_mps": "u"})
    tables["gyro"] = tables["gyro"].rename(columns={"r_degps": "r"})
    folder = write_folder(tmp_path / "run", tables)
    for file, column in (("dvl", "u"), ("gyro", "r")):
        refused(folder, f"column {column} (", f"has no unit ({folder / file}.csv)")


def test_missing_time_column(tmp_path):
    path = wide_file(tmp_path, lambda text: text.replace("time_s", "t"))
    refused(path, path, "no time column", "t, u_mps", 'time = "t"')


@pytest.mark.parametrize(
    "text",
    [
        "rpm\n600\n601\n",
        '"rpm"\n"600"\n',
        "rpm\n[rpm]\n600,5\n",
        "rpm [1/min]\n6e2\n",
        "made at sea\n\nrpm\n600\n",
    ],
)
def test_a_rate_without_times_is_told_to_have_no_time_column(tmp_path, text):
    """Its only column has a name, and it was told to have no row of names."""
    folder = write_folder(tmp_path / "run")
    (folder / "rpm.csv").write_text(text)
    refused(folder, f"{folder / 'rpm.csv'}, columns rpm: has no time column", "Name it time_s")


@pytest.mark.parametrize("name", ["u", "r", "rudder"])
def test_known_quantity_without_unit(tmp_path, name):
    column = {"u": "u_mps", "r": "r_radps", "rudder": "rudder_deg"}[name]
    path = wide_file(tmp_path, lambda text: text.replace(column, name))
    refused(path, path, f"column {name} ", "has no unit", column, "--map")


def test_unit_of_another_dimension(tmp_path):
    path = wide_file(tmp_path, lambda text: text.replace("u_mps", "u_deg"))
    refused(path, "u_deg", "does not fit", "Convert its values and name it u_mps or u_kn")


def test_a_propeller_rate_in_radians_is_told_its_scale(tmp_path):
    path = wide_file(tmp_path, lambda text: text.replace("rpm", "n_radps", 1))
    refused(path, "n_radps", 'unit = "rpm", scale = 9.549297')
    for name in ("n [rad/s]", "rpm_radps"):
        path = wide_file(tmp_path, lambda text, name=name: text.replace("rpm", name, 1))
        refused(path, 'unit = "rpm", scale = 9.549297')
    with pytest.raises(ValidationError, match=r'rad/s is unit = "rpm", scale = 9.549297'):
        ColumnMap.model_validate({"rpm": {"rpm": {"column": "n_radps", "unit": "rad/s"}}})


def test_label_that_contradicts_the_suffix(tmp_path):
    path = wide_file(tmp_path, lambda text: text.replace("u_mps", "u_mps [kn]"))
    refused(path, path, "u_mps", "kn")


def test_one_quantity_twice(tmp_path):
    path = tmp_path / "run.csv"
    wide_table().assign(u_kn=3.0).to_csv(path, index=False)
    refused(path, path, "u_mps and u_kn", "both hold u")


@pytest.mark.parametrize("text", ["ERR", "1.2.3", "12:30", "0x1F", "1 2"])
def test_text_in_a_number_column(tmp_path, text):
    lines = wide_table().to_csv(index=False).split("\n")
    fields = lines[100].split(",")
    fields[3] = text
    lines[100] = ",".join(fields)
    path = tmp_path / "run.csv"
    path.write_text("# preamble\n\n" + "\n".join(lines))
    refused(path, path, "row 103", "column r_radps", repr(text))


def test_text_in_the_time_column(tmp_path):
    path = wide_file(tmp_path, lambda text: text.replace("\n2.0,", "\nnoon,"))
    refused(path, "row 22", "time_s", "'noon'")


def test_no_instant_in_timestamp(tmp_path):
    table = wide_table().rename(columns={"time_s": "timestamp"}).astype({"timestamp": object})
    table["timestamp"] = [f"2024-05-01T10:00:{k:05.2f}" for k in np.arange(len(table)) / 10]
    table.loc[4, "timestamp"] = "yesterday"
    table.to_csv(tmp_path / "run.csv", index=False)
    refused(tmp_path / "run.csv", "row 6", "timestamp", "'yesterday'", "ISO 8601")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "is empty"),
        (b"\n\n  \n", "is empty"),
        (b"\0" * 400, "is empty"),
        (b"time_s,u_mps,v_mps,r_radps,rudder_deg,rpm\n", "no data"),
        (bytes(range(256)) * 20, "binary"),
        (b"PK\x03\x04" + b"x" * 100, "ZIP"),
        (b"\x89HDF\r\n\x1a\n" + b"x" * 100, "HDF5"),
        (b"PAR1 but not really", "damaged Parquet"),
        (b"\x1f\x8b" + b"garbage" * 9, "damaged gzip"),
        (b"0.0,1.5,0.1\n0.1,1.5,0.1\n", "no row of column names"),
        (b"a letter\nto no one\n", "no row of column names"),
        (b"600\n601\n602\n", "no row of column names"),
        (b"logger 7\n12\n0.0,1.5,0.1\n0.1,1.5,0.1\n", "no row of column names"),
    ],
)
def test_files_that_are_no_logs(tmp_path, content, words):
    path = tmp_path / "run.csv"
    path.write_bytes(content)
    refused(path, path, words)


def test_one_broken_file_among_sensors(tmp_path):
    folder = write_folder(tmp_path / "run")
    (folder / "gyro.csv").write_bytes(b"")
    refused(folder, folder / "gyro.csv", "is empty")


def test_many_ragged_rows(tmp_path):
    path = wide_file(tmp_path, lambda text: text.replace("0,", "0,,", 40))
    refused(path, path, "row", "fields of the header")


def test_decimal_comma_between_commas(tmp_path):
    table = wide_table()
    path = tmp_path / "run.csv"
    lines = [",".join(f"{x:.2f}".replace(".", ",") for x in row) for row in table.to_numpy()]
    path.write_text("\n".join([",".join(table.columns), *lines]))
    refused(path, path, "fields of the header", "decimal comma")


def test_two_files_of_one_sensor(tmp_path):
    folder = write_folder(tmp_path / "run")
    sensor_tables()["dvl"].to_parquet(folder / "dvl.parquet")
    refused(folder, folder, "dvl.csv, dvl.parquet")


def test_folder_without_logs(tmp_path):
    (tmp_path / "photo.jpg").write_bytes(b"x")
    refused(tmp_path, tmp_path, "contains no log", "photo.jpg", "dvl.csv")


def test_lone_sensor_file(tmp_path):
    folder = write_folder(tmp_path / "run")
    refused(folder / "dvl.csv", "dvl.csv", "r_degps", "gyro")


def test_parquet_with_text_or_nothing(tmp_path):
    path = tmp_path / "run.parquet"
    table = wide_table().astype({"u_mps": str})
    table.loc[7, "u_mps"] = "ERR"
    table.to_parquet(path)
    refused(path, path, "row 8", "u_mps", "'ERR'")
    wide_table().iloc[:0].to_parquet(path)
    with pytest.raises(InputError, match="no data"):
        read_trials([path])


def test_two_clocks_in_one_trial(tmp_path):
    tables = sensor_tables()
    gyro = tables["gyro"].rename(columns={"time_s": "timestamp"})
    gyro["timestamp"] += 1.7e9
    folder = write_folder(tmp_path / "run", tables | {"gyro": gyro})
    refused(folder, "different clocks", "gyro.csv", "timestamp", "100.000 s")


@pytest.mark.parametrize(("start", "program"), [(45413.5, "Excel"), (739373.5, "MATLAB")])
def test_days_are_told_from_seconds(tmp_path, start, program):
    tables = sensor_tables()
    for table in tables.values():
        table["time_s"] = start + table["time_s"] / 86400.0
    with pytest.raises(InputError, match=f"are days as {program} counts them") as told:
        read_trials([write_folder(tmp_path / "log", tables)])
    assert "86400" in told.value.remedy


def test_a_long_count_of_seconds_is_no_days(tmp_path):
    tables = sensor_tables(origin_s=45413.5)
    (trial,) = read_trials([write_folder(tmp_path / "log", tables)])
    assert trial.sensors["gyro"].time_s[0] == 45413.5


def test_a_pipe_named_after_a_sensor_is_refused_by_its_name(tmp_path):
    folder = write_folder(tmp_path / "log")
    (folder / "dvl.csv").unlink()
    os.mkfifo(folder / "dvl.csv")
    with pytest.raises(InputError, match="is a pipe, not a file") as told:
        read_trials([folder])
    assert told.value.where.endswith("dvl.csv")


def test_two_columns_of_one_name_are_to_be_renamed(tmp_path):
    """A map could not choose between them."""
    path = wide_file(tmp_path, lambda text: text.replace("u_mps", "v_mps", 1))
    message = refused(path, path, "two columns named v_mps", "Rename one of them")
    assert "--map" not in message


def test_the_remedy_for_a_missing_channel_names_a_file_that_may_have_it(tmp_path):
    tables = sensor_tables()
    tables["attitude"] = tables["dvl"].rename(columns={"u_mps": "roll_deg", "v_mps": "pitch_deg"})
    tables["thruster"] = tables.pop("rpm").rename(columns={"rpm": "rpm_cmd"})
    message = '[rpm]\n    file = "thruster.csv"\n    rpm = { column = "rpm_cmd", unit = "rpm" }'
    refused(write_folder(tmp_path / "run", tables), message)
    tables["thruster"] = tables["thruster"].rename(columns={"rpm_cmd": "main_rpm_2"})
    refused(write_folder(tmp_path / "other", tables), 'file = "thruster.csv"', '"main_rpm_2"')


def test_the_remedy_for_a_missing_channel_names_no_file_where_none_may_have_it(tmp_path):
    tables = sensor_tables()
    del tables["rudder"]
    message = refused(write_folder(tmp_path / "run", tables), "[rudder]\n", '{ column = "your')
    assert "file =" not in message


def test_text_files_with_other_endings_are_to_be_renamed(tmp_path):
    for sensor, table in sensor_tables().items():
        table.to_csv(tmp_path / f"{sensor}.txt", index=False)
    for look in (lambda: read_trials([tmp_path]), lambda: inspect_log(tmp_path)):
        with pytest.raises(InputError) as caught:
            look()
        assert (caught.value.remedy or "").startswith(
            "If dvl.txt is a table, give it the ending .csv"
        )
