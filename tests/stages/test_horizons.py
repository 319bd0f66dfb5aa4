"""How far held-out maneuvers extrapolate, and errors of predictions over short horizons."""

from types import SimpleNamespace

import numpy as np
import pytest

from auvident.engines.flown import beyond_in_turn
from auvident.engines.predictive import Band
from auvident.engines.records import Record
from auvident.report.held_out_words import beyond
from auvident.schema.artifacts import Maneuver, Maneuvers
from auvident.stages.validate.horizons import windows_of
from auvident.stages.validate.stage import drawn_lost, windows_lost
from tests.engines.chain import sample, validated


def record(name: str, rudder_deg: float, rate_degps: float, speed: float) -> Record:
    n = 200
    inputs = np.column_stack([np.full(n, np.radians(-rudder_deg)), np.zeros(n), np.full(n, 20.0)])
    given = np.column_stack(
        [np.full(n, speed), np.zeros(n), np.full(n, np.radians(rate_degps)), np.zeros(n)]
    )
    return Record(name, np.arange(n) * 0.1, inputs, given, given.copy(), given[0])


def test_a_held_out_maneuver_that_goes_further_says_by_what() -> None:
    others = [record("a", 15.0, 4.0, 1.5), record("b", 10.0, 5.0, 2.0)]
    found = beyond_in_turn([record("z", 25.0, 5.1, 1.0)], others, "horizontal")["z"]
    assert set(found) == {"rudder", "u_low"}  # 2 % more of the rate is the same
    assert np.degrees(found["rudder"].reaches) == pytest.approx(25.0)
    assert np.degrees(found["rudder"].identified) == pytest.approx(15.0)
    assert (found["u_low"].reaches, found["u_low"].identified) == (1.0, 1.5)
    (line,) = beyond({"z": found, "within": {}})
    assert line.replace("\u00a0", " ") == (
        "z goes beyond the maneuvers used for identification: 25 deg of rudder (15 deg there), "
        "slows to 1.0 m/s (1.5 m/s there)"
    )


def test_a_held_out_maneuver_within_the_range_says_nothing() -> None:
    others = [record("a", 15.0, 4.0, 1.5), record("b", 10.0, 5.0, 2.0)]
    assert beyond_in_turn([record("z", 12.0, 4.5, 1.8)], others, "horizontal") == {"z": {}}
    assert beyond({"z": {}}) == []
    assert beyond_in_turn(others, [], "horizontal") == {}


def test_windows_cover_the_held_out_maneuvers_and_leave_the_rest() -> None:
    parts = {"trial": "t", "kind": "turn", "plane": "horizontal", "planes": ("horizontal",)}
    held = Maneuver(id="a", t_start_s=10.0, t_end_s=27.0, role="validate", **parts)
    used = Maneuver(id="b", t_start_s=40.0, t_end_s=80.0, role="identify", **parts)
    cut = windows_of(Maneuvers(maneuvers=(held, used)), 5.0).maneuvers
    assert [(m.id, m.t_start_s, m.t_end_s) for m in cut] == [
        ("a", 10.0, 15.0),
        ("a", 15.0, 20.0),
        ("a", 20.0, 25.0),
    ]


def test_a_maneuver_of_just_three_windows_has_three_of_them() -> None:
    """16.4 - 1.4 is less than 15 in the last digit of a binary number."""
    parts = {"trial": "t", "kind": "turn", "plane": "horizontal", "planes": ("horizontal",)}
    start = 14 * 0.1
    held = Maneuver(id="a", t_start_s=start, t_end_s=16.4, role="validate", **parts)
    assert held.t_end_s - held.t_start_s < 15.0
    assert len(windows_of(Maneuvers(maneuvers=(held,)), 5.0).maneuvers) == 3


def test_a_short_horizon_has_the_smaller_error_of_what_adds_up() -> None:
    metrics = validated("harbour_trial").metrics
    free, (short, long) = metrics.summary["validate"], metrics.horizons.values()
    assert list(metrics.horizons) == ["5", "20"]
    for channel in ("heading", "track"):
        assert short[channel].rmse < long[channel].rmse < free[channel].rmse
    for channel, m in short.items():  # over the same standard deviation
        ratio = m.rmse / free[channel].rmse
        assert m.nrmse / free[channel].nrmse == pytest.approx(ratio)


def test_every_held_out_maneuver_of_a_sample_is_looked_at() -> None:
    held = {m.id for m in sample("harbour_trial").maneuvers.maneuvers if m.role == "validate"}
    assert set(validated("harbour_trial").metrics.extrapolation) == held


def test_windows_whose_prediction_diverges_are_told() -> None:
    good, lost = SimpleNamespace(ran_away=False), SimpleNamespace(ran_away=True)
    (finding,) = windows_lost({"5": [good] * 9, "20": [good, lost, good]})
    assert (finding.code, finding.where, finding.value) == ("window-ran-away", "20 s", 1.0)
    assert finding.message.startswith("the prediction diverges in 1 of 3 windows")


def test_models_drawn_for_a_band_that_diverge_are_told() -> None:
    two = [SimpleNamespace(maneuver=SimpleNamespace(id=name)) for name in ("turn", "zigzag")]
    (finding,) = drawn_lost(two, [Band({}), Band({}, ran_away=39)])
    assert (finding.code, finding.where, finding.value) == ("drawn-models-run-away", "zigzag", 39.0)
    assert finding.message.startswith("39 of 64 models drawn for the band diverge")
