"""Levels, ramps and noise of a logged input: where a rudder or a propeller is held constant.

Everything works on plain arrays of equidistant samples. An input at index i acts from sample i
to sample i + 1, so the sample range of a plateau is half-open like a Python slice.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SECOND_DIFFERENCE_GAIN = 6**0.5  # std of x[i-1] - 2 x[i] + x[i+1] over std of white noise
NOISE_QUANTILE = 0.25  # share of the record that is surely not maneuvering: noise is read there
FEWEST_WINDOWS = 8  # a quarter of fewer is chance
RAMP_SHARE = 0.05  # of the level: a fin that moves less than this within a span is at rest
RATE_SPAN_S = 0.3  # over which a slew rate is measured; shorter spans see noise


@dataclass(frozen=True)
class Plateau:
    """A stretch of constant input.

    Attributes
    ----------
    start, stop : int
        Half-open sample range.
    level : float
        Median over the range, in the unit of the input.
    """

    start: int
    stop: int
    level: float

    @property
    def samples(self) -> int:
        """Number of samples."""
        return self.stop - self.start

    @property
    def middle(self) -> int:
        """Sample in its middle."""
        return (self.start + self.stop) // 2


def odd_samples(span_s: float, rate_hz: float) -> int:
    """Odd number of samples, at least 3, that spans about `span_s`."""
    return 2 * max(1, round(span_s * rate_hz / 2)) + 1


def running_median(x: Array, samples: int) -> Array:
    """Centred running median of an odd number of samples; the ends are repeated."""
    half = samples // 2
    padded = np.pad(np.asarray(x, dtype=float), half, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, samples)
    return np.asarray(np.median(windows, axis=1))


def running_mean(x: Array, samples: int) -> Array:
    """Centred running mean of an odd number of samples; the window shrinks at the ends."""
    x = np.asarray(x, dtype=float)
    half = min(samples // 2, max(0, x.size - 1))
    total = np.concatenate(([0.0], np.cumsum(x)))
    index = np.arange(x.size)
    low, high = np.maximum(index - half, 0), np.minimum(index + half + 1, x.size)
    return np.asarray((total[high] - total[low]) / (high - low))


def noise_std(x: Array, samples: int, where: NDArray[np.bool_] | None = None) -> float:
    """Standard deviation of the white noise on a piecewise smooth signal.

    Local second differences are taken in windows of `samples`; the quietest quarter of the
    windows counts, because the activity of an autopilot is no sensor noise. With `where` only
    those samples count, if they fill `FEWEST_WINDOWS` windows.
    """
    second = np.abs(np.diff(np.asarray(x, dtype=float), n=2))
    if where is not None and np.count_nonzero(where[1:-1]) >= FEWEST_WINDOWS * samples:
        second = second[where[1:-1]]
    if second.size < samples:
        return 0.0
    windows = second[: second.size // samples * samples].reshape(-1, samples)
    local = np.sqrt(np.mean(windows**2, axis=1)) / SECOND_DIFFERENCE_GAIN
    return float(np.quantile(local, NOISE_QUANTILE))


def slew_rate(x: Array, rate_hz: float) -> float:
    """Fastest change of an input, in its unit per second, over spans of `RATE_SPAN_S`."""
    span = max(1, round(RATE_SPAN_S * rate_hz))
    if x.size <= span:
        return 0.0
    return float(np.max(np.abs(x[span:] - x[:-span]))) * rate_hz / span


def plateaus(x: Array, tolerance: float) -> list[Plateau]:
    """Cut a signal into stretches that stay within `tolerance` of their level.

    Parameters
    ----------
    x : ndarray, shape (n,)
        The input, equidistant samples.
    tolerance : float
        Largest distance from the level, in the unit of `x`.

    Returns
    -------
    list of Plateau
        Adjacent, covering all samples; ramps become many short ones.
    """
    pieces: list[tuple[int, int]] = []
    start, low, high = 0, np.inf, -np.inf
    for i, value in enumerate(x.tolist()):  # a day of it: comparing is faster than calling
        if value < low:
            low = value
        if value > high:
            high = value
        if high - low > 2 * tolerance:
            pieces.append((start, i))
            start, low, high = i, value, value
    if x.size:
        pieces.append((start, x.size))
    return _merged([Plateau(a, b, median(x[a:b])) for a, b in pieces], x, tolerance)


def median(x: Array) -> float:
    """As `numpy.median`, without its preparations, which take longer than a short stretch."""
    half, ordered = x.size // 2, np.sort(x)
    return float(ordered[half] if x.size % 2 else (ordered[half - 1] + ordered[half]) / 2.0)


def _merged(pieces: list[Plateau], x: Array, tolerance: float) -> list[Plateau]:
    """Join neighbours of the same level: noise had cut them."""
    joined: list[Plateau] = []
    for piece in pieces:
        if joined and abs(joined[-1].level - piece.level) <= tolerance:
            start = joined.pop().start
            piece = Plateau(start, piece.stop, median(x[start : piece.stop]))
        joined.append(piece)
    return joined


def ramp_start(x: Array, arrival: int, level: float, span: int, tolerance: float) -> int:
    """First sample of the move that arrives at `level` at sample `arrival`.

    Walks back while the distance from the level grows by more than half of `tolerance` (or
    `RAMP_SHARE` of the level) per `span` samples; so a slow ramp, the tail of a servo and the
    step of a command are followed alike, and noise is not.
    """
    least = max(0.5 * tolerance, RAMP_SHARE * abs(level))

    def distance(k: int) -> float:
        """From the level."""
        return abs(float(x[k]) - level)

    i = arrival
    while i > 0 and distance(max(0, i - span)) - distance(i) > least:
        i -= 1
    return min(i + 1, arrival) if i < arrival else arrival
