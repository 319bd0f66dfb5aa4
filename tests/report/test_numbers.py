"""One way to write numbers, in the styles of the terminal and of the page."""

import pytest

from auvident.report.numbers import PAGE, TERMINAL


@pytest.mark.parametrize(
    ("value", "terminal", "page"),
    [
        (0.5, "0.5", "0.500"),
        (-12.0, "-12", "−12.0"),
        (12345.6, "12300", "12300"),
        (0.00001, "0.00001", "0.0000100"),
        (9.9996, "10", "10.0"),
        (0.0, "0", "0"),
        (-3e-9, "-3e-09", "−3.00e−09"),
        (2.5e7, "2.5e+07", "2.50e+07"),
        (None, "", "–"),
        (float("nan"), "", "–"),
        (float("inf"), "", "–"),
    ],
)
def test_the_same_digits_stand_in_both_styles(
    value: float | None, terminal: str, page: str
) -> None:
    assert TERMINAL.number(value) == terminal
    assert PAGE.number(value) == page


def test_angles_are_in_degrees_on_the_page_and_as_in_the_artifacts_on_the_terminal() -> None:
    assert TERMINAL.quantity(0.1, "rad/s") == "0.1 rad/s"
    assert PAGE.quantity(0.1, "rad/s") == "5.73\u00a0deg/s"
    assert (TERMINAL.unit("kg m^2"), PAGE.unit("kg m^2")) == ("kg m^2", "kg m²")
    assert PAGE.quantity(0.2, "-") == "0.200"


def test_signs_of_names_are_hyphens() -> None:
    assert PAGE.signs("dive-1 -0.2 (-0.3 to 0.1)") == "dive-1 −0.2 (−0.3 to 0.1)"
