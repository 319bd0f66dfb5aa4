"""The console that follows the pipeline: decisions, progress and tables on standard error."""

import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import click

from auvident.cli.interrupt import raise_again
from auvident.pipeline.observer import Observer
from auvident.schema.quoting import printable

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.progress import Progress, TaskID


class Watch(Observer):
    """Prints what the pipeline tells.

    Parameters
    ----------
    quiet, verbose : bool
        Nothing but warnings; more than usual.
    brief : bool
        Whether the tables of a stage stand among those of others.
    """

    def __init__(self, quiet: bool = False, verbose: bool = False, brief: bool = False) -> None:
        self.quiet, self.verbose, self.brief = quiet, verbose, brief and not verbose
        self._bar: tuple[Progress, TaskID] | None = None

    def decided(self, stage: str, sentence: str) -> None:
        """One line a stage."""
        raise_again()
        self._line(sentence)

    def note(self, text: str) -> None:
        """One line."""
        self._line(text)

    def refused(self, problem: str) -> None:
        """A warning; also with ``--quiet``."""
        self._stop()
        click.echo(f"Warning: skipped: {printable(problem)}", err=True)

    def progress(self, text: str, fraction: float | None = None) -> None:
        """A bar, on a terminal only."""
        raise_again()
        if self.quiet or not sys.stderr.isatty():
            return
        if self._bar is None:
            self._bar = _start_bar()
        bar, task = self._bar
        bar.update(
            task,
            description=printable(text),
            completed=fraction,
            total=None if fraction is None else 1,
        )

    def finished(self, stage: str, outputs: Mapping[str, Any], seconds: float) -> None:
        """The tables of the stage."""
        raise_again()
        self._stop()
        if self.quiet:
            return
        from auvident.report.console import stage_report

        for piece in stage_report(stage, outputs, self.brief):
            self.show(piece)
        if self.verbose:
            self._line(f"{stage}: {seconds:.1f} s")

    def show(self, piece: "RenderableType") -> None:
        """A table, with rules and colours where the terminal has them."""
        if self.quiet:
            return
        self._stop()
        from auvident.report.console_style import console_for, width_of

        console_for(sys.stderr, width_of(sys.stderr)).print(piece)

    def _line(self, text: str) -> None:
        self._stop()
        if not self.quiet:
            click.echo(printable(text), err=True)

    def _stop(self) -> None:
        if self._bar is not None:
            self._bar[0].stop()
            self._bar = None

    def __enter__(self) -> "Watch":
        return self

    def __exit__(self, *_: object) -> None:
        self._stop()


def _start_bar() -> "tuple[Progress, TaskID]":
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    from auvident.report.console_style import console_for

    text = TextColumn("{task.description}", markup=False)
    columns = (text, BarColumn(), TimeElapsedColumn())
    bar = Progress(*columns, console=console_for(sys.stderr), transient=True)
    bar.start()
    return bar, bar.add_task("", total=None)
