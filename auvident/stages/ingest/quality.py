"""The quality report of one trial."""

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from auvident.constants import MEDIAN_OF_ABS_TO_STD
from auvident.errors import ContradictionError
from auvident.schema.artifacts import Finding
from auvident.schema.channels import CHANNELS, RECORD_COLUMN, TIME_COLUMN
from auvident.schema.holding import seems_on_change
from auvident.schema.logs import (
    ChannelQuality,
    RawTrial,
    RecordSpan,
    SensorQuality,
    TrialQuality,
)
from auvident.schema.trial import Trial
from auvident.schema.vehicle import Vehicle
from auvident.stages.ingest.alignment import check_alignment
from auvident.stages.ingest.checks import Seen, run_checks, with_the_gyro_at_fault
from auvident.stages.ingest.clean import CleanSensor, Series
from auvident.stages.ingest.clocks import not_of_the_depth
from auvident.stages.ingest.outliers import noise_std, resolution
from auvident.stages.ingest.pace import pace_of
from auvident.stages.ingest.remarks import sampling_findings
from auvident.stages.ingest.resample import Resampled, median_period
from auvident.stages.ingest.time_units import a_day_apart, too_quick, unit_by_span

MIN_NOISE_SAMPLES = 30  # fewer second differences do not tell the noise


class Bridged(Protocol):
    """What the report needs to know of how a channel came to the grid."""

    @property
    def limit_s(self) -> float:
        """Longest interval bridged."""

    @property
    def method(self) -> str:
        """How."""


def report(
    raw: RawTrial,
    trial: Trial,
    vehicle: Vehicle,
    sensors: Mapping[str, CleanSensor],
    plans: Mapping[str, Bridged],
    columns: Mapping[str, Resampled],
    needed: Sequence[str],
) -> TrialQuality:
    """Quality of an ingested trial; a contradiction in its signs or units is an `InputError`."""
    time = trial.table[TIME_COLUMN].to_numpy()
    own = tuple(_sensor(s, plans, columns) for s in sensors.values() if s.series)
    absent = tuple(c.column for c in CHANNELS if c.column not in columns)
    try:
        aligned = check_alignment(raw, trial, vehicle)
    except ContradictionError as error:
        raise with_the_gyro_at_fault(error, Seen(raw, trial, vehicle)) from error
    signs = (aligned.heading, aligned.rudder, aligned.sign, aligned.elevator)
    made, contradicted = run_checks(Seen(raw, trial, vehicle, *signs))
    clocks, of_clocks = not_of_the_depth(aligned.checks_made, aligned.findings, made)
    findings = (
        *contradicted,
        *raw.findings,
        *sampling_findings(
            raw.name,
            own,
            needed,
            absent,
            pace_of(raw.sensors, vehicle).passage_s,
            silent_inputs(sensors),
        ),
        *_unusable(sensors),
        *unit_by_span(raw.sensors),
        *a_day_apart(raw.sensors),
        *_too_quick(own, float(time[-1] - time[0]), pace_of(raw.sensors, vehicle).passage_s),
        *of_clocks,
    )
    return TrialQuality(
        trial=raw.name,
        rate_hz=trial.rate_hz,
        t_start_s=float(time[0]),
        t_end_s=float(time[-1]),
        samples=time.size,
        origin=raw.origin,
        sensors=own,
        absent=absent,
        records=_records(trial),
        alignment=aligned.alignment,
        checks=aligned.checks,
        checks_made=(*made, *clocks),
        findings=findings,
    )


def silent_inputs(sensors: Mapping[str, CleanSensor]) -> tuple[str, ...]:
    """Inputs that are taken for polled and seem to be logged only when they change."""
    gyro = sensors.get("gyro")
    others = gyro.time_s if gyro is not None else None
    return tuple(
        name
        for name, sensor in sensors.items()
        if sensor.raw.on_change is None
        and any(
            series.channel.kind == "input" and seems_on_change(series.time_s, series.values, others)
            for series in sensor.series.values()
        )
    )


def _unusable(sensors: Mapping[str, CleanSensor]) -> list[Finding]:
    """Optional channels of the log without a usable sample in the trial."""
    return [
        Finding(
            code="channel_unusable",
            message=f"column {sensor.raw.columns[column]} has no usable sample in the time "
            "that the required sensors share",
            where=sensor.raw.file,
        )
        for sensor in sensors.values()
        for column in sensor.raw.values
        if column not in sensor.series
    ]


def _too_quick(
    sensors: Sequence[SensorQuality], duration_s: float, passage_s: float
) -> list[Finding]:
    dvl = next((s for s in sensors if s.sensor == "dvl"), None)
    if dvl is None or not dvl.rate_hz:
        return []
    return [*too_quick(dvl.rate_hz, duration_s, passage_s, dvl.file)]


def _sensor(
    sensor: CleanSensor, plans: Mapping[str, Bridged], columns: Mapping[str, Resampled]
) -> SensorQuality:
    period = median_period(sensor.time_s)
    return SensorQuality(
        sensor=sensor.raw.sensor,
        file=sensor.raw.file,
        rows_read=sensor.raw.rows_read,
        rows_used=sensor.time_s.size if sensor.raw.rows_read else 0,
        dropped=sensor.dropped,
        rate_hz=1.0 / period if period > 0 else None,
        jitter_s=_jitter(sensor.time_s, period),
        t_start_s=float(sensor.time_s[0]),
        t_end_s=float(sensor.time_s[-1]),
        method=", ".join(dict.fromkeys(plans[c].method for c in sensor.series)),
        channels=tuple(
            _channel(sensor, series, plans[c], columns[c]) for c, series in sensor.series.items()
        ),
    )


def _jitter(time_s: np.ndarray, period_s: float) -> float | None:
    """Spread of the intervals between samples."""
    steps = np.diff(time_s)
    if not steps.size:
        return None
    steps -= period_s
    apart = np.median(np.abs(steps, out=steps), overwrite_input=True)
    return float(MEDIAN_OF_ABS_TO_STD * apart)


def _gaps(time_s: np.ndarray, limit_s: float) -> tuple[int, float]:
    """Number of intervals between samples that are not bridged, and the longest interval."""
    steps = np.diff(time_s)
    return int(np.sum(steps > limit_s)), float(steps.max()) if steps.size else 0.0


def _channel(
    sensor: CleanSensor, series: Series, plan: Bridged, found: Resampled
) -> ChannelQuality:
    gaps, longest = _gaps(series.time_s, plan.limit_s)
    values = series.values
    measured = series.channel.kind == "measured"
    enough = values.size >= MIN_NOISE_SAMPLES
    known = np.isfinite(found.values)
    column = series.channel.column
    noise = noise_std(values) if measured and enough else None
    return ChannelQuality(
        column=column,
        log_column=sensor.raw.columns[column],
        unit=series.channel.unit,
        samples=values.size,
        dropped=series.dropped,
        minimum=float(values.min()),
        maximum=float(values.max()),
        noise_std=sensor.raw.std.get(column, noise),
        resolution=resolution(values) if measured else None,
        gaps=gaps,
        longest_gap_s=longest,
        gap_limit_s=plan.limit_s if np.isfinite(plan.limit_s) else None,
        interpolated_share=float(np.mean(known & ~found.sampled)) if measured else 0.0,
        missing_share=float(np.mean(~known)),
        source=sensor.raw.not_logged.get(column, "logged"),
    )


def _records(trial: Trial) -> tuple[RecordSpan, ...]:
    record = trial.table[RECORD_COLUMN].to_numpy()
    time = trial.table[TIME_COLUMN].to_numpy()
    first = np.flatnonzero((record >= 0) & (np.diff(record, prepend=-1) != 0))
    last = np.flatnonzero((record >= 0) & (np.diff(record, append=-1) != 0))
    return tuple(
        RecordSpan(
            record=int(record[i]), t_start_s=time[i], t_end_s=time[k], samples=int(k - i + 1)
        )
        for i, k in zip(first, last, strict=True)
    )
