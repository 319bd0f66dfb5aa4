"""Numbers for people that follow from the geometry and from the coefficients."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from auvident.physics.ase import stability
from auvident.physics.ase.drag import crossflow_reynolds, cylinder_drag, finite_length_factor
from auvident.physics.ase.fins import aspect_ratio, hull_ratio, lift_slope
from auvident.physics.ase.geometry import HullGeometry
from auvident.physics.ase.hull import slenderness_factor
from auvident.physics.ase.spread import spread_facts
from auvident.schema.vehicle import Vehicle

SPEED_SHARES = (0.5, 0.75, 1.0, 1.25)  # of the design speed, rows of the speed table


def geometry_facts(vehicle: Vehicle, hull: HullGeometry, speed_mps: float) -> dict[str, float]:
    """Sizes, stations, Reynolds numbers and factors behind the coefficients, by name and unit."""
    viscosity, options = vehicle.fluid.kinematic_viscosity_m2ps, vehicle.ase
    reynolds_c = crossflow_reynolds(hull, speed_mps, viscosity, options)
    drag = (
        options.crossflow_cd if options.crossflow_drag == "constant" else cylinder_drag(reynolds_c)
    )
    facts: dict[str, Any] = {
        "length_m": hull.length_m,
        "diameter_m": hull.diameter_m,
        "fineness": hull.fineness,
        "volume_m3": hull.volume_m3,
        "wetted_m2": hull.wetted_m2,
        "planform_m2": hull.planform_m2,
        "planform_x_m": hull.planform_x_m,
        "buoyancy_x_m": hull.buoyancy_x_m,
        "tail_m": hull.tail_m,
        "cut_from_nose_m": hull.nose_x_m - hull.cut_x_m,
        "cut_x_m": hull.cut_x_m,
        "cut_area_m2": hull.cut_area_m2,
        "cut_volume_m3": hull.cut_volume_m3,
        "slenderness_factor": slenderness_factor(hull, options),
        "reynolds": speed_mps * hull.length_m / viscosity,
        "crossflow_reynolds": reynolds_c,
        "crossflow_cd": drag,
        "crossflow_finite_length": finite_length_factor(
            hull.fineness, options.crossflow_finite_length
        ),
    }
    for i, fin in enumerate(vehicle.fin):
        name = f"fin{i + 1}_{fin.kind}"
        facts[f"{name}_aspect_ratio"] = aspect_ratio(fin)
        facts[f"{name}_hull_ratio"] = hull_ratio(fin, hull)
        sweep = np.radians(fin.sweep_deg)
        facts[f"{name}_lift_slope"] = lift_slope(aspect_ratio(fin), sweep, options.fin_lift)
    return {name: float(value) for name, value in facts.items()}


def rigid_body_terms(vehicle: Vehicle) -> dict[str, float]:
    """What the mass adds beside each coefficient on its side of the equation (theory 1.3, 1.4).

    Returns
    -------
    dict of str to float
        For an added mass the entry of the mass matrix it stands in with opposite sign (m beside
        -Y_vdot); for the others the term that joins the coefficient on the right-hand side.
    """
    body = vehicle.body
    m, moment = body.mass_kg, body.mass_kg * body.x_g_m
    return {
        "X_udot": m,
        "Y_vdot": m,
        "Z_wdot": m,
        "N_rdot": body.izz_kgm2,
        "M_qdot": body.inertia_kgm2("vertical"),
        "Y_rdot": moment,
        "N_vdot": moment,
        "Z_qdot": -moment,
        "M_wdot": -moment,
        "X_vr": m,
        "X_rr": moment,
        "Y_ur": -m,
        "N_ur": -moment,
        "X_wq": -m,
        "X_qq": moment,
        "Z_uq": m,
        "M_uq": -moment,
    }


def motion_facts(
    vehicle: Vehicle,
    values: Mapping[str, float],
    stds: Mapping[str, float],
    effects: Mapping[str, Mapping[str, float]],
    speed_mps: float,
) -> dict[str, Any]:
    """Stability, turning and speed, straight from the coefficients.

    Parameters
    ----------
    vehicle : Vehicle
    values, stds : mapping of str to float
        Coefficients by symbol; the vertical plane is left out where they lack.
    effects : mapping of str to mapping
        One-sigma effect of each formula on each coefficient.
    speed_mps : float
        Design speed.

    Returns
    -------
    dict
        Finite numbers, lists of rows, and booleans; what does not exist is left out. ``spread``
        has the same figures with what the standard deviations leave open, see `spread_facts`.
    """
    body = vehicle.body
    facts: dict[str, Any] = {"horizontal": _horizontal(vehicle, values)}
    if "Z_uw" in values:
        facts["vertical"] = _vertical(vehicle, values)
    advance = stability.speed_per_rate_m(values)
    if np.isfinite(advance):
        rates = tuple(round(60.0 * s * speed_mps / advance, -1) for s in SPEED_SHARES)
        facts["speed"] = {
            "speed_per_rate_m": advance,
            "design_speed_mps": speed_mps,
            "design_speed_rpm": 60.0 * speed_mps / advance,
            "table": stability.speed_table(values, rates),
        }
    facts["mass_kg"], facts["x_g_m"] = body.mass_kg, body.x_g_m
    facts["spread"] = spread_facts(vehicle, values, stds, effects, speed_mps)
    return _finite(facts)


def _horizontal(vehicle: Vehicle, c: Mapping[str, float]) -> dict[str, Any]:
    """Facts of the horizontal plane."""
    body = vehicle.body
    margin = _quotient(stability.horizontal_stability, c, body.mass_kg, body.x_g_m)
    gain = _quotient(stability.linear_turning_gain, c, body.mass_kg, body.x_g_m)
    growth = stability.eigenvalues_per_metre(c, body.mass_kg, body.izz_kgm2, body.x_g_m)
    return {
        "G": margin,
        "straight_line_stable": bool(np.all(growth.real < 0.0)),
        "slowest_growth_per_m": float(np.max(growth.real)),
        "linear_rate_per_speed_and_rudder_perm": gain,
        "turns": stability.turning_table(c, body.mass_kg, body.x_g_m),
    }


def _vertical(vehicle: Vehicle, c: Mapping[str, float]) -> dict[str, Any]:
    """Facts of the vertical plane."""
    body = vehicle.body
    inertia = body.inertia_kgm2("vertical")
    facts: dict[str, Any] = {
        "G": _quotient(stability.vertical_stability, c, body.mass_kg, body.x_g_m)
    }
    critical = stability.righting_speed_mps(c, body.mass_kg, inertia, body.x_g_m, body.z_g_m)
    facts["stable_at_every_speed"] = critical is None
    if critical is not None:
        facts["stable_below_mps"] = critical
    return facts


def _quotient(function: Any, c: Mapping[str, float], mass: float, x_g: float) -> float:
    """Value of a quotient, NaN (left out later) where its denominator is zero."""
    numbers = {symbol: np.float64(value) for symbol, value in c.items()}
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(function(numbers, np.float64(mass), np.float64(x_g)))


def _finite(facts: Any) -> Any:
    """The same without entries that are not finite."""
    if isinstance(facts, dict):
        kept = {k: _finite(v) for k, v in facts.items()}
        return {k: v for k, v in kept.items() if v is not None}
    if isinstance(facts, list):
        return [_finite(row) for row in facts]
    if isinstance(facts, float) and not np.isfinite(facts):
        return None
    return facts
