"""Whether the rows of a polled input are its changes, or samples taken now and then.

A log that writes each command as it is given knows when it changed: at its row. One that samples
the command, or the angle reached, at a rate of its own only knows between which rows; held until
its next row it comes late by half a period. No vehicle answers before its command. The
acceleration, as the mean between two rows, rises from interval to interval as the input stepped at
the rows before and after,

    a(k+1) - a(k) = sum over j of h(j) (x(k+1-j) - x(k-j)),

and h(-1) / (h(-1) + h(0)) is the share of a step that acts in the interval before its row: none
where rows are changes, whatever the servo, half where they are samples and the servo is quick.
Of ten drawn vehicles whose log tells it to 0.06 it was 0.08 to 0.57; their rows are samples.
Logged at the ticks of the controller, where rows are changes, it was -0.24 to 0.06 in the six of 40
drawn vehicles that tell it to 0.1, and none is taken for samples.

A log of more rows than samples copies each sample into the rows that follow. Whether these hold a
command or copy a sample tells the answer likewise, at the first row of each.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from auvident.schema.holding import median_period
from auvident.stages.ingest.held_copies import slow_samples
from auvident.stages.ingest.response import SLOW_SHARE

SURE_STDS = 3.0  # standard deviations by which a share has to differ from none ...
LEAST_SHARE = 0.1  # ... and by so much
MOST_SHARE = 1.0  # of more the clocks are wrong: that is told elsewhere
# [L/U] half a period: what comes late by less is little beside a servo's own lag. Held-out errors
# of r fell by 29 and 55 % where it was 0.12 and 0.13, by -8 to 20 % where it was 0.05 to 0.06 (five
# drawn vehicles of even seeds, u better in two of them): the limit lies between.
LEAST_LATE_LENGTHS = 0.08
UNEVEN = 1.5  # intervals longer by this factor than the usual one are left out
LEAST_ROWS = 50
LAGS = (-2, -1, 0, 1, 2, 3)  # [rows] h(-2) is what is no answer
SINGULAR = 1e10  # condition, from which on the steps do not tell their answers apart
# rate or velocity that answers to an input
ANSWERS = {"rudder_rad": "r_radps", "elevator_rad": "q_radps", "rpm": "u_mps"}
SPEED = "u_mps"  # that tells whether the vehicle is under way
Signals = Mapping[str, tuple[np.ndarray, np.ndarray]]  # times and values by column


@dataclass(frozen=True)
class Share:
    """Share of a step that acts before its row, with its standard deviation."""

    value: float
    std: float

    @property
    def sampled(self) -> bool:
        """Whether the rows are surely samples."""
        return max(SURE_STDS * self.std, LEAST_SHARE) < self.value < MOST_SHARE


def asked_of(columns: Collection[str]) -> tuple[str, ...]:
    """Those of some columns that `sampled_inputs` looks at: inputs, and what answers to them."""
    inputs = [column for column in ANSWERS if column in columns]
    asked = (*inputs, *(ANSWERS[column] for column in inputs), *([SPEED] if inputs else []))
    return tuple(column for column in dict.fromkeys(asked) if column in columns)


def sampled_inputs(signals: Signals, passage_s: float) -> tuple[str, ...]:
    """Columns of the inputs whose rows are samples, so far apart that the vehicle feels it.

    One logger writes them all: what the answer to one tells holds for the others.

    Parameters
    ----------
    signals : mapping
        As `share_before` takes them.
    passage_s : float
        L/U of the vehicle [s].
    """
    slow = [
        column
        for column in ANSWERS
        if column in signals
        and 0.5 * median_period(signals[column][0]) > LEAST_LATE_LENGTHS * passage_s
    ]
    shares = (share_before(column, signals) for column in ANSWERS if slow)
    told = any(share.sampled for share in shares if share is not None)
    return tuple(slow) if told else ()


def copied_inputs(signals: Signals) -> dict[str, np.ndarray]:
    """Inputs that change only at the ticks of a clock slower than their rows.

    Returns
    -------
    dict of str to numpy.ndarray of bool
        For each such column, which of its rows are at those ticks.
    """
    ticks = {c: slow_samples(*signals[c]) for c in ANSWERS if c in signals}
    return {column: rows for column, rows in ticks.items() if rows is not None}


def share_before(column: str, signals: Signals) -> Share | None:
    """Share of the steps of an input that acts before their rows; None where nothing tells it.

    Parameters
    ----------
    column : str
        Of the input, of `ANSWERS`.
    signals : mapping
        Times [s] in ascending order and values of all channels by column, as logged.
    """
    needed = (column, ANSWERS[column], SPEED)
    if any(name not in signals or signals[name][0].size < LEAST_ROWS for name in needed):
        return None
    (time, values), (seen_s, seen), (u_s, u) = (signals[name] for name in needed)
    period, speed = median_period(time), np.interp(time, u_s, u)
    if median_period(seen_s) > period:
        return None
    steps = np.diff(values * np.abs(values) if column == "rpm" else values)
    dt = np.diff(time)
    rises = np.diff(np.diff(np.interp(time, seen_s, seen)) / dt)
    under_way = speed > SLOW_SHARE * np.quantile(speed, 0.9)
    told = (
        (dt < UNEVEN * period) & under_way[1:] & (time[:-1] > seen_s[0]) & (time[1:] < seen_s[-1])
    )
    rows = np.arange(LAGS[-1], rises.size + LAGS[0])
    rows = rows[told[rows] & told[rows + 1]]
    found = _fitted(np.column_stack([steps[rows - lag] for lag in LAGS]), rises[rows])
    return found and replace(found, value=found.value - _feigned(time, seen_s) / period)


def _feigned(time: np.ndarray, seen_s: np.ndarray) -> float:
    """Mean time [s] by which an answer seems early, as its readings are joined by lines.

    Between readings P apart a line cuts the corner at a share x of the way by x (1 - x) P times
    the change of slope: a sixth of P in the mean, none where rows and readings have one clock.
    """
    after = np.clip(np.searchsorted(seen_s, time), 1, seen_s.size - 1)
    before, apart = seen_s[after - 1], seen_s[after] - seen_s[after - 1]
    x = np.clip((time - before) / apart, 0.0, 1.0)
    usual = apart < UNEVEN * median_period(seen_s)
    return float(np.mean((x * (1.0 - x) * apart)[usual])) if usual.any() else 0.0


def _fitted(steps: np.ndarray, rises: np.ndarray) -> Share | None:
    """The share from the least squares of rises by steps, with a sandwich for its deviation."""
    gram = steps.T @ steps
    if rises.size < LEAST_ROWS or np.linalg.cond(gram) > SINGULAR:
        return None
    inverse = np.linalg.inv(gram)
    h = inverse @ (steps.T @ rises)
    scores = (rises - steps @ h)[:, None] * steps
    whole = float(h[1] + h[2])
    if whole == 0.0:  # nothing answers: the channel stands still
        return None
    share = float(h[1] - h[0]) / whole
    slope = np.zeros(h.size)
    slope[:3] = np.array([-1.0, 1.0 - share, -share]) / whole
    variance = slope @ inverse @ (scores.T @ scores) @ inverse @ slope
    return Share(share, float(np.sqrt(variance)))
