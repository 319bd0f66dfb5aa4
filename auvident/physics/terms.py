"""The right-hand side as data: which term stands in which equation.

Both planes share one set of equations. In the horizontal plane the lateral velocity a is the
sway v, the rate b is the yaw rate r, the angle is the heading; in the vertical plane a is the
heave w, b the pitch rate q, the angle is the pitch, and the sign sigma of the coupling between
translation and rotation changes (theory 1.3 and 1.4)::

    M(p) d(u, a, b)/dt = sum of the terms,    d(angle)/dt = b

    M = [[m - X_udot, 0, m z_G (vertical)],
         [0, m - A_adot, sigma m x_G - A_bdot],
         [m z_G (vertical), sigma m x_G - B_adot, I - B_bdot]]

With buoyancy on the axis through O, m z_G is the righting moment z_G W over g, one parameter with
it. The trim moment x_GW = x_G W - x_B B is what the ballasting leaves of two large moments, so
m x_G stays as the vehicle file has it: a thousandth of the length moves m x_G by so little that
M_uq and Z_qdot beside it take it up with 0.04 of their standard deviations.

A term is ``weight * p[parameter] * factor * factor * factor``; a factor is a power of one
variable. Everything is linear in the parameters p, hence the Jacobians of `dynamics` are exact
and a further term is one more row here.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from auvident.constants import GRAVITY_MPS2
from auvident.schema.artifacts import RigidBody
from auvident.schema.coefficients import CONSTANTS as ESTIMATED_CONSTANTS
from auvident.schema.coefficients import symbols_of
from auvident.schema.effects import BY_ID, name_in
from auvident.schema.planes import PLANE_ROWS, Plane
from auvident.schema.planes import symbol_in as symbol_in
from auvident.schema.unexplained import NAME, PRODUCTS, Factor

STATES = ("u", "a", "b", "angle")
EQUATIONS = ("X", "A", "B")
# variables a factor may be a power of: states, sine and cosine of the angle, own control
# surface d (rudder; elevator in the vertical plane), the other one e, propeller rate n in rev/s;
# with effects also a factor on the thrust, the thrust itself, the part of a change of weight that
# has been made, what the propeller race adds at the fin (to the square of the flow, to the flow,
# and to the flow times the station of the fin), roll, pitch and depth as logged, and free forces
INPUTS = (
    *("d", "e", "n", "thrust", "T", "changed", "race", "flow", "reach", "roll", "pitch", "depth"),
    *("X", "A", "B"),
)
VARIABLES = ("u", "a", "b", "sin", "cos", *INPUTS)
# the powers of values in arrays; `batch.place_powers` has those of one value, in the same order
POWER_OF: dict[str, Callable[[npt.NDArray[Any]], npt.NDArray[Any]]] = {
    "x": lambda x: x,
    "|x|": np.abs,
    "x^2": np.square,
    "x|x|": lambda x: x * np.abs(x),
    "x^3": lambda x: x**3,
}
POWERS = tuple(POWER_OF)
# known; then those that the data may change
CONSTANTS = ("m", "m x_G", "I", "x_fin", *(c.symbol for c in ESTIMATED_CONSTANTS))
PER_G = 1.0 / GRAVITY_MPS2  # from z_G W to m z_G
FACTORS_PER_TERM = 3
PLANE_NAMES = {row.name: row.names for row in PLANE_ROWS}
SIGMA = {row.name: row.sigma for row in PLANE_ROWS}

# Hydrodynamic terms: equation, coefficient with generic axes, factors (variable, power).
HYDRODYNAMIC = (
    ("X", "X_uu", ("u", "x|x|")),
    ("X", "X_aa", ("a", "x^2")),
    ("X", "X_ab", ("a", "x"), ("b", "x")),
    ("X", "X_bb", ("b", "x^2")),
    ("X", "X_uudd", ("u", "x^2"), ("d", "x^2")),
    ("X", "X_uudd", ("u", "x^2"), ("e", "x^2")),
    ("X", "T_nn", ("n", "x|x|")),
    ("X", "T_nu", ("n", "|x|"), ("u", "x")),
    ("A", "A_ua", ("u", "x"), ("a", "x")),
    ("A", "A_ub", ("u", "x"), ("b", "x")),
    ("A", "A_a|a|", ("a", "x|x|")),
    ("A", "A_b|b|", ("b", "x|x|")),
    ("A", "A_uud", ("u", "x^2"), ("d", "x")),
    ("B", "B_ua", ("u", "x"), ("a", "x")),
    ("B", "B_ub", ("u", "x"), ("b", "x")),
    ("B", "B_a|a|", ("a", "x|x|")),
    ("B", "B_b|b|", ("b", "x|x|")),
    ("B", "B_uud", ("u", "x^2"), ("d", "x")),
)
LINEAR_DRAG = "linear_drag.X_u"  # beside X_uu in every balance of thrust and drag
# Forces of effects: parameter of the table of effects (with generic axes; of two twins that of the
# horizontal plane), equation, weight, factors.
EFFECT_FORCES: tuple[tuple[Any, ...], ...] = (
    ("propeller_side_force.Y_nn", "A", +1, ("n", "x|x|")),
    ("propeller_side_force.N_nn", "B", +1, ("n", "x|x|")),
    ("thrust_line_moment.z_m", "B", +1, ("T", "x")),
    ("hull_asymmetry.A_0", "A", +1, ("u", "x|x|")),
    ("hull_asymmetry.B_0", "B", +1, ("u", "x|x|")),
    ("sway_cross_flow.A_a|b|", "A", +1, ("a", "x"), ("b", "|x|")),
    ("sway_cross_flow.A_b|a|", "A", +1, ("b", "x"), ("a", "|x|")),
    ("yaw_cross_flow.B_a|b|", "B", +1, ("a", "x"), ("b", "|x|")),
    ("yaw_cross_flow.B_b|a|", "B", +1, ("b", "x"), ("a", "|x|")),
    ("cubic_damping.B_aab", "B", +1, ("a", "x^2"), ("b", "x")),
    ("cubic_damping.B_bbb", "B", +1, ("b", "x^3")),
    ("turning_drag.X_aau", "X", +1, ("a", "x^2"), ("u", "x")),
    ("turning_drag.X_bbu", "X", +1, ("b", "x^2"), ("u", "x")),
    (LINEAR_DRAG, "X", +1, ("u", "x")),
    ("linear_damping.A_a", "A", +1, ("a", "x")),
    ("linear_damping.B_b", "B", +1, ("b", "x")),
    ("weight_change.weight_n", "X", -1, ("changed", "x"), ("sin", "x")),
    ("weight_change.weight_n", "A", +1, ("changed", "x"), ("cos", "x")),
    ("weight_change.moment_nm", "B", -1, ("changed", "x"), ("cos", "x")),
    ("buoyancy_gradient.gradient_npm", "X", -1, ("depth", "x"), ("sin", "x")),
    ("buoyancy_gradient.gradient_npm", "A", +1, ("depth", "x"), ("cos", "x")),
    ("roll_coupling.Y_uuphi", "A", +1, ("u", "x^2"), ("roll", "x")),
    ("roll_coupling.N_uuphi", "B", +1, ("u", "x^2"), ("roll", "x")),
    ("weight_excess.W-B_n", "X", -1, ("pitch", "x")),
    *((f"{NAME}.{q.generic}", q.equation, +1, *q.factors) for q in PRODUCTS),
)
# A fin in the propeller race meets a flow of V^2 = u^2 + c T. Its lift without the race,
# A_uud (u^2 d - sigma k u (a + l b)) with the second part within A_ua and A_ub, becomes
# A_uud (V^2 d - sigma k V (a + l b)), and its drag that of V^2; l = sigma x_fin is its station.
# Without the damping a race is found at half its size (population, even seeds 5184 and 5270).
RACE = "propeller_race"
# k: lift slope of a fin at incidence over that when it is deflected: K_B(W) + K_W(B) over K_W(B)
# (1.2 to 1.4 of a tail fin), over the effectiveness of a flap where not the whole fin moves (0.7
# with a third of the chord, 0.5 with a sixth: thin aerofoil, Glauert 1926)
RACE_DAMPING = 1.5
RACE_FORCES = (  # equation, coefficient, weight, whether sigma turns it, factors
    ("X", "X_uudd", 1.0, False, ("race", "x"), ("d", "x^2")),
    ("A", "A_uud", 1.0, False, ("race", "x"), ("d", "x")),
    ("B", "B_uud", 1.0, False, ("race", "x"), ("d", "x")),
    ("A", "A_uud", -RACE_DAMPING, True, ("flow", "x"), ("a", "x")),
    ("B", "B_uud", -RACE_DAMPING, True, ("flow", "x"), ("a", "x")),
    ("A", "A_uud", -RACE_DAMPING, False, ("reach", "x"), ("b", "x")),
    ("B", "B_uud", -RACE_DAMPING, False, ("reach", "x"), ("b", "x")),
)
THRUST_EFFECTS = ("thrust_sag", "thrust_step")  # they multiply the thrust by a factor
# forces that come as a series in time, each with a factor as its parameter
FREE_FORCE = "free_force"
FREE_FORCES = tuple(f"{FREE_FORCE}.{equation}" for equation in EQUATIONS)
# Rigid-body terms moved to the right: weight in units of sigma where the plane turns the sign.
RIGID = {
    "horizontal": (
        ("X", "m", +1, ("a", "x"), ("b", "x")),
        ("X", "m x_G", +1, ("b", "x^2")),
        ("A", "m", -1, ("u", "x"), ("b", "x")),
        ("B", "m x_G", -1, ("u", "x"), ("b", "x")),
    ),
    "vertical": (
        ("X", "m", -1, ("a", "x"), ("b", "x")),
        ("X", "m x_G", +1, ("b", "x^2")),
        ("X", "W-B", -1, ("sin", "x")),
        ("A", "m", +1, ("u", "x"), ("b", "x")),
        ("A", "z_GW", +PER_G, ("b", "x^2")),
        ("A", "W-B", +1, ("cos", "x")),
        ("B", "m x_G", -1, ("u", "x"), ("b", "x")),
        ("B", "z_GW", -PER_G, ("a", "x"), ("b", "x")),
        ("B", "z_GW", -1, ("sin", "x")),
        ("B", "x_GW", -1, ("cos", "x")),
    ),
}
# Mass matrix: row, column, parameter, weight.
MASS = (
    ("X", "X", "m", 1.0),
    ("X", "X", "X_udot", -1.0),
    ("A", "A", "m", 1.0),
    ("A", "A", "A_adot", -1.0),
    ("A", "B", "A_bdot", -1.0),
    ("B", "A", "B_adot", -1.0),
    ("B", "B", "I", 1.0),
    ("B", "B", "B_bdot", -1.0),
)


class Equations(NamedTuple):
    """The arrays of a `Structure`, as the kernels take them."""

    terms: npt.NDArray[np.int64]
    weights: npt.NDArray[np.float64]
    mass: npt.NDArray[np.int64]
    mass_weights: npt.NDArray[np.float64]


@dataclass(frozen=True)
class Structure:
    """The equations of one plane as arrays for the compiled kernels.

    Attributes
    ----------
    plane : str
        ``horizontal`` or ``vertical``.
    parameters : tuple of str
        Coefficients of the plane, then `CONSTANTS`, then the parameters of the effects; the
        order of the parameter vector p.
    effects : tuple of str
        Effects that the prediction carries; `FREE_FORCE` may be among them.
    terms : (n_terms, 2 + 2 * FACTORS_PER_TERM) int array
        Equation, parameter, then (variable, power) pairs; power -1 is the factor 1.
    weights : (n_terms,) float array
    mass : (n_mass, 3) int array
        Row, column, parameter.
    mass_weights : (n_mass,) float array
    """

    plane: Plane
    parameters: tuple[str, ...]
    effects: tuple[str, ...]
    terms: npt.NDArray[np.int64]
    weights: npt.NDArray[np.float64]
    mass: npt.NDArray[np.int64]
    mass_weights: npt.NDArray[np.float64]

    def index(self, symbol: str) -> int:
        """Position of a coefficient or constant in the parameter vector."""
        return self.parameters.index(symbol)

    @property
    def equations(self) -> Equations:
        """The four arrays for the compiled kernels."""
        return Equations(self.terms, self.weights, self.mass, self.mass_weights)


def force_name(plane: Plane, generic: str) -> str:
    """Parameter of a force in a plane, e.g. ``sway_cross_flow.A_a|b|`` -> ``...Y_v|r|``."""
    effect, _, symbol = name_in(plane, generic).partition(".")
    return f"{effect}.{symbol_in(plane, symbol)}"


def row_of(
    equation: int, parameter: int, factors: Sequence[Factor], variables: Sequence[str], most: int
) -> list[int]:
    """A term as numbers, see `Structure.terms`, with room for so many factors."""
    row = [equation, parameter]
    for variable, power in factors:
        row += [variables.index(variable), POWERS.index(power)]
    return row + [0, -1] * (most - len(factors))


@lru_cache(maxsize=64)
def structure_of(plane: Plane, effects: tuple[str, ...] = ()) -> Structure:
    """Arrays of the equations of one plane, with the effects that the prediction carries."""
    names = tuple(name for e in effects if e != FREE_FORCE for name in BY_ID[e].names(plane))
    names += FREE_FORCES if FREE_FORCE in effects else ()
    parameters = symbols_of(plane) + CONSTANTS + names
    rows, weights = [], []
    for equation, parameter, weight, factors in _force_rows(plane, effects, names):
        places = EQUATIONS.index(equation), parameters.index(parameter)
        rows.append(row_of(*places, factors, VARIABLES, FACTORS_PER_TERM))
        weights.append(float(weight))
    mass = [*MASS, ("A", "B", "m x_G", SIGMA[plane]), ("B", "A", "m x_G", SIGMA[plane])]
    if plane == "vertical":
        mass += [("X", "B", "z_GW", PER_G), ("B", "X", "z_GW", PER_G)]
    mass_rows = [
        [EQUATIONS.index(i), EQUATIONS.index(j), parameters.index(_parameter(plane, name))]
        for i, j, name, _ in mass
    ]
    return Structure(
        plane,
        parameters,
        effects,
        np.array(rows, dtype=np.int64),
        np.array(weights),
        np.array(mass_rows, dtype=np.int64),
        np.array([weight for *_, weight in mass]),
    )


def _force_rows(plane: Plane, effects: tuple[str, ...], names: tuple[str, ...]) -> Iterator[tuple]:
    """Equation, parameter, weight and factors of every force."""
    thrust_varies = any(effect in effects for effect in THRUST_EFFECTS)
    for equation, generic, *factors in HYDRODYNAMIC:
        if thrust_varies and generic.startswith("T_"):
            factors = [*factors, ("thrust", "x")]
        yield equation, symbol_in(plane, generic), 1.0, tuple(factors)
    for equation, constant, weight, *factors in RIGID[plane]:
        yield equation, constant, weight, tuple(factors)
    for equation, generic, weight, turns, *factors in RACE_FORCES if RACE in effects else ():
        sign = SIGMA[plane] if turns else 1.0
        yield equation, symbol_in(plane, generic), sign * weight, tuple(factors)
    for generic, equation, weight, *factors in EFFECT_FORCES:
        name = force_name(plane, generic)
        if name in names:
            yield equation, name, weight, tuple(factors)
    if FREE_FORCE in effects:
        for equation, name in zip(EQUATIONS, FREE_FORCES, strict=True):
            yield equation, name, 1.0, ((equation, "x"),)


def _parameter(plane: Plane, name: str) -> str:
    return name if name in CONSTANTS else symbol_in(plane, name)


def mass_matrices(structure: Structure, p: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    """Mass matrices (n, 3, 3), rigid body and added mass, of parameters (n_parameters, n)."""
    mass = np.zeros((p.shape[1], 3, 3))
    for (i, j, k), weight in zip(structure.mass, structure.mass_weights, strict=True):
        mass[:, i, j] += weight * p[k]
    return mass


def parameter_vector(
    plane: Plane,
    coefficients: Mapping[str, float],
    rigid: RigidBody,
    effects: Mapping[str, float] | None = None,
    structure: Structure | None = None,
) -> npt.NDArray[np.float64]:
    """Parameter vector p of a plane: its coefficients, the constants, the effects.

    Parameters
    ----------
    plane : str
    coefficients : mapping
        Dimensional value by symbol, of coefficients and of constants; a missing coefficient of
        the plane counts as zero, a missing constant as `rigid` has it.
    rigid : RigidBody
    effects : mapping, optional
        Internal value by name ``effect.parameter``; a missing one counts as zero.
    structure : Structure, optional
        Whose parameters are meant; without it that of the plane without effects.

    Returns
    -------
    (n_parameters,) array
    """
    structure = structure or structure_of(plane)
    constants = {
        "m": rigid.mass_kg,
        "m x_G": rigid.mass_kg * rigid.x_g_m,
        "I": rigid.inertia_kgm2,
        "x_fin": rigid.fin_x_m,
        **rigid.constants(),
    }
    values = {**constants, **coefficients, **(effects or {})}
    return np.array([values.get(name, 0.0) for name in structure.parameters])
