"""Which files of a folder a proposed map is for, and how it names them."""

import re
from collections.abc import Collection, Mapping, Sequence
from fnmatch import fnmatchcase
from itertools import takewhile
from pathlib import Path

from auvident.errors import InputError
from auvident.schema.channels import NEEDED
from auvident.schema.logs import SensorMap
from auvident.storage.log_aside import sensors_of
from auvident.storage.log_columns import resolve, time_column
from auvident.storage.log_file import LogFile, stem
from auvident.storage.log_find import find_trials

Tables = Mapping[str, LogFile]  # by `LogFile.where`
PREFIX = re.compile(r".*[_\-. ]")  # of names such as run1_dvl.csv: all before the last part
SUFFIX = re.compile(r"[_\-. ][^_\-. ].*")  # of names such as dvl_001: all behind the first part
SIGNS = re.compile(r"[\[\]*?]")  # that mean something in a pattern


def trials_without_map(path: Path, logs: Tables) -> tuple[Tables, ...]:
    """Tables of each trial that is found at a path without a map; none where that is refused.

    Parameters
    ----------
    path : Path
        What the user gave.
    logs : mapping of str to LogFile
        The tables that matter; trials of others are left out.
    """
    try:
        sources = find_trials([path], None, [])
    except InputError:  # what reads the log says why
        return ()
    found = ({k: log for k, log in logs.items() if log.path in s.files} for s in sources)
    return tuple(tables for tables in found if tables)


def to_propose_for(logs: Tables, trials: Sequence[Tables]) -> Tables:
    """Of trials that each have all that is needed the first, which stands for all; else all."""
    return trials[0] if trials and all(map(_has_needed, trials)) else logs


def _has_needed(logs: Tables) -> bool:
    """Whether tables have every needed channel under its own name."""
    found: set[str] = set()
    for log in logs.values():
        for sensor in sensors_of(NEEDED):
            try:
                time_column(log, SensorMap())
                found |= resolve(log, sensor, SensorMap()).keys()
            except InputError:
                continue
    return set(NEEDED) <= found


def are_one_trial(homes: Collection[str], trials: Sequence[Tables]) -> bool:
    """Whether tables are read together without a map; of what is refused nobody can say."""
    return not trials or any(set(homes) <= tables.keys() for tables in trials)


def file_patterns(homes: Mapping[str, Collection[str]], logs: Tables) -> dict[str, str]:
    """Name of the file of each table as a map has it.

    Where several trials or parts of one lie in one folder, told apart by what their files begin
    or end with (``a1_dvl.csv``, ``a1_gyro.csv``, ``b2_dvl.csv``; ``dvl_001.csv``,
    ``gyro_001.csv``, ``dvl_002.csv``), it is a pattern that fits all.

    Parameters
    ----------
    homes : mapping of str to collection of str
        Tables that the map is to name, and their columns in it.
    logs : mapping of str to LogFile
        All tables of the folder.
    """
    names = {home: logs[home].path.name for home in homes}
    if len(set(names.values())) < 2:
        return names
    others = [log for log in logs.values() if log.path.name not in names.values()]
    for patterns in (_by_ending(names), _by_beginning(names, logs)):
        alike = [_has_alike(others, patterns[home], homes[home]) for home in patterns]
        if patterns and all(alike):
            return patterns
    return names


def _by_ending(names: Mapping[str, str]) -> dict[str, str]:
    """Patterns for what stands behind the beginning that all names have; none where there is none.

    ``a1_dvl.csv`` and ``a1_gyro.csv`` give ``*_dvl.csv`` and ``*_gyro.csv``.
    """
    begin = PREFIX.match(_common_beginning(names.values()))
    if begin is None:
        return {}
    rests = {home: name[begin.end() - 1 :] for home, name in names.items()}
    return {} if any(map(SIGNS.search, rests.values())) else {h: f"*{r}" for h, r in rests.items()}


def _by_beginning(names: Mapping[str, str], logs: Tables) -> dict[str, str]:
    """Patterns for what stands before the ending that all names have; none where there is none.

    ``dvl_001.csv`` and ``gyro_001.csv`` give ``dvl_*.csv`` and ``gyro_*.csv``.
    """
    stems = {home: stem(logs[home].path) for home in names}
    end = SUFFIX.search(_common_beginning([text[::-1] for text in stems.values()])[::-1])
    if end is None:
        return {}
    rests = {home: text[: len(text) - len(end[0]) + 1] for home, text in stems.items()}
    if any(map(SIGNS.search, names.values())):
        return {}
    return {home: f"{rest}*{names[home][len(stems[home]) :]}" for home, rest in rests.items()}


def _has_alike(others: Collection[LogFile], pattern: str, columns: Collection[str]) -> bool:
    """Whether there are other files that a pattern fits, and all of them have the columns."""
    found = [log for log in others if fnmatchcase(log.path.name, pattern)]
    return bool(found) and all(set(columns) <= set(log.names) for log in found)


def _common_beginning(names: Collection[str]) -> str:
    """The characters that all names begin with."""
    alike = takewhile(lambda letters: len(set(letters)) == 1, zip(*names, strict=False))
    return "".join(letters[0] for letters in alike)
