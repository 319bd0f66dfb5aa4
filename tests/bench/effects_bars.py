"""The figures that the residual loop is held to, and those for information."""

from collections.abc import Callable, Sequence
from statistics import median
from typing import Any

from tests.bench.effects_score import Score
from tests.bench.effects_truth import FINDING_OF

Scores = Sequence[Score]
Table = list[dict[str, Any]]

AFFECTED = ("current", "rudder_lag", "rudder_offset", "dvl_misalignment")
CHANNELS = ("u", "v", "r")
RISE = 0.02  # of a held-out error: the bar of the loop
NEAR_S = 10.0  # of an event's or a step's time
# Held-out errors of a good model of these vehicles (m/s, m/s, rad/s), where no clean trial was run.
CLEAN = {"u": 0.006, "v": 0.008, "r": 0.0025}


def clean_errors(scores: Scores) -> dict[tuple[str, str], float]:
    """Median held-out error by vehicle and channel of the trials with nothing planted."""
    found: dict[tuple[str, str], list[float]] = {}
    for score in scores:
        for channel, (before, _) in score.held_out.items() if score.kind == "none" else ():
            found.setdefault((score.vehicle, channel), []).append(before)
    return {key: median(values) for key, values in found.items()}


def affected_ratio(score: Score, clean: dict[tuple[str, str], float]) -> float | None:
    """After over before in the channel whose error is largest against that of clean trials."""
    told = {c: score.held_out[c] for c in CHANNELS if c in score.held_out}
    if not told:
        return None
    usual = {c: clean.get((score.vehicle, c), CLEAN[c]) for c in told}
    worst = max(told, key=lambda c: told[c][0] / usual[c])
    before, after = told[worst]
    return after / before


def worst_rise(score: Score, channels: Sequence[str] = CHANNELS) -> float | None:
    """Largest relative rise of the held-out error of these channels."""
    pairs = [score.held_out[c] for c in channels if c in score.held_out]
    return max((after / before - 1.0 for before, after in pairs if before > 0.0), default=None)


def bars(scores: Scores) -> Table:
    """Every figure with its bar."""
    single = [s for s in scores if s.kind == "single"]
    seen = [s for s in single if s.visible]
    none, outside, pair = ([s for s in scores if s.kind == k] for k in ("none", "outside", "pair"))
    sizes = [z.inside for s in seen for z in s.sizes if z.inside is not None]
    return [
        _at_least("visible effects declared", 0.95, [s.declared for s in seen]),
        _at_least("right family", 0.92, [s.right_family for s in seen]),
        _at_least("right id or in a stated group", 0.88, [s.right_or_group for s in seen]),
        _at_most("wrong name, nothing of the family", 0.03, [s.wrong_name for s in single]),
        _at_most("nothing planted: anything stated", 0.05, [stated(s) for s in none]),
        _at_most("outside of the library: confident name", 0.20, [s.confident for s in outside]),
        _at_least("size within its 95 % interval", 0.85, sizes),
        _at_least("pairs: both families", 0.80, [s.right_family for s in pair]),
        *prediction_bars(scores),
        *for_information(single, none, outside, pair),
    ]


def stated(score: Score) -> bool:
    """Whether anything but "nothing found" is said; a failure counts."""
    return score.verdict != "none_found"


def rises_surely(score: Score) -> bool:
    """Whether u, v or r rises by more than 2 %, and more than chance would."""
    own = {c: score.held_out[c] for c in CHANNELS if c in score.surely_up and c in score.held_out}
    return any(after > (1.0 + RISE) * before for before, after in own.values())


def prediction_bars(scores: Scores) -> Table:
    """Held-out errors: the four effects that show most, and rises anywhere."""
    clean, four = clean_errors(scores), [s for s in scores if s.label in AFFECTED]
    ratios = [r for s in four if (r := affected_ratio(s, clean)) is not None]
    rises = [r for s in four if (r := worst_rise(s)) is not None]
    every = [r for s in scores if (r := worst_rise(s)) is not None]
    heading = [r for s in scores if (r := worst_rise(s, ("heading",))) is not None]
    return [
        _number("held-out ratio, most affected channel, four effects", 0.5, ratios, median),
        _number("held-out worst rise of u, v or r, four effects", RISE, rises, max),
        _at_most("u, v or r rises more than 2 %", None, [r > RISE for r in every]),
        _at_most("heading rises more than 2 %", None, [r > RISE for r in heading]),
        _at_most(
            "u, v or r rises more than 2 %, interval above zero",
            None,
            [rises_surely(s) for s in scores if s.held_out],
        ),
    ]


def for_information(single: Scores, none: Scores, outside: Scores, pair: Scores) -> Table:
    """Figures without a bar."""
    hidden = [s for s in single if not s.visible]
    finding = [s for s in single if s.label in FINDING_OF]
    return [
        _at_least("visible share of planted effects", None, [bool(s.visible) for s in single]),
        _at_most(
            "visible, verdict unexplained",
            None,
            [s.verdict == "unexplained" for s in single if s.visible],
        ),
        _at_most(
            "visible, partly explained",
            None,
            [s.verdict == "partly_explained" for s in single if s.visible],
        ),
        _at_most(
            "outside of the library: partly explained",
            None,
            [s.verdict == "partly_explained" for s in outside],
        ),
        _at_most(
            "named besides a right name", None, [bool(s.extra) for s in single if s.right_family]
        ),
        _at_most("not visible, wrong name", None, [s.wrong_name for s in hidden]),
        _at_least(
            "cross-flow and turning drag: name or finding",
            None,
            [s.by_finding or s.right_or_group for s in finding],
        ),
        _at_least(
            "named events and steps within 10 s of their time",
            None,
            [s.off_s <= NEAR_S for s in single if s.off_s is not None],
        ),
        _at_most("nothing planted: a name", None, [bool(s.named) for s in none]),
        _at_least("pairs: both ids or groups", None, [s.right_or_group for s in pair]),
    ]


def _at_least(what: str, bar: float | None, flags: Sequence[bool]) -> dict[str, Any]:
    return _row(what, flags, "" if bar is None else f">= {bar:.0%}", lambda x: x >= (bar or 0.0))


def _at_most(what: str, bar: float | None, flags: Sequence[bool]) -> dict[str, Any]:
    return _row(what, flags, "" if bar is None else f"<= {bar:.0%}", lambda x: x <= (bar or 0.0))


def _row(
    what: str, flags: Sequence[bool], bar: str, good: Callable[[float], bool]
) -> dict[str, Any]:
    share = sum(flags) / len(flags) if flags else None
    return {
        "what": what,
        "n": len(flags),
        "found": "-" if share is None else f"{share:.1%}",
        "bar": bar,
        "met": _met(None if share is None or not bar else good(share)),
    }


def _number(
    what: str, bar: float, values: Sequence[float], of: Callable[[Sequence[float]], float]
) -> dict[str, Any]:
    value = of(values) if values else None
    return {
        "what": what,
        "n": len(values),
        "found": "-" if value is None else f"{value:.3f}",
        "bar": f"<= {bar}",
        "met": _met(None if value is None else value <= bar),
    }


def _met(good: bool | None) -> str:
    return "" if good is None else ("yes" if good else "NO")
