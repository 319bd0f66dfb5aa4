"""Whether the logs of a run are still the files that it was made from."""

import os
from collections.abc import Collection
from pathlib import Path

from auvident.errors import InputError
from auvident.schema.manifest import StageEntry
from auvident.storage.run_directory import RunDirectory

MAX_DEPTH = 4  # folders below a log in which files are looked for, as `find_trials` does
# Of files that often lie beside logs and never are one; any other that is new is looked at.
NO_LOG = (".md", ".toml", ".json", ".py", ".html", ".pdf", ".png", ".jpg", ".jpeg")


def other_log(entry: StageEntry, run: RunDirectory) -> tuple[str, str]:
    """A log file that came since ingest or went away, and how; empty where there is none.

    Parameters
    ----------
    entry : StageEntry
        Of ingest.
    run : RunDirectory

    Returns
    -------
    name, how : str
        The name as the run remembers it, and ``is new`` or ``is missing``. Nothing is said
        where a log is gone as it was given: a run need not keep its logs.
    """
    given = [Path(os.path.abspath(run.located(name))) for name in entry.options.get("logs", ())]
    if not given or not all(log.exists() for log in given):
        return "", ""
    known = {os.path.abspath(run.located(name)): name for name in entry.inputs}
    others = (entry.options.get("vehicle"), entry.options.get("map"))
    places = set(given)
    inside = [f for f in known if places & {Path(f), *Path(f).parents}]
    logs = [file for file in inside if known[file] not in others]
    gone = [file for file in logs if not os.path.exists(file)]
    if len(gone) == len(logs):
        return "", ""
    if gone:
        return known[gone[0]], "is missing"
    if any(_has_other(log, known, MAX_DEPTH) for log in given if log.is_dir()):
        return next(((n, "is new") for n in _found(entry, run) if n not in entry.inputs), ("", ""))
    return "", ""


def _has_other(folder: Path, known: Collection[str], depth: int) -> bool:
    """Whether a folder has a file that may be a log and was not read; none is opened for it."""
    try:
        inside = [e for e in os.scandir(folder) if not e.name.startswith(".")]
    except OSError:
        return False
    below = [Path(e.path) for e in inside if e.is_dir()]
    files = [e.path for e in inside if not e.is_dir() and not e.name.lower().endswith(NO_LOG)]
    if any(file not in known for file in files):
        return True
    return depth > 0 and any(_has_other(place, known, depth - 1) for place in below)


def _found(entry: StageEntry, run: RunDirectory) -> list[str]:
    """Log files that ingest would read now; none where it would refuse them."""
    from auvident.pipeline.ingesting import log_files

    options = dict(entry.options)
    options["logs"] = [run.located(name) for name in options["logs"]]
    options["map"] = run.located(options["map"]) if options.get("map") else None
    try:
        return [run.remembered(file) for file in log_files(options)]
    except (InputError, OSError):
        return []
