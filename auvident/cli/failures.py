"""What went wrong, in a few lines on standard error, and the exit code.

The last line of defence as well: what no part of the program has foreseen is one line, and a file
with all that is needed to find it.
"""

import io
import os
import shlex
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import click

from auvident.cli.common import OPTIONS_OF_PROCESS
from auvident.cli.lines import in_lines
from auvident.errors import BUG_EXIT_CODE, AuvidentError, InputError
from auvident.schema.quoting import clipped, printable

LONGEST_MESSAGE = 4000  # characters; a name or value of a user's file may be of any length
NO_MEMORY = InputError(
    "this machine has too little memory",
    remedy="Give a shorter log, a lower --rate or fewer --samples.",
)


def say(problem: str) -> None:
    """One error on standard error, as text that gives no orders to the terminal."""
    click.echo(in_lines(f"Error: {printable(clipped(problem, LONGEST_MESSAGE))}"), err=True)


def warn(problem: str) -> None:
    """One warning on standard error."""
    click.echo(f"Warning: {printable(clipped(problem, LONGEST_MESSAGE))}", err=True)


def told(error: AuvidentError) -> int:
    """An error that the user can do something about."""
    say(str(error))
    return error.exit_code


def misused(error: click.ClickException) -> int:
    """A command line that cannot be read."""
    shown = io.StringIO()
    error.show(shown)
    click.echo(printable(clipped(shown.getvalue().rstrip(), LONGEST_MESSAGE)), err=True)
    return error.exit_code


def from_outside(error: OSError) -> int:
    """What the system refused: a place, or standard output where no file is named."""
    where = os.fsdecode(error.filename) if isinstance(error.filename, str | bytes) else ""
    problem = f"cannot be used: {error.strerror}"
    return told(
        InputError(
            problem, where or "standard output", "Check the path, permissions and disk space."
        )
    )


def bug(error: BaseException) -> int:
    """What was not foreseen: one line, and a file to send; with --verbose the traceback as well."""
    import traceback

    if OPTIONS_OF_PROCESS.verbose:
        click.echo(printable("".join(traceback.format_exception(error))), err=True)
    say(f"unexpected {type(error).__name__}: {clipped(str(error))}\n  {_what_to_do(error)}")
    return BUG_EXIT_CODE


def _what_to_do(error: BaseException) -> str:
    try:
        return f"This is a bug. Please report it with the file {_crash_file(error)}."
    except OSError:
        return (
            "This is a bug. Please report it together with the output of the same command with "
            "--verbose."
        )


def _crash_file(error: BaseException) -> Path:
    """Write what is needed to find a bug; it has no data of a log but what the traceback quotes."""
    import tempfile
    import traceback
    from datetime import UTC, datetime

    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S")
    number, name = tempfile.mkstemp(".txt", f"auvident-crash-{stamp}-")
    with open(number, "w", encoding="utf-8", errors="backslashreplace") as stream:
        stream.write("\n".join([*_about(), "", *traceback.format_exception(error)]))
    return Path(name)


def _about() -> Iterator[str]:
    from auvident.versions import about

    yield shlex.join(sys.argv)
    yield f"in {os.getcwd()}"
    yield from about()


def close_output() -> None:
    """Send what is still to be printed, while it can be said that this failed.

    Raises
    ------
    OSError
        The disk is full, or the reader of the pipe has left.
    """
    sys.stdout.flush()


def forget_output() -> None:
    """What is still to be printed goes nowhere; else Python complains of it when it ends."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
