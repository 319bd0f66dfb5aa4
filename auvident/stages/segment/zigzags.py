"""Zigzags: the fin alternates between two sides and swings the heading away from the course.

An autopilot alternates too, but it brings the heading back: at each of its reversals the
heading is where it was at the last one or nearer to the course. A zigzag reverses the fin
beyond the course, to the other side each time. That, not the look of the rudder, decides.
"""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from auvident.physics.maneuvers.plateaus import Plateau
from auvident.schema.artifacts import Rejected
from auvident.schema.planes import BY_PLANE, Plane
from auvident.stages.segment.chains import (
    LEAST_EXECUTES,
    LEAST_SWING_RAD,
    UNEQUAL_FACTOR,
    alike,
    chains,
    longest_move_s,
    reverses,
)
from auvident.stages.segment.pieces import Found, Piece
from auvident.stages.segment.scales import Scales, swept_fins
from auvident.stages.segment.spans import Spans
from auvident.stages.segment.turns import execute, too_slow

PEAK_SHARE = 0.4  # of the amplitude: an autopilot's rudder before the execute is smaller
HELD_S = 0.5  # a fin that rests for this long has reached its angle
LEAST_SWING_SHARE = 0.1  # of the whole swing; overshoots of nine times the angle do not occur

TOO_FEW = "zigzag: too few {fin} executes"
AUTOPILOT = "zigzag: the {fin} brings the {angle} back instead of swinging it, swing [deg]"
UNEQUAL = "zigzag: the {fin} goes to two sides by different orders, ratio of the angles"


def find_zigzags(
    piece: Piece,
    scales: Scales,
    held: Sequence[Plateau],
    plane: Plane = "horizontal",
    taken: Sequence[Found] = (),
) -> tuple[list[Found], list[Rejected]]:
    """Zigzags among the stretches of constant fin angle, and of nearly constant ones.

    Parameters
    ----------
    piece : Piece
        Uninterrupted piece of a trial.
    scales : Scales
        Yardsticks of the trial.
    held : sequence of Plateau
        Stretches of constant fin angle that are no turning circle.
    plane : str
        Noted in what is found, and its fin and angle named in what fell short.
    taken : sequence of Found
        Turning circles of this piece.

    Returns
    -------
    list of Found, list of Rejected
        From first execute to last release, in time order; and what fell short: every stretch in
        which the fin is held to both sides has its reason.
    """
    circles = Spans((t.start, t.stop) for t in taken)
    swept = [p for p in swept_fins(piece) if not circles.holds(p.middle)]
    sure, unsure = _search(piece, scales, held), _search(piece, scales, swept)
    zigzags = [c for c in sure if c.verdict is None]
    for c in (c for c in unsure if c.verdict is None):
        rivals = [z for z in zigzags if z.start < c.stop and c.start < z.stop]
        if c.executes > sum(z.executes for z in rivals):
            zigzags = [*(z for z in zigzags if z not in rivals), c] if rivals else [*zigzags, c]
    zigzags.sort(key=lambda c: c.start)
    begins = sorted(t.start for t in taken)
    found = [
        Found("zigzag", piece, c.start, _before(begins, c), c.level_rad, plane) for c in zigzags
    ]
    words = {"fin": BY_PLANE[plane].fin, "angle": BY_PLANE[plane].states[3].symbol}
    rejected: list[Rejected] = []
    said = Spans([*((z.start, z.stop) for z in zigzags), *((t.start, t.stop) for t in taken)])
    for c in (*sure, *unsure, *_pairs(piece, scales, held)):
        if c.verdict is not None and not said.meets(c.start, c.stop):
            reason, *evidence = c.verdict
            rejected.append(piece.rejected(c.start, c.stop, reason.format(**words), *evidence))
            said.add(c.start, c.stop)
    return found, sorted(rejected, key=lambda r: r.t_start_s)


@dataclass(frozen=True)
class _Candidate:
    """Samples of a chain of executes, half-open, and why it is no zigzag."""

    start: int
    stop: int
    executes: int
    level_rad: float
    verdict: tuple[str, float, float] | None


def _before(begins: Sequence[int], c: _Candidate) -> int:
    """End of a zigzag, at the latest where a turn begins without a rest; `begins` ascend."""
    return min([c.stop, *begins[(k := bisect_right(begins, c.start)) : k + 1]])


def _search(piece: Piece, scales: Scales, held: Sequence[Plateau]) -> list[_Candidate]:
    """Every chain of holds with the verdict on it."""
    candidates = []
    for chain in chains(piece, scales, held):
        start, unheld = first_execute(piece, scales, chain)
        stop, unfinished = last_release(piece, scales, chain)
        verdict = judge(piece, scales, chain, unheld + unfinished)
        executes = len(chain) + unheld + unfinished
        candidates.append(_Candidate(start, stop, executes, _amplitude(chain), verdict))
    return candidates


def _pairs(piece: Piece, scales: Scales, held: Sequence[Plateau]) -> list[_Candidate]:
    """Every two holds to two sides without a rest, which alone are no zigzag."""
    pairs = [(a, b) for a, b in pairwise(held) if reverses(piece, scales, a, b)]
    few = TOO_FEW, 2.0, float(LEAST_EXECUTES)
    return [
        _Candidate(
            a.start, b.stop, 2, 0.0, few if alike((a, b), scales) else _different_orders(a, b)
        )
        for a, b in pairs
    ]


def _different_orders(a: Plateau, b: Plateau) -> tuple[str, float, float]:
    """Why two holds are not of one zigzag."""
    angles = sorted((abs(a.level), abs(b.level)))
    return UNEQUAL, angles[1] / angles[0], UNEQUAL_FACTOR


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
    before = piece.fin[max(0, start - max(1, piece.samples(HELD_S))) : start]
    if start == 0 or small or float(np.ptp(before)) <= scales.tolerance_rad:
        return start, 0  # an angle that was held is another maneuver's
    return execute(piece, scales, Plateau(start - 1, start, peak)), 1


def last_release(piece: Piece, scales: Scales, chain: Sequence[Plateau]) -> tuple[int, int]:
    """End of a chain, and the number of executes behind its last hold.

    A record may end while the fin is on its way to the next angle.
    """
    last, end = chain[-1], float(piece.fin[-1])
    moved = end * last.level < 0 and abs(end) >= PEAK_SHARE * abs(last.level)
    if moved and piece.size - last.stop <= piece.samples(longest_move_s(scales, abs(last.level))):
        return piece.size, 1
    return last.stop, 0


def judge(
    piece: Piece, scales: Scales, chain: Sequence[Plateau], unheld: int = 0
) -> tuple[str, float, float] | None:
    """None for a zigzag, else reason, value, threshold.

    `unheld` executes came before or behind the chain without reaching their angle.
    """
    swing, whole = swings(piece, scales, chain)
    least_swing = max(LEAST_SWING_RAD, LEAST_SWING_SHARE * whole)
    executes = len(chain) + unheld
    if executes < LEAST_EXECUTES:
        return TOO_FEW, executes, LEAST_EXECUTES
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
