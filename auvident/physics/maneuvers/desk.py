"""Maneuvers flown on the desk: a helm that sees the model's motion orders the fin, step by step.

Angles are counted as a person steers: positive orders turn to starboard, or put the bow up, and so
does a positive change of the angle. `DeskFlight.side` makes of an order the angle of the fin,
whose positive side is that of the equations.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from auvident.physics.dynamics import SPEED_LIMIT
from auvident.physics.fleet import Fleet, Servos
from auvident.physics.steady import SteadyRun

Array = npt.NDArray[Any]

LONGEST_STEP_S = 0.05
STEP, SWITCHED_STEP = 0.1, 0.02  # L/U: of any helm; of one that switches where an angle is reached
TURNED_RAD = np.radians(540.0)  # a turning circle ends here (ITTC 7.5-04-02-01)
EXECUTES = 5  # of a zigzag
MOST_CIRCLE, MOST_SWING = 300.0, 60.0  # L/U: a whole circle, one swing of a zigzag
# a rate has settled when it moves by less than this part of U/L, the speed of U, over this time
SETTLED, SETTLING, MOST_SETTLING = 2.0e-4, 3.0, 90.0
SETTLED_MODELS = 0.9  # of the drawn models, and the first
# Autopilot of the depth: a depth error of one hull length asks for 0.2 rad of pitch, at most 20
# degrees; a pitch error for 1.5 times as much elevator, less L/U times the pitch rate, at most 20
# degrees. So chosen that the stable REMUS 100 and the unstable SUBOFF (G_V = -1.16) both settle.
DEPTH_GAIN, PITCH_GAIN, RATE_GAIN = 0.2, 1.5, 1.0
UPRIGHT_RAD = 0.5 * np.pi  # a pitch beyond is a loop, no maneuver about a level run
PITCH_LIMIT, ELEVATOR_LIMIT = np.radians(20.0), np.radians(20.0)
DEPTH_REACHED, DEPTH_HELD, MOST_DEPTH = 0.05, 10.0, 150.0  # share of the step; L/U; L/U


@dataclass(frozen=True)
class Moment:
    """What a helm sees: time since the start, speed of the hull, motion since the start.

    Attributes
    ----------
    time_s : float
    states : (4, S) array
    angle : (S,) array
        Heading or pitch since the start [rad].
    way : (2, S) array
        North and east, or along and depth, since the start [m].
    """

    time_s: float
    states: Array
    angle: Array
    way: Array


class DeskHelm(Protocol):
    """Orders the fins (S,) and says which models (S,) are through.

    It steps in `step_s` at the most, keeps a row every `row_s`, and gives up at `longest_s`. Where
    it `switches`, figures count from the moment of a reversal, and that is a row as well.
    """

    longest_s: float
    step_s: float
    row_s: float
    switches: bool

    def order(self, now: Moment) -> Array:
        """Angles ordered [rad], positive to starboard or up."""

    def over(self, now: Moment) -> Array:
        """Which models are through."""


@dataclass(frozen=True)
class Setting:
    """What every helm needs: hull time L/U, length, speed, number of models, their steady run."""

    hull_time_s: float
    length_m: float
    speed_mps: float
    size: int
    trim_rad: Array
    pitch_rad: Array


@dataclass
class CircleHelm:
    """The fin held until the vehicle has turned by 540 degrees."""

    setting: Setting
    order_rad: float
    switches: bool = False

    def __post_init__(self) -> None:
        self.longest_s = MOST_CIRCLE * self.setting.hull_time_s
        self.step_s = self.row_s = STEP * self.setting.hull_time_s

    def order(self, now: Moment) -> Array:
        """The same at all times."""
        return np.full(self.setting.size, self.order_rad)

    def over(self, now: Moment) -> Array:
        """Come round."""
        found: Array = np.abs(now.angle) >= TURNED_RAD
        return found


@dataclass
class ZigzagHelm:
    """The fin reversed each time the angle comes to the switching angle on its side."""

    setting: Setting
    order_rad: float
    switch_rad: float
    switches: bool = True

    def __post_init__(self) -> None:
        self.longest_s = (EXECUTES + 1) * MOST_SWING * self.setting.hull_time_s
        self.step_s = self.row_s = SWITCHED_STEP * self.setting.hull_time_s
        self._now = np.full(self.setting.size, self.order_rad)
        self._executes = np.ones(self.setting.size, dtype=int)

    def order(self, now: Moment) -> Array:
        """To one side until the angle is there, then to the other."""
        there = np.sign(self._now) * now.angle >= self.switch_rad
        self._executes = self._executes + there
        self._now = np.where(there, -self._now, self._now)
        return self._now

    def over(self, now: Moment) -> Array:
        """At the execute after the last one, which shows the last overshoot."""
        return self._executes > EXECUTES


@dataclass(frozen=True)
class Level:
    """Where a level of a stair of orders ended: order, states (4, S)."""

    order_rad: float
    states: Array


@dataclass
class StairHelm:
    """One order after the other, each held until rate and speed of the models have settled.

    All models change together, when the first and nine of ten others have settled.
    """

    setting: Setting
    orders_rad: Sequence[float]
    levels: list[Level] = field(default_factory=list)
    switches: bool = False

    def __post_init__(self) -> None:
        self.longest_s = len(self.orders_rad) * MOST_SETTLING * self.setting.hull_time_s
        self.step_s = STEP * self.setting.hull_time_s
        self.row_s = 5.0 * self.step_s
        self._since, self._seen = 0.0, [(0.0, np.zeros((2, self.setting.size)))]

    def order(self, now: Moment) -> Array:
        """The next one where the last has settled."""
        if len(self.levels) < len(self.orders_rad) and self._has_settled(now):
            self._since, self._seen = now.time_s, []
            order = self.orders_rad[len(self.levels)]
            self.levels.append(Level(order, now.states.copy()))
        at = min(len(self.levels), len(self.orders_rad) - 1)
        return np.full(self.setting.size, self.orders_rad[at])

    def _has_settled(self, now: Moment) -> bool:
        time = self.setting.hull_time_s
        scale = np.array([[self.setting.speed_mps], [1.0 / time]])
        self._seen.append((now.time_s, now.states[[0, 2]] / scale))
        while len(self._seen) > 2 and self._seen[1][0] <= now.time_s - SETTLING * time:
            self._seen.pop(0)
        if now.time_s - self._since > MOST_SETTLING * time:
            return True
        if now.time_s - self._seen[0][0] < SETTLING * time or now.time_s == self._since:
            return False
        moved = np.abs(self._seen[-1][1] - self._seen[0][1]).max(axis=0)
        still = (moved < SETTLED) | ~np.isfinite(moved)
        return bool(still[0] and still.mean() >= SETTLED_MODELS)

    def over(self, now: Moment) -> Array:
        """After the last level."""
        return np.full(self.setting.size, len(self.levels) == len(self.orders_rad))


@dataclass
class DepthHelm:
    """Proportional depth, proportional and rate pitch control about the trimmed run."""

    setting: Setting
    depth_m: float
    switches: bool = False

    def __post_init__(self) -> None:
        time = self.setting.hull_time_s
        climb = abs(self.depth_m) / (self.setting.speed_mps * np.sin(PITCH_LIMIT))
        self.longest_s = MOST_DEPTH * time + 2.0 * float(climb)
        self.step_s = self.row_s = STEP * time
        self._held_since = np.full(self.setting.size, np.inf)

    def order(self, now: Moment) -> Array:
        """Elevator, positive up: bow down for a depth that is greater."""
        away = (now.way[1] - self.depth_m) / self.setting.length_m
        pitch = np.clip(DEPTH_GAIN * away, -PITCH_LIMIT, PITCH_LIMIT)
        damping = RATE_GAIN * self.setting.hull_time_s * now.states[2]
        order = self.setting.trim_rad + PITCH_GAIN * (pitch - now.angle) - damping
        return np.clip(order, -ELEVATOR_LIMIT, ELEVATOR_LIMIT)

    def over(self, now: Moment) -> Array:
        """Held at the new depth for a while."""
        there = np.abs(now.way[1] - self.depth_m) <= DEPTH_REACHED * abs(self.depth_m)
        self._held_since = np.where(there, np.minimum(self._held_since, now.time_s), np.inf)
        found: Array = now.time_s - self._held_since >= DEPTH_HELD * self.setting.hull_time_s
        return found


@dataclass(frozen=True)
class DeskFlight:
    """A maneuver of S models.

    Attributes
    ----------
    time_s : (n,) array
    states : (n, 4, S) array
        NaN from where a model ran away.
    way : (n, 2, S) array
    order, fin : (n, S) array
        Ordered, and of the servo, as the equations count [rad].
    ends : (S,) int array
        Row at which each model is through; -1 where it never was.
    side : float
        Angle of the fin over the order of a person.
    setting : Setting
    helm : DeskHelm
    """

    time_s: Array
    states: Array
    way: Array
    order: Array
    fin: Array
    ends: Array
    side: float
    setting: Setting
    helm: DeskHelm


def setting_of(fleet: Fleet, run: SteadyRun, length_m: float, side: float) -> Setting:
    """What the helms need of the approach: speed and hull time are those of the first model."""
    speed = float(run.states[0, 0])
    trim = side * run.angle
    return Setting(length_m / speed, length_m, speed, fleet.size, trim, run.states[3])


def fly(
    fleet: Fleet,
    run: SteadyRun,
    setting: Setting,
    helm: DeskHelm,
    side: float,
    progress: Callable[[float], None] | None = None,
) -> DeskFlight:
    """Fly a maneuver from the steady run, with the propeller rate of that run.

    Parameters
    ----------
    fleet : Fleet
    run : SteadyRun
        Models whose run was not found stay out (NaN).
    setting : Setting
    helm : DeskHelm
    side : float
        1 where a positive angle of the fin turns to starboard or up, else -1.
    progress : callable, optional
        Told the time flown [s].
    """
    dt = round_step(min(helm.step_s, LONGEST_STEP_S))
    every = max(1, int(helm.row_s / dt))
    states = np.where(run.found, run.states, np.nan)
    start, way = states[3].copy(), np.zeros((2, fleet.size))
    servos = Servos(fleet, run.angle.copy(), dt)
    gone = made_good(fleet, states)
    rows: list[tuple[Any, ...]] = []
    ends, k, told = np.full(fleet.size, -1), 0, np.full(fleet.size, np.nan)
    with np.errstate(invalid="ignore", over="ignore"):
        while True:
            now = Moment(k * dt, states, states[3] - start, way)
            order = side * helm.order(now)
            through = helm.over(now)
            last = bool(through[0] and (through | ~np.isfinite(states[0])).all())
            last |= k * dt >= helm.longest_s or not np.isfinite(states[:, 0]).all()
            new = through & (ends < 0)
            turned, told = helm.switches and bool((order != told).any()), order
            if k % every == 0 or last or new[0] or turned:
                rows.append((k * dt, states.copy(), way.copy(), order, servos.angle.copy()))
            ends = np.where(new, len(rows) - 1, ends)
            if last:
                break
            mean = servos.follow(order)
            fleet.step(states, fleet.felt(mean), run.rate_rps, dt)
            states[:, ~within_reach(fleet, states)] = np.nan
            before, gone = gone, made_good(fleet, states)
            way = way + 0.5 * dt * (before + gone)
            k += 1
            if progress is not None and k % 1000 == 0:
                progress(k * dt)
    time, seen, gone_by, orders, fins = (np.array(column) for column in zip(*rows, strict=True))
    return DeskFlight(time, seen, gone_by, orders, fins, ends, side, setting, helm)


def within_reach(fleet: Fleet, states: Array) -> npt.NDArray[np.bool_]:
    """Which models (S,) have not run away: no speed is absurd, no pitch beyond the vertical."""
    found = (np.abs(states[:3]) < SPEED_LIMIT).all(axis=0)
    if fleet.structure.plane == "vertical":
        found &= np.abs(states[3]) < UPRIGHT_RAD
    return np.asarray(found)


def round_step(longest_s: float) -> float:
    """The longest step of one, two or five in its first digit that is no longer than this."""
    decade = 10.0 ** np.floor(np.log10(longest_s) + 1e-9)
    return float(max(m for m in (1.0, 2.0, 5.0) if m * decade <= longest_s * (1.0 + 1e-9)) * decade)


def made_good(fleet: Fleet, states: Array) -> Array:
    """Velocity (2, S) along the start and across it, to starboard or down."""
    u, a, _, angle = states
    cos, sin = np.cos(angle), np.sin(angle)
    if fleet.structure.plane == "vertical":
        return np.array([u * cos + a * sin, a * cos - u * sin])
    return np.array([u * cos - a * sin, u * sin + a * cos])
