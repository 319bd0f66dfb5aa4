"""Zigzags of the elevator: maneuvers of the vertical plane, and no straight runs of the other."""

from dataclasses import replace

import numpy as np

from auvident.schema.artifacts import Rejected
from auvident.schema.trial import Trial
from auvident.stages.segment.pieces import Found, Piece, pieces_of
from auvident.stages.segment.scales import PROPELLED_SHARE, Scales, held_fins, scales_of
from auvident.stages.segment.zigzags import find_zigzags


def find_elevator_zigzags(piece: Piece, scales: Scales) -> tuple[list[Found], list[Rejected]]:
    """Zigzags of the elevator about its trim, switched on pitch.

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
    about_trim = replace(piece, fin=piece.fin - trim)
    return find_zigzags(about_trim, scales, held_fins(about_trim, scales), plane="vertical")


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
