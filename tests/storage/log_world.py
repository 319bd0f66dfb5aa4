"""Small logs on disk: a vehicle that weaves, each sensor at its own rate."""

import gzip
from pathlib import Path

import numpy as np
import pandas as pd

RATES = {"dvl": 5.0, "gyro": 20.0, "rudder": 10.0, "rpm": 2.0}
DURATION_S = 30.0


def sensor_tables(origin_s: float = 100.0) -> dict[str, pd.DataFrame]:
    """Tables of the needed sensors, columns as in the contract."""
    tables = {}
    for sensor, rate in RATES.items():
        t = np.arange(0.0, DURATION_S, 1.0 / rate)
        phase = 2 * np.pi * t / 12.0
        columns = {
            "dvl": {"u_mps": 1.5 + 0.1 * np.cos(phase), "v_mps": 0.1 * np.sin(phase)},
            "gyro": {"r_degps": 5.0 * np.sin(phase)},
            "rudder": {"rudder_deg": 10.0 * np.sign(np.sin(phase + 0.1))},
            "rpm": {"rpm": np.full(t.size, 1200.0)},
        }[sensor]
        tables[sensor] = pd.DataFrame({"time_s": np.round(t + origin_s, 3), **columns})
    return tables


def write_folder(folder: Path, tables: dict[str, pd.DataFrame] | None = None) -> Path:
    """A trial folder with one CSV file per sensor."""
    folder.mkdir(parents=True, exist_ok=True)
    for sensor, table in (tables or sensor_tables()).items():
        table.to_csv(folder / f"{sensor}.csv", index=False)
    return folder


def wide_table() -> pd.DataFrame:
    """All columns at 10 Hz on one clock."""
    t = np.round(np.arange(0.0, DURATION_S, 0.1), 3)
    phase = 2 * np.pi * t / 12.0
    return pd.DataFrame(
        {
            "time_s": t,
            "u_mps": np.round(1.5 + 0.1 * np.cos(phase), 4),
            "v_mps": np.round(0.1 * np.sin(phase), 4),
            "r_radps": np.round(0.1 * np.sin(phase), 5),
            "rudder_deg": np.round(10.0 * np.sign(np.sin(phase + 0.1)), 1),
            "rpm": 1200.0,
        }
    )


def write_gzip(path: Path, text: str) -> Path:
    """A compressed text file."""
    path.write_bytes(gzip.compress(text.encode()))
    return path
