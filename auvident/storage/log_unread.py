"""Columns that seem to hold a channel which was not read, as their name is not the program's."""

from collections.abc import Collection, Iterable, Mapping

from auvident.schema.artifacts import Finding
from auvident.schema.channels import SENSORS, Channel
from auvident.storage.log_columns import LogColumn, guess_column, of_sensor, split_unit
from auvident.storage.log_file import LogFile
from auvident.storage.log_geographic import quantity_named
from auvident.storage.log_time_names import guess_time
from auvident.storage.log_valid import unread_flag
from auvident.storage.readers.quaternions import quaternions_in

LEAST_LETTERS = 3  # of a name that means something in a file that is not that of its sensor


def columns_told(
    tables: Iterable[LogFile],
    homes: Mapping[str, LogFile],
    columns: Mapping[str, Mapping[str, LogColumn]],
    given: Collection[str],
) -> tuple[Finding, ...]:
    """What is said of columns of text and Parquet that may be channels, and are not read.

    Parameters
    ----------
    tables : iterable of LogFile
        All of the trial.
    homes, columns : mapping
        Table and columns of each sensor that is read.
    given : collection of str
        Channels that a map states or derives.
    """
    plain = [log for log in tables if log.container is None]
    found: dict[str, list[str]] = {}
    for sensor in SENSORS:
        own = columns.get(sensor, {}) if sensor in homes else {}
        absent = [c for c in of_sensor(sensor) if c.column not in own and c.column not in given]
        if sensor == "position" and own:
            continue
        for log in [homes[sensor]] if sensor in homes else plain:
            names = _left(log, homes, columns)
            likely = [(c, _likely(c, log, names)) for c in absent]
            said = [f"{name} ({channel.meaning})" for channel, name in likely if name]
            flag = unread_flag(log.names) if sensor == "dvl" and sensor in homes else None
            said += [f"{flag} (which readings of the DVL are valid)"] if flag else []
            if sensor == "attitude" and sensor not in homes:
                said += _quaternions(names)
            found.setdefault(log.path.name, []).extend(said)
    return tuple(_told(file, names, plain[0]) for file, names in found.items() if names)


def _left(
    log: LogFile, homes: Mapping[str, LogFile], columns: Mapping[str, Mapping[str, LogColumn]]
) -> list[str]:
    """Columns of a table that no sensor has."""
    here = [sensor for sensor, home in homes.items() if home.where == log.where]
    taken = {column.name for sensor in here for column in columns[sensor].values()}
    return [name for name in log.names if name not in taken and name != guess_time(log)]


def _quaternions(names: list[str]) -> list[str]:
    """Attitudes as quaternions, which are read of containers alone."""
    known = {name.lower() for name in names}
    found = [*quaternions_in(names), *(q for q in ("q", "quat_", "q_") if _parts(q) <= known)]
    return [f"{name} (a quaternion: write roll_deg, pitch_deg, heading_deg)" for name in found]


def _parts(base: str) -> set[str]:
    return {f"{base}{axis}" for axis in "wxyz"}


def _likely(channel: Channel, log: LogFile, names: list[str]) -> str | None:
    """A column that is called like a channel; short names count in the file of its sensor."""
    if channel.sensor == "position":
        angles = [n for n in names if quantity_named(split_unit(n)[0]) == channel.quantity]
        if angles:
            return angles[0]
    name = guess_column(channel, names)
    is_own = log.stem.lower() == channel.sensor
    return name if name and (is_own or len(split_unit(name)[0]) >= LEAST_LETTERS) else None


def _told(file: str, names: list[str], log: LogFile) -> Finding:
    return Finding(
        code="columns_not_read",
        message=f"not read in {file}, though it may be meant, as name or unit are not the "
        f"program's: {', '.join(dict.fromkeys(names))}",
        where=str(log.path.parent),
        remedy="`auvident inspect` proposes a map (--map) that names it.",
    )
