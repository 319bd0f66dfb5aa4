"""What to type where an artifact is missing, stale or damaged."""

import shlex
from collections.abc import Iterator
from pathlib import Path

from auvident.schema.manifest import Manifest, StageEntry
from auvident.storage.run_directory import MANIFEST, RunDirectory

FLAGS = {
    "map": "--map",
    "rate_hz": "--rate",
    "max_gap_s": "--max-gap",
    "allow_outside": "--allow-outside",
    "filter": "--filter",
    "engine": "--engine",
    "plane": "--plane",
    "plan": "--plan",
    "fix": "--fix",
    "hold_out": "--hold-out",
    "with_unexplained": "--with-unexplained",
}
WRITTEN = "Give a model.json that auvident has written."
COMBINE = "`auvident combine RUN... --output FILE.json` makes one of run directories."


def typed(path: Path | str | float) -> str:
    """A path or value as it is typed on the command line."""
    return shlex.quote(str(path))


def again(run: Path) -> str:
    """The command that makes what a run lacks, with the options of its last run."""
    return f"auvident run --run {typed(run)}"


def made_again(file: Path, elsewhere: str = WRITTEN) -> str:
    """What to do about an artifact that is missing or damaged.

    Parameters
    ----------
    file : Path
    elsewhere : str
        The same for a file that stands in no run directory.
    """
    run = run_around(file)
    return f"`{again(run)}` makes it again." if run else elsewhere


def run_around(file: Path) -> Path | None:
    """The run directory that an artifact stands in, named as the file is where that tells it."""
    # one more above the model of a second plane
    folders = [*file.parents[1:3], *file.resolve().parents[1:3]]
    return next((folder for folder in folders if (folder / MANIFEST).exists()), None)


def command_of(stage: str, run: RunDirectory, manifest: Manifest | None) -> str:
    """The command that runs a stage, with the options that it was last run with."""
    path = typed(run.path)
    entry = manifest.stages.get(stage) if manifest else None
    if stage != "ingest":
        return " ".join([f"auvident {stage} {path}", *(_options_of(stage, run, entry))])
    if entry is None:
        return f"auvident ingest LOG... --vehicle V.toml --run {path}"
    logs = [typed(run.located(name)) for name in entry.options["logs"]]
    vehicle = typed(run.located(entry.options["vehicle"]))
    words = ["auvident ingest", *logs, "--vehicle", vehicle, *_options_of(stage, run, entry)]
    return " ".join([*words, "--run", path])


def _options_of(stage: str, run: RunDirectory, entry: StageEntry | None) -> Iterator[str]:
    """Words of the options of a stage that are not the usual ones."""
    from auvident.pipeline.table import BY_NAME

    usual = BY_NAME[stage]
    for key, value in (entry.options if entry else {}).items():
        is_usual = value is None or value is False or value in ([], usual.options.get(key))
        if key not in FLAGS or is_usual:
            continue
        for one in value if isinstance(value, list) else [value]:
            place = run.located(one) if key in usual.paths else None
            named = place if place is not None and place.exists() else one
            yield FLAGS[key] if one is True else f"{FLAGS[key]} {typed(named)}"
