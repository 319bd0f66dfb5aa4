"""Lines keep what matters when they are thinned; figures show gaps, and bear wild predictions."""

import re

import numpy as np
import pandas as pd
import pytest

from auvident.report.figures import (
    MOST_POINTS,
    limits,
    new_figure,
    style,
    svg,
    thinned,
    unbridged,
)
from auvident.report.figures_coefficients import forest
from auvident.report.figures_joined import groups, joined
from auvident.report.figures_prediction import _once_round, _ribbon, covered, prediction
from auvident.report.figures_trial import timeline, track
from auvident.schema.artifacts import (
    ChannelMetrics,
    Maneuver,
    ManeuverMetrics,
    ModelCoefficient,
)
from auvident.schema.trial import Trial


def trial(name: str = "bay", start_s: float = 100.0, seconds: int = 60) -> Trial:
    time = start_s + np.arange(10 * seconds) / 10.0
    table = pd.DataFrame(
        {
            "time_s": time,
            "u_mps": 1.5 + 0.1 * np.sin(time),
            "v_mps": 0.0,
            "r_radps": 0.1,
            "rudder_rad": -0.1,
            "rpm": 900.0,
            "heading_rad": 0.1 * (time - start_s),
            "record": 0,
        }
    )
    return Trial.from_table(name, table, 10.0)


def maneuver(name: str = "bay", start_s: float = 110.0, role: str = "identify") -> Maneuver:
    return Maneuver(
        id=f"{name}-turn-1",
        trial=name,
        kind="turn",
        t_start_s=start_s,
        t_end_s=start_s + 30.0,
        role=role,  # type: ignore[arg-type]
        plane="horizontal",
        planes=("horizontal",),
    )


def test_short_lines_stay_as_they_are() -> None:
    t = np.arange(MOST_POINTS, dtype=float)
    kept, values = thinned(t, t**2)
    assert kept is t
    assert values.size == MOST_POINTS


def test_thinning_keeps_ends_and_extremes() -> None:
    t = np.linspace(0.0, 1.0, 50_000)
    y = np.sin(40.0 * t)
    y[31_234], y[17] = 9.0, -9.0
    kept, values, other = thinned(t, y, 2.0 * y)
    assert len(kept) <= MOST_POINTS + 2
    assert (kept[0], kept[-1]) == (0.0, 1.0)
    assert (values.max(), values.min()) == (9.0, -9.0)
    assert np.all(np.diff(kept) > 0.0)
    np.testing.assert_array_equal(other, 2.0 * values)


def test_a_line_is_broken_where_the_readings_pause_and_not_between_slow_ones() -> None:
    t = np.arange(100) / 10.0
    y = np.where(np.arange(100) % 2, np.nan, 1.0)  # every other row
    y[40] = np.nan  # one lost sample
    y[60:72] = np.nan
    at, line = unbridged(t, y)
    assert np.flatnonzero(np.isnan(line)).tolist() == [29]
    assert (at[28], at[30]) == (5.8, 7.2)
    assert all(len(x) == 0 for x in unbridged(t, np.full(100, np.nan)))


def test_the_band_of_the_track_ends_with_its_first_turn() -> None:
    turning = pd.DataFrame({"heading_rad_simulated": 3.0 + 0.1 * np.arange(200)})
    assert _once_round(turning).sum() == 63  # 2 pi / 0.1
    assert _once_round(-turning).sum() == 63
    assert _once_round(pd.DataFrame({"time_s": range(5)})).all()


def test_thinning_keeps_holes() -> None:
    t = np.arange(40_000, dtype=float)
    y = np.sin(t)
    y[20_000:24_000] = np.nan
    kept, values = thinned(t, y)
    inside = (kept >= 20_000) & (kept < 24_000)
    assert inside.any() and np.isnan(values[inside]).all()
    assert np.isfinite(values[~inside]).all()


def test_thinning_of_nothing_but_holes() -> None:
    t = np.arange(40_000, dtype=float)
    kept, values = thinned(t, np.full_like(t, np.nan))
    assert len(kept) <= 2 * MOST_POINTS
    assert np.isnan(values).all()


def test_limits_show_what_must_be_seen_and_cut_the_rest() -> None:
    low, high = limits(np.array([0.0, 1.0, np.nan]), np.array([1e200, -0.1, np.inf]))
    assert low < -0.1 and high > 1.0  # both seen
    assert low > -0.5 and high < 2.0  # the line that runs away does not flatten them
    assert limits(np.array([np.nan]), np.array([])) == (0.0, 1.0)
    low, high = limits(np.full(3, 5.0), np.array([]))
    assert low < 5.0 < high


def test_only_a_trial_with_gaps_shows_some() -> None:
    whole = trial()
    table = whole.table.copy()
    table.loc[200:250, "record"] = -1
    broken = Trial.from_table("bay", table, 10.0)
    with style():
        assert ">gap<" not in timeline([whole], [maneuver()], "a")
        assert ">gap<" in timeline([broken], [maneuver()], "a")


def test_held_out_maneuvers_are_hatched() -> None:
    def hatches(role: str) -> int:
        with style():
            text = timeline([trial()], [maneuver(role=role)], "a")
        return text.count("url(#a-hatch")

    assert hatches("validate") == hatches("identify") + 1  # besides that of the legend


def test_trials_end_to_end_keep_their_maneuvers() -> None:
    trials = [trial("a", 1000.0), trial("b", 50.0), trial("c", 0.0)]
    marks = [maneuver("b", 60.0), maneuver("c", 5.0), maneuver("elsewhere", 5.0)]
    whole, moved = joined(trials, marks)
    time = whole.table["time_s"].to_numpy()
    assert time[0] == 0.0
    assert np.all(np.diff(time) > 0.0)
    assert [m.id for m in moved] == ["b-turn-1", "c-turn-1"]
    row = np.searchsorted(time, moved[0].t_start_s)
    assert whole.table["heading_rad"].iloc[row] == pytest.approx(0.1 * 10.0, abs=0.011)
    assert moved[0].t_end_s - moved[0].t_start_s == pytest.approx(30.0)
    with style():
        text = timeline(trials, marks, "a")
    assert "b-turn-1" in text and "c-turn-1" in text and "elsewhere" not in text


def test_a_dive_has_its_pitch_at_a_glance_and_a_turn_has_none() -> None:
    level = trial()
    dives = level.with_table(level.table.assign(pitch_rad=0.1, q_radps=0.0, elevator_rad=0.1))
    diving = maneuver().model_copy(update={"plane": "vertical", "planes": ("vertical",)})
    with style():
        assert ">pitch, deg<" in timeline([dives], [diving], "a")
        assert ">pitch, deg<" not in timeline([dives], [maneuver()], "a")


def test_few_trials_stand_apart() -> None:
    trials = [trial(str(i)) for i in range(5)]
    assert [len(g) for g in groups(trials[:2], apart=2, together=3)] == [1, 1]
    assert [len(g) for g in groups(trials, apart=2, together=3)] == [3, 2]


def test_dead_reckoning_of_a_straight_run_ends_where_it_should() -> None:
    from auvident.report.figures_trial import _positions

    straight = trial()
    straight.table["heading_rad"], straight.table["u_mps"] = np.pi / 2.0, 2.0
    found = _positions(straight)
    assert found is not None
    assert found[1][-1] == pytest.approx(2.0 * 60.0)  # east
    assert found[0][-1] == pytest.approx(0.0, abs=1e-9)
    with style():
        assert (
            track(
                [Trial.from_table("x", straight.table.drop(columns="heading_rad"), 10.0)], [], "a"
            )
            is None
        )


def metrics() -> ManeuverMetrics:
    channel = ChannelMetrics(rmse=0.00474, nrmse=0.2, r2=0.9, theil=0.1, unit="m/s", samples=9)
    return ManeuverMetrics(
        id="m", trial="bay", kind="turn", role="validate", duration_s=60.0, channels={"u": channel}
    )


def simulation() -> pd.DataFrame:
    t = np.arange(600) / 10.0
    columns = {"time_s": 5.0 + t, "control_rad": 0.1 + 0.0 * t, "rpm": 900.0 + 0.0 * t}
    for stem in ("u_mps", "v_mps", "r_radps", "heading_rad"):
        for ending in ("measured", "simulated", "ase"):
            columns[f"{stem}_{ending}"] = np.sin(t / 9.0)
    return pd.DataFrame(columns)


def test_numbers_in_a_figure_are_not_shortened_with_its_coordinates() -> None:
    with style():
        text = prediction(simulation(), metrics(), None, "a")
    assert "RMSE 0.00474\u00a0m/s" in text
    assert not re.search(r'd="[^"]*\d\.\d{3}', text)


def test_the_share_of_the_readings_in_the_band_is_told() -> None:
    table = simulation()
    table["u_mps_lo"], table["u_mps_hi"] = table["u_mps_measured"] - 0.1, table["u_mps_measured"]
    table.loc[:149, "u_mps_measured"] += 0.2  # a quarter lies above the band
    assert covered(table, ["u_mps"]) == 0.75
    assert covered(table, ["v_mps"]) is None
    table.loc[150:299, "u_mps_measured"] = np.nan  # what was not read is not counted
    assert covered(table, ["u_mps"]) == pytest.approx(300 / 450)
    with style():
        text = prediction(table, metrics(), None, "a")
    assert "67\u00a0% in the band" in text
    label = text.split('aria-label="')[1].split('"')[0]
    assert label.startswith("Held-out turn m, 60 s, predicted; RMSE u 0.0047")
    assert "holds 67\u00a0% of the readings" in label


def test_the_band_across_the_track_turns_one_way_and_is_as_wide_as_its_ends() -> None:
    t = np.linspace(0.0, 20.0, 400)
    table = pd.DataFrame({"north": 30.0 * np.sin(t), "east": 30.0 * np.cos(t)})
    ends = {f"{a}_m_{e}": table[a] + s for a in table for e, s in (("lo", -2.0), ("hi", 2.0))}
    quads = _ribbon(pd.DataFrame(ends))
    first, second = quads[:, 2] - quads[:, 0], quads[:, 3] - quads[:, 1]
    assert np.all(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0] >= 0.0)
    radius = np.hypot(*quads.reshape(-1, 2).T)
    np.testing.assert_allclose([radius.min(), radius.max()], [28.0, 32.0], atol=0.1)


@pytest.mark.parametrize("wild", [np.nan, 1e200, np.inf])
def test_an_estimate_that_runs_away_leaves_the_figure_readable(wild: float) -> None:
    table = simulation()
    for stem in ("u_mps", "v_mps", "r_radps", "heading_rad"):
        table.loc[300:, f"{stem}_ase"] = wild
    with style():
        text = prediction(table, metrics(), metrics(), "a")
    assert "nan" not in text and "e+" not in text


def test_a_coefficient_far_from_its_prior_is_said_with_its_distance() -> None:
    near = ModelCoefficient(
        symbol="Y_uv",
        value=-50.0,
        std=5.0,
        unit="kg/m",
        prime=-0.05,
        prior=-50.0,
        prior_std=10.0,
        origin="identified",
        data_share=0.75,
    )
    far = near.model_copy(update={"symbol": "N_uv", "value": 50.0})
    with style():
        assert "+10.0" in forest([near, far], "a")
        assert "+10.0" not in forest([near], "a")


def test_two_figures_of_a_page_share_no_identifier() -> None:
    def identifiers(name: str) -> set[str]:
        with style():
            figure = new_figure(2.0)
            figure.subplots().plot([0.0, 1.0], [0.0, 1.0], "o")
            return set(re.findall(r'id="([^"]*)"', svg(figure, name, "line")))

    assert identifiers("a") and not identifiers("a") & identifiers("b")
