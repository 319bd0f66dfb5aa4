"""Coefficients of the bare hull (theory 3, tables 3.2.1 and 3.2.2) in the horizontal plane.

A body of revolution has the same ones in the vertical plane, with the signs of
`auvident.physics.ase.assembly.MIRROR`.
"""

from typing import Any

import numpy as np

from auvident.physics.ase.accuracy import Deviation
from auvident.physics.ase.added_mass import Lateral
from auvident.physics.ase.drag import crossflow_kgpm3, subcritical_kgpm3
from auvident.physics.ase.geometry import HullGeometry
from auvident.physics.ase.spheroid import (
    datcom_slenderness,
    equal_volume_radius_m,
    spheroid_factors,
)
from auvident.schema.vehicle import AseOptions


def slenderness_factor(hull: HullGeometry, options: AseOptions) -> np.ndarray:
    """Munk's k2 - k1 (theory 3.1), of the equal-volume spheroid or from DATCOM's chart."""
    if options.hull_slenderness == "datcom":
        return datcom_slenderness(hull.fineness)
    radius = equal_volume_radius_m(hull.length_m, hull.volume_m3)
    factors = spheroid_factors(0.5 * hull.length_m, radius)
    return factors.lateral - factors.axial


def cut(hull: HullGeometry, deviation: Deviation) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Station, section and volume ahead where potential flow ends, moved by its accuracy."""
    move = deviation.shift("cut_station") * hull.tail_m
    x = np.maximum(hull.cut_x_m - move, hull.nose_x_m - hull.length_m)
    area = np.where(move == 0.0, hull.cut_area_m2, np.pi * hull.radius_at(x) ** 2)
    between = 0.5 * (area + hull.cut_area_m2) * (hull.cut_x_m - x)
    return x, area, hull.cut_volume_m3 + between


def lift_terms(
    hull: HullGeometry, density: Any, options: AseOptions, deviation: Deviation
) -> dict[str, np.ndarray]:
    """Potential force cut at the mid-tail station: Y_uv, N_uv, X_vv, and the rate terms.

    The rate terms (option ``hull_rate_lift``; zero in the method, but a deviation) are those of
    a slender body whose wake begins at the cut: Y_ur = x_s Y_uv, N_ur = x_s^2 Y_uv. They bring
    the SUBOFF bare hull's Y_r', N_r' (Roddy 1990) from -0.0004, 0.0001 to the measured size.
    """
    x, area, volume = cut(hull, deviation)
    strength = density * slenderness_factor(hull, options) * deviation.scale("slenderness")
    force = -strength * area
    rate = float(options.hull_rate_lift) + deviation.shift("hull_rate_lift")
    return {
        "Y_uv": force,
        "N_uv": -strength * (volume + x * area),
        "X_vv": -0.5 * force * (1.0 + deviation.shift("suction")),
        "Y_ur": rate * x * force,
        "N_ur": rate * x**2 * force,
    }


def crossflow_terms(
    hull: HullGeometry,
    speed_mps: Any,
    density: Any,
    viscosity: Any,
    options: AseOptions,
    deviation: Deviation,
) -> dict[str, np.ndarray]:
    """Cross-flow drag: Y_v|v|, N_v|v|, and as an option the strips of a turning hull.

    Jorgensen's correction (TR R-474, theory 3.2.14-20): eta of the fineness and C_dn of the
    cross-flow Reynolds number, in both planes. A coefficient is constant, so that number is taken
    at one incidence (``crossflow_angle_deg``). The factor cos(alpha/2) of his potential term is of
    third order in the incidence, where the model ends at the second.

    The strips of a turning hull are uncertain by subcritical ones: near the pivot the flow
    across is slow at any speed.
    """
    per_area = crossflow_kgpm3(hull, speed_mps, density, viscosity, options)
    half_density = 0.5 * np.asarray(density, float)
    per_area = per_area * deviation.offset_factor("crossflow_drag", per_area / half_density)
    force = -per_area * hull.planform_m2
    centre = hull.planform_x_m - deviation.shift("crossflow_centre") * hull.length_m
    turning = float(options.hull_rate_crossflow) * per_area
    slow = subcritical_kgpm3(hull, density, options)
    turning = turning + deviation.shift("crossflow_turning") * slow
    return {
        "Y_v|v|": force,
        "N_v|v|": force * centre,
        "Y_r|r|": -turning * hull.planform_xabs_m4,
        "N_r|r|": -turning * hull.planform_xcube_m5,
    }


def coriolis_terms(
    surge_added_mass: np.ndarray, lateral: Lateral, deviation: Deviation
) -> dict[str, np.ndarray]:
    """Added-mass forces of a turning body (theory 3.1.6); Munk's moment is in `lift_terms`."""
    share = deviation.scale("coriolis")
    return {
        "X_vr": -lateral.force * share,
        "X_rr": -lateral.cross * share,
        "Y_ur": surge_added_mass * share,
        "N_ur": lateral.cross * share,
    }
