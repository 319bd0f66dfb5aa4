"""Outputs of this program among the logs: run directories, simulations, tables of coefficients."""

import shlex
from collections.abc import Iterable, Sequence
from pathlib import Path

import pyarrow as pa
from pyarrow import parquet

from auvident.errors import InputError, StageError
from auvident.schema.channels import BY_COLUMN, SENSORS
from auvident.schema.coefficients import BY_SYMBOL
from auvident.storage.artifacts import read_json
from auvident.storage.lock import LOCK_FILE
from auvident.storage.log_file import (
    LOG_SUFFIXES,
    PARQUET_SUFFIXES,
    is_container,
    looks_like_log,
    open_log,
    stem,
)
from auvident.storage.regular import refuse_irregular
from auvident.storage.run_directory import MANIFEST

OURS, HEAD_BYTES = b'"auvident/run/', 200  # in the first bytes of a manifest
MAX_DEPTH = 4  # folders below the one given; a deeper tree is not a log folder but a disk
LEAST_BANDS = 2  # channels with a lower and an upper bound: no sensor logs these
LEAST_SYMBOLS = 2  # columns named for coefficients
TABLE_OF_COEFFICIENTS = ("symbol", "value", "std", "prime")
REMEDY = "Give the logs it was made from."


def is_run_directory(folder: Path) -> bool:
    """Whether a folder holds the manifest of a run."""
    try:
        manifest = read_json(folder / MANIFEST)
    except StageError:
        return _begins_as_one(folder / MANIFEST)
    return isinstance(manifest, dict) and str(manifest.get("schema")).startswith("auvident/")


def holds_runs_alone(place: Path, depth: int = MAX_DEPTH) -> bool:
    """Whether a folder is a run directory, one that a command has made, or has nothing but these.

    What a command has made holds no manifest before its first stage has ended, but a lock.
    """
    if not place.is_dir():
        return False
    if is_run_directory(place) or (place / LOCK_FILE).is_file():
        return True
    try:
        inside = list(place.iterdir()) if depth else []
    except OSError:  # what cannot be looked at may be a log
        return False
    return bool(inside) and all(holds_runs_alone(p, depth - 1) for p in inside)


def _begins_as_one(manifest: Path) -> bool:
    """Whether a damaged manifest is one by its first line."""
    try:
        return manifest.is_file() and OURS in manifest.open("rb").read(HEAD_BYTES)
    except OSError:
        return False


def own_output(path: Path) -> str:
    """What a file is that this program wrote, in words; "" for any other."""
    program = _program(path)
    if program:
        return f"a table that {program} wrote"
    if is_container(path):
        return ""
    try:
        names = open_log(path).names
    except InputError:
        return ""
    if sum(f"{c}_low" in names and f"{c}_high" in names for c in BY_COLUMN) >= LEAST_BANDS:
        return "a simulation that auvident wrote"
    symbols = sum(name in BY_SYMBOL for name in names)
    if set(TABLE_OF_COEFFICIENTS) <= set(names) or symbols >= LEAST_SYMBOLS:
        return "a table of coefficients that auvident wrote"
    return ""


def _program(path: Path) -> str:
    """The program that wrote a Parquet file, when it is this one."""
    if not path.name.lower().endswith(PARQUET_SUFFIXES):
        return ""
    try:
        about = parquet.read_schema(path).metadata or {}
    except (pa.ArrowException, OSError, UnicodeDecodeError):
        return ""
    program = about.get(b"program", b"").decode(errors="replace")
    return program if program.startswith("auvident") else ""


def logs_in(folder: Path) -> tuple[Path, ...]:
    """Files of a folder that are taken for logs, in order.

    Raises
    ------
    InputError
        A device, a pipe or a socket has the name of a sensor.
    """
    for p in folder.iterdir():
        if p.name.lower().endswith(LOG_SUFFIXES) and stem(p).lower() in SENSORS:
            refuse_irregular(p)
    files = sorted(p for p in folder.iterdir() if looks_like_log(p))
    return tuple(p for p in files if not own_output(p))


def folders_in(folder: Path) -> list[Path]:
    """Folders in which logs are searched, in order."""
    below = sorted(p for p in folder.iterdir() if p.is_dir() and p.name[:1] not in "._")
    return [p for p in below if not is_run_directory(p)]


def not_own(root: Path, files: Iterable[Path]) -> list[Path]:
    """Files below a folder that stand in no run directory and are no output themselves."""
    return [p for p in files if not _in_run_directory(root, p) and not own_output(p)]


def _in_run_directory(root: Path, file: Path) -> bool:
    between = [p for p in file.parents if p != root and p.is_relative_to(root)]
    return any(is_run_directory(p) for p in between)


def refuse_own(path: Path) -> None:
    """Refuse what the user named as a log and what is an output.

    Raises
    ------
    InputError
        It is a run directory, or a file that this program wrote.
    """
    if path.is_dir() and is_run_directory(path):
        raise InputError(
            "is a run directory of auvident, not a log",
            str(path),
            f"{REMEDY} `auvident run --run {shlex.quote(str(path))}` without logs uses them again.",
        )
    what = own_output(path) if path.is_file() else ""
    if what:
        raise InputError(f"is {what}, not a log", str(path), REMEDY)


def refuse_only_own(folder: Path) -> None:
    """Refuse a folder all of whose logs are files that this program wrote.

    Raises
    ------
    InputError
        There is at least one, and no other.
    """
    logs = sorted(p for p in folder.iterdir() if looks_like_log(p))
    if logs and all(own_output(p) for p in logs):
        names = ", ".join(p.name for p in logs[:12])
        raise InputError(f"contains only files that auvident wrote ({names})", str(folder), REMEDY)


def left_out(paths: Sequence[Path]) -> tuple[Path, ...]:
    """Outputs of this program that a search for logs passes over: run directories and files."""
    found: list[Path] = []
    level = [Path(p) for p in paths if Path(p).is_dir()]
    for _ in range(MAX_DEPTH + 1):
        inside = [p for folder in level for p in sorted(folder.iterdir())]
        found += [p for p in inside if p.is_dir() and is_run_directory(p)]
        found += [p for p in inside if looks_like_log(p) and own_output(p)]
        level = [p for folder in level for p in folders_in(folder)]
    return tuple(dict.fromkeys(found))
