"""The maneuvers behind the models of runs, as they were ingested: no log is read."""

from pathlib import Path
from typing import TYPE_CHECKING

from auvident.pipeline.given import Given
from auvident.pipeline.remedies import made_again, run_around
from auvident.storage.artifacts import read_json, read_model
from auvident.storage.run_directory import RunDirectory

if TYPE_CHECKING:
    from auvident.schema.artifacts import IdentifiedModel
    from auvident.stages.identify import Replay, Window

QUALITY, MANEUVERS = "ingest/quality.json", "segment/maneuvers.json"
DIAGNOSED = ("diagnose", "diagnosis.json")  # folder and file
EVENT = "one_off_event"


def replay_behind(file: Path, model: "IdentifiedModel") -> "Replay | None":
    """The maneuvers that a model was identified from; None where they are there no more.

    Parameters
    ----------
    file : Path
        Of the model, in a run directory.
    model : IdentifiedModel
        Of that run.
    """
    from auvident.stages.identify import replay_in

    run = run_around(file)
    if run is None or not model.stages or not _is_there(run):
        return None
    given = Given(RunDirectory(run))
    return replay_in(given.trials, given.maneuvers, model, _windows(run, file))


def _is_there(run: Path) -> bool:
    """Whether a run has its maneuvers and all of its ingested trials."""
    if not (run / QUALITY).exists() or not (run / MANEUVERS).exists():
        return False
    trials = read_json(run / QUALITY, made_again(run / QUALITY)).get("trials", ())
    return all((run / "ingest" / f"{t['trial']}.parquet").exists() for t in trials)


def _windows(run: Path, file: Path) -> "tuple[Window, ...]":
    """What a refined model left out of its readings: the events that the diagnosis found."""
    from auvident.schema.diagnosis import Diagnosis
    from auvident.stages.refine import windows_of

    stage, *plane, _ = file.resolve().relative_to(run.resolve()).parts
    folder, name = DIAGNOSED
    told = run.joinpath(folder, *plane, name)
    if stage != "refine" or not told.exists():
        return ()
    effects = read_json(told, made_again(told)).get("effects", ())
    if EVENT not in {effect.get("id") for effect in effects}:
        return ()
    return windows_of(read_model(told, Diagnosis, made_again(told)))
