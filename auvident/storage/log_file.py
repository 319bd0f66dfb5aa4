"""One log file, text or Parquet: its columns, and their values on demand."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
from pyarrow import parquet

from auvident.errors import InputError
from auvident.storage.log_csv import Kind, LogTable, read_csv
from auvident.storage.log_layout import MISSING, TIME_NAMES, Layout, find_layout
from auvident.storage.log_text import HEAD_BYTES, read_text
from auvident.storage.log_time import MISSING_COUNT

TEXT_SUFFIXES = (".csv", ".tsv", ".csv.gz", ".tsv.gz")
PARQUET_SUFFIXES = (".parquet", ".pq")
LOG_SUFFIXES = (*TEXT_SUFFIXES, *PARQUET_SUFFIXES)  # looked for in folders
OTHER_SUFFIXES = (".txt.gz", ".txt", ".dat", ".log")  # read when named by the user
PARQUET_MAGIC = b"PAR1"


@dataclass(frozen=True)
class LogFile:
    """A log file whose columns are known.

    Attributes
    ----------
    path : Path
        The file.
    names : tuple of str
        Names of its columns, as in the file.
    units : tuple of str
        Units from brackets, a units row or Parquet metadata; "" where none.
    layout : Layout or None
        Layout of a text file; None for Parquet.
    """

    path: Path
    names: tuple[str, ...]
    units: tuple[str, ...]
    layout: Layout | None

    def find(self, name: str) -> str | None:
        """Name in the file of a column, case ignored unless that is ambiguous."""
        if name in self.names:
            return name
        same = [own for own in self.names if own.strip().lower() == name.strip().lower()]
        return same[0] if len(same) == 1 else None

    def unit_of(self, name: str) -> str:
        """Unit that the file states beside the name of a column, or ""."""
        return self.units[self.names.index(name)]


def stem(path: Path) -> str:
    """Name of a log file without its endings (``a.csv.gz`` -> ``a``)."""
    lower = path.name.lower()
    for suffix in (*LOG_SUFFIXES, *OTHER_SUFFIXES):
        if lower.endswith(suffix):
            return path.name[: -len(suffix)]
    return path.stem


def looks_like_log(path: Path) -> bool:
    """Whether a file of a folder is taken for a log by its name."""
    is_hidden = path.name.startswith(".")
    return path.is_file() and not is_hidden and path.name.lower().endswith(LOG_SUFFIXES)


def open_log(path: Path, time_names: Collection[str] = ()) -> LogFile:
    """Find the columns of a log file.

    Parameters
    ----------
    path : Path
        CSV (plain or gzip) or Parquet, told apart by content.
    time_names : collection of str
        Further names of time columns, from the map.

    Raises
    ------
    InputError
        When the file is empty, no log, or has no column names.
    """
    if _is_parquet(path):
        return _open_parquet(path)
    head, _ = read_text(path, HEAD_BYTES)
    names = {*TIME_NAMES, *(name.lower() for name in time_names)}
    layout = find_layout(head.decode(errors="replace"), str(path), names)
    return LogFile(path, layout.names, layout.units, layout)


def read_log(log: LogFile, wanted: Mapping[str, Kind | None]) -> LogTable:
    """Read columns of a log file; see `auvident.storage.log_csv.read_csv`."""
    for name in wanted:
        if log.names.count(name) > 1:
            raise InputError(f"has two columns named {name}", str(log.path), "Rename one of them.")
    if log.layout is not None:
        return read_csv(log.path, log.layout, wanted)
    return _read_parquet(log, wanted)


def _is_parquet(path: Path) -> bool:
    try:
        with path.open("rb") as stream:
            return stream.read(4) == PARQUET_MAGIC
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", str(path)) from error


def _open_parquet(path: Path) -> LogFile:
    try:
        schema = parquet.read_schema(path)
    except (pa.ArrowException, OSError) as error:
        raise InputError(
            f"is damaged Parquet: {error}", str(path), "Its end is missing when it was not closed."
        ) from error
    units = tuple(
        (field.metadata or {}).get(b"unit", b"").decode(errors="replace") for field in schema
    )
    return LogFile(path, tuple(schema.names), units, None)


def _read_parquet(log: LogFile, wanted: Mapping[str, Kind | None]) -> LogTable:
    try:
        table = parquet.read_table(log.path, columns=list(wanted))
    except (pa.ArrowException, OSError) as error:
        raise InputError(f"is damaged Parquet: {error}", str(log.path)) from error
    if len(table) == 0:
        raise InputError("has column names but no data", str(log.path))
    rows = np.arange(1, len(table) + 1)
    columns = {
        name: _parquet_column(table.column(name), kind, name, log.path)
        for name, kind in wanted.items()
    }
    return LogTable(columns, rows, len(table))


def _parquet_column(
    column: pa.ChunkedArray, kind: Kind | None, name: str, path: Path
) -> np.ndarray:
    kind_of = column.type
    if pa.types.is_timestamp(kind_of):
        return _instants(column)
    if pa.types.is_duration(kind_of) and kind is None:
        return column.to_numpy()
    if pa.types.is_integer(kind_of) and kind is None:
        return _counts(column)
    if pa.types.is_boolean(kind_of) or pa.types.is_integer(kind_of) or pa.types.is_null(kind_of):
        return _floats(column)
    if pa.types.is_floating(kind_of) or pa.types.is_decimal(kind_of):
        return _floats(column)
    if pa.types.is_dictionary(kind_of):
        column, kind_of = column.cast(kind_of.value_type), kind_of.value_type
    if pa.types.is_string(kind_of) or pa.types.is_large_string(kind_of):
        texts = column.to_pandas().astype(object).fillna("")
        return _numbers(texts, name, path) if kind == "number" else texts.to_numpy(object)
    raise InputError(
        f"column {name} holds {kind_of}, not numbers", str(path), "Store it as numbers."
    )


def _floats(column: pa.ChunkedArray) -> np.ndarray:
    """Numbers, the nearest a float can hold; NaN where null."""
    return column.cast(pa.float64(), safe=False).to_numpy().astype(float)


def _counts(column: pa.ChunkedArray) -> np.ndarray:
    """Integers as they are, for they may be stamps of nanoseconds that no float can hold."""
    if pa.types.is_unsigned_integer(column.type):  # the largest numbers are fillers, no times
        most = np.iinfo(np.int64).max
        wide = column.cast(pa.uint64()).fill_null(2**64 - 1).to_numpy()
        return np.where(wide > most, MISSING_COUNT, np.minimum(wide, most).astype(np.int64))
    return column.cast(pa.int64()).fill_null(int(MISSING_COUNT)).to_numpy()


def _instants(column: pa.ChunkedArray) -> np.ndarray:
    """Instants as ``datetime64`` in UTC; those without a zone are taken for UTC."""
    return column.cast(pa.timestamp(column.type.unit)).to_numpy()


def _numbers(texts: pd.Series, name: str, path: Path) -> np.ndarray:
    numbers = pd.to_numeric(texts, errors="coerce").to_numpy(dtype=float, copy=True)
    wrong = np.flatnonzero(np.isnan(numbers) & ~texts.str.strip().str.lower().isin(MISSING))
    if wrong.size:
        raise InputError(
            f"{texts.iloc[wrong[0]]!r} in column {name} is not a number",
            f"{path}, row {wrong[0] + 1}",
            "Store numbers, and null where there is no value.",
        )
    return numbers
