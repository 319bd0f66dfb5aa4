"""What becomes of a command: from the logged inputs to those that act on the vehicle.

The input side of the prediction. Logged commands are held until the next one and given as means
over each step. In order: a delay; dead band, play and unequal gain between command and servo; a
first-order servo with a slew limit; an offset of the fin; separation of the flow. The propeller
follows its command with a lag, and the thrust may fall through the trial; so may a weight at one
time. The race behind it makes the flow past a fin faster. Without effects the inputs pass
unchanged. The fin is that of the plane: rudder or elevator.
"""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.jit import borrowing, kernel
from auvident.physics.term_tables import N_INPUTS
from auvident.physics.vector import values_of
from auvident.schema.effects import name_in
from auvident.schema.planes import PLANES, Plane

Array = npt.NDArray[Any]

SUBSTEPS = 5  # of a step, for the servo: a fifth of a step is short beside any servo
# [rad or 1/s] nearer to its target a servo or a propeller has arrived: on its way to zero it would
# pass numbers so small that the processor takes a hundred times as long over each
ARRIVED = 1.0e-100
SAG_PERIOD_S = 1000.0  # the thrust sags by its fraction in this time
# parameters in the order in which `actuate_steps` takes them, in the horizontal plane
COMMAND = (
    "rudder_delay.delay_s",
    "rudder_deadband.deadband_deg",
    "rudder_backlash.half_width_deg",
    "rudder_asymmetry.gain",
    "rudder_lag.lag_s",
    "rudder_rate_limit.rate_degps",
    "rudder_offset.offset_deg",
    "rudder_stall.angle_deg",
    "propeller_race.c_m2ps2pn",
    "propeller_lag.lag_s",
    "thrust_sag.fraction_per_1000_s",
    "thrust_step.fraction",
    "thrust_step.time_s",
    "thrust_step.over_s",
    "weight_change.time_s",
    "weight_change.over_s",
    "T_nn",
    "T_nu",
    "x_fin",
)
COMMANDS = {plane: tuple(name_in(plane, name) for name in COMMAND) for plane in PLANES}
DELAY, DEADBAND, BACKLASH, ASYMMETRY, LAG, SLOWNESS, OFFSET, STALL, RACE = range(9)
MOTOR_LAG, SAG, STEP, STEP_TIME, OVER, CHANGE_TIME, CHANGE_OVER, T_NN, T_NU, X_FIN = range(9, 19)
SERVO = (DELAY, DEADBAND, BACKLASH, ASYMMETRY, LAG, SLOWNESS)
STEERING = (*SERVO, OFFSET, STALL)  # act on the own control alone; the others on all but it
# columns of the inputs
CONTROL, OTHER, REVS, THRUST, DRIVE, CHANGED, RACED, FLOW, REACH = range(9)
ROLL, PITCH, DEPTH, FORCE = range(9, 13)
ACTED = REACH + 1  # so many columns come of the commands
NOWHERE, NO_STEP, NO_PAST = np.zeros(0, dtype=np.int64), np.zeros((0, 2)), np.zeros(0)


@kernel
def servo_angle(command, lag, slowness, deadband, half_width, asymmetry, dt, out):
    """Step means of the angle of a servo.

    Its mean over a substep lies short of the target by a share of the distance at its beginning:
    (lag/h) (1 - exp(-h/lag)) of a lag alone; of a slew limit alone, which would take the share
    t of the substep, t/2, or 1 - 1/(2 t) where it does not arrive. Exact for either, for both
    where the limit rules; and what is off leaves no trace, however it is approached.

    Parameters
    ----------
    command : (n,) array
        Step means of the angle ordered [rad].
    lag : float
        Time constant [s]; zero follows at once.
    slowness : float
        Inverse of the slew limit [s/rad]; zero has none.
    deadband, half_width : float
        Of the command, and of the play [rad].
    asymmetry : float
        Gain 1 + asymmetry to the positive, 1 - asymmetry to the negative side.
    dt : float
        Step [s].
    out : (n,) array, filled
    """
    h, keep, most, trailing = servo_constants(lag, slowness, dt)
    taken = angle = 0.0
    for k in range(command.shape[0]):
        taken = taken_up(command[k], taken, deadband, half_width if k > 0 else 0.0)
        target = unequal(taken, asymmetry)
        if k == 0:
            angle = target
        out[k], angle = turned(target, angle, slowness, h, keep, most, trailing)


@kernel
def servo_constants(lag, slowness, dt):
    """Substep, what a lag leaves of a distance in it, most that is turned, trailing share."""
    h = dt / SUBSTEPS
    keep = math.exp(-h / lag) if lag > 0.0 else 0.0
    most = h / slowness if slowness > 0.0 else math.inf
    return h, keep, most, lag / h * (1.0 - keep) if lag > 0.0 else 0.0


@borrowing
def taken_up(command, taken, deadband, half_width):
    """Command behind the dead band and the play, that was `taken` before."""
    ordered = math.copysign(max(abs(command) - deadband, 0.0), command)
    return min(max(taken, ordered - half_width), ordered + half_width)


@borrowing
def unequal(taken, asymmetry):
    """Angle that the servo goes to, by its unequal gain."""
    return taken * (1.0 + asymmetry if taken > 0.0 else 1.0 - asymmetry)


@kernel
def turned(target, angle, slowness, h, keep, most, trailing):
    """Mean angle of the servo over one step, and the angle that it comes to."""
    short, per_angle = 0.0, max(slowness, 0.0) / h
    for _ in range(SUBSTEPS):
        distance = target - angle
        if distance == 0.0:  # mostly at once: without a lag only the longest turns take a step
            break
        lying, turn = substep(distance, per_angle, 1.0 - keep, most, trailing)
        short, angle = short + lying, angle + turn
    return target - short / SUBSTEPS, arrived(angle, target)


@borrowing
def arrived(value, target):
    """The target, where a value has come as near to it as counts."""
    return target if abs(target - value) < ARRIVED else value


@borrowing
def substep(distance, per_angle, made_up, most, trailing):
    """How far short of its target a servo lies in the mean over a substep, and how far it turns."""
    turning = abs(distance) * per_angle
    limited = 0.5 * turning if turning <= 1.0 else 1.0 - 0.5 / turning
    lying = max(trailing, limited) * distance
    return lying, min(max(distance * made_up, -most), most)


@kernel
def lagged(command, lag, dt, out):
    """Step means of a first-order response to step means of its command."""
    if lag <= 0.0:
        for k in range(command.shape[0]):
            out[k] = command[k]
        return
    keep = math.exp(-dt / lag)
    now = command[0]
    for k in range(command.shape[0]):
        out[k] = command[k] + (now - command[k]) * (1.0 - keep) * lag / dt
        now = arrived(command[k] + (now - command[k]) * keep, command[k])


@borrowing
def share_fallen(elapsed, time, undecided):
    """Part of a step that has been made, to be expected at a time.

    Where only an interval is known, all times in it are as likely, and the part rises along it.
    """
    since = elapsed - time + 0.5 * undecided
    if since < 0.0:
        return 0.0
    return since / undecided if since < undecided else 1.0


@kernel
def servo_parts(e, dt, share, parts):
    """Fill the constants (2, 4) of a servo with effects e (19,), see `follow`."""
    for part in range(2):
        lasts = dt * (1.0 - share if part else share)
        if lasts > 0.0:
            h, keep, most, trailing = servo_constants(e[LAG], e[SLOWNESS], lasts)
            parts[part, 0], parts[part, 1], parts[part, 2], parts[part, 3] = h, keep, most, trailing


@kernel
def follow(before, order, share, parts, e, half_width, taken, angle):
    """One step of a servo whose order arrives late.

    For the first share of the step it goes after the order before, for the rest after the new one.
    A servo that goes after their mean instead does not feel a small delay at all as long as it
    turns as fast as it can, and a fit comes to rest where the delay is a whole number of steps.

    Parameters
    ----------
    before, order : float
        [rad]
    share : float
        Of the step, at which the order arrives.
    parts : (2, 4) array
        From `servo_parts`.
    e : (19,) array
        Internal values in the order of `COMMAND`.
    half_width : float
        Of the play [rad].
    taken, angle : float
        Order behind the play, and angle of the servo, when the step begins [rad].

    Returns
    -------
    float
        Mean angle over the step.
    float, float
        `taken` and `angle` at its end.
    """
    mean = 0.0
    for part in range(2):
        lasts = 1.0 - share if part else share
        if lasts > 0.0:
            taken = taken_up(order if part else before, taken, e[DEADBAND], half_width)
            target = unequal(taken, e[ASYMMETRY])
            h, keep, most, trailing = parts[part]
            reached, angle = turned(target, angle, e[SLOWNESS], h, keep, most, trailing)
            mean += lasts * reached
    return mean, taken, angle


@kernel
def play_after(past, order, e):
    """Order behind the play (rad), with effects e (19,), after past orders (k,) and then another.

    Nothing is known of the time before them: the play is where the first one leaves it.
    """
    taken = taken_up(past[0] if past.shape[0] > 0 else order, 0.0, e[DEADBAND], 0.0)
    for before in past:
        taken = taken_up(before, taken, e[DEADBAND], e[BACKLASH])
    return taken_up(order, taken, e[DEADBAND], e[BACKLASH])


@kernel
def turning_points(values):
    """What a play remembers of past orders (n,): their turning points, each swing within the last.

    A swing that a later one exceeds leaves no trace (the return-point memory of hysteresis;
    Mayergoyz 1991): hours of steering leave a few points. What is not finite is left out.
    """
    kept, count = np.empty(values.shape[0]), 0
    for value in values:
        if not math.isfinite(value) or (count > 0 and value == kept[count - 1]):
            continue
        if count > 1 and (kept[count - 1] - kept[count - 2]) * (value - kept[count - 1]) > 0.0:
            count -= 1  # it goes on as before
        while count > 2 and _is_wiped_out(kept[count - 3 : count], value):
            count -= 2
        kept[count] = value
        count += 1
    return kept[:count].copy()


@kernel
def _is_wiped_out(points, value):
    """Whether the second swing of three points lies within the first, and an order exceeds it."""
    swing = abs(points[2] - points[1])
    return abs(points[1] - points[0]) >= swing and abs(value - points[2]) >= swing


@kernel
def _turn_fins(past, command, dt, e, angle):
    """Angles (v, n) of the servo with each of some effects e (v, 19).

    Substep by substep, as the processor works on several servos at a time but on one substep of
    each; of one servo `follow` says the same.
    """
    count, last = e.shape[0], command.shape[0] - 1
    parts, lasts, whole = np.ones((2, 4)), np.empty((2, count)), np.empty(count, np.int64)
    turning = np.ones((2, 4, count))
    taken, reached = np.empty(count), np.empty(count)
    target, short = np.empty(count), np.empty(count)
    for v in range(count):
        whole[v] = math.floor(e[v, DELAY] / dt)
        lasts[0, v] = e[v, DELAY] / dt - whole[v]
        lasts[1, v] = 1.0 - lasts[0, v]
        servo_parts(e[v], dt, lasts[0, v], parts)
        for part in range(2):
            h, keep, most, trailing = parts[part]
            turning[part, 0, v], turning[part, 1, v] = max(e[v, SLOWNESS], 0.0) / h, 1.0 - keep
            turning[part, 2, v], turning[part, 3, v] = most, trailing
        first = command[min(max(-whole[v] - (lasts[0, v] > 0.0), 0), last)]
        taken[v] = play_after(past, first, e[v])  # the play is where the orders before it left it
        reached[v] = unequal(taken[v], e[v, ASYMMETRY])
    for k in range(command.shape[0]):
        for v in range(count):
            angle[v, k] = 0.0
        for part in range(2):
            turns = False
            for v in range(count):
                short[v], target[v] = 0.0, reached[v]
                if lasts[part, v] > 0.0:
                    order = command[min(max(k - whole[v] - 1 + part, 0), last)]
                    taken[v] = taken_up(order, taken[v], e[v, DEADBAND], e[v, BACKLASH])
                    target[v] = unequal(taken[v], e[v, ASYMMETRY])
                    turns = turns or target[v] != reached[v]
            if turns:
                _turn_together(turning[part], target, short, reached)
            for v in range(count):
                reached[v] = arrived(reached[v], target[v])
                if lasts[part, v] > 0.0:
                    angle[v, k] += lasts[part, v] * (target[v] - short[v] / SUBSTEPS)


@borrowing
def _turn_together(turning, target, short, reached):
    """Turn every servo for a part of a step, with constants (4, v); adds to the last two (v,)."""
    per_angle, made_up, most, trailing = turning
    for _ in range(SUBSTEPS):
        for v in range(target.shape[0]):
            lying, turn = substep(
                target[v] - reached[v], per_angle[v], made_up[v], most[v], trailing[v]
            )
            short[v] += lying
            reached[v] += turn


@borrowing
def _drive(elapsed, speed, e, k, revs, out):
    """What the propeller does to the vehicle in row k; fills the first inputs, but for controls."""
    thrust = thrust_of(revs, speed[k], e)
    factor = 1.0 - e[SAG] * elapsed[k] / SAG_PERIOD_S
    factor -= e[STEP] * share_fallen(elapsed[k], e[STEP_TIME], e[OVER])
    out[REVS], out[THRUST] = revs, factor
    out[DRIVE] = thrust * factor
    out[CHANGED] = share_fallen(elapsed[k], e[CHANGE_TIME], e[CHANGE_OVER])
    out[RACED], out[FLOW], out[REACH] = race_at_fin(out[DRIVE], speed[k], e)


@borrowing
def thrust_of(revs, speed, e):
    """Thrust of the healthy propeller."""
    return e[T_NN] * revs * abs(revs) + e[T_NU] * abs(revs) * speed


@borrowing
def felt_angle(angle, e):
    """Angle that acts: with its offset, as far as the flow follows it."""
    turned = angle + e[OFFSET]
    return turned / math.sqrt(1.0 + max(e[STALL], 0.0) * turned * turned)


@borrowing
def race_flow(race, speed):
    """Speed by which a race faster by `race` [m^2/s^2] in its square exceeds that of the vehicle.

    The square alone acts on the angle of the fin: a speed of a noisy log that it is divided by
    would lay the fin anew with every reading.
    """
    return math.sqrt(max(speed * speed + race, 0.0)) - abs(speed)


@borrowing
def race_at_fin(thrust, speed, e):
    """What the race adds at the fin: square of the flow, flow, and flow times the station."""
    race = e[RACE] * thrust
    flow = race_flow(race, speed)
    return race, flow, flow * e[X_FIN]


@kernel
def actuate_steps(past, raw, elapsed, speed, dt, e, places, steps, whole, slopes):
    """Inputs that act on the vehicle, and their slopes by differences, one effect at a time.

    Parameters
    ----------
    past : (p,) array
        Own control before that, as far as a play remembers it (`turning_points`) [rad].
    raw : (m + n, 3) array
        Own control, other control [rad], propeller rate [rev/s]; from m rows before the
        maneuver on, so that lags have settled.
    elapsed : (m + n,) array
        Time since the start of the trial [s].
    speed : (m + n,) array
        Measured surge velocity [m/s], for the thrust and the race.
    dt : float
    e : (19,) array
        Internal values in the order of `COMMAND`.
    places : (k,) int array
        Of the values to move.
    steps : (k, 2) array
        How far each is moved, and what the difference is divided by.
    whole : (m + n, 15) array
        Its first nine columns are filled: controls, propeller rate, thrust factor, thrust, part of
        the weight that has changed; of the race the square of the flow that it adds, the flow,
        and the flow times the station of the fin.
    slopes : (n, 9, k) array, filled
    """
    n, rows, count = slopes.shape[0], raw.shape[0], places.shape[0]
    lead, driven, fins = rows - n, np.empty(ACTED), 1
    slopes[:] = 0.0
    moved, fin_of = np.empty((1 + count, e.shape[0])), np.zeros(1 + count, np.int64)
    for v in range(1 + count):
        moved[v] = e
        if v > 0:
            moved[v, places[v - 1]] += steps[v - 1, 0]
            if places[v - 1] in SERVO:
                fin_of[v], fins = fins, fins + 1
    turning = np.empty((fins, e.shape[0]))
    for v in range(1 + count):
        turning[fin_of[v]] = moved[v]
    turning[0] = e  # with which the others leave the fin
    angle, rate, lagging = np.empty((fins, rows)), np.empty(rows), np.empty(rows)
    _turn_fins(past, raw[:, CONTROL].copy(), dt, turning, angle)
    command = raw[:, REVS].copy()
    lagged(command, e[MOTOR_LAG], dt, rate)
    for k in range(rows):
        whole[k, CONTROL], whole[k, OTHER] = felt_angle(angle[0, k], e), raw[k, OTHER]
        _drive(elapsed, speed, e, k, rate[k], whole[k])
    for v in range(1, 1 + count):
        steering, at_propeller = places[v - 1] in STEERING, places[v - 1] == MOTOR_LAG
        if at_propeller:
            lagged(command, moved[v, MOTOR_LAG], dt, lagging)
        for t in range(n):
            k = lead + t
            if steering:
                there = felt_angle(angle[fin_of[v], k], moved[v])
                slopes[t, CONTROL, v - 1] = (there - whole[k, CONTROL]) / steps[v - 1, 1]
            else:
                revs = lagging[k] if at_propeller else rate[k]
                _drive(elapsed, speed, moved[v], k, revs, driven)
                for i in range(REVS, ACTED):
                    slopes[t, i, v - 1] = (driven[i] - whole[k, i]) / steps[v - 1, 1]


def command_values(plane: Plane, parameters: tuple[str, ...], p: Array) -> Array:
    """Values in the order of `COMMAND` from a parameter vector; absent ones are zero."""
    return values_of(COMMANDS[plane], parameters, p)


def acting_inputs(
    raw: Array,
    elapsed: Array,
    speed: Array,
    roll: Array,
    pitch: Array,
    dt: float,
    e: Array,
    depth: Array | float = 0.0,
) -> Array:
    """Inputs (n, 15) of the equations of motion; see `actuate_steps`. No free force acts."""
    return acting_with_steps(raw, elapsed, speed, roll, pitch, dt, e, depth, 0, NOWHERE, NO_STEP)[0]


def acting_with_steps(
    raw: Array,
    elapsed: Array,
    speed: Array,
    roll: Array,
    pitch: Array,
    dt: float,
    e: Array,
    depth: Array | float,
    rows: int,
    places: Array,
    steps: Array,
    past: Array = NO_PAST,
) -> tuple[Array, Array]:
    """Inputs, and their slopes (rows, 9, k) in the last rows; see `actuate_steps`."""
    out, slopes = np.zeros((len(raw), N_INPUTS)), np.empty((rows, ACTED, len(places)))
    actuate_steps(past, raw, elapsed, speed, dt, e, places, steps, out, slopes)
    out[:, ROLL], out[:, PITCH], out[:, DEPTH] = roll, pitch, depth
    return out, slopes
