"""Refinement: identify again with what a diagnosis found, keep what predicts better."""

from auvident.stages.refine.along import along
from auvident.stages.refine.attempts import carried_of, choose, unclaimed, windows_of
from auvident.stages.refine.compare import compare, gives_away
from auvident.stages.refine.unexplained import Base, with_unexplained

__all__ = [
    "Base",
    "along",
    "carried_of",
    "choose",
    "compare",
    "gives_away",
    "unclaimed",
    "windows_of",
    "with_unexplained",
]
