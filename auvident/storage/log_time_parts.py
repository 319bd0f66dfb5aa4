"""Times that a table has in two columns: whole seconds, and what is beyond them (ns, us, ms)."""

import re
from collections.abc import Mapping, Sequence

import numpy as np

from auvident.storage.log_time import MISSING_COUNT, MOST_COUNT, Stamps, as_floats, read_stamps

WHOLE = re.compile(r"(?P<of>.*?)(?P<unit>secs?)$", re.IGNORECASE)  # stamp.secs of ROS 1, sec of 2
PER_SECOND = 10**9
# Names of the part beyond, with plural s where the seconds have it, and nanoseconds in one.
PARTS = {
    "nsec": 1,
    "nanosec": 1,
    "usec": 10**3,
    "microsec": 10**3,
    "msec": 10**6,
    "millisec": 10**6,
}


def beyond_seconds_of(name: str, names: Sequence[str]) -> str | None:
    """The column of what is beyond the whole seconds of another, or None.

    Parameters
    ----------
    name : str
        A column of times, such as ``header.stamp.secs``.
    names : sequence of str
        All columns of the table.
    """
    twins = _twins(name)
    return next((other for other in names if other.lower() in twins), None)


def _twins(name: str) -> dict[str, int]:
    """Names that the column beside one of whole seconds may have, and nanoseconds in one of it."""
    found = WHOLE.fullmatch(name)
    if found is None:
        return {}
    plural = found["unit"].lower().removeprefix("sec")
    return {f"{found['of']}{part}{plural}".lower(): ns for part, ns in PARTS.items()}


def whole_seconds_in(names: Sequence[str]) -> str | None:
    """The first column of whole seconds that has one of the part beyond beside it, or None."""
    return next((name for name in names if beyond_seconds_of(name, names)), None)


def read_parts(
    columns: Mapping[str, np.ndarray], name: str, unit: str | None, where: str, rows: np.ndarray
) -> Stamps:
    """Times of a column, with the part of a second that another column may have.

    Parameters
    ----------
    columns : mapping of str to numpy.ndarray
        As read, what is beyond the seconds among them.
    name : str
        The column of times.
    unit, where, rows
        As of `auvident.storage.log_time.read_stamps`, which says what is raised.
    """
    other = beyond_seconds_of(name, [*columns])
    counts = None
    if other is not None:
        counts = _counts(columns[name], columns[other], _twins(name)[other.lower()])
    if counts is None:
        return read_stamps(columns[name], unit, where, rows)
    return read_stamps(counts, "ns", where, rows)


def _counts(seconds: np.ndarray, beyond: np.ndarray, ns: int) -> np.ndarray | None:
    """Both as integers of nanoseconds; None where they are not whole seconds and a part of one."""
    if seconds.dtype.kind not in "if" or beyond.dtype.kind not in "if":
        return None
    whole, part = as_floats(seconds), as_floats(beyond)
    known = np.isfinite(whole) & np.isfinite(part)
    known &= np.abs(whole) < MOST_COUNT / PER_SECOND
    if np.any(whole[known] % 1.0) or np.any((part[known] < 0) | (part[known] * ns >= PER_SECOND)):
        return None
    counts = np.full(whole.size, MISSING_COUNT)
    counts[known] = whole[known].astype(np.int64) * PER_SECOND + part[known].astype(np.int64) * ns
    return counts
