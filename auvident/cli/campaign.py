"""Commands for many trials: pool their models, run a campaign of them, compile beforehand."""

from pathlib import Path

import click

from auvident.cli.common import PATH, SEED, Output, command
from auvident.schema.planes import PLANES

FALSE_ALARMS = click.option(
    "--false-alarms",
    type=click.FloatRange(0.0, 0.5, min_open=True),
    metavar="P",
    help="Probability of reporting a change where there is none, all tests together."
    "  [default: 0.01]",
)
FAIL_ON_CHANGE = click.option(
    "--fail-on-change", is_flag=True, help="Exit with code 1 if the vehicle changed."
)
KEEP = click.option(
    "--keep", is_flag=True, help="Also pool trials that fit no other; they are only named."
)


@command("pool", "auvident pool runs/demo runs/second --output remus100_pooled.json")
@click.argument("runs", metavar="RUN...", nargs=-1, required=True, type=PATH)
@click.option(
    "--output", "file", type=PATH, help="Output file (.json).  [default: standard output]"
)
@click.option(
    "--changes", "changes_file", type=PATH, help="Also write what changed to this file (.json)."
)
@click.option("--plane", type=click.Choice(PLANES), help="Plane, for runs of both.")
@KEEP
@FALSE_ALARMS
@FAIL_ON_CHANGE
@SEED
def pool(
    output: Output,
    runs: tuple[Path, ...],
    file: Path | None,
    changes_file: Path | None,
    plane: str | None,
    keep: bool,
    false_alarms: float | None,
    fail_on_change: bool,
    seed: int | None,
) -> None:
    """Pool the trials of one vehicle to one model, and say what changed between them.

    RUN is a run directory or its model.json; no log is read again. What one trial cannot show,
    all together may: the model is used as any other (`simulate`, `export`).
    """
    from auvident.pipeline.pooling import pool_runs, refuse_change, write_pooled
    from auvident.report.console_campaign import pooled_pieces
    from auvident.storage.artifacts import json_bytes, write_bytes

    found = pool_runs(
        runs, plane=plane, keep=keep, false_alarms=false_alarms, seed=seed or 0
    )
    with output.watch() as watch:
        for piece in pooled_pieces(found.model, found.changes):
            watch.show(piece)
        if file is not None:
            write_pooled(found.model, file)
            watch.note(f"Pooled model written to {file}")
        if changes_file is not None:
            write_bytes(changes_file, json_bytes(found.changes, str(changes_file)))
    if file is None and not output.json:
        output.text(json_bytes(found.model, "pool").decode().rstrip("\n"))
    output.artifact(found.model, "pool")
    if fail_on_change:
        refuse_change(found.changes)
