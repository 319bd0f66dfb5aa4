"""Zigzags of the elevator: maneuvers of the vertical plane, and no straight runs of the other.

An elevator is laid about the angle that keeps the depth, about zero, or about another angle; the
executes of a zigzag are measured from the middle of its own two angles.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from auvident.physics.maneuvers.plateaus import Plateau
from auvident.schema.artifacts import Rejected
from auvident.schema.trial import Trial
from auvident.stages.segment.chains import LEAST_EXECUTES, SAME_SIDE_SHARE, longest_move_s
from auvident.stages.segment.pieces import Found, Piece, pieces_of
from auvident.stages.segment.scales import (
    LEAST_FIN_RAD,
    PROPELLED_SHARE,
    Scales,
    held_fins,
    scales_of,
)
from auvident.stages.segment.zigzags import find_zigzags


def find_elevator_zigzags(piece: Piece, scales: Scales) -> tuple[list[Found], list[Rejected]]:
    """Zigzags of the elevator about its trim or an angle of their own, switched on pitch.

    Parameters
    ----------
    piece : Piece
        Piece of a trial in the vertical plane.
    scales : Scales
        Yardsticks of the trial in the vertical plane.

    Returns
    -------
    list of Found, list of Rejected
        As by `find_zigzags`.
    """
    propelled = np.abs(piece.rpm) >= PROPELLED_SHARE * scales.rpm
    trim = float(np.median(piece.fin[propelled])) if propelled.any() else 0.0
    found, rejected = _zigzags_about(piece, scales, trim)
    for swing in _swings(piece, scales):
        if any(_meets(swing, f) for f in found):
            continue
        own, why = _zigzags_about(piece, scales, swing.middle_rad)
        own = [f for f in own if _meets(swing, f) and not any(_meets(f, g) for g in found)]
        if own:
            why = [r for r in why if _said_of(piece, swing, r)]
            rejected = [r for r in rejected if not _said_of(piece, swing, r)] + why
            found += own
    return sorted(found, key=lambda f: f.start), sorted(rejected, key=lambda r: r.t_start_s)


def _zigzags_about(piece: Piece, scales: Scales, trim: float) -> tuple[list[Found], list[Rejected]]:
    """Zigzags with executes to either side of an angle [rad]."""
    about = replace(piece, fin=piece.fin - trim)
    return find_zigzags(about, scales, held_fins(about, scales), plane="vertical")


@dataclass(frozen=True)
class _Swing:
    """Samples, half-open, over which the elevator goes back and forth between two angles."""

    start: int
    stop: int
    middle_rad: float


def _swings(piece: Piece, scales: Scales) -> list[_Swing]:
    """Runs of holds at two angles in turn, whatever their middle."""
    runs: list[list[Plateau]] = []
    for hold in held_fins(piece, scales, least_rad=0.0):
        if runs and _goes_on(piece, scales, runs[-1], hold):
            runs[-1].append(hold)
            continue
        before = runs[-1][-1:] if runs else []
        joined = before and _moves_on(piece, scales, before[0], hold)
        runs.append([*before, hold] if joined else [hold])
    return [
        _Swing(run[0].start, run[-1].stop, float(np.median([_middle(p) for p in pairwise(run)])))
        for run in runs
        if len(run) >= LEAST_EXECUTES
    ]


def _middle(pair: tuple[Plateau, Plateau]) -> float:
    return 0.5 * (pair[0].level + pair[1].level)


def _moves_on(piece: Piece, scales: Scales, last: Plateau, hold: Plateau) -> bool:
    """Whether the elevator went from one angle to another without a rest, by twice the least."""
    amplitude = 0.5 * abs(hold.level - last.level)
    at_once = hold.start - last.stop <= piece.samples(longest_move_s(scales, amplitude))
    return amplitude >= LEAST_FIN_RAD and at_once


def _goes_on(piece: Piece, scales: Scales, run: Sequence[Plateau], hold: Plateau) -> bool:
    """Whether the elevator returns from the last hold of a run to the angle before."""
    if not _moves_on(piece, scales, run[-1], hold):
        return False
    amplitude = 0.5 * abs(hold.level - run[-1].level)
    same = max(SAME_SIDE_SHARE * amplitude, scales.tolerance_rad)
    return len(run) < 2 or abs(run[-2].level - hold.level) <= same


def _meets(one: _Swing | Found, other: Found) -> bool:
    """Whether two ranges have samples in common."""
    return one.start < other.stop and other.start < one.stop


def _said_of(piece: Piece, swing: _Swing, r: Rejected) -> bool:
    """Whether a refusal is of samples of a swing."""
    return r.t_start_s < piece.time(swing.stop) and r.t_end_s > piece.time(swing.start)


def elevator_zigzags_of(trial: Trial) -> list[Found]:
    """All elevator zigzags of a trial; none where it logs no vertical motion."""
    pieces = pieces_of(trial, "vertical")
    if not pieces:
        return []
    scales = scales_of(pieces)
    return [f for piece in pieces for f in find_elevator_zigzags(piece, scales)[0]]


def on_clock_of(piece: Piece, f: Found) -> Found:
    """A maneuver in samples of another piece of its trial."""
    start, stop = np.searchsorted(piece.t, [f.piece.time(f.start), f.piece.time(f.stop)])
    return replace(f, piece=piece, start=int(start), stop=int(stop))
