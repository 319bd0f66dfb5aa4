"""A model that contradicts its estimate all over leads with that."""

from types import SimpleNamespace

import pytest

from auvident.schema.artifacts import ESTIMATE_CONTRADICTED, AgainstPrior
from auvident.schema.coefficients import COEFFICIENTS
from auvident.stages.identify.prior_data import _leads

GEOMETRY = SimpleNamespace(applies=True)
CHANCE = SimpleNamespace(p=0.3, chi_square=12.0, directions=10)
FAR = SimpleNamespace(p=1e-8, chi_square=60.0, directions=10)


def away(*distances: float, first: str = "") -> list[AgainstPrior]:
    symbols = [first] * bool(first) + [c.symbol for c in COEFFICIENTS]
    return [
        AgainstPrior(symbol=s, prior=0.0, prior_std=1.0, data=d, data_std=0.0, away=d)
        for s, d in zip(symbols, distances, strict=False)
    ]


@pytest.mark.parametrize("distances", [(20.0, 1.0, 0.5), (-6.5, 1.0), (3.0,) * 8])
def test_much_contradiction_asks_for_the_right_vehicle_file(distances):
    (found,) = _leads(away(*distances), CHANCE, GEOMETRY)
    assert found.code == ESTIMATE_CONTRADICTED
    assert "is this the vehicle file of this vehicle" in found.message
    assert f"of {len(distances)} coefficients" in found.message


@pytest.mark.parametrize("distances", [(), (1.0,), (4.8, 3.0, 2.6), (3.0,) * 5])
def test_what_right_vehicles_come_to_is_not_led_with(distances):
    assert not _leads(away(*distances), CHANCE, GEOMETRY)


def test_much_in_all_is_led_with_though_no_coefficient_is_far():
    (found,) = _leads(away(4.0, 3.0, 1.0), FAR, GEOMETRY)
    assert "2 of 3 coefficients contradict" in found.message
    assert "(chi-square 60 of 10 in all)" in found.message
    assert found.value < found.threshold


def test_ballasting_alone_is_no_other_vehicle():
    assert not _leads(away(9.0, 1.0, first="W-B"), CHANCE, GEOMETRY)
    assert not _leads(away(9.0, 1.0, first="W-B"), FAR, GEOMETRY)
