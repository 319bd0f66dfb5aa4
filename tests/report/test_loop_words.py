"""The words of the residual loop."""

import pytest

from auvident.report import loop_words as words
from auvident.report.numbers import TERMINAL
from auvident.report.tables import written
from auvident.report.tables_loop import adjusted, attempts, candidates, sight
from auvident.schema.diagnosis import (
    Attempt,
    Detectable,
    EffectFound,
    Lookalikes,
    ParameterValue,
)
from auvident.schema.loop_statements import nothing_found, nothing_known, remaining
from auvident.schema.planes import HORIZONTAL
from auvident.stages.diagnose.verdict.observability import detectable_push
from tests import loop_world


def test_an_interval_is_as_stated_else_from_the_standard_deviation() -> None:
    assert words.interval(loop_world.NORTH) == (-0.129, -0.113)
    low, high = words.interval(loop_world.EAST)
    assert (low, high) == pytest.approx((0.083 - 1.96 * 0.005, 0.083 + 1.96 * 0.005))
    half = ParameterValue(symbol="lag_s", value=0.1, std=0.1, unit="s", low=0.0)
    assert words.interval_text(half) == "0 to 0.3"


def test_a_size_has_unit_and_interval() -> None:
    assert words.size("current", loop_world.NORTH) == "north_mps -0.121 m/s (-0.129 to -0.113)"
    bare = ParameterValue(symbol="gain", value=0.2, std=0.01, unit="-")
    assert words.size("rudder_asymmetry", bare) == "gain 0.2 (0.18 to 0.22)"
    screened = bare.model_copy(update={"std": None})  # a size without an interval
    assert words.size("rudder_asymmetry", screened) == "gain 0.2"
    late = ParameterValue(symbol="time_s", value=1358.5, std=0.5, unit="s", low=1357.5, high=1359.5)
    assert words.size("weight_change", late) == "time_s 1358.5 s (1357.5 to 1359.5)"


def test_a_limit_that_may_be_none_is_told_by_the_least_that_it_may_be() -> None:
    """A stall whose inverse square is near zero was told at 331 deg, -12636 to 13298."""
    values = {
        "rudder_stall": ("angle_deg", 330.8, 6616.0, "deg"),
        "rudder_rate_limit": ("rate_degps", 80.0, 20.0, "deg/s"),
        "rudder_delay": ("delay_s", -0.017, 0.016, "s"),
        "linear_drag": ("X_u", -0.4, 0.0, "kg/s"),
    }
    found = [
        EffectFound(
            id=name,
            family="actuation",
            parameters=(ParameterValue(symbol=symbol, value=value, std=std, unit=unit),),
        )
        for name, (symbol, value, std, unit) in values.items()
    ]
    rows = {row[0]: row[3:] for row in written(adjusted(found), TERMINAL).rows}
    assert rows["rudder_stall"] == ("≥ 37", "")
    assert rows["rudder_rate_limit"] == ("80", "54 to 157")  # 80 / (1 +- 1.96 x 0.25)
    assert rows["rudder_delay"] == ("-0.017", "-0.048 to 0.014")
    assert rows["linear_drag"] == ("-0.4", "")


def test_the_place_of_an_effect_of_one_time() -> None:
    assert words.place(loop_world.EVENT) == "harbour_trial-turn-2 at 431.5 s for 6.0 s"
    assert words.place(loop_world.CURRENT) == ""


def test_visible_effects_stand_by_family_with_the_size_that_shows_them_whole() -> None:
    found = words.visible_by_family(loop_world.sees())
    assert found["environment"] == ["current ≥ 0.014 m/s"]  # the worse of north and east
    assert found["sensing"] == ["gyro_bias ≥ 0.03 deg/s", "dvl_lever_arm ≥ 0.05 m"]
    assert list(found) == ["environment", "actuation", "sensing", "hydrodynamics"]
    assert words.visible_by_family(()) == {}


def test_a_limit_shows_from_its_size_downwards() -> None:
    found = words.visible_by_family(loop_world.sees())
    assert found["actuation"] == ["rudder_lag ≥ 0.07 s", "rudder_rate_limit ≤ 31 deg/s"]


def test_blind_effects_are_named_once_by_reason() -> None:
    found = words.blind_by_reason(loop_world.sees())
    assert found == {
        "the coefficients take it up": ["dvl_lever_arm.dy_m"],  # dx_m of it is seen
        "no position was logged": ["dvl_scale"],
        "no roll logged": ["roll_coupling"],
    }
    silent = Detectable(
        id="wave",
        family="environment",
        symbol="omega_radps",
        size=1.0,
        unit="rad/s",
        visible=False,
        kept=0.0,
    )
    assert words.blind_by_reason([silent]) == {"too small compared with the noise": ["wave"]}


def test_a_parameter_is_named_where_the_reasons_differ() -> None:
    both = [row for row in loop_world.sees() if row.id == "roll_coupling"]
    other = both[1].model_copy(update={"why": "hardly excited"})
    assert words.blind_by_reason([both[0], other]) == {
        "no roll logged": ["roll_coupling.Y_uuphi"],
        "hardly excited": ["roll_coupling.N_uuphi"],
    }


def test_effects_that_all_look_alike_are_one_row() -> None:
    def pair(a: str, b: str, cosine: float) -> Lookalikes:
        return Lookalikes(ids=(a, b), cosine=cosine, separate_by="thrust steps")

    all_of_them = [pair("a", "b", 0.99), pair("a", "c", 0.97), pair("b", "c", 0.98)]
    (row,) = words.alike(all_of_them)
    assert (row.ids, row.cosine) == (("a", "b", "c"), 0.97)
    assert words.alike(all_of_them[:2]) == all_of_them[:2]  # b and c can be told apart


def test_accepted_candidates_come_first_then_the_greatest_gain() -> None:
    accepted, *rejected = loop_world.CANDIDATES
    weak = accepted.model_copy(update={"gain": 0.5})
    assert words.ranked([*reversed(rejected), weak])[0] is weak
    gains = [c.gain for c in words.ranked(loop_world.CANDIDATES)]
    assert gains == sorted(gains, reverse=True)


def test_residuals_are_pooled_as_root_mean_squares() -> None:
    rows = loop_world.residual_rows(["a", "b"], loop_world.AFTER)
    rows = (rows[0].model_copy(update={"rms": 0.03}), *rows[1:])
    u, _, r = words.pooled(rows)
    assert u.rms == pytest.approx(((0.03**2 + 0.046**2) / 2.0) ** 0.5)
    assert u.rms_after == pytest.approx(0.0061)
    assert r.ratio == pytest.approx(0.0062 / 0.0009)
    unknown = rows[0].model_copy(update={"noise_std": 0.0})
    assert words.pooled([unknown])[0].ratio is None


def test_what_an_unexplained_residual_follows_in_whatever_form() -> None:
    rows = [
        {"axis": "N", "regressor": "cos 2 heading", "gain": 41.27, "rms_fall": {"r": -0.1}},
        ["Y", "v|r|", 3.0],
        "time",
    ]
    assert words.correlates({"correlates": rows}) == [
        "the remaining yaw moment follows cos 2 heading (41.3 nats, 0 % off the residual)",
        "Y, v|r|, 3",
        "time",
    ]
    assert words.correlates({}) == []
    assert words.plain({"id": "current", "gain": 3.0}) == "current"
    assert words.plain({"u": 0.25, "v": ["a", "b"]}) == "u 0.25, v a, b"


def test_coefficients_that_moved_by_more_than_two_of_their_deviations() -> None:
    base = {
        "unit": "kg",
        "prior": 0.0,
        "prior_std": 9.0,
        "before": 1.0,
        "before_std": 0.5,
        "after_std": 0.1,
    }
    from auvident.schema.diagnosis import CoefficientComparison as Row

    rows = [
        Row(symbol=symbol, after=after, **base)  # type: ignore[arg-type]
        for symbol, after in (("a", 1.9), ("b", 2.1), ("c", -1.0))
    ]
    fixed = Row(symbol="d", after=9.0, **base | {"before_std": 0.0})  # type: ignore[arg-type]
    assert [c.symbol for c in words.moved([*rows, fixed])] == ["c", "b"]


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (178.0, "180"),
        (0.00003, "0.00003"),
        (1.26, "1.3"),
        (-2511.0, "-2500"),
        (3e-9, "3e-09"),
        (2e7, "2e+07"),
        (0.0, "0"),
        (None, ""),
    ],
)
def test_numbers_are_plain_where_they_can_be(value: float | None, shown: str) -> None:
    assert words.number(value, 2) == shown


def test_a_push_has_to_exceed_all_of_its_sizes() -> None:
    rows = detectable_push((0.04, 0.02), HORIZONTAL)
    assert words.detectable_text(rows) == "one_off_event ≥ 0.064 m/s and ≥ 1.8 deg/s"
    assert "one-off push above 0.064 m/s and above 1.8 deg/s" in nothing_found(rows)


def test_what_was_found_is_not_told_to_be_hidden() -> None:
    hidden = loop_world.sees()[0].model_copy(update={"visible": False, "why": "hidden"})
    found, none = loop_world.diagnosis(sees=(hidden,)), loop_world.nothing()
    assert hidden.id in {e.id for e in found.effects}
    assert not any("hidden" in str(row) for row in sight(found).rows)
    other = none.model_copy(update={"sees": (hidden,)})
    assert any("hidden" in str(row) for row in sight(other).rows)


def test_what_a_force_follows_is_said_where_it_explains_something() -> None:
    row = {"axis": "Y", "regressor": "roll", "gain": 21.0}
    told = {
        fall: nothing_known({"channels": ["v"], "correlates": [{**row, "rms_fall": {"v": fall}}]})
        for fall in (-0.007, 0.01, 0.05)
    }
    assert [("follows the roll" in text) for text in told.values()] == [False, False, True]


def test_several_effects_come_closest_and_one_comes() -> None:
    assert "; current comes closest, but is not confirmed" in nothing_known({"nearest": "current"})
    several = {"nearest": "current, wave"}
    assert "; current, wave come closest, but are not confirmed" in nothing_known(several)
    assert "current, wave come closest, but fit too badly" in remaining(several)


def test_candidates_say_beside_which_effects_they_were_tried() -> None:
    found = loop_world.diagnosis().candidates
    heads = [column.head for column in candidates(found).columns]
    assert "beside" not in heads
    later = found[0].model_copy(update={"beside": ("dvl_delay",)})
    table = candidates([later, *found[1:]])
    place = [column.head for column in table.columns].index("beside")
    assert [row[place].text(TERMINAL) for row in table.rows][:2] == ["dvl_delay", ""]


def test_effects_whose_column_is_not_logged_are_named() -> None:
    found = loop_world.diagnosis().model_copy(update={"missing": ("roll_rad",), "sees": ()})
    (row,) = [row for row in sight(found).rows if row[0] == "not tested"]
    assert "roll_coupling" in str(row[1]) and "roll_rad is not in the log" in str(row[1])


def test_attempts_show_what_decides() -> None:
    first = Attempt(effects=())
    tried = Attempt(effects=("current",), left_out={"u": 1.2}, balance=-0.44, balance_se=0.2)
    found = loop_world.comparison(loop_world.diagnosis())
    table = attempts(found.model_copy(update={"attempts": (first, tried)}))
    place = [c.head for c in table.columns].index("left-out errors of all, with ÷ without")
    cell = table.rows[0][place]
    assert (cell.value, cell.std) == pytest.approx((0.644, 0.129), abs=0.001)
