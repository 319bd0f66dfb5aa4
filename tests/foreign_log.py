"""A trial as another logger writes it: one wide file, other names, knots, a helm to starboard.

It is `sample_logs/harbour_trial` in all but its looks, so that a page of the documentation can
show how a log of one's own is read, and a test that it is read right.
"""

from pathlib import Path

import pandas as pd

from tests.command_line import SAMPLES

KNOT_MPS = 1852.0 / 3600.0
TRIAL = SAMPLES / "harbour_trial"
# column of the foreign file: sensor, its column, a factor, decimals
COLUMNS = {
    "Log fwd [kn]": ("dvl", "u_mps", 1.0 / KNOT_MPS, 4),
    "Log stbd [kn]": ("dvl", "v_mps", 1.0 / KNOT_MPS, 4),
    "Yaw rate [deg/s]": ("gyro", "r_degps", 1.0, 3),
    "Compass [deg]": ("attitude", "heading_deg", 1.0, 2),
    "Helm [deg]": ("rudder", "rudder_deg", -1.0, 2),
    "Motor [rpm]": ("rpm", "rpm", 1.0, 0),
    "Northing [m]": ("position", "north_m", 1.0, 2),
    "Easting [m]": ("position", "east_m", 1.0, 2),
}
RATE_HZ = 20.0


def write(file: Path) -> None:
    """One row every 50 ms with what came since the row before; empty where nothing did."""
    found = [_sensor(name, *source) for name, source in COLUMNS.items()]
    wide = pd.concat(found, axis=1).sort_index()
    wide.index = pd.Index([f"{k / RATE_HZ:.2f}" for k in wide.index], name="Time [s]")
    wide.to_csv(file, sep=";")


def _sensor(name: str, sensor: str, column: str, factor: float, digits: int) -> pd.Series:
    rows = pd.read_csv(TRIAL / f"{sensor}.csv").dropna()
    if "valid" in rows:
        rows = rows[rows["valid"] == 1]
    at = (rows["time_s"] * RATE_HZ).round().astype(int)
    last = (rows[column] * factor).groupby(at).last()
    return last.map(lambda value: f"{value:.{digits}f}").rename(name)
