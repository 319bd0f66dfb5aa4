"""Which topic of a container holds which sensor: by the names of topics and fields, and axes."""

import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from auvident.schema.channels import CHANNELS, SENSORS, Channel
from auvident.storage.log_columns import ALIASES, of_sensor, split_unit
from auvident.storage.log_file import LogFile
from auvident.storage.log_geographic import COLUMNS
from auvident.storage.log_proposal import Proposal, Values, unit_of
from auvident.storage.log_propose_angles import angle_proposals, find_angles
from auvident.storage.log_valid import is_flag_by_name
from auvident.storage.readers.interface import STAMP
from auvident.storage.readers.quaternions import ANGLES

GENERIC = ("value", "data", "val", "angle", "reading", "measurement")  # names that say nothing
SHORT = 2  # letters of an alias that means something only in a topic named after the sensor
# Names of fields besides those of columns.
FIELDS: dict[str, tuple[str, ...]] = {
    "u": ("linear_x", "vel_x", "velocity_x"),
    "v": ("linear_y", "vel_y", "velocity_y"),
    "w": ("linear_z", "vel_z", "velocity_z"),
    "p": ("angular_velocity_x", "angular_x", "gyrx", "gyro_rad_x"),
    "q": ("angular_velocity_y", "angular_y", "gyry", "gyro_rad_y"),
    "r": ("angular_velocity_z", "angular_z", "gyrz", "gyro_rad_z"),
    "rudder": ("rud", "rudder", "rudder_angle"),
    "elevator": ("elev", "elevator", "elevator_angle", "stern_planes"),
    "rpm": ("esc_rpm", "rpm1", "rpm_x"),
    "north": ("position_x", "point_x", "x", "n"),
    "east": ("position_y", "point_y", "y", "e"),
}
# Words in the name of a topic that tell its sensor.
WORDS: dict[str, tuple[str, ...]] = {
    "dvl": ("dvl", "bottom_track", "velocity_body"),
    "gyro": ("gyro", "imu", "angular_velocity"),
    "rudder": ("rudder", "fin", "rud"),
    "elevator": ("elevator", "fin", "stern", "strn", "elev"),
    "rpm": ("rpm", "thrust", "prop", "motor", "esc"),
    "attitude": ("attitude", "att", "ahrs", "orientation", "imu"),
    "depth": ("depth", "dpth", "pressure"),
    "position": ("position", "pose", "pos", "odom", "gps", "gnss", "fix", "usbl"),
}
# Parts of a name that say that a field is no measurement of its quantity.
OTHERS = frozenset(("covariance", "cov", "std", "variance", "bias", "error", "limit", "ref"))
WANTED = frozenset(("cmd", "command", "setpoint", "sp", "target", "desired", "reference"))
# Axes forward, port, up (REP 103 of ROS): channels that count the other way.
SWAPPED = {"x": "y", "y": "x"}
AGAINST_FLU = ("v_mps", "w_mps", "q_radps", "r_radps")
FLU_REMARK = "axes of REP 103, y to port and z up"
STAMPED = "stamp_ns"
PRINTED = "field."  # of each name in the text of `rostopic echo -p`
MOST_LATE_S = 60.0  # of a stamp by the sensor against that of the recording


def is_generic(name: str) -> bool:
    """Whether a column's name says nothing of what it holds."""
    return re.sub(r"\[\d+\]$", "", name.strip().lower()).rpartition(".")[2] in GENERIC


def is_printed(log: LogFile) -> bool:
    """Whether a text file holds the messages of a topic as ROS prints them."""
    return any(name.startswith(PRINTED) for name in log.names)


def as_topics(logs: Mapping[str, LogFile]) -> dict[str, LogFile]:
    """Files of printed messages as the topics that they hold, by the names of the files."""
    return {key: replace(log, topic=log.topic or log.stem) for key, log in logs.items()}


def assign_topics(logs: Mapping[str, LogFile], values: Values) -> list[Proposal]:
    """One table for each sensor: that with most of its channels, named after it, with most rows."""
    matches = {key: _matches(log, values[key]) for key, log in logs.items()}
    angles = {
        key: pair
        for key, log in logs.items()
        if not {*COLUMNS} <= {*matches[key]} and (pair := find_angles(log, values[key]))
    }
    for key, pair in angles.items():
        matches[key] |= dict(zip(COLUMNS, pair.names, strict=True))
    found: list[Proposal] = []
    for sensor in SENSORS:
        of_angles = angles if sensor == "position" else {}
        ranks = {
            key: _rank(sensor, log, matches[key], values[key], key in of_angles)
            for key, log in logs.items()
        }
        best = max(logs, key=lambda key: ranks[key])
        if not any(ranks[best][:2]):
            continue
        rivals = [
            logs[key].topic for key in logs if key != best and ranks[key][:5] == ranks[best][:5]
        ]
        if best in of_angles:
            found += angle_proposals(best, of_angles[best], _also_in(rivals))
        else:
            found += _proposals(sensor, best, logs[best], matches[best], values[best], rivals)
    return found


def _also_in(rivals: list[str]) -> str:
    return f"also in {', '.join(rivals)}" if rivals else ""


def _rank(
    sensor: str,
    log: LogFile,
    matches: Mapping[str, str],
    values: Mapping[str, np.ndarray],
    of_angles: bool,
) -> tuple[int, int, int, int, int, int]:
    """How much speaks for a table.

    Channels, needed and all, its name, that it is not of latitude and longitude, what changes,
    its rows.
    """
    channels = [c for c in of_sensor(sensor) if c.column in matches]
    needed = sum(c.needed for c in channels)
    words = _words(log.topic)
    named = any(word in words for word in WORDS[sensor])
    no_reading = channels and channels[0].kind == "measured" and WANTED & {*words.split("_")}
    rows = max((v.size for v in values.values()), default=0)
    moving = sum(_moves(values[matches[c.column]]) for c in channels)
    metric = int(moving > 0 and not of_angles)
    return (0,) * 6 if no_reading else (needed, len(channels), int(named), metric, moving, rows)


def _moves(values: np.ndarray) -> bool:
    known = values[np.isfinite(values)]
    return bool(known.size and known.min() < known.max())


@dataclass(frozen=True)
class _Match:
    column: str
    length: int
    changes: bool


def _matches(log: LogFile, values: Mapping[str, np.ndarray]) -> dict[str, str]:
    """Columns of a table by channel column: each column has the channel of its longest alias."""
    found: dict[str, _Match] = {}
    for name, numbers in values.items():
        channel, length = _channel_of(log, name)
        if channel is None or numbers.dtype == object or name == log.time:
            continue
        known = numbers[np.isfinite(numbers)]
        match = _Match(name, length, bool(known.size and np.ptp(known) > 0))
        before = found.get(channel.column)
        better = (match.changes, match.length)
        if known.size and (before is None or better > (before.changes, before.length)):
            found[channel.column] = match
    return {column: match.column for column, match in found.items()}


def _channel_of(log: LogFile, name: str) -> tuple[Channel | None, int]:
    forms = _forms(log, name)
    if OTHERS & {*forms[0].split("_")}:
        return None, 0
    words, best, length = _words(log.topic), None, 0
    for channel in CHANNELS:
        named = any(word in words for word in WORDS[channel.sensor])
        for alias in _aliases(channel, _axes(log)):
            if len(alias) <= SHORT and not named:
                continue
            if len(alias) > length and any(f == alias or f.endswith("_" + alias) for f in forms):
                best, length = channel, len(alias)
    return best, length


def _aliases(channel: Channel, axes: str) -> Iterable[str]:
    """Names of a channel; x is east and y north where the axes are those of ROS."""
    own = (channel.quantity, *ALIASES[channel.quantity], *FIELDS.get(channel.quantity, ()))
    if axes != "flu" or channel.sensor != "position":
        return own
    return tuple(re.sub("(^|_)([xy])$", lambda m: m[1] + SWAPPED[m[2]], alias) for alias in own)


def _forms(log: LogFile, name: str) -> tuple[str, ...]:
    """Spellings of a column: its words, with those of the topic where they say too little."""
    axis = re.sub(r"\[([012])\]", lambda m: "_" + "xyz"[int(m[1])], name)
    words = _words(axis)
    topic = _words(re.sub(r"\[\d+\]$", "", log.topic.rpartition("/")[2]))
    forms = [words, split_unit(words)[0]]
    if is_generic(name):
        forms.append(topic)
    if words.startswith("xyz_"):
        forms.append(f"{topic}_{words[4:]}")
    if len(words) == 1:
        forms.append(f"{topic}_{words}")
    return tuple(forms)


def _words(name: str) -> str:
    return re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")


def _axes(log: LogFile) -> str:
    if log.container is None:
        return "flu" if is_printed(log) else ""
    return log.container.tables[log.topic].axes


def _proposals(
    sensor: str,
    home: str,
    log: LogFile,
    matches: Mapping[str, str],
    values: Mapping[str, np.ndarray],
    rivals: list[str],
) -> list[Proposal]:
    found = []
    for channel in of_sensor(sensor):
        name = matches.get(channel.column)
        if name is None:
            continue
        against = _axes(log) == "flu" and channel.column in AGAINST_FLU
        unit, guessed = unit_of(channel, log, name, values[name])
        remarks = [FLU_REMARK] if against else []
        remarks += [_also_in(rivals)] if rivals else []
        found.append(
            Proposal(channel, home, name, unit, guessed, -1 if against else 1, "; ".join(remarks))
        )
    return found


def topic_lines(
    sensor: str, log: LogFile, values: Mapping[str, np.ndarray], proposals: list[Proposal]
) -> list[str]:
    """Lines of a map that name topic, clock and frame."""
    lines = [f"topic = {json.dumps(log.topic)}"]
    stamp = next((name for name in log.names if name.endswith(STAMPED) and name != STAMP), None)
    if stamp is not None and _is_clock(values.get(stamp), values.get(STAMP)):
        lines.append(f"time = {json.dumps(stamp)}")
    elif not log.time:
        lines.append('time = "?"  # no time column was recognised')
    lines += flag_lines(sensor, values)
    turned = any(p.name.endswith(ANGLES) and "." in p.name for p in proposals)
    if sensor == "attitude" and _axes(log) == "flu" and turned:
        lines.append('frame = "enu"  # axes of REP 103; "ned" if the driver has its own')
    return lines


def flag_lines(sensor: str, values: Mapping[str, np.ndarray]) -> list[str]:
    """The line that names the column in which a DVL marks its readings as valid, if there is one.

    A flag of another sensor is left alone: `valid` is read without a map, and others mean much.
    """
    named = [n for n in values if is_flag_by_name(n)] if sensor == "dvl" else []
    flag = next((n for n in named if _is_flag(values[n])), None)
    return [f"valid = {json.dumps(flag)}"] if flag else []


def _is_flag(values: np.ndarray) -> bool:
    """Whether a column holds both 0 and 1 or only 1, or empty cells beside."""
    if values.dtype == object:
        return False
    kinds = set(np.unique(values[np.isfinite(values)]))
    return kinds in ({0.0, 1.0}, {1.0})


def _is_clock(stamp: np.ndarray | None, recorded: np.ndarray | None) -> bool:
    """Whether the stamps of the sensor run with those of the recording."""
    if stamp is None or recorded is None or stamp.size != recorded.size or not stamp.size:
        return False
    return bool(np.all(np.abs(stamp - recorded) < MOST_LATE_S * 1e9))
