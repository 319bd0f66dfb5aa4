"""Models side by side: the same equations, steps and servo as one alone."""

import numpy as np
import pytest

from auvident.physics.actuation import COMMAND, acting_inputs
from auvident.physics.batch import inverse_mass
from auvident.physics.dynamics import N_STATES, step
from auvident.physics.fleet import Fleet, Servos, possible
from auvident.physics.virtual import healthy
from auvident.schema.planes import PLANES, Plane
from tests.physics.desk_models import remus

ALL = np.ones(N_STATES, dtype=bool)
N = 7


def one_step(fleet: Fleet, s: int, x: np.ndarray, fin: float, revs: float, dt: float) -> np.ndarray:
    """Model s alone, by the step that everything else is made of."""
    structure, p = fleet.structure, fleet.vectors[s]
    inverse, out = np.empty((3, 3)), np.empty(N_STATES)
    inverse_mass(p, structure.mass, structure.mass_weights, ALL, inverse)
    inputs = healthy(np.array([fin, 0.0, revs]))
    step(x, inputs, x, x, dt, p, inverse, ALL, structure.equations, out)
    return out


@pytest.mark.parametrize("plane", PLANES)
def test_models_side_by_side_move_as_each_does_alone(plane: Plane) -> None:
    models = remus(plane, N - 1)
    fleet, rng = Fleet(models.structure, models.vectors), np.random.default_rng(3)
    states = rng.normal(0.0, 0.3, (N_STATES, N))
    states[0] += 1.5
    fin, revs = rng.normal(0.0, 0.2, N), rng.uniform(10.0, 20.0, N)
    expected = [one_step(fleet, s, states[:, s].copy(), fin[s], revs[s], 0.05) for s in range(N)]
    fleet.step(states, fin, revs, 0.05)
    np.testing.assert_allclose(states, np.array(expected).T, rtol=1e-12, atol=1e-14)


def test_rates_are_the_slope_of_a_short_step() -> None:
    models = remus("vertical", N - 1)
    fleet, rng = Fleet(models.structure, models.vectors), np.random.default_rng(4)
    states = rng.normal(0.0, 0.3, (N_STATES, N)) + np.array([[1.5], [0.0], [0.0], [0.0]])
    angle, revs, dt = rng.normal(0.0, 0.2, N), np.full(N, 15.0), 1.0e-6
    rates, moved = fleet.rates(states, angle, revs), states.copy()
    fleet.step(moved, angle, revs, dt)
    np.testing.assert_allclose((moved - states) / dt, rates, rtol=1e-4, atol=1e-4)  # O(dt) rates


def test_a_held_speed_stays() -> None:
    models = remus("horizontal")
    fleet = Fleet(models.structure, models.vectors, held_speed_mps=1.5)
    states = np.array([[1.5], [0.1], [0.2], [0.0]])
    fleet.step(states, np.array([0.1]), np.zeros(1), 0.05)
    assert states[0, 0] == 1.5
    assert states[2, 0] != 0.2


def test_a_mass_matrix_that_is_not_positive_is_found() -> None:
    models = remus("horizontal", 2)
    vectors = models.vectors.copy()
    vectors[1, models.structure.index("Y_vdot")] = 1.0e3
    assert possible(models.structure, vectors).tolist() == [True, False, True]


def test_the_servo_is_that_of_the_logged_inputs() -> None:
    """Dead band, play, gain, lag and limit step by step, a delay of 3.4 steps before."""
    models, dt = remus("horizontal", 1), 0.05
    fleet = Fleet(models.structure, models.vectors)
    values = {
        "rudder_delay.delay_s": 3.4 * dt,
        "rudder_deadband.deadband_deg": 0.01,
        "rudder_backlash.half_width_deg": 0.02,
        "rudder_asymmetry.gain": 0.1,
        "rudder_lag.lag_s": 0.2,
        "rudder_rate_limit.rate_degps": 2.0,
    }
    e = np.array([values.get(name, 0.0) for name in COMMAND])
    fleet.command[1] = e
    orders = 0.3 * np.sign(np.sin(0.15 * np.arange(200)))
    orders[:10] = 0.0  # the servos begin amidships
    servos = Servos(fleet, np.zeros(2), dt)
    followed = np.array([servos.follow(np.full(2, order)) for order in orders])
    raw, zero = np.column_stack([orders, 0.0 * orders, 0.0 * orders]), np.zeros(200)
    expected = acting_inputs(raw, zero, zero, zero, zero, dt, e)[:, 0]
    np.testing.assert_allclose(followed[:, 1], expected, atol=1e-14)
    np.testing.assert_allclose(followed[:, 0], orders, atol=1e-14)  # a model without a servo


def test_a_stated_rate_limits_every_fin() -> None:
    models = remus("horizontal", 1)
    fleet = Fleet(models.structure, models.vectors, rate_limit_radps=0.5)
    servos = Servos(fleet, np.zeros(2), 0.05)
    for _ in range(4):
        servos.follow(np.full(2, 1.0))
    np.testing.assert_allclose(servos.angle, 4 * 0.05 * 0.5)
