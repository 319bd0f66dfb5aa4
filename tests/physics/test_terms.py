"""The table of terms: complete, without strangers, and each term what the schema declares."""

import math
import re

import numpy as np
import pytest

from auvident.physics.terms import (
    CONSTANTS,
    HYDRODYNAMIC,
    MASS,
    RACE,
    RACE_DAMPING,
    SIGMA,
    parameter_vector,
    structure_of,
    symbol_in,
)
from auvident.schema.artifacts import RigidBody
from auvident.schema.coefficients import BY_SYMBOL, PLANES, symbols_of
from tests.physics.right_hand_side import right_hand_side

ALL = np.ones(4, dtype=bool)
STATE = {"u": 1.7, "a": -0.31, "b": 0.23}
INPUTS = {"own": 0.19, "other": -0.07, "n": 14.0}


def regressor_value(symbol: str, plane: str) -> float:
    """What the schema says a coefficient multiplies, evaluated at `STATE` and `INPUTS`."""
    a, b = ("v", "r") if plane == "horizontal" else ("w", "q")
    own, other = ("dr", "de") if plane == "horizontal" else ("de", "dr")
    values = {"u": STATE["u"], a: STATE["a"], b: STATE["b"], "n": INPUTS["n"]}
    values |= {own: INPUTS["own"], other: INPUTS["other"]}
    text = re.sub(r"\|(\w+)\|", r" abs(\1) ", BY_SYMBOL[symbol].regressor)
    text = re.sub(r"(?<=[\w)]) +(?=[\w(])(?<!abs )", " * ", " ".join(text.split()))
    return float(eval(text, {"abs": abs}, values))


def test_the_evaluation_of_a_regressor_is_right_itself() -> None:
    assert regressor_value("X_uu", "horizontal") == pytest.approx(1.7 * 1.7)
    assert regressor_value("T_nu", "vertical") == pytest.approx(14.0 * 1.7)
    assert regressor_value("X_uudd", "horizontal") == pytest.approx(1.7**2 * (0.19**2 + 0.07**2))


@pytest.mark.parametrize("plane", PLANES)
def test_every_coefficient_of_the_plane_occurs_and_no_other(plane) -> None:
    in_terms = {symbol_in(plane, generic) for _, generic, *_ in HYDRODYNAMIC}
    in_mass = {symbol_in(plane, name) for *_, name, _ in MASS if name not in CONSTANTS}
    assert in_terms | in_mass == set(symbols_of(plane))
    assert not in_terms & in_mass
    assert all(symbol.endswith("dot") for symbol in in_mass)
    assert not any(symbol.endswith("dot") for symbol in in_terms)


@pytest.mark.parametrize("plane", PLANES)
def test_arrays_use_every_parameter(plane) -> None:
    structure = structure_of(plane)
    used = set(structure.terms[:, 1].tolist()) | set(structure.mass[:, 2].tolist())
    unused = {structure.parameters[i] for i in set(range(len(structure.parameters))) - used}
    # the horizontal plane has no restoring force and y_G = 0: these constants have no place in it
    expected = {"W-B", "z_GW", "x_GW"} if plane == "horizontal" else set()
    expected |= {"x_fin"}  # which the race needs, in the inputs
    assert unused == expected
    assert len(structure.terms) == len(structure.weights)
    assert len(structure.mass) == len(structure.mass_weights)


@pytest.mark.parametrize(
    ("plane", "symbol"),
    [(p, s) for p in PLANES for s in symbols_of(p) if not s.endswith("dot")],
)
def test_each_term_is_the_product_the_schema_declares(plane, symbol) -> None:
    structure = structure_of(plane)
    p = np.zeros(len(structure.parameters))
    p[structure.index(symbol)] = 1.0
    x, inputs = np.array([*STATE.values(), 0.4]), np.array(list(INPUTS.values()))
    rate = right_hand_side(structure, ALL, x, inputs, p, np.eye(3))
    expected = np.zeros(3)
    equation = {"X": 0, "Y": 1, "Z": 1, "N": 2, "M": 2}[BY_SYMBOL[symbol].equation]
    expected[equation] = regressor_value(symbol, plane)
    np.testing.assert_allclose(rate[:3], expected, rtol=1e-14)  # three products: rounding only


@pytest.mark.parametrize(
    ("plane", "generic", "symbol"),
    [
        ("horizontal", "B_ua", "N_uv"),
        ("horizontal", "A_b|b|", "Y_r|r|"),
        ("horizontal", "B_adot", "N_vdot"),
        ("horizontal", "X_uudd", "X_uudd"),
        ("vertical", "A_bdot", "Z_qdot"),
        ("vertical", "X_ab", "X_wq"),
        ("vertical", "B_uud", "M_uud"),
        ("vertical", "T_nu", "T_nu"),
    ],
)
def test_symbols_of_a_plane(plane, generic, symbol) -> None:
    assert symbol_in(plane, generic) == symbol


def test_parameter_vector_has_coefficients_then_constants() -> None:
    body = RigidBody(
        mass_kg=30.0,
        x_g_m=0.1,
        z_g_m=0.02,
        inertia_kgm2=3.0,
        weight_n=300.0,
        buoyancy_n=306.0,
        fin_x_m=-0.7,
    )
    structure = structure_of("vertical")
    p = parameter_vector("vertical", {"M_uq": -4.0}, body)
    found = dict(zip(structure.parameters, p, strict=True))
    assert found.pop("M_uq") == -4.0
    constants = {"m": 30.0, "m x_G": 3.0, "I": 3.0, "x_fin": -0.7, "W-B": -6.0}
    constants |= {"z_GW": 6.0, "x_GW": 0.0}
    assert {name: found.pop(name) for name in CONSTANTS} == pytest.approx(constants)
    assert set(found.values()) == {0.0}  # what is not given counts as zero


def test_an_identified_constant_takes_the_place_of_the_vehicle_files() -> None:
    body = RigidBody(
        mass_kg=30.0, x_g_m=0.1, z_g_m=0.02, inertia_kgm2=3.0, weight_n=300.0, buoyancy_n=306.0
    )
    p = parameter_vector("vertical", {"W-B": -1.0, "x_GW": 0.2}, body)
    found = dict(zip(structure_of("vertical").parameters, p, strict=True))
    assert [found[s] for s in ("W-B", "x_GW", "z_GW")] == [-1.0, 0.2, pytest.approx(6.0)]


@pytest.mark.parametrize("plane", PLANES)
def test_a_fin_in_the_race_lifts_as_in_a_faster_flow(plane) -> None:
    """Molland and Turnock (2007), 3.6: at (V, angle of the flow) for what it does at (u, ...)."""
    structure, sigma = structure_of(plane, (RACE,)), SIGMA[plane]
    x, inputs, u, d, x_fin, c_t = (
        np.array([*STATE.values(), 0.4]),
        np.zeros(15),
        1.7,
        0.19,
        -0.8,
        2.1,
    )
    p = np.zeros(len(structure.parameters))
    coefficients = {"X": ("X_uudd", -7.0), "A": ("A_uud", 9.0 * sigma), "B": ("B_uud", -7.2)}
    for generic, value in coefficients.values():
        p[structure.index(symbol_in(plane, generic))] = value
    flow = math.sqrt(u**2 + c_t)
    inputs[0], inputs[6:9] = d, (c_t, flow - u, x_fin * (flow - u))
    found = right_hand_side(structure, ALL, x, inputs, p, np.eye(3))[:3]
    side = STATE["a"] + sigma * x_fin * STATE["b"]  # v + x r, w - x q

    def lift(speed: float) -> float:
        return speed**2 * d - sigma * RACE_DAMPING * speed * side

    more = lift(flow) - lift(u) + u**2 * d  # without the race, the damping is that of A_ua, A_ub
    np.testing.assert_allclose(found[1:], [9.0 * sigma * more, -7.2 * more], rtol=1e-12)
    np.testing.assert_allclose(found[0], -7.0 * flow**2 * d**2, rtol=1e-12)
