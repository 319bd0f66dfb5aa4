"""How fast the vehicle sinks: from its depth, and where that is missing from its motion.

A missing reading of depth is one row without depth. Short gaps are bridged (`BRIDGED_S`);
in longer ones surge, heave and pitch tell the rate, where they are logged; where they are not,
nothing does, and the other signs of a maneuver decide alone.
"""

import numpy as np

from auvident.constants import VehicleTime
from auvident.physics.maneuvers.plateaus import Array, odd_samples, running_mean
from auvident.stages.segment.pieces import Piece, true_ranges

DIVE_WINDOW_S: VehicleTime = 4.0  # over which a rate is averaged; readings that span less tell none


def sink_rate(piece: Piece) -> Array:
    """Rate of sinking of every row [m/s], NaN where nothing tells it.

    A trial without any depth is not judged by its motion: a pitch that is off would make a dive of
    every level run, and nothing would show it.
    """
    by_depth = sink_by_depth(piece)
    if piece.depth is None or piece.descent is None:
        return by_depth
    by_motion = _averaged(piece, piece.descent)
    return np.where(np.isfinite(by_depth), by_depth, by_motion)


def least_rows(piece: Piece) -> int:
    """Rows of a stretch whose rate of sinking is told; a rate takes two, however slow the log."""
    return max(2, piece.samples(DIVE_WINDOW_S))


def sink_by_depth(piece: Piece) -> Array:
    """Rate at which the depth rises [m/s], NaN where there is none."""
    rate = np.full(piece.size, np.nan)
    if piece.depth is None:
        return rate
    for start, stop in true_ranges(np.isfinite(piece.depth)):
        if stop - start >= least_rows(piece):
            rate[start:stop] = np.gradient(piece.depth[start:stop], piece.t[start:stop])
    return _averaged(piece, rate)


def _averaged(piece: Piece, rate: Array) -> Array:
    """Running mean of each stretch without a gap."""
    mean = np.full(piece.size, np.nan)
    for start, stop in true_ranges(np.isfinite(rate)):
        mean[start:stop] = running_mean(rate[start:stop], odd_samples(DIVE_WINDOW_S, piece.rate_hz))
    return mean
