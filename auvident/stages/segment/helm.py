"""Who steers? The bounds of a straight run from the restlessness of its rudder.

The command of an autopilot carries the noise of its heading and rate sensors times its gains.
In a straight run the rudder rests or the gains are gentle, in a transit they are not. The change
shows in the sample-to-sample motion of the rudder even when the heading is perfectly steady.
"""

import numpy as np

from auvident.constants import VehicleTime
from auvident.physics.maneuvers.plateaus import Array
from auvident.stages.segment.pieces import Piece

Level = tuple[int, int, float]

BLOCK_S = 1.0  # restlessness is pooled over this
RESOLUTION_RAD = np.radians(0.005)  # of a fin log; less motion is none
LOUDER = 1.5  # ratio of RMS motion that tells two helms apart; one helm varies by 10 to 20 %
SURE = 5.0  # standard errors of the difference: a chance of 1e-6 per cut that is tried
LEAST_BLOCKS = 3  # on either side
SHORTEST_TRANSIT_S: VehicleTime = 8.0  # between two runs: to take over, settle and hand back
NEAR_S: VehicleTime = 15.0  # next to a single step, what surely is the run if anything is


def restlessness(piece: Piece) -> Array:
    """Logarithm of the mean squared rudder motion per second, one value per `BLOCK_S`."""
    block = max(2, piece.samples(BLOCK_S))
    motion = np.diff(piece.fin_logged, prepend=piece.fin_logged[:1]) ** 2
    whole = motion[: motion.size // block * block].reshape(-1, block)
    return np.asarray(np.log(np.mean(whole, axis=1) + RESOLUTION_RAD**2))


def without_other_helm(piece: Piece, run: list[Level]) -> list[Level]:
    """First and last level without the part that another helm steered.

    Parameters
    ----------
    piece : Piece
        Uninterrupted piece of a trial.
    run : list of (start, stop, rpm)
        At least two thrust levels, samples half-open.

    Returns
    -------
    list of (start, stop, rpm)
        As many levels; a first or last level of another helm has length zero.
    """
    noise = restlessness(piece)
    block = max(2, piece.samples(BLOCK_S))
    near = piece.samples(NEAR_S)
    first, last = run[0], run[-1]
    inner_stop = last[0] if len(run) > 2 else min(last[1], last[0] + near)
    inside = _blocks(noise, first[1], inner_stop, block)
    outside = _blocks(noise, first[0], first[1], block)
    begin = first[0] + block * loud_blocks(outside, inside) if outside.size else first[0]
    first = (min(begin, first[1]), first[1], first[2])
    inner_start = first[1] if len(run) > 2 else max(first[0], first[1] - near)
    inside = _blocks(noise, inner_start, last[0], block)
    outside = _blocks(noise, last[0], last[1], block)[::-1]
    end = last[1] - block * loud_blocks(outside, inside) if outside.size else last[1]
    last = (last[0], max(end, last[0]), last[2])
    return [first, *run[1:-1], last]


def split_by_other_helm(piece: Piece, run: list[Level]) -> list[list[Level]]:
    """Two runs where another helm steered between them, else the run as it is.

    The loudest stretch in the middle decides. It must be louder than what is before and after,
    and leave two thrust levels on either side.
    """
    if len(run) < 4:
        return [run]
    block = max(2, piece.samples(BLOCK_S))
    noise = _blocks(restlessness(piece), run[0][0], run[-1][1], block)
    loud = _loudest_stretch(noise, max(LEAST_BLOCKS, round(SHORTEST_TRANSIT_S / BLOCK_S)))
    if loud is None:
        return [run]
    origin = -(-run[0][0] // block)
    start, stop = block * (origin + loud[0]), block * (origin + loud[1])
    before = [(a, min(b, start), rpm) for a, b, rpm in run if a < start]
    after = [(max(a, stop), b, rpm) for a, b, rpm in run if b > stop]
    if len(before) < 2 or len(after) < 2:
        return [run]
    return [*split_by_other_helm(piece, before), *split_by_other_helm(piece, after)]


def _loudest_stretch(noise: Array, shortest: int) -> tuple[int, int] | None:
    """The stretch that differs most surely from the rest, if it is louder than both sides."""
    n = noise.size
    total, square = (np.concatenate(([0.0], np.cumsum(x))) for x in (noise, noise**2))
    a, b = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
    ok = (b - a >= shortest) & (a >= shortest) & (b <= n - shortest)
    if not ok.any():
        return None
    a, b = a[ok], b[ok]
    counts = np.stack([a, b - a, n - b])
    sums = np.stack([total[a], total[b] - total[a], total[n] - total[b]])
    before, inside, after = sums / counts
    residual = np.maximum(square[n] - np.sum(sums**2 / counts, axis=0), 1e-12) / (n - 3)
    louder = inside - np.maximum(before, after)
    error = np.sqrt(residual * (1 / counts[1] + 1 / np.minimum(counts[0], counts[2])))
    sure = np.where(louder >= 2 * np.log(LOUDER), louder / error, 0.0)
    best = int(np.argmax(sure))
    return (int(a[best]), int(b[best])) if sure[best] > SURE else None


def _blocks(noise: Array, start: int, stop: int, block: int) -> Array:
    """Whole blocks inside a range, without those that a step of the leg order may touch."""
    return noise[-(-start // block) : stop // block]


def loud_blocks(outside: Array, inside: Array) -> int:
    """Number of blocks at the beginning of `outside` that are louder than the rest.

    `outside` is in the order in which it approaches `inside`. The best cut by the two-sample
    statistic is taken, again and again on what is left, as long as it is sure.
    """
    cut = 0
    while True:
        more = _one_cut(outside[cut:], inside)
        if more == 0:
            return cut
        cut += more


def _one_cut(outside: Array, inside: Array) -> int:
    """The surest cut, 0 when none is sure."""
    best, surest = 0, SURE
    for k in range(LEAST_BLOCKS, outside.size + 1):
        quiet = np.concatenate([outside[k:], inside])
        if quiet.size < LEAST_BLOCKS:
            continue
        loud = outside[:k]
        difference = float(np.mean(loud) - np.mean(quiet))
        if difference < 2 * np.log(LOUDER):
            continue
        spread = (np.sum((loud - loud.mean()) ** 2) + np.sum((quiet - quiet.mean()) ** 2)) / max(
            1, loud.size + quiet.size - 2
        )
        error = float(np.sqrt(spread * (1 / loud.size + 1 / quiet.size)))
        sure = difference / max(error, 1e-9)
        if sure > surest:
            best, surest = k, sure
    return best
