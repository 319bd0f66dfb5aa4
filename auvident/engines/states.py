"""Smoothed states of a maneuver with the coefficients of a model."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import FILTER_START_STD
from auvident.engines.motion_pass import motion_pass
from auvident.engines.noise import LONGEST_CORRELATION_S
from auvident.engines.records import Record
from auvident.estimation.output_error import correlation_time
from auvident.estimation.smoother import smooth
from auvident.physics.dynamics import N_STATES, simulate_states
from auvident.physics.terms import Structure

Array = npt.NDArray[Any]

UNSEEN_ERRORS = 2.0  # standard errors of the mean square of a residual
LEAST_FORCING = 0.05  # process noise of a channel the model explains, in sensor std per root second


@dataclass(frozen=True)
class States:
    """Smoothed states (n, 4) and their standard deviations; inactive ones are as given.

    Active ones are NaN where the model runs away from the readings.
    """

    mean: Array
    std: Array


def smoothed_states(
    structure: Structure,
    p: Array,
    record: Record,
    active: Array,
    sensor: Array,
    sensor_std: Array,
    dt_s: float,
) -> States:
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
    passed = motion_pass(
        record.start[index],
        np.diag((FILTER_START_STD * sensor_std[index]) ** 2),
        record.inputs,
        record.given,
        np.where(active, record.measured, np.nan),
        sensor,
        sensor_std**2,
        forcing[index] ** 2 * dt_s,
        dt_s,
        p,
        active,
        structure.equations,
    )
    mean, std = record.given.copy(), np.zeros((len(record.time_s), N_STATES))
    mean[:, index], std[:, index] = np.nan, np.nan
    if passed is not None:
        found = smooth(*passed)
        mean[:, index] = found.mean
        std[:, index] = np.sqrt(np.einsum("kii->ki", found.covariance))
    return States(mean, std)


def forcing_std(
    structure: Structure,
    p: Array,
    record: Record,
    active: Array,
    sensor: Array,
    sensor_std: Array,
    dt_s: float,
) -> Array:
    """Process noise (4,) per root second that would leave residuals like those found.

    A velocity that forgets within a time tau and is driven by white noise of intensity q has the
    variance s^2 = q^2 tau / 2 and a correlation time of 2 tau, both sides together. Beside white
    sensor noise of the variance n^2 that of the sum is shorter: 2 tau = T (s^2 + n^2) / s^2.
    Less than `UNSEEN_ERRORS` may be there unseen.
    """
    states = simulate_states(
        record.start, record.inputs, record.given, dt_s, p, active, structure.equations
    )
    residual = record.measured - states @ sensor.T
    forcing = LEAST_FORCING * sensor_std
    for c in np.flatnonzero(active):
        values = residual[np.isfinite(residual[:, c]), c]
        if values.size:
            both_sides = correlation_time(values, round(LONGEST_CORRELATION_S / dt_s))
            power = float(np.mean(values**2))
            least = UNSEEN_ERRORS * power * np.sqrt(2.0 * both_sides / values.size)
            slow = max(power - sensor_std[c] ** 2, least)
            if slow > 0.0:
                forcing[c] = max(forcing[c], 2.0 * slow / np.sqrt(both_sides * dt_s * power))
    return forcing
