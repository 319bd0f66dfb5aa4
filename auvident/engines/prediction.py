"""The one prediction: logged inputs to predicted readings, with every effect in it.

What acts on the vehicle (`physics.actuation`), how it moves (`physics.dynamics`), what the
sensors read (`physics.sensing`), at a parameter vector, with derivatives by its free entries.
Simulation, output error and the analysis of residuals run it; the filters take its parts, with
inputs and readings to first order about the parameters of their start.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.constants import VehicleTime
from auvident.engines.problem import Linear
from auvident.engines.records import Record, Source
from auvident.physics import sensing as sense
from auvident.physics.actuation import COMMANDS, FORCE, acting_inputs, actuate_steps, command_values
from auvident.physics.dynamics import N_STATES, simulate_states, simulate_with_sensitivities
from auvident.physics.term_tables import N_INPUTS
from auvident.physics.terms import Structure
from auvident.schema.artifacts import Sensing
from auvident.schema.effects import parameter_of

Array = npt.NDArray[Any]

SMALL = 0.1  # an effect below this part of its step is not at work yet
SMALL_STEP = 0.02  # [of the prior] longest step of a slope where an effect is at work already
READING_STEP = 0.05  # [of the prior] step of a slope of the readings
# readings are smoothed over this time before slopes are taken from them
SMOOTHED_S: VehicleTime = 1.5


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
    """Parameters that move: positions, the column of every parameter, unit and step of each.

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


def at_effects(frame: Frame, p: Array, record: Record) -> Record:
    """The record as the effects at p make it: acting inputs, states behind the readings."""
    source = record.source
    if source is None or not frame.structure.effects:
        return record
    e = frame.reading_effects(p)
    behind = sense.states_behind(
        frame.structure.plane,
        frame.sensing,
        e,
        source.bridged,
        source.rates,
        frame.dt_s,
        source.from_middle_s,
        source.heading,
    )
    inputs = _inputs(frame, frame.command_effects(p), record)
    return replace(record, inputs=inputs, given=behind, start=_start(frame, e, record, source))


def _start(frame: Frame, e: Array, record: Record, source: Source) -> Array:
    """State (4,) at the start; what a fit moved it by stays."""
    plane = frame.structure.plane
    middle, heading = (None if x is None else x[:1] for x in (source.from_middle_s, source.heading))
    args = (source.start[None], source.rates[:1], frame.dt_s, middle, heading)
    here, without = (
        sense.states_behind(plane, frame.sensing, values, *args)[0]
        for values in (e, np.zeros_like(e))
    )
    start: Array = record.start + here - without
    return start


def _inputs(frame: Frame, e: Array, record: Record) -> Array:
    source = record.source
    assert source is not None
    whole = acting_inputs(
        source.raw,
        source.elapsed_s,
        source.speed,
        source.roll,
        source.pitch,
        frame.dt_s,
        e,
        0.0 if source.depth is None else source.depth,
    )
    inputs = whole[len(source.raw) - len(record.time_s) :]
    if source.free_force is not None:
        inputs[:, FORCE:] = source.free_force
    return np.ascontiguousarray(inputs)


def input_slopes(frame: Frame, p: Array, acting: Record, free: Free) -> tuple[Array, Array]:
    """Slopes (n, 12, k) of the inputs by the free parameters in columns (k,), per unit of scale.

    By differences: play, dead band and limits have no slope where they are off, and take a step
    of the size to be expected there.

    Parameters
    ----------
    acting : Record
        As `at_effects` returns it.
    """
    commands, e = COMMANDS[frame.structure.plane], frame.command_effects(p)
    found = _columns_of(commands, frame.structure.parameters, free)
    source = acting.source
    if not found or source is None:
        return np.zeros((len(acting.time_s), N_INPUTS, 0)), np.zeros(0, dtype=np.int64)
    columns, places = np.array(found, dtype=np.int64).T
    steps = np.zeros((len(found), 2))
    for k, place in enumerate(places):
        declared, scale = parameter_of(commands[place]).step, free.scale[columns[k]]
        at_work = abs(e[place]) > SMALL * declared * scale
        step = min(declared, SMALL_STEP) if at_work else declared
        steps[k] = step * scale, step
    slopes = np.zeros((len(acting.time_s), N_INPUTS, len(found)))
    actuate_steps(
        source.raw,
        source.elapsed_s,
        source.speed,
        frame.dt_s,
        e,
        places.copy(),
        steps,
        acting.inputs,
        slopes,
    )
    return slopes, columns.copy()


def _columns_of(
    effects: tuple[str, ...], names: tuple[str, ...], free: Free
) -> list[tuple[int, int]]:
    """Column among the free parameters, and place, of those effects that are free."""
    return [
        (column, effects.index(names[i]))
        for column, i in enumerate(free.positions)
        if "." in names[i] and names[i] in effects
    ]


def simulated(frame: Frame, p: Array, record: Record, active: Array) -> Array:
    """States (n, 4) of the free-running simulation of a record; see `at_effects` for its form."""
    return simulate_states(
        record.start, record.inputs, record.given, frame.dt_s, p, active, frame.structure.equations
    )


def readings(frame: Frame, p: Array, record: Record, states: Array) -> Array:
    """Readings (n, 4) that the sensors would give of the states."""
    source = record.source
    rates = np.zeros((len(states), 2)) if source is None else source.rates
    return sense.readings(
        frame.structure.plane,
        frame.sensing,
        frame.reading_effects(p),
        states,
        states[:, 3],
        rates,
        frame.dt_s,
        None if source is None else source.from_middle_s,
        None if source is None else source.heading,
    )


@dataclass(frozen=True)
class Slopes:
    """Readings (n, 4) and their slopes (n, 4, 4 + n_free) by the start and the free parameters."""

    readings: Array
    slopes: Array
    states: Array


def readings_with_slopes(
    frame: Frame, p: Array, record: Record, active: Array, free: Free, gain: Array | None = None
) -> Slopes | None:
    """Predicted readings of a record with their slopes; None where the simulation runs away.

    Parameters
    ----------
    record : Record
        As ingested; the effects at p are put in here.
    gain : (4,) array, optional
        Observer gain, see `physics.dynamics.simulate_with_sensitivities`.
    """
    acting = at_effects(frame, p, record)
    slopes, columns = input_slopes(frame, p, acting, free)
    z = np.zeros((len(record.time_s), N_STATES, 1 + N_STATES + len(free.positions)))
    if not simulate_with_sensitivities(
        acting.start,
        acting.inputs,
        slopes,
        columns,
        acting.given,
        np.zeros(N_STATES) if gain is None else gain,
        frame.dt_s,
        p,
        active,
        frame.structure.equations,
        free.column,
        free.scale,
        z,
    ):
        return None
    states = z[:, :, 0].copy()
    e = frame.reading_effects(p)
    matrix = sense.sensor_matrix(frame.structure.plane, frame.sensing, e)
    at_once = np.matmul(matrix, z)
    if frame.structure.plane == "vertical" and record.source is not None:
        by_pitch = sense.water_by_pitch(frame.sensing, e, states[:, 3], record.source.heading)
        if by_pitch.any():  # the water moves
            at_once[:, :2, 1:] += by_pitch[:, :, None] * z[:, None, 3, 1:]
    read = sense.late(at_once, e, frame.dt_s)
    found = readings(frame, p, record, states)
    _add_reading_slopes(frame, e, record, states, found, free, read[:, :, 1:])
    return Slopes(found, read[:, :, 1:], states)


def _add_reading_slopes(
    frame: Frame, e: Array, record: Record, states: Array, base: Array, free: Free, slopes: Array
) -> None:
    """Slopes of the readings by the effects of the sensors, by differences."""
    source = record.source
    assert source is not None or not frame.structure.effects
    for column, place in _columns_of(sense.READING, frame.structure.parameters, free):
        assert source is not None
        moved = e.copy()
        moved[place] += READING_STEP * free.scale[column]
        there = sense.readings(
            frame.structure.plane,
            frame.sensing,
            moved,
            states,
            states[:, 3],
            source.rates,
            frame.dt_s,
            source.from_middle_s,
            source.heading,
        )
        slopes[:, :, N_STATES + column] += (there - base) / READING_STEP


def seen_rows(frame: Frame, p: Array, record: Record, channels: Array) -> Array:
    """Rows (n, 4) of the readings that a prediction can be compared with."""
    seen = np.isfinite(record.measured) & channels
    if frame.structure.effects:
        seen &= ~sense.unknown_rows(frame.reading_effects(p), len(seen), frame.dt_s)
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
    e, k = frame.reading_effects(p), len(records)
    matrix = sense.sensor_matrix(frame.structure.plane, frame.sensing, e)
    pairs = _columns_of(sense.READING, frame.structure.parameters, free)
    offset, by_reading = np.zeros((k, n, 4)), np.zeros((k, n, 4, len(pairs)))
    inputs: list[Array] = []
    columns = np.zeros(0, dtype=np.int64)
    for j, record in enumerate(records):
        length, states = len(record.time_s), _smoothed(record.given, frame.dt_s)
        base = readings(frame, p, record, states)
        offset[j, :length] = base - states @ matrix.T
        slopes = np.zeros((length, 4, N_STATES + len(free.positions)))
        _add_reading_slopes(frame, e, record, states, base, free, slopes)
        by_reading[j, :length] = slopes[:, :, [N_STATES + column for column, _ in pairs]]
        slope, columns = input_slopes(frame, p, record, free)
        inputs.append(np.concatenate([slope, np.zeros((n - length, *slope.shape[1:]))]))
    reading_columns = np.array([column for column, _ in pairs], dtype=np.int64)
    return Linear(columns, np.array(inputs), offset, reading_columns, by_reading), matrix


def _smoothed(states: Array, dt_s: float) -> Array:
    """States without their fastest noise."""
    window = 2 * round(0.5 * SMOOTHED_S / dt_s) + 1
    return states if len(states) < window or window < 5 else local_parabolas(states, window)


def local_parabolas(values: Array, window: int) -> Array:
    """Values (n, m) of parabolas fitted to `window` (odd) rows each (Savitzky and Golay 1964).

    The first and last rows lie on the first and last parabola. What scipy.signal returns; to
    import that takes half as long as an identification.
    """
    half = window // 2
    powers = np.vander(np.arange(-half, half + 1.0), 3)
    hat = powers @ np.linalg.pinv(powers)
    middle = np.lib.stride_tricks.sliding_window_view(values, window, axis=0) @ hat[half]
    ends = hat[:half] @ values[:window], hat[half + 1 :] @ values[-window:]
    smooth: Array = np.concatenate([ends[0], middle, ends[1]])
    return smooth
