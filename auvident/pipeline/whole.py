"""Models of six degrees of freedom: made from run directories, found again, flown on a log."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from auvident.errors import InputError, StageError, UsageError
from auvident.pipeline.observer import Observer
from auvident.pipeline.predict import (
    NO_RUN,
    SIGNS_ASSUMED,
    VEHICLE,
    SimulatedTrial,
    bare_vehicle,
    drawn_by,
    find_model,
    read_inputs,
    refuse_nonsense,
    tell_unread,
)
from auvident.pipeline.remedies import COMBINE, made_again
from auvident.schema.combined import COMBINED, CombinedModel
from auvident.schema.complete import lacking_of_whole
from auvident.schema.planes import PLANES
from auvident.storage.artifacts import Model, read_json, read_model
from auvident.storage.run_directory import MANIFEST, RunDirectory

if TYPE_CHECKING:
    import pandas as pd

    from auvident.schema.artifacts import IdentifiedModel, Maneuvers
    from auvident.schema.trial import Trial
    from auvident.schema.vehicle import Vehicle

ESTIMATE = "ase/coefficients.json"
BESIDE = PLANES[1]  # folder of the other plane in that of a stage
SPEAKS_OF_ONE = "Combine runs of one vehicle, with the same vehicle file."


def combine_runs(
    targets: Sequence[Path], vehicle_file: Path | None = None
) -> "tuple[CombinedModel, tuple[Path, ...]]":
    """One model of six degrees of freedom from runs, and the models that went in.

    Parameters
    ----------
    targets : sequence of Path
        Run directories, of one plane or of both, or files of models.
    vehicle_file : Path, optional
        In place of that of the runs; needed where no run is given.

    Raises
    ------
    UsageError
        Nothing to combine; two models of one plane.
    InputError
        Models of different vehicles; no vehicle file; a vehicle file in place of a model.
    StageError
        A run without a model.
    """
    from auvident.schema.artifacts import AseResult
    from auvident.stages.ase import estimate
    from auvident.stages.combine import combine

    if not targets and vehicle_file is None:
        raise UsageError("there is nothing to combine", "runs", "Name run directories or models.")
    found = [pair for target in targets for pair in models_of(target)]
    vehicle = _one_vehicle(targets, vehicle_file)
    runs = [] if vehicle_file else [t for t in targets if (t / ESTIMATE).exists()]
    ase = _read(runs[0] / ESTIMATE, AseResult) if runs else estimate(vehicle)
    models = [model for _, model in found]
    combined = combine(models, vehicle, ase, logs=[_logs(t) for t in targets if t.is_dir()])
    files = tuple(path for path, _ in found)
    sources = [
        source.model_copy(update={"file": str(path)})
        for source, path in zip(combined.models, files, strict=True)
    ]
    return combined.model_copy(update={"models": tuple(sources)}), files


def _read(file: Path, kind: type[Model]) -> Model:
    """An artifact of a run, as its class."""
    return read_model(file, kind, made_again(file))


def _logs(target: Path) -> "tuple[list[Trial], Maneuvers]":
    """Trials and maneuvers of a run: of what the identification used, roll can be seen."""
    from auvident.pipeline.given import Given

    given = Given(RunDirectory(target))
    return list(given.trials), given.maneuvers


def models_of(target: Path) -> "list[tuple[Path, IdentifiedModel]]":
    """The models of a run, that of the other plane where it has one, or that of a file."""
    from auvident.schema.artifacts import IdentifiedModel

    if target.suffix == ".toml":
        raise InputError(
            NO_RUN,
            str(target),
            "Give run directories or files of models; a vehicle file goes with --vehicle. "
            "`auvident simulate` flies one as it is.",
        )
    path, model = find_model(target)
    found = [(path, model)]
    other = path.parent / BESIDE / path.name
    if path != target and not other.exists():  # refined in one plane only
        other = path.parents[1] / "identify" / BESIDE / path.name
    if path != target and other.exists():
        found.append((other, _read(other, IdentifiedModel)))
    return found


def _one_vehicle(targets: Sequence[Path], vehicle_file: Path | None) -> "Vehicle":
    """The vehicle of all runs."""
    from auvident.schema.vehicle import Vehicle
    from auvident.storage.vehicle_file import load_vehicle

    if vehicle_file is not None:
        return load_vehicle(vehicle_file)
    vehicles = {t: _read(t / VEHICLE, Vehicle) for t in targets if (t / VEHICLE).exists()}
    if not vehicles:
        raise InputError(
            "the vehicle is unknown: a model file does not describe the other plane",
            str(targets[0]),
            "Give the run directory, or --vehicle V.toml.",
        )
    (first, vehicle), *others = vehicles.items()
    for path, other in others:
        for part in ("hull", "fin", "propeller"):
            if getattr(other, part) != getattr(vehicle, part):
                raise InputError(
                    f"the runs are of different vehicles: [{part}] is not the same",
                    f"{first}, {path}",
                    SPEAKS_OF_ONE,
                )
    return vehicle


def is_whole(target: Path) -> bool:
    """Whether a file is a combined model, or a vehicle file, which is flown from its geometry."""
    if target.is_dir() or not target.exists():
        return False
    if target.suffix == ".toml":
        return True
    if target.suffix != ".json":
        return False
    tree = read_json(target, made_again(target))
    return isinstance(tree, dict) and tree.get("schema") == COMBINED


def find_whole(target: Path) -> "tuple[CombinedModel, Vehicle | None]":
    """A combined model from its file, or from a vehicle file by geometry and [coefficients]."""
    from auvident.stages.ase import estimate
    from auvident.stages.combine import combine
    from auvident.storage.vehicle_file import load_vehicle

    if target.suffix == ".toml":
        vehicle = load_vehicle(target)
        return combine([], vehicle, estimate(vehicle)), vehicle
    if target.exists() and not is_whole(target):
        raise InputError(
            "is no model of six degrees of freedom",
            str(target),
            "`auvident combine` makes one of run directories and of models of a plane.",
        )
    return read_whole(target), None


def read_whole(file: Path) -> CombinedModel:
    """A combined model from its file; `StageError` where it lacks what it is flown with."""
    remedy = made_again(file, COMBINE)
    model = read_model(file, CombinedModel, remedy)
    if missing := lacking_of_whole(model):
        raise StageError(missing, str(file), remedy)
    return model


def predict_whole(
    target: Path,
    log: Path,
    *,
    vehicle_file: Path | None = None,
    column_map: Path | None = None,
    rate_hz: float = 10.0,
    seed: int = 0,
    observer: Observer,
    options: Mapping[str, Any],
) -> SimulatedTrial:
    """Simulate a log in six degrees of freedom; see `auvident.pipeline.predict.predict`."""
    from auvident.stages.combine import beyond_ranges, of_coefficients_alone

    model, vehicle = find_whole(target)
    vehicle = signs_of(target, model, vehicle, vehicle_file, observer)
    trial = log_of_all_inputs(vehicle, log, column_map, rate_hz)
    table = predict_whole_trial(model, trial, seed, options, observer)
    far = beyond_ranges(model, table)
    return SimulatedTrial(trial.name, target, model, table, of_coefficients_alone(model), far)


def log_of_all_inputs(
    vehicle: "Vehicle", log: Path, column_map: Path | None, rate_hz: float
) -> "Trial":
    """The one trial of a log, with the inputs of both planes."""
    from auvident.stages.combine import INPUT_COLUMNS

    return read_inputs(vehicle, log, column_map, rate_hz, INPUT_COLUMNS)


def predict_whole_trial(
    model: CombinedModel,
    trial: "Trial",
    seed: int,
    options: Mapping[str, Any],
    observer: Observer,
) -> "pd.DataFrame":
    """Simulate a trial; `options` as of `auvident.stages.combine.simulate_whole`."""
    from auvident.stages.combine import simulate_whole, unread_starts

    refuse_nonsense(options)
    tell_unread(unread_starts(trial, **options), observer)
    return simulate_whole(model, trial, rng=drawn_by(seed), **options)


def signs_of(
    target: Path | None,
    model: "CombinedModel",
    own: "Vehicle | None",
    vehicle_file: Path | None,
    observer: Observer,
) -> "Vehicle":
    """The vehicle for the signs of a log: as given, of the model's file, or of its run."""
    from auvident.schema.vehicle import Vehicle
    from auvident.storage.vehicle_file import load_vehicle

    if vehicle_file is not None:
        return load_vehicle(vehicle_file)
    if own is not None:
        return own
    folders = [*(list(target.resolve().parents)[1:2] if target else ()), *_folders(model)]
    runs = [f for f in folders if (f / MANIFEST).exists() and (f / VEHICLE).exists()]
    vehicles = [_read(run / VEHICLE, Vehicle) for run in runs]
    for found in vehicles:  # another run may stand at that path by now
        if (found.body.name, found.hull.length_m) == (model.vehicle, model.length_m):
            return found
    observer.note(SIGNS_ASSUMED)
    values = model.values()
    return bare_vehicle(model.vehicle, values["m"], values["I_zz"], model.length_m)


def _folders(model: "CombinedModel") -> list[Path]:
    """Where the runs may be that a model was made from."""
    files = [Path(source.file) for source in model.models if source.file]
    return [parent for file in files for parent in list(file.parents)[1:3]]


def write_combined(model: "CombinedModel", file: Path) -> None:
    """Write a combined model to a file."""
    from auvident.storage.artifacts import json_bytes, write_bytes

    write_bytes(file, json_bytes(model, str(file)))


__all__ = [
    "combine_runs",
    "find_whole",
    "is_whole",
    "models_of",
    "predict_whole",
    "write_combined",
]
