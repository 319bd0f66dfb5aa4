"""Axes of the DVL: swapped, turned, of the wrong sign, or those of the earth."""

from collections.abc import Callable

import numpy as np

from auvident.schema.logs import DEG
from auvident.stages.ingest.checks.correction import EARTH, EARTH_SWAPPED, mixed
from auvident.stages.ingest.checks.row import Figure, Verdict, agrees, contradicts, untested
from auvident.stages.ingest.checks.seen import MIN_SPEED_MPS, Seen
from auvident.stages.ingest.checks.speed import MIN_RPM, MIN_SAMPLES, SURE_STDS, tracked

SIDEWAYS = 1.5  # |v| over |u| of a vehicle whose long axis is not where the log has it
PIECE_LENGTHS = 4.0  # of way, over which the velocity turns with the heading
LEAST_TURNED, LEAST_PIECES = 0.3, 8  # rad; pieces
EARTHLY, BODILY = 0.7, 0.35  # turn of the velocity over that of the heading; of a drift below 0.3
TURNING = 0.1  # r L / u: a circle of ten lengths
SWAY_SLOPE = 0.1  # v / (r L): hulls drift outward in a turn, about -0.2 to -0.5
# As read at the DVL, over r L: a column without the yaw rate, one that has clearly more, the usual
STILL, CLEARLY, USUAL_DRIFT = 0.08, 3.0, -0.3
LEAST_STRAIGHTS = 6  # twice as many as unknowns: a share of u and two components of a current
STRAIGHTS = "needs straight stretches on several courses"
SURE_SHARE = 0.03  # standard deviation of v / u: 2 degrees
ONE_COURSE = 10.0  # condition of the equations: on one course a current looks the same
HALVES = 2.0  # the stretches overlap by half
YAW_LIMIT_DEG = 6.0  # what is smaller the diagnosis estimates
TURNED_LIMIT = np.radians(20.0)  # no DVL is mounted so far off unless it says so
REMEDY = (
    "Check the axes of the DVL (u forward, v starboard, w down); a map (--map) names other "
    "columns, sign = -1 in it flips one."
)


def drift_slope(seen: Seen, ahead: str, aside: str) -> float | None:
    """Sway per yaw rate and length in turns, at the origin; None without turns."""
    u, v, r = seen.columns(ahead, aside, "r_radps")
    turning = (np.abs(r) * seen.length_m > TURNING * np.abs(u)) & (np.abs(u) > MIN_SPEED_MPS)
    if turning.sum() < MIN_SAMPLES:
        return None
    yaw = r[turning] * seen.length_m
    return float((v[turning] - seen.vehicle.dvl.x_m * r[turning]) @ yaw / (yaw @ yaw))


def velocity_turn(seen: Seen) -> float | None:
    """Turn of the velocity over that of the vehicle: 0 in its axes, 1 or -1 in the earth's."""
    u, v, r = (seen.whole(name) for name in ("u_mps", "v_mps", "r_radps"))
    speed, rate = np.hypot(u, v), seen.trial.rate_hz
    moving = speed[speed > seen.way_mps]
    if moving.size < MIN_SAMPLES:
        return None
    step = max(round(PIECE_LENGTHS * seen.length_m / float(np.median(moving)) * rate), 2)
    good = np.where(speed > seen.way_mps, r, np.nan)
    size = (u.size - 1) // step * step
    ends, starts = np.arange(step, size + 1, step), np.arange(0, size, step)
    turned = _turned(good, starts, ends, rate)
    velocity = u + 1j * v
    change = np.angle(velocity[ends] * np.conj(velocity[starts]))
    rows = np.isfinite(turned) & np.isfinite(change)
    rows &= (np.abs(turned) > LEAST_TURNED) & (np.abs(turned) < 2.5)
    if rows.sum() < LEAST_PIECES:
        return None
    return float(np.median(change[rows] / turned[rows]))


def _turned(rate: np.ndarray, starts: np.ndarray, ends: np.ndarray, hz: float) -> np.ndarray:
    """Angle turned in each piece, NaN where a row of it is unknown or slow."""
    total = np.concatenate(([0.0], np.cumsum(np.nan_to_num(rate)) / hz))
    unknown = np.concatenate(([0], np.cumsum(~np.isfinite(rate))))
    whole = unknown[ends] == unknown[starts]
    return np.where(whole, total[ends] - total[starts], np.nan)


def dvl_axes(seen: Seen) -> Verdict:
    """Whether u points ahead and v to starboard, by motion and, where logged, position."""
    return _by_motion(seen) or _by_track(seen)


def _by_motion(seen: Seen) -> Verdict | None:
    """A contradiction of the axes that needs no position, or None."""
    return _earthly(seen) or _sideways(seen) or _vertical(seen)


def _earthly(seen: Seen) -> Verdict | None:
    turn = velocity_turn(seen)
    if turn is None or abs(turn) < EARTHLY:
        return None
    order, fix = ("north and east", EARTH) if turn > 0.0 else ("east and north", EARTH_SWAPPED)
    return contradicts(
        f"the velocity vector turns with the heading ({turn:+.2f} of it): u and v look like "
        f"{order}, not ahead and starboard",
        turn,
        "Log the velocity in vehicle axes, or turn it by the heading.",
        fix if seen.has("heading_rad") else "",
    )


def _sideways(seen: Seen) -> Verdict | None:
    u, v, rpm = seen.columns("u_mps", "v_mps", "rpm")
    moving = (np.hypot(u, v) > seen.way_mps) & (np.abs(rpm) > MIN_RPM)
    if moving.sum() < MIN_SAMPLES:
        return None
    ahead, aside = float(np.median(np.abs(u[moving]))), float(np.median(np.abs(v[moving])))
    if aside < SIDEWAYS * ahead:
        return None
    side = float(np.sign(np.median(v[moving])))
    slope = drift_slope(seen, "v_mps", "u_mps")
    sway = 1.0 if slope is None or slope < 0.0 else -1.0
    how = "swapped" if side * sway > 0.0 and side > 0.0 else "turned by 90 degrees"
    return contradicts(
        f"the vehicle moves sideways: |v| is {aside / max(ahead, 1e-3):.3g} times |u| under way; "
        f"u and v look {how}",
        aside / max(ahead, 1e-3),
        REMEDY,
        mixed({"u_mps": (side, "v_mps"), "v_mps": (sway, "u_mps")}),
    )


def _vertical(seen: Seen) -> Verdict | None:
    """v and w swapped: what drifts in turns stands in w; a DVL at the pivot cannot tell."""
    if not seen.has("w_mps"):
        return None
    aside, down = (drift_slope(seen, "u_mps", name) for name in ("v_mps", "w_mps"))
    if aside is None or down is None:
        return None
    arm = seen.vehicle.dvl.x_m / seen.length_m
    in_v, in_w = abs(aside + arm), down + arm  # as read, where the DVL sits
    if abs(in_w) < STILL or in_v > STILL or abs(in_w) < CLEARLY * in_v:
        return None
    sign = min((1.0, -1.0), key=lambda s: abs(s * in_w - arm - USUAL_DRIFT))
    return contradicts(
        f"w changes with the yaw rate ({in_w:+.2f} r L) and v does not: v and w look swapped",
        in_w,
        REMEDY,
        mixed({"v_mps": (sign, "w_mps"), "w_mps": (sign, "v_mps")}),
    )


def _by_track(seen: Seen) -> Verdict:
    found, turn = tracked(seen), velocity_turn(seen)
    if found is None:
        return (
            untested("no turns under way and no position")
            if turn is None
            else agrees("the velocity keeps its direction in the vehicle while it turns", turn)
        )
    degrees = float(np.degrees(found.turned))
    if abs(found.turned) <= TURNED_LIMIT + np.radians(abs(seen.vehicle.dvl.mounting_yaw_deg)):
        return agrees(f"the track by the DVL is turned by {degrees:+.1f} degrees only", degrees)
    return contradicts(
        f"the track by the DVL is turned by {degrees:+.0f} degrees against that by position",
        degrees,
        "Check the mounting of the DVL ([dvl] mounting_yaw_deg), the heading and its reference.",
    )


def dvl_yaw(seen: Seen) -> Verdict:
    """A DVL that is turned has a share of u in v on straight stretches, whatever the course.

    v = e u + c_east cos(heading) - c_north sin(heading): a current changes with the course.
    """
    known = [w for w in seen.windows if np.isfinite(w.heading_rad + w.sway_mps)]
    if len(known) < LEAST_STRAIGHTS:
        return untested(STRAIGHTS)
    u, v, heading = np.array([(w.speed_mps, w.sway_mps, w.heading_rad) for w in known]).T
    rows = np.column_stack((u, np.cos(heading), -np.sin(heading)))
    inverse = np.linalg.pinv(rows.T @ rows)
    share, *current = (float(x) for x in inverse @ rows.T @ v)
    left = v - rows @ (share, *current)
    std = float(np.sqrt(HALVES * (left @ left) / np.subtract(*rows.shape) * inverse[0, 0]))
    if std > SURE_SHARE or np.linalg.cond(rows / np.array([u.mean(), 1.0, 1.0])) > ONE_COURSE:
        return untested(STRAIGHTS)
    turned = Figure(-float(np.arctan(share)) / DEG - seen.vehicle.dvl.mounting_yaw_deg, std / DEG)
    if abs(turned.value) <= YAW_LIMIT_DEG + SURE_STDS * turned.std:
        return turned.verdict("agrees", "v fades on straight stretches, as it should")
    return turned.verdict(
        "contradicts",
        f"v is {share:+.2f} u on straight stretches of all courses: the DVL looks turned by "
        f"{turned.value:+.0f} degrees against its mounting",
        "Check the mounting of the DVL; [dvl] mounting_yaw_deg in the vehicle file states it "
        f"(here {seen.vehicle.dvl.mounting_yaw_deg + turned.value:.1f}, positive to starboard).",
    )


def _after_axes(test: Callable[[Seen], Verdict]) -> Callable[[Seen], Verdict]:
    """A test of one sign, where the axes as a whole are right."""

    def told(seen: Seen) -> Verdict:
        return untested("see dvl_axes") if _by_motion(seen) else test(seen)

    return told


@_after_axes
def surge_sign(seen: Seen) -> Verdict:
    """The vehicle moves ahead while the propeller turns ahead."""
    u, rpm = seen.columns("u_mps", "rpm")
    ahead = rpm > MIN_RPM
    if ahead.sum() < MIN_SAMPLES:
        return untested("the propeller hardly turns ahead")
    speed = float(np.median(u[ahead]))
    if speed >= -MIN_SPEED_MPS:
        return agrees("u is positive while the propeller turns ahead", speed)
    back = drift_slope(seen, "u_mps", "v_mps")
    both = back is not None and back > SWAY_SLOPE
    terms = {"u_mps": (-1.0, "u_mps")} | ({"v_mps": (-1.0, "v_mps")} if both else {})
    return contradicts(
        "u is mostly negative while the propeller turns ahead"
        + ("; with v, the DVL looks turned by 180 degrees" if both else ""),
        speed,
        "Check the axes of the DVL (u forward, v starboard) and the sign of rpm; "
        "sign = -1 in a map (--map) flips a column.",
        mixed(terms),
    )


@_after_axes
def sway_sign(seen: Seen) -> Verdict:
    """Hulls drift outward in turns."""
    slope = drift_slope(seen, "u_mps", "v_mps")
    if slope is None:
        return untested("no turns of less than ten lengths in radius")
    if slope <= SWAY_SLOPE:
        return agrees("the vehicle drifts outward in its turns", slope)
    return contradicts(
        f"the vehicle drifts into its turns (v = {slope:+.2f} r L)",
        slope,
        "Check that v is positive to starboard, and [dvl] x_m; sign = -1 in a map "
        "(--map) flips a column.",
        mixed({"v_mps": (-1.0, "v_mps")}),
    )
