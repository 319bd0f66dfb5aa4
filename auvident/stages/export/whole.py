"""A model of one plane, or of both, as terms of six degrees of freedom: for simulators."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import GRAVITY_MPS2, USUAL_SPEED_MPS
from auvident.engines.carried import structure_behind, vector_behind
from auvident.errors import UsageError
from auvident.physics import actuation as act
from auvident.physics.six_dof_terms import (
    AXES,
    DRAG_OF,
    FIN_DRAG,
    VARIABLES,
    VELOCITIES,
    Factors,
    planar_mass,
    planar_rows,
    six_dof_structure,
    whole_names,
)
from auvident.physics.terms import CONSTANTS, LINEAR_DRAG, POWERS, structure_of
from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.combined import CombinedModel
from auvident.schema.planes import BY_PLANE, PLANES, Plane
from auvident.schema.quoting import comment
from auvident.stages.export.contents import refuse_damaged, refuse_unfit, refuse_unknown

Array = npt.NDArray[Any]
AnyModel = IdentifiedModel | CombinedModel

INERTIAS = ("I_xx", "I_yy", "I_zz")
GIVEN = "vehicle file"  # origin of a coefficient that stands there
RIGID = {*CONSTANTS, *INERTIAS}  # of the body itself: mass, its place, inertia, weight


@dataclass(frozen=True)
class Term:
    """A force: its axis, the parameter, the value with its weight, powers of variables."""

    axis: str
    parameter: str
    value: float
    factors: Factors

    @property
    def variables(self) -> set[str]:
        """Variables among its factors."""
        return {variable for variable, _ in self.factors}


@dataclass(frozen=True)
class Whole:
    """A model in six degrees of freedom.

    Attributes
    ----------
    vehicle : str
        As it may stand in a comment.
    length_m, density_kgpm3 : float
    planes : tuple of str
        In which it moves.
    values : mapping
        Parameters by their name in six degrees of freedom.
    terms : tuple of Term
        Those that are not zero.
    mass, added : (6, 6) array
        Mass matrix, and the added mass in it.
    commands : mapping
        What becomes of a command, by plane, in the order of `physics.actuation.COMMAND`.
    of_planes : mapping
        Effects that the model carries, by plane.
    made : str
        Where it comes from, for people: ``identified by auvident``, or estimated.
    """

    vehicle: str
    length_m: float
    density_kgpm3: float
    planes: tuple[Plane, ...]
    values: dict[str, float]
    terms: tuple[Term, ...]
    mass: Array
    added: Array
    commands: dict[Plane, Array]
    of_planes: dict[Plane, tuple[str, ...]]
    made: str

    @property
    def effects(self) -> tuple[str, ...]:
        """Effects that the model carries, each once."""
        return tuple(dict.fromkeys(e for ids in self.of_planes.values() for e in ids))

    def effects_in(self, plane: Plane) -> tuple[str, ...]:
        """Effects that it carries in a plane."""
        return self.of_planes[plane]

    @property
    def moving(self) -> tuple[str, ...]:
        """Velocities that the model has equations for."""
        if len(self.planes) == len(PLANES):
            return VELOCITIES
        return BY_PLANE[self.planes[0]].velocities

    @property
    def buoyancy_n(self) -> float:
        """Buoyancy; a model of the horizontal plane alone has that of its weight."""
        excess = self.values.get("W-B", 0.0) if "vertical" in self.planes else 0.0
        return self.values["m"] * GRAVITY_MPS2 - excess

    @property
    def usual_rate_rps(self) -> float:
        """Propeller rate of a straight run at `USUAL_SPEED_MPS`, linear drag counted; or zero."""
        u, thrust = USUAL_SPEED_MPS, (self.values.get("T_nn", 0.0), self.values.get("T_nu", 0.0))
        drag = self.values.get("X_uu", 0.0) * u * u + self.values.get(LINEAR_DRAG, 0.0) * u
        roots = np.roots([thrust[0], thrust[1] * u, drag])
        ahead = roots.real[(np.abs(roots.imag) < 1e-9) & (roots.real > 0.0)]
        return float(ahead.min()) if len(ahead) else 0.0

    @property
    def inverse(self) -> Array:
        """Inverse of the mass matrix among the moving velocities, zero elsewhere."""
        on = [VELOCITIES.index(name) for name in self.moving]
        out = np.zeros_like(self.mass)
        out[np.ix_(on, on)] = np.linalg.inv(self.mass[np.ix_(on, on)])
        return out

    @property
    def propeller(self) -> Array:
        """Command of the plane that knows of the propeller."""
        own = [p for p in self.planes if self.commands[p][act.MOTOR_LAG : act.CHANGE_TIME].any()]
        return self.commands[own[0] if own else self.planes[0]]


def whole_of(model: AnyModel) -> Whole:
    """A model as terms of six degrees of freedom.

    Raises
    ------
    UsageError
        An effect that this version does not know; a value that is no number, or none of a body in
        water.
    """
    whole = _of_combined(model) if isinstance(model, CombinedModel) else _of_plane(model)
    on = [VELOCITIES.index(name) for name in whole.moving]
    mass = 0.5 * (whole.mass + whole.mass.T)[np.ix_(on, on)]
    if not np.linalg.eigvalsh(mass).min() > 0.0 or not whole.buoyancy_n > 0.0:
        raise UsageError(
            "mass, added mass and buoyancy are not those of a body in water",
            "--format",
            "Use json, or identify the model again.",
        )
    return whole


def _of_plane(model: IdentifiedModel) -> Whole:
    refuse_unfit(model)
    plane, p, structure = model.plane, vector_behind(model), structure_behind(model)
    names = whole_names(plane, structure.effects)
    values = {names[n]: float(p[i]) for i, n in enumerate(structure.parameters)}
    drag = float(p[structure.index(FIN_DRAG)])
    values |= dict.fromkeys(DRAG_OF.values(), drag)
    return _assembled(
        model,
        (plane,),
        values,
        planar_rows(plane, structure.effects),
        planar_mass(plane),
        {plane: act.command_values(plane, structure.parameters, p)},
        {plane: structure.effects},
    )


def _of_combined(model: CombinedModel) -> Whole:
    refuse_unknown([e for plane in PLANES for e in model.effect_ids(plane)])
    refuse_damaged(model.values())
    ids = {plane: model.effect_ids(plane) for plane in PLANES}
    structure = six_dof_structure(ids["horizontal"], ids["vertical"])
    values = {n: float(v) for n, v in model.values().items()}
    rows = [
        (AXES[t[0]], structure.parameters[t[1]], float(w), _factors(t))
        for t, w in zip(structure.terms, structure.weights, strict=True)
    ]
    mass = [
        (AXES[i], AXES[j], structure.parameters[k], float(w))
        for (i, j, k), w in zip(structure.mass, structure.mass_weights, strict=True)
    ]
    commands = {plane: _command(plane, ids[plane], values) for plane in PLANES}
    return _assembled(model, PLANES, values, rows, mass, commands, ids)


def _factors(term: Array) -> Factors:
    pairs = zip(term[2::2], term[3::2], strict=True)
    return tuple((VARIABLES[v], POWERS[power]) for v, power in pairs if power >= 0)


def _command(plane: Plane, ids: tuple[str, ...], values: dict[str, float]) -> Array:
    """What becomes of a command in a plane of a combined model."""
    parameters, names = structure_of(plane, ids).parameters, whole_names(plane, ids)
    p = np.array([values.get(names[n], 0.0) for n in parameters])
    return np.asarray(act.command_values(plane, parameters, p))


def _assembled(
    model: AnyModel,
    planes: tuple[Plane, ...],
    values: dict[str, float],
    rows: list[Any],
    mass: list[Any],
    commands: dict[Plane, Array],
    of_planes: dict[Plane, tuple[str, ...]],
) -> Whole:
    terms = [Term(axis, n, w * values.get(n, 0.0), factors) for axis, n, w, factors in rows]
    return Whole(
        comment(model.vehicle),
        model.length_m,
        model.density_kgpm3,
        planes,
        values,
        tuple(term for term in terms if term.value != 0.0),
        _matrix(mass, values),
        _matrix([entry for entry in mass if entry[2].endswith("dot")], values),
        commands,
        of_planes,
        _made(model),
    )


def _made(model: AnyModel) -> str:
    """Where a model comes from; of one that no trial stands behind, that it is an estimate."""
    if isinstance(model, IdentifiedModel) or model.models:
        return "identified by auvident"
    given = any(c.origin == GIVEN for c in model.coefficients)
    return f"estimated from geometry{' and given coefficients' if given else ''} by auvident"


def _matrix(entries: list[Any], values: dict[str, float]) -> Array:
    out = np.zeros((len(AXES), len(AXES)))
    for row, column, name, weight in entries:
        out[AXES.index(row), AXES.index(column)] += weight * values.get(name, 0.0)
    return out
