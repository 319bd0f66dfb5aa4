"""Which maneuvers identify and which validate.

The automatic choice holds out about a quarter of the zigzags and of the turns, at least one
where there are two, and one of several straight runs, so that speed is predicted through thrust
steps too (the turns and zigzags that identify are run at several speeds). It takes maneuvers from
the middle of the range, so that the validation interpolates: the rest keeps the largest and the
smallest fin angle, both sides and both ends of the speed range as long as others can be spared.
What overlaps with the maneuvers held out, in either plane, is settled in `split`.
"""

from collections.abc import Collection, Sequence
from typing import Any

from auvident.errors import InputError, UsageError
from auvident.schema.artifacts import Finding, Maneuver
from auvident.schema.planes import BY_PLANE, PLANES

HELD_OUT_SHARE = 0.25
LEAST_OF_KIND = {"zigzag": 2, "turn": 2, "straight": 2}  # fewer: all are needed to identify
SAME_ANGLE_DEG = 1.0  # fin angles within this are one amplitude


def choose(maneuvers: Sequence[Maneuver], barred: Collection[str] = ()) -> set[str]:
    """IDs of the maneuvers held out by the automatic choice; it does not depend on the order.

    Those whose ID is `barred` identify.
    """
    held: set[str] = set()
    for kind, least in LEAST_OF_KIND.items():
        for plane in PLANES:
            same = [m for m in maneuvers if m.kind == kind and m.plane == plane and m.shows(plane)]
            if len(same) >= least:
                number = 1 if kind == "straight" else max(1, round(HELD_OUT_SHARE * len(same)))
                held |= _of_one_kind(same, number, {m.id for m in _spare(same)} - set(barred))
    return held


def _spare(same: Sequence[Maneuver]) -> Sequence[Maneuver]:
    """Those of one kind that may be held out.

    Of straight runs that serve both planes one, where another is left to each; else they are
    needed to identify.
    """
    both = [m for m in same if all(m.shows(plane) for plane in PLANES)]
    if len(both) > 1:
        return both
    return [m for m in same if m not in both]


def _of_one_kind(maneuvers: Sequence[Maneuver], number: int, spare: Collection[str]) -> set[str]:
    """The most central ones that can be spared, one after the other."""
    remaining = sorted(maneuvers, key=lambda m: (_amplitude(m), _speed(m), m.id))
    held: list[Maneuver] = []
    while len(held) < number and len(remaining) > 1:
        free = [m for m in remaining if m.id in spare]
        if not free:
            break
        best = min(free, key=lambda m: (_losses(m, remaining, held), _off_centre(m, remaining)))
        remaining.remove(best)
        held.append(best)
    return {m.id for m in held}


def _amplitude(m: Maneuver) -> float:
    """Fin angle; for a straight run the greatest thrust step."""
    if m.kind == "straight":
        return max((abs(float(x)) for x in m.features.get("rpm_steps", [])), default=0.0)
    return abs(float(m.features.get(f"{BY_PLANE[m.plane].fin}_deg", 0.0)))


def _speed(m: Maneuver) -> float:
    return float(m.features.get("approach_speed_mps", 0.0))


def _side(m: Maneuver) -> Any:
    return m.features.get("side", m.features.get("first_side", ""))


def _losses(m: Maneuver, remaining: Sequence[Maneuver], held: Sequence[Maneuver]) -> tuple:
    """What the identification would lose without `m`, the gravest loss first."""
    others = [x for x in remaining if x is not m]
    angles = [_amplitude(x) for x in others]
    side = all(_side(x) != _side(m) for x in others)
    largest = _amplitude(m) > max(angles) + SAME_ANGLE_DEG
    smallest = _amplitude(m) < min(angles) - SAME_ANGLE_DEG
    again = any(
        abs(_amplitude(x) - _amplitude(m)) <= SAME_ANGLE_DEG and _side(x) == _side(m) for x in held
    )
    speeds = [_speed(x) for x in others]
    fastest = bool(speeds) and not min(speeds) <= _speed(m) <= max(speeds)
    torn = int(m.features.get("parts", 1)) > 1  # an uninterrupted one tests the longer prediction
    return largest, side and len(others) > 1, smallest, torn, again, fastest


def _off_centre(m: Maneuver, remaining: Sequence[Maneuver]) -> tuple[float, float, str]:
    """Distance from the middle of the range of angles and speeds."""

    def distance(of: Any) -> float:
        values = sorted(of(x) for x in remaining)
        span = values[-1] - values[0]
        middle = 0.5 * (values[(len(values) - 1) // 2] + values[len(values) // 2])
        return abs(of(m) - middle) / span if span > 0 else 0.0

    return round(distance(_amplitude) + distance(_speed), 6), _amplitude(m), m.id


def part_id(whole: str, number: int) -> str:
    """ID of the numbered part (from 0) of a maneuver torn by drop-outs."""
    letters = ""
    number += 1
    while number:
        number, digit = divmod(number - 1, 26)
        letters = chr(ord("a") + digit) + letters
    return whole + letters


def _is_part(name: str, whole: str) -> bool:
    """Whether a name is the ID of a part of a maneuver; its parts go together."""
    rest = name.removeprefix(whole)
    return name.startswith(whole) and rest.isalpha() and rest.islower()


def _same_whole(name: str, other: str) -> bool:
    """Whether one is a part of the other."""
    return _is_part(name, other) or _is_part(other, name)


def requested(
    maneuvers: Sequence[Maneuver], trials: Sequence[str], hold_out: Sequence[str]
) -> set[str]:
    """IDs of the maneuvers that the user holds out, by their ID or by their trial.

    Raises
    ------
    UsageError
        An ID is unknown, or nothing is left to identify.
    """
    held: set[str] = set()
    for name in hold_out:
        chosen = {m.id for m in maneuvers if name in (m.id, m.trial) or _same_whole(name, m.id)}
        if not chosen and name not in trials:
            ids = ", ".join(m.id for m in maneuvers)
            raise UsageError(
                f"there is no maneuver and no trial {name!r} to hold out",
                remedy=f"Maneuvers: {ids}. Trials: {', '.join(trials)}.",
            )
        if not chosen:
            raise InputError(
                f"no maneuver was found in trial {name!r}, so nothing of it can be held out",
                where=name,
                remedy="Hold out another trial, or see the rejected candidates of this one.",
            )
        held |= chosen
    if len(held) == len(maneuvers):
        raise UsageError(
            "all maneuvers are held out, none is left to identify the model from",
            remedy="Hold out fewer maneuvers.",
        )
    return held


def with_roles(maneuvers: Sequence[Maneuver], held: set[str]) -> tuple[Maneuver, ...]:
    """The maneuvers with their roles."""
    return tuple(
        m.model_copy(update={"role": "validate" if m.id in held else "identify"}) for m in maneuvers
    )


def role_findings(maneuvers: Sequence[Maneuver]) -> list[Finding]:
    """What the user should know about the split."""
    findings = []
    if not any(m.role == "validate" for m in maneuvers):
        findings.append(
            Finding(
                code="nothing_held_out",
                message="Nothing is held out: there is no maneuver to spare for validation, "
                "so the model is not tested on data it has not seen.",
                value=len(maneuvers),
                threshold=2,
                remedy="Record a second zigzag or turn, or hold one out with --hold-out ID.",
            )
        )
    turns = [m for m in maneuvers if m.kind == "turn"]
    sides = {_side(m) for m in turns}
    used = {_side(m) for m in turns if m.role == "identify"}
    if used and used != sides:
        findings.append(
            Finding(
                code="one_turn_side",
                message=f"Only turns to {used.pop()} are used for identification.",
                remedy="Add a turn to the other side, or hold out another maneuver.",
            )
        )
    return findings
