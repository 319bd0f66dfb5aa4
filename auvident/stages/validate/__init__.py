"""Validation: re-simulation of whole maneuvers from their initial state and inputs alone."""

from auvident.stages.validate.side_by_side import held_out_errors
from auvident.stages.validate.stage import (
    Prediction,
    Validation,
    compare,
    tracks,
    validate,
)

__all__ = [
    "Prediction",
    "Validation",
    "compare",
    "held_out_errors",
    "tracks",
    "validate",
]
