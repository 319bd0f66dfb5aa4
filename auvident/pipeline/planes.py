"""The planes of a run: as asked for, else those that the trials have maneuvers of."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from auvident.errors import NumericsError, StageError
from auvident.pipeline.given import Given
from auvident.pipeline.remedies import made_again
from auvident.schema.planes import PLANES, Plane
from auvident.storage.artifacts import read_json
from auvident.storage.run_directory import RunDirectory

if TYPE_CHECKING:
    from auvident.pipeline.table import Stage
    from auvident.schema.artifacts import Maneuver

FOUND, BOTH = "found", "both"  # values of the option beside the planes themselves
MODEL = "identify/model.json"
LEAST_STEPS = 2  # depth steps that make a plane beside maneuvers of the other


def asked_for(option: str) -> tuple[Plane, ...]:
    """Planes that the option may mean."""
    return tuple(p for p in PLANES if option in (p, FOUND, BOTH))


def wanted_planes(option: str, maneuvers: "Sequence[Maneuver]") -> tuple[Plane, ...]:
    """Planes to identify; the first one has the folders of the stages."""
    return _with_maneuvers(maneuvers) if option == FOUND else asked_for(option)


def _with_maneuvers(maneuvers: "Sequence[Maneuver]") -> tuple[Plane, ...]:
    """Planes in which more than straight runs identify; the horizontal one where there is none.

    A depth step is a straight run of the vertical plane: its elevator is what it shows. One alone
    beside turns or zigzags is the autopilot keeping its depth, and no plane is known from it.
    """
    own = [m for m in maneuvers if m.role == "identify" and not _is_straight(m)]
    kinds = {p: [m.kind for m in own if m.plane == p] for p in PLANES}
    found = tuple(p for p in PLANES if kinds[p])
    alone = len(kinds["vertical"]) < LEAST_STEPS and "zigzag" not in kinds["vertical"]
    return found[:1] if alone and len(found) > 1 else found or PLANES[:1]


def _is_straight(m: "Maneuver") -> bool:
    return m.kind == "straight" and m.plane == PLANES[0]


def called(stage: "Stage", given: Given) -> dict[str, Any]:
    """Outputs of a stage, of all planes that it knows; called once where planes do not matter."""
    if not stage.by_plane:
        return dict(stage.function(given))
    known = [p for p in given.planes if p in stage.planes] or list(given.planes[:1])
    outputs: dict[str, Any] = {}
    for plane in known:
        view = given.within(plane, outputs)
        try:
            made = stage.function(view)
        except NumericsError as error:
            if not outputs or given.options.get("plane") != FOUND:
                raise
            outputs = _noted(outputs, plane, error)
            continue
        outputs |= {view.place(name): artifact for name, artifact in made.items()}
    return outputs


def _noted(outputs: Mapping[str, Any], plane: Plane, error: NumericsError) -> dict[str, Any]:
    """What the first plane has, with the failure of a plane that nobody asked for."""
    from auvident.schema.artifacts import Finding

    finding = Finding(
        code="plane-not-identified",
        message=f"the {plane} plane was not identified: {error.problem}",
        where=error.where,
        remedy=error.remedy,
    )
    model = outputs[MODEL]
    findings = (*model.findings, finding)
    return {**outputs, MODEL: model.model_copy(update={"findings": findings})}


def planes_of(run: RunDirectory) -> tuple[Plane, ...]:
    """Planes of a run that has been identified: of its model, and of that beside it."""
    remedy = made_again(run / MODEL)
    tree = read_json(run / MODEL, remedy)
    first: Plane | None = tree.get("plane") if isinstance(tree, dict) else None
    if first not in PLANES:
        raise StageError("names no plane", str(run / MODEL), remedy)
    given = Given(run, planes=PLANES, plane=PLANES[-1])
    return (first, PLANES[-1]) if first == PLANES[0] and given.has(MODEL) else (first,)
