"""One role for each stretch: what overlaps a held-out maneuver goes with it.

Maneuvers of the two planes may overlap in time. One that lies within held-out ones over most of
its length is held out as well, in both planes alike. What overlaps less keeps its role, and its
identification leaves out the rows that are held out. The automatic choice holds out nothing that
would take all the maneuvers of a kind out of the identification of a plane this way, so that both
planes stay identifiable; the choice of the user stands as it is.
"""

from collections.abc import Iterable, Sequence

from auvident.errors import UsageError
from auvident.schema.artifacts import Finding, Maneuver
from auvident.schema.planes import PLANES
from auvident.stages.segment import roles

MOST = 0.5  # of its length: what lies further than this within held-out maneuvers goes with them


def split(
    maneuvers: Sequence[Maneuver], trials: Sequence[str], hold_out: Sequence[str]
) -> tuple[tuple[Maneuver, ...], list[Finding]]:
    """The maneuvers with their roles, and what the user should know about them.

    Parameters
    ----------
    maneuvers : sequence of Maneuver
        Of all trials and both planes.
    trials : sequence of str
        Names of the trials.
    hold_out : sequence of str
        IDs of maneuvers or names of trials; they replace the automatic choice.

    Raises
    ------
    InputError, UsageError
        As by `roles.requested`; also when nothing is left to identify with all that goes along.
    """
    if hold_out:
        held = roles.requested(maneuvers, trials, hold_out)
    else:
        held = choose(maneuvers)
    along = going_along(maneuvers, held)
    if hold_out and len(held) + len(along) == len(maneuvers):
        raise UsageError(
            "all maneuvers are held out or lie within those that are, none is left to identify "
            "the model from",
            remedy="Hold out fewer maneuvers.",
        )
    final = roles.with_roles(maneuvers, _reasons(maneuvers, held, along, bool(hold_out)))
    return final, [*_findings(maneuvers, held, along), *roles.role_findings(final)]


def _reasons(
    maneuvers: Sequence[Maneuver], held: set[str], along: dict[str, str], asked: bool
) -> dict[str, str]:
    """Why each of them is held out, by ID."""
    typical = {} if asked else roles.why_held(maneuvers, held)
    reasons = {name: f"lies within {cause}, which is held out" for name, cause in along.items()}
    for m in maneuvers:
        if m.id in held:
            reasons[m.id] = "asked for with --hold-out" if asked else typical[m.id]
    return reasons


def choose(maneuvers: Sequence[Maneuver]) -> set[str]:
    """IDs of the maneuvers held out by the automatic choice, without those that go along."""
    barred: set[str] = set()
    while True:
        held = roles.choose(maneuvers, barred)
        along = going_along(maneuvers, held)
        costly = {along[m.id] for m in _of_lost_kinds(maneuvers, held, along)}
        if not costly:
            return held
        barred |= costly


def _of_lost_kinds(
    maneuvers: Sequence[Maneuver], held: set[str], along: dict[str, str]
) -> list[Maneuver]:
    """Those that go along of the kinds of which nothing identifies any more."""
    gone = [m for m in maneuvers if m.id in along]
    left = {_group(m) for m in maneuvers if m.id not in held and m.id not in along}
    return [m for m in gone if _group(m) not in left]


def _group(m: Maneuver) -> tuple[str | bool, ...]:
    return m.kind, *(m.shows(plane) for plane in PLANES)


def going_along(maneuvers: Sequence[Maneuver], held: Iterable[str]) -> dict[str, str]:
    """Maneuvers that lie within held-out ones over most of their length, by the ID of which."""
    cause, near = {name: name for name in held}, _overlapping(maneuvers)
    spread = True
    while spread:
        spread = False
        for m in maneuvers:
            others = [x for x in near[m.id] if x.id in cause]
            if m.id not in cause and others and share_within(m, others) > MOST:
                cause[m.id] = cause[max(others, key=lambda x: (_common_s(x, m), x.id)).id]
                spread = True
    return {name: root for name, root in cause.items() if name != root}


def _overlapping(maneuvers: Sequence[Maneuver]) -> dict[str, list[Maneuver]]:
    """Those that have time in common with each other one, by the ID of that."""
    near: dict[str, list[Maneuver]] = {m.id: [] for m in maneuvers}
    going_on: list[Maneuver] = []
    for m in sorted(maneuvers, key=lambda m: (m.trial, m.t_start_s)):
        going_on = [x for x in going_on if x.trial == m.trial and x.t_end_s > m.t_start_s]
        for x in (x for x in going_on if _common_s(x, m) > 0.0):
            near[m.id].append(x)
            near[x.id].append(m)
        going_on.append(m)
    return near


def _common_s(a: Maneuver, b: Maneuver) -> float:
    """Time that two maneuvers have in common [s]."""
    if a.trial != b.trial:
        return 0.0
    return max(0.0, min(a.t_end_s, b.t_end_s) - max(a.t_start_s, b.t_start_s))


def share_within(m: Maneuver, others: Iterable[Maneuver]) -> float:
    """Share of a maneuver's length that lies within other ones of its trial."""
    common, reached = 0.0, m.t_start_s
    for other in sorted(others, key=lambda x: x.t_start_s):
        if other.trial == m.trial:
            stop = min(other.t_end_s, m.t_end_s)
            common += max(0.0, stop - max(other.t_start_s, reached))
            reached = max(reached, stop)
    return common / max(m.t_end_s - m.t_start_s, 1e-9)


def _findings(
    maneuvers: Sequence[Maneuver], held: set[str], along: dict[str, str]
) -> list[Finding]:
    """That a maneuver is held out because of another."""
    near = _overlapping([m for m in maneuvers if m.id in held or m.id in along])
    return [
        Finding(
            code="held_out_along",
            message=f"Most of it lies within the held-out {along[m.id]}, so it is held out as "
            "well: no part of a trial has both roles.",
            where=m.id,
            value=round(share_within(m, near[m.id]), 3),
            threshold=MOST,
            remedy="To identify from it, hold out another maneuver with --hold-out ID.",
        )
        for m in maneuvers
        if m.id in along
    ]
