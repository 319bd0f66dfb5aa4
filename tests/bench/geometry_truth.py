"""Coefficients of drawn vehicles, taken from the generator's forces in both planes of motion.

The generator (`seatrial.population`) shares nothing with the program but the vehicle file. Slopes
are at the design speed; a quadratic term is what bends the force between one and two times a
tenth of the speed sideways, or 0.3 of U/L in turning, which is how far a trial goes.
"""

import sys
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from tests.engines.chain import SAMPLES

if str(SAMPLES) not in sys.path:
    sys.path.insert(0, str(SAMPLES))

Array = npt.NDArray[np.float64]

SMALL = 1e-4  # of the speed: a slope is a slope there
SIDEWAYS, TURNING = 0.1, 0.3  # of U and of U/L
HELM_RAD = 0.2  # of the drag of a deflected fin
AXES = {"X": 0, "Y": 1, "Z": 2, "M": 4, "N": 5}


class Way(NamedTuple):
    """A plane as the generator's forces have it: velocity, rate, fin, force and moment."""

    velocity: str
    rate: str
    fin: str
    force: str
    moment: str


WAYS = {
    "horizontal": Way("v", "r", "rudder", "Y", "N"),
    "vertical": Way("w", "q", "elevator", "Z", "M"),
}


class Drawn(NamedTuple):
    """A drawn vehicle: the generator's, its scales, and the tables of its vehicle file."""

    vehicle: Any
    size: Any
    stated: dict[str, Any]


def drawn(seeds: Iterable[int], count: int) -> Iterator[Drawn]:
    """The first `count` vehicles that can be built; no drag guessed by an owner among the keys."""
    from seatrial.population.equipment import draw_equipment
    from seatrial.population.form import Refused, draw_form
    from seatrial.population.stated import draw_stated

    for seed in seeds:
        rng = np.random.default_rng(seed)
        try:
            vehicle, size, keys = draw_form(rng)
        except Refused:
            continue
        stated = draw_stated(vehicle, size, keys, draw_equipment(size, rng), rng)
        stated.pop("coefficients", None)
        yield Drawn(vehicle, size, stated)
        count -= 1
        if not count:
            return


def damped(vehicle: Any) -> bool:
    """Whether it has damping beside lift and strips, which no drawing of a vehicle shows."""
    return bool(np.any(np.array(vehicle.plant.damping)))


def forces(body: Any, plant: Any, u: float, **motion: float) -> Array:
    """Hydrodynamic force and moment (6,) of the plant in a state, without thrust."""
    from seatrial.plant import PlantEffects, add_coriolis, add_fins, add_hull

    added = -np.diag(plant.added_mass)
    for place, value in zip(((1, 5), (2, 4), (1, 3), (3, 5)), plant.added_cross, strict=True):
        added[place] = added[place[::-1]] = -value
    nu, tau = np.array([u, *(motion.get(x, 0.0) for x in "vwpqr")]), np.zeros(6)
    add_coriolis(nu, added, tau)
    add_hull(nu, body, PlantEffects(), tau)
    fins = motion.get("rudder", 0.0), motion.get("elevator", 0.0)
    add_fins(nu, *fins, 0.0, body, PlantEffects(), tau)
    return tau


def truth(vehicle: Any, size: Any) -> dict[str, float]:
    """Coefficients of both planes, added masses and thrust."""
    plant = vehicle.plant
    x, y, z, _, m, n = plant.added_mass
    found = {"X_udot": x, "Y_vdot": y, "Z_wdot": z, "M_qdot": m, "N_rdot": n}
    found |= {"Y_rdot": plant.added_cross[0], "Z_qdot": plant.added_cross[1]}
    found["X_uu"] = float(forces(vehicle.body, plant, size.speed)[0] / size.speed**2)
    for way in WAYS.values():
        found |= _plane(vehicle, size, way)
    return found | _thrust(vehicle, size)


def _plane(vehicle: Any, size: Any, way: Way) -> dict[str, float]:
    """Slopes, curvatures and axial forces of one plane."""
    u, found = size.speed, {}

    def at(**motion: float) -> Array:
        return forces(vehicle.body, vehicle.plant, u, **motion)

    def odd(name: str, value: float) -> Array:
        return 0.5 * (at(**{name: value}) - at(**{name: -value}))

    def even(name: str, value: float) -> float:
        return float((0.5 * (at(**{name: value}) + at(**{name: -value})) - at())[0])

    a, b = SIDEWAYS * u, TURNING * u / size.length
    for name, step in ((way.velocity, a), (way.rate, b)):
        slope = odd(name, SMALL * step / SIDEWAYS) / (SMALL * step / SIDEWAYS * u)
        bend = (odd(name, 2.0 * step) - 2.0 * odd(name, step)) / (2.0 * step**2)
        for axis in (way.force, way.moment):
            found[f"{axis}_u{name}"] = float(slope[AXES[axis]])
            found[f"{axis}_{name}|{name}|"] = float(bend[AXES[axis]])
        found[f"X_{name}{name}"] = even(name, 1.5 * step) / (1.5 * step) ** 2
    signs = ((i, j) for i in (1.0, -1.0) for j in (1.0, -1.0))
    both = sum(i * j * at(**{way.velocity: i * a, way.rate: j * b})[0] for i, j in signs)
    found[f"X_{way.velocity}{way.rate}"] = float(both / (4.0 * a * b))
    slope = odd(way.fin, SMALL) / (SMALL * u * u)
    for axis in (way.force, way.moment):
        found[f"{axis}_uud"] = float(slope[AXES[axis]])
    return found


def _thrust(vehicle: Any, size: Any) -> dict[str, float]:
    """The line through the thrust at the design speed."""
    plant, u = vehicle.plant, size.speed
    d, n = vehicle.file["propeller"]["diameter_m"], plant.cruise_rpm / 60.0
    advance, (k0, k1, k2) = (1.0 - plant.wake) * u / (n * d), plant.kt
    load = (1.0 - plant.deduction) * size.density * d**3
    return {
        "T_nn": load * d * (k0 - k2 * advance**2),
        "T_nu": load * (1.0 - plant.wake) * (k1 + 2.0 * k2 * advance),
    }


def roll_truth(vehicle: Any, size: Any) -> dict[str, float]:
    """Roll terms of a drawn vehicle; of the damping what its fins do, the lift in it."""
    plant, body, u = vehicle.plant, vehicle.body, size.speed
    found = {"I_xx": plant.i_xx, "K_pdot": plant.added_mass[3], "z_GW": body.weight * body.z_g}
    found |= {"Y_pdot": plant.added_cross[2], "N_pdot": plant.added_cross[3]}
    p = _slope_of_fins(body, u, 3, u / size.diameter)
    v, r = _slope_of_fins(body, u, 1, u), _slope_of_fins(body, u, 5, u / size.length)
    found |= {"K_up": p[3], "Y_up": p[1], "N_up": p[5], "K_uv": v[3], "K_ur": r[3]}
    return {symbol: float(value) for symbol, value in found.items()}


def _slope_of_fins(body: Any, u: float, axis: int, unit: float) -> Array:
    """Slope over the speed of the force (6,) of the fins with one velocity."""
    from seatrial.plant import PlantEffects, add_fins

    forces_of = []
    for sign in (1.0, -1.0):
        nu, tau = np.zeros(6), np.zeros(6)
        nu[0], nu[axis] = u, sign * SMALL * unit
        add_fins(nu, 0.0, 0.0, 0.0, body, PlantEffects(), tau)
        forces_of.append(tau)
    return (forces_of[0] - forces_of[1]) / (2.0 * SMALL * unit * u)
