"""Tables of what a run was made from, when and how."""

from collections.abc import Sequence
from datetime import datetime
from pathlib import PurePath
from typing import Any

from auvident.report.tables import Cell, Fixed, Number, Rows, Table, columns
from auvident.schema.artifacts import Rejected
from auvident.schema.logs import Quality
from auvident.schema.manifest import Manifest, StageEntry

HASH_DIGITS = 12


def lags(quality: Quality) -> Table:
    """Delays between the sensors' clocks."""
    rows: Rows = [
        [
            t.trial,
            f"{a.second} behind {a.first}",
            Fixed(1000.0 * a.lag_s, ".0f"),
            Fixed(1000.0 * a.std_s, ".1f"),
            Fixed(100.0 * a.explained, ".0f", " %"),
        ]
        for t in quality.trials
        for a in t.alignment
    ]
    heads = columns(("trial", "sensors"), ("lag, ms", "± std, ms", "variance explained"))
    return Table(heads, rows)


def rejected(found: Sequence[Rejected]) -> Table:
    """Pieces of a trial that are no maneuver, and why."""
    rows: Rows = [
        [
            r.trial,
            r.reason,
            Fixed(r.t_start_s, ".1f"),
            Fixed(r.t_end_s, ".1f"),
            Number(r.value),
            Number(r.threshold),
        ]
        for r in found
    ]
    return Table(columns(("trial", "reason"), ("from, s", "to, s", "value", "limit")), rows)


def stages(manifest: Manifest) -> Table:
    """Stages of the run: when, with which options and seed."""
    rows = [_stage(name, entry) for name, entry in manifest.stages.items()]
    heads = ("stage", "outcome", "options", "started, UTC", "s", "seed", "version")
    return Table(columns(heads[:3], heads[3:]), rows)


def _stage(name: str, entry: StageEntry) -> list[Cell]:
    options = ", ".join(
        f"{k} = {_option(v)}" for k, v in entry.options.items() if v not in (None, (), [])
    )
    return [
        name,
        entry.outcome.replace("_", " "),
        options,
        entry.started_at[:19].replace("T", " "),
        _seconds(entry),
        Number(None) if entry.seed is None else str(entry.seed),
        entry.program_version,
    ]


def _option(value: Any) -> str:
    """An option, paths by their last part: the report may travel."""
    if isinstance(value, list | tuple):
        return ", ".join(_option(v) for v in value)
    return PurePath(value).name if isinstance(value, str) and "/" in value else str(value)


def _seconds(entry: StageEntry) -> Number:
    try:
        ended, started = (datetime.fromisoformat(t) for t in (entry.ended_at, entry.started_at))
    except ValueError:
        return Number(None)
    return Number((ended - started).total_seconds(), 2)


def files(manifest: Manifest) -> Table:
    """The files the run rests on, with the start of their sha256."""
    found: dict[str, str] = {}
    made = {name for entry in manifest.stages.values() for name in entry.outputs}
    for entry in manifest.stages.values():
        found |= {name: sha for name, sha in entry.inputs.items() if name not in made}
        found |= entry.program_files
    rows = [["/".join(PurePath(n).parts[-2:]), s[:HASH_DIGITS]] for n, s in found.items()]
    return Table(columns(("file", "sha256 begins with")), rows)
