"""Files that are parts of one log, as ``dvl.csv`` and ``dvl (1).csv``, or copies of one."""

import filecmp
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from auvident.errors import InputError
from auvident.schema.artifacts import Finding
from auvident.schema.logs import FIRST_FEW, RawSensor
from auvident.storage.log_aside import Read
from auvident.storage.log_columns import LogColumn
from auvident.storage.log_file import LogFile, log_name

MOST_PAUSE_S = 3600.0  # between two parts; after a longer one it is another trial
Part = tuple[RawSensor, int]  # a sensor of one file, and the second from which its times count
Columns = Mapping[str, LogColumn]


def are_of_one_log(logs: Iterable[LogFile]) -> bool:
    """Whether files are told apart only by what stands behind their name."""
    logs = tuple(logs)
    return not any(log.topic for log in logs) and len({log_name(log.path) for log in logs}) == 1


def parts_of(home: LogFile, logs: Iterable[LogFile]) -> tuple[LogFile, ...]:
    """The other files of the log that a file is a part of."""
    others = (log for log in logs if log.path != home.path)
    return tuple(log for log in others if are_of_one_log((home, log)))


def with_parts(
    read: Read,
    homes: Mapping[str, LogFile],
    parts: Mapping[str, Sequence[LogFile]],
    columns_of: Callable[[str, LogFile], Columns],
    read_part: Callable[[str, LogFile], Part],
) -> tuple[Read, tuple[Finding, ...]]:
    """Join the parts of each sensor's log, where they follow each other in time.

    Parameters
    ----------
    read : tuple
        Sensors as read from their files, and the seconds from which their times count.
    homes : mapping of str to LogFile
        The file of each sensor.
    parts : mapping of str to sequence of LogFile
        Further files that may be parts of the same log.
    columns_of, read_part : callable
        The columns of a sensor in a file, and what it holds.

    Returns
    -------
    read : tuple
        The same with the parts.
    findings : tuple of Finding
        What was joined, and what was not.

    Raises
    ------
    InputError
        When parts overlap and none has the name of the log, or one cannot be read.
    """
    sensors, origins = dict(read[0]), dict(read[1])
    findings: list[Finding] = []
    joined: dict[str, None] = {}  # names of files, each once
    for sensor, files in parts.items():
        home = homes[sensor]
        others, told = _without_copies(home, files)
        expected = columns_of(sensor, home)
        alike = [part for part in others if columns_of(sensor, part) == expected]
        told += [_unlike(home, part) for part in others if part not in alike]
        found = [(sensors[sensor], origins[sensor]), *(read_part(sensor, p) for p in alike)]
        found = [part for part in found if part[0].time_s.size]
        fault = _why_not(sorted(found, key=_start))
        if fault and log_name(home.path) != home.stem.lower():
            raise _not_joined(home, alike, fault, sensor)
        if fault:
            told.append(_told(home, alike, fault, sensor))
        elif len(found) > 1:
            sensors[sensor], origins[sensor] = _joined(sorted(found, key=_start))
            joined[_names(home, alike)] = None
        findings += told
    findings += _said(homes, joined)
    unique = {finding.model_dump_json(): finding for finding in findings}
    return (sensors, origins), tuple(unique.values())


def _without_copies(
    home: LogFile, others: Sequence[LogFile]
) -> tuple[list[LogFile], list[Finding]]:
    """The files that differ from each other, and what is said of the others."""
    kept, told = [home], []
    for log in others:
        same = [k for k in kept if filecmp.cmp(k.path, log.path, shallow=False)]
        if not same:
            kept.append(log)
            continue
        told.append(
            Finding(
                code="file_not_used",
                message=f"{log.path.name} is a copy of {same[0].path.name}, and is not read",
                where=str(log.path.parent),
            )
        )
    return kept[1:], told


def _start(part: Part) -> float:
    return part[1] + float(np.min(part[0].time_s))


def _end(part: Part) -> float:
    return part[1] + float(np.max(part[0].time_s))


def _why_not(found: Sequence[Part]) -> str:
    """Why parts, in the order of their starts, are not one log; "" where they are."""
    for one, other in pairwise(found):
        if _start(other) < _end(one):
            return (
                f"overlap in time ({_start(one):.1f} to {_end(one):.1f} s, "
                f"{_start(other):.1f} to {_end(other):.1f} s)"
            )
        if _start(other) - _end(one) > MOST_PAUSE_S:
            return f"are {(_start(other) - _end(one)) / 3600.0:.1f} hours apart"
    return ""


def _joined(found: Sequence[Part]) -> Part:
    """One sensor of all parts, which follow each other."""
    sensors = [sensor for sensor, _ in found]
    first, origin = found[0]
    times = [sensor.time_s + (own - origin) for sensor, own in found]
    counts: dict[str, int] = {}
    rows: dict[str, tuple[int, ...]] = {}
    for sensor in sensors:
        counts |= {why: counts.get(why, 0) + n for why, n in sensor.dropped.items()}
        rows |= {
            why: (*rows.get(why, ()), *n)[:FIRST_FEW] for why, n in sensor.dropped_rows.items()
        }
    return replace(
        first,
        file=" + ".join((first.file, *(Path(s.file).name for s in sensors[1:]))),
        time_s=np.concatenate(times),
        values={key: np.concatenate([s.values[key] for s in sensors]) for key in first.values},
        rows=np.concatenate([s.rows for s in sensors]),
        rows_read=sum(s.rows_read for s in sensors),
        dropped=counts,
        dropped_rows=rows,
        remarks=tuple(remark for s in sensors for remark in s.remarks),
    ), origin


def _names(home: LogFile, others: Iterable[LogFile]) -> str:
    return ", ".join(log.path.name for log in (home, *others))


def _said(homes: Mapping[str, LogFile], joined: Iterable[str]) -> list[Finding]:
    names = "; ".join(joined)
    if not names:
        return []
    return [
        Finding(
            code="files_joined",
            message=f"parts that follow each other in time were read as one log: {names}",
            where=str(next(iter(homes.values())).path.parent),
            remedy="If they are of two trials, keep only those of one in this folder.",
        )
    ]


def _told(home: LogFile, others: Sequence[LogFile], fault: str, sensor: str) -> Finding:
    error = _not_joined(home, others, fault, sensor)
    return Finding(
        code="files_not_joined",
        message=f"{error.problem}; {home.path.name} alone was read",
        where=error.where,
        remedy=error.remedy,
    )


def _not_joined(home: LogFile, others: Sequence[LogFile], fault: str, sensor: str) -> InputError:
    return InputError(
        f"{_names(home, others)} {fault}, so they were not joined to one log",
        str(home.path.parent),
        f'Choose one in a map (--map), [{sensor}] file = "{home.path.name}", or keep only one of '
        "them in this folder; parts of one log need one clock that goes on from file to file.",
    )


def _unlike(home: LogFile, part: LogFile) -> Finding:
    return Finding(
        code="files_not_joined",
        message=f"{part.path.name} has other columns than {home.path.name}, and is not read",
        where=str(part.path.parent),
        remedy="If it is a part of the same log, give it the same columns; else remove it.",
    )
