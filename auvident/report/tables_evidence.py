"""Tables of what each coefficient rests on: prior, data, scatter, and the way to its value."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from auvident.report.tables import (
    Cell,
    Column,
    Fixed,
    Number,
    Rounded,
    Rows,
    Table,
    Unit,
    WithStd,
    columns,
)
from auvident.report.verdict_rules import SETTLED
from auvident.schema.artifacts import IdentifiedModel, ModelCoefficient, ModelConstant
from auvident.schema.coefficients import ESTIMATED

if TYPE_CHECKING:
    import pandas as pd

COVERAGE = 2.0  # k of an expanded uncertainty, GUM 6.2
NOTHING_KNOWN = "says nothing"
FITTED = "final, output error"  # where a fit of the free-running prediction came last
WRONG_SIGN = " !"
WRONG_SIGN_NOTE = "! marks a sign opposite to that expected of a streamlined hull."


# --- prior, data and posterior ------------------------------------------------------------


def evidence(model: IdentifiedModel, before: IdentifiedModel | None = None) -> Table:
    """Each coefficient before the data, by the data alone, and after; in units and prime values.

    Parameters
    ----------
    model : IdentifiedModel
        The final model.
    before : IdentifiedModel, optional
        The identified one, where the final model is another.
    """
    told = model.prior_against_data
    data = {row.symbol: row for row in told.coefficients} if told else {}
    earlier = {c.symbol: c for c in before.estimates} if before else {}
    rows: list[list[Cell]] = []
    for c in model.estimates:
        alone = data.get(c.symbol)
        own = earlier.get(c.symbol)
        rows.append(
            [
                c.symbol,
                f"{ESTIMATED[c.symbol].meaning} ({ESTIMATED[c.symbol].regressor})",
                Unit(c.unit),
                WithStd(c.value, c.std, WRONG_SIGN * has_wrong_sign(c)),
                *([WithStd(own.value, own.std) if own else ""] if before else []),
                WithStd(c.prior, c.prior_std),
                WithStd(alone.data, alone.data_std) if alone else NOTHING_KNOWN,
                Fixed(alone.away if alone else None, "+.1f"),
                Fixed(100.0 * c.data_share, ".0f", " %"),
                _prime(c),
                f"{c.origin}, both planes" if c.shared_with else c.origin,
            ]
        )
    heads = (
        *columns(("", "meaning", "unit")),
        *columns(numbers=("final" if before else "identified",)),
        *columns(numbers=("before refine",) if before else ()),
        *columns(numbers=("prior", "data alone", "apart, std", "from data", "1000 × prime")),
        Column("origin"),
    )
    note = WRONG_SIGN_NOTE if any(has_wrong_sign(c) for c in model.estimates) else ""
    together = (
        f"Prior and data together: chi-square {told.chi_square:.1f} in {told.directions} "
        f"directions that the data see, probability {told.p:.2g}."
        if told
        else ""
    )
    return Table(heads, rows, caption=" ".join(x for x in (together, note) if x))


def has_wrong_sign(c: ModelConstant) -> bool:
    """Whether a value has the sign that a streamlined hull does not."""
    return c.value * ESTIMATED[c.symbol].sign < 0.0


def _prime(c: ModelConstant) -> Cell:
    """The value without dimension, with its standard deviation."""
    if not isinstance(c, ModelCoefficient):
        return ""
    if c.value == 0.0:
        return Number(0.0)
    factor = 1000.0 * c.prime / c.value
    return WithStd(1000.0 * c.prime, factor * c.std)


# --- uncertainty after GUM ----------------------------------------------------------------


@dataclass(frozen=True)
class Parts:
    """Standard uncertainties of a coefficient: from scatter, from the prior, and together."""

    scatter: float
    prior: float

    @property
    def combined(self) -> float:
        """Root sum of squares, GUM 5.1.2."""
        return float(np.hypot(self.scatter, self.prior))


def uncertainty_parts(model: IdentifiedModel) -> dict[str, Parts]:
    """Type A and type B of each coefficient, where the model knows both.

    With the prior's information D and the posterior covariance P of the fit, P D P is what the
    uncertainty of the prior gives the estimate, and P - P D P what the readings give. Type A is the
    scatter between maneuvers (jackknife), which holds what the readings give; type B is the
    first part, with the priors taken as independent.
    """
    found = model.covariance
    if not found or "fitted_variance" not in found:
        return {}
    symbols: list[str] = list(found["symbols"])
    covariance = np.array(found["matrix"], float)
    np.fill_diagonal(covariance, found["fitted_variance"])
    prior = np.sqrt(np.sum((covariance / np.array(found["scale"], float)) ** 2, axis=1))
    rows = {c.symbol: c for c in model.estimates}
    return {
        s: Parts(scatter=float(rows[s].std_jackknife or 0.0), prior=float(prior[i]))
        for i, s in enumerate(symbols)
        if s in rows and rows[s].std_jackknife is not None
    }


def uncertainty(model: IdentifiedModel) -> Table:
    """Type A, type B, combined and expanded uncertainty of each coefficient."""
    parts = uncertainty_parts(model)
    rows: Rows = [
        [
            c.symbol,
            Unit(c.unit),
            Rounded(c.value, parts[c.symbol].combined),
            Number(parts[c.symbol].scatter, 2),
            Number(parts[c.symbol].prior, 2),
            Number(parts[c.symbol].combined, 2),
            Number(COVERAGE * parts[c.symbol].combined, 2),
            _relative(COVERAGE * parts[c.symbol].combined, c.value),
        ]
        for c in model.estimates
        if c.symbol in parts
    ]
    numbers = ("value", "type A", "type B", "combined", f"expanded, k = {COVERAGE:g}", "of value")
    return Table(columns(("", "unit"), numbers), rows)


def _relative(expanded: float, value: float) -> Cell:
    """In percent of the value; none where that says nothing."""
    share = expanded / abs(value) if value else float("inf")
    return Fixed(100.0 * share if share < 10.0 else None, ".0f", " %")


# --- convergence --------------------------------------------------------------------------


@dataclass(frozen=True)
class Way:
    """Values of a coefficient at the end of each round, and how far the last one moved it."""

    symbol: str
    values: tuple[float, ...]
    final: ModelConstant

    @property
    def moved(self) -> float:
        """Last change in standard deviations."""
        if len(self.values) < 2 or self.final.std <= 0.0:
            return 0.0
        return (self.values[-1] - self.values[-2]) / self.final.std


def rounds(model: IdentifiedModel) -> list[str]:
    """What each value of a way is: cycles by the filter, and what a fit made of the last one."""
    cycles = dict.fromkeys(s.cycle for s in model.stages if not s.fitted_noise)
    named = [f"{model.filter.upper()}, cycle {c}" for c in cycles]
    return [*named, FITTED] if any(s.fitted_noise for s in model.stages) else named


def ways(model: IdentifiedModel, history: "pd.DataFrame") -> list[Way]:
    """Each coefficient at the end of each round of the plan."""
    orders = [o for o, s in enumerate(model.stages) if not s.fitted_noise]
    ends = list({model.stages[o].cycle: o for o in orders}.values())  # the last of each cycle
    fitted = len(orders) < len(model.stages)
    last = history.groupby(["order", "symbol"], sort=False)["value"].last().unstack()
    held = last.reindex(range(len(model.stages))).ffill().loc[ends]
    return [
        Way(c.symbol, (*held[c.symbol].tolist(), *([c.value] if fitted else [])), c)
        for c in model.estimates
        if c.symbol in held.columns and not held[c.symbol].isna().any()
    ]


def convergence(found: Sequence[Way], heads: Sequence[str]) -> Table:
    """Each coefficient after each round, its last change, and whether it has settled."""
    rows: Rows = [
        [
            w.symbol,
            Unit(w.final.unit),
            Rounded(w.final.prior, w.final.prior_std),
            *(Rounded(v, w.final.std) for v in w.values),
            Fixed(w.moved, "+.2f"),
            SETTLED.of(abs(w.moved)).words,
        ]
        for w in found
    ]
    numbers = ("prior", *heads, "last change, std")
    return Table((*columns(("", "unit"), numbers), Column("")), rows)


def convergence_words(found: Sequence[Way]) -> str:
    """In a sentence: whether the last round still moved anything."""
    if not found or len(found[0].values) < 2:
        return ""
    groups: dict[str, list[str]] = {w.words: [] for w in SETTLED.words}
    for way in found:
        groups[SETTLED.of(abs(way.moved)).words].append(way.symbol)
    first = SETTLED.words[0].words
    others = [f"{word}: {', '.join(n)}" for word, n in groups.items() if n and word != first]
    if not others:
        return "Every coefficient has settled: the last round moved none by half a std."
    return f"{len(groups[first])} of {len(found)} coefficients have settled; {'; '.join(others)}."
