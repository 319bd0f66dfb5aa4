"""Readers of trial logs: paths and a column map in, raw sensors in SI units out.

The layout of a log is section 3 of the user's contract: one file per sensor, one wide file, or
files named freely with a map. Nothing is resampled or cleaned here but rows that are no samples
(marked invalid, cut off, without a time).
"""

import difflib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pyarrow

from auvident.errors import InputError, together
from auvident.schema.artifacts import Finding
from auvident.schema.channels import BY_COLUMN, NEEDED, SENSORS, Channel
from auvident.schema.logs import (
    FIRST_FEW,
    AttitudeMap,
    ColumnMap,
    InputMap,
    RawSensor,
    RawTrial,
    SensorMap,
    moved_stamps,
)
from auvident.storage.declared import parse, read_toml, refuse_outside
from auvident.storage.log_aside import Read, blamed, open_usable, read_usable, set_aside
from auvident.storage.log_columns import (
    LogColumn,
    listed,
    missing_channels,
    missing_topic,
    resolve,
    time_column,
)
from auvident.storage.log_constant import with_constants
from auvident.storage.log_csv import Kind, LogTable
from auvident.storage.log_file import LogFile, open_logs, read_log
from auvident.storage.log_find import TrialSource, find_trials, has_sensor
from auvident.storage.log_geographic import COLUMNS, faults_of, from_first_fix, minutes_told
from auvident.storage.log_parts import Columns, Part, are_of_one_log, parts_of, with_parts
from auvident.storage.log_time import ABSOLUTE_S, Stamps
from auvident.storage.log_time_names import refuse_time_label, time_unit
from auvident.storage.log_time_parts import beyond_seconds_of, read_parts
from auvident.storage.log_unread import columns_told
from auvident.storage.log_valid import marked
from auvident.storage.log_zeros import ZEROS, zeros_between, zeros_told
from auvident.storage.log_zone import refuse_two_zones

Tables = tuple[LogFile, ...]
MAP_REMEDY = (
    'A table per sensor, e.g.\n    [rudder]\n    file = "*.csv"\n    time = "t"\n    '
    'rudder = { column = "delta_cmd", unit = "deg", sign = -1 }'
)


def read_column_map(path: Path) -> ColumnMap:
    """Read ``MAP.toml``; a fault is an `InputError` naming file, table and key."""
    data = read_toml(path)
    tables = {f"[{key}] file": t.get("file") for key, t in data.items() if isinstance(t, dict)}
    named = {"file": data.get("file"), **tables}
    refuse_outside({key: str(pattern) for key, pattern in named.items() if pattern}, path)
    return parse(ColumnMap, data, path, MAP_REMEDY)


def read_trials(
    paths: Sequence[Path],
    column_map: ColumnMap | None = None,
    needed: Collection[str] = NEEDED,
) -> list[RawTrial]:
    """Read the trials behind some paths.

    Parameters
    ----------
    paths : sequence of Path
        Trial folders, wide files, or folders of either; see `find_trials`.
    column_map : ColumnMap, optional
        The user's names, units and signs.
    needed : collection of str
        Channel columns (``u_mps``) without which a trial is refused.

    Returns
    -------
    list of RawTrial
        In the order of the paths.

    Raises
    ------
    InputError
        When a file, column, unit, number or time cannot be used; see `auvident.errors`.
    """
    return [read_trial(s, column_map, needed) for s in find_trials(paths, column_map)]


def read_trial(
    source: TrialSource,
    column_map: ColumnMap | None = None,
    needed: Collection[str] = NEEDED,
) -> RawTrial:
    """Read one trial; parameters and errors as for `read_trials`."""
    column_map = column_map or ColumnMap()
    times = {t for t in (column_map.of(sensor).time for sensor in SENSORS) if t}
    logs, faults = open_usable(source, needed, lambda path: open_logs(path, times))
    found = ((sensor, _home(source, logs, sensor, column_map)) for sensor in SENSORS)
    homes = {sensor: log for sensor, log in found if log is not None}
    columns, unusable = _resolved(homes, column_map)
    elsewhere = {*column_map.constants(), *column_map.derive.columns}
    logged = [column for column in needed if column not in elsewhere]
    missing = _missing(source, logs, columns, homes, logged)
    if unusable:
        raise together([*unusable, *missing])
    if missing:
        with blamed(faults):
            raise together(missing)
    homes = {sensor: log for sensor, log in homes.items() if columns[sensor]}
    sensors, origins = read_usable(
        homes, needed, lambda own: _read_sensors(own, columns, column_map), faults
    )
    parts = _parts(source, logs, {s: homes[s] for s in sensors})
    (sensors, origins), joined = _with_parts((sensors, origins), homes, parts, column_map)
    is_mapped = any(column_map.of(sensor).entries() for sensor in SENSORS)  # as its writer chose
    undecided = _undecided(source, logs, homes, column_map)
    unread = tuple(log for log in _all(logs) if log not in undecided)
    told = (*undecided, *(log for others in parts.values() for log in others))
    remarks = (remark for sensor in sensors.values() for remark in sensor.remarks)
    findings = (
        *remarks,
        *joined,
        *_unused(source, logs, homes, undecided, told),
        *(() if is_mapped else columns_told(unread, homes, columns, elsewhere)),
        *set_aside(faults),
        *_damage(logs),
    )
    raw = _from_common_origin(source.name, sensors, origins, findings)
    refuse_two_zones(raw, homes, logged, column_map)
    pyarrow.default_memory_pool().release_unused()  # it keeps a part of what reading took
    return replace(with_constants(raw, column_map), derive=column_map.derive)


def _home(
    source: TrialSource, logs: dict[Path, Tables], sensor: str, column_map: ColumnMap
) -> LogFile | None:
    """Table of a sensor: named by the map, of its name, or the only one with its columns."""
    topic = column_map.of(sensor).topic
    if sensor in source.assigned:
        searched: Tables = logs.get(source.assigned[sensor], ())
    else:
        searched = tuple(log for tables in logs.values() for log in tables)
    if topic is not None and searched:
        searched = _of_topic(searched, topic, sensor, source)
    if len(searched) == 1:
        return searched[0]
    named = [log for log in searched if not log.topic and log.stem.lower() == sensor]
    if named:
        return named[0]
    having = _having(searched, sensor, column_map)[0]
    if len(having) > 1 and not are_of_one_log(having):
        names = " and ".join(log.label for log in having)
        key = "topic" if having[0].topic else "file"
        raise InputError(
            f"columns of {sensor} are spread over {names}",
            str(source.place),
            f'Name the {key} in a map (--map): [{sensor}] {key} = "{having[0].label}"',
        )
    return having[0] if having else None


def _having(searched: Tables, sensor: str, column_map: ColumnMap) -> tuple[Tables, Tables]:
    """Tables that have a sensor, and those left alone: latitude and longitude, unless they are all.

    Loggers hold these in many tables, and nothing that the user wrote says which is meant.
    """
    mapping = column_map.of(sensor)
    found = tuple(log for log in searched if has_sensor(log, sensor, column_map))
    if sensor != "position" or mapping.entries():
        return found, ()
    angles = tuple(
        log for log in found if any(c.is_angle for c in resolve(log, sensor, mapping).values())
    )
    if len(angles) == len(found) == 1:
        return found, ()
    return tuple(log for log in found if log not in angles), angles


def _of_topic(searched: Tables, topic: str, sensor: str, source: TrialSource) -> Tables:
    found = tuple(log for log in searched if log.topic == topic)
    if found:
        return found
    there = [log.topic for log in searched if log.topic]
    close = difflib.get_close_matches(topic, there, n=1)
    raise InputError(
        f"the map's topic {topic!r} for {sensor} is missing; found {listed(there) or 'no topics'}",
        str(source.place),
        f'Did you mean "{close[0]}"?' if close else "Correct the map.",
    )


def _resolved(
    homes: Mapping[str, LogFile], column_map: ColumnMap
) -> tuple[dict[str, dict[str, LogColumn]], list[InputError]]:
    """Columns of each sensor, and what is wrong with those of the others."""
    columns: dict[str, dict[str, LogColumn]] = {}
    faults: list[InputError] = []
    for sensor, log in homes.items():
        try:
            columns[sensor] = resolve(log, sensor, column_map.of(sensor))
        except InputError as fault:
            faults.append(fault)
    return columns, faults


def _missing(
    source: TrialSource,
    logs: dict[Path, Tables],
    columns: Mapping[str, dict[str, LogColumn]],
    homes: Mapping[str, LogFile],
    needed: Collection[str],
) -> list[InputError]:
    """Errors of the needed channels that are nowhere, those of one file in one."""
    all_of_them = [log for tables in logs.values() for log in tables]
    lacking: dict[str, list[Channel]] = {}
    for channel in (BY_COLUMN[column] for column in needed):
        is_known = channel.sensor in columns or channel.sensor not in homes
        if is_known and channel.column not in columns.get(channel.sensor, {}):
            home = homes.get(channel.sensor)
            lacking.setdefault(home.where if home else str(source.place), []).append(channel)
    found = []
    for where, channels in lacking.items():
        home = homes.get(channels[0].sensor)
        searched = [home] if home else all_of_them
        if searched[0].topic:
            labels = [log.label for log in searched]
            found += [missing_topic(channel, where, labels) for channel in channels]
        else:
            names = {log.label: log.names for log in searched}
            units = {name: log.unit_of(name).strip() for log in searched for name in log.names}
            found.append(missing_channels(channels, where, names, units))
    return found


def _read_sensors(
    homes: dict[str, LogFile], columns: dict[str, dict[str, LogColumn]], column_map: ColumnMap
) -> tuple[dict[str, RawSensor], dict[str, int]]:
    """Read each table once and hand its columns to its sensors.

    Returns the sensors, and for each the whole second from which its times count.
    """
    found: dict[str, RawSensor] = {}
    origins: dict[str, int] = {}
    for where in dict.fromkeys(log.where for log in homes.values()):
        here = [sensor for sensor, log in homes.items() if log.where == where]
        log = homes[here[0]]
        wanted: dict[str, Kind | None] = {}
        for sensor in here:
            mapping = column_map.of(sensor)
            time = time_column(log, mapping)
            wanted[time] = None
            beside = beyond_seconds_of(time, log.names)
            wanted |= {beside: None} if beside else {}
            wanted |= {column.name: "number" for column in columns[sensor].values()}
            flag = _valid_column(log, sensor, here, mapping.valid)
            if flag is not None:
                wanted[flag] = None
        table = read_log(log, wanted)
        for sensor in here:
            flag = _valid_column(log, sensor, here, column_map.of(sensor).valid)
            name = time_column(log, column_map.of(sensor))
            stamps = _stamps(log, table, name, column_map.of(sensor))
            found[sensor] = _sensor(log, table, sensor, columns[sensor], column_map, flag, stamps)
            origins[sensor] = stamps.origin_s
    return {sensor: found[sensor] for sensor in SENSORS if sensor in found}, origins


def _all(logs: dict[Path, Tables]) -> Tables:
    return tuple(log for own in logs.values() for log in own)


def _parts(
    source: TrialSource, logs: dict[Path, Tables], homes: dict[str, LogFile]
) -> dict[str, Tables]:
    """Files that may be parts of the log of a sensor, where no map chooses one."""
    return {s: parts_of(home, _all(logs)) for s, home in homes.items() if s not in source.assigned}


def _with_parts(
    read: Read, homes: dict[str, LogFile], parts: dict[str, Tables], column_map: ColumnMap
) -> tuple[Read, tuple[Finding, ...]]:
    def columns_of(sensor: str, log: LogFile) -> Columns:
        has = has_sensor(log, sensor, column_map)
        return resolve(log, sensor, column_map.of(sensor)) if has else {}

    def read_part(sensor: str, log: LogFile) -> Part:
        own = {s: log for s, others in parts.items() if log in others and columns_of(s, log)}
        columns = {s: dict(columns_of(s, log)) for s in own}
        found, origins = _read_sensors(own, columns, column_map)
        return found[sensor], origins[sensor]

    return with_parts(read, homes, parts, columns_of, read_part)


def _stamps(log: LogFile, table: LogTable, name: str, mapping: SensorMap) -> Stamps:
    where = f"{log.where}, column {name}"
    refuse_time_label(log, name, mapping)
    return read_parts(table.columns, name, time_unit(log, name, mapping), where, table.rows)


def _valid_column(log: LogFile, sensor: str, here: Sequence[str], mapped: str | None) -> str | None:
    """Column that marks invalid samples of a sensor.

    A bare ``valid`` belongs to the sensor that names the file or is alone in it; in a file of
    several sensors it is the DVL's, the only one that tells when it has lost the bottom.
    """
    if mapped is not None:
        found = log.find(mapped)
        if found is None:
            raise InputError(
                f"the map's valid column {mapped!r} for {sensor} is missing; found "
                f"{', '.join(log.names)}",
                log.where,
                "Correct the map.",
            )
        return found
    own = log.find(f"{sensor}_valid")
    owner = log.stem.lower() if log.stem.lower() in here else "dvl"
    owner = here[0] if len(here) == 1 else owner
    return own or (log.find("valid") if sensor == owner else None)


def _sensor(
    log: LogFile,
    table: LogTable,
    sensor: str,
    columns: dict[str, LogColumn],
    column_map: ColumnMap,
    flag: str | None,
    stamps: Stamps,
) -> RawSensor:
    mapping, time_s = column_map.of(sensor), stamps.time_s
    valid = np.isfinite(time_s)
    dropped, dropped_rows = dict(table.dropped), dict(table.dropped_rows)
    remarks: tuple[Finding, ...] = ()
    _note(dropped, dropped_rows, "no_time", table.rows[~valid])
    if flag is not None:
        false, remarks = marked(table.columns[flag], flag, log.where)
        false &= valid
        _note(dropped, dropped_rows, "marked_invalid", table.rows[false])
        valid &= ~false
    names = [column.name for column in columns.values()]
    zeros = np.zeros_like(valid)
    zeros[valid] = zeros_between(
        _chosen(time_s, valid), [_chosen(table.columns[name], valid) for name in names]
    )
    if zeros.any():
        _note(dropped, dropped_rows, ZEROS, table.rows[zeros])
        remarks += (zeros_told(sensor, log.where, names, zeros),)
        valid &= ~zeros
    values = {key: column.in_si(table.columns[column.name]) for key, column in columns.items()}
    of_angles = any(column.is_angle for column in columns.values())
    faults = faults_of(*(values[key] for key in COLUMNS)) if of_angles else {}
    if of_angles:
        remarks += minutes_told(values[COLUMNS[0]], values[COLUMNS[1]], log.where)
    for reason, wrong in faults.items():
        _note(dropped, dropped_rows, reason, table.rows[valid & wrong])
        valid &= ~wrong
    if isinstance(mapping, AttitudeMap) and mapping.frame == "enu":
        values = _to_ned(values)
    values = {key: _finite(_chosen(numbers, valid)) for key, numbers in values.items()}
    if of_angles:
        values = dict(zip(COLUMNS, from_first_fix(*(values[key] for key in COLUMNS)), strict=True))
    return RawSensor(
        sensor=sensor,
        file=log.where,
        time_s=moved_stamps(_chosen(time_s, valid), mapping.time_offset_s, mapping.time_drift_ppm),
        values=values,
        rows=_chosen(table.rows, valid),
        columns={key: column.name for key, column in columns.items()},
        rows_read=table.rows_read,
        dropped=dropped,
        dropped_rows=dropped_rows,
        on_change=mapping.on_change if isinstance(mapping, InputMap) else None,
        time_column=time_column(log, mapping),
        remarks=remarks,
    )


def _chosen(values: np.ndarray, which: np.ndarray) -> np.ndarray:
    """The values where `which` is true; without a copy where that is everywhere."""
    return values if which.all() else values[which]


def _to_ned(angles: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Angles of a body (forward, port, up) in (east, north, up) as the program has them."""
    turned = {"pitch_rad": (0.0, -1.0), "heading_rad": (np.pi / 2, -1.0)}
    return {
        key: turned[key][0] + turned[key][1] * values if key in turned else values
        for key, values in angles.items()
    }


def _finite(numbers: np.ndarray) -> np.ndarray:
    return numbers if np.isfinite(numbers).all() else np.where(np.isinf(numbers), np.nan, numbers)


def _note(
    dropped: dict[str, int],
    dropped_rows: dict[str, tuple[int, ...]],
    reason: str,
    rows: np.ndarray,
) -> None:
    if rows.size:
        dropped[reason] = int(rows.size)
        dropped_rows[reason] = tuple(int(row) for row in rows[:FIRST_FEW])


def _undecided(
    source: TrialSource,
    logs: dict[Path, Tables],
    homes: dict[str, LogFile],
    column_map: ColumnMap,
) -> Tables:
    """Tables of which each has latitude and longitude, where no other has a position."""
    mapping = column_map.of("position")
    if "position" in homes or "position" in source.assigned or mapping.topic is not None:
        return ()
    tables = tuple(log for own in logs.values() for log in own)
    return _having(tables, "position", column_map)[1]


def _unused(
    source: TrialSource,
    logs: dict[Path, Tables],
    homes: dict[str, LogFile],
    undecided: Tables,
    told: Tables,
) -> tuple[Finding, ...]:
    used = {log.path for log in (*homes.values(), *told)}
    aside = tuple(
        Finding(
            code="file_not_used",
            message=f"{path.name} is a recording beside tables, and is not read",
            where=str(source.place),
            remedy="Give it alone, or name its topics in a map (--map).",
        )
        for path in source.aside
    )
    if undecided:
        labels = listed([log.label for log in undecided])
        key = "topic" if undecided[0].topic else "file"
        finding = Finding(
            code="file_not_used",
            message=f"latitude and longitude are in each of {labels}, and not read",
            where=str(source.place),
            remedy=f'Choose in a map (--map): [position] {key} = "{undecided[0].label}".',
        )
        aside = (*aside, finding)
    return aside + tuple(
        Finding(
            code="file_not_used",
            message=f"{path.name} has no column of a known channel that is not in another file",
            where=str(source.place),
        )
        for path in logs
        if path not in used
    )


def _damage(logs: dict[Path, Tables]) -> tuple[Finding, ...]:
    """What the reader of a container could not read."""
    return tuple(
        Finding(code="log_damaged", message=note, where=str(path))
        for path, tables in logs.items()
        if tables[0].container is not None
        for note in tables[0].container.notes
    )


def _is_instant(sensor: RawSensor) -> bool:
    """Whether a sensor's times are absolute; ``time_s`` is what the user counts, as it is."""
    return not sensor.time_column.lower().endswith("_s")


def _refuse_two_clocks(name: str, sensors: dict[str, RawSensor], starts: dict[str, float]) -> None:
    """Refuse instants beside seconds since switch-on: any overlap would be an accident."""
    clocks = {start > ABSOLUTE_S: key for key, start in starts.items()}
    if len(clocks) == 2:
        since, instant = sensors[clocks[False]], sensors[clocks[True]]
        raise InputError(
            f"the sensors run on different clocks: {since.time_column} of {since.file} starts "
            f"at {starts[clocks[False]]:.3f} s, {instant.time_column} of {instant.file} is "
            "absolute",
            f"trial {name}",
            "Put all of them on the same clock.",
        )


def _from_common_origin(
    name: str,
    sensors: dict[str, RawSensor],
    origins: dict[str, int],
    findings: tuple[Finding, ...],
) -> RawTrial:
    """Count absolute instants from the whole second at which the trial starts.

    ``time_s`` is left as the user counts it, even from 1970.
    """
    starts = {k: origins[k] + float(s.time_s.min()) for k, s in sensors.items() if s.time_s.size}
    absolute = [start for start in starts.values() if start > ABSOLUTE_S]
    if not absolute or not any(_is_instant(s) for s in sensors.values()):
        return RawTrial(name, _from(0, sensors, origins), findings)
    _refuse_two_clocks(name, sensors, starts)
    origin = int(np.floor(min(absolute)))
    stamp = datetime.fromtimestamp(origin, UTC).isoformat().replace("+00:00", "Z")
    return RawTrial(name, _from(origin, sensors, origins), findings, stamp)


def _from(origin: int, sensors: dict[str, RawSensor], origins: dict[str, int]) -> dict:
    """Sensors with their times counted from `origin` instead of each from its own."""
    return {k: replace(s, time_s=s.time_s + (origins[k] - origin)) for k, s in sensors.items()}
