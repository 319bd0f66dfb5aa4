"""A standard maneuver flown with a model and with models drawn beside it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pandas as pd

from auvident.engines.flown import beyond, reached
from auvident.errors import NumericsError
from auvident.physics.maneuvers.desk import (
    CircleHelm,
    DepthHelm,
    DeskFlight,
    DeskHelm,
    Setting,
    StairHelm,
    ZigzagHelm,
    fly,
    setting_of,
)
from auvident.physics.maneuvers.desk_figures import FIGURES, of_all, rows_of
from auvident.schema.artifacts import Extrapolation
from auvident.schema.channels import TIME_COLUMN
from auvident.schema.desk import DeskOrder, DeskResult
from auvident.schema.planes import CONTROL_COLUMNS, STATE_COLUMNS
from auvident.stages.desk.approach import Approach, Approached, begin
from auvident.stages.desk.models import DeskModel, possible_models
from auvident.stages.desk.tell import (
    FEWEST,
    INTERVAL,
    curves_of,
    figures_of,
    findings_of,
    of_equations,
)

SPIRAL = (1.0, 0.8, 0.6, 0.4, 0.28, 0.2, 0.16, 0.12, 0.08, 0.04, 0.0)  # of the greatest rudder
MOST_WAYS = 40  # of drawn models, to be drawn as lines
WAYS = {"horizontal": ("north_m", "east_m"), "vertical": ("along_m", "depth_m")}


@dataclass(frozen=True)
class Desk:
    """A maneuver as it was flown.

    Attributes
    ----------
    result : DeskResult
        What is told of it.
    table : pandas.DataFrame
        Motion of the best model, with the band of those drawn.
    drawn_ways : (n, 2, k) array
        Where some of the drawn models went: the two ways of the table.
    """

    result: DeskResult
    table: pd.DataFrame
    drawn_ways: npt.NDArray[np.float64]


def _spiral(setting: Setting, greatest: float) -> StairHelm:
    down = [share * greatest for share in SPIRAL]
    there = [*down, *(-order for order in down[-2::-1])]
    return StairHelm(setting, [*there, *there[-2::-1]])


HELMS: Mapping[str, Callable[..., DeskHelm]] = {
    "turning-circle": CircleHelm,
    "zigzag": ZigzagHelm,
    "spiral": _spiral,
    "pull-out": lambda setting, rudder: StairHelm(setting, [rudder, 0.0, -rudder, 0.0]),
    "depth-step": DepthHelm,
    "vertical-zigzag": ZigzagHelm,
}


def helm_of(order: DeskOrder, setting: Setting) -> DeskHelm:
    """The helm of a maneuver, its angles in rad."""
    values = [
        float(np.radians(value)) if parameter.unit == "deg" else value
        for parameter, value in zip(order.row.parameters, order.values, strict=True)
    ]
    return HELMS[order.row.name](setting, *values)


def fly_maneuver(
    models: DeskModel,
    order: DeskOrder,
    approach: Approach,
    progress: Callable[[str], None] | None = None,
) -> Desk:
    """Fly a maneuver.

    Parameters
    ----------
    models : DeskModel
        Of the plane that the maneuver needs.
    order : DeskOrder
    approach : Approach
    progress : callable, optional
        Told where the flight is.

    Raises
    ------
    UsageError, InputError
        See `approach.begin`.
    NumericsError
        No straight run can be held, the model runs away, or it comes to no figure.
    """
    models = possible_models(models)
    begun = begin(models, approach)
    setting = setting_of(begun.fleet, begun.run, models.length_m, begun.side)
    told = None if progress is None else (lambda t: progress(f"{order.text}: {t:.0f} s flown"))
    helm = helm_of(order, setting)
    flight = fly(begun.fleet, begun.run, setting, helm, begun.side, told)
    _refuse_lost(flight, models, order)
    own = of_all(flight, FIGURES[order.row.name])
    if not any(np.isfinite(values[0]) for values in own.values()):
        raise _comes_to_nothing(flight, models, order)
    figures = figures_of(order.row.figures, own | of_equations(begun, models))
    lost = int((~np.isfinite(flight.states[-1, 0, 1:])).sum())
    held = begun.fleet.held_speed_mps is not None
    result = DeskResult(
        vehicle=models.vehicle,
        plane=models.plane,
        maneuver=order.row.name,
        parameters=order.parameters,
        model=models.name,
        source=models.source,
        given=models.given,
        length_m=models.length_m,
        speed_mps=setting.speed_mps,
        rpm=None if held else 60.0 * float(begun.run.rate_rps[0]),
        speed_is_held=held,
        servo=begun.servo,
        models_drawn=len(models.vectors) - 1,
        models_lost=lost,
        figures=figures,
        curves=curves_of(flight, begun, order, setting.speed_mps),
        extrapolation=_beyond_range(flight, models),
        findings=tuple(findings_of(flight, models, order, lost)),
    )
    ways = flight.way[rows_of(flight, 0)][:, :, 1 : 1 + MOST_WAYS]
    return Desk(result, _table(flight, begun, models), ways)


def _beyond_range(flight: DeskFlight, models: DeskModel) -> dict[str, Extrapolation]:
    """Where the motion of the best model leaves the range that it was identified from."""
    rows = rows_of(flight, 0)
    motion = reached(flight.fin[rows, 0], flight.states[rows, :3, 0], models.plane)
    return beyond(motion, models.flown, models.plane)


def _refuse_lost(flight: DeskFlight, models: DeskModel, order: DeskOrder) -> None:
    """Stop where the best model ran away before the maneuver was over."""
    lost = np.flatnonzero(~np.isfinite(flight.states[:, 0, 0]))
    if lost.size:
        beyond = " or pitches beyond 90 deg" if models.plane == "vertical" else ""
        raise NumericsError(
            f"the simulation diverges{beyond}",
            f"{models.name}, {order.text}, {flight.time_s[lost[0]]:.1f} s",
            "The motion leaves the range of the data behind the model. Use a smaller angle or a "
            "lower --speed, or check the damping coefficients of the model.",
        )


def _comes_to_nothing(flight: DeskFlight, models: DeskModel, order: DeskOrder) -> NumericsError:
    turned = np.degrees(np.abs(flight.states[:, 3, 0] - flight.states[0, 3, 0]).max())
    return NumericsError(
        f"none of its figures is reached within {flight.time_s[-1]:.0f} s; "
        f"the vehicle turns by {turned:.3g} deg at most",
        f"{models.name}, {order.text}",
        "Use a larger fin angle or a smaller switching angle; the fin may be too weak to turn "
        "this vehicle.",
    )


def _table(flight: DeskFlight, begun: Approached, models: DeskModel) -> pd.DataFrame:
    """Motion of the best model until it is through, with the band of the drawn ones."""
    rows, plane = rows_of(flight, 0), models.plane
    own, rpm = CONTROL_COLUMNS[plane][0], 60.0 * begun.run.rate_rps[0]
    columns = {
        TIME_COLUMN: flight.time_s[rows],
        own: flight.fin[rows, 0],
        own.replace("_rad", "_order_rad"): flight.order[rows, 0],
        "rpm": np.full(rows.stop, rpm),
    }
    names = (*STATE_COLUMNS[plane], *WAYS[plane])
    motion = np.concatenate([flight.states[rows], flight.way[rows]], axis=1)
    columns |= {name: motion[:, i, 0] for i, name in enumerate(names)}
    drawn = motion[:, :, 1:]
    drawn = drawn[:, :, np.isfinite(drawn).all(axis=(0, 1))]
    if drawn.shape[2] >= FEWEST:
        low, high = np.percentile(drawn, INTERVAL, axis=2)
        for i, name in enumerate(names):
            columns |= {f"{name}_low": low[:, i], f"{name}_high": high[:, i]}
    return pd.DataFrame(columns)
