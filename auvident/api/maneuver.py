"""A standard maneuver that a model has flown."""

from functools import cached_property
from typing import TYPE_CHECKING

import pandas as pd

from auvident.api.frames import figure_frame, finding_frame, range_frame

if TYPE_CHECKING:
    from auvident.api.plots import Panels
    from auvident.schema.desk import DeskResult
    from auvident.stages.desk import Desk


class FlownManeuver:
    """A turning circle, zigzag, spiral, ... flown by a model; see `Model.maneuver`.

    Attributes
    ----------
    table : pandas.DataFrame
        Motion of the model: ``time_s``, fin and its order, ``rpm``, states and way in SI, and
        ``..._low``, ``..._high``, which hold 90 % of the models drawn.
    result : pydantic model
        Everything that is told of it, as ``auvident simulate --maneuver --json`` prints it.
    """

    def __init__(self, desk: "Desk") -> None:
        self._desk = desk
        self.table: pd.DataFrame = desk.table
        self.result: DeskResult = desk.result

    def __repr__(self) -> str:
        numbers = "/".join(f"{value:g}" for value in self.result.parameters.values())
        return f"<{self.result.maneuver} {numbers} of {self.result.vehicle}>"

    @cached_property
    def figures(self) -> pd.DataFrame:
        """Advance, tactical diameter, overshoots, K and T, ... by name: value, low, high, unit."""
        return figure_frame(self.result.figures)

    @cached_property
    def findings(self) -> pd.DataFrame:
        """What to know before the figures are trusted."""
        told = self.result.findings
        return finding_frame(("simulate", self.result.plane, finding) for finding in told)

    @cached_property
    def beyond(self) -> pd.DataFrame:
        """Where it leaves the range that its model was identified from, as of `Model.beyond`."""
        return range_frame(self.result.extrapolation)

    def plot(self) -> "Panels":
        """Fin, states and track with the band of the models drawn.

        Returns
        -------
        Panels
            The matplotlib axes, from top to bottom, then the track.
        """
        from auvident.api.plots import drawn
        from auvident.report.figures_desk import desk_figure

        return drawn(desk_figure, self.result, self.table, self._desk.drawn_ways, "svg")
