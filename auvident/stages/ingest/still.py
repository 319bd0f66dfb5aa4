"""Channels that never change although a vehicle under way moves them: nothing was measured.

A sensor that is not connected logs zeros. Held against other channels it passes for a wrong scale
of these: with a heave of zeros the depth seems to change too slowly for the speed.
"""

import numpy as np
import pandas as pd

OF_MOTION = (
    "w_mps", "p_radps", "q_radps", "roll_rad", "pitch_rad", "depth_m", "north_m", "east_m",
)  # fmt: skip
ROUNDING = 1e-9  # relative; a constant that was brought to a grid


def still_channels(table: pd.DataFrame) -> frozenset[str]:
    """Those of `OF_MOTION` in a trial's table that have one and the same value throughout."""
    return frozenset(c for c in OF_MOTION if c in table and is_still(table[c].to_numpy(float)))


def is_still(values: np.ndarray) -> bool:
    """Whether what is known of a channel has one value, but for rounding."""
    known = values[np.isfinite(values)]
    return known.size > 0 and bool(np.ptp(known) <= ROUNDING * np.max(np.abs(known)))
