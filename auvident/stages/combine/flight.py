"""Prediction in six degrees of freedom: from the inputs of a log to the motion, with a band."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import pandas as pd

from auvident.engines.carried import CURRENTS, OF_THRUST, with_speed
from auvident.engines.falling import Pushed, PushesAlong
from auvident.engines.flown import SPEEDS, beyond, joined, reached_in
from auvident.engines.prediction import Frame, at_effects, ran_away_remedy
from auvident.engines.predictive import OF_DRAWS, half_width
from auvident.engines.records import Record, is_read_at, record_of, sensor_matrix
from auvident.engines.stretches import as_maneuver, uninterrupted
from auvident.errors import NumericsError
from auvident.physics.maneuvers.track import integral_of
from auvident.physics.sensing import DOWN, current
from auvident.physics.six_dof import (
    ATTITUDE,
    POSITION,
    SixDofSystem,
    angles_of,
    rates_six_dof,
    simulate_six_dof,
    state_of,
    system_of,
)
from auvident.physics.six_dof_terms import (
    OF_RACE,
    VELOCITIES,
    SixDofStructure,
    six_dof_structure,
    whole_names,
)
from auvident.physics.terms import INPUTS as PLANAR_INPUTS
from auvident.physics.terms import structure_of
from auvident.schema.artifacts import Extrapolation
from auvident.schema.channels import BY_QUANTITY, TIME_COLUMN
from auvident.schema.combined import ChannelBand, CombinedModel
from auvident.schema.planes import BY_PLANE, HORIZONTAL, PLANES, VERTICAL, Plane
from auvident.schema.trial import Trial

Array = npt.NDArray[np.float64]

SAMPLES = 100  # models drawn for the band: their variance is then known to a seventh
INPUT_COLUMNS = (*HORIZONTAL.control_columns, "rpm")
ANGLES = ("roll", "pitch", "heading")
CHANNELS = (*VELOCITIES, *ANGLES)
STATE_COLUMNS = tuple(BY_QUANTITY[name].column for name in CHANNELS)
TRACK_COLUMNS = tuple(BY_QUANTITY[name].column for name in ("north", "east", "depth"))
# effects of the propeller: one acts on it, whichever plane showed it
OF_PROPELLER = frozenset({"propeller_lag", "thrust_sag", "thrust_step"})
CURRENT = "current"
SINKING = "vertical_current"  # carries the vehicle down, which the log of the depth shows
FASTEST_MPS = 30.0  # no steady speed is looked for beyond


@dataclass(frozen=True)
class Flight:
    """A stretch of a log as the model takes it.

    Attributes
    ----------
    time_s : (n,) array
    start : (13,) array
    inputs : (n, 12) array
        As they act; see `physics.six_dof`.
    logged : (n, 3) array
        Rudder, elevator [rad], rpm.
    drift : (n, 3) array
        How far the water has carried the vehicle, north, east and down [m].
    heading_rad : float
        Heading at the start, as the log counts it.
    """

    time_s: Array
    start: Array
    inputs: Array
    logged: Array
    drift: Array
    heading_rad: float


def simulate_whole(
    model: CombinedModel,
    trial: Trial,
    *,
    window_s: tuple[float, float] = (-np.inf, np.inf),
    speed_mps: float | None = None,
    samples: int = SAMPLES,
    rng: np.random.Generator,
) -> pd.DataFrame:
    """Predict the motion of the whole vehicle from the inputs of a trial.

    Parameters
    ----------
    model : CombinedModel
    trial : Trial
        With rudder, elevator and rpm; what is measured gives the initial state.
    window_s : tuple of float
        First and last time [s] to simulate.
    speed_mps : float, optional
        Initial speed on a straight level run, in place of the measured state.
    samples : int
        Models drawn from the covariance for the band; 0 for none.
    rng : numpy.random.Generator

    Returns
    -------
    pandas.DataFrame
        ``time_s``, ``stretch``, the inputs, velocities through the water, roll, pitch, heading,
        north and east from the start, depth; ``..._low`` and ``..._high`` of each state: where a
        reading is expected in 95 of 100 cases, from the models drawn, the noise of the sensors and
        the errors of maneuvers left out; of a channel of which the model does not tell these
        (`of_coefficients_alone`), 95 of 100 of the models drawn.

    Raises
    ------
    InputError, UsageError
        No such inputs; nothing in the window.
    NumericsError
        The model runs away; says when.
    """
    dt_s, structure = 1.0 / trial.rate_hz, structure_behind_whole(model)
    system = system_of(structure, structure.vector(model.values()))
    drawn = _drawn_systems(model, structure, samples, rng)
    tables = []
    for number, (start_s, end_s) in enumerate(uninterrupted(trial, INPUT_COLUMNS, window_s)):
        flight = flight_of(model, trial, system, start_s, end_s, speed_mps)
        runs = _drawn_runs(model, flight, system, drawn, dt_s, rng)
        table = _predict(flight, trial.name, system, runs, model.band, dt_s)
        table.insert(1, "stretch", number)
        tables.append(table)
    return pd.concat(tables, ignore_index=True)


def _drawn_runs(
    model: CombinedModel,
    flight: Flight,
    system: SixDofSystem,
    drawn: Sequence[SixDofSystem],
    dt_s: float,
    rng: np.random.Generator,
) -> Iterator[Array]:
    """States (n, 13) of the models drawn, pushed along the way where they hardly keep a course."""
    pushed = {name: std for of_plane in model.pushes.values() for name, std in of_plane.items()}
    if not pushed:
        yield from (simulate_six_dof(flight.start, flight.inputs, dt_s, one) for one in drawn)
        return
    std = np.array([pushed.get(name, 0.0) for name in VELOCITIES])
    states = tuple(VELOCITIES.index(name) for name in pushed)
    pushes = PushesAlong(std, model.length_m, states)
    rows = pushes.rows_of(len(flight.inputs), float(flight.start[0]), dt_s)
    about = simulate_six_dof(flight.start, flight.inputs, dt_s, system)
    for one in drawn:
        yield _simulated_pushed(flight, one, dt_s, pushes.drawn(rows, rng), about)


def _simulated_pushed(
    flight: Flight,
    system: SixDofSystem,
    dt_s: float,
    pushed: Pushed,
    about: Array,
) -> Array:
    """States (n, 13) of a flight that is pushed at some rows, of which the first is 0."""
    states, now = np.empty((len(flight.inputs), len(flight.start))), flight.start
    for number, (first, last) in enumerate(pushed.stretches(len(states) - 1)):
        start = pushed.state(number, now, about[first])
        states[first : last + 1] = simulate_six_dof(
            start, flight.inputs[first : last + 1], dt_s, system
        )
        now = states[last]
    return states


def unread_planes(trial: Trial, time_s: float) -> list[Plane]:
    """Planes of which the log has no reading of the velocities about a time.

    The heave and the pitch rate need not be logged: they are small at a start.
    """
    there = [p for p in PLANES if p == HORIZONTAL.name or _has_velocities(trial, p)]
    return [p for p in there if not is_read_at(trial, p, time_s)]


def unread_starts(
    trial: Trial,
    *,
    window_s: tuple[float, float] = (-np.inf, np.inf),
    speed_mps: float | None = None,
    **_: object,
) -> list[float]:
    """Times [s] at which a flight begins on a straight run, as no reading is there.

    None where a speed is given, or the velocities of the horizontal plane are not in the log.
    Options as of `simulate_whole`.
    """
    if speed_mps is not None or not _has_velocities(trial, HORIZONTAL.name):
        return []
    begun = uninterrupted(trial, INPUT_COLUMNS, window_s)
    return [start for start, _ in begun if unread_planes(trial, start)]


def _has_velocities(trial: Trial, plane: Plane) -> bool:
    return all(c in trial.table for c in BY_PLANE[plane].columns[:3])


def beyond_ranges(model: CombinedModel, table: pd.DataFrame) -> dict[str, Extrapolation]:
    """Where a motion leaves the range of a plane's model; a speed that either knows is known."""
    speeds = joined([{name: flown[name] for name in SPEEDS} for flown in model.flown.values()])
    far: dict[str, Extrapolation] = {}
    for plane, flown in model.flown.items():
        far |= beyond(reached_in(table, plane), {**flown, **speeds}, plane)
    return far


def of_coefficients_alone(model: CombinedModel) -> tuple[str, ...]:
    """Columns of which the band is the scatter of the models drawn, and nothing else."""
    return tuple(BY_QUANTITY[name].column for name in CHANNELS if name not in model.band)


def structure_behind_whole(model: CombinedModel) -> SixDofStructure:
    """The equations of a combined model with the effects that its planes carry."""
    return six_dof_structure(model.effect_ids("horizontal"), model.effect_ids("vertical"))


def _drawn_systems(
    model: CombinedModel, structure: SixDofStructure, samples: int, rng: np.random.Generator
) -> list[SixDofSystem]:
    """Models drawn from the covariance; one with an impossible mass matrix is none."""
    systems = []
    for moved in model.draws(samples, rng):
        try:
            systems.append(system_of(structure, structure.vector(model.values(moved))))
        except NumericsError:
            continue
    return systems


def plane_frame(model: CombinedModel, plane: Plane, dt_s: float) -> tuple[Frame, Array]:
    """The equations of one plane and its parameters: what effects make of inputs and readings.

    There is one water: a current that one plane alone knows is that of the other as well.
    """
    ids, names = model.effect_ids(plane), whole_names(plane, model.effect_ids(plane))
    knows = _that_knows_current(model)
    if knows not in (None, plane) and CURRENT not in ids:
        ids, names = (*ids, CURRENT), whole_names(knows, (CURRENT,)) | names
    structure, values = structure_of(plane, ids), model.values()
    p = np.array([values.get(names[n], 0.0) for n in structure.parameters])
    return Frame(structure, model.sensing[plane], dt_s), p


def _that_knows_current(model: CombinedModel) -> Plane | None:
    """The first plane of which the model carries a current."""
    return next((plane for plane in PLANES if CURRENT in model.effect_ids(plane)), None)


def flight_of(
    model: CombinedModel,
    trial: Trial,
    system: SixDofSystem,
    start_s: float,
    end_s: float,
    speed_mps: float | None = None,
) -> Flight:
    """A stretch of a trial, its inputs as they act and the state it starts from."""
    dt_s = 1.0 / trial.rate_hz
    records = {}
    for plane in PLANES:
        sensor = sensor_matrix(plane, model.sensing[plane])
        records[plane] = record_of(as_maneuver(trial, plane, start_s, end_s), trial, plane, sensor)
    acting = _acting(model, records, dt_s)
    start = _start(trial, acting)
    measured = not unread_planes(trial, start_s)
    if speed_mps is not None or not measured:
        first = _inputs(model, acting)[0]
        start[: 8 if trial.has_heading else 9] = 0.0  # the bow points to where it is read to
        start[0] = speed_mps if speed_mps is not None else steady_speed(system, first[2])
    one = Flight(
        acting["horizontal"].time_s,
        state_of(start[:6], start[6:9], start[9:]),
        _inputs_at(model, records, np.full(len(acting["horizontal"]), start[0]), dt_s),
        np.column_stack([_logged(records, plane) for plane in PLANES] + [_rpm(records)]),
        _drift(model, acting["horizontal"], dt_s),
        float(start[8]),
    )
    if not any(OF_THRUST & set(model.effect_ids(plane)) for plane in PLANES):
        return one
    # what acts depends on the speed: that of a first prediction, as nothing later is known
    first_run = simulate_six_dof(one.start, one.inputs, dt_s, system)
    speed = np.nan_to_num(first_run[:, 0], nan=one.start[0])
    return replace(one, inputs=_inputs_at(model, records, speed, dt_s))


def _inputs_at(
    model: CombinedModel, records: Mapping[Plane, Record], speed: Array, dt_s: float
) -> Array:
    """Inputs (n, 12) as they act at speeds (n,)."""
    at_speed = {plane: with_speed(record, speed) for plane, record in records.items()}
    return _inputs(model, _acting(model, at_speed, dt_s))


def _acting(
    model: CombinedModel, records: Mapping[Plane, Record], dt_s: float
) -> dict[Plane, Record]:
    """The records as the effects make them."""
    return {
        plane: at_effects(*plane_frame(model, plane, dt_s), record)
        for plane, record in records.items()
    }


def _inputs(model: CombinedModel, acting: Mapping[Plane, Record]) -> Array:
    """Inputs (n, 12) as they act; see `physics.six_dof`."""
    turning = next((p for p in PLANES if OF_PROPELLER & set(model.effect_ids(p))), PLANES[0])
    own = {BY_PLANE[plane].fin: record.inputs[:, 0] for plane, record in acting.items()}
    propeller, vertical = acting[turning].inputs, acting[VERTICAL.name].inputs
    return np.column_stack(
        [
            own["rudder"],
            own["elevator"],
            propeller[:, PLANAR_INPUTS.index("n")],
            _column(propeller, "thrust", 1.0),
            _column(vertical, "T", 0.0),
            _column(vertical, "changed", 0.0),
            *(_column(acting[plane].inputs, name, 0.0) for plane in PLANES for name in OF_RACE),
        ]
    )


def _column(inputs: Array, name: str, usual: float) -> Array:
    """An input of a plane by its name; the usual one where no effect needs it."""
    k = PLANAR_INPUTS.index(name) if name in PLANAR_INPUTS else inputs.shape[1]
    return inputs[:, k] if k < inputs.shape[1] else np.full(len(inputs), usual)


def _logged(records: Mapping[Plane, Record], plane: Plane) -> Array:
    return records[plane].inputs[:, 0]


def _rpm(records: Mapping[Plane, Record]) -> Array:
    return np.asarray(60.0 * records[PLANES[0]].inputs[:, 2])


def _start(trial: Trial, acting: Mapping[Plane, Record]) -> Array:
    """Velocities (6,), roll, pitch and heading, position (3,) from the readings at the start."""
    start = np.zeros(12)
    names = CHANNELS
    for plane in (VERTICAL, HORIZONTAL):  # the speed is that of the horizontal one
        for state, value in zip(plane.states, acting[plane.name].start, strict=True):
            start[names.index(state.symbol)] = value
    record = acting[HORIZONTAL.name]
    assert record.source is not None
    lead = len(record.source.roll) - len(record.time_s)
    start[names.index("p")] = record.source.rates[0, 0]
    start[names.index("roll")] = record.source.roll[lead]
    if "depth_m" in trial.table:
        row = np.searchsorted(trial.table[TIME_COLUMN].to_numpy(), record.time_s[0])
        start[-1] = np.nan_to_num(trial.table["depth_m"].to_numpy()[row])
    return start


def steady_speed(system: SixDofSystem, rate_rps: float) -> float:
    """Speed at which thrust and drag balance on a straight level run [m/s]; 0 without thrust."""
    from scipy.optimize import brentq

    def surge(u: float) -> float:
        state = state_of(np.array([u, 0, 0, 0, 0, 0], float), np.zeros(3))
        return float(rates_six_dof(state, np.array([0.0, 0.0, rate_rps, 1.0]), system)[0])

    if not (surge(0.0) > 0.0 > surge(FASTEST_MPS)):
        return 0.0
    return float(brentq(surge, 0.0, FASTEST_MPS))


def _drift(model: CombinedModel, record: Record, dt_s: float) -> Array:
    """How far moving water has carried the vehicle (n, 3) since the start."""
    drift = np.zeros((len(record.time_s), 3))
    if CURRENTS & set(model.effect_ids("horizontal")) or _that_knows_current(model):
        frame, p = plane_frame(model, "horizontal", dt_s)
        since = None if record.source is None else record.source.from_middle_s
        at = np.zeros(len(record)) if since is None else since
        water = current(frame.reading_effects(p), at)
        drift[:, :2] = np.column_stack([integral_of(record.time_s, x) for x in water.T])
    if SINKING in model.effect_ids("vertical"):
        frame, p = plane_frame(model, "vertical", dt_s)
        drift[:, 2] = frame.reading_effects(p)[DOWN] * (record.time_s - record.time_s[0])
    return drift


def _predict(
    flight: Flight,
    name: str,
    system: SixDofSystem,
    runs: Iterable[Array],
    band: Mapping[str, ChannelBand],
    dt_s: float,
) -> pd.DataFrame:
    states = simulate_six_dof(flight.start, flight.inputs, dt_s, system)
    if not np.isfinite(states).all():
        row = int(np.argmin(np.isfinite(states).all(axis=1)))
        raise NumericsError(
            "the simulation diverges",
            f"{name}, {flight.time_s[row]:.1f} s",
            ran_away_remedy(dt_s),
        )
    columns = {TIME_COLUMN: flight.time_s}
    columns |= dict(zip(INPUT_COLUMNS, flight.logged.T, strict=True))
    shown = _shown(states, flight.heading_rad)
    columns |= dict(zip(STATE_COLUMNS, shown.T, strict=True))
    track = states[:, POSITION] + flight.drift
    columns |= dict(zip(TRACK_COLUMNS, track.T, strict=True))
    stable = [_shown(run, flight.heading_rad) for run in runs if np.isfinite(run).all()]
    if stable:
        low, high = _band(band, flight.time_s - flight.time_s[0], shown, np.array(stable))
        for i, column in enumerate(STATE_COLUMNS):
            columns |= {f"{column}_low": low[:, i], f"{column}_high": high[:, i]}
    return pd.DataFrame(columns)


def _band(
    band: Mapping[str, ChannelBand], elapsed_s: Array, shown: Array, drawn: Array
) -> tuple[Array, Array]:
    """Ends (n, 9) of the band about predicted states, from those of the models drawn."""
    low, high = np.percentile(drawn, OF_DRAWS, axis=0)
    variance = np.mean((drawn - shown) ** 2, axis=0)
    for name, row in band.items():
        c = CHANNELS.index(name)
        half = half_width(row, row.noise_std, variance[:, c], elapsed_s)
        low[:, c], high[:, c] = shown[:, c] - half, shown[:, c] + half
    return low, high


def _shown(states: Array, heading: float) -> Array:
    """Velocities and angles (n, 9) of states (n, 13); the heading counts on from the start."""
    angles = angles_of(states[:, ATTITUDE])
    angles[:, 2] += 2.0 * np.pi * np.round((heading - angles[0, 2]) / (2.0 * np.pi))
    return np.column_stack([states[:, :6], angles])
