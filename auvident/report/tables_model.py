"""Tables of an identified model: what the maneuvers show of it, its coefficients, its passes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from auvident.report.numbers import TERMINAL, Style
from auvident.report.tables import (
    Cell,
    Column,
    Fixed,
    Joined,
    Number,
    Rows,
    Table,
    Unit,
    WithStd,
    columns,
)
from auvident.schema.artifacts import (
    Combination,
    IdentifiedModel,
    ModelCoefficient,
    ModelConstant,
    StageRecord,
)
from auvident.schema.coefficients import ESTIMATED
from auvident.schema.effect_words import nuisance_parameters

# share of a coefficient's certainty that came from the data: from, name
SIGHT = (
    (0.8, "well identified"),
    (0.3, "partly identified"),
    (-1.0, "value from the prior"),
)
SIGHT_WORDS = "; ".join(
    f"from {100.0 * below:.0f} %: {name}" if below > 0.0 else f"below: {name}"
    for below, name in SIGHT
)
NEVER, HARDLY = "not identifiable", "hardly identifiable"
MOST_SHARES = 5  # coefficients named of a combination; the artifact has all of them
NO_INFORMATION = 1.0e-6  # beside the prior's: zero but for rounding
WRONG_SIGN = " !"


def sight(model: IdentifiedModel) -> Table:
    """What the maneuvers can and cannot show of the coefficients, before any value is shown."""
    rows, least = [], 1.1
    for below, name in SIGHT:
        found = [
            c.symbol
            for c in model.estimates
            if c.origin in ("identified", "kinematic") and below <= c.data_share < least
        ]
        least = below
        rows.append([name, ", ".join(found) or "none"])
    structural = [c.meaning.split(":")[0] for c in model.unidentifiable if c.structural]
    rows += [[NEVER, f"from any trial: {meaning}"] for meaning in dict.fromkeys(structural)]
    weak = [combination(c, TERMINAL) for c in model.unidentifiable if not c.structural]
    rows += [[HARDLY, f"from these maneuvers: {text}"] for text in weak]
    caption = "`auvident plan-trial RUN` ranks the maneuvers that would show more."
    return Table(columns(("", "")), rows, "What these maneuvers show of the coefficients", caption)


def combination(found: Combination, style: Style) -> str:
    """A sum of coefficients, largest share first, in prior standard deviations."""
    shares = list(zip(found.symbols, found.weights, strict=True))
    moves = [s if w == 1.0 else f"{style.number(w, 2)} {s}" for s, w in shares[:MOST_SHARES]]
    more = f" and {len(shares) - MOST_SHARES} more" if len(shares) > MOST_SHARES else ""
    return " + ".join(moves).replace(f"+ {style.minus}", f"{style.minus} ") + more


def combinations(model: IdentifiedModel) -> Table:
    """Directions that the data do not show, what each means, and how much the data hold of it."""
    rows: Rows = [
        [
            _Combination(c),
            c.meaning or "set by the prior",
            "none" if c.information < NO_INFORMATION else Number(c.information, 2),
        ]
        for c in model.unidentifiable
    ]
    heads = columns(("combination of coefficients", "meaning"), ("information, data ÷ prior",))
    return Table(heads, rows)


@dataclass(frozen=True)
class _Combination:
    """The sum as a cell."""

    found: Combination

    def text(self, style: Style) -> str:
        """The sum in a style."""
        return combination(self.found, style)


def coefficients(model: IdentifiedModel) -> Table:
    """Coefficients before and after the data."""
    heads = (
        *columns(("",)),
        Column("meaning", on_page=True),
        Column("unit"),
        *columns(numbers=("identified, ± std", "prior, ± std")),
        Column("1000 × prime", numeric=True, on_page=True),
        Column("from data", numeric=True),
        Column("data against prior, std", numeric=True),
        Column("origin"),
    )
    told = model.prior_against_data
    away = {row.symbol: row.away for row in told.coefficients} if told else {}
    rows = [_coefficient(c, away.get(c.symbol)) for c in model.estimates]
    title = f"{model.vehicle}, {model.plane} plane ({model.filter}, {model.engine})"
    notes = [nuisance_parameters(model.effects)]
    if any(_has_wrong_sign(c) for c in model.estimates):
        notes.append("! marks a sign opposite to that expected of a streamlined hull.")
    return Table(heads, rows, title, " ".join(note for note in notes if note))


def _coefficient(c: ModelConstant, away: float | None) -> list[Cell]:
    declared = ESTIMATED[c.symbol]
    return [
        c.symbol,
        f"{declared.meaning} ({declared.regressor})",
        Unit(c.unit),
        WithStd(c.value, c.std, WRONG_SIGN * _has_wrong_sign(c)),
        WithStd(c.prior, c.prior_std),
        Number(1000.0 * c.prime, 4) if isinstance(c, ModelCoefficient) else "",
        Fixed(100.0 * c.data_share, ".0f", " %"),
        Fixed(away, "+.1f"),
        f"{c.origin}, both planes" if c.shared_with else c.origin,
    ]


def _has_wrong_sign(c: ModelConstant) -> bool:
    return c.value * ESTIMATED[c.symbol].sign < 0.0


def correlated(correlations: Mapping[str, Mapping[str, float]], least: float) -> Table:
    """Pairs of coefficients that are strongly correlated, the strongest first."""
    found = {
        (min(a, b), max(a, b)): value
        for a, row in correlations.items()
        for b, value in row.items()
        if abs(value) >= least
    }
    pairs = sorted(found.items(), key=lambda pair: -abs(pair[1]))
    rows: Rows = [[f"{a}, {b}", Fixed(value, "+.2f")] for (a, b), value in pairs]
    return Table(columns(("pair",), ("correlation",)), rows)


def passes(model: IdentifiedModel) -> Table:
    """The passes of the plan as they were done."""
    channels = list(dict.fromkeys(c for s in model.stages for c in (*s.nis_mean, *s.fitted_noise)))
    heads = columns(
        ("cycle", "stage", "system"),
        (
            "free",
            "maneuvers",
            "samples",
            "log-likelihood",
            *(f"noise {c}" for c in channels),
            *(f"NIS {c}" for c in channels),
        ),
    )
    return Table(heads, [_pass(s, channels) for s in model.stages])


def _pass(s: StageRecord, channels: Sequence[str]) -> list[Cell]:
    counts = (str(len(s.free)), str(len(s.maneuvers)), str(s.samples))
    noise = (_noise(s, c) for c in channels)
    nis = (Number(s.nis_mean[c], 2) if c in s.nis_mean else "" for c in channels)
    return [str(s.cycle), s.stage, s.system, *counts, Number(s.log_likelihood, 5), *noise, *nis]


def _noise(record: StageRecord, column: str) -> Cell:
    """Noise of a channel in a pass; of a fit that of the sensor and that of the disturbance."""
    fitted = record.fitted_noise.get(column)
    if fitted is not None:
        if fitted.slow_std == 0.0:
            return Number(fitted.white_std, 2)
        slow = Joined(
            (Number(fitted.slow_std, 2), Number(fitted.slow_time_s, 2, behind=" s")), " over "
        )
        return Joined((Number(fitted.white_std, 2), slow))
    return Number(record.noise_std.get(column), 2) if column in record.nis_mean else ""
