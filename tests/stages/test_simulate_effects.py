"""Simulation of a model with effects: each acts where the table of effects says."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from auvident.engines.carried import structure_behind, vector_behind
from auvident.physics.virtual import steady_approach
from auvident.pipeline.given import Given
from auvident.pipeline.inputs import trial_of
from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.trial import Trial
from auvident.stages.simulate import simulate, steady_speed, unread_starts
from auvident.storage.run_directory import RunDirectory
from tests import loop_world

WINDOW = (1373.0, 1448.0)  # the last zigzag
STATES = ["u_mps", "v_mps", "r_radps", "heading_rad"]


@pytest.fixture(scope="module")
def given(completed: Path) -> Given:
    return Given(RunDirectory(completed / "runs/demo"))


def with_effects(model: IdentifiedModel, **effects: dict[str, float]) -> IdentifiedModel:
    """A model with effects of these sizes, as an engineer reads them, beside its nuisances."""
    added = loop_world.model_effects(effects)
    return model.model_copy(update={"effects": (*model.effects, *added)})


def run(model: IdentifiedModel, trial: Trial, **options: Any) -> pd.DataFrame:
    options = {"window_s": WINDOW, "samples": 0, "rng": np.random.default_rng(0)} | options
    return simulate(model, trial, **options)


def changed(trial: Trial, **columns: Any) -> Trial:
    return Trial.from_table(trial.name, trial.table.assign(**columns), trial.rate_hz)


def test_an_offset_of_the_rudder_is_a_rudder_laid_by_so_much(given: Given) -> None:
    trial = given.trials[0]
    laid = changed(trial, rudder_rad=trial.table["rudder_rad"] + np.radians(2.0))
    expected = run(given.model, laid)
    found = run(with_effects(given.model, rudder_offset={"offset_deg": 2.0}), trial)
    np.testing.assert_allclose(found[STATES], expected[STATES], atol=1e-12)
    # the inputs shown are those of the log
    pd.testing.assert_series_equal(found["rudder_rad"], run(given.model, trial)["rudder_rad"])
    assert not np.allclose(found["r_radps"], run(given.model, trial)["r_radps"], atol=0.01)


def test_models_of_a_hull_that_may_fall_are_pushed_and_its_prediction_is_not(given: Given) -> None:
    trial, left = given.trials[0], given.model.left_out
    assert left is not None
    pushed = left.model_copy(update={"push": {"v": 0.02, "r": 0.02}})
    usual, found = (
        run(given.model.model_copy(update={"left_out": told}), trial, samples=20)
        for told in (left, pushed)
    )
    pd.testing.assert_frame_equal(found[STATES], usual[STATES])
    width, before = ((t["r_radps_high"] - t["r_radps_low"]).mean() for t in (found, usual))
    assert width > 1.2 * before


def test_a_run_that_begins_in_balance_stays_there_also_with_linear_drag(given: Given) -> None:
    """The friction of a refined model counts in the balance that a simulation begins with."""
    time = np.arange(300) * 0.1
    table = pd.DataFrame({"time_s": time, "rudder_rad": 0.0, "rpm": 700.0})
    model = with_effects(given.model, linear_drag={"X_u": -0.5})
    trial, options = trial_of(table, ("rudder_rad", "rpm")), {"window_s": (-np.inf, np.inf)}
    found, without = (run(m, trial, **options) for m in (model, given.model))
    assert found["u_mps"].iloc[-1] == pytest.approx(found["u_mps"].iloc[0], rel=1e-4)
    assert found["u_mps"].iloc[0] < 0.98 * without["u_mps"].iloc[0]


@pytest.mark.parametrize("drag", [0.0, -0.5])
def test_the_speed_in_balance_is_the_one_that_maneuvers_are_planned_at(
    given: Given, drag: float
) -> None:
    """And that of the polynomial, as surge has no other terms; none where nothing drives."""
    model = with_effects(given.model, linear_drag={"X_u": drag}) if drag else given.model
    values, rate = given.model.values(), 700.0 / 60.0
    terms = [values["X_uu"], drag + values["T_nu"] * rate, values["T_nn"] * rate**2]
    assert steady_speed(model, rate) == pytest.approx(max(np.roots(terms).real), rel=1e-6)
    planned = steady_approach(structure_behind(model), vector_behind(model), rate)
    assert steady_speed(model, rate) == planned[0]
    assert steady_speed(model, 0.0) == steady_speed(model, -rate) == 0.0


def test_where_nothing_is_read_a_motion_begins_in_balance(given: Given) -> None:
    trial = given.trials[0]
    gap = trial.table["time_s"].between(WINDOW[0] - 10.0, WINDOW[0] + 10.0)
    deaf = changed(trial, **{c: trial.table[c].mask(gap) for c in ("u_mps", "v_mps")})
    found, model = run(given.model, deaf), given.model
    rate = trial.table["rpm"][trial.table["time_s"] >= WINDOW[0]].iloc[0] / 60.0
    assert found["u_mps"].iloc[0] == pytest.approx(steady_speed(model, rate), rel=1e-3)
    assert found[["v_mps", "r_radps"]].iloc[0].eq(0.0).all()
    # a track is north and east: the bow points to where it is read to
    assert found["heading_rad"].iloc[0] == run(model, trial)["heading_rad"].iloc[0] != 0.0
    assert run(model, trial, speed_mps=1.2)["heading_rad"].iloc[0] == found["heading_rad"].iloc[0]
    assert unread_starts(model, deaf, window_s=WINDOW) == pytest.approx([WINDOW[0]], abs=0.1)
    assert not unread_starts(model, trial, window_s=WINDOW)
    assert not unread_starts(model, deaf, window_s=WINDOW, speed_mps=1.0)


def test_a_current_moves_the_start_and_the_track_but_no_maneuver(given: Given) -> None:
    trial = given.trials[0]
    north, east = 0.2, -0.1
    model = with_effects(given.model, current={"north_mps": north, "east_mps": east})
    found = run(model, trial)
    without = run(given.model, trial)
    heading = without["heading_rad"].iloc[0]
    ahead = north * np.cos(heading) + east * np.sin(heading)
    # readings are over ground; the vehicle moves by so much less through the water
    assert found["u_mps"].iloc[0] == pytest.approx(without["u_mps"].iloc[0] - ahead, abs=1e-9)
    speed = {"speed_mps": 1.2}  # the same start for both
    found, without = run(model, trial, **speed), run(given.model, trial, **speed)
    np.testing.assert_allclose(found[STATES], without[STATES], atol=1e-12)
    seconds = found["time_s"] - found["time_s"].iloc[0]
    np.testing.assert_allclose(found["north_m"] - without["north_m"], north * seconds, atol=1e-9)
    np.testing.assert_allclose(found["east_m"] - without["east_m"], east * seconds, atol=1e-9)


def test_a_force_acts(given: Given) -> None:
    """The moment of an asymmetric hull turns a vehicle that goes straight."""
    trial = changed(given.trials[0], rudder_rad=0.0)
    model = with_effects(given.model, hull_asymmetry={"Y_0": 0.0, "N_0": 0.4})
    found = run(model, trial, speed_mps=1.2)
    assert abs(run(given.model, trial, speed_mps=1.2)["r_radps"].iloc[-1]) < 1e-9
    assert found["r_radps"].iloc[-1] > 0.01


def test_the_race_of_the_propeller_rests_on_the_speed_of_the_simulation(given: Given) -> None:
    """Where no speed was logged; the rudder would be laid over without bound otherwise."""
    trial = given.trials[0]
    bare = Trial.from_table(
        trial.name, trial.table[["time_s", "rudder_rad", "rpm", "record"]], trial.rate_hz
    )
    model = with_effects(given.model, propeller_race={"c_m2ps2pn": 0.01})
    plain, raced = run(given.model, bare), run(model, bare)
    assert raced["r_radps"].abs().max() < 2.0 * plain["r_radps"].abs().max()
    assert not np.allclose(raced["r_radps"], plain["r_radps"], atol=1e-4)


def test_the_band_is_drawn_with_the_effects(given: Given) -> None:
    model = with_effects(given.model, rudder_offset={"offset_deg": 2.0})
    found = run(model, given.trials[0], samples=30)
    inside = found["r_radps"].between(found["r_radps_low"], found["r_radps_high"])
    assert inside.mean() > 0.8
