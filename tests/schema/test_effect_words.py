"""What ends at a bound is said to be known to one side only: words, interval, tables."""

import pytest

from auvident.report import loop_words
from auvident.report.numbers import TERMINAL
from auvident.report.tables import written
from auvident.report.tables_loop import effects
from auvident.schema.confirmed import holds_nothing
from auvident.schema.diagnosis import Bound, EffectFound, ParameterValue, ends
from auvident.schema.effect_words import plain
from auvident.schema.effects import BY_ID


def at(name: str, value: float, bound: Bound | None = None, half: float = 0.1) -> ParameterValue:
    """A parameter by its name, with an interval."""
    effect, _, symbol = name.partition(".")
    unit = next(p.unit for p in BY_ID[effect].parameters if p.symbol == symbol)
    told = ends(value, half, bound)
    return ParameterValue(symbol=symbol, value=value, std=0.05, unit=unit, bound=bound, **told)


def test_what_is_known_to_a_factor_keeps_its_sign() -> None:
    def told(value: float, half: float) -> ParameterValue:
        unit = "m^2/s^2/N"
        own = ends(value, half, None, known_to=2.0)
        return ParameterValue(symbol="c_m2ps2pn", value=value, std=0.1, unit=unit, **own)

    assert told(0.4, 0.1).interval == pytest.approx((0.15, 1.0))
    assert told(-0.4, 0.1).interval == pytest.approx((-1.0, -0.15))
    assert told(0.1, 0.3).interval == pytest.approx((-0.4, 0.8))
    for value, half in ((0.4, 0.1), (-0.4, 0.1), (0.1, 0.3)):
        assert told(value, half).half_of_fit(2.0) == pytest.approx(half)
        assert holds_nothing("propeller_race", told(value, half)) == (half > abs(value))


def test_without_a_compass_a_direction_counts_from_the_bow() -> None:
    values = [at("current.north_mps", 0.0), at("current.east_mps", -0.2)]
    assert plain("current", values, 2.0, 10.0) == "a current of 0.20 m/s towards 270 deg"
    assert plain("current", values, 2.0, 10.0, "bow") == (
        "a current of 0.20 m/s towards 270 deg from the bow at the start of the log"
    )


@pytest.mark.parametrize(
    ("effect", "parameters", "words"),
    [
        ("gyro_delay", [("delay_s", 2.0, "at least")], "a gyro delay of at least 2.00 s"),
        (
            "rudder_stall",
            [("angle_deg", 7.4, "at most")],
            "a rudder that stalls at no more than 7 deg",
        ),
        (
            "rudder_backlash",
            [("half_width_deg", 11.46, "at least")],
            "a rudder backlash of at least ±11.5 deg",
        ),
        (
            "dvl_lever_arm",
            [("dx_m", 1.0, "at least"), ("dy_m", 0.9, None)],
            "a DVL at least 1.00 m forward and 0.90 m to starboard of its stated position",
        ),
        (
            "dvl_lever_arm",
            [("dx_m", -1.0, "at most"), ("dy_m", -0.9, None)],
            "a DVL at least 1.00 m aft and 0.90 m to port of its stated position",
        ),
        (
            "current",
            [("north_mps", 2.0, "at least"), ("east_mps", 0.0, None)],
            "a current of at least 2.00 m/s towards 0 deg",
        ),
        (
            "hull_asymmetry",
            [("Y_0", 1.0, "at least"), ("N_0", -0.5, "at most")],
            "a hull asymmetry with at least 4.00 N and no more than -2.00 N m at 2.0 m/s",
        ),
        (
            "sway_cross_flow",
            [("Y_v|r|", 3.0, "at least"), ("Y_r|v|", 1.0, None)],
            "sway cross flow (Y_v|r| at least 3 kg, Y_r|v| 1 kg)",
        ),
    ],
)
def test_the_sentence_says_to_which_side_a_size_is_known(effect, parameters, words) -> None:
    values = [at(f"{effect}.{symbol}", value, bound) for symbol, value, bound in parameters]
    assert plain(effect, values, 2.0, 10.0) == words
    known = [p.model_copy(update={"bound": None}) for p in values]
    assert not any(side in plain(effect, known, 2.0, 10.0) for side in ("least", "more than"))


def test_the_interval_is_open_beyond_a_bound() -> None:
    assert at("gyro_delay.delay_s", 2.0, "at least").interval == (1.9, None)
    assert at("rudder_stall.angle_deg", 7.0, "at most").interval == (None, 7.1)
    assert at("gyro_delay.delay_s", 0.5).interval == (0.4, 0.6)
    bare = ParameterValue(symbol="delay_s", value=2.0, std=0.05, unit="s", bound="at least")
    assert bare.interval is None and bare.half == 0.0


def test_an_open_interval_can_hold_nothing_as_well() -> None:
    for half, nothing in ((0.1, False), (2.5, True)):
        assert holds_nothing("gyro_delay", at("gyro_delay.delay_s", 2.0, "at least", half)) == (
            nothing
        )
        stall = at("rudder_stall.angle_deg", 2.0, "at most", half)
        assert holds_nothing("rudder_stall", stall) == nothing


def test_an_effect_tells_which_parameters_are_at_a_bound_and_its_table_shows_it() -> None:
    pair = (at("dvl_lever_arm.dx_m", 1.0, "at least"), at("dvl_lever_arm.dy_m", 0.1))
    found = EffectFound(id="dvl_lever_arm", family="sensing", parameters=pair)
    assert found.at_bound == ("dx_m",)
    assert EffectFound.model_validate_json(found.model_dump_json()) == found
    rows = written(effects([found]), TERMINAL).rows
    assert [row[4:] for row in rows] == [
        ("≥ 1.000", "≥ 0.9"),
        ("0.100", "0 to 0.2, not confirmed"),
    ]
    assert loop_words.sizes(found.id, pair).startswith("dx_m ≥ 1 m (≥ 0.9)")


@pytest.mark.parametrize(
    ("effect", "sizes", "says"),
    [
        (
            "weight_change",
            (-22.5, 0.3),
            "weight that falls by 22.5 N and a bow-down moment that grows",
        ),
        (
            "buoyancy_gradient",
            (-0.25,),
            "weight minus buoyancy that falls by 0.25 N per m of depth",
        ),
        ("thrust_sag", (0.1,), "thrust that declines by 10.0% in 1000 s"),
        ("thrust_sag", (-0.1,), "thrust that rises by 10.0% in 1000 s"),
        ("thrust_step", (-0.2,), "thrust that rises by 20.0%"),
        ("linear_drag", (-2.4,), "linear drag of 2.40 kg/s"),
        ("linear_drag", (2.4,), "linear drag of 2.40 kg/s that pushes ahead"),
        ("vertical_current", (0.05,), "water that sinks by 0.050 m/s"),
        ("vertical_current", (-0.05,), "water that rises by 0.050 m/s"),
    ],
)
def test_what_falls_is_not_said_to_grow_by_less_than_nothing(effect, sizes, says):
    symbols = [p.symbol for p in BY_ID[effect].parameters]
    values = [
        ParameterValue(symbol=s, value=x, std=0.0, unit="-")
        for s, x in zip(symbols, sizes, strict=False)
    ]
    assert plain(effect, values, 1.5, 20.0).startswith(says)


def test_a_size_that_cannot_be_told_from_none_is_not_in_the_sentence():
    weight = at("weight_change.weight_n", -22.5, half=2.9)
    moment = at("weight_change.moment_nm", -0.34, half=4.9)
    assert plain("weight_change", [weight, moment], 1.5, 20.0).startswith(
        "weight that falls by 22.5 N at"
    )
    side, turn = (
        at("roll_coupling.Y_uuphi", -13.0, half=10.0),
        at("roll_coupling.N_uuphi", 4.8, half=9.8),
    )
    assert plain("roll_coupling", [side, turn], 1.5, 20.0) == "force due to roll (Y_uuphi -13 kg/m)"
    arm, abeam = (
        at("dvl_lever_arm.dx_m", -0.3, half=0.1),
        at("dvl_lever_arm.dy_m", -0.003, half=0.07),
    )
    said = plain("dvl_lever_arm", [arm, abeam], 1.5, 20.0)
    assert said == "a DVL 0.30 m aft of its stated position"
    assert "N_uuphi" in plain("roll_coupling", [turn], 1.5, 20.0)  # nothing is told from none
