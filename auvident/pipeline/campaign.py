"""A campaign: trials run one by one, pooled by vehicle, told in tables that others read."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from auvident import __version__
from auvident.errors import AuvidentError, GateError, InputError, NumericsError, UsageError
from auvident.pipeline.campaign_jobs import Job, JobDone, JobRunner, LocalProcesses, processors
from auvident.pipeline.campaign_pooling import PooledVehicle, judged, pooled_by_plane
from auvident.pipeline.freshness import is_of_this_run
from auvident.pipeline.given import Given
from auvident.pipeline.observer import Observer
from auvident.pipeline.planes import planes_of
from auvident.pipeline.pooling import PooledRuns, alarms, date_of
from auvident.pipeline.predict import find_model
from auvident.pipeline.remedies import FLAGS
from auvident.pipeline.run import up_to_date
from auvident.pipeline.table import BY_NAME
from auvident.schema.campaign import (
    CampaignResult,
    CampaignTrial,
    RunOptions,
)
from auvident.schema.planes import PLANES
from auvident.storage.artifacts import json_bytes, parquet_bytes, read_json, write_bytes
from auvident.storage.campaign_file import RESULT, PlannedTrial
from auvident.storage.run_directory import RunDirectory

if TYPE_CHECKING:
    import pandas as pd

METRICS, COMPARISON = "validate/metrics.json", "refine/comparison.json"
NONE_FOUND = "none_found"  # verdict
MOSTLY = 0.5  # share of the data from which on a coefficient is said to come from them
OPTION_NAMES = {key: FLAGS[key] for key in RunOptions.model_fields}
# Up to where a run must be up to date for its trial to count though its process ended with this
# code. A gate, or a log that was set aside, is told when the whole run stands; where the numbers
# of a stage fail that the report can do without, what stands up to the errors counts. After any
# other end (a refused log, a full disk, a kill, a bug) what stands there may be of an earlier run.
STANDS_UP_TO = {
    GateError.exit_code: "report",
    InputError.exit_code: "report",
    NumericsError.exit_code: "validate",
}
STAGE_OF = {"rate_hz": "ingest", "max_gap_s": "ingest", "fix": "ingest", "hold_out": "segment"}


@dataclass(frozen=True)
class CampaignPlan:
    """What a campaign is to do.

    Attributes
    ----------
    output : Path
    trials : sequence of PlannedTrial
    jobs : int or None
        Trials at a time; None for one a processor.
    false_alarms : float
        Probability of a change where there is none.
    allow_outside : bool
        Whether vehicle files may name files outside of their folder.
    """

    output: Path
    trials: Sequence[PlannedTrial]
    jobs: int | None = None
    false_alarms: float = 0.01
    allow_outside: bool = False
    seed: int = 0

    def run_of(self, trial: PlannedTrial) -> Path:
        """Its run directory."""
        return self.output / trial.vehicle / trial.name


@dataclass
class CampaignRun:
    """The outcome of a campaign: its result, and the pooled runs by vehicle."""

    result: CampaignResult
    pooled: dict[str, PooledRuns] = field(default_factory=dict)


def options_of(trial: PlannedTrial, allow_outside: bool) -> dict[str, dict[str, Any]]:
    """Options by stage, as `run_all` takes them: of `auvident run` with the same arguments."""
    stages: dict[str, dict[str, Any]] = {
        "ingest": {"logs": (trial.log,), "vehicle": trial.vehicle_file},
        "segment": {},
        "identify": {},
    }
    if trial.column_map is not None:
        stages["ingest"]["map"] = trial.column_map
    if allow_outside:
        stages["ingest"]["allow_outside"] = True
    for key, value in _set(trial.options).items():
        stages[STAGE_OF.get(key, "identify")][key] = value
    return stages


def _set(options: RunOptions) -> dict[str, Any]:
    return {k: v for k, v in options.model_dump().items() if v not in (None, ())}


def arguments_of(trial: PlannedTrial, run: Path, allow_outside: bool) -> tuple[str, ...]:
    """The same as arguments of ``auvident``."""
    found = ["run", str(trial.log), "--vehicle", str(trial.vehicle_file), "--run", str(run)]
    found += ["--map", str(trial.column_map)] if trial.column_map is not None else []
    found += ["--allow-outside"] if allow_outside else []
    for key, value in _set(trial.options).items():
        for one in value if isinstance(value, tuple) else (value,):
            found += [OPTION_NAMES[key], str(one)]
    return (*found, "--quiet")


def run_campaign(
    plan: CampaignPlan,
    observer: Observer,
    *,
    dry_run: bool = False,
    runner: JobRunner | None = None,
    warm: Callable[[Observer], None] | None = None,
) -> CampaignRun:
    """Run every trial that is not up to date, pool them by vehicle, write the tables.

    Parameters
    ----------
    plan : CampaignPlan
    observer : Observer
    dry_run : bool
        Only say what would be run.
    runner : JobRunner, optional
        Where trials run; without it on all processors of this machine.
    warm : callable, optional
        Compiles the kernels before the first trial, so that not every one of them does.
    """
    trials = {_key(t): t for t in plan.trials}
    states = {key: _state(plan, t) for key, t in trials.items()}
    if dry_run:
        return CampaignRun(
            CampaignResult(program_version=__version__, trials=tuple(states.values()))
        )
    from auvident.storage.lock import locked

    with locked(plan.output):
        waiting = [t for t in plan.trials if states[_key(t)].state == "planned"]
        if waiting and warm is not None:
            warm(observer)
        own = runner or LocalProcesses(plan.jobs or processors())
        jobs = [Job(_key(t), arguments_of(t, plan.run_of(t), plan.allow_outside)) for t in waiting]
        for done in _followed(own, jobs, plan.jobs or processors(), observer):
            counts = _counts(plan, trials[done.key], done.exit_code)
            states[done.key] = _ended(states[done.key], done, counts)
        return gathered(plan, states, observer)


def _key(trial: PlannedTrial) -> str:
    return f"{trial.vehicle}/{trial.name}"


def _state(plan: CampaignPlan, trial: PlannedTrial) -> CampaignTrial:
    """Whether a trial is up to date, or to be run."""
    return CampaignTrial(
        vehicle=trial.vehicle,
        trial=trial.name,
        log=str(trial.log),
        run=str(plan.run_of(trial)),
        state="up to date" if _stands(plan, trial) else "planned",
    )


def _stands(plan: CampaignPlan, trial: PlannedTrial, until: str | None = None) -> bool:
    """Whether the run of a trial is what it would be made to now, up to a stage."""
    run = plan.run_of(trial)
    try:
        return run.is_dir() and up_to_date(run, options_of(trial, plan.allow_outside), until=until)
    except (AuvidentError, OSError):  # damaged, or not to be read: the run says so itself
        return False


def _counts(plan: CampaignPlan, trial: PlannedTrial, exit_code: int) -> bool:
    """Whether a trial has a result, by how its process ended and what that left."""
    if exit_code == 0:
        return True
    until = STANDS_UP_TO.get(exit_code)
    return until is not None and _stands(plan, trial, until)


def _followed(
    runner: JobRunner, jobs: Sequence[Job], at_once: int, observer: Observer
) -> "Sequence[JobDone]":
    """Trials as they end, each told with the time that is left."""
    began, found = time.perf_counter(), []
    observer.progress(f"0 of {len(jobs)} trials", 0.0)
    for done in runner.each(jobs):
        found.append(done)
        share = len(found) / len(jobs)
        left = (time.perf_counter() - began) * (1.0 / share - 1.0)
        told = f"{len(found)} of {len(jobs)} trials, {_in_words(left)} left"
        outcome = done.problem or f"done in {done.seconds:.0f} s"
        observer.note(f"[{len(found)}/{len(jobs)}] {done.key}: {outcome} ({_in_words(left)} left)")
        observer.progress(told, share)
    return found


def _in_words(seconds: float) -> str:
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"


def _ended(row: CampaignTrial, done: JobDone, counts: bool) -> CampaignTrial:
    return row.model_copy(
        update={
            "state": "done" if counts else "failed",
            "seconds": round(done.seconds, 1),
            "exit_code": done.exit_code,
            "problem": done.problem,
        }
    )


def gathered(
    plan: CampaignPlan, states: Mapping[str, CampaignTrial], observer: Observer
) -> CampaignRun:
    """What the runs say, pooled by vehicle; writes tables, models and the page."""
    rows = {key: with_results(row) for key, row in states.items()}
    found: list[PooledVehicle] = []
    for name in dict.fromkeys(t.vehicle for t in plan.trials):
        own = [r for r in rows.values() if r.vehicle == name]
        observer.progress(f"pooling {name}", None)
        by_plane = pooled_by_plane(plan.output / name, own, plan.false_alarms, plan.seed)
        rows |= {f"{name}/{r.trial}": r for r in judged(own, by_plane)}
        found += by_plane
    result = CampaignResult(
        program_version=__version__,
        trials=tuple(rows.values()),
        vehicles=tuple(v.told for v in found),
    )
    pooled = {v.told.title: v.runs for v in found if v.runs is not None}
    write_tables(plan.output, result, pooled)
    return CampaignRun(result, pooled)


def with_results(row: CampaignTrial) -> CampaignTrial:
    """A row with what stands in its run directory."""
    run = Path(row.run)
    if row.state in ("failed", "planned"):  # what stands there may be of an earlier run
        return row.model_copy(update={"state": "failed"})
    if not (run / METRICS).exists():
        return row
    try:
        _, model = find_model(run)
        beside = len(planes_of(RunDirectory(run))) > 1
        told = [_in_plane(run, is_second) for is_second in (False, True)[: 1 + beside]]
    except AuvidentError as error:
        return row.model_copy(update={"state": "failed", "problem": error.problem})
    errors: dict[str, dict[str, float]] = {}
    for plane in told:  # speed and track are those of the first
        errors |= {c: e for c, e in plane.errors.items() if c not in errors}
    verdicts = [plane.verdict for plane in told]
    return row.model_copy(
        update={
            "date": date_of(run),
            "verdict": next((v for v in verdicts if v not in ("", NONE_FOUND)), verdicts[0]),
            "effects": tuple(dict.fromkeys(e for plane in told for e in plane.effects)),
            "maneuvers": len(model.stages[-1].maneuvers) if model.stages else 0,
            "rmse": {c: e["rmse"] for c, e in errors.items()},
            "nrmse": {c: e["nrmse"] for c, e in errors.items() if "nrmse" in e},
            "from_data": sum(c.data_share > MOSTLY for c in model.coefficients),
            "coefficients": len(model.coefficients),
        }
    )


@dataclass(frozen=True)
class _PlaneTold:
    """What a run says of a plane: held-out errors by channel, and what its model lacked."""

    errors: dict[str, dict[str, float]]
    verdict: str
    effects: tuple[str, ...]


def _in_plane(run: Path, is_second: bool) -> _PlaneTold:
    """Errors of the refined model, where it is of these logs and of this model.

    A second plane may have been identified and no more; the trial counts by its first.
    """
    directory = RunDirectory(run)
    given = Given(directory, planes=PLANES, plane=PLANES[-1] if is_second else None)
    metrics, comparison = (run / given.place(name) for name in (METRICS, COMPARISON))
    told = read_json(metrics) if metrics.exists() or not is_second else {}
    errors = dict(told.get("summary", {}).get("validate", {}))
    stands = is_of_this_run(BY_NAME["refine"], directory, directory.existing())
    refined = read_json(comparison) if stands and comparison.exists() else {}
    errors |= refined.get("held_out", {}).get("after", {})
    effects = tuple(str(e["id"]) for e in refined.get("effects", ()))
    return _PlaneTold(errors, refined.get("verdict", ""), effects)


# --- tables --------------------------------------------------------------------------------


def write_tables(output: Path, result: CampaignResult, pooled: Mapping[str, PooledRuns]) -> None:
    """``campaign.json`` and one Parquet file each for trials, coefficients and effects.

    ``pooled`` is by the title of a vehicle.
    """
    program = {"program": f"auvident {__version__}"}
    for name, table in tables_of(result, pooled).items():
        write_bytes(output / f"{name}.parquet", parquet_bytes(table, program))
    write_bytes(output / RESULT, json_bytes(result, RESULT))


def tables_of(
    result: CampaignResult, pooled: Mapping[str, PooledRuns]
) -> "dict[str, pd.DataFrame]":
    """Trials, coefficients and effects as long tables."""
    import pandas as pd

    told = [(v, pooled[v.title]) for v in result.vehicles if v.title in pooled]
    return {
        "trials": pd.DataFrame([_trial_row(t) for t in result.trials]),
        "coefficients": pd.DataFrame(
            [row for v, runs in told for row in _coefficient_rows(v.name, runs)],
            columns=list(COEFFICIENT_COLUMNS),
        ),
        "effects": pd.DataFrame(
            [row for v, runs in told for row in _effect_rows(v.name, runs)],
            columns=list(EFFECT_COLUMNS),
        ),
    }


COEFFICIENT_COLUMNS = (
    "vehicle", "plane", "trial", "date", "symbol", "unit", "value", "std", "shrunk", "shrunk_std",
    "pooled", "pooled_std", "prior", "prior_std", "data_share", "pooled_data_share", "between_std",
    "used",
)  # fmt: skip
EFFECT_COLUMNS = (
    "vehicle", "plane", "trial", "date", "effect", "parameter", "value", "std", "unit",
)  # fmt: skip


def _trial_row(t: CampaignTrial) -> dict[str, Any]:
    row = t.model_dump(exclude={"rmse", "nrmse", "effects"})
    errors = {f"rmse_{c}": v for c, v in t.rmse.items()}
    errors |= {f"nrmse_{c}": v for c, v in t.nrmse.items()}
    return {**row, "effects": ",".join(t.effects), **errors}


def _coefficient_rows(vehicle: str, runs: PooledRuns) -> list[dict[str, Any]]:
    """A row for each trial and coefficient: as it says alone, with the others, and all together."""
    rows = []
    together = {p.symbol: p for p in runs.model.pooling.parameters}
    for t in runs.model.pooling.trials:
        for symbol, own in t.alone.items():
            p, other = together[symbol], t.shrunk[symbol]
            share = 1.0 - (own.std / p.prior_std) ** 2 if p.prior_std > 0.0 else 0.0
            values = (
                vehicle, runs.model.plane, t.trial, t.date, symbol, p.unit, own.value, own.std,
                other.value, other.std, p.value, p.std, p.prior, p.prior_std,
                min(max(share, 0.0), 1.0), p.share, p.between_std, t.used,
            )  # fmt: skip
            rows.append(dict(zip(COEFFICIENT_COLUMNS, values, strict=True)))
    return rows


def _effect_rows(vehicle: str, runs: PooledRuns) -> list[dict[str, Any]]:
    """Effects that the model of a trial has by name: its own, and those of the vehicle."""
    rows = []
    for t in runs.model.pooling.trials:
        for name, value in t.own.items():
            effect, _, parameter = name.partition(".")
            head = (vehicle, runs.model.plane, t.trial, t.date)
            values = (*head, effect, parameter, value.value, value.std, value.unit)
            rows.append(dict(zip(EFFECT_COLUMNS, values, strict=True)))
    return rows


def refuse_changes(result: CampaignResult) -> None:
    """The gate of ``--fail-on-change``.

    Raises
    ------
    GateError
        A vehicle changed, with what; or its last trial fits no other.
    """
    told = [
        f"{v.title}: {text}" for v in result.vehicles if v.changes for text in alarms(v.changes)
    ]
    if told:
        raise GateError("; ".join(told), "", "See the campaign page.")


def refuse_empty(trials: Sequence[PlannedTrial]) -> None:
    """Refuse a campaign without a trial."""
    if not trials:
        raise UsageError("there is no trial", "", "Give a campaign file or folders of trials.")


def refuse_among_logs(plan: CampaignPlan) -> None:
    """Refuse an output in which the run of a trial would stand in the folder of its log.

    Raises
    ------
    UsageError
    """
    for trial in plan.trials:
        if plan.run_of(trial).resolve() == trial.log.resolve():
            raise UsageError(
                f"the run of {_key(trial)} would stand in the folder of its log",
                str(plan.output),
                "Give another folder to --output.",
            )
