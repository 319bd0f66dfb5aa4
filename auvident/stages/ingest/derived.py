"""Velocities and yaw rate from position and heading, where the map asks for them.

They enter the trial as what DVL and gyro would have read, with their standard deviation. Their
errors are correlated in time: the standard deviation that the identification counts with is that
of white noise which is as large as they are where they are largest, per sample of the trial.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from auvident.errors import InputError
from auvident.physics.sensing import sensor_matrix
from auvident.schema.artifacts import Finding, Sensing
from auvident.schema.channels import BY_COLUMN
from auvident.schema.logs import DEG, NotLogged, RawSensor, RawTrial, TrialQuality
from auvident.schema.vehicle import Vehicle
from auvident.stages.ingest.clean import clean_sensor
from auvident.stages.ingest.pace import pace_of
from auvident.stages.ingest.resample import gap_limit, median_period
from auvident.stages.ingest.track import (
    LEAST_STEP_S,
    Nodes,
    Rate,
    Turning,
    moving,
    nodes_in,
    step_for,
    turning,
)

SOURCE: NotLogged = "derived"
VELOCITIES = ("u_mps", "v_mps")
YAW_RATE = "r_radps"
FROM = {
    "u_mps": "position and heading",
    "v_mps": "position and heading",
    "r_radps": "heading",
}
LEAST_SAMPLES = 20  # fewer readings do not tell motion from noise
SPEED_FIXES = 200  # positions between which the usual speed is taken
SLOWEST_LENGTHS = 0.02  # per second: a vehicle that lies still has no speed
SLOWEST_S = 5.0  # a compass or a position that is slower shows no maneuver
REMEDY = "Log it, name its column in a map (--map), or leave out [derive]."


MOST_LENGTHS = 2.0  # from the origin to an antenna: one behind the vehicle tows along


@dataclass(frozen=True)
class Samples:
    """Clean samples (n,) that something is derived from, and their lines in the file."""

    time_s: np.ndarray
    values: np.ndarray
    rows: np.ndarray


@dataclass(frozen=True)
class DerivedColumn:
    """A derived column: values on some ticks, its std, and that of white noise in its place."""

    time_s: np.ndarray
    rows: np.ndarray
    values: np.ndarray
    std: float
    counted: float


def with_derived(
    raw: RawTrial, vehicle: Vehicle, rate_hz: float, max_gap_s: float
) -> tuple[RawTrial, dict[str, Any]]:
    """The trial with what its map wants derived, and figures for ``checks`` of its quality.

    Parameters
    ----------
    raw : RawTrial
        As read.
    vehicle : Vehicle
        Where the DVL sits whose readings are made up.
    rate_hz : float
        Rows per second of the trial.
    max_gap_s : float
        Longest gap that is bridged.

    Raises
    ------
    InputError
        When position or heading are missing, too few or too slow.
    """
    asked = raw.derive.columns
    if not asked:
        return raw, {}
    furthest = max(abs(raw.derive.x_m), abs(raw.derive.y_m))
    if furthest > MOST_LENGTHS * vehicle.hull.length_m:
        raise InputError(
            f"the position is taken {furthest:g} m from the origin of a vehicle of "
            f"{vehicle.hull.length_m:g} m",
            "[derive] x_m, y_m",
            "Give the place of the antenna or transponder in vehicle axes, in m.",
        )
    compass = _series(raw, vehicle, "heading_rad", max_gap_s)
    passage = vehicle.hull.length_m / _speed(raw, vehicle)
    turn = turning(compass.time_s, compass.values, _nodes(compass, max_gap_s), passage)
    found: dict[str, DerivedColumn] = {}
    facts: dict[str, Any] = {"heading_noise_rad": turn.noise_rad}
    if YAW_RATE in asked:
        ticks = _ticks(raw, "gyro") or _own_ticks(compass, turn.nodes)
        found[YAW_RATE] = _at(ticks, turn.nodes, turn.r, rate_hz)
    if set(VELOCITIES) & set(asked):
        facts["position_noise_m"] = _velocities(
            raw, vehicle, turn, (rate_hz, max_gap_s), asked, found
        )
    for column, one in found.items():
        facts[column] = {"std": one.std, "std_counted": one.counted}
    sensors = dict(raw.sensors)
    for column, one in found.items():
        sensor = BY_COLUMN[column].sensor
        sensors[sensor] = _with_column(sensors.get(sensor), column, one, raw)
    said = _finding(raw, found, facts)
    return replace(raw, sensors=sensors, findings=(*raw.findings, said)), {SOURCE: facts}


def stated_noise_for(vehicle: Vehicle, reports: Sequence[TrialQuality]) -> Vehicle:
    """The vehicle without the accuracy of sensors that did not measure what was derived."""
    derived = {
        sensor.sensor
        for trial in reports
        for sensor in trial.sensors
        for channel in sensor.channels
        if channel.source == SOURCE
    }
    update: dict[str, Any] = {}
    if "dvl" in derived:
        update["dvl"] = vehicle.dvl.model_copy(update={"std_mps": None})
    if "gyro" in derived:
        update["gyro"] = vehicle.gyro.model_copy(update={"std_radps": None})
    return vehicle.model_copy(update=update)


def _speed(raw: RawTrial, vehicle: Vehicle) -> float:
    """Usual speed in m/s: by positions some seconds apart, else as logged, else one length a s."""
    found = np.empty(0)
    dvl, position = raw.sensors.get("dvl"), raw.sensors.get("position")
    if position is not None and {"north_m", "east_m"} <= set(position.values):
        near = np.arange(0, position.time_s.size, max(1, position.time_s.size // SPEED_FIXES))
        steps = [np.diff(position.values[c][near]) for c in ("north_m", "east_m")]
        apart = np.diff(position.time_s[near])
        found = np.hypot(*steps)[apart > 0] / apart[apart > 0]
    elif dvl is not None and "u_mps" in dvl.values:
        found = np.abs(dvl.values["u_mps"])
    found = found[np.isfinite(found)]
    length = vehicle.hull.length_m
    usual = float(np.median(found)) if found.size else length
    return max(usual, SLOWEST_LENGTHS * length)


# --- what it is derived from --------------------------------------------------------------


def _series(raw: RawTrial, vehicle: Vehicle, column: str, max_gap_s: float) -> Samples:
    """Clean samples of a column that is needed, enough and often enough."""
    channel = BY_COLUMN[column]
    sensor = raw.sensors.get(channel.sensor)
    if sensor is None or column not in sensor.values:
        raise InputError(
            f"[derive] needs {column} ({channel.meaning}), which is not in the log",
            f"trial {raw.name}",
            REMEDY,
        )
    clean = clean_sensor(sensor, vehicle, pace_of(raw.sensors, vehicle))
    series = clean.series.get(column)
    count = 0 if series is None else series.time_s.size
    where = f"{sensor.file}, column {sensor.columns[column]}"
    if series is None or count < LEAST_SAMPLES:
        raise InputError(
            f"[derive] needs at least {LEAST_SAMPLES} samples of {column}, found {count}",
            where,
            REMEDY,
        )
    period = median_period(series.time_s)
    if period > SLOWEST_S:
        raise InputError(
            f"one sample of {column} every {period:g} s is too slow for [derive] "
            f"(limit {SLOWEST_S:g} s)",
            where,
            REMEDY,
        )
    return Samples(series.time_s, series.values, _rows_at(sensor, series.time_s))


def _rows_at(sensor: RawSensor, time_s: np.ndarray) -> np.ndarray:
    """Lines of the file at times that it has."""
    order = np.argsort(sensor.time_s, kind="stable")
    return sensor.rows[order[np.searchsorted(sensor.time_s[order], time_s)]]


def _fixes(raw: RawTrial, vehicle: Vehicle, max_gap_s: float) -> tuple[Samples, Samples]:
    """Positions north and east at common times, copies of a held fix left out."""
    north = _series(raw, vehicle, "north_m", max_gap_s)
    east = _series(raw, vehicle, "east_m", max_gap_s)
    _, i, j = np.intersect1d(north.time_s, east.time_s, return_indices=True)
    moved = (np.diff(north.values[i]) != 0) | (np.diff(east.values[j]) != 0)
    new = np.concatenate(([True], moved))
    return _only(north, i[new]), _only(east, j[new])


def _only(series: Samples, which: np.ndarray) -> Samples:
    return Samples(series.time_s[which], series.values[which], series.rows[which])


def _pieces(time_s: np.ndarray, max_gap_s: float) -> list[tuple[float, float]]:
    """Spans without a gap that is too long to bridge."""
    breaks = np.flatnonzero(np.diff(time_s) > gap_limit(time_s, max_gap_s))
    first = np.concatenate(([0], breaks + 1))
    last = np.concatenate((breaks, [time_s.size - 1]))
    return [(float(time_s[a]), float(time_s[b])) for a, b in zip(first, last, strict=True) if b > a]


def _common(
    a: list[tuple[float, float]], b: list[tuple[float, float]]
) -> list[tuple[float, float]]:
    both = [(max(s, t), min(e, f)) for s, e in a for t, f in b]
    return [(s, e) for s, e in both if e > s]


def _nodes(series: Samples, max_gap_s: float) -> Nodes:
    return nodes_in(_pieces(series.time_s, max_gap_s), step_for(median_period(series.time_s)))


# --- what is derived ----------------------------------------------------------------------


Ticks = tuple[np.ndarray, np.ndarray]  # times and rows of the file


def _ticks(raw: RawTrial, sensor: str) -> Ticks | None:
    """Ticks of a sensor that measured something else."""
    own = raw.sensors.get(sensor)
    if own is None or not set(own.values) - set(raw.derive.columns):
        return None
    return own.time_s, own.rows


def _own_ticks(series: Samples, nodes: Nodes) -> Ticks:
    """Ticks of the readings, or of the nodes where these are fewer."""
    if median_period(series.time_s) >= LEAST_STEP_S:
        return series.time_s, series.rows
    near = np.clip(np.searchsorted(series.time_s, nodes.time_s), 0, series.rows.size - 1)
    return nodes.time_s, series.rows[near]


def _at(ticks: Ticks, nodes: Nodes, rate: Rate, rate_hz: float) -> DerivedColumn:
    time, rows = ticks
    values = np.interp(time, nodes.time_s, rate.values)
    values = np.where(nodes.within(time), values, np.nan)
    apart = max(median_period(np.unique(time)), 1.0 / rate_hz)
    std = float(np.sqrt(np.mean(rate.std**2)))
    return DerivedColumn(time, rows, values, std, max(std, math.sqrt(rate.density / apart)))


def _velocities(
    raw: RawTrial,
    vehicle: Vehicle,
    turn: Turning,
    grid: tuple[float, float],
    asked: tuple[str, ...],
    found: dict[str, DerivedColumn],
) -> float:
    """Add the velocities that are asked for; returns the noise of a fix in m."""
    rate_hz, max_gap_s = grid
    if vehicle.dvl.reference == "water":
        raise InputError(
            "velocities derived from positions are over ground, but [dvl] reference is water",
            f"trial {raw.name}",
            'Set reference = "ground" in the vehicle file for this trial.',
        )
    north, east = _fixes(raw, vehicle, max_gap_s)
    heading = [
        (float(t[0]), float(t[-1]))
        for t in np.split(turn.nodes.time_s, np.flatnonzero(turn.nodes.starts)[1:])
    ]
    pieces = _common(_pieces(north.time_s, max_gap_s), heading) if north.time_s.size > 1 else []
    nodes = nodes_in(pieces, step_for(median_period(north.time_s))) if pieces else None
    own = nodes.within(north.time_s) if nodes else np.zeros(north.time_s.size, dtype=bool)
    if nodes is None or own.sum() < LEAST_SAMPLES:
        raise InputError(
            f"only {own.sum()} different positions have a heading beside them; [derive] needs "
            f"{LEAST_SAMPLES}",
            f"trial {raw.name}",
            REMEDY,
        )
    north, east = _only(north, np.flatnonzero(own)), _only(east, np.flatnonzero(own))
    passage = vehicle.hull.length_m / _speed(raw, vehicle)
    moved = moving(north.time_s, (north.values, east.values), turn, nodes, passage)
    u, v = _as_read(raw, vehicle, turn, (moved.u, moved.v), nodes)
    ticks = _ticks(raw, "dvl") or (north.time_s, north.rows)
    for column, rate in zip(VELOCITIES, (u, v), strict=True):
        if column in asked:
            found[column] = _at(ticks, nodes, rate, rate_hz)
    return moved.noise_m


def _as_read(
    raw: RawTrial, vehicle: Vehicle, turn: Turning, at_fix: tuple[Rate, Rate], nodes: Nodes
) -> tuple[Rate, Rate]:
    """Velocities at the DVL, in its axes, from those where the position was taken."""
    r = np.interp(nodes.time_s, turn.nodes.time_s, turn.r.values)
    u = at_fix[0].values + raw.derive.y_m * r
    v = at_fix[1].values - raw.derive.x_m * r
    dvl = vehicle.dvl
    sensing = Sensing(
        dvl_x_m=dvl.x_m,
        dvl_y_m=dvl.y_m,
        dvl_z_m=dvl.down_m,
        dvl_mounting_yaw_rad=dvl.mounting_yaw_deg * DEG,
        noise_std={},
    )
    read = sensor_matrix("horizontal", sensing)[:2, :3] @ np.vstack((u, v, r))
    return replace(at_fix[0], values=read[0]), replace(at_fix[1], values=read[1])


def _with_column(
    own: RawSensor | None, column: str, one: DerivedColumn, raw: RawTrial
) -> RawSensor:
    if own is None or own.time_s.size != one.time_s.size or own.time_s is not one.time_s:
        source = raw.sensors["position" if column in VELOCITIES else "attitude"]
        kept = own if own is not None and np.array_equal(own.time_s, one.time_s) else None
        own = kept or RawSensor(
            sensor=BY_COLUMN[column].sensor,
            file=source.file,
            time_s=one.time_s,
            values={},
            rows=one.rows,
            columns={},
            rows_read=one.time_s.size,
            time_column=source.time_column,
        )
    return replace(
        own,
        values=own.values | {column: one.values},
        columns=own.columns | {column: f"{SOURCE} from {FROM[column]}"},
        not_logged=own.not_logged | {column: SOURCE},
        std=own.std | {column: one.counted},
    )


def _finding(
    raw: RawTrial, found: Mapping[str, DerivedColumn], facts: Mapping[str, Any]
) -> Finding:
    known = ", ".join(
        f"{c} {one.std:.2g} {BY_COLUMN[c].unit} (counts with {one.counted:.2g})"
        for c, one in found.items()
    )
    fixes = f"{facts['position_noise_m']:.2g} m, " if "position_noise_m" in facts else ""
    aside = ", and a heading that is off by a degree puts 1.7 % of u into v" if fixes else ""
    return Finding(
        code="derived_channels",
        message=f"not measured but derived, with the standard deviation of each: {known}; from "
        f"readings that scatter by {fixes}{facts['heading_noise_rad'] / DEG:.2g} degrees. "
        f"The errors are correlated in time, hence the larger figure{aside}",
        where=f"trial {raw.name}",
        remedy="A DVL and a gyro show effects that such a trial cannot.",
    )
