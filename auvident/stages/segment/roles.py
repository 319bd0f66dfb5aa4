"""Which maneuvers identify and which validate.

The automatic choice holds out about a quarter of the zigzags and of the turns, at least one
where there are two, and one of several straight runs, so that speed is predicted through thrust
steps too (the turns and zigzags that identify are run at several speeds). What is held out is to
be as hard to predict as the rest. Maneuvers are ranked among their kind by fin angle, speed and
rate of turn. The central ones would be interpolated and flatter the model, the outermost ones
blame it for what it never saw: those are held out of which the ranks lie, in the mean square, as
far from the middle as those of all maneuvers of the kind (balanced sampling of the second
moments). The largest fin angle of each kind and both sides identify as long as others can be
spared. What overlaps with the maneuvers held out, in either plane, is settled in `split`.
"""

import heapq
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.errors import InputError, UsageError
from auvident.schema.artifacts import Finding, Maneuver
from auvident.schema.planes import BY_PLANE, PLANES

HELD_OUT_SHARE = 0.25
LEAST_OF_KIND = {"zigzag": 2, "turn": 2, "straight": 2}  # fewer: all are needed to identify
SAME_ANGLE_DEG = 1.0  # fin angles within this are one amplitude
DECIMALS = 6  # of squared ranks: what differs by less is equally far from the middle

Array = npt.NDArray[np.float64]


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
    """Those whose ranks lie as far from the middle as those of all, one after the other."""
    away = dict(zip((m.id for m in maneuvers), _off_middle(maneuvers), strict=True))
    typical = float(np.mean(list(away.values())))
    remaining = sorted(map(_Seen.of, maneuvers), key=lambda m: m.id)
    held: list[_Seen] = []
    beyond, again = 0.0, dict.fromkeys(away, False)
    while len(held) < number and len(remaining) > 1:
        free = [m for m in remaining if m.id in spare]
        if not free:
            break
        left = _Left.of(remaining)
        best = min(
            free,
            key=lambda m: (
                *left.losses(m),
                again[m.id],
                round(abs(beyond + (away[m.id] - typical)), DECIMALS),
                m.amplitude,
                m.id,
            ),
        )
        remaining.remove(best)
        held.append(best)
        beyond += away[best.id] - typical
        for m in remaining:
            again[m.id] = again[m.id] or _alike(m, best)
    return {m.id for m in held}


@dataclass(frozen=True)
class _Seen:
    """What the choice looks at of a maneuver, looked up once."""

    id: str
    amplitude: float
    side: Any
    torn: bool

    @classmethod
    def of(cls, m: Maneuver) -> "_Seen":
        return cls(m.id, _amplitude(m), _side(m), int(m.features.get("parts", 1)) > 1)


@dataclass(frozen=True)
class _Left:
    """What is left to identify, in figures that tell what it would lose without one of them."""

    largest: float
    next_largest: float
    sides: Mapping[Any, int]

    @classmethod
    def of(cls, remaining: Sequence[_Seen]) -> "_Left":
        first, second = heapq.nlargest(2, (m.amplitude for m in remaining))
        return cls(first, second, Counter(m.side for m in remaining))

    def losses(self, m: _Seen) -> tuple[bool, ...]:
        """What the identification would lose without `m`, the gravest loss first."""
        others = self.next_largest if m.amplitude == self.largest else self.largest
        side = self.sides[m.side] == 1 and sum(self.sides.values()) > 2
        # an uninterrupted one tests the longer one
        return m.amplitude > others + SAME_ANGLE_DEG, side, m.torn


def _alike(m: _Seen, x: _Seen) -> bool:
    """Whether one of two is held out again rather than another one."""
    return abs(x.amplitude - m.amplitude) <= SAME_ANGLE_DEG and x.side == m.side


def _off_middle(maneuvers: Sequence[Maneuver]) -> Array:
    """Squared distance (n,) of the ranks of each from the middle, in standard deviations."""
    ranks = _ranks(maneuvers)
    spread = ranks.std(axis=0)
    off = (ranks - ranks.mean(axis=0)) / np.where(spread > 0.0, spread, 1.0)
    distance: Array = np.sum(off**2, axis=1)
    return distance


def _ranks(maneuvers: Sequence[Maneuver]) -> Array:
    """Ranks (n, 3) by fin angle, speed and rate of turn, 1 the smallest; equals share theirs."""
    values = np.array([[_amplitude(m), _speed(m), _rate(m)] for m in maneuvers])
    ranks: Array = np.empty(values.shape)
    for column, own in zip(values.T, ranks.T, strict=True):
        _, place, equal = np.unique(column, return_inverse=True, return_counts=True)
        below = np.cumsum(equal) - equal
        own[:] = (below + 0.5 * (equal + 1))[place]
    return ranks


def why_held(maneuvers: Sequence[Maneuver], held: Collection[str]) -> dict[str, str]:
    """Why the automatic choice holds out each of some maneuvers, in words, by ID."""
    kinds: dict[tuple[str, str], list[Maneuver]] = {}
    for m in maneuvers:
        kinds.setdefault((m.kind, m.plane), []).append(m)
    return {
        m.id: _typical(m, len(same), row)
        for same in kinds.values()
        for m, row in zip(same, _ranks(same), strict=True)
        if m.id in held
    }


def _typical(m: Maneuver, of: int, row: Array) -> str:
    first = "thrust step" if m.kind == "straight" else f"{BY_PLANE[m.plane].fin} angle"
    last = "change of speed" if m.kind == "straight" else "rate of turn"
    names = (first, "speed", last)
    ranks = ", ".join(f"{n} {r:g}" for n, r in zip(names, row, strict=True))
    return f"typical of its kind (rank among {of}, from the smallest: {ranks})"


def _amplitude(m: Maneuver) -> float:
    """Fin angle; for a straight run the greatest thrust step."""
    if m.kind == "straight":
        return max((abs(float(x)) for x in m.features.get("rpm_steps", [])), default=0.0)
    return abs(float(m.features.get(f"{BY_PLANE[m.plane].fin}_deg", 0.0)))


def _speed(m: Maneuver) -> float:
    """Approach speed; of a straight run the mean of its steady speeds."""
    steady = m.features.get("steady_speed_mps")
    if m.kind == "straight" and isinstance(steady, list) and steady:
        return float(np.mean(steady))
    return float(m.features.get("approach_speed_mps", 0.0))


def _rate(m: Maneuver) -> float:
    """Standard deviation of the rate of turn; of a straight run that of the speed."""
    excitation = m.features.get("excitation") or {}
    name = BY_PLANE[m.plane].velocities[2]
    key = "u_std_mps" if m.kind == "straight" else f"{name}_std_degps"
    return float(excitation.get(key) or 0.0)


def _side(m: Maneuver) -> Any:
    return m.features.get("side", m.features.get("first_side", ""))


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


def with_roles(maneuvers: Sequence[Maneuver], held: Mapping[str, str]) -> tuple[Maneuver, ...]:
    """The maneuvers with their roles; `held` says of each that validates why."""
    return tuple(
        m.model_copy(
            update={
                "role": "validate" if m.id in held else "identify",
                "reason": held.get(m.id, ""),
            }
        )
        for m in maneuvers
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
