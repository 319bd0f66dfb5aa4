"""What a person sees of the residual loop: what can be seen at all, the ranking, the verdict."""

from collections.abc import Mapping, Sequence
from typing import Any

from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from auvident.report import loop_words as words
from auvident.report.console_style import findings_lines, house_table
from auvident.report.numbers import TERMINAL
from auvident.schema.diagnosis import (
    Candidate,
    Comparison,
    Diagnosis,
    Difference,
    EffectFound,
    HeldOut,
)

number = TERMINAL.number
VERDICT_STYLES = {
    "none_found": "bold green", "effect_found": "bold cyan", "ambiguous": "bold yellow",
    "partly_explained": "bold cyan", "unexplained": "bold yellow",
}  # fmt: skip
MOST_CANDIDATES = 8  # rows of the ranking; the artifact has all of them
MOST_LOOKALIKES = 6


def diagnose(outputs: Mapping[str, Any]) -> list[RenderableType]:
    """First what can be seen at all, then the residual, the ranking and the verdict."""
    found: Diagnosis = outputs["diagnose/diagnosis.json"]
    pieces: list[RenderableType] = [sight(found)]
    if found.residuals:
        pieces.append(residual_table(found))
    if found.candidates:
        pieces.append(ranking_table(found.candidates))
    pieces += verdict_lines(found)
    return [*pieces, *findings_lines(found.findings)]


def diagnose_brief(outputs: Mapping[str, Any]) -> list[RenderableType]:
    """What can be seen at all, and the verdict; `refine` has the rest."""
    found: Diagnosis = outputs["diagnose/diagnosis.json"]
    return [sight(found), *findings_lines(found.findings)]


def refine(outputs: Mapping[str, Any]) -> list[RenderableType]:
    """The effects with intervals, held-out errors, coefficients that moved."""
    found: Comparison = outputs["refine/comparison.json"]
    moved = words.moved(found.coefficients)
    pieces = discovery(found)
    if moved:
        pieces.append(moved_table(found))
    return [*pieces, *findings_lines(found.findings)]


def refine_brief(outputs: Mapping[str, Any]) -> list[RenderableType]:
    """Findings alone: the discovery ends the run."""
    return findings_lines(outputs["refine/comparison.json"].findings)


def discovery(found: Comparison) -> list[RenderableType]:
    """What the model lacked, in plain words, and what adding it changed."""
    pieces: list[RenderableType] = [statement(found)]
    if found.added:
        pieces.append(effects_table((*found.effects, *found.not_confirmed)))
    pieces += [*_ambiguous_lines(found), *_unexplained_lines(found)]
    if found.added and found.held_out.before:
        pieces.append(held_out_table(found.held_out))
    return pieces


def statement(found: Diagnosis | Comparison) -> Text:
    """The verdict in one sentence."""
    text = Text("Verdict: ", style="bold")
    return text.append(found.statement, style=VERDICT_STYLES[found.verdict])


def sight(found: Diagnosis) -> Table:
    """What the maneuvers can and cannot show, before any verdict."""
    table = house_table("What these maneuvers can and cannot see of an effect", ("", ""))
    for family, names in words.visible_by_family(found.sees).items():
        table.add_row(family, ", ".join(names))
    for why, names in words.blind_by_reason(found.sees).items():
        table.add_row(Text("not seen", style="yellow"), f"{', '.join(names)}: {why}")
    for same in found.lookalikes[:MOST_LOOKALIKES]:
        remedy = f"; {same.separate_by}" if same.separate_by else ""
        row = f"{', '.join(same.ids)} (cosine {same.cosine:.3f}){remedy}"
        table.add_row(Text("look alike", style="yellow"), row)
    for missing in found.missing:
        table.add_row(Text("not tested", style="yellow"), missing)
    return table


def residual_table(found: Diagnosis) -> Table:
    """Residual of each channel against the noise of its sensor."""
    heads = ("residual, rms", "sensor noise", "ratio", "with the effects", "correlated over, s")
    table = house_table("What the model does not explain", ("channel", "unit"), heads)
    for row in words.pooled(found.residuals):
        table.add_row(
            row.channel, row.unit, number(row.rms, 3), number(row.noise_std, 3),
            number(row.ratio, 3), number(row.rms_after, 3), number(row.correlation_time_s, 2),
        )  # fmt: skip
    return table


def ranking_table(candidates: Sequence[Candidate]) -> Table:
    """The best candidates, with why the others were turned down."""
    title = "Effects that were tried, by the likelihood they gain"
    table = house_table(title, ("effect",), ("gain, nats", "p", "in maneuvers left out"))
    table.add_column("size with 95 % interval")
    table.add_column("turned down because")
    rows = words.ranked(candidates)
    for c in rows[:MOST_CANDIDATES]:
        table.add_row(
            c.id, number(c.gain, 3), number(c.p, 2), number(c.held_back_gain, 3),
            words.sizes(c.id, c.parameters), c.rejected or "-", style="" if c.rejected else "cyan",
        )  # fmt: skip
    if len(rows) > MOST_CANDIDATES:
        table.caption = f"and {len(rows) - MOST_CANDIDATES} more: diagnose/diagnosis.json"
        table.caption_justify = "left"
    return table


def verdict_lines(found: Diagnosis) -> list[RenderableType]:
    """The verdict, its effects, and what cannot be told apart or explained."""
    pieces: list[RenderableType] = [statement(found)]
    if found.effects:
        pieces.append(effects_table(found.effects))
    pieces += _ambiguous_lines(found)
    if found.separate_by:
        pieces.append(Text(f"To tell them apart: {found.separate_by}", style="yellow"))
    return pieces + _unexplained_lines(found)


def _ambiguous_lines(found: Diagnosis | Comparison) -> list[RenderableType]:
    return [
        Text(f"These data cannot tell apart: {', '.join(group)}", style="yellow")
        for group in found.ambiguous
    ]


def _unexplained_lines(found: Diagnosis | Comparison) -> list[RenderableType]:
    lines = words.unexplained_lines(found.unexplained)
    return [Text(f"Left unexplained: {line}", style="yellow") for line in lines]


def effects_table(effects: Sequence[EffectFound]) -> Table:
    """Effects in plain words, each parameter with its 95 % interval."""
    table = house_table("", ("effect", "", "parameter"), ("value",))
    table.add_column("unit")
    table.add_column("95 % interval", justify="right")
    for effect in effects:
        first, plain = effect.id, " ".join(x for x in (effect.plain, words.place(effect)) if x)
        for p in effect.parameters:
            bounds = words.interval_of(effect.id, p)
            table.add_row(first, plain, p.symbol, number(p.value, 4), p.unit, bounds)
            first = plain = ""
        if not effect.parameters:
            table.add_row(first, plain)
    return table


def held_out_table(held_out: HeldOut) -> Table:
    """Errors of the held-out maneuvers before and after, with the interval of the difference."""
    heads = ("RMSE before", "RMSE after", "difference", "95 % interval", "NRMSE before",
             "NRMSE after")  # fmt: skip
    title = "Prediction of the held-out maneuvers, before and after"
    table = house_table(title, ("channel", "unit"), heads)
    for channel, before in held_out.before.items():
        after = held_out.after.get(channel)
        table.add_row(
            channel, before.unit, number(before.rmse, 3), number(after.rmse if after else None, 3),
            *_difference(held_out.difference.get(channel)), number(before.nrmse, 3),
            number(after.nrmse if after else None, 3),
        )  # fmt: skip
    return table


def _difference(difference: Difference | None) -> tuple[str, str]:
    if difference is None:
        return "", ""
    low, high = (number(bound, 2) for bound in (difference.low, difference.high))
    return number(difference.value, 2), f"{low} to {high}"


def moved_table(found: Comparison) -> Table:
    """Coefficients that the added effects moved."""
    title = f"Coefficients that moved by more than {words.MOVED:g} standard deviations"
    table = house_table(title, ("", "unit"), ("before", "after", "moved, std", "ASE"))
    for c in words.moved(found.coefficients):
        table.add_row(
            c.symbol, c.unit, f"{number(c.before, 4)} ± {number(c.before_std, 2)}",
            f"{number(c.after, 4)} ± {number(c.after_std, 2)}", f"{words.moves(c):+.1f}",
            f"{number(c.prior, 4)} ± {number(c.prior_std, 2)}",
        )  # fmt: skip
    return table
