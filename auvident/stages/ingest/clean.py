"""Samples of each channel that are fit for use: empty, repeated and implausible ones go."""

from dataclasses import dataclass, field, replace

import numpy as np

from auvident.errors import InputError
from auvident.schema.channels import BY_COLUMN, Channel
from auvident.schema.logs import FIRST_FEW, Dropped, RawSensor, RawTrial
from auvident.schema.vehicle import Vehicle
from auvident.stages.ingest.order import order_rows
from auvident.stages.ingest.outliers import find_outliers, keep_one_of_held
from auvident.stages.ingest.units import refuse_wrong_unit


@dataclass(frozen=True)
class Series:
    """Clean samples of one channel; `dropped` counts samples by reason.

    Of the samples before the last drop a mask is kept instead of a copy of the others: a day of
    a fast gyro has some outliers in each channel.
    """

    channel: Channel
    all_times_s: np.ndarray
    all_values: np.ndarray
    used: np.ndarray | None = None
    dropped: dict[str, Dropped] = field(default_factory=dict)

    @property
    def time_s(self) -> np.ndarray:
        """Times, shape (n,), strictly ascending."""
        return self.all_times_s if self.used is None else self.all_times_s[self.used]

    @property
    def values(self) -> np.ndarray:
        """Values in the internal sign, shape (n,); angles are unwrapped."""
        return self.all_values if self.used is None else self.all_values[self.used]

    def changed_by(self, change: np.ndarray) -> "Series":
        """The same samples with something added to their values."""
        values = self.values + change
        return replace(self, all_times_s=self.time_s, all_values=values, used=None)


@dataclass(frozen=True)
class CleanSensor:
    """Clean samples of one sensor; `time_s` holds the ticks with a sample of any channel."""

    raw: RawSensor
    series: dict[str, Series]
    time_s: np.ndarray
    dropped: dict[str, Dropped]


def clean_sensor(raw: RawSensor, vehicle: Vehicle) -> CleanSensor:
    """Order the rows of a sensor and clean each of its channels.

    Parameters
    ----------
    raw : RawSensor
        As read.
    vehicle : Vehicle
        For the signs of the control angles.

    Raises
    ------
    InputError
        When time goes backward for good, or a channel is mostly beyond what is possible.
    """
    ordered = order_rows(raw)
    keep = ordered.keep
    dropped = _with(_reader_drops(raw), "backward_time", raw, ordered.backward)
    held = keep_one_of_held(raw, keep)
    if held is not None:
        dropped = _with(dropped, "held_copy", raw, keep[~held])
        keep = keep[held]
    series = {}
    for column in raw.values:
        clean = _clean_channel(raw, BY_COLUMN[column], keep, vehicle)
        if clean.time_s.size:
            series[column] = clean
    return CleanSensor(raw, series, _ticks([*series.values()]), dropped)


def _ticks(series: list[Series]) -> np.ndarray:
    """Times with a sample of any channel."""
    used = [s.used for s in series if s.used is not None]
    if series and all(s.all_times_s is series[0].all_times_s for s in series):
        all_times_s = series[0].all_times_s
        return all_times_s[np.logical_or.reduce(used)] if len(used) == len(series) else all_times_s
    ticks = np.empty(0)
    for s in series:
        ticks = np.union1d(ticks, s.time_s) if ticks.size else s.time_s
    return ticks


def internal_sign(channel: Channel, vehicle: Vehicle) -> int:
    """Factor from the log's sign of a control angle to the internal one."""
    signs = {"rudder": vehicle.rudder_sign, "elevator": vehicle.elevator_sign}
    return signs.get(channel.quantity, 1)


def _reader_drops(raw: RawSensor) -> dict[str, Dropped]:
    return {
        reason: Dropped(count=n, first_rows=raw.dropped_rows.get(reason, ()))
        for reason, n in raw.dropped.items()
    }


def _with(
    dropped: dict[str, Dropped], reason: str, raw: RawSensor, which: np.ndarray
) -> dict[str, Dropped]:
    """Add the samples `which` (indices into the raw rows) under a reason."""
    if not which.size:
        return dropped
    first = which[:FIRST_FEW]
    times = tuple(float(t) for t in raw.time_s[first])
    rows = tuple(int(row) for row in raw.rows[first])
    return dropped | {reason: Dropped(count=int(which.size), first_times_s=times, first_rows=rows)}


def _clean_channel(raw: RawSensor, channel: Channel, keep: np.ndarray, vehicle: Vehicle) -> Series:
    whole = keep.size == raw.time_s.size
    time, values = raw.time_s, raw.values[channel.column]
    if not whole:
        time, values = time[keep], values[keep]
    index: np.ndarray | slice = slice(None)  # all of them, without a copy
    dropped: dict[str, Dropped] = {}

    def drop(reason: str, bad: np.ndarray) -> None:
        nonlocal index, dropped
        if bad.any():
            chosen = np.arange(keep.size)[index]
            dropped = _with(dropped, reason, raw, keep[chosen[bad]])
            index = chosen[~bad]

    drop("empty", np.isnan(values))
    drop("repeated_time", _repeated(time[index], keep_last=channel.kind == "input"))
    if not channel.is_angle:
        refuse_wrong_unit(raw, channel, values[index])
        drop("implausible", np.abs(values[index]) > channel.plausible)
    if channel.kind == "measured" and channel.column not in raw.not_logged:
        drop("outlier", find_outliers(_unwrapped(values[index], channel)))
    sign = internal_sign(channel, vehicle)
    if channel.is_angle or sign < 0:
        clean = _unwrapped(values[index], channel) * sign
        return Series(channel, time[index], clean, dropped=dropped)
    used = None if whole and isinstance(index, slice) else _mask(raw.time_s.size, keep[index])
    return Series(channel, raw.time_s, raw.values[channel.column], used, dropped)


def _mask(size: int, chosen: np.ndarray) -> np.ndarray:
    mask = np.zeros(size, dtype=bool)
    mask[chosen] = True
    return mask


def _repeated(time: np.ndarray, keep_last: bool) -> np.ndarray:
    """Samples at a time that has another: of a command the last holds, else the first counts."""
    same = np.zeros(time.size, dtype=bool)
    if keep_last:
        same[:-1] = time[1:] <= time[:-1]
    else:
        same[1:] = time[1:] <= time[:-1]
    return same


def _unwrapped(values: np.ndarray, channel: Channel) -> np.ndarray:
    return np.unwrap(values) if channel.is_angle and values.size else values


def clean_trial(raw: RawTrial, vehicle: Vehicle, needed: tuple[str, ...]) -> dict[str, CleanSensor]:
    """Clean every sensor of a trial.

    Raises
    ------
    InputError
        When a needed channel is missing or has no usable sample.
    """
    clean = {name: clean_sensor(sensor, vehicle) for name, sensor in raw.sensors.items()}
    for column in needed:
        channel = BY_COLUMN[column]
        sensor = clean.get(channel.sensor)
        if sensor is None or column not in sensor.raw.values:
            raise InputError(
                f"no {column} ({channel.meaning})", f"trial {raw.name}", "Add it to the log."
            )
        if column not in sensor.series:
            raise InputError(
                f"column {sensor.raw.columns[column]} ({channel.meaning}) has no usable sample: "
                f"{_why_none(sensor)}",
                sensor.raw.file,
                "Record it, or name another column in a map (--map).",
            )
    return clean


def _why_none(sensor: CleanSensor) -> str:
    reasons = [f"{d.count} {reason}" for reason, d in sensor.dropped.items()]
    return f"all {sensor.raw.rows_read} rows are empty or dropped" + (
        f" ({', '.join(reasons)})" if reasons else ""
    )
