"""Roll of the whole vehicle from geometry: what neither plane of motion has.

A body of revolution neither resists rolling by added mass nor by lift; fins and sail do, and a
sail ties roll to sway and yaw. Signs are those of the package: the sail stands above the hull
(z < 0), p is positive to starboard down, K = y Z - z Y.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from auvident.constants import GRAVITY_MPS2, USUAL_SPEED_MPS
from auvident.physics.ase.accuracy import BY_NAME
from auvident.physics.ase.drag import friction_coefficient
from auvident.physics.ase.fins import (
    aspect_ratio,
    buried_share,
    chord_edges_m,
    hull_ratio,
    lift_slope,
)
from auvident.physics.ase.geometry import HullGeometry, hull_geometry
from auvident.physics.ase.prior import FLOOR_ACROSS, RESIDUAL_SHARE
from auvident.physics.ase.quadrature import integrate, nodes_and_weights
from auvident.physics.ase.roll_section import plate_share, roll_section
from auvident.schema.vehicle import Fin, Vehicle

STRIP_NODES = 24  # per piece of a chord, as of the other strips
PLATE_DRAG = 1.2  # of a rectangular plate across the flow, sides 1 to 5 (Hoerner 1965, 3-16)
PROTRUDING = 0.25  # of the roll inertia of the displaced water: REMUS has 0.5 of it in its tables
SIDED = 0.005  # of the displaced mass: an antenna that no [[fin]] of kind sail stands for
STATED_INERTIA = 0.05  # of a stated inertia: swung as a pendulum, or summed from the parts
DECAY = 0.1  # of critical damping, judgement: openings, antennas, water that swings within
# Standard deviations of a logarithm where `accuracy.ACCURACIES` has none.
SIGMAS = {
    "roll_gyration": 0.30,  # REMUS 0.177 is 1.4 times a uniform body, LAUV 0.04 is 0.8 times one
    "roll_friction": 0.50,  # friction of a hull that turns, boundary layer as of one that does not
    "roll_span": 0.30,  # strips with the lift slope of sway give 1.5 times slender fins in roll
    "roll_plates": 0.50,  # drag of swinging plates, 1.2 to 3 by amplitude, less at the ends
    "roll_height": 0.01,  # z_G to a hundredth of the diameter: what inclining on the quay reaches
}


class RollTerm(NamedTuple):
    """Value, standard deviation > 0 and contributions of one term."""

    value: float
    std: float
    parts: dict[str, float]


@dataclass(frozen=True)
class RollRow:
    """Declaration of a term: equation, what it multiplies, unit, and its least deviation.

    The least deviation, ``floor``, is of what the file leaves out: a share of the displaced mass
    or of the force across the planform, times powers of half the diameter and half the length.
    """

    symbol: str
    equation: str
    regressor: str
    unit: str
    meaning: str
    floor: tuple[str, int, int] | None = None


# fmt: off
ROLL_ROWS: tuple[RollRow, ...] = (
    RollRow("I_xx", "K", "dp/dt", "kg m^2", "roll inertia of the vehicle about O"),
    RollRow("K_pdot", "K", "dp/dt", "kg m^2", "added inertia in roll", ("mass", 2, 0)),
    RollRow("K_up", "K", "u p", "kg m", "roll damping by lift of the fins", ("lift", 2, 0)),
    RollRow("K_p|p|", "K", "p|p|", "kg m^2", "roll damping of fins as plates", ("lift", 3, 0)),
    RollRow("K_uv", "K", "u v", "kg", "roll moment of a sail due to drift", ("lift", 1, 0)),
    RollRow("K_ur", "K", "u r", "kg m", "roll moment of a sail due to yaw", ("lift", 1, 1)),
    RollRow("Y_up", "Y", "u p", "kg", "side force of a sail due to roll", ("lift", 1, 0)),
    RollRow("N_up", "N", "u p", "kg m", "yaw moment of a sail due to roll", ("lift", 1, 1)),
    RollRow("Y_pdot", "Y", "dp/dt", "kg m", "added mass, sway and roll (K_vdot)", ("side", 1, 0)),
    RollRow("N_pdot", "N", "dp/dt", "kg m^2", "added mass, yaw and roll (K_rdot)", ("side", 1, 1)),
    RollRow("z_GW", "K", "-cos(theta) sin(phi)", "N m", "righting moment"),
)
# fmt: on


class _Share(NamedTuple):
    """A contribution, and the logarithmic deviations of the formulas it comes from."""

    symbol: str
    part: str
    value: float
    sigmas: dict[str, float]


def roll_estimate(vehicle: Vehicle, speed_mps: float | None = None) -> dict[str, RollTerm]:
    """Roll terms of the vehicle, by the symbols of `ROLL_ROWS`.

    Parameters
    ----------
    vehicle : Vehicle
        One vehicle (no variants axis).
    speed_mps : float, optional
        For the Reynolds number of the hull's friction; the design speed comes first.

    Returns
    -------
    dict of str to RollTerm
        SI, about O, signs of the package: the equations are ``(I_xx - K_pdot) dp/dt = K_up u p +
        K_p|p| p|p| + K_uv u v + K_ur u r - z_GW cos(theta) sin(phi) + ...``. ``Y_pdot`` is also
        K_vdot and ``N_pdot`` K_rdot. A hull that is no body of revolution has ``I_xx`` and
        ``z_GW`` alone.
    """
    shares = [*_mass_shares(vehicle)]
    if vehicle.hull.is_body_of_revolution:
        hull = hull_geometry(vehicle)
        speed = vehicle.body.design_speed_mps or speed_mps or USUAL_SPEED_MPS
        shares += _hull_shares(vehicle, hull, speed)
        for fin in vehicle.fin:
            shares += _lift_shares(vehicle, hull, fin)
            shares += _plates(vehicle, hull, fin)
            shares += _inertia_shares(vehicle, hull, fin)
        floors = {row.symbol: _floor(vehicle, hull, row) for row in ROLL_ROWS}
        inertia = sum(abs(s.value) for s in shares if s.symbol in ("I_xx", "K_pdot"))
        floors["K_up"] = float(np.hypot(floors["K_up"], _decay(vehicle, inertia, speed)))
    else:
        floors = {"I_xx": 0.0, "z_GW": 0.0}
    floors["z_GW"] = _righting_std(vehicle)
    return {symbol: _term(symbol, shares, floor) for symbol, floor in floors.items()}


def _floor(vehicle: Vehicle, hull: HullGeometry, row: RollRow) -> float:
    """Deviation of what the file leaves out, in the unit of the term."""
    if row.floor is None:
        return 0.0
    kind, across, along = row.floor
    displaced = vehicle.fluid.density_kgpm3 * float(hull.volume_m3)
    force = 0.5 * vehicle.fluid.density_kgpm3 * float(hull.planform_m2)
    # a cylinder has d^2/8 of inertia, half of the square of half the diameter
    scale = {"mass": 0.5 * PROTRUDING * displaced, "side": SIDED * displaced}
    scale["lift"] = FLOOR_ACROSS * force
    arm = (0.5 * float(hull.diameter_m)) ** across * (0.5 * float(hull.length_m)) ** along
    return scale[kind] * arm


def _decay(vehicle: Vehicle, inertia: float, speed: float) -> float:
    """Deviation of K_up by damping that is no lift: a share of the critical at this speed."""
    stiffness = vehicle.body.mass_kg * GRAVITY_MPS2 * abs(vehicle.body.z_g_m)
    return DECAY * 2.0 * float(np.sqrt(stiffness * inertia)) / speed


def _term(symbol: str, shares: Iterable[_Share], floor: float) -> RollTerm:
    """Sum of the parts; one formula deviates alike in all of them."""
    own = [s for s in shares if s.symbol == symbol]
    stated = bool(own) and all("stated" in s.sigmas for s in own)
    parts: dict[str, float] = {}
    effects: dict[str, float] = {}
    for share in own:
        parts[share.part] = parts.get(share.part, 0.0) + share.value
        for name, sigma in share.sigmas.items():
            effects[name] = effects.get(name, 0.0) + sigma * share.value
    of_parts = float(np.hypot.reduce([0.0, *parts.values()]))
    residual = 0.0 if stated else RESIDUAL_SHARE * of_parts
    std = float(np.hypot.reduce([residual, floor, *effects.values()]))
    return RollTerm(sum(parts.values()), std, {k: v for k, v in parts.items() if v != 0.0})


def _mass_shares(vehicle: Vehicle) -> Iterator[_Share]:
    """Roll inertia, stated or of a uniform body, and the righting moment."""
    body = vehicle.body
    weight = body.mass_kg * GRAVITY_MPS2
    yield _Share("z_GW", "weight", weight * body.z_g_m, {"stated": 0.0})
    if body.ixx_kgm2 is not None:
        yield _Share("I_xx", "vehicle file", body.ixx_kgm2, {"stated": STATED_INERTIA})
        return
    gyration = {"roll_gyration": SIGMAS["roll_gyration"]}
    yield _Share("I_xx", "uniform body", body.mass_kg * _gyration_m2(vehicle), gyration)
    yield _Share("I_xx", "low centre", body.mass_kg * body.z_g_m**2, {})


def _gyration_m2(vehicle: Vehicle) -> float:
    """Square of the roll radius of gyration of a uniform body in the shape of the hull.

    Of revolution: half the mean of R^2 over the volume, d^2/8 of a cylinder. Another hull: an
    ellipse of beam and draught.
    """
    if vehicle.hull.is_body_of_revolution:
        fourth, second = _powers(hull_geometry(vehicle), 4, 2)
        return 0.5 * fourth / second
    beam, draught = vehicle.hull.beam_m or 0.0, vehicle.hull.draught_m or 0.0
    return (beam**2 + draught**2) / 16.0


def _powers(hull: HullGeometry, *exponents: int) -> list[float]:
    """Integrals of powers of the radius along the hull."""

    def integrands(xi: np.ndarray) -> np.ndarray:
        radius = np.sqrt(np.maximum(hull.shape.squared_radius(xi)[0], 0.0))
        return np.stack([radius**k for k in exponents])

    return [float(x) for x in integrate(integrands, hull.shape.edges_m)]


def _righting_std(vehicle: Vehicle) -> float:
    """Of z_G W, by the height of the centre of gravity."""
    size = vehicle.hull.diameter_m or vehicle.hull.draught_m
    if size is None:
        size = float(hull_geometry(vehicle).diameter_m)
    return SIGMAS["roll_height"] * size * vehicle.body.mass_kg * GRAVITY_MPS2


def _hull_shares(vehicle: Vehicle, hull: HullGeometry, speed: float) -> Iterator[_Share]:
    """Friction of a hull that turns about its axis as it goes ahead.

    The flow along the surface has the direction (u, p R); of the stress C_f rho/2 u^2 the share
    p R/u turns: K_up = -rho/2 C_f int 2 pi R^3 dx. A tenth of what small tail fins do.
    """
    fluid = vehicle.fluid
    reynolds = speed * float(hull.length_m) / fluid.kinematic_viscosity_m2ps
    friction = float(friction_coefficient(reynolds, vehicle.ase.friction_line))
    (cubes,) = _powers(hull, 3)
    value = -np.pi * fluid.density_kgpm3 * friction * cubes
    yield _Share("K_up", "hull", value, {"roll_friction": SIGMAS["roll_friction"]})


def _lift_shares(vehicle: Vehicle, hull: HullGeometry, fin: Fin) -> Iterator[_Share]:
    """Damping by the lift of a set; of a sail also what ties roll to drift and yaw.

    Slender fins shed the added mass of their trailing edge: K = -m_44 u p, where m_44 holds the
    hull and the other fins of the set; other sets beside it lower its aspect ratio. The lift slope
    over that of a slender fin, pi A/2, takes the finite aspect ratio in: 2 h^2/S in sway, where
    the hull is a mirror, (1 + tau) h^2/S in roll, where without a hull the opposite side works
    the other way (a rolling wing: a0 A/(A+4) for a0 A/(A+2) of lifting-line theory).
    """
    tau = float(hull_ratio(fin, hull))
    tip = fin.exposed_span_m / (1.0 - tau)
    section, aspect = roll_section(fin.count, tau), float(aspect_ratio(fin))
    load = vehicle.fluid.density_kgpm3 * fin.efficiency
    rolling = _slope_share(vehicle, fin, 0.5 * aspect * (1.0 + tau), _shielding(vehicle, fin, tau))
    sigmas = _lift_sigmas(fin, hull)
    damping = -load * tip**4 * float(section.roll) * rolling
    yield _Share("K_up", fin.kind, damping, sigmas | {"roll_span": SIGMAS["roll_span"]})
    if fin.kind == "sail":
        moment = -load * tip**3 * float(section.cross) * _slope_share(vehicle, fin, aspect)
        for symbol, arm in (("K_uv", 1.0), ("K_ur", fin.x_m), ("Y_up", 1.0), ("N_up", fin.x_m)):
            yield _Share(symbol, fin.kind, moment * arm, sigmas)


def _slope_share(vehicle: Vehicle, fin: Fin, aspect: float, shielding: float = 1.0) -> float:
    """Lift slope over that of a slender fin; shielding counts the more the more slender it is."""
    slope = lift_slope(aspect * shielding, np.radians(fin.sweep_deg), vehicle.ase.fin_lift)
    return float(slope) / (0.5 * np.pi * aspect)


def _shielding(vehicle: Vehicle, fin: Fin, tau: float) -> float:
    """Added inertia of a set among the others at its station over that of the set alone."""
    together = beside(vehicle, fin)
    among = float(roll_section(together, tau).roll) * fin.count / together
    return among / float(roll_section(fin.count, tau).roll)


def _lift_sigmas(fin: Fin, hull: HullGeometry) -> dict[str, float]:
    """Deviations of the lift of a set at incidence, as in the planes of motion."""
    shares = {"fin_lift": 1.0, "sail_interference": 1.0}
    if fin.kind != "sail":
        buried = float(buried_share(fin, hull))
        shares = {"fin_lift": 1.0, "fin_wake": 1.0, "fin_incidence": 1.0}
        shares |= {"fin_wake_buried": buried, "fin_incidence_buried": buried}
    return {name: share * BY_NAME[name].sigma for name, share in shares.items()}


def _plates(vehicle: Vehicle, hull: HullGeometry, fin: Fin) -> Iterator[_Share]:
    """K_p|p| = -rho/2 C_D n int c y^3 dy over the span, of a vehicle at rest in the water."""
    root = float(hull.radius_at(fin.mid_chord_x_m))
    tip = root + fin.exposed_span_m
    y, weight = nodes_and_weights(np.array([root, tip]), STRIP_NODES)
    chord = np.interp(y, [root, tip], [fin.root_chord_m, fin.tip_chord_m])
    load = 0.5 * vehicle.fluid.density_kgpm3 * PLATE_DRAG * fin.count * fin.efficiency
    value = -load * float(np.sum(weight * chord * y**3))
    yield _Share("K_p|p|", fin.kind, value, {"roll_plates": SIGMAS["roll_plates"]})


def _inertia_shares(vehicle: Vehicle, hull: HullGeometry, fin: Fin) -> Iterator[_Share]:
    """Added inertia of a set by strips across its span; of a sail also its share of sway and yaw.

    Strips overstate a chord that is short beside the span (`plate_share`): as nothing else adds
    inertia in roll, that is not left to the deviation as it is in the planes of motion.
    """
    aft, forward = (float(x) for x in chord_edges_m(fin))
    x, weight = nodes_and_weights(np.array([aft, forward]), STRIP_NODES)
    radius = hull.shape.radius_m(hull.nose_x_m - x)
    tau = float(hull_ratio(fin, hull))
    tip = np.maximum(fin.exposed_span_m / (1.0 - tau), radius)
    section = roll_section(beside(vehicle, fin), radius / tip)
    share = plate_share(0.5 * float(aspect_ratio(fin)) * (1.0 + tau))
    load = vehicle.fluid.density_kgpm3 * float(share) * weight
    sigma = {"strip_fins": BY_NAME["strip_fins"].sigma}
    own = fin.count / beside(vehicle, fin)
    inertia = own * float(np.sum(load * tip**4 * section.roll))
    yield _Share("K_pdot", fin.kind, -inertia, sigma)
    if fin.kind == "sail":
        tie = load * tip**3 * section.cross
        yield _Share("Y_pdot", fin.kind, -float(np.sum(tie)), sigma)
        yield _Share("N_pdot", fin.kind, -float(np.sum(tie * x)), sigma)


def beside(vehicle: Vehicle, fin: Fin) -> int:
    """Fins at the station of a set, its own among them: they shield each other in roll."""
    count = 0
    for other in vehicle.fin:
        aft, forward = (float(x) for x in chord_edges_m(other))
        count += other.count * (other is fin or aft < fin.mid_chord_x_m < forward)
    return count
