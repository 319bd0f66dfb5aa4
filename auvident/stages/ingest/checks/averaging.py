"""Velocities that went through a moving average before they were logged.

The average hides the noise, but not all of it: its differences are those of samples n apart, so
that the noise of one sample comes back n samples later with the other sign. Nothing else does
that at one lag alone: white noise is over after three differences, motion and waves change little
from one lag to the next.
"""

import numpy as np

from auvident.constants import MEDIAN_OF_ABS_TO_STD
from auvident.schema.logs import RawSensor
from auvident.stages.ingest.checks.row import Verdict, agrees, contradicts, untested
from auvident.stages.ingest.checks.seen import Array, Seen
from auvident.stages.ingest.resample import median_period

VELOCITIES = ("u_mps", "v_mps")
DELAY_S = 0.3  # of half the average: as late as a bus may make a DVL, ...
DELAY_LENGTHS = 0.1  # ... and in L/U: shorter than a turn takes to begin
ORDER = 3  # of the differences: motion is smooth over as many samples
FEWEST, MOST = 4, 100  # samples of an average; differences of fewer overlap
SAMPLES = (10 * MOST, 200_000)  # fewer tell no correlation; more tell it no better
CLIPPED = 3.0  # standard deviations: waves, onsets and outliers shall not decide
# Correlation at a lag less the mean of those beside it: -0.83 of an average, -0.1 at most of clean
# trials of even seeds. Elsewhere an average has none, an oscillation has as much.
DIP, ELSEWHERE = -0.5, 0.3


def dvl_averaged(seen: Seen) -> Verdict:
    """Samples of u and v with noise of their own, not of those before them."""
    dvl = seen.raw.sensors.get("dvl")
    found = None if dvl is None or {*VELOCITIES} & {*dvl.not_logged} else correlation(dvl)
    if dvl is None or found is None or not np.isfinite(seen.passage_s):
        return untested("too few samples of u and v, without noise, or the vehicle hardly moves")
    count, dip = averaged_over(found)
    if not count:
        return agrees("each sample of u and v has noise of its own", dip)
    width_s = count * median_period(np.sort(dvl.time_s[np.isfinite(dvl.time_s)]))
    delay_s = 0.5 * (width_s - width_s / count)
    words = f"u and v are moving averages over {count} samples ({width_s:.1f} s)"
    if delay_s <= max(DELAY_S, DELAY_LENGTHS * seen.passage_s):
        return agrees(f"{words}, short for this vehicle", delay_s)
    return contradicts(
        f"{words}, {delay_s:.2f} s late unless they are centred",
        delay_s,
        "Log the DVL without its filter; else take the delay off the stamps, in a map (--map): "
        f"[dvl] time_offset_s = {-delay_s:.2f}.",
    )


def correlation(dvl: RawSensor) -> Array | None:
    """Autocorrelation of the differences of u and v, at lags 0 to `MOST` + 1; None without any."""
    values = np.array([dvl.values[c] for c in VELOCITIES if c in dvl.values])
    values = values[:, np.isfinite(values).all(axis=0)] if values.size else values.reshape(1, -1)
    fresh = np.concatenate(([True], (values[:, 1:] != values[:, :-1]).any(axis=0)))
    values = values[:, fresh[: values.shape[1]]][:, : SAMPLES[1]]
    if values.shape[1] < SAMPLES[0]:
        return None
    steps = np.diff(values, ORDER, axis=1)
    spread = MEDIAN_OF_ABS_TO_STD * np.median(np.abs(steps), axis=1, keepdims=True)
    if not (spread > 0.0).all():
        return None
    steps = np.clip(steps / spread, -CLIPPED, CLIPPED)
    steps -= steps.mean(axis=1, keepdims=True)
    lags = range(MOST + 2)
    found = np.array([(steps[:, k:] * steps[:, : steps.shape[1] - k]).mean() for k in lags])
    return np.asarray(found / found[0])


def averaged_over(found: Array) -> tuple[int, float]:
    """Samples of the moving average that a correlation shows, 0 without one, and its dip."""
    lags = np.arange(FEWEST, MOST + 1)
    dips = found[lags] - 0.5 * (found[lags - 1] + found[lags + 1])
    best = int(np.argmin(dips))
    apart = np.abs(np.arange(found.size) - lags[best]) >= ORDER
    apart[:ORDER] = False
    if dips[best] > DIP or np.abs(found[apart]).max() > ELSEWHERE:
        return 0, float(dips[best])
    return int(lags[best]), float(dips[best])
