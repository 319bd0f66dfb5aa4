"""Identification: the stages of a plan, from the ASE to the identified model."""

from auvident.stages.identify.held_out import without_held_out
from auvident.stages.identify.setup import headings_compare, prepare
from auvident.stages.identify.shared import Shared, shared_of
from auvident.stages.identify.stage import Identification, identify

__all__ = [
    "Identification",
    "Shared",
    "headings_compare",
    "identify",
    "prepare",
    "shared_of",
    "without_held_out",
]
