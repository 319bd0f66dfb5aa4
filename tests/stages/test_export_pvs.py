"""The class for PythonVehicleSimulator against the program's own prediction."""

import ast
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from auvident.pipeline.exporting import export_model
from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.combined import CombinedModel
from auvident.schema.effects import BY_ID
from auvident.schema.planes import BY_PLANE, PLANES, Plane
from auvident.stages.combine import STATE_COLUMNS, simulate_whole
from auvident.stages.export import export
from auvident.stages.export.pvs import as_pvs
from auvident.storage.artifacts import json_bytes
from tests.engines.chain import sample
from tests.engines.effects_world import DT, blank
from tests.engines.whole_world import whole_vehicle
from tests.stages.test_export import (
    EQUAL,
    NASTY,
    SINGLE,
    case_of,
    named,
    program,
    with_effects,
)

NU, ANGLES = ("u", "v", "w", "p", "q", "r"), ("roll", "pitch", "heading")


def vehicle_of(model: IdentifiedModel | CombinedModel, **options: float) -> Any:
    """The vehicle, as the package makes it."""
    module = program(as_pvs(model))
    (name,) = (name for name in vars(module) if name.startswith("Auv"))
    return getattr(module, name)(**options)


def flown(vehicle: Any, first: np.ndarray, angles: np.ndarray, controls: np.ndarray) -> np.ndarray:
    """Velocities (n, 6), the angles (n, 3) of every step given."""
    nu, u_actual, rows = np.array(first), np.array(controls[0]), []
    for k, u_control in enumerate(controls):
        rows.append(nu)
        eta = np.array([0.0, 0.0, 0.0, *angles[k]])
        nu, u_actual = vehicle.dynamics(eta, nu, u_actual, u_control, DT)
    return np.array(rows)


@pytest.mark.parametrize("plane", PLANES)
@pytest.mark.parametrize("kind", ["plain", "actuation"])
def test_a_plane_flies_as_in_the_program(plane: Plane, kind: str) -> None:
    """With all that becomes of a command; the race needs a speed, which here is its own."""
    every = [e for p, e in SINGLE if p == plane and BY_ID[e].enters == "input"]
    ids = [e for e in every if e != "propeller_race"] if kind == "actuation" else []
    model = with_effects(plane, *ids)
    case = replace(case_of(model, blank(300), DT), before=[])
    module, fin = program(export(model, "python")), case.inputs[0][0]
    series = {"elapsed_s": 0.0} if "elapsed_s" in module.simulate.__code__.co_varnames else {}
    expected = np.array(module.simulate(case.start, case.inputs, DT, fin=fin, **series))
    row = BY_PLANE[plane]
    own, other, rate = np.transpose(case.inputs)
    fins = {row.fins[0]: own, row.fins[1]: other}
    controls = np.column_stack([-fins["rudder"], fins["elevator"], 60.0 * rate])
    angles = np.zeros((len(expected), 3))
    angles[:, ANGLES.index(row.states[3].symbol)] = expected[:, 3]
    columns = [NU.index(name) for name in row.velocities]
    first = np.zeros(6)
    first[columns] = expected[0, :3]
    found = flown(vehicle_of(model), first, angles, controls)
    np.testing.assert_allclose(found[:, columns], expected[:, :3], rtol=0, atol=EQUAL)
    assert not np.delete(found, columns, axis=1).any()


EARLY_S = -0.14


def early(plane: Plane) -> IdentifiedModel:
    """A model whose fin moves before it is ordered to, as where a clock is late."""
    effect = f"{BY_PLANE[plane].fin}_delay"
    delay = {"id": effect, "internal": {f"{effect}.delay_s": EARLY_S}}
    return with_effects(plane).model_copy(update={"effects": (delay,)})


def early_in_both() -> CombinedModel:
    """The same of both planes."""
    effects = {plane: early(plane).effects for plane in PLANES}
    names = [f"{plane} {effect['id']}.delay_s" for plane, (effect,) in effects.items()]
    model = whole_vehicle()
    parameters = {**model.parameters, **dict.fromkeys(names, EARLY_S)}
    return model.model_copy(update={"effects": effects, "parameters": parameters})


def test_a_negative_delay_is_left_out_and_said(tmp_path: Path) -> None:
    """In the notes and in the file; of a delay that can be, nothing."""
    told, file = "nothing acts before it is ordered: the negative delay of ", tmp_path / "m.json"
    for model, fins in (
        (early("horizontal"), "the rudder."),
        (early("vertical"), "the elevator."),
        (early_in_both(), "the rudder and the elevator."),
        (with_effects("horizontal", "rudder_delay"), ""),
    ):
        file.write_bytes(json_bytes(model, "model"))
        made = export_model(file, "pvs")
        text = " ".join(made.content.decode().split())
        for place in (" ".join(made.notes), text):
            assert f"{told}{fins}" in place if fins else told not in place
        assert vehicle_of(model).rudder.delay >= 0.0


def test_six_degrees_of_freedom_fly_as_in_the_program() -> None:
    """The first minute of a log: the same steps, the angles those of the program."""
    model, log = whole_vehicle(), sample("dive_trial").trials[0]
    window = (-np.inf, float(log.table["time_s"].iloc[0]) + 60.0)
    table = simulate_whole(model, log, window_s=window, samples=0, rng=np.random.default_rng(0))
    expected = table[list(STATE_COLUMNS)].to_numpy()
    controls = table[["rudder_rad", "elevator_rad", "rpm"]].to_numpy() * [-1.0, 1.0, 1.0]
    found = flown(vehicle_of(model), expected[0, :6], expected[:, 6:], controls)
    np.testing.assert_allclose(found, expected[:, :6], rtol=0, atol=EQUAL)
    assert np.ptp(found[:, 4]) > 0.01


def own_loop(steps: int, step_s: float, vehicle: Any) -> tuple[np.ndarray, np.ndarray]:
    """What the package documents of its simulation: control, dynamics, attitude by Euler."""
    eta, nu, u_actual, rows = np.zeros(6), vehicle.nu, vehicle.u_actual, []
    for i in range(steps + 1):
        assert vehicle.controlMode == "stepInput"
        u_control = vehicle.stepInput(i * step_s)
        rows.append(np.concatenate([eta, nu, u_control, u_actual]))
        nu, u_actual = vehicle.dynamics(eta, nu, u_actual, u_control, step_s)
        c, s = np.cos(eta[5]), np.sin(eta[5])
        moved = [c * nu[0] - s * nu[1], s * nu[0] + c * nu[1], 0.0, 0.0, 0.0, nu[5]]
        eta = eta + step_s * np.array(moved)
    return np.arange(steps + 1)[:, None] * step_s, np.array(rows)


def loop_of_the_package() -> Callable:
    """That of the package where it is installed."""
    try:
        from python_vehicle_simulator.lib.mainLoop import simulate
    except ImportError:
        return own_loop
    return simulate


def test_the_loop_of_the_package_runs_it() -> None:
    """All that it reads is there; a positive rudder turns to starboard, as in its vehicles."""
    vehicle = vehicle_of(with_effects("horizontal", "rudder_lag"))
    assert vehicle.dimU == len(vehicle.controls) == len(vehicle.u_actual) == 3
    assert vehicle.name == "REMUS 100" and vehicle.L > 1.0 and vehicle.controlDescription
    time_s, data = loop_of_the_package()(1200, 0.05, vehicle)
    assert data.shape == (len(time_s), 2 * 6 + 2 * vehicle.dimU)
    u, r, rudder = data[:, 6], data[:, 11], data[:, 12]
    assert (u[300:] > 0.5).all()
    turning = (rudder > 0.0) & (time_s[:, 0] > 30.0)
    assert (r[turning] > 0.01).all()
    assert data[-1, 15] == pytest.approx(rudder[-1], abs=1e-6)  # the servo has arrived


def test_the_water_carries_it() -> None:
    """Without thrust it ends up drifting with the current, and turns as in still water."""
    model = with_effects("horizontal")
    still, carried = vehicle_of(model), vehicle_of(model, V_current=0.3, beta_current=90.0)
    nu, eta, u = np.array([1.4, 0.0, 0.0, 0.0, 0.0, 0.0]), np.zeros(6), np.zeros(3)
    through, _ = still.dynamics(eta, nu, u, np.array([0.2, 0.0, 900.0]), DT)
    over_ground = nu + np.eye(6)[1] * 0.3
    moved, _ = carried.dynamics(eta, over_ground, u, np.array([0.2, 0.0, 900.0]), DT)
    water = carried.water(0.0, 0.0, 0.5 * DT * through[5])
    np.testing.assert_allclose(moved - water, through, atol=1e-5)
    assert moved[5] == pytest.approx(through[5], abs=1e-12)


@pytest.mark.parametrize("name", NASTY)
def test_no_name_becomes_a_part_of_the_class(name: str) -> None:
    """Only docstrings, the name and that of the class differ from those of a plain name."""
    for model in (named(name), whole_vehicle().model_copy(update={"vehicle": name})):
        plain = model.model_copy(update={"vehicle": "REMUS 100"})
        one, other = (_bare(ast.parse(as_pvs(m))) for m in (model, plain))
        assert one == other
        assert vehicle_of(model).name == name


def _bare(tree: ast.Module) -> str:
    """A module without texts and the name of its class."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef) and node.name.startswith("Auv"):
            node.name = "Auv"
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            node.value = ""
    return ast.dump(tree)
