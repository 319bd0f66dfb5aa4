"""The noise of each channel, as large as what a prediction leaves says."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import VehicleTime
from auvident.engines.free_run import (
    Colours,
    OutputError,
    RecordResidual,
    predicted,
    residuals_of,
)
from auvident.engines.records import Record
from auvident.errors import NumericsError
from auvident.estimation.coloured import Colour, at_least, colour_of
from auvident.estimation.output_error import correlation_time
from auvident.parallel import each
from auvident.physics.dynamics import N_STATES

Array = npt.NDArray[Any]

# lags beyond this are not looked at: longer than any transient
LONGEST_CORRELATION_S: VehicleTime = 60.0
ESCAPED = 10.0  # [std of the channel] a prediction that ran away counts as this wrong


@dataclass(frozen=True)
class Noise:
    """Noise of the channels with a model, and what it was found from.

    Attributes
    ----------
    colours : tuple of Colour
    residuals : tuple of RecordResidual
        Empty where the noise was not found from them.
    log_likelihood : float
        Of the residuals with these colours, parameters that are fitted included.
    rms : (c,) array
        Root mean square of the residuals.
    """

    colours: Colours
    residuals: tuple[RecordResidual, ...] = ()
    log_likelihood: float = np.nan
    rms: Array | None = None


def white(stds: Array) -> Colours:
    """Noise (4,) of the channels without any disturbance."""
    return tuple(Colour(float(std), 0.0, 1.0) for std in stds)


def effective_noise(output: OutputError, p: Array, sensor_std: Array) -> Array:
    """Standard deviation at which residuals of the current model count as independent.

    What a sensor's accuracy does not explain is the model's fault or the sea's: the rms of the
    residual takes the place of the sensor noise where it is larger. And a residual correlated
    over n samples says as little as one of n: times the square root of its correlation time.
    So a channel stirred by turbulence does not bend the coefficients to explain what is random,
    nor drown the prior, nor is it claimed as certainty afterwards. Records are predicted from
    where they begin.

    Returns
    -------
    (4,) array
        Effective standard deviation of each channel; the sensor's own where it is inactive.
    """
    longest = round(LONGEST_CORRELATION_S / output.frame.dt_s)
    power, times, count = np.zeros(N_STATES), np.zeros(N_STATES), np.zeros(N_STATES)
    for record in output.records:
        residual = record.measured - predicted(output.frame, p, record, output.active)
        for c in output.channels:
            values = _with_escapes(record, int(c), residual)
            power[c] += float(values @ values)
            count[c] += values.size
            times[c] += values.size * correlation_time(values, longest)
    noise = sensor_std.copy()
    used = count > 0
    rms = np.sqrt(power[used] / count[used])
    noise[used] = np.maximum(rms, noise[used]) * np.sqrt(times[used] / count[used])
    return noise


def _with_escapes(record: Record, channel: int, residual: Array) -> Array:
    """Residual of the readings of a channel, far outside of them where the prediction ran away."""
    read = record.measured[:, channel]
    values = residual[np.isfinite(read), channel]
    ran_away = ~np.isfinite(values)
    if ran_away.any():
        values[ran_away] = ESCAPED * float(np.nanstd(read))
    return values


def coloured_noise(output: OutputError, p: Array, sensor_std: Array) -> Colours:
    """Most likely sensor noise and disturbance of each channel, from what the model leaves.

    The sensor's stated accuracy is the least of its noise. Inactive channels keep it.

    Parameters
    ----------
    output : OutputError
        With the noise with which the starts are fitted.
    p : (n_parameters,) array
    sensor_std : (4,) array

    Raises
    ------
    NumericsError
        A prediction ran away: there is no residual.
    """
    residuals = residuals_or_raise(output, p)
    found = list(white(sensor_std))
    for c, (colour, _) in zip(
        output.channels,
        most_likely_colours(residuals, output.channels, output.frame.dt_s),
        strict=True,
    ):
        found[c] = at_least(colour, float(sensor_std[c]))
    return tuple(found)


def residuals_or_raise(output: OutputError, p: Array) -> tuple[RecordResidual, ...]:
    """Residuals of all records.

    Raises
    ------
    NumericsError
        A prediction ran away: there is no residual.
    """
    residuals = residuals_of(output, p)
    if residuals is None:
        raise NumericsError(
            "the prediction diverges with the initial coefficients of the fit",
            remedy="Run the filter stages first, or check the priors and the mass properties.",
        )
    return residuals


def most_likely_colours(
    residuals: Sequence[RecordResidual], channels: Sequence[int] | Array, dt_s: float
) -> list[tuple[Colour, float]]:
    """Most likely noise of some channels, and the log-likelihood of each with it."""
    return each(lambda c: colour_of([r.error[:, c] for r in residuals], dt_s), channels)
