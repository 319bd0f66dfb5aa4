"""Fins and sail on the hull (theory 4, 5): lift, drag, cross-flow and added mass.

A set acts in a plane of motion with the square of the cosine between its normal and the sideways
motion of that plane: 1 for a rudder in the horizontal plane, 1/2 for an X-tail at 45 degrees.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from auvident.physics.ase import interference
from auvident.physics.ase.accuracy import Deviation
from auvident.physics.ase.drag import fin_profile_drag
from auvident.physics.ase.geometry import HullGeometry
from auvident.schema.coefficients import Plane
from auvident.schema.vehicle import AseOptions, Fin

LIFT_EFFICIENCY = 0.9  # section lift slope over 2 pi, and span efficiency (Whicker & Fehlner 1958)
# C_Dc = 0.1 + slope * taper (Whicker & Fehlner 1958 fig. 28: 0.80 and 0.40 at taper 0.45).
LEAST_CROSSFLOW_ASPECT = 0.5  # C_Dc/A of a long low strake would exceed a plate across the flow
CROSSFLOW_BASE, CROSSFLOW_SLOPE = 0.1, {"square": 1.6, "faired": 0.7}


@dataclass(frozen=True)
class FinForces:
    """A set of fins as the assembly needs it: forces over u^2, kg/m, of the whole set.

    Attributes
    ----------
    kind : str
        ``rudder``, ``elevator`` or ``sail``.
    commands : tuple of str
        What deflects it.
    x_m : ndarray
        Centre of pressure.
    incidence, deflection, induced, induced_deflection, profile, crossflow : ndarray
        Half density times area times K C_La (incidence), K C_La (deflection), K C_Di (both),
        C_D0 and C_Dc/A.
    projection : dict of str to float
        Cosine between the normal of the fins and the sideways motion, by plane.
    """

    kind: str
    commands: tuple[str, ...]
    x_m: np.ndarray
    incidence: np.ndarray
    deflection: np.ndarray
    induced: np.ndarray
    induced_deflection: np.ndarray
    profile: np.ndarray
    crossflow: np.ndarray
    projection: dict[str, float]


def mean_chord_m(fin: Fin) -> np.ndarray:
    """Mean of the chords at root and tip."""
    return 0.5 * (np.asarray(fin.root_chord_m, float) + np.asarray(fin.tip_chord_m, float))


def area_m2(fin: Fin) -> np.ndarray:
    """Planform of one fin."""
    return np.asarray(fin.exposed_span_m, float) * mean_chord_m(fin)


def aspect_ratio(fin: Fin) -> np.ndarray:
    """2 h^2 / S of one fin: the hull acts as a reflection plane (theory 4.1)."""
    return 2.0 * np.asarray(fin.exposed_span_m, float) ** 2 / area_m2(fin)


def lift_slope(aspect: Any, sweep_rad: Any = 0.0, law: str = "whicker_fehlner") -> np.ndarray:
    """Slope of the lift coefficient of a low-aspect-ratio fin, 1/rad.

    Parameters
    ----------
    aspect : array_like
        Aspect ratio with mirror.
    sweep_rad : array_like
        Sweep of the quarter-chord line.
    law : {"whicker_fehlner", "hoerner"}
        DTMB report 933 eq. 1; or 1/(1/(2 pi 0.9) + 1/(pi A)) (Hoerner, as Prestero 2001 eq. 4.33).

    Returns
    -------
    ndarray
    """
    a = np.asarray(aspect, float)
    if law == "hoerner":
        return 1.0 / (1.0 / (2.0 * np.pi * LIFT_EFFICIENCY) + 1.0 / (np.pi * a))
    cosine, section = np.cos(sweep_rad), 2.0 * LIFT_EFFICIENCY
    return section * np.pi * a / (section + cosine * np.sqrt(a**2 / cosine**4 + 4.0))


def crossflow_coefficient(fin: Fin) -> np.ndarray:
    """C_Dc against taper and tip (Whicker & Fehlner fig. 28, theory 4.1)."""
    taper = np.asarray(fin.tip_chord_m, float) / np.asarray(fin.root_chord_m, float)
    return CROSSFLOW_BASE + CROSSFLOW_SLOPE[fin.tip] * taper


def projection(fin: Fin, plane: Plane) -> float:
    """Cosine between the fins' normal and the sideways motion of the plane."""
    angle = np.radians(fin.dihedral_deg)
    upright = (fin.kind == "elevator") == (plane == "vertical")
    value = np.cos(angle) if upright else np.sin(angle)
    return float(value) if abs(value) > 1e-12 else 0.0


def hull_ratio(fin: Fin, hull: HullGeometry) -> np.ndarray:
    """Tau: hull radius at the fin over the distance of the tip from the axis."""
    radius = hull.radius_at(fin.mid_chord_x_m)
    return radius / (radius + np.asarray(fin.exposed_span_m, float))


def buried_share(fin: Fin, hull: HullGeometry) -> np.ndarray:
    """Share of the span inside the hull's largest diameter: it works in the hull's wake."""
    inside = 0.5 * hull.diameter_m - hull.radius_at(fin.mid_chord_x_m)
    return np.clip(inside / np.asarray(fin.exposed_span_m, float), 0.0, 1.0)


def interference_factors(
    fin: Fin, hull: HullGeometry, options: AseOptions
) -> tuple[np.ndarray, np.ndarray]:
    """Factor of the set's lift at incidence and when deflected (theory 5).

    Pairs take (1 + tau)^2 and K_W(B); a fin that has none opposite, as a sail, takes the factors
    from the added mass of a circle with one fin.
    """
    tau = hull_ratio(fin, hull)
    pairs, singles = divmod(fin.count, 2)
    single = np.ones_like(tau)
    mirror = 2.0 if _without_mirror(fin, options) else 1.0
    if options.sail_interference != "none":
        single = mirror * interference.single_fin_and_body(tau)
    pair, moved = np.ones_like(tau), np.ones_like(tau)
    if options.incidence_interference != "none":
        pair = interference.fin_and_body(tau)
    if options.deflection_interference == "incidence":
        moved = (2 * pairs * pair + singles * single) / fin.count
    elif options.deflection_interference == "k_wb":
        alone = mirror * interference.single_fin_on_body(tau)
        moved = (2 * pairs * interference.fin_on_body(tau) + singles * alone) / fin.count
    return (2 * pairs * pair + singles * single) / fin.count, moved


def fin_forces(
    fin: Fin,
    hull: HullGeometry,
    density: Any,
    reynolds_pm: Any,
    options: AseOptions,
    deviation: Deviation,
) -> FinForces:
    """Forces of one ``[[fin]]`` entry (theory tables 3.3.1 to 3.4.3).

    Parameters
    ----------
    fin : Fin
    hull : HullGeometry
    density : array_like
    reynolds_pm : array_like
        Speed over kinematic viscosity, 1/m.
    options : AseOptions
    deviation : Deviation
        Draw of the formula accuracies.

    Returns
    -------
    FinForces
    """
    slope, aspect = _isolated(fin, options)
    incidence, deflection = interference_factors(fin, hull, options)
    wake, share_incidence, share_deflection = _lift_accuracy(fin, hull, deviation)
    dynamic = 0.5 * np.asarray(density, float) * fin.count * area_m2(fin)
    lift = np.asarray(fin.efficiency, float) * deviation.scale("fin_lift") * wake
    k_incidence = incidence * share_incidence * lift
    k_deflection = deflection * share_deflection * lift
    power = 1 if options.induced_drag_scaling == "linear" else 2
    drag = slope**2 / (LIFT_EFFICIENCY * np.pi * aspect) * deviation.scale("fin_induced")
    profile = _profile_drag(fin, reynolds_pm, options)
    across = crossflow_coefficient(fin) / np.maximum(aspect, LEAST_CROSSFLOW_ASPECT)
    across = across * np.asarray(fin.efficiency, float)
    return FinForces(
        kind=fin.kind,
        commands=fin.commands,
        x_m=_centre_m(fin, deviation),
        incidence=dynamic * k_incidence * slope,
        deflection=dynamic * k_deflection * slope,
        induced=dynamic * k_incidence**power * drag,
        induced_deflection=dynamic * k_deflection**power * drag,
        profile=dynamic * profile * deviation.scale("fin_drag"),
        crossflow=dynamic * across * deviation.scale("fin_crossflow"),
        projection={
            "horizontal": projection(fin, "horizontal"),
            "vertical": projection(fin, "vertical"),
        },
    )


def _profile_drag(fin: Fin, reynolds_pm: Any, options: AseOptions) -> np.ndarray:
    """C_D0: of the fin, else of the options, else from friction and thickness."""
    for known in (fin.cd0, options.fin_cd0):
        if known is not None:
            return np.asarray(known, float)
    root, span = np.asarray(fin.root_chord_m, float), np.asarray(fin.exposed_span_m, float)
    return fin_profile_drag(reynolds_pm * area_m2(fin) / span, root / span, options.friction_line)


def _isolated(fin: Fin, options: AseOptions) -> tuple[np.ndarray, np.ndarray]:
    """Lift slope and aspect ratio of the fin without the hull."""
    aspect = aspect_ratio(fin)
    if _without_mirror(fin, options):
        aspect = 0.5 * aspect
    sweep = np.radians(np.asarray(fin.sweep_deg, float))
    return lift_slope(aspect, sweep, options.fin_lift), aspect


def _without_mirror(fin: Fin, options: AseOptions) -> bool:
    """Whether the aspect ratio is h^2/S and the factor 1 + 6 tau + tau^2 (theory 5.2)."""
    return options.sail_interference == "no_mirror" and fin.count == 1


def _lift_accuracy(
    fin: Fin, hull: HullGeometry, deviation: Deviation
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Deviation of the inflow, of the incidence factor and of the deflection factor."""
    if fin.kind == "sail":
        sail = deviation.scale("sail_interference")
        return np.ones_like(sail), sail, sail
    buried = buried_share(fin, hull)
    wake = deviation.scale("fin_wake") * deviation.scale("fin_wake_buried", buried)
    incidence = deviation.scale("fin_incidence")
    incidence = incidence * deviation.scale("fin_incidence_buried", buried)
    return wake, incidence, deviation.scale("fin_deflection")


def _centre_m(fin: Fin, deviation: Deviation) -> np.ndarray:
    """Centre of pressure: the stated station, moved by the accuracy of that station."""
    name = "sail_centre" if fin.kind == "sail" else "fin_centre"
    return np.asarray(fin.x_m, float) - mean_chord_m(fin) * deviation.shift(name)


def chord_edges_m(fin: Fin) -> tuple[np.ndarray, np.ndarray]:
    """Stations between which the fin's strips stand: its mean chord about the mid-chord point.

    Returns
    -------
    aft, forward : ndarray
        Body axes, m.
    """
    middle, half = np.asarray(fin.mid_chord_x_m, float), 0.5 * mean_chord_m(fin)
    return middle - half, middle + half
