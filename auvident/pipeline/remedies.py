"""What to type where an artifact is missing, stale or damaged."""

import shlex
from pathlib import Path

from auvident.schema.manifest import Manifest
from auvident.storage.run_directory import MANIFEST, RunDirectory

WRITTEN = "Give a model.json that auvident has written."
COMBINE = "`auvident combine RUN... --output FILE.json` makes one of run directories."


def typed(path: Path | str) -> str:
    """A path as it is typed on the command line."""
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
    """The command that runs a stage."""
    path = typed(run.path)
    if stage != "ingest":
        return f"auvident {stage} {path}"
    entry = manifest.stages.get("ingest") if manifest else None
    if entry is None:
        return f"auvident ingest LOG... --vehicle V.toml --run {path}"
    logs = " ".join(typed(run.located(name)) for name in entry.options["logs"])
    column_map = entry.options.get("map")
    also = f" --map {typed(run.located(column_map))}" if column_map else ""
    vehicle = typed(run.located(entry.options["vehicle"]))
    return f"auvident ingest {logs} --vehicle {vehicle}{also} --run {path}"
