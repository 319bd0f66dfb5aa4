"""Held-out maneuvers choose nothing: garbage in their readings changes only their own errors."""

from dataclasses import fields
from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from auvident.engines.records import Record, Source
from auvident.pipeline import steps
from auvident.pipeline.helper import Helper
from auvident.pipeline.observer import Observer
from auvident.schema.artifacts import ON_ERRORS
from auvident.schema.channels import BY_COLUMN, TIME_COLUMN
from auvident.schema.trial import Trial
from auvident.stages.diagnose.checks.kinematics import heading_against_gyro, position_against_dvl
from auvident.stages.diagnose.fit.case import case_of
from auvident.stages.identify import prepare, without_held_out
from auvident.storage.artifacts import json_bytes
from tests.engines.chain import plan_named
from tests.stages.diagnose.loop_chain import diagnosed, loop

NAMES = ("bay_trial", "harbour_trial")


def garbage(name: str, trial: Trial) -> Trial:
    """The trial with every reading of the held-out maneuvers replaced by large noise."""
    table, rng = trial.table.copy(), np.random.default_rng(0)
    measured = [c for c in BY_COLUMN if c in table and BY_COLUMN[c].kind == "measured"]
    assert {"u_mps", "v_mps", "r_radps", "heading_rad"} <= set(measured)
    for m in loop(name).chain.maneuvers.maneuvers:
        if m.role == "validate":
            rows = (table[TIME_COLUMN] >= m.t_start_s) & (table[TIME_COLUMN] < m.t_end_s)
            table.loc[rows, measured] = rng.normal(size=(int(rows.sum()), len(measured)))
    return trial.with_table(table)


def given(name: str, trials: list[Trial], **more: Any) -> Any:
    """What the pipeline gives its stages, without a run directory."""
    made = loop(name)
    return SimpleNamespace(
        trials=trials,
        maneuvers=made.chain.maneuvers,
        ase=made.chain.ase,
        vehicle=made.chain.vehicle,
        model=made.model,
        noise=lambda: made.chain.noise,
        seed=0,
        options={"filter": None},
        observer=Observer(),
        manifest=None,
        is_beside=False,
        former={},
        plane=None,
        kept={},
        helper=Helper(),
        table=lambda name: pd.DataFrame(),
        **more,
    )


@pytest.fixture(scope="module", autouse=True)
def plan() -> Any:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(steps, "identifying_plan", lambda given: plan_named("spiral"))
        yield


@cache
def poisoned_trials(name: str) -> list[Trial]:
    return [garbage(name, t) for t in loop(name).chain.trials]


@cache
def refined(poisoned: bool) -> dict[str, Any]:
    """The refinement in the bay, where a current is added."""
    name = "bay_trial"
    trials = poisoned_trials(name) if poisoned else list(loop(name).chain.trials)
    return steps.refine(given(name, trials, diagnosis=diagnosed(name).diagnosis))


def test_the_diagnosis_is_the_same_to_the_last_byte() -> None:
    """Which also shows that the same seed gives the same result."""
    name = "harbour_trial"  # the quicker one
    found = steps.diagnose(given(name, poisoned_trials(name)))
    expected = diagnosed(name)
    assert json_bytes(found["diagnose/diagnosis.json"], "") == json_bytes(expected.diagnosis, "")
    residuals = found["diagnose/residuals.parquet"]
    assert residuals.keys() == expected.residuals.keys()
    for column, values in residuals.items():
        np.testing.assert_array_equal(values, expected.residuals[column])


@pytest.mark.parametrize("name", NAMES)
def test_the_case_of_a_diagnosis_is_the_same(name) -> None:
    """All that a diagnosis looks at, without running it."""
    made = loop(name)
    cases = []
    for trials in (poisoned_trials(name), list(made.chain.trials)):
        seen = [without_held_out(t, made.chain.maneuvers, "horizontal") for t in trials]
        setup = prepare(
            trials,
            made.chain.maneuvers,
            made.chain.ase,
            made.chain.vehicle,
            made.chain.noise,
            plane="horizontal",
            plan=plan_named("spiral"),
            filter="ekf",
            engine="compiled",
        )
        found = (heading_against_gyro(seen), position_against_dvl(seen, made.chain.vehicle.dvl))
        cases.append(case_of(setup, made.model, [c for c in found if c is not None]))
    for one, other in zip(cases[0].records, cases[1].records, strict=True):
        for a, b in zip(arrays(one), arrays(other), strict=True):
            np.testing.assert_array_equal(a, b)
    for ours, theirs in zip(cases[0].checks, cases[1].checks, strict=True):
        np.testing.assert_array_equal(ours.mean, theirs.mean)
        np.testing.assert_array_equal(ours.covariance, theirs.covariance)
    np.testing.assert_array_equal(cases[0].setup.prior_std, cases[1].setup.prior_std)


def arrays(record: Record) -> list[np.ndarray]:
    """Everything in a record."""
    own = [getattr(record, f.name) for f in fields(record) if f.name not in ("id", "source")]
    source = [getattr(record.source, f.name) for f in fields(Source)]
    return [a for a in (*own, *source) if a is not None]


def test_the_refined_model_is_the_same_to_the_last_byte() -> None:
    found, expected = (refined(p)["refine/model.json"] for p in (True, False))
    assert expected.effects  # there is something in it
    assert json_bytes(found, "") == json_bytes(expected, "")


SAID_OF_ERRORS = {*ON_ERRORS, "worse-refined"}  # findings on the errors of what was held out


def test_only_the_errors_of_what_was_held_out_change() -> None:
    found, expected = (refined(p)["refine/comparison.json"].model_dump() for p in (True, False))
    # the draws of the bootstrap for what comes later depend on how many came before: not here,
    # where the rows are the same
    for told in ("held_out", "coverage"):  # errors of what was held out, and its share in a band
        assert found.pop(told) != expected.pop(told)
    ours, theirs = found.pop("maneuvers"), expected.pop("maneuvers")
    for one in (found, expected):  # those on the errors themselves are of what was held out
        one["findings"] = [f for f in one["findings"] if f["code"] not in SAID_OF_ERRORS]
    assert found == expected
    for one, other in zip(ours, theirs, strict=True):
        assert (one == other) == (one["role"] == "identify"), one["id"]


def test_the_current_lowers_the_errors_of_what_was_held_out() -> None:
    held = refined(False)["refine/comparison.json"].held_out
    assert held.maneuvers
    for channel in ("u", "v"):
        assert held.after[channel].rmse < 0.6 * held.before[channel].rmse
        assert held.difference[channel].high < 0.0


def test_without_a_compass_held_out_maneuvers_still_tell_which_way_later_ones_lay() -> None:
    """Their yaw rate is summed up with the others; their readings are gone all the same."""
    made = loop("harbour_trial")
    (trial,) = made.chain.trials
    bare = trial.with_table(trial.table.drop(columns="heading_rad"))
    left = without_held_out(bare, made.chain.maneuvers, "horizontal")
    assert left.table["r_radps"].isna().sum() > bare.table["r_radps"].isna().sum()
    assert left.turned_rad is not None
    np.testing.assert_array_equal(left.turned_rad, bare.turned_rad)
    heading = trial.table["heading_rad"].to_numpy()
    off = left.turned_rad - (heading - heading[np.isfinite(heading)][0])
    assert np.nanmax(np.abs(off)) < 0.2  # the gyro drifts by 11 deg in 22 minutes
    assert np.nanmax(np.abs(np.diff(heading))) < np.pi
