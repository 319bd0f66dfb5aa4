"""Containers of many tables: topics named by a map, found by their columns, refused otherwise."""

from types import SimpleNamespace

import numpy as np
import pytest
from container_world import write_csv

from auvident.errors import InputError
from auvident.schema.logs import ColumnMap
from auvident.storage.log_file import looks_like_log, open_logs, stem
from auvident.storage.log_inspect import inspect_log
from auvident.storage.logs import read_column_map, read_trials
from auvident.storage.readers import registry
from auvident.storage.readers.interface import in_memory

MAGIC = b"LABLOG"
START_NS = 1_700_000_000_000_000_000


def tables():
    """A weaving vehicle in topics with names of their own."""
    stamps = START_NS + np.arange(0, 300) * 100_000_000
    phase = 2 * np.pi * np.arange(300) / 120
    return {
        "/nav/dvl": {
            "timestamp_ns": stamps[::2],
            "twist.linear.x": (1.5 + 0.1 * np.cos(phase))[::2],
            "twist.linear.y": (0.1 * np.sin(phase))[::2],
        },
        "/gyro": {"timestamp_ns": stamps, "r_radps": 0.1 * np.sin(phase)},
        "/fins": {"timestamp_ns": stamps, "angle": 0.2 * np.sign(phase - np.pi), "state": stamps},
        "/motor": {"timestamp_ns": stamps, "rpm": np.full(300, 1200)},
    }


MAP = {
    "dvl": {
        "topic": "/nav/dvl",
        "u": {"column": "twist.linear.x", "unit": "mps"},
        "v": {"column": "twist.linear.y", "unit": "mps", "sign": -1},
    },
    "rudder": {"topic": "/fins", "rudder": {"column": "angle", "unit": "rad"}},
    "rpm": {"rpm": {"column": "rpm", "unit": "rpm"}},
}


class LabReader:
    """A laboratory's own format: the magic word and nothing else."""

    name = "log of the laboratory"

    def __init__(self, content=None, notes=()):
        self.content, self.notes, self.opened = content or tables(), notes, 0

    def matches(self, path, head):
        return head.startswith(MAGIC)

    def open(self, path):
        self.opened += 1
        return in_memory(self.content, notes=self.notes)


@pytest.fixture
def lab(tmp_path, monkeypatch):
    """A reader from an entry point, and a file for it."""
    reader = LabReader()
    point = SimpleNamespace(name=".lab", value="lab.readers:reader", load=lambda: reader)
    monkeypatch.setattr(registry, "_entry_points", lambda: {".lab": point})
    path = tmp_path / "Trial 3.lab"
    path.write_bytes(MAGIC + b"...")
    return path, reader


def test_topics_named_in_a_map_become_sensors(lab):
    path, reader = lab
    (trial,) = read_trials([path], ColumnMap.model_validate(MAP))
    expected = tables()["/nav/dvl"]
    dvl = trial.sensors["dvl"]
    assert trial.name == "Trial 3"
    assert trial.origin.startswith("2023-11-14T22:13:20")
    np.testing.assert_allclose(dvl.time_s, np.arange(0, 30, 0.2), atol=1e-9)
    np.testing.assert_array_equal(dvl.values["u_mps"], expected["twist.linear.x"])
    np.testing.assert_array_equal(dvl.values["v_mps"], -expected["twist.linear.y"])
    assert dvl.file == f"{path}, topic /nav/dvl"
    assert reader.opened == 1


def test_a_folder_of_them_is_a_folder_of_trials(lab):
    path, _ = lab
    (path.parent / "Trial 4.lab").write_bytes(path.read_bytes())
    (path.parent / "other.lab").write_bytes(b"something else")
    assert stem(path) == "Trial 3"
    assert not looks_like_log(path.parent / "other.lab")
    named = MAP | {"file": "*.lab"}
    for column_map in (MAP, named):
        trials = read_trials([path.parent], ColumnMap.model_validate(column_map))
        assert [t.name for t in trials] == ["Trial 3", "Trial 4"]


def test_without_a_map_only_columns_of_the_program_s_own_names_are_taken(lab):
    path, _ = lab
    with pytest.raises(InputError) as caught:
        read_trials([path])
    for word in ("u_mps", "/nav/dvl", "/motor", "auvident inspect"):
        assert word in str(caught.value)


def test_two_topics_with_the_same_columns_are_refused(lab):
    path, reader = lab
    reader.content["/gyro_2"] = dict(reader.content["/gyro"])
    with pytest.raises(InputError, match=r"\[gyro\] topic = \"/gyro\""):
        read_trials([path], ColumnMap.model_validate(MAP))


def test_a_topic_that_is_not_there(lab):
    path, _ = lab
    wrong = MAP | {"dvl": MAP["dvl"] | {"topic": "/nav/dlv"}}
    with pytest.raises(InputError, match='Did you mean "/nav/dvl"'):
        read_trials([path], ColumnMap.model_validate(wrong))


def test_a_column_that_is_no_number(lab):
    path, reader = lab
    reader.content["/fins"]["angle"] = np.array(["port"] * 300, dtype=object)
    with pytest.raises(InputError, match="'port' in column angle"):
        read_trials([path], ColumnMap.model_validate(MAP))


def test_damage_is_a_finding(lab):
    path, reader = lab
    reader.notes = ("the last 120 bytes are cut off",)
    (trial,) = read_trials([path], ColumnMap.model_validate(MAP))
    (finding,) = trial.findings
    assert (finding.code, finding.message) == ("log_damaged", reader.notes[0])


def test_a_container_without_tables_is_refused(lab):
    path, reader = lab
    reader.notes = ("all of it is zeros",)
    reader.content.clear()
    with pytest.raises(InputError, match=r"has no table.*zeros"):
        open_logs(path)


def test_a_reader_that_cannot_be_loaded(lab, monkeypatch):
    def load():
        raise ImportError("no module named lab")

    point = SimpleNamespace(name=".lab", value="lab.readers:reader", load=load)
    monkeypatch.setattr(registry, "_entry_points", lambda: {".lab": point})
    with pytest.raises(InputError, match="no module named lab"):
        read_trials([lab[0]])


def test_a_missing_library_names_its_extra(tmp_path):
    with pytest.raises(InputError) as caught:
        registry.need("no_such_library.reader", "ros", tmp_path / "a.bag")
    assert "needs no_such_library: pip install 'auvident[ros]'" in str(caught.value)


def test_every_reader_of_the_table_can_be_loaded_without_its_library():
    for suffix, module in registry.READERS:
        assert suffix.startswith(".") and suffix == suffix.lower()
        reader = registry.import_module(f"auvident.storage.readers.{module}").READER
        assert reader.name and not reader.matches(registry.Path(f"a{suffix}"), b"nothing")


def test_a_recording_beside_its_tables_is_left_aside_and_told(lab):
    path, reader = lab
    folder = write_csv(path.parent / "exported")
    path.rename(folder / path.name)
    (trial,) = read_trials([folder])
    assert trial.name == "exported"
    (finding,) = trial.findings
    assert finding.code == "file_not_used"
    assert path.name in finding.message
    assert reader.opened == 0  # its library need not be there
    for table in folder.glob("*.csv"):
        table.rename(folder / f"offsets_{table.name}").write_text("x,y\n1,2\n")
    (trial,) = read_trials([folder], ColumnMap.model_validate(MAP))
    assert trial.name == path.stem


LAT, LON = 36.8 + 1e-5 * np.arange(150), -121.9 + 1e-5 * np.arange(150)
FIX = {"timestamp_ns": START_NS + np.arange(150) * 200_000_000}


@pytest.mark.parametrize(
    ("topic", "fields", "scale"),
    [
        ("/gps/fix", ("latitude", "longitude"), 1.0),  # sensor_msgs/NavSatFix
        ("/odometry", ("pose.position.latitude", "pose.position.longitude"), 1.0),
        ("vehicle_gps_position", ("lat", "lon"), 1e7),  # PX4 before 1.14
        ("GPS[0]", ("Lat", "Lng"), 1.0),
        ("nav", ("NAV_LAT", "NAV_LONG"), 1.0),
    ],
)
def test_a_topic_of_fixes_is_proposed_as_the_position(lab, tmp_path, topic, fields, scale):
    path, reader = lab
    columns = {fields[0]: np.rint(scale * LAT) if scale > 1 else LAT}
    columns[fields[1]] = np.rint(scale * LON) if scale > 1 else LON
    reader.content[topic] = FIX | columns
    (tmp_path / "MAP.toml").write_text(inspect_log(path).proposed_map)
    mapping = read_column_map(tmp_path / "MAP.toml")
    assert mapping.position.topic == topic
    (trial,) = read_trials([path], mapping, needed=())
    north = trial.sensors["position"].values["north_m"]
    assert north[-1] == pytest.approx(149e-5 * 110974, abs=0.05)  # a degree at 36.8 N


def test_a_longitude_that_is_counted_eastward_all_around_is_proposed(lab):
    path, reader = lab
    reader.content["/gps/fix"] = FIX | {"latitude": LAT, "longitude": LON % 360.0}
    assert 'topic = "/gps/fix"' in inspect_log(path).proposed_map


def test_a_position_in_metres_is_proposed_before_fixes(lab):
    path, reader = lab
    reader.content["/gps/fix"] = FIX | {"latitude": LAT, "longitude": LON}
    metres = FIX | {"position.x": np.arange(150.0), "position.y": np.arange(150.0)}
    reader.content["/pose"] = {key: values[::2] for key, values in metres.items()}
    assert 'topic = "/pose"' in inspect_log(path).proposed_map


def test_fixes_in_several_topics_are_left_alone_and_told(lab):
    path, reader = lab
    for topic in ("sensor_gps", "vehicle_gps_position"):
        reader.content[topic] = FIX | {"latitude_deg": LAT, "longitude_deg": LON}
    (trial,) = read_trials([path], ColumnMap.model_validate(MAP))
    assert "position" not in trial.sensors
    (finding,) = trial.findings
    assert '[position] topic = "sensor_gps"' in finding.remedy
