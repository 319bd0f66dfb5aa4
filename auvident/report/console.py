"""Tables of every stage for people; the command line prints them on standard error."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import RenderableType
from rich.text import Text

from auvident.report import check_words, console_loop, tables_model
from auvident.report import tables_run as tables
from auvident.report.ase_tables import ase_report
from auvident.report.console_combined import combined_brief, combined_pieces
from auvident.report.console_style import findings_lines, rich_table
from auvident.report.held_out_words import beyond, doubts_of, why_held_out
from auvident.report.numbers import TERMINAL
from auvident.report.tables import Column, Fixed, Number, Rows, Table, columns
from auvident.report.trial_words import set_aside
from auvident.schema.artifacts import (
    ESTIMATE_CONTRADICTED,
    IdentifiedModel,
    Maneuver,
    Metrics,
    TrialPlan,
)
from auvident.schema.logs import Quality, TrialQuality
from auvident.schema.places import by_plane

if TYPE_CHECKING:
    import pandas as pd

    from auvident.schema.diagnosis import Comparison

number = TERMINAL.number
STATE_STYLES = {"done": "green", "stale": "yellow", "missing": "red", "not needed": "dim"}
ROLES = {
    "identify": "Prediction of the maneuvers used for identification",
    "validate": "Prediction of the held-out maneuvers",
}
HORIZONS = "Prediction of the held-out maneuvers, restarted from the readings at these intervals"
LEADS = (ESTIMATE_CONTRADICTED,)  # findings on a model that are told before its coefficients
MOST_SENSOR_TABLES = 3  # trials; more of them are shown with one row each


def stage_report(
    stage: str, outputs: Mapping[str, Any], brief: bool = False
) -> list[RenderableType]:
    """What a person sees of the outputs of a stage.

    Parameters
    ----------
    stage : str
    outputs : mapping
        Artifacts by path in the run directory.
    brief : bool
        One stage among several: without what a later table repeats.
    """
    report = BRIEF_REPORTS.get(stage) if brief else None
    report = report or REPORTS.get(stage)
    if report is None:
        return []
    first, *others = by_plane(outputs)
    pieces = report(first[1])
    for plane, own in others:
        pieces += [plane_heading(plane), *report(own)]
    return pieces


def plane_heading(plane: str) -> RenderableType:
    """Begins what is shown of a plane beside the first one."""
    return Text(f"{plane.capitalize()} plane", style="bold underline")


def discoveries(planes: "Sequence[tuple[str, Comparison | None]]") -> list[RenderableType]:
    """What the models lacked, by plane; the first one has no name and no heading."""
    pieces: list[RenderableType] = []
    for plane, comparison in planes:
        if comparison is not None:
            pieces += [plane_heading(plane)] if plane else []
            pieces += console_loop.discovery(comparison)
    return pieces


def frame_table(title: str, frame: "pd.DataFrame") -> RenderableType:
    """A small table of numbers."""
    rows = [
        [Number(v, 4) if isinstance(v, float) else str(v) for v in row]
        for row in frame.itertuples(index=False)
    ]
    return rich_table(Table(columns(numbers=[str(c) for c in frame.columns]), rows, title))


def _ingest(outputs: Mapping[str, Any]) -> list[RenderableType]:
    quality: Quality = outputs["ingest/quality.json"]
    pieces = [*checks_first(quality), *(Text(line) for line in set_aside(quality))]
    if len(quality.trials) > 1:
        pieces.append(rich_table(tables.trials(quality.trials)))
    if len(quality.trials) <= MOST_SENSOR_TABLES:
        pieces += [_sensors(trial) for trial in quality.trials]
    told = {c.message for t in quality.trials for c in t.checks_made if c.outcome == "contradicts"}
    findings = [f for t in quality.trials for f in t.findings if f.message not in told]
    others = [f for f in quality.findings if f.code != "log_refused"]  # told above
    return [*pieces, *findings_lines([*findings, *others])]


def model_first(model: IdentifiedModel) -> list[RenderableType]:
    """That the model hardly is one of this vehicle, before its coefficients."""
    return [
        Text(f"{f.message[:1].upper()}{f.message[1:]}", style="bold red")
        for f in model.findings
        if f.code in LEADS
    ]


def checks_first(quality: Quality) -> list[RenderableType]:
    """What contradicts in the logs, and what nothing in them tests: before anything else."""
    lines: list[RenderableType] = [
        Text(line, style="bold red") for line in check_words.contradictions(quality.trials)
    ]
    left = check_words.untested(quality.trials)
    return [*lines, *([Text(left, style="dim")] if left else [])]


def _sensors(trial: TrialQuality) -> RenderableType:
    title = (
        f"{trial.trial}: {trial.samples} rows at {trial.rate_hz:g} Hz, gap-free records: "
        f"{len(trial.records)}"
    )
    return rich_table(tables.sensors((trial,), title))


def _segment(outputs: Mapping[str, Any]) -> list[RenderableType]:
    maneuvers: Sequence[Maneuver] = outputs["segment/maneuvers.json"]
    beside = outputs["segment/rejected.json"]
    table = rich_table(tables.maneuvers(maneuvers, "Maneuvers"))
    rejected = len(beside["rejected"])
    note = f"{rejected} candidate maneuvers rejected; the reasons are in segment/rejected.json"
    why: list[RenderableType] = [Text(line) for line in why_held_out(maneuvers)]
    if len({m.trial for m in maneuvers}) > 1:
        why = [rich_table(tables.maneuvers_by_trial(maneuvers)), *why]
    return [table, *why, Text(note, style="dim"), *findings_lines(beside["findings"])]


def _ase(outputs: Mapping[str, Any]) -> list[RenderableType]:
    return [ase_report(outputs["ase/coefficients.json"])]


def _identify(outputs: Mapping[str, Any]) -> list[RenderableType]:
    model: IdentifiedModel = outputs["identify/model.json"]
    first, rest = model_first(model), [f for f in model.findings if f.code not in LEADS]
    pieces = [rich_table(tables_model.sight(model)), rich_table(tables_model.coefficients(model))]
    return [*first, *pieces, *findings_lines(rest)]


def _validate(outputs: Mapping[str, Any]) -> list[RenderableType]:
    metrics: Metrics = outputs["validate/metrics.json"]
    pieces: list[RenderableType] = []
    for role, title in ROLES.items():
        if role in metrics.summary:
            before = metrics.ase.summary.get(role, {}) if metrics.ase else {}
            crossed = metrics.cross_validation if role == "validate" else {}
            prior = "ASE" if metrics.estimated else "prior"
            own = metrics.summary[role]
            errors = tables.errors_by_channel(title, own, before, crossed, prior)
            pieces.append(rich_table(errors))
    if metrics.horizons:
        pieces.append(rich_table(tables.errors_by_horizon(metrics, HORIZONS)))
    if metrics.residuals:
        pieces.append(rich_table(tables.residuals(metrics, "Residual analysis")))
    lines = [Text(line, style="yellow") for line in beyond(metrics.extrapolation)]
    return [*pieces, *lines, *findings_lines(metrics.findings)]


def status_table(run: Path, rows: Sequence[Mapping[str, Any]]) -> RenderableType:
    """State of every stage."""
    cells = [
        [row["stage"], row["state"], row["reason"], row["failed"].problem if row["failed"] else ""]
        for row in rows
    ]
    heads = columns(("stage", "state", "reason", "last failure"))
    return rich_table(_without_empty(Table(heads, cells, f"Run directory {run}")), STATE_STYLES)


def _without_empty(table: Table) -> Table:
    """A table without its last column where that is empty."""
    if any(row[-1] for row in table.rows):
        return table
    return replace(table, columns=table.columns[:-1], rows=[row[:-1] for row in table.rows])


def comparison_tables(comparison: Mapping[str, Any]) -> list[RenderableType]:
    """Several runs side by side."""
    pieces: list[RenderableType] = [rich_table(t) for t in tables.runs_side_by_side(comparison)]
    pieces += [Text(line, style="yellow") for line in doubts_of(comparison)]
    for plane, beside in comparison.get("planes", {}).items():
        pieces += [plane_heading(plane), *comparison_tables(beside)]
    return pieces


def log_tables(report: Any) -> list[RenderableType]:
    """What is in a log: its files with their clocks and columns, and a proposed map."""
    pieces: list[RenderableType] = []
    for file in report.files:
        notes = [Text(note, style="yellow") for note in file.notes]
        pieces += [Text(_log_title(file), style="italic"), _log_columns(file), *notes]
    if report.unassigned:
        names = ", ".join(report.unassigned)
        pieces.append(Text(f"No column was found for: {names}", style="yellow"))
    return pieces


def _log_title(file: Any) -> str:
    clock = f"time in {file.time_column!r}" if file.time_column else "no time column"
    rate = f", {number(file.rate_hz, 4)} Hz" if file.rate_hz else ""
    span = "" if file.start_s is None else f", {file.start_s:.1f} to {file.end_s:.1f} s"
    gaps = f", {_gaps(file.gaps, file.longest_gap_s)}" if file.gaps else ""
    kind = f" ({file.kind})" if file.kind else ""
    return f"{file.file}{kind}: {file.rows} rows, {clock}{rate}{span}{gaps}"


def _gaps(count: int, longest_s: float) -> str:
    return (
        f"1 gap of {longest_s:.3g} s" if count == 1 else f"{count} gaps of up to {longest_s:.3g} s"
    )


def _log_columns(file: Any) -> RenderableType:
    heads = columns(("column", "read as", "unit"), ("minimum", "maximum", "empty"))
    rows: Rows = [
        [
            c.name,
            c.quantity or "",
            c.unit,
            Number(c.minimum, 4),
            Number(c.maximum, 4),
            str(c.empty),
            c.note,
        ]
        for c in file.columns
    ]
    return rich_table(_without_empty(Table((*heads, Column("note")), rows)))


def trial_plan_table(plan: TrialPlan) -> RenderableType:
    """Candidate maneuvers, best first."""
    title = f"{plan.vehicle}, {plan.plane} plane: what one more maneuver would add"
    heads = columns(("maneuver", "what to do"), ("length, s", "gain, nats"))
    rows: Rows = [
        [
            c.name,
            c.what,
            Fixed(c.duration_s, ".0f"),
            Fixed(c.gain_nats, ".2f"),
            ", ".join(f"{symbol} {number(f, 2)}" for symbol, f in c.shrinks.items()),
        ]
        for c in plan.candidates
    ]
    caption = "A gain of 1 nat shrinks the volume of the uncertainty of all coefficients to 37 %."
    return rich_table(Table((*heads, Column("std after ÷ before")), rows, title, caption))


REPORTS: dict[str, Callable[[Mapping[str, Any]], list[RenderableType]]] = {
    "ingest": _ingest,
    "segment": _segment,
    "ase": _ase,
    "identify": _identify,
    "validate": _validate,
    "diagnose": console_loop.diagnose,
    "refine": console_loop.refine,
    "combine": lambda outputs: combined_pieces(outputs["combine/model.json"]),
}
# Where a later table repeats most of it: the estimate comes again as the prior of the
# identification, the verdict at the end of the run.
BRIEF_REPORTS: dict[str, Callable[[Mapping[str, Any]], list[RenderableType]]] = {
    "ase": lambda outputs: findings_lines(outputs["ase/coefficients.json"].findings),
    "diagnose": console_loop.diagnose_brief,
    "refine": console_loop.refine_brief,
    "combine": lambda outputs: combined_brief(outputs["combine/model.json"]),
}
