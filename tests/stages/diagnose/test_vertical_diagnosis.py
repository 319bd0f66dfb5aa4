"""The residual loop in the vertical plane: the dive as it is, and with errors put into its logs.

What is put into a column of the log is known whatever the program believes: a pitch that reads two
degrees too much, a DVL that is pitched, an elevator that stands elsewhere than its command or
follows it late.
"""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from auvident.schema.diagnosis import Diagnosis, EffectFound
from auvident.schema.effects import BY_ID
from auvident.stages.diagnose.stage import Diagnosed, diagnose
from auvident.stages.identify import without_held_out
from auvident.stages.refine.attempts import carried_of
from tests.engines.chain import Chain, sample
from tests.session import once

TRIAL = "dive_trial"
TILT = math.radians(2.0)
DEEPER_M, STATED_M = 0.15, 0.07  # where the DVL of the dive sits
OFFSET_DEG, LATE_S = 2.5, 0.4  # late by about L / (2 U)
# Enough of the dive to tell a DVL and a delay: thrust steps, zigzags of two sizes, depth steps. An
# offset of the elevator is told from an asymmetric hull by all of it.
FEW = (
    "straight-1",
    "vertical-zigzag-1",
    "vertical-zigzag-3",
    "vertical-zigzag-5",
    "vertical-straight-5",
    "vertical-straight-6",
)
Edit = Callable[[pd.DataFrame], None]


def pitch_reads_too_much(table: pd.DataFrame) -> None:
    table["pitch_rad"] += TILT


def dvl_is_pitched(table: pd.DataFrame) -> None:
    u, w = table["u_mps"].to_numpy(), table["w_mps"].to_numpy()
    c, s = math.cos(TILT), math.sin(TILT)
    table["u_mps"], table["w_mps"] = c * u - s * w, s * u + c * w


def elevator_stands_elsewhere(table: pd.DataFrame) -> None:
    table["elevator_rad"] -= math.radians(OFFSET_DEG)


def elevator_is_late(table: pd.DataFrame) -> None:
    rows = round(LATE_S / 0.1)
    table["elevator_rad"] = np.append(table["elevator_rad"].to_numpy()[rows:], np.zeros(rows))


def dvl_sits_deeper(table: pd.DataFrame) -> None:
    table["u_mps"] += table["q_radps"] * DEEPER_M


EDITS: dict[str, tuple[Edit, ...]] = {
    "clean": (),
    "pitch": (pitch_reads_too_much,),
    "pitch and elevator": (pitch_reads_too_much, elevator_stands_elsewhere),
    "dvl and delay": (dvl_is_pitched, elevator_is_late),
    "deeper": (dvl_sits_deeper,),
    "deeper than stated": (dvl_sits_deeper,),
}
OF_FEW = ("pitch", "dvl and delay", "deeper", "deeper than stated")


def edited(name: str) -> Chain:
    chain = sample(TRIAL)
    (trial,) = chain.trials
    table = trial.table.copy()
    for edit in EDITS[name]:
        edit(table)
    few = tuple(m for m in chain.maneuvers.maneuvers if m.id.removeprefix(f"{TRIAL}-") in FEW)
    update = {"maneuvers": few} if name in OF_FEW else {}
    maneuvers = chain.maneuvers.model_copy(update=update)
    vehicle = chain.vehicle
    if name == "deeper than stated":
        dvl = vehicle.dvl.model_copy(update={"z_m": STATED_M})
        vehicle = vehicle.model_copy(update={"dvl": dvl})
    trials = (trial.with_table(table),)
    return replace(chain, trials=trials, maneuvers=maneuvers, vehicle=vehicle)


@once
def diagnosed(name: str) -> Diagnosed:
    chain = edited(name)
    model = chain.identify("vertical").model
    seen = [without_held_out(t, chain.maneuvers, "vertical") for t in chain.trials]
    return diagnose(seen, chain.maneuvers, chain.vehicle, chain.setup("vertical"), model)


def named(found: Diagnosis) -> dict[str, EffectFound]:
    return {e.id: e for e in found.effects}


def is_within(effect: EffectFound, value: float) -> bool:
    (p,) = effect.parameters
    assert p.low is not None and p.high is not None
    return p.low <= value <= p.high


def test_nothing_is_found_in_the_dive() -> None:
    found = diagnosed("clean").diagnosis
    assert (found.verdict, found.effects) == ("none_found", ())
    assert found.plane == "vertical"
    assert {r.channel for r in found.residuals} == {"u", "w", "q"}


def test_a_pitch_bias_is_found() -> None:
    effects = named(diagnosed("pitch").diagnosis)
    assert set(effects) == {"pitch_bias"}
    assert is_within(effects["pitch_bias"], 2.0)


def test_a_pitch_bias_and_an_elevator_offset_are_found_together() -> None:
    """An offset of the elevator is no trim moment: it grows with the speed."""
    effects = named(diagnosed("pitch and elevator").diagnosis)
    assert set(effects) == {"pitch_bias", "elevator_offset"}
    assert is_within(effects["pitch_bias"], 2.0)
    assert is_within(effects["elevator_offset"], OFFSET_DEG)


def test_a_pitched_dvl_and_a_late_elevator_are_found_together() -> None:
    effects = named(diagnosed("dvl and delay").diagnosis)
    assert set(effects) == {"dvl_pitch", "elevator_delay"}
    assert is_within(effects["dvl_pitch"], 2.0)
    assert is_within(effects["elevator_delay"], LATE_S)


def test_a_dvl_deeper_than_the_vehicle_file_states_is_found() -> None:
    """Every model took the depth along that no file states, and one of 2,800 nats in a file that
    states it was never said (population, even seed 6478)."""
    effects = named(diagnosed("deeper than stated").diagnosis)
    assert set(effects) == {"dvl_lever_arm"}
    (deep,) = (p for p in effects["dvl_lever_arm"].parameters if p.symbol == "dz_m")
    assert deep.low is not None and deep.high is not None and deep.low <= DEEPER_M <= deep.high


def test_a_depth_of_the_dvl_that_the_file_does_not_state_is_taken_along() -> None:
    found = diagnosed("deeper").diagnosis
    assert "dvl_lever_arm" not in named(found)
    (row,) = (r for r in found.sees if (r.id, r.symbol) == ("dvl_lever_arm", "dz_m"))
    assert not row.visible and row.why.endswith("the vehicle file does not state it")


@pytest.mark.parametrize("name", list(EDITS))
def test_effects_are_those_of_the_plane(name: str) -> None:
    found = diagnosed(name).diagnosis
    tried = {c.id for c in found.candidates} | {row.id for row in found.sees}
    assert all("vertical" in BY_ID[e].planes for e in tried)
    assert not any(e.startswith("rudder") for e in tried)


def test_residuals_and_forces_stand_in_columns_of_the_plane() -> None:
    table = diagnosed("pitch").residuals
    assert {"w_mps_before", "q_radps_after", "pitch_rad", "force_Z_n", "force_M_nm"} <= set(table)
    assert "heading_rad" not in table and "force_Y_n" not in table


def test_what_the_depth_told_is_known_before_the_refinement() -> None:
    """The bias of the pitch is carried with what the depth says of it, no DVL pitched beside it."""
    carried = carried_of(diagnosed("pitch").diagnosis)
    assert carried is not None
    assert carried.prior["pitch_bias.bias_deg"] == pytest.approx(TILT, abs=2e-3)
    assert carried.prior_std["pitch_bias.bias_deg"] < 2e-3
