"""What the model leaves of the held-out maneuvers: over time, and correlated with itself."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from auvident.constants import NORMAL_95
from auvident.report.figures import (
    BLUE,
    GRID,
    SKY,
    SOFT,
    VERMILLION,
    new_figure,
    quiet,
    svg,
    thinned,
)
from auvident.report.html_data import CHANNELS
from auvident.report.numbers import SHOWN_UNITS
from auvident.report.tables_consistency import MANEUVERS, size_verdict
from auvident.report.verdict_rules import FAIL, LAGS
from auvident.schema.artifacts import ResidualTests, Role

HEIGHT_IN = 1.35  # of a channel


def innovations(
    table: pd.DataFrame, tests: Mapping[str, ResidualTests], role: Role, name: str
) -> str | None:
    """Error of each channel with the band of its noise, and its autocorrelation, judged.

    Parameters
    ----------
    table : pandas.DataFrame
        As `validate` writes it, of the final model.
    tests : mapping
        Of the channels of that role.
    role : str
        Of the maneuvers that are shown, one after the other.
    name : str
        Different for each figure of the page.
    """
    rows = [
        (symbol, column, unit, words)
        for symbol, column, unit, words in CHANNELS
        if symbol in tests and tests[symbol].nis is not None and f"{column}_measured" in table
    ]
    own = table[table["role"] == role]
    if not rows or own.empty:
        return None
    figure = new_figure(0.75 + HEIGHT_IN * len(rows))
    height = figure.get_figheight()
    grid = figure.add_gridspec(
        len(rows),
        2,
        left=0.075,
        right=0.99,
        top=1.0 - 0.3 / height,
        bottom=0.45 / height,
        hspace=0.5,
        wspace=0.13,
        width_ratios=[1.7, 1.0],
    )
    for i, (symbol, column, unit, words) in enumerate(rows):
        first = figure.axes[:2] if i else (None, None)  # one time above the other, one lag
        left, right = (figure.add_subplot(grid[i, k], sharex=first[k]) for k in (0, 1))
        _over_time(left, own, column, unit, tests[symbol])
        left.set_ylabel(f"{words}\n{SHOWN_UNITS.get(unit, (unit,))[0]}")
        _correlated(right, tests[symbol])
        if i + 1 < len(rows):
            quiet(left)
            quiet(right)
    left.set_xlabel("time, maneuvers one after the other, s")
    right.set_xlabel("lag, s")
    figure.align_ylabels()
    return svg(figure, name, _told({r[0]: tests[r[0]] for r in rows}, role))


def _over_time(
    axes: Axes, table: pd.DataFrame, column: str, unit: str, tests: ResidualTests
) -> None:
    """Measured minus predicted, with the band that 95 % of it should lie in."""
    factor = SHOWN_UNITS.get(unit, (unit, 1.0))[1]
    start = 0.0
    for _, rows in table.groupby("maneuver", sort=False):
        time = rows["time_s"].to_numpy(float)
        left = (rows[f"{column}_measured"] - rows[f"{column}_simulated"]).to_numpy(float) * factor
        seen = np.isfinite(left)
        if seen.any():
            axes.plot(*thinned(time[seen] - time[0] + start, left[seen]), color=BLUE, lw=0.7)
        start += float(time[-1] - time[0])
        axes.axvline(start, color=GRID, lw=0.7)
    noise = tests.noise
    if noise is not None:
        half = NORMAL_95 * factor * float(np.hypot(noise.white_std, noise.slow_std))
        axes.axhspan(-half, half, color=SKY, alpha=0.2, lw=0)
    axes.axhline(0.0, color=SOFT, lw=0.7)
    axes.set_xlim(0.0, max(start, 1e-9))
    axes.locator_params(axis="y", nbins=4)
    assert tests.nis is not None
    verdict = size_verdict(tests.nis)
    axes.set_title(f"size {verdict}: NIS {tests.nis.corrected:.2g}", **_look(verdict))


def _correlated(axes: Axes, tests: ResidualTests) -> None:
    """Autocorrelation by lag with its band; the figure alone where the lags are not known."""
    white = tests.autocorrelation
    if white is None:
        axes.set_axis_off()
        axes.set_title("\N{NO-BREAK SPACE}")  # as high as the panel beside it
        return
    axes.axhspan(-white.band, white.band, color=SKY, alpha=0.3, lw=0)
    axes.axhline(0.0, color=SOFT, lw=0.7)
    if white.values:
        axes.vlines(white.lags_s, 0.0, white.values, color=BLUE, lw=1.1)
    else:
        axes.plot(white.lag_s, white.largest, "o", color=BLUE, ms=4)
    axes.set_xlim(left=0.0)
    axes.set_ylim(min(-0.3, 1.1 * white.largest), max(0.5, 1.1 * white.largest))
    verdict = LAGS.of(white.outside).words
    text = f"white {verdict}: {100.0 * white.outside:.0f} % of the lags outside"
    axes.set_title(text, **_look(verdict))


def _look(verdict: str) -> dict[str, Any]:
    return {"fontsize": 8.5, "pad": 3, "color": VERMILLION if verdict == FAIL else SOFT}


def _told(tests: Mapping[str, ResidualTests], role: Role) -> str:
    """For those who cannot see it."""
    pieces = []
    for symbol, t in tests.items():
        white = LAGS.of(t.autocorrelation.outside).words if t.autocorrelation else "not tested"
        size = size_verdict(t.nis) if t.nis else "not tested"
        pieces.append(f"{symbol}: size {size}, white {white}")
    return f"Errors of {MANEUVERS[role]} and their autocorrelation; {'; '.join(pieces)}"
