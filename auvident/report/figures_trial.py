"""Figures of a trial as it was logged: channels over time with its maneuvers, and the track."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from auvident.report.figures import (
    BLUE,
    INK,
    KIND_COLOURS,
    ORANGE,
    SOFT,
    new_figure,
    quiet,
    svg,
    thinned,
)
from auvident.report.html_data import SHOWN_UNITS
from auvident.schema.artifacts import Maneuver
from auvident.schema.channels import BY_COLUMN, RECORD_COLUMN, TIME_COLUMN
from auvident.schema.trial import Trial

# Rows of the figure: columns drawn in one panel, label. Those a log lacks are left out.
ROWS = (
    (("u_mps",), "speed u"),
    (("rpm",), "propeller"),
    (("rudder_rad", "elevator_rad"), "rudder"),
    (("r_radps",), "yaw rate r"),
    (("q_radps",), "pitch rate q"),
    (("heading_rad",), "heading"),
    (("depth_m",), "depth"),
)
VERTICAL_ONLY = ("q_radps", "elevator_rad")
HORIZONTAL_ONLY = ("r_radps", "heading_rad")
SHADE = {"identify": 0.18, "validate": 0.42}  # opacity by role
HATCH = {"identify": None, "validate": "////"}
LABEL_SHARE = 0.022  # of the trial's length a maneuver needs for its label
TRACK_IN = 4.6
HEAD_IN, PANEL_IN = 1.0, 1.05  # height of legend, names and axis; of one panel


def timeline(trial: Trial, maneuvers: Sequence[Maneuver], name: str) -> str:
    """Channels of a trial over time, maneuvers shaded by kind and role, gaps marked.

    Parameters
    ----------
    trial : Trial
    maneuvers : sequence of Maneuver
        Of any trial; the others are left out.
    name : str
        Different for each figure of the page.
    """
    own = [m for m in maneuvers if m.trial == trial.name]
    rows = _rows(trial, own)
    figure = new_figure(HEAD_IN + PANEL_IN * len(rows))
    height = figure.get_figheight()
    heights = [0.32, *[1.0] * len(rows)]
    panels = figure.subplots(
        len(rows) + 1, 1, sharex=True, gridspec_kw={"height_ratios": heights, "hspace": 0.16}
    )
    figure.subplots_adjust(left=0.075, right=0.99, top=1.0 - 0.5 / height, bottom=0.45 / height)
    _strip(panels[0], own, trial)
    for axes, (columns, label) in zip(panels[1:], rows, strict=True):
        _channel(axes, trial, columns, label)
        _shade(axes, own)
        _gaps(axes, trial)
        if axes is not panels[-1]:
            quiet(axes)
    panels[-1].set_xlabel("time, s")
    time = trial.table[TIME_COLUMN]
    panels[-1].set_xlim(float(time.iloc[0]), float(time.iloc[-1]))
    _legend(figure, own, _interruptions(trial).size > 0)
    return svg(figure, name, f"Trial {trial.name} over time with its maneuvers")


def _rows(trial: Trial, maneuvers: Sequence[Maneuver]) -> list[tuple[list[str], str]]:
    """Panels for what the log has, of the plane that its maneuvers are of."""
    planes = {m.features.get("plane", "horizontal") for m in maneuvers} or {"horizontal"}
    left_out: set[str] = set()
    if "vertical" not in planes:
        left_out |= {*VERTICAL_ONLY, "depth_m"}
    if "horizontal" not in planes:
        left_out |= {*HORIZONTAL_ONLY, "rudder_rad"}
    rows = []
    for columns, label in ROWS:
        there = [c for c in columns if c in trial.table and c not in left_out]
        there = [c for c in there if trial.table[c].notna().any()]
        if there:
            rows.append((there, label))
    return rows


def _strip(axes: Axes, maneuvers: Sequence[Maneuver], trial: Trial) -> None:
    """Bars with the names of the maneuvers above the panels."""
    time = trial.table[TIME_COLUMN]
    shortest = LABEL_SHARE * float(time.iloc[-1] - time.iloc[0])
    for m in maneuvers:
        length = m.t_end_s - m.t_start_s
        held = m.role == "validate"
        axes.barh(
            0, length, left=m.t_start_s, height=1.0, color=KIND_COLOURS[m.kind],
            alpha=0.55 if held else 0.3, hatch=HATCH[m.role], edgecolor=INK if held else SOFT,
            linewidth=1.2 if held else 0.5,
        )  # fmt: skip
        if length > shortest:
            label = m.id.removeprefix(f"{trial.name}-").removeprefix("vertical-")
            axes.text(
                m.t_start_s + length / 2, 0.72, label.replace("straight", "str").replace("zigzag",
                "zz"), ha="center", va="bottom", fontsize=8, fontweight="bold" if held else None,
            )  # fmt: skip
    axes.set_ylim(-0.5, 0.5)
    axes.set_axis_off()


def _channel(axes: Axes, trial: Trial, columns: Sequence[str], label: str) -> None:
    time = trial.table[TIME_COLUMN].to_numpy(float)
    for column, colour in zip(columns, (BLUE, ORANGE), strict=False):
        unit, factor = SHOWN_UNITS.get(BY_COLUMN[column].unit, (BY_COLUMN[column].unit, 1.0))
        values = trial.table[column].to_numpy(float) * factor
        where = "steps-post" if BY_COLUMN[column].kind == "input" else "default"
        axes.plot(*thinned(time, values), color=colour, lw=0.9, drawstyle=where, label=column)
    if columns[0] == "depth_m":
        axes.invert_yaxis()
    words = "elevator" if columns[0] == "elevator_rad" else label
    if len(columns) > 1:
        words = "rudder,\nelevator (orange)"
    axes.set_ylabel(f"{words}\n{unit}")
    axes.locator_params(axis="y", nbins=5)


def _shade(axes: Axes, maneuvers: Sequence[Maneuver]) -> None:
    for m in maneuvers:
        axes.axvspan(m.t_start_s, m.t_end_s, color=KIND_COLOURS[m.kind], alpha=SHADE[m.role], lw=0)


def _interruptions(trial: Trial) -> np.ndarray:
    """First row of each interruption and the row after its last, shape (n, 2)."""
    if RECORD_COLUMN not in trial.table:
        return np.empty((0, 2), int)
    outside = (trial.table[RECORD_COLUMN].to_numpy() < 0).astype(int)
    return np.flatnonzero(np.diff(np.concatenate([[0], outside, [0]]))).reshape(-1, 2)


def _gaps(axes: Axes, trial: Trial) -> None:
    """Where a needed channel is interrupted: hatched."""
    time = trial.table[TIME_COLUMN].to_numpy(float)
    for first, last in _interruptions(trial):
        end = time[min(last, len(time) - 1)]
        axes.axvspan(time[first], end, facecolor="none", edgecolor=SOFT, hatch="xxxx", lw=0)


def _legend(figure: Figure, maneuvers: Sequence[Maneuver], gaps: bool) -> None:
    kinds = dict.fromkeys(m.kind for m in maneuvers)
    handles = [Patch(color=KIND_COLOURS[k], alpha=0.4, label=k) for k in kinds]
    handles.append(Patch(facecolor="none", edgecolor=SOFT, label="identifies"))
    handles.append(Patch(facecolor="none", edgecolor=INK, hatch="////", label="held out"))
    if gaps:
        handles.append(Patch(facecolor="none", edgecolor=SOFT, hatch="xxxx", lw=0, label="gap"))
    figure.legend(
        handles=handles, loc="upper right", ncols=len(handles), bbox_to_anchor=(0.995, 1.005),
        borderaxespad=0.2, handlelength=1.6, columnspacing=1.2,
    )  # fmt: skip


def track(trial: Trial, maneuvers: Sequence[Maneuver], name: str) -> str | None:
    """Track of a trial, north up; measured positions, else dead reckoning; None without both."""
    found = _positions(trial)
    if found is None:
        return None
    north, east, how = found
    time = trial.table[TIME_COLUMN].to_numpy(float)
    spans = [max(float(np.nanmax(x) - np.nanmin(x)), 1.0) for x in (north, east)]
    wide = min(max(spans[1] / spans[0], 0.45), 2.0)
    figure = new_figure(TRACK_IN, width_in=min(TRACK_IN * wide + 2.8, 11.0))
    axes = figure.subplots()
    axes.plot(*thinned(east, north), color=SOFT, lw=0.7)
    for m in (m for m in maneuvers if m.trial == trial.name):
        inside = (time >= m.t_start_s) & (time <= m.t_end_s)
        width = 2.6 if m.role == "validate" else 1.5
        axes.plot(*thinned(east[inside], north[inside]), color=KIND_COLOURS[m.kind], lw=width)
    start = np.flatnonzero(np.isfinite(north))[0]
    axes.plot(east[start], north[start], "o", color=INK, ms=5)
    axes.annotate(" start", (east[start], north[start]))
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("east, m")
    axes.set_ylabel("north, m")
    axes.set_title(f"{how}; held-out maneuvers thick")
    figure.tight_layout()
    return svg(figure, name, f"Track of trial {trial.name}")


def _positions(trial: Trial) -> tuple[np.ndarray, np.ndarray, str] | None:
    """North, east and how they were found."""
    table = trial.table
    if {"north_m", "east_m"} <= set(table) and table["north_m"].notna().any():
        return (
            table["north_m"].to_numpy(float),
            table["east_m"].to_numpy(float),
            "measured positions",
        )
    if "heading_rad" not in table or table["heading_rad"].isna().all():
        return None
    heading = table["heading_rad"].interpolate(limit_direction="both").to_numpy(float)
    u, v = (np.nan_to_num(table[c].to_numpy(float)) for c in ("u_mps", "v_mps"))
    step = 1.0 / trial.rate_hz
    north = np.cumsum(u * np.cos(heading) - v * np.sin(heading)) * step
    east = np.cumsum(u * np.sin(heading) + v * np.cos(heading)) * step
    return north, east, "dead reckoning from speed and heading"
