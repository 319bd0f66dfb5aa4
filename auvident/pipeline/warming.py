"""Compile the kernels beforehand, on a trial of no vehicle's that is made up for that."""

import tomllib

from auvident.pipeline.observer import Observer
from auvident.pipeline.steps import begin_with_kernels

KINDS = ("ekf", "ukf")
SECONDS, RATE_HZ = 60.0, 10.0


def warm_up(observer: Observer, kinds: tuple[str, ...] = KINDS) -> bool:
    """Compile what an identification needs, unless it is there; whether anything was to do."""
    from auvident.first_use import is_first

    waiting = [kind for kind in kinds if is_first(kind)]
    for kind in waiting:
        begin_with_kernels(observer, kind)
        _compile(kind)
    return bool(waiting)


def warm_for_runs(observer: Observer) -> None:
    """What runs with default options need."""
    warm_up(observer, KINDS[:1])


def _compile(kind: str) -> None:
    """As a first identification does, of the vehicle that comes as a template."""
    import numpy as np
    import pandas as pd

    from auvident.schema.artifacts import Maneuver, Maneuvers
    from auvident.schema.trial import Trial
    from auvident.schema.vehicle import Vehicle
    from auvident.stages.ase import estimate
    from auvident.stages.identify.warm_up import compile_for
    from auvident.storage.plan_file import read_plan
    from auvident.storage.templates import vehicle_template

    vehicle = Vehicle.model_validate(tomllib.loads(vehicle_template()))
    time = np.arange(0.0, SECONDS, 1.0 / RATE_HZ)
    wave = np.sin(0.5 * time)
    columns = {"u_mps": 1.5 + 0.01 * wave, "v_mps": 0.02 * wave, "r_radps": 0.1 * wave}
    columns |= {"heading_rad": -0.2 * np.cos(0.5 * time), "rudder_rad": -0.1 * wave}
    columns |= {"rpm": np.full(len(time), 900.0)}
    sampled = {f"{s}_sampled": True for s in ("dvl", "gyro", "rudder", "rpm", "attitude")}
    table = pd.DataFrame({"time_s": time, **columns, **sampled, "record": 0})
    maneuvers = tuple(
        Maneuver(
            id=f"made-up-{kind_of}",
            trial="made up",
            kind=kind_of,  # type: ignore[arg-type]
            role="identify",
            plane="horizontal",
            planes=("horizontal",),
            t_start_s=start,
            t_end_s=start + 0.4 * SECONDS,
        )
        for kind_of, start in (("zigzag", 0.1 * SECONDS), ("turn", 0.55 * SECONDS))
    )
    compile_for(
        Trial.from_table("made up", table, RATE_HZ),
        Maneuvers(maneuvers=maneuvers),
        estimate(vehicle),
        vehicle,
        read_plan("refined"),
        kind,
    )
