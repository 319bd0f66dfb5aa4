"""Figures of what a coefficient rests on: prior, data and final value, and how it settled."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from auvident.report.figures import (
    BLUE,
    GREEN,
    INK,
    ORANGE,
    SKY,
    SOFT,
    VERMILLION,
    new_figure,
    svg,
)
from auvident.report.tables_evidence import Way
from auvident.report.verdict_rules import SETTLED
from auvident.schema.artifacts import AgainstPrior, IdentifiedModel, ModelConstant

ORIGIN_COLOURS = {"identified": BLUE, "kinematic": GREEN, "ase": SOFT, "given": SOFT}
REACH = 4.5  # prior standard deviations shown on each side; farther ones get an arrow
LEAST_MOVE = 1.0e-2  # standard deviations, where the logarithmic axis of the changes begins
TINY = 1.0e-300  # in place of no standard deviation
# height of the three in a row: data above, final, before below
ABOVE, BELOW = -0.24, 0.24


def evidence(
    model: IdentifiedModel, before: IdentifiedModel | None, name: str, prior: str = "ASE"
) -> str | None:
    """Prior, data alone and final value of each coefficient, with the share from the data.

    Parameters
    ----------
    model, before : IdentifiedModel
        The final model, and the identified one where that is another.
    name : str
        Different for each figure of the page.
    prior : str
        What the prior is called.
    """
    rows = [c for c in model.estimates if c.prior_std > 0.0]
    if not rows:
        return None
    told = model.prior_against_data
    alone = {row.symbol: row for row in told.coefficients} if told else {}
    earlier = {c.symbol: c for c in before.estimates} if before else {}
    figure = new_figure(1.15 + 0.27 * len(rows))
    height = figure.get_figheight()
    left, right = figure.subplots(
        1, 2, sharey=True, gridspec_kw={"width_ratios": [3.2, 1.0], "wspace": 0.04}
    )
    figure.subplots_adjust(left=0.07, right=0.99, top=1.0 - 0.62 / height, bottom=0.5 / height)
    left.axvspan(-1.0, 1.0, color=SKY, alpha=0.2, lw=0)
    left.axvline(0.0, color=SOFT, lw=0.8)
    _marks(left, rows, alone, ABOVE, (ORANGE, "D", 3.2, 1.0))
    for origin, colour in ORIGIN_COLOURS.items():
        own = {c.symbol: c for c in rows if c.origin == origin}
        _marks(left, rows, own, 0.0, (colour, "o", 4.6, 1.8))
    _marks(left, rows, earlier, BELOW, (VERMILLION, "s", 3.0, 1.0))
    right.barh(
        range(len(rows)),
        [100.0 * c.data_share for c in rows],
        color=[ORIGIN_COLOURS[c.origin] for c in rows],
        height=0.6,
    )
    left.set_xlim(-REACH, REACH)
    left.set_ylim(len(rows) - 0.4, -0.6)
    left.set_yticks(range(len(rows)), [c.symbol for c in rows])
    left.set_xlabel("(value − prior) / prior standard deviation")
    right.set_xlim(0.0, 100.0)
    right.set_xlabel("% of the certainty")
    right.set_title("from the data")
    right.tick_params(left=False)
    figure.legend(
        handles=_handles(bool(alone), before is not None, prior),
        loc="upper left",
        ncols=4,
        bbox_to_anchor=(0.062, 1.0),
        borderaxespad=0.1,
    )
    return svg(figure, name, _told(model, before is not None))


def _marks(
    axes: Axes,
    rows: Sequence[ModelConstant],
    found: Mapping[str, AgainstPrior | ModelConstant],
    off: float,
    look: tuple[str, str, float, float],
) -> None:
    """One of the three of every coefficient that has it, in prior standard deviations."""
    colour, marker, size, width = look
    at = [(i, c, found[c.symbol]) for i, c in enumerate(rows) if c.symbol in found]
    values = np.array([_value(row) for _, _, row in at]).reshape(-1, 2)
    prior = np.array([(c.prior, c.prior_std) for _, c, _ in at]).reshape(-1, 2)
    place, spread = (values[:, 0] - prior[:, 0]) / prior[:, 1], values[:, 1] / prior[:, 1]
    y = np.array([i + off for i, _, _ in at])
    near = np.abs(place) <= REACH
    axes.errorbar(
        place[near],
        y[near],
        xerr=spread[near],
        fmt=marker,
        color=colour,
        ms=size,
        elinewidth=width,
        capsize=0,
    )
    for x, height in zip(place[~near], y[~near], strict=True):
        _far(axes, float(x), float(height), colour)


def _value(row: AgainstPrior | ModelConstant) -> tuple[float, float]:
    """What the data alone say, or the value, with its standard deviation."""
    return (row.data, row.data_std) if isinstance(row, AgainstPrior) else (row.value, row.std)


def _far(axes: Axes, place: float, y: float, colour: str) -> None:
    """An arrow at the edge of the axis, with the distance."""
    side = 1.0 if place > 0.0 else -1.0
    axes.plot(side * (REACH - 0.1), y, ">" if side > 0 else "<", color=colour, ms=5)
    axes.text(
        side * (REACH - 0.22),
        y,
        f"{place:+.1f}".replace("-", "−"),
        va="center",
        fontsize=8.5,
        ha="right" if side > 0 else "left",
    )


def _handles(alone: bool, before: bool, prior: str) -> list[Line2D | Patch]:
    """What the marks are, those that are there."""
    found: list[Line2D | Patch] = [
        Patch(
            color=SKY,
            alpha=0.2,
            label=f"{'prior' if prior == 'prior' else f'prior ({prior})'} ± std",
        ),
        Line2D([], [], color=BLUE, marker="o", ms=4.6, lw=1.8, label="final value ± std"),
    ]
    if alone:
        found.append(
            Line2D([], [], color=ORANGE, marker="D", ms=3.2, lw=1.0, label="data alone ± std")
        )
    if before:
        found.append(
            Line2D([], [], color=VERMILLION, marker="s", ms=3.0, lw=1.0, label="before refine")
        )
    return found


def _told(model: IdentifiedModel, refined: bool) -> str:
    """For those who cannot see it: what moved most, and what the data hardly touch."""
    rows = [c for c in model.estimates if c.prior_std > 0.0]
    most = max(rows, key=lambda c: abs(c.value - c.prior) / c.prior_std)
    idle = [c.symbol for c in rows if c.data_share < 0.3]
    text = (
        f"Prior, data and {'final' if refined else 'identified'} value of {len(rows)} "
        "coefficients; "
        f"{most.symbol} is furthest from its prior, by "
        f"{abs(most.value - most.prior) / most.prior_std:.1f} standard deviations"
    )
    return text + (f"; from the prior: {', '.join(idle)}" if idle else "")


def settling(ways: Sequence[Way], heads: Sequence[str], name: str) -> str | None:
    """How far each coefficient is from its final value after each round, logarithmic."""
    if not ways or len(ways[0].values) < 2:
        return None
    figure = new_figure(2.6, width_in=8.2)
    axes = figure.subplots()
    values = np.array([way.values for way in ways])
    spread = np.array([max(way.final.std, TINY) for way in ways])
    away = np.abs(values[:, :-1] - values[:, -1:]) / spread[:, None]
    shown = np.maximum(away, LEAST_MOVE)
    places = np.arange(shown.shape[1])
    restless = away[:, -1] > SETTLED.words[0].limit
    for chosen, colour, opacity in ((~restless, BLUE, 0.45), (restless, VERMILLION, 0.9)):
        y = np.column_stack([shown[chosen], np.full(chosen.sum(), np.nan)]).ravel()
        x = np.tile(np.append(places, np.nan), chosen.sum())  # one line with holes: drawn quickly
        axes.plot(x, y, "o-", color=colour, lw=0.9, ms=3, alpha=opacity)
    limit = SETTLED.words[0].limit
    axes.axhline(limit, color=INK, lw=0.9, ls=(0, (4, 2)))
    axes.text(places[-1] + 0.06, limit / 1.15, f"settled: up to {limit:g}", fontsize=8.5, va="top")
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(lambda x, _: f"{x:g}")
    axes.yaxis.set_minor_formatter(lambda x, _: "")
    axes.set_xticks(places, heads[:-1])
    axes.set_xlim(-0.15, len(places) - 0.6)
    axes.set_ylabel("distance from the final value, std")
    figure.tight_layout()
    restless_names = [w.symbol for w, r in zip(ways, restless, strict=True) if r]
    told = f"{len(ways) - len(restless_names)} of {len(ways)} coefficients have settled"
    return svg(figure, name, f"{told}; not yet {', '.join(restless_names) or 'none'}")
