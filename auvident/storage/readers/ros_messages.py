"""Serialised ROS messages as columns, by their definition alone.

A definition tells where each number stands; messages of equal length whose strings and sequences
are of equal length have one layout, and their numbers are sliced out of a matrix of bytes. Nothing
of a definition is ever made into code. ROS 1 packs its fields without gaps; ROS 2 (CDR) aligns them
to their size, counted from after the four bytes that tell the byte order.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

BASE, NAME, ARRAY, SEQUENCE = 1, 2, 3, 4  # kinds of fields in a parsed definition
SIZES = {"f": 4, "i": 4, "u": 4, "b": 1}
DTYPES = {
    "bool": "u1",
    "byte": "u1",
    "char": "u1",
    "octet": "u1",
    **{f"{sign}int{8 * n}": f"{letter}{n}" for sign, letter in (("", "i"), ("u", "u"))
       for n in (1, 2, 4, 8)},
    "float32": "f4",
    "float64": "f8",
}  # fmt: skip
INSTANTS = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
INSTANT = "_ns"  # added to the name of a stamp, which becomes one column of nanoseconds
MOST_ELEMENTS = 64  # of an array that become columns; a longer one is an image or a cloud
LEFT_OUT = ("covariance",)  # arrays that no channel is made of, and that would fill pages
MOST_DEPTH = 24  # of fields within fields; a definition that contains itself goes on forever
MOST_LAYOUTS = 100  # of one topic that are searched for before messages are taken one by one
HEADER = 4  # bytes before a CDR message

Definitions = Mapping[str, tuple[Any, Sequence[tuple[str, Any]]]]


class MalformedError(Exception):
    """A message does not fit its definition."""


@dataclass
class Places:
    """Where the numbers of a message stand.

    Attributes
    ----------
    places : dict of str to tuple
        Offset in bytes and numpy dtype of each column; of a stamp the dtype is "t".
    lengths : list of tuple
        Offset and value of each length; messages that share them share the layout.
    """

    places: dict[str, tuple[int, str]] = field(default_factory=dict)
    lengths: list[tuple[int, int]] = field(default_factory=list)


class _Walk:
    """One pass over a message along its definition."""

    def __init__(self, definitions: Definitions, data: bytes, is_cdr: bool) -> None:
        self.definitions, self.data, self.is_cdr = definitions, data, is_cdr
        self.position = HEADER if is_cdr else 0
        self.order = "<" if not is_cdr or data[1:2] == b"\x01" else ">"
        self.layout = Places()

    def message(self, name: str) -> Places:
        self.struct(name, "", True, 0)
        over = len(self.data) - self.position
        if over < 0 or over >= (HEADER if self.is_cdr else 1):
            raise MalformedError(f"{len(self.data)} bytes where {name} takes {self.position}")
        return self.layout

    def struct(self, name: str, prefix: str, named: bool, depth: int) -> None:
        if depth > MOST_DEPTH:
            raise MalformedError(f"the definition of {name} contains itself")
        if name in INSTANTS:
            self.align(4)
            self.put(prefix.rstrip(".") + INSTANT, "t", 8, named)
            return
        if name not in self.definitions:
            raise MalformedError(f"there is no definition of {name}")
        fields = self.definitions[name][1]
        if not fields and self.is_cdr:
            self.position += 1  # a structure is never empty there
        for own, kind in fields:
            self.field(kind, prefix + own, named, depth)

    def field(self, kind: Any, name: str, named: bool, depth: int) -> None:
        if kind[0] == BASE:
            self.base(kind[1][0], name, named)
        elif kind[0] == NAME:
            self.struct(kind[1], name + ".", named, depth + 1)
        else:
            count = kind[1][1] if kind[0] == ARRAY else self.length()
            self.elements(kind[1][0], count, name, named, depth)

    def elements(self, kind: Any, count: int, name: str, named: bool, depth: int) -> None:
        named = named and count <= MOST_ELEMENTS and not name.endswith(LEFT_OUT)
        if kind[0] == BASE and kind[1][0] in DTYPES and not named:
            size = int(DTYPES[kind[1][0]][1])
            if count:
                self.align(size)
            self.skip(count * size)
            return
        for index in range(count):
            before = self.position
            self.field(kind, f"{name}[{index}]", named, depth + 1)
            if self.position == before:
                return  # elements of no size, however many

    def base(self, kind: str, name: str, named: bool) -> None:
        if kind == "string":
            self.skip(self.length())
            return
        if kind not in DTYPES:
            raise MalformedError(f"{name} is of the type {kind}, which cannot be read")
        size = int(DTYPES[kind][1])
        self.align(size)
        self.put(name, self.order + DTYPES[kind], size, named)

    def length(self) -> int:
        self.align(4)
        start = self.position
        self.skip(4)
        count = int.from_bytes(self.data[start : start + 4], self.byte_order)
        self.layout.lengths.append((start, count))
        return count

    @property
    def byte_order(self) -> Any:
        return "little" if self.order == "<" else "big"

    def put(self, name: str, dtype: str, size: int, named: bool) -> None:
        if named:
            self.layout.places[name] = (self.position, dtype if dtype != "t" else self.order + "t")
        self.skip(size)

    def align(self, size: int) -> None:
        if self.is_cdr:
            self.position += -(self.position - HEADER) % size

    def skip(self, size: int) -> None:
        self.position += size
        if self.position > len(self.data):
            raise MalformedError(f"ends after {len(self.data)} bytes, within a field")


def layout_of(definitions: Definitions, name: str, data: bytes, is_cdr: bool) -> Places:
    """Layout of a message.

    Parameters
    ----------
    definitions : mapping
        Constants and fields by type, as `rosbags.typesys.get_types_from_msg` parses them.
    name : str
        Type of the message.
    data : bytes
        The message.
    is_cdr : bool
        Whether it is of ROS 2.

    Raises
    ------
    MalformedError
        When it does not fit its definition.
    """
    return _Walk(definitions, data, is_cdr).message(name)


def columns_of(
    definitions: Definitions, name: str, messages: Sequence[bytes], is_cdr: bool
) -> dict[str, np.ndarray]:
    """All numbers of some messages of one type by column, shape (n,) each.

    An element that some messages do not have is NaN there; stamps are int64 in ns.

    Raises
    ------
    MalformedError
        When a message does not fit its definition.
    """
    found: dict[str, np.ndarray] = {}
    filled: dict[str, int] = {}
    for rows, block, layout in _blocks(definitions, name, messages, is_cdr):
        for column, (offset, dtype) in layout.places.items():
            values = _slice(block, offset, dtype)
            if column not in found:
                found[column] = np.zeros(len(messages), values.dtype)
                filled[column] = 0
            found[column][rows] = values
            filled[column] += rows.size
    gappy = [column for column, count in filled.items() if count < len(messages)]
    return found if not gappy else _with_gaps(found, gappy, definitions, name, messages, is_cdr)


def _with_gaps(
    found: dict[str, np.ndarray],
    gappy: Sequence[str],
    definitions: Definitions,
    name: str,
    messages: Sequence[bytes],
    is_cdr: bool,
) -> dict[str, np.ndarray]:
    """Columns that not every message has, with NaN where it is missing."""
    there = {column: np.zeros(len(messages), bool) for column in gappy}
    for rows, _, layout in _blocks(definitions, name, messages, is_cdr):
        for column in layout.places.keys() & there.keys():
            there[column][rows] = True
    holes = {c: np.where(mask, found[c].astype(float), np.nan) for c, mask in there.items()}
    return found | holes


def _blocks(
    definitions: Definitions, name: str, messages: Sequence[bytes], is_cdr: bool
) -> Iterator[tuple[np.ndarray, np.ndarray, Places]]:
    """Messages of one layout each: their rows, their bytes (n, length), the layout."""
    sizes = np.array([len(message) for message in messages])
    for size in np.unique(sizes):
        rows: np.ndarray = np.flatnonzero(sizes == size)
        layouts = 0
        block = np.frombuffer(b"".join(messages[i] for i in rows.tolist()), np.uint8).reshape(
            -1, size
        )
        while rows.size:
            layout = layout_of(definitions, name, messages[int(rows[0])], is_cdr)
            same = _alike(block, layout, is_cdr)
            if layouts >= MOST_LAYOUTS:
                same[1:] = False
            yield rows[same], block[same], layout
            rows, block, layouts = rows[~same], block[~same], layouts + 1


def _alike(block: np.ndarray, layout: Places, is_cdr: bool) -> np.ndarray:
    """Messages whose byte order and lengths are those of the first."""
    same = np.ones(len(block), bool)
    fixed = [(0, HEADER)] if is_cdr else []
    for start, size in (*fixed, *((offset, 4) for offset, _ in layout.lengths)):
        same &= (block[:, start : start + size] == block[0, start : start + size]).all(axis=1)
    return same


def _slice(block: np.ndarray, offset: int, dtype: str) -> np.ndarray:
    if dtype[1] == "t":
        parts = [_slice(block, offset + step, dtype[0] + "u4") for step in (0, 4)]
        return parts[0].astype(np.int64) * 1_000_000_000 + parts[1].astype(np.int64)
    size = int(dtype[2])
    return np.ascontiguousarray(block[:, offset : offset + size]).view(dtype)[:, 0]
