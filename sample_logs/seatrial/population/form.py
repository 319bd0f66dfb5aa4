"""A vehicle drawn at random: geometry, mass and everything hydrodynamic, in proportion.

Ranges are wide but those of vehicles that exist: REMUS 100 (Prestero 2001) and the plants of
`seatrial.vehicles` lie inside of all of them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from seatrial.population.hull import DrawnHull, draw_hull
from seatrial.vehicles import GRAVITY, Plant, Vehicle, build_body

LENGTH_M, FINENESS, SPEED_MPS = (0.8, 8.0), (4.0, 10.0), (0.5, 3.0)
TIME_S = (0.4, 5.0)  # L/U
RPM = (100.0, 2500.0)
# Sway and yaw at which the shares of the damping are meant [of U, of U/L]
SWAY_SHARE, YAW_SHARE = 0.15, 0.6


class Refused(Exception):
    """A drawn vehicle that cannot be built or sailed; the message is the reason."""


@dataclass(frozen=True)
class Size:
    """The scales of a vehicle, by which everything else of a trial is measured (SI)."""

    length: float
    diameter: float
    speed: float
    density: float

    @property
    def time(self) -> float:
        """L/U [s]."""
        return self.length / self.speed

    @property
    def force(self) -> float:
        """1/2 rho U^2 L^2 [N]."""
        return 0.5 * self.density * self.speed**2 * self.length**2


def draw_size(rng: np.random.Generator) -> Size:
    """Length, diameter, design speed; L/U within `TIME_S`."""
    length = float(np.exp(rng.uniform(*np.log(LENGTH_M))))
    low = max(SPEED_MPS[0], length / TIME_S[1])
    high = min(SPEED_MPS[1], length / TIME_S[0])
    speed = float(np.exp(rng.uniform(np.log(low), np.log(high))))
    density = float(rng.uniform(1000.0, 1028.0))
    length = round(length, 3)
    return Size(length, round(length / rng.uniform(*FINENESS), 4), round(speed, 2), density)


def draw_form(rng: np.random.Generator) -> tuple[Vehicle, Size, dict]:
    """A vehicle as the generator uses it, its scales, and the hull keys of its vehicle file."""
    size = draw_size(rng)
    hull = draw_hull(size.length, size.diameter, rng)
    file = geometry(size, hull, rng)
    plant = draw_plant(size, hull, file, rng)
    vehicle = Vehicle("drawn", file, plant, build_body(file, plant), {})
    lowest = np.linalg.eigvalsh(vehicle.body.mass).min()
    if lowest <= 0.0:
        raise Refused("mass matrix is not positive")
    return vehicle, size, hull.keys


def geometry(size: Size, hull: DrawnHull, rng: np.random.Generator) -> dict:
    """The true tables of the vehicle: mass, hull, fins, propeller, DVL, fluid."""
    origin = hull.centre
    buoyancy, fins = size.density * hull.volume * GRAVITY, draw_fins(size, origin, rng)
    # a little buoyant, and no more than the elevators hold at small angles
    held = 0.05 * size.density * size.speed**2 * fin_area(fins[1]) * 3.0
    mass = (buoyancy - min(rng.uniform(0.0005, 0.004) * buoyancy, held)) / GRAVITY
    inertia = mass * hull.gyration**2 * rng.uniform(0.85, 1.1)
    z_g = size.diameter * float(np.exp(rng.uniform(np.log(0.008), np.log(0.1))))
    return {
        "vehicle": {
            "mass_kg": mass,
            "izz_kgm2": inertia,
            "iyy_kgm2": inertia * rng.uniform(0.97, 1.03),
            "x_g_m": z_g * math.tan(math.radians(rng.uniform(-2.0, 2.0))),
            "z_g_m": z_g,
            "origin_from_nose_m": origin,
            "buoyancy_n": buoyancy,
        },
        "hull": {
            "length_m": size.length,
            "diameter_m": size.diameter,
            "offsets_x_from_nose_m": hull.station,
            "offsets_radius_m": hull.radius,
        },
        "fin": fins,
        "propeller": {
            "diameter_m": round(float(rng.uniform(0.45, 0.85)) * size.diameter, 4),
            "x_m": origin - size.length * 1.01,
        },
        "dvl": {"x_m": round(float(rng.uniform(-0.3, 0.3)) * size.length, 3), "y_m": 0.0},
        "fluid": {
            "density_kgpm3": size.density,
            "kinematic_viscosity_m2ps": float(rng.uniform(1.05e-6, 1.5e-6)),
        },
    }


def draw_fins(size: Size, origin: float, rng: np.random.Generator) -> list[dict]:
    """Two rudders, two elevators and, on one vehicle in three, a sail."""
    tail = origin - size.length
    area = rng.uniform(0.016, 0.05) * size.length * size.diameter  # of one fin
    x = tail + rng.uniform(0.04, 0.10) * size.length
    rudder = _fin("rudder", 2, x, area, rng.uniform(0.8, 1.7), rng)
    elevator = {**rudder, "kind": "elevator"}
    if rng.random() < 0.3:
        area *= rng.uniform(0.8, 1.3)
        elevator = _fin("elevator", 2, x, area, rng.uniform(0.8, 1.7), rng)
    fins = [rudder, elevator]
    if rng.random() < 0.33:
        area = rng.uniform(0.03, 0.10) * size.length * size.diameter
        x = rng.uniform(0.0, 0.2) * size.length
        fins.append(_fin("sail", 1, x, area, rng.uniform(0.5, 1.2), rng))
    return fins


def _fin(kind: str, count: int, x: float, area: float, aspect: float, rng) -> dict:
    """One set of fins; `aspect` is span over mean chord of one fin."""
    span, taper = math.sqrt(area * aspect), rng.uniform(0.55, 1.0)
    root = 2.0 * area / span / (1.0 + taper)
    return {
        "kind": kind,
        "count": count,
        "x_m": round(float(x), 4),
        "exposed_span_m": round(span, 4),
        "root_chord_m": round(root, 4),
        "tip_chord_m": round(taper * root, 4),
        "sweep_deg": round(float(rng.uniform(0.0, 20.0)), 1),
        "tip": str(rng.choice(["square", "faired"])),
    }


def fin_area(fin: dict) -> float:
    """Exposed area of one fin [m^2]."""
    return fin["exposed_span_m"] * (fin["root_chord_m"] + fin["tip_chord_m"]) / 2


def lift_slope(fin: dict, rng: np.random.Generator) -> float:
    """Slope [1/rad] of a low-aspect-ratio wing and its image (Helmbold 1942), with scatter."""
    aspect = 2.0 * fin["exposed_span_m"] ** 2 / fin_area(fin)
    half = 2.0 / aspect
    return float(2 * math.pi / (half + math.sqrt(1.0 + half**2)) * rng.uniform(0.85, 1.15))


def draw_plant(size: Size, hull: DrawnHull, file: dict, rng: np.random.Generator) -> Plant:
    """Everything that the vehicle file does not say."""
    rudder = file["fin"][0]
    sail = [f for f in file["fin"] if f["kind"] == "sail"]
    lift = rng.uniform(0.5, 1.5) * 0.5 * size.density * size.diameter**2
    added, cross = added_masses(size, hull, file, rng)
    roll_inertia = file["vehicle"]["mass_kg"] * size.diameter**2 / 8 * rng.uniform(0.7, 1.1)
    stiffness = file["vehicle"]["mass_kg"] * GRAVITY * file["vehicle"]["z_g_m"]
    critical = 2.0 * math.sqrt(stiffness * (roll_inertia - added[3]))
    parts = {
        "added_mass": added,
        "added_cross": cross,
        "i_xx": roll_inertia,
        "drag_form": float(rng.uniform(0.05, 0.19)),
        "friction_factor": float(rng.uniform(1.0, 1.3)),
        "hull_lift": lift,
        "hull_lift_x": float(-rng.uniform(0.15, 0.38) * size.length),
        "hull_induced": lift * rng.uniform(0.4, 0.9),
        "cross_flow": float(rng.uniform(0.3, 1.3)),
        "roll_linear": critical * float(np.exp(rng.uniform(np.log(0.03), np.log(0.4)))),
        "roll_quadratic": critical * float(rng.uniform(0.02, 0.3)),
        "fin_slope": lift_slope(rudder, rng),
        "fin_stall": float(rng.uniform(0.33, 0.48)),
        "fin_drag": float(rng.uniform(0.008, 0.02)),
        "oswald": float(rng.uniform(0.75, 0.9)),
        "fin_upwash": float(rng.uniform(0.9, 1.25)),
        "fin_effect": float(rng.uniform(0.38, 0.9)),
        "sail_slope": lift_slope(sail[0], rng) if sail else 0.0,
        "dvl_z": float(rng.uniform(0.3, 0.5)) * size.diameter,
        "turbulence": turbulence(size, rng),
        "y_g": file["vehicle"]["z_g_m"] * math.tan(math.radians(rng.uniform(-1.5, 1.5))),
    }
    parts["damping"] = draw_damping(size, parts, rudder, rng)
    return Plant(**parts, **draw_propeller(size, hull, file, parts, rng))


def added_masses(size: Size, hull: DrawnHull, file: dict, rng) -> tuple[tuple, tuple]:
    """Strips of circles and fins, less at the ends; and the couplings (Newman 1977, ch. 4)."""
    x = file["vehicle"]["origin_from_nose_m"] - hull.station
    strip = rng.uniform(0.85, 1.0) * size.density * math.pi * hull.radius**2
    totals = {}
    for axis in ("rudder", "elevator"):
        fin = next(f for f in file["fin"] if f["kind"] == axis)
        plate = 2.0 * rng.uniform(0.7, 1.1) * size.density * math.pi / 4
        plate *= fin["exposed_span_m"] ** 2 * (fin["root_chord_m"] + fin["tip_chord_m"])
        plate /= 2.0
        sums = [float(np.trapezoid(strip * x**k, hull.station)) for k in range(3)]
        totals[axis] = [s + plate * fin["x_m"] ** k for k, s in enumerate(sums)]
    (sway, sway_x, yaw), (heave, heave_x, pitch) = totals["rudder"], totals["elevator"]
    roll = 0.4 * file["vehicle"]["mass_kg"] * size.diameter**2 / 8 * rng.uniform(0.5, 1.5)
    height = y_p = n_p = 0.0
    for sail in (f for f in file["fin"] if f["kind"] == "sail"):
        chord = (sail["root_chord_m"] + sail["tip_chord_m"]) / 2
        plate = size.density * math.pi / 4 * sail["exposed_span_m"] ** 2 * chord
        height = size.diameter / 2 + 0.45 * sail["exposed_span_m"]
        sway, sway_x = sway + plate, sway_x + plate * sail["x_m"]
        yaw, roll = yaw + plate * sail["x_m"] ** 2, roll + plate * height**2
        y_p, n_p = -plate * height, -plate * height * sail["x_m"]
    # slender spheroids: k1 falls from 0.08 at fineness 4 to 0.02 at 10 (Lamb 1932, art. 115)
    surge = size.density * hull.volume * 0.6 * (size.diameter / size.length) ** 1.45
    added = (-surge * rng.uniform(0.8, 1.3), -sway, -heave, -roll, -pitch, -yaw)
    return added, (-sway_x, heave_x, y_p, n_p)


def draw_damping(size: Size, parts: dict, rudder: dict, rng: np.random.Generator) -> tuple:
    """Damping beside lift and strips, on half of the vehicles, in any mixture of orders.

    Sizes are shares of what hull lift and fins do at `SWAY_SHARE` and `YAW_SHARE`.
    """
    if rng.random() < 0.5:
        return ((0.0, 0.0, 0.0),) * 4
    v, r = SWAY_SHARE * size.speed, YAW_SHARE * size.speed / size.length
    fins = size.density * fin_area(rudder) * parts["fin_slope"] * parts["fin_upwash"]
    sway = (parts["hull_lift"] + fins) * size.speed * v
    yaw = parts["hull_lift"] * parts["hull_lift_x"] ** 2 + fins * rudder["x_m"] ** 2
    yaw *= size.speed * r
    strength, mixture = rng.uniform(0.1, 0.7, 2), rng.dirichlet([0.6, 0.6, 0.6], 2)
    rows = [
        [float(f * q / at**k) for k, q in enumerate(m, 1)]
        for f, at, m in zip((strength[0] * sway, strength[1] * yaw), (v, r), mixture, strict=True)
    ]
    vertical = rng.uniform(0.8, 1.2, 2)
    heave, pitch = ([float(k * a) for a in row] for k, row in zip(vertical, rows, strict=True))
    return tuple(map(tuple, (rows[0], heave, pitch, rows[1])))


def hull_drag(size: Size, hull: DrawnHull, file: dict, parts: dict) -> float:
    """Drag [N] ahead at the design speed, hull and fins."""
    reynolds = size.speed * size.length / file["fluid"]["kinematic_viscosity_m2ps"]
    friction = 0.075 / (math.log10(reynolds) - 2.0) ** 2
    slope = np.gradient(hull.radius, hull.station)
    wetted = np.trapezoid(2 * np.pi * hull.radius * np.sqrt(1 + slope**2), hull.station)
    area = parts["drag_form"] * math.pi * size.diameter**2 / 4
    area += parts["friction_factor"] * friction * wetted
    area += sum(f["count"] * fin_area(f) for f in file["fin"]) * parts["fin_drag"]
    return float(0.5 * size.density * size.speed**2 * area)


def draw_propeller(size: Size, hull: DrawnHull, file: dict, parts: dict, rng) -> dict:
    """Curves, wake, and the speed that balances the drag at the design speed."""
    kt0, zero, bend = rng.uniform(0.24, 0.42), rng.uniform(0.75, 1.25), -rng.uniform(0.03, 0.2)
    kt = (float(kt0), float(-(kt0 + bend * zero**2) / zero), float(bend))
    kq0, far = kt0 * rng.uniform(0.11, 0.14), 1.1 * zero
    kq_bend = -kq0 * rng.uniform(0.2, 0.5) / far**2
    kq = (float(kq0), float(-(kq0 + kq_bend * far**2) / far), float(kq_bend))
    wake, deduction = float(rng.uniform(0.08, 0.3)), float(rng.uniform(0.04, 0.18))
    d = file["propeller"]["diameter_m"]
    needed = hull_drag(size, hull, file, parts) / ((1 - deduction) * size.density * d**4)
    inflow = (1 - wake) * size.speed / d
    # kt0 n^2 + kt1 inflow n + kt2 inflow^2 = needed
    half, rest = kt[1] * inflow / (2 * kt[0]), (kt[2] * inflow**2 - needed) / kt[0]
    revs = -half + math.sqrt(max(half**2 - rest, 0.0))
    if not RPM[0] < 60.0 * revs < RPM[1]:
        raise Refused("propeller: speed of rotation out of range")
    if not 0.25 < inflow / revs < 0.85 * zero:
        raise Refused("propeller: advance ratio out of range")
    curves = {"kt": kt, "kq": kq, "wake": wake, "deduction": deduction}
    return {**curves, "cruise_rpm": round(60.0 * revs)}


def turbulence(size: Size, rng: np.random.Generator) -> tuple:
    """Deviations of the outer forces: those of the REMUS plant by the scales, times 0.3 to 2."""
    f = 3.7e-5 * size.force * float(rng.uniform(0.3, 2.0))
    moment = 0.2 * f * size.length
    return (f / 3, f, f, 0.2 * f * size.diameter, moment, moment)
