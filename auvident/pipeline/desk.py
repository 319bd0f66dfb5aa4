"""Standard maneuvers on the desk: the model of a run, of a file, or of a vehicle file."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from auvident.constants import USUAL_SPEED_MPS
from auvident.errors import InputError, StageError
from auvident.pipeline.freshness import is_of_this_run
from auvident.pipeline.observer import Observer
from auvident.pipeline.predict import drawn_by, find_model, refuse_nonsense
from auvident.pipeline.remedies import made_again, run_around, typed
from auvident.pipeline.steps import COMPILING, COMPILING_EACH_TIME
from auvident.pipeline.table import BY_NAME
from auvident.pipeline.whole import is_whole, read_whole
from auvident.schema.combined import CombinedModel
from auvident.schema.desk import DeskOrder, desk_order
from auvident.storage.artifacts import read_model
from auvident.storage.run_directory import RunDirectory

if TYPE_CHECKING:
    import numpy as np

    from auvident.schema.artifacts import AseResult, IdentifiedModel
    from auvident.schema.vehicle import Vehicle
    from auvident.stages.desk import Desk, DeskModel

ESTIMATED = "ase/coefficients.json"
SECOND_PLANE = ("refine/vertical/model.json", "identify/vertical/model.json")
MANEUVERS = {"horizontal": "turns or zigzags", "vertical": "dives or zigzags of the elevator"}
SPEED_ASSUMED = (
    f"The speed of the approach is {USUAL_SPEED_MPS:g} m/s, as neither --speed nor --rpm is given "
    "and neither a run directory nor design_speed_mps of a vehicle file tells another."
)
SPEED_OF_MODEL = (
    "The speed of the approach is {:.3g} m/s, the middle of those that the model was identified "
    "from, as neither --speed nor --rpm is given and its run directory is not found."
)


@dataclass(frozen=True)
class Asked:
    """What was asked for beside the maneuver."""

    speed_mps: float | None = None
    rpm: float | None = None
    rudder_rate_degps: float | None = None
    samples: int = 100
    seed: int = 0


def fly_on_desk(target: Path, maneuver: str, asked: Asked, observer: Observer) -> "Desk":
    """Fly a maneuver with the model of a target.

    Parameters
    ----------
    target : Path
        Run directory, ``model.json``, or vehicle file (TOML).
    maneuver : str
        As on the command line, e.g. ``zigzag:10/10``.
    asked : Asked
    observer : Observer

    Raises
    ------
    UsageError
        No such maneuver.
    InputError, StageError
        The target has no model of the plane that the maneuver needs.
    NumericsError
        The model cannot fly it.
    """
    order = desk_order(maneuver)
    if target.suffix != ".toml" and not (target.exists() or not target.suffix):
        raise InputError(
            "no such file", str(target), "Give a run directory, a model.json or a vehicle file."
        )
    if target.suffix != ".toml" and is_whole(target):
        whole = read_whole(target)
        return fly_whole(whole, str(target), order, asked, observer)
    if target.suffix == ".toml":
        models, usual = _of_vehicle(target, order, asked, observer)
    else:
        path, model = _model_for(target, order)
        return fly_model(model, path, order, asked, observer)
    return fly_models(models, usual, order, asked, observer)


def fly_model(
    model: "IdentifiedModel", path: Path | None, order: DeskOrder, asked: Asked, observer: Observer
) -> "Desk":
    """Fly a maneuver with an identified model; `path` is its file, where it has one."""
    from auvident.stages.desk import identified_models

    if model.plane != order.row.plane:
        raise _of_other_plane(model, str(path or model.vehicle), order)
    name = str(path) if path else f"model of {model.vehicle}"
    usual = _speed_of_trial(path, model.vehicle) if path else None
    usual = usual or _speed_of_model(model.flown, asked, observer)
    models = identified_models(model, name, asked.samples, _rng(asked))
    return fly_models(models, usual, order, asked, observer)


def fly_whole(
    model: CombinedModel, name: str, order: DeskOrder, asked: Asked, observer: Observer
) -> "Desk":
    """Fly a maneuver with a model of six degrees of freedom, restricted to its plane.

    `name` is its file, or the vehicle file that it was estimated from; else that of the vehicle.
    """
    from auvident.stages.desk import combined_models

    plane = order.row.plane
    models = combined_models(model, plane, name, asked.samples, _rng(asked))
    usual = _speed_of_whole(model, Path(name), plane)
    if usual is None:
        flown = model.flown.get(plane) or next(iter(model.flown.values()), {})
        usual = _speed_of_model(flown, asked, observer)
    return fly_models(models, usual, order, asked, observer)


def fly_estimate(
    ase: "AseResult",
    vehicle: "Vehicle",
    name: str,
    order: DeskOrder,
    asked: Asked,
    observer: Observer,
) -> "Desk":
    """Fly a maneuver with the estimate from geometry, with what the vehicle gives in its place."""
    return fly_models(
        _estimated(ase, vehicle, name, order, asked), ase.speed_mps, order, asked, observer
    )


def fly_models(
    models: "DeskModel",
    usual_mps: float | None,
    order: DeskOrder,
    asked: Asked,
    observer: Observer,
) -> "Desk":
    """Fly a maneuver with models of its plane; `usual_mps` is the speed where none is asked for."""
    from auvident.jit import cache_is_writable, has_compiled
    from auvident.stages.desk import Approach, fly_maneuver

    if not has_compiled("fleet._step"):
        observer.note(COMPILING if cache_is_writable() else COMPILING_EACH_TIME)
    approach = Approach(
        asked.speed_mps, asked.rpm, asked.rudder_rate_degps, usual_mps or USUAL_SPEED_MPS
    )
    return fly_maneuver(models, order, approach, observer.progress)


def _rng(asked: Asked) -> "np.random.Generator":
    refuse_nonsense({"samples": asked.samples})
    return drawn_by(asked.seed)


def _of_vehicle(
    target: Path, order: DeskOrder, asked: Asked, observer: Observer
) -> "tuple[DeskModel, float]":
    """The estimate from a vehicle file, with what it gives, and its design speed."""
    from auvident.stages.ase import estimate
    from auvident.storage.vehicle_file import load_vehicle

    vehicle = load_vehicle(target)
    usual = vehicle.body.design_speed_mps or _speed_of_model({}, asked, observer)
    return _estimated(estimate(vehicle), vehicle, str(target), order, asked), usual


def _estimated(
    ase: "AseResult", vehicle: "Vehicle", name: str, order: DeskOrder, asked: Asked
) -> "DeskModel":
    """Models of an estimate in the plane of the maneuver."""
    from auvident.stages.desk import estimated_models
    from auvident.stages.identify.setup import rigid_body

    plane = order.row.plane
    rigid = rigid_body(vehicle, plane)
    return estimated_models(ase, rigid, plane, name, asked.samples, _rng(asked))


def _speed_of_trial(path: Path, vehicle: str) -> float | None:
    """Speed that the estimate in the run around a model was made for, if it is of its vehicle."""
    from auvident.schema.artifacts import AseResult

    run = run_around(path)
    if run is None or not (run / ESTIMATED).exists():
        return None
    found = read_model(run / ESTIMATED, AseResult, made_again(run / ESTIMATED))
    return found.speed_mps if found.vehicle == vehicle else None


def _speed_of_whole(model: CombinedModel, own: Path, plane: str) -> float | None:
    """Speed of the trial behind a plane of a combined model, or of its vehicle file."""
    from auvident.storage.vehicle_file import load_vehicle

    if own.suffix == ".toml" and own.is_file():
        return load_vehicle(own).body.design_speed_mps
    nearest_first = sorted(model.models, key=lambda source: source.plane != plane)
    files = [*(Path(source.file) for source in nearest_first), own]
    speeds = (_speed_of_trial(file, model.vehicle) for file in files if file.is_file())
    return next((speed for speed in speeds if speed is not None), None)


def _speed_of_model(flown: Mapping[str, float], asked: Asked, observer: Observer) -> float:
    """The middle of the speeds flown, or the usual one; which it is, is said where it counts."""
    middle = 0.5 * (flown.get("u", 0.0) + flown.get("u_low", 0.0))
    known = middle > 0.0
    if asked.speed_mps is None and asked.rpm is None:
        observer.note(SPEED_OF_MODEL.format(middle) if known else SPEED_ASSUMED)
    return middle if known else USUAL_SPEED_MPS


def _of_other_plane(model: "IdentifiedModel", where: str, order: DeskOrder) -> InputError:
    needed = order.row.plane
    return InputError(
        f"is a model of the {model.plane} plane, and {order.row.name} needs one of the "
        f"{needed} plane",
        where,
        f"Identify with `--plane {needed}`, or give the run directory or the vehicle file.",
    )


def _model_for(target: Path, order: DeskOrder) -> "tuple[Path, IdentifiedModel]":
    """The model of the plane of a maneuver; a run may have one of each."""
    path, model = find_model(target)
    needed = order.row.plane
    if model.plane == needed:
        return path, model
    if path == target:
        raise _of_other_plane(model, str(target), order)
    second = _second_model(RunDirectory(target))
    if second is not None and second[1].plane == needed:
        return second
    raise StageError(
        f"there is no model of the {needed} plane, which {order.row.name} needs",
        str(target),
        f"It takes {MANEUVERS[needed]} in the log: `auvident run` with such a log beside the "
        f"others, or `auvident identify {typed(target)} --plane {needed}` where this one has them "
        "(in a copy, to keep the model).",
    )


def _second_model(run: RunDirectory) -> "tuple[Path, IdentifiedModel] | None":
    """The model of the other plane of a run with both: refined, unless that is out of date."""
    from auvident.schema.artifacts import IdentifiedModel

    refined = is_of_this_run(BY_NAME["refine"], run, run.existing())
    for name in SECOND_PLANE if refined else SECOND_PLANE[1:]:
        if (run / name).exists():
            return run / name, read_model(run / name, IdentifiedModel, made_again(run / name))
    return None


def with_columns(desk: "Desk") -> Any:
    """The result with the columns of its table, as ``--json`` prints it."""
    columns = {name: tuple(values.tolist()) for name, values in desk.table.items()}
    return desk.result.model_copy(update={"columns": columns})
