"""What the HTML report shows of the residual loop: verdict, tables, figures of its section."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from auvident.report import loop_words as words
from auvident.report import tables_loop as tables
from auvident.report.html_data import ReportData
from auvident.report.tables import Table
from auvident.schema.diagnosis import Candidate, Comparison, Diagnosis

if TYPE_CHECKING:
    import pandas as pd

BAND_ENDS = ("_lo", "_hi")
MOST_CANDIDATES = 8  # the others can be unfolded
GRADES = {
    "none_found": "good",
    "effect_found": "fair",
    "ambiguous": "fair",
    "partly_explained": "poor",
    "unexplained": "poor",
}


@dataclass(frozen=True)
class Lacks:
    """Everything that the section shows; what the run does not have is empty."""

    verdict: str
    grade: str
    statement: str
    false_alarm_p: str
    effects: Table
    attempts: Table | None
    nuisance: Table
    ambiguous: tuple[str, ...]
    separate_by: str
    unexplained: tuple[str, ...]
    held_out: Table | None
    crossed: Table | None
    force: str
    maneuvers: Table | None
    moved: Table | None
    candidates: Table
    bars: str
    others: Table
    sight: Table
    residuals: Table
    steps: tuple[str, ...]
    suggests: str


def lacks(report: ReportData) -> Lacks | None:
    """What the model lacks, from the diagnosis and, where there is one, the refinement."""
    found = report.comparison or report.diagnosis
    if found is None:
        return None
    diagnosis = report.diagnosis or _nothing_known(found)
    comparison = report.comparison
    changed = comparison if comparison and comparison.added else None
    return Lacks(
        verdict=words.VERDICTS[found.verdict],
        grade=GRADES[found.verdict],
        statement=found.statement,
        false_alarm_p="" if found.false_alarm_p is None else f"{100.0 * found.false_alarm_p:.3g} %",
        effects=tables.effects((*found.effects, *found.not_confirmed)),
        attempts=tables.attempts(comparison) if comparison else None,
        nuisance=tables.adjusted(diagnosis.nuisance),
        ambiguous=tuple(" and ".join(group) for group in found.ambiguous),
        separate_by=diagnosis.separate_by,
        unexplained=words.unexplained_lines(found.unexplained),
        held_out=tables.held_out(changed.held_out) if changed else None,
        crossed=tables.cross_validated(changed.cross_validation, "") if changed else None,
        force=words.force(comparison) if comparison else "",
        maneuvers=tables.maneuvers(changed.maneuvers, report.kinds) if changed else None,
        moved=tables.moved(changed.coefficients) if changed else None,
        candidates=tables.candidates(words.ranked(found.candidates)[:MOST_CANDIDATES]),
        bars=_bars(found.candidates),
        others=tables.candidates(words.ranked(found.candidates)[MOST_CANDIDATES:]),
        sight=replace(tables.sight(diagnosis), title=""),
        residuals=tables.residuals(diagnosis),
        steps=diagnosis.steps,
        suggests=words.SUGGESTS.get(diagnosis.plane, ""),
    )


def _bars(found: Sequence[Candidate]) -> str:
    """What the figure of the candidates shows, and no more than it shows."""
    text = (
        "Bars: gain in log-likelihood by adding the effect, corrected for the autocorrelation of "
    )
    text += "the residual"
    text += "; blue: accepted." if any(not c.rejected for c in found) else "."
    tried = any(c.held_back_gain is not None for c in found)
    return text + (" Diamonds: gain in maneuvers left out in turn." if tried else "")


def _nothing_known(found: Diagnosis | Comparison) -> Diagnosis:
    """A diagnosis that says no more than the comparison does."""
    return Diagnosis(plane="horizontal", verdict=found.verdict, statement=found.statement)


def figures(report: ReportData) -> dict[str, list[str | None]]:
    """Figures of the section by the names that the template uses."""
    from auvident.report.figures_forces import unknown_force
    from auvident.report.figures_loop import before_after, gains

    found = report.comparison or report.diagnosis
    table = report.residuals
    named = found is not None and bool(found.effects or found.ambiguous)
    return {
        "gains": [gains(found.candidates, f"gains{report.tag}")] if found else [],
        "before_after": [before_after(table, f"beforeafter{report.tag}", *_bands(report), named)]
        if table is not None
        else [],
        "forces": [unknown_force(table, f"forces{report.tag}")] if table is not None else [],
    }


def _bands(report: ReportData) -> "tuple[pd.DataFrame | None, bool]":
    """Predictions with a band, and whether they are those of the final model."""
    changed = report.comparison is not None and report.comparison.added
    is_final = bool(changed) and report.refined is not None
    return (report.refined if is_final else report.simulation), is_final


def with_refined(rows: "pd.DataFrame", report: ReportData, maneuver: str) -> "pd.DataFrame":
    """Rows of a maneuver with what the refined model predicts as ``..._refined``, and its band.

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
        for c in refined.columns
        if c.endswith(ending)
    }
    ends = [c for c in refined.columns if c.endswith(BAND_ENDS)]
    own = [c for c in rows.columns if c.endswith(BAND_ENDS)]
    band = {c: refined[c].to_numpy() for c in ends}
    return rows.drop(columns=own).assign(**added, **band)
