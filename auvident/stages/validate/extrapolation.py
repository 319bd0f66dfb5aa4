"""How far the held-out maneuvers go beyond those that identify."""

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from auvident.engines.records import Record
from auvident.schema.artifacts import Extrapolation
from auvident.schema.planes import BY_PLANE, Plane

Array = npt.NDArray[np.float64]

NEAR = 0.05  # of the size reached: noise and an execute that overshoots go no further
MOST = 0.99  # quantile of the size: a spike of a sensor is no range


def extrapolation_of(
    held_out: Sequence[Record], identifying: Sequence[Record], plane: Plane
) -> dict[str, dict[str, Extrapolation]]:
    """Quantities by which each held-out maneuver leaves the range of those that identify.

    Sizes of the fin angle, of the transverse velocity (at a speed the drift angle) and of the
    rate of turn, and the speed at both ends (``u_low`` is the lowest). A maneuver within the
    range has no entry under its ID.

    Parameters
    ----------
    held_out, identifying : sequence of Record
        Readings at the origin and logged inputs.
    """
    if not identifying:
        return {}
    ranges = [_reached(record, plane) for record in identifying]
    known = {name: max(r[name] for r in ranges) for name in ranges[0] if name != "u_low"}
    known["u_low"] = min(r["u_low"] for r in ranges)
    units = _units(plane)
    return {
        record.id: {
            name: Extrapolation(reaches=value, identified=known[name], unit=units[name])
            for name, value in _reached(record, plane).items()
            if _beyond(name, value, known)
        }
        for record in held_out
    }


def _reached(record: Record, plane: Plane) -> dict[str, float]:
    """What a maneuver reaches of each quantity."""
    fin, (speed, across, rate) = record.inputs[:, 0], record.given[:, :3].T
    names = BY_PLANE[plane].velocities
    size = {BY_PLANE[plane].fin: fin, names[1]: across, names[2]: rate}
    found = {name: float(np.quantile(np.abs(x), MOST)) for name, x in size.items()}
    low, high = np.quantile(speed, [1.0 - MOST, MOST])
    return {**found, "u": float(high), "u_low": float(low)}


def _beyond(name: str, value: float, known: Mapping[str, float]) -> bool:
    """Whether a quantity leaves the range by more than counts as the same."""
    if name == "u_low":
        return value < known[name] - NEAR * known["u"]
    return value > (1.0 + NEAR) * known[name]


def _units(plane: Plane) -> dict[str, str]:
    row = BY_PLANE[plane]
    names = (row.fin, *row.velocities, "u_low")
    return dict(zip(names, ("rad", "m/s", "m/s", "rad/s", "m/s"), strict=True))
