"""Smoothed states of a maneuver with the coefficients of a model."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.engines.estimator import START_STD
from auvident.engines.free_run import LONGEST_CORRELATION_S
from auvident.engines.records import Record
from auvident.estimation.output_error import correlation_time
from auvident.estimation.smoother import smooth
from auvident.physics.dynamics import (
    N_STATES,
    inverse_mass,
    simulate_states,
    step_with_sensitivities,
)
from auvident.physics.term_tables import N_INPUTS
from auvident.physics.terms import Structure

Array = npt.NDArray[Any]

LEAST_FORCING = 0.05  # process noise of a channel the model explains, in sensor std per root second


@dataclass(frozen=True)
class States:
    """Smoothed states (n, 4) and their standard deviations; inactive ones are as given."""

    mean: Array
    std: Array


def smoothed_states(
    structure: Structure, p: Array, record: Record, active: Array, sensor: Array,
    sensor_std: Array, dt_s: float,
) -> States:  # fmt: skip
    """States of one maneuver given all its readings and a model.

    Parameters
    ----------
    structure, p : Structure, (n_parameters,) array
    record : Record
    active : (4,) bool array
        States that are estimated.
    sensor : (4, 4) array
        Reading = sensor @ state.
    sensor_std : (4,) array
        Noise of each channel.
    dt_s : float
    """
    forcing = forcing_std(structure, p, record, active, sensor, sensor_std, dt_s)
    index = np.flatnonzero(active)
    inverse = np.empty((3, 3))
    inverse_mass(p, structure.mass, structure.mass_weights, active, inverse)
    x, covariance = record.start[index].copy(), np.diag((START_STD * sensor_std[index]) ** 2)
    n, m = len(record.time_s), len(index)
    after, before = (np.zeros((n, m)), np.zeros((n, m, m))), (np.zeros((n, m)), np.zeros((n, m, m)))
    transition = np.zeros((n, m, m))
    no_slopes, no_columns = np.zeros((N_INPUTS, 0)), np.zeros(0, dtype=np.int64)
    column = np.full(len(p), -1, dtype=np.int64)
    for k in range(n):
        before[0][k], before[1][k] = x, covariance
        x, covariance = _update(x, covariance, record, k, index, sensor, sensor_std)
        after[0][k], after[1][k] = x, covariance
        if k == n - 1:
            break
        full, out = record.given[k].copy(), np.empty(N_STATES)
        full[index] = x
        s_x = np.eye(N_STATES)
        step_with_sensitivities(
            full, record.inputs[k], record.given[k], record.given[k + 1], dt_s, p, inverse,
            active, *structure.arrays, column, no_slopes, no_columns, s_x, out,
        )  # fmt: skip
        transition[k] = s_x[np.ix_(index, index)]
        x = out[index]
        covariance = transition[k] @ covariance @ transition[k].T
        covariance += np.diag(forcing[index] ** 2 * dt_s)
    found = smooth(after[0], after[1], before[0], before[1], transition)
    mean, std = record.given.copy(), np.zeros((n, N_STATES))
    mean[:, index] = found.mean
    std[:, index] = np.sqrt(np.einsum("kii->ki", found.covariance))
    return States(mean, std)


def _update(
    x: Array, covariance: Array, record: Record, k: int, index: Array, sensor: Array,
    sensor_std: Array,
) -> tuple[Array, Array]:  # fmt: skip
    """Kalman update (Joseph form) with the readings there are at row k."""
    seen = index[np.isfinite(record.measured[k, index])]
    if not seen.size:
        return x, covariance
    full = record.given[k].copy()
    full[index] = x
    h = sensor[seen][:, index]
    noise = np.diag(sensor_std[seen] ** 2)
    gain = np.linalg.solve(h @ covariance @ h.T + noise, h @ covariance).T
    left = np.eye(len(index)) - gain @ h
    x = x + gain @ (record.measured[k, seen] - sensor[seen] @ full)
    return x, left @ covariance @ left.T + gain @ noise @ gain.T


def forcing_std(
    structure: Structure, p: Array, record: Record, active: Array, sensor: Array,
    sensor_std: Array, dt_s: float,
) -> Array:  # fmt: skip
    """Process noise (4,) per root second that would leave residuals like those found.

    A residual of rms s and correlation time T comes from white forcing of s sqrt(2 / T).
    """
    states = simulate_states(
        record.start, record.inputs, record.given, dt_s, p, active, *structure.arrays
    )
    residual = record.measured - states @ sensor.T
    forcing = LEAST_FORCING * sensor_std
    for c in np.flatnonzero(active):
        values = residual[np.isfinite(residual[:, c]), c]
        if values.size:
            correlation = correlation_time(values, round(LONGEST_CORRELATION_S / dt_s)) * dt_s
            excess = max(float(np.mean(values**2)) - sensor_std[c] ** 2, 0.0)
            forcing[c] = max(forcing[c], np.sqrt(2.0 * excess / correlation))
    return forcing
