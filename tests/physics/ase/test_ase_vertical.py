"""The vertical plane: SUBOFF as measured, REMUS by hand, drawn vehicles, elevators, options."""

import numpy as np
import pytest
from ase_vehicles import changed, fins, load

from auvident.physics.ase.drag import cylinder_drag, finite_length_factor
from auvident.schema.coefficients import COEFFICIENTS, V
from auvident.stages.ase import estimate
from tests.bench.geometry import BAR, MIRRORED, WHY, errors, of_kinds, prime, rms
from tests.bench.published import LENGTH_PP, SUBOFF, SUBOFF_KINDS, VERTICAL

DRAWN = 40  # even seeds
REMUS_AREA = {"root_chord_m": 0.09383, "tip_chord_m": 0.06137}  # see test_ase_remus
ALONE = {"incidence_interference": "none", "deflection_interference": "none"}


def suboff(kinds=SUBOFF_KINDS, **ase):
    """Prime values and deviations of a configuration."""
    return prime(estimate(changed(of_kinds(load("suboff"), kinds), ase=ase)), LENGTH_PP)


# Estimate over measurement of the fully appended model (1): the known bias of the formulas, and
# on either side what the tests leave open (4-5 % static, 10 % rotary and control, 7 % added mass).
RATIOS = {
    "Z_uw": (1.55, 1.90),  # planes in the wake: their increment 3.6 times what (5) less (3) has
    "M_uw": (0.45, 0.70),  # hull +2 %, less the moment of the same planes
    "Z_uq": (0.75, 1.05),  # planes too strong against a hull without lift by rate
    "M_uq": (0.75, 1.00),
    "Z_wdot": (1.20, 1.40),  # strips of a finite body: 20 to 25 % (theory 2.2), and the planes'
    "M_wdot": (0.50, 0.85),  # of the size, a difference of large strips fore and aft
    "Z_qdot": (0.50, 0.75),
    "M_qdot": (1.25, 1.55),  # 21 % of the hull's strips, as much again of planes with A = 1.8
    "Z_uud": (1.75, 2.25),  # theory 8.1: 1.9 with K_W(B), 1.5 without
    "M_uud": (1.75, 2.25),
}


@pytest.mark.parametrize("symbol", VERTICAL)
def test_suboff_is_off_by_what_is_known_of_the_formulas(symbol):
    low, high = RATIOS[symbol]
    assert low < suboff()[symbol][0] / VERTICAL[symbol] < high, WHY[symbol]


@pytest.mark.parametrize(("name", "kinds", "measured"), SUBOFF, ids=[row[0] for row in SUBOFF])
def test_suboff_lies_within_two_deviations(name, kinds, measured):
    found = suboff(kinds)
    for symbol, value in measured.items():
        assert abs(found[symbol][0] - value) < 2.0 * found[symbol][1], symbol


def test_deviations_on_suboff_are_neither_boast_nor_shrug():
    square = []
    for _, kinds, measured in SUBOFF:
        found = suboff(kinds)
        square += [((found[s][0] - v) / found[s][1]) ** 2 for s, v in measured.items()]
    assert 0.3 < np.mean(square) < 2.0  # correlated errors: a wide band around 1


def test_alternatives_of_the_formulas_come_nearer_where_theory_says_so():
    """Theory 2.2 and 8.1: lengths that end, planes without carry-over on a tapered stern."""
    method, alone = suboff(), suboff(**ALONE)
    finite = suboff(finite_length=True)
    for symbol, better in {"Z_wdot": finite, "M_qdot": finite, "Z_uw": alone}.items():
        measured = VERTICAL[symbol]
        assert abs(better[symbol][0] - measured) < abs(method[symbol][0] - measured), symbol
    assert finite["M_qdot"][0] / VERTICAL["M_qdot"] == pytest.approx(1.14, abs=0.10)
    assert alone["Z_uud"][0] / VERTICAL["Z_uud"] == pytest.approx(1.5, abs=0.10)
    assert alone["Z_uw"][0] / VERTICAL["Z_uw"] == pytest.approx(1.13, abs=0.10)


# The recipe's own numbers of REMUS (theory 8.2), with the signs of the vertical plane.
RECIPE = {
    ("Z_uw", "hull"): -19.06,
    ("M_uw", "hull"): 17.30,
    ("X_ww", "hull"): 9.53,
    ("Z_w|w|", "hull"): -90.2,
    ("M_w|w|", "hull"): -90.2 * 0.01555,  # + D_c x_p, x_p aft of O
    ("Z_uw", "elevator"): -31.9,
    ("M_uw", "elevator"): 31.9 * -0.638,  # - x_E Z_uw
    ("Z_uq", "elevator"): 0.638 * -31.9,  # - x_E Z_uw
    ("M_uq", "elevator"): 0.638**2 * -31.9,  # x_E^2 Z_uw
    ("Z_uud", "elevator"): -23.0,
    ("M_uud", "elevator"): -14.7,
}


@pytest.mark.parametrize(("key", "value"), RECIPE.items())
def test_remus_by_hand(key, value):
    remus = load("remus")
    entries = fins(remus, "rudder", "elevator", **REMUS_AREA)
    row = estimate(changed(remus, fin=entries)).by_symbol()[key[0]]
    # the centroid of the planform, 1 mm either way, is what M_w|w| hangs on
    assert row.parts[key[1]] == pytest.approx(value, rel=0.01, abs=0.001 * 90.2)


def test_cross_flow_by_fineness_and_reynolds_number():
    """Jorgensen: eta of the fineness, C_dn of the flow across; Z_w|w| = -rho/2 eta C_dn A_p."""
    found = estimate(load("remus"))
    g = found.geometry
    assert finite_length_factor(np.array(g["fineness"])) == pytest.approx(0.645, abs=0.002)
    across = 1.54 * np.sin(np.radians(10.0)) * 0.191 / 1.19e-6
    assert g["crossflow_reynolds"] == pytest.approx(across)
    assert cylinder_drag(across) == pytest.approx(1.2)  # subcritical
    force = -0.5 * 1030.0 * 0.645 * 1.2 * 0.2265
    assert found.by_symbol()["Z_w|w|"].parts["hull"] == pytest.approx(force, rel=0.005)
    larger = estimate(load("suboff"))  # in the drag crisis, where the table falls to a quarter
    assert 2e5 < larger.geometry["crossflow_reynolds"] < 4e5
    assert 0.3 < larger.geometry["crossflow_cd"] < 1.1


@pytest.mark.parametrize("own", [own for own, _ in MIRRORED])
def test_deviations_on_drawn_vehicles(own):
    """Root mean square of error over deviation, on 40 even seeds.

    Half of the drawn vehicles have damping beside lift and strips, up to 0.7 of the lift at a
    drift of 0.15, in any mixture of orders: no drawing shows it, so the cross-flow of the others
    counts. The hull of the generator is pulled back by incidence, that of the method forward
    (suction), as X_vv of published submarine models is: 1.5 deviations, in both planes alike.
    """
    z = errors(DRAWN)
    plain = z["damped"] == 0.0
    assert np.sum(plain) > 10
    found = rms(z[own][plain]) if own in ("Z_w|w|", "M_q|q|") else rms(z[own])
    assert found < (1.6 if own == "X_ww" else BAR)


def test_both_planes_are_as_uncertain_on_drawn_vehicles():
    """Sails aside, which stand in one plane only, the planes are images of each other."""
    z = errors(DRAWN)
    for own, other in MIRRORED:
        assert rms(z[own]) == pytest.approx(rms(z[other]), abs=0.25), own


@pytest.mark.parametrize("source", ["bare", "finned"])
def test_equalities_of_the_added_mass(source):
    """Kirchhoff (theory 2.3): X_wq = Z_wdot, X_qq = Z_qdot, Z_uq = -X_udot, M_uq = -Z_qdot.

    Of the hull alone, or with ``coriolis_added_mass = "finned"`` of the whole mass matrix.
    """
    rows = estimate(changed(load("remus"), ase={"coriolis_added_mass": source})).by_symbol()
    whole = source == "finned"
    used = {s: row.value if whole else row.parts.get("hull") for s, row in rows.items()}
    equal = {"X_wq": ("Z_wdot", 1), "X_qq": ("Z_qdot", 1), "Z_uq": ("X_udot", -1)}
    equal |= {"M_uq": ("Z_qdot", -1), "X_vr": ("Y_vdot", -1), "X_rr": ("Y_rdot", -1)}
    equal |= {"Y_ur": ("X_udot", 1), "N_ur": ("Y_rdot", 1)}
    for symbol, (mass, sign) in equal.items():
        assert rows[symbol].parts["hull"] == pytest.approx(sign * used[mass]), symbol


def test_bare_added_mass_is_the_default():
    remus = load("remus")
    assert remus.ase.coriolis_added_mass == "bare"
    stated = estimate(changed(remus, ase={"coriolis_added_mass": "bare"}))
    assert stated.by_symbol()["X_wq"] == estimate(remus).by_symbol()["X_wq"]


def test_sail_is_disregarded_but_for_its_drag():
    """As the method has it: in heave and pitch a sail is a plate edge on."""
    base = load("suboff")
    without = estimate(of_kinds(base, ("rudder", "elevator"))).by_symbol()
    for row in estimate(base).coefficients:
        if row.plane == "vertical":
            assert row.value == pytest.approx(without[row.symbol].value), row.symbol
            assert "sail" not in row.parts
    assert "sail" in estimate(base).by_symbol()["X_uu"].parts


def test_elevators_by_count_station_and_efficiency():
    remus = load("remus")

    def found(**update):
        entries = [*fins(remus, "rudder"), *fins(remus, "elevator", **update)]
        return estimate(changed(remus, fin=entries)).by_symbol()

    usual = found()
    half, foreplane = found(efficiency=0.5), found(x_m=0.35)
    assert half["Z_uud"].value == pytest.approx(0.5 * usual["Z_uud"].value)
    assert half["Z_wdot"].value == pytest.approx(usual["Z_wdot"].value)  # water is moved anyway
    assert foreplane["M_uud"].value > 0.0 > usual["M_uud"].value  # M = - x Z
    assert foreplane["M_uw"].parts["elevator"] > 0.0 > usual["M_uw"].parts["elevator"]
    four = found(count=4)
    for symbol in ("Z_uud", "Z_uw", "M_uq"):
        own = usual[symbol].parts["elevator"]
        assert four[symbol].parts["elevator"] == pytest.approx(2.0 * own), symbol
    for c in (c for c in COEFFICIENTS if c.planes != V and c.symbol not in ("X_uu", "X_uudd")):
        assert foreplane[c.symbol].value == pytest.approx(usual[c.symbol].value), c.symbol


def test_x_tail_acts_in_both_planes_alike():
    """Four planes at 45 degrees: half of the squares of four is that of two, in each plane."""
    remus = load("remus")
    x_tail = changed(remus, fin=fins(remus, "rudder", "elevator", dihedral_deg=45.0))
    turned, upright = estimate(x_tail).by_symbol(), estimate(remus).by_symbol()
    for symbol in ("Z_uw", "M_uw", "Z_uq", "M_uq", "Z_wdot", "M_qdot"):
        assert turned[symbol].value == pytest.approx(upright[symbol].value), symbol
    # either command moves all four, each with its cosine
    ratio = turned["Z_uud"].value / upright["Z_uud"].value
    assert ratio == pytest.approx(2.0 * np.cos(np.pi / 4))
