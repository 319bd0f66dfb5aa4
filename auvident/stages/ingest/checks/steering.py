"""What the coefficients from geometry make of a fin, for rudder and elevator alike."""

from dataclasses import dataclass

import numpy as np

from auvident.schema.planes import HORIZONTAL, PlaneRow, symbol_in
from auvident.stages.ingest.checks.seen import Seen

NEEDED = ("A_adot", "A_bdot", "B_adot", "B_bdot", "A_ub", "B_ub", "A_uud", "B_uud")


@dataclass(frozen=True)
class Steering:
    """Yaw or pitch acceleration of the estimate: by its fin at u = 1 m/s, and by the rate."""

    by_fin: float
    by_rate: float


def steering(seen: Seen, plane: PlaneRow = HORIZONTAL) -> Steering | None:
    """What the coefficients from geometry make of the fin of a plane; None without them."""
    own = {generic: symbol_in(plane.name, generic) for generic in NEEDED}
    if seen.drawn is None or not set(own.values()) <= set(seen.drawn):
        return None
    c = {generic: float(seen.drawn[symbol][0]) for generic, symbol in own.items()}
    body, sigma = seen.vehicle.body, plane.sigma
    inertia, moment = body.inertia_kgm2(plane.name), body.mass_kg * body.x_g_m
    mass = [
        [body.mass_kg - c["A_adot"], sigma * moment - c["A_bdot"]],
        [sigma * moment - c["B_adot"], inertia - c["B_bdot"]],
    ]
    forces = [[c["A_uud"], c["A_ub"] - sigma * body.mass_kg], [c["B_uud"], c["B_ub"] - moment]]
    rows = np.linalg.solve(np.array(mass), np.array(forces))[1]
    return Steering(float(rows[0]), float(rows[1]))
