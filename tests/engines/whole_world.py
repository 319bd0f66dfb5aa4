"""One model of the whole vehicle out of two sample trials, and its maneuvers in both planes."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import numpy.typing as npt

from auvident.engines.carried import Course, frame_of, predicted_course, vector_behind
from auvident.engines.prediction import readings
from auvident.engines.records import Record, record_of, sensor_matrix
from auvident.physics.six_dof import simulate_six_dof, system_of
from auvident.schema.artifacts import IdentifiedModel, Maneuver
from auvident.schema.combined import CombinedModel
from auvident.schema.planes import BY_PLANE, PLANES
from auvident.schema.trial import Trial
from auvident.stages.combine import STATE_COLUMNS, combine
from auvident.stages.combine.flight import _shown, flight_of, plane_frame, structure_behind_whole
from auvident.stages.ingest import ingest
from auvident.storage.logs import read_trials
from tests.engines.chain import SAMPLES, identified, sample

Array = npt.NDArray[Any]
VEHICLE = {"vehicle": "remus100"}
OTHER_MANEUVERS = (
    "straights",
    "turns",
    "zigzags_10",
    "zigzags_20",
    "vertical_zigzags",
    "depth_steps",
)
DIVES = 4
TRIALS = {"horizontal": "harbour_trial", "vertical": "dive_trial"}
EVERY = np.ones(4, dtype=bool)


def planar(plane: str) -> IdentifiedModel:
    """Model of a plane, of its sample trial."""
    return identified(TRIALS[plane], plane).model


@cache
def whole_vehicle() -> CombinedModel:
    """Both of them in one, with roll from their logs."""
    before = sample("harbour_trial")
    logs = [(sample(name).trials, sample(name).maneuvers) for name in TRIALS.values()]
    return combine([planar(plane) for plane in PLANES], before.vehicle, before.ase, logs=logs)


def held_out(plane: str) -> list[Maneuver]:
    """Maneuvers of the sample trial of a plane that validate."""
    found = sample(TRIALS[plane]).maneuvers.maneuvers
    return [m for m in found if m.role == "validate" and m.shows(plane)]


def errors(model: IdentifiedModel | CombinedModel, plane: str, trial: Trial, m: Maneuver) -> Array:
    """Predicted less measured readings (n, 4) of a plane, from the start and the inputs alone."""
    sensing = model.sensing if isinstance(model, IdentifiedModel) else model.sensing[plane]
    record = record_of(m, trial, plane, sensor_matrix(plane, sensing))
    if isinstance(model, IdentifiedModel):
        course = predicted_course(frame_of(model, 0.1), vector_behind(model), record, EVERY)
    else:
        course = flown(model, plane, trial, m, record)
    off = course.readings - record.measured
    if plane == "horizontal":
        off[:, 3] = (off[:, 3] + np.pi) % (2.0 * np.pi) - np.pi
    return off


def flown(model: CombinedModel, plane: str, trial: Trial, m: Maneuver, record: Record) -> Course:
    """What the sensors of a plane read in six degrees of freedom."""
    structure = structure_behind_whole(model)
    system = system_of(structure, structure.vector(model.values()))
    flight = flight_of(model, trial, system, m.t_start_s, m.t_end_s)
    shown = _shown(simulate_six_dof(flight.start, flight.inputs, 0.1, system), flight.heading_rad)
    columns = [STATE_COLUMNS.index(c) for c in BY_PLANE[plane].columns]
    states = shown[:, columns]
    return Course(readings(*plane_frame(model, plane, 0.1), record, states), states, states)


def rms(rows: list[Array]) -> Array:
    """Root mean square of all rows by column."""
    return np.sqrt(np.nanmean(np.vstack(rows) ** 2, axis=0))


def spiral_descents(folder: Path) -> tuple[Trial, list[tuple[float, float]]]:
    """A day of spiral descents of the vehicle of the harbour and the dive, written to a folder.

    The rudder is held while the elevators keep the steepest slope.

    Returns
    -------
    Trial
    list of tuple of float
        Beginning and end of each descent.
    """
    with _generator() as trial, patch.object(trial, "random_schedule", _day_of_descents):
        truth = trial.generate(
            {**VEHICLE, "name": "helix_trial", "seed": 7}, folder / "helix_trial"
        )
    return _ingested(folder / "helix_trial"), _spans(truth["maneuvers"])


def turning_dives(folder: Path) -> tuple[Trial, list[tuple[float, float]]]:
    """A day of turning dives of that vehicle: rudder and elevator laid at once; see above."""
    few = dict.fromkeys(OTHER_MANEUVERS, 0) | {"coupled": 2 * DIVES}
    case = {**VEHICLE, "name": "turning_trial", "seed": 11, "plane": "both", "schedule": few}
    with _generator() as trial:
        truth = trial.generate(case, folder / "turning_trial")
    dives = [m for m in truth["maneuvers"] if m["way"] == "turning dive"]
    return _ingested(folder / "turning_trial"), _spans(dives)


def _day_of_descents(
    plane: str, cruise_rpm: float, rng: np.random.Generator, options: dict
) -> tuple[Array, list]:
    from seatrial import helm, schedule

    p = schedule.Programme(cruise_rpm, 8.0, rng)
    schedule.surface_start(p)
    for rudder_deg in (-9.0, 12.0, -14.0, 10.0):
        schedule.transit(p)
        number = p.note(kind="coupled", rudder_deg=rudder_deg)
        fin = np.radians(rudder_deg)
        p.add(helm.FIXED, 30.0, p.speed(0.95, 1.1), 60.0, maneuver=number, fin=fin)
        p.add(helm.TRANSIT, 40.0, p.speed(1.0, 1.05))
    schedule.surface_end(p)
    return np.array(p.legs), p.notes


@contextmanager
def _generator() -> Iterator[Any]:
    """The module that sails a trial; it stands among the samples, not in a package."""
    with patch.object(sys, "path", [str(SAMPLES), *sys.path]):
        from seatrial import trial

        yield trial


def _ingested(folder: Path) -> Trial:
    (raw,) = read_trials([folder])
    return ingest(raw, sample("harbour_trial").vehicle)[0]


def _spans(maneuvers: list[dict]) -> list[tuple[float, float]]:
    return [(m["t_start_s"], m["t_end_s"]) for m in maneuvers]
