"""Maneuver figures: turning circle, zigzag and straight run, measured or simulated.

Definitions after IMO MSC.137(76) and ITTC 7.5-04-02-01. Pure functions on arrays of equal shape
(n,), SI and radians in, the unit of each figure as the suffix of its name out. A figure that
the record does not reach (the tactical diameter of a turn through 150 degrees) is absent.

The track is found by dead reckoning of the body velocities, so it is the track through the
medium the velocities refer to, and a drifting position sensor does not enter.
"""

from auvident.physics.maneuvers.straight import rpm_levels, straight_figures
from auvident.physics.maneuvers.track import (
    dead_reckoning,
    first_crossing,
    headings_from_start,
    integral_of,
    track_of,
)
from auvident.physics.maneuvers.turn import turn_figures
from auvident.physics.maneuvers.zigzag import reversals, zigzag_figures

__all__ = [
    "dead_reckoning",
    "first_crossing",
    "headings_from_start",
    "integral_of",
    "reversals",
    "rpm_levels",
    "straight_figures",
    "track_of",
    "turn_figures",
    "zigzag_figures",
]
