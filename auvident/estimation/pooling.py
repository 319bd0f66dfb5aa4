"""Trials pooled by the information of their data; it knows no vehicle.

Every trial starts from the same prior N(0, V) in units of its standard deviations and ends at
N(m, P). What its data alone say is the information J = P^-1 - V^-1 and the score h = P^-1 m - V^-1
m_0: the trial's own parameters are gone with their rows and columns, as they are independent before
the data. Trials add up::

    P^-1 = V^-1 + sum J_t,   m = P (V^-1 m_0 + sum h_t)

Between trials the parameters themselves scatter with a variance T, diagonal: ballast, temperature,
repairs. The data of a trial then say less of the vehicle, (J^-1 + T)^-1 = J - J (J + T^-1)^-1 J,
also where J is singular. T is that of largest restricted likelihood (Patterson and Thompson 1971),
from moments on (DerSimonian and Laird 1986; several parameters at once as in Jackson, White and
Riley 2013), and is zero where the trials agree (Cochran's Q).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.estimation.chances import chi_square_above
from auvident.estimation.identifiability import UNSEEN_INFORMATION

Array = npt.NDArray[Any]

ROUNDING = 1.0e-9  # of the largest eigenvalue of an information; smaller ones are zero
SEEN = UNSEEN_INFORMATION  # from which on a direction counts in tests
# Variance of a prior that says nothing of what the data see, and keeps what none of them sees where
# it is: a wider one would let rounding move it far.
WIDE = 100.0
WEAK = 1.0e-6  # information that keeps the scale of what no trial sees finite
# Probability of so much scatter by chance above which trials agree. Few trials see little of their
# scatter: with 0.1 the squared errors of six trials that scatter by 0.02 of the prior variance were
# 1.11 times as large as claimed, so 1.04; of six that agree 0.96 and 0.94.
AGREE = 0.2
LEAST_FREEDOM = 3  # of a scatter, counted at least: fewer leave Student's t without a variance
LEAST_TOLD = 0.5  # degrees of freedom below which a sum of squares says nothing
ALIKE_ROUNDS = 30
# Where the likelihood of a variance is climbed from at least, and steps at most, from a good start
# fewer. A variance is steady where the squares are so near to what is expected of them, on its way
# to zero below the share `STAYS` of that, and not felt where it is so small beside all errors.
LEAST_SCATTER, LIKELY_ROUNDS, LIKELY_ROUNDS_AGAIN = 1.0e-3, 150, 20
STEADY, STAYS, UNFELT = 0.01, 0.98, 0.01
NOTHING = 1.0e-12  # information that is none, in units of the prior's
BEYOND_CHANCE = 1.0e-3  # probability of so large a difference of two trials by chance
ROUNDS = 4  # of weights and variances, which depend on each other
# [std] beyond which a difference of neighbours counts no more: so low that a step, one difference
# in seven, makes the variance 1.5 times as large; beyond one in three it would pass for scatter.
CLIPPED = 1.5
OF_CLIPPED = 0.7785  # mean square of a standard normal variable that is clipped there


@dataclass(frozen=True)
class TrialData:
    """What the data of one trial say of n parameters.

    Attributes
    ----------
    information : (n, n) array
        J, positive semi-definite; zero where the trial has no such parameter.
    score : (n,) array
        h, the information times the estimate of the data alone.
    clipped : float
        Largest negative eigenvalue that was set to zero, in units of the prior's information.
    """

    information: Array
    score: Array
    clipped: float = 0.0


def told_by(mean: Array, covariance: Array, prior_mean: Array, prior_variance: Array) -> TrialData:
    """What the data say: the posterior without its prior.

    Where a posterior is wider than its prior, the data count as none; that is decided along the
    eigenvectors in units of the prior, in which no parameter has a unit.
    """
    root = np.sqrt(prior_variance)
    inverse = np.linalg.inv(covariance / np.outer(root, root))
    values, vectors = np.linalg.eigh(0.5 * (inverse + inverse.T) - np.eye(len(mean)))
    seen = vectors[:, values > ROUNDING * max(float(values[-1]), 1.0)]
    kept = values[values > ROUNDING * max(float(values[-1]), 1.0)]
    away = inverse @ (mean / root) - prior_mean / root
    score = (seen @ (seen.T @ away)) / root
    information = (seen * kept) @ seen.T / np.outer(root, root)
    return TrialData(information, score, max(0.0, -float(values[0])))


def eliminated(
    gradient: Array,
    information: Array,
    kept: Array,
    gone: Array,
    pull: Array,
    variance: Array | float = 1.0,
) -> tuple[Array, Array, Array]:
    """Gradient and information about some parameters, others being at their best beside a prior.

    Parameters
    ----------
    gradient, information : (n,), (n, n) array
        Of minus the log likelihood, in standard deviations of the prior.
    kept, gone : (m,), (k,) int array
    pull : (k,) array
        Gradient by what is eliminated, with that of its prior.
    variance : (k,) array or float
        Of the prior of what is eliminated.

    Returns
    -------
    (m,), (m, m) array
        The Schur complement.
    (k, m) array
        How what is eliminated moves against what is kept.
    """
    held = information[np.ix_(gone, gone)] + np.eye(len(gone)) / variance
    share = np.linalg.solve(held, information[np.ix_(gone, kept)])
    left = information[np.ix_(kept, kept)] - information[np.ix_(kept, gone)] @ share
    return gradient[kept] - share.T @ pull, 0.5 * (left + left.T), share


def spread_over(told: TrialData, at: Sequence[int], n: int) -> TrialData:
    """The same among n parameters, at these places."""
    information, score = np.zeros((n, n)), np.zeros(n)
    information[np.ix_(at, at)], score[list(at)] = told.information, told.score
    return TrialData(information, score, told.clipped)


def scattered(told: TrialData, between: Array) -> TrialData:
    """What a trial says of the vehicle, whose parameters scatter with variances between (n,)."""
    at = np.flatnonzero(between > 0.0)
    if not at.size:
        return told
    (score,), (information,) = _all_scattered(
        told.score[None], told.information[None], at, between[at]
    )
    return replace(told, information=0.5 * (information + information.T), score=score)


def _all_scattered(
    scores: Array, informations: Array, at: npt.NDArray[np.int64], variances: Array
) -> tuple[Array, Array]:
    """Scores (k, n) and informations (k, n, n) of trials that scatter in parameters ``at``."""
    across = informations[:, at]
    gain = np.linalg.solve(across[:, :, at] + np.diag(1.0 / variances), across)
    told = informations - np.swapaxes(across, 1, 2) @ gain
    return scores - np.einsum("tki,tk->ti", gain, scores[:, at]), told


@dataclass(frozen=True)
class Pooled:
    """Mean (n,) and covariance (n, n) of all trials and the prior."""

    mean: Array
    covariance: Array


def pooled(
    trials: Sequence[TrialData],
    prior_mean: Array,
    prior_variance: Array,
    between: Array | None = None,
) -> Pooled:
    """All trials and the prior once."""
    if between is not None:
        trials = [scattered(t, between) for t in trials]
    information = np.diag(1.0 / prior_variance) + sum(t.information for t in trials)
    score = prior_mean / prior_variance + sum(t.score for t in trials)
    return Pooled(*solved(information, score))


def solved(information: Array, score: Array) -> tuple[Array, Array]:
    """Mean (n,) and covariance (n, n) of an information and its score.

    Scaled to a unit diagonal, and the mean not by the inverse: data that know some combinations ten
    thousand times as well as their priors leave no digit of that product.
    """
    scale = 1.0 / np.sqrt(np.diag(information))
    scaled, across = information * np.outer(scale, scale), np.outer(scale, scale)
    covariance = np.linalg.inv(scaled) * across
    return scale * np.linalg.solve(scaled, scale * score), 0.5 * (covariance + covariance.T)


def without_prior(trials: Sequence[TrialData], between: Array | None = None) -> Pooled:
    """All trials, with a prior so wide that it counts nowhere beside data."""
    n = len(trials[0].score)
    return pooled(trials, np.zeros(n), np.full(n, WIDE), between)


@dataclass(frozen=True)
class Agreement:
    """Cochran's Q: scatter of the trials over what their own errors allow, with its probability."""

    q: float
    freedom: float
    p: float


def _agreement(q: float, freedom: float) -> Agreement:
    from scipy.special import chdtrc  # a fifteenth of an identification, which has no use for it

    p = float(chdtrc(freedom, q)) if freedom > LEAST_TOLD else 1.0
    return Agreement(float(q), float(freedom), p)


def agreement(trials: Sequence[TrialData], between: Array | None = None) -> Agreement:
    """Of all parameters together, along what each trial sees."""
    if between is not None:
        trials = [scattered(t, between) for t in trials]
    whole = without_prior(trials)
    q = freedom = 0.0
    for t in trials:
        axes = seen_axes(t.information)
        q += float(np.sum((axes.T @ (t.score - t.information @ whole.mean)) ** 2))
        along = t.information @ axes
        freedom += axes.shape[1] - float(np.sum(along * (whole.covariance @ along)))
    return _agreement(q, freedom)


def agreements(trials: Sequence[TrialData]) -> list[Agreement]:
    """Of each parameter, the others at their pooled values."""
    scores, variances, _ = _residuals(trials)
    with np.errstate(divide="ignore", invalid="ignore"):
        z = np.where(variances[0] > 0.0, scores**2 / variances[0], 0.0)
        freedom = np.where(variances[0] > 0.0, variances[1] / variances[0], 0.0)
    return [_agreement(q, f) for q, f in zip(z.sum(axis=0), freedom.sum(axis=0), strict=True)]


def seen_axes(information: Array) -> Array:
    """Axes (n, k) along which data see something: axes' J axes = 1."""
    values, vectors = np.linalg.eigh(information)
    return vectors[:, values > SEEN] / np.sqrt(values[values > SEEN])


def _residuals(trials: Sequence[TrialData]) -> tuple[Array, tuple[Array, Array], Array]:
    """Scores (trials, n) at the pooled values; their variances without pooling, and with it."""
    whole = without_prior(trials)
    scores = np.array([t.score - t.information @ whole.mean for t in trials])
    own = np.array([np.diag(t.information) for t in trials])
    taken = [np.diag(t.information @ whole.covariance @ t.information) for t in trials]
    own = np.where(own > SEEN, own, 0.0)
    left = np.where(own > 0.0, np.maximum(own - np.array(taken), 0.0), 0.0)
    return scores, (own, left), np.array([t.information for t in trials])


def between_trials(trials: Sequence[TrialData], start: Array | None = None) -> Array:
    """Variance (n,) of each parameter between trials; zero where they agree (`AGREE`).

    Every squared residual score is, on average, its own variance and, of every parameter that
    scatters, the square of the information about both: non-negative least squares. From there, or
    from a start that is given (what has none there has none), the likelihood is climbed
    (`_likely`). Where that leaves too much, all parameters scatter alike on top (`_alike`).
    """
    n = len(trials[0].score)
    if len(trials) < 2 or not _disagree(trials):
        return np.zeros(n)
    rounds = LIKELY_ROUNDS_AGAIN
    if start is None:
        rounds = LIKELY_ROUNDS
        scores, (own, left), informations = _residuals(trials)
        start = np.maximum(_moments(scores, own, left, informations), LEAST_SCATTER)
    return _with_alike(trials, _likely(trials, start, rounds))


def _likely(trials: Sequence[TrialData], start: Array, rounds: int) -> Array:
    """Variances (n,) of largest restricted likelihood, from a start on; what is not seen has none.

    Every step raises the likelihood, and what is not there goes to zero (MM steps of Zhou, Hu,
    Zhou and Lange 2019). Moments swap the scatter of parameters that every trial sees together: of
    six trials that see four of them sharply the squared errors were 6 times as large as claimed.
    """
    informations = np.array([t.information for t in trials])
    scores = np.array([t.score for t in trials])
    most = np.einsum("tii->ti", informations).max(axis=0)
    at = np.flatnonzero((most > SEEN) & (start > 0.0))
    found, ratio = start[at], np.ones(len(at))
    for _ in range(rounds if at.size else 0):
        left, own = _about_mean(*_all_scattered(scores, informations, at, found))
        ratio = (left[:, at] ** 2).sum(axis=0) / np.maximum(own[:, at].sum(axis=0), NOTHING)
        found = np.maximum(found * np.sqrt(ratio), np.finfo(float).tiny)
        gone = found * most[at] < UNFELT
        if np.all(gone | (np.abs(ratio - 1.0) < STEADY)):
            break
    likely = np.zeros(len(start))
    likely[at] = np.where((ratio > STAYS) & (found * most[at] >= UNFELT), found, 0.0)
    return likely


def _about_mean(scores: Array, informations: Array) -> tuple[Array, Array]:
    """Scores (k, n) at the mean of all, and their variances."""
    n = informations.shape[1]
    whole = informations.sum(axis=0) + np.eye(n) / WIDE
    mean, covariance = solved(whole, scores.sum(axis=0))
    left = scores - informations @ mean
    known = ((informations @ covariance) * informations).sum(axis=2)
    return left, np.maximum(np.einsum("tii->ti", informations) - known, 0.0)


def _with_alike(trials: Sequence[TrialData], between: Array) -> Array:
    """Variances with as much of all parameters alike as neighbours ask for beyond them."""
    rest = [scattered(t, between) for t in trials]
    return between + _alike(_differences(rest))


def _alike(pairs: Sequence[tuple[Array, Array]]) -> float:
    """Variance of all parameters alike, from differences of trials; zero where chance makes them.

    Each direction that a pair sees is told by its precision, the best ones by what scatters alone:
    a weighted mean in which all count the same. The median pair decides, as a step is in one.
    """
    found = []
    for information, score in pairs:
        axes = seen_axes(information)
        squares = (axes.T @ score) ** 2
        gains = 2.0 * ((information @ axes) ** 2).sum(axis=0)
        if not squares.size or chi_square_above(len(squares), squares.sum()) > BEYOND_CHANCE:
            found.append(0.0)
            continue
        variance = 0.0
        for _ in range(ALIKE_ROUNDS):
            weight = gains / (1.0 + variance * gains) ** 2
            variance = max(0.0, float(weight @ (squares - 1.0) / (weight @ gains)))
        found.append(variance)
    return float(np.median(found)) if found else 0.0


def for_few(between: Array, count: int) -> Array:
    """Variance between so many trials (or maneuvers) to count with where they alone tell it.

    The error of a mean over its estimated standard deviation has Student's t distribution, whose
    variance is nu / (nu - 2) with nu = count - 1. The same factor makes the mean of the inverse,
    which is the information that several estimates add up, that of the true variance.
    """
    freedom = max(count - 1, LEAST_FREEDOM)
    return between * freedom / (freedom - 2)


def freedom_of_neighbours(count: int) -> float:
    """Degrees of freedom that `between_neighbours` knows a variance to.

    Half of those of the deviations from a mean: neighbours share a trial, and large differences
    are clipped. Of 600 drawn series of 5, 8, 10 and 20 trials 2.7, 4.0, 4.7 and 9.8.
    """
    return 0.5 * (count - 1)


def _disagree(trials: Sequence[TrialData]) -> bool:
    each = [a.p for a in agreements(trials) if a.freedom > 0.0]
    return agreement(trials).p < AGREE or min(each, default=1.0) < AGREE / max(len(each), 1)


def between_neighbours(trials: Sequence[TrialData]) -> Array:
    """Variance (n,) between trials from the differences of each and the next.

    A step is in one of them, and a drift in none by much: this is the scatter that a change has to
    stand out from. Large differences are clipped.
    """
    pairs = _differences(trials)
    if not pairs:
        return np.zeros(len(trials[0].score))
    informations = np.array([k for k, _ in pairs])
    own = np.array([np.diag(k) for k in informations])
    own = np.where(own > SEEN, own, 0.0)
    scores = np.array([q for _, q in pairs])
    return _with_alike(trials, 0.5 * _moments(scores, own, own, informations, clipped=True))


def _differences(trials: Sequence[TrialData]) -> list[tuple[Array, Array]]:
    """Of each trial from the next: information, and score.

    Scores are taken at the mean of all, where they are small: those at the prior's mean lose the
    difference in their rounding.
    """
    mean = without_prior(trials).mean
    near = [replace(t, score=t.score - t.information @ mean) for t in trials]
    return [_difference(a, b) for a, b in pairwise(near)]


def _difference(a: TrialData, b: TrialData) -> tuple[Array, Array]:
    """Information (J_a^-1 + J_b^-1)^-1 about the difference of two trials, and its score."""
    both = a.information + b.information
    scale = 1.0 / np.sqrt(np.diag(both) + WEAK)
    inverse = np.linalg.inv(both * np.outer(scale, scale) + ROUNDING * np.eye(len(scale)))
    inverse *= np.outer(scale, scale)
    information = a.information @ inverse @ b.information
    score = b.information @ inverse @ a.score - a.information @ inverse @ b.score
    return 0.5 * (information + information.T), score


def _moments(
    scores: Array,
    own: Array,
    left: Array,
    informations: Array,
    clipped: bool = False,
) -> Array:
    """Variances (n,) that explain the squares of scores (k, n) best, none of them negative."""
    from scipy.optimize import nnls  # a quarter of a second to import

    used = own > 0.0
    if not used.any():
        return np.zeros(scores.shape[1])
    share = left[used] / own[used]
    squares = scores[used] ** 2 / own[used]
    slopes = (informations**2 / np.where(own > 0.0, own, 1.0)[:, :, None])[used] * share[:, None]
    unit = np.maximum(slopes.sum(axis=0), np.finfo(float).tiny)
    found = np.zeros(scores.shape[1])
    for _ in range(ROUNDS * (3 if clipped else 1)):
        expected = np.maximum(share + slopes @ found, np.finfo(float).eps)
        seen = squares
        if clipped:
            seen = np.minimum(squares, CLIPPED**2 * expected) / OF_CLIPPED
        fitted, _ = nnls(slopes / unit / expected[:, None], (seen - share) / expected)
        found = fitted / unit
    return np.asarray(found)


@dataclass(frozen=True)
class Distance:
    """Of a trial from all others together: chi-square in so many directions, and without the few
    parameters that differ most (``rest``)."""

    square: float
    directions: int
    p: float
    rest: float
    parameters: tuple[int, ...]


def distance(
    trial: TrialData, others: Sequence[TrialData], between: Array, most: int = 2
) -> Distance:
    """How far a trial is from what the others and the prior N(0, 1) predict, along what it sees."""
    n = len(trial.score)
    whole = pooled(others, np.zeros(n), np.ones(n), between)
    axes = seen_axes(trial.information)
    left = axes.T @ (trial.score - trial.information @ whole.mean)
    along = axes.T @ trial.information
    spread = np.diag(between) + whole.covariance
    values, vectors = np.linalg.eigh(along @ spread @ along.T)
    inverse = (vectors / (1.0 + np.maximum(values, 0.0))) @ vectors.T
    square = float(left @ inverse @ left)
    chosen, rest = _explained(left, along, inverse, most)
    k = axes.shape[1]
    return Distance(square, k, chi_square_above(k, square) if k else 1.0, rest, chosen)


def _explained(
    left: Array, along: Array, inverse: Array, most: int
) -> tuple[tuple[int, ...], float]:
    """The parameters, up to so many, that explain most of a difference; what is left of it."""
    chosen: list[int] = []
    rest = float(left @ inverse @ left)
    for _ in range(min(most, along.shape[0])):
        best = {i: _left_with(left, along[:, [*chosen, i]], inverse) for i in range(along.shape[1])}
        i = min(best, key=lambda k: best[k])
        chosen, rest = [*chosen, i], best[i]
    return tuple(chosen), rest


def _left_with(left: Array, columns: Array, inverse: Array) -> float:
    gain, _, _, _ = np.linalg.lstsq(columns.T @ inverse @ columns, columns.T @ inverse @ left, None)
    away = left - columns @ gain
    return float(away @ inverse @ away)


def shrunk(trial: TrialData, others: Pooled, between: Array) -> Pooled:
    """A trial's own parameters: its data, and all others as far as trials agree."""
    prior = np.linalg.inv(others.covariance + np.diag(between))
    return Pooled(*solved(prior + trial.information, prior @ others.mean + trial.score))
