"""Depth in the segment stage: used wherever it is, missing rows are missing rows and no more."""

import numpy as np
import pytest
from segment_world import Sail, Ship
from test_segment_samples import SAMPLES, ingested

from auvident.constants import BRIDGED_S
from auvident.schema.trial import Trial
from auvident.stages.segment import segment, segment_vertical
from auvident.stages.segment.depth import sink_by_depth, sink_rate
from auvident.stages.segment.pieces import pieces_of

AUV = Ship()
SINK_MPS = 0.4
DIVE_S = (40.0, 130.0)  # since the start of the record; as many thrust levels as the run below
RUN_S = (160.0, 250.0)


def dived(motion: bool = False) -> Trial:
    """A dive under thrust steps, then a level run under thrust steps."""
    s = Sail(AUV, np.random.default_rng(3))
    s.u = AUV.cruise_mps
    s.fixed(40, 900)
    s.straight([750, 950, 800], [30, 30, 30], kept=False)
    s.fixed(30, 900)
    s.straight([750, 950, 800], [30, 30, 30], kept=False)
    s.fixed(30, 900)
    trial = s.trial()
    table = trial.table.copy()
    since = table["time_s"] - table["time_s"].iloc[0]
    noise = s.rng.normal(0.0, 0.01, len(table))
    table["depth_m"] = 0.2 + SINK_MPS * np.clip(since - DIVE_S[0], 0.0, DIVE_S[1] - DIVE_S[0])
    table["depth_m"] += noise
    if motion:
        dives = since.between(*DIVE_S)
        table["pitch_rad"] = -np.arcsin(np.where(dives, SINK_MPS / table["u_mps"].clip(0.8), 0.0))
        table["w_mps"] = 0.0
    return trial.with_table(table)


def without_depth(trial: Trial, *spans_s: tuple[float, float]) -> Trial:
    """The trial without the readings of depth in some spans since its start."""
    table = trial.table.copy()
    since = table["time_s"] - table["time_s"].iloc[0]
    for start, stop in spans_s:
        table.loc[(since > start - 1e-6) & (since < stop - 1e-6), "depth_m"] = np.nan
    return trial.with_table(table)


def straights(trial: Trial) -> list[tuple[float, float]]:
    origin = trial.table["time_s"].iloc[0]
    return [
        (m.t_start_s - origin, m.t_end_s - origin)
        for m in segment([trial]).maneuvers
        if m.kind == "straight"
    ]


def test_a_dive_is_no_straight_run_and_without_depth_it_would_be() -> None:
    (run,) = straights(dived())
    assert DIVE_S[1] - 1.0 < run[0] < RUN_S[0] + 1.0
    assert run[1] > RUN_S[1] - 1.0
    (all_of_it,) = straights(without_depth(dived(), (0, 1000)))
    assert all_of_it[0] < DIVE_S[0]


@pytest.mark.parametrize(
    "spans",
    [
        [(0.0, 0.1)],
        [(0.0, 4.0)],
        [(0.0, 20.0)],
        [(60.0, 60.1)],
        [(60.0, 64.0)],
        [(200.0, 203.0)],
        [(200.0, 230.0)],
        [(270.0, 1000.0)],
        [(t, t + 0.1) for t in range(0, 270, 7)],
    ],
)
def test_missing_rows_of_depth_change_nothing_where_there_is_depth(spans) -> None:
    assert straights(without_depth(dived(), *spans)) == straights(dived())


def test_a_dive_without_depth_for_a_while_shows_in_its_pitch() -> None:
    """A depth sensor that starts late."""
    trial = without_depth(dived(motion=True), (0.0, 140.0))
    assert straights(trial) == straights(dived(motion=True))


def test_short_gaps_of_depth_are_bridged_and_long_ones_are_not() -> None:
    spans = [(60.0, 60.0 + BRIDGED_S), (100.0, 100.2 + BRIDGED_S)]
    (whole,) = pieces_of(dived())
    (piece,) = pieces_of(without_depth(dived(), *spans))
    since = piece.t - piece.t[0]
    sink = sink_by_depth(piece)
    long = (since > 100.0 - 1e-6) & (since < spans[1][1] - 1e-6)
    np.testing.assert_array_equal(np.isnan(sink), long)
    np.testing.assert_array_equal(np.isnan(sink_rate(piece)), long)  # nothing else tells
    np.testing.assert_allclose(sink[~long], sink_by_depth(whole)[~long], atol=0.05)


def test_a_gap_of_pitch_leaves_the_rows_to_what_else_there_is() -> None:
    trial = without_depth(dived(motion=True), (0.0, 140.0))
    table = trial.table.copy()
    table.loc[10:20, "pitch_rad"] = np.nan
    assert straights(trial.with_table(table)) == straights(dived(motion=True))


@pytest.mark.parametrize("rows", [[0], [0, 1, 2], [-1], [0, 4000, 9000, 9001, -1]])
def test_empty_rows_of_depth_leave_the_maneuvers_of_a_dive_trial_alone(rows) -> None:
    trial = ingested(SAMPLES / "dive_trial", "remus100")
    table = trial.table.copy()
    table.loc[table.index[rows], "depth_m"] = np.nan
    spoiled = trial.with_table(table)
    assert spans_of(segment([spoiled])) == spans_of(segment([trial]))
    assert spans_of(segment_vertical([spoiled])) == spans_of(segment_vertical([trial]))


def spans_of(found) -> list[tuple[str, float, float, str]]:
    return [(m.id, m.t_start_s, m.t_end_s, m.role) for m in found.maneuvers]
