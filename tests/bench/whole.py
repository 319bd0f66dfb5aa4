"""Held-out errors of the whole vehicle in six degrees of freedom beside those of each plane."""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from auvident.engines.stretches import as_maneuver
from auvident.schema.artifacts import Maneuver
from auvident.schema.planes import PLANES
from auvident.schema.trial import Trial
from tests.engines.chain import sample
from tests.engines.whole_world import (
    TRIALS,
    errors,
    held_out,
    planar,
    rms,
    spiral_descents,
    turning_dives,
    whole_vehicle,
)

MILLI = 1.0e3
COLUMNS = {  # title: factor, by plane
    "horizontal": {"u mm/s": MILLI, "v mm/s": MILLI, "r mrad/s": MILLI, "heading deg": 57.29578},
    "vertical": {"u mm/s": MILLI, "w mm/s": MILLI, "q mrad/s": MILLI, "pitch deg": 57.29578},
}
# of both planes at once: the rudder held on the steepest slope; rudder and elevator laid and held
COUPLED = {"spiral descents": spiral_descents, "turning dives": turning_dives}

Rows = list[dict[str, Any]]


def whole() -> dict[str, Rows]:
    """RMSE of maneuvers that identified nothing, by plane: its own model, and the whole one."""
    with tempfile.TemporaryDirectory(prefix="auvident-whole-") as name:
        coupled = {title: make(Path(name)) for title, make in COUPLED.items()}
    found = {}
    for plane in PLANES:
        (own,) = sample(TRIALS[plane]).trials
        rows = _compared(plane, TRIALS[plane], own, held_out(plane))
        for title, (trial, times) in coupled.items():
            flown = [as_maneuver(trial, plane, *span) for span in times]
            rows += _compared(plane, title, trial, flown)
        found[f"{plane} plane"] = rows
    return found


def _compared(plane: str, name: str, trial: Trial, maneuvers: Sequence[Maneuver]) -> Rows:
    models = {f"model of the {plane} plane": planar(plane), "whole vehicle": whole_vehicle()}
    rows = []
    for model, own in models.items():
        error = rms([errors(own, plane, trial, m) for m in maneuvers])
        channels = zip(COLUMNS[plane].items(), error, strict=True)
        told = {title: float(np.round(value * factor, 2)) for (title, factor), value in channels}
        rows.append({"maneuvers": name, "model": model, **told})
    return rows
