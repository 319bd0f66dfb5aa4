"""What a candidate may gain as the by-product of another."""

from itertools import combinations

import pytest

from auvident.errors import NumericsError
from auvident.stages.diagnose.score.first_order import cosine, cosines, joint_about
from auvident.stages.diagnose.select.screen import apart, by_others, screen, shares_of
from tests.stages.diagnose.loop_chain import small_case, small_fit

SHARES = {
    frozenset({"current", "gyro_bias"}): 0.81,
    frozenset({"current", "linear_drag"}): 0.01,
    frozenset({"gyro_bias", "linear_drag"}): 0.0,
}
EFFECTS = ("current", "linear_drag", "gyro_bias", "rudder_rate_limit")


def test_what_looks_like_another_may_be_its_by_product() -> None:
    gains = {"current": 1000.0, "gyro_bias": 800.0, "linear_drag": 60.0}
    found = by_others(SHARES, gains)
    assert found == pytest.approx({"current": 648.0, "gyro_bias": 810.0, "linear_drag": 10.0})
    assert apart(gains, found) == ["current", "gyro_bias", "linear_drag"]
    gains = {"current": 1000.0, "gyro_bias": 400.0, "linear_drag": 19.0}
    assert apart(gains, by_others(SHARES, gains)) == ["current"]


def test_what_is_alone_is_no_by_product() -> None:
    assert by_others(SHARES, {"linear_drag": 60.0}) == {"linear_drag": 0.0}
    assert by_others(SHARES, {}) == {}


def test_likeness_of_all_pairs_is_that_of_each() -> None:
    joint = joint_about(small_case(), small_fit(), EFFECTS)
    assert joint is not None
    places = {e: joint.case.positions(e) for e in EFFECTS}
    each = {
        frozenset(p): cosine(joint, places[p[0]], places[p[1]]) for p in combinations(EFFECTS, 2)
    }
    assert cosines(joint, EFFECTS) == pytest.approx(each, abs=1e-9)


def test_a_limit_may_stand_for_anything_and_surge_is_apart_from_the_gyro() -> None:
    joint = joint_about(small_case(), small_fit(), EFFECTS)
    assert joint is not None
    shares = shares_of(joint, EFFECTS)
    assert all(share == 1.0 for pair, share in shares.items() if "rudder_rate_limit" in pair)
    assert shares[frozenset({"linear_drag", "gyro_bias"})] < 0.1


def test_a_model_at_the_edge_of_running_away_is_told(monkeypatch) -> None:
    """As one that was bent by a channel that never changes: nothing can be scored about it."""
    monkeypatch.setattr("auvident.stages.diagnose.select.screen.joint_about", lambda *_: None)
    with pytest.raises(NumericsError, match="diverges") as caught:
        screen(small_case(), small_fit(), EFFECTS)
    assert "auvident ingest" in caught.value.remedy and "turn" in caught.value.where
