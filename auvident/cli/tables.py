"""Commands that print the program's own tables."""

import click

from auvident.cli.common import Output, command
from auvident.errors import UsageError
from auvident.schema.coefficients import COEFFICIENTS, PLANES, of_plane

SIGNS = {1: "+", -1: "-", 0: "±"}


@command("coefficients", "auvident coefficients --plane vertical")
@click.option("--plane", type=click.Choice(PLANES), help="Only those of one plane.")
def coefficients(output: Output, plane: str | None) -> None:
    """List the coefficients: symbol, equation, what each multiplies, unit, expected sign."""
    chosen = of_plane(plane) if plane else COEFFICIENTS  # type: ignore[arg-type]
    rows = [
        {
            "symbol": c.symbol, "planes": c.planes, "equation": c.equation,
            "regressor": c.regressor, "group": c.group, "unit": c.unit, "sign": SIGNS[c.sign],
            "meaning": c.meaning,
        }
        for c in chosen
    ]  # fmt: skip
    if output.json:
        output.artifact({"schema": "auvident/coefficients/1", "coefficients": rows}, "coefficients")
        return
    widths = {"symbol": 8, "equation": 8, "regressor": 21, "group": 13, "unit": 7, "sign": 4}
    heads = [name.ljust(width) for name, width in widths.items()]
    output.text("  ".join([*heads, "meaning"]).rstrip())
    for row in rows:
        cells = [str(row[name]).ljust(width) for name, width in widths.items()]
        output.text("  ".join([*cells, str(row["meaning"])]))


@command("schema", "auvident schema model")
@click.argument("name", required=False)
def schema(output: Output, name: str | None) -> None:
    """Print the JSON schema of an artifact or of a file that you write.

    Without NAME the names are listed.
    """
    from auvident.pipeline.schemas import SCHEMAS, json_schema

    if name is None:
        output.text("\n".join(f"{key:12s} {file}" for key, (file, _) in SCHEMAS.items()))
        return
    key = name.removesuffix(".json").removesuffix(".toml")
    if key not in SCHEMAS:
        raise UsageError(f"there is no schema {name!r}", "schema", f"One of {', '.join(SCHEMAS)}.")
    output.json = True
    output.artifact(json_schema(key), key)
