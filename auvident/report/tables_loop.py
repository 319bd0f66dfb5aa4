"""Tables of the residual loop, from its artifacts; for the terminal and for the page."""

from collections.abc import Sequence

from auvident.report import loop_words as words
from auvident.report.tables import (
    Cell,
    Column,
    Fixed,
    Number,
    Rows,
    Table,
    Unit,
    Words,
    change,
    columns,
    interval,
    with_std,
)
from auvident.schema.diagnosis import (
    Candidate,
    CoefficientComparison,
    Comparison,
    Diagnosis,
    Difference,
    EffectFound,
    HeldOut,
    ManeuverComparison,
)


def effects(found: Sequence[EffectFound]) -> Table:
    """Effects in plain words, each parameter with its 95 % interval."""
    rows: list[list[Cell]] = []
    for effect in found:
        first = [effect.id, " ".join(x for x in (effect.plain, words.place(effect)) if x)]
        for p in effect.parameters:
            bounds = Words(words.interval_of(effect.id, p))
            rows.append([*first, p.symbol, Unit(p.unit), Number(p.value), bounds])
            first = ["", ""]
        if not effect.parameters:
            rows.append([*first, "", "", "", ""])
    heads = columns(("effect", "in words", "parameter", "unit"), ("value", "95 % interval"))
    return Table(heads, rows)


def held_out(found: HeldOut) -> Table:
    """Pooled errors of what was held out, before and after, with the interval of the difference."""
    rows: list[list[Cell]] = []
    for channel, before in found.before.items():
        after, unit = found.after.get(channel), before.unit
        rmse, nrmse = (after.rmse, after.nrmse) if after else (None, None)
        better = (before.rmse / rmse) ** 2 if rmse else None
        rows.append(
            [
                channel,
                Unit(unit, True),
                Number(before.rmse, 3, unit),
                Number(rmse, 3, unit),
                *_difference(found.difference.get(channel), unit),
                Number(before.nrmse),
                Number(nrmse),
                Number(better, 2),
            ]
        )
    heads = (
        "RMSE before",
        "RMSE after",
        "difference",
        "95 % interval",
        "NRMSE before",
        "NRMSE after",
    )
    return Table(
        (*columns(("channel", "unit"), heads), Column("squared error ÷", "", True, on_page=True)),
        rows,
        "Prediction of the held-out maneuvers, before and after",
    )


def _difference(found: Difference | None, unit: str) -> tuple[Cell, Cell]:
    if found is None:
        return Number(None), Number(None)
    return Number(found.value, 2, unit), interval(found.low, found.high, unit)


def maneuvers(found: Sequence[ManeuverComparison]) -> Table:
    """Errors of every maneuver, before → after; a star where the difference is no chance."""
    units = {name: e.unit for m in found for name, e in m.before.items()}
    rows = [
        [m.id, m.kind, m.role, *(_change(m, name) for name in units)]
        for m in sorted(found, key=lambda m: m.role != "validate")
    ]
    channels = (Column(name, unit, numeric=True) for name, unit in units.items())
    return Table((*columns(("maneuver", "kind", "role")), *channels), rows, mark="validate")


def _change(m: ManeuverComparison, channel: str) -> Cell:
    """Error before and after; sure where the interval of the difference excludes zero."""
    before, after = m.before.get(channel), m.after.get(channel)
    if before is None or after is None:
        return Number(None)
    difference = m.difference.get(channel)
    sure = difference is not None and difference.low * difference.high > 0.0
    return change(before.rmse, after.rmse, before.unit, sure)


def coefficients(found: Sequence[CoefficientComparison], title: str = "") -> Table:
    """Coefficients against their prior, before and after, and how far each moved."""
    rows: Rows = [
        [
            c.symbol,
            Unit(c.unit),
            with_std(c.prior, c.prior_std),
            with_std(c.before, c.before_std),
            with_std(c.after, c.after_std),
            Fixed(words.moves(c), "+.1f"),
        ]
        for c in found
    ]
    heads = columns(("", "unit"), ("prior", "before", "after", "moved, std"))
    return Table(heads, rows, title)


def moved(found: Sequence[CoefficientComparison]) -> Table:
    """Those that the added effects moved."""
    title = f"Coefficients that moved by more than {words.MOVED:g} standard deviations"
    return coefficients(words.moved(found), title)


def candidates(found: Sequence[Candidate], caption: str = "") -> Table:
    """Candidates in their order; accepted ones are marked."""
    rows: Rows = [
        [
            "accepted" if not c.rejected else "",
            c.id,
            c.family,
            Words(words.sizes(c.id, c.parameters)),
            c.rejected,
            Number(c.gain),
            Number(c.p, 2),
            Number(c.held_back_gain),
            Fixed(None if c.improved is None else 100.0 * c.improved, ".0f", " %"),
        ]
        for c in found
    ]
    heads = (
        Column(on_page=True),
        Column("effect"),
        Column("family", on_page=True),
        *columns(("size with 95 % interval", "turned down because"), ("gain, nats", "p")),
        Column("gain in maneuvers left out", numeric=True),
        Column("of them helped", numeric=True, on_page=True),
    )
    title = "Effects that were tried, by the likelihood they gain"
    return Table(heads, rows, title, caption, mark="accepted")


def attempts(found: Comparison) -> Table:
    """What was tried in place of the model before, and its errors over those of that."""
    rows = words.attempt_rows(found)
    channels = list(dict.fromkeys(c for _, _, ratios in rows for c in ratios))
    cells: Rows = [
        [effects, became, *(Number(ratios.get(c)) for c in channels)]
        for effects, became, ratios in rows
    ]
    heads = columns(("with", ""), [f"{c}, after ÷ before" for c in channels])
    return Table(heads, cells)


def residuals(found: Diagnosis) -> Table:
    """Residual of every channel against the noise of its sensor."""
    rows: Rows = [
        [
            r.channel,
            Unit(r.unit, True),
            Number(r.rms, 3, r.unit),
            Number(r.noise_std, 3, r.unit),
            Number(r.ratio),
            Number(r.rms_after, 3, r.unit),
            Number(r.correlation_time_s, 2),
        ]
        for r in words.pooled(found.residuals)
    ]
    heads = ("residual, rms", "sensor noise", "ratio", "with the effects", "correlated over, s")
    return Table(columns(("channel", "unit"), heads), rows, "What the model does not explain")


def sees(found: Diagnosis) -> Table:
    """Smallest size of every parameter that these maneuvers would show."""
    rows: Rows = [
        [
            row.family,
            row.id,
            row.symbol,
            Unit(row.unit),
            Number(row.size, 2, before=f"{words.bound(row)} "),
            Fixed(100.0 * row.kept, ".0f", " %"),
        ]
        for row in found.sees
        if row.visible
    ]
    heads = columns(("family", "effect", "parameter", "unit"), ("shows from", "signature left"))
    return Table(heads, rows)


def blind(found: Diagnosis) -> Table:
    """What these maneuvers would not show, by the reason."""
    reasons = words.blind_by_reason(found.sees)
    rows = [[", ".join(names), why] for why, names in reasons.items()]
    return Table(columns(("not seen", "why")), rows)


def lookalikes(found: Diagnosis) -> Table:
    """Effects that look alike in these maneuvers."""
    rows = [[", ".join(s.ids), s.separate_by, f"{s.cosine:.3f}"] for s in found.lookalikes]
    return Table(columns(("these look alike", "what would separate them"), ("cosine",)), rows)
