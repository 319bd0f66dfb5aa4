"""The sentences of the HTML report: the verdict, how far to trust it, what cannot be told."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from auvident.constants import NOT_BETTER
from auvident.report import check_words
from auvident.report.html_data import (
    DYNAMIC,
    ReportData,
    gain,
    number,
    percent,
    quantity,
)
from auvident.report.loop_words import unexplained_lines
from auvident.report.tables_model import SIGHT
from auvident.schema.artifacts import (
    ESTIMATE_CONTRADICTED,
    ON_A_MODEL,
    PRIOR_WORDS,
    ChannelMetrics,
    Finding,
)
from auvident.schema.diagnosis import ChannelError
from auvident.schema.effects import DEGREES

# Pooled NRMSE of the worst of the velocities and rates -> word, CSS class.
GRADES = (
    (0.1, "well", "good"),
    (0.3, "fairly well", "fair"),
    (1.0, "poorly", "poor"),
)
WORSE_THAN_CONSTANT = ("worse than their mean would", "poor")
# what a model was identified from: column, words, unit, factor to it
RANGES = (
    ("u_mps_measured", "speed", "m/s", 1.0),
    ("control_rad", "control angle", "deg", DEGREES),
    ("r_radps_measured", "yaw rate", "deg/s", DEGREES),
    ("q_radps_measured", "pitch rate", "deg/s", DEGREES),
    ("rpm", "propeller", "rpm", 1.0),
)
SPAN = (0.01, 0.99)  # quantiles, so that no single noisy sample widens the range
PARTLY = SIGHT[1][0]  # share of the certainty from which on a coefficient counts as identified
MOST_NAMED = 4  # coefficients that a further maneuver would show
STRONG_CORRELATION = 0.8
SERIOUS = {
    ESTIMATE_CONTRADICTED,
    "advance_ratio",
    "dvl_axes",
    "gyro_axes",
    "heading_gyro_gain",
    "heave_sign",
    "pitch_rate_scale",
    "pitch_sign",
    "rpm_constant",
    "rpm_scale",
    "rpm_sign",
    "rudder_cut",
    "rudder_scale",
    "rudder_stuck",
    "rudder_unit",
    "speed_by_drift",
    "speed_position_ratio",
    "speed_scale",
    "surge_sign",
    "sway_by_position",
    "sway_sign",
    "yaw_rate_unit",
    "channel-ignored",
    "prediction-ran-away",
    "nothing_held_out",
    "wrong-sign",
    "not-predicted",
    "no-better",
    "log_refused",
    "trials_overlap",
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
    """How well the model predicts, in one sentence, and its CSS class."""
    metrics = data.metrics
    if metrics is None or data.model is None:
        return "No model has been identified and validated yet; what follows is the input.", "none"
    if not metrics.summary:
        return "Every prediction of the model diverges: it predicts nothing.", "poor"
    role = data.role
    pooled = {k: m for k, m in data.final_errors().items() if k in DYNAMIC}
    if not pooled:
        return "No channel was measured to compare the predictions with.", "none"
    word, grade = _grade(max(m.nrmse for m in pooled.values()))
    count = sum(m.role == role for m in metrics.maneuvers)
    which = "held-out maneuver" if role == "validate" else "maneuver used for identification"
    which = _plural(which, count)
    errors = ", ".join(
        f"{k} {quantity(m.rmse, m.unit, 2)} ({percent(m.nrmse)})" for k, m in pooled.items()
    )
    text = f"{_which_model(data)} predicts {count} {which} {word}: RMSE {errors}"
    text += _gain_words(data, role, pooled)
    if role == "identify":
        return text + " No maneuver was held out, so this says little about others.", "poor"
    return text, grade


def _which_model(data: ReportData) -> str:
    if data.comparison is None or not data.is_refined:
        return "The identified model"
    added = " and ".join(
        e.plain or e.id for e in (*data.comparison.effects, *data.comparison.not_confirmed)
    )
    return f"The final model, with {added}," if added else "The final, refined model"


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
    factors = ", ".join(f"{number(g, 2)} ({k})" for k, g in ratios.items())
    return f". The errors with {PRIOR_WORDS[data.prior_name]} are larger by factors of {factors}."


def summary(data: ReportData) -> list[tuple[str, str]]:
    """What the report comes to, line by line: a word, and a sentence or two."""
    found = data.comparison or data.diagnosis
    contradicted = _contradicted(data)
    rows = [("Contradicted", contradicted), ("Accuracy", verdict(data)[0])]
    rows.append(("Valid for", _range(data)))
    if found is not None:
        little = " This says little while the log is contradicted." if contradicted else ""
        rows += [("Missing effects", found.statement + little), ("With them", _added(data))]
        rows.append(("Unexplained", _rest(data)))
    rows += [("Coefficients", _identified(data)), ("Untested", _untested(data))]
    rows.append(("Next maneuver", _next(data)))
    return [(word, text) for word, text in rows if text]


def _contradicted(data: ReportData) -> str:
    """What contradicts in the logs, and a model that contradicts its estimate all over."""
    lines = check_words.contradictions(data.quality.trials) if data.quality else []
    model = data.final_model
    led = [f for f in model.findings if f.code == ESTIMATE_CONTRADICTED] if model else []
    return " ".join([*lines, *(f"{f.message[:1].upper()}{f.message[1:]}" for f in led)])


def _untested(data: ReportData) -> str:
    """What nothing in the logs tests."""
    text = check_words.untested(data.quality.trials) if data.quality else ""
    text = text.removeprefix("Untested: ")
    return text[:1].upper() + text[1:]


def _range(data: ReportData) -> str:
    """Speeds, angles and rates of the maneuvers that identified."""
    table = data.simulation
    if table is None:
        return ""
    rows = table[table["role"] == "identify"]
    pieces = []
    for column, words, unit, factor in RANGES:
        if column in rows and rows[column].notna().any():
            low, high = (factor * float(rows[column].quantile(q)) for q in SPAN)
            pieces.append(f"{words} {number(low, 2)} to {number(high, 2)} {unit}")
    if not pieces:
        return ""
    return f"{'; '.join(pieces)} (the range of the maneuvers used for identification)."


def _rest(data: ReportData) -> str:
    """What is left that no effect explains."""
    found = data.comparison or data.diagnosis
    return " ".join(unexplained_lines(found.unexplained)) if found else ""


def _added(data: ReportData) -> str:
    """Held-out errors without and with the effects; empty where nothing was added."""
    found = data.comparison
    if found is None or not found.added:
        return ""
    errors = [
        f"{name} {quantity(before.rmse, before.unit, 2)} → {quantity(after.rmse, after.unit, 2)}"
        for name, before in found.held_out.before.items()
        if (after := found.held_out.after.get(name))
    ]
    worse = [f.where for f in found.findings if f.code == "worse-refined"]
    pieces = [f"held-out RMSE {', '.join(errors)}."] if errors else []
    pieces += [f"Worse than without: {', '.join(worse)}."] if worse else []
    return " ".join(pieces)


def _identified(data: ReportData) -> str:
    """How many coefficients the data determined, and which not."""
    model = data.final_model
    if model is None:
        return ""
    own = [c for c in model.estimates if c.origin in ("identified", "kinematic")]
    rest = [c.symbol for c in own if c.data_share < PARTLY]
    text = f"{len(own) - len(rest)} of {len(own)} determined at least in part by these data"
    return f"{text}; values from the prior: {', '.join(rest)}." if rest else f"{text}."


def _next(data: ReportData) -> str:
    """The maneuver that would add most, and what would separate effects that look alike."""
    found = data.comparison or data.diagnosis
    text = ""
    if found is not None and found.ambiguous and data.diagnosis:
        text = f"To tell the effects apart: {data.diagnosis.separate_by}. "
    if data.plan is None or not data.plan.candidates:
        return text.strip()
    best = data.plan.candidates[0]
    named = ", ".join(list(best.shrinks)[:MOST_NAMED])
    helps = f"; it would add most about {named}" if named else ""
    return f"{text}{best.name[0].upper()}{best.name[1:]} ({best.what}){helps}."


def cards(data: ReportData) -> list[dict[str, Any]]:
    """Pooled error of each channel with those of the identified model and of the prior."""
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


def coverage(data: ReportData) -> str:
    """How much of what was held out the band holds; empty where there is no band."""
    found = data.metrics.coverage if data.metrics else {}
    if data.is_refined and data.comparison and data.comparison.coverage:
        found = data.comparison.coverage
    if not found:
        return ""
    nominal = percent(next(iter(found.values())).nominal)
    shares = [
        f"{name} {percent(c.covered)} (mean width {quantity(c.width, c.unit)})"
        for name, c in found.items()
    ]
    return (
        f"The {nominal} band is made from the errors of the identifying maneuvers, each left out "
        f"in turn. It holds these shares of the held-out samples: {', '.join(shares)}."
    )


def _error(e: ChannelMetrics | ChannelError | None) -> str:
    return f"{quantity(e.rmse, e.unit)}, {percent(e.nrmse)}" if e else "–"


def _factor(ratio: float | None) -> str:
    """A ratio of errors in words."""
    if ratio is None or ratio <= 0.0:
        return "–"
    if ratio >= NOT_BETTER:
        return f"{number(ratio, 2)} times smaller"
    return f"{number(1.0 / ratio, 2)} times larger"


def warnings(data: ReportData) -> list[Warning_]:
    """Every finding of every stage, the gravest first."""
    found: list[tuple[str, Finding]] = []
    if data.metrics:
        # what `refine` says of the final model takes the place of this
        found += [
            ("validate", f)
            for f in data.metrics.findings
            if not (data.is_refined and f.code in ON_A_MODEL)
        ]
    if data.final_model:
        found += [("identify", f) for f in data.final_model.findings]
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
    return ranked(found)


def ranked(found: Sequence[tuple[str, Finding]]) -> list[Warning_]:
    """Findings of stages, the gravest first."""
    told = [Warning_(_rank(f.code), stage, f) for stage, f in _merged(found)]
    return sorted(told, key=lambda w: RANKS.index(w.rank))


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
