"""What a command came to, read back from the run directory: for CI systems and pull requests."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from auvident.errors import (
    BUG_EXIT_CODE,
    AuvidentError,
    GateError,
    InputError,
    InUseError,
    UsageError,
)
from auvident.pipeline.freshness import Decision, judge_all
from auvident.pipeline.given import Given
from auvident.pipeline.planes import planes_of
from auvident.pipeline.reporting import REJECTED
from auvident.pipeline.table import BY_NAME, STAGES, before
from auvident.report.loop_words import place
from auvident.schema.artifacts import Finding
from auvident.schema.manifest import Manifest, StageEntry
from auvident.schema.outcome import (
    CaseResult,
    CommandOutcome,
    GateResult,
    HeldOutError,
    PlaneOutcome,
    ResultCase,
    Severity,
    severity,
)
from auvident.schema.prior_errors import pooled_by_prior
from auvident.storage.artifacts import read_json
from auvident.storage.run_directory import RunDirectory

if TYPE_CHECKING:
    from auvident.schema.artifacts import ChannelMetrics, Metrics
    from auvident.schema.diagnosis import ChannelError, Comparison, EffectFound
    from auvident.schema.logs import CheckMade

LAST = STAGES[-1].name
ERRORS = {"validate", "refine"}  # stages with errors of held-out maneuvers
OF_CHECK: dict[str, CaseResult] = {
    "agrees": "passed",
    "contradicts": "failed",
    "untested": "skipped",
}
OF_FINDING: dict[Severity, CaseResult] = {"error": "failed", "warning": "passed", "note": "passed"}
OF_COMMAND = (UsageError, InUseError)  # no fault of a stage


def outcome_of(
    command: str,
    path: Path,
    until: str = LAST,
    error: Exception | None = None,
    gates: Sequence[GateResult] = (),
) -> CommandOutcome:
    """How a command on a run directory came out.

    Parameters
    ----------
    command : str
        As it is typed, without options.
    path : Path
        Run directory; it need not exist.
    until : str
        The last stage that the command is about; what does not lead to it is left out.
    error : exception, optional
        What ended the command.
    gates : sequence of GateResult

    Returns
    -------
    CommandOutcome
        With nothing but the error where the run directory cannot be read.
    """
    told = ended_with(command, error, gates)
    bare = replace(told, cases=(*_failure("command", command, error), *_of_gates(gates)))
    if isinstance(error, OF_COMMAND):
        return bare
    with suppress(AuvidentError, OSError):
        run = RunDirectory(path)
        manifest = run.manifest()
        leads = (
            {s.name for s in STAGES if until == LAST} | {s.name for s in before(until)} | {until}
        )
        decisions = [d for d in judge_all(run, manifest) if d.stage in leads or _tells(d, until)]
        return _with_run(told, Given(run, manifest), decisions, error)
    return bare


def _tells(decision: Decision, until: str) -> bool:
    """Whether a stage that a command does not rest on has errors that belong to its result."""
    return (decision.stage, decision.state, until) == ("validate", "done", "refine")


def compared(
    command: str,
    comparison: Mapping[str, Any],
    gates: Sequence[GateResult] = (),
    error: Exception | None = None,
) -> CommandOutcome:
    """How several runs stand side by side; see `outcome_of` and `compare.compare_runs`."""
    told = ended_with(command, error, gates)
    tables = [comparison, *comparison.get("planes", {}).values()] if comparison else []
    failure = [] if isinstance(error, GateError) else _failure("command", command, error)
    return replace(told, cases=(*failure, *_of_gates(gates)), compared=tables)


def ended_with(
    command: str, error: Exception | None, gates: Sequence[GateResult] = ()
) -> CommandOutcome:
    """How a command ended, without what it left."""
    now = datetime.now(UTC).isoformat(timespec="seconds")
    told = CommandOutcome(command, at=now, gates=tuple(gates))
    if error is None:
        return told
    if isinstance(error, AuvidentError):
        problem, where, remedy = error.problem, error.where, error.remedy
        return replace(told, problem=problem, where=where, remedy=remedy, exit_code=error.exit_code)
    if isinstance(error, OSError):  # what the system refused
        problem = f"cannot be used: {error.strerror}"
        where = str(error.filename or "")
        return replace(told, problem=problem, where=where, exit_code=InputError.exit_code)
    text = f"unexpected {type(error).__name__}: {error}"
    return replace(told, problem=text, exit_code=BUG_EXIT_CODE)


def _with_run(
    told: CommandOutcome, given: Given, decisions: Sequence[Decision], error: Exception | None
) -> CommandOutcome:
    """The same with what stands in the run directory and is up to date."""
    broken = _broken(decisions, given.manifest, error)
    decisions = [_after_failure(d, broken) for d in decisions] if broken else decisions
    done = frozenset(d.stage for d in decisions if d.state == "done")
    if "identify" in done:
        given = replace(given, planes=planes_of(given.run))
    checks = list(_checks(given)) if "ingest" in done else []
    said = {made.message for _, made in checks if made.outcome == "contradicts"}
    findings = [f for f in _findings(given, done) if f.message not in said]
    cases = [
        *([] if broken else _failure("command", told.command, error)),
        *(_of_stage(d, given.manifest, error if d.stage == broken else None) for d in decisions),
        *_distinct(_of_check(trial, made) for trial, made in checks),
        *_distinct(_of_finding(f) for f in findings),
        *_of_gates(told.gates),
    ]
    return replace(
        told,
        vehicle=given.quality.vehicle if "ingest" in done else "",
        report=str(given.run / BY_NAME[LAST].main) if LAST in done else "",
        planes=[_plane(view, done) for view in given.views()] if done & ERRORS else [],
        findings=findings,
        cases=cases,
    )


def _broken(
    decisions: Sequence[Decision], manifest: Manifest | None, error: Exception | None
) -> str:
    """The stage that an error ended; empty where it is the fault of none."""
    if error is None or isinstance(error, GateError):
        return ""
    failed = manifest.failed if manifest else {}
    noted = (s for s, attempt in failed.items() if attempt.problem == str(error.args[0]))
    return next(noted, next((d.stage for d in decisions if d.state in ("missing", "stale")), ""))


def _after_failure(decision: Decision, broken: str) -> Decision:
    """What an earlier run left of a stage that failed now is not told, nor what rests on it."""
    if decision.stage != broken and BY_NAME[broken] not in before(decision.stage):
        return decision
    return Decision(decision.stage, "stale", f"{broken} failed")


def _failure(group: str, name: str, error: Exception | None) -> list[ResultCase]:
    """The case of an error that ended a command; none for a gate, which is a case of its own."""
    if error is None or isinstance(error, GateError):
        return []
    told = ended_with(name, error)
    kind = type(error).__name__
    return [ResultCase(group, name, "error", told.problem, str(error), kind)]


def _of_stage(decision: Decision, manifest: Manifest | None, error: Exception | None) -> ResultCase:
    name = decision.stage
    if error is not None:
        return _failure("stages", name, error)[0]
    entry = manifest.stages.get(name) if manifest else None
    if decision.state == "done" and entry is not None:
        return ResultCase("stages", name, seconds=_seconds(entry))
    return ResultCase("stages", name, "skipped", f"{decision.state}: {decision.reason}")


def _seconds(entry: StageEntry) -> float:
    started, ended = (datetime.fromisoformat(at) for at in (entry.started_at, entry.ended_at))
    return max((ended - started).total_seconds(), 0.0)


def _checks(given: Given) -> "Iterator[tuple[str, CheckMade]]":
    for trial in given.quality.trials:
        yield from ((trial.trial, made) for made in trial.checks_made)


def _of_check(trial: str, made: "CheckMade") -> ResultCase:
    name = f"{trial}: {made.what} against {made.against}" if made.against else made.what
    text = f"{made.message}\n{made.remedy}" if made.remedy else made.message
    return ResultCase("checks", name, OF_CHECK[made.outcome], made.message, text, made.name)


def _findings(given: Given, done: frozenset[str]) -> Iterator[Finding]:
    """Findings on what the run ends with; those on a model that was superseded are left out."""
    if "ingest" in done:
        several = len(given.quality.trials) > 1
        for trial in given.quality.trials:
            yield from (_placed(f, trial.trial if several else "") for f in trial.findings)
        yield from given.quality.findings
    if "segment" in done:
        rejected = read_json(given.run / REJECTED, given.remedy(REJECTED))
        yield from (Finding.model_validate(f) for f in rejected["findings"])
    if "ase" in done:
        yield from given.ase.findings
    for view in given.views() if "identify" in done else ():
        of = str(view.plane) if view.is_beside else ""
        yield from (_placed(f, of) for f in _of_model(view, done))


def _of_model(view: Given, done: frozenset[str]) -> Iterator[Finding]:
    if _is_refined(view, done):
        yield from (*view.refined.findings, *view.comparison.findings)
        return
    yield from view.model.findings
    yield from view.metrics.findings if "validate" in done else ()
    yield from view.diagnosis.findings if "diagnose" in done else ()


def _is_refined(view: Given, done: frozenset[str]) -> bool:
    return "refine" in done and view.has("refine/comparison.json")


def _placed(finding: Finding, of: str) -> Finding:
    """A finding with the trial or plane that it is of."""
    where = ", ".join(part for part in (of, finding.where) if part)
    return finding.model_copy(update={"where": where})


def _of_finding(finding: Finding) -> ResultCase:
    name = f"{finding.code}: {finding.where}" if finding.where else finding.code
    how = severity(finding)
    text = f"{how}: {finding.message}\n{finding.remedy}".rstrip()
    return ResultCase("findings", name, OF_FINDING[how], finding.message, text, finding.code)


def _distinct(cases: Iterator[ResultCase]) -> Iterator[ResultCase]:
    """Cases with a number behind the name where several have the same."""
    seen: dict[str, int] = {}
    for case in cases:
        seen[case.name] = seen.get(case.name, 0) + 1
        number = seen[case.name]
        yield case if number == 1 else replace(case, name=f"{case.name} ({number})")


def _of_gates(gates: Sequence[GateResult]) -> Iterator[ResultCase]:
    for gate in gates:
        limit = "" if gate.limit is None else f" at most {gate.limit:.4g} {gate.unit}".rstrip()
        name = f"RMSE of {gate.channel}{limit}" if gate.channel else "comparison"
        name = f"{gate.of}: {name}" if gate.of else name
        result: CaseResult = "failed" if gate.unmet else "passed"
        told = "" if gate.value is None else f"RMSE {gate.value:.4g} {gate.unit}"
        yield ResultCase("gates", name, result, gate.unmet, gate.unmet or told, "gate")


def _plane(view: Given, done: frozenset[str]) -> PlaneOutcome:
    """Verdict and errors of one plane, by what there is of validation and refinement."""
    metrics = view.metrics if "validate" in done else None
    refined = view.comparison if _is_refined(view, done) else None
    verdict = refined or (view.diagnosis if "diagnose" in done else None)
    maneuvers: Sequence[str] = refined.held_out.maneuvers if refined else ()
    if metrics:
        maneuvers = [m.id for m in metrics.maneuvers if m.role == "validate"]
    return PlaneOutcome(
        str(view.plane),
        verdict.statement if verdict else "",
        maneuvers,
        list(_errors(metrics, refined)),
        [_effect(e) for e in verdict.effects] if verdict else [],
    )


def _errors(metrics: "Metrics | None", refined: "Comparison | None") -> Iterator[HeldOutError]:
    """Errors of the held-out maneuvers: from geometry, identified, refined."""
    after = refined.held_out.after if refined and refined.added else {}
    covered = (refined.coverage if refined else {}) or (metrics.coverage if metrics else {})
    geometry = pooled_by_prior(metrics) if metrics else {}
    before: Mapping[str, ChannelMetrics | ChannelError] = refined.held_out.before if refined else {}
    if metrics:
        before = metrics.summary.get("validate", {})
    for channel, own in before.items():
        last = after.get(channel)
        yield HeldOutError(
            channel,
            own.unit,
            geometry[channel].rmse if channel in geometry else None,
            own.rmse,
            last.rmse if last else None,
            last.nrmse if last else own.nrmse,
            covered[channel].covered if channel in covered else None,
        )


def _effect(effect: "EffectFound") -> str:
    return " ".join(part for part in (f"{effect.id}:", effect.plain, place(effect)) if part)
