"""Simulation of a log with the model of a run directory, or of a model file."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from auvident.errors import InputError, StageError, UsageError
from auvident.pipeline.freshness import is_of_this_run
from auvident.pipeline.observer import Observer
from auvident.pipeline.planes import planes_of
from auvident.pipeline.remedies import WRITTEN, again, made_again, run_around, typed
from auvident.pipeline.steps import begin_with_kernels
from auvident.pipeline.table import BY_NAME
from auvident.schema.complete import lacking
from auvident.schema.places import beside
from auvident.schema.quoting import clipped
from auvident.storage.artifacts import DAMAGED, as_model, read_json, read_model
from auvident.storage.run_directory import RunDirectory

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from auvident.schema.artifacts import Extrapolation, IdentifiedModel
    from auvident.schema.combined import CombinedModel
    from auvident.schema.trial import Trial
    from auvident.schema.vehicle import Vehicle

REFINED = "refine/model.json"  # goes first, unless what it rests on has changed since
MODELS = "auvident/model/"  # schemas of the models of a plane, pooled ones among them
IDENTIFIED = "identify/model.json"
WHOLE = "combine/model.json"  # of a run of both planes
VEHICLE = "ingest/vehicle.json"
NO_RUN = "is a vehicle file, not a run or a model"
NO_MODEL = "Give a run directory, or a model.json that auvident has written."
USUAL_FINENESS = 8.0  # length over diameter of a survey AUV
SIGNS_ASSUMED = (
    "The model is not in a run directory, so a positive rudder is assumed to turn to port "
    "and a positive elevator to pitch down. Use --vehicle V.toml to state other signs."
)


@dataclass(frozen=True)
class SimulatedTrial:
    """A simulation and what it was made from.

    The band of the columns `of_coefficients` holds `auvident.constants.BAND_SHARE` of the
    models drawn, that of the others as much of the readings. `extrapolation` is where the motion
    leaves the range that the model was identified from.
    """

    trial: str
    model_file: Path
    model: "IdentifiedModel | CombinedModel"
    table: "pd.DataFrame"
    of_coefficients: tuple[str, ...] = ()
    extrapolation: "Mapping[str, Extrapolation]" = field(default_factory=dict)


def find_model(target: Path, plane: str | None = None) -> "tuple[Path, IdentifiedModel]":
    """The model of a run directory (refined, if it was and nothing changed since) or of a file.

    Parameters
    ----------
    target : Path
    plane : str, optional
        Of a run of both planes; without it the first one.

    Raises
    ------
    InputError
        There is no such file, or it is of another kind; its model is of another plane, or a
        combined one.
    StageError
        The run directory has no model, or the file is none.
    """
    from auvident.schema.artifacts import IdentifiedModel
    from auvident.schema.combined import COMBINED

    path = target
    if target.is_dir() or not target.suffix:
        path = _model_of(RunDirectory(target), plane)
    elif not target.exists():
        raise InputError("no such file", str(target), "Give a run directory or a model.json.")
    remedy = made_again(path)
    tree = _tree_of(path, remedy)
    if isinstance(tree, dict) and tree.get("schema") == COMBINED:
        raise InputError(
            "is a combined model already, and not the model of a plane",
            str(path),
            "Give run directories, or the model.json of a plane.",
        )
    schema = tree.get("schema") if isinstance(tree, dict) else None
    if path == target and isinstance(schema, str) and not schema.startswith(MODELS):
        raise StageError(f"is no model: its schema is {clipped(schema)!r}", str(path), WRITTEN)
    model = as_model(tree, IdentifiedModel, path, remedy)
    if missing := lacking(model):
        raise StageError(missing, str(path), remedy)
    if plane not in (None, model.plane):
        raise InputError(f"is a model of the {model.plane} plane", str(path), "Leave out --plane.")
    return path, model


def _tree_of(path: Path, remedy: str) -> Any:
    """Content of a model file; what is named as no JSON file and is none was never a model."""
    try:
        return read_json(path, remedy)
    except StageError as error:
        if path.suffix == ".json" or not error.problem.startswith(DAMAGED):
            raise
        problem = NO_RUN if path.suffix == ".toml" else "is no model"
        raise InputError(problem, str(path), NO_MODEL) from None


def _model_of(run: RunDirectory, plane: str | None) -> Path:
    manifest = run.existing()
    identify = manifest.stages.get("identify")
    if identify is None or not (run / IDENTIFIED).exists():
        remedy = f"Run `auvident identify {typed(run.path)}`."
        raise StageError("there is no identified model", str(run.path), remedy)
    identified, refined = _names_of(run, plane)
    is_refined = is_of_this_run(BY_NAME["refine"], run, manifest)
    return run / (refined if is_refined and (run / refined).exists() else identified)


def _names_of(run: RunDirectory, plane: str | None) -> tuple[str, str]:
    """Identified and refined model of a plane."""
    planes = planes_of(run)
    if plane in (None, planes[0]):
        return IDENTIFIED, REFINED
    if plane not in planes:
        raise StageError(
            f"there is no model of the {plane} plane",
            str(run.path),
            f"Run `auvident identify {typed(run.path)} --plane both`.",
        )
    return beside(IDENTIFIED), beside(REFINED)


def vehicle_of(
    model_file: Path | None, model: "IdentifiedModel", vehicle_file: Path | None, observer: Observer
) -> "Vehicle":
    """The vehicle: as given, or of the run directory that the model stands in.

    Raises
    ------
    StageError
        The run directory is that of another vehicle by now.
    """
    from auvident.schema.vehicle import Vehicle
    from auvident.storage.vehicle_file import load_vehicle

    if vehicle_file is not None:
        return load_vehicle(vehicle_file)
    run = run_around(model_file) if model_file else None
    if run is not None and (run / VEHICLE).exists():
        vehicle = read_model(run / VEHICLE, Vehicle, made_again(run / VEHICLE))
        if (vehicle.body.name, vehicle.hull.length_m) != (model.vehicle, model.length_m):
            raise StageError(
                f"the run has read logs of {vehicle.body.name} since, so that the signs of "
                f"{model.vehicle}, of which the model is, are not known",
                str(run),
                f"Give --vehicle V.toml; `{again(run)}` identifies {vehicle.body.name}.",
            )
        return vehicle
    observer.note(SIGNS_ASSUMED)
    rigid = model.rigid_body
    return bare_vehicle(model.vehicle, rigid.mass_kg, rigid.inertia_kgm2, model.length_m)


def bare_vehicle(name: str, mass_kg: float, izz_kgm2: float, length_m: float) -> "Vehicle":
    """A vehicle of which nothing but the usual signs is taken, to read a log."""
    from auvident.schema.vehicle import Vehicle

    body = {
        "name": name,
        "mass_kg": mass_kg,
        "izz_kgm2": izz_kgm2,
        "origin_from_nose_m": 0.5 * length_m,
    }
    # a hull must stand there
    hull = {"length_m": length_m, "diameter_m": length_m / USUAL_FINENESS}
    return Vehicle.model_validate({"vehicle": body, "hull": hull})


def read_inputs(
    vehicle: "Vehicle",
    log: Path,
    column_map: Path | None,
    rate_hz: float,
    needed: tuple[str, ...],
) -> "Trial":
    """The one trial of a log, with the inputs of a simulation.

    Raises
    ------
    InputError
        There are several.
    """
    from auvident.stages.ingest import ingest
    from auvident.storage.logs import read_column_map, read_trials

    trials = read_trials([log], read_column_map(column_map) if column_map else None, needed)
    if len(trials) > 1:
        names = ", ".join(t.name for t in trials)
        raise InputError("contains several trials", str(log), f"Give one of them: {names}.")
    return ingest(trials[0], vehicle, rate_hz=rate_hz, needed=needed)[0]


def predict(
    target: Path,
    log: Path,
    *,
    plane: str | None = None,
    vehicle_file: Path | None = None,
    column_map: Path | None = None,
    rate_hz: float = 10.0,
    seed: int = 0,
    observer: Observer,
    options: Mapping[str, Any],
) -> SimulatedTrial:
    """Simulate a log with a model.

    Parameters
    ----------
    target : Path
        Run directory or ``model.json``; a combined model (of a run of both planes, unless it is out
        of date), or a vehicle file for its estimate from geometry, is flown in six degrees of
        freedom.
    log : Path
        With the inputs, and the initial state if there is one.
    plane : str, optional
        Of a run of both planes; without it the whole vehicle, and the first one where there is no
        model of that, or the log lacks the fin of the other.
    vehicle_file : Path, optional
        For the signs, where the model stands in no run directory.
    column_map : Path, optional
    rate_hz : float
    seed : int
        Of the models drawn for the band.
    observer : Observer
    options : mapping
        ``window_s``, ``speed_mps`` and ``samples`` of `auvident.stages.simulate.simulate`.
    """
    from auvident.pipeline.whole import is_whole, predict_whole

    found = {"vehicle_file": vehicle_file, "column_map": column_map}
    given: dict[str, Any] = {**found, "rate_hz": rate_hz, "seed": seed, "options": options}
    if is_whole(target):
        if plane:
            what = "is flown as a whole: --plane is for the model of a plane"
            raise UsageError(what, str(target), "Leave out --plane.")
        return predict_whole(target, log, observer=observer, **given)
    whole = None if plane else _whole_of(target, observer)
    if whole is not None:
        try:
            made = predict_whole(whole, log, observer=observer, **given)
        except InputError as error:
            _without_other_fin(target, error, observer)
        else:
            observer.note(f"The whole vehicle is flown ({whole}); --plane chooses a plane.")
            return made
    return _predict_plane(target, log, plane, observer, **given)


def _whole_of(target: Path, observer: Observer) -> Path | None:
    """The model of the whole vehicle in a run directory, made from what the run has now."""
    if not (target.is_dir() and (target / WHOLE).exists()):
        return None
    run = RunDirectory(target)
    if is_of_this_run(BY_NAME["combine"], run, run.existing()):
        return target / WHOLE
    observer.note(
        f"{target / WHOLE} is out of date: the model of one plane is flown. "
        f"`auvident combine {typed(target)} --output FILE.json` makes a new one."
    )
    return None


def _without_other_fin(target: Path, error: InputError, observer: Observer) -> None:
    """Say that a plane is flown alone, as the log lacks an input of the other; else it is wrong."""
    from auvident.stages.simulate import INPUT_COLUMNS

    first = planes_of(RunDirectory(target))[0]
    if not error.lacks or error.lacks in INPUT_COLUMNS[first]:
        raise error
    observer.note(
        f"The log has no {error.lacks}, which the whole vehicle needs: the model of the {first} "
        "plane is flown."
    )


def _predict_plane(
    target: Path,
    log: Path,
    plane: str | None,
    observer: Observer,
    *,
    vehicle_file: Path | None,
    column_map: Path | None,
    rate_hz: float,
    seed: int,
    options: Mapping[str, Any],
) -> SimulatedTrial:
    """Simulate a log with the model of a plane."""
    from auvident.stages.simulate import beyond_range, of_coefficients_alone

    path, model = find_model(target, plane)
    vehicle = vehicle_of(path, model, vehicle_file, observer)
    trial = log_of_inputs(model, vehicle, log, column_map, rate_hz)
    begin_with_kernels(observer)
    table = predict_trial(model, trial, seed, options, observer)
    far = beyond_range(model, table)
    return SimulatedTrial(trial.name, path, model, table, of_coefficients_alone(model), far)


def log_of_inputs(
    model: "IdentifiedModel", vehicle: "Vehicle", log: Path, column_map: Path | None, rate_hz: float
) -> "Trial":
    """The one trial of a log, with the inputs that a model needs."""
    from auvident.stages.simulate import INPUT_COLUMNS

    return read_inputs(vehicle, log, column_map, rate_hz, INPUT_COLUMNS[model.plane])


def predict_trial(
    model: "IdentifiedModel",
    trial: "Trial",
    seed: int,
    options: Mapping[str, Any],
    observer: Observer,
) -> "pd.DataFrame":
    """Simulate a trial with a model; `options` as of `auvident.stages.simulate.simulate`."""
    from auvident.stages.simulate import simulate, unread_starts

    refuse_nonsense(options)
    tell_unread(unread_starts(model, trial, **options), observer)
    return simulate(model, trial, rng=drawn_by(seed), **options)


def drawn_by(seed: int) -> "np.random.Generator":
    """The random numbers of a seed.

    Raises
    ------
    UsageError
        A negative one.
    """
    import numpy as np

    if seed < 0:
        raise UsageError(f"{seed} is no seed", "--seed", "Give 0, or a whole number above it.")
    return np.random.default_rng(seed)


def refuse_nonsense(options: Mapping[str, Any]) -> None:
    """Refuse a speed that no simulation begins at, and a number of models that is none."""
    speed, samples = options.get("speed_mps"), options.get("samples", 0)
    if speed is not None and not 0.0 <= speed < math.inf:
        raise UsageError(
            f"{speed:g} m/s", "--speed", "Give a speed ahead, or 0 for a start at rest."
        )
    if samples < 0:
        raise UsageError(f"{samples} models", "--samples", "Give 0, or how many to draw.")


def tell_unread(starts: Sequence[float], observer: Observer) -> None:
    """Say where a motion begins on a straight run although velocities are logged."""
    for start in starts:
        observer.note(
            f"No velocity is known about {start:.1f} s: the motion begins there on a straight run "
            "at the speed that the propeller keeps. --from begins elsewhere, --speed at a speed."
        )
