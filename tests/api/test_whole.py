"""Six degrees of freedom: what the commands make and fly, as an object."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import auvident
from tests.command_line import SAMPLES, Called


def test_it_is_made_flown_and_read_again_as_by_the_commands(
    demo: Path, auvident: Callable[..., Called]
) -> None:
    import auvident as interface

    told = json.loads(auvident("combine", demo, "--output", "told.json", "--json").out)
    made = interface.combine(demo)
    values = {c["symbol"]: c["value"] for c in told["coefficients"]}
    assert made.coefficients.loc[list(values), "value"].to_dict() == pytest.approx(values)
    assert made.coefficients.loc["Y_uud", "source"] == "identified, horizontal"
    assert made.findings["code"].to_list() == [f["code"] for f in told["findings"]]
    read = interface.load_whole_model(made.save("made.json"))
    assert read.artifact == made.artifact and "horizontal identified" in repr(read)
    shown = ("--maneuver", "zigzag:10/10", "--samples", 0, "--json")
    figures = json.loads(auvident("simulate", "told.json", *shown).out)["figures"]
    flown = read.maneuver("zigzag:10/10", 0).figures["value"].to_dict()
    assert flown == pytest.approx({f["name"]: f["value"] for f in figures})
    auvident("export", "made.json", "--format", "uuv", "--output", "told.xacro")
    assert read.export("uuv", "mine.xacro").read_bytes() == Path("told.xacro").read_bytes()
    with pytest.raises(interface.UsageError, match="no form of a model of six degrees"):
        read.export("python")
    with pytest.raises(interface.InputError, match="load_whole_model"):
        interface.load_model("made.json")


def test_on_a_table_it_turns_as_the_model_of_its_plane(demo: Path) -> None:
    run, time = auvident.load_run(demo), np.arange(200) * 0.1
    table = pd.DataFrame({"time_s": time, "rudder_deg": -5.0, "rpm": 800.0, "elevator_deg": 0.0})
    whole = auvident.combine(demo).simulate(table, 0, speed_mps=1.4)
    plane = run.model.simulate(table, 0, speed_mps=1.4)
    assert len(whole) == len(plane) == len(table)
    assert whole["r_radps"].iloc[-1] == pytest.approx(plane["r_radps"].iloc[-1], rel=0.1)
    assert auvident.combine(demo).beyond(whole).empty
    fast = auvident.combine(demo).simulate(table, 0, speed_mps=4.0)
    assert auvident.combine(demo).beyond(fast).loc["u", "reaches"] > 2.0
    with pytest.raises(auvident.InputError, match="elevator_rad"):
        auvident.combine(demo).simulate(table.drop(columns="elevator_deg"))


def test_a_run_of_one_plane_has_none_and_a_vehicle_file_has(demo: Path) -> None:
    with pytest.raises(auvident.StageError, match=r"auvident\.combine\("):
        _ = auvident.load_run(demo).whole
    with pytest.raises(auvident.UsageError, match="nothing to combine"):
        auvident.combine([])
    for wrong in (demo, demo / "refine/model.json"):
        with pytest.raises(auvident.InputError, match="no model of six degrees of freedom"):
            auvident.load_whole_model(wrong)
    motion = auvident.load_run(demo).signals.drop(columns="rudder_rad")
    with pytest.raises(auvident.InputError, match="no column rudder_rad"):
        auvident.load_run(demo).model.beyond(motion)
    found = auvident.load_whole_model(SAMPLES / "remus100.toml")
    assert set(found.coefficients["source"]) <= {"geometry", "vehicle file"}
