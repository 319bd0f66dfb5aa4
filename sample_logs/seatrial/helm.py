"""The helm: legs one after the other, autopilots, zigzag switching on measured angles.

A leg is a row of numbers (columns ``LEG_*``). Rudder and elevator commands change at the control
rate; the autopilot sees measured heading, pitch and depth, not the truth.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

# Columns of a leg.
KIND, MANEUVER, DURATION, RPM, FIN, SWITCH, COUNT, HEADING, DEPTH, LONGEST, OTHER, TRIM = range(12)
LEG_COLUMNS = 12

# Kinds. HEADING is an absolute heading [rad]; NaN keeps the heading found at the leg's start.
# DEPTH [m]; NaN leaves the elevators at zero. LONGEST [s] ends a turn or a zigzag that does not
# come to its own end; 0 is the usual time. OTHER multiplies FIN on every second zigzag execute.
# TRIM [rad] is added to the elevator of a vertical zigzag; NaN: what kept the depth before it.
FIXED = 0  # rudder held at FIN [rad] for DURATION
WIGGLE = 1  # rudder +-FIN, period SWITCH [s]
TRANSIT = 2  # heading autopilot
TURN = 3  # rudder FIN for at least DURATION and a heading change of SWITCH [rad]
ZIGZAG = 4  # rudder +-FIN, switching at heading SWITCH [rad]; COUNT switches and DURATION at least
STRAIGHT = 5  # heading kept gently
VERTICAL_ZIGZAG = 6  # elevator +-FIN, switching at pitch SWITCH [rad]; rudder keeps the heading
COUPLED = 7  # rudder held at FIN and elevator at SWITCH [rad] for DURATION

# Memory of the helm between control ticks.
LEG, LEG_TIME, HEADING_0, SIGN, SWITCHES, DEPTH_SUM, HEADING_SUM, MANEUVER_0, MEAN_ELEVATOR = range(
    9
)
MEMORY = 9

LONGEST_ZIGZAG_S = 130.0
TURN_STRETCH = 2.0  # a turn that does not come round ends at this multiple of its duration


class Gains(NamedTuple):
    """Autopilot gains (rad per rad, rad per rad/s, rad per m)."""

    heading: float = 0.9
    heading_rate: float = 0.7
    heading_sum: float = 0.02
    gentle: float = 0.35
    depth: float = 0.14
    depth_sum: float = 0.012
    pitch: float = 0.9
    pitch_rate: float = 0.5
    pitch_limit: float = math.radians(16.0)
    fin_limit: float = math.radians(18.0)
    transit_limit: float = math.radians(12.0)
    trim_time: float = 8.0  # [s] over which the elevator that keeps the depth is averaged
    helm_rate: float = 0.0  # [rad/s] at which the rudder command moves; 0: at once


@nb.njit(cache=True)
def clip(value, limit):
    """`value` held between -limit and +limit."""
    return min(max(value, -limit), limit)


@nb.njit(cache=True)
def start_leg(memory, legs, heading):
    """Reset the helm's memory at the start of the leg; one maneuver keeps one base heading."""
    leg = legs[int(memory[LEG])]
    memory[LEG_TIME] = 0.0
    memory[SWITCHES] = 0.0
    memory[SIGN] = 1.0
    same = leg[MANEUVER] >= 0.0 and leg[MANEUVER] == memory[MANEUVER_0]
    if not same:
        memory[HEADING_0] = heading
        if not math.isnan(leg[HEADING]):
            turn = leg[HEADING] - heading
            memory[HEADING_0] = heading + math.atan2(math.sin(turn), math.cos(turn))
    memory[MANEUVER_0] = leg[MANEUVER]


@nb.njit(cache=True)
def has_crossed(memory, leg, angle):
    """Whether a zigzag swing is at its end; a positive fin makes `angle` negative."""
    first = math.copysign(1.0, leg[FIN])
    return -memory[SIGN] * first * angle >= leg[SWITCH]


@nb.njit(cache=True)
def leg_is_over(memory, leg, heading, pitch):
    """Whether the leg ends at this tick."""
    time, kind = memory[LEG_TIME], int(leg[KIND])
    if kind == TURN:
        around = abs(heading - memory[HEADING_0]) >= leg[SWITCH]
        longest = leg[LONGEST] if leg[LONGEST] > 0.0 else TURN_STRETCH * leg[DURATION]
        return (around and time >= leg[DURATION]) or time >= longest
    if kind in (ZIGZAG, VERTICAL_ZIGZAG):
        angle = heading - memory[HEADING_0] if kind == ZIGZAG else pitch
        enough = memory[SWITCHES] >= leg[COUNT] and time >= leg[DURATION]
        longest = leg[LONGEST] if leg[LONGEST] > 0.0 else LONGEST_ZIGZAG_S
        return (enough and has_crossed(memory, leg, angle)) or time >= longest
    return time >= leg[DURATION]


@nb.njit(cache=True)
def heading_rudder(memory, heading, r, gain, gains, limit, dt):
    """Heading autopilot; positive rudder turns to port."""
    error = heading - memory[HEADING_0]
    if abs(error) < 0.2:
        memory[HEADING_SUM] = clip(memory[HEADING_SUM] + gains.heading_sum * error * dt, 0.1)
    return clip(gain * (error + gains.heading_rate * r) + memory[HEADING_SUM], limit)


@nb.njit(cache=True)
def depth_elevator(memory, leg, depth, pitch, q, gains, dt):
    """Depth autopilot with an inner pitch loop; positive elevator puts the bow down."""
    if math.isnan(leg[DEPTH]):
        return 0.0
    error = depth - leg[DEPTH]
    if abs(error) < 1.0:
        memory[DEPTH_SUM] = clip(memory[DEPTH_SUM] + gains.depth_sum * error * dt, 0.12)
    wanted = clip(gains.depth * error + memory[DEPTH_SUM], gains.pitch_limit)
    return clip(gains.pitch * (pitch - wanted) + gains.pitch_rate * q, gains.fin_limit)


@nb.njit(cache=True)
def moved(command, wanted, gains, dt):
    """The command after one tick, on its way to the one wanted at the helm's rate."""
    if gains.helm_rate <= 0.0:
        return wanted
    return command + clip(wanted - command, gains.helm_rate * dt)


@nb.njit(cache=True)
def zigzag_fin(memory, leg, angle):
    """Fin command of a zigzag; `angle` is the measured deviation."""
    if has_crossed(memory, leg, angle):
        memory[SIGN] = -memory[SIGN]
        memory[SWITCHES] += 1.0
    return memory[SIGN] * leg[FIN] * (leg[OTHER] if memory[SIGN] < 0.0 else 1.0)


@nb.njit(cache=True)
def commands(memory, leg, measured, gains, dt):
    """Rudder and elevator command [rad] from measured (heading, pitch, depth, q, r)."""
    heading, pitch, depth, q, r = measured
    kind = int(leg[KIND])
    elevator = depth_elevator(memory, leg, depth, pitch, q, gains, dt)
    if kind in (FIXED, TURN):
        return leg[FIN], elevator
    if kind == COUPLED:
        return leg[FIN], leg[SWITCH]
    if kind == WIGGLE:
        half = math.floor(2.0 * memory[LEG_TIME] / leg[SWITCH])
        return (leg[FIN] if half % 2 == 0 else -leg[FIN]), elevator
    if kind == ZIGZAG:
        return zigzag_fin(memory, leg, heading - memory[HEADING_0]), elevator
    gain, limit = gains.heading, gains.transit_limit
    if kind == STRAIGHT:
        gain, limit = gains.gentle, gains.transit_limit / 3.0
    rudder = heading_rudder(memory, heading, r, gain, gains, limit, dt)
    if kind == VERTICAL_ZIGZAG:
        trim = memory[MEAN_ELEVATOR] if math.isnan(leg[TRIM]) else leg[TRIM]
        return rudder, trim + zigzag_fin(memory, leg, pitch)
    memory[MEAN_ELEVATOR] += (elevator - memory[MEAN_ELEVATOR]) * min(dt / gains.trim_time, 1.0)
    return rudder, elevator


def leg_row(kind: int, duration_s: float, rpm: float, depth_m: float = np.nan, **others) -> list:
    """One leg; `others` are the columns of their name (fin, heading in rad)."""
    return [
        float(kind),
        float(others.get("maneuver", -1)),
        float(duration_s),
        float(rpm),
        float(others.get("fin", 0.0)),
        float(others.get("switch", 0.0)),
        float(others.get("count", 0.0)),
        float(others.get("heading", np.nan)),
        float(depth_m),
        float(others.get("longest", 0.0)),
        float(others.get("other", 1.0)),
        float(others.get("trim", 0.0)),
    ]
