"""Maneuvers and interruptions of the record."""

import numpy as np
import pytest
from segment_world import DEG, Sail, Ship, overlap

from auvident.schema.trial import Trial
from auvident.stages.segment import segment

AUV = Ship()
LOST = ["u_mps", "v_mps"]


def with_gap(trial: Trial, start_s: float, seconds: float, columns=LOST) -> Trial:
    """The trial without some channels for a while, numbered as the ingest stage does."""
    table = trial.table.copy()
    gap = (table["time_s"] >= start_s) & (table["time_s"] < start_s + seconds)
    table.loc[gap, columns] = np.nan
    after = table["time_s"] >= start_s + seconds
    number = table["record"].to_numpy(copy=True)
    number[after & (number >= 0)] += 1
    number[gap] = -1
    return trial.with_table(table.assign(record=number))


def one_turn(degrees: float = 500):
    s = Sail(AUV, np.random.default_rng(0))
    s.u = AUV.cruise_mps
    s.steer(30, 900, 0, 0.9, 8 * DEG)
    s.turn(12 * DEG, 900, degrees)
    s.steer(30, 900, s.psi, 0.9, 8 * DEG)
    return s


def records_inside(trial: Trial, m) -> np.ndarray:
    table = trial.table
    inside = table["time_s"].between(m.t_start_s - 0.01, m.t_end_s - 0.01)
    return np.unique(table.loc[inside, "record"])


@pytest.mark.parametrize("columns", [LOST, ["r_radps"], ["rudder_rad"], ["rpm"]])
def test_a_short_drop_out_tears_a_turn_into_parts_of_one_role(columns):
    s = one_turn()
    _, start, end = s.truth[0]
    trial = with_gap(s.trial(), start + 20, 2.0, columns)
    result = segment([trial])
    parts = result.maneuvers
    assert [m.id for m in parts] == ["trial-turn-1a", "trial-turn-1b"]
    assert len({m.role for m in parts}) == 1
    # no part reaches into the gap; all of the rest is used
    assert all(records_inside(trial, m).size == 1 for m in parts)
    used = sum(m.t_end_s - m.t_start_s for m in parts)
    assert used == pytest.approx(end - start - 2.0, abs=0.4)
    assert parts[0].features["whole_end_s"] == pytest.approx(end, abs=0.3)
    finding = next(f for f in result.findings if f.code == "torn_by_dropout")
    assert finding.value == pytest.approx(2.0, abs=0.3)


def test_a_torn_zigzag_is_still_recognised_as_one():
    s = Sail(AUV, np.random.default_rng(0))
    s.u = AUV.cruise_mps
    s.steer(30, 900, 0, 0.9, 8 * DEG)
    s.zigzag(20 * DEG, 20 * DEG, 5, 900)
    s.steer(30, 900, 0, 0.9, 8 * DEG)
    _, start, end = s.truth[0]
    trial = with_gap(with_gap(s.trial(), start + 6, 1.5), end - 7, 1.5)
    found = segment([trial]).maneuvers
    assert {m.kind for m in found} == {"zigzag"}
    assert all(m.features["executes"] == 5 for m in found)
    inside = (end - start - 3.0) / (end - start)
    assert overlap(s.truth, found, "zigzag") == pytest.approx(inside, abs=0.05)


def test_a_part_too_short_to_use_is_left_out():
    s = one_turn()
    start = s.truth[0][1]
    trial = with_gap(s.trial(), start + 3, 2.0)
    result = segment([trial])
    assert [m.id for m in result.maneuvers] == ["trial-turn-1"]
    assert result.maneuvers[0].t_start_s >= start + 5 - 0.01
    assert "torn_by_dropout" in [f.code for f in result.findings]


def test_across_a_long_gap_the_longer_side_is_used():
    s = one_turn(900)
    _, start, end = s.truth[0]
    trial = with_gap(s.trial(), start + 45, 12.0)
    result = segment([trial])
    assert len(result.maneuvers) == 1
    m = result.maneuvers[0]
    assert m.t_start_s == pytest.approx(start + 57, abs=0.2)
    assert m.t_end_s == pytest.approx(end, abs=0.2)
    assert any("shorter side" in r.reason for r in result.rejected)
    assert "cut_by_gap" in [f.code for f in result.findings]


def test_parts_are_held_out_together():
    s = one_turn()
    s.zigzag(20 * DEG, 20 * DEG, 4, 900)
    s.steer(20, 900, s.psi, 0.9, 8 * DEG)
    trial = with_gap(s.trial(), s.truth[0][1] + 20, 2.0)
    for name in ("trial-turn-1", "trial-turn-1b"):
        result = segment([trial], hold_out=[name])
        held = [m.id for m in result.maneuvers if m.role == "validate"]
        assert held == ["trial-turn-1a", "trial-turn-1b"]


def test_an_untouched_trial_has_no_gap_findings():
    codes = {f.code for f in segment([one_turn().trial()]).findings}
    assert not codes & {"torn_by_dropout", "cut_by_gap"}
