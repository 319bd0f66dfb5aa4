"""What a reader of a container file has to offer: its tables, and their columns on demand."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from auvident.storage.log_time import MISSING_COUNT, MOST_COUNT

STAMP = "timestamp_ns"  # of a table: when the container says that a row was written, int64
DAMAGED_REMEDY = "Copy the file again from where it was written, or export it again."
MOST_S = MOST_COUNT // 10**9  # the year 2116: a stamp beyond it is none


@dataclass(frozen=True)
class ColumnHead:
    """A column of a table.

    Attributes
    ----------
    name : str
        Name; fields of fields are joined by dots (``twist.linear.x``), elements of an array
        numbered (``xyz[0]``).
    dtype : str
        Name of its numpy dtype; "object" for text.
    unit : str
        Unit that the container states, in any spelling; "" where it states none.
    """

    name: str
    dtype: str = "float64"
    unit: str = ""


@dataclass(frozen=True)
class TableHead:
    """A table of a container: a topic, a group, a kind of message.

    Attributes
    ----------
    name : str
        By which ``topic`` in a map addresses it.
    columns : tuple of ColumnHead
        Its columns; time is one of them.
    rows : int
        How many there are, as far as the container tells before they are read.
    time : str
        Column that stamps the rows; "" when the reader knows of none. `STAMP` is the usual name
        where the container itself stamps messages.
    notes : tuple of str
        What is worth knowing of it, a sentence each.
    axes : str
        "flu" where the convention of the format is forward, port, up in east, north, up; "" where
        it is that of the program, or where there is none. Only the proposed map knows of it.
    kind : str
        Name of the type of its rows, for people; "" where that says nothing.
    """

    name: str
    columns: tuple[ColumnHead, ...]
    rows: int
    time: str = STAMP
    notes: tuple[str, ...] = ()
    axes: str = ""
    kind: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(column.name for column in self.columns)


class Container(Protocol):
    """An opened file.

    Attributes
    ----------
    tables : mapping of str to TableHead
        By name, in the order of the file.
    notes : tuple of str
        What could not be read of the file, a sentence each; damage is told, not hidden.
    """

    @property
    def tables(self) -> Mapping[str, TableHead]:
        """Tables by name."""

    @property
    def notes(self) -> tuple[str, ...]:
        """What could not be read."""

    def read(self, table: str, columns: Sequence[str]) -> dict[str, np.ndarray]:
        """Columns of a table, shape (n,) each.

        Numbers as they are stored (time stamps as int64 counts or float), NaN where there is no
        value, objects for text, ``datetime64`` for instants.

        Raises
        ------
        InputError
            When the file is damaged where they stand.
        """


class LogReader(Protocol):
    """A format.

    Attributes
    ----------
    name : str
        Of the format, for people: "ROS 1 bag".
    """

    name: str

    def __hash__(self) -> int:
        """Opened files are remembered by their reader: a plain object will do."""

    def matches(self, path: Path, head: bytes) -> bool:
        """Whether a file is of this format, by its name and its first `HEAD` bytes."""

    def open(self, path: Path) -> Container:
        """Find the tables of a file.

        Raises
        ------
        InputError
            When a library is missing (with the extra that has it), or the file is damaged.
        """


@dataclass(frozen=True)
class Tables:
    """A container whose columns are all in memory already.

    Attributes
    ----------
    tables : dict of str to TableHead
        By name.
    columns : dict of str to dict of str to numpy.ndarray
        Columns by table.
    notes : tuple of str
        What could not be read.
    """

    tables: dict[str, TableHead]
    columns: dict[str, dict[str, np.ndarray]]
    notes: tuple[str, ...] = ()

    def read(self, table: str, columns: Sequence[str]) -> dict[str, np.ndarray]:
        """Columns of a table."""
        return {name: self.columns[table][name] for name in columns}


def in_memory(
    columns: Mapping[str, Mapping[str, np.ndarray]],
    time: Mapping[str, str] | None = None,
    units: Mapping[tuple[str, str], str] | None = None,
    notes: tuple[str, ...] = (),
) -> Tables:
    """A container of arrays.

    Parameters
    ----------
    columns : mapping of str to mapping of str to numpy.ndarray
        Columns by table, shape (n,) each within a table.
    time : mapping of str to str, optional
        Time column by table; `STAMP` where there is such a column, else "".
    units : mapping of tuple of str to str, optional
        Units by table and column.
    notes : tuple of str
        What could not be read.
    """
    time, units = time or {}, units or {}
    tables = {
        name: TableHead(
            name,
            tuple(ColumnHead(c, str(a.dtype), units.get((name, c), "")) for c, a in table.items()),
            len(next(iter(table.values()), ())),
            time.get(name, STAMP if STAMP in table else ""),
        )
        for name, table in columns.items()
    }
    return Tables(tables, {name: dict(table) for name, table in columns.items()}, notes)


def ns_of_seconds(seconds: np.ndarray, start_s: int = 0) -> np.ndarray:
    """Stamps in s, after a whole second, as int64 counts of ns; none where no clock shows that.

    The whole seconds and the rest apart: a float of nanoseconds since 1970 is short of digits.
    """
    known = np.abs(seconds) <= MOST_S
    safe = np.where(known, seconds, 0.0)
    whole = np.floor(safe)
    rest = np.rint((safe - whole) * 1e9).astype(np.int64)
    return np.where(known, (whole.astype(np.int64) + start_s) * 10**9 + rest, MISSING_COUNT)


def ns_of_counts(counts: np.ndarray, ns_each: int) -> np.ndarray:
    """Whole counts of so many ns each as int64 counts of ns; none where 64 bits do not hold it."""
    most = MOST_COUNT // ns_each
    known = (counts <= most) & (counts >= -most)
    return np.where(known, np.where(known, counts, 0).astype(np.int64) * ns_each, MISSING_COUNT)
