"""The sentences of the HTML report: the verdict, how far to trust it, what cannot be told."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from auvident.constants import NOT_BETTER
from auvident.report.html_data import (
    DYNAMIC,
    ReportData,
    gain,
    number,
    percent,
    quantity,
)
from auvident.report.numbers import PAGE
from auvident.report.tables_run import combination as combination_text
from auvident.schema.artifacts import (
    ON_ERRORS,
    PRIOR_WORDS,
    ChannelMetrics,
    Combination,
    Finding,
)
from auvident.schema.diagnosis import ChannelError

# Pooled NRMSE of the worst of the velocities and rates -> word, CSS class.
GRADES = (
    (0.1, "closely", "good"),
    (0.3, "usably", "fair"),
    (1.0, "poorly", "poor"),
)
WORSE_THAN_CONSTANT = ("worse than its own mean would", "poor")
STRONG_CORRELATION = 0.8
NO_INFORMATION = 1.0e-6  # beside the prior's: zero but for rounding
SERIOUS = {
    "prediction-ran-away",
    "nothing_held_out",
    "wrong-sign",
    "not-predicted",
    "no-better",
    "log_refused",
    "rudder_sign_unverified",
    "never_under_way",
    "no_record",
    "rudder_never_moves",
    "channel_unusable",
}
NOTES = {
    "channels_absent",
    "file_not_used",
    "assumed_section",
    "assumed_propulsion_factor",
    "input_logged_on_change",
    "coarse_time",
    "jitter",
    "own_outputs_left_out",
}
RANKS = ("serious", "caution", "note")


@dataclass(frozen=True)
class Warning_:
    """A finding as the report shows it: how grave, from which stage."""

    rank: str
    stage: str
    finding: Finding


def verdict(data: ReportData) -> tuple[str, str]:
    """The report in one sentence, and its CSS class."""
    metrics = data.metrics
    if metrics is None or data.model is None:
        return "No model has been identified and validated yet; what follows is the input.", "none"
    if not metrics.summary:
        return "The model's predictions leave every bound: it predicts nothing.", "poor"
    role = data.role
    pooled = {k: m for k, m in data.final_errors().items() if k in DYNAMIC}
    if not pooled:
        return "No channel was measured to compare the predictions with.", "none"
    word, grade = _grade(max(m.nrmse for m in pooled.values()))
    count = sum(m.role == role for m in metrics.maneuvers)
    which = "held-out maneuver" if role == "validate" else "maneuver that identified the model"
    which = _plural(which, count)
    errors = ", ".join(
        f"{k} {quantity(m.rmse, m.unit, 2)} ({percent(m.nrmse)})" for k, m in pooled.items()
    )
    text = (
        f"{_which_model(data)} predicts {count} {which} {word}: RMSE {errors} of the measured "
        "standard deviation)"
    ).replace("%) of", "% of")
    text += _gain_words(data, role, pooled)
    if role == "identify":
        return text + " No maneuver was held out, so this says little about others.", "poor"
    return text, grade


def _which_model(data: ReportData) -> str:
    if data.comparison is None or not data.is_refined:
        return "The model"
    added = " and ".join(
        e.plain or e.id for e in (*data.comparison.effects, *data.comparison.not_confirmed)
    )
    return f"The final model, refined with {added}," if added else "The final, refined model"


def _plural(which: str, count: int) -> str:
    return which if count == 1 else which.replace("maneuver", "maneuvers", 1)


def _grade(worst: float) -> tuple[str, str]:
    for limit, word, grade in GRADES:
        if worst <= limit:
            return word, grade
    return WORSE_THAN_CONSTANT


def _gain_words(data: ReportData, role: str, pooled: dict[str, ChannelError]) -> str:
    before = data.pooled_before(role)
    ratios = {k: g for k, m in pooled.items() if (g := gain(before.get(k), m)) is not None}
    if not ratios:
        return "."
    factors = ", ".join(f"{k} {number(g, 2)}" for k, g in ratios.items())
    what = PRIOR_WORDS[data.prior_name]
    return f". Squared errors of {what} are larger by the factors {factors}."


def cards(data: ReportData) -> list[dict[str, Any]]:
    """Pooled error of each channel with that of the estimate from geometry and the gain."""
    if data.metrics is None:
        return []
    prior, identified = data.pooled_before(data.role), data.identified_errors()
    found = []
    for name, m in data.final_errors().items():
        b, ratio, by_effects = prior.get(name), gain(prior.get(name), m), None
        if data.is_refined:
            by_effects = gain(identified[name], m)
        found.append(
            {
                "name": name,
                "rmse": quantity(m.rmse, m.unit),
                "nrmse": percent(m.nrmse),
                "r2": number(1.0 - m.nrmse**2),
                "grade": _grade(m.nrmse)[1],
                "identified": _error(identified[name]),
                "by_effects": _factor(by_effects),
                "worse_by_effects": by_effects is not None and by_effects < NOT_BETTER,
                "before": _error(b),
                "gain": _factor(ratio),
                "worse": ratio is not None and ratio <= NOT_BETTER,
            }
        )
    return found


def _error(e: ChannelMetrics | ChannelError | None) -> str:
    return f"{quantity(e.rmse, e.unit)}, {percent(e.nrmse)}" if e else "–"


def _factor(ratio: float | None) -> str:
    return "–" if ratio is None else number(ratio, 2)


def warnings(data: ReportData) -> list[Warning_]:
    """Every finding of every stage, the gravest first."""
    found: list[tuple[str, Finding]] = []
    if data.metrics:
        # what `refine` says of the errors of the final model takes the place of this
        found += [
            ("validate", f)
            for f in data.metrics.findings
            if not (data.is_refined and f.code in ON_ERRORS)
        ]
    if data.model:
        found += [("identify", f) for f in data.model.findings]
    for stage, artifact in (("diagnose", data.diagnosis), ("refine", data.comparison)):
        found += [(stage, f) for f in artifact.findings] if artifact else []
    if data.maneuvers:
        # the other plane may lack a held-out maneuver; the report is about one plane
        found += [
            ("segment", f)
            for f in data.maneuvers.findings
            if f.code != "nothing_held_out" or not data.held_out()
        ]
    if data.quality:
        found += [("ingest", f) for f in data.quality.findings]
        found += [
            ("ingest", f.model_copy(update={"where": _at(t.trial, f.where)}))
            for t in data.quality.trials
            for f in t.findings
        ]
    if data.ase:
        found += [("ase", f) for f in data.ase.findings]
    ranked = [Warning_(_rank(f.code), stage, f) for stage, f in _merged(found)]
    return sorted(ranked, key=lambda w: RANKS.index(w.rank))


def _at(trial: str, where: str) -> str:
    return where if trial in where or not trial else f"{trial}, {where}" if where else trial


def _merged(found: Sequence[tuple[str, Finding]]) -> list[tuple[str, Finding]]:
    """The same message at several places, or handed on by another stage, said once."""
    groups: dict[tuple[str, str], list[tuple[str, Finding]]] = {}
    for stage, f in found:
        groups.setdefault((f.code, f.message), []).append((stage, f))
    return [(same[0][0], _as_one([f for _, f in same])) for same in groups.values()]


def _as_one(same: Sequence[Finding]) -> Finding:
    """One finding with all places; without a value where they differ in it."""
    where = "; ".join(dict.fromkeys(f.where for f in same if f.where))
    value = same[0].value if len({f.value for f in same}) == 1 else None
    return same[0].model_copy(update={"where": where, "value": value})


def _rank(code: str) -> str:
    return "serious" if code in SERIOUS else "note" if code in NOTES else "caution"


def combination(c: Combination) -> tuple[str, str]:
    """A direction that the data cannot see: its coefficients, and what that means."""
    text = combination_text(c, PAGE)
    meaning = c.meaning or (
        "moved together by so many prior standard deviations they can stand in for each other"
        if len(c.symbols) > 1
        else "rests on its prior"
    )
    if c.information < NO_INFORMATION:
        return text, meaning
    return text, f"{meaning} (the data hold {number(c.information, 2)} of the prior's information)"


def pairs(correlations: dict[str, dict[str, float]]) -> list[tuple[str, str, float]]:
    """Pairs of coefficients that are strongly correlated, the strongest first."""
    seen = {
        (min(a, b), max(a, b)): value
        for a, row in correlations.items()
        for b, value in row.items()
        if abs(value) >= STRONG_CORRELATION
    }
    return [(a, b, v) for (a, b), v in sorted(seen.items(), key=lambda x: -abs(x[1]))]
