"""Invariants and plausibility of the six-degree-of-freedom plant."""

import numpy as np
import pytest
from seatrial.plant import PlantEffects, add_coriolis, rk4_step, workspace
from seatrial.vehicles import PLANTS, load_vehicle

VEHICLES = sorted(PLANTS)
DT = 0.01


def undamped(body):
    """The same body with every force off except inertia: no fins, drag, propeller, weight."""
    return body._replace(
        fins=body.fins[:0],
        kt=np.zeros(3),
        kq=np.zeros(3),
        weight=0.0,
        buoyancy=0.0,
        drag_form=0.0,
        friction_factor=0.0,
        hull_lift=0.0,
        hull_induced=0.0,
        cross_flow=0.0,
        roll_linear=0.0,
        roll_quadratic=0.0,
    )


def sail_for(body, seconds, rudder, state, elevator=0.0, revs=14.0):
    """States of every step with fins and propeller held."""
    work, outer = workspace(), np.zeros(6)
    history = np.empty((int(seconds / DT), state.size))
    for k in range(history.shape[0]):
        rk4_step(state, DT, rudder, elevator, revs, 1.0, outer, body, PlantEffects(), work)
        history[k] = state
    return history


def moving(u=1.4, depth=8.0):
    state = np.zeros(15)
    state[0], state[8] = u, depth
    return state


@pytest.mark.parametrize("name", VEHICLES)
def test_mass_matrix_is_symmetric_and_positive(name):
    mass = load_vehicle(name).body.mass
    assert np.array_equal(mass, mass.T)
    assert np.linalg.eigvalsh(mass).min() > 0


@pytest.mark.parametrize("name", VEHICLES)
def test_coriolis_does_no_work(name):
    body, rng = load_vehicle(name).body, np.random.default_rng(1)
    for _ in range(50):
        nu, tau = rng.normal(size=6), np.zeros(6)
        add_coriolis(nu, body.mass, tau)
        # round-off of sums of terms of the size of |mass| |nu|^3
        assert abs(nu @ tau) < 1e-13 * np.abs(body.mass).max() * np.sum(nu**2) ** 1.5


@pytest.mark.parametrize("name", VEHICLES)
def test_energy_is_kept_without_forces_and_damping(name):
    body = undamped(load_vehicle(name).body)
    state = moving()
    state[1:6] = 0.2, -0.1, 0.3, 0.1, -0.2
    before = 0.5 * state[:6] @ body.mass @ state[:6]
    nu = sail_for(body, 20.0, 0.0, state)[:, :6]
    energy = 0.5 * np.einsum("ti,ij,tj->t", nu, body.mass, nu)
    # the fourth-order step loses or gains about 1e-9 over 2000 steps at these rates
    assert np.abs(energy / before - 1).max() < 1e-6


@pytest.mark.parametrize("name", VEHICLES)
def test_damping_takes_energy_with_the_propeller_off(name):
    body = load_vehicle(name).body._replace(
        kt=np.zeros(3), kq=np.zeros(3), weight=0.0, buoyancy=0.0
    )
    state = moving()
    state[1:6] = 0.2, -0.1, 0.3, 0.1, -0.2
    nu = sail_for(body, 20.0, 0.0, state)[:, :6]
    energy = 0.5 * np.einsum("ti,ij,tj->t", nu, body.mass, nu)
    assert np.all(np.diff(energy) <= 0)


def test_port_and_starboard_mirror_without_sail_and_torque():
    body = load_vehicle("remus100").body._replace(kq=np.zeros(3))
    port = sail_for(body, 30.0, 0.2, moving())
    starboard = sail_for(body, 30.0, -0.2, moving())
    mirror = np.ones(15)
    mirror[[1, 3, 5, 7, 9, 11, 12, 13, 14]] = -1
    assert np.abs(port - mirror * starboard).max() < 1e-9  # round-off only


def test_sail_and_torque_break_the_mirror():
    for name in VEHICLES:
        body = load_vehicle(name).body
        port = sail_for(body, 30.0, 0.2, moving())[-1]
        starboard = sail_for(body, 30.0, -0.2, moving())[-1]
        assert abs(port[9] + starboard[9]) > np.radians(1.0)


@pytest.mark.parametrize("name", VEHICLES)
def test_steady_speed_and_turn(name):
    vehicle = load_vehicle(name)
    revs = vehicle.plant.cruise_rpm / 60
    body = vehicle.body._replace(buoyancy=vehicle.body.weight)
    straight = sail_for(body, 60.0, 0.0, moving(), revs=revs)[-1]
    assert 1.3 < straight[0] < 1.6
    turn = sail_for(body, 60.0, -np.radians(15), moving(), revs=revs)
    end = turn[-1]
    assert 8 < np.degrees(end[5]) < 20  # negative rudder turns to starboard
    assert 2 < np.degrees(np.arctan2(-end[1], end[0])) < 15  # drifts outward
    assert 0.7 < end[0] / straight[0] < 0.98
    assert np.abs(np.degrees(turn[:, 9])).max() < 10
    steady = turn[-1000:, 5]
    assert np.ptp(steady) < 0.01 * steady.mean()  # no oscillation, no drift
    assert 2 < end[0] / end[5] / body.length < 8  # turning radius in lengths


@pytest.mark.parametrize("name", VEHICLES)
def test_elevator_down_puts_the_bow_down(name):
    body = load_vehicle(name).body
    end = sail_for(body, 3.0, 0.0, moving(), elevator=0.1)[-1]
    assert end[10] < -0.02


def test_spread_draws_another_vehicle_each_seed():
    bodies = [load_vehicle("tern180", 0.2, np.random.default_rng(s)) for s in (1, 1, 2)]
    drag = [b.plant.hull_lift for b in bodies]
    assert drag[0] == drag[1] != drag[2]
    assert bodies[0].file == bodies[2].file
