"""Rolling moves a DVL that sits above or below the axis sideways; that is taken out of its log.

The models of both planes know no roll. At the position (x, y, z) of the DVL the sway velocity is
v + x r - z p (theory 1.1); x r stands in the sensor matrix, z p is known from the log.
"""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from auvident.schema.artifacts import Finding
from auvident.schema.vehicle import Dvl
from auvident.stages.ingest.clean import CleanSensor, Series
from auvident.stages.ingest.resample import gap_limit

ROLL_RATE, AHEAD, ASIDE = "p_radps", "u_mps", "v_mps"


def without_roll(
    sensors: Mapping[str, CleanSensor], dvl: Dvl, max_gap_s: float
) -> tuple[dict[str, CleanSensor], tuple[Finding, ...]]:
    """Velocities of the DVL as it would read them on the axis.

    Parameters
    ----------
    sensors : mapping of str to CleanSensor
    dvl : Dvl
        Height and mounting angle.
    max_gap_s : float
        Longest interval between roll rates over which they are interpolated.

    Returns
    -------
    sensors : dict of str to CleanSensor
        The same without a height or a logged roll rate.
    findings : tuple of Finding
        What was done, if anything.
    """
    rate = next((k.series[ROLL_RATE] for k in sensors.values() if ROLL_RATE in k.series), None)
    own = next((k for k in sensors.values() if ASIDE in k.series), None)
    if dvl.down_m == 0.0 or rate is None or own is None or ASIDE in own.raw.not_logged:
        return dict(sensors), ()
    if not np.ptp(own.series[ASIDE].values):  # stands still: nothing was measured
        return dict(sensors), ()
    yaw, series = math.radians(dvl.mounting_yaw_deg), dict(own.series)
    for column, share in ((AHEAD, math.sin(yaw)), (ASIDE, math.cos(yaw))):
        if column in series:
            read = series[column]
            added = share * dvl.down_m * np.nan_to_num(_at(rate, read.time_s, max_gap_s))
            series[column] = read.changed_by(added)
    roll = _at(rate, own.series[ASIDE].time_s, max_gap_s)
    moved = replace(own, series=series)
    return {**sensors, own.raw.sensor: moved}, (_done(own, dvl, roll),)


def _at(rate: Series, time_s: np.ndarray, max_gap_s: float) -> np.ndarray:
    """Roll rate at other times; NaN outside of its log and in gaps."""
    found = np.interp(time_s, rate.time_s, rate.values, left=np.nan, right=np.nan)
    after = np.clip(np.searchsorted(rate.time_s, time_s), 1, len(rate.time_s) - 1)
    wide = np.diff(rate.time_s)[after - 1] > gap_limit(rate.time_s, max_gap_s)
    return np.where(wide, np.nan, found)


def _done(own: CleanSensor, dvl: Dvl, roll: np.ndarray) -> Finding:
    """The line of the record."""
    known = np.isfinite(roll)
    most = abs(dvl.down_m) * float(np.max(np.abs(roll[known]), initial=0.0))
    side = "below" if dvl.down_m > 0.0 else "above"
    left = (
        f"; {np.sum(~known)} readings without a roll rate are as logged" if not all(known) else ""
    )
    return Finding(
        code="dvl_roll_removed",
        message=f"the DVL sits {abs(dvl.down_m):g} m {side} the origin: its velocity aside is "
        f"corrected for the logged roll rate (v + z p), by up to {most:.2g} m/s{left}",
        where=own.raw.file,
        value=most,
    )
