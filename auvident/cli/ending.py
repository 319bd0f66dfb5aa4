"""Files for CI systems that tell how a command came out, written however it ends."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from auvident.cli.common import PATH, Output, options
from auvident.cli.precious import refuse_precious
from auvident.errors import UsageError

if TYPE_CHECKING:
    from auvident.pipeline.gates import Judged
    from auvident.schema.outcome import CommandOutcome, GateResult

STEP_SUMMARY = "GITHUB_STEP_SUMMARY"  # names a file to which the steps of a workflow append
FILES = options(
    click.option(
        "--summary",
        type=PATH,
        metavar="FILE",
        help=f"Write a summary in Markdown, also when the command fails; ${STEP_SUMMARY} is "
        "appended to.",
    ),
    click.option(
        "--junit",
        type=PATH,
        metavar="FILE",
        help="Write stages, checks, findings and gates as JUnit XML, also when the command fails.",
    ),
)


@dataclass
class Ending:
    """What a command knows of its end: the gates, and of several runs how they compare."""

    gates: "list[GateResult]" = field(default_factory=list)
    comparison: Mapping[str, Any] = field(default_factory=dict)

    def check(self, planes: "Sequence[Judged]", limits: Mapping[str, float]) -> None:
        """Hold the errors of every plane against the limits; see `gates.check_planes`."""
        from auvident.pipeline.gates import check_planes, limit_gates

        self.gates += limit_gates(planes, limits)
        check_planes(planes, limits)

    def compare(self, comparison: Mapping[str, Any], share: float | None) -> None:
        """Hold runs against the last of them; see `gates.check_not_worse`."""
        from auvident.pipeline.gates import baseline_gates, check_not_worse

        self.comparison = comparison
        if share is not None:
            self.gates += baseline_gates(comparison, share)
            check_not_worse(comparison, share)


Tell = Callable[[Ending, Exception | None, Mapping[str, Any]], "CommandOutcome"]


def of_run(command: str, until: str) -> Tell:
    """How a command on a run directory came out, with the stages that lead to one."""

    def tell(end: Ending, error: Exception | None, options: Mapping[str, Any]) -> "CommandOutcome":
        from auvident.pipeline.outcome import outcome_of

        run = options["run"]
        return outcome_of(f"auvident {command} {run}", run, until, error, end.gates)

    return tell


def of_comparison(
    end: Ending, error: Exception | None, options: Mapping[str, Any]
) -> "CommandOutcome":
    """How several runs compare."""
    from auvident.pipeline.outcome import compared

    named = " ".join(str(run) for run in options["runs"])
    return compared(f"auvident compare {named}", end.comparison, end.gates, error)


def told_in_files(tell: Tell) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Give a command ``--summary`` and ``--junit``; it stands right below `command`.

    The command finds its `Ending` in its `Output`. Its error is more than that a file cannot be
    written, which then is only a warning. Wrong usage writes nothing.
    """

    def declare(function: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(function)
        def call(output: Output, summary: Path | None, junit: Path | None, **given: Any) -> Any:
            _refuse(summary, junit)
            output.end = end = Ending()
            try:
                code = function(output, **given)
            except click.ClickException:
                raise
            except Exception as error:
                _write_beside(summary, junit, tell, end, error, given)
                raise
            _write(summary, junit, lambda: replace(tell(end, None, given), exit_code=code or 0))
            return code

        return FILES(call)

    return declare


def _refuse(summary: Path | None, junit: Path | None) -> None:
    """Before any work: places where no file can be."""
    if summary is not None and summary == junit:
        raise UsageError("is the file of --summary and of --junit", str(junit), "Name two files.")
    for name, file in (("--summary", summary), ("--junit", junit)):
        if file is not None and file.is_dir():
            raise UsageError("is a folder", str(file), f"{name} needs the name of a file.")
        refuse_precious(file)


def _write_beside(
    summary: Path | None,
    junit: Path | None,
    tell: Tell,
    end: Ending,
    error: Exception,
    given: Mapping[str, Any],
) -> None:
    """The files of a command that failed."""
    from auvident.cli.failures import warn

    try:
        _write(summary, junit, lambda: tell(end, error, given))
    except OSError as fault:
        warn(f"{fault.filename}: cannot be written: {fault.strerror}")


def _write(summary: Path | None, junit: Path | None, tell: "Callable[[], CommandOutcome]") -> None:
    if summary is None and junit is None:
        return
    from auvident.report.junit import junit_bytes
    from auvident.report.pull_request import markdown
    from auvident.storage.artifacts import write_bytes

    outcome = tell()
    if junit is not None:
        write_bytes(junit, junit_bytes(outcome))
    if summary is not None:
        text = markdown(outcome).encode()
        _append(summary, text) if _is_step_summary(summary) else write_bytes(summary, text)


def _is_step_summary(file: Path) -> bool:
    named = os.environ.get(STEP_SUMMARY)
    return bool(named) and file.resolve() == Path(str(named)).resolve()


def _append(file: Path, text: bytes) -> None:
    with file.open("ab") as stream:
        stream.write(b"\n" + text if stream.tell() else text)
