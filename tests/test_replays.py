"""The maneuvers behind the model of a run, as pooling predicts them again."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from auvident.engines.carried import internal_values
from auvident.pipeline.left_out_runs import with_own
from auvident.pipeline.pooling import pool_runs, with_small_effects
from auvident.pipeline.predict import find_model
from auvident.pipeline.replays import replay_behind
from auvident.schema.artifacts import IdentifiedModel

CURRENT = ("current.north_mps", "current.east_mps")


def of_run(run: Path) -> tuple[Path, IdentifiedModel]:
    """The model that a run is pooled by."""
    file, model = find_model(run)
    return file, with_small_effects(file, model)


def test_they_are_those_of_the_last_stage_with_the_readings_that_counted(demo: Path) -> None:
    file, model = of_run(demo)
    found = replay_behind(file, model)
    assert found is not None
    assert {r.id for r in found.records} == set(model.stages[-1].maneuvers)


def test_the_water_of_a_trial_is_told_beside_another_model(demo: Path) -> None:
    """Beside the trial's own it is what the trial has."""
    file, model = of_run(demo)
    found = replay_behind(file, model)
    assert found is not None
    told, own = found.own_beside(pool_runs([demo]).model), internal_values(model.effects)
    stds = np.sqrt(np.diag(np.array(model.covariance["matrix"])))
    for name in CURRENT:
        std = stds[model.covariance["symbols"].index(name)]
        assert told[name] == pytest.approx(own[name], abs=3.0 * std)
    rows = with_own(pool_runs([demo]).model, model, told).effects
    (current,) = (e for e in rows if e["id"] == "current")
    assert current["internal"] == {name: told[name] for name in CURRENT}


def test_without_its_ingested_trial_a_run_is_pooled_by_its_model(demo: Path) -> None:
    file, model = of_run(demo)
    (demo / "ingest" / "harbour_trial.parquet").unlink()
    assert replay_behind(file, model) is None
    (told,) = (f for f in pool_runs([demo]).model.findings if f.code == "pooled-by-model")
    assert told.where == "demo"


def test_a_model_outside_of_a_run_directory_has_none(demo: Path) -> None:
    file, model = of_run(demo)
    shutil.copy(file, "model.json")
    assert replay_behind(Path("model.json"), model) is None


def test_maneuvers_cut_anew_are_not_those_of_the_model(demo: Path) -> None:
    file, model = of_run(demo)
    maneuvers = demo / "segment" / "maneuvers.json"
    rows = json.loads(maneuvers.read_text())
    (first, *_) = (m for m in rows if m["id"] in model.stages[-1].maneuvers)
    first["t_end_s"] -= 5.0
    maneuvers.write_text(json.dumps(rows))
    assert replay_behind(file, model) is None


def test_readings_that_an_event_spoilt_are_left_out_again(demo: Path) -> None:
    """As `refine` left them out: else other readings count than the model was fitted to."""
    file, model = of_run(demo)
    whole = replay_behind(file, model)
    assert whole is not None
    record = whole.records[0]
    diagnosis = demo / "diagnose" / "diagnosis.json"
    tree = json.loads(diagnosis.read_text())
    event = {
        "id": "one_off_event",
        "family": "disturbance",
        "maneuver": record.id,
        "time_s": float(record.time_s[10]),
        "duration_s": 3.0,
        "parameters": [],
    }
    tree["effects"] = [*tree["effects"], event]
    diagnosis.write_text(json.dumps(tree))
    inside = (record.time_s >= record.time_s[10]) & (record.time_s <= record.time_s[10] + 3.0)
    lost = int(np.isfinite(record.measured[inside][:, :3]).sum())
    last = model.stages[-1].model_copy(update={"samples": model.stages[-1].samples - lost})
    fewer = model.model_copy(update={"stages": (*model.stages[:-1], last)})
    found = replay_behind(file, fewer)
    assert found is not None
    assert not np.isfinite(found.records[0].measured[inside]).any()
