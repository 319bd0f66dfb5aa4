"""Tables of every stage for people; the command line prints them on standard error."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from auvident.report import console_loop
from auvident.report import tables_run as tables
from auvident.report.ase_tables import ase_report
from auvident.report.console_style import findings_lines, house_table, rich_table
from auvident.report.numbers import TERMINAL
from auvident.schema.artifacts import (
    IdentifiedModel,
    Maneuver,
    Metrics,
    TrialPlan,
)
from auvident.schema.effect_words import allowances
from auvident.schema.logs import Quality, TrialQuality

if TYPE_CHECKING:
    import pandas as pd

number = TERMINAL.number
STATE_STYLES = {"done": "green", "stale": "yellow", "missing": "red"}
ROLES = {
    "identify": "Prediction of the maneuvers that identified",
    "validate": "Prediction of the held-out maneuvers",
}
# share of a coefficient's certainty that came from the data: from, name
SIGHT = ((0.8, "well seen"), (0.3, "partly seen"), (-1.0, "left to the prior"))
MOST_SHARES = 5  # coefficients named of a combination
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
    return report(outputs) if report else []


def frame_table(title: str, frame: "pd.DataFrame") -> Table:
    """A small table of numbers."""
    table = house_table(title, (), [str(c) for c in frame.columns])
    for row in frame.itertuples(index=False):
        table.add_row(*(number(v, 4) if isinstance(v, float) else str(v) for v in row))
    return table


def _ingest(outputs: Mapping[str, Any]) -> list[RenderableType]:
    quality: Quality = outputs["ingest/quality.json"]
    pieces: list[RenderableType] = []
    if len(quality.trials) > MOST_SENSOR_TABLES:
        pieces.append(rich_table(tables.trials(quality.trials)))
    else:
        pieces += [_sensors(trial) for trial in quality.trials]
    findings = [f for trial in quality.trials for f in trial.findings]
    return [*pieces, *findings_lines([*findings, *quality.findings])]


def _sensors(trial: TrialQuality) -> Table:
    title = (
        f"{trial.trial}: {trial.samples} rows at {trial.rate_hz:g} Hz, uninterrupted records: "
        f"{len(trial.records)}"
    )
    return rich_table(tables.sensors((trial,), title))


def _segment(outputs: Mapping[str, Any]) -> list[RenderableType]:
    maneuvers: Sequence[Maneuver] = outputs["segment/maneuvers.json"]
    beside = outputs["segment/rejected.json"]
    table = rich_table(tables.maneuvers(maneuvers, "Maneuvers"))
    note = f"{len(beside['rejected'])} candidates rejected: segment/rejected.json says why"
    return [table, Text(note, style="dim"), *findings_lines(beside["findings"])]


def _ase(outputs: Mapping[str, Any]) -> list[RenderableType]:
    return [ase_report(outputs["ase/coefficients.json"])]


def _identify(outputs: Mapping[str, Any]) -> list[RenderableType]:
    model: IdentifiedModel = outputs["identify/model.json"]
    return [sight_table(model), model_table(model), *findings_lines(model.findings)]


def _validate(outputs: Mapping[str, Any]) -> list[RenderableType]:
    metrics: Metrics = outputs["validate/metrics.json"]
    pieces: list[RenderableType] = []
    for role, title in ROLES.items():
        if role in metrics.summary:
            before = metrics.ase.summary.get(role, {}) if metrics.ase else {}
            errors = tables.errors_by_channel(title, metrics.summary[role], before)
            pieces.append(rich_table(errors))
    return [*pieces, *findings_lines(metrics.findings)]


def sight_table(model: IdentifiedModel) -> Table:
    """What the maneuvers can and cannot see, before any value is shown."""
    table = house_table("What these maneuvers can and cannot see", ("", ""))
    least = 1.1
    for below, name in SIGHT:
        seen = [
            c.symbol
            for c in model.coefficients
            if c.origin in ("identified", "kinematic") and below <= c.data_share < least
        ]
        least = below
        table.add_row(name, ", ".join(seen) or "-")
    for combination in model.unidentifiable:
        name = "no data can see" if combination.structural else "not shown here"
        table.add_row(name, tables.combination(combination, TERMINAL, MOST_SHARES))
    table.caption = "auvident plan-trial RUN ranks the maneuvers that would show more"
    table.caption_justify = "left"
    return table


def model_table(model: IdentifiedModel) -> Table:
    """Coefficients before and after the data."""
    title = f"{model.vehicle}, {model.plane} plane ({model.filter}, {model.engine})"
    columns = ("value", "std", "prior", "prior std", "1000 x prime", "from data")
    table = house_table(title, ("", "unit"), columns)
    table.add_column("origin")
    for c in model.coefficients:
        table.add_row(
            c.symbol,
            c.unit,
            number(c.value, 4),
            number(c.std, 2),
            number(c.prior, 4),
            number(c.prior_std, 2),
            number(1e3 * c.prime, 4),
            f"{100.0 * c.data_share:.0f} %",
            c.origin,
        )
    table.caption, table.caption_justify = allowances(model.effects) or None, "left"
    return table


def status_table(run: Path, rows: Sequence[Mapping[str, Any]]) -> Table:
    """State of every stage."""
    table = house_table(f"Run directory {run}", ("stage", "state", "why", "last failure"))
    for row in rows:
        style = STATE_STYLES[row["state"]]
        failed = row["failed"].problem if row["failed"] else ""
        table.add_row(row["stage"], Text(row["state"], style=style), row["reason"], failed)
    return table


def comparison_tables(comparison: Mapping[str, Any]) -> list[RenderableType]:
    """Several runs side by side."""
    pieces: list[RenderableType] = [rich_table(t) for t in tables.runs_side_by_side(comparison)]
    sets = {tuple(run["held_out"]) for run in comparison["runs"]}
    note = "The runs hold out different maneuvers: their errors are not of the same thing."
    return [*pieces, Text(note, style="yellow")] if len(sets) > 1 else pieces


def log_tables(report: Any) -> list[RenderableType]:
    """What is in a log: its files with their clocks and columns, and a proposed map."""
    pieces: list[RenderableType] = []
    for file in report.files:
        clock = f"time in {file.time_column!r}" if file.time_column else "no time column"
        rate = f", {number(file.rate_hz, 4)} Hz" if file.rate_hz else ""
        span = "" if file.start_s is None else f", {file.start_s:.1f} to {file.end_s:.1f} s"
        gaps = f", {file.gaps} gaps up to {file.longest_gap_s:.3g} s" if file.gaps else ""
        title = f"{file.file}: {file.rows} rows, {clock}{rate}{span}{gaps}"
        table = house_table("", ("column", "taken for", "unit"), ("least", "most", "empty"))
        table.add_column("note")
        for c in file.columns:
            table.add_row(
                c.name,
                c.quantity or "",
                c.unit,
                number(c.minimum, 4),
                number(c.maximum, 4),
                str(c.empty),
                c.note,
            )
        notes = [Text(note, style="yellow") for note in file.notes]
        pieces += [Text(title, style="italic"), table, *notes]
    if report.unassigned:
        names = ", ".join(report.unassigned)
        pieces.append(Text(f"No column was found for: {names}", style="yellow"))
    return pieces


def trial_plan_table(plan: TrialPlan) -> Table:
    """Candidate maneuvers, best first."""
    title = f"{plan.vehicle}, {plan.plane} plane: what another maneuver would add"
    table = house_table(title, ("maneuver", "what to do"), ("length, s", "gain, nats"))
    table.add_column("standard deviations shrink by the factor")
    for c in plan.candidates:
        shrinks = ", ".join(f"{symbol} {number(f, 2)}" for symbol, f in c.shrinks.items())
        table.add_row(c.name, c.what, f"{c.duration_s:.0f}", f"{c.gain_nats:.2f}", shrinks)
    return table


REPORTS: dict[str, Callable[[Mapping[str, Any]], list[RenderableType]]] = {
    "ingest": _ingest,
    "segment": _segment,
    "ase": _ase,
    "identify": _identify,
    "validate": _validate,
    "diagnose": console_loop.diagnose,
    "refine": console_loop.refine,
}
# Where a later table repeats most of it: the estimate comes again as the prior of the
# identification, the verdict at the end of the run.
BRIEF_REPORTS: dict[str, Callable[[Mapping[str, Any]], list[RenderableType]]] = {
    "ase": lambda outputs: findings_lines(outputs["ase/coefficients.json"].findings),
    "diagnose": console_loop.diagnose_brief,
    "refine": console_loop.refine_brief,
}
