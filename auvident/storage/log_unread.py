"""Columns that seem to hold a channel which was not read, as their name is not the program's."""

from collections.abc import Collection, Iterable, Mapping

from auvident.schema.artifacts import Finding
from auvident.schema.channels import SENSORS, Channel
from auvident.storage.log_columns import LogColumn, guess_column, of_sensor, split_unit
from auvident.storage.log_file import LogFile
from auvident.storage.log_geographic import quantity_named
from auvident.storage.log_time_names import guess_time

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
            taken = {
                c.name
                for s, home in homes.items()
                if home.where == log.where
                for c in columns[s].values()
            }
            names = [n for n in log.names if n not in taken and n != guess_time(log)]
            for channel in absent:
                name = _likely(channel, log, names)
                if name is not None:
                    found.setdefault(log.path.name, []).append(f"{name} ({channel.meaning})")
    return tuple(_told(file, names, plain[0]) for file, names in found.items())


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
