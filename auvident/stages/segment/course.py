"""Where the vehicle changes its course: no depth step is ordered there.

A hull in a turn heels, trims and loses speed, and with them its depth: nobody ordered that, and
the equations of the vertical plane do not know the rudder that did it.
"""

import numpy as np

from auvident.schema.trial import Trial
from auvident.stages.segment.pieces import Found, Piece, pieces_of, true_ranges
from auvident.stages.segment.scales import Scales, scales_of
from auvident.stages.segment.straights import STEADY_RUDDER_RAD, rate_limits

TURNED_RAD = np.radians(10.0)  # to one side, at a stretch


def course_changes(trial: Trial) -> list[Found]:
    """All stretches of a trial in which the heading is steered elsewhere, as turns.

    Nothing where the trial logs no horizontal motion, or where nothing was ever steered.
    """
    pieces = pieces_of(trial, "horizontal")
    if not pieces:
        return []
    scales = scales_of(pieces)
    return [f for piece in pieces for f in _changes(piece, scales)] if scales.gain_radpm else []


def _changes(piece: Piece, scales: Scales) -> list[Found]:
    """Ranges in which the vehicle turns to one side, as fast as a rudder that steers turns it."""
    least, _ = rate_limits(scales)
    steered = max(least, scales.gain_radpm * scales.speed_mps * STEADY_RUDDER_RAD)
    found = []
    for side in (1.0, -1.0):
        for start, stop in true_ranges(side * piece.rate_mean > steered):
            if abs(float(np.sum(piece.rate[start:stop]))) >= TURNED_RAD * piece.rate_hz:
                found.append(Found("turn", piece, start, stop))
    return sorted(found, key=lambda f: f.start)
