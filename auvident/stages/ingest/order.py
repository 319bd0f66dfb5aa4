"""Time stamps: glitches are dropped, a clock that jumps and stays is refused."""

from dataclasses import dataclass

import numpy as np

from auvident.errors import InputError
from auvident.schema.logs import RawSensor

GLITCH_ROWS = 3  # a longer run of rows out of order is no glitch but another clock
MAX_GLITCHES = 200  # runs of 2 or 3 rows out of order; more mean the clock is not usable
STAYED_TICKS = 1.5  # a clock that lost more than this over a glitch has been set back
MAX_PAUSE_S = 6 * 3600.0  # a pause within a trial; beyond it there are two trials
MIN_PERIOD_ROWS = 10  # fewer rows have no typical period
DESCENDING_SHARE = 0.9  # of the steps in time go back: the log has the newest row first
UNIT_REMEDY = (
    "The time is no seconds: name the column by its unit (time_us, time_ms), or set "
    'time_unit = "us" in a map (--map).'
)


@dataclass(frozen=True)
class Ordered:
    """Rows of a sensor in ascending time: `keep` as indices, `backward` as indices dropped."""

    keep: np.ndarray
    backward: np.ndarray


def order_rows(sensor: RawSensor) -> Ordered:
    """Rows of a sensor whose time stamps ascend (equal ones are kept).

    A single stamp that is too early or too late, or up to `GLITCH_ROWS` of them, is dropped;
    so are rows written a second time.

    Raises
    ------
    InputError
        When time goes backward for good, or jumps ahead by more than `MAX_PAUSE_S`.
    """
    time = sensor.time_s
    keep = np.ones(time.size, dtype=bool)
    if np.any(time[1:] < time[:-1]):
        _drop_isolated(time, keep)
        _drop_runs(sensor, keep)
    _drop_leaps(sensor, keep)
    return Ordered(np.flatnonzero(keep), np.flatnonzero(~keep))


def _drop_isolated(time: np.ndarray, keep: np.ndarray) -> None:
    """Single rows outside the interval of their neighbours, where these ascend."""
    while True:
        rows = np.flatnonzero(keep)
        t = time[rows]
        out = np.zeros(t.size, dtype=bool)
        out[1:-1] = ((t[1:-1] < t[:-2]) | (t[1:-1] > t[2:])) & (t[2:] > t[:-2])
        out[1:] &= ~out[:-1]  # of two swapped rows, one is enough
        if not out.any():
            return
        keep[rows[out]] = False


def _drop_runs(sensor: RawSensor, keep: np.ndarray) -> None:
    time = sensor.time_s
    steps = np.diff(time)
    tick = float(np.median(steps[steps > 0])) if np.any(steps > 0) else 0.0
    period = tick * np.count_nonzero(steps) / steps.size  # several rows bear one whole second
    for _ in range(MAX_GLITCHES):
        rows = np.flatnonzero(keep)
        back = np.flatnonzero(np.diff(time[rows]) < 0)
        if not back.size:
            return
        before, after = rows[: back[0] + 1], rows[back[0] + 1 :]
        too_late = before[time[before] > time[after[0]]]
        beyond = np.flatnonzero(time[after] > time[before[-1]])
        too_early = after[: beyond[0]] if beyond.size else after
        if _written_before(sensor, before, too_early):
            keep[too_early] = False
            continue
        too_early = too_early[time[too_early] < time[before[-1]]]  # an equal stamp is in order
        run = too_early if too_early.size <= too_late.size else too_late
        if run.size > GLITCH_ROWS or _stayed(time, rows, run, tick, period):
            raise _backward(sensor, before[-1], after[0])
        keep[run] = False
    raise _backward(sensor, before[-1], after[0])


def _written_before(sensor: RawSensor, before: np.ndarray, again: np.ndarray) -> bool:
    """Whether rows repeat earlier rows, time and values."""
    time = sensor.time_s
    place = np.searchsorted(time[before], time[again])
    if np.any(place >= before.size):
        return False
    first = before[place]
    if not np.array_equal(time[first], time[again]):
        return False
    pairs = ((x[first], x[again]) for x in sensor.values.values())
    return all(np.array_equal(a, b, equal_nan=True) for a, b in pairs)


def _stayed(
    time: np.ndarray, rows: np.ndarray, run: np.ndarray, tick: float, period: float
) -> bool:
    """Whether less time has passed across a dropped run than its rows took."""
    first, last = np.searchsorted(rows, (run[0], run[-1] + 1))
    if run.size < 2 or first == 0 or last >= rows.size or rows.size < MIN_PERIOD_ROWS:
        return False
    elapsed = time[rows[last]] - time[rows[first - 1]]
    return bool((last - first + 1) * period - elapsed > STAYED_TICKS * tick)


def _backward(sensor: RawSensor, last: int, first: int) -> InputError:
    time, rows = sensor.time_s, sensor.rows
    if np.mean(np.diff(time) < 0.0) > DESCENDING_SHARE:
        return InputError(
            f"the newest row comes first: {time[0]:.3f} s at row {rows[0]}, "
            f"{time[-1]:.3f} s at row {rows[-1]}",
            f"{sensor.file}, column {sensor.time_column}",
            "Sort the rows by time, the oldest first.",
        )
    return InputError(
        f"time goes backward and stays there: {time[last]:.3f} s at row {rows[last]}, "
        f"then {time[first]:.3f} s at row {rows[first]}",
        f"{sensor.file}, row {rows[first]}, column {sensor.time_column}",
        f"Split the log at row {rows[first]} into two trials, or correct its clock.",
    )


def _drop_leaps(sensor: RawSensor, keep: np.ndarray) -> None:
    """A few rows beyond a pause of hours at either end have a corrupt time stamp."""
    rows = np.flatnonzero(keep)
    time = sensor.time_s if rows.size == keep.size else sensor.time_s[rows]
    leaps = np.flatnonzero(time[1:] - time[:-1] > MAX_PAUSE_S)
    for leap in leaps:
        head, tail = rows[: leap + 1], rows[leap + 1 :]
        if tail.size <= GLITCH_ROWS < rows.size:
            keep[tail] = False
        elif head.size <= GLITCH_ROWS:
            keep[head] = False
        else:
            remedy = "Split the log there into two trials, or correct its clock."
            if np.median(np.diff(time)) > MAX_PAUSE_S:  # every row, not one
                remedy = UNIT_REMEDY
            raise InputError(
                f"time jumps from {time[leap]:.3f} s to {time[leap + 1]:.3f} s",
                f"{sensor.file}, row {sensor.rows[tail[0]]}, column {sensor.time_column}",
                remedy,
            )
