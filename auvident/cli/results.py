"""Commands that look at run directories."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from auvident.cli.common import (
    MOST_SEED,
    OUTSIDE,
    PATH,
    RUN,
    Natural,
    Output,
    command,
    completing,
    refuse_no_table,
    write_table,
)
from auvident.cli.ending import of_comparison, told_in_files
from auvident.cli.precious import refuse_precious
from auvident.constants import BAND_SHARE
from auvident.schema.places import BESIDE
from auvident.schema.planes import PLANES, Plane

if TYPE_CHECKING:
    import pandas as pd

    from auvident.cli.watch import Watch
    from auvident.pipeline.predict import SimulatedTrial

    _OfTexts = click.Choice[str]
else:
    _OfTexts = click.Choice  # which takes no type before click 8.2

MOST_SAMPLES = 10_000  # of a band: its edge is then known to 1 % of its width
# of the files in RUN/simulate, by the folder that the model stands in
MADE_OF = {BESIDE: f"-{BESIDE}", "combine": "-whole"}
OF_MODELS_ALONE = (
    "the band holds 95 % of the sampled models, not of the readings: no maneuver left out tells of "
    "the errors of sensors and equations."
)


def plane_option(default: str = "the first", only: str = "") -> Any:
    """``--plane`` of a command; `default` is what is taken without it, `only` where it serves."""
    words = f"Plane of a run that has both{only}.  [default: {default}]"
    return click.option("--plane", type=click.Choice(PLANES), help=words)


PLANE = plane_option()


@command("status", "auvident status runs/demo")
@RUN
def status(output: Output, run: Path) -> None:
    """Show which stages are done, stale, missing or not needed, and why.

    With --verbose also where the libraries are no longer those that a stage was run with: results
    are the same to the last bit only with the same ones.
    """
    from auvident.pipeline import status as judge
    from auvident.report.console import status_table
    from auvident.storage.lock import worker
    from auvident.versions import changed

    at_work = worker(run)
    decisions, manifest = judge(run)
    rows = []
    for decision in decisions:
        entry, attempt = manifest.stages.get(decision.stage), manifest.failed.get(decision.stage)
        rows.append(
            {
                "stage": decision.stage,
                "state": decision.state,
                "reason": decision.reason,
                "ended_at": entry.ended_at if entry else None,
                "outputs": sorted(entry.outputs) if entry else [],
                "failed": attempt,
                "libraries_changed": changed(entry.libraries) if entry else {},
                "libraries_known": bool(entry and entry.libraries),
            }
        )
    with output.watch() as watch:
        watch.show(status_table(run, rows))
        if at_work:
            watch.note(f"In use, so that this may change: {at_work.words}")
        if output.verbose:
            for line in _other_libraries(rows):
                watch.note(line)
    in_use = at_work.words if at_work else None
    told = {"schema": "auvident/status/1", "run": str(run), "stages": rows, "in_use": in_use}
    output.artifact(told, "status")


def _other_libraries(rows: list[dict[str, Any]]) -> list[str]:
    """Libraries that changed since stages were run, with the stages."""
    stages: dict[str, list[str]] = {}
    for row in rows:
        for name, (old, new) in row["libraries_changed"].items():
            stages.setdefault(f"{name} was {old}, is {new}", []).append(row["stage"])
    unknown = [row["stage"] for row in rows if row["outputs"] and not row["libraries_known"]]
    lines = [f"{text}: {', '.join(names)}" for text, names in stages.items()]
    lines += [f"libraries not recorded: {', '.join(unknown)}"] if unknown else []
    return lines or ["The libraries are those that the stages were run with."]


@command(
    "simulate",
    "auvident simulate runs/demo --inputs sample_logs/harbour_trial --from 1373 --to 1448",
    "auvident simulate runs/demo --maneuver zigzag:20/20 --output zigzag.csv",
    "auvident simulate sample_logs/remus100.toml --maneuver turning-circle:15 --speed 1.5",
)
@click.argument("target", metavar="RUN|MODEL|VEHICLE.toml", type=PATH)
@click.option("--inputs", "log", type=PATH, help="Log with the inputs (rudder or elevator, rpm).")
@click.option(
    "--maneuver",
    metavar="NAME[:NUMBERS]",
    shell_complete=completing("desk_maneuvers"),
    help="Standard maneuver: turning-circle:15, zigzag:10/10, spiral:25, pull-out:15, depth-step:5 "
    "or vertical-zigzag:10/5 (deg, m; the defaults).",
)
@plane_option("the whole vehicle, else the first", only=", for --inputs")
@click.option("--from", "from_s", type=float, metavar="SECONDS", help="Start of the simulation.")
@click.option("--to", "to_s", type=float, metavar="SECONDS", help="End of the simulation.")
@click.option(
    "--speed",
    "speed_mps",
    type=float,
    metavar="MPS",
    help="With --inputs, start from a straight run at this speed, not from the measured state; "
    "with --maneuver, speed of the approach.  [default: that of the trial, else of the vehicle "
    "file]",
)
@click.option(
    "--rpm",
    type=float,
    help="Propeller rate of the maneuver, 1/min.  [default: what the speed needs]",
)
@click.option(
    "--rudder-rate",
    "rudder_rate_degps",
    type=float,
    metavar="DEGPS",
    help="Servo speed in the maneuver, deg/s.  [default: that of the model, else 25, at most 93 "
    "deg in the time L/U]",
)
@click.option(
    "--vehicle", type=PATH, help="Vehicle file, for a MODEL that is not in a run directory."
)
@click.option("--map", "map_", type=PATH, help="Column map: names, units and signs (TOML).")
@click.option(
    "--rate",
    "rate_hz",
    type=float,
    metavar="HZ",
    help="Sampling rate of the log.  [default: 10]",
)
@click.option(
    "--samples",
    type=Natural(MOST_SAMPLES),
    default=100,
    help="Models sampled for the uncertainty band, at most 10000.  [default: 100]",
)
@OUTSIDE
@click.option("--output", "file", type=PATH, help="Output file (.parquet or .csv).")
@click.option("--figure", type=PATH, help="Picture of a maneuver (.svg or .png).")
@click.option(
    "--seed",
    type=Natural(MOST_SEED),
    default=0,
    help="Seed of the sampling.  [default: 0]",
)
def simulate(
    output: Output,
    target: Path,
    log: Path | None,
    maneuver: str | None,
    plane: str | None,
    from_s: float | None,
    to_s: float | None,
    speed_mps: float | None,
    rpm: float | None,
    rudder_rate_degps: float | None,
    vehicle: Path | None,
    map_: Path | None,
    rate_hz: float | None,
    samples: int,
    file: Path | None,
    figure: Path | None,
    seed: int,
) -> None:
    """Predict the motion from the inputs of a log, or fly a standard maneuver.

    With --inputs it starts from the measured state if the log has one, else on a straight run at
    --speed or at the steady speed of the first propeller rate. A RUN of both planes
    flies the whole vehicle, unless --plane is given. The band holds 95 % of the readings; where the
    errors of a model are not known (from geometry, of few maneuvers, roll), it holds 95 % of the
    sampled models, and that is said. The table is written to --output, else to RUN/simulate, else
    (MODEL) to standard output.

    With --maneuver it starts from a steady straight run. A RUN, a MODEL or a VEHICLE.toml will do;
    of the last its [coefficients] are used, the others are estimated from geometry. Angles on the
    command line are positive to starboard, or bow up; depths, downwards. The intervals hold 90 %
    of the sampled models. The table is written to --output, with the signs of the axes (a positive
    rudder turns to port, a positive elevator pitches down).
    """
    if (log is None) == (maneuver is None):
        raise click.UsageError("Give either --inputs LOG or --maneuver NAME.")
    refuse_no_table(file)
    for written in (file, figure):
        refuse_precious(written, target, log, vehicle, map_)
    if maneuver is not None:
        logged: dict[str, Any] = {
            "--from": from_s,
            "--to": to_s,
            "--vehicle": vehicle,
            "--map": map_,
            "--rate": rate_hz,
        }
        _refuse(logged | {"--plane": plane}, "--inputs")
        asked = {"speed_mps": speed_mps, "rpm": rpm, "rudder_rate_degps": rudder_rate_degps}
        asked |= {"samples": samples, "seed": seed}
        return _fly(output, target, maneuver, asked, file, figure)
    assert log is not None
    steered: dict[str, Any] = {"--rpm": rpm, "--rudder-rate": rudder_rate_degps}
    _refuse({**steered, "--figure": figure}, "--maneuver")
    window = (-math.inf if from_s is None else from_s, math.inf if to_s is None else to_s)
    options = {"window_s": window, "speed_mps": speed_mps, "samples": samples}
    data: dict[str, Any] = {"vehicle_file": vehicle, "column_map": map_, "plane": plane}
    data |= {"rate_hz": 10.0 if rate_hz is None else rate_hz, "seed": seed}
    return _predict(output, target, log, data, options, file)


def _refuse(given: dict[str, Any], other: str) -> None:
    """Options that only go with another one."""
    for name, value in given.items():
        if value is not None:
            raise click.UsageError(f"{name} can only be used with {other}.")


def _predict(
    output: Output,
    target: Path,
    log: Path,
    data: dict[str, Any],
    options: dict[str, Any],
    file: Path | None,
) -> None:
    from auvident.pipeline.predict import predict
    from auvident.report.held_out_words import beyond
    from auvident.storage.run_directory import RunDirectory

    with output.watch() as watch:
        tell_outdated(watch, target)
        made = predict(target, log, observer=watch, options=options, **data)
        if file is None and target.is_dir():
            of = MADE_OF.get(made.model_file.parent.name, "")
            name = f"simulate/{made.trial}{of}.parquet"
            RunDirectory(target).refuse_link(name)
            file = target / name
            _write_in_run(made.table, file)
        elif file is not None:
            write_table(made.table, file)
        if file is not None:
            watch.note(f"{len(made.table)} rows written to {file} (model: {made.model_file})")
        bare = [c for c in made.of_coefficients if f"{c}_low" in made.table]
        if bare:
            watch.note(f"{', '.join(bare)}: {OF_MODELS_ALONE}")
        for line in beyond({made.trial: made.extrapolation}):
            watch.note(line)
        begun = made.table.loc[made.table["stretch"].diff().fillna(1) != 0, "time_s"]
        if len(begun) > 1:
            times = ", ".join(f"{time:.1f}" for time in begun[:MOST_TIMES])
            times += ", ..." if len(begun) > MOST_TIMES else ""
            watch.note(STRETCHES.format(len(begun), times))
    if output.json:
        columns = {name: values.tolist() for name, values in made.table.items()}
        simulation = {"schema": "auvident/simulation/1", "trial": made.trial, "columns": columns}
        far = {name: e.model_dump() for name, e in made.extrapolation.items()}
        told = {"band": _band_of(made), "extrapolation": far}
        output.artifact(simulation | told, "simulation")
    elif file is None:
        output.text(made.table.to_csv(index=False).rstrip("\n"))


def _write_in_run(table: "pd.DataFrame", file: Path) -> None:
    """Write a table where nobody has named a file; the run may be one that is only read."""
    from auvident.errors import InputError

    try:
        write_table(table, file)
    except OSError as error:
        what = f"cannot be written: {error.strerror}"
        raise InputError(what, str(file), "Give another place with --output FILE.") from None


MOST_TIMES = 5  # that are listed
STRETCHES = (
    "Inputs are missing in between: the motion is predicted in {} stretches, which begin anew at "
    "{} s (column stretch)."
)


def tell_outdated(watch: "Watch", *targets: Path) -> None:
    """Say of run directories what changed since their models were made, which are taken as is."""
    from auvident.pipeline.freshness import outdated

    for line in filter(None, map(outdated, filter(Path.is_dir, targets))):
        watch.note(line)


def _band_of(made: "SimulatedTrial") -> dict[str, Any]:
    """What the band of each column holds a share of: readings, or the models drawn."""
    banded = [c for c in made.table if f"{c}_low" in made.table]
    readings = [c for c in banded if c not in made.of_coefficients]
    models = [c for c in banded if c in made.of_coefficients]
    return {"share": BAND_SHARE, "of_readings": readings, "of_sampled_models": models}


def _fly(
    output: Output,
    target: Path,
    maneuver: str,
    asked: dict[str, Any],
    file: Path | None,
    figure: Path | None,
) -> None:
    from auvident.pipeline.desk import Asked, fly_on_desk, with_columns
    from auvident.report.desk import desk_pieces

    form = _picture_form(figure)
    with output.watch() as watch:
        tell_outdated(watch, target)
        desk = fly_on_desk(target, maneuver, Asked(**asked), watch)
        for piece in desk_pieces(desk.result):
            watch.show(piece)
        if file is not None:
            write_table(desk.table, file)
            watch.note(f"{len(desk.table)} rows written to {file} (model: {desk.result.model})")
        if figure is not None:
            from auvident.report.figures_desk import desk_figure
            from auvident.storage.artifacts import write_bytes

            write_bytes(figure, desk_figure(desk.result, desk.table, desk.drawn_ways, form))
            watch.note(f"picture written to {figure}")
    output.artifact(with_columns(desk), "desk")


def _picture_form(figure: Path | None) -> str:
    """``svg`` or ``png``, by the end of the file's name."""
    from auvident.errors import UsageError

    form = "svg" if figure is None else figure.suffix.removeprefix(".")
    if form not in ("svg", "png"):
        raise UsageError(
            "is neither a .svg nor a .png file",
            str(figure),
            "Give a file name that ends in .svg or .png.",
        )
    return form


class ExportForm(_OfTexts):
    """A format of `export`; of one that cannot hold the model it says why."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        """The format by its name."""
        if str(value).lower() == "stonefish":
            self.fail(NO_STONEFISH, param, ctx)
        return super().convert(value, param, ctx)


NO_STONEFISH = (
    "Stonefish cannot hold the model: it computes drag and added mass itself from the shape of the "
    "hull and takes no hydrodynamic derivatives. Use fmu, pvs, gz or uuv."
)


@command(
    "export",
    "auvident export runs/demo --format python --output remus100_model.py",
    "auvident export runs/demo --format fmu --output remus100.fmu",
    "auvident export runs/demo --format toml",
)
@click.argument("target", metavar="RUN|MODEL|VEHICLE.toml", type=PATH)
@click.option(
    "--format",
    "form",
    type=ExportForm(["json", "toml", "csv", "python", "matlab", "c", "fmu", "pvs", "gz", "uuv"]),
    help="Form of the model.  [default: by the suffix of --output, else json]",
)
@click.option("--output", "file", type=PATH, help="Output file.  [default: standard output]")
@PLANE
@OUTSIDE
def export(
    output: Output, target: Path, form: str | None, file: Path | None, plane: str | None
) -> None:
    """Write the model for use elsewhere.

    python, matlab and c are self-contained functions with the equations, servo and propeller, that
    predict what auvident simulate does; toml is a [coefficients] table for a vehicle file. c is a
    source file that begins with its header, which FILE.c has beside it as FILE.h, too. fmu is a
    unit of FMI 2.0 for co-simulation.

    pvs is a class for PythonVehicleSimulator, gz a world of gz-sim, uuv a model of uuv_simulator
    and Plankton: of six degrees of freedom from a combined model, or from a run that has one,
    unless --plane is given, and of a VEHICLE.toml its estimate from geometry. What a simulator
    cannot hold is listed, and what it costs.
    """
    from auvident.pipeline.exporting import export_model, write_export

    refuse_precious(file, target)
    if form is None:
        form = FORM_OF_SUFFIX.get(file.suffix, "json") if file else "json"
    with output.watch() as watch:
        made = export_model(target, form, plane, to_file=file is not None)
        if file is not None:
            write_export(made, form, file)
            watch.note(f"{made.source} written as {form} to {file}")
        for line in made.notes:
            watch.note(line)
        tell_outdated(watch, target)
    if file is None and not output.json:
        output.text(made.content.decode().rstrip("\n"))
    output.artifact(made.model, str(made.source))


FORM_OF_SUFFIX = {
    ".json": "json",
    ".toml": "toml",
    ".csv": "csv",
    ".py": "python",
    ".m": "matlab",
    ".c": "c",
    ".fmu": "fmu",
    ".sdf": "gz",
}


def read_share(ctx: click.Context, parameter: click.Parameter, text: str | None) -> float | None:
    """Share of a whole, as ``10%`` or ``0.1``."""
    if text is None:
        return None
    try:
        share = float(text.removesuffix("%")) * (0.01 if text.endswith("%") else 1.0)
    except ValueError:
        share = math.nan
    if not 0.0 <= share < math.inf:
        raise click.BadParameter(f"{text!r} is not a share: give 10% or 0.1")
    return share


@command(
    "compare",
    "auvident compare runs/demo runs/other",
    "auvident compare runs/demo runs/other --fail-if-worse 10%",
)
@told_in_files(of_comparison)
@click.argument("runs", metavar="RUN RUN...", nargs=-1, required=True, type=PATH)
@click.option(
    "--fail-if-worse",
    "share",
    metavar="SHARE",
    callback=read_share,
    help="Exit with code 1 if a held-out error exceeds that of the last run, the baseline, by "
    "more than this share (10% or 0.1).",
)
def compare(output: Output, runs: tuple[Path, ...], share: float | None) -> None:
    """Show coefficients and held-out errors of several runs side by side.

    --fail-if-worse holds each run against the last one. It fails as well where they cannot be
    compared: another vehicle or plane, no held-out error, a prediction that diverges.
    """
    from auvident.pipeline.compare import compare_runs
    from auvident.report.console import comparison_tables

    if len(runs) < 2:
        raise click.UsageError("Give at least two run directories.")
    comparison = compare_runs(runs)
    with output.watch() as watch:
        for table in comparison_tables(comparison):
            watch.show(table)
    output.artifact(comparison, "compare")
    output.end.compare(comparison, share)


@command("plan-trial", "auvident plan-trial runs/demo")
@RUN
@PLANE
def plan_trial(output: Output, run: Path, plane: Plane | None) -> None:
    """Rank further maneuvers by what they would tell about the coefficients.

    Candidates are simulated with the identified model. What each would add is stated as the
    expected gain of information, and as the factor by which standard deviations would shrink.
    """
    from auvident.pipeline.ask import plan_trial as rank
    from auvident.report.console import trial_plan_table

    with output.watch() as watch:
        plan = rank(run, watch, plane)
        tell_outdated(watch, run)
        watch.show(trial_plan_table(plan))
    output.artifact(plan, "plan-trial")
