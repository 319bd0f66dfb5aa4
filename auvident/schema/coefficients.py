"""The hydrodynamic coefficients and the constants estimated beside them, each declared once.

Labels of the filters, artifacts, reports and ``auvident coefficients`` derive from these tables.
A force or moment coefficient multiplies the product of velocities in ``regressor`` on the
right-hand side of its equation; an added mass multiplies an acceleration.
Source of the list: theory of the method, equations 2.2.18-20 (horizontal), 2.2.31-33 (vertical).

A constant is a force or moment of weight and buoyancy; it has no prime value, as it does not grow
with the speed.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from auvident.schema.planes import PLANES, Plane

Group = Literal[
    "surge_inertia",
    "drag",
    "thrust",
    "turning_drag",
    "inertia",
    "lift",
    "cross_flow",
    "control",
    "restoring",
]


@dataclass(frozen=True)
class Coefficient:
    """Declaration of one coefficient.

    Attributes
    ----------
    symbol : str
        Name in every file and table, e.g. ``Y_v|v|``.
    planes : tuple of str
        Planes of motion in whose equations it stands.
    equation : str
        ``X``, ``Y``, ``N``, ``Z`` or ``M``.
    regressor : str
        What it multiplies, for people; ``d`` is the rudder (elevator) angle, ``n`` in rev/s.
    group : str
        Coefficients that matter in the same maneuvers; a plan file may name a group.
    unit : str
        SI unit of the dimensional value.
    length_power : int
        The prime (SNAME) value is value / (density/2 * length**length_power).
    sign : int
        Sign expected of a streamlined hull with stern fins: -1, +1, or 0 when either occurs.
    meaning : str
        One line for people.
    """

    symbol: str
    planes: tuple[Plane, ...]
    equation: str
    regressor: str
    group: Group
    unit: str
    length_power: int
    sign: int
    meaning: str


@dataclass(frozen=True)
class Constant:
    """Declaration of one constant; attributes as of `Coefficient`."""

    symbol: str
    planes: tuple[Plane, ...]
    equation: str
    regressor: str
    group: Group
    unit: str
    sign: int
    meaning: str


H: tuple[Plane, ...] = ("horizontal",)
V: tuple[Plane, ...] = ("vertical",)
HV = PLANES

# fmt: off
COEFFICIENTS: tuple[Coefficient, ...] = (
    # symbol, planes, equation, regressor, group, unit, length power, sign, meaning
    Coefficient("X_udot", HV, "X", "du/dt", "surge_inertia", "kg", 3, -1, "added mass in surge"),
    Coefficient("X_uu", HV, "X", "u|u|", "drag", "kg/m", 2, -1, "axial drag"),
    Coefficient("X_vv", H, "X", "v v", "turning_drag", "kg/m", 2, 0, "axial force due to sway"),
    Coefficient("X_vr", H, "X", "v r", "turning_drag", "kg", 3, +1, "axial force due to sway and yaw"),
    Coefficient("X_rr", H, "X", "r r", "turning_drag", "kg m", 4, 0, "axial force due to yaw"),
    Coefficient("X_ww", V, "X", "w w", "turning_drag", "kg/m", 2, 0, "axial force due to heave"),
    Coefficient("X_wq", V, "X", "w q", "turning_drag", "kg", 3, -1, "axial force due to heave and pitch"),
    Coefficient("X_qq", V, "X", "q q", "turning_drag", "kg m", 4, 0, "axial force due to pitch"),
    Coefficient("X_uudd", HV, "X", "u u (dr dr + de de)", "turning_drag", "kg/m", 2, -1, "drag of deflected fins"),
    Coefficient("T_nn", HV, "X", "n|n|", "thrust", "kg m", 4, +1, "thrust at zero advance"),
    Coefficient("T_nu", HV, "X", "|n|u", "thrust", "kg", 3, -1, "loss of thrust with advance"),
    Coefficient("Y_vdot", H, "Y", "dv/dt", "inertia", "kg", 3, -1, "added mass in sway"),
    Coefficient("Y_rdot", H, "Y", "dr/dt", "inertia", "kg m", 4, 0, "added mass, sway due to yaw"),
    Coefficient("Y_uv", H, "Y", "u v", "lift", "kg/m", 2, -1, "side force due to drift"),
    Coefficient("Y_ur", H, "Y", "u r", "lift", "kg", 3, 0, "side force due to yaw"),
    Coefficient("Y_v|v|", H, "Y", "v|v|", "cross_flow", "kg/m", 2, -1, "cross-flow drag in sway"),
    Coefficient("Y_r|r|", H, "Y", "r|r|", "cross_flow", "kg m", 4, 0, "cross-flow side force due to yaw"),
    Coefficient("Y_uud", H, "Y", "u u dr", "control", "kg/m", 2, +1, "side force of the rudder"),
    Coefficient("N_vdot", H, "N", "dv/dt", "inertia", "kg m", 4, 0, "added mass, yaw due to sway"),
    Coefficient("N_rdot", H, "N", "dr/dt", "inertia", "kg m^2", 5, -1, "added inertia in yaw"),
    Coefficient("N_uv", H, "N", "u v", "lift", "kg", 3, 0, "yaw moment due to drift"),
    Coefficient("N_ur", H, "N", "u r", "lift", "kg m", 4, -1, "yaw damping"),
    Coefficient("N_v|v|", H, "N", "v|v|", "cross_flow", "kg", 3, 0, "cross-flow yaw moment due to sway"),
    Coefficient("N_r|r|", H, "N", "r|r|", "cross_flow", "kg m^2", 5, -1, "cross-flow yaw damping"),
    Coefficient("N_uud", H, "N", "u u dr", "control", "kg", 3, -1, "yaw moment of the rudder"),
    Coefficient("Z_wdot", V, "Z", "dw/dt", "inertia", "kg", 3, -1, "added mass in heave"),
    Coefficient("Z_qdot", V, "Z", "dq/dt", "inertia", "kg m", 4, 0, "added mass, heave due to pitch"),
    Coefficient("Z_uw", V, "Z", "u w", "lift", "kg/m", 2, -1, "normal force due to incidence"),
    Coefficient("Z_uq", V, "Z", "u q", "lift", "kg", 3, 0, "normal force due to pitch rate"),
    Coefficient("Z_w|w|", V, "Z", "w|w|", "cross_flow", "kg/m", 2, -1, "cross-flow drag in heave"),
    Coefficient("Z_q|q|", V, "Z", "q|q|", "cross_flow", "kg m", 4, 0, "cross-flow normal force due to pitch"),
    Coefficient("Z_uud", V, "Z", "u u de", "control", "kg/m", 2, -1, "normal force of the elevator"),
    Coefficient("M_wdot", V, "M", "dw/dt", "inertia", "kg m", 4, 0, "added mass, pitch due to heave"),
    Coefficient("M_qdot", V, "M", "dq/dt", "inertia", "kg m^2", 5, -1, "added inertia in pitch"),
    Coefficient("M_uw", V, "M", "u w", "lift", "kg", 3, 0, "pitch moment due to incidence"),
    Coefficient("M_uq", V, "M", "u q", "lift", "kg m", 4, -1, "pitch damping"),
    Coefficient("M_w|w|", V, "M", "w|w|", "cross_flow", "kg", 3, 0, "cross-flow pitch moment due to heave"),
    Coefficient("M_q|q|", V, "M", "q|q|", "cross_flow", "kg m^2", 5, -1, "cross-flow pitch damping"),
    Coefficient("M_uud", V, "M", "u u de", "control", "kg", 3, -1, "pitch moment of the elevator"),
)
CONSTANTS: tuple[Constant, ...] = (
    # symbol, planes, equation, regressor, group, unit, sign, meaning
    Constant("W-B", V, "Z", "cos(pitch)", "restoring", "N", 0, "weight in water, in X times -sin(pitch)"),
    Constant("x_GW", V, "M", "-cos(pitch)", "restoring", "N m", 0, "trim moment x_G W - x_B B"),
    Constant("z_GW", V, "M", "-sin(pitch)", "restoring", "N m", +1, "righting moment z_G W"),
)
# fmt: on

BY_SYMBOL: dict[str, Coefficient] = {c.symbol: c for c in COEFFICIENTS}
ESTIMATED: dict[str, Coefficient | Constant] = {**BY_SYMBOL, **{c.symbol: c for c in CONSTANTS}}


def of_plane(plane: Plane) -> tuple[Coefficient, ...]:
    """Coefficients in the equations of one plane, in the order of the table."""
    return tuple(c for c in COEFFICIENTS if plane in c.planes)


def symbols_of(plane: Plane) -> tuple[str, ...]:
    """Symbols of `of_plane`."""
    return tuple(c.symbol for c in of_plane(plane))


def constants_of(plane: Plane) -> tuple[str, ...]:
    """Symbols of the constants that one plane estimates beside its coefficients."""
    return tuple(c.symbol for c in CONSTANTS if plane in c.planes)


def expand(names: Iterable[str], plane: Plane) -> tuple[str, ...]:
    """Coefficients and constants of a plane from symbols and groups, in the order of the tables.

    A name that is neither is ignored here; `unknown_names` finds it.
    """
    wanted, own = set(names), (c for c in ESTIMATED.values() if plane in c.planes)
    return tuple(c.symbol for c in own if {c.symbol, c.group, "all"} & wanted)


def unknown_names(names: Iterable[str]) -> list[str]:
    """Names that are neither a symbol nor a group nor ``all``."""
    known = {"all", *ESTIMATED, *(c.group for c in ESTIMATED.values())}
    return [name for name in names if name not in known]


def prime_unit(symbol: str, density_kgpm3: float, length_m: float) -> float:
    """Dimensional value of one unit of the prime coefficient.

    Parameters
    ----------
    symbol : str
        A symbol of the table.
    density_kgpm3, length_m : float
        Water density and hull length.

    Returns
    -------
    float
        density/2 * length**length_power, in the unit of the coefficient.
    """
    return 0.5 * density_kgpm3 * length_m ** BY_SYMBOL[symbol].length_power
