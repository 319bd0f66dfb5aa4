"""Errors of two models in the identifying maneuvers, each left out in turn, side by side."""

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.engines.jackknife import LEAST_MANEUVERS
from auvident.schema.artifacts import LeftOutManeuver, LeftOutSummary
from auvident.schema.diagnosis import Attempt, CrossValidated
from auvident.schema.mattering import share_that_matters
from auvident.schema.planes import PLANE_ROWS, STATES

Array = npt.NDArray[np.float64]

VELOCITIES = {symbol for row in PLANE_ROWS for symbol in row.velocities}
CHANNELS = tuple(s.symbol for s in STATES if s.symbol in VELOCITIES)  # of either plane
RISE = 0.02  # share by which an error rises before it is said to: as in the study of the loop
# A channel that rises by more than this, beyond chance, refuses a model unless what the others
# gain outweighs it beyond chance as well.
MUCH = 0.10
SURELY = 2.0  # standard errors of the balance beyond which a model is surely the better one
# ... and the error over that of the model before with which a channel is clearly predicted better.
# Healthy hulls have damping of other forms: of 39 (even seeds from 62200 on) five end with an
# effect in doubt, of which four take little off, or not surely.
CLEARLY = 0.75
LEAST_SQUARE = 1.0e-18  # least mean square error to compare with


@dataclass(frozen=True)
class LeftOutChange:
    """Change of the left-out errors, paired by maneuver and channel.

    Attributes
    ----------
    log_ratios : dict of str to float
        Logarithm of the error after over the one before, by channel, pooled over maneuvers.
    standard_errors : dict of str to float
        Of these, by a jackknife over maneuvers.
    balance, balance_se : float
        Mean over the maneuvers of the logarithm of the ratio in each, itself the mean over its
        channels; and the standard error of that mean.
    ran_away : bool
        A maneuver left out is lost that the model before predicts.
    """

    log_ratios: dict[str, float]
    standard_errors: dict[str, float]
    balance: float
    balance_se: float
    ran_away: bool = False

    @property
    def ratios(self) -> dict[str, float]:
        """Error after over error before, by channel."""
        return {c: math.exp(value) for c, value in self.log_ratios.items()}

    def rising(self, share: float = RISE) -> tuple[str, ...]:
        """Channels whose error rises by more than a share, and beyond its standard error."""
        least = math.log1p(share)
        se = self.standard_errors
        return tuple(c for c, rise in self.log_ratios.items() if rise > max(least, se[c]))

    @property
    def falls(self) -> bool:
        """Whether the errors fall beyond the standard error of their balance."""
        return self.balance + self.balance_se < 0.0

    @property
    def is_undecided(self) -> bool:
        """Whether the balance is within its standard error: the errors of the fit decide then."""
        return abs(self.balance) <= self.balance_se

    @property
    def is_larger(self) -> bool:
        """Whether the left-out error is larger, so that the model before is the better one.

        The mean logarithm is above zero; or one channel rises by much, beyond chance, and what the
        others gain does not outweigh it beyond chance. Every maneuver has one vote: pooled, the
        largest error decides alone (the only run with steps of thrust, left out).
        """
        return self.balance > 0.0 or (bool(self.rising(MUCH)) and not self.falls)


def left_out_change(
    before: LeftOutSummary | None,
    after: LeftOutSummary | None,
    without: Collection[str] = (),
) -> LeftOutChange | None:
    """Compare the left-out errors of two models; None with fewer than `LEAST_MANEUVERS` pairs.

    Pairs that the second model loses do not make them too few: it ran away.

    Parameters
    ----------
    before, after : LeftOutSummary or None
    without : collection of str
        Maneuvers that do not count: readings of them are masked in one of the models.
    """
    if before is None or after is None:
        return None
    own = {m.id: m for m in after.maneuvers}
    pairs = [(m, own[m.id]) for m in before.maneuvers if m.id in own and m.id not in without]
    lost = any(old.channels and not new.channels for old, new in pairs)
    pairs = [pair for pair in pairs if pair[0].channels and pair[1].channels]
    if len(pairs) < LEAST_MANEUVERS:
        return LeftOutChange({}, {}, 0.0, 0.0, True) if lost else None
    sums = np.array([[_sums(m) for m in pair] for pair in pairs])  # maneuver, model, channel, sum
    names = [c for k, c in enumerate(CHANNELS) if (sums[:, :, k, 1] > 0.0).all(axis=1).sum() > 1]
    places = [CHANNELS.index(c) for c in names]
    if not names:
        return None
    whole, se = _jackknifed(sums[:, :, places])
    return LeftOutChange(
        dict(zip(names, whole.tolist(), strict=True)),
        dict(zip(names, se.tolist(), strict=True)),
        *_mean_of_maneuvers(sums[:, :, places]),
        lost,
    )


def _sums(maneuver: LeftOutManeuver) -> list[tuple[float, float]]:
    """Sum of the squared errors, and number of readings, of each channel."""
    rows = (maneuver.channels.get(c) for c in CHANNELS)
    return [(r.rmse**2 * r.samples, float(r.samples)) if r else (0.0, 0.0) for r in rows]


def _mean_of_maneuvers(sums: Array) -> tuple[float, float]:
    """Mean over the maneuvers of the mean log ratio of their channels, and its standard error."""
    seen = np.all(sums[..., 1] > 0.0, axis=1)
    logs = np.where(seen, [_log_ratios(own[None]) for own in sums], 0.0)
    count = np.sum(seen, axis=1)
    own = (np.sum(logs, axis=1) / np.maximum(count, 1))[count > 0]
    return float(own.mean()), float(own.std(ddof=1)) / math.sqrt(len(own))


def _jackknifed(sums: Array) -> tuple[Array, Array]:
    """The log ratios (k,), and their standard errors over the F maneuvers.

    (F - 1)/F times the sum of the squared deviations, each maneuver left out of the sums in turn.
    """
    count = len(sums)
    without = np.array([_log_ratios(np.delete(sums, f, axis=0)) for f in range(count)])
    away = without - without.mean(axis=0)
    error: Array = np.sqrt((count - 1) / count * np.sum(away**2, axis=0))
    return _log_ratios(sums), error


def _log_ratios(sums: Array) -> Array:
    """Logarithm of the pooled error after over that before, by channel."""
    squares, samples = np.moveaxis(sums.sum(axis=0), -1, 0)  # each (model, channel)
    mean = np.maximum(squares / np.maximum(samples, 1.0), LEAST_SQUARE)
    found: Array = 0.5 * np.log(mean[1] / mean[0])
    return found


def as_told(change: LeftOutChange | None) -> dict[str, Any]:
    """A change as the artifact has it; nothing where no maneuvers were left out."""
    if change is None:
        return {}
    return {
        "left_out": change.ratios,
        "left_out_se": change.standard_errors,
        "balance": change.balance,
        "balance_se": change.balance_se,
    }


def bettered(attempts: Sequence[Attempt], errors: CrossValidated | None) -> tuple[str, ...]:
    """Channels of which the model taken explains more of what was left out, by what matters.

    Surely by all of them together, and clearly by each: what has no sure name is there.

    Parameters
    ----------
    attempts : sequence of Attempt
    errors : CrossValidated or None
        Of the model before, in maneuvers left out in turn.
    """
    taken = next((a for a in attempts[1:] if a.taken and not a.unclaimed), None)
    if taken is None or errors is None or taken.balance is None or taken.balance_se is None:
        return ()
    if taken.balance > -SURELY * taken.balance_se:
        return ()
    clearly = {c: ratio for c, ratio in taken.left_out.items() if ratio < CLEARLY}
    explained = {
        c: errors.before[c].nrmse * math.sqrt(1.0 - clearly[c] ** 2)
        for c in CHANNELS
        if c in clearly and c in errors.before
    }
    return tuple(c for c, share in explained.items() if share > share_that_matters(c))
