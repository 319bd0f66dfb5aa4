"""Roll from geometry: closed forms of the section, Prestero's REMUS, and drawn vehicles."""

import math
import sys

import numpy as np
import pytest
from ase_vehicles import changed, fins, load

from auvident.physics.ase.added_mass import one_fin_section
from auvident.physics.ase.roll import ROLL_ROWS, beside, roll_estimate
from auvident.physics.ase.roll_section import plate_share, roll_section
from auvident.schema.vehicle import Vehicle
from auvident.storage.vehicle_file import load_vehicle
from tests.engines.chain import SAMPLES
from tests.session import once

if str(SAMPLES) not in sys.path:
    sys.path.insert(0, str(SAMPLES))

RADII = (0.05, 0.3, 0.6, 0.9)
DRAWN = 40


def pair_on_circle(tau):
    """Newman 1977, table 4.3: roll inertia of a circle with two fins, over rho s^4."""
    a = math.pi - math.asin(2.0 * tau / (1.0 + tau**2))
    bracket = 2.0 * a**2 - a * math.sin(4.0 * a) + 0.5 * math.sin(2.0 * a) ** 2
    return tau**4 * (bracket / (math.pi * math.sin(a) ** 4) - 0.5 * math.pi)


@pytest.mark.parametrize("tau", RADII)
def test_pair_of_fins_on_a_circle(tau):
    # the Fourier sum converges as 1/N and the kink at the root of a short fin is sharp
    accuracy = 0.004 if tau > 0.8 else 0.001
    assert roll_section(2, tau).roll == pytest.approx(pair_on_circle(tau), rel=accuracy)


@pytest.mark.parametrize("tau", RADII)
def test_sway_of_one_fin_is_that_of_the_planes(tau):
    """Theory 2.2: pi rho ((s + R)^4 / (4 s^2) - 3 R^2)."""
    exact = float(one_fin_section(1.0, np.array(1.0), np.array(tau)))
    assert roll_section(1, tau).sway == pytest.approx(exact, rel=0.001)


def test_plates_without_a_hull():
    """Plate pi/8, cross 2/pi (Blevins); a plate about its edge: pi/4 in sway, 9 pi/128 in roll."""
    assert roll_section(2, 0.0).roll == pytest.approx(math.pi / 8)
    assert roll_section(4, 0.0).roll == pytest.approx(2.0 / math.pi, rel=1e-4)
    edge = roll_section(1, 0.0)
    assert (edge.sway, edge.cross, edge.roll) == (
        pytest.approx(math.pi / 4),
        pytest.approx(math.pi / 8),
        pytest.approx(9.0 * math.pi / 128),
    )


def test_a_fin_that_ends_at_the_hull_adds_nothing():
    for count in (1, 2, 3, 4):
        assert roll_section(count, 1.0).roll == pytest.approx(0.0, abs=1e-12)
    assert roll_section(1, 1.0).sway == pytest.approx(math.pi)  # the circle itself


@pytest.mark.parametrize(("aspect", "share"), [(1.0, 0.579), (2.0, 0.757 / 2), (0.5, 0.757)])
def test_plates_of_finite_span(aspect, share):
    assert plate_share(aspect) == pytest.approx(share)
    assert plate_share(1e-3) == pytest.approx(1.0, abs=0.002)


def test_remus_against_prestero():
    """His K_pdot -0.0704 and K_pp -0.130 and what the sources of both numbers are.

    Eq. 4.24 is 2/pi rho a^4 by the length of the fins; the printed figure is pi rho a^4 by it.
    The drag of his tables B is ten times that of tables 4.2 and 4.3 (Y_vv -1310 for -131), and so,
    it seems, is K_pp: a tenth of it is a plate's.
    """
    found = roll_estimate(load("remus"))
    length, tip = 0.074, 0.131
    assert math.pi * 1030.0 * tip**4 * length == pytest.approx(0.0704, rel=0.01)
    slender = 2.0 / math.pi * 1030.0 * tip**4 * length
    strips = -found["K_pdot"].value / float(plate_share(1.473))
    assert strips == pytest.approx(slender, rel=0.10)  # the hull counts, and the span is literal
    assert abs(found["K_pdot"].value + 0.0704) < 2.0 * found["K_pdot"].std
    assert found["K_p|p|"].value == pytest.approx(-0.0130, rel=0.2)
    assert abs(found["I_xx"].value - 0.177) < found["I_xx"].std
    assert found["z_GW"].value == pytest.approx(30.48 * 9.80665 * 0.0196)


def test_every_term_has_a_deviation():
    assert set(roll_estimate(load("remus"))) == {row.symbol for row in ROLL_ROWS}
    for name in ("remus", "suboff"):
        for symbol, term in roll_estimate(load(name)).items():
            assert term.std > 0.0, symbol
            assert sum(term.parts.values()) == pytest.approx(term.value), symbol


def test_sail_ties_roll_to_drift_and_yaw():
    """Drift to starboard pushes the sail to port, above the axis: K < 0; forward sail: K_ur < 0."""
    suboff = roll_estimate(load("suboff"))
    for symbol in ("K_uv", "K_ur", "Y_up", "N_up", "Y_pdot", "N_pdot"):
        assert suboff[symbol].value < 0.0, symbol
    assert suboff["K_uv"].value == suboff["Y_up"].value
    bare = load("suboff")
    bare = roll_estimate(changed(bare, fin=fins(bare, "rudder", "elevator")))
    assert bare["K_uv"].value == bare["Y_pdot"].value == 0.0
    assert abs(bare["K_up"].value) < 0.5 * abs(suboff["K_up"].value)


def test_side_force_of_the_sail_acts_on_its_span():
    """K_uv over the sail's Y_uv: the height of its own share of the force, within the span."""
    from auvident.stages.ase import estimate

    suboff = load("suboff")
    side = estimate(suboff).by_symbol()["Y_uv"].parts["sail"]
    height = roll_estimate(suboff)["K_uv"].value / side
    assert 0.3 * 0.254 < height < 0.254 + 0.222  # the carry-over on the hull has no moment


def test_planes_that_stand_together_shield_each_other():
    remus = load("remus")
    pair = changed(remus, fin=fins(remus, "rudder"))
    apart = changed(remus, fin=[*fins(remus, "rudder"), *fins(remus, "elevator", x_m=-0.45)])
    assert beside(remus, remus.fin[0]) == 4
    assert beside(apart, apart.fin[0]) == 2
    one, cross = roll_estimate(pair), roll_estimate(remus)
    ratio = cross["K_pdot"].value / one["K_pdot"].value
    closed = float(roll_section(4, 0.33).roll / roll_section(2, 0.33).roll)
    assert ratio == pytest.approx(closed, rel=0.02)  # hull radius varies along the chord
    lifts = cross["K_up"].parts["rudder"] / one["K_up"].parts["rudder"]
    assert 0.5 * closed < lifts < 1.0


def test_x_tail_rolls_as_a_cross():
    remus = load("remus")
    turned = changed(remus, fin=fins(remus, "rudder", "elevator", dihedral_deg=45.0))
    for symbol, term in roll_estimate(turned).items():
        assert term.value == pytest.approx(roll_estimate(remus)[symbol].value), symbol


def test_inertia_of_the_file_comes_first():
    stated = roll_estimate(changed(load("remus"), vehicle={"ixx_kgm2": 0.177}))["I_xx"]
    assert stated.value == 0.177
    assert stated.std == pytest.approx(0.05 * 0.177)


def test_uniform_cylinder():
    """m d^2/8 about its axis, and m z_G^2 of a low centre."""
    data = {
        "vehicle": {"mass_kg": 50.0, "izz_kgm2": 10.0, "origin_from_nose_m": 1.0, "z_g_m": 0.02},
        "hull": {"length_m": 2.0, "diameter_m": 0.18, "nose_length_m": 0.0, "tail_length_m": 0.0},
    }
    found = roll_estimate(Vehicle.model_validate(data))["I_xx"]
    assert found.parts["uniform body"] == pytest.approx(50.0 * 0.18**2 / 8.0, rel=1e-6)
    assert found.parts["low centre"] == pytest.approx(50.0 * 0.02**2)


def test_hull_that_is_no_body_of_revolution():
    assert set(roll_estimate(load("kvlcc2"))) == {"I_xx", "z_GW"}


def roll_forces(body, plant, size):
    """Slopes of the generator's fins with roll rate, drift and yaw rate, over speed."""
    from seatrial.plant import PlantEffects, add_fins

    u, step = size.speed, 1e-4

    def slope(axis, unit):
        pair = []
        for sign in (1.0, -1.0):
            nu, tau = np.zeros(6), np.zeros(6)
            nu[0], nu[axis] = u, sign * step * unit
            add_fins(nu, 0.0, 0.0, 0.0, body, PlantEffects(), tau)
            pair.append(tau)
        return (pair[0] - pair[1]) / (2.0 * step * unit * u)

    return slope(3, u / size.diameter), slope(1, u), slope(5, u / size.length)


@once
def errors():
    """Errors over their standard deviations on even seeds, by symbol; lift of the fins alone."""
    from seatrial.population.equipment import draw_equipment
    from seatrial.population.form import Refused, draw_form
    from seatrial.population.stated import draw_stated

    rows = []
    for seed in range(0, 4 * DRAWN, 2):
        rng = np.random.default_rng(seed)
        try:
            vehicle, size, keys = draw_form(rng)
        except Refused:
            continue
        stated = draw_stated(vehicle, size, keys, draw_equipment(size, rng), rng)
        body, plant = vehicle.body, vehicle.plant
        p, v, r = roll_forces(body, plant, size)
        true = {"I_xx": plant.i_xx, "K_pdot": plant.added_mass[3]}
        true |= {"Y_pdot": plant.added_cross[2], "N_pdot": plant.added_cross[3]}
        true |= {"K_up": p[3], "Y_up": p[1], "N_up": p[5], "K_uv": v[3], "K_ur": r[3]}
        true["z_GW"] = body.weight * body.z_g
        found = roll_estimate(Vehicle.model_validate(stated))
        rows.append({s: (true[s] - found[s].value) / found[s].std for s in true})
    return {s: np.array([row[s] for row in rows]) for s in rows[0]}


@pytest.mark.parametrize("symbol", [r.symbol for r in ROLL_ROWS if r.symbol != "K_p|p|"])
def test_deviations_on_drawn_vehicles(symbol):
    """The generator's fins are strips with the lift at 0.45 of the span, alone in the water."""
    assert len(errors()[symbol]) >= DRAWN
    assert np.sqrt(np.mean(errors()[symbol] ** 2)) < 1.5


def test_sailed_vehicle_of_the_samples():
    """The generator's sail: 5 kg of sway mass at 0.19 m, K_pdot -0.32, N_pdot -0.17."""
    found = roll_estimate(load_vehicle(SAMPLES / "tern180.toml"))
    truth = {"Y_pdot": -0.95, "N_pdot": -0.17, "K_pdot": -0.32, "I_xx": 0.46}
    for symbol, value in truth.items():
        assert abs(found[symbol].value - value) < 1.5 * found[symbol].std, symbol
