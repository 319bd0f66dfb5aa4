"""One table of a log file (text, Parquet, or a container of many): columns, values on demand."""

import re
import unicodedata
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
from pyarrow import parquet

from auvident.errors import InputError
from auvident.storage.log_csv import Kind, LogTable, numbered, read_csv
from auvident.storage.log_layout import (
    MISSING,
    NUMBER,
    TIME_NAMES,
    Layout,
    find_layout,
    is_missing,
)
from auvident.storage.log_text import HEAD_BYTES, LONG_HEAD_BYTES, read_text
from auvident.storage.log_time import MISSING_COUNT
from auvident.storage.readers.interface import DAMAGED_REMEDY, Container, LogReader, TableHead
from auvident.storage.readers.registry import container_suffixes, find_reader, open_container
from auvident.storage.regular import MEGABYTE, refuse_irregular

TEXT_SUFFIXES = (".csv", ".tsv", ".csv.gz", ".tsv.gz")
PARQUET_SUFFIXES = (".parquet", ".pq")
LOG_SUFFIXES = (*TEXT_SUFFIXES, *PARQUET_SUFFIXES)  # looked for in folders
OTHER_SUFFIXES = (".txt.gz", ".txt", ".dat", ".log")  # read when named by the user
PARQUET_MAGIC = b"PAR1"
# A table that repeats itself packs into nothing; noise does not. Only a bomb is beyond both.
MOST_TIMES = 100
MOST_UNPACKED = 256 * MEGABYTE
CELL_BYTES = 8
UNNAMED_INDEX = "__index_level_0__"  # as pandas writes it to Parquet
MOST_COLUMNS = 10_000
# What a browser, a file manager or a logger that begins a new file adds to a name. A number of
# three digits or more is a date, a propeller rate or a run.
ADDED = re.compile(
    r"(?P<of>.+?)(?:[\s_-]*(?:\(\d+\)|(?:part|pt)[\s_-]*\d+|-?\s*copy(?:\s*\(\d+\))?)|[\s_-]+\d\d?)",
    re.IGNORECASE,
)


@dataclass(frozen=True)
class LogFile:
    """A table of a log file whose columns are known; most files have one.

    Attributes
    ----------
    path : Path
        The file.
    names : tuple of str
        Names of its columns, as in the file.
    units : tuple of str
        Units from brackets, a units row or Parquet metadata; "" where none.
    layout : Layout or None
        Layout of a text file; None for others.
    topic : str
        Name of the table in a container file; "" for files of one table.
    time : str
        Time column that the container states; "" where it is found by its name.
    container : Container or None
        The opened container.
    """

    path: Path
    names: tuple[str, ...]
    units: tuple[str, ...]
    layout: Layout | None
    topic: str = ""
    time: str = ""
    container: Container | None = field(default=None, compare=False, repr=False)

    @property
    def where(self) -> str:
        """File, and table of it, for messages."""
        return f"{self.path}, topic {self.topic}" if self.topic else str(self.path)

    @property
    def label(self) -> str:
        """Name for lists, without the folder."""
        return self.topic or self.path.name

    @property
    def stem(self) -> str:
        """Name without folder, endings and topics above it (``/nav/dvl`` -> ``dvl``)."""
        return self.topic.rpartition("/")[2] if self.topic else stem(self.path)

    def find(self, name: str) -> str | None:
        """Name in the file of a column, case ignored unless that is ambiguous.

        Letters with marks may be one sign or two (NFC, NFD), as editors and systems have it.
        """
        if name in self.names:
            return name
        for spelled in (_composed, _plain):
            same = [own for own in self.names if spelled(own) == spelled(name)]
            if len(same) == 1:
                return same[0]
        return None

    def refuse_twice(self, names: Collection[str]) -> None:
        """Refuse columns of which there are two of one name: no map could tell them apart.

        Raises
        ------
        InputError
        """
        for name in names:
            if self.names.count(name) > 1:
                raise InputError(f"has two columns named {name}", self.where, "Rename one of them.")

    def unit_of(self, name: str) -> str:
        """Unit that the file states beside the name of a column, or ""."""
        return self.units[self.names.index(name)]


def _composed(name: str) -> str:
    return unicodedata.normalize("NFC", name)


def _plain(name: str) -> str:
    return _composed(name).strip().lower()


def stem(path: Path) -> str:
    """Name of a log file without its endings (``a.csv.gz`` -> ``a``)."""
    lower = path.name.lower()
    own = next((s for s in (*LOG_SUFFIXES, *OTHER_SUFFIXES) if lower.endswith(s)), None)
    suffix = own or next((s for s in container_suffixes() if lower.endswith(s)), path.suffix)
    return path.name[: -len(suffix)] if suffix else path.name


def log_name(path: Path) -> str:
    """Name of the log that a file is a part of, lower case (``dvl (1).csv`` -> ``dvl``)."""
    found = ADDED.fullmatch(stem(path))
    return (found["of"] if found else stem(path)).lower()


def looks_like_log(path: Path) -> bool:
    """Whether a file of a folder is taken for a log by its name."""
    if path.name.startswith(".") or not path.is_file():
        return False
    return path.name.lower().endswith(LOG_SUFFIXES) or is_container(path)


def is_container(path: Path) -> bool:
    """Whether a file holds tables that a reader of another logger's format opens."""
    return _reader(path) is not None


def _reader(path: Path) -> LogReader | None:
    """The reader of a container; CSV and Parquet are read here, and no reader is asked."""
    return None if path.name.lower().endswith(LOG_SUFFIXES) else find_reader(path)


def open_logs(path: Path, time_names: Collection[str] = ()) -> tuple[LogFile, ...]:
    """Tables of a log file: one of a text or Parquet file, all of a container.

    Raises
    ------
    InputError
        As `open_log`, and where the library of a container's format is missing.
    """
    reader = _reader(path)
    if reader is None:
        return (open_log(path, time_names),)
    container = open_container(path, reader)
    if not container.tables:
        told = "; ".join(container.notes)
        problem = f"has no table that can be read{told and f': {told}'}"
        raise InputError(problem, str(path), DAMAGED_REMEDY)
    return tuple(_table_of(path, container, head) for head in container.tables.values())


def _table_of(path: Path, container: Container, head: TableHead) -> LogFile:
    units = tuple(column.unit for column in head.columns)
    return LogFile(path, head.names, units, None, head.name, head.time, container)


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
    log = _open_parquet(path) if _is_parquet(path) else _open_text(path, time_names)
    if len(log.names) > MOST_COLUMNS:
        raise InputError(
            f"has {len(log.names)} columns", str(path), f"A log has {MOST_COLUMNS} at most."
        )
    return log


def _open_text(path: Path, time_names: Collection[str]) -> LogFile:
    head, _ = read_text(path, HEAD_BYTES)
    if head.count(b"\n") < 2:
        head, _ = read_text(path, LONG_HEAD_BYTES)
    names = {*TIME_NAMES, *(name.lower() for name in time_names)}
    layout = find_layout(head.decode(errors="replace"), str(path), names)
    return LogFile(path, layout.names, layout.units, layout)


def read_log(log: LogFile, wanted: Mapping[str, Kind | None]) -> LogTable:
    """Read columns of a log file; see `auvident.storage.log_csv.read_csv`."""
    log.refuse_twice(wanted)
    if log.container is not None:
        return _read_table(log, log.container, wanted)
    if log.layout is not None:
        return read_csv(log.path, log.layout, wanted)
    return _read_parquet(log, wanted)


def _is_parquet(path: Path) -> bool:
    refuse_irregular(path)
    try:
        with path.open("rb") as stream:
            return stream.read(4) == PARQUET_MAGIC
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror}", str(path)) from error


def _open_parquet(path: Path) -> LogFile:
    try:
        schema = parquet.read_schema(path)
        names = tuple(schema.names)
    except UnicodeDecodeError as error:
        raise InputError(
            "has a column whose name is not UTF-8", str(path), "Export it again."
        ) from error
    except (pa.ArrowException, OSError) as error:
        raise InputError(
            f"is damaged Parquet: {error}", str(path), "Its end is missing when it was not closed."
        ) from error
    units = tuple(
        (field.metadata or {}).get(b"unit", b"").decode(errors="replace") for field in schema
    )
    return LogFile(path, names, units, None, time=_index_of_time(schema))


def _index_of_time(schema: pa.Schema) -> str:
    """The index of a data frame, where it has no name, holds times, and no column is called so."""
    if any(name.strip().lower() in TIME_NAMES for name in schema.names):
        return ""
    kinds = [field.type for field in schema if field.name == UNNAMED_INDEX]
    is_time = any(pa.types.is_timestamp(kind) or pa.types.is_duration(kind) for kind in kinds)
    return UNNAMED_INDEX if is_time else ""


def _read_parquet(log: LogFile, wanted: Mapping[str, Kind | None]) -> LogTable:
    _refuse_bomb(log.path, wanted)
    columns, rows = {}, 0
    for name, kind in wanted.items():  # one by one: a long log need not be in memory twice
        try:
            table = parquet.read_table(log.path, columns=[name], pre_buffer=False)
        except (pa.ArrowException, OSError) as error:
            raise InputError(f"is damaged Parquet: {error}", str(log.path)) from error
        rows = len(table)
        if rows == 0:
            raise InputError("has column names but no data", str(log.path))
        columns[name] = _parquet_column(table.column(name), kind, name, log.path)
        del table
        pa.default_memory_pool().release_unused()
    return LogTable(columns, numbered(1, rows), rows)


def _refuse_bomb(path: Path, wanted: Collection[str]) -> None:
    """Refuse a small file whose columns fill the memory."""
    try:
        about = parquet.read_metadata(path)
        # of all columns: asked for a single one that is damaged, pyarrow ends the process
        said = sum(about.row_group(k).total_byte_size for k in range(about.num_row_groups))
        packed = path.stat().st_size
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
        raise InputError(f"is damaged Parquet: {error}", str(path)) from error
    unpacked = max(said, CELL_BYTES * about.num_rows * len(wanted))
    if unpacked > max(MOST_UNPACKED, MOST_TIMES * packed):
        raise InputError(
            f"unpacks to {unpacked // MEGABYTE} MB, more than {MOST_TIMES} times its size, which "
            "no log does",
            str(path),
            "Check its content: its columns repeat one value.",
        )


def _read_table(log: LogFile, container: Container, wanted: Mapping[str, Kind | None]) -> LogTable:
    found = container.read(log.topic, list(wanted))
    count = min((values.size for values in found.values()), default=0)
    if count == 0:
        raise InputError("has columns but no rows", log.where)
    columns = {name: _stored(found[name], kind, name, log) for name, kind in wanted.items()}
    return LogTable(columns, np.arange(1, count + 1), count)


def _stored(values: np.ndarray, kind: Kind | None, name: str, log: LogFile) -> np.ndarray:
    """Values of a container as the rest of the program has them: float64, int64, text, instants."""
    letter = values.dtype.kind
    if letter == "M":
        return values
    if letter == "i" and kind is None:
        return values.astype(np.int64)
    if letter in "OUS":
        texts = pd.Series(values, dtype=object).fillna("").astype(str)
        return _of_texts(texts, kind, name, log.path)
    if letter in "biuf":
        return values.astype(float)
    raise InputError(f"column {name} holds {values.dtype}, not numbers", log.where)


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
        return _of_texts(texts, kind, name, path)
    raise InputError(
        f"column {name} holds {kind_of}, not numbers", str(path), "Store it as numbers."
    )


def _floats(column: pa.ChunkedArray) -> np.ndarray:
    """Numbers, the nearest a float can hold; NaN where null."""
    numbers = column.cast(pa.float64(), safe=False).to_numpy()
    return numbers if numbers.flags.writeable else numbers.copy()


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


def _of_texts(texts: pd.Series, kind: Kind | None, name: str, path: Path) -> np.ndarray:
    """Numbers where they are wanted, or where all of the text is numbers; else the text."""
    if kind is None:
        known = (text.strip() for text in texts.tolist() if not is_missing(text))
        kind = "number" if all(map(NUMBER.fullmatch, known)) else "text"
    return _numbers(texts, name, path) if kind == "number" else texts.to_numpy(object)


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
