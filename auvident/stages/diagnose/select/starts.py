"""Where the fit of a candidate begins."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.engines.free_run import residual_of
from auvident.errors import NumericsError
from auvident.parallel import each
from auvident.schema.effects import BY_ID
from auvident.stages.diagnose.fit.case import Case
from auvident.stages.diagnose.fit.fits import Fitted, first_colours, fit_with, output_error
from auvident.stages.diagnose.score.first_order import Score, joint_about

Array = npt.NDArray[Any]

# Prior standard deviations of a limit at which a fit begins as well. One that is not reached shows
# nothing to first order; beside one that is always reached the coefficients are those of another
# vehicle, from which no small step leads back.
FAR = (2.0, 4.0)


def baseline_of(case: Case) -> Fitted:
    """Best fit without any effect, from the identified model and from the estimate.

    One that a small change of its coefficients makes diverge is none to search from: the current of
    a short trial had bent it until it fitted.
    """

    def begun(start: Array) -> Fitted | None:
        p = case.at_rest(start)
        return fit_with(case, (), p, first_colours(case, p), rounds=3, steps=12)

    found = [f for f in each(begun, (case.identified, case.setup.prior)) if f is not None]
    if not found:
        raise NumericsError(
            "the prediction of a maneuver used for identification diverges, both with "
            "the identified coefficients and with the estimate from geometry",
            _runaway_of(case),
            "Hold that maneuver out, or check its log.",
        )
    steady = [f for f in found if joint_about(case, f, ()) is not None]
    return max(steady or found, key=lambda f: f.log_likelihood)


def _runaway_of(case: Case) -> str:
    """Maneuvers in which the identified model runs away."""
    output = output_error(case, first_colours(case, case.identified))
    at = output.at(case.identified)
    return ", ".join(r.id for r in case.records if residual_of(output, at, r) is None)


def at_typical_size(case: Case, before: Fitted, candidate: str) -> Array | None:
    """The model with an effect at a typical size, for those that act in no straight line.

    What the sensors say about each other is the size where they say something.
    """
    known = known_to_sensors(case, (*before.effects, candidate))
    positions = case.positions(candidate)
    names = [case.names[i] for i in positions]
    if not BY_ID[candidate].curved and not any(name in known for name in names):
        return None
    p = before.parameters.copy()
    for i, name in zip(positions, names, strict=True):
        p[i] = known[name][0] if name in known else float(case.setup.prior_std[i])
    return p


@dataclass(frozen=True)
class Begin:
    """Where the fit of a candidate may begin.

    Attributes
    ----------
    parameters : (n_parameters,) array
    promise : float
        What the first step lets one hope for [nats].
    unseen : bool
        Nobody knows what is to be hoped for: a limit that is reached.
    """

    parameters: Array
    promise: float
    unseen: bool = False


def starts_of(
    case: Case, before: Fitted, candidate: str, scored: Score, typical: Score | None
) -> list[Begin]:
    """Where the first-order step leads, and sizes that it cannot know.

    Parameters
    ----------
    scored : Score
        The best one of the screen.
    typical : Score or None
        From a typical size; None for candidates that have none, or run away from it.
    """
    found = [Begin(scored.parameters, scored.gain)]
    there = at_typical_size(case, before, candidate)
    if there is not None and typical is not None:
        found.append(Begin(there, typical.gain, is_limit(candidate)))
    far = at_far_sizes(case, before, candidate)
    return [*found, *(Begin(p, -np.inf, unseen=True) for p in far)]


def is_limit(candidate: str) -> bool:
    """Whether an effect does nothing until it is reached."""
    return any(p.form != "plain" for p in BY_ID[candidate].parameters)


def at_far_sizes(case: Case, before: Fitted, candidate: str) -> list[Array]:
    """The model with a limit at sizes that are far from none."""
    if not is_limit(candidate):
        return []
    own, starts = case.positions(candidate), []
    for stds in FAR:
        p = before.parameters.copy()
        p[own] = stds * case.setup.prior_std[own]
        starts.append(p)
    return starts


def known_to_sensors(case: Case, effects: Sequence[str]) -> dict[str, tuple[float, float]]:
    """Mean and standard deviation by name, of all checks of the sensors that have it."""
    there = {name for effect in effects for name in BY_ID[effect].names()}
    told: dict[str, list[tuple[float, float]]] = {}
    for check in (check.with_only(there) for check in case.checks):
        variances = np.diag(check.covariance)
        for name, mean, variance in zip(check.names, check.mean, variances, strict=True):
            told.setdefault(name, []).append((float(mean), float(variance)))
    return {name: _weighted(*np.array(values).T) for name, values in told.items()}


def _weighted(means: Array, variances: Array) -> tuple[float, float]:
    """Weighted mean and its standard deviation, wider where they disagree (Birge 1932)."""
    weights = 1.0 / variances
    mean = float(weights @ means / weights.sum())
    disagree = float(weights @ (means - mean) ** 2) / max(len(means) - 1, 1)
    return mean, float(np.sqrt(max(disagree, 1.0) / weights.sum()))
