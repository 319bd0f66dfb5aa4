"""Six degrees of freedom: one model from those of the planes, and how it flies a log."""

from auvident.stages.combine.flight import (
    INPUT_COLUMNS,
    STATE_COLUMNS,
    of_coefficients_alone,
    simulate_whole,
)
from auvident.stages.combine.stage import combine

__all__ = [
    "INPUT_COLUMNS",
    "STATE_COLUMNS",
    "combine",
    "of_coefficients_alone",
    "simulate_whole",
]
