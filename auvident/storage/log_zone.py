"""Time zones: instants with one beside instants without, which are taken for UTC."""

import re
from collections.abc import Collection, Mapping

import numpy as np
import pyarrow as pa
from pyarrow import parquet

from auvident.errors import InputError
from auvident.schema.channels import BY_COLUMN, Channel
from auvident.schema.holding import hold_rule
from auvident.schema.logs import ColumnMap, RawSensor, RawTrial
from auvident.storage.log_columns import time_column
from auvident.storage.log_file import LogFile, read_log
from auvident.storage.log_layout import is_missing

DATE = re.compile(r"\d[T ]\d|^\d{8}|^\d{4}-\d\d")  # a time of day alone has no zone either way
ZONE = re.compile(
    r"\d\s*(?:Z|UTC|GMT)$|[:T]\d{2,6}(?:[.,]\d+)?\s*[+-]\d\d(?::?\d\d)?$", re.IGNORECASE
)


def refuse_two_zones(
    raw: RawTrial, homes: Mapping[str, LogFile], needed: Collection[str], column_map: ColumnMap
) -> None:
    """Refuse sensors that never overlap, where the times of some have a zone and of others none.

    Parameters
    ----------
    raw : RawTrial
    homes : mapping of str to LogFile
        Table of each sensor.
    needed : collection of str
        Channel columns of the sensors that have to overlap.
    column_map : ColumnMap
        Names of the time columns.

    Raises
    ------
    InputError
    """
    channels = [BY_COLUMN[column] for column in needed]
    own = {c.sensor: c for c in channels if c.sensor in homes and c.sensor in raw.sensors}
    sensors = {s: raw.sensors[s] for s in own if np.isfinite(raw.sensors[s].time_s).any()}
    if not sensors or _overlap(sensors, own):
        return
    zones = {s: has_zone(homes[s], time_column(homes[s], column_map.of(s))) for s in sensors}
    naive = list(dict.fromkeys(sensors[s].file for s, zone in zones.items() if zone is False))
    if not naive or True not in zones.values():
        return
    spans = "; ".join(
        f"{s.file} {np.nanmin(s.time_s):.3f} to {np.nanmax(s.time_s):.3f} s"
        for s in sensors.values()
    )
    raise InputError(
        f"the required sensors never overlap in time: {spans}",
        f"trial {raw.name}",
        f"The times of {' and '.join(naive)} have no time zone and are taken for UTC; those of the "
        "others have one. "
        "Write them with their zone (2024-05-01T12:00:00+02:00), or shift them by time_offset_s in "
        "a map (--map).",
    )


def _overlap(sensors: Mapping[str, RawSensor], channels: Mapping[str, Channel]) -> bool:
    """Whether all are logged at one time; a command that is written on change goes on."""
    start = max(float(np.nanmin(s.time_s)) for s in sensors.values())
    return all(
        float(np.nanmax(s.time_s)) >= start or _goes_on(s, channels[name])
        for name, s in sensors.items()
    )


def _goes_on(sensor: RawSensor, channel: Channel) -> bool:
    if channel.kind != "input" or channel.column not in sensor.values:
        return False
    order = np.argsort(sensor.time_s)
    time, values = sensor.time_s[order], sensor.values[channel.column][order]
    known = np.isfinite(time) & np.isfinite(values)
    return hold_rule(time[known], values[known], sensor.on_change).rule == "on_change"


def has_zone(log: LogFile, name: str) -> bool | None:
    """Whether a column of instants has a time zone; None where its times are none."""
    if log.container is not None:
        return None
    if log.layout is None:
        kind = parquet.read_schema(log.path).field(name).type
        if pa.types.is_timestamp(kind):
            return kind.tz is not None
    values = read_log(log, {name: None}).columns[name]
    known = (v.strip().strip('"') for v in values.tolist() if isinstance(v, str))
    first = next((v for v in known if not is_missing(v)), "")
    return bool(ZONE.search(first)) if DATE.search(first) else None
