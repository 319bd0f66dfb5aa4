"""Zigzags: the fin alternates between two sides and swings the heading away from the course.

An autopilot alternates too, but it brings the heading back: at each of its reversals the
heading is where it was at the last one or nearer to the course. A zigzag reverses the fin
beyond the course, to the other side each time. That, not the look of the rudder, decides.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from auvident.physics.maneuvers.plateaus import Plateau
from auvident.schema.artifacts import Rejected
from auvident.schema.planes import Plane
from auvident.stages.segment.pieces import Found, Piece
from auvident.stages.segment.scales import Scales
from auvident.stages.segment.turns import TRAVEL_FACTOR, execute, too_slow

LEAST_EXECUTES = 3  # IMO MSC.137(76): two overshoots, hence two reversals after the execute
SAME_SIDE_SHARE = 0.08  # of the amplitude: the angle returns to this on the same side
TWO_SIDES_SHARE = 0.25  # of the amplitude: the two sides differ by trim and calibration
TWO_SIDES_RAD = np.radians(2.0)  # or by this
REST_S = 1.0  # between two holds, besides the time the fin needs to travel
PEAK_SHARE = 0.4  # of the amplitude: an autopilot's rudder before the execute is smaller
HELD_S = 0.5  # a fin that rests for this long has reached its angle
LEAST_SWING_RAD = np.radians(0.5)  # heading between two reversals; the least zigzag has 2 degrees
LEAST_SWING_SHARE = 0.1  # of the whole swing; overshoots of nine times the angle do not occur

TOO_FEW = "zigzag: too few rudder executes"
AUTOPILOT = "zigzag: the rudder brings the heading back instead of swinging it, swing [deg]"


def find_zigzags(
    piece: Piece, scales: Scales, held: Sequence[Plateau], plane: Plane = "horizontal"
) -> tuple[list[Found], list[Rejected]]:
    """Zigzags among the stretches of constant fin angle.

    Parameters
    ----------
    piece : Piece
        Uninterrupted piece of a trial.
    scales : Scales
        Yardsticks of the trial.
    held : sequence of Plateau
        Stretches of constant fin angle that are no turning circle.
    plane : str
        Noted in what is found.

    Returns
    -------
    list of Found, list of Rejected
        From first execute to last release, in time order; and what fell short.
    """
    found: list[Found] = []
    rejected: list[Rejected] = []
    for chain in chains(piece, scales, held):
        start, unheld = first_execute(piece, scales, chain)
        stop = chain[-1].stop
        verdict = judge(piece, scales, chain, unheld)
        if verdict is None:
            found.append(Found("zigzag", piece, start, stop, _amplitude(chain), plane))
        elif verdict[0]:
            rejected.append(piece.rejected(start, stop, *verdict))
    return found, rejected


def _amplitude(chain: Sequence[Plateau]) -> float:
    """Mean of the fin angles to the two sides: a trim angle cancels."""
    sides = [[p.level for p in chain if p.level * sign > 0] for sign in (1, -1)]
    return 0.5 * float(np.median(sides[0]) - np.median(sides[1]))


def first_execute(piece: Piece, scales: Scales, chain: Sequence[Plateau]) -> tuple[int, int]:
    """Sample of the first execute of a chain, and the number of executes before its first hold.

    A slow fin may be reversed before it has reached its angle the first time; then the move to
    the first hold begins on the other side, and the execute is the beginning of the move there.
    """
    start = execute(piece, scales, chain[0])
    peak = float(piece.fin[max(0, start - 1)])
    small = peak * chain[0].level >= 0 or abs(peak) < PEAK_SHARE * abs(chain[0].level)
    before = piece.fin[max(0, start - piece.samples(HELD_S)) : start]
    if start == 0 or small or float(np.ptp(before)) <= scales.tolerance_rad:
        return start, 0  # an angle that was held is another maneuver's
    return execute(piece, scales, Plateau(start - 1, start, peak)), 1


def chains(piece: Piece, scales: Scales, held: Sequence[Plateau]) -> list[list[Plateau]]:
    """Runs of holds that alternate between two sides at two angles without a rest."""
    runs: list[list[Plateau]] = []
    for p in held:
        if runs and _continues(piece, scales, runs[-1], p):
            runs[-1].append(p)
        else:
            runs.append([p])
    return [run for run in runs if len(run) >= 2]


def _continues(piece: Piece, scales: Scales, run: Sequence[Plateau], p: Plateau) -> bool:
    """Whether `p` is the next swing of `run`."""
    last = run[-1]
    amplitude = 0.5 * (abs(p.level) + abs(last.level))
    if last.level * p.level >= 0:
        return False
    if abs(abs(p.level) - abs(last.level)) > max(TWO_SIDES_SHARE * amplitude, TWO_SIDES_RAD):
        return False
    same = max(SAME_SIDE_SHARE * amplitude, scales.tolerance_rad)
    if len(run) >= 2 and abs(run[-2].level - p.level) > same:
        return False
    travel_s = 2 * amplitude / max(scales.fin_slew_radps, 1e-6)
    return p.start - last.stop <= piece.samples(REST_S + TRAVEL_FACTOR * travel_s)


def judge(
    piece: Piece, scales: Scales, chain: Sequence[Plateau], unheld: int = 0
) -> tuple[str, float, float] | None:
    """None for a zigzag, else reason, value, threshold; an empty reason is not worth a word.

    `unheld` executes came before the chain without reaching their angle.
    """
    swing, whole = swings(piece, scales, chain)
    least_swing = max(LEAST_SWING_RAD, LEAST_SWING_SHARE * whole)
    executes = len(chain) + unheld
    if executes < LEAST_EXECUTES:
        reason = TOO_FEW if swing >= least_swing else ""
        return reason, executes, LEAST_EXECUTES
    slow = too_slow(piece, scales, chain[0])
    if slow is not None:
        return f"zigzag: {slow[0]}", *slow[1:]
    if swing < least_swing:
        return AUTOPILOT, float(np.degrees(swing)), float(np.degrees(least_swing))
    return None


def swings(piece: Piece, scales: Scales, chain: Sequence[Plateau]) -> tuple[float, float]:
    """Median change of heading between reversals, in the direction the fin drives; whole swing.

    The last hold ends with the release, not with a reversal, and is left out where possible.
    """
    ends = [min(p.stop, piece.size - 1) for p in chain]
    inner = list(pairwise(ends[:-1])) or list(pairwise(ends))
    signs = [scales.drive * np.sign(p.level) for p in chain[1:]]
    driven = [
        s * float(piece.angle[b] - piece.angle[a]) for s, (a, b) in zip(signs, inner, strict=False)
    ]
    whole = [float(np.ptp(piece.angle[a : b + 1])) for a, b in inner]
    return float(np.median(driven)), float(np.median(whole))
