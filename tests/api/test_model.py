"""A model of the interface: it moves as `auvident simulate` says, at once and step by step."""

import json
import pickle
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import auvident
from tests.command_line import Called

STATES = ["u_mps", "v_mps", "r_radps", "heading_rad"]
Call = Callable[..., Called]


@pytest.fixture(scope="module")
def run(completed: Path) -> auvident.Run:
    return auvident.load_run(completed / "runs/demo")


@pytest.fixture(scope="module")
def model(run: auvident.Run) -> auvident.Model:
    return run.model


def inputs(rudder: Callable[[Any], Any], **more: Any) -> pd.DataFrame:
    """A minute at 10 Hz, the propeller in steps."""
    time = np.arange(600) * 0.1
    rpm = np.where(time < 30.0, 700.0, 900.0)
    return pd.DataFrame({"time_s": time, "rudder_rad": rudder(time), "rpm": rpm, **more})


def helm(time: Any) -> Any:
    return np.where((time // 15.0) % 2 == 0, 0.17, -0.17)


# --- a whole simulation -------------------------------------------------------------------


def test_a_log_gives_what_the_command_prints(demo: Path, auvident: Call) -> None:
    import auvident as interface

    run = interface.load_run(demo)
    cut = run.signals.query("400.0 <= time_s < 430.0")
    cut[["time_s", "u_mps", "v_mps", "r_radps", "rudder_rad", "rpm"]].to_csv("cut.csv", index=False)
    told = auvident("simulate", demo, "--inputs", "cut.csv", "--samples", 5, "--json")
    assert told.code == 0, told.err
    made = run.model.simulate("cut.csv", 5)
    pd.testing.assert_frame_equal(made, pd.DataFrame(json.loads(told.out)["columns"]))


def test_signals_of_a_run_are_inputs_and_give_what_validation_predicted(run: auvident.Run) -> None:
    held = run.maneuvers[run.maneuvers["role"] == "validate"].iloc[0]
    told = run.prediction[run.prediction["maneuver"] == held.name]
    made = run.model.simulate(run.signals, 0, from_s=held["t_start_s"], to_s=held["t_end_s"])
    both = made.merge(told, on="time_s")
    assert len(both) == len(told) > 300
    for state in ("r_radps", "heading_rad"):  # of velocities the reading is that at the DVL
        np.testing.assert_allclose(both[state], both[f"{state}_simulated"], atol=1e-12)


def test_every_row_of_a_table_is_simulated_from_a_straight_run(model: auvident.Model) -> None:
    table = inputs(helm)
    made = model.simulate(table, draws=20)
    assert made["time_s"].to_list() == pytest.approx(table["time_s"].to_list())
    assert made.loc[0, STATES[1:]].to_list() == [0.0, 0.0, 0.0]
    assert made.loc[0, "u_mps"] == pytest.approx(made.loc[299, "u_mps"], rel=0.2)  # in balance
    turning = made.iloc[100]  # the rudder to port
    assert turning["r_radps_low"] < turning["r_radps"] < turning["r_radps_high"] < 0.0
    assert model.simulate(table, 0, speed_mps=0.7).loc[0, "u_mps"] == 0.7


def test_degrees_and_other_columns_do_no_harm(model: auvident.Model) -> None:
    table = inputs(helm)
    degrees = table.assign(rudder_deg=np.degrees(table["rudder_rad"]), note="a").drop(
        columns="rudder_rad"
    )
    a, b = model.simulate(table, 0), model.simulate(degrees, 0)
    np.testing.assert_allclose(a[STATES], b[STATES], atol=1e-12)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda t: t.drop(columns="rpm"), "no column rpm"),
        (lambda t: t.drop(columns="rudder_rad"), "no column rudder_rad"),
        (lambda t: t.assign(rpm="fast"), "rpm is not of numbers"),
        (lambda t: t.drop(index=300), "row 300 is at 30.1 s"),
        (lambda t: t.iloc[::-1], "not evenly spaced"),
        (lambda t: t.assign(time_s=np.nan), "not evenly spaced"),
        (lambda t: t.iloc[:3], "there are 3 rows"),
        (lambda t: t.assign(time_s=pd.to_datetime(t["time_s"], unit="s")), "time_s is of dates"),
    ],
)
def test_a_table_that_cannot_be_flown_says_why(change, said, model: auvident.Model) -> None:
    with pytest.raises(auvident.InputError, match=said):
        model.simulate(change(inputs(helm)))


# --- one step at a time -------------------------------------------------------------------


def test_a_simulation_step_by_step_is_the_same_as_at_once(model: auvident.Model) -> None:
    """With the servo of the model, its rate limit and its lags."""
    table = inputs(helm)
    whole = model.simulate(table, 0, speed_mps=1.5)
    first = table.iloc[0]
    flown = model.start(speed_mps=1.5, rudder_rad=first["rudder_rad"], rpm=first["rpm"])
    states, ways = [flown.state], [flown.way_m]
    for rudder, rpm in table[["rudder_rad", "rpm"]].to_numpy()[:-1]:
        states.append(flown.step(rudder, rpm))
        ways.append(flown.way_m)
    np.testing.assert_allclose(states, whole[STATES], atol=1e-12)
    np.testing.assert_allclose(ways, whole[["north_m", "east_m"]], atol=1e-9)
    assert flown.time_s == pytest.approx(59.9)


def test_a_step_is_that_of_the_exported_program(model: auvident.Model) -> None:
    """Generated code that stands alone, with constants of its own."""
    space: dict[str, Any] = {}
    exec(model.export("python"), space)
    state = np.array([1.3, -0.1, 0.2, 0.5])
    acting = (0.11, 0.0, 12.5)  # rudder, elevator, propeller rate
    told = space["step"](state.tolist(), acting, 0.1)
    mine = model.step(state, 0.11, 750.0, 0.1)
    np.testing.assert_allclose(mine, told, rtol=0.0, atol=1e-13)
    by_name = dict(zip(model.states, state, strict=True))
    np.testing.assert_array_equal(model.step(by_name, 0.11, 750.0, 0.1), mine)
    np.testing.assert_array_equal(model.step(pd.Series(by_name), 0.11, 750.0, 0.1), mine)


def test_a_step_mirrors(model: auvident.Model) -> None:
    """Port and starboard; a positive rudder turns to port."""
    port = model.step([1.5, 0.05, -0.1, 0.0], 0.2, 800.0, 0.1)
    starboard = model.step([1.5, -0.05, 0.1, 0.0], -0.2, 800.0, 0.1)
    np.testing.assert_allclose(port, starboard * [1.0, -1.0, -1.0, -1.0], atol=1e-14)
    assert model.step([1.5, 0.0, 0.0, 0.0], 0.2, 800.0, 0.1)[2] < 0.0


def test_states_that_are_none(model: auvident.Model) -> None:
    with pytest.raises(auvident.UsageError, match="u_mps, v_mps, r_radps, heading_rad"):
        model.step([1.0, 0.0], 0.0, 600.0, 0.1)
    with pytest.raises(auvident.UsageError, match="four numbers"):
        model.step({"u_mps": 1.0}, 0.0, 600.0, 0.1)
    with pytest.raises(auvident.NumericsError, match="diverges"):
        model.step([1.0, np.nan, 0.0, 0.0], 0.0, 600.0, 0.1)
    with pytest.raises(auvident.UsageError, match="Give one of them"):
        model.start([1.0, 0.0, 0.0, 0.0], speed_mps=1.0)
    with pytest.raises(auvident.UsageError, match="positive"):
        model.start(dt_s=0.0)


def test_a_model_goes_to_other_processes(model: auvident.Model) -> None:
    again = pickle.loads(pickle.dumps(model))
    state = [1.5, 0.0, 0.0, 0.0]
    np.testing.assert_array_equal(
        again.step(state, 0.1, 700.0, 0.1), model.step(state, 0.1, 700.0, 0.1)
    )


def test_a_motion_beyond_what_was_flown_says_by_what(model: auvident.Model) -> None:
    """The trial has 20 deg of rudder."""
    assert model.beyond(model.simulate(inputs(helm), 0)).empty
    far = model.beyond(model.simulate(inputs(lambda t: helm(t) * 3.0), 0)).loc["rudder"]
    assert far["unit"] == "rad" and far["reaches"] == pytest.approx(0.51)
    assert far["identified"] == pytest.approx(np.radians(20.0), abs=0.01)
    assert list(model.maneuver("turning-circle:30", 0).beyond.index[:1]) == ["rudder"]
    assert model.maneuver("zigzag:10/10", 0).beyond.empty


# --- maneuvers, exports, files ------------------------------------------------------------


def test_a_maneuver_is_that_of_the_command(demo: Path, auvident: Call) -> None:
    import auvident as interface

    told = json.loads(
        auvident("simulate", demo, "--maneuver", "zigzag:20/10", "--samples", 20, "--json").out
    )
    flown = interface.load_run(demo).model.maneuver("zigzag:20/10", 20)
    for row in told["figures"]:
        mine = flown.figures.loc[row["name"]]
        assert mine["unit"] == row["unit"]
        assert mine[["value", "low", "high"]].to_list() == [
            row[k] for k in ("value", "low", "high")
        ]
    assert flown.table["time_s"].to_list() == told["columns"]["time_s"]
    assert len(flown.plot()) == 6 and flown.plot()._repr_png_()


def test_a_maneuver_of_the_other_plane_or_of_none(model: auvident.Model) -> None:
    with pytest.raises(auvident.InputError, match="vertical"):
        model.maneuver("depth-step:5")
    with pytest.raises(auvident.UsageError, match="Did you mean zigzag"):
        model.maneuver("zigzack")


@pytest.mark.parametrize("wrong", [{"draws": -1}, {"seed": -1}])
def test_numbers_of_draws_that_are_none(wrong: dict, model: auvident.Model) -> None:
    """A maneuver took a negative number for none, and a negative seed ended as by a bug."""
    table = pd.DataFrame({"time_s": np.arange(20) * 0.1, "rudder_rad": 0.0, "rpm": 900.0})
    for call in (lambda: model.maneuver("zigzag", **wrong), lambda: model.simulate(table, **wrong)):
        with pytest.raises(auvident.UsageError, match="-1"):
            call()


def test_an_export_is_that_of_the_command(
    demo: Path,
    auvident: Call,
) -> None:
    import auvident as interface

    model = interface.load_model(demo)
    for form in ("json", "toml", "csv", "python", "matlab", "c"):
        shown = auvident("export", demo, "--format", form).out
        assert model.export(form).rstrip("\n") == shown.rstrip("\n")
        assert model.export(form, f"model.{form}").read_text() == model.export(form)
    assert Path("model.h").exists()
    again = interface.load_model("model.json")
    assert again.artifact == model.artifact and "REMUS 100" in repr(again)
    with pytest.raises(interface.UsageError, match="there is no format"):
        model.export("word")


@pytest.mark.parametrize("form", ["pvs", "gz", "uuv", "fmu"])
def test_an_export_to_a_simulator_is_that_of_the_command(
    demo: Path, auvident: Call, form: str
) -> None:
    import auvident as interface

    auvident("export", demo, "--format", form, "--plane", "horizontal", "--output", "told")
    told = Path("told").read_bytes()
    model = interface.load_model(demo)
    mine = model.export(form, "mine")
    if form == "fmu":
        with zipfile.ZipFile(mine) as made, zipfile.ZipFile("told") as shown:
            assert made.namelist() == shown.namelist()
        with pytest.raises(interface.UsageError, match="binary file"):
            model.export(form)
    else:
        assert mine.read_bytes() == told and model.export(form) == told.decode()


def test_a_model_without_a_file_is_exported_without_what_it_costs(model: auvident.Model) -> None:
    apart = auvident.Model(model.artifact)
    assert "held-out maneuvers" in model.export("gz")
    assert "told for a model in a run directory" in apart.export("gz")


def test_a_form_that_is_none_is_told_those_that_are(model: auvident.Model) -> None:
    forms = ("json", "python", "fmu", "pvs", "gz", "uuv")
    with pytest.raises(auvident.UsageError) as told:
        model.export("simulink")
    assert all(form in str(told.value) for form in forms)


def test_no_model_is_an_error(demo: Path) -> None:
    with pytest.raises(auvident.InputError, match="no such file"):
        auvident.load_model("nothing.json")
    with pytest.raises(auvident.StageError, match="vertical"):
        auvident.load_model(demo, plane="vertical")
