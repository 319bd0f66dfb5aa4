"""Maneuvers run in the model with a helm of its own: it decides from the simulated angle."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.physics.batch import inverse_mass
from auvident.physics.dynamics import ALL_STATES, N_STATES, N_VELOCITIES, step
from auvident.physics.term_tables import N_INPUTS
from auvident.physics.terms import Structure

Array = npt.NDArray[Any]
# seconds since the start, angle since the start [rad], last command [rad] -> command, thrust ratio
Helm = Callable[[float, float, float], tuple[float, float]]

APPROACH_STEP_S = 1.0e-3  # over which a speed is to stay as it is
FASTEST_MPS = 30.0  # no steady speed is looked for beyond


@dataclass(frozen=True)
class VirtualRun:
    """What happened: times (n,), states (n, 4) and inputs (n, 3)."""

    time_s: Array
    states: Array
    inputs: Array


def zigzag_helm(amplitude_rad: float, switch_rad: float) -> Helm:
    """Reverse the control each time the angle passes the switching angle on its side.

    Parameters
    ----------
    amplitude_rad : float
        First command; positive turns to port (bow down), so that the angle falls.
    switch_rad : float
        Positive.
    """

    def helm(time: float, angle: float, last: float) -> tuple[float, float]:
        command = last or amplitude_rad
        if command * angle < 0.0 and abs(angle) >= switch_rad:
            command = -command
        return command, 1.0

    return helm


def held_helm(control_rad: float) -> Helm:
    """Hold the control."""
    return lambda time, angle, last: (control_rad, 1.0)


def thrust_helm(ratios: Sequence[float], level_s: float) -> Helm:
    """Control amidships, the propeller rate in steps relative to the approach."""
    return lambda time, angle, last: (0.0, ratios[min(int(time / level_s), len(ratios) - 1)])


def combined_helm(control: Helm, thrust: Helm) -> Helm:
    """Control of one helm, thrust of another."""
    return lambda t, angle, last: (control(t, angle, last)[0], thrust(t, angle, last)[1])


def run_virtual(
    structure: Structure,
    p: Array,
    start: Array,
    n_rps: float,
    duration_s: float,
    helm: Helm,
    *,
    dt_s: float = 0.1,
    rate_limit_radps: float = math.inf,
) -> VirtualRun:
    """Run a maneuver in the model.

    Parameters
    ----------
    structure, p : Structure, (n_parameters,) array
    start : (4,) array
        u, a, b, angle.
    n_rps : float
        Propeller rate of the approach.
    duration_s : float
    helm : Helm
    dt_s : float
    rate_limit_radps : float
        Of the control surface.

    Returns
    -------
    VirtualRun
        Ends early where the model runs away.
    """
    inverse = np.empty((N_VELOCITIES, N_VELOCITIES))
    inverse_mass(p, structure.mass, structure.mass_weights, ALL_STATES, inverse)
    states, inputs = [np.asarray(start, dtype=float)], []
    acting, equations = healthy(np.zeros(3)), structure.equations
    command = control = 0.0
    for k in range(round(duration_s / dt_s)):
        x, out = states[-1], np.empty(N_STATES)
        command, ratio = helm(k * dt_s, x[3] - start[3], command)
        move = rate_limit_radps * dt_s
        control += min(max(command - control, -move), move)
        acting[0], acting[2] = control, n_rps * ratio
        inputs.append(acting[:3].copy())
        step(x, acting, x, x, dt_s, p, inverse, ALL_STATES, equations, out)
        if not all(map(math.isfinite, out)):
            break
        states.append(out)
    n = min(len(inputs), len(states))
    return VirtualRun(np.arange(n) * dt_s, np.array(states[:n]), np.array(inputs[:n]))


def healthy(inputs: Array) -> Array:
    """Inputs (15,) of the equations when the controls (3,) act as ordered and nothing else does."""
    return np.concatenate([inputs, [1.0], np.zeros(N_INPUTS - 4)])


def steady_approach(structure: Structure, p: Array, n_rps: float) -> Array:
    """State (4,) of a straight run ahead at a propeller rate, lateral motion held at zero.

    The speed is that at which nothing changes any more, however long the vehicle takes to come to
    it (a tanker of 7 m minutes); NaN where thrust and drag balance at none.
    """
    active, inverse = np.array([True, False, False, False]), np.empty((N_VELOCITIES, N_VELOCITIES))
    inverse_mass(p, structure.mass, structure.mass_weights, active, inverse)
    acting, equations = healthy(np.array([0.0, 0.0, n_rps])), structure.equations

    def gained(speed: float) -> float:
        x, out = np.array([speed, 0.0, 0.0, 0.0]), np.empty(N_STATES)
        step(x, acting, x, x, APPROACH_STEP_S, p, inverse, active, equations, out)
        return float(out[0] - speed)

    found = np.zeros(N_STATES)
    balanced = gained(0.0) > 0.0 > gained(FASTEST_MPS)
    found[0] = _last_gaining(gained, 0.0, FASTEST_MPS) if balanced else np.nan
    return found


def _last_gaining(gained: Callable[[float], float], low: float, high: float) -> float:
    """Where a gain turns into a loss, by halves; `scipy.optimize` takes 0.3 s to import."""
    while low < (middle := 0.5 * (low + high)) < high:
        low, high = (middle, high) if gained(middle) > 0.0 else (low, middle)
    return middle
