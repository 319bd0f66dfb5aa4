"""Files that no result is written over: what the command reads, and what a run is made of."""

from pathlib import Path

from auvident.errors import AuvidentError, UsageError

MANIFEST = "run.json"
ELSEWHERE = "Give the name of another file."


def refuse_precious(target: Path | None, *read: Path | None) -> None:
    """Before any work: refuse to write a result over an input, or over an artifact of a run.

    Parameters
    ----------
    target : Path or None
        Where the result goes.
    *read : Path or None
        Files and folders of logs that the command reads; a run directory among them may hold
        other files, but no artifact is replaced.

    Raises
    ------
    UsageError
        Names the file.
    """
    if target is None or not target.is_file():
        return
    there = target.resolve()
    for source in filter(None, read):
        place = source.resolve()
        folder = place.is_dir() and not (place / MANIFEST).exists()
        if there == place or (folder and place in there.parents):
            raise UsageError(f"would be written over, and {source} is read", str(target), ELSEWHERE)
    for folder_above in there.parents:
        if (folder_above / MANIFEST).is_file() and _is_artifact(there, folder_above):
            raise UsageError(f"belongs to the run {folder_above.name}", str(target), ELSEWHERE)


def _is_artifact(file: Path, run: Path) -> bool:
    """Whether a run directory has the file from one of its stages."""
    from auvident.storage.run_directory import RunDirectory

    if file == run / MANIFEST:
        return True
    try:
        manifest = RunDirectory(run).manifest()
    except AuvidentError:  # no run of this program, or a damaged one
        return False
    stages = manifest.stages.values() if manifest else ()
    return any(str(file.relative_to(run)) in entry.outputs for entry in stages)
