"""Every coefficient of both planes as the sum of its parts (theory 6, table 3.4.4)."""

import re
from collections import defaultdict
from typing import Any

import numpy as np

from auvident.physics.ase import added_mass
from auvident.physics.ase import hull as bare
from auvident.physics.ase.accuracy import NOMINAL, Deviation
from auvident.physics.ase.drag import hull_drag_kgpm, omitted_drag_kgpm, stated_drag_kgpm
from auvident.physics.ase.fins import FinForces, fin_forces
from auvident.physics.ase.geometry import HullGeometry, hull_geometry
from auvident.physics.ase.propeller import thrust_coefficients
from auvident.schema.coefficients import COEFFICIENTS, H
from auvident.schema.planes import BY_PLANE, HORIZONTAL, PLANES, VERTICAL, Plane
from auvident.schema.vehicle import Vehicle

Parts = dict[str, dict[str, np.ndarray]]
"""Symbol -> part (hull, sail, rudder, elevator, propeller, appendages) -> value."""

TURNED = str.maketrans({HORIZONTAL.names[x]: VERTICAL.names[x] for x in "ABab"})


def mirrored(symbol: str) -> tuple[str, int]:
    """Symbol in the vertical plane of a coefficient of the horizontal one, and its sign there.

    The vertical plane is the horizontal one turned by 90 degrees about x: v -> w, r -> -q, Y -> Z,
    N -> -M, and an elevator angle is a rudder angle with the opposite sign of the force.
    """
    signed = re.sub(r"\|.\|", "", symbol)  # a magnitude has no sign to change
    changes = symbol.startswith("N") + signed.count("r") + symbol.endswith("uud")
    return symbol.translate(TURNED), (-1) ** changes


MIRROR: dict[str, tuple[str, int]] = {
    c.symbol: mirrored(c.symbol) for c in COEFFICIENTS if c.planes == H
}


def coefficient_parts(
    vehicle: Vehicle,
    speed_mps: Any,
    deviation: Deviation = NOMINAL,
    geometry: HullGeometry | None = None,
) -> Parts:
    """Contribution of each part to each coefficient.

    Parameters
    ----------
    vehicle : Vehicle
        A body of revolution; its numbers may be arrays over a leading variants axis.
    speed_mps : array_like
        Speed for the Reynolds numbers.
    deviation : Deviation, optional
        Draw of the accuracies of the formulas.
    geometry : HullGeometry, optional
        Of this vehicle, when it is at hand already.

    Returns
    -------
    dict of str to dict of str to ndarray
        ``parts[symbol][part]``, dimensional SI; the value of a coefficient is the sum.
    """
    hull = hull_geometry(vehicle) if geometry is None else geometry
    density = np.asarray(vehicle.fluid.density_kgpm3, float)
    stream = np.asarray(speed_mps, float) / vehicle.fluid.kinematic_viscosity_m2ps
    fins = [fin_forces(f, hull, density, stream, vehicle.ase, deviation) for f in vehicle.fin]
    parts: Parts = {c.symbol: {} for c in COEFFICIENTS}
    surge = added_mass.surge(hull, density, vehicle.ase) * deviation.scale("surge_spheroid")
    parts["X_udot"]["hull"] = surge
    _axial_drag(vehicle, hull, fins, speed_mps, deviation, parts)
    for plane in PLANES:
        for symbol, contributions in _lateral(
            vehicle, hull, fins, surge, plane, speed_mps, deviation
        ).items():
            name, sign = (symbol, 1) if plane == "horizontal" else MIRROR[symbol]
            parts[name] = {part: sign * value for part, value in contributions.items()}
    if vehicle.propeller is not None:
        thrust = thrust_coefficients(vehicle.propeller, density, deviation)
        parts["T_nn"]["propeller"], parts["T_nu"]["propeller"] = thrust
    return parts


def totals(parts: Parts) -> dict[str, np.ndarray]:
    """Value of each coefficient: the sum of its parts, 0 where nothing contributes."""
    return {
        symbol: np.asarray(sum(values.values(), start=np.zeros(())))
        for symbol, values in parts.items()
    }


def _add(contributions: dict[str, np.ndarray], part: str, value: np.ndarray) -> None:
    """Add to a part; several sets of one kind add up."""
    contributions[part] = contributions[part] + value if part in contributions else value


def _axial_drag(
    vehicle: Vehicle,
    hull: HullGeometry,
    fins: list[FinForces],
    speed_mps: Any,
    deviation: Deviation,
    parts: Parts,
) -> None:
    """X_uu of hull, all fins and the rest; X_uudd, the mean of the planes with a moving set.

    The rest (``appendages``) is what a sketch omits, or what is missing to a stated total.
    """
    fluid = vehicle.fluid
    drag = hull_drag_kgpm(
        hull, speed_mps, fluid.density_kgpm3, fluid.kinematic_viscosity_m2ps, vehicle.ase
    )
    axial = parts["X_uu"]
    axial["hull"] = -drag * deviation.scale("friction")
    for fin in fins:
        _add(axial, fin.kind, -fin.profile)
    whole = stated_drag_kgpm(vehicle.hull, hull, fluid.density_kgpm3, deviation)
    if whole is None:
        rest = -omitted_drag_kgpm(hull, fluid.density_kgpm3, vehicle.ase, deviation)
    else:
        rest = -whole - sum(axial.values(), start=np.zeros(()))
    axial["appendages"] = rest
    moved = [[f for f in fins if command in f.commands] for command in HORIZONTAL.fins]
    planes = max(sum(bool(group) for group in moved), 1)
    for group in moved:
        for fin in group:
            _add(parts["X_uudd"], fin.kind, -fin.induced_deflection / planes)


def _lateral(
    vehicle: Vehicle,
    hull: HullGeometry,
    fins: list[FinForces],
    surge: np.ndarray,
    plane: Plane,
    speed_mps: Any,
    deviation: Deviation,
) -> Parts:
    """The coefficients of one plane under their horizontal names and signs."""
    out: Parts = defaultdict(dict, {symbol: {} for symbol in MIRROR})
    density, options = np.asarray(vehicle.fluid.density_kgpm3, float), vehicle.ase
    bare_mass = added_mass.bare_hull(hull, density, options, deviation)
    masses = {"hull": [bare_mass]}
    for entry in vehicle.fin:
        increment = added_mass.fin_increment(entry, hull, density, plane, deviation)
        masses.setdefault(entry.kind, []).append(increment)
    for part, lateral in masses.items():
        sums = added_mass.total(lateral)
        for symbol, value in zip(
            ("Y_vdot", "Y_rdot", "N_vdot", "N_rdot"),
            (sums.force, sums.cross, sums.cross, sums.moment),
            strict=True,
        ):
            out[symbol][part] = value
    turning = bare_mass
    if options.coriolis_added_mass == "finned":
        turning = added_mass.total([m for group in masses.values() for m in group])
    viscosity = vehicle.fluid.kinematic_viscosity_m2ps
    for terms in (
        bare.lift_terms(hull, density, options, deviation),
        bare.crossflow_terms(hull, speed_mps, density, viscosity, options, deviation),
        bare.coriolis_terms(surge, turning, deviation),
    ):
        for symbol, value in terms.items():
            _add(out[symbol], "hull", value)
    for fin in fins:
        if fin.projection[plane] != 0.0:
            _add_fin(out, fin, plane, deviation)
    return dict(out)


def _add_fin(out: Parts, fin: FinForces, plane: Plane, deviation: Deviation) -> None:
    """Theory tables 3.3.1 to 3.3.3 with the interference of 3.4.1 to 3.4.3."""
    cosine, x = fin.projection[plane], fin.x_m
    square = cosine**2
    side = -(fin.incidence + fin.profile) * square
    suction = (fin.incidence - fin.induced) * square * (1.0 + deviation.shift("suction"))
    across = -(fin.crossflow + fin.incidence * deviation.shift("fin_stall")) * cosine**3
    terms = {
        "X_vv": suction,
        "X_vr": 2.0 * x * suction,
        "X_rr": x**2 * suction,
        "Y_uv": side,
        "Y_ur": x * side,
        "N_uv": x * side,
        "N_ur": x**2 * side,
        "Y_v|v|": across,
        "Y_r|r|": across * x * np.abs(x),
        "N_v|v|": x * across,
        "N_r|r|": across * np.abs(x) ** 3,
    }
    if BY_PLANE[plane].fin in fin.commands:
        moved = fin.deflection * cosine
        terms |= {"Y_uud": moved, "N_uud": x * moved}
    for symbol, value in terms.items():
        _add(out[symbol], fin.kind, value)
