"""The unknown forces that would make a prediction follow the readings.

The motion, and a force on each axis of the plane that walks at random, are estimated by an extended
Kalman filter with the equations of the model, and smoothed. Drawn against heading, rate of turn
and time the forces show what the model lacks (Kristensen, Madsen and Jorgensen 2004); they are
for the eye, no verdict rests on them.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import DIAGNOSED_START_STD, VehicleTime
from auvident.engines.free_run import start_std
from auvident.engines.motion_pass import motion_pass
from auvident.engines.noise import LONGEST_CORRELATION_S
from auvident.engines.prediction import NOTHING_FREE, At, at_effects, readings, seen_rows
from auvident.engines.records import Record
from auvident.errors import NumericsError
from auvident.estimation.output_error import correlation_time
from auvident.estimation.smoother import smooth
from auvident.physics.batch import inverse_mass
from auvident.physics.sensing import sensor_matrix
from auvident.physics.terms import FREE_FORCES
from auvident.stages.diagnose.fit.case import ACTIVE, Case
from auvident.stages.diagnose.fit.fits import N_CHANNELS, Fitted

Array = npt.NDArray[Any]

LEAST_SLOW = 0.1  # [of the sensor noise] a residual that is all noise still allows so much motion
LEAST_TIME_S: VehicleTime = 1.0  # forces that change faster are taken for noise
N_FORCES = len(FREE_FORCES)
START_FORCE = 3.0  # a force starts within this many of its usual sizes


@dataclass(frozen=True)
class Forces:
    """Smoothed forces of one record; all NaN where the motion could not be followed.

    Attributes
    ----------
    mean : (n, 3) array
        X, Y [N] and N [N m], positive ahead, to starboard and turning to starboard.
    std : (n, 3) array
    """

    mean: Array
    std: Array


@dataclass(frozen=True)
class Stepper:
    """One step of the model with forces.

    Attributes
    ----------
    case : Case
    parameters : (n_parameters,) array
        Those of the model, and a factor of one on the forces.
    inverse : (3, 3) array
        Inverse mass matrix.
    """

    case: Case
    parameters: Array
    inverse: Array

    @property
    def model(self) -> tuple[Any, ...]:
        """The last arguments of a pass, from the step on."""
        setup = self.case.setup
        return setup.dt_s, self.parameters, ACTIVE, setup.structure.equations


def stepper_of(case: Case, p: Array) -> Stepper:
    """The step of a model, its forces open."""
    structure, inverse, q = case.setup.structure, np.empty((3, 3)), p.copy()
    q[[case.position(name) for name in FREE_FORCES]] = 1.0
    if not inverse_mass(q, structure.mass, structure.mass_weights, ACTIVE, inverse) > 0.0:
        raise NumericsError(
            "the mass matrix is not positive definite",
            "unknown forces of the diagnosis",
            "Check mass, inertia and added masses in the vehicle file.",
        )
    return Stepper(case, q, inverse)


@dataclass(frozen=True)
class Walk:
    """Size (3,) of the forces [N, N, N m], their random walk per root second, sensor noise."""

    size: Array
    intensity: Array
    noise: Array


def unknown_forces(case: Case, fitted: Fitted) -> dict[str, Array]:
    """Forces (n, 3) of every record by its id, see `smoothed_forces`."""
    return {name: forces.mean for name, forces in smoothed_forces(case, fitted).items()}


def smoothed_forces(case: Case, fitted: Fitted) -> dict[str, Forces]:
    """Unknown forces of every record by its id, with standard deviations.

    A reading that is late by an effect of the model makes the force late by as much.

    Parameters
    ----------
    case : Case
    fitted : Fitted
        A fit of this case.

    Raises
    ------
    NumericsError
        The mass matrix is not positive definite.
    """
    step = stepper_of(case, fitted.parameters)
    walk = walk_of(step, fitted)
    return {
        record.id: _smoothed(step, fitted, record, residual.states, walk)
        for record, residual in zip(case.records, fitted.residuals, strict=True)
    }


def walk_of(step: Stepper, fitted: Fitted) -> Walk:
    """Forces that would leave residuals like those found.

    A force of size f and correlation time T on a mass m that forgets at the rate d makes
    deviations of variance (f / m)^2 / (d (d + 1 / T)) and correlation time 1 / d + T.
    """
    case, mass = step.case, np.linalg.inv(step.inverse)
    # the colours take a residual smoother than theirs for one with less noise
    noise = np.maximum([c.white for c in fitted.colours], case.setup.sensor_std[:N_CHANNELS])
    slow, lasting = slow_part(case, fitted, noise)
    rate = np.maximum(damping_of(step, fitted), 1.0 / lasting)
    time_s = np.maximum(lasting - 1.0 / rate, LEAST_TIME_S)
    size = np.sqrt(mass**2 @ (slow**2 * rate * (rate + 1.0 / time_s)))
    return Walk(size, size * np.sqrt(2.0 / time_s), noise)


def damping_of(step: Stepper, fitted: Fitted) -> Array:
    """Rate (3,) [1/s] at which each velocity forgets, at the usual motion."""
    case = step.case
    states = np.median(np.concatenate([r.states for r in fitted.residuals]), axis=0)
    acting = [at_effects(case.setup.frame, fitted.parameters, r).inputs for r in case.records]
    x = np.concatenate([states[:N_CHANNELS], np.zeros(N_FORCES)])
    usual = np.median(np.concatenate(acting), axis=0)
    held = np.array([states, states])
    passed = motion_pass(
        x,
        np.eye(len(x)),
        np.array([usual, usual]),
        held,
        np.full(held.shape, np.nan),
        np.eye(4),
        np.ones(4),
        np.zeros(len(x)),
        *step.model,
    )
    if passed is None:  # lost within a step: it forgets nothing, and no force will be found
        return np.zeros(N_CHANNELS)
    slopes = passed[-1][0]
    rate: Array = (1.0 - slopes.diagonal()[:N_CHANNELS]) / case.setup.dt_s
    return rate


def slow_part(case: Case, fitted: Fitted, noise: Array) -> tuple[Array, Array]:
    """Size (3,) and correlation time (3,) [s] of the residuals but for their noise."""
    dt_s, time_s = case.setup.dt_s, np.empty(N_CHANNELS)
    slow = np.sqrt(np.maximum(np.nan_to_num(fitted.rms) ** 2 - noise**2, (LEAST_SLOW * noise) ** 2))
    for c in range(N_CHANNELS):
        errors = [r.error[:, c] for r in fitted.residuals if np.isfinite(r.error[:, c]).any()]
        longest = round(LONGEST_CORRELATION_S / dt_s)
        both = [correlation_time(_bridged(e), longest) * dt_s for e in errors]
        one_side = 0.5 * float(np.mean(both)) if both else 0.0
        time_s[c] = one_side * (1.0 + (noise[c] / slow[c]) ** 2)  # the noise itself lasts no time
    return slow, np.clip(time_s, LEAST_TIME_S, LONGEST_CORRELATION_S)


def _bridged(error: Array) -> Array:
    """Errors with lines over the rows without a reading."""
    rows, seen = np.arange(len(error)), np.isfinite(error)
    return np.interp(rows, rows[seen], error[seen])


def _smoothed(step: Stepper, fitted: Fitted, record: Record, states: Array, walk: Walk) -> Forces:
    frame, p = step.case.setup.frame, fitted.parameters
    sensor = sensor_matrix(frame.structure.plane, frame.sensing, frame.reading_effects(p))
    offset = readings(frame, p, record, states) - states @ sensor.T
    seen = seen_rows(At(frame, p, NOTHING_FREE), record, ACTIVE)
    read = np.where(seen, record.measured - offset, np.nan)
    start = [start_std(colour, DIAGNOSED_START_STD) for colour in fitted.colours]
    spread = np.diag(np.append(start, START_FORCE * walk.size) ** 2)
    growth = np.append(np.zeros(N_CHANNELS), walk.intensity**2 * step.case.setup.dt_s)
    passed = motion_pass(
        np.append(states[0, :N_CHANNELS], np.zeros(N_FORCES)),
        spread,
        at_effects(frame, p, record).inputs,
        states,
        read,
        sensor,
        np.append(walk.noise, np.nan) ** 2,
        growth,
        *step.model,
    )
    if passed is None:
        nothing = np.full((len(read), N_FORCES), np.nan)
        return Forces(nothing, nothing)
    found = smooth(*passed)
    variance = np.einsum("kii->ki", found.covariance)[:, N_CHANNELS:]
    return Forces(found.mean[:, N_CHANNELS:], np.sqrt(variance))
