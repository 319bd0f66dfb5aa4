"""Signs and units of rudder, elevator and heading against the gyro: refused or noted."""

from dataclasses import dataclass

import numpy as np

from auvident.errors import ContradictionError, InputError
from auvident.schema.artifacts import Finding
from auvident.schema.logs import DEG, CheckMade, RawTrial
from auvident.schema.planes import BY_FIN
from auvident.schema.vehicle import Vehicle
from auvident.stages.ingest.checks.correction import scaled
from auvident.stages.ingest.held import LEAST_HOLDS, SURE_SHARE, Held, Votes
from auvident.stages.ingest.response import Relation

SURE_STDS = 3.0  # standard deviations beyond which a figure is not chance
SIGN_STDS = 4.0  # a refusal needs more than a warning: four jackknife standard deviations,
SIGN_SHARE = 0.2  # a fifth of the variance of the yaw acceleration due to the rudder alone,
SIGN_EXPLAINED = 0.4  # and a relation that explains a fair part of it; true ones exceed 0.85
# Angular acceleration over u^2 / L^2 and angle: 0.5 to 1.3 for torpedo and tanker alike; what is
# far below it is no fin's doing.
SIGN_RESPONSE = 0.1
LEAST_STEPS = 4  # of an elevator: a zigzag; 2 at most of horizontal trials, 37 of vertical ones
# What is so far ahead of the rudder is not due to it: no actuator does that. An acceleration is
# taken for such when so much
AHEAD_S = 0.3
AHEAD_EXPLAINED = 0.05  # more of it is explained that way
UNIT_LIMIT = 0.25  # relative distance from a ratio of units that counts as that ratio


def evidence(
    sign: Relation | None,
    held: Held,
    pitching: Relation | None,
    heading: Relation | None,
    elevator: Votes,
) -> dict[str, dict[str, float]]:
    """Responses to the internal rudder and elevator (negative as they should be), heading gain."""
    checks = {}
    for name, votes in (
        ("rudder_held_turns", held.turns),
        ("rudder_held_steps", held.steps),
        ("elevator_held_steps", elevator),
    ):
        if votes.rows:
            checks[name] = {
                "rows": float(votes.rows),
                "holds": float(votes.holds),
                "contrary_share": votes.share,
            }
    for name, found in (("rudder_sign", sign), ("elevator_sign", pitching)):
        if found is not None:
            checks[name] = {
                "response_1pm2": float(found.theta[0]),
                "std": float(found.theta_std[0]),
                "share": float(found.alone[0]),
                "explained": float(found.explained),
            }
    if heading is not None:
        gain, std = float(heading.theta[0]), float(heading.theta_std[0])
        checks["heading_over_gyro"] = {"gain": gain, "std": std}
    return checks


@dataclass(frozen=True)
class RudderSign:
    """Sign of the rudder: -1 as the vehicle file says, 1 the opposite, 0 not shown; and by what."""

    sign: int
    shown: str = ""


def judge_rudder(
    vehicle: Vehicle, found: Relation | None, either_way: Relation | None, held: Held
) -> RudderSign:
    """Sign of the rudder from what shows it best.

    Steady turns with the rudder held decide: they need neither a model nor a common clock. But a
    hull that cannot hold its course stays in a turn against the rudder, which steps and the yaw
    acceleration show: then nothing is sure. Without such turns the steps of the rudder decide, then
    the yaw acceleration; both can be upside down when the rudder is stamped seconds late, which an
    acceleration shows that is ahead of the rudder, and few turns that contradict.

    Parameters
    ----------
    vehicle : Vehicle
        With the sign that it should be.
    found, either_way : Relation or None
        Yaw acceleration from the rudder before it, and from one that may also come after it.
    held : Held
        What follows where the rudder is held.
    """
    opposite = found is not None and _is_opposite(found, vehicle)
    words = f"; {_response_words(found)}" if found is not None and opposite else ""
    if held.turns.sign > 0 and found is not None and _others_agree(found, held):
        return RudderSign(0)
    if held.turns.sign:
        return RudderSign(held.turns.sign, _held_words(held.turns) + words)
    sign = RudderSign(held.steps.sign, _held_words(held.steps) + words)
    if not sign.sign and found is not None:
        agrees = _in_stds(found) < -SURE_STDS
        sign = RudderSign(1 if opposite else -int(agrees), _response_words(found))
    if not sign.sign and found is not None and _both_contradict(found, vehicle, held):
        sign = RudderSign(1, f"{_held_words(held.all)}; {_response_words(found)}")
    few_turns = held.turns.holds > 1 and (held.turns.share - 0.5) * sign.sign < 0
    return RudderSign(0) if few_turns or _is_ahead(sign.sign, found, either_way) else sign


def _others_agree(found: Relation, held: Held) -> bool:
    """Whether steps of the rudder and the yaw acceleration say that the sign is right."""
    steps = held.steps.holds >= LEAST_HOLDS and held.steps.share < 0.5
    clear = found.explained >= SIGN_EXPLAINED and found.alone[0] >= SIGN_SHARE
    return bool(steps and clear and _in_stds(found) < -SIGN_STDS)


def _both_contradict(found: Relation, vehicle: Vehicle, held: Held) -> bool:
    """Whether few holds and an acceleration, neither sure enough alone, say the same together.

    A trial of a minute or two has two holds of ten seconds in which every row contradicts, and an
    acceleration three and a half standard deviations from zero: what agrees is taken from less.
    """
    votes = held.all
    contrary = votes.holds >= LEAST_HOLDS and votes.share >= SURE_SHARE
    return contrary and _is_opposite(found, vehicle, SURE_STDS)


def _is_ahead(sign: int, found: Relation | None, either_way: Relation | None) -> bool:
    """Whether the acceleration fits a rudder that comes after it better, and with another sign."""
    if found is None or either_way is None or either_way.lag_s > -AHEAD_S:
        return False
    better = either_way.explained > found.explained + AHEAD_EXPLAINED
    return better and float(either_way.theta[0]) * sign < 0


def refuse_rudder_sign(raw: RawTrial, vehicle: Vehicle, rudder: RudderSign) -> None:
    """Refuse a log whose rudder works the other way than the vehicle file says."""
    if rudder.sign > 0:
        raise _contradiction(raw, vehicle, "rudder", rudder.shown)


def refuse_elevator_sign(
    raw: RawTrial,
    vehicle: Vehicle,
    found: Relation | None,
    either_way: Relation | None,
    steps: int,
    held: Votes,
) -> tuple[CheckMade, ...]:
    """Refuse a log whose elevator works the other way than the vehicle file says.

    An autopilot that holds the depth of a lively vehicle moves the elevator with the pitch, in
    oscillations of a second or two. Half a period later they look like those of an elevator of
    the opposite sign: the scan of either way has to say the same. In a loop that is closed all
    the time even both may do: only an elevator that is stepped and held is the cause of what
    follows. Else the sign is left untested, which the check that is returned says.

    What follows such steps decides where there are enough of them: a hull that answers as slowly as
    it is flown up and down has a pitch acceleration against its elevator most of the time. Of 53
    drawn vertical trials 52 had 26 s of it or more and at most 3 % against, horizontal ones hardly
    any.

    Parameters
    ----------
    raw : RawTrial
    vehicle : Vehicle
        With the sign that it should be.
    found, either_way : Relation or None
        Pitch acceleration from the elevator before it, and from one that may also come after it.
    steps : int
        How often the elevator goes from one angle that is held to another.
    held : Votes
        What the pitch rate does after such steps.
    """
    if held.sign > 0:
        raise _contradiction(raw, vehicle, "elevator", _held_words(held, "elevator"))
    if held.sign < 0 or found is None or either_way is None or not _is_opposite(found, vehicle):
        return ()
    agrees = held.holds >= LEAST_HOLDS and held.share < 0.5
    if float(either_way.theta[0]) > 0.0 and steps >= LEAST_STEPS and not agrees:
        raise _contradiction(raw, vehicle, "elevator", _response_words(found))
    return (
        CheckMade(
            name="elevator_sign",
            what="sign of the elevator",
            against="pitch",
            outcome="untested",
            message="it moves with the pitch; vertical zigzags or steps would show it",
        ),
    )


def _is_opposite(found: Relation, vehicle: Vehicle, stds: float = SIGN_STDS) -> bool:
    """Whether the response to the internal angle is surely the opposite of what it should be."""
    if found.explained < SIGN_EXPLAINED or found.alone[0] < SIGN_SHARE:
        return False
    response = float(found.theta[0]) * vehicle.hull.length_m**2
    return _in_stds(found) > stds and response >= SIGN_RESPONSE


def _response_words(found: Relation) -> str:
    return (
        f"its share of the acceleration is {100 * found.alone[0]:.0f} %, "
        f"{_in_stds(found):.0f} standard deviations from zero"
    )


def _held_words(held: Votes, fin: str = "rudder") -> str:
    return (
        f"{100 * held.share:.0f} % of {held.rows} rows in which the {fin} is held, "
        f"{held.holds} times"
    )


def _contradiction(raw: RawTrial, vehicle: Vehicle, fin: str, shown: str) -> ContradictionError:
    row = BY_FIN[fin]
    key, ways, rate = row.sign_key, row.sides, row.states[2].symbol
    said = str(getattr(vehicle.signs, key))
    assumed = vehicle.signs.assumed(key)
    unsaid = f" (not stated in the vehicle file; {assumed} is assumed)" if assumed else ""
    other = ways[1] if said == ways[0] else ways[0]
    side = f"to {other}" if fin == "rudder" else other
    sensor = raw.sensors[fin]
    column = sensor.columns[f"{fin}_rad"]
    return ContradictionError(
        f"the log's {fin} sign contradicts [signs] {key} = {said!r}{unsaid}: a positive {column} "
        f"turns the bow {side} ({shown})",
        f"{sensor.file}, column {column}",
        f"Set {key} = {other!r} in the vehicle file, or sign = -1 for the column in a map "
        f"(--map), or give --fix {fin}_sign; if the gyro has the wrong sign, set sign = -1 for "
        f"{rate}.",
        f"{fin}_sign",
        scaled(-1.0, f"{fin}_rad"),
    )


def refuse_heading(raw: RawTrial, found: Relation | None) -> None:
    """Refuse a heading that turns against the gyro or at 57 times its rate."""
    if found is None:
        return
    gain, std = float(found.theta[0]), float(found.theta_std[0])
    if found.explained < SIGN_EXPLAINED or abs(gain) < SIGN_STDS * std:
        return
    gyro, attitude = raw.sensors["gyro"], raw.sensors["attitude"]
    names = (
        f"{attitude.columns['heading_rad']} changes at {gain:.3g} times {gyro.columns['r_radps']}"
    )
    where = f"{attitude.file} and {gyro.file}"
    if gain < 0:
        raise ContradictionError(
            f"heading and yaw rate have opposite signs: {names}",
            where,
            "Heading is positive clockwise, r to starboard: set sign = -1 for the wrong one "
            "in a map (--map), or leave the heading out; --fix yaw_rate_sign turns r.",
            "yaw_rate_sign",
            scaled(-1.0, "r_radps"),
        )
    for ratio in (1.0 / DEG, DEG):
        if abs(gain / ratio - 1.0) < UNIT_LIMIT:
            raise InputError(
                f"heading and yaw rate are not in the units they are labelled with: {names}",
                where,
                "One of them is in degrees but labelled rad, or the other way round.",
            )


def sign_findings(raw: RawTrial, found: Relation | None, rudder: RudderSign) -> list[Finding]:
    """Note a trial that does not show the sign of its rudder."""
    if rudder.sign < 0:
        return []
    return [
        Finding(
            code="rudder_sign_unverified",
            message="the trial does not show to which side a positive rudder turns the vehicle",
            where=f"trial {raw.name}",
            value=None if found is None else _in_stds(found),
            threshold=-SURE_STDS,
            remedy="Make sure that [signs] rudder_positive_turns is right.",
        )
    ]


def _in_stds(found: Relation) -> float:
    """Leading coefficient in its standard deviations; 0 when it was never excited."""
    return float(found.theta[0] / max(found.theta_std[0], np.finfo(float).tiny))
