"""Tails of distributions in closed form, for what every command asks of them.

`scipy.special` has them all, and takes a fifteenth of the time of an identification to import. The
formulas are those of Abramowitz and Stegun (1964), chapter 26, and for Kolmogorov's distribution
of Marsaglia, Tsang and Wang (2003), Journal of Statistical Software 8(18). Degrees of freedom are
whole numbers.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]

KOLMOGOROV_TERMS = 6  # of both series; where each is used the next is below 1e-30
KOLMOGOROV_CHANGE = 1.0  # argument below which the other series is the faster one


def normal_below(values: Array) -> Array:
    """Share (n,) of the standard normal distribution below some values (n,)."""
    ends = (-values / math.sqrt(2.0)).tolist()
    return 0.5 * np.array([math.erfc(end) for end in ends])


def normal_quantile(share: float) -> float:
    """Value below which a share of the standard normal distribution lies."""
    from statistics import NormalDist

    return NormalDist().inv_cdf(share)


def chi_square_above(freedom: int, value: float) -> float:
    """Share of the chi-square distribution above a value: A&S 26.4.4 and 26.4.5."""
    half, odd = 0.5 * value, freedom % 2
    if half <= 0.0:
        return 1.0
    powers = [n + 0.5 * odd for n in range(freedom // 2)]
    terms = [math.exp(n * math.log(half) - half - math.lgamma(n + 1.0)) for n in powers]
    return math.fsum(terms) + (math.erfc(math.sqrt(half)) if odd else 0.0)


def student_quantile(freedom: int, share: float) -> float:
    """Value below which a share, at least a half, of Student's distribution lies: A&S 26.7."""
    low, high = 0.0, 0.5 * math.pi
    while low < (middle := 0.5 * (low + high)) < high:
        if 0.5 + 0.5 * _student_within(freedom, middle) < share:
            low = middle
        else:
            high = middle
    return math.sqrt(freedom) * math.tan(middle)


def student_above(freedom: int, value: float) -> float:
    """Share of Student's distribution above a value: A&S 26.7."""
    within = _student_within(freedom, math.atan(abs(value) / math.sqrt(freedom)))
    return 0.5 * (1.0 - within) if value > 0.0 else 0.5 * (1.0 + within)


def _student_within(freedom: int, angle: float) -> float:
    """Share between t and -t, of which the angle is that of t / sqrt(freedom): A&S 26.7.3, 4."""
    odd, square = freedom % 2, math.cos(angle) ** 2
    term, total = math.cos(angle) if odd else 1.0, 0.0
    for n in range(1 + odd, freedom, 2):
        total += term
        term *= n / (n + 1) * square
    total *= math.sin(angle)
    return 2.0 / math.pi * (angle + total) if odd else total


def kolmogorov_above(value: float) -> float:
    """Share of Kolmogorov's limiting distribution above a value."""
    if value <= 0.0:
        return 1.0
    k = np.arange(1, KOLMOGOROV_TERMS + 1)
    if value < KOLMOGOROV_CHANGE:
        series = np.exp(-(((2 * k - 1) * math.pi / value) ** 2) / 8.0).sum()
        return 1.0 - math.sqrt(2.0 * math.pi) / value * float(series)
    return 2.0 * float(((-1.0) ** (k - 1) * np.exp(-2.0 * (k * value) ** 2)).sum())
