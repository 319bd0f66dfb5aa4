"""One stage executed: called, here or by the helper, and its outputs written."""

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from auvident import __version__
from auvident.errors import AuvidentError, InputError, NumericsError
from auvident.parallel import one_blas_thread
from auvident.pipeline.freshness import Wanted, judge
from auvident.pipeline.given import Given, matching
from auvident.pipeline.observer import Observer
from auvident.pipeline.planes import called, planes_of, wanted_planes
from auvident.pipeline.remedies import again
from auvident.pipeline.table import BY_NAME, STAGES, Outputs, Stage
from auvident.schema.manifest import FailedAttempt, Manifest, StageEntry
from auvident.schema.planes import Plane
from auvident.schema.trial import Columns
from auvident.storage.artifacts import json_bytes, parquet_bytes
from auvident.storage.run_directory import PACKAGE, RunDirectory
from auvident.versions import libraries

if TYPE_CHECKING:
    import pandas as pd

# Stages of several runs in the threads of one process wait for each other: the number of threads
# of linear algebra is one for the whole process, and the first to leave would undo it for all.
_ONE_AT_A_TIME = threading.Lock()


@dataclass(frozen=True)
class Executed:
    """What a stage came to: its artifacts, the content of their files, what it leaves to others."""

    outputs: Outputs
    content: Mapping[str, bytes]
    kept: Mapping[tuple[str, Plane | None], Any]
    seconds: float
    ended: str


@dataclass(frozen=True)
class Execution:
    """A stage that has begun: what it is given, and what its entry in the manifest says."""

    stage: Stage
    wanted: Wanted
    given: Given
    inputs: Mapping[str, str]
    started: str

    @classmethod
    def begun(
        cls, stage: Stage, wanted: Wanted, options: Mapping[str, Any], given: Given
    ) -> "Execution":
        """Announce a stage, and look up what it is given.

        Parameters
        ----------
        stage : Stage
        wanted : Wanted
        options : mapping
            Those given; others have their defaults.
        given : Given
            The run, its manifest, who watches and who helps.
        """
        started = _now()
        given.observer.started(stage.name)
        former = given.manifest.stages.get(stage.name) if given.manifest else None
        wanted = _with_seed(stage, wanted, former)
        names = matching(given.manifest, stage.reads)
        inputs = {name: given.run.sha256(name) or "" for name in names}
        full = {**stage.options, **options}
        given = replace(given, options=full, seed=wanted.seed or 0, also=_also(stage, given))
        given = replace(given, planes=_planes(stage, given))
        return cls(stage, wanted, given, inputs, started)

    def here(self) -> Executed:
        """Call the stage; a failure is noted."""
        return self._noting(lambda: make(self.stage, self.given))

    def beside(self) -> Callable[[], Executed]:
        """Have the helper call the stage; what waits for the result notes a failure."""
        g = self.given
        order = self.stage.name, g.run.path, g.options, g.seed, g.also, g.planes
        made = g.helper.begin(make_from_files, *order, observer=g.observer)
        return lambda: self._noting(made)

    def _noting(self, made: Callable[[], Executed]) -> Executed:
        try:
            return made()
        except (InputError, NumericsError) as error:
            # logs that are refused leave no trace
            if self.stage.after or isinstance(error, NumericsError):
                _record_failure(self.stage, self.given.run, self.wanted, error)
            raise

    def conclude(self, made: Executed) -> Outputs:
        """Write what is to come into the manifest, then the outputs, then the entry."""
        run, name, given = self.given.run, self.stage.name, self.given
        given.kept.update(made.kept)
        # another stage may have come to its end meanwhile
        manifest = run.manifest() or Manifest(program_version=__version__, created_at=self.started)
        manifest = _announce(run, manifest, name, made.content)
        run.commit(made.content, manifest.own(name))
        entry = _entry(self.wanted, self.inputs, self.started, made.ended).model_copy(
            update={
                "outputs": {file: run.sha256(file) or "" for file in made.content},
                "outcome": "done_with_findings" if _has_findings(made.outputs.values()) else "done",
            }
        )
        run.save(_with(manifest, name, entry))
        given.observer.finished(name, made.outputs, made.seconds)
        return made.outputs


def make(stage: Stage, given: Given) -> Executed:
    """The artifacts of a stage, and the content of their files."""
    clock = time.perf_counter()
    with _ONE_AT_A_TIME, one_blas_thread():
        outputs = called(stage, given)
    content = {name: _bytes(name, artifact) for name, artifact in outputs.items()}
    return Executed(outputs, content, given.kept, time.perf_counter() - clock, _now())


def make_from_files(
    name: str,
    path: Path,
    options: Mapping[str, Any],
    seed: int,
    also: frozenset[str],
    planes: tuple[Plane, ...],
    observer: Observer,
) -> Executed:
    """As `make`, of a process that knows no more than where the run directory is."""
    run = RunDirectory(path)
    given = Given(run, run.manifest(), options, seed, observer, also, planes)
    return make(BY_NAME[name], given)


def _also(stage: Stage, given: Given) -> frozenset[str]:
    """Stages that a stage shows where they are up to date; of one that is stale it is said."""
    decisions = [judge(BY_NAME[name], given.run, given.manifest) for name in stage.also]
    for stale in (d for d in decisions if d.state == "stale"):
        given.observer.note(
            f"{stage.name} does without {stale.stage}, which is stale: {stale.reason}. "
            f"`{again(given.run.path)}` makes it again."
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


def _entry(wanted: Wanted, inputs: Mapping[str, str], started: str, ended: str) -> StageEntry:
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
        ended_at=ended,
    )


def _with(manifest: Manifest, name: str, entry: StageEntry) -> Manifest:
    """The manifest with one stage done, stages in the order of the table."""
    stages = {**manifest.stages, name: entry}
    ordered = {s.name: stages.pop(s.name) for s in STAGES if s.name in stages} | stages
    failed = {key: attempt for key, attempt in manifest.failed.items() if key != name}
    writing = {key: names for key, names in manifest.writing.items() if key != name}
    done = {"stages": ordered, "failed": failed, "writing": writing}
    return manifest.model_copy(update={**done, "program_version": __version__})


def _record_failure(stage: Stage, run: RunDirectory, wanted: Wanted, error: AuvidentError) -> None:
    """Note why a stage failed; the artifacts of an earlier success stay."""
    manifest = run.manifest()
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


def _marks(table: "pd.DataFrame | Columns") -> dict[str, str]:
    """What a stage says of a table as a whole."""
    said = {} if isinstance(table, Mapping) else table.attrs
    return {str(key): str(value) for key, value in said.items()}


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
