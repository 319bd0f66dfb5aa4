"""Damage: readings that are missing."""

from __future__ import annotations

import numpy as np

from seatrial.damage.kind import REFUSED, RIGHT, SAID, Kind, family
from seatrial.damage.log import NEEDED, VELOCITIES, Log

LOST = "readings lost"
FILL = "fill values"


def some(log: Log, sensor: str, share: float, rng: np.random.Generator) -> np.ndarray:
    """Rows drawn at random."""
    return rng.random(log.time(sensor).size) < share


def within(log: Log, sensor: str, seconds: float, at: float = 0.5) -> np.ndarray:
    """Rows of so many seconds from a share of the trial on."""
    begin, end = log.span()
    first = begin + at * (end - begin)
    time = log.time(sensor)
    return (time >= first) & (time < first + seconds)


def rows_gone(sensor: str):
    """Apply: a share of the rows is not there; what was never logged, nobody can count."""

    def apply(log: Log, share: float, rng: np.random.Generator) -> None:
        log.drop(sensor, some(log, sensor, share, rng))
        log.lost = 0

    return apply


def gap(*sensors: str):
    """Apply: nothing for so many seconds."""

    def apply(log: Log, seconds: float, _: np.random.Generator) -> None:
        for sensor in sensors:
            log.drop(sensor, within(log, sensor, seconds))

    return apply


def fill(text: str, quantities: str = "uvw"):
    """Apply: a fill value in a share of the rows of the DVL."""
    return lambda log, share, rng: log.put("dvl", quantities, some(log, "dvl", share, rng), text)


def zeros_in_turns(log: Log, share: float, rng: np.random.Generator) -> None:
    """The DVL loses the bottom in turns and writes zeros."""
    log.put("dvl", VELOCITIES, log.turning("dvl") & some(log, "dvl", share, rng), "0.0000")


def invalid(log: Log, rows: np.ndarray) -> None:
    """Rows that the DVL marks."""
    table = log.read("dvl")
    table["valid"] = np.where(rows, "0", table["valid"])
    log.lost += int(rows.sum())
    log.write("dvl", table)


def unmarked(log: Log, share: float, rng: np.random.Generator) -> None:
    """Rows that are marked invalid, with wild values in them."""
    rows = some(log, "dvl", share, rng)
    wild = rng.normal(0.0, 2.0, rows.size)
    log.spoil("dvl", "uv", rows, wild)
    log.lost -= int(rows.sum())
    invalid(log, rows)


def inverted(log: Log, *_: object) -> None:
    """1 where the reading is not valid."""
    table = log.read("dvl")
    table["valid"] = np.where(table["valid"] == "1", "0", "1")
    log.write("dvl", table)


def late(sensor: str):
    """Apply: a sensor starts late, by a share of the trial."""
    return lambda log, share, _: log.drop(sensor, log.part(sensor, -1.0, share))


def early(*sensors: str):
    """Apply: sensors stop at a share of the trial."""

    def apply(log: Log, share: float, _: np.random.Generator) -> None:
        gone = {sensor: log.part(sensor, share, 2.0) for sensor in sensors or log.sensors()}
        for sensor, rows in gone.items():
            log.drop(sensor, rows)

    return apply


def rpm_zeros(log: Log, share: float, rng: np.random.Generator) -> None:
    """Single rows of rpm are zero."""
    log.put("rpm", ["rpm"], some(log, "rpm", share, rng), "0")


def two_rates(log: Log, *_: object) -> None:
    """The gyro is logged at a fifth of its rate in the second half."""
    second = log.part("gyro", 0.5, 2.0)
    log.drop("gyro", second & (np.arange(second.size) % 5 != 0))
    log.lost = 0


ROWS = family(
    "drop-outs",
    Kind(
        "rows-gone-dvl",
        LOST,
        "a share of {} of the DVL's rows is not there",
        RIGHT,
        rows_gone("dvl"),
        (0.1, 0.3, 0.7),
        "dvl",
    ),
    Kind(
        "rows-gone-gyro",
        LOST,
        "a share of {} of the gyro's rows is not there",
        RIGHT,
        rows_gone("gyro"),
        (0.3,),
        "gyro",
    ),
    Kind(
        "rows-gone-rudder",
        LOST,
        "a share of {} of the rudder's rows is not there",
        RIGHT,
        rows_gone("rudder"),
        (0.3,),
        "rudder",
    ),
    Kind("empty-cells", LOST, "a share of {} of u, v, w is empty", RIGHT, fill(""), (0.2,), "dvl"),
    Kind("nan-texts", LOST, "NaN in a share of {} of u, v, w", RIGHT, fill("NaN"), (0.2,), "dvl"),
    Kind("dash-texts", LOST, "-- in a share of {} of u, v, w", RIGHT, fill("--"), (0.05,), "dvl"),
    Kind(
        "not-available", LOST, "N/A in a share of {} of u, v, w", RIGHT, fill("N/A"), (0.05,), "dvl"
    ),
    Kind(
        "null-texts", LOST, "null in a share of {} of u, v, w", RIGHT, fill("null"), (0.05,), "dvl"
    ),
    Kind("inf-texts", LOST, "inf in a share of {} of u, v, w", RIGHT, fill("inf"), (0.05,), "dvl"),
    Kind("gap-dvl", LOST, "no DVL for {} s", RIGHT, gap("dvl"), (20.0, 60.0), "dvl"),
    Kind("gap-gyro", LOST, "no gyro for {} s", RIGHT, gap("gyro"), (3.0, 20.0), "gyro"),
    Kind("gap-rudder", LOST, "no rudder for {} s", RIGHT, gap("rudder"), (20.0,), "rudder"),
    Kind("gap-rpm", LOST, "no rpm for {} s", RIGHT, gap("rpm"), (20.0,), "rpm"),
    Kind(
        "gap-all",
        LOST,
        "nothing for {} s",
        RIGHT,
        gap(*NEEDED, "attitude", "depth", "elevator", "position"),
        (30.0,),
    ),
    Kind(
        "lost-in-turns",
        LOST,
        "no DVL rows in turns",
        SAID,
        lambda log, *_: log.drop("dvl", log.turning("dvl")),
        (),
        "dvl",
    ),
    Kind(
        "zeros",
        FILL,
        "zeros in a share of {} of the DVL's rows, marked valid",
        RIGHT,
        fill("0.0000"),
        (0.03, 0.2),
        "dvl",
    ),
    Kind(
        "zeros-in-turns",
        FILL,
        "zeros in a share of {} of the DVL's rows in turns",
        RIGHT,
        zeros_in_turns,
        (0.5, 1.0),
        "dvl",
    ),
    Kind(
        "zeros-v",
        FILL,
        "zeros in a share of {} of v alone",
        RIGHT,
        fill("0.0000", "v"),
        (0.1,),
        "dvl",
    ),
    Kind(
        "sentinel-32",
        FILL,
        "-32.768 in a share of {} of u, v, w",
        RIGHT,
        fill("-32.768"),
        (0.02, 0.2),
        "dvl",
    ),
    Kind(
        "sentinel-9",
        FILL,
        "-9.999 in a share of {} of u, v, w",
        RIGHT,
        fill("-9.999"),
        (0.02, 0.2),
        "dvl",
    ),
    Kind(
        "sentinel-999",
        FILL,
        "-999 in a share of {} of u, v, w",
        RIGHT,
        fill("-999"),
        (0.02, 0.2),
        "dvl",
    ),
    Kind(
        "sentinel-1e30",
        FILL,
        "1e30 in a share of {} of u, v, w",
        RIGHT,
        fill("1e30"),
        (0.02,),
        "dvl",
    ),
    Kind(
        "sentinel-gyro",
        FILL,
        "-999 in a share of {} of the gyro's rows",
        RIGHT,
        lambda log, k, rng: log.put("gyro", "pqr", some(log, "gyro", k, rng), "-999"),
        (0.02,),
        "gyro",
    ),
    Kind(
        "sentinel-rudder",
        FILL,
        "-999 in a share of {} of the rudder's rows",
        RIGHT,
        lambda log, k, rng: log.put("rudder", ["rudder"], some(log, "rudder", k, rng), "-999"),
        (0.02,),
        "rudder",
    ),
    Kind(
        "sentinel-rpm",
        FILL,
        "65535 in a share of {} of the rows of rpm",
        RIGHT,
        lambda log, k, rng: log.put("rpm", ["rpm"], some(log, "rpm", k, rng), "65535"),
        (0.02,),
        "rpm",
    ),
    Kind(
        "rpm-zeros",
        FILL,
        "zero in a share of {} of the rows of rpm",
        RIGHT,
        rpm_zeros,
        (0.03,),
        "rpm",
    ),
    Kind(
        "heading-zeros",
        FILL,
        "zero in a share of {} of the headings",
        RIGHT,
        lambda log, k, rng: log.put("attitude", ["heading"], some(log, "attitude", k, rng), "0.00"),
        (0.03,),
        "attitude",
    ),
    Kind(
        "invalid-wild",
        LOST,
        "a share of {} of the DVL's rows wild and marked invalid",
        RIGHT,
        unmarked,
        (0.2,),
        "dvl",
    ),
    Kind(
        "all-invalid",
        LOST,
        "every row of the DVL marked invalid",
        REFUSED,
        lambda log, *_: invalid(log, np.ones(log.time("dvl").size, dtype=bool)),
        (),
        "dvl",
    ),
    Kind(
        "valid-inverted", LOST, "valid is 1 where the reading is none", REFUSED, inverted, (), "dvl"
    ),
    Kind(
        "late-dvl",
        LOST,
        "the DVL starts after a share of {} of the trial",
        RIGHT,
        late("dvl"),
        (0.2,),
        "dvl",
    ),
    Kind(
        "late-gyro",
        LOST,
        "the gyro starts after a share of {} of the trial",
        RIGHT,
        late("gyro"),
        (0.2,),
        "gyro",
    ),
    Kind(
        "early-rudder",
        LOST,
        "the rudder stops at a share of {} of the trial",
        RIGHT,
        early("rudder"),
        (0.8,),
        "rudder",
    ),
    Kind("early-all", LOST, "the log stops at a share of {} of the trial", RIGHT, early(), (0.8,)),
    Kind(
        "early-most", LOST, "the log stops at a share of {} of the trial", REFUSED, early(), (0.05,)
    ),
    Kind(
        "two-rates",
        LOST,
        "the gyro at a fifth of its rate in the second half",
        RIGHT,
        two_rates,
        (),
        "gyro",
    ),
    Kind(
        "no-attitude",
        LOST,
        "no attitude file",
        RIGHT,
        lambda log, *_: log.remove("attitude"),
        (),
        "attitude",
    ),
    Kind(
        "no-elevator",
        LOST,
        "no elevator file",
        RIGHT,
        lambda log, *_: log.remove("elevator"),
        (),
        "elevator",
    ),
)
