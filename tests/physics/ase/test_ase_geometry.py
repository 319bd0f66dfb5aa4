import numpy as np
import pytest
from ase_vehicles import changed, load
from hypothesis import given, settings
from hypothesis import strategies as st

from auvident.physics.ase.geometry import hull_geometry
from auvident.physics.ase.quadrature import integrate
from auvident.schema.hull_shape import hull_shape

QUADRATURE = 1e-8  # the integrals are refined until they change by less
NO_FINS: list = []


def body(**hull):
    """REMUS without fins and with another hull; mass is no matter for geometry."""
    hull = {"length_m": 2.0, "diameter_m": 0.4, **hull}
    vehicle = load("remus")
    data = vehicle.model_dump(by_alias=True, exclude_unset=True)
    data |= {"hull": hull, "fin": NO_FINS}
    data["vehicle"] = {**data["vehicle"], "origin_from_nose_m": 1.0}
    return type(vehicle).model_validate(data)


def test_spheroid_has_its_closed_forms():
    spheroid = body(nose_length_m=1.0, tail_length_m=1.0, tail_shape="ellipsoid")
    found = hull_geometry(spheroid)
    a, b = 1.0, 0.2
    e = np.sqrt(1.0 - b**2 / a**2)
    assert found.volume_m3 == pytest.approx(4 / 3 * np.pi * a * b**2, rel=QUADRATURE)
    wetted = 2 * np.pi * b**2 * (1 + a / (b * e) * np.arcsin(e))
    assert found.wetted_m2 == pytest.approx(wetted, rel=1e-7)
    assert found.planform_m2 == pytest.approx(np.pi * a * b, rel=QUADRATURE)
    assert found.planform_x_m == pytest.approx(0.0, abs=1e-10)
    assert found.volume_xx_m5 == pytest.approx(found.volume_m3 * a**2 / 5, rel=QUADRATURE)


def test_ellipsoid_cylinder_cone_has_its_closed_forms():
    found = hull_geometry(body(nose_length_m=0.5, tail_length_m=0.6))
    circle = np.pi * 0.2**2
    assert found.volume_m3 == pytest.approx(circle * (2 / 3 * 0.5 + 0.9 + 0.6 / 3), rel=QUADRATURE)
    assert found.planform_m2 == pytest.approx(np.pi * 0.2 * 0.5 / 2 + 0.9 * 0.4 + 0.6 * 0.2)
    assert found.cut_x_m == pytest.approx(-0.7)
    assert found.cut_area_m2 == pytest.approx(circle / 4)
    assert found.cut_volume_m3 == pytest.approx(circle * (2 / 3 * 0.5 + 0.9 + 0.6 * 7 / 24))


def test_suboff_has_its_published_sizes():
    found = hull_geometry(load("suboff"))
    assert found.wetted_m2 == pytest.approx(5.988, abs=5e-4)  # Groves et al. 1989, last digit
    assert found.volume_m3 == pytest.approx(0.69921, abs=5e-6)  # theory 8.1
    assert found.planform_m2 == pytest.approx(1.88427, abs=5e-6)
    assert 2.013 - found.buoyancy_x_m == pytest.approx(2.0086, abs=5e-5)
    assert 2.013 - found.cut_x_m == pytest.approx(3.8005, abs=5e-5)


def test_remus_has_its_published_sizes():
    found = hull_geometry(load("remus"))
    assert found.planform_m2 == pytest.approx(0.226, rel=0.003)  # Prestero 2001, 3 digits
    assert found.volume_m3 == pytest.approx(0.0315, rel=0.006)
    assert found.wetted_m2 == pytest.approx(0.709, rel=0.02)  # his sum of strips
    assert found.buoyancy_x_m == pytest.approx(0.00554, abs=0.0005)


@pytest.mark.parametrize("points", [30, 60, 200])
def test_offsets_stand_for_the_analytic_hull(points):
    suboff = load("suboff")
    x = np.linspace(0.0, 4.3561, points)
    radius = np.round(hull_shape(suboff.hull).radius_m(x), 4)  # a drawing in tenths of mm
    offsets = {"offsets_x_from_nose_m": list(x), "offsets_radius_m": list(radius)}
    found = hull_geometry(
        type(suboff).model_validate(
            suboff.model_dump(by_alias=True, exclude_unset=True)
            | {"hull": {"length_m": 4.3561, **offsets}}
        )
    )
    exact = hull_geometry(suboff)
    # 30 points are 0.15 m apart: a thousandth of the volume, some hundredths of the cut station
    assert found.volume_m3 == pytest.approx(exact.volume_m3, rel=1e-3)
    assert found.wetted_m2 == pytest.approx(exact.wetted_m2, rel=3e-3)
    assert found.cut_x_m == pytest.approx(exact.cut_x_m, abs=0.03)


@settings(max_examples=25, deadline=None)
@given(st.floats(0.3, 3.0), st.sampled_from(["cone", "parabola", "ellipsoid"]))
def test_sizes_scale_with_the_hull(scale, tail):
    lengths = {"length_m": 2.0, "diameter_m": 0.4, "nose_length_m": 0.5, "tail_length_m": 0.6}
    one = hull_geometry(body(**lengths, tail_shape=tail))
    big = hull_geometry(body(**{k: scale * v for k, v in lengths.items()}, tail_shape=tail))
    assert big.volume_m3 == pytest.approx(scale**3 * one.volume_m3, rel=1e-7)
    assert big.wetted_m2 == pytest.approx(scale**2 * one.wetted_m2, rel=1e-5)


def test_myring_tail_ends_at_its_base_with_its_slope():
    shape = hull_shape(
        body(myring_theta_deg=20.0, tail_length_m=0.6, tail_base_diameter_m=0.1).hull
    )
    end = shape.radius_m(np.array([2.0, 2.0 - 1e-6]))
    assert end[0] == pytest.approx(0.05, abs=1e-9)
    assert (end[1] - end[0]) / 1e-6 == pytest.approx(np.tan(np.radians(20.0)), rel=1e-4)


def test_missing_sections_take_usual_lengths():
    found = hull_shape(body().hull)
    assert found.edges_m[1] == pytest.approx(0.4)  # one diameter
    assert found.tail_start_m == pytest.approx(1.0)  # 2.5 diameters from the end


def test_integrals_of_a_jump_are_refused():
    from auvident.errors import NumericsError

    wild = np.random.default_rng(1).standard_normal(4096)
    with pytest.raises(NumericsError, match="do not converge"):
        integrate(lambda x: wild[None, : x.size] * 1.0, np.array([0.0, 1.0]))


def test_variants_give_what_single_vehicles_give():
    suboff = load("suboff")
    lengths = np.array([4.0, 4.3561, 4.6])
    many = suboff.model_copy(update={"hull": suboff.hull.model_copy(update={"length_m": lengths})})
    found = hull_geometry(many)
    for i, length in enumerate(lengths):
        one = hull_geometry(changed(suboff, hull={"length_m": float(length)}))
        assert found.volume_m3[i] == pytest.approx(one.volume_m3, rel=1e-9)
        assert found.cut_area_m2[i] == pytest.approx(one.cut_area_m2, rel=1e-9)
