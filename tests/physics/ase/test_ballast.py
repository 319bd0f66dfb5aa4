"""Weight in water, trim and righting moment as the vehicle file has them."""

import pytest

from auvident.physics.ase.ballast import ballast
from auvident.stages.ase import estimate
from auvident.storage.vehicle_file import load_vehicle
from tests.engines.chain import SAMPLES
from tests.physics.ase.ase_vehicles import changed

REMUS = load_vehicle(SAMPLES / "remus100.toml")
WEIGHT = 30.48 * 9.80665  # N
DIAMETER = 0.191  # m


def told(**keys) -> dict[str, tuple[float, float]]:
    vehicle = REMUS.model_copy(update={"body": REMUS.body.model_copy(update=keys)})
    return {c.symbol: (c.value, c.std) for c in ballast(vehicle, DIAMETER)}


def test_values_are_those_of_the_file_and_deviations_those_of_careful_ballasting() -> None:
    found = told()
    assert found["W-B"] == pytest.approx((WEIGHT - 300.0, 0.005 * WEIGHT))
    assert found["x_GW"] == pytest.approx((0.0, 0.001 * 1.3327 * WEIGHT))
    assert found["z_GW"] == pytest.approx((0.0196 * WEIGHT, 0.015 * DIAMETER * WEIGHT))


def test_what_is_not_stated_is_less_sure() -> None:
    assert told(buoyancy_n=None)["W-B"] == pytest.approx((0.0, 0.02 * WEIGHT))
    assert told(z_g_m=0.0)["z_GW"] == pytest.approx((0.0, 0.05 * DIAMETER * WEIGHT))


def test_a_centre_of_gravity_ahead_of_the_origin_is_no_trim() -> None:
    """The origin need not be the centre of buoyancy; what ballasting leaves is near zero."""
    assert told(x_g_m=0.2)["x_GW"] == told()["x_GW"]


def test_stated_deviations_take_their_place() -> None:
    found = told(buoyancy_std_n=0.7, x_g_std_m=0.002, z_g_std_m=0.0, buoyancy_n=None)
    assert [found[s][1] for s in ("W-B", "x_GW", "z_GW")] == pytest.approx(
        [0.7, 0.002 * WEIGHT, 0.0]
    )


def test_a_given_constant_takes_the_place_of_the_files() -> None:
    known = {"W-B": {"value": -0.5, "std": 0.1}}
    result = estimate(changed(REMUS, coefficients=known))
    rows = {c.symbol: c for c in result.constants}
    assert (rows["W-B"].value, rows["W-B"].std) == (-0.5, 0.1)
    assert rows["W-B"].source == "[coefficients]" and rows["z_GW"].source == "z_g_m"
    assert {c.plane for c in result.constants} == {"vertical"}
    assert [c.unit for c in result.constants] == ["N", "N m", "N m"]


def test_a_hull_without_formulas_has_them_as_well() -> None:
    tanker = load_vehicle(SAMPLES / "kvlcc2" / "vehicle.toml")
    assert [c.symbol for c in estimate(tanker).constants] == ["W-B", "x_GW", "z_GW"]
