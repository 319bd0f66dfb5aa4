"""Lag of one sensor behind others as a straight line in time, from a relation between them.

A relation ``y(t) = X(t) theta`` holds when its signals are on one clock. The signals of the sensor
whose clock is in doubt are read at ``t + lag(t)``, ``lag(t) = a + c tau``, tau from -1 at the start
of the trial to 1 at its end: the lag that explains most of y is that of the clock. A lag above 0
says that the stamps of the sensor are late.

The trial is cut into blocks. The normal equations of each block are made once at every lag of a
scan; a line picks one lag per block, so that any line costs but a sum and a small system of
equations. Blocks left out in turn (jackknife) tell how far the line is determined.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np

Signals = dict[str, np.ndarray]
Equations = Callable[[Signals], tuple[np.ndarray, np.ndarray]]

WIDEST_S = 32.0  # of the wide scan, either way: GPS and UTC are 18 s apart
WIDE_STEP = 0.5  # of the smoothing, so that no minimum is stepped over
FINE_STEP = 0.2  # of the smoothing as well
FINE_STEPS = 6  # on either side of the line of the wide scan: two of its steps
STEEPEST = 2.5e-3  # drift of a clock that is scanned: 2500 ppm; quartz has below 100 ...
MOST_GAIN_S = 8.0  # ... which is this in a day, from the middle to the end
WIDE_BLOCKS = 12
FINE_BLOCK_S = 20.0  # about a zigzag leg; errors in one are not independent ...
FINE_BLOCKS = (8, 48)  # ... fewer tell no spread, more tell it no better
CLEARLY = 0.95  # of what a constant lag leaves unexplained: less speaks for a drift
ELSEWHERE_STEPS = 6  # of the wide scan: three smoothings, beyond the valley of the best lag
SAME_STEPS = 3  # of the wide scan: so close are the same lag
ROWS_OF_BLOCK = 1000  # of longer ones a piece will do
LEAST_OF_BLOCK = 5  # rows of a block on average
LEAST_ROWS = 0.5  # of the most rows at any lag: with fewer a fit is good by chance
RIDGE = 1e-9  # relative; keeps a regressor that is nowhere excited from dividing by zero
STEPS = 6  # of Newton, from the best line of the fine scan
PRIOR_SMOOTHINGS = 7.0  # so much of the record weighs as much as the prior, in its smoothing
TINY = 1e-200  # no power of a signal is smaller
NINE = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)], dtype=float)


@dataclass(frozen=True)
class Line:
    """Lag of a sensor along a trial.

    Attributes
    ----------
    lag_s, lag_std_s : float
        Constant lag that explains most, with its jackknife standard deviation.
    middle_s, middle_std_s : float
        Lag at the middle of the trial when it may change.
    gain_s, gain_std_s : float
        What it gains from there to the end, and loses to the start.
    at_s, half_s : float
        Middle of the trial and half its length.
    explained : float
        Share of the variance of y that is explained without drift (0 to 1).
    explained_drifting : float
        The same with it.
    right : float
        What a clock without lag leaves unexplained, over what the constant lag does.
    rival : float
        What the best lag elsewhere leaves unexplained, over what this one does (1 and more).
    alone : bool
        No block decides: the wide scan comes to the same lag without any one of them.
    at_edge : bool
        The best lag is at the end of the wide scan: it may be larger.
    """

    lag_s: float
    lag_std_s: float
    middle_s: float
    middle_std_s: float
    gain_s: float
    gain_std_s: float
    at_s: float
    half_s: float
    explained: float
    explained_drifting: float
    right: float
    rival: float
    alone: bool
    at_edge: bool

    @property
    def drift(self) -> float:
        """Gain in s per s."""
        return self.gain_s / self.half_s


@dataclass(frozen=True)
class LikelyCoefficients:
    """Usual coefficients of a relation and their spread, shape (p,) each."""

    mean: np.ndarray
    std: np.ndarray

    def gram(self) -> np.ndarray:
        """What it adds to the normal equations, per variance of the residual."""
        rows = np.column_stack((np.eye(self.mean.size), self.mean)) / self.std[:, None]
        return np.asarray(rows.T @ rows)


@dataclass(frozen=True)
class _Scan:
    """Normal equations of each block at each lag: grams of shape (lags, blocks, p + 1, p + 1)."""

    lags_s: np.ndarray
    tau: np.ndarray
    grams: np.ndarray

    @property
    def step_s(self) -> float:
        return float(self.lags_s[1] - self.lags_s[0])

    def at(self, lag_s: np.ndarray) -> np.ndarray:
        """Grams of the blocks at lags of shape (..., blocks), by parabolas through three lags."""
        place = (lag_s - self.lags_s[0]) / self.step_s
        near = np.clip(np.rint(place).astype(int), 1, self.lags_s.size - 2)
        x, block = place - near, np.arange(self.tau.size)
        weights = (0.5 * x * (x - 1.0), 1.0 - x**2, 0.5 * x * (x + 1.0))
        parts = (
            w[..., None, None] * self.grams[near + k, block]
            for k, w in zip((-1, 0, 1), weights, strict=True)
        )
        return np.asarray(sum(parts))

    def nearest(self, lag_s: np.ndarray) -> np.ndarray:
        place = np.rint((lag_s - self.lags_s[0]) / self.step_s).astype(int)
        return self.grams[np.clip(place, 0, self.lags_s.size - 1), np.arange(self.tau.size)]


@dataclass(frozen=True)
class Question:
    """A relation on the signals of one trial.

    Attributes
    ----------
    signals : dict of str to numpy.ndarray
        On one grid, NaN where not known, `time` among them; shape (n,) each.
    own : collection of str
        Names of the signals whose clock is in doubt.
    equations : callable
        signals -> y of shape (n,) or (n, m) and X of shape (n, p) or (n, m, p).
    smoothing_s : float
        Over which the signals are averaged.
    prior : LikelyCoefficients, optional
        Of the coefficients.
    """

    signals: Signals
    own: Collection[str]
    equations: Equations
    smoothing_s: float
    prior: LikelyCoefficients | None = None


def fit_line(question: Question) -> Line | None:
    """Lag of the signals in doubt behind the others; None when there is too little to compare."""
    time = question.signals["time"]
    at_s, half_s = float(time[0] + time[-1]) / 2.0, float(time[-1] - time[0]) / 2.0
    reach = min(WIDEST_S, half_s)
    step = WIDE_STEP * question.smoothing_s
    wide = _scan(question, np.zeros(2), step, reach, WIDE_BLOCKS)
    if wide is None:
        return None
    first, line, rival, sure = _widely(wide, half_s)
    steady = _fine(question, np.array([first, 0.0]))
    moving = steady if line[1] == 0.0 else _fine(question, line)
    if steady is None or moving is None:
        return None
    lag, lag_std, share = _descend(steady, drifting=False)
    both, both_std, drifting = _descend(moving, drifting=True)
    return Line(
        lag_s=first + lag[0],
        lag_std_s=lag_std[0],
        middle_s=line[0] + both[0],
        middle_std_s=both_std[0],
        gain_s=line[1] + both[1],
        gain_std_s=both_std[1],
        at_s=at_s,
        half_s=half_s,
        explained=1.0 - share,
        explained_drifting=1.0 - drifting,
        right=_over_right(steady, wide, first),
        rival=rival,
        alone=sure,
        at_edge=abs(first) > reach - wide.step_s,
    )


def _over_right(fine: _Scan, wide: _Scan, first: float) -> float:
    """What is left unexplained without lag over the least, in the fine scan if that is in it."""
    for scan, lag in ((fine, -first), (wide, 0.0)):
        if scan.lags_s[0] <= lag <= scan.lags_s[-1]:
            left = _unexplained(scan.grams.sum(axis=1))
            return float(np.interp(lag, scan.lags_s, left) / max(float(left.min()), TINY))
    return float("inf")


def _fine(question: Question, line: np.ndarray) -> _Scan | None:
    """Scan about a line (lag at the middle, gain to the end)."""
    time = question.signals["time"]
    blocks = int(np.clip((time[-1] - time[0]) / FINE_BLOCK_S, *FINE_BLOCKS))
    step = FINE_STEP * question.smoothing_s
    return _scan(question, line, step, FINE_STEPS * step, blocks)


def _scan(
    question: Question, line: np.ndarray, step_s: float, reach_s: float, blocks: int
) -> _Scan | None:
    signals, time = question.signals, question.signals["time"]
    every = max(1, round(step_s / float(time[1] - time[0])))
    step_s = every * float(time[1] - time[0])
    lag = (line[0] + line[1] * np.linspace(-1.0, 1.0, time.size))[::every]
    thin = {name: x[::every] for name, x in signals.items()}
    if line.any():
        thin |= {n: np.interp(thin["time"] + lag, time, signals[n]) for n in question.own}
    most = max(2, round(reach_s / step_s))
    rows = _rows(thin["time"].size, blocks)
    own = {n: thin[n] for n in question.own}
    still = _read({n: x for n, x in thin.items() if n not in own}, rows)
    still["time"] = thin["time"][np.clip(rows, 0, thin["time"].size - 1)]
    shifts, found = np.arange(-most, most + 1), []
    for shift in shifts:
        moved = still | _read(own, rows + shift)
        found.append(_grams(*question.equations(moved), blocks))
    grams = np.stack([g for g, _ in found])
    known = np.array([count for _, count in found])
    enough = known >= LEAST_ROWS * known.max(initial=1)
    if known.max(initial=0) < LEAST_OF_BLOCK * blocks or enough.sum() < 3:
        return None
    used = np.flatnonzero(enough)
    part = slice(used[0], used[-1] + 1)
    grams = _with_prior(
        grams[part], known[part], question.prior, PRIOR_SMOOTHINGS * question.smoothing_s / step_s
    )
    return _Scan(shifts[part] * step_s, (2 * np.arange(blocks) + 1) / blocks - 1, grams)


def _with_prior(
    grams: np.ndarray, rows: np.ndarray, prior: LikelyCoefficients | None, weight: float
) -> np.ndarray:
    """Grams to which the prior is added, a share to each block."""
    if prior is None:
        return grams
    total = grams.sum(axis=1)
    variance = float(np.min(_unexplained(total) * total[:, -1, -1] / rows))
    return np.asarray(grams + variance * weight * prior.gram() / grams.shape[1])


def _rows(size: int, blocks: int) -> np.ndarray:
    """Rows that are compared: all, or of a long trial an equal piece in the middle of each block.

    Rows before the first and after the last are unknown.
    """
    whole = size / blocks
    each = int(min(np.ceil(whole), ROWS_OF_BLOCK))
    first = np.floor(np.arange(blocks) * whole + (whole - each) / 2).astype(int)
    return np.clip(first[:, None] + np.arange(each), -1, size).ravel()


def _read(signals: Signals, rows: np.ndarray) -> Signals:
    """Some rows of signals, unknown before the first and after the last."""
    last = next(iter(signals.values())).size - 1 if signals else 0
    outside = np.flatnonzero((rows < 0) | (rows > last))
    inside = np.clip(rows, 0, last)
    found = {n: x[inside] for n, x in signals.items()}
    for values in found.values():
        values[outside] = np.nan
    return found


def _grams(y: np.ndarray, x: np.ndarray, blocks: int) -> tuple[np.ndarray, int]:
    """Grams of (X, y) of each block, and the number of rows in all."""
    known = np.isfinite(y + x @ np.ones(x.shape[-1]))
    both = np.concatenate((x, y[..., None]), axis=-1)
    both = np.where(known[..., None], both, 0.0).reshape(blocks, -1, both.shape[-1])
    return both.transpose(0, 2, 1) @ both, int(known.sum())


def _unexplained(grams: np.ndarray) -> np.ndarray:
    """Share of the variance of y that X does not explain, of Grams of shape (..., p + 1, p + 1)."""
    a, b, yy = grams[..., :-1, :-1], grams[..., :-1, -1], grams[..., -1, -1]
    scale = np.sqrt(np.maximum(np.diagonal(a, axis1=-2, axis2=-1), TINY))
    unit = a / (scale[..., :, None] * scale[..., None, :]) + RIDGE * np.eye(scale.shape[-1])
    right = b / scale
    told = np.sum(right * np.linalg.solve(unit, right[..., None])[..., 0], axis=-1)
    return np.clip(1.0 - told / np.maximum(yy, TINY), 0.0, 1.0)


def _widely(wide: _Scan, half_s: float) -> tuple[float, np.ndarray, float, bool]:
    """Best constant lag, best line (lag at the middle, gain to the end), rival, whether it is sure.

    A drift has to leave clearly less unexplained than a constant lag. It is sure when without any
    one block the lag is the same.
    """
    steepest = min(STEEPEST * half_s, MOST_GAIN_S)
    count = int(np.ceil(steepest / wide.step_s))
    gains = np.linspace(-steepest, steepest, 2 * count + 1)
    lags = wide.lags_s
    lines = lags[:, None] + gains[:, None, None] * wide.tau
    left = np.stack([_unexplained(wide.nearest(x).sum(axis=1)) for x in lines], axis=1)
    best = int(np.argmin(left[:, count]))
    i, j = (int(k) for k in np.unravel_index(int(np.argmin(left)), left.shape))
    if left[i, j] > CLEARLY * left[best, count]:
        i, j = best, count
    grams = wide.nearest(lines[j])
    others = grams.sum(axis=1)[:, None] - grams
    without = lags[np.argmin(_unexplained(others), axis=0)]
    sure = bool(np.all(np.abs(without - lags[i]) <= SAME_STEPS * wide.step_s))
    elsewhere = left[np.abs(lags - lags[i]) > ELSEWHERE_STEPS * wide.step_s].min(initial=1.0)
    rival = float(elsewhere / max(left[i, j], TINY))
    return float(lags[best]), np.array([lags[i], gains[j]]), rival, sure


def _descend(fine: _Scan, drifting: bool) -> tuple[np.ndarray, np.ndarray, float]:
    """Line of least unexplained share near that of the scan, its jackknife deviation, the share."""
    step = fine.step_s
    grid = np.linspace(-FINE_STEPS, FINE_STEPS, 2 * FINE_STEPS + 1) * step * 0.9
    gains = grid if drifting else np.zeros(1)
    lines = np.array([(a, c) for a in grid for c in gains])
    left = _unexplained(fine.nearest(lines[:, :1] + lines[:, 1:] * fine.tau).sum(axis=1))
    line = lines[int(np.argmin(left))]
    for _ in range(STEPS):
        total = _around(fine, line, drifting).sum(axis=1)
        ahead = np.nan_to_num(_step(_unexplained(total), step, drifting))
        line = line + np.clip(ahead, -2.0 * step, 2.0 * step)
    reach = float(fine.lags_s[-1]) - step
    grams = _around(fine, line, drifting)
    total = grams.sum(axis=1)
    others = _unexplained(total[:, None] - grams)
    steps = _step(others, step, drifting)
    count = steps.shape[0]
    std = np.sqrt((count - 1) / count * ((steps - steps.mean(axis=0)) ** 2).sum(axis=0))
    lost = np.abs(line) > reach  # no minimum in the scan
    std = np.where(lost.any() | ~np.isfinite(std), np.inf, std)
    return line, std, float(_unexplained(total)[4])


def _around(fine: _Scan, line: np.ndarray, drifting: bool) -> np.ndarray:
    """Grams of the blocks at nine lines about one, shape (9, blocks, p + 1, p + 1)."""
    near = line + NINE * (1.0, float(drifting)) * fine.step_s
    return fine.at(near[:, :1] + near[:, 1:] * fine.tau)


def _step(share: np.ndarray, step_s: float, drifting: bool) -> np.ndarray:
    """To the minimum of the parabola through nine shares; NaN where it has none.

    Shares of shape (9, ...), steps of shape (..., 2).
    """
    s = share.reshape(3, 3, *share.shape[1:])
    lag, gain = (s[2, 1] - s[0, 1]) / 2.0, (s[1, 2] - s[1, 0]) / 2.0  # slopes
    lag_lag, gain_gain = s[2, 1] - 2 * s[1, 1] + s[0, 1], s[1, 2] - 2 * s[1, 1] + s[1, 0]
    cross = (s[2, 2] - s[2, 0] - s[0, 2] + s[0, 0]) / 4.0
    if not drifting:
        lag_lag = np.where(lag_lag > 0.0, lag_lag, np.nan)
        return np.stack((-lag / lag_lag, np.zeros_like(lag)), axis=-1) * step_s
    area = lag_lag * gain_gain - cross**2
    area = np.where((area > 0.0) & (lag_lag > 0.0), area, np.nan)
    steps = (cross * gain - gain_gain * lag, cross * lag - lag_lag * gain)
    return np.stack(steps, axis=-1) / area[..., None] * step_s
