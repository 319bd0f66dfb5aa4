"""Lines of a map that a message offers are TOML, and of use as they stand."""

import re
import tomllib

import pandas as pd
import pytest
from log_world import sensor_tables, write_folder

from auvident.errors import InputError
from auvident.schema.channels import BY_QUANTITY
from auvident.storage.log_columns import entry_text, missing_channels, missing_topic
from auvident.storage.logs import MAP_REMEDY, read_column_map, read_trials


def offered(told: str) -> dict:
    """The lines that are further in than the rest; those of each place are a map of their own."""
    blocks = re.findall(r"(?:^ {4}.*\n?)+", told, re.MULTILINE)
    maps = [tomllib.loads(re.sub(r"^ {4}", "", block, flags=re.MULTILINE)) for block in blocks]
    return {key: table for one in reversed(maps) for key, table in one.items()}


def refused(folder, column_map=None) -> str:
    with pytest.raises(InputError) as caught:
        read_trials([folder], column_map)
    return str(caught.value)


def renamed(tmp_path, sensor, names, **more):
    tables = sensor_tables()
    tables[sensor] = tables[sensor].rename(columns=names).assign(**more)
    return write_folder(tmp_path / "run", tables)


def test_what_is_missing_is_offered_as_a_map_that_reads_the_log(tmp_path):
    tables = sensor_tables()
    tables["servo"] = tables.pop("rudder").rename(columns={"rudder_deg": "delta_cmd"})
    dvl = tables.pop("dvl").rename(columns={"u_mps": "surge_mps", "v_mps": "sway_mps"})
    folder = write_folder(tmp_path / "run", tables | {"bottom": dvl})
    told = refused(folder).partition("\n  Where nothing measured")[0]
    tables = offered(told)
    servo = {"column": "delta_cmd", "unit": "deg"}
    assert tables["rudder"] == {"file": "servo.csv", "rudder": servo}
    assert tables["dvl"]["file"] == "bottom.csv" and tables["dvl"]["v"]["column"] == "sway_mps"
    path = tmp_path / "map.toml"
    path.write_text("\n".join(line for line in told.split("\n") if line.startswith("    ")))
    (trial,) = read_trials([folder], read_column_map(path))
    assert trial.sensors["rudder"].columns == {"rudder_rad": "delta_cmd"}


def test_all_that_may_be_said_of_what_was_not_logged_is_toml():
    channels = [BY_QUANTITY[q] for q in ("u", "v", "r", "rudder", "rpm")]
    message = str(missing_channels(channels, "run", {"a.csv": ["time_s"]}, {}))
    told = offered(message)
    assert told["dvl"]["u"] == {"column": "your_column", "unit": "mps"}
    assert offered(message.partition("Where rpm")[2])["rpm"] == {"rpm": {"constant": 600}}
    assert all(told["derive"].values())
    topic = offered(str(missing_topic(BY_QUANTITY["r"], "run", ["/a"])))
    assert topic == {"gyro": {"topic": "...", "r": {"column": "...", "unit": "degps"}}}


@pytest.mark.parametrize(
    ("sensor", "names", "scale"),
    [
        ("gyro", {"r_degps": "r"}, None),
        ("rpm", {"rpm": "rpm_percent"}, 0),
        ("rudder", {"rudder_deg": "rudder_mps"}, 0),
        ("rpm", {"rpm": "shaft_radps"}, 9.549297),
    ],
)
def test_a_unit_that_is_not_known_is_offered_as_toml(tmp_path, sensor, names, scale):
    told = refused(renamed(tmp_path, sensor, names))
    entry = offered(told)[sensor]["r" if sensor == "gyro" else sensor]
    assert entry.get("scale") == scale
    assert ("In place of the scale 0" in told) == (scale == 0)


def test_a_scale_that_was_not_put_in_is_refused_by_the_map(tmp_path):
    """As degrees, a rudder of 60 % would be read without a word."""
    told = refused(renamed(tmp_path, "rudder", {"rudder_deg": "rudder_pct"}))
    path = tmp_path / "map.toml"
    path.write_text("\n".join(re.findall(r"^ {4}(.*)", told, re.MULTILINE)))
    with pytest.raises(InputError, match="scale = 0 would leave nothing"):
        read_column_map(path)


def test_labels_and_twins_are_offered_as_toml(tmp_path):
    depth = pd.DataFrame({"time_s": sensor_tables()["dvl"]["time_s"], "depth [dbar]": 5.0})
    told = refused(write_folder(tmp_path / "a", sensor_tables() | {"depth": depth}))
    assert offered(told) == {"depth": {"depth": {"column": "depth", "unit": "m", "scale": 0}}}
    told = refused(renamed(tmp_path / "b", "gyro", {"r_degps": "r_degps [rad/s]"}))
    assert offered(told) == {"gyro": {"r": {"column": "r_degps", "unit": "degps"}}}
    told = refused(renamed(tmp_path / "c", "gyro", {}, r_radps=0.0))
    assert offered(told) == {"gyro": {"r": {"column": "r_degps", "unit": "degps"}}}


def test_a_name_with_quotes_ends_no_string():
    line = entry_text(BY_QUANTITY["r"], 'yaw "rate" \\ x')
    assert tomllib.loads(line)["r"]["column"] == 'yaw "rate" \\ x'


def test_the_example_of_a_map_is_toml():
    assert offered(MAP_REMEDY)["rudder"]["time"] == "t"
