"""Clocks of the sensors against that of the gyro, from what the vehicle did.

Signs: a lag above 0 says that the stamps of a sensor are late, what happened at t is stamped
t + lag. A correction is what has to be added to the stamps, the negative of the lag, as
``time_offset_s`` and ``time_drift_ppm`` of a map; the offset is that at the median of the stamps.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from auvident.constants import NORMAL_95
from auvident.errors import ContradictionError
from auvident.schema.artifacts import Finding
from auvident.schema.channels import SENSORS
from auvident.schema.logs import Alignment, CheckMade, RawTrial, moved_stamps
from auvident.schema.trial import Trial
from auvident.schema.vehicle import Vehicle
from auvident.stages.ingest.checks.row import FAR_OFF, Outcome
from auvident.stages.ingest.clocks_estimate import ClockLag, Lags, passage_s
from auvident.stages.ingest.clocks_judged import estimate_clocks

PREFIX = "clock_"
DRIFT_PREFIX = "drift_"
# What the rate of depth is reckoned from, and what a clock of the depth is called
RATE_OF_DEPTH = ("pitch_sign", "heave_sign", "heave_scale")
OF_THE_DEPTH, LATE_DEPTH = (PREFIX + "depth", DRIFT_PREFIX + "depth"), "depth_lags_gyro"
DRIFT_S = 0.15  # gained from the middle to the end: 0.3 s over a trial, as `LATE_S`
REFUSED = ("gyro", "dvl", "rudder", "elevator", "rpm")  # what the equations take
# A lag of these that is longer leaves nothing to identify; what is shorter a delay in the model
# of the sensors takes up.
REFUSED_S, REFUSED_LENGTHS = 2.0, 1.5


@dataclass(frozen=True)
class Limit:
    """Lags that are no fault of a clock: late, and early by a time and by L/U."""

    late_s: float
    early_s: float
    early_lengths: float = 0.0

    def of(self, lag_s: float, passage: float) -> float:
        """Limit on the side of a lag."""
        return self.late_s if lag_s >= 0 else self.early_s + self.early_lengths * passage


# What a right clock, and one without drift, leave unexplained over what the lag does, at least.
# Clocks of clean trials of even seeds whose interval is beyond the limit have 1.16 and 1.05 at
# most; those that are off by 1 s or 1000 ppm hardly ever less than 1.3 and 1.1.
EVIDENT, EVIDENT_DRIFT = 1.25, 1.1
# A command is early by the lag of its servo or motor; 0.6 s and L/U of a servo, two and a half of
# a motor and its water jet are those that the diagnosis knows as effects.
LIMITS: Mapping[str, Limit] = {
    "gyro": Limit(0.3, 0.3),
    "attitude": Limit(0.1, 0.1),  # pure kinematics: a step of a 10 Hz log
    "dvl": Limit(0.3, 0.3),  # averaging and a bus take up to that
    "rudder": Limit(0.3, 0.6, 1.0),
    "elevator": Limit(0.3, 0.6, 1.0),
    "rpm": Limit(0.6, 0.6, 2.5),
    "depth": Limit(0.5, 0.5),  # filters of pressure gauges
    "position": Limit(0.5, 0.5),  # travel time of the sound
}
NOT_SURE = ", if that is not chance: more turns, zigzags or steps would tell"
NOT_KINEMATIC = (
    ", if that is not chance or a hull that answers otherwise than most: more turns and zigzags, "
    "or position or depth in the log, would tell"
)
TO_CHECK = (
    "Only the equations of motion say so: check how the {0} is stamped. If its clock is wrong, a "
    "map puts it right: "
)
EITHER = (
    "It may as well be the {1}, which nothing in the log tells: check how both are stamped. If it "
    "is the {0}, a map puts it right: "
)
CLOSELY_S = 0.6  # a clock known to that is tested; the diagnosis estimates delays
NOTED_S = {"rudder": 0.6, "elevator": 0.6}  # a slow servo that is worth a line, of whatever cause


@dataclass(frozen=True)
class Clocks:
    """What the trial says about the clocks of its sensors."""

    checks: tuple[CheckMade, ...]
    findings: tuple[Finding, ...]
    alignment: tuple[Alignment, ...]


def check_clocks(raw: RawTrial, trial: Trial, vehicle: Vehicle) -> Clocks:
    """Offset and drift of the clock of each sensor; nothing is corrected.

    Parameters
    ----------
    raw : RawTrial
        For the names of files and the stamps.
    trial : Trial
        The same on one clock.
    vehicle : Vehicle
    """
    lags = estimate_clocks(raw, trial, vehicle, _may_be_off)
    passage = passage_s(trial, vehicle)
    checks: list[CheckMade] = []
    findings: list[Finding] = []
    for sensor in (s for s in LIMITS if s in raw.sensors):
        found = lags.of.get(sensor)
        if found is not None:
            made = _checks(raw, sensor, found, passage)
            checks += made
            findings += _findings(raw, sensor, found, made, passage)
        elif sensor != "gyro":
            checks.append(_untested(sensor, lags))
    return Clocks(tuple(checks), tuple(findings), _alignment(lags))


def _may_be_off(sensor: str, found: ClockLag, passage: float) -> bool:
    """Whether the interval of the offset, or that of the drift, lies beyond its limit."""
    late = _excess_s(sensor, found, passage, found.std_s) > 0.0
    return late or _drifts(found, found.gain_std_s)


def _is_off(sensor: str, found: ClockLag, passage: float) -> bool:
    """Whether besides a right clock would leave clearly more unexplained.

    Where sway and yaw go hand in hand all the time, an equation that leaves something out fits a
    little better with a lag, and every block of the trial says so.
    """
    late = _excess_s(sensor, found, passage, found.sure_std_s) > 0.0 and found.right >= EVIDENT
    drifts = _drifts(found, found.sure_gain_std_s)
    return late or (drifts and found.steady >= EVIDENT_DRIFT)


def _excess_s(sensor: str, found: ClockLag, passage: float, std_s: float) -> float:
    """So far the interval of the lag lies beyond the limit [s]."""
    limit = LIMITS[sensor].of(found.lag_s, passage)
    return abs(found.lag_s) - NORMAL_95 * std_s - limit


def _drifts(found: ClockLag, std_s: float) -> bool:
    return abs(found.gain_s) - NORMAL_95 * std_s > DRIFT_S


def refuse_clocks(raw: RawTrial, vehicle: Vehicle, trial: Trial, clocks: Clocks) -> None:
    """Refuse a trial in which a sensor that the equations take is seconds off.

    Raises
    ------
    ContradictionError
        With what would correct it.
    """
    limit = max(REFUSED_S, REFUSED_LENGTHS * passage_s(trial, vehicle))
    for check in clocks.checks:
        sensor = check.name.removeprefix(PREFIX)
        if sensor not in REFUSED or check.outcome != "contradicts":
            continue
        ends = [abs(x) for x in (check.low, check.high) if x is not None]
        if min(ends, default=0.0) > limit + (check.limit or 0.0):
            remedy = check.remedy
            if not check.fix:
                remedy += f" --fix {check.name} does the same."
            raise ContradictionError(
                check.message, raw.sensors[sensor].file, remedy, check.name, check.fix_if_asked
            )


def not_of_the_depth(
    checks: Sequence[CheckMade], findings: Sequence[Finding], made: Sequence[CheckMade]
) -> tuple[tuple[CheckMade, ...], tuple[Finding, ...]]:
    """Clocks and their findings without those of the depth, where pitch or w is what contradicts.

    The rate of depth that a w of the wrong sign or scale makes fits the depth better with a lag,
    and moved stamps would be a second fault.

    Parameters
    ----------
    checks, findings : sequence
        Of the clocks.
    made : sequence of CheckMade
        Of signs and scales.
    """
    wrong = next(
        (c.name for c in made if c.name in RATE_OF_DEPTH and c.outcome == "contradicts"), ""
    )
    if not wrong:
        return tuple(checks), tuple(findings)
    blank = {"low": None, "high": None, "remedy": "", "fix": "", "fix_if_asked": ""}
    blank |= {"outcome": "untested", "value": None, "message": f"see {wrong}"}
    return (
        tuple(
            c.model_copy(update=blank)
            if c.name in OF_THE_DEPTH and c.outcome == "contradicts"
            else c
            for c in checks
        ),
        tuple(f for f in findings if f.code != LATE_DEPTH),
    )


def _checks(raw: RawTrial, sensor: str, found: ClockLag, passage: float) -> list[CheckMade]:
    off = _is_off(sensor, found, passage)
    unsure = not off and _may_be_off(sensor, found, passage)
    lag_s, ppm = _untold(sensor, found, passage)
    only = "" if off else _coarsely(lag_s, ppm, found.half_s)
    spread, fix = NORMAL_95 * found.std_s, correction(raw, sensor, found) if off else (0.0, 0.0)
    value = f"{fix[0]:.3f}, {fix[1]:.0f}" if off else ""
    offset = CheckMade(
        name=PREFIX + sensor,
        what=f"clock of the {sensor}",
        against="; ".join(found.against),
        outcome=_outcome(off, unsure),
        value=found.lag_s,
        low=found.lag_s - spread,
        high=found.lag_s + spread,
        limit=LIMITS[sensor].of(found.lag_s, passage),
        message=_message(sensor, found, off or unsure) + (_not_sure(found) if unsure else ""),
        remedy=_remedy(sensor, found, *fix) if off else "",
        fix=value if found.kinematic and not found.instead else "",
        fix_if_asked=value,
        only=only,
        within=lag_s if only and np.isfinite(lag_s) else None,
    )
    if not np.isfinite(found.gain_std_s):
        return [offset]
    drifts = off and _drifts(found, found.sure_gain_std_s)
    within = ppm if only and np.isfinite(ppm) else None
    return [offset, _drift_check(sensor, found, _outcome(drifts, unsure), only, within)]


def _drift_check(
    sensor: str, found: ClockLag, outcome: Outcome, only: str, within: float | None
) -> CheckMade:
    ppm = 1e6 / found.half_s
    low, high = (found.gain_s + k * NORMAL_95 * found.gain_std_s for k in (-1, 1))
    return CheckMade(
        name=DRIFT_PREFIX + sensor,
        what=f"clock of the {sensor}",
        against="; ".join(found.against),
        outcome=outcome,
        value=found.gain_s * ppm,
        low=low * ppm,
        high=high * ppm,
        limit=DRIFT_S * ppm,
        message=f"the {sensor} gains {found.gain_s * ppm:.0f} ppm on {_reference(sensor)} "
        f"(95 %: {low * ppm:.0f} to {high * ppm:.0f})",
        remedy=f"See {PREFIX + sensor}." if outcome == "contradicts" else "",
        only=only,
        within=within,
    )


def _untold(sensor: str, found: ClockLag, passage: float) -> tuple[float, float]:
    """Lag (s) and drift (ppm) of a clock up to which nothing would be said."""
    limit = max(LIMITS[sensor].of(side, passage) for side in (-1.0, 1.0))
    gain_s = DRIFT_S + NORMAL_95 * found.sure_gain_std_s
    return limit + NORMAL_95 * found.sure_std_s, 1e6 * gain_s / found.half_s


def _coarsely(lag_s: float, ppm: float, half_s: float) -> str:
    """How coarsely a clock was tested, in words; empty where closely."""
    if max(lag_s, 1e-6 * ppm * half_s) <= CLOSELY_S:
        return ""
    drift = f"{ppm:.0f} ppm" if np.isfinite(ppm) else "any drift"
    return f"to {lag_s:.1f} s and {drift}" if np.isfinite(lag_s) else FAR_OFF


def _outcome(off: bool, unsure: bool) -> Outcome:
    if off:
        return "contradicts"
    return "untested" if unsure else "agrees"


def _message(sensor: str, found: ClockLag, off: bool) -> str:
    low, high = (found.lag_s + k * NORMAL_95 * found.std_s for k in (-1, 1))
    if not off:
        return (
            f"the {sensor} is on the clock of the gyro: {found.lag_s:+.2f} s (95 %: {low:+.2f} to "
            f"{high:+.2f}); smaller delays are left to the diagnosis"
        )
    if found.lag_s < 0.0:
        low, high = -high, -low
    side = "late" if found.lag_s >= 0.0 else "early"
    words = (
        f"the time stamps of the {sensor} are {abs(found.lag_s):.2f} s {side} against "
        f"{_reference(sensor)} (95 %: {low:.2f} to {high:.2f})"
    )
    if _drifts(found, found.gain_std_s):
        ppm = 1e6 / found.half_s
        words += f" in the middle of the trial, and drift by {found.gain_s * ppm:+.0f} ppm"
    return words


def _reference(sensor: str) -> str:
    return "all other sensors" if sensor == "gyro" else "the gyro"


def _not_sure(found: ClockLag) -> str:
    return NOT_SURE if found.kinematic else NOT_KINEMATIC


def _remedy(sensor: str, found: ClockLag, offset_s: float, drift_ppm: float) -> str:
    """A correction is proposed where kinematics has measured it; else the clock is to be looked at.

    What a hull outside of the population does looks like a lag, and a correction spoils its model.
    """
    table = f"[{sensor}] time_offset_s = {offset_s:.3f}"
    if drift_ppm:
        table += f", time_drift_ppm = {drift_ppm:.0f}"
    if found.instead:
        return EITHER.format(sensor, found.instead) + table + "."
    if not found.kinematic:
        return TO_CHECK.format(sensor) + table + "."
    return f"Apply it with --fix {PREFIX}{sensor}, or in a map (--map): {table}."


def _untested(sensor: str, lags: Lags) -> CheckMade:
    return CheckMade(
        name=PREFIX + sensor,
        what=f"clock of the {sensor}",
        against="the gyro",
        outcome="untested",
        message=lags.missing.get(sensor, "nothing in the log to compare it with"),
    )


def _findings(
    raw: RawTrial, sensor: str, found: ClockLag, made: list[CheckMade], passage: float
) -> list[Finding]:
    check = made[0]
    noted = abs(found.lag_s) - NORMAL_95 * found.std_s > NOTED_S.get(sensor, np.inf)
    if check.outcome != "contradicts" and not noted:
        return []
    command = sensor in ("rudder", "elevator", "rpm")
    remedy = check.remedy or "A slow servo, or clocks that differ: the diagnosis tests both."
    message = check.message if check.remedy else f"gyro lags {sensor} by {-found.lag_s:.2f} s"
    return [
        Finding(
            code=f"gyro_lags_{sensor}" if command else f"{sensor}_lags_gyro",
            message=message,
            where=f"trial {raw.name}",
            value=-found.lag_s if command else found.lag_s,
            threshold=check.limit if check.remedy else NOTED_S[sensor],
            remedy=remedy,
        )
    ]


def _alignment(lags: Lags) -> tuple[Alignment, ...]:
    found = []
    for sensor, lag in lags.of.items():
        command = sensor in ("rudder", "elevator", "rpm")
        found.append(
            Alignment(
                first=sensor if command else "gyro",
                second="gyro" if command else sensor,
                lag_s=-lag.lag_s if command else lag.lag_s,
                std_s=lag.std_s,
                explained=lag.explained,
            )
        )
    return tuple(found)


# --- corrections --------------------------------------------------------------------------


def correction(raw: RawTrial, sensor: str, found: ClockLag) -> tuple[float, float]:
    """What has to be added to the stamps: offset in s at their median, and drift in ppm."""
    drift = -found.gain_s / found.half_s if _drifts(found, found.gain_std_s) else 0.0
    stamps = raw.sensors[sensor].time_s
    away = float(np.nanmedian(stamps)) - found.at_s
    return -found.lag_s + drift * away, 1e6 * drift


def apply_clock(raw: RawTrial, sensor: str, offset_s: float, drift_ppm: float) -> RawTrial:
    """A trial with the stamps of one sensor moved.

    Parameters
    ----------
    raw : RawTrial
    sensor : str
    offset_s : float
        Added to the stamps, at their median.
    drift_ppm : float
        Added per s from there, in 1e-6 s.
    """
    own = raw.sensors[sensor]
    moved = replace(own, time_s=moved_stamps(own.time_s, offset_s, drift_ppm))
    return replace(raw, sensors={**raw.sensors, sensor: moved})


def corrected(raw: RawTrial, name: str, fix: str) -> RawTrial:
    """Apply the correction that a check of a clock proposes: its name, offset and drift."""
    offset_s, drift_ppm = (float(x) for x in fix.split(","))
    return apply_clock(raw, name.removeprefix(PREFIX), offset_s, drift_ppm)


FIXES = frozenset(PREFIX + sensor for sensor in SENSORS)  # names of the checks with a correction
