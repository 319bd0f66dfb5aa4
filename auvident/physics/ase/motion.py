"""Many models of one vehicle run side by side: a turning circle and a zigzag of each.

The terms are those of `auvident.physics.terms`, gone through with arrays over the models: for a
few hundred models and steps that is faster than to load compiled kernels.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from auvident.physics.terms import (
    CONSTANTS,
    POWER_OF,
    POWERS,
    VARIABLES,
    mass_matrices,
    structure_of,
)
from auvident.schema.planes import Plane
from auvident.schema.vehicle import Body

Array = npt.NDArray[np.float64]

CIRCLE_DEG = 15.0  # rudder of the turning circle: the middle of the table of steady turns
ZIGZAG_DEG = 10.0  # rudder and heading of the zigzag 10/10 (IMO MSC.137(76))
OVERSHOOTS = 2
STEP = 0.1  # of L/U
LONGEST = 60.0  # L/U: to turn by 180 degrees at 15 degrees of rudder takes 5 to 30
# Rate of a fin that nothing tells of: that of a small vehicle's servo, or 93 deg in the time L/U
# where that is slower: 65 deg in 28 s (SOLAS II-1/29) with the L/U of 40 s of a tanker
USUAL_RATE_DEGPS, USUAL_RATE_DEG = 25.0, 93.0


def rigid_constants(body: Body, plane: Plane = "horizontal") -> dict[str, float]:
    """Mass, its moment and inertia in the equations of a plane; the other constants are zero."""
    moment, inertia = body.mass_kg * body.x_g_m, body.inertia_kgm2(plane)
    known = {"m": body.mass_kg, "m x_G": moment, "I": inertia}
    return {name: known.get(name, 0.0) for name in CONSTANTS}


class Models:
    """The equations of the horizontal plane of n models.

    Parameters
    ----------
    drawn : mapping of str to (n,) array
        Coefficients by symbol.
    body : Body
    rate_rps : float
        Propeller rate, held; with 0 the speed is held instead.
    """

    def __init__(self, drawn: Mapping[str, Array], body: Body, rate_rps: float) -> None:
        structure = structure_of("horizontal")
        n = len(next(iter(drawn.values())))
        constants = {c: np.full(n, value) for c, value in rigid_constants(body).items()}
        p = np.array([{**constants, **drawn}[name] for name in structure.parameters])
        mass = mass_matrices(structure, p)
        self.possible = np.linalg.eigvalsh(mass).min(axis=-1) > 0.0
        mass[~self.possible] = np.eye(3)
        self.inverse = np.linalg.inv(mass)
        self.terms = [
            (row[0], weight * p[row[1]], _factors(row))
            for row, weight in zip(structure.terms.tolist(), structure.weights, strict=True)
        ]
        self.rate_rps = rate_rps

    def rates(self, states: Array, rudder: Array) -> Array:
        """Rates (4, n) of u, v, r and heading."""
        known = {"u": states[0], "a": states[1], "b": states[2], "d": rudder}
        known |= {"e": np.zeros(()), "n": np.asarray(self.rate_rps)}
        powers: dict[tuple[int, int], Array] = {}
        force = np.zeros((len(rudder), 3))
        for equation, weight, factors in self.terms:
            product = weight
            for pair in factors:
                if pair not in powers:
                    powers[pair] = POWER_OF[POWERS[pair[1]]](known[VARIABLES[pair[0]]])
                product = product * powers[pair]
            force[:, equation] += product
        moved = np.einsum("nij,nj->in", self.inverse, force)
        if self.rate_rps == 0.0:
            moved[0] = 0.0
        return np.vstack([moved, states[2]])

    def step(self, states: Array, rudder: Array, dt_s: float) -> Array:
        """States (4, n) one step later, by the midpoint rule."""
        half = states + 0.5 * dt_s * self.rates(states, rudder)
        return states + dt_s * self.rates(half, rudder)


def _factors(row: list[int]) -> list[tuple[int, int]]:
    """Variable and power of each factor in a row of the terms."""
    return [(v, power) for v, power in zip(row[2::2], row[3::2], strict=True) if power >= 0]


@dataclass
class _Circle:
    """Way across the first course, and how far that is after 180 degrees."""

    across: Array
    diameter: Array

    def see(self, before: Array, after: Array, dt_s: float) -> None:
        """Go on by a step."""
        speed = [s[0] * np.sin(s[3]) + s[1] * np.cos(s[3]) for s in (before, after)]
        gone = 0.5 * dt_s * (speed[0] + speed[1])
        turned, now = np.abs(before[3]), np.abs(after[3])
        reached = (turned < np.pi) & (now >= np.pi)
        share = (np.pi - turned) / np.where(reached, now - turned, 1.0)
        self.diameter[reached] = np.abs(self.across + share * gone)[reached]
        self.across = self.across + gone


@dataclass
class _Zigzag:
    """Order to the rudder of a zigzag, and the overshoot after each of its reversals."""

    rudder: Array
    overshoots: Array
    count: Array = field(init=False)
    begin: Array = field(init=False)
    peak: Array = field(init=False)

    def __post_init__(self) -> None:
        self.count = np.zeros(len(self.rudder), dtype=int)
        self.begin, self.peak = np.zeros(len(self.rudder)), np.zeros(len(self.rudder))

    def see(self, heading: Array) -> None:
        """Reverse the rudder where the heading has come to its angle on the other side."""
        size = np.abs(heading)
        back = (self.rudder * heading < 0.0) & (size >= np.radians(ZIGZAG_DEG))
        for k in range(OVERSHOOTS):
            done = back & (self.count == k + 1)
            self.overshoots[k, done] = np.degrees(self.peak - self.begin)[done]
        self.count, self.rudder = self.count + back, np.where(back, -self.rudder, self.rudder)
        self.begin = np.where(back, size, self.begin)
        # the same side as the heading at the reversal: against the rudder's own turn
        same = self.rudder * heading > 0.0
        self.peak = np.where(back, size, np.where(same, np.maximum(self.peak, size), self.peak))


def usual_rate_degps(speed_mps: float, length_m: float) -> float:
    """How fast a fin turns, where nothing tells."""
    return min(USUAL_RATE_DEGPS, USUAL_RATE_DEG * speed_mps / length_m)


def maneuver_figures(
    drawn: Mapping[str, Array],
    body: Body,
    length_m: float,
    speed: Array,
    rate_rps: float,
    *,
    fin_radps: float,
) -> dict[str, Array]:
    """Figures of a turning circle and of a zigzag.

    Parameters
    ----------
    drawn : mapping of str to (n,) array
        Coefficients of the horizontal plane by symbol.
    body : Body
    length_m : float
    speed : (n,) array
        Approach, m/s.
    rate_rps : float
        Propeller rate, held; with 0 the speed is held instead.
    fin_radps : float
        How fast the rudder turns.

    Returns
    -------
    dict of str to (n,) array
        ``tactical_diameter_m`` (IMO MSC.137(76)) at `CIRCLE_DEG`, ``overshoot_1_deg`` and so on of
        the zigzag; NaN where the maneuver does not come to it.
    """
    n = len(speed)
    models = Models({s: np.tile(x, 2) for s, x in drawn.items()}, body, rate_rps)
    circle = _Circle(np.zeros(n), np.full(n, np.nan))
    zigzag = _Zigzag(np.full(n, np.radians(ZIGZAG_DEG)), np.full((OVERSHOOTS, n), np.nan))
    states, dt = np.zeros((4, 2 * n)), STEP * length_m / float(np.nanmedian(speed))
    laid, most = np.zeros(2 * n), fin_radps * dt
    states[0] = np.where(models.possible, np.tile(speed, 2), np.nan)
    with np.errstate(invalid="ignore", over="ignore"):
        for _ in range(round(LONGEST / STEP)):
            zigzag.see(states[3, n:])
            order = np.concatenate([np.full(n, np.radians(CIRCLE_DEG)), zigzag.rudder])
            turned = np.clip(order - laid, -most, most)
            mean = laid + turned * (1.0 - 0.5 * np.abs(turned) / most)  # over the step
            after, laid = models.step(states, mean, dt), laid + turned
            circle.see(states[:, :n], after[:, :n], dt)
            states = after
            if np.all(
                np.isnan(states[3]) | np.isfinite([*circle.diameter, *zigzag.overshoots[-1]])
            ):
                break
    figures = {f"overshoot_{k + 1}_deg": row for k, row in enumerate(zigzag.overshoots)}
    return {"tactical_diameter_m": circle.diameter, **figures}
