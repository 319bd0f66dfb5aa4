"""Time columns: seconds, epoch counts and ISO 8601 instants become seconds."""

import numpy as np
import pandas as pd

from auvident.errors import InputError
from auvident.schema.logs import TIME_UNITS

# An epoch count of 2001 or later in s, ms, us, ns exceeds 1e9 times 1, 1e3, 1e6, 1e9; one of
# before the year 5138 in the next smaller unit does not reach 1e11 of it.
EPOCH_MAGNITUDES = (("ns", 1e17), ("us", 1e14), ("ms", 1e11))
ABSOLUTE_S = 1e8  # a time beyond it (3 years in seconds) counts from 1970, not from switch-on


def to_seconds(values: np.ndarray, unit: str | None, where: str, rows: np.ndarray) -> np.ndarray:
    """Seconds of a time column.

    Parameters
    ----------
    values : numpy.ndarray
        Numbers, or texts in ISO 8601, shape (n,).
    unit : str or None
        ``s``, ``ms``, ``us``, ``ns``, ``iso``, or None: seconds unless the magnitude is that of
        an epoch in a finer unit.
    where : str
        File and column, for messages.
    rows : numpy.ndarray
        Row of each value, for messages.

    Returns
    -------
    numpy.ndarray
        Seconds, shape (n,); since 1970 for instants; NaN where missing.

    Raises
    ------
    InputError
        When a text is no instant.
    """
    if values.dtype == object:
        return _from_text(values, where, rows)
    numbers = np.where(np.isfinite(values), values, np.nan)
    factor = TIME_UNITS[unit] if unit in TIME_UNITS else _epoch_factor(numbers)
    return numbers * factor


def _epoch_factor(numbers: np.ndarray) -> float:
    magnitude = np.nanmedian(np.abs(numbers)) if np.isfinite(numbers).any() else 0.0
    for unit, least in EPOCH_MAGNITUDES:
        if magnitude >= least:
            return TIME_UNITS[unit]
    return 1.0


def _from_text(values: np.ndarray, where: str, rows: np.ndarray) -> np.ndarray:
    texts = pd.Series(values, dtype=object).fillna("").astype(str).str.strip().str.strip('"')
    texts = texts.str.replace(r"(\d),(\d+)", r"\1.\2", regex=True)
    empty = texts == ""
    instants = pd.to_datetime(texts.mask(empty), format="ISO8601", utc=True, errors="coerce")
    wrong = np.flatnonzero(np.asarray(instants.isna() & ~empty))
    if wrong.size:
        raise InputError(
            f"{values[wrong[0]]!r} is no time of ISO 8601 (2024-05-01T12:00:00.100Z)",
            f"{where}, row {rows[wrong[0]]}",
            "Write seconds in a column time_s, or ISO 8601 or epoch counts in timestamp.",
        )
    seconds = (instants - pd.Timestamp(0, tz="UTC")) / pd.Timedelta(1, "s")
    return seconds.to_numpy(dtype=float)
