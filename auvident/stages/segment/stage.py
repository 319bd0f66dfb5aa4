"""From trials to maneuvers with roles."""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from auvident.errors import InputError
from auvident.schema.artifacts import Finding, Maneuver, Maneuvers, Rejected
from auvident.schema.planes import BY_PLANE, Plane
from auvident.schema.trial import Trial
from auvident.stages.segment import roles
from auvident.stages.segment.elevators import elevator_zigzags_of, on_clock_of
from auvident.stages.segment.features import features_of, reference_rms
from auvident.stages.segment.gaps import parts_of, settle_cuts
from auvident.stages.segment.level import level
from auvident.stages.segment.pieces import Found, Piece, pieces_of, planes_logged
from auvident.stages.segment.scales import LEAST_FIN_RAD, Scales, held_fins, scales_of
from auvident.stages.segment.spans import Spans
from auvident.stages.segment.split import split
from auvident.stages.segment.straights import LONG_RUN_S, find_straights
from auvident.stages.segment.turns import find_steady_turns, find_turns
from auvident.stages.segment.zigzags import find_zigzags

CLOSEST = 8  # rejected candidates named when nothing was found
# findings of a trial that was not looked at
NOT_SEARCHED = ("never_under_way", "no_record", "plane_not_searched")

Search = Callable[[Piece, Scales], tuple[list[Found], list[Rejected]]]
Searched = tuple[list[Found], list[Rejected], list[Finding]]
Whole = tuple[Maneuver, Found]  # a maneuver with its ID and figures, before it is cut into parts


@dataclass(frozen=True)
class Gathered:
    """What a search found in all trials."""

    wholes: list[Whole] = field(default_factory=list)
    rejected: list[Rejected] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)


def segment(trials: Sequence[Trial], *, hold_out: Sequence[str] = ()) -> Maneuvers:
    """Find straight runs, turns and zigzags in the horizontal plane, and give them roles.

    Parameters
    ----------
    trials : sequence of Trial
        Ingested logs.
    hold_out : sequence of str
        IDs of maneuvers or names of trials that validate; they replace the automatic choice.

    Returns
    -------
    Maneuvers
        In time order within each trial, with figures and excitation as features; the rejected
        candidates with reason, value and threshold; findings. A straight run lasts from its
        first to its last thrust level, a turn from rudder execute to release, a zigzag from
        first execute to last release. None crosses an interruption of the record: one torn by
        a short drop-out comes in parts (``...-turn-2a``, ``...-turn-2b``) of one role whose
        features are those of the whole.

    Raises
    ------
    InputError
        No maneuver in any trial, or none in a trial that is to be held out.
    UsageError
        `hold_out` names nothing known, or everything.
    """
    return assemble(trials, "horizontal", search_horizontally, hold_out)


def search_horizontally(trial: Trial) -> Searched:
    """Maneuvers of one trial in the horizontal plane, rejected candidates, findings."""
    swung = elevator_zigzags_of(trial)

    def search(piece: Piece, scales: Scales) -> tuple[list[Found], list[Rejected]]:
        """No straight run where the elevators swing the vehicle."""
        return search_horizontal(piece, scales, [on_clock_of(piece, f) for f in swung])

    return search_trial(trial, "horizontal", search)


def search_horizontal(
    piece: Piece, scales: Scales, elsewhere: Sequence[Found] = ()
) -> tuple[list[Found], list[Rejected]]:
    """Turns first, then zigzags in the other rudder angles, then what else the rest has."""
    held = held_fins(piece, scales)
    turns, why_no_turn = find_turns(piece, scales, held)
    circles = Spans((t.start, t.stop) for t in turns)
    others = [p for p in held if not circles.holds(p.middle)]
    zigzags, why_no_zigzag = find_zigzags(piece, scales, others, taken=turns)
    steady = find_steady_turns(piece, scales, [*turns, *zigzags])
    refused = _outside(piece, [*why_no_turn, *why_no_zigzag], steady)
    taken = [*turns, *zigzags, *steady]
    straights, why_no_straight = find_straights(piece, scales, [*taken, *elsewhere])
    kept, why_not_level = level(piece, scales, [*taken, *straights])
    return kept, [*refused, *why_no_straight, *why_not_level]


def _outside(piece: Piece, rejected: list[Rejected], found: Sequence[Found]) -> list[Rejected]:
    """What was refused, without what turned out to be part of a maneuver."""
    spans = Spans((piece.time(f.start), piece.time(f.stop)) for f in found)
    return [r for r in rejected if not spans.meets(r.t_start_s, r.t_end_s)]


def assemble(
    trials: Sequence[Trial],
    plane: Plane,
    search: Callable[[Trial], Searched],
    hold_out: Sequence[str],
) -> Maneuvers:
    """Search every trial and give roles to what is found; arguments as for `segment`."""
    gathered = gather(trials, search)
    if not gathered.wholes:
        raise nothing_found(trials, plane, gathered)
    return finished(gathered, trials, hold_out)


def gather(trials: Sequence[Trial], search: Callable[[Trial], Searched]) -> Gathered:
    """Search every trial and name what is found."""
    gathered = Gathered()
    for trial in trials:
        found, refused, said = search(trial)
        gathered.wholes.extend(zip(_named(trial, found), found, strict=True))
        gathered.rejected.extend(refused)
        gathered.findings.extend(said)
    return gathered


def finished(gathered: Gathered, trials: Sequence[Trial], hold_out: Sequence[str]) -> Maneuvers:
    """Roles and parts of what was gathered."""
    names = [trial.name for trial in trials]
    final, said = split([m for m, _ in gathered.wholes], names, hold_out)
    parts = [p for m, (_, f) in zip(final, gathered.wholes, strict=True) for p in _parts(m, f)]
    return Maneuvers(
        maneuvers=tuple(parts),
        rejected=tuple(gathered.rejected),
        findings=(*gathered.findings, *said),
    )


def _parts(m: Maneuver, f: Found) -> list[Maneuver]:
    """The maneuver, or its uninterrupted parts with a letter each; figures are of the whole."""
    ranges = parts_of(f)
    if ranges == [(f.start, f.stop)]:
        return [m]
    whole = {"whole": m.id, "whole_start_s": m.t_start_s, "whole_end_s": m.t_end_s}
    return [
        m.model_copy(
            update={
                "id": roles.part_id(m.id, number) if len(ranges) > 1 else m.id,
                "t_start_s": round(f.piece.time(a), 3),
                "t_end_s": round(f.piece.time(b if b == f.stop else b - 1), 3),
                "features": {**m.features, **whole, "part": number + 1},
            }
        )
        for number, (a, b) in enumerate(ranges)
    ]


def search_trial(trial: Trial, plane: Plane, search: Search) -> Searched:
    """Maneuvers, rejected candidates and findings of one trial, in time order."""
    pieces = pieces_of(trial, plane)
    if not pieces:
        return [], [], [_no_record(trial, plane)]
    scales = scales_of(pieces)
    if scales.rpm <= 0:
        return [], [], [_never_under_way(trial, scales.speed_mps)]
    found: list[Found] = []
    rejected: list[Rejected] = []
    for piece in pieces:
        more, refused = search(piece, scales)
        found += sorted(more, key=lambda f: f.start)
        rejected += refused
    found, cut, findings = settle_cuts(found)
    if scales.drive > 0 and found:
        findings.append(_wrong_sign(trial, plane))
    return found, sorted([*rejected, *cut], key=lambda r: r.t_start_s), findings


def _named(trial: Trial, found: Sequence[Found]) -> list[Maneuver]:
    """Maneuvers with their IDs and features; roles follow."""
    if not found:
        return []
    reference = reference_rms(found)
    count: Counter[str] = Counter()
    named = []
    for f in found:
        count[f.kind] += 1
        planes = planes_logged(trial, f)
        named.append(
            Maneuver(
                id=maneuver_id(trial.name, f.plane, f.kind, count[f.kind]),
                trial=trial.name,
                kind=f.kind,
                t_start_s=round(f.piece.time(f.start), 3),
                t_end_s=round(f.piece.time(f.stop), 3),
                role="identify",
                plane=f.plane,
                planes=planes,
                features={
                    **features_of(f, reference),
                    "parts": len(parts_of(f)),
                    **({"planes": [*planes]} if planes != f.planes else {}),
                },
            )
        )
    return named


def maneuver_id(trial: str, plane: Plane, kind: str, number: int) -> str:
    """ID of a maneuver; those of the vertical plane say so."""
    return f"{trial}-{'' if plane == 'horizontal' else f'{plane}-'}{kind}-{number}"


def _no_record(trial: Trial, plane: Plane) -> Finding:
    lacking = trial.lacking(BY_PLANE[plane].needed)
    if lacking:
        return Finding(
            code="plane_not_searched",
            message=f"{', '.join(lacking)} not in the log: {plane} maneuvers were not looked for.",
            where=trial.name,
            remedy=f"Log it, or name its column in a map (--map), if the {plane} plane is to be "
            "identified.",
        )
    needed = "elevator and pitch rate" if plane == "vertical" else "every needed channel"
    return Finding(
        code="no_record",
        message=f"No uninterrupted record with {needed}: the trial has no {plane} maneuvers.",
        where=trial.name,
    )


def _never_under_way(trial: Trial, speed_mps: float) -> Finding:
    return Finding(
        code="never_under_way",
        message=f"The propeller never turns (rpm is 0 throughout, at a usual speed of "
        f"{speed_mps:.2g} m/s): the trial has no maneuvers.",
        where=trial.name,
        value=0.0,
        remedy="Check the rpm channel: it looks stuck, or is not connected, where the vehicle "
        "makes way. Or leave this trial out.",
    )


def _wrong_sign(trial: Trial, plane: Plane) -> Finding:
    fin, key = BY_PLANE[plane].fin, BY_PLANE[plane].sign_key
    return Finding(
        code=f"{fin}_sign",
        message=f"The vehicle responds to its {fin} with the opposite sign of what [signs] states.",
        where=trial.name,
        remedy=f"Change {key} in the vehicle file, or the sign of the {fin} in the map.",
    )


def nothing_found(trials: Sequence[Trial], plane: Plane, gathered: Gathered) -> InputError:
    """What came closest, and why each failed."""
    longest = sorted(gathered.rejected, key=lambda r: r.t_start_s - r.t_end_s)[:CLOSEST]
    lines = [
        f"{r.trial}, {r.t_start_s:.1f} to {r.t_end_s:.1f} s: {r.reason}: {r.value:g}, "
        f"needed {r.threshold:g}"
        for r in longest
        if r.value is not None and r.threshold is not None
    ]
    closest = (
        "\n  ".join(["Closest candidates:", *lines])
        if lines
        else "\n  ".join(["No candidate either:", *_why_no_candidate(trials, gathered)])
    )
    return InputError(
        f"no {plane} maneuver (straight run with thrust steps, turning circle, zigzag) was found",
        where=", ".join(trial.name for trial in trials),
        remedy=closest,
    )


def _why_no_candidate(trials: Sequence[Trial], gathered: Gathered) -> list[str]:
    """Why there was nothing to look at in a trial, and of those with something what it lacks."""
    still = [f for f in gathered.findings if f.code in NOT_SEARCHED]
    said = [f"{f.where}: {f.message} {f.remedy}".rstrip() for f in still]
    if len({f.where for f in still}) < len(trials):
        said.append(
            "the fins are never held at an angle of "
            f"{math.degrees(LEAST_FIN_RAD):.0f} degrees or more, and no straight stretch of "
            f"{LONG_RUN_S:.0f} s was run. Check the units and names of the channels."
        )
    return said
