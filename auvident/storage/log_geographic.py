"""Position as latitude and longitude: how columns are called, and metres from the first fix.

North and east are arcs by the radii of curvature at the first fix (WGS 84). Where the meridians
converge they differ from a plane that touches the earth there by up to d^2 tan(latitude) / (2 R) at
the distance d: 0.07 m at 1 km and 40 degrees, 7 m at 10 km.
"""

import numpy as np

from auvident.schema.artifacts import Finding
from auvident.schema.channels import BY_QUANTITY

# Names of the columns, by the quantity that is made of them.
NAMES: dict[str, tuple[str, ...]] = {
    "north": ("latitude", "lat"),
    "east": ("longitude", "lon", "long", "lng"),
}
COLUMNS = tuple(BY_QUANTITY[quantity].column for quantity in NAMES)
EARTH_M, FLATTENING = 6378137.0, 1 / 298.257223563  # WGS 84
MOST_RAD = (np.pi / 2, np.pi)  # of latitude and longitude, either way
WHOLE_TURN_RAD = 2.0 * np.pi  # of a longitude that is counted eastward all around
ROUNDING = 1e-7  # of the largest angle: a float of four bytes
MOSTLY = 0.5  # of the latitudes are beyond a pole: another unit
FAR_RAD = np.deg2rad(1.0)  # in latitude, from the middle of a trial: a wild reading


def quantity_named(stem: str) -> str | None:
    """``north`` of the name of a latitude, ``east`` of a longitude, without its unit; else None."""
    return next((quantity for quantity, names in NAMES.items() if stem in names), None)


def is_no_fix(lat_rad: np.ndarray, lon_rad: np.ndarray) -> np.ndarray:
    """Where a receiver had no fix: both zero."""
    return (lat_rad == 0.0) & (lon_rad == 0.0)


def is_impossible(lat_rad: np.ndarray, lon_rad: np.ndarray) -> np.ndarray:
    """Where a latitude is beyond 90 degrees, or a longitude neither in -180 to 180 nor to 360."""
    most_lat, west, east = ((1.0 + ROUNDING) * most for most in (*MOST_RAD, WHOLE_TURN_RAD))
    return (np.abs(lat_rad) > most_lat) | (lon_rad < -west) | (lon_rad > east)


def faults_of(lat_rad: np.ndarray, lon_rad: np.ndarray) -> dict[str, np.ndarray]:
    """Which readings are none, by the reason under which they are counted."""
    return {"no_fix": is_no_fix(lat_rad, lon_rad), "implausible": is_impossible(lat_rad, lon_rad)}


def from_first_fix(lat_rad: np.ndarray, lon_rad: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """North and east by the radii of curvature at the first fix (WGS 84).

    Parameters
    ----------
    lat_rad, lon_rad : numpy.ndarray
        Latitude, positive north, and longitude, positive east, in rad, shape (n,). The longitude
        may jump by a turn, at the date line.

    Returns
    -------
    north_m, east_m : numpy.ndarray
        From the first fix that is not far from the others, in m; NaN where there is no fix.
    """
    fixed = np.isfinite(lat_rad) & np.isfinite(lon_rad)
    fixed &= ~is_no_fix(lat_rad, lon_rad) & ~is_impossible(lat_rad, lon_rad)
    if not fixed.any():
        return np.full(fixed.shape, np.nan), np.full(fixed.shape, np.nan)
    near = fixed & (np.abs(lat_rad - np.median(lat_rad[fixed])) < FAR_RAD)
    first = int(np.argmax(near if near.any() else fixed))
    meridian, across = _radii_m(float(lat_rad[first]))
    turn = (lon_rad - lon_rad[first] + np.pi) % (2.0 * np.pi) - np.pi
    north = (lat_rad - lat_rad[first]) * meridian
    east = turn * across * np.cos(lat_rad[first])
    return np.where(fixed, north, np.nan), np.where(fixed, east, np.nan)


def _radii_m(lat_rad: float) -> tuple[float, float]:
    """Radii of curvature of the ellipsoid along the meridian and across it."""
    e2 = FLATTENING * (2.0 - FLATTENING)
    w = 1.0 - e2 * np.sin(lat_rad) ** 2
    return EARTH_M * (1.0 - e2) / w**1.5, EARTH_M / np.sqrt(w)


def minutes_told(lat_rad: np.ndarray, lon_rad: np.ndarray, where: str) -> tuple[Finding, ...]:
    """What is said of fixes beyond the globe that are degrees and minutes (ddmm.mmmm of NMEA)."""
    lat, lon = (np.abs(np.degrees(x[np.isfinite(x)])).round(6) for x in (lat_rad, lon_rad))
    of_minutes = all(
        np.all(x % 100.0 <= 60.0) and np.all(x // 100.0 <= most)
        for x, most in ((lat, 90.0), (lon, 180.0))
    )
    if not lat.size or np.mean(lat > 90.0) < MOSTLY or not of_minutes:
        return ()
    return (
        Finding(
            code="degrees_and_minutes",
            message=f"latitude and longitude look like degrees and minutes (ddmm.mmmm of NMEA, "
            f"{np.median(lat):.4f} and {np.median(lon):.4f}), and no fix of them was read",
            where=where,
            remedy="Write them in degrees: dd + mm.mmmm / 60.",
        ),
    )
