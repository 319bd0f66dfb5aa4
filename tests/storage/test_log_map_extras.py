"""What a map says of inputs that were not logged, or not in rpm: constants, scales, offsets."""

import numpy as np
import pandas as pd
import pytest

from auvident.errors import InputError
from auvident.stages.ingest import ingest
from auvident.storage.log_inspect import inspect_log
from auvident.storage.logs import read_column_map, read_trials
from tests.stages.ingest_world import vehicle
from tests.storage.log_world import sensor_tables, wide_table, write_folder


def column_map(folder, text):
    path = folder / "map.toml"
    path.write_text(text)
    return read_column_map(path)


def without_rpm(folder):
    tables = sensor_tables()
    del tables["rpm"]
    return write_folder(folder / "run", tables)


def test_a_constant_takes_the_place_of_a_log(tmp_path):
    mapping = column_map(tmp_path, "[rpm]\nrpm = { constant = 600 }\n")
    (raw,) = read_trials([without_rpm(tmp_path)], mapping)
    trial, quality = ingest(raw, vehicle(signs={"rudder_positive_turns": "starboard"}))
    assert np.all(trial.table["rpm"] == 600.0)
    (rpm,) = [s for s in quality.sensors if s.sensor == "rpm"]
    assert (rpm.rows_read, rpm.rows_used) == (0, 0)
    assert rpm.channels[0].source == "constant"
    assert {c.source for s in quality.sensors for c in s.channels if s.sensor != "rpm"} == {
        "logged"
    }
    (said,) = [f for f in quality.findings if f.code == "constant_input"]
    assert said.value == 600.0
    assert "thrust and drag cannot be separated" in said.message
    assert not [f for f in quality.findings if f.code == "input_logged_on_change"]


def test_a_constant_counts_before_a_column_of_the_file(tmp_path):
    mapping = column_map(tmp_path, '[rpm]\nrpm = { constant = -10, unit = "rps", sign = -1 }\n')
    (raw,) = read_trials([write_folder(tmp_path / "run")], mapping)
    assert raw.sensors["rpm"].values["rpm"].tolist() == [600.0]


def test_a_missing_rpm_names_the_constant(tmp_path):
    with pytest.raises(InputError) as caught:
        read_trials([without_rpm(tmp_path)])
    assert "rpm = { constant = 600 }" in caught.value.remedy


@pytest.mark.parametrize(
    ("column", "entry", "expected"),
    [
        ("throttle", '{ column = "throttle", scale = 12.5 }', 1000.0),
        ("throttle", '{ column = "throttle", unit = "percent", scale = 12.5, offset = 40 }', 1040),
        ("throttle", '{ column = "throttle", unit = "%", scale = 12.5, sign = -1 }', -1000.0),
        ("throttle", '{ column = "throttle", unit = "rps", scale = 0.2, offset = 1 }', 17 * 60),
        ("n_rps", '{ column = "n_rps", scale = 2 }', 160 * 60.0),
    ],
)
def test_scale_and_offset_make_rpm_of_a_throttle(tmp_path, column, entry, expected):
    table = wide_table().rename(columns={"rpm": column}).assign(**{column: 80.0})
    table.to_csv(tmp_path / "wide.csv", index=False)
    mapping = column_map(tmp_path, f"[rpm]\nrpm = {entry}\n")
    (raw,) = read_trials([tmp_path / "wide.csv"], mapping)
    np.testing.assert_allclose(raw.sensors["rpm"].values["rpm"], expected, rtol=1e-12)


def test_scale_and_offset_hold_for_any_quantity_in_its_unit(tmp_path):
    """A servo in microseconds: 0.1 degrees each from 1500 on, to the other side."""
    table = wide_table()
    wanted = np.deg2rad(table["rudder_deg"].to_numpy())
    table["servo"] = 1500.0 - 10.0 * table.pop("rudder_deg")
    table.to_csv(tmp_path / "wide.csv", index=False)
    entry = '{ column = "servo", unit = "deg", scale = 0.1, offset = -150, sign = -1 }'
    mapping = column_map(tmp_path, f"[rudder]\nrudder = {entry}\n")
    (raw,) = read_trials([tmp_path / "wide.csv"], mapping)
    np.testing.assert_allclose(raw.sensors["rudder"].values["rudder_rad"], wanted, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[rpm]\nrpm = { column = "throttle", unit = "percent" }', ("scale", "[rpm]")),
        ('[rpm]\nrpm = { column = "rpm", constant = 600 }', ("either column or constant",)),
        ("[rpm]\nrpm = { constant = 600, scale = 2 }", ("neither scale nor offset",)),
        ("[rpm]\nrpm = { }", ("either column or constant",)),
        ('[rpm]\nrpm = { column = "rpm", scale = 0 }', ("scale = 0",)),
        ("[rpm]\nrpm = { constant = nan }", ("finite",)),
        ("[dvl]\nu = { constant = 1.5 }", ("u is measured",)),
        ("[elevator]\nelevator = { constant = 2 }", ("needs a unit",)),
        ('[rudder]\nrudder = { column = "d", unit = "percent", scale = 2 }', ("not one of",)),
        ('[rudder]\nrudder = { column = "d", unit = "%" }', ("degrees of one percent",)),
        ('[dvl]\nu = { column = "speed", unit = "kn" }\n[derive]\nu = true', ("keep one",)),
    ],
)
def test_a_map_that_says_too_little_or_too_much_is_refused(tmp_path, text, words):
    with pytest.raises(InputError) as caught:
        column_map(tmp_path, text)
    for word in words:
        assert word in str(caught.value)


def test_a_log_without_dvl_and_gyro_is_shown_what_can_be_derived(tmp_path):
    """A boat with GPS and compass; its measured rudder stands behind the command."""
    t = np.arange(0.0, 60.0, 0.5)
    table = pd.DataFrame({"time": t, "rudder_command": 10.0, "rudder": np.sin(t), "x0": t})
    table = table.assign(y0=0.1 * t, heading=90 + t, speed_kn=2.0, rpm=600 + t)
    table.to_csv(tmp_path / "boat.csv", index=False)
    report = inspect_log(tmp_path / "boat.csv")
    assert report.unassigned == ("v_mps", "r_radps")
    assert 'rudder = { column = "rudder", ' in report.proposed_map
    proposed = report.proposed_map.replace("# [derive]", "[derive]")
    proposed = proposed.replace("# v = true", "v = true").replace("# r = true", "r = true")
    (raw,) = read_trials([tmp_path / "boat.csv"], column_map(tmp_path, proposed))
    assert raw.derive.columns == ("v_mps", "r_radps")
