"""What trials say, carried over to common coefficients.

The data of a trial are described about its own coefficients, where some changes leave every motion
as it is (common scales of the equations). About others these are other changes. As what a motion
tells are accelerations (`auvident.physics.accelerations`), the difference that a trial sees
between its own coefficients m_t and others is::

    delta_t(theta) = A_t^+ (alpha(theta) - alpha(m_t)),   A_t = d alpha / d theta at m_t

which is theta - m_t less what it cannot see. Its log likelihood is quadratic in delta_t; about
theta its information is D' J D with D = A_t^+ A(theta). (In navigation the same is known as the
spurious information that a filter gains by linearising about several estimates: Huang, Mourikis
and Roumeliotis 2010.)
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.engines.carried import LEADERS
from auvident.estimation.pooling import TrialData, between_trials, for_few, pooled
from auvident.physics.accelerations import Accelerations, accelerations_of
from auvident.physics.terms import parameter_vector, structure_of
from auvident.schema.artifacts import IdentifiedModel
from auvident.stages.pool.collect import Collected

Array = npt.NDArray[Any]

UNSEEN = 1.0e-9  # singular values of the accelerations, of the largest: none to rounding
ROUNDS, SETTLED = (
    30,
    1.0e-6,
)  # of the common coefficients, and their last move in units of the prior
SCATTERING = 4  # rounds in which the scatter between trials is estimated as well
FARTHEST = 1.0  # move in one round, in units of the prior


def map_of(data: Collected) -> Accelerations:
    """From the common parameters, in their units, to accelerations."""
    model = data.trials[-1].model
    structure = structure_of(model.plane, data.effects)
    values = dict(zip(data.names, data.origin.tolist(), strict=True))
    followers = {f: lead for f, lead in LEADERS.items() if f in structure.parameters}
    own = {s: v for s, v in values.items() if "." not in s}
    own |= _held(model, own, followers)
    effects = {s: v for s, v in values.items() if "." in s}
    start = parameter_vector(model.plane, own, model.rigid_body, effects, structure)
    return accelerations_of(structure, start, data.names, data.unit, followers)


def _held(
    model: IdentifiedModel, own: dict[str, float], followers: dict[str, str]
) -> dict[str, float]:
    """Coefficients that no trial estimated, and those that follow another."""
    held = {s: v for s, v in model.values().items() if s not in own}
    return held | {f: own[lead] for f, lead in followers.items() if lead in own}


def carrier(data: Collected) -> Callable[[Array], tuple[TrialData, ...]]:
    """Common coefficients (n,), in units of the prior, to what each trial says about them."""
    found = map_of(data)
    ways = [_way(found, one) for one in zip(data.told, data.means, data.at, strict=True)]

    def carried(theta: Array) -> tuple[TrialData, ...]:
        alpha, slopes = found.at(theta), found.slopes(theta)
        return tuple(way(theta, alpha, slopes) for way in ways)

    return carried


def _way(
    found: Accelerations, one: tuple[TrialData, Array, Array]
) -> Callable[[Array, Array, Array], TrialData]:
    """How a trial's information is carried over."""
    told, mean, at = one
    alpha, slopes = found.at(mean), found.slopes(mean)[:, at]
    size = np.linalg.norm(slopes, axis=1)
    told_of = size > UNSEEN * size.max()  # a force that the trial's equations lack is not
    unit = np.where(told_of, 1.0 / np.where(told_of, size, 1.0), 0.0)
    back = np.linalg.pinv(slopes * unit[:, None], rcond=UNSEEN)
    information = told.information[np.ix_(at, at)]
    pull = told.score[at] - information @ mean[at]

    def carried(theta: Array, there: Array, slopes_there: Array) -> TrialData:
        away = back @ ((there - alpha) * unit)
        turned = back @ (slopes_there * unit[:, None])
        own = turned.T @ information @ turned
        score = turned.T @ (pull - information @ away) + own @ theta
        return replace(told, information=0.5 * (own + own.T), score=score)

    return carried


def about_common(data: Collected, inside: Sequence[int] | None = None) -> Collected:
    """The trials about the coefficients that they, or some of them, have together."""
    carry = carrier(data)
    n = len(data.names)
    chosen = set(range(len(data.told)) if inside is None else inside)
    theta = np.median([data.means[k] for k in chosen], axis=0)
    between = np.zeros(n)
    for k in range(ROUNDS):
        trials = [one for j, one in enumerate(carry(theta)) if j in chosen]
        between = for_few(between_trials(trials), len(trials)) if k < SCATTERING else between
        step = pooled(trials, np.zeros(n), np.ones(n), between).mean - theta
        step *= min(1.0, FARTHEST / max(float(np.abs(step).max()), FARTHEST))
        theta = theta + step
        if np.abs(step).max() < SETTLED:
            break
    return replace(data, told=carry(theta))
