"""A circle with radial fins that rolls and sways: added mass of the section, by conformal map.

For n equal fins, equally spaced, f = (z/R)^(n/2) + (R/z)^(n/2) takes the outside of circle and
fins to the outside of a slit, and f = F cos(n phi/2), F = f(s), runs along the slit with the
angle phi on a unit circle. The stream function of the boundary is r^2/2 in roll and x in sway
across a fin at angle zero; with its Fourier coefficients b_k the added mass is
pi rho sum k b_k^2 (Newman 1977, Marine Hydrodynamics, section 4.14).
"""

from typing import Any, NamedTuple

import numpy as np

POINTS = 8192  # about the circle: sums within 5e-4 of closed forms, 3e-3 for fins of R/10

# Rectangular plates moving across themselves, over pi/4 rho (shorter side)^2 (longer side),
# against the ratio of the sides (Meyerhoff 1970; DNV-RP-C205 table D-2).
PLATE_SIDES = (1.0, 1.25, 1.5, 1.59, 2.0, 2.5, 3.0, 3.17, 4.0, 5.0, 6.25, 8.0, 10.0)
PLATE_MASS = (
    *(0.579, 0.642, 0.690, 0.704, 0.757, 0.801, 0.830, 0.840),
    *(0.872, 0.897, 0.917, 0.934, 0.947),
)


class RollSection(NamedTuple):
    """Added mass of a section over rho s^2, rho s^3 and rho s^4, s the distance of the tip."""

    sway: np.ndarray
    cross: np.ndarray
    roll: np.ndarray


def roll_section(count: int, ratio: Any) -> RollSection:
    """Added mass in roll of a circle with equal fins, and in sway where there is one fin.

    Parameters
    ----------
    count : int
        Fins, equally spaced.
    ratio : array_like
        Radius of the circle over the distance of the tips, 0 to 1.

    Returns
    -------
    RollSection
        ``sway`` and ``cross`` (of sway across the fin with roll, positive) of one fin; zero
        coupling and no sway for several. Without a circle ``roll`` is pi/8 for a pair (a plate)
        and 2/pi for four (Blevins 1979, as Prestero 2001 eq. 4.24).
    """
    tau = np.clip(np.asarray(ratio, float), 0.0, 1.0)[..., None]
    phi = 2.0 * np.pi * np.arange(POINTS) / POINTS
    power = 0.5 * count
    hull = tau**power
    g = np.abs(np.cos(power * phi)) * (1.0 + hull**2)  # r^(n/2) + R^n / r^(n/2), lengths over s
    root = np.sqrt(np.maximum(g**2 - 4.0 * hull**2, 0.0))
    radius = np.where(root > 0.0, (0.5 * (g + root)) ** (1.0 / power), tau)
    roll = _coefficients(0.5 * radius**2)
    inner = _energy(roll, roll)
    if count != 1:
        return RollSection(np.zeros_like(inner), np.zeros_like(inner), inner)
    sway = _coefficients(np.where(root > 0.0, radius, 0.5 * g**2 - tau))
    return RollSection(_energy(sway, sway), _energy(sway, roll), inner)


def plate_share(aspect: Any) -> np.ndarray:
    """Added mass of a rectangular plate over that of its strips across the span.

    Parameters
    ----------
    aspect : array_like
        Span over chord; strips across the span are exact for a span that is short.

    Returns
    -------
    ndarray
        0 to 1.
    """
    a = np.maximum(np.asarray(aspect, float), 1e-6)
    sides = np.maximum(a, 1.0 / a)
    far = np.maximum(sides / PLATE_SIDES[-1], 1.0)  # the deficit falls off with the ratio
    mass = 1.0 - (1.0 - np.interp(sides, PLATE_SIDES, PLATE_MASS)) / far
    return mass / np.maximum(a, 1.0)


def _coefficients(values: np.ndarray) -> np.ndarray:
    """Cosine coefficients k = 1, 2, ... of an even function about the circle."""
    found: np.ndarray = 2.0 / POINTS * np.fft.rfft(values, axis=-1)[..., 1:-1].real
    return found


def _energy(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Pi times the sum of k a_k b_k."""
    total: np.ndarray = np.pi * np.sum(np.arange(1, one.shape[-1] + 1) * one * other, axis=-1)
    return total
