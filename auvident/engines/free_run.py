"""The free-running prediction against the readings: residual, noise, likelihood.

One likelihood for the refinement of a plan, for the information and the scatter of any result, and
for the diagnosis. Errors are whitened by the noise of their channel: sensor noise, and a slow
disturbance where the residual shows one (`estimation.coloured`). The start of a record is no
coefficient: its best value is taken, its uncertainty counted.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.engines.prediction import (
    Frame,
    Free,
    Slopes,
    at_effects,
    readings,
    readings_with_slopes,
    seen_rows,
    simulated,
)
from auvident.engines.records import Record
from auvident.engines.setup import Setup, live_followers
from auvident.errors import NumericsError
from auvident.estimation.coloured import Colour, colour_of, whiten_channels
from auvident.estimation.output_error import Likelihood, correlation_time
from auvident.parallel import each
from auvident.physics.dynamics import N_STATES

Array = npt.NDArray[Any]
Colours = tuple[Colour, ...]

LONGEST_CORRELATION_S = 60.0  # lags beyond this are not looked at: longer than any transient
ESCAPED = 10.0  # [std of the channel] a prediction that ran away counts as this wrong
LARGEST = 1.0e20  # squared slopes in units of the noise beyond which a motion has run away
# In a fit the start is estimated along; the line through the readings that it begins from bends
# where the rudder is laid at once, hence so wide.
FITTED_START_STD = 30.0
NOTHING = np.zeros(0, dtype=np.int64)


def predicted(setup: Setup, parameters: Array, record: Record, active: Array) -> Array:
    """Readings (n, 4) predicted by free-running simulation of the active states."""
    acting = at_effects(setup.frame, parameters, record)
    states = simulated(setup.frame, parameters, acting, active)
    return readings(setup.frame, parameters, record, states)


def effective_noise(
    setup: Setup, parameters: Array, records: Sequence[Record], active: Array
) -> Array:
    """Standard deviation at which residuals of the current model count as independent.

    What a sensor's accuracy does not explain is the model's fault or the sea's: the rms of the
    residual takes the place of the sensor noise where it is larger. And a residual correlated
    over n samples says as little as one of n: times the square root of its correlation time.
    So a channel stirred by turbulence does not bend the coefficients to explain what is random,
    nor drown the prior, nor is it claimed as certainty afterwards.

    Returns
    -------
    (4,) array
        Effective standard deviation of each channel; the sensor's own where it is inactive.
    """
    longest = round(LONGEST_CORRELATION_S / setup.dt_s)
    power, times, count = np.zeros(N_STATES), np.zeros(N_STATES), np.zeros(N_STATES)
    for record in records:
        residual = record.measured - predicted(setup, parameters, record, active)
        for c in np.flatnonzero(active):
            seen = np.isfinite(record.measured[:, c])
            values = residual[seen, c]
            ran_away = ~np.isfinite(values)
            if ran_away.any():
                values[ran_away] = _spread(record, int(c))
            power[c] += float(values @ values)
            count[c] += values.size
            times[c] += values.size * correlation_time(values, longest)
    noise = setup.sensor_std.copy()
    used = count > 0
    rms = np.sqrt(power[used] / count[used])
    noise[used] = np.maximum(rms, noise[used]) * np.sqrt(times[used] / count[used])
    return noise


def _spread(record: Record, channel: int) -> float:
    """What a prediction that ran away counts as: far outside what was measured."""
    return ESCAPED * float(np.nanstd(record.measured[:, channel]))


def white(noise: Array) -> Colours:
    """Noise (4,) of the channels without any disturbance."""
    return tuple(Colour(float(std), 0.0, 1.0) for std in noise)


def coloured_noise(
    setup: Setup, parameters: Array, records: Sequence[Record], active: Array, colours: Colours
) -> Colours:
    """Most likely sensor noise and disturbance of each channel, from what the model leaves.

    The sensor's stated accuracy is the least of its noise. Inactive channels keep it.

    Parameters
    ----------
    colours : tuple of Colour
        Noise with which the starts are fitted.

    Raises
    ------
    NumericsError
        A prediction ran away: there is no residual.
    """
    moving, held = setup.free(NOTHING), start_information(active, colours)
    left = each(
        lambda r: left_over(setup.frame, parameters, r, active, colours, moving, held),
        records,
        len,
    )
    residuals = [residual[0] for residual in left if residual is not None]
    if len(residuals) < len(left):
        raise NumericsError(
            "the prediction diverges with the initial coefficients of the fit",
            remedy="Run the filter stages first, or check the priors and the mass properties.",
        )
    found = list(white(setup.sensor_std))
    for c in np.flatnonzero(active):
        colour, _ = colour_of([residual[:, c] for residual in residuals], setup.dt_s)
        found[c] = replace(colour, white=max(colour.white, float(setup.sensor_std[c])))
    return tuple(found)


def left_over(
    frame: Frame,
    p: Array,
    record: Record,
    active: Array,
    colours: Colours,
    moving: Free,
    held: Array,
) -> tuple[Array, Array] | None:
    """Measured minus predicted with the best start, and the predicted states.

    Parameters
    ----------
    moving : Free
        Of no parameter.
    held : (k, k) array
        See `record_parts`.

    Returns
    -------
    tuple of (n, 4) array and (n, 4) array, or None
        NaN where there is no reading; None where the prediction runs away.
    """
    found = white_slopes(frame, p, record, active, colours, moving)
    if found is None:
        return None
    slopes, seen, rows = found
    if not np.isfinite(rows).all() or np.abs(rows).max() > LARGEST**0.5:
        return None
    start = np.linalg.solve(rows[:, 1:].T @ rows[:, 1:] + held, rows[:, 1:].T @ rows[:, 0])
    error = np.where(seen, record.measured - slopes.readings, np.nan)
    error[:, active] += slopes.slopes[:, active][:, :, np.flatnonzero(active)] @ start
    return error, slopes.states


def white_rows(
    error: Array,
    slopes: Array,
    columns: Array,
    seen: Array,
    channels: Array,
    colours: Colours,
    dt_s: float,
) -> Array:
    """Whitened errors and slopes of some channels, one below the other.

    Parameters
    ----------
    error, seen : (n, 4) array
    slopes : (n, 4, k) array
    columns : (m,) int array
        Of the slopes.
    channels : (c,) int array
    colours : tuple of Colour
        Of every channel; those named are used.

    Returns
    -------
    (c n, 1 + m) array
        Column 0 is the error.
    """
    own = [colours[c] for c in channels]
    keep = np.array([math.exp(-dt_s / colour.time_s) for colour in own])
    still, slow = (np.array([getattr(c, part) for c in own]) for part in ("white", "slow"))
    out = np.empty((len(own) * len(error), 1 + len(columns)))
    whiten_channels(error, slopes, columns, seen, channels, keep, still, slow, out)
    return out


def white_slopes(
    frame: Frame,
    p: Array,
    record: Record,
    active: Array,
    colours: Colours,
    moving: Free,
    gain: Array | None = None,
) -> tuple[Slopes, Array, Array] | None:
    """Readings with slopes at p, which of them are seen, and both whitened; None: it runs away.

    Columns of the whitened: predicted minus measured, slopes by the active states of the start,
    by what moves.
    """
    found = readings_with_slopes(frame, p, record, active, moving, gain)
    if found is None:
        return None
    seen, channels = seen_rows(frame, p, record, active), np.flatnonzero(active)
    kept = np.concatenate([channels, N_STATES + np.arange(len(moving.positions))])
    error = found.readings - record.measured
    rows = white_rows(error, found.slopes, kept, seen, channels, colours, frame.dt_s)
    return found, seen, rows


def lost_readings(record: Record, seen: Array, channels: Array) -> int:
    """Readings that a prediction cannot be compared with, as a late sensor's first ones.

    A fit must not gain by losing them: each counts as what a reading is expected to cost.
    """
    return int((np.isfinite(record.measured[:, channels]) & ~seen[:, channels]).sum())


def record_parts(
    frame: Frame,
    p: Array,
    record: Record,
    active: Array,
    colours: Colours,
    moving: Free,
    held: Array,
    gain: Array | None = None,
) -> tuple[float, Array, Array] | None:
    """Half the squared error of a record, gradient and curvature, its start eliminated.

    Readings that are lost (`lost_readings`) count with their expected half each.

    Parameters
    ----------
    held : (k, k) array
        What is known of the k active states of the start beforehand, as an inverse covariance.

    Returns
    -------
    tuple of float, (n_free,) and (n_free, n_free) array, or None
        None where the prediction runs away.
    """
    found = white_slopes(frame, p, record, active, colours, moving, gain)
    if found is None:
        return None
    whole, k = found[2].T @ found[2], len(held)
    if not np.isfinite(whole).all() or np.abs(whole).max() > LARGEST:
        return None  # it ran away, but not far enough to be stopped
    g, h = whole[1:, 0], whole[1:, 1:]
    start = np.linalg.solve(h[:k, :k] + held, np.column_stack([g[:k], h[:k, k:]]))
    lost = lost_readings(record, found[1], np.flatnonzero(active))
    half = 0.5 * (float(whole[0, 0]) - float(g[:k] @ start[:, 0]) + lost)
    return half, g[k:] - h[k:, :k] @ start[:, 0], h[k:, k:] - h[k:, :k] @ start[:, 1:]


def start_information(active: Array, colours: Colours, stds: float = FITTED_START_STD) -> Array:
    """What is known of the active states of a start: so many standard deviations of the noise."""
    return np.diag([start_std(colours[c], stds) ** -2.0 for c in np.flatnonzero(active)])


def start_std(colour: Colour, stds: float) -> float:
    """How far the start of a record may be from the line through its readings."""
    return stds * math.hypot(colour.white, colour.slow)


def likelihood_of(
    setup: Setup,
    parameters: Array,
    free: Array,
    records: Sequence[Record],
    active: Array,
    colours: Colours,
) -> Likelihood:
    """Likelihood of the deviations from `parameters` for `estimation.output_error.fit`."""
    moving, held = setup.free(free), start_information(active, colours)

    def likelihood(theta: Array) -> tuple[float, Array, Array]:
        p = moved(setup, parameters, free, theta)
        return summed(
            each(
                lambda r: record_parts(setup.frame, p, r, active, colours, moving, held),
                records,
                len,
            ),
            len(free),
        )

    return likelihood


def summed(
    parts: Sequence[tuple[float, Array, Array] | None], n: int
) -> tuple[float, Array, Array]:
    """Sum over the records; infinite when one of them ran away."""
    half, gradient, curvature = 0.0, np.zeros(n), np.zeros((n, n))
    for part in parts:
        if part is None:
            return np.inf, gradient, curvature
        half += part[0]
        gradient += part[1]
        curvature += part[2]
    return half, gradient, 0.5 * (curvature + curvature.T)


def moved(setup: Setup, parameters: Array, free: Array, theta: Array) -> Array:
    """Parameters moved by theta prior standard deviations; followers move along."""
    p = parameters.copy()
    p[free] += setup.prior_std[free] * theta
    for follower, leader in live_followers(setup, free):
        p[follower] += p[leader] - parameters[leader]
    return p
