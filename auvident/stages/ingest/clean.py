"""Samples of each channel that are fit for use: empty, repeated and impossible ones go."""

from dataclasses import dataclass, field, replace

import numpy as np

from auvident.errors import InputError
from auvident.schema.channels import BY_COLUMN, Channel
from auvident.schema.logs import FIRST_FEW, Dropped, RawSensor, RawTrial
from auvident.schema.vehicle import Vehicle
from auvident.stages.ingest.drop_outs import find_drop_outs, find_pulses
from auvident.stages.ingest.fill_values import (
    fill_in_same_rows,
    find_fills,
    is_impossible,
    is_sentinel,
)
from auvident.stages.ingest.flat import find_flat
from auvident.stages.ingest.held_copies import holds_throughout, keep_one_of_held, slow_samples
from auvident.stages.ingest.order import order_rows
from auvident.stages.ingest.outliers import find_outliers, of_rows
from auvident.stages.ingest.overflow import find_overflows
from auvident.stages.ingest.pace import Pace, pace_of
from auvident.stages.ingest.remarks import NOT_A_FAULT
from auvident.stages.ingest.spikes import find_spikes
from auvident.stages.ingest.units import refuse_wrong_unit

# Depth and position may stand still, angles of attitude are smoothed.
LEAST_LEFT = 0.3  # of the samples of a needed channel
FLAT_SENSORS = ("dvl", "gyro", "rudder", "elevator", "rpm")


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

    def only(self, which: np.ndarray) -> "Series":
        """Some of the samples."""
        time_s, values = self.time_s[which], self.values[which]
        return replace(self, all_times_s=time_s, all_values=values, used=None)

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
    """Clean samples of one sensor; `time_s` holds the ticks with a sample of any channel.

    `lost` has the channels without any sample left: what was dropped, by reason.
    """

    raw: RawSensor
    series: dict[str, Series]
    time_s: np.ndarray
    dropped: dict[str, Dropped]
    lost: dict[str, dict[str, Dropped]] = field(default_factory=dict)


def clean_sensor(raw: RawSensor, vehicle: Vehicle, pace: Pace) -> CleanSensor:
    """Order the rows of a sensor and clean each of its channels.

    Parameters
    ----------
    raw : RawSensor
        As read.
    vehicle : Vehicle
        For the signs of the control angles.
    pace : Pace
        Of the vehicle, for what its readings can do.

    Raises
    ------
    InputError
        When time goes backward for good, or a channel is mostly beyond what is possible.
    """
    ordered = order_rows(raw)
    keep = ordered.keep
    dropped = _with(_reader_drops(raw), "backward_time", raw, ordered.backward)
    copies = _copies(raw, keep, pace)
    thinned = keep[~copies] if copies.any() else keep
    filled = _fill_values(raw, thinned, pace)
    late = _copied_fixes(raw, thinned, filled)
    dropped = _with(dropped, "held_copy", raw, thinned[late] if late.any() else keep[copies])
    keep = thinned[~late] if late.any() else thinned
    filled = {column: own[~late] for column, own in filled.items()} if late.any() else filled
    series, lost = {}, {}
    for column in raw.values:
        clean = _clean_channel(raw, BY_COLUMN[column], keep, filled[column], vehicle, pace)
        if clean.time_s.size:
            series[column] = clean
        else:
            lost[column] = clean.dropped
    return CleanSensor(raw, series, _ticks([*series.values()]), dropped, lost)


def _ticks(series: list[Series]) -> np.ndarray:
    """Times with a sample of any channel."""
    used = [s.used for s in series if s.used is not None]
    if series and all(s.all_times_s is series[0].all_times_s for s in series):
        all_times_s = series[0].all_times_s
        if len(used) < len(series):
            return all_times_s
        every = np.logical_or.reduce(used)
        return all_times_s if every.all() else all_times_s[every]
    ticks = np.empty(0)
    for s in series:
        ticks = np.union1d(ticks, s.time_s) if ticks.size else s.time_s
    return ticks


def internal_sign(channel: Channel, vehicle: Vehicle) -> int:
    """Factor from the log's sign of a control angle to the internal one.

    The one that turns to port is positive because it pushes the stern to starboard: a fin ahead
    of the origin turns the vehicle by the other sign.
    """
    signs = {"rudder": vehicle.rudder_sign, "elevator": vehicle.elevator_sign}
    fin = channel.quantity
    if fin in signs and (ahead := vehicle.station_of(fin)) > 0.0:
        raise InputError(
            f"the {fin} stands {ahead:.2g} m ahead of the origin",
            f"{vehicle.body.name}: [[fin]] x_m",
            "x_m is measured from O, forward positive: a stern fin has x_m < 0. Logs of a vehicle "
            "that steers with bow planes alone cannot be used.",
        )
    return signs.get(fin, 1)


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


def _copies(raw: RawSensor, keep: np.ndarray, pace: Pace) -> np.ndarray:
    """Which of the rows `keep` repeat the one before them; zeros of a lost bottom are no copies."""
    none = np.zeros(keep.size, dtype=bool)
    held = None if raw.sensor == "position" else keep_one_of_held(raw, keep)
    if held is None or holds_throughout(raw, keep):
        return none if held is None else ~held
    lost = np.logical_or.reduce([*_fill_values(raw, keep, pace).values()])
    held = keep_one_of_held(raw, keep[~lost])
    if held is not None:
        none[~lost] = ~held
    return none


def _copied_fixes(raw: RawSensor, keep: np.ndarray, filled: dict[str, np.ndarray]) -> np.ndarray:
    """Which rows repeat a fix in a log of more rows than fixes: it would come half a fix late.

    Or a depth. Only once fill values are found, of which each copy counts.
    """
    none = np.zeros(keep.size, dtype=bool)
    held = keep_one_of_held(raw, keep) if raw.sensor == "position" else None
    if raw.sensor == "depth":
        held = slow_samples(of_rows(raw.time_s, keep), of_rows(raw.values["depth_m"], keep))
    if held is None:
        return none
    return ~held & ~np.logical_or.reduce([none, *filled.values()])


def _fill_values(raw: RawSensor, keep: np.ndarray, pace: Pace) -> dict[str, np.ndarray]:
    """Which of the rows `keep` hold a fill value, for each channel of a sensor."""
    filled, values, time = {}, {}, of_rows(raw.time_s, keep)
    for column in raw.values:
        channel = BY_COLUMN[column]
        filled[column] = np.zeros(keep.size, dtype=bool)
        own = values[column] = of_rows(raw.values[column], keep)
        if column in raw.not_logged:
            continue
        known = ~np.isnan(own)
        impossible = known & is_impossible(own, channel)
        filled[column][impossible] = is_sentinel(own[impossible], channel)
        rest = known & ~impossible
        find = find_fills if channel.kind == "measured" else find_drop_outs
        if rest.all():
            filled[column] = find(time, own, channel, pace)
        else:
            filled[column][rest] = find(time[rest], own[rest], channel, pace)
    fill_in_same_rows(filled, values)
    return filled


class _Used:
    """Readings of a channel that are left, and those dropped, by reason."""

    def __init__(self, raw: RawSensor, column: str, keep: np.ndarray) -> None:
        self.raw, self.keep = raw, keep
        self._time, self._values = of_rows(raw.time_s, keep), of_rows(raw.values[column], keep)
        self.left: np.ndarray | slice = slice(None)  # all of them, without a copy; else a mask
        self.dropped: dict[str, Dropped] = {}

    @property
    def time(self) -> np.ndarray:
        return self._time[self.left]

    @property
    def values(self) -> np.ndarray:
        return self._values[self.left]

    def drop(self, reason: str, bad: np.ndarray) -> None:
        """Leave out some of those that are left."""
        if bad.any():
            mask = (
                np.ones(self.keep.size, dtype=bool) if isinstance(self.left, slice) else self.left
            )
            found = np.flatnonzero(mask)[bad]
            self.dropped = _with(self.dropped, reason, self.raw, self.keep[found])
            mask[found] = False
            self.left = mask

    def rows(self) -> np.ndarray | None:
        """Which rows of the sensor are left; None for all."""
        size = self.raw.time_s.size
        if self.keep.size != size:
            return _mask(size, self.keep[self.left])
        return None if isinstance(self.left, slice) else self.left


def _clean_channel(
    raw: RawSensor,
    channel: Channel,
    keep: np.ndarray,
    filled: np.ndarray,
    vehicle: Vehicle,
    pace: Pace,
) -> Series:
    used = _Used(raw, channel.column, keep)
    used.drop("empty", np.isnan(used.values))
    used.drop("repeated_time", _repeated(used.time, keep_last=channel.kind == "input"))
    used.drop("fill_value", filled[used.left])
    if not channel.is_angle:
        refuse_wrong_unit(raw, channel, used.values)
    used.drop("implausible", is_impossible(used.values, channel))
    if channel.column not in raw.not_logged:
        _drop_faults(used, channel, pace)
    sign = internal_sign(channel, vehicle)
    if channel.is_angle or sign < 0:
        clean = _unwrapped(used.values, channel) * sign
        return Series(channel, used.time, clean, dropped=used.dropped)
    return Series(channel, raw.time_s, raw.values[channel.column], used.rows(), used.dropped)


def _drop_faults(used: _Used, channel: Channel, pace: Pace) -> None:
    """What a sensor says while it fails, and single readings that no vehicle makes."""
    if channel.sensor == "gyro":
        used.drop("overflow", find_overflows(used.time, used.values, channel, pace))
    if channel.sensor in FLAT_SENSORS:
        saturated, stuck = find_flat(used.values, channel.kind == "input")
        used.drop("saturated", saturated)
        used.drop("stuck", stuck[~saturated])
    if channel.kind == "measured":
        used.drop("outlier", find_outliers(_unwrapped(used.values, channel)))
        spikes = find_spikes(used.time, _unwrapped(used.values, channel), channel, pace)
    else:
        spikes = find_pulses(used.time, used.values, channel, pace)
    used.drop("spike", spikes)


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
        When a needed channel is missing, or hardly a sample of it is usable.
    """
    pace = pace_of(raw.sensors, vehicle)
    clean = {name: clean_sensor(sensor, vehicle, pace) for name, sensor in raw.sensors.items()}
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
                f"{_why_none(sensor, column)}",
                sensor.raw.file,
                "Record it, or name another column in a map (--map).",
            )
        _refuse_too_little(sensor, sensor.series[column])
    return clean


def _why_none(sensor: CleanSensor, column: str) -> str:
    counts = sensor.dropped | sensor.lost.get(column, {})
    return f"all {sensor.raw.rows_read} rows are empty or dropped" + (
        f" ({_reasons(counts)})" if counts else ""
    )


def _refuse_too_little(sensor: CleanSensor, series: Series) -> None:
    """Refuse a needed channel of which most samples are no measurements."""
    faults = {why: d for why, d in series.dropped.items() if why not in NOT_A_FAULT}
    lost = sum(d.count for d in faults.values())
    left = series.time_s.size
    if left < LEAST_LEFT * (left + lost):
        first = min((d for d in faults.values()), key=lambda d: d.first_rows)
        name = sensor.raw.columns[series.channel.column]
        raise InputError(
            f"{left} of {left + lost} samples of {name} ({series.channel.meaning}) are left: "
            f"{_reasons(faults)}",
            f"{sensor.raw.file}, row {first.first_rows[0]} on, column {name}",
            "Repair the channel, or name another column in a map (--map).",
        )


def _reasons(counts: dict[str, Dropped]) -> str:
    return ", ".join(f"{d.count} {reason}" for reason, d in counts.items())
