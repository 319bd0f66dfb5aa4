"""What physics knows of the coefficients, against matrices and powers written out by hand."""

import numpy as np
import pytest

from auvident.constants import GRAVITY_MPS2
from auvident.physics.consistency import (
    CONSTRAINTS,
    MASS_LEFT,
    Basis,
    constraints_of,
    hull_power,
)
from auvident.physics.terms import structure_of
from auvident.schema.coefficients import BY_SYMBOL
from auvident.schema.effects import in_plane
from auvident.schema.planes import BY_PLANE, PLANES
from tests.engines.chain import setup_of

SAMPLES = (("harbour_trial", "horizontal"), ("bay_trial", "horizontal"), ("dive_trial", "vertical"))


def drawn(setup, seed: int) -> np.ndarray:
    """Coefficients anywhere within some of their own size."""
    rng, p = np.random.default_rng(seed), setup.prior.copy()
    coefficients = np.array([name in BY_SYMBOL for name in setup.structure.parameters])
    p[coefficients] *= 1.0 + rng.normal(size=coefficients.sum())
    return p


def value_of(setup, p: np.ndarray, name: str) -> float:
    value, _ = setup.constraints(p)
    return min(g for g, row in zip(value, setup.constraints.ids, strict=True) if row == name)


@pytest.mark.parametrize(("sample", "plane"), SAMPLES)
@pytest.mark.parametrize("seed", range(10))
def test_masses_against_eigenvalues_written_out(sample, plane, seed) -> None:
    setup = setup_of(sample, plane)
    p = drawn(setup, seed)
    row, name = BY_PLANE[plane], setup.structure.index
    (_, y, n), (_, v, r) = row.axes, row.velocities
    m, inertia = p[name("m")], p[name("I")]
    cross = 0.5 * (p[name(f"{y}_{r}dot")] + p[name(f"{n}_{v}dot")]) / np.sqrt(m * inertia)
    added = -np.array(
        [[p[name(f"{y}_{v}dot")] / m, cross], [cross, p[name(f"{n}_{r}dot")] / inertia]]
    )
    assert value_of(setup, p, "lateral_added_mass") == pytest.approx(
        np.linalg.eigvalsh(added)[0], abs=1e-12
    )
    assert value_of(setup, p, "surge_added_mass") == pytest.approx(-p[name("X_udot")] / m)
    rigid = np.eye(3)
    rigid[1, 2] = rigid[2, 1] = row.sigma * p[name("m x_G")] / np.sqrt(m * inertia)
    if plane == "vertical":
        rigid[0, 2] = rigid[2, 0] = p[name("z_GW")] / GRAVITY_MPS2 / np.sqrt(m * inertia)
    whole = rigid.copy()
    whole[0, 0] -= p[name("X_udot")] / m
    whole[1:, 1:] += added
    expected = np.linalg.eigvalsh(whole)[0] - MASS_LEFT * np.linalg.eigvalsh(rigid)[0]
    assert value_of(setup, p, "total_mass") == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(("sample", "plane"), SAMPLES)
def test_slopes_are_those_of_differences(sample, plane) -> None:
    setup = setup_of(sample, plane)
    p = drawn(setup, 3)
    _, slopes = setup.constraints(p)
    for k in range(len(p)):
        step = np.zeros(len(p))
        step[k] = 1e-6 * max(abs(p[k]), 1e-3)
        up, down = (setup.constraints(p + sign * step)[0] for sign in (1.0, -1.0))
        # second order of the eigenvalues, rounding of the differences
        np.testing.assert_allclose(
            (up - down) / (2.0 * step[k]), slopes[:, k], atol=1e-7 * np.abs(slopes).max()
        )


@pytest.mark.parametrize(("sample", "plane"), SAMPLES)
def test_every_constraint_is_concave(sample, plane) -> None:
    setup = setup_of(sample, plane)
    for seed in range(20):
        p, q = drawn(setup, seed), drawn(setup, 100 + seed)
        ends = 0.5 * (setup.constraints(p)[0] + setup.constraints(q)[0])
        assert (setup.constraints(0.5 * (p + q))[0] >= ends - 1e-12).all()


@pytest.mark.parametrize(("sample", "plane"), SAMPLES)
def test_the_estimate_keeps_every_constraint(sample, plane) -> None:
    setup = setup_of(sample, plane)
    assert set(setup.constraints.ids) == {row.id for row in CONSTRAINTS}
    assert (setup.constraints(setup.prior)[0] > 0.0).all()


def test_power_of_the_hull_written_out() -> None:
    structure, rng = structure_of("horizontal"), np.random.default_rng(1)
    for _ in range(20):
        u, v, r = rng.normal(size=3)
        p = rng.normal(size=len(structure.parameters))
        c = dict(zip(structure.parameters, p, strict=True))
        x = c["X_uu"] * u * abs(u) + c["X_vv"] * v**2 + c["X_vr"] * v * r + c["X_rr"] * r**2
        y = (
            c["Y_uv"] * u * v
            + c["Y_ur"] * u * r
            + c["Y_v|v|"] * v * abs(v)
            + c["Y_r|r|"] * r * abs(r)
        )
        n = (
            c["N_uv"] * u * v
            + c["N_ur"] * u * r
            + c["N_v|v|"] * v * abs(v)
            + c["N_r|r|"] * r * abs(r)
        )
        power = hull_power(structure, np.array([u, v, r])) @ p
        assert power == pytest.approx(u * x + v * y + r * n, abs=1e-12)


@pytest.mark.parametrize("plane", PLANES)
def test_the_forces_of_the_added_masses_at_constant_velocity_do_no_work(plane) -> None:
    # -C(nu) nu of Fossen 2011, (6.43) with the added masses; the vertical plane turns the sign
    structure, rng, s = structure_of(plane), np.random.default_rng(2), BY_PLANE[plane].sigma
    (_, y, n), (_, v, r) = BY_PLANE[plane].axes, BY_PLANE[plane].velocities
    x_udot, y_vdot, y_rdot = -rng.uniform(1.0, 5.0, 3)
    p = np.zeros(len(structure.parameters))
    for name, value in {
        f"X_{v}{r}": -s * y_vdot,
        f"X_{r}{r}": -s * y_rdot,
        f"{y}_u{r}": s * x_udot,
        f"{n}_u{v}": s * (y_vdot - x_udot),
        f"{n}_u{r}": s * y_rdot,
    }.items():
        p[structure.index(name)] = value
    for state in rng.normal(size=(20, 3)):
        size = np.abs(hull_power(structure, state)) @ np.abs(p)
        assert hull_power(structure, state) @ p == pytest.approx(0.0, abs=1e-12 * size)


def test_neither_propeller_nor_fin_nor_body_is_damping_of_the_hull() -> None:
    structure = structure_of("horizontal", tuple(e.id for e in in_plane("horizontal")))
    power = hull_power(structure, np.array([1.5, 0.2, -0.3]))
    counted = {structure.parameters[i] for i in np.flatnonzero(power)}
    assert {"X_uu", "Y_uv", "N_ur", "linear_drag.X_u", "yaw_cross_flow.N_v|r|"} <= counted
    foreign = (
        "T_nn",
        "T_nu",
        "X_uudd",
        "Y_uud",
        "m",
        "m x_G",
        "hull_asymmetry.Y_0",
        "roll_coupling.Y_uuphi",
    )
    assert not counted & set(foreign)


def basis(setup, **changes) -> Basis:
    p = setup.prior.copy()
    for symbol, value in changes.items():
        p[setup.structure.index(symbol)] = value
    return Basis(setup.structure, p, setup.prior_std, np.array([[1.5, 0.0, 0.0]]))


def test_coefficients_given_against_a_constraint_are_taken_at_their_word() -> None:
    setup = setup_of()
    assert "lateral_added_mass" not in constraints_of(basis(setup, N_rdot=+10.0)).ids
    assert "lateral_added_mass" in constraints_of(basis(setup, N_rdot=-10.0)).ids


def test_a_fin_of_which_the_estimate_is_not_sure_may_push_either_way() -> None:
    setup = setup_of()
    std = setup.prior_std[setup.structure.index("Y_uud")]
    assert "fin_force" in constraints_of(basis(setup, Y_uud=2.1 * std)).ids
    assert "fin_force" not in constraints_of(basis(setup, Y_uud=1.9 * std)).ids


def test_the_table_says_all_of_each_row_once() -> None:
    assert len({row.id for row in CONSTRAINTS}) == len(CONSTRAINTS)
    for row in CONSTRAINTS:
        assert row.quantity and row.source and row.asks and row.lacks and row.planes
