"""What the report stage reads: every artifact that the run has."""

from typing import TYPE_CHECKING

from auvident.errors import NumericsError
from auvident.pipeline.given import Given
from auvident.storage.artifacts import read_json

if TYPE_CHECKING:
    from auvident.report.html_data import ReportData
    from auvident.schema.artifacts import Maneuvers, TrialPlan


def report_data(given: Given) -> "ReportData":
    """Artifacts of all stages; of those it can do without only where they are up to date."""
    from auvident.report.html_data import ReportData

    return ReportData(
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
        diagnosis=given.diagnosis if "diagnose" in given.also else None,
        comparison=given.comparison if "refine" in given.also else None,
        residuals=given.table("diagnose/residuals.parquet") if "diagnose" in given.also else None,
        refined=given.table("refine/simulation.parquet") if "refine" in given.also else None,
        refined_model=given.refined if "refine" in given.also else None,
        refined_history=given.table("refine/history.parquet") if "refine" in given.also else None,
        plan=_plan(given),
    )


def _plan(given: Given) -> "TrialPlan | None":
    """What to fly next; None where no further maneuver can be simulated with the model."""
    from auvident.stages.plan_trial import plan_trial

    if not given.model.covariance:
        return None
    try:
        return plan_trial(given.trials, given.maneuvers.maneuvers, given.model)
    except NumericsError:
        return None


def _maneuvers(given: Given) -> "Maneuvers":
    """The maneuvers with what was rejected, which stands in a file of its own."""
    beside = read_json(given.run / "segment/rejected.json")
    return given.maneuvers.model_validate(
        {
            "maneuvers": given.maneuvers.maneuvers,
            "rejected": beside["rejected"],
            "findings": beside["findings"],
        }
    )
