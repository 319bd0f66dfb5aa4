"""Rauch-Tung-Striebel smoothing of a filter pass; it knows no vehicle."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


@dataclass(frozen=True)
class Smoothed:
    """Means (n, m) and covariances (n, m, m) given all readings."""

    mean: Array
    covariance: Array


def smooth(
    filtered: Array,
    filtered_covariance: Array,
    predicted: Array,
    predicted_covariance: Array,
    transition: Array,
) -> Smoothed:
    """Run back over a pass.

    With C_k = P_k F_k' (P_k+1|k)^-1: x_k|n = x_k + C_k (x_k+1|n - x_k+1|k) and
    P_k|n = P_k + C_k (P_k+1|n - P_k+1|k) C_k' (Rauch, Tung and Striebel 1965).

    Parameters
    ----------
    filtered : (n, m) array
        Means after the readings of each step.
    filtered_covariance : (n, m, m) array
    predicted : (n, m) array
        Means before the readings of each step; row 0 is not used.
    predicted_covariance : (n, m, m) array
    transition : (n, m, m) array
        Derivative of the step from each row to the next; the last row is not used.
    """
    mean, covariance = filtered.copy(), filtered_covariance.copy()
    gains = np.linalg.solve(
        predicted_covariance[1:], transition[:-1] @ filtered_covariance[:-1]
    ).swapaxes(1, 2)
    for k in range(len(filtered) - 2, -1, -1):
        gain = gains[k]
        mean[k] += gain @ (mean[k + 1] - predicted[k + 1])
        covariance[k] += gain @ (covariance[k + 1] - predicted_covariance[k + 1]) @ gain.T
        covariance[k] = 0.5 * (covariance[k] + covariance[k].T)
    return Smoothed(mean, covariance)
