"""Identifying maneuvers left out in turn: does an effect help where it was not fitted?

The fit to the others begins at the fit to all; the maneuver left out is predicted by simulation.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import INDEPENDENT_S
from auvident.engines.free_run import (
    Colours,
    OutputError,
    RecordResidual,
    residual_of,
    white_error,
)
from auvident.engines.records import Record
from auvident.schema.effects import BY_ID
from auvident.stages.diagnose.fit.case import Case
from auvident.stages.diagnose.fit.fits import (
    N_CHANNELS,
    Fitted,
    fits_to_others,
    output_error,
    started,
)

Array = npt.NDArray[Any]

STEPS = 20  # of each fit without a maneuver, at most
MOST_FITS = 10  # of more maneuvers several are left out together, so that time grows with length
MOST_OF_BLOCK = 30.0  # [nats] a block of time counts for no more
# [nats] a maneuver that an effect changes by less says nothing about it: a steady turn hardly shows
# a late rudder (seed 1519: three zigzags gain 120 and more, three turns lose 3 to 6)
INDIFFERENT = 10.0
LEAST_TELLING = 2  # maneuvers: what one says is no evidence
LEAST_ERROR = 1.0e-9  # [nats] of a gain: less is none
LEAST_ABOVE = 0.05  # of the power of a residual, above the noise of its sensor, to be looked at


@dataclass(frozen=True)
class LeftOut:
    """A fit without each maneuver in turn.

    Attributes
    ----------
    parameters : (f, n_parameters) array
        Of the fits without one maneuver, or without several of many.
    blocks : list of (b,) array
        Squared innovations of each maneuver as predicted without it, summed over `INDEPENDENT_S`.
    power : (m, 3) array
        Squared errors of each of these predictions, summed by channel.
    excess : (m,) array
        What each of these predictions costs more than that of the fit to all [nats].
    """

    parameters: Array
    blocks: list[Array]
    power: Array
    excess: Array


@dataclass(frozen=True)
class FitsWithout:
    """Fits without each maneuver in turn of the models of a case, each made once.

    What a candidate was tried with is what the next round compares others with, and the scatter
    of the fits of the last model is part of how well its effects are known.
    """

    made: dict[tuple[object, ...], Array] = field(default_factory=dict)

    def of(self, case: Case, fitted: Fitted) -> Array:
        """Parameters (f, n_parameters), see `fits_without`."""
        at_work = fitted.parameters[[_is_at_work(name, fitted) for name in case.names]]
        key = (fitted.effects, fitted.colours, at_work.tobytes())
        if key not in self.made:
            self.made[key] = fits_without(case, fitted)
        return self.made[key]


def _is_at_work(name: str, fitted: Fitted) -> bool:
    """Whether it has a part in the model: the time of an effect that is absent has none."""
    effect, _, of_effect = name.partition(".")
    timed = bool(of_effect) and effect in BY_ID and BY_ID[effect].instant is not None
    return not timed or effect in fitted.effects


def leave_out(case: Case, fitted: Fitted, colours: Colours) -> LeftOut:
    """Predict each maneuver with a fit to others, begun at the fit to all."""
    return seen_with(case, fitted, fits_without(case, fitted), colours)


def fits_without(case: Case, fitted: Fitted) -> Array:
    """Parameters (f, n_parameters) of fits without one maneuver, or without several of many."""
    return np.array(fits_to_others(case, fitted, _groups(case), STEPS))


def seen_with(case: Case, fitted: Fitted, parameters: Array, colours: Colours) -> LeftOut:
    """What fits without each maneuver in turn predict of it, seen with some noise.

    Parameters
    ----------
    fitted : Fitted
        The fit to all maneuvers.
    parameters : (f, n_parameters) array
        Of the fits without some of them, see `fits_without`.
    colours : tuple of Colour
    """
    case = started(case, fitted)
    output = output_error(case, colours)
    by_record = {
        record.id: residual_of(output, at, record)
        for at, group in zip(map(output.at, parameters), _groups(case), strict=True)
        for record in group
    }
    found = [by_record[record.id] for record in case.records]
    # both starts of a record are found with this noise: that of the fit may be another by now
    here = output.at(fitted.parameters)
    with_all = [residual_of(output, here, record) for record in case.records]
    blocks, own = (
        [_blocks(output, r, record) for r, record in zip(residuals, case.records, strict=True)]
        for residuals in (found, with_all)
    )
    excess = [_more(b, o) for b, o in zip(blocks, own, strict=True)]
    return LeftOut(parameters, blocks, np.array([_power(r) for r in found]), np.array(excess))


def _groups(case: Case) -> list[tuple[Record, ...]]:
    """Maneuvers that are left out together."""
    return [case.records[k::MOST_FITS] for k in range(min(MOST_FITS, len(case.records)))]


def _more(blocks: Array, own: Array) -> float:
    """What a prediction costs more than that of the fit to all; infinite where it runs away."""
    return 0.5 * float(blocks.sum() - own.sum()) if np.isfinite(blocks).all() else np.inf


def _blocks(output: OutputError, found: RecordResidual | None, record: Record) -> Array:
    """Squared innovations in blocks of time; infinite where the prediction runs away."""
    n, dt_s = len(record.time_s), output.frame.dt_s
    number = (np.arange(n) * dt_s // INDEPENDENT_S).astype(np.int64)
    if found is None:
        return np.full(int(number[-1]) + 1, np.inf)
    white = white_error(found.error, output.colours, dt_s)
    lost = np.isfinite(record.measured) & ~np.isfinite(found.error)  # to no model's gain
    squares = np.sum(white[:, :N_CHANNELS] ** 2, axis=1) + lost[:, :N_CHANNELS].sum(axis=1)
    sums = np.zeros(int(number[-1]) + 1)
    np.add.at(sums, number, squares)
    return sums


def _power(found: RecordResidual | None) -> Array:
    """Squared errors (3,) of a prediction; infinite where it runs away."""
    if found is None:
        return np.full(N_CHANNELS, np.inf)
    return np.asarray(np.nansum(found.error[:, :N_CHANNELS] ** 2, axis=0))


@dataclass(frozen=True)
class Helped:
    """How much an effect helps the maneuvers that were left out.

    Attributes
    ----------
    gain : float
        Rise of their log-likelihood [nats].
    share : float
        Of the maneuvers that it helps.
    deciding : float
        Share as above of the maneuvers that it changes by more than `INDIFFERENT`; zero where
        there is none.
    t : float
        The gain in standard errors; see `t_value`.
    strength : float
        The same, fewer where other rules are not met; see `select.healthy`.
    explained : float
        Of the power of the residual above the noise of the sensor, the share that is explained,
        in the channel where that is most; see `explained_share`.
    """

    gain: float
    share: float
    deciding: float = 0.0
    t: float = 0.0
    explained: float = 0.0
    strength: float = 0.0


def helped(
    before: LeftOut,
    after: LeftOut,
    gain: float = np.inf,
    floor: Array | float = 0.0,
) -> Helped:
    """Compare two fits on the maneuvers left out, with one noise for both.

    Parameters
    ----------
    gain : float, optional
        Of the effect in the fit to all [nats], see `telling`.
    floor : (m, 3) array, optional
        Power that the noise of the sensors alone would have, see `noise_floor`.
    """
    gains = gains_told(before, after, gain)
    whole = np.concatenate(gains)
    sums = np.array([g.sum() for g in gains])
    decided = sums[np.abs(sums) > INDIFFERENT]
    deciding = float(np.mean(decided > 0.0)) if len(decided) else 0.0
    tell = telling(before, after, gain)
    least = np.broadcast_to(floor, before.power.shape)
    return Helped(
        float(whole.sum()),
        float(np.mean(sums > 0.0)),
        deciding,
        t_value(whole),
        explained_share(before.power[tell], after.power[tell], least[tell]),
    )


def telling(before: LeftOut, after: LeftOut, gain: float) -> npt.NDArray[np.bool_]:
    """Which maneuvers (m,), left out, say something about an effect: all, where one or none would.

    Without the only run that shows a coefficient the others predict it thousands of nats off, with
    an effect of 50 or without it (population, even seeds 3022, 5134 and 5252). What is off by more
    than the effect explains altogether is off for another reason, and which of the two fits is
    further off says nothing.
    """
    tells = np.minimum(before.excess, after.excess) <= gain
    return tells if tells.sum() >= LEAST_TELLING else np.ones_like(tells)


def gains_told(before: LeftOut, after: LeftOut, gain: float) -> list[Array]:
    """Gains as of `gains_of`, of the maneuvers that say something alone; see `telling`."""
    tell = telling(before, after, gain)
    return [g for g, tells in zip(gains_of(before, after), tell, strict=True) if tells]


def gains_of(before: LeftOut, after: LeftOut) -> list[Array]:
    """Gain of each block of time of each maneuver left out [nats]."""
    with np.errstate(invalid="ignore"):  # where both run away neither helps
        gains = [0.5 * (a - b) for a, b in zip(before.blocks, after.blocks, strict=True)]
    return [clipped(np.nan_to_num(g)) for g in gains]


def clipped(gains: Array) -> Array:
    """Gains of blocks so that one bad place of one maneuver decides nothing."""
    return np.clip(gains, -MOST_OF_BLOCK, MOST_OF_BLOCK)


def t_value(gains: Array) -> float:
    """Sum of gains (n,) over its standard error, were each as likely a loss; at most n**0.5.

    What a nat is worth cancels, so that it means the same in a short log and in a long one, with
    a quiet sensor and with a noisy one.
    """
    return float(gains.sum() / max(float(np.sqrt(gains @ gains)), LEAST_ERROR))


def readings_of(case: Case) -> Array:
    """Readings (m, 3) of each channel in each maneuver."""
    return np.array([np.isfinite(r.measured[:, :N_CHANNELS]).sum(axis=0) for r in case.records])


def noise_floor(case: Case, colours: Colours) -> Array:
    """Power (m, 3) that sensors alone leave of the readings: as stated, or as seen where less."""
    seen, stated = np.array([c.white for c in colours[:N_CHANNELS]]), case.setup.sensor_std
    return np.asarray(readings_of(case) * np.minimum(seen, stated[:N_CHANNELS]) ** 2)


def explained_share(before: Array, after: Array, floor: Array | float) -> float:
    """Share of the power above a floor that is explained, in the channel where it is most.

    A channel with hardly more than the noise of its sensor has nothing to be explained. A maneuver
    from which both predictions run away, or the one without the effect, shows no share; nothing is
    explained by an effect with which a prediction runs away that did not without it.

    Parameters
    ----------
    before, after, floor : (m, 3) array
        Of each maneuver.
    """
    stays, runs_away = np.isfinite(before).all(axis=1), ~np.isfinite(after).all(axis=1)
    if np.any(stays & runs_away):
        return 0.0
    old, new = before[stays].sum(axis=0), after[stays].sum(axis=0)
    above = old - np.broadcast_to(floor, before.shape)[stays].sum(axis=0)
    there = above > LEAST_ABOVE * old
    shares = (old - new)[there] / above[there]
    return float(shares.max(initial=0.0))
