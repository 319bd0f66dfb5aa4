"""Volume, surfaces, centroids and moments of a hull of revolution about the origin O."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from auvident.physics.ase.quadrature import integrate
from auvident.schema.hull_shape import HullShape, hull_shape
from auvident.schema.vehicle import Vehicle

DATCOM_STATION = (0.378, 0.527)  # xi_0 = 0.378 L + 0.527 xi_1 (USAF DATCOM 4.2.1.1)


@dataclass(frozen=True)
class HullGeometry:
    """What the formulas need to know of the hull; arrays over variants, SI, x about O.

    Attributes
    ----------
    length_m, diameter_m, volume_m3, wetted_m2, planform_m2 : ndarray
        Sizes; the wetted surface is that of the sides, without a flat base.
    planform_x_m, buoyancy_x_m : ndarray
        Centroid of the planform area and of the volume.
    cut_x_m, cut_area_m2, cut_volume_m3 : ndarray
        The station where potential flow ends, its section and the volume ahead of it.
    volume_x_m4, volume_xx_m5 : ndarray
        Integrals of x S and x^2 S.
    planform_xabs_m4, planform_xcube_m5 : ndarray
        Integrals of 2R x|x| and 2R |x|^3, for the cross-flow of a turning hull.
    nose_x_m : ndarray
        Nose tip.
    shape : HullShape
    """

    length_m: np.ndarray
    diameter_m: np.ndarray
    volume_m3: np.ndarray
    wetted_m2: np.ndarray
    planform_m2: np.ndarray
    planform_x_m: np.ndarray
    buoyancy_x_m: np.ndarray
    cut_x_m: np.ndarray
    cut_area_m2: np.ndarray
    cut_volume_m3: np.ndarray
    volume_x_m4: np.ndarray
    volume_xx_m5: np.ndarray
    planform_xabs_m4: np.ndarray
    planform_xcube_m5: np.ndarray
    nose_x_m: np.ndarray
    shape: HullShape

    @property
    def fineness(self) -> np.ndarray:
        """Length over largest diameter."""
        return self.length_m / self.diameter_m

    @property
    def tail_m(self) -> np.ndarray:
        """Length from the end of the parallel body to the aft end."""
        return self.length_m - self.shape.tail_start_m

    def radius_at(self, x_m: Any) -> np.ndarray:
        """Hull radius at body stations `x_m`, one per variant; zero beyond the ends."""
        xi = self.nose_x_m - np.asarray(x_m, float)
        return self.shape.radius_m(xi[..., None])[..., 0]


def hull_geometry(vehicle: Vehicle) -> HullGeometry:
    """Integrate the hull of the vehicle.

    Parameters
    ----------
    vehicle : Vehicle
        Its numbers may be arrays over variants.

    Returns
    -------
    HullGeometry

    Raises
    ------
    NumericsError
        When the integrals do not converge.
    """
    shape = hull_shape(vehicle.hull)
    nose_x = np.asarray(vehicle.body.origin_from_nose_m, float)
    cut = cut_station_m(vehicle, shape)
    edges = _edges(shape, nose_x, cut)

    def integrands(xi: np.ndarray) -> np.ndarray:
        g, slope = shape.squared_radius(xi)
        g = np.maximum(g, 0.0)
        radius, section, x = np.sqrt(g), np.pi * g, nose_x[..., None] - xi
        side = 2.0 * np.pi * np.sqrt(g + (0.5 * slope) ** 2)
        ahead = np.where(xi <= cut[..., None], section, 0.0)
        rows = [section, ahead, section * x, section * x**2, side, 2.0 * radius]
        rows += [2.0 * radius * x, 2.0 * radius * x * np.abs(x), 2.0 * radius * np.abs(x) ** 3]
        return np.stack(np.broadcast_arrays(*rows))

    volume, ahead, vx, vxx, wetted, plan, px, pabs, pcube = integrate(integrands, edges)
    cut_radius = shape.radius_m(cut[..., None])[..., 0]
    return HullGeometry(
        shape.length_m,
        2.0 * shape.max_radius_m,
        volume,
        wetted,
        plan,
        px / plan,
        vx / volume,
        nose_x - cut,
        np.pi * cut_radius**2,
        ahead,
        vx,
        vxx,
        pabs,
        pcube,
        nose_x,
        shape,
    )


def cut_station_m(vehicle: Vehicle, shape: HullShape) -> np.ndarray:
    """Distance from the nose where potential flow is taken to end (theory 3.2.6, DATCOM)."""
    end = shape.edges_m[..., -1]
    if vehicle.ase.hull_station == "end":
        return end
    if vehicle.ase.hull_station == "mid_tail":
        return 0.5 * (shape.tail_start_m + end)
    xi = np.linspace(0.0, 1.0, 2001) * end[..., None]
    steepest = np.argmin(shape.squared_radius(xi)[1], axis=-1)
    xi_1 = np.take_along_axis(xi, steepest[..., None], axis=-1)[..., 0]
    return np.minimum(DATCOM_STATION[0] * shape.length_m + DATCOM_STATION[1] * xi_1, end)


def _edges(shape: HullShape, nose_x: np.ndarray, cut: np.ndarray) -> np.ndarray:
    """Pieces of the shape, divided also at the cut station and at the origin."""
    first, last = shape.edges_m[..., :1], shape.edges_m[..., -1:]
    extra = [np.clip(station[..., None], first, last) for station in (nose_x, cut)]
    lead = np.broadcast_shapes(*(e.shape[:-1] for e in (shape.edges_m, *extra)))
    parts = [np.broadcast_to(e, (*lead, e.shape[-1])) for e in (shape.edges_m, *extra)]
    return np.sort(np.concatenate(parts, axis=-1), axis=-1)
