"""Tables of files that hold arrays in a tree: which arrays are columns of one table."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from auvident.errors import InputError
from auvident.storage.log_layout import TIME_NAMES
from auvident.storage.log_time import MISSING_COUNT, MOST_COUNT
from auvident.storage.log_time_names import TIME_ALIASES
from auvident.storage.readers.interface import (
    DAMAGED_REMEDY,
    ColumnHead,
    TableHead,
    ns_of_counts,
    ns_of_seconds,
)

MOST_VALUES = 200_000_000  # of one array: three weeks at 100 Hz; more is no log, or damage
MOST_WIDE = 16  # numbers in a row of an array: vectors and small matrices are columns, images not
STAMPS = frozenset((*TIME_NAMES, *TIME_ALIASES))
EPOCH_WORD = " since "
UNIT_WORDS = {  # of "seconds since 2024-05-01" (CF conventions 4.4)
    "s": 1.0,
    "sec": 1.0,
    "secs": 1.0,
    "second": 1.0,
    "seconds": 1.0,
    "ms": 1e-3,
    "msec": 1e-3,
    "millisecond": 1e-3,
    "milliseconds": 1e-3,
    "us": 1e-6,
    "microsecond": 1e-6,
    "microseconds": 1e-6,
    "ns": 1e-9,
    "nanosecond": 1e-9,
    "nanoseconds": 1e-9,
    "min": 60.0,
    "minute": 60.0,
    "minutes": 60.0,
    "h": 3600.0,
    "hour": 3600.0,
    "hours": 3600.0,
    "d": 86400.0,
    "day": 86400.0,
    "days": 86400.0,
}


@dataclass(frozen=True)
class Field:
    """An array of a file.

    Attributes
    ----------
    path : tuple of str
        Groups above it, and its name.
    shape : tuple of int
        Of the array, axes of length 1 left out; the first is that of the rows.
    dtype : numpy.dtype
    load : callable
        Returns the array in that shape.
    unit : str
        As the file states it.
    stamp : str
        "yes", "no", or "" where its name decides whether it is a time.
    axis : str
        Name of the axis of its rows, where the file names axes.
    """

    path: tuple[str, ...]
    shape: tuple[int, ...]
    dtype: np.dtype
    load: Callable[[], np.ndarray]
    unit: str = ""
    stamp: str = ""
    axis: str = ""

    @property
    def is_time(self) -> bool:
        """Whether it looks like the time of a table."""
        if self.stamp:
            return self.stamp == "yes"
        return len(self.shape) == 1 and self.path[-1].strip().lower() in STAMPS


@dataclass(frozen=True)
class Tree:
    """A container of arrays in a tree, each read when it is asked for."""

    path: Path
    tables: dict[str, TableHead]
    columns: dict[str, dict[str, Callable[[], np.ndarray]]] = field(repr=False)
    notes: tuple[str, ...] = ()

    def read(self, table: str, columns: Sequence[str]) -> dict[str, np.ndarray]:
        """Columns of a table."""
        try:
            return {name: self.columns[table][name]() for name in columns}
        except InputError:
            raise
        except Exception as error:  # the libraries raise whatever a damaged file leads them into
            told = str(error) or type(error).__name__
            raise InputError(
                f"is damaged: {told}", f"{self.path}, {table}", DAMAGED_REMEDY
            ) from error


def tree_of(path: Path, fields: Sequence[Field], root: str, mark: str, notes: list[str]) -> Tree:
    """Tables of a tree: what has one time, or else stands in one group and is of one length.

    Parameters
    ----------
    path : Path
    fields : sequence of Field
    root : str
        Name of the table of what stands in no group.
    mark : str
        Between the names of groups.
    notes : list of str
        What could not be read; what is left out here is added.
    """
    timed = {(f.path[:-1], f.shape[0]) for f in fields if f.is_time}
    groups: dict[tuple[tuple[str, ...], str, int], list[Field]] = {}
    for one in fields:
        if len(one.shape) > 2 or (len(one.shape) == 2 and one.shape[1] > MOST_WIDE):
            notes.append(f"{mark.join(one.path)} of shape {one.shape} is not a column")
        elif int(np.prod(one.shape)) > MOST_VALUES:
            notes.append(f"{mark.join(one.path)} is said to hold {np.prod(one.shape)} values")
        else:
            owner = _owner(one, timed)
            groups.setdefault((owner, one.axis, one.shape[0]), []).append(one)
    heads, columns = {}, {}
    several = _several(groups)
    for (owner, axis, length), own in groups.items():
        name = _name(owner, axis, own, root, mark, owner in several)
        heads[name], columns[name] = _table(name, owner, own, length)
    return Tree(path, heads, columns, tuple(notes))


def _several(
    groups: Mapping[tuple[tuple[str, ...], str, int], list[Field]],
) -> set[tuple[str, ...]]:
    """Groups with arrays of several lengths or axes."""
    owners = [owner for owner, _, _ in groups]
    return {owner for owner in owners if owners.count(owner) > 1}


def _owner(one: Field, timed: set[tuple[tuple[str, ...], int]]) -> tuple[str, ...]:
    """The nearest group above an array that has a time of its length, else its own."""
    own = one.path[:-1]
    above = (own[:k] for k in range(len(own), -1, -1))
    return next((group for group in above if (group, one.shape[0]) in timed), own)


def _name(
    owner: tuple[str, ...], axis: str, own: list[Field], root: str, mark: str, several: bool
) -> str:
    group = mark.join(owner)
    if not several:
        return group or axis or root
    part = axis or next((f.path[-1] for f in own if f.is_time), own[0].path[-1])
    return f"{group}{mark}{part}" if group else part


def _table(
    name: str, owner: tuple[str, ...], own: list[Field], length: int
) -> tuple[TableHead, dict[str, Callable[[], np.ndarray]]]:
    heads: list[ColumnHead] = []
    loads: dict[str, Callable[[], np.ndarray]] = {}
    time = ""
    for one in own:
        base = ".".join(one.path[len(owner) :])
        if len(one.shape) == 1:
            heads.append(ColumnHead(base, str(one.dtype), _label(one)))
            loads[base] = one.load
            time = time or (base if one.stamp == "yes" else "")
            continue
        for k in range(one.shape[1]):
            part = f"{base}[{k}]"
            heads.append(ColumnHead(part, str(one.dtype), one.unit))
            loads[part] = _part(one.load, k)
    return TableHead(name, tuple(heads), length, time), loads


def _label(one: Field) -> str:
    return "" if EPOCH_WORD in one.unit else one.unit


def _part(load: Callable[[], np.ndarray], k: int) -> Callable[[], np.ndarray]:
    return lambda: load()[:, k]


# --- time ---------------------------------------------------------------------------------


def is_time_unit(unit: str) -> bool:
    """Whether a unit is one of time that names the instant from which it counts."""
    word, _, origin = unit.strip().partition(EPOCH_WORD)
    return bool(origin) and word.strip().lower() in UNIT_WORDS


def instants(values: np.ndarray, unit: str, where: str) -> np.ndarray:
    """Counts of a unit such as ``seconds since 2024-05-01 12:00`` as ``datetime64[ns]``.

    Raises
    ------
    InputError
        When the instant from which it counts cannot be read.
    """
    word, _, origin = unit.strip().partition(EPOCH_WORD)
    start = _instant(origin.strip(), unit, where)
    size = UNIT_WORDS[word.strip().lower()]
    if values.dtype.kind in "iu" and round(size * 1e9) == size * 1e9:
        ns = ns_of_counts(values, round(size * 1e9))
    else:
        ns = ns_of_seconds(values.astype(float) * size)
    found = start + np.where(ns == MISSING_COUNT, 0, ns).astype("timedelta64[ns]")
    found[ns == MISSING_COUNT] = np.datetime64("NaT")
    return found


def _instant(text: str, unit: str, where: str) -> np.datetime64:
    try:
        found = np.datetime64(pd.to_datetime(text, utc=True).tz_convert(None), "ns")
        if abs(found.astype(np.int64)) > MOST_COUNT:
            raise OverflowError("beyond what counts of ns since 1970 hold")
        return found
    except (ValueError, TypeError, OverflowError) as error:
        raise InputError(
            f"the time unit {unit!r} does not count from a date that can be read",
            where,
            'Write "seconds since 1970-01-01T00:00:00Z", or seconds.',
        ) from error
