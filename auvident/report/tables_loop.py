"""Tables of the residual loop, from its artifacts; for the terminal and for the page."""

import math
from collections.abc import Mapping, Sequence

from auvident.constants import NORMAL_95
from auvident.report import loop_words as words
from auvident.report.tables import (
    Cell,
    Column,
    Fixed,
    Interval,
    Joined,
    Nrmse,
    Number,
    Rmse,
    Rounded,
    Rows,
    Table,
    Unit,
    WithStd,
    Words,
    change,
    columns,
)
from auvident.schema.artifacts import CrossValidation
from auvident.schema.diagnosis import (
    Attempt,
    Candidate,
    CoefficientComparison,
    Comparison,
    CrossValidated,
    Diagnosis,
    Difference,
    EffectFound,
    HeldOut,
    ManeuverComparison,
    ParameterValue,
)
from auvident.schema.effects import in_plane, parameter_of


def effects(found: Sequence[EffectFound]) -> Table:
    """Effects in plain words, each parameter with its 95 % interval."""
    rows: list[list[Cell]] = []
    for effect in found:
        first = [effect.id, " ".join(x for x in (effect.plain, words.place(effect)) if x)]
        for p in effect.parameters:
            bounds = Words(words.interval_of(effect.id, p))
            rows.append([*first, p.symbol, Unit(p.unit), _value(p), bounds])
            first = ["", ""]
        if not effect.parameters:
            rows.append([*first, "", "", "", ""])
    heads = columns(("effect", "in words", "parameter", "unit"), ("value", "95 % interval"))
    return Table(heads, rows)


def adjusted(found: Sequence[EffectFound]) -> Table:
    """What is adjusted along with every effect; a limit that may as well be none by its least."""
    rows: list[list[Cell]] = []
    for effect in found:
        first = effect.id
        for p in effect.parameters:
            std = p.std or 0.0
            low, high = parameter_of(f"{effect.id}.{p.symbol}").reaches(p.value, NORMAL_95 * std)
            bounds = Interval(low, high) if std and high is not None else ""
            value: Cell = Rounded(p.value, std)
            if high is None:
                value = Joined((Words(words.SIDES["at least"]), Number(low, 2)), " ")
            rows.append([first, p.symbol, Unit(p.unit), value, bounds])
            first = ""
    return Table(columns(("effect", "parameter", "unit"), ("value", "95 % interval")), rows)


def _value(p: ParameterValue) -> Cell:
    """The value of a parameter, with its side where it is known to one only."""
    value = Rounded(p.value, words.std_of(p))
    return Joined((Words(words.SIDES[p.bound]), value), " ") if p.bound else value


def held_out(found: HeldOut) -> Table:
    """Pooled errors of what was held out, before and after, with the interval of the difference."""
    rows: list[list[Cell]] = []
    for channel, before in found.before.items():
        after, unit = found.after.get(channel), before.unit
        rows.append(
            [
                channel,
                Unit(unit, True),
                Rmse(before),
                Rmse(after),
                *_difference(found.difference.get(channel), unit),
                Nrmse(channel, before),
                Nrmse(channel, after, before),
                Fixed(_percent(before.rmse, after.rmse if after else None), "+.0f", " %"),
            ]
        )
    heads = (
        "RMSE without",
        "RMSE with",
        "difference",
        "95 % interval",
        "NRMSE without",
        "NRMSE with",
    )
    return Table(
        (*columns(("channel", "unit"), heads), Column("change of RMSE", "", True, on_page=True)),
        rows,
        "Prediction of the held-out maneuvers without and with the effects",
    )


def _percent(before: float, after: float | None) -> float | None:
    return 100.0 * (after / before - 1.0) if after is not None and before > 0.0 else None


def _difference(found: Difference | None, unit: str) -> tuple[Cell, Cell]:
    if found is None:
        return Number(None), Number(None)
    return Number(found.value, 2, unit), Interval(found.low, found.high, unit)


def maneuvers(found: Sequence[ManeuverComparison], kinds: Mapping[str, str] | None = None) -> Table:
    """Errors of every maneuver, before → after; a star where the difference is no chance.

    Parameters
    ----------
    found : sequence of ManeuverComparison
    kinds : mapping, optional
        What each is called, see `tables_run.kinds_of`.
    """
    units = {name: e.unit for m in found for name, e in m.before.items()}
    rows = [
        [m.id, (kinds or {}).get(m.id, m.kind), m.role, *(_change(m, name) for name in units)]
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
            WithStd(c.prior, c.prior_std),
            WithStd(c.before, c.before_std),
            WithStd(c.after, c.after_std),
            Fixed(words.moves(c), "+.1f"),
        ]
        for c in found
    ]
    heads = columns(("", "unit"), ("prior", "without", "with", "moved, std"))
    return Table(heads, rows, title)


def moved(found: Sequence[CoefficientComparison]) -> Table:
    """Those that the added effects moved."""
    title = f"Coefficients that moved by more than {words.MOVED:g} standard deviations"
    return coefficients(words.moved(found), title)


def candidates(found: Sequence[Candidate], caption: str = "") -> Table:
    """Candidates in their order; accepted ones are marked."""
    later = any(c.beside for c in found)
    known = any(p.interval for c in found for p in c.parameters)
    rows: Rows = [
        [
            "accepted" if not c.rejected else "",
            c.id,
            Words(words.sizes(c.id, c.parameters)),
            c.rejected,
            *([Words(", ".join(c.beside))] if later else ()),
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
        *columns(
            (
                "size, 95 % interval" if known else "size",
                "rejected because",
                *(["beside"] if later else ()),
            ),
            ("gain, nats", "p"),
        ),
        Column("left out, nats", numeric=True),
        Column("improved", numeric=True, on_page=True),
    )
    title = "Candidate effects, by their gain in log-likelihood"
    return Table(heads, rows, title, caption, mark="accepted")


def attempts(found: Comparison) -> Table:
    """Models that were tried, and their errors over those of the identified one."""
    tried = found.attempts[1:]
    fitted = list(dict.fromkeys(c for a in tried for c in a.ratios))
    crossed = list(dict.fromkeys(c for a in tried for c in a.left_out))
    decided = any(a.balance is not None for a in tried)
    cells: Rows = [
        [
            *words.attempt_words(a),
            *([_together(a)] if decided else ()),
            *(_left_out_ratio(a, c) for c in crossed),
            *(Number(a.ratios.get(c)) for c in fitted),
        ]
        for a in tried
    ]
    heads = ["left-out errors of all, with ÷ without"] if decided else []
    heads += [f"left-out RMSE of {c}, with ÷ without" for c in crossed]
    heads += [f"RMSE of {c}, with ÷ without" for c in fitted]
    return Table(columns(("model with", ""), heads), cells)


def _together(attempt: Attempt) -> Cell:
    """Ratio of the left-out errors, mean over maneuvers and channels, with its standard error."""
    if attempt.balance is None:
        return Number(None)
    ratio = math.exp(attempt.balance)
    return WithStd(ratio, ratio * (attempt.balance_se or 0.0))


def _left_out_ratio(attempt: Attempt, channel: str) -> Cell:
    """Ratio of the errors of maneuvers left out in turn, with its standard error."""
    ratio = attempt.left_out.get(channel)
    if ratio is None:
        return Number(None)
    return WithStd(ratio, ratio * attempt.left_out_se.get(channel, 0.0))


CROSSED = "Identifying maneuvers, each left out in turn, without and with the effects"


def cross_validated(found: CrossValidated, title: str = CROSSED) -> Table:
    """Left-out errors of two models, with their standard errors over maneuvers."""
    rows: Rows = [
        [
            channel,
            Unit(before.unit, True),
            *(_error(row) for row in (before, after)),
            Nrmse(channel, before),
            Nrmse(channel, after, before),
            Fixed(_percent(before.rmse, after.rmse if after else None), "+.0f", " %"),
        ]
        for channel, before in found.before.items()
        for after in [found.after.get(channel)]
    ]
    heads = ("RMSE without, ± se", "RMSE with, ± se", "NRMSE without", "NRMSE with")
    change = Column("change of RMSE", "", True, on_page=True)
    return Table((*columns(("channel", "unit"), heads), change), rows, title)


def _error(row: CrossValidation | None) -> Cell:
    """An error with its standard error."""
    return Number(None) if row is None else WithStd(row.rmse, row.se, unit=row.unit)


def residuals(found: Diagnosis) -> Table:
    """Residual of every channel against the noise of its sensor."""
    rows: list[list[Cell]] = []
    for r in words.pooled(found.residuals):
        sizes = (Number(r.rms, 3, r.unit), Number(r.noise_std, 3, r.unit), Number(r.ratio))
        after = [Number(r.rms_after, 3, r.unit)] if found.effects else []
        time = Number(r.correlation_time_s, 2)
        rows.append([r.channel, Unit(r.unit, True), *sizes, *after, time])
    added = ["with the effects"] if found.effects else []
    heads = ("residual, rms", "sensor noise", "ratio", *added, "correlation time, s")
    return Table(
        columns(("channel", "unit"), heads),
        rows,
        "Residual of the fit of the diagnosis, without effects",
    )


def _untested(found: Diagnosis, column: str) -> str:
    """Effects that need a column which is not in the log."""
    seen = {row.id for row in found.sees}
    lacking = [e.id for e in in_plane(found.plane) if column in e.needs and e.id not in seen]
    return f"{', '.join(lacking)}: {column} is not in the log" if lacking else column


NOT_SHOWN, ALIKE, NOT_TESTED = "not shown", "look alike", "not tested"
SIGHT_TITLE = "Effects that these maneuvers would and would not show"


def sight(found: Diagnosis) -> Table:
    """What the maneuvers can and cannot show, before any verdict; sizes are the smallest."""
    seen = words.visible_by_family(found.sees).items()
    rows: list[list[Cell]] = [[family, Words(", ".join(names))] for family, names in seen]
    named = {e.id for e in found.effects}  # whatever could be expected of them, they have shown
    unseen = [row for row in found.sees if row.id not in named]
    for why, names in words.blind_by_reason(unseen).items():
        rows.append([NOT_SHOWN, f"{', '.join(names)}: {why}"])
    for same in words.alike(found.lookalikes):
        remedy = f"; separated by {same.separate_by}" if same.separate_by else ""
        text = f"{', '.join(same.ids)} (correlation {same.cosine:.3f}){remedy}"
        rows.append([ALIKE, text])
    rows += [[NOT_TESTED, _untested(found, column)] for column in found.missing]
    return Table(columns(("", "")), rows, SIGHT_TITLE)
