"""What a simulator makes of held-out maneuvers, beside what the model itself predicts of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.engines.carried import predicted_course
from auvident.engines.prediction import Frame, at_effects, readings
from auvident.engines.records import Record, record_of, sensor_matrix
from auvident.physics.dynamics import ALL_STATES
from auvident.physics.six_dof_terms import whole_names
from auvident.physics.terms import structure_of
from auvident.schema.artifacts import IdentifiedModel, Maneuver, Maneuvers, Sensing
from auvident.schema.planes import BY_PLANE, Plane
from auvident.schema.trial import Trial
from auvident.stages.export.simulators import ReadVehicle, fly_plane
from auvident.stages.export.whole import AnyModel, Whole

Array = npt.NDArray[Any]


@dataclass(frozen=True)
class Cost:
    """Errors of one plane over its held-out maneuvers.

    Attributes
    ----------
    plane : str
    maneuvers : int
    duration_s : float
    own, theirs : mapping
        RMSE by state, of the model itself and in the simulator.
    apart : mapping
        Largest difference between the two.
    ran_away : int
        Maneuvers in which the simulator diverges; they count in neither.
    """

    plane: Plane
    maneuvers: int
    duration_s: float
    own: dict[str, float]
    theirs: dict[str, float]
    apart: dict[str, float]
    ran_away: int = 0


def costs_of(
    model: AnyModel,
    whole: Whole,
    vehicle: ReadVehicle,
    trials: Sequence[Trial],
    maneuvers: Maneuvers,
) -> tuple[Cost, ...]:
    """Held-out maneuvers flown by what a simulator reads, for each plane that has any.

    Both start from the measured state and take the logged inputs alone; in a model of both planes
    what leaves the plane is held, for either.
    """
    by_name = {trial.name: trial for trial in trials}
    found = []
    for plane in whole.planes:
        held_out = [m for m in maneuvers.maneuvers if m.role == "validate" and m.shows(plane)]
        pairs = [(m, by_name[m.trial]) for m in held_out if m.trial in by_name]
        if pairs:
            found.append(_cost(model, whole, vehicle, plane, pairs))
    return tuple(found)


def _cost(
    model: AnyModel,
    whole: Whole,
    vehicle: ReadVehicle,
    plane: Plane,
    pairs: Sequence[tuple[Maneuver, Trial]],
) -> Cost:
    own, theirs, apart, lost, duration = [], [], [], 0, 0.0
    for maneuver, trial in pairs:
        dt_s, sensing = 1.0 / trial.rate_hz, _sensing(model, plane)
        record = record_of(maneuver, trial, plane, sensor_matrix(plane, sensing))
        frame, p = _frame(whole, plane, sensing, dt_s)
        ours = predicted_course(frame, p, record, ALL_STATES).readings
        flown = readings(frame, p, record, _flown(frame, p, record, vehicle, plane))
        if not np.isfinite(flown).all():
            lost += 1
            continue
        own.append(_off(ours - record.measured, plane))
        theirs.append(_off(flown - record.measured, plane))
        apart.append(np.abs(_off(flown - ours, plane)))
        duration += len(record) * dt_s
    names = [state.symbol for state in BY_PLANE[plane].states]
    return Cost(
        plane,
        len(pairs),
        duration,
        dict(zip(names, _rms(own), strict=True)) if own else {},
        dict(zip(names, _rms(theirs), strict=True)) if own else {},
        dict(zip(names, np.vstack(apart).max(axis=0).tolist(), strict=True)) if own else {},
        lost,
    )


def _sensing(model: AnyModel, plane: Plane) -> Sensing:
    return model.sensing if isinstance(model, IdentifiedModel) else model.sensing[plane]


def _frame(whole: Whole, plane: Plane, sensing: Sensing, dt_s: float) -> tuple[Frame, Array]:
    """The equations of a plane and their parameters."""
    ids = whole.effects_in(plane)
    structure, names = structure_of(plane, ids), whole_names(plane, ids)
    p = np.array([whole.values.get(names[n], 0.0) for n in structure.parameters])
    return Frame(structure, sensing, dt_s), p


def _flown(frame: Frame, p: Array, record: Record, vehicle: ReadVehicle, plane: Plane) -> Array:
    """States in the simulator, from the state and the orders of the record."""
    acting, source = at_effects(frame, p, record), record.source
    assert source is not None
    lead = len(source.raw) - len(record.time_s)
    return fly_plane(vehicle, plane, acting.start, source.raw, lead, frame.dt_s)


def _off(difference: Array, plane: Plane) -> Array:
    """Differences (n, 4); that of a heading within half a turn."""
    out = difference.copy()
    if BY_PLANE[plane].states[3].wraps:
        out[:, 3] = (out[:, 3] + np.pi) % (2.0 * np.pi) - np.pi
    return out


def _rms(rows: Sequence[Array]) -> list[float]:
    together = np.vstack(rows)
    return [float(np.sqrt(np.nanmean(column**2))) for column in together.T]


def lines_of(costs: Sequence[Cost], tool: str) -> tuple[str, ...]:
    """The costs in words, a line for each plane."""
    return tuple(_line(cost, tool) for cost in costs)


def _line(cost: Cost, tool: str) -> str:
    states = {state.symbol: state for state in BY_PLANE[cost.plane].states}
    parts = []
    for name, before in cost.own.items():
        degrees = states[name].unit == "rad"
        scale, unit = (float(np.degrees(1.0)), "deg") if degrees else (1.0, states[name].unit)
        after = cost.theirs[name]
        parts.append(f"{name} {scale * before:.2g} to {scale * after:.2g} {unit}")
    lost = f"; it diverges in {cost.ran_away} of them" if cost.ran_away else ""
    told = ", ".join(parts) or "nothing to compare"
    return (
        f"What that costs on the {cost.maneuvers} held-out maneuvers of the {cost.plane} plane "
        f"(RMSE of the model, and by the documented equations of {tool}): {told}{lost}."
    )
