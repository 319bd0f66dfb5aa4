"""Readings without their fastest noise, where what follows from them would multiply it."""

from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import VehicleTime

Array = npt.NDArray[Any]

# the noise of a DVL at 2 to 10 Hz falls to a third; a surge changes in several L/U
SMOOTHED_S: VehicleTime = 1.5


def smoothed(states: Array, dt_s: float) -> Array:
    """States (n, m) without their fastest noise."""
    window = 2 * round(0.5 * SMOOTHED_S / dt_s) + 1
    return states if len(states) < window or window < 5 else local_parabolas(states, window)


def local_parabolas(values: Array, window: int) -> Array:
    """Values (n, m) of parabolas fitted to `window` (odd) rows each (Savitzky and Golay 1964).

    The first and last rows lie on the first and last parabola. What scipy.signal returns; to
    import that takes half as long as an identification.
    """
    half = window // 2
    powers = np.vander(np.arange(-half, half + 1.0), 3)
    hat = powers @ np.linalg.pinv(powers)
    middle = np.lib.stride_tricks.sliding_window_view(values, window, axis=0) @ hat[half]
    ends = hat[:half] @ values[:window], hat[half + 1 :] @ values[-window:]
    smooth: Array = np.concatenate([ends[0], middle, ends[1]])
    return smooth
