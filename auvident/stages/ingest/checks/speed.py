"""Scale and sign of speed and propeller rate: against position, propeller and drift in turns."""

from dataclasses import dataclass

import numpy as np

from auvident.schema.logs import KNOT, RPM_OF_RADPS
from auvident.stages.ingest.checks.correction import VELOCITIES, scaled
from auvident.stages.ingest.checks.heave import speed_by_depth
from auvident.stages.ingest.checks.reckoned import POSITION, is_reckoned
from auvident.stages.ingest.checks.row import (
    Figure,
    Ratio,
    Verdict,
    agrees,
    coarsely,
    contradicts,
    untested,
)
from auvident.stages.ingest.checks.seen import MIN_SPEED_MPS, Seen
from auvident.stages.ingest.checks.throttle import (
    SHARE_REMEDY,
    column_of_rpm,
    pulses_remedy,
    rest_us,
    share_of_throttle,
)
from auvident.stages.ingest.checks.track import LEAST_EXPLAINED, TrackFit, sway_gain, track

MIN_RPM = 10.0  # a propeller that turns slower is stopped
STANDS_RPM = 1.0  # a propeller that drives a hull turns faster, also where rev/s were logged
MIN_SAMPLES = 50  # fewer are no evidence
POSITION_LIMIT = 0.05  # DVLs are good to 1 %, lever arms and changing currents add to it
SWAY_LIMIT = 0.45  # sway of small, fast vehicles turns too much between two fixes to be seen
PATH_LIMIT = 0.35  # ratio of the lengths of two tracks, which a current takes part in
SURE_STDS = 3.0
LEAST_BALANCE = 0.35  # logarithm: even a drag and a thrust that are known leave the current
TURNING = 0.1  # r L / u
PIVOT, PIVOT_STD = 0.35, 0.15  # lengths ahead of midships; logarithm, of 150 drawn vehicles
PIVOT_LIMIT = 0.5  # logarithm; the worst of them is 0.42 off
TOLD_APART = 4.0  # difference of chi-square that names one of two
SURELY_EXPLAINED = 0.8  # of a track in the mirror, where the track itself is not even half
# By the quarters that the track in the mirror (east of the other sign) is turned by.
MIRRORS = (
    "east has the other sign",
    "north and east are swapped and have the other sign",
    "north has the other sign",
    "north and east are swapped",
)
UNITS = {
    "knots logged as m/s": KNOT,
    "m/s logged as knots": 1.0 / KNOT,
}
RADPS = "rad/s in an rpm column"
GEARS = {
    "rpm of a motor before a gear of 2": 0.5,
    "rpm of a motor before a gear of 3": 1.0 / 3.0,
    "rpm that counts every second turn": 2.0,
    RADPS: RPM_OF_RADPS,
    "rev/s in an rpm column": 60.0,
}
ONE_RATE = "rpm never changes: thrust and drag cannot be told apart"
LEVELS = 1.3  # ratio of steady speeds over ground that one propeller rate does not make
# Where the current is taken out or does not count: a speed settles within 4 % either way, and in
# so many standard deviations of it from quarter to quarter.
SETTLED_SPREAD, UNRESTS = 0.1, 8.0
WINDOWS_OF_A_CURRENT = 6  # tell a speed and two components of the current
CONSTANT_RPM = 0.01  # of its mean
WINDOW_COUNT = 4
AHEAD_SHARE = 0.9  # of the rows under way


def tracked(seen: Seen) -> TrackFit | None:
    """The fit of the track where the position follows the DVL at all, and is not made of it."""
    found = None if is_reckoned(seen) else track(seen)
    return found if found is not None and found.explained >= LEAST_EXPLAINED else None


def by_position(seen: Seen) -> Verdict:
    """Speed of the DVL against position, the current estimated along."""
    if is_reckoned(seen):
        return untested(POSITION)
    found = tracked(seen)
    if found is None:
        return _mirrored(seen) or _by_path(seen)
    scale = found.scale
    speed = Figure(1.0 / scale.value, scale.std / scale.value**2)
    off = abs(speed.value - 1.0)
    if off <= POSITION_LIMIT + SURE_STDS * speed.std:
        told = POSITION_LIMIT + SURE_STDS * speed.std
        return speed.verdict(
            "agrees", f"the speed agrees with the position (tested to {100 * told:.0f} %)"
        )
    named = _nearest(UNITS, scale.value, 0.1)
    factor = UNITS[named] if named else scale.value
    return speed.verdict(
        "contradicts",
        f"the DVL reads {speed.value:.3g} times the speed by position"
        f"{f'; {named}?' if named else ', current taken out'}",
        "Check the units of u, v and of the position, and the DVL's sound speed.",
        scaled(factor, *_velocities(seen)),
    )


def _mirrored(seen: Seen) -> Verdict | None:
    """A position that follows the DVL as in a mirror: swapped, or one of it of the other sign."""
    found = track(seen, mirrored=True)
    if found is None or found.explained < SURELY_EXPLAINED:
        return None
    words = MIRRORS[round(found.turned / (0.5 * np.pi)) % 4]
    return contradicts(
        f"the position follows heading and speed only as in a mirror: {words}?",
        found.scale.value,
        "Check columns and signs of north and east (a longitude west is negative) in a map "
        "(--map); or heading, r and v count to port, as ROS has them: then turn all three.",
    )


def sway_by_position(seen: Seen) -> Verdict:
    """Sway of the DVL against position: what is far off, or of the wrong sign."""
    found = sway_gain(seen) if tracked(seen) is not None else None
    told = SWAY_LIMIT + SURE_STDS * found.std if found is not None else np.inf
    if found is None or not told < 2.0:
        if is_reckoned(seen):
            return untested(POSITION)
        return untested("no position log that shows the drift in turns")
    if abs(found.value - 1.0) <= told:
        said = found.verdict("agrees", f"v fits the position (tested to {100 * told:.0f} %)")
        smaller = found.value / (1.0 - told) if told < 1.0 else np.inf
        larger = (1.0 + told) / found.value if found.value > 0.0 else np.inf
        return coarsely(said, max(larger, smaller))
    return found.verdict(
        "contradicts",
        f"the vehicle drifts {found.value:+.2f} times as much by its position as by v",
        "Check sign and scale of v, and [dvl] x_m; sign = -1 in a map (--map) flips a column.",
        scaled(-1.0, "v_mps") if found.value < 0.0 else "",
    )


def _by_path(seen: Seen) -> Verdict:
    """Lengths of both tracks, where no heading tells the current apart."""
    ratios = _path_ratios(seen)
    if ratios.size < 4:
        return untested("no position log, or too short")
    ratio = float(np.median(ratios))
    if abs(ratio - 1.0) <= PATH_LIMIT:
        return agrees("the speed agrees with the position (tested to 35 %, no heading)", ratio)
    return contradicts(
        f"the vehicle travels {ratio:.2f} times as fast by its position as by its "
        "DVL (1.94 or 0.51 would be knots for m/s)",
        ratio,
        "Check the units of u, v and of the position; a DVL in water-track mode "
        "does not measure the current.",
        scaled(UNITS.get(_nearest(UNITS, ratio, 0.3), ratio), *_velocities(seen)),
    )


def _path_ratios(seen: Seen) -> np.ndarray:
    """Length by position over length by the DVL, of nearly straight pieces."""
    names = ("time_s", "u_mps", "v_mps", "north_m", "east_m", "r_radps")
    time, u, v, north, east, r = seen.columns(*names)
    rate_hz, piece_s = seen.trial.rate_hz, 20.0
    step = round(piece_s * rate_hz)
    if time.size < 4 * step:
        return np.empty(0)
    first = np.arange(0, time.size - step, step)
    whole = np.abs(time[first + step] - time[first] - piece_s) < 0.5 / rate_hz
    fixes = np.hypot(north[first + step] - north[first], east[first + step] - east[first])
    course = np.convolve(np.hypot(u, v), np.ones(step) / step, mode="valid")[first] * piece_s
    yaw = np.cumsum(r) / rate_hz
    turned = np.abs(yaw[first + step] - yaw[first])
    good = whole & (course > piece_s * MIN_SPEED_MPS) & (turned < 0.5)
    return np.asarray(fixes[good] / course[good])


def _nearest(names: dict[str, float], factor: float, within: float) -> str:
    """The named factor that comes nearest, or nothing."""
    apart = {name: abs(np.log(factor / other)) for name, other in names.items()}
    best = min(apart, key=lambda name: apart[name])
    return best if apart[best] <= within else ""


def _velocities(seen: Seen) -> list[str]:
    return [column for column in VELOCITIES if column in seen.raw.sensors["dvl"].values]


@dataclass(frozen=True)
class Balance:
    """Speed over what the propeller drives the hull to, and who is to blame for a difference."""

    ratio: Ratio
    limit: float
    rpm: float
    speed_mps: float
    blamed: tuple[str, ...]

    @property
    def expected(self) -> str:
        """Ratios that are no contradiction, in words."""
        factor = float(np.exp(self.limit))
        return f"{1 / factor:.2f} to {factor:.2f} expected"


def balance(seen: Seen) -> Balance | None:
    """Steady speed against thrust and drag from geometry; None where either lacks."""
    advance = seen.advance if seen.windows else None
    if advance is None:
        return None
    measured = np.array([w.speed_mps / w.rate_rps for w in seen.windows])
    spread = float(np.std(np.log(measured)) / np.sqrt(measured.size))
    ratio = Ratio(
        float(np.median(measured)) / advance.value, float(np.hypot(advance.log_std, spread))
    )
    limit = max(LEAST_BALANCE, SURE_STDS * ratio.log_std)
    rpm = 60.0 * float(np.median([w.rate_rps for w in seen.windows]))
    speed = float(np.median([w.speed_mps for w in seen.windows]))
    blamed = _blamed(seen, ratio) if abs(ratio.log) > limit else ()
    return Balance(ratio, limit, rpm, speed, blamed)


def _blamed(seen: Seen, ratio: Ratio) -> tuple[str, ...]:
    """Which of speed and propeller rate is off: position or depth tell, else the drift in turns."""
    if rest_us(seen) is not None:
        return ("rpm",)
    found = tracked(seen)
    if found is not None:
        near = abs(np.log(found.scale.value)) < 0.2
        return ("rpm",) if near else ("speed",)
    by_depth = speed_by_depth(seen)
    if by_depth.outcome != "untested":
        return ("rpm",) if by_depth.outcome == "agrees" else ("speed",)
    pivot, otherwise = pivot_ratio(seen), pivot_ratio(seen, 1.0 / ratio.value)
    if pivot is None or otherwise is None:
        return ("speed", "rpm")
    apart = (pivot.log**2 - otherwise.log**2) / PIVOT_STD**2
    if abs(apart) < TOLD_APART:
        return ("speed", "rpm")
    return ("speed",) if apart > 0.0 else ("rpm",)


def _words(found: Balance) -> str:
    return (
        f"u is {found.ratio.value:.2f} times what {found.rpm:,.0f} rpm drive this hull to "
        f"({found.expected})"
    )


REMEDY = "Check the units of u and rpm, a gear, and [hull] and [propeller] of the vehicle file."


def by_propeller(seen: Seen) -> Verdict:
    """Whether the speed is what the propeller drives the hull to."""
    return _held_against(seen, "speed", "rpm", UNITS, scaled_speed=True)


def rpm_by_speed(seen: Seen) -> Verdict:
    """Whether the propeller rate is what the speed asks for."""
    rest = rest_us(seen)
    if rest is not None:
        return contradicts(
            f"rpm is {rest:.0f} where the vehicle stands still: microseconds of a throttle's "
            "pulses (PWM), no rate of a propeller",
            rest,
            pulses_remedy(seen, rest),
        )
    return _held_against(seen, "rpm", "speed", GEARS, scaled_speed=False)


def _held_against(
    seen: Seen, own: str, other: str, names: dict[str, float], scaled_speed: bool
) -> Verdict:
    found = balance(seen)
    if found is None:
        return untested(_why_no_balance(seen))
    if not found.blamed:
        share = 100.0 * (np.exp(found.limit) - 1.0)
        return found.ratio.verdict(
            "agrees", f"speed and rpm fit thrust and drag (tested to {share:.0f} % only)"
        )
    if own not in found.blamed:
        return found.ratio.verdict(
            "agrees", f"{_words(found)}, and the other checks of the {own} point to the {other}"
        )
    wanted = 1.0 / found.ratio.value if scaled_speed else found.ratio.value
    named = _nearest(names, wanted, found.limit)
    share = "" if scaled_speed or named not in ("", RADPS) else share_of_throttle(seen)
    if share and named:  # a slow propeller's rad/s and a throttle's per cent are as large
        named, share = "", f"{share}, or {named}"
    either = f" (or the {other} is off)" if len(found.blamed) > 1 else ""
    guess = f"{named or share or 'a wrong unit, a gear'}? Or another vehicle's file?"
    columns = _velocities(seen) if scaled_speed else ["rpm"]
    return found.ratio.verdict(
        "contradicts",
        f"{_words(found)}; {guess}{either}",
        SHARE_REMEDY.format(column=column_of_rpm(seen)) if share else REMEDY,
        scaled(names[named], *columns) if named else "",
    )


def _why_no_balance(seen: Seen) -> str:
    if seen.vehicle.propeller is None and "T_nn" not in seen.vehicle.coefficients:
        return "no [propeller] in the vehicle file"
    if seen.advance is None:
        return "drag and thrust are not known from the vehicle file"
    return "no straight stretch of ten lengths at steady speed and rpm"


def pivot_ratio(seen: Seen, factor: float = 1.0, side: float = 1.0) -> Ratio | None:
    """Drift per yaw rate in turns, against the usual: the pivot is 0.35 lengths ahead of midships.

    What a hull drifts with in a turn hardly depends on it: speed over yaw rate shows its scale.

    Parameters
    ----------
    seen : Seen
    factor : float
        By which the velocities are multiplied first, as read: the lever arm of the DVL is not.
    side : float
        -1 for a sway of the other sign.
    """
    names, factors = ("u_mps", "v_mps", "r_radps"), (factor, side * factor, 1.0)
    u, v, r = (x * k for x, k in zip(seen.columns(*names), factors, strict=True))
    turning = (np.abs(r) * seen.length_m > TURNING * np.abs(u)) & (u > factor * seen.way_mps)
    if turning.sum() < MIN_SAMPLES:
        return None
    midships = seen.vehicle.body.origin_from_nose_m - 0.5 * seen.length_m
    yaw = r[turning]
    drift = v[turning] + (midships - seen.vehicle.dvl.x_m) * yaw
    ahead = -float(drift @ yaw / (yaw @ yaw)) / seen.length_m
    return Ratio(ahead / PIVOT, PIVOT_STD) if ahead > 0.0 else None


def by_drift(seen: Seen) -> Verdict:
    """Speed against yaw rate by the drift in turns."""
    pivot = pivot_ratio(seen)
    if pivot is None:
        return untested("no turns, or the drift in them is not outward")
    if abs(pivot.log) <= PIVOT_LIMIT:
        share = 100.0 * (np.exp(PIVOT_LIMIT) - 1.0)
        return pivot.verdict(
            "agrees", f"the drift in turns fits speed and yaw rate (to {share:.0f} % only)"
        )
    flipped = pivot_ratio(seen, side=-1.0)
    suspects = [
        _nearest(UNITS, 1.0 / pivot.value, PIVOT_LIMIT),
        "v of the other sign" if flipped and abs(flipped.log) <= PIVOT_LIMIT else "",
        "a scale of v or of the yaw rate, or lengths of another vehicle's file",
    ]
    return pivot.verdict(
        "contradicts",
        f"the drift in turns is {pivot.value:.2f} times the usual for this yaw rate; "
        f"{', '.join(s for s in suspects if s)}?",
        "Check the units of v and r, the sign of v, and in the vehicle file length_m, "
        "origin_from_nose_m and [dvl] x_m.",
    )


def rpm_sign(seen: Seen) -> Verdict:
    """The propeller turns ahead while the vehicle moves ahead."""
    u, rpm = seen.columns("u_mps", "rpm")
    ahead = u > seen.way_mps
    if ahead.sum() < MIN_SAMPLES:
        return untested("the vehicle hardly moves ahead")
    share = float(np.mean(rpm[ahead] < -MIN_RPM))
    if share < AHEAD_SHARE:
        return agrees("the propeller turns ahead where the vehicle moves ahead", share)
    return contradicts(
        f"rpm is negative in {100 * share:.0f} % of the rows in which the vehicle moves ahead",
        share,
        "Check the sign of rpm; sign = -1 in a map (--map) flips a column.",
        scaled(-1.0, "rpm"),
    )


def rpm_varies(seen: Seen) -> Verdict:
    """Speeds of one propeller rate are one speed, and without a propeller there is none."""
    rpm = seen.whole("rpm")
    known = rpm[np.isfinite(rpm)]
    ahead = seen.whole("u_mps")[np.isfinite(rpm)]
    ahead = ahead[ahead > seen.way_mps]
    if known.size and np.abs(known).max() <= STANDS_RPM and ahead.size >= MIN_SAMPLES:
        return _drives_without(float(np.abs(known).max()), float(np.median(ahead)))
    if known.size == 0 or np.ptp(known) > CONSTANT_RPM * abs(known.mean()):
        few = len(seen.windows) < WINDOW_COUNT or known.size == 0
        words = "too few straight stretches at steady speed"
        return untested(words) if few else agrees("rpm changes")
    if len(seen.windows) < WINDOW_COUNT:
        return untested(ONE_RATE)
    speeds, limit = _of_one_rate(seen)
    ratio = float(np.quantile(speeds, 0.95) / np.quantile(speeds, 0.05))
    if ratio < limit:
        return untested(ONE_RATE)
    return contradicts(
        f"rpm never changes, but steady speeds on straight runs differ by a factor of {ratio:.2f}, "
        f"more than {limit:.2f}",
        ratio,
        "Log the rate of the propeller; a constant in its place identifies no thrust.",
    )


def _drives_without(most: float, speed_mps: float) -> Verdict:
    stands = f"at {most:.3g}" if most == 0.0 else f"within {most:.2g}"
    return contradicts(
        f"the vehicle makes {speed_mps:.2g} m/s although rpm stands {stands} throughout: the log "
        "of the propeller looks stuck, or is not connected"
        f"{'' if most == 0.0 else ', or it is a throttle of 0 to 1'}",
        speed_mps,
        "Check the log of rpm; a map (--map) names another column, or the scale of a throttle.",
    )


def _of_one_rate(seen: Seen) -> tuple[np.ndarray, float]:
    """Speeds of the steady windows without what a current adds over ground, and their limit."""
    speeds = np.array([w.speed_mps for w in seen.windows])
    limit = 1.0 + max(SETTLED_SPREAD, UNRESTS * float(np.median([w.unrest for w in seen.windows])))
    if seen.vehicle.dvl.reference == "water":
        return speeds, limit
    course = np.array([w.heading_rad for w in seen.windows])
    if speeds.size < WINDOWS_OF_A_CURRENT or not np.isfinite(course).all():
        return speeds, max(LEVELS, limit)
    x = np.column_stack((np.ones_like(course), np.cos(course), np.sin(course)))
    theta, *_ = np.linalg.lstsq(x, speeds, rcond=None)
    return speeds - x[:, 1:] @ theta[1:], limit


def advance_ratio(seen: Seen) -> Verdict:
    """u / (n D) of a propeller that drives a hull."""
    u, rpm = seen.columns("u_mps", "rpm")
    driven = (np.abs(rpm) > STANDS_RPM) & (np.abs(u) > MIN_SPEED_MPS)
    if seen.vehicle.propeller is None:
        return untested("no [propeller] in the vehicle file")
    if driven.sum() < MIN_SAMPLES:
        moves = (np.abs(u) > MIN_SPEED_MPS).sum() >= MIN_SAMPLES
        why = "the propeller hardly turns" if moves else "the vehicle hardly moves"
        return _at_rest(seen) or untested(why)
    turns = np.abs(rpm[driven]) / 60.0
    advance = float(np.median(np.abs(u[driven]) / (turns * seen.vehicle.propeller.diameter_m)))
    if MIN_ADVANCE <= advance <= MAX_ADVANCE:
        return agrees("u / (n D) is that of a propeller that drives a hull", advance)
    fault = "motor rather than propeller rpm (gear ratio)"
    if advance > MAX_ADVANCE:
        share = f"{share_of_throttle(seen)}, or ".removeprefix(", or ")
        fault = f"{share}{RADPS}, or u in knots or cm/s"
        fault = "rev/s in an rpm column" if advance > 10 * MAX_ADVANCE else fault
    return contradicts(
        f"u / (n D) is {advance:.3g}; looks like {fault}, or a wrong propeller diameter",
        advance,
        "Check the units of rpm and u and [propeller] diameter_m.",
    )


def _at_rest(seen: Seen) -> Verdict | None:
    """A vehicle that never moves although its propeller turns, or None."""
    u, rpm = (np.abs(x) for x in seen.columns("u_mps", "rpm"))
    turning = rpm > MIN_RPM
    if turning.sum() < MIN_SAMPLES or seen.vehicle.propeller is None:
        return None
    most = float(np.quantile(u[turning], 0.9))
    advance = most / (np.median(rpm[turning]) / 60.0 * seen.vehicle.propeller.diameter_m)
    if advance >= MIN_ADVANCE:
        return None
    return contradicts(
        f"u stays below {most:.2g} m/s while the propeller turns; looks like m/s in a _cmps "
        "column, or a DVL that measures nothing",
        advance,
        "Check unit and column of u.",
    )


MAX_ADVANCE = 2.0  # u / (n D): marine propellers give no thrust beyond about 1.5
MIN_ADVANCE = 0.1  # a propeller that drives a hull moves forward
