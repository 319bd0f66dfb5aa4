"""Hull-fin interference: slender-body theory of a fin on a circular body (NACA 1307).

tau = R/s is the hull radius over the distance of the tip from the axis; 0 is a fin without a
hull, 1 a fin that vanishes beside the hull.
"""

from typing import Any

import numpy as np

from auvident.physics.ase.quadrature import nodes_and_weights

SMALL = 1e-3  # closed forms are 0/0 at both ends; the limits are reached to better than 1e-3
SINGLE_FIN_NODES = 24  # Gauss points on the fin: relative error below 1e-9


def fin_on_body(tau: Any) -> np.ndarray:
    """K_W(B): lift of a fin pair on the body at incidence over that of the fins alone.

    Parameters
    ----------
    tau : array_like
        Hull radius over tip radius, 0 to 1.

    Returns
    -------
    ndarray
        1 to 2 (Pitts, Nielsen & Kaattari, NACA report 1307, eq. 14). Also the lift of fins and
        body together when the fins are deflected.
    """
    t = np.clip(np.asarray(tau, float), SMALL, 1.0 - SMALL)
    gap = 1.0 / t - t
    bracket = (1.0 + t**4) * (0.5 * np.arctan(0.5 * gap) + np.pi / 4.0)
    value = 2.0 / np.pi / (1.0 - t) ** 2 * (bracket - t**2 * (gap + 2.0 * np.arctan(t)))
    return _to_limits(tau, value, 1.0, 2.0)


def fin_and_body(tau: Any) -> np.ndarray:
    """K_W(B) + K_B(W) = (1 + tau)^2: lift due to a fin pair at incidence, carry-over included."""
    return (1.0 + np.asarray(tau, float)) ** 2


def _to_limits(tau: Any, value: np.ndarray, at_zero: float, at_one: float) -> np.ndarray:
    """Straight line from the ends of the closed form's range to its exact limits."""
    t = np.asarray(tau, float)
    low = at_zero + (value - at_zero) * np.clip(t / SMALL, 0.0, 1.0)
    high = at_one + (value - at_one) * np.clip((1.0 - t) / SMALL, 0.0, 1.0)
    return np.where(t < SMALL, low, np.where(t > 1.0 - SMALL, high, value))


def single_fin_and_body(tau: Any) -> np.ndarray:
    """Lift due to one fin (a sail) at incidence over that of the fin on a reflection plane.

    From the added mass of a circle with one fin, (1 + 6 tau + tau^2)/2 (theory 5.2); 1/2 without
    a hull, because the aspect ratio 2 h^2/S presumes a mirror.
    """
    t = np.asarray(tau, float)
    return 0.5 * (1.0 + 6.0 * t + t * t)


def single_fin_on_body(tau: Any) -> np.ndarray:
    """The share of `single_fin_and_body` that acts on the fin itself.

    Integral of the potential jump over the fin, 2 int sqrt((c - X)(X + 2R)) dy, X = y + R^2/y,
    c = s + R^2/s, from the Joukowski map of circle and fin to a slit. By the reciprocity of
    slender-body theory it is also the lift of fin and body when the fin alone is deflected.
    """
    t = np.asarray(tau, float)[..., None]
    y, weight = nodes_and_weights(np.concatenate([t, np.ones_like(t)], axis=-1), SINGLE_FIN_NODES)
    tip, place = 1.0 + t * t, y + t * t / np.maximum(y, SMALL * SMALL)  # lengths over s
    jump = np.sqrt(np.maximum((tip - place) * (place + 2.0 * t), 0.0))
    height = np.maximum(1.0 - t[..., 0], SMALL * SMALL)
    ratio = 2.0 * np.sum(jump * weight, axis=-1) / (0.5 * np.pi * height**2)
    return np.where(t[..., 0] > 1.0 - SMALL * SMALL, 2.0, ratio)
