"""Straight runs: the heading is left alone while the thrust is stepped.

A transit is straight as well. What tells them apart is the thrust step; where the run begins
and ends within the straight stretch is read from the levels of the propeller and from the
rudder, which works harder under the transit's autopilot than during the run.
"""

from collections.abc import Sequence

import numpy as np

from auvident.constants import MEDIAN_OF_ABS_TO_STD, VehicleTime
from auvident.physics.maneuvers.plateaus import (
    odd_samples,
    plateaus,
    running_mean,
)
from auvident.physics.maneuvers.straight import RPM_STEP_SHARE, SHORTEST_LEVEL_S, rpm_levels
from auvident.schema.artifacts import Rejected
from auvident.stages.segment.depth import sink_rate
from auvident.stages.segment.helm import Level, split_by_other_helm, without_other_helm
from auvident.stages.segment.pieces import MEAN_WINDOW_S, Found, Piece, true_ranges
from auvident.stages.segment.scales import LEAST_FIN_RAD, Scales
from auvident.stages.segment.spans import Spans

FALLBACK_YAW_RATE_RADPS = np.radians(1.0)  # limit of straight where nothing was ever steered
STEADY_EQUIVALENT_RAD = np.radians(3.0)  # straight: turning no faster than this rudder would turn
STEADY_RUDDER_RAD = np.radians(6.0)  # running mean; heading kept gently stays well below
STEADY_NOISE_BAND = 3.0
SEA_BAND = 3.0  # standard deviations of the yaw rate that the sea alone makes
DRIFT_EQUIVALENT_RAD = np.radians(9.0)  # asymmetry and sea turn no faster than this rudder would
REST_S: VehicleTime = 10.0  # a rudder still for this long has been left alone
AFLOAT_SPEED_SHARE = 0.2  # of cruise: below, the vehicle does not run
DIVE_SLOPE = 0.1  # vertical over forward speed (6 degrees): diving or surfacing, not a level run
BRIDGE_S = 3.0  # a gust or a wave may disturb the run for this long ...
BRIDGE_RAD = np.radians(5.0)  # ... and by this heading
EDGE_RPM_SHARE = 0.5  # of cruise: a first or last level below has a quarter of the thrust, idles
EDGE_SPEED_SHARE = 0.35  # of cruise
EDGE_LEVEL_SHARE = 0.6  # of the other levels: a shorter first or last one is a settling transit
# two levels alone: each must last long enough for the speed to answer
SHORTEST_EDGE_S: VehicleTime = 15.0
LONG_RUN_S: VehicleTime = 30.0  # a straight run of this length without a step deserves a word
RUN_RANGE_SHARE = 0.12  # of cruise rpm: a quarter of the thrust, more than transits differ by
# a step this close to the beginning of the straight stretch bounds the level
STEP_REACH_S: VehicleTime = 3.0

NO_STEP = "straight: no thrust step, change of rpm"
TOO_SHORT = "straight: the levels on either side of the thrust step do not last, shortest [s]"


def find_straights(
    piece: Piece, scales: Scales, taken: Sequence[Found]
) -> tuple[list[Found], list[Rejected]]:
    """Straight runs with thrust steps outside the maneuvers already found.

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
    list of Found, list of Rejected
        From the start of the first to the end of the last thrust level, in time order; and
        what fell short.
    """
    found: list[Found] = []
    rejected: list[Rejected] = []
    for start, stop in steady_stretches(piece, scales, taken):
        levels = _levels(piece, scales, start, stop)
        runs = [
            _without_transit(piece, scales, part) for part in split_by_other_helm(piece, levels)
        ]
        least = RUN_RANGE_SHARE * scales.rpm
        good = [run for run in runs if len(run) >= 2 and _range(run) >= least]
        found += [Found("straight", piece, run[0][0], run[-1][1]) for run in good]
        if not good and piece.seconds(start, stop) >= LONG_RUN_S:
            longest = max(runs, key=len)
            rejected.append(_why_not(piece, scales, start, stop, longest, levels))
    return found, rejected


def _range(run: list[Level]) -> float:
    """Difference between the highest and the lowest propeller rate of a run [1/min]."""
    rpm = [level for _, _, level in run]
    return max(rpm) - min(rpm) if len(rpm) >= 2 else 0.0


def steady_stretches(piece: Piece, scales: Scales, taken: Sequence[Found]) -> list[tuple[int, int]]:
    """Half-open ranges in which the vehicle runs level and straight."""
    steady = steady_mask(piece, scales)
    for other in taken:
        steady[other.start : other.stop] = False
    ranges, others = true_ranges(steady), Spans((f.start, f.stop) for f in taken)
    joined: list[tuple[int, int]] = []
    for start, stop in ranges:
        if joined and _bridged(piece, joined[-1][1], start, others):
            start = joined.pop()[0]
        joined.append((start, stop))
    return joined


def steady_mask(piece: Piece, scales: Scales) -> np.ndarray:
    """Samples at which the vehicle neither turns, nor steers, nor dives, nor stands."""
    rudder = running_mean(piece.fin, odd_samples(MEAN_WINDOW_S, piece.rate_hz))
    small = np.abs(rudder) <= STEADY_RUDDER_RAD
    afloat = piece.speed >= AFLOAT_SPEED_SHARE * scales.speed_mps
    rate = np.abs(piece.rate_mean)
    least, most = rate_limits(scales)
    sea = float(np.median(rate[small & afloat])) if (small & afloat).any() else 0.0
    limit = np.clip(SEA_BAND * MEDIAN_OF_ABS_TO_STD * sea, least, most)
    steady = small & afloat & ((rate <= limit) | (_at_rest(piece, scales) & (rate <= most)))
    dives = np.abs(sink_rate(piece)) > DIVE_SLOPE * np.maximum(piece.speed, scales.speed_mps)
    return np.asarray(steady & ~dives)  # a rate that nothing tells is no dive


def rate_limits(scales: Scales) -> tuple[float, float]:
    """Yaw rate that is straight in calm water, and at most [rad/s]."""
    per_rudder = scales.gain_radpm * scales.speed_mps
    least = per_rudder * STEADY_EQUIVALENT_RAD or FALLBACK_YAW_RATE_RADPS
    least = max(least, STEADY_NOISE_BAND * scales.rate_noise_radps)
    return least, max(least, per_rudder * DRIFT_EQUIVALENT_RAD)


def _at_rest(piece: Piece, scales: Scales) -> np.ndarray:
    """Where the rudder lies still amidships: what turns the vehicle then is no helm."""
    rest = np.zeros(piece.size, dtype=bool)
    for p in plateaus(piece.fin, scales.tolerance_rad):
        if abs(p.level) < LEAST_FIN_RAD and p.samples >= piece.samples(REST_S):
            rest[p.start : p.stop] = True
    return rest


def _bridged(piece: Piece, end: int, start: int, others: Spans) -> bool:
    """Whether two steady ranges are one run with a short disturbance between them."""
    if start - end > piece.samples(BRIDGE_S):
        return False
    if others.meets(end, start):
        return False
    return bool(np.ptp(piece.angle[end - 1 : start + 1]) <= BRIDGE_RAD)


def _levels(piece: Piece, scales: Scales, start: int, stop: int) -> list[Level]:
    """Levels of the propeller rate in a range, in samples of the piece."""
    levels = rpm_levels(piece.rpm[start:stop], piece.rate_hz, scales.rpm_noise, scales.rpm)
    return [(a + start, b + start, rpm) for a, b, rpm in levels]


def _without_transit(piece: Piece, scales: Scales, levels: list[Level]) -> list[Level]:
    """Levels of the run itself: idle and transit levels are taken off both ends."""
    run = list(levels)
    for end in (0, -1):
        while len(run) >= 2 and _idles(piece, scales, run[end]):
            run.pop(end)
    if len(run) < 2:
        return run
    outer = (_outer_step(piece, scales, run[0][0], -1), _outer_step(piece, scales, run[-1][1], 1))
    run = without_other_helm(piece, run)
    for end, bounded in zip((-1, 0), reversed(outer), strict=True):
        least = SHORTEST_LEVEL_S
        if not bounded:
            least = SHORTEST_EDGE_S if len(run) <= 2 else _edge_least(piece, run)
        if len(run) >= 2 and piece.seconds(*run[end][:2]) < least:
            run.pop(end)
    return run


def _idles(piece: Piece, scales: Scales, level: Level) -> bool:
    """Whether a level is too slow to begin or end a run."""
    start, stop, rpm = level
    settled = float(np.mean(piece.speed[(start + stop) // 2 : stop]))
    slow = settled < EDGE_SPEED_SHARE * scales.speed_mps
    return slow or abs(rpm) < EDGE_RPM_SHARE * scales.rpm


def _outer_step(piece: Piece, scales: Scales, index: int, side: int) -> bool:
    """Whether the propeller rate changes just outside a level, on the given side."""
    reach = piece.samples(STEP_REACH_S)
    a, b = sorted((index - side, index + side * reach))
    near = piece.rpm[max(a, 0) : max(b, 1)]
    return near.size > 0 and bool(np.ptp(near) >= RPM_STEP_SHARE * scales.rpm)


def _edge_least(piece: Piece, run: list[Level]) -> float:
    """Least length of a first or last level, from the levels between [s]."""
    return EDGE_LEVEL_SHARE * float(np.median([piece.seconds(a, b) for a, b, _ in run[1:-1]]))


def _why_not(
    piece: Piece, scales: Scales, start: int, stop: int, run: list[Level], levels: list[Level]
) -> Rejected:
    """The reason why a straight stretch is no run."""
    if len(run) < 2 and _range(levels) >= RUN_RANGE_SHARE * scales.rpm:
        shortest = min(piece.seconds(a, b) for a, b, _ in levels)
        return piece.rejected(start, stop, TOO_SHORT, shortest, SHORTEST_EDGE_S)
    return piece.rejected(start, stop, NO_STEP, _range(levels), RUN_RANGE_SHARE * scales.rpm)
