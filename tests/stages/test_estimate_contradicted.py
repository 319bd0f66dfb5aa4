"""A model that contradicts its estimate all over leads with that."""

from types import SimpleNamespace

import pytest

from auvident.schema.artifacts import ESTIMATE_CONTRADICTED, AgainstPrior
from auvident.schema.coefficients import COEFFICIENTS
from auvident.stages.identify.prior_data import _leads

GEOMETRY = SimpleNamespace(applies=True)


def away(*distances: float, first: str = "") -> list[AgainstPrior]:
    symbols = [first] * bool(first) + [c.symbol for c in COEFFICIENTS]
    return [
        AgainstPrior(symbol=s, prior=0.0, prior_std=1.0, data=d, data_std=0.0, away=d)
        for s, d in zip(symbols, distances, strict=False)
    ]


@pytest.mark.parametrize("distances", [(20.0, 1.0, 0.5), (-6.5, 1.0), (3.0,) * 8])
def test_much_contradiction_asks_for_the_right_vehicle_file(distances):
    (found,) = _leads(away(*distances), GEOMETRY)
    assert found.code == ESTIMATE_CONTRADICTED
    assert "is this the vehicle file of this vehicle" in found.message
    assert f"of {len(distances)} coefficients" in found.message


@pytest.mark.parametrize("distances", [(), (1.0,), (4.8, 3.0, 2.6), (3.0,) * 5])
def test_what_right_vehicles_come_to_is_not_led_with(distances):
    assert not _leads(away(*distances), GEOMETRY)


def test_ballasting_alone_is_no_other_vehicle():
    assert not _leads(away(9.0, 1.0, first="W-B"), GEOMETRY)
