"""What a person sees of the residual loop: what can be seen at all, the ranking, the verdict."""

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import RenderableType
from rich.text import Text

from auvident.report import loop_words as words
from auvident.report import tables_loop as tables
from auvident.report.console_style import findings_lines, rich_table
from auvident.schema.diagnosis import Candidate, Comparison, Diagnosis

VERDICT_STYLES = {
    "none_found": "bold green",
    "effect_found": "bold cyan",
    "ambiguous": "bold yellow",
    "partly_explained": "bold cyan",
    "unexplained": "bold yellow",
}
CANNOT_TELL = "These data cannot tell apart"
MOST_CANDIDATES = 8  # rows of the ranking; the artifact has all of them
SIGHT_STYLES = dict.fromkeys((tables.NOT_SHOWN, tables.ALIKE, tables.NOT_TESTED), "yellow")


def diagnose(outputs: Mapping[str, Any]) -> list[RenderableType]:
    """First what can be seen at all, then the residual and the ranking; last the verdict."""
    found: Diagnosis = outputs["diagnose/diagnosis.json"]
    pieces: list[RenderableType] = [sight(found)]
    if found.residuals:
        pieces.append(rich_table(tables.residuals(found)))
    if found.candidates:
        pieces.append(ranking(found.candidates))
    pieces += effect_lines(found)
    return [*pieces, *findings_lines(found.findings), statement(found)]


def diagnose_brief(outputs: Mapping[str, Any]) -> list[RenderableType]:
    """What can be seen at all, and the verdict; `refine` has the rest."""
    found: Diagnosis = outputs["diagnose/diagnosis.json"]
    return [sight(found), *findings_lines(found.findings)]


def refine(outputs: Mapping[str, Any]) -> list[RenderableType]:
    """The effects with intervals, held-out errors, coefficients that moved."""
    found: Comparison = outputs["refine/comparison.json"]
    pieces, moved = changes(found), tables.moved(found.coefficients)
    if moved.rows:
        pieces.append(rich_table(moved))
    return [*pieces, *findings_lines(found.findings), statement(found)]


def refine_brief(outputs: Mapping[str, Any]) -> list[RenderableType]:
    """Findings alone: the discovery ends the run."""
    return findings_lines(outputs["refine/comparison.json"].findings)


def discovery(found: Comparison) -> list[RenderableType]:
    """What adding the effects changed, and last what the model lacked, in plain words."""
    return [*changes(found), statement(found)]


def changes(found: Comparison) -> list[RenderableType]:
    """The effects, what they changed, and what is left."""
    pieces: list[RenderableType] = []
    if found.added:
        pieces.append(rich_table(tables.effects((*found.effects, *found.not_confirmed))))
    pieces += [*_ambiguous_lines(found), *_unexplained_lines(found)]
    if words.force(found):
        pieces.append(Text(words.force(found), style="yellow"))
    if found.added and found.held_out.before:
        pieces.append(rich_table(tables.held_out(found.held_out)))
    if found.added and found.cross_validation.before:
        pieces.append(rich_table(tables.cross_validated(found.cross_validation)))
    return pieces


def statement(found: Diagnosis | Comparison) -> Text:
    """The verdict in one sentence."""
    text = Text("Verdict: ", style="bold")
    return text.append(found.statement, style=VERDICT_STYLES[found.verdict])


def sight(found: Diagnosis) -> RenderableType:
    """What the maneuvers can and cannot show, before any verdict."""
    return rich_table(tables.sight(found), SIGHT_STYLES)


def ranking(candidates: Sequence[Candidate]) -> RenderableType:
    """The best candidates, with why the others were turned down."""
    rows, more = words.ranked(candidates), len(candidates) - MOST_CANDIDATES
    caption = f"{more} more in diagnose/diagnosis.json" if more > 0 else ""
    return rich_table(tables.candidates(rows[:MOST_CANDIDATES], caption))


def effect_lines(found: Diagnosis) -> list[RenderableType]:
    """The effects, and what cannot be told apart or explained."""
    pieces: list[RenderableType] = []
    if found.to_try:
        pieces.append(rich_table(tables.effects(found.to_try)))
    pieces += _ambiguous_lines(found)
    if found.separate_by and found.separate_by not in found.statement:
        pieces.append(
            Text(f"These maneuvers would tell them apart: {found.separate_by}", style="yellow")
        )
    return pieces + _unexplained_lines(found)


def _ambiguous_lines(found: Diagnosis | Comparison) -> list[RenderableType]:
    return [
        Text(f"{CANNOT_TELL} {' and '.join(group)}", style="yellow")
        for group in found.ambiguous
        if not found.statement.startswith(CANNOT_TELL)  # the verdict says it
    ]


def _unexplained_lines(found: Diagnosis | Comparison) -> list[RenderableType]:
    lines = words.unexplained_lines(found.unexplained)
    return [Text(f"Unexplained: {line}", style="yellow") for line in lines]
