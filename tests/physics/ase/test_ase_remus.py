"""REMUS 100: Prestero 2001, and the recipe's own numbers of theory 8.2."""

import pytest
from ase_vehicles import changed, fins, load

from auvident.stages.ase import estimate

# The source prints an area of 6.65e-3 m^2 beside a chord of 0.0747 m and a span of 0.0857 m
# (6.40e-3 m^2); the recipe's numbers are made with the area.
BY_AREA = {"root_chord_m": 0.09383, "tip_chord_m": 0.06137}


@pytest.fixture(scope="module")
def recipe():
    remus = load("remus")
    return estimate(changed(remus, fin=fins(remus, "rudder", "elevator", **BY_AREA)))


def test_strip_added_mass_is_that_of_prestero():
    """With his tip height, 0.131 m off the axis: -35.5, 1.93, -4.88 within 2 %."""
    remus = load("remus")
    found = estimate(
        changed(remus, fin=fins(remus, "rudder", "elevator", exposed_span_m=0.0881))
    ).by_symbol()
    assert found["Y_vdot"].value == pytest.approx(-35.5, rel=0.02)
    assert found["Y_rdot"].value == pytest.approx(1.93, rel=0.02)
    assert found["N_vdot"].value == found["Y_rdot"].value
    assert found["N_rdot"].value == pytest.approx(-4.88, rel=0.02)
    assert found["Z_qdot"].value == pytest.approx(-1.93, rel=0.02)
    assert found["M_qdot"].value == pytest.approx(-4.88, rel=0.02)


RECIPE = {  # theory 8.2, to 1 %
    ("X_udot", "hull"): -1.384,
    ("Y_uv", "hull"): -19.06,
    ("N_uv", "hull"): -17.30,
    ("X_vv", "hull"): 9.53,
    ("X_uu", "hull"): -1.849,
    ("Y_v|v|", "hull"): -90.2,
    ("Y_uv", "rudder"): -31.9,
    ("Y_uud", "rudder"): 23.0,
    ("N_uud", "rudder"): -14.7,
}


@pytest.mark.parametrize(("key", "value"), RECIPE.items())
def test_recipe_has_its_own_numbers(recipe, key, value):
    symbol, part = key
    assert recipe.by_symbol()[symbol].parts[part] == pytest.approx(value, rel=0.01)


def test_recipe_factors(recipe):
    g = recipe.geometry
    assert g["slenderness_factor"] == pytest.approx(0.87932, rel=0.001)
    assert g["cut_from_nose_m"] == pytest.approx(1.0806, rel=0.002)
    assert g["cut_area_m2"] == pytest.approx(0.021043, rel=0.005)
    assert g["cut_volume_m3"] == pytest.approx(0.028985, rel=0.002)
    assert g["crossflow_finite_length"] == pytest.approx(0.6447, rel=0.001)
    assert g["fin1_rudder_aspect_ratio"] == pytest.approx(2.209, rel=0.001)
    assert g["fin1_rudder_lift_slope"] == pytest.approx(2.6133, rel=0.001)
    assert g["fin1_rudder_hull_ratio"] == pytest.approx(0.3337, rel=0.005)


def test_without_interference(recipe):
    remus = load("remus")
    ase = {"incidence_interference": "none", "deflection_interference": "none"}
    entry = fins(remus, "rudder", "elevator", **BY_AREA)
    found = estimate(changed(remus, fin=entry, ase=ase)).by_symbol()
    assert found["Y_uv"].parts["rudder"] == pytest.approx(-17.9, rel=0.01)
    assert found["Y_uud"].value == pytest.approx(17.9, rel=0.01)
    assert found["N_uud"].value == pytest.approx(-11.4, rel=0.01)


def test_option_of_prestero_for_surge():
    """His ellipsoid has the hull's diameter: -0.93."""
    remus = load("remus")
    found = estimate(changed(remus, ase={"surge_spheroid": "diameter"})).by_symbol()
    assert found["X_udot"].value == pytest.approx(-0.93, rel=0.02)  # his k1 is read from a table


def test_cross_flow_strips_of_a_turning_hull():
    """Theory 3.3: N_r|r| -5.2 with the finite-length factor, -8.1 without."""
    remus = load("remus")
    for source, value in (("datcom", -5.2), ("none", -8.1)):
        ase = {"hull_rate_crossflow": True, "crossflow_finite_length": source}
        found = estimate(changed(remus, ase=ase)).by_symbol()["N_r|r|"]
        assert found.parts["hull"] == pytest.approx(value, rel=0.02)


@pytest.mark.parametrize("measured", [0.267, 0.2])
def test_measured_drag_of_the_whole_vehicle_lies_within_a_deviation(recipe, measured):
    """C_d on 0.0285 m^2 of the tow tank and at sea (theory 8.2), twice the smooth hull's."""
    drag = recipe.by_symbol()["X_uu"]
    assert abs(-0.5 * 1030.0 * 0.0285 * measured - drag.value) < drag.std


def test_fins_drag_as_in_the_build_up_of_prestero():
    """Four fins: 0.62 N at 1.54 m/s in fresh water (theory 8.2)."""
    remus = load("remus")
    entries = [
        {k: v for k, v in f.items() if k != "cd0"} for f in fins(remus, "rudder", "elevator")
    ]
    parts = estimate(changed(remus, fin=entries)).by_symbol()["X_uu"].parts
    drag = -(parts["rudder"] + parts["elevator"]) * 999.1 / 1030.0 * 1.54**2
    # friction of turbulent flow; his C_d 0.02 is a round figure for fins of any size
    assert drag == pytest.approx(0.62, rel=0.2)


def test_stated_drag_is_that_of_the_whole_vehicle(recipe):
    remus = load("remus")
    unit = 0.5 * 1030.0 * 0.25 * 3.141592653589793 * 0.191**2
    row = estimate(changed(remus, hull={"drag_coefficient": 0.267})).by_symbol()["X_uu"]
    assert (row.value, row.origin) == (pytest.approx(-0.267 * unit), "given")
    assert row.std == pytest.approx(0.15 * 0.267 * unit)
    assert sum(row.parts.values()) == pytest.approx(row.value)
    assert row.parts["hull"] == recipe.by_symbol()["X_uu"].parts["hull"]
    known = {"drag_coefficient": 0.267, "drag_coefficient_std": 0.01}
    row = estimate(changed(remus, hull=known)).by_symbol()["X_uu"]
    assert row.std == pytest.approx(0.01 * unit)


@pytest.mark.parametrize(
    ("tables", "problem"),
    [
        ({"hull": {"drag_coefficient_std": 0.01}}, "needs drag_coefficient"),
        (
            {"hull": {"drag_coefficient": 0.2}, "coefficients": {"X_uu": {"value": -3, "std": 1}}},
            "not both",
        ),
    ],
)
def test_drag_that_is_stated_twice_or_in_part_is_refused(tables, problem):
    with pytest.raises(ValueError, match=problem):
        changed(load("remus"), **tables)


def test_drag_of_a_hull_without_diameter_has_no_area_to_refer_to():
    with pytest.raises(ValueError, match="needs diameter_m"):
        changed(load("kvlcc2"), hull={"drag_coefficient": 0.2})
