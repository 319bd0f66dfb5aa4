"""The equations of both planes written out by hand (theory 1.3 and 1.4), for comparison.

Nothing of the package is used here. The functions accept complex numbers, so that a complex
step through them gives derivatives exact to rounding.
"""

from collections.abc import Callable, Mapping

import numpy as np

Values = Mapping[str, complex]
STATES = 4
GRAVITY = 9.80665  # standard gravity, CGPM 1901


def magnitude(x: complex) -> complex:
    """|x| that stays analytic under a complex step."""
    return x if np.real(x) >= 0 else -x


def horizontal(x, inputs, c: Values) -> tuple[np.ndarray, np.ndarray]:
    """Mass matrix of (u, v, r) and right-hand side (f_X, f_Y, f_N); theory 2.2.21-27."""
    u, v, r, _ = x
    d, e, n = inputs
    m, mx = c["m"], c["m x_G"]
    mass = np.array(
        [
            [m - c["X_udot"], 0, 0],
            [0, m - c["Y_vdot"], mx - c["Y_rdot"]],
            [0, mx - c["N_vdot"], c["I"] - c["N_rdot"]],
        ]
    )
    f_x = (
        c["X_uu"] * u * magnitude(u)
        + c["X_vv"] * v**2
        + (c["X_vr"] + m) * v * r
        + (c["X_rr"] + mx) * r**2
        + c["X_uudd"] * u**2 * (d**2 + e**2)
        + c["T_nn"] * n * magnitude(n)
        + c["T_nu"] * magnitude(n) * u
    )
    f_y = (
        c["Y_uv"] * u * v
        + (c["Y_ur"] - m) * u * r
        + c["Y_v|v|"] * v * magnitude(v)
        + c["Y_r|r|"] * r * magnitude(r)
        + c["Y_uud"] * u**2 * d
    )
    f_n = (
        c["N_uv"] * u * v
        + (c["N_ur"] - mx) * u * r
        + c["N_v|v|"] * v * magnitude(v)
        + c["N_r|r|"] * r * magnitude(r)
        + c["N_uud"] * u**2 * d
    )
    return mass, np.array([f_x, f_y, f_n])


def vertical(x, inputs, c: Values) -> tuple[np.ndarray, np.ndarray]:
    """Mass matrix of (u, w, q) and right-hand side (f_X, f_Z, f_M); theory 2.2.28-33.

    The centre of buoyancy is the origin, so the restoring moment is that of the weight alone.
    """
    u, w, q, theta = x
    d, e, n = inputs
    m, mx, mz = c["m"], c["m x_G"], c["z_GW"] / GRAVITY
    mass = np.array(
        [
            [m - c["X_udot"], 0, mz],
            [0, m - c["Z_wdot"], -mx - c["Z_qdot"]],
            [mz, -mx - c["M_wdot"], c["I"] - c["M_qdot"]],
        ]
    )
    f_x = (
        c["X_uu"] * u * magnitude(u)
        + c["X_ww"] * w**2
        + (c["X_wq"] - m) * w * q
        + (c["X_qq"] + mx) * q**2
        + c["X_uudd"] * u**2 * (d**2 + e**2)
        + c["T_nn"] * n * magnitude(n)
        + c["T_nu"] * magnitude(n) * u
        - c["W-B"] * np.sin(theta)
    )
    f_z = (
        c["Z_uw"] * u * w
        + (c["Z_uq"] + m) * u * q
        + mz * q**2
        + c["Z_w|w|"] * w * magnitude(w)
        + c["Z_q|q|"] * q * magnitude(q)
        + c["Z_uud"] * u**2 * d
        + c["W-B"] * np.cos(theta)
    )
    f_m = (
        c["M_uw"] * u * w
        + (c["M_uq"] - mx) * u * q
        - mz * w * q
        + c["M_w|w|"] * w * magnitude(w)
        + c["M_q|q|"] * q * magnitude(q)
        + c["M_uud"] * u**2 * d
        - c["z_GW"] * np.sin(theta)
        - c["x_GW"] * np.cos(theta)
    )
    return mass, np.array([f_x, f_z, f_m])


EQUATIONS: dict[str, Callable] = {"horizontal": horizontal, "vertical": vertical}


def rate(plane: str, x, inputs, c: Values, active) -> np.ndarray:
    """Time derivative of (u, a, b, angle); states that are not active stand still."""
    mass, force = EQUATIONS[plane](x, inputs, c)
    on = np.flatnonzero(active[:3])
    result = np.zeros(STATES, dtype=np.result_type(mass, force))
    result[on] = np.linalg.solve(mass[np.ix_(on, on)], force[on])
    if active[3]:
        result[3] = x[2]
    return result


def random_values(plane: str, symbols, rng: np.random.Generator) -> dict[str, float]:
    """Coefficients and constants of a vehicle of some 50 kg and 2 m; both signs occur.

    The mass matrix is positive definite and well away from singular.
    """
    values = {symbol: float(rng.uniform(-30.0, 30.0)) for symbol in symbols}
    values |= {"m": 50.0, "m x_G": rng.uniform(-2, 2), "I": 20.0}
    values |= {"W-B": rng.uniform(-3, 3), "z_GW": rng.uniform(0, 20), "x_GW": rng.uniform(-2, 2)}
    for symbol in symbols:
        if symbol.endswith("dot"):
            values[symbol] = float(rng.uniform(-3.0, 3.0))
    for symbol in ("X_udot", "Y_vdot", "Z_wdot", "N_rdot", "M_qdot"):
        if symbol in values:
            values[symbol] = float(rng.uniform(-40.0, 0.0))
    return values


def stable_values(plane: str) -> dict[str, float]:
    """A dissipative, straight-line stable vehicle with time constants of a second or two."""
    a, b = ("v", "r") if plane == "horizontal" else ("w", "q")
    big_a, big_b = ("Y", "N") if plane == "horizontal" else ("Z", "M")
    turn = 1.0 if plane == "horizontal" else -1.0
    values = {
        "X_udot": -1.5,
        "X_uu": -3.0,
        f"X_{a}{a}": -4.0,
        f"X_{a}{b}": turn * 20.0,
        f"X_{b}{b}": -1.0,
        "X_uudd": -8.0,
        "T_nn": 0.03,
        "T_nu": -0.3,
        f"{big_a}_{a}dot": -30.0,
        f"{big_a}_{b}dot": turn * 1.5,
        f"{big_a}_u{a}": -40.0,
        f"{big_a}_u{b}": turn * 6.0,
        f"{big_a}_{a}|{a}|": -90.0,
        f"{big_a}_{b}|{b}|": turn * 0.5,
        f"{big_a}_uud": turn * 15.0,
        f"{big_b}_{a}dot": turn * 1.5,
        f"{big_b}_{b}dot": -5.0,
        f"{big_b}_u{a}": turn * -8.0,
        f"{big_b}_u{b}": -9.0,
        f"{big_b}_{a}|{a}|": turn * -3.0,
        f"{big_b}_{b}|{b}|": -8.0,
        f"{big_b}_uud": -10.0,
    }
    constants = {"m": 32.0, "m x_G": 0.3, "I": 3.5, "W-B": 0.0}
    constants |= {"z_GW": 0.0, "x_GW": 0.0}
    if plane == "vertical":
        constants |= {"W-B": -2.0, "z_GW": 6.0, "x_GW": 0.5}
    return values | constants
