"""Damage: time stamps."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pandas as pd

from seatrial.damage.kind import REFUSED, RIGHT, SAID, Kind, family
from seatrial.damage.log import TIME, Log, numbers

PPM = 1e-6
EPOCH = 1_718_000_000.0  # 10 June 2024, 06:13:20 UTC
DAY, WEEK = 86_400.0, 604_800.0
START = datetime.fromtimestamp(EPOCH, UTC)
RAW = "time stamps"


def clock_of(sensor: str) -> str:
    """The fault of one sensor's clock."""
    return f"clock of {sensor}"


def shift(sensor: str):
    """Apply: stamps of one sensor later by the size [s]."""
    return lambda log, s, _: log.retime(sensor, lambda t: t + s)


def drift(sensor: str):
    """Apply: the clock of one sensor gains, by the size [ppm]; right at the start of the trial."""

    def apply(log: Log, ppm: float, _: np.random.Generator) -> None:
        begin, _ = log.span()
        log.retime(sensor, lambda t: t + ppm * PPM * (t - begin))

    return apply


def shifted(sensor: str, *sizes: float) -> Kind:
    """Row: the clock of a sensor is off."""
    fault = clock_of(sensor)
    words = f"stamps of the {sensor} later by {{}} s"
    row = Kind(f"shift-{sensor}", fault, words, SAID, shift(sensor), sizes, sensor)
    return replace(row, figure=True)


def drifting(sensor: str, *sizes: float) -> Kind:
    """Row: the clock of a sensor drifts."""
    fault = clock_of(sensor)
    words = f"the clock of the {sensor} gains {{}} ppm"
    return Kind(f"drift-{sensor}", fault, words, SAID, drift(sensor), sizes, sensor)


def of_all(function):
    """Apply: stamps of every sensor by the same function of the time."""

    def apply(log: Log, size: float, _: np.random.Generator) -> None:
        for sensor in log.sensors():
            log.retime(sensor, lambda t: function(t, log, size))

    return apply


def of_one(sensor: str, function):
    """Apply: stamps of one sensor by a function of the time."""
    return lambda log, size, _: log.retime(sensor, lambda t: function(t, log, size))


def middle(log: Log) -> float:
    """The middle of the trial [s]."""
    return float(np.mean(log.span()))


def stepped(t: np.ndarray, middle_s: float, step_s: float) -> np.ndarray:
    """A clock that is set in the middle of the trial."""
    return np.where(t > middle_s, t + step_s, t)


def step_all(log: Log, size: float, _: np.random.Generator) -> None:
    """Every clock is set at mid-trial."""
    at = middle(log)
    for sensor in log.sensors():
        log.retime(sensor, lambda t: stepped(t, at, size))


def rolled(period: float):
    """Apply: time within a period that ends at mid-trial."""

    def apply(log: Log, *_: object) -> None:
        at = middle(log)
        for sensor in log.sensors():
            log.retime(sensor, lambda t: (t - at) % period)

    return apply


def restarted(log: Log, *_: object) -> None:
    """The recorder starts again at mid-trial, with its clock at zero."""
    at = middle(log)
    for sensor in log.sensors():
        log.retime(sensor, lambda t: np.where(t > at, t - at, t))


def batches(log: Log, size: float, _: np.random.Generator) -> None:
    """Rows stamped when they arrive, so many at a time, at the time of the last."""
    n = int(size)

    def arrived(t: np.ndarray) -> np.ndarray:
        last = np.minimum((np.arange(t.size) // n + 1) * n - 1, t.size - 1)
        return t[last]

    log.retime("gyro", arrived)


def stamps(log: Log, name: str, text) -> None:
    """Another column of time in every file."""
    for sensor in log.sensors():
        table = log.read(sensor)
        table[TIME] = [text(t) if np.isfinite(t) else "" for t in numbers(table[TIME])]
        log.write(sensor, table.rename(columns={TIME: name}))


def iso(t: float, zone: str = "Z") -> str:
    """An ISO 8601 stamp."""
    return (START + timedelta(seconds=float(t))).strftime("%Y-%m-%dT%H:%M:%S.%f") + zone


def whole(log: Log, kind: str, per_second: float, since: float) -> None:
    """Parquet files with whole-number stamps."""
    for sensor in log.sensors():
        table = log.read(sensor)
        values = {c: numbers(table[c]) for c in table.columns if c != TIME}
        time = numbers(table[TIME]) + since
        known = np.isfinite(time)
        ticks = np.round(time[known] * per_second).astype(kind)
        frame = pd.DataFrame({"timestamp": ticks, **{c: x[known] for c, x in values.items()}})
        frame.to_parquet(log.folder / f"{sensor}.parquet")
        log.remove(sensor)


def jitter(log: Log, size: float, rng: np.random.Generator) -> None:
    """Stamps of arrival instead of sampling."""
    log.retime("dvl", lambda t: t + rng.exponential(size, t.size))


def backward(log: Log, size: float, rng: np.random.Generator) -> None:
    """A share of the stamps steps back by a second."""
    for sensor in ("dvl", "gyro", "rudder"):
        log.retime(sensor, lambda t: np.where(rng.random(t.size) < size, t - 1.0, t))


def repeated(log: Log, size: float, rng: np.random.Generator) -> None:
    """A share of the stamps is that of the row before."""

    def again(t: np.ndarray) -> np.ndarray:
        same = rng.random(t.size) < size
        same[0] = False
        return np.where(same, np.roll(t, 1), t)

    for sensor in ("dvl", "gyro"):
        log.retime(sensor, again)


def corrupt(log: Log, *_: object) -> None:
    """Two stamps beyond all bounds."""

    def wild(t: np.ndarray) -> np.ndarray:
        t = t.copy()
        t[t.size // 3], t[t.size // 2] = 4.2e12, -4.2e9
        return t

    log.retime("gyro", wild)


ROWS = family(
    "clocks",
    shifted("dvl", -1.0, 1.0, 5.0, 18.0, -18.0),
    shifted("gyro", 1.0, 5.0),
    shifted("rudder", -1.0, 1.0, 5.0, 18.0),
    shifted("rpm", 5.0, 18.0),
    shifted("attitude", -1.0, 1.0, 18.0),
    shifted("position", 5.0, 18.0),
    shifted("depth", 18.0),
    drifting("dvl", 500.0, 1000.0, 2000.0),
    drifting("gyro", 1000.0, 2000.0),
    drifting("rudder", 500.0, 1000.0, 2000.0),
    drifting("rpm", 1000.0, 2000.0),
    drifting("attitude", 500.0, 1000.0, 2000.0),
    drifting("position", 1000.0, 2000.0),
    Kind(
        "hour-off",
        clock_of("dvl"),
        "stamps of the DVL in local time, {} s later",
        REFUSED,
        shift("dvl"),
        (3600.0,),
        "dvl",
    ),
    Kind(
        "dvl-set",
        clock_of("dvl"),
        "the clock of the DVL is set by {} s at mid-trial",
        SAID,
        of_one("dvl", lambda t, log, s: stepped(t, middle(log), s)),
        (1.0, 3.0),
        "dvl",
    ),
    Kind(
        "all-set",
        RAW,
        "every clock is set by {} s at mid-trial",
        RIGHT,
        step_all,
        (1.0, -1.0, 60.0),
    ),
    Kind(
        "leap-second",
        clock_of("gyro"),
        "one second twice at mid-trial, in the gyro alone",
        SAID,
        of_one("gyro", lambda t, log, _: stepped(t, middle(log), -1.0)),
        (),
        "gyro",
    ),
    Kind("clock-restarts", RAW, "the clock starts at zero again at mid-trial", REFUSED, restarted),
    Kind("day-wraps", RAW, "time of day, midnight at mid-trial", REFUSED, rolled(DAY)),
    Kind(
        "week-rolls-over",
        RAW,
        "GPS time of week that rolls over at mid-trial",
        REFUSED,
        rolled(WEEK),
    ),
    Kind(
        "later-by-epoch",
        RAW,
        "seconds since 1970 in time_s",
        RIGHT,
        of_all(lambda t, *_: t + EPOCH),
    ),
    Kind("iso", RAW, "ISO 8601 stamps", RIGHT, lambda log, *_: stamps(log, "timestamp", iso)),
    Kind(
        "iso-without-zone",
        RAW,
        "ISO 8601 stamps without a zone",
        RIGHT,
        lambda log, *_: stamps(log, "timestamp", lambda t: iso(t, "")),
    ),
    Kind(
        "iso-two-zones",
        RAW,
        "DVL stamped two hours behind, with its zone",
        RIGHT,
        lambda log, *_: (
            stamps(log, "timestamp", iso),
            log.edit("dvl", lambda text: text.replace("Z", "-00:00")),
        )[-1],
    ),
    Kind(
        "epoch-milliseconds",
        RAW,
        "whole milliseconds since 1970",
        RIGHT,
        lambda log, *_: stamps(log, "timestamp", lambda t: f"{(t + EPOCH) * 1e3:.0f}"),
    ),
    Kind(
        "int64-nanoseconds",
        RAW,
        "whole nanoseconds since 1970 in Parquet",
        RIGHT,
        lambda log, *_: whole(log, "int64", 1e9, EPOCH),
    ),
    Kind(
        "uint64-nanoseconds",
        RAW,
        "unsigned nanoseconds since 1970 in Parquet",
        RIGHT,
        lambda log, *_: whole(log, "uint64", 1e9, EPOCH),
    ),
    Kind(
        "int64-since-start",
        RAW,
        "whole nanoseconds since the start in Parquet",
        RIGHT,
        lambda log, *_: whole(log, "int64", 1e9, 0.0),
    ),
    Kind(
        "uint64-microseconds",
        RAW,
        "unsigned microseconds since the start in Parquet",
        RIGHT,
        lambda log, *_: whole(log, "uint64", 1e6, 0.0),
    ),
    Kind(
        "single-precision",
        RAW,
        "seconds since 1970 in single precision",
        REFUSED,
        of_all(lambda t, *_: (t + EPOCH).astype(np.float32).astype(float)),
    ),
    Kind("coarse", RAW, "stamps in whole seconds", SAID, of_all(lambda t, *_: np.floor(t))),
    Kind(
        "coarse-dvl",
        RAW,
        "stamps of the DVL in whole seconds",
        SAID,
        of_one("dvl", lambda t, *_: np.floor(t)),
        (),
        "dvl",
    ),
    Kind("batches", RAW, "gyro stamped {} rows at a time", SAID, batches, (10.0, 50.0), "gyro"),
    Kind(
        "jitter", RAW, "DVL stamped on arrival, {} s late on average", SAID, jitter, (0.3,), "dvl"
    ),
    Kind(
        "backward", RAW, "a share of {} of the stamps steps back by 1 s", RIGHT, backward, (0.01,)
    ),
    Kind("repeated", RAW, "a share of {} of the stamps is repeated", RIGHT, repeated, (0.02, 0.2)),
    Kind(
        "corrupt-stamps",
        RAW,
        "two stamps of the gyro beyond all bounds",
        RIGHT,
        corrupt,
        (),
        "gyro",
    ),
    Kind(
        "constant-stamps",
        RAW,
        "one stamp in all rows of the DVL",
        REFUSED,
        of_one("dvl", lambda t, *_: np.full(t.size, t[0])),
        (),
        "dvl",
    ),
)
