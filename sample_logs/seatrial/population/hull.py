"""Hulls of revolution of the families that a vehicle file knows, drawn with their proportions.

Sources: Myring 1976; Groves, Huang & Chang 1989 (DARPA SUBOFF, DTRC/SHD-1298-01).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

POINTS = 401
FAMILIES = ("myring", "ellipsoid", "suboff", "offsets")
LONGEST_ENDS = 0.85  # nose and tail together, of the length


@dataclass(frozen=True)
class DrawnHull:
    """A hull: what the vehicle file says of it, and the offsets that the plant has."""

    keys: dict
    station: np.ndarray  # from the nose [m]
    radius: np.ndarray  # [m]

    @property
    def volume(self) -> float:
        """Displaced volume [m^3]."""
        return float(np.trapezoid(np.pi * self.radius**2, self.station))

    @property
    def centre(self) -> float:
        """Centre of volume from the nose [m]."""
        moment = np.trapezoid(np.pi * self.radius**2 * self.station, self.station)
        return float(moment / self.volume)

    @property
    def gyration(self) -> float:
        """Radius of gyration about a crosswise axis through the centre, filled evenly [m]."""
        squares = (self.station - self.centre) ** 2 + self.radius**2 / 4
        second = np.trapezoid(np.pi * self.radius**2 * squares, self.station)
        return float(np.sqrt(second / self.volume))


def draw_hull(length: float, diameter: float, rng: np.random.Generator) -> DrawnHull:
    """A hull of that length and diameter, of any family."""
    family = str(rng.choice(FAMILIES))
    nose, tail = rng.uniform(0.6, 1.6) * diameter, rng.uniform(1.5, 3.2) * diameter
    shrink = min(1.0, LONGEST_ENDS * length / (nose + tail))
    keys = {
        "length_m": length,
        "diameter_m": diameter,
        "nose_length_m": float(nose * shrink),
        "tail_length_m": float(tail * shrink),
    }
    station = np.linspace(0.0, length, POINTS)
    if family == "suboff":
        keys = {"shape": "suboff", "length_m": length, "diameter_m": diameter}
        return DrawnHull(keys, station, 0.5 * diameter * suboff(station / length))
    keys["tail_base_diameter_m"] = float(rng.uniform(0.0, 0.3) * diameter)
    if family == "ellipsoid":
        keys |= {"shape": "ellipsoid"}
        keys["tail_shape"] = str(rng.choice(["cone", "parabola", "ellipsoid"]))
        return DrawnHull(keys, station, sections(station, keys, 2.0, keys["tail_shape"]))
    power, theta = float(rng.uniform(1.4, 3.0)), _tail_angle(keys, rng)
    keys |= {"shape": "myring", "myring_n": power, "myring_theta_deg": theta}
    radius = sections(station, keys, power, "myring")
    if family == "offsets":
        keys = {"length_m": length, "diameter_m": diameter} | table_of(station, radius)
    return DrawnHull(keys, station, radius)


def _tail_angle(keys: dict, rng: np.random.Generator) -> float:
    """End angle of a Myring tail [deg] that neither bulges nor waists."""
    drop = 0.5 * (keys["diameter_m"] - keys["tail_base_diameter_m"])
    fullest = np.degrees(np.arctan2(3.0 * drop, keys["tail_length_m"]))
    return float(rng.uniform(0.3, 0.85) * fullest)


def sections(station: np.ndarray, keys: dict, power: float, tail: str) -> np.ndarray:
    """Radii [m] of a superelliptic nose, a cylinder and a tail."""
    half, a, c = keys["diameter_m"] / 2, keys["nose_length_m"], keys["tail_length_m"]
    drop = half - keys["tail_base_diameter_m"] / 2
    bow = half * np.clip(1 - ((station - a) / a) ** 2, 0, 1) ** (1 / power)
    s = np.clip((station - (station[-1] - c)) / c, 0.0, 1.0)
    if tail == "myring":
        slope = c * np.tan(np.radians(keys["myring_theta_deg"]))
        stern = half - (3 * drop - slope) * s**2 + (2 * drop - slope) * s**3
    else:
        lost = {"cone": s, "parabola": s**2, "ellipsoid": 1 - np.sqrt(1 - s**2)}[tail]
        stern = half - drop * lost
    return np.where(station < a, bow, np.maximum(stern, 0.0))


def suboff(share: np.ndarray) -> np.ndarray:
    """Radius of the SUBOFF hull over its largest, at shares of the length (Groves et al. 1989)."""
    x = share * 14.291667  # feet, as in the source
    bow = np.clip(x, 0.0, 3.333333)
    t = 0.3 * bow - 1.0
    nose = 1.126395101 * bow * t**4 + 0.442874707 * bow**2 * t**3 + 1.0 - t**4 * (1.2 * bow + 1.0)
    s, end, k0, k1 = np.clip((13.979167 - x) / 3.333333, 0.0, 1.0), 0.1175, 10.0, 44.6244
    powers = (
        end**2,
        0.0,
        end * k0,
        20 - 20 * end**2 - 4 * end * k0 - k1 / 3,
        -45 + 45 * end**2 + 6 * end * k0 + k1,
        36 - 36 * end**2 - 4 * end * k0 - k1,
        -10 + 10 * end**2 + end * k0 + k1 / 3,
    )
    stern = np.sqrt(np.polynomial.polynomial.polyval(s, powers))
    cap = end * np.sqrt(np.clip(1 - ((x - 13.979167) / 0.3125) ** 2, 0, 1))
    radius = np.where(x < 3.333333, np.clip(nose, 0, None) ** (1 / 2.1), 1.0)
    return np.where(x > 13.979167, cap, np.where(x > 10.645833, stern, radius))


def table_of(station: np.ndarray, radius: np.ndarray, points: int = 61) -> dict:
    """Offsets as a vehicle file has them, closer together at the ends."""
    share = 0.5 * (1 - np.cos(np.linspace(0.0, np.pi, points)))
    x = share * station[-1]
    return {
        "offsets_x_from_nose_m": [round(float(v), 4) for v in x],
        "offsets_radius_m": [round(float(v), 5) for v in np.interp(x, station, radius)],
    }
