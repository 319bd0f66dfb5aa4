"""The day's programme of a drawn vehicle: times by its L/U, and several ways to sail a maneuver."""

from __future__ import annotations

import math

import numpy as np

from seatrial import helm
from seatrial.helm import Gains
from seatrial.population.form import Size
from seatrial.schedule import DEGREE, Programme

# (rudder, heading) of zigzags [deg]
ZIGZAGS = ((10, 10), (20, 20), (15, 5), (15, 15), (20, 10), (10, 5))
TURNS = (8, 10, 12, 15, 18, 20)
CIRCLE_DEG = (200.0, 400.0)
REMUS_TIME_S, REMUS_LENGTH_M = 0.89, 1.33  # of the vehicle for which the autopilots were made
SHORT_MINUTES, LONG_MINUTES = 10.0, (10.0, 60.0)


class Day(Programme):
    """A programme whose durations are in L/U, and never below a few seconds."""

    def __init__(self, size: Size, rpm: float, rate: float, rng: np.random.Generator) -> None:
        depth = round(float(rng.uniform(5.0, 8.0)) + 0.8 * size.length, 1)
        super().__init__(rpm, depth, rng)
        self.size, self.rate = size, rate  # yaw rate per rudder angle at cruise [1/s]

    def units(self, low: float, high: float, least_s: float = 8.0) -> float:
        """A duration between `low` and `high` L/U in full half seconds."""
        return max(self.seconds(low * self.size.time, high * self.size.time), least_s)

    @property
    def minutes(self) -> float:
        """Time of the legs so far, about."""
        return sum(leg[helm.DURATION] for leg in self.legs) / 60.0


def gains_for(size: Size, rng: np.random.Generator) -> Gains:
    """Autopilots stretched to the vehicle's time and length; the rudder at once or at a rate."""
    slower, usual = size.time / REMUS_TIME_S, Gains()
    shorter = REMUS_LENGTH_M / size.length
    rate = 0.0 if rng.random() < 0.4 else float(rng.uniform(8.0, 40.0)) * DEGREE / slower
    return usual._replace(
        heading_rate=usual.heading_rate * slower,
        heading_sum=usual.heading_sum / slower,
        depth=usual.depth * shorter,
        depth_sum=usual.depth_sum * shorter / slower,
        pitch_rate=usual.pitch_rate * slower,
        helm_rate=rate,
    )


def draw_day(
    size: Size, rpm: float, rate: float, short: bool, rng: np.random.Generator
) -> tuple[np.ndarray, list]:
    """Legs and maneuver notes of a trial: the needed maneuvers, then others until time is up."""
    day = Day(size, rpm, rate, rng)
    wanted = SHORT_MINUTES if short else float(np.exp(rng.uniform(*np.log(LONG_MINUTES))))
    surface_start(day)
    angles = rng.permutation(TURNS)
    turns = [_turn(float(a) * (1 if i % 2 else -1), i) for i, a in enumerate(angles)]
    zigzags = [_zigzag(*ZIGZAGS[k], i) for i, k in enumerate(rng.permutation(len(ZIGZAGS)))]
    needed = [straight, straight, *turns[:3], *zigzags[:3], _zigzag(10, 10, int(rng.integers(2)))]
    others = [*turns[3:], *zigzags[3:], straight]
    for builder in [needed[k] for k in rng.permutation(len(needed))]:
        _next(day, builder)
    while day.minutes < wanted:
        _next(day, others[int(rng.integers(len(others)))])
    transit(day)
    surface_end(day)
    return np.array(day.legs), day.notes


def _next(day: Day, builder) -> None:
    transit(day)
    builder(day)


def surface_start(day: Day) -> None:
    """Waiting, a fin check at zero speed, the dive."""
    nan = float("nan")
    day.add(helm.FIXED, day.seconds(10, 30), 0, nan)
    day.add(helm.WIGGLE, day.seconds(8, 16), 0, nan, fin=day.rng.uniform(10, 20) * DEGREE, switch=4)
    day.add(helm.FIXED, day.seconds(5, 15), 0, nan)
    _change_depth(day, day.depth_m)
    transit(day)


def surface_end(day: Day) -> None:
    """Back up, stop and drift."""
    _change_depth(day, 0.15)
    day.add(helm.FIXED, day.seconds(15, 35), 0, float("nan"))


def _change_depth(day: Day, to: float) -> None:
    """Straight ahead for as long as the climb or dive takes at a gentle slope."""
    seconds = day.depth_m / (0.15 * day.size.speed) + 15.0 * day.size.time
    heading = day.rng.uniform(-math.pi, math.pi)
    day.add(helm.TRANSIT, round(seconds), day.speed(1.0, 1.05), to, heading=heading)


def transit(day: Day) -> None:
    """One or two headings under autopilot; the last leg settles before the next maneuver."""
    rpm = day.speed(0.97, 1.05)
    if day.rng.random() < 0.25:
        heading = day.rng.uniform(-math.pi, math.pi)
        day.add(helm.TRANSIT, day.units(12, 18, 12.0), rpm, heading=heading)
    heading = day.rng.uniform(-math.pi, math.pi)
    day.add(helm.TRANSIT, day.units(18, 30, 16.0), rpm, heading=heading)


def straight(day: Day) -> None:
    """Thrust steps of different sizes on one heading; rudder at zero or the heading kept."""
    kept = bool(day.rng.random() < 0.7)
    number = day.note(kind="straight", heading_kept=kept)
    level = float(day.rng.uniform(0.7, 1.3))
    for _ in range(int(day.rng.integers(3, 6))):
        kind = helm.STRAIGHT if kept else helm.FIXED
        rpm = round(day.cruise_rpm * level, -1)
        day.add(kind, day.units(18, 32, 15.0), rpm, maneuver=number)
        step = day.rng.uniform(0.1, 0.45) * (-1 if level > 1.0 else 1)
        level = float(np.clip(level + step, 0.65, 1.35))


def _turn(angle_deg: float, number: int):
    def build(day: Day) -> None:
        """Circle or a part of one, the rudder held."""
        share = day.rng.uniform(0.75, 0.95) if number % 2 else day.rng.uniform(1.0, 1.25)
        rpm = round(day.cruise_rpm * share, -1)
        around = day.rng.uniform(*CIRCLE_DEG)
        expected = around / (day.rate * abs(angle_deg) * share)
        note = day.note(kind="turn", rudder_deg=angle_deg, heading_deg=round(around), rpm=rpm)
        day.add(
            helm.TURN,
            round(0.7 * expected),
            rpm,
            maneuver=note,
            fin=angle_deg * DEGREE,
            switch=around * DEGREE,
            longest=3.0 * expected + 20.0 * day.size.time,
        )

    return build


def _zigzag(rudder_deg: int, heading_deg: int, number: int):
    def build(day: Day) -> None:
        """Zigzag, first to a side drawn at random, at times with executes of unequal size."""
        rpm = day.speed(1.05, 1.25) if number % 2 else day.speed(0.75, 0.95)
        side = 1 if day.rng.random() < 0.5 else -1
        other = 1.0 if day.rng.random() < 0.7 else round(float(day.rng.uniform(0.6, 1.4)), 2)
        rudder = side * rudder_deg
        note = day.note(
            kind="zigzag", rudder_deg=rudder, heading_deg=heading_deg, other=other, rpm=rpm
        )
        day.add(
            helm.ZIGZAG,
            day.units(25, 45, 20.0),
            rpm,
            maneuver=note,
            fin=rudder * DEGREE,
            switch=heading_deg * DEGREE,
            count=int(day.rng.integers(4, 7)),
            longest=max(140.0 * day.size.time, 60.0),
            other=other,
        )

    return build
