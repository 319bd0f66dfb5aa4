"""Many models of one vehicle side by side, each with its own fin and its own start.

The right-hand side is that of `batch`, with one point for each model: their parameters are rows,
and so are fin and propeller rate. The servo is that of `actuation`, step by step, because on the
desk a fin is steered by what the vehicle does.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.jit import kernel
from auvident.physics.actuation import (
    ASYMMETRY,
    BACKLASH,
    DELAY,
    SLOWNESS,
    command_values,
    felt_angle,
    follow,
    race_at_fin,
    servo_parts,
    thrust_of,
)
from auvident.physics.batch import (
    invert_masses,
    place_inputs,
    point_system,
    point_work,
    rates,
    step_points,
)
from auvident.physics.term_tables import N_INPUTS, N_POSITIONS, N_POWERS, N_STATES, P_ROWS
from auvident.physics.terms import INPUTS, Structure, mass_matrices

Array = npt.NDArray[Any]

FIN, REVS, FACTOR, THRUST = (INPUTS.index(name) for name in ("d", "n", "thrust", "T"))
OF_RACE = tuple(INPUTS.index(name) for name in ("race", "flow", "reach"))
FIN_ROW, REVS_ROW, THRUST_ROW = ((N_POSITIONS + i) * N_POWERS for i in (FIN, REVS, THRUST))
RACE_ROW, FLOW_ROW, REACH_ROW = ((N_POSITIONS + i) * N_POWERS for i in OF_RACE)


@kernel
def _fill(fin, revs, speed, e, rows):
    """Fin, propeller rate, thrust and race (S,) of every model into their rows."""
    for s in range(fin.shape[0]):
        rows[FIN_ROW, s], rows[REVS_ROW, s] = fin[s], revs[s]
        rows[THRUST_ROW, s] = thrust_of(revs[s], speed[s], e[s])
        race, flow, reach = race_at_fin(rows[THRUST_ROW, s], speed[s], e[s])
        rows[RACE_ROW, s], rows[FLOW_ROW, s], rows[REACH_ROW, s] = race, flow, reach


@kernel
def _step(x, fin, revs, e, inputs, held, dt, system, work):
    """States x (4, S) one step later, in place."""
    _fill(fin, revs, x[0], e, work.rows)
    step_points(x.shape[1], inputs, held, held, dt, system, work, x)


@kernel
def _rates(x, fin, revs, e, inputs, held, system, work, out):
    """Rates (4, S) of the states."""
    _fill(fin, revs, x[0], e, work.rows)
    place_inputs(inputs, system.used, work.scalars)
    for i in range(x.shape[0]):
        for s in range(x.shape[1]):
            work.stage[i, s] = x[i, s]
    rates(x.shape[1], 0.0, held, held, system, work)
    for i in range(x.shape[0]):
        for s in range(x.shape[1]):
            out[i, s] = work.rate[i, s] if system.active[i] else 0.0


@kernel
def _turn(before, ordered, share, dt, e, taken, angle, mean):
    """Step means of the servo angles (S,); play and angle go on to the end of the step."""
    parts = np.ones((2, 4))
    for s in range(ordered.shape[0]):
        servo_parts(e[s], dt, share[s], parts)
        mean[s], taken[s], angle[s] = follow(
            before[s], ordered[s], share[s], parts, e[s], e[s, BACKLASH], taken[s], angle[s]
        )


@kernel
def _felt(angle, e, out):
    """Angles (S,) that act on the vehicle."""
    for s in range(angle.shape[0]):
        out[s] = felt_angle(angle[s], e[s])


class Fleet:
    """S models of one structure.

    Parameters
    ----------
    structure : Structure
    vectors : (S, n_parameters) array
        Parameter vectors.
    held_speed_mps : float, optional
        Hold this speed instead of solving the surge equation.
    rate_limit_radps : float, optional
        Of the fin, in place of what the models have.
    """

    def __init__(
        self,
        structure: Structure,
        vectors: Array,
        held_speed_mps: float | None = None,
        rate_limit_radps: float | None = None,
    ) -> None:
        self.structure, self.vectors = structure, vectors
        self.held_speed_mps, self.size = held_speed_mps, len(vectors)
        active = np.array([held_speed_mps is None, True, True, True])
        moves, moving = (vectors != vectors[0]).any(axis=0), np.zeros(N_INPUTS, dtype=bool)
        moving[[FIN, REVS, THRUST, *OF_RACE]] = True
        self._system = point_system(active, moves, moving, structure.equations)
        self._work = point_work(vectors[0], self.size)
        for position in np.flatnonzero(moves):
            self._work.rows[P_ROWS + position] = vectors[:, position]
        invert_masses(self.size, self._system, self._work)
        self._inputs, self._held = np.zeros(N_INPUTS), np.zeros(N_STATES)
        self._inputs[FACTOR], self._held[0] = 1.0, held_speed_mps or 0.0
        self.command = np.array(
            [command_values(structure.plane, structure.parameters, p) for p in vectors]
        )
        if rate_limit_radps is not None:
            self.command[:, SLOWNESS] = 1.0 / rate_limit_radps

    def parameter(self, name: str) -> Array:
        """Values (S,) of a coefficient or constant."""
        values: Array = self.vectors[:, self.structure.index(name)]
        return values

    def rates(self, states: Array, angle: Array, revs: Array) -> Array:
        """Rates (4, S) of the states with the fins at an angle (S,)."""
        out = np.empty((N_STATES, self.size))
        fin = self.felt(angle)
        _rates(
            states, fin, revs, self.command, self._inputs, self._held, self._system, self._work, out
        )
        return out

    def felt(self, angle: Array) -> Array:
        """Angle (S,) that acts: offset and separation of each model."""
        out = np.empty(self.size)
        _felt(angle, self.command, out)
        return out

    def step(self, states: Array, fin: Array, revs: Array, dt_s: float) -> None:
        """Advance the states (4, S) in place; `fin` (S,) acts over the step."""
        _step(
            states,
            fin,
            revs,
            self.command,
            self._inputs,
            self._held,
            dt_s,
            self._system,
            self._work,
        )
        if self.held_speed_mps is not None:
            states[0] = self.held_speed_mps


def possible(structure: Structure, vectors: Array) -> Array:
    """Models (S,) whose mass matrix is positive definite, by its leading minors."""
    mass = mass_matrices(structure, vectors.T)
    minors = [np.linalg.det(mass[:, :n, :n]) for n in (1, 2, 3)]
    found: Array = np.min(minors, axis=0) > 0.0
    return found


@dataclass
class Servos:
    """The servos of a fleet: each follows its orders, delayed, as its model says.

    Attributes
    ----------
    fleet : Fleet
    angle, taken : (S,) array
        Where they are, and what play has taken up.
    dt_s : float
    """

    fleet: Fleet
    angle: Array
    dt_s: float

    def __post_init__(self) -> None:
        gain = self.fleet.command[:, ASYMMETRY]
        self.taken = self.angle / np.where(self.angle > 0.0, 1.0 + gain, 1.0 - gain)
        late = np.maximum(self.fleet.command[:, DELAY], 0.0) / self.dt_s
        self._whole = np.floor(late).astype(int)
        self._share = late - self._whole
        self._orders = [self.taken.copy()] * (int(self._whole.max()) + 2)

    def follow(self, order: Array) -> Array:
        """Mean angle (S,) over the step in which an order is given."""
        self._orders = [*self._orders[1:], order]
        before, told, mean = order, order, np.empty(self.fleet.size)
        if len(self._orders) > 2 or self._share.any():
            table, models = np.array(self._orders), np.arange(self.fleet.size)
            at = len(table) - 1 - self._whole
            before, told = table[at - 1, models], table[at, models]
        own = self.fleet.command, self.taken, self.angle
        _turn(before, told, self._share, self.dt_s, *own, mean)
        return mean
