"""Text logs of Iver3, REMUS and others that write date and time of day into two columns.

Columns are named as in the file, units in brackets behind the name. `timestamp` is made of both
columns, north and east in m of latitude and longitude in degrees, from the first fix.
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from auvident.errors import InputError
from auvident.storage.log_geographic import NAMES, from_first_fix
from auvident.storage.log_layout import BRACKETS
from auvident.storage.log_text import read_text
from auvident.storage.readers.interface import Tables, in_memory

TABLE = "log"
STAMP_COLUMN = "timestamp"
DATE, TIME = ("date", "utc date", "gps date"), ("time", "utc time", "gps time", "time of day")
DELIMITERS = (";", ",", "\t")
CLOCK = re.compile(r"(\d{1,2}):(\d{2}):(\d{2}(?:\.\d+)?)")
DATES = ("%m/%d/%Y", "%Y-%m-%d", "%Y/%m/%d", "%d.%m.%Y", "%m/%d/%y")
LEAST_READ = 0.9  # share of the rows whose date and time can be read


@dataclass(frozen=True)
class DatedReader:
    """Text with a column for the date and one for the time of day (``.log``)."""

    name: str = "text with date and time of day"

    def matches(self, path: Path, head: bytes) -> bool:
        """By the names in the first line."""
        first = head.split(b"\n")[0].decode(errors="replace").lstrip("\ufeff")
        names = _names(first)
        return _find(names, DATE) is not None and _find(names, TIME) is not None

    def open(self, path: Path) -> Tables:
        """Read the log."""
        content, _ = read_text(path)
        head, _, body = content.decode(errors="replace").lstrip("\ufeff").partition("\n")
        names, mark = _names(head), _delimiter(head)
        rows = [line.rstrip("\r").split(mark) for line in body.split("\n") if line.strip()]
        good = [row for row in rows if len(row) in (len(names), len(names) + 1)]
        if not good:
            raise InputError("has column names but no data", str(path))
        lost = len(rows) - len(good)
        texts = {
            name: pd.Series([row[k].strip() for row in good])
            for k, (name, _) in enumerate(names)
            if name
        }
        columns = {STAMP_COLUMN: _stamps(*_clock(texts, names, path), path)}
        columns |= {name: _column(text) for name, text in texts.items()}
        columns |= _metres(columns, names)
        units = {(TABLE, name): unit for name, unit in names}
        units |= dict.fromkeys([(TABLE, "north_m"), (TABLE, "east_m")], "m")
        notes = (f"{lost} lines do not have the fields of the first one",) if lost else ()
        return in_memory({TABLE: columns}, {TABLE: STAMP_COLUMN}, units, notes)


def _delimiter(head: str) -> str:
    return max(DELIMITERS, key=head.count)


def _names(head: str) -> list[tuple[str, str]]:
    """Names of the columns and the units behind them."""
    found = []
    for text in head.rstrip("\r\n").split(_delimiter(head)):
        split = BRACKETS.match(text.strip())
        found.append((split["name"], split["unit"]) if split else (text.strip(), ""))
    return found


def _find(names: list[tuple[str, str]], wanted: tuple[str, ...]) -> str | None:
    return next((name for name, _ in names if name.lower() in wanted), None)


def _clock(
    texts: dict[str, pd.Series], names: list[tuple[str, str]], path: Path
) -> tuple[pd.Series, pd.Series]:
    """Texts of the date and of the time of day."""
    date, time = (_find(names, wanted) for wanted in (DATE, TIME))
    if date is None or time is None:  # a bare carriage return ends a line, too
        raise InputError(
            "is damaged: its first line ends before the columns of date and time of day",
            f"{path}, row 1",
            "Repair the first line.",
        )
    return texts[date], texts[time]


def _stamps(date: pd.Series, time: pd.Series, path: Path) -> np.ndarray:
    """Date and time of day as ``datetime64[ns]``; NaT where they cannot be read."""
    clock = time.str.extract(CLOCK).astype(float)
    seconds = 3600.0 * clock[0] + 60.0 * clock[1] + clock[2]
    days = _days(date)
    known = (seconds.notna() & days.notna()).to_numpy()
    if known.mean() < LEAST_READ:
        row = int(np.flatnonzero(~known)[0]) + 2
        raise InputError(
            "date and time of day cannot be read",
            f"{path}, row {row}",
            "Write dates as 2024-05-01 or 5/1/2024 (month first), times as 12:00:00.0.",
        )
    found = np.full(known.size, np.datetime64("NaT", "ns"))
    ns = np.rint(seconds.to_numpy()[known] * 1e3).astype(np.int64) * 10**6
    found[known] = days.to_numpy()[known].astype("datetime64[ns]") + ns.astype("timedelta64[ns]")
    return found


def _days(texts: pd.Series) -> pd.Series:
    """Days by the first way of writing that fits most of them."""
    tried = [pd.to_datetime(texts, format=way, errors="coerce") for way in DATES]
    return max(tried, key=lambda days: int(days.notna().sum()))


def _column(texts: pd.Series) -> np.ndarray:
    """Numbers where all are, or empty; else text."""
    numbers = pd.to_numeric(texts, errors="coerce")
    empty = texts.str.lower().isin(("", "nan", "n/a", "na", "-"))
    if (numbers.notna() | empty).all():
        return numbers.to_numpy(dtype=float)
    return texts.to_numpy(dtype=object)


def _metres(columns: dict[str, np.ndarray], names: list[tuple[str, str]]) -> dict[str, np.ndarray]:
    """North and east in m, where there are latitude and longitude in degrees."""
    own = [_find(names, wanted) for wanted in NAMES.values()]
    if None in own or any(columns[name or ""].dtype == object for name in own):
        return {}
    north, east = from_first_fix(*(np.deg2rad(columns[name or ""]) for name in own))
    return {} if np.isnan(north).all() else {"north_m": north, "east_m": east}


READER = DatedReader()
