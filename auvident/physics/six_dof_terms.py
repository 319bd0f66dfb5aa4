"""The equations of six degrees of freedom as data, made of those of the planes.

Every row of the planar tables (`terms`) is a restriction of an equation of the whole vehicle, and
stands here once, with the axes, velocities and fins of its plane. What no plane shows is what
turns when the vehicle moves in both of them or rolls: the Coriolis forces of the mass matrix,
rigid body and added mass together, from Kirchhoff's equations (theory 1.2 and 2.3)::

    F = -omega x L,    M = -v x L - omega x H,    (L, H) = mass matrix times velocity

Those that stay within a plane are left out, as they stand among its own terms: rigid body in
`terms.RIGID`, added mass within X_vr, X_rr, Y_ur, N_uv, N_ur, X_wq, X_qq, Z_uq, M_uw and M_uq;
likewise that of roll within N_up, as what goes with the speed is lift (theory 2.3).
Across the planes the added mass is that of the mass matrix, fins included.

Cross-flow drag of a body of revolution is along the cross-flow: v|v| of a plane becomes
v sqrt(v^2 + w^2), r|r| becomes r sqrt(q^2 + r^2), and the same for w and q.
Rudder and elevator are different fins: the drag of each is what the plane that it steers in says
of it, X_uudrdr and X_uudede, where a plane has one X_uudd for both. With the other fin deflected
the surge of a plane is another one by the difference of the two.
Weight acts at (x_G, 0, z_G), buoyancy at the origin; the moment of the propeller's torque and
whatever else rolls the vehicle are the rows of `ROLL`.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from auvident.physics.terms import POWERS, Structure, row_of, structure_of
from auvident.physics.terms import VARIABLES as PLANAR
from auvident.schema.coefficients import BY_SYMBOL
from auvident.schema.planes import BY_PLANE, HORIZONTAL, PLANE_ROWS, PLANES, VERTICAL, Plane

AXES = ("X", "Y", "Z", "K", "M", "N")
VELOCITIES = ("u", "v", "w", "p", "q", "r")
# what a factor may be a power of: velocities, their magnitudes across the hull, the direction of
# gravity in body axes (sine of the pitch; cosine of it times sine and cosine of the roll), sine
# and cosine of the heading, angles, depth; fins, propeller rate [rev/s], a factor on the thrust,
# the thrust itself [N], the part of a change of weight that has been made, what the propeller race
# adds at each fin
ACROSS = {"v": "vw", "w": "vw", "q": "qr", "r": "qr"}
OF_ATTITUDE = ("sin", "side", "cos", "heading sin", "heading cos", "roll", "pitch")
OF_RACE = ("race", "flow", "reach")
INPUTS = (
    *("rudder", "elevator", "n", "thrust", "T", "changed"),
    *(f"{name} {plane.fin}" for plane in PLANE_ROWS for name in OF_RACE),
)
VARIABLES = (*VELOCITIES, "vw", "qr", *OF_ATTITUDE, "depth", *INPUTS)
# what an angle of a plane is among them
ANGLE = {"horizontal": {"sin": "heading sin", "cos": "heading cos"}, "vertical": {}}
# in place of the other plane's equations, which are there: the weight in water acts by itself
STAND_INS = ("weight_excess.",)
FACTORS_PER_TERM = 4
SURGE_ALONE = {"u", "n", "thrust"}  # what depends on these alone is in both planes the same
# what the planes call the same: inertia and the station of their fin
OF_PLANE = {
    "horizontal": {"I": "I_zz", "x_fin": "x_rudder"},
    "vertical": {"I": "I_yy", "x_fin": "x_elevator"},
}
FIN_DRAG = "X_uudd"  # of a plane, for whichever fin is deflected
DRAG_OF = {"rudder": "X_uudrdr", "elevator": "X_uudede"}

Factors = tuple[tuple[str, str], ...]
Row = tuple[str, str, float, Factors]

# coefficients of both planes, each with what the planes call it
COEFFICIENTS: dict[str, str] = {
    name: symbol
    for symbol in BY_SYMBOL
    for name in (DRAG_OF.values() if symbol == FIN_DRAG else (symbol,))
}

# What rolls the vehicle, and what its roll does to sway and yaw where a fin stands on one side
# alone (a sail); torque of the propeller.
ROLL: tuple[Row, ...] = (
    ("K", "K_up", 1.0, (("u", "x"), ("p", "x"))),
    ("K", "K_p|p|", 1.0, (("p", "x|x|"),)),
    ("K", "K_uv", 1.0, (("u", "x"), ("v", "x"))),
    ("K", "K_ur", 1.0, (("u", "x"), ("r", "x"))),
    ("K", "K_nn", 1.0, (("n", "x|x|"),)),
    ("K", "K_nu", 1.0, (("n", "|x|"), ("u", "x"))),
    ("Y", "Y_up", 1.0, (("u", "x"), ("p", "x"))),
    ("N", "N_up", 1.0, (("u", "x"), ("p", "x"))),
)
# Added mass of roll, inertia: row, column, parameter, weight.
ROLL_MASS = (
    ("K", "K", "I_xx", 1.0),
    ("K", "K", "K_pdot", -1.0),
    ("Y", "K", "Y_pdot", -1.0),
    ("K", "Y", "Y_pdot", -1.0),
    ("N", "K", "N_pdot", -1.0),
    ("K", "N", "N_pdot", -1.0),
)
# Unit of each of their parameters.
ROLL_UNITS = {
    "I_xx": "kg m^2",
    "K_pdot": "kg m^2",
    "K_up": "kg m",
    "K_p|p|": "kg m^2",
    "K_uv": "kg",
    "K_ur": "kg m",
    "K_nn": "kg m^2",
    "K_nu": "kg m",
    "Y_pdot": "kg m",
    "Y_up": "kg",
    "N_pdot": "kg m^2",
    "N_up": "kg m",
}
# Those whose sign physics gives: inertia, added inertia, damping.
ROLL_SIGNS = {"I_xx": 1, "K_pdot": -1, "K_up": -1, "K_p|p|": -1}
# -omega x L and -v x L - omega x H: equation, velocity, momentum, sign
CROSS = (
    *(("X", "q", "Z", -1.0), ("X", "r", "Y", 1.0)),
    *(("Y", "r", "X", -1.0), ("Y", "p", "Z", 1.0)),
    *(("Z", "p", "Y", -1.0), ("Z", "q", "X", 1.0)),
    *(("K", "v", "Z", -1.0), ("K", "w", "Y", 1.0), ("K", "q", "N", -1.0), ("K", "r", "M", 1.0)),
    *(("M", "w", "X", -1.0), ("M", "u", "Z", 1.0), ("M", "r", "K", -1.0), ("M", "p", "N", 1.0)),
    *(("N", "u", "Y", -1.0), ("N", "v", "X", 1.0), ("N", "p", "M", -1.0), ("N", "q", "K", 1.0)),
)


@dataclass(frozen=True)
class SixDofStructure:
    """The equations of the whole vehicle as arrays.

    Attributes
    ----------
    parameters : tuple of str
        Order of the parameter vector: coefficients and constants of the planes, `ROLL_UNITS`,
        parameters of effects (``horizontal sway_cross_flow.Y_v|r|``).
    terms : (n_terms, 2 + 2 * FACTORS_PER_TERM) int array
        Equation, parameter, then (variable, power) pairs; power -1 is the factor 1.
    weights : (n_terms,) float array
    mass : (n_mass, 3) int array
        Row, column, parameter.
    mass_weights : (n_mass,) float array
    """

    parameters: tuple[str, ...]
    terms: npt.NDArray[np.int64]
    weights: npt.NDArray[np.float64]
    mass: npt.NDArray[np.int64]
    mass_weights: npt.NDArray[np.float64]

    def vector(self, values: Mapping[str, float]) -> npt.NDArray[np.float64]:
        """Parameter vector of values by name; a missing one is zero."""
        return np.array([values.get(name, 0.0) for name in self.parameters])


def whole_name(plane: Plane, name: str, equation: str = "", factors: Factors = ()) -> str:
    """Name in six degrees of freedom of a parameter of a plane.

    Coefficients and constants keep theirs, but for inertia, station and drag of a fin; an effect
    belongs to its plane, unless it acts on the surge alone: there is one hull and one propeller.
    """
    if name in OF_PLANE[plane]:
        return OF_PLANE[plane][name]
    if name == FIN_DRAG:
        deflected = {variable for variable, _ in factors} & set(DRAG_OF)
        return DRAG_OF[deflected.pop() if deflected else BY_PLANE[plane].fin]
    surge_alone = equation == "X" and {variable for variable, _ in factors} <= SURGE_ALONE
    return name if surge_alone or "." not in name else f"{plane} {name}"


def whole_names(plane: Plane, effects: tuple[str, ...] = ()) -> dict[str, str]:
    """Name in six degrees of freedom of each parameter of a plane with its effects."""
    names = {n: whole_name(plane, n) for n in structure_of(plane, effects).parameters}
    shared = {name for _, name, *_ in planar_rows(plane, effects)} & set(names)
    return {**names, **{name: name for name in shared}}


def planar_rows(plane: Plane, effects: tuple[str, ...] = ()) -> list[Row]:
    """Terms of a plane with its axes, velocities and fins."""
    structure = structure_of(plane, effects)
    return [
        _whole(plane, structure, term, float(weight))
        for term, weight in zip(structure.terms, structure.weights, strict=True)
        if not structure.parameters[term[1]].startswith(STAND_INS)
    ]


def _whole(plane: Plane, structure: Structure, term: npt.NDArray[np.int64], weight: float) -> Row:
    """One term of a plane among those of the whole vehicle."""
    row = BY_PLANE[plane]
    turned = {**row.names, **ANGLE[plane], "d": row.fins[0], "e": row.fins[1]}
    turned |= {name: f"{name} {row.fin}" for name in OF_RACE}
    parameter, factors = structure.parameters[term[1]], []
    for variable, power in zip(term[2::2], term[3::2], strict=True):
        name = turned.get(PLANAR[variable], PLANAR[variable])
        if power < 0 or name == "thrust":
            continue
        if POWERS[power] == "x|x|" and name in ACROSS:
            factors += [(name, "x"), (ACROSS[name], "x")]
        else:
            factors.append((name, POWERS[power]))
    if parameter.startswith("T_"):  # one propeller: what a plane knows of its thrust counts in all
        factors.append(("thrust", "x"))
    equation = row.axes[term[0]]
    name = whole_name(plane, parameter, equation, tuple(factors))
    return equation, name, weight, tuple(factors)


def planar_mass(plane: Plane) -> list[tuple[str, str, str, float]]:
    """Entries of the mass matrix of a plane with its axes."""
    structure, axes = structure_of(plane), BY_PLANE[plane].axes
    return [
        (axes[i], axes[j], whole_name(plane, structure.parameters[k]), float(weight))
        for (i, j, k), weight in zip(structure.mass, structure.mass_weights, strict=True)
    ]


def within_a_plane(equation: str, velocities: Iterable[str]) -> bool:
    """Whether a product of velocities in an equation is among the terms of a plane."""
    return any(
        equation in row.axes and set(velocities) <= set(row.velocities)
        for row in (HORIZONTAL, VERTICAL)
    )


def coriolis_rows(mass: Iterable[tuple[str, str, str, float]]) -> list[Row]:
    """Coriolis forces of a mass matrix that no plane has among its terms."""
    momenta: dict[str, list[tuple[str, str, float]]] = {axis: [] for axis in AXES}
    for axis, column, parameter, weight in mass:
        momenta[axis].append((VELOCITIES[AXES.index(column)], parameter, weight))
    return [
        (equation, parameter, sign * weight, tuple((x, "x") for x in sorted((velocity, moving))))
        for equation, velocity, axis, sign in CROSS
        for moving, parameter, weight in momenta[axis]
        if not within_a_plane(equation, (velocity, moving))
        and not (parameter.endswith("dot") and "u" in (velocity, moving))
    ]


def low_centre(mass: Iterable[tuple[str, str, str, float]]) -> list[tuple[str, str, str, float]]:
    """Entries of m z_G between sway and roll, from those between surge and pitch."""
    (arm,) = ((name, weight) for i, j, name, weight in mass if (i, j) == ("X", "M"))
    return [("Y", "K", arm[0], -arm[1]), ("K", "Y", arm[0], -arm[1])]


def weight_rows() -> list[Row]:
    """Weight and its moments where the vehicle rolls, beside those of the vertical plane."""
    arm = {(row[0], row[3]): row[1] for row in planar_rows("vertical")}
    excess = arm["Z", (("cos", "x"),)]
    righting, trim = arm["M", (("sin", "x"),)], arm["M", (("cos", "x"),)]
    return [
        ("Y", excess, 1.0, (("side", "x"),)),
        ("K", righting, -1.0, (("side", "x"),)),
        ("N", trim, 1.0, (("side", "x"),)),
    ]


@lru_cache(maxsize=64)
def six_dof_structure(
    horizontal: tuple[str, ...] = (), vertical: tuple[str, ...] = ()
) -> SixDofStructure:
    """Equations of the whole vehicle, with the effects that the models of its planes carry."""
    carried: dict[Plane, tuple[str, ...]] = {"horizontal": horizontal, "vertical": vertical}
    mass = list(dict.fromkeys(entry for plane in PLANES for entry in planar_mass(plane)))
    mass += [*ROLL_MASS, *low_centre(mass)]
    planar = [row for plane in PLANES for row in planar_rows(plane, carried[plane])]
    rows = [*dict.fromkeys(planar), *_merged(coriolis_rows(mass)), *weight_rows(), *ROLL]
    names = dict.fromkeys(COEFFICIENTS)
    names |= dict.fromkeys(name for _, name, *_ in rows)
    names |= dict.fromkeys(name for _, _, name, _ in mass)
    parameters = tuple(names)
    terms = [
        row_of(AXES.index(axis), parameters.index(name), factors, VARIABLES, FACTORS_PER_TERM)
        for axis, name, _, factors in rows
    ]
    return SixDofStructure(
        parameters,
        np.array(terms, dtype=np.int64),
        np.array([row[2] for row in rows]),
        np.array(
            [[AXES.index(i), AXES.index(j), parameters.index(name)] for i, j, name, _ in mass]
        ),
        np.array([weight for *_, weight in mass]),
    )


def _merged(rows: Iterable[Row]) -> list[Row]:
    """Rows with the same product added up; what cancels is left out."""
    sums: dict[tuple[str, str, Factors], float] = {}
    for equation, parameter, weight, factors in rows:
        key = (equation, parameter, factors)
        sums[key] = sums.get(key, 0.0) + weight
    return [(e, p, weight, f) for (e, p, f), weight in sums.items() if weight != 0.0]
