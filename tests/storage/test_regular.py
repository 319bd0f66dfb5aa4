"""What a user names is a file that ends: no device, no pipe, no bomb, no endless text."""

import gzip
import os
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from pyarrow import parquet

from auvident.errors import AuvidentError, InputError, StageError
from auvident.storage import artifacts, declared, log_file, log_text
from auvident.storage.artifacts import read_json, sha256_of, write_bytes
from auvident.storage.declared import read_toml
from auvident.storage.log_inspect import inspect_log
from auvident.storage.logs import read_trials
from auvident.storage.vehicle_file import load_vehicle, read_offsets

READERS: dict[str, Callable[[Path], object]] = {
    "toml": read_toml,
    "json": read_json,
    "offsets": lambda path: read_offsets(path, path),
    "log": lambda path: read_trials([path]),
    "inspect": inspect_log,
}
HEAD, ROW = b"time_s,u_mps,v_mps,r_radps,rudder_rad,rpm\n", b"0,1,0,0,0,900\n"
DAMAGED = Path(__file__).resolve().parents[1] / "data/damaged/small.parquet"
REPEATED = 400_000  # rows that are all the same: a few kilobytes


@pytest.fixture
def low_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bombs of a megabyte, so that the tests are quick."""
    for module in (log_file, log_text):
        monkeypatch.setattr(module, "MOST_UNPACKED", 1 << 20)
    monkeypatch.setattr(declared, "MOST_BYTES", 1 << 20)
    monkeypatch.setattr(artifacts, "MOST_JSON_BYTES", 1 << 20)


@pytest.mark.parametrize("reader", READERS)
def test_a_pipe_is_refused_without_opening_it(tmp_path: Path, reader: str) -> None:
    """Opening one without a writer would wait for ever."""
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(AuvidentError, match="a pipe, not a file"):
        READERS[reader](tmp_path / "pipe")
    assert sha256_of(tmp_path / "pipe") is None


@pytest.mark.parametrize("reader", READERS)
def test_a_device_is_refused(reader: str) -> None:
    with pytest.raises(AuvidentError, match="a device, not a file"):
        READERS[reader](Path("/dev/zero"))


@pytest.mark.usefixtures("low_limits")
def test_gzip_that_unpacks_to_a_hundred_times_its_size_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "wide.csv.gz"
    path.write_bytes(gzip.compress(HEAD + ROW * REPEATED))
    with pytest.raises(InputError, match="unpacks to more than 1 MB"):
        read_trials([path])


@pytest.mark.usefixtures("low_limits")
def test_gzip_of_several_members_is_limited_as_a_whole(tmp_path: Path) -> None:
    path = tmp_path / "wide.csv.gz"
    member = gzip.compress(ROW * (REPEATED // 40))
    path.write_bytes(gzip.compress(HEAD) + member * 40)
    with pytest.raises(InputError, match="unpacks to more than 1 MB"):
        read_trials([path])


@pytest.mark.usefixtures("low_limits")
def test_a_log_that_packs_as_logs_do_is_read_whole(tmp_path: Path) -> None:
    """Larger than the limit on the size alone, far below that on the ratio."""
    noise = np.random.default_rng(1).normal(size=(12_000, 6))
    names = ["u_mps", "v_mps", "r_radps", "rudder_rad", "rpm", "depth_m"]
    table = pd.DataFrame(noise, columns=names)
    table.insert(0, "time_s", 0.1 * np.arange(12_000))
    table.to_csv(tmp_path / "wide.csv.gz", index=False)
    table.to_parquet(tmp_path / "other.parquet")
    for name in ("wide.csv.gz", "other.parquet"):
        (trial,) = read_trials([tmp_path / name])
        assert trial.sensors["dvl"].time_s.size == 12_000


@pytest.mark.usefixtures("low_limits")
def test_parquet_that_repeats_one_value_is_refused(tmp_path: Path) -> None:
    names = ("time_s", "u_mps", "v_mps", "r_radps", "rudder_rad", "rpm")
    table = pa.table({name: pa.array(np.zeros(REPEATED)) for name in names})
    parquet.write_table(table, tmp_path / "wide.parquet")
    with pytest.raises(InputError, match="more than 100 times its size"):
        read_trials([tmp_path / "wide.parquet"])


@pytest.mark.usefixtures("low_limits")
@pytest.mark.parametrize(("reader", "error"), [("toml", InputError), ("json", StageError)])
def test_a_file_that_is_written_by_hand_is_not_large(
    tmp_path: Path, reader: str, error: type[AuvidentError]
) -> None:
    (tmp_path / "large").write_bytes(b" " * ((1 << 20) + 1))
    with pytest.raises(error, match="larger than 1 MB"):
        READERS[reader](tmp_path / "large")


def test_parquet_with_a_damaged_column_is_refused_and_does_not_end_the_process() -> None:
    """What fuzzing found: asked for the size of that column, pyarrow calls abort()."""
    log = log_file.open_log(DAMAGED)
    with pytest.raises(InputError, match="is damaged Parquet: Definition level"):
        log_file.read_log(log, {"u_mps": "number"})
    assert log_file.read_log(log, {"time_s": "number"}).rows_read == 30
    assert inspect_log(DAMAGED)


def test_parquet_with_a_name_that_is_no_utf_8_is_refused(tmp_path: Path) -> None:
    columns = {"time_s": [0.0, 1.0], "u_mps": [1.0, 1.0]}
    parquet.write_table(pa.table(columns), tmp_path / "wide.parquet", store_schema=False)
    content = (tmp_path / "wide.parquet").read_bytes()
    (tmp_path / "wide.parquet").write_bytes(content.replace(b"u_mps", b"\x96_mps"))
    with pytest.raises(InputError, match=r"not UTF-8|damaged"):
        read_trials([tmp_path / "wide.parquet"])


def test_a_line_of_megabytes_is_no_table(tmp_path: Path) -> None:
    head = b"time_s,u_mps,v_mps,note\n0,1,0,ok\n"
    (tmp_path / "wide.csv").write_bytes(head + b"1,1,0," + b"n" * 3_000_000 + b"\n2,1,0,ok\n")
    inspect_log(tmp_path / "wide.csv")
    with pytest.raises(InputError):
        read_trials([tmp_path / "wide.csv"])


def test_a_field_longer_than_the_parser_takes_is_no_bug(tmp_path: Path) -> None:
    line = b"0,1,0," + b"n" * 131_073
    (tmp_path / "wide.csv").write_bytes(b"time_s,u_mps,v_mps,note\n" + line + b"\n1,1,0,x\n")
    with pytest.raises(InputError, match="r_radps"):
        read_trials([tmp_path / "wide.csv"])


def test_many_columns_are_refused(tmp_path: Path) -> None:
    names = ",".join(f"c{k}" for k in range(100_000))
    row = ",".join("1" * 100_000)
    (tmp_path / "wide.csv").write_text(f"time_s,{names}\n0,{row}\n1,{row}\n")
    with pytest.raises(InputError, match="100001 columns"):
        read_trials([tmp_path / "wide.csv"])


TOML = {
    "brackets": ("a = " + "[" * 100_000, "nested too deeply"),
    "closed brackets": ("a = " + "[" * 100_000 + "]" * 100_000, "nested too deeply"),
    "inline tables": ("a = " + "{a=" * 100_000, "nested too deeply"),
    "levels of a key": (".".join("a" * 100_000) + " = 1", "more than 100 levels"),
    "quoted levels": (".".join(['"a"'] * 200) + " = 1", "more than 100 levels"),
    "digits": ("a = " + "9" * 100_000, "number that cannot be read"),
    "a key twice": ("a = 1\na = 2\n", "line 2"),
    "a table twice": ("[a]\nb = 1\n[a]\nc = 1", "twice"),
    "a NUL byte": ("a = 1\0", "not valid TOML"),
}


@pytest.mark.parametrize("name", TOML)
def test_hostile_toml_is_refused_in_a_short_message(tmp_path: Path, name: str) -> None:
    text, words = TOML[name]
    (tmp_path / "v.toml").write_text(text)
    with pytest.raises(InputError, match=words) as refused:
        read_toml(tmp_path / "v.toml")
    assert len(str(refused.value)) < 1000


def test_an_array_of_many_numbers_in_one_line_is_no_dotted_key(tmp_path: Path) -> None:
    (tmp_path / "v.toml").write_text(f"a = [{', '.join(['0.5'] * 1000)}]")
    assert len(read_toml(tmp_path / "v.toml")["a"]) == 1000


def test_toml_of_windows_is_read(tmp_path: Path) -> None:
    (tmp_path / "v.toml").write_bytes(b"\xef\xbb\xbfa = 1\r\n[b]\rc = 2\r\n")
    assert read_toml(tmp_path / "v.toml") == {"a": 1, "b": {"c": 2}}


def test_toml_that_is_no_utf_8_is_named_with_its_row(tmp_path: Path) -> None:
    (tmp_path / "v.toml").write_bytes(b"a = 1\nb = '\xe9'\n")
    with pytest.raises(InputError, match=r"row 2: is not UTF-8 text: byte 0xe9") as refused:
        read_toml(tmp_path / "v.toml")
    assert "Save it as UTF-8" in str(refused.value)


JSON = {
    "depth": "[" * 100_000,
    "NaN": '{"a": NaN}',
    "Infinity": '{"a": -Infinity}',
    "digits": '{"a": ' + "9" * 100_000 + "}",
    "half": '{"a": [1, 2',
    "not text": '{"a": "\udce9"}',
}


@pytest.mark.parametrize("name", JSON)
def test_damaged_json_is_refused_in_a_short_message(tmp_path: Path, name: str) -> None:
    (tmp_path / "a.json").write_text(JSON[name], errors="surrogateescape")
    with pytest.raises(StageError, match="damaged") as refused:
        read_json(tmp_path / "a.json", "Do this.")
    assert len(str(refused.value)) < 1000
    assert "Do this." in str(refused.value)


def test_a_device_is_written_to_and_stays_one(tmp_path: Path) -> None:
    """Renaming a file over it replaced ``/dev/null`` for the whole machine."""
    master, slave = os.openpty()
    path = Path(os.ttyname(slave))
    write_bytes(path, b"model\n")
    assert path.is_char_device()
    assert os.read(master, 100).replace(b"\r\n", b"\n") == b"model\n"
    os.close(master), os.close(slave)


def test_a_pipe_is_written_to_and_stays_one(tmp_path: Path) -> None:
    pipe, read = tmp_path / "pipe", []
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: read.append(pipe.read_bytes()))
    reader.start()
    write_bytes(pipe, b"model")
    reader.join(10)
    assert read == [b"model"]
    assert pipe.is_fifo()


def test_a_link_stays_and_leads_to_what_was_written(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to("model.json")
    for content in (b"new", b"newer"):
        write_bytes(tmp_path / "link", content)
        assert (tmp_path / "link").is_symlink()
        assert (tmp_path / "model.json").read_bytes() == content


@pytest.mark.parametrize("place", [".", "folder"])
def test_a_folder_is_not_written_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    (tmp_path / "folder").mkdir()
    monkeypatch.chdir(tmp_path)
    with pytest.raises(IsADirectoryError):
        write_bytes(Path(place), b"model")
    assert [p.name for p in tmp_path.rglob("*")] == ["folder"]


def test_a_failed_write_names_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full_disk(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(OSError, match=r"model\.json"):
        write_bytes(tmp_path / "model.json", b"new")


def test_offsets_that_cannot_be_read_are_named(tmp_path: Path) -> None:
    text = "[vehicle]\nmass_kg = 1\nizz_kgm2 = 1\norigin_from_nose_m = 0.5\n[hull]\nlength_m = 1\n"
    (tmp_path / "v.toml").write_text(text + 'offsets = "hull.csv"\n')
    (tmp_path / "hull.csv").write_bytes(b"x_from_nose_m,radius_m\n" + b"9" * 200_000 + b",x\n")
    with pytest.raises(InputError, match="not a number") as refused:
        load_vehicle(tmp_path / "v.toml")
    assert len(str(refused.value)) < 1000
