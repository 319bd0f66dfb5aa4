"""A pooled model held against trials that did not go into it."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from auvident.errors import InputError, UsageError
from auvident.pipeline.given import Given
from auvident.pipeline.pooling import logs_of, with_small_effects
from auvident.pipeline.predict import find_model
from auvident.pipeline.replays import replay_behind
from auvident.schema.changes import LeftOutTrialError
from auvident.schema.effects import BY_ID
from auvident.storage.run_directory import RunDirectory

if TYPE_CHECKING:
    from auvident.schema.artifacts import IdentifiedModel
    from auvident.schema.pooled import PooledModel


LEFT_OUT = "Give runs that were left out of it."


def left_out_errors(model: "PooledModel", targets: Sequence[Path]) -> list[LeftOutTrialError]:
    """Errors of the held-out maneuvers of runs, by the pooled model and by their own.

    The water, the ballast and the clocks are those of the trial, as its identifying maneuvers have
    them beside the pooled coefficients; where these are there no more, as its own model has them.

    Raises
    ------
    InputError
        A run is of another vehicle, with what differs.
    UsageError
        A run, or a log of it, went into the pooled model.
    """
    from auvident.stages.pool.collect import other_vehicle

    pooled = [Path(t.file) for t in model.pooling.trials if t.used]
    logs = {digest for t in model.pooling.trials if t.used for digest in t.logs}
    found = []
    for target in targets:
        path, own = find_model(target, model.plane)
        if differs := next(other_vehicle(model, own), ""):
            problem = f"is not of the vehicle of the pooled model: {differs}"
            raise InputError(problem, str(target), LEFT_OUT)
        if path.resolve() in [file.resolve() for file in pooled]:
            raise UsageError("went into the pooled model", str(target), LEFT_OUT)
        again = [name for digest, name in logs_of(target).items() if digest in logs]
        if again:
            what = f"the log {again[0]} went into the pooled model with another run"
            raise UsageError(what, str(target), LEFT_OUT)
        full = with_small_effects(path, own)
        replay = replay_behind(path, full)
        beside = replay.own_beside(model) if replay else {}
        found += errors_beside(target, with_own(model, full, beside), own)
    return found


def with_own(
    model: "PooledModel", own: "IdentifiedModel", beside: Mapping[str, float] | None = None
) -> "IdentifiedModel":
    """The pooled model in the water and with the clocks of a trial.

    Parameters
    ----------
    beside : mapping, optional
        Values of these, internal, in place of those that the trial's own model has.
    """
    values = beside or {}
    rows = [
        e | {"internal": {n: values.get(n, v) for n, v in e["internal"].items()}}
        for e in own.effects
        if BY_ID[str(e["id"])].of_trial
    ]
    place = {name: k for k, name in enumerate(BY_ID)}
    effects = sorted((*model.effects, *rows), key=lambda e: place[str(e["id"])])
    return model.model_copy(update={"effects": tuple(effects)})


def errors_beside(
    target: Path, model: "IdentifiedModel", own: "IdentifiedModel"
) -> list[LeftOutTrialError]:
    """Errors of the held-out maneuvers of a run, by a model and by its own."""
    from auvident.stages.validate import held_out_errors

    given = Given(RunDirectory(target))
    return [
        LeftOutTrialError(
            trial=target.name, channel=c, unit=e.unit, pooled=e.one, own=e.other, p=e.p
        )
        for c, e in held_out_errors(given.trials, given.maneuvers, model, own).items()
    ]
