"""Straight steady runs of a fleet: the fin and the attitude that hold the course or the depth.

On a course that is held the rate is zero, and in the vertical plane the path is level: the drift
w = u tan(pitch) goes along the depth contour. What is left to find is speed or propeller rate,
the drift over the speed, and the angle of the fin, so that no velocity changes (Newton's method
on the rates of the equations of motion, all their forces included).
"""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from auvident.physics.fleet import Fleet

Array = npt.NDArray[Any]
Unknown = Literal["speed", "rate", "neither"]

STEPS, STEP, TOLERANCE = 60, 1.0e-6, 1.0e-10
LONGEST_MOVE = 0.2  # rad, or share of the speed, in one step: a start far off does not overshoot
STEEPEST = np.radians(45.0)  # beyond it neither the fin nor the drift are a run that can be held


@dataclass(frozen=True)
class SteadyRun:
    """Steady runs of S models.

    Attributes
    ----------
    states : (4, S) array
    angle : (S,) array
        Of the servo [rad].
    rate_rps : (S,) array
        Of the propeller.
    found : (S,) bool array
    """

    states: Array
    angle: Array
    rate_rps: Array
    found: Array


def steady_run(fleet: Fleet, speed_mps: float, rate_rps: float, unknown: Unknown) -> SteadyRun:
    """Steady runs of every model.

    Parameters
    ----------
    fleet : Fleet
    speed_mps, rate_rps : float
        Given, or where the search begins; positive, and not far below what is found.
    unknown : str
        Which of the two is sought; with ``neither`` the speed need not stay as it is.
    """

    def at(y: Array) -> tuple[Array, Array]:
        u = speed_mps * (y[0] if unknown == "speed" else np.ones(fleet.size))
        n = rate_rps * (y[0] if unknown == "rate" else np.ones(fleet.size))
        angle = np.arctan(y[1]) if fleet.structure.plane == "vertical" else np.zeros(fleet.size)
        return np.array([u, u * y[1], np.zeros(fleet.size), angle]), n

    def residual(y: Array) -> Array:
        states, n = at(y)
        rates = fleet.rates(states, y[2], n)[:3]
        if unknown == "neither" or fleet.held_speed_mps is not None:
            rates[0] = y[0] - 1.0
        return rates

    y, moved = np.zeros((3, fleet.size)), np.full(fleet.size, np.inf)
    y[0] = 1.0
    for _ in range(STEPS):
        base = residual(y)
        slopes = np.empty((fleet.size, 3, 3))
        for k in range(3):
            there = y.copy()
            there[k] += STEP
            slopes[:, :, k] = ((residual(there) - base) / STEP).T
        step = _solved(slopes, base.T).T
        y = y - np.clip(step, -LONGEST_MOVE, LONGEST_MOVE)
        moved = np.abs(step).max(axis=0)
        if not (moved > TOLERANCE).any():
            break
    states, n = at(y)
    found = (moved <= 1.0e3 * TOLERANCE) & (np.abs(y[2]) < STEEPEST) & (y[0] > 0.0)
    found &= np.abs(np.arctan(y[1])) < STEEPEST
    return SteadyRun(states, y[2], n, found)


def _solved(slopes: Array, base: Array) -> Array:
    """Newton steps (S, 3); none is found (infinite) where the equations do not tell."""
    finite = np.column_stack([slopes.reshape(len(base), -1), base])
    whole: Array = np.isfinite(finite).all(axis=1)
    step = np.full(base.shape, np.inf)
    sound = np.where(whole[:, None, None], slopes, np.eye(3))
    size = np.linalg.norm(sound, axis=2).prod(axis=1)
    whole &= np.abs(np.linalg.det(sound)) > 1e-12 * size
    if whole.any():
        step[whole] = np.linalg.solve(slopes[whole], base[whole][:, :, None])[:, :, 0]
    return step


@dataclass(frozen=True)
class Nomoto:
    """First-order steering of S models about a straight run: T dr/dt + r = K delta.

    ``gain_ps`` is K [1/s] by the angle of the fin as the model counts it, ``time_s`` T [s].
    """

    gain_ps: Array
    time_s: Array


def linear_steering(fleet: Fleet, run: SteadyRun) -> Nomoto:
    """K and T of the equations linearised about a straight run, its speed held.

    r over delta is K (1 + T3 s) / ((1 + T1 s)(1 + T2 s)), and T = T1 + T2 - T3 (Nomoto 1957).
    """
    step = 1.0e-5

    def rates(da: float, db: float, dd: float) -> Array:
        states = run.states.copy()
        states[1] += da
        states[2] += db
        return fleet.rates(states, run.angle + dd, run.rate_rps)[1:3]

    def slope(*by: float) -> Array:
        return (rates(*by) - rates(*(-x for x in by))) / (2.0 * step)

    (a11, a21), (a12, a22) = slope(step, 0.0, 0.0), slope(0.0, step, 0.0)
    b1, b2 = slope(0.0, 0.0, step)
    with np.errstate(divide="ignore", invalid="ignore"):
        determinant, lead = a11 * a22 - a12 * a21, a21 * b1 - a11 * b2
        return Nomoto(lead / determinant, -(a11 + a22) / determinant - b2 / lead)
