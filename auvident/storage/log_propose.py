"""A proposed ``MAP.toml`` for files with other names: aliases for columns, ranges for units."""

import json
from collections.abc import Collection, Mapping, Sequence

import numpy as np

from auvident.errors import InputError
from auvident.schema.channels import CHANNELS, SENSORS, Channel
from auvident.schema.logs import PERCENT, SensorMap, unit_name
from auvident.storage.log_columns import (
    ALIASES,
    angle_of,
    guess_column,
    of_sensor,
    quantity_of,
    resolve,
    split_unit,
    time_column,
)
from auvident.storage.log_file import LogFile
from auvident.storage.log_proposal import (
    Proposal,
    Values,
    in_another,
    in_knots,
    may_be_on_change,
    one_unit,
    unit_of,
)
from auvident.storage.log_propose_angles import angle_proposals, find_angles
from auvident.storage.log_propose_files import (
    Tables,
    are_one_trial,
    file_patterns,
    to_propose_for,
)
from auvident.storage.log_propose_topics import (
    as_topics,
    assign_topics,
    flag_lines,
    is_generic,
    is_printed,
    topic_lines,
)
from auvident.storage.log_time import EPOCH_MAGNITUDES
from auvident.storage.log_time_names import guess_time, time_unit
from auvident.storage.log_valid import unread_flag

USUAL_STEP_S = 5.0  # a median step above it means that the time is not in seconds
STEPS_OF = {"ms": 1e3 * USUAL_STEP_S, "us": 1e6 * USUAL_STEP_S}  # steps below: this unit
HEADER = (
    "# Proposed by `auvident inspect`: check names, units and signs, then pass it with --map.\n"
)


def propose_map(
    logs: Mapping[str, LogFile], values: Values, trials: Sequence[Tables] = ()
) -> tuple[str, tuple[str, ...]]:
    """Text of a map for the tables of one folder or container, and needed channels without one.

    Parameters
    ----------
    logs : mapping of str to LogFile
        The tables by `LogFile.where`; of files alike (a trial each) the first stands for all.
    values : mapping
        Their columns.
    trials : sequence of mapping
        Those of them that are read together without a map, as `trials_without_map` finds them.

    Returns
    -------
    text : str
        TOML; "" when nothing needs a map.
    unassigned : tuple of str
        Needed channel columns for which nothing was found.
    """
    chosen = _first_of_alike(to_propose_for(logs, trials))
    with_topics = any(log.topic or is_printed(log) for log in chosen.values())
    assigned = assign_topics(as_topics(chosen), values) if with_topics else _assign(chosen, values)
    proposals = in_knots(one_unit(assigned), chosen, values)
    found = {p.channel.column for p in proposals}
    unassigned = tuple(c.column for c in CHANNELS if c.needed and c.column not in found)
    silent = any(may_be_on_change(p, chosen, values) for p in proposals)
    homes = {q.home: [p.name for p in proposals if p.home == q.home] for q in proposals}
    marks = any(_has_unread_flag(p, chosen, values) for p in proposals)
    is_read = not silent and not marks and not _in_finer_units(proposals, chosen, values)
    is_read = is_read and are_one_trial(homes, trials) and _reads_without(chosen, proposals)
    if is_read and not (unassigned and _have_other_columns(chosen, values, proposals)):
        return "", unassigned
    files = file_patterns(homes, chosen)
    tables = [
        _table(sensor, [p for p in proposals if p.channel.sensor == sensor], chosen, values, files)
        for sensor in SENSORS
    ]
    text = HEADER + "\n".join(table for table in tables if table)
    text += _missing(unassigned, {p.channel.sensor for p in proposals}, chosen)
    text += _derive(found, unassigned)
    return (text, unassigned) if proposals else ("", unassigned)


def _missing(
    unassigned: Collection[str], begun: Collection[str], logs: Mapping[str, LogFile]
) -> str:
    """Needed channels without a column, as the lines that would name one."""
    lines: list[str] = []
    for sensor in SENSORS:
        needed = [c for c in of_sensor(sensor) if c.column in unassigned]
        if not needed:
            continue
        lines.append(f"in the table [{sensor}]:" if sensor in begun else f"[{sensor}]")
        if sensor not in begun:
            lines += [] if len(logs) == 1 else ['file = "?"']
            lines.append(f"time = {json.dumps(_common_time(logs) or '?')}")
        lines += [f'{c.quantity} = {{ column = "?", unit = "{_suffix(c)}" }}' for c in needed]
    if not lines:
        return ""
    head = f"No column was recognised for {', '.join(unassigned)}. If the log has it, say where:"
    return "\n" + "".join(f"# {line}\n" for line in (head, *lines))


def _common_time(logs: Mapping[str, LogFile]) -> str | None:
    """The time column of all tables, if they have one of the same name."""
    names = {guess_time(log) for log in logs.values()}
    return names.pop() if len(names) == 1 else None


def _suffix(channel: Channel) -> str:
    """The unit in which the program counts, as columns and maps spell it."""
    return channel.column.rpartition("_")[2]


def _first_of_alike(logs: Mapping[str, LogFile]) -> dict[str, LogFile]:
    """The tables of one trial, where each file is a trial: those of the first."""
    files: dict[object, list[tuple[str, tuple[str, ...]]]] = {}
    for log in logs.values():
        files.setdefault(log.path, []).append((log.topic, log.names))
    containers = [log.path for log in logs.values() if log.topic]
    first = containers[0] if containers else next(iter(files), None)
    alike = len(files) > 1 and all(tables == files[first] for tables in files.values())
    return {k: log for k, log in logs.items() if not (alike or containers) or log.path == first}


def _derive(found: Collection[str], unassigned: Collection[str]) -> str:
    """What position and heading, or the heading alone, could stand in for; only proposed."""
    from_heading = ("r_radps",) if "heading_rad" in found else ()
    from_both = ("u_mps", "v_mps") if {"heading_rad", "north_m", "east_m"} <= {*found} else ()
    wanted = [c[0] for c in (*from_both, *from_heading) if c in unassigned]
    if not wanted:
        return ""
    lines = "".join(f"# {quantity} = true\n" for quantity in wanted)
    why = "# Where it was not measured, it can be derived from position and heading:"
    return f"\n{why}\n# [derive]\n{lines}"


def _assign(logs: Mapping[str, LogFile], values: Values) -> list[Proposal]:
    """Best column of each channel: its own name first, then the known aliases."""
    found: dict[str, Proposal] = {}
    used: set[tuple[str, str]] = set()
    times = {(key, guess_time(log)) for key, log in logs.items()}
    for exact in (True, False):
        for channel in CHANNELS:
            home = None if channel.column in found else _home(channel, logs)
            for key in [] if channel.column in found else ([home] if home else list(logs)):
                names = [
                    name
                    for name, numbers in values[key].items()
                    if numbers.dtype != object
                    and (key, name) not in used | times
                    and (quantity_of(name) or np.any(numbers[np.isfinite(numbers)]))
                ]
                name = _named(channel, logs[key], names, exact)
                if name is not None:
                    found[channel.column] = _proposal(channel, key, name, logs[key], values[key])
                    used.add((key, name))
                    break
    return _with_angles(found, logs, values)


def _proposal(
    channel: Channel, key: str, name: str, log: LogFile, values: Mapping[str, np.ndarray]
) -> Proposal:
    """A column for a channel in the unit that it states, else that of its range."""
    another = in_another(channel, log, name)
    if another is not None:
        unit, scale, remark = another
        return Proposal(channel, key, name, unit, False, remark=remark, scale=scale)
    unit, guessed = unit_of(channel, log, name, values[name])
    label = log.unit_of(name).strip() if guessed else ""
    remark = f'labelled "{label}"' if label else ""
    return Proposal(channel, key, name, unit, guessed, remark=remark)


def _with_angles(
    found: dict[str, Proposal], logs: Mapping[str, LogFile], values: Values
) -> list[Proposal]:
    """The proposals, latitude and longitude among them where no position in m is."""
    others = [p for p in found.values() if p.channel.sensor != "position"]
    position = [p for p in found.values() if p.channel.sensor == "position"]
    home = _home(of_sensor("position")[0], logs)
    for key in [] if len(position) == 2 else ([home] if home else list(logs)):
        angles = find_angles(logs[key], values[key])
        if angles is not None:
            return others + angle_proposals(key, angles)
    return others + position


def _home(channel: Channel, logs: Mapping[str, LogFile]) -> str | None:
    return next((key for key, log in logs.items() if log.stem.lower() == channel.sensor), None)


def _named(channel: Channel, log: LogFile, names: list[str], exact: bool) -> str | None:
    """Column of a channel; one that is called ``value`` has the name of its file."""
    generic = [name for name in names if is_generic(name)]
    spelled = {name: name for name in names}
    if len(generic) == 1 and log.stem.lower() not in spelled:
        spelled = {log.stem.lower() if n in generic else n: n for n in names}
    found = (_exact if exact else guess_column)(channel, list(spelled))
    return None if found is None else spelled[found]


def _exact(channel: Channel, names: list[str]) -> str | None:
    """Column of a channel by name or by the first, unmistakable aliases (long ones)."""
    sure = {channel.quantity, *(alias for alias in ALIASES[channel.quantity] if len(alias) > 2)}
    found = [n for n in names if _base(n) in sure or n.strip().lower() in sure]
    return min(found, key=lambda n: _base(n) != channel.quantity, default=None)


def _base(name: str) -> str:
    lower = name.strip().lower()
    stem, _, suffix = lower.rpartition("_")
    is_unit = bool(unit_name(suffix)) or suffix in PERCENT
    return stem if stem and is_unit else split_unit(lower)[0]


def _has_unread_flag(proposal: Proposal, logs: Mapping[str, LogFile], values: Values) -> bool:
    """Whether the table of a DVL marks its readings in a column that only a map can name."""
    home = proposal.home
    is_left = unread_flag(logs[home].names) is not None
    return is_left and bool(flag_lines(proposal.channel.sensor, values[home]))


def _reads_without(logs: Mapping[str, LogFile], proposals: list[Proposal]) -> bool:
    """Whether every proposed column is found without a map."""
    for proposal in proposals:
        log, sensor = logs[proposal.home], proposal.channel.sensor
        try:
            columns = resolve(log, sensor, SensorMap())
            time_column(log, SensorMap())
        except InputError:
            return False
        column = columns.get(proposal.channel.column)
        if column is None or (column.is_angle and _has_rivals(log, logs, proposals)):
            return False
    return True


def _has_rivals(fixes: LogFile, logs: Mapping[str, LogFile], proposals: Sequence[Proposal]) -> bool:
    """Whether another table of the same trial has latitude and longitude: none is read then."""
    if fixes.stem.lower() == "position" or len({p.home for p in proposals}) == 1:
        return False
    others = (log for log in logs.values() if log.where != fixes.where)
    return any(angle_of(n, log.unit_of(n)) for log in others for n in log.names)


def _table(
    sensor: str,
    proposals: list[Proposal],
    logs: Mapping[str, LogFile],
    values: Values,
    files: Mapping[str, str],
) -> str:
    if not proposals:
        return ""
    home = proposals[0].home
    log = logs[home]
    lines = [f"[{sensor}]"]
    if log.topic:
        lines += topic_lines(sensor, log, values[home], proposals)
    else:
        if len(logs) > 1 and log.stem.lower() != sensor:
            lines.append(f"file = {json.dumps(files[home])}")
        lines += _time_lines(log, values[home])
        lines += flag_lines(sensor, values[home])
    lines += [_entry(p) for p in proposals if p.home == home]
    if of_sensor(sensor)[0].kind == "input":
        if any(may_be_on_change(p, logs, values) for p in proposals if p.home == home):
            lines.append("on_change = true  # rows differ, with silences between: check")
        lines.append("# add sign = -1 if its sign is opposite to [signs]")
    return "\n".join(lines) + "\n"


def _have_other_columns(
    logs: Mapping[str, LogFile], values: Values, proposals: Sequence[Proposal]
) -> bool:
    """Whether the tables have columns of numbers that may be what is missing."""
    taken = {(p.home, p.name) for p in proposals}
    taken |= {
        (key, name) for key, log in logs.items() for name in (guess_time(log), "valid") if name
    }
    return any(
        numbers.dtype != object and (key, name) not in taken
        for key in logs
        for name, numbers in values[key].items()
    )


def _in_finer_units(
    proposals: Sequence[Proposal], logs: Mapping[str, LogFile], values: Values
) -> bool:
    """Whether the rows of every needed table are too far apart for seconds, and are no epochs."""
    homes = {p.home for p in proposals if p.channel.needed}
    return bool(homes) and all(
        _finer_unit(logs[home], values[home])
        and np.nanmedian(values[home][guess_time(logs[home]) or ""]) < EPOCH_MAGNITUDES[-1][1]
        for home in homes
    )


def _time_lines(log: LogFile, values: Mapping[str, np.ndarray]) -> list[str]:
    name, unit = guess_time(log), _finer_unit(log, values)
    if name is None:
        return ['time = "?"  # no time column was recognised']
    by_rows = [f'time_unit = "{unit}"  # by the distance of the rows: check'] if unit else []
    return [f"time = {json.dumps(name)}", *by_rows]


def _finer_unit(log: LogFile, values: Mapping[str, np.ndarray]) -> str | None:
    """Unit of a time whose name says none, where the rows are too far apart for seconds."""
    name = guess_time(log)
    numbers = None if name is None else values.get(name)
    if (
        name is None
        or numbers is None
        or numbers.dtype == object
        or time_unit(log, name, SensorMap())
    ):
        return None
    known = numbers[np.isfinite(numbers)]
    step = float(np.median(np.diff(known))) if known.size > 1 else 0.0
    if step <= USUAL_STEP_S:
        return None
    of_epoch = (unit for unit, least in EPOCH_MAGNITUDES if np.median(known) >= least)
    return next(of_epoch, None) or next(
        (unit for unit, most in STEPS_OF.items() if step < most), None
    )


def _plain(number: float) -> str:
    """A power of ten as people write it: 1e-7."""
    return f"{number:g}".replace("e-0", "e-")


def _entry(proposal: Proposal) -> str:
    sign = ", sign = -1" if proposal.sign < 0 else ""
    scale = "" if proposal.scale == 1.0 else f", scale = {_plain(proposal.scale)}"
    text = (
        f"{proposal.channel.quantity} = "
        f'{{ column = {json.dumps(proposal.name)}, unit = "{proposal.unit}"{scale}{sign} }}'
    )
    remarks = [proposal.remark] if proposal.remark else []
    remarks += ["unit guessed from the values: check"] if proposal.guessed else []
    # names of other topics are in it, and no control character may stand in TOML
    said = "".join(c if c.isprintable() else "?" for c in "; ".join(remarks))
    return text + (f"  # {said}" if remarks else "")
