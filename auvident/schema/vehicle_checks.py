"""Vehicles that cannot be: numbers of the file that contradict each other.

Every check names the two numbers. The vehicle's numbers may be arrays over a variants axis; the
mask of a contradiction then says which variants it concerns.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from auvident.constants import GRAVITY_MPS2
from auvident.schema.hull_shape import HullShape, hull_shape, section_lengths
from auvident.schema.vehicle import Fin, Hull, Vehicle

MASS_RATIO = (0.67, 1.5)  # mass over displaced mass of a submerged vehicle, at the very most
SHORTEST_FINENESS = 1.2  # length over diameter: below it no formula of the method holds
OFFSET_LENGTH_TOLERANCE = 0.02  # of the length, between the offsets and length_m
OFFSET_DIAMETER_TOLERANCE = 0.03  # of the diameter, between the offsets and diameter_m
STATION_TOLERANCE = 0.02  # of the length: a rudder stock may stand a little behind the hull
# Radii of gyration that no vehicle comes down to, of the length about y and z and of the largest
# radius about x: all of the mass as steel (7.8 times as dense as water), a slab across the middle
# (1 / 7.8 / sqrt(12) = 0.037) or a rod in the axis (1 / sqrt(2 * 7.8) = 0.25). Vehicles have 0.25
# and 0.7 or so.
LEAST_GYRADIUS, LEAST_ROLL_GYRADIUS = 0.037, 0.25
VOLUME_STATIONS = 400  # of the trapezoid sum behind the mass check: error below 1 %


@dataclass(frozen=True)
class Contradiction:
    """What cannot be, where, and what to do; `mask` has the shape of the variants."""

    mask: np.ndarray
    where: str
    problem: str
    remedy: str


def contradictions(vehicle: Vehicle) -> Iterator[Contradiction]:
    """Yield what cannot be about a vehicle, the basic faults first.

    Parameters
    ----------
    vehicle : Vehicle
        Offsets must have been read already.

    Yields
    ------
    Contradiction
        Only those whose mask is true somewhere.
    """
    if not vehicle.hull.is_body_of_revolution:
        return
    for check in (_lengths, _offsets, _stations, _fins, _masses, _inertias, _ballast):
        found = [c for c in check(vehicle) if np.any(c.mask)]
        yield from found
        if any(np.all(c.mask) for c in found):
            return  # later checks need what this one denies


def _say(
    mask: Any, where: str, text: Callable[..., str], remedy: str, *numbers: Any
) -> Contradiction:
    """Contradiction whose text quotes the numbers of the first variant it concerns."""
    mask = np.asarray(mask)
    arrays = np.broadcast_arrays(mask, *(np.asarray(n, float) for n in numbers))
    quoted = []
    if np.any(mask):
        first = int(np.argmax(arrays[0].ravel()))
        quoted = [float(a.ravel()[first]) for a in arrays[1:]]
    return Contradiction(mask, where, text(*quoted) if quoted else "", remedy)


def _lengths(vehicle: Vehicle) -> Iterator[Contradiction]:
    """Sections of the hull against its length and diameter."""
    hull = vehicle.hull
    if hull.family == "offsets" or hull.diameter_m is None:
        return
    length, diameter = np.asarray(hull.length_m, float), np.asarray(hull.diameter_m, float)
    nose, tail = section_lengths(hull)
    yield _say(
        length < SHORTEST_FINENESS * diameter,
        "[hull] diameter_m",
        lambda d, le: f"a hull of {le:g} m length and {d:g} m diameter is not a slender body",
        "Check both; they are metres.",
        diameter,
        length,
    )
    if hull.family == "suboff":
        return
    yield _say(
        nose + tail > length * (1.0 + 1e-9),
        "[hull] nose_length_m, tail_length_m",
        lambda n, t, le: f"nose {n:g} m and tail {t:g} m are longer than the hull, {le:g} m",
        "Shorten the nose or the tail, or lengthen the hull.",
        nose,
        tail,
        length,
    )
    base = np.asarray(hull.tail_base_diameter_m, float)
    yield _say(
        base > diameter,
        "[hull] tail_base_diameter_m",
        lambda b, d: f"the tail ends with {b:g} m, wider than the hull, {d:g} m",
        "The base is the flat end of the tail, 0 for a pointed one.",
        base,
        diameter,
    )
    if hull.family == "myring" and hull.myring_theta_deg is not None:
        yield _bulging_tail(hull, tail)


def _bulging_tail(hull: Hull, tail: np.ndarray) -> Contradiction:
    """A Myring tail so long for its end angle that it grows wider than the hull."""
    drop = 0.5 * (np.asarray(hull.diameter_m, float) - np.asarray(hull.tail_base_diameter_m, float))
    theta = np.asarray(hull.myring_theta_deg, float)
    c = tail + np.asarray(hull.myring_tail_offset_m, float)
    most = np.degrees(np.arctan2(3.0 * drop, c))
    return _say(
        theta > most,
        "[hull] myring_theta_deg",
        lambda t, m: (
            f"a tail ending with {t:g} deg grows wider than the hull; {m:.3g} deg is the "
            "most for its length"
        ),
        "Lower myring_theta_deg or shorten the tail.",
        theta,
        most,
    )


def _offsets(vehicle: Vehicle) -> Iterator[Contradiction]:
    """Free offsets against themselves and against the sizes of the file."""
    hull = vehicle.hull
    if hull.family != "offsets" or hull.offsets_x_from_nose_m is None:
        return
    x = np.asarray(hull.offsets_x_from_nose_m, float)
    r = np.asarray(hull.offsets_radius_m, float)
    where = "[hull] offsets"
    fault, remedy = offset_fault(x, r)
    if fault:
        yield Contradiction(np.asarray(True), where, fault, remedy)
        return
    yield _say(
        abs(x[-1] - x[0] - hull.length_m) > OFFSET_LENGTH_TOLERANCE * hull.length_m,
        where,
        lambda end, le: f"the offsets reach over {end:g} m, length_m says {le:g} m",
        "Let the offsets run from nose tip to tail end.",
        x[-1] - x[0],
        hull.length_m,
    )
    if hull.diameter_m is not None:
        yield _say(
            abs(2.0 * r.max() - hull.diameter_m) > OFFSET_DIAMETER_TOLERANCE * hull.diameter_m,
            where,
            lambda d, le: f"twice the largest offset is {d:g} m, diameter_m says {le:g} m",
            "The offsets are radii.",
            2.0 * r.max(),
            hull.diameter_m,
        )
    if hull.tail_length_m is not None:
        yield _say(
            hull.tail_length_m >= x[-1] - x[0],
            "[hull] tail_length_m",
            lambda t, le: f"the tail, {t:g} m, is as long as the hull, {le:g} m",
            "Leave it out to have it found from the offsets.",
            hull.tail_length_m,
            x[-1] - x[0],
        )


def offset_fault(x: np.ndarray, radius: np.ndarray) -> tuple[str, str]:
    """What is wrong with offsets and what to do; empty strings when nothing is."""
    if x.shape != radius.shape:
        return f"{x.size} stations but {radius.size} radii", "Give one radius per station."
    if x.size < 4:
        return f"{x.size} points are too few", "Give at least 4, better 20 or more."
    steps = np.flatnonzero(np.diff(x) <= 0.0)
    if steps.size:
        i = int(steps[0])
        return (
            f"the stations do not ascend: {x[i + 1]:g} m follows {x[i]:g} m (point {i + 2})",
            "Sort the points from nose to tail and drop repeated ones.",
        )
    if x[0] < 0.0:
        return f"the first station, {x[0]:g} m, lies ahead of the nose", "Measure from the nose."
    if np.any(radius < 0.0):
        i = int(np.argmax(radius < 0.0))
        return f"the radius {radius[i]:g} m at {x[i]:g} m is negative", "Radii are 0 or more."
    if radius.max() <= 0.0:
        return "every radius is zero", "Radii are metres."
    if x[-1] - x[0] < 2.0 * SHORTEST_FINENESS * radius.max():
        return (
            f"a hull of {x[-1] - x[0]:g} m length and {2.0 * radius.max():g} m diameter is "
            "not a slender body",
            "Check the units; stations and radii are metres.",
        )
    return "", ""


def _stations(vehicle: Vehicle) -> Iterator[Contradiction]:
    """Origin and centre of gravity against the hull."""
    body, length = vehicle.body, np.asarray(vehicle.hull.length_m, float)
    origin = np.asarray(body.origin_from_nose_m, float)
    yield _say(
        origin > length,
        "[vehicle] origin_from_nose_m",
        lambda o, le: f"the origin, {o:g} m behind the nose, is outside the hull, {le:g} m long",
        "It is the distance of O from the nose tip, positive.",
        origin,
        length,
    )
    gravity = origin - np.asarray(body.x_g_m, float)
    yield _say(
        (gravity < 0.0) | (gravity > length),
        "[vehicle] x_g_m",
        lambda g, le: (
            f"the centre of gravity, {g:g} m behind the nose, is outside the hull, 0 to {le:g} m"
        ),
        "x_g_m is measured from O, forward positive.",
        gravity,
        length,
    )
    radius = hull_shape(vehicle.hull).max_radius_m
    yield _say(
        np.abs(np.asarray(body.z_g_m, float)) > radius,
        "[vehicle] z_g_m",
        lambda z, r: (
            f"the centre of gravity lies {z:g} m off the axis, the hull's radius is {r:g} m"
        ),
        "z_g_m is positive downwards, metres.",
        body.z_g_m,
        radius,
    )


def _fins(vehicle: Vehicle) -> Iterator[Contradiction]:
    """Fins against the hull they stand on."""
    shape = hull_shape(vehicle.hull)
    length = np.asarray(vehicle.hull.length_m, float)
    nose = np.asarray(vehicle.body.origin_from_nose_m, float)
    for i, fin in enumerate(vehicle.fin):
        where = f"[[fin]] {i + 1} ({fin.kind})"
        x = np.asarray(fin.x_m, float)
        slack = STATION_TOLERANCE * length
        yield _say(
            (x > nose + slack) | (x < nose - length - slack),
            f"{where} x_m",
            lambda p, front, aft: (
                f"the station {p:g} m is outside the hull, {aft:g} to {front:g} m"
            ),
            "x_m is measured from O, forward positive: a stern fin has x_m < 0.",
            x,
            nose,
            nose - length,
        )
        root, tip = np.asarray(fin.root_chord_m, float), np.asarray(fin.tip_chord_m, float)
        yield _say(
            np.maximum(root, tip) > length,
            f"{where} root_chord_m",
            lambda c, le: f"a chord of {c:g} m is longer than the hull, {le:g} m",
            "Chords are metres.",
            np.maximum(root, tip),
            length,
        )
        yield _tip_inside(fin, shape, nose, where)
        yield _say(
            np.asarray(fin.exposed_span_m, float) > length,
            f"{where} exposed_span_m",
            lambda s, le: f"a span of {s:g} m is longer than the hull, {le:g} m",
            "It is the height of one fin above the hull, metres.",
            fin.exposed_span_m,
            length,
        )


def _tip_inside(fin: Fin, shape: HullShape, nose: np.ndarray, where: str) -> Contradiction:
    """The tip, measured from the hull at x_m, against the thicker hull at its leading edge."""
    half = 0.5 * np.asarray(fin.exposed_span_m, float)
    back = half * np.tan(np.radians(np.asarray(fin.sweep_deg, float)))
    root_chord, tip_chord = np.asarray(fin.root_chord_m, float), np.asarray(fin.tip_chord_m, float)
    middle = np.asarray(fin.mid_chord_x_m, float)
    lead = middle + 0.125 * (root_chord + tip_chord) - back + 0.25 * tip_chord
    root = shape.radius_m((nose - middle)[..., None])[..., 0]
    there = shape.radius_m((nose - lead)[..., None])[..., 0]
    return _say(
        there > root + 2.0 * half,
        f"{where} exposed_span_m",
        lambda s, r: (
            f"the tip, {s:.4g} m from the axis, is inside the hull at its leading edge, {r:.4g} m"
        ),
        "exposed_span_m is the height above the hull at mid-chord; check it and x_m.",
        root + 2.0 * half,
        there,
    )


def _masses(vehicle: Vehicle) -> Iterator[Contradiction]:
    """Mass and buoyancy of a submerged body against the volume of its hull."""
    shape, body = hull_shape(vehicle.hull), vehicle.body
    xi = np.linspace(0.0, 1.0, VOLUME_STATIONS) * shape.edges_m[..., -1:]
    section = np.pi * np.maximum(shape.squared_radius(xi)[0], 0.0)
    volume = np.trapezoid(section, xi, axis=-1)
    mass = np.asarray(body.mass_kg, float)
    displaced = np.asarray(vehicle.fluid.density_kgpm3, float) * volume
    low, high = MASS_RATIO
    yield _say(
        (mass < low * displaced) | (mass > high * displaced),
        "[vehicle] mass_kg",
        lambda m, d: (
            f"a mass of {m:g} kg contradicts the {d:.4g} kg of water that the hull displaces"
        ),
        "Check mass_kg, the hull's sizes (metres) and density_kgpm3; a free-flooding vehicle "
        "counts with the water it carries.",
        mass,
        displaced,
    )
    if body.displaced_volume_m3 is not None:
        stated = np.asarray(body.displaced_volume_m3, float)
        yield _say(
            (stated < low * volume) | (stated > high * volume),
            "[vehicle] displaced_volume_m3",
            lambda s, v: f"a volume of {s:g} m^3 contradicts the hull's, {v:.4g} m^3",
            "Check the unit and the hull's sizes.",
            stated,
            volume,
        )


def _inertias(vehicle: Vehicle) -> Iterator[Contradiction]:
    """Radii of gyration against the reach of the hull from O, and against its length."""
    body, length = vehicle.body, np.asarray(vehicle.hull.length_m, float)
    origin = np.asarray(body.origin_from_nose_m, float)
    radius = hull_shape(vehicle.hull).max_radius_m
    whole = np.maximum(origin, length - origin) + radius
    least = LEAST_GYRADIUS * length
    for name, inertia, reach, low in (
        ("izz_kgm2", body.izz_kgm2, whole, least),
        ("iyy_kgm2", body.iyy_kgm2, whole, least),
        ("ixx_kgm2", body.ixx_kgm2, radius, LEAST_ROLL_GYRADIUS * radius),
    ):
        if inertia is None:
            continue
        gyradius = np.sqrt(np.asarray(inertia, float) / np.asarray(body.mass_kg, float))
        yield _say(
            gyradius > reach,
            f"[vehicle] {name}",
            lambda k, le: (
                f"the radius of gyration, {k:.3g} m, is larger than the hull reaches "
                f"from O, {le:.3g} m"
            ),
            "Inertia is about O, in kg m^2.",
            gyradius,
            reach,
        )
        yield _say(
            gyradius < low,
            f"[vehicle] {name}",
            lambda k, le: (
                f"the radius of gyration, {k:.3g} m, is smaller than {le:.3g} m, that of this mass "
                "as a block of steel in the middle of the hull"
            ),
            "Inertia is about O, in kg m^2.",
            gyradius,
            low,
        )


def _ballast(vehicle: Vehicle) -> Iterator[Contradiction]:
    """Buoyancy against the weight, and what is unsure of the ballasting against the vehicle."""
    body = vehicle.body
    weight = np.asarray(body.mass_kg, float) * GRAVITY_MPS2
    if body.buoyancy_n is not None:
        buoyancy, (low, high) = np.asarray(body.buoyancy_n, float), MASS_RATIO
        yield _say(
            (weight < low * buoyancy) | (weight > high * buoyancy),
            "[vehicle] buoyancy_n",
            lambda b, w: f"a buoyancy of {b:g} N contradicts the weight, {w:.4g} N",
            "buoyancy_n is a force, newtons; leave it out for a neutral vehicle.",
            buoyancy,
            weight,
        )
    most = {
        "buoyancy_std_n": (body.buoyancy_std_n, weight, "N", "weight"),
        "x_g_std_m": (body.x_g_std_m, vehicle.hull.length_m, "m", "length"),
        "z_g_std_m": (body.z_g_std_m, hull_shape(vehicle.hull).max_radius_m, "m", "radius"),
    }
    for key, (std, size, unit, what) in most.items():
        if std is not None:
            yield _too_unsure(key, std, size, unit, what)


def _too_unsure(key: str, std: Any, size: Any, unit: str, what: str) -> Contradiction:
    """A standard deviation beyond the vehicle itself."""
    return _say(
        np.asarray(std, float) > np.asarray(size, float),
        f"[vehicle] {key}",
        lambda s, n: (
            f"a standard deviation of {s:g} {unit} is larger than the {what}, {n:.4g} {unit}"
        ),
        f"Check the unit; leave {key} out for what careful ballasting reaches.",
        std,
        size,
    )
