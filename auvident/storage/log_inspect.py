"""What is in a log, and a map that would read it: the data behind ``auvident inspect``."""

from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field

from auvident.errors import InputError
from auvident.schema.base import Artifact
from auvident.schema.logs import SensorMap
from auvident.schema.quoting import encodable
from auvident.storage.log_columns import angle_of, quantity_of
from auvident.storage.log_file import LogFile, open_logs, read_log
from auvident.storage.log_find import layout_remedy
from auvident.storage.log_own import MAX_DEPTH, folders_in, logs_in, refuse_only_own, refuse_own
from auvident.storage.log_propose import propose_map
from auvident.storage.log_propose_files import trials_without_map
from auvident.storage.log_time import as_floats
from auvident.storage.log_time_names import guess_time, refuse_time_label, time_unit
from auvident.storage.log_time_parts import read_parts
from auvident.storage.regular import refuse_irregular

Text = Annotated[str, AfterValidator(encodable)]  # of a damaged file, to be written as JSON
LEAST_PERIOD_S = 1e-9  # between rows; less is no clock
GAP_PERIODS = 5.0  # an interval of so many periods is shown as a gap


class ColumnReport(Artifact):
    """A column: what it was taken for, its range and its empty cells."""

    name: Text
    unit: Text = ""
    quantity: str | None = None
    minimum: float | None = None
    maximum: float | None = None
    empty: int = 0
    distinct: int = 0
    note: str = ""


class FileReport(Artifact):
    """A file, or a topic of it and the type of its messages: its clock and its columns.

    `fault` and `remedy` say why nothing of a file can be read.
    """

    file: Text
    kind: Text = ""
    rows: int = 0
    time_column: Text | None = None
    start_s: float | None = None
    end_s: float | None = None
    rate_hz: float | None = None
    gaps: int = 0
    longest_gap_s: float | None = None
    backward: int = 0
    repeated: int = 0
    columns: tuple[ColumnReport, ...] = ()
    notes: tuple[Text, ...] = ()
    fault: Text = ""
    remedy: Text = ""


class LogReport(Artifact):
    """Everything ``auvident inspect`` shows.

    `proposed_map` is the text of a ``MAP.toml``; "" when none is needed, or none would help.
    `unassigned` names needed channels for which no column was found.
    """

    schema_: str = Field(default="auvident/inspect/1", alias="schema")
    path: Text
    files: tuple[FileReport, ...]
    proposed_map: Text = ""
    unassigned: tuple[str, ...] = ()


def inspect_log(path: Path) -> LogReport:
    """Look at a log without judging it.

    Parameters
    ----------
    path : Path
        A file, a trial folder or a folder of them.

    Raises
    ------
    InputError
        When there is nothing at the path that could be a log.
    """
    path = Path(path)
    files = _files(path)
    opened: dict[str, LogFile] = {}
    values: dict[str, dict[str, np.ndarray]] = {}
    reports = []
    for file in files:
        try:
            tables = open_logs(file)
        except InputError as error:
            notes = tuple(text for text in (error.problem, error.remedy) if text)
            reports.append(
                FileReport(
                    file=str(file), notes=notes, fault=error.problem, remedy=error.remedy or ""
                )
            )
            continue
        for log in tables:
            opened[log.where] = log
            values[log.where], report = _inspect_file(log)
            reports.append(report)
    first = files[0].parent
    together = {key: log for key, log in opened.items() if log.path.parent == first}
    trials = trials_without_map(path, together)
    text, unassigned = propose_map(together, values, trials)
    return LogReport(path=str(path), files=tuple(reports), proposed_map=text, unassigned=unassigned)


def _files(path: Path) -> list[Path]:
    if not path.exists():
        raise InputError("no such file or folder", str(path), "Check the path.")
    refuse_irregular(path)
    if path.is_file():
        return [path]
    refuse_own(path)
    found: list[Path] = []
    level = [path]
    for _ in range(MAX_DEPTH):
        found += [p for folder in level for p in logs_in(folder)]
        level = [p for folder in level for p in folders_in(folder)]
    if not found:
        refuse_only_own(path)
        raise InputError("contains no CSV or Parquet file", str(path), layout_remedy(path))
    return found


def _inspect_file(log: LogFile) -> tuple[dict[str, np.ndarray], FileReport]:
    values, rows, notes = _read_all(log)
    notes = [*_notes_of(log), *notes]
    numbers = {name: as_floats(column) for name, column in values.items()}
    time_name = guess_time(log)
    clock: dict[str, float | int | None] = {}
    if time_name is not None and time_name in values:
        try:
            refuse_time_label(log, time_name, SensorMap())
            unit = time_unit(log, time_name, SensorMap())
            stamps = read_parts(values, time_name, unit, log.where, np.arange(1, rows + 1))
            clock = _clock(stamps.time_s + stamps.origin_s)
        except InputError as error:
            notes.append(error.problem)
    columns = tuple(_column(log, name, numbers.get(name)) for name in log.names if name)
    report = FileReport.model_validate(
        {
            "file": log.where,
            "kind": log.container.tables[log.topic].kind if log.container else "",
            "rows": rows,
            "time_column": time_name,
            "columns": columns,
            "notes": tuple(notes),
            **clock,
        }
    )
    return numbers, report


def _notes_of(log: LogFile) -> tuple[str, ...]:
    """What the reader of a container says of a table, and of the file with its first table."""
    if log.container is None:
        return ()
    is_first = log.topic == next(iter(log.container.tables))
    return (*(log.container.notes if is_first else ()), *log.container.tables[log.topic].notes)


def _counted(count: int, reason: str) -> str:
    """Rows that were left out, with the reason."""
    return f"{count} row{'s' * (count != 1)} left out: {reason.replace('_', ' ')}"


def _read_all(log: LogFile) -> tuple[dict[str, np.ndarray], int, list[str]]:
    """All columns; where one is faulty, those that can be read, and the faults."""
    names = [name for name in dict.fromkeys(log.names) if name and log.names.count(name) == 1]
    try:
        table = read_log(log, dict.fromkeys(names))
        notes = [_counted(count, reason) for reason, count in table.dropped.items()]
        return table.columns, table.rows.size, notes
    except InputError as error:
        notes = [str(error).split("\n")[0]]
    readable = [name for name in names if _is_readable(log, name)]
    if not readable:
        return {}, 0, notes
    try:  # once more, together: a line that is empty but for other columns counts in each
        table = read_log(log, dict.fromkeys(readable))
    except InputError:
        return {}, 0, notes
    return table.columns, table.rows.size, notes


def _is_readable(log: LogFile, name: str) -> bool:
    try:
        read_log(log, {name: None})
    except InputError:
        return False
    return True


def _clock(time: np.ndarray) -> dict[str, float | int | None]:
    known = time[np.isfinite(time)]
    if not known.size:
        return {}
    steps = np.diff(known)
    ahead = steps[(steps > 0) & np.isfinite(steps)]  # damaged stamps may be too far apart for one
    period = float(np.median(ahead)) if ahead.size else 0.0
    return {
        "start_s": float(known.min()),
        "end_s": float(known.max()),
        "rate_hz": 1.0 / period if period > LEAST_PERIOD_S else None,
        "gaps": int(np.sum(ahead > GAP_PERIODS * period)),
        "longest_gap_s": float(ahead.max()) if ahead.size else None,
        "backward": int(np.sum(steps < 0)),
        "repeated": int(np.sum(steps == 0)),
    }


def _column(log: LogFile, name: str, values: np.ndarray | None) -> ColumnReport:
    unit = log.unit_of(name)
    if values is None:
        return ColumnReport(name=name, unit=unit, note="cannot be read as numbers or time")
    if values.dtype == object:
        empty = sum(not str(v).strip() or v is None for v in values)
        return ColumnReport(
            name=name, unit=unit, empty=empty, distinct=len(set(map(str, values))), note="text"
        )
    known = values[np.isfinite(values)]
    return ColumnReport(
        name=name,
        unit=unit,
        quantity=quantity_of(name) or angle_of(name, unit),
        minimum=float(known.min()) if known.size else None,
        maximum=float(known.max()) if known.size else None,
        empty=int(values.size - known.size),
        distinct=int(np.unique(known).size),
    )
