"""What the ``[hull]`` keys mean: the squared radius along the axis of a body of revolution.

A shape is given as G = R^2 and dG/dxi over the distance xi from the nose, because G stays smooth
where a rounded nose makes R' infinite: S = pi G, dS_w = 2 pi sqrt(G + (G'/2)^2) dxi.

The numbers of the hull may be arrays over a leading variants axis; stations have one more axis
at the end.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from auvident.schema.vehicle import Hull

MYRING_THETA_DEG = 25.0  # tail half angle when none is given; REMUS: 0.436 rad (Prestero 2001)
MYRING_FULLEST = 2.5  # c tan(theta) over the drop in radius of an assumed tail; from 3 on it bulges
DEFAULT_NOSE_DIAMETERS = 1.0  # nose length when none is given; REMUS 0.91, SUBOFF 2.0 diameters
DEFAULT_TAIL_DIAMETERS = 2.5  # tail length when none is given; REMUS 2.6, SUBOFF 2.2 diameters
PARALLEL_TOLERANCE = 5e-4  # of the largest radius: an offset this close to it is parallel body
PARALLEL_STATIONS = 4001  # at which the end of the parallel body is looked for in offsets

Squared = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class HullShape:
    """A body of revolution.

    Attributes
    ----------
    length_m, max_radius_m : ndarray, shape (...)
        Length and largest radius.
    edges_m : ndarray, shape (..., k)
        Ascending stations from the nose between which the shape is smooth.
    tail_start_m : ndarray, shape (...)
        Where the parallel body ends, from the nose.
    squared_radius : callable
        ``xi (..., n) -> (G, dG/dxi)`` in m^2 and m; zero outside the hull.
    """

    length_m: np.ndarray
    max_radius_m: np.ndarray
    edges_m: np.ndarray
    tail_start_m: np.ndarray
    squared_radius: Squared

    def radius_m(self, xi: Any) -> np.ndarray:
        """Radius at stations from the nose, shape (..., n)."""
        return np.sqrt(np.maximum(self.squared_radius(np.asarray(xi, dtype=float))[0], 0.0))


def section_lengths(hull: Hull) -> tuple[np.ndarray, np.ndarray]:
    """Nose and tail length, m, with the stated defaults where the file gives none."""
    length, diameter = np.asarray(hull.length_m, float), np.asarray(hull.diameter_m, float)
    nose, tail = hull.nose_length_m, hull.tail_length_m
    assumed_nose = np.minimum(DEFAULT_NOSE_DIAMETERS * diameter, 0.3 * length)
    assumed_tail = np.minimum(DEFAULT_TAIL_DIAMETERS * diameter, 0.5 * length)
    return (
        assumed_nose if nose is None else np.asarray(nose, float),
        assumed_tail if tail is None else np.asarray(tail, float),
    )


def hull_shape(hull: Hull) -> HullShape:
    """Shape of a hull of revolution.

    Parameters
    ----------
    hull : Hull
        The ``[hull]`` table; its numbers may be arrays over variants.

    Returns
    -------
    HullShape
        Myring (Prestero 2001 eq. 2.1, 2.2), ellipsoid-cylinder-cone, DARPA SUBOFF (Groves et
        al. 1989) scaled to length and diameter, or free offsets.
    """
    if hull.family == "offsets":
        return _offsets(hull)
    return _suboff(hull) if hull.family == "suboff" else _sections(hull)


def _sections(hull: Hull) -> HullShape:
    """Nose, cylinder and tail; the Myring nose with n = 2 is a semi-ellipsoid."""
    length, radius = np.asarray(hull.length_m, float), 0.5 * np.asarray(hull.diameter_m, float)
    nose, tail = section_lengths(hull)
    tail_start = length - tail
    length, radius, nose, tail_start = np.broadcast_arrays(length, radius, nose, tail_start)
    stern = _tail(hull, tail_start[..., None], (length - tail_start)[..., None], radius[..., None])
    bow = _nose(hull, nose[..., None], radius[..., None])

    def squared_radius(xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        (g_bow, d_bow), (g_stern, d_stern) = bow(xi), stern(xi)
        in_bow, in_stern = xi < nose[..., None], xi > tail_start[..., None]
        outside = (xi < 0.0) | (xi > length[..., None] * (1.0 + 1e-12))
        g = np.where(in_bow, g_bow, np.where(in_stern, g_stern, radius[..., None] ** 2))
        d = np.where(in_bow, d_bow, np.where(in_stern, d_stern, 0.0))
        return np.where(outside, 0.0, g), np.where(outside, 0.0, d)

    edges = np.stack([np.zeros_like(length), nose, tail_start, length], axis=-1)
    return HullShape(length, radius, edges, tail_start, squared_radius)


def _nose(hull: Hull, nose: np.ndarray, radius: np.ndarray) -> Squared:
    """R = d/2 [1 - ((xi + a_off - a)/a)^2]^(1/n), a = nose length + a_off (Prestero 2.1)."""
    a = nose + np.asarray(hull.myring_nose_offset_m, float)[..., None]
    a = np.where(a > 1e-9 * radius, a, 1.0)  # no nose at all
    power = 2.0 / np.asarray(hull.myring_n, float)[..., None]

    def squared(xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        t = np.clip((xi - nose) / a, -1.0 + 1e-15, 0.0)
        bracket = 1.0 - t * t
        g = radius**2 * bracket**power
        return g, radius**2 * power * bracket ** (power - 1.0) * (-2.0 * t / a)

    return squared


def _tail(hull: Hull, start: np.ndarray, tail: np.ndarray, radius: np.ndarray) -> Squared:
    """Myring's cubic (Prestero 2.2, extended to a base radius), cone, parabola or ellipsoid."""
    base = 0.5 * np.asarray(hull.tail_base_diameter_m, float)[..., None]
    drop = radius - base
    c = tail + np.asarray(hull.myring_tail_offset_m, float)[..., None]
    c = np.where(c > 1e-9 * radius, c, 1.0)  # no tail at all
    theta = MYRING_THETA_DEG if hull.myring_theta_deg is None else hull.myring_theta_deg
    slope = c * np.tan(np.radians(np.asarray(theta, float)))[..., None]
    if hull.myring_theta_deg is None:
        slope = np.minimum(slope, MYRING_FULLEST * drop)
    kind = "myring" if hull.family == "myring" else hull.tail_shape

    def squared(xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        s = np.clip((xi - start) / c, 0.0, 1.0)
        if kind == "ellipsoid":
            bent = np.sqrt(np.maximum(1.0 - s * s, 0.0))
            r = base + drop * bent
            return r * r, 2.0 * drop * (-s / c) * (drop + base / np.maximum(bent, 1e-12))
        if kind == "myring":
            r = radius - (3.0 * drop - slope) * s**2 + (2.0 * drop - slope) * s**3
            d = -2.0 * (3.0 * drop - slope) * s + 3.0 * (2.0 * drop - slope) * s**2
        elif kind == "parabola":
            r, d = radius - drop * s**2, -2.0 * drop * s
        else:
            r, d = radius - drop * s, -drop * np.ones_like(s)
        return r * r, 2.0 * r * d / c

    return squared


# DARPA SUBOFF hull: Groves, Huang & Chang 1989 (DTRC/SHD-1298-01), feet from the nose.
SUBOFF_LENGTH_FT = 14.291667
SUBOFF_EDGES_FT = (0.0, 3.333333, 10.645833, 13.979167, 14.291667)
SUBOFF_BASE_RATIO, SUBOFF_K0, SUBOFF_K1 = 0.1175, 10.0, 44.6244


def suboff_squared(x_ft: np.ndarray) -> np.ndarray:
    """(R/R_max)^2 of the SUBOFF hull at `x_ft` from the nose (Groves et al. 1989)."""
    rh, k0, k1 = SUBOFF_BASE_RATIO, SUBOFF_K0, SUBOFF_K1
    _, bow, mid, aft, end = SUBOFF_EDGES_FT
    x = np.clip(x_ft, 0.0, bow)
    t = 0.3 * x - 1.0
    nose = 1.126395101 * x * t**4 + 0.442874707 * x**2 * t**3 + 1.0 - t**4 * (1.2 * x + 1.0)
    s = np.clip((aft - x_ft) / bow, 0.0, 1.0)
    tail = (
        rh**2
        + rh * k0 * s**2
        + (20.0 - 20.0 * rh**2 - 4.0 * rh * k0 - k1 / 3.0) * s**3
        + (-45.0 + 45.0 * rh**2 + 6.0 * rh * k0 + k1) * s**4
        + (36.0 - 36.0 * rh**2 - 4.0 * rh * k0 - k1) * s**5
        + (-10.0 + 10.0 * rh**2 + rh * k0 + k1 / 3.0) * s**6
    )
    cap = rh**2 * np.maximum(1.0 - ((np.clip(x_ft, aft, end) - aft) / (end - aft)) ** 2, 0.0)
    g = np.where(x_ft > aft, cap, tail)
    g = np.where(x_ft < bow, np.maximum(nose, 0.0) ** (2.0 / 2.1), np.where(x_ft < mid, 1.0, g))
    return np.where((x_ft < 0.0) | (x_ft > end * (1.0 + 1e-12)), 0.0, g)


def _suboff(hull: Hull) -> HullShape:
    """The SUBOFF hull, stretched to the length and diameter of the file."""
    length, radius = np.broadcast_arrays(
        np.asarray(hull.length_m, float), 0.5 * np.asarray(hull.diameter_m, float)
    )
    per_m = (SUBOFF_LENGTH_FT / length)[..., None]

    def squared_radius(xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        step = 1e-6 * SUBOFF_LENGTH_FT  # central difference inside the hull, error ~1e-9
        x = np.asarray(xi) * per_m
        low, high = np.maximum(x - step, 0.0), np.minimum(x + step, SUBOFF_LENGTH_FT)
        slope = (suboff_squared(high) - suboff_squared(low)) / np.maximum(high - low, step)
        inside = (x >= 0.0) & (x <= SUBOFF_LENGTH_FT * (1.0 + 1e-12))
        square = radius[..., None] ** 2
        return square * suboff_squared(x), np.where(inside, square * slope * per_m, 0.0)

    edges = np.asarray(SUBOFF_EDGES_FT) / per_m
    return HullShape(length, radius, edges, edges[..., 2], squared_radius)


def _offsets(hull: Hull) -> HullShape:
    """Offsets, R^2 joined by a monotone cubic (no overshoot between the given points)."""
    x = np.asarray(hull.offsets_x_from_nose_m, float)
    g = np.asarray(hull.offsets_radius_m, float) ** 2
    slopes = monotone_slopes(x, g)

    def squared_radius(xi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        value, slope = hermite(x, g, slopes, np.asarray(xi, float))
        span = (x[-1] - x[0]) * 1e-12
        outside = (xi < x[0] - span) | (xi > x[-1] + span)
        return np.where(outside, 0.0, np.maximum(value, 0.0)), np.where(outside, 0.0, slope)

    top = float(np.sqrt(g.max()))
    if hull.tail_length_m is not None:
        tail_start = x[-1] - float(hull.tail_length_m)
    else:
        fine = np.linspace(x[0], x[-1], PARALLEL_STATIONS)
        full = np.sqrt(np.maximum(squared_radius(fine)[0], 0.0)) >= (1.0 - PARALLEL_TOLERANCE) * top
        tail_start = float(fine[np.flatnonzero(full)[-1]]) if np.any(full) else float(x[g.argmax()])
    return HullShape(
        np.asarray(x[-1] - x[0]), np.asarray(top), x, np.asarray(tail_start), squared_radius
    )


def monotone_slopes(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Slopes of the monotone cubic of Fritsch & Butland (1984) with one-sided ends.

    Parameters
    ----------
    x, y : ndarray, shape (n,)
        Strictly ascending stations and values, n >= 2.

    Returns
    -------
    ndarray, shape (n,)
        dy/dx at the stations.
    """
    h, secant = np.diff(x), np.diff(y) / np.diff(x)
    slopes = np.zeros_like(y)
    slopes[0], slopes[-1] = secant[0], secant[-1]
    if len(x) == 2:
        return slopes
    w1, w2 = 2.0 * h[1:] + h[:-1], h[1:] + 2.0 * h[:-1]
    same = secant[:-1] * secant[1:] > 0.0
    safe = np.where(secant == 0.0, 1.0, secant)
    slopes[1:-1] = np.where(same, (w1 + w2) / (w1 / safe[:-1] + w2 / safe[1:]), 0.0)
    slopes[0] = _end_slope(h[0], h[1], secant[0], secant[1])
    slopes[-1] = _end_slope(h[-1], h[-2], secant[-1], secant[-2])
    return slopes


def _end_slope(h0: float, h1: float, s0: float, s1: float) -> float:
    """Three-point slope at an end, limited so that the curve keeps its direction."""
    slope = ((2.0 * h0 + h1) * s0 - h0 * s1) / (h0 + h1)
    if slope * s0 <= 0.0:
        return 0.0
    return 3.0 * s0 if s0 * s1 < 0.0 and abs(slope) > 3.0 * abs(s0) else slope


def hermite(
    x: np.ndarray, y: np.ndarray, slopes: np.ndarray, at: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Value and slope of the cubic Hermite interpolant, clamped to the ends of the table."""
    at = np.clip(at, x[0], x[-1])
    i = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(x) - 2)
    h = x[i + 1] - x[i]
    t = (at - x[i]) / h
    rise = (y[i + 1] - y[i]) / h
    bend = slopes[i] + slopes[i + 1] - 2.0 * rise
    turn = 3.0 * rise - 2.0 * slopes[i] - slopes[i + 1]
    value = y[i] + h * t * (slopes[i] + t * (turn + t * bend))
    return value, slopes[i] + t * (2.0 * turn + 3.0 * t * bend)
