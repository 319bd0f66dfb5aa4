"""Where the error of an angle can be told as a share of how the angle varies.

The standard deviation of a heading that runs round and round is that of a ramp: it grows with the
length of the maneuver, and an error of any size is a small share of it. Such an error is told in
degrees alone.
"""

import math

# standard deviation of a heading that turns evenly once round [rad]
ONCE_ROUND_RAD = 2.0 * math.pi / math.sqrt(12.0)
TURNS_ROUND = ("heading",)


def share(channel: str, rmse: float | None, nrmse: float | None) -> float | None:
    """NRMSE of a channel; None for a heading whose variation is that of a spin.

    Parameters
    ----------
    channel : str
        Its symbol.
    rmse, nrmse : float or None
        Root mean square error [SI], and over the standard deviation of what was measured.
    """
    if rmse is None or nrmse is None or (channel in TURNS_ROUND and spins(rmse, nrmse)):
        return None
    return nrmse


def spins(rmse: float, nrmse: float) -> bool:
    """Whether the standard deviation behind an NRMSE [rad] is that of more than one turn."""
    return nrmse > 0.0 and rmse / nrmse > ONCE_ROUND_RAD
