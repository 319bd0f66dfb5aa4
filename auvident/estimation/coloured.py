"""Residuals of a free-running prediction as sensor noise and a slow disturbance; no vehicle here.

What a model leaves of a record is white noise of the sensor plus what the sea and the model's own
faults add, which lasts for seconds: an Ornstein-Uhlenbeck process. A scalar Kalman filter turns
such a residual, and everything linear in it, into white innovations, so that a likelihood counts
neither a slow error as many independent ones nor a fast one as if it drowned in the slow.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import VehicleTime
from auvident.jit import borrowing, kernel

Array = npt.NDArray[Any]

# correlation times that are tried; slower is the model's fault
TIMES_S: tuple[VehicleTime, ...] = (0.3, 0.6, 1.0, 2.0, 4.0)
# disturbance over sensor noise; one that lasts 4 s doubles what 10 readings a second say slowly
# at 0.11 already
RATIOS = (0.0, 0.05, 0.1, 0.17, 0.3, 0.6, 1.0, 1.7, 3.0, 5.0, 9.0, 16.0)
FACTORS = 64  # of a product: (1 + 16^2)^64 is far within the range of a number

NEGLIGIBLE = 1.0e-3  # of the noise of a sensor: a residual that small is one of arithmetic


@dataclass(frozen=True)
class Colour:
    """Noise of a channel.

    Attributes
    ----------
    white : float
        Standard deviation of the sensor noise.
    slow : float
        Standard deviation of the disturbance.
    time_s : float
        Its correlation time.
    """

    white: float
    slow: float
    time_s: float


@borrowing
def whiten_row(row, state, gain, scale, keep):
    """Innovations of a row (C,) over their standard deviation, in place; `state` (C,) goes on."""
    for c in range(row.shape[0]):
        innovation = row[c] - state[c]
        row[c] = innovation * scale
        state[c] = (state[c] + gain * innovation) * keep


@kernel
def next_variance(variance, gain, keep, slow):
    """Variance of the disturbance one row later; a gain of zero saw nothing."""
    return keep * keep * variance * (1.0 - gain) + (1.0 - keep * keep) * slow * slow


@kernel
def whiten(values, seen, keep, white, slow):
    """Innovations of the columns of `values` (n, C), in place, over their standard deviation.

    Parameters
    ----------
    values : (n, C) array
        Column 0 may be a residual, the others slopes of it. Rows not seen become zero.
    seen : (n,) bool array
    keep : float
        exp(-step / correlation time).
    white, slow : float

    Returns
    -------
    float
        Sum of the logarithms of the innovation variances.
    """
    n, columns = values.shape
    state, variance, total = np.zeros(columns), slow * slow, 0.0
    for k in range(n):
        gain = 0.0
        if seen[k]:
            spread = variance + white * white
            gain = variance / spread
            total += math.log(spread)
            whiten_row(values[k], state, gain, 1.0 / math.sqrt(spread), keep)
        else:
            for c in range(columns):
                values[k, c] = 0.0
                state[c] *= keep
        variance = next_variance(variance, gain, keep, slow)
    return total


@kernel
def whiten_channels(error, slopes, columns, seen, channels, keep, white, slow, out):
    """Innovations of channels of a record and of their slopes, one channel below the other.

    Parameters
    ----------
    error : (n, 4) array
    slopes : (n, 4, >= k) array
    columns : (k,) int array
        Of the slopes.
    seen : (n, 4) bool array
        Rows not seen become zero.
    channels : (c,) int array
    keep, white, slow : (c,) array
        Of each of these channels, see `whiten`.
    out : (c n, 1 + k) array, filled
        Error, then slopes.
    """
    n = error.shape[0]
    for i in range(channels.shape[0]):
        own, c = out[i * n : (i + 1) * n], channels[i]
        for t in range(n):
            if seen[t, c]:
                own[t, 0] = error[t, c]
                for k in range(columns.shape[0]):
                    own[t, 1 + k] = slopes[t, c, columns[k]]
        whiten(own, seen[:, c], keep[i], white[i], slow[i])


@kernel
def _distances(values, seen, keep, slow, square, total):
    """Add the squared innovations and log variances of a record for a unit white noise.

    All noises advance together, reading by reading: the loop over them is what the processor does
    several at a time. The logarithm is that of a product, taken before it leaves the range.

    Parameters
    ----------
    values : (n,) array
    seen : (n,) bool array
    keep : (m,) array
        exp(-step / correlation time) of each noise.
    slow : (m,) array
        Variance of its disturbance over that of the sensor noise.
    square, total : (m,) array, added to
    """
    m = keep.shape[0]
    state, variance, product = np.zeros(m), slow.copy(), np.ones(m)
    again = keep * keep
    new, since = (1.0 - again) * slow, 0
    for k in range(values.shape[0]):
        if seen[k]:
            value = values[k]
            for i in range(m):
                spread = variance[i] + 1.0
                share, innovation = 1.0 / spread, value - state[i]
                square[i] += innovation * innovation * share
                product[i] *= spread
                state[i] = (state[i] + variance[i] * share * innovation) * keep[i]
                variance[i] = again[i] * variance[i] * share + new[i]
            since += 1
        else:
            for i in range(m):
                state[i] *= keep[i]
                variance[i] = again[i] * variance[i] + new[i]
        if since == FACTORS or k + 1 == values.shape[0]:
            for i in range(m):
                total[i] += math.log(product[i])
                product[i] = 1.0
            since = 0


def colour_of(pieces: Sequence[Array], dt_s: float) -> tuple[Colour, float]:
    """Most likely noise of a channel, and the log-likelihood with it.

    Parameters
    ----------
    pieces : sequence of (n,) array
        Residual of each record, NaN where nothing was measured.
    dt_s : float

    Returns
    -------
    tuple of Colour and float
    """
    return _most_likely(sum((_tried(piece, dt_s) for piece in pieces), NOTHING_TRIED))


def colours_without_each(pieces: Sequence[Array], dt_s: float, least: float) -> list[Colour]:
    """Most likely noise of a channel for each record, from the others alone; see `colour_of`.

    That of a single record is its own. The sensor noise is `least` or more.
    """
    tried = [_tried(piece, dt_s) for piece in pieces]
    total = sum(tried, NOTHING_TRIED)
    left = [total - own if (total - own).count else own for own in tried]
    return [at_least(_most_likely(others)[0], least) for others in left]


def at_least(colour: Colour, white: float) -> Colour:
    """The noise with no less of the sensor than so much."""
    return replace(colour, white=max(colour.white, white))


def whitened(piece: Array, colour: Colour, dt_s: float) -> Array:
    """Innovations (n,) of a residual over their standard deviation; NaN stays NaN."""
    seen = np.isfinite(piece)
    values = np.where(seen, piece, 0.0)[:, None]
    whiten(values, seen, math.exp(-dt_s / colour.time_s), colour.white, colour.slow)
    return np.where(seen, values[:, 0], np.nan)


@dataclass(frozen=True)
class _Tried:
    """Squared innovations and log variances (times, ratios) of some residuals, and their count."""

    square: Array
    logs: Array
    count: int

    def __add__(self, other: "_Tried") -> "_Tried":
        return _Tried(self.square + other.square, self.logs + other.logs, self.count + other.count)

    def __sub__(self, other: "_Tried") -> "_Tried":
        return _Tried(self.square - other.square, self.logs - other.logs, self.count - other.count)


NOTHING_TRIED = _Tried(np.zeros((len(TIMES_S), len(RATIOS))), np.zeros(1), 0)


def _tried(piece: Array, dt_s: float) -> _Tried:
    seen = np.isfinite(piece)
    shape = len(TIMES_S), len(RATIOS)
    square, logs = np.zeros(shape), np.zeros(shape)
    keep = np.repeat(np.exp(-dt_s / np.array(TIMES_S)), len(RATIOS))
    slow = np.tile(np.array(RATIOS) ** 2, len(TIMES_S))
    _distances(np.where(seen, piece, 0.0), seen, keep, slow, square.ravel(), logs.ravel())
    return _Tried(square, logs, int(seen.sum()))


def _most_likely(tried: _Tried) -> tuple[Colour, float]:
    if tried.count == 0:
        return Colour(1.0, 0.0, 1.0), 0.0
    variance, n = tried.square / tried.count, tried.count
    value = -0.5 * (n * (np.log(2.0 * math.pi * np.maximum(variance, 1e-300)) + 1.0) + tried.logs)
    i, j = (int(k) for k in np.unravel_index(np.argmax(value), value.shape))
    white = math.sqrt(variance[i, j])
    return Colour(white, RATIOS[j] * white, TIMES_S[i]), float(value[i, j])
