"""Does an effect show? The same inputs once with it and once without, against the noise.

The rule: an effect is visible where the root mean square of what it changes in the measured u, v
or r (u, w, q or pitch), over the maneuvers, is at least `VISIBLE` times the noise of that channel:
the sensor's own and the scatter of the motion itself, which the turbulence makes, root of the sum
of squares. A fault of the depth sensor shows in the depth, about its mean in each maneuver: what is
off by the same everywhere shows nowhere.

The trial without the effect follows the record of the one with it: it has the same commands, sea
and turbulence, and starts anew from the recorded motion every `WINDOW` L/U. So nothing drifts away,
and a vehicle that is directionally unstable can be compared too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba as nb
import numpy as np

from seatrial.actuators import Servo, felt_angle, motor_step, servo_step, servo_target
from seatrial.effects import PLANTED
from seatrial.plant import STATES, PlantEffects, rk4_step, workspace
from seatrial.planting import (
    fin_servo,
    motor_drive,
    plant_effects,
    vertical_water,
    with_weight,
)
from seatrial.population.drawn import Drawn, Sailed, with_faults
from seatrial.sensors import attitude, depth, dvl, gyro
from seatrial.simulate import (
    ELEVATOR,
    ELEVATOR_COMMAND,
    REVS,
    RPM_COMMAND,
    RUDDER,
    RUDDER_COMMAND,
    STEP_S,
    TURBULENCE_TIME_S,
    Drive,
    sea_forces,
    sinking,
)
from seatrial.vehicles import FIN_STALL, Body

VISIBLE = 1.0
WINDOW = 15.0  # [L/U]
OTHER_WINDOW = 17.0  # [L/U] what happens where one begins anew is seen in the other
CHANNELS = {"horizontal": ("u", "v", "r"), "vertical": ("u", "w", "q", "pitch")}
# columns of the record: what a push changes at once, in m/s and rad/s
PUSHED = {"horizontal": {"v_mps": 1, "r_radps": 5}, "vertical": {"w_mps": 2, "q_radps": 4}}
PUSH = "one_off_event"
DEPTH_FAULTS = ("depth_lag", "depth_scale")
# What happens in the record alone: following it has no legs, and no memory of its own.
NOT_AGAIN = (PUSH, "memory_force", "roll_mode", "stuck_elevator")


@dataclass(frozen=True)
class Variant:
    """A vehicle and what acts on it, to be compared with the one that was sailed."""

    body: Body
    effects: PlantEffects
    rudder: Servo
    elevator: Servo
    drive: Drive
    planted: dict  # for the sensors


@nb.njit(cache=True)
def _late(record, column, k, delay):
    return record[max(k - round(delay / STEP_S), 0), column]


@nb.njit(cache=True)
def taken_up(angle, servo):
    """What the play has let through where the servo has come to rest at `angle`."""
    return angle / (1.0 + servo.asymmetry if angle > 0.0 else 1.0 - servo.asymmetry)


@nb.njit(cache=True)
def follow(record, window, body, effects, rudder_servo, elevator_servo, drive, sea, gusts_in, work):
    """The record again with other parts, from the recorded motion anew every `window` steps."""
    found, state = record.copy(), np.zeros(STATES)
    outer, gusts = np.zeros(6), np.zeros(6)
    keep = math.exp(-STEP_S / TURBULENCE_TIME_S)
    rudder = elevator = revs = taken_rudder = taken_elevator = 0.0
    for k in range(record.shape[0]):
        if k % window == 0:
            state[:12], state[12:] = record[k, :12], 0.0
            rudder, elevator, revs = record[k, RUDDER], record[k, ELEVATOR], record[k, REVS]
            taken_rudder = taken_up(rudder, rudder_servo)
            taken_elevator = taken_up(elevator, elevator_servo)
        found[k, :12] = state[:12]
        wanted, taken_rudder = servo_target(
            _late(record, RUDDER_COMMAND, k, rudder_servo.delay), taken_rudder, rudder_servo
        )
        next_rudder = servo_step(rudder, wanted, rudder_servo, STEP_S)
        wanted, taken_elevator = servo_target(
            _late(record, ELEVATOR_COMMAND, k, elevator_servo.delay), taken_elevator, elevator_servo
        )
        next_elevator = servo_step(elevator, wanted, elevator_servo, STEP_S)
        next_revs = motor_step(revs, record[k, RPM_COMMAND] / 60.0, drive.lag, STEP_S)
        time = k * STEP_S
        thrust_factor = 1.0 - drive.sag_per_s * time
        if time >= drive.step_time:
            thrust_factor -= drive.step_fraction
        for j in range(6):
            gusts[j] = keep * gusts[j] + math.sqrt(1.0 - keep * keep) * gusts_in[k, j]
            outer[j] = sea.turbulence[j] * gusts[j]
        sea_forces(time, state, -2, 0.0, sea, outer)
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
    return found


def pushed_s(drawn: Drawn, sailed: Sailed) -> tuple[float, float]:
    """Start and end of the planted push on the clock of the record [s]."""
    effects = drawn.truth(sailed)["effects"]
    start, end = next(e["log_time_s"] for e in effects if e["id"] == PUSH)
    return start - drawn.origin, end - drawn.origin


def variant(drawn: Drawn, planted: dict, **changed) -> Variant:
    """The vehicle with other planted effects, or other parts."""
    parts = {
        "body": drawn.vehicle.body,
        "effects": plant_effects(planted),
        "rudder": drawn.rudder(planted),
        "elevator": drawn.elevator(planted),
        "drive": drawn.drive(planted),
        "planted": planted,
    }
    return Variant(**{**parts, **changed})


def motion(drawn: Drawn, sailed: Sailed, other: Variant, noise=None, window=WINDOW) -> np.ndarray:
    """Record of the variant along the sailed one, from that anew every `window` L/U."""
    calm = sailed.sea
    if "wave" not in other.planted:
        calm = calm._replace(swell_force=0.0, swell_moment=0.0)
    calm = with_weight(other.planted, vertical_water(other.planted, calm))
    steps = round(window * drawn.size.time / STEP_S)
    parts = (other.body, other.effects, other.rudder, other.elevator, other.drive, calm)
    gusts = sailed.noise if noise is None else noise
    return follow(sailed.record, steps, *parts, gusts, workspace())


def sudden(drawn: Drawn, sailed: Sailed) -> dict[str, float]:
    """Largest change within L/U that the planted push makes of sway and yaw (heave and pitch).

    In m/s and rad/s, against the same record without it, while it pushes; empty where none is
    planted.
    """
    if PUSH not in drawn.planted:
        return {}
    left = {k: v for k, v in drawn.planted.items() if k != PUSH}
    lag, columns = max(round(drawn.size.time / STEP_S), 1), PUSHED[drawn.plane]
    found, (start, end) = np.zeros(len(columns)), pushed_s(drawn, sailed)
    during = slice(max(round(start / STEP_S) - lag, 0), round(end / STEP_S) + lag)
    for window in (WINDOW, OTHER_WINDOW):
        other = motion(drawn, sailed, variant(drawn, left), window=window)
        pushed = (sailed.record - other)[:, list(columns.values())]
        part = np.arange(len(pushed)) // round(window * drawn.size.time / STEP_S)
        within = part[lag:] == part[:-lag]
        changes = np.abs(pushed[lag:] - pushed[:-lag]) * within[:, None]
        found = np.maximum(found, changes[during].max(axis=0))
    return dict(zip(columns, found.tolist(), strict=True))


def measured(drawn: Drawn, record: np.ndarray, planted: dict) -> dict:
    """Times and values of the channels with the noise of the trial, the same for every variant."""
    noise = drawn.equipment.noise
    speeds = dvl(record, drawn.vehicle, planted, drawn.stream("dvl"), noise)
    rates = gyro(record, planted, drawn.stream("gyro"), noise)
    if drawn.plane == "horizontal":
        return {
            "u": (speeds["time_s"], speeds["u_mps"]),
            "v": (speeds["time_s"], speeds["v_mps"]),
            "r": (rates["time_s"], rates["r"]),
        }
    tilt = attitude(record, planted, drawn.stream("attitude"), noise)
    deep = depth(record, planted, drawn.stream("depth"), noise)
    return {
        "u": (speeds["time_s"], speeds["u_mps"]),
        "w": (speeds["time_s"], speeds["w_mps"]),
        "q": (rates["time_s"], rates["q"]),
        "pitch": (tilt["time_s"], tilt["pitch"]),
        "depth": (deep["time_s"], deep["depth"]),
    }


def spans(drawn: Drawn, sailed: Sailed) -> list[tuple[float, float]]:
    """Start and end of the maneuvers on the clock of the record [s]."""
    found = drawn.truth(sailed)["maneuvers"]
    return [(m["t_start_s"] - drawn.origin, m["t_end_s"] - drawn.origin) for m in found]


def change(one: dict, other: dict, within: list[tuple[float, float]]) -> dict[str, float]:
    """Root mean square of the differences of each channel within the spans."""
    found = {}
    for channel, (times, values) in one.items():
        difference = values - other[channel][1]
        parts = [difference[(times >= start) & (times <= end)] for start, end in within]
        if channel == "depth":
            parts = [part - part.mean() for part in parts if part.size]
        found[channel] = float(np.sqrt(np.nanmean(np.concatenate(parts) ** 2)))
    return found


def background(drawn: Drawn, sailed: Sailed) -> dict[str, float]:
    """Noise of the channels: the sensor, and the scatter that other turbulence would make."""
    clean, within = variant(drawn, drawn.planted), spans(drawn, sailed)
    again = drawn.stream("other turbulence").normal(size=sailed.noise.shape)
    pair = [motion(drawn, sailed, clean, gusts) for gusts in (sailed.noise, again)]
    seen = [measured(drawn, record, drawn.planted) for record in pair]
    scatter, noise = change(*seen, within), drawn.equipment.noise
    own = dict.fromkeys("uvw", noise.dvl_mps) | dict.fromkeys("qr", noise.gyro_radps)
    own |= {"pitch": noise.tilt_rad, "depth": noise.depth_m}
    return {c: math.hypot(own[c], scatter[c] / math.sqrt(2.0)) for c in scatter}


def visibility(drawn: Drawn, sailed: Sailed) -> dict[str, dict]:
    """Every planted effect: change over noise by channel, and whether it is visible."""
    record, found = sailed.record, {}
    again = motion(drawn, sailed, variant(drawn, drawn.planted)) if drawn.planted else record
    for name in drawn.planted:
        left = {k: v for k, v in drawn.planted.items() if k != name}
        with_all = measured(drawn, record if name in NOT_AGAIN else again, drawn.planted)
        other = motion(drawn, sailed, variant(drawn, left))
        found[name] = (with_all, measured(drawn, other, left))
    return _judged(drawn, sailed, found)


def own_effects(drawn: Drawn, sailed: Sailed, asked: dict[str, dict]) -> dict[str, dict]:
    """What the drawn vehicle itself has of the effects asked for, as `visibility` puts it.

    `asked` holds the sizes that are said of each, by the parameters of the recipe. Some are taken
    away together: what their change says holds for each of them. ``explained`` is the share of that
    change, in power over the noise, that the effects as they are said make good in a vehicle from
    which its own have been taken; None where the recipe does not know them by these sizes.
    """
    as_it_is = variant(drawn, drawn.planted)
    found, explained = {}, {}
    for names, changes in without(drawn, as_it_is).items():
        said = {name: sizes for name, sizes in asked.items() if name in names}
        if not said:
            continue
        base, bare = (
            measured(drawn, motion(drawn, sailed, one), drawn.planted)
            for one in (as_it_is, variant(drawn, drawn.planted, **changes))
        )
        found |= dict.fromkeys(said, (base, bare))
        share = None
        if is_known(said, drawn.plane):
            record = motion(drawn, sailed, instead(drawn, changes, said))
            share = made_good(drawn, sailed, base, bare, measured(drawn, record, drawn.planted))
        explained |= {name: {"explained": share} for name in said}
    judged = _judged(drawn, sailed, found)
    return {name: row | explained[name] for name, row in judged.items()}


def is_known(said: dict[str, dict], plane: str) -> bool:
    """Whether the recipe has effects by the sizes that are said of them."""
    return all(set(PLANTED[plane][name].units) == set(sizes) for name, sizes in said.items())


def instead(drawn: Drawn, changes: dict, said: dict[str, dict]) -> Variant:
    """A vehicle without its own parts and with the effects that are said of it."""
    parts = dict(changes)
    for fin in ("rudder", "elevator"):
        if fin in parts:
            parts[fin] = with_faults(parts[fin], fin_servo(fin, said))
    if "drive" in parts:
        parts["drive"] = with_faults(parts["drive"], motor_drive(said))
    return variant(drawn, drawn.planted | said, **parts)


def made_good(drawn: Drawn, sailed: Sailed, base: dict, bare: dict, other: dict) -> float | None:
    """Share of what lies between `base` and `bare` that `other` makes good; None without any."""
    noise, within = background(drawn, sailed), spans(drawn, sailed)
    left, whole = (
        sum((change(base, one, within)[c] / noise[c]) ** 2 for c in CHANNELS[drawn.plane])
        for one in (other, bare)
    )
    return round(1.0 - left / whole, 3) if whole > 0.0 else None


def without(drawn: Drawn, as_it_is: Variant) -> dict[tuple[str, ...], dict]:
    """Changes that take something away from the vehicle, by the ids it would be called by."""
    if drawn.plane == "vertical":
        return without_upright(drawn, as_it_is)
    body, held = drawn.vehicle.body, as_it_is.rudder
    quick = held._replace(lag=1e-3, rate_limit=1e3, delay=0.0)
    true = held._replace(deadband=0.0, backlash=0.0, asymmetry=0.0, offset=0.0)
    effects = as_it_is.effects
    return hull_without(body, as_it_is) | {
        ("rudder_lag", "rudder_rate_limit", "rudder_delay"): {"rudder": quick},
        ("rudder_deadband", "rudder_backlash", "rudder_asymmetry", "rudder_offset"): {
            "rudder": true
        },
        ("sway_cross_flow",): {"effects": effects._replace(sway_cross_flow=-1.0)},
        ("yaw_cross_flow",): {"effects": effects._replace(yaw_cross_flow=-1.0)},
        ("propeller_side_force", "hull_asymmetry"): {
            "body": body._replace(kq=np.zeros(3), y_g=0.0),
        },
    }


def without_upright(drawn: Drawn, as_it_is: Variant) -> dict[tuple[str, ...], dict]:
    """As `without`, in the vertical plane."""
    held, effects = as_it_is.elevator, as_it_is.effects
    quick = held._replace(lag=1e-3, rate_limit=1e3, delay=0.0)
    true = held._replace(deadband=0.0, backlash=0.0, asymmetry=0.0, offset=0.0)
    return hull_without(drawn.vehicle.body, as_it_is) | {
        ("elevator_lag", "elevator_rate_limit", "elevator_delay"): {"elevator": quick},
        ("elevator_deadband", "elevator_backlash", "elevator_asymmetry", "elevator_offset"): {
            "elevator": true
        },
        ("heave_cross_flow",): {"effects": effects._replace(heave_cross_flow=-1.0)},
        ("pitch_cross_flow",): {"effects": effects._replace(pitch_cross_flow=-1.0)},
    }


def hull_without(body: Body, as_it_is: Variant) -> dict[tuple[str, ...], dict]:
    """What is taken away from motor, hull and fins in either plane."""
    no_linear, no_cubic, fins = body.damping.copy(), body.damping.copy(), body.fins.copy()
    no_linear[:, 0], no_cubic[:, 2], fins[:, FIN_STALL] = 0.0, 0.0, 1e3
    return {
        ("propeller_lag",): {"drive": as_it_is.drive._replace(lag=1e-3)},
        ("linear_damping",): {"body": body._replace(damping=no_linear)},
        ("cubic_damping",): {"body": body._replace(damping=no_cubic)},
        ("rudder_stall", "elevator_stall"): {"body": body._replace(fins=fins)},
        ("turning_drag",): {"body": body._replace(hull_induced=0.0)},
    }


def _judged(drawn: Drawn, sailed: Sailed, pairs: dict) -> dict[str, dict]:
    if not pairs:
        return {}
    noise, within = background(drawn, sailed), spans(drawn, sailed)
    found = {}
    for name, (one, other) in pairs.items():
        changed = change(one, other, within)
        shown = ("depth",) if name in DEPTH_FAULTS else CHANNELS[drawn.plane]
        ratios = {c: changed[c] / noise[c] for c in shown}
        largest = max(ratios, key=lambda c: ratios[c])
        found[name] = {
            "visible": bool(ratios[largest] >= VISIBLE),
            "channel": largest,
            "ratio": round(ratios[largest], 3),
        }
    return found
