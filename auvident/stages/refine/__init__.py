"""Refinement: identify again with what a diagnosis found, keep what predicts better."""

from auvident.stages.refine.attempts import carried_of, choose
from auvident.stages.refine.compare import compare

__all__ = ["carried_of", "choose", "compare"]
