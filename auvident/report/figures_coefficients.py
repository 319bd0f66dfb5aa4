"""Figures of the coefficients: before and after the data, on the way, and tied to each other."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import ListedColormap, to_rgb
from matplotlib.ticker import FixedFormatter, FixedLocator

from auvident.report.figures import (
    BLUE,
    GREEN,
    INK,
    ORANGE,
    SKY,
    SOFT,
    VERMILLION,
    categories,
    new_figure,
    svg,
)
from auvident.report.numbers import unit_text
from auvident.schema.artifacts import ModelConstant

ORIGIN_COLOURS = {"identified": BLUE, "kinematic": GREEN, "ase": SOFT, "given": SOFT}
FOREST_REACH = 4.5  # prior standard deviations shown on each side; farther ones get an arrow
HISTORY_COLUMNS = 4
RINGED = 0.95  # correlation beyond which a pair is marked
MOST_HISTORY_POINTS = 24  # of one pass of one coefficient: its panel is small
MOST_TOLD = 4  # coefficients or pairs named in an alternative text
# negative correlations orange, positive ones blue; the weaker, the more the page shows through
SIGNED = ListedColormap(
    [(*to_rgb(ORANGE if x < 0.0 else BLUE), abs(x)) for x in np.linspace(-1.0, 1.0, 41)]
)


def forest(coefficients: Sequence[ModelConstant], name: str) -> str:
    """Posterior against prior, in units of the prior standard deviation, with the data share."""
    rows = [c for c in coefficients if c.prior_std > 0.0]
    figure = new_figure(0.9 + 0.235 * len(rows))
    top = 1.0 - 0.45 / figure.get_figheight()
    left, right = figure.subplots(
        1, 2, sharey=True, gridspec_kw={"width_ratios": [2.6, 1.0], "wspace": 0.04}
    )
    figure.subplots_adjust(left=0.07, right=0.99, top=top, bottom=0.5 / figure.get_figheight())
    places = np.array([(c.value - c.prior) / c.prior_std for c in rows])
    spreads = np.array([c.std / c.prior_std for c in rows])
    origins = np.array([ORIGIN_COLOURS[c.origin] for c in rows])
    for colour in dict.fromkeys(origins.tolist()):
        dots(left, places, spreads, origins == colour, color=colour, ms=4.5, lw=1.6)
    shares = [100.0 * c.data_share for c in rows]
    right.barh(range(len(rows)), shares, color=origins.tolist(), height=0.62)
    left.axvspan(-1.0, 1.0, color=SKY, alpha=0.2, lw=0)
    left.axvline(0.0, color=SOFT, lw=0.8)
    left.set_xlim(-FOREST_REACH, FOREST_REACH)
    left.set_ylim(len(rows) - 0.4, -0.6)
    categories(left.yaxis, [c.symbol for c in rows])
    left.set_xlabel("(value − prior) / prior standard deviation")
    left.set_title("identified ± std; shaded: prior ± std")
    right.set_xlim(0.0, 100.0)
    right.set_xlabel("%")
    right.set_title("share from the data")
    far = sorted(rows, key=lambda c: -abs(c.value - c.prior) / c.prior_std)[:MOST_TOLD]
    told = ", ".join(f"{c.symbol} {(c.value - c.prior) / c.prior_std:+.1f}" for c in far)
    shares = [c.data_share for c in rows] or [0.0]
    caption = (
        f"{len(rows)} coefficients after the data; farthest from the prior, in its standard "
        f"deviations: {told}; {100 * min(shares):.0f} to {100 * max(shares):.0f} % of their "
        "information is from the data"
    )
    return svg(figure, name, caption.replace("-", "−"))


def dots(
    axes: Axes, places: np.ndarray, spreads: np.ndarray, chosen: np.ndarray, **look: Any
) -> None:
    """Values with their standard deviations, one a row; an arrow and the distance beyond the axis.

    Parameters
    ----------
    axes : Axes
    places, spreads : (n,) array
        In prior standard deviations.
    chosen : (n,) array of bool
        Rows that are drawn.
    **look
        Of the dots.
    """
    shift = look.pop("shift", 0.0)
    near = np.flatnonzero(chosen & (np.abs(places) <= FOREST_REACH))
    axes.errorbar(places[near], near + shift, xerr=spreads[near], fmt="o", capsize=0, **look)
    for i in np.flatnonzero(chosen & (np.abs(places) > FOREST_REACH)).tolist():
        side = float(np.sign(places[i]))
        edge = side * (FOREST_REACH - 0.1)
        axes.plot(edge, i + shift, ">" if side > 0 else "<", color=VERMILLION, ms=6)
        if not shift:
            anchor = "right" if side > 0 else "left"
            text = f"{places[i]:+.1f} "
            axes.text(edge - 0.12 * side, i, text, va="center", ha=anchor, fontsize=8)


def history(table: pd.DataFrame, coefficients: Sequence[ModelConstant], name: str) -> str | None:
    """Every estimated coefficient through the passes of the plan, with its band.

    Parameters
    ----------
    table : pandas.DataFrame
        ``identify/history.parquet``.
    coefficients : sequence of ModelConstant
        Their order and prior.
    name : str
        Different for each figure of the page.
    """
    there = set(table["symbol"].unique())
    rows = [c for c in coefficients if c.symbol in there]
    if not rows:
        return None
    passes = table.groupby("order")["cycle"].first()
    starts = [int(o) for o, new in zip(passes.index, passes.diff().ne(0.0), strict=True) if new]
    lines = -(-len(rows) // HISTORY_COLUMNS)
    figure = new_figure(0.5 + 1.3 * lines)
    height = figure.get_figheight()
    grid = figure.add_gridspec(
        lines,
        HISTORY_COLUMNS,
        left=0.055,
        right=0.995,
        top=1.0 - 0.25 / height,
        bottom=0.42 / height,
        hspace=0.42,
        wspace=0.24,
    )
    groups = dict(list(table.groupby("symbol", sort=False)))
    for i, c in enumerate(rows):
        axes = figure.add_subplot(grid[i // HISTORY_COLUMNS, i % HISTORY_COLUMNS])
        _history_panel(axes, groups[c.symbol], c, starts, len(passes))
    last = [groups[c.symbol]["value"].iloc[-1] - c.prior for c in rows if c.prior_std > 0.0]
    spread = [c.prior_std for c in rows if c.prior_std > 0.0]
    most = max((abs(x) / s for x, s in zip(last, spread, strict=True)), default=0.0)
    caption = (
        f"{len(rows)} coefficients through {len(passes)} passes in {len(starts)} cycles; "
        f"at the end at most {most:.1f} prior standard deviations from the prior"
    )
    return svg(figure, name, caption)


def _history_panel(
    axes: Axes, table: pd.DataFrame, c: ModelConstant, starts: Sequence[int], end: int
) -> None:
    for start in starts[1:]:
        axes.axvline(start, color=SOFT, lw=0.7)
    band = (c.prior - c.prior_std, c.prior + c.prior_std)
    axes.axhspan(*band, color=SKY, alpha=0.2, lw=0)
    axes.axhline(c.prior, color=SOFT, lw=0.7, ls=(0, (4, 2)))
    x, value, std = _passes(table)
    seen = np.isfinite(value)
    ends = np.flatnonzero(~seen)  # each pass ends in a row without a value
    outline = [
        np.concatenate(
            [
                np.column_stack([x[p], value[p] - std[p]]),
                np.column_stack([x[p], value[p] + std[p]])[::-1],
            ]
        )
        for p in (slice(a, b) for a, b in zip([0, *ends[:-1] + 1], ends, strict=True))
    ]
    axes.add_collection(PolyCollection(outline, color=BLUE, alpha=0.25, lw=0), autolim=False)
    axes.plot(x[seen], value[seen], color=BLUE, lw=0.6, ls=(0, (1, 2)))  # held between passes
    axes.plot(x, value, color=BLUE, lw=1.2)
    shown = np.concatenate([value[seen], [c.value - c.std, c.value + c.std, c.prior]])
    low, high = float(shown.min()), float(shown.max())
    margin = max(0.12 * (high - low), 0.6 * c.std, 1e-12)
    axes.set_ylim(low - margin, high + margin)
    axes.set_xlim(0, end)
    axes.xaxis.set_major_locator(FixedLocator(starts))
    axes.xaxis.set_major_formatter(FixedFormatter([str(i + 1) for i in range(len(starts))]))
    axes.grid(False, axis="x")
    axes.set_title(f"{c.symbol}, {unit_text(c.unit)}", pad=3)
    axes.locator_params(axis="y", nbins=4)


def _passes(table: pd.DataFrame) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Place (pass + share of the pass done), value and std; NaN between passes."""
    order = table["order"].to_numpy(float)
    whole = table[["time_s", "value", "std"]].to_numpy(float)
    pieces: list[np.ndarray] = []
    for rows in np.split(np.arange(len(order)), np.flatnonzero(np.diff(order)) + 1):
        kept = rows[:: max(len(rows) // MOST_HISTORY_POINTS, 1)]
        length = max(float(whole[rows[-1], 0]), 1e-9)
        piece = whole[kept]
        piece[:, 0] = order[rows[0]] + piece[:, 0] / length
        if len(piece) == 1:  # a fit has one result: hold it over its pass
            piece = np.vstack([piece, piece + np.array([1.0, 0.0, 0.0])])
        pieces += [piece, np.full((1, 3), np.nan)]
    joined = np.vstack(pieces)
    return joined[:, 0], joined[:, 1], joined[:, 2]


def correlations_of(covariance: Mapping[str, Any]) -> np.ndarray:
    """Correlations (n, n) of what was estimated together, as the fit left them.

    Variances widened to the scatter between maneuvers no longer go with the covariances.
    """
    matrix = np.array(covariance.get("matrix", np.zeros((0, 0))), float)
    variance = np.array(covariance.get("fitted_variance", np.diag(matrix)), float)
    np.fill_diagonal(matrix, variance)
    found: np.ndarray = matrix / np.sqrt(np.outer(variance, variance))
    return found


def correlation_matrix(covariance: Mapping[str, Any], name: str) -> str | None:
    """Posterior correlations of all pairs as a map; None without a covariance."""
    symbols = list(covariance.get("symbols", ()))
    if len(symbols) < 2:
        return None
    matrix = correlations_of(covariance)
    size = 1.3 + 0.27 * len(symbols)
    figure = new_figure(size, width_in=size)
    axes = figure.subplots()
    np.fill_diagonal(matrix, np.nan)  # says nothing
    axes.imshow(matrix, cmap=SIGNED, vmin=-1.0, vmax=1.0, interpolation="none")
    for axis in (axes.xaxis, axes.yaxis):
        categories(axis, symbols)
    axes.grid(False)
    found = np.nonzero(np.triu(np.abs(matrix) >= RINGED, 1))
    pairs = np.column_stack(found)
    both = np.concatenate([pairs, pairs[:, ::-1]])
    axes.plot(both[:, 0], both[:, 1], "o", mfc="none", mec=INK, mew=1.2, ms=6)
    told = ", ".join(
        f"{symbols[i]} and {symbols[j]} {matrix[i, j]:.2f}" for i, j in pairs[:MOST_TOLD]
    )
    more = f"; beyond {RINGED} are {told}" if told else f"; none beyond {RINGED}"
    caption = f"Correlations of {len(symbols)} identified coefficients{more}"
    return svg(figure, name, caption.replace("-", "−"))
