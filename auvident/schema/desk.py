"""Standard maneuvers that a model is flown through on the desk, each a row, and what comes out."""

import difflib
from dataclasses import dataclass
from typing import Literal

from pydantic import Field

from auvident.errors import UsageError
from auvident.schema.artifacts import Extrapolation, Finding
from auvident.schema.base import Artifact
from auvident.schema.planes import Plane

ModelSource = Literal["identified", "estimated", "given"]


@dataclass(frozen=True)
class DeskParameter:
    """A number behind the colon of a maneuver.

    Attributes
    ----------
    name, unit : str
    default : float
    least, most : float
        Bounds of its size.
    signed : bool
        Whether a minus says to which side; else it is positive.
    """

    name: str
    unit: str
    default: float
    least: float
    most: float
    signed: bool = False


@dataclass(frozen=True)
class DeskManeuver:
    """Declaration of a maneuver.

    Attributes
    ----------
    name : str
    plane : str
    parameters : tuple of DeskParameter
        In the order in which they stand behind the colon, a slash between them.
    steered, ends : str
        For people: what the fin does, and when it is over.
    figures : tuple of str
        What comes out, in the order in which it is told; a name that ends in ``*`` stands for all
        that begin so.
    """

    name: str
    plane: Plane
    parameters: tuple[DeskParameter, ...]
    steered: str
    ends: str
    figures: tuple[str, ...]

    @property
    def form(self) -> str:
        """How it is written, e.g. ``zigzag:RUDDER/HEADING``."""
        names = "/".join(p.name.split("_")[0].upper() for p in self.parameters)
        return f"{self.name}:{names}"

    @property
    def usual(self) -> str:
        """It with the defaults, e.g. ``zigzag:10/10``."""
        return self.written([p.default for p in self.parameters])

    def written(self, values: list[float]) -> str:
        """It with some values."""
        return f"{self.name}:{'/'.join(f'{v:g}' for v in values)}"


_SWINGS = (
    "overshoot_*",
    "time_to_second_execute_s",
    "initial_turning_time_s",
    "initial_turning_distance_m",
    "time_to_check_yaw_s",
    "reach_s",
    "period_s",
)
_STEERING = ("nomoto_gain_ps", "nomoto_time_s", "stability_index")
MANEUVERS: tuple[DeskManeuver, ...] = (
    DeskManeuver(
        "turning-circle",
        "horizontal",
        (DeskParameter("rudder", "deg", 15.0, 0.1, 45.0, signed=True),),
        "rudder laid to one angle and held (positive: to starboard)",
        "after a turn of 540 deg",
        (
            "advance_m",
            "transfer_m",
            "tactical_diameter_m",
            "steady_diameter_m",
            "time_to_90_s",
            "time_to_180_s",
            "steady_r_degps",
            "steady_speed_mps",
            "speed_loss",
            "steady_drift_deg",
            *_STEERING,
        ),
    ),
    DeskManeuver(
        "zigzag",
        "horizontal",
        (
            DeskParameter("rudder", "deg", 10.0, 0.1, 45.0, signed=True),
            DeskParameter("heading", "deg", 10.0, 0.1, 90.0),
        ),
        "rudder to one side (positive: first to starboard), reversed at each heading change",
        "after 5 executes",
        (*_SWINGS, "zigzag_gain_ps", "zigzag_time_s", *_STEERING),
    ),
    DeskManeuver(
        "spiral",
        "horizontal",
        (DeskParameter("rudder", "deg", 25.0, 5.0, 45.0),),
        "Dieudonné spiral: rudder from starboard in steps to port and back, a steady turn at each",
        "after the last step",
        ("loop_height_degps", "loop_width_deg", "steady_r_degps", *_STEERING),
    ),
    DeskManeuver(
        "pull-out",
        "horizontal",
        (DeskParameter("rudder", "deg", 15.0, 0.1, 45.0),),
        "a steady turn to starboard, rudder amidships, the same to port",
        "when the second rate has settled",
        (
            "residual_starboard_degps",
            "residual_port_degps",
            "residual_difference_degps",
            "steady_starboard_degps",
            "steady_port_degps",
            *_STEERING,
        ),
    ),
    DeskManeuver(
        "depth-step",
        "vertical",
        (DeskParameter("depth", "m", 5.0, 0.01, 1000.0, signed=True),),
        "an autopilot goes to another depth (positive: deeper)",
        "when the depth has been held within 5 % of the step for 10 hull lengths",
        (
            "rise_time_s",
            "settling_time_s",
            "depth_overshoot_m",
            "depth_overshoot_share",
            "depth_error_m",
            "greatest_pitch_deg",
            "greatest_elevator_deg",
            "trim_elevator_deg",
            "trim_pitch_deg",
            "stability_index",
        ),
    ),
    DeskManeuver(
        "vertical-zigzag",
        "vertical",
        (
            DeskParameter("elevator", "deg", 10.0, 0.1, 45.0, signed=True),
            DeskParameter("pitch", "deg", 5.0, 0.1, 45.0),
        ),
        "elevator to one side (positive: first bow up), reversed at each change of pitch",
        "after 5 executes",
        (
            *_SWINGS,
            "depth_overshoot_*",
            "trim_elevator_deg",
            "trim_pitch_deg",
            "stability_index",
        ),
    ),
)
BY_MANEUVER = {row.name: row for row in MANEUVERS}


@dataclass(frozen=True)
class DeskOrder:
    """A maneuver with its numbers."""

    row: DeskManeuver
    values: tuple[float, ...]

    @property
    def text(self) -> str:
        """It as it is written on the command line."""
        return self.row.written(list(self.values))

    @property
    def parameters(self) -> dict[str, float]:
        """Its numbers by name and unit."""
        pairs = zip(self.row.parameters, self.values, strict=True)
        return {f"{p.name}_{p.unit}": value for p, value in pairs}


def desk_order(text: str) -> DeskOrder:
    """``zigzag:10/10`` -> the row of the zigzag with 10 and 10.

    Raises
    ------
    UsageError
        No such maneuver, or numbers that it cannot take.
    """
    name, colon, rest = text.strip().partition(":")
    row = BY_MANEUVER.get(name)
    if row is None:
        close = difflib.get_close_matches(name, BY_MANEUVER, n=1)
        meant = f"Did you mean {close[0]}? " if close else ""
        known = ", ".join(r.usual for r in MANEUVERS)
        raise UsageError(f"there is no maneuver {name!r}", "--maneuver", f"{meant}Known: {known}.")
    parts = rest.split("/") if colon else []
    if len(parts) > len(row.parameters):
        raise _wrong(text, row, f"it takes {len(row.parameters)} of them at most")
    values = [p.default for p in row.parameters]
    for i, part in enumerate(parts):
        values[i] = _value(text, row, row.parameters[i], part)
    return DeskOrder(row, tuple(values))


def _value(text: str, row: DeskManeuver, parameter: DeskParameter, part: str) -> float:
    try:
        value = float(part)
    except ValueError:
        raise _wrong(text, row, f"{part!r} is not a number") from None
    if not parameter.least <= abs(value) <= parameter.most:  # nor a NaN
        size = f"{parameter.least:g} to {parameter.most:g} {parameter.unit}"
        raise _wrong(text, row, f"{parameter.name} must be {size}, not {part}")
    if value < 0.0 and not parameter.signed:
        raise _wrong(text, row, f"{parameter.name} takes no sign")
    return value


def _wrong(text: str, row: DeskManeuver, why: str) -> UsageError:
    return UsageError(
        f"{text!r} cannot be flown: {why}", "--maneuver", f"For example --maneuver {row.usual}."
    )


class DeskFigure(Artifact):
    """A figure with its 90 % interval; ``share`` of the drawn models come to it."""

    name: str
    value: float | None
    low: float | None = None
    high: float | None = None
    unit: str
    share: float | None = None


class DeskCurve(Artifact):
    """Figures along something: the rate by the rudder of a spiral, the trim by the speed.

    ``columns`` are the names of the figures of each row, ``along`` what they go along.
    """

    name: str
    along: str
    unit: str
    at: tuple[float, ...]
    figures: tuple[tuple[DeskFigure, ...], ...]


class DeskResult(Artifact):
    """What ``auvident simulate --maneuver`` prints.

    ``source`` says where the model is from: identified, estimated from geometry, or with given
    coefficients (``given`` names them); ``extrapolation`` where the motion leaves the range that it
    was identified from. ``columns`` are those of the table of the motion.
    """

    schema_: str = Field(default="auvident/desk/1", alias="schema")
    vehicle: str
    plane: Plane
    maneuver: str
    parameters: dict[str, float]
    model: str
    source: ModelSource
    given: tuple[str, ...] = ()
    length_m: float
    speed_mps: float
    rpm: float | None
    speed_is_held: bool = False
    servo: str
    models_drawn: int
    models_lost: int = 0
    figures: tuple[DeskFigure, ...]
    curves: tuple[DeskCurve, ...] = ()
    extrapolation: dict[str, Extrapolation] = {}
    findings: tuple[Finding, ...] = ()
    columns: dict[str, tuple[float | None, ...]] = {}


class StandardManeuvers(Artifact):
    """``validate/standard.json``; ``refine/standard.json`` is that of the model it ends with.

    Turning circle and zigzags as ITTC and IMO ask for them, flown with the model and models drawn
    beside it; ``greatest_laid_deg`` is the angle that the fin was laid to in the maneuvers that
    identify. ``findings`` names those that the model cannot fly.
    """

    schema_: str = Field(default="auvident/standard/1", alias="schema")
    vehicle: str
    plane: Plane
    greatest_laid_deg: float
    maneuvers: tuple[DeskResult, ...] = ()
    findings: tuple[Finding, ...] = ()
