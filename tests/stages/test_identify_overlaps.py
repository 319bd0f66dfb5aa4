"""Identification where maneuvers overlap held-out ones: what is left of them identifies."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from auvident.constants import ANSWER_S
from auvident.engines.setup import Setup
from auvident.errors import NumericsError
from auvident.schema.artifacts import Maneuver, Maneuvers
from auvident.schema.channels import BY_COLUMN
from auvident.schema.logs import DEG
from auvident.schema.trial import Trial
from auvident.stages.identify import Identification, prepare
from tests.engines.chain import identified, plan_named, sample

NAME = "dive_trial"
HALF_S = 0.05  # half a row


def of_sample(role: str) -> list[Maneuver]:
    own = [m for m in sample(NAME).maneuvers.maneuvers if m.shows("vertical")]
    return [m for m in own if m.role == role]


@cache
def run() -> Maneuver:
    """The straight run that is held out."""
    return next(m for m in of_sample("validate") if m.id == f"{NAME}-straight-2")


def depth_step(start: float, end: float, name: str = "late") -> Maneuver:
    """A maneuver of the vertical plane that identifies, in times since the run began."""
    changes: dict[str, Any] = {"id": name, "role": "identify", "plane": "vertical"}
    changes |= {"planes": ("vertical",), "features": {"maneuver": "depth_step"}}
    times = {"t_start_s": run().t_start_s + start, "t_end_s": run().t_start_s + end}
    return run().model_copy(update=changes | times)


def length() -> float:
    return run().t_end_s - run().t_start_s


def with_more(*more: Maneuver) -> Maneuvers:
    found = sample(NAME).maneuvers
    return found.model_copy(update={"maneuvers": (*found.maneuvers, *more)})


def setup_with(maneuvers: Maneuvers) -> Setup:
    c = sample(NAME)
    return prepare(
        c.trials,
        maneuvers,
        c.ase,
        c.vehicle,
        c.noise,
        plane="vertical",
        plan=plan_named("spiral"),
        filter="ekf",
        engine="compiled",
    )


@cache
def identified_with(start: float, end: float) -> Identification:
    return sample(NAME).identify("vertical", maneuvers=with_more(depth_step(start, end)))


def test_a_maneuver_within_a_held_out_one_identifies_nothing_and_it_is_said() -> None:
    model = identified_with(20.0, 50.0).model
    (said,) = [f for f in model.findings if f.code == "held-out-within"]
    assert said.where == "late" and said.value == 0.0 and said.threshold == ANSWER_S
    assert run().id in said.message
    without = identified(NAME, "vertical").model
    assert model.coefficients == without.coefficients


def test_the_held_out_stretch_under_another_id_identifies_nothing() -> None:
    again = run().model_copy(update={"id": f"{NAME}-straight-13", "role": "identify"})
    setup = setup_with(with_more(again))
    assert set(setup.records) == {m.id for m in of_sample("identify")}


@pytest.mark.parametrize(
    ("start", "end", "begins", "ends"),
    [(-12.0, 20.0, -12.0, 0.0), (100.0, 150.0, None, 150.0), (-8.0, 160.0, None, 160.0)],
)
def test_what_is_left_of_a_maneuver_identifies(start, end, begins, ends) -> None:
    begins = length() if begins is None else begins
    record = setup_with(with_more(depth_step(start, end))).records["late"][1]
    since = record.time_s - run().t_start_s
    assert since[0] == pytest.approx(begins, abs=HALF_S)
    assert since[-1] == pytest.approx(ends - 2 * HALF_S, abs=HALF_S)
    assert np.isfinite(record.measured[:, 0]).any()
    assert record.start[0] > 0.3 and (record.given[:, 0] > 0.3).all()  # a gap is no standstill


def test_too_little_left_is_left_out() -> None:
    names = set(setup_with(with_more(depth_step(100.0, length() + ANSWER_S - 0.2))).records)
    assert "late" not in names
    names = set(setup_with(with_more(depth_step(100.0, length() + ANSWER_S + 0.2))).records)
    assert "late" in names


def test_a_cut_maneuver_is_said() -> None:
    from auvident.stages.identify.held_out import overlap_findings

    c = sample(NAME)
    more = with_more(depth_step(-12.0, 20.0), depth_step(20.0, 50.0, "inside"))
    said = overlap_findings(c.trials, more, "vertical")
    assert [(f.code, f.where) for f in said] == [
        ("held-out-in-part", "late"),
        ("held-out-within", "inside"),
    ]
    assert said[0].value == pytest.approx(12.0, abs=0.2)
    assert not overlap_findings(c.trials, c.maneuvers, "vertical")


def test_nothing_left_at_all_is_an_error_that_says_so() -> None:
    alone = Maneuvers(maneuvers=(run(), depth_step(20.0, 50.0), depth_step(60.0, 90.0, "later")))
    with pytest.raises(NumericsError, match="held-out") as error:
        sample(NAME).identify("vertical", maneuvers=alone)
    assert "late, later" in error.value.where and error.value.exit_code == 5


# --- maneuvers without readings ------------------------------------------------------------


def silent(*names: str) -> tuple[Trial, ...]:
    """The sample trial with every sensor silent over some maneuvers."""
    (trial,) = sample(NAME).trials
    table = trial.table.copy()
    measured = [c for c in BY_COLUMN if c in table and BY_COLUMN[c].kind == "measured"]
    for m in sample(NAME).maneuvers.maneuvers:
        if m.id in names:
            rows = table["time_s"].between(m.t_start_s - HALF_S, m.t_end_s + HALF_S)
            table.loc[rows, measured] = np.nan
    return (trial.with_table(table),)


def test_a_maneuver_without_any_reading_is_left_out_and_it_is_said() -> None:
    lost = f"{NAME}-vertical-zigzag-3"
    model = sample(NAME).identify("vertical", trials=silent(lost)).model
    (said,) = [f for f in model.findings if f.code == "no-readings"]
    assert said.where == lost and "w_mps" in said.message
    assert all(lost not in stage.maneuvers for stage in model.stages)


def test_no_reading_at_all_is_an_error_with_what_to_check() -> None:
    names = [m.id for m in of_sample("identify")]
    with pytest.raises(NumericsError, match="no maneuver for identification has a reading"):
        sample(NAME).identify("vertical", trials=silent(*names))


# --- a vertical plane without pitch --------------------------------------------------------


def test_a_plane_without_pitch_says_to_hold_the_trim_and_with_it_held_predicts() -> None:
    """Trim and pitch go together: free, the pitch of this dive is predicted 12 degrees off."""
    (trial,) = sample(NAME).trials
    level = trial.with_table(trial.table.drop(columns="pitch_rad"))
    noise = {column: std for column, std in sample(NAME).noise.items() if column != "pitch_rad"}
    chain = replace(sample(NAME), trials=(level,), noise=noise)
    whole = plan_named("refined")
    free = chain.identify("vertical", plan=whole).model
    (said,) = [f for f in free.findings if f.code == "pitch-not-logged"]
    assert "x_g_std_m = 0" in said.remedy
    held = chain.with_body(x_g_std_m=0.0).identify("vertical", plan=whole).model
    assert not [f for f in held.findings if f.code == "pitch-not-logged"]
    wrong, right = (sample(NAME).validate(model) for model in (free, held))
    errors = [v.metrics.summary["validate"]["pitch"].rmse for v in (wrong, right)]
    assert errors[0] > 5 * DEG and errors[1] < 1.5 * DEG


def test_a_pitch_that_is_logged_is_no_finding() -> None:
    model = identified(NAME, "vertical").model
    assert "pitch-not-logged" not in {f.code for f in model.findings}
