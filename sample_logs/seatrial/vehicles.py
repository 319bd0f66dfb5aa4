"""Plant parameters of the vehicles: what the sea knows and the vehicle file does not.

Geometry, mass and inertia come from the vehicle file; everything hydrodynamic stands in `PLANTS`.

REMUS 100. The published set (Prestero 2001, tables B) is inconsistent: the combined ``Y_uv`` equals
the body part alone, the fin lift is about 0.45 of what its own slope gives for two fins, and the
set is violently unstable in yaw once the ad-hoc factor 10 on ``N_rr`` is taken back. The totals
here keep his added masses and fin geometry and take both rudder fins with their full slope; hull
lift acts at 0.34 m behind the origin. They add up to about ``Y_uv`` -43, ``N_uv`` -13, ``Y_ur`` 21,
``N_ur`` -10 (SI, u v and u r products), which is directionally stable.

Tern 180 is an invention of this project with plausible proportions.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

GRAVITY = 9.81
STRIPS = 24
BALLAST = ("mass_kg", "buoyancy_n", "x_g_m", "z_g_m")
VEHICLE_FOLDER = Path(__file__).resolve().parent.parent

# Columns of the fin table.
FIN_X, FIN_Y, FIN_Z, FIN_UPRIGHT, FIN_AREA, FIN_SLOPE, FIN_STALL = 0, 1, 2, 3, 4, 5, 6
FIN_DRAG, FIN_INDUCED, FIN_UPWASH, FIN_EFFECT, FIN_CONTROL = 7, 8, 9, 10, 11
FIN_COLUMNS = 12
CONTROL_NONE, CONTROL_RUDDER, CONTROL_ELEVATOR = 0, 1, 2


@dataclass(frozen=True)
class Plant:
    """Hydrodynamic truth of one vehicle (SI units).

    added_mass : (X_udot, Y_vdot, Z_wdot, K_pdot, M_qdot, N_rdot), all negative
    added_cross : (Y_rdot, Z_qdot, Y_pdot, N_pdot)
    i_xx : roll inertia [kg m^2]
    drag_form : form and appendage drag coefficient on the frontal area
    friction_factor : multiplies ITTC-57 friction on the wetted surface
    hull_lift, hull_lift_x : [kg/m] and [m]; normal force ``-hull_lift * speed * v`` at that station
    hull_induced : [kg/m] axial drag ``-hull_induced * (v^2 + w^2)`` at that station
    cross_flow : drag coefficient of the strips
    roll_linear, roll_quadratic : [N m s], [N m s^2]
    fin_slope, fin_stall, fin_drag, oswald : lift slope [1/rad], stall angle [rad], C_D0, e
    fin_upwash, fin_effect : local incidence and deflection that count, over the geometric ones
    sail_slope : as fin_slope, carry-over on the hull included
    kt, kq : K_T(J), K_Q(J) = c0 + c1 J + c2 J^2
    wake, deduction : wake fraction, thrust deduction
    cruise_rpm : propeller speed that gives about 1.5 m/s
    dvl_z : [m] the DVL sits below the axis
    turbulence : standard deviation of the six OU forces [N, N m]
    y_g : [m] centre of gravity to starboard
    damping : rows (sway, heave, pitch, yaw) of (linear, quadratic, cubic), all positive: a force
        ``-(a + b |x| + c x^2) x``, whatever the forward speed
    """

    added_mass: tuple
    added_cross: tuple
    i_xx: float
    drag_form: float
    friction_factor: float
    hull_lift: float
    hull_lift_x: float
    hull_induced: float
    cross_flow: float
    roll_linear: float
    roll_quadratic: float
    fin_slope: float
    fin_stall: float
    fin_drag: float
    oswald: float
    fin_upwash: float
    fin_effect: float
    sail_slope: float
    kt: tuple
    kq: tuple
    wake: float
    deduction: float
    cruise_rpm: float
    dvl_z: float
    turbulence: tuple
    y_g: float = 0.0
    damping: tuple = ((0.0, 0.0, 0.0),) * 4


PLANTS = {
    # Added masses: Prestero 2001, tables B. Drag: his sea estimate C_d 0.2, fins counted apart.
    # Fin slope 3.1: Hoerner for aspect ratio 2.2, as in the source. Flap effect below one because
    # the fins work in the wake of a tapered stern (SUBOFF planes reach 0.4 to 0.6 of theory).
    "remus100": Plant(
        added_mass=(-0.93, -35.5, -35.5, -0.0704, -4.88, -4.88),
        added_cross=(1.93, -1.93, 0.0, 0.0),
        i_xx=0.177,
        drag_form=0.10,
        friction_factor=1.12,
        hull_lift=18.0,
        hull_lift_x=-0.34,
        hull_induced=12.0,
        cross_flow=0.8,
        roll_linear=0.12,
        roll_quadratic=0.13,
        fin_slope=3.1,
        fin_stall=0.40,
        fin_drag=0.012,
        oswald=0.85,
        fin_upwash=1.15,
        fin_effect=0.38,
        sail_slope=0.0,
        kt=(0.285, -0.290, -0.110),
        kq=(0.034, -0.024, -0.012),
        wake=0.17,
        deduction=0.08,
        cruise_rpm=900.0,
        dvl_z=0.07,
        turbulence=(0.05, 0.15, 0.15, 0.010, 0.04, 0.04),
    ),
    # Added masses: strips of circles and fins times about 0.9 for finite length; the sail adds
    # 5 kg of sway mass 0.19 m above the axis (Y_pdot, K_pdot). Sail slope 2.6: aspect ratio 1.4
    # on its mirror image, plus carry-over on the hull.
    "tern180": Plant(
        added_mass=(-2.1, -64.0, -59.0, -0.32, -10.4, -10.6),
        added_cross=(1.6, -2.3, -0.95, -0.17),
        i_xx=0.46,
        drag_form=0.11,
        friction_factor=1.15,
        hull_lift=26.0,
        hull_lift_x=-0.43,
        hull_induced=20.0,
        cross_flow=0.7,
        roll_linear=0.45,
        roll_quadratic=0.6,
        fin_slope=2.7,
        fin_stall=0.42,
        fin_drag=0.011,
        oswald=0.85,
        fin_upwash=1.12,
        fin_effect=0.46,
        sail_slope=2.6,
        kt=(0.310, -0.240, -0.180),
        kq=(0.040, -0.026, -0.018),
        wake=0.19,
        deduction=0.10,
        cruise_rpm=660.0,
        dvl_z=0.09,
        turbulence=(0.09, 0.27, 0.27, 0.03, 0.10, 0.10),
    ),
}


class Body(NamedTuple):
    """Arrays and numbers that the compiled plant reads (SI units)."""

    mass: np.ndarray  # 6x6, rigid body plus added
    mass_inverse: np.ndarray
    strip_x: np.ndarray  # [m]
    strip_area: np.ndarray  # [m^2] side area of each strip
    fins: np.ndarray  # rows of FIN_* columns
    kt: np.ndarray
    kq: np.ndarray
    weight: float
    buoyancy: float
    z_g: float
    radius: float
    length: float
    density: float
    viscosity: float
    frontal_area: float
    wetted_area: float
    drag_form: float
    friction_factor: float
    hull_lift: float
    hull_lift_x: float
    hull_induced: float
    cross_flow: float
    roll_linear: float
    roll_quadratic: float
    propeller_diameter: float
    wake: float
    deduction: float
    x_g: float = 0.0
    y_g: float = 0.0
    damping: np.ndarray = np.zeros((4, 3))  # as in `Plant`


@dataclass(frozen=True)
class Vehicle:
    """A vehicle as the generator uses it."""

    name: str
    file: dict
    plant: Plant
    body: Body
    spread_factors: dict

    @property
    def scale(self) -> float:
        """Lateral size relative to REMUS, for drawing effect sizes."""
        return (self.body.length / 1.33) ** 2


def load_vehicle(
    name: str,
    spread: float = 0.0,
    rng: np.random.Generator | None = None,
    ballast: dict | None = None,
) -> Vehicle:
    """Vehicle `name`; `spread` multiplies plant parameters by random factors of that size.

    `ballast` has true values of the table ``[vehicle]`` where the vehicle file is wrong.
    """
    with open(VEHICLE_FOLDER / f"{name}.toml", "rb") as stream:
        file = tomllib.load(stream)
    unknown = set(ballast or {}) - set(BALLAST)
    if unknown:
        raise ValueError(f"no ballast {sorted(unknown)}; known: {', '.join(BALLAST)}")
    file["vehicle"] |= ballast or {}
    plant, factors = PLANTS[name], {}
    if spread > 0.0:
        plant, factors = spread_plant(plant, spread, rng)
    return Vehicle(name, file, plant, build_body(file, plant), factors)


def spread_plant(plant: Plant, spread: float, rng: np.random.Generator):
    """Random factors ``exp(N(0, spread))``, bounded to 0.6 .. 1.6, on the uncertain parameters.

    Added masses move by a quarter of it: they are known better than damping.
    """
    names = (
        ("drag_form", 1.0),
        ("friction_factor", 0.3),
        ("hull_lift", 1.0),
        ("hull_lift_x", 0.4),
        ("hull_induced", 1.0),
        ("cross_flow", 1.0),
        ("roll_linear", 1.0),
        ("fin_slope", 0.5),
        ("fin_drag", 1.0),
        ("fin_effect", 0.7),
        ("sail_slope", 0.7),
        ("kt", 0.3),
        ("kq", 0.5),
        ("added_mass", 0.25),
        ("added_cross", 0.5),
    )
    factors = {n: float(np.clip(np.exp(rng.normal(0, spread * k)), 0.6, 1.6)) for n, k in names}
    changed = {n: _times(getattr(plant, n), factors[n]) for n, _ in names}
    return replace(plant, **changed), factors


def _times(value, factor: float):
    return tuple(factor * x for x in value) if isinstance(value, tuple) else factor * value


def build_body(file: dict, plant: Plant) -> Body:
    """Everything the compiled plant needs, from the vehicle file and the plant table."""
    vehicle, hull, fluid = file["vehicle"], file["hull"], file["fluid"]
    mass = mass_matrix(vehicle, plant)
    station, radius = hull_offsets(hull)
    slope = np.gradient(radius, station)
    strip_x, strip_area = strips(station, radius, vehicle["origin_from_nose_m"])
    return Body(
        mass=mass,
        mass_inverse=np.linalg.inv(mass),
        strip_x=strip_x,
        strip_area=strip_area,
        fins=fin_table(file, plant, station, radius),
        kt=np.array(plant.kt),
        kq=np.array(plant.kq),
        weight=vehicle["mass_kg"] * GRAVITY,
        buoyancy=vehicle["buoyancy_n"],
        z_g=vehicle["z_g_m"],
        radius=hull["diameter_m"] / 2,
        length=hull["length_m"],
        density=fluid["density_kgpm3"],
        viscosity=fluid["kinematic_viscosity_m2ps"],
        frontal_area=np.pi * hull["diameter_m"] ** 2 / 4,
        wetted_area=float(np.trapezoid(2 * np.pi * radius * np.sqrt(1 + slope**2), station)),
        drag_form=plant.drag_form,
        friction_factor=plant.friction_factor,
        hull_lift=plant.hull_lift,
        hull_lift_x=plant.hull_lift_x,
        hull_induced=plant.hull_induced,
        cross_flow=plant.cross_flow,
        roll_linear=plant.roll_linear,
        roll_quadratic=plant.roll_quadratic,
        propeller_diameter=file["propeller"]["diameter_m"],
        wake=plant.wake,
        deduction=plant.deduction,
        x_g=float(vehicle["x_g_m"]),
        y_g=plant.y_g,
        damping=np.array(plant.damping),
    )


def mass_matrix(vehicle: dict, plant: Plant) -> np.ndarray:
    """Rigid-body plus added-mass matrix about O (Fossen 2011, eqs. 3.44 and 6.50), 6x6."""
    m, z_g = vehicle["mass_kg"], vehicle["z_g_m"]
    rigid = np.diag([m, m, m, plant.i_xx, vehicle["iyy_kgm2"], vehicle["izz_kgm2"]])
    rigid[0, 4] = rigid[4, 0] = m * z_g
    rigid[1, 3] = rigid[3, 1] = -m * z_g
    off_centre = ((1, 5, vehicle["x_g_m"]), (2, 4, -vehicle["x_g_m"]))
    for row, column, arm in (*off_centre, (0, 5, -plant.y_g), (2, 3, plant.y_g)):
        rigid[row, column] += m * arm
        rigid[column, row] += m * arm
    added = -np.diag(plant.added_mass)
    places = (1, 5), (2, 4), (1, 3), (3, 5)
    for (row, column), value in zip(places, plant.added_cross, strict=True):
        added[row, column] = added[column, row] = -value
    return rigid + added


def hull_offsets(hull: dict, points: int = 401) -> tuple[np.ndarray, np.ndarray]:
    """Stations from the nose [m] and radii [m]: tabulated, or Myring (1976)."""
    station = np.linspace(0.0, hull["length_m"], points)
    if "offsets_radius_m" in hull:
        table = hull["offsets_x_from_nose_m"], hull["offsets_radius_m"]
        return station, np.interp(station, *table)
    d, a, c = hull["diameter_m"], hull["nose_length_m"], hull["tail_length_m"]
    tangent = np.tan(np.radians(hull["myring_theta_deg"]))
    nose = np.clip(1 - ((station - a) / a) ** 2, 0, 1) ** (1 / hull["myring_n"])
    s = np.maximum(station - (hull["length_m"] - c), 0.0)
    tail = d / 2 - (1.5 * d / c**2 - tangent / c) * s**2 + (d / c**3 - tangent / c**2) * s**3
    return station, np.where(station < a, d / 2 * nose, np.maximum(tail, 0.0))


def strips(station: np.ndarray, radius: np.ndarray, origin: float):
    """Centres (body axes) and side areas of equal strips along the hull."""
    edges = np.linspace(0.0, station[-1], STRIPS + 1)
    middle = (edges[1:] + edges[:-1]) / 2
    return origin - middle, 2 * np.interp(middle, station, radius) * np.diff(edges)


def fin_table(file: dict, plant: Plant, station: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """One row per fin: two rudders, two elevators and, where there is one, the sail."""
    rows = []
    for fin in file["fin"]:
        span = fin["exposed_span_m"]
        area = span * (fin["root_chord_m"] + fin["tip_chord_m"]) / 2
        origin = file["vehicle"]["origin_from_nose_m"]
        arm = float(np.interp(origin - fin["x_m"], station, radius)) + 0.45 * span
        aspect = 2 * span**2 / area
        upright = fin["kind"] != "elevator"
        sail = fin["kind"] == "sail"
        control = {"rudder": CONTROL_RUDDER, "elevator": CONTROL_ELEVATOR}.get(fin["kind"], 0)
        for side in (-1.0, 1.0)[: fin["count"]]:
            row = np.zeros(FIN_COLUMNS)
            row[FIN_X], row[FIN_AREA] = fin["x_m"], area
            row[FIN_Z if upright else FIN_Y] = side * arm
            row[FIN_UPRIGHT], row[FIN_CONTROL] = float(upright), control
            row[FIN_SLOPE] = plant.sail_slope if sail else plant.fin_slope
            row[FIN_STALL], row[FIN_DRAG] = plant.fin_stall, plant.fin_drag
            row[FIN_INDUCED] = 1.0 / (np.pi * plant.oswald * aspect)
            row[FIN_UPWASH] = 1.0 if sail else plant.fin_upwash
            row[FIN_EFFECT] = 0.0 if sail else plant.fin_effect
            rows.append(row)
    return np.array(rows)
