"""Which stages are done, stale, missing or not needed, and why: hashes decide, not times."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from auvident import __version__
from auvident.pipeline.given import fits, matching
from auvident.pipeline.log_changes import other_log
from auvident.pipeline.planes import planes_of
from auvident.pipeline.remedies import again
from auvident.pipeline.table import BY_NAME, STAGES, Stage, before
from auvident.schema.manifest import Manifest, StageEntry
from auvident.schema.planes import PLANES, Plane
from auvident.storage.artifacts import sha256_of
from auvident.storage.run_directory import PACKAGE, RunDirectory

State = Literal["done", "stale", "missing", "not needed"]


@dataclass(frozen=True)
class Decision:
    """State of a stage with the reason in half a sentence (empty when done)."""

    stage: str
    state: State
    reason: str = ""

    @property
    def sentence(self) -> str:
        """What `auvident run` prints before it runs or skips the stage."""
        if self.state == "done":
            return f"{self.stage}: up to date"
        if self.state == "missing":
            return f"{self.stage}: first run"
        return f"{self.stage}: runs again because {self.reason}"


@dataclass(frozen=True)
class Wanted:
    """What a stage would be run with; compared with what it was run with."""

    options: Mapping[str, Any]
    sources: Mapping[str, str]
    seed: int | None = None


def judge(
    stage: Stage, run: RunDirectory, manifest: Manifest | None, wanted: Wanted | None = None
) -> Decision:
    """State of one stage by itself; stages before it are taken as they are.

    Parameters
    ----------
    stage : Stage
    run : RunDirectory
    manifest : Manifest or None
    wanted : Wanted, optional
        Options and sources of a new run; without it those of the last run hold, and logs that
        can no longer be found do not make the stage stale, unless only some of them are gone.
    """
    entry = manifest.stages.get(stage.name) if manifest else None
    if entry is None or manifest is None:
        return Decision(stage.name, "missing", "it has not been run")
    reason = (
        _program(entry)
        or (_options(entry, wanted) if wanted else "")
        or _sources(stage, entry, run, wanted)
        or _inputs(stage, entry, run, manifest)
        or _outputs(entry, run)
    )
    return Decision(stage.name, "stale" if reason else "done", reason)


def is_of_this_run(stage: Stage, run: RunDirectory, manifest: Manifest) -> bool:
    """Whether the outputs of a stage were made from what the run has now.

    Another version of the program may have made them: what a run ended with stays its result.
    """
    entry = manifest.stages.get(stage.name)
    return bool(entry and not _inputs(stage, entry, run, manifest) and not _outputs(entry, run))


def _program(entry: StageEntry) -> str:
    if entry.program_version == __version__:
        return ""
    return f"the program changed from {entry.program_version} to {__version__}"


def _options(entry: StageEntry, wanted: Wanted) -> str:
    for key, value in wanted.options.items():
        old, new = _spelled(entry.options.get(key)), _spelled(value)
        if old != new:
            return f"option {key} changed from {old} to {new}"
    if wanted.seed is not None and wanted.seed != entry.seed:
        return f"option seed changed from {_spelled(entry.seed)} to {wanted.seed}"
    return ""


def _spelled(value: Any) -> str:
    """An option as a sentence names it."""
    if value is None or value == () or value == []:
        return "none"
    return ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)


def sources_of(stage: Stage, entry: StageEntry) -> dict[str, str]:
    """Hashes of the files that a stage read from outside, named as by `RunDirectory`."""
    files = {name: h for name, h in entry.inputs.items() if not fits(name, stage.reads)}
    return files | {PACKAGE + name: h for name, h in entry.program_files.items()}


def _sources(stage: Stage, entry: StageEntry, run: RunDirectory, wanted: Wanted | None) -> str:
    sources = sources_of(stage, entry)
    if wanted is not None:
        return _difference(sources, wanted.sources)
    for name, old in sources.items():
        now = sha256_of(run.located(name))
        if now is not None and now != old:
            return f"{_shown(name)} changed"
    name, how = other_log(entry, run) if stage.name == "ingest" else ("", "")
    return f"{_shown(name)} {how}" if name else ""


def _inputs(stage: Stage, entry: StageEntry, run: RunDirectory, manifest: Manifest) -> str:
    old = {name: h for name, h in entry.inputs.items() if fits(name, stage.reads)}
    names = matching(manifest, stage.reads)
    return _difference(old, {name: run.sha256(name) or "" for name in names})


def _outputs(entry: StageEntry, run: RunDirectory) -> str:
    for name, old in entry.outputs.items():
        now = run.sha256(name)
        if run.link_on_the_way(name):
            return f"{name} is reached through a symbolic link"
        if now != old:
            return f"{name} {'is missing' if now is None else 'was changed after it was written'}"
    return ""


def _difference(old: Mapping[str, str], new: Mapping[str, str]) -> str:
    """The first difference between two sets of files with their hashes."""
    for name in new:
        if name not in old:
            return f"{_shown(name)} is new"
    for name, digest in old.items():
        if name not in new:
            return f"{_shown(name)} is no longer used"
        if not new[name]:
            return f"{_shown(name)} is missing"
        if new[name] != digest:
            return f"{_shown(name)} changed"
    return ""


def _shown(name: str) -> str:
    """A file as a sentence names it: artifacts by path, files elsewhere by folder and name."""
    parts = [p for p in Path(name.removeprefix(PACKAGE)).parts if p not in ("..", "/")]
    return "/".join(parts[-2:])


def judge_all(run: RunDirectory, manifest: Manifest | None) -> list[Decision]:
    """State of every stage; a stage that rests on a stale one is stale."""
    decisions: dict[str, Decision] = {}
    for stage in STAGES:
        decision = judge(stage, run, manifest)
        broken = [s for s in before(stage.name) if decisions[s.name].state != "done"]
        if broken and decision.state != "missing":
            first = decisions[broken[0].name]
            decision = Decision(stage.name, "stale", f"{first.stage} is {first.state}")
        if stage.needs_both and not broken:
            decision = in_planes(stage, decision, planes_of(run))
        decisions[stage.name] = decision
    return list(decisions.values())


def in_planes(stage: Stage, decision: Decision, planes: Sequence[Plane]) -> Decision:
    """State of a stage in a run of these planes: one of both is not missing where there is one."""
    if stage.needs_both and len(planes) < len(PLANES) and decision.state == "missing":
        return Decision(stage.name, "not needed", "the run has one plane")
    return decision


def first_broken(name: str, run: RunDirectory, manifest: Manifest | None) -> Decision | None:
    """The first stage before `name` that must run again, or None."""
    needed = {stage.name for stage in before(name)}
    decisions = (judge(BY_NAME[s.name], run, manifest) for s in STAGES if s.name in needed)
    return next((d for d in decisions if d.state != "done"), None)


def outdated(path: Path) -> str:
    """What the model of a run does not rest on any more: sentences, empty where all is as it was.

    For commands that take a model as it is.
    """
    run = RunDirectory(path)
    manifest = run.existing()
    since, unrefined = _changed_since(run, manifest), _not_refined(run, manifest)
    told = [f"{since} since its model was identified"] if since else []
    if unrefined:
        why = f": {unrefined}" if unrefined != since else ""
        told.append(f"the identified model is taken in place of the refined one{why}")
    return f"{path}: {'; '.join(told)}. `{again(path)}` makes it again." if told else ""


def _changed_since(run: RunDirectory, manifest: Manifest) -> str:
    """What changed since the model was identified.

    An artifact that is gone says nothing against it, nor does another version of the program.
    """
    for stage in (*before("identify"), BY_NAME["identify"]):
        entry = manifest.stages.get(stage.name)
        if entry is None:
            continue
        inputs = _inputs(stage, entry, run, manifest)
        kept = "" if inputs.endswith(" is missing") else inputs
        reason = _sources(stage, entry, run, None) or kept
        if reason:
            return reason
    return ""


def _not_refined(run: RunDirectory, manifest: Manifest) -> str:
    """Why the refined model, where there was one, is not the one that is taken."""
    stage = BY_NAME["refine"]
    entry = manifest.stages.get(stage.name)
    return _inputs(stage, entry, run, manifest) or _outputs(entry, run) if entry else ""
