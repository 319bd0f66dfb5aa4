"""The table of checks of units, scales, signs and axes; one row is one test."""

import math

from auvident.schema.artifacts import Finding
from auvident.schema.channels import NEEDED
from auvident.schema.logs import CheckMade
from auvident.stages.ingest.checks import averaging, axes, elevator, gyro, heave, rudder, speed
from auvident.stages.ingest.checks.row import Check, untested
from auvident.stages.ingest.checks.seen import Seen

# fmt: off
CHECKS: tuple[Check, ...] = (
    Check("dvl_axes", "axes of the DVL", "motion, heading and position", axes.dvl_axes, None,
          "a wrong axis shows by a factor, not by shares"),
    Check("dvl_yaw", "mounting of the DVL", "v on straight stretches", axes.dvl_yaw,
          axes.YAW_LIMIT_DEG, "degrees; what is smaller the diagnosis estimates",
          after=("dvl_axes",)),
    Check("dvl_averaged", "samples of the DVL", "one another", averaging.dvl_averaged,
          averaging.DELAY_S, "averaging and a bus take up to that; smaller delays are diagnosed"),
    Check("speed_by_position", "scale of the speed within 5 %", "position", speed.by_position,
          speed.POSITION_LIMIT, "DVLs are good to 1 %; lever arms and currents that change",
          "speed_position_ratio", after=("dvl_axes",)),
    Check("speed_scale", "scale of the speed", "thrust and drag", speed.by_propeller,
          None, "three standard deviations of thrust and drag from geometry",
          after=("dvl_axes",)),
    Check("rpm_scale", "scale of rpm", "speed, thrust and drag", speed.rpm_by_speed,
          None, "three standard deviations of thrust and drag from geometry",
          after=("dvl_axes",)),
    Check("speed_by_drift", "scale of speed over yaw rate", "drift in turns", speed.by_drift,
          speed.PIVOT_LIMIT, "logarithm; more than the worst of 150 drawn vehicles",
          after=("dvl_axes", "dvl_yaw")),
    Check("advance_ratio", "speed and rpm", "propeller diameter", speed.advance_ratio,
          speed.MAX_ADVANCE, "propellers give no thrust beyond u / (n D) = 1.5"),
    Check("rpm_sign", "sign of rpm", "speed ahead", speed.rpm_sign, speed.AHEAD_SHARE,
          "share of the rows"),
    Check("rpm_constant", "rpm", "steady speeds", speed.rpm_varies, None,
          "10 % or eight times their unrest; 30 % where a current may add to them"),
    Check("surge_sign", "sign of u", "rpm", axes.surge_sign, axes.MIN_SPEED_MPS,
          "a speed that is no noise"),
    Check("sway_sign", "sign of v", "yaw rate in turns", axes.sway_sign, axes.SWAY_SLOPE,
          "hulls drift outward, by 0.2 to 0.5 r L"),
    Check("sway_by_position", "scale and sign of v", "position", speed.sway_by_position,
          speed.SWAY_LIMIT, "short turns between two fixes make 0.41 at most of 22 drawn vehicles",
          after=("dvl_axes",)),
    Check("heading_unit", "unit of the heading", "yaw rate", gyro.heading_unit, gyro.STILL_SHARE,
          "share of the turns by the yaw rate; no gyro is off by a factor of three"),
    Check("gyro_axes", "axes of the gyro", "heading", gyro.gyro_axes, gyro.LEAST_FOLLOWED,
          "share of the turns by the heading; heel and pitch take a few per cent"),
    Check("yaw_rate_scale", "scale and sign of the yaw rate", "heading or course",
          gyro.by_heading, None,
          "no gyro is 7 % off; heel makes 2 to 6 %, 3 % is told where roll and pitch are logged",
          "heading_gyro_gain", after=("heading_unit", "gyro_axes")),
    Check("yaw_rate_offset", "offset of the yaw rate", "heading", gyro.offset_by_heading,
          gyro.OFFSET_LIMIT, "share of the largest yaw rate; gyros drift by much less",
          after=("heading_unit", "gyro_axes")),
    Check("yaw_rate_unit", "unit of the yaw rate", "speed and hull length", gyro.yaw_rate_unit,
          gyro.MAX_YAW_RATE, "the tightest AUVs turn at r L / u = 1.2"),
    Check("rudder_sign", "sign of the rudder", "turns", rudder.rudder_sign, None,
          "97 of 100 rows say the same where it is right"),
    Check("rudder_unit", "unit of the rudder", "turns, and stops of fins", rudder.rudder_unit,
          rudder.MOST_RUDDER_RAD, "fins are stopped at 20 to 35 degrees"),
    Check("rudder_scale", "scale of the rudder", "fins of the vehicle file", rudder.rudder_scale,
          rudder.GAIN_LIMIT, "logarithm; three standard deviations over drawn vehicles",
          after=("dvl_axes",)),
    Check("rudder_offset", "zero of the rudder", "moments of yaw", rudder.rudder_offset,
          rudder.OFFSET_LIMIT_DEG, "degrees; one propeller and an uneven hull need one or two",
          after=("dvl_axes", "gyro_axes")),
    Check("rudder_cut", "range of the rudder", "turns at its largest angle", rudder.rudder_cut,
          rudder.CUT_SPREAD, "turns at one rudder are alike, but for current and sides",
          after=("rudder_offset",)),
    Check("rudder_stuck", "the rudder where it stands still", "yaw rate", rudder.rudder_stuck,
          rudder.SWING, "a settled turn does not swing"),
    Check("pitch_sign", "sign and scale of pitch and depth", "speed and rate of depth",
          heave.pitch_by_depth, heave.SCALE_LIMIT, "the water and the roll take part",
          after=("dvl_axes", "surge_sign")),
    Check("heave_sign", "sign of w", "rate of depth", heave.heave_by_depth, None,
          "four standard deviations", after=("pitch_sign",)),
    Check("pitch_rate_scale", "scale and sign of the pitch rate", "pitch", heave.pitch_rate,
          heave.RATE_LIMIT, "roll takes part", after=("pitch_sign",)),
    Check("speed_by_depth", "scale of the speed within 5 %", "rate of depth", heave.speed_by_depth,
          heave.SPEED_LIMIT, "twice the worst of 21 drawn clean logs",
          after=("dvl_axes", "speed_by_position", "pitch_sign", "heave_sign", "pitch_rate_scale")),
    Check("heave_scale", "scale of w", "rate of depth", heave.heave_scale, heave.HEAVE_LIMIT,
          "more than twice the worst of 30 drawn vertical trials",
          after=("dvl_axes", "pitch_sign", "heave_sign", "speed_by_position", "speed_by_depth")),
    Check("elevator_unit", "unit of the elevator", "pitch rates, and stops of fins",
          elevator.elevator_unit, elevator.MOST_RUDDER_RAD,
          "fins are stopped at 20 to 35 degrees", channel="elevator_rad"),
    Check("elevator_scale", "scale of the elevator", "fins of the vehicle file",
          elevator.elevator_scale, elevator.GAIN_LIMIT,
          "logarithm; three standard deviations over drawn vehicles",
          after=("dvl_axes", "speed_by_position", "pitch_sign", "pitch_rate_scale",
                 "elevator_unit"), channel="elevator_rad"),
    Check("elevator_cut", "range of the elevator", "moments at its largest angle",
          elevator.elevator_cut, elevator.CUT_SPREAD,
          "moments at one elevator are alike; 1.11 at most of 30 drawn trials",
          after=("dvl_axes", "pitch_sign", "pitch_rate_scale", "elevator_unit"),
          channel="elevator_rad"),
    Check("elevator_stuck", "the elevator where it stands still", "moments of pitch",
          elevator.elevator_stuck, elevator.STUCK_SHARE,
          "share of its usual range; 0.22 at most of 30 drawn trials",
          after=("dvl_axes", "pitch_sign", "pitch_rate_scale", "elevator_unit"),
          channel="elevator_rad"),
)
# fmt: on


def run_checks(seen: Seen) -> tuple[tuple[CheckMade, ...], list[Finding]]:
    """Every row of the table on one trial, and a finding for each contradiction.

    Inputs alone, of a maneuver that is still to be flown, are not tested.
    """
    if not set(NEEDED) <= set(seen.trial.table.columns):
        return (), []
    made: list[CheckMade] = []
    found: list[Finding] = []
    for check in CHECKS:
        if check.channel and not seen.has(check.channel):
            continue
        wrong = {row.name for row in made if row.outcome == "contradicts"}
        before = next((name for name in check.after if name in wrong), "")
        said = untested(f"see {before}") if before else check.test(seen)
        made.append(
            CheckMade(
                name=check.name,
                what=check.what,
                against=check.against,
                outcome=said.outcome,
                value=_finite(said.value),
                low=_finite(said.low),
                high=_finite(said.high),
                limit=check.limit,
                message=said.message,
                remedy=said.remedy,
                fix=said.fix,
                only=said.only,
                within=_finite(said.within),
            )
        )
        if said.outcome == "contradicts":
            found.append(_finding(check, made[-1], seen.raw.name))
    return tuple(made), found


def _finite(x: float | None) -> float | None:
    """A number as the artifact may have it; what cannot be told is none."""
    return float(x) if x is not None and math.isfinite(x) else None


def _finding(check: Check, made: CheckMade, trial: str) -> Finding:
    """The finding of a contradiction, with the way out."""
    fix = f" Fix: --fix {made.name}." if made.fix else ""
    return Finding(
        code=check.finding,
        message=made.message,
        where=f"trial {trial}",
        value=made.value,
        threshold=made.limit,
        remedy=made.remedy + fix,
    )
