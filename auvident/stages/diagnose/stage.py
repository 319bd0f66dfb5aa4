"""Diagnosis: what the identified model does not explain, traced to the effect it lacks."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.engines.setup import Setup
from auvident.errors import NumericsError
from auvident.parallel import all_of
from auvident.schema.artifacts import IdentifiedModel, Maneuvers
from auvident.schema.diagnosis import Diagnosis
from auvident.schema.planes import Plane
from auvident.schema.trial import Columns, Trial
from auvident.schema.vehicle import Vehicle
from auvident.stages.diagnose.checks.events import Event
from auvident.stages.diagnose.checks.kinematics import (
    SensorCheck,
    heading_against_gyro,
    position_against_dvl,
)
from auvident.stages.diagnose.checks.vertical import (
    depth_against_dvl,
    pitch_against_gyro,
    position_in_dives,
)
from auvident.stages.diagnose.checks.waves import find_wave
from auvident.stages.diagnose.fit.case import Case, case_of, sizes_of, testable
from auvident.stages.diagnose.fit.fits import Fitted
from auvident.stages.diagnose.score.free_forces import FreeForce, free_forces
from auvident.stages.diagnose.select.candidates import Traced
from auvident.stages.diagnose.select.events_aside import (
    Pushes,
    headings_of,
    pieces_of,
    traced_without_events,
)
from auvident.stages.diagnose.select.instants import narrowed
from auvident.stages.diagnose.select.search import Search
from auvident.stages.diagnose.select.telling import Telling, untold
from auvident.stages.diagnose.verdict.document import diagnosis_of
from auvident.stages.diagnose.verdict.evidence import Evidence, mattering, remainders
from auvident.stages.diagnose.verdict.residuals import residual_table

Array = npt.NDArray[Any]
DVL_HEIGHT = "dvl_lever_arm.dz_m"
Progress = Callable[[str, float | None], None]


@dataclass(frozen=True)
class Diagnosed:
    """What `diagnose` returns: the verdict with its evidence, and the residuals."""

    diagnosis: Diagnosis
    residuals: Columns


def diagnose(
    trials: Sequence[Trial],
    maneuvers: Maneuvers,
    vehicle: Vehicle,
    setup: Setup,
    model: IdentifiedModel,
    *,
    told: Sequence[SensorCheck] = (),
    progress: Progress | None = None,
) -> Diagnosed:
    """Trace what a model leaves of the identifying maneuvers to the effects it lacks.

    Parameters
    ----------
    trials : sequence of Trial
        With the readings of held-out maneuvers blanked, so that they choose nothing.
    maneuvers : Maneuvers
    vehicle : Vehicle
    setup : Setup
        Of the identification.
    model : IdentifiedModel
    told : sequence of SensorCheck
        What was found of effects in the other plane (`told_by`).
    progress : callable, optional
        Called with a text and the share of what the text speaks of that is done, None where
        nobody knows.

    Raises
    ------
    NumericsError
        The model runs away in a maneuver.
    """
    tell = progress or untold
    tell("sensors held against each other", None)
    try:
        stated = (DVL_HEIGHT,) if vehicle.dvl.z_m is not None else ()
        case = case_of(setup, model, [*told, *CHECKS[model.plane](trials, vehicle)], stated)
        return _diagnosed(trials, maneuvers, case, model, tell)
    except np.linalg.LinAlgError as error:
        raise NumericsError(
            f"the fits of the residual are singular ({error})",
            remedy="Identify from more maneuvers, or set priors for the coefficients.",
        ) from None


def _diagnosed(
    trials: Sequence[Trial],
    maneuvers: Maneuvers,
    case: Case,
    model: IdentifiedModel,
    tell: Progress,
) -> Diagnosed:
    there, missing = testable(case.setup, case.records)
    candidates = tuple(e.id for e in there if not e.nuisance)
    pushes = Pushes(case, headings_of(case), model.length_m / sizes_of(case.records)[0])

    def wanting(fitted: Fitted) -> bool:
        return bool(mattering(remainders(case, fitted, model.length_m)))

    def trace(seen: Case, baseline: Fitted) -> Traced:
        return Search(seen, candidates, told=Telling(tell), wanting=wanting).trace(baseline)

    tell("residual of the model, one-off events", None)
    traced, events = traced_without_events(pushes, trace)
    traced = narrowed(traced, trials, maneuvers)
    tell("forces without a named cause", None)
    evidence, residuals = all_of(
        partial(_evidence, traced, candidates, pushes, events, missing),
        partial(residual_table, traced, maneuvers),
    )
    tell("verdict", None)
    return Diagnosed(diagnosis_of(evidence, model), residuals)


def _in_horizontal(trials: Sequence[Trial], vehicle: Vehicle) -> list[SensorCheck]:
    found = all_of(
        partial(heading_against_gyro, trials), partial(position_against_dvl, trials, vehicle.dvl)
    )
    return [check for check in found if check is not None]


def _in_vertical(trials: Sequence[Trial], vehicle: Vehicle) -> list[SensorCheck]:
    found = all_of(
        partial(pitch_against_gyro, trials),
        partial(depth_against_dvl, trials, vehicle),
        partial(position_in_dives, trials, vehicle.dvl),
    )
    return [check for check in found if check is not None]


# sensors held against each other, by plane
CHECKS: dict[Plane, Callable[[Sequence[Trial], Vehicle], list[SensorCheck]]] = {
    "horizontal": _in_horizontal,
    "vertical": _in_vertical,
}


def _evidence(
    traced: Traced,
    candidates: tuple[str, ...],
    pushes: Pushes,
    events: Sequence[Event],
    missing: Sequence[str],
) -> Evidence:
    case, final = traced.case, traced.final
    pieces = pieces_of(case, final.residuals, pushes.headings)
    free, rival, wave = all_of(
        partial(free_forces, case, final, traced.without),
        partial(rival_of, traced),
        partial(find_wave, pieces, plane=case.plane),
    )
    return Evidence(
        traced,
        candidates,
        tuple(events),
        wave=wave,
        free=tuple(free),
        rival=rival,
        missing=tuple(missing),
        least_push=pushes.smallest(final),
    )


def rival_of(traced: Traced) -> FreeForce | None:
    """The best free force in place of the last effect that was accepted and is claimed."""
    accepted = traced.claimed
    if not accepted:
        return None
    found = free_forces(traced.case, accepted[-1].before)
    return found[0] if found else None
