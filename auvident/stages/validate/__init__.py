"""Validation: re-simulation of whole maneuvers from their initial state and inputs alone."""

from auvident.stages.validate.side_by_side import side_by_side
from auvident.stages.validate.stage import (
    Prediction,
    Validation,
    compare,
    predict_all,
    tracks,
    validate,
)

__all__ = [
    "Prediction",
    "Validation",
    "compare",
    "predict_all",
    "side_by_side",
    "tracks",
    "validate",
]
