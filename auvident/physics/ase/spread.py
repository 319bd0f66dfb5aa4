"""What the uncertain coefficients leave open: stability, turning, overshoots and speed by draws."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.physics.ase import stability
from auvident.physics.ase.draws import DRAWS, drawn_coefficients
from auvident.physics.ase.motion import (
    CIRCLE_DEG,
    ZIGZAG_DEG,
    maneuver_figures,
    usual_rate_degps,
)
from auvident.schema.coefficients import symbols_of
from auvident.schema.planes import Plane
from auvident.schema.vehicle import Vehicle

Array = npt.NDArray[np.float64]

ONE_STD, NEARLY_ALL = (15.865, 84.135), (2.5, 97.5)  # percentiles
FEWEST = 20  # draws of which percentiles are told
# stability index, moment that turns the bow, its sign when that is into the flow
MARGINS: dict[Plane, tuple[Any, str, float]] = {
    "horizontal": (stability.horizontal_stability, "N_uv", 1.0),
    "vertical": (stability.vertical_stability, "M_uw", -1.0),
}
ROOTS = ("X_uu", "T_nu", "T_nn")


def spread_facts(
    vehicle: Vehicle,
    values: Mapping[str, float],
    stds: Mapping[str, float],
    effects: Mapping[str, Mapping[str, float]],
    speed_mps: float,
) -> dict[str, Any]:
    """Figures of the vehicle with what the standard deviations of the coefficients leave open.

    Parameters
    ----------
    vehicle : Vehicle
    values, stds : mapping of str to float
        Coefficients by symbol; the vertical plane is left out where they lack.
    effects : mapping of str to mapping
        As of `drawn_coefficients`.
    speed_mps : float
        Design speed.

    Returns
    -------
    dict
        ``draws``; by plane ``G``, ``unstable_probability`` (straight-line, without
        the righting moment) and ``weathercock_probability`` (that the moment due to drift or
        incidence turns the bow into the flow); ``tactical_diameter_m`` and ``overshoot_..._deg``
        with their rudder; ``speed_mps`` at ``rpm``. A figure has ``value``; ``std``, half of the
        distance between the 16 and 84 % points, as a quotient has no variance; ``low`` and
        ``high``, 95 % between them; ``share``, of the draws that come to it.
    """
    drawn = drawn_coefficients(values, stds, effects, given=vehicle.coefficients)
    facts: dict[str, Any] = {"draws": DRAWS}
    for plane, (_, moment, _) in MARGINS.items():
        if moment in drawn:
            facts[plane] = _stability(vehicle, drawn, plane)
    speed = np.full(DRAWS + 1, speed_mps)
    advance = np.array([stability.speed_per_rate_m(_row(drawn, i)) for i in range(DRAWS + 1)])
    rate = speed_mps / advance[0] if np.isfinite(advance[0]) else 0.0
    if rate > 0.0:
        speed = rate * advance
        facts["speed"] = {"rpm": 60.0 * rate, "speed_mps": _figure(speed)}
    if values["N_uud"] != 0.0:
        facts["horizontal"] |= _maneuvers(vehicle, drawn, speed, rate)
    return facts


def _row(drawn: Mapping[str, Array], i: int) -> dict[str, float]:
    """Coefficients of the straight run in one draw."""
    return {symbol: float(drawn[symbol][i]) for symbol in ROOTS}


def _stability(vehicle: Vehicle, drawn: Mapping[str, Array], plane: Plane) -> dict[str, Any]:
    """Stability index of a plane, and how likely its sign and that of the bow's moment are."""
    body, (margin, moment, sign) = vehicle.body, MARGINS[plane]
    inertia = body.inertia_kgm2(plane)
    with np.errstate(divide="ignore", invalid="ignore"):
        index = np.asarray(margin(drawn, body.mass_kg, body.x_g_m), float)
    growth = stability.eigenvalues_per_metre(drawn, body.mass_kg, inertia, body.x_g_m, plane)
    return {
        "G": _figure(index),
        "unstable_probability": float(np.mean(growth[1:].real.max(axis=-1) >= 0.0)),
        "weathercock_probability": float(np.mean(sign * drawn[moment][1:] > 0.0)),
    }


def _maneuvers(
    vehicle: Vehicle, drawn: Mapping[str, Array], speed: Array, rate_rps: float
) -> dict[str, Any]:
    """Turning circle and zigzag."""
    own, length = {s: drawn[s] for s in symbols_of("horizontal")}, vehicle.hull.length_m
    servo = usual_rate_degps(float(np.nanmedian(speed)), length)
    turns = math.radians(servo)
    found = maneuver_figures(own, vehicle.body, length, speed, rate_rps, fin_radps=turns)
    figures: dict[str, Any] = {name: _figure(x) for name, x in found.items()}
    orders = {"circle_rudder_deg": CIRCLE_DEG, "zigzag_rudder_deg": ZIGZAG_DEG}
    return {**orders, "servo_degps": servo, **figures}


def _figure(x: Array) -> dict[str, float]:
    """Value and spread of a figure: of the estimate first, then of the draws."""
    draws = x[1:][np.isfinite(x[1:])]
    told = {"value": float(x[0]), "share": len(draws) / len(x[1:])}
    if len(draws) < FEWEST:
        return told
    inner, outer = np.percentile(draws, ONE_STD), np.percentile(draws, NEARLY_ALL)
    told["std"] = float(0.5 * (inner[1] - inner[0]))
    return told | {"low": float(outer[0]), "high": float(outer[1])}
