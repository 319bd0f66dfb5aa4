"""One table, rendered for the terminal and for the page."""

import pytest

from auvident.report.console_style import rich_table
from auvident.report.numbers import PAGE, TERMINAL
from auvident.report.tables import (
    Cell,
    Column,
    Fixed,
    Interval,
    Joined,
    Number,
    Quantity,
    Rounded,
    Table,
    Unit,
    WithStd,
    Words,
    beside,
    change,
    columns,
    written,
)
from auvident.report.tables_loop import effects, held_out
from auvident.report.tables_loop import maneuvers as changed_maneuvers
from auvident.report.tables_run import kinds_of, maneuvers
from auvident.schema.artifacts import Maneuver
from auvident.schema.diagnosis import (
    ChannelError,
    EffectFound,
    HeldOut,
    ManeuverComparison,
    ParameterValue,
)
from tests.report.test_console import text_of

TABLE = Table(
    (Column("channel"), Column("family", on_page=True), Column("r", "rad/s", numeric=True)),
    [["r", "rates", Number(0.1, 3, "rad/s")], ["q", "rates", Number(None)]],
    title="Errors",
    mark="q",
)


def test_the_terminal_leaves_out_what_only_the_page_has_room_for() -> None:
    narrow, wide = written(TABLE, TERMINAL), written(TABLE, PAGE)
    assert narrow.heads == ("channel", "r, rad/s") and narrow.numeric == (False, True)
    assert wide.heads == ("channel", "family", "r, deg/s")
    assert narrow.rows == (("r", "0.1"), ("q", ""))
    assert wide.rows == (("r", "rates", "5.73"), ("q", "rates", "–"))
    assert narrow.marked == wide.marked == (False, True)


@pytest.mark.parametrize(
    ("cell", "terminal", "page"),
    [
        (Fixed(-4.0, "+.1f"), "-4.0", "−4.0"),
        (Fixed(None, ".1f"), "", "–"),
        (Quantity(0.1, "rad/s", 2), "0.1 rad/s", "5.7\u00a0deg/s"),
        (Quantity(None, "m"), "", "–"),
        (WithStd(-1.5, 0.25), "-1.50 ± 0.25", "−1.50 ± 0.25"),
        (WithStd(-1.5, None), "-1.5", "−1.500"),
        (Rounded(-1.5234, 0.25), "-1.52", "−1.52"),
        (Interval(-0.04, 0.01), "-0.04 to 0.01", "−0.040 to 0.010"),
        (Interval(-0.04, -0.0001), "-0.04 to -0.0001", "−0.040 to −0.00010"),
        (Interval(0.104, 0.1061, "rad/s"), "0.104 to 0.1061", "5.959 to 6.079"),
        (change(0.5, 0.25, "m/s", True), "0.5 → 0.25 *", "0.500 → 0.250 *"),
        (beside(0.5, 0.25), "0.5 (0.25)", "0.500 (0.250)"),
        (beside(0.5, None), "0.5", "0.500"),
        (Unit("rad/s"), "rad/s", "rad/s"),
        (Unit("rad/s", True), "rad/s", "deg/s"),
        (Words("a-1 -0.2"), "a-1 -0.2", "a-1 −0.2"),
        (Joined(["", "a", Number(2.0, behind=" m")]), "a, 2 m", "a, 2.00 m"),
    ],
)
def test_a_cell_in_both_styles(cell: Cell, terminal: str, page: str) -> None:
    table = Table(columns(("",)), [[cell]])
    assert written(table, TERMINAL).rows == ((terminal,),)
    assert written(table, PAGE).rows == ((page,),)


def test_a_parameter_keeps_the_unit_it_is_stated_in() -> None:
    """Sizes of effects are in the unit an engineer reads already."""
    rate = ParameterValue(symbol="omega_radps", value=1.0, std=0.1, unit="rad/s")
    table = written(
        effects([EffectFound(id="wave", family="environment", parameters=(rate,))]), PAGE
    )
    assert table.rows[0][2:5] == ("omega_radps", "rad/s", "1.00")


def test_both_show_the_same_held_out_errors_in_their_units() -> None:
    error = {"r": ChannelError(rmse=0.1, nrmse=0.2, unit="rad/s")}
    table = held_out(HeldOut(maneuvers=("turn-1",), before=error, after=error))
    terminal = text_of([rich_table(table)])
    row = next(line for line in terminal.splitlines() if line.startswith(" r "))
    assert row.split()[:4] == ["r", "rad/s", "0.1", "0.1"]
    assert "change of RMSE" not in terminal
    page = written(table, PAGE)
    assert page.rows[0][:4] == ("r", "deg/s", "5.73", "5.73")
    assert page.heads[-1] == "change of RMSE" and page.rows[0][-1] == "+0 %"


def test_a_depth_step_is_called_one_though_its_kind_is_straight() -> None:
    span = {"trial": "both", "t_start_s": 0.0, "t_end_s": 30.0, "role": "identify"}
    step = {"maneuver": "depth_step", "depth_range_m": [2.0, 5.0]}
    told = {"kind": "straight", "plane": "vertical", "planes": ("vertical",), **span}
    found = [
        Maneuver(id="both-vertical-straight-1", features=step, **told),
        Maneuver(id="both-vertical-straight-2", **told),
    ]
    called = ["depth step", "straight"]
    assert [row[1] for row in maneuvers(found).rows] == called
    errors = {"u": ChannelError(rmse=0.1, nrmse=0.2, unit="m/s")}
    compared = [
        ManeuverComparison(id=m.id, kind=m.kind, role=m.role, before=errors, after=errors)
        for m in found
    ]
    assert [row[1] for row in changed_maneuvers(compared, kinds_of(found)).rows] == called
    assert [row[1] for row in changed_maneuvers(compared).rows] == ["straight", "straight"]
