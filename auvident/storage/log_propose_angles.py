"""Latitude and longitude as a proposed position: by the names of the columns and their range."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from auvident.schema.logs import unit_name, units_of
from auvident.storage.log_columns import of_sensor, split_unit
from auvident.storage.log_file import LogFile
from auvident.storage.log_geographic import MOST_RAD, WHOLE_TURN_RAD, quantity_named
from auvident.storage.log_proposal import Proposal

# What may stand before the name: gps_lat, NAV_LONG.
PREFIXES = ("gps", "gnss", "nav", "pos", "position", "fix", "ins", "usbl")
LEAST_WITHIN = 0.9  # share of the values that are on the globe; fillers are not
TENTHS_OF_MICRODEGREES = 1e-7  # integers of GPS receivers
MOST_DEG = tuple(np.degrees((MOST_RAD[0], WHOLE_TURN_RAD)))  # of magnitudes
LEAST_DEG = 1e-3  # in 1e-7 degrees; a smaller number beyond 360 is something else


class Angles(NamedTuple):
    """Columns of one table, and what they are in."""

    names: tuple[str, str]
    unit: str
    scale: float
    guessed: bool


def find_angles(log: LogFile, values: Mapping[str, np.ndarray]) -> Angles | None:
    """Latitude and longitude in a table, or None.

    Parameters
    ----------
    log : LogFile
        The table.
    values : mapping of str to numpy.ndarray
        Its columns.
    """
    named: dict[str, dict[str, str]] = {}
    for name, numbers in values.items():
        prefix, quantity = _called(name)
        if quantity is not None and numbers.dtype != object:
            named.setdefault(prefix, {}).setdefault(quantity, name)
    for pair in named.values():
        if len(pair) == 2:
            found = _in_unit(log, (pair["north"], pair["east"]), values)
            if found is not None:
                return found
    return None


def _called(name: str) -> tuple[str, str | None]:
    """What stands before the name of a latitude or longitude, and its quantity."""
    path, _, last = name.strip().lower().rpartition(".")
    stem = split_unit(last)[0]
    before, _, word = stem.rpartition("_")
    if quantity_named(stem) is not None:
        return path, quantity_named(stem)
    return f"{path}.{before}", quantity_named(word) if before in PREFIXES else None


def _in_unit(
    log: LogFile, names: tuple[str, str], values: Mapping[str, np.ndarray]
) -> Angles | None:
    """The unit that both state, else that in which they fit on the globe."""
    known = [np.abs(values[n][np.isfinite(values[n]) & (values[n] != 0.0)]) for n in names]
    if not all(numbers.size for numbers in known):
        return None
    stated = _stated(log, names)
    if stated in units_of("rad"):
        return Angles(names, stated, 1.0, False)
    if stated is not None:
        return None
    if _within(known, MOST_RAD):
        return Angles(names, "rad", 1.0, True)
    if _within(known, MOST_DEG):
        return Angles(names, "deg", 1.0, True)
    degrees = [TENTHS_OF_MICRODEGREES * numbers for numbers in known]
    are_whole = all(np.all(numbers == np.rint(numbers)) for numbers in known)
    if are_whole and _within(degrees, MOST_DEG) and all(np.median(d) > LEAST_DEG for d in degrees):
        return Angles(names, "deg", TENTHS_OF_MICRODEGREES, True)
    return None


def _stated(log: LogFile, names: Sequence[str]) -> str | None:
    """Unit by labels or suffixes, of the first column that has one."""
    units = [unit_name(log.unit_of(name)) or split_unit(name)[1] for name in names]
    return next((unit for unit in units if unit is not None), None)


def _within(known: Sequence[np.ndarray], most: Sequence[float]) -> bool:
    return all(
        np.mean(numbers <= limit) >= LEAST_WITHIN
        for numbers, limit in zip(known, most, strict=True)
    )


def angle_proposals(home: str, angles: Angles, remark: str = "") -> list[Proposal]:
    """North and east of a table by its latitude and longitude."""
    return [
        Proposal(
            channel, home, name, angles.unit, angles.guessed, remark=remark, scale=angles.scale
        )
        for channel, name in zip(of_sensor("position"), angles.names, strict=True)
    ]
