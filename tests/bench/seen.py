"""How well can any coefficients that all trials share predict what one trial held out?

A trial is pooled with the others with the maneuvers that it held out among those that identify.
What that model still misses of them, beside the trial's own fit that never saw them, no model of
all trials could tell from the trials alone.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from auvident.engines.records import Record, sensor_matrix
from auvident.pipeline.given import Given
from auvident.pipeline.left_out_runs import errors_beside, with_own
from auvident.pipeline.pooling import pool_trial
from auvident.pipeline.predict import find_model
from auvident.schema.artifacts import IdentifiedModel, Maneuvers
from auvident.schema.changes import LeftOutTrialError
from auvident.stages.identify.setup import records_of
from auvident.stages.pool import pool
from auvident.storage.run_directory import RunDirectory

OTHER_ROLE = {"identify": "validate", "validate": "identify"}


def errors_having_seen(runs: Sequence[Path], target: Path) -> list[LeftOutTrialError]:
    """Errors of what a run held out, by the model of all runs that has seen it, and by its own."""
    given = Given(RunDirectory(target))
    _, own = find_model(target)
    trials = {run: pool_trial(run, None, run.name) for run in runs}
    replay = trials[target].replay() if trials[target].replay else None
    if replay is None:
        raise ValueError(f"{target}: its maneuvers are there no more")
    seen = replace(replay, records=(*replay.records, *held_out_records(given, own)))
    trials[target] = replace(trials[target], replay=lambda: seen)
    model = pool(list(trials.values())).model
    water = with_own(model, seen.model, seen.own_beside(model))
    return errors_beside(target, water, own)


def held_out_records(given: Given, model: IdentifiedModel) -> list[Record]:
    """Records of the maneuvers that a run held out."""
    turned = _turned(given.maneuvers)
    sensor = sensor_matrix(model.plane, model.sensing)
    return [
        record for _, record in records_of(given.trials, turned, model.plane, sensor)[0].values()
    ]


def _turned(maneuvers: Maneuvers) -> Maneuvers:
    """Those that identify held out, and those held out to identify."""
    there = tuple(
        m.model_copy(update={"role": OTHER_ROLE.get(m.role, m.role)}) for m in maneuvers.maneuvers
    )
    return maneuvers.model_copy(update={"maneuvers": there})
