"""The maneuvers behind a model, predicted again with other coefficients.

A model tells what its maneuvers say about coefficients near its own: a parabola. What they say
about others, as those that all trials of a vehicle have in common, is told by predicting them with
these: gradient and curvature of the likelihood there, with the noise that the model was fitted
with. What is the trial's own (the water, the ballast, the clocks) is most probable beside them, and
eliminated.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.engines.carried import LEADERS, internal_values, prior_behind
from auvident.engines.free_run import Colours, OutputError, likelihood, well_started
from auvident.engines.map_fit import Prior, map_fit
from auvident.engines.noise import white
from auvident.engines.prediction import Frame, Free
from auvident.engines.records import STATE_COLUMNS, Record
from auvident.engines.setup import active_states, bounds_of
from auvident.errors import NumericsError
from auvident.estimation.coloured import Colour
from auvident.estimation.pooling import eliminated
from auvident.physics.terms import Structure, parameter_vector, structure_of
from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.effects import BY_ID

Array = npt.NDArray[Any]

# Of the fit of what is a trial's own. It begins where the trial's model ended, some standard
# deviations away; what it leaves is in the gradient, and the next round goes on from there.
OWN_STEPS, OWN_TOLERANCE = 6, 1.0e-5


@dataclass(frozen=True)
class Replay:
    """Maneuvers that a model was identified from by output error.

    Attributes
    ----------
    model : IdentifiedModel
    records : tuple of Record
    dt_s : float
    """

    model: IdentifiedModel
    records: tuple[Record, ...]
    dt_s: float

    def about(
        self, common: Mapping[str, float], scale: Array, widened: Mapping[str, float] | None = None
    ) -> "Replayed | None":
        """What the maneuvers say about common parameters; None where the prediction runs away.

        Parameters
        ----------
        common : mapping
            Values of coefficients and of parameters of effects by name, internal; the equations
            have these effects, and those of the model.
        scale : (n,) array
            Unit of each.
        widened : mapping, optional
            By how much the variances of priors of the trial's own are larger than in its model.
        """
        own = [name for name in self.model.covariance["symbols"] if name not in common]
        scales = self._scales(own, widened or {})
        problem = self._problem(common, own, {str(e["id"]) for e in self.model.effects})
        p = self._own_fitted(problem, scales)
        if p is None:
            return None
        free = self._free(problem, [*common, *own], np.array([*scale, *scales]))
        half, gradient, information = likelihood(well_started(problem.output, p), p, free)
        if not np.isfinite(half):
            return None
        values = dict(zip([*common, *own], p[free.positions].tolist(), strict=True))
        ended = p[free.positions][len(common) :]
        away = (ended - self._priors(own)) / scales
        low, high = (np.isclose(ended, bound) for bound in bounds_of(own))
        told = _eliminated(gradient, information, away, len(common), (low, high))
        return Replayed(half + 0.5 * float(away @ away), *told, values)

    def own_beside(self, model: IdentifiedModel) -> dict[str, float]:
        """What is the trial's alone, as it is most probable beside a model; empty where it fails.

        The equations are those of the model, with the trial's water, ballast and clocks.
        """
        own = [name for name in self.model.covariance["symbols"] if _is_of_trial(name)]
        told = {str(e["id"]) for e in self.model.effects}
        known = {**model.values(), **internal_values(model.effects)}
        problem = self._problem(known, own, {e for e in told if BY_ID[e].of_trial})
        p = self._own_fitted(problem, self._scales(own, {}))
        if p is None:
            return {}
        return {name: float(p[problem.structure.index(name)]) for name in own}

    # --- the problem --------------------------------------------------------------------------

    def _problem(
        self, common: Mapping[str, float], own: Sequence[str], effects: set[str]
    ) -> "_Problem":
        """The equations with these effects, and those of which common parameters are given."""
        named = effects | {name.partition(".")[0] for name in common if "." in name}
        structure = structure_of(self.model.plane, tuple(e for e in BY_ID if e in named))
        values = self.model.values() | {n: v for n, v in common.items() if "." not in n}
        values |= {f: values[lead] for f, lead in LEADERS.items() if lead in common}
        told = {**internal_values(self.model.effects), **common}
        p = parameter_vector(self.model.plane, values, self.model.rigid_body, told, structure)
        active = active_states(self.model.stages[-1].system, self.model.plane)  # type: ignore[arg-type]
        frame = Frame(structure, self.model.sensing, self.dt_s)
        output = OutputError(frame, self.records, active, noise_behind(self.model))
        return _Problem(structure, output, p, tuple(own))

    def _free(self, problem: "_Problem", names: Sequence[str], scale: Array) -> Free:
        parameters = problem.structure.parameters
        place = {name: i for i, name in enumerate(parameters)}
        told = [(f, lead) for f, lead in LEADERS.items() if f in place and lead in names]
        followers = [(place[f], place[lead]) for f, lead in told]
        positions = np.array([place[name] for name in names], dtype=np.int64)
        return Free.among(len(parameters), positions, scale, followers)

    def _own_fitted(self, problem: "_Problem", scales: Array) -> Array | None:
        """Parameters with the most probable of a trial's own; None where that leads nowhere."""
        p, own = problem.parameters, problem.own
        try:
            output = well_started(problem.output, p)
            if not own:
                return p
            free = self._free(problem, own, scales)
            limits = (self._priors(own), *bounds_of(own))
            mean, low, high = ((x - p[free.positions]) / free.scale for x in limits)
            prior = Prior(mean, np.eye(len(own)), low, high, p[free.positions])
            return map_fit(output, free, prior, p, OWN_STEPS, OWN_TOLERANCE)[0]
        except NumericsError:
            return None

    def _scales(self, names: Sequence[str], widened: Mapping[str, float]) -> Array:
        told = self.model.covariance
        scales = dict(zip(told["symbols"], told["scale"], strict=True))
        return np.array([scales[name] * widened.get(name, 1.0) ** 0.5 for name in names])

    def _priors(self, names: Sequence[str]) -> Array:
        priors = prior_behind(self.model)
        return np.array([priors[name] for name in names])


def _eliminated(
    gradient: Array, information: Array, away: Array, n: int, lies_at: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Gradient and information about the first n parameters, the others at their best.

    These are ``away`` (k,) from their prior, in its standard deviations; at their lower or upper
    bound (``lies_at``) they stay where what pulls them would take them beyond.
    """
    low, high = lies_at
    pull = gradient[n:] + away
    loose = np.flatnonzero(~(low & (pull > 0.0)) & ~(high & (pull < 0.0)))
    slope, left, _ = eliminated(gradient, information, np.arange(n), n + loose, pull[loose])
    return slope, left


@dataclass(frozen=True)
class _Problem:
    """Equations and likelihood, where its parameters begin, and which are the trial's own."""

    structure: Structure
    output: OutputError
    parameters: Array
    own: tuple[str, ...]


@dataclass(frozen=True)
class Replayed:
    """What maneuvers say about n common parameters, in units of their scale.

    Attributes
    ----------
    cost : float
        Minus the log likelihood, and what the trial's own parameters pay to their prior.
    gradient : (n,) array
        Of the cost.
    information : (n, n) array
    values : dict
        All parameters, those of the trial alone as they are most probable.
    """

    cost: float
    gradient: Array
    information: Array
    values: dict[str, float]


def _is_of_trial(name: str) -> bool:
    """Whether a parameter is that of an effect which every trial has of its own."""
    return "." in name and BY_ID[name.partition(".")[0]].of_trial


def noise_behind(model: IdentifiedModel) -> Colours:
    """Noise of the channels that the last stage of a model was fitted with."""
    columns, fitted = STATE_COLUMNS[model.plane], model.stages[-1].fitted_noise
    known = white(np.array([model.sensing.noise_std[c] for c in columns]))
    return tuple(
        Colour(fitted[c].white_std, fitted[c].slow_std, fitted[c].slow_time_s)
        if c in fitted
        else colour
        for c, colour in zip(columns, known, strict=True)
    )


def replay_of(model: IdentifiedModel, records: Sequence[Record], dt_s: float) -> Replay | None:
    """The maneuvers behind a model, among some; None where they are not what it was fitted to.

    That of a filter is not the likelihood of a prediction, and where other readings count than did
    then the artifacts have changed since. Of two planes the second one shares what the first told.
    """
    if not model.stages or not model.stages[-1].fitted_noise:
        return None
    last = model.stages[-1]
    chosen = tuple(r for r in records if r.id in last.maneuvers)
    active = active_states(last.system, model.plane)  # type: ignore[arg-type]
    samples = sum(int(np.isfinite(r.measured[:, active]).sum()) for r in chosen)
    is_shared = any(c.shared_with for c in model.coefficients)
    is_same = samples == last.samples and len(chosen) == len(last.maneuvers)
    return Replay(model, chosen, dt_s) if is_same and not is_shared else None
