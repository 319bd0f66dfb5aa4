"""Figures of a zigzag (IMO MSC.137(76), ITTC 7.5-04-02-01)."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from auvident.physics.maneuvers.track import Array, first_crossing

HALF = 0.5  # a rudder beyond half its amplitude has been put over
AMPLITUDE = 0.9  # quantile of the angle that is the amplitude: an overshoot of the servo is none
ON_LEVEL = 0.9  # share of the angle held, from which on the rudder has not left it for sure
EXACT = 1.0e-6  # [samples] rounding of a move that begins at a sample


def reversals(rudder_rad: ArrayLike) -> NDArray[np.int64]:
    """Samples at which the rudder leaves one side of a zigzag for the other.

    A side is left where the rudder was last beyond half the amplitude on it, and the move is
    followed back to its beginning: a line through nine tenths and half of the level, on to the
    level. The heading goes on turning while the first tenth of the move goes by.
    The last sample, which may be the release already, starts no new side.
    """
    x = np.asarray(rudder_rad, dtype=float)
    level = HALF * float(np.quantile(np.abs(x), AMPLITUDE))
    side = np.where(x > level, 1, np.where(x < -level, -1, 0))
    known = np.flatnonzero(side)
    known = known[: known.size - (known.size > 1 and known[-1] == x.size - 1)]
    change = known[:-1][side[known[:-1]] != side[known[1:]]]
    return np.array([_departure(x, int(i)) for i in change], dtype=np.int64)


def _departure(x: Array, last: int) -> int:
    """First sample of the move that leaves the level held, which falls below half after `last`."""
    sign = np.sign(x[last])
    other = np.flatnonzero(~(sign * x[:last] > 0))  # not on this side
    begin = int(other[-1]) + 1 if other.size else 0
    held = float(np.median(x[begin : last + 1]))
    on_level = np.flatnonzero(sign * x[begin : last + 1] >= ON_LEVEL * abs(held))
    if not on_level.size:
        return last + 1
    left, halved = (
        _passing(x, i, share * held)
        for i, share in ((begin + int(on_level[-1]), ON_LEVEL), (last, HALF))
    )
    away = left - (halved - left) * (1.0 - ON_LEVEL) / (ON_LEVEL - HALF)
    return max(math.floor(away + EXACT), begin) + 1


def _passing(x: Array, i: int, value: float) -> float:
    """Where between samples i and i + 1 a value is passed; sample i where there it is not."""
    step = x[i + 1] - x[i]
    return i + float(np.clip((value - x[i]) / step, 0.0, 1.0)) if step != 0.0 else float(i)


def zigzag_figures(
    time_s: ArrayLike,
    heading_rad: ArrayLike,
    rudder_rad: ArrayLike,
    base_heading_rad: float | None = None,
    switch_rad: float | None = None,
) -> dict[str, float]:
    """Figures of a zigzag that begins with the first rudder execute.

    Parameters
    ----------
    time_s : array_like, shape (n,)
        From first execute to last release [s].
    heading_rad : array_like, shape (n,)
        Unwrapped heading [rad]; pitch for a vertical zigzag.
    rudder_rad : array_like, shape (n,)
        Rudder angle [rad].
    base_heading_rad : float, optional
        Original course; else the heading at the first sample.
    switch_rad : float, optional
        Nominal switching angle; else the mean deviation found at the reversals.

    Returns
    -------
    dict of str to float
        ``rudder_deg`` (amplitude), ``executes`` (first included), ``switch_deg`` (mean
        deviation at the reversals), ``overshoot_1_deg``, ``overshoot_2_deg``, ... (heading
        beyond its value at which the rudder was reversed), ``time_to_second_execute_s``,
        ``initial_turning_time_s`` (until the heading deviates by `switch_rad`; absent where the
        first swing does not),
        ``time_to_check_yaw_s`` (second execute to the first greatest deviation), ``reach_s``
        (first execute to the return to the original course), ``period_s`` (between reversals to
        the same side, mean).
    """
    t, x = np.asarray(time_s, dtype=float), np.asarray(rudder_rad, dtype=float)
    psi = np.asarray(heading_rad, dtype=float)
    psi = psi - (psi[0] if base_heading_rad is None else base_heading_rad)
    turn = reversals(x)
    figures = {
        "rudder_deg": float(np.degrees(np.median(np.abs(x)))),
        "executes": float(turn.size + 1),
    }
    if turn.size == 0:
        return figures
    deviation = psi[turn]
    first = 1.0 if deviation[0] >= 0 else -1.0
    sides = first * np.array([(-1.0) ** k for k in range(turn.size)])
    switch = float(np.mean(sides * deviation)) if switch_rad is None else switch_rad
    figures["switch_deg"] = float(np.degrees(np.mean(sides * deviation)))
    figures["time_to_second_execute_s"] = float(t[turn[0]] - t[0])
    swing = slice(int(turn[1]) + 1) if turn.size > 1 else slice(None)
    initial = first_crossing(t[swing], first * psi[swing], switch)
    if initial is not None:
        figures["initial_turning_time_s"] = initial - float(t[0])
    figures |= _overshoots(t, psi, turn, sides)
    back = first_crossing(t[turn[0] :], -first * psi[turn[0] :], 0.0)
    if back is not None and back > t[turn[0]]:
        figures["reach_s"] = back - float(t[0])
    if turn.size >= 3:
        figures["period_s"] = float(np.mean(t[turn[2:]] - t[turn[:-2]]))
    return figures


def _overshoots(t: Array, psi: Array, turn: NDArray[np.int64], sides: Array) -> dict[str, float]:
    """Overshoot after each reversal; absent where the record ends before the heading returns."""
    figures: dict[str, float] = {}
    ends = [*turn[1:].tolist(), psi.size - 1]
    for k, (begin, end) in enumerate(zip(turn.tolist(), ends, strict=True)):
        swing = sides[k] * psi[begin : end + 1]
        peak = int(np.argmax(swing))
        if peak == swing.size - 1:
            continue
        figures[f"overshoot_{k + 1}_deg"] = float(np.degrees(swing[peak] - swing[0]))
        if k == 0:
            figures["time_to_check_yaw_s"] = float(t[begin + peak] - t[begin])
    return figures
