"""Scale of the rudder, and rudders that are cut off or stuck, by what the vehicle does."""

import numpy as np

from auvident.schema.logs import DEG
from auvident.stages.ingest.checks.correction import less, scaled
from auvident.stages.ingest.checks.gyro import MAX_YAW_RATE
from auvident.stages.ingest.checks.row import (
    Figure,
    Ratio,
    Verdict,
    agrees,
    coarsely,
    contradicts,
    untested,
)
from auvident.stages.ingest.checks.seen import BRISK, MIN_SPEED_MPS, Seen
from auvident.stages.ingest.checks.speed import MIN_SAMPLES
from auvident.stages.ingest.checks.steering import steering
from auvident.stages.ingest.held import SettledHold, settled_holds
from auvident.stages.ingest.moments import HeldFin
from auvident.stages.ingest.still import is_still

MIN_TURN_RATE = 0.1  # r L / u of a circle of 10 lengths: needs a rudder of some degrees
SMALL_RUDDER_RAD = 1.5 * DEG  # largest deflection that can hardly turn a vehicle so
MOST_RUDDER_RAD = 38.0 * DEG  # fins stall long before, and are stopped at 20 to 35 degrees
LEAST_EXPLAINED = 0.5  # of the variance of the yaw acceleration
# Turning gain over that of the estimate, 140 drawn vehicles: median and standard deviation of
# its logarithm; the estimate has fins that are deflected too effective by a third.
USUAL_GAIN, GAIN_STD = 0.76, 0.29
GAIN_LIMIT = 3.0 * GAIN_STD
LEAST_DAMPING = 0.3  # of the estimate's: a hull that hardly holds its course tells nothing
SCALES = {
    "twice the angle of the fins?": 0.5,
    "half the angle of the fins?": 2.0,
    "radians logged as degrees?": 1.0 / DEG,
    "degrees logged as radians?": DEG,
}
NEAR_RATIO = 0.5  # logarithm, of a named scale
ALIKE = 0.02  # of the largest angle: holds at one extreme
LEAST_HOLDS = 3
# Least share, in the logarithm, that the yaw rates have in what bends apart. Where the angle was
# cut off, r = U / R, and the speed falls by less than the radius; a current leaves the rates as
# they are (a share of 0.1 in a drawn trial whose turns bent apart by 1.34).
RATE_SHARE = 0.5
SETTLED = 0.3  # range of the curvature of a turn over its median: zigzags of a slow ship have more
CUT_SPREAD = 1.3  # ratio of turns at one and the same rudder; 1.06 at most of 15 trials
LEAST_BALANCED = 0.6  # of the variance of the yaw acceleration
# Rudder at which the moments of yaw vanish: 0.22 degrees at most of 40 drawn clean trials; a single
# propeller and a hull that is not symmetric need one or two. The diagnosis estimates what is less.
OFFSET_LIMIT_DEG = 2.5
SURE_STDS = 3.0
LEAST_HELD_S = 4.0  # shorter is what a smoothed zigzag leaves of a leg
# Way of the rudder by the moments from the one that is held, of its usual range: 0.43 at most of
# 150 drawn clean trials, 0.7 to 2.6 in 21 of 30 whose log stands still for 40 s.
STUCK_SHARE = 0.5
STUCK_REMEDY = "Check the log of the rudder there, or leave the stretch out."
SWING = 0.25  # r L / u: a change of the turn that a rudder that is held does not make


def rudder_unit(seen: Seen) -> Verdict:
    """Turns need some degrees of rudder, and fins have stops."""
    u, r, rudder = seen.columns("u_mps", "r_radps", "rudder_rad")
    moving = np.abs(u) > MIN_SPEED_MPS
    if moving.sum() < MIN_SAMPLES:
        return untested("the vehicle hardly moves")
    rate = np.abs(r[moving]) * seen.length_m / np.abs(u[moving])
    most, largest = float(np.quantile(rate, 0.95)), float(np.abs(rudder[moving]).max())
    if MIN_TURN_RATE < most <= MAX_YAW_RATE and largest < SMALL_RUDDER_RAD:
        return _turns_without(largest, stands=is_still(rudder))
    usual = float(np.quantile(np.abs(rudder[moving]), 0.98))
    if usual > MOST_RUDDER_RAD:
        return contradicts(
            f"the rudder is laid to {usual / DEG:.0f} degrees; fins stall at 20 to 30: a servo's "
            "angle or twice that of the fins?",
            usual,
            "Check unit and scale of the rudder.",
        )
    return agrees("the rudder has angles that fins have", largest)


def _turns_without(largest: float, *, stands: bool) -> Verdict:
    if stands:
        return contradicts(
            f"the vehicle turns although the rudder stands at {largest / DEG:.2f} degrees "
            "throughout: the log of the rudder looks stuck, or is not connected",
            largest,
            "Check the log of the rudder.",
        )
    return contradicts(
        f"the vehicle turns although the rudder stays within {largest / DEG:.2f} "
        "degrees; rudder looks like radians in a _deg column",
        largest,
        "Give the column the suffix of its unit, or state the unit in a map (--map).",
        scaled(1.0 / DEG, "rudder_rad"),
    )


def rudder_sign(seen: Seen) -> Verdict:
    """Which way the rudder turns the vehicle; the other way than stated has been refused."""
    if seen.sign is None or seen.sign.sign >= 0:
        return untested("no turns with the rudder held, or steps of it")
    return agrees("the rudder turns the vehicle as [signs] says")


def rudder_scale(seen: Seen) -> Verdict:
    """Turning gain, yaw acceleration by the rudder over that by the rate, against the estimate."""
    if not seen.vehicle.hull.is_body_of_revolution:
        return untested("fins are estimated from geometry for bodies of revolution only")
    own, found = steering(seen), seen.rudder
    if own is None or own.by_fin == 0.0 or own.by_rate >= 0.0:
        return untested("no estimate of the fins from the vehicle file")
    if found is None or found.explained < LEAST_EXPLAINED:
        return untested("no maneuvers that show what the rudder does")
    if found.theta[1] / own.by_rate < LEAST_DAMPING or found.theta[0] / own.by_fin <= 0.0:
        return untested("a vehicle that hardly holds its course does not show it")
    gain = found.theta[0] / found.theta[1] / (own.by_fin / own.by_rate)
    ratio = Ratio(float(gain) / USUAL_GAIN, GAIN_STD)
    if abs(ratio.log) <= GAIN_LIMIT:
        words = "the rudder turns the vehicle as its fins should"
        return coarsely(ratio.verdict("agrees", words), ratio.untold(GAIN_LIMIT))
    apart = {name: abs(np.log(ratio.value / scale)) for name, scale in SCALES.items()}
    named = min(apart, key=lambda name: apart[name])
    fix = scaled(SCALES[named], "rudder_rad") if apart[named] < NEAR_RATIO else ""
    return ratio.verdict(
        "contradicts",
        f"the rudder turns the vehicle {ratio.value:.2f} times as much as the fins of the vehicle "
        f"file should{f'; {named}' if fix else ''}",
        "Check unit and scale of the rudder, and [[fin]] of the vehicle file.",
        fix,
    )


def rudder_offset(seen: Seen) -> Verdict:
    """The rudder at which the vehicle runs straight, by the balance of the moments of yaw."""
    if seen.yawing is None or seen.yawing.relation.explained < LEAST_EXPLAINED:
        return untested("no maneuvers that show what the rudder does")
    angle, std = seen.yawing.relation.derived(lambda theta: -theta[..., -1] / theta[..., 0])
    offset = Figure(seen.vehicle.rudder_sign * float(angle) / DEG, float(std) / DEG)
    if not np.isfinite(offset.value + offset.std):
        return untested("the rudder does not show in the moments")
    if abs(offset.value) <= OFFSET_LIMIT_DEG + SURE_STDS * offset.std:
        return offset.verdict("agrees", "the vehicle runs straight with the rudder amidships")
    return offset.verdict(
        "contradicts",
        f"the vehicle runs straight with the rudder at {offset.value:+.1f} degrees",
        "Check the zero of the rudder and the trim of the vehicle; --fix takes the angle off the "
        "log, the diagnosis estimates it as rudder offset.",
        less(offset.value * DEG, "rudder_rad"),
    )


def rudder_cut(seen: Seen) -> Verdict:
    """At one and the same rudder all turns are alike; else the log has cut the angle off.

    Over ground a current bends the path of one turn more than that of another, while the yaw
    rates are alike. Where the angle was cut off they differ, too, if by less: a vehicle that turns
    more tightly goes more slowly.
    """
    holds = [h for h in settled_holds(seen.trial, seen.length_m, seen.way_mps) if h.angle]
    top = max((abs(h.angle) for h in holds), default=0.0)
    settled = [h for h in holds if h.swing <= SETTLED * abs(h.bend) and h.bend * h.angle < 0.0]
    alike = [h for h in settled if abs(h.angle) >= (1.0 - ALIKE) * top]
    if len(alike) < LEAST_HOLDS:
        return untested("too few turns at the largest rudder")
    least, *_, most = sorted(alike, key=lambda h: abs(h.bend))
    ratio = abs(most.bend / least.bend)
    over_ground = seen.vehicle.dvl.reference == "ground"
    if over_ground and abs(most.rate) < ratio**RATE_SHARE * abs(least.rate):
        return agrees("turns at the largest rudder have yaw rates that are alike", ratio)
    if ratio < CUT_SPREAD:
        return agrees("turns at the largest rudder are alike", ratio)
    return contradicts(
        f"turns at the same rudder of {top / DEG:.1f} degrees differ by a factor of {ratio:.2f}: "
        "the log looks cut off there",
        ratio,
        "Check the range of the rudder's log; angles beyond it are lost.",
    )


def rudder_stuck(seen: Seen) -> Verdict:
    """A rudder that is held makes one turn; a vehicle that turns otherwise has another rudder."""
    holds: list[SettledHold] = settled_holds(seen.trial, seen.length_m, BRISK * seen.way_mps)
    worst = max(holds, key=lambda h: h.contrary, default=None)
    if worst is not None and worst.contrary >= SWING:
        return contradicts(
            f"the yaw rate swings by {worst.contrary:.2f} u / L while the rudder stands at "
            f"{worst.angle / DEG:.1f} degrees from {worst.start_s:.0f} to {worst.end_s:.0f} s: "
            "the log of the rudder looks stuck",
            worst.contrary,
            STUCK_REMEDY,
        )
    shown = _stuck_by_moments(seen)
    if shown is not None:
        return shown
    if worst is None:
        return untested("the rudder is never held for long")
    return agrees("the vehicle does not swing while the rudder is held", worst.contrary)


def _stuck_by_moments(seen: Seen) -> Verdict | None:
    """A hold in which the moments of yaw show another rudder; None where there is none."""
    if seen.yawing is None or seen.yawing.relation.explained < LEAST_BALANCED:
        return None
    long = [h for h in seen.yawing.holds if h.end_s - h.start_s >= LEAST_HELD_S and h.shown.size]
    worst = max(long, key=_away, default=None)
    if worst is None or _away(worst) < STUCK_SHARE * seen.yawing.usual:
        return None
    angle = worst.shown[int(np.argmax(np.abs(worst.shown - worst.angle)))]
    return contradicts(
        f"the vehicle turns as if the rudder were at {angle / DEG:.0f} degrees while it stands at "
        f"{worst.angle / DEG:.1f} degrees from {worst.start_s:.0f} to {worst.end_s:.0f} s: the log "
        "of the rudder looks stuck",
        _away(worst) / seen.yawing.usual,
        STUCK_REMEDY,
    )


def _away(hold: HeldFin) -> float:
    """Most that the rudder by the moments departs from the one that is held, beyond its scatter.

    A slow servo is still on its way to it when the hold begins; one whose log is stuck was there.
    """
    off = np.abs(hold.shown - hold.angle)
    return float(np.max(off - np.minimum.accumulate(off) - hold.shown_std))
