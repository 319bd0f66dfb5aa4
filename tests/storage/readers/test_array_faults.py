"""Damaged, odd and hostile files of arrays and text logs: refused or told, and never run."""

import gzip
import pickle
import struct
import time

import numpy as np
import pytest

from auvident.errors import InputError
from auvident.storage.log_file import open_logs, read_log
from auvident.storage.log_inspect import inspect_log
from auvident.storage.log_time import MISSING_COUNT
from auvident.storage.logs import read_column_map, read_trials
from auvident.storage.readers.fields import instants
from auvident.storage.readers.interface import ns_of_counts
from auvident.storage.readers.mat5 import check
from tests.storage.readers.array_world import (
    START_S,
    tables,
    write_alog,
    write_hdf5,
    write_lsf,
    write_mat_5,
    write_mat_73,
    write_netcdf_3,
    write_netcdf_4,
)

WRITERS = {
    "a.mat": ("scipy", write_mat_5),
    "b.mat": ("h5py", write_mat_73),
    "a.h5": ("h5py", write_hdf5),
    "a.nc": ("scipy", write_netcdf_3),
    "b.nc": ("h5netcdf", write_netcdf_4),
    "a.alog": ("numpy", write_alog),
    "a.lsf": ("imcpy", write_lsf),
}


def tables_in(path):
    return {log.topic: log for log in open_logs(path)}


@pytest.mark.parametrize("name", WRITERS)
def test_files_cut_off_or_overwritten_are_refused_or_read(name, tmp_path):
    """Whatever is done to a file, the only error is one that names it."""
    library, write = WRITERS[name]
    pytest.importorskip(library)
    whole = write(tmp_path / name).read_bytes()
    rng = np.random.default_rng(1)
    damaged = [whole[: int(len(whole) * share)] for share in (0.02, 0.3, 0.7, 0.99)]
    for _ in range(4):
        wrong = bytearray(whole)
        for at in rng.integers(16, len(whole), 40):
            wrong[at] = rng.integers(256)
        damaged.append(bytes(wrong))
    for k, content in enumerate(damaged):
        path = tmp_path / f"{k}{name}"
        path.write_bytes(content)
        try:
            for log in open_logs(path):
                if log.container is not None:
                    read_log(log, dict.fromkeys(log.names[:3]))
        except InputError as error:
            assert path.name in str(error)


def test_a_pickle_beside_an_lsf_is_not_loaded(tmp_path):
    pytest.importorskip("imcpy")
    path = write_lsf(tmp_path / "Data.lsf")

    class Bomb:
        def __reduce__(self):
            return (open, (str(tmp_path / "ran"), "w"))

    (tmp_path / "Data.imcpy_idx").write_bytes(pickle.dumps(Bomb()))
    assert "ServoPosition[id=1]" in tables_in(path)
    assert not (tmp_path / "ran").exists()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["Data.imcpy_idx", "Data.lsf"]


def test_an_lsf_is_read_on_after_a_damaged_stretch(tmp_path):
    pytest.importorskip("imcpy")
    content = write_lsf(tmp_path / "Data.lsf").read_bytes()
    whole = tables_in(tmp_path / "Data.lsf")["Rpm"].container.tables["Rpm"].rows
    path = tmp_path / "cut.lsf.gz"
    path.write_bytes(gzip.compress(content[:5000] + b"\x00" * 300 + content[5300:-3]))
    log = tables_in(path)["Rpm"]
    assert whole - 10 < log.container.tables["Rpm"].rows <= whole
    assert "bytes are damaged" in log.container.notes[0]


def test_a_timetable_is_refused_with_what_to_save(tmp_path):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "t.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        data = file.create_dataset("T", data=np.zeros((1, 6), np.uint32))
        data.attrs["MATLAB_object_decode"] = np.int32(3)
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file".ljust(128))
    with pytest.raises(InputError) as caught:
        open_logs(path)
    assert "timetable" in str(caught.value) and "table2struct" in str(caught.value)


def test_a_timetable_of_version_5_is_refused(tmp_path):
    """An opaque element by hand: MATLAB's own form of objects in version 5."""

    def element(kind, content):
        return struct.pack("<II", kind, len(content)) + content + b"\0" * (-len(content) % 8)

    flags = element(6, struct.pack("<II", 17, 0))
    words = b"".join(element(1, word) for word in (b"T", b"MCOS", b"timetable"))
    array = element(14, element(6, struct.pack("<II", 6, 0)) + element(5, struct.pack("<ii", 1, 1)))
    head = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
    path = tmp_path / "t.mat"
    path.write_bytes(head + element(14, flags + words + array))
    with pytest.raises(InputError) as caught:
        open_logs(path)
    assert "MAT" in str(caught.value)


def test_cells_and_objects_are_told_beside_arrays(tmp_path):
    from scipy.io import savemat

    cells = np.empty(2, dtype=object)
    cells[0], cells[1] = np.arange(3.0), "text"
    structs = np.zeros(4, dtype=[("t", object), ("x", object)])
    for k in range(4):
        structs[k] = (float(k), np.arange(k + 1.0))
    time = {"time_s": np.arange(5.0), "inner": {"u_mps": np.ones(5), "axes": np.ones((5, 3))}}
    savemat(tmp_path / "a.mat", {"c": cells, "many": structs, "run": time})
    logs = tables_in(tmp_path / "a.mat")
    assert logs["run"].names == ("time_s", "inner.u_mps", *(f"inner.axes[{k}]" for k in range(3)))
    told = " ".join(logs["run"].container.notes)
    assert "c is a cell array" in told and "many.x" in told


def test_links_out_of_an_hdf5_file_are_not_followed(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "secret.h5", "w") as file:
        file["time_s"] = np.arange(3.0)
    (tmp_path / "raw.bin").write_bytes(np.arange(8.0).tobytes())
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["x"] = np.arange(4.0)
        file["out"] = h5py.ExternalLink(str(tmp_path / "secret.h5"), "/time_s")
        file["soft"] = h5py.SoftLink("/x")
        file.create_dataset("raw", (8,), "f8", external=[(str(tmp_path / "raw.bin"), 0, 64)])
        layout = h5py.VirtualLayout((3,), "f8")
        layout[:] = h5py.VirtualSource(str(tmp_path / "secret.h5"), "time_s", (3,))
        file.create_virtual_dataset("virtual", layout)
        file.create_group("loop")["back"] = file["/"]
        file.create_dataset("large", (10**12,), "f8", chunks=(10**6,))
        file["grid"] = np.zeros((4, 30))
    logs = tables_in(tmp_path / "a.h5")
    assert {name: log.names for name, log in logs.items()} == {"/": ("x",)}
    told = logs["/"].container.notes
    assert len(told) == 7, told


def test_arrays_of_several_lengths_in_one_group_are_tables_of_their_own(tmp_path):
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file["nav/time_s"], file["nav/u_mps"] = np.arange(9.0), np.ones(9)
        file["nav/imu/time_s"], file["nav/imu/r"] = np.arange(9.0) + 0.1, np.ones(9)
        file["nav/imu/axes/x"] = np.ones(9)
        file["nav/fix"] = np.ones(4)
        both = np.zeros(5, dtype=[("time_s", "f8"), ("depth_m", "f8")])
        file["depth"] = both
    logs = {name: log.names for name, log in tables_in(tmp_path / "a.h5").items()}
    assert logs == {
        "depth": ("time_s", "depth_m"),
        "nav/fix": ("fix",),
        "nav/imu": ("axes.x", "r", "time_s"),
        "nav/time_s": ("time_s", "u_mps"),
    }


@pytest.mark.parametrize(
    ("unit", "values", "expected"),
    [
        ("seconds since 1970-01-01", np.array([1.7e9 + 0.25]), "2023-11-14T22:13:20.25"),
        ("days since 2023-11-14 00:00:0.0 UTC", np.array([1, 2]), "2023-11-15"),
        ("milliseconds since 2023-11-14T22:13:20Z", np.array([125]), "2023-11-14T22:13:20.125"),
        ("hours since 2023-11-14 22:13:20 +02:00", np.array([0.5]), "2023-11-14T20:43:20"),
    ],
)
def test_time_since_an_instant(unit, values, expected):
    assert instants(values, unit, "a.nc")[0] == np.datetime64(expected)


@pytest.mark.parametrize("unit", ["seconds since launch", "s since 99999-01-01", "s since "])
def test_time_since_no_date_is_refused(unit):
    with pytest.raises(InputError, match="does not count from a date"):
        instants(np.arange(3.0), unit, "a.nc")


def test_an_alog_that_is_something_else_is_refused(tmp_path):
    path = tmp_path / "a.alog"
    path.write_text("%% LOGSTART 1.7e9\n" + "one two\n" * 20)
    with pytest.raises(InputError, match="20 of 20 lines"):
        open_logs(path)


def test_pairs_in_an_alog_are_columns_and_damaged_lines_are_told(tmp_path):
    path = tmp_path / "a.alog"
    lines = [f"{k / 10:.3f} NODE_REPORT pNode X={k},Y=-{k}.5,MODE=DRIVE" for k in range(100)]
    lines[40] = "4.0 NODE"
    path.write_text(f"%% LOGSTART {START_S}.25\n" + "\n".join(lines) + "\n10.0 DB_TIME db 1\n")
    log = tables_in(path)["NODE_REPORT"]
    assert log.names == ("timestamp_ns", "X", "Y", "MODE")
    table = read_log(log, {"X": "number", "Y": "number", "timestamp_ns": None})
    assert table.columns["Y"][7] == -7.5
    assert table.columns["timestamp_ns"][0] == START_S * 10**9 + 250_000_000
    assert "1 lines are damaged, the first is line 42" in log.container.notes[0]


IVER = (
    "Latitude;Longitude;Time;Date;C True Heading;Pitch Angle;DFS Depth (m);Vehicle Speed (kn);"
    "Motor Speed CMD;Fin Yaw T\r\n"
)


def iver(path, rows=200, date="5/21/2024"):
    lines = [
        f"{41.5 + 1e-5 * k:.7f};{-71.3 - 2e-5 * k:.7f};"
        f"23:{59 if k < 100 else 0}:{(k % 100) * 0.5:05.2f};{date};"
        f"{270 + k / 10:.1f};1.5;{2 + k / 100:.2f};2.5;{140};{k % 20}"
        for k in range(rows)
    ]
    path.write_text(IVER + "\r\n".join(lines) + "\r\n", newline="")
    return path


def test_date_and_time_of_day_are_one_stamp_and_fixes_are_metres(tmp_path):
    path = iver(tmp_path / "mission.log", rows=100)
    log = tables_in(path)["log"]
    assert log.time == "timestamp"
    assert log.unit_of("Vehicle Speed") == "kn"
    wanted = dict.fromkeys(("timestamp", "north_m", "east_m", "DFS Depth"))
    table = read_log(log, wanted).columns
    assert table["timestamp"][0] == np.datetime64("2024-05-21T23:59:00")
    assert table["timestamp"][99] == np.datetime64("2024-05-21T23:59:49.5")
    # a degree of latitude at 41.5 N is 111 063 m, one of longitude 83 496 m (WGS 84 tables)
    assert table["north_m"][-1] == pytest.approx(99e-5 * 111063, rel=1e-3)
    assert table["east_m"][-1] == pytest.approx(-198e-5 * 83496, rel=1e-3)


def test_dates_that_cannot_be_read_are_refused(tmp_path):
    with pytest.raises(InputError, match="row 2"):
        open_logs(iver(tmp_path / "mission.log", date="21st of May"))


def test_other_text_named_log_is_read_as_before(tmp_path):
    path = tmp_path / "wide.log"
    path.write_text("time_s,u_mps\n" + "\n".join(f"{k},{k / 10}" for k in range(30)))
    (log,) = open_logs(path)
    assert log.layout is not None
    with pytest.raises(InputError, match="v_mps"):
        read_trials([path])


@pytest.mark.parametrize("start", ["2024-05-01", "1e400", "1e300", "-5", "nan"])
def test_a_start_of_a_moos_log_that_is_no_time_is_refused_with_its_line(tmp_path, start):
    path = tmp_path / "a.alog"
    path.write_text(f"%% LOG FILE: a.alog\n%% LOGSTART {start}\n1.0 NAV_X iX 3\n")
    with pytest.raises(InputError, match="is not a time in seconds since 1970") as told:
        open_logs(path)
    assert str(path) in told.value.where
    assert "row 2" in told.value.where
    assert "1714564800.0" in told.value.remedy


def test_a_moos_value_of_many_digits_is_no_endless_search(tmp_path):
    path = tmp_path / "a.alog"
    path.write_text(f"%% LOGSTART {START_S}\n1.0 NAV_X iX 1.5\n1.5 NAV_X iX {'9' * 100_000} 2\n")
    began = time.process_time()
    (log,) = open_logs(path)
    assert log.names == ("timestamp_ns", "value")
    assert time.process_time() - began < 10.0


@pytest.mark.parametrize("time", ["1e300", "1e400", "-1e12"])
def test_a_moos_line_at_no_time_of_a_clock_is_damaged(tmp_path, time):
    path = tmp_path / "a.alog"
    lines = [f"{k}.5 NAV_X iX {k}" for k in range(40)]
    path.write_text("\n".join([f"%% LOGSTART {START_S}", *lines, f"{time} NAV_X iX 7"]))
    (log,) = open_logs(path)
    assert log.container.notes == ("1 lines are damaged, the first is line 42",)
    stamps = read_log(log, {"timestamp_ns": None}).columns["timestamp_ns"]
    assert stamps.tolist() == [(START_S + k) * 10**9 + 5 * 10**8 for k in range(40)]
    path.write_text(f"%% LOGSTART {START_S}\n{time} NAV_X iX 7\n")
    with pytest.raises(InputError, match="the time in s") as told:
        open_logs(path)
    assert "row 2" in told.value.where


@pytest.mark.parametrize("unit", ["days since 1970-01-01", "ns since 2023-01-01"])
def test_counts_beyond_any_clock_are_no_time(unit):
    found = instants(np.array([1.0, 1e300, np.nan, -1e300]), unit, "a.h5")
    assert np.isnat(found).tolist() == [False, True, True, True]


def test_whole_counts_beyond_64_bits_are_no_time():
    found = ns_of_counts(np.array([5, 2**63], np.uint64), 1000)
    assert found.tolist() == [5000, MISSING_COUNT]


@pytest.mark.parametrize("kind", [48905, 200, 14, 0])
def test_a_mat_file_with_a_type_that_there_is_not_is_refused(tmp_path, kind):
    """Found by the fuzzer: scipy took the number for an index, and the process ended."""
    path = write_mat_5(tmp_path / "a.mat")
    content = bytearray(path.read_bytes())
    tag = struct.pack("<II", 9, 8 * len(tables()["attitude"]))  # the data of an array of doubles
    at = content.find(tag)
    assert at > 0
    content[at : at + 4] = struct.pack("<I", kind)
    path.write_bytes(bytes(content))
    with pytest.raises(InputError, match=f"an element of type {kind} ") as told:
        open_logs(path)
    assert told.value.remedy


def write_units(path):
    """A unit of any length, which stands in a heap."""
    import h5py

    with h5py.File(path, "w") as file:
        for column in ("time_s", "rpm"):
            file[f"rpm/{column}"] = np.arange(30.0)
            file[f"rpm/{column}"].attrs["units"] = column.rpartition("_")[-1]
    return path


@pytest.mark.parametrize(("name", "write"), [("b.nc", write_netcdf_4), ("a.h5", write_units)])
@pytest.mark.parametrize("length", [0, 2**64 - 16])
def test_a_heap_at_which_hdf5_turns_in_circles_is_refused(name, write, length, tmp_path):
    """Found by the fuzzer: an entry without number and length, which the library never passes."""
    pytest.importorskip(WRITERS[name][0])
    path = write(tmp_path / name)
    assert open_logs(path)
    content = bytearray(path.read_bytes())
    at = content.find(b"GCOL")
    assert at > 0, "the writer makes no heap"
    content[at + 16 : at + 32] = struct.pack("<HHIQ", int(length > 0), 0, 0, length)
    path.write_bytes(bytes(content))
    with pytest.raises(InputError, match=f"heap at byte {at} has an entry of no length"):
        open_logs(path)


def mat_with(path, held, *changes):
    """A file that scipy wrote, with bytes changed that follow a mark."""
    from scipy.io import savemat

    savemat(path, held)
    content = bytearray(path.read_bytes())
    for mark, offset, new in changes:
        at = content.find(mark) + offset
        assert at > offset
        content[at : at + len(new)] = new
    path.write_bytes(bytes(content))
    return path


FLAGS = struct.pack("<II", 6, 8)
DIMENSIONS = struct.pack("<II", 5, 8)
TWO_CELLS = np.array([np.arange(3.0), "text"], dtype=object)


@pytest.mark.parametrize(
    ("held", "change", "words"),
    [
        ({"a": np.arange(5.0)}, (FLAGS, 9, b"\x08"), "not all of its parts"),  # complex
        ({"a": np.arange(5.0)}, (FLAGS, 8, b"\x05"), "not all of its parts"),  # sparse
        ({"a": np.arange(5.0)}, (DIMENSIONS, 4, b"\x00"), "no dimensions"),
        ({"a": np.arange(5.0)}, (DIMENSIONS, 4, b"\x03"), "no dimensions"),
        ({"a": TWO_CELLS}, (DIMENSIONS, 10, b"\x01"), "not all of its parts"),
        ({"a": {"x": 1.0}}, (DIMENSIONS, 12, b"\x02"), "not all of its parts"),
        ({"a": {"x": 1.0}}, (b"\x05\0\x04\0", 4, b"\0\0\0\0"), "names of 0 letters"),
        ({"a": {"x": 1.0}}, (b"\x05\0\x04\0", 4, b"\xff\xff\xff\xff"), "of -1 letters"),
        ({"a": {"x": 1.0}}, (b"\x05\0\x04\0", 0, b"\x06"), "no fields"),
    ],
)
def test_a_mat_file_that_says_more_than_it_holds_is_refused(tmp_path, held, change, words):
    """Found by the fuzzer: scipy took for the rest what followed, and the process ended."""
    path = mat_with(tmp_path / "a.mat", held, change)
    with pytest.raises(InputError, match=f"damaged MAT file: .* {words}"):
        open_logs(path)


def test_mat_files_of_all_kinds_of_variables_pass_the_check(tmp_path):
    from scipy.io import savemat
    from scipy.sparse import csr_array

    cells = np.empty(2, dtype=object)
    cells[:] = [np.arange(3), "text"]
    held = {
        "a": np.arange(5.0),
        "c": np.array([1j, 2]),
        "s": {"x": np.arange(4), "t": "äöü", "deep": {"y": np.ones((2, 3), np.uint8)}},
        "cells": cells,
        "sparse": csr_array(np.eye(3)),
        "flag": np.array([True, False]),
        "none": np.zeros((0, 0)),
        "structs": np.array([(1, 2), (3, 4)], dtype=[("x", object), ("y", object)]),
        "no_cells": np.zeros((0, 3), dtype=object),
    }
    for packed in (False, True):
        savemat(tmp_path / "a.mat", held, do_compression=packed)
        check((tmp_path / "a.mat").read_bytes())
        assert open_logs(tmp_path / "a.mat")


def test_a_proposed_map_is_valid_where_a_rival_has_a_name_that_does_not_print(tmp_path):
    """Found by the fuzzer: the comment named the other topic as it stands in the file."""
    path = tmp_path / "a.alog"
    rows = [f"{k}.0 {n} i{n} {k}.5" for k in range(40) for n in ("YAW_RATE", "YAW_RATE\x0e")]
    path.write_text(f"%% LOGSTART {START_S}\n" + "\n".join(rows))
    text = inspect_log(path).proposed_map
    assert "also in YAW_RATE" in text
    (tmp_path / "MAP.toml").write_text(text)
    assert read_column_map(tmp_path / "MAP.toml").gyro.r is not None
