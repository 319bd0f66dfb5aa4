"""What the program wrote is no log: skipped where logs are searched, refused where it is named."""

import json
import shutil

import numpy as np
import pandas as pd
import pytest
from log_world import sensor_tables, wide_table, write_folder

from auvident.errors import InputError
from auvident.schema.logs import ColumnMap
from auvident.storage.artifacts import parquet_bytes
from auvident.storage.lock import LOCK_FILE
from auvident.storage.log_find import find_trials
from auvident.storage.log_inspect import inspect_log
from auvident.storage.log_own import left_out
from auvident.storage.logs import read_trials

COEFFICIENTS = (
    "symbol,value,std,unit,prime,prior,prior_std,origin,data_share\n"
    "X_uu,-2.9,0.6,kg/m,-0.003,-1.9,0.8,identified,0.45\n"
)


def artifact(path, table=None):
    """A table as the pipeline writes it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    table = wide_table() if table is None else table
    path.write_bytes(parquet_bytes(table, {"program": "auvident 0.1.0"}))
    return path


def run_directory(path, manifest: bool = True):
    """A run directory with an ingested trial and a simulation."""
    artifact(path / "ingest" / "a.parquet")
    artifact(path / "validate" / "simulation.parquet")
    if manifest:
        text = json.dumps({"schema": "auvident/run/1", "program": "auvident", "stages": {}})
        (path / "run.json").write_text(text)
    return path


def simulation() -> pd.DataFrame:
    """What ``auvident simulate`` writes: channels with their bands."""
    table = wide_table().assign(stretch=0, heading_rad=np.linspace(0, 1, len(wide_table())))
    for name in ("u_mps", "v_mps", "r_radps", "heading_rad"):
        table[f"{name}_low"], table[f"{name}_high"] = table[name] - 0.1, table[name] + 0.1
    return table


def names(*paths, column_map=None) -> list[str]:
    return [source.name for source in find_trials(paths, column_map)]


@pytest.mark.parametrize("manifest", [True, False])  # False: killed before it was written
def test_a_run_directory_among_the_logs_is_not_searched(tmp_path, manifest):
    write_folder(tmp_path / "b")
    wide_table().to_csv(tmp_path / "c.csv", index=False)
    run = run_directory(tmp_path / "run1", manifest)
    assert names(tmp_path) == ["c", "b"]
    found = (
        [run]
        if manifest
        else [run / "ingest" / "a.parquet", run / "validate" / "simulation.parquet"]
    )
    assert left_out([tmp_path]) == tuple(found)


def test_logs_below_a_run_directory_are_not_searched_either(tmp_path):
    write_folder(tmp_path / "b")
    write_folder(run_directory(tmp_path / "run1") / "more" / "d")
    assert names(tmp_path) == ["b"]


def test_patterns_of_a_map_do_not_reach_into_a_run_directory(tmp_path):
    for name in ("b", "run1"):
        write_folder(tmp_path / name)
    run_directory(tmp_path / "run1")
    tables = {s: {"file": f"**/{s}.csv"} for s in ("dvl", "gyro", "rudder", "rpm")}
    (source,) = find_trials([tmp_path], ColumnMap.model_validate(tables))
    assert {path.parent.name for path in source.files} == {"b"}


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_a_simulation_in_a_trial_folder_fills_no_channel(tmp_path, ending):
    folder = write_folder(tmp_path / "run", sensor_tables())
    place = folder / f"predicted.{ending}"
    if ending == "csv":
        simulation().to_csv(place, index=False)
    else:
        place.write_bytes(parquet_bytes(simulation(), {}))
    (trial,) = read_trials([folder])
    assert "attitude" not in trial.sensors
    assert left_out([folder]) == (place,)


def test_outputs_beside_a_wide_log_are_no_trials(tmp_path):
    wide_table().to_csv(tmp_path / "a.csv", index=False)
    simulation().to_csv(tmp_path / "sim.csv", index=False)
    (tmp_path / "model.csv").write_text(COEFFICIENTS)
    sweep = pd.DataFrame({"rudder.exposed_span_m": [0.1], "X_udot": [1.0], "N_uud": [2.0]})
    sweep.to_csv(tmp_path / "sweep.csv", index=False)
    assert names(tmp_path) == ["a"]
    assert {p.name for p in left_out([tmp_path])} == {"sim.csv", "model.csv", "sweep.csv"}


def refused(path, *words):
    with pytest.raises(InputError) as caught:
        find_trials([path])
    assert caught.value.exit_code == 3
    assert caught.value.remedy
    for word in (str(path), *words):
        assert word in str(caught.value)


def test_what_is_named_is_refused_with_what_it_is(tmp_path):
    run = run_directory(tmp_path / "run1")
    refused(run, "run directory of auvident", "--run")
    refused(run / "ingest", "only files that auvident wrote", "a.parquet")
    refused(run / "ingest" / "a.parquet", "table that auvident 0.1.0 wrote")
    simulation().to_csv(tmp_path / "sim.csv", index=False)
    refused(tmp_path / "sim.csv", "simulation that auvident wrote")
    (tmp_path / "model.csv").write_text(COEFFICIENTS)
    refused(tmp_path / "model.csv", "coefficients that auvident wrote")


def test_logs_kept_below_a_run_directory_may_be_named(tmp_path):
    log = write_folder(run_directory(tmp_path / "run1") / "logs" / "d")
    assert names(log) == ["d"]


def test_a_run_json_of_another_program_hides_nothing(tmp_path):
    write_folder(tmp_path / "all" / "b")
    for text in ('{"schema": "other/1"}', "[1]", "not json", ""):
        (tmp_path / "all" / "run.json").write_text(text)
        assert names(tmp_path) == ["b"]


def test_inspect_does_not_propose_artifacts(tmp_path):
    write_folder(tmp_path / "b")
    run_directory(tmp_path / "run1")
    files = [file.file for file in inspect_log(tmp_path).files]
    assert len(files) == 4
    shutil.rmtree(tmp_path / "b")
    assert inspect_log(tmp_path / "run1" / "ingest" / "a.parquet").files  # named: looked at


def test_a_folder_of_runs_is_not_what_was_meant_by_a_log_that_is_not_there(tmp_path):
    """The command makes its run directory, with a lock in it, before it looks for the log."""
    locked = tmp_path / "trial_1_run"
    locked.mkdir()
    (locked / LOCK_FILE).write_text("{}")
    run_directory(tmp_path / "trial_1_done")
    run_directory(tmp_path / "trial_1_all" / "first")
    with pytest.raises(InputError, match="no such file or folder") as caught:
        find_trials([tmp_path / "trial_1"])
    assert caught.value.remedy == "Check the path."
    write_folder(tmp_path / "trial_1_morning")
    with pytest.raises(InputError) as caught:
        find_trials([tmp_path / "trial_1"])
    assert caught.value.remedy == f"Did you mean {tmp_path / 'trial_1_morning'}?"
