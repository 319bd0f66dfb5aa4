"""Heave, pitch and depth against each other: d(depth)/dt = w cos(pitch) - u sin(pitch)."""

import numpy as np

from auvident.stages.ingest.checks.correction import scaled
from auvident.stages.ingest.checks.row import Figure, Verdict, untested
from auvident.stages.ingest.checks.seen import Seen
from auvident.stages.ingest.response import Relation, Signals, fit_relation, smooth_records

MARGIN_S = 2.0  # as in the checks of the horizontal plane
LEAST_EXPLAINED = 0.6  # of the variance of the rate of depth
LEAST_ALONE = 0.02  # of it by a term alone: a w of noise shows no sign
LEAST_ASIDE = 0.1  # of the variance of the depth rate that speed and pitch leave
SIGN_STDS = 4.0  # a contradiction is no chance
# what the depth changes by over what it should, where a unit is another one
SCALES = {
    "feet logged as metres": 3.281,
    "speeds in feet per second": 1 / 3.281,
    "pressure in kPa logged as depth": 10.0,
    "pressure in bar logged as depth": 0.1,
}
NEAR = 0.13  # share of such a number within which it is meant
SCALE_LIMIT = 0.5  # the worst of 150 drawn trials is 40 % off; feet are a factor of 3.3
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
    return gain.verdict("agrees", "the depth changes as speed and pitch say")


def heave_by_depth(seen: Seen) -> Verdict:
    """Sign of heave against the rate of depth."""
    found = sinking(seen)
    if found is None or found.theta.size < 3:
        return untested("no heave, no pitch, or no depth")
    if found.explained < LEAST_EXPLAINED or found.alone[1] < LEAST_ALONE:
        return untested("the depth hardly shows the heave")
    gain = Figure.of(found, 1)
    if gain.value < -SIGN_STDS * gain.std:
        return gain.verdict(
            "contradicts",
            f"the depth changes against the heave ({gain.value:+.2f} of it)",
            "Heave w is positive down: sign = -1 in a map (--map) flips it.",
            scaled(-1.0, "w_mps"),
        )
    if gain.value < SIGN_STDS * gain.std:
        return untested("the depth hardly shows the heave")
    return gain.verdict("agrees", "the depth changes with the heave")


def heave_scale(seen: Seen) -> Verdict:
    """Scale of heave: what sinks the vehicle besides its speed along the pitch."""
    found = _sinking_aside(seen)
    if found is None:
        return untested("no heave, no pitch, or no depth")
    gain = Figure.of(found)
    if found.alone[0] < LEAST_ASIDE or gain.std > HEAVE_STD * max(abs(gain.value), 1.0):
        return untested("the depth hardly shows the heave")
    told = HEAVE_LIMIT + SIGN_STDS * gain.std
    if abs(gain.value - 1.0) <= told:
        return gain.verdict("agrees", f"w fits the depth (tested to {100 * told:.0f} %)")
    return gain.verdict(
        "contradicts",
        f"the depth changes by {gain.value:.2f} times the heave, beside speed and pitch",
        "Check unit, scale and column of w, and [dvl] x_m.",
        scaled(gain.value, "w_mps") if gain.value > 0.0 else "",
    )


def _sinking_aside(seen: Seen) -> Relation | None:
    """Rate of depth from w, less that of all others at the DVL's place; None without them."""
    columns = {"u": "u_mps", "v": "v_mps", "w": "w_mps", "pitch": "pitch_rad", "depth": "depth_m"}
    columns |= {"q": "q_radps", "r": "r_radps"}
    if not seen.has(*columns.values()):
        return None
    columns |= {"roll": "roll_rad"} if seen.has("roll_rad") else {}
    arm = seen.vehicle.dvl.x_m

    def relation(s: Signals, lag: float) -> tuple[np.ndarray, np.ndarray]:
        roll = s["roll"] if "roll" in s else np.zeros_like(s["u"])
        rest = arm * s["q"] * np.cos(roll) + (s["v"] - arm * s["r"]) * np.sin(roll)
        rate = s["depth_dot"] + s["u"] * np.sin(s["pitch"]) - rest * np.cos(s["pitch"])
        x = (s["w"] * np.cos(roll) * np.cos(s["pitch"]), s["u"], np.ones_like(roll))
        return rate, np.column_stack(x)  # with a pitch that is off

    records = smooth_records(seen.trial, columns, MARGIN_S)
    return fit_relation(records, relation, (0.0, 0.0), lambda s: np.abs(s["u"]) > seen.way_mps)


def pitch_rate(seen: Seen) -> Verdict:
    """Scale and sign of the pitch rate against the pitch."""
    if not seen.has("q_radps", "pitch_rad"):
        return untested("no pitch rate, or no pitch")

    def relation(s: Signals, lag: float) -> tuple[np.ndarray, np.ndarray]:
        return s["pitch_dot"], np.column_stack((s["q"], np.ones_like(s["q"])))

    columns = {"q": "q_radps", "pitch": "pitch_rad", "u": "u_mps"}
    records = smooth_records(seen.trial, columns, MARGIN_S)
    found = fit_relation(records, relation, (0.0, 0.0), lambda s: np.abs(s["u"]) > seen.way_mps)
    if found is None or found.explained < LEAST_EXPLAINED:
        return untested("the pitch hardly changes")
    gain = Figure.of(found)
    if abs(gain.value - 1.0) <= RATE_LIMIT + SIGN_STDS * gain.std:
        return gain.verdict("agrees", "the pitch changes at the pitch rate")
    return gain.verdict(
        "contradicts",
        f"the pitch changes at {gain.value:.2f} times the pitch rate",
        "Check units, signs and scales of q and pitch.",
        scaled(gain.value, "q_radps"),
    )
