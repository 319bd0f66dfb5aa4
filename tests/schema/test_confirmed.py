"""An effect is claimed by sizes that are told and matter, and beside nothing that is in doubt."""

import pytest

from auvident.schema.confirmed import is_confirmed, leaning
from auvident.schema.diagnosis import Candidate, EffectFound, ParameterValue

ARM = (("dx_m", 0.0975, 0.35, 0.078), ("dy_m", 0.0052, 0.0045, 0.047))


@pytest.mark.parametrize(
    ("sizes", "confirmed"),
    [
        (ARM, False),  # odd seed 8153, whose DVL is where its file says: 5 mm abeam are sure
        ((ARM[0], ("dy_m", 0.052, 0.0045, 0.047)), True),
        ((("dx_m", 0.0975, 0.05, 0.078), ARM[1]), True),
        ((("dx_m", 0.0975, 0.35, 0.078), ("dy_m", 0.0052, 0.0060, 0.047)), False),
        ((("dx_m", 0.0975, 0.35, None), ("dy_m", 0.0052, 0.0045, None)), True),  # older artifact
    ],
)
def test_an_effect_is_confirmed_by_sizes_that_are_told_and_matter(sizes, confirmed) -> None:
    parameters = tuple(
        ParameterValue(
            symbol=symbol,
            value=value,
            std=half / 2.0,
            unit="m",
            low=value - half,
            high=value + half,
            matters_from=matters,
        )
        for symbol, value, half, matters in sizes
    )
    effect = EffectFound(id="dvl_lever_arm", family="sensing", parameters=parameters)
    assert is_confirmed(effect) == confirmed


@pytest.mark.parametrize(("limit", "confirmed"), [(20.0, True), (90.0, False)])
def test_a_limit_matters_from_its_practical_size_down(limit, confirmed) -> None:
    value = ParameterValue(
        symbol="rate_degps",
        value=limit,
        std=0.5,
        unit="deg/s",
        low=limit - 1.0,
        high=limit + 1.0,
        matters_from=25.0,
    )
    effect = EffectFound(id="rudder_rate_limit", family="actuation", parameters=(value,))
    assert is_confirmed(effect) == confirmed


def found(*ids: str, by_sensors: bool = False) -> list[EffectFound]:
    return [EffectFound(id=i, family="-", parameters=(), by_sensors=by_sensors) for i in ids]


def row(id_: str, gain: float, *beside: str) -> Candidate:
    return Candidate(id=id_, family="-", gain=gain, beside=beside)


ROLL, LIMIT, ARMS = (
    row("roll_coupling", 1073.0),
    row("rudder_rate_limit", 205.0, "roll_coupling"),
    row("dvl_lever_arm", 64.0, "roll_coupling", "rudder_rate_limit"),
)
ALL = found("roll_coupling", "rudder_rate_limit", "dvl_lever_arm")


def test_what_was_found_beside_a_clearly_stronger_effect_in_doubt_is_in_doubt() -> None:
    """Odd seed 13271: a servo speed limit that is none stood, and the roll beside it fell."""
    rows = (ROLL, LIMIT, ARMS)
    assert leaning(ALL, {"roll_coupling"}, rows) == {"rudder_rate_limit", "dvl_lever_arm"}
    assert leaning(ALL, {"rudder_rate_limit"}, rows) == {"dvl_lever_arm"}
    assert leaning(ALL, {"dvl_lever_arm"}, rows) == set()
    assert leaning(ALL, (), rows) == set()


def test_what_is_as_strong_or_shown_by_sensors_or_was_no_candidate_leans_on_nothing() -> None:
    for gain in (4171.0, 1000.0):
        as_strong = row("rudder_rate_limit", gain, "roll_coupling")
        assert leaning(ALL[:2], {"roll_coupling"}, (ROLL, as_strong)) == set()
    shown = found("rudder_rate_limit", by_sensors=True)
    assert leaning(shown, {"roll_coupling"}, (ROLL, LIMIT)) == set()
    assert leaning(found("one_off_event"), {"roll_coupling"}, (ROLL, LIMIT)) == set()


def test_one_doubt_is_handed_on() -> None:
    on_limit = row("dvl_lever_arm", 64.0, "rudder_rate_limit")
    rows = (ROLL, LIMIT, on_limit)
    assert leaning(ALL, {"roll_coupling"}, rows) == {"rudder_rate_limit", "dvl_lever_arm"}
