"""MAP.toml: the user's names, files, units, signs and clocks."""

import unicodedata

import numpy as np
import pytest
from log_world import sensor_tables, wide_table, write_folder

from auvident.errors import InputError
from auvident.schema.channels import CHANNELS, SENSORS
from auvident.schema.logs import ColumnMap
from auvident.storage.declared import outside_allowed
from auvident.storage.log_inspect import inspect_log
from auvident.storage.logs import read_column_map, read_trials


def column_map(tmp_path, text):
    path = tmp_path / "MAP.toml"
    path.write_text(text)
    return read_column_map(path)


def test_every_channel_has_its_entry():
    for channel in CHANNELS:
        table = ColumnMap.model_validate({channel.sensor: {channel.quantity: "x_deg"}})
        assert set(table.of(channel.sensor).entries()) == {channel.quantity}
    assert set(SENSORS) <= set(ColumnMap.model_fields)


def test_the_example_of_the_contract(tmp_path):
    tables = sensor_tables()
    rudder = tables.pop("rudder")
    folder = write_folder(tmp_path / "run", tables)
    rudder.set_axis(["t", "delta_cmd"], axis=1).to_csv(folder / "servo log.csv", index=False)
    mapping = column_map(
        tmp_path,
        '[rudder]\nfile = "*.csv"\ntime = "t"\n'
        'rudder = { column = "delta_cmd", unit = "deg", sign = -1 }\n',
    )
    (trial,) = read_trials([folder], mapping)
    assert trial.name == "run"
    np.testing.assert_allclose(
        trial.sensors["rudder"].values["rudder_rad"], -np.radians(rudder["rudder_deg"])
    )


def test_common_time_and_offset(tmp_path):
    table = wide_table().rename(columns={"time_s": "t"})
    table["t"] *= 1e3
    table.to_csv(tmp_path / "run.csv", index=False)
    mapping = column_map(tmp_path, 'time = "t"\ntime_unit = "ms"\n[dvl]\ntime_offset_s = -0.25\n')
    (trial,) = read_trials([tmp_path / "run.csv"], mapping)
    expected = wide_table()["time_s"]
    np.testing.assert_allclose(trial.sensors["gyro"].time_s, expected, atol=1e-9)
    np.testing.assert_allclose(trial.sensors["dvl"].time_s, expected - 0.25, atol=1e-9)


def test_drift_counts_from_the_middle_of_the_stamps(tmp_path):
    wide_table().to_csv(tmp_path / "run.csv", index=False)
    text = "[dvl]\ntime_offset_s = -0.25\ntime_drift_ppm = 2000\n"
    (trial,) = read_trials([tmp_path / "run.csv"], column_map(tmp_path, text))
    stamps = wide_table()["time_s"].to_numpy()
    expected = stamps - 0.25 + 2e-3 * (stamps - np.median(stamps))
    np.testing.assert_allclose(trial.sensors["dvl"].time_s, expected, atol=1e-9)
    np.testing.assert_allclose(trial.sensors["gyro"].time_s, stamps, atol=1e-9)


def test_wide_files_of_a_folder_with_a_map(tmp_path):
    logs = tmp_path / "logs"
    logs.mkdir()
    for name in ("one", "two"):
        wide_table().rename(columns={"time_s": "t"}).to_csv(logs / f"{name}.csv", index=False)
    for text in ('time = "t"\n', 'file = "*.csv"\ntime = "t"\n'):
        trials = read_trials([logs], column_map(tmp_path, text))
        assert [t.name for t in trials] == ["one", "two"]


def test_several_trials_in_one_folder_by_wildcard(tmp_path):
    logs = tmp_path / "logs"
    logs.mkdir()
    for run in ("run1", "run2"):
        for sensor, table in sensor_tables().items():
            table.to_csv(logs / f"{run}_{sensor}.csv", index=False)
    text = "".join(f'[{s}]\nfile = "*_{s}.csv"\n' for s in sensor_tables())
    trials = read_trials([logs], column_map(tmp_path, text))
    assert [t.name for t in trials] == ["run1", "run2"]
    assert trials[1].sensors["gyro"].file.endswith("run2_gyro.csv")


def test_on_change_reaches_the_sensor(tmp_path):
    folder = write_folder(tmp_path / "run")
    (trial,) = read_trials([folder], column_map(tmp_path, "[rudder]\non_change = true\n"))
    assert trial.sensors["rudder"].on_change is True
    assert trial.sensors["rpm"].on_change is None


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[rudder]\ncolour = 3\n", ("[rudder] colour", "unknown key")),
        ("[sonar]\nfile = 'a'\n", ("[sonar]", "unknown key")),
        ("[dlv]\nfile = 'a'\n", ("[dlv] unknown key, did you mean dvl?",)),
        ("[dvl]\nuu = 'a'\n", ("[dvl] uu: unknown key, did you mean u?",)),
        ("[dvl]\nu = { colum = 'a' }\n", ("[dvl] u.colum: unknown key, did you mean column?",)),
        ("[rudder]\ntime = 3\n", ("[rudder] time", "3")),
        ("[rudder]\nrudder = 5\n", ("[rudder] rudder", "5")),
        ("[rudder]\nrudder = { column = 'a', sign = 2 }\n", ("[rudder] rudder.sign", "2")),
        ("[rudder]\nrudder = { column = 'a', unit = 'kn' }\n", ("[rudder]", "'kn'", "deg")),
        ("[dvl]\nrudder = 'a'\n", ("[dvl] rudder", "unknown key")),
        ("[rudder]\ntime_offset_s = 'soon'\n", ("[rudder] time_offset_s", "soon")),
        ("[dvl]\ntime_offset_s = 1e300\n", ("[dvl] time_offset_s", "1e+300")),
        ("[dvl]\ntime_drift_ppm = -1e300\n", ("[dvl] time_drift_ppm", "-1e+300")),
        ("[dvl]\ntime_offset_s = true\n", ("a number is asked for, not true",)),
        (f"[dvl]\ntime_offset_s = {'1' * 100_000}\n", ("cannot be read", "twenty digits")),
        (
            "[dvl]\nu = 'a'\n[rudder] file = 'x.csv', rudder = 'd'\n",
            ("not valid TOML", "In line 3 write [rudder] on a line of its own", "commas"),
        ),
        ("[rudder\n", ("not valid TOML", "line 1", "tables as [name]")),
    ],
)
def test_faults_of_the_map(tmp_path, text, words):
    with pytest.raises(InputError) as caught:
        column_map(tmp_path, text)
    assert caught.value.exit_code == 3
    for word in ("MAP.toml", *words):
        assert word in str(caught.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[rudder]\nrudder = 'delta_deg'\n", ("rudder.csv", "delta_deg", "time_s, rudder_deg")),
        ("[rudder]\ntime = 'tick'\n", ("rudder.csv", "tick", "time_s, rudder_deg")),
        ("[rudder]\nfile = 'servo*.csv'\n", ("servo*.csv", "no file that matches")),
        ("[rudder]\nvalid = 'ok'\n", ("rudder.csv", "'ok'")),
        ("[rudder]\nfile = '/etc/*'\n", ("[rudder] file", "pattern")),
        ("[rpm]\nrpm = { column = 'rpm', unit = 'rps' }\n", ()),
    ],
)
def test_maps_that_do_not_fit_the_log(tmp_path, text, words):
    folder = write_folder(tmp_path / "run")
    with outside_allowed(True):  # else a pattern from the root does not get as far
        mapping = column_map(tmp_path, text)
    if not words:  # the map's unit overrides the name's
        (trial,) = read_trials([folder], mapping)
        assert trial.sensors["rpm"].values["rpm"][0] == 72000.0
        return
    with pytest.raises(InputError) as caught:
        read_trials([folder], mapping)
    for word in words:
        assert word in str(caught.value)


def foreign_folder(folder):
    """A log with other names, units, delimiters and a clock in milliseconds."""
    folder.mkdir()
    tables = sensor_tables()
    nav = tables["dvl"].set_axis(["t", "vx", "vy"], axis=1)
    imu = tables["gyro"].set_axis(["stamp", "gyro_z"], axis=1)
    servo = tables["rudder"].set_axis(["time", "delta_cmd"], axis=1)
    servo["time"] *= 1e3
    motor = tables["rpm"].set_axis(["t", "n_prop"], axis=1)
    nav.to_csv(folder / "nav.csv", index=False)
    imu.to_csv(folder / "imu.csv", index=False, sep=";", decimal=",")
    servo.to_parquet(folder / "servo.parquet")
    motor.to_csv(folder / "motor.tsv", index=False, sep="\t")
    return folder


def test_proposed_map_reads_the_log(tmp_path):
    folder = foreign_folder(tmp_path / "run")
    report = inspect_log(folder)
    assert report.unassigned == ()
    (trial,) = read_trials([folder], column_map(tmp_path, report.proposed_map))
    (plain,) = read_trials([write_folder(tmp_path / "plain")])
    for name, sensor in plain.sensors.items():
        np.testing.assert_allclose(trial.sensors[name].time_s, sensor.time_s, atol=1e-9)
        for column, values in sensor.values.items():
            np.testing.assert_allclose(trial.sensors[name].values[column], values, rtol=1e-12)


def test_inspect_shows_clock_ranges_and_flaws(tmp_path):
    tables = sensor_tables()
    tables["gyro"] = tables["gyro"].drop(range(100, 140))
    tables["gyro"].loc[50, "r_degps"] = np.nan
    folder = write_folder(tmp_path / "run", tables)
    report = inspect_log(folder)
    assert report.proposed_map == ""
    (gyro,) = [f for f in report.files if f.file.endswith("gyro.csv")]
    assert gyro.rate_hz == pytest.approx(20.0)
    assert gyro.gaps == 1
    assert gyro.longest_gap_s == pytest.approx(41 * 0.05)
    assert gyro.columns[1].empty == 1
    assert gyro.columns[1].maximum == pytest.approx(5.0, rel=0.01)


def test_inspect_does_not_stop_at_a_broken_file(tmp_path):
    folder = write_folder(tmp_path / "run")
    (folder / "depth.csv").write_bytes(b"")
    text = (folder / "dvl.csv").read_text().replace("\n101.0,1", "\n101.0,X1", 1)
    (folder / "dvl.csv").write_text(text)
    files = {f.file.rsplit("/")[-1]: f for f in inspect_log(folder).files}
    assert files["depth.csv"].notes == ("is empty", files["depth.csv"].remedy)
    assert files["depth.csv"].remedy
    assert "row 7" in files["dvl.csv"].notes[0]
    assert files["dvl.csv"].columns[2].maximum is not None


@pytest.mark.parametrize(
    "pattern", ["../*.csv", "a/../../*.csv", "/etc/passwd", "..\\\\*.csv", "C:/x.csv", "\\\\x"]
)
@pytest.mark.parametrize("table", ["", "[dvl]\n"])
def test_the_patterns_of_a_map_stay_in_the_log_folder(tmp_path, pattern, table):
    text = f'{table}file = "{pattern}"\n'
    with pytest.raises(InputError, match="out of the log folder") as refused:
        column_map(tmp_path, text)
    assert "--allow-outside" in str(refused.value)
    with outside_allowed(True):
        column_map(tmp_path, text)


@pytest.mark.parametrize("pattern", ["**a", "a[/dev]" * 3000])
def test_what_is_no_pattern_of_files_is_refused(tmp_path, pattern):
    """The long one has more folders than Python's search is deep (found by the fuzzer)."""
    mapping = column_map(tmp_path, f'[dvl]\nfile = "{pattern}"\n')
    with pytest.raises(InputError, match="not a valid pattern") as refused:
        read_trials([write_folder(tmp_path / "run")], mapping)
    assert "[dvl] file" in str(refused.value) and len(str(refused.value)) < 1000


def test_patterns_within_the_log_folder_may_have_folders(tmp_path):
    assert column_map(tmp_path, 'file = "day..1/*/x.csv"\n').file == "day..1/*/x.csv"


@pytest.mark.parametrize(("in_file", "in_map"), [("NFC", "NFD"), ("NFD", "NFC")])
def test_letters_with_marks_may_be_one_sign_or_two(tmp_path, in_file, in_map):
    of_file, of_map = (unicodedata.normalize(form, "Fahrt längs") for form in (in_file, in_map))
    assert of_file != of_map
    table = wide_table().rename(columns={"u_mps": of_file})
    table.to_csv(tmp_path / "run.csv", index=False)
    text = f'[dvl]\nu = {{ column = "{of_map}", unit = "mps" }}\n'
    (trial,) = read_trials([tmp_path / "run.csv"], column_map(tmp_path, text))
    assert trial.sensors["dvl"].columns["u_mps"] == of_file


@pytest.mark.parametrize("every", [1, 2])
def test_a_unit_of_time_that_makes_rows_follow_too_fast_is_refused(tmp_path, every):
    """A log of 10 Hz whose seconds are read as milliseconds; at 5 Hz a sensor might be so fast."""
    wide_table()[::every].to_csv(tmp_path / "run.csv", index=False)
    mapping = column_map(tmp_path, 'time = "time_s"\ntime_unit = "ms"\n')
    if every == 2:
        assert len(read_trials([tmp_path / "run.csv"], mapping)) == 1
        return
    with pytest.raises(InputError, match="1e\\+04 a second") as caught:
        read_trials([tmp_path / "run.csv"], mapping)
    assert "Check the unit of the time: time_unit" in caught.value.remedy


def test_messages_that_come_in_bursts_are_no_fault_of_the_unit(tmp_path):
    table = wide_table()
    table["time_s"] = 0.1 * (table.index // 10) + 1e-6 * (table.index % 10)
    table.to_csv(tmp_path / "run.csv", index=False, float_format="%.7f")
    assert len(read_trials([tmp_path / "run.csv"])) == 1
