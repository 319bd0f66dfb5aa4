"""Added mass: equal-volume spheroid in surge, strips with fins and sail sideways (theory 2)."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from auvident.physics.ase.accuracy import Deviation
from auvident.physics.ase.fins import chord_edges_m, projection
from auvident.physics.ase.geometry import HullGeometry
from auvident.physics.ase.quadrature import nodes_and_weights
from auvident.physics.ase.spheroid import equal_volume_radius_m, spheroid_factors
from auvident.schema.coefficients import Plane
from auvident.schema.vehicle import AseOptions, Fin

STRIP_NODES = 24  # per piece of a fin's chord; doubling it changes the sums by less than 1e-6


class Lateral(NamedTuple):
    """Sway force, its moment and the yaw moment: Y_vdot, Y_rdot = N_vdot, N_rdot."""

    force: np.ndarray
    cross: np.ndarray
    moment: np.ndarray


def two_fin_section(density: Any, tip: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Sway added mass of a circle with two opposite fins, kg/m (Blevins; Prestero 4.19).

    Parameters
    ----------
    density : array_like
    tip, radius : ndarray
        Distance of the tips from the axis, >= radius, and radius of the circle.

    Returns
    -------
    ndarray
        pi rho (s^2 - R^2 + R^4/s^2).
    """
    return np.pi * density * (tip**2 - radius**2 + _ratio(radius**4, tip**2))


def one_fin_section(density: Any, tip: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """Sway added mass of a circle with one fin, kg/m: pi rho ((s+R)^4/(4 s^2) - 3 R^2).

    Exact potential value from the Joukowski map of circle and fin to a slit (theory 2.2).
    """
    return np.pi * density * (_ratio((tip + radius) ** 4, 4.0 * tip**2) - 3.0 * radius**2)


def _ratio(top: np.ndarray, bottom: np.ndarray) -> np.ndarray:
    """Quotient that is zero where there is neither hull nor fin."""
    return np.where(bottom > 0.0, top / np.where(bottom > 0.0, bottom, 1.0), 0.0)


def surge(hull: HullGeometry, density: Any, options: AseOptions) -> np.ndarray:
    """X_udot, kg: spheroid of the hull's length and volume, or of its length and diameter."""
    radius = equal_volume_radius_m(hull.length_m, hull.volume_m3)
    volume = hull.volume_m3
    if options.surge_spheroid == "diameter":
        radius = 0.5 * hull.diameter_m
        volume = 2.0 / 3.0 * np.pi * hull.length_m * radius**2
    return -spheroid_factors(0.5 * hull.length_m, radius).axial * density * volume


def bare_hull(
    hull: HullGeometry, density: Any, options: AseOptions, deviation: Deviation
) -> Lateral:
    """Strip values of the bare hull (theory 3.1.4-5), optionally with the finite-length factors.

    Returns
    -------
    Lateral
        kg, kg m, kg m^2; Y_vdot < 0, N_rdot < 0.
    """
    force, cross = -density * hull.volume_m3, -density * hull.volume_x_m4
    moment = -density * hull.volume_xx_m5
    if options.finite_length:
        a, b = 0.5 * hull.length_m, equal_volume_radius_m(hull.length_m, hull.volume_m3)
        factors = spheroid_factors(a, b)
        about_centre = density * hull.volume_m3 * factors.rotation * (a**2 + b**2) / 5.0
        force, cross = factors.lateral * force, factors.lateral * cross
        moment = factors.lateral * -density * hull.volume_m3 * hull.buoyancy_x_m**2 - about_centre
    size = deviation.scale("strip_added_mass")
    arm = deviation.shift("added_mass_centre") * hull.length_m
    return Lateral(
        force * size,
        (cross + arm * force) * size,
        (moment + 2.0 * arm * cross) * size * deviation.scale("strip_rotation"),
    )


def fin_increment(
    fin: Fin, hull: HullGeometry, density: Any, plane: Plane, deviation: Deviation
) -> Lateral:
    """What a set of fins adds to the strips of the hull it covers.

    The tips stand at one distance from the axis over the mean chord (the s_R of the method); the
    hull radius is the local one.

    Returns
    -------
    Lateral
        kg, kg m, kg m^2.
    """
    share = projection(fin, plane) ** 2
    if share == 0.0:
        zero = np.zeros(())
        return Lateral(zero, zero, zero)
    edges = np.stack(np.broadcast_arrays(*chord_edges_m(fin)), axis=-1)
    x, weight = nodes_and_weights(edges, STRIP_NODES)
    radius = hull.shape.radius_m(hull.nose_x_m[..., None] - x)
    reach = hull.radius_at(fin.mid_chord_x_m) + np.asarray(fin.exposed_span_m, float)
    tip = np.maximum(reach[..., None], radius)
    rho = np.asarray(density, float)[..., None]
    pairs, singles = divmod(fin.count, 2)
    circle = np.pi * rho * radius**2
    strip = pairs * (two_fin_section(rho, tip, radius) - circle)
    strip = share * (strip + singles * (one_fin_section(rho, tip, radius) - circle)) * weight
    size = deviation.scale("strip_fins")
    moments = [-np.sum(strip * x**k, axis=-1) * size for k in (0, 1, 2)]
    return Lateral(*moments)


def total(parts: Sequence[Lateral]) -> Lateral:
    """Sum of hull and fins."""
    return Lateral(*(sum(values, start=np.zeros(())) for values in zip(*parts, strict=True)))
