"""The manifest of a run directory, ``run.json``: what was made from what, when and how."""

from typing import Any

from pydantic import Field

from auvident.schema.base import Artifact
from auvident.schema.places import BESIDE, BY_PLANE_STAGES

LONGEST_NAME = 200  # bytes of the name of an artifact; file systems hold 255


class FailedAttempt(Artifact):
    """A failed attempt at a stage, kept until the stage succeeds."""

    at: str
    problem: str
    where: str = ""
    remedy: str = ""
    exit_code: int
    options: dict[str, Any] = {}


class StageEntry(Artifact):
    """One stage that was done.

    Attributes
    ----------
    inputs, outputs : dict of str to str
        sha256 by path, relative to the run directory or absolute. Inputs are artifacts of earlier
        stages, and the user's files (logs, map, vehicle file, plan).
    program_files : dict of str to str
        sha256 of files that come with the program (built-in plans), by path in the package.
    libraries : dict of str to str
        Versions of Python and of the libraries that the numbers and bytes of the outputs depend
        on, by name; empty in a run of a version that did not note them.
    options : dict
        Every option with its value, defaults included; those of ingest name the logs, the
        vehicle file and the map.
    seed : int or None
        Of the random numbers; None where nothing is drawn.
    started_at, ended_at : str
        ISO 8601, UTC.
    outcome : str
        ``done``, or ``done_with_findings`` when something is worth reading.
    """

    program_version: str
    inputs: dict[str, str] = {}
    program_files: dict[str, str] = {}
    libraries: dict[str, str] = {}
    options: dict[str, Any] = {}
    outputs: dict[str, str]
    seed: int | None = None
    started_at: str
    ended_at: str
    outcome: str = "done"


class Manifest(Artifact):
    """``run.json``.

    Attributes
    ----------
    writing : dict of str to tuple of str
        Outputs that a stage was about to write and may have left without its entry, by stage.
    """

    schema_: str = Field(default="auvident/run/1", alias="schema")
    program: str = "auvident"
    program_version: str
    created_at: str
    stages: dict[str, StageEntry] = {}
    failed: dict[str, FailedAttempt] = {}
    writing: dict[str, tuple[str, ...]] = {}

    def own(self, stage: str) -> frozenset[str]:
        """Files that a stage has written, or may have when it was killed."""
        entry = self.stages.get(stage)
        return frozenset(entry.outputs if entry else ()) | frozenset(self.writing.get(stage, ()))

    def strays(self) -> list[tuple[str, str]]:
        """Stages with files that cannot be theirs: a manifest is data, which anyone may edit."""
        stages = dict.fromkeys((*self.stages, *self.writing))
        claimed = [(stage, name) for stage in stages for name in sorted(self.own(stage))]
        return [(stage, name) for stage, name in claimed if not can_be_output(stage, name)]


def can_be_output(stage: str, name: str) -> bool:
    """Whether a path can be that of an output: a file in the folder of its stage, or of a plane."""
    folder, _, file = name.partition("/")
    if stage in BY_PLANE_STAGES:
        file = file.removeprefix(f"{BESIDE}/")
    if folder != stage or not stage.replace("-", "_").isidentifier():
        return False
    return file not in ("", ".", "..") and not set(file) & set("/\\\0") and _fits(file)


def _fits(file: str) -> bool:
    """Whether it is text, and short enough for a file system, with what is added while written."""
    try:
        return len(file.encode()) <= LONGEST_NAME
    except UnicodeEncodeError:
        return False
