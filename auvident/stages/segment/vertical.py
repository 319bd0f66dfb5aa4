"""Maneuvers of the vertical plane: elevator zigzags, depth steps, and straight runs."""

from collections.abc import Sequence

import numpy as np

from auvident.constants import VehicleTime
from auvident.physics.maneuvers.plateaus import Array
from auvident.physics.maneuvers.straight import rpm_levels
from auvident.schema.artifacts import Maneuvers, Rejected
from auvident.schema.trial import Trial
from auvident.stages.segment.course import course_changes
from auvident.stages.segment.depth import least_rows, sink_by_depth
from auvident.stages.segment.elevators import find_elevator_zigzags, on_clock_of
from auvident.stages.segment.level import level, usual_depth
from auvident.stages.segment.pieces import Found, Piece, pieces_of, true_ranges
from auvident.stages.segment.scales import Scales, scales_of
from auvident.stages.segment.stage import Searched, assemble, search_trial
from auvident.stages.segment.straights import find_straights

STEP_SLOPE = 0.03  # vertical over forward speed (2 degrees): a change of depth was ordered
# the depth swings in after a step; orders closer than twice this are one run
SETTLE_S: VehicleTime = 10.0
LEAST_STEP_M = 0.5  # well above the waves' pressure and the depth-keeping of an autopilot
SUBMERGED_SHARE = 0.3  # of the usual depth: shallower is a dive from or a rise to the surface

SURFACE = "depth step: begins or ends near the surface, least depth [m]"
TOO_SMALL = "depth step: too small, change of depth [m]"
OFF_COURSE = "depth step: the course changes or has just changed, time since [s]"


def segment_vertical(trials: Sequence[Trial], hold_out: Sequence[str] = ()) -> Maneuvers:
    """Find elevator zigzags, depth steps and straight runs, and give them roles.

    Parameters
    ----------
    trials : sequence of Trial
        Ingested logs with elevator, heave velocity and pitch rate; others are passed over.
    hold_out : sequence of str
        As for `segment`.

    Returns
    -------
    Maneuvers
        As by `segment`. An elevator zigzag has kind ``zigzag``, a run of depth steps kind
        ``straight``, both with ``plane = "vertical"`` among the features; depth steps also have
        ``maneuver = "depth_step"`` and ``depth_range_m``. Straight runs with thrust steps are
        those of `segment`.

    Raises
    ------
    InputError, UsageError
        As by `segment`.
    """
    return assemble(trials, "vertical", search_vertically, hold_out)


def search_vertically(trial: Trial) -> Searched:
    """Vertical maneuvers of one trial, and its straight runs outside them."""
    turned = course_changes(trial)

    def ordered(piece: Piece, scales: Scales) -> tuple[list[Found], list[Rejected]]:
        """No depth step where the course changes."""
        here = [on_clock_of(piece, f) for f in turned]
        return search_vertical(piece, scales, [f for f in here if f.start < f.stop])

    found, rejected, findings = search_trial(trial, "vertical", ordered)
    if not found and findings:
        return found, rejected, findings

    def straights(piece: Piece, scales: Scales) -> tuple[list[Found], list[Rejected]]:
        """Straight runs in what the vertical maneuvers leave."""
        runs, rejected = find_straights(piece, scales, [on_clock_of(piece, f) for f in found])
        kept, why_not_level = level(piece, scales, runs)
        return kept, [*rejected, *why_not_level]

    runs, no_runs, torn = search_trial(trial, "horizontal", straights)
    both = sorted([*found, *runs], key=lambda f: f.piece.time(f.start))
    torn = [f for f in torn if not f.code.endswith("_sign")]
    return both, [*rejected, *no_runs], [*findings, *torn]


def search_vertical(
    piece: Piece, scales: Scales, turned: Sequence[Found]
) -> tuple[list[Found], list[Rejected]]:
    """Elevator zigzags, and depth steps in what they and changes of the course leave."""
    zigzags, no_zigzags = find_elevator_zigzags(piece, scales)
    steps, no_steps = find_depth_steps(piece, scales, zigzags, turned)
    return [*zigzags, *steps], [*no_zigzags, *no_steps]


def find_depth_steps(
    piece: Piece, scales: Scales, taken: Sequence[Found], turned: Sequence[Found]
) -> tuple[list[Found], list[Rejected]]:
    """Runs of ordered changes of depth, submerged from beginning to end.

    Parameters
    ----------
    piece : Piece
        Piece of a trial in the vertical plane; without depth nothing is found.
    scales : Scales
        Yardsticks of the trial.
    taken : sequence of Found
        Zigzags of this piece.
    turned : sequence of Found
        Changes of its course: a change of depth that begins in one was not ordered, and one
        that goes on in it is cut there.

    Returns
    -------
    list of Found, list of Rejected
        From the first change of depth until the last has settled, in time order; and what
        fell short.
    """
    found: list[Found] = []
    rejected: list[Rejected] = []
    if piece.depth is None:
        return found, rejected
    usual, on_course = usual_depth(piece, scales), _on_course_s(piece, turned)
    steps: list[tuple[int, int]] = []
    for start, stop in depth_changes(piece, scales, taken, turned):
        depth = piece.depth[start:stop]
        if stop - start < least_rows(piece):
            continue  # the ripple of depth-keeping
        needed = (
            (SURFACE, float(depth.min()), SUBMERGED_SHARE * usual),
            (TOO_SMALL, float(np.ptp(depth)), LEAST_STEP_M),
            (OFF_COURSE, float(on_course[start]), SETTLE_S),
        )
        short = next((why for why in needed if why[1] < why[2]), None)
        if short is None:
            steps.append((start, stop))
        else:
            rejected.append(piece.rejected(start, stop, *short))
    for start, stop in _joined(piece, scales, steps, [*taken, *turned]):
        depth = piece.depth[start:stop]
        ends = [round(float(x), 3) for x in (np.nanmin(depth), np.nanmax(depth))]
        notes = {"maneuver": "depth_step", "depth_range_m": ends}
        found.append(Found("straight", piece, start, stop, plane="vertical", notes=notes))
    return found, rejected


def ordered_depths(trial: Trial) -> list[Found]:
    """Runs of ordered changes of depth in a log that need not have elevator, heave and pitch rate.

    Elevator zigzags count among them, as nothing else tells of these there.
    """
    pieces, turned = pieces_of(trial), course_changes(trial)
    if not pieces:
        return []
    scales, found = scales_of(pieces), []
    for piece in pieces if scales.rpm > 0 else ():
        here = [f for f in (on_clock_of(piece, t) for t in turned) if f.start < f.stop]
        found += find_depth_steps(piece, scales, (), here)[0]
    return found


def _on_course_s(piece: Piece, turned: Sequence[Found]) -> Array:
    """Time since the last change of the course for each sample [s]; infinite before the first."""
    since = np.full(piece.size, np.inf)
    for turn, stop in zip(turned, [*(t.start for t in turned[1:]), piece.size], strict=False):
        since[turn.start : stop] = np.maximum(
            piece.t[turn.start : stop] - piece.time(turn.stop), 0.0
        )
    return since


def depth_changes(
    piece: Piece, scales: Scales, taken: Sequence[Found], turned: Sequence[Found]
) -> list[tuple[int, int]]:
    """Half-open ranges in which the depth changes outside the zigzags, cut where a turn begins."""
    changes = np.abs(sink_by_depth(piece)) > STEP_SLOPE * scales.speed_mps
    for other in taken:  # a zigzag swings the depth, and leaves one to recover from
        changes[other.start : other.stop + 2 * piece.samples(SETTLE_S)] = False
    changes[[t.start for t in turned]] = False
    return true_ranges(changes)


def _joined(
    piece: Piece, scales: Scales, steps: Sequence[tuple[int, int]], taken: Sequence[Found]
) -> list[tuple[int, int]]:
    """Steps at one thrust, each before the last has settled, are one run; with settling."""
    settle = piece.samples(SETTLE_S)
    levels = rpm_levels(piece.rpm, piece.rate_hz, scales.rpm_noise, scales.rpm)
    steps = [
        (max(start, a), min(stop, b))
        for start, stop in steps
        for a, b, _ in levels
        if min(stop, b) - max(start, a) >= least_rows(piece)
    ]
    borders = sorted([*(t.start for t in taken), *(a for a, _, _ in levels)])
    runs: list[tuple[int, int]] = []
    for start, stop in steps:
        stop = min([stop + settle, piece.size, *(b for b in borders if b >= stop)])
        between = bool(runs) and any(runs[-1][1] <= b <= start for b in borders)
        if runs and start - runs[-1][1] <= settle and not between:
            start = runs.pop()[0]
        runs.append((start, stop))
    return runs
