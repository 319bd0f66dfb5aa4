"""Maneuvers on the command line: what is read, and what is refused with what it could be."""

import pytest

from auvident.errors import UsageError
from auvident.schema.desk import MANEUVERS, desk_order


@pytest.mark.parametrize("row", MANEUVERS, ids=lambda row: row.name)
def test_a_name_alone_has_its_defaults(row: object) -> None:
    order = desk_order(row.name)  # type: ignore[attr-defined]
    assert order.row is row
    assert order == desk_order(order.text)
    assert order.text == row.usual  # type: ignore[attr-defined]


def test_numbers_stand_behind_the_colon() -> None:
    assert desk_order("zigzag:-20/10").values == (-20.0, 10.0)
    assert desk_order("zigzag:20").values == (20.0, 10.0)
    assert desk_order("depth-step:-2.5").parameters == {"depth_m": -2.5}


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("zigzg:10/10", "zigzag"),
        ("", "turning-circle"),
        ("zigzag:10/10/5", "2 of them"),
        ("zigzag:ten", "'ten' is not a number"),
        ("zigzag:", "'' is not a number"),
        ("zigzag:nan", "0.1 to 45 deg"),
        ("zigzag:90/10", "0.1 to 45 deg"),
        ("zigzag:10/-10", "heading takes no sign"),
        ("turning-circle:0", "0.1 to 45 deg"),
        ("spiral:-25", "no sign"),
    ],
)
def test_what_cannot_be_flown_is_refused(text: str, word: str) -> None:
    with pytest.raises(UsageError) as caught:
        desk_order(text)
    assert word in str(caught.value)
    assert caught.value.exit_code == 2
    assert caught.value.remedy
