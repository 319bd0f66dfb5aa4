"""The compiled engine against filterpy's, on pieces of two sample maneuvers."""

from functools import cache

import numpy as np
import pytest

from auvident.engines import compiled, reference
from auvident.engines.problem import FilterProblem, FilterResult
from auvident.schema.coefficients import expand
from tests.engines.chain import cut, problem_of, setup_of

SYSTEMS = {
    "surge": (["drag", "thrust", "turning_drag"], (True, False, False, False)),
    "lateral": (["lift", "control", "cross_flow", "inertia"], (False, True, True, False)),
    "coupled": (["all"], (True, True, True, False)),
}
VERTICAL = {"vertical": (["all"], (True, True, True, True))}
CASES = [(s, k) for s in (*SYSTEMS, *VERTICAL) for k in ("ekf", "ukf")]


@cache
def problem(system: str) -> FilterProblem:
    """Two maneuvers of unequal length with readings missing beyond those of the slow DVL."""
    plane = "vertical" if system == "vertical" else "horizontal"
    setup = setup_of("dive_trial" if plane == "vertical" else "harbour_trial", plane)
    kinds = dict(setup.records.values())
    long, short = cut(kinds["zigzag"], 420), cut(kinds["straight"], 260)
    rng = np.random.default_rng(1)
    for record in (long, short):
        record.measured[rng.random(record.measured.shape) < 0.2] = np.nan
    long.measured[100:150] = np.nan  # nothing at all for 5 s
    names, active = (SYSTEMS | VERTICAL)[system]
    following = {setup.structure.parameters[f] for f in setup.followers[:, 0]}
    symbols = [s for s in expand(names, plane) if s not in following]
    return problem_of(setup, [long, short], symbols, active)


@cache
def both(system: str, kind: str) -> tuple[FilterResult, FilterResult]:
    return compiled.run(problem(system), kind), reference.run(problem(system), kind)


@pytest.mark.parametrize(("system", "kind"), CASES)
def test_the_problem_is_as_hard_as_it_should_be(system, kind) -> None:
    p, (found, _) = problem(system), both(system, kind)
    assert p.records.lengths.tolist() == [420, 260]
    possible = int(p.records.lengths.sum() * p.channels.sum())
    assert 0.3 * possible < found.samples < 0.8 * possible
    moved = (found.parameters - p.parameters)[p.free] / p.scale
    assert np.abs(moved).max() > 0.5  # the data say something
    assert found.samples == both(system, kind)[1].samples


# Both do the same arithmetic in another order over 420 steps; conditions of up to 1e6 leave
# 1e-10 of 1e-16, and agreement is asked for to 1e-8 of each quantity's own size.
RELATIVE = 1e-8


@pytest.mark.parametrize(("system", "kind"), CASES)
def test_parameters_agree(system, kind) -> None:
    p, (found, expected) = problem(system), both(system, kind)
    np.testing.assert_allclose(
        found.parameters[p.free] / p.scale, expected.parameters[p.free] / p.scale, rtol=RELATIVE
    )
    np.testing.assert_allclose(found.parameters, expected.parameters, rtol=RELATIVE)


@pytest.mark.parametrize(("system", "kind"), CASES)
def test_covariances_agree(system, kind) -> None:
    found, expected = both(system, kind)
    spread = np.sqrt(np.diag(expected.theta_covariance))
    np.testing.assert_allclose(
        found.theta_covariance / np.outer(spread, spread),
        expected.theta_covariance / np.outer(spread, spread),
        atol=RELATIVE,
    )


@pytest.mark.parametrize(("system", "kind"), CASES)
def test_log_likelihoods_agree(system, kind) -> None:
    found, expected = both(system, kind)
    assert found.log_likelihood == pytest.approx(expected.log_likelihood, rel=RELATIVE)


@pytest.mark.parametrize(("system", "kind"), CASES)
def test_histories_agree(system, kind) -> None:
    p, (found, expected) = problem(system), both(system, kind)
    np.testing.assert_allclose(
        found.history / p.scale, expected.history / p.scale, rtol=RELATIVE, atol=RELATIVE
    )
    np.testing.assert_allclose(found.history_std, expected.history_std, rtol=RELATIVE)
    np.testing.assert_array_equal(found.history[-1], found.parameters[p.free])


@pytest.mark.parametrize(("system", "kind"), CASES)
def test_states_and_whitened_innovations_agree(system, kind) -> None:
    p, (found, expected) = problem(system), both(system, kind)
    np.testing.assert_allclose(found.states, expected.states, rtol=RELATIVE, atol=RELATIVE)
    np.testing.assert_allclose(found.whitened, expected.whitened, rtol=RELATIVE, atol=RELATIVE)
    measured = np.isfinite(p.records.measured) & p.channels
    np.testing.assert_array_equal(np.isfinite(found.whitened), measured)


def test_ekf_and_ukf_differ_where_the_system_is_not_linear() -> None:
    """So that agreement above is not agreement of two names for one filter."""
    ekf, ukf = both("coupled", "ekf")[0], both("coupled", "ukf")[0]
    p = problem("coupled")
    away = np.abs((ekf.parameters - ukf.parameters)[p.free] / p.scale)
    assert 1e-4 < away.max() < 1.0
