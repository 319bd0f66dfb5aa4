"""Unit and scale of the elevator, and elevators that are cut off or stuck, by the moments.

What the rudder's checks read from turns is read here from the balance of moments, of
`auvident.stages.ingest.moments`.
"""

import numpy as np

from auvident.schema.logs import DEG
from auvident.schema.planes import VERTICAL
from auvident.stages.ingest.checks.correction import scaled
from auvident.stages.ingest.checks.row import (
    Ratio,
    Verdict,
    agrees,
    coarsely,
    contradicts,
    untested,
)
from auvident.stages.ingest.checks.rudder import (
    MOST_RUDDER_RAD,
    NEAR_RATIO,
    SCALES,
    SMALL_RUDDER_RAD,
)
from auvident.stages.ingest.checks.seen import BRISK, Array, Seen
from auvident.stages.ingest.checks.speed import MIN_SAMPLES, TURNING
from auvident.stages.ingest.checks.steering import steering
from auvident.stages.ingest.moments import HeldFin
from auvident.stages.ingest.still import is_still

NO_STEPS = "no vertical zigzags or steps that show the elevator"
# q L / u, 95 % quantile on straight ways: 0.12 at least of 38 drawn vertical trials, 0.05 at most
# of 35 horizontal ones, where an autopilot keeps the depth
MIN_PITCH_RATE = 0.08
MOST_PITCH_RATE = 1.0  # beyond that it is the gyro that is wrong
LEAST_EXPLAINED = 0.5  # of the variance of the pitch acceleration
LEAST_ALONE = 0.1  # of it by the elevator: 0.35 at least of 38 drawn vertical trials
SURE_SHARE = 0.3  # standard deviation of the response, of itself: a larger one tells nothing
# Pitch acceleration by the elevator over that of the estimate, drawn vehicles of even seeds:
# median and standard deviation of its logarithm; fins that are deflected are less effective than
# the estimate has them.
USUAL_GAIN, GAIN_STD = 0.64, 0.27
GAIN_LIMIT = 3.0 * GAIN_STD
# What pitches less may be damped more: a hull with the published coefficients of the REMUS, which
# are quadratic in the pitch rate, answers with 0.2 of what is usual, the sample of it with 0.5.
# Only what lies two standard deviations below the first is accused.
DAMPED_GAIN = 0.2
LEAST_GAIN = float(np.exp(np.log(DAMPED_GAIN) - 2.0 * GAIN_STD))
ALIKE = 0.02  # of the largest angle: holds at one extreme
LEAST_HOLDS = 6
CUT_SPREAD = (
    1.3  # of the middle 80 %: 1.11 at most of clean trials, 1.5 to 2.5 of ones cut at 5 deg
)
# swing of the angle that the moments show, of the usual range of the elevator: 0.22 at most of
# clean trials, 0.8 and more where its log stands for a minute
STUCK_SHARE = 0.5
STUCK_LENGTHS, STUCK_S = 5.0, 10.0  # shorter holds are those of a zigzag


def elevator_unit(seen: Seen) -> Verdict:
    """Pitching needs some degrees of elevator, and fins have stops."""
    rate, angles = _straight(seen)
    if rate.size < MIN_SAMPLES:
        return untested(NO_STEPS)
    most = float(np.quantile(rate, 0.95))
    largest, usual = float(angles.max()), float(np.quantile(angles, 0.98))
    moves = not is_still(seen.columns("elevator_rad")[0])
    if MIN_PITCH_RATE < most <= MOST_PITCH_RATE and largest < SMALL_RUDDER_RAD:
        return contradicts(
            f"the vehicle pitches although the elevator stays within {largest / DEG:.2f} degrees; "
            "it looks stuck, or like radians in a _deg column",
            largest,
            "Give the column the suffix of its unit, or state the unit in a map (--map).",
            scaled(1.0 / DEG, "elevator_rad") if moves else "",
        )
    if usual > MOST_RUDDER_RAD:
        return contradicts(
            f"the elevator is laid to {usual / DEG:.0f} degrees; fins stall at 20 to 30: a "
            "servo's angle or twice that of the fins?",
            usual,
            "Check unit and scale of the elevator.",
        )
    if most < MIN_PITCH_RATE:
        return untested(NO_STEPS)
    return agrees("the elevator has angles that fins have", largest)


def _straight(seen: Seen) -> tuple[Array, Array]:
    """q L / u and elevator angles, both without their sign, on straight ways at speed."""
    u, q, r, elevator = seen.columns("u_mps", "q_radps", "r_radps", "elevator_rad")
    rows = (u > BRISK * seen.way_mps) & (np.abs(r) * seen.length_m < TURNING * u)
    return np.abs(q[rows]) * seen.length_m / u[rows], np.abs(elevator[rows])


def elevator_scale(seen: Seen) -> Verdict:
    """Pitch acceleration by the elevator against the estimate."""
    if not seen.vehicle.hull.is_body_of_revolution:
        return untested("fins are estimated from geometry for bodies of revolution only")
    own = steering(seen, VERTICAL)
    if own is None or own.by_fin == 0.0:
        return untested("no estimate of the fins from the vehicle file")
    if seen.pitching is None or not _shown(seen):
        return untested(NO_STEPS)
    found = seen.pitching.relation
    gain = float(found.theta[0]) / own.by_fin
    if gain <= 0.0:
        return untested("the elevator pitches the vehicle the other way")
    ratio = Ratio(gain / USUAL_GAIN, GAIN_STD)
    if abs(ratio.log) <= GAIN_LIMIT:
        words = "the elevator pitches the vehicle as its fins should"
        return coarsely(ratio.verdict("agrees", words), ratio.untold(GAIN_LIMIT))
    apart = {name: abs(np.log(ratio.value / scale)) for name, scale in SCALES.items()}
    named = min(apart, key=lambda name: apart[name])
    words = (
        f"the elevator pitches the vehicle {ratio.value:.2f} times as much as the fins of the "
        "vehicle file should"
    )
    if LEAST_GAIN < ratio.value < 1.0:
        return untested(f"{words}: its damping, [[fin]], or the scale of the elevator?")
    fix = scaled(SCALES[named], "elevator_rad") if apart[named] < NEAR_RATIO else ""
    return ratio.verdict(
        "contradicts",
        f"{words}{f'; {named}' if fix else ''}",
        "Check unit and scale of the elevator, and [[fin]] of the vehicle file.",
        fix,
    )


def _shown(seen: Seen, sure_share: float = SURE_SHARE) -> bool:
    """Whether the moments show the elevator: one that only keeps a depth answers to the pitch."""
    rate, _ = _straight(seen)
    if rate.size < MIN_SAMPLES or np.quantile(rate, 0.95) < MIN_PITCH_RATE:
        return False
    if seen.pitching is None:
        return False
    found = seen.pitching.relation
    sure = abs(found.theta_std[0]) <= sure_share * abs(found.theta[0])
    return bool(sure and found.explained >= LEAST_EXPLAINED and found.alone[0] >= LEAST_ALONE)


def elevator_cut(seen: Seen) -> Verdict:
    """At one and the same elevator all moments are alike; else the log has cut the angle off."""
    if seen.pitching is None or not _shown(seen):
        return untested(NO_STEPS)
    top = max((abs(h.angle) for h in seen.pitching.holds), default=0.0)
    alike = [h for h in seen.pitching.holds if abs(h.angle) >= (1.0 - ALIKE) * top]
    if len(alike) < LEAST_HOLDS:
        return untested("too few moves to the largest elevator")
    shown = np.array([np.median(h.shown) * np.sign(h.angle) for h in alike])
    low, high = np.quantile(shown, (0.1, 0.9))
    ratio = float(high / low) if low > 0.0 else np.inf
    if ratio < CUT_SPREAD:
        return agrees("the moments at the largest elevator are alike", ratio)
    return contradicts(
        f"the moments of pitch at the same elevator of {top / DEG:.1f} degrees differ by a factor "
        f"of {ratio:.2f}: the log looks cut off there",
        ratio,
        "Check the range of the elevator's log; angles beyond it are lost.",
    )


def elevator_stuck(seen: Seen) -> Verdict:
    """An elevator that is held makes one moment; what pitches the vehicle on is another one.

    A log that stands still for a minute spoils the balance itself, which need not be sure here.
    """
    if seen.pitching is None or not _shown(seen, np.inf):
        return untested(NO_STEPS)
    least_s = max(STUCK_S, STUCK_LENGTHS * seen.passage_s)
    long = [h for h in seen.pitching.holds if h.end_s - h.start_s >= least_s and h.shown.size > 1]
    if not long:
        return untested("the elevator is never held for long")
    worst = max(long, key=_swing)
    share = _swing(worst) / seen.pitching.usual
    if share < STUCK_SHARE:
        return agrees("the moments do not swing while the elevator is held", share)
    return contradicts(
        f"the vehicle pitches as if the elevator moved by {_swing(worst) / DEG:.0f} degrees while "
        f"it stands at {worst.angle / DEG:.1f} degrees from {worst.start_s:.0f} to "
        f"{worst.end_s:.0f} s: the log of the elevator looks stuck",
        share,
        "Check the log of the elevator there, or leave the stretch out.",
    )


def _swing(hold: HeldFin) -> float:
    return float(np.ptp(hold.shown))
