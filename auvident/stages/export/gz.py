"""The model as a world of gz-sim (Gazebo): SDF with the systems that move the vehicle.

Hydrodynamics holds the hull, LiftDrag a fin, Thruster the propeller. The added mass stands in the
inertia of the link (`fluid_added_mass`), where the physics engine solves for it: that of the
Hydrodynamics system follows the acceleration of the step before, and runs away where it is larger
than the mass, as it is across every slender hull. The engine then adds the Coriolis forces of the
added mass by itself, so they are taken off the products of velocities; those of Hydrodynamics, of
which older versions have two elements wrong, are switched off.
"""

import re
import textwrap
from xml.etree import ElementTree as ET

import numpy as np

from auvident.constants import GRAVITY_MPS2
from auvident.physics import actuation as act
from auvident.physics.six_dof_terms import AXES, VELOCITIES
from auvident.schema.planes import BY_FIN
from auvident.schema.quoting import xml_comment
from auvident.stages.export.hull import (
    HOLD_PER_S,
    Array,
    SolidBody,
    Surface,
    body_of,
    commands_left_out,
    coriolis_of_added_mass,
    effects_left_out,
    fins_of,
    hull_of,
    symmetric,
)
from auvident.stages.export.whole import Whole

SDF, STEP_S = "1.10", 0.001
WIDTH = 98  # of a comment
CANNOT = "What this simulator cannot hold:"
# forward, left, up from forward, starboard, down
TURNED = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])
OF_MATRIX = "xyzpqr"  # of `fluid_added_mass`
ROUND = 12  # digits of a number in a file of a simulator
FIN_MASS_KG, FIN_INERTIA = 1e-3, 1e-6  # no part of the vehicle's: it moves the joint alone
DIAMETER_M = 0.1  # of the propeller: only its products with alpha_1 and alpha_2 count
NO_LIMIT_RADPS = 1000.0
HELD = {"slew"}
AXIS_OF = {"rudder": "0 0 -1", "elevator": "0 -1 0"}  # so that a joint turns as a fin does
UPWARD_OF = {"rudder": "0 1 0", "elevator": "0 0 1"}
LIFT_SIGN = -1.0  # force on a fin, to starboard or down, against `upward`
SYSTEMS = (
    ("gz-sim-physics-system", "gz::sim::systems::Physics"),
    ("gz-sim-user-commands-system", "gz::sim::systems::UserCommands"),
    ("gz-sim-scene-broadcaster-system", "gz::sim::systems::SceneBroadcaster"),
)


def as_gz(whole: Whole, cost: tuple[str, ...] = ()) -> str:
    """The model as a world of gz-sim.

    Parameters
    ----------
    whole : Whole
    cost : tuple of str
        What the simulator makes of held-out maneuvers, a line each; see `cost`.
    """
    root = ET.Element("sdf", version=SDF)
    root.append(ET.Comment(_comment(whole, cost)))
    world = ET.SubElement(root, "world", name="auvident")
    physics = ET.SubElement(world, "physics", name="step", type="ignored")
    put(physics, max_step_size=STEP_S, real_time_factor=1.0)
    put(world, gravity=f"0 0 {-GRAVITY_MPS2}")
    for file, name in SYSTEMS:
        ET.SubElement(world, "plugin", filename=file, name=name)
    _plugin(world, "buoyancy", "Buoyancy", uniform_fluid_density=whole.density_kgpm3)
    _model(world, whole)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=False) + "\n"


def left_out_of_gz(whole: Whole) -> tuple[str, ...]:
    """What gz-sim cannot hold, or holds otherwise, a line each."""
    hull = hull_of(whole)
    lost = [*commands_left_out(whole, HELD), *effects_left_out(whole, hull.others)]
    lost += [n for n in ("X_uudrdr", "X_uudede") if _steers(whole, n) and whole.values.get(n)]
    lines = [f"Left out: {', '.join(lost)}."] if lost else []
    lines.append(
        "A fin pushes across the flow that it meets, with the speed of that flow squared; that of "
        "the model across the hull, with the surge velocity squared."
    )
    lines.append("The thrust takes the speed of the vehicle, the model its surge velocity.")
    if hull.across:
        lines.append("Drag across the hull is that of each plane by itself.")
    if len(whole.planes) == 1:
        lines.append(
            f"The model is of the {whole.planes[0]} plane: what leaves it is held by damping, and "
            "weight and buoyancy balance."
            if whole.planes[0] == "horizontal"
            else "The model is of the vertical plane: what leaves it is held by damping."
        )
    return tuple(lines)


def _steers(whole: Whole, drag: str) -> bool:
    fin = "rudder" if drag == "X_uudrdr" else "elevator"
    return BY_FIN[fin].name in whole.planes


def name_of_model(whole: Whole) -> str:
    """Name of the model in topics."""
    plain = re.sub(r"[^A-Za-z0-9]+", "_", whole.vehicle).strip("_").lower()[:40]
    return plain or "auv"


def _comment(whole: Whole, cost: tuple[str, ...]) -> str:
    topic = f"gz topic -m gz.msgs.Double -t /model/{name_of_model(whole)}/joint"
    return written_comment(
        f"{whole.vehicle}: model {whole.made}, for gz-sim 8 and later with DART.",
        "Run: gz sim FILE. A joint turns as the fin does: a positive rudder turns to port, a "
        "positive elevator has its trailing edge down (rad). The propeller takes rad/s; publish "
        "its rate again and again, as the thrust follows the speed only then:",
        f"{topic}/propeller_joint/cmd_vel -p 'data: 95'",
        *(f"{topic}/{fin.name}_joint/0/cmd_pos -p 'data: 0.1'" for fin in fins_of(whole)),
        CANNOT,
        *left_out_of_gz(whole),
        *cost,
    )


def written_comment(*lines: str) -> str:
    """Lines of a comment at the beginning of a file; none of them ends it."""
    parts = (textwrap.wrap(line, WIDTH, subsequent_indent="    ") for line in lines)
    return xml_comment("\n".join(["", *(part for wrapped in parts for part in wrapped), ""]))


def _model(world: ET.Element, whole: Whole) -> None:
    model = ET.SubElement(world, "model", name=name_of_model(whole))
    body = body_of(whole)
    _base_link(model, whole, body)
    for fin in fins_of(whole):
        _part(model, fin.name, fin.station_m, AXIS_OF[fin.name])
    _part(model, "propeller", 0.0, "1 0 0")
    _hydrodynamics(model, whole, body)
    for fin in fins_of(whole):
        _fin(model, whole, fin)
    _thruster(model, whole)


def _base_link(model: ET.Element, whole: Whole, body: SolidBody) -> None:
    link = ET.SubElement(model, "link", name="base_link")
    inertial = ET.SubElement(link, "inertial")
    x, _, z = body.centre_m
    put(inertial, pose=f"{number(x)} 0 {number(-z)} 0 0 0", mass=body.mass_kg)
    moments = dict(zip(("ixx", "iyy", "izz"), body.inertia_kgm2, strict=True))
    put(ET.SubElement(inertial, "inertia"), **moments, ixy=0.0, ixz=0.0, iyz=0.0)
    added = symmetric(whole.added) * np.outer(TURNED, TURNED)
    entries = {
        OF_MATRIX[i] + OF_MATRIX[j]: float(added[i, j]) for i in range(6) for j in range(i, 6)
    }
    put(ET.SubElement(inertial, "fluid_added_mass"), **entries)
    volume = body.buoyancy_n / (GRAVITY_MPS2 * whole.density_kgpm3)
    radius = (volume / (np.pi * whole.length_m)) ** 0.5
    for kind in ("collision", "visual"):
        shape = ET.SubElement(link, kind, name=kind)
        put(shape, pose=f"{number(body.buoyancy_centre_m)} 0 0 0 {np.pi / 2!r} 0")
        cylinder = ET.SubElement(ET.SubElement(shape, "geometry"), "cylinder")
        put(cylinder, radius=float(radius), length=whole.length_m)


def _part(model: ET.Element, name: str, x: float, axis: str) -> None:
    """A link without weight that a joint turns."""
    link = ET.SubElement(model, "link", name=f"{name}_link")
    put(link, pose=f"{number(x)} 0 0 0 0 0")
    inertial = ET.SubElement(link, "inertial")
    put(inertial, mass=FIN_MASS_KG)
    put(ET.SubElement(inertial, "inertia"), ixx=FIN_INERTIA, iyy=FIN_INERTIA, izz=FIN_INERTIA)
    joint = ET.SubElement(model, "joint", name=f"{name}_joint", type="revolute")
    put(joint, parent="base_link", child=f"{name}_link")
    put(ET.SubElement(joint, "axis"), xyz=axis)


def _hydrodynamics(model: ET.Element, whole: Whole, body: SolidBody) -> None:
    """The hull, less the Coriolis forces of the added mass, which the engine adds."""
    hull = hull_of(whole)
    linear = hull.linear.copy()
    inertia = (*(body.mass_kg,) * 3, *body.inertia_kgm2)
    for k, name in enumerate(VELOCITIES):
        if name not in whole.moving:
            linear[k, k] -= HOLD_PER_S * inertia[k]
    products = hull.products - coriolis_of_added_mass(symmetric(whole.added))
    plugin = _plugin(model, "hydrodynamics", "Hydrodynamics", link_name="base_link")
    put(plugin, water_density=whole.density_kgpm3, disable_coriolis="true")
    for name, value in _coefficients(linear, products, hull.absolute):
        put(plugin, **{name: value})


def _coefficients(linear: Array, products: Array, absolute: Array) -> list[tuple[str, float]]:
    """Elements of the Hydrodynamics system: axes forward, left, up."""
    found = []
    for i, axis in enumerate(AXES):
        for j, first in enumerate(VELOCITIES):
            name = f"{axis.lower()}{first.upper()}"
            found.append((name, linear[i, j] * TURNED[i] * TURNED[j]))
            for k, second in enumerate(VELOCITIES):
                sign = TURNED[i] * TURNED[j]
                found.append((f"{name}abs{second.upper()}", absolute[i, j, k] * sign))
                turned = products[i, j, k] * sign * TURNED[k]
                found.append((f"{name}{second.upper()}", turned))
    scale = max(abs(value) for _, value in found)
    return [(name, float(value)) for name, value in found if abs(value) > 1e-14 * scale]


def _fin(model: ET.Element, whole: Whole, fin: Surface) -> None:
    """LiftDrag for the force, a position controller for the servo."""
    _plugin(
        model,
        "lift-drag",
        "LiftDrag",
        link_name="base_link",
        control_joint_name=f"{fin.name}_joint",
        air_density=whole.density_kgpm3,
        area=1.0,
        cla=0.0,
        cda=0.0,
        cma=0.0,
        cla_stall=0.0,
        cda_stall=0.0,
        control_joint_rad_to_cl=LIFT_SIGN * 2.0 * fin.force / whole.density_kgpm3,
        cp=f"{number(fin.station_m)} 0 0",
        forward="1 0 0",
        upward=UPWARD_OF[fin.name],
    )
    slowness = float(whole.commands[BY_FIN[fin.name].name][act.SLOWNESS])
    fastest = 1.0 / slowness if slowness > 0.0 else NO_LIMIT_RADPS
    _plugin(
        model,
        "joint-position-controller",
        "JointPositionController",
        joint_name=f"{fin.name}_joint",
        use_velocity_commands="true",
        cmd_max=fastest,
        cmd_min=-fastest,
    )


def _thruster(model: ET.Element, whole: Whole) -> None:
    """The propeller: thrust by rate and speed, through the coefficients alpha_1 and alpha_2."""
    rho, turn = whole.density_kgpm3, 2.0 * np.pi
    _plugin(
        model,
        "thruster",
        "Thruster",
        namespace=name_of_model(whole),
        joint_name="propeller_joint",
        use_angvel_cmd="true",
        velocity_control="true",
        fluid_density=rho,
        propeller_diameter=DIAMETER_M,
        wake_fraction=0.0,
        alpha_1=whole.values.get("T_nn", 0.0) / (rho * DIAMETER_M**4 * turn**2),
        alpha_2=whole.values.get("T_nu", 0.0) / (rho * DIAMETER_M**3 * turn),
        max_thrust_cmd=NO_LIMIT_RADPS,
        min_thrust_cmd=-NO_LIMIT_RADPS,
    )


def _plugin(element: ET.Element, file: str, kind: str, /, **values: float | str) -> ET.Element:
    plugin = ET.SubElement(
        element, "plugin", filename=f"gz-sim-{file}-system", name=f"gz::sim::systems::{kind}"
    )
    put(plugin, **values)
    return plugin


def put(element: ET.Element, /, **values: float | str) -> None:
    """Elements with a text each."""
    for name, value in values.items():
        child = ET.SubElement(element, name)
        child.text = value if isinstance(value, str) else number(value)


def number(value: float) -> str:
    """A number with `ROUND` digits."""
    return f"{float(value) + 0.0:.{ROUND}g}"  # no minus zero
