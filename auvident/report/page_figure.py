"""A figure as markup of the page: panels stretch and stack, words stay as large as they are.

matplotlib holds what is drawn: axes, lines, scales, ticks. Its own SVG scales as a whole, so
that what can be read on a desk is 4 px high on a phone, and placing text takes most of its
time. Here each panel becomes a picture in two layers (`marks`) that is as wide as the page lets
it, and what stands around it is text of the page.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import escape
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Text

from auvident.report import marks
from auvident.report.marks import ACROSS, CHARACTER_PX, DOWN, Hatches, colour, percent

PX_PER_IN = 96
LEAST_HIGH_PX = 44
MANY = 4  # columns from which on panels flow, as many side by side as there is room for
MOST_SQUARE_PX = 620  # width of a panel with one scale both ways
KEY_PX = (26, 10)  # sample of a line in a legend
LABEL_PITCH_PX = 12.5  # of names that stand on end
AT_THE_END = 0.985  # of an axis: half of a number there stands beyond it
TICK_PX = 17  # room below a panel for the numbers of its axis


@dataclass(frozen=True)
class Ticks:
    """Ticks of an axis: shares of the panel, and labels."""

    places: tuple[float, ...]
    labels: tuple[str, ...]


Writer = Callable[[Sequence[Axes], Hatches], str]  # of panels above each other


def markup(figure: Figure, name: str, caption: str, writer: Writer | None = None) -> str:
    """The figure as an element of an HTML page.

    Parameters
    ----------
    figure : Figure
    name : str
        Different for each figure of the page: identifiers inside derive from it.
    caption : str
        What it shows, for those who cannot see it.
    writer : callable, optional
        Of panels above each other, instead of one that draws them.
    """
    write = writer or _stack
    hatches = Hatches(name)
    stacks = _stacks(figure)
    cells = "".join(write(stack, hatches) for stack in stacks)
    head = "".join(_legend(legend, hatches) for legend in legends(figure))
    suptitle = figure.get_suptitle()
    title = f'<p class="title">{escape(suptitle)}</p>' if suptitle else ""
    look, columns = _columns(stacks, figure)
    defined = hatches.definitions()
    shared = f'<svg class="shared">{defined}</svg>' if defined else ""
    return (
        f'<div class="plot" id="figure-{escape(name)}" role="img" aria-label="{escape(caption)}">'
        f'{shared}{title}{head}<div class="cells{look}"{columns}>{cells}</div></div>'
    )


def legends(figure: Figure) -> list[Legend]:
    """Legends of the figure, and of its panels."""
    own = [axes.get_legend() for axes in figure.axes]
    return [*figure.legends, *(legend for legend in own if legend is not None)]


# --- layout -----------------------------------------------------------------------------------


def _left(axes: Axes) -> float:
    return round(float(axes.get_position(original=True).x0), 2)


def _stacks(figure: Figure) -> list[list[Axes]]:
    """Panels that share their axis across stand above each other, in the order of drawing."""
    found: dict[tuple[float, frozenset[int]], list[Axes]] = {}
    for axes in figure.axes:
        if axes.get_label() == "<colorbar>" or not axes.get_visible():
            continue
        shared = frozenset(map(id, axes.get_shared_x_axes().get_siblings(axes)))
        found.setdefault((_left(axes), shared), []).append(axes)
    return list(found.values())


def _columns(stacks: Sequence[Sequence[Axes]], figure: Figure) -> tuple[str, str]:
    """Class of the grid and its columns, by the widths that the figure has."""
    widths = {_left(s[0]): s[0].get_position(original=True).width for s in stacks}
    if len(widths) < 2:
        return "", ""
    if len(widths) >= MANY:
        return " many", ""
    template = " ".join(f"{100.0 * w:.0f}fr" for _, w in sorted(widths.items()))
    rows_shared = any(_without_labels(s[0].yaxis) for s in stacks)
    return " together" if rows_shared else "", f' style="--columns:{template}"'


def _without_labels(axis: Axis) -> bool:
    shown = axis.get_tick_params(which="major")
    return not any(shown.get(f"label{side}", False) for side in ("left", "bottom"))


def _stack(stack: Sequence[Axes], hatches: Hatches) -> str:
    """Panels one above the other, with the same room at their left."""
    ticks = [(_ticks(axes.xaxis), _ticks(axes.yaxis)) for axes in stack]
    named = [y.labels for axes, (_, y) in zip(stack, ticks, strict=True) if _numbered(axes.yaxis)]
    left = max((marks.widest(labels) for labels in named), default=0.0) + 10.0
    panels = [_panel(a, x, y, hatches) for a, (x, y) in zip(stack, ticks, strict=True)]
    return f'<div class="stack" style="--left:{left:.0f}px">{"".join(panels)}</div>'


def _numbered(axis: Axis) -> bool:
    return bool(axis.axes.axison) and not _without_labels(axis)


# --- a panel ----------------------------------------------------------------------------------


def _panel(axes: Axes, x: Ticks, y: Ticks, hatches: Hatches) -> str:
    """Name and errors above, the drawing, and below it what its axis means."""
    square = axes.get_aspect() != "auto"
    if square:
        axes.apply_aspect()
    lower = f'<g class="axes"><path class="grid" d="{_grid(axes, x, y)}"/>{_spines(axes)}</g>'
    upper = marks.boxes(axes, hatches) + marks.glyphs(axes) + marks.texts(axes)
    upper += _numbers_below(axes, x) + _numbers_left(axes, y)
    label = escape(axes.get_xlabel())
    below = f'<p class="across">{label}</p>' if label else ""
    return (
        f'{_head(axes)}<div class="panel" style="{_size(axes, x, square)}">'
        f'<svg class="lower" viewBox="0 0 {ACROSS} {DOWN}" preserveAspectRatio="none">'
        f'{lower}{marks.lower(axes)}</svg><svg class="upper">{upper}</svg></div>{below}'
    )


def _size(axes: Axes, x: Ticks, square: bool) -> str:
    box = axes.bbox
    above = marks.room_above(axes)
    numbered = _numbered(axes.xaxis)
    below = (marks.widest(x.labels) + 8.0 if _upright(axes, x) else TICK_PX) if numbered else 0.0
    room = f"margin-top:{above:.0f}px;" if above else ""
    room += f"margin-bottom:{below:.0f}px;" if below else ""
    if _upright(axes, x):  # a map with names at both sides
        room += f"min-width:{LABEL_PITCH_PX * len(x.labels):.0f}px;"
    if square:
        most = min(MOST_SQUARE_PX, PX_PER_IN * box.width / axes.figure.dpi)
        return f"{room}aspect-ratio:{box.width / box.height:.3f};max-width:{most:.0f}px"
    high = max(PX_PER_IN * box.height / axes.figure.dpi, LEAST_HIGH_PX if axes.axison else 0.0)
    return f"{room}--high:{high:.0f}px"


def _head(axes: Axes) -> str:
    """What is drawn, and how well it fits; an empty line beside a panel that has such words."""
    words = _words(axes)
    if not words and not any(map(_words, _beside(axes))):
        return ""
    return f'<p class="head">{words or "<span>&nbsp;</span>"}</p>'


def _words(axes: Axes) -> str:
    name = escape(axes.get_ylabel().replace("\n", ", "))
    # matplotlib hands out the words of these titles, but not their colour
    left, right = axes._left_title, axes._right_title  # type: ignore[attr-defined]
    own = (f"<b>{name}</b>" if name else "") + _coloured(left) + _coloured(axes.title)
    return f"<span>{own}</span>{_coloured(right)}" if own or right.get_text() else ""


def _beside(axes: Axes) -> list[Axes]:
    """Panels of the same rows: what stands above one of them moves them all down."""
    bottom = axes.get_position(original=True).y0
    shared = axes.get_shared_y_axes().get_siblings(axes)
    return [a for a in shared if a.get_position(original=True).y0 == bottom]


def _coloured(title: Text) -> str:
    words, hue = escape(title.get_text()), colour(title.get_color())
    look = "" if hue == "var(--ink)" else f' style="color:{hue}"'
    return f"<span{look}>{words}</span>" if words else ""


def _ticks(axis: Axis) -> Ticks:
    """Ticks within the panel, without the artists that matplotlib makes of them."""
    axes, low_high = axis.axes, sorted(axis.get_view_interval())
    at = np.asarray(axis.get_majorticklocs(), float)
    labels = np.array(axis.get_major_formatter().format_ticks(at.tolist()), str)
    margin = 1e-9 * (low_high[1] - low_high[0])
    seen = (at >= low_high[0] - margin) & (at <= low_high[1] + margin)
    at, labels = at[seen], labels[seen]
    points = np.column_stack([at, at])
    shares = (axes.transScale + axes.transLimits).transform(points)[:, int(axis is axes.yaxis)]
    return Ticks(tuple(map(float, shares)), tuple(map(str, labels)))


def _grid(axes: Axes, x: Ticks, y: Ticks) -> str:
    if not axes.axison:
        return ""
    d = ""
    if axes.xaxis.get_tick_params(which="major").get("gridOn"):
        d += "".join(f"M{round(ACROSS * share)} 0v{DOWN}" for share in x.places)
    if axes.yaxis.get_tick_params(which="major").get("gridOn"):
        d += "".join(f"M0 {round(DOWN * (1.0 - share))}h{ACROSS}" for share in y.places)
    return d


def _spines(axes: Axes) -> str:
    return f'<path class="spine" d="M0 0v{DOWN}h{ACROSS}"/>' if axes.axison else ""


def _upright(axes: Axes, x: Ticks) -> bool:
    """Whether the labels across need to stand on end: as words do, when there are many."""
    return sum(map(len, x.labels)) * CHARACTER_PX > PX_PER_IN * axes.bbox.width / axes.figure.dpi


def _numbers_below(axes: Axes, x: Ticks) -> str:
    """Numbers of the axis across; every other one can be left out where it is narrow."""
    if not _numbered(axes.xaxis):
        return ""
    kind = "x upright" if _upright(axes, x) else "x"
    parts = [
        f'<text x="{percent(share)}" y="100%"{_other(i, kind)}{_inside(share, kind)}>'
        f"{escape(label)}</text>"
        for i, (share, label) in enumerate(zip(x.places, x.labels, strict=True))
        if label
    ]
    return f'<g class="{kind}">{"".join(parts)}</g>'


def _inside(share: float, kind: str) -> str:
    """A number at the very end of the axis ends there, as the page may end there, too."""
    return ' style="text-anchor:end"' if share > AT_THE_END and kind == "x" else ""


def _other(i: int, kind: str) -> str:
    return ' class="other"' if i % 2 and kind == "x" else ""


def _numbers_left(axes: Axes, y: Ticks) -> str:
    if not _numbered(axes.yaxis):
        return ""
    parts = [
        f'<text y="{percent(1.0 - share)}">{escape(label)}</text>'
        for share, label in zip(y.places, y.labels, strict=True)
        if label
    ]
    return f'<g class="y">{"".join(parts)}</g>'


# --- legend -----------------------------------------------------------------------------------


def _legend(legend: Legend, hatches: Hatches) -> str:
    keys = [
        f"<li>{_sample(handle, hatches)}{escape(text.get_text())}</li>"
        for handle, text in zip(legend.legend_handles, legend.get_texts(), strict=True)
        if handle is not None
    ]
    return f'<ul class="keys">{"".join(keys)}</ul>'


def _sample(handle: Artist, hatches: Hatches) -> str:
    """A piece of the line, or of the area."""
    wide, high = KEY_PX
    if isinstance(handle, Line2D):
        inner = _line_sample(handle)
    else:
        assert isinstance(handle, Patch)
        inner = _area_sample(handle, hatches)
    return f'<svg width="{wide}" height="{high}">{inner}</svg>'


def _line_sample(line: Line2D) -> str:
    wide, high = KEY_PX
    marker = str(line.get_marker())
    text = ""
    if line.get_linestyle() not in ("None", "", " "):
        look = marks.stroke(
            line.get_color(), float(line.get_linewidth()), line, marks.dash_lengths(line)
        )
        text += f'<path d="M1 {high / 2:g}h{wide - 2}" fill="none"{look}/>'
    if marker in marks.GLYPHS or marker in ("o", "."):
        glyph = marks.GLYPHS.get(marker, "○" if line.get_markerfacecolor() == "none" else "●")
        fill = colour(line.get_markeredgecolor())
        text += f'<text class="mark" x="50%" y="50%" fill="{fill}" font-size="12">{glyph}</text>'
    return text


def _area_sample(patch: Patch, hatches: Hatches) -> str:
    wide, high = KEY_PX
    face = patch.get_facecolor()
    at = f'<rect x=".5" y=".5" width="{wide - 1}" height="{high - 1}"'
    text, filled = "", to_rgba(face)[3] > 0.0
    if filled:
        text = f'{at} fill="{colour(face)}"{marks.opacity("fill-opacity", patch, face)}/>'
    if patch.get_hatch():
        text += f'{at} fill="{hatches.fill(patch)}"/>'
    edge = colour(patch.get_edgecolor())
    outlined = patch.get_linewidth() and not filled
    return text + (f'{at} fill="none" stroke="{edge}"/>' if outlined else "")
