"""Series of a run as data frames: the trials with smoothed states, measured against predicted."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import pandas as pd

from auvident.report.html_loop import with_refined
from auvident.schema.channels import TIME_COLUMN
from auvident.schema.trial import Trial

if TYPE_CHECKING:
    from auvident.report.html_data import ReportData

STD = "std_"  # of a column of the estimated states
CLOCK_DIGITS = 6  # [of 1 s] to which two rows are of one time


def with_smoothed(
    trials: Sequence[Trial], maneuvers: pd.DataFrame | None, states: Sequence[pd.DataFrame]
) -> pd.DataFrame:
    """Trials one below the other, with the estimated states of each plane beside the channels."""
    whole = pd.concat([t.table.assign(trial=t.name) for t in trials], ignore_index=True)
    whole["maneuver"] = ""
    if maneuvers is None:
        return whole
    clock = whole[TIME_COLUMN].round(CLOCK_DIGITS)
    rows = pd.MultiIndex.from_arrays([whole["trial"], clock])
    for table in states:
        at = table["maneuver"].map(maneuvers["trial"]), table[TIME_COLUMN].round(CLOCK_DIGITS)
        table = table.set_index(pd.MultiIndex.from_arrays(at))
        table = table[~table.index.duplicated()].reindex(rows)
        here = table["maneuver"].notna().to_numpy() & (whole["maneuver"] == "").to_numpy()
        whole.loc[here, "maneuver"] = table["maneuver"].to_numpy()[here]
        for column in table.columns.drop(["maneuver", TIME_COLUMN]):
            name = f"{str(column).removeprefix(STD)}_smoothed"
            name += "_std" if str(column).startswith(STD) else ""
            if name not in whole:  # the speed is that of the first plane
                whole[name] = table[column].to_numpy()
    return whole


def predictions(planes: "Sequence[ReportData]") -> pd.DataFrame:
    """Measured and predicted channels of every maneuver, the refined model beside the others."""
    found = []
    for data in planes:
        if data.simulation is None:
            continue
        for name, rows in data.simulation.groupby("maneuver", sort=False):
            found.append(with_refined(rows, data, str(name)).assign(plane=data.plane))
    return pd.concat(found, ignore_index=True) if found else pd.DataFrame()
