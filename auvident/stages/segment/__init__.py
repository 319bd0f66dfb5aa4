"""Find the maneuvers of the trials and decide which identify and which validate."""

from auvident.stages.segment.both import segment_both
from auvident.stages.segment.stage import segment
from auvident.stages.segment.vertical import segment_vertical

__all__ = ["segment", "segment_both", "segment_vertical"]
