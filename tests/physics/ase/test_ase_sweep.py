import time

import numpy as np
import pytest
from ase_vehicles import changed, fins, load

from auvident.errors import UsageError
from auvident.physics.ase.sweep import _is_number, parse_sweep, sweep, with_values
from auvident.schema.coefficients import COEFFICIENTS
from auvident.schema.vehicle import Vehicle
from auvident.stages.ase import estimate


def test_sweep_gives_what_single_estimates_give():
    remus = load("remus")
    table = sweep(remus, {"rudder.exposed_span_m": [0.08, 0.1], "hull.length_m": [1.3, 1.33, 1.4]})
    assert len(table) == 6
    row = table.iloc[5]
    assert (row["rudder.exposed_span_m"], row["hull.length_m"]) == (0.1, 1.4)
    entry = [*fins(remus, "rudder", exposed_span_m=0.1), *fins(remus, "elevator")]
    single = estimate(changed(remus, fin=entry, hull={"length_m": 1.4}))
    for c in single.coefficients:
        assert row[c.symbol] == pytest.approx(c.value, rel=1e-6, abs=1e-12), c.symbol
    assert row["G_H"] == pytest.approx(single.facts["horizontal"]["G"], rel=1e-6)
    assert row["G_V"] == pytest.approx(single.facts["vertical"]["G"], rel=1e-6)


def numbers_of(vehicle: Vehicle) -> dict[str, float]:
    """Every number that the file of a vehicle states, by its key in a sweep."""
    tables = {"vehicle": vehicle.body, "hull": vehicle.hull, "propeller": vehicle.propeller}
    tables |= {"fluid": vehicle.fluid, **{fin.kind: fin for fin in vehicle.fin}}
    return {
        f"{table}.{name}": getattr(row, name)
        for table, row in tables.items()
        for name in (type(row).model_fields if row else ())
        if _is_number(row, name) and getattr(row, name)
    }


@pytest.mark.parametrize(("key", "value"), numbers_of(load("remus")).items())
def test_every_number_of_the_file_can_be_swept(key: str, value: float) -> None:
    """Three values side by side, and one after the other."""
    remus, values = load("remus"), value * np.array([1.0, 1.004, 0.996])
    found = sweep(remus, {key: values})
    assert (found["problem"] == "").all()
    for k, x in enumerate(values):
        one = sweep(with_values(remus, {key: float(x)}), {})
        for c in COEFFICIENTS:
            expected = pytest.approx(one[c.symbol][0], rel=1e-9, abs=1e-12)
            assert found[c.symbol][k] == expected, c.symbol


def test_ten_thousand_variants_take_seconds_not_minutes():
    grid = parse_sweep(["rudder.exposed_span_m=0.08:0.16:100", "hull.length_m=1.3:1.5:100"])
    start = time.process_time()
    table = sweep(load("remus"), grid)
    assert time.process_time() - start < 60.0
    assert len(table) == 10_000
    assert np.all(np.isfinite(table.drop(columns="problem").to_numpy()))


def test_longer_rudder_turns_faster():
    table = sweep(load("remus"), parse_sweep(["rudder.exposed_span_m=0.08:0.16:9"]))
    assert table["Y_uud"].is_monotonic_increasing
    assert table["N_uv"].is_monotonic_increasing  # the tail's side force weighs more


def test_impossible_variants_say_why():
    table = sweep(
        load("remus"), {"hull.nose_length_m": [0.17, 1.0], "vehicle.mass_kg": [30.0, -1.0]}
    )
    assert table["problem"].tolist()[0] == ""
    assert "zero or negative" in table["problem"][1]
    assert "longer than the hull" in table["problem"][2]
    assert table["Y_uv"].isna().tolist() == [False, True, True, True]


@pytest.mark.parametrize(
    ("key", "least", "words"),
    [("izz_kgm2", 0.0738, "0.0492 m"), ("iyy_kgm2", 0.0738, "0.0492 m"), ("ixx_kgm2", 0.01737, "")],
)
def test_inertia_of_a_block_of_steel_amidships_is_the_least(key, least, words):
    """30.48 kg as a slab of 0.171 m, of 1.33 m, or as a rod of 34 mm radius in the axis."""
    table = sweep(load("remus"), {f"vehicle.{key}": [0.98 * least, 1.02 * least]})
    assert f"[vehicle] {key}: the radius of gyration, " in table["problem"][0]
    assert f"is smaller than {words}" in table["problem"][0]
    assert table["problem"][1] == ""


def test_design_speed_and_propeller_can_be_swept():
    table = sweep(load("remus"), {"vehicle.design_speed_mps": [1.0, 2.0]})
    assert abs(table["X_uu"][1]) < abs(table["X_uu"][0])  # friction falls with Reynolds number
    known = changed(load("remus"), hull={"drag_coefficient": 0.2})
    drag = sweep(known, {"hull.drag_coefficient": [0.2, 0.3]})["X_uu"]
    assert drag[1] == pytest.approx(1.5 * drag[0])
    thrust = sweep(load("remus"), {"propeller.diameter_m": [0.14, 0.28]})["T_nn"]
    assert thrust[1] == pytest.approx(16.0 * thrust[0])


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("rudder", "start:stop:count"),
        ("rudder.exposed_span_m=0.1:0.2", "start:stop:count"),
        ("rudder.exposed_span_m=a:b:3", "start:stop:count"),
        ("rudder.exposed_span_m=0.1:0.2:0", "count 0"),
        ("rudder.exposed_span_m=nan:1:3", "finite"),
        ("rudder.exposed_span_m=0:1:9999999", "count"),
    ],
)
def test_unreadable_sweeps_are_refused(text, problem):
    with pytest.raises(UsageError, match=problem) as error:
        parse_sweep([text])
    assert error.value.exit_code == 2
    assert text in str(error.value)


def test_sweep_of_several_values():
    found = parse_sweep(["sail.x_m=0.1,0.3", "hull.length_m=1:2:3"])
    assert found["sail.x_m"].tolist() == [0.1, 0.3]
    assert found["hull.length_m"].tolist() == [1.0, 1.5, 2.0]
    with pytest.raises(UsageError, match="twice"):
        parse_sweep(["hull.length_m=1:2:3", "hull.length_m=1:2:3"])


@pytest.mark.parametrize("key", ["sail.x_m", "rudder.colour", "keel.x_m", "rudder.count"])
def test_keys_the_vehicle_does_not_have_are_refused(key):
    with pytest.raises(UsageError, match=key):
        sweep(load("remus"), {key: [1.0, 2.0]})
