"""What trials say about the coefficients of all, by their maneuvers predicted again with these.

A parabola about a trial's own estimate is not the likelihood where the coefficients of all are: of
16 trials of a generated vehicle they lay so far from each other's own that predictions with them
cost half as much again as the parabolas told. So the trials are told again from where all of them
together are (Gauss-Newton on the sum of their likelihoods), as often as that moves.

What no one claims (the small effects that every vehicle may have) stays the trial's own, each time
beside its prior, and the pooled model carries the mean. It makes up for what the equations lack,
which is the same in every trial. Pooled, its prior counted once against all of them and gave way:
rudders that answer at once had a lag of 0.12 s, where each trial alone says 0.03, and zigzags that
were held out were predicted half as badly again.

What changed since a trial is that trial's own, too: the mean of a fin that was straight and is bent
is that of no vehicle. Of that the estimate from geometry is one and the same error in every trial
and counts once, with what is pooled; in each trial before a change it is left so wide that it says
nothing. Counted each time, 65 trials of a hull that fouls held their own drags to the estimate, and
through them the thrust: the drag came out by a fifth too small, by thirteen of its claimed standard
deviations.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.engines.replay import Replay
from auvident.engines.setup import bounds_of
from auvident.estimation.pooling import (
    WIDE,
    Pooled,
    TrialData,
    between_trials,
    eliminated,
    for_few,
    pooled,
    spread_over,
)
from auvident.parallel import each
from auvident.schema.pooled import POOLED
from auvident.stages.pool.collect import Collected

Array = npt.NDArray[Any]
Load = Callable[[], Replay | None]

ROUNDS = 10  # five vehicles of generated seasons took 3 to 7
SETTLED = 0.1  # [standard deviations of the pooled coefficients] of a move that ends the rounds


@dataclass(frozen=True)
class Again:
    """Trials told again.

    Attributes
    ----------
    data : Collected
        Nothing is told of what no one claims.
    unclaimed : (k,) int array
        Places of that.
    mean, variance : (k,) array
        What it is in a trial, in units of the prior; and what a single trial knows of it.
    by_model : tuple of str
        Trials whose models alone tell them.
    moved : float
        How far the coefficients moved in the last round, in their standard deviations.
    """

    data: Collected
    unclaimed: npt.NDArray[np.int64]
    mean: Array
    variance: Array
    by_model: tuple[str, ...]
    moved: float

    def together(self, between: Array) -> Pooled:
        """All trials and the prior; what no one claims as it is in a trial."""
        n = len(self.data.names)
        found = pooled(self.data.told, np.zeros(n), np.ones(n), between)
        mean, covariance = found.mean.copy(), found.covariance.copy()
        mean[self.unclaimed] = self.mean
        covariance[self.unclaimed, self.unclaimed] = self.variance
        return Pooled(mean, covariance)


def again(
    data: Collected, claimed: Sequence[str], changed: Sequence[Collection[str]] = ()
) -> Again:
    """The trials by their maneuvers, about the coefficients that they have together.

    Parameters
    ----------
    data : Collected
        As their models tell them; those without maneuvers stay so.
    claimed : sequence of str
        Effects of the vehicle that are more than what every vehicle may have.
    changed : sequence of collections of str, optional
        Parameters that changed since, of each trial.
    """
    unclaimed = _places(data, [n for n in data.names if not _is_claimed(n, claimed)])
    since = changed or [()] * len(data.trials)
    owns = [_own(data, unclaimed, names) for names in since]
    widths = [np.where(np.arange(len(own)) < len(unclaimed), 1.0, WIDE) for own in owns]
    theta = np.zeros(len(data.names))
    told = [_apart(*one, theta) for one in zip(data.told, owns, widths, strict=True)]
    theta, moved = _moved(data, [t for t, _ in told], theta)
    found: list[tuple[TrialData, Array] | None] = []
    for _ in range(ROUNDS):
        loads = [(*one, t.replay) for *one, t in zip(owns, widths, data.trials, strict=True)]
        found = each(partial(_about, data, theta), loads)
        told = [
            _apart(t, own, width, theta) if one is None else one
            for t, own, width, one in zip(data.told, owns, widths, found, strict=True)
        ]
        theta, moved = _moved(data, [t for t, _ in told], theta)
        if moved < SETTLED:
            break
    variances = [np.diag(np.linalg.inv(np.eye(len(theta)) + t.information)) for t in data.told]
    return Again(
        replace(data, told=tuple(t for t, _ in told)),
        unclaimed,
        _mean_since(data, unclaimed, [values for _, values in told], since),
        np.mean(variances, axis=0)[unclaimed],
        tuple(
            t.name
            for t, one in zip(data.trials, found, strict=True)
            if one is None and t.model.plan != POOLED
        ),
        moved,
    )


def _places(data: Collected, names: Collection[str]) -> npt.NDArray[np.int64]:
    return np.array([i for i, name in enumerate(data.names) if name in names], dtype=np.int64)


def _own(
    data: Collected, unclaimed: npt.NDArray[np.int64], changed: Collection[str]
) -> npt.NDArray[np.int64]:
    """Places of what is a trial's own: what no one claims, then what changed since."""
    return np.concatenate([unclaimed, np.setdiff1d(_places(data, changed), unclaimed)])


def _mean_since(
    data: Collected,
    unclaimed: npt.NDArray[np.int64],
    values: Sequence[Array],
    changed: Sequence[Collection[str]],
) -> Array:
    """What no one claims (k,), over the trials of which it did not change since."""
    own = np.array([row[: len(unclaimed)] for row in values])
    same = np.array([[data.names[i] not in names for i in unclaimed] for names in changed])
    return np.asarray(np.average(own, axis=0, weights=same) if own.size else own.mean(axis=0))


def _is_claimed(name: str, effects: Sequence[str]) -> bool:
    """Whether a parameter is a coefficient, or of one of these effects."""
    effect, dot, _ = name.partition(".")
    return not dot or effect in effects


def _apart(
    told: TrialData, own: npt.NDArray[np.int64], width: Array, theta: Array
) -> tuple[TrialData, Array]:
    """A trial without some parameters, which are its own; these (k,) beside the others of theta.

    Their prior, with these variances, counts in each trial.
    """
    n = len(told.score)
    kept = np.setdiff1d(np.arange(n), own)
    pull = -told.score[own]
    slope, left, share = eliminated(-told.score, told.information, kept, own, pull, width)
    held = told.information[np.ix_(own, own)] + np.diag(1.0 / width)
    values = np.linalg.solve(held, told.score[own]) - share @ theta[kept]
    return spread_over(replace(told, information=left, score=-slope), kept.tolist(), n), values


def _moved(data: Collected, told: Sequence[TrialData], theta: Array) -> tuple[Array, float]:
    """Pooled coefficients (n,) within their bounds; how far they moved in standard deviations."""
    n = len(theta)
    found = pooled(told, np.zeros(n), np.ones(n), for_few(between_trials(told), len(told)))
    low, high = ((bound - data.origin) / data.unit for bound in bounds_of(data.names))
    there = np.clip(found.mean, low, high)
    return there, float(np.abs((there - theta) / np.sqrt(np.diag(found.covariance))).max())


def _about(
    data: Collected, theta: Array, trial: tuple[npt.NDArray[np.int64], Array, Load | None]
) -> tuple[TrialData, Array] | None:
    """What a trial says about coefficients (n,) in units of the prior, and what is its own (k,).

    ``trial`` has the places of its own, the variances of their priors, and how its maneuvers are
    loaded.
    """
    own, width, load = trial
    replay = load() if load else None
    if replay is None:
        return None
    kept = np.setdiff1d(np.arange(len(theta)), own)
    there = data.origin + data.unit * theta
    values = {data.names[i]: float(there[i]) for i in kept}
    wide = {data.names[i]: float(w) for i, w in zip(own, width, strict=True)}
    found = replay.about(values, data.unit[kept], wide)
    if found is None:
        return None
    score = found.information @ theta[kept] - found.gradient
    told = spread_over(TrialData(found.information, score), kept.tolist(), len(theta))
    values_of_own = [found.values.get(data.names[i], float(data.origin[i])) for i in own]
    return told, (np.array(values_of_own) - data.origin[own]) / data.unit[own]
