"""Diagnosis: what the identified model does not explain, traced to the effect it lacks."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from auvident.engines.setup import Setup
from auvident.errors import NumericsError
from auvident.schema.artifacts import IdentifiedModel, Maneuvers
from auvident.schema.diagnosis import Diagnosis
from auvident.schema.planes import Plane
from auvident.schema.trial import Trial
from auvident.schema.vehicle import Vehicle
from auvident.stages.diagnose.checks.events import Event, find_events, smallest_push
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
from auvident.stages.diagnose.checks.waves import Residual, find_wave
from auvident.stages.diagnose.fit.case import Case, case_of, sizes_of, testable
from auvident.stages.diagnose.fit.fits import Fitted
from auvident.stages.diagnose.score.free_forces import FreeForce, free_forces
from auvident.stages.diagnose.select.candidates import Traced
from auvident.stages.diagnose.select.instants import narrowed
from auvident.stages.diagnose.select.search import Search
from auvident.stages.diagnose.select.starts import baseline_of
from auvident.stages.diagnose.select.telling import Telling, untold
from auvident.stages.diagnose.verdict.document import diagnosis_of
from auvident.stages.diagnose.verdict.evidence import Evidence
from auvident.stages.diagnose.verdict.residuals import residual_table

Array = npt.NDArray[Any]
DVL_HEIGHT = "dvl_lever_arm.dz_m"
Progress = Callable[[str, float | None], None]


@dataclass(frozen=True)
class Diagnosed:
    """What `diagnose` returns: the verdict with its evidence, and the residuals."""

    diagnosis: Diagnosis
    residuals: pd.DataFrame


def diagnose(
    trials: Sequence[Trial],
    maneuvers: Maneuvers,
    vehicle: Vehicle,
    setup: Setup,
    model: IdentifiedModel,
    *,
    told: Sequence[SensorCheck] = (),
    seed: int = 0,
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
    seed : int
        Of sign flips and bootstrap.
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
        return _diagnosed(trials, maneuvers, case, model, seed, tell)
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
    seed: int,
    tell: Progress,
) -> Diagnosed:
    there, missing = testable(case.setup, case.records)
    candidates = tuple(e.id for e in there if not e.nuisance)
    search = Search(case, candidates, np.random.default_rng(seed), told=Telling(tell))
    headings = headings_of(case)
    tell("residual of the model, one-off events", None)
    hull_time_s = model.length_m / sizes_of(model, case.records)[0]
    baseline, events = _without_events(search, headings, hull_time_s)
    traced = narrowed(search.trace(baseline), trials, maneuvers)
    tell("forces without a named cause", None)
    evidence = _evidence(traced, search, headings, events, missing)
    evidence = replace(
        evidence, least_push=_least_push(search.case, baseline, headings, hull_time_s)
    )
    tell("verdict", None)
    return Diagnosed(diagnosis_of(evidence, model), residual_table(traced, maneuvers))


def _in_horizontal(trials: Sequence[Trial], vehicle: Vehicle) -> list[SensorCheck]:
    found = heading_against_gyro(trials), position_against_dvl(trials, vehicle.dvl)
    return [check for check in found if check is not None]


def _in_vertical(trials: Sequence[Trial], vehicle: Vehicle) -> list[SensorCheck]:
    found = (
        pitch_against_gyro(trials),
        depth_against_dvl(trials, vehicle),
        position_in_dives(trials, vehicle.dvl),
    )
    return [check for check in found if check is not None]


# sensors held against each other, by plane
CHECKS: dict[Plane, Callable[[Sequence[Trial], Vehicle], list[SensorCheck]]] = {
    "horizontal": _in_horizontal,
    "vertical": _in_vertical,
}


def headings_of(case: Case) -> dict[str, Array]:
    """Heading (n,) of each record; of the vertical plane as logged, zero where it is not."""
    found = {}
    for record in case.records:
        logged = record.source.heading if record.source is not None else None
        found[record.id] = record.given[:, 3] if logged is None else logged
    return found


def _without_events(
    search: Search, headings: Mapping[str, Array], hull_time_s: float
) -> tuple[Fitted, list[Event]]:
    """The fit without any effect, one-off events masked."""
    baseline = baseline_of(search.case)
    noise = search.case.setup.sensor_std[:3]
    pieces = pieces_of(search.case, baseline.residuals, headings)
    events = find_events(pieces, noise, search.case.plane, hull_time_s)
    if not events:
        return baseline, []
    search.case = search.case.masked(
        [(e.maneuver, e.time_s, e.time_s + e.duration_s) for e in events]
    )
    return baseline_of(search.case), events


def _least_push(
    case: Case, baseline: Fitted, headings: Mapping[str, Array], hull_time_s: float
) -> tuple[float, float] | None:
    pieces = pieces_of(case, baseline.residuals, headings)
    return smallest_push(pieces, case.setup.sensor_std[:3], hull_time_s)


def _evidence(
    traced: Traced,
    search: Search,
    headings: Mapping[str, Array],
    events: Sequence[Event],
    missing: Sequence[str],
) -> Evidence:
    case = traced.case
    wave = find_wave(pieces_of(case, traced.final.residuals, headings), plane=case.plane)
    free = free_forces(case, traced.final, traced.without)
    rival = rival_of(traced)
    return Evidence(
        traced, search.candidates, tuple(events), wave, tuple(free), rival, tuple(missing)
    )


def rival_of(traced: Traced) -> FreeForce | None:
    """The best free force in place of the last effect that was accepted."""
    accepted = [r for r in traced.rounds if r.accepted is not None]
    if not accepted:
        return None
    found = free_forces(traced.case, accepted[-1].before)
    return found[0] if found else None


def pieces_of(
    case: Case, residuals: Sequence[Any], headings: Mapping[str, Array]
) -> list[Residual]:
    """Residuals as the searches for waves and events take them."""
    return [
        Residual(r.id, r.time_s, r.error, record.given[:, 0], headings[r.id], record.given[:, 3])
        for r, record in zip(residuals, case.records, strict=True)
    ]
