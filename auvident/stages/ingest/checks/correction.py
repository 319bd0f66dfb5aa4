"""Corrections that a check proposes: channels of a sensor from those that it logged.

A correction is written as text, for the record and for people: ``u_mps = 0.514444 u_mps; ...``,
each channel a multiple of one channel of the same sensor, less an offset where it has one
(``r_radps = 1 r_radps - 0.0123``). Channels may be of several sensors. `EARTH` turns north and
east into ahead and starboard.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from auvident.schema.channels import BY_COLUMN
from auvident.schema.logs import RawSensor, RawTrial

VELOCITIES = ("u_mps", "v_mps", "w_mps")
EARTH = "u_mps, v_mps = north, east turned by heading_rad"
EARTH_SWAPPED = "u_mps, v_mps = east, north turned by heading_rad"

Terms = Mapping[str, tuple[float, str]]


def scaled(factor: float, *columns: str) -> str:
    """Text of a correction that multiplies channels."""
    return mixed({column: (factor, column) for column in columns})


def mixed(terms: Terms) -> str:
    """Text of a correction: channel -> factor and channel that it is made of."""
    return "; ".join(f"{to} = {factor:.6g} {of}" for to, (factor, of) in terms.items())


def less(offset: float, column: str) -> str:
    """Text of a correction that takes an offset off a channel."""
    return f"{scaled(1.0, column)} {'-' if offset > 0.0 else '+'} {abs(offset):.6g}"


def corrected(raw: RawTrial, fix: str) -> RawTrial:
    """The trial with a correction made to what was logged."""
    if fix in (EARTH, EARTH_SWAPPED):
        return _with(raw, _vehicle_axes(raw, swapped=fix == EARTH_SWAPPED))
    terms: dict[str, dict[str, tuple[float, str, float]]] = {}
    for part in fix.split("; "):
        to, _, of = part.partition(" = ")
        factor, column, *rest = of.split(" ")
        own = terms.setdefault(BY_COLUMN[to].sensor, {})
        own[to] = (float(factor), column, float("".join(rest) or 0.0))
    for name, own in terms.items():
        raw = _with(raw, _made_of(raw.sensors[name], own))
    return raw


def _made_of(sensor: RawSensor, terms: Mapping[str, tuple[float, str, float]]) -> RawSensor:
    """The sensor with channels that are a factor times one of its own, and an offset."""
    made = {
        to: factor * sensor.values[of] + offset
        for to, (factor, of, offset) in terms.items()
        if of in sensor.values
    }
    return replace(sensor, values={**sensor.values, **made})


def _with(raw: RawTrial, sensor: RawSensor) -> RawTrial:
    return replace(raw, sensors={**raw.sensors, sensor.sensor: sensor})


def _vehicle_axes(raw: RawTrial, swapped: bool) -> RawSensor:
    """The DVL with north and east turned by the heading at its samples."""
    dvl, attitude = raw.sensors["dvl"], raw.sensors["attitude"]
    north, east = (dvl.values[c] for c in VELOCITIES[:2][:: -1 if swapped else 1])
    known = np.isfinite(attitude.values["heading_rad"]) & np.isfinite(attitude.time_s)
    time, first = np.unique(attitude.time_s[known], return_index=True)
    angle = np.unwrap(attitude.values["heading_rad"][known][first])
    heading = np.interp(dvl.time_s, time, angle, left=np.nan, right=np.nan)
    ahead = north * np.cos(heading) + east * np.sin(heading)
    aside = east * np.cos(heading) - north * np.sin(heading)
    return replace(dvl, values={**dvl.values, "u_mps": ahead, "v_mps": aside})
