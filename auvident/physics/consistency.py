"""What physics knows of the coefficients whatever the data say: g(p) >= 0, concave in p.

A fit that sees ratios alone, or that lacks an effect, is free to end at an added inertia of the
wrong sign or at a hull that drives itself. Each row of `CONSTRAINTS` rules out one such thing; its
g is without dimension, so that nearness means the same for every vehicle.

A matrix that is to be positive semi-definite counts by its least eigenvalue, as in the
identification of rigid bodies (Wensing, Kim and Slotine 2018). A log-Cholesky parametrisation
(Rucker and Wensing 2022) keeps it as well; here the coefficients stay the parameters, because the
prior is theirs.

Fluid that moves with the hull keeps its energy: the forces that the added masses make at constant
velocity (shares of X_ab, X_bb, A_ub, B_ua and B_ub, the Munk moment among them) do no work
all together, u X + a A + b B = 0 (Lamb 1932, articles 124 and 126). The power of all terms in u, a
and b is therefore that of the damping, without taking these coefficients apart.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from auvident.constants import NORMAL_95
from auvident.physics.terms import (
    CONSTANTS,
    EQUATIONS,
    POWER_OF,
    STATES,
    VARIABLES,
    Structure,
    symbol_in,
)
from auvident.schema.coefficients import BY_SYMBOL
from auvident.schema.planes import PLANES, Plane

Array = npt.NDArray[Any]

MASS_LEFT = 0.5  # share of the rigid body's least eigenvalue that the total mass matrix keeps
VELOCITIES = len(EQUATIONS)
# a variable below this number stands at its place in a state
assert VARIABLES[:VELOCITIES] == STATES[:VELOCITIES] == ("u", "a", "b")


class Basis(NamedTuple):
    """What constraints are made of.

    Attributes
    ----------
    structure : Structure
    prior, prior_std : (n_parameters,) array
        Estimate and its standard deviation, zero where a parameter is held.
    flown : (k, 3) array
        States (u, a, b) over the envelope flown.
    """

    structure: Structure
    prior: Array
    prior_std: Array
    flown: Array


class LinearRow(NamedTuple):
    """g = slopes @ p."""

    slopes: Array


class EigenvalueRow(NamedTuple):
    """g = least eigenvalue of sum_k p[at_k] matrices_k, beyond a margin."""

    at: npt.NDArray[np.int64]
    matrices: Array
    margin: float = 0.0

    def evaluate(self, p: Array) -> tuple[float, Array]:
        """g and its slopes by the parameters `at`; where two eigenvalues meet those of one."""
        values, vectors = np.linalg.eigh(np.tensordot(p[self.at], self.matrices, 1))
        first = vectors[:, 0]
        return float(values[0]) - self.margin, self.matrices @ first @ first


Row = LinearRow | EigenvalueRow


@dataclass(frozen=True)
class Constraint:
    """Declaration of one constraint.

    Attributes
    ----------
    id : str
    quantity : str
        g in words, axes and velocities generic.
    source : str
    planes : tuple of str
        Planes that it applies to.
    asks : str
        What data that pull at it ask for.
    lacks : str
        What the model is likely to lack where they do.
    rows : callable
        `Basis` to the rows of g; none where it cannot be told.
    """

    id: str
    quantity: str
    source: str
    planes: tuple[Plane, ...]
    asks: str
    lacks: str
    rows: Callable[[Basis], Iterator[Row]]


# --- rows ----------------------------------------------------------------------------------


def _mass_unit(basis: Basis) -> Array:
    """Units (3,) of the rows of a mass matrix: roots of mass, mass and inertia."""
    mass, inertia = (basis.prior[basis.structure.index(name)] for name in ("m", "I"))
    root: Array = np.sqrt([mass, mass, inertia])
    return root


def _mass_rows(basis: Basis, equations: range, rigid: bool, added: bool) -> EigenvalueRow:
    """Symmetric part of the mass matrix in some equations, in units of the rigid body's."""
    structure, unit = basis.structure, _mass_unit(basis)
    parts: dict[int, Array] = {}
    for (i, j, parameter), weight in zip(structure.mass, structure.mass_weights, strict=True):
        constant = structure.parameters[parameter] in CONSTANTS
        if i in equations and j in equations and (rigid if constant else added):
            matrix = parts.setdefault(int(parameter), np.zeros((len(equations), len(equations))))
            i, j = i - equations.start, j - equations.start
            share = 0.5 * weight / (unit[equations][i] * unit[equations][j])
            matrix[i, j] += share
            matrix[j, i] += share
    return EigenvalueRow(np.array(list(parts)), np.array(list(parts.values())))


def surge_added_mass(basis: Basis) -> Iterator[Row]:
    """-X_udot over the mass."""
    yield _mass_rows(basis, range(1), rigid=False, added=True)


def lateral_added_mass(basis: Basis) -> Iterator[Row]:
    """Least eigenvalue of the added masses of the two lateral equations."""
    yield _mass_rows(basis, range(1, VELOCITIES), rigid=False, added=True)


def total_mass(basis: Basis) -> Iterator[Row]:
    """Least eigenvalue of the mass matrix beyond a share of the rigid body's."""
    body = _mass_rows(basis, range(VELOCITIES), rigid=True, added=False)
    least, _ = body.evaluate(basis.prior)
    whole = _mass_rows(basis, range(VELOCITIES), rigid=True, added=True)
    yield whole._replace(margin=MASS_LEFT * least)


def hull_damping(basis: Basis) -> Iterator[Row]:
    """Minus the power of the hull's forces in each state, over the estimate's part by part.

    An estimate without resistance straight ahead is no hull's: none of its states is judged.
    """
    if not hull_power(basis.structure, np.array([1.0, 0.0, 0.0])) @ basis.prior < 0.0:
        return
    for state in basis.flown:
        power = hull_power(basis.structure, state)
        size = float(np.abs(power) @ np.abs(basis.prior))
        if size > 0.0:
            yield LinearRow(-power / size)


def hull_power(structure: Structure, state: Array) -> Array:
    """Power u X + a A + b B of the hull's terms in a state (u, a, b), by the parameters.

    The hull's are those of velocities alone; a side force or moment that neither drift nor turn
    makes is none of its damping. Propeller, fins, weight and rigid body are left out.
    """
    power, values = np.zeros(len(structure.parameters)), [of(state) for of in POWER_OF.values()]
    for row, weight in zip(structure.terms, structure.weights, strict=True):
        factors = [(v, k) for v, k in row[2:].reshape(-1, 2) if k >= 0]
        variables = {v for v, _ in factors}
        turns = row[0] == 0 or variables & {1, 2}
        if structure.parameters[row[1]] in CONSTANTS or not turns or max(variables) >= VELOCITIES:
            continue
        force = weight * np.prod([values[k][v] for v, k in factors])
        power[row[1]] += state[row[0]] * force
    return power


def _of_sign(generic: str, surely: bool = False) -> Callable[[Basis], Iterator[Row]]:
    """That a coefficient has the sign of the table; `surely`: where the estimate is sure of it."""

    def rows(basis: Basis) -> Iterator[Row]:
        symbol = symbol_in(basis.structure.plane, generic)
        i, sign = basis.structure.index(symbol), BY_SYMBOL[symbol].sign
        least = NORMAL_95 * basis.prior_std[i] if surely else 0.0
        if sign * basis.prior[i] > least:
            slopes = np.zeros(len(basis.prior))
            slopes[i] = 1.0 / basis.prior[i]
            yield LinearRow(slopes)

    return rows


# --- table ---------------------------------------------------------------------------------

A_LAG = "a delay, a servo lag or the lever arm of a sensor may be missing"
CONSTRAINTS = (
    Constraint(
        "surge_added_mass",
        "-X_udot / m",
        "kinetic energy of the fluid is not negative (Lamb 1932, article 121)",
        PLANES,
        "an added mass in surge of the wrong sign",
        "a lag of the propeller or of the speed measurement may be missing",
        surge_added_mass,
    ),
    Constraint(
        "lateral_added_mass",
        "least eigenvalue of -[[A_adot, A_bdot], [B_adot, B_bdot]], units m and I",
        "kinetic energy of the fluid is not negative (Lamb 1932, article 121)",
        PLANES,
        "an added mass or added inertia of the wrong sign",
        A_LAG,
        lateral_added_mass,
    ),
    Constraint(
        "total_mass",
        f"least eigenvalue of the mass matrix less {MASS_LEFT} of the rigid body's, units m and I",
        "kinetic energy of body and fluid (Lamb 1932, article 121)",
        PLANES,
        "less inertia than that of the body alone",
        A_LAG,
        total_mass,
    ),
    Constraint(
        "hull_damping",
        "-(u X + a A + b B) of the hull in the states flown, over the estimate's part by part",
        "forces without work but for damping (Lamb 1932, articles 124 and 126)",
        PLANES,
        "a hull that gains energy from the water it moves through",
        "a current, the roll or a force that does not come from the hull may be missing",
        hull_damping,
    ),
    Constraint(
        "thrust",
        "T_nn over its estimate",
        "a propeller at rest in the water drives ahead",
        PLANES,
        "a propeller that pulls astern",
        "the sign or the scale of the logged propeller rate may be wrong",
        _of_sign("T_nn"),
    ),
    Constraint(
        "thrust_loss",
        "T_nu over its estimate",
        "thrust falls with the advance (every open-water curve)",
        PLANES,
        "a thrust that grows with the advance",
        "a current or a lag of the propeller may be missing",
        _of_sign("T_nu"),
    ),
    Constraint(
        "fin_force",
        "A_uud over its estimate, where its interval excludes the other sign",
        "conventions of the control angles",
        PLANES,
        "fins that push to the other side",
        A_LAG,
        _of_sign("A_uud", surely=True),
    ),
    Constraint(
        "fin_moment",
        "B_uud over its estimate, where its interval excludes the other sign",
        "conventions of the control angles",
        PLANES,
        "fins that turn to the other side",
        "the sign of the logged control angle may be wrong, or " + A_LAG,
        _of_sign("B_uud", surely=True),
    ),
)
BY_CONSTRAINT = {row.id: row for row in CONSTRAINTS}


@dataclass(frozen=True)
class Constraints:
    """The constraints on a parameter vector, row by row.

    Attributes
    ----------
    ids : tuple of str
        Constraint of each row.
    linear : (k, n_parameters) array
        Slopes of the first rows.
    eigenvalues : tuple of EigenvalueRow
        The other rows.
    """

    ids: tuple[str, ...]
    linear: Array
    eigenvalues: tuple[EigenvalueRow, ...] = ()

    def __call__(self, p: Array) -> tuple[Array, Array]:
        """g (m,) and its slopes (m, n_parameters)."""
        k = len(self.linear)
        value, slopes = np.zeros(len(self.ids)), np.zeros((len(self.ids), len(p)))
        if k:
            value[:k], slopes[:k] = self.linear @ p, self.linear
        for i, row in enumerate(self.eigenvalues, k):
            value[i], slopes[i, row.at] = row.evaluate(p)
        return value, slopes


UNCONSTRAINED = Constraints((), np.zeros((0, 0)))


def constraints_of(basis: Basis) -> Constraints:
    """All constraints of a plane that the estimate itself keeps.

    Coefficients that were given against one of them are taken at their word.
    """
    linear: list[tuple[str, Array]] = []
    eigenvalues: list[tuple[str, EigenvalueRow]] = []
    for declared in CONSTRAINTS:
        if basis.structure.plane not in declared.planes:
            continue
        for row in declared.rows(basis):
            if isinstance(row, LinearRow):
                if row.slopes @ basis.prior > 0.0:
                    linear.append((declared.id, row.slopes))
            elif row.evaluate(basis.prior)[0] > 0.0:
                eigenvalues.append((declared.id, row))
    ids = tuple(name for name, _ in linear) + tuple(name for name, _ in eigenvalues)
    slopes = np.array([row for _, row in linear]).reshape(len(linear), len(basis.prior))
    return Constraints(ids, slopes, tuple(row for _, row in eigenvalues))
