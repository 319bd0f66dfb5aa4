"""Fits and filters keep what physics knows, and take no notice of what does not hold them."""

from dataclasses import replace

import numpy as np
import pytest

from auvident.constants import BEYOND_CHANCE_NATS
from auvident.engines.constraints import OUTERMOST, by_constraint, envelope, in_units, states_at
from auvident.engines.estimator import Task, free_positions, kept_inside, run_stage, task_of
from auvident.engines.setup import Setup
from auvident.estimation.inequalities import nearest
from auvident.physics.consistency import Constraints, hull_power
from auvident.stages.identify.result import _constraint_findings
from tests.engines.chain import identified, setup_of
from tests.engines.test_estimator import linear_setup, stage

METHODS = ("filter", "output_error")


def under(setup: Setup, constraints: Constraints) -> Setup:
    """The identification with other constraints."""
    other = replace(setup)
    other.__dict__["constraints"] = constraints  # where a cached property keeps its value
    return other


def half_of_the_way(task: Task, best: np.ndarray, symbol: str) -> Constraints:
    """That a coefficient goes half as far from its estimate as the data ask."""
    i = task.setup.structure.index(symbol)
    slopes = np.zeros((1, len(best)))
    half = 0.5 * (best[i] + task.setup.prior[i])
    # linear without a constant: on the side of the estimate of zero's ray through the half
    slopes[0, i] = np.sign(task.setup.prior[i] - best[i]) / abs(half)
    mass = task.setup.structure.index("m")
    slopes[0, mass] = -slopes[0, i] * half / task.setup.prior[mass]
    return Constraints((symbol,), slopes)


@pytest.mark.parametrize("method", METHODS)
def test_a_stage_whose_optimum_is_outside_ends_inside(method) -> None:
    plain, how = linear_setup(), stage(method=method)
    best = run_stage(plain, plain.prior, how)
    setup = under(plain, half_of_the_way(task_of(plain, how), best.parameters, "X_vr"))
    (before,), _ = setup.constraints(best.parameters)
    found = run_stage(setup, setup.prior, how)
    (value,), _ = setup.constraints(found.parameters)
    assert before < 0.0 <= value < 1e-6
    assert found.prices["X_vr"] > 0.0
    # the other coefficients take what suits them, as far as they are correlated with it
    others = [i for i in found.free if setup.structure.parameters[i] != "X_vr"]
    assert (found.parameters[others] != best.parameters[others]).all()


def test_the_price_of_a_constraint_is_what_the_fit_without_it_gains() -> None:
    plain, how = linear_setup(), stage(method="filter")
    best = run_stage(plain, plain.prior, how)
    setup = under(plain, half_of_the_way(task_of(plain, how), best.parameters, "X_vr"))
    found = run_stage(setup, setup.prior, how)
    away = (found.parameters - best.parameters)[best.free] / setup.prior_std[best.free]
    lost = 0.5 * away @ np.linalg.solve(best.covariance, away)
    assert found.prices["X_vr"] == pytest.approx(lost, rel=1e-4)


@pytest.mark.parametrize("method", METHODS)
def test_constraints_that_do_not_hold_change_nothing(method) -> None:
    plain, how = linear_setup(), stage(method=method)
    best = run_stage(plain, plain.prior, how)
    slopes = np.zeros((1, len(plain.prior)))
    slopes[0, plain.structure.index("m")] = 1.0
    found = run_stage(under(plain, Constraints(("m",), slopes)), plain.prior, how)
    np.testing.assert_array_equal(found.parameters, best.parameters)
    np.testing.assert_array_equal(found.covariance, best.covariance)
    assert found.prices == {"m": 0.0}


def pushed(setup: Setup, seed: int) -> np.ndarray:
    """Coefficients some standard deviations off, moved inside."""
    how = stage(system="coupled", free=("all",), maneuvers=("straight", "turn", "zigzag"))
    positions, rng = free_positions(setup, how), np.random.default_rng(seed)
    free = setup.free(positions)
    inside = in_units(setup.constraints, free, setup.prior)
    wide = np.full(len(positions), np.inf)
    far = 5.0 * rng.normal(size=len(positions))
    found = nearest(inside, far, np.eye(len(positions)), -wide, wide)
    return free.moved(setup.prior, found)


@pytest.mark.parametrize("seed", range(8))
def test_no_state_of_the_envelope_drives_the_hull(seed) -> None:
    setup, rng = setup_of(), np.random.default_rng(seed)
    p = pushed(setup, seed)
    assert (setup.constraints(p)[0] >= 0.0).all()
    states = np.concatenate([r.given[:, :3] for _, r in setup.records.values()])
    states = states[rng.choice(len(states), 300)]
    for state in states[np.abs(states[:, 0]) > 0.5]:
        power = hull_power(setup.structure, state)
        # between the states of the grid a little is left: 0.085 at most in 60 draws
        assert -power @ p > -0.1 * np.abs(power) @ np.abs(setup.prior)


def test_the_envelope_is_made_of_what_was_flown_and_of_no_stray_reading() -> None:
    records = [r for _, r in setup_of().records.values()]
    states = np.concatenate([r.given[:, :3] for r in records])
    found = envelope(records)
    edge = np.quantile(np.abs(states), OUTERMOST, axis=0)
    assert (np.abs(found[:, 1:]).max(axis=0) > 0.8 * edge[1:]).all()
    given = records[0].given.copy()
    given[::300, 1] = 50.0
    stray = [replace(records[0], given=given), *records[1:]]
    assert np.abs(envelope(stray)[:, 1]).max() < 50.0
    assert envelope([]).shape == (0, 3)


def test_port_and_starboard_have_one_envelope() -> None:
    records = [r for _, r in setup_of().records.values()]
    mirrored = [replace(r, given=r.given * np.array([1.0, -1.0, -1.0, 1.0])) for r in records]
    np.testing.assert_array_equal(envelope(mirrored), envelope(records))


def test_slopes_in_units_of_a_fit_go_with_what_follows() -> None:
    setup = setup_of()
    free = setup.free(np.array([setup.structure.index(s) for s in ("Y_rdot", "N_rdot")]))
    inside = in_units(setup.constraints, free, setup.prior)
    _, slopes = inside(np.zeros(2))
    for k, step in enumerate(1e-6 * np.eye(2)):
        moved = (inside(step)[0] - inside(-step)[0]) / 2e-6
        np.testing.assert_allclose(moved, slopes[:, k], atol=1e-8)


def test_an_outcome_outside_is_moved_inside_and_one_inside_stays() -> None:
    plain = linear_setup()
    best = run_stage(plain, plain.prior, stage())
    setup = under(plain, half_of_the_way(task_of(plain, stage()), best.parameters, "X_vr"))
    assert kept_inside(plain, best) is best
    assert (setup.constraints(kept_inside(setup, best).parameters)[0] >= 0.0).all()


def test_costs_of_the_rows_of_a_constraint_are_added() -> None:
    rows = Constraints(("a", "b", "a"), np.zeros((3, 1)))
    assert by_constraint(rows, np.array([1.0, 2.0, 3.0])) == {"a": 4.0, "b": 2.0}


def test_of_a_constraint_at_several_states_the_worst_is_told() -> None:
    rows = Constraints(("a", "b", "a"), np.array([[1.0], [2.0], [-3.0]]))
    a, b = states_at(rows, np.array([2.0]), {"a": 5.0})
    assert (a.id, a.value, a.active, a.cost_nats) == ("a", -6.0, True, 5.0)
    assert (b.id, b.value, b.active, b.cost_nats) == ("b", 4.0, False, 0.0)


def test_a_model_says_where_it_stands_to_every_constraint() -> None:
    model = identified("harbour_trial").model
    assert {row.id for row in model.constraints} == set(setup_of().constraints.ids)
    assert all(
        row.value > 0.0 and not row.active and row.cost_nats == 0.0 for row in model.constraints
    )
    assert not [f for f in model.findings if f.code == "against-physics"]


def test_what_a_constraint_costs_beyond_chance_is_a_finding() -> None:
    setup = setup_of()
    outcome = run_stage(setup, setup.prior, stage())
    for cost, told in ((0.9 * BEYOND_CHANCE_NATS, 0), (34.0, 1)):
        costs = {"lateral_added_mass": cost}
        found = _constraint_findings(states_at(setup.constraints, outcome.parameters, costs))
        assert len(found) == told
    assert found[0].where == "lateral_added_mass"
    assert "added inertia of the wrong sign (cost 34 nats): a delay" in found[0].message
