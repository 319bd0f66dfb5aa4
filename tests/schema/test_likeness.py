"""Effects that look like each other: a group is a row of one table and a column of another."""

from dataclasses import replace

import pytest

from auvident.schema import effects, likeness
from auvident.schema.effects import BY_MANEUVERS, EFFECTS, LIKENESSES, Effect
from auvident.schema.likeness import (
    TELLS_MOST,
    TELLS_MOST_VERTICAL,
    alike,
    partners,
    separated_by,
)
from auvident.schema.planes import PLANES, Plane
from auvident.stages.diagnose.select.screen import short_list

PAIR = ("gyro_bias", "gyro_scale")  # in no group so far


def alike_in(plane: Plane) -> list[Effect]:
    """Effects of a plane that are in a group."""
    return [e for e in EFFECTS if e.alike and plane in e.planes]


@pytest.mark.parametrize("plane", PLANES)
def test_every_group_has_its_row_and_every_row_its_effects(plane) -> None:
    groups, there = BY_MANEUVERS[plane], alike_in(plane)
    assert {e.alike for e in there} == set(groups)
    assert all(sum(e.alike == group for e in there) >= 2 for group in groups)


def test_no_effect_looks_like_one_of_the_other_plane_alone() -> None:
    assert partners("rudder_backlash") == ("rudder_deadband",)
    assert partners("elevator_backlash") == ("elevator_deadband",)
    assert set(partners("dvl_delay")) >= {"rudder_lag", "elevator_lag", "gyro_delay"}
    assert set(partners("thrust_line_moment")) == {"elevator_offset", "hull_asymmetry"}


def test_an_effect_of_no_group_looks_like_none() -> None:
    assert alike(PAIR[0]) == () == partners(PAIR[0])
    assert separated_by(PAIR) == TELLS_MOST


def test_a_new_group_is_a_change_of_the_table_of_effects_alone(monkeypatch) -> None:
    """Everything that asks for look-alikes, the short list of a search among it, knows it then."""
    table = tuple(replace(e, alike="gyro") if e.id in PAIR else e for e in EFFECTS)
    for module in (effects, likeness):
        monkeypatch.setattr(module, "EFFECTS", table)
    for e in table:
        monkeypatch.setitem(effects.BY_ID, e.id, e)
    monkeypatch.setitem(LIKENESSES, "gyro", "turns to both sides")
    assert partners(PAIR[0]) == PAIR[1:]
    assert separated_by(PAIR) == "turns to both sides"
    assert short_list({PAIR[0]: 50.0, PAIR[1]: 1.0}, {}) == PAIR


def test_a_pair_of_two_groups_needs_what_tells_most() -> None:
    assert separated_by(("rudder_lag", "rudder_stall")) == TELLS_MOST
    assert separated_by(("elevator_lag", "elevator_stall"), "vertical") == TELLS_MOST_VERTICAL


@pytest.mark.parametrize(
    ("plane", "group"), [(plane, group) for plane in PLANES for group in BY_MANEUVERS[plane]]
)
def test_a_group_is_told_apart_by_its_own_maneuvers(plane, group) -> None:
    own = [e.id for e in alike_in(plane) if e.alike == group]
    assert separated_by(own, plane) == BY_MANEUVERS[plane][group]
