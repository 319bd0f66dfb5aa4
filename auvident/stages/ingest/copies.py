"""One trial given twice: equal readings, whatever the name, the clock or the form of the file.

Readings are compared, not files. Successive readings of a channel are cut into short runs; the
noise of a sensor makes every such run unlike any other, so that two trials which share many of
them at one shift of the clock are one recording. Repeated values (a slow sensor on the clock of a
fast one) count once. A copy that was interpolated to another clock has no reading in common; it
is compared with the first one interpolated in the same way, and as one that was resampled in any
other way (`auvident.stages.ingest.resampled`).
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from auvident.constants import VehicleTime
from auvident.errors import InputError
from auvident.schema.artifacts import Finding
from auvident.schema.channels import BY_COLUMN
from auvident.schema.logs import FIRST_FEW, RawSensor, RawTrial
from auvident.stages.ingest.outliers import noise_std
from auvident.stages.ingest.resampled import (
    LEFT_OVER,
    Even,
    Signal,
    evenly,
    left_over,
    likely_shifts,
)

Span = tuple[float, float, float]  # seconds in common, from when, to when
NOTHING: Span = (0.0, 0.0, 0.0)
YAW_RATE = "r_radps"
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
MOST_RUNS = 1_000_000  # of longer logs every second, fourth, ... run is kept, chosen by its key
MOST_READINGS = 1_000_000  # of longer logs pieces are compared,
PIECE = 20_000  # of so many readings
BLOCK = 1 << 18  # readings whose runs are made together
KEY_SHIFT = 40  # the low bits of a key follow the low bits of its readings
IN_ANOTHER = "in_another_trial"  # why rows are dropped
MARGIN_S = 1.0  # about what is shared: other sensors begin a little earlier, end a little later
LONGER = 1.05  # times as long: the shorter trial is a part
FACTORS = np.random.default_rng(0).integers(1, 2**63, RUN, dtype=np.uint64) | np.uint64(1)
REMEDY = (
    "Leave one of them out: a maneuver that is in two trials would be held out in one and "
    "used for identification in the other."
)


@dataclass(frozen=True)
class Readings:
    """Readings of one channel, in ascending time, and the runs among them that occur once.

    `keys` are ascending; `starts_s` and `first` are time and value at which each run begins;
    `period_s` is the mean time between readings, `resolution` their last digit. Of long logs
    `time_s` and `values` are pieces, and one run in `thinned` is kept.
    """

    time_s: np.ndarray
    values: np.ndarray
    keys: np.ndarray
    starts_s: np.ndarray
    first: np.ndarray
    period_s: float
    span_s: float
    resolution: float
    thinned: int = 1

    @cached_property
    def noise(self) -> float:
        """Standard deviation of the noise."""
        return noise_std(self.values)

    @cached_property
    def largest(self) -> float:
        """Largest magnitude of a value."""
        return float(np.abs(self.values).max(initial=0.0))

    @cached_property
    def signal(self) -> Signal:
        """The readings as those of a resampled log are held against them."""
        return Signal(self.time_s, self.values)


@dataclass(frozen=True)
class Fingerprint:
    """What tells a trial from others."""

    name: str
    file: str
    origin: str
    readings: dict[str, Readings]
    even: Even | None = None

    @property
    def span_s(self) -> float:
        """Seconds from the first reading to the last."""
        return max((r.span_s for r in self.readings.values()), default=0.0)


@dataclass(frozen=True)
class Common:
    """What a trial shares with an earlier one: seconds of a channel, and when on its own clock."""

    old: Fingerprint
    column: str
    seconds: float
    from_s: float
    to_s: float


def fingerprint(raw: RawTrial) -> Fingerprint:
    """Runs of readings of the measured channels of a trial."""
    readings = {}
    for column, name in COLUMNS.items():
        sensor = raw.sensors.get(name)
        if sensor is not None and column in sensor.values:
            readings[column] = _readings(sensor.time_s, sensor.values[column])
    gyro = raw.sensors.get("gyro")
    if gyro is None or YAW_RATE not in gyro.values:
        return Fingerprint(raw.name, "", raw.origin, readings)
    even = evenly(*_ascending(gyro.time_s, gyro.values[YAW_RATE]), MAX_PERIOD_S)
    return Fingerprint(raw.name, gyro.file, raw.origin, readings, even)


def refuse_copy(new: Fingerprint, earlier: Sequence[Fingerprint]) -> None:
    """Refuse a trial whose readings are those of an earlier one, or of a good part of it.

    Raises
    ------
    InputError
        Naming both.
    """
    for common in find_copies(new, earlier):
        if not _is_partial(new, common):
            raise _twice(new, common)


def find_copies(new: Fingerprint, earlier: Sequence[Fingerprint]) -> list[Common]:
    """Earlier trials that a trial shares readings with, and how many."""
    found = (_in_common(old, new) for old in earlier)
    return [common for common in found if common is not None]


def without_copies(
    raw: RawTrial,
    own: Fingerprint,
    earlier: Sequence[Fingerprint],
    replaceable: Collection[str] = (),
) -> tuple[RawTrial, tuple[str, ...]]:
    """A trial without the readings that stand in an earlier one.

    Parameters
    ----------
    raw : RawTrial
        The trial.
    own : Fingerprint
        Of it.
    earlier : sequence of Fingerprint
        Of the trials in use.
    replaceable : collection of str
        Names of those that may give way to a longer recording.

    Returns
    -------
    raw : RawTrial
        Less a part that it shares with another one, which a finding tells.
    parts : tuple of str
        Earlier trials that are parts of this one.

    Raises
    ------
    InputError
        When it is a copy of an earlier trial or a good part of it.
    """
    parts = []
    for common in find_copies(own, earlier):
        if _is_partial(own, common):
            raw = _without(raw, common)
        elif common.old.name in replaceable and own.span_s > LONGER * common.old.span_s:
            parts.append(common.old.name)
        else:
            raise _twice(own, common)
    return raw, tuple(parts)


def _is_partial(new: Fingerprint, common: Common) -> bool:
    """Whether the time in common, repeated readings and lost ones included, is the lesser part."""
    return common.to_s - common.from_s < MIN_SHARE * min(new.span_s, common.old.span_s)


def _twice(new: Fingerprint, common: Common) -> InputError:
    return InputError(
        f"trial {new.name} contains the readings of trial {common.old.name}: "
        f"{common.seconds:.0f} s of {common.column} are equal",
        f"{new.file} and {common.old.file}",
        REMEDY,
    )


def _without(raw: RawTrial, common: Common) -> RawTrial:
    """The trial without the time that it shares, said and counted."""
    told = Finding(
        code="trials_overlap",
        message=f"{common.seconds:.0f} s of trial {raw.name} ({common.from_s:.1f} to "
        f"{common.to_s:.1f} s) are also in trial {common.old.name}; they are used there alone",
        where=f"trial {raw.name}",
        value=common.seconds,
        threshold=MIN_COMMON_S,
        remedy="End one recording where the next begins: a maneuver of both would be held out in "
        "one and used for identification in the other.",
    )
    sensors = {name: _cut(sensor, common) for name, sensor in raw.sensors.items()}
    return replace(raw, sensors=sensors, findings=(*raw.findings, told))


def _cut(sensor: RawSensor, common: Common) -> RawSensor:
    shared = sensor.time_s >= common.from_s - MARGIN_S
    shared &= sensor.time_s <= common.to_s + MARGIN_S
    if not shared.any():
        return sensor
    rows = tuple(int(row) for row in sensor.rows[shared][:FIRST_FEW])
    return replace(
        sensor,
        time_s=sensor.time_s[~shared],
        values={column: x[~shared] for column, x in sensor.values.items()},
        rows=sensor.rows[~shared],
        dropped=sensor.dropped | {IN_ANOTHER: int(shared.sum())},
        dropped_rows=sensor.dropped_rows | {IN_ANOTHER: rows},
    )


def _ascending(time_s: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Known readings in the order of time."""
    known = np.isfinite(values) & np.isfinite(time_s)
    if not known.all():
        time_s, values = time_s[known], values[known]
    if np.all(time_s[1:] >= time_s[:-1]):
        return time_s, values
    order = np.argsort(time_s, kind="stable")
    return time_s[order], values[order]


def _readings(time_s: np.ndarray, values: np.ndarray) -> Readings:
    known = np.isfinite(values) & np.isfinite(time_s)
    time, x = time_s[known], values[known]
    steps = np.round(np.clip(x, -LARGEST, LARGEST) / STEP).astype(np.int64)
    changed = np.concatenate(([True], np.diff(steps) != 0)) if x.size else np.empty(0, bool)
    thinned = 1 << max(0, int(x.size // MOST_RUNS).bit_length())
    keys, starts = _runs(steps[changed], thinned)
    keys, place, times = np.unique(keys, return_index=True, return_counts=True)
    once = starts[place[times == 1]]
    span = float(time.max() - time.min()) if time.size else 0.0
    ascending = _pieces(*_ascending(time, x))
    return Readings(
        *ascending,
        keys[times == 1],
        time[changed][once],
        x[changed][once],
        span / max(int(np.count_nonzero(changed)), 1),
        span,
        _last_digit(ascending[1]),
        thinned,
    )


def _pieces(time_s: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Readings of a long log in pieces that are spread over it; the others are let go."""
    if time_s.size <= MOST_READINGS:
        return time_s, values
    first = np.linspace(0, time_s.size - PIECE, MOST_READINGS // PIECE).astype(int)
    chosen = (first[:, None] + np.arange(PIECE)).ravel()
    return time_s[chosen], values[chosen]


def _last_digit(values: np.ndarray) -> float:
    """Smallest distance of two values, those that a conversion of units leaves apart not counted.

    Unlike the smallest step in time it tells a log of full digits from one of few.
    """
    apart = np.diff(np.unique(values))
    apart = apart[apart > ONE_VALUE]
    return float(apart.min()) if apart.size else 0.0


def _runs(steps: np.ndarray, thinned: int) -> tuple[np.ndarray, np.ndarray]:
    """Keys of the runs of readings and their starts; even ramps, all alike, are left out."""
    if steps.size < RUN:
        return np.empty(0, np.uint64), np.empty(0, int)
    parts = [
        _runs_of(steps[k : k + BLOCK + RUN - 1], np.uint64(thinned - 1))
        for k in range(0, steps.size - RUN + 1, BLOCK)
    ]
    keys = np.concatenate([keys for keys, _ in parts])
    return keys, np.concatenate([k * BLOCK + starts for k, (_, starts) in enumerate(parts)])


def _runs_of(steps: np.ndarray, mask: np.uint64) -> tuple[np.ndarray, np.ndarray]:
    runs = np.lib.stride_tricks.sliding_window_view(steps, RUN)
    rises = np.lib.stride_tricks.sliding_window_view(np.diff(steps), RUN - 1)
    even = np.ptp(rises, axis=1) <= 1  # a coarse sensor in a slow turn: one digit after the other
    starts = np.flatnonzero(~even)
    with np.errstate(over="ignore"):
        keys = (runs[starts].astype(np.uint64) * FACTORS).sum(axis=1, dtype=np.uint64)
    kept = (keys >> np.uint64(KEY_SHIFT)) & mask == 0
    return keys[kept], starts[kept]


def _ahead(old: Fingerprint, new: Fingerprint) -> float | None:
    """By how much an instant has more seconds in the new trial, if the clocks are one."""
    if not old.origin and not new.origin:
        return 0.0
    if not old.origin or not new.origin:
        return None
    origins = np.array([t.removesuffix("Z") for t in (old.origin, new.origin)], "datetime64[s]")
    return float((origins[0] - origins[1]) / np.timedelta64(1, "s"))


def _in_common(old: Fingerprint, new: Fingerprint) -> Common | None:
    """What two trials share, by the first channel that shows it."""
    ahead = _ahead(old, new)
    for column in COLUMNS:
        if column in new.readings and column in old.readings:
            found = _shared(old.readings[column], new.readings[column], ahead)
            if found is not None:
                return Common(old, column, *found)
    resampled = _resampled(old, new, ahead)
    return Common(old, YAW_RATE, *resampled) if resampled is not None else None


def _shared(old: Readings, new: Readings, ahead: float | None) -> Span | None:
    """Seconds in common when two channels are one recording, and from when to when."""
    least = min(MIN_COMMON_S, MIN_SHARE * min(old.span_s, new.span_s))
    a, b, shift = _runs_in_common(old, new)
    period = max(old.period_s, new.period_s)
    common = period * a.size * max(old.thinned, new.thinned)
    if a.size >= MIN_RUNS and common >= least and _equal(old, new, a, b):
        starts = new.starts_s[b]
        return common, float(starts.min()), float(starts.max()) + RUN * period
    shifts = [x for x in (ahead, shift) if x is not None]
    found = max((_equal_between(old, new, x) for x in shifts), default=NOTHING)
    return found if found[0] >= least and found[0] > 0 else None


def _resampled(old: Fingerprint, new: Fingerprint, ahead: float | None) -> Span | None:
    """Seconds in which one is a filter of the other, and from when to when."""
    if old.even is None or new.even is None:
        return None
    a, b = old.readings[YAW_RATE], new.readings[YAW_RATE]
    least = min(MIN_COMMON_S, MIN_SHARE * min(a.span_s, b.span_s))
    if min(a.time_s.size, b.time_s.size) < RUN:
        return None
    periods = [a.signal.step_s, b.signal.step_s]
    shifts = [] if ahead is None else [ahead]
    for shift in [*shifts, *likely_shifts(old.even, new.even, max(periods))]:
        forth = periods[0] <= periods[1]
        source, other = (a, b) if forth else (b, a)
        ahead_s = shift if forth else -shift
        share, times = left_over(source.signal, other.signal, ahead_s, MAX_PERIOD_S)
        if share < LEFT_OVER and np.ptp(times) >= least:
            back = 0.0 if forth else shift
            return float(np.ptp(times)), float(times[0] + back), float(times[-1] + back)
    return None


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
    return 0.5 * max(old.resolution, new.resolution) + FLOAT_DIGITS * old.largest


def _equal_between(old: Readings, new: Readings, ahead: float) -> Span:
    """Seconds in which one is the other interpolated: equal at this shift, at others not."""
    for source, other, shift in ((old, new, ahead), (new, old, -ahead)):
        share, times = _interpolated(source, other, shift)
        if share >= MIN_SHARE:
            elsewhere = (_interpolated(source, other, shift + by)[0] for by in ELSEWHERE_S)
            if max(elsewhere) < MIN_SHARE * share:
                back = 0.0 if other is new else ahead
                return share * float(np.ptp(times)), times[0] + back, times[-1] + back
    return NOTHING


def _interpolated(source: Readings, other: Readings, ahead: float) -> tuple[float, np.ndarray]:
    """Share of the readings that lie on the line between two of the source, and their times."""
    time, x = source.time_s, source.values
    t = other.time_s - ahead
    limit = _rounding(source, other)
    if limit > NOISE_SHARE * source.noise:
        return 0.0, t[:0]
    after = np.clip(np.searchsorted(time, t), 1, max(time.size - 1, 1))
    if time.size < 2 or not t.size:
        return 0.0, t[:0]
    inside = (t >= time[0]) & (t <= time[-1]) & (time[after] - time[after - 1] <= MAX_PERIOD_S)
    apart = np.abs(np.interp(t, time, x) - other.values)[inside]
    if inside.sum() < MIN_RUNS:
        return 0.0, t[:0]
    return float(np.mean(apart <= limit)), other.time_s[inside]
