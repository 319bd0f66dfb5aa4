"""The ingest stage: clean, find the common clock, resample, check, report."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from auvident.constants import BRIDGED_S, VehicleTime
from auvident.errors import InputError, UsageError
from auvident.schema.channels import (
    BY_COLUMN,
    CHANNELS,
    FLAG_SUFFIX,
    NEEDED,
    RECORD_COLUMN,
    SENSORS,
    TIME_COLUMN,
)
from auvident.schema.holding import POLLED, SAMPLED, Hold, hold_rule, median_period
from auvident.schema.logs import RawSensor, RawTrial, TrialQuality
from auvident.schema.trial import Trial
from auvident.schema.vehicle import Vehicle
from auvident.stages.ingest.clean import CleanSensor, Series, clean_trial
from auvident.stages.ingest.derived import with_derived
from auvident.stages.ingest.dvl_roll import without_roll
from auvident.stages.ingest.pace import pace_of
from auvident.stages.ingest.polled import asked_of, copied_inputs, sampled_inputs
from auvident.stages.ingest.quality import report, silent_inputs
from auvident.stages.ingest.resample import (
    Grid,
    Resampled,
    gap_limit,
    is_averaged,
    resample_input,
    resample_measured,
)
from auvident.stages.ingest.time_units import a_day_apart, unit_by_span

MAX_RATE_HZ = 1000.0
MAX_PERIOD_S: VehicleTime = 5.0  # slower velocities or yaw rates do not show a maneuver
MIN_RATE_HZ = 1.0 / MAX_PERIOD_S  # nor does a slower grid
MOST_ALIKE = 0.05  # share of different times: a clock of whole seconds has as few at 20 Hz only
MAX_TICKS = 20_000_000  # some days at 100 Hz; more is a corrupt time stamp


@dataclass(frozen=True)
class Resampling:
    """How a channel comes to the grid: longest interval bridged, and the span it covers."""

    limit_s: float
    method: str
    start_s: float
    end_s: float


def ingest(
    raw: RawTrial,
    vehicle: Vehicle,
    *,
    rate_hz: float = 10.0,
    max_gap_s: float = BRIDGED_S,
    needed: Collection[str] = NEEDED,
) -> tuple[Trial, TrialQuality]:
    """Bring a trial to one clock.

    Parameters
    ----------
    raw : RawTrial
        As read.
    vehicle : Vehicle
        For the signs of the control angles and the plausibility of the speeds.
    rate_hz : float
        Rows per second of the result.
    max_gap_s : float
        Longest interval between samples of a measured channel that is interpolated; slow
        sensors are given 2.5 of their periods.
    needed : collection of str
        Channel columns that every row of a record must have.

    Returns
    -------
    trial : Trial
        The table of `auvident.schema.trial`.
    quality : TrialQuality
        What was dropped, bridged and noticed.

    Raises
    ------
    InputError
        When a needed channel is missing or empty, time goes backward, sensors never overlap, a
        unit is impossible or the rudder's sign contradicts the vehicle file.
    """
    if not MIN_RATE_HZ <= rate_hz <= MAX_RATE_HZ or not 0 < max_gap_s < np.inf:
        raise UsageError(
            f"rate {rate_hz:g} Hz, longest gap {max_gap_s:g} s",
            "ingest",
            f"Give a rate of {MIN_RATE_HZ:g} to {MAX_RATE_HZ:g} Hz (a slower one does not show a "
            "maneuver) and a gap above 0.",
        )
    needed = tuple(needed)
    raw, facts = with_derived(raw, vehicle, rate_hz, max_gap_s)
    sensors = clean_trial(raw, vehicle, needed)
    sensors, done = without_roll(sensors, vehicle.dvl, max_gap_s)
    _refuse_too_slow(sensors, needed)
    copied, sampled = _sampled(sensors, pace_of(raw.sensors, vehicle).passage_s)
    sensors = {name: _without_copies(k, copied) for name, k in sensors.items()}
    plans = {c: _plan(s, k, rate_hz, max_gap_s, c in sampled) for c, s, k in _series(sensors)}
    grid = _common_grid(raw, plans, needed, rate_hz)
    columns = {c: _resample(series, plans[c], grid) for c, series, _ in _series(sensors)}
    columns = {c: x for c, x in columns.items() if c in needed or np.isfinite(x.values).any()}
    sensors = {name: _only(k, columns) for name, k in sensors.items()}
    table = _table(grid, columns, needed)
    # those of the table, so that a long log is not in memory twice
    columns = {c: replace(found, values=table[c].to_numpy()) for c, found in columns.items()}
    trial = Trial.from_table(raw.name, _marked(table, sensors), rate_hz)
    try:
        quality = report(raw, trial, vehicle, sensors, plans, columns, needed)
    except InputError as error:
        raise _perhaps_on_change(error, silent_inputs(sensors)) from error
    update = {"findings": (*quality.findings, *done), "checks": quality.checks | facts}
    return trial, quality.model_copy(update=update)


def _perhaps_on_change(error: InputError, silent: Collection[str]) -> InputError:
    """The same, where an input is full of silences that may be what contradicts."""
    if not silent:
        return error
    tables = " and ".join(f"[{name}]" for name in silent)
    remedy = (
        f"First of all: {' and '.join(silent)} may be logged only on change; if so, set "
        f"on_change = true in {tables} of a map (--map). {error.remedy}"
    )
    return InputError(error.problem, error.where, remedy.strip())


def _series(sensors: dict[str, CleanSensor]) -> list[tuple[str, Series, CleanSensor]]:
    found = {c: (c, s, k) for k in sensors.values() for c, s in k.series.items()}
    return [found[c.column] for c in CHANNELS if c.column in found]


def _sampled(
    sensors: dict[str, CleanSensor], passage_s: float
) -> tuple[dict[str, np.ndarray], tuple[str, ...]]:
    """Inputs of which the rows are samples; of those that are copied, which rows hold one.

    What they are asked of is a copy of the channels, and gone afterwards: a day is long.
    """
    series = {c: s for c, s, _ in _series(sensors)}
    signals = {c: (series[c].time_s, series[c].values) for c in asked_of(series)}
    once = copied_inputs(signals)
    signals |= {c: (signals[c][0][rows], signals[c][1][rows]) for c, rows in once.items()}
    sampled = sampled_inputs(signals, passage_s)
    return {c: rows for c, rows in once.items() if c in sampled}, sampled


def _without_copies(sensor: CleanSensor, copied: Mapping[str, np.ndarray]) -> CleanSensor:
    """The sensor with each sample of an input once, where rows that follow copy it."""
    once = {c: s.only(copied[c]) for c, s in sensor.series.items() if c in copied}
    return replace(sensor, series=sensor.series | once) if once else sensor


def _only(sensor: CleanSensor, columns: Collection[str]) -> CleanSensor:
    """The sensor without channels that have nothing to say within the trial."""
    return replace(sensor, series={c: s for c, s in sensor.series.items() if c in columns})


def _refuse_too_slow(sensors: dict[str, CleanSensor], needed: tuple[str, ...]) -> None:
    for column, series, sensor in _series(sensors):
        period = median_period(series.time_s)
        if column in needed and series.channel.kind == "measured" and period > MAX_PERIOD_S:
            raise InputError(
                f"one sample of {sensor.raw.columns[column]} every {period:g} s is too slow "
                f"(limit {MAX_PERIOD_S:g} s)",
                f"{sensor.raw.file}, column {sensor.raw.time_column}",
                _digits_lost(sensor.raw)
                or "If the time is in milliseconds, name it time_ms or set time_unit in a map.",
            )


def _digits_lost(raw: RawSensor) -> str:
    """What to do about stamps that a spreadsheet has cut to a few digits; "" where it did not."""
    times = np.unique(raw.time_s).size
    if times > MOST_ALIKE * raw.time_s.size:
        return ""
    return (
        f"Export {raw.file} again, with all digits of its times: its {raw.time_s.size} rows have "
        f"{times} different one{'s' * (times != 1)}, as where a spreadsheet kept 1.71815E+12 of "
        "1718151234567."
    )


def _plan(
    series: Series, sensor: CleanSensor, rate_hz: float, max_gap_s: float, sampled: bool
) -> Resampling:
    time, step = series.time_s, 1.0 / rate_hz
    if series.channel.kind == "input":
        hold: Hold = hold_rule(time, series.values, sensor.raw.on_change)
        last = time[-1] + min(hold.limit_s, median_period(time))
        end = np.inf if hold.rule == "on_change" else last - step
        rule = SAMPLED if sampled and hold.rule == POLLED else hold.rule
        return Resampling(hold.limit_s, rule, float(time[0]), float(end))
    limit = gap_limit(time, max_gap_s)
    if is_averaged(time, step):
        return Resampling(limit, "averaged", float(time[0] + step / 2), float(time[-1] - step / 2))
    return Resampling(limit, "interpolated", float(time[0]), float(time[-1]))


def _common_grid(
    raw: RawTrial, plans: dict[str, Resampling], needed: tuple[str, ...], rate_hz: float
) -> Grid:
    start = max(plans[column].start_s for column in needed)
    end = min(plans[column].end_s for column in needed)
    if not np.isfinite(end):  # nothing but commands written on change
        end = start
    if (end - start) * rate_hz > MAX_TICKS:
        raise InputError(
            f"the trial would last {end - start:.0f} s",
            f"trial {raw.name}",
            "Correct the time stamps.",
        )
    grid = Grid.within(start, end, rate_hz)
    if grid.size < 2:
        clocks = (*unit_by_span(raw.sensors), *a_day_apart(raw.sensors))
        spans = "; ".join(
            f"{s.file} {s.time_s.min():.3f} to {s.time_s.max():.3f} s"
            for name, s in raw.sensors.items()
            if s.time_s.size and any(BY_COLUMN[c].sensor == name for c in needed)
        )
        raise InputError(
            f"the required sensors never overlap in time: {spans}",
            f"trial {raw.name}",
            " ".join(f"{f.message}. {f.remedy}" for f in clocks)
            or next(filter(None, map(_digits_lost, raw.sensors.values())), "")
            or "Check that all of them run on the same clock; time_offset_s in a map (--map) "
            "shifts one.",
        )
    return grid


def _resample(series: Series, plan: Resampling, grid: Grid) -> Resampled:
    if series.channel.kind == "input":
        by_line = plan.method == SAMPLED
        return resample_input(series.time_s, series.values, grid, plan.limit_s, by_line)
    return resample_measured(series.time_s, series.values, grid, plan.limit_s)


def _table(grid: Grid, columns: dict[str, Resampled], needed: tuple[str, ...]) -> pd.DataFrame:
    table: dict[str, np.ndarray] = {TIME_COLUMN: grid.time_s}
    table |= {column: found.values for column, found in columns.items()}
    for sensor in SENSORS:
        own = [c for c in columns if BY_COLUMN[c].sensor == sensor]
        decisive = [c for c in own if c in needed] or own
        if own:
            flags = [columns[c].sampled for c in decisive]
            table[sensor + FLAG_SUFFIX] = np.logical_and.reduce(flags)
    known = np.logical_and.reduce([np.isfinite(columns[c].values) for c in needed])
    table[RECORD_COLUMN] = _records(known)
    return pd.DataFrame(table)


def _marked(table: pd.DataFrame, sensors: dict[str, CleanSensor]) -> pd.DataFrame:
    """The table, with what was not logged in its attributes; they go into the file."""
    marks = {column: how for k in sensors.values() for column, how in k.raw.not_logged.items()}
    if marks:
        own = [c.column for c in CHANNELS if c.column in marks]
        table.attrs["not_logged"] = ", ".join(f"{c}: {marks[c]}" for c in own)
    return table


def _records(known: np.ndarray) -> np.ndarray:
    """Number of the uninterrupted piece of each row; -1 where a needed channel is unknown."""
    begins = known & ~np.concatenate(([False], known[:-1]))
    return np.where(known, np.cumsum(begins) - 1, -1)
