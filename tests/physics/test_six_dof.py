"""Six degrees of freedom against the planes, and against Kirchhoff's equations from matrices."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from auvident.constants import GRAVITY_MPS2
from auvident.errors import NumericsError
from auvident.physics.ase.assembly import MIRROR
from auvident.physics.batch import inverse_mass
from auvident.physics.dynamics import simulate_states
from auvident.physics.six_dof import (
    angles_of,
    mass_matrix,
    quaternion,
    rates_six_dof,
    simulate_six_dof,
    state_of,
    system_of,
)
from auvident.physics.six_dof_terms import (
    AXES,
    DRAG_OF,
    FIN_DRAG,
    ROLL,
    ROLL_MASS,
    ROLL_UNITS,
    VELOCITIES,
    six_dof_structure,
    whole_name,
    whole_names,
)
from auvident.physics.terms import RACE, structure_of
from auvident.schema.coefficients import BY_SYMBOL, PLANES
from auvident.schema.effects import in_plane
from auvident.schema.planes import BY_PLANE
from auvident.schema.unexplained import NAME
from tests.physics.plane_equations import random_values, stable_values
from tests.physics.right_hand_side import right_hand_side
from tests.processor_time import least_of_three

WHOLE = six_dof_structure()
# fins at rest, propeller stopped, thrust as it is
STILL = np.array([0.0, 0.0, 0.0, 1.0])


def planar_values(plane: str, rng: np.random.Generator) -> dict[str, float]:
    """Coefficients and constants of a plane under the names of its equations."""
    symbols = [s for s in structure_of(plane).parameters if s in BY_SYMBOL]
    return random_values(plane, symbols, rng)


def whole_values(planar: dict[str, dict[str, float]], **more: float) -> dict[str, float]:
    """Values of both planes in one vehicle; where they share a name, those of the last."""
    values = {}
    for plane, own in planar.items():
        values |= {whole_name(plane, name): v for name, v in own.items()}
    return values | {"I_xx": 0.4, **more}


def case(
    plane: str, seed: int
) -> tuple[dict[str, float], dict[str, float], np.ndarray, np.ndarray]:
    """Values of a plane and of a whole vehicle that has them, a state and the inputs."""
    rng = np.random.default_rng(seed)
    other = next(p for p in PLANES if p != plane)
    own = planar_values(plane, rng)
    roll = {s: float(rng.uniform(-3.0, 0.0)) for s in ROLL_UNITS if s != "I_xx"}
    values = whole_values({other: planar_values(other, rng), plane: own}, **roll)
    return (
        own,
        values,
        rng.normal(size=4) * [1.5, 0.5, 0.5, 1.0],
        rng.normal(size=3) * [0.3, 0.3, 15],
    )


def planar_rates(plane: str, values: dict[str, float], x: np.ndarray, inputs: np.ndarray):
    structure, inverse = structure_of(plane), np.empty((3, 3))
    p = np.array([values.get(name, 0.0) for name in structure.parameters])
    active = np.ones(4, dtype=bool)
    inverse_mass(p, structure.mass, structure.mass_weights, active, inverse)
    return right_hand_side(structure, active, x, np.concatenate([inputs, np.zeros(6)]), p, inverse)


def in_the_plane(plane: str, x: np.ndarray, inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """State and inputs of the whole vehicle that moves in a plane."""
    row = BY_PLANE[plane]
    velocities = np.zeros(6)
    velocities[[VELOCITIES.index(name) for name in row.velocities]] = x[:3]
    angles = (0.0, 0.0, x[3]) if plane == "horizontal" else (0.0, x[3], 0.0)
    own, other = (0, 1) if row.fin == "rudder" else (1, 0)
    acting = np.array([0.0, 0.0, inputs[2], 1.0])
    acting[own], acting[other] = inputs[0], inputs[1]
    return state_of(velocities, np.array(angles)), acting


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("plane", PLANES)
def test_a_plane_is_the_restriction_of_the_whole(plane: str, seed: int) -> None:
    own, values, x, inputs = case(plane, seed)
    inputs[1] = 0.0  # the other fin is at rest
    state, acting = in_the_plane(plane, x, inputs)
    velocities = BY_PLANE[plane].velocities
    system = system_of(WHOLE, WHOLE.vector(values), velocities)
    rates = rates_six_dof(state, acting, system)
    moving = [VELOCITIES.index(name) for name in velocities]
    planar = planar_rates(plane, own, x, inputs)
    # rounding of sums of some ten thousand newtons
    np.testing.assert_allclose(rates[moving], planar[:3], rtol=1e-12, atol=1e-11)
    assert not np.delete(rates[:6], moving).any()


@pytest.mark.parametrize("plane", PLANES)
def test_a_fin_of_the_other_plane_has_the_drag_that_its_own_plane_says(plane: str) -> None:
    own, values, x, inputs = case(plane, 3)
    state, acting = in_the_plane(plane, x, inputs)
    velocities = BY_PLANE[plane].velocities
    system = system_of(WHOLE, WHOLE.vector(values), velocities)
    moving = [VELOCITIES.index(name) for name in velocities]
    away = rates_six_dof(state, acting, system)[moving] - planar_rates(plane, own, x, inputs)[:3]
    mass = mass_matrix(WHOLE, WHOLE.vector(values))[np.ix_(moving, moving)]
    drag = values[DRAG_OF[BY_PLANE[plane].fins[1]]] - own[FIN_DRAG]
    assert drag != 0.0
    expected = [drag * x[0] ** 2 * inputs[1] ** 2, 0.0, 0.0]
    np.testing.assert_allclose(mass @ away, expected, rtol=1e-9, atol=1e-9)


def added(values: dict[str, float]) -> np.ndarray:
    """Added mass matrix (6, 6) from its symbols, as the textbooks print it."""
    c = {**dict.fromkeys(("Y_pdot", "N_pdot"), 0.0), **values}
    matrix = np.diag([-c[s] for s in ("X_udot", "Y_vdot", "Z_wdot", "K_pdot", "M_qdot", "N_rdot")])
    for i, j, symbol in ((1, 5, "Y_rdot"), (2, 4, "Z_qdot"), (1, 3, "Y_pdot"), (3, 5, "N_pdot")):
        matrix[i, j] = matrix[j, i] = -c[symbol]
    return matrix


def skew(a: np.ndarray) -> np.ndarray:
    return np.array([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def rigid(m: float, x_g: float, z_g: float, inertia: tuple[float, float, float]) -> np.ndarray:
    """Rigid-body mass matrix (Fossen 2011, eq. 3.44)."""
    arm = skew(np.array([x_g, 0.0, z_g]))
    return np.block([[m * np.eye(3), -m * arm], [m * arm, np.diag(inertia)]])


def coriolis(mass: np.ndarray, nu: np.ndarray) -> np.ndarray:
    """C(nu) nu in the standard skew form (Fossen 2011, eq. 3.46)."""
    momentum = mass @ nu
    first, second = skew(momentum[:3]), skew(momentum[3:])
    return np.block([[np.zeros((3, 3)), -first], [-first, -second]]) @ nu


def weight(values: dict[str, float], roll: float, pitch: float) -> np.ndarray:
    """Forces and moments of weight and buoyancy (Fossen 2011, eq. 4.6), buoyancy at O."""
    down = np.array([-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)])
    arm = np.array([values["x_GW"], 0.0, values["z_GW"]])  # times the weight
    return np.concatenate([values["W-B"] * down, np.cross(arm, down)])


def ideal_vehicle(seed: int, restoring: bool) -> tuple[dict[str, float], np.ndarray]:
    """A vehicle in an ideal fluid: its planar coefficients are those of Kirchhoff's equations.

    Without restoring the centre of gravity lies on the axis.
    """
    rng = np.random.default_rng(seed)
    m, x_g, z_g = 40.0, rng.uniform(-0.1, 0.1), rng.uniform(0.0, 0.05) * restoring
    inertia = rng.uniform([0.4, 3.0, 3.0], [1.0, 6.0, 6.0])
    symbols = ("X_udot", "Y_vdot", "Z_wdot", "K_pdot", "M_qdot", "N_rdot")
    values = dict(zip(symbols, -rng.uniform(0.2, 1.0, 6) * [3, 40, 45, 0.5, 6, 5], strict=True))
    cross = ("Y_rdot", "Z_qdot", "Y_pdot", "N_pdot")
    values |= dict(zip(cross, rng.uniform(-0.5, 0.5, 4), strict=True))
    values |= {"N_vdot": values["Y_rdot"], "M_wdot": values["Z_qdot"]}
    values |= {"X_vr": -values["Y_vdot"], "X_rr": -values["Y_rdot"], "Y_ur": values["X_udot"]}
    values |= {"N_ur": values["Y_rdot"], "N_uv": values["Y_vdot"] - values["X_udot"]}
    values |= {"X_wq": values["Z_wdot"], "X_qq": values["Z_qdot"], "Z_uq": -values["X_udot"]}
    values |= {
        "N_up": values["Y_pdot"],
        "M_uq": -values["Z_qdot"],
        "M_uw": values["X_udot"] - values["Z_wdot"],
    }
    constants = {"m": m, "m x_G": m * x_g}
    constants |= dict(zip(("I_xx", "I_yy", "I_zz"), inertia, strict=True))
    constants |= {"z_GW": m * GRAVITY_MPS2 * z_g}
    if restoring:
        constants |= {"W-B": -2.0, "x_GW": m * GRAVITY_MPS2 * x_g}
    mass = rigid(m, x_g, z_g, tuple(inertia)) + added(values)
    return values | constants, mass


@pytest.mark.parametrize("seed", range(20))
def test_it_is_kirchhoffs_equations_from_matrices(seed: int) -> None:
    values, mass = ideal_vehicle(seed, restoring=True)
    rng = np.random.default_rng(100 + seed)
    nu, angles = rng.normal(size=6) * [2, 1, 1, 1, 1, 1], rng.uniform(-1.2, 1.2, 3)
    p = WHOLE.vector(values)
    rates = rates_six_dof(state_of(nu, angles), STILL, system_of(WHOLE, p))
    np.testing.assert_allclose(mass_matrix(WHOLE, p), mass, rtol=1e-14, atol=1e-14)
    expected = np.linalg.solve(mass, weight(values, *angles[:2]) - coriolis(mass, nu))
    np.testing.assert_allclose(rates[:6], expected, rtol=1e-11, atol=1e-11)


def rotation(attitude: np.ndarray) -> np.ndarray:
    """Body to north-east-down from Euler angles (Fossen 2011, eq. 2.18)."""
    (roll, pitch, heading) = angles_of(attitude)[0]
    (cr, cp, ch), (sr, sp, sh) = np.cos([roll, pitch, heading]), np.sin([roll, pitch, heading])
    return np.array(
        [
            [ch * cp, ch * sp * sr - sh * cr, ch * sp * cr + sh * sr],
            [sh * cp, sh * sp * sr + ch * cr, sh * sp * cr - ch * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def test_an_ideal_fluid_takes_neither_energy_nor_momentum() -> None:
    values, mass = ideal_vehicle(7, restoring=False)
    start = state_of(np.array([1.5, 0.4, -0.3, 0.5, -0.2, 0.6]), np.array([0.2, -0.4, 1.0]))
    states = simulate_six_dof(
        start, np.tile(STILL, (2001, 1)), 0.005, system_of(WHOLE, WHOLE.vector(values))
    )
    energy = np.einsum("ni,ij,nj->n", states[:, :6], mass, states[:, :6])
    np.testing.assert_allclose(energy, energy[0], rtol=1e-8)
    for state in states[::200]:
        turned, momentum = rotation(state[6:10]), mass @ state[:6]
        linear = turned @ momentum[:3]
        angular = turned @ momentum[3:] + np.cross(state[10:], linear)
        first = mass @ states[0, :6]
        turned_0 = rotation(states[0, 6:10])
        np.testing.assert_allclose(linear, turned_0 @ first[:3], atol=1e-6)
        np.testing.assert_allclose(angular, turned_0 @ first[3:], atol=1e-5)


def turned_about_x(vector: np.ndarray, angle: float) -> np.ndarray:
    """Components (6,) in axes turned about x."""
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[1, 0, 0], [0, c, s], [0, -s, c]])
    return np.concatenate([turn @ vector[:3], turn @ vector[3:]])


@pytest.mark.parametrize("seed", range(5))
def test_a_body_of_revolution_does_not_know_which_way_is_up(seed: int) -> None:
    values = stable_values("horizontal")
    for symbol, (mirrored, sign) in MIRROR.items():
        values[mirrored] = sign * values.get(symbol, 0.0)
    values |= {"I_xx": 0.5, "I_yy": values["I"], "I_zz": values["I"], "K_up": -0.4, "K_pdot": -0.1}
    system = system_of(WHOLE, WHOLE.vector(values))
    rng = np.random.default_rng(seed)
    nu, angle = rng.normal(size=6) * [1.5, 0.5, 0.5, 0.5, 0.5, 0.5], float(rng.uniform(-3, 3))
    inputs = np.array([0.0, 0.0, 15.0, 1.0])
    upright = rates_six_dof(state_of(nu, np.zeros(3)), inputs, system)[:6]
    turned = rates_six_dof(state_of(turned_about_x(nu, angle), np.zeros(3)), inputs, system)[:6]
    np.testing.assert_allclose(turned, turned_about_x(upright, angle), rtol=1e-11, atol=1e-11)


def flown(seconds: float, dt: float = 0.1) -> tuple[dict[str, float], np.ndarray, np.ndarray]:
    """A stable vehicle, its state and inputs of a turning dive."""
    values = whole_values({p: stable_values(p) for p in PLANES}, K_pdot=-0.07, K_up=-0.5)
    n = round(seconds / dt) + 1
    inputs = np.column_stack([np.full(n, 0.15), np.full(n, 0.05), np.full(n, 15.0), np.ones(n)])
    inputs[n // 2 :, :2] *= -1.0
    return values, state_of(np.array([1.5, 0, 0, 0, 0, 0]), np.zeros(3)), inputs


def test_the_simulation_agrees_with_scipy() -> None:
    values, start, inputs = flown(20.0)
    system = system_of(WHOLE, WHOLE.vector(values))
    states = simulate_six_dof(start, inputs, 0.1, system)
    x = start
    for k in (100, 200):
        solved = solve_ivp(
            lambda _, y, k=k: rates_six_dof(y, inputs[k - 100], system),
            (0.0, 10.0),
            x,
            rtol=1e-10,
            atol=1e-10,
        )
        x = solved.y[:, -1]
        # a step of RK4 in half a tenth of a second, where roll swings at 5 rad/s
        np.testing.assert_allclose(states[k, :10], x[:10], atol=2e-5)
    np.testing.assert_allclose(states[0], start)


@pytest.mark.parametrize("plane", PLANES)
def test_it_flies_a_plane_as_the_planar_simulation_does(plane: str) -> None:
    own = stable_values(plane)
    values = whole_values({p: stable_values(p) for p in PLANES} | {plane: own})
    row, rng = BY_PLANE[plane], np.random.default_rng(3)
    fin = rng.normal(size=200) * 0.1
    planar_inputs = np.column_stack([fin, np.zeros(200), np.full(200, 15.0)])
    x0 = np.array([1.4, 0.05, 0.02, 0.1])
    structure = structure_of(plane)
    p = np.array([own.get(name, 0.0) for name in structure.parameters])
    arguments = (np.zeros((200, 4)), 0.1, p, np.ones(4, dtype=bool), structure.equations)
    expected = simulate_states(x0, planar_inputs, *arguments)
    cases = [in_the_plane(plane, x0, inputs) for inputs in planar_inputs]
    system = system_of(WHOLE, WHOLE.vector(values), row.velocities)
    acting = np.array([inputs for _, inputs in cases])
    states = simulate_six_dof(cases[0][0], acting, 0.1, system, substeps=1)
    moving = [VELOCITIES.index(name) for name in row.velocities]
    # the pitch goes through a quaternion that a step leaves short of unit length
    np.testing.assert_allclose(states[:, moving], expected[:, :3], rtol=0, atol=1e-6)


def test_it_is_a_thousand_times_faster_than_the_vehicle() -> None:
    values, start, inputs = flown(600.0)
    system = system_of(WHOLE, WHOLE.vector(values))
    simulate_six_dof(start, inputs[:10], 0.1, system)
    assert np.isfinite(simulate_six_dof(start, inputs, 0.1, system)).all()
    best = least_of_three(lambda: simulate_six_dof(start, inputs, 0.1, system))
    assert 600.0 / best > 1000.0, f"{600.0 / best:.0f} times real time"


def test_angles_return_from_the_quaternion() -> None:
    angles = np.random.default_rng(5).uniform([-3, -1.5, -3], [3, 1.5, 3], (50, 3))
    back = np.array([angles_of(quaternion(*row))[0] for row in angles])
    np.testing.assert_allclose(back, angles, atol=1e-12)


def test_a_vehicle_that_runs_away_is_not_a_number_from_there() -> None:
    values, start, inputs = flown(20.0)
    states = simulate_six_dof(
        start, inputs, 0.1, system_of(WHOLE, WHOLE.vector(values | {"X_uu": 50.0}))
    )
    assert np.isfinite(states[0]).all()
    assert np.isnan(states[-1]).all()


def test_an_impossible_mass_matrix_is_refused() -> None:
    values, *_ = flown(1.0)
    with pytest.raises(NumericsError, match="positive definite"):
        system_of(WHOLE, WHOLE.vector(values | {"K_pdot": 10.0}))


def test_effects_of_a_plane_act_in_it_and_shared_ones_once() -> None:
    structure = six_dof_structure(("linear_drag", "hull_asymmetry"), ("linear_drag",))
    assert structure.parameters.count("linear_drag.X_u") == 1
    assert "horizontal hull_asymmetry.Y_0" in structure.parameters
    values, start, _ = flown(1.0)
    p = structure.vector(values | {"horizontal hull_asymmetry.Y_0": 3.0, "linear_drag.X_u": -2.0})
    with_both = rates_six_dof(start, STILL, system_of(structure, p, ("u", "v", "w")))
    plain = rates_six_dof(start, STILL, system_of(WHOLE, WHOLE.vector(values), ("u", "v", "w")))
    mass = mass_matrix(WHOLE, WHOLE.vector(values))
    force = mass[:3, :3] @ (with_both - plain)[:3]
    np.testing.assert_allclose(force, [-2.0 * 1.5, 3.0 * 1.5**2, 0.0], atol=1e-9)


@pytest.mark.parametrize("product", ["sin", "cos"])
@pytest.mark.parametrize(("symbol", "axis"), [("X", "X"), ("Y", "Y"), ("N", "N")])
def test_what_follows_the_heading_does_so_at_any_attitude(
    product: str, symbol: str, axis: str
) -> None:
    structure = six_dof_structure((NAME,))
    name = f"horizontal {NAME}.{symbol}_{product}"
    values, *_ = flown(1.0)
    mass, heading = mass_matrix(WHOLE, WHOLE.vector(values)), 2.0
    x = state_of(np.zeros(6), np.array([0.3, -0.5, heading]))
    plain = rates_six_dof(x, STILL, system_of(WHOLE, WHOLE.vector(values)))
    moved = rates_six_dof(x, STILL, system_of(structure, structure.vector(values | {name: 2.0})))
    expected = np.zeros(6)
    expected[AXES.index(axis)] = 2.0 * getattr(np, product)(heading)
    np.testing.assert_allclose(mass @ (moved - plain)[:6], expected, atol=1e-9)


def test_every_symbol_of_roll_has_a_unit() -> None:
    assert {row[1] for row in ROLL} | {entry[2] for entry in ROLL_MASS} == set(ROLL_UNITS)


def forced(plane: str) -> list[str]:
    """Effects of a plane that are forces; the weight in water stands in for the other plane."""
    found = []
    for effect in in_plane(plane):
        structure = structure_of(plane, (effect.id,))
        used = {structure.parameters[k] for k in structure.terms[:, 1]}
        if effect.id != "weight_excess" and any("." in name for name in used):
            found.append(effect.id)
    return found


@pytest.mark.parametrize(("plane", "effect"), [(p, e) for p in PLANES for e in forced(p)])
def test_an_effect_acts_on_the_whole_as_in_its_plane(plane: str, effect: str) -> None:
    own, values, x, inputs = case(plane, 5)
    rng, structure = np.random.default_rng(6), structure_of(plane, (effect,))
    internal = {n: float(rng.uniform(0.5, 2.0)) for n in structure.parameters if "." in n}
    thrust, changed, roll, depth = 7.0, 0.4, 0.3, 2.5
    pitch = x[3] if plane == "vertical" else 0.0
    acting = np.concatenate(
        [inputs, [1.0, thrust, changed, *np.zeros(3), roll, pitch, depth, *np.zeros(3)]]
    )
    inverse, active = np.empty((3, 3)), np.ones(4, dtype=bool)

    def planar(more: dict[str, float]) -> np.ndarray:
        p = np.array([(own | more).get(name, 0.0) for name in structure.parameters])
        inverse_mass(p, structure.mass, structure.mass_weights, active, inverse)
        return right_hand_side(structure, active, x, acting, p, inverse)[:3]

    velocities = BY_PLANE[plane].velocities
    moving = [VELOCITIES.index(name) for name in velocities]
    state, fins = in_the_plane(plane, x, inputs)
    heading = x[3] if plane == "horizontal" else 0.0
    rolled = roll if plane == "horizontal" else 0.0
    state = state_of(state[:6], np.array([rolled, pitch, heading]), np.array([0.0, 0.0, depth]))
    whole = six_dof_structure(*((effect,) if plane == p else () for p in PLANES))

    def together(more: dict[str, float]) -> np.ndarray:
        p = whole.vector(values | {whole_names(plane, (effect,))[n]: v for n, v in more.items()})
        acts = np.concatenate([fins, [thrust, changed]])
        return rates_six_dof(state, acts, system_of(whole, p, velocities))[moving]

    by_effect = planar(internal) - planar({})
    assert np.abs(by_effect).max() > 1e-3
    np.testing.assert_allclose(together(internal) - together({}), by_effect, rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize("plane", PLANES)
def test_the_race_acts_on_the_whole_as_in_its_plane(plane: str) -> None:
    own, values, x, inputs = case(plane, 7)
    inputs[1] = 0.0  # the other fin is at rest
    structure, row = structure_of(plane, (RACE,)), BY_PLANE[plane]
    race = np.array([0.8, 0.21, -0.17])
    p = np.array([own.get(name, 0.0) for name in structure.parameters])
    inverse, active = np.empty((3, 3)), np.ones(4, dtype=bool)
    inverse_mass(p, structure.mass, structure.mass_weights, active, inverse)
    whole = six_dof_structure((RACE,), (RACE,))
    system = system_of(whole, whole.vector(values), row.velocities)
    moving = [VELOCITIES.index(name) for name in row.velocities]
    state, fins = in_the_plane(plane, x, inputs)

    def rates(acting: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        planar = np.concatenate([inputs, [1.0, 0.0, 0.0], acting, np.zeros(6)])
        by_fin = {row.fin: acting}
        both = [by_fin.get(fin, np.zeros(3)) for fin in ("rudder", "elevator")]
        together = np.concatenate([fins, np.zeros(2), *both])
        return (
            right_hand_side(structure, active, x, planar, p, inverse)[:3],
            rates_six_dof(state, together, system)[moving],
        )

    (plane_raced, whole_raced), (plane_still, whole_still) = rates(race), rates(np.zeros(3))
    assert np.abs(plane_raced - plane_still).max() > 1e-3
    np.testing.assert_allclose(
        whole_raced - whole_still, plane_raced - plane_still, rtol=1e-9, atol=1e-10
    )
