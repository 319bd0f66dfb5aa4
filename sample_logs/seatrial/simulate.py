"""The compiled loop: helm, servos, sea and plant at 100 Hz, one row recorded per step.

numba keeps the compiled `run`, with what it calls, until this very file changes: after a change of
`plant`, `helm` or `actuators` remove ``__pycache__``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from seatrial import helm
from seatrial.actuators import felt_angle, motor_step, servo_step, servo_target
from seatrial.plant import STATES, add_weight, rk4_step
from seatrial.vehicles import GRAVITY

STEP_S = 0.01
CONTROL_STEPS = 5  # helm at 20 Hz
TURBULENCE_TIME_S = 2.0
CALM_ABOVE_M = 3.0  # depth above which rising and sinking of the water fades
# Recorded columns: 12 states, then these.
RUDDER_COMMAND, ELEVATOR_COMMAND, RPM_COMMAND, RUDDER, ELEVATOR, REVS = range(12, 18)
RECORD_COLUMNS = 18


class Sea(NamedTuple):
    """Outer forces. Surface waves fade with depth; the swell of the wave effect does not."""

    turbulence: np.ndarray  # standard deviations of six OU forces [N, N m]
    surface_omega: np.ndarray  # [rad/s]
    surface_phase: np.ndarray
    surface_force: np.ndarray  # components x six forces [N, N m]
    swell_force: float = 0.0  # [N]
    swell_moment: float = 0.0  # [N m]
    swell_omega: float = 1.0  # [rad/s]
    swell_direction: float = 0.0  # [rad]
    event_leg: int = -1
    event_after_s: float = 0.0
    event_duration_s: float = 1.0
    event_force: float = 0.0
    event_moment: float = 0.0
    upright: bool = False  # swell and event act in heave and pitch, not in sway and yaw
    weight_change: float = 0.0  # [N], from `weight_time` on
    weight_station: float = 0.0  # [m]
    weight_time: float = 1e9
    sinking: float = 0.0  # of the water [m/s], well below the surface
    wave_speed: float = 0.0  # of its slow rise and fall [m/s]
    wave_omega: float = 1.0
    stuck_leg: int = -1  # in which the elevators stop where they are
    stuck_after_s: float = 0.0
    stuck_for_s: float = 0.0


class Drive(NamedTuple):
    """Motor and what happens to the thrust in the course of the trial."""

    lag: float = 0.12
    sag_per_s: float = 0.0
    step_fraction: float = 0.0
    step_time: float = 1e9


@nb.njit(cache=True)
def sea_forces(time, state, leg, leg_time, sea, out):
    """Surface waves, swell and the one-off event, added to `out`."""
    depth = max(state[8], 0.0)
    for i in range(sea.surface_omega.size):
        omega = sea.surface_omega[i]
        factor = math.exp(-omega * omega / GRAVITY * depth)
        factor *= math.sin(omega * time + sea.surface_phase[i])
        for j in range(6):
            out[j] += factor * sea.surface_force[i, j]
    if sea.swell_force != 0.0 or sea.swell_moment != 0.0:
        number = sea.swell_omega**2 / GRAVITY
        ahead = state[6] * math.cos(sea.swell_direction) + state[7] * math.sin(sea.swell_direction)
        wave = math.sin(sea.swell_omega * time - number * ahead)
        bearing = sea.swell_direction - state[11]
        if sea.upright:
            slope = math.cos(sea.swell_omega * time - number * ahead)
            out[2] += sea.swell_force * wave
            out[4] += sea.swell_moment * slope * math.cos(bearing)
        else:
            out[0] += sea.swell_force * wave * math.cos(bearing)
            out[1] += sea.swell_force * wave * math.sin(bearing)
            out[5] += sea.swell_moment * wave * math.sin(2.0 * bearing)
    if leg == sea.event_leg:
        phase = (leg_time - sea.event_after_s) / sea.event_duration_s
        if 0.0 <= phase <= 1.0:
            out[2 if sea.upright else 1] += sea.event_force * math.sin(math.pi * phase)
            out[4 if sea.upright else 5] += sea.event_moment * math.sin(math.pi * phase)
    if time >= sea.weight_time:
        add_weight(sea.weight_change, state[9], state[10], out)
        arm = sea.weight_station * math.cos(state[10])
        out[4] -= sea.weight_change * arm * math.cos(state[9])
        out[5] += sea.weight_change * arm * math.sin(state[9])


@nb.njit(cache=True)
def is_stuck(leg, leg_time, sea):
    """Whether the elevators stand still."""
    since = leg_time - sea.stuck_after_s
    return leg == sea.stuck_leg and 0.0 <= since < sea.stuck_for_s


@nb.njit(cache=True)
def sinking(time, depth, sea):
    """Downward speed of the water [m/s]: steady, with a slow wave, and none at the surface."""
    below = min(max(depth / CALM_ABOVE_M, 0.0), 1.0)
    return below * (sea.sinking + sea.wave_speed * math.sin(sea.wave_omega * time))


@nb.njit(cache=True)
def run(legs, start, body, effects, rudder_servo, elevator_servo, drive, sea, gains, noise, work):
    """Sail the legs. `noise` has, per step, six turbulence and three in-loop sensor normals.

    Returns the record (steps x RECORD_COLUMNS) and the start time [s] of every leg (one more
    entry for the end).
    """
    steps = noise.shape[0]
    record = np.zeros((steps, RECORD_COLUMNS))
    starts = np.full(legs.shape[0] + 1, -1.0)
    state, memory = start.copy(), np.zeros(helm.MEMORY)
    memory[helm.MANEUVER_0] = -2.0
    outer, gusts = np.zeros(6), np.zeros(6)
    keep = math.exp(-STEP_S / TURBULENCE_TIME_S)
    rudder = elevator = revs = rudder_command = elevator_command = 0.0
    taken_rudder = taken_elevator = 0.0
    count = 0
    starts[0] = 0.0
    helm.start_leg(memory, legs, state[11])
    for k in range(steps):
        time = k * STEP_S
        if k % CONTROL_STEPS == 0:
            heading = state[11] + 0.1 * math.pi / 180.0 * noise[k, 6]
            pitch = state[10] + 0.1 * math.pi / 180.0 * noise[k, 7]
            depth = state[8] + 0.01 * noise[k, 8]
            if helm.leg_is_over(memory, legs[int(memory[helm.LEG])], heading, pitch):
                memory[helm.LEG] += 1.0
                starts[int(memory[helm.LEG])] = time
                if int(memory[helm.LEG]) >= legs.shape[0]:
                    break
                helm.start_leg(memory, legs, heading)
            leg = legs[int(memory[helm.LEG])]
            measured = (heading, pitch, depth, state[4], state[5])
            wanted, elevator_command = helm.commands(
                memory, leg, measured, gains, CONTROL_STEPS * STEP_S
            )
            rudder_command = helm.moved(rudder_command, wanted, gains, CONTROL_STEPS * STEP_S)
        leg = legs[int(memory[helm.LEG])]
        record[k, :12] = state[:12]
        record[k, RUDDER_COMMAND], record[k, ELEVATOR_COMMAND] = rudder_command, elevator_command
        record[k, RPM_COMMAND] = leg[helm.RPM]
        record[k, RUDDER], record[k, ELEVATOR], record[k, REVS] = rudder, elevator, revs
        count = k + 1

        late = max(k - round(rudder_servo.delay / STEP_S), 0)
        wanted, taken_rudder = servo_target(
            record[late, RUDDER_COMMAND], taken_rudder, rudder_servo
        )
        next_rudder = servo_step(rudder, wanted, rudder_servo, STEP_S)
        late = max(k - round(elevator_servo.delay / STEP_S), 0)
        wanted, taken_elevator = servo_target(
            record[late, ELEVATOR_COMMAND], taken_elevator, elevator_servo
        )
        next_elevator = servo_step(elevator, wanted, elevator_servo, STEP_S)
        if is_stuck(int(memory[helm.LEG]), memory[helm.LEG_TIME], sea):
            next_elevator = elevator
        next_revs = motor_step(revs, leg[helm.RPM] / 60.0, drive.lag, STEP_S)
        thrust_factor = 1.0 - drive.sag_per_s * time
        if time >= drive.step_time:
            thrust_factor -= drive.step_fraction
        for j in range(6):
            gusts[j] = keep * gusts[j] + math.sqrt(1.0 - keep * keep) * noise[k, j]
            outer[j] = sea.turbulence[j] * gusts[j]
        sea_forces(time, state, int(memory[helm.LEG]), memory[helm.LEG_TIME], sea, outer)
        rk4_step(
            state,
            STEP_S,
            felt_angle(0.5 * (rudder + next_rudder), rudder_servo),
            felt_angle(0.5 * (elevator + next_elevator), elevator_servo),
            0.5 * (revs + next_revs),
            thrust_factor,
            outer,
            body,
            effects,
            work,
        )
        state[8] += sinking(time, state[8], sea) * STEP_S
        rudder, elevator, revs = next_rudder, next_elevator, next_revs
        memory[helm.LEG_TIME] += STEP_S
    return record[:count], starts


def start_state(depth_m: float, heading_rad: float) -> np.ndarray:
    """Vehicle at rest."""
    state = np.zeros(STATES)
    state[8], state[11] = depth_m, heading_rad
    return state
