"""Units as people write them."""

import pytest

from auvident.schema.logs import unit_name

SPELLED = {
    "deg/sec": "degps",
    "º/s": "degps",
    "rad s-1": "radps",
    "rad.s^-1": "radps",
    "radians/second": "radps",
    "[m s⁻¹]": "mps",
    "m/sec": "mps",
    "ms-1": "mps",
    "km/h": "kmph",
    "ft/s": "ftps",
    "Feet": "ft",
    "r/min": "rpm",
    "1/s": "rps",
}


@pytest.mark.parametrize("text", SPELLED)
def test_a_unit_is_known_however_it_is_spelled(text):
    assert unit_name(text) == SPELLED[text]


@pytest.mark.parametrize("text", ["", "ms", "s-1", "dbar", "hours"])
def test_what_is_no_unit_of_a_reading_is_none(text):
    assert unit_name(text) is None
