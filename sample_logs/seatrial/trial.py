"""From a recipe to a log folder and its truth."""

from __future__ import annotations

import zlib
from pathlib import Path

import numpy as np

from seatrial import helm
from seatrial.effects import draw_effects
from seatrial.logs import write_logs
from seatrial.plant import workspace
from seatrial.planting import (
    fin_servo,
    motor_drive,
    plant_effects,
    vertical_water,
    with_weight,
)
from seatrial.schedule import random_schedule
from seatrial.sensors import drifted, measure_all
from seatrial.simulate import STEP_S, Sea, run, start_state
from seatrial.vehicles import Vehicle, load_vehicle

LONGEST_S = {"horizontal": 2100.0, "vertical": 2100.0, "both": 4200.0}
RECIPE_KEYS = {"name", "vehicle", "seed", "spread", "plane", "schedule", "effect", "ballast"}


def generate(recipe: dict, out_dir: str | Path | None) -> dict:
    """Sail a trial and write its log.

    Parameters
    ----------
    recipe : ``name``, ``vehicle`` (file stem), ``seed``; optional ``spread`` (random factors on the
        plant parameters), ``plane`` ("horizontal", "vertical" or "both"), ``schedule`` (numbers of
        maneuvers), ``effect`` (list of tables with ``id`` and, optionally, parameters),
        ``ballast`` (true mass_kg, buoyancy_n, x_g_m, z_g_m where the vehicle file is wrong)
    out_dir : folder of the CSV files; None writes none

    Returns
    -------
    dict
        The truth: maneuvers on the log clock, effects with parameters, spread factors.
    """
    unknown = set(recipe) - RECIPE_KEYS
    if unknown:
        raise ValueError(f"unknown recipe keys {sorted(unknown)}; known: {sorted(RECIPE_KEYS)}")
    seed = int(recipe["seed"])
    vehicle = load_vehicle(
        recipe["vehicle"],
        recipe.get("spread", 0.0),
        stream(seed, "spread"),
        recipe.get("ballast", {}),
    )
    planted = draw_effects(
        recipe.get("effect", []),
        seed,
        vehicle.scale,
        vehicle.plant.cruise_rpm / 60.0,
        recipe.get("plane", "horizontal"),
    )
    record, starts, legs, notes = sail(recipe, vehicle, planted)
    origin = float(np.round(stream(seed, "origin").uniform(0, 900), 1))
    if out_dir is not None:
        measured = measure_all(record, vehicle, planted, lambda name: stream(seed, name))
        tail = ("attitude", "depth", "position", "none")[seed % 4]
        signs = vehicle.file["signs"]
        write_logs(measured, signs, origin, Path(out_dir), lambda n: stream(seed, n), tail)
    maneuvers = maneuver_list(legs, starts, notes, origin)
    ballast = {"ballast": recipe["ballast"]} if "ballast" in recipe else {}
    return {
        "trial": recipe["name"],
        "vehicle": recipe["vehicle"],
        "seed": seed,
        "plane": recipe.get("plane", "horizontal"),
        "time_origin_s": origin,
        "duration_s": round(record.shape[0] * STEP_S, 2),
        "spread_factors": vehicle.spread_factors,
        **ballast,
        "effects": truth_effects(planted, maneuvers, origin),
        "maneuvers": maneuvers,
    }


def stream(seed: int, name: str) -> np.random.Generator:
    """Random stream of one purpose, so that one change leaves the others as they are."""
    return np.random.default_rng([seed, zlib.crc32(name.encode())])


def sail(recipe: dict, vehicle: Vehicle, planted: dict):
    """Run the simulation. Returns the record, leg starts [s], legs and maneuver notes."""
    seed, plane = int(recipe["seed"]), recipe.get("plane", "horizontal")
    legs, notes = random_schedule(
        plane,
        vehicle.plant.cruise_rpm,
        stream(seed, "schedule"),
        recipe.get("schedule", {}),
    )
    rng = stream(seed, "sea")
    body = vehicle.body
    record, starts = run(
        legs,
        start_state(0.97 * body.radius, rng.uniform(-np.pi, np.pi)),
        body,
        plant_effects(planted),
        fin_servo("rudder", planted),
        fin_servo("elevator", planted),
        motor_drive(planted),
        make_sea(vehicle, planted, legs, notes, rng, plane == "vertical"),
        helm.Gains(),
        rng.normal(size=(int(LONGEST_S[plane] / STEP_S), 9)),
        workspace(),
    )
    if not np.isfinite(record).all():
        raise FloatingPointError(f"{recipe['name']}: the simulated vehicle went out of bounds")
    return drifted(record, planted), starts, legs, notes


def make_sea(vehicle: Vehicle, planted: dict, legs, notes, rng, upright: bool = False) -> Sea:
    """Turbulence, surface waves, and what is planted in the sea; `upright` in heave and pitch."""
    size = vehicle.scale
    amplitude = np.array([2.0, 4.0, 6.0, 0.25, 1.0, 0.8]) * size
    wave, event = planted.get("wave", {}), planted.get("one_off_event")
    sea = Sea(
        turbulence=np.array(vehicle.plant.turbulence),
        surface_omega=rng.uniform(2.4, 3.6, 3),
        surface_phase=rng.uniform(0, 2 * np.pi, 3),
        surface_force=amplitude * rng.uniform(0.3, 1.0, (3, 6)),
        swell_force=float(wave.get("force_n", 0.0)),
        swell_moment=float(wave.get("moment_nm", 0.0)),
        swell_omega=float(wave.get("omega_radps", 1.0)),
        swell_direction=float(wave.get("direction_rad", 0.0)),
        upright=upright,
    )
    sea = with_weight(planted, vertical_water(planted, sea))
    stuck = planted.get("stuck_elevator")
    if stuck is not None:
        sea = sea._replace(
            stuck_leg=leg_of(stuck, legs, notes),
            stuck_after_s=float(stuck["after_s"]),
            stuck_for_s=float(stuck["duration_s"]),
        )
    if event is None:
        return sea
    return sea._replace(
        event_leg=leg_of(event, legs, notes),
        event_after_s=float(event["after_s"]),
        event_duration_s=float(event["duration_s"]),
        event_force=float(event["force_n"]),
        event_moment=float(event["moment_nm"]),
    )


def leg_of(event: dict, legs: np.ndarray, notes: list) -> int:
    """First leg of the maneuver in which something happens."""
    number = min(int(event["maneuver_fraction"] * len(notes)), len(notes) - 1)
    return int(np.flatnonzero(legs[:, helm.MANEUVER] == number)[0])


def maneuver_list(legs: np.ndarray, starts: np.ndarray, notes: list, origin: float) -> list[dict]:
    """Maneuvers with start and end on the log clock, from the legs that carry their number."""
    found = []
    for number, note in enumerate(notes):
        rows = np.flatnonzero(legs[:, helm.MANEUVER] == number)
        begin, end = starts[rows[0]], starts[rows[-1] + 1]
        if begin < 0 or end < 0:
            continue
        times = {
            "t_start_s": round(float(begin) + origin, 2),
            "t_end_s": round(float(end) + origin, 2),
        }
        found.append({**note, **times})
    return sorted(found, key=lambda m: m["t_start_s"])


def truth_effects(planted: dict, maneuvers: list[dict], origin: float) -> list[dict]:
    """Planted effects; times of the trial go over to the log clock."""
    effects = []
    for name, parameters in planted.items():
        entry = {"id": name, "parameters": dict(parameters)}
        if name in ("one_off_event", "stuck_elevator"):
            number = min(int(parameters["maneuver_fraction"] * len(maneuvers)), len(maneuvers) - 1)
            begin = maneuvers[number]["t_start_s"] + parameters["after_s"]
            entry["log_time_s"] = [round(begin, 2), round(begin + parameters["duration_s"], 2)]
        if name in ("thrust_step", "weight_change"):
            entry["log_time_s"] = [round(parameters["time_s"] + origin, 2)]
        effects.append(entry)
    return effects
