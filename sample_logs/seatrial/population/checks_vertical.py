"""Can a drawn vehicle be sailed up and down? Trim, what an elevator does, a calm trial run."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from seatrial import helm
from seatrial.actuators import Servo
from seatrial.helm import Gains, leg_row
from seatrial.plant import STATES, PlantEffects, derivative, workspace
from seatrial.population.checks import DEGREE, DEPTH_M, MOST_PITCH_DEG, MOST_UNSTABLE
from seatrial.population.form import Refused, Size
from seatrial.simulate import ELEVATOR_COMMAND, STEP_S, Drive, Sea, run, start_state
from seatrial.vehicles import Vehicle, build_body

HEAVE_PITCH = np.array([2, 4, 10])
SLOW = 0.75  # of the design speed, the slowest of a trial
LEAST_PITCH = 0.3  # [rad/rad] at the slow speed, from which elevators can swing the vehicle
MOST_TRIM_DEG, TRIMMED = 4.5, 0.4  # of a vehicle that is out of trim, and how many are
MOST_HANGING_DEG = 8.0  # pitch of such a vehicle at rest
MOST_HELD_DEG = 8.0  # elevator that keeps the depth
STEP, HUNTING_DEG, LEFT = 1.5, 2.5, 0.35  # [L], pitch at rest, [L] from the depth at last
LEGS_TIME = (60.0, 70.0, 70.0)  # [L/U]
DIVE_M = 5.0
STIFFNESS = (1.0, 0.6, 1.7, 0.35)  # of the autopilot, the first that holds the vehicle


def out_of_trim(vehicle: Vehicle, size: Size, rng: np.random.Generator) -> Vehicle:
    """Some vehicles have their centre of gravity so far off that the elevators are laid for it."""
    laid = math.radians(rng.uniform(-MOST_TRIM_DEG, MOST_TRIM_DEG))
    if rng.random() > TRIMMED:
        return vehicle
    moment = -_moment(vehicle, size, 1e-3) / 1e-3 * laid
    tables = {**vehicle.file["vehicle"]}
    most = tables["z_g_m"] * math.tan(MOST_HANGING_DEG * DEGREE)
    tables["x_g_m"] = float(np.clip(tables["x_g_m"] - moment / vehicle.body.weight, -most, most))
    file = {**vehicle.file, "vehicle": tables}
    return replace(vehicle, file=file, body=build_body(file, vehicle.plant))


def _moment(vehicle: Vehicle, size: Size, elevator: float) -> float:
    """Pitch moment [N m] of an elevator angle at the design speed."""
    rates = [_rates(vehicle, size.speed, np.zeros(3), angle, whole=True) for angle in (elevator, 0)]
    return float((vehicle.body.mass @ (rates[0] - rates[1])[:6])[4])


def _rates(vehicle: Vehicle, speed: float, shift, elevator: float, whole: bool = False):
    """Derivative of (w, q, pitch) at a speed, level but for `shift`; or of the whole state."""
    state, out = np.zeros(STATES), np.zeros(STATES)
    state[0], state[8] = speed, DEPTH_M
    state[HEAVE_PITCH] += shift
    revs = vehicle.plant.cruise_rpm / 60.0  # the propeller gives no pitch moment
    body, none = vehicle.body, np.zeros(6)
    derivative(state, 0.0, elevator, revs, 1.0, none, body, PlantEffects(), np.zeros(6), out)
    return out if whole else out[HEAVE_PITCH]


def response(vehicle: Vehicle, size: Size, share: float = 1.0) -> tuple[float, float]:
    """Largest real eigenvalue [U/L], and steady pitch per elevator angle [rad/rad].

    Of the linear motion at a share of the design speed; the pitch is infinite where no steady
    one exists, as the vehicle pitches on.
    """
    speed = share * size.speed
    steps = 1e-5 * np.array([size.speed, 1.0 / size.time, 1.0])
    columns = [
        (_rates(vehicle, speed, h, 0.0) - _rates(vehicle, speed, -h, 0.0)) / (2 * h.max())
        for h in np.diag(steps)
    ]
    jacobian = np.column_stack(columns)
    laid = (
        _rates(vehicle, speed, np.zeros(3), 1e-4) - _rates(vehicle, speed, np.zeros(3), -1e-4)
    ) / 2e-4
    index = float(np.linalg.eigvals(jacobian).real.max() * size.time)
    if index > 0.0:
        return index, math.inf
    return index, abs(float(np.linalg.solve(jacobian, -laid)[2]))


def sail_check(vehicle: Vehicle, size: Size, gains: Gains):
    """Record of a calm run: level, a depth step, back; and the leg starts."""
    rpm, lower = vehicle.plant.cruise_rpm, DEPTH_M + STEP * size.length
    seconds = [k * size.time for k in LEGS_TIME]
    legs = [
        leg_row(helm.TRANSIT, s, rpm, depth, heading=0.0)
        for s, depth in zip(seconds, (DEPTH_M, lower, DEPTH_M), strict=True)
    ]
    start = start_state(DEPTH_M, 0.0)
    start[0] = size.speed
    return _calm_run(vehicle, gains, legs, start, sum(seconds))


def dives(vehicle: Vehicle, size: Size, gains: Gains) -> bool:
    """Whether a vehicle at rest at the surface comes down to twice its length below it."""
    depth = 2.0 * size.length + DIVE_M
    seconds = depth / (0.15 * size.speed) + 30.0 * size.time
    leg = leg_row(helm.TRANSIT, seconds, vehicle.plant.cruise_rpm, depth, heading=0.0)
    start = start_state(0.97 * vehicle.body.radius, 0.0)
    record, _ = _calm_run(vehicle, gains, [leg], start, seconds)
    return bool(record[-1, 8] > 0.8 * depth)


def _calm_run(vehicle: Vehicle, gains: Gains, legs: list, start: np.ndarray, seconds: float):
    calm = Sea(np.zeros(6), np.ones(1), np.zeros(1), np.zeros((1, 6)))
    noise = np.zeros((int((seconds + 5.0) / STEP_S), 9))
    parts = (PlantEffects(), Servo(), Servo(), Drive(), calm, gains, noise, workspace())
    return run(np.array(legs), start, vehicle.body, *parts)


def check_vertical(vehicle: Vehicle, size: Size, gains: Gains) -> tuple[dict, Gains]:
    """Facts about a vehicle in the vertical plane, and the autopilot that holds it.

    Raises `Refused` with the reason where no vertical maneuvers could be sailed.
    """
    index, authority = response(vehicle, size)
    if index > MOST_UNSTABLE:
        raise Refused("too unstable in pitch")
    slow = response(vehicle, size, SLOW)[1]
    if slow < LEAST_PITCH:
        raise Refused("elevators too weak to swing it")
    reasons = []
    for stiffness in STIFFNESS:
        tried = gains._replace(
            pitch=stiffness * gains.pitch,
            pitch_rate=stiffness * gains.pitch_rate,
            depth=min(stiffness, 1.0) * gains.depth,
        )
        record, starts = sail_check(vehicle, size, tried)
        fault = _fault(record, starts, size)
        if not fault and not dives(vehicle, size, tried):
            fault = "does not dive"
        reasons.append(fault)
        if not reasons[-1]:
            level = _end_of(record, starts, 0)
            return {
                "vertical_index": index,
                "pitch_per_elevator": min(authority, 1e3),
                "pitch_per_elevator_slow": min(slow, 1e3),
                "trim_deg": float(level[:, ELEVATOR_COMMAND].mean() / DEGREE),
                "level_pitch_deg": float(level[:, 10].mean() / DEGREE),
                "stiffness": stiffness,
            }, tried
    raise Refused(reasons[0])


def _end_of(record: np.ndarray, starts: np.ndarray, leg: int) -> np.ndarray:
    """Last quarter of a leg."""
    first, last = starts[leg] / STEP_S, starts[leg + 1] / STEP_S
    return record[int(first + 0.75 * (last - first)) : int(last)]


def _fault(record: np.ndarray, starts: np.ndarray, size: Size) -> str:
    """Why the autopilot does not hold the vehicle, or nothing."""
    if not np.isfinite(record).all() or np.abs(record[:, 10]).max() > MOST_PITCH_DEG * DEGREE:
        return "pitches up or down"
    for leg, depth in enumerate((0.0, STEP * size.length, 0.0)):
        end = _end_of(record, starts, leg)
        if np.abs(end[:, 8] - DEPTH_M - depth).max() > LEFT * size.length:
            return "does not come to its depth"
        if np.ptp(end[:, 10]) > HUNTING_DEG * DEGREE:
            return "hunts in depth"
    held = np.abs(_end_of(record, starts, 0)[:, ELEVATOR_COMMAND].mean())
    return "too far out of trim" if held > MOST_HELD_DEG * DEGREE else ""
