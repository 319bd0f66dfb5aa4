"""What counts as naming a fault: codes of findings, names of checks, reasons of dropped readings.

A row of the generator has a fault in words; here stand the patterns (`fnmatch`) of what the
program may call it. ``dropped:REASON`` is a reason under which readings of the sensor went,
``effect:ID`` an effect that `diagnose` names. A pattern with ``@`` behind it counts where message
or place name the sensor of the row as well, one with ``~`` and words where the message has them.
"""

from collections.abc import Iterable, Mapping
from fnmatch import fnmatch
from typing import Any

SENSOR_WORDS = {
    "dvl": ("dvl", "u_mps", "v_mps", "w_mps", "u_kn", "v_kn", "velocit", "speed"),
    "gyro": ("gyro", "r_radps", "r_degps", "yaw rate"),
    "rudder": ("rudder",),
    "rpm": ("rpm", "propeller"),
    "attitude": ("attitude", "heading", "pitch", "roll"),
    "position": ("position", "north", "east", "track"),
    "depth": ("depth",),
    "elevator": ("elevator",),
}
# Findings that a channel is not to be trusted, whatever the reason.
ABOUT_A_SENSOR = (
    "many_rows_dropped@",
    "much_missing@",
    "much_left_out@",
    "channel_unusable@",
    "sensor_set_aside@",
    "*set_aside*@",
    "*file_not_used*@",
    "constant_channel@",
    "clipped*@",
    "*saturat*@",
    "*stuck*@",
    "*frozen*@",
)
SPEED = (
    "speed*",
    "advance_ratio",
    "*thrust*",
    "*propeller*",
    "dvl_scale*",
    "u_scale*",
    "effect:dvl_scale",
)
RPM = ("rpm*", "advance_ratio", "*thrust*", "*propeller*", "speed_rpm*", "speed_scale")
RUDDER = ("rudder_unit", "rudder_scale*", "rudder_gain*", "*fin_force*", "turning_gain*")
GYRO = (
    "speed_by_drift",
    "heading_gyro_gain",
    "yaw_rate_unit",
    "gyro_scale*",
    "yaw_rate_scale*",
    "effect:gyro_scale",
)
AXES = ("*axes*", "*swap*", "*turned*", "surge_sign", "dvl_yaw*", "*misalign*", "*earth*")
HEADING = ("heading_*", "*heading")
STAMPS = ("coarse_time", "jitter", "dropped:backward_time", "dropped:repeated_time", "clock_*")
STUCK = ("dropped:stuck*", "dropped:held_copy", "held_copies@", "*frozen*@", "*stuck*@")
CLOCKS = {
    "dvl": ("dvl_lags_*", "clock_dvl*", "drift_dvl"),
    "gyro": ("*_lags_gyro", "gyro_lags_*", "clock_*", "drift_*"),  # what others are measured by
    "rudder": ("gyro_lags_rudder", "rudder_lags_*", "clock_rudder*", "drift_rudder"),
    "rpm": ("*rpm_lag*", "clock_rpm*", "drift_rpm"),
    "attitude": ("attitude_lags_*", "clock_attitude*", "clock_heading*", "drift_attitude"),
    "position": ("*position_lag*", "clock_position*", "drift_position"),
    "depth": ("*depth_lag*", "clock_depth*", "drift_depth"),
}
# The model against the estimate from geometry; one coefficient alone is no more than a remark.
WHOLE = ("priors-contradicted", "estimate*contradict*", "*vehicle_file*")
THRUST = ("speed_scale", "rpm_scale")  # these ask whether it is another vehicle's file

# Fault of a row -> patterns.
NAMES: dict[str, tuple[str, ...]] = {
    "scale of the speed": SPEED,
    "scale of v": ("speed_by_drift", "sway*", "v_scale*", "*centripetal*", "*axes*"),
    "scale of rpm": RPM,
    "scale of the rudder": RUDDER,
    "scale of the gyro": GYRO,
    "unit of the heading": HEADING,
    "unit of the pitch": ("pitch*",),
    "scale of the depth": ("depth*", "heave*", "pitch_sign"),  # the check of sign and scale
    "scale of the position": ("speed_position_ratio", "speed_scale*", "position*", "track*"),
    "unit of the time": ("*time*", "clock_*", "*rate*", "too_slow*"),
    "sign of the rudder": ("rudder_sign", "rudder_sign_*contra*"),
    "sign of the elevator": ("elevator_sign*",),
    "sign of the yaw rate": ("yaw_rate_sign*", "gyro_sign*", "heading_gyro*", "rudder_sign"),
    "axes of the DVL": (*AXES, "sway_*", "speed_position_ratio"),
    "sign of v": ("sway_*", "*axes*", "v_sign*", "speed_by_drift~v of the other sign"),
    "heave axis of the DVL": ("heave*", "w_sign*", "*axes*"),
    "axes of the gyro": ("yaw_rate_unit", "gyro_axes*", "heading_gyro_gain", "gyro_scale*"),
    "sign of rpm": ("rpm*", "surge_sign"),
    "sense of the heading": HEADING,
    "offset of the heading": HEADING,
    "sign of the pitch": ("pitch*",),
    "sign of the roll": ("roll*",),
    "sign of the depth": ("depth*", "heave*", "never_under*", "surface*"),
    "axes of the position": ("position*", "track*", "*axes*", "clock_position*", "speed_scale*"),
    "time stamps": STAMPS,
    "readings lost": (
        "sensor_starts_late@",
        "sensor_stops_early@",
        "cut_by_gap",
        "torn_by_dropout",
        "dropped:*",
    ),
    "fill values": ("dropped:fill*", "fill*", "dropped:outlier", "dropped:implausible"),
    "spikes": (
        "spikes",
        "dropped:spike*",
        "dropped:outlier",
        "dropped:burst*",
        "dropped:implausible",
    ),
    "stuck readings": STUCK,
    "saturated readings": (
        "gyro_axes",
        "*saturat*",
        "*overflow*",
        "dropped:saturat*",
        "dropped:overflow",
        "dropped:outlier",
    ),
    "clipped rudder": ("rudder_cut", "*clipp*", "*saturat*", "rudder_scale*", "rudder_gain*"),
    "frozen rudder": ("*frozen*", "*stuck*", "rudder_constant*"),
    "frozen rpm": ("*frozen*", "*stuck*", "rpm_constant*"),
    "constant channel": ("constant_channel", "rudder_never_moves", "elevator_unit", "*constant*"),
    "constant rpm": ("rpm*", "*constant*"),
    "coarse digits": ("*coarse*", "*resolution*"),
    "noise of the DVL": ("noise*", "*noise"),
    "offset": (
        "*bias*",
        "*offset*",
        "effect:*offset",
        "effect:*bias",
        "heading_*",
        "speed_position_ratio@",
    ),
    "copied rows": ("held_copies", "dropped:held_copy", "dropped:repeated_time"),
    "delay of the DVL": ("dvl_averaged", "dvl_lags_*", "clock_dvl*", "effect:dvl_delay"),
    "form of the text": (),
    "rows that cannot be read": ("dropped:*", "many_rows_dropped"),
    "columns": ("file_not_used", "*column*"),
    "order of the rows": ("dropped:backward_time",),
    "files": ("sensor_stops_early@", "file_not_used", "*set_aside*"),
    "the same trial twice": ("*same_trial*", "*twice*", "*cop*", "*overlap*"),
    "vehicle file": (*WHOLE, *THRUST, "speed_by_drift~vehicle's file"),
    "numbers of the vehicle file": (
        *WHOLE,
        *THRUST,
        "mass_and_volume",
        "no_*",
        "fin_*",
        "slender_fin",
        "stout_hull",
        "assumed_*",
        "*propeller*",
        "advance_ratio",
        "speed*",
        "rudder_scale*",
        "elevator_scale*",
        "*thrust*",
        "sway_sign",
        "*axes*",
        "*misalign*",
        "dvl_yaw~against its mounting",
    ),
    "map": ("file_not_used", "rudder_never_moves", "rudder_scale*"),
    **{f"clock of {sensor}": patterns for sensor, patterns in CLOCKS.items()},
}
# Fault of a row -> checks that would test it. The first line of the ingest says of a quantity that
# nothing tests it only where none of its checks could. ``@`` as in `NAMES`.
TESTED_BY: dict[str, tuple[str, ...]] = {
    "scale of the speed": ("speed_by_position", "speed_by_depth", "speed_scale"),
    "scale of v": ("sway_by_position",),
    "scale of rpm": ("rpm_scale",),
    "scale of the rudder": ("rudder_scale",),
    "scale of the gyro": ("yaw_rate_scale",),
    "scale of the position": ("speed_by_position",),
    "unit of the heading": ("heading_unit",),
    "scale of the depth": ("pitch_sign",),
    "unit of the pitch": ("pitch_sign",),
    "sign of v": ("sway_by_position",),
    "sign of the rudder": ("rudder_sign",),
    "sign of the yaw rate": ("yaw_rate_scale",),
    "sign of the pitch": ("pitch_sign",),
    "sign of the depth": ("pitch_sign",),
    "sign of rpm": ("rpm_sign",),
    "axes of the DVL": ("dvl_axes",),
    "axes of the gyro": ("gyro_axes",),
    "heave axis of the DVL": ("heave_sign",),
    "offset": ("yaw_rate_offset@",),  # of the gyro alone
    "clipped rudder": ("rudder_cut",),
    "frozen rudder": ("rudder_stuck",),
    "constant rpm": ("rpm_constant",),
    **{f"clock of {sensor}": (f"clock_{sensor}", f"drift_{sensor}") for sensor in CLOCKS},
}
# The model is said to be doubtful, but not why.
DOUBTS = (
    *WHOLE,
    "not-predicted",
    "worse-than-prior",
    "no-better",
    "prediction-ran-away",
    "against-physics",
)
# Counts and remarks, which blame nothing.
REMARKS = (
    *WHOLE,
    "*cop*",
    "*rate*",
    "assumed_*",
    "channels_absent",
    "cut_by_gap",
    "file_not_used",
    "held_copies",
    "many_rows_dropped",
    "no_*",
    "sensor_starts_late",
    "sensor_stops_early",
    "torn_by_dropout",
)
# Names of some fault or other: with none of the right ones among them, a wrong name.
ACCUSING = sorted(
    {
        p.rstrip("@").partition("~")[0]
        for patterns in NAMES.values()
        for p in patterns
        if ":" not in p
    }
    - {*REMARKS}
)


def names_it(telling: Mapping[str, Any], fault: str, sensor: str) -> bool:
    """Whether a finding, check or reason names the fault of a row."""
    for pattern, _, words in (p.partition("~") for p in NAMES[fault] if not p.endswith("@")):
        if fnmatch(telling["code"], pattern) and words in telling["message"]:
            return True
    generic = (*(p for p in NAMES[fault] if p.endswith("@")), *ABOUT_A_SENSOR)
    about = any(fnmatch(telling["code"], pattern.rstrip("@")) for pattern in generic)
    return about and mentions(telling, sensor)


def may_name(code: str, fault: str) -> bool:
    """Whether a code is one that a fault may be called by."""
    return any(fnmatch(code, p.partition("~")[0].rstrip("@")) for p in NAMES[fault])


def mentions(telling: Mapping[str, Any], sensor: str) -> bool:
    """Whether message or place name the sensor, or one of its channels."""
    text = f"{telling['message']} {telling['where']} {telling['code']}".lower()
    return any(word in text for word in SENSOR_WORDS.get(sensor, ()))


def any_of(code: str, patterns: Iterable[str]) -> bool:
    """Whether a code is one of those."""
    return any(fnmatch(code, pattern) for pattern in patterns)
