"""The channels of a trial, each declared once.

The ingest stage writes a table with these columns; the readers, the filters, the metrics and
the figures take names, units and sensor from here.
"""

from dataclasses import dataclass
from typing import Literal

Kind = Literal["measured", "input"]

FLAG_SUFFIX = "_sampled"  # column `<sensor>_sampled`: a real sample stands behind this row
RECORD_COLUMN = "record"  # number of the uninterrupted piece of the trial a row belongs to
TIME_COLUMN = "time_s"


@dataclass(frozen=True)
class Channel:
    """Declaration of one channel.

    Attributes
    ----------
    column : str
        Column of the ingested table, SI unit as suffix.
    quantity : str
        Stem of the column in a log, without unit (``u``, ``rudder``, ``heading``).
    sensor : str
        File stem of the sensor that delivers it.
    unit : str
        SI unit.
    kind : str
        ``measured`` (a value at an instant) or ``input`` (held until the next command).
    needed : bool
        Whether a trial in the horizontal plane is refused without it.
    is_angle : bool
        Whether it wraps at 2 pi.
    plausible : float
        Magnitude beyond which a value is taken for a wrong unit or an outlier.
    meaning : str
        One line for people.
    """

    column: str
    quantity: str
    sensor: str
    unit: str
    kind: Kind
    needed: bool
    is_angle: bool
    plausible: float
    meaning: str


# fmt: off
CHANNELS: tuple[Channel, ...] = (
    Channel("u_mps", "u", "dvl", "m/s", "measured", True, False, 15.0, "surge velocity of the DVL"),
    Channel("v_mps", "v", "dvl", "m/s", "measured", True, False, 8.0, "sway velocity of the DVL"),
    Channel("w_mps", "w", "dvl", "m/s", "measured", False, False, 8.0, "heave velocity of the DVL"),
    Channel("p_radps", "p", "gyro", "rad/s", "measured", False, False, 6.0, "roll rate"),
    Channel("q_radps", "q", "gyro", "rad/s", "measured", False, False, 3.0, "pitch rate"),
    Channel("r_radps", "r", "gyro", "rad/s", "measured", True, False, 3.0, "yaw rate"),
    Channel("rudder_rad", "rudder", "rudder", "rad", "input", True, False, 1.6, "rudder angle"),
    Channel("elevator_rad", "elevator", "elevator", "rad", "input", False, False, 1.6,
            "elevator angle"),
    Channel("rpm", "rpm", "rpm", "1/min", "input", True, False, 1e4, "propeller rate"),
    Channel("roll_rad", "roll", "attitude", "rad", "measured", False, True, 3.2, "roll angle"),
    Channel("pitch_rad", "pitch", "attitude", "rad", "measured", False, False, 1.6, "pitch angle"),
    Channel("heading_rad", "heading", "attitude", "rad", "measured", False, True, 7.0,
            "heading, unwrapped"),
    Channel("depth_m", "depth", "depth", "m", "measured", False, False, 12e3, "depth"),
    Channel("north_m", "north", "position", "m", "measured", False, False, 1e7, "position north"),
    Channel("east_m", "east", "position", "m", "measured", False, False, 1e7, "position east"),
)
# fmt: on

BY_COLUMN: dict[str, Channel] = {c.column: c for c in CHANNELS}
BY_QUANTITY: dict[str, Channel] = {c.quantity: c for c in CHANNELS}
NEEDED: tuple[str, ...] = tuple(c.column for c in CHANNELS if c.needed)
SENSORS: tuple[str, ...] = tuple(dict.fromkeys(c.sensor for c in CHANNELS))


def sampled_flag(column: str) -> str:
    """Name of the flag column of the sensor behind `column`, e.g. ``dvl_sampled``."""
    return BY_COLUMN[column].sensor + FLAG_SUFFIX
