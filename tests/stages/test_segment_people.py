"""Maneuvers as people steer them: unequal executes, creeping rudders, cut and eased ends."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from segment_world import DEG, Sail, Ship

from auvident.errors import InputError
from auvident.schema.artifacts import Maneuvers
from auvident.stages.segment import segment

SHIP = Ship()
EDGE_S = 0.31  # the running median and the logger's interval


def under_way(ship: Ship = SHIP, seed: int = 0) -> Sail:
    """A trial at cruise speed on a course, with a run that identifies surge."""
    s = Sail(ship, np.random.default_rng(seed))
    s.u = ship.cruise_mps
    s.straight([700, 1000, 850], [30, 25, 30], kept=False)
    s.steer(40, ship.cruise_rpm, s.psi, 0.9, 12 * DEG)
    return s


def zigzag(s: Sail, angles: Sequence[float], switch: float, creep: float = 0.0) -> None:
    """Executes of these angles [deg], each until the heading passes the switch [deg].

    A creeping rudder begins each hold at a share `1 - creep` of its angle.
    """
    start, psi = s.time, s.psi
    for angle in angles:
        began = s.time
        while -np.sign(angle) * (s.psi - psi) < switch * DEG:
            share = 1.0 - creep * np.exp(-(s.time - began) / 2.0)
            s.step(share * angle * DEG, 900)
    s.note("zigzag", start)


def zigzags(result: Maneuvers):
    return [m for m in result.maneuvers if m.kind == "zigzag"]


def away(s: Sail, degrees: float = 60.0) -> None:
    """An autopilot goes to another course and stays there."""
    s.steer(40, 900, s.psi + degrees * DEG, 0.9, 12 * DEG)


@pytest.mark.parametrize("other", [0.5, 0.6, 0.76, 1.0, 1.35, 1.6, 2.0])
@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("course", [-60, 60])
def test_executes_of_unequal_size_are_one_zigzag(other, side, course):
    s = under_way()
    angles = [side * a for a in (10, -10 * other, 10, -10 * other, 10, -10 * other)]
    zigzag(s, angles, 10)
    away(s, course)
    (found,) = zigzags(segment([s.trial()]))
    _, start, end = s.truth[-1]
    assert found.t_start_s == pytest.approx(start, abs=EDGE_S)
    assert found.t_end_s == pytest.approx(end, abs=EDGE_S)
    assert found.features["executes"] == len(angles)
    assert found.features["rudder_deg"] == pytest.approx(5 * (1 + other), abs=0.1)


@pytest.mark.parametrize(
    "angles", [(18, -22, 20, -17, 23, -19), (10, -14, 12, -16, 13), (-12, 9, -14, 11, -10, 13)]
)
def test_no_two_executes_need_be_equal(angles):
    s = under_way()
    zigzag(s, angles, 10)
    s.fixed(10, 900)
    away(s)
    (found,) = zigzags(segment([s.trial()]))
    assert found.t_start_s == pytest.approx(s.truth[-1][1], abs=EDGE_S)
    assert found.t_end_s == pytest.approx(s.truth[-1][2], abs=EDGE_S)
    assert found.features["executes"] == len(angles)


@pytest.mark.parametrize("other", [2.5, 4.0])
def test_angles_that_differ_by_more_are_refused_with_their_ratio(other):
    s = under_way()
    zigzag(s, [8, -8 * other] * 3, 10)
    away(s)
    result = segment([s.trial()])
    assert not zigzags(result)
    _, start, end = s.truth[-1]
    said = [r for r in result.rejected if r.t_start_s < end and start < r.t_end_s]
    reasons = [(r.value, r.threshold) for r in said if "different orders" in r.reason]
    assert reasons
    assert reasons[0] == (pytest.approx(other, rel=0.01), 2.0)


@pytest.mark.parametrize("left_s", [0.2, 0.4, 1.0, 3.0])
@pytest.mark.parametrize("other", [1.0, 0.7])
@pytest.mark.parametrize("slew_degps", [np.inf, 10])
def test_a_record_that_ends_in_the_third_execute_has_a_zigzag(left_s, other, slew_degps):
    s = under_way(replace(SHIP, slew_degps=slew_degps))
    zigzag(s, [15, -15 * other], 15)
    travel_s = 0.0 if np.isinf(slew_degps) else 15 * (0.6 + other) / slew_degps
    s.fixed(travel_s + left_s, 900, 15 * DEG)
    (found,) = zigzags(segment([s.trial()]))
    assert found.features["executes"] == 3
    assert found.t_end_s == pytest.approx(s.rows[-1][0], abs=EDGE_S)


@pytest.mark.parametrize("creep", [0.2, 0.3, 0.4])
@pytest.mark.parametrize("other", [1.0, 0.75])
def test_a_rudder_that_creeps_within_its_holds(creep, other):
    """By 2 to 8 degrees, as a servo under load does; its command would be constant."""
    s = under_way(replace(SHIP, rudder_noise_deg=0.1))
    zigzag(s, [20, -20 * other] * 3, 20, creep)
    away(s)
    (found,) = zigzags(segment([s.trial()]))
    assert found.t_start_s == pytest.approx(s.truth[-1][1], abs=EDGE_S)
    assert found.t_end_s == pytest.approx(s.truth[-1][2], abs=EDGE_S)
    assert found.features["executes"] == 6


@pytest.mark.parametrize("angles", [(15, -15), (15, -8), (10, -12)])
def test_two_executes_and_an_autopilot_that_comes_back_are_no_zigzag(angles):
    s = under_way()
    course = s.psi
    zigzag(s, angles, 15)
    s.steer(40, 900, course, 0.9, 8 * DEG)
    result = segment([s.trial()])
    assert not zigzags(result)
    assert any(r.reason.startswith("zigzag") for r in result.rejected)


@pytest.mark.parametrize("other", [1.0, 1.4])
def test_an_autopilot_that_goes_to_another_course_is_no_execute(other):
    s = under_way()
    zigzag(s, [10, -10 * other, 10, -10 * other, 10], 10)
    away(s, 120)
    (found,) = zigzags(segment([s.trial()]))
    assert found.t_end_s == pytest.approx(s.truth[-1][2], abs=EDGE_S)
    assert found.features["executes"] == 5


def test_every_rudder_to_both_sides_has_its_reason():
    s = under_way()
    spans = []
    for angles in ((15, -15), (6, -20), (5, -18, 5)):
        zigzag(s, angles, 10)
        spans.append(s.truth[-1][1:])
        away(s)
    rejected = [r for r in segment([s.trial()]).rejected if r.reason.startswith("zigzag")]
    for start, end in spans:
        assert any(r.t_start_s < end and start < r.t_end_s for r in rejected)


def circle(s: Sail, degrees: float, creep_deg: float, ease_s: float) -> None:
    """A turn whose rudder creeps while it is held, and is eased off slowly."""
    start, psi, began = s.time, s.psi, s.time
    while abs(s.psi - psi) < degrees * DEG:
        s.step((12 + creep_deg * np.cos(0.5 * (s.time - began))) * DEG, 900)
    s.note("turn", start)
    for share in np.linspace(1, 0, max(1, round(ease_s * s.ship.rate_hz))):
        s.step(12 * share * DEG, 900)


@pytest.mark.parametrize(("creep_deg", "ease_s"), [(0.0, 6.0), (1.5, 0.5), (1.5, 6.0)])
def test_half_a_circle_at_a_steady_rate_is_a_turn(creep_deg, ease_s):
    s = under_way()
    circle(s, 240, creep_deg, ease_s)
    s.steer(40, 900, s.psi, 0.9, 12 * DEG)
    (turn,) = [m for m in segment([s.trial()]).maneuvers if m.kind == "turn"]
    _, start, end = s.truth[-1]
    assert turn.t_start_s == pytest.approx(start, abs=EDGE_S)
    assert end - EDGE_S < turn.t_end_s < end + 0.5 * ease_s + EDGE_S


@pytest.mark.parametrize("before", [40, 80])
def test_a_course_order_out_of_a_turn_to_the_other_side_is_no_turn(before):
    """The rudder first takes back what the vehicle still turns."""
    ship = replace(SHIP, lag_s=4.0, gain=-0.35)
    s = under_way(ship)
    s.fixed(before / 4, 900, -12 * DEG)
    course = s.psi - 150 * DEG
    s.steer(90, 900, course, 0.9, 12 * DEG)
    assert not [m for m in segment([s.trial()]).maneuvers if m.kind == "turn"]


def test_a_log_of_two_executes_says_what_was_missing():
    s = Sail(SHIP, np.random.default_rng(0))
    s.u = SHIP.cruise_mps
    s.fixed(20, 900)
    zigzag(s, (15, -15), 15)
    s.fixed(20, 900)
    with pytest.raises(InputError, match="too few rudder executes"):
        segment([s.trial()])
