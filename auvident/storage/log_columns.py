"""Which column of a file holds which channel, in which unit; what to suggest when none does."""

import difflib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from auvident.errors import InputError, together
from auvident.schema.channels import BY_QUANTITY, CHANNELS, Channel
from auvident.schema.logs import (
    LONE_ANGLE,
    PERCENT,
    RPM_OF_RADPS,
    UNITS,
    ColumnEntry,
    Derive,
    SensorMap,
    is_angle_for,
    unit_name,
    units_for,
    units_of,
)
from auvident.schema.quoting import quoted
from auvident.storage.log_file import LogFile
from auvident.storage.log_geographic import quantity_named
from auvident.storage.log_layout import TIME_NAMES
from auvident.storage.log_time_names import guess_time

RPM_STEMS = ("n", "prop", "propeller", "propeller_rate", "shaft", "thruster", "motor")
# Names met in logs, by quantity; only proposed, never used without the user's word.
ALIASES: dict[str, tuple[str, ...]] = {
    "u": (
        "vx",
        "vel_x",
        "velocity_x",
        "surge",
        "surge_velocity",
        "dvl_x",
        "dvl_u",
        "u_dvl",
        "v_x",
        "speed",
        "x_velocity",
        "vel_u",
        "u_body",
        "bt_vx",
        "vforward",
    ),
    "v": (
        "vy",
        "vel_y",
        "velocity_y",
        "sway",
        "sway_velocity",
        "dvl_y",
        "dvl_v",
        "v_dvl",
        "v_y",
        "y_velocity",
        "vel_v",
        "v_body",
        "bt_vy",
        "vlateral",
    ),
    "w": (
        "vz",
        "vel_z",
        "velocity_z",
        "heave",
        "heave_velocity",
        "dvl_z",
        "dvl_w",
        "w_dvl",
        "v_z",
        "z_velocity",
        "vel_w",
        "w_body",
        "bt_vz",
    ),
    "p": (
        "roll_rate",
        "rollrate",
        "gyro_x",
        "wx",
        "omega_x",
        "p_gyro",
        "gyr_x",
        "angular_velocity_x",
    ),
    "q": (
        "pitch_rate",
        "pitchrate",
        "gyro_y",
        "wy",
        "omega_y",
        "q_gyro",
        "gyr_y",
        "angular_velocity_y",
    ),
    "r": (
        "yaw_rate",
        "yawrate",
        "gyro_z",
        "wz",
        "omega_z",
        "r_gyro",
        "gyr_z",
        "rot",
        "turn_rate",
        "rate_of_turn",
        "psidot",
        "psi_dot",
        "angular_velocity_z",
    ),
    "rudder": (
        "delta",
        "delta_cmd",
        "delta_r",
        "rudder_cmd",
        "rudder_angle",
        "rud",
        "dr",
        "delta_rudder",
        "rudder_command",
        "vertical_fin",
        "fin_rudder",
        "helm",
    ),
    "elevator": (
        "delta_e",
        "delta_s",
        "elevator_cmd",
        "elevator_angle",
        "stern_plane",
        "de",
        "ds",
        "sternplane",
        "delta_stern",
        "horizontal_fin",
        "pitch_fin",
    ),
    "rpm": (
        "n",
        "n_prop",
        "prop",
        "propeller",
        "propeller_rpm",
        "prop_rpm",
        "shaft_rpm",
        "motor_rpm",
        "thruster_rpm",
        "shaft",
        "thruster",
        "rps",
        "rev",
        "n_rpm",
        "n_cmd",
        "rpm_cmd",
    ),
    "roll": ("phi", "roll_angle"),
    "pitch": ("theta", "pitch_angle"),
    "heading": ("psi", "yaw", "hdg", "heading_true", "yaw_angle", "compass", "course_heading"),
    "depth": ("z", "depth_sensor", "pos_z"),
    "north": ("x", "x_north", "pos_n", "pos_north", "northing", "ned_x", "pos_x", "y_utm", "x0"),
    "east": ("y", "y_east", "pos_e", "pos_east", "easting", "ned_y", "pos_y", "x_utm", "y0"),
}
INSTRUMENTS = frozenset(("imu", "ahrs", "ins", "mru", "nav", "gyro", "fog", "dvl", "adcp", "ctd"))
USUAL_UNIT = {"m/s": "mps", "rad": "deg", "rad/s": "degps", "1/min": "rpm", "m": "m"}
MOST_LISTED = 40  # names in a message
LEAST_LETTERS = 3  # of a quantity whose name says something within that of a column
STAND_IN = ", scale = 0"  # one that only the user knows; a map with this is refused
SCALE_TOLD = (
    "\n  In place of the scale 0 put what 1 of the column is in that unit; where the column does "
    "not count from 0, add offset, in that unit."
)
TIME_REMEDY = "Name it time_s (seconds) or timestamp (ISO 8601 or epoch)"


@dataclass(frozen=True)
class LogColumn:
    """A column of a file that holds a channel: SI value = `factor` times the number + `offset`.

    Of a latitude or longitude (`is_angle`) that is in rad; both become north and east.
    """

    channel: Channel
    name: str
    factor: float
    offset: float = 0.0
    is_angle: bool = False

    def in_si(self, numbers: np.ndarray) -> np.ndarray:
        """Numbers of the file in the unit of the channel."""
        found = self.factor * numbers
        return found + self.offset if self.offset else found


def of_sensor(sensor: str) -> tuple[Channel, ...]:
    """Channels of one sensor."""
    return tuple(c for c in CHANNELS if c.sensor == sensor)


def split_unit(name: str) -> tuple[str, str | None]:
    """Stem and unit suffix of a column name, lower case; ``rpm`` and ``rps`` are their own."""
    lower = name.strip().lower()
    if lower in ("rpm", "rps"):
        return "rpm", lower
    base, _, suffix = lower.rpartition("_")
    return (base, suffix) if base and suffix in UNITS else (lower, None)


def quantity_of(name: str) -> str | None:
    """Quantity that a column holds by its name, or None."""
    base, unit = split_unit(name)
    if base in BY_QUANTITY:
        return base
    return "rpm" if base in RPM_STEMS and unit in ("rpm", "rps") else None


def angle_of(name: str, label: str) -> str | None:
    """Quantity of a column that is called latitude or longitude and says its unit, or None."""
    stem, suffix = split_unit(name)
    stated = {unit for unit in (suffix, unit_name(label)) if unit is not None}
    found = quantity_named(stem)
    is_angle = found and stated and all(is_angle_for(found, unit) for unit in stated)
    return found if is_angle else None


def time_column(log: LogFile, mapping: SensorMap) -> str:
    """Name of the time column of a sensor.

    Raises
    ------
    InputError
        When there is none, naming the columns found.
    """
    if mapping.time is not None:
        found = log.find(mapping.time)
        if found is None:
            raise _missing(log, f"the map's time column {mapping.time!r}", mapping.time)
        return found
    if log.time:
        return log.time
    for name in TIME_NAMES:
        found = log.find(name)
        if found is not None:
            return found
    guess = guess_time(log)
    hint = f', or say time = "{guess}" in a map (--map)' if guess else ""
    raise InputError(
        "has no time column",
        f"{log.where}, columns {', '.join(log.names)}",
        TIME_REMEDY + hint + ".",
    )


def resolve(log: LogFile, sensor: str, mapping: SensorMap) -> dict[str, LogColumn]:
    """Columns of one sensor's channels in a file, by channel column.

    Raises
    ------
    InputError
        When a mapped column is missing, a quantity has no unit or one that does not fit, two
        columns hold the same quantity, or a latitude has no longitude; tells of all of them.
    """
    entries = mapping.entries()
    found, faults = {}, list[InputError]()
    for channel in of_sensor(sensor):
        entry = entries.get(channel.quantity)
        if entry is not None and entry.column is None:  # a constant
            continue
        try:
            column = _mapped(log, channel, entry) if entry else _by_name(log, channel)
        except InputError as fault:
            faults.append(fault)
            continue
        if column is not None:
            found[channel.column] = column
    if faults:
        raise together(faults)
    return _as_angles(log, found) if sensor == "position" else found


def _as_angles(log: LogFile, found: dict[str, LogColumn]) -> dict[str, LogColumn]:
    """Columns of a position, with latitude and longitude where nothing is in m."""
    if any(not column.is_angle for column in found.values()):
        both = found
    else:
        absent = [c for c in of_sensor("position") if c.column not in found]
        named = {c.column: _angle_by_name(log, c) for c in absent}
        both = found | {key: column for key, column in named.items() if column is not None}
    angles = [column for column in both.values() if column.is_angle]
    if len(angles) == 1:
        (lone,) = angles
        alone = LONE_ANGLE.format(f"{lone.channel.quantity} (column {lone.name})")
        problem, _, remedy = alone.partition("; ")
        raise InputError(problem, log.where, f"{remedy[:1].upper()}{remedy[1:]} in [position].")
    return both


def _angle_by_name(log: LogFile, channel: Channel) -> LogColumn | None:
    return _only_one(
        log, channel, [n for n in log.names if angle_of(n, log.unit_of(n)) == channel.quantity]
    )


def _mapped(log: LogFile, channel: Channel, entry: ColumnEntry) -> LogColumn:
    wanted = entry.column or ""
    name = log.find(wanted)
    if name is None:
        what = f"the map's column {wanted!r} for {channel.quantity}"
        raise _missing(log, what, wanted)
    unit = _unit_of_entry(log, name, channel, entry)
    factor = entry.sign * _factor(log, name, channel, unit)
    is_angle = is_angle_for(channel.quantity, unit)
    return LogColumn(channel, name, factor * entry.scale, factor * entry.offset, is_angle)


def _unit_of_entry(log: LogFile, name: str, channel: Channel, entry: ColumnEntry) -> str | None:
    """Unit by the map, or as the file states it; a scaled throttle is rpm."""
    if entry.unit and entry.unit.strip().lower() in PERCENT:
        return "rpm"
    unit = unit_name(entry.unit) if entry.unit else _stated_unit(log, name, channel)
    scaled = channel.quantity == "rpm" and "scale" in entry.model_fields_set
    return "rpm" if unit is None and scaled else unit


def _by_name(log: LogFile, channel: Channel) -> LogColumn | None:
    names = [name for name in log.names if quantity_of(name) == channel.quantity]
    return _only_one(log, channel, names)


def _only_one(log: LogFile, channel: Channel, names: Sequence[str]) -> LogColumn | None:
    """The column of a channel among some, the one whose unit is stated; None where there is none.

    Raises
    ------
    InputError
        When none has a unit that fits, or two have, or two have one name.
    """
    log.refuse_twice(names)
    stated = [name for name in names if _stated_unit(log, name, channel) is not None]
    if len(stated) > 1:
        raise InputError(
            f"columns {' and '.join(stated)} both hold {channel.quantity}",
            log.where,
            "Remove one, or choose in a map (--map):"
            + in_map(channel, entry_text(channel, stated[0])),
        )
    if not names:
        return None
    name = stated[0] if stated else names[0]
    unit = _stated_unit(log, name, channel)
    factor = _factor(log, name, channel, unit)
    return LogColumn(channel, name, factor, is_angle=is_angle_for(channel.quantity, unit))


def _stated_unit(log: LogFile, name: str, channel: Channel) -> str | None:
    """Unit by suffix or beside the name; the two must agree."""
    suffix = split_unit(name)[1]
    beside = unit_name(log.unit_of(name))
    if suffix and beside and suffix != beside:
        raise InputError(
            f"column {name} is labelled {log.unit_of(name)!r}",
            log.where,
            "Correct the suffix or the label, or state the unit in a map (--map):"
            + in_map(channel, entry_text(channel, name)),
        )
    return suffix or beside


def _factor(log: LogFile, name: str, channel: Channel, unit: str | None) -> float:
    if unit is not None and unit in units_for(channel.quantity):
        return UNITS[unit][1]
    allowed = units_of(channel.unit)
    stem = channel.quantity if channel.quantity != "rpm" else "n"
    names = " or ".join(f"{stem}_{suffix}" for suffix in allowed)
    label = log.unit_of(name).strip()
    entry = in_map(channel, labelled_entry(channel, name, label))
    if unit is None and label:
        raise InputError(
            f"column {name} ({channel.meaning}) is labelled {label!r}, which is no known unit",
            log.where,
            "State its unit in a map (--map), and in place of the scale 0 what 1 "
            f"{label} is in that unit:{entry.removesuffix(SCALE_TOLD)}",
        )
    mapped = f"in a map (--map):{entry}"
    problem, remedy = "has no unit", f"Name it {names}, or state the unit {mapped}"
    if unit is not None:  # another name alone would have the numbers read in another unit
        problem = f"has the unit {unit}, which does not fit"
        remedy = f"Convert its values and name it {names}, or say how to {mapped}"
    raise InputError(f"column {name} ({channel.meaning}) {problem}", log.where, remedy)


def entry_text(channel: Channel, name: str, unit: str | None = None) -> str:
    """Line of a map for a column, e.g. ``rudder = { column = "x", unit = "deg" }``."""
    unit = unit or split_unit(name)[1]
    is_angle = quantity_named(split_unit(name)[0]) == channel.quantity
    usual = "deg" if is_angle else USUAL_UNIT[channel.unit]
    fits = unit if unit in units_for(channel.quantity) else usual
    is_share = name.strip().lower().rpartition("_")[2] in PERCENT
    is_other = is_share or unit not in (None, fits)
    scale = STAND_IN if channel.kind == "input" and is_other else ""
    if channel.unit == "1/min" and unit == "radps":
        scale = f", scale = {RPM_OF_RADPS:.7g}"
    return f'{channel.quantity} = {{ column = "{quoted(name)}", unit = "{fits}"{scale} }}'


def in_map(channel: Channel, *lines: str) -> str:
    """Lines of a map as a message offers them, ready to paste, below the header of their table."""
    shown = "".join(f"\n    {line}" for line in (f"[{channel.sensor}]", *lines))
    return shown + (SCALE_TOLD if any(STAND_IN in line for line in lines) else "")


def labelled_entry(channel: Channel, name: str, label: str) -> str:
    """As `entry_text`, of a column with a label beside it: with a scale where that is no unit."""
    unit = unit_name(label)
    entry = entry_text(channel, name, split_unit(name)[1] or unit)
    if not label or unit is not None or ", scale = " in entry:
        return entry
    return f"{entry.removesuffix(' }')}{STAND_IN} }}"


def guess_column(channel: Channel, names: Sequence[str]) -> str | None:
    """The column that most probably holds a channel under another name, or None."""
    bases = {name: split_unit(name)[0] for name in names}
    for wanted in (channel.quantity, *ALIASES[channel.quantity]):
        for name, base in bases.items():
            if wanted in (base, name.strip().lower()):
                return name
    words = (channel.quantity, *ALIASES[channel.quantity])
    for wanted in (word for word in words if len(word) >= LEAST_LETTERS):
        for name, base in bases.items():
            if wanted == _without_instrument(base):
                return name
    known = [a for a in (channel.quantity, *ALIASES[channel.quantity]) if len(a) > 3]
    taken = {a for q, aliases in ALIASES.items() for a in (q, *aliases) if q != channel.quantity}
    for name, base in bases.items():
        if (
            len(base) > 3
            and base not in taken
            and difflib.get_close_matches(base, known, n=1, cutoff=0.8)
        ):
            return name
    return None


def _without_instrument(base: str) -> str:
    """Name of a column without the instrument before it: ``imu yaw rate`` is ``yaw_rate``."""
    words = [word for word in re.split(r"[\W_]+", base) if word]
    while len(words) > 1 and words[0] in INSTRUMENTS:
        del words[0]
    return "_".join(words)


def missing_channels(
    channels: Sequence[Channel],
    where: str,
    columns: Mapping[str, Sequence[str]],
    labels: Mapping[str, str],
) -> InputError:
    """Error for needed channels that no file has, with what was found and a map entry for each.

    Parameters
    ----------
    channels : sequence of Channel
        What is missing.
    where : str
        File or folder that was searched.
    columns : mapping of str to sequence of str
        Columns found, by file name.
    labels : mapping of str to str
        What stands beside the names of columns.
    """
    found = "; ".join(f"{file}: {listed(names)}" for file, names in columns.items())
    names = (f"{' or '.join(_log_names(c))} ({c.meaning}) for {c.sensor}" for c in channels)
    sensors = dict.fromkeys(c.sensor for c in channels)
    tables = [[c for c in channels if c.sensor == sensor] for sensor in sensors]
    entries = [_likely_entries(of_one, columns, labels) for of_one in tables]
    plural = "s" if len(channels) > 1 else ""
    return InputError(
        f"no column {', none '.join(names)}; found {found or 'nothing'}",
        where,
        f"Name the column{plural} in a map (--map; `auvident inspect` proposes one):"
        + "".join(entries)
        + _without(channels),
        lacks=channels[0].column,
    )


def _likely_entries(
    channels: Sequence[Channel], columns: Mapping[str, Sequence[str]], labels: Mapping[str, str]
) -> str:
    """Table of a map for the missing channels of a sensor, with the likely file and columns."""
    likely = {f: [_likely_column(c, names) for c in channels] for f, names in columns.items()}
    file = next((f for f, found in likely.items() if any(found)), "")
    names = [name or "your_column" for name in likely.get(file, [None] * len(channels))]
    pairs = zip(channels, names, strict=True)
    lines = [labelled_entry(c, name, labels.get(name, "")) for c, name in pairs]
    return in_map(channels[0], *([f'file = "{quoted(file)}"'] if file else []), *lines)


def _likely_column(channel: Channel, names: Sequence[str]) -> str | None:
    """A column to name in a message: under another name, or with that of the channel within."""
    found = guess_column(channel, names)
    if found is not None or len(channel.quantity) < LEAST_LETTERS:
        return found
    return next((n for n in names if channel.quantity in re.split(r"[\W_]+", n.lower())), None)


def _without(channels: Sequence[Channel]) -> str:
    """What a map can say of channels that were not logged."""
    derived = [c.quantity for c in channels if c.quantity in Derive.model_fields]
    told = ""
    if derived:
        told += (
            f"\n  Where nothing measured {', '.join(derived)} but position and heading are "
            "logged:\n    [derive]" + "".join(f"\n    {quantity} = true" for quantity in derived)
        )
    if any(c.quantity == "rpm" for c in channels):
        told += "\n  Where rpm was not logged but held, instead:"
        told += "\n    [rpm]\n    rpm = { constant = 600 }"
    return told


def missing_topic(channel: Channel, where: str, topics: Sequence[str]) -> InputError:
    """Error for a needed channel that no topic of a container has under its own name."""
    names = " or ".join(_log_names(channel))
    return InputError(
        f"no topic has {names} ({channel.meaning}) for {channel.sensor}; found {listed(topics)}",
        where,
        "Run `auvident inspect` on it, which proposes a map:"
        + in_map(channel, 'topic = "..."', entry_text(channel, "...")),
        lacks=channel.column,
    )


def listed(names: Sequence[str]) -> str:
    """Names in a row, the first few where there are many."""
    return ", ".join(names[:MOST_LISTED]) + (", ..." if len(names) > MOST_LISTED else "")


def _log_names(channel: Channel) -> tuple[str, ...]:
    if channel.quantity == "rpm":
        return ("rpm",)
    names = tuple(f"{channel.quantity}_{unit}" for unit in units_of(channel.unit))
    return names[:2]


def _missing(log: LogFile, what: str, wanted: str) -> InputError:
    close = difflib.get_close_matches(wanted, log.names, n=1)
    hint = f'Did you mean "{close[0]}"?' if close else "Correct the map."
    return InputError(f"{what} is missing; found {listed(log.names)}", log.where, hint)
