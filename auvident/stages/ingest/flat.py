"""Readings that stand still: a sensor at the end of its range, or a column that is stuck.

Noise hardly ever repeats a value. Where a channel does so over many rows and elsewhere does not,
nothing was measured. A channel of coarse digits, a smoothed one and one without noise repeat
themselves everywhere, or come to rest gradually, and are left alone.
"""

from dataclasses import dataclass

import numpy as np

from auvident.stages.ingest.outliers import STUCK_ROWS, STUCK_SHARE
from auvident.stages.ingest.pace import excerpt

SHORT_ROWS = 4  # runs of so many rows and more up to `STUCK_ROWS` are what smoothing leaves,
SHORT_SHARE = 0.001  # of the rows; a share of p equal neighbours leaves 4 p^3 of them by chance
FLAT_ROWS, FLAT_RUNS, LONE_ROWS = 3, 3, 5  # at the end of a range: so many short runs, or a long
BEFORE = 5  # steps before a run that show whether it was reached gradually
ABRUPT = 0.25  # of the usual step
FEW_HOLDS = 3  # a measured fin angle stands still so often at most; a command does at every turn


@dataclass(frozen=True)
class Runs:
    """Stretches of two and more equal values: first row, length, value."""

    start: np.ndarray
    length: np.ndarray
    value: np.ndarray

    def only(self, which: np.ndarray) -> "Runs":
        """Some of them."""
        return Runs(self.start[which], self.length[which], self.value[which])


def runs_of(values: np.ndarray) -> Runs:
    """Stretches of equal values of a channel; a value that differs from its neighbours is none."""
    repeats = np.zeros(values.size + 1, dtype=np.int8)
    repeats[1:-1] = values[1:] == values[:-1]
    edges = np.flatnonzero(np.diff(repeats))
    start, last = edges[::2], edges[1::2]
    return Runs(start, last - start + 1, values[start])


def find_flat(values: np.ndarray, is_input: bool = False) -> tuple[np.ndarray, np.ndarray]:
    """Samples at the end of the range, and samples of a channel that is stuck.

    Parameters
    ----------
    values : numpy.ndarray
        Samples in ascending time, shape (n,).
    is_input : bool
        Fin angle or propeller rate: full rudder is no end of a range, and only what has the
        noise of a measurement can be stuck.

    Returns
    -------
    saturated, stuck : numpy.ndarray of bool
        Shape (n,) each. The first sample of a stuck stretch was measured and is not among them.
    """
    none = np.zeros(values.size, dtype=bool)
    if values.size < 2 * STUCK_ROWS:
        return none, none
    every = runs_of(values)
    runs = every.only((every.length >= FLAT_ROWS) & (every.value != 0.0))
    if not runs.start.size:
        return none, none
    runs = runs.only(are_abrupt(values, runs.start))
    ends = {e for e in (values.min(), values.max()) if _is_wall(runs, e)}
    stuck = runs.only((runs.length >= STUCK_ROWS) & ~np.isin(runs.value, list(ends)))
    if is_input and (stuck.start.size > FEW_HOLDS or ends):
        return none, none
    if not (ends or stuck.start.size) or not _is_noisy(values, every, ends, stuck):
        return none, none
    held = none.copy()
    for start, length in zip(stuck.start, stuck.length, strict=True):
        held[start + 1 : start + length] = True
    return np.logical_or.reduce([none, *(values == e for e in ends)]), held


def _is_wall(runs: Runs, end: float) -> bool:
    """Whether readings pile up at the largest or the smallest of them."""
    lengths = runs.length[runs.value == end]
    return bool(lengths.size >= FLAT_RUNS or (lengths >= LONE_ROWS).any())


def _is_noisy(values: np.ndarray, every: Runs, ends: set[float], stuck: Runs) -> bool:
    """Whether values hardly repeat outside of what is set apart."""
    apart = np.isin(every.start, stuck.start) | np.isin(every.value, list(ends))
    length = every.length[~apart]
    rows = values.size - stuck.length.sum() - sum(np.count_nonzero(values == e) for e in ends)
    short = length[(length >= SHORT_ROWS) & (length < STUCK_ROWS)]
    few = max(SHORT_SHARE * rows, 2 * SHORT_ROWS)
    return bool((length - 1).sum() <= STUCK_SHARE * rows and short.sum() <= few)


def are_abrupt(values: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Whether the steps before some rows are about as large as anywhere: no motion that settles.

    Parameters
    ----------
    values : numpy.ndarray
        Samples of a channel, shape (n,).
    starts : numpy.ndarray of int
        First row of each run, shape (k,).
    """
    steps = np.abs(np.diff(excerpt(values)))
    moving = steps[steps > 0.0]
    usual = float(np.median(moving)) if moving.size else np.inf
    before = starts[:, None] - 1 - np.arange(BEFORE)
    inside = before >= 0
    at = np.maximum(before, 0)
    sums = np.where(inside, np.abs(values[at + 1] - values[at]), 0.0).sum(axis=1)
    return sums > ABRUPT * usual * np.maximum(inside.sum(axis=1), 1)
