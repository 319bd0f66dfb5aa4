"""MOOS asynchronous logs (``.alog``): lines of time, variable, source and value.

Every variable is a table, and so is every source: what one application published, each variable
a column, empty where another one was published. Values of the form ``X=1.5,Y=2`` are taken apart.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from auvident.errors import InputError
from auvident.storage.log_time import ABSOLUTE_S
from auvident.storage.readers.interface import MOST_S, STAMP, Tables, in_memory, ns_of_seconds

START = re.compile(rb"^%+\s*LOG ?START\s+(?P<start>\S+)", re.MULTILINE)
SECONDS = "time_s"
PAIRS = re.compile(r"^\s*\w+\s*=[^=,]*(,\s*\w+\s*=[^=,]*)*$")
NUMBER = re.compile(r"[-+]?(\d+(\.\d*)?|\.\d+)([eE][-+]?\d+)?")
MOST_SHOWN = 40  # characters of a start that is none
MOST_FAULTS = 0.05  # share of lines that are none; beyond it the file is something else
Line = tuple[float, str, str, str]


@dataclass(frozen=True)
class MoosReader:
    """Logs of pLogger (``.alog``)."""

    name: str = "MOOS alog"

    def matches(self, path: Path, head: bytes) -> bool:
        """By the banner, a comment."""
        return head.lstrip().startswith(b"%")

    def open(self, path: Path) -> Tables:
        """Read the log."""
        content = path.read_bytes()
        start = _start(content, path)
        lines, faults = _lines(content)
        if not lines or len(faults) > MOST_FAULTS * (len(lines) + len(faults)):
            row = f", row {faults[0]}" if faults else ""
            raise InputError(
                f"{len(faults)} of {len(lines) + len(faults)} lines are not "
                '"time variable source value", the time in s',
                f"{path}{row}",
                "Give the .alog as pLogger wrote it.",
            )
        notes = (
            (f"{len(faults)} lines are damaged, the first is line {faults[0]}",) if faults else ()
        )
        return in_memory(_tables(lines, start), notes=notes, time=_times(lines, start))


def _start(content: bytes, path: Path) -> float:
    """Seconds since 1970 at which the log starts, by its banner; 0 where it says nothing."""
    found = START.search(content)
    if found is None:
        return 0.0
    text = found["start"].decode(errors="replace")
    if NUMBER.fullmatch(text) and 0.0 <= float(text) <= MOST_S:
        return float(text)
    line = content.count(b"\n", 0, found.start("start")) + 1
    raise InputError(
        f"LOGSTART {text[:MOST_SHOWN]!r} is not a time in seconds since 1970",
        f"{path}, row {line}",
        "Write it as pLogger does (%% LOGSTART 1714564800.0), or remove the line: the times then "
        "count from the start of the log.",
    )


def _lines(content: bytes) -> tuple[list[Line], list[int]]:
    """Lines that can be read, and numbers of those that cannot; comments count as neither."""
    found: list[Line] = []
    faults = []
    for number, raw in enumerate(content.split(b"\n"), 1):
        text = raw.decode(errors="replace").strip()
        if not text or text.startswith("%"):
            continue
        parts = text.split(None, 3)
        if len(parts) < 3 or not NUMBER.fullmatch(parts[0]) or abs(float(parts[0])) > MOST_S:
            faults.append(number)
            continue
        found.append((float(parts[0]), parts[1], parts[2], parts[3] if len(parts) > 3 else ""))
    return found, faults


def _times(lines: list[Line], start: float) -> dict[str, str]:
    name = STAMP if start > ABSOLUTE_S else SECONDS
    return dict.fromkeys([*(line[1] for line in lines), *(line[2] for line in lines)], name)


def _tables(lines: list[Line], start: float) -> dict[str, dict[str, np.ndarray]]:
    by_variable: dict[str, list[Line]] = {}
    by_source: dict[str, list[Line]] = {}
    for line in lines:
        by_variable.setdefault(line[1], []).append(line)
        by_source.setdefault(line[2], []).append(line)
    found = {}
    for name, own in by_variable.items():
        found[name] = {**_stamps(own, start), **_values([line[3] for line in own])}
    for source, own in by_source.items():
        if source in found or len({line[1] for line in own}) < 2:
            continue
        found[source] = {**_stamps(own, start), **_side_by_side(own)}
    return found


def _stamps(lines: list[Line], start: float) -> dict[str, np.ndarray]:
    time = np.array([line[0] for line in lines])
    if start <= ABSOLUTE_S:
        return {SECONDS: time + start}
    whole = int(start)
    return {STAMP: ns_of_seconds(time + (start - whole), whole)}


def _values(texts: list[str]) -> dict[str, np.ndarray]:
    """A column of numbers or text, or a column for each name of ``name=number`` pairs."""
    if all(PAIRS.match(text) for text in texts):
        rows = [dict(pair.split("=", 1) for pair in text.split(",")) for text in texts]
        rows = [{key.strip(): value.strip() for key, value in row.items()} for row in rows]
        names = dict.fromkeys(key for row in rows for key in row)
        return {name: _column([row.get(name, "") for row in rows]) for name in names}
    return {"value": _column(texts)}


def _column(texts: list[str]) -> np.ndarray:
    plain = [text.strip().strip('"') for text in texts]
    words = {"true": "1", "false": "0", "nan": "", "": ""}
    plain = [words.get(text.lower(), text) for text in plain]
    if all(not text or NUMBER.fullmatch(text) for text in plain):
        return np.array([float(text) if text else np.nan for text in plain])
    return np.array(texts, dtype=object)


def _side_by_side(lines: list[Line]) -> dict[str, np.ndarray]:
    """The variables of one source, numbers only, NaN where another was published."""
    found = {}
    for name in dict.fromkeys(line[1] for line in lines):
        rows = [k for k, line in enumerate(lines) if line[1] == name]
        values = _column([lines[k][3] for k in rows])
        if values.dtype != object:
            found[name] = np.full(len(lines), np.nan)
            found[name][rows] = values
    return found


READER = MoosReader()
