"""Maneuvers in windows, each predicted from the readings at its own start."""

from collections.abc import Mapping

import numpy as np

from auvident.constants import VehicleTime
from auvident.schema.artifacts import ChannelMetrics, Maneuvers

HORIZONS_S: tuple[VehicleTime, ...] = (5.0, 20.0)


def windows_of(maneuvers: Maneuvers, horizon_s: float) -> Maneuvers:
    """Held-out maneuvers cut into windows of one length; what is left at the end does not count."""
    found = []
    for m in maneuvers.maneuvers:
        if m.role == "validate":
            count = int((m.t_end_s - m.t_start_s) / horizon_s + 1e-9)
            for start in m.t_start_s + horizon_s * np.arange(count):
                times = {"t_start_s": float(start), "t_end_s": float(start) + horizon_s}
                found.append(m.model_copy(update=times))
    return maneuvers.model_copy(update={"maneuvers": tuple(found)})


def over_the_same_spread(
    found: Mapping[str, ChannelMetrics], free: Mapping[str, ChannelMetrics]
) -> dict[str, ChannelMetrics]:
    """Errors in shares of what varies over whole maneuvers, as those of the free prediction.

    A heading and a track are counted from the start of each window, and vary less within it.
    """
    told = {}
    for name, m in found.items():
        if name in free and free[name].nrmse > 0.0:
            nrmse = m.rmse * free[name].nrmse / free[name].rmse
            told[name] = m.model_copy(update={"nrmse": nrmse, "r2": 1.0 - nrmse**2})
    return told
