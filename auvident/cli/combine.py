"""Command that makes one model of six degrees of freedom."""

from pathlib import Path

import click

from auvident.cli.common import OUTSIDE, PATH, Output, command
from auvident.cli.precious import refuse_precious
from auvident.cli.results import tell_outdated


@command(
    "combine",
    "auvident combine runs/demo --output remus100_6dof.json",
)
@click.argument("runs", metavar="RUN...", nargs=-1, required=True, type=PATH)
@click.option(
    "--output", "file", type=PATH, help="Output file (.json).  [default: standard output]"
)
@click.option(
    "--vehicle", type=PATH, help="Vehicle file in place of that of the runs; model files need one."
)
@OUTSIDE
def combine(
    output: Output, runs: tuple[Path, ...], file: Path | None, vehicle: Path | None
) -> None:
    """Make one model of six degrees of freedom from runs of both planes.

    Give a run of each plane, or one run of both; a plane without a run is the estimate from
    geometry, as is roll. What both planes identify is joined by their information. The file of a
    model stands for its plane alone: of a run of both planes RUN/refine/model.json for the
    horizontal one, RUN/refine/vertical/model.json for the vertical one.

    `auvident simulate MODEL.json --inputs LOG` flies it.
    """
    from auvident.pipeline.whole import combine_runs, write_combined
    from auvident.report.console_combined import combined_pieces

    refuse_precious(file, *runs, vehicle)
    model, files = combine_runs(runs, vehicle)
    with output.watch() as watch:
        for piece in combined_pieces(model):
            watch.show(piece)
        if file is not None:
            write_combined(model, file)
            named = ", ".join(str(path) for path in files)
            watch.note(f"model of six degrees of freedom written to {file} (from {named})")
        tell_outdated(watch, *runs)
    if file is None and not output.json:
        from auvident.storage.artifacts import json_bytes

        output.text(json_bytes(model, "combine").decode().rstrip("\n"))
    output.artifact(model, "combine")
