"""Whether the innovations of a filter pass are as large as the filter says."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.estimation.output_error import correlation_time

Array = npt.NDArray[Any]

TWO_SIDED_95 = 1.959964  # standard normal quantile of 97.5 %


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
    low, high : float
        95 % band of `corrected`, with samples / correlation degrees of freedom.
    """

    mean: float
    correlation: float
    corrected: float
    low: float
    high: float


def consistency(whitened: Array, longest: int) -> Consistency | None:
    """Test one channel of a filter pass.

    Parameters
    ----------
    whitened : (k, n) array
        Whitened innovations of each record; NaN where nothing was measured.
    longest : int
        Longest lag looked at, in samples.

    Returns
    -------
    Consistency or None
        None when nothing was measured.
    """
    pieces = [row[np.isfinite(row)] for row in whitened]
    pieces = [piece for piece in pieces if piece.size]
    if not pieces:
        return None
    count = sum(piece.size for piece in pieces)
    mean = sum(float(piece @ piece) for piece in pieces) / count
    correlation = sum(piece.size * correlation_time(piece, longest) for piece in pieces) / count
    low, high = chi_square_band(count / correlation)
    return Consistency(mean, correlation, mean * correlation, low, high)


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
    """95 % band of a mean of squares with `freedom` degrees of freedom (Wilson-Hilferty)."""
    centre, spread = 1.0 - 2.0 / (9.0 * freedom), np.sqrt(2.0 / (9.0 * freedom))
    low, high = (centre + side * TWO_SIDED_95 * spread for side in (-1.0, 1.0))
    return max(float(low), 0.0) ** 3, float(high) ** 3
