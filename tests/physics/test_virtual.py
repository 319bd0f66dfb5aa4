"""Runs of a model with a helm of its own: where they begin."""

import numpy as np
import pytest

from auvident.physics.ase.stability import speed_per_rate_m
from auvident.physics.terms import LINEAR_DRAG, structure_of
from auvident.physics.virtual import steady_approach
from auvident.schema.planes import PLANES
from auvident.stages.ase import estimate
from auvident.stages.desk import estimated_models
from auvident.stages.identify.setup import rigid_body
from auvident.storage.vehicle_file import load_vehicle
from tests.command_line import SAMPLES
from tests.physics.desk_models import remus


@pytest.mark.parametrize("rpm", [100.0, 300.0, 1000.0])
def test_a_heavy_ship_approaches_at_the_speed_of_its_balance(rpm: float) -> None:
    """A minute from 1 m/s on took the tanker to 0.78 m/s at 300 rpm; it keeps 0.58."""
    vehicle = load_vehicle(SAMPLES / "kvlcc2/vehicle.toml")
    rigid, rng = rigid_body(vehicle, "horizontal"), np.random.default_rng(0)
    ship = estimated_models(estimate(vehicle), rigid, "horizontal", "ship", 0, rng)
    found = steady_approach(ship.structure, ship.vectors[0], rpm / 60.0)
    assert found[0] == pytest.approx(speed_per_rate_m(ship.of_first()) * rpm / 60.0, rel=1e-9)
    assert not found[1:].any()


@pytest.mark.parametrize("plane", PLANES)
def test_a_speed_in_balance_counts_linear_drag(plane) -> None:
    own, n = remus(plane).of_first(), 10.0
    structure, linear = structure_of(plane, ("linear_drag",)), -2.0
    values = {**own, LINEAR_DRAG: linear}
    p = np.array([values[name] for name in structure.parameters])
    u = steady_approach(structure, p, n)[0]
    thrust = own["T_nn"] * n**2 + own["T_nu"] * n * u
    assert own["X_uu"] * u**2 + linear * u + thrust == pytest.approx(0.0, abs=1e-9 * thrust)


def test_without_a_balance_there_is_no_approach() -> None:
    models = remus("horizontal")
    p = models.vectors[0].copy()
    p[models.structure.index("T_nn")] = -0.1
    assert np.isnan(steady_approach(models.structure, p, 10.0)[0])
