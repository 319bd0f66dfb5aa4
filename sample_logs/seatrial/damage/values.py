"""Damage: readings that are wrong."""

from __future__ import annotations

import numpy as np

from seatrial.damage.dropouts import some, within
from seatrial.damage.kind import REFUSED, RIGHT, SAID, Kind, family
from seatrial.damage.log import VELOCITIES, Log

SPIKES, STUCK, SATURATED = "spikes", "stuck readings", "saturated readings"
CONSTANT, COARSE, BIAS, COPIES = "constant channel", "coarse digits", "offset", "copied rows"
SPIKE_SPREADS = 6.0  # of a channel
BURST = 4  # rows


def spikes(sensor: str, quantities: str):
    """Apply: single readings far off, in a share of the rows."""

    def apply(log: Log, share: float, rng: np.random.Generator) -> None:
        rows = some(log, sensor, share, rng)
        thrown(log, sensor, quantities, rows, rng.choice([-1.0, 1.0], rows.size))

    return apply


def thrown(log: Log, sensor: str, quantities: str, rows: np.ndarray, side: np.ndarray) -> None:
    """Readings of some rows off by several spreads of their channel."""
    lost = log.lost
    for quantity in quantities:
        spread = float(np.nanstd(log.values(sensor, quantity)))
        log.spoil(sensor, [quantity], rows, lambda x, s=spread: x + SPIKE_SPREADS * s * side)
    log.lost = lost + int(rows.sum())


def bursts(sensor: str, quantities: str):
    """Apply: four readings in a row far off to one side; the share is that of all rows."""

    def apply(log: Log, share: float, rng: np.random.Generator) -> None:
        size = log.time(sensor).size
        rows, side = np.zeros(size, dtype=bool), np.ones(size)
        for first in np.flatnonzero(rng.random(size) < share / BURST):
            rows[first : first + BURST] = True
            side[first : first + BURST] = rng.choice([-1.0, 1.0])
        thrown(log, sensor, quantities, rows, side)

    return apply


def held_first(rows: np.ndarray):
    """Values: those of the last row before, as long as the rows last."""

    def values(x: np.ndarray) -> np.ndarray:
        index = np.where(rows, 0, np.arange(x.size))
        return x[np.maximum.accumulate(index)]

    return values


def frozen(sensor: str, *quantities: str):
    """Apply: readings stand still for so many seconds while the vehicle maneuvers."""

    def apply(log: Log, seconds: float, _: np.random.Generator) -> None:
        rows, lost = log.busy(sensor, seconds), log.lost
        log.spoil(sensor, quantities, rows, held_first(rows))
        log.lost = lost + int(rows.sum())

    return apply


def constant(sensor: str, *quantities: str):
    """Apply: the median in all rows."""
    return lambda log, *_: log.change(
        sensor, quantities, lambda _, x: np.full(x.size, np.nanmedian(x))
    )


def saturated(sensor: str, *quantities: str):
    """Apply: nothing beyond a share of the 99 % quantile."""

    def apply(log: Log, share: float, _: np.random.Generator) -> None:
        for quantity in quantities:
            x = log.values(sensor, quantity)
            limit = share * float(np.nanquantile(np.abs(x), 0.99))
            log.lost += int(np.sum(np.abs(x) > limit))
            log.change(sensor, [quantity], lambda _, x, a=limit: np.clip(x, -a, a))

    return apply


def clipped(log: Log, degrees: float, _: np.random.Generator) -> None:
    """The log of the rudder does not go beyond an angle."""
    log.change("rudder", ["rudder"], lambda _, x: np.clip(x, -degrees, degrees))


def wrapped(log: Log, share: float, _: np.random.Generator) -> None:
    """A gyro whose whole numbers overflow."""
    limit = share * float(np.nanmax(np.abs(log.values("gyro", "r"))))
    log.lost += int(np.sum(np.abs(log.values("gyro", "r")) > limit))
    log.change("gyro", "r", lambda _, x: (x + limit) % (2.0 * limit) - limit)


def coarse(sensor: str, *quantities: str):
    """Apply: digits of the size."""
    return lambda log, step, _: log.change(
        sensor, quantities, lambda _, x: np.round(x / step) * step
    )


def coarse_share(log: Log, share: float, _: np.random.Generator) -> None:
    """Steps of the yaw rate as a share of its largest value."""
    step = share * float(np.nanmax(np.abs(log.values("gyro", "r"))))
    log.change("gyro", "r", lambda _, x: np.round(x / step) * step)


def noise(log: Log, size: float, rng: np.random.Generator) -> None:
    """More noise in u and v: a share of the spread of u."""
    spread = size * float(np.nanstd(log.values("dvl", "u")))
    log.change("dvl", "uv", lambda _, x: x + rng.normal(0.0, spread, x.size))


def offset_share(sensor: str, quantity: str):
    """Apply: an offset, as a share of the largest value."""

    def apply(log: Log, share: float, _: np.random.Generator) -> None:
        largest = float(np.nanquantile(np.abs(log.values(sensor, quantity)), 0.99))
        log.change(sensor, [quantity], lambda _, x: x + share * largest)

    return apply


def copies(log: Log, size: float, _: np.random.Generator) -> None:
    """The DVL on a fast clock: every sample in so many rows."""
    table, n = log.read("dvl"), int(size)
    time = log.time("dvl")
    period = float(np.median(np.diff(time)))
    table = table.loc[np.repeat(table.index, n)].reset_index(drop=True)
    later = np.tile(np.arange(n) * period / n, time.size)
    table["time_s"] = [f"{t:.3f}" for t in np.repeat(time, n) + later]
    log.write("dvl", table)


def flipped_bits(log: Log, share: float, rng: np.random.Generator) -> None:
    """A power of two times some readings."""
    rows = some(log, "gyro", share, rng)
    log.spoil("gyro", "r", rows, lambda x: x * 2.0 ** rng.integers(2, 12, x.size))


def lagging(log: Log, size: float, _: np.random.Generator) -> None:
    """A DVL that averages over so many samples."""
    n = int(size)
    kernel = np.ones(n) / n

    def averaged(_: np.ndarray, x: np.ndarray) -> np.ndarray:
        known = np.isfinite(x)
        full = np.interp(np.arange(x.size), np.flatnonzero(known), x[known])
        return np.convolve(np.pad(full, (n - 1, 0), mode="edge"), kernel, mode="valid")

    log.change("dvl", "uv", averaged)


def rpm_stuck(log: Log, seconds: float, _: np.random.Generator) -> None:
    """rpm stands still where it changes most."""
    time, rpm = log.time("rpm"), log.values("rpm", "rpm")
    moved = np.abs(np.diff(rpm, prepend=rpm[0]))
    starts = np.arange(np.nanmin(time) + seconds, np.nanmax(time) - 2.0 * seconds, seconds / 4.0)
    inside = [np.nansum(moved[(time >= s) & (time < s + seconds)]) for s in starts]
    begin = starts[int(np.argmax(inside))]
    rows = (time >= begin) & (time < begin + seconds)
    log.spoil("rpm", ["rpm"], rows, held_first(rows))


ROWS = family(
    "values",
    Kind(
        "spikes-dvl",
        SPIKES,
        "spikes in a share of {} of u and v",
        RIGHT,
        spikes("dvl", "uv"),
        (0.01, 0.1),
        "dvl",
    ),
    Kind(
        "spikes-gyro",
        SPIKES,
        "spikes in a share of {} of r",
        RIGHT,
        spikes("gyro", "r"),
        (0.01, 0.1),
        "gyro",
    ),
    Kind(
        "spikes-rudder",
        SPIKES,
        "spikes in a share of {} of the rudder angles",
        RIGHT,
        spikes("rudder", ["rudder"]),
        (0.01,),
        "rudder",
    ),
    Kind(
        "spikes-heading",
        SPIKES,
        "spikes in a share of {} of the headings",
        RIGHT,
        spikes("attitude", ["heading"]),
        (0.03,),
        "attitude",
    ),
    Kind(
        "spikes-position",
        SPIKES,
        "spikes in a share of {} of the positions",
        RIGHT,
        spikes("position", ["north", "east"]),
        (0.03,),
        "position",
    ),
    Kind(
        "bursts-dvl",
        SPIKES,
        "bursts of four in a share of {} of u and v",
        RIGHT,
        bursts("dvl", "uv"),
        (0.02, 0.1),
        "dvl",
    ),
    Kind(
        "bursts-gyro",
        SPIKES,
        "bursts of four in a share of {} of r",
        RIGHT,
        bursts("gyro", "r"),
        (0.02,),
        "gyro",
    ),
    Kind(
        "bits", SPIKES, "bits flipped in a share of {} of r", RIGHT, flipped_bits, (0.002,), "gyro"
    ),
    Kind(
        "gyro-saturated",
        SATURATED,
        "gyro saturated at a share of {} of its range",
        RIGHT,
        saturated("gyro", "r"),
        (0.6, 0.85),
        "gyro",
    ),
    Kind(
        "dvl-saturated",
        SATURATED,
        "u saturated at a share of {} of its range",
        RIGHT,
        saturated("dvl", "u"),
        (0.85,),
        "dvl",
    ),
    Kind(
        "gyro-overflows",
        SATURATED,
        "r wraps at a share of {} of its range",
        SAID,
        wrapped,
        (0.7,),
        "gyro",
    ),
    Kind(
        "rudder-clipped",
        "clipped rudder",
        "rudder log clipped at {} degrees",
        SAID,
        clipped,
        (8.0,),
        "rudder",
    ),
    Kind(
        "gyro-frozen",
        STUCK,
        "r stands still for {} s",
        RIGHT,
        frozen("gyro", "r"),
        (5.0, 20.0),
        "gyro",
    ),
    Kind(
        "gyro-all-frozen",
        STUCK,
        "p, q, r stand still for {} s",
        RIGHT,
        frozen("gyro", "p", "q", "r"),
        (20.0,),
        "gyro",
    ),
    Kind(
        "dvl-frozen",
        STUCK,
        "u, v, w stand still for {} s",
        RIGHT,
        frozen("dvl", *VELOCITIES),
        (30.0,),
        "dvl",
    ),
    Kind(
        "v-frozen",
        STUCK,
        "v alone stands still for {} s",
        RIGHT,
        frozen("dvl", "v"),
        (30.0, 60.0),
        "dvl",
    ),
    Kind(
        "rudder-frozen",
        "frozen rudder",
        "rudder stands still for {} s of maneuvers",
        SAID,
        frozen("rudder", "rudder"),
        (10.0, 40.0),
        "rudder",
    ),
    Kind(
        "rpm-frozen",
        "frozen rpm",
        "rpm stands still for {} s of a thrust step",
        SAID,
        rpm_stuck,
        (40.0,),
        "rpm",
    ),
    Kind(
        "heading-frozen",
        STUCK,
        "heading stands still for {} s",
        RIGHT,
        frozen("attitude", "heading"),
        (30.0,),
        "attitude",
    ),
    Kind(
        "v-constant", CONSTANT, "one value in all rows of v", SAID, constant("dvl", "v"), (), "dvl"
    ),
    Kind(
        "gyro-constant",
        CONSTANT,
        "one value in all rows of r",
        REFUSED,
        constant("gyro", "r"),
        (),
        "gyro",
    ),
    Kind(
        "rudder-constant",
        CONSTANT,
        "one angle in all rows of the rudder",
        REFUSED,
        constant("rudder", "rudder"),
        (),
        "rudder",
    ),
    Kind(
        "rpm-constant",
        "constant rpm",
        "one value in all rows of rpm",
        SAID,
        constant("rpm", "rpm"),
        (),
        "rpm",
    ),
    Kind(
        "heading-constant",
        CONSTANT,
        "one heading in all rows",
        SAID,
        constant("attitude", "heading"),
        (),
        "attitude",
    ),
    Kind(
        "depth-constant",
        CONSTANT,
        "one depth in all rows",
        SAID,
        constant("depth", "depth"),
        (),
        "depth",
    ),
    Kind(
        "coarse-speed",
        COARSE,
        "u and v in steps of {} m/s",
        SAID,
        coarse("dvl", "u", "v"),
        (0.1,),
        "dvl",
    ),
    Kind(
        "coarse-yaw-rate",
        COARSE,
        "r in steps of a share of {} of its range",
        SAID,
        coarse_share,
        (0.1,),
        "gyro",
    ),
    Kind(
        "coarse-heading",
        COARSE,
        "heading in steps of {} degrees",
        RIGHT,
        coarse("attitude", "heading"),
        (5.0,),
        "attitude",
    ),
    Kind(
        "noise",
        "noise of the DVL",
        "more noise in u and v: {} of the spread of u",
        SAID,
        noise,
        (0.3,),
        "dvl",
    ),
    Kind(
        "gyro-bias",
        BIAS,
        "offset of r of {} of its largest value",
        SAID,
        offset_share("gyro", "r"),
        (0.1,),
        "gyro",
    ),
    Kind(
        "gyro-bias-no-heading",
        BIAS,
        "offset of r of {} of its largest value, no heading",
        SAID,
        offset_share("gyro", "r"),
        (0.1,),
        "gyro",
        ("attitude",),
    ),
    Kind(
        "u-offset",
        BIAS,
        "offset of u of {} of its largest value",
        SAID,
        offset_share("dvl", "u"),
        (0.15,),
        "dvl",
    ),
    Kind(
        "v-offset",
        BIAS,
        "offset of v of {} of its largest value",
        SAID,
        offset_share("dvl", "v"),
        (0.3,),
        "dvl",
    ),
    Kind(
        "rudder-offset",
        BIAS,
        "offset of the rudder of {} of its largest value",
        SAID,
        offset_share("rudder", "rudder"),
        (0.2,),
        "rudder",
    ),
    Kind(
        "depth-offset",
        BIAS,
        "depth off by a share of {}",
        RIGHT,
        offset_share("depth", "depth"),
        (0.5,),
        "depth",
    ),
    Kind("copies", COPIES, "every sample of the DVL in {} rows", RIGHT, copies, (5.0,), "dvl"),
    Kind(
        "averaged-dvl",
        "delay of the DVL",
        "u and v averaged over the last {} samples",
        SAID,
        lagging,
        (10.0,),
        "dvl",
    ),
    Kind(
        "jump-position",
        SPIKES,
        "the position jumps for {} s",
        RIGHT,
        lambda log, s, _: log.spoil(
            "position", ["north", "east"], within(log, "position", s), lambda x: x + 500.0
        ),
        (30.0,),
        "position",
    ),
)
