"""Columns of Parquet files as arrays, against what pandas and pyarrow make of the same files."""

from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from auvident.errors import StageError
from auvident.storage.artifacts import parquet_bytes, read_arrays
from auvident.storage.columns import arrow_of, read_columns

ROWS = 77


def table() -> pd.DataFrame:
    """Numbers with gaps, flags and counts, of a number of rows that fills no byte."""
    rng = np.random.default_rng(7)
    values = rng.normal(size=(ROWS, 2))
    values[rng.random((ROWS, 2)) < 0.3] = np.nan
    return pd.DataFrame(
        {
            "time_s": np.arange(ROWS) / 10.0,
            "u_mps": values[:, 0],
            "none": np.full(ROWS, np.nan),
            "endless": np.where(np.isnan(values[:, 1]), np.inf, values[:, 1]),
            "dvl_sampled": rng.random(ROWS) < 0.5,
            "record": rng.integers(-1, 9, ROWS),
        }
    )


@pytest.mark.parametrize("rows_of_a_group", [ROWS, 13])
def test_what_is_read_is_what_pandas_reads(tmp_path: Path, rows_of_a_group: int) -> None:
    path, expected = tmp_path / "t.parquet", table()
    pq.write_table(pa.Table.from_pandas(expected), path, row_group_size=rows_of_a_group)
    found = read_columns(path)
    pd.testing.assert_frame_equal(pd.DataFrame(found), expected, check_exact=True)
    assert not any(values.flags.writeable for values in found.values())


def test_what_is_written_is_what_pandas_would_write() -> None:
    frame = table().assign(symbol=["Y_uv", "", "ü"] * 25 + ["a", "b"])
    columns = {str(name): values.to_numpy() for name, values in frame.items()}
    expected = pa.Table.from_pandas(frame, preserve_index=False)
    assert arrow_of(columns).equals(expected)


def test_fixed_width_texts_and_no_rows(tmp_path: Path) -> None:
    path = tmp_path / "t.parquet"
    columns = {"maneuver": np.full(3, "a"), "std_u_mps": np.array([0.1, np.nan, 0.3])}
    path.write_bytes(parquet_bytes(columns, {}))
    found = pd.read_parquet(path)
    assert found["maneuver"].tolist() == ["a", "a", "a"]
    assert found["std_u_mps"].isna().tolist() == [False, True, False]
    assert pq.read_schema(path).field("std_u_mps").metadata[b"unit"] == b"m/s"
    path.write_bytes(parquet_bytes({name: values[:0] for name, values in columns.items()}, {}))
    assert len(pd.read_parquet(path)) == 0


@pytest.mark.parametrize(
    ("column", "says"),
    [
        (pa.array(["a", "b"]), "u_mps are of the type string"),
        (pa.array([True, None]), "u_mps are of the type bool, 1 of them missing"),
        (pa.array([1, None], pa.int64()), "u_mps are of the type int64, 1 of them missing"),
    ],
)
def test_other_columns_are_refused(tmp_path: Path, column: pa.Array, says: str) -> None:
    path = tmp_path / "t.parquet"
    pq.write_table(pa.table({"u_mps": column}), path)
    with pytest.raises(StageError, match=says):
        read_arrays(path, "Make it again.")


def test_missing_and_damaged_files(tmp_path: Path) -> None:
    with pytest.raises(StageError, match="is missing"):
        read_arrays(tmp_path / "none.parquet")
    (tmp_path / "t.parquet").write_bytes(b"PAR1 no more")
    with pytest.raises(StageError, match="cannot be read"):
        read_arrays(tmp_path / "t.parquet")
