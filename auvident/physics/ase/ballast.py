"""Weight in water, trim and righting moment, as the vehicle file has them and how surely."""

from collections.abc import Iterator

from auvident.constants import GRAVITY_MPS2
from auvident.schema.artifacts import AseConstant
from auvident.schema.coefficients import CONSTANTS, Constant
from auvident.schema.vehicle import Vehicle

# Of the weight. A vehicle is ballasted in a tank to a tenth of a percent; the density of the sea
# changes by half a percent with salinity and temperature (1020 to 1028 kg/m3).
BUOYANCY_SHARE = 0.005
# Where no buoyancy is stated, it is taken for the weight: vehicles are ballasted to float with up
# to some 2 % of it (REMUS 100: 2.3 %, Prestero 2001).
NEUTRAL_SHARE = 0.02
# Of the hull's length: 1 to 2 mm on a vehicle of 1.5 m, which lies level to 4 degrees with
# 20 mm between the centres of buoyancy and gravity.
TRIM_SHARE = 0.001
# Of the diameter: 3 mm on 0.2 m, the list by a known weight moved across (inclining test).
HEIGHT_SHARE = 0.015
# Where no height is stated: most torpedo hulls have 0 to 0.1 of the diameter (REMUS 100: 0.1).
UNKNOWN_HEIGHT_SHARE = 0.05


def ballast(vehicle: Vehicle, height_m: float) -> tuple[AseConstant, ...]:
    """Constants of the vertical plane with their standard deviations.

    The trim moment is x_G W - x_B B, which ballasting makes zero; the file's ``x_g_m`` does not
    tell it, because x_B depends on all that is flooded and all that is not.

    Parameters
    ----------
    vehicle : Vehicle
    height_m : float
        Diameter of the hull, or its draught.
    """
    told = {
        "W-B": _weight_in_water(vehicle),
        "x_GW": _trim(vehicle),
        "z_GW": _righting(vehicle, height_m),
    }
    return tuple(_rows(vehicle, told))


def _rows(vehicle: Vehicle, told: dict[str, tuple[float, float, str]]) -> Iterator[AseConstant]:
    for declared in CONSTANTS:
        value, std, source = told[declared.symbol]
        known = vehicle.coefficients.get(declared.symbol)
        if known is not None:
            value, std, source = known.value, known.std, "[coefficients]"
        yield _row(declared, value, std, source)


def _row(declared: Constant, value: float, std: float, source: str) -> AseConstant:
    return AseConstant(
        symbol=declared.symbol,
        plane=declared.planes[0],
        value=value,
        std=std,
        unit=declared.unit,
        source=source,
    )


def _weight_in_water(vehicle: Vehicle) -> tuple[float, float, str]:
    """W - B, its standard deviation and the keys it comes from."""
    body = vehicle.body
    weight = body.mass_kg * GRAVITY_MPS2
    if body.buoyancy_n is None:
        value, share, source = 0.0, NEUTRAL_SHARE, "neutral: no buoyancy_n is stated"
    else:
        value, share = weight - body.buoyancy_n, BUOYANCY_SHARE
        source = "mass_kg and buoyancy_n"
    stated = body.buoyancy_std_n
    return value, share * weight if stated is None else stated, source


def _trim(vehicle: Vehicle) -> tuple[float, float, str]:
    """x_G W - x_B B of a vehicle that is ballasted to lie level."""
    body, stated = vehicle.body, vehicle.body.x_g_std_m
    arm = TRIM_SHARE * vehicle.hull.length_m if stated is None else stated
    return 0.0, arm * body.mass_kg * GRAVITY_MPS2, "ballasted to lie level"


def _righting(vehicle: Vehicle, height_m: float) -> tuple[float, float, str]:
    """z_G W; a height of exactly zero is one that nobody has stated."""
    body, stated = vehicle.body, vehicle.body.z_g_std_m
    unknown = body.z_g_m == 0.0
    arm = (UNKNOWN_HEIGHT_SHARE if unknown else HEIGHT_SHARE) * height_m
    weight, source = body.mass_kg * GRAVITY_MPS2, "none: no z_g_m is stated" if unknown else "z_g_m"
    return body.z_g_m * weight, weight * (arm if stated is None else stated), source
