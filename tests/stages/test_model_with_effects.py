"""A model that carries effects: written, read and predicted with as it was identified."""

from dataclasses import fields
from functools import cache
from typing import Any

import numpy as np
import pandas as pd
import pytest

from auvident.engines.carried import (
    Carried,
    frame_of,
    internal_values,
    predicted_course,
    vector_behind,
)
from auvident.engines.setup import Setup
from auvident.physics.dynamics import ALL_STATES
from auvident.schema.artifacts import IdentifiedModel
from auvident.schema.channels import BY_COLUMN, TIME_COLUMN
from auvident.schema.effects import parameter_of
from auvident.schema.trial import Trial
from auvident.stages.identify import stage as identify_stage
from auvident.stages.simulate import simulate
from auvident.stages.validate import validate
from auvident.storage.artifacts import json_bytes
from tests.engines.chain import Chain, sample

# estimated, and given: of the command, in the equations, of the readings
SHOWN = {
    "rudder_offset.offset_deg": 1.0,
    "rudder_lag.lag_s": 0.2,
    "rudder_rate_limit.rate_degps": 60.0,
    "current.north_mps": 0.05,
    "current.east_mps": -0.02,
    "dvl_misalignment.yaw_deg": 0.5,
    "gyro_bias.bias_degps": 0.05,
    "hull_asymmetry.Y_0": 0.1,
    "hull_asymmetry.N_0": 0.02,
    "dvl_delay.delay_s": 0.1,
    "thrust_sag.fraction_per_1000_s": 0.05,
}
ESTIMATED = ("current", "rudder_lag", "rudder_offset", "thrust_sag")


def carried() -> Carried:
    start = {name: parameter_of(name).internal(v) for name, v in SHOWN.items()}
    own = [n for n in start if n.split(".")[0] in ESTIMATED]
    prior_std = {n: parameter_of(n).prior for n in own}
    return Carried(ESTIMATED, start, dict.fromkeys(own, 0.0), prior_std)


@cache
def identified() -> tuple[Chain, Setup, np.ndarray, IdentifiedModel]:
    """The chain, and setup, final parameters and model of its identification with effects."""
    seen: list[Any] = []

    def noted(setup: Setup, *args: Any) -> IdentifiedModel:
        seen.append((setup, args[2][-1].outcome.parameters))
        model: IdentifiedModel = identify_stage.__dict__["_model_of"](setup, *args)
        return model

    chain = sample("harbour_trial")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(identify_stage, "_model_of", identify_stage.model_of, raising=False)
        patch.setattr(identify_stage, "model_of", noted)
        model = chain.identify(carried=carried()).model
    return chain, *seen[0], model


def read_again(model: IdentifiedModel) -> IdentifiedModel:
    return IdentifiedModel.model_validate_json(json_bytes(model, "model.json"))


# --- round trip ----------------------------------------------------------------------------


def test_the_model_read_again_predicts_what_was_identified() -> None:
    _, setup, final, model = identified()
    again = read_again(model)
    for _, record in setup.records.values():
        found = predicted_course(
            frame_of(again, setup.dt_s), vector_behind(again), record, ALL_STATES
        )
        expected = predicted_course(setup.frame, final, record, ALL_STATES)
        for f in fields(found):
            np.testing.assert_array_equal(getattr(found, f.name), getattr(expected, f.name))


def test_the_parameters_come_back_to_the_last_bit() -> None:
    _, setup, final, model = identified()
    again = read_again(model)
    structure = frame_of(again, setup.dt_s).structure
    assert structure.parameters == setup.structure.parameters
    np.testing.assert_array_equal(vector_behind(again), final)


def test_given_effects_keep_their_value_and_estimated_ones_move() -> None:
    *_, model = identified()
    internal = internal_values(model.effects)
    assert set(internal) == set(SHOWN)
    for name, shown in SHOWN.items():
        value = parameter_of(name).internal(shown)
        assert (internal[name] == value) == (name.split(".")[0] not in ESTIMATED), name


def test_effects_are_shown_with_units_and_deviations() -> None:
    *_, model = identified()
    for row in model.effects:
        assert row["nuisance"] == (row["id"] not in ESTIMATED)
        for p in row["parameters"]:
            declared = parameter_of(f"{row['id']}.{p['symbol']}")
            internal = row["internal"][f"{row['id']}.{p['symbol']}"]
            assert p["value"] == pytest.approx(declared.shown(internal)[0])
            assert p["unit"] == declared.unit
            assert (p["std"] > 0.0) == (row["id"] in ESTIMATED)
            if row["id"] in ESTIMATED:  # in units of the prior, which the data have narrowed
                assert p["std"] < declared.shown(internal, declared.prior)[1]


# --- validate and simulate -----------------------------------------------------------------


@cache
def validated() -> pd.DataFrame:
    chain, _, _, model = identified()
    return validate(chain.trials, chain.maneuvers, read_again(model)).simulation


def test_validation_predicts_the_identifying_maneuvers_as_identified() -> None:
    """Of these nothing is blanked, so that both have the same record."""
    _, setup, final, _ = identified()
    table = validated()
    for name, (_, record) in setup.records.items():
        rows = table[table["maneuver"] == name]
        expected = predicted_course(setup.frame, final, record, ALL_STATES).readings
        for k, column in enumerate(("u_mps", "v_mps", "r_radps")):
            away = np.abs(rows[f"{column}_simulated"].to_numpy() - expected[:, k])
            # the start and the inputs before may lie in a held-out maneuver, blanked for one only
            assert np.nanmax(away[len(away) // 2 :]) < 0.01
            assert np.nanmedian(away) < 1e-3


def test_simulation_of_a_window_is_the_prediction_of_that_maneuver() -> None:
    chain, setup, final, model = identified()
    record = next(record for kind, record in setup.records.values() if kind == "zigzag")
    (trial,) = chain.trials
    window = (float(record.time_s[0]), float(record.time_s[-1]))
    found = simulate(
        read_again(model), trial, window_s=window, samples=0, rng=np.random.default_rng(0)
    )
    expected = predicted_course(setup.frame, final, record, ALL_STATES).states
    n = min(len(found), len(expected))
    assert n > 0.9 * len(expected)
    for k, column in enumerate(("u_mps", "v_mps", "r_radps", "heading_rad")):
        away = np.abs(found[column].to_numpy()[:n] - expected[:n, k])
        assert away.max() < 1e-6, column


RACE = {
    "id": "propeller_race",
    "family": "actuation",
    "nuisance": False,
    "parameters": [],
    "internal": {"propeller_race.c_m2ps2pn": 0.02},
}
EACH = [
    *ESTIMATED,
    *dict.fromkeys(n.split(".")[0] for n in SHOWN if n.split(".")[0] not in ESTIMATED),
]


@pytest.mark.parametrize("effect", [*EACH, "all", "propeller_race"])
def test_a_prediction_looks_at_no_reading_after_the_start(effect) -> None:
    """Only logged inputs: garbage in everything that was measured later changes nothing."""
    chain, _, _, model = identified()
    rows = tuple(r for r in (*model.effects, RACE) if effect in (r["id"], "all"))
    rows = rows[: len(model.effects)]  # "all" but the race
    model = model.model_copy(update={"effects": rows})
    m = next(m for m in chain.maneuvers.maneuvers if m.role == "validate" and m.kind == "zigzag")
    only = chain.maneuvers.model_copy(update={"maneuvers": (m,)})
    found, expected = (
        validate(t, only, model).simulation.filter(like="_simulated")
        for t in ([noisy_after(t, m.t_start_s + 1.0) for t in chain.trials], chain.trials)
    )
    assert len(found)
    pd.testing.assert_frame_equal(found, expected)


def noisy_after(trial: Trial, time_s: float) -> Trial:
    """The trial with garbage in every reading from a time on."""
    table, rng = trial.table.copy(), np.random.default_rng(0)
    measured = [c for c in BY_COLUMN if c in table and BY_COLUMN[c].kind == "measured"]
    late = table[TIME_COLUMN] >= time_s
    table.loc[late, measured] = rng.normal(size=(int(late.sum()), len(measured)))
    return trial.with_table(table)


def test_a_model_with_effects_has_a_band_in_validation_and_in_simulation() -> None:
    chain, _, _, model = identified()
    assert model.left_out is not None
    table = validate(chain.trials, chain.maneuvers, model).simulation
    first = next(m for m in chain.maneuvers.maneuvers if m.kind == "zigzag")
    window = first.t_start_s, first.t_end_s
    rng = np.random.default_rng(0)
    desk = simulate(model, chain.trials[0], window_s=window, samples=10, rng=rng)
    for column in ("u_mps", "v_mps", "r_radps", "heading_rad"):
        assert (table[f"{column}_hi"] > table[f"{column}_lo"]).all()
        assert (desk[f"{column}_high"] > desk[f"{column}_low"]).all()
    assert {"north_m_lo", "north_m_hi", "east_m_lo", "east_m_hi"} <= set(table.columns)
