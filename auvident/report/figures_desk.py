"""Figure of a maneuver flown on the desk: its track and its channels over time, with the band."""

import io

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from auvident.report.figures import BLUE, INK, SOFT, new_figure, quiet, style
from auvident.report.numbers import SHOWN_UNITS, unit_text
from auvident.report.taken import is_taken
from auvident.schema.channels import TIME_COLUMN
from auvident.schema.desk import DeskCurve, DeskResult
from auvident.schema.planes import BY_PLANE

BAND_OPACITY, WAY_OPACITY = 0.22, 0.3
WITH_TRACK = 0.62  # share of the width left to the channels
WAYS = {"horizontal": ("east_m", "north_m"), "vertical": ("along_m", "depth_m")}
TOWARDS = {"horizontal": "to starboard", "vertical": "bow up"}  # of a positive angle of the fin
WAY_WORDS = {
    "horizontal": ("to starboard of the first course, m", "along the first course, m"),
    "vertical": ("along, m", "depth, m"),
}


def desk_figure(result: DeskResult, table: pd.DataFrame, ways: np.ndarray, form: str) -> bytes:
    """The picture as SVG or PNG.

    Parameters
    ----------
    result : DeskResult
    table : pandas.DataFrame
        Motion, with ``_low`` and ``_high`` where models were drawn.
    ways : (n, 2, k) array
        Where some of the drawn models went, in the order of `table`.
    form : str
        ``svg`` or ``png``.
    """
    row = BY_PLANE[result.plane]
    with style():
        channels = [(s.column, s.unit, s.words) for s in row.states]
        figure = new_figure(1.1 * (len(channels) + 1) + 0.9)
        grid = figure.add_gridspec(
            len(channels) + 1, 1, left=0.085, right=WITH_TRACK, top=0.92, bottom=0.09, hspace=0.3
        )
        time = table[TIME_COLUMN].to_numpy(float)
        first = figure.add_subplot(grid[0])
        _helm(first, time, table, row.control_columns[0], f"{row.fin}, {TOWARDS[row.name]}")
        for i, (column, unit, words) in enumerate(channels):
            axes = figure.add_subplot(grid[i + 1], sharex=first)
            _channel(axes, time, table, column, unit, words)
            if i + 1 < len(channels):
                quiet(axes)
        quiet(first)
        axes.set_xlabel("time from the first execute, s")
        axes.set_xlim(time[0], time[-1])
        _beside(figure, result, table, ways)
        numbers = "/".join(f"{v:g}" for v in result.parameters.values())
        figure.suptitle(
            f"{result.vehicle}: {result.maneuver} {numbers}, approach {result.speed_mps:.3g} m/s; "
            "shaded: 90 % of the drawn models, thin: some",
            x=0.085,
            ha="left",
            fontsize=9.5,
            color=INK,
        )
        figure.align_ylabels()
        return _bytes(figure, form)


def _bytes(figure: Figure, form: str) -> bytes:
    if is_taken(figure):
        return b""
    stream = io.BytesIO()
    told = {"Date": None} if form == "svg" else {}
    figure.savefig(stream, format=form, dpi=150, facecolor="white", metadata=told)
    return stream.getvalue()


def helm_lines(table: pd.DataFrame, column: str) -> tuple[np.ndarray, np.ndarray]:
    """Order and angle (n,) of a fin in degrees, positive to starboard or with the bow up.

    The table has the signs of the axes: there a positive angle turns to port, or puts the bow down.
    """
    order = table[column.replace("_rad", "_order_rad")].to_numpy(float)
    return -np.degrees(order), -np.degrees(table[column].to_numpy(float))


def _helm(axes: Axes, time: np.ndarray, table: pd.DataFrame, column: str, words: str) -> None:
    order, angle = helm_lines(table, column)
    axes.plot(time, order, color=SOFT, drawstyle="steps-post", lw=0.9)
    axes.plot(time, angle, color=INK)
    axes.set_ylabel(f"{words}\ndeg")


def _channel(
    axes: Axes, time: np.ndarray, table: pd.DataFrame, column: str, unit: str, words: str
) -> None:
    shown, factor = SHOWN_UNITS.get(unit, (unit, 1.0))
    if f"{column}_low" in table:
        low, high = (factor * table[f"{column}_{end}"].to_numpy(float) for end in ("low", "high"))
        axes.fill_between(time, low, high, color=BLUE, alpha=BAND_OPACITY, lw=0.0)
    axes.plot(time, factor * table[column].to_numpy(float), color=BLUE)
    axes.set_ylabel(f"{words}\n{unit_text(shown)}")
    axes.locator_params(axis="y", nbins=5)


def _beside(figure: Figure, result: DeskResult, table: pd.DataFrame, ways: np.ndarray) -> None:
    """The track; of a spiral the rate by rudder."""
    axes = figure.add_axes((WITH_TRACK + 0.075, 0.2, 0.995 - WITH_TRACK - 0.075, 0.62))
    spiral = next((c for c in result.curves if c.name == "spiral"), None)
    if spiral is not None:
        _spiral(axes, spiral)
        return
    x, y = WAYS[result.plane]
    across, along = table[x].to_numpy(float), table[y].to_numpy(float)
    first = 1 if result.plane == "horizontal" else 0  # north comes before east, along before depth
    for k in range(ways.shape[2]):
        axes.plot(ways[:, first, k], ways[:, 1 - first, k], color=BLUE, lw=0.5, alpha=WAY_OPACITY)
    axes.plot(across, along, color=BLUE)
    axes.plot(across[0], along[0], "o", color=INK, ms=4)
    if result.plane == "vertical":
        axes.invert_yaxis()
    else:
        axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel(WAY_WORDS[result.plane][0])
    axes.set_ylabel(WAY_WORDS[result.plane][1])


def _spiral(axes: Axes, curve: DeskCurve) -> None:
    at = np.array(curve.at)
    for k, words in enumerate(("from starboard", "from port")):
        figures = [row[k] for row in curve.figures]
        values = np.array([np.nan if f.value is None else f.value for f in figures])
        axes.plot(at, values, "o-" if k == 0 else "s--", color=(BLUE, INK)[k], ms=3, label=words)
        if k == 0 and all(f.low is not None and f.high is not None for f in figures):
            low, high = ([getattr(f, end) for f in figures] for end in ("low", "high"))
            axes.fill_between(at, low, high, color=BLUE, alpha=BAND_OPACITY, lw=0.0)
    axes.set_xlabel("rudder, deg, positive to starboard")
    axes.set_ylabel("steady yaw rate, deg/s")
    axes.legend(loc="upper left")
