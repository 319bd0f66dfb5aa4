"""Models of one plane to fly on the desk: identified ones, and those from a vehicle file."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.engines.carried import LEADERS, claimed_covariance, structure_behind
from auvident.engines.draws import drawn_vectors
from auvident.errors import InputError, NumericsError
from auvident.physics.ase.draws import drawn_coefficients
from auvident.physics.fleet import possible
from auvident.physics.six_dof_terms import whole_names
from auvident.physics.terms import Structure, parameter_vector, structure_of
from auvident.schema.artifacts import AseResult, IdentifiedModel, RigidBody
from auvident.schema.coefficients import constants_of, symbols_of
from auvident.schema.combined import CombinedModel
from auvident.schema.desk import ModelSource
from auvident.schema.planes import Plane

Array = npt.NDArray[Any]

SAMPLES = 100  # models drawn for the intervals: each end then rests on some five of them


@dataclass(frozen=True)
class DeskModel:
    """Models of one plane: the best one first, then those drawn.

    Attributes
    ----------
    vehicle, name : str
        The vehicle, and the file that the model is from.
    source : str
    structure : Structure
    vectors : (S, n_parameters) array
    length_m : float
    given : tuple of str
        Coefficients that a vehicle file states.
    flown : dict
        Range that the models were identified from; empty where it is not known.
    """

    vehicle: str
    name: str
    source: ModelSource
    structure: Structure
    vectors: Array
    length_m: float
    given: tuple[str, ...] = ()
    flown: dict[str, float] = field(default_factory=dict)

    @property
    def plane(self) -> Plane:
        """Of its equations."""
        return self.structure.plane

    @property
    def coefficients(self) -> int:
        """How many coefficients its plane has."""
        return len(symbols_of(self.plane))

    def of_first(self) -> dict[str, float]:
        """Parameters of the best model by name."""
        return dict(zip(self.structure.parameters, self.vectors[0].tolist(), strict=True))


def identified_models(
    model: IdentifiedModel, name: str, samples: int, rng: np.random.Generator
) -> DeskModel:
    """An identified model, and some drawn from the covariance that it claims."""
    vectors = np.array(drawn_vectors(model, samples, rng, claimed_covariance))
    structure = structure_behind(model)
    length, flown = model.length_m, model.flown
    return DeskModel(model.vehicle, name, "identified", structure, vectors, length, flown=flown)


def estimated_models(
    ase: AseResult,
    rigid: RigidBody,
    plane: Plane,
    name: str,
    samples: int,
    rng: np.random.Generator,
) -> DeskModel:
    """The estimate from geometry with what is given in its place, and draws of both.

    Raises
    ------
    InputError
        Coefficients of the plane are missing.
    """
    rows = {c.symbol: c for c in ase.estimates}
    missing = [s for s in symbols_of(plane) if s not in rows]
    if missing:
        raise InputError(
            f"there are no coefficients of the {plane} plane: {', '.join(missing)}",
            f"{name}: [coefficients]",
            "State value and std of each, or diameter_m of a body of revolution.",
        )
    coefficients = ase.by_symbol()
    own = {s: rows[s] for s in (*symbols_of(plane), *constants_of(plane)) if s in rows}
    given = tuple(s for s in symbols_of(plane) if coefficients[s].origin == "given")
    values = {s: c.value for s, c in own.items()}
    stds = {s: c.std for s, c in own.items()}
    effects = ase.accuracy_effects
    drawn = drawn_coefficients(values, stds, effects, given=given, rng=rng, draws=samples)
    for follower, leader in LEADERS.items():  # two names of one added mass move together
        if follower in drawn:
            drawn[follower] = values[follower] + drawn[leader] - values[leader]
    columns = [{s: float(x[i]) for s, x in drawn.items()} for i in range(samples + 1)]
    vectors = np.array([parameter_vector(plane, column, rigid) for column in columns])
    source: ModelSource = "given" if given else "estimated"
    return DeskModel(ase.vehicle, name, source, structure_of(plane), vectors, ase.length_m, given)


def combined_models(
    model: CombinedModel, plane: Plane, name: str, samples: int, rng: np.random.Generator
) -> DeskModel:
    """A model of six degrees of freedom, restricted to a plane, and some drawn."""
    ids = model.effect_ids(plane)
    structure, moves = structure_of(plane, ids), [{}, *model.draws(samples, rng)]
    names = whole_names(plane, ids)
    values = [model.values(moved) for moved in moves]
    vectors = np.array([[v.get(names[n], 0.0) for n in structure.parameters] for v in values])
    source: ModelSource = (
        "identified" if any(m.plane == plane for m in model.models) else "estimated"
    )
    flown = model.flown.get(plane, {})
    return DeskModel(model.vehicle, name, source, structure, vectors, model.length_m, flown=flown)


def possible_models(models: DeskModel) -> DeskModel:
    """Those whose mass matrix is positive definite.

    Raises
    ------
    NumericsError
        The best one is not among them.
    """
    kept = possible(models.structure, models.vectors)
    if not kept[0]:
        raise NumericsError(
            "the mass matrix of the model is not positive definite",
            models.name,
            "Check mass, inertia, x_g_m and the added masses.",
        )
    return replace(models, vectors=models.vectors[kept])
