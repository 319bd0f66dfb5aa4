"""Is a drawn vehicle one that could go to sea? Stability index, speed, turns, roll, energy."""

from __future__ import annotations

import math

import numpy as np

from seatrial import helm
from seatrial.actuators import Servo
from seatrial.helm import Gains, leg_row
from seatrial.plant import STATES, PlantEffects, derivative, rk4_step, workspace
from seatrial.population.form import Refused, Size
from seatrial.simulate import STEP_S, Drive, Sea, run, start_state
from seatrial.vehicles import Body, Vehicle

DEPTH_M = 200.0  # no surface in the way
CHECK_DEG = 15.0
DIAMETERS, SPEED_ERROR, MOST_ROLL_DEG, MOST_PITCH_DEG = (2.0, 12.0), 0.15, 20.0, 25.0
MOST_UNSTABLE = 0.6  # eigenvalue [U/L] from which the autopilot loses the vehicle
LEGS_TIME = (40.0, 90.0, 40.0, 90.0, 40.0)  # [L/U]
DEGREE = math.pi / 180.0


def stability(vehicle: Vehicle, size: Size) -> dict:
    """Linear stability of the straight run: largest real parts of the eigenvalues [U/L].

    ``index`` is that of sway and yaw alone, ``with_roll`` has roll and its rate too; positive is
    directionally unstable.
    """
    body, state = vehicle.body, np.zeros(STATES)
    state[0], state[8] = size.speed, DEPTH_M
    revs = vehicle.plant.cruise_rpm / 60.0
    places = np.array([1, 5, 3, 9])

    def rates(shift: np.ndarray) -> np.ndarray:
        moved, out = state.copy(), np.zeros(STATES)
        moved[places] += shift
        derivative(moved, 0.0, 0.0, revs, 1.0, np.zeros(6), body, PlantEffects(), np.zeros(6), out)
        return out[places]

    steps = 1e-5 * np.array([size.speed, 1.0 / size.time, 1.0 / size.time, 1.0])
    columns = [(rates(h) - rates(-h)) / (2 * h.max()) for h in np.diag(steps)]
    jacobian = np.column_stack(columns)
    own = np.linalg.eigvals(jacobian[:2, :2]).real.max()
    whole = np.linalg.eigvals(jacobian).real.max()
    return {"index": float(own * size.time), "with_roll": float(whole * size.time)}


def roll_mode(vehicle: Vehicle) -> dict:
    """Natural frequency [rad/s] and damping ratio of roll at rest."""
    body = vehicle.body
    stiffness, inertia = body.weight * body.z_g, body.mass[3, 3]
    return {
        "frequency_radps": math.sqrt(stiffness / inertia),
        "damping": body.roll_linear / (2.0 * math.sqrt(stiffness * inertia)),
    }


def sail_check(vehicle: Vehicle, size: Size, gains: Gains) -> np.ndarray:
    """Record of a calm run: ahead, a turn to either side, ahead again; and the leg starts."""
    rpm, seconds = vehicle.plant.cruise_rpm, [k * size.time for k in LEGS_TIME]
    legs = [
        leg_row(helm.TRANSIT, seconds[0], rpm, DEPTH_M, heading=0.0),
        leg_row(helm.FIXED, seconds[1], rpm, DEPTH_M, fin=CHECK_DEG * DEGREE),
        leg_row(helm.TRANSIT, seconds[2], rpm, DEPTH_M, heading=0.0),
        leg_row(helm.FIXED, seconds[3], rpm, DEPTH_M, fin=-CHECK_DEG * DEGREE),
        leg_row(helm.TRANSIT, seconds[4], rpm, DEPTH_M, heading=0.0),
    ]
    calm = Sea(np.zeros(6), np.ones(1), np.zeros(1), np.zeros((1, 6)))
    start = start_state(DEPTH_M, 0.0)
    start[0] = 0.8 * size.speed
    noise = np.zeros((int((sum(seconds) + 5.0) / STEP_S), 9))
    parts = (PlantEffects(), Servo(), Servo(), Drive(), calm, gains, noise, workspace())
    return run(np.array(legs), start, vehicle.body, *parts)


def check(vehicle: Vehicle, size: Size, gains: Gains) -> dict:
    """Facts about a vehicle; raises `Refused` with the reason where it could not be sailed."""
    stable = stability(vehicle, size)
    if stable["index"] > MOST_UNSTABLE:
        raise Refused("too unstable")
    record, starts = sail_check(vehicle, size, gains)
    if not np.isfinite(record).all():
        raise Refused("ran away")
    if np.abs(record[:, 9]).max() > MOST_ROLL_DEG * DEGREE:
        raise Refused("rolls over")
    if np.abs(record[:, 10]).max() > MOST_PITCH_DEG * DEGREE:
        raise Refused("pitches up or down")
    if np.abs(record[:, 8] - DEPTH_M).max() > max(3.0, 2.5 * size.length):
        raise Refused("does not keep its depth")
    ahead, *turns = (_settled(record, starts, leg) for leg in (0, 1, 3))
    if abs(ahead[0] / size.speed - 1.0) > SPEED_ERROR:
        raise Refused("steady speed is not the design speed")
    diameters = [_diameter(turn) / size.length for turn in turns]
    if not all(DIAMETERS[0] < d < DIAMETERS[1] for d in diameters):
        raise Refused("turning diameter out of range")
    home = record[int((starts[5] - 5.0 * size.time) / STEP_S) : int(starts[5] / STEP_S)]
    if np.abs(np.angle(np.exp(1j * home[:, 11]))).max() > 6.0 * DEGREE:
        raise Refused("does not keep its heading")
    if not loses_energy(vehicle.body, size):
        raise Refused("gains energy at zero control")
    return {
        **stable,
        "roll": roll_mode(vehicle),
        "steady_speed_mps": float(ahead[0]),
        "turning_diameters": diameters,
        "speed_kept_in_turns": float(np.mean([t[0] for t in turns]) / ahead[0]),
        "heel_deg": float(np.abs(record[:, 9]).max() / DEGREE),
        "rate_per_rudder": float(np.mean([abs(t[5]) for t in turns]) / (CHECK_DEG * DEGREE)),
        "net_buoyancy": vehicle.body.buoyancy / vehicle.body.weight - 1.0,
    }


def _settled(record: np.ndarray, starts: np.ndarray, leg: int) -> np.ndarray:
    """Mean of the last quarter of a leg."""
    first, last = starts[leg] / STEP_S, starts[leg + 1] / STEP_S
    return record[int(first + 0.75 * (last - first)) : int(last)].mean(axis=0)


def _diameter(mean: np.ndarray) -> float:
    """Of a steady turn [m]."""
    return float(2.0 * math.hypot(mean[0], mean[1]) / max(abs(mean[5]), 1e-9))


def without_engine(body: Body) -> Body:
    """The same body without propeller, weight and buoyancy."""
    return body._replace(kt=np.zeros(3), kq=np.zeros(3), weight=0.0, buoyancy=0.0)


def loses_energy(body: Body, size: Size) -> bool:
    """Whether the kinetic energy of a tumbling start only falls, propeller and fins at rest."""
    still, state, work = without_engine(body), np.zeros(STATES), workspace()
    state[:3] = np.array([0.9, 0.12, -0.08]) * size.speed
    state[3:6] = np.array([0.1, -0.15, 0.3]) / size.time
    state[8], step = DEPTH_M, 0.01 * size.time
    last = math.inf
    for _ in range(500):
        energy = 0.5 * state[:6] @ body.mass @ state[:6]
        if energy > last:
            return False
        last = energy
        rk4_step(state, step, 0.0, 0.0, 0.0, 1.0, np.zeros(6), still, PlantEffects(), work)
    return True
