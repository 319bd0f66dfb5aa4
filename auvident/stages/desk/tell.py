"""Figures, curves and findings of a maneuver flown on the desk, with intervals from the draws."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.physics.ase import stability
from auvident.physics.fleet import Fleet
from auvident.physics.maneuvers.desk import DeskFlight
from auvident.physics.maneuvers.desk_figures import spiral_branches
from auvident.physics.steady import SteadyRun, Unknown, linear_steering, steady_run
from auvident.schema.artifacts import Finding
from auvident.schema.desk import DeskCurve, DeskFigure, DeskOrder
from auvident.schema.planes import BY_PLANE
from auvident.stages.desk.approach import Approached
from auvident.stages.desk.models import DeskModel

Array = npt.NDArray[Any]

INTERVAL = (5.0, 95.0)  # percentiles of the draws
FEWEST = 20  # draws of which percentiles are told
MANY_LOST = 0.05  # share of the draws that run away from which on it is told
TRIM_SHARES = (0.5, 0.75, 1.0, 1.25)  # of the speed of the approach
UNITS = {"degps": "deg/s", "mps": "m/s", "deg": "deg", "ps": "1/s", "m": "m", "s": "s"}
G_OF = {
    "horizontal": stability.horizontal_stability,
    "vertical": stability.vertical_stability,
}


def of_equations(begun: Approached, models: DeskModel) -> dict[str, Array]:
    """Figures (S,) that need no maneuver: stability index, Nomoto's K and T, the trim."""
    fleet, run = begun.fleet, begun.run
    mass = fleet.parameter("m")
    own = _with_linear(models, {s: fleet.parameter(s) for s in models.structure.parameters}, run)
    with np.errstate(divide="ignore", invalid="ignore"):
        found = {"stability_index": G_OF[models.plane](own, mass, own["m x_G"] / mass)}
    if models.plane == "horizontal":
        steering = linear_steering(fleet, run)
        found["nomoto_gain_ps"] = begun.side * steering.gain_ps
        found["nomoto_time_s"] = steering.time_s
    else:
        found |= _trim(run.states[3], begun.side * run.angle)
    return {name: np.where(run.found, x, np.nan) for name, x in found.items()}


def _with_linear(models: DeskModel, own: dict[str, Array], run: SteadyRun) -> dict[str, Array]:
    """Coefficients of the lift with the linear damping, which at a speed acts like them."""
    row, speed = BY_PLANE[models.plane], np.maximum(run.states[0], np.finfo(float).tiny)
    found = dict(own)
    for axis, velocity in zip(row.axes[1:], (row.names["a"], row.names["b"]), strict=True):
        linear = own.get(f"linear_damping.{axis}_{velocity}")
        if linear is not None:
            found[f"{axis}_u{velocity}"] = own[f"{axis}_u{velocity}"] + linear / speed
    return found


def _trim(pitch: Array, angle: Array) -> dict[str, Array]:
    return {"trim_elevator_deg": np.degrees(angle), "trim_pitch_deg": np.degrees(pitch)}


def figure(name: str, values: Array) -> DeskFigure:
    """A figure of the first model with the interval of the others; the unit is in the name."""
    stem, _, ending = name.rpartition("_")
    unit = UNITS.get(ending, "-")
    drawn = values[1:][np.isfinite(values[1:])]
    low, high = np.percentile(drawn, INTERVAL).tolist() if drawn.size >= FEWEST else (None, None)
    return DeskFigure(
        name=stem if ending in UNITS else name,
        value=float(values[0]) if np.isfinite(values[0]) else None,
        low=low,
        high=high,
        unit=unit,
        share=drawn.size / (len(values) - 1) if len(values) > 1 else None,
    )


def figures_of(wanted: Sequence[str], found: Mapping[str, Array]) -> tuple[DeskFigure, ...]:
    """The figures of a row of the table in its order."""
    names: list[str] = []
    for name in wanted:
        if name.endswith("*"):
            same = [n for n in found if re.fullmatch(re.escape(name[:-1]) + r"\d+_.*", n)]
            names += sorted(same, key=lambda n: int(re.findall(r"\d+", n)[-1]))
        elif name in found:
            names.append(name)
    return tuple(figure(name, found[name]) for name in names)


def curves_of(
    flight: DeskFlight, begun: Approached, order: DeskOrder, speed_mps: float
) -> tuple[DeskCurve, ...]:
    """Rate by rudder of a spiral; trim by speed in the vertical plane."""
    if order.row.name == "spiral":
        at, down, up = spiral_branches(flight)
        rows = [
            (figure("r_from_starboard_degps", a), figure("r_from_port_degps", b))
            for a, b in zip(np.degrees(down), np.degrees(up), strict=True)
        ]
        told = tuple(float(round(d, 6)) for d in np.degrees(at))
        return (DeskCurve(name="spiral", along="rudder", unit="deg", at=told, figures=tuple(rows)),)
    if order.row.plane == "vertical":
        return (trim_by_speed(begun, speed_mps),)
    return ()


def trim_by_speed(begun: Approached, speed_mps: float) -> DeskCurve:
    """Elevator and pitch that hold the depth at several speeds; none where nothing holds it."""
    speeds, fleet = tuple(share * speed_mps for share in TRIM_SHARES), begun.fleet
    rows = []
    for speed in speeds:
        rate = float(begun.run.rate_rps[0]) * speed / speed_mps
        if fleet.held_speed_mps is not None:
            fleet = Fleet(fleet.structure, fleet.vectors, speed)
        unknown: Unknown = "rate" if fleet.held_speed_mps is None else "neither"
        run = steady_run(fleet, speed, rate, unknown)
        trim = _trim(run.states[3], begun.side * run.angle)
        rows.append(tuple(figure(name, np.where(run.found, x, np.nan)) for name, x in trim.items()))
    return DeskCurve(name="trim", along="speed", unit="m/s", at=speeds, figures=tuple(rows))


def findings_of(
    flight: DeskFlight, models: DeskModel, order: DeskOrder, lost: int
) -> list[Finding]:
    """What the user should know before trusting the figures."""
    found = []
    drawn = flight.states.shape[2] - 1
    if drawn and lost > MANY_LOST * drawn:
        found.append(
            Finding(
                code="drawn-models-run-away",
                where=order.text,
                message=f"{lost} of {drawn} sampled models diverge or cannot hold a straight run; "
                "the intervals are those of the others",
                value=lost / drawn,
                threshold=MANY_LOST,
                remedy="The model is too uncertain for this maneuver.",
            )
        )
    if flight.ends[0] < 0:
        found.append(
            Finding(
                code="maneuver-not-finished",
                where=order.text,
                message=f"not finished within {flight.time_s[-1]:.0f} s ({order.row.ends})",
                remedy="Another angle or speed may finish it.",
            )
        )
    if models.source != "identified":
        found.append(_origin(models))
    return found


def _origin(models: DeskModel) -> Finding:
    own = [s for s in models.structure.parameters if s in models.given]
    if not own:
        words = "every coefficient is the estimate from geometry"
    elif len(own) == models.coefficients:
        words = "every coefficient is as given in the vehicle file"
    else:
        others = models.coefficients - len(own)
        words = f"{len(own)} coefficients are as given, {others} are the estimate from geometry"
    return Finding(code="not-identified", where=models.name, message=words)
