"""Steady runs and linear steering against closed forms."""

import numpy as np
import pytest

from auvident.physics.ase.stability import linear_turning_gain
from auvident.physics.fleet import Fleet
from auvident.physics.steady import linear_steering, steady_run
from auvident.schema.planes import PLANES, Plane
from tests.physics.desk_models import changed, linear, remus


def test_the_speed_of_a_straight_run_is_that_of_thrust_equal_to_drag() -> None:
    models = remus("horizontal")
    fleet, c = Fleet(models.structure, models.vectors), models.of_first()
    n = 15.0
    run = steady_run(fleet, 1.0, n, "speed")
    roots = np.roots([c["X_uu"], c["T_nu"] * n, c["T_nn"] * n**2])
    assert run.found[0]
    assert run.states[0, 0] == pytest.approx(roots.max(), rel=1e-9)
    back = steady_run(fleet, float(run.states[0, 0]), 12.0, "rate")
    assert back.rate_rps[0] == pytest.approx(n, rel=1e-9)


@pytest.mark.parametrize("plane", PLANES)
def test_nothing_changes_on_a_steady_run(plane: Plane) -> None:
    models = remus(plane, 20)
    fleet = Fleet(models.structure, models.vectors)
    run = steady_run(fleet, 1.5, 15.0, "rate")
    rates = fleet.rates(run.states, run.angle, run.rate_rps)
    assert run.found.all()
    np.testing.assert_allclose(rates, 0.0, atol=1e-8)
    u, a, _, angle = run.states
    if plane == "vertical":
        np.testing.assert_allclose(a * np.cos(angle) - u * np.sin(angle), 0.0, atol=1e-12)


def test_the_trim_solves_the_balance_of_heave_and_pitch() -> None:
    """Small angles: Z_uw u w + Z_uud u^2 d + W-B = 0, M_uw u w + M_uud u^2 d - z_G W theta = 0."""
    models = changed(remus("vertical"), Z_w__w__=0.0, M_w__w__=0.0)
    c, u = models.of_first(), 1.5
    run = steady_run(Fleet(models.structure, models.vectors), u, 15.0, "rate")
    matrix = np.array(
        [
            [c["Z_uw"] * u**2, c["Z_uud"] * u**2],
            [c["M_uw"] * u**2 - 0.0196 * 30.48 * 9.80665, c["M_uud"] * u**2],
        ]
    )
    weight = 30.48 * 9.80665 - 300.0
    theta, elevator = np.linalg.solve(matrix, [-weight, 0.0])
    assert run.states[3, 0] == pytest.approx(theta, rel=2e-3)  # angles of a degree
    assert run.angle[0] == pytest.approx(elevator, rel=2e-3)


def test_what_no_fin_carries_is_not_found() -> None:
    models = remus("vertical")
    run = steady_run(Fleet(models.structure, models.vectors), 0.1, 1.0, "rate")
    assert not run.found[0]


def test_nomoto_follows_from_the_coefficients() -> None:
    """K by the gain of the linear equations; T1 + T2 - T3 by their matrices (theory 1.3)."""
    models = linear(remus("horizontal"))
    c, u = models.of_first(), 1.5
    fleet = Fleet(models.structure, models.vectors)
    steering = linear_steering(fleet, steady_run(fleet, u, 15.0, "rate"))
    m, i_z = 30.48, 3.45
    assert steering.gain_ps[0] == pytest.approx(u * linear_turning_gain(c, m, 0.0), rel=1e-6)
    mass = np.array([[m - c["Y_vdot"], -c["Y_rdot"]], [-c["N_vdot"], i_z - c["N_rdot"]]])
    damping = u * np.array([[c["Y_uv"], c["Y_ur"] - m], [c["N_uv"], c["N_ur"]]])
    fin = u**2 * np.array([c["Y_uud"], c["N_uud"]])
    times = -1.0 / np.linalg.eigvals(np.linalg.solve(mass, damping))
    zero = mass[0, 0] * fin[1] - mass[1, 0] * fin[0]
    zero /= damping[1, 0] * fin[0] - damping[0, 0] * fin[1]
    assert steering.time_s[0] == pytest.approx((times.sum() - zero).real, rel=1e-5)
