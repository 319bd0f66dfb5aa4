"""PX4 ULog, by the library pyulog."""

import io
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from auvident.errors import InputError
from auvident.storage.readers.interface import (
    DAMAGED_REMEDY,
    STAMP,
    Tables,
    in_memory,
    ns_of_counts,
)
from auvident.storage.readers.quaternions import ANGLES, angles, quaternions_in
from auvident.storage.readers.registry import need

MAGIC = b"\x55\x4c\x6f\x67\x01\x12\x35"
EXTRA = "px4"
TIME = "timestamp"  # of every message, microseconds since the start of the controller
NS_PER_US = 1000
MOST_DEPTH, MOST_FIELDS = 24, 20_000  # of a format; those of PX4 have a few hundred fields
MOST_RETURNS = 100  # to one place of a file
QUATERNIONS = ("q", "q_d")  # arrays of four that are attitudes: of the body (FRD) in NED
TURNED = tuple(f"{name}.{angle}" for name in QUATERNIONS for angle in ANGLES)


@dataclass(frozen=True)
class ULogReader:
    """Logs of PX4 (``.ulg``)."""

    name: str = "PX4 ULog"

    def matches(self, path: Path, head: bytes) -> bool:
        """By the first bytes."""
        return head.startswith(MAGIC)

    def open(self, path: Path) -> Tables:
        """Read the log; the library has all of it in memory."""
        pyulog = need("pyulog", EXTRA, path)
        said = io.StringIO()
        try:
            with redirect_stdout(said), _Forward(path) as stream, _Forward(path) as again:
                _refuse_endless(pyulog.ULog(stream, parse_header_only=True).message_formats)
                log = pyulog.ULog(again)
        except Exception as error:  # at damaged files the library raises whatever it runs into
            told = str(error) or type(error).__name__
            raise InputError(f"is a damaged ULog: {told}", str(path), DAMAGED_REMEDY) from error
        several = {data.name for data in log.data_list if data.multi_id}
        columns = {_name(data, several): _columns(data.data) for data in log.data_list}
        time = {name: STAMP for name, table in columns.items() if STAMP in table}
        units = {(t, c): "rad" for t in columns for c in columns[t] if c.endswith(TURNED)}
        return in_memory(columns, time, units, _notes(log))


class _EndlessError(Exception):
    """The library reads the same bytes again and again; it catches no error of this kind."""


class _Forward(io.BufferedReader):
    """A file in which the library may go back, but not to one place for ever.

    It goes back by the length that a message states, of which the end of a file that is cut off
    may hold less.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(io.FileIO(path))
        self._returns = Counter[int]()

    def seek(self, offset: int, whence: int = 0, /) -> int:
        place = super().seek(offset, whence)
        self._returns[place] += 1
        if self._returns[place] > MOST_RETURNS:
            raise _EndlessError(f"what stands at byte {place} is no message")
        return place


def _refuse_endless(formats: Mapping[str, Any]) -> None:
    """Refuse messages of fields within fields that the library would unfold until memory ends."""
    fields: dict[str, float] = {}

    def count(name: str, depth: int) -> float:
        if depth > MOST_DEPTH:
            raise ValueError(f"the format of {name} contains itself")
        if name in formats and name not in fields:
            parts = ((max(1, size), kind) for kind, size, _ in formats[name].fields)
            fields[name] = sum(size * count(kind, depth + 1) for size, kind in parts)
        return fields.get(name, 1)

    for name in formats:
        if count(name, 0) > MOST_FIELDS:
            raise ValueError(f"the format of {name} has {count(name, 0):.3g} fields")


def _name(data: Any, several: set[str]) -> str:
    return f"{data.name}[{data.multi_id}]" if data.name in several else data.name


def _columns(data: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    found = {name: np.asarray(values) for name, values in data.items()}
    for base, parts in quaternions_in(found, QUATERNIONS).items():
        turned = angles(*(found[part] for part in parts))
        found |= {f"{base}.{angle}": values for angle, values in turned.items()}
    if TIME not in found:
        return found
    return {STAMP: ns_of_counts(found[TIME], NS_PER_US), **found}


def _notes(log: Any) -> tuple[str, ...]:
    notes: list[str] = []
    if log.file_corruption:
        notes.append("parts of the log are damaged and were left out")
    lost_ms: Sequence[int] = [dropout.duration for dropout in log.dropouts]
    if lost_ms:
        notes.append(
            f"the logger dropped out {len(lost_ms)} times, {sum(lost_ms) / 1e3:.1f} s in all"
        )
    return tuple(notes)


READER = ULogReader()
