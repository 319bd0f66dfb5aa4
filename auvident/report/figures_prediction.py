"""Figures of the predictions: a maneuver measured, predicted by the model and by the estimate."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from auvident.report.figures import (
    BLUE,
    GREEN,
    GRID,
    INK,
    SOFT,
    VERMILLION,
    limits,
    new_figure,
    quiet,
    svg,
    thinned,
    unbridged,
)
from auvident.report.html_data import CHANNELS, number, percent, quantity
from auvident.report.numbers import SHOWN_UNITS
from auvident.schema.artifacts import ChannelMetrics, ManeuverMetrics
from auvident.schema.planes import PLANE_ROWS
from auvident.schema.spin import share

# column ending, colour, line style, line width, words; drawn in this order
LINES = (
    ("ase", VERMILLION, (0, (4, 2)), 1.0, "{prior} alone"),
    ("measured", INK, "-", 2.0, "measured"),
    ("simulated", BLUE, "-", 1.2, "identified model"),
    ("refined", GREEN, (0, (5, 1)), 1.2, "final model, with the effects"),
)
BAND_OPACITY = 0.18
BAND_WORDS = "its 95 % band"
ENDS = ("lo", "hi")
MEASURED_OPACITY = 0.45  # so that the model on top of it is seen
LEAST_HELM_DEG = 1.0  # span of the axis: a constant helm is no noise
RIBBON_POINTS = 120
FULL_TURN_RAD = 2.0 * np.pi
ONCE_ROUND_WORDS = " (of the track: its first turn)"
WITH_TRACK = 0.64  # share of the width left to the channels


def prediction(
    table: pd.DataFrame,
    after: ManeuverMetrics,
    before: ManeuverMetrics | None,
    name: str,
    prior: str = "ASE",
) -> str:
    """One maneuver: its inputs, each channel, and the track where there is one.

    Parameters
    ----------
    table : pandas.DataFrame
        Rows of the maneuver of ``validate/simulation.parquet``.
    after, before : ManeuverMetrics
        Errors of the model and of the estimate from geometry.
    name : str
        Different for each figure of the page.
    prior : str
        What the model started from.
    """
    rows = [c for c in CHANNELS if f"{c[1]}_measured" in table]
    has_track = "north_m_measured" in table
    figure = new_figure(1.0 + 1.12 * len(rows) + 0.6)
    grid = figure.add_gridspec(
        len(rows) + 1,
        1,
        left=0.085,
        right=WITH_TRACK if has_track else 0.99,
        top=0.93,
        bottom=0.075,
        hspace=0.38,
        height_ratios=[0.6, *[1.0] * len(rows)],
    )
    time = table["time_s"].to_numpy(float)
    time = time - time[0]
    first = figure.add_subplot(grid[0])
    _inputs(first, time, table, after)
    for i, (channel, column, unit, words) in enumerate(rows):
        axes = figure.add_subplot(grid[i + 1], sharex=first)
        _channel(axes, time, table, column, unit)
        axes.set_ylabel(f"{words}\n{SHOWN_UNITS.get(unit, (unit,))[0]}")
        final = _final_error(table, [column])
        _errors(axes, channel, after.channels, before.channels if before else {}, prior, final)
        _add_coverage(axes, covered(table, [column]))
        if i + 1 < len(rows):
            quiet(axes)
    quiet(first)
    axes.set_xlabel("time from the start of the maneuver, s")
    axes.set_xlim(time[0], time[-1])
    if has_track:
        _track(figure, table, after, before, prior)
    ends = {str(c).rpartition("_")[2] for c in table.columns}
    cut = has_track and not _once_round(table).all()
    words = BAND_WORDS + ONCE_ROUND_WORDS * cut if "hi" in ends else ""
    _legend(figure, prior, "refined" in ends, words)
    return svg(figure, name, _caption(table, after, rows))


def covered(table: pd.DataFrame, columns: Sequence[str]) -> float | None:
    """Share of the readings of columns that lie within the band; None without a band."""
    inside, seen = 0, 0
    for column in columns:
        if f"{column}_lo" not in table or f"{column}_measured" not in table:
            continue
        low, high = (table[f"{column}_{end}"].to_numpy(float) for end in ENDS)
        y = table[f"{column}_measured"].to_numpy(float)
        there = np.isfinite(y) & np.isfinite(low) & np.isfinite(high)
        inside += int(((y >= low) & (y <= high) & there).sum())
        seen += int(there.sum())
    return inside / seen if seen else None


def _add_coverage(axes: Axes, share: float | None) -> None:
    text = axes.get_title("right")
    if share is not None and text:
        axes.set_title(f"{text} · {percent(share)} in the band", loc="right", fontsize=8.5, pad=3)


def _caption(
    table: pd.DataFrame, after: ManeuverMetrics, rows: Sequence[tuple[str, str, str, str]]
) -> str:
    """The errors in words."""
    told = []
    for channel, column, unit, _ in rows:
        final = _final_error(table, [column])
        error = after.channels[channel].rmse if channel in after.channels else None
        error = error if final is None else final
        if error is not None:
            told.append(f"{channel} {quantity(error, unit, 2)}")
    which = "Held-out" if after.role == "validate" else "Identifying"
    errors = f"; RMSE {', '.join(told)}" if told else ""
    share = covered(table, [column for _, column, _, _ in rows])
    band = "" if share is None else f"; the 95 % band holds {percent(share)} of the readings"
    return f"{which} {after.kind} {after.id}, {after.duration_s:.0f} s, predicted{errors}{band}"


def _inputs(axes: Axes, time: np.ndarray, table: pd.DataFrame, metrics: ManeuverMetrics) -> None:
    control = np.degrees(table["control_rad"].to_numpy(float))
    axes.plot(*thinned(time, control), color=SOFT, drawstyle="steps-post", lw=1.0)
    surface = next(r.fin for r in PLANE_ROWS if f"{r.columns[1]}_measured" in table)
    axes.set_ylabel(f"{surface}\ndeg")
    middle, half = 0.5 * (control.max() + control.min()), 0.5 * (control.max() - control.min())
    half = max(1.15 * half, 0.5 * LEAST_HELM_DEG)
    axes.set_ylim(middle - half, middle + half)
    low, high = table["rpm"].min(), table["rpm"].max()
    rate = f"{low:.0f}" if high - low < 1.0 else f"{low:.0f} to {high:.0f}"
    axes.set_title(f"propeller {rate} rpm", loc="right", fontsize=8.5, color=SOFT)
    axes.locator_params(axis="y", nbins=4)


def _channel(axes: Axes, time: np.ndarray, table: pd.DataFrame, column: str, unit: str) -> None:
    factor = SHOWN_UNITS.get(unit, (unit, 1.0))[1]
    start, band = 0.0, np.array([])
    if column in ("heading_rad",):  # as turned since the start, not the compass
        start = factor * float(table[f"{column}_simulated"].iloc[0])
    if f"{column}_lo" in table:
        low, high = (factor * table[f"{column}_{e}"].to_numpy(float) - start for e in ENDS)
        band = np.concatenate([x[np.isfinite(x)] for x in (low, high)])
        at, low, high = thinned(time, low, high)
        axes.fill_between(at, low, high, color=_band_colour(table), alpha=BAND_OPACITY, lw=0.0)
    values = {}
    for ending, colour, dashes, width, _ in LINES:
        if f"{column}_{ending}" not in table:
            continue
        y = table[f"{column}_{ending}"].to_numpy(float) * factor - start
        values[ending] = y
        opacity = MEASURED_OPACITY if ending == "measured" else 1.0
        line = thinned(*unbridged(time, y))
        axes.plot(*line, color=colour, ls=dashes, lw=width, alpha=opacity)
    inside = np.concatenate([band, *(values[e] for e in values if e != "ase")])
    axes.set_ylim(*limits(inside, values.get("ase", np.array([]))))
    axes.locator_params(axis="y", nbins=5)


def _band_colour(table: pd.DataFrame) -> str:
    """Colour of the model that the band is of: the final one, where that is another."""
    return GREEN if any(str(c).endswith("_refined") for c in table.columns) else BLUE


def _errors(
    axes: Axes,
    channel: str,
    after: Mapping[str, ChannelMetrics],
    before: Mapping[str, ChannelMetrics],
    prior: str,
    final: float | None = None,
) -> None:
    """Errors above a panel; those of the final model first, where it is another one."""
    found = after.get(channel)
    if found is None:
        return
    if final is not None:
        axes.set_title(
            _three_errors(found, before.get(channel), prior, final),
            loc="right",
            fontsize=8.5,
            pad=3,
        )
        return
    text = f"RMSE {quantity(found.rmse, found.unit)}"
    if share(channel, found.rmse, found.nrmse) is not None:
        text += f" · NRMSE {number(found.nrmse, 2)}"
    if channel in before:
        text += f" ({prior} {quantity(before[channel].rmse, found.unit)})"
    axes.set_title(text, loc="right", fontsize=8.5, pad=3)


def _three_errors(
    found: ChannelMetrics, before: ChannelMetrics | None, prior: str, final: float
) -> str:
    text = f"RMSE {quantity(final, found.unit)} (identified {quantity(found.rmse, found.unit)}"
    return text + (f", {prior} {quantity(before.rmse, found.unit)})" if before else ")")


def _final_error(table: pd.DataFrame, columns: Sequence[str]) -> float | None:
    """Error of the refined model over columns together; None where there is no such model."""
    if any(f"{c}_refined" not in table for c in columns):
        return None
    squares = sum(
        (table[f"{c}_refined"] - table[f"{c}_measured"]).to_numpy(float) ** 2 for c in columns
    )
    return float(np.sqrt(np.nanmean(squares)))


def _track(
    figure: Figure,
    table: pd.DataFrame,
    after: ManeuverMetrics,
    before: ManeuverMetrics | None,
    prior: str,
) -> None:
    axes = figure.add_axes((WITH_TRACK + 0.075, 0.22, 0.995 - WITH_TRACK - 0.075, 0.6))
    if {f"{axis}_m_{end}" for axis in ("north", "east") for end in ENDS} <= set(table):
        band = PolyCollection(
            list(_ribbon(table[_once_round(table)])),
            color=_band_colour(table),
            alpha=BAND_OPACITY,
            lw=0.0,
        )
        axes.add_collection(band, autolim=False)
    for ending, colour, dashes, width, _ in LINES:
        if f"north_m_{ending}" in table:
            east, north = (table[f"{c}_m_{ending}"].to_numpy(float) for c in ("east", "north"))
            opacity = MEASURED_OPACITY if ending == "measured" else 1.0
            axes.plot(*thinned(east, north), color=colour, ls=dashes, lw=width, alpha=opacity)
    seen = [
        table[f"{c}_m_{e}"].to_numpy(float)
        for e in ("measured", "simulated")
        for c in ("east", "north")
    ]
    _square(axes, np.concatenate([seen[0], seen[2]]), np.concatenate([seen[1], seen[3]]))
    axes.plot(0.0, 0.0, "o", color=INK, ms=4)
    axes.axhline(0.0, color=GRID, lw=0.6)
    axes.set_xlabel("east of the start, m")
    axes.set_ylabel("north of the start, m")
    found = after.channels.get("track")
    if found is not None:
        final = _final_error(table, ["north_m", "east_m"])
        text = f"track: RMSE {quantity(found.rmse if final is None else final, found.unit)}"
        text += "" if final is None else f", identified {quantity(found.rmse, found.unit)}"
        if before and "track" in before.channels:
            text += f", {prior} {quantity(before.channels['track'].rmse, 'm')}"
        axes.set_title(text, fontsize=8.5)


def _once_round(table: pd.DataFrame) -> np.ndarray:
    """Rows of a track up to its first full turn; a band that goes on would lie over itself."""
    heading = "heading_rad_simulated"
    if heading not in table:
        return np.ones(len(table), dtype=bool)
    turned = np.abs(table[heading] - table[heading].iloc[0]).to_numpy(float)
    return np.maximum.accumulate(np.nan_to_num(turned)) <= FULL_TURN_RAD


def _ribbon(table: pd.DataFrame) -> np.ndarray:
    """The band across the track as quadrilaterals, shape (n, 4, 2), all turning the same way."""
    kept = slice(None, None, max(len(table) // RIBBON_POINTS, 1))
    low, high = (
        np.column_stack([table[f"{a}_m_{end}"].to_numpy(float)[kept] for a in ("east", "north")])
        for end in ENDS
    )
    seen = np.isfinite(low + high).all(axis=1)
    middle, half = 0.5 * (low + high)[seen], 0.5 * (high - low)[seen]
    if len(middle) < 2:
        return np.empty((0, 4, 2))
    along = np.gradient(middle, axis=0)
    length = np.maximum(np.hypot(*along.T), 1e-12)
    across = np.column_stack([-along[:, 1], along[:, 0]]) / length[:, None]
    aside = across * np.hypot(*(half * across).T)[:, None]
    left, right = middle + aside, middle - aside
    quads = np.stack([left[:-1], left[1:], right[1:], right[:-1]], axis=1)
    first, second = quads[:, 2] - quads[:, 0], quads[:, 3] - quads[:, 1]
    turned = first[:, 0] * second[:, 1] < first[:, 1] * second[:, 0]
    return np.where(turned[:, None, None], quads[:, ::-1], quads)


def _square(axes: Axes, east: np.ndarray, north: np.ndarray) -> None:
    """The same scale both ways, around what was measured and predicted."""
    middle = [(np.nanmin(x) + np.nanmax(x)) / 2.0 for x in (east, north)]
    half = 0.56 * max(float(np.nanmax(x) - np.nanmin(x)) for x in (east, north))
    half = max(half, 0.5)
    axes.set_xlim(middle[0] - half, middle[0] + half)
    axes.set_ylim(middle[1] - half, middle[1] + half)
    axes.set_aspect("equal")
    axes.locator_params(nbins=6)


def _legend(figure: Figure, prior: str, refined: bool, band: str) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Line2D | Patch] = [
        Line2D(
            [],
            [],
            color=c,
            ls=d,
            lw=w,
            label=words.format(prior=prior),
            alpha=MEASURED_OPACITY if e == "measured" else 1.0,
        )
        for e, c, d, w, words in (*LINES[1:], LINES[0])
        if e != "refined" or refined
    ]
    if band:
        colour = GREEN if refined else BLUE
        patch = Patch(color=colour, alpha=BAND_OPACITY, lw=0.0, label=band)
        handles.insert(3 if refined else 2, patch)  # behind the line that it is about
    figure.legend(
        handles=handles,
        loc="upper left",
        ncols=len(handles),
        bbox_to_anchor=(0.08, 1.0),
        borderaxespad=0.1,
    )
