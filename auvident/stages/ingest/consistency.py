"""Channels held against each other and against the vehicle: wrong units that look possible."""

from collections.abc import Iterator

import numpy as np

from auvident.schema.artifacts import Finding
from auvident.schema.logs import DEG, RawTrial
from auvident.schema.trial import Trial
from auvident.schema.vehicle import Vehicle

MIN_SPEED_MPS = 0.2  # ratios to a smaller speed are noise
MIN_RPM = 10.0  # a propeller that turns slower is stopped
MIN_SAMPLES = 50  # fewer are no evidence
MAX_YAW_RATE = 2.0  # r L / u: a turn on half a hull length; the tightest AUVs reach about 1.2
MIN_YAW_RATE = 0.01  # r L / u of a circle of 100 lengths: less with a deflected rudder is no turn
MIN_TURN_RATE = 0.1  # r L / u of a circle of 10 lengths: needs a rudder of some degrees
SMALL_RUDDER_RAD = 1.5 * DEG  # largest deflection that can hardly turn a vehicle so
LARGE_RUDDER_RAD = 4.0 * DEG  # deflection that must turn it
MAX_ADVANCE = 2.0  # u / (n D): marine propellers give no thrust beyond about 1.5
MIN_ADVANCE = 0.1  # a propeller that drives a hull moves forward
SWAY_SLOPE = 0.1  # v / (r L) midship: hulls drift outward in a turn, about -0.2 to -0.5
SPEED_RATIO = 0.35  # relative difference of DVL and position speed that no current explains
TRACK_S = 20.0  # over which the track is compared: long against the noise of a position fix


def check_consistency(raw: RawTrial, trial: Trial, vehicle: Vehicle) -> list[Finding]:
    """Findings on units and signs that single channels cannot show.

    Each names the figure and the limit; nothing is corrected.
    """
    return [
        found.model_copy(update={"where": f"trial {raw.name}"})
        for check in (_surge, _sway, _yaw_rate, _advance, _track)
        for found in check(trial, vehicle)
    ]


def _columns(trial: Trial, *names: str) -> list[np.ndarray]:
    """Columns of the rows where all are known; empty when one is absent."""
    if not set(names) <= set(trial.table.columns):
        return [np.empty(0) for _ in names]
    table = trial.table[list(names)].to_numpy(dtype=float)
    return list(table[np.isfinite(table).all(axis=1)].T)


def _surge(trial: Trial, vehicle: Vehicle) -> Iterator[Finding]:
    u, rpm = _columns(trial, "u_mps", "rpm")
    ahead = rpm > MIN_RPM
    if ahead.sum() >= MIN_SAMPLES and np.median(u[ahead]) < -MIN_SPEED_MPS:
        yield Finding(
            code="surge_sign",
            message="u is mostly negative while the propeller turns ahead",
            value=float(np.median(u[ahead])),
            threshold=-MIN_SPEED_MPS,
            remedy="Check the axes of the DVL (u forward, v starboard) and the sign of rpm; "
            "sign = -1 in a map (--map) flips a column.",
        )


def _sway(trial: Trial, vehicle: Vehicle) -> Iterator[Finding]:
    u, v, r = _columns(trial, "u_mps", "v_mps", "r_radps")
    length = vehicle.hull.length_m
    turning = (np.abs(r) * length > MIN_TURN_RATE * np.abs(u)) & (u > MIN_SPEED_MPS)
    if turning.sum() < MIN_SAMPLES:
        return
    yaw = r[turning] * length
    slope = float((v[turning] - vehicle.dvl.x_m * r[turning]) @ yaw / (yaw @ yaw))
    if slope > SWAY_SLOPE:
        yield Finding(
            code="sway_sign",
            message=f"the vehicle drifts into its turns (v = {slope:+.2f} r L)",
            value=slope,
            threshold=SWAY_SLOPE,
            remedy="Check that v is positive to starboard, and [dvl] x_m; sign = -1 in a map "
            "(--map) flips a column.",
        )


def _yaw_rate(trial: Trial, vehicle: Vehicle) -> Iterator[Finding]:
    u, r, rudder = _columns(trial, "u_mps", "r_radps", "rudder_rad")
    moving = np.abs(u) > MIN_SPEED_MPS
    if moving.sum() < MIN_SAMPLES:
        return
    rate = np.abs(r[moving]) * vehicle.hull.length_m / np.abs(u[moving])
    most, largest = float(np.quantile(rate, 0.95)), float(np.abs(rudder[moving]).max())
    if most > MAX_YAW_RATE:
        yield Finding(
            code="yaw_rate_unit",
            message=f"yaw rates reach {most:.3g} speeds per hull length, more than in any "
            "turn; r looks like degrees per second in a _radps column",
            value=most,
            threshold=MAX_YAW_RATE,
            remedy="Give the column the suffix of its unit, or state the unit in a map (--map).",
        )
    if most > MIN_TURN_RATE and largest < SMALL_RUDDER_RAD:
        yield Finding(
            code="rudder_unit",
            message=f"the vehicle turns although the rudder stays within {largest / DEG:.2f} "
            "degrees; rudder looks like radians in a _deg column",
            value=largest,
            threshold=SMALL_RUDDER_RAD,
            remedy="Give the column the suffix of its unit, or state the unit in a map (--map).",
        )
    deflected = np.abs(rudder[moving]) > LARGE_RUDDER_RAD
    if deflected.sum() >= MIN_SAMPLES and np.quantile(rate[deflected], 0.9) < MIN_YAW_RATE:
        yield Finding(
            code="yaw_rate_unit",
            message="the vehicle hardly turns with the rudder deflected; r looks like rad/s in a "
            "_degps column, or is not the yaw rate",
            value=float(np.quantile(rate[deflected], 0.9)),
            threshold=MIN_YAW_RATE,
            remedy="Check the unit and column of r, and the unit of the rudder.",
        )


def _advance(trial: Trial, vehicle: Vehicle) -> Iterator[Finding]:
    u, rpm = _columns(trial, "u_mps", "rpm")
    driven = (np.abs(rpm) > 1.0) & (np.abs(u) > MIN_SPEED_MPS)
    if vehicle.propeller is None or driven.sum() < MIN_SAMPLES:
        return
    turns = np.abs(rpm[driven]) / 60.0
    advance = float(np.median(np.abs(u[driven]) / (turns * vehicle.propeller.diameter_m)))
    if advance > MAX_ADVANCE:
        fault = "rev/s in an rpm column" if advance > 10 * MAX_ADVANCE else "u in knots or cm/s"
        yield _advance_finding(advance, MAX_ADVANCE, fault)
    elif advance < MIN_ADVANCE:
        yield _advance_finding(advance, MIN_ADVANCE, "motor rather than propeller rpm (gear ratio)")


def _advance_finding(advance: float, limit: float, fault: str) -> Finding:
    return Finding(
        code="advance_ratio",
        message=f"u / (n D) is {advance:.3g}; looks like {fault}, or a wrong propeller diameter",
        value=advance,
        threshold=limit,
        remedy="Check the units of rpm and u and [propeller] diameter_m.",
    )


def _track(trial: Trial, vehicle: Vehicle) -> Iterator[Finding]:
    """Length of the track by position fixes and by the DVL."""
    names = ("time_s", "u_mps", "v_mps", "north_m", "east_m")
    time, u, v, north, east = _columns(trial, *names)
    step = round(TRACK_S * trial.rate_hz)
    if time.size < 4 * step:
        return
    first = np.arange(0, time.size - step, step)
    whole = np.abs(time[first + step] - time[first] - TRACK_S) < 0.5 / trial.rate_hz
    fixes = np.hypot(north[first + step] - north[first], east[first + step] - east[first])
    course = np.convolve(np.hypot(u, v), np.ones(step) / step, mode="valid")[first] * TRACK_S
    far = whole & (course > TRACK_S * MIN_SPEED_MPS)
    straight = far & (_turned(trial, names)[first + step] < 0.5) if far.any() else far
    if straight.sum() < 4:
        return
    ratio = float(np.median(fixes[straight] / course[straight]))
    if abs(ratio - 1.0) > SPEED_RATIO:
        yield Finding(
            code="speed_position_ratio",
            message=f"the vehicle travels {ratio:.2f} times as fast by its position as by its "
            "DVL (1.94 or 0.51 would be knots for m/s)",
            value=ratio,
            threshold=1.0 + SPEED_RATIO,
            remedy="Check the units of u, v and of the position; a DVL in water-track mode "
            "does not measure the current.",
        )


def _turned(trial: Trial, names: tuple[str, ...]) -> np.ndarray:
    """Yaw angle in rad turned over the last `TRACK_S` at the rows where all names are known."""
    known = np.isfinite(trial.table[list(names)].to_numpy(dtype=float)).all(axis=1)
    rate = np.nan_to_num(trial.table["r_radps"].to_numpy(dtype=float))[known]
    yaw = np.cumsum(rate) / trial.rate_hz
    step = round(TRACK_S * trial.rate_hz)
    return np.abs(yaw - np.concatenate((np.zeros(min(step, yaw.size)), yaw[:-step])))
