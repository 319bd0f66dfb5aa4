"""Vehicles of published measurements, and changes of them."""

from pathlib import Path
from typing import Any

from auvident.schema.vehicle import Vehicle
from auvident.storage.vehicle_file import load_vehicle

VEHICLES = Path(__file__).parents[2] / "data" / "vehicles"


def load(name: str) -> Vehicle:
    return load_vehicle(VEHICLES / f"{name}.toml")


def changed(base: Vehicle, /, **tables: Any) -> Vehicle:
    """The vehicle with some keys of some tables replaced, validated again."""
    data = base.model_dump(by_alias=True, exclude_unset=True)
    for table, keys in tables.items():
        data[table] = {**data.get(table, {}), **keys} if isinstance(keys, dict) else keys
    return Vehicle.model_validate(data)


def fins(vehicle: Vehicle, *kinds: str, **update: Any) -> list[dict]:
    """The entries of some kinds, for `changed`."""
    return [{**f.model_dump(exclude_unset=True), **update} for f in vehicle.fin if f.kind in kinds]
