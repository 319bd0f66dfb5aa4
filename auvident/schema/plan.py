"""The plan of an identification: its stages in order, and the tuning factors of the method."""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from auvident.schema.artifacts import ManeuverKind
from auvident.schema.base import Declared
from auvident.schema.coefficients import unknown_names
from auvident.schema.effects import allowable

System = Literal["surge", "lateral", "coupled"]
# states of (u, a, b, angle) that a system estimates and measures; the others are given
ACTIVE: dict[System, tuple[bool, bool, bool]] = {
    "surge": (True, False, False),
    "lateral": (False, True, True),
    "coupled": (True, True, True),
}


class PlanStage(Declared):
    """``[[stage]]``: which coefficients are estimated, how, from which maneuvers.

    ``method`` is ``filter`` (the EKF or UKF) or ``output_error`` (maximum a posteriori fit of
    the free-running simulation); ``system`` says which states are estimated together: surge
    alone with the measured lateral states as inputs, lateral (yaw-sway or heave-pitch) alone
    with the measured u as input, or all coupled. ``passes`` runs it so many times in a row, each
    with the noise that the last one's result leaves. ``noise`` says what ``output_error`` takes a
    residual for: ``effective``, as the filter does, counts n samples that go together as one;
    ``coloured`` is sensor noise and a disturbance of seconds, as they are most likely.
    """

    name: str
    system: System
    method: Literal["filter", "output_error"] = "filter"
    noise: Literal["effective", "coloured"] = "effective"
    maneuvers: tuple[ManeuverKind, ...] = ("straight", "turn", "zigzag")
    free: tuple[str, ...]
    once: bool = False
    passes: Annotated[int, Field(ge=1, le=10)] = 1

    @model_validator(mode="after")
    def _names_are_known(self) -> Self:
        unknown = unknown_names(self.free)
        if unknown:
            raise ValueError(
                f"stage {self.name!r}: {unknown[0]!r} is neither a coefficient nor a group; "
                "see `auvident coefficients`"
            )
        return self


class Tuning(Declared):
    """Tuning factors of one coefficient.

    ``prior`` multiplies the prior standard deviation at the start of each stage; ``drift`` is
    the standard deviation added per square root of a second, in units of the prior standard
    deviation (theory 7.3, Q_theta).
    """

    prior: Annotated[float, Field(gt=0)] = 1.0
    drift: Annotated[float, Field(ge=0)] = 0.0


class Plan(Declared):
    """The whole plan file.

    Stages run in order, `cycles` times round (the spiral); those marked ``once`` run only in
    the last round. ``continues`` names a built-in plan whose stages go before those of this file
    and whose other keys hold where this file has none. ``start`` gives the factors on the prior
    values at which the estimation starts; with several, all stages run from each and the results
    are averaged (Abkowitz's over- and under-estimation). ``observer_time_s`` sets the process noise
    relative to the measurement noise: the filter trusts the model over about this time; with
    ``"likely"`` each pass takes the time, of a few, that makes its innovations most likely.
    ``nuisance`` names effects that are estimated along with the small standard deviation that the
    table has for every vehicle (no servo is infinitely fast); without any, the equations are those
    of the method alone. ``rudder_lag`` or ``elevator_lag``, either name, is the fin of the plane.
    """

    name: str
    description: str = ""
    continues: str | None = None
    cycles: Annotated[int, Field(ge=1, le=50)] = 1
    start: tuple[Annotated[float, Field(gt=0)], ...] = Field((1.0,), min_length=1)
    observer_time_s: Annotated[float, Field(gt=0)] | Literal["likely"] = 30.0
    nuisance: tuple[str, ...] = ()
    stage: tuple[PlanStage, ...] = Field(min_length=1)
    tuning: dict[str, Tuning] = {}

    @model_validator(mode="after")
    def _tuning_is_known(self) -> Self:
        unknown = unknown_names(self.tuning)
        if unknown:
            raise ValueError(f"[tuning] {unknown[0]!r} is neither a coefficient nor a group")
        return self

    @model_validator(mode="after")
    def _nuisances_are_known(self) -> Self:
        known = allowable()
        for name in self.nuisance:
            if name not in known:
                raise ValueError(
                    f"{name!r} cannot be a nuisance parameter of a plan; those that can are "
                    f"{', '.join(known)}"
                )
        return self

    def rounds(self) -> list[tuple[int, PlanStage]]:
        """Stages in the order they run, with the number of their cycle from 1."""
        return [
            (cycle, stage)
            for cycle in range(1, self.cycles + 1)
            for stage in self.stage
            if cycle == self.cycles or not stage.once
            for _ in range(stage.passes)
        ]
