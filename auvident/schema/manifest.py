"""The manifest of a run directory, ``run.json``: what was made from what, when and how."""

from typing import Any

from pydantic import Field

from auvident.schema.base import Artifact


class Attempt(Artifact):
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
    options: dict[str, Any] = {}
    outputs: dict[str, str]
    seed: int | None = None
    started_at: str
    ended_at: str
    outcome: str = "done"


class Manifest(Artifact):
    """``run.json``."""

    schema_: str = Field(default="auvident/run/1", alias="schema")
    program: str = "auvident"
    program_version: str
    created_at: str
    stages: dict[str, StageEntry] = {}
    failed: dict[str, Attempt] = {}
