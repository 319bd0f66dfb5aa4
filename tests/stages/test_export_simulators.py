"""Files for gz-sim and uuv_simulator, flown by what those document, against the program."""

from xml.etree import ElementTree as ET

import numpy as np
import pytest

from auvident.constants import GRAVITY_MPS2, USUAL_SPEED_MPS
from auvident.errors import UsageError
from auvident.physics.six_dof import rates_six_dof, state_of, system_of
from auvident.physics.six_dof_terms import VELOCITIES, six_dof_structure
from auvident.physics.terms import LINEAR_DRAG
from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.planes import BY_PLANE, PLANES, Plane
from auvident.stages.export import export
from auvident.stages.export.gz import as_gz, left_out_of_gz
from auvident.stages.export.hull import (
    body_of,
    coriolis_of_added_mass,
    fins_of,
    hull_of,
    symmetric,
)
from auvident.stages.export.simulators import ReadVehicle, fly_plane, read_gz, read_uuv
from auvident.stages.export.uuv import as_uuv, left_out_of_uuv
from auvident.stages.export.whole import whole_of
from auvident.stages.simulate import steady_speed
from tests.engines.whole_world import planar, whole_vehicle
from tests.stages.test_export import NASTY, named, program, with_effects

SIMULATORS = {"gz": (as_gz, read_gz), "uuv": (as_uuv, read_uuv)}
ROUNDED = 1e-9  # twelve digits in a file


def with_values(model: IdentifiedModel, **values: float) -> IdentifiedModel:
    """The model with other coefficients, by their names in a program."""
    from auvident.stages.export.expressions import identifier

    changed = tuple(
        c.model_copy(update={"value": values.get(identifier(c.symbol), c.value)})
        for c in model.coefficients
    )
    return model.model_copy(update={"coefficients": changed})


def accelerations(vehicle: ReadVehicle, plane: Plane, state: np.ndarray, rate: float) -> np.ndarray:
    """Those of a plane with the fins amidships, from two states a moment apart."""
    dt, orders = 1e-4, np.tile([0.0, 0.0, rate], (2, 1))
    first, second = fly_plane(vehicle, plane, state, orders, 0, dt)
    return (second - first)[:3] / dt


def own_accelerations(model: IdentifiedModel, state: np.ndarray, rate: float) -> np.ndarray:
    """The same by the exported equations."""
    module, dt = program(export(model, "python")), 1e-4
    acting = [0.0, 0.0, rate]
    return (np.array(module.step(list(state), acting, dt)) - state)[:3] / dt


@pytest.mark.parametrize("plane", PLANES)
def test_gz_has_every_force_of_the_hull(plane: Plane) -> None:
    """Signs, Coriolis forces once, weight and buoyancy: only fins and thrust at drift differ."""
    rng = np.random.default_rng(7)
    model = with_effects(plane, "linear_drag", "hull_asymmetry", "linear_damping")
    vehicle = read_gz(as_gz(whole_of(model)))
    for _ in range(6):
        state = np.array([1.4, 0.2, 0.3, 0.4]) * rng.uniform(-1.0, 1.0, 4)
        expected = own_accelerations(model, state, 0.0)
        np.testing.assert_allclose(accelerations(vehicle, plane, state, 0.0), expected, atol=1e-7)
    ahead = np.array([1.5, 0.0, 0.0, 0.1])
    expected = own_accelerations(model, ahead, 15.0)
    np.testing.assert_allclose(accelerations(vehicle, plane, ahead, 15.0), expected, atol=1e-4)


@pytest.mark.parametrize("plane", PLANES)
def test_uuv_has_every_force_that_it_can_hold(plane: Plane) -> None:
    """Of a model without those that it cannot: what it adds for the added mass comes once.

    Its fins have their lift across the flow, so that in one that sets by a small angle there is
    lift times angle ahead, which no coefficient has.
    """
    rng = np.random.default_rng(7)
    base = with_effects(plane, "linear_drag")
    row, symbols = BY_PLANE[plane], base.values()
    (_, a, b), (_, A, B) = row.velocities, row.axes
    lost = {f"X_{a}{a}": 0.0, f"{A}_{b}_abs_{b}": 0.0, f"{B}_{a}_abs_{a}": 0.0}
    lost |= {f"X_{a}{b}": -row.sigma * symbols[f"{A}_{a}dot"]}
    lost |= {f"X_{b}{b}": -row.sigma * symbols[f"{A}_{b}dot"], "T_nu": 0.0, "X_uudd": 0.0}
    model = with_values(base, **lost)
    assert "Left out: " not in " ".join(left_out_of_uuv(whole_of(model)))
    vehicle = read_uuv(as_uuv(whole_of(model)))
    (station,) = (fin.station_m for fin in fins_of(whole_of(model)) if fin.name == row.fins[0])
    mass = whole_of(model).mass[0, 0]
    for _ in range(60):
        state = np.array([1.4, 2e-3, 2e-3, 0.3]) * [1.0, *rng.uniform(-1.0, 1.0, 3)]
        expected = own_accelerations(model, state, 0.0)
        across = state[1] + row.sigma * station * state[2]
        expected[0] += abs(symbols[f"{A}_uud"]) * across**2 / mass
        np.testing.assert_allclose(accelerations(vehicle, plane, state, 0.0), expected, atol=3e-7)


def test_uuv_has_thrust_and_drag_about_a_run_in_balance() -> None:
    """Its thrust knows the rate alone: the balance holds at every rate, and nearly beside it."""
    model = with_effects("horizontal")
    vehicle = read_uuv(as_uuv(whole_of(model)))
    for rate in (8.0, 16.0):
        run = np.array([steady_speed(model, rate), 0.0, 0.0, 0.0])
        (still, *_) = accelerations(vehicle, "horizontal", run, rate)
        assert still == pytest.approx(0.0, abs=1e-9)
        for slower, faster in ((0.98, 1.0), (1.0, 1.02)):
            away = run * slower
            expected = own_accelerations(model, away, faster * rate)[0]
            found = accelerations(vehicle, "horizontal", away, faster * rate)[0]
            assert found == pytest.approx(expected, rel=0.01)


def test_added_mass_coriolis_is_that_of_kirchhoff() -> None:
    """Against the cross products, for a mass matrix with everything in it."""
    rng = np.random.default_rng(7)
    full = rng.normal(size=(6, 6))
    added, nu = full @ full.T, rng.normal(size=6)
    momentum = added @ nu
    force = -np.cross(nu[3:], momentum[:3])
    moment = -np.cross(nu[:3], momentum[:3]) - np.cross(nu[3:], momentum[3:])
    products = coriolis_of_added_mass(added)
    found = np.einsum("ijk,j,k->i", products, nu, nu)
    np.testing.assert_allclose(found, [*force, *moment], rtol=1e-12)


def test_gz_has_six_degrees_of_freedom() -> None:
    """At every velocity for which drag across the hull is that of one plane."""
    rng = np.random.default_rng(7)
    model = whole_vehicle()
    whole, text = whole_of(model), as_gz(whole_of(model))
    vehicle = read_gz(text)
    structure = six_dof_structure(model.effect_ids("horizontal"), model.effect_ids("vertical"))
    system = system_of(structure, structure.vector(model.values()))
    total, off = vehicle.mass + vehicle.added, []
    for rest in (("w", "r"), ("v", "q")):
        nu = np.array([1.4, 0.2, 0.2, 0.5, 0.3, 0.3]) * rng.uniform(0.2, 1.0, 6)
        nu[[VELOCITIES.index(name) for name in rest]] = 0.0
        momentum = total @ nu
        force = vehicle.hydrodynamics(nu)
        force[:3] -= np.cross(nu[3:], momentum[:3])
        force[3:] -= np.cross(nu[:3], momentum[:3]) + np.cross(nu[3:], momentum[3:])
        expected = rates_six_dof(state_of(nu, np.zeros(3)), np.array([0, 0, 0.0, 1.0]), system)
        still = rates_six_dof(state_of(0 * nu, np.zeros(3)), np.array([0, 0, 0.0, 1.0]), system)
        off.append(np.linalg.solve(total, force) - (expected - still)[:6])
    np.testing.assert_allclose(off, 0.0, atol=1e-7)
    body = body_of(whole)
    assert body.mass_kg * GRAVITY_MPS2 - vehicle.buoyancy[0] == pytest.approx(model.values()["W-B"])
    assert vehicle.weight[0] * vehicle.weight[2] == pytest.approx(model.values()["z_GW"])


@pytest.mark.parametrize("tool", SIMULATORS)
@pytest.mark.parametrize("plane", PLANES)
def test_a_fin_steers_as_in_the_program(tool: str, plane: Plane) -> None:
    """A small angle for ten seconds: to the same side, and as far within a tenth."""
    model = planar(plane)
    write, read = SIMULATORS[tool]
    orders = np.tile([0.03, 0.0, 15.0], (100, 1))
    start = np.array([1.4, 0.0, 0.0, 0.0])
    module = program(export(model, "python"))
    own = np.array(module.simulate(start.tolist(), orders.tolist(), 0.1))
    found = fly_plane(read(write(whole_of(model))), plane, start, orders, 0, 0.1)
    np.testing.assert_allclose(found[-1, :3], own[-1, :3], rtol=0.1, atol=2e-3)
    assert abs(own[-1, 2]) > 3e-3 or plane == "vertical"


def test_what_has_no_place_is_named() -> None:
    """Beside what every model has; the comment in the file says it as well."""
    model = with_effects("horizontal", "rudder_delay", "cubic_damping", "rudder_lag", "thrust_sag")
    whole = whole_of(model)
    for lines, text in (
        (left_out_of_gz(whole), as_gz(whole)),
        (left_out_of_uuv(whole), as_uuv(whole)),
    ):
        said = " ".join(lines)
        assert all(
            n in said for n in ("delay of the rudder", "cubic_damping.N_rrr", "sagging thrust")
        )
        assert all(line in " ".join(text.split()) for line in lines)
    assert "lag of the rudder servo" in left_out_of_gz(whole)[0]
    assert "lag of the rudder servo" not in left_out_of_uuv(whole)[0]
    assert "X_uudrdr" in left_out_of_gz(whole)[0]
    assert "Y_r|r|" in left_out_of_uuv(whole)[0]
    assert [term.parameter.rpartition(".")[2] for term in hull_of(whole).others] == [
        "N_vvr",
        "N_rrr",
    ]


@pytest.mark.parametrize("name", [*NASTY, "<a>&amp;]]>", "\x00\udcff", "-->", "a--b---"])
@pytest.mark.parametrize("tool", SIMULATORS)
def test_no_name_becomes_xml(tool: str, name: str) -> None:
    """Only the comment and the name of the model differ from those of a plain name."""
    write, _ = SIMULATORS[tool]
    odd, plain = (ET.fromstring(write(whole_of(named(n)))) for n in (name, "REMUS 100"))
    (model,) = odd.iter("model")
    assert str(model.get("name")).isidentifier() or model.get("name")[0].isdigit()
    shapes = [[(e.tag, e.get("filename")) for e in tree.iter()] for tree in (odd, plain)]
    assert shapes[0] == shapes[1]


def test_the_added_mass_is_symmetric() -> None:
    whole = whole_of(with_values(planar("horizontal"), Y_rdot=4.0, N_vdot=2.0))
    assert symmetric(whole.added)[1, 5] == -3.0
    np.testing.assert_allclose(read_gz(as_gz(whole)).added, symmetric(whole.added), rtol=ROUNDED)


@pytest.mark.parametrize("tool", SIMULATORS)
def test_a_model_of_the_horizontal_plane_neither_sinks_nor_trims(tool: str) -> None:
    """Whatever the vehicle file says of its ballast; and the rest of it stays at rest."""
    write, read = SIMULATORS[tool]
    whole = whole_of(planar("horizontal"))
    assert whole.values["W-B"] != 0.0
    vehicle = read(write(whole))
    (weight, x, _), (buoyancy, x_b, _) = vehicle.weight, vehicle.buoyancy
    assert buoyancy == pytest.approx(weight) and buoyancy * x_b == pytest.approx(weight * x)
    away = np.array([0.0, 0.0, 0.1, 0.1, 0.1, 0.0])
    assert (vehicle.hydrodynamics(away)[2:5] < 0.0).all()


def test_a_fin_beyond_the_hull_keeps_its_moment() -> None:
    whole = whole_of(with_values(planar("horizontal"), Y_uud=0.5, N_uud=-4.5))
    (fin,) = fins_of(whole)
    assert fin.station_m == -0.5 * whole.length_m
    assert fin.force * fin.station_m == pytest.approx(-4.5)
    assert "Y_uud" in left_out_of_gz(whole)[0] and "Y_uud" in left_out_of_uuv(whole)[0]


def test_what_is_no_vehicle_is_refused() -> None:
    model = planar("horizontal")
    for odd in (
        with_values(model, X_udot=100.0),
        model.model_copy(update={"effects": ({"id": "bow_thruster", "internal": {}},)}),
        with_values(model, X_uu=float("nan")),
    ):
        with pytest.raises(UsageError):
            whole_of(odd)
    whole = whole_vehicle()
    entries = tuple(e.model_copy(update={"value": np.inf}) for e in whole.constants)
    with pytest.raises(UsageError, match="not a finite number"):
        whole_of(whole.model_copy(update={"constants": entries}))


@pytest.mark.parametrize("plane", PLANES)
def test_the_rate_of_a_straight_run_balances_linear_drag_too(plane: Plane) -> None:
    """About that run uuv_simulator has the thrust of the model, which falls with the speed."""
    whole = whole_of(with_effects(plane, "linear_drag"))
    plain = whole_of(with_effects(plane))
    u, n, own = USUAL_SPEED_MPS, whole.usual_rate_rps, whole.values
    thrust = own["T_nn"] * n * n + own["T_nu"] * n * u
    drag = own["X_uu"] * u * u + own[LINEAR_DRAG] * u
    assert own[LINEAR_DRAG] > 0.0 and n < plain.usual_rate_rps  # of its usual size, but ahead
    assert thrust + drag == pytest.approx(0.0, abs=1e-9 * thrust)
    read, ahead = read_uuv(as_uuv(whole)), np.array([u, 0.0, 0.0, 0.0, 0.0, 0.0])
    resistance = whole.values["X_uu"] * u * u + whole.values[LINEAR_DRAG] * u
    found = read.thrust(n, ahead) + float(read.hydrodynamics(ahead)[0]) - resistance
    assert found == pytest.approx(thrust, rel=1e-9)
