"""The sample trials from log to model, each stage once per session."""

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from auvident.engines.problem import FilterProblem
from auvident.engines.records import Record, stack
from auvident.engines.setup import Setup
from auvident.pipeline.steps import cruising_speed
from auvident.schema.artifacts import AseResult, Maneuvers
from auvident.schema.plan import Plan
from auvident.schema.trial import Trial
from auvident.schema.vehicle import Vehicle
from auvident.stages.ase import estimate
from auvident.stages.identify import Identification, identify, prepare
from auvident.stages.ingest import ingest
from auvident.stages.segment import segment_both
from auvident.stages.validate import Validation, validate
from auvident.storage.logs import read_trials
from auvident.storage.plan_file import read_plan
from auvident.storage.vehicle_file import load_vehicle
from tests.session import once

SAMPLES = Path(__file__).resolve().parents[2] / "sample_logs"


@dataclass(frozen=True)
class Chain:
    """What stands before the identification."""

    trials: tuple[Trial, ...]
    maneuvers: Maneuvers
    ase: AseResult
    vehicle: Vehicle
    noise: dict[str, float]

    def with_body(self, **keys) -> "Chain":
        """The same trial with other mass properties in the vehicle file."""
        body = self.vehicle.body.model_copy(update=keys)
        vehicle = self.vehicle.model_copy(update={"body": body})
        return replace(self, vehicle=vehicle, ase=estimate(vehicle, self.ase.speed_mps))

    def identify(self, plane: str = "horizontal", filter: str = "ekf", **changes) -> Identification:
        """The identification with the default plan; anything can be exchanged."""
        parts = {
            "trials": self.trials,
            "maneuvers": self.maneuvers,
            "ase": self.ase,
            "vehicle": self.vehicle,
            "noise": self.noise,
            "plan": plan_named("spiral"),
        } | changes
        first = [parts.pop(k) for k in ("trials", "maneuvers", "ase", "vehicle", "noise")]
        return identify(*first, plane=plane, filter=filter, **parts)

    def setup(self, plane: str = "horizontal", **changes) -> Setup:
        """The arrays of an identification with the filter's own plan; anything can be exchanged."""
        options = {"plan": plan_named("spiral"), "filter": "ekf", "engine": "compiled"} | changes
        logs = self.trials, self.maneuvers, self.ase, self.vehicle, self.noise
        return prepare(*logs, plane=plane, **options)

    def validate(self, model) -> Validation:
        return validate(self.trials, self.maneuvers, model)


@cache
def plan_named(name: str) -> Plan:
    return read_plan(name)


def chain_of(paths, vehicle_file: Path, hold_out=()) -> Chain:
    """Read, ingest and segment some logs."""
    vehicle = load_vehicle(vehicle_file)
    ingested = [ingest(raw, vehicle) for raw in read_trials(paths)]
    trials = tuple(trial for trial, _ in ingested)
    squares: dict[str, list[float]] = {}
    for _, quality in ingested:
        for channel in (c for sensor in quality.sensors for c in sensor.channels):
            if channel.noise_std is not None:
                squares.setdefault(channel.column, []).append(channel.noise_std**2)
    return Chain(
        trials,
        segment_both(trials, hold_out),
        estimate(vehicle, vehicle.body.design_speed_mps or cruising_speed(list(trials))),
        vehicle,
        {column: float(np.sqrt(np.mean(s))) for column, s in squares.items()},
    )


@once
def sample(name: str) -> Chain:
    """A sample trial with the vehicle file that goes with it."""
    vehicle = "tern180" if name in ("bay_trial", "sound_trial") else "remus100"
    return chain_of([SAMPLES / name], SAMPLES / f"{vehicle}.toml")


@once
def identified(name: str, plane: str = "horizontal", filter: str = "ekf") -> Identification:
    return sample(name).identify(plane, filter)


@once
def validated(name: str, plane: str = "horizontal", filter: str = "ekf") -> Validation:
    return sample(name).validate(identified(name, plane, filter).model)


def setup_of(name: str = "harbour_trial", plane: str = "horizontal", **changes):
    """The arrays of an identification."""
    return sample(name).setup(plane, **changes)


# of a source, what leads in before the maneuver
LEADING = ("raw", "elapsed_s", "speed", "roll", "pitch", "depth")
OWN = ("rates", "bridged", "from_middle_s", "heading")


def cut(record: Record, samples: int) -> Record:
    """The first samples of a record, with the inputs that lead in."""
    source = record.source
    if source is not None:
        end = len(source.raw) - len(record.time_s) + samples
        long = {k: getattr(source, k)[:end] for k in LEADING}
        own = {k: getattr(source, k) for k in OWN}
        short = {k: None if x is None else x[:samples] for k, x in own.items()}
        source = replace(source, **long, **short)
    return Record(
        record.id,
        record.time_s[:samples],
        record.inputs[:samples],
        record.given[:samples],
        record.measured[:samples].copy(),
        record.start,
        source,
    )


def problem_of(setup, records, symbols, active, **changes) -> FilterProblem:
    """A filter pass over some records with the prior of the ASE and plausible noise."""
    stacked, starts = stack(records, setup.dt_s)
    free = np.array([setup.structure.index(s) for s in symbols], dtype=np.int64)
    noise = 5.0 * setup.sensor_std
    followers = setup.followers[np.isin(setup.followers[:, 1], free)]
    parts = {
        "structure": setup.structure,
        "records": stacked,
        "parameters": setup.prior,
        "free": free,
        "followers": followers,
        "scale": setup.prior_std[free],
        "theta_covariance": np.eye(len(free)),
        "theta_noise": np.full(len(free), 1e-8),
        "active": np.array(active),
        "channels": np.array(active),
        "sensor": setup.sensor,
        "process_std": noise / 10.0,
        "sensor_std": noise,
        "start": starts,
        "start_std": 3 * noise,
    } | changes
    return FilterProblem(**parts)
