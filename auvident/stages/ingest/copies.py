"""One trial given twice: equal readings, whatever the name, the clock or the form of the file.

Readings are compared, not files. Successive readings of a channel are cut into short runs; the
noise of a sensor makes every such run unlike any other, so that two trials which share many of
them at one shift of the clock are one recording. Repeated values (a slow sensor on the clock of a
fast one) count once. A copy that was interpolated to another clock has no reading in common; it
is compared with the first one interpolated in the same way.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from auvident.constants import VehicleTime
from auvident.errors import InputError
from auvident.schema.channels import BY_COLUMN
from auvident.schema.logs import RawTrial
from auvident.stages.ingest.outliers import noise_std

COLUMNS = {c: BY_COLUMN[c].sensor for c in ("r_radps", "u_mps", "v_mps")}
STEP = 2e-4  # m/s, rad/s: rounding in files is finer, the noise of most sensors coarser
RUN = 12  # readings in a run
WINDOW_S = 0.25  # by which the clock of a wide file may be late for a reading
FEW_RUNS = 5  # in common: they give the shift at which readings are compared
MIN_RUNS = 25  # at one shift of the clock; of other trials hardly ever two are
MIN_SHARE = 0.5  # of the shorter trial
# long enough for a maneuver; recorders that roll over repeat a few seconds
MIN_COMMON_S: VehicleTime = 30.0
NOISE_SHARE = 0.25  # equal readings differ by rounding, others by more than the noise
MAX_PERIOD_S = 5.0  # readings farther apart are not interpolated
ELSEWHERE_S = (-7.9, -3.7, -1.3, 1.3, 3.7, 7.9)  # shifts at which a copy is unlike itself
FLOAT_DIGITS = 1e-6  # of the largest value: single precision
LARGEST = 1e3  # m/s, rad/s: beyond any reading that is one
ONE_VALUE = 1e-12  # m/s, rad/s
FACTORS = np.random.default_rng(0).integers(1, 2**63, RUN, dtype=np.uint64) | np.uint64(1)
REMEDY = (
    "Leave one of them out: a maneuver that is in two trials would be held out in one and "
    "used for identification in the other."
)


@dataclass(frozen=True)
class Readings:
    """Readings of one channel, in ascending time, and the runs among them that occur once.

    `keys` are ascending; `starts_s` and `first` are time and value at which each run begins;
    `period_s` is the mean time between readings, `resolution` their last digit.
    """

    time_s: np.ndarray
    values: np.ndarray
    keys: np.ndarray
    starts_s: np.ndarray
    first: np.ndarray
    period_s: float
    span_s: float
    resolution: float


@dataclass(frozen=True)
class Fingerprint:
    """What tells a trial from others."""

    name: str
    file: str
    origin: str
    readings: dict[str, Readings]


def fingerprint(raw: RawTrial) -> Fingerprint:
    """Runs of readings of the measured channels of a trial."""
    readings = {}
    for column, name in COLUMNS.items():
        sensor = raw.sensors.get(name)
        if sensor is not None and column in sensor.values:
            readings[column] = _readings(sensor.time_s, sensor.values[column])
    file = raw.sensors["gyro"].file if "gyro" in raw.sensors else ""
    return Fingerprint(raw.name, file, raw.origin, readings)


def refuse_copy(new: Fingerprint, earlier: Sequence[Fingerprint]) -> None:
    """Refuse a trial whose readings are those of an earlier one, or a part of them.

    Raises
    ------
    InputError
        Naming both.
    """
    for old in earlier:
        for column in COLUMNS:
            if column not in new.readings or column not in old.readings:
                continue
            common = _common_s(old.readings[column], new.readings[column], _ahead(old, new))
            if common is not None:
                raise InputError(
                    f"trial {new.name} contains the readings of trial {old.name}: "
                    f"{common:.0f} s of {column} are equal",
                    f"{new.file} and {old.file}",
                    REMEDY,
                )


def _readings(time_s: np.ndarray, values: np.ndarray) -> Readings:
    known = np.isfinite(values) & np.isfinite(time_s)
    time, x = time_s[known], values[known]
    steps = np.round(np.clip(x, -LARGEST, LARGEST) / STEP).astype(np.int64)
    changed = np.concatenate(([True], np.diff(steps) != 0)) if x.size else np.empty(0, bool)
    keys, starts = _runs(steps[changed])
    keys, place, times = np.unique(keys, return_index=True, return_counts=True)
    once = starts[place[times == 1]]
    span = float(time.max() - time.min()) if time.size else 0.0
    ascending = np.argsort(time, kind="stable")
    return Readings(
        time[ascending],
        x[ascending],
        keys[times == 1],
        time[changed][once],
        x[changed][once],
        span / max(int(np.count_nonzero(changed)), 1),
        span,
        _last_digit(x),
    )


def _last_digit(values: np.ndarray) -> float:
    """Smallest distance of two values, those that a conversion of units leaves apart not counted.

    Unlike the smallest step in time it tells a log of full digits from one of few.
    """
    apart = np.diff(np.unique(values))
    apart = apart[apart > ONE_VALUE]
    return float(apart.min()) if apart.size else 0.0


def _runs(steps: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Keys of the runs of readings and their starts; even ramps, all alike, are left out."""
    if steps.size < RUN:
        return np.empty(0, np.uint64), np.empty(0, int)
    runs = np.lib.stride_tricks.sliding_window_view(steps, RUN)
    rises = np.lib.stride_tricks.sliding_window_view(np.diff(steps), RUN - 1)
    even = np.ptp(rises, axis=1) <= 1  # a coarse sensor in a slow turn: one digit after the other
    starts = np.flatnonzero(~even)
    with np.errstate(over="ignore"):
        keys = (runs[starts].astype(np.uint64) * FACTORS).sum(axis=1, dtype=np.uint64)
    return keys, starts


def _ahead(old: Fingerprint, new: Fingerprint) -> float | None:
    """By how much an instant has more seconds in the new trial, if the clocks are one."""
    if not old.origin and not new.origin:
        return 0.0
    if not old.origin or not new.origin:
        return None
    origins = np.array([t.removesuffix("Z") for t in (old.origin, new.origin)], "datetime64[s]")
    return float((origins[0] - origins[1]) / np.timedelta64(1, "s"))


def _common_s(old: Readings, new: Readings, ahead: float | None) -> float | None:
    """Seconds in common when two channels are one recording, else None."""
    least = min(MIN_COMMON_S, MIN_SHARE * min(old.span_s, new.span_s))
    a, b, shift = _runs_in_common(old, new)
    common = max(old.period_s, new.period_s) * a.size
    if a.size >= MIN_RUNS and common >= least and _equal(old, new, a, b):
        return common
    shifts = [x for x in (ahead, shift) if x is not None]
    found = max((_equal_between(old, new, x) for x in shifts), default=0.0)
    return found if found >= least and found > 0 else None


def _runs_in_common(old: Readings, new: Readings) -> tuple[np.ndarray, np.ndarray, float | None]:
    """Runs of both that are alike at one shift of the clock, the most, and that shift."""
    _, a, b = np.intersect1d(old.keys, new.keys, assume_unique=True, return_indices=True)
    if a.size < FEW_RUNS:
        return a[:0], b[:0], None
    shift = new.starts_s[b] - old.starts_s[a]
    order = np.argsort(shift)
    count = np.searchsorted(shift[order], shift[order] + WINDOW_S, "right") - np.arange(a.size)
    best = int(np.argmax(count))
    same = order[best : best + count[best]]
    return a[same], b[same], float(np.median(shift[same]))


def _equal(old: Readings, new: Readings, a: np.ndarray, b: np.ndarray) -> bool:
    """Whether readings differ by rounding only."""
    apart = float(np.sqrt(np.mean((new.first[b] - old.first[a]) ** 2)))
    return apart <= _rounding(old, new)


def _rounding(old: Readings, new: Readings) -> float:
    """Largest difference of one reading in two files: half of the last digit."""
    largest = float(np.abs(old.values).max(initial=0.0))
    return 0.5 * max(old.resolution, new.resolution) + FLOAT_DIGITS * largest


def _equal_between(old: Readings, new: Readings, ahead: float) -> float:
    """Seconds in which one is the other interpolated: equal at this shift, at others not."""
    for source, other, shift in ((old, new, ahead), (new, old, -ahead)):
        share, common = _interpolated(source, other, shift)
        if share >= MIN_SHARE:
            elsewhere = (_interpolated(source, other, shift + by)[0] for by in ELSEWHERE_S)
            if max(elsewhere) < MIN_SHARE * share:
                return common
    return 0.0


def _interpolated(source: Readings, other: Readings, ahead: float) -> tuple[float, float]:
    """Share of the readings that lie on the line between two of the source, and their seconds."""
    time, x = source.time_s, source.values
    t = other.time_s - ahead
    after = np.clip(np.searchsorted(time, t), 1, max(time.size - 1, 1))
    if time.size < 2 or not t.size:
        return 0.0, 0.0
    inside = (t >= time[0]) & (t <= time[-1]) & (time[after] - time[after - 1] <= MAX_PERIOD_S)
    apart = np.abs(np.interp(t, time, x) - other.values)[inside]
    limit = _rounding(source, other)
    if inside.sum() < MIN_RUNS or limit > NOISE_SHARE * noise_std(x):
        return 0.0, 0.0
    share = float(np.mean(apart <= limit))
    return share, share * float(np.ptp(t[inside]))
