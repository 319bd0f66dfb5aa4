"""Validation: re-simulation of whole maneuvers from their initial state and inputs alone."""

from auvident.stages.validate.stage import (
    ACTIVE,
    Prediction,
    Validation,
    compare,
    tracks,
    validate,
)

__all__ = ["ACTIVE", "Prediction", "Validation", "compare", "tracks", "validate"]
