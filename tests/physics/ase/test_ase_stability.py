import numpy as np
import pytest
from ase_vehicles import changed, fins, load
from scipy.integrate import solve_ivp

from auvident.constants import GRAVITY_MPS2
from auvident.physics.ase import stability
from auvident.stages.ase import estimate


def coefficients(vehicle):
    return {c.symbol: c.value for c in estimate(vehicle).coefficients}


def test_margins_of_roddys_table_follow_from_his_derivatives():
    """Theory 8.1: m' = 0.0177 bare, 0.0183 appended, x_G' = 0; vertical G -1.162874."""
    bare = {"Y_uv": -0.005948, "N_uv": -0.012795, "Y_ur": 0.001811, "N_ur": -0.001597}
    # back-solved mass to 3 digits: G is 20 with a gradient of 1300 per unit of m'
    assert stability.horizontal_stability(bare, 0.0177, 0.0) == pytest.approx(-20.385, rel=0.01)
    vertical = {"Z_uw": -0.013910, "M_uw": 0.010324, "Z_uq": -0.007545, "M_uq": -0.003702}
    assert stability.vertical_stability(vertical, 0.0183, 0.0) == pytest.approx(-1.163, rel=0.02)


def linear_growth(c, mass, inertia, x_g, speed=1.0):
    """Largest growth rate of sway and yaw by integrating the linear equations in time."""
    inertial = np.array(
        [
            [mass - c["Y_vdot"], mass * x_g - c["Y_rdot"]],
            [mass * x_g - c["N_vdot"], inertia - c["N_rdot"]],
        ]
    )
    force = np.array([[c["Y_uv"], c["Y_ur"] - mass], [c["N_uv"], c["N_ur"] - mass * x_g]])
    run = solve_ivp(
        lambda _, s: np.linalg.solve(inertial, force @ s) * speed,
        (0, 20),
        [1.0, 0.3],
        t_eval=[10, 20],
        rtol=1e-10,
        atol=1e-16,
    )
    early, late = np.linalg.norm(run.y, axis=0)
    return np.log(late / early) / 10.0


@pytest.mark.parametrize("kinds", [(), ("rudder", "elevator")])
def test_sign_of_the_margin_is_that_of_a_disturbed_run(kinds):
    remus = load("remus")
    c = coefficients(changed(remus, fin=fins(remus, *kinds)))
    margin = stability.horizontal_stability(c, 30.48, 0.0)
    growth = linear_growth(c, 30.48, 3.45, 0.0)
    assert (margin > 0.0) == (growth < 0.0)
    eigenvalues = stability.eigenvalues_per_metre(c, 30.48, 3.45, 0.0)
    assert growth == pytest.approx(eigenvalues.real.max(), abs=0.1)  # complex: phase


def test_vertical_margin_counts_the_centre_of_gravity():
    """Finding: theory 1.6 drops m x_G from the vertical margin; both planes must agree."""
    c = coefficients(load("remus"))
    for x_g in (-0.1, 0.0, 0.1):
        horizontal = stability.horizontal_stability(c, 30.48, x_g)
        assert stability.vertical_stability(c, 30.48, x_g) == pytest.approx(horizontal, rel=1e-12)


def test_steady_turn_is_where_a_simulated_turn_ends():
    c, m, inertia = coefficients(load("remus")), 30.48, 3.45
    delta = np.radians(10.0)
    inertial = np.array([[m - c["Y_vdot"], -c["Y_rdot"]], [-c["N_vdot"], inertia - c["N_rdot"]]])

    def rate(_, s):
        v, r = s
        y = c["Y_uv"] * v + (c["Y_ur"] - m) * r + c["Y_v|v|"] * v * abs(v)
        n = c["N_uv"] * v + c["N_ur"] * r + c["N_v|v|"] * v * abs(v)
        y += c["Y_r|r|"] * r * abs(r) + c["Y_uud"] * delta
        n += c["N_r|r|"] * r * abs(r) + c["N_uud"] * delta
        return np.linalg.solve(inertial, [y, n])

    end = solve_ivp(rate, (0, 200), [0.0, 0.0], rtol=1e-10, atol=1e-12).y[:, -1]
    rows = {row["rudder_deg"]: row for row in stability.turning_table(c, m, 0.0)}
    found = rows[10.0]
    rate = end[1] / np.hypot(1.0, end[0])  # along the path
    assert np.radians(found["rate_per_speed_degpm"]) == pytest.approx(rate, rel=1e-6)
    assert np.tan(np.radians(found["drift_deg"])) == pytest.approx(end[0], rel=1e-6)
    assert found["rate_per_speed_degpm"] < 0.0  # a positive rudder turns to port
    assert 0.5 < found["speed_ratio"] < 1.0


def test_small_rudder_turns_as_the_linear_gain_says():
    c = coefficients(load("remus"))
    gain = float(stability.linear_turning_gain(c, 30.48, 0.0))
    small = stability.steady_turn(c, 30.48, 0.0, 1e-5, np.zeros(2))
    assert small is not None
    assert small[1] / 1e-5 == pytest.approx(gain, rel=1e-3)  # quadratic terms of 1e-5


def test_unstable_hull_turns_on_with_the_rudder_amidships():
    remus = load("remus")
    weak = changed(remus, fin=fins(remus, "rudder", "elevator", efficiency=0.35))
    facts = estimate(weak).facts["horizontal"]
    assert facts["G"] < 0.0
    assert not facts["straight_line_stable"]
    smallest = facts["turns"][0]
    assert smallest["rate_per_speed_degpm"] < 0.0  # the branch a hard-over rudder leads to


def test_speed_balances_thrust_and_drag():
    c = coefficients(load("remus"))
    advance = stability.speed_per_rate_m(c)
    n, u = 25.0, 25.0 * advance
    force = c["X_uu"] * u * u + c["T_nn"] * n * n + c["T_nu"] * n * u
    assert force == pytest.approx(0.0, abs=1e-9 * c["T_nn"] * n * n)
    table = estimate(load("remus")).facts["speed"]["table"]
    assert table[0]["speed_mps"] == pytest.approx(advance * table[0]["rpm"] / 60.0)


def test_righting_moment_holds_an_unstable_vehicle_below_a_speed():
    remus = load("remus")
    weak = changed(remus, fin=fins(remus, "rudder", "elevator", efficiency=0.35))
    limit = estimate(weak).facts["vertical"]["stable_below_mps"]
    c, m, inertia, z_g = coefficients(weak), 30.48, 3.45, 0.0196

    def growth(u):
        inertial = np.array(
            [[m - c["Z_wdot"], -c["Z_qdot"]], [-c["M_wdot"], inertia - c["M_qdot"]]]
        )
        force = u * np.array([[c["Z_uw"], c["Z_uq"] + m], [c["M_uw"], c["M_uq"]]])
        upper = np.linalg.solve(inertial, np.c_[force, [0.0, -m * GRAVITY_MPS2 * z_g]])
        return np.linalg.eigvals(np.vstack([upper, [0, 1, 0]])).real.max()

    assert growth(0.99 * limit) < 0.0 < growth(1.01 * limit)


@pytest.mark.parametrize("efficiency", [0.35, 1.0])
def test_a_high_centre_of_gravity_topples_whatever_the_fins_do(efficiency):
    """The last coefficient of the characteristic polynomial, -Z_uw u m g z_G, is negative."""
    remus = load("remus")
    high = changed(
        remus,
        fin=fins(remus, "rudder", "elevator", efficiency=efficiency),
        vehicle={**remus.model_dump(by_alias=True)["vehicle"], "z_g_m": -0.01},
    )
    facts = estimate(high).facts["vertical"]
    assert not facts["stable_at_every_speed"]
    assert facts["stable_below_mps"] == 0.0


def test_vehicle_that_nothing_steers_has_no_steady_turns():
    """A rudder turned into the horizontal plane by its dihedral acts in the vertical one only."""
    remus = load("remus")
    flat = changed(remus, fin=fins(remus, "rudder", dihedral_deg=90.0))
    assert estimate(flat).facts["horizontal"]["turns"] == []
