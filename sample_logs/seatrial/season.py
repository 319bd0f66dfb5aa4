"""A season: trials of three vehicles over months, in which things happen to them.

``python -m seatrial.season --out DIR [--trials 200] [--seed 0]`` (in ``sample_logs``) makes a
folder for each vehicle with its ``vehicle.toml`` and a log folder for each trial, dated;
``campaign.toml``; and ``truth.json``, which says what happened when. The water and the ballast are
others in every trial. Nothing of it is committed: it is made when it is asked for.
"""

from __future__ import annotations

import argparse
import json
import shutil
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from seatrial.effects import draw_effects
from seatrial.logs import write_logs
from seatrial.sensors import measure_all
from seatrial.trial import sail, stream
from seatrial.vehicles import VEHICLE_FOLDER, Plant, Vehicle, build_body, load_vehicle, spread_plant

FIRST_DAY = datetime(2026, 3, 2, 8, 0, tzinfo=UTC)
DAYS = 120  # of a season
SPREAD = 0.12  # of the plant of each vehicle about its table
SCHEDULE = {"straights": 1, "turns": 3, "zigzags_10": 1, "zigzags_20": 1}
LONG_SCHEDULE = {"straights": 2, "turns": 5, "zigzags_10": 2, "zigzags_20": 2}
BALLAST_STD = 0.002  # of the mass
CURRENT_MPS = 0.2


@dataclass(frozen=True)
class Boat:
    """A vehicle of the season: its table, and what happens to it at which share of the season.

    happening : ``bent fin`` (the rudder gives `size` less), ``fouling`` (drag grows by `size` to
        the end), ``new thruster`` (it gives `size` less thrust), or nothing
    """

    name: str
    table: str
    happening: str = ""
    at: float = 0.5
    size: float = 0.0


BOATS = (
    Boat("alba", "remus100", "bent fin", 0.55, 0.20),
    Boat("brio", "remus100", "fouling", 0.0, 0.30),
    Boat("cora", "tern180", "new thruster", 0.4, 0.15),
)
STEADY = tuple(replace(boat, happening="", size=0.0) for boat in BOATS)


def season(
    out: Path,
    trials: int,
    seed: int = 0,
    boats: tuple[Boat, ...] = BOATS,
    faults: bool = True,
    schedule: dict[str, int] = SCHEDULE,
) -> dict:
    """Make a season, of trials with the maneuvers of a schedule; its truth.

    With `faults` the first vehicle has a trial of the third under its name, the second one a log
    without a gyro and one whose gyro shows 0.7 of the rate.
    """
    told = {}
    for number, boat in enumerate(boats):
        count = trials // len(boats) + (number < trials % len(boats))
        plant = plant_of(boat, seed)
        folder = out / boat.name
        folder.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(VEHICLE_FOLDER / f"{boat.table}.toml", folder / "vehicle.toml")
        days = np.linspace(0.0, DAYS, count)
        rows = []
        for k in range(count):
            when = FIRST_DAY + timedelta(days=round(float(days[k]), 2), hours=number)
            own = 10_000 * seed + 1_000 * number + k
            changed = changed_plant(plant, boat, k / max(count - 1, 1))
            name = f"{when:%Y-%m-%d}"
            sail_one(boat.table, changed, own, folder / name, when, schedule)
            rows.append({"trial": name, "seed": own})
        told[boat.name] = {
            "table": boat.table,
            "happening": boat.happening,
            "size": boat.size,
            "first": _first(boat, rows),
            "trials": rows,
        }
    if faults:
        told["faults"] = _spoil(out, boats, told, seed, schedule)
    (out / "campaign.toml").write_text(_campaign(boats), encoding="utf-8")
    (out / "truth.json").write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
    return told


def sail_one(
    table: str,
    plant: Plant,
    seed: int,
    folder: Path,
    when: datetime,
    schedule: dict[str, int] = SCHEDULE,
) -> None:
    """One trial with its own water and ballast, its stamps in seconds since 1970."""
    rng = stream(seed, "ballast")
    file = load_vehicle(table).file
    body = file["vehicle"]
    ballast = {"buoyancy_n": body["buoyancy_n"] * float(1.0 + BALLAST_STD * rng.normal())}
    vehicle = load_vehicle(table, ballast=ballast)
    vehicle = Vehicle(table, vehicle.file, plant, build_body(vehicle.file, plant), {})
    speed, heading = CURRENT_MPS * rng.random(), rng.uniform(-np.pi, np.pi)
    water = {
        "north_mps": float(speed * np.cos(heading)),
        "east_mps": float(speed * np.sin(heading)),
    }
    revs = plant.cruise_rpm / 60.0
    planted = draw_effects([{"id": "current", **water}], seed, vehicle.scale, revs, "horizontal")
    recipe = {"name": folder.name, "seed": seed, "schedule": schedule}
    record, *_ = sail(recipe, vehicle, planted)
    measured = measure_all(record, vehicle, planted, lambda name: stream(seed, name))
    write_logs(
        measured, vehicle.file["signs"], when.timestamp(), folder, lambda n: stream(seed, n), "none"
    )
    for log in folder.glob("*.csv"):
        text = log.read_text(encoding="ascii")
        log.write_text(text.replace("time_s", "timestamp", 1), encoding="ascii")


def plant_of(boat: Boat, seed: int) -> Plant:
    """The plant of a vehicle: the same in all its trials."""
    from seatrial.vehicles import PLANTS

    plant, _ = spread_plant(PLANTS[boat.table], SPREAD, stream(seed, boat.name))
    return plant


def changed_plant(plant: Plant, boat: Boat, share: float) -> Plant:
    """The plant at a share of the season."""
    if boat.happening == "fouling":
        factor = 1.0 + boat.size * share
        return replace(
            plant,
            drag_form=plant.drag_form * factor,
            friction_factor=plant.friction_factor * factor,
            fin_drag=plant.fin_drag * factor,
        )
    if share < boat.at or not boat.happening:
        return plant
    if boat.happening == "bent fin":
        return replace(plant, fin_effect=plant.fin_effect * (1.0 - boat.size))
    return replace(plant, kt=tuple((1.0 - boat.size) * k for k in plant.kt))


def _first(boat: Boat, rows: list[dict]) -> str:
    """First trial with what happens; of fouling none."""
    if not boat.happening or boat.happening == "fouling":
        return ""
    shares = [k / max(len(rows) - 1, 1) for k in range(len(rows))]
    return next(row["trial"] for row, share in zip(rows, shares, strict=True) if share >= boat.at)


def _spoil(
    out: Path, boats: tuple[Boat, ...], told: dict, seed: int, schedule: dict[str, int]
) -> dict:
    """Two bad logs, and a trial under the wrong vehicle's name."""
    first, second, third = boats
    rows = {boat.name: told[boat.name]["trials"] for boat in boats}
    wrong = rows[first.name][len(rows[first.name]) // 4]["trial"]
    when = datetime.strptime(wrong, "%Y-%m-%d").replace(tzinfo=UTC)
    shutil.rmtree(out / first.name / wrong)
    plant, own = plant_of(third, seed), 10_000 * seed + 9_000
    sail_one(third.table, plant, own, out / first.name / wrong, when, schedule)
    mute, slow = (rows[second.name][len(rows[second.name]) * k // 4]["trial"] for k in (1, 3))
    (out / second.name / mute / "gyro.csv").unlink()
    _scale_gyro(out / second.name / slow / "gyro.csv", 0.7)
    return {
        "wrong vehicle": [first.name, wrong],
        "no gyro": [second.name, mute],
        "gyro scale": [second.name, slow],
    }


def _scale_gyro(log: Path, factor: float) -> None:
    head, *lines = log.read_text(encoding="ascii").splitlines()
    rows = [line.split(",") for line in lines]
    for row in rows:
        row[1:4] = [f"{factor * float(cell):.5f}" if cell else "" for cell in row[1:4]]
    log.write_text("\n".join([head, *(",".join(row) for row in rows)]) + "\n", encoding="ascii")


def _campaign(boats: tuple[Boat, ...]) -> str:
    text = '[[vehicle]]\nname = "{0}"\nfile = "{0}/vehicle.toml"\ntrials = ["{0}/2*"]\n'
    return "\n".join(text.format(boat.name) for boat in boats)


def main() -> None:
    """Make a season in a folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--trials", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--steady", action="store_true", help="nothing happens to the vehicles")
    parser.add_argument("--long", action="store_true", help="trials of 25 minutes in place of 15")
    options = parser.parse_args()
    boats = STEADY if options.steady else BOATS
    schedule = LONG_SCHEDULE if options.long else SCHEDULE
    season(options.out, options.trials, options.seed, boats, not options.steady, schedule)


if __name__ == "__main__":
    main()
