"""Questions to a finished run: answered from its artifacts, nothing is written."""

from pathlib import Path
from typing import TYPE_CHECKING

from auvident.errors import StageError
from auvident.pipeline.freshness import judge_all
from auvident.pipeline.given import Given
from auvident.pipeline.observer import Observer
from auvident.pipeline.run import command_of
from auvident.pipeline.steps import announce_compilation
from auvident.storage.run_directory import RunDirectory

if TYPE_CHECKING:
    from auvident.schema.artifacts import TrialPlan


def finished(path: Path, stage: str) -> Given:
    """The artifacts of a run whose stages are up to date as far as `stage`.

    Raises
    ------
    StageError
        One of them is missing or stale; names the command to run.
    """
    run = RunDirectory(path)
    manifest = run.existing()
    for decision in judge_all(run, manifest):
        if decision.state != "done":
            raise StageError(
                f"{decision.stage} is {decision.state}: {decision.reason}",
                str(path),
                f"Run `{command_of(decision.stage, run, manifest)}` first.",
            )
        if decision.stage == stage:
            break
    return Given(run, manifest)


def plan_trial(path: Path, observer: Observer) -> "TrialPlan":
    """Which maneuvers would add most to what the trials have told."""
    given = finished(path, "identify")
    announce_compilation(observer)
    from auvident.stages.plan_trial import plan_trial as rank

    return rank(given.trials, given.maneuvers.maneuvers, given.model)
