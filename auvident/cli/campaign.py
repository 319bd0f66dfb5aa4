"""Commands for many trials: pool their models, run a campaign of them, compile beforehand."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from auvident.cli.common import MOST_SEED, PATH, Natural, Output, command
from auvident.cli.precious import refuse_precious
from auvident.cli.results import tell_outdated
from auvident.schema.planes import PLANES

if TYPE_CHECKING:
    from auvident.pipeline.campaign import CampaignPlan

FALSE_ALARMS = click.option(
    "--false-alarms",
    type=click.FloatRange(0.0, 0.5, min_open=True),
    metavar="P",
    help="Probability of reporting a change where there is none, all tests together."
    "  [default: 0.01]",
)
FAIL_ON_CHANGE = click.option(
    "--fail-on-change",
    is_flag=True,
    help="Exit with code 1 if the vehicle changed, or its last trial fits no other.",
)
# no run directory is there that would remember it
SEED = click.option(
    "--seed",
    type=Natural(MOST_SEED),
    default=0,
    help="Seed of the random numbers.  [default: 0]",
)
KEEP = click.option(
    "--keep", is_flag=True, help="Also pool trials that fit no other; they are only named."
)


@command("pool", "auvident pool runs/demo runs/other --output remus100_pooled.json")
@click.argument("runs", metavar="RUN...", nargs=-1, required=True, type=PATH)
@click.option(
    "--output", "file", type=PATH, help="Output file (.json).  [default: standard output]"
)
@click.option(
    "--changes", "changes_file", type=PATH, help="Also write what changed to this file (.json)."
)
@click.option("--plane", type=click.Choice(PLANES), help="Plane, for runs of both.")
@click.option(
    "--validate",
    "left_out",
    multiple=True,
    type=PATH,
    metavar="RUN",
    help="Predict the held-out maneuvers of this run, which is not pooled; repeatable.",
)
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
    left_out: tuple[Path, ...],
    keep: bool,
    false_alarms: float | None,
    fail_on_change: bool,
    seed: int,
) -> None:
    """Pool the trials of one vehicle to one model, and say what changed between them.

    RUN is a run directory or its model.json. The maneuvers of a run directory are predicted again
    with the common coefficients; no log is read again. What one trial cannot show, all together
    may: the model is used as any other (`simulate`, `export`).
    """
    from auvident.pipeline.left_out_runs import left_out_errors
    from auvident.pipeline.pooling import pool_runs, refuse_change, write_pooled
    from auvident.report import tables_campaign as tables
    from auvident.report.console_campaign import pooled_pieces
    from auvident.report.console_style import rich_table
    from auvident.storage.artifacts import json_bytes, write_bytes

    for written in (file, changes_file):
        refuse_precious(written, *runs, *left_out)
    with output.watch() as watch:
        found = pool_runs(
            runs, plane=plane, keep=keep, false_alarms=false_alarms, seed=seed, observer=watch
        )
        for piece in pooled_pieces(found.model, found.changes):
            watch.show(piece)
        if left_out:
            watch.show(rich_table(tables.left_out(left_out_errors(found.model, left_out))))
        if file is not None:
            write_pooled(found.model, file)
            watch.note(f"Pooled model written to {file}")
        if changes_file is not None:
            write_bytes(changes_file, json_bytes(found.changes, str(changes_file)))
        tell_outdated(watch, *runs)
    if file is None and not output.json:
        output.text(json_bytes(found.model, "pool").decode().rstrip("\n"))
    output.artifact(found.model, "pool")
    if fail_on_change:
        refuse_change(found.changes)


@command("warm-up", "auvident warm-up")
def warm_up(output: Output) -> None:
    """Compile the numerical kernels, once on a machine, before the first run needs them.

    Processes that want them at the same time wait for the one that compiles.
    """
    from auvident.pipeline.warming import warm_up as compile_all

    with output.watch() as watch:
        done = compile_all(watch)
        watch.note("Kernels compiled." if done else "Kernels were compiled already.")
    output.artifact({"schema": "auvident/warm-up/1", "compiled": done}, "warm-up")


@command(
    "campaign",
    "auvident campaign sample_logs --vehicle sample_logs/remus100.toml --output campaign --dry-run",
)
@click.argument("sources", metavar="CAMPAIGN.toml | FOLDER...", nargs=-1, required=True, type=PATH)
@click.option("--output", "folder", required=True, type=PATH, help="Folder of the results.")
@click.option("--vehicle", type=PATH, help="Vehicle file of all folders (TOML).")
@click.option(
    "--jobs", type=click.IntRange(1, 1024), help="Trials at a time.  [default: one a processor]"
)
@click.option(
    "--scheduler",
    metavar="ADDRESS",
    help="Run the trials on the Dask cluster of this scheduler (tcp://HOST:PORT, or its scheduler "
    "file); needs auvident[dask].",
)
@click.option("--dry-run", is_flag=True, help="List the trials and what would be run, and stop.")
@FALSE_ALARMS
@FAIL_ON_CHANGE
@SEED
@click.option("--allow-outside", is_flag=True, help="Read files outside of the campaign's folder.")
def campaign(
    output: Output,
    sources: tuple[Path, ...],
    folder: Path,
    vehicle: Path | None,
    jobs: int | None,
    scheduler: str | None,
    dry_run: bool,
    false_alarms: float | None,
    fail_on_change: bool,
    seed: int,
    allow_outside: bool,
) -> int:
    """Run many trials, pool them by vehicle, say what changed; one page and Parquet tables.

    Give a campaign file, or a folder of trials for each vehicle with its vehicle.toml in it. Each
    trial gets a run directory OUTPUT/VEHICLE/TRIAL. Trials that are up to date are skipped; a trial
    that fails is listed with its reason, and the exit code is then 3.
    """
    from auvident.pipeline.campaign import refuse_changes, run_campaign
    from auvident.pipeline.campaign_cluster import ClusterWorkers
    from auvident.pipeline.campaign_page import write_page
    from auvident.pipeline.warming import warm_for_runs
    from auvident.report.console_campaign import campaign_pieces
    from auvident.storage.declared import outside_allowed

    if scheduler is not None and jobs is not None:
        raise click.UsageError("Give either --jobs or --scheduler: a cluster has its own number.")
    with outside_allowed(allow_outside):
        plan = _plan(sources, folder, vehicle, jobs, false_alarms, seed, allow_outside)
    with output.watch() as watch:
        runner = None if scheduler is None else ClusterWorkers(scheduler, folder, watch.note)
        warm = None if runner else warm_for_runs  # workers see to it themselves
        done = run_campaign(plan, watch, dry_run=dry_run, runner=runner, warm=warm)
        page = None if dry_run else write_page(folder, done)
        for piece in campaign_pieces(done.result):
            watch.show(piece)
    output.artifact(done.result, "campaign")
    if page is not None and not output.json and not output.quiet:
        output.text(str(page))
    if fail_on_change:
        refuse_changes(done.result)
    return 3 if any(t.state == "failed" for t in done.result.trials) else 0


def _plan(
    sources: tuple[Path, ...],
    folder: Path,
    vehicle: Path | None,
    jobs: int | None,
    false_alarms: float | None,
    seed: int,
    allow_outside: bool,
) -> "CampaignPlan":
    """What is to be done, by the file or the folders."""
    from auvident.pipeline.campaign import CampaignPlan, refuse_among_logs, refuse_empty
    from auvident.schema.campaign import Campaign, RunOptions
    from auvident.storage.campaign_file import read_campaign, trials_in_folders

    files = [s for s in sources if s.suffix == ".toml"]
    if files and (len(sources) > 1 or vehicle is not None):
        raise click.UsageError("Give either one campaign file or folders (with --vehicle).")
    declared: Campaign | None = None
    if files:
        declared, trials = read_campaign(files[0], folder)
    else:
        trials = trials_in_folders(sources, vehicle, RunOptions())  # type: ignore[call-arg]
    refuse_empty(trials)
    own = declared.campaign if declared else None
    rate = own.false_alarms if own else 0.01
    plan = CampaignPlan(
        folder,
        trials,
        jobs or (own.jobs if own else None),
        rate if false_alarms is None else false_alarms,
        allow_outside,
        seed,
    )
    refuse_among_logs(plan)
    return plan
