"""From the accuracies of the formulas to the standard deviations.

First-order propagation: every accuracy is moved one sigma up and down, all at once in one
vectorised evaluation; half the difference is the one-sigma effect on each coefficient.
"""

import numpy as np

from auvident.physics.ase.accuracy import ACCURACIES, one_at_a_time
from auvident.physics.ase.assembly import Parts, coefficient_parts, totals
from auvident.physics.ase.geometry import HullGeometry
from auvident.schema.coefficients import BY_SYMBOL
from auvident.schema.vehicle import Vehicle

RESIDUAL_SHARE = 0.05  # of each part: interpolation of charts and what no shared formula explains
# Least standard deviation, as a share of the dynamic pressure on the whole planform (moments:
# times powers of L/2). A pair of tail fins has Y_uv near 0.3 of it and C_D0 near 4e-4: the floors
# are about 2 % of a fin pair across the flow and twice a fin pair's drag along it, the size of the
# antennas and transducers that the geometry leaves out.
FLOOR_ACROSS, FLOOR_ALONG = 0.005, 0.001
ALONG_SYMBOLS = ("X_udot", "X_uu", "X_uudd")
ABSENT_CONTROL_SHARE = 0.1  # a control term without a set that moves: a third of a fin pair
ABSENT_PROPELLER_THRUST = 0.35  # K_T intercept of an unknown propeller of 0.7 hull diameters
ABSENT_PROPELLER_DIAMETERS = 0.7
CONTROL_SYMBOLS = ("X_uudd", "Y_uud", "N_uud", "Z_uud", "M_uud")


def contributions(
    vehicle: Vehicle, speed_mps: float, geometry: HullGeometry
) -> dict[str, dict[str, float]]:
    """One-sigma effect of each accuracy on each coefficient.

    Parameters
    ----------
    vehicle : Vehicle
        One vehicle (no variants axis).
    speed_mps : float
    geometry : HullGeometry

    Returns
    -------
    dict of str to dict of str to float
        ``effects[accuracy][symbol]``, signed, dimensional SI; zero effects are left out.
    """
    values = totals(coefficient_parts(vehicle, speed_mps, one_at_a_time(), geometry))
    effects: dict[str, dict[str, float]] = {a.name: {} for a in ACCURACIES}
    for symbol, value in values.items():
        spread = np.broadcast_to(value, (1 + 2 * len(ACCURACIES),))
        half = 0.5 * (spread[1::2] - spread[2::2])
        for accuracy, effect in zip(ACCURACIES, half, strict=True):
            if effect != 0.0:
                effects[accuracy.name][symbol] = float(effect)
    return {name: effect for name, effect in effects.items() if effect}


def residuals(vehicle: Vehicle, parts: Parts, geometry: HullGeometry) -> dict[str, float]:
    """Standard deviation of each coefficient that no shared formula explains.

    Zero only for what the file states with a standard deviation of its own.
    """
    result = {}
    for symbol, values in parts.items():
        of_parts = RESIDUAL_SHARE * np.sqrt(sum(float(v) ** 2 for v in values.values()))
        result[symbol] = float(np.hypot(of_parts, _floor(vehicle, symbol, bool(values), geometry)))
    if vehicle.hull.drag_coefficient is not None:
        result["X_uu"] = 0.0  # its standard deviation is the one that the file states
    return result


def _floor(vehicle: Vehicle, symbol: str, present: bool, geometry: HullGeometry) -> float:
    """Scale of what the geometry leaves out, in the unit of the coefficient."""
    density, diameter = float(vehicle.fluid.density_kgpm3), float(geometry.diameter_m)
    if symbol in ("T_nn", "T_nu"):
        size = ABSENT_PROPELLER_DIAMETERS * diameter
        if vehicle.propeller is not None:
            size = float(vehicle.propeller.diameter_m)
        share = ABSENT_PROPELLER_THRUST * (RESIDUAL_SHARE if present else 1.0)
        return share * density * size ** (4 if symbol == "T_nn" else 3)
    powers = BY_SYMBOL[symbol].length_power - 2
    scale = 0.5 * density * float(geometry.planform_m2) * (0.5 * float(geometry.length_m)) ** powers
    absent = symbol in CONTROL_SYMBOLS and not present
    if absent:
        return ABSENT_CONTROL_SHARE * scale
    return (FLOOR_ALONG if symbol in ALONG_SYMBOLS else FLOOR_ACROSS) * scale


def standard_deviations(
    effects: dict[str, dict[str, float]], residual: dict[str, float]
) -> dict[str, float]:
    """Root of the sum of squares of all effects and the residual, by symbol."""
    return {
        symbol: float(
            np.sqrt(rest**2 + sum(effect.get(symbol, 0.0) ** 2 for effect in effects.values()))
        )
        for symbol, rest in residual.items()
    }
