"""What a program of a model holds: its equations, what acts on its inputs, what is left out."""

import math
import sys
import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from auvident.engines.carried import structure_behind, vector_behind
from auvident.errors import UsageError
from auvident.physics import actuation as act
from auvident.physics.sensing import DRIFT_PERIOD_S, READING, reading_values
from auvident.physics.terms import Structure
from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.effects import BY_ID
from auvident.schema.planes import BY_PLANE, Plane
from auvident.schema.quoting import clipped
from auvident.stages.export.expressions import (
    OF_EFFECTS,
    parameter_name,
    state_names,
    used_variables,
)


def _plain(value: float) -> float:
    return value


def _inverse(value: float) -> float:
    return 1.0 / value if value > 0.0 else math.inf


def _inverse_root(value: float) -> float:
    return value**-0.5 if value > 0.0 else math.inf


# feature of a template, constant in the program, place in `physics.actuation.COMMAND`, its value
ACTUATION: tuple[tuple[str, str, int, Callable[[float], float]], ...] = (
    ("delay", "FIN_DELAY_S", act.DELAY, _plain),
    ("deadband", "FIN_DEADBAND_RAD", act.DEADBAND, _plain),
    ("backlash", "FIN_BACKLASH_RAD", act.BACKLASH, _plain),
    ("asymmetry", "FIN_ASYMMETRY", act.ASYMMETRY, _plain),
    ("lag", "SERVO_LAG_S", act.LAG, _plain),
    ("slew", "SERVO_SLEW_RADPS", act.SLOWNESS, _inverse),
    ("offset", "FIN_OFFSET_RAD", act.OFFSET, _plain),
    ("stall", "FIN_STALL_RAD", act.STALL, _inverse_root),
    ("race", "RACE_M2PS2PN", act.RACE, _plain),
    ("race", "FIN_STATION_M", act.X_FIN, _plain),
    ("motor", "PROPELLER_LAG_S", act.MOTOR_LAG, _plain),
    ("sag", "THRUST_SAG", act.SAG, _plain),
    ("thrust_step", "THRUST_STEP", act.STEP, _plain),
    ("thrust_step", "THRUST_STEP_TIME_S", act.STEP_TIME, _plain),
    ("thrust_step", "THRUST_STEP_OVER_S", act.OVER, _plain),
    ("changed", "WEIGHT_CHANGE_TIME_S", act.CHANGE_TIME, _plain),
    ("changed", "WEIGHT_CHANGE_OVER_S", act.CHANGE_OVER, _plain),
)
# of an acting input, its expression in a program where it is not its own series
EXPRESSIONS = {
    "thrust_factor": "factor",
    "thrust_n": "thrust",
    "changed": "weight",
    "race_m2ps2": "race",
    "race_flow_mps": "flow",
    "race_reach_m2ps": "FIN_STATION_M * flow",
}
EARLY = "Left out, as nothing acts before it is ordered: the negative delay of {}."
LAGS = ("lag", "motor")  # act above zero alone
OVER_GROUND = ("current.north_mps", "current.east_mps")
WATER: dict[Plane, tuple[str, ...]] = {
    "horizontal": OVER_GROUND,
    "vertical": (*OVER_GROUND, "vertical_current.down_mps"),
}
WATER_DRIFT = tuple(name for name in READING if name.startswith("current_drift."))
IN_MOTION = ("input", "force")  # effects that move the vehicle enter there
LOGGED = ("roll_rad", "pitch_rad", "depth_m")


@dataclass(frozen=True)
class Contents:
    """What a program of a model holds.

    Attributes
    ----------
    model : IdentifiedModel
    structure : Structure
    parameters : mapping
        Value of every parameter of the equations, by its name in a program.
    actuation : mapping
        Value of every constant of servo and propeller that is at work.
    water : mapping
        Velocity of the water and its changes as identified, where the model has a current.
    features : frozenset of str
        What of the templates the model needs.
    acting : tuple of str
        Inputs of the equations as they act.
    logged : tuple of str
        Series that the simulation takes beside the inputs.
    """

    model: IdentifiedModel
    structure: Structure
    parameters: dict[str, float]
    actuation: dict[str, float]
    water: dict[str, tuple[float, ...]]
    features: frozenset[str]
    acting: tuple[str, ...]
    logged: tuple[str, ...]

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the states."""
        return state_names(self.structure)

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs as ordered."""
        return self.acting[:3]


def contents_of(model: IdentifiedModel) -> Contents:
    """What a program of a model holds.

    Raises
    ------
    UsageError
        An effect that the program does not know, or a value that is no number.
    """
    refuse_unfit(model)
    structure, p = structure_behind(model), vector_behind(model)
    e = act.command_values(model.plane, structure.parameters, p)
    used = used_variables(structure)
    features, actuation = _actuation(list(e), used)
    features = features | _derived(features, used) | {model.plane}
    water = _water(model, structure, list(reading_values(structure.parameters, p)))
    of_effects = tuple(name for variable, name in OF_EFFECTS.items() if variable in used)
    at_work = {*structure.terms[:, 1], *structure.mass[:, 2]}
    return Contents(
        model,
        structure,
        {
            parameter_name(name): float(p[i])
            for i, name in enumerate(structure.parameters)
            if i in at_work
        },
        actuation,
        water,
        features | {name.lower() for name in water},
        (*BY_PLANE[model.plane].control_columns, "rate_rps", *of_effects),
        (
            *(("speed_mps",) if "drive" in features else ()),
            *(name for name in LOGGED if name in of_effects),
        ),
    )


def refuse_unfit(model: IdentifiedModel) -> None:
    """Refuse a model that is no program.

    Raises
    ------
    UsageError
        An effect that the program does not know, or a value that is no number.
    """
    refuse_unknown([str(e.get("id", "")) for e in model.effects])
    found: dict[str, Any] = model.values() | model.rigid_body.model_dump()
    for effect in model.effects:
        internal = effect.get("internal")
        found |= internal if isinstance(internal, dict) else {str(effect["id"]): internal}
    refuse_damaged(found)


def refuse_unknown(ids: Sequence[str]) -> None:
    """Refuse effects that this version does not know."""
    unknown = [name for name in ids if name not in BY_ID]
    if unknown:
        raise UsageError(
            f"the effects {clipped(', '.join(unknown))} are unknown to this version",
            "--format",
            "Use json, or the version of auvident that identified the model.",
        )


def refuse_damaged(found: Mapping[str, Any]) -> None:
    """Refuse a value that is no number, which would be no program."""
    for name, value in found.items():
        if not isinstance(value, (int, float)) or not abs(value) <= sys.float_info.max:
            raise UsageError(
                f"{clipped(str(name))} is not a finite number",
                "--format",
                "Use json, or identify the model again.",
            )


def _actuation(e: list[float], used: set[str]) -> tuple[frozenset[str], dict[str, float]]:
    """Features at work, and the constants that they need."""
    found = {
        feature
        for feature, _, place, value in ACTUATION
        if (e[place] > 0.0 if feature in LAGS else e[place] != 0.0)
        and math.isfinite(value(e[place]))
    }
    found -= set() if e[act.STEP] else {"thrust_step"}
    for name in ("changed", "race"):
        found = found | {name} if name in used else found - {name}
    constants = {
        name: float(value(e[place]))
        for feature, name, place, value in ACTUATION
        if feature in found
    }
    return frozenset(found), constants


def _derived(at_work: frozenset[str], used: set[str]) -> frozenset[str]:
    """Features that follow from those at work and from the variables of the terms."""
    servo, both = at_work & {"lag", "slew"}, {"lag", "slew"} <= at_work
    drive, factor = "race" in at_work or "T" in used, "thrust" in used
    rows = {
        "servo": servo,
        "both": both,
        "lag_alone": "lag" in at_work and not both,
        "slew_alone": "slew" in at_work and not both,
        "drive": drive,
        "factor": factor,
        "drive_factor": drive and factor,
        "fallen": at_work & {"thrust_step", "changed"},
        "timed": at_work & {"sag", "thrust_step", "changed"},
        "constants": at_work,
    }
    return frozenset(name for name, holds in rows.items() if holds)


def _water(
    model: IdentifiedModel, structure: Structure, e: list[float]
) -> dict[str, tuple[float, ...]]:
    """Velocity of the water and, where it drifts, its rates; nothing without a current."""
    values = dict(zip(READING, e, strict=True))
    carried = {effect for effect in structure.effects if _is_water(effect)}
    if not carried:
        return {}
    found = {"WATER": tuple(float(values[name]) for name in WATER[model.plane])}
    if "current_drift" in carried:
        found["DRIFT"] = tuple(float(values[name]) / DRIFT_PERIOD_S for name in WATER_DRIFT)
    return found


def _is_water(effect: str) -> bool:
    row = BY_ID[effect]
    return row.family == "environment" and row.enters == "reading"


def title(model: IdentifiedModel, escaped: Callable[[str], str]) -> str:
    """One line that says what this is."""
    return f"{escaped(model.vehicle)}: model of the {model.plane} plane, identified by auvident."


def remarks(model: IdentifiedModel) -> tuple[str, ...]:
    """What of a model a program leaves out or has off, a line each."""
    ids = [str(effect.get("id", "")) for effect in model.effects]
    refuse_unknown(ids)
    return remarks_on_effects(ids)


def remarks_on_effects(ids: Sequence[str]) -> tuple[str, ...]:
    """What of these effects a program leaves out or has off, a line each."""
    water = [name for name in ids if _is_water(name)]
    sensors = [name for name in ids if BY_ID[name].enters == "reading" and name not in water]
    events = [name for name in ids if BY_ID[name].enters == "disturbance"]
    lines = (
        (sensors, "Left out, as sensors do not move the vehicle: {}."),
        (events, "Left out, as it belongs to one trial: {}."),
        (
            water,
            "Off by default: {}. States are through the water, until its velocity is given.",
        ),
    )
    return tuple(text.format(", ".join(names)) for names, text in lines if names)


def comment_lines(model: IdentifiedModel, mark: str, width: int) -> str:
    """Effects that act, and what is left out, as lines of a comment."""
    ids = [str(effect["id"]) for effect in model.effects]
    return acting_lines(ids, remarks_on_effects(ids), mark, width)


def acting_lines(ids: Sequence[str], left_out: Sequence[str], mark: str, width: int) -> str:
    """Which of these effects act, and lines of what is left out, as lines of a comment."""
    acting = ", ".join(name for name in ids if BY_ID[name].enters in IN_MOTION) or "none"
    lines = (f"Effects that act: {acting}.", *left_out)
    wrapped = (textwrap.fill(line, width) for line in lines)
    return "\n".join(f"{mark}{part}" for line in wrapped for part in line.splitlines())
