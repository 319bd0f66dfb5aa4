"""Relations between channels that hold whatever the vehicle, fitted block by block.

A relation ``y(t) = X(t; lag) theta`` is fitted at every lag of a scan. Blocks of the trial are
left out in turn (jackknife), so that the uncertainty of lag and theta counts what white-noise
formulas miss: turbulence, waves, and that samples of one turn are not independent.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from auvident.constants import VehicleTime
from auvident.schema.channels import RECORD_COLUMN
from auvident.schema.trial import Trial

# moving average, twice: shorter than any turn, longer than sensor noise
SMOOTHING_S: VehicleTime = 1.0
SLOW_SHARE = 0.3  # of the 90 % quantile of the speed: below it a rudder has no grip
# about a zigzag leg, longer than the memory of residuals; short trials ...
BLOCK_S: tuple[VehicleTime, VehicleTime] = (5.0, 20.0)
BLOCKS = 8  # ... are cut into so many, but not shorter than turbulence lasts
LAG_STEP_S = 0.1  # of the scan; a parabola through the best three refines it
MIN_RECORD_S = 10.0  # shorter records leave nothing after smoothing and shifting
MIN_BLOCKS = 4  # fewer give no uncertainty
RIDGE = 1e-9  # relative; keeps a regressor that is nowhere excited from dividing by zero

Signals = dict[str, np.ndarray]


@dataclass(frozen=True)
class Relation:
    """Fit of a relation at its best lag.

    Attributes
    ----------
    lag_s, lag_std_s : float
        Best lag and its jackknife standard deviation.
    theta, theta_std : numpy.ndarray
        Coefficients there, shape (p,).
    explained : float
        Share of the variance of y that the relation explains (0 to 1); 0 of a y that stays zero.
    alone : numpy.ndarray
        Share of the variance that is lost without each regressor, shape (p,).
    at_edge : bool
        The best lag is the first or last of the scan: it is not determined.
    left_out : numpy.ndarray
        Coefficients without each block in turn, shape (blocks, p).
    """

    lag_s: float
    lag_std_s: float
    theta: np.ndarray
    theta_std: np.ndarray
    explained: float
    alone: np.ndarray
    at_edge: bool
    left_out: np.ndarray = field(default_factory=lambda: np.empty((0, 0)))

    def derived(self, of: Callable[[np.ndarray], np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """A function of the coefficients (..., p), and its jackknife standard deviation."""
        return of(self.theta), _jackknife_std(of(self.left_out))


def smooth_records(trial: Trial, columns: dict[str, str], margin_s: float) -> list[Signals]:
    """Smoothed signals of each long enough record in which all columns are known.

    Parameters
    ----------
    trial : Trial
        An ingested trial.
    columns : dict of str to str
        Column of the table by name of the signal.
    margin_s : float
        Kept free at both ends for shifting.

    Returns
    -------
    list of dict
        Signals and their derivatives (``<name>_dot``), and ``time``; shape (n,) each.
    """
    record = trial.table[RECORD_COLUMN].to_numpy()
    table = {name: trial.table[column].to_numpy() for name, column in columns.items()}
    known = (record >= 0) & np.logical_and.reduce([np.isfinite(x) for x in table.values()])
    width = max(1, round(SMOOTHING_S * trial.rate_hz))
    least = round((MIN_RECORD_S + 2 * margin_s) * trial.rate_hz) + 2 * width
    edges = np.flatnonzero(np.diff(np.where(known, record, -1))) + 1
    time = trial.table["time_s"].to_numpy()
    return [
        _smooth({n: x[rows] for n, x in table.items()}, time[rows], width)
        for rows in np.split(np.arange(known.size), edges)
        if rows.size >= least and known[rows[0]]
    ]


def _smooth(raw: Signals, time: np.ndarray, width: int) -> Signals:
    window = np.convolve(np.ones(width) / width, np.ones(width) / width)
    inside = slice(width - 1, time.size - width + 1)
    smooth: Signals = {"time": time[inside]}
    for name, values in raw.items():
        smooth[name] = np.convolve(values, window, mode="valid")
        smooth[name + "_dot"] = np.gradient(smooth[name], time[inside])
    return smooth


def shifted(signals: Signals, name: str, lag_s: float) -> np.ndarray:
    """A signal as it was `lag_s` ago."""
    return np.interp(signals["time"] - lag_s, signals["time"], signals[name])


def heading_rate(
    q: np.ndarray | float, r: np.ndarray, roll: np.ndarray | float, pitch: np.ndarray | float
) -> np.ndarray:
    """d(heading)/dt = (q sin(roll) + r cos(roll)) / cos(pitch), rad/s, of rates and angles."""
    return np.asarray((q * np.sin(roll) + r * np.cos(roll)) / np.cos(pitch))


def kept_on_the_grid(
    records: list[Signals], rate: str, use: Callable[[Signals], np.ndarray]
) -> float:
    """What differences over steps of the grid keep of a rate: 1 of a fine one, 0.4 of a coarse one.

    Parameters
    ----------
    records : list of dict
        From `smooth_records`.
    rate : str
        Signal that is summed up, then differentiated as an angle of `records` is.
    use : callable
        As of `fit_relation`.
    """

    def relation(s: Signals, lag: float) -> tuple[np.ndarray, np.ndarray]:
        own, time = s[rate], s["time"]
        steps = 0.5 * (own[1:] + own[:-1]) * np.diff(time)
        turned = np.concatenate(([0.0], np.cumsum(steps)))
        return np.gradient(turned, time), np.column_stack((own, np.ones_like(own)))

    found = fit_relation(records, relation, (0.0, 0.0), use)
    return float(found.theta[0]) if found is not None else 1.0


def fit_relation(
    records: list[Signals],
    relation: Callable[[Signals, float], tuple[np.ndarray, np.ndarray]],
    lags_s: tuple[float, float],
    use: Callable[[Signals], np.ndarray],
) -> Relation | None:
    """Fit a relation over a scan of lags.

    Parameters
    ----------
    records : list of dict
        From `smooth_records`.
    relation : callable
        (signals, lag) -> y of shape (n,) and X of shape (n, p).
    lags_s : (float, float)
        First and last lag of the scan; equal for a single one.
    use : callable
        signals -> rows that count, bool of shape (n,).

    Returns
    -------
    Relation or None
        None when fewer than `MIN_BLOCKS` blocks are left.
    """
    lags = np.arange(lags_s[0], lags_s[1] + LAG_STEP_S / 2, LAG_STEP_S)
    margin = max(abs(lags_s[0]), abs(lags_s[1]))
    whole = sum(float(s["time"][-1] - s["time"][0]) - 2 * margin for s in records)
    block = float(np.clip(whole / BLOCKS, *BLOCK_S))
    cut = [_cut(signals, margin, block, use) for signals in records]
    grams = np.stack([_grams(records, relation, lag, cut) for lag in lags])
    if grams.shape[1] < MIN_BLOCKS:
        return None
    total = grams.sum(axis=1)
    left_out = total[:, None] - grams
    lag, at_edge = _best_lag(lags, _sse(total))
    others = np.array([_best_lag(lags, sse)[0] for sse in _sse(left_out).T])
    best = int(np.argmin(_sse(total)))
    spread = _solve(left_out[best])
    variance = max(float(total[best, -1, -1]), np.finfo(float).tiny)
    return Relation(
        lag,
        float(_jackknife_std(others)),
        _solve(total[best]),
        _jackknife_std(spread),
        1.0 - float(_sse(total[best])) / variance if total[best, -1, -1] > 0.0 else 0.0,
        _alone(total[best]),
        at_edge,
        spread,
    )


@dataclass(frozen=True)
class _Blocks:
    """Rows of each block of a record, filled up to one length, and which of them count."""

    rows: np.ndarray
    counts: np.ndarray


def _cut(
    signals: Signals, margin: float, block_s: float, use: Callable[[Signals], np.ndarray]
) -> _Blocks:
    """Blocks of a record in which any row counts."""
    time = signals["time"]
    counts = use(signals) & (time >= time[0] + margin) & (time <= time[-1] - margin)
    block = ((time - time[0] - margin) // block_s).astype(int)
    starts = np.concatenate(([0], np.flatnonzero(np.diff(block)) + 1))
    lengths = np.diff(starts, append=time.size)
    used = np.logical_or.reduceat(counts, starts)
    within = np.arange(lengths.max())
    rows = np.minimum(starts[used, None] + within, time.size - 1)
    return _Blocks(rows, counts[rows] & (within < lengths[used, None]))


def _grams(
    records: list[Signals],
    relation: Callable[[Signals, float], tuple[np.ndarray, np.ndarray]],
    lag: float,
    cut: list[_Blocks],
) -> np.ndarray:
    """Gram matrix of (X, y) of each block, shape (blocks, p + 1, p + 1)."""
    found = []
    for signals, blocks in zip(records, cut, strict=True):
        y, x = relation(signals, lag)
        both = np.column_stack((x, y))[blocks.rows]
        both *= blocks.counts[..., None]
        found.append(np.swapaxes(both, 1, 2) @ both)
    return np.concatenate(found) if found else np.empty((0, 2, 2))


def _solve(gram: np.ndarray) -> np.ndarray:
    """Coefficients of each Gram matrix of a stack, shape (..., p)."""
    a, b = gram[..., :-1, :-1], gram[..., :-1, -1]
    scale = np.sqrt(np.maximum(np.diagonal(a, axis1=-2, axis2=-1), np.finfo(float).tiny))
    unit = a / (scale[..., None] * scale[..., None, :]) + RIDGE * np.eye(scale.shape[-1])
    return np.linalg.solve(unit, (b / scale)[..., None])[..., 0] / scale


def _sse(gram: np.ndarray) -> np.ndarray:
    """Residual sum of squares of each Gram matrix of a stack, shape (...)."""
    explained = gram[..., None, :-1, -1] @ _solve(gram)[..., None]
    return np.maximum(gram[..., -1, -1] - explained[..., 0, 0], 0.0)


def _alone(gram: np.ndarray) -> np.ndarray:
    """Share of the variance lost without each regressor."""
    count = gram.shape[0] - 1
    without = [np.delete(np.delete(gram, k, axis=0), k, axis=1) for k in range(count)]
    sse = np.array([_sse(g) if count > 1 else g[-1, -1] for g in without])
    return (sse - _sse(gram)) / max(float(gram[-1, -1]), np.finfo(float).tiny)


def _best_lag(lags: np.ndarray, sse: np.ndarray) -> tuple[float, bool]:
    best = int(np.argmin(sse))
    if best in (0, lags.size - 1):
        return float(lags[best]), lags.size > 1
    left, middle, right = sse[best - 1 : best + 2]
    curvature = left - 2 * middle + right
    step = 0.5 * (left - right) / curvature if curvature > 0 else 0.0
    return float(lags[best] + step * LAG_STEP_S), False


def _jackknife_std(left_out: np.ndarray) -> np.ndarray:
    count = left_out.shape[0]
    spread = ((left_out - left_out.mean(axis=0)) ** 2).sum(axis=0)
    return np.sqrt((count - 1) / count * spread)
