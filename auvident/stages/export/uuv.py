"""The model for uuv_simulator (Gazebo classic, ROS) and Plankton (ROS 2): SDF with its plugins.

Its hydrodynamic model of type ``fossen`` takes matrices of 36 elements: added mass, damping that
is linear, damping that is linear and goes with the surge velocity, and of a quadratic damping the
diagonal alone. It adds the Coriolis forces of the added mass by itself, so that they are taken off
what goes with the surge velocity; and its fins have the lift of the flow along them as well as that
of their angle, so that this is taken off the hull. Coefficients are those of axes forward,
starboard, down.
"""

from xml.etree import ElementTree as ET

import numpy as np

from auvident.constants import GRAVITY_MPS2, USUAL_SPEED_MPS
from auvident.physics import actuation as act
from auvident.physics.six_dof_terms import AXES, VELOCITIES
from auvident.schema.planes import BY_FIN
from auvident.stages.export.gz import (
    CANNOT,
    FIN_INERTIA,
    FIN_MASS_KG,
    name_of_model,
    number,
    put,
    written_comment,
)
from auvident.stages.export.hull import (
    HOLD_PER_S,
    PROPELLER,
    Array,
    HullForces,
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

SDF = "1.6"
HELD = {"lag"}
SURGE = VELOCITIES.index("u")
# roll of a fin's link, whose z axis is its hinge; the hinge as its joint turns
ROLL_OF = {"rudder": 0.0, "elevator": 0.5 * np.pi}
HINGE_OF = {"rudder": "0 0 -1", "elevator": "0 0 1"}
# sign of a fin's force in its angle, velocity across it and its share of the rate: the lift of the
# flow along it is this times force times (velocity, station times rate)
ALONG = {"rudder": ("v", "r", -1.0, -1.0), "elevator": ("w", "q", 1.0, -1.0)}
SMALL = 1e-9  # of the largest product: rounding


def as_uuv(whole: Whole, cost: tuple[str, ...] = ()) -> str:
    """The model for uuv_simulator and Plankton; `cost` as in `gz.as_gz`."""
    root = ET.Element("sdf", version=SDF)
    root.append(ET.Comment(_comment(whole, cost)))
    model = ET.SubElement(root, "model", name=name_of_model(whole))
    body = body_of(whole)
    _base_link(model, body)
    _part(model, "thruster", 0.0, 0.0, "1 0 0")
    for fin in fins_of(whole):
        _part(model, fin.name, fin.station_m, ROLL_OF[fin.name], HINGE_OF[fin.name])
    _hydrodynamics(model, whole, body)
    for number_of_fin, fin in enumerate(fins_of(whole)):
        _fin(model, whole, fin, number_of_fin)
    _thruster(model, whole)
    ET.indent(root)
    return ET.tostring(root, encoding="unicode") + "\n"


def left_out_of_uuv(whole: Whole) -> tuple[str, ...]:
    """What uuv_simulator cannot hold, or holds otherwise, a line each."""
    hull = hull_of(whole)
    lost = [*commands_left_out(whole, HELD), *effects_left_out(whole, hull.others)]
    lost = [name for name in lost if name != "lag of the propeller"]
    lost += _products_left_out(whole, hull)
    lines = [f"Left out: {', '.join(lost)}."] if lost else []
    lines.append("T_nu: the thrust falls with the speed as about a straight run in balance.")
    lines.append("Forces that go with the surge velocity squared are those of a vehicle ahead.")
    if whole.values.get("X_uudrdr") or whole.values.get("X_uudede"):
        lines.append(
            "The drag of a fin goes with its angle to the flow, that of the model to the hull."
        )
    if len(whole.planes) == 1:
        lines.append(
            f"The model is of the {whole.planes[0]} plane: what leaves it is held by damping."
        )
    return tuple(lines)


def _products_left_out(whole: Whole, hull: HullForces) -> list[str]:
    """Products without a place; those of the added mass, which the simulator adds by itself."""
    products = hull.products - coriolis_of_added_mass(symmetric(whole.added))
    least = SMALL * np.abs(products).max(initial=1.0)
    moving = [VELOCITIES.index(v) for v in whole.moving]
    names = []
    for i in moving:
        for j in moving:
            for k in moving:
                if j != SURGE and abs(products[i, j, k]) > least:
                    held = "" if hull.products[i, j, k] else " less that of the added mass"
                    names.append(f"{AXES[i]}_{VELOCITIES[j]}{VELOCITIES[k]}{held}")
                if abs(hull.absolute[i, j, k]) > 0.0 and not (i == j == k or j == k == SURGE):
                    names.append(f"{AXES[i]}_{VELOCITIES[j]}|{VELOCITIES[k]}|")
    return names


def _comment(whole: Whole, cost: tuple[str, ...]) -> str:
    return written_comment(
        f"{whole.vehicle}: model {whole.made}, for uuv_simulator and Plankton.",
        "Fins take rad (a positive rudder turns to port, a positive elevator has its trailing "
        "edge down), the thruster rad/s.",
        CANNOT,
        *left_out_of_uuv(whole),
        *cost,
    )


def _base_link(model: ET.Element, body: SolidBody) -> None:
    link = ET.SubElement(model, "link", name="base_link")
    inertial = ET.SubElement(link, "inertial")
    x, _, z = body.centre_m
    put(inertial, pose=f"{number(x)} 0 {number(-z)} 0 0 0", mass=body.mass_kg)
    moments = dict(zip(("ixx", "iyy", "izz"), body.inertia_kgm2, strict=True))
    put(ET.SubElement(inertial, "inertia"), **moments, ixy=0.0, ixz=0.0, iyz=0.0)


def _part(model: ET.Element, name: str, x: float, roll: float, axis: str) -> None:
    """A link without weight that a joint turns."""
    link = ET.SubElement(model, "link", name=f"{name}_link")
    put(link, pose=f"{number(x)} 0 0 {number(roll)} 0 0")
    inertial = ET.SubElement(link, "inertial")
    put(inertial, mass=FIN_MASS_KG)
    put(ET.SubElement(inertial, "inertia"), ixx=FIN_INERTIA, iyy=FIN_INERTIA, izz=FIN_INERTIA)
    joint = ET.SubElement(model, "joint", name=f"{name}_joint", type="revolute")
    put(joint, parent="base_link", child=f"{name}_link")
    put(ET.SubElement(joint, "axis"), xyz=axis)


def _hydrodynamics(model: ET.Element, whole: Whole, body: SolidBody) -> None:
    plugin = ET.SubElement(
        model, "plugin", name="hydrodynamics", filename="libuuv_underwater_object_ros_plugin.so"
    )
    put(
        plugin,
        fluid_density=whole.density_kgpm3,
        flow_velocity_topic="/hydrodynamics/current_velocity",
        debug="0",
    )
    link = ET.SubElement(plugin, "link", name="base_link")
    put(
        link,
        neutrally_buoyant="0" if "vertical" in whole.planes else "1",
        volume=body.buoyancy_n / (GRAVITY_MPS2 * whole.density_kgpm3),
        center_of_buoyancy=f"{number(body.buoyancy_centre_m)} 0 0",
    )
    box = dict.fromkeys(("width", "height"), 0.1 * whole.length_m) | {"length": whole.length_m}
    put(ET.SubElement(link, "box"), **box)
    linear, forward, quadratic = _damping(whole, body)
    put(
        ET.SubElement(link, "hydrodynamic_model"),
        type="fossen",
        added_mass=_elements(symmetric(whole.added)),
        linear_damping=_elements(linear),
        linear_damping_forward_speed=_elements(forward),
        quadratic_damping=_elements(quadratic),
    )


def _damping(whole: Whole, body: SolidBody) -> tuple[Array, Array, Array]:
    """Damping: linear, linear and with the surge velocity, quadratic of the diagonal."""
    hull = hull_of(whole)
    linear = hull.linear.copy()
    inertia = (*(body.mass_kg,) * 3, *body.inertia_kgm2)
    for k, name in enumerate(VELOCITIES):
        if name not in whole.moving:
            linear[k, k] -= HOLD_PER_S * inertia[k]
    products = hull.products - coriolis_of_added_mass(symmetric(whole.added))
    forward = products[:, SURGE, :].copy()
    ahead = hull.absolute[:, SURGE, SURGE].copy()
    ahead[SURGE] = 0.0
    forward[:, SURGE] += ahead
    for fin in fins_of(whole):
        forward -= _lift_along(fin)
    quadratic = np.diag([hull.absolute[k, k, k] for k in range(len(AXES))])
    quadratic[SURGE, SURGE] += _drag_for_thrust(whole)
    return linear, forward, quadratic


def _lift_along(fin: Surface) -> Array:
    """What the flow along a fin lifts at angle zero, as damping with the surge velocity."""
    across, rate, sign, turned = ALONG[fin.name]
    axis, moment = (1, 5) if fin.name == "rudder" else (2, 4)
    lever = fin.station_m if fin.name == "rudder" else -fin.station_m
    out = np.zeros((len(AXES), len(AXES)))
    side = sign * fin.force
    share = fin.station_m if fin.name == "rudder" else turned * fin.station_m
    out[axis, VELOCITIES.index(across)], out[axis, VELOCITIES.index(rate)] = side, side * share
    out[moment] = lever * out[axis]
    return out


def _elements(matrix: Array) -> str:
    """A matrix as its elements, row by row."""
    return " ".join(number(float(value)) for value in matrix.ravel())


def _fin(model: ET.Element, whole: Whole, fin: Surface, index: int) -> None:
    plugin = ET.SubElement(
        model, "plugin", name=f"{fin.name}_plugin", filename="libuuv_fin_ros_plugin.so"
    )
    name = name_of_model(whole)
    put(
        plugin,
        input_topic=f"/{name}/fins/{index}/input",
        output_topic=f"/{name}/fins/{index}/output",
        link_name=f"{fin.name}_link",
        joint_name=f"{fin.name}_joint",
    )
    e = whole.commands[BY_FIN[fin.name].name]
    _dynamics(plugin, float(e[act.LAG]))
    force = fin.force if fin.name == "rudder" else -fin.force
    put(
        ET.SubElement(plugin, "liftdrag"),
        type="Quadratic",
        lift_constant=force,
        drag_constant=max(-fin.drag, 0.0),
    )


def _thruster(model: ET.Element, whole: Whole) -> None:
    plugin = ET.SubElement(
        model, "plugin", name="thruster_plugin", filename="libuuv_thruster_ros_plugin.so"
    )
    put(plugin, linkName="thruster_link", jointName="thruster_joint", thrusterID="0", gain=1.0)
    _dynamics(plugin, float(whole.propeller[act.MOTOR_LAG]))
    constant = _rotor_constant(whole)
    put(ET.SubElement(plugin, "conversion"), type="Basic", rotorConstant=constant)


def _dynamics(plugin: ET.Element, lag: float) -> None:
    dynamics = ET.SubElement(plugin, "dynamics")
    put(dynamics, type="FirstOrder" if lag > 0.0 else "ZeroOrder")
    if lag > 0.0:
        put(dynamics, timeConstant=lag)


def _rotor_constant(whole: Whole) -> float:
    """Thrust over rate squared, with half of its fall with the speed: see `_drag_for_thrust`."""
    t_nn, t_nu = (whole.values.get(n, 0.0) for n in PROPELLER)
    return (t_nn + 0.5 * t_nu * _speed_per_rate(whole)) / (2.0 * np.pi) ** 2


def _drag_for_thrust(whole: Whole) -> float:
    """Quadratic drag that stands for the other half of the fall of the thrust with the speed.

    The simulator has thrust by rate alone. About a straight run in balance, where u = a n, the
    product n u is (a n^2 + u^2 / a) / 2 to the first order in both.
    """
    speed = _speed_per_rate(whole)
    return 0.5 * whole.values.get("T_nu", 0.0) / speed if speed > 0.0 else 0.0


def _speed_per_rate(whole: Whole) -> float:
    """Speed over rate on a straight run in balance [m per revolution]; zero without thrust."""
    rate = whole.usual_rate_rps
    return USUAL_SPEED_MPS / rate if rate > 0.0 else 0.0
