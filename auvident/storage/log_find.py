"""Which files make up which trial: folders, wide files, sensor files, files named by a map."""

import difflib
import re
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

from auvident.errors import InputError
from auvident.schema.channels import SENSORS
from auvident.schema.logs import ColumnMap
from auvident.storage.declared import fitting
from auvident.storage.log_columns import resolve, time_column
from auvident.storage.log_file import (
    OTHER_SUFFIXES,
    LogFile,
    is_container,
    log_name,
    looks_like_log,
    open_logs,
    stem,
)
from auvident.storage.log_own import (
    MAX_DEPTH,
    folders_in,
    holds_runs_alone,
    logs_in,
    not_own,
    refuse_only_own,
    refuse_own,
)
from auvident.storage.regular import refuse_irregular

LAYOUT_REMEDY = (
    "A log is a folder with one file per sensor (dvl.csv, gyro.csv, rudder.csv, rpm.csv), "
    "or one file with all columns; other names need a map (--map), "
    "which `auvident inspect` proposes."
)


@dataclass(frozen=True)
class TrialSource:
    """Files of one trial.

    Attributes
    ----------
    name : str
        Name of the trial.
    place : Path
        Folder or file, for messages.
    files : tuple of Path
        Files to search for columns.
    assigned : dict of str to Path
        File of a sensor as the map's pattern says.
    among_others : bool
        Whether it is one of several in a folder, where the others do without it.
    aside : tuple of Path
        Recordings of another logger beside them, which are not read.
    """

    name: str
    place: Path
    files: tuple[Path, ...]
    assigned: dict[str, Path] = field(default_factory=dict)
    among_others: bool = False
    aside: tuple[Path, ...] = ()


class Fault(NamedTuple):
    """Why what stands at a path is no trial."""

    path: Path
    error: InputError


def find_trials(
    paths: Sequence[Path],
    column_map: ColumnMap | None = None,
    faults: list[Fault] | None = None,
) -> list[TrialSource]:
    """Trials behind the paths that the user gave.

    Parameters
    ----------
    paths : sequence of Path
        Trial folders, wide files, folders of either, or all the sensor files of a folder.
    column_map : ColumnMap, optional
        The user's map.
    faults : list of Fault, optional
        Takes what is wrong with one of several trials in a folder; without it that is raised.

    Raises
    ------
    InputError
        When a path does not exist, holds no log, or two trials have one name.
    """
    column_map = column_map or ColumnMap()
    found: list[TrialSource] = []
    by_folder: dict[Path, list[Path]] = {}
    for path in dict.fromkeys(Path(p) for p in paths):
        if not path.exists():
            raise _no_such(path)
        refuse_irregular(path)
        refuse_own(path)
        if path.is_dir():
            found += _folder_or_refuse(path, column_map, faults)
        elif _is_sensor_file(path, column_map):
            by_folder.setdefault(path.parent, []).append(path)
        else:
            found.append(_single(path, column_map))
    found += [_loose(folder, files, column_map) for folder, files in by_folder.items()]
    return _distinct(found)


def _no_such(path: Path) -> InputError:
    there = [p.name for p in path.parent.iterdir()] if path.parent.is_dir() else []
    close = difflib.get_close_matches(path.name, there, n=max(len(there), 1))
    meant = next((p for p in map(path.parent.joinpath, close) if not holds_runs_alone(p)), None)
    hint = f"Did you mean {meant}?" if meant else "Check the path."
    return InputError("no such file or folder", str(path), hint)


def _is_sensor_file(path: Path, column_map: ColumnMap) -> bool:
    return stem(path).lower() in SENSORS and not any(_patterns(column_map))


def _patterns(column_map: ColumnMap) -> dict[str, str]:
    patterns = {sensor: column_map.of(sensor).file for sensor in SENSORS}
    return {sensor: pattern for sensor, pattern in patterns.items() if pattern}


def _loose(folder: Path, files: Sequence[Path], column_map: ColumnMap) -> TrialSource:
    """Sensor files named one by one: one trial, unless a lone file has all the columns."""
    if len(files) == 1:
        return _single(files[0], column_map)
    return TrialSource(folder.resolve().name, folder, tuple(files))


def _single(path: Path, column_map: ColumnMap) -> TrialSource:
    for sensor, pattern in _patterns(column_map).items():
        if not path.match(pattern):
            raise InputError(
                f"the map looks for [{sensor}] in {pattern!r}",
                str(path),
                "Give the folder of the trial instead of one file, or correct the map.",
            )
    return TrialSource(stem(path), path, (path,))


def _folder_or_refuse(
    path: Path, column_map: ColumnMap, faults: list[Fault] | None
) -> list[TrialSource]:
    own: list[Fault] | None = None if faults is None else []
    found = _folder(path, column_map, 0, own)
    if found and faults is not None and own is not None:
        faults += own
        return [replace(s, among_others=len(found) + len(own) > 1) for s in found]
    if found:
        return found
    if own:
        raise none_usable(own)
    inside = sorted(p.name + ("/" if p.is_dir() else "") for p in path.iterdir())
    wanted = sorted(set(_patterns(column_map).values()))
    problem = "contains no log"
    refuse_only_own(path)
    if any(looks_like_log(p) for p in path.iterdir()):
        problem = "contains no file that is named after a sensor or has a time column"
    if wanted:
        problem = f"contains no file that matches {', '.join(wanted)} and has the mapped columns"
    listing = ", ".join(inside[:12]) + (", ..." if len(inside) > 12 else "")
    raise InputError(f"{problem}; found {listing or 'nothing'}", str(path), layout_remedy(path))


def layout_remedy(folder: Path) -> str:
    """What to do about a folder without a log: text files with other endings are not looked at."""
    texts = sorted(p.name for p in folder.iterdir() if p.name.lower().endswith(OTHER_SUFFIXES))
    if not texts:
        return LAYOUT_REMEDY
    return (
        f"If {texts[0]} is a table, give it the ending .csv, as all of its folder. " + LAYOUT_REMEDY
    )


def none_usable(faults: Sequence[Fault]) -> InputError:
    """One error for several trials, with the reason of each."""
    if len(faults) == 1:
        return faults[0].error
    reasons = "".join(f"\n  {fault.error}" for fault in faults)
    return InputError(f"none of {len(faults)} trials can be used:{reasons}")


def _tried(
    of: Path, call: Callable[[], list[TrialSource]], faults: list[Fault] | None
) -> list[TrialSource]:
    """What a call finds; nothing where it fails and its fault is taken note of."""
    try:
        return call()
    except InputError as error:
        if faults is None:
            raise
        faults.append(Fault(of, error))
        return []


def _folder(
    path: Path, column_map: ColumnMap, depth: int, faults: list[Fault] | None
) -> list[TrialSource]:
    """Trials in a folder; when it is itself none, also those in the folders below."""
    logs = logs_in(path)
    name = path.resolve().name
    if _patterns(column_map):
        matched = _by_patterns(path, logs, column_map)
        if matched:
            return matched
        logs = ()
    logs, aside = _set_apart(logs, column_map)
    if any(stem(log).lower() in SENSORS for log in logs):
        _refuse_twins(path, logs)
        return [TrialSource(name, path, logs, aside=aside)]
    found = []
    for log in logs:
        found += _tried(log, partial(_wide, log, len(logs) == 1, column_map, aside), faults)
    wide = [source.files[0] for source in found]
    if len(wide) > 1 and _is_split(wide, column_map):
        return [TrialSource(name, path, tuple(wide), aside=aside)]
    if depth < MAX_DEPTH:
        for below in folders_in(path):
            found += _tried(below, partial(_folder, below, column_map, depth + 1, faults), faults)
    return found


def _wide(
    log: Path, alone: bool, column_map: ColumnMap, aside: tuple[Path, ...]
) -> list[TrialSource]:
    """A file of a folder as a trial, unless it is no recording."""
    is_trial = alone or _has_time(log, column_map)
    return [TrialSource(stem(log), log, (log,), aside=aside)] if is_trial else []


def _set_apart(
    logs: tuple[Path, ...], column_map: ColumnMap
) -> tuple[tuple[Path, ...], tuple[Path, ...]]:
    """Logs of a folder, and recordings that are left aside, as the tables were made from them."""
    tables = tuple(log for log in logs if not is_container(log))
    with_topics = any(column_map.of(sensor).topic is not None for sensor in SENSORS)
    if with_topics or not 0 < len(tables) < len(logs):
        return logs, ()
    if not any(stem(t).lower() in SENSORS or _has_time(t, column_map) for t in tables):
        return logs, ()
    return tables, tuple(log for log in logs if log not in tables)


def _refuse_twins(path: Path, logs: Iterable[Path]) -> None:
    count = Counter(stem(log).lower() for log in logs)
    twins = [name for name in SENSORS if count[name] > 1]
    if twins:
        files = ", ".join(log.name for log in logs if stem(log).lower() == twins[0])
        raise InputError(f"two files of one sensor: {files}", str(path), "Keep one of them.")


def _has_time(log: Path, column_map: ColumnMap) -> bool:
    """Whether a file of a folder is a recording; tables such as hull offsets are none."""
    opened = open_logs(log, _time_names(column_map))
    if opened[0].topic:
        return any(table.time for table in opened)
    try:
        return bool(time_column(opened[0], column_map.of("dvl")))
    except InputError:
        return bool(_sensors_in(opened, column_map))


def _is_split(logs: Sequence[Path], column_map: ColumnMap) -> bool:
    """Whether no file alone has dvl, gyro and rudder, but together they have them once each.

    Parts of one log (``dvl_part1.csv``, ``dvl_part2.csv``) count once.
    """
    core = ("dvl", "gyro", "rudder")
    names = _time_names(column_map)
    have = [(log_name(p), _sensors_in(open_logs(p, names), column_map)) for p in logs]
    if any(all(sensor in h for sensor in core) for _, h in have):
        return False
    return all(len({name for name, h in have if sensor in h}) == 1 for sensor in core)


def _time_names(column_map: ColumnMap) -> set[str]:
    return {t for t in (column_map.of(sensor).time for sensor in SENSORS) if t}


def _sensors_in(logs: Iterable[LogFile], column_map: ColumnMap) -> set[str]:
    """Sensors with a readable column in a file."""
    return {s for s in SENSORS if any(has_sensor(log, s, column_map) for log in logs)}


def has_sensor(log: LogFile, sensor: str, column_map: ColumnMap) -> bool:
    """Whether a table has the time column and a column of a sensor; faults count as no."""
    mapping = column_map.of(sensor)
    if mapping.topic is not None and mapping.topic != log.topic:
        return False
    try:
        return bool(resolve(log, sensor, mapping)) and bool(time_column(log, mapping))
    except InputError:
        return False


def _by_patterns(path: Path, logs: Sequence[Path], column_map: ColumnMap) -> list[TrialSource]:
    """Trials of a folder by the map's file patterns.

    A pattern that matches one file (or one with the mapped columns) names it; patterns that
    match several make one trial for each text that the wildcards stand for.
    """
    matches = {s: _matching(path, s, p, column_map) for s, p in _patterns(column_map).items()}
    if not any(matches.values()):
        return []
    if all(len(found) <= 1 for found in matches.values()):
        assigned = {s: found[0] for s, found in matches.items() if found}
        files = tuple(dict.fromkeys((*assigned.values(), *logs)))
        name = path.resolve().name
        if len(logs) == 1 and len(set(assigned.values())) == 1:
            name = stem(files[0])
        return [TrialSource(name, path, files, assigned)]
    groups: dict[str, dict[str, Path]] = {}
    for sensor, found in matches.items():
        for file in found:
            key = _wildcard_text(file.relative_to(path), column_map.of(sensor).file or "")
            groups.setdefault(key, {})[sensor] = file
    return [_group(path, key, assigned) for key, assigned in sorted(groups.items())]


def _group(path: Path, key: str, assigned: dict[str, Path]) -> TrialSource:
    files = tuple(dict.fromkeys(assigned.values()))
    name = stem(files[0]) if len(files) == 1 else key.strip("._- /").replace("/", "_")
    place = files[0] if len(files) == 1 else path
    return TrialSource(name or path.resolve().name, place, files, assigned)


def _matching(path: Path, sensor: str, pattern: str, column_map: ColumnMap) -> list[Path]:
    """Files that a pattern names; of several, those that have the sensor's columns."""
    fit = fitting(pattern, path, f"{path}: [{sensor}] file", '"*.csv"')
    files = [p for p in fit if p.is_file() and not p.name.startswith(".")]
    found = not_own(path, files)
    if len(found) <= 1:
        return found
    logs = [p for p in found if looks_like_log(p)] or found
    names = _time_names(column_map)
    return [
        p
        for p in logs
        if any(has_sensor(table, sensor, column_map) for table in open_logs(p, names))
    ]


def _wildcard_text(relative: Path, pattern: str) -> str:
    """Text that the wildcards of a pattern stand for in a file's name."""
    signs = {"*": "([^/]*)", "?": "([^/])", "**": "(.*)"}
    parts = re.split(r"(\*\*|\*|\?)", pattern)
    expression = "".join(signs.get(part) or re.escape(part) for part in parts)
    found = re.fullmatch(expression, relative.as_posix())
    return "_".join(found.groups()) if found else relative.as_posix()


def _distinct(found: list[TrialSource]) -> list[TrialSource]:
    """Refuse two trials of one name; a lone file of a folder may take the folder's name.

    Trials of one name in the folders of a folder (``day1/run``, ``day2/run``) get both names.
    """
    count = Counter(source.name for source in found)
    named = [
        replace(s, name=_folder_name(s)) if count[s.name] > 1 and _is_alone(s) else s for s in found
    ]
    count = Counter(source.name for source in named)
    named = [
        replace(s, name=f"{s.place.resolve().parent.name}_{s.name}")
        if count[s.name] > 1 and s.among_others
        else s
        for s in named
    ]
    count = Counter(source.name for source in named)
    for source in named:
        if count[source.name] > 1 and not source.among_others:
            places = " and ".join(str(s.place) for s in named if s.name == source.name)
            raise InputError(
                f"two trials are named {source.name!r}",
                places,
                "Rename one of the files or folders: a trial is named after it.",
            )
    return named


def _is_alone(source: TrialSource) -> bool:
    folder = source.files[0].parent
    return len(source.files) == 1 and len(logs_in(folder)) == 1


def _folder_name(source: TrialSource) -> str:
    return source.files[0].resolve().parent.name
