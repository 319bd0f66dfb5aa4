"""A column proposed for a channel, and the unit that its values seem to be in."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from auvident.errors import InputError
from auvident.schema.channels import Channel
from auvident.schema.holding import seems_on_change
from auvident.schema.logs import (
    KNOT,
    PERCENT,
    RPM_OF_RADPS,
    UNITS,
    SensorMap,
    is_angle_for,
    unit_name,
)
from auvident.storage.log_columns import split_unit
from auvident.storage.log_file import LogFile
from auvident.storage.log_geographic import from_first_fix
from auvident.storage.log_time import to_seconds
from auvident.storage.log_time_names import guess_time, time_unit

Values = Mapping[str, Mapping[str, np.ndarray]]  # columns of tables by `LogFile.where`
Track = tuple[np.ndarray, np.ndarray]  # times in s, and values

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
CHORD_S = 10.0  # over which a speed is taken from the position
LEAST_MPS = 0.3  # a slower vehicle may be drifting
FEWEST_CHORDS = 8
KNOTS_WITHIN = 0.06  # of a knot in m/s: a current and a tolerance of the log are in it


@dataclass(frozen=True)
class Proposal:
    """A column proposed for a channel.

    Attributes
    ----------
    channel : Channel
        What it seems to hold.
    home : str
        Its table, as `LogFile.where` has it.
    name, unit : str
        Column and unit.
    guessed : bool
        Whether the unit was read off its range.
    sign : int
        -1 where the axes of the log point the other way.
    remark : str
        Why, for the reader of the map.
    scale : float
        What one of the column is in the unit.
    """

    channel: Channel
    home: str
    name: str
    unit: str
    guessed: bool
    sign: int = 1
    remark: str = ""
    scale: float = 1.0


def one_unit(proposals: list[Proposal]) -> list[Proposal]:
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


def unit_of(channel: Channel, log: LogFile, name: str, values: np.ndarray) -> tuple[str, bool]:
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


def in_another(channel: Channel, log: LogFile, name: str) -> tuple[str, float, str] | None:
    """Unit, scale and remark for a column that says a unit which is none of its channel.

    A share of the range becomes an angle or a rate by a scale that the log does not know: a map
    without it is refused with what to write.
    """
    label, suffix = log.unit_of(name).strip().lower(), name.strip().lower().rpartition("_")[2]
    if channel.kind == "input" and {label, suffix} & PERCENT:
        if channel.unit == "1/min":
            return "percent", 1.0, "add scale, the rpm of one percent"
        return "percent", 1.0, 'write unit = "deg" and scale, the degrees of one percent'
    if channel.unit == "1/min" and "radps" in (unit_name(label), unit_name(suffix)):
        return "rpm", RPM_OF_RADPS, "rad/s by its name"
    return None


def in_knots(
    proposals: list[Proposal], logs: Mapping[str, LogFile], values: Values
) -> list[Proposal]:
    """The same, the velocities in knots where the track is half as long as they say in m/s."""
    by_column = {p.channel.column: p for p in proposals}
    wanted = [by_column.get(column) for column in ("u_mps", "north_m", "east_m")]
    if any(p is None for p in wanted) or not (wanted[0] and wanted[0].guessed):
        return proposals
    u, north, east = (_track(p, logs, values) for p in wanted if p is not None)
    if wanted[1] and is_angle_for("north", wanted[1].unit):
        north, east = _in_metres(north, east)
    share = _share(u, north, east)
    if share is None or abs(share - KNOT) > KNOTS_WITHIN:
        return proposals
    remark = f"the position moves {share:.2f} m/s for each of it: knots"
    return [
        replace(p, unit="kn", guessed=False, remark=remark) if p.channel.sensor == "dvl" else p
        for p in proposals
    ]


def may_be_on_change(proposal: Proposal, logs: Mapping[str, LogFile], values: Values) -> bool:
    """Whether an input seems to be logged only when it changes, and would be taken for polled."""
    if proposal.channel.kind != "input":
        return False
    time, numbers = _track(proposal, logs, values)
    if time.size < 2:  # or no clock at all
        return False
    apart = np.append(np.diff(time) > 0, True)
    return seems_on_change(time[apart], numbers[apart])


def _track(proposal: Proposal, logs: Mapping[str, LogFile], values: Values) -> Track:
    """Times in s and values of a proposed column, in order; empty where there is no clock."""
    log, table = logs[proposal.home], values[proposal.home]
    name = guess_time(log)
    none = np.empty(0)
    if name is None or name not in table or table[name].dtype == object:
        return none, none
    try:
        rows = np.arange(1, table[name].size + 1)
        time = to_seconds(table[name], time_unit(log, name, SensorMap()), log.where, rows)
    except InputError:  # what is amiss with the clock is told beside its file
        return none, none
    good = np.isfinite(time) & np.isfinite(table[proposal.name])
    order = np.argsort(time[good], kind="stable")
    numbers = table[proposal.name][good][order]
    if is_angle_for(proposal.channel.quantity, proposal.unit):
        numbers = proposal.scale * UNITS[proposal.unit][1] * numbers
    return time[good][order], numbers


def _in_metres(lat_rad: Track, lon_rad: Track) -> tuple[Track, Track]:
    """North and east of a track in latitude and longitude; empty where these are not in pairs."""
    none = np.empty(0)
    if not np.array_equal(lat_rad[0], lon_rad[0]):
        return (none, none), (none, none)
    north, east = from_first_fix(lat_rad[1], lon_rad[1])
    known = np.isfinite(north)
    return (lat_rad[0][known], north[known]), (lat_rad[0][known], east[known])


def _share(
    u: Track,
    north: Track,
    east: Track,
) -> float | None:
    """Speed of the position over the logged one, the median of chords; None where too few."""
    if min(u[0].size, north[0].size, east[0].size) < FEWEST_CHORDS:
        return None
    starts = np.arange(max(u[0][0], north[0][0]), min(u[0][-1], north[0][-1]) - CHORD_S, CHORD_S)
    moved = [np.interp(starts + CHORD_S, *x) - np.interp(starts, *x) for x in (north, east)]
    track = np.hypot(*moved) / CHORD_S
    steps = np.linspace(0.0, CHORD_S, FEWEST_CHORDS)
    logged = np.mean(np.abs(np.interp(starts[:, None] + steps, *u)), axis=1)
    under_way = (track > LEAST_MPS) & (logged > LEAST_MPS)
    if np.sum(under_way) < FEWEST_CHORDS:
        return None
    return float(np.median(track[under_way] / logged[under_way]))
