"""How fast the readings of a vehicle can change: more is no motion but a fault of the log."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from auvident.constants import USUAL_SPEED_MPS
from auvident.schema.channels import BY_COLUMN, Channel
from auvident.schema.logs import RawSensor
from auvident.schema.vehicle import Vehicle
from auvident.stages.ingest.outliers import MIN_SAMPLES, MIN_SIGMAS, noise_std, resolution

LEAST_SHARE = 0.1  # of the usual speed: a vehicle at rest all the time has no pace
SPEED_QUANTILE = 0.9  # of |u| over a trial with rests: the speed under way
PIECES, PIECE_ROWS = 100, 2_000  # of a long channel
USUAL_STEP_QUANTILE = 0.75  # of the steps: with one sample in ten wild, a fifth of them is
USUAL_STEPS = 4.0  # times that step: what filters and coarse digits do
RESOLUTIONS = 3.0  # of the smallest step

# Largest rate of change of a quantity: factor, power of the speed U, power of the length L. Of
# vehicles drawn by even seeds in 0.2 s, thrust steps, fins and waves at the surface included:
# u 0.7, v 0.6, w 1.3 U^2/L; q 0.9, r 1.8 (U/L)^2. Roll swings in its own time and has no row.
FASTEST: dict[str, tuple[float, int, int]] = {
    "u": (1.5, 2, -1),
    "v": (1.5, 2, -1),
    "w": (1.5, 2, -1),
    "q": (2.0, 2, -2),
    "r": (2.0, 2, -2),
    "pitch": (2.0, 1, -1),
    "heading": (2.0, 1, -1),
    "depth": (1.5, 1, 0),
    "north": (3.0, 1, 0),
    "east": (3.0, 1, 0),
}


@dataclass(frozen=True)
class Pace:
    """Length and speed that scale what a vehicle can do."""

    length_m: float
    speed_mps: float

    @property
    def passage_s(self) -> float:
        """Time in which it goes its own length."""
        return self.length_m / self.speed_mps

    def fastest(self, channel: Channel) -> float | None:
        """Largest rate of change of a channel per second, or None where none can be stated."""
        if channel.quantity not in FASTEST:
            return None
        factor, of_speed, of_length = FASTEST[channel.quantity]
        return float(factor * self.speed_mps**of_speed * self.length_m**of_length)


def pace_of(sensors: Mapping[str, RawSensor], vehicle: Vehicle) -> Pace:
    """Pace of a trial: the speed from its own log."""
    dvl = sensors.get("dvl")
    u = np.abs(dvl.values["u_mps"]) if dvl is not None and "u_mps" in dvl.values else np.empty(0)
    u = u[u < BY_COLUMN["u_mps"].plausible]
    fast = float(np.quantile(u, SPEED_QUANTILE)) if u.size else 0.0
    usual = vehicle.body.design_speed_mps or USUAL_SPEED_MPS
    return Pace(vehicle.hull.length_m, max(fast, LEAST_SHARE * usual))


def excerpt(values: np.ndarray) -> np.ndarray:
    """Pieces from all over a long channel, enough to tell its noise and its usual steps."""
    if values.size <= 2 * PIECES * PIECE_ROWS:
        return values
    first = np.linspace(0, values.size - PIECE_ROWS, PIECES).astype(int)
    return np.concatenate([values[k : k + PIECE_ROWS] for k in first])


@dataclass(frozen=True)
class StepLimit:
    """Largest step between two samples that noise and motion explain."""

    noise: float
    usual: float
    per_s: float

    @property
    def least(self) -> float:
        """The limit over no time at all."""
        return max(self.noise, self.usual)

    def over(self, seconds: np.ndarray) -> np.ndarray:
        """The limit over intervals of time."""
        return np.maximum(self.noise + self.per_s * seconds, self.usual)

    def wild(self, time_s: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Samples before steps that no motion explains, as indices; few come near the limit."""
        steps = np.diff(values)
        large = np.flatnonzero(np.abs(steps, out=steps) > self.least)
        return large[steps[large] > self.over(time_s[large + 1] - time_s[large])]


def step_limit(values: np.ndarray, channel: Channel, pace: Pace) -> StepLimit | None:
    """Limit of the steps of a channel, or None where motion has none that can be stated.

    Parameters
    ----------
    values : numpy.ndarray
        Samples in ascending time, angles unwrapped, shape (n,).
    """
    fastest = pace.fastest(channel)
    if fastest is None or values.size < MIN_SAMPLES:
        return None
    values = excerpt(values)
    usual = USUAL_STEPS * float(np.quantile(np.abs(np.diff(values)), USUAL_STEP_QUANTILE))
    sigmas = np.sqrt(2.0) * MIN_SIGMAS * noise_std(values)
    return StepLimit(max(sigmas, RESOLUTIONS * resolution(values)), usual, fastest)
