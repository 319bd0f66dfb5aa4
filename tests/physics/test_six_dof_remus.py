"""Six degrees of freedom against the equations of Prestero's REMUS 100, written out one by one.

T. Prestero, MIT/WHOI 2001, his six equations of motion and tables B (combined coefficients).
He prints every coupling between the planes; here they follow from the mass matrix. What is left
between the two is the cross-flow drag, by component there and along the cross-flow here, and
M_rp = -N_pq, which he rounds to 4.86 where K_pdot - N_rdot of his tables is 4.81.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from auvident.physics.six_dof import (
    angles_of,
    mass_matrix,
    rates_six_dof,
    simulate_six_dof,
    state_of,
    system_of,
)
from auvident.physics.six_dof_terms import six_dof_structure

WHOLE = six_dof_structure()
WEIGHT, BUOYANCY, Z_G, MASS = 299.0, 306.0, 0.0196, 299.0 / 9.80665
I_XX, I_YY, I_ZZ = 0.177, 3.45, 3.45
THRUST, TORQUE, RATE = 3.86, -0.543, 25.4  # N, N m, rev/s; at 1.54 m/s
PLANAR = {
    "X_uu": -1.62,
    "X_udot": -0.93,
    "X_wq": -35.5,
    "X_qq": -1.93,
    "X_vr": 35.5,
    "X_rr": -1.93,
    "Y_v|v|": -1310.0,
    "Y_r|r|": 0.632,
    "Y_uv": -28.6,
    "Y_vdot": -35.5,
    "Y_rdot": 1.93,
    "Y_ur": 5.22,
    "Y_uud": 9.64,
    "Z_w|w|": -131.0,
    "Z_q|q|": -0.632,
    "Z_uw": -28.6,
    "Z_wdot": -35.5,
    "Z_qdot": -1.93,
    "Z_uq": -5.22,
    "Z_uud": -9.64,
    "M_w|w|": 3.18,
    "M_q|q|": -188.0,
    "M_uw": 24.0,
    "M_wdot": -1.93,
    "M_qdot": -4.88,
    "M_uq": -2.0,
    "M_uud": -6.15,
    "N_v|v|": -3.18,
    "N_r|r|": -94.0,
    "N_uv": -24.0,
    "N_vdot": 1.93,
    "N_rdot": -4.88,
    "N_ur": -2.0,
    "N_uud": -6.15,
}
ROLL = {"K_p|p|": -0.130, "K_pdot": -0.0704}
ACROSS = {
    "Y_wp": 35.5,
    "Y_pq": 1.93,
    "Z_vp": -35.5,
    "Z_rp": 1.93,
    "M_vp": -1.93,
    "M_rp": 4.86,
    "N_wp": -1.93,
    "N_pq": -4.86,
}
ROUNDED = ROLL["K_pdot"] - PLANAR["N_rdot"] - ACROSS["M_rp"]


def whole() -> np.ndarray:
    """His vehicle as parameters of the package."""
    constants = {"m": MASS, "I_xx": I_XX, "I_yy": I_YY, "I_zz": I_ZZ}
    constants |= {"W-B": WEIGHT - BUOYANCY, "z_GW": Z_G * WEIGHT}
    propeller = {"T_nn": THRUST / RATE**2, "K_nn": TORQUE / RATE**2}
    return WHOLE.vector(PLANAR | ROLL | constants | propeller)


def forces(nu: np.ndarray, roll: float, pitch: float, rudder: float, elevator: float):
    """Right-hand sides of his equations, with everything but the accelerations."""
    c, (u, v, w, p, q, r) = PLANAR | ROLL | ACROSS, nu
    down, arm = WEIGHT - BUOYANCY, MASS * Z_G
    x = -down * np.sin(pitch) + c["X_uu"] * u * abs(u) + (c["X_wq"] - MASS) * w * q
    x += c["X_qq"] * q * q + (c["X_vr"] + MASS) * v * r + c["X_rr"] * r * r - arm * p * r + THRUST
    y = down * np.cos(pitch) * np.sin(roll) + c["Y_v|v|"] * v * abs(v) + c["Y_r|r|"] * r * abs(r)
    y += c["Y_uv"] * u * v + (c["Y_wp"] + MASS) * w * p + (c["Y_ur"] - MASS) * u * r
    y += -arm * q * r + c["Y_pq"] * p * q + c["Y_uud"] * u * u * rudder
    z = down * np.cos(pitch) * np.cos(roll) + c["Z_w|w|"] * w * abs(w) + c["Z_q|q|"] * q * abs(q)
    z += c["Z_uw"] * u * w + (c["Z_uq"] + MASS) * u * q + (c["Z_vp"] - MASS) * v * p
    z += arm * (p * p + q * q) + c["Z_rp"] * r * p + c["Z_uud"] * u * u * elevator
    k = -Z_G * WEIGHT * np.cos(pitch) * np.sin(roll) + c["K_p|p|"] * p * abs(p)
    k += -(I_ZZ - I_YY) * q * r + arm * (u * r - w * p) + TORQUE
    m = -Z_G * WEIGHT * np.sin(pitch) + c["M_w|w|"] * w * abs(w) + c["M_q|q|"] * q * abs(q)
    m += c["M_uw"] * u * w + c["M_uq"] * u * q - (I_XX - I_ZZ) * r * p + arm * (v * r - w * q)
    m += c["M_vp"] * v * p + c["M_rp"] * r * p + c["M_uud"] * u * u * elevator
    n = c["N_v|v|"] * v * abs(v) + c["N_r|r|"] * r * abs(r) + c["N_uv"] * u * v + c["N_ur"] * u * r
    n += c["N_wp"] * w * p + (c["N_pq"] - (I_YY - I_XX)) * p * q + c["N_uud"] * u * u * rudder
    return np.array([x, y, z, k, m, n])


def mass() -> np.ndarray:
    """What multiplies the accelerations in his equations."""
    c, arm = PLANAR | ROLL, MASS * Z_G
    matrix = np.diag([MASS, MASS, MASS, I_XX, I_YY, I_ZZ])
    matrix -= np.diag([c[s] for s in ("X_udot", "Y_vdot", "Z_wdot", "K_pdot", "M_qdot", "N_rdot")])
    matrix[0, 4] = matrix[4, 0] = arm
    matrix[1, 3] = matrix[3, 1] = -arm
    matrix[1, 5], matrix[5, 1] = -c["Y_rdot"], -c["N_vdot"]
    matrix[2, 4], matrix[4, 2] = -c["Z_qdot"], -c["M_wdot"]
    return matrix


def explained(nu: np.ndarray) -> np.ndarray:
    """What the package has beyond his forces: cross-flow along itself, M_rp unrounded."""
    _, v, w, p, q, r = nu
    across = {"v": np.hypot(v, w), "w": np.hypot(v, w), "q": np.hypot(q, r), "r": np.hypot(q, r)}
    more = {x: y * (across[x] - abs(y)) for x, y in zip("vwqr", (v, w, q, r), strict=True)}
    pairs = (("Y", "vr"), ("Z", "wq"), ("M", "wq"), ("N", "vr"))
    y, z, m, n = (sum(PLANAR[f"{a}_{x}|{x}|"] * more[x] for x in pair) for a, pair in pairs)
    return np.array([0.0, y, z, 0.0, m + ROUNDED * r * p, n - ROUNDED * p * q])


@pytest.mark.parametrize("seed", range(10))
def test_what_differs_is_cross_flow_and_a_rounding(seed: int) -> None:
    rng = np.random.default_rng(seed)
    nu, angles = rng.normal(size=6) * [1.5, 0.3, 0.3, 0.5, 0.3, 0.3], rng.uniform(-0.6, 0.6, 3)
    fins, parameters = rng.uniform(-0.2, 0.2, 2), whole()
    np.testing.assert_allclose(mass_matrix(WHOLE, parameters), mass(), rtol=1e-12, atol=1e-12)
    inputs = np.array([*fins, RATE, 1.0])
    rates = rates_six_dof(state_of(nu, angles), inputs, system_of(WHOLE, parameters))[:6]
    expected = forces(nu, *angles[:2], *fins) + explained(nu)
    np.testing.assert_allclose(mass() @ rates, expected, rtol=1e-9, atol=1e-9)


def flown(rudder: float, elevator: float, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """States u to r, roll, pitch, heading, depth (n, 10) at 10 Hz.

    His equations with what is `explained`, in Euler angles; the package.
    """

    def rate(_: float, x: np.ndarray) -> np.ndarray:
        (u, v, w, p, q, r), (roll, pitch, _) = x[:6], x[6:9]
        angles = (
            p + np.tan(pitch) * (q * np.sin(roll) + r * np.cos(roll)),
            q * np.cos(roll) - r * np.sin(roll),
            (q * np.sin(roll) + r * np.cos(roll)) / np.cos(pitch),
        )
        sinking = -u * np.sin(pitch) + np.cos(pitch) * (v * np.sin(roll) + w * np.cos(roll))
        pushed = forces(x[:6], roll, pitch, rudder, elevator) + explained(x[:6])
        accelerations = np.linalg.solve(mass(), pushed)
        return np.array([*accelerations, *angles, sinking])

    start = np.zeros(10)
    start[0] = 1.54
    times = np.arange(0.0, seconds, 0.1)
    his = solve_ivp(rate, (0.0, seconds), start, t_eval=times, rtol=1e-8, atol=1e-10).y.T
    inputs = np.tile([rudder, elevator, RATE, 1.0], (len(times), 1))
    system = system_of(WHOLE, whole())
    states = simulate_six_dof(state_of(start[:6], np.zeros(3)), inputs, 0.1, system, substeps=8)
    return his, np.column_stack([states[:, :6], angles_of(states[:, 6:10]), states[:, 12]])


@pytest.mark.parametrize(
    ("rudder_deg", "elevator_deg", "seconds"), [(-4.0, 0.0, 60.0), (0.0, -2.0, 30.0)]
)
def test_a_turning_circle_and_a_change_of_depth_are_those_of_his_equations(
    rudder_deg: float, elevator_deg: float, seconds: float
) -> None:
    """With what differs put in. Without it his circle goes on to 5.6 rad, this one to 3.7: he has
    Y_v|v| ten times what he calculated, so that it is no body of revolution, and the buoyant
    vehicle descends at 15 degrees of incidence all the while.
    """
    his, own = flown(np.radians(rudder_deg), np.radians(elevator_deg), seconds)
    away = np.abs(own - his).max(axis=0) / np.abs(his).max(axis=0)
    # steps of an eightieth of a second, where roll swings at 5 rad/s
    assert away.max() < 1e-4, away
    assert (np.abs(his[-1, 8]) > np.pi) if rudder_deg else (np.abs(his[-1, 9]) > 1.0)
