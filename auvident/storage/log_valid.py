"""Columns that mark invalid samples: which words and numbers are false, and which say neither."""

from collections.abc import Iterable

import numpy as np

from auvident.schema.artifacts import Finding
from auvident.schema.quoting import clipped
from auvident.storage.log_layout import MISSING
from auvident.storage.log_time import as_floats

FALSE_WORDS = frozenset(("0", "0.0", "false", "f", "no", "n", "invalid", "bad", "nok", "void"))
TRUE_WORDS = frozenset(("1", "1.0", "true", "t", "yes", "y", "valid", "good", "ok"))
NMEA_TRUE, NMEA_FALSE = "a", "v"  # of NMEA 0183: data valid, navigation receiver warning
BY_DEFAULT = ("valid", "dvl_valid")  # read without a map
FLAGS = frozenset(
    (
        *("valid", "is_valid", "dvl_valid", "velocity_valid", "vel_valid", "bottom_lock", "lock"),
        *("locked", "dvl_lock", "bt_lock", "bt_valid", "bt_good", "bt_ok", "bottom_track_valid"),
        *("ok", "dvl_ok", "good", "dvl_good"),
    )
)
FEW = 5  # values of a message


def is_flag_by_name(name: str) -> bool:
    """Whether a column is called as those in which a DVL marks its readings as valid."""
    return name.strip().lower() in FLAGS


def unread_flag(names: Iterable[str]) -> str | None:
    """The column by which a DVL marks its readings, where a log without a map leaves it unread."""
    called = {name.strip().lower(): name for name in names}
    if not called.keys().isdisjoint(BY_DEFAULT):
        return None
    return next((name for name in called.values() if is_flag_by_name(name)), None)


def marked(flags: np.ndarray, name: str, where: str) -> tuple[np.ndarray, tuple[Finding, ...]]:
    """Rows that their flag calls invalid, bool of shape (n,), and what was not understood.

    An empty flag says nothing, nor does one that is neither true nor false: such rows count as
    valid, which is said.
    """
    if flags.dtype != object:
        numbers = as_floats(flags)
        other = numbers[np.isfinite(numbers) & ~np.isin(numbers, (0.0, 1.0))]
        return numbers == 0, _not_understood([f"{x:g}" for x in other.tolist()], name, where)
    words = np.array([str(flag).strip().strip('"').lower() for flag in flags], dtype=object)
    told = {*words.tolist()} - {*MISSING, "", "none"}
    is_nmea = bool(told) and told <= {NMEA_TRUE, NMEA_FALSE}
    false = {NMEA_FALSE} if is_nmea else FALSE_WORDS
    unknown = set() if is_nmea else told - FALSE_WORDS - TRUE_WORDS
    other = [word for word in words.tolist() if word in unknown]
    return np.isin(words, list(false)), _not_understood(other, name, where)


def _not_understood(other: list[str], name: str, where: str) -> tuple[Finding, ...]:
    if not other:
        return ()
    values = list(dict.fromkeys(other))
    shown = ", ".join(clipped(value) for value in values[:FEW]) + ", …" * (len(values) > FEW)
    return (
        Finding(
            code="valid_not_understood",
            message=f"{len(other)} values of {name} are neither true nor false ({shown}): these "
            "rows count as valid",
            where=where,
            value=float(len(other)),
            remedy="Write 1 and 0, true and false, or A and V into it, and 0 where the sample is "
            'not to be used; or name another column in a map (--map): valid = "...".',
        ),
    )
