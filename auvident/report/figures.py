"""Figures as SVG inside a page: one style, colours that follow the page, few points.

A figure is drawn with fixed colours, each of which stands for a CSS variable of the page; so it
is readable on light and dark ground and in print. Text stays text.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FixedFormatter, FixedLocator

from auvident.report.taken import are_taken, is_taken
from auvident.report.unticked import Unticked

Array = npt.NDArray[np.float64]

WIDTH_IN = 11.8  # of a figure over the whole page
MOST_POINTS = 1600  # of a line: about twice the pixels of a panel
LONGEST_STEPS = 3.5  # of a sensor that a line bridges: three lost samples are a hole

# Colour in the drawing -> variable of the page. The first four are ink and paper; the others,
# after Okabe and Ito, are told apart by all common kinds of colour vision.
INK, SOFT, GRID, PAPER = "#101112", "#606162", "#d0d1d2", "#fdfefc"
BLUE, VERMILLION, GREEN, SKY, PURPLE, ORANGE = (
    "#0072b2",
    "#d55e00",
    "#009e73",
    "#56b4e9",
    "#cc79a7",
    "#e69f00",
)
VARIABLES = {
    INK: "--ink",
    SOFT: "--soft",
    GRID: "--grid",
    PAPER: "--paper",
    BLUE: "--blue",
    VERMILLION: "--vermillion",
    GREEN: "--green",
    SKY: "--sky",
    PURPLE: "--purple",
    ORANGE: "--orange",
}
KIND_COLOURS = {"straight": SKY, "turn": PURPLE, "zigzag": GREEN}
STYLE: Any = {
    "svg.fonttype": "none",
    "text.parse_math": False,  # names are of the user: a dollar sign is a dollar sign
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.labelsize": 9.0,
    "axes.titlelocation": "left",
    "axes.edgecolor": SOFT,
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "axes.facecolor": "none",
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "figure.facecolor": "none",
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "text.color": INK,
    "xtick.color": SOFT,
    "ytick.color": SOFT,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "lines.linewidth": 1.1,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "hatch.linewidth": 0.6,
    "path.simplify": True,
    "path.simplify_threshold": 0.3,
}


LIVE = ContextVar("LIVE", default=False)  # whether figures are drawn by the browser


@contextmanager
def style(live: bool = False) -> Iterator[None]:
    """Style of the report, for figures made and drawn inside; `live` for those of plotly."""
    before = LIVE.set(live)
    try:
        with rc_context(STYLE):
            yield
    finally:
        LIVE.reset(before)


def new_figure(height_in: float, width_in: float = WIDTH_IN) -> Figure:
    """An empty figure."""
    if are_taken():
        return Figure(figsize=(width_in, height_in))
    return Unticked(figsize=(width_in, height_in))


def svg(figure: Figure, name: str, caption: str) -> str:
    """A figure as an element that may stand in an HTML page with others.

    Parameters
    ----------
    figure : Figure
    name : str
        Different for each figure of the page: identifiers inside derive from it.
    caption : str
        What it shows, for those who cannot see it.
    """
    if is_taken(figure):
        return ""
    if LIVE.get():
        from auvident.report.interactive import live_markup as write
    else:
        from auvident.report.page_figure import markup as write

    return write(figure, name, caption)


def thinned(t: Array, *columns: Array) -> tuple[Array, ...]:
    """Lines with at most about `MOST_POINTS` points, extremes of each piece kept.

    Parameters
    ----------
    t : (n,) array
    *columns : (n,) arrays
        The first decides which points are kept.

    Returns
    -------
    tuple of arrays
        The same rows of all of them.
    """
    n = len(t)
    if n <= MOST_POINTS or not columns:
        return (t, *columns)
    pieces = MOST_POINTS // 2
    length = n // pieces + (n % pieces > 0)
    padded = np.pad(columns[0], (0, -n % length), constant_values=np.nan).reshape(-1, length)
    starts = np.arange(len(padded)) * length
    low = np.argmin(np.where(np.isnan(padded), np.inf, padded), axis=1) + starts
    high = np.argmax(np.where(np.isnan(padded), -np.inf, padded), axis=1) + starts
    missing = np.flatnonzero(np.isnan(padded).any(axis=1)) * length  # a hole stays a hole
    holes = [s + np.flatnonzero(np.isnan(columns[0][s : s + length]))[:1] for s in missing]
    rows = np.unique(np.concatenate([[0, n - 1], low, high, *holes]))
    rows = rows[rows < n].astype(int)
    return (t[rows], *(c[rows] for c in columns))


def unbridged(t: Array, y: Array) -> tuple[Array, Array]:
    """A line over its finite points, with a hole where the readings pause.

    A sensor slower than the rows leaves empty rows between its samples; those are passed over.
    A pause of more than `LONGEST_STEPS` of its steps gets a nan, which breaks the line.
    """
    seen = np.isfinite(y)
    t, y = t[seen], y[seen]
    steps = np.diff(t)
    if not steps.size:
        return t, y
    breaks = np.flatnonzero(steps > LONGEST_STEPS * np.median(steps)) + 1
    return np.insert(t, breaks, t[breaks - 1]), np.insert(y, breaks, np.nan)


def limits(inside: Array, beyond: Array, most: float = 0.6) -> tuple[float, float]:
    """Limits of an axis that show `inside` whole and `beyond` as far as space allows.

    Parameters
    ----------
    inside, beyond : array
        Values that must be seen, and values that may leave the panel.
    most : float
        Space given to `beyond` on each side, in spans of `inside`.
    """
    inside, beyond = inside[np.isfinite(inside)], beyond[np.isfinite(beyond)]
    if not inside.size:
        return 0.0, 1.0
    low, high = float(inside.min()), float(inside.max())
    span = max(high - low, 1e-3 * max(abs(low), abs(high)), 1e-9)
    if beyond.size:
        low = max(min(low, float(beyond.min())), low - most * span)
        high = min(max(high, float(beyond.max())), high + most * span)
    margin = 0.06 * (high - low + span)
    return low - margin, high + margin


def categories(axis: Axis, names: Sequence[str]) -> None:
    """Names in place of numbers at 0, 1, 2... of an axis."""
    axis.set_major_locator(FixedLocator(range(len(names))))
    axis.set_major_formatter(FixedFormatter(names))


def quiet(axes: Axes) -> None:
    """A panel without its own labels of time: another below has them."""
    axes.tick_params(labelbottom=False)
