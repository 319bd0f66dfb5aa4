"""What a simulator of rigid bodies in water has to hold, sorted: body, hull, fins, propeller."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import GRAVITY_MPS2
from auvident.physics import actuation as act
from auvident.physics.six_dof_terms import ACROSS, AXES, CROSS, DRAG_OF, VELOCITIES
from auvident.schema.planes import BY_FIN, PLANES
from auvident.stages.export.whole import RIGID, Term, Whole

Array = npt.NDArray[Any]

N = len(VELOCITIES)
OWN = {"vw": "", "qr": ""}  # a magnitude across the hull is that of the velocity beside it
# force and moment of each fin
FINS = {"rudder": ("Y_uud", "N_uud"), "elevator": ("Z_uud", "M_uud")}
PROPELLER = ("T_nn", "T_nu")
HOLD_PER_S = 10.0  # damping rate of what the model has no equations for, so that it stays at rest
ROLL_INERTIA_SHARE = 0.1  # of that in yaw, where no model tells of it: it stays at rest
COMMANDS = (  # what becomes of a command, its place, words
    ("delay", act.DELAY, "delay of the {}"),
    ("deadband", act.DEADBAND, "dead band of the {}"),
    ("backlash", act.BACKLASH, "play of the {}"),
    ("asymmetry", act.ASYMMETRY, "unequal gain of the {}"),
    ("lag", act.LAG, "lag of the {} servo"),
    ("slew", act.SLOWNESS, "speed limit of the {} servo"),
    ("offset", act.OFFSET, "offset of the {}"),
    ("stall", act.STALL, "stall of the {}"),
    ("race", act.RACE, "propeller race at the {}"),
)
OF_PROPELLER = (
    (act.MOTOR_LAG, "lag of the propeller"),
    (act.SAG, "sagging thrust"),
    (act.STEP, "falling thrust"),
)


@dataclass(frozen=True)
class SolidBody:
    """Rigid body: mass, place of its centre of mass and of buoyancy, inertia about the former.

    Axes are forward, starboard, down, from the origin of the vehicle file.
    """

    mass_kg: float
    centre_m: tuple[float, float, float]
    inertia_kgm2: tuple[float, float, float]
    buoyancy_n: float
    buoyancy_centre_m: float


@dataclass(frozen=True)
class Surface:
    """A fin as a force of speed squared times angle at a station; ``lost`` is a force not held."""

    name: str
    force: float
    station_m: float
    drag: float
    lost: str = ""


@dataclass(frozen=True)
class HullForces:
    """Forces of the hull as sums of products of velocities, and what is none.

    Attributes
    ----------
    linear : (6, 6) array
        Axis, velocity.
    products : (6, 6, 6) array
        Axis, velocity, velocity; the first no later than the second.
    absolute : (6, 6, 6) array
        Axis, velocity, velocity of which the size counts.
    others : tuple of Term
        Terms that are neither of these nor of body, fins and propeller.
    across : bool
        Whether drag across the hull in two planes was taken apart.
    """

    linear: Array
    products: Array
    absolute: Array
    others: tuple[Term, ...]
    across: bool


def hull_of(whole: Whole) -> HullForces:
    """Forces of the hull, the Coriolis forces of the added mass among them.

    What a simulator adds by itself has to be taken off: see `coriolis_of_added_mass`.
    """
    linear, products, absolute = np.zeros((N, N)), np.zeros((N, N, N)), np.zeros((N, N, N))
    others = []
    for term in whole.terms:
        if term.parameter in RIGID or term.parameter in _of_parts():
            continue
        axis, product = AXES.index(term.axis), _product(term)
        if product is None:
            others.append(term)
        elif product[0] == "linear":
            linear[axis, product[1]] += term.value
        elif product[0] == "product":
            products[(axis, *sorted(product[1:]))] += term.value
        else:
            absolute[(axis, *product[1:])] += term.value
    used = {v for term in whole.terms for v in term.variables}
    across = len(whole.planes) == len(PLANES) and bool(used & set(OWN))
    return HullForces(linear, products, absolute, tuple(others), across)


def _of_parts() -> set[str]:
    """Parameters of fins and propeller."""
    return {*PROPELLER, *DRAG_OF.values(), *(name for pair in FINS.values() for name in pair)}


def _product(term: Term) -> tuple[Any, ...] | None:
    """Kind of product and places of its velocities; None for what is not of velocities."""
    factors = [(v, power) for v, power in term.factors if v != "thrust"]
    names = [v for v, _ in factors]
    if names[1:] and names[1] in OWN and ACROSS.get(names[0]) == names[1]:
        factors = [(names[0], "x|x|")]
    if not factors or any(v not in VELOCITIES for v, _ in factors):
        return None
    places = [VELOCITIES.index(v) for v, _ in factors]
    match [power for _, power in factors]:
        case ["x"]:
            return ("linear", places[0])
        case ["x|x|"]:
            return ("absolute", places[0], places[0])
        case ["x^2"]:
            return ("product", places[0], places[0])
        case ["x", "x"]:
            return ("product", *places)
        case ["x", "|x|"]:
            return ("absolute", *places)
        case ["|x|", "x"]:
            return ("absolute", places[1], places[0])
    return None


def coriolis_of_added_mass(added: Array) -> Array:
    """Products (6, 6, 6) of velocities in the Coriolis forces of an added mass (Kirchhoff)."""
    out = np.zeros((N, N, N))
    for equation, velocity, axis, sign in CROSS:
        for moving in range(N):
            pair = sorted((VELOCITIES.index(velocity), moving))
            out[(AXES.index(equation), *pair)] += sign * added[AXES.index(axis), moving]
    return out


def symmetric(matrix: Array) -> Array:
    """The added mass as a simulator takes it: equal on both sides of its diagonal."""
    return np.asarray(0.5 * (matrix + matrix.T))


def body_of(whole: Whole) -> SolidBody:
    """The rigid body; without a model of a plane, what keeps it at rest there."""
    rigid = whole.mass - whole.added
    m = float(rigid[0, 0])
    x = float(rigid[1, 5] / m) if rigid[1, 5] else float(-rigid[2, 4] / m)
    z = float(rigid[0, 4] / m)
    across = float(max(rigid[4, 4], rigid[5, 5]))
    about = [float(rigid[k, k]) for k in (3, 4, 5)]
    about = [about[0] or ROLL_INERTIA_SHARE * across, about[1] or across, about[2] or across]
    inertia = (about[0] - m * z * z, about[1] - m * (x * x + z * z), about[2] - m * x * x)
    trim = whole.values.get("x_GW", 0.0) if "vertical" in whole.planes else 0.0
    lever = (x * m * GRAVITY_MPS2 - trim) / whole.buoyancy_n
    return SolidBody(m, (x, 0.0, z), inertia, whole.buoyancy_n, lever)


def fins_of(whole: Whole) -> tuple[Surface, ...]:
    """Fins that steer in the planes of the model.

    One whose force and moment put it beyond the hull stands at its stern, with the moment right.
    """
    found = []
    for fin, (force, moment) in FINS.items():
        if BY_FIN[fin].name not in whole.planes:
            continue
        side, turn = whole.values.get(force, 0.0), whole.values.get(moment, 0.0)
        turn = turn if fin == "rudder" else -turn
        station, beyond = -0.5 * whole.length_m, abs(turn) > abs(side) * whole.length_m
        side, station = (turn / station, station) if beyond else (side, turn / side if side else 0)
        drag = whole.values.get(DRAG_OF[fin], 0.0)
        found.append(Surface(fin, side, station, drag, force if beyond else ""))
    return tuple(found)


def commands_left_out(whole: Whole, held: set[str]) -> list[str]:
    """What becomes of a command and has no place in a format that holds these."""
    found = []
    for plane in whole.planes:
        e, fin = whole.commands[plane], next(f for f, row in BY_FIN.items() if row.name == plane)
        found += [words.format(fin) for name, k, words in COMMANDS if e[k] and name not in held]
    found += [words for k, words in OF_PROPELLER if whole.propeller[k]]
    return found


def effects_left_out(whole: Whole, lost: tuple[Term, ...]) -> list[str]:
    """Names of parameters whose terms have no place, each once."""
    names = [*dict.fromkeys(term.parameter for term in lost)]
    names += [fin.lost for fin in fins_of(whole) if fin.lost]
    return [name if len(whole.planes) > 1 else name.rpartition(" ")[2] for name in names]
