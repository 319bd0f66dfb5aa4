"""The compiled engine against filterpy's, on pieces of two sample maneuvers."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from auvident.engines import compiled, reference
from auvident.engines.carried import Carried
from auvident.engines.prediction import at_effects, linear_about
from auvident.engines.problem import FilterProblem, FilterResult
from auvident.engines.records import Record
from auvident.engines.setup import Setup
from auvident.engines.sigma_points import DIVERGED
from auvident.errors import NumericsError
from auvident.schema.coefficients import expand
from auvident.schema.effects import BY_ID, parameter_of
from tests.engines.chain import cut, problem_of, setup_of

SYSTEMS = {
    "surge": (["drag", "thrust", "turning_drag"], (True, False, False, False)),
    "lateral": (["lift", "control", "cross_flow", "inertia"], (False, True, True, False)),
    "coupled": (["all"], (True, True, True, False)),
}
VERTICAL = {"vertical": (["all"], (True, True, True, True))}
# the coupled system of a model that carries effects: on commands, in the equations, on readings
EFFECTS = {
    "rudder_offset.offset_deg": 1.0,
    "rudder_lag.lag_s": 0.3,
    "rudder_rate_limit.rate_degps": 40.0,
    "propeller_lag.lag_s": 0.5,
    "thrust_sag.fraction_per_1000_s": 0.1,
    "current.north_mps": 0.05,
    "current.east_mps": -0.1,
    "dvl_misalignment.yaw_deg": 1.0,
    "dvl_lever_arm.dx_m": 0.05,
    "dvl_lever_arm.dy_m": -0.05,
    "gyro_bias.bias_degps": 0.1,
    "gyro_scale.fraction": 0.01,
    "dvl_delay.delay_s": 0.12,
    "hull_asymmetry.Y_0": 0.3,
    "hull_asymmetry.N_0": -0.1,
    "linear_drag.X_u": -0.1,
}
CASES = [(s, k) for s in (*SYSTEMS, *VERTICAL, "effects") for k in ("ekf", "ukf")]


def carried() -> Carried:
    """`EFFECTS`, to be estimated with their usual priors for a vehicle of 1.6 m."""
    start = {name: parameter_of(name).internal(value) for name, value in EFFECTS.items()}
    prior_std = {
        name: parameter_of(name).prior * parameter_of(name).size_unit(1025.0, 1.6, 1.4, 16.0)
        for name in EFFECTS
    }
    effects = tuple(e for e in BY_ID if any(name.startswith(f"{e}.") for name in EFFECTS))
    return Carried(effects, start, dict.fromkeys(EFFECTS, 0.0), prior_std)


@cache
def problem(system: str) -> FilterProblem:
    """Two maneuvers of unequal length with readings missing beyond those of the slow DVL."""
    plane = "vertical" if system == "vertical" else "horizontal"
    with_effects = {"carried": carried()} if system == "effects" else {}
    setup = setup_of(
        "dive_trial" if plane == "vertical" else "harbour_trial", plane, **with_effects
    )
    kinds = dict(setup.records.values())
    long, short = cut(kinds["zigzag"], 420), cut(kinds["straight"], 260)
    rng = np.random.default_rng(1)
    for record in (long, short):
        record.measured[rng.random(record.measured.shape) < 0.2] = np.nan
    long.measured[100:150] = np.nan  # nothing at all for 5 s
    if system == "effects":
        return with_linear(setup, [long, short])
    names, active = (SYSTEMS | VERTICAL)[system]
    following = {setup.structure.parameters[f] for f in setup.followers[:, 0]}
    symbols = [s for s in expand(names, plane) if s not in following]
    return problem_of(setup, [long, short], symbols, active)


def with_linear(setup: Setup, records: list[Record]) -> FilterProblem:
    """As `estimator` makes it: inputs and readings to first order about the start."""
    symbols = [*expand(["lift", "control", "drag", "thrust"], "horizontal"), *EFFECTS]
    free = setup.free(np.array([setup.structure.index(s) for s in symbols], dtype=np.int64))
    acting = [at_effects(setup.frame, setup.start, record) for record in records]
    linear, sensor = linear_about(
        setup.frame, setup.start, acting, free, max(len(r.time_s) for r in acting)
    )
    return problem_of(
        setup,
        acting,
        symbols,
        (True, True, True, False),
        parameters=setup.start,
        linear=linear,
        sensor=sensor,
    )


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


# Both do the same arithmetic in another order over 420 steps. Agreement is asked for in each
# quantity's own size, which for one that may be zero, as every effect, is its prior standard
# deviation. Conditions of 1e5 leave 5e-11 of 1e-16 in the EKF; in the UKF the weight of the centre,
# 1 - n = -27, cancels against the others and leaves up to 1e-8. How far, hangs on the processor:
# a reference that differs by more from itself, its readings rounded otherwise, is held to that
# (with all effects 1.0e-8 to 1.7e-8 on one processor, where ours differs from itself by 4e-11).
EXACT = {"ekf": 1e-9, "ukf": 1e-8}
ROUNDED = 1e-15  # a few roundings of a double
DRAWS = 3
OF_BOTH = 2.0  # the difference has the rounding of either: what one draw leaves, twice


@cache
def relative(system: str, kind: str) -> float:
    """Tolerance of a comparison, wider only where the reference does not hold it against itself."""
    own = _own_rounding(system) if kind == "ukf" else 0.0
    assert own < 1e-7
    return EXACT[kind] if own <= EXACT[kind] else OF_BOTH * own


def _own_rounding(system: str) -> float:
    """Most by which the reference differs from itself with its readings rounded otherwise."""
    p, (_, expected) = problem(system), both(system, "ukf")
    rng, found = np.random.default_rng(0), 0.0
    for _ in range(DRAWS):
        rounded = 1.0 + ROUNDED * rng.standard_normal(p.records.measured.shape)
        records = replace(p.records, measured=p.records.measured * rounded)
        again = reference.run(replace(p, records=records), "ukf")
        found = max(found, float(np.nanmax(np.abs(again.whitened - expected.whitened))))
    return found


@pytest.mark.parametrize(("system", "kind"), CASES)
def test_parameters_agree(system, kind) -> None:
    p, (found, expected) = problem(system), both(system, kind)
    size = np.abs(expected.parameters)
    size[p.free] = np.maximum(size[p.free], p.scale)
    assert (np.abs(found.parameters - expected.parameters) <= relative(system, kind) * size).all()


@pytest.mark.parametrize(("system", "kind"), CASES)
def test_covariances_agree(system, kind) -> None:
    found, expected = both(system, kind)
    spread = np.sqrt(np.diag(expected.theta_covariance))
    np.testing.assert_allclose(
        found.theta_covariance / np.outer(spread, spread),
        expected.theta_covariance / np.outer(spread, spread),
        rtol=0.0,
        atol=relative(system, kind),
    )


@pytest.mark.parametrize(("system", "kind"), CASES)
def test_log_likelihoods_agree(system, kind) -> None:
    found, expected = both(system, kind)
    assert found.log_likelihood == pytest.approx(
        expected.log_likelihood, rel=relative(system, kind)
    )


@pytest.mark.parametrize(("system", "kind"), CASES)
def test_histories_agree(system, kind) -> None:
    p, (found, expected) = problem(system), both(system, kind)
    np.testing.assert_allclose(
        found.history / p.scale,
        expected.history / p.scale,
        rtol=relative(system, kind),
        atol=relative(system, kind),
    )
    np.testing.assert_allclose(found.history_std, expected.history_std, rtol=relative(system, kind))
    np.testing.assert_array_equal(found.history[-1], found.parameters[p.free])


@pytest.mark.parametrize(("system", "kind"), CASES)
def test_states_and_whitened_innovations_agree(system, kind) -> None:
    p, (found, expected) = problem(system), both(system, kind)
    np.testing.assert_allclose(
        found.states, expected.states, rtol=relative(system, kind), atol=relative(system, kind)
    )
    np.testing.assert_allclose(
        found.whitened, expected.whitened, rtol=relative(system, kind), atol=relative(system, kind)
    )
    measured = np.isfinite(p.records.measured) & p.channels
    np.testing.assert_array_equal(np.isfinite(found.whitened), measured)


def test_ekf_and_ukf_differ_where_the_system_is_not_linear() -> None:
    """So that agreement above is not agreement of two names for one filter."""
    ekf, ukf = both("coupled", "ekf")[0], both("coupled", "ukf")[0]
    p = problem("coupled")
    away = np.abs((ekf.parameters - ukf.parameters)[p.free] / p.scale)
    assert 1e-4 < away.max() < 1.0


@pytest.mark.parametrize("kind", ["ekf", "ukf"])
def test_the_effects_of_the_problem_move_with_the_data(kind) -> None:
    """Agreement is worth nothing where inputs and readings do not depend on a parameter."""
    p, (found, _) = problem("effects"), both("effects", kind)
    assert p.linear is not None
    assert len(p.linear.input_columns) == 5
    assert len(p.linear.reading_columns) == 8
    names = [p.structure.parameters[i] for i in p.free]
    shrunk = np.sqrt(np.diag(found.theta_covariance))[[names.index(n) for n in EFFECTS]]
    assert (shrunk < 0.999).all()
    assert (shrunk < 0.8).sum() > len(EFFECTS) / 2


# --- faults --------------------------------------------------------------------------------


@pytest.mark.parametrize(("dt_s", "told"), [(0.1, False), (2.0, True)])
def test_a_filter_that_stops_on_a_coarse_grid_names_the_rate(dt_s: float, told: bool) -> None:
    p = problem("surge")
    coarse = replace(p, records=replace(p.records, dt_s=dt_s))
    with pytest.raises(NumericsError, match="the state diverged") as caught:
        compiled.raise_fault(coarse, np.array([5, 0, 1, DIVERGED]))
    assert ("a faster --rate than 0.5 Hz" in caught.value.remedy) == told
    assert "hold the maneuver out" in caught.value.remedy
