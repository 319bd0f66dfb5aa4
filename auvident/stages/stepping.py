"""A model one step at a time, for a controller, a planner or an environment to train in.

The right-hand side, its step and the servo are those of every prediction.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.engines.carried import structure_behind, vector_behind
from auvident.errors import NumericsError
from auvident.physics.actuation import (
    CONTROL,
    DRIVE,
    FLOW,
    MOTOR_LAG,
    RACED,
    REACH,
    REVS,
    THRUST,
    command_values,
    felt_angle,
    race_at_fin,
    thrust_of,
)
from auvident.physics.batch import inverse_mass
from auvident.physics.dynamics import ALL_STATES, N_STATES, SPEED_LIMIT, step
from auvident.physics.fleet import Fleet, Servos
from auvident.physics.maneuvers.desk import made_good
from auvident.physics.term_tables import N_INPUTS, N_VELOCITIES
from auvident.physics.terms import Structure
from auvident.schema.artifacts import IdentifiedModel

Array = npt.NDArray[Any]


@dataclass(frozen=True)
class ModelStepper:
    """The equations of a model with its parameters.

    Attributes
    ----------
    structure : Structure
    p : (n_parameters,) array
    commands : (19,) array
        Effects of servo and propeller in the order of `physics.actuation.COMMAND`.
    inverse : (3, 3) array
        Inverse mass matrix.
    """

    structure: Structure
    p: Array
    commands: Array
    inverse: Array

    def step(self, state: Array, fin_rad: float, rate_rps: float, dt_s: float) -> Array:
        """State (4,) after a step with the fin and the propeller held.

        Raises
        ------
        NumericsError
            The state is no longer finite.
        """
        x, out = np.array(state, dtype=float), np.empty(N_STATES)
        acting = self._acting(fin_rad, rate_rps, float(x[0]))
        equations = self.structure.equations
        step(x, acting, x, x, dt_s, self.p, self.inverse, ALL_STATES, equations, out)
        return finite(out)

    def _acting(self, fin_rad: float, rate_rps: float, speed_mps: float) -> Array:
        """Inputs (15,) of the equations: what fin and propeller do at a speed."""
        thrust = thrust_of(rate_rps, speed_mps, self.commands)
        inputs = np.zeros(N_INPUTS)
        inputs[CONTROL] = felt_angle(fin_rad, self.commands)
        inputs[REVS], inputs[THRUST], inputs[DRIVE] = rate_rps, 1.0, thrust
        inputs[[RACED, FLOW, REACH]] = race_at_fin(thrust, speed_mps, self.commands)
        return inputs


def stepper_of(model: IdentifiedModel) -> ModelStepper:
    """The equations of a model, ready to be stepped."""
    structure, p = structure_behind(model), vector_behind(model)
    inverse = np.empty((N_VELOCITIES, N_VELOCITIES))
    inverse_mass(p, structure.mass, structure.mass_weights, ALL_STATES, inverse)
    return ModelStepper(structure, p, command_values(model.plane, structure.parameters, p), inverse)


def finite(state: Array) -> Array:
    """The state, if it is one that a vehicle can be in.

    Raises
    ------
    NumericsError
        It is not.
    """
    if not (np.abs(state[:N_VELOCITIES]) < SPEED_LIMIT).all():
        raise NumericsError(
            "the simulation diverges",
            f"state {np.array2string(state, precision=3)}",
            "Take a shorter step, or inputs and states within the range of the trial.",
        )
    return state


class SteppedFleet:
    """One model under way, with the memory of its servo and its propeller.

    Parameters
    ----------
    model : IdentifiedModel
    state : (4,) array
    fin_rad, rate_rps : float
        Angle of the servo and rate of the propeller at the start.
    dt_s : float
        Step.

    Attributes
    ----------
    way_m : (2,) array
        Made through the water since the start: north and east, in the vertical plane along and
        down.
    """

    def __init__(
        self, model: IdentifiedModel, state: Array, fin_rad: float, rate_rps: float, dt_s: float
    ) -> None:
        self._fleet = Fleet(structure_behind(model), vector_behind(model)[None])
        self._states, self._dt_s = np.array(state, dtype=float)[:, None], dt_s
        self._rate, self.way_m = rate_rps, np.zeros(2)
        self._servos = Servos(self._fleet, np.array([float(fin_rad)]), dt_s)

    @property
    def state(self) -> Array:
        """State (4,) now."""
        return self._states[:, 0].copy()

    @property
    def fin_rad(self) -> float:
        """Angle of the servo now."""
        return float(self._servos.angle[0])

    def step(self, order_rad: float, rate_rps: float) -> Array:
        """State (4,) one step later, with fin and propeller ordered so for the whole of it."""
        revs = np.array([self._turned(rate_rps)])
        mean = self._servos.follow(np.array([float(order_rad)]))
        felt, before = self._fleet.felt(mean), self._gone()
        self._fleet.step(self._states, felt, revs, self._dt_s)
        self.way_m = self.way_m + 0.5 * self._dt_s * (before + self._gone())
        return finite(self.state)

    def _gone(self) -> Array:
        """Velocity (2,) of the way."""
        return made_good(self._fleet, self._states)[:, 0]

    def _turned(self, ordered_rps: float) -> float:
        """Mean rate over the step, which the propeller follows with its lag."""
        lag = float(self._fleet.command[0, MOTOR_LAG])
        if lag <= 0.0:
            return ordered_rps
        keep, before = np.exp(-self._dt_s / lag), self._rate
        self._rate = ordered_rps + (before - ordered_rps) * keep
        return float(ordered_rps + (before - ordered_rps) * (1.0 - keep) * lag / self._dt_s)
