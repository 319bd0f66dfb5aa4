"""How a maneuver begins: a straight run in balance, at a speed or a propeller rate."""

import math
from dataclasses import dataclass

from auvident.constants import USUAL_SPEED_MPS
from auvident.errors import InputError, NumericsError, UsageError
from auvident.physics.actuation import LAG, SLOWNESS, command_values
from auvident.physics.ase.motion import usual_rate_degps
from auvident.physics.ase.stability import speed_per_rate_m
from auvident.physics.fleet import Fleet
from auvident.physics.steady import SteadyRun, Unknown, steady_run
from auvident.physics.terms import symbol_in
from auvident.schema.planes import BY_PLANE
from auvident.stages.desk.models import DeskModel


@dataclass(frozen=True)
class Approach:
    """What was asked for: speed, propeller rate, rate of the fin; the speed where none was.

    With a speed alone the propeller turns as each model needs for it, with a rate alone each has
    the speed of its balance; with both the maneuver begins at the speed, out of balance.
    """

    speed_mps: float | None = None
    rpm: float | None = None
    rudder_rate_degps: float | None = None
    usual_speed_mps: float = USUAL_SPEED_MPS


@dataclass(frozen=True)
class Approached:
    """A fleet on its straight run.

    Attributes
    ----------
    fleet : Fleet
    run : SteadyRun
    side : float
        Angle of the fin over the order of a person: 1 where positive is to starboard, or up.
    servo : str
        For people: how fast the fin turns.
    """

    fleet: Fleet
    run: SteadyRun
    side: float
    servo: str


def begin(models: DeskModel, approach: Approach) -> Approached:
    """Put the models on a straight run.

    Raises
    ------
    UsageError
        A speed, a propeller rate or a rate of the fin that is none.
    InputError
        The model has no fin in its plane.
    NumericsError
        It can hold no straight run there.
    """
    _refuse_nonsense(approach)
    first = models.of_first()
    side = _side(models, first)  # without a fin no balance is found either, for another reason
    advance = speed_per_rate_m(first)
    speed = approach.speed_mps or approach.usual_speed_mps
    held = None if math.isfinite(advance) else speed
    if held is None and approach.speed_mps is None and approach.rpm is not None:
        speed = advance * approach.rpm / 60.0
    rate, servo = _fin_rate(models, approach, speed)
    fleet = Fleet(models.structure, models.vectors, held, rate)
    run = _run(fleet, approach, speed, speed / advance if held is None else 0.0)
    if not run.found[0]:
        raise _not_held(models, speed)
    return Approached(fleet, run, side, servo)


def _run(fleet: Fleet, approach: Approach, speed: float, rate_rps: float) -> SteadyRun:
    if fleet.held_speed_mps is not None:
        return steady_run(fleet, speed, 0.0, "neither")
    if approach.rpm is not None:
        unknown: Unknown = "speed" if approach.speed_mps is None else "neither"
        return steady_run(fleet, speed, approach.rpm / 60.0, unknown)
    return steady_run(fleet, speed, rate_rps, "rate")


def _refuse_nonsense(approach: Approach) -> None:
    for option, value in (
        ("--speed", approach.speed_mps),
        ("--rpm", approach.rpm),
        ("--rudder-rate", approach.rudder_rate_degps),
    ):
        if value is not None and not 0.0 < value < math.inf:
            raise UsageError(f"{value:g} is not positive", option, "Give a positive number.")


def _fin_rate(models: DeskModel, approach: Approach, speed: float) -> tuple[float | None, str]:
    """Rate [rad/s] in place of the model's own, and words."""
    asked = approach.rudder_rate_degps
    if asked is None:
        e = command_values(models.plane, models.structure.parameters, models.vectors[0])
        if e[SLOWNESS] > 0.0 or e[LAG] > 0.0:
            rate = f"{math.degrees(1.0 / e[SLOWNESS]):.3g} deg/s" if e[SLOWNESS] > 0.0 else ""
            lag = f"lag {e[LAG]:.2g} s" if e[LAG] > 0.0 else ""
            return None, f"{', '.join(t for t in (rate, lag) if t)} (from the model)"
        asked = usual_rate_degps(speed, models.length_m)
        return math.radians(asked), f"{asked:.3g} deg/s (typical)"
    return math.radians(asked), f"{asked:.3g} deg/s (as given)"


def _side(models: DeskModel, first: dict[str, float]) -> float:
    symbol = symbol_in(models.plane, "B_uud")
    if first[symbol] == 0.0:
        raise InputError(
            f"the model has no {BY_PLANE[models.plane].fin}: {symbol} is 0",
            models.name,
            "A maneuver needs a fin to steer with: add a [[fin]], or state the coefficient.",
        )
    return math.copysign(1.0, first[symbol])


def _not_held(models: DeskModel, speed: float) -> NumericsError:
    plane = models.plane
    why = "depth" if plane == "vertical" else "course"
    remedy = (
        "Give another --speed; at a low one the fins may not carry the weight in water: check "
        "mass_kg, buoyancy_n and z_g_m."
        if plane == "vertical"
        else "Give another --speed, or check the coefficients of drag and thrust."
    )
    return NumericsError(
        f"at {speed:.3g} m/s no fin angle below 45 deg holds the {why}",
        models.name,
        remedy,
    )
