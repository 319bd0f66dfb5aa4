"""Commands that look things up: what is in a log, and the program's own tables."""

import os
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import click

from auvident.cli.common import PATH, Output, command, completing
from auvident.errors import InputError, UsageError
from auvident.schema.effect import FAMILIES, Effect
from auvident.schema.planes import PLANES, Plane

SIGNS = {1: "+", -1: "-", 0: "±"}


@command("coefficients", "auvident coefficients --plane vertical")
@click.option("--plane", type=click.Choice(PLANES), help="Only the coefficients of this plane.")
def coefficients(output: Output, plane: str | None) -> None:
    """List coefficients and constants: symbol, what each multiplies, unit, expected sign."""
    from auvident.schema.coefficients import CONSTANTS, ESTIMATED

    chosen = [c for c in ESTIMATED.values() if plane is None or plane in c.planes]
    rows = [
        {
            "symbol": c.symbol,
            "planes": c.planes,
            "equation": c.equation,
            "regressor": c.regressor,
            "group": c.group,
            "unit": c.unit,
            "sign": SIGNS[c.sign],
            "meaning": c.meaning,
        }
        for c in chosen
    ]
    if output.json:
        own = {row["symbol"]: row for row in rows}
        constants = [own.pop(c.symbol) for c in CONSTANTS if c.symbol in own]
        listed = {"coefficients": list(own.values()), "constants": constants}
        output.artifact({"schema": "auvident/coefficients/1", **listed}, "coefficients")
        return
    widths = {"symbol": 8, "equation": 8, "regressor": 21, "group": 13, "unit": 7, "sign": 4}
    heads = (*widths, "meaning")
    cells = [[str(row[name]) for name in heads] for row in rows]
    _list(output, heads, cells, tuple(widths.values()))


@command("effects", "auvident effects --family actuation")
@click.option("--family", type=click.Choice(FAMILIES), help="Only the effects of this family.")
@click.option("--plane", type=click.Choice(PLANES), help="Only the effects of this plane.")
def effects(output: Output, family: str | None, plane: Plane | None) -> None:
    """List the effects that a model may lack: family, parameters with units, how each shows.

    `auvident diagnose` tests each of them; --json also has the equations, bounds and sources.
    """
    from auvident.schema.effects import EFFECTS

    chosen = [
        effect
        for effect in EFFECTS
        if family in (None, effect.family) and (plane is None or plane in effect.planes)
    ]
    if output.json:
        rows = [asdict(effect) for effect in chosen]
        output.artifact({"schema": "auvident/effects/1", "effects": rows}, "effects")
        return
    heads = ("effect", "family", "parameters", "units")
    listed = [heads, *(_cells(e, plane) for e in (chosen if plane else EFFECTS))]
    widths = [max(map(len, column)) for column in zip(*listed, strict=True)]
    shown = [[*_cells(e, plane), e.of_plane(plane)[1]] for e in chosen]
    _list(output, (*heads, "how it shows in the data"), shown, widths)


def _list(
    output: Output, heads: Sequence[str], rows: Sequence[Sequence[str]], widths: Sequence[int]
) -> None:
    """A table on standard output: one row a line, or as wide as the terminal where it is one."""
    if sys.stdout.isatty() or "COLUMNS" in os.environ:
        from auvident.report.console_style import console_for, rich_table
        from auvident.report.tables import Table, columns

        return console_for(sys.stdout).print(rich_table(Table(columns(heads), rows)))
    for cells in (heads, *rows):
        padded = [cell.ljust(width) for cell, width in zip(cells, widths, strict=False)]
        output.text("  ".join([*padded, cells[-1]]))


def _cells(effect: Effect, plane: Plane | None = None) -> tuple[str, ...]:
    """First columns of an effect: name, family, parameters (in a plane) and their units."""
    parameters, _ = effect.of_plane(plane)
    symbols = ", ".join(p.symbol for p in parameters)
    units = ", ".join(dict.fromkeys(p.unit for p in parameters))
    return effect.id, effect.family, symbols, units


@command("schema", "auvident schema model")
@click.argument("name", required=False, shell_complete=completing("schemas"))
def schema(output: Output, name: str | None) -> None:
    """Print the JSON schema of an artifact or of a file that you write.

    Without NAME the names are listed.
    """
    from auvident.pipeline.schemas import ALIASES, SCHEMAS, json_schema

    if name is None:
        listed = {key: file for key, (file, _) in SCHEMAS.items()}
        if not output.json:
            wide = max(map(len, listed))
            output.text("\n".join(f"{key:{wide}s} {file}" for key, file in listed.items()))
        return output.artifact({"schema": "auvident/schemas/1", "schemas": listed}, "schema")
    stem = name.removesuffix(".json").removesuffix(".toml")
    key = ALIASES.get(stem, stem)
    if key not in SCHEMAS:
        raise UsageError(f"there is no schema {name!r}", "schema", f"One of {', '.join(SCHEMAS)}.")
    output.json = True
    output.artifact(json_schema(key), key)


@command("new-vehicle", "auvident new-vehicle --output my_vehicle.toml")
@click.option("--output", "file", type=PATH, help="Write it to a new file.")
def new_vehicle(output: Output, file: Path | None) -> None:
    """Print a vehicle file to start from: every key with what it means.

    The numbers are those of a REMUS 100, so that it can be read as it is.
    """
    from auvident.storage.artifacts import write_bytes
    from auvident.storage.templates import vehicle_template

    text = vehicle_template()
    if file is not None:
        _refuse_existing(file)
        write_bytes(file, text.encode())
        with output.watch() as watch:
            watch.note(f"written to {file}; once it has your numbers: auvident ase {file}")
    elif not output.json:
        output.text(text.rstrip("\n"))
    output.artifact({"schema": "auvident/new-vehicle/1", "toml": text}, "new-vehicle")


def _refuse_existing(file: Path) -> None:
    """Refuse to write over a file, which a person may have edited, or which is the log itself."""
    if file.exists() and (file.is_file() or file.is_dir()):  # /dev/stdout may be written to
        raise UsageError("exists already", str(file), "Give the name of a new file.")


@command(
    "inspect",
    "auvident inspect sample_logs/harbour_trial",
    "auvident inspect sample_logs/harbour_trial/gyro.csv --json",
)
@click.argument("log", metavar="LOG", type=PATH)
@click.option("--output", "file", type=PATH, help="Write the proposed map to a new file (TOML).")
def inspect(output: Output, log: Path, file: Path | None) -> None:
    """Show what a log contains: clocks, columns, ranges, gaps, and a map that would read it.

    The proposed map, if one is needed, is printed on standard output, ready for --map.
    """
    from auvident.report.console import log_tables
    from auvident.storage.log_inspect import inspect_log

    if file is not None:
        _refuse_existing(file)
    report = inspect_log(log)
    faulty = [f for f in report.files if f.fault]
    if len(faulty) == len(report.files):
        raise InputError(faulty[0].fault, faulty[0].file, faulty[0].remedy)
    with output.watch() as watch:
        for piece in log_tables(report):
            watch.show(piece)
        if faulty:
            watch.note(f"{len(faulty)} of {len(report.files)} files cannot be read; see above.")
        elif not report.proposed_map and not report.unassigned:
            watch.note(_as_it_is(log))
        if file is not None and not report.proposed_map:
            watch.note(f"No map is proposed, and {file} was not written.")
    _put(output, report.proposed_map, file)
    output.artifact(report, "inspect")


def _as_it_is(log: Path) -> str:
    """Whether a log that needs no map can be read."""
    from auvident.pipeline.ingesting import hindrance

    told = hindrance(log)
    if told:
        return f"It needs no map, but it cannot be read as it is: {told}"
    return "The log can be read as it is, without a map."


def _put(output: Output, proposed_map: str, file: Path | None) -> None:
    """A proposed map, if there is one: into a file, else on standard output."""
    from auvident.storage.artifacts import write_bytes

    if proposed_map and file is not None:
        write_bytes(file, proposed_map.encode())
    elif proposed_map and not output.json:
        output.text(proposed_map.rstrip("\n"))
