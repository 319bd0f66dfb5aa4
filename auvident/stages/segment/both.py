"""Maneuvers of both planes in one list: each stretch once, numbered in time order.

Both searches look for straight runs, each outside its own maneuvers. Where they find the same
stretch it stands once and serves both planes. Where they do not, a depth step or a drop-out of
the elevator lies in it: each stretch then serves the plane whose search found it, so that no
plane counts a reading twice.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import TypeVar

from auvident.schema.artifacts import Finding, Maneuver, Maneuvers
from auvident.schema.base import Artifact
from auvident.schema.planes import BY_PLANE, Plane
from auvident.schema.trial import Trial
from auvident.stages.segment.gaps import parts_of
from auvident.stages.segment.stage import (
    Gathered,
    Whole,
    finished,
    gather,
    maneuver_id,
    nothing_found,
    search_horizontally,
)
from auvident.stages.segment.vertical import ordered_depths, search_vertically

Said = TypeVar("Said", bound=Artifact)

NOT_LOGGED = "plane_not_searched"
NO_PIECES = ("no_record", NOT_LOGGED)  # findings of a plane without a piece of record
FEWEST_DIVES = 2  # one may be the way down from the surface that was cut, or the autopilot
SAME_S = 5.0  # runs that begin and end this close are one: the searches look at different rows


def segment_both(trials: Sequence[Trial], hold_out: Sequence[str] = ()) -> Maneuvers:
    """Maneuvers of the horizontal plane, and of the vertical one where there are any.

    Parameters
    ----------
    trials : sequence of Trial
    hold_out : sequence of str
        As for `segment`; for both planes together.

    Returns
    -------
    Maneuvers
        As by `segment` and `segment_vertical`. Straight runs that serve one plane only name it
        in ``planes`` among their features.

    Raises
    ------
    InputError
        Neither plane has a maneuver; says what came closest in the horizontal one.
    UsageError
        As by `segment`.
    """
    horizontal, vertical = gather(trials, search_horizontally), gather(trials, search_vertically)
    if not any(f.plane == "vertical" for _, f in vertical.wholes):
        vertical = Gathered(findings=_half_logged(trials, vertical.findings))
    if not horizontal.wholes and not vertical.wholes:
        raise nothing_found(trials, "horizontal", horizontal)
    wholes = numbered(merged(horizontal.wholes, vertical.wholes), trials)
    rejected = [*horizontal.rejected, *vertical.rejected]
    findings = [*horizontal.findings, *vertical.findings]
    both = Gathered(wholes, _once(rejected), _once(findings))
    return finished(both, trials, hold_out)


def _half_logged(trials: Sequence[Trial], findings: Sequence[Finding]) -> list[Finding]:
    """Why the vertical plane was not searched where its fin or its motion was logged, or it dived.

    Most trials have neither, or all and no maneuvers of it; identifying in that plane says so.
    """
    row = BY_PLANE["vertical"]
    ways = (row.control_columns[:1], row.columns[1:3])
    meant = {t.name for t in trials if any(not t.lacking(way) for way in ways)}
    told = [f for f in findings if f.where in meant and f.code in NO_PIECES]
    by_name = {t.name: t for t in trials if t.name not in meant}
    unmeant = [f for f in findings if f.where in by_name and f.code == NOT_LOGGED]
    return [*told, *(d for f in unmeant for d in _dived(by_name[f.where], f))]


def _dived(trial: Trial, finding: Finding) -> Iterator[Finding]:
    """The finding that the plane was not searched, of a trial whose depth was changed by order."""
    runs = ordered_depths(trial)
    if len(runs) >= FEWEST_DIVES:
        message = f"The vehicle changes its depth by order ({len(runs)} times), but "
        message += finding.message
        yield finding.model_copy(update={"message": message, "value": float(len(runs))})


def _once(said: Sequence[Said]) -> list[Said]:
    """Each of some models once; some have dictionaries inside and no hash."""
    known: dict[str, Said] = {}
    for model in said:
        known.setdefault(model.model_dump_json(), model)
    return list(known.values())


def merged(horizontal: Sequence[Whole], vertical: Sequence[Whole]) -> list[Whole]:
    """Maneuvers of two searches, a stretch that both found once."""
    twins = [(h, v) for h in horizontal for v in vertical if _same_stretch(h, v)]
    shared, again = ({pair[i][0].id for pair in twins} for i in (0, 1))
    searched = [{m.trial for m, _ in found} for found in (horizontal, vertical)]
    own = [
        w if w[0].id in shared or w[0].trial not in searched[1] else _only(w, "horizontal")
        for w in horizontal
    ]
    new = [w for w in vertical if w[0].id not in again and w[0].shows("vertical")]
    return [*own, *(_only(w, "vertical") if w[0].trial in searched[0] else w for w in new)]


def _same_stretch(one: Whole, other: Whole) -> bool:
    """Whether two searches found the same maneuver of one trial, in the same parts."""
    (a, f), (b, g) = one, other
    if (a.trial, a.kind, f.plane) != (b.trial, b.kind, g.plane):
        return False
    ours, theirs = _ends(one), _ends(other)
    near = zip(ours, theirs, strict=False)
    return len(ours) == len(theirs) and all(abs(x - y) <= SAME_S for x, y in near)


def _ends(whole: Whole) -> list[float]:
    """Start and end of each uninterrupted part [s]."""
    piece = whole[1].piece
    return [piece.time(i) for part in parts_of(whole[1]) for i in part]


def _only(whole: Whole, plane: Plane) -> Whole:
    """A straight run that serves one plane; other maneuvers do so anyway."""
    m, f = whole
    if m.kind != "straight" or f.plane == "vertical":
        return whole
    features = {**m.features, "planes": [plane]}
    return m.model_copy(update={"planes": (plane,), "features": features}), f


def numbered(wholes: Sequence[Whole], trials: Sequence[Trial]) -> list[Whole]:
    """In time order within each trial, numbered by kind over both planes."""
    order = {trial.name: number for number, trial in enumerate(trials)}
    count: Counter[tuple[str, str]] = Counter()
    found: list[Whole] = []
    for m, f in sorted(wholes, key=lambda w: (order[w[0].trial], w[0].t_start_s)):
        count[m.trial, m.kind] += 1
        found.append((_renamed(m, f.plane, count[m.trial, m.kind]), f))
    return found


def _renamed(m: Maneuver, plane: Plane, number: int) -> Maneuver:
    return m.model_copy(update={"id": maneuver_id(m.trial, plane, m.kind, number)})
