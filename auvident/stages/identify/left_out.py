"""What the identifying maneuvers, left out in turn, say about the errors of a prediction."""

import math
from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from auvident.engines.falling import (
    HARDLY,
    PushesAlong,
    growth_of_push,
    hardly_keeps_course,
)
from auvident.engines.jackknife import LEAST_MANEUVERS
from auvident.engines.predictive import LeftOutCourse, errors_of, noise_of
from auvident.engines.setup import Setup
from auvident.physics.terms import Structure
from auvident.schema.artifacts import Finding, LeftOutError, LeftOutManeuver, LeftOutSummary
from auvident.schema.planes import BY_PLANE, Plane

Array = npt.NDArray[np.float64]

# What a hull keeps of itself, or does not, and what is left out of the question whether it does.
KEPT: dict[Plane, tuple[str, str]] = {
    "horizontal": ("course", ""),
    "vertical": ("pitch", ", its righting moment aside"),
}


def left_out_of(
    setup: Setup, courses: Mapping[str, LeftOutCourse | None], pushes: PushesAlong | None
) -> tuple[LeftOutSummary | None, list[Finding]]:
    """Errors of maneuvers left out in turn; None with fewer than `LEAST_MANEUVERS`."""
    if len(courses) < LEAST_MANEUVERS:
        return None, []
    good = [course for course in courses.values() if course is not None]
    lost = [name for name, course in courses.items() if course is None]
    plane = setup.structure.plane
    rows = sum(len(setup.records[name][1]) for name in lost)
    noise, falls = noise_of(setup.sensing, plane), pushes is not None
    error = errors_of(good, plane, noise, rows, falls) if good else {}
    found = LeftOutSummary(
        maneuvers=tuple(_maneuver(name, course) for name, course in courses.items()),
        spread=_spread(good),
        model_error=error,
        push=_by_state(pushes, plane) if pushes else {},
    )
    return found, [_lost(lost, len(courses))] if lost else []


def _by_state(pushes: PushesAlong, plane: Plane) -> dict[str, float]:
    """Pushes of the two states that are pushed."""
    states = [state.symbol for state in BY_PLANE[plane].states[1:3]]
    return dict(zip(states, pushes.std[1:3].tolist(), strict=True))


def _maneuver(name: str, course: LeftOutCourse | None) -> LeftOutManeuver:
    channels = {}
    for channel, error in (course.error if course else {}).items():
        seen = error[np.isfinite(error)]
        if seen.size:
            rmse = float(np.sqrt(np.mean(seen**2)))
            channels[channel] = LeftOutError(rmse=rmse, samples=seen.size)
    return LeftOutManeuver(id=name, channels=channels)


def _spread(courses: list[LeftOutCourse]) -> dict[str, float]:
    """Standard deviation of what was measured, all maneuvers together; of a track both ways."""
    found = {}
    for channel in courses[0].measured if courses else ():
        values = np.concatenate([_measured(course, channel) for course in courses])
        if len(values):
            found[channel] = float(np.sqrt(np.sum(np.var(values, axis=0))))
    return found


def _measured(course: LeftOutCourse, channel: str) -> Array:
    """Readings (m, k) of a channel."""
    values = course.measured[channel]
    values = values.reshape(len(values), -1)
    return values[np.isfinite(values).all(axis=1)]


def course_findings(structure: Structure, p: Array, length_m: float) -> list[Finding]:
    """What is to be known of a model that hardly keeps its course, see `engines.falling`."""
    if not hardly_keeps_course(structure, p, length_m):
        return []
    growth = growth_of_push(structure, p, length_m)
    share = 100.0 * math.expm1(growth)
    push = f"grows by {share:.0f} %" if share >= 0.0 else f"dies away by only {-share:.0f} %"
    keeps, aside = KEPT[structure.plane]
    return [
        Finding(
            code="hardly-keeps-course",
            where=keeps,
            value=growth,
            threshold=-HARDLY,
            message=f"the identified hull hardly keeps its {keeps}{aside}: steering straight "
            f"ahead, a push {push} with each hull length, so that a prediction from the logged "
            "angles may turn to the side that the vehicle did not",
            remedy="The band, where there is one, reaches both sides: trust it rather than the "
            "line in its middle (least in straight runs), and errors at horizons of 5 and 20 s "
            "rather than those of whole maneuvers. Larger tail fins stabilise.",
        )
    ]


def _lost(names: list[str], count: int) -> Finding:
    return Finding(
        code="left-out-ran-away",
        where=", ".join(names),
        value=float(len(names)),
        message=f"the prediction of {len(names)} of {count} maneuvers diverges when each is left "
        "out of the fit, so their errors are not in the cross-validation",
        remedy="The other maneuvers do not show what these do: add one like them.",
    )
