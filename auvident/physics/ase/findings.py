"""What an engineer should know before trusting the estimate of this vehicle."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from auvident.physics.ase.drag import LAMINAR_REYNOLDS
from auvident.physics.ase.fins import aspect_ratio, buried_share
from auvident.physics.ase.geometry import HullGeometry
from auvident.physics.ase.motion import rigid_constants
from auvident.physics.ase.propeller import thrust_line
from auvident.physics.ase.stability import speed_per_rate_m
from auvident.physics.terms import mass_matrices, structure_of
from auvident.schema.artifacts import Finding
from auvident.schema.coefficients import symbols_of
from auvident.schema.effect_words import with_std
from auvident.schema.planes import PLANE_ROWS
from auvident.schema.vehicle import Vehicle

BURIED_LIMIT = 0.5  # share of the span in the hull's wake from which lift is over-predicted
SMALL_FINENESS = 4.0  # DATCOM charts and slender-body theory begin here
WHICKER_FEHLNER_ASPECT = 3.0  # upper end of the tests of DTMB report 933
OPEN = 0.2  # probability of the less likely side above which nothing is decided
MASS_TOLERANCE = 0.15  # mass against displaced mass: beyond it the file deserves a look


def findings(
    vehicle: Vehicle, hull: HullGeometry, values: Mapping[str, float], speed_mps: float
) -> Iterator[Finding]:
    """Yield the findings about an estimate.

    Parameters
    ----------
    vehicle : Vehicle
    hull : HullGeometry
    values : mapping of str to float
        Coefficients by symbol.
    speed_mps : float

    Yields
    ------
    Finding
    """
    yield from _hull_findings(vehicle, hull, speed_mps)
    yield from _fin_findings(vehicle, hull)
    for row in PLANE_ROWS:
        name = row.fin
        if not any(name in fin.commands for fin in vehicle.fin):
            symbols = ", ".join(f"{axis}_uud" for axis in row.axes[1:])
            yield Finding(
                code=f"no_{name}",
                message=(
                    f"There is no fin of kind {name}: {symbols} are zero, with a wide "
                    "standard deviation."
                ),
                where="[[fin]]",
                remedy=f"Add a [[fin]] of kind {name!r} if the vehicle has one.",
            )
    yield from _propeller_findings(vehicle, values)
    yield from _mass_findings(vehicle, values)
    yield from _ballast_findings(vehicle)


def _ballast_findings(vehicle: Vehicle) -> Iterator[Finding]:
    """Inertia in pitch that is assumed; a centre of gravity with which the vehicle turns over."""
    if vehicle.body.iyy_kgm2 is None and any(fin.kind == "elevator" for fin in vehicle.fin):
        yield Finding(
            code="assumed_inertia",
            message="iyy_kgm2 is not given; izz_kgm2 is assumed, as of a body of revolution.",
            where="[vehicle] iyy_kgm2",
            remedy="State it for the vertical plane.",
        )
    if vehicle.body.z_g_m < 0.0:
        yield Finding(
            code="gravity_above",
            message="The centre of gravity lies above the axis, on which that of buoyancy is "
            "taken to be: such a vehicle turns over at rest.",
            where="[vehicle] z_g_m",
            value=vehicle.body.z_g_m,
            threshold=0.0,
            remedy="z_g_m is positive below the origin; check its sign, and count it from the "
            "centre of buoyancy.",
        )


def _mass_findings(vehicle: Vehicle, values: Mapping[str, float]) -> Iterator[Finding]:
    """Added masses, given in the vehicle file, with which nothing can be accelerated."""
    for row in PLANE_ROWS:
        structure = structure_of(row.name)
        known = {**rigid_constants(vehicle.body, row.name), **values}
        p = np.array([[known[name]] for name in structure.parameters])
        (mass,) = mass_matrices(structure, p)
        least = float(np.linalg.eigvalsh(0.5 * (mass + mass.T)).min())
        if least <= 0.0:
            added = ", ".join(s for s in symbols_of(row.name) if s.endswith("dot"))
            yield Finding(
                code="impossible_mass",
                message=f"With these added masses the mass matrix of the {row.name} plane is not "
                "positive definite: nothing can be simulated or identified.",
                where="[coefficients]",
                value=least,
                threshold=0.0,
                remedy=f"Check {added}: added masses are negative here, as X = X_udot du/dt.",
            )


def undecided(facts: Mapping[str, Any]) -> Iterator[Finding]:
    """Yield what the estimate leaves open, from `auvident.physics.ase.facts.motion_facts`."""
    spread = facts["spread"]["horizontal"]
    chance, index = spread["unstable_probability"], spread["G"]
    if OPEN < chance < 1.0 - OPEN and {"value", "std"} <= set(index):
        yield Finding(
            code="stability_undecided",
            message=f"The geometry does not decide whether the vehicle keeps a straight course: "
            f"directionally unstable with probability {chance:.2f} "
            f"(G {with_std(index['value'], index['std'])}).",
            where="[[fin]]",
            value=chance,
            remedy="Zigzags of small angles at sea show it; larger tail fins stabilise.",
        )


def _hull_findings(vehicle: Vehicle, hull: HullGeometry, speed_mps: float) -> Iterator[Finding]:
    """Range of the hull formulas, assumed sizes, mass against volume."""
    reynolds = speed_mps * float(hull.length_m) / vehicle.fluid.kinematic_viscosity_m2ps
    if reynolds < LAMINAR_REYNOLDS:
        yield Finding(
            code="low_reynolds",
            message="Much of the boundary layer may be laminar; the drag assumes a turbulent one.",
            where="[vehicle] design_speed_mps",
            value=reynolds,
            threshold=LAMINAR_REYNOLDS,
        )
    if float(hull.fineness) < SMALL_FINENESS:
        yield Finding(
            code="stout_hull",
            message="The hull is too stout for the charts and for slender-body theory.",
            where="[hull]",
            value=float(hull.fineness),
            threshold=SMALL_FINENESS,
        )
    if vehicle.hull.family in ("myring", "ellipsoid"):
        for key in ("nose_length_m", "tail_length_m"):
            if getattr(vehicle.hull, key) is None:
                yield Finding(
                    code="assumed_section",
                    message=f"{key} is not given; a typical one for this diameter is assumed.",
                    where=f"[hull] {key}",
                    remedy="State it: the tail determines the lift of the hull.",
                )
    displaced = vehicle.fluid.density_kgpm3 * float(hull.volume_m3)
    if abs(vehicle.body.mass_kg / displaced - 1.0) > MASS_TOLERANCE:
        yield Finding(
            code="mass_and_volume",
            message=f"The mass, {vehicle.body.mass_kg:g} kg, and the water the hull displaces, "
            f"{displaced:.4g} kg, differ.",
            where="[vehicle] mass_kg",
            value=vehicle.body.mass_kg / displaced,
            threshold=MASS_TOLERANCE,
            remedy="Check both; the mass of a free-flooding vehicle includes the water inside.",
        )


def _fin_findings(vehicle: Vehicle, hull: HullGeometry) -> Iterator[Finding]:
    """Fins outside the range in which their formulas were measured."""
    for i, fin in enumerate(vehicle.fin):
        where = f"[[fin]] {i + 1} ({fin.kind})"
        buried = float(buried_share(fin, hull))
        if fin.kind != "sail" and buried > BURIED_LIMIT:
            yield Finding(
                code="fin_in_wake",
                message="Much of the span lies in the wake of the hull, where the "
                "formulas overestimate the lift by a factor of 1.5 to 3 (DARPA "
                "SUBOFF); the standard deviations allow for it.",
                where=where,
                value=buried,
                threshold=BURIED_LIMIT,
                remedy="Set the efficiency of the fin if its lift is known.",
            )
        aspect = float(aspect_ratio(fin))
        if aspect > WHICKER_FEHLNER_ASPECT:
            yield Finding(
                code="slender_fin",
                message=(
                    "The aspect ratio is outside the range of the tests behind the lift formula."
                ),
                where=where,
                value=aspect,
                threshold=WHICKER_FEHLNER_ASPECT,
            )


def _propeller_findings(vehicle: Vehicle, values: Mapping[str, float]) -> Iterator[Finding]:
    """Thrust that cannot drive, and factors that are assumed."""
    if vehicle.propeller is None:
        yield Finding(
            code="no_propeller",
            message=(
                "There is no [propeller]: T_nn and T_nu are zero, with a wide standard deviation."
            ),
            where="[propeller]",
            remedy="Give diameter_m and kt0, kt1 or a table.",
        )
        return
    k_0, k_1 = (float(k) for k in thrust_line(vehicle.propeller))
    if k_0 <= 0.0 or k_1 >= 0.0:
        yield Finding(
            code="propeller_line",
            message=f"K_T = {k_0:g} + {k_1:g} J is not the curve of a propulsive propeller: "
            "thrust should be positive at J = 0 and decrease with J.",
            where="[propeller]",
            value=k_0,
        )
    elif not speed_per_rate_m(values) > 0.0:
        yield Finding(
            code="no_steady_speed",
            message="The thrust balances the drag at no forward speed.",
            where="[propeller]",
        )
    assumed = {"wake_fraction", "thrust_deduction"} - vehicle.propeller.model_fields_set
    for key in sorted(assumed):
        yield Finding(
            code="assumed_propulsion_factor",
            message=f"{key} is not given; 0 is assumed.",
            where=f"[propeller] {key}",
            remedy="0.1 to 0.4 (wake) and 0.05 to 0.25 (deduction) are typical behind AUV hulls.",
        )
