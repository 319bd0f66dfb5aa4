"""Times that a table has in two columns: whole seconds, and the nanoseconds beyond them."""

import re
from collections.abc import Mapping, Sequence

import numpy as np

from auvident.storage.log_time import MISSING_COUNT, MOST_COUNT, Stamps, as_floats, read_stamps

WHOLE = re.compile(r"(?P<of>.*?)(?P<unit>secs?)$", re.IGNORECASE)  # stamp.secs of ROS 1, sec of 2
PER_SECOND = 10**9
NAMES = {"secs": ("nsecs", "nanosecs"), "sec": ("nsec", "nanosec")}


def nanoseconds_of(name: str, names: Sequence[str]) -> str | None:
    """The column of nanoseconds that belongs to one of whole seconds, or None.

    Parameters
    ----------
    name : str
        A column of times, such as ``header.stamp.secs``.
    names : sequence of str
        All columns of the table.
    """
    found = WHOLE.fullmatch(name)
    if found is None:
        return None
    twins = {f"{found['of']}{unit}".lower() for unit in NAMES[found["unit"].lower()]}
    return next((other for other in names if other.lower() in twins), None)


def whole_seconds_in(names: Sequence[str]) -> str | None:
    """The first column of whole seconds that has one of nanoseconds beside it, or None."""
    return next((name for name in names if nanoseconds_of(name, names)), None)


def read_parts(
    columns: Mapping[str, np.ndarray], name: str, unit: str | None, where: str, rows: np.ndarray
) -> Stamps:
    """Times of a column, with the nanoseconds that a second column may have.

    Parameters
    ----------
    columns : mapping of str to numpy.ndarray
        As read, the nanoseconds among them.
    name : str
        The column of times.
    unit, where, rows
        As of `auvident.storage.log_time.read_stamps`, which says what is raised.
    """
    other = nanoseconds_of(name, [*columns])
    counts = None if other is None else _counts(columns[name], columns[other])
    if counts is None:
        return read_stamps(columns[name], unit, where, rows)
    return read_stamps(counts, "ns", where, rows)


def _counts(seconds: np.ndarray, nanoseconds: np.ndarray) -> np.ndarray | None:
    """Both as integers of nanoseconds; None where they are not whole seconds and a part of one."""
    if seconds.dtype.kind not in "if" or nanoseconds.dtype.kind not in "if":
        return None
    whole, part = as_floats(seconds), as_floats(nanoseconds)
    known = np.isfinite(whole) & np.isfinite(part)
    known &= np.abs(whole) < MOST_COUNT / PER_SECOND
    if np.any(whole[known] % 1.0) or np.any((part[known] < 0) | (part[known] >= PER_SECOND)):
        return None
    counts = np.full(whole.size, MISSING_COUNT)
    counts[known] = whole[known].astype(np.int64) * PER_SECOND + part[known].astype(np.int64)
    return counts
