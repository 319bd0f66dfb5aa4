"""ArduPilot DataFlash (``.bin``): messages that the log itself describes.

A message begins with two magic bytes and its number; messages ``FMT`` give length, name, format and
column names of each number, ``FMTU``, ``UNIT`` and ``MULT`` the units. Formats:
https://ardupilot.org/dev/docs/code-overview-adding-a-new-log-message.html
"""

import mmap
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from auvident.errors import InputError
from auvident.storage.readers.interface import (
    DAMAGED_REMEDY,
    STAMP,
    ColumnHead,
    TableHead,
    ns_of_counts,
)

MAGIC = b"\xa3\x95"
FMT = 128  # number of the messages that describe messages
FMT_DTYPE = np.dtype([("number", "u1"), ("length", "u1"), ("name", "S4"), ("format", "S16"),
                      ("columns", "S64")])  # fmt: skip
HEADER = 3  # magic bytes and number
# Letter of a format -> numpy type, and what a unit of it is worth.
FORMATS: dict[str, tuple[str, float]] = {
    "a": ("(32,)<i2", 1.0),
    "b": ("i1", 1.0),
    "B": ("u1", 1.0),
    "h": ("<i2", 1.0),
    "H": ("<u2", 1.0),
    "i": ("<i4", 1.0),
    "I": ("<u4", 1.0),
    "q": ("<i8", 1.0),
    "Q": ("<u8", 1.0),
    "g": ("<f2", 1.0),
    "f": ("<f4", 1.0),
    "d": ("<f8", 1.0),
    "n": ("S4", 1.0),
    "N": ("S16", 1.0),
    "Z": ("S64", 1.0),
    "c": ("<i2", 0.01),
    "C": ("<u2", 0.01),
    "e": ("<i4", 0.01),
    "E": ("<u4", 0.01),
    "L": ("<i4", 1e-7),
    "M": ("u1", 1.0),
}
TIMES = {"TimeUS": 1_000, "TimeMS": 1_000_000}  # column of the time since switch-on -> ns
UNITS = {"degheading": "deg", "deglatitude": "deg", "deglongitude": "deg"}
WHOLE = "iu"  # kinds of numpy type of a time and of the number of a sensor
INSTANCE = "#"  # unit of the column that tells one of several equal sensors
NO_MULTIPLIER = ("-", "?", "")


@dataclass(frozen=True)
class DataFlashReader:
    """Logs of ArduPilot (``.bin``)."""

    name: str = "ArduPilot DataFlash"

    def matches(self, path: Path, head: bytes) -> bool:
        """By the first message, which describes the description."""
        return head.startswith(MAGIC + bytes([FMT]))

    def open(self, path: Path) -> "DataFlash":
        """Find the messages."""
        return DataFlash(path)


@dataclass(frozen=True)
class Format:
    """A kind of message: its name, columns, and how they are stored."""

    name: str
    length: int
    columns: tuple[str, ...]
    letters: str

    @cached_property
    def dtype(self) -> np.dtype:
        """Of a message after its header."""
        return np.dtype(
            [(c, FORMATS[x][0]) for c, x in zip(self.columns, self.letters, strict=True)]
        )

    def of_kind(self, kinds: str) -> tuple[str, ...]:
        """Columns of one value each, of these kinds of numpy type."""
        return tuple(c for c in self.columns if self.dtype[c].kind in kinds)


@dataclass
class Index:
    """Where the messages stand: offsets by number, formats by number, bytes of no message."""

    formats: dict[int, Format] = field(default_factory=dict)
    offsets: dict[int, list[int]] = field(default_factory=dict)
    stray: int = 0
    places: int = 0
    unknown: set[str] = field(default_factory=set)


@dataclass
class DataFlash:
    """An opened log."""

    path: Path

    @property
    def tables(self) -> dict[str, TableHead]:
        """Kinds of messages; one for each of several equal sensors."""
        return {name: head for name, (head, _, _) in self._tables.items()}

    @property
    def notes(self) -> tuple[str, ...]:
        """Damage."""
        index, notes = self._index, []
        if index.stray:
            notes.append(f"{index.stray} bytes at {index.places} places belong to no message")
        if index.unknown:
            notes.append(f"formats that are not known: {', '.join(sorted(index.unknown))}")
        return tuple(notes)

    def read(self, table: str, columns: Sequence[str]) -> dict[str, np.ndarray]:
        """Columns of a kind of message."""
        _, number, rows = self._tables[table]
        values = self._values(number)
        return {name: values[name] if rows is None else values[name][rows] for name in columns}

    @cached_property
    def _data(self) -> mmap.mmap:
        with self.path.open("rb") as stream:
            return mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)

    @cached_property
    def _index(self) -> Index:
        found = _scan(self._data)
        if not found.formats:
            raise InputError(
                "is a damaged DataFlash log: describes no message", str(self.path), DAMAGED_REMEDY
            )
        return found

    @cached_property
    def _tables(self) -> dict[str, tuple[TableHead, int, np.ndarray | None]]:
        tables: dict[str, tuple[TableHead, int, np.ndarray | None]] = {}
        for number, offsets in self._index.offsets.items():
            kind = self._index.formats[number]
            units, ids = self._units(number), kind.of_kind(WHOLE)
            instance = next((c for c in ids if units.get(c) == INSTANCE), None)
            which = self._values(number)[instance] if instance else np.zeros(len(offsets))
            for one in np.unique(which):
                rows = np.flatnonzero(which == one) if instance else None
                alone = rows is None or rows.size == len(offsets)
                name = kind.name if alone else f"{kind.name}[{one:g}]"
                name = f"{name} ({number})" if name in tables else name
                count = len(offsets) if rows is None else rows.size
                tables[name] = (self._head(name, number, count), number, rows)
        return tables

    def _head(self, name: str, number: int, count: int) -> TableHead:
        units = self._units(number)
        heads = [
            ColumnHead(column, str(values.dtype), units.get(column, ""))
            for column, values in self._values(number, first=1).items()
        ]
        time = STAMP if heads and heads[0].name == STAMP else ""
        return TableHead(name, tuple(heads), count, time)

    def _values(self, number: int, first: int | None = None) -> dict[str, np.ndarray]:
        """All columns of a kind of message, or of the first few."""
        kind, data = self._index.formats[number], self._data
        offsets = self._index.offsets[number][:first]
        raw = b"".join(data[o + HEADER : o + kind.length] for o in offsets)
        table = np.frombuffer(raw, kind.dtype)
        found: dict[str, np.ndarray] = {}
        time = next((c for c in kind.of_kind(WHOLE) if c in TIMES), None)
        if time is not None:
            found[STAMP] = ns_of_counts(table[time], TIMES[time])
        for column, letter in zip(kind.columns, kind.letters, strict=True):
            found |= _column(column, table[column], FORMATS[letter][1])
        return found

    def _units(self, number: int) -> dict[str, str]:
        """Units of a kind of message, where its values are in them and in no multiple."""
        kind = self._index.formats[number]
        if number not in self._stated:
            return {}
        units, multipliers = self._stated[number]
        found = {}
        for column, letter, unit, by in zip(
            kind.columns, kind.letters, units, multipliers, strict=False
        ):
            factor = 1.0 if by in NO_MULTIPLIER else self._multipliers.get(by, np.nan)
            label = INSTANCE if unit == INSTANCE else self._labels.get(unit, "")
            if FORMATS[letter][1] != 1.0 or factor == 1.0 or label == INSTANCE:
                found[column] = UNITS.get(label, label)
        return found

    @cached_property
    def _stated(self) -> dict[int, tuple[str, str]]:
        """Letters of the units and multipliers of each kind of message."""
        rows = self._all("FMTU", ("FmtType", "UnitIds", "MultIds"))
        known = ((_number(number), units, by) for number, units, by in rows)
        return {int(n): (str(units), str(by)) for n, units, by in known if np.isfinite(n)}

    @cached_property
    def _labels(self) -> dict[str, str]:
        return {_letter(one): str(label) for one, label in self._all("UNIT", ("Id", "Label"))}

    @cached_property
    def _multipliers(self) -> dict[str, float]:
        return {_letter(one): _number(by) for one, by in self._all("MULT", ("Id", "Mult"))}

    def _all(self, name: str, columns: Sequence[str]) -> list[tuple]:
        for number, kind in self._index.formats.items():
            if kind.name != name or number not in self._index.offsets:
                continue
            values = self._values(number)
            if {*columns} <= {*values}:
                return list(zip(*(values[column] for column in columns), strict=True))
        return []


def _number(value: Any) -> float:
    """A number of a message; NaN where a damaged definition makes it something else."""
    try:
        return float(value)
    except (TypeError, ValueError):
        return float("nan")


def _letter(code: Any) -> str:
    """The letter of a unit or multiplier by its code; "" where it is none."""
    number = _number(code)
    return chr(int(number)) if 0.0 <= number < 128.0 else ""


def _column(name: str, values: np.ndarray, scale: float) -> dict[str, np.ndarray]:
    if values.ndim == 2:
        return {f"{name}[{i}]": values[:, i] for i in range(values.shape[1])}
    if values.dtype.kind == "S":
        texts = [text.decode("latin-1").strip("\0 ") for text in values.tolist()]
        return {name: np.array(texts, dtype=object)}
    return {name: values if scale == 1.0 else values * scale}


def _scan(data: mmap.mmap) -> Index:
    """Every message of a log; bytes between messages are counted and passed over."""
    index, position, end = Index(), 0, len(data)
    lengths = {FMT: HEADER + FMT_DTYPE.itemsize}
    while position + HEADER <= end:
        number = data[position + 2]
        length = lengths.get(number, 0)
        if data[position : position + 2] != MAGIC or not length or position + length > end:
            after = data.find(MAGIC, position + 1)
            after = end if after < 0 else after
            index.stray, index.places = index.stray + after - position, index.places + 1
            position = after
            continue
        if number == FMT:
            _describe(index, lengths, data[position + HEADER : position + length])
        if number in index.formats:
            index.offsets.setdefault(number, []).append(position)
        position += length
    index.stray += end - position
    return index


def _describe(index: Index, lengths: dict[int, int], raw: bytes) -> None:
    about = np.frombuffer(raw, FMT_DTYPE)[0]
    name, letters, columns = (
        about[key].decode("latin-1").strip("\0 ") for key in ("name", "format", "columns")
    )
    number = int(about["number"])
    if number in lengths and number != FMT:
        return  # described before; a log that is appended to describes everything again
    names = tuple(columns.split(",")) if columns else ()
    known = set(letters) <= set(FORMATS) and len(names) == len(letters) == len({*names} - {""})
    if known and Format(name, 0, names, letters).dtype.itemsize == about["length"] - HEADER:
        index.formats[number] = Format(name, int(about["length"]), names, letters)
    elif letters:
        index.unknown.add(name)
    if number != FMT and about["length"] > HEADER:
        lengths[number] = int(about["length"])


READER = DataFlashReader()
