"""What a written model breaks of what physics knows, by arithmetic of our own.

From the numbers that ``model.json`` states: matrices and signs as Lamb (1932, article 121) and the
conventions of the control angles have them, not the rows of `auvident.physics.consistency`. The
damping over the envelope flown alone is taken from what the model says of itself, because the
states flown are not in the file.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from auvident.constants import GRAVITY_MPS2

TOLERANCE = 1.0e-9  # of a share without dimension: rounding
KEPT = 0.5  # share of the least eigenvalue of the rigid body that the total mass matrix keeps
MODELS = ("identify/model.json", "refine/model.json")
DAMPING = "hull_damping"
LATERAL = {"horizontal": ("Y_v", "Y_r", "N_v", "N_r"), "vertical": ("Z_w", "Z_q", "M_w", "M_q")}
FINS = {"horizontal": ("Y_uud", "N_uud"), "vertical": ("Z_uud", "M_uud")}
SURE = 1.959964  # of its standard deviations the estimate lies on its side of zero


def broken_in(run: Path) -> dict[str, list[str]]:
    """What each model of a run breaks, by its path; a stage without a model is left out."""
    found = {}
    for name in MODELS:
        path = run / name
        if path.is_file():
            found[name] = broken(json.loads(path.read_text(encoding="utf-8")))
    return found


def broken(model: Mapping[str, Any]) -> list[str]:
    """Names of what a model breaks, where its own estimate does not break it already."""
    rows = {row["symbol"]: row for row in (*model["coefficients"], *model["constants"])}
    now = _shares(model, {name: row["value"] for name, row in rows.items()})
    before = _shares(model, {name: row["prior"] for name, row in rows.items()})
    for symbol in FINS[model["plane"]]:
        row = rows.get(symbol)
        if row is not None and abs(row["prior"]) > SURE * row["prior_std"]:
            now[symbol], before[symbol] = row["value"] / row["prior"], 1.0
    stated = [c["value"] for c in model["constraints"] if c["id"] == DAMPING]
    wrong = [name for name in now if before[name] > 0.0 and not now[name] >= -TOLERANCE]
    return wrong + [DAMPING] * any(not value >= -TOLERANCE for value in stated)


def _shares(model: Mapping[str, Any], value: Mapping[str, float]) -> dict[str, float]:
    """Least eigenvalues of the inertias, in units of the body's mass and inertia; thrust."""
    body, plane = model["rigid_body"], model["plane"]
    mass, inertia = body["mass_kg"], body["inertia_kgm2"]
    unit = np.diag([mass**-0.5, mass**-0.5, inertia**-0.5])
    fluid = np.zeros((3, 3))
    fluid[0, 0] = -value.get("X_udot", 0.0)
    fluid[1:, 1:] = -np.reshape([value.get(f"{name}dot", 0.0) for name in LATERAL[plane]], (2, 2))
    added = unit @ (0.5 * (fluid + fluid.T)) @ unit
    stated, now = (unit @ _body(body, plane, part) @ unit for part in ({}, value))
    left = np.linalg.eigvalsh(now + added)[0] - KEPT * np.linalg.eigvalsh(stated)[0]
    return {
        "surge_added_mass": float(added[0, 0]),
        "lateral_added_mass": float(np.linalg.eigvalsh(added[1:, 1:])[0]),
        "total_mass": float(left),
        "thrust": float(np.sign(value.get("T_nn", 0.0))),
        "thrust_loss": -float(np.sign(value.get("T_nu", 0.0))),
    }


def _body(body: Mapping[str, float], plane: str, value: Mapping[str, float]) -> np.ndarray:
    """Mass matrix (3, 3) of the body by surge, sway or heave, yaw or pitch.

    A righting moment that is identified says where the mass lies, too.
    """
    mass = body["mass_kg"]
    found = np.diag([mass, mass, body["inertia_kgm2"]])
    side = mass * body["x_g_m"] if plane == "horizontal" else -mass * body["x_g_m"]
    found[1, 2] = found[2, 1] = side
    if plane == "vertical":
        below = value["z_GW"] / GRAVITY_MPS2 if "z_GW" in value else mass * body["z_g_m"]
        found[0, 2] = found[2, 0] = below
    return found
