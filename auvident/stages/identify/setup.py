"""What stays the same through an identification: data, priors, sensors."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from auvident.constants import GRAVITY_MPS2
from auvident.engines.carried import Carried, Window
from auvident.engines.records import (
    ANGLE,
    STATE_COLUMNS,
    Record,
    frame_of,
    in_one_frame,
    record_of,
    sensor_matrix,
)
from auvident.engines.setup import Setup
from auvident.errors import InputError, NumericsError
from auvident.physics.terms import parameter_vector, symbol_in
from auvident.schema.artifacts import (
    AseResult,
    Finding,
    Maneuver,
    ManeuverKind,
    Maneuvers,
    RigidBody,
    Sensing,
)
from auvident.schema.channels import BY_COLUMN
from auvident.schema.coefficients import Plane, constants_of, symbols_of
from auvident.schema.plan import Plan
from auvident.schema.planes import BY_PLANE
from auvident.schema.trial import Trial
from auvident.schema.vehicle import Vehicle
from auvident.stages.identify.held_out import identifying, without_held_out

if TYPE_CHECKING:
    from auvident.stages.identify.shared import Shared

Array = npt.NDArray[Any]

# Accuracy of a channel when neither the vehicle file nor the log tells: a common DVL, a
# fibre-optic or MEMS rate gyro, a compass.
DEFAULT_STD = {"m/s": 5.0e-3, "rad/s": 1.0e-3, "rad": 5.0e-3}

TRIM = "x_GW"
OMITTED = "appendages"  # part of the estimate for what a sketch does not show


def prepare(
    trials: Sequence[Trial],
    maneuvers: Maneuvers,
    ase: AseResult,
    vehicle: Vehicle,
    noise: Mapping[str, float],
    *,
    plane: Plane,
    plan: Plan,
    filter: str,
    engine: str,
    carried: Carried | None = None,
    shared: "Shared | None" = None,
) -> Setup:
    """Arrays of the identification; see `identify` for the parameters."""
    carried = carried or Carried()
    structure = carried.structure(plane)
    sensing = sensing_of(vehicle, noise, plane)
    sensor = sensor_matrix(plane, sensing)
    records, rate_hz = records_of(trials, maneuvers, plane, sensor, carried.windows)
    values, stds = priors(ase, plane)
    if shared:
        values, stds = {**values, **shared.values}, {**stds, **shared.stds}
        records = {name: (kind, shared.uncounted(r)) for name, (kind, r) in records.items()}
    stds |= {name: std for name, std in carried.prior_std.items() if std > 0.0}
    rigid = rigid_body(vehicle, plane)
    prior = parameter_vector(plane, values, rigid, carried.prior, structure)
    start = parameter_vector(plane, {**values, **carried.start}, rigid, carried.start, structure)
    prior_std = np.array([stds.get(name, 0.0) for name in structure.parameters])
    prior = np.where(prior_std > 0.0, prior, start)
    followers = np.array(
        [[structure.index(symbol_in(plane, "B_adot")), structure.index(symbol_in(plane, "A_bdot"))]]
    )
    floors = [carried.least_noise.get(column, 0.0) for column in STATE_COLUMNS[plane]]
    noise_std = [sensing.noise_std[column] for column in STATE_COLUMNS[plane]]
    return Setup(
        structure=structure,
        plan=plan,
        records=records,
        dt_s=1.0 / rate_hz,
        sensing=sensing,
        sensor_std=np.maximum(noise_std, floors),
        prior=prior,
        prior_std=prior_std,
        followers=followers,
        filter=filter,
        engine=engine,
        start=start,
        friction=friction_share(ase),
        joint=shared.joint if shared else None,
        own_starts=carried.own_starts,
    )


def friction_share(ase: AseResult) -> float:
    """Share of hull and fins in the drag; all of it where only the whole is known.

    What a sketch omits (sensors, handles, gaps) drags by pressure, whatever the Reynolds number.
    """
    (row,) = (c for c in ase.coefficients if c.symbol == "X_uu")
    omitted = row.parts.get(OMITTED, 0.0)
    return float(np.clip(1.0 - omitted / row.value, 0.0, 1.0)) if row.value else 1.0


def records_of(
    trials: Sequence[Trial],
    maneuvers: Maneuvers,
    plane: Plane,
    sensor: Array,
    windows: Sequence[Window] = (),
) -> tuple[dict[str, tuple[ManeuverKind, Record]], float]:
    """Maneuvers that identify and have a reading, by id with their kind; their rate [Hz].

    Parameters
    ----------
    sensor : (4, 4) array
        From `sensor_matrix`.
    windows : sequence of (maneuver, start, end)
        Readings that are left out [s].

    Raises
    ------
    InputError, NumericsError
        There is none, with the reason.
    """
    by_name = {trial.name: without_held_out(trial, maneuvers, plane) for trial in trials}
    chosen = identifying(trials, maneuvers, plane)
    if not chosen:
        raise _nothing_identifies(trials, maneuvers, plane)
    records = {}
    for m in chosen:
        record = _masked(record_of(m, by_name[m.trial], plane, sensor), windows)
        if np.isfinite(record.measured).any():
            records[m.id] = (m.kind, record)
    if not records:
        raise _nothing_is_read(chosen)
    return records, by_name[chosen[0].trial].rate_hz


def headings_compare(trials: Sequence[Trial], maneuvers: Maneuvers, plane: Plane) -> bool:
    """Whether the headings of what identifies can be held against each other.

    They are logged, or summed up of one yaw rate.
    """
    by_name = {trial.name: trial for trial in trials}
    chosen = identifying(trials, maneuvers, plane)
    summed = in_one_frame(frame_of(m, by_name[m.trial], plane) for m in chosen)
    return summed or any(trial.has_heading for trial in trials)


def _masked(record: Record, windows: Sequence[Window]) -> Record:
    """The record without the readings in the windows that are left out."""
    measured = record.measured.copy()
    for name, start, end in windows:
        if name == record.id:
            measured[(record.time_s >= start) & (record.time_s <= end)] = np.nan
    return replace(record, measured=measured)


def unread_findings(
    trials: Sequence[Trial], maneuvers: Maneuvers, plane: Plane, setup: Setup
) -> list[Finding]:
    """Maneuvers that are to identify and of which no reading is left."""
    lost = [m for m in identifying(trials, maneuvers, plane) if m.id not in setup.records]
    return [
        Finding(
            code="no-readings",
            where=m.id,
            value=0.0,
            message=f"it has no reading of {', '.join(STATE_COLUMNS[plane])}, so it is not used "
            "for identification",
            remedy="Check the sensors' drop-outs in the ingested log.",
        )
        for m in lost
    ]


def pitch_findings(setup: Setup, ase: AseResult) -> list[Finding]:
    """A vertical plane without a reading of the pitch, whose trim is not held.

    The fit may then have the whole record pitched by any angle that a trim moment balances: on a
    sample trial it predicts a pitch that is 12 degrees off, and with the trim held 0.8.
    """
    if setup.structure.plane != "vertical":
        return []
    records = [record for _, record in setup.records.values()]
    free = any(row.symbol == TRIM and row.std > 0.0 for row in ase.constants)
    if not free or any(np.isfinite(r.measured[:, ANGLE]).any() for r in records):
        return []
    return [
        Finding(
            code="pitch-not-logged",
            where=f"{TRIM}, z_GW",
            message="the pitch is not logged: maneuvers are taken to begin level, and trim, "
            "righting moment and predicted pitch may be far off together",
            remedy="Log the pitch. Or, of a vehicle that is ballasted to lie level, hold the trim "
            "at that: x_g_std_m = 0 under [vehicle] of the vehicle file.",
        )
    ]


def _nothing_is_read(chosen: Sequence[Maneuver]) -> NumericsError:
    return NumericsError(
        "no maneuver for identification has a reading",
        where=", ".join(m.id for m in chosen),
        remedy="Check the sensors' drop-outs in the ingested log.",
    )


def _nothing_identifies(
    trials: Sequence[Trial], maneuvers: Maneuvers, plane: Plane
) -> InputError | NumericsError:
    lacking = min((t.lacking(BY_PLANE[plane].needed) for t in trials), key=len, default=[])
    if lacking:
        return InputError(
            f"no trial can be used for the {plane} plane: {', '.join(lacking)} not in the log",
            where=", ".join(trial.name for trial in trials),
            remedy="Log it, or name its column in a map (--map). Without --plane the planes are "
            "identified that the trials have maneuvers of.",
            lacks=lacking[0],
        )
    within = [m.id for m in maneuvers.maneuvers if m.role == "identify" and m.shows(plane)]
    if within:
        return NumericsError(
            f"every {plane}-plane maneuver for identification lies within held-out ones",
            where=", ".join(within),
            remedy="Hold out other maneuvers with `auvident segment --hold-out`.",
        )
    return NumericsError(
        f"there is no {plane}-plane maneuver to identify from",
        remedy="Hold out fewer maneuvers, or add a trial with maneuvers of this plane.",
    )


def priors(ase: AseResult, plane: Plane) -> tuple[dict[str, float], dict[str, float]]:
    """Value and standard deviation of each coefficient and constant of a plane before the data.

    A constant that an estimate of an earlier version lacks is held as the vehicle file has it.
    """
    wanted = {*symbols_of(plane), *constants_of(plane)}
    rows = [c for c in ase.estimates if c.symbol in wanted]
    return {c.symbol: c.value for c in rows}, {c.symbol: c.std for c in rows}


def rigid_body(vehicle: Vehicle, plane: Plane) -> RigidBody:
    """Mass properties in the equations of a plane."""
    body = vehicle.body
    weight = body.mass_kg * GRAVITY_MPS2
    return RigidBody(
        mass_kg=body.mass_kg,
        x_g_m=body.x_g_m,
        z_g_m=body.z_g_m,
        inertia_kgm2=body.inertia_kgm2(plane),
        weight_n=weight,
        buoyancy_n=body.buoyancy_n or weight,
        fin_x_m=vehicle.station_of(BY_PLANE[plane].fin),
    )


def sensing_of(vehicle: Vehicle, noise: Mapping[str, float], plane: Plane) -> Sensing:
    """Sensor positions and accuracies: the vehicle file, else the log, else a common sensor."""
    stated = {"dvl": vehicle.dvl.std_mps, "gyro": vehicle.gyro.std_radps}
    stds = {}
    for column in STATE_COLUMNS[plane]:
        channel = BY_COLUMN[column]
        stds[column] = stated.get(channel.sensor) or noise.get(column) or DEFAULT_STD[channel.unit]
    return Sensing(
        dvl_x_m=vehicle.dvl.x_m,
        dvl_y_m=vehicle.dvl.y_m,
        dvl_z_m=vehicle.dvl.down_m,
        dvl_mounting_yaw_rad=math.radians(vehicle.dvl.mounting_yaw_deg),
        noise_std=stds,
    )
