"""What many trials take is calculated from what a few took; growth from two sizes."""

import pytest

from tests.bench.campaign_cost import A_VEHICLE, calculated
from tests.bench.length import GROWING, exponents

PARTS = {
    "in a campaign s": 36.0,
    f"pooling {A_VEHICLE} s": 72.0,
    "log MiB": 2.0,
    "run directory MiB": 1.0,
    "model KiB": 100.0,
}


def test_what_many_trials_take_is_that_of_each_and_of_pooling_each_vehicle() -> None:
    found = calculated(PARTS, 100 * A_VEHICLE)  # 100 vehicles: 200 h of trials, 2 h of pooling
    assert (found["processor hours"], found["of it pooling h"]) == ("202", "2")
    assert (found["h on 2"], found["logs GB, read"]) == ("101", "41.9")
    few = calculated(PARTS, A_VEHICLE // 2)
    assert few["of it pooling h"] == "0.01"


def test_an_exponent_of_one_is_growth_in_step() -> None:
    rows = [{"maneuvers": n, **dict.fromkeys(GROWING, 0.1 * n)} for n in (6, 24, 96)]
    rows[-1]["ingest_s"] = 0.1 * 24 * 16.0  # by the square of 4
    found = exponents(rows)
    assert [row["maneuvers"] for row in found] == ["6 to 24", "24 to 96", "6 to 96"]
    assert [row["ingest"] for row in found] == pytest.approx([1.0, 2.0, 1.5])
    assert {row["segment"] for row in found} == {1.0}
