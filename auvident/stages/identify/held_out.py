"""What of a trial may identify: the held-out maneuvers choose nothing.

Maneuvers may overlap in time. Of one that identifies and reaches into a held-out one of its plane
the longest stretch outside identifies; too short a rest identifies nothing.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from auvident.constants import ANSWER_S
from auvident.schema.artifacts import Finding, Maneuver, Maneuvers
from auvident.schema.channels import BY_COLUMN, TIME_COLUMN
from auvident.schema.coefficients import Plane
from auvident.schema.trial import TURNED_COLUMN, Trial


def without_held_out(trial: Trial, maneuvers: Maneuvers, plane: Plane) -> Trial:
    """The trial with the rows of the plane's held-out maneuvers blanked: they choose nothing."""
    held = _held_out(trial.name, maneuvers, plane)
    if not held:
        return trial
    rows, columns = _rows_of(trial, held), trial.columns
    measured = [c for c in BY_COLUMN if c in columns and BY_COLUMN[c].kind == "measured"]
    changed = {c: np.where(rows, np.nan, columns[c]) for c in measured}
    if not trial.has_heading and trial.turned_rad is not None:
        changed[TURNED_COLUMN] = trial.turned_rad  # which way it lay, not how it moved
    return trial.with_columns(changed)


def identifying(trials: Sequence[Trial], maneuvers: Maneuvers, plane: Plane) -> list[Maneuver]:
    """The maneuvers of a plane that identify, each cut to what is not held out.

    Those of which less than `ANSWER_S` is left are left out; `overlap_findings` says so.
    """
    left = [(m, _outside(m, trials, maneuvers, plane)) for m in _chosen(maneuvers, plane)]
    return [rest for m, rest in left if rest is m or _seconds(rest) >= ANSWER_S]


def overlap_findings(trials: Sequence[Trial], maneuvers: Maneuvers, plane: Plane) -> list[Finding]:
    """Which maneuvers identify in part or not at all, because the rest is held out."""
    said = []
    for m in _chosen(maneuvers, plane):
        rest = _outside(m, trials, maneuvers, plane)
        if rest is not m:
            held = [x.id for x in _held_out(m.trial, maneuvers, plane) if _overlap(m, x)]
            said.append(_finding(m, _seconds(rest), ", ".join(held)))
    return said


def _finding(m: Maneuver, left_s: float, held: str) -> Finding:
    enough = left_s >= ANSWER_S
    what = (
        f"only its longest part outside, {left_s:.1f} s, is used for identification"
        if enough
        else f"only {left_s:.1f} s of it lie outside, so it is not used for identification"
    )
    return Finding(
        code="held-out-in-part" if enough else "held-out-within",
        where=m.id,
        value=round(left_s, 2),
        threshold=ANSWER_S,
        message=f"it overlaps held-out data ({held}): {what}",
        remedy=(
            "To identify from all of it, hold out another maneuver with `auvident segment "
            "--hold-out`."
        ),
    )


def _chosen(maneuvers: Maneuvers, plane: Plane) -> list[Maneuver]:
    return [m for m in maneuvers.maneuvers if m.role == "identify" and m.shows(plane)]


def _held_out(trial: str, maneuvers: Maneuvers, plane: Plane) -> list[Maneuver]:
    own = [m for m in maneuvers.maneuvers if m.role == "validate" and m.trial == trial]
    return [m for m in own if m.shows(plane)]


def _overlap(a: Maneuver, b: Maneuver) -> bool:
    return a.t_start_s < b.t_end_s and b.t_start_s < a.t_end_s


def _seconds(m: Maneuver) -> float:
    return m.t_end_s - m.t_start_s


def _rows_of(trial: Trial, maneuvers: Sequence[Maneuver]) -> npt.NDArray[np.bool_]:
    """Rows of maneuvers; the one at the end of each is the first of a maneuver that follows."""
    time, half = trial.columns[TIME_COLUMN], 0.5 / trial.rate_hz
    rows = np.zeros(len(time), dtype=bool)
    for m in maneuvers:
        rows |= (time >= m.t_start_s - half) & (time < m.t_end_s - half)
    return rows


def _outside(m: Maneuver, trials: Sequence[Trial], maneuvers: Maneuvers, plane: Plane) -> Maneuver:
    """The longest stretch of a maneuver that is not held out; itself where nothing of it is."""
    (trial,) = (t for t in trials if t.name == m.trial)
    own, held = (_rows_of(trial, x) for x in ([m], _held_out(m.trial, maneuvers, plane)))
    if not (own & held).any():
        return m
    edges = np.flatnonzero(np.diff(np.concatenate(([0], (own & ~held).astype(np.int8), [0]))))
    if not edges.size:
        return m.model_copy(update={"t_end_s": m.t_start_s})
    longest = int(np.argmax(edges[1::2] - edges[::2]))
    first, stop = edges[2 * longest : 2 * longest + 2]
    start = float(trial.columns[TIME_COLUMN][first])
    end = start + float(stop - first) / trial.rate_hz
    return m.model_copy(update={"t_start_s": start, "t_end_s": end})
