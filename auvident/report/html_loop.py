"""What the HTML report says of the residual loop: verdict, tables and figures of its section."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from auvident.report import loop_words as words
from auvident.report.html_data import ReportData, number, quantity
from auvident.report.html_tables import Table
from auvident.report.numbers import PAGE, unit_text
from auvident.schema.diagnosis import (
    Candidate,
    ChannelError,
    CoefficientComparison,
    Comparison,
    Diagnosis,
    Difference,
    EffectFound,
    HeldOut,
    ManeuverComparison,
    ParameterValue,
)

if TYPE_CHECKING:
    import pandas as pd

MOST_CANDIDATES = 8  # the others can be unfolded
GRADES = {
    "none_found": "good", "effect_found": "fair", "ambiguous": "fair", "partly_explained": "poor",
    "unexplained": "poor",
}  # fmt: skip


@dataclass(frozen=True)
class Lacks:
    """Everything that the section shows; what the run does not have is empty."""

    verdict: str
    grade: str
    statement: str
    false_alarm_p: str
    effects: Table
    attempts: Table | None
    silent: Table
    ambiguous: tuple[str, ...]
    separate_by: str
    unexplained: tuple[str, ...]
    summary: str
    held_out: Table | None
    maneuvers: Table | None
    moved: Table | None
    coefficients: Table | None
    candidates: Table
    others: Table
    sees: Table
    blind: Table
    lookalikes: Table
    missing: tuple[str, ...]
    residuals: Table
    steps: tuple[str, ...]


def lacks(report: ReportData) -> Lacks | None:
    """What the model lacks, from the diagnosis and, where there is one, the refinement."""
    found = report.comparison or report.diagnosis
    if found is None:
        return None
    diagnosis = report.diagnosis or _nothing_known(found)
    comparison = report.comparison
    return Lacks(
        verdict=words.VERDICTS[found.verdict],
        grade=GRADES[found.verdict],
        statement=found.statement,
        false_alarm_p="" if found.false_alarm_p is None else number(found.false_alarm_p, 2),
        effects=effect_table((*found.effects, *(comparison.not_confirmed if comparison else ()))),
        attempts=attempt_table(comparison) if comparison else None,
        silent=effect_table(diagnosis.silent),
        ambiguous=tuple(", ".join(group) for group in found.ambiguous),
        separate_by=diagnosis.separate_by,
        unexplained=words.unexplained_lines(found.unexplained),
        summary=summary(comparison) if comparison else "",
        held_out=held_out_table(comparison.held_out) if comparison else None,
        maneuvers=maneuver_table(comparison.maneuvers) if comparison else None,
        moved=moved_table(words.moved(comparison.coefficients)) if comparison else None,
        coefficients=moved_table(comparison.coefficients) if comparison else None,
        candidates=candidate_table(words.ranked(found.candidates)[:MOST_CANDIDATES]),
        others=candidate_table(words.ranked(found.candidates)[MOST_CANDIDATES:]),
        sees=sees_table(diagnosis),
        blind=blind_table(diagnosis),
        lookalikes=lookalike_table(diagnosis),
        missing=diagnosis.missing,
        residuals=residual_table(diagnosis),
        steps=diagnosis.steps,
    )


def summary(comparison: Comparison) -> str:
    """Held-out errors before and after in one sentence; empty where nothing was added."""
    held = comparison.held_out
    errors = [
        f"{name} {quantity(before.rmse, before.unit, 2)} → {quantity(after.rmse, after.unit, 2)}"
        for name, before in held.before.items() if (after := held.after.get(name))
    ]  # fmt: skip
    if not comparison.added or not errors:
        return ""
    return f"Held-out RMSE without and with what was added: {', '.join(errors)}."


def _nothing_known(found: Diagnosis | Comparison) -> Diagnosis:
    """A diagnosis that says no more than the comparison does."""
    return Diagnosis(plane="", verdict=found.verdict, statement=found.statement)


def figures(report: ReportData) -> dict[str, list[str | None]]:
    """Figures of the section by the names that the template uses."""
    from auvident.report.figures_forces import unknown_force
    from auvident.report.figures_loop import before_after, gains, moves

    found = report.comparison or report.diagnosis
    table = report.residuals
    changed = report.comparison is not None and report.comparison.added
    return {
        "gains": [gains(found.candidates, "gains")] if found else [],
        "before_after": [before_after(table, "beforeafter")] if table is not None else [],
        "forces": [unknown_force(table, "forces")] if table is not None else [],
        "moves": [moves(report.comparison.coefficients, "moves")]
        if changed and report.comparison else [],
    }  # fmt: skip


def with_refined(rows: "pd.DataFrame", report: ReportData, maneuver: str) -> "pd.DataFrame":
    """Rows of a maneuver with what the refined model predicts as ``..._refined``.

    As they are where nothing was added, or the refinement does not have the same rows.
    """
    if report.refined is None or report.comparison is None or not report.comparison.added:
        return rows
    refined = report.refined[report.refined["maneuver"] == maneuver]
    if not np.array_equal(refined["time_s"], rows["time_s"]):
        return rows
    ending = "_simulated"
    added = {
        c.removesuffix(ending) + "_refined": refined[c].to_numpy()
        for c in refined.columns if c.endswith(ending)
    }  # fmt: skip
    return rows.assign(**added)


def effect_table(effects: Sequence[EffectFound]) -> Table:
    """Effects in plain words, with each parameter and its interval."""
    rows = []
    for effect in effects:
        first = [effect.id, " ".join(x for x in (effect.plain, words.place(effect)) if x)]
        for p in effect.parameters:
            rows.append([*first, p.symbol, *_value(effect.id, p)])
            first = ["", ""]
        if not effect.parameters:
            rows.append([*first, "", "", "", ""])
    heads = ("effect", "in words", "parameter", "unit", "value", "95 % interval")
    return Table(heads, rows, left=4)


def _value(effect: str, p: ParameterValue) -> tuple[str, str, str]:
    return unit_text(p.unit), number(p.value), _signs(words.interval_of(effect, p))


def attempt_table(comparison: Comparison) -> Table:
    """What was tried in place of the model before, and its errors over those of that."""
    rows = words.attempt_rows(comparison)
    channels = list(dict.fromkeys(c for _, _, ratios in rows for c in ratios))
    cells = [
        [effects, became, *(number(ratios.get(c), 3) or "–" for c in channels)]
        for effects, became, ratios in rows
    ]
    return Table(("with", "", *(f"{c}, after ÷ before" for c in channels)), cells, left=2)


def held_out_table(held_out: HeldOut) -> Table:
    """Pooled errors of what was held out, before and after, with the interval of the difference."""
    rows = []
    for channel, before in held_out.before.items():
        after = held_out.after.get(channel)
        rows.append([
            channel, quantity(before.rmse, before.unit), _error(after),
            *_difference(held_out.difference.get(channel), before.unit), number(before.nrmse, 2),
            number(after.nrmse if after else None, 2), _ratio(before, after),
        ])  # fmt: skip
    heads = ("channel", "RMSE before", "RMSE after", "difference", "95 % interval",
             "NRMSE before", "NRMSE after", "squared error ÷")  # fmt: skip
    return Table(heads, rows)


def _error(error: ChannelError | None) -> str:
    return quantity(error.rmse, error.unit) if error else "–"


def _ratio(before: ChannelError, after: ChannelError | None) -> str:
    return number((before.rmse / after.rmse) ** 2, 2) if after and after.rmse > 0.0 else "–"


def _difference(difference: Difference | None, unit: str) -> tuple[str, str]:
    if difference is None:
        return "–", "–"
    low, high = (number(PAGE.shown(x, unit), 2) for x in (difference.low, difference.high))
    return quantity(difference.value, unit, 2), f"{low} to {high}"


def maneuver_table(maneuvers: Sequence[ManeuverComparison]) -> Table:
    """Errors of every maneuver, before → after; a difference that is none is not in bold."""
    names = list(dict.fromkeys(name for m in maneuvers for name in m.before))
    units = {name: e.unit for m in maneuvers for name, e in m.before.items()}
    rows = [
        [m.id, m.kind, m.role, *(_change(m, name) for name in names)]
        for m in sorted(maneuvers, key=lambda m: m.role != "validate")
    ]
    heads = ("maneuver", "kind", "role", *(f"{n}, {PAGE.unit(units[n])}" for n in names))
    return Table(heads, rows, left=3, mark="validate")


def _change(m: ManeuverComparison, channel: str) -> str:
    """``before → after``; a star where the interval of the difference excludes zero."""
    before, after = m.before.get(channel), m.after.get(channel)
    if before is None or after is None:
        return "–"
    difference = m.difference.get(channel)
    sure = difference is not None and difference.low * difference.high > 0.0
    values = (number(PAGE.shown(e.rmse, e.unit)) for e in (before, after))
    return " → ".join(values) + (" *" if sure else "")


def moved_table(coefficients: Sequence[CoefficientComparison]) -> Table:
    """Coefficients against their prior, before and after, and how far each moved."""
    rows = [
        [c.symbol, unit_text(c.unit), f"{number(c.prior)} ± {number(c.prior_std, 2)}",
         f"{number(c.before)} ± {number(c.before_std, 2)}",
         f"{number(c.after)} ± {number(c.after_std, 2)}",
         f"{words.moves(c):+.1f}".replace("-", "−")]
        for c in coefficients
    ]  # fmt: skip
    return Table(("", "unit", "prior", "before", "after", "moved, std"), rows, left=2)


def candidate_table(candidates: Sequence[Candidate]) -> Table:
    """Candidates in their order; accepted ones are marked."""
    rows = [
        ["accepted" if not c.rejected else "", c.id, c.family,
         _signs(words.sizes(c.id, c.parameters)), c.rejected, number(c.gain), number(c.p, 2),
         number(c.held_back_gain),
         "–" if c.improved is None else f"{100.0 * c.improved:.0f} %"]
        for c in candidates
    ]  # fmt: skip
    heads = ("", "effect", "family", "size with 95 % interval", "turned down because",
             "gain, nats", "p", "gain in maneuvers left out", "of them helped")  # fmt: skip
    return Table(heads, rows, left=5, mark="accepted")


def _signs(text: str) -> str:
    """Real minus signs before numbers."""
    return re.sub(r"(?<!\w)-(?=\d)", "−", text)


def sees_table(found: Diagnosis) -> Table:
    """Smallest size of every parameter that these maneuvers would show."""
    rows = [
        [row.family, row.id, row.symbol, unit_text(row.unit),
         f"{words.bound(row)} {number(row.size, 2)}", f"{100.0 * row.kept:.0f} %"]
        for row in found.sees if row.visible
    ]  # fmt: skip
    heads = ("family", "effect", "parameter", "unit", "shows from", "signature left")
    return Table(heads, rows, left=4)


def blind_table(found: Diagnosis) -> Table:
    """What these maneuvers would not show, by the reason."""
    blind = words.blind_by_reason(found.sees)
    return Table(("not seen", "why"), [[", ".join(n), why] for why, n in blind.items()], left=2)


def lookalike_table(found: Diagnosis) -> Table:
    """Effects that look alike in these maneuvers."""
    rows = [[", ".join(s.ids), s.separate_by, f"{s.cosine:.3f}"] for s in found.lookalikes]
    return Table(("these look alike", "what would separate them", "cosine"), rows, left=2)


def residual_table(found: Diagnosis) -> Table:
    """Residual of every channel against the noise of its sensor."""
    rows = [
        [r.channel, quantity(r.rms, r.unit), quantity(r.noise_std, r.unit, 2),
         number(r.ratio, 2), quantity(r.rms_after, r.unit), number(r.correlation_time_s, 2)]
        for r in words.pooled(found.residuals)
    ]  # fmt: skip
    heads = ("channel", "residual, rms", "sensor noise", "ratio", "with the effects",
             "correlated over, s")  # fmt: skip
    return Table(heads, rows)
