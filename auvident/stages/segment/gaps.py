"""Maneuvers cut by a gap in the record: what is left of them, and that it is said.

A short drop-out of a sensor leaves a maneuver recognisable: its parts on either side, each
within one record, are used and keep one role. Across a long gap nobody knows what happened: of
two sides that each are a maneuver, and look like one, the longer is used.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from auvident.constants import ANSWER_S
from auvident.schema.artifacts import Finding, Rejected
from auvident.stages.segment.pieces import Found

TOUCH_S = 1.5  # a maneuver that ends this close to a gap was cut by it
SAME_LEVEL_SHARE = 0.25  # of the fin angle: both sides of the gap are one maneuver


OTHER_SIDE = "{}: the shorter side of a maneuver cut by a gap in the record, length [s]"


def settle_cuts(
    found: Sequence[Found],
) -> tuple[list[Found], list[Rejected], list[Finding]]:
    """Of two parts of one maneuver keep the longer.

    Parameters
    ----------
    found : sequence of Found
        All maneuvers of one trial, in time order.

    Returns
    -------
    list of Found, list of Rejected, list of Finding
        Maneuvers that stay, shorter parts, and a finding for every maneuver at a gap.
    """
    kept: list[Found] = []
    rejected: list[Rejected] = []
    for f in found:
        if kept and _one_maneuver(kept[-1], f):
            short, long = sorted((kept.pop(), f), key=lambda x: x.seconds)
            reason = OTHER_SIDE.format(short.kind)
            rejected.append(
                short.piece.rejected(short.start, short.stop, reason, short.seconds, long.seconds)
            )
            f = long
        kept.append(f)
    cut = [f for f in kept if _begins_cut(f) or _ends_cut(f)]
    torn = [f for f in kept if (f.piece.record[f.start : f.stop] < 0).any()]
    return kept, rejected, [*map(_finding, cut), *map(_torn, torn)]


def parts_of(f: Found) -> list[tuple[int, int]]:
    """Uninterrupted parts of a maneuver that are worth using, half-open sample ranges.

    The longest part is returned even if it is short.
    """
    record = f.piece.record[f.start : f.stop]
    edges = [0, *(np.flatnonzero(np.diff(record)) + 1).tolist(), record.size]
    parts = [(f.start + a, f.start + b) for a, b in pairwise(edges) if b > a and record[a] >= 0]
    least = f.piece.samples(ANSWER_S)
    return [p for p in parts if p[1] - p[0] >= least] or [max(parts, key=lambda p: p[1] - p[0])]


def _begins_cut(f: Found) -> bool:
    return not f.piece.is_first and f.start <= f.piece.samples(TOUCH_S)


def _ends_cut(f: Found) -> bool:
    return not f.piece.is_last and f.piece.size - f.stop <= f.piece.samples(TOUCH_S)


def _one_maneuver(a: Found, b: Found) -> bool:
    """Whether a gap lies between two parts of the same maneuver."""
    if a.kind != b.kind or b.piece.number <= a.piece.number:
        return False
    same = abs(a.level_rad - b.level_rad) <= SAME_LEVEL_SHARE * max(abs(a.level_rad), 1e-9)
    return same and _ends_cut(a) and _begins_cut(b)


def _finding(f: Found) -> Finding:
    where = f"{f.piece.trial}, {f.piece.time(f.start):.1f} to {f.piece.time(f.stop):.1f} s"
    return Finding(
        code="cut_by_gap",
        message=f"A gap in the record cuts this {f.kind}; its longest uninterrupted part is used.",
        where=where,
        value=round(f.seconds, 2),
        remedy="See the quality report of the ingest stage for the sensor that dropped out.",
    )


def _torn(f: Found) -> Finding:
    where = f"{f.piece.trial}, {f.piece.time(f.start):.1f} to {f.piece.time(f.stop):.1f} s"
    parts = parts_of(f)
    lost = f.seconds - sum(f.piece.seconds(a, b) for a, b in parts)
    return Finding(
        code="torn_by_dropout",
        message=f"Drop-outs of a sensor split this {f.kind}: {len(parts)} uninterrupted "
        f"part(s) of it are used together, {lost:.1f} s are not.",
        where=where,
        value=round(lost, 2),
        remedy="See the quality report of the ingest stage for the sensor that dropped out.",
    )
