"""Log files: columns with unit suffixes, sensible decimals, and the flaws of real files."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

DEGREES = 180.0 / math.pi
# sensor -> (measured name, column, factor, decimals). The rates and fins have variants per vehicle.
COLUMNS = {
    "dvl": [("u_mps", "u_mps", 1, 4), ("v_mps", "v_mps", 1, 4), ("w_mps", "w_mps", 1, 4)],
    "gyro": [(c, f"{c}_degps", DEGREES, 3) for c in "pqr"],
    "rudder": [("value", "rudder_deg", DEGREES, 2)],
    "elevator": [("value", "elevator_deg", DEGREES, 2)],
    "rpm": [("value", "rpm", 1, 0)],
    "attitude": [(c, f"{c}_deg", DEGREES, 2) for c in ("roll", "pitch", "heading")],
    "depth": [("depth", "depth_m", 1, 3)],
    "position": [("north", "north_m", 1, 2), ("east", "east_m", 1, 2)],
}
GYRO_RADIANS = [(c, f"{c}_radps", 1, 5) for c in "pqr"]


def write_logs(measured: dict, signs: dict, origin_s: float, folder: Path, streams, tail: str):
    """Write one CSV file per sensor into `folder`.

    `signs` is the vehicle file's table; `origin_s` shifts the time stamps to the log clock;
    the file of sensor `tail` ends in the middle of its last line, as after a lost link.
    """
    folder.mkdir(parents=True, exist_ok=True)
    for sensor, data in measured.items():
        columns = COLUMNS[sensor]
        if sensor == "gyro" and signs["rudder_positive_turns"] == "starboard":
            columns = GYRO_RADIANS
        data = with_log_sign(sensor, data, signs)
        text = table_text(data, columns, origin_s, streams(sensor + " file"))
        if sensor == tail:
            text = text[: -len(text.splitlines()[-1]) // 2 - 1]
        (folder / f"{sensor}.csv").write_text(text, encoding="ascii", newline="\n")


def with_log_sign(sensor: str, data: dict, signs: dict) -> dict:
    """Fin commands in the sign the vehicle logs."""
    flipped = {
        "rudder": signs["rudder_positive_turns"] == "starboard",
        "elevator": signs["elevator_positive_pitches"] == "up",
    }
    return {**data, "value": -data["value"]} if flipped.get(sensor) else data


def table_text(data: dict, columns: list, origin_s: float, rng: np.random.Generator) -> str:
    """The CSV text of one sensor."""
    stamps = flawed_stamps(data["time_s"] + origin_s, rng)
    cells = [[f"{t:.3f}" for t in stamps]]
    for name, _, factor, decimals in columns:
        cells.append([number_text(x, decimals) for x in data[name] * factor])
    blank_some(cells, rng)
    header = ["time_s"] + [column for _, column, _, _ in columns]
    if "valid" in data:
        header.append("valid")
        cells.append([str(x) for x in data["valid"]])
    lines = [",".join(header)] + [",".join(row) for row in zip(*cells, strict=True)]
    return "\n".join(lines) + "\n"


def number_text(value: float, decimals: int) -> str:
    """Fixed decimals, no minus zero, an empty cell for NaN."""
    if math.isnan(value):
        return ""
    text = f"{value:.{decimals}f}"
    return text[1:] if text.startswith("-") and float(text) == 0 else text


def flawed_stamps(times: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A few repeated stamps and a few that step back."""
    times = np.round(times, 3)
    repeated = rng.integers(1, times.size, rng.integers(0, 4))
    times[repeated] = times[repeated - 1]
    backward = rng.integers(10, times.size, rng.integers(0, 3))
    times[backward] -= np.round(rng.uniform(0.3, 1.2, backward.size), 3)
    return times


def blank_some(cells: list, rng: np.random.Generator) -> None:
    """A few empty cells, never the time."""
    for row in rng.integers(0, len(cells[0]), rng.integers(0, 5)):
        cells[int(rng.integers(1, len(cells)))][row] = ""
