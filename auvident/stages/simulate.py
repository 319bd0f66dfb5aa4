"""Prediction with an identified model: from the inputs of a log to the motion, with a band."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pandas as pd

from auvident.engines.carried import frame_of, over_ground, structure_behind, vector_behind
from auvident.engines.draws import drawn_vectors
from auvident.engines.falling import simulated_pushed
from auvident.engines.flown import beyond, reached_in
from auvident.engines.prediction import Frame, at_effects, ran_away_remedy, simulated
from auvident.engines.predictive import OF_DRAWS, half_widths, pushes_behind
from auvident.engines.records import ANGLE, Record, is_read_at, record_of, sensor_matrix
from auvident.engines.stretches import as_maneuver, uninterrupted
from auvident.errors import NumericsError
from auvident.physics.dynamics import ALL_STATES, N_STATES
from auvident.physics.maneuvers.track import dead_reckoning
from auvident.physics.virtual import steady_approach
from auvident.schema.artifacts import Extrapolation, IdentifiedModel
from auvident.schema.channels import TIME_COLUMN
from auvident.schema.planes import BY_PLANE, PLANE_ROWS, STATE_COLUMNS
from auvident.schema.trial import Trial

Array = npt.NDArray[np.float64]

SAMPLES = 100  # models drawn for the band: their variance is then known to a seventh
INPUT_COLUMNS = {row.name: (row.control_columns[0], "rpm") for row in PLANE_ROWS}


def simulate(
    model: IdentifiedModel,
    trial: Trial,
    *,
    window_s: tuple[float, float] = (-np.inf, np.inf),
    speed_mps: float | None = None,
    samples: int = SAMPLES,
    rng: np.random.Generator,
) -> pd.DataFrame:
    """Predict the motion from the inputs of a trial.

    The effects of the model act: those of actuators and forces on the motion, those of sensors
    on the initial state that the readings give, a current also on the track. Velocities are
    those through the water.

    Parameters
    ----------
    model : IdentifiedModel
    trial : Trial
        With control angle and rpm; measured velocities give the initial state if present.
    window_s : tuple of float
        First and last time [s] to simulate.
    speed_mps : float, optional
        Initial speed on a straight run, in place of the measured state.
    samples : int
        Models drawn from the covariance for the band; 0 for none.
    rng : numpy.random.Generator

    Returns
    -------
    pandas.DataFrame
        ``time_s``, ``stretch`` (number of the uninterrupted stretch), the inputs, the states,
        in the horizontal plane north and east from the start, and ``..._low``, ``..._high`` of
        each state: where a reading is expected in 95 of 100 cases, from the models drawn, the
        noise of the sensors and the errors of maneuvers left out; for a model that does not tell
        of these, 95 of 100 of the models drawn.

    Raises
    ------
    UsageError
        Nothing to simulate in the window.
    NumericsError
        The model runs away; says when.
    """
    records = _stretches(model, trial, window_s, speed_mps)
    draws = drawn_vectors(model, samples, rng)
    tables = []
    for number, record in enumerate(records):
        table = _predict(model, record, draws, 1.0 / trial.rate_hz, rng)
        table.insert(1, "stretch", number)
        tables.append(table)
    return pd.concat(tables, ignore_index=True)


def beyond_range(model: IdentifiedModel, table: pd.DataFrame) -> dict[str, Extrapolation]:
    """Where a simulated motion leaves the range that its model was identified from."""
    return beyond(reached_in(table, model.plane), model.flown, model.plane)


def of_coefficients_alone(model: IdentifiedModel) -> tuple[str, ...]:
    """Columns of which the band is the scatter of the models drawn, and nothing else."""
    told = model.left_out.model_error if model.left_out else {}
    return tuple(s.column for s in BY_PLANE[model.plane].states if s.symbol not in told)


def unread_starts(
    model: IdentifiedModel,
    trial: Trial,
    *,
    window_s: tuple[float, float] = (-np.inf, np.inf),
    speed_mps: float | None = None,
    **_: object,
) -> list[float]:
    """Times [s] at which a simulation begins on a straight run, as no reading is there.

    None where a speed is given, or the velocities are not in the log at all. Options as of
    `simulate`.
    """
    if speed_mps is not None or not set(STATE_COLUMNS[model.plane][:3]) <= set(trial.table):
        return []
    begun = uninterrupted(trial, INPUT_COLUMNS[model.plane], window_s)
    return [start for start, _ in begun if not is_read_at(trial, model.plane, start)]


def _stretches(
    model: IdentifiedModel, trial: Trial, window_s: tuple[float, float], speed: float | None
) -> list[Record]:
    """Uninterrupted stretches where all inputs are known, within the window, as they act."""
    stretches = uninterrupted(trial, INPUT_COLUMNS[model.plane], window_s)
    return [_stretch(model, trial, start, end, speed) for start, end in stretches]


def _stretch(
    model: IdentifiedModel, trial: Trial, start_s: float, end_s: float, speed: float | None
) -> Record:
    maneuver = as_maneuver(trial, model.plane, start_s, end_s)
    record = record_of(maneuver, trial, model.plane, sensor_matrix(model.plane, model.sensing))
    if speed is None and is_read_at(trial, model.plane, start_s):
        return _acting(model, record, trial.rate_hz)
    begun = np.zeros(N_STATES)
    begun[0] = steady_speed(model, record.inputs[0, 2]) if speed is None else speed
    if model.plane == "horizontal" and trial.has_heading:
        begun[ANGLE] = record.start[ANGLE]  # a track is north and east, and so is a current
    if record.source is not None:
        logged = record.source.speed
        known = np.where(logged == 0.0, begun[0], logged)  # zero where it is not logged
        record = replace(record, source=replace(record.source, speed=known))
    return replace(_acting(model, record, trial.rate_hz), start=begun)


def _acting(model: IdentifiedModel, record: Record, rate_hz: float) -> Record:
    """The record as the effects make it: what acts on the vehicle, the state it starts from."""
    return at_effects(frame_of(model, 1.0 / rate_hz), vector_behind(model), record)


def steady_speed(model: IdentifiedModel, rate_rps: float) -> float:
    """Speed at which thrust and drag balance on a straight run ahead [m/s]; 0 without thrust."""
    speed = steady_approach(structure_behind(model), vector_behind(model), rate_rps)[0]
    return float(np.nan_to_num(speed))


def _predict(
    model: IdentifiedModel,
    record: Record,
    draws: list[Array],
    dt_s: float,
    rng: np.random.Generator,
) -> pd.DataFrame:
    frame, active = frame_of(model, dt_s), ALL_STATES
    runs = [simulated(frame, draws[0], record, active)]
    if not np.isfinite(runs[0]).all():
        row = int(np.argmin(np.isfinite(runs[0]).all(axis=1)))
        raise NumericsError(
            "the simulation diverges",
            f"{record.id}, {record.time_s[row]:.1f} s",
            ran_away_remedy(dt_s),
        )
    runs += _drawn_runs(model, frame, record, draws[1:], runs[0], rng)
    columns = {TIME_COLUMN: record.time_s}
    own, rpm = INPUT_COLUMNS[model.plane]
    assert record.source is not None
    logged = record.source.raw[len(record.source.raw) - len(record.time_s) :]
    columns |= {own: logged[:, 0], rpm: 60.0 * logged[:, 2]}
    names = STATE_COLUMNS[model.plane]
    columns |= {name: runs[0][:, i] for i, name in enumerate(names)}
    if model.plane == "horizontal":
        states = over_ground(frame, draws[0], record, runs[0])
        north, east = dead_reckoning(record.time_s, states[:, 0], states[:, 1], states[:, 3])
        columns |= {"north_m": north, "east_m": east}
    stable = [run for run in runs[1:] if np.isfinite(run).all()]
    if stable:
        low, high = _band(model, record, runs[0], np.array(stable))
        for i, name in enumerate(names):
            columns |= {f"{name}_low": low[:, i], f"{name}_high": high[:, i]}
    return pd.DataFrame(columns)


def _drawn_runs(
    model: IdentifiedModel,
    frame: Frame,
    record: Record,
    draws: list[Array],
    about: Array,
    rng: np.random.Generator,
) -> list[Array]:
    """States (n, 4) of the models drawn, pushed along the way where they hardly keep a course."""
    active, pushes = ALL_STATES, pushes_behind(model)
    if pushes is None:
        return [simulated(frame, p, record, active) for p in draws]
    rows = pushes.rows(record, frame.dt_s)
    return [simulated_pushed(frame, p, record, pushes.drawn(rows, rng), about) for p in draws]


def _band(
    model: IdentifiedModel, record: Record, states: Array, drawn: Array
) -> tuple[Array, Array]:
    """Ends (n, 4) of the band about predicted states, from those of the models drawn."""
    low, high = np.percentile(drawn, OF_DRAWS, axis=0)
    symbols = [state.symbol for state in BY_PLANE[model.plane].states]
    variance = dict(zip(symbols, np.mean((drawn - states) ** 2, axis=0).T, strict=True))
    for name, half in half_widths(model, variance, record.time_s - record.time_s[0]).items():
        c = symbols.index(name)
        low[:, c], high[:, c] = states[:, c] - half, states[:, c] + half
    return low, high
