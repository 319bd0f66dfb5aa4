"""Uninterrupted stretches of a trial in which the inputs of a prediction are known."""

from collections.abc import Sequence

import numpy as np

from auvident.errors import InputError, UsageError
from auvident.schema.artifacts import Maneuver
from auvident.schema.channels import TIME_COLUMN
from auvident.schema.planes import Plane
from auvident.schema.trial import Trial

LEAST_ROWS = 10  # a shorter stretch of inputs says nothing


def uninterrupted(
    trial: Trial, needed: Sequence[str], window_s: tuple[float, float]
) -> list[tuple[float, float]]:
    """First and last time [s] of each stretch in a window where all inputs are known.

    Raises
    ------
    InputError
        The log has no such column.
    UsageError
        There is no such stretch.
    """
    columns = trial.columns
    missing = [c for c in needed if c not in columns]
    if missing:
        raise InputError(
            f"the log has no {missing[0]}",
            f"trial {trial.name}",
            "The simulation needs it as an input.",
        )
    time = columns[TIME_COLUMN]
    known = trial.where_known(needed)
    known &= (time >= window_s[0]) & (time <= window_s[1])
    edges = np.flatnonzero(np.diff(np.concatenate(([False], known, [False]))))
    pairs = [(a, b) for a, b in edges.reshape(-1, 2) if b - a >= LEAST_ROWS]
    if not pairs:
        raise UsageError(
            "there is nothing to simulate: no inputs in the time window",
            f"trial {trial.name}, {time[0]:.1f} to {time[-1]:.1f} s",
            "Widen --from and --to.",
        )
    return [(float(time[a]), float(time[b - 1])) for a, b in pairs]


def as_maneuver(trial: Trial, plane: Plane, start_s: float, end_s: float) -> Maneuver:
    """A stretch as a maneuver, so that it can be cut out of its trial."""
    return Maneuver(
        id=trial.name,
        trial=trial.name,
        kind="straight",
        t_start_s=start_s,
        t_end_s=end_s,
        role="validate",
        plane=plane,
        planes=(plane,),
    )
