"""Damaged files: whatever the bytes, they are read or refused with an error of the family."""

import random

import pandas as pd
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from log_world import wide_table

from auvident.errors import AuvidentError
from auvident.storage.log_inspect import ColumnReport, LogReport, inspect_log
from auvident.storage.logs import read_trials
from tests.bench.fuzz import damaged as spoilt
from tests.bench.fuzz_containers import NAMES, containers

FUZZ = settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
TEXT = wide_table().head(40).to_csv(index=False).encode()
PIECES = [
    b"",
    b",",
    b";",
    b"\n",
    b"\r",
    b'"',
    b"#",
    b"nan",
    b"1e999",
    b"\0",
    b"\xff\xfe",
    b"time_s",
    b" ",
    b"-",
    b"\xef\xbb\xbf",
    b"x" * 50,
    b"\t",
    b"1,5",
]


def damaged(content: bytes, cuts: list[tuple[int, int, bytes]]) -> bytes:
    for at, length, piece in cuts:
        at %= len(content) + 1
        content = content[:at] + piece + content[at + length :]
    return content


def read_or_refuse(path) -> None:
    try:
        (trial,) = read_trials([path])
    except AuvidentError as error:
        assert error.problem
        assert error.where
    else:
        for sensor in trial.sensors.values():
            assert {x.size for x in sensor.values.values()} == {sensor.time_s.size}
            assert sensor.rows.size == sensor.time_s.size


CUTS = st.lists(
    st.tuples(st.integers(0, 10_000), st.integers(0, 200), st.sampled_from(PIECES)), max_size=5
)


@FUZZ
@example(cuts=[(42, 0, b"nan"), (1336, 195, b"\xff\xfe")])  # no UTF-8 in a row cut short
@given(cuts=CUTS)
def test_damaged_text(tmp_path, cuts):
    path = tmp_path / "run.csv"
    path.write_bytes(damaged(TEXT, cuts))
    read_or_refuse(path)


@FUZZ
@given(content=st.binary(max_size=400))
def test_any_bytes(tmp_path, content):
    path = tmp_path / "run.csv"
    path.write_bytes(content)
    read_or_refuse(path)


@FUZZ
@given(cuts=CUTS)
def test_damaged_parquet(tmp_path, cuts):
    whole = tmp_path / "whole.parquet"
    if not whole.exists():
        wide_table().to_parquet(whole)
    path = tmp_path / "run.parquet"
    path.write_bytes(damaged(whole.read_bytes(), cuts))
    read_or_refuse(path)


@settings(parent=FUZZ, max_examples=60)
@given(cuts=CUTS)
def test_inspect_never_stops(tmp_path, cuts):
    path = tmp_path / "run.csv"
    path.write_bytes(damaged(TEXT, cuts))
    report = inspect_log(path)
    assert len(report.files) == 1
    report.model_dump_json()


@settings(parent=FUZZ, max_examples=60)
@given(
    names=st.lists(
        st.sampled_from(["t", "time_s", "vx", "u_mps", "delta", "n", "x", "psi", "yaw_rate", "u"]),
        min_size=2,
        max_size=6,
        unique=True,
    )
)
def test_a_proposed_map_is_valid_whatever_the_columns(tmp_path, names):
    from auvident.storage.logs import read_column_map

    table = pd.DataFrame({name: [float(k), k + 0.5, k + 1.0] for k, name in enumerate(names)})
    table.to_csv(tmp_path / "run.csv", index=False)
    text = inspect_log(tmp_path / "run.csv").proposed_map
    (tmp_path / "MAP.toml").write_text(text)
    read_column_map(tmp_path / "MAP.toml")


@pytest.mark.parametrize("name", NAMES)
def test_damaged_logs_of_many_tables(name, tmp_path):
    """A taste of ``python -m tests.bench.fuzz``: sound files are read, others refused."""
    found = [*containers(tmp_path, (name,))]
    if not found:
        pytest.skip("its library is not installed")
    ((_, file, sound, read),) = found
    rng = random.Random(7)
    cases = [*sound, *(spoilt(rng.choice(sound), sound, rng) for _ in range(6))]
    for k, content in enumerate(cases):
        path = tmp_path / file
        path.write_bytes(content)
        try:
            read(path)
        except AuvidentError as error:
            assert error.problem
            assert k >= len(sound), f"a sound file is refused: {error}"


def test_a_line_that_only_some_columns_skip_is_skipped_by_all(tmp_path):
    lines = wide_table().head(60).to_csv(index=False).splitlines()
    lines[20] = "#" + lines[20][1:]  # a remark, to whoever reads its first column
    cells = lines[40].split(",")
    cells[2] += "x"  # no number: the columns are read one by one
    lines[40] = ",".join(cells)
    path = tmp_path / "log.csv"
    path.write_text("\n".join(lines))
    (file,) = inspect_log(path).files
    assert file.rows == 59
    assert any("is not a number" in note for note in file.notes)


def test_what_is_no_text_in_a_file_can_be_written_as_json(tmp_path):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        for name, values in wide_table().head(60).items():
            file[f"dvl/{name}"] = values.to_numpy()
        file["dvl/u_mps"].attrs.create("units", "m\udc9cu".encode(errors="surrogateescape"))
    report = inspect_log(path)
    assert LogReport.model_validate_json(report.model_dump_json()) == report
    odd = ColumnReport(name="a\udc9c", unit="m\udc9cu")
    assert odd.name == "a\\udc9c" and "udc9cu" in odd.model_dump_json()
