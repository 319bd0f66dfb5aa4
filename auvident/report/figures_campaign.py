"""Figures of a vehicle over its trials."""

from collections.abc import Sequence
from datetime import datetime

import numpy as np

from auvident.report import figures
from auvident.schema.changes import Changes, SeriesPoint, VehicleChange

USUAL = ("fin", "drag", "thrust", "lift", "cross-flow")  # drawn where nothing changed
MOST = 8  # panels
PANEL_IN = 1.7
NAMES = {
    "fin": "fin force and moment",
    "drag": "drag",
    "thrust": "thrust",
    "lift": "hull lift",
    "cross-flow": "cross-flow drag",
}


def over_trials(found: Changes) -> str:
    """Quantities over the trials, each with what chance lets it be and its change."""
    changed = {c.what: c for c in found.changes}
    wanted = dict.fromkeys([*changed, *USUAL])
    names = [n for n in wanted if n in found.series][:MOST]
    if not names or len(found.trials) < 2:
        return ""
    figure = figures.new_figure(PANEL_IN * len(names) + 0.5)
    axes = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    x, labels = _abscissa(found)
    for axis, name in zip(axes, names, strict=True):
        _panel(axis, found.series[name], x, changed.get(name))
        for change in (c for c in found.changes if c.what == name):
            _mark(axis, change, found, x)
        axis.set_title(NAMES.get(name, name))
    axes[-1].set_xlabel(labels)
    told = ", ".join(c.what for c in found.changes) or "nothing"
    text = f"{found.vehicle} over {len(found.trials)} trials: {told} changed"
    return figures.svg(figure, f"changes-{found.vehicle}", text)


def _abscissa(found: Changes) -> tuple[np.ndarray, str]:
    if found.dated:
        stamps = [datetime.fromisoformat(d).timestamp() / 86_400.0 for d in found.dates]
        return np.array(stamps) - stamps[0], f"days since {found.dates[0][:10]}"
    return np.arange(1.0, len(found.trials) + 1.0), "trial"


def _panel(
    axis: figures.Axes,
    points: Sequence[SeriesPoint],
    x: np.ndarray,
    change: VehicleChange | None,
) -> None:
    """A quantity over the trials; what is drawn without a change is one share of a group."""
    seen = [k for k, p in enumerate(points) if p.std is not None]
    factor = _factor(change)
    values = np.array([factor * points[k].value for k in seen])
    stds = np.array([factor * (points[k].std or 0.0) for k in seen])
    axis.axhline(0.0, color=figures.GRID)
    axis.errorbar(
        x[seen], values, 1.96 * stds, fmt="o", ms=4, color=figures.BLUE, ecolor=figures.SKY, lw=1.0
    )
    axis.set_ylabel(_label(change))
    if len(seen):
        reach = max(float(np.quantile(np.abs(values) + 2.0 * stds, 0.9)), 1e-9)
        axis.set_ylim(-1.4 * reach, 1.4 * reach)


def _factor(change: VehicleChange | None) -> float:
    """From a size to what is drawn: shares in per cent."""
    return 100.0 if change is None or change.share else 1.0


def _label(change: VehicleChange | None) -> str:
    if change is None or change.share:
        return "% of common"
    return "difference" if change.unit == "-" else f"difference [{change.unit}]"


def _mark(axis: figures.Axes, change: VehicleChange, found: Changes, x: np.ndarray) -> None:
    """Where a step set in, or the line of a drift."""
    if change.kind == "drift":
        ends = 0.5 * _factor(change) * of_middle(change) * np.array([-1.0, 1.0])
        axis.plot(x[[0, -1]], ends, color=figures.VERMILLION)
        return
    first, early, late = (
        found.trials.index(n) for n in (change.trial, change.earliest, change.latest)
    )
    axis.axvspan(x[max(early - 1, 0)], x[late], color=figures.ORANGE, alpha=0.2, lw=0)
    axis.axvline(0.5 * (x[first - 1] + x[first]), color=figures.VERMILLION)


def of_middle(change: VehicleChange) -> float:
    """Size of a drift as the points have it: a share of the middle, where it is told of the start.

    From 1.2 to 0.8 of the middle is a fall by 40 % of that and by a third of the start.
    """
    return change.size / (1.0 + 0.5 * change.size) if change.share else change.size
