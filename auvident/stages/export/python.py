"""The model as a Python module without dependencies."""

import re
import textwrap

from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.quoting import quoted
from auvident.stages.export.contents import (
    EXPRESSIONS,
    Contents,
    comment_lines,
    contents_of,
    title,
)
from auvident.stages.export.expressions import force_expressions, mass_expressions
from auvident.stages.export.template import assembled, filled

WIDTH = 98
FUNCTIONS = ("copysign", "cos", "exp", "floor", "sin", "sqrt")  # of the module math
HEAD = '''"""@title@

Self-contained: needs only Python. Units SI, angles in radians; x forward, y starboard, z down.
A positive rudder has its trailing edge to port (the bow turns to port), a positive elevator its
trailing edge down; the propeller rate is in rev/s.

States: @states@.
Inputs as ordered, one row a step, for `simulate`: @inputs@.
Inputs as they act, for `derivative` and `step`: @acting@.

@remarks@
"""

@math@@parameters@
[constants]
[constants]# servo and propeller
[constants]@actuation@
[water]
[water]# velocity of the water as identified (north, east@down@), for `over_ground`; off by default
[water]@water@

MASS = (
@mass@
)
'''
MOTION = '''

def derivative(state, inputs):
    """Time derivative of the state (@states@)."""
    @states@ = state
    @acting@ = inputs
    force = (
@forces@
    )
    (m00, m01, m02), (m10, m11, m12), (m20, m21, m22) = MASS
    f0, f1, f2 = force
    c0, c1, c2 = m11 * m22 - m12 * m21, m12 * m20 - m10 * m22, m10 * m21 - m11 * m20
    determinant = m00 * c0 + m01 * c1 + m02 * c2
    du = f0 * c0 + f1 * (m02 * m21 - m01 * m22) + f2 * (m01 * m12 - m02 * m11)
    da = f0 * c1 + f1 * (m00 * m22 - m02 * m20) + f2 * (m02 * m10 - m00 * m12)
    db = f0 * c2 + f1 * (m01 * m20 - m00 * m21) + f2 * (m00 * m11 - m01 * m10)
    return (du / determinant, da / determinant, db / determinant, @rate@)


def step(state, inputs, dt_s):
    """State after one step of the classical Runge-Kutta method with constant inputs."""
    k1 = derivative(state, inputs)
    k2 = derivative([x + 0.5 * dt_s * k for x, k in zip(state, k1)], inputs)
    k3 = derivative([x + 0.5 * dt_s * k for x, k in zip(state, k2)], inputs)
    k4 = derivative([x + dt_s * k for x, k in zip(state, k3)], inputs)
    slopes = [a + 2.0 * b + 2.0 * c + d for a, b, c, d in zip(k1, k2, k3, k4)]
    return [x + dt_s / 6.0 * slope for x, slope in zip(state, slopes)]
'''
DELAYED = '''

def delayed(orders, k, dt_s):
    """Orders of the fin that arrive in step k, the delay later, and how long each one stands."""
    whole = floor(FIN_DELAY_S / dt_s)
    share, last = FIN_DELAY_S / dt_s - whole, len(orders) - 1
    first, before = min(max(k - whole, 0), last), min(max(k - whole - 1, 0), last)
    now = (orders[first][0], (1.0 - share) * dt_s)
    return [(orders[before][0], share * dt_s), now] if share > 0.0 else [now]
'''
SERVO = '''

def servo(fin, ordered, dt_s):
    """Mean angle of the fin over a step, from its angle at the start, and its angle at the end."""
[!servo]    return ordered, ordered
[servo]    h, short = dt_s / 5, 0.0
[lag]    keep = exp(-h / SERVO_LAG_S)
[lag]    trailing = SERVO_LAG_S / h * (1.0 - keep)
[slew]    most = SERVO_SLEW_RADPS * h
[servo]    for _ in range(5):
[servo]        distance = ordered - fin
[slew]        turning = abs(distance) / most
[slew]        limited = 0.5 * turning if turning <= 1.0 else 1.0 - 0.5 / turning
[lag_alone]        short += trailing * distance
[lag_alone]        fin += distance * (1.0 - keep)
[slew_alone]        short += limited * distance
[slew_alone]        fin += min(max(distance, -most), most)
[both]        short += max(trailing, limited) * distance
[both]        fin += min(max(distance * (1.0 - keep), -most), most)
[servo]    return ordered - short / 5, fin
'''
PROPELLER = '''

def propeller(rate, ordered, dt_s):
    """Mean rate of the propeller over a step, from its rate at the start, and that at the end."""
    keep = exp(-dt_s / PROPELLER_LAG_S)
    mean = ordered + (rate - ordered) * (1.0 - keep) * PROPELLER_LAG_S / dt_s
    return mean, ordered + (rate - ordered) * keep
'''
FALLEN = '''

def fallen(since_s, over_s):
    """Part of a change that has been made; where only an interval is known, it rises along it."""
    since_s += 0.5 * over_s
    if since_s < 0.0:
        return 0.0
    return since_s / over_s if since_s < over_s else 1.0
'''
ACTUATORS = '''

def laid(fin, taken, order, lasts_s):
    """Mean angle of the fin while an order stands; then its angle and the order behind the play."""
[deadband]    order = copysign(max(abs(order) - FIN_DEADBAND_RAD, 0.0), order)
[backlash]    if taken is not None:
[backlash]        order = min(max(taken, order - FIN_BACKLASH_RAD), order + FIN_BACKLASH_RAD)
    taken = order
[asymmetry]    order *= 1.0 + FIN_ASYMMETRY if order > 0.0 else 1.0 - FIN_ASYMMETRY
    mean, fin = servo(order if fin is None else fin, order, lasts_s)
    return mean, fin, taken


def actuators(orders, dt_s, fin=None):
    """Mean angle of the fin and mean rate of the propeller over every step of the orders."""
[!motor]    moved, taken = [], None
[motor]    moved, taken, rate = [], None, orders[0][2]
    for k, row in enumerate(orders):
[!delay]        angle, fin, taken = laid(fin, taken, row[0], dt_s)
[delay]        angle, play = 0.0, taken
[delay]        for order, lasts_s in delayed(orders, k, dt_s):
[delay]            mean, fin, taken = laid(fin, play, order, lasts_s)
[delay]            angle, play = angle + lasts_s / dt_s * mean, taken if k > 0 else None
[!motor]        moved.append((angle, row[2]))
[motor]        mean, rate = propeller(rate, row[2], dt_s)
[motor]        moved.append((angle, mean))
    return moved
'''
ACTING = '''

def acting_inputs(inputs, dt_s, fin, before@names@):
    """Inputs as they act over every step: rows for `step`."""
    acting = []
    for k, (angle, rate) in enumerate(actuators([*before, *inputs], dt_s, fin)[len(before) :]):
[timed]        time_s = elapsed_s + k * dt_s
[factor]        factor = 1.0
[sag]        factor -= THRUST_SAG * time_s / 1000.0
[thrust_step]        factor -= THRUST_STEP * fallen(time_s - THRUST_STEP_TIME_S, THRUST_STEP_OVER_S)
[drive]        thrust = T_nn * rate * abs(rate) + T_nu * abs(rate) * speed_mps[k]
[drive_factor]        thrust *= factor
[offset]        angle += FIN_OFFSET_RAD
[stall]        angle /= sqrt(1.0 + (angle / FIN_STALL_RAD) ** 2)
[race]        race = RACE_M2PS2PN * thrust
[race]        flow = sqrt(max(speed_mps[k] ** 2 + race, 0.0)) - abs(speed_mps[k])
[changed]        weight = fallen(time_s - WEIGHT_CHANGE_TIME_S, WEIGHT_CHANGE_OVER_S)
        acting.append((@row@))
    return acting
'''
SIMULATE = '''

def simulate(state, inputs, dt_s, fin=None, before=()@defaults@):
    """States at the start of every step, as `auvident simulate` predicts them.

    inputs: one row (@inputs@) a step, as ordered.
    fin: angle of the servo at the start of the first row; by default what that row orders.
    before: rows of inputs before the start, which servo, delay and play remember; `auvident
    simulate` takes those of 20 s, as far as there are any, and before them, for a play, the
    angles at which the fin was turned back. `fin` is then the angle before them.
[timed]    elapsed_s: time of the first row since the start of the trial.
[drive]    speed_mps: surge velocity as logged, one a row, for the thrust that meets the fin; by
[drive]    default that of the start, as `auvident simulate` has it where no speed was logged.
[logged]    @logged@: as logged, one a row; by default zero.
    """
[series]    size = len(inputs)
[drive]    speed_mps = [state[0]] * size if speed_mps is None else speed_mps
@fill@
    states = [list(state)]
    for acting in acting_inputs(inputs, dt_s, fin, before@names@)[:-1]:
        states.append(step(states[-1], acting, dt_s))
    return states
'''
WATER = '''

[horizontal]def over_ground(state, north_mps=0.0, east_mps=0.0):
[horizontal]    """The state with the velocity of the water added: `over_ground(state, *WATER)`."""
[vertical]def over_ground(state, heading=0.0, north_mps=0.0, east_mps=0.0, down_mps=0.0):
[vertical]    """The state with that of the water added: `over_ground(state, heading, *WATER)`."""
    @states@ = state
[horizontal]    c, s = cos(heading), sin(heading)
[horizontal]    ahead, aside = north_mps * c + east_mps * s, east_mps * c - north_mps * s
[horizontal]    return [u + ahead, v + aside, r, heading]
[vertical]    c, s = cos(pitch), sin(pitch)
[vertical]    ahead = north_mps * cos(heading) + east_mps * sin(heading)
[vertical]    return [u + ahead * c - down_mps * s, w + ahead * s + down_mps * c, q, pitch]
'''
DRIFT = '''

def water(from_middle_s):
    """Velocity of the water (north, east) at a time from the middle of the trial, as identified."""
    early, late = min(from_middle_s, 0.0), max(from_middle_s, 0.0)
    north, east = DRIFT[0] * early + DRIFT[2] * late, DRIFT[1] * early + DRIFT[3] * late
    return WATER[0] + north, WATER[1] + east
'''
# feature without which a part is left out, and the part
PARTS = (
    ("", HEAD),
    ("", MOTION),
    ("delay", DELAYED),
    ("", SERVO),
    ("motor", PROPELLER),
    ("fallen", FALLEN),
    ("", ACTUATORS),
    ("", ACTING),
    ("", SIMULATE),
    ("water", WATER),
    ("drift", DRIFT),
)


def as_python(model: IdentifiedModel) -> str:
    """The model as a Python module without dependencies."""
    contents = contents_of(model)
    features = set(contents.features)
    features |= {"series"} if contents.logged else set()
    features |= {"logged"} if set(contents.logged) - {"speed_mps"} else set()
    template = assembled(PARTS, features)
    late = {"title": "@title@", "math": "@math@"}  # no name is read as a part
    body = filled(template, features, _values(contents) | late)
    used = [name for name in FUNCTIONS if re.search(rf"\b{name}\(", body)]
    needed = f"from math import {', '.join(used)}\n\n" if used else ""
    return filled(body, (), {"title": title(model, quoted), "math": needed})


def _values(contents: Contents) -> dict[str, str]:
    """What stands at the places of the template."""
    model, structure = contents.model, contents.structure
    names = (*(("elapsed_s",) if "timed" in contents.features else ()), *contents.logged)
    series = [name for name in contents.logged if name != "speed_mps"]
    fill = [f"    {n} = [0.0] * size if {n} is None else {n}" for n in series]
    return {
        "states": ", ".join(contents.states),
        "rate": contents.states[2],
        "inputs": ", ".join(contents.inputs),
        "acting": ", ".join(contents.acting),
        "remarks": comment_lines(model, "", WIDTH),
        "parameters": _assignments(contents.parameters),
        "actuation": _assignments(contents.actuation),
        "water": "\n".join(f"{name} = {value!r}" for name, value in contents.water.items()),
        "down": ", down" if model.plane == "vertical" else "",
        "mass": "\n".join(f"    ({', '.join(row)})," for row in mass_expressions(structure)),
        "forces": "\n".join(_wrapped(f"{force},") for force in force_expressions(structure)),
        "names": "".join(f", {name}" for name in names),
        "defaults": "".join(f", {n}={'0.0' if n == 'elapsed_s' else 'None'}" for n in names),
        "logged": ", ".join(series),
        "fill": "\n".join(fill),
        "row": ", ".join(_expression(name, contents) for name in contents.acting),
    }


def _expression(name: str, contents: Contents) -> str:
    """An acting input in the loop over the rows."""
    own, other, rate = contents.inputs
    at_work = {own: "angle", other: "inputs[k][1]", rate: "rate"} | EXPRESSIONS
    return at_work.get(name, f"{name}[k]")


def _wrapped(force: str) -> str:
    """A sum of many terms over several lines."""
    return textwrap.fill(
        force,
        WIDTH,
        initial_indent=" " * 8,
        subsequent_indent=" " * 12,
        break_on_hyphens=False,
        break_long_words=False,
    )


def _assignments(values: dict[str, float]) -> str:
    return "\n".join(f"{name} = {value!r}" for name, value in values.items())
