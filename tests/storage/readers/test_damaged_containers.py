"""Containers that are cut off, damaged or hostile: an error or a finding, never a traceback."""

import re
import shutil
import sqlite3
import struct

import numpy as np
import pytest
from container_world import (
    DATAFLASH_MAP,
    ROS_MAP,
    fmt,
    tables,
    write_dataflash,
    write_ros,
    write_ulog,
)

from auvident.errors import InputError
from auvident.storage.log_file import looks_like_log, open_logs, read_log
from auvident.storage.log_inspect import inspect_log
from auvident.storage.logs import read_column_map, read_trials
from auvident.storage.readers import ros
from auvident.storage.readers.dataflash import Format

KINDS = {
    "bag": ("rosbags", lambda f: write_ros(f / "trial.bag")),
    "db3": ("rosbags", lambda f: write_ros(f / "trial", "sqlite3")),
    "mcap": ("rosbags", lambda f: write_ros(f / "trial", "mcap", "STORAGE")),
    "ulog": ("pyulog", lambda f: write_ulog(f / "trial.ulg")),
    "dataflash": ("numpy", lambda f: write_dataflash(f / "trial.bin")),
}


@pytest.fixture(scope="module", params=KINDS)
def whole(request, tmp_path_factory):
    """A file and its bytes."""
    library, write = KINDS[request.param]
    pytest.importorskip(library, reason=f"needs {library}")
    path = write(tmp_path_factory.mktemp("whole"))
    return path, path.read_bytes()


def read_all(path):
    """Every column of every table; errors of the family are fine, others are not."""
    try:
        tables = open_logs(path)
    except InputError as error:
        assert str(path) in str(error)
        return 0
    rows = 0
    for table in tables:
        try:
            rows += read_log(table, dict.fromkeys(table.names)).rows.size
        except InputError as error:
            assert str(path) in str(error)
    return rows


@pytest.mark.parametrize("share", [0.0, 0.001, 0.3, 0.97])
def test_files_that_are_cut_off(whole, tmp_path, share):
    path, content = whole
    cut = tmp_path / path.name
    cut.write_bytes(content[: int(share * len(content))])
    everything = read_all(path)
    assert read_all(cut) < everything


def test_files_with_flipped_bytes(whole, tmp_path):
    path, content = whole
    rng = np.random.default_rng(5)
    for count in (3, 30, 300):
        spoilt = np.frombuffer(content, np.uint8).copy()
        places = rng.integers(0, spoilt.size if count > 3 else 4000, count)
        spoilt[places] = rng.integers(0, 255, count)
        damaged = tmp_path / f"{count}{path.suffix}"
        damaged.write_bytes(spoilt.tobytes())
        read_all(damaged)


def test_inspect_tells_what_is_wrong(whole, tmp_path):
    path, content = whole
    cut = tmp_path / path.name
    cut.write_bytes(content[: len(content) // 2] + bytes(200))
    report = inspect_log(cut)
    assert any(file.notes for file in report.files) or path.suffix == ".ulg"


@pytest.mark.parametrize("column", ["name", "type"])
@pytest.mark.parametrize("value", [None, 7, b"\xff"])
def test_a_topic_whose_name_or_type_is_gone_leaves_the_others(tmp_path, column, value):
    pytest.importorskip("rosbags")
    path = write_ros(tmp_path / "trial", "sqlite3")
    with sqlite3.connect(path) as data:
        data.executescript(
            "CREATE TABLE bare AS SELECT * FROM topics; DROP TABLE topics;"
            "ALTER TABLE bare RENAME TO topics"  # without the constraints, which a disk knows not
        )
        first = data.execute("SELECT min(id) FROM topics").fetchone()
        data.execute(f"UPDATE topics SET {column} = ? WHERE id = ?", (value, *first))
    count = len(inspect_log(path).files)
    assert count == len(open_logs(path)) > 1
    assert read_all(path) > 0


def test_a_file_of_another_kind_is_no_container(tmp_path):
    for suffix in (".bag", ".db3", ".mcap", ".ulg", ".bin"):
        path = tmp_path / f"firmware{suffix}"
        path.write_bytes(bytes(range(256)) * 20)
        assert not looks_like_log(path)
        with pytest.raises(InputError):
            open_logs(path)


@pytest.mark.parametrize("kind", [130, 131])
def test_units_of_letters_that_there_are_not_are_none(tmp_path, kind):
    path = write_dataflash(tmp_path / "trial.bin")
    content = bytearray(path.read_bytes())
    row = content.find(bytes((0xA3, 0x95, kind)))
    content[row + 3 + 8] = 0xF9  # the letter, behind the time: -7
    path.write_bytes(content)
    assert read_all(path) > 0
    inspect_log(path)


@pytest.mark.parametrize("names", [b"TimeUS,,E", b",N,E\0\0\0\0\0"])
def test_a_message_with_a_column_without_a_name_is_not_known(tmp_path, names):
    path = write_dataflash(tmp_path / "trial.bin")
    whole, before = path.read_bytes(), read_all(path)
    assert whole.count(b"TimeUS,N,E") == 1
    path.write_bytes(whole.replace(b"TimeUS,N,E", names.ljust(10, b"\0")))
    assert 0 < read_all(path) < before
    assert any("not known: POS" in note for f in inspect_log(path).files for note in f.notes)


@pytest.mark.parametrize("first", ["date\r,time,rpm", "date,\rtime,rpm", "\rdate,time,rpm"])
def test_a_first_line_that_ends_early_has_no_clock(tmp_path, first):
    path = tmp_path / "mission.log"
    rows = [f"2024-05-01,12:00:{k:02d}.5,{k}" for k in range(30)]
    path.write_bytes("\n".join([first, *rows]).encode())
    with pytest.raises(InputError, match=r"damaged|no data") as refused:
        open_logs(path)
    assert str(path) in str(refused.value)


@pytest.mark.parametrize("letter", ["a", "d", "n"])  # of an array, a number, a text
@pytest.mark.parametrize("name", [b"FMTU", b"UNIT", b"MULT", b"IMU\0", b"POS\0"])
def test_definitions_of_other_types(tmp_path, name, letter):
    """One letter of a definition is another, and its length that of the other type."""
    path = write_dataflash(tmp_path / "trial.bin")
    whole = path.read_bytes()
    for found in re.finditer(rb"\xa3\x95\x80(?=.." + name + b")", whole, re.DOTALL):
        at = found.end()  # number, length, name, letters
        for k, old in enumerate(whole[at + 6 : at + 22].rstrip(b"\0").decode()):
            length = whole[at + 1] + size_of(letter) - size_of(old)
            if length < 256:
                content = bytearray(whole)
                content[at + 6 + k], content[at + 1] = ord(letter), length
                path.write_bytes(content)
                assert read_all(path) > 0


def size_of(letter: str) -> int:
    return Format("", 0, ("x",), letter).dtype.itemsize


def test_bytes_between_messages_are_a_finding(tmp_path):
    path = write_dataflash(tmp_path / "trial.bin")
    content = path.read_bytes()
    middle = content.find(b"\xa3\x95", len(content) // 2)
    path.write_bytes(content[:middle] + b"\0" * 33 + content[middle:-5])
    (tmp_path / "MAP.toml").write_text(DATAFLASH_MAP)
    (trial,) = read_trials([path], read_column_map(tmp_path / "MAP.toml"))
    (finding,) = trial.findings
    assert finding.code == "log_damaged"
    assert "at 2 places" in finding.message


@pytest.fixture
def bag(tmp_path):
    """A small bag of ROS 1 by the library."""
    pytest.importorskip("rosbags", reason="needs rosbags")
    return write_ros(tmp_path / "trial.bag", "", "BZ2")


def test_no_definition_of_a_file_becomes_code(bag, tmp_path, monkeypatch):
    from rosbags.typesys.store import Typestore

    def refuse(*arguments):
        raise AssertionError("the library makes code of a definition here")

    (tmp_path / "MAP.toml").write_text(ROS_MAP)
    monkeypatch.setattr(Typestore, "register", refuse)
    monkeypatch.setattr(Typestore, "get_msgdef", refuse)
    (trial,) = read_trials([bag], read_column_map(tmp_path / "MAP.toml"))
    assert trial.sensors["dvl"].time_s.size


@pytest.mark.parametrize(
    "name", [b"lab/A:\n os.sys", b"lab_msgs/D'\"#\n", b"../../../etc/", b"\xff\xfe\xfd/msg/Dv"]
)
def test_names_that_are_no_names(tmp_path, name):
    pytest.importorskip("rosbags", reason="needs rosbags")
    path = write_ros(tmp_path / "trial.bag")
    content = path.read_bytes()
    hostile = content.replace(b"lab_msgs/Dvl", (name + b"x" * 12)[:12])
    assert hostile != content
    path.write_bytes(hostile)
    read_all(path)


def test_a_chunk_that_unpacks_without_end(bag, monkeypatch):
    monkeypatch.setattr(ros, "MOST_CHUNK", 1 << 12)
    with pytest.raises(InputError, match="unpacks to more than"):
        open_logs(bag)


@pytest.mark.parametrize("storage", ["sqlite3", "mcap"])
def test_a_bag_in_several_files_is_one_trial(tmp_path, storage):
    pytest.importorskip("rosbags", reason="needs rosbags")
    first = write_ros(tmp_path / "night", storage)
    folder, second = first.parent, first.with_stem("night_1")
    shutil.copy(first, second)
    text = (folder / "metadata.yaml").read_text()
    both = text.replace(f"- {first.name}\n", f"- {first.name}\n  - {second.name}\n", 1)
    assert both != text
    (folder / "metadata.yaml").write_text(both)
    (tmp_path / "MAP.toml").write_text(ROS_MAP)
    (trial,) = read_trials([folder], read_column_map(tmp_path / "MAP.toml"))
    assert trial.sensors["gyro"].time_s.size == 2 * len(tables()["gyro"])


@pytest.mark.parametrize(
    ("formats", "words"),
    [
        (
            (b"a:uint64_t timestamp;b[60000] x;", b"b:c[60000] y;", b"c:float z;"),
            "3.6e\\+09 fields",
        ),
        ((b"a:uint64_t timestamp;b x;", b"b:a y;"), "contains itself"),
    ],
)
def test_a_ulog_whose_fields_never_end(tmp_path, formats, words):
    pytest.importorskip("pyulog", reason="needs pyulog")
    content = b"ULog\x01\x12\x35\x01" + bytes(8)
    for text in formats:
        content += struct.pack("<HB", len(text), ord("F")) + text
    subscription = struct.pack("<BH", 0, 0) + b"a"
    content += struct.pack("<HB", len(subscription), ord("A")) + subscription
    (tmp_path / "a.ulg").write_bytes(content)
    with pytest.raises(InputError, match=words):
        open_logs(tmp_path / "a.ulg")


def test_two_kinds_of_message_of_one_name_are_two_tables(tmp_path):
    one, two = (fmt(number, "A", "Qd", "TimeUS,x", 16) for number in (140, 141))
    message = struct.pack("<Qd", 1, 2.0)
    path = tmp_path / "a.bin"
    head = fmt(128, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns", 86)
    path.write_bytes(head + one + two + b"\xa3\x95\x8c" + message + b"\xa3\x95\x8d" + message)
    assert [log.topic for log in open_logs(path)] == ["FMT", "A", "A (141)"]


def test_a_definition_that_cannot_be_parsed_costs_its_own_topic(tmp_path):
    pytest.importorskip("rosbags", reason="needs rosbags")
    path = write_ros(tmp_path / "trial.bag")
    content = path.read_bytes()
    assert b"float32[4] ranges" in content
    path.write_bytes(content.replace(b"float32[4] ranges", b"float32[4] ra*ges"))
    logs = {log.topic: log for log in open_logs(path)}
    assert logs["/dvl"].names == ("timestamp_ns",)
    assert "angular_velocity.z" in logs["/imu/data"].names
    (report,) = [f for f in inspect_log(path).files if f.file.endswith("topic /dvl")]
    assert "cannot be read" in report.notes[0]


def test_a_ulog_at_whose_end_the_library_turns_in_circles(tmp_path):
    """Found by the fuzzer: it goes back by a length of which the file holds less."""
    pytest.importorskip("pyulog", reason="needs pyulog")
    content = b"ULog\x01\x12\x35\x01" + bytes(8)
    text = b"a:uint64_t timestamp;"
    message = struct.pack("<HB", len(text), ord("F")) + text
    # a message of no type, as long as leads back to the beginning of the one before
    (tmp_path / "a.ulg").write_bytes(content + message + struct.pack("<HB", len(message) + 1, 0))
    with pytest.raises(InputError, match="is no message") as told:
        open_logs(tmp_path / "a.ulg")
    assert told.value.remedy
