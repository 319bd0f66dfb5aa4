"""The day's programme in the vertical plane: elevator zigzags, depth steps, thrust steps."""

from __future__ import annotations

import math

import numpy as np

from seatrial import helm
from seatrial.population.form import Size
from seatrial.population.schedule import (
    LONG_MINUTES,
    SHORT_MINUTES,
    Day,
    straight,
    surface_end,
    surface_start,
    transit,
)
from seatrial.schedule import DEGREE

# (elevator, pitch) of zigzags [deg], and what the elevator is laid about
ZIGZAGS = ((10, 10), (6, 6), (12, 5), (15, 10), (10, 5), (12, 12))
TRIMS = ("amidships", "kept", "laid")  # zero, what keeps the depth, an angle of its own
LAID_DEG, LEAST_LAID_DEG = (3.0, 4.0), 10  # elevator angle of a zigzag from which it may be
REACHED = (
    0.5  # of the pitch that the elevator would give at last: a zigzag switches there or before
)
STEPS = (0.4, 2.5)  # sizes of depth steps [L]
LEAST_STEP_M, LEAST_PITCH_DEG = 0.7, 2.0
DEPTH_M, DEEPER = (6.0, 9.0), 3.0  # the working depth: [m] and [L]


def draw_vertical_day(
    size: Size, rpm: float, facts: dict, short: bool, rng: np.random.Generator
) -> tuple[np.ndarray, list]:
    """Legs and maneuver notes of a trial: the needed maneuvers, then others until time is up."""
    day = Day(size, rpm, 0.0, rng)
    day.depth_m = round(float(rng.uniform(*DEPTH_M)) + DEEPER * size.length, 1)
    wanted = SHORT_MINUTES if short else float(np.exp(rng.uniform(*np.log(LONG_MINUTES))))
    surface_start(day)
    order = rng.permutation(len(ZIGZAGS))
    zigzags = [_zigzag(*ZIGZAGS[k], _about(k, i), i, facts) for i, k in enumerate(order)]
    needed = [straight, straight, *zigzags[:3], _zigzag(10, 10, "kept", 3, facts)]
    needed += [_depth_steps(0), _depth_steps(1)]
    others = [*zigzags[3:], _depth_steps(2), straight]
    for builder in [needed[k] for k in rng.permutation(len(needed))]:
        _next(day, builder)
    while day.minutes < wanted:
        _next(day, others[int(rng.integers(len(others)))])
    transit(day)
    surface_end(day)
    return np.array(day.legs), day.notes


def _about(which: int, number: int) -> str:
    """What a zigzag is sailed about: not about an angle near its own."""
    about = TRIMS[number % len(TRIMS)]
    return "kept" if about == "laid" and ZIGZAGS[which][0] < LEAST_LAID_DEG else about


def _next(day: Day, builder) -> None:
    """A transit, in which the vehicle comes back to its working depth, and the maneuver."""
    transit(day)
    builder(day)


def _zigzag(elevator_deg: int, pitch_deg: int, about: str, number: int, facts: dict):
    def build(day: Day) -> None:
        """Vertical zigzag, first up or down; the slow ones of a stiff vehicle switch earlier."""
        fast = bool(number % 2)
        rpm = day.speed(1.05, 1.2) if fast else day.speed(0.78, 0.95)
        side = 1 if day.rng.random() < 0.5 else -1
        other = 1.0 if day.rng.random() < 0.7 else round(float(day.rng.uniform(0.6, 1.4)), 2)
        laid = float(day.rng.uniform(*LAID_DEG) * day.rng.choice([-1.0, 1.0]))
        trim = {"amidships": 0.0, "kept": math.nan, "laid": round(laid, 1)}[about]
        authority = facts["pitch_per_elevator" if fast else "pitch_per_elevator_slow"]
        off = 0.0 if about == "kept" else abs(trim - facts["trim_deg"])
        weaker = min(other, 1.0) * elevator_deg - off  # what is left of the lesser execute
        pitch = max(min(pitch_deg, REACHED * authority * weaker), LEAST_PITCH_DEG)
        note = day.note(
            kind="zigzag",
            plane="vertical",
            elevator_deg=side * elevator_deg,
            pitch_deg=round(pitch, 1),
            other=other,
            about=about,
            rpm=rpm,
        )
        day.add(
            helm.VERTICAL_ZIGZAG,
            day.units(25, 45, 20.0),
            rpm,
            maneuver=note,
            fin=side * elevator_deg * DEGREE,
            switch=pitch * DEGREE,
            count=int(day.rng.integers(4, 7)),
            longest=max(90.0 * day.size.time, 60.0),
            other=other,
            trim=trim * DEGREE,
        )

    return build


def _depth_steps(number: int):
    def build(day: Day) -> None:
        """A few steps of the depth order about the working depth, small and large."""
        rpm = day.speed(1.0, 1.2) if number % 2 else day.speed(0.8, 0.95)
        note = day.note(kind="depth_step", plane="vertical", rpm=rpm)
        sizes = np.exp(day.rng.uniform(*np.log(STEPS), int(day.rng.integers(2, 4))))
        side = 1 if day.rng.random() < 0.5 else -1
        for i, share in enumerate(sizes):
            step = max(float(share) * day.size.length, LEAST_STEP_M) * side * (-1) ** i
            day.add(
                helm.TRANSIT,
                day.units(20, 32, 15.0),
                rpm,
                round(day.depth_m + step, 2),
                maneuver=note,
            )

    return build
