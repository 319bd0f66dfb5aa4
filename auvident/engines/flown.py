"""The range that a model was identified from, and what goes beyond it."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from auvident.engines.records import Record
from auvident.errors import InputError
from auvident.schema.artifacts import Extrapolation
from auvident.schema.planes import BY_PLANE, CONTROL_COLUMNS, STATE_COLUMNS, Plane

if TYPE_CHECKING:
    import pandas as pd

Array = npt.NDArray[np.float64]

NEAR = 0.05  # of the size reached: noise and an execute that overshoots go no further
SPEEDS = ("u", "u_low")  # highest and lowest
MOST = 0.99  # quantile of the size: a spike of a sensor is no range


def range_of(records: Sequence[Record], plane: Plane) -> dict[str, float]:
    """What maneuvers reach together, see `reached`; empty without any."""
    return joined([reached(r.inputs[:, 0], r.given[:, :3], plane) for r in records])


def joined(ranges: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """What several ranges reach together."""
    names = ranges[0] if ranges else {}
    return {n: (min if n == "u_low" else max)(r[n] for r in ranges) for n in names}


def reached(fin: Array, velocities: Array, plane: Plane) -> dict[str, float]:
    """What a motion reaches of each quantity.

    Sizes of the fin angle [rad], of the transverse velocity [m/s] (at a speed the drift angle)
    and of the rate of turn [rad/s], and the speed [m/s] at both ends (``u_low`` is the lowest).

    Parameters
    ----------
    fin : (n,) array
    velocities : (n, 3) array
        Forward, transverse, rate of turn.
    plane : str
    """
    names, (speed, across, rate) = BY_PLANE[plane].velocities, velocities.T
    size = {BY_PLANE[plane].fin: fin, names[1]: across, names[2]: rate}
    found = {name: float(np.quantile(np.abs(x), MOST)) for name, x in size.items()}
    low, high = np.quantile(speed, [1.0 - MOST, MOST])
    return {**found, "u": float(high), "u_low": float(low)}


def reached_in(table: "pd.DataFrame", plane: Plane) -> dict[str, float]:
    """What a simulated motion reaches, from its table of inputs and states.

    Raises
    ------
    InputError
        The table is of another plane.
    """
    fin, velocities = CONTROL_COLUMNS[plane][0], list(STATE_COLUMNS[plane][:3])
    missing = [name for name in (fin, *velocities) if name not in table]
    if missing:
        raise InputError(
            f"there is no column {missing[0]}",
            "the motion",
            f"Give a motion of the {plane} plane, as `simulate` returns it.",
        )
    return reached(table[fin].to_numpy(), table[velocities].to_numpy(), plane)


def beyond(
    motion: Mapping[str, float], known: Mapping[str, float], plane: Plane
) -> dict[str, Extrapolation]:
    """Quantities by which a motion leaves the range; none of a range that is not known."""
    row = BY_PLANE[plane]
    units = ("rad", "m/s", "m/s", "rad/s", "m/s")
    return {
        name: Extrapolation(reaches=motion[name], identified=known[name], unit=unit)
        for name, unit in zip((row.fin, *row.velocities, "u_low"), units, strict=True)
        if known and _is_beyond(name, motion[name], known)
    }


def beyond_in_turn(
    records: Sequence[Record], identifying: Sequence[Record], plane: Plane
) -> dict[str, dict[str, Extrapolation]]:
    """What `beyond` finds of each maneuver, by its ID; empty where none identifies."""
    if not identifying:
        return {}
    known = range_of(identifying, plane)
    return {record.id: beyond(range_of([record], plane), known, plane) for record in records}


def _is_beyond(name: str, value: float, known: Mapping[str, float]) -> bool:
    """Whether a quantity leaves the range by more than counts as the same."""
    if name == "u_low":
        return value < known[name] - NEAR * known["u"]
    return value > (1.0 + NEAR) * known[name]
