"""Estimates of drawn vehicles against what the generator made them of.

The generator (`seatrial.population`) shares nothing with the program but the vehicle file. Its
truth is taken from its forces: slopes at the design speed, and the drag there.
"""

import sys

import numpy as np
import pytest

from auvident.schema.vehicle import Vehicle
from auvident.stages.ase import estimate
from tests.engines.chain import SAMPLES
from tests.session import once

if str(SAMPLES) not in sys.path:
    sys.path.insert(0, str(SAMPLES))

VEHICLES = 40
STRAIGHT = ("X_uu", "T_nn", "T_nu")
MASSES = ("X_udot", "Y_vdot", "N_rdot", "Z_wdot", "M_qdot", "Y_rdot", "Z_qdot")
SLOPES = ("Y_uv", "N_uv", "Y_ur", "N_ur", "Y_uud", "N_uud")


def forces(body, plant, u, v=0.0, r=0.0, rudder=0.0):
    """Hydrodynamic force and moment (6,) of the plant in a state."""
    from seatrial.plant import PlantEffects, add_coriolis, add_fins, add_hull

    added = -np.diag(plant.added_mass)
    for place, value in zip(((1, 5), (2, 4), (1, 3), (3, 5)), plant.added_cross, strict=True):
        added[place] = added[place[::-1]] = -value
    nu, tau = np.array([u, v, 0.0, 0.0, 0.0, r]), np.zeros(6)
    add_coriolis(nu, added, tau)
    add_hull(nu, body, PlantEffects(), tau)
    add_fins(nu, rudder, 0.0, 0.0, body, PlantEffects(), tau)
    return tau


def truth(vehicle, size):
    """Coefficients of a drawn vehicle."""
    body, plant, u, h = vehicle.body, vehicle.plant, size.speed, 1e-4
    x, y, z, _, m, n = plant.added_mass
    found = {"X_udot": x, "Y_vdot": y, "Z_wdot": z, "M_qdot": m, "N_rdot": n}
    found |= {"Y_rdot": plant.added_cross[0], "Z_qdot": plant.added_cross[1]}
    found["X_uu"] = forces(body, plant, u)[0] / u**2
    for name, unit, divisor in (("v", u, u), ("r", u / size.length, u), ("rudder", 1.0, u * u)):
        step = h * unit
        slope = forces(body, plant, u, **{name: step}) - forces(body, plant, u, **{name: -step})
        slope /= 2.0 * step * divisor
        symbol = {"v": "uv", "r": "ur", "rudder": "uud"}[name]
        found |= {f"Y_{symbol}": slope[1], f"N_{symbol}": slope[5]}
    d, n = vehicle.file["propeller"]["diameter_m"], plant.cruise_rpm / 60.0
    advance, (k0, k1, k2) = (1.0 - plant.wake) * u / (n * d), plant.kt
    load = (1.0 - plant.deduction) * size.density * d**3
    found["T_nn"] = load * d * (k0 - k2 * advance**2)
    found["T_nu"] = load * (1.0 - plant.wake) * (k1 + 2.0 * k2 * advance)
    return found


@once
def errors():
    """Errors over their standard deviations: (VEHICLES,) by symbol."""
    from seatrial.population.equipment import draw_equipment
    from seatrial.population.form import Refused, draw_form
    from seatrial.population.stated import draw_stated

    rng, rows = np.random.default_rng(0), []
    while len(rows) < VEHICLES:
        try:
            vehicle, size, keys = draw_form(rng)
        except Refused:
            continue
        stated = draw_stated(vehicle, size, keys, draw_equipment(size, rng), rng)
        stated.pop("coefficients", None)  # of half of them the owner has guessed a drag
        found = estimate(Vehicle.model_validate(stated)).by_symbol()
        true = truth(vehicle, size)
        rows.append({s: (true[s] - found[s].value) / found[s].std for s in true})
    return {symbol: np.array([row[symbol] for row in rows]) for symbol in rows[0]}


def test_drag_is_neither_that_of_the_bare_hull_nor_uncertain_beyond_reason():
    z = errors()["X_uu"]
    assert abs(z.mean()) < 0.75
    assert 0.7 < np.mean(z**2) < 1.5


@pytest.mark.parametrize("symbol", [*STRAIGHT, *MASSES, *SLOPES])
def test_no_deviation_is_far_too_narrow(symbol):
    assert np.sqrt(np.mean(errors()[symbol] ** 2)) < 1.5
