"""How long a logged command holds, and whether a log of commands is written only on change."""

from dataclasses import dataclass

import numpy as np

POLLED = "polled"  # rule: written at a fixed rate, each row a change or no change
SAMPLED = "sampled"  # ... or a sample of what changed at any time since the row before
HOLD_MIN_S = 2.0  # a polled command is held so long: slower vehicles poll at 1 Hz
HOLD_PERIODS = 5.0  # and at least over so many of its periods
ON_CHANGE_EQUAL = 0.05  # equal successive values: a command polled at a fixed rate has more
ON_CHANGE_SPREAD = 5.0  # 95 % quantile over median of the intervals: far from a fixed rate
HEARTBEAT_ROWS = 5  # so many long intervals ...
HEARTBEAT_SPREAD = 1.3  # ... alike within this factor are a heartbeat, no drop-outs
HEARTBEAT_MARGIN = 1.5  # times the heartbeat is held
SLOW_S = 2.0  # intervals of the median command beyond it, ...
UNEVEN = 1.5  # ... of which the quartiles differ by this factor, are those of no clock
SLOW_EQUAL = 0.25  # of so few rows: where an empty one is left out, the next repeats the one before
SILENT_SHARE = 0.1  # of the time without a row, beyond what is polled: too much for drop-outs
AWAKE_SHARE = 0.5  # of the silences in which another sensor goes on: else the logger was off


def median_period(time_s: np.ndarray) -> float:
    """Median interval between samples in s; 0 for fewer than two."""
    if time_s.size < 2:
        return 0.0
    return float(np.median(np.diff(time_s), overwrite_input=True))


@dataclass(frozen=True)
class Hold:
    """How long a command is held: `limit_s` after a sample, and which rule said so."""

    limit_s: float
    rule: str


def hold_rule(time_s: np.ndarray, values: np.ndarray, on_change: bool | None) -> Hold:
    """How long a logged command holds when none follows.

    A command polled at a fixed rate is held over `HOLD_MIN_S` or `HOLD_PERIODS` of its periods;
    a longer silence is a drop-out. A log that is written only when the command changes shows
    hardly any equal successive values at very unequal intervals: there silence means that
    nothing changed, and the command holds until the next one.

    Parameters
    ----------
    time_s, values : numpy.ndarray
        Samples in ascending time, shape (n,).
    on_change : bool or None
        The user's word on it; None: decide from the data.
    """
    if on_change or (on_change is None and _is_on_change(time_s, values)):
        return Hold(np.inf, "on_change")
    limit = max(HOLD_MIN_S, HOLD_PERIODS * median_period(time_s))
    steps = np.diff(time_s)
    long = steps[steps > limit] if on_change is None else steps[:0]
    if long.size >= HEARTBEAT_ROWS and long.max() <= HEARTBEAT_SPREAD * np.median(long):
        return Hold(HEARTBEAT_MARGIN * float(np.median(long)), "heartbeat")
    return Hold(limit, POLLED)


def _is_on_change(time: np.ndarray, values: np.ndarray) -> bool:
    if time.size < 2:
        return True
    equal = float(np.mean(np.diff(values) == 0))
    steps = np.diff(time)
    spread = float(np.quantile(steps, 0.95) / np.median(steps))
    few = time.size < 2 * HEARTBEAT_ROWS  # a handful of rows in a trial is a list of commands
    return equal <= ON_CHANGE_EQUAL and (spread > ON_CHANGE_SPREAD or few)


def seems_on_change(
    time_s: np.ndarray, values: np.ndarray, others_s: np.ndarray | None = None
) -> bool:
    """Whether a command that `hold_rule` takes for polled may be written only when it changes.

    Nearly every row differs from the one before, and there are silences of all lengths: the
    log of a command that is stepped by hand, or that an autopilot moves and then holds. The
    log of a noisy measured angle with drop-outs may look the same, so this is only said.

    Parameters
    ----------
    time_s, values : numpy.ndarray
        Samples in ascending time, shape (n,).
    others_s : numpy.ndarray, optional
        Times in ascending order of a sensor that is written at a fixed rate: silences that it
        shares are the logger's.
    """
    if time_s.size < 2 * HEARTBEAT_ROWS or hold_rule(time_s, values, None).rule != POLLED:
        return False
    equal = float(np.mean(np.diff(values) == 0))
    steps, period = np.diff(time_s), median_period(time_s)
    short, long = np.quantile(steps, (0.25, 0.75))
    if period > SLOW_S:
        return bool(long > UNEVEN * short and equal <= SLOW_EQUAL)
    if equal > ON_CHANGE_EQUAL:
        return False
    silent = np.flatnonzero(steps > max(HOLD_MIN_S, HOLD_PERIODS * period))
    if silent.size < HEARTBEAT_ROWS or steps[silent].sum() < SILENT_SHARE * steps.sum():
        return False
    if others_s is None:
        return True
    middle = time_s[silent] + 0.5 * steps[silent]
    near = np.searchsorted(others_s, middle + period) - np.searchsorted(
        others_s, middle - max(period, 0.25 * HOLD_MIN_S)
    )
    return bool(np.mean(near > 0) >= AWAKE_SHARE)
