"""Steps and drifts in parameters over a series of trials; it knows no vehicle.

Trial t says J_t and h_t of n parameters (`pooling.TrialData`, scatter between trials included). Had
nothing changed, the scores h_t - J_t theta would be N(0, J_t) with one theta. A candidate moves the
parameters along a direction d by an unknown size from one trial on, or in proportion to the time::

    theta_t = theta + size g_t d,   g_t = 0 or 1 (step), -1/2 to 1/2 (drift)

The score test of each, with theta and the changes found before fitted along, is standard normal
where nothing changed. The largest of all candidates is held against the largest that trials drawn
from their own claims have: the rate of false alarms is that of all directions and times together.
Where scatter between trials is among the claims, it is itself estimated from few of them, and the
drawn ones scatter by as much more or less as that allows.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from auvident.estimation.pooling import (
    LEAST_FREEDOM,
    WIDE,
    TrialData,
    between_neighbours,
    between_trials,
    for_few,
    freedom_of_neighbours,
    scattered,
    solved,
)

Array = npt.NDArray[Any]
Kind = Literal["step", "drift"]

LEAST_INFORMATION = 1.0e-3  # about a size, in units of the prior's; below it nothing is seen
LEAST_TRIALS = 3
MOST_CHANGES = 6
DRAWS, AT_ONCE = 2000, 100
RIVAL = 4.0  # two nats: difference of squares within which another candidate does as well
WITHIN = 3.84  # of the square: 95 % interval of the time of a step


@dataclass(frozen=True)
class FoundChange:
    """A change.

    Attributes
    ----------
    kind : str
    direction : int
    first : int
        First trial with it; of a drift 0.
    between : tuple of int
        Earliest and latest first trial that the data allow.
    size, std : float
        Along the direction; of a drift from the first to the last trial.
    z : float
        Standardised score.
    p : float
        Probability of as large a score anywhere if nothing changed.
    rivals : tuple of int
        Directions that explain it as well.
    """

    kind: Kind
    direction: int
    first: int
    between: tuple[int, int]
    size: float
    std: float
    z: float
    p: float
    rivals: tuple[int, ...]


@dataclass(frozen=True)
class ChangeSearch:
    """Changes in the order in which they were found, and the score that chance reaches.

    ``tests`` is the number of candidates, ``theta`` the parameters without the changes.
    """

    found: tuple[FoundChange, ...]
    threshold: float
    tests: int
    theta: Array


@dataclass(frozen=True)
class Scattering:
    """Trials that scatter, by variances that were estimated from them.

    Attributes
    ----------
    told : sequence of TrialData
        Without the scatter.
    variance : (n,) array
        As estimated.
    freedom : float
        Degrees of freedom of the estimate.
    """

    told: Sequence[TrialData]
    variance: Array
    freedom: float

    @cached_property
    def between(self) -> Array:
        """Variance (n,) that is counted with."""
        return for_few(self.variance, len(self.told))

    @cached_property
    def trials(self) -> list[TrialData]:
        """What each says of the vehicle."""
        return [scattered(t, self.between) for t in self.told]

    def drawn(self, count: int, rng: np.random.Generator) -> Array:
        """Scores (count, trials, n) of them where nothing changed.

        Each time they scatter by as much more or less as the estimate allows.
        """
        shape = count, len(self.told), len(self.variance)
        chance = rng.chisquare(self.freedom, (count, 1, shape[2])) / self.freedom
        away = np.sqrt(self.variance / chance) * rng.standard_normal(shape)
        by_noise, by_scatter = self._gains
        noise = rng.standard_normal(shape)
        drawn = np.einsum("tij,rtj->rti", by_noise, noise)
        return np.asarray(drawn + np.einsum("tij,rtj->rti", by_scatter, away))

    @cached_property
    def _gains(self) -> tuple[Array, Array]:
        """What noise and scatter make of the scores: (I + J T)^-1 J^1/2 and (I + J T)^-1 J."""
        informations = np.array([t.information for t in self.told])
        values, vectors = np.linalg.eigh(informations)
        roots = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
        weights = np.linalg.inv(np.eye(len(self.between)) + informations * self.between)
        return weights @ roots, weights @ informations


class _Series:
    """Information and scores over the trials, and the candidates."""

    def __init__(self, trials: Sequence[TrialData], directions: Array, times: Array) -> None:
        self.information = np.array([t.information for t in trials])
        self.scores = np.array([t.score for t in trials])
        self.directions = directions
        count = len(trials)
        steps = [(np.arange(count) >= k).astype(float) for k in range(1, count)]
        span = max(float(times[-1] - times[0]), np.finfo(float).tiny)
        drift = (times - times[0]) / span - 0.5
        self.courses = np.array([*steps, drift])
        self.along = np.einsum("tij,dj->tdi", self.information, directions)
        self.own = np.einsum("tdi,di->td", self.along, directions)

    def columns(self, chosen: Sequence[tuple[int, int]]) -> tuple[Array, Array]:
        """Information (m, m) about theta and the changes, and all candidates' part with them.

        Returns (m, m) and (courses, directions, m).
        """
        n, extra = self.information.shape[1], len(chosen)
        whole = np.zeros((n + extra, n + extra))
        whole[:n, :n] = self.information.sum(axis=0) + np.eye(n) / WIDE
        with_theta = np.einsum("ct,tdi->cdi", self.courses, self.along)
        with_others = np.zeros((*with_theta.shape[:2], extra))
        for k, (c, d) in enumerate(chosen):
            whole[:n, n + k] = whole[n + k, :n] = with_theta[c, d]
            across = np.einsum("tdi,i->td", self.along, self.directions[d])
            with_others[:, :, k] = np.einsum("ct,td->cd", self.courses * self.courses[c], across)
        for k, (c, d) in enumerate(chosen):
            whole[n + k, n:] = with_others[c, d]
        return whole, np.concatenate([with_theta, with_others], axis=2)

    def sums(self, scores: Array, chosen: Sequence[tuple[int, int]]) -> tuple[Array, Array]:
        """Scores (..., trials, n) about theta and changes (..., m), and about candidates."""
        along = scores @ self.directions.T
        candidates = np.einsum("ct,...td->...cd", self.courses, along)
        told = [candidates[..., c, d][..., None] for c, d in chosen]
        return np.concatenate([scores.sum(axis=-2), *told], axis=-1), candidates


def search(
    told: Sequence[TrialData],
    directions: Array,
    times: Array,
    rng: np.random.Generator,
    false_alarms: float,
) -> tuple[ChangeSearch, Sequence[TrialData]]:
    """Look for changes until none stands out from chance and from the scatter between trials.

    First from the scatter of neighbours, in which a step is once and a drift by little. That takes
    the scatter of one parameter for that of another which every trial sees with it; so what is
    found has to stand out again from the scatter that is left with it, by its likelihood. Of drawn
    series of 6 to 20 trials whose parameters all scatter by 0.1 to 1 prior standard deviations 7 %
    then have a change at a stated 5 %, where 12 % have one by the first alone and 30 % with its
    scatter taken as known.

    Parameters
    ----------
    told : sequence of TrialData
        In the order of time.
    directions : (d, n) array
        That parameters may change along.
    times : (trials,) array
        In any unit.
    rng : Generator
        For the trials drawn from their claims.
    false_alarms : float
        Probability of one change or more where there is none.

    Returns
    -------
    ChangeSearch
    sequence of TrialData
        The trials with the scatter from which changes had to stand out.
    """
    count, n = len(told), directions.shape[1]
    if count < LEAST_TRIALS:
        return ChangeSearch((), np.inf, 0, np.zeros(n)), told
    neighbours = Scattering(told, between_neighbours(told), freedom_of_neighbours(count))
    found = search_from(neighbours, directions, times, rng, false_alarms)
    if not found.found:
        return found, neighbours.trials
    rest = [_without(t, found, directions, times, k) for k, t in enumerate(told)]
    freedom = max(count - 1 - len(found.found), LEAST_FREEDOM)
    left = Scattering(told, between_trials(rest), freedom)
    return search_from(left, directions, times, rng, false_alarms), left.trials


def _without(
    trial: TrialData, search: ChangeSearch, directions: Array, times: Array, k: int
) -> TrialData:
    """What a trial would say if nothing had changed."""
    changes = (f.size * course(f, k, times) * directions[f.direction] for f in search.found)
    return replace(trial, score=trial.score - trial.information @ sum(changes))


def search_from(
    scattering: Scattering,
    directions: Array,
    times: Array,
    rng: np.random.Generator,
    false_alarms: float,
) -> ChangeSearch:
    """Look for changes until none stands out from chance and a scatter that was estimated."""
    series = _Series(scattering.trials, directions, times)
    largest, tests = _by_chance(series, scattering, rng)
    threshold = float(np.quantile(largest, 1.0 - false_alarms))
    chosen: list[tuple[int, int]] = []
    scores: list[tuple[Array, float]] = []
    while len(chosen) < MOST_CHANGES:
        z = _standardised(series, chosen)
        c, d = np.unravel_index(int(np.argmax(np.abs(z))), z.shape)
        if abs(z[c, d]) <= threshold:
            break
        chosen.append((int(c), int(d)))
        scores.append((z, float(z[c, d])))
    return ChangeSearch(
        tuple(_found(series, chosen, scores, largest)),
        threshold,
        tests,
        _fitted(series, chosen)[0][: directions.shape[1]],
    )


def _standardised(series: _Series, chosen: Sequence[tuple[int, int]]) -> Array:
    """Scores (courses, directions) over their standard deviations."""
    gains, root = _gains(series, chosen)
    about, candidates = series.sums(series.scores, chosen)
    return (candidates - gains @ about) * root


def _gains(series: _Series, chosen: Sequence[tuple[int, int]]) -> tuple[Array, Array]:
    """What theta takes of each candidate (c, d, m), and one over the standard deviation (c, d)."""
    whole, parts = series.columns(chosen)
    gains = np.linalg.solve(whole, parts.reshape(-1, len(whole)).T).T.reshape(parts.shape)
    own = np.einsum("ct,td->cd", series.courses**2, series.own)
    left = own - np.einsum("cdm,cdm->cd", gains, parts)
    return gains, np.where(left > LEAST_INFORMATION, 1.0, 0.0) / np.sqrt(np.maximum(left, 1e-300))


def _by_chance(
    series: _Series, scattering: Scattering, rng: np.random.Generator
) -> tuple[Array, int]:
    """Largest scores of series drawn where nothing changes, and the number of candidates."""
    gains, root = _gains(series, ())
    found: list[Array] = []
    for _ in range(DRAWS // AT_ONCE):
        about, candidates = series.sums(scattering.drawn(AT_ONCE, rng), ())
        z = (candidates - np.einsum("cdm,rm->rcd", gains, about)) * root
        found.append(np.abs(z).max(axis=(1, 2)))
    return np.concatenate(found), int(np.count_nonzero(root))


def _fitted(series: _Series, chosen: Sequence[tuple[int, int]]) -> tuple[Array, Array]:
    """Theta and sizes of the changes together, and their covariance."""
    whole, _ = series.columns(chosen)
    about, _ = series.sums(series.scores, chosen)
    return solved(whole, about)


def _found(
    series: _Series,
    chosen: Sequence[tuple[int, int]],
    scores: Sequence[tuple[Array, float]],
    largest: Array,
) -> list[FoundChange]:
    sizes, covariance = _fitted(series, chosen)
    n, found = series.directions.shape[1], []
    for k, ((c, d), (z, own)) in enumerate(zip(chosen, scores, strict=True)):
        drift = c == len(series.courses) - 1
        near = np.flatnonzero(z[:-1, d] ** 2 > own**2 - WITHIN)
        best = (z**2).max(axis=0)
        order = np.argsort(-best, kind="stable")
        rivals = [int(r) for r in order if r != d and best[r] > own**2 - RIVAL]
        found.append(
            FoundChange(
                "drift" if drift else "step",
                d,
                0 if drift else c + 1,
                (0, len(series.scores) - 1)
                if drift
                else (int(near.min()) + 1, int(near.max()) + 1),
                float(sizes[n + k]),
                float(np.sqrt(covariance[n + k, n + k])),
                own,
                float((1 + np.count_nonzero(largest >= abs(own))) / (1 + len(largest))),
                tuple(rivals),
            )
        )
    return found


def course(found: FoundChange, k: int, times: Array) -> float:
    """How much of a change a trial has: of a step none or all, of a drift from -1/2 to 1/2."""
    if found.kind == "step":
        return float(k >= found.first)
    span = max(float(times[-1] - times[0]), np.finfo(float).tiny)
    return float(times[k] - times[0]) / span - 0.5


def series_along(
    trials: Sequence[TrialData], direction: Array, theta: Array
) -> list[tuple[float, float]]:
    """Size of a change in each trial alone, the others at theta, with its standard deviation.

    What a trial does not see has an infinite one.
    """
    found = []
    for t in trials:
        own = float(direction @ t.information @ direction)
        away = float(direction @ (t.score - t.information @ theta))
        seen = own > LEAST_INFORMATION
        found.append((away / own, 1.0 / np.sqrt(own)) if seen else (0.0, np.inf))
    return found
