"""Six degrees of freedom: one model from those of the planes, and how it flies a log."""

from auvident.stages.combine.flight import (
    INPUT_COLUMNS,
    STATE_COLUMNS,
    beyond_ranges,
    of_coefficients_alone,
    simulate_whole,
    unread_starts,
)
from auvident.stages.combine.stage import combine

__all__ = [
    "INPUT_COLUMNS",
    "STATE_COLUMNS",
    "beyond_ranges",
    "combine",
    "of_coefficients_alone",
    "simulate_whole",
    "unread_starts",
]
