"""Damage: units and scales."""

from __future__ import annotations

import math

import numpy as np

from seatrial.damage.kind import REFUSED, RIGHT, SAID, Kind, family
from seatrial.damage.log import TIME, VELOCITIES, Log, column

KNOT = 1852.0 / 3600.0  # m/s
DEGREES = 180.0 / math.pi
FOOT = 0.3048  # m
SPEED, RPM, RUDDER = "scale of the speed", "scale of rpm", "scale of the rudder"
GYRO, HEADING, DEPTH, TRACK, CLOCK = (
    "scale of the gyro",
    "unit of the heading",
    "scale of the depth",
    "scale of the position",
    "unit of the time",
)
POSITION, ATTITUDE = ("position",), ("attitude",)


def dvl(log: Log, factor: float, _: np.random.Generator) -> None:
    """All velocities times a factor."""
    log.scale("dvl", VELOCITIES, factor)


def labelled(log: Log, sensor: str, unit: str) -> None:
    """Another unit in the names of all columns, the values as they are."""
    table = log.read(sensor)
    names = {c: f"{c.partition('_')[0]}_{unit}" for c in table.columns if c not in (TIME, "valid")}
    log.write(sensor, table.rename(columns=names))


def gyro_unit(log: Log, degrees_as_radians: bool) -> None:
    """Rates in one unit under the label of the other."""
    radians = column(log.read("gyro"), "r").endswith("radps")
    labelled(log, "gyro", "radps" if degrees_as_radians else "degps")
    if radians == degrees_as_radians:
        log.scale("gyro", "pqr", DEGREES if degrees_as_radians else 1.0 / DEGREES)


def share_of_largest(log: Log, sensor: str, quantity: str, largest: float) -> None:
    """A command as a share of its largest value."""
    log.scale(sensor, [quantity], largest / np.nanmax(np.abs(log.values(sensor, quantity))))


ROWS = family(
    "units and scales",
    Kind(
        "knots",
        SPEED,
        "speeds in knots in _mps columns",
        SAID,
        lambda log, _, rng: dvl(log, 1.0 / KNOT, rng),
        (),
        "dvl",
    ),
    Kind(
        "knots-no-position",
        SPEED,
        "speeds in knots in _mps columns, no position log",
        SAID,
        lambda log, _, rng: dvl(log, 1.0 / KNOT, rng),
        (),
        "dvl",
        POSITION,
    ),
    Kind(
        "mps-as-knots",
        SPEED,
        "speeds in m/s in _kn columns",
        SAID,
        lambda log, _, rng: labelled(log, "dvl", "kn"),
        (),
        "dvl",
    ),
    Kind(
        "mps-as-knots-no-position",
        SPEED,
        "speeds in m/s in _kn columns, no position log",
        SAID,
        lambda log, _, rng: labelled(log, "dvl", "kn"),
        (),
        "dvl",
        POSITION,
    ),
    Kind("dvl-scale", SPEED, "speeds times {}", SAID, dvl, (0.8, 0.9, 1.1), "dvl"),
    Kind(
        "dvl-scale-no-position",
        SPEED,
        "speeds times {}, no position log",
        SAID,
        dvl,
        (0.8, 1.1, 1.5),
        "dvl",
        POSITION,
    ),
    Kind(
        "cm-per-s",
        SPEED,
        "speeds in cm/s in _mps columns",
        REFUSED,
        lambda log, _, rng: dvl(log, 100.0, rng),
        (),
        "dvl",
    ),
    Kind(
        "mm-per-s",
        SPEED,
        "speeds in mm/s in _mps columns",
        REFUSED,
        lambda log, _, rng: dvl(log, 1000.0, rng),
        (),
        "dvl",
    ),
    Kind(
        "cm-label",
        SPEED,
        "speeds in m/s in _cmps columns",
        REFUSED,
        lambda log, _, rng: labelled(log, "dvl", "cmps"),
        (),
        "dvl",
    ),
    Kind(
        "v-scale",
        "scale of v",
        "v alone times {}",
        SAID,
        lambda log, k, _: log.scale("dvl", "v", k),
        (0.5, 2.0),
        "dvl",
    ),
    Kind(
        "gyro-scale",
        GYRO,
        "yaw rate times {}, heading logged",
        SAID,
        lambda log, k, _: log.scale("gyro", "r", k),
        (1.1, 1.3),
        "gyro",
    ),
    Kind(
        "gyro-scale-no-heading",
        GYRO,
        "yaw rate times {}, no heading",
        SAID,
        lambda log, k, _: log.scale("gyro", "r", k),
        (1.3,),
        "gyro",
        ATTITUDE,
    ),
    Kind(
        "gyro-scale-alone",
        GYRO,
        "yaw rate times {}, neither heading nor position",
        SAID,
        lambda log, k, _: log.scale("gyro", "r", k),
        (1.3,),
        "gyro",
        ATTITUDE + POSITION,
    ),
    Kind(
        "gyro-degrees-as-radians",
        GYRO,
        "deg/s in a _radps column",
        REFUSED,
        lambda log, *_: gyro_unit(log, True),
        (),
        "gyro",
    ),
    Kind(
        "gyro-radians-as-degrees",
        GYRO,
        "rad/s in a _degps column",
        REFUSED,
        lambda log, *_: gyro_unit(log, False),
        (),
        "gyro",
    ),
    Kind(
        "gyro-radians-as-degrees-no-heading",
        GYRO,
        "rad/s in a _degps column, no heading",
        SAID,
        lambda log, *_: gyro_unit(log, False),
        (),
        "gyro",
        ATTITUDE,
    ),
    Kind(
        "gear",
        RPM,
        "rpm of the motor: times {}",
        SAID,
        lambda log, k, _: log.scale("rpm", ["rpm"], k),
        (0.5, 2.0, 4.0),
        "rpm",
    ),
    Kind(
        "gear-no-position",
        RPM,
        "rpm of the motor: times {}, no position log",
        SAID,
        lambda log, k, _: log.scale("rpm", ["rpm"], k),
        (2.0,),
        "rpm",
        POSITION,
    ),
    Kind(
        "rps-as-rpm",
        RPM,
        "rev/s in the rpm column",
        SAID,
        lambda log, *_: log.scale("rpm", ["rpm"], 1.0 / 60.0),
        (),
        "rpm",
    ),
    Kind(
        "rpm-as-rps",
        RPM,
        "rpm in an rpm_rps column",
        REFUSED,
        lambda log, *_: log.rename("rpm", {"rpm": "rpm_rps"}),
        (),
        "rpm",
    ),
    Kind(
        "throttle",
        RPM,
        "throttle in percent in the rpm column",
        SAID,
        lambda log, *_: share_of_largest(log, "rpm", "rpm", 100.0),
        (),
        "rpm",
    ),
    Kind(
        "rudder-scale",
        RUDDER,
        "rudder angle times {}",
        SAID,
        lambda log, k, _: log.scale("rudder", ["rudder"], k),
        (0.5, 2.0),
        "rudder",
    ),
    Kind(
        "rudder-radians-as-degrees",
        RUDDER,
        "radians in a _deg column",
        SAID,
        lambda log, *_: log.scale("rudder", ["rudder"], 1.0 / DEGREES),
        (),
        "rudder",
    ),
    Kind(
        "rudder-degrees-as-radians",
        RUDDER,
        "degrees in a _rad column",
        REFUSED,
        lambda log, *_: labelled(log, "rudder", "rad"),
        (),
        "rudder",
    ),
    Kind(
        "rudder-normalised",
        RUDDER,
        "rudder from -1 to 1 in a _deg column",
        SAID,
        lambda log, *_: share_of_largest(log, "rudder", "rudder", 1.0),
        (),
        "rudder",
    ),
    Kind(
        "rudder-pulse",
        RUDDER,
        "servo pulses around 1500 us in the rudder column",
        REFUSED,
        lambda log, *_: log.change("rudder", ["rudder"], lambda _, x: 1500.0 + 10.0 * x),
        (),
        "rudder",
    ),
    Kind(
        "heading-degrees-as-radians",
        HEADING,
        "heading in degrees in a _rad column",
        REFUSED,
        lambda log, *_: labelled(log, "attitude", "rad"),
        (),
        "attitude",
    ),
    Kind(
        "heading-radians-as-degrees",
        HEADING,
        "heading in radians in a _deg column",
        REFUSED,
        lambda log, *_: log.scale("attitude", ["heading"], 1.0 / DEGREES),
        (),
        "attitude",
    ),
    Kind(
        "heading-half-circle",
        HEADING,
        "heading from -180 to 180",
        RIGHT,
        lambda log, *_: log.change(
            "attitude", ["heading"], lambda _, x: (x + 180.0) % 360.0 - 180.0
        ),
        (),
        "attitude",
    ),
    Kind(
        "heading-true-radians",
        HEADING,
        "attitude in radians, labelled so",
        RIGHT,
        lambda log, *_: (
            log.scale("attitude", ["roll", "pitch", "heading"], 1.0 / DEGREES),
            labelled(log, "attitude", "rad"),
        )[-1],
        (),
        "attitude",
    ),
    Kind(
        "pitch-radians",
        "unit of the pitch",
        "pitch in radians in a _deg column",
        SAID,
        lambda log, *_: log.scale("attitude", ["pitch"], 1.0 / DEGREES),
        (),
        "attitude",
    ),
    Kind(
        "depth-feet",
        DEPTH,
        "depth in feet in a _m column",
        SAID,
        lambda log, *_: log.scale("depth", ["depth"], 1.0 / FOOT),
        (),
        "depth",
    ),
    Kind(
        "depth-pressure",
        DEPTH,
        "pressure in kPa in the depth column",
        SAID,
        lambda log, *_: log.scale("depth", ["depth"], 10.0),
        (),
        "depth",
    ),
    Kind(
        "position-km",
        TRACK,
        "position in km in _m columns",
        SAID,
        lambda log, *_: log.scale("position", ["north", "east"], 1e-3),
        (),
        "position",
    ),
    Kind(
        "position-feet",
        TRACK,
        "position in feet in _m columns",
        SAID,
        lambda log, *_: log.scale("position", ["north", "east"], 1.0 / FOOT),
        (),
        "position",
    ),
    Kind(
        "position-degrees",
        TRACK,
        "latitude and longitude in degrees in _m columns",
        SAID,
        lambda log, *_: log.change("position", ["north", "east"], lambda _, x: 43.0 + x / 111e3),
        (),
        "position",
    ),
    Kind(
        "milliseconds",
        CLOCK,
        "times of all sensors in ms in time_s",
        SAID,
        lambda log, *_: [log.retime(s, lambda t: t * 1e3) for s in log.sensors()] and None,
    ),
    Kind(
        "milliseconds-one",
        CLOCK,
        "times of the DVL in ms in time_s",
        REFUSED,
        lambda log, *_: log.retime("dvl", lambda t: t * 1e3),
        (),
        "dvl",
    ),
    Kind(
        "minutes",
        CLOCK,
        "times of all sensors in minutes in time_s",
        SAID,
        lambda log, *_: [log.retime(s, lambda t: t / 60.0) for s in log.sensors()] and None,
    ),
)
