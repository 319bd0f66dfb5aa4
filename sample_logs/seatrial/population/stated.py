"""The vehicle file as its owner would write it: what is known, with the errors people make."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from seatrial.population.equipment import Equipment
from seatrial.population.form import Size
from seatrial.vehicles import Vehicle

MASS, INERTIA, BUOYANCY, CURVE, DRAG = 0.02, 0.06, 0.01, 0.10, 0.3  # relative errors, std
CENTRE_M, HEIGHT_M, LEAST_HEIGHT_M = 0.005, 0.003, 0.001
BALLAST = (0.003, 0.02)  # of mass and buoyancy, from well to badly known
CAREFUL = 0.5  # of the owners state how well they know it


def draw_stated(
    vehicle: Vehicle, size: Size, keys: dict, equipment: Equipment, rng: np.random.Generator
) -> dict:
    """Tables of the vehicle file: geometry is exact, the rest is weighed, guessed or copied."""
    true, plant = vehicle.file["vehicle"], vehicle.plant
    inertia = float(rng.normal(1.0, INERTIA))
    tables = {
        "vehicle": {
            "name": "drawn vehicle",
            "mass_kg": true["mass_kg"] * float(rng.normal(1.0, MASS)),
            "izz_kgm2": true["izz_kgm2"] * inertia,
            "iyy_kgm2": true["iyy_kgm2"] * inertia,
            "x_g_m": float(np.round(true["x_g_m"] + rng.normal(0.0, CENTRE_M), 3)),
            "z_g_m": max(true["z_g_m"] + float(rng.normal(0.0, HEIGHT_M)), LEAST_HEIGHT_M),
            "origin_from_nose_m": true["origin_from_nose_m"],
            "buoyancy_n": true["buoyancy_n"] * float(rng.normal(1.0, BUOYANCY)),
            "design_speed_mps": round(size.speed * 5.0) / 5.0 or size.speed,
        },
        "hull": keys,
        "fin": vehicle.file["fin"],
        "propeller": vehicle.file["propeller"] | stated_curve(vehicle, size, rng),
        "dvl": vehicle.file["dvl"] | {"std_mps": _rated(equipment.noise.dvl_mps, rng)},
        "gyro": {"std_radps": _rated(equipment.noise.gyro_radps, rng)},
        "fluid": {"density_kgpm3": 1025.0 if size.density > 1012.0 else 1000.0},
        "signs": {
            "rudder_positive_turns": str(rng.choice(["port", "starboard"])),
            "elevator_positive_pitches": str(rng.choice(["down", "up"])),
        },
    }
    if rng.random() < 0.5:
        guess = guessed_drag(vehicle) * float(np.exp(rng.normal(0.0, DRAG)))
        tables["coefficients"] = {"X_uu": {"value": guess, "std": DRAG * abs(guess)}}
    if plant.dvl_z > 0.0 and rng.random() < 0.5:
        tables["dvl"]["z_m"] = round(plant.dvl_z, 3)
    return tables


def mistaken_ballast(
    vehicle: Vehicle, stated: dict, rng: np.random.Generator, care: np.random.Generator
) -> dict:
    """The table of the vehicle with the errors of ballasting: weighed well, badly, or guessed.

    Mass and buoyancy are off by 0.3 to 2 %, the height of the centre of gravity by 5 mm or by a
    tenth, its station by up to 5 mm. By `care`, half of the owners say how sure they are.
    """
    true, level = vehicle.file["vehicle"], float(np.exp(rng.uniform(*np.log(BALLAST))))
    high, unsure = true["z_g_m"] + float(rng.normal(0.0, CENTRE_M)), CENTRE_M
    if rng.random() < 0.5:
        high, unsure = true["z_g_m"] * float(rng.normal(1.0, 0.1)), 0.1 * true["z_g_m"]
    off = float(rng.uniform(0.2, 1.0)) * CENTRE_M
    table = {
        **stated["vehicle"],
        "mass_kg": true["mass_kg"] * float(rng.normal(1.0, level)),
        "buoyancy_n": true["buoyancy_n"] * float(rng.normal(1.0, level)),
        "x_g_m": float(np.round(true["x_g_m"] + rng.normal(0.0, off), 4)),
        "z_g_m": max(high, LEAST_HEIGHT_M),
    }
    if care.random() < CAREFUL:
        weights = math.sqrt(2.0) * level * vehicle.body.weight  # mass and buoyancy are both off
        stds = {"buoyancy_std_n": weights, "x_g_std_m": off, "z_g_std_m": unsure}
        table |= {key: _rated(std, care) for key, std in stds.items()}
    return {"vehicle": table}


def stated_curve(vehicle: Vehicle, size: Size, rng: np.random.Generator) -> dict:
    """The line through K_T about the working point, off by a tenth; wake from a book."""
    plant, d = vehicle.plant, vehicle.file["propeller"]["diameter_m"]
    j = (1.0 - plant.wake) * size.speed / (plant.cruise_rpm / 60.0 * d)
    slope = plant.kt[1] + 2.0 * plant.kt[2] * j
    level = plant.kt[0] + plant.kt[1] * j + plant.kt[2] * j * j
    off = float(rng.normal(1.0, CURVE))
    return {
        "kt0": off * (level - slope * j),
        "kt1": off * slope,
        "wake_fraction": 0.2,
        "thrust_deduction": 0.1,
    }


def guessed_drag(vehicle: Vehicle) -> float:
    """X_uu [kg/m] of the hull, form and friction at C_F 0.004, without fins."""
    body = vehicle.body
    area = body.drag_form * body.frontal_area + body.friction_factor * 0.004 * body.wetted_area
    return -0.5 * body.density * area


def _rated(std: float, rng: np.random.Generator) -> float:
    """A data sheet's figure for a noise, or an owner's for an error."""
    return float(std * rng.uniform(0.7, 1.4))


def write_stated(tables: dict, path: Path) -> None:
    """Write the vehicle file (TOML)."""
    lines = ["# drawn at random; geometry exact, the rest as known ashore"]
    for name, table in tables.items():
        for row in table if isinstance(table, list) else [table]:
            head = f"[[{name}]]" if isinstance(table, list) else f"[{name}]"
            lines += ["", head, *(f"{key} = {_value(v)}" for key, v in row.items())]
    path.write_text("\n".join(lines) + "\n", encoding="ascii", newline="\n")


def _value(value) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{k} = {_value(v)}" for k, v in value.items()) + " }"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_value(v) for v in value) + "]"
    if isinstance(value, int):
        return str(value)
    text = f"{float(value):.6g}"
    return text if math.isfinite(float(text)) and set(text) & set(".e") else text + ".0"
