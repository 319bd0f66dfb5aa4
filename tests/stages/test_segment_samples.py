"""The segment stage on the sample trials, on fresh ones from their generator, on KVLCC2."""

import json
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from segment_world import overlap

from auvident.schema.trial import Trial
from auvident.stages.ingest import ingest
from auvident.stages.segment import segment, segment_vertical
from auvident.storage.logs import read_trials
from auvident.storage.vehicle_file import load_vehicle

ROOT = Path(__file__).resolve().parents[2]
SAMPLES = ROOT / "sample_logs"
TRUTH = ROOT / "tests" / "truth"
KVLCC2 = SAMPLES / "kvlcc2"
KINDS = ("straight", "turn", "zigzag")


def ingested(folder: Path, vehicle: str) -> Trial:
    raw = read_trials([folder])[0]
    return ingest(raw, load_vehicle(SAMPLES / f"{vehicle}.toml"))[0]


def schedule(truth: dict, kinds=KINDS) -> list:
    return [
        (m["kind"], m["t_start_s"], m["t_end_s"]) for m in truth["maneuvers"] if m["kind"] in kinds
    ]


def wholes(maneuvers, kind: str) -> int:
    return len({m.features.get("whole", m.id) for m in maneuvers if m.kind == kind})


@pytest.mark.parametrize("name", ["harbour_trial", "bay_trial", "sound_trial"])
def test_sample_trials(name):
    truth = json.loads((TRUTH / f"{name}.json").read_text())
    result = segment([ingested(SAMPLES / name, truth["vehicle"])])
    for kind in KINDS:
        assert overlap(schedule(truth), result.maneuvers, kind) >= 0.9, kind
        assert wholes(result.maneuvers, kind) == sum(k == kind for k, _, _ in schedule(truth))
    held = {m.kind for m in result.maneuvers if m.role == "validate"}
    assert {"turn", "zigzag"} <= held


def test_dive_trial():
    truth = json.loads((TRUTH / "dive_trial.json").read_text())
    trial = ingested(SAMPLES / "dive_trial", truth["vehicle"])
    vertical = segment_vertical([trial]).maneuvers
    assert overlap(schedule(truth), vertical, "zigzag") >= 0.9
    steps = [m for m in vertical if m.features.get("maneuver") == "depth_step"]
    runs = tuple(m for m in vertical if m not in steps)
    assert overlap(schedule(truth), runs, "straight") >= 0.9
    for m in truth["maneuvers"]:
        if m["kind"] == "depth_step":
            assert any(s.t_start_s < m["t_end_s"] and m["t_start_s"] < s.t_end_s for s in steps)
    horizontal = segment([trial]).maneuvers
    assert not [m for m in horizontal if m.kind != "straight"]
    assert overlap(schedule(truth), horizontal, "straight") >= 0.9


@pytest.mark.parametrize(("vehicle", "seed"), [("remus100", 41), ("tern180", 42)])
def test_fresh_trials(vehicle, seed, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(str(SAMPLES))
    from seatrial.trial import generate

    recipe = {"name": "fresh", "vehicle": vehicle, "seed": seed, "spread": 0.2}
    truth = generate(recipe, tmp_path / "fresh")
    found = segment([ingested(tmp_path / "fresh", vehicle)]).maneuvers
    for kind in KINDS:
        assert overlap(schedule(truth), found, kind) >= 0.9, kind
    assert "seatrial" in sys.modules


def test_every_kvlcc2_file_is_one_zigzag():
    trials = []
    for path in sorted(KVLCC2.glob("*.parquet")):
        table = pd.read_parquet(path)
        table["rudder_rad"] *= -1  # of these files a positive rudder turns to starboard
        trials.append(Trial.from_table(path.stem, table.assign(record=0), 10.0))
    result = segment(trials)
    assert [m.kind for m in result.maneuvers] == ["zigzag"] * len(trials)
    for m, trial in zip(result.maneuvers, trials, strict=True):
        rudder, switch = (int(x) for x in m.trial.split("_")[2:4])
        t = trial.table["time_s"].to_numpy()
        half = np.abs(trial.table["rudder_rad"].to_numpy()) > np.radians(rudder / 2)
        first = t[np.argmax(half)]
        # half the angle at 16 deg/s, half a second of servo start
        assert first - rudder / 2 / 16 - 0.7 < m.t_start_s < first
        assert m.t_end_s == pytest.approx(t[-1], abs=0.5)  # the files end in mid-zigzag
        assert m.features["rudder_deg"] == pytest.approx(rudder, abs=0.2)
        # the rudder order was given at the nominal heading; the angle answers a little later
        assert switch - 0.5 < m.features["switch_deg"] < switch + 3
        assert m.features["first_side"] == ("port" if m.trial.endswith("_P") else "starboard")
    assert sum(m.role == "validate" for m in result.maneuvers) == 3
