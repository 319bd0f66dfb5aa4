"""Time columns: seconds, epoch counts and ISO 8601 instants become seconds."""

import re
from dataclasses import dataclass

import numpy as np
import pandas as pd

from auvident.errors import InputError
from auvident.schema.logs import TIME_UNITS

# An epoch count of 2001 or later in s, ms, us, ns exceeds 1e9 times 1, 1e3, 1e6, 1e9; one of
# before the year 5138 in the next smaller unit does not reach 1e11 of it.
EPOCH_MAGNITUDES = (("ns", 1e17), ("us", 1e14), ("ms", 1e11))
ABSOLUTE_S = 1e8  # a time beyond it (3 years in seconds) counts from 1970, not from switch-on
BEYOND_S = 1e11  # the year 5138
LEAST_EPOCH_S = 1e9  # 2001: whole numbers before it are counts of something else than seconds
MOST_STEP_S = 60.0  # between rows; beyond it the unit of whole numbers is a finer one
# Dates of 1982 to 2119 as numbers of days: of spreadsheets, and of MATLAB (datenum).
DAYS = {"Excel": (3e4, 8e4), "MATLAB": (7.24e5, 7.74e5)}
MOST_DAY_STEP = 2e-4  # mean distance of rows: 17 s in days; in seconds faster than any sensor
FEWEST_OF_RATE = 10  # rows by which it is judged
MOST_RATE_HZ = 9e3  # PX4 logs raw gyros at 8 kHz; 10 Hz in s that are read as ms are beyond it
MOST_SHARED = 0.5  # of the rows may have the time of the row before, in a clock of whole seconds
LEAST_LOST_S = 1.0  # floats of 32 bits that are further apart have lost the time within a second
MOST_COUNT = 2**62  # half of what 64 bits hold, the year 2116 in ns: beyond it is a filler
MISSING_COUNT = np.iinfo(np.int64).min  # an empty cell among integers; numpy's NaT is the same


TIME_OF_DAY = re.compile(r"(\d{1,2}):(\d{2}):(\d{2}(?:\.\d+)?)Z?")
DURATION = re.compile(r"-?\d+ days?,? \d{1,2}:\d{2}:\d{2}(?:\.\d+)?")  # of pandas and Python
DAY_S = 86400.0
# Dates of which no other reading is usual: 01.05.2024 and 2024/05/01; 5/1/2024 may be either.
DAY_FIRST = re.compile(r"^(\d{2})\.(\d{2})\.(\d{4})(?=\D|$)")
SLASHED = re.compile(r"^(\d{4})/(\d{2})/(\d{2})(?=\D|$)")
MONTHS = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")
NAMED_MONTH = re.compile(
    rf"^(\d{{1,2}})[- ]({'|'.join(MONTHS)})[- ](\d{{4}})(?=\D|$)", re.IGNORECASE
)
UTC_WORD = re.compile(r"\s*(?:UTC|GMT)$", re.IGNORECASE)  # other names of zones mean several
# Seconds of the day and of the GPS week begin again at 0: within so many of their steps of the end.
ROLL_OVERS_S, ROLLED_STEPS = (86400.0, 604800.0), 5.0
# Numbers that are hours, minutes and seconds (hhmmss.ss of NMEA) never end in 60 to 99; seconds do
# for 40 of every 100, unless the log is shorter than that or its rows are far apart.
LEAST_SPAN_S, MOST_CLOCK_STEP_S = 200.0, 10.0


@dataclass(frozen=True)
class Stamps:
    """Times of a column: seconds after the whole second `origin_s`, shape (n,), NaN if missing.

    A float of the seconds since 1970 resolves a quarter of a microsecond; what is left after a
    whole second keeps its nanoseconds.
    """

    time_s: np.ndarray
    origin_s: int


def to_seconds(values: np.ndarray, unit: str | None, where: str, rows: np.ndarray) -> np.ndarray:
    """Seconds of a time column, shape (n,); see `read_stamps`."""
    stamps = read_stamps(values, unit, where, rows)
    return stamps.time_s + stamps.origin_s


def read_stamps(values: np.ndarray, unit: str | None, where: str, rows: np.ndarray) -> Stamps:
    """Times of a column.

    Parameters
    ----------
    values : numpy.ndarray
        Numbers, integers (`MISSING_COUNT` where empty), instants (``datetime64``), durations
        (``timedelta64``) or texts in ISO 8601, shape (n,).
    unit : str or None
        ``s``, ``ms``, ``us``, ``ns``, ``iso``, or None: seconds unless the magnitude is that of
        an epoch in a finer unit.
    where : str
        File and column, for messages.
    rows : numpy.ndarray
        Row of each value, for messages.

    Returns
    -------
    Stamps
        Since 1970 for instants.

    Raises
    ------
    InputError
        When a text is no instant, integers are neither of a named unit nor an epoch, floats have
        lost the seconds, or the rows follow each other faster than those of any sensor.
    """
    stamps = _stamps_of(values, unit, where, rows)
    _refuse_too_fast(stamps.time_s, where)
    return stamps


def _stamps_of(values: np.ndarray, unit: str | None, where: str, rows: np.ndarray) -> Stamps:
    """Times of a column, however fast they follow each other."""
    if values.dtype == object:
        values = _from_text(values, where, rows)
    if values.dtype.kind == "M":
        return _from_instants(values)
    if values.dtype.kind == "m":
        return _from_durations(values)
    if values.dtype.kind == "i":
        return _from_counts(values, _per_second(values, unit, where))
    numbers = np.where(np.isfinite(values), values, np.nan)
    factor = TIME_UNITS[unit] if unit in TIME_UNITS else _epoch_factor(numbers)
    _refuse_finer(numbers * factor, where)
    _refuse_single_precision(numbers, factor, where)
    seconds = _rolled_over(numbers * factor)
    if unit in (None, "s"):
        _refuse_days(numbers, where)
        _refuse_digits_of_clock(seconds, where)
    return Stamps(seconds, 0)


def as_floats(values: np.ndarray) -> np.ndarray:
    """Integers, instants and durations as floats, NaN where missing; others as they are."""
    if values.dtype.kind in "mM":
        stamps = _from_instants(values) if values.dtype.kind == "M" else _from_durations(values)
        return stamps.time_s + stamps.origin_s
    if values.dtype.kind == "i":
        return np.where(values == MISSING_COUNT, np.nan, values.astype(float))
    return values


def _from_counts(counts: np.ndarray, per_second: int) -> Stamps:
    """Integers as seconds, the whole ones of the earliest taken off before the division.

    A stamp that is none of a clock counts as missing: the largest and smallest numbers, and 0 or
    less among instants since 1970, which a clock shows that has not been set.
    """
    known = (counts != MISSING_COUNT) & (counts > -MOST_COUNT) & (counts < MOST_COUNT)
    if known.any() and np.median(counts[known]) >= LEAST_EPOCH_S * per_second:
        known &= counts > 0
    if not known.any():
        return Stamps(np.full(counts.size, np.nan), 0)
    origin = int(counts[known].min()) // per_second
    rest = np.where(known, counts, origin * per_second) - origin * per_second
    return Stamps(np.where(known, rest / per_second, np.nan), origin)


def _from_instants(instants: np.ndarray) -> Stamps:
    unit = np.datetime_data(instants.dtype)[0]
    if unit not in TIME_UNITS:  # whole days
        instants, unit = instants.astype("datetime64[s]"), "s"
    return _from_counts(instants.view(np.int64), round(1.0 / TIME_UNITS[unit]))


def _from_durations(durations: np.ndarray) -> Stamps:
    unit = np.datetime_data(durations.dtype)[0]
    return _from_counts(durations.view(np.int64), round(1.0 / TIME_UNITS[unit]))


def _per_second(counts: np.ndarray, unit: str | None, where: str) -> int:
    """How many of these counts make a second: as named, or by the magnitude of an epoch."""
    if unit in TIME_UNITS:
        per_second = round(1.0 / TIME_UNITS[unit])
        seconds = as_floats(counts) / per_second
        _refuse_finer(seconds, where, is_finer=unit == "s" and _usual_step(seconds) > MOST_STEP_S)
        return per_second
    numbers = as_floats(counts)
    factor = _epoch_factor(numbers)
    known = numbers[np.isfinite(numbers)] * factor
    if known.size and (np.median(known) < LEAST_EPOCH_S or _usual_step(known) > MOST_STEP_S):
        known = known / factor
        raise InputError(
            f"values from {known.min():.0f} to {known.max():.0f} are neither seconds nor an "
            "epoch in s, ms, us or ns",
            where,
            'Give the column the suffix of its unit (time_us), or set time_unit = "us" in '
            "a map (--map).",
        )
    return round(1.0 / factor)


def _refuse_days(numbers: np.ndarray, where: str) -> None:
    """Refuse dates as days, which would be a trial of a fraction of a second."""
    known = numbers[np.isfinite(numbers)]
    if known.size < 2 or not 0.0 < np.ptp(known) < MOST_DAY_STEP * known.size:
        return
    middle = float(np.median(known))
    for program, (least, most) in DAYS.items():
        if least <= middle <= most:
            raise InputError(
                f"times from {known.min():.6f} to {known.max():.6f}, {_usual_step(known):.2g} "
                f"apart, are days as {program} counts them, not seconds",
                where,
                "Export the time as text in ISO 8601 (column timestamp), or multiply it by 86400 "
                "(column time_s).",
            )


def _refuse_digits_of_clock(numbers: np.ndarray, where: str) -> None:
    """Refuse times of day as GPS receivers write them: each minute would be a gap of 40 s."""
    known = numbers[np.isfinite(numbers)]
    if known.size < FEWEST_OF_RATE or np.ptp(known) < LEAST_SPAN_S:
        return
    are_of_day = known.min() >= 0.0 and known.max() < 240000.0
    if not are_of_day or _usual_step(known) > MOST_CLOCK_STEP_S:
        return
    if np.all(known % 1e2 < 60.0) and np.all(known % 1e4 < 6e3):
        raise InputError(
            f"times from {known.min():.2f} to {known.max():.2f} never end in 60 to 99: they are "
            "hours, minutes and seconds (hhmmss), not seconds",
            where,
            "Write them as 12:34:56.7, or as seconds (column time_s).",
        )


def _refuse_finer(seconds: np.ndarray, where: str, is_finer: bool = False) -> None:
    """Refuse times beyond any epoch: counts of a finer unit than the column says."""
    known = seconds[np.isfinite(seconds)]
    if known.size and (is_finer or np.median(np.abs(known)) >= BEYOND_S):
        raise InputError(
            f"times from {known.min():.4g} to {known.max():.4g} s, {_usual_step(known):.3g} s "
            "apart, are counts of a finer unit (ms, us, ns)",
            where,
            "Give the column the suffix of its unit (time_ns), name it timestamp, or set "
            'time_unit = "ns" in a map (--map).',
        )


def _refuse_single_precision(numbers: np.ndarray, factor: float, where: str) -> None:
    """Refuse times of which 32 bits have kept no seconds: most rows share that of another."""
    known = numbers[np.isfinite(numbers)]
    if known.size < 2 or np.mean(np.diff(known) == 0.0) < MOST_SHARED:
        return
    with np.errstate(over="ignore"):
        rounded = known.astype(np.float32)
    step_s = float(np.spacing(np.abs(np.median(rounded)))) * factor
    if np.array_equal(rounded, known) and LEAST_LOST_S <= step_s < np.inf:
        raise InputError(
            f"times are floats of 32 bits, of which two neighbours are {step_s:.3g} s apart",
            where,
            "Store the time as floats of 64 bits (double), as integers or as instants; what is "
            "between those steps is lost in this file.",
        )


def _refuse_too_fast(seconds: np.ndarray, where: str) -> None:
    """Refuse rows that follow each other faster than those of any sensor, by their mean distance.

    Not by the median: messages may come in bursts.
    """
    known = seconds[np.isfinite(seconds)]
    span = float(np.ptp(known)) if known.size >= FEWEST_OF_RATE else 0.0
    if span > 0.0 and known.size - 1 > MOST_RATE_HZ * span:
        raise InputError(
            f"{known.size} rows in {span:.3g} s, {(known.size - 1) / span:.3g} a second, are more "
            "than any sensor delivers",
            where,
            "Check the unit of the time: time_unit in the map (--map), or the suffix of the "
            "column (time_s, time_ms).",
        )


def _epoch_factor(numbers: np.ndarray) -> float:
    magnitude = np.nanmedian(np.abs(numbers)) if np.isfinite(numbers).any() else 0.0
    for unit, least in EPOCH_MAGNITUDES:
        if magnitude >= least:
            return TIME_UNITS[unit]
    return 1.0


def _rolled_over(seconds: np.ndarray) -> np.ndarray:
    """Seconds of the day or of the GPS week, that go on where they begin again."""
    known = np.flatnonzero(np.isfinite(seconds))
    own = seconds[known]
    steps = np.diff(own)
    back = np.flatnonzero(steps < 0.0)
    if not back.size:
        return seconds
    least = int(back[np.argmin(steps[back])])
    near = ROLLED_STEPS * max(_usual_step(own), 1e-3)
    for period in ROLL_OVERS_S:
        within = own.min() >= 0.0 and own.max() <= period
        if within and -near <= steps[least] + period <= near:
            found = seconds.copy()
            found[known[least + 1 :]] += period
            return found
    return seconds


def _usual_step(seconds: np.ndarray) -> float:
    return float(np.median(np.abs(np.diff(seconds)))) if seconds.size > 1 else 0.0


def _from_text(values: np.ndarray, where: str, rows: np.ndarray) -> np.ndarray:
    texts = pd.Series(values, dtype=object).fillna("").astype(str).str.strip().str.strip('"')
    texts = texts.str.replace(r"(\d),(\d+)", r"\1.\2", regex=True)
    empty = texts == ""
    of_day = texts[~empty].str.fullmatch(TIME_OF_DAY)
    if of_day.size and of_day.all():
        return _from_time_of_day(texts)
    if of_day.size and texts[~empty].str.fullmatch(DURATION).all():
        plain = texts.mask(empty).str.replace(",", "", regex=False)
        return pd.to_timedelta(plain).dt.as_unit("ns").to_numpy()
    texts = texts.str.replace(DAY_FIRST, r"\3-\2-\1", regex=True)
    texts = texts.str.replace(SLASHED, r"\1-\2-\3", regex=True)
    texts = texts.str.replace(NAMED_MONTH, _with_number, regex=True)
    texts = texts.str.replace(UTC_WORD, "Z", regex=True)
    instants = pd.to_datetime(texts.mask(empty), format="ISO8601", utc=True, errors="coerce")
    wrong = np.flatnonzero(np.asarray(instants.isna() & ~empty))
    if wrong.size:  # among seconds stored as text, the word that made a text of them
        words = wrong[pd.to_numeric(texts.iloc[wrong], errors="coerce").isna()]
        first = (words if words.size else wrong)[0]
        raise InputError(
            f"{values[first]!r} is not an ISO 8601 time (2024-05-01T12:00:00.100Z)",
            f"{where}, row {rows[first]}",
            "Write seconds in a column time_s, or ISO 8601 or epoch counts in timestamp.",
        )
    return instants.dt.tz_convert(None).to_numpy()


def _with_number(found: re.Match[str]) -> str:
    """A date with the name of a month (``01-May-2024`` of MATLAB) as ISO 8601 has it."""
    return f"{found[3]}-{MONTHS.index(found[2].lower()) + 1:02d}-{int(found[1]):02d}"


def _from_time_of_day(texts: pd.Series) -> np.ndarray:
    """Times of day (``23:59:59.9``) as durations since the midnight before the first of them."""
    parts = texts.str.extract(TIME_OF_DAY).astype(float)
    seconds = (3600.0 * parts[0] + 60.0 * parts[1] + parts[2]).to_numpy()
    known = np.isfinite(seconds)
    own = seconds[known]
    # Both ways: a row that is out of order around midnight falls back into the day before.
    days = np.cumsum(np.rint(-np.diff(own, prepend=own[:1]) / DAY_S))
    ns = np.full(seconds.size, np.datetime64("NaT").astype("timedelta64[ns]"))
    ns[known] = np.rint((own + DAY_S * days) * 1e9).astype("timedelta64[ns]")
    return ns
