"""Marks of a panel as SVG that stretches with the page: what is drawn scales, strokes do not.

A panel has two layers. The lower one holds paths in whole numbers, `ACROSS` by `DOWN` over the
panel, stretched to whatever size the page gives it. The upper one holds text and small shapes
at percentages of the panel, in pixels that stay the same.
"""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from markupsafe import escape
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cbook import STEP_LOOKUP_MAP
from matplotlib.collections import Collection, LineCollection, PathCollection
from matplotlib.colors import to_hex, to_rgba
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Text

from auvident.report.figures import VARIABLES

Array = npt.NDArray[np.float64]

ACROSS, DOWN = 2000, 1000  # cells of the lower layer: half a pixel of a wide page
BEYOND = 2.0  # panels; what leaves it by more is cut there
PX_PER_PT = 1.25  # a little less than 4/3: strokes of a page are finer than those of print
CHARACTER_PX = 6.3  # mean width of a character of a tick label
# shapes that a stretched layer would distort are characters
GLYPHS = {"D": "◆", "d": "◆", ">": "▶", "<": "◀", "^": "▲", "v": "▼", "s": "■", "x": "×"}
HATCHES = {"/": "M-2 8L8-2M3 13L13 3", "x": "M0 0L10 10M0 10L10 0"}


def colour(value: Any) -> str:
    """A colour as the page writes it: its variable, where it has one."""
    code = to_hex(value)
    return f"var({VARIABLES[code]})" if code in VARIABLES else code


def opacity(name: str, artist: Artist, value: Any) -> str:
    """Attribute of the opacity, where it is not whole."""
    alpha = to_rgba(value)[3] if artist.get_alpha() is None else artist.get_alpha()
    return "" if alpha is None or alpha >= 1.0 else f' {name}="{float(alpha):.2g}"'


def places(axes: Axes, artist: Artist, points: Any) -> Array:
    """Points of an artist as shares of the panel, up and to the right."""
    box = axes.bbox
    shown = np.asarray(artist.get_transform().transform(np.asarray(points, float)), float)
    return (shown.reshape(-1, 2) - (box.x0, box.y0)) / (box.width, box.height)


def percent(share: float) -> str:
    """A share as SVG writes it."""
    return f"{100.0 * share:.2f}".rstrip("0").rstrip(".") + "%"


# --- lower layer ------------------------------------------------------------------------------


def trace(points: Array, closed: bool = False) -> str:
    """Path through points given as shares; a point that is not finite interrupts it."""
    there = np.asarray(np.isfinite(points).all(axis=1))
    cells = np.clip(np.where(there[:, None], points, 0.0), -BEYOND, 1.0 + BEYOND)
    whole = np.rint(np.column_stack([cells[:, 0], 1.0 - cells[:, 1]]) * (ACROSS, DOWN)).astype(int)
    breaks = np.flatnonzero(np.diff(there.astype(int))) + 1
    pieces = [
        p for p, seen in zip(np.split(whole, breaks), there[[0, *breaks]], strict=True) if seen
    ]
    return "".join(_piece(p) + ("z" if closed else "") for p in pieces)


def _piece(cells: npt.NDArray[np.int_]) -> str:
    """Relative steps, without those that do not move and without the middle of straight runs."""
    first = f"M{cells[0, 0]} {cells[0, 1]}"
    steps = np.diff(cells, axis=0)
    steps = steps[steps.any(axis=1)]
    if not len(steps):
        return first + "h0"
    before, after = steps[:-1], steps[1:]
    bent = before[:, 0] * after[:, 1] != before[:, 1] * after[:, 0]
    turned = bent | ((before * after).sum(axis=1) < 0)
    starts = np.concatenate([[0], np.flatnonzero(turned) + 1])
    kept = np.add.reduceat(steps, starts, axis=0)
    return f"{first}l{' '.join(map(str, kept.ravel().tolist()))}".replace(" -", "-")


def stroke(value: Any, width_pt: float, artist: Artist, dashes: Sequence[float] = ()) -> str:
    """Attributes of a stroke."""
    text = f' stroke="{colour(value)}" stroke-width="{PX_PER_PT * width_pt:.3g}"'
    if dashes:
        lengths = " ".join(f"{PX_PER_PT * max(width_pt, 1.0) * d:.3g}" for d in dashes)
        text += f' stroke-dasharray="{lengths}"'
    return text + opacity("stroke-opacity", artist, value)


def dash_lengths(line: Line2D) -> Sequence[float]:
    """Lengths of the dashes of a line in line widths; it has no public name for them."""
    return line._unscaled_dash_pattern[1] or ()  # type: ignore[attr-defined,no-any-return]


def _line(axes: Axes, line: Line2D) -> str:
    data = np.asarray(line.get_xydata(), float)
    if not len(data):
        return ""
    marks = _dots(places(axes, line, data), line) if line.get_marker() in ("o", ".") else ""
    if line.get_linestyle() in ("None", "", " "):
        return marks
    if line.get_drawstyle() != "default":
        data = np.column_stack(STEP_LOOKUP_MAP[line.get_drawstyle()](data[:, 0], data[:, 1]))
    look = stroke(line.get_color(), float(line.get_linewidth()), line, dash_lengths(line))
    return f'<path d="{trace(places(axes, line, data))}"{look}/>{marks}'


def _dots(points: Array, line: Line2D) -> str:
    """Round dots: ends of strokes without length, which no stretching distorts."""
    size = float(line.get_markersize()) * (0.5 if line.get_marker() == "." else 1.0)
    d = spots(points)
    if not d:
        return ""
    edge, face = line.get_markeredgecolor(), line.get_markerfacecolor()
    ring = PX_PER_PT * float(line.get_markeredgewidth())
    text = _round(d, edge, PX_PER_PT * size, line)
    if face == "none":
        inner = f'stroke="var(--paper)" stroke-width="{PX_PER_PT * size - 2 * ring:.3g}"'
        text += f'<path class="dot" d="{d}" {inner}/>'
    return text


def spots(points: Array) -> str:
    """Path of strokes without length at points within the panel."""
    inside = points[np.isfinite(points).all(axis=1)]
    inside = inside[((inside >= -1e-6) & (inside <= 1.0 + 1e-6)).all(axis=1)]
    cells = np.rint(np.column_stack([inside[:, 0], 1.0 - inside[:, 1]]) * (ACROSS, DOWN))
    return "".join(f"M{x:.0f} {y:.0f}h0" for x, y in cells)


def _round(d: str, value: Any, size_px: float, artist: Artist) -> str:
    look = f'stroke="{colour(value)}" stroke-width="{size_px:.3g}"'
    return f'<path class="dot" d="{d}" {look}{opacity("stroke-opacity", artist, value)}/>'


def _segments(axes: Axes, lines: LineCollection) -> str:
    d = "".join(trace(places(axes, lines, s)) for s in lines.get_segments() if len(s))
    value, width = lines.get_color()[0], float(np.atleast_1d(lines.get_linewidth())[0])
    dashes: Any = lines.get_linestyle()[0]
    return f'<path d="{d}"{stroke(value, width, lines, dashes[1] or ())}/>'


def _scatter(axes: Axes, dots: PathCollection) -> str:
    offsets = dots.get_offset_transform().transform(np.asarray(dots.get_offsets(), float))
    box = axes.bbox
    points = (offsets - (box.x0, box.y0)) / (box.width, box.height)
    faces = np.asarray(dots.get_facecolor())
    faces = faces if len(faces) else np.asarray(dots.get_edgecolor())
    size = PX_PER_PT * float(np.sqrt(np.atleast_1d(dots.get_sizes())[0]))
    codes = np.array([to_hex(f) for f in faces])[np.arange(len(points)) % len(faces)]
    return "".join(_round(spots(points[codes == c]), c, size, dots) for c in dict.fromkeys(codes))


def _areas(axes: Axes, areas: Collection) -> str:
    d = "".join(trace(places(axes, areas, p.vertices), closed=True) for p in areas.get_paths())
    face = areas.get_facecolor()
    if not len(face) or not d:
        return ""
    return f'<path d="{d}" fill="{colour(face[0])}"{opacity("fill-opacity", areas, face[0])}/>'


def _image(axes: Axes, image: AxesImage) -> str:
    """Cells of a map, each a rectangle; those without a value are left out."""
    values: Any = np.ma.masked_invalid(np.ma.asarray(image.get_array(), float))
    rgba = image.to_rgba(values)
    rows, columns = values.shape[:2]
    wide, high = ACROSS / columns, DOWN / rows
    parts = []
    for i, j in zip(*np.nonzero(~np.ma.getmaskarray(values)), strict=True):
        if rgba[i, j, 3] < 0.005:
            continue
        x, y = round(j * wide), round(i * high)
        size = f'width="{round((j + 1) * wide) - x}" height="{round((i + 1) * high) - y}"'
        face = rgba[i, j]
        part = f'<rect x="{x}" y="{y}" {size} fill="{colour(face[:3])}"'
        parts.append(f"{part}{opacity('fill-opacity', image, face)}/>")
    return "".join(parts)


def lower(axes: Axes) -> str:
    """Everything of a panel that stretches with it, in the order of drawing."""
    found: list[Artist] = [*axes.images, *axes.collections, *axes.lines, *axes.artists]
    found += [p for p in axes.patches if not is_box(p)]
    return "".join(_low(axes, a) for a in sorted(found, key=Artist.get_zorder) if a.get_visible())


def _low(axes: Axes, artist: Artist) -> str:
    match artist:
        case Line2D():
            return _line(axes, artist)
        case LineCollection():
            return _segments(axes, artist)
        case PathCollection():
            return _scatter(axes, artist)
        case Collection():
            return _areas(axes, artist)
        case AxesImage():
            return _image(axes, artist)
        case Patch():
            d = trace(places(axes, artist, artist.get_path().vertices), closed=True)
            face = artist.get_facecolor()
            return f'<path d="{d}" fill="{colour(face)}"{opacity("fill-opacity", artist, face)}/>'
    raise TypeError(f"no mark for {type(artist).__name__}")


# --- upper layer ------------------------------------------------------------------------------


class Hatches:
    """Patterns of a figure, each defined once, with identifiers of their own."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.found: dict[tuple[str, str], str] = {}

    def fill(self, patch: Patch) -> str:
        """Reference to the pattern of a patch."""
        key = str(patch.get_hatch())[0], colour(patch.get_edgecolor())
        self.found.setdefault(key, f"{self.name}-hatch{len(self.found)}")
        return f"url(#{self.found[key]})"

    def definitions(self) -> str:
        """What the references refer to."""
        parts = [
            f'<pattern id="{of}" width="10" height="10" patternUnits="userSpaceOnUse">'
            f'<path d="{HATCHES[kind]}" fill="none" stroke="{edge}" stroke-width=".8"/></pattern>'
            for (kind, edge), of in self.found.items()
        ]
        return f"<defs>{''.join(parts)}</defs>" if parts else ""


def boxes(axes: Axes, hatches: Hatches) -> str:
    """Rectangles: bars and shades."""
    found = [p for p in axes.patches if is_box(p) and p.get_visible()]
    return "".join(_box(axes, p, hatches) for p in sorted(found, key=Artist.get_zorder))


def is_box(patch: Patch) -> bool:
    """Whether a patch is a rectangle along the axes; some versions make a polygon of a span."""
    corners = np.asarray(patch.get_path().vertices)
    return len(corners) == 5 and all(len(np.unique(corners[:, k])) <= 2 for k in (0, 1))


def _box(axes: Axes, patch: Patch, hatches: Hatches) -> str:
    ends = np.clip(places(axes, patch, patch.get_path().vertices), 0.0, 1.0)
    (left, bottom), (right, top) = ends.min(axis=0), ends.max(axis=0)
    at = (
        f'<rect x="{percent(left)}" y="{percent(1.0 - top)}" '
        f'width="{percent(right - left)}" height="{percent(top - bottom)}"'
    )
    text, face = "", patch.get_facecolor()
    if to_rgba(face)[3] > 0.0:
        text = f'{at} fill="{colour(face)}"{opacity("fill-opacity", patch, face)}{_edge(patch)}/>'
    if patch.get_hatch():
        text += f'{at} fill="{hatches.fill(patch)}"/>'
    return text


def _edge(patch: Patch) -> str:
    width = float(patch.get_linewidth())
    seen = width > 0.0 and to_rgba(patch.get_edgecolor())[3] > 0.0
    if not seen or to_hex(patch.get_edgecolor()) == to_hex(patch.get_facecolor()):
        return ""
    return f' stroke="{colour(patch.get_edgecolor())}" stroke-width="{width:.2g}"'


def glyphs(axes: Axes) -> str:
    """Markers that are no dots."""
    parts = []
    for line in axes.lines:
        glyph = GLYPHS.get(str(line.get_marker()))
        if glyph is None:
            continue
        size = max(2.0 * float(line.get_markersize()), 9.0)
        fill = colour(line.get_markeredgecolor())
        for x, y in places(axes, line, line.get_xydata()):
            if 0.0 <= x <= 1.0 and 0.0 <= y <= 1.0:
                at = f'x="{percent(x)}" y="{percent(1.0 - y)}" font-size="{size:.3g}"'
                parts.append(f'<text class="mark" {at} fill="{fill}">{glyph}</text>')
    return "".join(parts)


ANCHORS = {"left": "", "center": ' text-anchor="middle"', "right": ' text-anchor="end"'}
LOWERED = {"center": ' dy=".35em"', "center_baseline": ' dy=".35em"', "top": ' dy=".8em"'}


def texts(axes: Axes) -> str:
    """Words inside of a panel; a `gid` becomes their class."""
    return "".join(_text(axes, t) for t in axes.texts if t.get_visible() and t.get_text())


def _text(axes: Axes, text: Text) -> str:
    (x, y), *_ = places(axes, text, [text.get_position()])
    look = f' class="{text.get_gid()}"' if text.get_gid() else ""
    look += ANCHORS[text.get_horizontalalignment()] + LOWERED.get(text.get_verticalalignment(), "")
    if to_hex(text.get_color()) in VARIABLES and VARIABLES[to_hex(text.get_color())] != "--ink":
        look += f' fill="{colour(text.get_color())}"'
    if str(text.get_fontweight()) == "bold":
        look += ' font-weight="600"'
    if text.get_rotation():
        look += f' style="transform:rotate({-text.get_rotation():.0f}deg)"'
    return f'<text x="{percent(x)}" y="{percent(1.0 - y)}"{look}>{escape(text.get_text())}</text>'


def room_above(axes: Axes) -> float:
    """Pixels that words above a panel need."""
    above = [t for t in axes.texts if t.get_text() and _rises(axes, t)]
    rises = [len(t.get_text()) * np.sin(np.radians(t.get_rotation())) for t in above]
    return 16.0 + CHARACTER_PX * max(rises) if above else 0.0


def _rises(axes: Axes, text: Text) -> bool:
    return bool(places(axes, text, [text.get_position()])[0, 1] > 1.0)


def widest(labels: Iterable[str]) -> float:
    """Pixels that labels need."""
    return CHARACTER_PX * max((len(label) for label in labels), default=0)
