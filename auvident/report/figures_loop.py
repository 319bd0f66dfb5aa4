"""Figures of the residual loop: gains, maneuvers before and after, coefficients that moved."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from auvident.report.figures import (
    BLUE,
    GREEN,
    INK,
    PAPER,
    SKY,
    SOFT,
    VERMILLION,
    categories,
    limits,
    new_figure,
    quiet,
    svg,
    thinned,
    unbridged,
)
from auvident.report.figures_coefficients import FOREST_REACH, dots
from auvident.report.figures_prediction import BAND_OPACITY, covered
from auvident.report.html_data import CHANNELS, number, percent
from auvident.report.loop_words import ranked
from auvident.report.numbers import SHOWN_UNITS
from auvident.schema.diagnosis import Candidate, CoefficientComparison

MOST_BARS = 15
MOST_TOLD = 4  # named in an alternative text
LEAST_GAIN = 0.3  # nats, where the logarithmic axis begins: less is nothing
MOST_CHANNELS, MOST_MANEUVERS = 3, 2  # drawn over time
WORTH_DRAWING = 0.05  # of the greatest fall of the residual: channels below it are left out
ROLES = ("validate", "identify")  # a maneuver of each is drawn, where there is one
# column ending, colour, line style, line width, opacity, words
LINES = (
    ("measured", INK, "-", 2.0, 0.4, "measured"),
    ("before", VERMILLION, (0, (4, 2)), 1.1, 1.0, "predicted, identified model"),
    ("after", BLUE, "-", 1.2, 1.0, "predicted, with the effects"),
)


def gains(candidates: Sequence[Candidate], name: str) -> str | None:
    """Gain of the best candidates as bars, in data left out as dots; accepted ones in colour."""
    rows = ranked(candidates)[:MOST_BARS]
    if not rows:
        return None
    figure = new_figure(0.75 + 0.24 * len(rows), width_in=8.2)
    axes = figure.subplots()
    shown = [max(c.gain, LEAST_GAIN) for c in rows]
    colours = [SOFT if c.rejected else BLUE for c in rows]
    axes.barh(range(len(rows)), shown, color=colours, height=0.62)
    for i, c in enumerate(rows):
        axes.text(shown[i] * 1.08, i, number(c.gain), va="center", fontsize=8)
        if c.held_back_gain is not None and c.held_back_gain > LEAST_GAIN:
            axes.plot(c.held_back_gain, i, "D", color=GREEN, mec=PAPER, mew=0.8, ms=6)
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(lambda x, _: f"{x:g}")
    axes.xaxis.set_minor_formatter(lambda x, _: "")
    most = max(max(c.gain, c.held_back_gain or 0.0) for c in rows)
    axes.set_xlim(LEAST_GAIN, 3.0 * max(most, 10.0 * LEAST_GAIN))
    axes.set_ylim(len(rows) - 0.4, -0.6)
    categories(axes.yaxis, [c.id for c in rows])
    axes.set_xlabel("gain in log-likelihood, nats (logarithmic)")
    told = ", ".join(f"{c.id} {number(c.gain)} nats" for c in rows[:MOST_TOLD])
    accepted = ", ".join(c.id for c in rows if not c.rejected) or "none"
    return svg(figure, name, f"Gain in log-likelihood by candidate: {told}; accepted: {accepted}")


def before_after(
    table: pd.DataFrame,
    name: str,
    bands: pd.DataFrame | None = None,
    final: bool = True,
    effects: bool = True,
) -> str | None:
    """The most affected channels in one or two maneuvers, with the residual below each.

    Parameters
    ----------
    table : pandas.DataFrame
        ``diagnose/residuals.parquet``.
    name : str
        Different for each figure of the page.
    bands : pandas.DataFrame or None
        ``refine/simulation.parquet`` or ``validate/simulation.parquet``, for the 95 % band.
    final : bool
        Whether the band is that of the model with the effects.
    effects : bool
        Whether there are any; the prediction with them is not drawn where there are none.
    """
    falls = squared_falls(table)
    if falls.empty:
        return None
    if not effects:
        table = table.drop(columns=[c for c in table.columns if str(c).endswith("_after")])
    channels, maneuvers = most_affected(falls, table)
    figure = new_figure(0.7 + 2.1 * len(channels))
    height = figure.get_figheight()
    grid = figure.add_gridspec(
        2 * len(channels),
        len(maneuvers),
        left=0.075,
        right=0.99,
        top=1.0 - 0.55 / height,
        bottom=0.45 / height,
        hspace=0.35,
        wspace=0.14,
        height_ratios=[1.0, 0.55] * len(channels),
    )
    for j, maneuver in enumerate(maneuvers):
        rows = table[table["maneuver"] == maneuver]
        first: Axes | None = None
        for i, column in enumerate(channels):
            upper = figure.add_subplot(grid[2 * i, j], sharex=first)
            first = first or upper
            lower = figure.add_subplot(grid[2 * i + 1, j], sharex=upper)
            own = None if bands is None else bands[bands["maneuver"] == maneuver]
            share = _band(upper, own, column, BLUE if final else VERMILLION)
            _panel(upper, lower, rows, column)
            if share is not None:
                upper.set_title(f"{percent(share)} in the band", loc="right")
            quiet(upper)
            if i + 1 < len(channels):
                quiet(lower)
            if i == 0:
                upper.set_title(f"{maneuver} ({rows['role'].iloc[0]})")
        lower.set_xlabel("time from the start of the maneuver, s")
    held = bands is not None and any(f"{c}_lo" in bands for c in channels)
    _legend(figure, any(f"{c}_after" in table for c in channels), held, final)
    return svg(figure, name, _falls_told(falls, channels, maneuvers))


def _falls_told(falls: pd.DataFrame, channels: Sequence[str], maneuvers: Sequence[str]) -> str:
    symbols = {column: symbol for symbol, column, _, _ in CHANNELS}
    told = []
    for maneuver in maneuvers:
        own = (f"{symbols[c]} {number(float(falls[c][maneuver]), 2)}" for c in channels)
        told.append(f"{maneuver}: {', '.join(own)}")
    return (
        "Most affected channels, measured and predicted, with the residuals; the mean squared "
        f"residual falls, in variances of the channel, {'; '.join(told)}"
    )


def _band(axes: Axes, rows: pd.DataFrame | None, column: str, colour: str) -> float | None:
    """The 95 % band of a channel; the share of the readings in it."""
    if rows is None or f"{column}_lo" not in rows or rows.empty:
        return None
    factor = SHOWN_UNITS.get(next(u for _, c, u, _ in CHANNELS if c == column), ("", 1.0))[1]
    time = rows["time_s"].to_numpy(float)
    low, high = (factor * rows[f"{column}_{end}"].to_numpy(float) for end in ("lo", "hi"))
    at, low, high = thinned(time - time[0], low, high)
    axes.fill_between(at, low, high, color=colour, alpha=BAND_OPACITY, lw=0.0)
    return covered(rows, [column])


def squared_falls(table: pd.DataFrame) -> pd.DataFrame:
    """Fall of the mean squared residual by maneuver and channel, over the channel's variance.

    Where there is no prediction after, the mean square itself. Columns are those of the channels.
    """
    found = {}
    for _, column, _, _ in CHANNELS:
        if f"{column}_before" not in table or f"{column}_measured" not in table:
            continue
        measured = table[f"{column}_measured"]
        squares = (measured - table[f"{column}_before"]) ** 2
        if f"{column}_after" in table and not table[f"{column}_after"].isna().all():
            after = (measured - table[f"{column}_after"]) ** 2
            fall = squares - after
            squares = fall if fall.abs().max() > 0.0 else squares
        spread = float(measured.var()) or 1.0
        found[column] = (squares / spread).groupby(table["maneuver"], sort=False).mean()
    return pd.DataFrame(found)


def most_affected(falls: pd.DataFrame, table: pd.DataFrame) -> tuple[list[str], list[str]]:
    """Channels and maneuvers to draw: one held out and one that identified first."""
    mean = falls.mean().abs().sort_values(ascending=False)  # where it got worse is told as well
    channels = [c for c in mean.index if mean[c] >= WORTH_DRAWING * mean.iloc[0]][:MOST_CHANNELS]
    best = falls[channels].sum(axis=1).abs().sort_values(ascending=False)
    first = table.drop_duplicates("maneuver")
    roles = dict(zip(first["maneuver"], first["role"], strict=True))
    firsts = [next((m for m in best.index if roles[m] == r), None) for r in ROLES]
    order = dict.fromkeys([*(m for m in firsts if m is not None), *best.index])
    return channels, list(order)[:MOST_MANEUVERS]


def _panel(upper: Axes, lower: Axes, rows: pd.DataFrame, column: str) -> None:
    words, unit = next((w, u) for _, c, u, w in CHANNELS if c == column)
    shown, factor = SHOWN_UNITS.get(unit, (unit, 1.0))
    time = rows["time_s"].to_numpy(float) - float(rows["time_s"].iloc[0])
    values = {
        ending: rows[f"{column}_{ending}"].to_numpy(float) * factor
        for ending, *_ in LINES
        if f"{column}_{ending}" in rows
    }
    for ending, colour, dashes, width, opacity, _ in LINES:
        if ending in values:
            _line(upper, time, values[ending], (colour, dashes, width, opacity))
        if ending in values and ending != "measured":
            residual = values["measured"] - values[ending]
            _line(lower, time, residual, (colour, dashes, width, opacity))
    lower.axhline(0.0, color=SOFT, lw=0.7)
    upper.set_ylim(*limits(np.concatenate(list(values.values())), np.array([])))
    upper.set_xlim(time[0], max(time[-1], time[0] + 1e-9))
    lower.locator_params(axis="y", nbins=4)
    upper.set_ylabel(f"{words}\n{shown}")
    lower.set_ylabel(f"residual\n{shown}")


def _line(axes: Axes, time: np.ndarray, y: np.ndarray, look: tuple[Any, ...]) -> None:
    colour, dashes, width, opacity = look
    axes.plot(*thinned(*unbridged(time, y)), color=colour, ls=dashes, lw=width, alpha=opacity)


def _legend(figure: Figure, with_after: bool, with_band: bool, final: bool) -> None:
    handles: list[Line2D | Patch] = [
        Line2D([], [], color=colour, ls=dashes, lw=width, alpha=opacity, label=words)
        for ending, colour, dashes, width, opacity, words in LINES
        if with_after or ending != "after"
    ]
    if with_band:
        words = f"95 % band of the {'final' if final else 'identified'} model"
        colour = BLUE if final else VERMILLION
        handles.append(Patch(color=colour, alpha=BAND_OPACITY, lw=0.0, label=words))
    figure.legend(
        handles=handles, loc="upper left", ncols=4, bbox_to_anchor=(0.07, 1.0), borderaxespad=0.1
    )


def moves(coefficients: Sequence[CoefficientComparison], name: str) -> str | None:
    """Coefficients before and after against the estimate from geometry."""
    rows = [c for c in coefficients if c.prior_std > 0.0]
    if not rows:
        return None
    figure = new_figure(0.9 + 0.235 * len(rows), width_in=8.2)
    axes = figure.subplots()
    prior, unit = np.array([(c.prior, c.prior_std) for c in rows]).T
    looks = (("before", {"color": VERMILLION, "mfc": "none"}), ("after", {"color": BLUE}))
    for shift, (when, look) in zip((-0.14, 0.14), looks, strict=True):
        value, std = (np.array([getattr(c, when + end) for c in rows]) for end in ("", "_std"))
        whole = np.full(len(rows), True)
        dots(axes, (value - prior) / unit, std / unit, whole, shift=shift, ms=4, lw=1.5, **look)
    axes.axvspan(-1.0, 1.0, color=SKY, alpha=0.2, lw=0)
    axes.axvline(0.0, color=SOFT, lw=0.8)
    axes.set_xlim(-FOREST_REACH, FOREST_REACH)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    categories(axes.yaxis, [c.symbol for c in rows])
    axes.set_xlabel("(value − prior) / prior standard deviation")
    far = sorted(rows, key=lambda c: -abs(c.after - c.before) / c.prior_std)[:MOST_TOLD]
    told = ", ".join(
        f"{c.symbol} from {number((c.before - c.prior) / c.prior_std, 2)} to "
        f"{number((c.after - c.prior) / c.prior_std, 2)}"
        for c in far
    )
    return svg(
        figure,
        name,
        f"{len(rows)} coefficients without and with the effects, in prior standard deviations "
        f"from the prior; farthest moved: {told}",
    )
