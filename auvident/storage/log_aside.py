"""Files of a trial that cannot be read: one that is not needed is set aside, and said so."""

from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol, TypeVar

from auvident.errors import InputError
from auvident.schema.artifacts import Finding
from auvident.schema.channels import BY_COLUMN, SENSORS
from auvident.schema.logs import RawSensor
from auvident.storage.log_file import stem
from auvident.storage.log_find import TrialSource
from auvident.storage.log_text import OR_WITHOUT

Read = tuple[dict[str, RawSensor], dict[str, int]]
Faults = dict[Path, InputError]
Opened = TypeVar("Opened")


class OfFile(Protocol):
    """A table of a log, of which only its file matters here."""

    @property
    def path(self) -> Path:
        """The file."""


Table = TypeVar("Table", bound=OfFile)


def sensors_of(columns: Collection[str]) -> frozenset[str]:
    """Sensors that deliver some channels."""
    return frozenset(BY_COLUMN[column].sensor for column in columns)


def open_usable(
    source: TrialSource, needed: Collection[str], open_one: Callable[[Path], Opened]
) -> tuple[dict[Path, Opened], Faults]:
    """Open the files of a trial.

    Parameters
    ----------
    source : TrialSource
        The trial.
    needed : collection of str
        Channel columns without which it is refused.
    open_one : callable
        Opens one file.

    Returns
    -------
    opened : dict of Path
        Those that can be opened.
    faults : dict of Path to InputError
        Those that cannot, and are not known to be needed.

    Raises
    ------
    InputError
        When the file of a needed sensor, or the only one, cannot be opened.
    """
    needed_sensors = sensors_of(needed)
    named = {source.assigned[s] for s in needed_sensors if s in source.assigned}
    opened: dict[Path, Opened] = {}
    faults: Faults = {}
    for path in source.files:
        try:
            opened[path] = open_one(path)
        except InputError as error:
            if path in named or stem(path).lower() in needed_sensors:
                raise _of_needed(error) from error
            if len(source.files) == 1:
                raise
            faults[path] = error
    if not opened:
        raise next(iter(faults.values()))
    return opened, faults


def _of_needed(error: InputError) -> InputError:
    """The fault of a file that a trial cannot do without: leaving it out is no way out."""
    remedy = error.remedy
    if remedy == OR_WITHOUT:
        remedy = "Export it again; a trial needs this sensor."
    return InputError(error.problem, error.where, remedy)


@contextmanager
def blamed(faults: Faults) -> Iterator[None]:
    """Where something is missing, a file that may have had it and cannot be read is the reason."""
    try:
        yield
    except InputError as error:
        unknown = [f for path, f in faults.items() if stem(path).lower() not in SENSORS]
        raise unknown[0] if unknown else error from error


def read_usable(
    homes: Mapping[str, Table],
    needed: Collection[str],
    read: Callable[[dict[str, Table]], Read],
    faults: Faults,
) -> Read:
    """Read the sensors of each file; a file of nothing that is needed may fail.

    Parameters
    ----------
    homes : mapping of str
        Table of each sensor.
    needed : collection of str
        Channel columns without which the trial is refused.
    read : callable
        Reads some of the sensors.
    faults : dict
        Takes the files that cannot be read.
    """
    found: dict[str, RawSensor] = {}
    origins: dict[str, int] = {}
    for path in dict.fromkeys(table.path for table in homes.values()):
        here = {sensor: table for sensor, table in homes.items() if table.path == path}
        try:
            sensors, own_origins = read(here)
        except InputError as error:
            if sensors_of(needed) & set(here):
                raise
            faults[path] = error
            continue
        found |= sensors
        origins |= own_origins
    return {sensor: found[sensor] for sensor in SENSORS if sensor in found}, origins


def set_aside(faults: Faults) -> tuple[Finding, ...]:
    """What the user should know of files that were not used."""
    return tuple(
        Finding(
            code="file_set_aside",
            message=f"{path.name} was not used: {error.problem}",
            where=error.where or str(path),
            remedy=error.remedy or "Repair the file, or remove it.",
        )
        for path, error in faults.items()
    )
