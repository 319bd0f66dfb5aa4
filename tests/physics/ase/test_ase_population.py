"""Estimates of drawn vehicles against what the generator made them of.

The generator (`seatrial.population`) shares nothing with the program but the vehicle file. Its
truth is taken from its forces: slopes at the design speed, and the drag there.
"""

import numpy as np
import pytest

from auvident.schema.vehicle import Vehicle
from auvident.stages.ase import estimate
from tests.bench.geometry_truth import truth
from tests.session import once

VEHICLES = 40
STRAIGHT = ("X_uu", "T_nn", "T_nu")
MASSES = ("X_udot", "Y_vdot", "N_rdot", "Z_wdot", "M_qdot", "Y_rdot", "Z_qdot")
SLOPES = ("Y_uv", "N_uv", "Y_ur", "N_ur", "Y_uud", "N_uud")


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
