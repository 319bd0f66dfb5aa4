"""Several short trials laid end to end, so that one figure shows them."""

from collections.abc import Sequence

import pandas as pd

from auvident.schema.artifacts import Maneuver
from auvident.schema.channels import RECORD_COLUMN, TIME_COLUMN
from auvident.schema.trial import Trial

SPACE = 0.01  # between two trials, as a share of all of them


def joined(trials: Sequence[Trial], maneuvers: Sequence[Maneuver]) -> tuple[Trial, list[Maneuver]]:
    """One trial made of several, each after the other, with the maneuvers moved along.

    Parameters
    ----------
    trials : sequence of Trial
    maneuvers : sequence of Maneuver
        Those of other trials are left out.

    Returns
    -------
    Trial
        Time begins at 0; an empty row keeps the lines apart. One trial stays as it is.
    list of Maneuver
        With times of the joined trial, and its name as theirs.
    """
    if len(trials) == 1:
        return trials[0], [m for m in maneuvers if m.trial == trials[0].name]
    spans = [float(t.table[TIME_COLUMN].iloc[-1] - t.table[TIME_COLUMN].iloc[0]) for t in trials]
    space, start = SPACE * sum(spans), 0.0
    pieces, moved = [], []
    name = f"{trials[0].name} to {trials[-1].name}"
    for trial, span in zip(trials, spans, strict=True):
        shift = start - float(trial.table[TIME_COLUMN].iloc[0])
        table = trial.table.assign(**{TIME_COLUMN: trial.table[TIME_COLUMN] + shift})
        between = {TIME_COLUMN: [start + span + 0.5 * space], RECORD_COLUMN: [0]}
        pieces += [table, pd.DataFrame(between)]
        moved += [
            m.model_copy(
                update={
                    "t_start_s": m.t_start_s + shift,
                    "t_end_s": m.t_end_s + shift,
                    "trial": name,
                }
            )
            for m in maneuvers
            if m.trial == trial.name
        ]
        start += span + space
    return Trial.from_table(
        name, pd.concat(pieces[:-1], ignore_index=True), trials[0].rate_hz
    ), moved


def groups(trials: Sequence[Trial], apart: int, together: int) -> list[list[Trial]]:
    """Trials by figure: one each when they are few (`apart`), else some `together`."""
    size = 1 if len(trials) <= apart else together
    return [list(trials[i : i + size]) for i in range(0, len(trials), size)]
