"""Figures to hover over and to zoom into: the same panels, drawn by plotly in the browser.

What matplotlib holds is handed over as data; the library stands in the page, so that it needs no
network.
"""

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from markupsafe import Markup, escape
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import Collection, LineCollection, PathCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Text
from matplotlib.ticker import FixedFormatter

from auvident.errors import UsageError
from auvident.report import marks
from auvident.report.marks import Array, colour
from auvident.report.page_figure import PX_PER_IN, Writer, legends, markup

DIGITS = 5  # significant ones of a point
HEAD_PX, AXIS_PX, LEFT_PX = 34, 46, 64  # room above a panel, below the last one, at the left
SYMBOLS = {"o": "circle", ".": "circle", "D": "diamond", ">": "triangle-right"}
SYMBOLS |= {"<": "triangle-left", "^": "triangle-up", "v": "triangle-down", "s": "square"}
# fills every panel as it comes into view; colours of the page are looked up when it is opened
START = """
const page = getComputedStyle(document.documentElement);
const value = (_, name) => page.getPropertyValue(name).trim();
const seen = text => text.replace(/var\\((--[a-z]+)\\)/g, value);
const draw = place => {
  const plot = JSON.parse(seen(place.dataset.plot));
  Plotly.newPlot(place, plot.data, plot.layout, {responsive: true, displaylogo: false});
};
const watch = new IntersectionObserver(entries => entries.filter(e => e.isIntersecting)
  .forEach(e => { watch.unobserve(e.target); draw(e.target); }), {rootMargin: "800px"});
document.querySelectorAll(".live").forEach(place => watch.observe(place));
"""


def require_plotly() -> None:
    """Refuse, with the remedy, where plotly is not installed.

    Raises
    ------
    UsageError
    """
    try:
        import plotly.offline  # noqa: F401
    except ImportError as error:
        raise UsageError(
            "needs plotly, which is not installed",
            "--interactive",
            "Install it: pip install 'auvident[interactive]'.",
        ) from error


def scripts() -> Markup:
    """The library, and what starts it."""
    from plotly.offline import get_plotlyjs

    return Markup("<script>{}</script><script>{}</script>").format(
        Markup(get_plotlyjs()), Markup(START)
    )


def live_markup(figure: Figure, name: str, caption: str) -> str:
    """As `markup`, with panels that plotly fills."""
    labels = {
        colour(handle.get_color()): text.get_text()
        for legend in legends(figure)
        for handle, text in zip(legend.legend_handles, legend.get_texts(), strict=True)
        if isinstance(handle, Line2D)
    }
    writer: Writer = lambda stack, _: _stack(stack, labels)  # noqa: E731
    return markup(figure, name, caption, writer)


def _stack(stack: Sequence[Axes], labels: dict[str, str]) -> str:
    """Panels above each other in one drawing: they are zoomed together."""
    for axes in stack:
        axes.apply_aspect()
    heights = [max(PX_PER_IN * a.bbox.height / a.figure.dpi, 30.0) for a in stack]
    whole = sum(heights) + HEAD_PX * len(stack)
    data: list[dict[str, Any]] = []
    layout = _layout(stack[-1], whole)
    top = whole
    for i, (axes, height) in enumerate(zip(stack, heights, strict=True)):
        row = "" if i == 0 else str(i + 1)
        top -= HEAD_PX
        layout[f"yaxis{row}"] = _axis(axes, "y", [(top - height) / whole, top / whole])
        layout["annotations"].append(_title(axes, top / whole))
        data += _traces(axes, row, labels)
        layout["shapes"] += [_shape(axes, p, row) for p in axes.patches if marks.is_box(p)]
        layout["annotations"] += [_words(axes, t, row) for t in axes.texts if t.get_text()]
        top -= height
    layout["xaxis"] |= {"anchor": f"y{'' if len(stack) == 1 else len(stack)}"}
    plot = escape(json.dumps({"data": data, "layout": layout}, separators=(",", ":")))
    return (
        f'<div class="stack live" style="height:{whole + AXIS_PX:.0f}px" data-plot="{plot}"></div>'
    )


def _layout(last: Axes, height: float) -> dict[str, Any]:
    """What all panels of a stack share."""
    return {
        "margin": {"l": LEFT_PX, "r": 10, "t": 2, "b": AXIS_PX},
        "height": height + AXIS_PX,
        "font": {"size": 11, "color": "var(--ink)"},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "showlegend": False,
        "hovermode": "x" if last.get_aspect() == "auto" else "closest",
        "annotations": [],
        "shapes": [],
        "xaxis": _axis(last, "x", [0.0, 1.0]) | {"title": {"text": escape(last.get_xlabel())}},
    }


def _axis(axes: Axes, which: str, domain: list[float]) -> dict[str, Any]:
    axis = axes.xaxis if which == "x" else axes.yaxis
    logarithmic = axis.get_scale() == "log"
    limits = [float(x) for x in (axes.get_xlim() if which == "x" else axes.get_ylim())]
    found: dict[str, Any] = {
        "domain": domain,
        "range": np.log10(limits).tolist() if logarithmic else limits,
        "type": "log" if logarithmic else "linear",
        "gridcolor": "var(--grid)",
        "zeroline": False,
        "visible": bool(axes.axison),
    }
    formatter = axis.get_major_formatter()
    if isinstance(formatter, FixedFormatter):
        found |= {"tickvals": np.asarray(axis.get_majorticklocs(), float).tolist()}
        found |= {"ticktext": [escape(label) for label in formatter.seq]}
    if which == "y" and axes.get_aspect() != "auto":
        found |= {"scaleanchor": "x", "constrain": "domain"}
    return found


def _title(axes: Axes, top: float) -> dict[str, Any]:
    name = escape(axes.get_ylabel().replace("\n", ", "))
    rest = [axes.get_title(place) for place in ("left", "center", "right")]
    text = "  ".join([f"<b>{name}</b>", *(str(escape(t)) for t in rest if t)])
    place = {"x": 0, "xref": "paper", "xanchor": "left", "y": top, "yref": "paper"}
    return {"text": text, "showarrow": False, "yanchor": "bottom", **place}


def _data(axes: Axes, artist: Artist, points: Any) -> Array:
    """Points of an artist in the units of the axes."""
    if artist.get_transform() is axes.transData:
        return np.asarray(points, float).reshape(-1, 2)
    shown = artist.get_transform().transform(np.asarray(points, float))
    return np.asarray(axes.transData.inverted().transform(shown), float).reshape(-1, 2)


def _numbers(values: Array) -> list[float | None]:
    return [float(f"{v:.{DIGITS}g}") if np.isfinite(v) else None for v in values]


def _traces(axes: Axes, row: str, labels: dict[str, str]) -> list[dict[str, Any]]:
    found: list[Artist] = [*axes.collections, *axes.lines]
    drawn = [_trace(axes, a, labels) for a in sorted(found, key=Artist.get_zorder)]
    drawn += [_map(axes)] if axes.images else []
    return [{"xaxis": "x", "yaxis": f"y{row}", **t} for t in drawn]


def _trace(axes: Axes, artist: Artist, labels: dict[str, str]) -> dict[str, Any]:
    match artist:
        case Line2D():
            return _line(axes, artist, labels)
        case PathCollection():
            points = np.asarray(artist.get_offsets(), float)
            return _points(points) | {"mode": "markers", "marker": {"size": 4}}
        case LineCollection():
            pieces = [_data(axes, artist, s) for s in artist.get_segments()]
            return _points(_joined(pieces)) | _stroke(artist.get_color()[0], 1.6)
        case Collection():
            pieces = [_data(axes, artist, p.vertices) for p in artist.get_paths()]
            face: Any = artist.get_facecolor()
            fill = {"fill": "toself", "fillcolor": colour(face[0]) if len(face) else "none"}
            return _points(_joined(pieces)) | fill | {
                "mode": "none", "hoverinfo": "skip", "opacity": float(to_rgba(face[0])[3])
            }  # fmt: skip
    raise TypeError(f"no trace for {type(artist).__name__}")


def _joined(pieces: Sequence[Array]) -> Array:
    hole = np.full((1, 2), np.nan)
    return np.concatenate([part for piece in pieces for part in (piece, hole)] or [hole])


def _points(points: Array) -> dict[str, Any]:
    return {"type": "scatter", "x": _numbers(points[:, 0]), "y": _numbers(points[:, 1])}


def _stroke(value: Any, width_pt: float, dashes: Sequence[float] = ()) -> dict[str, Any]:
    line: dict[str, Any] = {"color": colour(value), "width": marks.PX_PER_PT * width_pt}
    if dashes:
        line["dash"] = ",".join(f"{marks.PX_PER_PT * width_pt * d:.3g}px" for d in dashes)
    return {"mode": "lines", "line": line, "hoverinfo": "skip"}


def _line(axes: Axes, line: Line2D, labels: dict[str, str]) -> dict[str, Any]:
    found = _points(_data(axes, line, line.get_xydata()))
    found["opacity"] = 1.0 if line.get_alpha() is None else float(line.get_alpha() or 0.0)
    symbol = SYMBOLS.get(str(line.get_marker()))
    if line.get_linestyle() not in ("None", "", " "):
        found |= _stroke(line.get_color(), float(line.get_linewidth()), marks.dash_lengths(line))
        found["line"]["shape"] = "hv" if line.get_drawstyle() == "steps-post" else "linear"
    else:
        found["mode"] = "markers"
    if symbol:
        hollow = "-open" if line.get_markerfacecolor() == "none" else ""
        size = marks.PX_PER_PT * float(line.get_markersize())
        found["marker"] = {
            "symbol": symbol + hollow,
            "size": size,
            "color": colour(line.get_color()),
        }
    name = labels.get(colour(line.get_color()))
    if len(found["x"]) > 2 or symbol:  # a line of reference has nothing to tell
        found |= {"name": str(escape(name or "")), "hoverinfo": "x+y+name" if name else "x+y"}
    return found


def _map(axes: Axes) -> dict[str, Any]:
    """A map of correlations: orange is negative, blue is positive."""
    values = np.asarray(axes.images[0].get_array(), float)
    ends = [[0.0, "var(--orange)"], [0.5, "rgba(127,127,127,0)"], [1.0, "var(--blue)"]]
    return {
        "type": "heatmap",
        "z": [_numbers(row) for row in values],
        "zmin": -1.0,
        "zmax": 1.0,
        "colorscale": ends,
        "showscale": False,
    }


def _shape(axes: Axes, patch: Any, row: str) -> dict[str, Any]:
    """A bar, or a shade over the whole of the panel."""
    points = patch.get_path().vertices
    share = marks.places(axes, patch, points)
    (x0, y0), (x1, y1) = (end(_data(axes, patch, points), axis=0) for end in (np.min, np.max))
    whole = [bool(np.allclose([share[:, k].min(), share[:, k].max()], [0.0, 1.0])) for k in (0, 1)]
    across = (
        {"xref": "x domain", "x0": 0, "x1": 1} if whole[0] else {"xref": "x", "x0": x0, "x1": x1}
    )
    yref = f"y{row}"
    up = (
        {"yref": f"{yref} domain", "y0": 0, "y1": 1}
        if whole[1]
        else {"yref": yref, "y0": y0, "y1": y1}
    )
    face = patch.get_facecolor()
    look = {"fillcolor": colour(face), "opacity": float(to_rgba(face)[3]), "line": {"width": 0}}
    return {"type": "rect", "layer": "below", **across, **up, **look}


def _words(axes: Axes, text: Text, row: str) -> dict[str, Any]:
    ((x, y),) = _data(axes, text, [text.get_position()])
    x = float(np.log10(x)) if axes.get_xscale() == "log" else float(x)
    place = {"x": x, "y": float(y), "xref": "x", "yref": f"y{row}"}
    anchor = {"xanchor": text.get_horizontalalignment(), "textangle": -float(text.get_rotation())}
    return {"text": str(escape(text.get_text())), "showarrow": False, **place, **anchor}
