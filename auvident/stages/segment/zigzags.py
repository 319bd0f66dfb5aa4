"""Zigzags: the fin alternates between two sides and swings the heading away from the course.

An autopilot alternates too, but it brings the heading back: at each of its reversals the
heading is where it was at the last one or nearer to the course. A zigzag reverses the fin
beyond the course, to the other side each time. That, not the look of the rudder, decides.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from auvident.physics.maneuvers.plateaus import Plateau
from auvident.schema.artifacts import Rejected
from auvident.schema.planes import Plane
from auvident.stages.segment.pieces import Found, Piece
from auvident.stages.segment.scales import Scales, swept_fins
from auvident.stages.segment.turns import TRAVEL_FACTOR, execute, too_slow

LEAST_EXECUTES = 3  # IMO MSC.137(76): two overshoots, hence two reversals after the execute
UNEQUAL_FACTOR = 2.0  # people lay the rudder to sizes that differ; by more it is another order
SAME_SIDE_SHARE = 0.08  # of the amplitude: an angle that returns to this was ordered again
REST_S = 1.0  # between two holds, besides the time the fin needs to travel
PEAK_SHARE = 0.4  # of the amplitude: an autopilot's rudder before the execute is smaller
HELD_S = 0.5  # a fin that rests for this long has reached its angle
LEAST_SWING_RAD = np.radians(0.5)  # heading between two reversals; the least zigzag has 2 degrees
LEAST_SWING_SHARE = 0.1  # of the whole swing; overshoots of nine times the angle do not occur
# Of the swing between reversals, how far the first and the last execute turn the heading. An
# autopilot that takes over comes back to the course (half of it) or goes to another one.
WHOLE_SHARE = 0.75
ANOTHER_COURSE = 1.5
SPREAD_FACTOR = 3.0  # a last angle is off the others of its side by this much of their own spread
FAR_COURSE = 2.0  # at the angle of the other executes it may be a leg that was carried on

TOO_FEW = "zigzag: too few rudder executes"
AUTOPILOT = "zigzag: the rudder brings the heading back instead of swinging it, swing [deg]"
UNEQUAL = "zigzag: the rudder goes to two sides by different orders, ratio of the angles"


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
        Noted in what is found.
    taken : sequence of Found
        Turning circles of this piece.

    Returns
    -------
    list of Found, list of Rejected
        From first execute to last release, in time order; and what fell short: every stretch in
        which the fin is held to both sides has its reason.
    """
    swept = [p for p in swept_fins(piece) if not any(t.start <= p.middle < t.stop for t in taken)]
    sure, unsure = _search(piece, scales, held), _search(piece, scales, swept)
    zigzags = [c for c in sure if c.verdict is None]
    for c in unsure:
        rivals = [z for z in zigzags if _meets(c, [z])]
        if c.verdict is None and c.executes > sum(z.executes for z in rivals):
            zigzags = [*(z for z in zigzags if z not in rivals), c]
    zigzags.sort(key=lambda c: c.start)
    found = [
        Found("zigzag", piece, c.start, _before(taken, c), c.level_rad, plane) for c in zigzags
    ]
    rejected: list[Rejected] = []
    said: list[_Candidate | Found] = [*zigzags, *taken]
    for c in (*sure, *unsure, *_pairs(piece, scales, held)):
        if c.verdict is not None and not _meets(c, said):
            rejected.append(piece.rejected(c.start, c.stop, *c.verdict))
            said.append(c)
    return found, sorted(rejected, key=lambda r: r.t_start_s)


@dataclass(frozen=True)
class _Candidate:
    """Samples of a chain of executes, half-open, and why it is no zigzag."""

    start: int
    stop: int
    executes: int
    level_rad: float
    verdict: tuple[str, float, float] | None


def _before(taken: Sequence[Found], c: _Candidate) -> int:
    """End of a zigzag, at the latest where a turn begins without a rest."""
    return min([c.stop, *(t.start for t in taken if c.start < t.start)])


def _meets(one: _Candidate, others: Sequence[_Candidate | Found]) -> bool:
    """Whether a range has samples in common with others."""
    return any(o.start < one.stop and one.start < o.stop for o in others)


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
    pairs = [(a, b) for a, b in pairwise(held) if _reverses(piece, scales, a, b)]
    few = TOO_FEW, 2.0, float(LEAST_EXECUTES)
    return [
        _Candidate(
            a.start, b.stop, 2, 0.0, few if _alike((a, b), scales) else _different_orders(a, b)
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
    before = piece.fin[max(0, start - piece.samples(HELD_S)) : start]
    if start == 0 or small or float(np.ptp(before)) <= scales.tolerance_rad:
        return start, 0  # an angle that was held is another maneuver's
    return execute(piece, scales, Plateau(start - 1, start, peak)), 1


def last_release(piece: Piece, scales: Scales, chain: Sequence[Plateau]) -> tuple[int, int]:
    """End of a chain, and the number of executes behind its last hold.

    A record may end while the fin is on its way to the next angle.
    """
    last, end = chain[-1], float(piece.fin[-1])
    moved = end * last.level < 0 and abs(end) >= PEAK_SHARE * abs(last.level)
    if moved and piece.size - last.stop <= piece.samples(_longest_move_s(scales, abs(last.level))):
        return piece.size, 1
    return last.stop, 0


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
    return _alike((*run, p), scales) and _reverses(piece, scales, run[-1], p)


def _alike(holds: Sequence[Plateau], scales: Scales) -> bool:
    """Whether the angles may be those of one zigzag."""
    angles = [abs(p.level) for p in holds]
    return max(angles) <= UNEQUAL_FACTOR * min(angles) + scales.tolerance_rad


def _reverses(piece: Piece, scales: Scales, last: Plateau, p: Plateau) -> bool:
    """Whether the fin went from one hold to the other side without a rest."""
    amplitude = 0.5 * (abs(p.level) + abs(last.level))
    longest = piece.samples(_longest_move_s(scales, amplitude))
    return last.level * p.level < 0 and p.start - last.stop <= longest


def _longest_move_s(scales: Scales, amplitude: float) -> float:
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
