"""Errors of a prediction as `validate` writes it, by channel."""

import math

import numpy as np
import pandas as pd

from auvident.schema.planes import STATES

NAMES = {state.column: (state.symbol, state.unit) for state in STATES}


def channels_of(rows: pd.DataFrame) -> list[tuple[str, str, str]]:
    """Column, name and unit of the channels in a table."""
    return [(c, *NAMES[c]) for c in NAMES if f"{c}_measured" in rows]


def rms_of(rows: pd.DataFrame, column: str) -> float:
    """Error of a channel; infinite where a prediction ran away, NaN where nothing was measured."""
    measured, simulated = (rows[f"{column}_{k}"].to_numpy() for k in ("measured", "simulated"))
    seen = np.isfinite(measured)
    if not seen.any():
        return math.nan
    error = simulated[seen] - measured[seen]
    return float(np.sqrt(np.mean(error**2))) if np.isfinite(error).all() else math.inf


def cruise_of(table: pd.DataFrame) -> tuple[float, float]:
    """Median speed [m/s] and propeller rate [rev/s] of the maneuvers."""
    return float(table["u_mps_measured"].median()), float(table["rpm"].median()) / 60.0
