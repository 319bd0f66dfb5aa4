"""Scale and sign of the yaw rate: against the heading, or against the course by position."""

import numpy as np

from auvident.schema.logs import DEG
from auvident.stages.ingest.checks.correction import less, mixed, scaled
from auvident.stages.ingest.checks.reckoned import HEADING, is_integrated, is_reckoned
from auvident.stages.ingest.checks.row import Figure, Verdict, agrees, contradicts, untested
from auvident.stages.ingest.checks.seen import MIN_SPEED_MPS, Seen
from auvident.stages.ingest.checks.speed import MIN_SAMPLES
from auvident.stages.ingest.checks.track import course_gain
from auvident.stages.ingest.response import (
    Relation,
    Signals,
    fit_relation,
    heading_rate,
    kept_on_the_grid,
    shifted,
    smooth_records,
)
from auvident.stages.ingest.still import is_still

GAIN_LIMIT = 0.07  # gyro against heading: heel makes 2 to 6 %, drawn vehicles 1 % at most
# ... with roll, pitch and q taken into account: 0.7 % is the worst of 43 drawn clean trials
ATTITUDE_LIMIT = 0.03
LEAST_COS_PITCH = 0.5  # beyond 60 degrees of pitch the heading is not what turns
OFFSET_LIMIT = 0.03  # of the largest yaw rate; 0.0006 is the worst of 30 drawn trials
COURSE_LIMIT = 0.15  # against the course: the drift angle changes along a turn
SURE_STDS = 3.0
MARGIN_S = 2.0  # for shifting, and as in the other checks
LEAST_EXPLAINED = 0.4  # of the variance of the rate of the heading
LEAST_FOLLOWED, FOLLOWED = 0.3, 0.7  # of its turns, by the yaw rate, and by another rate instead
LEAST_TURN = 0.05  # rad in the time of a length, standard deviation: less is noise
CLEAR_TURN = 0.1  # the same by the yaw rate
STILL_SHARE = 0.3  # of it by the heading; 1.00 to 1.03 of 24 drawn trials, 0.05 to 0.13 in radians
OTHER_RATES = {"p_radps": "p and r", "q_radps": "q and r"}
MAX_YAW_RATE = 2.0  # r L / u: a turn on half a hull length; the tightest AUVs reach about 1.2
MIN_YAW_RATE = 0.01  # r L / u of a circle of 100 lengths: less with a deflected rudder is no turn
LARGE_RUDDER_RAD = 4.0 * DEG  # deflection that must turn it


def gyro_axes(seen: Seen) -> Verdict:
    """The heading turns with r, not with another rate of the gyro."""
    if not np.isfinite(seen.passage_s) or not seen.has("heading_rad"):
        return untested("no heading, or the vehicle hardly moves")
    own = _followed(seen, "r_radps")
    if not np.isfinite(own):
        return untested("the heading hardly turns, or not for long")
    if own >= LEAST_FOLLOWED:
        return agrees("the heading turns with r", own)
    others = {name: _followed(seen, name) for name in OTHER_RATES if seen.has(name)}
    best = max(others, key=lambda name: others[name], default="")
    if not others or not others[best] > FOLLOWED:
        return contradicts(
            f"the heading turns, but not with r (which explains {100 * own:.0f} % of it): one of "
            "them overflows, is stuck, is of another axis or is seconds late",
            own,
            "Plot heading and r; leave the heading out if it is the one that is wrong.",
        )
    return contradicts(
        f"the heading turns with {best[0]}, not with r: {OTHER_RATES[best]} of the gyro look "
        "exchanged",
        own,
        "Check the axes of the gyro; a map (--map) names other columns.",
        mixed({"r_radps": (1.0, best), best: (1.0, "r_radps")}),
    )


def _followed(seen: Seen, name: str) -> float:
    """Share of the variance of the turns by the heading that a rate explains; NaN without turns."""
    by_rate, turned = _turns(seen, name)
    if turned.size < MIN_SAMPLES or np.std(turned) < LEAST_TURN:
        return np.nan
    if is_still(by_rate):  # a rate that stands still explains nothing
        return 0.0
    return float(np.corrcoef(by_rate, turned)[0, 1] ** 2)


def _turns(seen: Seen, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Angles turned in the times of a length of way, by a rate and by the heading (rad)."""
    rate, heading = seen.whole(name), seen.whole("heading_rad")
    step = max(round(seen.passage_s * seen.trial.rate_hz), 1)
    size = (rate.size - 1) // step * step
    by_rate = rate[:size].reshape(-1, step).mean(axis=1) * step / seen.trial.rate_hz
    turned = np.angle(np.exp(1j * np.diff(heading[: size + 1 : step])))
    known = np.isfinite(by_rate + turned)
    return by_rate[known], turned[known]


def heading_unit(seen: Seen) -> Verdict:
    """A heading that hardly turns while the gyro does is of another unit."""
    if not np.isfinite(seen.passage_s) or not seen.has("heading_rad"):
        return untested("no heading, or the vehicle hardly moves")
    by_rate, turned = _turns(seen, "r_radps")
    if turned.size < MIN_SAMPLES:
        return untested("heading and r are known together for too short a time")
    if np.std(by_rate) < CLEAR_TURN:
        return untested("over the whole log the vehicle turns too little")
    share = float(np.std(turned) / np.std(by_rate))
    if share >= STILL_SHARE:
        return agrees("the heading turns with the vehicle", share)
    clear = np.abs(by_rate) > CLEAR_TURN
    usual = float(np.median(turned[clear] / by_rate[clear]))  # few of them have a wrap in them
    radians = 0.5 * DEG < usual < 2.0 * DEG
    return contradicts(
        f"the heading turns by {usual:.3f} of what the yaw rate says"
        f"{'; radians logged as degrees?' if radians else ''}",
        share,
        "Give the heading the suffix of its unit, or state the unit in a map (--map).",
        scaled(1.0 / DEG, "heading_rad") if radians else "",
    )


def by_heading(seen: Seen) -> Verdict:
    """Rate of the heading over the yaw rate, else that of the course."""
    found = seen.heading
    if found is None or found.explained < LEAST_EXPLAINED:
        return _by_course(seen)
    if is_integrated(found):
        course = untested(HEADING) if is_reckoned(seen) else _by_course(seen)
        return untested(HEADING) if course.outcome == "untested" else course
    gain, limit = Figure.of(found), GAIN_LIMIT
    turning = _turning(seen, found.lag_s)
    if turning is not None:
        # A roll of the wrong sign makes the one reading worse and leaves the other.
        gain, limit = min(Figure.of(turning), gain, key=_apart), ATTITUDE_LIMIT
    told = limit + SURE_STDS * gain.std
    if _apart(gain) <= told:
        words = f"the heading changes at the yaw rate (tested to {100.0 * told:.0f} %)"
        return gain.verdict("agrees", words)
    if _kept(seen) - told <= gain.value < 1.0:
        return untested("the steps of --rate are long against the turns")
    return gain.verdict(
        "contradicts",
        f"the heading changes at {gain.value:.2f} times the yaw rate",
        "Check units and scale of gyro and heading.",
        scaled(gain.value, "r_radps"),
    )


def _apart(gain: Figure) -> float:
    return abs(gain.value - 1.0)


def _kept(seen: Seen) -> float:
    """What the grid keeps of the turns."""
    records = smooth_records(seen.trial, {"r": "r_radps", "u": "u_mps"}, MARGIN_S)
    return kept_on_the_grid(records, "r", lambda s: np.abs(s["u"]) > seen.way_mps)


def _turning(seen: Seen, lag_s: float) -> Relation | None:
    """d(heading)/dt = k (q sin(roll) + r cos(roll)) / cos(pitch) + c; None without these."""
    columns = {"r": "r_radps", "q": "q_radps", "roll": "roll_rad", "pitch": "pitch_rad"}
    columns |= {"heading": "heading_rad"}
    if not seen.has(*columns.values()):
        return None

    def relation(s: Signals, lag: float) -> tuple[np.ndarray, np.ndarray]:
        q, r = (shifted(s, name, lag) for name in ("q", "r"))
        rate = heading_rate(q, r, s["roll"], s["pitch"])
        return s["heading_dot"], np.column_stack((rate, np.ones_like(rate)))

    def use(s: Signals) -> np.ndarray:
        return np.cos(s["pitch"]) > LEAST_COS_PITCH

    records = smooth_records(seen.trial, columns, MARGIN_S)
    return fit_relation(records, relation, (lag_s, lag_s), use)


def offset_by_heading(seen: Seen) -> Verdict:
    """Yaw rate of a vehicle whose heading stays."""
    found = seen.heading
    if found is None or found.explained < LEAST_EXPLAINED:
        return untested("no heading, or it hardly turns")
    if is_integrated(found):
        return untested(HEADING)
    gain, rest = found.theta
    offset = Figure(-float(rest / gain), float(found.theta_std[1] / abs(gain)))
    rate = np.abs(seen.columns("r_radps")[0])
    limit = OFFSET_LIMIT * float(np.quantile(rate, 0.99)) + SURE_STDS * offset.std
    if abs(offset.value) <= limit:
        return offset.verdict("agrees", "the heading stays where the yaw rate is zero")
    return offset.verdict(
        "contradicts",
        f"the yaw rate has an offset of {offset.value / DEG:+.2g} deg/s where the heading stays",
        "Take the bias of the gyro off, as --fix does.",
        less(offset.value, "r_radps"),
    )


def _by_course(seen: Seen) -> Verdict:
    gain = course_gain(seen)
    if gain is None:
        return untested("no heading, and no turns with positions")
    if abs(gain.value - 1.0) <= COURSE_LIMIT + SURE_STDS * gain.std:
        told = 100.0 * (COURSE_LIMIT + SURE_STDS * gain.std)
        return gain.verdict("agrees", f"the course turns at the yaw rate (tested to {told:.0f} %)")
    return gain.verdict(
        "contradicts",
        f"the course by position turns at {gain.value:.2f} times the yaw rate",
        "Check unit, sign and scale of r.",
        scaled(gain.value, "r_radps"),
    )


def yaw_rate_unit(seen: Seen) -> Verdict:
    """Turns are neither tighter than any vehicle's nor absent with the rudder laid."""
    u, r, rudder = seen.columns("u_mps", "r_radps", "rudder_rad")
    moving = np.abs(u) > MIN_SPEED_MPS
    if moving.sum() < MIN_SAMPLES:
        return untested("the vehicle hardly moves")
    rate = np.abs(r[moving]) * seen.length_m / np.abs(u[moving])
    most = float(np.quantile(rate, 0.95))
    if most > MAX_YAW_RATE:
        return contradicts(
            f"yaw rates reach {most:.3g} speeds per hull length, more than in any "
            "turn; r looks like degrees per second in a _radps column",
            most,
            "Give the column the suffix of its unit, or state the unit in a map (--map).",
            scaled(DEG, "r_radps"),
        )
    laid = np.abs(rudder[moving]) > LARGE_RUDDER_RAD
    share = float(np.quantile(rate[laid], 0.9)) if laid.sum() >= MIN_SAMPLES else np.inf
    if share < MIN_YAW_RATE:
        return _hardly_turns(share, stands=is_still(r))
    return agrees("yaw rates are those of a vehicle that turns", most)


def _hardly_turns(share: float, *, stands: bool) -> Verdict:
    if stands:
        return contradicts(
            "the yaw rate stands still while the rudder is deflected: the log of the gyro looks "
            "stuck, or is not connected",
            share,
            "Check the log of the gyro.",
        )
    return contradicts(
        "the vehicle hardly turns with the rudder deflected; r looks like rad/s in a "
        "_degps column, or is not the yaw rate",
        share,
        "Check the unit and column of r, and the unit of the rudder.",
        scaled(1.0 / DEG, "r_radps"),
    )
