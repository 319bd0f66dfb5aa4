"""Heave, pitch and depth against each other: d(depth)/dt = w cos(pitch) - u sin(pitch)."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from auvident.stages.ingest.checks.correction import scaled
from auvident.stages.ingest.checks.row import Figure, Verdict, untested
from auvident.stages.ingest.checks.seen import Seen
from auvident.stages.ingest.response import (
    Relation,
    Signals,
    fit_relation,
    kept_on_the_grid,
    shifted,
    smooth_records,
)

MARGIN_S = 2.0  # as in the checks of the horizontal plane
AT_ONCE_S, DEPTH_LAGS_S = (0.0, 0.0), (-MARGIN_S, MARGIN_S)
LATE = "a depth that is late or early may be what does not fit; see clock_depth"
LEAST_EXPLAINED = 0.6  # of the variance of the rate of depth
LEAST_ALONE = 0.02  # of it by a term alone: a w of noise shows no sign
LEAST_ASIDE = 0.1  # of the variance of the depth rate that speed and pitch leave
LITTLE_HEAVE = "the depth hardly shows the heave"
SIGN_STDS = 4.0  # a contradiction is no chance
# what the depth changes by over what it should, where a unit is another one
SCALES = {
    "feet logged as metres": 3.281,
    "speeds in feet per second": 1 / 3.281,
    "pressure in kPa logged as depth": 10.0,
    "pressure in bar logged as depth": 0.1,
}
ENDS = 0.01  # quantile of the depths, and of the rest
WAVES = 0.5  # hull lengths that a vehicle at the surface is below it
NEAR = 0.13  # share of such a number within which it is meant
SCALE_LIMIT = 0.5  # the worst of 150 drawn trials is 40 % off; feet are a factor of 3.3
# As in `speed_by_position`. 0.024 is the worst of 21 drawn clean logs that know it to 0.025; two
# that do not are 0.05 and 0.11 off, within their intervals.
SPEED_LIMIT = 0.05
MOST_TOLD = 0.15  # what is told no better is no test
CLEARLY = 0.95  # of the sum of squares: less speaks for one of two readings
HEAVE_LIMIT = 0.2  # 0.08 is the worst of 30 drawn vertical trials, of the smallest vehicle
HEAVE_STD = 0.1  # less sure it tells no scale
RATE_LIMIT = 0.15  # gyro against pitch: roll and heel take part


def sinking(seen: Seen) -> Relation | None:
    """Rate of depth from pitch and heave; None without them."""
    columns = {"u": "u_mps", "pitch": "pitch_rad", "depth": "depth_m"}
    columns |= {"w": "w_mps"} if seen.has("w_mps") else {}
    columns |= {"q": "q_radps"} if seen.has("q_radps") else {}
    if not seen.has(*columns.values()):
        return None
    arm = seen.vehicle.dvl.x_m

    def relation(s: Signals, lag: float) -> tuple[np.ndarray, np.ndarray]:
        terms = [-s["u"] * np.sin(s["pitch"])]
        if "w" in s:
            heave = s["w"] + arm * s["q"] if "q" in s else s["w"]
            terms.append(heave * np.cos(s["pitch"]))
        return s["depth_dot"], np.column_stack((*terms, np.ones_like(s["u"])))

    records = smooth_records(seen.trial, columns, MARGIN_S)
    return fit_relation(records, relation, (0.0, 0.0), lambda s: np.abs(s["u"]) > seen.way_mps)


def pitch_by_depth(seen: Seen) -> Verdict:
    """Sign and scale of pitch against the rate of depth."""
    found = sinking(seen)
    if found is None:
        return untested("no pitch, or no depth")
    if found.explained < LEAST_EXPLAINED or found.alone[0] < LEAST_ALONE:
        return untested("the depth hardly changes with the pitch")
    gain = Figure.of(found)
    if gain.value < -SIGN_STDS * gain.std:
        if _is_depth(seen, found):
            return gain.verdict(
                "contradicts",
                f"the depth changes against speed, pitch and what else tells ({gain.value:+.2f} of "
                "what they say): it looks like a height, or all of them like axes forward-left-up",
                "Depth and w are positive down, pitch and q bow up: sign = -1 in a map (--map) "
                "flips one.",
                scaled(-1.0, "depth_m"),
            )
        return gain.verdict(
            "contradicts",
            f"the vehicle rises bow down ({gain.value:+.2f} of what the pitch says)",
            "Pitch is positive bow up, depth positive down: sign = -1 in a map (--map) flips one.",
            scaled(-1.0, "pitch_rad"),
        )
    if abs(gain.value - 1.0) > SCALE_LIMIT + SIGN_STDS * gain.std:
        named = next((name for name, x in SCALES.items() if abs(gain.value / x - 1.0) < NEAR), "")
        return gain.verdict(
            "contradicts",
            f"the depth changes at {gain.value:.2f} times the rate of speed and pitch"
            f"{f'; {named}?' if named else ''}",
            "Check the units of depth, pitch and u.",
        )
    if above_water(seen):
        return gain.verdict(
            "contradicts",
            "the depth changes as speed and pitch say, but it is negative throughout: pitch, q, w "
            "and depth of the other sign, like axes forward-left-up? Or a depth with an offset",
            "Depth and w are positive down, pitch and q bow up: sign = -1 in a map (--map) flips "
            "each of them, and offset moves the depth.",
        )
    return gain.verdict("agrees", "the depth changes as speed and pitch say")


def _is_depth(seen: Seen, found: Relation) -> bool:
    """Whether the depth has the wrong sign: the heave, else the pitch rate, sides with pitch.

    Where neither tells, a vehicle that would be above the water.
    """
    if found.theta.size > 2 and _shows_heave(found):
        heave = Figure.of(found, 1)
        if abs(heave.value) >= SIGN_STDS * heave.std:
            return heave.value < 0.0
    by_rate = pitch_rate(seen).outcome
    return by_rate == "agrees" or (by_rate == "untested" and above_water(seen))


def above_water(seen: Seen) -> bool:
    """Whether the depth, as it is, is that of a vehicle in the air, never below the waves."""
    (depth,) = seen.columns("depth_m")
    highest, deepest = np.quantile(depth, (ENDS, 1.0 - ENDS))
    return bool(highest < -seen.length_m and deepest < WAVES * seen.length_m)


def heave_by_depth(seen: Seen) -> Verdict:
    """Sign of heave against the rate of depth."""
    found = sinking(seen)
    if found is None or found.theta.size < 3:
        return untested("no heave, no pitch, or no depth")
    if not _shows_heave(found):
        return untested(LITTLE_HEAVE)
    gain = Figure.of(found, 1)
    if gain.value < -SIGN_STDS * gain.std:
        if _is_late(seen, lambda gain: gain < 0.0):
            return untested(LATE)
        return gain.verdict(
            "contradicts",
            f"the depth changes against the heave ({gain.value:+.2f} of it)",
            "Heave w is positive down: sign = -1 in a map (--map) flips it.",
            scaled(-1.0, "w_mps"),
        )
    if gain.value < SIGN_STDS * gain.std:
        return untested(LITTLE_HEAVE)
    return gain.verdict("agrees", "the depth changes with the heave")


def _shows_heave(found: Relation) -> bool:
    return found.explained >= LEAST_EXPLAINED and bool(found.alone[1] >= LEAST_ALONE)


def speed_by_depth(seen: Seen) -> Verdict:
    """Scale of all speeds of the DVL against the rate of depth: a dive needs no position."""
    both = _sinking_by_dvl(seen)
    if both is None:
        return untested("no heave, no pitch, or no depth")
    gain = Figure.of(both.speeds)
    told = SPEED_LIMIT + SIGN_STDS * gain.std
    if both.speeds.alone[0] < LEAST_ASIDE or not told < MOST_TOLD:
        return untested("no dives that show the speed in the rate of depth")
    if abs(gain.value - 1.0) <= told:
        return gain.verdict(
            "agrees", f"the speed agrees with the rate of depth (tested to {100 * told:.0f} %)"
        )
    if both.heave_left < CLEARLY * both.speeds_left:
        return untested("w does not fit the rate of depth")
    later, _ = _fitted(seen, _dvl_records(seen), of_all=True, lags_s=DEPTH_LAGS_S)
    if later is None or later.at_edge or abs(later.theta[0] - 1.0) <= told:
        return untested(LATE)
    either = CLEARLY * both.heave_left < both.speeds_left and both.heave.theta[0] > 0.0
    other = f", or w alone {1.0 / both.heave.theta[0]:.2f} times" if either else ""
    return gain.verdict(
        "contradicts",
        f"the DVL reads {1.0 / gain.value:.3g} times the speed by depth and pitch{other}",
        "Check the units of u, v, w, depth and pitch, and the DVL's sound speed.",
        scaled(gain.value, "u_mps", "v_mps", "w_mps") if not either else "",
    )


def heave_scale(seen: Seen) -> Verdict:
    """Scale of heave: what sinks the vehicle besides its speed along the pitch."""
    both, simply = _sinking_by_dvl(seen), sinking(seen)
    if both is None or simply is None:
        return untested("no heave, no pitch, or no depth")
    found = both.heave
    gain = Figure.of(found)
    sure = gain.std <= HEAVE_STD * max(abs(gain.value), 1.0)
    if not sure or found.alone[0] < LEAST_ASIDE or not _shows_heave(simply):
        return untested(LITTLE_HEAVE)
    told = HEAVE_LIMIT + SIGN_STDS * gain.std
    if abs(gain.value - 1.0) <= told:
        return gain.verdict("agrees", f"w fits the depth (tested to {100 * told:.0f} %)")
    if _is_late(seen, lambda gain: abs(gain - 1.0) > HEAVE_LIMIT):
        return untested(LATE)
    return gain.verdict(
        "contradicts",
        f"the depth changes by {gain.value:.2f} times the heave, beside speed and pitch",
        "Check unit, scale and column of w, and [dvl] x_m.",
        scaled(gain.value, "w_mps") if gain.value > 0.0 else "",
    )


@dataclass(frozen=True)
class Sinking:
    """The rate of depth by the DVL: with w at fault, and with all of its speeds.

    Attributes
    ----------
    heave, speeds : Relation
        The first coefficient is what the depth changes by over what w, or all speeds, say.
    heave_left, speeds_left : float
        Sum of squares that each leaves, (m/s)^2.
    """

    heave: Relation
    speeds: Relation
    heave_left: float
    speeds_left: float


def _sinking_by_dvl(seen: Seen) -> Sinking | None:
    """Both readings of the rate of depth at the DVL's place; None without all that it takes."""
    records = _dvl_records(seen)
    heave, heave_left = _fitted(seen, records, of_all=False)
    speeds, speeds_left = _fitted(seen, records, of_all=True)
    if heave is None or speeds is None:
        return None
    return Sinking(heave, speeds, heave_left, speeds_left)


def _is_late(seen: Seen, is_wrong: Callable[[float], bool]) -> bool:
    """Whether a depth that is late or early may be what contradicts, and not w.

    One that is late by a second, as behind a filter, changes as speed and pitch say of a second
    ago. What is missing then goes with their slope, and so does w: beside them the depth seems to
    change by two or three times the heave, or against it where the depth is early.

    Parameters
    ----------
    seen : Seen
    is_wrong : callable
        What the depth changes by over what w says -> whether that contradicts.
    """
    records = _dvl_records(seen)
    _, by_heave = _fitted(seen, records, of_all=False)
    _, by_lag = _fitted(seen, records, of_all=True, lags_s=DEPTH_LAGS_S)
    both, _ = _fitted(seen, records, of_all=False, lags_s=DEPTH_LAGS_S)
    if both is None or by_lag < CLEARLY * by_heave:
        return True
    return not is_wrong(float(both.theta[0]))


def _dvl_records(seen: Seen) -> list[Signals]:
    """What the rate of depth of the DVL's place takes; none without all of it."""
    columns = {"u": "u_mps", "v": "v_mps", "w": "w_mps", "pitch": "pitch_rad", "depth": "depth_m"}
    columns |= {"q": "q_radps", "r": "r_radps"}
    if not seen.has(*columns.values()):
        return []
    columns |= {"roll": "roll_rad"} if seen.has("roll_rad") else {}
    return smooth_records(seen.trial, columns, MARGIN_S)


def _fitted(
    seen: Seen,
    records: list[Signals],
    *,
    of_all: bool,
    lags_s: tuple[float, float] = AT_ONCE_S,
) -> tuple[Relation | None, float]:
    """Relation of the rate of depth to w, or to all speeds, and the sum of squares it leaves.

    The depth is late by the lag that fits best.
    """

    def relation(s: Signals, lag: float) -> tuple[np.ndarray, np.ndarray]:
        rate, by_heave, aside = _parts_of_sinking(s, lag, seen.vehicle.dvl.x_m)
        own = by_heave + aside if of_all else by_heave
        x = np.column_stack((own, s["u"], np.ones_like(own)))  # u: with a pitch that is off
        return (rate if of_all else rate - aside), x

    def under_way(s: Signals) -> np.ndarray:
        return np.abs(s["u"]) > seen.way_mps

    found = fit_relation(records, relation, lags_s, under_way)
    if found is None:
        return None, 0.0
    left = 0.0
    for s in records:
        rate, x = relation(s, found.lag_s)
        left += float(np.sum((rate - x @ found.theta)[under_way(s) & _inside(s)] ** 2))
    return found, left


def _inside(s: Signals) -> np.ndarray:
    """Rows of a record in which a lag takes nothing from beyond it."""
    since, until = s["time"] - s["time"][0], s["time"][-1] - s["time"]
    return (since >= MARGIN_S) & (until >= MARGIN_S)


def _parts_of_sinking(
    s: Signals, late_s: float, arm_m: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rate of depth of the DVL's place; parts of it by w, and by u and v, as it reads them."""
    roll = s["roll"] if "roll" in s else np.zeros_like(s["u"])
    level = np.cos(s["pitch"])
    turning = arm_m * (s["q"] * np.cos(roll) - s["r"] * np.sin(roll)) * level
    by_heave = s["w"] * np.cos(roll) * level
    aside = -s["u"] * np.sin(s["pitch"]) + s["v"] * np.sin(roll) * level
    return shifted(s, "depth_dot", -late_s) - turning, by_heave, aside


def pitch_rate(seen: Seen) -> Verdict:
    """Scale and sign of the pitch rate against the pitch."""
    if not seen.has("q_radps", "pitch_rad"):
        return untested("no pitch rate, or no pitch")

    def relation(s: Signals, lag: float) -> tuple[np.ndarray, np.ndarray]:
        return s["pitch_dot"], np.column_stack((s["q"], np.ones_like(s["q"])))

    def under_way(s: Signals) -> np.ndarray:
        return np.abs(s["u"]) > seen.way_mps

    columns = {"q": "q_radps", "pitch": "pitch_rad", "u": "u_mps"}
    records = smooth_records(seen.trial, columns, MARGIN_S)
    found = fit_relation(records, relation, AT_ONCE_S, under_way)
    if found is None or found.explained < LEAST_EXPLAINED:
        return untested("the pitch hardly changes")
    gain = Figure.of(found)
    told = RATE_LIMIT + SIGN_STDS * gain.std
    if abs(gain.value - 1.0) <= told:
        return gain.verdict("agrees", "the pitch changes at the pitch rate")
    kept = kept_on_the_grid(records, "q", under_way)
    if kept - told <= gain.value < 1.0:
        return untested("the steps of --rate are long against the pitching")
    if gain.value < -SIGN_STDS * gain.std:
        scales = abs(gain.value + 1.0) > told and kept >= 1.0 - RATE_LIMIT
        return _of_other_sign(seen, gain, scales)
    return gain.verdict(
        "contradicts",
        f"the pitch changes at {gain.value:.2f} times the pitch rate",
        "Check units, signs and scales of q and pitch.",
        scaled(gain.value, "q_radps") if kept >= 1.0 - RATE_LIMIT else "",
    )


def _of_other_sign(seen: Seen, gain: Figure, scales: bool) -> Verdict:
    """Pitch against pitch rate: the elevator sides with one of them, the depth with the pitch.

    What the elevator sides with is not turned: the elevator would contradict it from then on.
    Where elevator and depth disagree, more than one of the channels is off, and none is named.
    """
    by_depth, with_rate = pitch_by_depth(seen).outcome == "agrees", seen.elevator < 0
    words, fix = "", ""
    if with_rate and not by_depth:
        words, fix = ", and the elevator fits the pitch rate", scaled(-1.0, "pitch_rad")
    elif with_rate:
        words = ": the elevator fits the pitch rate, but the depth the pitch"
    else:
        fix = scaled(gain.value if scales else -1.0, "q_radps")
    return gain.verdict(
        "contradicts",
        f"the pitch changes at {gain.value:.2f} times the pitch rate{words}",
        "Pitch and q are positive bow up: sign = -1 in a map (--map) flips one.",
        fix,
    )
