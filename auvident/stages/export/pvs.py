"""The model as a vehicle class for PythonVehicleSimulator (Fossen)."""

import re
import textwrap
from collections.abc import Sequence

from auvident.physics import actuation as act
from auvident.physics.six_dof import SUBSTEPS
from auvident.physics.six_dof_terms import AXES, INPUTS, OF_RACE
from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.planes import BY_FIN, BY_PLANE
from auvident.schema.quoting import quoted
from auvident.stages.export.contents import (
    EARLY,
    acting_lines,
    contents_of,
    remarks_on_effects,
)
from auvident.stages.export.expressions import (
    CONSTANT_NAMES,
    POWER_TEXT,
    force_expressions,
    identifier,
    mass_expressions,
)
from auvident.stages.export.pvs_source import CLASS, FIN, HEAD, PLANAR, STEP, WHOLE
from auvident.stages.export.template import filled
from auvident.stages.export.whole import AnyModel, Term, Whole, whole_of

WIDTH = 98
PLACE = {"u": 0, "v": 1, "w": 2, "p": 3, "q": 4, "r": 5}
# what an input of the equations is called in `acting` of the class
ACTED = {
    "rudder_rad": "rudder",
    "elevator_rad": "elevator",
    "rate_rps": "rate",
    "thrust_factor": "factor",
    "thrust_n": "thrust",
    "changed": "weight",
    "race_m2ps2": "race",
    "race_flow_mps": "flow",
    "race_reach_m2ps": "reach",
    "roll_rad": "roll_angle",
    "pitch_rad": "pitch_angle",
    "depth_m": "down",
}
OF_INPUT = {
    "rudder": "rudder_rad",
    "elevator": "elevator_rad",
    "n": "rate_rps",
    "thrust": "thrust_factor",
    "T": "thrust_n",
    "changed": "changed",
} | {f"{name} {fin}": f"{name}_{fin}" for fin in BY_FIN for name in OF_RACE}
# what a variable of six degrees of freedom is called, and its expression where it is no state
NAMES = {
    "vw": ("across", ""),
    "qr": ("turning", ""),
    "sin": ("sine", ""),
    "side": ("side", ""),
    "cos": ("cosine", ""),
    "heading": ("heading", "math.atan2(2.0 * (b * c + a * d), 1.0 - 2.0 * (c * c + d * d))"),
    "heading sin": ("sin(heading)", ""),
    "heading cos": ("cos(heading)", ""),
    "roll": ("roll", "math.atan2(side, cosine)"),
    "pitch": ("pitch", "math.asin(min(max(sine, -1.0), 1.0))"),
    "depth": ("depth", ""),
}
FIN_ARGUMENTS = (
    ("delay", act.DELAY),
    ("deadband", act.DEADBAND),
    ("backlash", act.BACKLASH),
    ("asymmetry", act.ASYMMETRY),
    ("lag", act.LAG),
    ("offset", act.OFFSET),
    ("race", act.RACE),
    ("station", act.X_FIN),
)


def as_pvs(model: AnyModel) -> str:
    """The model as a module with a vehicle class."""
    whole = whole_of(model)
    parts, values = _planar(model) if isinstance(model, IdentifiedModel) else _whole(whole)
    values = _of_class(whole) | values
    late = {"title": "@title@", "vehicle": "@vehicle@"}
    text = "".join(filled(part, (), values | late) for part in (HEAD, *parts, FIN, CLASS))
    vehicle = quoted(model.vehicle)
    return filled(
        text,
        (),
        {"title": f"{vehicle}: {_kind(whole)}, {whole.made}.", "vehicle": vehicle},
    )


def left_out_of_pvs(whole: Whole) -> tuple[str, ...]:
    """What the class leaves out or has off, a line each."""
    early = [f"the {BY_PLANE[p].fin}" for p, e in whole.commands.items() if e[act.DELAY] < 0.0]
    told = (EARLY.format(" and ".join(early)),) if early else ()
    return (*remarks_on_effects(whole.effects), *told)


def _kind(whole: Whole) -> str:
    if len(whole.planes) > 1:
        return "model of six degrees of freedom"
    return f"model of the {whole.planes[0]} plane"


def _planar(model: IdentifiedModel) -> tuple[tuple[str, ...], dict[str, str]]:
    """Parts and values of a model of one plane."""
    contents = contents_of(model)
    row, u = BY_PLANE[model.plane], "u"
    _, a, b = row.velocities
    states = contents.states
    lateral, turning, angle = PLACE[a], PLACE[b], states[3]
    moved = {u: u, a: a, b: b}
    resting = [name for name in PLACE if name not in moved]
    return (PLANAR, STEP), {
        "about": f"A model of the {model.plane} plane: {', '.join(resting)} stay at rest.",
        "steps": "",
        "rest": ", ".join(resting),
        "parameters": _assignments(contents.parameters),
        "mass": "\n".join(f"    ({', '.join(r)})," for r in mass_expressions(contents.structure)),
        "states": ", ".join(states),
        "acting": ", ".join(contents.acting),
        "forces": "\n".join(_wrapped(f"{f},") for f in force_expressions(contents.structure)),
        "rate": b,
        "lateral": str(lateral),
        "turning": str(turning),
        "angle": angle,
        "u": u,
        "a": a,
        "b": b,
        "nu": f"[{', '.join(moved.get(name, '0.0') for name in PLACE)}]",
        "row": ", ".join(ACTED[name] for name in contents.acting),
        "raced": _raced(row.fin, OF_RACE),
    }


def _whole(whole: Whole) -> tuple[tuple[str, ...], dict[str, str]]:
    """Parts and values of a model of six degrees of freedom."""
    used = {v for term in whole.terms for v in term.variables}
    if {"heading sin", "heading cos"} & used:
        used |= {"heading"}
    needed = [(n, e) for v, (n, e) in NAMES.items() if v in used and e]
    parameters = dict.fromkeys([t.parameter for t in whole.terms] + ["T_nn", "T_nu"])
    values = {name_of(n): whole.values.get(n, 0.0) for n in parameters}
    return (WHOLE, STEP), {
        "about": "A model of six degrees of freedom.",
        "steps": f" in {SUBSTEPS} halves" if SUBSTEPS == 2 else "",
        "substeps": str(SUBSTEPS),
        "parameters": _assignments(values),
        "inverse": "\n".join(
            f"    ({', '.join(map(repr, row.tolist()))})," for row in whole.inverse
        ),
        "acting": ", ".join(OF_INPUT[name] for name in INPUTS),
        "variables": "\n".join(f"    {name} = {text}" for name, text in needed),
        "forces": "\n".join(_wrapped(f"{_force(whole, axis)},") for axis in AXES),
        "row": ", ".join(ACTED.get(OF_INPUT[name], OF_INPUT[name]) for name in INPUTS),
        "raced": "\n".join(_raced(fin, [f"{name}_{fin}" for name in OF_RACE]) for fin in BY_FIN),
    }


def _raced(fin: str, names: Sequence[str]) -> str:
    """The line that says what the race adds at a fin."""
    return f"        {', '.join(names)} = self.{fin}.raced(thrust, speed)"


def name_of(parameter: str) -> str:
    """Name of a parameter of six degrees of freedom in a program."""
    return CONSTANT_NAMES.get(parameter) or identifier(parameter)


def _force(whole: Whole, axis: str) -> str:
    """Right-hand side of one equation."""
    parts = [_term(whole, term) for term in whole.terms if term.axis == axis]
    return " + ".join(parts) or "0.0"


def _term(whole: Whole, term: Term) -> str:
    weight = term.value / whole.values[term.parameter]
    factors = [POWER_TEXT[power].format(_variable(v)) for v, power in term.factors]
    return "*".join([*([] if weight == 1.0 else [repr(weight)]), name_of(term.parameter), *factors])


def _variable(name: str) -> str:
    return OF_INPUT.get(name) or NAMES.get(name, (name, ""))[0]


def _of_class(whole: Whole) -> dict[str, str]:
    """What stands in the class."""
    e = whole.propeller
    vertical = whole.commands.get("vertical", e)
    return {
        "class_name": class_name_of(whole.vehicle),
        "length": repr(whole.length_m),
        "density": repr(whole.density_kgpm3),
        "rudder": _fin(whole, "rudder"),
        "elevator": _fin(whole, "elevator"),
        "lag": repr(float(e[act.MOTOR_LAG])),
        "sag": repr(float(e[act.SAG])),
        "fall": repr(float(e[act.STEP])),
        "fall_time": repr(float(e[act.STEP_TIME])),
        "fall_over": repr(float(e[act.OVER])),
        "change_time": repr(float(vertical[act.CHANGE_TIME])),
        "change_over": repr(float(vertical[act.CHANGE_OVER])),
        "rpm": repr(float(round(60.0 * whole.usual_rate_rps, -1))),
        "remarks": acting_lines(whole.effects, left_out_of_pvs(whole), "", WIDTH),
    }


def class_name_of(vehicle: str) -> str:
    """A Python identifier from the name of a vehicle, which nothing else in the module has."""
    plain = re.sub(r"[^A-Za-z0-9]+", "", vehicle)[:40]
    return f"Auv{plain}"


def _fin(whole: Whole, fin: str) -> str:
    """Arguments of a fin: those of its plane that are at work."""
    e = whole.commands.get(BY_FIN[fin].name)
    if e is None:
        return ""
    found = {name: float(e[place]) for name, place in FIN_ARGUMENTS if e[place]}
    if e[act.SLOWNESS] > 0.0:
        found["slew"] = 1.0 / float(e[act.SLOWNESS])
    if e[act.STALL] > 0.0:
        found["stall"] = float(e[act.STALL]) ** -0.5
    return ", ".join(f"{name}={value!r}" for name, value in found.items())


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
