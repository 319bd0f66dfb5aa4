"""Validation: re-simulation of whole maneuvers from their initial state and inputs alone."""

from auvident.stages.validate.stage import (
    Prediction,
    Validation,
    compare,
    tracks,
    validate,
)

__all__ = ["Prediction", "Validation", "compare", "tracks", "validate"]
