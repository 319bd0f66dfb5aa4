"""The HTML report: one file, nothing outside of it; scripts only in the interactive one."""

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from auvident import __version__
from auvident.report import (
    html_summary,
    tables_consistency,
    tables_evidence,
    tables_figures,
    tables_model,
    tables_record,
    tables_run,
    tables_standard,
    tables_whole,
)
from auvident.report import html_words as words
from auvident.report.contents import with_contents
from auvident.report.finding_words import evidence
from auvident.report.held_out_words import beyond, why_held_out
from auvident.report.html_data import ReportData, number
from auvident.report.html_loop import figures as loop_figures
from auvident.report.html_loop import lacks, with_refined
from auvident.report.numbers import PAGE
from auvident.report.tables import Table, written
from auvident.report.trial_words import set_aside
from auvident.report.verdict_rules import table as rules
from auvident.schema.artifacts import PRIOR_WORDS
from auvident.schema.combined import CombinedModel
from auvident.schema.effect_words import nuisance_parameters

if TYPE_CHECKING:
    from jinja2 import Template
    from markupsafe import Markup

    from auvident.schema.trial import Trial

FOLDER = Path(__file__).resolve().parent
MOST_TRIALS = 32  # drawn over time; of the others the table of maneuvers tells
TRIALS_NAMED = 6  # in the head
TRIALS_APART, TRIALS_TOGETHER = 2, 16  # a figure each up to so many; else so many in a figure
IN_BACKTICKS = re.compile("`([^`]+)`")
STRONG = 0.8  # correlation from which on a pair is listed
MOST_PREDICTIONS = 10  # held-out maneuvers drawn; the errors of all are in a table


Figures = Mapping[str, "list[Markup]"]


@dataclass(frozen=True)
class Drawn:
    """The figures of a page by their places: those of the trials, and those of each plane."""

    trials: Figures
    planes: Sequence[Figures]

    def beside(self, other: "Drawn") -> "Drawn":
        """Together with other parts of the same page."""
        planes = zip(self.planes, other.planes, strict=True)
        return Drawn({**self.trials, **other.trials}, [{**a, **b} for a, b in planes])


def draw(report: ReportData, live: bool = False, parts: Collection[str] | None = None) -> Drawn:
    """Figures of a page; they do not show what to fly next.

    Parameters
    ----------
    report : ReportData
    live : bool
        Whether they are drawn by plotly in the browser, to hover and zoom.
    parts : collection of str, optional
        `TRIALS`, which needs no more than the trials and their maneuvers, and of `PARTS`; all of
        them if not given.
    """
    from auvident.report.figures import style

    with style(live):
        return Drawn(
            _of_trials(report) if parts is None or TRIALS in parts else {},
            [_figures(data, PARTS if parts is None else parts) for data in report.planes],
        )


def _of_trials(report: ReportData) -> Figures:
    return {"timelines": _safe(_timelines(report)), "tracks": _safe(_tracks(report))}


def render(report: ReportData, live: bool = False, drawn: Drawn | None = None) -> str:
    """The report as one self-contained HTML document.

    Parameters
    ----------
    report : ReportData
        Sections whose artifacts are missing say so, or are left out.
    live : bool
        Whether the figures are drawn by plotly in the browser, to hover and zoom.
    drawn : Drawn, optional
        The figures, by `draw`; else they are drawn now.

    Returns
    -------
    str
    """
    drawn = drawn or draw(report, live)
    alone = len(report.planes) == 1
    shown = zip(report.planes, drawn.planes, strict=True)
    page = _template().render(
        name=report.name,
        version=__version__,
        data=report,
        subtitle=_subtitle(report),
        aside=set_aside(report.quality) if report.quality else [],
        planes=[_plane(data, figures, alone) for data, figures in shown],
        figures=drawn.trials,
        left_out=_trials_left_out(report),
        evidence=evidence,
        whole=_whole(report.whole) if report.whole else None,
        scripts=_scripts() if live else "",
        **_tables(report),
    )
    return with_contents(page)


def _scripts() -> "Markup":
    from auvident.report.interactive import scripts

    return scripts()


def _plane(report: ReportData, figures: Figures, alone: bool) -> dict[str, Any]:
    """What the page shows of one plane: its summary, and its sections as markup."""
    from markupsafe import Markup

    of_plane = "" if alone else f", {report.plane} plane"
    view = {"of_plane": of_plane, "number": number, "evidence": evidence, "figures": figures}
    view |= _view(report)
    sections = {
        name: Markup(_template(f"{file}.html").render(**view))
        for name, file in (("findings", "plane"), ("history", "history"), ("passes", "passes"))
    }
    return {
        "plane": report.plane,
        "title": f"{report.plane.capitalize()} plane",
        "summary": html_summary.summary(report),
        "grade": html_summary.grade(report),
        **sections,
    }


def _whole(model: CombinedModel) -> dict[str, Any]:
    """What the page shows of the model of six degrees of freedom."""
    return {
        "place": tables_whole.PLACE,
        "rests_on": tables_whole.rests_on(model),
        "entries": replace(tables_whole.entries(model), title=""),
        "warnings": words.ranked([("combine", finding) for finding in model.findings]),
    }


def _view(report: ReportData) -> dict[str, Any]:
    """What the sections of a plane are made of."""
    return {
        "data": report,
        "model": report.final_model,
        "refined": report.is_refined,
        "cards": words.cards(report),
        "prior": report.prior_name,
        "prior_words": PRIOR_WORDS[report.prior_name],
        "held": bool(report.held_out()),
        "warnings": words.warnings(report),
        "coverage": words.coverage(report),
        "untested": words.untested(report),
        "rules": rules(tables_model.SIGHT_WORDS),
        **_plane_tables(report),
    }


@cache
def _template(name: str = "template.html") -> "Template":
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(FOLDER),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["written"] = lambda table: written(table, PAGE)
    environment.filters["commands"] = _commands
    return environment.get_template(name)


def _commands(text: str) -> "Markup":
    """Text in which what stands between backticks is set as a command."""
    from markupsafe import Markup, escape

    return Markup(IN_BACKTICKS.sub(r"<code>\1</code>", str(escape(text))))  # escaped before


def _subtitle(report: ReportData) -> list[str]:
    """What the report is about, in a few facts."""
    facts = []
    if report.quality:
        for t in report.quality.trials[:TRIALS_NAMED]:
            start = f", {t.origin[:10]}" if t.origin else ""
            facts.append(f"{t.trial} ({(t.t_end_s - t.t_start_s) / 60.0:.0f} min{start})")
        if len(report.quality.trials) > TRIALS_NAMED:
            facts.append(f"and {len(report.quality.trials) - TRIALS_NAMED} more trials")
    if report.maneuvers:
        held = sum(m.role == "validate" for m in report.maneuvers.maneuvers)
        facts.append(f"{len(report.maneuvers.maneuvers)} maneuvers, {held} held out")
    return facts


def _safe(texts: Sequence[str | None]) -> "list[Markup]":
    """Figures as markup that needs no escaping: the SVG writer has escaped the names."""
    from markupsafe import Markup

    return [Markup(text) for text in texts if text]


def _figures(report: ReportData, parts: Collection[str]) -> Figures:
    """Some parts of the figures of a plane."""
    drawn = [draw_part(report) for part, draw_part in PARTS.items() if part in parts]
    return {name: _safe(found) for figures in drawn for name, found in figures.items()}


def _drawn(report: ReportData) -> "list[list[Trial]]":
    """Trials that are drawn, by figure; of too many those with held-out maneuvers first."""
    from auvident.report.figures_joined import groups

    maneuvers = report.maneuvers.maneuvers if report.maneuvers else ()
    held = {m.trial for m in maneuvers if m.role == "validate"}
    chosen = {t.name for t in sorted(report.trials, key=lambda t: t.name not in held)[:MOST_TRIALS]}
    return groups([t for t in report.trials if t.name in chosen], TRIALS_APART, TRIALS_TOGETHER)


def _timelines(report: ReportData) -> list[str]:
    from auvident.report.figures_trial import timeline

    maneuvers = report.maneuvers.maneuvers if report.maneuvers else ()
    return [timeline(g, maneuvers, f"timeline{i}") for i, g in enumerate(_drawn(report))]


def _tracks(report: ReportData) -> list[str | None]:
    from auvident.report.figures_trial import track

    maneuvers = report.maneuvers.maneuvers if report.maneuvers else ()
    return [track(g, maneuvers, f"track{i}") for i, g in enumerate(_drawn(report))]


def _predictions(report: ReportData) -> list[str | None]:
    from auvident.report.figures_prediction import prediction

    if report.simulation is None:
        return []
    rows = dict(list(report.simulation.groupby("maneuver", sort=False)))
    return [
        prediction(
            with_refined(rows[m.id], report, m.id),
            m,
            report.before(m.id),
            f"prediction{i}{report.tag}",
            report.prior_name,
        )
        for i, m in enumerate(report.held_out()[:MOST_PREDICTIONS])
        if m.id in rows
    ]


def _coefficients(report: ReportData) -> dict[str, list[str | None]]:
    """Figures of the coefficients of the final model, and of the way to it."""
    from auvident.report.figures_coefficients import correlation_matrix, history
    from auvident.report.figures_evidence import evidence, settling

    model, passes, tag = report.final_model, report.final_history, report.tag
    if model is None:
        return {"evidence": [], "correlations": [], "history": [], "settling": []}
    rounds = tables_evidence.rounds(model)
    return {
        "evidence": [evidence(model, report.superseded, f"evidence{tag}", report.prior_name)],
        "correlations": [correlation_matrix(model.covariance, f"correlations{tag}")],
        "history": [history(passes, model.estimates, f"history{tag}")]
        if passes is not None
        else [],
        "settling": [settling(report.ways, rounds, f"settling{tag}")],
    }


def _innovations(report: ReportData) -> list[str | None]:
    """What the final model leaves of what was held out, else of what identified."""
    from auvident.report.figures_innovations import innovations

    table = report.final_simulation
    if table is None:
        return []
    return [innovations(table, report.final_tests, report.role, f"innovations{report.tag}")]


# figures of a plane, by what they show
TRIALS = "trials"
PARTS: Mapping[str, Callable[[ReportData], dict[str, list[str | None]]]] = {
    "predictions": lambda report: {"predictions": _predictions(report)},
    "coefficients": _coefficients,
    "innovations": lambda report: {"innovations": _innovations(report)},
    "lacks": loop_figures,
}


def _trials_left_out(report: ReportData) -> list[str]:
    """Trials that are not drawn, said; and held-out maneuvers."""
    notes = []
    trials = len(report.trials)
    if trials > MOST_TRIALS:
        notes.append(
            f"{MOST_TRIALS} of {trials} trials are drawn, those with held-out maneuvers first."
        )
    held = max(len(data.held_out()) for data in report.planes)
    if held > MOST_PREDICTIONS:
        notes.append(f"{MOST_PREDICTIONS} of {held} held-out maneuvers are drawn.")
    return notes


def _tables(report: ReportData) -> dict[str, Any]:
    """Tables of the trials by the names that the template uses; None where there is nothing."""
    quality, manifest, found = report.quality, report.manifest, report.maneuvers
    return {
        "why_held": why_held_out(found.maneuvers) if found else [],
        "trial_rows": _trial_rows(report),
        "sensors": tables_run.sensors(quality.trials) if quality else None,
        "lags": tables_record.lags(quality) if quality else None,
        "maneuver_rows": tables_run.maneuvers(found.maneuvers) if found else None,
        "rejected": tables_record.rejected(found.rejected) if found else None,
        "stages": tables_record.stages(manifest) if manifest else None,
        "hashes": tables_record.files(manifest) if manifest else None,
    }


def _trial_rows(report: ReportData) -> Table | None:
    """Table of the trials; None for a single one, of which everything stands elsewhere."""
    if report.quality is None or len(report.quality.trials) < 2:
        return None
    known = report.maneuvers.maneuvers if report.maneuvers else None
    return replace(tables_run.trials(report.quality.trials, known), title="")


def _plane_tables(report: ReportData) -> dict[str, Any]:
    """Tables of a plane by the names that the templates use; None where there is nothing."""
    model, metrics, final = report.final_model, report.metrics, report.final_metrics
    return {
        "figure_tables": [
            table
            for kind in ("turn", "zigzag")
            for table in tables_figures.figure_tables(
                report.finally_held_out(), kind, model.plane if model else "horizontal"
            )
        ],
        "horizons": tables_run.errors_by_horizon(final) if final and final.horizons else None,
        "beyond": beyond(metrics.extrapolation) if metrics else [],
        "errors": tables_run.errors_by_maneuver(metrics, report.refined_channels(), report.kinds)
        if metrics
        else None,
        "residuals": tables_run.residuals(final) if final else None,
        "consistency": tables_consistency.consistency(final, model),
        "consistency_words": tables_consistency.consistency_words(report.final_tests, report.role),
        "model_sight": replace(tables_model.sight(model), title="") if model else None,
        "coefficients": tables_evidence.evidence(model, report.superseded) if model else None,
        "carried": PAGE.signs(nuisance_parameters(model.effects)) if model else "",
        "uncertainty": tables_evidence.uncertainty(model) if model else None,
        "combinations": tables_model.combinations(model) if model else None,
        "pairs": tables_model.correlated(model.correlations, STRONG) if model else None,
        "passes": tables_model.passes(model) if model else None,
        "convergence": tables_evidence.convergence(report.ways, tables_evidence.rounds(model))
        if model
        else None,
        "convergence_words": tables_evidence.convergence_words(report.ways),
        "lacks": lacks(report),
        **_standard(report),
    }


def _standard(report: ReportData) -> dict[str, Any]:
    """Tables of the standard maneuvers; None where there are none."""
    found, vehicle = report.standard, report.vehicle
    if found is None:
        return {"standard": None, "imo": None, "particulars": None}
    is_ship = vehicle is not None and vehicle.is_ship
    return {
        "standard": tables_standard.standard(found),
        "imo": tables_standard.imo(found) if is_ship else None,
        "particulars": tables_standard.particulars(vehicle, report.final_model, found)
        if vehicle
        else None,
    }
