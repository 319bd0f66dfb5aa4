import numpy as np
import pytest
from ase_vehicles import changed, fins, load

from auvident.physics.ase.accuracy import ACCURACIES, Deviation
from auvident.physics.ase.assembly import coefficient_parts, totals
from auvident.physics.ase.geometry import hull_geometry
from auvident.physics.ase.hull import crossflow_terms
from auvident.stages.ase import estimate


@pytest.mark.parametrize("name", ["suboff", "remus"])
def test_no_deviation_is_zero(name):
    for row in estimate(load(name)).coefficients:
        assert row.std > 0.0, row.symbol


def test_deviation_without_fins_covers_a_small_fin():
    """A vehicle with no rudder in its file still may have one of a third of REMUS's effect."""
    remus = load("remus")
    bare = estimate(changed(remus, fin=[])).by_symbol()
    full = estimate(remus).by_symbol()
    for symbol in ("Y_uud", "N_uud", "Z_uud", "M_uud"):
        assert bare[symbol].value == 0.0
        assert bare[symbol].std > 0.2 * abs(full[symbol].value)
    codes = {f.code for f in estimate(changed(remus, fin=fins(remus, "rudder"))).findings}
    assert "no_elevator" in codes
    assert "no_rudder" not in codes


def test_deviation_of_absent_yaw_cross_flow_covers_the_strips():
    remus = load("remus")
    found = estimate(remus).by_symbol()["N_r|r|"]
    ase = changed(remus, ase={"hull_rate_crossflow": True}).ase
    strips = crossflow_terms(hull_geometry(remus), 1.5, 1030.0, 1.19e-6, ase, Deviation())
    assert found.std > abs(float(strips["N_r|r|"]))


def test_first_order_propagation_against_random_draws():
    """Standard deviations against 4000 draws of the accuracies (without the residuals)."""
    remus = load("remus")
    rng = np.random.default_rng(5)
    draws = Deviation({a.name: rng.standard_normal(4000) for a in ACCURACIES})
    sampled = totals(coefficient_parts(remus, 1.54, draws))
    result = estimate(remus)
    for symbol in ("Y_uv", "N_uv", "Y_vdot", "N_rdot", "Y_v|v|", "X_uu", "Y_uud", "T_nn"):
        linear = np.sqrt(sum(e.get(symbol, 0.0) ** 2 for e in result.accuracy_effects.values()))
        # products of log-normal factors have a longer tail than first order: 25 % here
        assert np.std(sampled[symbol]) == pytest.approx(linear, rel=0.25), symbol


def test_given_coefficients_take_the_place_of_the_formulas():
    known = {"Y_uv": {"value": -40.0, "std": 2.0}}
    result = estimate(changed(load("remus"), coefficients=known))
    row = result.by_symbol()["Y_uv"]
    assert (row.value, row.std, row.origin) == (-40.0, 2.0, "given")


def test_every_accuracy_has_an_effect_and_a_source():
    suboff = load("suboff")
    propeller = {"propeller": {"diameter_m": 0.2, "kt0": 0.4, "kt1": -0.4}}
    given = {"propeller": {**propeller["propeller"], "wake_fraction": 0.2, "thrust_deduction": 0.1}}
    seen = set()
    stated = {"hull": {"drag_coefficient": 0.2}}
    for tables in (propeller, given, stated):
        seen |= set(estimate(changed(suboff, **tables)).accuracy_effects)
    assert seen == {a.name for a in ACCURACIES}
    assert all(a.source and a.sigma > 0.0 for a in ACCURACIES)


@pytest.mark.parametrize(
    ("given", "plane"),
    [
        ({"Y_vdot": 5000.0}, "horizontal"),
        ({"M_qdot": 100.0}, "vertical"),
        ({"Z_qdot": 60.0, "M_wdot": 60.0}, "vertical"),  # the diagonal is possible
        ({}, None),
    ],
)
def test_added_masses_with_which_nothing_can_move_are_told(given, plane):
    known = {symbol: {"value": value, "std": 1.0} for symbol, value in given.items()}
    result = estimate(changed(load("remus"), coefficients=known))
    found = [f.message for f in result.findings if f.code == "impossible_mass"]
    assert len(found) == (plane is not None)
    assert all(f"the {plane} plane" in message for message in found)


@pytest.mark.parametrize(("height_m", "told"), [(-0.02, True), (0.0, False), (0.02, False)])
def test_a_centre_of_gravity_above_that_of_buoyancy_is_told(height_m, told):
    found = estimate(changed(load("remus"), vehicle={"z_g_m": height_m})).findings
    assert ("gravity_above" in {f.code for f in found}) == told


@pytest.mark.parametrize("inertia", [None, 3.45])
def test_an_inertia_in_pitch_that_is_that_of_yaw_is_told(inertia):
    found = estimate(changed(load("remus"), vehicle={"iyy_kgm2": inertia})).findings
    assert ("assumed_inertia" in {f.code for f in found}) == (inertia is None)
