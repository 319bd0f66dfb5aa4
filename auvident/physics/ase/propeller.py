"""Thrust coefficients from the open-water curve (theory 3.5)."""

from typing import Any

import numpy as np

from auvident.physics.ase.accuracy import Deviation
from auvident.schema.vehicle import Propeller


def thrust_line(propeller: Propeller) -> tuple[np.ndarray, np.ndarray]:
    """k_0 and k_1 of K_T = k_0 + k_1 J.

    A table is fitted by least squares over its points with K_T >= 0 (a propeller that drives).

    Parameters
    ----------
    propeller : Propeller

    Returns
    -------
    k_0, k_1 : ndarray
    """
    if propeller.table_j is None or propeller.table_kt is None:
        return np.asarray(propeller.kt0, float), np.asarray(propeller.kt1, float)
    advance, thrust = np.asarray(propeller.table_j, float), np.asarray(propeller.table_kt, float)
    drives = thrust >= 0.0
    if np.count_nonzero(drives) < 2:
        drives = np.ones_like(drives)
    slope, intercept = np.polyfit(advance[drives], thrust[drives], 1)
    return np.asarray(intercept), np.asarray(slope)


def thrust_coefficients(
    propeller: Propeller, density: Any, deviation: Deviation
) -> tuple[np.ndarray, np.ndarray]:
    """T_nn and T_nu of T = T_nn n|n| + T_nu |n| u, n in rev/s.

    Parameters
    ----------
    propeller : Propeller
    density : array_like
    deviation : Deviation

    Returns
    -------
    T_nn, T_nu : ndarray
        rho D^4 k_0 (1 - t) in kg m and rho D^3 k_1 (1 - w)(1 - t) in kg.
    """
    k_0, k_1 = thrust_line(propeller)
    given = propeller.model_fields_set
    wake = "wake_given" if "wake_fraction" in given else "wake_assumed"
    deduction = "deduction_given" if "thrust_deduction" in given else "deduction_assumed"
    rho, d = np.asarray(density, float), np.asarray(propeller.diameter_m, float)
    behind = (1.0 - np.asarray(propeller.thrust_deduction, float)) * deviation.scale(deduction)
    inflow = (1.0 - np.asarray(propeller.wake_fraction, float)) * deviation.scale(wake)
    line = k_0 * deviation.scale("thrust_line"), k_1 * deviation.scale("thrust_slope")
    return rho * d**4 * line[0] * behind, rho * d**3 * line[1] * inflow * behind
