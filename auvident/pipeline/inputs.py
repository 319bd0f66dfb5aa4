"""A table of inputs as a trial, so that a model can be flown on what never was in a log."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from auvident.errors import InputError
from auvident.schema.channels import (
    BY_COLUMN,
    BY_QUANTITY,
    RECORD_COLUMN,
    TIME_COLUMN,
    sampled_flag,
)
from auvident.schema.logs import UNITS
from auvident.schema.trial import Trial

if TYPE_CHECKING:
    import pandas as pd

NAME = "inputs"
UNEVEN = 0.02  # of a step, by which a row may be off its time
FEWEST_ROWS = 10  # `auvident simulate` wants so many of a log
INPUTS = "the inputs"


def trial_of(table: "pd.DataFrame", needed: Sequence[str]) -> Trial:
    """A table of inputs as a trial.

    Parameters
    ----------
    table : pandas.DataFrame
        ``time_s`` in equal steps, the inputs (``rudder_rad`` or ``rudder_deg``, with the signs of
        the axes, ``rpm``); other channels of a trial as far as they are there, with their unit as
        suffix. Further columns are left alone.
    needed : sequence of str
        Inputs that the model needs, as a trial names them.

    Raises
    ------
    InputError
        A column is missing or no number, or the rows are not evenly spaced; names it.
    """
    found = _channels(table)
    for column in (TIME_COLUMN, *needed):
        _refuse_without(found, column)
    rate_hz = _rate_hz(found[TIME_COLUMN].to_numpy())
    marks: dict[str, Any] = {sampled_flag(c): True for c in found.columns if c in BY_COLUMN}
    marks[RECORD_COLUMN] = 0
    marks |= {c: table[c].to_numpy() for c in marks if c in table}
    found = found.assign(**marks).reset_index(drop=True)
    return Trial.from_table(NAME, _with_end(found, rate_hz), rate_hz)


def _channels(table: "pd.DataFrame") -> "pd.DataFrame":
    """Time and the channels of a table in SI, under the names that they have in a trial."""
    import pandas as pd

    own = {}
    for name in map(str, table.columns):
        quantity, _, unit = name.rpartition("_")
        if name == TIME_COLUMN or name in BY_COLUMN:
            own[name] = _numbers(table, name, 1.0)
        elif quantity in BY_QUANTITY and unit in UNITS:
            column = BY_QUANTITY[quantity]
            dimension, factor = UNITS[unit]
            if dimension == column.unit:
                own[column.column] = _numbers(table, name, factor)
    return pd.DataFrame(own)


def _numbers(table: "pd.DataFrame", name: str, factor: float) -> "np.ndarray":
    if table[name].dtype.kind in "mM":  # their numbers are nanoseconds
        raise InputError(f"column {name} is of dates", INPUTS, "Give it in seconds, as floats.")
    try:
        return factor * table[name].to_numpy(dtype=float, na_value=np.nan)
    except (TypeError, ValueError):
        raise InputError(f"column {name} is not of numbers", INPUTS, "Give it as floats.") from None


def _refuse_without(found: "pd.DataFrame", column: str) -> None:
    if column not in found:
        raise InputError(
            f"there is no column {column}",
            INPUTS,
            "A simulation needs time_s, rpm and the fin of its plane: rudder_rad or rudder_deg, "
            "elevator_rad or elevator_deg.",
        )


def _rate_hz(time: "np.ndarray") -> float:
    """Rows per second of evenly spaced rows."""
    if len(time) < FEWEST_ROWS:
        raise InputError(
            f"there are {len(time)} rows", INPUTS, f"{FEWEST_ROWS} are the fewest to simulate."
        )
    step = float(np.median(np.diff(time)))
    rate = 1.0 / step if step > 0.0 else np.nan
    off = np.abs((time - time[0]) * rate - np.arange(len(time)))
    if not (off <= UNEVEN).all():  # nor a NaN
        row = int(np.argmax(~(off <= UNEVEN)))
        raise InputError(
            f"the rows are not evenly spaced: row {row} is at {time[row]:g} s",
            f"{INPUTS}, time_s",
            "Put them on one clock (numpy.interp), or give the path of a log.",
        )
    return float(rate)


def _with_end(table: "pd.DataFrame", rate_hz: float) -> "pd.DataFrame":
    """The table with the end of its last step as another row: every row of it is simulated."""
    import pandas as pd

    last = table.iloc[[-1]].assign(**{TIME_COLUMN: table[TIME_COLUMN].iloc[-1] + 1.0 / rate_hz})
    return pd.concat([table, last], ignore_index=True)
