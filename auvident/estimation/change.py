"""Steps and drifts in parameters over a series of trials; it knows no vehicle.

Trial t says J_t and h_t of n parameters (`pooling.TrialData`, scatter between trials included). Had
nothing changed, the scores h_t - J_t theta would be N(0, J_t) with one theta. A candidate moves the
parameters along a direction d by an unknown size from one trial on, or in proportion to the time::

    theta_t = theta + size g_t d,   g_t = 0 or 1 (step), -1/2 to 1/2 (drift)

The score test of each, with theta and the changes found before fitted along, is standard normal
where nothing changed. The largest of all candidates is held against the largest that trials drawn
from their own claims have: the rate of false alarms is that of all directions and times together.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from auvident.estimation.pooling import WIDE, TrialData

Array = npt.NDArray[Any]
Kind = Literal["step", "drift"]

LEAST_INFORMATION = 1.0e-3  # about a size, in units of the prior's; below it nothing is seen
LEAST_TRIALS = 3
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
    trials: Sequence[TrialData],
    directions: Array,
    times: Array,
    rng: np.random.Generator,
    false_alarms: float,
    most: int = 6,
) -> ChangeSearch:
    """Look for changes until none stands out from chance.

    Parameters
    ----------
    trials : sequence of TrialData
        In the order of time.
    directions : (d, n) array
        That parameters may change along.
    times : (trials,) array
        In any unit.
    rng : Generator
        For the trials drawn from their claims.
    false_alarms : float
        Probability of one change or more where there is none.
    most : int
        Changes at most.
    """
    n = directions.shape[1]
    if len(trials) < LEAST_TRIALS:
        return ChangeSearch((), np.inf, 0, np.zeros(n))
    series = _Series(trials, directions, times)
    largest, tests = _by_chance(series, rng)
    threshold = float(np.quantile(largest, 1.0 - false_alarms))
    chosen: list[tuple[int, int]] = []
    scores: list[tuple[Array, float]] = []
    while len(chosen) < most:
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
        _fitted(series, chosen)[0][:n],
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


def _by_chance(series: _Series, rng: np.random.Generator) -> tuple[Array, int]:
    """Largest scores of series drawn where nothing changes, and the number of candidates."""
    gains, root = _gains(series, ())
    values, vectors = np.linalg.eigh(series.information)
    roots = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
    found: list[Array] = []
    for _ in range(DRAWS // AT_ONCE):
        drawn = rng.standard_normal((AT_ONCE, *series.scores.shape))
        about, candidates = series.sums(np.einsum("tij,rtj->rti", roots, drawn), ())
        z = (candidates - np.einsum("cdm,rm->rcd", gains, about)) * root
        found.append(np.abs(z).max(axis=(1, 2)))
    return np.concatenate(found), int(np.count_nonzero(root))


def _fitted(series: _Series, chosen: Sequence[tuple[int, int]]) -> tuple[Array, Array]:
    """Theta and sizes of the changes together, and their covariance."""
    whole, _ = series.columns(chosen)
    about, _ = series.sums(series.scores, chosen)
    covariance = np.linalg.inv(whole)
    return covariance @ about, covariance


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
        rivals = [int(r) for r in np.argsort(-best) if r != d and best[r] > own**2 - RIVAL]
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
