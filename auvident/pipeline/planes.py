"""Maneuvers of both planes in one list; the identification takes those of its plane."""

from collections.abc import Sequence

from auvident.schema.artifacts import Maneuvers
from auvident.schema.trial import Trial


def segment_both(trials: Sequence[Trial], hold_out: Sequence[str]) -> Maneuvers:
    """As `auvident.stages.segment.segment_both`, which is imported when it is needed."""
    from auvident.stages.segment import segment_both as segment_planes

    return segment_planes(trials, hold_out)
