"""The effects a model carries: from its artifact to the prediction and back."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import USUAL_SPEED_MPS
from auvident.engines.prediction import Frame, Free, at_effects, readings, simulated
from auvident.engines.records import Record
from auvident.errors import StageError
from auvident.physics.sensing import current, water_abreast, water_in_vertical
from auvident.physics.terms import Structure, parameter_vector, structure_of, symbol_in
from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.coefficients import Plane
from auvident.schema.complete import unknown_effects
from auvident.schema.effects import BY_ID, own_in, parameter_of
from auvident.schema.planes import PLANES

Array = npt.NDArray[Any]
Window = tuple[str, float, float]  # maneuver, start and end [s] of readings that are left out

OF_THRUST = {"propeller_race", "thrust_line_moment"}  # and so of the speed
CURRENTS = {"current", "current_drift", "vertical_current"}
# coefficients that are one added mass: N_vdot = Y_rdot, M_wdot = Z_qdot
LEADERS = {symbol_in(p, "B_adot"): symbol_in(p, "A_bdot") for p in PLANES}


@dataclass(frozen=True)
class Carried:
    """Effects that an identification carries.

    Attributes
    ----------
    effects : tuple of str
        Those that are estimated, in the order of the table; the others are given.
    start, prior, prior_std : mapping
        Internal values by name ``effect.parameter``; a standard deviation of zero holds the start.
        The start may also name coefficients.
    windows : tuple of (maneuver, start, end)
        Readings that are left out [s].
    expected : mapping
        What every model is expected to have of an effect; its size is told beyond that.
    least_noise : mapping
        Channels (by column) that count no more than with this standard deviation.
    own_starts : bool
        Readings count by what a fit leaves of them with the starts fitted, not by what is left from
        the line through the first readings. Of a hull that hardly keeps its course errors of
        starts outgrow all else, and a fit lets go of the maneuvers that told it most.
    """

    effects: tuple[str, ...] = ()
    start: Mapping[str, float] = field(default_factory=dict)
    prior: Mapping[str, float] = field(default_factory=dict)
    prior_std: Mapping[str, float] = field(default_factory=dict)
    windows: tuple[Window, ...] = ()
    expected: Mapping[str, float] = field(default_factory=dict)
    least_noise: Mapping[str, float] = field(default_factory=dict)
    own_starts: bool = False

    def ids(self, plane: Plane) -> tuple[str, ...]:
        """All effects with a value, estimated or given, in the order of the table."""
        named = {n.partition(".")[0] for n, value in self.start.items() if value and "." in n}
        named |= {n.partition(".")[0] for n, std in self.prior_std.items() if std > 0.0}
        named |= set(self.effects)
        return tuple(e for e in BY_ID if e in named and plane in BY_ID[e].planes)

    def only(self, effects: Collection[str]) -> "Carried":
        """Without the values of other effects than these."""

        def kept(values: Mapping[str, float]) -> dict[str, float]:
            own = {n: v for n, v in values.items() if "." in n and n.partition(".")[0] in effects}
            return own | {n: v for n, v in values.items() if "." not in n}

        return replace(
            self,
            start=kept(self.start),
            prior=kept(self.prior),
            prior_std=kept(self.prior_std),
            expected=kept(self.expected),
        )

    def with_values_of(self, other: "Carried") -> "Carried":
        """With the values of another one beside these, and in their place."""
        return replace(
            self,
            start={**self.start, **other.start},
            prior={**self.prior, **other.prior},
            prior_std={**self.prior_std, **other.prior_std},
            expected={**self.expected, **other.expected},
        )

    def adding(self, stds: Mapping[str, float]) -> "Carried":
        """With other parameters, which are estimated from nothing on, beside these."""
        none = dict.fromkeys(stds, 0.0)
        return self.with_values_of(Carried(start=none, prior=none, prior_std=stds))

    def structure(self, plane: Plane) -> Structure:
        """The equations with these effects."""
        return structure_of(plane, self.ids(plane))


def allowed(
    effects: Sequence[str], plane: Plane, length_m: float, speed_mps: float = USUAL_SPEED_MPS
) -> Carried:
    """Effects as small as every vehicle has them, estimated along without a claim.

    What a plan says of one fin it says of that of the plane: `rudder_lag` is `elevator_lag` there.
    """
    own = dict.fromkeys(own_in(plane, e) for e in effects)
    rows = {
        n: parameter_of(n) for e in own if plane in BY_ID[e].planes for n in BY_ID[e].names(plane)
    }
    expected = {
        name: declared.nuisance_std * declared.size_unit(1.0, length_m, speed_mps, 1.0)
        for name, declared in rows.items()
    }
    return Carried(start=expected, prior=dict.fromkeys(rows, 0.0), prior_std=expected)


def internal_values(effects: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Internal value of every parameter of the effects in a model."""
    return {name: float(v) for effect in effects for name, v in effect["internal"].items()}


def structure_behind(model: IdentifiedModel) -> Structure:
    """The equations of a model with the effects it carries.

    Raises
    ------
    StageError
        An effect that this version does not know.
    """
    names = tuple(str(e["id"]) for e in model.effects)
    unknown = unknown_effects(names)
    if unknown:
        raise StageError(
            unknown,
            f"model of {model.vehicle}, {model.plane} plane",
            "Use the version of auvident that identified the model, or a later one.",
        )
    return structure_of(model.plane, names)


def vector_behind(model: IdentifiedModel, coefficients: Mapping[str, float] | None = None) -> Array:
    """Parameter vector of a model, its effects included.

    Parameters
    ----------
    model : IdentifiedModel
    coefficients : mapping, optional
        Coefficients to take in place of the model's own.
    """
    return parameter_vector(
        model.plane,
        coefficients or model.values(),
        model.rigid_body,
        internal_values(model.effects),
        structure_behind(model),
    )


def prior_behind(model: IdentifiedModel) -> dict[str, float]:
    """Mean of the prior of every parameter that a model estimated, internal.

    A model of an earlier version does not tell that of effects, which mostly is none.
    """
    symbols, own = model.covariance["symbols"], model.priors()
    told = dict.fromkeys(symbols, 0.0)
    told |= dict(zip(symbols, model.covariance.get("prior", ()), strict=False))
    return {s: own[s] if s in own else told[s] for s in symbols}


def fitted_covariance(model: IdentifiedModel) -> Array:
    """Covariance of the estimated parameters as the fit left it.

    Variances widened to the scatter between maneuvers no longer go with the covariances, and would
    let what is known well together scatter apart. A model of an earlier version has no others.
    """
    covariance = np.array(model.covariance["matrix"])
    if "fitted_variance" in model.covariance:
        np.fill_diagonal(covariance, model.covariance["fitted_variance"])
    return covariance


def claimed_covariance(model: IdentifiedModel) -> Array:
    """Covariance that holds for vehicles of other structure: of the fit, and of the scatter.

    A model of an earlier version, or of too few maneuvers, has the former alone.
    """
    covariance = fitted_covariance(model)
    if "scatter" in model.covariance:
        covariance = covariance + np.array(model.covariance["scatter"])
    return covariance


def free_behind(
    model: IdentifiedModel, claim: Callable[[IdentifiedModel], Array] = fitted_covariance
) -> tuple[Free, Array]:
    """The parameters that a model estimated, and their covariance in units of the scale.

    Parameters
    ----------
    claim : callable
        Which covariance: `fitted_covariance` or `claimed_covariance`.
    """
    structure, told = structure_behind(model), model.covariance
    kept = [i for i, s in enumerate(told["symbols"]) if s in structure.parameters]
    positions = np.array([structure.index(told["symbols"][i]) for i in kept], dtype=np.int64)
    followers = [c.symbol for c in model.coefficients if c.origin == "kinematic"]
    pairs = [(structure.index(f), structure.index(LEADERS[f])) for f in followers]
    scale = np.array(told["scale"])[kept]
    free = Free.among(len(structure.parameters), positions, scale, pairs)
    return free, claim(model)[np.ix_(kept, kept)] / np.outer(scale, scale)


def frame_of(model: IdentifiedModel, dt_s: float) -> Frame:
    """What a prediction with a model needs."""
    return Frame(structure_behind(model), model.sensing, dt_s)


@dataclass(frozen=True)
class Course:
    """A predicted course: readings (n, 4) at the sensors, states (n, 4) at the origin.

    Velocities of `states` are through the water where the model has a current, those of
    `over_ground` never.
    """

    readings: Array
    states: Array
    over_ground: Array


def predicted_course(frame: Frame, p: Array, record: Record, active: Array) -> Course:
    """Free-running prediction of a record from its start and inputs, and nothing measured after."""
    record = free_running(frame, p, record, active)
    acting = at_effects(frame, p, record)
    states = simulated(frame, p, acting, active)
    return Course(readings(frame, p, record, states), states, over_ground(frame, p, record, states))


def free_running(frame: Frame, p: Array, record: Record, active: Array) -> Record:
    """The record with nothing measured after its start in what acts on its inputs.

    The propeller race and the moment of the thrust need the speed: it is that of a first
    prediction.
    """
    if not OF_THRUST & set(frame.structure.effects) or record.source is None:
        return record
    first = with_speed(record, np.full(len(record.time_s), record.start[0]))
    states = simulated(frame, p, at_effects(frame, p, first), active)
    return with_speed(record, np.nan_to_num(states[:, 0], nan=record.start[0]))


def with_speed(record: Record, speed: Array) -> Record:
    """The record with another speed (n,) for what acts on the inputs."""
    source = record.source
    assert source is not None
    lead = np.full(len(source.speed) - len(speed), speed[0])
    return replace(record, source=replace(source, speed=np.concatenate([lead, speed])))


def over_ground(frame: Frame, p: Array, record: Record, states: Array) -> Array:
    """States with the velocity of the water added."""
    if not CURRENTS & set(frame.structure.effects):
        return states
    e, out = frame.reading_effects(p), states.copy()
    if frame.structure.plane == "vertical":
        heading = None if record.source is None else record.source.heading
        out[:, :2] += water_in_vertical(e, states[:, 3], heading)
        return out
    middle = None if record.source is None else record.source.from_middle_s
    since = np.zeros(len(states)) if middle is None else middle
    north, east = current(e, since).T
    ahead, aside = water_abreast(north, east, states[:, 3])
    out[:, 0] += ahead
    out[:, 1] += aside
    return out


def effect_rows(
    structure: Structure,
    p: Array,
    stds: Mapping[str, float],
    expected: Mapping[str, float],
    named: Sequence[str],
) -> tuple[dict[str, Any], ...]:
    """The effects of a model as they stand in its artifact; ``nuisance`` are those not named."""
    rows = []
    for effect in structure.effects:
        internal = {n: float(p[structure.index(n)]) for n in BY_ID[effect].names(structure.plane)}
        values = []
        for name, value in internal.items():
            declared = parameter_of(name)
            shown, std = declared.shown(value - expected.get(name, 0.0), stds.get(name, 0.0))
            values.append(
                {
                    "symbol": declared.symbol,
                    "value": shown,
                    "std": std,
                    "unit": declared.unit,
                }
            )
        rows.append(
            {
                "id": effect,
                "family": BY_ID[effect].family,
                "parameters": values,
                "nuisance": effect not in named,
                "internal": internal,
            }
        )
    return tuple(rows)
