"""Run one stage, or all that are not up to date."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import zip_longest
from pathlib import Path
from typing import Any

from auvident.errors import AuvidentError, NumericsError, StageError
from auvident.pipeline.ahead import OF_INGEST, OF_REPORT, OF_STAGES, load
from auvident.pipeline.execution import Executed, Execution
from auvident.pipeline.freshness import Decision, Wanted, first_broken, in_planes, judge, judge_all
from auvident.pipeline.given import Given
from auvident.pipeline.helper import helping
from auvident.pipeline.observer import Observer
from auvident.pipeline.planes import asked_for, planes_of
from auvident.pipeline.remedies import command_of
from auvident.pipeline.reporting import figures_of_trials
from auvident.pipeline.steps import TRIALS_DRAWN
from auvident.pipeline.table import BY_NAME, STAGES, Outputs, Stage, before
from auvident.schema.manifest import Manifest
from auvident.schema.places import beside
from auvident.schema.planes import PLANES, Plane
from auvident.storage.artifacts import read_json, sha256_of
from auvident.storage.run_directory import MANIFEST, PACKAGE, RunDirectory

OPTIONAL = frozenset(BY_NAME["report"].also)  # a run goes on when their numbers fail
NOT_RECORDED = frozenset({"interactive", "keep_going"})  # options that change no result
SILENT = Observer()
# Of the files of a log, up to which there is a second process: it holds the samples once more, and
# those of the samples have 3 to 4 MB.
MOST_BYTES_BESIDE = 2**25


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
        helped = stage.helped and _size_of_trials(run) <= MOST_BYTES_BESIDE
        if helped:
            load(OF_REPORT)
        with helping(helped) as helper:
            given = Given(run, manifest, observer=observer, helper=helper)
            execution = Execution.begun(stage, wanted, options or {}, given)
            return execution.conclude(execution.here())


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
    with run.lock(), helping() as helper:
        helper.begin(load, OF_INGEST)
        wanted = {s.name: _wanted(s, run, options.get(s.name, {}), seed) for s in STAGES}
        if _size_of_logs(run, wanted["ingest"]) > MOST_BYTES_BESIDE:
            helper.dismiss()
        planes = asked_for(str(wanted["identify"].options["plane"]))
        stages = _up_to(until)
        asked = [s for s in stages if not _left_out(s, planes, None)]
        _refuse_foreign(run, run.manifest(), asked)
        given = Given(run, observer=observer, helper=helper)
        _Progress(given, wanted, options, result, planes).through(stages)
        result.mains = _mains(run, {s.name: s.main for s in STAGES})
        besides = {s.name: beside(s.main) for s in STAGES if s.by_plane}
        result.beside = _mains(run, besides)
    return result


@dataclass
class _Progress:
    """How far `run_all` has got through the stages.

    ``pending`` is a stage that the helper works on while the next one, which does not rest on it,
    is done here; ``is_reported`` tells whether the run ends with a report.
    """

    given: Given
    wanted: Mapping[str, Wanted]
    options: Mapping[str, Mapping[str, Any]]
    result: RunResult
    planes: Sequence[Plane]
    pending: tuple[Execution, Callable[[], Executed]] | None = None
    is_reported: bool = False

    def through(self, stages: Sequence[Stage]) -> None:
        """Run the stages that are not up to date, in their order."""
        self.is_reported = BY_NAME["report"] in stages
        for stage, following in zip_longest(stages, stages[1:]):
            if self.pending and _rests_on(stage, self.pending[0].stage):
                self._settle()
            if self._is_to_run(stage):
                self._run(stage, following)
        self._settle()

    def _is_to_run(self, stage: Stage) -> bool:
        """Whether a stage is neither up to date nor left out; which of them it is, is told."""
        run, result = self.given.run, self.result
        decision = judge(stage, run, run.manifest(), self.wanted[stage.name])
        result.decisions.append(decision)
        if "identify" in stage.after:
            self.planes = planes_of(run)
        reason = _left_out(stage, self.planes, result.failure)
        if reason:
            self.given.observer.decided(stage.name, f"{stage.name}: skipped, {reason}")
            result.left_out.append(stage.name)
            result.decisions[-1] = in_planes(stage, decision, self.planes)
            return False
        self.given.observer.decided(stage.name, decision.sentence)
        return decision.state != "done"

    def _run(self, stage: Stage, following: Stage | None) -> None:
        """Run a stage, or have the helper do so where the following one can begin meanwhile."""
        given = replace(self.given, manifest=self.given.run.manifest())
        options = self.options.get(stage.name, {})
        execution = Execution.begun(stage, self.wanted[stage.name], options, given)
        alone = following is None or _rests_on(following, stage)
        if given.helper.is_beside and not alone:
            self.pending = execution, execution.beside()
            return
        try:
            made = self._made(execution)
        except AuvidentError as error:
            self._settle()
            if not isinstance(error, NumericsError) or stage.name not in OPTIONAL:
                raise
            self.result.failure = error
            self.result.left_out.append(stage.name)
            return
        self._settle()
        self.result.outputs |= execution.conclude(made)
        if not stage.after:
            given.helper.renew()  # with all that was loaded meanwhile

    def _made(self, execution: Execution) -> Executed:
        """What a stage comes to; who has nothing else to do loads what will be needed."""
        helper = self.given.helper
        if execution.stage.after or not helper.is_beside:
            if execution.stage.name == "refine" and helper.is_beside and self.is_reported:
                drawn = helper.begin(figures_of_trials, execution.given.run.path)
                execution.given.kept[TRIALS_DRAWN] = drawn
            return execution.here()
        made = execution.beside()
        load((*OF_STAGES, *(OF_REPORT if self.is_reported else ())))
        return made()

    def _settle(self) -> None:
        """Write what the helper was asked for."""
        if self.pending:
            (execution, made), self.pending = self.pending, None
            self.result.outputs |= execution.conclude(made())


def _rests_on(stage: Stage, other: Stage) -> bool:
    """Whether a stage reads what another one writes."""
    return other in before(stage.name) or other.name in stage.also


def _size_of_logs(run: RunDirectory, wanted: Wanted) -> int:
    """Bytes of the files that are read at first."""
    files = [run.located(name) for name in wanted.sources if not name.startswith(PACKAGE)]
    return sum(file.stat().st_size for file in files if file.is_file())


def _size_of_trials(run: RunDirectory) -> int:
    """Bytes of the trials of a run."""
    return sum(file.stat().st_size for file in run.path.glob("ingest/*.parquet"))


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
