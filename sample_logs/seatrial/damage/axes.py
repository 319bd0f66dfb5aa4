"""Damage: signs and axes."""

from __future__ import annotations

import numpy as np

from seatrial.damage.kind import REFUSED, RIGHT, SAID, Kind, family
from seatrial.damage.log import Log

FIN_SIGN, YAW_SIGN = "sign of the rudder", "sign of the yaw rate"
AXES, SWAY_SIGN, HEAVE = "axes of the DVL", "sign of v", "heave axis of the DVL"
HEADING, TRACK, RPM_SIGN = "sense of the heading", "axes of the position", "sign of rpm"
ATTITUDE, POSITION = ("attitude",), ("position",)
OTHER = {'"port"': '"starboard"', '"starboard"': '"port"', '"up"': '"down"', '"down"': '"up"'}


def turned(log: Log, degrees: float | np.ndarray) -> None:
    """Horizontal velocities in axes turned by an angle, positive to starboard."""
    table = log.read("dvl")
    angle = np.radians(degrees) * np.ones(len(table))
    u, v = log.values("dvl", "u"), log.values("dvl", "v")
    log.change("dvl", "u", lambda *_: u * np.cos(angle) + v * np.sin(angle))
    log.change("dvl", "v", lambda *_: v * np.cos(angle) - u * np.sin(angle))


def earth(log: Log, *_: object) -> None:
    """North and east in the columns of u and v."""
    turned(log, -np.degrees(log.heading(log.time("dvl"))))


def flipped(sensor: str, *quantities: str):
    """Apply: other signs."""
    return lambda log, *_: log.scale(sensor, quantities, -1.0)


def swapped(sensor: str, one: str, other: str):
    """Apply: readings exchanged."""
    return lambda log, *_: log.swap(sensor, one, other)


def forward_left_up(log: Log, *_: object) -> None:
    """All sensors in axes forward, left, up."""
    log.scale("dvl", "vw", -1.0)
    log.scale("gyro", "qr", -1.0)


ROWS = family(
    "signs and axes",
    Kind(
        "rudder-sign-vehicle",
        FIN_SIGN,
        "[signs] rudder_positive_turns the wrong way",
        REFUSED,
        lambda log, *_: log.set_key("signs", "rudder_positive_turns", OTHER.__getitem__),
        (),
        "rudder",
    ),
    Kind(
        "rudder-sign-no-heading",
        FIN_SIGN,
        "[signs] rudder_positive_turns the wrong way, no heading",
        REFUSED,
        lambda log, *_: log.set_key("signs", "rudder_positive_turns", OTHER.__getitem__),
        (),
        "rudder",
        ATTITUDE,
    ),
    Kind(
        "rudder-negated",
        FIN_SIGN,
        "rudder column with the other sign",
        REFUSED,
        flipped("rudder", "rudder"),
        (),
        "rudder",
    ),
    Kind(
        "elevator-sign",
        "sign of the elevator",
        "[signs] elevator the wrong way",
        RIGHT,
        lambda log, *_: log.set_key("signs", "elevator_positive_pitches", OTHER.__getitem__),
        (),
        "elevator",
    ),
    Kind(
        "yaw-rate-sign",
        YAW_SIGN,
        "r positive to port, heading logged",
        REFUSED,
        flipped("gyro", "r"),
        (),
        "gyro",
    ),
    Kind(
        "yaw-rate-sign-no-heading",
        YAW_SIGN,
        "r positive to port, no heading",
        REFUSED,
        flipped("gyro", "r"),
        (),
        "gyro",
        ATTITUDE,
    ),
    Kind("u-sign", AXES, "u positive astern", SAID, flipped("dvl", "u"), (), "dvl"),
    Kind("v-sign", SWAY_SIGN, "v positive to port", SAID, flipped("dvl", "v"), (), "dvl"),
    Kind("u-v-swapped", AXES, "u and v exchanged", SAID, swapped("dvl", "u", "v"), (), "dvl"),
    Kind("v-w-swapped", AXES, "v and w exchanged", SAID, swapped("dvl", "v", "w"), (), "dvl"),
    Kind("w-sign", HEAVE, "w positive upward", RIGHT, flipped("dvl", "w"), (), "dvl"),
    Kind(
        "dvl-turned",
        AXES,
        "DVL turned by {} degrees",
        SAID,
        lambda log, k, _: turned(log, k),
        (-90.0, 10.0, 45.0, 90.0, 180.0),
        "dvl",
    ),
    Kind(
        "dvl-turned-no-position",
        AXES,
        "DVL turned by {} degrees, no position log",
        SAID,
        lambda log, k, _: turned(log, k),
        (90.0,),
        "dvl",
        POSITION,
    ),
    Kind("earth-axes", AXES, "north and east velocities as u and v", SAID, earth, (), "dvl"),
    Kind(
        "earth-axes-no-position",
        AXES,
        "north and east velocities as u and v, no position log",
        SAID,
        earth,
        (),
        "dvl",
        POSITION,
    ),
    Kind(
        "earth-axes-alone",
        AXES,
        "north and east velocities as u and v, no heading, no position",
        SAID,
        lambda log, *_: (earth(log), log.remove("attitude", "position"))[-1],
        (),
        "dvl",
    ),
    Kind(
        "forward-left-up",
        SWAY_SIGN,
        "DVL and gyro in axes forward, left, up",
        REFUSED,
        forward_left_up,
        (),
        "gyro",
    ),
    Kind(
        "forward-left-up-no-heading",
        SWAY_SIGN,
        "the same, no heading",
        REFUSED,
        forward_left_up,
        (),
        "gyro",
        ATTITUDE,
    ),
    Kind(
        "p-r-swapped",
        "axes of the gyro",
        "p and r exchanged",
        SAID,
        swapped("gyro", "p", "r"),
        (),
        "gyro",
    ),
    Kind(
        "q-r-swapped",
        "axes of the gyro",
        "q and r exchanged",
        SAID,
        swapped("gyro", "q", "r"),
        (),
        "gyro",
    ),
    Kind(
        "q-r-swapped-no-heading",
        "axes of the gyro",
        "q and r exchanged, no heading",
        SAID,
        swapped("gyro", "q", "r"),
        (),
        "gyro",
        ATTITUDE,
    ),
    Kind("rpm-negative", RPM_SIGN, "rpm negative ahead", SAID, flipped("rpm", "rpm"), (), "rpm"),
    Kind(
        "heading-counterclockwise",
        HEADING,
        "heading positive to port",
        REFUSED,
        lambda log, *_: log.change("attitude", ["heading"], lambda _, x: (360.0 - x) % 360.0),
        (),
        "attitude",
    ),
    Kind(
        "heading-from-east",
        HEADING,
        "heading from east, counterclockwise",
        REFUSED,
        lambda log, *_: log.change("attitude", ["heading"], lambda _, x: (90.0 - x) % 360.0),
        (),
        "attitude",
    ),
    Kind(
        "heading-magnetic",
        "offset of the heading",
        "heading off by {} degrees (magnetic)",
        RIGHT,
        lambda log, k, _: log.change("attitude", ["heading"], lambda _, x: (x + k) % 360.0),
        (15.0, 180.0),
        "attitude",
    ),
    Kind(
        "pitch-sign",
        "sign of the pitch",
        "pitch positive bow down",
        RIGHT,
        flipped("attitude", "pitch"),
        (),
        "attitude",
    ),
    Kind(
        "roll-sign",
        "sign of the roll",
        "roll positive to port",
        RIGHT,
        flipped("attitude", "roll"),
        (),
        "attitude",
    ),
    Kind(
        "depth-sign",
        "sign of the depth",
        "depth negative below the surface",
        SAID,
        flipped("depth", "depth"),
        (),
        "depth",
    ),
    Kind(
        "north-east-swapped",
        TRACK,
        "north and east exchanged",
        SAID,
        swapped("position", "north", "east"),
        (),
        "position",
    ),
    Kind(
        "west",
        TRACK,
        "position positive to the west",
        SAID,
        flipped("position", "east"),
        (),
        "position",
    ),
)
