"""What the checks look at: the ingested trial, its vehicle, and what geometry says of it."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from auvident.constants import USUAL_SPEED_MPS
from auvident.errors import InputError, NumericsError
from auvident.physics.ase import stability
from auvident.physics.ase.assembly import coefficient_parts, totals
from auvident.physics.ase.draws import drawn_coefficients
from auvident.physics.ase.geometry import hull_geometry
from auvident.physics.ase.prior import contributions, residuals, standard_deviations
from auvident.schema.logs import RawTrial
from auvident.schema.trial import Trial
from auvident.schema.vehicle import Vehicle
from auvident.schema.vehicle_checks import contradictions
from auvident.stages.ingest.checks.row import Ratio
from auvident.stages.ingest.moments import PITCH, YAW, Moments, MomentsRow, moments
from auvident.stages.ingest.response import Relation
from auvident.stages.ingest.still import still_channels

if TYPE_CHECKING:
    from auvident.stages.ingest.signs import RudderSign

Array = npt.NDArray[np.float64]

MIN_SPEED_MPS = 0.2  # ratios to a smaller speed are noise
UNDER_WAY = 0.3  # of the 90 % quantile of the speed: slower is manoeuvring, dive and drift
BRISK = 2.0  # of the speed that counts as under way: a vehicle that coasts to rest swings
ROOTS = ("X_uu", "T_nu", "T_nn")
PASSAGES = 10.0  # lengths of way of a window: thrust and drag have settled by its end
STEADY, STEADY_RPM = 0.04, 0.05  # changes of speed and rpm in it, of their mean
STRAIGHT = 0.05  # r L / u: a circle of 40 lengths
LEAST_WINDOW_S = 5.0
QUARTERS = 4  # of a window, each of one row at least: they tell the unrest


@dataclass(frozen=True)
class Window:
    """A straight stretch at steady speed and propeller rate, whatever the sign of that."""

    speed_mps: float
    sway_mps: float  # NaN where it is not known, as the heading
    rate_rps: float
    heading_rad: float
    unrest: float  # standard deviation of the speed from quarter to quarter, of its mean


@dataclass(frozen=True)
class Seen:
    """A trial and its vehicle, with what several checks need of them, each made once.

    Attributes
    ----------
    raw : RawTrial
        For names of files and columns, and commands as they were written.
    trial : Trial
    vehicle : Vehicle
    heading : Relation or None
        Rate of the heading from the gyro.
    rudder : Relation or None
        Yaw acceleration from rudder and yaw rate.
    sign : RudderSign or None
        What was judged of the rudder's sign before; one that contradicts has been refused.
    elevator : int
        -1 where steps of the elevator pitch the vehicle as they should by its pitch rate, 1 the
        other way, 0 where that is not sure.
    """

    raw: RawTrial
    trial: Trial
    vehicle: Vehicle
    heading: Relation | None = None
    rudder: Relation | None = None
    sign: "RudderSign | None" = None
    elevator: int = 0

    @property
    def length_m(self) -> float:
        """Of the hull."""
        return self.vehicle.hull.length_m

    def has(self, *names: str) -> bool:
        """Whether the trial has all of these channels, none of motion that stands still."""
        return set(names) <= self._shown

    @cached_property
    def _shown(self) -> set[str]:
        return set(self.trial.table.columns) - still_channels(self.trial.table)

    def whole(self, name: str) -> Array:
        """One channel, NaN where it is unknown, and of one that the trial `has` not."""
        if not self.has(name):
            return np.full(len(self.trial.table), np.nan)
        return self.trial.table[name].to_numpy(dtype=float)

    def columns(self, *names: str) -> list[Array]:
        """Channels in the rows where all are known; empty when one is absent."""
        if not self.has(*names):
            return [np.empty(0) for _ in names]
        table = self.trial.table[list(names)].to_numpy(dtype=float)
        return list(table[np.isfinite(table).all(axis=1)].T)

    @cached_property
    def way_mps(self) -> float:
        """Speed, however its axes are named, above which the vehicle is under way."""
        speed = np.hypot(self.whole("u_mps"), self.whole("v_mps"))
        known = speed[np.isfinite(speed)]
        most = float(np.quantile(known, 0.9)) if known.size else 0.0
        return max(MIN_SPEED_MPS, UNDER_WAY * most)

    @cached_property
    def passage_s(self) -> float:
        """Time in which the vehicle travels its length at its usual speed."""
        u = np.abs(self.whole("u_mps"))
        moving = u[u > self.way_mps]
        return self.length_m / float(np.median(moving)) if moving.size else np.inf

    @cached_property
    def pitching(self) -> Moments | None:
        """Balance of the moments of pitch, at speeds at which the elevator governs it."""
        return self._moments(PITCH)

    @cached_property
    def yawing(self) -> Moments | None:
        """Balance of the moments of yaw, at speeds at which the rudder governs it."""
        return self._moments(YAW)

    def _moments(self, balance: MomentsRow) -> Moments | None:
        return moments(self.trial, self.vehicle, balance, BRISK * self.way_mps, self.passage_s)

    @cached_property
    def windows(self) -> list[Window]:
        """Straight stretches at steady speed and propeller rate."""
        if not np.isfinite(self.passage_s):
            return []
        u, v, r = (self.whole(name) for name in ("u_mps", "v_mps", "r_radps"))
        rate, heading = self.whole("rpm") / 60.0, self.whole("heading_rad")
        steady_s = max(LEAST_WINDOW_S, PASSAGES * self.passage_s)
        size = max(round(steady_s * self.trial.rate_hz), QUARTERS)
        found = []
        for first in range(0, u.size - size, max(size // 2, 1)):
            rows = slice(first, first + size)
            if self._steady(u[rows], r[rows], np.abs(rate[rows])):
                mean = float(u[rows].mean())
                unrest = float(np.std([q.mean() for q in np.array_split(u[rows], QUARTERS)])) / mean
                course = float(np.angle(np.exp(1j * heading[rows]).mean()))
                turns = float(np.abs(rate[rows]).mean())
                found.append(Window(mean, float(v[rows].mean()), turns, course, unrest))
        return found

    def _steady(self, u: Array, r: Array, rate: Array) -> bool:
        part = max(u.size // 4, 1)
        if not np.isfinite(u + r + rate).all() or u.mean() < self.way_mps or rate.mean() <= 0.0:
            return False
        turning = float(np.mean(np.abs(r)) * self.length_m / u.mean())
        change = abs(float(u[:part].mean() - u[-part:].mean()))
        level = np.ptp(rate) <= STEADY_RPM * rate.mean()
        return bool(turning < STRAIGHT and change < STEADY * u.mean() and level)

    @cached_property
    def drawn(self) -> Mapping[str, Array] | None:
        """Coefficients from geometry, or as given, and draws of what they leave open.

        None where neither exists, or where the geometry is none: the estimate of the next stage
        says so with all its words.
        """
        if not self.vehicle.hull.is_body_of_revolution:
            return _given(self.vehicle)
        if next(iter(contradictions(self.vehicle)), None) is not None:
            return None
        speed = self.vehicle.body.design_speed_mps or USUAL_SPEED_MPS
        try:
            geometry = hull_geometry(self.vehicle)
            parts = coefficient_parts(self.vehicle, speed, geometry=geometry)
            effects = contributions(self.vehicle, speed, geometry)
        except (InputError, NumericsError):
            return None
        stds = standard_deviations(effects, residuals(self.vehicle, parts, geometry))
        values = {symbol: float(value) for symbol, value in totals(parts).items()}
        known = self.vehicle.coefficients
        values |= {symbol: own.value for symbol, own in known.items()}
        stds |= {symbol: own.std for symbol, own in known.items()}
        return drawn_coefficients(values, stds, effects, given=known)

    @cached_property
    def advance(self) -> Ratio | None:
        """Speed over propeller rate [m] at which drag and thrust balance, with its spread."""
        if self.drawn is None or not set(ROOTS) <= set(self.drawn):
            return None
        rows = np.array([self.drawn[symbol] for symbol in ROOTS]).T
        found = [stability.speed_per_rate_m(dict(zip(ROOTS, row, strict=True))) for row in rows]
        draws = np.log([x for x in found[1:] if np.isfinite(x) and x > 0.0])
        if not np.isfinite(found[0]) or draws.size < len(found) // 2:
            return None
        low, high = np.percentile(draws, (15.865, 84.135))
        return Ratio(found[0], float(0.5 * (high - low)))


def _given(vehicle: Vehicle) -> Mapping[str, Array] | None:
    """The user's own coefficients, where the formulas of geometry do not apply."""
    known = vehicle.coefficients
    if not known:
        return None
    values = {symbol: own.value for symbol, own in known.items()}
    return drawn_coefficients(values, {s: own.std for s, own in known.items()}, {}, given=known)
