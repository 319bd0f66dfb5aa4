"""Servos and motor: what becomes of a command before the water feels it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb


class Servo(NamedTuple):
    """A fin servo. Angles in rad, times in s."""

    lag: float = 0.05
    rate_limit: float = math.radians(120.0)
    delay: float = 0.0
    deadband: float = 0.0
    backlash: float = 0.0  # half width of the play
    asymmetry: float = 0.0  # gain 1 + k to the positive, 1 - k to the negative side
    offset: float = 0.0
    separation: float = 1e9  # deflection at which the fin has lost 30 % of its effect


@nb.njit(cache=True)
def play(previous, command, half_width):
    """Backlash: the output moves only when the command leaves the play around it."""
    return min(max(previous, command - half_width), command + half_width)


@nb.njit(cache=True)
def servo_target(command, taken_up, servo):
    """Static part: dead band, then play, then unequal gain. Returns (target, play state)."""
    banded = math.copysign(max(abs(command) - servo.deadband, 0.0), command)
    taken_up = play(taken_up, banded, servo.backlash)
    gain = 1.0 + servo.asymmetry if taken_up > 0.0 else 1.0 - servo.asymmetry
    return gain * taken_up, taken_up


@nb.njit(cache=True)
def servo_step(angle, target, servo, dt):
    """First-order lag with a rate limit, one step."""
    step = (target - angle) * (1.0 - math.exp(-dt / max(servo.lag, 1e-6)))
    limit = servo.rate_limit * dt
    return angle + min(max(step, -limit), limit)


@nb.njit(cache=True)
def felt_angle(angle, servo):
    """Deflection the flow feels: offset added, less than geometric where the flow separates."""
    turned = angle + servo.offset
    return turned / math.sqrt(1.0 + (turned / servo.separation) ** 2)


@nb.njit(cache=True)
def motor_step(n, command, lag, dt):
    """First-order motor, one step; `n` in rev/s."""
    return n + (command - n) * (1.0 - math.exp(-dt / lag))
