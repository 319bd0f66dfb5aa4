"""Two logs of one motion fitted to each other in windows, with an honest covariance.

Uninterrupted stretches of the trials are cut into windows of about equal length. The difference
of the logs has a constant of its own in each, so that slow errors (random walk of an integral,
drift of a compass or of an acoustic position) do not pile up. The covariance is that of the
jackknife over clusters of windows (Cameron and Miller 2015, J. Human Resources 50, VI.B), so
coloured errors are counted; it is never below that of white ones, because few clusters may agree
by chance.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import MEDIAN_OF_ABS_TO_STD
from auvident.schema.channels import TIME_COLUMN, sampled_flag
from auvident.schema.trial import Trial

Array = npt.NDArray[Any]

CLUSTER_S = 60.0  # errors of neighbouring windows may be alike; those of clusters are not
LEAST_SAMPLES = 10  # of the reference in a window
LEAST_CLUSTERS = 5  # fewer say nothing about the scatter
LONGEST_GAP_S = 1.0  # without a sample of a sensor that is integrated: the stretch ends
GAP_PERIODS = 2.5  # ... or so many periods of a slow sensor
MARGIN_S = 2.5  # rows at the ends of a stretch that a delay may reach beyond
OUTLIER_STDS = 5.0
WEAK = 30.0  # information of so many priors' width keeps what is not excited finite
ITERATIONS = 3
ANGLES = ("roll_rad", "pitch_rad", "heading_rad")

Predict = Callable[["Stretch", Array], Array]


@dataclass(frozen=True)
class Stretch:
    """Uninterrupted rows of a trial.

    Attributes
    ----------
    dt_s : float
    signals : dict of str to (n,) array
        Columns of the trial, zero where they are not logged.
    rows : (m,) array of int
        Rows with a sample of the reference.
    window, cluster : (m,) array of int
        Numbers of the window and of the cluster of each of `rows`.
    """

    dt_s: float
    signals: dict[str, Array]
    rows: Array
    window: Array
    cluster: Array

    @cached_property
    def cosines(self) -> dict[str, tuple[Array, Array]]:
        """Cosine and sine (n,) of the angles, for which a fit asks at each of its parameters."""
        there = (name for name in ANGLES if name in self.signals)
        return {name: (np.cos(self.signals[name]), np.sin(self.signals[name])) for name in there}


def stretches_of(
    trials: Sequence[Trial],
    reference: tuple[str, ...],
    needed: tuple[str, ...],
    optional: tuple[str, ...],
    window_s: float,
) -> list[Stretch]:
    """Pieces of the trials in which everything is known, cut into windows.

    Parameters
    ----------
    trials : sequence of Trial
        Those without a needed column are passed over.
    reference : tuple of str
        Columns of one sensor, whose samples are compared with what the others integrate to.
    needed, optional : tuple of str
        The other columns; a stretch ends where one is unknown or its sensor silent.
    window_s : float
        At least `LEAST_SAMPLES` of the reference's periods are taken.
    """
    found: list[Stretch] = []
    first = 0
    for trial in trials:
        if not {*reference, *needed} <= set(trial.columns):
            continue
        carried = [c for c in (*needed, *optional) if c in trial.columns]
        for piece in _pieces(trial, carried):
            stretch = _stretch(trial, piece, (*needed, *optional), reference, window_s, first)
            if stretch is not None:
                first = int(stretch.window.max()) + 1
                found.append(stretch)
    return found


def _pieces(trial: Trial, carried: list[str]) -> list[Array]:
    """Rows of each piece in which the columns that are integrated are known throughout."""
    good = trial.where_known(carried)
    for flag in {sampled_flag(c) for c in carried}:
        good &= ~_silent(trial.columns[flag], trial.rate_hz)
    time = trial.columns[TIME_COLUMN]
    jump = np.concatenate([[False], np.diff(time) > 1.5 / trial.rate_hz])
    number = np.cumsum(jump | ~good)
    return [np.flatnonzero(good & (number == k)) for k in np.unique(number[good])]


def _silent(sampled: Array, rate_hz: float) -> Array:
    """Rows (n,) between samples of a sensor that are too far from each other."""
    at = np.flatnonzero(sampled)
    if len(at) < 2:
        return np.ones(len(sampled), dtype=bool)
    limit = max(LONGEST_GAP_S * rate_hz, GAP_PERIODS * float(np.median(np.diff(at))))
    right = np.searchsorted(at, np.arange(len(sampled)))
    after = at[np.minimum(right, len(at) - 1)]
    before = np.where(after == np.arange(len(sampled)), after, at[np.maximum(right - 1, 0)])
    return np.asarray(after - before > limit)


def _stretch(
    trial: Trial,
    piece: Array,
    carried: tuple[str, ...],
    reference: tuple[str, ...],
    window_s: float,
    first: int,
) -> Stretch | None:
    """One piece with its samples of the reference, its windows numbered from `first` on."""
    columns, margin = trial.columns, round(MARGIN_S * trial.rate_hz)
    seen = trial.where_known(reference)[piece] & columns[sampled_flag(reference[0])][piece]
    seen[:margin], seen[len(seen) - margin :] = False, False
    rows = np.flatnonzero(seen)
    if len(rows) < LEAST_SAMPLES:
        return None
    length = max(window_s * trial.rate_hz, LEAST_SAMPLES * float(np.median(np.diff(rows))))
    if rows[-1] - rows[0] < 0.5 * length:
        return None
    count = max(round((rows[-1] - rows[0]) / length), 1)
    number = (rows - rows[0]) * count // (rows[-1] - rows[0] + 1)
    zero = np.zeros(len(piece))
    signals = {c: columns[c][piece] if c in columns else zero for c in (*reference, *carried)}
    together = max(round(CLUSTER_S / window_s), 1)
    cluster = first + number // together * together
    return Stretch(1.0 / trial.rate_hz, signals, rows, first + number, cluster)


def fit_windows(
    stretches: Sequence[Stretch], predict: Predict, prior: Array, reach: Array | float = math.inf
) -> tuple[Array, Array, int, float] | None:
    """Parameters (k,), covariance (k, k), number of samples and rms of the residual.

    Gauss-Newton from zero; samples beyond `OUTLIER_STDS` are left out once it has settled. None
    with fewer than `LEAST_CLUSTERS`. What the logs do not tell within its reach, to first order
    from zero, is not known better for what the slopes are elsewhere: logs with hardly a turn fitted
    any delay of a DVL from -4 to 6 s alike, and the slopes at 6 s claimed 0.1 s.

    Parameters
    ----------
    stretches : sequence of Stretch
    predict : callable
        (stretch, parameters) -> difference of the two logs (n, channels), up to a constant.
    prior : (k,) array
        Usual size of each parameter.
    reach : (k,) array, optional
        Up to which the prediction holds, to both sides.
    """
    if len({int(c) for s in stretches for c in s.cluster}) < LEAST_CLUSTERS:
        return None
    window = np.concatenate([s.window for s in stretches])
    cluster = np.concatenate([s.cluster for s in stretches])

    def residual(at: Array) -> Array:
        return np.concatenate([predict(s, at)[s.rows] for s in stretches])

    keep, x = np.ones(len(window), dtype=bool), np.zeros(len(prior))
    normal = _normal(residual, x, prior, keep, window, cluster)
    told = normal.white() <= np.square(reach)
    x = np.clip(x + normal.step(), -reach, reach)
    for _ in range(ITERATIONS - 1):
        x = np.clip(x + _normal(residual, x, prior, keep, window, cluster).step(), -reach, reach)
    keep = _inliers(residual(x), window)
    for _ in range(ITERATIONS):
        normal = _normal(residual, x, prior, keep, window, cluster)
        x = np.clip(x + normal.step(), -reach, reach)
    unknown = np.diag(np.where(told, 0.0, reach) ** 2)
    return x, normal.covariance() + unknown, int(keep.sum()), normal.rms


@dataclass(frozen=True)
class _Normal:
    """Normal equations: gram (k, p, p) and right side (k, p) of each cluster, and the prior's."""

    gram: Array
    right: Array
    weak: Array
    pull: Array
    rms: float

    def step(self, without: int | None = None) -> Array:
        """Change of the parameters, possibly without a cluster."""
        keep = np.arange(len(self.gram)) != without
        information = self.gram[keep].sum(axis=0) + np.diag(self.weak)
        return np.linalg.solve(information, self.right[keep].sum(axis=0) + self.pull)

    def covariance(self) -> Array:
        """Scatter when clusters are left out in turn, not below that of white noise."""
        count = len(self.gram)
        left = np.array([self.step(without=k) for k in range(count)])
        left = left - left.mean(axis=0)
        found = (count - 1.0) / count * left.T @ left
        return found + np.diag(np.maximum(self.white() - np.diag(found), 0.0))

    def white(self) -> Array:
        """Variances (p,) if all samples err independently."""
        return np.diag(np.linalg.inv(self.gram.sum(axis=0) + np.diag(self.weak)))


def _normal(
    residual: Callable[[Array], Array],
    x: Array,
    prior: Array,
    keep: Array,
    window: Array,
    cluster: Array,
) -> _Normal:
    """Normal equations at x, in units of the residual's own variance."""
    z = _within(residual(x)[keep], window[keep])
    slopes = [_within(_slope(residual, x, i, p)[keep], window[keep]) for i, p in enumerate(prior)]
    jacobian = np.stack(slopes, axis=2)
    variance = float(np.mean(z**2))
    gram = [jacobian[cluster[keep] == k] for k in np.unique(cluster[keep])]
    error = [z[cluster[keep] == k] for k in np.unique(cluster[keep])]
    weak = (WEAK * prior) ** -2.0
    return _Normal(
        gram=np.array([np.einsum("nci,ncj->ij", j, j) for j in gram]) / variance,
        right=-np.array([np.einsum("nci,nc->i", j, e) for j, e in zip(gram, error, strict=True)])
        / variance,
        weak=weak,
        pull=-weak * x,
        rms=math.sqrt(variance),
    )


def _slope(residual: Callable[[Array], Array], x: Array, i: int, prior: float) -> Array:
    """Derivative of the residual with respect to one parameter, central difference."""
    step = np.zeros(len(x))
    step[i] = 0.1 * prior
    return (residual(x + step) - residual(x - step)) / (0.2 * prior)


def _within(values: Array, window: Array) -> Array:
    """Values (n, c) minus the mean of their window."""
    number = np.unique(window, return_inverse=True)[1]
    count = np.bincount(number)[:, None]
    total = np.column_stack([np.bincount(number, column) for column in values.T])
    return np.asarray(values - (total / count)[number])


def _inliers(values: Array, window: Array) -> Array:
    """Samples (n,) whose distance from their window's mean is not out of the ordinary."""
    z = _within(values, window)
    spread = MEDIAN_OF_ABS_TO_STD * np.median(np.abs(z))
    return np.asarray((np.abs(z) <= OUTLIER_STDS * spread).all(axis=1))
