"""Damage: files that are missing, damaged, foreign or there twice."""

from __future__ import annotations

import gzip
import shutil

import numpy as np
import pandas as pd

from seatrial.damage.kind import REFUSED, RIGHT, SAID, Kind, family
from seatrial.damage.log import NEEDED, TIME, Log, numbers

FILES, TWICE = "files", "the same trial twice"
SHIFT_S = 1234.5


def written(name: str, content: bytes):
    """Apply: a file beside the others."""
    return lambda log, *_: (log.folder / name).write_bytes(content) and None


def emptied(sensor: str):
    """Apply: a file without a byte."""
    return lambda log, *_: log.edit_bytes(sensor, lambda _: b"")


def gone(sensor: str):
    """Apply: a file is not there."""
    return lambda log, *_: log.remove(sensor)


def header_alone(sensor: str):
    """Apply: a file of a header."""
    return lambda log, *_: log.edit_lines(sensor, lambda lines: lines[:1])


def zipped(log: Log, share: float, _: np.random.Generator) -> None:
    """Files as .csv.gz; with a share below 1, the DVL's is cut."""
    for sensor in log.sensors():
        data = gzip.compress(log.file(sensor).read_bytes(), 1)
        data = data[: int(share * len(data))] if sensor == "dvl" else data
        (log.folder / f"{sensor}.csv.gz").write_bytes(data)
        log.remove(sensor)


def frame(log: Log, sensor: str) -> pd.DataFrame:
    """A sensor as numbers."""
    table = log.read(sensor)
    return pd.DataFrame({name: numbers(table[name]) for name in table.columns})


def parquet(log: Log, *_: object) -> None:
    """Parquet files."""
    for sensor in log.sensors():
        frame(log, sensor).to_parquet(log.folder / f"{sensor}.parquet")
        log.remove(sensor)


def parquet_cut(sensor: str):
    """Apply: a Parquet file that ends early."""

    def apply(log: Log, *_: object) -> None:
        path = log.folder / f"{sensor}.parquet"
        frame(log, sensor).to_parquet(path)
        path.write_bytes(path.read_bytes()[:-200])
        log.remove(sensor)

    return apply


def wide(log: Log, *_: object) -> None:
    """One table with all columns, a row a stamp, cells empty where a sensor has none."""
    frames = [frame(log, s).dropna(subset=[TIME]) for s in log.sensors()]
    table = pd.concat(frames).sort_values(TIME, kind="stable")
    log.remove(*log.sensors())
    table.to_csv(log.folder / "log.csv", index=False)


def twice(log: Log, shift_s: float, rng: np.random.Generator) -> None:
    """A copy of the trial under another name, with another clock."""
    copy(log, shift_s)


def copy(log: Log, shift_s: float) -> Log:
    """Add a copy of the trial."""
    other = log.folder.parent / "another"
    shutil.copytree(log.folder, other)
    again = Log(other, log.vehicle)
    if shift_s:
        for sensor in again.sensors():
            again.retime(sensor, lambda t: t + shift_s)
    log.logs = [*log.logs, other]
    return again


def twice_parquet(log: Log, *_: object) -> None:
    """A copy in another format."""
    parquet(copy(log, 0.0))


def twice_in_part(log: Log, share: float, _: np.random.Generator) -> None:
    """A copy of the beginning."""
    again = copy(log, 0.0)
    rows = {sensor: again.part(sensor, -1.0, share) for sensor in again.sensors()}
    for sensor, kept in rows.items():
        again.drop(sensor, ~kept)


def rate_changed(log: Log, *_: object) -> None:
    """A copy at another rate, interpolated, on another clock."""
    again = copy(log, 0.0)
    for sensor in again.sensors():
        table = frame(again, sensor).dropna()
        table = table.sort_values(TIME).drop_duplicates(TIME)
        time, period = table[TIME].to_numpy(), float(np.median(np.diff(table[TIME])))
        grid = np.arange(time[0], time[-1], 1.3 * period)
        columns = {n: np.interp(grid, time, table[n]) for n in table.columns if n != TIME}
        if "heading_deg" in columns:
            angle = np.unwrap(np.radians(table["heading_deg"].to_numpy()))
            columns["heading_deg"] = np.degrees(np.interp(grid, time, angle)) % 360.0
        if "valid" in columns:
            columns["valid"] = np.ones(grid.size)
        again.write(sensor, pd.DataFrame({TIME: grid + SHIFT_S, **columns}).round(5))


def split(log: Log, *_: object) -> None:
    """The gyro's file in two parts."""
    table, half = log.read("gyro"), log.part("gyro", 0.5, 2.0)
    table[~half].to_csv(log.folder / "gyro_1.csv", index=False)
    table[half].to_csv(log.folder / "gyro_2.csv", index=False)
    log.remove("gyro")


def also_parquet(log: Log, *_: object) -> None:
    """dvl.csv and dvl.parquet, not the same readings."""
    table = frame(log, "dvl")
    table["u_mps"] *= 0.9
    table.to_parquet(log.folder / "dvl.parquet")


def capitals(log: Log, *_: object) -> None:
    """File names in capitals."""
    for sensor in log.sensors():
        log.file(sensor).rename(log.folder / f"{sensor.upper()}.CSV")


def other_sensor(log: Log, *_: object) -> None:
    """The DVL's file under the name of the gyro's, too."""
    shutil.copy(log.file("dvl"), log.file("gyro"))


def other_trial(log: Log, *_: object) -> None:
    """The rudder's file of another time."""
    log.retime("rudder", lambda t: t + 1e5)


def backwards(log: Log, *_: object) -> None:
    """The rudder's file of another run of the same length."""
    table = log.read("rudder")
    name = table.columns[1]
    table[name] = table[name].to_numpy()[::-1]
    log.write("rudder", table)


NOTES = b"time,remark\n12:31,launched\n12:40,zigzag looks good\n13:15,recovered\n"
PICTURE = bytes((137, 80, 78, 71, 13, 10, 26, 10)) + bytes(range(256)) * 4

ROWS = family(
    "files",
    Kind("empty-depth", FILES, "depth.csv without a byte", RIGHT, emptied("depth"), (), "depth"),
    Kind(
        "empty-attitude",
        FILES,
        "attitude.csv without a byte",
        RIGHT,
        emptied("attitude"),
        (),
        "attitude",
    ),
    Kind("empty-dvl", FILES, "dvl.csv without a byte", REFUSED, emptied("dvl"), (), "dvl"),
    *(Kind(f"no-{s}", FILES, f"no {s}.csv", REFUSED, gone(s), (), s) for s in NEEDED),
    Kind(
        "header-alone-dvl",
        FILES,
        "dvl.csv with a header alone",
        REFUSED,
        header_alone("dvl"),
        (),
        "dvl",
    ),
    Kind(
        "header-alone-position",
        FILES,
        "position.csv with a header alone",
        RIGHT,
        header_alone("position"),
        (),
        "position",
    ),
    Kind(
        "notes",
        FILES,
        "notes.csv of another kind in the folder",
        RIGHT,
        written("notes.csv", NOTES),
    ),
    Kind(
        "hidden-files",
        FILES,
        ".DS_Store and ._dvl.csv in the folder",
        RIGHT,
        lambda log, *_: [written(n, PICTURE)(log) for n in (".DS_Store", "._dvl.csv")] and None,
    ),
    Kind(
        "picture",
        FILES,
        "a picture named depth.csv",
        RIGHT,
        lambda log, *_: log.edit_bytes("depth", lambda _: PICTURE),
        (),
        "depth",
    ),
    Kind(
        "picture-dvl",
        FILES,
        "a picture named dvl.csv",
        REFUSED,
        lambda log, *_: log.edit_bytes("dvl", lambda _: PICTURE),
        (),
        "dvl",
    ),
    Kind(
        "position-parquet-cut",
        FILES,
        "position.parquet ends early",
        RIGHT,
        parquet_cut("position"),
        (),
        "position",
    ),
    Kind(
        "dvl-parquet-cut", FILES, "dvl.parquet ends early", REFUSED, parquet_cut("dvl"), (), "dvl"
    ),
    Kind("gzip", FILES, "files as .csv.gz", RIGHT, lambda log, _, rng: zipped(log, 1.0, rng)),
    Kind("gzip-cut", FILES, "dvl.csv.gz ends after a share of {}", REFUSED, zipped, (0.5,), "dvl"),
    Kind("parquet", FILES, "Parquet files", RIGHT, parquet),
    Kind("wide", FILES, "one file with all columns", RIGHT, wide),
    Kind("capitals", FILES, "file names in capitals", RIGHT, capitals),
    Kind("split", FILES, "gyro_1.csv and gyro_2.csv", REFUSED, split, (), "gyro"),
    Kind(
        "dvl-two-formats",
        FILES,
        "dvl.csv and dvl.parquet, which differ",
        REFUSED,
        also_parquet,
        (),
        "dvl",
    ),
    Kind(
        "backup-copy",
        FILES,
        "dvl (1).csv beside dvl.csv",
        SAID,
        lambda log, *_: shutil.copy(log.file("dvl"), log.folder / "dvl (1).csv") and None,
        (),
        "dvl",
    ),
    Kind(
        "wrong-sensor",
        FILES,
        "the DVL's file under the name of the gyro's",
        REFUSED,
        other_sensor,
        (),
        "gyro",
    ),
    Kind(
        "rudder-of-another-day",
        FILES,
        "the rudder's file of another time",
        REFUSED,
        other_trial,
        (),
        "rudder",
    ),
    Kind(
        "rudder-of-another-trial",
        FILES,
        "the rudder's file of another trial, times as here",
        REFUSED,
        backwards,
        (),
        "rudder",
    ),
    Kind("twice", TWICE, "the trial and a copy", REFUSED, lambda log, *_: copy(log, 0.0) and None),
    Kind(
        "twice-shifted",
        TWICE,
        "the trial and a copy with its clock {} s later",
        REFUSED,
        twice,
        (0.05, SHIFT_S),
    ),
    Kind("twice-parquet", TWICE, "the trial as CSV and as Parquet", REFUSED, twice_parquet),
    Kind(
        "twice-in-part",
        TWICE,
        "the trial and a copy of its first share of {}",
        REFUSED,
        twice_in_part,
        (0.5,),
    ),
    Kind(
        "twice-another-rate",
        TWICE,
        "the trial and a copy at another rate, on another clock",
        REFUSED,
        rate_changed,
    ),
)
