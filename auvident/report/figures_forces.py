"""The unknown force that would explain the residual, drawn against what it might follow."""

import re

import numpy as np
import numpy.typing as npt
import pandas as pd
from matplotlib.axes import Axes

from auvident.report.figures import BLUE, SOFT, new_figure, quiet, svg
from auvident.report.numbers import PAGE, SHOWN_UNITS
from auvident.schema.planes import HORIZONTAL, VERTICAL

Array = npt.NDArray[np.float64]

FORCE = re.compile(r"force_[A-Z]_(n|nm)$")
UNITS = {"n": "N", "nm": "N m"}
# What a force is drawn against: columns that may hold it, unit, words, whether it is an angle
# that returns after a turn.
AGAINST = (
    *(
        ((s.column, f"{s.column}_measured"), s.unit, s.words, s.wraps)
        for place in (3, 2)
        for s in (HORIZONTAL.states[place], VERTICAL.states[place])
    ),
    (("time_s",), "s", "time in the trial", False),
)
MOST_DOTS = 350  # of a panel
BINS = 18
LEAST_IN_BIN = 5  # dots; fewer have no mean worth drawing
TURN_DEG = 360.0


def unknown_force(table: pd.DataFrame, name: str) -> str | None:
    """Smoothed unknown force and moment against angle and rate of the plane, and time.

    Parameters
    ----------
    table : pandas.DataFrame
        ``diagnose/residuals.parquet``; None is returned when it has no forces.
    name : str
        Different for each figure of the page.
    """
    forces = [c for c in table.columns if FORCE.match(str(c)) and table[c].notna().any()]
    against = [found for entry in AGAINST if (found := _regressor(table, *entry)) is not None]
    if not forces or not against:
        return None
    figure = new_figure(0.6 + 1.55 * len(forces))
    panels = figure.subplots(len(forces), len(against), squeeze=False, sharex="col")
    for i, force in enumerate(forces):
        _, axis, unit = str(force).split("_")
        for j, (x, label) in enumerate(against):
            _panel(panels[i, j], x, table[force].to_numpy(float))
            panels[i, j].set_ylabel(f"{axis}, {UNITS[unit]}")
            if j:
                panels[i, j].sharey(panels[i, 0])
            if i + 1 == len(forces):
                panels[i, j].set_xlabel(label)
            else:
                quiet(panels[i, j])
    drawn = ", ".join(label.partition(",")[0] for _, label in against)
    told = ", ".join(_spread_told(str(f), table[f].to_numpy(float)) for f in forces)
    return svg(figure, name, f"Smoothed unknown force against {drawn}; 95 % of it within {told}")


def _spread_told(force: str, values: Array) -> str:
    _, axis, unit = force.split("_")
    low, high = np.nanquantile(values, (0.025, 0.975))
    return f"{axis} {PAGE.interval(float(low), float(high))} {UNITS[unit]}"


def _regressor(
    table: pd.DataFrame, columns: tuple[str, ...], unit: str, words: str, wraps: bool
) -> tuple[Array, str] | None:
    """Values in the unit that people read, with their label; None when there are none."""
    column = next((c for c in columns if c in table and table[c].notna().any()), None)
    if column is None:
        return None
    shown, factor = SHOWN_UNITS.get(unit, (unit, 1.0))
    values = table[column].to_numpy(float) * factor
    return (np.mod(values, TURN_DEG) if wraps else values), f"{words}, {shown}"


def _panel(axes: Axes, x: Array, y: Array) -> None:
    seen = np.isfinite(x) & np.isfinite(y)
    x, y = x[seen], y[seen]
    step = max(len(x) // MOST_DOTS, 1)
    axes.plot(x[::step], y[::step], ".", color=SOFT, ms=2.5, alpha=0.55)
    axes.axhline(0.0, color=SOFT, lw=0.7)
    axes.plot(*binned(x, y), color=BLUE, lw=1.6)
    axes.locator_params(axis="y", nbins=5)


def binned(x: Array, y: Array) -> tuple[Array, Array]:
    """Mean of y over equal pieces of x; NaN where there are too few dots."""
    if not x.size or float(np.ptp(x)) == 0.0:
        return np.array([]), np.array([])
    edges = np.linspace(float(x.min()), float(x.max()), BINS + 1)
    place = np.clip(np.digitize(x, edges) - 1, 0, BINS - 1)
    count = np.bincount(place, minlength=BINS)
    total = np.bincount(place, weights=y, minlength=BINS)
    enough = count >= LEAST_IN_BIN
    mean = np.where(enough, total / np.maximum(count, 1), np.nan)
    return 0.5 * (edges[1:] + edges[:-1]), mean
