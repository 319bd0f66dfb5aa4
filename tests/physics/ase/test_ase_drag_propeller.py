import numpy as np
import pytest
from ase_vehicles import changed, load

from auvident.physics.ase.accuracy import NOMINAL
from auvident.physics.ase.drag import cylinder_drag, finite_length_factor, friction_coefficient
from auvident.physics.ase.propeller import thrust_coefficients, thrust_line
from auvident.stages.ase import estimate


def test_friction_lines_agree_where_ships_and_vehicles_run():
    reynolds = np.array([2e6, 1.2e7, 1e8])
    ittc = friction_coefficient(reynolds)
    assert ittc[1] == pytest.approx(0.075 / (np.log10(1.2e7) - 2) ** 2)
    for line in ("prandtl_schlichting", "schoenherr"):
        assert friction_coefficient(reynolds, line) == pytest.approx(ittc, rel=0.06)  # known gap
    schoenherr = friction_coefficient(1.2e7, "schoenherr")
    left = 0.242 / np.sqrt(schoenherr)
    assert left == pytest.approx(np.log10(1.2e7 * schoenherr), rel=1e-9)  # it solves its equation


def test_cross_flow_tables_are_those_of_jorgensen_and_datcom():
    assert cylinder_drag([1e4, 5e4, 5e5, 1e7]) == pytest.approx([1.10, 1.20, 0.29, 0.70])
    assert finite_length_factor(np.array([8.0, 12.0])) == pytest.approx([0.66, 0.71])
    both = [finite_length_factor(np.array([6.963]), s)[0] for s in ("datcom", "jorgensen")]
    assert both == pytest.approx([0.6447, 0.6503], abs=5e-4)  # theory 8.2; fit of theory 3.2


def test_suboff_resistance_is_the_measured_one():
    """87.4 N at 3.046 m/s, C_T = 3.15e-3 at Re 1.2e7, bare hull (theory 8.1): within 8 %."""
    viscosity = 3.046 * 4.26086 / 1.2e7
    bare = changed(
        load("suboff"),
        fin=[],
        ase={"appendage_cd": 0.0},
        vehicle={"design_speed_mps": 3.046},
        fluid={"density_kgpm3": 1000.0, "kinematic_viscosity_m2ps": viscosity},
    )
    result = estimate(bare)
    drag = -result.by_symbol()["X_uu"].value
    assert drag * 3.046**2 == pytest.approx(87.4, rel=0.08)
    assert drag / (500.0 * result.geometry["wetted_m2"]) == pytest.approx(3.15e-3, rel=0.08)


def test_propeller_gives_the_numbers_of_mss():
    """MSS remus100.m: T_nn 0.17997, T_nu -1.1092 before thrust deduction, to 0.5 %."""
    remus = changed(load("remus"), fluid={"density_kgpm3": 1026.0})
    t_nn, t_nu = thrust_coefficients(remus.propeller, 1026.0, NOMINAL)
    assert t_nn == pytest.approx(0.17997, rel=0.005)
    assert t_nu == pytest.approx(-1.1092, rel=0.005)
    n = 1525.0 / 60.0
    assert t_nn * n * n + t_nu * n * 2.5 == pytest.approx(45.8, rel=0.005)
    hull = changed(remus, propeller={"thrust_deduction": 0.1})
    less = thrust_coefficients(hull.propeller, 1026.0, NOMINAL)
    assert less == pytest.approx((0.9 * t_nn, 0.9 * t_nu))


def test_propeller_table_becomes_the_line_through_it():
    table = {"diameter_m": 0.14, "table_j": [0, 0.2, 0.4, 0.6, 1.5]}
    table["table_kt"] = [0.45, 0.37, 0.29, 0.21, -0.3]  # the last point brakes: left out
    vehicle = load("remus").model_dump(by_alias=True, exclude_unset=True) | {"propeller": table}
    propeller = type(load("remus")).model_validate(vehicle).propeller
    assert thrust_line(propeller) == pytest.approx((0.45, -0.4))
