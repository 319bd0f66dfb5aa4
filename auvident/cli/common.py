"""What all commands share: loading on demand, help with an example, output options.

In `auvident.cli` imports stand inside of functions for speed alone: help and usage errors come
without numpy, pandas and rich.
"""

import importlib
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from auvident.errors import InputError, UsageError

if TYPE_CHECKING:
    import pandas as pd
    from rich.console import RenderableType

    from auvident.cli.ending import Ending
    from auvident.cli.watch import Watch

Function = TypeVar("Function", bound=Callable[..., Any])


@dataclass
class Output:
    """How a command speaks.

    Attributes
    ----------
    json : bool
        The main artifact on standard output.
    quiet, verbose : bool
        Nothing but errors; more than usual.
    end : Ending
        Of a command that tells in files how it came out.
    """

    json: bool = False
    quiet: bool = False
    verbose: bool = False
    end: "Ending" = field(init=False)

    def watch(self, brief: bool = False) -> "Watch":
        """The console that follows the pipeline."""
        from auvident.cli.watch import Watch  # loads the pipeline

        return Watch(self.quiet, self.verbose, brief)

    def artifact(self, artifact: Any, name: str) -> None:
        """Print an artifact as JSON when it was asked for."""
        if self.json:
            from auvident.storage.artifacts import json_bytes

            sys.stdout.buffer.write(json_bytes(artifact, name))
            sys.stdout.flush()

    def last(self, pieces: "Sequence[RenderableType]") -> None:
        """What a command leaves a person with."""
        with self.watch() as watch:
            for piece in pieces:
                watch.show(piece)

    def text(self, text: str) -> None:
        """Print the result of a command that makes text; not part of progress."""
        click.echo(text)


LONGEST_LINE = 76  # columns of an example in a help
LONGEST_SENTENCE = 300  # columns of the first sentence of a help
MOST_SEED = 2**63 - 1  # that a manifest can hold in every language
OPTIONS_OF_PROCESS = Output()  # of the command that runs, for the report of a bug


class Group(click.Group):
    """A group that imports the module of a command when it is needed."""

    def __init__(self, *args: Any, sources: Mapping[str, tuple[str, ...]], **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.module_of = {name: module for module, names in sources.items() for name in names}

    def invoke(self, ctx: click.Context) -> Any:
        """As click does, which would end with the code of a gate when any pipe is broken."""
        try:
            return super().invoke(ctx)
        except BrokenPipeError as error:
            problem = f"cannot be used: {error.strerror}"
            raise InputError(problem, "a pipe", "Run the command again.") from error

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of all commands, in the order of the table."""
        return list(self.module_of)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command, from its module."""
        module = self.module_of.get(cmd_name)
        if module is None:
            return None
        found: click.Command = getattr(importlib.import_module(module), cmd_name.replace("-", "_"))
        return found

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The first sentence of every command, whole, where click would cut it to one line."""
        commands = [(name, self.get_command(ctx, name)) for name in self.list_commands(ctx)]
        rows = [(name, c.get_short_help_str(LONGEST_SENTENCE)) for name, c in commands if c]
        with formatter.section("Commands"):
            formatter.write_dl(rows)

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        """As click does, with the closest name when there is no such command."""
        try:
            return super().resolve_command(ctx, args)
        except click.UsageError as error:
            import difflib

            close = difflib.get_close_matches(args[0], self.module_of, n=1)
            if not close:
                raise
            raise click.UsageError(f"{error.message} Did you mean {close[0]!r}?", ctx) from None


def ending(*examples: str) -> str:
    """The examples that end a help; of a long one the options stand in lines of their own."""
    title = "Example:" if len(examples) == 1 else "Examples:"
    return "\b\n" + "\n".join([title, *(f"  {_continued(example)}" for example in examples)])


def _continued(example: str) -> str:
    if len(example) <= LONGEST_LINE:
        return example
    pieces = example.split(" --")
    lines = [pieces[0]]
    for piece in pieces[1:]:
        if len(lines[-1]) + len(piece) + 5 > LONGEST_LINE:
            lines.append(f"--{piece}")
        else:
            lines[-1] += f" --{piece}"
    return " \\\n      ".join(lines)


def command(name: str, *examples: str) -> Callable[[Callable[..., Any]], click.Command]:
    """Declare a command with its output options and the examples that end its help.

    The function gets an `Output` first.
    """
    epilog = ending(*examples)

    def declare(function: Callable[..., Any]) -> click.Command:
        def call(as_json: bool, quiet: bool, verbose: bool, **kwargs: Any) -> Any:
            OPTIONS_OF_PROCESS.verbose = verbose
            return function(Output(as_json, quiet, verbose), **kwargs)

        call.__doc__ = function.__doc__
        call.__click_params__ = getattr(function, "__click_params__", [])  # type: ignore[attr-defined]
        wrapped = call
        for option in _OUTPUT_OPTIONS:
            wrapped = option(wrapped)
        return click.command(name, epilog=epilog)(wrapped)

    return declare


_OUTPUT_OPTIONS = (
    click.option(
        "--verbose", is_flag=True, help="More output, and a traceback if the program fails."
    ),
    click.option("--quiet", is_flag=True, help="No progress and no tables, only errors."),
    click.option("--json", "as_json", is_flag=True, help="Print the result as JSON."),
)


def options(*decorators: Callable[[Function], Function]) -> Callable[[Function], Function]:
    """Several options as one decorator, in the order in which they stand in the help."""

    def decorate(function: Function) -> Function:
        for decorator in reversed(decorators):
            function = decorator(function)
        return function

    return decorate


def completing(name: str) -> Callable[..., Any]:
    """A function of `auvident.cli.completion`, which is loaded when a shell asks for it."""

    def complete(ctx: click.Context, param: click.Parameter, incomplete: str) -> Any:
        from auvident.cli import completion

        return getattr(completion, name)(ctx, param, incomplete)

    return complete


def given(**values: Any) -> dict[str, Any]:
    """The options that stand on the command line; the others have their defaults."""
    return {key: value for key, value in values.items() if value not in (None, ())}


def run_one(output: Output, name: str, path: Path, seed: int | None = None, **options: Any) -> Any:
    """Run one stage, show its tables, print its main artifact with ``--json``."""
    from auvident.pipeline import run_stage
    from auvident.pipeline.table import BY_NAME

    with output.watch() as watch:
        outputs = run_stage(name, path, given(**options), seed=seed, observer=watch)
    main = BY_NAME[name].main
    output.artifact(main_of(main, outputs), main)
    return outputs


def main_of(main: str, outputs: Mapping[str, Any]) -> Any:
    """The main artifact of a stage; that of a second plane stands in it under ``planes``."""
    from auvident.schema.places import by_plane
    from auvident.storage.artifacts import plain

    (_, first), *others = by_plane(outputs)
    planes = {plane: own[main] for plane, own in others}
    return {**plain(first[main]), "planes": planes} if planes else first[main]


def _allow(ctx: click.Context, param: click.Parameter, value: bool) -> None:
    """Hold for the command what is said of files outside of the folder of the one naming them."""
    if value:
        from auvident.storage.declared import outside_allowed

        ctx.with_resource(outside_allowed(value))


OUTSIDE_HELP = "Read files that the vehicle file or the map names outside of its folder."
# For ingest and run, which remember it; for other commands.
ALLOW_OUTSIDE = click.option("--allow-outside", is_flag=True, default=None, help=OUTSIDE_HELP)
OUTSIDE = click.option(
    "--allow-outside", is_flag=True, expose_value=False, callback=_allow, help=OUTSIDE_HELP
)


class Natural(click.ParamType):
    """A whole number from zero; the help does without the largest one."""

    name = "integer"

    def __init__(self, most: int) -> None:
        self.range = click.IntRange(min=0, max=most)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """The number; refused as click refuses one that is out of its range."""
        return int(self.range.convert(value, param, ctx))


FAIL_ABOVE = click.option(
    "--fail-above",
    multiple=True,
    metavar="CHANNEL=RMSE",
    shell_complete=completing("channels"),
    help="Exit with code 1 if the held-out RMSE of a channel is larger; in SI units, also "
    "heading and pitch (rad); repeatable.",
)
SEED = click.option(
    "--seed",
    type=Natural(MOST_SEED),
    help="Seed of the random numbers.  [default: that of the last run, initially 0]",
)


class GivenPath(click.Path):
    """A path that can be one; whether something stands there is the reader's business (code 3)."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The path; an empty one would be the current folder, and no file has other than text."""
        if not str(value):
            self.fail("The path is empty.", param, ctx)
        try:
            str(value).encode()
        except UnicodeEncodeError:
            self.fail(f"The name {str(value)!r} is not UTF-8. Rename the file.", param, ctx)
        return super().convert(value, param, ctx)


PATH: Any = GivenPath(path_type=Path, readable=False)  # as above: not click's business (code 2)
RUN = click.argument("run", metavar="RUN", type=PATH)


def parse_limits(texts: tuple[str, ...]) -> dict[str, float]:
    """``u=0.05`` -> {"u": 0.05}, for ``--fail-above``."""
    limits: dict[str, float] = {}
    for text in texts:
        channel, equals, number = text.partition("=")
        try:
            limit = float(number)
        except ValueError:
            equals, limit = "", 0.0
        if not equals or not channel.strip() or not 0.0 < limit < math.inf:
            raise UsageError(
                f"{text!r} is not CHANNEL=RMSE, a number above 0",
                "--fail-above",
                "For example --fail-above u=0.05.",
            )
        limits[channel.strip()] = limit
    if limits:
        from auvident.pipeline.gates import refuse_unknown

        refuse_unknown(limits)
    return limits


def write_table(table: "pd.DataFrame", target: Path) -> None:
    """A table as Parquet or CSV, by the end of the file's name; into a pipe or device as CSV."""
    from auvident.storage.artifacts import parquet_bytes, write_bytes

    refuse_no_table(target)
    if target.suffix == ".parquet":
        write_bytes(target, parquet_bytes(table, {}))
    else:
        write_bytes(target, table.to_csv(index=False).encode())


def refuse_no_table(target: Path | None) -> None:
    """Before any work: a file whose name says of no form of a table."""
    from auvident.storage.artifacts import stream_of

    if target is None or target.suffix in (".parquet", ".csv") or stream_of(target) is not None:
        return
    if not target.exists() or target.is_file() or target.is_dir():  # no device or pipe
        raise UsageError(
            "is neither a .parquet nor a .csv file",
            str(target),
            "Give a file name that ends in .parquet or .csv.",
        )
