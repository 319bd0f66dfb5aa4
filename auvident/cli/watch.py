"""The console that follows the pipeline: decisions, progress and tables on standard error."""

import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import click

from auvident.cli.interrupt import raise_again
from auvident.cli.lines import in_lines
from auvident.cli.time_left import TimeLeft, about, took
from auvident.pipeline.observer import Observer
from auvident.schema.quoting import printable

if TYPE_CHECKING:
    from rich.console import RenderableType
    from rich.progress import Progress, TaskID


BAR_WIDTH = 8  # columns


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
        self._pace, self._stage, self._announced = TimeLeft(), "", False

    def decided(self, stage: str, sentence: str) -> None:
        """One line a stage."""
        raise_again()
        self._announced = True
        self._line(sentence)

    def started(self, stage: str) -> None:
        """One line where there will be no bar, unless the decision to run it was one."""
        raise_again()
        if not (self._announced or sys.stderr.isatty()):
            self._line(f"{stage}: started")
        self._stage, self._pace, self._announced = stage, TimeLeft(), False

    def note(self, text: str) -> None:
        """One line."""
        self._line(text)

    def refused(self, problem: str) -> None:
        """A warning; also with ``--quiet``."""
        self._stop()
        click.echo(in_lines(f"Warning: skipped: {printable(problem)}"), err=True)

    def progress(self, text: str, fraction: float | None = None) -> None:
        """A bar, on a terminal only."""
        raise_again()
        if self.quiet or not sys.stderr.isatty():
            return
        if self._bar is None:
            self._bar = _start_bar()
        bar, task = self._bar
        left = self._pace.left_s(fraction)
        bar.update(
            task,
            description=printable(f"{self._stage}: {text}" if self._stage else text),
            completed=fraction,
            total=None if fraction is None else 1,
            left="" if left is None else f"some {about(left)} left",
        )

    def finished(self, stage: str, outputs: Mapping[str, Any], seconds: float) -> None:
        """The tables of the stage, and how long it took."""
        raise_again()
        self._stop()
        if self.quiet:
            return
        from auvident.report.console import stage_report

        for piece in stage_report(stage, outputs, self.brief):
            self.show(piece)
        self._line(f"{stage}: done in {took(seconds)}")

    def show(self, piece: "RenderableType") -> None:
        """A table, with rules and colours where the terminal has them."""
        if self.quiet:
            return
        self._stop()
        from auvident.report.console_style import console_for, width_of

        whole = getattr(piece, "no_wrap", None) is True  # a command or a path, to be copied
        console_for(sys.stderr, width_of(sys.stderr)).print(piece, soft_wrap=whole)

    def _line(self, text: str) -> None:
        self._stop()
        if not self.quiet:
            click.echo(in_lines(printable(text)), err=True)

    def _stop(self) -> None:
        if self._bar is not None:
            self._bar[0].stop()
            self._bar = None

    def __enter__(self) -> "Watch":
        return self

    def __exit__(self, *_: object) -> None:
        self._stop()


def _start_bar() -> "tuple[Progress, TaskID]":
    from rich.progress import BarColumn, Progress, TextColumn
    from rich.table import Column

    from auvident.report.console_style import console_for

    what = TextColumn(
        "{task.description}", markup=False, table_column=Column(overflow="fold", ratio=1)
    )
    left = TextColumn("{task.fields[left]}", markup=False, table_column=Column(no_wrap=True))
    columns = (what, BarColumn(BAR_WIDTH), left)
    bar = Progress(*columns, console=console_for(sys.stderr), transient=True, expand=True)
    bar.start()
    return bar, bar.add_task("", total=None, left="")
