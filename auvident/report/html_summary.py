"""The box at the top of the report: how good, for what, not for what, what next."""

from collections.abc import Mapping, Sequence

from auvident.report import check_words
from auvident.report import loop_words as words
from auvident.report.html_data import DYNAMIC, ReportData, gain, number, percent, quantity
from auvident.report.html_words import warnings
from auvident.report.loop_words import listed
from auvident.report.numbers import NO_UNIT, PAGE, unit_text
from auvident.report.tables_consistency import not_white
from auvident.report.tables_model import SIGHT
from auvident.report.verdict_rules import BAND, ERROR, GAIN, Word, worst
from auvident.schema.artifacts import (
    ESTIMATE_CONTRADICTED,
    PRIOR_WORDS,
    TrialCandidate,
)
from auvident.schema.coefficients import ESTIMATED, Group
from auvident.schema.diagnosis import (
    ChannelError,
    Comparison,
    CrossValidated,
    Diagnosis,
    EffectFound,
    ParameterValue,
)
from auvident.schema.effect_words import AXES, words_of
from auvident.schema.effects import DEGREES
from auvident.schema.planes import TRACK
from auvident.schema.spin import share

# what a model was identified from: column, words, unit, factor to it
RANGES = (
    ("u_mps_measured", "speed", "m/s", 1.0),
    ("control_rad", "{fin} angle", "deg", DEGREES),
    ("r_radps_measured", "yaw rate", "deg/s", DEGREES),
    ("q_radps_measured", "pitch rate", "deg/s", DEGREES),
    ("rpm", "propeller", "rpm", 1.0),
)
SPAN = (0.01, 0.99)  # quantiles, so that no single noisy sample widens the range
PARTLY = SIGHT[1][0]  # share of the certainty from which on a coefficient counts as identified
MOST_NEXT = 2  # maneuvers to fly
MOST_NAMED = 3  # coefficients that a further maneuver would show
# what a prediction needs the coefficients of a group for
NEEDED_FOR: dict[Group, str] = {
    "surge_inertia": "how quickly the speed follows the thrust",
    "drag": "speed at other thrust",
    "thrust": "speed at other thrust",
    "turning_drag": "loss of speed in maneuvers",
    "inertia": "quick moves of the fin",
    "lift": "drift and damping",
    "cross_flow": "large angles of incidence and tight turns",
    "control": "the effect of the fin",
    "restoring": "trim and depth keeping",
}
NOTHING = "The model lacks nothing"  # beside the words "It lacked"
# ends of the symbols of parameters, which stand beside their unit
UNIT_ENDS = ("mps", "degps", "deg", "s", "m", "n", "nm", "npm", "rad", "rpm", "m2ps2pn")
ASYMMETRY = 0.05  # of an interval about its value, below which one ± tells it
# rank of a finding, one of them, several
COUNTED = (
    ("serious", "serious finding", "serious findings"),
    ("caution", "caution", "cautions"),
)
Lines = list[str]


def summary(data: ReportData) -> list[tuple[str, Lines]]:
    """What the report comes to: a word, and what there is to say in a sentence or two."""
    told = verdict_lines(data)
    rows = [
        ("Contradicted", _contradicted(data)),
        ("Verdict", told),
        ("Use it for", _range(data)),
        ("Not for", _not_for(data)),
        (_lacking(data), _lacked(data)),
        ("What remains", _remains(data)),
        ("Fly next", _next(data)),
    ]
    return [(word, lines) for word, lines in rows if lines]


def grade(data: ReportData) -> str:
    """CSS class of the box: the worst of what the rules say."""
    if _contradicted(data):
        return "poor"
    return _judged(data)[1]


def verdict_lines(data: ReportData) -> Lines:
    """How well the model predicts, beside the estimate from geometry, with its band."""
    return _judged(data)[0]


def _judged(data: ReportData) -> tuple[Lines, str]:
    """The verdict, and its grade."""
    metrics = data.metrics
    if metrics is None or data.model is None:
        text = "No model has been identified and validated yet; what follows is the input."
        return [text], "none"
    if not metrics.summary:
        return ["Every prediction of the model diverges: it predicts nothing."], "poor"
    all_errors = data.final_errors()
    errors = {k: e for k, e in all_errors.items() if k in DYNAMIC}
    if not errors:
        return ["No channel was measured to compare the predictions with."], "none"
    told = {k: e for k, e in all_errors.items() if k != TRACK}  # a position has no usual spread
    shares = {k: share(k, e.rmse, e.nrmse) for k, e in told.items()}
    called = {k: ERROR.of(x) for k, x in shares.items() if x is not None}
    gains, better = _gains(data, {k: e for k, e in told.items() if k in errors or k in called})
    band, trusted = _band(data, told)
    grades = [*(w.grade for w in called.values()), *better, *trusted]
    count = sum(m.role == data.role for m in metrics.maneuvers)
    which = "held-out maneuver" if data.role == "validate" else "maneuver used for identification"
    text = f"{_which_model(data)} predicts {count} {_plural(which, count)}{_called(called)}: "
    text += f"RMSE {_errors(all_errors)}.{gains}"
    if data.role == "identify":
        grades.append("poor")
        text += " No maneuver was held out, so this says little about others."
    return [" ".join(x for x in (text, band) if x)], worst(grades)


def _called(called: Mapping[str, Word]) -> str:
    """`` well``, or by channel where they differ: ``; u and r well, v poorly``."""
    groups: dict[str, list[str]] = {}
    for name, word in called.items():
        groups.setdefault(word.words, []).append(name)
    if len(groups) == 1:
        return f" {next(iter(groups))}"
    return f", {', '.join(f'{listed(names)} {word}' for word, names in groups.items())}"


def _errors(errors: Mapping[str, ChannelError]) -> str:
    return ", ".join(f"{k} {quantity(e.rmse, e.unit, 2)}" for k, e in errors.items())


def _which_model(data: ReportData) -> str:
    if data.comparison is None or not data.is_refined:
        return "The identified model"
    added = " and ".join(
        unit_text(e.plain or e.id)
        for e in (*data.comparison.effects, *data.comparison.not_confirmed)
    )
    return f"The final model, with {added}," if added else "The final, refined model"


def _plural(which: str, count: int) -> str:
    return which if count == 1 else which.replace("maneuver", "maneuvers", 1)


def _gains(data: ReportData, errors: Mapping[str, ChannelError]) -> tuple[str, list[str]]:
    """How many times smaller the errors are than those of the prior, with grades."""
    before = data.pooled_before(data.role)
    ratios = {k: g for k, e in errors.items() if (g := gain(before.get(k), e)) is not None}
    if not ratios:
        return "", []
    factors = ", ".join(f"{number(g, 2)} ({k})" for k, g in ratios.items())
    text = f" With {PRIOR_WORDS[data.prior_name]} they are larger by the factors {factors}"
    doubted = [f"{k} is {w.words}" for k, g in ratios.items() if (w := GAIN.of(g)).grade != "good"]
    text += f": {', '.join(doubted)}" if doubted else ""
    return f"{text}.", [GAIN.of(g).grade for g in ratios.values()]


def _band(data: ReportData, errors: Mapping[str, ChannelError]) -> tuple[str, list[str]]:
    """How much of what was held out the band holds, with grades; channels by what it is called."""
    found = {k: c for k, c in data.coverage.items() if k in errors}
    if not found or data.role == "identify":
        return "", []
    groups: dict[Word, list[str]] = {}
    for name, c in found.items():
        groups.setdefault(BAND.of(c.covered), []).append(name)
    nominal = percent(next(iter(found.values())).nominal)
    spans = [(_span([found[n].covered for n in names]), listed(names)) for names in groups.values()]
    of = ("the samples", *("those" for _ in spans[1:]))
    parts = [
        f"{span} of {samples} of {names}: {w.words}"
        for w, samples, (span, names) in zip(groups, of, spans, strict=True)
    ]
    return f"Its {nominal} band holds {'; '.join(parts)}.", [w.grade for w in groups]


def _span(shares: Sequence[float]) -> str:
    """``93 to 98 %``."""
    low, high = percent(min(shares)), percent(max(shares))
    return low if low == high else f"{low.removesuffix(PAGE.space + '%')} to {high}"


def _contradicted(data: ReportData) -> Lines:
    """What contradicts in the logs, and a model that contradicts its estimate all over."""
    lines = check_words.contradictions(data.quality.trials) if data.quality else []
    model = data.final_model
    led = [f for f in model.findings if f.code == ESTIMATE_CONTRADICTED] if model else []
    return [*lines, *(f"{f.message[:1].upper()}{f.message[1:]}" for f in led)]


def _range(data: ReportData) -> Lines:
    """Speeds, angles and rates of the maneuvers that identified."""
    table = data.simulation
    if table is None:
        return []
    rows = table[table["role"] == "identify"]
    fin = data.fin
    pieces = []
    for column, what, unit, factor in RANGES:
        if column in rows and rows[column].notna().any():
            ends = [number(factor * float(rows[column].quantile(q)), 2) for q in SPAN]
            span = " to ".join(dict.fromkeys(ends))
            pieces.append(f"{what.format(fin=fin)} {span} {unit}")
    return [f"{', '.join(pieces).capitalize()}: what it was identified from."] if pieces else []


def _not_for(data: ReportData) -> Lines:
    """What lies beyond, channels predicted badly, coefficients that rest on the prior."""
    lines = []
    if data.simulation is not None:
        lines.append("Anything beyond that range.")
    lines += _badly(data)
    unknown = ", ".join(_on_prior(data))
    if unknown:
        source = "geometry" if data.prior_name == "ASE" else "the given values"
        lines.append(f"With caution, as known from {source} alone: {unknown}.")
    return [" ".join(lines)] if lines else []


def _badly(data: ReportData) -> Lines:
    """Channels predicted badly; the noise of a sensor alone is no error of the prediction."""
    noise = {r.channel: r.noise_std for r in data.diagnosis.residuals} if data.diagnosis else {}
    groups: dict[str, list[str]] = {}
    for name, e in (data.final_errors() if data.metrics else {}).items():
        told = share(name, e.rmse, e.nrmse)
        called = None if told is None or e.rmse <= noise.get(name, 0.0) else ERROR.of(told)
        if called is not None and called.grade == "poor":
            groups.setdefault(called.words, []).append(name)
    return [f"Predicted {how}: {', '.join(names)}." for how, names in groups.items()]


def _on_prior(data: ReportData) -> Lines:
    """What the coefficients are needed for that these data do not determine."""
    model = data.final_model
    groups: dict[str, list[str]] = {}
    for c in model.estimates if model else ():
        if c.origin in ("identified", "kinematic") and c.data_share < PARTLY:
            groups.setdefault(NEEDED_FOR[ESTIMATED[c.symbol].group], []).append(c.symbol)
    return [f"{what} ({', '.join(symbols)})" for what, symbols in groups.items()]


def _lacking(data: ReportData) -> str:
    """The word beside the effects: of what is in doubt alone it is not said that it lacked it."""
    return "It may lack" if _in_doubt(data.comparison or data.diagnosis) else "It lacked"


def _in_doubt(found: Diagnosis | Comparison | None) -> bool:
    """Whether something was found, and none of it is confirmed."""
    return found is not None and bool(found.not_confirmed) and not found.effects


def _lacked(data: ReportData) -> Lines:
    """Each effect with its size, and what all of them did to the held-out errors."""
    found = data.comparison or data.diagnosis
    if found is None:
        return []
    little = " This says little while the log is contradicted." if _contradicted(data) else ""
    comparison = data.comparison
    effects = (*found.effects, *found.not_confirmed)
    if not effects:
        return [found.statement.replace(NOTHING, "Nothing", 1) + little]
    lines = [_effect(e, found) for e in effects]
    alike = [listed([words_of(e) for e in group]) for group in found.ambiguous]
    lines += [f"These data cannot tell apart {group}." for group in alike]
    changed = _changed(comparison) if comparison and comparison.added else ""
    return [*lines[:-1], " ".join(x for x in (lines[-1], changed + little) if x)]


def _effect(effect: EffectFound, found: Diagnosis | Comparison) -> str:
    """An effect in words, with its sizes and their 95 % uncertainty."""
    listed_there = any(f"({p.symbol} " in effect.plain for p in effect.parameters)
    text = words_of(effect.id) if listed_there else effect.plain or effect.id
    text = PAGE.signs(unit_text(text))
    alone = len(effect.parameters) == 1
    sizes = [told for p in effect.parameters if (told := _size(effect, p, alone))]
    text = f"{text[:1].upper()}{text[1:]}" + (f" ({', '.join(sizes)}; 95\u00a0%)" if sizes else "")
    if effect in found.not_confirmed:
        text += ", not confirmed"
    elif isinstance(found, Comparison) and effect.id in found.outside:
        text += ", shown by the logs of the sensors and not in the model"
    return f"{text}."


def _size(effect: EffectFound, p: ParameterValue, alone: bool) -> str:
    """``north 0.104 ± 0.001 m/s``; the interval where it is open or not symmetric."""
    told = words.interval_text(p)
    if not told:
        return ""
    doubt = words.interval_of(effect.id, p).removeprefix(told)  # ", not confirmed"
    if p.interval is None or None not in p.interval:
        low, high = words.interval(p)
        if abs((high + low) / 2.0 - p.value) < ASYMMETRY * (high - low):
            told = PAGE.with_std(p.value, (high - low) / 2.0)
    unit = "" if p.unit in NO_UNIT else PAGE.written_unit(p.unit)
    name = "" if alone else _named(p.symbol, effect.frame)
    return " ".join(x for x in (name, PAGE.signs(told), unit) if x) + doubt


def _named(symbol: str, frame: str) -> str:
    """A parameter without the unit that its symbol ends in, its axis as directions are counted."""
    if symbol[:1].isupper():  # a coefficient: Y_v, N_nn
        return symbol
    stem, _, end = symbol.rpartition("_")
    name = (stem if end in UNIT_ENDS else symbol).replace("_", " ")
    return AXES[frame].get(name, name)


def _changed(found: Comparison) -> str:
    """Held-out errors without and with the effects, and which differences may be chance."""
    pieces, doubted = [], []
    for name, before in found.held_out.before.items():
        after = found.held_out.after.get(name)
        if after is None:
            continue
        first = number(PAGE.shown(before.rmse, before.unit), 2)
        difference = found.held_out.difference.get(name)
        worse = " (worse)" if difference is not None and difference.low > 0.0 else ""
        pieces.append(f"{name} {first} → {quantity(after.rmse, after.unit, 2)}{worse}")
        if difference is not None and difference.low <= 0.0 <= difference.high:
            doubted.append(name)
    if not pieces:
        return ""
    told = f"With that, held-out RMSE {', '.join(pieces)}.{_doubt(found, doubted)}"
    return f"{told}{_no_better(found.cross_validation)}"


def _no_better(crossed: CrossValidated) -> str:
    """Channels in which identifying maneuvers, each left out in turn, are predicted no better."""
    pieces = [
        f"{name} {number(PAGE.shown(old.rmse, old.unit), 2)} → {quantity(new.rmse, new.unit, 2)}"
        for name, old in crossed.before.items()
        if name in DYNAMIC and (new := crossed.after.get(name)) and new.rmse > old.rmse
    ]
    if not pieces:
        return ""
    return f" Identifying maneuvers, each left out in turn, are no better: {', '.join(pieces)}."


def _doubt(found: Comparison, channels: Sequence[str]) -> str:
    """That so few maneuvers do not tell a difference from chance."""
    if not channels:
        return ""
    count = sum(m.role == "validate" for m in found.maneuvers)
    which = "maneuver" if count == 1 else "maneuvers"
    return f" With {count} held-out {which} chance is not excluded for {listed(channels)}."


def _remains(data: ReportData) -> Lines:
    """An unexplained residual, and the findings to look at."""
    found = data.comparison or data.diagnosis
    lines = list(words.unexplained_lines(found.unexplained)) if found else []
    if lines:
        where = "Without what is not confirmed an" if _in_doubt(found) else "An"
        lines = [" ".join([f"{where} unexplained residual.", *lines])]
    if found is not None and not found.unexplained:
        lines.append("No residual that calls for another effect.")
    coloured = not_white(data.final_tests)
    if coloured:
        lines.append(f"The errors of {listed(coloured)} are not white: more than noise is left.")
    ranks = [w.rank for w in warnings(data)]
    counts = [
        f"{n} {one if n == 1 else many}" for rank, one, many in COUNTED if (n := ranks.count(rank))
    ]
    if counts:
        lines.append(f"{listed(counts)} below.")
    return [" ".join(lines)] if lines else []


def _next(data: ReportData) -> Lines:
    """The maneuvers that would add most, and what would separate effects that look alike."""
    found = data.comparison or data.diagnosis
    lines = []
    if found is not None and found.ambiguous and data.diagnosis:
        lines.append(f"To tell the effects apart: {data.diagnosis.separate_by}.")
    best = data.plan.candidates[:MOST_NEXT] if data.plan else ()
    return [*lines, *(f"{i}. {_maneuver(c)}" for i, c in enumerate(best, 1))]


def _maneuver(c: TrialCandidate) -> str:
    """A maneuver, what to do, and what it would do to the standard deviations."""
    named = list(c.shrinks.items())[:MOST_NAMED]
    helps = ", ".join(f"{s} by {100.0 * (1.0 - f):.0f} %" for s, f in named)
    gained = f"; would cut the standard deviation of {helps}" if helps else ""
    return f"{c.name[0].upper()}{c.name[1:]}: {c.what}, {c.duration_s:.0f} s{gained}."
