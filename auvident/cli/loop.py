"""Commands of the residual loop, and of the report that tells all."""

from pathlib import Path

import click

from auvident.cli.common import (
    FAIL_ABOVE,
    MOST_SEED,
    RUN,
    SEED,
    Natural,
    Output,
    command,
    parse_limits,
    run_one,
)
from auvident.cli.ending import of_run, told_in_files


@command("diagnose", "auvident diagnose runs/demo")
@RUN
@click.option(
    "--seed",
    type=Natural(MOST_SEED),
    expose_value=False,
    help="Taken as of the other commands; a diagnosis draws nothing.",
)
def diagnose(output: Output, run: Path) -> None:
    """Trace what the model does not explain to an effect that it lacks.

    It first reports which effects these maneuvers could show at all. Then each effect of
    `auvident effects` is tested, with one of these verdicts: an effect was found, several effects
    cannot be told apart, no listed effect explains the residual, or nothing is missing.
    """
    from auvident.report.closing import after_diagnose
    from auvident.schema.places import by_plane

    planes = by_plane(run_one(output, "diagnose", run))
    verdicts = [own["diagnose/diagnosis.json"].verdict for _, own in planes]
    output.last(after_diagnose(run, verdicts))


@command(
    "refine",
    "auvident refine runs/demo",
    "auvident refine runs/demo --fail-above u=0.2 --fail-above r=0.1",
    "auvident refine runs/demo --with-unexplained",
)
@told_in_files(of_run("refine", "refine"))
@RUN
@click.option(
    "--filter",
    type=click.Choice(["ekf", "ukf"]),
    help="Extended or unscented Kalman filter.  [default: as in the identification]",
)
@click.option(
    "--with-unexplained",
    is_flag=True,
    help="Also add an unnamed force for what no effect explains, if it improves the prediction "
    "of maneuvers left out in turn.",
)
@FAIL_ABOVE
@SEED
def refine(
    output: Output,
    run: Path,
    filter: str | None,
    with_unexplained: bool,
    fail_above: tuple[str, ...],
    seed: int | None,
) -> None:
    """Add the traced effects to the model, identify again, compare held-out errors.

    The plan is that of the identification. --fail-above applies to the refined model. A model
    that predicts the identifying maneuvers worse, each left out in turn, is not taken.
    """
    from auvident.pipeline.gates import refined
    from auvident.report.closing import after_refine
    from auvident.schema.places import by_plane

    limits = parse_limits(fail_above)
    force = with_unexplained or None
    outputs = run_one(output, "refine", run, seed, filter=filter, with_unexplained=force)
    planes = by_plane(outputs)
    output.last(after_refine(run))
    output.end.check([refined(own["refine/comparison.json"]) for _, own in planes], limits)


@command("report", "auvident report runs/demo")
@RUN
@click.option(
    "--interactive",
    is_flag=True,
    help="Also write interactive.html: hover, zoom; 6 MB, needs auvident[interactive].",
)
def report(output: Output, run: Path, interactive: bool) -> None:
    """Write a self-contained HTML report; print its path.

    It contains all figures, tables and findings, and needs neither other files nor a network.
    """
    from auvident.pipeline import run_stage

    if interactive:
        from auvident.report.interactive import require_plotly

        require_plotly()
    with output.watch() as watch:
        *_, name = run_stage("report", run, {"interactive": interactive}, observer=watch)
    if output.json:
        output.artifact({"schema": "auvident/report/1", "file": str(run / name)}, name)
    else:
        output.text(str(run / name))
