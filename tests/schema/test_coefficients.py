"""The table of coefficients is consistent with itself and with the dimensions of mechanics."""

import re
from fractions import Fraction

import pytest

from auvident.schema.coefficients import (
    BY_SYMBOL,
    COEFFICIENTS,
    CONSTANTS,
    ESTIMATED,
    PLANES,
    constants_of,
    expand,
    of_plane,
    prime_unit,
    symbols_of,
    unknown_names,
)

# dimensions as powers of (kg, m, s)
FORCE, MOMENT = (1, 1, -2), (1, 2, -2)
QUANTITIES = {"u": (0, 1, -1), "v": (0, 1, -1), "w": (0, 1, -1), "r": (0, 0, -1)}
QUANTITIES |= {"q": (0, 0, -1), "n": (0, 0, -1), "dr": (0, 0, 0), "de": (0, 0, 0)}
ACCELERATIONS = {f"d{x}/dt": (0, QUANTITIES[x][1], QUANTITIES[x][2] - 1) for x in "uvwrq"}
BASE = {"kg": 0, "m": 1, "s": 2}


def of_regressor(text: str) -> tuple[int, ...]:
    """Dimension of what a coefficient multiplies."""
    if text in ACCELERATIONS:
        return ACCELERATIONS[text]
    text = re.sub(r"\((.*?) \+ .*?\)", r"\1", text)  # both terms of a sum have the same one
    factors = [QUANTITIES[name] for name in re.findall(r"[a-z]+", text)]
    return tuple(sum(powers) for powers in zip(*factors, strict=True))


def of_unit(text: str) -> tuple[int, ...]:
    """Dimension of a unit such as ``kg m^2`` or ``kg/m``."""
    powers = [0, 0, 0]
    over, _, under = text.partition("/")
    for part, sign in ((over, 1), (under, -1)):
        for name, power in re.findall(r"(kg|m|s)(?:\^(\d))?", part):
            powers[BASE[name]] += sign * int(power or 1)
    return tuple(powers)


@pytest.mark.parametrize("c", COEFFICIENTS, ids=lambda c: c.symbol)
def test_unit_times_regressor_is_a_force_or_a_moment(c) -> None:
    whole = MOMENT if c.equation in ("N", "M") else FORCE
    product = tuple(a + b for a, b in zip(of_unit(c.unit), of_regressor(c.regressor), strict=True))
    assert product == whole


@pytest.mark.parametrize("c", COEFFICIENTS, ids=lambda c: c.symbol)
def test_the_prime_power_fits_the_unit(c) -> None:
    # density/2 * length^power is in kg m^(power - 3); speeds cancel against the regressor
    assert of_unit(c.unit) == (1, c.length_power - 3, 0)


@pytest.mark.parametrize("c", COEFFICIENTS, ids=lambda c: c.symbol)
def test_the_symbol_says_equation_and_regressor(c) -> None:
    axis, _, rest = c.symbol.partition("_")
    assert c.equation == ("X" if axis == "T" else axis)
    if c.symbol.endswith("dot"):
        assert c.regressor == f"d{rest[0]}/dt"
        assert c.group in ("inertia", "surge_inertia")
        return
    letters = rest.replace("|", "").replace("d", "")
    named = re.sub(r"\(.*\)|\bd[re]\b|[ |]", "", c.regressor)
    assert sorted(letters) == sorted(named)
    assert ("d" in rest) == bool(re.search(r"\bd[re]\b", c.regressor))


def test_symbols_are_unique_and_belong_to_the_plane_of_their_axis() -> None:
    assert len(BY_SYMBOL) == len(COEFFICIENTS)
    for c in COEFFICIENTS:
        states = set(re.findall(r"\b[a-z]\b", c.regressor))
        if c.equation in ("Y", "N") or states & {"v", "r"}:
            assert c.planes == ("horizontal",), c.symbol
        elif c.equation in ("Z", "M") or states & {"w", "q"}:
            assert c.planes == ("vertical",), c.symbol
        else:
            assert c.planes == PLANES, c.symbol


def test_the_planes_mirror_each_other() -> None:
    """The same groups, powers and units in the same order under v->w, r->q, Y->Z, N->M."""
    rows = {plane: [(c.group, c.length_power, c.unit) for c in of_plane(plane)] for plane in PLANES}
    assert sorted(rows["horizontal"]) == sorted(rows["vertical"])
    # theory 7.1 and 7.2 with the four inertia parameters of 1.3 spelled out as added masses
    assert len(symbols_of("horizontal")) == 8 + 14


def test_signs_that_mechanics_demands() -> None:
    """What dissipates or is an added mass of its own axis is negative."""
    demanded = ("X_udot", "Y_vdot", "Z_wdot", "N_rdot", "M_qdot", "X_uu", "Y_uv", "Z_uw", "N_ur")
    demanded += ("M_uq", "Y_v|v|", "Z_w|w|", "N_r|r|", "M_q|q|", "X_uudd", "T_nu")
    assert {BY_SYMBOL[s].sign for s in demanded} == {-1}
    # right-hand rule of the control angles, theory 0
    found = [BY_SYMBOL[s].sign for s in ("Y_uud", "N_uud", "Z_uud", "M_uud", "T_nn")]
    assert found == [+1, -1, -1, -1, +1]


@pytest.mark.parametrize("plane", PLANES)
def test_expand(plane) -> None:
    own = (*symbols_of(plane), *constants_of(plane))
    assert expand(["all"], plane) == own
    assert expand([], plane) == ()
    parts = {c.group: expand([c.group], plane) for c in ESTIMATED.values()}
    assert sorted(s for part in parts.values() for s in part) == sorted(own)
    # each group has coefficients in each plane; weight and buoyancy act in the vertical one alone
    assert {group for group, part in parts.items() if not part} <= {"restoring"}
    # in the order of the table and each once, whatever the order of the names
    assert expand(["thrust", "drag", "X_uu"], plane) == ("X_uu", "T_nn", "T_nu")


def test_constants_are_forces_and_moments_of_the_vertical_plane() -> None:
    assert constants_of("horizontal") == ()
    assert constants_of("vertical") == ("W-B", "x_GW", "z_GW") == expand(["restoring"], "vertical")
    units = {"Z": "N", "M": "N m"}
    assert [c.unit for c in CONSTANTS] == [units[c.equation] for c in CONSTANTS]
    assert expand(["z_GW", "Z_uw"], "vertical") == ("Z_uw", "z_GW")
    assert unknown_names(["W-B", "restoring"]) == []


def test_expand_leaves_out_the_other_plane() -> None:
    assert expand(["Y_uv", "Z_uw"], "vertical") == ("Z_uw",)


def test_unknown_names_are_found_in_their_order() -> None:
    names = ["lift", "Y_uvv", "all", "X_uu", "y_uv"]
    assert unknown_names(names) == ["Y_uvv", "y_uv"]


def test_prime_unit_is_half_density_times_a_power_of_length() -> None:
    assert prime_unit("N_rdot", 1025.0, 2.0) == pytest.approx(0.5 * 1025.0 * 32.0)
    # SUBOFF (Roddy 1990): Y_uv = density/2 L^2 Y_v', N_uv = density/2 L^3 N_v'
    length = Fraction(426086, 100000)
    assert prime_unit("Y_uv", 1000.0, float(length)) == pytest.approx(500 * float(length**2))
    assert prime_unit("N_uv", 1000.0, float(length)) == pytest.approx(500 * float(length**3))
