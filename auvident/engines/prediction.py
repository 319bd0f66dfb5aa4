"""The one prediction: logged inputs to predicted readings, with every effect in it.

What acts on the vehicle (`physics.actuation`), how it moves (`physics.dynamics`), what the
sensors read (`physics.sensing`), at a parameter vector, with derivatives by its free entries.
Simulation, output error and the analysis of residuals run it; the filters take its parts, with
inputs and readings to first order about the parameters of their start.
"""

import math
import threading
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.engines.accumulated import Sees, place_slopes
from auvident.engines.problem import Linear
from auvident.engines.records import Record, Source
from auvident.engines.smoothing import smoothed
from auvident.physics import readings as whole
from auvident.physics import sensing as sense
from auvident.physics.actuation import (
    COMMANDS,
    FORCE,
    NO_PAST,
    NO_STEP,
    NOWHERE,
    RACE,
    T_NN,
    T_NU,
    acting_with_steps,
    command_values,
)
from auvident.physics.dynamics import N_STATES, simulate_states, simulate_with_sensitivities
from auvident.physics.term_tables import N_INPUTS
from auvident.physics.terms import Structure
from auvident.schema.artifacts import Sensing
from auvident.schema.effects import parameter_of

Array = npt.NDArray[Any]

SMALL = 0.1  # an effect below this part of its step is not at work yet
# [of the prior] longest step of a slope where an effect is at work already. With 0.02 the slope by
# a limit of the rudder's rate was off by 1.3 deviations, and fits of `bay_trial` ended 20 to 40
# nats above their optimum; with this one those that converged end within 0.2.
SMALL_STEP = 1.0e-3
READING_STEP = 0.05  # [of the prior] step of a slope of the readings
USUAL_STEP_S = 0.1  # of a log at the usual rate
NO_WATER = np.zeros((0, 2))
MOST_KEPT = 1 << 23  # [numbers, 64 MB] of working memory is used again; more is given back


@dataclass(frozen=True)
class Frame:
    """What a prediction needs beside parameters and a record.

    Attributes
    ----------
    structure : Structure
    sensing : Sensing
    dt_s : float
    """

    structure: Structure
    sensing: Sensing
    dt_s: float

    def reading_effects(self, p: Array) -> Array:
        """Effects of the sensors in the order of `physics.sensing.READING`."""
        return sense.reading_values(self.structure.parameters, p)

    def command_effects(self, p: Array) -> Array:
        """Effects of servo and propeller in the order of `physics.actuation.COMMAND`."""
        return command_values(self.structure.plane, self.structure.parameters, p)


@dataclass(frozen=True)
class Free:
    """Parameters that move: positions, the column of every parameter, the unit of each.

    Attributes
    ----------
    positions : (n_free,) int array
    column : (n_parameters,) int array
        Column of each parameter (also of those that follow another), or -1.
    scale : (n_free,) array
    """

    positions: npt.NDArray[np.int64]
    column: npt.NDArray[np.int64]
    scale: Array

    @classmethod
    def among(
        cls, count: int, positions: Array, scale: Array, followers: Iterable[tuple[int, int]]
    ) -> "Free":
        """Some of so many parameters; pairs of one that follows and the one that it follows."""
        column = np.full(count, -1, dtype=np.int64)
        column[positions] = np.arange(len(positions))
        for follower, leader in followers:
            column[follower] = column[leader]
        return cls(positions, column, scale)

    def at(self, p: Array, values: Array) -> Array:
        """Parameters p with other values of the free ones; what follows moves along."""
        there = np.flatnonzero(self.column >= 0)
        leaders = self.positions[self.column[there]]
        q, followers = p.copy(), there != leaders
        q[self.positions] = values
        q[there[followers]] += (q - p)[leaders[followers]]
        return q

    def moved(self, p: Array, by: Array) -> Array:
        """Parameters p with the free ones moved, in units of scale."""
        return self.at(p, p[self.positions] + self.scale * by)


NOTHING_FREE = Free(NOWHERE, NOWHERE, np.zeros(0))


@dataclass(frozen=True)
class At:
    """A frame at a parameter vector of which some entries are free: what all records share.

    Attributes
    ----------
    frame : Frame
    p : (n_parameters,) array
    free : Free
    """

    frame: Frame
    p: Array
    free: Free

    @cached_property
    def reading_effects(self) -> Array:
        """Effects of the sensors in the order of `physics.sensing.READING`."""
        return self.frame.reading_effects(self.p)

    @cached_property
    def command_effects(self) -> Array:
        """Effects of servo and propeller in the order of `physics.actuation.COMMAND`."""
        return self.frame.command_effects(self.p)

    @cached_property
    def angle_is_as_read(self) -> bool:
        """Whether the angle has no bias and no scale."""
        e = self.reading_effects
        return not (e[sense.PITCH_BIAS] or e[sense.PITCH_SCALE])

    @cached_property
    def moves(self) -> "Moves":
        """The free effects on the inputs.

        Slopes by them are differences: play, dead band and limits have no slope where they are
        off, and take a step of the size to be expected there.
        """
        commands, e = COMMANDS[self.frame.structure.plane], self.command_effects
        found = _columns_of(commands, self.frame.structure.parameters, self.free)
        if e[RACE] == 0.0:  # the thrust turns no fin
            found = [(column, place) for column, place in found if place not in (T_NN, T_NU)]
        steps = np.zeros((len(found), 2))
        for k, (column, place) in enumerate(found):
            declared, scale = _step_of(commands[place]), self.free.scale[column]
            at_work = abs(e[place]) > SMALL * declared * scale
            step = min(declared, SMALL_STEP) if at_work else declared
            steps[k] = step * scale, step
        return Moves(*_both(found), steps)

    @cached_property
    def reading_moves(self) -> "Moves":
        """The free effects of the sensors."""
        found = _columns_of(sense.READING, self.frame.structure.parameters, self.free)
        columns, places = _both(found)
        return Moves(columns, places, READING_STEP * self.free.scale[columns])

    @cached_property
    def matrix(self) -> Array:
        """Sensor matrix (4, 4)."""
        frame = self.frame
        return sense.sensor_matrix(frame.structure.plane, frame.sensing, self.reading_effects)


@dataclass(frozen=True)
class Moves:
    """Free effects by which slopes are differences.

    Attributes
    ----------
    columns : (k,) int array
        Among the free parameters.
    places : (k,) int array
        In the order of `physics.actuation.COMMAND` or of `physics.sensing.READING`.
    steps : (k, 2) or (k,) array
        How far each is moved for its slope, and what the difference is divided by where that is
        not `READING_STEP`.
    """

    columns: npt.NDArray[np.int64]
    places: npt.NDArray[np.int64]
    steps: Array


NO_MOVES = Moves(NOWHERE, NOWHERE, NO_STEP)
NO_READING = Moves(NOWHERE, NOWHERE, np.zeros(0))


def _both(found: Sequence[tuple[int, int]]) -> tuple[Array, Array]:
    """Columns (k,) and places (k,) of some effects."""
    columns, places = np.array(found, dtype=np.int64).reshape(-1, 2).T
    return columns.copy(), places.copy()


def ran_away_remedy(dt_s: float) -> str:
    """What may be behind a simulation that diverges: the inputs, or steps longer than the usual."""
    text = "The inputs lie outside the range that the model was identified from"
    steps = f", or steps of {dt_s:g} s are too long for the vehicle: give a higher --rate"
    return f"{text}{steps if dt_s > USUAL_STEP_S else ''}."


def at_effects(frame: Frame, p: Array, record: Record) -> Record:
    """The record as the effects at p make it: acting inputs, states behind the readings."""
    at = At(frame, p, NOTHING_FREE)
    if _source(at, record) is None:
        return record
    inputs, start = _inputs(at, record, NO_MOVES)[0], _start(at, record)
    return replace(record, inputs=inputs, given=_behind(at, record), start=start)


def _source(at: At, record: Record) -> Source | None:
    """What effects need of the log; None where there are none, and a record is as it is logged."""
    return record.source if at.frame.structure.effects else None


def _behind(at: At, record: Record) -> Array:
    """States (n, 4) behind the readings."""
    frame, source = at.frame, _source(at, record)
    if source is None:
        return record.given
    return whole.states_behind(
        frame.structure.plane,
        frame.sensing,
        at.reading_effects,
        source.bridged,
        source.rates,
        frame.dt_s,
        source.from_middle_s,
        source.heading,
    )


def _followed(at: At, record: Record, active: Array, gain: Array | None) -> Array:
    """States (n, 4) behind the readings, of which inactive ones and the gain are used.

    Where that is the angle alone, which no effect of a sensor changes, those without effects do.
    """
    is_free = gain is None and active[0] and active[1] and active[2]
    return record.given if is_free and at.angle_is_as_read else _behind(at, record)


def _start(at: At, record: Record) -> Array:
    """State (4,) at the start; what a fit moved it by stays."""
    frame, source = at.frame, _source(at, record)
    if source is None:
        return record.start
    return whole.start_behind(
        frame.structure.plane,
        frame.sensing,
        at.reading_effects,
        record.start,
        source.start,
        source.rates,
        frame.dt_s,
        source.from_middle_s,
        source.heading,
    )


def _inputs(at: At, record: Record, moves: Moves) -> tuple[Array, Array]:
    """Inputs (n, 15) that act, and slopes (n, l, k) of the first of them."""
    frame, source = at.frame, _source(at, record)
    if source is None:
        return record.inputs, np.zeros((len(record.time_s), 0, len(moves.columns)))
    acting, slopes = acting_with_steps(
        source.raw,
        source.elapsed_s,
        source.speed,
        source.roll,
        source.pitch,
        frame.dt_s,
        at.command_effects,
        0.0 if source.depth is None else source.depth,
        len(record.time_s),
        moves.places,
        moves.steps,
        NO_PAST if source.past is None else source.past,
    )
    inputs = acting[len(source.raw) - len(record.time_s) :]
    if source.free_force is not None:
        inputs[:, FORCE:] = source.free_force
    return inputs, slopes


def input_slopes(frame: Frame, p: Array, acting: Record, free: Free) -> tuple[Array, Array]:
    """Slopes (n, 15, k) of the inputs by the free parameters in columns (k,), per unit of scale.

    By differences, see `At.moves`.

    Parameters
    ----------
    acting : Record
        As `at_effects` returns it.
    """
    at, source = At(frame, p, free), acting.source
    moves = at.moves
    if not len(moves.columns) or source is None:
        return np.zeros((len(acting.time_s), N_INPUTS, 0)), NOWHERE
    found = _inputs(at, acting, moves)[1]
    slopes = np.zeros((len(acting.time_s), N_INPUTS, len(moves.columns)))
    slopes[:, : found.shape[1]] = found
    return slopes, moves.columns


def _step_of(name: str) -> float:
    """Step for a slope by a difference, in units of scale."""
    return parameter_of(name).step if "." in name else SMALL_STEP


def _columns_of(
    effects: tuple[str, ...], names: tuple[str, ...], free: Free
) -> list[tuple[int, int]]:
    """Column among the free parameters, and place, of those effects that are free."""
    return [
        (column, effects.index(names[i]))
        for column, i in enumerate(free.positions)
        if names[i] in effects
    ]


def simulated(frame: Frame, p: Array, record: Record, active: Array) -> Array:
    """States (n, 4) of the free-running simulation of a record; see `at_effects` for its form."""
    return simulate_states(
        record.start, record.inputs, record.given, frame.dt_s, p, active, frame.structure.equations
    )


def readings(frame: Frame, p: Array, record: Record, states: Array) -> Array:
    """Readings (n, 4) that the sensors would give of the states."""
    return _readings(At(frame, p, NOTHING_FREE), record, states, NO_READING)[0]


def _readings(at: At, record: Record, states: Array, moves: Moves) -> tuple[Array, Array]:
    """Readings (n, 4), and their slopes (n, 4, k) by some effects of the sensors."""
    source, frame = record.source, at.frame
    return whole.readings_with_steps(
        frame.structure.plane,
        frame.sensing,
        at.reading_effects,
        moves.places,
        moves.steps,
        READING_STEP,
        states,
        states[:, 3],
        np.zeros((len(states), 2)) if source is None else source.rates,
        frame.dt_s,
        None if source is None else source.from_middle_s,
        None if source is None else source.heading,
    )


@dataclass(frozen=True)
class Observed:
    """A simulated record as the sensors see it.

    Attributes
    ----------
    readings : (n, 4) array
    z : (n, 4, 5 + n_free) array
        States with their slopes, see `physics.dynamics.simulate_with_sensitivities`.
    sees : Sees
        How the sensors see the slopes.
    """

    readings: Array
    z: Array
    sees: Sees


class _Memory(threading.local):
    """Working memory of a thread: fresh memory from the system costs as much as the arithmetic."""

    values = np.empty(0)

    def of(self, *shape: int) -> Array:
        """Memory of a shape, which holds until it is asked for again."""
        size = math.prod(shape)
        if size > MOST_KEPT:
            return np.empty(shape)
        if size > len(self.values):
            self.values = np.empty(size)
        return self.values[:size].reshape(shape)


_memory = _Memory()


def observed(at: At, record: Record, active: Array, gain: Array | None = None) -> Observed | None:
    """Predicted readings of a record with what their slopes are made of; None: it runs away.

    What is returned rests on working memory, and holds until this thread asks for more.

    Parameters
    ----------
    at : At
    record : Record
        As ingested; the effects are put in here.
    active : (4,) bool array
    gain : (4,) array, optional
        Observer gain, see `physics.dynamics.simulate_with_sensitivities`.
    """
    frame, free = at.frame, at.free
    inputs, slopes = _inputs(at, record, at.moves)
    z = _memory.of(len(record.time_s), N_STATES, 1 + N_STATES + len(free.positions))
    if not simulate_with_sensitivities(
        _start(at, record),
        inputs,
        slopes,
        at.moves.columns,
        _followed(at, record, active, gain),
        np.zeros(N_STATES) if gain is None else gain,
        frame.dt_s,
        at.p,
        active,
        frame.structure.equations,
        free.column,
        free.scale,
        z,
    ):
        return None
    return _observed(at, record, z)


def _observed(at: At, record: Record, z: Array) -> Observed:
    """A simulation as the sensors see it, with their effects."""
    e, source, dt_s = at.reading_effects, record.source, at.frame.dt_s
    states = np.ascontiguousarray(z[:, :, 0])
    found, slopes = _readings(at, record, states, at.reading_moves)
    by_pitch = NO_WATER
    if at.frame.structure.plane == "vertical" and source is not None:
        by_pitch = sense.water_by_pitch(at.frame.sensing, e, states[:, 3], source.heading)
    sees = Sees(
        at.matrix,
        np.ascontiguousarray(by_pitch),
        e[sense.DVL_DELAY] / dt_s,
        e[sense.GYRO_DELAY] / dt_s,
        1 + N_STATES + at.reading_moves.columns,
        slopes,
    )
    return Observed(found, z, sees)


@dataclass(frozen=True)
class Slopes:
    """Readings (n, 4) and their slopes (n, 4, 4 + n_free) by the start and the free parameters."""

    readings: Array
    slopes: Array
    states: Array


def readings_with_slopes(
    at: At, record: Record, active: Array, gain: Array | None = None
) -> Slopes | None:
    """Predicted readings of a record with their slopes; None where the simulation runs away.

    Parameters
    ----------
    at : At
    record : Record
        As ingested; the effects are put in here.
    active : (4,) bool array
    gain : (4,) array, optional
        Observer gain, see `physics.dynamics.simulate_with_sensitivities`.
    """
    found = observed(at, record, active, gain)
    if found is None:
        return None
    slopes = np.empty(found.z.shape)
    place_slopes(found.sees, found.z, slopes)
    return Slopes(found.readings, slopes[:, :, 1:], found.z[:, :, 0].copy())


def seen_rows(at: At, record: Record, channels: Array) -> Array:
    """Rows (n, 4) of the readings that a prediction can be compared with."""
    seen = np.isfinite(record.measured) & channels
    if at.frame.structure.effects:
        seen &= ~sense.unknown_rows(at.reading_effects, len(seen), at.frame.dt_s)
    return seen


def linear_about(
    frame: Frame, p: Array, records: Sequence[Record], free: Free, n: int
) -> tuple[Linear, Array]:
    """Inputs and readings to first order in the free parameters, and the sensor matrix (4, 4).

    Readings are taken about the smoothed states behind the log, which the model has no part in.

    Parameters
    ----------
    records : sequence of Record
        As `at_effects` returns them, in the order of the problem.
    n : int
        Length that they are padded to.
    """
    at, k = At(frame, p, free), len(records)
    moves, matrix = at.reading_moves, at.matrix
    offset, by_reading = np.zeros((k, n, 4)), np.zeros((k, n, 4, len(moves.columns)))
    inputs: list[Array] = []
    columns = np.zeros(0, dtype=np.int64)
    for j, record in enumerate(records):
        length, states = len(record.time_s), smoothed(record.given, frame.dt_s)
        base, by_reading[j, :length] = _readings(at, record, states, moves)
        offset[j, :length] = base - states @ matrix.T
        slope, columns = input_slopes(frame, p, record, free)
        inputs.append(np.concatenate([slope, np.zeros((n - length, *slope.shape[1:]))]))
    return Linear(columns, np.array(inputs), offset, moves.columns, by_reading), matrix
