"""Maneuvers of the horizontal plane that are none: run on an inclined path, or at the surface.

The heading turns by r / cos(pitch). On an inclined path the log therefore looks like that of a rate
gyro with a scale error, and what its maneuvers say of the others is off by that share.
At the surface the hull makes waves, whose drag dies out with the depth in wave numbers g / U^2.
"""

from collections.abc import Sequence

import numpy as np

from auvident.constants import GRAVITY_MPS2
from auvident.physics.maneuvers.plateaus import Array
from auvident.schema.artifacts import Rejected
from auvident.stages.segment.depth import sink_rate
from auvident.stages.segment.pieces import Found, Piece
from auvident.stages.segment.scales import Scales

# that much of a gyro scale error is of practical size (`auvident.schema.effects`): 10 degrees
INCLINED_SHARE = 0.015
# of the usual depth: what is run so much higher than the rest may be at the surface, ...
SURFACE_SHARE = 0.3
SURFACE_WAVES = 2.0  # ... if it is within so many U^2 / g, where waves still take 2 % of their drag

STANDING_MPS, STEEPEST = 0.05, 0.99  # slower, and steeper, the slope of the path means nothing

INCLINED = "{}: on an inclined path, mean of 1 / cos(pitch) less 1"
AT_SURFACE = "{}: at the surface while the rest is submerged, median depth [m]"


def level(
    piece: Piece, scales: Scales, found: Sequence[Found]
) -> tuple[list[Found], list[Rejected]]:
    """Maneuvers that are run level and submerged, and why the others are none.

    Parameters
    ----------
    piece : Piece
    scales : Scales
    found : sequence of Found
        Of this piece, in the horizontal plane.

    Returns
    -------
    list of Found, list of Rejected
        What neither depth nor pitch tells counts as level.
    """
    sink, usual = sink_rate(piece), usual_depth(piece, scales)
    kept, rejected = [], []
    for f in found:
        why = _inclined(piece, f, sink) or _at_surface(piece, scales, f, usual)
        rejected += [why] if why else []
        kept += [] if why else [f]
    return kept, rejected


def usual_depth(piece: Piece, scales: Scales) -> float:
    """Median depth under way [m]; zero where none is logged."""
    if piece.depth is None:
        return 0.0
    under_way = piece.depth[(piece.speed > 0.5 * scales.speed_mps) & np.isfinite(piece.depth)]
    return float(np.median(under_way)) if under_way.size else 0.0


def _inclined(piece: Piece, f: Found, sink: Array) -> Rejected | None:
    """Refused where the heading turns faster than the gyro tells."""
    rate, speed = sink[f.start : f.stop], piece.speed[f.start : f.stop]
    told = np.isfinite(rate)
    if not told.any():
        return None
    slope = np.clip(rate[told] / np.maximum(speed[told], STANDING_MPS), -STEEPEST, STEEPEST)
    share = float(np.mean(1.0 / np.sqrt(1.0 - slope**2) - 1.0))
    if share <= INCLINED_SHARE:
        return None
    return piece.rejected(f.start, f.stop, INCLINED.format(f.kind), share, INCLINED_SHARE)


def _at_surface(piece: Piece, scales: Scales, f: Found, usual: float) -> Rejected | None:
    """Refused at the surface, where the usual maneuver is not."""
    depth = np.zeros(0) if piece.depth is None else piece.depth[f.start : f.stop]
    depth = depth[np.isfinite(depth)]
    least = min(SURFACE_SHARE * usual, SURFACE_WAVES * scales.speed_mps**2 / GRAVITY_MPS2)
    if usual <= 0.0 or not depth.size or float(np.median(depth)) >= least:
        return None
    return piece.rejected(
        f.start, f.stop, AT_SURFACE.format(f.kind), float(np.median(depth)), least
    )
