"""What a maneuver is worth knowing by: its figures and how much it excites.

Excitation. In each equation the coefficients multiply regressors, products of velocities. A
maneuver tells them apart as far as its regressors are different functions of time. Each
regressor is divided by its RMS over all maneuvers of the trial; the excitation is the smallest
singular value of the matrix of these columns over the root of the number of samples: near 0 for
a steady state (there u ~ n and v ~ r ~ rudder), towards 1 where every regressor goes its own way
and is as large as elsewhere in the trial. It compares maneuvers of one trial; it is no absolute
measure of certainty.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from auvident.constants import VehicleTime
from auvident.physics.maneuvers import straight_figures, turn_figures, zigzag_figures
from auvident.physics.maneuvers.plateaus import Array
from auvident.schema.planes import BY_PLANE
from auvident.stages.segment.pieces import Found, Piece

# before the execute, over which the approach speed and course are averaged
APPROACH_S: VehicleTime = 3.0
RPM_PER_RPS = 60.0
DECIMALS = 4
EQUAL_SHARE = 0.8  # of the larger side of a zigzag: a smaller side above is equal but for its trim


def regressors(piece: Piece, rows: slice) -> dict[str, Array]:
    """Columns of the surge and the sway-yaw equations, shape (n, 3) each.

    Surge: u|u|, n|n|, |n|u; steering: u v, u r, u u rudder, or u w, u q, u u elevator.
    """
    u, v, r, fin = (x[rows] for x in (piece.speed, piece.v, piece.rate_mean, piece.fin))
    n = piece.rpm[rows] / RPM_PER_RPS
    return {
        "surge": np.column_stack([u * np.abs(u), n * np.abs(n), np.abs(n) * u]),
        "steering": np.column_stack([u * v, u * r, u * u * fin]),
    }


def reference_rms(found: Sequence[Found]) -> dict[str, Array]:
    """RMS of every regressor over all maneuvers of a trial, shape (3,) each."""
    parts = [regressors(f.piece, slice(f.start, f.stop)) for f in found]
    return {
        name: np.sqrt(np.mean(np.concatenate([p[name] for p in parts]) ** 2, axis=0))
        for name in ("surge", "steering")
    }


def excitation(f: Found, reference: dict[str, Array]) -> dict[str, float]:
    """RMS, spread and the excitation numbers of one maneuver.

    Returns
    -------
    dict of str to float
        ``u_std_mps``, ``rpm_std``, ``v_std_mps``, ``r_std_degps``, ``rudder_std_deg``,
        ``surge`` and ``steering`` (see the module). In the vertical plane w, q and elevator
        take the place of v, r and rudder.
    """
    p, rows = f.piece, slice(f.start, f.stop)
    _, v, r = BY_PLANE[f.plane].velocities
    numbers = {
        "u_std_mps": float(np.std(p.u[rows])),
        "rpm_std": float(np.std(p.rpm[rows])),
        f"{v}_std_mps": float(np.std(p.v[rows])),
        f"{r}_std_degps": float(np.degrees(np.std(p.rate[rows]))),
        f"{BY_PLANE[f.plane].fin}_std_deg": float(np.degrees(np.std(p.fin[rows]))),
    }
    for name, columns in regressors(p, rows).items():
        scaled = columns / np.where(reference[name] > 0, reference[name], 1.0)
        least = np.linalg.svd(scaled, compute_uv=False)[-1]
        numbers[name] = float(least / np.sqrt(len(scaled)))
    return {name: round(value, DECIMALS) for name, value in numbers.items()}


def features_of(f: Found, reference: dict[str, Array]) -> dict[str, Any]:
    """Figures, side and excitation of one maneuver, rounded for people."""
    build = {"turn": _turn, "zigzag": _zigzag, "straight": _straight}[f.kind]
    features = {name: _rounded(value) for name, value in build(f).items()}
    features["plane"] = f.plane
    features |= f.notes
    features["excitation"] = excitation(f, reference)
    return features


def _rounded(value: Any) -> Any:
    """Numbers, also in lists, with few decimals; counts stay counts."""
    if isinstance(value, list):
        return [_rounded(x) for x in value]
    return round(value, DECIMALS) if isinstance(value, float) else value


def _rows(f: Found) -> slice:
    """Samples of a maneuver with the one at which the input has changed, where there is one."""
    return slice(f.start, min(f.stop + 1, f.piece.size))


def approach_speed(f: Found) -> float:
    """Mean surge velocity before the maneuver; at its start where nothing lies before [m/s]."""
    before = slice(max(0, f.start - f.piece.samples(APPROACH_S)), max(f.start, 1))
    return float(np.mean(f.piece.u[before]))


def _side(change_rad: float) -> str:
    return "starboard" if change_rad >= 0 else "port"


def _turn(f: Found) -> dict[str, Any]:
    p, rows = f.piece, _rows(f)
    figures: dict[str, Any] = dict(
        turn_figures(
            p.t[rows],
            p.u[rows],
            p.v[rows],
            p.rate[rows],
            p.fin[rows],
            p.angle[rows],
            approach_speed(f),
        )
    )
    figures["rudder_deg"] = float(np.degrees(f.level_rad))
    return {"side": _side(figures["heading_change_deg"]), **figures}


def _zigzag(f: Found) -> dict[str, Any]:
    p, rows = f.piece, _rows(f)
    before = slice(max(0, f.start - p.samples(1.0)), f.start + 1)
    base = float(np.mean(p.angle[before])) if f.start else float(p.angle[0])
    fin = _evened(p.fin[rows])
    figures: dict[str, Any] = dict(zigzag_figures(p.t[rows], p.angle[rows], fin, base))
    del figures["rudder_deg"]
    figures[f"{BY_PLANE[f.plane].fin}_deg"] = float(np.degrees(f.level_rad))
    figures["executes"] = int(figures["executes"])
    figures["switches"] = figures["executes"] - 1
    figures["approach_speed_mps"] = approach_speed(f)
    return {"first_side": _first_side(f), **figures}


def _evened(fin: Array) -> Array:
    """The fin with the larger side scaled to the smaller, where the executes are unequal.

    Executes are counted where the fin passes half of the largest; twice the smaller hides them.
    """
    sides = [np.abs(fin[sign * fin > 0]) for sign in (1, -1)]
    level = [float(np.quantile(side, 0.9)) if side.size else 0.0 for side in sides]
    if min(level) >= EQUAL_SHARE * max(level) or min(level) <= 0.0:
        return fin
    return np.where(fin > 0, fin * (min(level) / level[0]), fin * (min(level) / level[1]))


def _first_side(f: Found) -> str:
    """Side to which the first execute turns."""
    p = f.piece
    first = p.fin[f.start : f.start + max(2, (f.stop - f.start) // 4)]
    beyond = first[np.abs(first) > 0.5 * f.level_rad]
    positive = beyond.size > 0 and beyond[0] > 0
    to_positive, to_negative = BY_PLANE[f.plane].sides
    return to_positive if positive else to_negative


def _straight(f: Found) -> dict[str, Any]:
    p, rows = f.piece, slice(f.start, f.stop)
    figures: dict[str, Any] = dict(straight_figures(p.t[rows], p.u[rows], p.rpm[rows]))
    figures["steps"] = int(figures["steps"])
    figures["speed_range_mps"] = float(np.ptp(p.speed[rows]))
    return figures
