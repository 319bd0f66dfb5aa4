"""What the report stage reads: every artifact that the run has."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

from auvident.errors import NumericsError
from auvident.pipeline.given import Given, Model
from auvident.schema.planes import Plane
from auvident.storage.artifacts import read_json
from auvident.storage.run_directory import RunDirectory

if TYPE_CHECKING:
    from auvident.report.html import Drawn, Figures
    from auvident.report.html_data import ReportData
    from auvident.schema.artifacts import IdentifiedModel, Maneuvers, TrialPlan
    from auvident.schema.combined import CombinedModel


Parts = tuple[str, ...]  # of the figures
WHOLE = "combine/model.json"
REJECTED = "segment/rejected.json"


def report_data(given: Given, plans: bool = True) -> "ReportData":
    """Artifacts of all stages, of every plane of the run; `plans`: with what to fly next."""
    views = given.views()
    planned = cache(lambda: [_plan(view) for view in views]) if plans else None
    first, *others = (
        _of_plane(view, partial(_of, planned, i) if planned else None)
        for i, view in enumerate(views)
    )
    return replace(first, others=tuple(map(_own, others)), whole=_whole(given))


def figures_of_trials(path: Path) -> "Figures":
    """The figures of a report that rest on no model, by a process that knows the run directory."""
    from auvident.report.html import TRIALS, draw
    from auvident.report.html_data import ReportData

    run = RunDirectory(path)
    given = Given(run, run.manifest())
    data = ReportData(trials=given.trials, maneuvers=_maneuvers(given))
    return draw(data, parts=(TRIALS,)).trials


def figures_of_run(
    path: Path, also: frozenset[str], planes: tuple[Plane, ...], parts: "Parts"
) -> "Drawn":
    """Figures of a report, by a process that knows where the run directory is."""
    from auvident.report.html import draw

    run = RunDirectory(path)
    data = report_data(Given(run, run.manifest(), also=also, planes=planes), plans=False)
    return draw(data, parts=parts)


def shared_out(with_trials: bool) -> "tuple[Parts, Parts]":
    """What the helper draws of a report, and what who also finds out what to fly next does.

    Either takes about as long. ``with_trials``: the figures of the trials are still to be drawn;
    without them the kernels that plan are loaded already, too.
    """
    from auvident.report.html import PARTS, TRIALS

    here = {"innovations", "lacks"} if with_trials else {"coefficients"}
    there = [*([TRIALS] if with_trials else []), *(part for part in PARTS if part not in here)]
    return tuple(there), tuple(here)


def _whole(given: Given) -> "CombinedModel | None":
    """The model of both planes, where the run has one that is up to date."""
    from auvident.schema.combined import CombinedModel

    there = "combine" in given.also and given.has(WHOLE)
    return given.read(WHOLE, CombinedModel) if there else None


def _own(other: "ReportData") -> "ReportData":
    """A plane beside the first one, without the findings that are said there already."""
    return replace(
        other,
        ase=other.ase.model_copy(update={"findings": ()}) if other.ase else None,
        quality=None,
        maneuvers=other.maneuvers.model_copy(update={"findings": ()}) if other.maneuvers else None,
    )


def _of(planned: "Callable[[], list[TrialPlan | None]]", number: int) -> "TrialPlan | None":
    return planned()[number]


def _of_plane(
    given: Given, planned: "Callable[[], TrialPlan | None] | None" = None
) -> "ReportData":
    """Artifacts of a plane; of those it can do without only where they are up to date."""
    from auvident.report.html_data import ReportData
    from auvident.schema.artifacts import Metrics
    from auvident.schema.desk import StandardManeuvers

    diagnosed = "diagnose" in given.also and given.has("diagnose/diagnosis.json")
    is_refined = _is_refined(given)
    data = ReportData(
        trials=given.trials,
        vehicle=given.vehicle,
        quality=given.quality,
        maneuvers=_maneuvers(given),
        ase=given.ase,
        model=given.model,
        history=given.table("identify/history.parquet"),
        metrics=given.metrics,
        simulation=given.table("validate/simulation.parquet"),
        manifest=given.manifest,
        diagnosis=given.diagnosis if diagnosed else None,
        comparison=given.comparison if is_refined else None,
        residuals=given.table("diagnose/residuals.parquet") if diagnosed else None,
        refined=given.table("refine/simulation.parquet") if is_refined else None,
        refined_model=given.refined if is_refined else None,
        refined_history=given.table("refine/history.parquet") if is_refined else None,
        refined_metrics=_of_run(given, "refine/metrics.json", Metrics) if is_refined else None,
    )
    last = "refine" if data.is_refined else "validate"
    return replace(
        data,
        standard=_of_run(given, f"{last}/standard.json", StandardManeuvers),
        planned=planned,
    )


def _is_refined(given: Given) -> bool:
    return "refine" in given.also and given.has("refine/comparison.json")


def _final_model(given: Given) -> "IdentifiedModel | None":
    """The model that the report is about, read alone."""
    from auvident.report.html_data import ReportData

    if not _is_refined(given):
        return given.model
    data = ReportData(model=given.model, comparison=given.comparison, refined_model=given.refined)
    return data.final_model


def _of_run(given: Given, name: str, kind: type[Model]) -> Model | None:
    """An artifact that a run of an earlier version does not have."""
    return given.read(name, kind) if given.has(name) else None


def _plan(given: Given) -> "TrialPlan | None":
    """What to fly next; None where no further maneuver can be simulated with the model."""
    from auvident.stages.plan_trial import plan_trial

    model = _final_model(given)
    if model is None or not model.covariance:
        return None
    try:
        return plan_trial(given.trials, given.maneuvers.maneuvers, model)
    except NumericsError:
        return None


def _maneuvers(given: Given) -> "Maneuvers":
    """The maneuvers with what was rejected, which stands in a file of its own."""
    beside = read_json(given.run / REJECTED, given.remedy(REJECTED))
    return given.maneuvers.model_validate(
        {
            "maneuvers": given.maneuvers.maneuvers,
            "rejected": beside["rejected"],
            "findings": beside["findings"],
        }
    )
