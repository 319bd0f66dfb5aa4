"""A written trial that is about to be damaged: its folder, its vehicle file, a map if it needs one.

Files are edited as text, cells that a kind of damage does not touch keep their digits.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

TIME = "time_s"
NEEDED = ("dvl", "gyro", "rudder", "rpm")
VELOCITIES = ("u", "v", "w")
BUSY_SHARE = 0.5  # of the 95 % quantile of the yaw rate: faster is a turn


@dataclass
class Log:
    """A trial on disk.

    folder : one CSV file a sensor, named after it
    vehicle : the vehicle file
    logs : what is handed to the program; the folder, unless a kind of damage says otherwise
    map : the map file that is given, if any
    lost : rows of readings that are spoilt or gone
    """

    folder: Path
    vehicle: Path
    logs: list[Path] = field(default_factory=list)
    map: Path | None = None
    lost: int = 0

    def __post_init__(self) -> None:
        self.logs = self.logs or [self.folder]

    # --- files ----------------------------------------------------------------------------

    def file(self, sensor: str) -> Path:
        """The file of a sensor."""
        return self.folder / f"{sensor}.csv"

    def sensors(self) -> list[str]:
        """Sensors that have a file."""
        return sorted(path.stem for path in self.folder.glob("*.csv"))

    def remove(self, *sensors: str) -> None:
        """Take sensors out of the log."""
        for sensor in sensors:
            self.file(sensor).unlink(missing_ok=True)

    def edit(self, sensor: str, change: Callable[[str], str]) -> None:
        """Change the text of a file."""
        path = self.file(sensor)
        path.write_text(change(path.read_text(encoding="utf-8")), encoding="utf-8", newline="")

    def edit_all(self, change: Callable[[str], str]) -> None:
        """Change the text of every file."""
        for sensor in self.sensors():
            self.edit(sensor, change)

    def edit_lines(self, sensor: str, change: Callable[[list[str]], list[str]]) -> None:
        """Change the lines of a file, the header is the first."""
        self.edit(sensor, lambda text: "\n".join(change(text.splitlines())) + "\n")

    def edit_bytes(self, sensor: str, change: Callable[[bytes], bytes]) -> None:
        """Change the bytes of a file."""
        self.file(sensor).write_bytes(change(self.file(sensor).read_bytes()))

    # --- tables ---------------------------------------------------------------------------

    def read(self, sensor: str) -> pd.DataFrame:
        """The cells of a sensor as text."""
        return pd.read_csv(self.file(sensor), dtype=str, keep_default_na=False).fillna("")

    def write(self, sensor: str, table: pd.DataFrame) -> None:
        """Write the cells of a sensor."""
        table.to_csv(self.file(sensor), index=False, lineterminator="\n")

    def time(self, sensor: str) -> np.ndarray:
        """Time stamps of a sensor [s]."""
        return numbers(self.read(sensor)[TIME])

    def values(self, sensor: str, quantity: str) -> np.ndarray:
        """Readings of a quantity, NaN where there is none."""
        table = self.read(sensor)
        return numbers(table[column(table, quantity)])

    def change(
        self,
        sensor: str,
        quantities: Iterable[str],
        function: Callable[[np.ndarray, np.ndarray], np.ndarray],
    ) -> None:
        """New values of quantities from time and values, in as many digits as before, or more."""
        table = self.read(sensor)
        time = numbers(table[TIME])
        for quantity in quantities:
            name = TIME if quantity == TIME else column(table, quantity)
            before = numbers(table[name])
            after = np.asarray(function(time, before), dtype=float)
            touched = ~((after == before) | (np.isnan(after) & np.isnan(before)))
            cells = table[name].to_numpy(dtype=object)
            places = decimals(table[name]) + 2 * (quantity != TIME)
            cells[touched] = [cell(x, places) for x in after[touched]]
            table[name] = cells
        self.write(sensor, table)

    def scale(self, sensor: str, quantities: Iterable[str], factor: float) -> None:
        """Multiply quantities."""
        self.change(sensor, quantities, lambda _, x: x * factor)

    def rename(self, sensor: str, names: dict[str, str]) -> None:
        """Give columns other names: `names` by quantity."""
        table = self.read(sensor)
        self.write(sensor, table.rename(columns={column(table, q): n for q, n in names.items()}))

    def swap(self, sensor: str, one: str, other: str) -> None:
        """Exchange the readings of two quantities."""
        table = self.read(sensor)
        a, b = column(table, one), column(table, other)
        table[a], table[b] = table[b].copy(), table[a].copy()
        self.write(sensor, table)

    def retime(self, sensor: str, function: Callable[[np.ndarray], np.ndarray]) -> None:
        """New time stamps from the old ones."""
        self.change(sensor, [TIME], lambda t, _: function(t))

    def drop(self, sensor: str, gone: np.ndarray) -> None:
        """Leave out rows, which count as lost."""
        self.lost += int(gone.sum())
        self.write(sensor, self.read(sensor)[~gone])

    def spoil(
        self,
        sensor: str,
        quantities: Iterable[str],
        bad: np.ndarray,
        value: float | np.ndarray | Callable[[np.ndarray], np.ndarray],
    ) -> None:
        """Put a value in the place of the readings of some rows, which count as lost."""
        self.lost += int(bad.sum())

        def changed(_: np.ndarray, x: np.ndarray) -> np.ndarray:
            x = x.copy()
            x[bad] = value(x)[bad] if callable(value) else np.broadcast_to(value, x.shape)[bad]
            return x

        self.change(sensor, quantities, changed)

    def put(self, sensor: str, quantities: Iterable[str], bad: np.ndarray, text: str) -> None:
        """Put a text in the place of the readings of some rows, which count as lost."""
        self.lost += int(bad.sum())
        table = self.read(sensor)
        for quantity in quantities:
            table.loc[bad, column(table, quantity)] = text
        self.write(sensor, table)

    # --- what went on ---------------------------------------------------------------------

    def span(self) -> tuple[float, float]:
        """First and last time of the gyro [s]."""
        time = self.time("gyro")
        return float(np.nanmin(time)), float(np.nanmax(time))

    def part(self, sensor: str, first: float, last: float) -> np.ndarray:
        """Rows between two shares of the trial."""
        begin, end = self.span()
        share = (self.time(sensor) - begin) / (end - begin)
        return (share >= first) & (share < last)

    def turning(self, sensor: str) -> np.ndarray:
        """Rows of a sensor in which the vehicle turns."""
        time, rate = self.time("gyro"), np.abs(self.values("gyro", "r"))
        known = np.isfinite(time) & np.isfinite(rate)
        order = np.argsort(time[known], kind="stable")
        at = np.interp(self.time(sensor), time[known][order], rate[known][order])
        return at > BUSY_SHARE * np.nanquantile(rate, 0.95)

    def busy(self, sensor: str, seconds: float) -> np.ndarray:
        """Rows of a sensor in the stretch of time in which the rudder moves most."""
        time, rudder = self.time("rudder"), self.values("rudder", "rudder")
        known = np.isfinite(time) & np.isfinite(rudder)
        time, travel = time[known], np.abs(np.diff(rudder[known], prepend=rudder[known][0]))
        starts = np.arange(time.min(), time.max() - seconds, seconds / 4.0)
        moved = [travel[(time >= s) & (time < s + seconds)].sum() for s in starts]
        begin = float(starts[int(np.argmax(moved))])
        at = self.time(sensor)
        return (at >= begin) & (at < begin + seconds)

    def heading(self, at: np.ndarray) -> np.ndarray:
        """Heading [rad] at those times."""
        table = self.read("attitude")
        time, psi = numbers(table[TIME]), np.radians(numbers(table[column(table, "heading")]))
        known = np.isfinite(time) & np.isfinite(psi)
        order = np.argsort(time[known], kind="stable")
        return np.interp(at, time[known][order], np.unwrap(psi[known][order]))

    # --- vehicle file, map ----------------------------------------------------------------

    def edit_vehicle(self, change: Callable[[str], str]) -> None:
        """Change the text of the vehicle file."""
        text = self.vehicle.read_text(encoding="utf-8")
        self.vehicle.write_text(change(text), encoding="utf-8")

    def set_key(self, table: str, key: str, value: str | Callable[[str], str] | None) -> None:
        """Set, change or (with None) remove a key of every table of that name."""
        self.edit_vehicle(lambda text: with_key(text, table, key, value))

    def write_map(self, text: str) -> None:
        """Give a map."""
        self.map = self.folder.parent / "map.toml"
        self.map.write_text(text, encoding="utf-8")


def numbers(cells: pd.Series) -> np.ndarray:
    """Cells as numbers, NaN where they are none."""
    return pd.to_numeric(cells, errors="coerce").to_numpy(dtype=float, copy=True)


def column(table: pd.DataFrame, quantity: str) -> str:
    """The column of a quantity: named after it, with a unit behind."""
    for name in table.columns:
        if name == quantity or name.startswith(f"{quantity}_"):
            return str(name)
    raise KeyError(f"no column of {quantity!r} among {list(table.columns)}")


def decimals(cells: pd.Series) -> int:
    """Digits behind the point in the first cells."""
    return max((len(c.partition(".")[2]) for c in cells[:20] if "e" not in c.lower()), default=3)


def cell(value: float, places: int) -> str:
    """A number as text; empty for NaN."""
    if math.isnan(value):
        return ""
    if not math.isfinite(value) or (value != 0.0 and not 1e-9 < abs(value) < 1e12):
        return repr(float(value))
    return f"{value:.{places}f}"


def with_key(text: str, table: str, key: str, value: str | Callable[[str], str] | None) -> str:
    """The text of a TOML file with another value of a key, in every table of that name."""
    inside, lines, heads = False, [], (f"[{table}]", f"[[{table}]]")
    for line in text.splitlines():
        if line.startswith("["):
            inside = line.split("#")[0].strip() in heads
            lines.append(line)
            if inside and isinstance(value, str):
                lines.append(f"{key} = {value}")
            continue
        name, _, old = (piece.strip() for piece in line.partition("="))
        if not inside or name != key:
            lines.append(line)
        elif callable(value):
            lines.append(f"{key} = {value(old)}")
    return "\n".join(lines) + "\n"


def times(factor: float) -> Callable[[str], str]:
    """For `with_key`: the value times a factor."""
    return lambda old: repr(float(old.split("#")[0]) * factor)


def as_rows(table: pd.DataFrame, quoting: int = csv.QUOTE_MINIMAL, separator: str = ",") -> str:
    """A table as CSV text."""
    stream = io.StringIO()
    table.to_csv(stream, index=False, sep=separator, quoting=quoting, lineterminator="\n")
    return stream.getvalue()
