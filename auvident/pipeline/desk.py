"""Standard maneuvers on the desk: the model of a run, of a file, or of a vehicle file."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from auvident.constants import USUAL_SPEED_MPS
from auvident.errors import InputError, StageError
from auvident.pipeline.freshness import judge
from auvident.pipeline.observer import Observer
from auvident.pipeline.predict import find_model
from auvident.pipeline.steps import COMPILING, COMPILING_EACH_TIME
from auvident.pipeline.table import BY_NAME
from auvident.pipeline.whole import is_whole
from auvident.schema.desk import DeskOrder, desk_order
from auvident.storage.artifacts import read_model
from auvident.storage.run_directory import MANIFEST, RunDirectory

if TYPE_CHECKING:
    import numpy as np

    from auvident.schema.artifacts import IdentifiedModel
    from auvident.stages.desk import Desk, DeskModel

ESTIMATED = "ase/coefficients.json"
SECOND_PLANE = ("refine/vertical/model.json", "identify/vertical/model.json")
SPEED_ASSUMED = (
    f"The speed of the approach is {USUAL_SPEED_MPS:g} m/s, as neither --speed nor --rpm is given "
    "and the model is not in a run directory."
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
    from auvident.jit import cache_is_writable, has_compiled

    order = desk_order(maneuver)
    if target.suffix != ".toml" and not (target.exists() or not target.suffix):
        raise InputError(
            "no such file", str(target), "Give a run directory, a model.json or a vehicle file."
        )
    if not has_compiled("fleet._step"):
        observer.note(COMPILING if cache_is_writable() else COMPILING_EACH_TIME)
    import numpy as np

    rng = np.random.default_rng(asked.seed)
    if target.suffix != ".toml" and is_whole(target):
        models, usual = _of_whole(target, order, asked, rng), None
    elif target.suffix == ".toml":
        models, usual = _of_vehicle(target, order, asked, rng)
    else:
        models, usual = _of_model(target, order, asked, rng)
        if usual is None and asked.speed_mps is None and asked.rpm is None:
            observer.note(SPEED_ASSUMED)
    from auvident.stages.desk import Approach, fly_maneuver

    approach = Approach(
        asked.speed_mps, asked.rpm, asked.rudder_rate_degps, usual or USUAL_SPEED_MPS
    )
    return fly_maneuver(models, order, approach, observer.progress)


def _of_vehicle(
    target: Path, order: DeskOrder, asked: Asked, rng: "np.random.Generator"
) -> "tuple[DeskModel, float | None]":
    """The estimate from a vehicle file, with what it gives, and its design speed."""
    from auvident.stages.ase import estimate
    from auvident.stages.desk import estimated_models
    from auvident.stages.identify.setup import rigid_body
    from auvident.storage.vehicle_file import load_vehicle

    vehicle = load_vehicle(target)
    ase, plane = estimate(vehicle), order.row.plane
    rigid = rigid_body(vehicle, plane)
    return estimated_models(ase, rigid, plane, str(target), asked.samples, rng), ase.speed_mps


def _of_whole(
    target: Path, order: DeskOrder, asked: Asked, rng: "np.random.Generator"
) -> "DeskModel":
    """A model of six degrees of freedom in the plane of the maneuver."""
    from auvident.schema.combined import CombinedModel
    from auvident.stages.desk import combined_models

    model = read_model(target, CombinedModel)
    return combined_models(model, order.row.plane, str(target), asked.samples, rng)


def _of_model(
    target: Path, order: DeskOrder, asked: Asked, rng: "np.random.Generator"
) -> "tuple[DeskModel, float | None]":
    """The identified model of the plane that is needed, and the speed of its trial."""
    from auvident.schema.artifacts import AseResult
    from auvident.stages.desk import identified_models

    path, model = _model_for(target, order)
    run = next((p for p in path.resolve().parents[1:3] if (p / MANIFEST).exists()), None)
    usual = None
    if run is not None and (run / ESTIMATED).exists():
        usual = read_model(run / ESTIMATED, AseResult).speed_mps
    return identified_models(model, str(path), asked.samples, rng), usual


def _model_for(target: Path, order: DeskOrder) -> "tuple[Path, IdentifiedModel]":
    """The model of the plane of a maneuver; a run may have one of each."""
    path, model = find_model(target)
    needed = order.row.plane
    if model.plane == needed:
        return path, model
    if path == target:
        raise InputError(
            f"is a model of the {model.plane} plane, and {order.row.name} needs one of the "
            f"{needed} plane",
            str(target),
            f"Identify with `--plane {needed}`, or give the run directory or the vehicle file.",
        )
    second = _second_model(RunDirectory(target))
    if second is not None and second[1].plane == needed:
        return second
    raise StageError(
        f"there is no model of the {needed} plane, which {order.row.name} needs",
        str(target),
        f"Run `auvident identify {target} --plane {needed}` (in a copy, to keep this one).",
    )


def _second_model(run: RunDirectory) -> "tuple[Path, IdentifiedModel] | None":
    """The model of the other plane of a run with both: refined, unless that is out of date."""
    from auvident.schema.artifacts import IdentifiedModel

    refined = judge(BY_NAME["refine"], run, run.existing()).state == "done"
    for name in SECOND_PLANE if refined else SECOND_PLANE[1:]:
        if (run / name).exists():
            return run / name, read_model(run / name, IdentifiedModel)
    return None


def with_columns(desk: "Desk") -> Any:
    """The result with the columns of its table, as ``--json`` prints it."""
    columns = {name: tuple(values.tolist()) for name, values in desk.table.items()}
    return desk.result.model_copy(update={"columns": columns})
