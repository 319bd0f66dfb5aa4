"""Turning circles: the rudder is put over, held, and the vehicle comes round."""

from collections.abc import Sequence

import numpy as np

from auvident.constants import VehicleTime
from auvident.physics.maneuvers.plateaus import Array, Plateau, ramp_start
from auvident.physics.maneuvers.straight import RPM_LEVEL_SHARE
from auvident.schema.artifacts import Rejected
from auvident.stages.segment.pieces import Found, Piece, true_ranges
from auvident.stages.segment.scales import NOISE_BAND, Scales, swept_fins
from auvident.stages.segment.spans import Spans

LEAST_TURN_RAD = np.radians(165)  # a circle comes to 180 degrees; the rest is gyro drift and lag
LOOKED_LIKE_RAD = np.radians(90)  # from here on a turn deserves a word when it is refused
LEAST_SPEED_SHARE = 0.35  # of cruise: below, waves and drift move the vehicle as much as the fin
LEAST_RPM_SHARE = 0.45  # of cruise: a fifth of the thrust; fin checks and surface runs, no trial
HARD_OVER_RAD = np.radians(5)  # a fin held beyond this for long was meant to turn
LONG_HOLD_S: VehicleTime = 15.0
RAMP_SPAN_S = 0.5  # over which a move of the fin shows above its noise
TRAVEL_FACTOR = 1.5  # a fin near its end stop slows down
HALF = 0.5  # a rudder below half of its angle has left it
EASED_FACTOR = 3.0  # leaving takes this much longer than coming ...
EASED_S = 0.3  # ... plus a control interval: an autopilot eases the rudder off near its course
COURSE_ORDER_RAD = np.pi  # an autopilot turns the short way
ORDER_S = 2.0  # speed and rudder of a maneuver are ordered within this time
SETTLED_S: VehicleTime = 5.0  # an autopilot on its course has kept the rudder small for this long
LEAST_EASED_RAD = np.radians(345)  # two course orders to one side; the rest as for the circle
LEAST_STEADY_RAD = np.pi  # at a steady rate this serves, however the rudder came and left
NEAR_SAMPLES = 256  # looked at first for the end of a hold
STEADY_SHARE = 0.2  # of the rate in the second half of a hold: within this it is steady

TOO_LITTLE = "turn: too short, change of heading under constant rudder [deg]"
AGAINST = "turn: the vehicle turns against its rudder, by [deg]"
EASED = "turn: an autopilot's change of course, the rudder eases off after a turn of [deg]"


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
        start, stop = execute(piece, scales, p), p.stop
        least = LEAST_TURN_RAD
        if eases_off(piece, scales, p, start):
            stop = _without_course_order(piece, scales, p)
            ordered = stop < p.stop or _was_ordered(piece, scales, p, start)
            least = LEAST_TURN_RAD if ordered else LEAST_EASED_RAD
        reason = judge_turn(piece, scales, Plateau(p.start, stop, p.level), least)
        if reason is None:
            found.append(Found("turn", piece, start, stop, p.level))
        elif reason[0]:
            rejected.append(piece.rejected(start, stop, *reason))
    return found, rejected


def find_steady_turns(piece: Piece, scales: Scales, taken: Sequence[Found]) -> list[Found]:
    """Turns at a steady rate under a rudder that a person holds, a load moves, or that is eased.

    Parameters
    ----------
    piece : Piece
        Uninterrupted piece of a trial.
    scales : Scales
        Yardsticks of the trial.
    taken : sequence of Found
        Turns and zigzags of this piece.

    Returns
    -------
    list of Found
        From rudder execute to rudder release, in time order.
    """
    others = Spans((f.start, f.stop) for f in taken)
    return [
        Found("turn", piece, execute(piece, scales, p), p.stop, p.level)
        for p in swept_fins(piece)
        if not others.meets(p.start, p.stop)
        and judge_turn(piece, scales, p, LEAST_TURN_RAD) is None
        and steady_heading(piece, scales, p) >= LEAST_STEADY_RAD
    ]


def steady_heading(piece: Piece, scales: Scales, p: Plateau) -> float:
    """Largest change of heading at a steady rate within a hold [rad]."""
    rate = piece.rate_mean[p.start : p.stop]
    usual = float(np.median(rate[rate.size // 2 :]))
    band = max(STEADY_SHARE * abs(usual), NOISE_BAND * scales.rate_noise_radps)
    spans = true_ranges(np.abs(rate - usual) <= min(band, HALF * abs(usual)))
    angle = piece.angle[p.start : p.stop]
    return max((abs(float(angle[b - 1] - angle[a])) for a, b in spans), default=0.0)


def judge_turn(
    piece: Piece, scales: Scales, p: Plateau, least_rad: float
) -> tuple[str, float, float] | None:
    """None for a turn, else reason, value, threshold; an empty reason is not worth a word."""
    turned = float(piece.angle[p.stop - 1] - piece.angle[p.start])
    change = abs(turned)
    slow = too_slow(piece, scales, p)
    if slow is not None:
        meant = change >= LOOKED_LIKE_RAD or _was_meant(piece, p)
        return f"turn: {slow[0]}" if meant else "", *slow[1:]
    if change >= least_rad and turned * p.level * scales.drive < 0:
        return AGAINST, float(np.degrees(change)), 0.0
    whole = float(piece.angle[p.stop - 1] - piece.angle[execute(piece, scales, p)])
    whole *= float(np.sign(turned))
    if change >= least_rad and whole < LEAST_TURN_RAD:  # first it took back another turn
        return TOO_LITTLE, float(np.degrees(whole)), float(np.degrees(LEAST_TURN_RAD))
    if change >= least_rad:
        return None
    reason = "" if change < LOOKED_LIKE_RAD else TOO_LITTLE
    if change >= LEAST_TURN_RAD:
        reason = EASED
    return reason, float(np.degrees(change)), float(np.degrees(least_rad))


def too_slow(piece: Piece, scales: Scales, p: Plateau) -> tuple[str, float, float] | None:
    """Reason, value and threshold if the vehicle hardly runs when the fin is put to `p`."""
    speed, least = float(piece.speed[p.start]), LEAST_SPEED_SHARE * scales.speed_mps
    if speed < least:
        return "too slow, speed at the execute [m/s]", speed, least
    rpm, least = float(np.median(np.abs(piece.rpm[p.start : p.stop]))), LEAST_RPM_SHARE * scales.rpm
    if rpm < least:
        return "too little thrust at the execute [rpm]", rpm, least
    return None


def eases_off(piece: Piece, scales: Scales, p: Plateau, start: int) -> bool:
    """Whether the rudder leaves its angle as under an autopilot that nears its course.

    It then falls to half of the angle much slower than it came and without a rest on the way;
    a rest is the stop at which an autopilot holds the rudder after a release.
    """
    side = np.sign(p.level)
    below = _first_below(piece.fin[p.stop :], side, HALF * abs(p.level))
    if below is None:
        return False
    path, second = piece.fin[p.stop : p.stop + below + 1] * side, max(1, piece.samples(1.0))
    if path.size > second and np.min(np.abs(path[second:] - path[:-second])) < scales.tolerance_rad:
        return False
    entry_s, exit_s = piece.seconds(start, p.start), piece.seconds(p.stop, p.stop + below)
    return exit_s > EASED_FACTOR * entry_s + EASED_S


def _first_below(fin: Array, side: float, limit: float) -> int | None:
    """First sample that is below a limit on a side; it is near as a rule, and the log is long."""
    start, size = 0, NEAR_SAMPLES
    while start < fin.size:
        below = np.flatnonzero(fin[start : start + size] * side < limit)
        if below.size:
            return start + int(below[0])
        start, size = start + size, 2 * size
    return None


def _without_course_order(piece: Piece, scales: Scales, p: Plateau) -> int:
    """End of a turn that an autopilot continued at the same angle, if its new speed tells when."""
    for step in reversed(thrust_steps(piece, scales, p.start, p.stop)):
        before = abs(float(piece.angle[step] - piece.angle[p.start]))
        after = abs(float(piece.angle[p.stop - 1] - piece.angle[step]))
        if before >= LEAST_TURN_RAD and after <= COURSE_ORDER_RAD:
            return step
    return p.stop


def _was_ordered(piece: Piece, scales: Scales, p: Plateau, start: int) -> bool:
    """Whether the execute comes out of a settled course together with a new speed.

    A transit settles before a maneuver, and maneuvers come with their speeds; the second of two
    course orders comes with neither.
    """
    near = piece.samples(ORDER_S)
    before = piece.fin[max(0, start - piece.samples(SETTLED_S)) : start]
    settled = before.size > 0 and float(np.max(np.abs(before))) < HALF * abs(p.level)
    return settled and bool(thrust_steps(piece, scales, start - near, start + near))


def thrust_steps(piece: Piece, scales: Scales, start: int, stop: int) -> list[int]:
    """Samples in a range, within the piece, at which the propeller rate begins to change."""
    second = max(1, piece.samples(1.0))
    first = max(start, second)
    last = max(first, min(stop, piece.size))
    change = np.abs(piece.rpm[first:last] - piece.rpm[first - second : last - second])
    moving = change > max(RPM_LEVEL_SHARE * scales.rpm, 4 * scales.rpm_noise)
    begins = np.flatnonzero(np.diff(np.concatenate(([0], moving.astype(np.int8)))) == 1)
    return [first + int(i) for i in begins]


def _was_meant(piece: Piece, p: Plateau) -> bool:
    """A large angle held for long."""
    return abs(p.level) >= HARD_OVER_RAD and p.samples >= piece.samples(LONG_HOLD_S)


def execute(piece: Piece, scales: Scales, p: Plateau) -> int:
    """Sample at which the fin began to move towards the level of `p`."""
    span = max(1, piece.samples(RAMP_SPAN_S))
    start = ramp_start(piece.fin, p.start, p.level, span, scales.tolerance_rad)
    travel_s = TRAVEL_FACTOR * 2 * abs(p.level) / max(scales.fin_slew_radps, 1e-6)
    return max(start, p.start - piece.samples(travel_s) - span)
