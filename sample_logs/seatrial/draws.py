"""How the parameters of planted effects are drawn."""

from __future__ import annotations

import math

import numpy as np


def side(rng: np.random.Generator, low: float, high: float) -> float:
    """Size between `low` and `high`, either sign."""
    return float(rng.uniform(low, high) * rng.choice([-1.0, 1.0]))


def polar(rng: np.random.Generator, low: float, high: float) -> tuple[float, float]:
    """North and east parts of a vector of that length in any direction."""
    size, angle = rng.uniform(low, high), rng.uniform(-math.pi, math.pi)
    return float(size * math.cos(angle)), float(size * math.sin(angle))


def one(name: str, low: float, high: float, signed: bool = False):
    """Drawer of a single parameter."""

    def draw(rng, scale, revs):
        return {name: side(rng, low, high) if signed else float(rng.uniform(low, high))}

    return draw


def pair(first: str, a: tuple, second: str, b: tuple):
    """Drawer of a side force and a yaw moment of either sign, scaled with the vehicle."""

    def draw(rng, scale, revs):
        return {first: side(rng, *a) * scale, second: side(rng, *b) * scale**1.5}

    return draw
