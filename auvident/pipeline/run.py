"""Run one stage, or all that are not up to date."""

import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from auvident import __version__
from auvident.errors import AuvidentError, InputError, NumericsError, StageError
from auvident.parallel import one_blas_thread
from auvident.pipeline.freshness import Decision, Wanted, first_broken, in_planes, judge, judge_all
from auvident.pipeline.given import Given, matching
from auvident.pipeline.observer import Observer
from auvident.pipeline.planes import asked_for, called, planes_of, wanted_planes
from auvident.pipeline.remedies import again, command_of
from auvident.pipeline.table import BY_NAME, STAGES, Outputs, Stage
from auvident.schema.manifest import FailedAttempt, Manifest, StageEntry
from auvident.schema.places import beside
from auvident.schema.planes import PLANES, Plane
from auvident.storage.artifacts import json_bytes, parquet_bytes, read_json, sha256_of
from auvident.storage.run_directory import MANIFEST, PACKAGE, RunDirectory
from auvident.versions import libraries

if TYPE_CHECKING:
    import pandas as pd

OPTIONAL = frozenset(BY_NAME["report"].also)  # a run goes on when their numbers fail
NOT_RECORDED = frozenset({"interactive", "keep_going"})  # options that change no result
SILENT = Observer()
# Stages of several runs in the threads of one process wait for each other: the number of threads
# of linear algebra is one for the whole process, and the first to leave would undo it for all.
_ONE_AT_A_TIME = threading.Lock()


@dataclass
class RunResult:
    """What `run_all` did: a decision a stage, and the outputs of those that ran.

    ``mains`` is the content of the main artifact of each stage that has one, as it was when the
    run ended (None where it is no JSON): another process may have changed the files since;
    ``beside`` is the same of the plane that stands beside the first one, where there is one.
    ``left_out`` are stages that do not know the plane, or rest on one whose numbers failed;
    ``failure`` is that of a stage which the report can do without.
    """

    decisions: list[Decision] = field(default_factory=list)
    outputs: dict[str, Any] = field(default_factory=dict)
    mains: dict[str, Any] = field(default_factory=dict)
    beside: dict[str, Any] = field(default_factory=dict)
    left_out: list[str] = field(default_factory=list)
    failure: NumericsError | None = None


def run_stage(
    name: str,
    path: Path,
    options: Mapping[str, Any] | None = None,
    *,
    seed: int | None = None,
    observer: Observer = SILENT,
) -> Outputs:
    """Run one stage, whether or not it is up to date.

    Parameters
    ----------
    name : str
        A stage of the table.
    path : Path
        Run directory.
    options : mapping, optional
        Options of the stage; those left out have their defaults.
    seed : int, optional
        For a stage that draws; without it that of its last run, at first 0.
    observer : Observer

    Returns
    -------
    mapping
        The artifacts written, by path in the run directory.

    Raises
    ------
    StageError
        An earlier stage is missing or stale; names the command to run.
    """
    stage, run = BY_NAME[name], RunDirectory(path)
    if stage.after:
        run.existing()  # where there is no run, no directory is made for the lock
    with run.lock():
        manifest = run.existing() if stage.after else run.manifest()
        _refuse_broken(stage, run, manifest)
        _refuse_foreign(run, manifest, [stage])
        wanted = _wanted(stage, run, options or {}, seed)
        return _execute(stage, run, manifest, wanted, options or {}, observer)


def run_all(
    path: Path,
    options: Mapping[str, Mapping[str, Any]],
    *,
    seed: int | None = None,
    observer: Observer = SILENT,
    until: str | None = None,
) -> RunResult:
    """Run every stage that is not up to date, in the order of the table.

    Parameters
    ----------
    path : Path
        Run directory; a new one stays only once the logs have proved usable.
    options : mapping of str to mapping
        Options by stage.
    seed, observer
        As for `run_stage`.
    until : str, optional
        Last stage.

    Returns
    -------
    RunResult
        A failure of the numbers stops the run, except in a stage that the report only shows
        where it was run: then it is returned.
    """
    run, result = RunDirectory(path), RunResult()
    kept: dict[Any, Any] = {}
    with run.lock():
        wanted = {s.name: _wanted(s, run, options.get(s.name, {}), seed) for s in STAGES}
        planes = asked_for(str(wanted["identify"].options["plane"]))
        stages = _up_to(until)
        asked = [s for s in stages if not _left_out(s, planes, None)]
        _refuse_foreign(run, run.manifest(), asked)
        for stage in stages:
            manifest = run.manifest()
            decision = judge(stage, run, manifest, wanted[stage.name])
            result.decisions.append(decision)
            if "identify" in stage.after:
                planes = planes_of(run)
            reason = _left_out(stage, planes, result.failure)
            if reason:
                observer.decided(stage.name, f"{stage.name}: skipped, {reason}")
                result.left_out.append(stage.name)
                result.decisions[-1] = in_planes(stage, decision, planes)
                continue
            observer.decided(stage.name, decision.sentence)
            if decision.state == "done":
                continue
            try:
                result.outputs |= _execute(
                    stage,
                    run,
                    manifest,
                    wanted[stage.name],
                    options.get(stage.name, {}),
                    observer,
                    kept,
                )
            except NumericsError as error:
                if stage.name not in OPTIONAL:
                    raise
                result.failure = error
                result.left_out.append(stage.name)
        result.mains = _mains(run, {s.name: s.main for s in STAGES})
        besides = {s.name: beside(s.main) for s in STAGES if s.by_plane}
        result.beside = _mains(run, besides)
    return result


def _up_to(until: str | None) -> Sequence[Stage]:
    """Stages in their order, all without a last one."""
    return STAGES if until is None else STAGES[: STAGES.index(BY_NAME[until]) + 1]


def _mains(run: RunDirectory, names: Mapping[str, str]) -> dict[str, Any]:
    """Main artifacts by stage."""
    there = {stage: name for stage, name in names.items() if (run / name).exists()}
    return {s: read_json(run / name) if ".json" in name else None for s, name in there.items()}


def _refuse_foreign(run: RunDirectory, manifest: Manifest | None, stages: Sequence[Stage]) -> None:
    """Before any work: no output of the stages may stand where something foreign does."""
    run.refuse_link(MANIFEST)
    for stage in stages:
        run.refuse_foreign(stage.name, stage.writes, manifest.own(stage.name) if manifest else ())


def _left_out(stage: Stage, planes: Sequence[Plane], failure: NumericsError | None) -> str:
    """Why a run goes on without a stage; empty when it does not."""
    if not {*planes} & {*stage.planes}:
        return f"it covers only the {' and '.join(stage.planes)} plane"
    if stage.needs_both and len(planes) < len(PLANES):
        return "it needs both planes"
    rests_on_it = stage.name in OPTIONAL and OPTIONAL & {*stage.after}
    return "an earlier stage failed numerically" if failure and rests_on_it else ""


def up_to_date(
    path: Path,
    options: Mapping[str, Mapping[str, Any]],
    *,
    seed: int | None = None,
    until: str | None = None,
) -> bool:
    """Whether `run_all` with these options would skip every stage, or those up to `until`."""
    run = RunDirectory(path)
    manifest = run.manifest()
    if manifest is None:
        return False
    needed = {d.stage for d in judge_all(run, manifest) if d.state != "not needed"}
    wanted = [(s, _wanted(s, run, options.get(s.name, {}), seed)) for s in _up_to(until)]
    return all(judge(s, run, manifest, w).state == "done" for s, w in wanted if s.name in needed)


def status(path: Path) -> tuple[list[Decision], Manifest]:
    """State of every stage of an existing run directory, and its manifest."""
    run = RunDirectory(path)
    manifest = run.existing()
    return judge_all(run, manifest), manifest


def _refuse_broken(stage: Stage, run: RunDirectory, manifest: Manifest | None) -> None:
    broken = first_broken(stage.name, run, manifest)
    if broken is not None:
        raise StageError(
            f"{stage.name} needs {broken.stage}, which is {broken.state}: {broken.reason}",
            str(run.path),
            f"Run `{command_of(broken.stage, run, manifest)}` first.",
        )


def _wanted(
    stage: Stage, run: RunDirectory, options: Mapping[str, Any], seed: int | None
) -> Wanted:
    """Options with defaults, and the hashes of the sources; refuses unusable ones."""
    full = {**stage.options, **options}
    files = stage.sources(full)
    recorded = {
        key: _recorded(value, run if key in stage.paths else None)
        for key, value in full.items()
        if key not in NOT_RECORDED
    }
    return Wanted(
        recorded,
        {run.remembered(file): sha256_of(file) or "" for file in files},
        seed if stage.draws else None,
    )


def _recorded(value: Any, paths_of: RunDirectory | None) -> Any:
    """An option as JSON keeps it; paths as the run directory remembers them."""
    if isinstance(value, tuple | list):
        return [_recorded(item, paths_of) for item in value]
    if paths_of is None or value is None or not Path(value).exists():  # name of a built-in plan
        return value
    return paths_of.remembered(Path(value))


def _execute(
    stage: Stage,
    run: RunDirectory,
    manifest: Manifest | None,
    wanted: Wanted,
    options: Mapping[str, Any],
    observer: Observer,
    kept: dict[Any, Any] | None = None,
) -> Outputs:
    """Call a stage and write what it returns: what is to come, the outputs, then the entry."""
    started, clock = _now(), time.perf_counter()
    observer.started(stage.name)
    former = manifest.stages.get(stage.name) if manifest else None
    wanted = _with_seed(stage, wanted, former)
    inputs = {name: run.sha256(name) or "" for name in matching(manifest, stage.reads)}
    also = _also(stage, run, manifest, observer)
    given = Given(run, manifest, {**stage.options, **options}, wanted.seed or 0, observer, also)
    given = replace(given, planes=_planes(stage, given), kept={} if kept is None else kept)
    outputs, content = _call(stage, given, wanted)
    manifest = manifest or Manifest(program_version=__version__, created_at=started)
    manifest = _announce(run, manifest, stage.name, content)
    run.commit(content, manifest.own(stage.name))
    entry = _entry(wanted, inputs, started).model_copy(
        update={
            "outputs": {name: run.sha256(name) or "" for name in content},
            "outcome": "done_with_findings" if _has_findings(outputs.values()) else "done",
        }
    )
    run.save(_with(manifest, stage.name, entry))
    observer.finished(stage.name, outputs, time.perf_counter() - clock)
    return outputs


def _also(
    stage: Stage, run: RunDirectory, manifest: Manifest | None, observer: Observer
) -> frozenset[str]:
    """Stages that a stage shows where they are up to date; of one that is stale it is said."""
    decisions = [judge(BY_NAME[name], run, manifest) for name in stage.also]
    for stale in (d for d in decisions if d.state == "stale"):
        observer.note(
            f"{stage.name} does without {stale.stage}, which is stale: {stale.reason}. "
            f"`{again(run.path)}` makes it again."
        )
    return frozenset(d.stage for d in decisions if d.state == "done")


def _planes(stage: Stage, given: Given) -> tuple[Plane, ...]:
    """Planes that the run has once there are maneuvers."""
    if "plane" in stage.options:
        return wanted_planes(given.options["plane"], given.maneuvers.maneuvers)
    return planes_of(given.run) if {"identify", "validate", "diagnose"} & {*stage.after} else ()


def _announce(
    run: RunDirectory, manifest: Manifest, stage: str, outputs: Mapping[str, bytes]
) -> Manifest:
    """The manifest, saved, with outputs that are new to it: those of a killed run are then known.

    Raises
    ------
    UsageError
        Something that the stage has not written is in the way of one.
    """
    own = manifest.own(stage)
    run.refuse_foreign(stage, outputs, own)
    if outputs.keys() <= own:
        return manifest
    writing = {**manifest.writing, stage: tuple(sorted(own | outputs.keys()))}
    manifest = manifest.model_copy(update={"writing": writing})
    run.save(manifest)
    return manifest


def _with_seed(stage: Stage, wanted: Wanted, former: StageEntry | None) -> Wanted:
    """The seed of a stage that draws: as given, else that of its last run, else 0."""
    if not stage.draws or wanted.seed is not None:
        return wanted
    return replace(wanted, seed=former.seed if former and former.seed is not None else 0)


def _call(stage: Stage, given: Given, wanted: Wanted) -> tuple[Outputs, dict[str, bytes]]:
    """The artifacts of a stage, and the content of their files; a failure is noted."""
    try:
        with _ONE_AT_A_TIME, one_blas_thread():
            outputs = called(stage, given)
        return outputs, {name: _bytes(name, artifact) for name, artifact in outputs.items()}
    except (InputError, NumericsError) as error:
        if stage.after or isinstance(error, NumericsError):  # logs that are refused leave no trace
            _record_failure(stage, given.run, given.manifest, wanted, error)
        raise


def _entry(wanted: Wanted, inputs: Mapping[str, str], started: str) -> StageEntry:
    """What the manifest says of a stage that has just been called, still without outputs."""
    files = {k: h for k, h in wanted.sources.items() if not k.startswith(PACKAGE)}
    program = {k.removeprefix(PACKAGE): h for k, h in wanted.sources.items() if k not in files}
    return StageEntry(
        program_version=__version__,
        inputs={**inputs, **files},
        program_files=program,
        libraries=dict(libraries()),
        options=dict(wanted.options),
        outputs={},
        seed=wanted.seed,
        started_at=started,
        ended_at=_now(),
    )


def _with(manifest: Manifest, name: str, entry: StageEntry) -> Manifest:
    """The manifest with one stage done, stages in the order of the table."""
    stages = {**manifest.stages, name: entry}
    ordered = {s.name: stages.pop(s.name) for s in STAGES if s.name in stages} | stages
    failed = {key: attempt for key, attempt in manifest.failed.items() if key != name}
    writing = {key: names for key, names in manifest.writing.items() if key != name}
    done = {"stages": ordered, "failed": failed, "writing": writing}
    return manifest.model_copy(update={**done, "program_version": __version__})


def _record_failure(
    stage: Stage,
    run: RunDirectory,
    manifest: Manifest | None,
    wanted: Wanted,
    error: AuvidentError,
) -> None:
    """Note why a stage failed; the artifacts of an earlier success stay."""
    if manifest is None:
        return
    attempt = FailedAttempt(
        at=_now(),
        problem=error.problem,
        where=error.where,
        remedy=error.remedy,
        exit_code=error.exit_code,
        options=dict(wanted.options),
    )
    failed = {**manifest.failed, stage.name: attempt}
    run.save(manifest.model_copy(update={"failed": failed}))


def _marks(table: "pd.DataFrame") -> dict[str, str]:
    """What a stage says of a table as a whole."""
    return {str(key): str(value) for key, value in table.attrs.items()}


def _bytes(name: str, artifact: "Any | pd.DataFrame") -> bytes:
    """Content of a file by the end of its name."""
    if name.endswith(".parquet"):
        return parquet_bytes(artifact, {"program": f"auvident {__version__}", **_marks(artifact)})
    if name.endswith(".json"):
        return json_bytes(artifact, name)
    return artifact if isinstance(artifact, bytes) else str(artifact).encode()


def _has_findings(artifacts: Any) -> bool:
    return any(_findings(artifact) for artifact in artifacts)


def _findings(artifact: Any) -> Sequence[Any]:
    if isinstance(artifact, Mapping):
        return artifact.get("findings", ())
    return getattr(artifact, "findings", ()) if not hasattr(artifact, "columns") else ()


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds")


def last_options(path: Path) -> dict[str, dict[str, Any]]:
    """Options that every stage was last run with, paths as they are found from here."""
    run = RunDirectory(path)
    found: dict[str, dict[str, Any]] = {}
    for name, entry in run.existing().stages.items():
        paths = BY_NAME[name].paths if name in BY_NAME else ()
        found[name] = {
            key: _located(value, run) if key in paths else value
            for key, value in entry.options.items()
        }
    return found


def _located(value: Any, run: RunDirectory) -> Any:
    if isinstance(value, list):
        return [run.located(item) for item in value]
    if value is None or not run.located(value).exists():
        return value
    return run.located(value)
