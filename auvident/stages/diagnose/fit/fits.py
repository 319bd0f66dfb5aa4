"""Fits of the free-running prediction with chosen effects, and what they leave.

The residual of a channel is taken for sensor noise and a slow disturbance (`estimation.coloured`),
both as large as the residual itself says; a fit runs in rounds of fixed noise, brought up to date
in between.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import DIAGNOSED_START_STD
from auvident.engines import free_run
from auvident.engines.free_run import NOTHING, Colours
from auvident.engines.prediction import Free, Slopes
from auvident.engines.records import Record
from auvident.errors import NumericsError
from auvident.estimation.coloured import Colour, colour_of, whiten
from auvident.estimation.output_error import fit
from auvident.parallel import each
from auvident.stages.diagnose.fit.case import ACTIVE, SILENT_REACH, Case

Array = npt.NDArray[Any]

N_CHANNELS = 3
N_START = 3  # active states whose start is fitted along
ROUNDS, STEPS = 2, 8  # rounds of fixed weights, steps in each
TOLERANCE = 1.0e-4  # relative fall of the cost at which a round ends


@dataclass(frozen=True)
class Residual:
    """What a prediction with fitted starts leaves of one record.

    Attributes
    ----------
    id : str
    time_s : (n,) array
    error : (n, 4) array
        Measured minus predicted; NaN where there is no reading.
    states : (n, 4) array
    """

    id: str
    time_s: Array
    error: Array
    states: Array


@dataclass(frozen=True)
class Fitted:
    """A fitted prediction.

    Attributes
    ----------
    effects : tuple of str
        Effects that were free, beside coefficients and silent allowances.
    parameters : (n_parameters,) array
    free : (n_free,) int array
    residuals : tuple of Residual
    colours : tuple of Colour
        Noise of each channel with this model.
    log_likelihood : float
        Of the readings with these colours, and of the sensor checks.
    rms : (3,) array
        Root mean square of the residual.
    """

    effects: tuple[str, ...]
    parameters: Array
    free: npt.NDArray[np.int64]
    residuals: tuple[Residual, ...]
    colours: Colours
    log_likelihood: float
    rms: Array


def residual_of(case: Case, p: Array, record: Record, colours: Colours) -> Residual | None:
    """What the prediction leaves of a record, its start fitted; None where it runs away."""
    held = free_run.start_information(ACTIVE, colours, DIAGNOSED_START_STD)
    found = free_run.left_over(
        case.setup.frame, p, record, ACTIVE, colours, case.setup.free(NOTHING), held
    )
    return None if found is None else Residual(record.id, record.time_s, *found)


def white_slopes(
    case: Case, p: Array, record: Record, colours: Colours, moving: Free, gain: Array | None = None
) -> tuple[Slopes, Array, Array] | None:
    """`free_run.white_slopes` of a record of the case."""
    return free_run.white_slopes(case.setup.frame, p, record, ACTIVE, colours, moving, gain)


def white_error(error: Array, colours: Colours, dt_s: float) -> Array:
    """Whitened errors (n, 3); zero where there is no reading."""
    seen = np.isfinite(error)
    out = np.zeros((len(error), N_CHANNELS))
    for c, colour in enumerate(colours):
        block = np.nan_to_num(error[:, c : c + 1])
        whiten(block, seen[:, c], math.exp(-dt_s / colour.time_s), colour.white, colour.slow)
        out[:, c] = block[:, 0]
    return out


def residuals_of(case: Case, p: Array, colours: Colours) -> tuple[Residual, ...] | None:
    """Residuals of all records; None where one runs away."""
    found = each(lambda record: residual_of(case, p, record, colours), case.records, len)
    return None if any(r is None for r in found) else tuple(found)  # type: ignore[arg-type]


def colours_of(case: Case, residuals: Sequence[Residual]) -> tuple[Colours, float, Array]:
    """Noise of each channel, the log-likelihood with it, and the rms of the residuals (3,).

    A reading that a late sensor shows from before its record counts as the others of its channel
    do, so that models with other delays are compared by the same number of readings.
    """
    pieces = [[r.error[:, c] for r in residuals] for c in range(N_CHANNELS)]
    found = each(lambda own: colour_of(own, case.setup.dt_s), pieces)
    total = 0.0
    for c, (_, value) in enumerate(found):
        there = sum(int(np.isfinite(record.measured[:, c]).sum()) for record in case.records)
        seen = sum(int(np.isfinite(piece).sum()) for piece in pieces[c])
        total += value * there / max(seen, 1)
    rms = np.array([np.sqrt(np.nanmean(np.concatenate(own) ** 2)) for own in pieces])
    return tuple(colour for colour, _ in found), total, rms


def first_colours(case: Case, p: Array) -> Colours:
    """Noise with a model that nothing is known of yet."""
    sensors = tuple(Colour(std, 10.0 * std, 4.0) for std in case.setup.sensor_std[:N_CHANNELS])
    found = residuals_of(case, p, sensors)
    return sensors if found is None else colours_of(case, found)[0]


def prior_of(case: Case, free: Array, open_: Sequence[int]) -> tuple[Array, Array, Array, Array]:
    """Mean, information and bounds of the free parameters, in units of their prior.

    Silent allowances are tight unless their effect is open (a candidate or accepted). What the
    sensors say about each other counts like a prior.
    """
    scale = case.setup.prior_std[free]
    away, tight = case.setup.prior[free] / scale, np.ones(len(free))
    low, high = case.low[free] / scale, case.high[free] / scale
    for k, i in enumerate(free):
        if case.silent[i] > 0.0 and i not in open_:
            tight[k] = case.silent[i] / scale[k]
            low[k] = max(low[k], away[k] - SILENT_REACH * tight[k])
            high[k] = min(high[k], away[k] + SILENT_REACH * tight[k])
    information = np.diag(tight**-2.0)
    moment = information @ away
    for matrix, vector in _checked(case, free):
        information = information + matrix
        moment = moment + vector
    return np.linalg.solve(information, moment), information, low, high


def _checked(case: Case, free: Array) -> list[tuple[Array, Array]]:
    """Information of the sensor checks on the free parameters, the others being zero."""
    found = []
    for check in case.checks:
        rows = [
            (k, int(np.flatnonzero(free == case.position(name))[0]))
            for k, name in enumerate(check.names)
            if case.position(name) in free
        ]
        if not rows:
            continue
        inverse = np.linalg.inv(check.covariance)
        own, place = [k for k, _ in rows], [c for _, c in rows]
        select = np.zeros((len(own), len(free)))
        select[np.arange(len(own)), place] = case.setup.prior_std[free][place]
        found.append(
            (
                select.T @ inverse[np.ix_(own, own)] @ select,
                select.T @ (inverse @ check.mean)[own],
            )
        )
    return found


def check_cost(case: Case, p: Array) -> float:
    """Half the squared distance of the sensors' parameters from what the checks say."""
    total = 0.0
    for check in case.checks:
        away = np.array([p[case.position(name)] for name in check.names]) - check.mean
        total += 0.5 * float(away @ np.linalg.solve(check.covariance, away))
    return total


def free_positions(case: Case, effects: Sequence[str]) -> Array:
    """Positions of all that a fit with these effects frees."""
    extra = [i for effect in effects for i in case.positions(effect)]
    return np.array(sorted({*case.baseline(), *extra}), dtype=np.int64)


def open_positions(case: Case, effects: Sequence[str]) -> list[int]:
    """Positions of the parameters of effects."""
    return [i for effect in effects for i in case.positions(effect)]


def fit_with(
    case: Case,
    effects: Sequence[str],
    start: Array,
    colours: Colours,
    *,
    rounds: int = ROUNDS,
    steps: int = STEPS,
    gain: Array | None = None,
) -> Fitted | None:
    """Fit coefficients, silent allowances and effects; None where it runs away from the start."""
    free = free_positions(case, effects)
    mean, information, low, high = prior_of(case, free, open_positions(case, effects))
    scale, p = case.setup.prior_std[free], start.copy()
    best: Fitted | None = None
    for _ in range(rounds):
        theta = np.clip(p[free] / scale, low, high)
        p[free] = theta * scale
        try:
            result = fit(
                _likelihood(case, p, free, colours, gain),
                theta,
                mean,
                information,
                (low, high),
                steps,
                TOLERANCE,
            )
        except NumericsError:
            break
        p = p.copy()
        p[free] = result.theta * scale
        found = residuals_of(case, p, colours)
        if found is None:
            break
        colours, log_likelihood, rms = colours_of(case, found)
        log_likelihood -= check_cost(case, p)
        best = Fitted(tuple(effects), p, free, found, colours, log_likelihood, rms)
    return best


def _likelihood(case: Case, p: Array, free: Array, colours: Colours, gain: Array | None) -> Any:
    """Likelihood of `estimation.output_error.fit` in absolute units of the prior."""
    moving = case.setup.free(free)

    def likelihood(theta: Array) -> tuple[float, Array, Array]:
        q = p.copy()
        q[free] = theta * moving.scale
        parts = each(lambda r: record_parts(case, q, r, colours, moving, gain), case.records, len)
        return free_run.summed(parts, len(free))

    return likelihood


def record_parts(
    case: Case, p: Array, record: Record, colours: Colours, moving: Any, gain: Array | None = None
) -> tuple[float, Array, Array] | None:
    """Half the squared error of a record, gradient and curvature, its start eliminated."""
    held = free_run.start_information(ACTIVE, colours, DIAGNOSED_START_STD)
    return free_run.record_parts(case.setup.frame, p, record, ACTIVE, colours, moving, held, gain)


def log_gain(before: Fitted, after: Fitted) -> float:
    """Rise of the log-likelihood from one fit to another, in nats."""
    return after.log_likelihood - before.log_likelihood
