"""Residual analysis: what predictions leave, by role and channel."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import ANSWER_S, INDEPENDENT_S
from auvident.engines.noise import LONGEST_CORRELATION_S
from auvident.engines.setup import active_states
from auvident.estimation.coloured import (
    NEGLIGIBLE,
    Colour,
    at_least,
    colour_of,
    colours_without_each,
    whitened,
)
from auvident.estimation.innovations import (
    consistency,
    cross_correlation,
    whiteness,
)
from auvident.schema.artifacts import (
    Autocorrelation,
    FittedNoise,
    InputCorrelation,
    NisTest,
    ResidualTests,
    Role,
    Theil,
)
from auvident.schema.planes import BY_PLANE, Plane

Array = npt.NDArray[Any]
LAG_DIGITS = 6  # of a second
Pieces = Sequence[Array]


@dataclass(frozen=True)
class Compared:
    """A maneuver measured and predicted.

    Attributes
    ----------
    role : str
    channels : mapping
        Measured (NaN: nothing was) and predicted (n,) by channel.
    inputs : mapping
        What acted on the vehicle (n,), by name.
    """

    role: Role
    channels: Mapping[str, tuple[Array, Array]]
    inputs: Mapping[str, Array]

    def error(self, channel: str) -> Array:
        """Measured minus predicted (n,)."""
        measured, predicted = self.channels[channel]
        return measured - predicted


def residuals_of(
    compared: Sequence[Compared], plane: Plane, dt_s: float, sensors: Mapping[str, float]
) -> dict[str, dict[str, ResidualTests]]:
    """Tests of what predictions leave, by role and channel.

    The noise of a channel, of the sensor and of a disturbance, is that of the identifying
    maneuvers: each of these is whitened with the noise of the others, held-out ones with that of
    all. Correlations with inputs are those of the residual itself.

    Parameters
    ----------
    compared : sequence of Compared
    plane : str
    dt_s : float
    sensors : mapping
        Standard deviation of the sensor of each channel, by column; the spread where unknown.
    """
    fitted = dict(zip(BY_PLANE[plane].states, active_states("coupled", plane), strict=True))
    known = [c for c in compared if c.role == "identify"]
    found: dict[str, dict[str, ResidualTests]] = {}
    for role in dict.fromkeys(c.role for c in compared):
        own = [c for c in compared if c.role == role]
        for state, is_fitted in fitted.items():
            share = theil([c.channels[state.symbol] for c in own])
            if share is not None:
                tests = {}
                if is_fitted:
                    read = np.concatenate([c.channels[state.symbol][0] for c in own])
                    least = NEGLIGIBLE * (sensors.get(state.column) or float(np.nanstd(read)))
                    tests = _tests(own, known or own, state.symbol, dt_s, least)
                found.setdefault(role, {})[state.symbol] = ResidualTests(theil=share, **tests)
    return found


def theil(pairs: Sequence[tuple[Array, Array]]) -> Theil | None:
    """Inequality coefficient and its shares (Theil 1966); None where nothing was measured.

    The mean squared error is that of the means, plus that of the standard deviations, plus
    2 (1 - correlation) times their product. Without an error all of it is covariance.

    Parameters
    ----------
    pairs : sequence of (measured (n,), predicted (n,))
    """
    m, s = (np.concatenate([pair[i] for pair in pairs]) for i in (0, 1))
    seen = np.isfinite(m) & np.isfinite(s)
    if not seen.any():
        return None
    m, s = m[seen], s[seen]
    square = float(np.mean((m - s) ** 2))
    size = float(np.sqrt(np.mean(m**2)) + np.sqrt(np.mean(s**2)))
    if square == 0.0:
        return Theil(coefficient=0.0, bias=0.0, variance=0.0, covariance=1.0)
    bias = float((m.mean() - s.mean()) ** 2) / square
    variance = float((m.std() - s.std()) ** 2) / square
    together = float(np.mean((m - m.mean()) * (s - s.mean())))
    return Theil(
        coefficient=square**0.5 / size,
        bias=bias,
        variance=variance,
        covariance=2.0 * (m.std() * s.std() - together) / square,
    )


def _tests(
    own: Sequence[Compared], known: Sequence[Compared], channel: str, dt_s: float, least: float
) -> dict[str, Any]:
    """Tests of a channel that the fit compares, over the maneuvers of a role."""
    left = [c.error(channel) for c in own]
    colour = at_least(colour_of([c.error(channel) for c in known], dt_s)[0], least)
    colours = [colour] * len(left)
    if known[0] is own[0]:
        colours = colours_without_each(left, dt_s, least)
    white = [whitened(e, c, dt_s) for e, c in zip(left, colours, strict=True)]
    return {
        "noise": _noise(colour),
        "nis": _nis(white, dt_s),
        "autocorrelation": _whiteness(white, dt_s),
        "inputs": {
            name: found
            for name in own[0].inputs
            if (found := _with_input(left, [c.inputs[name] for c in own], dt_s)) is not None
        },
    }


def _noise(colour: Colour) -> FittedNoise:
    return FittedNoise(white_std=colour.white, slow_std=colour.slow, slow_time_s=colour.time_s)


def _nis(white: Pieces, dt_s: float) -> NisTest | None:
    found = consistency(white, round(LONGEST_CORRELATION_S / dt_s), inflated=False)
    return None if found is None else NisTest(**found.as_told())


def _whiteness(white: Pieces, dt_s: float) -> Autocorrelation | None:
    found = whiteness(white, round(ANSWER_S / dt_s))
    if found is None:
        return None
    return Autocorrelation(
        largest=found.largest,
        lag_s=found.lag * dt_s,
        band=found.band,
        outside=found.outside,
        p=found.p,
        lags_s=tuple(round(lag * dt_s, LAG_DIGITS) for lag in found.lags),
        values=found.values,
    )


def _with_input(left: Pieces, given: Pieces, dt_s: float) -> InputCorrelation | None:
    found = cross_correlation(left, given, round(INDEPENDENT_S / dt_s))
    if found is None:
        return None
    return InputCorrelation(largest=found.largest, lag_s=found.lag * dt_s, band=found.band)
