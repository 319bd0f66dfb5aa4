"""Drag along and across the hull, of a fin, and of what a sketch omits (theory 3.2, 8.2)."""

from typing import Any

import numpy as np

from auvident.physics.ase.accuracy import Deviation
from auvident.physics.ase.geometry import HullGeometry
from auvident.schema.vehicle import AseOptions, Hull

LAMINAR_REYNOLDS = 5e5  # below it long laminar runs are likely
FORM_CUBIC, FORM_LINEAR = 60.0, 0.0025  # 1 + 60/f^3 + 0.0025 f (DATCOM 4.2.3.1)
FIN_THICKNESS = 0.12  # of the chord: NACA 0012, usual on small vehicles
LEAST_REYNOLDS = 1e4  # of a fin; the friction lines are for turbulent flow and end far above
BASE_DRAG = 0.029  # 0.029 (d_b/d)^3 / sqrt(C_Df), on the frontal area (DATCOM 4.2.3.1)

# Cylinder drag against cross-flow Reynolds number: Jorgensen TR R-474 p. 76 by way of digitised
# data (White; Roshko 1961), smoothed (theory 3.2, row "use").
CROSSFLOW_REYNOLDS = (
    1e2,
    1e3,
    3e3,
    1e4,
    3e4,
    1e5,
    2e5,
    2.5e5,
    3.2e5,
    4e5,
    5e5,
    6.3e5,
    1e6,
    1.6e6,
    2e6,
    2.5e6,
    3.2e6,
    4e6,
)
CROSSFLOW_DRAG = (
    1.40,
    1.00,
    0.95,
    1.10,
    1.20,
    1.20,
    1.18,
    1.08,
    0.90,
    0.45,
    0.29,
    0.30,
    0.34,
    0.43,
    0.55,
    0.61,
    0.69,
    0.70,
)
SUBCRITICAL_DRAG = 1.2  # from 3e4 up to the drag crisis

# Finite-length factor against fineness: Jorgensen 1977 fig. 4, digitised; and DATCOM
# fig. 4.2.1.2-35a.
JORGENSEN_FINENESS = (1.5, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 14, 16, 18, 20, 24, 28, 32, 36, 39)
JORGENSEN_ETA = (
    0.558,
    0.569,
    0.592,
    0.611,
    0.625,
    0.639,
    0.651,
    0.663,
    0.672,
    0.682,
    0.700,
    0.717,
    0.729,
    0.740,
    0.752,
    0.772,
    0.785,
    0.799,
    0.810,
    0.814,
)
DATCOM_FINENESS = (2.0, 4.0, 8.0, 12.0, 16.0, 20.0, 24.0, 28.0)
DATCOM_ETA = (0.56, 0.60, 0.66, 0.71, 0.74, 0.76, 0.775, 0.79)


def friction_coefficient(reynolds: Any, line: str = "ittc57") -> np.ndarray:
    """Turbulent flat-plate friction.

    Parameters
    ----------
    reynolds : array_like
        Speed times length over kinematic viscosity.
    line : {"ittc57", "prandtl_schlichting", "schoenherr"}
        0.075/(lg Re - 2)^2; 0.455/(lg Re)^2.58; 0.242/sqrt(C_f) = lg(Re C_f).

    Returns
    -------
    ndarray
        C_f on the wetted surface.
    """
    log = np.log10(np.asarray(reynolds, float))
    if line == "prandtl_schlichting":
        return 0.455 / log**2.58
    ittc = 0.075 / (log - 2.0) ** 2
    if line == "ittc57":
        return ittc
    friction = ittc
    for _ in range(30):  # the fixed point contracts by about 0.15 a step
        friction = (0.242 / (log + np.log10(friction))) ** 2
    return friction


def form_factor(fineness: np.ndarray) -> np.ndarray:
    """Pressure drag of a body of revolution over its friction (DATCOM 4.2.3.1)."""
    return 1.0 + FORM_CUBIC / fineness**3 + FORM_LINEAR * fineness


def hull_drag_kgpm(
    hull: HullGeometry, speed_mps: Any, density: Any, viscosity: Any, options: AseOptions
) -> np.ndarray:
    """D_x of the bare hull: X_uu = -D_x (theory 3.2.14, table 3.2.1).

    Parameters
    ----------
    hull : HullGeometry
    speed_mps, density, viscosity : array_like
        For the Reynolds number on the length; kg/m^3; m^2/s.
    options : AseOptions
        ``friction_line`` and ``base_drag``.

    Returns
    -------
    ndarray
        Drag over u|u|, kg/m, positive.
    """
    reynolds = np.asarray(speed_mps, float) * hull.length_m / np.asarray(viscosity, float)
    friction = friction_coefficient(reynolds, options.friction_line)
    area = friction * form_factor(hull.fineness) * hull.wetted_m2
    if options.base_drag:
        frontal = 0.25 * np.pi * hull.diameter_m**2
        end = hull.shape.edges_m[..., -1:]
        base = 2.0 * hull.shape.radius_m(end)[..., 0] / hull.diameter_m
        area = area + BASE_DRAG * base**3 / np.sqrt(area / frontal) * frontal
    return 0.5 * np.asarray(density, float) * area


def fin_profile_drag(reynolds: Any, root_over_span: Any, line: str = "ittc57") -> np.ndarray:
    """C_D0 of a fin on a hull, on its planform area (Hoerner 1965, chapters 6 and 8).

    Parameters
    ----------
    reynolds : array_like
        On the mean chord.
    root_over_span : array_like
        Chord at the root over exposed span.
    line : str
        As of `friction_coefficient`.

    Returns
    -------
    ndarray
        2 C_f (1 + 2 t/c + 60 (t/c)^4) of both sides, and 0.75 t/c - 0.0003 (c/t)^2 on the square
        of the thickness in the corner with the hull.
    """
    friction = friction_coefficient(np.maximum(reynolds, LEAST_REYNOLDS), line)
    thickness = FIN_THICKNESS
    section = 2.0 * friction * (1.0 + 2.0 * thickness + 60.0 * thickness**4)
    corner = (0.75 * thickness - 0.0003 / thickness**2) * thickness**2
    return section + corner * np.asarray(root_over_span, float)


def omitted_drag_kgpm(
    hull: HullGeometry, density: Any, options: AseOptions, deviation: Deviation
) -> np.ndarray:
    """Drag over u|u|, kg/m, of what a vehicle file leaves out: antennas, sensors, openings, hub."""
    drag = options.appendage_cd * deviation.scale("protuberances")
    return drag * frontal_kgpm(hull, density)


def stated_drag_kgpm(
    stated: Hull, hull: HullGeometry, density: Any, deviation: Deviation
) -> np.ndarray | None:
    """Drag over u|u|, kg/m, of the whole vehicle by the coefficient in its file, or None."""
    if stated.drag_coefficient is None:
        return None
    drag = np.asarray(stated.drag_coefficient, float)
    spread = np.asarray(stated.drag_std, float) * deviation.shift("drag_stated")
    return (drag + spread) * frontal_kgpm(hull, density)


def frontal_kgpm(hull: HullGeometry, density: Any) -> np.ndarray:
    """Half density times frontal area: what a drag coefficient is multiplied by."""
    return 0.125 * np.pi * np.asarray(density, float) * hull.diameter_m**2


def crossflow_reynolds(
    hull: HullGeometry, speed_mps: Any, viscosity: Any, options: AseOptions
) -> np.ndarray:
    """V sin(alpha) d / nu at the representative incidence of the options (theory 3.2.18)."""
    across = np.asarray(speed_mps, float) * np.sin(np.radians(options.crossflow_angle_deg))
    return across * hull.diameter_m / np.asarray(viscosity, float)


def cylinder_drag(reynolds: Any) -> np.ndarray:
    """C_dn of a long cylinder, interpolated in lg Re, held beyond the ends of the table."""
    log = np.log10(np.maximum(np.asarray(reynolds, float), 1.0))
    return np.interp(log, np.log10(CROSSFLOW_REYNOLDS), CROSSFLOW_DRAG)


def finite_length_factor(fineness: np.ndarray, source: str = "datcom") -> np.ndarray:
    """Cross-flow drag of a finite over that of an infinite cylinder."""
    if source == "none":
        return np.ones_like(fineness)
    table = (
        (DATCOM_FINENESS, DATCOM_ETA) if source == "datcom" else (JORGENSEN_FINENESS, JORGENSEN_ETA)
    )
    return np.interp(fineness, *table)


def crossflow_kgpm3(
    hull: HullGeometry, speed_mps: Any, density: Any, viscosity: Any, options: AseOptions
) -> np.ndarray:
    """Half density times eta C_dn: the cross-flow force per planform area and speed squared."""
    if options.crossflow_drag == "constant":
        drag = np.asarray(options.crossflow_cd)
    else:
        drag = cylinder_drag(crossflow_reynolds(hull, speed_mps, viscosity, options))
    return _across_kgpm3(drag, hull, density, options)


def subcritical_kgpm3(hull: HullGeometry, density: Any, options: AseOptions) -> np.ndarray:
    """The same where the flow across is below the drag crisis."""
    return _across_kgpm3(np.asarray(SUBCRITICAL_DRAG), hull, density, options)


def _across_kgpm3(
    drag: np.ndarray, hull: HullGeometry, density: Any, options: AseOptions
) -> np.ndarray:
    """Half density times the drag of a finite cylinder."""
    eta = finite_length_factor(hull.fineness, options.crossflow_finite_length)
    return 0.5 * np.asarray(density, float) * eta * drag
