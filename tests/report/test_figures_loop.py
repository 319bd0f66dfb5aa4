"""What the figures of the residual loop choose to draw, and what they bear."""

import numpy as np
import pandas as pd
import pytest

from auvident.report.figures import style
from auvident.report.figures_forces import BINS, binned, unknown_force
from auvident.report.figures_loop import before_after, gains, most_affected, moves, squared_falls
from auvident.schema.diagnosis import Candidate, CoefficientComparison

SECONDS = np.arange(200) / 10.0


def rows(maneuver: str, role: str, **wrong: float) -> pd.DataFrame:
    """A maneuver whose prediction before is off by so much; after it is right."""
    table: dict = {
        "maneuver": maneuver,
        "trial": "bay",
        "kind": "turn",
        "role": role,
        "time_s": SECONDS,
    }
    for column in ("u_mps", "v_mps", "r_radps"):
        measured = np.sin(SECONDS)
        table |= {
            f"{column}_measured": measured,
            f"{column}_after": measured,
            f"{column}_before": measured + wrong.get(column, 0.0),
        }
    return pd.DataFrame(table)


@pytest.fixture
def table() -> pd.DataFrame:
    return pd.concat(
        [
            rows("turn-1", "identify", v_mps=0.1),
            rows("turn-2", "identify", v_mps=0.5, u_mps=0.3),
            rows("turn-3", "validate", v_mps=0.2),
            rows("turn-4", "validate", v_mps=0.05),
        ],
        ignore_index=True,
    )


def test_the_fall_of_the_residual_is_that_of_its_square(table: pd.DataFrame) -> None:
    falls = squared_falls(table)
    spread = table["v_mps_measured"].var()
    assert falls.loc["turn-2", "v_mps"] == pytest.approx(0.25 / spread)
    assert falls.loc["turn-1", "u_mps"] == 0.0
    assert list(falls) == ["u_mps", "v_mps", "r_radps"]


def test_the_most_affected_are_drawn_one_held_out_and_one_that_identified(
    table: pd.DataFrame,
) -> None:
    channels, maneuvers = most_affected(squared_falls(table), table)
    assert channels == ["v_mps", "u_mps"]  # r did not change
    assert maneuvers == ["turn-3", "turn-2"]
    only = table[table["role"] == "identify"]
    assert most_affected(squared_falls(only), only)[1] == ["turn-2", "turn-1"]


def test_without_a_change_the_largest_residual_is_drawn(table: pd.DataFrame) -> None:
    same = table.assign(**{f"{c}_after": table[f"{c}_before"] for c in ("u_mps", "v_mps")})
    assert squared_falls(same).loc["turn-2", "u_mps"] == pytest.approx(
        0.09 / table["u_mps_measured"].var()
    )
    bare = table.drop(columns=[c for c in table if c.endswith("_after")])
    with style():
        text = before_after(bare, "figure")
        none_named = before_after(table, "figure", effects=False)
        named = before_after(table, "figure")
    assert text and "predicted, identified model" in text and "with the effects" not in text
    assert none_named and "with the effects" not in none_named
    assert named and "with the effects" in named


def test_holes_and_foreign_columns_do_no_harm(table: pd.DataFrame) -> None:
    table.loc[::3, "u_mps_measured"] = np.nan
    with style():
        text = before_after(table.assign(note="x"), "figure")
    assert text and "turn-3 (validate)" in text and "nan" not in text.lower()
    assert before_after(table[["maneuver", "role", "time_s"]], "figure") is None


def test_bars_are_named_and_numbered() -> None:
    candidates = [
        Candidate(id="current", family="environment", gain=812.0, held_back_gain=600.0),
        Candidate(id="rudder_lag", family="actuation", gain=-0.5, rejected="gains nothing"),
    ]
    with style():
        text = gains(candidates, "gains")
    assert text and "current" in text and "812" in text and "−0.500" in text
    assert "mathdefault" not in text
    beyond = [candidates[0].model_copy(update={"held_back_gain": 246000.0})]
    with style():
        assert "100000" in (gains(beyond, "gains") or "")  # the axis reaches to the diamond
    assert gains([], "gains") is None


def test_a_coefficient_far_off_gets_an_arrow() -> None:
    row = {"unit": "kg", "prior": 0.0, "prior_std": 1.0, "before_std": 0.5, "after_std": 0.5}
    near = CoefficientComparison(symbol="N_ur", before=0.5, after=1.0, **row)  # type: ignore
    far = near.model_copy(update={"symbol": "N_uv", "after": 50.0})
    with style():
        assert "N_uv" in (moves([near, far], "moves") or "")
    given = near.model_copy(update={"prior_std": 0.0})
    assert moves([given], "moves") is None


def test_the_mean_line_follows_the_force() -> None:
    x = np.linspace(0.0, 360.0, 4000)
    middle, mean = binned(x, np.cos(np.radians(x)))
    assert len(middle) == BINS
    np.testing.assert_allclose(mean, np.cos(np.radians(middle)), atol=0.02)  # curvature in a bin
    sparse = binned(np.array([0.0, 1.0, 2.0]), np.ones(3))
    assert np.isnan(sparse[1]).all()
    assert binned(np.zeros(5), np.ones(5))[0].size == 0


def test_forces_are_drawn_against_what_is_there(table: pd.DataFrame) -> None:
    assert unknown_force(table, "forces") is None
    forces = table.assign(force_X_n=0.1, force_N_nm=np.nan, heading_rad=7.0 * np.pi)
    with style():
        text = unknown_force(forces, "forces")
    assert text and "X, N" in text and "heading, deg" in text and "yaw rate r, deg/s" in text
    assert "N, N m" not in text  # never estimated


def test_what_only_got_worse_is_drawn_as_well(table: pd.DataFrame) -> None:
    for column in ("u_mps", "v_mps", "r_radps"):
        before, after = f"{column}_before", f"{column}_after"
        table[before], table[after] = table[after], table[before]
    channels, maneuvers = most_affected(squared_falls(table), table)
    assert (channels[0], maneuvers) == ("v_mps", ["turn-3", "turn-2"])
    assert before_after(table, "worse") is not None
