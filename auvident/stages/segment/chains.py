"""Runs of holds of the fin to alternate sides, and which of them are the executes of one zigzag.

People lay the rudder to angles that differ, and an autopilot that takes over holds it as well, to
come back to the course or to go to another one. Its holds stand at the ends of a run; their angle,
and how far they turn the heading compared with the others, tell them apart.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from auvident.physics.maneuvers.plateaus import Plateau
from auvident.stages.segment.pieces import Piece
from auvident.stages.segment.scales import Scales
from auvident.stages.segment.turns import TRAVEL_FACTOR, execute, too_slow

LEAST_EXECUTES = 3  # IMO MSC.137(76): two overshoots, hence two reversals after the execute
UNEQUAL_FACTOR = 2.0  # people lay the rudder to sizes that differ; by more it is another order
SAME_SIDE_SHARE = 0.08  # of the amplitude: an angle that returns to this was ordered again
REST_S = 1.0  # between two holds, besides the time the fin needs to travel
LEAST_SWING_RAD = np.radians(0.5)  # heading between two reversals; the least zigzag has 2 degrees
# Of the swing between reversals, how far the first and the last execute turn the heading. An
# autopilot that takes over comes back to the course (half of it) or goes to another one.
WHOLE_SHARE = 0.75
ANOTHER_COURSE = 1.5
SPREAD_FACTOR = 3.0  # a last angle is off the others of its side by this much of their own spread
FAR_COURSE = 2.0  # at the angle of the other executes it may be a leg that was carried on


def chains(piece: Piece, scales: Scales, held: Sequence[Plateau]) -> list[list[Plateau]]:
    """Runs of holds that alternate between two sides without a rest, each one zigzag's at most."""
    runs: list[list[Plateau]] = []
    for p in held:
        if runs and _continues(piece, scales, runs[-1], p):
            runs[-1].append(p)
        else:
            runs.append([p])
    return [_without_courses(piece, scales, run) for run in runs if len(run) >= 2]


def _continues(piece: Piece, scales: Scales, run: Sequence[Plateau], p: Plateau) -> bool:
    """Whether `p` is the next swing of `run`."""
    return alike((*run, p), scales) and reverses(piece, scales, run[-1], p)


def alike(holds: Sequence[Plateau], scales: Scales) -> bool:
    """Whether the angles may be those of one zigzag."""
    angles = [abs(p.level) for p in holds]
    return max(angles) <= UNEQUAL_FACTOR * min(angles) + scales.tolerance_rad


def reverses(piece: Piece, scales: Scales, last: Plateau, p: Plateau) -> bool:
    """Whether the fin went from one hold to the other side without a rest."""
    amplitude = 0.5 * (abs(p.level) + abs(last.level))
    longest = piece.samples(longest_move_s(scales, amplitude))
    return last.level * p.level < 0 and p.start - last.stop <= longest


def longest_move_s(scales: Scales, amplitude: float) -> float:
    """Time in which the fin comes from one side to the other [s]."""
    return REST_S + TRAVEL_FACTOR * 2 * amplitude / max(scales.fin_slew_radps, 1e-6)


def _without_courses(piece: Piece, scales: Scales, run: list[Plateau]) -> list[Plateau]:
    """A run without that at its ends with which an autopilot goes to a course."""
    if len(run) < LEAST_EXECUTES:
        return run
    if too_slow(piece, scales, run[0]) is not None:
        return run if _ordered_again(scales, run[:-1], run[-1]) else run[:-1]
    while len(run) > LEAST_EXECUTES and _comes_from_afar(piece, scales, run):
        run = run[1:]
    swing = _swing(piece, run[:-1])
    for k in range(LEAST_EXECUTES - 1, len(run)):
        share = _turned(piece, run[k - 1], run[k]) / max(swing, 1e-9)
        if not _ordered_again(scales, run[:k], run[k]) and share > ANOTHER_COURSE:
            return run[:k]
    if not _is_execute(piece, scales, run, swing):
        return run[:-1]
    return [*run[:-1], _within_swing(piece, run, max(swing, LEAST_SWING_RAD))]


def _turned(piece: Piece, before: Plateau, p: Plateau) -> float:
    """Change of heading from the reversal before a hold to its end [rad]."""
    return abs(float(piece.angle[min(p.stop, piece.size - 1)] - piece.angle[before.stop]))


def _within_swing(piece: Piece, run: Sequence[Plateau], swing: float) -> Plateau:
    """The last hold; one that led far to another course ends where it led as far as the others."""
    before, last = run[-2:]
    if _turned(piece, before, last) <= FAR_COURSE * swing:
        return last
    far = np.abs(piece.angle[last.start : last.stop] - piece.angle[before.stop]) >= swing
    return Plateau(last.start, last.start + max(1, int(np.argmax(far))), last.level)


def _comes_from_afar(piece: Piece, scales: Scales, run: Sequence[Plateau]) -> bool:
    """Whether the first hold turned to the course on which the zigzag began."""
    start, stop = execute(piece, scales, run[0]), run[0].stop
    turned = abs(float(piece.angle[stop] - piece.angle[start]))
    return turned > ANOTHER_COURSE * max(_swing(piece, run[1:]), LEAST_SWING_RAD)


def _is_execute(piece: Piece, scales: Scales, run: Sequence[Plateau], swing: float) -> bool:
    """Whether the last hold is one of the zigzag: by its angle, or by it and where it led."""
    before, last = run[:-1], run[-1]
    if _ordered_again(scales, before, last):
        return True
    share = _turned(piece, before[-1], last) / max(swing, 1e-9)
    ends = piece.size - last.stop <= piece.samples(REST_S)
    led = share <= ANOTHER_COURSE and (ends or share >= WHOLE_SHARE)
    return led and abs(_usual(before[-2::-2]) - last.level) <= SPREAD_FACTOR * _spread(before)


def _ordered_again(scales: Scales, before: Sequence[Plateau], p: Plateau) -> bool:
    """Whether the fin returns to its angle on the same side."""
    same = max(SAME_SIDE_SHARE * abs(p.level), scales.tolerance_rad)
    return abs(_usual(before[-2::-2]) - p.level) <= same


def _usual(holds: Sequence[Plateau]) -> float:
    """Median angle."""
    return float(np.median([p.level for p in holds]))


def _spread(run: Sequence[Plateau]) -> float:
    """Mean deviation of the angles from the usual one on their side; of two holds, their own."""
    if len(run) == 2:
        return abs(abs(run[0].level) - abs(run[1].level))
    return float(np.mean([abs(p.level - _usual(run[i % 2 :: 2])) for i, p in enumerate(run)]))


def _swing(piece: Piece, run: Sequence[Plateau]) -> float:
    """Median change of heading between the ends of successive holds."""
    pairs = pairwise(piece.angle[min(p.stop, piece.size - 1)] for p in run)
    return float(np.median([abs(b - a) for a, b in pairs]))
