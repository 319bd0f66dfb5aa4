"""Fits of the free-running prediction with chosen effects, and what they leave.

The fit is that of `engines.map_fit`. Here is what it takes in a diagnosis: the prior, with nuisance
parameters and sensor checks; the noise, which a few rounds bring up to date; and what of the
likelihood is compared between models.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import DIAGNOSED_START_STD
from auvident.engines.free_run import (
    Colours,
    OutputError,
    RecordResidual,
    beginning_at,
    knowing,
    residuals_of,
    well_started,
)
from auvident.engines.map_fit import Estimate, NoisePolicy, Prior, beginning, map_fit, map_rounds
from auvident.engines.noise import Noise, most_likely_colours, residuals_or_raise
from auvident.engines.records import Record
from auvident.errors import NumericsError
from auvident.estimation.coloured import TIMES_S, Colour
from auvident.parallel import each
from auvident.stages.diagnose.fit.case import ACTIVE, NUISANCE_REACH, Case

Array = npt.NDArray[Any]

N_CHANNELS = 3
ROUNDS, STEPS = 2, 8  # rounds of fixed weights, steps in each
TOLERANCE = 1.0e-4  # relative fall of the cost at which a round ends
NOISE_SETTLED = 0.01  # relative change of the noise below which another round changes nothing
# [noise of the sensor] a disturbance as slow as any, where nothing is known of what a model leaves
FIRST_SLOW = 10.0


@dataclass(frozen=True, kw_only=True)
class Fitted(Estimate):
    """A fitted prediction; its log-likelihood is that of readings and sensor checks.

    Attributes
    ----------
    effects : tuple of str
        Effects that were free, beside coefficients and nuisance parameters.
    residuals : tuple of RecordResidual
    rms : (3,) array
        Root mean square of the residual.
    """

    effects: tuple[str, ...]
    residuals: tuple[RecordResidual, ...]
    rms: Array


def output_error(case: Case, colours: Colours, gain: Array | None = None) -> OutputError:
    """The likelihood of a case with a noise; for `gain` see `OutputError`."""
    return OutputError(case.setup.frame, case.records, ACTIVE, colours, DIAGNOSED_START_STD, gain)


def noise_of(case: Case, residuals: Sequence[RecordResidual]) -> Noise:
    """Noise of each channel as residuals say, and how likely they are with it.

    A reading that a late sensor shows from before its record counts as the others of its channel
    do, so that models with other delays are compared by the same number of readings.
    """
    found = most_likely_colours(residuals, range(N_CHANNELS), case.setup.dt_s)
    total, rms = 0.0, np.empty(N_CHANNELS)
    for c, (_, value) in enumerate(found):
        there = sum(int(np.isfinite(record.measured[:, c]).sum()) for record in case.records)
        errors = np.concatenate([r.error[:, c] for r in residuals])
        total += value * there / max(int(np.isfinite(errors).sum()), 1)
        rms[c] = np.sqrt(np.nanmean(errors**2))
    return Noise(tuple(colour for colour, _ in found), tuple(residuals), total, rms)


def first_colours(case: Case, p: Array) -> Colours:
    """Noise with a model that nothing is known of yet."""
    stds = case.setup.sensor_std[:N_CHANNELS]
    sensors = tuple(Colour(std, FIRST_SLOW * std, TIMES_S[-1]) for std in stds)
    found = residuals_of(output_error(case, sensors), p)
    return sensors if found is None else noise_of(case, found).colours


def prior_of(case: Case, free: Array, open_: Sequence[int]) -> Prior:
    """Prior of the free parameters.

    Nuisance parameters are tight unless their effect is open (a candidate or accepted). What the
    sensors say about each other counts like a prior.
    """
    scale = case.setup.prior_std[free]
    mean, tight = case.setup.prior[free] / scale, np.ones(len(free))
    nuisance = (case.nuisance_std[free] > 0.0) & ~np.isin(free, open_)
    tight[nuisance] = (case.nuisance_std[free] / scale)[nuisance]
    reach = np.where(nuisance, NUISANCE_REACH * tight, np.inf)
    information = case.setup.prior_information(free, tight)
    moment = information @ mean
    for matrix, vector in _checked(case, free):
        information = information + matrix
        moment = moment + vector
    return Prior(
        np.linalg.solve(information, moment),
        information,
        np.maximum(case.low[free] / scale, mean - reach),
        np.minimum(case.high[free] / scale, mean + reach),
        constraints=case.setup.constraints,
    )


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


def fit_with(
    case: Case,
    effects: Sequence[str],
    start: Array,
    colours: Colours,
    *,
    rounds: int = ROUNDS,
    steps: int = STEPS,
    ceiling: float = np.inf,
) -> Fitted | None:
    """Fit coefficients, nuisance parameters and effects.

    None where it runs away from the start, or is given up there (see `NoisePolicy`).
    """

    def left(output: OutputError, p: Array) -> Noise:
        return noise_of(case, residuals_or_raise(output, p))

    free = case.setup.free(case.with_baseline(effects))
    prior = prior_of(case, free.positions, case.positions(*effects))
    policy, best = NoisePolicy(left, rounds, NOISE_SETTLED, steps, TOLERANCE, ceiling), None
    with suppress(NumericsError):  # the rounds before it stand
        for done in map_rounds(output_error(case, colours), free, lambda _: prior, start, policy):
            best = done
    return None if best is None else fitted_of(case, effects, best.parameters, best.noise)


def started(case: Case, fitted: Fitted) -> Case:
    """The case with each record begun where a fit predicts it best (`free_run.well_started`)."""
    moved = {residual.id: residual.moved for residual in fitted.residuals}
    begun = tuple(beginning_at(record, moved[record.id]) for record in case.records)
    output = replace(output_error(case, fitted.colours), records=begun)
    return replace(case, records=well_started(output, fitted.parameters).records)


def fits_to_others(
    case: Case, fitted: Fitted, groups: Sequence[Sequence[Record]], steps: int
) -> list[Array]:
    """Parameters (n_parameters,) fitted to all maneuvers but those of each group, noise held.

    Each fit begins at the fit to all, and stays there where it runs away.
    """
    free = case.setup.free(case.with_baseline(fitted.effects))
    prior = prior_of(case, free.positions, case.positions(*fitted.effects))
    whole = output_error(started(case, fitted), fitted.colours)
    whole = knowing(whole, beginning(free, prior, fitted.parameters), free)

    def without(group: Sequence[Record]) -> Array:
        out = {record.id for record in group}
        rest = replace(whole, records=tuple(r for r in whole.records if r.id not in out))
        with suppress(NumericsError):
            return map_fit(rest, free, prior, fitted.parameters, steps, TOLERANCE)[0]
        return fitted.parameters

    return each(without, groups)


def fitted_of(case: Case, effects: Sequence[str], p: Array, noise: Noise) -> Fitted:
    """A fit that ended at some parameters, with the noise that they leave."""
    assert noise.rms is not None  # `noise_of` found it
    return Fitted(
        parameters=p,
        free=case.with_baseline(effects),
        colours=noise.colours,
        log_likelihood=noise.log_likelihood - check_cost(case, p),
        effects=tuple(effects),
        residuals=noise.residuals,
        rms=noise.rms,
    )


def log_gain(before: Fitted, after: Fitted) -> float:
    """Rise of the log-likelihood from one fit to another, in nats."""
    return after.log_likelihood - before.log_likelihood
