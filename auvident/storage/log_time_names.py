"""Names and units of time columns: what people call them, and the unit that a name tells."""

from auvident.errors import InputError
from auvident.schema.logs import TIME_UNITS, SensorMap
from auvident.storage.log_file import UNNAMED_INDEX, LogFile
from auvident.storage.log_layout import INDEX, TIME_NAMES
from auvident.storage.log_time_parts import whole_seconds_in

TIME_ALIASES = (
    "t",
    "time",
    "t_s",
    "time_sec",
    "seconds",
    "sec",
    "stamp",
    "utc",
    "datetime",
    "date_time",
    "epoch",
    "unix_time",
    "timestamp_s",
    "timestamp_ms",
    "timestamp_us",
    "t_ms",
    "t_us",
    "clock",
    "time_usec",
    "time_boot_ms",
    "timestamp_usec",
    "timeus",
    "timems",
    "tow",
    "tow_s",
    "tow_ms",
    "gps_tow",
    "itow",
    "gps_seconds",
    "zeit",
)
MAY_BE_TIME = (UNNAMED_INDEX, INDEX)  # of a data frame, where nothing else is
TIME_SPELLINGS = {"usec": "us", "msec": "ms", "nsec": "ns"}  # of MAVLink: time_usec
RUN_TOGETHER = {"timeus": "us", "timems": "ms", "itow": "ms"}  # of DataFlash: TimeUS; of u-blox
TIME_LABELS = {
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), "s"),
    **dict.fromkeys(("ms", "msec", "millisecond", "milliseconds"), "ms"),
    **dict.fromkeys(("us", "µs", "μs", "usec", "microsecond", "microseconds"), "us"),
    **dict.fromkeys(("ns", "nsec", "nanosecond", "nanoseconds"), "ns"),
}
TIMES_SIXTY = frozenset(("min", "mins", "minute", "minutes", "h", "hr", "hrs", "hour", "hours"))


def guess_time(log: LogFile) -> str | None:
    """A column that may be the time, or None."""
    if log.time:
        return log.time
    for alias in (*TIME_NAMES, *TIME_ALIASES, *MAY_BE_TIME):
        found = log.find(alias)
        if found is not None:
            return found
    labelled = [n for n, label in zip(log.names, log.units, strict=True) if _is_time_label(label)]
    return whole_seconds_in(log.names) or (labelled[0] if len(labelled) == 1 else None)


def _is_time_label(label: str) -> bool:
    return label.strip("[]() ").lower() in TIME_LABELS


def time_unit(log: LogFile, name: str, mapping: SensorMap) -> str | None:
    """Unit of a time column: the map's word, or the suffix or label of its name, or None."""
    return mapping.time_unit or _suffix_of_time(name) or TIME_LABELS.get(_label(log, name))


def refuse_time_label(log: LogFile, name: str, mapping: SensorMap) -> None:
    """Refuse a time column whose label is none of a time in seconds or finer, or not its suffix.

    Raises
    ------
    InputError
        Unless the map states the unit.
    """
    label = _label(log, name)
    if mapping.time_unit is not None or not label:
        return
    if label in TIMES_SIXTY:
        raise InputError(
            f"column {name} is in {label}, not in seconds",
            log.where,
            "Write it in seconds (time_s), or as times of day or instants (timestamp).",
        )
    suffix, labelled = _suffix_of_time(name), TIME_LABELS.get(label)
    if suffix and labelled and suffix != labelled:
        raise InputError(
            f"column {name} is labelled {label!r}",
            log.where,
            f'Correct the suffix or the label, or say time_unit = "{labelled}" in a map (--map).',
        )


def _label(log: LogFile, name: str) -> str:
    """What stands beside the name of a column; the readers of containers have taken it in."""
    return log.unit_of(name).strip("[]() ").lower() if log.container is None else ""


def _suffix_of_time(name: str) -> str | None:
    suffix = name.lower().rpartition("_")[2]
    if name.lower() == suffix:
        return RUN_TOGETHER.get(suffix)
    suffix = TIME_SPELLINGS.get(suffix, suffix)
    return suffix if suffix in TIME_UNITS else None
