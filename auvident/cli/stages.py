"""The commands of the stages, and `auvident run`, which does them all."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from auvident.cli.common import (
    ALLOW_OUTSIDE,
    FAIL_ABOVE,
    OUTSIDE,
    PATH,
    RUN,
    SEED,
    Output,
    command,
    completing,
    options,
    parse_limits,
    run_one,
)
from auvident.cli.ending import of_run, told_in_files
from auvident.errors import UsageError
from auvident.schema.planes import PLANES

if TYPE_CHECKING:
    from auvident.schema.logs import Quality

LOGS = click.argument("logs", metavar="LOG...", nargs=-1, type=PATH)
VEHICLE = click.option("--vehicle", type=PATH, help="Vehicle file (TOML).")
RUN_OPTION = click.option(
    "--run", required=True, type=PATH, help="Run directory; created if needed."
)
KEEP_GOING = click.option(
    "--keep-going",
    is_flag=True,
    default=None,
    help="Set unusable logs aside and continue, as with the trials of a folder; exit code 3 "
    "at the end.",
)
INGEST_OPTIONS = options(
    click.option("--map", "map_", type=PATH, help="Column map: names, units and signs (TOML)."),
    click.option(
        "--rate",
        "rate_hz",
        type=float,
        metavar="HZ",
        help="Sampling rate after ingest, 0.2 to 1000.  [default: 10]",
    ),
    click.option(
        "--max-gap",
        "max_gap_s",
        type=float,
        metavar="SECONDS",
        help="Longest gap between samples that is bridged.  [default: 5]",
    ),
    ALLOW_OUTSIDE,
    click.option(
        "--fix",
        multiple=True,
        metavar="NAME",
        help="Apply the correction that the check NAME of the log proposes; repeatable.",
    ),
    KEEP_GOING,
)
SEGMENT_OPTIONS = options(
    click.option(
        "--hold-out",
        multiple=True,
        metavar="ID",
        shell_complete=completing("maneuvers"),
        help=(
            "Maneuver or trial to hold out for validation; repeatable; replaces the "
            "automatic choice."
        ),
    )
)
IDENTIFY_OPTIONS = options(
    click.option(
        "--filter",
        type=click.Choice(["ekf", "ukf"]),
        help="Extended or unscented Kalman filter.  [default: ekf]",
    ),
    click.option(
        "--engine",
        type=click.Choice(["compiled", "filterpy"]),
        help="Own compiled filters, or those of filterpy (slow, to compare).  [default: compiled]",
    ),
    click.option(
        "--plane",
        type=click.Choice([*PLANES, "both", "found"]),
        help="Plane of motion; `found`: those with maneuvers of their own.  [default: found]",
    ),
    click.option(
        "--plan",
        metavar="NAME|FILE",
        shell_complete=completing("plans"),
        help="Identification plan: which coefficients in which order.  [default: refined]",
    ),
)


@command(
    "ingest",
    "auvident ingest sample_logs/harbour_trial --vehicle sample_logs/remus100.toml"
    " --run runs/harbour",
)
@LOGS
@VEHICLE
@RUN_OPTION
@INGEST_OPTIONS
def ingest(
    output: Output,
    logs: tuple[Path, ...],
    vehicle: Path | None,
    run: Path,
    map_: Path | None,
    rate_hz: float | None,
    max_gap_s: float | None,
    allow_outside: bool | None,
    fix: tuple[str, ...],
    keep_going: bool | None,
) -> int:
    """Read logs, bring all sensors to one clock, clean them, report their quality.

    LOG is a trial folder with one file per sensor, a single wide file, or a folder of trials;
    several may be given. `auvident inspect LOG` shows what a log contains.
    """
    _need(logs, vehicle, run)
    outputs = run_one(
        output,
        "ingest",
        run,
        logs=logs,
        vehicle=vehicle,
        map=map_,
        rate_hz=rate_hz,
        max_gap_s=max_gap_s,
        allow_outside=allow_outside,
        fix=fix,
        keep_going=keep_going,
    )
    return exit_code(outputs.get("ingest/quality.json"))


def _need(logs: tuple[Path, ...], vehicle: Path | None, run: Path) -> None:
    if not logs:
        raise click.UsageError("Missing argument 'LOG...'.")
    if vehicle is None:
        raise click.UsageError("Missing option '--vehicle'.")
    if run.is_dir() and not (run / "run.json").exists() and any(map(run.samefile, _there(logs))):
        raise UsageError(
            "is the folder of the log, which could not be read again with a run in it",
            "--run",
            "Give another folder.",
        )


def _there(logs: tuple[Path, ...]) -> list[Path]:
    return [log for log in logs if log.exists()]


def exit_code(quality: "Quality | None") -> int:
    """3 when a trial was set aside, now or when the logs were read, else 0."""
    return 3 if quality and quality.set_aside else 0


@command("segment", "auvident segment runs/demo --hold-out harbour_trial-turn-4")
@RUN
@SEGMENT_OPTIONS
def segment(output: Output, run: Path, hold_out: tuple[str, ...]) -> None:
    """Find straight runs, turns, zigzags and depth steps; choose which to hold out.

    A depth step is a straight run of which the depth changes: kind `straight` in the artifact.
    """
    run_one(output, "segment", run, hold_out=hold_out)


@command("identify", "auvident identify runs/demo", "auvident identify runs/demo --plan together")
@RUN
@IDENTIFY_OPTIONS
def identify(output: Output, run: Path, **chosen: Any) -> None:
    """Estimate states and coefficients jointly, in the stages of a plan."""
    run_one(output, "identify", run, **chosen)


@command(
    "validate",
    "auvident validate runs/demo",
    "auvident validate runs/demo --fail-above u=0.2 --fail-above r=0.1",
    "auvident validate runs/demo --fail-above r=0.1 --summary pull-request.md --junit gates.xml",
)
@told_in_files(of_run("validate", "validate"))
@RUN
@FAIL_ABOVE
def validate(output: Output, run: Path, fail_above: tuple[str, ...]) -> None:
    """Predict the maneuvers from their initial state and inputs; compare with the log.

    The identification has not seen the held-out maneuvers. RMSE are in the unit of the channel:
    m/s, rad/s, rad, m. The intervals of standard maneuvers are of models drawn with seed 0,
    whatever the seed of the run.
    """
    from auvident.pipeline.gates import predicted
    from auvident.schema.places import by_plane

    limits = parse_limits(fail_above)
    planes = by_plane(run_one(output, "validate", run))
    output.end.check([predicted(own["validate/metrics.json"]) for _, own in planes], limits)


@command(
    "run",
    "auvident run sample_logs/harbour_trial --vehicle sample_logs/remus100.toml --run runs/demo",
)
@told_in_files(of_run("run", "report"))
@LOGS
@VEHICLE
@RUN_OPTION
@INGEST_OPTIONS
@SEGMENT_OPTIONS
@IDENTIFY_OPTIONS
@FAIL_ABOVE
@SEED
def run(
    output: Output,
    logs: tuple[Path, ...],
    vehicle: Path | None,
    run: Path,
    map_: Path | None,
    rate_hz: float | None,
    max_gap_s: float | None,
    allow_outside: bool | None,
    fix: tuple[str, ...],
    keep_going: bool | None,
    hold_out: tuple[str, ...],
    fail_above: tuple[str, ...],
    seed: int | None,
    **identify: Any,
) -> int:
    """Run all stages in order; stages that are up to date are skipped.

    The run ends with the effects that the model lacked, how the held-out errors changed, the path
    of the report and the next command; with --quiet it prints one line, verdict and report.
    Without LOG, the logs, the vehicle file and the options of the last run are used.
    """
    from auvident.pipeline.whole_run import ended, judged, run_logs
    from auvident.report.closing import REPORT, after_run, in_one_line
    from auvident.report.console import discoveries

    limits = parse_limits(fail_above)
    if logs or vehicle is not None:
        _need(logs, vehicle, run)
    asked = {
        "logs": logs,
        "vehicle": vehicle,
        "map": map_,
        "rate_hz": rate_hz,
        "max_gap_s": max_gap_s,
        "allow_outside": allow_outside,
        "fix": fix,
        "keep_going": keep_going,
        "hold_out": hold_out,
        **identify,
    }
    with output.watch(brief=True) as watch:
        result = run_logs(run, asked, seed=seed, observer=watch)
        for piece in contradicted(run, result):
            watch.show(piece)
        told = ended(run, result)
        for piece in discoveries([(plane, comparison) for plane, _, comparison in told]):
            watch.show(piece)
    compared = [(plane, comparison) for plane, _, comparison in told]
    quality = quality_of(run, result)
    output.last(after_run(run, [c for _, c in compared if c is not None], quality))
    if output.json:
        output.artifact(summary(run, result), "run")
    elif output.quiet:
        output.text(in_one_line(run, compared))
    elif not (sys.stdout.isatty() and sys.stderr.isatty()):  # there it has just been told
        output.text(str(run / REPORT))
    if result.failure is not None:
        raise result.failure
    output.end.check([judged(metrics, comparison) for _, metrics, comparison in told], limits)
    return exit_code(quality)


def contradicted(run: Path, result: Any) -> list[Any]:
    """What a run says before its results: contradictions in the logs and of the estimate."""
    from rich.text import Text

    from auvident.report.console import checks_first, model_first
    from auvident.report.trial_words import set_aside
    from auvident.schema.artifacts import IdentifiedModel
    from auvident.storage.artifacts import as_model

    quality = quality_of(run, result)
    pieces: list[Any] = checks_first(quality) if quality else []
    if quality and "ingest/quality.json" not in result.outputs:  # the stage has not said it now
        pieces += [Text(line) for line in set_aside(quality)]
    for mains in (result.mains, result.beside):
        if "identify" in mains:
            model = as_model(mains["identify"], IdentifiedModel, run / "identify" / "model.json")
            pieces += model_first(model)
    return pieces


def quality_of(run: Path, result: Any) -> "Quality | None":
    """What the checks of the logs said, where they are read."""
    from auvident.schema.logs import Quality
    from auvident.storage.artifacts import as_model

    if "ingest" not in result.mains:
        return None
    return as_model(result.mains["ingest"], Quality, run / "ingest" / "quality.json")


def summary(run: Path, result: Any) -> dict[str, Any]:
    """What ``auvident run --json`` prints: the decisions and the main artifacts."""
    from auvident.pipeline.table import STAGES
    from auvident.schema.places import BESIDE

    decisions = [{"stage": d.stage, "state": d.state, "reason": d.reason} for d in result.decisions]
    mains = {s.name: s.main for s in STAGES}
    files = {n: str(run / p) for n, p in mains.items() if n in result.mains}
    artifacts = {n: tree for n, tree in result.mains.items() if tree is not None}
    for name, tree in result.beside.items():
        artifacts[name] = {**artifacts.get(name, {}), "planes": {BESIDE: tree}}
    found = {"decisions": decisions, "files": files, **artifacts}
    return {"schema": "auvident/summary/1", "run": str(run), **found}


@command(
    "ase",
    "auvident ase runs/demo",
    "auvident ase --vehicle sample_logs/remus100.toml --json",
    "auvident ase sample_logs/remus100.toml sample_logs/tern180.toml",
    "auvident ase --vehicle sample_logs/tern180.toml --sweep rudder.exposed_span_m=0.08:0.16:100",
)
@click.argument("targets", metavar="[RUN | V.toml...]", nargs=-1, type=PATH)
@click.option("--vehicle", "vehicles", multiple=True, type=PATH, help="Vehicle file (TOML).")
@click.option(
    "--sweep",
    multiple=True,
    metavar="KEY=START:STOP:COUNT",
    help="Sweep a number of the vehicle file; repeatable.",
)
@click.option("--output", "file", type=PATH, help="Output file of the sweep (.parquet or .csv).")
@OUTSIDE
def ase(
    output: Output,
    targets: tuple[Path, ...],
    vehicles: tuple[Path, ...],
    sweep: tuple[str, ...],
    file: Path | None,
) -> None:
    """Estimate the coefficients of both planes from geometry.

    For a run directory, the vehicle is that of ingest, and the result becomes the prior of the
    identification. For vehicle files nothing is stored; several are compared side by side.
    Intervals of turning and stability are of vehicles drawn with seed 0, the same ones every time,
    also in a sweep.
    """
    from auvident.cli.designs import compare_designs, show_sweep

    files = [*vehicles, *(t for t in targets if t.suffix == ".toml")]
    runs = [t for t in targets if t.suffix != ".toml"]
    if len(runs) + bool(files) != 1 or len(runs) > 1:
        raise click.UsageError("Give either one run directory or vehicle files.")
    if (sweep or file) and len(files) != 1:
        raise click.UsageError("--sweep and --output need exactly one vehicle file (--vehicle).")
    if runs:
        run_one(output, "ase", runs[0])
    elif sweep:
        show_sweep(output, files[0], sweep, file)
    else:
        compare_designs(output, files)
