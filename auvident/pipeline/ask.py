"""Questions to a finished run: answered from its artifacts, nothing is written."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from auvident.errors import StageError
from auvident.pipeline.freshness import judge_all
from auvident.pipeline.given import Given
from auvident.pipeline.observer import Observer
from auvident.pipeline.planes import MODEL, planes_of
from auvident.pipeline.predict import find_model
from auvident.pipeline.remedies import command_of, typed
from auvident.pipeline.steps import begin_with_kernels
from auvident.storage.run_directory import RunDirectory

if TYPE_CHECKING:
    from auvident.schema.artifacts import TrialPlan
    from auvident.schema.planes import Plane

ONE_OF_BOTH = (
    "These are maneuvers of the {} plane, of a run of both: --plane {} ranks those of the other."
)


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


def opened(path: Path) -> Given:
    """The artifacts of a run as it is, with the stages that are up to date.

    Raises
    ------
    StageError
        There is no run.
    """
    run = RunDirectory(path)
    manifest = run.existing()
    done = frozenset(d.stage for d in judge_all(run, manifest) if d.state == "done")
    planes = planes_of(run) if (run / MODEL).exists() else ()
    return Given(run, manifest, also=done, planes=planes)


def need(given: Given, stage: str) -> None:
    """Refuse to go on with an opened run where a stage is not up to date.

    Raises
    ------
    StageError
        Names the command to run.
    """
    if stage not in given.also:
        finished(given.run.path, stage)


def in_plane(given: Given, plane: "Plane | None") -> Given:
    """The artifacts of a plane of the run; of the first one without a name."""
    planes = planes_of(given.run)
    if plane not in (None, *planes):
        raise StageError(
            f"there is no model of the {plane} plane",
            str(given.run.path),
            f"Run `auvident identify {typed(given.run.path)} --plane both`.",
        )
    return replace(given, planes=planes).within(plane or planes[0])


def plan_trial(path: Path, observer: Observer, plane: "Plane | None" = None) -> "TrialPlan":
    """Which maneuvers would add most to what the trials have told, in the first plane or another.

    Judged with the model that the run ends with.

    Raises
    ------
    StageError
        The run has not been identified, or not in this plane.
    """
    given = in_plane(finished(path, "identify"), plane)
    begin_with_kernels(observer)
    from auvident.stages.plan_trial import plan_trial as rank

    model = find_model(path, given.model.plane)[1]
    plan = rank(given.trials, given.maneuvers.maneuvers, model)
    others = [p for p in planes_of(given.run) if p != plan.plane]
    if others and plane is None:
        observer.note(ONE_OF_BOTH.format(plan.plane, others[0]))
    return plan
