"""The estimate from geometry, from a file, a dictionary or a vehicle."""

import json
import tomllib
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path

import pytest

import auvident
from tests.command_line import SAMPLES, Called

FILE = SAMPLES / "remus100.toml"
TABLES = tomllib.loads(FILE.read_text())


def test_a_file_its_tables_and_a_vehicle_give_what_the_command_gives(
    auvident: Callable[..., Called],
) -> None:
    import auvident as interface

    told = json.loads(auvident("ase", FILE, "--json").out)
    before = deepcopy(TABLES)
    for given in (str(FILE), TABLES):
        found = interface.estimate_from_geometry(given)
        table = found.coefficients
        for row in told["coefficients"]:
            mine = table.loc[row["symbol"]]
            assert mine[["value", "std", "prime"]].to_list() == [
                row[key] for key in ("value", "std", "prime")
            ]
        assert found.facts.keys() == told["facts"].keys()
        assert found.findings["code"].to_list() == [f["code"] for f in told["findings"]]
    assert before == TABLES


def test_parts_add_up_to_the_coefficients() -> None:
    found = auvident.estimate_from_geometry(TABLES)
    estimated = found.coefficients.loc[found.parts.index]
    assert found.parts.sum(axis=1).to_numpy() == pytest.approx(estimated["value"].to_numpy())


def test_a_larger_fin_at_the_stern_steers_more_and_steadies_more() -> None:
    tables = deepcopy(TABLES)
    for fin in tables["fin"]:
        if fin["kind"] == "rudder":
            fin["exposed_span_m"] *= 1.3
    found = [auvident.estimate_from_geometry(t) for t in (TABLES, tables)]
    steer, steady = ([e.coefficients.loc[s, "value"] for e in found] for s in ("N_uud", "N_uv"))
    assert steer[1] < 1.3 * steer[0] < 0.0 and steady[1] > steady[0] + 1.0
    circles = [e.maneuver("turning-circle:15", 0).figures["value"] for e in found]
    assert circles[1]["tactical_diameter"] > circles[0]["tactical_diameter"]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"vehicle": {"mass": 31.0}}, r"\[vehicle\] mass: unknown key"),
        ({"hull": {"length_m": -1.0}}, r"\[hull\] length_m"),
        ({"hull": {"offsets": "../hull.csv"}}, "outside"),
    ],
)
def test_a_dictionary_that_is_no_vehicle_says_where(change: dict, said: str) -> None:
    tables = {key: ({} if "offsets" in own else TABLES[key]) | own for key, own in change.items()}
    with pytest.raises(auvident.InputError, match=said):
        auvident.load_vehicle({**TABLES, **tables})


def test_a_vehicle_that_is_one_is_taken_as_it_is() -> None:
    vehicle = auvident.load_vehicle(FILE)
    assert isinstance(vehicle, auvident.Vehicle) and auvident.load_vehicle(vehicle) is vehicle
    with pytest.raises(auvident.InputError, match="no such file"):
        auvident.load_vehicle(Path("nothing.toml"))
