"""A proposed ``MAP.toml`` for files with other names: aliases for columns, ranges for units."""

import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from auvident.errors import InputError
from auvident.schema.channels import CHANNELS, SENSORS, Channel
from auvident.schema.logs import TIME_UNITS, UNITS, SensorMap, unit_name
from auvident.storage.log_columns import (
    ALIASES,
    guess_column,
    guess_time,
    of_sensor,
    resolve,
    split_unit,
    time_column,
)
from auvident.storage.log_file import LogFile, stem

# A value beyond the limit is taken for the second unit. A rudder of 2 rad or a yaw rate of 1 rad/s
# does not occur; whole circles tell degrees of heading; propellers of AUVs turn faster than 40 rpm.
RANGE_UNITS: dict[str, tuple[tuple[str, float], ...]] = {
    "rad": (("rad", 6.5), ("deg", np.inf)),
    "rad/s": (("radps", 1.0), ("degps", np.inf)),
    "m/s": (("mps", 15.0), ("cmps", 1500.0), ("mmps", np.inf)),
    "1/min": (("rps", 40.0), ("rpm", np.inf)),
    "m": (("m", np.inf),),
}
FIN_LIMIT = 1.6  # rad: a fin beyond 90 degrees is in degrees
USUAL_STEP_S = 5.0  # a median step above it means that the time is not in seconds
HEADER = (
    "# Proposed by `auvident inspect`: check names, units and signs, then pass it with --map.\n"
)


@dataclass(frozen=True)
class Proposal:
    """A column proposed for a channel; `guessed` when its unit was read off its range."""

    channel: Channel
    file: Path
    name: str
    unit: str
    guessed: bool


def propose_map(
    logs: Mapping[Path, LogFile], values: Mapping[Path, Mapping[str, np.ndarray]]
) -> tuple[str, tuple[str, ...]]:
    """Text of a map for the files of one folder, and needed channels without a column.

    Parameters
    ----------
    logs : mapping of Path to LogFile
        The files; of files with the same columns (a trial each) the first stands for all.
    values : mapping
        Their columns.

    Returns
    -------
    text : str
        TOML; "" when nothing needs a map.
    unassigned : tuple of str
        Needed channel columns for which nothing was found.
    """
    alike = len({log.names for log in logs.values()}) == 1 and len(logs) > 1
    chosen = dict(list(logs.items())[:1]) if alike else dict(logs)
    proposals = _one_unit(_assign(chosen, values))
    found = {p.channel.column for p in proposals}
    unassigned = tuple(c.column for c in CHANNELS if c.needed and c.column not in found)
    if _reads_without(chosen, proposals):
        return "", unassigned
    tables = [
        _table(sensor, [p for p in proposals if p.channel.sensor == sensor], chosen, values)
        for sensor in SENSORS
    ]
    text = HEADER + "\n".join(table for table in tables if table)
    text += "".join(f"\n# No column found for {c}.\n" for c in unassigned)
    text += _derive(found, unassigned)
    return (text, unassigned) if proposals else ("", unassigned)


def _derive(found: Collection[str], unassigned: Collection[str]) -> str:
    """What position and heading, or the heading alone, could stand in for; only proposed."""
    from_heading = ("r_radps",) if "heading_rad" in found else ()
    from_both = ("u_mps", "v_mps") if {"heading_rad", "north_m", "east_m"} <= {*found} else ()
    wanted = [c[0] for c in (*from_both, *from_heading) if c in unassigned]
    if not wanted:
        return ""
    lines = "".join(f"# {quantity} = true\n" for quantity in wanted)
    return f"\n# Where nothing measured it, position and heading imply it:\n# [derive]\n{lines}"


def _assign(
    logs: Mapping[Path, LogFile], values: Mapping[Path, Mapping[str, np.ndarray]]
) -> list[Proposal]:
    """Best column of each channel: its own name first, then the known aliases."""
    found: dict[str, Proposal] = {}
    used: set[tuple[Path, str]] = set()
    times = {(path, guess_time(log)) for path, log in logs.items()}
    for exact in (True, False):
        for channel in CHANNELS:
            home = None if channel.column in found else _home(channel, logs)
            for path in [] if channel.column in found else ([home] if home else list(logs)):
                names = [
                    name
                    for name, numbers in values[path].items()
                    if numbers.dtype != object and (path, name) not in used | times
                ]
                name = _exact(channel, names) if exact else guess_column(channel, names)
                if name is not None:
                    unit, guessed = _unit(channel, logs[path], name, values[path][name])
                    found[channel.column] = Proposal(channel, path, name, unit, guessed)
                    used.add((path, name))
                    break
    return list(found.values())


def _one_unit(proposals: list[Proposal]) -> list[Proposal]:
    """Guessed units of one sensor agree: the channel with the widest range decides."""
    order = {name: i for options in RANGE_UNITS.values() for i, (name, _) in enumerate(options)}
    widest: dict[tuple[str, str], str] = {}
    for p in proposals:
        key = (p.channel.sensor, p.channel.unit)
        if p.guessed and order[p.unit] >= order[widest.get(key, p.unit)]:
            widest[key] = p.unit
    return [
        replace(p, unit=widest[p.channel.sensor, p.channel.unit]) if p.guessed else p
        for p in proposals
    ]


def _home(channel: Channel, logs: Mapping[Path, LogFile]) -> Path | None:
    return next((path for path in logs if stem(path).lower() == channel.sensor), None)


def _exact(channel: Channel, names: list[str]) -> str | None:
    """Column of a channel by name or by the first, unmistakable aliases (long ones)."""
    sure = {channel.quantity, *(alias for alias in ALIASES[channel.quantity] if len(alias) > 2)}
    own_first = sorted(names, key=lambda name: _base(name) != channel.quantity)
    return next((n for n in own_first if _base(n) in sure or n.strip().lower() in sure), None)


def _base(name: str) -> str:
    lower = name.strip().lower()
    stem_, _, suffix = lower.rpartition("_")
    return stem_ if stem_ and unit_name(suffix) else split_unit(lower)[0]


def _unit(channel: Channel, log: LogFile, name: str, values: np.ndarray) -> tuple[str, bool]:
    """Unit by suffix or label when it fits, else by range."""
    suffix = name.strip().lower().rpartition("_")[2]
    for stated in (unit_name(log.unit_of(name)), split_unit(name)[1], unit_name(suffix)):
        if stated and UNITS[stated][0] == channel.unit:
            return stated, False
    known = np.abs(values[np.isfinite(values)])
    largest = float(known.max()) if known.size else 0.0
    options = RANGE_UNITS[channel.unit]
    if channel.kind == "input" and channel.unit == "rad":
        options = (("rad", FIN_LIMIT), ("deg", np.inf))
    return next(unit for unit, limit in options if largest <= limit), True


def _reads_without(logs: Mapping[Path, LogFile], proposals: list[Proposal]) -> bool:
    """Whether every proposed column is found without a map."""
    for proposal in proposals:
        log, sensor = logs[proposal.file], proposal.channel.sensor
        try:
            columns = resolve(log, sensor, SensorMap())
            time_column(log, SensorMap())
        except InputError:
            return False
        if columns.get(proposal.channel.column) is None:
            return False
    return True


def _table(
    sensor: str,
    proposals: list[Proposal],
    logs: Mapping[Path, LogFile],
    values: Mapping[Path, Mapping[str, np.ndarray]],
) -> str:
    if not proposals:
        return ""
    path = proposals[0].file
    lines = [f"[{sensor}]"]
    if len(logs) > 1 and stem(path).lower() != sensor:
        lines.append(f"file = {json.dumps(path.name)}")
    lines += _time_lines(logs[path], values[path])
    lines += [_entry(p) for p in proposals if p.file == path]
    if of_sensor(sensor)[0].kind == "input":
        lines.append("# add sign = -1 if it counts the other way than [signs] says")
    return "\n".join(lines) + "\n"


def _time_lines(log: LogFile, values: Mapping[str, np.ndarray]) -> list[str]:
    name = guess_time(log)
    if name is None:
        return ['time = "?"  # no time column was recognised']
    lines = [f"time = {json.dumps(name)}"]
    suffix = name.lower().rpartition("_")[2]
    numbers = values.get(name)
    if suffix in TIME_UNITS or numbers is None or numbers.dtype == object:
        return lines
    steps = np.diff(numbers[np.isfinite(numbers)])
    if steps.size and USUAL_STEP_S < np.median(steps) < 1e3 * USUAL_STEP_S:
        lines.append('time_unit = "ms"  # by the distance of the rows: check')
    return lines


def _entry(proposal: Proposal) -> str:
    text = (
        f"{proposal.channel.quantity} = "
        f'{{ column = {json.dumps(proposal.name)}, unit = "{proposal.unit}" }}'
    )
    return text + ("  # unit guessed from the values: check" if proposal.guessed else "")
