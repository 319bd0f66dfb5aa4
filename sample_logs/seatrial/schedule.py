"""A day's programme: which legs in which order, drawn from the seed within bounds."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from seatrial import helm
from seatrial.helm import leg_row

DEGREE = math.pi / 180.0
PLANES = ("horizontal", "vertical", "both")
FEWER_OF_BOTH = {"turns": 4, "depth_steps": 2, "vertical_zigzags": 4}  # for a trial of half an hour
HELIX_DEPTH_M = 60.0  # ordered, and out of reach: the autopilot keeps its steepest slope


@dataclass
class Programme:
    """Legs under construction, and one note per maneuver for the truth."""

    cruise_rpm: float
    depth_m: float
    rng: np.random.Generator
    legs: list = field(default_factory=list)
    notes: list = field(default_factory=list)

    def add(self, kind: int, duration_s: float, rpm: float, depth: float | None = None, **others):
        """Append one leg; depth defaults to the working depth."""
        depth = self.depth_m if depth is None else depth
        self.legs.append(leg_row(kind, duration_s, rpm, depth, **others))

    def note(self, **what) -> int:
        """Open a maneuver; its number marks its legs."""
        self.notes.append(what)
        return len(self.notes) - 1

    def speed(self, low: float, high: float) -> float:
        """A propeller speed between two fractions of cruise, in full 10 rpm."""
        return round(self.cruise_rpm * self.rng.uniform(low, high), -1)

    def seconds(self, low: float, high: float) -> float:
        """A duration in full half seconds."""
        return round(2 * self.rng.uniform(low, high)) / 2


def random_schedule(
    plane: str, cruise_rpm: float, rng: np.random.Generator, options: dict
) -> tuple[np.ndarray, list]:
    """Legs of a trial and notes on its maneuvers.

    `options` may hold the numbers of maneuvers: straights, turns, zigzags_10, zigzags_20 in the
    horizontal plane; straights, vertical_zigzags, depth_steps in the vertical one; all of them,
    and fewer unless asked, in a trial of both. `coupled` maneuvers turn and dive at once.
    """
    depth = float(np.round(rng.uniform(7.0, 11.0), 1))
    programme = Programme(cruise_rpm, depth, rng)
    surface_start(programme)
    builders = builders_of(plane, options, rng) + coupled_list(options)
    order = rng.permutation(len(builders))
    for number in order:
        transit(programme)
        builders[number](programme)
    transit(programme)
    surface_end(programme)
    return np.array(programme.legs), programme.notes


def builders_of(plane: str, options: dict, rng: np.random.Generator) -> list:
    """Builders of the maneuvers of a plane, or of both."""
    if plane == "vertical":
        return vertical_list(options)
    if plane == "horizontal":
        return horizontal_list(options, rng)
    if plane != "both":
        raise ValueError(f"no such plane: {plane}; known: {', '.join(PLANES)}")
    fewer = {**FEWER_OF_BOTH, **options}
    return horizontal_list(fewer, rng) + vertical_list({**fewer, "straights": 0})


def horizontal_list(options: dict, rng: np.random.Generator) -> list:
    """Builders of the horizontal maneuvers, every kind to both sides and at two speeds."""
    turns = options.get("turns", int(rng.integers(4, 6)))
    angles = list(rng.permutation([8, 12, 15, 20, 18, 10]))
    builders = [straight] * options.get("straights", 2)
    for i in range(turns):
        builders.append(_turn(float(angles[i % 6]) * (1 if i % 2 else -1), i))
    for angle in (10, 20):
        for i in range(options.get(f"zigzags_{angle}", 2)):
            builders.append(_zigzag(angle, i))
    return builders


def vertical_list(options: dict) -> list:
    """Builders of the vertical maneuvers."""
    builders = [straight] * options.get("straights", 2)
    builders += [depth_steps] * options.get("depth_steps", 3)
    for i in range(options.get("vertical_zigzags", 6)):
        builders.append(_vertical_zigzag((6, 6, 10, 10, 8, 12)[i % 6], i))
    return builders


def coupled_list(options: dict) -> list:
    """Builders of maneuvers in both planes at once, by turns a turning dive and a helix."""
    return [(turning_dive, helix)[i % 2] for i in range(options.get("coupled", 0))]


def surface_start(programme: Programme) -> None:
    """At the surface: waiting, fin checks at zero speed, then the dive."""
    p, nan = programme, float("nan")
    p.add(helm.FIXED, p.seconds(15, 40), 0, nan)
    p.add(helm.WIGGLE, p.seconds(8, 16), 0, nan, fin=p.rng.uniform(12, 20) * DEGREE, switch=4.0)
    p.add(helm.FIXED, p.seconds(5, 20), 0, nan)
    slow = round(0.35 * p.cruise_rpm, -1)
    p.add(helm.WIGGLE, p.seconds(8, 14), slow, nan, fin=p.rng.uniform(8, 15) * DEGREE, switch=5.0)
    heading = p.rng.uniform(-math.pi, math.pi)
    p.add(helm.TRANSIT, p.seconds(50, 65), p.speed(0.98, 1.04), heading=heading)


def surface_end(programme: Programme) -> None:
    """Back up, a slow surface run, stop and drift."""
    p, nan = programme, float("nan")
    p.add(helm.TRANSIT, p.seconds(35, 45), p.speed(0.95, 1.02), 0.15)
    p.add(helm.TRANSIT, p.seconds(10, 25), round(0.4 * p.cruise_rpm, -1), 0.15)
    p.add(helm.WIGGLE, p.seconds(6, 12), 0, nan, fin=p.rng.uniform(5, 18) * DEGREE, switch=4.0)
    p.add(helm.FIXED, p.seconds(15, 35), 0, nan)


def transit(programme: Programme) -> None:
    """One or two headings under autopilot; the last leg settles before the next maneuver."""
    p = programme
    rpm = p.speed(0.97, 1.05)
    if p.rng.random() < 0.35:
        heading = p.rng.uniform(-math.pi, math.pi)
        p.add(helm.TRANSIT, p.seconds(14, 22), rpm, heading=heading)
    heading = p.rng.uniform(-math.pi, math.pi)
    p.add(helm.TRANSIT, p.seconds(20, 34), rpm, heading=heading)


def straight(programme: Programme) -> None:
    """Thrust steps on one heading, up and down; rudder at zero or the heading gently kept."""
    p = programme
    kept = bool(p.rng.random() < 0.6)
    number = p.note(kind="straight", heading_kept=kept)
    level = float(p.rng.uniform(0.75, 1.3))
    for _ in range(int(p.rng.integers(3, 6))):
        rpm = round(p.cruise_rpm * level, -1)
        kind = helm.STRAIGHT if kept else helm.FIXED
        p.add(kind, p.seconds(25, 35), rpm, maneuver=number)
        step = p.rng.uniform(0.15, 0.4) * (-1 if level > 1.0 else 1)
        level = float(np.clip(level + step, 0.72, 1.32))


def _turn(angle_deg: float, number: int):
    def build(programme: Programme) -> None:
        """Circle with the rudder held, 360 degrees or more."""
        p = programme
        rpm = p.speed(0.82, 0.92) if number % 3 == 1 else p.speed(1.0, 1.22)
        note = p.note(kind="turn", rudder_deg=angle_deg, rpm=rpm)
        p.add(
            helm.TURN,
            p.seconds(50, 72),
            rpm,
            maneuver=note,
            fin=angle_deg * DEGREE,
            switch=p.rng.uniform(360, 400) * DEGREE,
        )

    return build


def _zigzag(angle_deg: int, number: int):
    def build(programme: Programme) -> None:
        """Zigzag, first to a side drawn at random; slow and fast in turn."""
        p = programme
        rpm = p.speed(1.1, 1.25) if number % 2 else p.speed(0.8, 0.92)
        side = 1 if p.rng.random() < 0.5 else -1
        note = p.note(kind="zigzag", rudder_deg=side * angle_deg, heading_deg=angle_deg, rpm=rpm)
        p.add(
            helm.ZIGZAG,
            p.seconds(60, 78),
            rpm,
            maneuver=note,
            fin=side * angle_deg * DEGREE,
            switch=angle_deg * DEGREE,
            count=5,
        )

    return build


def _vertical_zigzag(angle_deg: int, number: int):
    def build(programme: Programme) -> None:
        """Vertical zigzag: elevator to +-angle, switching at that pitch; heading kept."""
        p = programme
        rpm = p.speed(1.08, 1.22) if number % 2 else p.speed(0.82, 0.95)
        note = p.note(
            kind="zigzag", plane="vertical", elevator_deg=angle_deg, pitch_deg=angle_deg, rpm=rpm
        )
        p.add(
            helm.VERTICAL_ZIGZAG,
            p.seconds(45, 70),
            rpm,
            maneuver=note,
            fin=angle_deg * DEGREE,
            switch=angle_deg * DEGREE,
            count=5,
        )

    return build


def depth_steps(programme: Programme) -> None:
    """A few steps of the depth order, heading kept."""
    p = programme
    rpm = p.speed(0.9, 1.15)
    number = p.note(kind="depth_step", plane="vertical", rpm=rpm)
    for _ in range(int(p.rng.integers(2, 4))):
        depth = p.depth_m + p.rng.uniform(1.0, 3.0) * (1 if p.rng.random() < 0.5 else -1)
        p.add(helm.TRANSIT, p.seconds(22, 32), rpm, round(depth, 1), maneuver=number)


def turning_dive(programme: Programme) -> None:
    """Rudder and elevator laid and held at once, then both the other way: down, then up again."""
    p = programme
    rpm, side = p.speed(0.9, 1.1), 1 if p.rng.random() < 0.5 else -1
    rudder, elevator = side * round(p.rng.uniform(8, 15)), round(p.rng.uniform(3, 6))
    number = p.note(
        kind="coupled", way="turning dive", rudder_deg=rudder, elevator_deg=elevator, rpm=rpm
    )
    for sign in (1, -1):
        p.add(
            helm.COUPLED,
            p.seconds(14, 18),
            rpm,
            maneuver=number,
            fin=sign * rudder * DEGREE,
            switch=sign * elevator * DEGREE,
        )


def helix(programme: Programme) -> None:
    """A spiral descent: rudder held, the elevators keep the steepest slope allowed; then back."""
    p = programme
    rpm, side = p.speed(0.9, 1.1), 1 if p.rng.random() < 0.5 else -1
    rudder = side * round(p.rng.uniform(8, 15))
    number = p.note(kind="coupled", way="helix", rudder_deg=rudder, rpm=rpm)
    p.add(
        helm.FIXED,
        p.seconds(35, 45),
        rpm,
        HELIX_DEPTH_M,
        maneuver=number,
        fin=rudder * DEGREE,
    )
    heading = p.rng.uniform(-math.pi, math.pi)
    p.add(helm.TRANSIT, p.seconds(38, 46), p.speed(1.0, 1.05), heading=heading)
