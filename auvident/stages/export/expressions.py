"""The equations of motion as expressions that Python, MATLAB and C share."""

import re

from auvident.physics.terms import (
    CONSTANTS,
    EQUATIONS,
    PLANE_NAMES,
    POWERS,
    VARIABLES,
    Structure,
)
from auvident.schema.planes import BY_PLANE

# Valid in Python and in MATLAB alike; `abs` is `fabs` in C.
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
# names of the variables that belong to effects: of those after the propeller rate
OF_EFFECTS = {
    "thrust": "thrust_factor",
    "T": "thrust_n",
    "changed": "changed",
    "race": "race_m2ps2",
    "flow": "race_flow_mps",
    "reach": "race_reach_m2ps",
    "roll": "roll_rad",
    "pitch": "pitch_rad",
    "depth": "depth_m",
}


def identifier(symbol: str) -> str:
    """A coefficient's symbol as a name in a program: ``Y_v|v|`` -> ``Y_v_abs_v``."""
    plain = re.sub(r"\|(\w+)\|", r"_abs_\1_", symbol).rstrip("_")
    return re.sub(r"\W", "_", plain)


def parameter_name(symbol: str) -> str:
    """Name of a parameter of the equations: a coefficient, a constant, or one of an effect."""
    return CONSTANT_NAMES[symbol] if symbol in CONSTANTS else identifier(symbol)


def state_names(structure: Structure) -> tuple[str, ...]:
    """Names of the four states."""
    return tuple(state.symbol for state in BY_PLANE[structure.plane].states)


def variable_names(structure: Structure) -> dict[str, str]:
    """Name of each variable of the terms in a program."""
    names, angle = PLANE_NAMES[structure.plane], state_names(structure)[3]
    state = ("u", names["a"], names["b"], f"sin({angle})", f"cos({angle})")
    inputs = (*BY_PLANE[structure.plane].control_columns, "rate_rps")
    return dict(zip(VARIABLES, (*state, *inputs), strict=False)) | OF_EFFECTS


def used_variables(structure: Structure) -> set[str]:
    """Variables that stand in a term."""
    factors = structure.terms[:, 2:].reshape(-1, 2)
    return {VARIABLES[variable] for variable, power in factors if power >= 0}


def force_expressions(structure: Structure) -> list[str]:
    """Right-hand side of each equation, from the table of terms."""
    variables = variable_names(structure)
    forces: list[list[tuple[float, str]]] = [[] for _ in EQUATIONS]
    for row, weight in zip(structure.terms, structure.weights, strict=True):
        factors = [parameter_name(structure.parameters[row[1]])]
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
        elements[i][j].append((float(weight), parameter_name(structure.parameters[parameter])))
    return [[_sum(terms) for terms in row] for row in elements]


def _sum(terms: list[tuple[float, str]]) -> str:
    """Weighted terms as one expression."""
    text = "".join(f" {'-' if w < 0 else '+'} {_weight(abs(w))}{term}" for w, term in terms)
    if text.startswith(" - "):
        return f"-{text.removeprefix(' - ')}"
    return text.removeprefix(" + ") or "0.0"


def _weight(size: float) -> str:
    return "" if size == 1.0 else f"{size!r}*"
