"""What a simulator makes of the file that was written: its documented equations, read from there.

Neither gz-sim nor uuv_simulator is run here. From the text of the file alone, by the element names
that the simulators document, the forces of their plugins are computed and the motion of a plane
is integrated: gz-sim with DART, which solves for rigid body and `fluid_added_mass` together and
has the Coriolis forces of both; uuv_simulator, which follows the acceleration with a filter, in
the limit of small steps. What leaves the plane is held.

Axes of the integration are forward, starboard, down; those of the files forward, left, up.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import numpy.typing as npt

from auvident.constants import GRAVITY_MPS2
from auvident.physics.actuation import lagged, servo_angle
from auvident.physics.dynamics import SPEED_LIMIT
from auvident.physics.six_dof_terms import AXES, VELOCITIES
from auvident.schema.planes import BY_PLANE, Plane

Array = npt.NDArray[Any]

TURN = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])  # forward, left, up to forward, starboard, down
LEAST_FLOW_MPS = 0.01  # gz-sim: a fin in slower water pushes nothing
PITCH = "pitch"


@dataclass(frozen=True)
class ReadFin:
    """A fin as the simulator has it: its force from velocity and angle, its servo."""

    name: str
    wrench: Callable[[Array, float], Array]
    slowness: float = 0.0
    lag: float = 0.0


@dataclass(frozen=True)
class ReadVehicle:
    """A vehicle as read from a file.

    Attributes
    ----------
    mass, added : (6, 6) array
        Of the rigid body and of the water, about the origin.
    hydrodynamics : callable
        Velocities (6,) to force (6,).
    thrust : callable
        Rate [rev/s] and velocities to thrust [N].
    fins : tuple of ReadFin
    weight, buoyancy : tuple of float
        Force [N], then where it acts forward and down [m].
    propeller_lag : float
    """

    mass: Array
    added: Array
    hydrodynamics: Callable[[Array], Array]
    thrust: Callable[[float, Array], float]
    fins: tuple[ReadFin, ...]
    weight: tuple[float, float, float]
    buoyancy: tuple[float, float, float]
    propeller_lag: float = 0.0


def read_gz(text: str) -> ReadVehicle:
    """The vehicle of a world of gz-sim."""
    model = _found(ET.fromstring(text), "world/model")
    link = _found(model, "link[@name='base_link']")
    mass, weight = _rigid(_found(link, "inertial"))
    plugins: dict[str, list[ET.Element]] = {}
    for plugin in model.iter("plugin"):
        plugins.setdefault(str(plugin.get("name")).rpartition("::")[2], []).append(plugin)
    (hydrodynamics,), (thruster,) = plugins["Hydrodynamics"], plugins["Thruster"]
    if hydrodynamics.findtext("disable_coriolis") != "true":
        raise ValueError("the Coriolis forces of the Hydrodynamics system are not read here")
    density = float(str(hydrodynamics.findtext("water_density")))
    limits = {
        str(p.findtext("joint_name")).removesuffix("_joint"): _value(p, "cmd_max")
        for p in plugins["JointPositionController"]
    }
    fins = tuple(_gz_fin(p, limits) for p in plugins.get("LiftDrag", []))
    return ReadVehicle(
        mass,
        _fluid_added_mass(_found(link, "inertial/fluid_added_mass")),
        _gz_hull(hydrodynamics),
        _gz_thrust(thruster),
        fins,
        weight,
        _gz_buoyancy(_found(link, "collision"), density),
    )


def _found(element: ET.Element, path: str) -> ET.Element:
    found = element.find(path)
    if found is None:
        raise ValueError(f"the file has no {path}")
    return found


def _value(element: ET.Element, name: str, usual: float = 0.0) -> float:
    text = element.findtext(name)
    return usual if text is None else float(text)


def _values(element: ET.Element, name: str) -> Array:
    return np.array([float(part) for part in str(element.findtext(name)).split()])


def _rigid(inertial: ET.Element) -> tuple[Array, tuple[float, float, float]]:
    """Mass matrix of the body about the origin, and its weight."""
    m, place = _value(inertial, "mass"), _values(inertial, "pose")[:3] * TURN[:3]
    inertia = _found(inertial, "inertia")
    moments = np.diag([_value(inertia, name) for name in ("ixx", "iyy", "izz")])
    out = np.zeros((6, 6))
    out[:3, :3] = m * np.eye(3)
    out[:3, 3:], out[3:, :3] = -m * _cross(place), m * _cross(place)
    out[3:, 3:] = moments - m * _cross(place) @ _cross(place)
    return out, (m * GRAVITY_MPS2, float(place[0]), float(place[2]))


def _cross(a: Array) -> Array:
    """Matrix (3, 3) of the cross product with a."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def crossed(a: Array, b: Array) -> Array:
    """Cross product of two vectors: `numpy.cross` takes ten times as long."""
    (a1, a2, a3), (b1, b2, b3) = a.tolist(), b.tolist()
    return np.array([a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1])


def _fluid_added_mass(element: ET.Element) -> Array:
    names = "xyzpqr"
    out = np.zeros((6, 6))
    for i, one in enumerate(names):
        for j in range(i, 6):
            out[i, j] = out[j, i] = _value(element, one + names[j])
    return np.asarray(out * np.outer(TURN, TURN))


def _gz_buoyancy(collision: ET.Element, density: float) -> tuple[float, float, float]:
    """Force of the Buoyancy system on a cylinder, and where it acts."""
    cylinder = _found(collision, "geometry/cylinder")
    volume = np.pi * _value(cylinder, "radius") ** 2 * _value(cylinder, "length")
    x, _, z = _values(collision, "pose")[:3] * TURN[:3]
    return float(density * GRAVITY_MPS2 * volume), float(x), float(z)


def _gz_hull(plugin: ET.Element) -> Callable[[Array], Array]:
    """Forces of the Hydrodynamics system: stability derivatives by their names."""
    linear, products, absolute = np.zeros((6, 6)), np.zeros((6, 6, 6)), np.zeros((6, 6, 6))
    for i, axis in enumerate(AXES):
        for j, first in enumerate(VELOCITIES):
            name = f"{axis.lower()}{first.upper()}"
            linear[i, j] = _value(plugin, name)
            for k, second in enumerate(VELOCITIES):
                products[i, j, k] = _value(plugin, f"{name}{second.upper()}")
                absolute[i, j, k] = _value(plugin, f"{name}abs{second.upper()}")

    def force(nu: Array) -> Array:
        state = nu * TURN
        damping = linear + products @ state + absolute @ np.abs(state)
        return np.asarray(TURN * (damping @ state))

    return force


def _gz_thrust(plugin: ET.Element) -> Callable[[float, Array], float]:
    """Thrust of the Thruster system, from rate and speed."""
    density, diameter = _value(plugin, "fluid_density"), _value(plugin, "propeller_diameter")
    one, two = _value(plugin, "alpha_1"), _value(plugin, "alpha_2")
    wake = _value(plugin, "wake_fraction", 0.2)

    def thrust(rate_rps: float, nu: Array) -> float:
        turning = 2.0 * np.pi * rate_rps
        if turning == 0.0:
            return 0.0
        speed = (1.0 - wake) * float(np.linalg.norm(nu[:3]))
        coefficient = one + two * speed / (turning * diameter)
        return float(coefficient * density * diameter**4 * turning * abs(turning))

    return thrust


def _gz_fin(plugin: ET.Element, limits: dict[str, float]) -> ReadFin:
    """A fin of the LiftDrag system: lift across the flow at its centre of pressure."""
    name = str(plugin.findtext("control_joint_name")).removesuffix("_joint")
    gain, area = _value(plugin, "control_joint_rad_to_cl"), _value(plugin, "area")
    pressure = 0.5 * _value(plugin, "air_density") * area
    place, forward = _values(plugin, "cp"), _values(plugin, "forward")
    spanwise = np.cross(forward, _values(plugin, "upward"))

    def wrench(nu: Array, angle: float) -> Array:
        state = nu * TURN
        flow = state[:3] + crossed(state[3:], place)
        if np.linalg.norm(flow) <= LEAST_FLOW_MPS:
            return np.zeros(6)
        along = flow - flow @ spanwise * spanwise
        lift = crossed(spanwise, along)
        force = gain * angle * pressure * (along @ along) * lift / np.linalg.norm(lift)
        return np.asarray(TURN * np.concatenate([force, crossed(place, force)]))

    return ReadFin(name, wrench, slowness=1.0 / limits[name])


def read_uuv(text: str) -> ReadVehicle:
    """The vehicle of a model of uuv_simulator."""
    model = _found(ET.fromstring(text), "model")
    plugins = {str(p.get("name")): p for p in model.iter("plugin")}
    mass, weight = _rigid(_found(model, "link[@name='base_link']/inertial"))
    water = plugins["hydrodynamics"]
    link = _found(water, "link[@name='base_link']")
    fossen = _found(link, "hydrodynamic_model")
    added = _values(fossen, "added_mass").reshape(6, 6)
    place = _values(link, "center_of_buoyancy") * TURN[:3]
    buoyancy = _value(water, "fluid_density") * GRAVITY_MPS2 * _value(link, "volume")
    thruster = plugins["thruster_plugin"]
    constant = _value(_found(thruster, "conversion"), "rotorConstant")
    fins = [_uuv_fin(model, p) for name, p in plugins.items() if p.find("liftdrag") is not None]
    return ReadVehicle(
        mass,
        added,
        _uuv_hull(fossen),
        lambda rate, nu: constant * (2.0 * np.pi) ** 2 * rate * abs(rate),
        tuple(fins),
        weight,
        (buoyancy, float(place[0]), float(place[2])),
        _value(_found(thruster, "dynamics"), "timeConstant"),
    )


def _uuv_hull(fossen: ET.Element) -> Callable[[Array], Array]:
    """Damping of the model of type fossen; of the quadratic one the diagonal counts."""
    names = ("linear_damping", "linear_damping_forward_speed", "quadratic_damping")
    linear, forward, quadratic = (_values(fossen, name).reshape(6, 6) for name in names)
    own = np.diag(quadratic)

    def force(nu: Array) -> Array:
        return np.asarray((linear + nu[0] * forward) @ nu + own * np.abs(nu) * nu)

    return force


def _uuv_fin(model: ET.Element, plugin: ET.Element) -> ReadFin:
    """A fin with quadratic lift and drag by its angle to the flow, which is across its hinge."""
    name = str(plugin.findtext("link_name")).removesuffix("_link")
    pose = _values(_found(model, f"link[@name='{name}_link']"), "pose")
    hinge = float(_values(_found(model, f"joint[@name='{name}_joint']/axis"), "xyz")[2])
    liftdrag = _found(plugin, "liftdrag")
    lift, drag = _value(liftdrag, "lift_constant"), _value(liftdrag, "drag_constant")
    c, s = np.cos(pose[3]), np.sin(pose[3])
    rolled = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])  # link to vehicle

    def wrench(nu: Array, angle: float) -> Array:
        state = nu * TURN
        turn = hinge * angle
        c, s = np.cos(turn), np.sin(turn)
        to_vehicle = rolled @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        flow = to_vehicle.T @ (state[:3] + crossed(state[3:], pose[:3]))
        flow[2] = 0.0
        speed = float(np.linalg.norm(flow))
        if speed == 0.0:
            return np.zeros(6)
        incidence = np.arctan2(flow[1], flow[0])
        if abs(incidence) > 0.5 * np.pi:
            incidence -= np.copysign(np.pi, incidence)
        across = np.array([flow[1], -flow[0], 0.0]) / speed
        pushed = incidence * speed**2 * (lift * across - drag * incidence * flow / speed)
        force = to_vehicle @ pushed
        return np.asarray(TURN * np.concatenate([force, crossed(pose[:3], force)]))

    lag = _value(_found(plugin, "dynamics"), "timeConstant")
    return ReadFin(name, wrench, lag=lag)


def fly_plane(
    vehicle: ReadVehicle, plane: Plane, start: Array, orders: Array, lead: int, dt_s: float
) -> Array:
    """States (n, 4) of a plane from the first one and the orders; NaN from where it ran away.

    Parameters
    ----------
    vehicle : ReadVehicle
    plane : str
    start : (4,) array
    orders : (lead + n, 3) array
        Own fin, other fin [rad], propeller rate [rev/s].
    lead : int
        Rows before the start, which the servos remember.
    dt_s : float
    """
    row = BY_PLANE[plane]
    on = [VELOCITIES.index(name) for name in row.velocities]
    angles = dict(zip(row.fins, (orders[:, 0], orders[:, 1]), strict=True))
    turned = {fin.name: _turned(fin, angles[fin.name], dt_s) for fin in vehicle.fins}
    rates = np.empty(len(orders))
    lagged(np.ascontiguousarray(orders[:, 2]), vehicle.propeller_lag, dt_s, rates)
    total = vehicle.mass + vehicle.added
    inverse = np.linalg.inv(total[np.ix_(on, on)])

    def derivative(x: Array, k: int) -> Array:
        nu = np.zeros(6)
        nu[on] = x[:3]
        momentum = total @ nu
        force = vehicle.hydrodynamics(nu)
        force[0] += vehicle.thrust(float(rates[k]), nu)
        force[:3] -= crossed(nu[3:], momentum[:3])
        force[3:] -= crossed(nu[:3], momentum[:3]) + crossed(nu[3:], momentum[3:])
        for fin in vehicle.fins:
            force += fin.wrench(nu, float(turned[fin.name][k]))
        if row.states[3].symbol == PITCH:
            force += _hydrostatics(vehicle, float(x[3]))
        return np.append(inverse @ force[on], x[2])

    states = np.full((len(orders) - lead, 4), np.nan)
    x = np.array(start, dtype=float)
    for i in range(len(states)):
        states[i] = x
        k1 = derivative(x, lead + i)
        k2 = derivative(x + 0.5 * dt_s * k1, lead + i)
        k3 = derivative(x + 0.5 * dt_s * k2, lead + i)
        k4 = derivative(x + dt_s * k3, lead + i)
        x = x + dt_s / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        if not (np.abs(x[:3]) < SPEED_LIMIT).all():
            break
    return states


def _turned(fin: ReadFin, orders: Array, dt_s: float) -> Array:
    """Mean angle of a fin over every step."""
    out = np.empty(len(orders))
    own = np.ascontiguousarray(orders, dtype=float)
    servo_angle(own, fin.lag, fin.slowness, 0.0, 0.0, 0.0, dt_s, out)
    return out


def _hydrostatics(vehicle: ReadVehicle, pitch: float) -> Array:
    """Weight and buoyancy at a pitch without roll."""
    out, s, c = np.zeros(6), np.sin(pitch), np.cos(pitch)
    for sign, (force, x, z) in ((1.0, vehicle.weight), (-1.0, vehicle.buoyancy)):
        ahead, down = -sign * force * s, sign * force * c
        out += np.array([ahead, 0.0, down, 0.0, z * ahead - x * down, 0.0])
    return out
