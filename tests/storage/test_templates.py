"""The vehicle file to start from: valid as it is, and every key that there is stands in it."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from auvident.schema.vehicle import Body, Dvl, Fin, Fluid, Gyro, Hull, Propeller, Signs, Vehicle
from auvident.storage.templates import vehicle_template
from auvident.storage.vehicle_file import load_vehicle
from tests.command_line import SAMPLES, Called

TABLES = {
    "vehicle": Body,
    "hull": Hull,
    "fin": Fin,
    "propeller": Propeller,
    "dvl": Dvl,
    "gyro": Gyro,
    "fluid": Fluid,
    "signs": Signs,
}


def test_it_can_be_read_as_it_is(tmp_path: Path, auvident: Callable[..., Called]) -> None:
    called = auvident("new-vehicle")
    assert called.code == 0
    file = tmp_path / "my.toml"
    file.write_text(called.out)
    own, known = load_vehicle(file), load_vehicle(SAMPLES / "remus100.toml")
    assert own.hull.length_m == pytest.approx(known.hull.length_m, rel=0.01)
    assert own.propeller.kt0 == known.propeller.kt0
    assert auvident("ase", "--vehicle", file).code == 0
    again = tmp_path / "again.toml"
    assert auvident("new-vehicle", "--output", again).code == 0
    assert again.read_text() == file.read_text()
    assert auvident("new-vehicle", "--output", again).code == 2


@pytest.mark.parametrize("name", TABLES)
def test_every_key_of_a_table_stands_in_it(name: str) -> None:
    pieces = re.split(r"^(?:# )?\[+(\w+)\]+", vehicle_template(), flags=re.M)
    named = zip(pieces[1::2], pieces[2::2], strict=True)
    keys = {k for n, text in named if n == name for k in re.findall(r"^(?:# )?(\w+) =", text, re.M)}
    assert keys == set(TABLES[name].model_fields)


def test_the_tables_are_those_of_a_vehicle() -> None:
    aliases = {f.alias or name for name, f in Vehicle.model_fields.items()}
    assert {*TABLES, "coefficients", "ase"} == aliases


def test_optional_keys_hold_as_written(tmp_path: Path) -> None:
    """What is said to hold without a key is its default."""
    text, found = vehicle_template(), load_vehicle
    file = tmp_path / "my.toml"
    file.write_text(text)
    before = found(file)
    for line in (
        "# tail_shape",
        "# y_m",
        "# reference",
        "# density_kgpm3",
        "# sweep_deg",
        "# tip =",
    ):
        file.write_text(text.replace(line, line.removeprefix("# ")))
        assert found(file) == before, line
