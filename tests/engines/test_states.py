"""Smoothed states of a maneuver: on a known motion, and beside the readings of the sample."""

import numpy as np
import pytest

from auvident.engines.records import Record
from auvident.engines.states import forcing_std, smoothed_states
from auvident.physics.dynamics import simulate_states
from auvident.physics.terms import parameter_vector, structure_of
from auvident.schema.artifacts import RigidBody

ACTIVE = np.array([True, True, True, False])
NOISE = np.array([0.005, 0.005, 0.001, 0.005])
COEFFICIENTS = {
    "X_udot": -1.0,
    "X_uu": -3.0,
    "T_nn": 0.1,
    "T_nu": -0.8,
    "Y_vdot": -35.0,
    "N_rdot": -5.0,
    "Y_uv": -50.0,
    "Y_ur": 10.0,
    "Y_uud": 10.0,
    "N_uv": 2.0,
    "N_ur": -10.0,
    "N_uud": -6.0,
}


def made(seed: int):
    """A zigzag-like motion of a known vehicle, its noisy readings with every other one missing."""
    body = RigidBody(
        mass_kg=30.0, x_g_m=0.0, z_g_m=0.0, inertia_kgm2=3.5, weight_n=294.0, buoyancy_n=294.0
    )
    structure, rng = structure_of("horizontal"), np.random.default_rng(seed)
    p = parameter_vector("horizontal", COEFFICIENTS, body)
    n = 400
    inputs = np.zeros((n, 3))
    inputs[:, 0] = 0.2 * np.sign(np.sin(np.arange(n) / 30.0))
    inputs[:, 2] = 15.0
    start = np.array([1.4, 0.0, 0.0, 0.0])
    truth = simulate_states(start, inputs, np.zeros((n, 4)), 0.1, p, ACTIVE, structure.equations)
    measured = truth + rng.normal(size=(n, 4)) * NOISE
    measured[1::2, :2] = np.nan
    record = Record("m", np.arange(n) * 0.1, inputs, np.zeros((n, 4)), measured, start)
    return structure, p, record, truth


def test_smoothed_states_are_nearer_to_the_truth_than_the_readings() -> None:
    structure, p, record, truth = made(1)
    found = smoothed_states(structure, p, record, ACTIVE, np.eye(4), NOISE, 0.1)
    error = np.sqrt(np.mean((found.mean - truth)[:, :3] ** 2, axis=0))
    assert (error < 0.5 * NOISE[:3]).all()  # 200 to 400 readings of a motion that is known


def test_the_error_of_smoothed_states_is_of_the_stated_size() -> None:
    """Mean squared error over variance, over seeds; correlated in time, hence a wide band."""
    ratios = []
    for seed in range(12):
        structure, p, record, truth = made(seed)
        found = smoothed_states(structure, p, record, ACTIVE, np.eye(4), NOISE, 0.1)
        ratios.append(np.mean(((found.mean - truth)[:, :3] / found.std[:, :3]) ** 2))
    assert 0.2 < np.mean(ratios) < 2.0  # the forcing is bounded from below: cautious


def driven(seed: int, forcing: np.ndarray):
    """The same motion, pushed at every step by white noise (3,) per root second."""
    structure, p, record, _ = made(seed)
    n, rng = 4000, np.random.default_rng(100 + seed)
    inputs, held = np.resize(record.inputs[:188], (n, 3)), np.zeros((2, 4))  # a whole period
    truth = np.tile(record.start, (n, 1))
    for k in range(1, n):
        own = held, 0.1, p, ACTIVE, structure.equations
        truth[k] = simulate_states(truth[k - 1], inputs[k - 1 : k + 1], *own)[1]
        truth[k, :3] += forcing * np.sqrt(0.1) * rng.normal(size=3)
    measured = truth + rng.normal(size=(n, 4)) * NOISE
    time = np.arange(n) * 0.1
    return structure, p, Record("m", time, inputs, np.zeros((n, 4)), measured, record.start), truth


@pytest.mark.parametrize("share", [0.05, 0.2, 1.0])  # motions of 0.2 to 4 times the sensor noise
def test_the_process_noise_is_that_which_drives_the_motion(share: float) -> None:
    """Of white noise in the accelerations; the errors of the states are then of their size."""
    forcing, found, ratios = share * np.array([0.03, 0.03, 0.012]), [], []
    for seed in range(4):
        structure, p, record, truth = driven(seed, forcing)
        own = structure, p, record, ACTIVE, np.eye(4), NOISE, 0.1
        found.append(forcing_std(*own)[:3])
        states = smoothed_states(*own)
        ratios.append(np.mean(((states.mean - truth)[:, :3] / states.std[:, :3]) ** 2))
    np.testing.assert_allclose(np.mean(found, axis=0), forcing, rtol=0.15)  # 400 s each
    assert 0.9 < np.mean(ratios) < 1.1


def test_the_pitch_is_smoothed_with_the_vertical_motion() -> None:
    body = RigidBody(
        mass_kg=30.0, x_g_m=0.0, z_g_m=0.02, inertia_kgm2=3.5, weight_n=294.0, buoyancy_n=294.0
    )
    values = {"Z_wdot": -35.0, "M_qdot": -5.0, "Z_uw": -50.0, "M_uq": -10.0, "M_uud": -6.0}
    values |= {"X_udot": -1.0, "X_uu": -3.0, "T_nn": 0.1, "T_nu": -0.8}
    structure, p = structure_of("vertical"), parameter_vector("vertical", values, body)
    active, n, rng = np.ones(4, dtype=bool), 400, np.random.default_rng(3)
    inputs = np.zeros((n, 3))
    inputs[:, 0], inputs[:, 2] = 0.1 * np.sign(np.sin(np.arange(n) / 30.0)), 15.0
    start, given = np.array([1.4, 0.0, 0.0, 0.05]), np.zeros((n, 4))
    truth = simulate_states(start, inputs, given, 0.1, p, active, structure.equations)
    assert np.ptp(truth[:, 3]) > 0.2
    measured = truth + rng.normal(size=(n, 4)) * NOISE
    record = Record("m", np.arange(n) * 0.1, inputs, given, measured, start)
    found = smoothed_states(structure, p, record, active, np.eye(4), NOISE, 0.1)
    error = np.sqrt(np.mean((found.mean - truth) ** 2, axis=0))
    assert (error < 0.5 * NOISE).all()
    assert (found.std > 0.0).all()


def test_states_are_unknown_where_the_model_runs_away() -> None:
    structure, p, record, _ = made(1)
    wild = p.copy()
    wild[structure.index("N_r|r|")] = 1e6  # turning faster makes it turn faster
    found = smoothed_states(structure, wild, record, ACTIVE, np.eye(4), NOISE, 0.1)
    assert np.isnan(found.mean[:, :3]).all() and np.isnan(found.std[:, :3]).all()
