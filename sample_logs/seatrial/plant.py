"""Six-degree-of-freedom plant: state derivative from fin angles, propeller speed and outer forces.

The velocities are relative to the water. A steady uniform current only carries that frame along
(Galilean invariance), so it enters the position and the velocity over ground and nothing else.

State: 0-2 u v w [m/s], 3-5 p q r [rad/s], 6-8 north east down [m], 9-11 roll pitch heading [rad]
(heading unwrapped), 12 lagged |v| r (|w| q where its force
is in the vertical plane), 13-14 angle and rate of the extra roll mode.

Sources: Fossen 2011 (rigid body, Coriolis from a mass matrix, restoring), Prestero 2001 (fins with
local inflow, cross-flow strips), ITTC 1957 (friction line), Hoerner 1965 (lift, induced drag).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba as nb
import numpy as np

from seatrial.vehicles import (
    CONTROL_ELEVATOR,
    CONTROL_RUDDER,
    FIN_AREA,
    FIN_CONTROL,
    FIN_DRAG,
    FIN_EFFECT,
    FIN_INDUCED,
    FIN_SLOPE,
    FIN_STALL,
    FIN_UPRIGHT,
    FIN_UPWASH,
    FIN_X,
    FIN_Y,
    FIN_Z,
)

STATES = 15


class PlantEffects(NamedTuple):
    """Size of every effect that acts inside the plant; zero is absent. Units in `effects.py`."""

    current_north: float = 0.0
    current_east: float = 0.0
    side_force_nn: float = 0.0
    yaw_moment_nn: float = 0.0
    side_force_uu: float = 0.0
    yaw_moment_uu: float = 0.0
    sway_cross_flow: float = 0.0
    yaw_cross_flow: float = 0.0
    linear_drag: float = 0.0
    cubic_vvr: float = 0.0
    cubic_rrr: float = 0.0
    turning_vv: float = 0.0
    turning_rr: float = 0.0
    roll_side_force: float = 0.0
    roll_yaw_moment: float = 0.0
    race: float = 0.0
    heading_side_force: float = 0.0
    heading_yaw_moment: float = 0.0
    memory_side_force: float = 0.0
    memory_yaw_moment: float = 0.0
    memory_time: float = 1.0
    mode_side_force: float = 0.0
    mode_frequency: float = 1.0
    mode_damping: float = 1.0
    linear_v: float = 0.0
    linear_r: float = 0.0
    heave_force_uu: float = 0.0
    pitch_moment_uu: float = 0.0
    heave_cross_flow: float = 0.0
    pitch_cross_flow: float = 0.0
    linear_w: float = 0.0
    linear_q: float = 0.0
    cubic_wwq: float = 0.0
    cubic_qqq: float = 0.0
    turning_ww: float = 0.0
    turning_qq: float = 0.0
    thrust_line: float = 0.0
    buoyancy_gradient: float = 0.0
    ballasted_at: float = 0.0
    memory_heave_force: float = 0.0
    memory_pitch_moment: float = 0.0


@nb.njit(cache=True)
def add_coriolis(nu, mass, tau):
    """Subtract ``C(nu) nu`` built from the mass matrix (Fossen 2011, eq. 3.46); does no work."""
    a0 = a1 = a2 = b0 = b1 = b2 = 0.0
    for j in range(6):
        a0 += mass[0, j] * nu[j]
        a1 += mass[1, j] * nu[j]
        a2 += mass[2, j] * nu[j]
        b0 += mass[3, j] * nu[j]
        b1 += mass[4, j] * nu[j]
        b2 += mass[5, j] * nu[j]
    u, v, w, p, q, r = nu[0], nu[1], nu[2], nu[3], nu[4], nu[5]
    tau[0] -= q * a2 - r * a1
    tau[1] -= r * a0 - p * a2
    tau[2] -= p * a1 - q * a0
    tau[3] -= v * a2 - w * a1 + q * b2 - r * b1
    tau[4] -= w * a0 - u * a2 + r * b0 - p * b2
    tau[5] -= u * a1 - v * a0 + p * b1 - q * b0


@nb.njit(cache=True)
def add_restoring(depth, roll, pitch, body, tau):
    """Weight at (x_g, y_g, z_g), buoyancy at O; it fades where the hull comes out of the water."""
    submerged = min(max(0.5 * (1.0 + depth / body.radius), 0.0), 1.0)
    net = body.weight - body.buoyancy * submerged
    tau[0] -= net * math.sin(pitch)
    tau[1] += net * math.cos(pitch) * math.sin(roll)
    tau[2] += net * math.cos(pitch) * math.cos(roll)
    tau[3] -= body.z_g * body.weight * math.cos(pitch) * math.sin(roll)
    tau[4] -= body.z_g * body.weight * math.sin(pitch)
    along, across = body.x_g * body.weight, body.y_g * body.weight
    tau[3] += across * math.cos(pitch) * math.cos(roll)
    tau[4] -= along * math.cos(pitch) * math.cos(roll)
    tau[5] += along * math.cos(pitch) * math.sin(roll) + across * math.sin(pitch)


@nb.njit(cache=True)
def add_hull(nu, body, effects, tau):
    """Axial drag, hull lift with its induced drag, roll damping, other damping, strips."""
    u, v, w, p, q, r = nu[0], nu[1], nu[2], nu[3], nu[4], nu[5]
    rho = body.density
    reynolds = max(abs(u) * body.length / body.viscosity, 1e4)
    friction = 0.075 / (math.log10(reynolds) - 2.0) ** 2
    drag = body.drag_form * body.frontal_area
    drag += body.friction_factor * friction * body.wetted_area
    tau[0] -= 0.5 * rho * drag * u * abs(u) - effects.linear_drag * u
    x = body.hull_lift_x
    side, heave = v + r * x, w - q * x
    speed = math.sqrt(u * u + v * v + w * w)
    tau[0] -= body.hull_induced * (side * side + heave * heave)
    tau[1] -= body.hull_lift * speed * side
    tau[2] -= body.hull_lift * speed * heave
    tau[4] += x * body.hull_lift * speed * heave
    tau[5] -= x * body.hull_lift * speed * side
    tau[3] -= (body.roll_linear + body.roll_quadratic * abs(p)) * p
    add_damping(nu, body.damping, tau)
    add_cross_flow(v, w, q, r, body, effects, tau)


@nb.njit(cache=True)
def add_damping(nu, damping, tau):
    """Linear, quadratic and cubic damping of sway, heave, pitch and yaw, each on its own."""
    for i in range(4):
        axis = (1, 2, 4, 5)[i]
        x = nu[axis]
        tau[axis] -= (damping[i, 0] + damping[i, 1] * abs(x) + damping[i, 2] * x * x) * x


@nb.njit(cache=True)
def add_cross_flow(v, w, q, r, body, effects, tau):
    """Cross-flow drag of the hull, strip by strip (Prestero 2001, eqs. 4.7 to 4.9)."""
    force_y = force_z = moment_y = moment_z = 0.0
    for i in range(body.strip_x.size):
        x = body.strip_x[i]
        side, heave = v + r * x, w - q * x
        load = 0.5 * body.density * body.cross_flow * body.strip_area[i]
        load *= math.sqrt(side * side + heave * heave)
        force_y -= load * side
        force_z -= load * heave
        moment_y += load * heave * x
        moment_z -= load * side * x
    tau[1] += force_y * (1.0 + effects.sway_cross_flow)
    tau[2] += force_z * (1.0 + effects.heave_cross_flow)
    tau[4] += moment_y * (1.0 + effects.pitch_cross_flow)
    tau[5] += moment_z * (1.0 + effects.yaw_cross_flow)


@nb.njit(cache=True)
def lift_coefficient(incidence, slope, stall):
    """Linear, then bending over around `stall` and falling with the cosine beyond [-]."""
    bent = incidence / (1.0 + (incidence / stall) ** 4) ** 0.25
    return slope * bent * math.cos(incidence)


@nb.njit(cache=True)
def add_fins(nu, rudder, elevator, thrust, body, effects, tau):
    """Lift and drag of each fin from the flow at its own centre."""
    for i in range(body.fins.shape[0]):
        fin = body.fins[i]
        x, y, z = fin[FIN_X], fin[FIN_Y], fin[FIN_Z]
        along = nu[0] + nu[4] * z - nu[5] * y
        side = nu[1] + nu[5] * x - nu[3] * z
        heave = nu[2] + nu[3] * y - nu[4] * x
        angle = 0.0
        if fin[FIN_CONTROL] == CONTROL_RUDDER:
            angle = -rudder
        elif fin[FIN_CONTROL] == CONTROL_ELEVATOR:
            angle = elevator
        if fin[FIN_CONTROL] != 0.0 and effects.race != 0.0:
            along = math.copysign(math.sqrt(along * along + effects.race * max(thrust, 0.0)), along)
        cross = side if fin[FIN_UPRIGHT] > 0.5 else heave
        square = along * along + cross * cross
        if square < 1e-10:
            continue
        inflow = math.atan2(cross, along)
        incidence = fin[FIN_UPWASH] * inflow + fin[FIN_EFFECT] * angle
        lift = lift_coefficient(incidence, fin[FIN_SLOPE], fin[FIN_STALL])
        drag = fin[FIN_DRAG] + fin[FIN_INDUCED] * lift * lift
        load = 0.5 * body.density * fin[FIN_AREA] * square
        forward = load * (lift * math.sin(inflow) - drag * math.cos(inflow))
        normal = -load * (lift * math.cos(inflow) + drag * math.sin(inflow))
        tau[0] += forward
        tau[4] += z * forward
        tau[5] -= y * forward
        if fin[FIN_UPRIGHT] > 0.5:
            tau[1] += normal
            tau[3] -= z * normal
            tau[5] += x * normal
        else:
            tau[2] += normal
            tau[3] += y * normal
            tau[4] -= x * normal


@nb.njit(cache=True)
def propeller(u, n, body):
    """Thrust on the hull [N] and shaft torque [N m] at `n` rev/s, from K_T(J) and K_Q(J)."""
    d = body.propeller_diameter
    turns = max(n, 0.05)
    advance = min(max((1.0 - body.wake) * u / (turns * d), -0.3), 1.2)
    kt = body.kt[0] + body.kt[1] * advance + body.kt[2] * advance * advance
    kq = body.kq[0] + body.kq[1] * advance + body.kq[2] * advance * advance
    load = body.density * max(n, 0.0) ** 2 * d**4
    return (1.0 - body.deduction) * load * kt, load * d * kq


@nb.njit(cache=True)
def add_odd_forces(state, n, effects, tau):
    """Forces of the planted effects that are no part of a healthy vehicle."""
    u, v, r, roll, heading = state[0], state[1], state[5], state[9], state[11]
    twice = math.cos(2.0 * heading)
    tau[0] += effects.turning_vv * v * v + effects.turning_rr * r * r
    tau[1] += effects.side_force_nn * n * n + effects.side_force_uu * u * abs(u)
    tau[1] += effects.roll_side_force * u * u * roll + effects.heading_side_force * twice
    tau[1] += effects.memory_side_force * state[12] + effects.mode_side_force * state[13]
    tau[5] += effects.yaw_moment_nn * n * n + effects.yaw_moment_uu * u * abs(u)
    tau[5] += effects.roll_yaw_moment * u * u * roll + effects.heading_yaw_moment * twice
    tau[5] += effects.memory_yaw_moment * state[12]
    tau[5] += effects.cubic_vvr * v * v * r + effects.cubic_rrr * r * r * r
    tau[1] += effects.linear_v * v
    tau[5] += effects.linear_r * r


@nb.njit(cache=True)
def add_vertical_forces(state, thrust, effects, tau):
    """Forces of the planted effects that act in the vertical plane."""
    u, w, q = state[0], state[2], state[4]
    tau[0] += effects.turning_ww * w * w + effects.turning_qq * q * q
    tau[2] += effects.heave_force_uu * u * abs(u) + effects.linear_w * w
    tau[2] += effects.memory_heave_force * state[12]
    tau[4] += effects.pitch_moment_uu * u * abs(u) + effects.linear_q * q
    tau[4] += effects.cubic_wwq * w * w * q + effects.cubic_qqq * q * q * q
    tau[4] += effects.thrust_line * thrust + effects.memory_pitch_moment * state[12]
    lost = effects.buoyancy_gradient * (state[8] - effects.ballasted_at)
    add_weight(lost, state[9], state[10], tau)


@nb.njit(cache=True)
def add_weight(weight, roll, pitch, tau):
    """A weight [N] more at O."""
    tau[0] -= weight * math.sin(pitch)
    tau[1] += weight * math.cos(pitch) * math.sin(roll)
    tau[2] += weight * math.cos(pitch) * math.cos(roll)


@nb.njit(cache=True)
def derivative(state, rudder, elevator, n, thrust_factor, outer, body, effects, tau, out):
    """Time derivative of the state into `out`; `outer` are the forces of sea and turbulence."""
    for i in range(6):
        tau[i] = outer[i]
    nu = state[:6]
    thrust, torque = propeller(state[0], n, body)
    thrust *= thrust_factor
    tau[0] += thrust
    tau[3] -= torque
    add_coriolis(nu, body.mass, tau)
    add_restoring(state[8], state[9], state[10], body, tau)
    add_hull(nu, body, effects, tau)
    add_fins(nu, rudder, elevator, thrust, body, effects, tau)
    add_odd_forces(state, n, effects, tau)
    add_vertical_forces(state, thrust, effects, tau)
    for i in range(6):
        total = 0.0
        for j in range(6):
            total += body.mass_inverse[i, j] * tau[j]
        out[i] = total
    kinematics(state, effects, out)
    driven = abs(state[1]) * state[5]
    if effects.memory_heave_force != 0.0 or effects.memory_pitch_moment != 0.0:
        driven = abs(state[2]) * state[4]
    out[12] = (driven - state[12]) / effects.memory_time
    omega = effects.mode_frequency
    out[13] = state[14]
    out[14] = -2.0 * effects.mode_damping * omega * state[14]
    out[14] += omega * omega * (state[0] * state[5] - state[13])


@nb.njit(cache=True)
def kinematics(state, effects, out):
    """Position and Euler angles (Fossen 2011, eqs. 2.18 and 2.28); the current carries along."""
    u, v, w, p, q, r = state[0], state[1], state[2], state[3], state[4], state[5]
    cr, sr = math.cos(state[9]), math.sin(state[9])
    cp, sp = math.cos(state[10]), math.sin(state[10])
    ch, sh = math.cos(state[11]), math.sin(state[11])
    out[6] = ch * cp * u + (ch * sp * sr - sh * cr) * v + (ch * sp * cr + sh * sr) * w
    out[7] = sh * cp * u + (sh * sp * sr + ch * cr) * v + (sh * sp * cr - ch * sr) * w
    out[8] = -sp * u + cp * sr * v + cp * cr * w
    out[6] += effects.current_north
    out[7] += effects.current_east
    out[9] = p + (q * sr + r * cr) * sp / cp
    out[10] = q * cr - r * sr
    out[11] = (q * sr + r * cr) / cp


@nb.njit(cache=True)
def rk4_step(state, dt, rudder, elevator, n, thrust_factor, outer, body, effects, work):
    """Advance `state` in place by one Runge-Kutta step with fins and propeller held."""
    k1, k2, k3, k4, trial, tau = work[0], work[1], work[2], work[3], work[4], work[5]
    derivative(state, rudder, elevator, n, thrust_factor, outer, body, effects, tau, k1)
    trial[:] = state + 0.5 * dt * k1
    derivative(trial, rudder, elevator, n, thrust_factor, outer, body, effects, tau, k2)
    trial[:] = state + 0.5 * dt * k2
    derivative(trial, rudder, elevator, n, thrust_factor, outer, body, effects, tau, k3)
    trial[:] = state + dt * k3
    derivative(trial, rudder, elevator, n, thrust_factor, outer, body, effects, tau, k4)
    state += dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


def workspace() -> np.ndarray:
    """Scratch rows for `rk4_step`."""
    return np.zeros((6, STATES))
