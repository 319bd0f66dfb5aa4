"""Figures of a trial as it was logged: channels over time with its maneuvers, and the track."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from auvident.report.figures import (
    BLUE,
    INK,
    KIND_COLOURS,
    ORANGE,
    SOFT,
    Array,
    new_figure,
    quiet,
    svg,
    thinned,
)
from auvident.report.figures_joined import joined
from auvident.report.numbers import PAGE, SHOWN_UNITS, unit_text
from auvident.schema.artifacts import Maneuver
from auvident.schema.channels import BY_COLUMN, RECORD_COLUMN, TIME_COLUMN
from auvident.schema.planes import PLANE_ROWS
from auvident.schema.trial import Trial

# Rows of the figure: columns drawn in one panel, label. Those a log lacks are left out.
ROWS = (
    (("u_mps",), "speed u"),
    (("rpm",), "propeller"),
    (("rudder_rad", "elevator_rad"), "rudder"),
    (("r_radps",), "yaw rate r"),
    (("q_radps",), "pitch rate q"),
    (("heading_rad",), "heading"),
    (("pitch_rad",), "pitch"),
    (("depth_m",), "depth"),
)
# columns that show in one plane alone
OWN = {row.name: {*row.columns[1:], row.control_columns[0]} for row in PLANE_ROWS}
OWN["vertical"].add("depth_m")
SHADE = {"identify": 0.18, "validate": 0.42}  # opacity by role
HATCH = {"identify": None, "validate": "////"}
LABEL_SHARE = 0.022  # of the trial's length a maneuver needs for its label
ROOMY_SHARE = 0.12  # the same where the page is narrow
TRACK_IN, TRACK_WIDTH_IN = 5.0, 7.5
HEAD_IN, HEAD_JOINED_IN, PANEL_IN = 1.0, 1.6, 1.05  # legend, names and axis; one panel
LABEL_SLANT_DEG = 22  # where names are long


def timeline(trials: Sequence[Trial], maneuvers: Sequence[Maneuver], name: str) -> str:
    """Channels over time, maneuvers shaded by kind and role, gaps marked.

    Parameters
    ----------
    trials : sequence of Trial
        Several are laid end to end.
    maneuvers : sequence of Maneuver
        Of any trial; those of others are left out.
    name : str
        Different for each figure of the page.
    """
    trial, own = joined(trials, maneuvers)
    rows = _rows(trial, own)
    head = HEAD_IN if len(trials) == 1 else HEAD_JOINED_IN
    figure = new_figure(head + PANEL_IN * len(rows))
    height = figure.get_figheight()
    panels = figure.subplots(
        len(rows) + 1,
        1,
        sharex=True,
        gridspec_kw={"height_ratios": [0.32, *[1.0] * len(rows)], "hspace": 0.16},
    )
    figure.subplots_adjust(
        left=0.075, right=0.99, top=1.0 - (head - 0.5) / height, bottom=0.45 / height
    )
    _strip(panels[0], own, trial, slanted=len(trials) > 1)
    for axes, (columns, label) in zip(panels[1:], rows, strict=True):
        _channel(axes, trial, columns, label)
        _shade(axes, own)
        _gaps(axes, trial)
        if axes is not panels[-1]:
            quiet(axes)
    panels[-1].set_xlabel("time, s" if len(trials) == 1 else "time, trials end to end, s")
    time = trial.table[TIME_COLUMN]
    panels[-1].set_xlim(float(time.iloc[0]), float(time.iloc[-1]))
    figure.align_ylabels(panels)
    _legend(figure, own, _interruptions(trial).size > 0, any(len(c) > 1 for c, _ in rows))
    return svg(figure, name, _told(trial, own, rows))


def _told(
    trial: Trial, maneuvers: Sequence[Maneuver], rows: Sequence[tuple[list[str], str]]
) -> str:
    """What was logged, in words."""
    ranges = [
        f"{BY_COLUMN[c].column.rpartition('_')[0] or c} {_range(trial, c)}"
        for columns, _ in rows
        for c in columns
    ]
    held = sum(m.role == "validate" for m in maneuvers)
    time = trial.table[TIME_COLUMN]
    gaps = len(_interruptions(trial))
    return (
        f"Trial {trial.name}, {float(time.iloc[-1] - time.iloc[0]):.0f} s: {', '.join(ranges)}; "
        f"{len(maneuvers)} maneuvers, {held} held out; gaps: {gaps or 'none'}"
    )


def _range(trial: Trial, column: str) -> str:
    unit, factor = SHOWN_UNITS.get(BY_COLUMN[column].unit, (BY_COLUMN[column].unit, 1.0))
    values = trial.table[column].to_numpy(float) * factor
    return f"{PAGE.interval(float(np.nanmin(values)), float(np.nanmax(values)))} {unit_text(unit)}"


def _rows(trial: Trial, maneuvers: Sequence[Maneuver]) -> list[tuple[list[str], str]]:
    """Panels for what the log has, of the plane that its maneuvers are of."""
    planes = {m.plane for m in maneuvers} or {"horizontal"}
    left_out = {column for plane in OWN if plane not in planes for column in OWN[plane]}
    rows = []
    for columns, label in ROWS:
        there = [c for c in columns if c in trial.table and c not in left_out]
        there = [c for c in there if trial.table[c].notna().any()]
        if there:
            rows.append((there, label))
    return rows


def _label(m: Maneuver, trial: Trial) -> str:
    """Short name of a maneuver."""
    label = m.id.removeprefix(f"{trial.name}-").removeprefix(f"{m.plane}-")
    return label.replace("straight", "str").replace("zigzag", "zz")


def _strip(axes: Axes, maneuvers: Sequence[Maneuver], trial: Trial, slanted: bool) -> None:
    """Bars with the names of the maneuvers above the panels."""
    time = trial.table[TIME_COLUMN]
    span = float(time.iloc[-1] - time.iloc[0])
    shortest = LABEL_SHARE * span
    for m in maneuvers:
        length = m.t_end_s - m.t_start_s
        held = m.role == "validate"
        axes.barh(
            0,
            length,
            left=m.t_start_s,
            height=1.0,
            color=KIND_COLOURS[m.kind],
            alpha=0.55 if held else 0.3,
            hatch=HATCH[m.role],
            edgecolor=INK if held else SOFT,
            linewidth=1.2 if held else 0.5,
        )
        if slanted or length > shortest:
            place = m.t_start_s if slanted else m.t_start_s + length / 2
            axes.text(
                place,
                0.72,
                _label(m, trial),
                ha="left" if slanted else "center",
                va="bottom",
                rotation=LABEL_SLANT_DEG if slanted else 0,
                rotation_mode="anchor",
                fontsize=8,
                fontweight="bold" if held else None,
                gid=None if length > ROOMY_SHARE * span and not slanted else "roomy",
            )
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
    if len(columns) > 1:
        label = "fins"
    elif columns[0] == "elevator_rad":
        label = "elevator"
    axes.set_ylabel(f"{label}\n{unit_text(unit)}")
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


def _legend(figure: Figure, maneuvers: Sequence[Maneuver], gaps: bool, both_fins: bool) -> None:
    kinds = dict.fromkeys(m.kind for m in maneuvers)
    handles: list[Patch | Line2D] = [
        Patch(color=KIND_COLOURS[k], alpha=0.4, label=k) for k in kinds
    ]
    handles.append(Patch(facecolor="none", edgecolor=SOFT, label="identifies"))
    handles.append(Patch(facecolor="none", edgecolor=INK, hatch="////", label="held out"))
    if both_fins:
        fins = (("rudder", BLUE), ("elevator", ORANGE))
        handles += [Line2D([], [], color=colour, label=words) for words, colour in fins]
    if gaps:
        handles.append(Patch(facecolor="none", edgecolor=SOFT, hatch="xxxx", lw=0, label="gap"))
    figure.legend(
        handles=handles,
        loc="upper right",
        ncols=len(handles),
        bbox_to_anchor=(0.995, 1.005),
        borderaxespad=0.2,
        handlelength=1.6,
        columnspacing=1.2,
    )


def track(trials: Sequence[Trial], maneuvers: Sequence[Maneuver], name: str) -> str | None:
    """Tracks, north up; measured positions, else dead reckoning; None without both.

    Several trials are drawn from their own start.
    """
    found = [(t, p) for t in trials if (p := _positions(t)) is not None]
    if not found:
        return None
    figure = new_figure(TRACK_IN, width_in=TRACK_WIDTH_IN)
    axes = figure.subplots()
    for trial, (north, east, _) in found:
        if len(found) > 1:
            first = np.flatnonzero(np.isfinite(north))[0]
            north, east = north - north[first], east - east[first]
        _one_track(axes, trial, north, east, [m for m in maneuvers if m.trial == trial.name])
    axes.set_aspect("equal", adjustable="datalim")
    start = ", each from its start" if len(found) > 1 else ""
    axes.set_xlabel(f"east, m{start}")
    axes.set_ylabel("north, m")
    how = " and ".join(dict.fromkeys(p[2] for _, p in found))
    axes.set_title(f"{how}; held-out maneuvers thick")
    lengths = [np.nansum(np.hypot(np.diff(p[0]), np.diff(p[1]))) for _, p in found]
    wide, high = axes.dataLim.width, axes.dataLim.height
    return svg(
        figure,
        name,
        f"Track of trial {', '.join(t.name for t, _ in found)}: {high:.0f} m from south to north, "
        f"{wide:.0f} m from west to east, {sum(lengths):.0f} m long",
    )


def _one_track(
    axes: Axes, trial: Trial, north: Array, east: Array, maneuvers: Sequence[Maneuver]
) -> None:
    time = trial.table[TIME_COLUMN].to_numpy(float)
    axes.plot(*thinned(east, north), color=SOFT, lw=0.7)
    for m in maneuvers:
        inside = (time >= m.t_start_s) & (time <= m.t_end_s)
        width = 2.6 if m.role == "validate" else 1.5
        axes.plot(*thinned(east[inside], north[inside]), color=KIND_COLOURS[m.kind], lw=width)
    if not axes.texts:  # said once where several begin at the same place
        start = np.flatnonzero(np.isfinite(north))[0]
        axes.plot(east[start], north[start], "o", color=INK, ms=5)
        axes.text(float(east[start]), float(north[start]), "  start")


def _positions(trial: Trial) -> tuple[Array, Array, str] | None:
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
