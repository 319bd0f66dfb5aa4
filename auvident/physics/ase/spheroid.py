"""Added mass of a prolate spheroid (Lamb, Hydrodynamics, art. 114, 373; Imlay 1961)."""

from typing import NamedTuple

import numpy as np

SLENDERNESS_FINENESS = (4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 14.0, 16.0, 18.0, 20.0)
SLENDERNESS_DATCOM = (0.77, 0.825, 0.865, 0.91, 0.94, 0.955, 0.965, 0.97, 0.973, 0.975)
SPHERE_ECCENTRICITY = 0.02  # below it the closed forms lose digits; sphere values are exact to 1e-4


class SpheroidFactors(NamedTuple):
    """Added mass over displaced mass, axial and lateral, and added over displaced inertia."""

    axial: np.ndarray
    lateral: np.ndarray
    rotation: np.ndarray


def equal_volume_radius_m(length_m: np.ndarray, volume_m3: np.ndarray) -> np.ndarray:
    """Minor semi-axis of the spheroid with the hull's length and volume (theory 3.1.1)."""
    return np.sqrt(3.0 * volume_m3 / (2.0 * np.pi * length_m))


def spheroid_factors(half_length_m: np.ndarray, radius_m: np.ndarray) -> SpheroidFactors:
    """Lamb's k1, k2, k' (theory 3.1.2-3).

    Parameters
    ----------
    half_length_m, radius_m : ndarray
        Semi-axes a >= b.

    Returns
    -------
    SpheroidFactors
        ``X_udot = -k1 rho V``, ``Y_vdot = -k2 rho V``, ``N_rdot = -k' rho V (a^2+b^2)/5``.
    """
    e2 = 1.0 - (np.asarray(radius_m, float) / half_length_m) ** 2
    slender = e2 > SPHERE_ECCENTRICITY**2
    e2 = np.where(slender, e2, 0.5)
    e = np.sqrt(e2)
    log = np.log((1.0 + e) / (1.0 - e))
    alpha = 2.0 * (1.0 - e2) / e**3 * (0.5 * log - e)
    beta = 1.0 / e2 - (1.0 - e2) / (2.0 * e**3) * log
    rotation = e2**2 * (beta - alpha) / ((2.0 - e2) * (2.0 * e2 - (2.0 - e2) * (beta - alpha)))
    return SpheroidFactors(
        np.where(slender, alpha / (2.0 - alpha), 0.5),
        np.where(slender, beta / (2.0 - beta), 0.5),
        np.where(slender, rotation, 0.0),
    )


def datcom_slenderness(fineness: np.ndarray) -> np.ndarray:
    """k2 - k1 against fineness (DATCOM fig. 4.2.1.1-20a), held beyond the ends of the chart."""
    return np.interp(fineness, SLENDERNESS_FINENESS, SLENDERNESS_DATCOM)
