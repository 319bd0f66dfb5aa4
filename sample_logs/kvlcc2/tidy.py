"""Tidy tables from the basin's files: ``python sample_logs/kvlcc2/tidy.py RAW --out DIR``.

RAW is ``data/01_raw/kvlcc2_hsva/raw_data`` of the deposit that README.md names.
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import parquet

PREFIX = "HSVA_CPMC_KVLCC2_"
# Columns of the raw files; the velocities point north and east, the eighth column is not used.
RAW = ("t_s", "north_m", "east_m", "heading_deg", "north_mps", "east_mps", "r_degps")
RUDDER, REVOLUTIONS = 8, 9  # deg, positive to port; 1/s
EVERY = 2  # 20 Hz to 10 Hz
DIGITS = 7  # of every number: more than the measurement has
SMOOTH = ("u_mps", "v_mps", "r_radps", "heading_rad", "north_m", "east_m")  # no value twice


def tidy(text: str) -> dict[str, np.ndarray]:
    """Columns in SI units and body axes of one raw file.

    Parameters
    ----------
    text : str
        The file: a header of words, then 12 numbers a line.

    Returns
    -------
    dict of str to numpy.ndarray
        Float64 columns, rounded to seven digits.
    """
    lines = [line.split() for line in text.splitlines()]
    rows = [line for line in lines if len(line) == 12 and all(map(_is_number, line))][::EVERY]
    values = np.array(rows, dtype=float).T
    raw = dict(zip(RAW, values, strict=False))
    heading = np.radians(raw["heading_deg"])
    cos, sin = np.cos(heading), np.sin(heading)
    columns = {
        "time_s": raw["t_s"] - raw["t_s"][0],
        "u_mps": cos * raw["north_mps"] + sin * raw["east_mps"],
        "v_mps": cos * raw["east_mps"] - sin * raw["north_mps"],
        "r_radps": np.radians(raw["r_degps"]),
        "rudder_rad": -np.radians(values[RUDDER]),  # positive to starboard
        "rpm": 60.0 * values[REVOLUTIONS],
        "heading_rad": heading,
        "north_m": raw["north_m"],
        "east_m": raw["east_m"],
    }
    return {name: _rounded(column) for name, column in columns.items()}


def write(columns: dict[str, np.ndarray], path: Path) -> None:
    """One test as Parquet, without a loss and in half the room of its text."""
    parquet.write_table(
        pa.table(columns),
        path,
        compression="zstd",
        use_dictionary=[name for name in columns if name not in SMOOTH],
        column_encoding=dict.fromkeys(SMOOTH, "BYTE_STREAM_SPLIT"),
    )


def _is_number(word: str) -> bool:
    return re.fullmatch(r"-?\d*\.\d+", word) is not None


def _rounded(column: np.ndarray) -> np.ndarray:
    return np.array([float(f"{value:.{DIGITS}g}") for value in column])


def main() -> None:
    """Write one Parquet file for each raw file of a folder."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("raw", type=Path, help="folder of the raw files (.dat)")
    parser.add_argument("--out", type=Path, required=True, help="folder for the Parquet files")
    arguments = parser.parse_args()
    for file in sorted(arguments.raw.glob(f"{PREFIX}*.dat")):
        name = f"hsva_{file.stem.removeprefix(PREFIX)}.parquet"
        write(tidy(file.read_text(encoding="latin-1")), arguments.out / name)


if __name__ == "__main__":
    main()
