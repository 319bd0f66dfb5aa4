"""What many trials take is calculated from what a few took; growth from two sizes."""

import pytest

from auvident.schema.changes import LeftOutTrialError
from tests.bench.campaign_cost import A_VEHICLE, calculated
from tests.bench.length import GROWING, exponents
from tests.bench.season import against_own, by_change, in_model

PARTS = {
    "in a campaign s": 36.0,
    f"pooling {A_VEHICLE} s": 52.0,
    f"predicting {A_VEHICLE} again s": 20.0,
    "log MiB": 2.0,
    "run directory MiB": 1.0,
    "model KiB": 100.0,
    "maneuvers MiB": 0.1,
}


def test_what_many_trials_take_is_that_of_each_and_of_pooling_each_vehicle() -> None:
    found = calculated(PARTS, 100 * A_VEHICLE)  # 100 vehicles: 200 h of trials, 2 h of pooling
    assert (found["processor hours"], found["of it pooling h"]) == ("202", "2")
    assert (found["h on 2"], found["logs GB, read"]) == ("101", "41.9")
    few = calculated(PARTS, A_VEHICLE // 2)
    assert few["of it pooling h"] == "0.01"


def test_trials_left_out_are_counted_by_channel() -> None:
    pairs = [("u", 1.0, 2.0), ("u", 1.05, 1.0), ("u", 7.0, 1.0), ("r", 0.3, 0.3)]
    errors = [
        LeftOutTrialError(trial="t", channel=c, unit="m/s", pooled=pooled, own=own)
        for c, pooled, own in pairs
    ]
    surge, turn = against_own(errors)
    assert (surge["channel"], surge["trials"], turn["trials"]) == ("u", 3, 1)
    assert (surge["not worse"], turn["not worse"]) == ("33%", "100%")
    assert surge["by 10% at most"] == "67%"
    assert surge["median of pooled over own"] == pytest.approx(1.05)
    assert surge["rms own"] == pytest.approx(2.0**0.5)


def test_trials_since_a_change_are_told_beside_what_they_are_if_it_is_ignored() -> None:
    errors = [{"r": (0.9, 4.0)}, {"r": (1.2, 3.0)}, {"r": (0.8, 7.0)}]
    row = by_change("alba", "r", errors)
    assert (row["vehicle"], row["channel"], row["trials"]) == ("alba", "r", 3)
    assert (row["median of pooled over own"], row["largest"]) == (0.9, 1.2)
    assert row["median, changes ignored"] == 4.0


def test_an_exponent_of_one_is_growth_in_step() -> None:
    rows = [{"maneuvers": n, **dict.fromkeys(GROWING, 0.1 * n)} for n in (6, 24, 96)]
    rows[-1]["ingest_s"] = 0.1 * 24 * 16.0  # by the square of 4
    found = exponents(rows)
    assert [row["maneuvers"] for row in found] == ["6 to 24", "24 to 96", "6 to 96"]
    assert [row["ingest"] for row in found] == pytest.approx([1.0, 2.0, 1.5])
    assert {row["segment"] for row in found} == {1.0}


def test_fouling_is_a_smaller_share_of_what_the_model_has_in_its_drag() -> None:
    """The part of the thrust that falls with the square of the speed is in it as well."""
    truth = {"happening": "fouling", "size": 0.3, "trials": [{"seed": 1000}]}
    assert 0.15 < in_model("brio", truth) < 0.25
    assert in_model("alba", {"happening": "bent fin", "size": 0.2}) == -0.2
