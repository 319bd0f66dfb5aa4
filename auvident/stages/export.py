"""An identified model as text for other programs: data, or equations that stand alone."""

import json
import re
from collections.abc import Callable

from auvident.engines.carried import internal_values
from auvident.errors import UsageError
from auvident.physics.terms import (
    CONSTANTS,
    EQUATIONS,
    PLANE_NAMES,
    POWERS,
    VARIABLES,
    Structure,
    parameter_vector,
    structure_of,
)
from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.planes import PLANE_ROWS
from auvident.schema.quoting import comment, csv_cell, encodable, quoted

# Valid in Python and in MATLAB alike.
POWER_TEXT = {
    "x": "{0}",
    "|x|": "abs({0})",
    "x^2": "{0}*{0}",
    "x|x|": "{0}*abs({0})",
    "x^3": "{0}*{0}*{0}",
}
CONSTANT_NAMES = {
    "m": "mass",
    "m x_G": "mass_x_g",
    "I": "inertia",
    "W-B": "weight_less_buoyancy",
    "z_GW": "z_g_weight",
    "x_GW": "trim_moment",
}
INPUTS = {row.name: (*row.control_columns, "rate_rps") for row in PLANE_ROWS}
ANGLE = {row.name: row.states[3].symbol for row in PLANE_ROWS}
BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")  # of TOML; others stand in quotes
CSV_COLUMNS = (
    "symbol",
    "value",
    "std",
    "unit",
    "prime",
    "prior",
    "prior_std",
    "origin",
    "data_share",
)
# the one effect that the equation forms have room for
SLEW = ("rudder_rate_limit", "elevator_rate_limit")


def identifier(symbol: str) -> str:
    """A coefficient's symbol as a name in a program: ``Y_v|v|`` -> ``Y_v_abs_v``."""
    stem, bar, rest = symbol.partition("|")
    return f"{stem}_abs_{rest.rstrip('|')}" if bar else symbol


def export(model: IdentifiedModel, form: str) -> str:
    """The model in another form.

    Parameters
    ----------
    model : IdentifiedModel
    form : str
        A key of `FORMS`.

    Raises
    ------
    UsageError
        Unknown form, or effects in a form that has no room for them.
    """
    if form not in FORMS:
        raise UsageError(f"there is no format {form!r}", "--format", f"One of {', '.join(FORMS)}.")
    without = [str(e.get("id", "")) for e in model.effects if e.get("id") not in SLEW]
    if without and form in EQUATION_FORMS:
        names = ", ".join(without)
        raise UsageError(
            f"the effects {names} cannot be written as {form}",
            "--format",
            "Use json, or a model without them: identify/model.json, or a plan without nuisance "
            "parameters.",
        )
    return FORMS[form](model)


def _json(model: IdentifiedModel) -> str:
    return (
        encodable(json.dumps(model.model_dump(by_alias=True), indent=2, ensure_ascii=False)) + "\n"
    )


def _toml(model: IdentifiedModel) -> str:
    """A table that can stand in a vehicle file: the next identification starts from it."""
    lines = [f"# {_title(model, quoted)}", "# Dimensional SI values; valid in a vehicle file.", ""]
    if model.effects:
        names = comment(", ".join(str(effect.get("id", "")) for effect in model.effects))
        lines += [
            f"# Identified together with the effects {names}, which this format cannot hold.",
            "",
        ]
    lines.append("[coefficients]")
    for c in model.estimates:
        key = c.symbol if BARE_KEY.fullmatch(c.symbol) else f'"{quoted(c.symbol)}"'
        lines.append(f"{key} = {{ value = {c.value!r}, std = {c.std!r} }}  # {comment(c.unit)}")
    return "\n".join(lines) + "\n"


def _csv(model: IdentifiedModel) -> str:
    lines = [",".join(CSV_COLUMNS)]
    for c in model.estimates:
        lines.append(",".join(csv_cell(getattr(c, name, "")) for name in CSV_COLUMNS))
    return "\n".join(lines) + "\n"


def _title(model: IdentifiedModel, escaped: Callable[[str], str]) -> str:
    return f"{escaped(model.vehicle)}: model of the {model.plane} plane, identified by auvident."


def _parameters(model: IdentifiedModel) -> dict[str, float]:
    """Values by their name in a program."""
    structure = structure_of(model.plane)
    p = parameter_vector(model.plane, model.values(), model.rigid_body)
    names = [CONSTANT_NAMES.get(name, identifier(name)) for name in structure.parameters]
    return {name: float(value) for name, value in zip(names, p, strict=True)}


def _sum(terms: list[tuple[float, str]]) -> str:
    """Weighted terms as one expression."""
    text = "".join(f" {'-' if w < 0 else '+'} {_weight(abs(w))}{term}" for w, term in terms)
    if text.startswith(" - "):
        return f"-{text.removeprefix(' - ')}"
    return text.removeprefix(" + ") or "0.0"


def _weight(size: float) -> str:
    return "" if size == 1.0 else f"{size!r}*"


def _variables(structure: Structure) -> dict[str, str]:
    """Name of each variable of the terms in a program."""
    names = PLANE_NAMES[structure.plane]
    angle, (own, other, rate) = ANGLE[structure.plane], INPUTS[structure.plane]
    values = ("u", names["a"], names["b"], f"sin({angle})", f"cos({angle})", own, other, rate)
    return dict(zip(VARIABLES, values, strict=False))  # those after them belong to effects


def _name(structure: Structure, parameter: int) -> str:
    symbol = structure.parameters[parameter]
    return CONSTANT_NAMES[symbol] if symbol in CONSTANTS else identifier(symbol)


def force_expressions(structure: Structure) -> list[str]:
    """Right-hand side of each equation, from the table of terms."""
    variables = _variables(structure)
    forces: list[list[tuple[float, str]]] = [[] for _ in EQUATIONS]
    for row, weight in zip(structure.terms, structure.weights, strict=True):
        factors = [_name(structure, int(row[1]))]
        for variable, power in zip(row[2::2], row[3::2], strict=True):
            if power >= 0:
                text = variables[VARIABLES[variable]]
                factors.append(POWER_TEXT[POWERS[power]].format(text))
        forces[row[0]].append((float(weight), "*".join(factors)))
    return [_sum(terms) for terms in forces]


def mass_expressions(structure: Structure) -> list[list[str]]:
    """Elements of the 3x3 mass matrix."""
    size = range(len(EQUATIONS))
    elements: list[list[list[tuple[float, str]]]] = [[[] for _ in size] for _ in size]
    for (i, j, parameter), weight in zip(structure.mass, structure.mass_weights, strict=True):
        elements[i][j].append((float(weight), _name(structure, int(parameter))))
    return [[_sum(terms) for terms in row] for row in elements]


PYTHON = '''"""{title}

Self-contained: needs only Python. Units SI, angles in radians; x forward, y starboard, z down.
A positive rudder has its trailing edge to port (the bow turns to port), a positive elevator its
trailing edge down. `simulate` takes the first input as ordered, `derivative` and `step` the angle
of the fin itself; the propeller rate is in rev/s.
States: {states}. Inputs: {inputs}.
"""

from math import cos, inf, sin

SLEW_RADPS = {slew}  # fastest motion of the fin
{parameters}

MASS = (
{mass}
)


def derivative(state, inputs):
    """Time derivative of the state ({states})."""
    {states} = state
    {inputs} = inputs
    force = (
{forces}
    )
    (m00, m01, m02), (m10, m11, m12), (m20, m21, m22) = MASS
    f0, f1, f2 = force
    c0, c1, c2 = m11 * m22 - m12 * m21, m12 * m20 - m10 * m22, m10 * m21 - m11 * m20
    determinant = m00 * c0 + m01 * c1 + m02 * c2
    du = f0 * c0 + f1 * (m02 * m21 - m01 * m22) + f2 * (m01 * m12 - m02 * m11)
    da = f0 * c1 + f1 * (m00 * m22 - m02 * m20) + f2 * (m02 * m10 - m00 * m12)
    db = f0 * c2 + f1 * (m01 * m20 - m00 * m21) + f2 * (m00 * m11 - m01 * m10)
    return (du / determinant, da / determinant, db / determinant, {rate})


def step(state, inputs, dt_s):
    """State after one step of the classical Runge-Kutta method with constant inputs."""
    k1 = derivative(state, inputs)
    k2 = derivative([x + 0.5 * dt_s * k for x, k in zip(state, k1)], inputs)
    k3 = derivative([x + 0.5 * dt_s * k for x, k in zip(state, k2)], inputs)
    k4 = derivative([x + dt_s * k for x, k in zip(state, k3)], inputs)
    slopes = [a + 2.0 * b + 2.0 * c + d for a, b, c, d in zip(k1, k2, k3, k4)]
    return [x + dt_s / 6.0 * slope for x, slope in zip(state, slopes)]


def servo(fin, ordered, dt_s):
    """Mean angle of the fin over a step, from its angle at the start, and its angle at the end."""
    most, distance = SLEW_RADPS * dt_s, ordered - fin
    if abs(distance) <= most:
        return ordered - 0.5 * distance * abs(distance) / most, ordered
    turned = most if distance > 0.0 else -most
    return fin + 0.5 * turned, fin + turned


def simulate(state, inputs, dt_s, fin=None):
    """States at the start of every step: one row of inputs a step; fin: its angle at the start."""
    states, fin = [list(state)], inputs[0][0] if fin is None else fin
    for ordered, *others in inputs[:-1]:
        angle, fin = servo(fin, ordered, dt_s)
        states.append(step(states[-1], [angle, *others], dt_s))
    return states
'''

MATLAB = """function dx = auvident_model(x, inputs)
% {title}
% Units SI, angles in radians; x forward, y starboard, z down. A positive rudder has its trailing
% edge to port (the bow turns to port), a positive elevator its trailing edge down; fin angles are
% those of the fin itself, which moves at {slew} rad/s at most.
% x = [{states}], inputs = [{inputs}] (propeller rate in rev/s); dx is a column.
% Example: [t, x] = ode45(@(t, x) auvident_model(x, [0.1 0 14]), [0 60], [1.4 0 0 0]);
{parameters}
{unpack}
force = [{forces}];
mass_matrix = [{mass}];
dx = [mass_matrix \\ force; {rate}];
end
"""


def _python(model: IdentifiedModel) -> str:
    structure = structure_of(model.plane)
    names = PLANE_NAMES[model.plane]
    indent = " " * 8
    return PYTHON.format(
        title=_title(model, quoted),
        states=f"u, {names['a']}, {names['b']}, {ANGLE[model.plane]}",
        inputs=", ".join(INPUTS[model.plane]),
        parameters="\n".join(f"{k} = {v!r}" for k, v in _parameters(model).items()),
        mass="\n".join(f"    ({', '.join(row)})," for row in mass_expressions(structure)),
        forces="\n".join(f"{indent}{force}," for force in force_expressions(structure)),
        rate=names["b"],
        slew=_slew(model),
    )


def _slew(model: IdentifiedModel) -> str:
    """Fastest motion of the fin [rad/s] as a number of a program."""
    values = internal_values([e for e in model.effects if e.get("id") in SLEW])
    slowness = sum(values.values())
    return repr(1.0 / slowness) if slowness > 0.0 else "inf"


def _matlab(model: IdentifiedModel) -> str:
    structure = structure_of(model.plane)
    names = PLANE_NAMES[model.plane]
    states = ("u", names["a"], names["b"], ANGLE[model.plane])
    unpack = [f"{name} = x({i});" for i, name in enumerate(states, start=1)]
    unpack += [f"{name} = inputs({i});" for i, name in enumerate(INPUTS[model.plane], start=1)]
    return MATLAB.format(
        title=_title(model, comment),
        states=" ".join(states),
        inputs=" ".join(INPUTS[model.plane]),
        parameters="\n".join(f"{k} = {v!r};" for k, v in _parameters(model).items()),
        unpack="\n".join(unpack),
        forces="; ...\n    ".join(force_expressions(structure)),
        mass="; ...\n    ".join(", ".join(row) for row in mass_expressions(structure)),
        rate=names["b"],
        slew=_slew(model),
    )


FORMS: dict[str, Callable[[IdentifiedModel], str]] = {
    "json": _json,
    "toml": _toml,
    "csv": _csv,
    "python": _python,
    "matlab": _matlab,
}
EQUATION_FORMS = ("python", "matlab")
