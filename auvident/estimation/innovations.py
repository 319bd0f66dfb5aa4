"""Residual analysis: are innovations white, normal and as large as claimed, and free of inputs?

Series come in pieces (records), with NaN where nothing was measured. Innovations that are claimed
to be standard normal are compared with zero mean and unit variance, not with their own.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.estimation.chances import (
    chi_square_above,
    kolmogorov_above,
    normal_below,
    normal_quantile,
)
from auvident.estimation.output_error import correlation_time

Array = npt.NDArray[Any]

TWO_SIDED_95 = 1.959964  # standard normal quantile of 97.5 %
# share of the samples that a lag needs in pairs: sensors that tick at every other row have next to
# none at odd lags
ENOUGH_PAIRS = 0.1
FLAT = 1.0e-9  # range over size of a series that does not vary
VALUE_DIGITS = 4  # of an autocorrelation that is told at every lag


@dataclass(frozen=True)
class Consistency:
    """Normalised innovation squared of one channel against its chi-square band.

    Attributes
    ----------
    mean : float
        Mean of the squared whitened innovations.
    correlation : float
        Their correlation time in samples; 1 when white.
    corrected : float
        mean * correlation: the noise of a pass is inflated by the correlation of the residual,
        so this is 1 when the claimed variance of an independent piece of information is right.
        Where the noise is that of a coloured residual instead, nothing was inflated, and this is
        the mean.
    low, high : float
        95 % band of `corrected`, with samples / correlation degrees of freedom.
    normality : Normality
        Of the innovations times the square root of corrected / mean.
    """

    mean: float
    correlation: float
    corrected: float
    low: float
    high: float
    normality: "Normality"

    def as_told(self) -> dict[str, float]:
        """The figures of the test as they stand in an artifact."""
        told = {k: getattr(self, k) for k in ("mean", "correlation", "corrected", "low", "high")}
        n = self.normality
        return told | {"effective_samples": n.effective_samples, "ks": n.distance, "ks_p": n.p}


@dataclass(frozen=True)
class Normality:
    """Kolmogorov-Smirnov test of innovations against the standard normal distribution.

    Attributes
    ----------
    distance : float
        Largest difference between the two distribution functions.
    effective_samples : float
        Number of independent innovations that say as much: samples over correlation time.
    p : float
        Probability of a larger distance of so many.
    """

    distance: float
    effective_samples: float
    p: float


@dataclass(frozen=True)
class Whiteness:
    """Autocorrelation of innovations.

    Attributes
    ----------
    largest, lag : float, int
        The largest by magnitude, and its lag in samples.
    band : float
        95 % band of the autocorrelation of white noise at that lag, to either side of zero.
    outside : float
        Share of the lags outside their band; 0.05 when white.
    p : float
        Of the sum over the lags (Ljung and Box 1978), small when not white.
    lags, values : tuple
        Every lag with enough pairs, in samples, and the autocorrelation there.
    """

    largest: float
    lag: int
    band: float
    outside: float
    p: float
    lags: tuple[int, ...] = ()
    values: tuple[float, ...] = ()


@dataclass(frozen=True)
class CrossCorrelation:
    """Correlation of a residual with an input some samples before.

    Attributes
    ----------
    largest, lag : float, int
        The largest by magnitude, and its lag in samples.
    band : float
        95 % band of the largest over all lags of two series that have nothing to do with each
        other, each with its own autocorrelation (Bartlett 1946).
    """

    largest: float
    lag: int
    band: float


def consistency(
    whitened: Sequence[Array] | Array, longest: int, inflated: bool = True
) -> Consistency | None:
    """Test one channel of a stage.

    Parameters
    ----------
    whitened : sequence of (n,) arrays
        Whitened innovations of each record; NaN where nothing was measured.
    longest : int
        Longest lag looked at, in samples.
    inflated : bool
        Whether the noise was inflated by the correlation of the residual.

    Returns
    -------
    Consistency or None
        None when nothing was measured.
    """
    values = np.concatenate([row[np.isfinite(row)] for row in whitened])
    if not values.size:
        return None
    mean, correlation = float(values @ values) / values.size, correlation_of(whitened, longest)
    factor = correlation if inflated else 1.0
    low, high = chi_square_band(values.size / correlation)
    tested = normality(values * factor**0.5, values.size / correlation)
    return Consistency(mean, correlation, mean * factor, low, high, tested)


def correlation_of(pieces: Sequence[Array] | Array, longest: int) -> float:
    """Correlation time in samples, the mean over the pieces by their readings."""
    read = [piece[np.isfinite(piece)] for piece in pieces]
    times = [(own.size, correlation_time(own, longest)) for own in read if own.size]
    return sum(n * time for n, time in times) / sum(n for n, _ in times)


def normality(values: Array, effective_samples: float) -> Normality:
    """Kolmogorov-Smirnov test of values (n,) against the standard normal distribution."""
    n, below = len(values), normal_below(np.sort(values))
    steps = np.arange(n + 1) / n
    distance = float(max((steps[1:] - below).max(), (below - steps[:-1]).max()))
    p = kolmogorov_above(distance * effective_samples**0.5)
    return Normality(distance, effective_samples, p)


def lagged(pieces: Sequence[Array], others: Sequence[Array], lags: int) -> tuple[Array, Array]:
    """Sums of products (lags + 1,) of a series with another so much before, and their number."""
    products, pairs = np.zeros(lags + 1), np.zeros(lags + 1)
    for x, y in zip(pieces, others, strict=True):
        size = 1 << (2 * len(x) - 1).bit_length()
        for total, now, before in (
            (products, np.nan_to_num(x), np.nan_to_num(y)),
            (pairs, np.isfinite(x) * 1.0, np.isfinite(y) * 1.0),
        ):
            spectrum = np.fft.rfft(now, size) * np.conj(np.fft.rfft(before, size))
            found = np.fft.irfft(spectrum, size)[: min(lags + 1, len(x))]
            total[: len(found)] += found
    return products, np.round(pairs)


def whiteness(pieces: Sequence[Array], lags: int) -> Whiteness | None:
    """Autocorrelation of innovations up to a lag; None with too few pairs of them."""
    products, pairs = lagged(pieces, pieces, lags)
    told = pairs > ENOUGH_PAIRS * pairs[0]
    told[0] = False
    if not told.any() or products[0] <= 0.0:
        return None
    lag, count = np.flatnonzero(told), pairs[told]
    found = products[told] / count / (products[0] / pairs[0])
    band, worst = TWO_SIDED_95 / np.sqrt(count), int(np.abs(found).argmax())
    return Whiteness(
        largest=float(found[worst]),
        lag=int(lag[worst]),
        band=float(band[worst]),
        outside=float(np.mean(np.abs(found) > band)),
        p=chi_square_above(len(lag), float(np.sum(count * found**2))),
        lags=tuple(lag.tolist()),
        values=tuple(np.round(found, VALUE_DIGITS).tolist()),
    )


def cross_correlation(
    residual: Sequence[Array], given: Sequence[Array], lags: int
) -> CrossCorrelation | None:
    """Correlation of a residual with an input up to some samples before; None where one is flat.

    The variance of a correlation of two independent series over n pairs is 1/n times the sum over
    all lags of the product of their autocorrelations; the lags looked at are as many tries as they
    are lengths of that sum.

    Parameters
    ----------
    residual, given : sequence of (n,) arrays
        Their means over all pieces are taken off.
    lags : int
        Longest lag looked at, in samples.
    """
    x, y = _standardised(residual), _standardised(given)
    if x is None or y is None:
        return None
    products, pairs = lagged(x, y, lags)
    told = np.flatnonzero(pairs > ENOUGH_PAIRS * pairs[0])
    if not told.size:
        return None
    found = products[told] / pairs[told]
    together = max(1.0 + 2.0 * float(_autocorrelation(x) @ _autocorrelation(y)), 1.0)
    tries = max(told.size / together, 1.0)
    worst = int(np.abs(found).argmax())
    spread = float(np.sqrt(together / pairs[told[worst]]))
    band = min(normal_quantile(0.5 + 0.5 * 0.95 ** (1.0 / tries)) * spread, 1.0)
    return CrossCorrelation(float(found[worst]), int(told[worst]), band)


def _standardised(pieces: Sequence[Array]) -> list[Array] | None:
    """A series with zero mean and unit variance; None where it is flat."""
    values = np.concatenate(pieces)
    values = values[np.isfinite(values)]
    if not values.size or np.ptp(values) <= FLAT * np.abs(values).max():
        return None
    return [(piece - values.mean()) / values.std() for piece in pieces]


def _autocorrelation(pieces: Sequence[Array]) -> Array:
    """Autocorrelation from lag one on, tapered as pairs become few (the biased estimate)."""
    products, _ = lagged(pieces, pieces, max(map(len, pieces)) - 1)
    return np.asarray(products[1:] / products[0])


def most_likely(whitened: Array, log_likelihood: float) -> float:
    """Log-likelihood of a pass with the noise of each channel as large as its innovations are.

    All variances of a channel, its readings' and its state's, are taken times the mean square of
    its whitened innovations, where the Gaussian likelihood is highest.

    Parameters
    ----------
    whitened : (k, n, c) array
        Innovations over their standard deviation; NaN where nothing was measured.
    log_likelihood : float
        Of the pass as it was.
    """
    for c in range(whitened.shape[2]):
        own = whitened[:, :, c][np.isfinite(whitened[:, :, c])]
        square = float(own @ own)
        if square > 0.0:
            factor = square / own.size
            log_likelihood += 0.5 * (square - own.size - own.size * float(np.log(factor)))
    return log_likelihood


def chi_square_band(freedom: float) -> tuple[float, float]:
    """95 % band of a mean of squares with `freedom` degrees of freedom."""
    low, high = (float(mean_square_quantile(freedom, z)) for z in (-TWO_SIDED_95, TWO_SIDED_95))
    return max(low, 0.0), high


def mean_square_quantile(freedom: Array | float, z: float) -> Array:
    """Quantile of a chi-square over its degrees of freedom, from the standard normal one, z.

    It is the cube of a normal variable (Wilson and Hilferty 1931), good to some percent at one
    degree.
    """
    spread = 2.0 / (9.0 * np.asarray(freedom))
    return np.asarray((1.0 - spread + z * np.sqrt(spread)) ** 3)
