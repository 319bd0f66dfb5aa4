"""Rauch-Tung-Striebel smoothing of a filter pass; it knows no vehicle."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[Any]


class Passed(NamedTuple):
    """What a pass of a filter leaves for the smoother.

    Attributes
    ----------
    x, P : (n, m), (n, m, m) arrays
        Means and covariances after the readings of each row.
    x_predicted, P_predicted : (n, m), (n, m, m) arrays
        Those before the readings of each row; row 0 is not used.
    F : (n, m, m) array
        Derivative of the step from each row to the next; the last row is not used.
    """

    x: Array
    P: Array
    x_predicted: Array
    P_predicted: Array
    F: Array


@dataclass(frozen=True)
class Smoothed:
    """Means (n, m) and covariances (n, m, m) given all readings."""

    mean: Array
    covariance: Array


def smooth(x: Array, P: Array, x_predicted: Array, P_predicted: Array, F: Array) -> Smoothed:
    """Run back over a pass; arguments as the fields of `Passed`.

    With C_k = P_k F_k' (P_k+1|k)^-1: x_k|n = x_k + C_k (x_k+1|n - x_k+1|k) and
    P_k|n = P_k + C_k (P_k+1|n - P_k+1|k) C_k' (Rauch, Tung and Striebel 1965).
    """
    mean, covariance = x.copy(), P.copy()
    gains = np.linalg.solve(P_predicted[1:], F[:-1] @ P[:-1]).swapaxes(1, 2)
    for k in range(len(x) - 2, -1, -1):
        C = gains[k]
        mean[k] += C @ (mean[k + 1] - x_predicted[k + 1])
        covariance[k] += C @ (covariance[k + 1] - P_predicted[k + 1]) @ C.T
        covariance[k] = 0.5 * (covariance[k] + covariance[k].T)
    return Smoothed(mean, covariance)
