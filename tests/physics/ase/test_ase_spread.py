"""Figures by draws from the estimate."""

import numpy as np
import pytest
from ase_vehicles import changed, fins, load

from auvident.physics.ase import stability
from auvident.physics.ase.draws import DRAWS, drawn_coefficients
from auvident.physics.ase.motion import maneuver_figures
from auvident.physics.maneuvers import turn_figures, zigzag_figures
from auvident.physics.terms import parameter_vector, structure_of
from auvident.physics.virtual import held_helm, run_virtual, zigzag_helm
from auvident.schema.coefficients import BY_SYMBOL
from auvident.stages.ase import estimate
from auvident.stages.identify.setup import rigid_body
from tests.processor_time import least_of_three


@pytest.fixture(scope="module")
def remus():
    return estimate(load("remus"))


def draws(result):
    rows = result.by_symbol()
    values = {s: r.value for s, r in rows.items()}
    return drawn_coefficients(values, {s: r.std for s, r in rows.items()}, result.accuracy_effects)


def test_draws_have_the_deviations_and_correlations_of_the_estimate(remus):
    drawn, effects = draws(remus), remus.accuracy_effects
    rows = remus.by_symbol()
    for symbol in ("X_uu", "Y_uv", "N_uv", "Y_uud", "N_rdot"):
        assert drawn[symbol][0] == rows[symbol].value
        # 200 draws: a standard deviation to 5 %, three of these
        assert np.std(drawn[symbol][1:]) == pytest.approx(rows[symbol].std, rel=0.15), symbol
    joint = sum(e.get("Y_uud", 0.0) * e.get("N_uud", 0.0) for e in effects.values())
    expected = joint / (rows["Y_uud"].std * rows["N_uud"].std)
    found = np.corrcoef(drawn["Y_uud"][1:], drawn["N_uud"][1:])[0, 1]
    assert found == pytest.approx(expected, abs=0.05)


def test_draws_keep_a_declared_sign(remus):
    for symbol, drawn in draws(remus).items():
        sign = BY_SYMBOL[symbol].sign
        assert not sign or np.all(sign * drawn >= 0.0), symbol


def test_given_coefficient_is_drawn_by_itself(remus):
    vehicle = changed(load("remus"), coefficients={"Y_uv": {"value": -40.0, "std": 2.0}})
    rows = estimate(vehicle).by_symbol()
    values, stds = ({s: getattr(r, k) for s, r in rows.items()} for k in ("value", "std"))
    drawn = drawn_coefficients(values, stds, remus.accuracy_effects, given=("Y_uv",))
    assert np.std(drawn["Y_uv"][1:]) == pytest.approx(2.0, rel=0.15)
    assert abs(np.corrcoef(drawn["Y_uv"][1:], drawn["Z_uw"][1:])[0, 1]) < 0.25  # 3.5 of 200 draws


@pytest.mark.parametrize("efficiency", [1.0, 0.5])
def test_maneuvers_are_those_of_the_program_itself(efficiency):
    """Against its compiled simulation in small steps, and the figures taken from its record."""
    vehicle = load("remus")
    vehicle = changed(vehicle, fin=fins(vehicle, "rudder", "elevator", efficiency=efficiency))
    result = estimate(vehicle)
    c = {row.symbol: row.value for row in result.coefficients}
    rate = result.speed_mps / stability.speed_per_rate_m(c)
    drawn = {symbol: np.full(3, value) for symbol, value in c.items()}
    found = maneuver_figures(
        drawn, vehicle.body, result.length_m, np.full(3, result.speed_mps), rate, fin_radps=np.inf
    )
    structure = structure_of("horizontal")
    p = parameter_vector("horizontal", c, rigid_body(vehicle, "horizontal"))
    start = np.array([result.speed_mps, 0.0, 0.0, 0.0])
    turn, zigzag = (
        run_virtual(structure, p, start, rate, 60.0, helm, dt_s=0.01)
        for helm in (held_helm(np.radians(15.0)), zigzag_helm(*np.radians([10.0, 10.0])))
    )
    u, v, r, heading = turn.states.T
    figures = turn_figures(turn.time_s, u, v, r, turn.inputs[:, 0], heading)
    figures |= zigzag_figures(zigzag.time_s, zigzag.states[:, 3], zigzag.inputs[:, 0])
    assert found["tactical_diameter_m"] == pytest.approx(figures["tactical_diameter_m"], rel=0.01)
    for name in ("overshoot_1_deg", "overshoot_2_deg"):
        # the rudder is reversed within a step of 0.1 L/U, in which the heading moves by 1 to 2 deg
        assert found[name] == pytest.approx(figures[name], rel=0.1, abs=0.2), name


def test_stability_of_small_fins_is_told_as_undecided():
    vehicle = load("remus")
    weak = changed(vehicle, fin=fins(vehicle, "rudder", "elevator", efficiency=0.5))
    result = estimate(weak)
    spread = result.facts["spread"]["horizontal"]
    assert 0.2 < spread["unstable_probability"] < 0.8
    assert spread["G"]["low"] < 0.0 < spread["G"]["high"]
    [found] = [f for f in result.findings if f.code == "stability_undecided"]
    assert f"probability {spread['unstable_probability']:.2f}" in found.message


def test_large_fins_are_surely_stable_and_none_are_not():
    vehicle = load("remus")
    large = changed(vehicle, fin=fins(vehicle, "rudder", "elevator", exposed_span_m=0.2))
    assert estimate(large).facts["spread"]["horizontal"]["unstable_probability"] < 0.02
    bare = estimate(changed(vehicle, fin=[])).facts["spread"]["horizontal"]
    assert bare["unstable_probability"] > 0.9
    assert "tactical_diameter_m" not in bare  # nothing steers
    for result in (estimate(large), estimate(changed(vehicle, fin=[]))):
        assert "stability_undecided" not in {f.code for f in result.findings}


def test_both_planes_of_a_body_without_sail_are_alike(remus):
    spread = remus.facts["spread"]
    assert spread["vertical"]["G"]["value"] == pytest.approx(spread["horizontal"]["G"]["value"])
    horizontal, vertical = (spread[p]["unstable_probability"] for p in ("horizontal", "vertical"))
    assert horizontal == pytest.approx(vertical, abs=0.1)  # other draws: 3 of 0.03


def test_speed_at_the_design_rate(remus):
    """Drag and thrust coefficients to about 20 %: speed to about 15 %, X_uu by its root."""
    speed = remus.facts["spread"]["speed"]
    assert speed["speed_mps"]["value"] == pytest.approx(remus.speed_mps)
    assert speed["rpm"] == pytest.approx(remus.facts["speed"]["design_speed_rpm"])
    drag = remus.by_symbol()["X_uu"]
    assert 0.2 < speed["speed_mps"]["std"] / remus.speed_mps / (drag.std / -drag.value) < 1.0


def test_given_coefficients_alone_have_a_spread_too():
    facts = estimate(load("kvlcc2")).facts["spread"]
    assert set(facts["horizontal"]) >= {"G", "unstable_probability", "tactical_diameter_m"}
    assert "vertical" not in facts


def test_spread_is_the_same_every_time_and_quick():
    first = estimate(load("suboff")).facts["spread"]
    assert first == estimate(load("suboff")).facts["spread"]
    assert least_of_three(lambda: estimate(load("suboff"))) < 2.0  # takes 0.1 s
    assert first["draws"] == DRAWS
