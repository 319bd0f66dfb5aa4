"""Turning circles: the rudder is put over, held, and the vehicle comes round."""

from collections.abc import Sequence

import numpy as np

from auvident.physics.figures_plateaus import Plateau, ramp_start
from auvident.schema.artifacts import Rejected
from auvident.stages.segment.pieces import Found, Piece, Scales

LEAST_TURN_RAD = np.radians(165)  # a circle comes to 180 degrees; the rest is gyro drift and lag
LOOKED_LIKE_RAD = np.radians(90)  # from here on a turn deserves a word when it is refused
LEAST_SPEED_SHARE = 0.35  # of cruise: below, waves and drift move the vehicle as much as the fin
HARD_OVER_RAD = np.radians(5)  # a fin held beyond this for long was meant to turn
LONG_HOLD_S = 15.0


def find_turns(
    piece: Piece, scales: Scales, held: Sequence[Plateau]
) -> tuple[list[Found], list[Rejected]]:
    """Turning circles among the stretches of constant rudder.

    Parameters
    ----------
    piece : Piece
        Uninterrupted piece of a trial.
    scales : Scales
        Yardsticks of the trial.
    held : sequence of Plateau
        Stretches of constant rudder (`held_fins`).

    Returns
    -------
    list of Found, list of Rejected
        From rudder execute to rudder release, in time order; and what fell short.
    """
    found: list[Found] = []
    rejected: list[Rejected] = []
    for p in held:
        change = abs(float(piece.angle[p.stop - 1] - piece.angle[p.start]))
        fast = float(piece.speed[p.start])
        least = LEAST_SPEED_SHARE * scales.speed_mps
        start = execute(piece, scales, p)
        if fast < least and (change >= LOOKED_LIKE_RAD or _was_meant(piece, p)):
            rejected.append(piece.rejected(start, p.stop, TOO_SLOW, fast, least))
        elif change >= LEAST_TURN_RAD:
            found.append(Found("turn", piece, start, p.stop, p.level))
        elif change >= LOOKED_LIKE_RAD:
            value, limit = np.degrees(change), np.degrees(LEAST_TURN_RAD)
            rejected.append(piece.rejected(start, p.stop, TOO_LITTLE, value, limit))
    return found, rejected


TOO_SLOW = "turn: too slow, speed at the rudder execute [m/s]"
TOO_LITTLE = "turn: too short, change of heading under constant rudder [deg]"


def _was_meant(piece: Piece, p: Plateau) -> bool:
    """A large angle held for long."""
    return abs(p.level) >= HARD_OVER_RAD and p.samples >= piece.samples(LONG_HOLD_S)


def execute(piece: Piece, scales: Scales, p: Plateau) -> int:
    """Sample at which the fin began to move towards the level of `p`."""
    return ramp_start(piece.fin, p.start, scales.fin_slew_radps / piece.rate_hz)
