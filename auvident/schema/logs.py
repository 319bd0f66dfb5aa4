"""Logs before and after ingest: raw sensors, the column map and the quality report.

``MAP.toml`` is `ColumnMap`; ``ingest/quality.json`` is `Quality`. `RawTrial` is what the
readers hand to the ingest stage: every sensor with its own ticks, in SI units, signs as logged.
"""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from auvident.schema.artifacts import Finding
from auvident.schema.base import Artifact, Declared
from auvident.schema.channels import BY_COLUMN, BY_QUANTITY, SENSORS
from auvident.schema.unit_spellings import spelled

if TYPE_CHECKING:
    import numpy as np

DEG = 0.017453292519943295  # rad per degree
KNOT = 1852.0 / 3600.0  # m/s per knot
FOOT = 0.3048  # m per foot
RPM_OF_RADPS = 9.549296585513721  # rev/min per rad/s

# Unit of a column (suffix or map) -> unit of the channel it fits, factor to that unit.
UNITS: dict[str, tuple[str, float]] = {
    "mps": ("m/s", 1.0),
    "kn": ("m/s", KNOT),
    "cmps": ("m/s", 0.01),
    "mmps": ("m/s", 0.001),
    "kmph": ("m/s", 1.0 / 3.6),
    "ftps": ("m/s", FOOT),
    "rad": ("rad", 1.0),
    "deg": ("rad", DEG),
    "radps": ("rad/s", 1.0),
    "degps": ("rad/s", DEG),
    "rpm": ("1/min", 1.0),
    "rps": ("1/min", 60.0),
    "m": ("m", 1.0),
    "ft": ("m", FOOT),
}
PERCENT = frozenset(("percent", "%", "pct"))  # of a throttle: no unit until its scale is known
PERCENT_REMEDY = (
    "a throttle in percent needs scale, the rpm of one percent: "
    '{ column = "throttle", unit = "percent", scale = 12.5 }'
)
PERCENT_OF_FIN = (
    ': give the unit that scale makes of it, the degrees of one percent: unit = "deg", scale = 0.25'
)
RADPS_OF_PROPELLER = (
    f': rad/s is unit = "rpm", scale = {RPM_OF_RADPS:.7g}'  # no unit: gyros have it, too
)
AS_ANGLES = ("north", "east")  # also of latitude and longitude, always both
LONE_ANGLE = (
    "{0} alone is an angle; latitude and longitude go together: "
    'north = {{ column = "lat", unit = "deg" }}, east = {{ column = "lon", unit = "deg" }}'
)
TIME_UNITS: dict[str, float] = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


def unit_name(text: str) -> str | None:
    """Name of a unit in `UNITS` from any known spelling, or None."""
    word = spelled(text)
    return word if word in UNITS else None


def units_of(dimension: str) -> tuple[str, ...]:
    """Names of the units that a channel of this unit may be logged in."""
    return tuple(name for name, (fits, _) in UNITS.items() if fits == dimension)


def units_for(quantity: str) -> tuple[str, ...]:
    """Names of the units of a quantity; north and east may be angles, latitude and longitude."""
    own = units_of(BY_QUANTITY[quantity].unit)
    return own + units_of("rad") if quantity in AS_ANGLES else own


def is_angle_for(quantity: str, unit: str | None) -> bool:
    """Whether a unit makes a latitude or longitude of the column of a position."""
    return quantity in AS_ANGLES and unit in units_of("rad")


# --- the map file -------------------------------------------------------------------------


class ColumnEntry(Declared):
    """Column of a quantity: ``{ column = "delta_cmd", unit = "deg", sign = -1 }``.

    `scale` and `offset` make numbers of `unit` of those in the column, `sign` comes last:
    sign * (scale * number + offset). In place of a column an input may have a `constant`.
    """

    column: str | None = None
    unit: str | None = None
    sign: Literal[1, -1] = 1
    scale: float = 1.0
    offset: float = 0.0
    constant: float | None = None

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if (self.column is None) == (self.constant is None):
            raise ValueError("give either column or constant")
        if self.scale == 0.0:
            raise ValueError("scale = 0 would leave nothing of the column")
        if self.constant is not None and {"scale", "offset"} & self.model_fields_set:
            raise ValueError("a constant takes neither scale nor offset")
        return self


def _from_name(value: object) -> object:
    return {"column": value} if isinstance(value, str) else value


Entry = Annotated[ColumnEntry, BeforeValidator(_from_name)] | None
NotLogged = Literal["constant", "derived"]  # where a channel comes from that no sensor logged
TimeUnit = Literal["s", "ms", "us", "ns", "iso"]


MOST_OFFSET_S = 1e10  # from switch-on to 1970 and back
MOST_DRIFT_PPM = 1e5  # ten times what a clock without a crystal drifts by


class SensorMap(Declared):
    """Where a sensor's samples stand; the tables of the sensors add their quantities.

    `topic` is the table of a container file (a ROS bag, an MCAP, a ULog) that has them.
    `time_offset_s` is added to its stamps, and `time_drift_ppm` per second from their median.
    """

    file: str | None = None
    topic: str | None = None
    time: str | None = None
    time_unit: TimeUnit | None = None
    time_offset_s: float = Field(default=0.0, ge=-MOST_OFFSET_S, le=MOST_OFFSET_S)
    time_drift_ppm: float = Field(default=0.0, ge=-MOST_DRIFT_PPM, le=MOST_DRIFT_PPM)
    valid: str | None = None

    def entries(self) -> dict[str, ColumnEntry]:
        """Mapped columns by quantity."""
        found = {q: getattr(self, q) for q in type(self).model_fields if q in BY_QUANTITY}
        return {q: entry for q, entry in found.items() if entry is not None}

    @model_validator(mode="after")
    def _units_fit(self) -> Self:
        for quantity, entry in self.entries().items():
            _check_constant(quantity, entry)
            if _is_percent(quantity, entry):
                continue
            name = unit_name(entry.unit) if entry.unit is not None else None
            if entry.unit is not None and name not in units_for(quantity):
                allowed = ", ".join(units_for(quantity))
                share = (entry.unit or "").strip().lower() in PERCENT
                remedy = PERCENT_OF_FIN if share and name is None else ""
                remedy = RADPS_OF_PROPELLER if (quantity, name) == ("rpm", "radps") else remedy
                raise ValueError(
                    f"unit {entry.unit!r} of {quantity} is not one of {allowed}{remedy}"
                )
        return self


def _check_constant(quantity: str, entry: ColumnEntry) -> None:
    if entry.constant is None:
        return
    if BY_QUANTITY[quantity].kind != "input":
        raise ValueError(f"{quantity} is measured: only an input may be constant")
    if entry.unit is None and BY_QUANTITY[quantity].unit != "1/min":
        raise ValueError(f"the constant {quantity} needs a unit")


def _is_percent(quantity: str, entry: ColumnEntry) -> bool:
    """Whether a column is a throttle in percent, which its scale makes rpm."""
    if quantity != "rpm" or (entry.unit or "").strip().lower() not in PERCENT:
        return False
    if "scale" not in entry.model_fields_set:
        raise ValueError(PERCENT_REMEDY)
    return True


class DvlMap(SensorMap):
    """``[dvl]``."""

    u: Entry = None
    v: Entry = None
    w: Entry = None


class GyroMap(SensorMap):
    """``[gyro]``."""

    p: Entry = None
    q: Entry = None
    r: Entry = None


class InputMap(SensorMap):
    """Common to the inputs. `on_change`: rows are written only when the value changes."""

    on_change: bool | None = None


class RudderMap(InputMap):
    """``[rudder]``."""

    rudder: Entry = None


class ElevatorMap(InputMap):
    """``[elevator]``."""

    elevator: Entry = None


class RpmMap(InputMap):
    """``[rpm]``."""

    rpm: Entry = None


class AttitudeMap(SensorMap):
    """``[attitude]``.

    `frame`: "ned", angles of a body (forward, starboard, down) in (north, east, down); "enu",
    of a body (forward, port, up) in (east, north, up), as ROS has them (REP 103).
    """

    frame: Literal["ned", "enu"] = "ned"
    roll: Entry = None
    pitch: Entry = None
    heading: Entry = None


class DepthMap(SensorMap):
    """``[depth]``."""

    depth: Entry = None


class PositionMap(SensorMap):
    """``[position]``: north and east, or as them latitude and longitude in deg or rad."""

    north: Entry = None
    east: Entry = None

    @model_validator(mode="after")
    def _both_angles(self) -> Self:
        found = {q: unit_name(e.unit) if e.unit else None for q, e in self.entries().items()}
        angles = [q for q, unit in found.items() if is_angle_for(q, unit)]
        if len(angles) == 1 and (len(found) == 1 or None not in found.values()):
            raise ValueError(LONE_ANGLE.format(*angles))
        return self


class Derive(Declared):
    """``[derive]``: velocities and yaw rate from position and heading, where nothing measured them.

    `x_m`, `y_m`: where the position is taken (antenna, transponder), in vehicle axes from the
    origin.
    """

    u: bool = False
    v: bool = False
    r: bool = False
    x_m: float = 0.0
    y_m: float = 0.0

    @property
    def columns(self) -> tuple[str, ...]:
        """Channel columns that are asked for."""
        return tuple(BY_QUANTITY[q].column for q in ("u", "v", "r") if getattr(self, q))


class ColumnMap(Declared):
    """``MAP.toml``: the user's files, columns, units and signs.

    `file`, `time` and `time_unit` before the first table hold for every sensor whose table
    does not say otherwise. A file is a pattern relative to the log folder.
    """

    file: str | None = None
    time: str | None = None
    time_unit: TimeUnit | None = None
    dvl: DvlMap | None = None
    gyro: GyroMap | None = None
    rudder: RudderMap | None = None
    elevator: ElevatorMap | None = None
    rpm: RpmMap | None = None
    attitude: AttitudeMap | None = None
    depth: DepthMap | None = None
    position: PositionMap | None = None
    derive: Derive = Derive()

    @model_validator(mode="after")
    def _measured_or_derived(self) -> Self:
        for column in self.derive.columns:
            channel = BY_COLUMN[column]
            if channel.quantity in self.of(channel.sensor).entries():
                raise ValueError(
                    f"[{channel.sensor}] {channel.quantity} has a column and [derive] asks for it "
                    "as well: keep one"
                )
        return self

    def of(self, sensor: str) -> SensorMap:
        """Table of one sensor with the common settings filled in."""
        own: SensorMap = getattr(self, sensor) or SensorMap()
        common = {
            key: getattr(self, key)
            for key in ("file", "time", "time_unit")
            if getattr(own, key) is None
        }
        return own.model_copy(update=common)

    def constants(self) -> dict[str, float]:
        """Constant inputs by channel column, in the unit of the channel."""
        found = {}
        for sensor in SENSORS:
            for quantity, entry in self.of(sensor).entries().items():
                if entry.constant is not None:
                    factor = UNITS[unit_name(entry.unit) or ""][1] if entry.unit else 1.0
                    found[BY_QUANTITY[quantity].column] = entry.sign * factor * entry.constant
        return found


# --- raw logs -----------------------------------------------------------------------------


@dataclass(frozen=True)
class RawSensor:
    """Samples of one sensor as logged.

    Attributes
    ----------
    sensor : str
        Name of the sensor in `auvident.schema.channels`.
    file : str
        File it came from, for messages.
    time_s : numpy.ndarray
        Time of each row in s, shape (n,); not necessarily ascending, NaN where missing.
    values : dict of str to numpy.ndarray
        Values by channel column (``u_mps``), SI units, signs as logged, NaN where missing.
    rows : numpy.ndarray
        Row (1-based line of a text file) of each sample, for messages, shape (n,).
    columns : dict of str to str
        Name in the file of each channel column.
    rows_read : int
        Rows in the file, with those dropped by the reader.
    dropped : dict of str to int
        Rows dropped by the reader, by reason.
    dropped_rows : dict of str to tuple of int
        The first few rows dropped, by reason.
    on_change : bool or None
        The map's word on whether rows are written only on change.
    time_column : str
        Name of its time column in the file.
    not_logged : dict of str to str
        Columns that no sensor logged: ``constant`` or ``derived``.
    std : dict of str to float
        Noise of a derived column that the identification counts with.
    remarks : tuple of Finding
        What the reader noticed.
    """

    sensor: str
    file: str
    time_s: "np.ndarray"
    values: "dict[str, np.ndarray]"
    rows: "np.ndarray"
    columns: dict[str, str]
    rows_read: int
    dropped: dict[str, int] = field(default_factory=dict)
    dropped_rows: dict[str, tuple[int, ...]] = field(default_factory=dict)
    on_change: bool | None = None
    time_column: str = "time_s"
    not_logged: dict[str, NotLogged] = field(default_factory=dict)
    std: dict[str, float] = field(default_factory=dict)
    remarks: "tuple[Finding, ...]" = ()


def moved_stamps(time_s: "np.ndarray", offset_s: float, drift_ppm: float) -> "np.ndarray":
    """Stamps with an offset added at their median, and a drift from there.

    The median of a log depends on no single stamp, and an offset there hardly on the drift.
    """
    import numpy as np

    if not drift_ppm or not np.isfinite(time_s).any():
        return time_s + offset_s
    return time_s + offset_s + 1e-6 * drift_ppm * (time_s - np.nanmedian(time_s))


@dataclass(frozen=True)
class RawTrial:
    """One trial as logged: its sensors, each on its own ticks of a shared clock.

    Attributes
    ----------
    name : str
        Stem of its folder or file.
    sensors : dict of str to RawSensor
        Sensors found, by name.
    findings : tuple of Finding
        What the readers noticed.
    origin : str
        Time (ISO 8601, UTC) of ``time_s`` = 0 when the log has absolute time stamps, else "".
    derive : Derive
        What the map wants derived from position and heading.
    """

    name: str
    sensors: dict[str, RawSensor]
    findings: tuple[Finding, ...] = ()
    origin: str = ""
    derive: Derive = field(default_factory=Derive)


# --- quality.json -------------------------------------------------------------------------


FIRST_FEW = 5  # times and rows that are kept for the report


class Dropped(Artifact):
    """Samples left out for one reason: how many, and times and rows of the first few."""

    count: int
    first_times_s: tuple[float, ...] = ()
    first_rows: tuple[int, ...] = ()


class ChannelQuality(Artifact):
    """What became of one channel.

    `noise_std` is that of the raw samples in the channel's unit (None for inputs and where
    there are too few; of a derived one what the identification counts with);
    `interpolated_share` and `missing_share` refer to the grid. `source` says where it comes from.
    """

    column: str
    log_column: str
    unit: str
    samples: int
    dropped: dict[str, Dropped] = {}
    minimum: float
    maximum: float
    noise_std: float | None = None
    resolution: float | None = None
    gaps: int = 0
    longest_gap_s: float = 0.0
    gap_limit_s: float | None = None
    interpolated_share: float = 0.0
    missing_share: float = 0.0
    source: Literal["logged"] | NotLogged = "logged"


class SensorQuality(Artifact):
    """What became of one sensor's rows."""

    sensor: str
    file: str
    rows_read: int
    rows_used: int
    dropped: dict[str, Dropped] = {}
    rate_hz: float | None = None
    jitter_s: float | None = None
    t_start_s: float
    t_end_s: float
    method: str = ""
    channels: tuple[ChannelQuality, ...] = ()


class RecordSpan(Artifact):
    """An uninterrupted piece of a trial."""

    record: int
    t_start_s: float
    t_end_s: float
    samples: int


class Alignment(Artifact):
    """Delay of one sensor's clock against another's, estimated from the motion.

    `lag_s` > 0: the second lags the first by so much. `explained` is the share of the variance
    that the relation behind the estimate explains.
    """

    first: str
    second: str
    lag_s: float
    std_s: float
    explained: float


class CheckMade(Artifact):
    """One test of units, scales, signs, axes or clocks of a trial: what, against what, outcome.

    Attributes
    ----------
    name : str
        Of the row in the table of checks; also what ``--fix`` takes where `fix` is given.
    what, against : str
        The quantity that is tested and what it is held against, in words.
    outcome : {"agrees", "contradicts", "untested"}
    value, low, high : float or None
        The figure with its 95 % interval.
    limit : float or None
        Distance from what is expected that counts as a contradiction.
    message : str
        A sentence; for an untested row, what would be needed.
    remedy : str
    fix : str
        Value that ``ingest --fix NAME`` would apply; empty where none is proposed.
    fix_if_asked : str
        The same where the check does not propose it, and only applies it when told to.
    only : str
        How coarsely it was tested, where that is not fine enough to rely on.
    within : float or None
        The same as a figure, a factor, or s or ppm of a clock: a fault up to so much is not told.
        None where it was tested closely, and where nothing is too large.
    """

    name: str
    what: str
    against: str
    outcome: Literal["agrees", "contradicts", "untested"]
    value: float | None = None
    low: float | None = None
    high: float | None = None
    limit: float | None = None
    message: str = ""
    remedy: str = ""
    fix: str = ""
    fix_if_asked: str = ""
    only: str = ""
    within: float | None = None


class TrialQuality(Artifact):
    """Quality of one ingested trial; `fixed` has the corrections of ``--fix`` by check."""

    trial: str
    rate_hz: float
    t_start_s: float
    t_end_s: float
    samples: int
    origin: str = ""
    sensors: tuple[SensorQuality, ...] = ()
    absent: tuple[str, ...] = ()
    records: tuple[RecordSpan, ...] = ()
    alignment: tuple[Alignment, ...] = ()
    checks: dict[str, Any] = {}
    checks_made: tuple[CheckMade, ...] = ()
    fixed: dict[str, str] = {}
    findings: tuple[Finding, ...] = ()


class SetAside(Artifact):
    """A trial that was found and not used: why, where the fault is, what to do."""

    trial: str
    reason: str
    where: str = ""
    remedy: str = ""


class Quality(Artifact):
    """``ingest/quality.json``."""

    schema_: str = Field("auvident/quality/1", alias="schema")
    vehicle: str
    rate_hz: float
    trials: tuple[TrialQuality, ...]
    findings: tuple[Finding, ...] = ()
    set_aside: tuple[SetAside, ...] = ()
