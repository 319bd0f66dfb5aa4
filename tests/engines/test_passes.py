"""One pass of the filters: closed form of a linear problem, gaps, order, followers."""

from dataclasses import replace

import numpy as np
import pytest

from auvident.engines import compiled, reference
from auvident.engines.records import stack
from tests.engines.chain import cut, problem_of, setup_of

KINDS = ("ekf", "ukf")
SURGE, LATERAL = (True, False, False, False), (False, True, True, False)
LIFT = ("Y_uv", "Y_ur", "N_uv", "N_ur", "Y_uud", "N_uud")


def records(*lengths: int, setup=None) -> list:
    setup = setup or setup_of()
    chosen = [r for kind, r in setup.records.values() if kind != "straight"]
    return [cut(r, n) for r, n in zip(chosen, lengths, strict=False)]


# --- closed form ---------------------------------------------------------------------------


def without_own_speed(setup):
    """A surge equation whose right-hand side does not know u: linear in state and parameters."""
    prior = setup.prior.copy()
    for symbol in ("X_uu", "T_nu", "X_uudd"):
        prior[setup.structure.index(symbol)] = 0.0
    return replace(setup, prior=prior)


LINEAR = ("X_vv", "X_vr", "X_rr", "T_nn")


def regression(setup, problem):
    """Readings as a linear function of (theta, starts), by Simpson's rule; and the data."""
    m = setup.prior[setup.structure.index("m")]
    surge_mass = m - setup.prior[setup.structure.index("X_udot")]
    mx = setup.prior[setup.structure.index("m x_G")]
    at = [setup.structure.index(s) for s in LINEAR]
    dt, rows, data, offsets = problem.records.dt_s, [], [], []
    k = len(problem.records.ids)
    for j, n in enumerate(problem.records.lengths):
        given = problem.records.given[j, :n]
        middle = 0.5 * (given[:-1] + given[1:])
        rps = problem.records.inputs[j, : n - 1, 2]

        def products(x, rps=rps):
            v, r = x[:, 1], x[:, 2]
            return np.column_stack([v * v, v * r, r * r, rps * np.abs(rps)])

        def rigid(x):
            return m * x[:, 1] * x[:, 2] + mx * x[:, 2] ** 2

        def simpson(f, given=given, middle=middle):
            return dt / 6 * (f(given[:-1]) + 4 * f(middle) + f(given[1:])) / surge_mass

        slopes = np.vstack([np.zeros(4), np.cumsum(simpson(products), axis=0)])
        known = slopes @ problem.parameters[at]
        known += np.concatenate([[0.0], np.cumsum(simpson(rigid))])
        known += given @ np.where(problem.active, 0.0, problem.sensor[0])  # lever arm times given
        for t in np.flatnonzero(np.isfinite(problem.records.measured[j, :n, 0])):
            start = np.eye(k)[j]
            rows.append(np.concatenate([slopes[t] * problem.scale, start]))
            data.append(problem.records.measured[j, t, 0])
            offsets.append(known[t] + problem.start[j, 0])
    return np.array(rows), np.array(data) - np.array(offsets)


@pytest.mark.parametrize("run", [compiled.run, reference.run], ids=["compiled", "filterpy"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_linear_problem_has_the_posterior_of_a_regression(kind, run) -> None:
    setup = without_own_speed(setup_of())
    sensor = setup.sensor.copy()
    sensor[0, 2] = -0.3  # the DVL to starboard of the origin: the given r is in the reading of u
    problem = problem_of(
        setup,
        records(200, 150),
        LINEAR,
        SURGE,
        sensor=sensor,
        process_std=np.zeros(4),
        theta_noise=np.zeros(4),
    )
    found = run(problem, kind)
    h, z = regression(setup, problem)
    assert found.samples == len(z) > 150
    prior = np.diag([1.0] * 4 + [problem.start_std[0] ** 2] * 2)
    s = h @ prior @ h.T + problem.sensor_std[0] ** 2 * np.eye(len(z))
    mean = prior @ h.T @ np.linalg.solve(s, z)
    covariance = prior - prior @ h.T @ np.linalg.solve(s, h @ prior)
    log_likelihood = -0.5 * (z @ np.linalg.solve(s, z) + np.linalg.slogdet(2 * np.pi * s)[1])
    theta = (found.parameters - problem.parameters)[problem.free] / problem.scale
    # condition of s: 1e5, hence 1e-10 of each quantity; the dense form above is the weaker one
    np.testing.assert_allclose(theta, mean[:4], rtol=1e-7, atol=1e-8)
    np.testing.assert_allclose(found.theta_covariance, covariance[:4, :4], atol=1e-8)
    assert found.log_likelihood == pytest.approx(log_likelihood, rel=1e-8)


# --- missing readings ----------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_a_missing_channel_is_one_of_infinite_noise(kind) -> None:
    setup = setup_of()
    noise = 5.0 * setup.sensor_std
    deaf = noise.copy()
    deaf[1] = 1e8  # [m/s] against speeds of 0.3
    gone = records(200, 150)
    for record in gone:
        record.measured[:, 1] = np.nan
    noisy = compiled.run(problem_of(setup, records(200, 150), LIFT, LATERAL, sensor_std=deaf), kind)
    silent = compiled.run(problem_of(setup, gone, LIFT, LATERAL, sensor_std=noise), kind)
    assert noisy.samples > silent.samples
    # what a reading tells at this noise: (0.3 / 1e8)^2 = 1e-17
    np.testing.assert_allclose(noisy.parameters, silent.parameters, rtol=1e-10)
    np.testing.assert_allclose(noisy.theta_covariance, silent.theta_covariance, atol=1e-10)


@pytest.mark.parametrize("kind", KINDS)
def test_after_the_last_reading_nothing_changes_but_the_states(kind) -> None:
    blind = records(200)
    blind[0].measured[80:] = np.nan
    problem = problem_of(setup_of(), blind, LIFT, LATERAL, theta_noise=np.zeros(6))
    found = compiled.run(problem, kind)
    early = compiled.run(
        problem_of(setup_of(), [cut(blind[0], 80)], LIFT, LATERAL, theta_noise=np.zeros(6)), kind
    )
    np.testing.assert_allclose(found.parameters, early.parameters, rtol=1e-12)
    assert found.log_likelihood == pytest.approx(early.log_likelihood, rel=1e-12)
    assert np.isfinite(found.states[0][:, [1, 2]]).all()


@pytest.mark.parametrize("kind", KINDS)
def test_without_any_reading_the_posterior_is_the_prior(kind) -> None:
    blind = records(50)
    blind[0].measured[:] = np.nan
    problem = problem_of(
        setup_of(), blind, LIFT, LATERAL, theta_noise=np.full(6, 0.01), channels=np.array(LATERAL)
    )
    found = compiled.run(problem, kind)
    assert found.samples == 0
    assert found.log_likelihood == 0.0
    np.testing.assert_array_equal(found.parameters, problem.parameters)
    # 49 predictions, each adding the drift
    np.testing.assert_allclose(np.diag(found.theta_covariance), 1.0 + 49 * 0.01, rtol=1e-12)


# --- order of the maneuvers ----------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_order_of_maneuvers_of_unequal_length_does_not_matter(kind) -> None:
    pieces = records(200, 120, 160)
    found = compiled.run(problem_of(setup_of(), pieces, LIFT, LATERAL), kind)
    turned = compiled.run(problem_of(setup_of(), pieces[::-1], LIFT, LATERAL), kind)
    np.testing.assert_array_equal(found.parameters, turned.parameters)  # the same array
    np.testing.assert_array_equal(found.theta_covariance, turned.theta_covariance)


@pytest.mark.parametrize("kind", KINDS)
def test_place_of_maneuvers_of_equal_length_does_not_matter(kind) -> None:
    pieces = records(150, 150, 150)
    renamed = [replace(r, id=name) for r, name in zip(pieces, "acb", strict=True)]
    # begun where a first pass ended: the farther the parameters go from where a pass begins, the
    # more count the terms of third order below
    first = problem_of(setup_of(), pieces, LIFT, LATERAL)
    begun = compiled.run(first, kind).parameters
    found = compiled.run(problem_of(setup_of(), pieces, LIFT, LATERAL, parameters=begun), kind)
    problem = problem_of(setup_of(), renamed, LIFT, LATERAL, parameters=begun)
    assert problem.records.ids == ("a", "b", "c")
    turned = compiled.run(problem, kind)
    # The readings of one instant are taken in another order: the same but for rounding, also
    # in the UKF, whose sigma points depend on the order only through the Cholesky factor; its
    # pairs then differ by terms of third order.
    tolerance = 1e-9 if kind == "ekf" else 1e-6
    away = (found.parameters - turned.parameters)[problem.free] / problem.scale
    assert np.abs(away).max() < tolerance
    np.testing.assert_allclose(found.theta_covariance, turned.theta_covariance, atol=tolerance)


def test_stack_sorts_by_length_then_name_and_pads_with_nan() -> None:
    pieces = [
        replace(r, id=name) for r, name in zip(records(30, 50, 30), ("z", "m", "a"), strict=True)
    ]
    stacked, starts = stack(pieces, 0.1)
    assert stacked.ids == ("m", "a", "z")
    assert stacked.lengths.tolist() == [50, 30, 30]
    np.testing.assert_array_equal(starts, [pieces[i].start for i in (1, 2, 0)])
    for block in (stacked.inputs, stacked.given, stacked.measured):
        assert np.isnan(block[1:, 30:]).all()
    np.testing.assert_array_equal(stacked.inputs[2, :30], pieces[0].inputs)


# --- followers, mean and covariance --------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_a_follower_moves_with_its_leader(kind) -> None:
    setup = setup_of()
    problem = problem_of(setup, records(200, 150), ("Y_rdot", "Y_vdot", "N_rdot"), LATERAL)
    found = compiled.run(problem, kind)
    moved = found.parameters - problem.parameters
    y_rdot, n_vdot = (setup.structure.index(s) for s in ("Y_rdot", "N_vdot"))
    assert abs(moved[y_rdot]) > 0.01 * setup.prior_std[y_rdot]
    assert moved[n_vdot] == pytest.approx(moved[y_rdot], rel=1e-12)
    others = np.setdiff1d(np.arange(len(moved)), [*problem.free, n_vdot])
    assert (moved[others] == 0.0).all()


@pytest.mark.parametrize("kind", KINDS)
def test_one_parameter_cannot_become_less_certain_without_drift(kind) -> None:
    problem = problem_of(setup_of(), records(200, 150), LIFT, LATERAL, theta_noise=np.zeros(6))
    found = compiled.run(problem, kind)
    assert (np.diff(found.history_std, axis=0) <= 1e-12 * problem.scale).all()
    assert (np.linalg.eigvalsh(found.theta_covariance) > 0).all()
    np.testing.assert_allclose(
        found.history_std[-1] / problem.scale, np.sqrt(np.diag(found.theta_covariance)), rtol=1e-12
    )
