"""What follows from the coefficients: straight-line stability, turning, speed against rpm."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from auvident.constants import GRAVITY_MPS2
from auvident.schema.planes import BY_PLANE, Plane

TURN_ANGLES_DEG = (5.0, 10.0, 15.0, 20.0, 25.0)
NEWTON_STEPS, NEWTON_TOLERANCE = 60, 1e-12
FEED_DEG = 60.0  # deflection from which the turning curve is followed down to zero
FEED_STEP_DEG = 1.0

Values = Mapping[str, Any]


def horizontal_stability(c: Values, mass: Any, x_g: Any) -> np.ndarray:
    """G_H = 1 - N_v (Y_r - m) / (Y_v (N_r - m x_G)); straight-line stable when positive.

    Parameters
    ----------
    c : mapping
        Dimensional coefficients by symbol.
    mass, x_g : array_like
        kg; m forward of O.

    Returns
    -------
    ndarray
        Dimensionless; the same with prime or dimensional values (theory 1.6).
    """
    return 1.0 - c["N_uv"] * (c["Y_ur"] - mass) / (c["Y_uv"] * (c["N_ur"] - mass * x_g))


def vertical_stability(c: Values, mass: Any, x_g: Any) -> np.ndarray:
    """G_V = 1 - M_w (Z_q + m) / (Z_w (M_q - m x_G)), without the righting moment.

    The m x_G term, as in the horizontal plane, comes from (M_uq - m x_G) u q (theory 1.4).
    """
    return 1.0 - c["M_uw"] * (c["Z_uq"] + mass) / (c["Z_uw"] * (c["M_uq"] - mass * x_g))


def eigenvalues_per_metre(
    c: Values, mass: float, inertia: float, x_g: float, plane: Plane = "horizontal"
) -> np.ndarray:
    """Growth of sway and yaw (heave and pitch) per metre travelled, 1/m.

    Negative real parts decay; the righting moment of the vertical plane is left out. Shape (..., 2)
    for coefficients of shape (...).
    """
    row = BY_PLANE[plane]
    (force, moment), (a, b) = row.axes[1:], (row.names["a"], row.names["b"])
    cross = row.sigma * mass * x_g
    inertial = _matrix(
        mass - c[f"{force}_{a}dot"],
        cross - c[f"{force}_{b}dot"],
        cross - c[f"{moment}_{a}dot"],
        inertia - c[f"{moment}_{b}dot"],
    )
    damping = _matrix(
        c[f"{force}_u{a}"],
        c[f"{force}_u{b}"] - row.sigma * mass,
        c[f"{moment}_u{a}"],
        c[f"{moment}_u{b}"] - mass * x_g,
    )
    return np.linalg.eigvals(np.linalg.solve(inertial, damping))


def _matrix(*entries: Any) -> np.ndarray:
    """Matrices (..., 2, 2) of their entries, row by row."""
    stacked = np.stack(np.broadcast_arrays(*entries), axis=-1)
    return stacked.reshape(*stacked.shape[:-1], 2, 2)


def speed_per_rate_m(c: Values) -> float:
    """Speed over propeller rate, m: root of X_uu a^2 + T_nu a + T_nn = 0, a = u/n > 0.

    Returns
    -------
    float
        NaN when no forward speed balances the thrust.
    """
    drag, slope, thrust = float(c["X_uu"]), float(c["T_nu"]), float(c["T_nn"])
    if drag >= 0.0 or thrust <= 0.0:
        return float("nan")
    return float((-slope - np.sqrt(slope**2 - 4.0 * drag * thrust)) / (2.0 * drag))


def steady_turn(
    c: Values, mass: float, x_g: float, angle_rad: float, start: np.ndarray
) -> np.ndarray | None:
    """Sway and yaw rate over speed of a steady turn, by Newton's method.

    Every force is of second order in the velocities, so the solution does not depend on speed.

    Parameters
    ----------
    c : mapping
    mass, x_g : float
    angle_rad : float
        Rudder, positive to port.
    start : ndarray, shape (2,)
        First guess of (v/u, r/u).

    Returns
    -------
    ndarray, shape (2,), or None
        v/u and r/u in 1/m; None without convergence.
    """
    state = np.array(start, float)
    for _ in range(NEWTON_STEPS):
        v, r = state
        residual = np.array(
            [
                c["Y_uv"] * v
                + (c["Y_ur"] - mass) * r
                + c["Y_v|v|"] * v * abs(v)
                + c["Y_r|r|"] * r * abs(r)
                + c["Y_uud"] * angle_rad,
                c["N_uv"] * v
                + (c["N_ur"] - mass * x_g) * r
                + c["N_v|v|"] * v * abs(v)
                + c["N_r|r|"] * r * abs(r)
                + c["N_uud"] * angle_rad,
            ]
        )
        slope = np.array(
            [
                [
                    c["Y_uv"] + 2.0 * c["Y_v|v|"] * abs(v),
                    c["Y_ur"] - mass + 2.0 * c["Y_r|r|"] * abs(r),
                ],
                [
                    c["N_uv"] + 2.0 * c["N_v|v|"] * abs(v),
                    c["N_ur"] - mass * x_g + 2.0 * c["N_r|r|"] * abs(r),
                ],
            ]
        )
        if abs(np.linalg.det(slope)) < 1e-12 * np.prod(np.linalg.norm(slope, axis=1)):
            return None
        step = np.linalg.solve(slope, residual)
        state = state - step
        if np.all(np.abs(step) <= NEWTON_TOLERANCE * (1.0 + np.abs(state))):
            return state
    return None


def turning_table(c: Values, mass: float, x_g: float) -> list[dict[str, float]]:
    """Steady turns at several rudder angles (to port), speed loss included.

    The curve is followed from a hard-over rudder downwards, so a directionally unstable vehicle
    shows the branch that it really turns on.

    Returns
    -------
    list of dict
        Empty where nothing steers; else ``rudder_deg``, ``rate_per_speed_degpm`` (deg turned per
        metre, negative to port), ``drift_deg``, ``diameter_m``, ``speed_ratio`` of turn to
        straight run at equal rpm; speeds are those along the path.
    """
    if c["Y_uud"] == c["N_uud"] == 0.0:
        return []
    rows, state = [], np.array([0.1, -0.1])
    for degrees in np.arange(FEED_DEG, 0.5, -FEED_STEP_DEG):
        found = steady_turn(c, mass, x_g, np.radians(degrees), state)
        if found is None:
            continue
        state = found
        if degrees in TURN_ANGLES_DEG:
            rows.append(_turn_row(c, mass, x_g, float(degrees), state))
    return rows[::-1]


def _turn_row(
    c: Values, mass: float, x_g: float, degrees: float, state: np.ndarray
) -> dict[str, float]:
    """One row of the turning table."""
    v, r = (float(x) for x in state)
    speed = float(np.hypot(1.0, v))  # along the path, over u
    row = {
        "rudder_deg": degrees,
        "rate_per_speed_degpm": float(np.degrees(r)) / speed,
        "drift_deg": float(np.degrees(np.arctan(v))),
    }
    if abs(r) > NEWTON_TOLERANCE:  # else it is zero, as far as the solution tells
        row["diameter_m"] = 2.0 * speed / abs(r)
    drag = c["X_uu"] + c["X_vv"] * v**2 + (c["X_vr"] + mass) * v * r
    drag = drag + (c["X_rr"] + mass * x_g) * r**2 + c["X_uudd"] * np.radians(degrees) ** 2
    straight = speed_per_rate_m(c)
    turning = speed_per_rate_m({**c, "X_uu": drag})
    if np.isfinite(straight) and np.isfinite(turning):
        row["speed_ratio"] = speed * turning / straight
    return row


def linear_turning_gain(c: Values, mass: Any, x_g: Any) -> np.ndarray:
    """Steady r/(u delta), 1/m, of the linear equations; its sign reverses when G_H < 0."""
    yaw, sway = c["N_ur"] - mass * x_g, c["Y_ur"] - mass
    determinant = c["Y_uv"] * yaw - c["N_uv"] * sway
    return (c["N_uv"] * c["Y_uud"] - c["Y_uv"] * c["N_uud"]) / determinant


def speed_table(c: Values, rpm: tuple[float, ...]) -> list[dict[str, float]]:
    """Steady straight speed against propeller rpm; empty when no speed balances the thrust."""
    advance = speed_per_rate_m(c)
    if not np.isfinite(advance):
        return []
    return [{"rpm": n, "speed_mps": advance * n / 60.0} for n in rpm]


def righting_speed_mps(
    c: Values, mass: float, inertia: float, x_g: float, z_g: float
) -> float | None:
    """Speed above which a vertically unstable vehicle oscillates in spite of its righting moment.

    Routh's criterion for heave, pitch and pitch angle with the moment -m g z_G theta.

    Returns
    -------
    float or None
        m/s; None when the vehicle is stable at every speed, 0 when nothing rights it, or the
        centre of gravity lies above that of buoyancy and topples it.
    """
    if z_g < 0.0:
        return 0.0  # of the characteristic polynomial the last coefficient is negative
    m11, m12 = mass - c["Z_wdot"], -mass * x_g - c["Z_qdot"]
    m21, m22 = -mass * x_g - c["M_wdot"], inertia - c["M_qdot"]
    a11, a12, a21, a22 = c["Z_uw"], c["Z_uq"] + mass, c["M_uw"], c["M_uq"] - mass * x_g
    static = float(a11 * a22 - a12 * a21)
    if static >= 0.0:
        return None
    damping = float(m12 * a21 + m21 * a12 - m11 * a22 - m22 * a11)
    if damping <= 0.0:
        return 0.0
    reserve = damping * m11 + a11 * (m11 * m22 - m12 * m21)
    square = mass * GRAVITY_MPS2 * z_g * reserve / (damping * -static)
    return float(np.sqrt(square)) if square > 0.0 else 0.0
