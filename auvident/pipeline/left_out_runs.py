"""A pooled model held against trials that did not go into it."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from auvident.errors import InputError, UsageError
from auvident.pipeline.given import Given
from auvident.pipeline.pooling import logs_of
from auvident.pipeline.predict import find_model
from auvident.schema.changes import LeftOutTrialError
from auvident.schema.effects import BY_ID
from auvident.storage.run_directory import RunDirectory

if TYPE_CHECKING:
    from auvident.schema.artifacts import IdentifiedModel
    from auvident.schema.pooled import PooledModel


LEFT_OUT = "Give runs that were left out of it."


def left_out_errors(model: "PooledModel", targets: Sequence[Path]) -> list[LeftOutTrialError]:
    """Errors of the held-out maneuvers of runs, by the pooled model and by their own.

    The water, the ballast and the clocks are those of the trial, as its own model has them.

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
        found += _errors(target, with_own(model, own), own)
    return found


def with_own(model: "PooledModel", own: "IdentifiedModel") -> "IdentifiedModel":
    """The pooled model in the water and with the clocks of a trial."""
    of_trial = tuple(e for e in own.effects if BY_ID[str(e["id"])].of_trial)
    place = {name: k for k, name in enumerate(BY_ID)}
    effects = sorted((*model.effects, *of_trial), key=lambda e: place[str(e["id"])])
    return model.model_copy(update={"effects": tuple(effects)})


def _errors(
    target: Path, model: "IdentifiedModel", own: "IdentifiedModel"
) -> list[LeftOutTrialError]:
    from auvident.stages.validate import validate

    given = Given(RunDirectory(target))
    pairs = [
        validate(given.trials, given.maneuvers, one).metrics.summary.get("validate", {})
        for one in (model, own)
    ]
    return [
        LeftOutTrialError(
            trial=target.name, channel=c, unit=e.unit, pooled=e.rmse, own=pairs[1][c].rmse
        )
        for c, e in pairs[0].items()
        if c in pairs[1]
    ]
