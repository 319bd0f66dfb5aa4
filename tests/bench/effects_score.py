"""Was the planted effect found? Pure functions from one outcome to one score."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import hypot, inf
from typing import Any

from scipy.stats import kstest

from auvident.constants import NORMAL_95
from auvident.schema.effects import BY_ID, parameter_of
from auvident.schema.loop_statements import TOGETHER
from tests.bench.effects_truth import FINDING_OF

CONFIDENT = ("effect_found", "ambiguous")  # with nothing said to remain
# Seen by a search of the residual and not by a slope: `sees` may have no size for them.
EVENT = "one_off_event"
SEARCHED = ("wave", EVENT)
# North and east are axes of the chart: what flows between them is no smaller than along one.
FLOWS = ("current", "current_drift")

Row = Mapping[str, Any]
Spans = Sequence[Sequence[float]] | None  # start and end of maneuvers [s]


@dataclass(frozen=True)
class Size:
    """A named size against the planted one."""

    symbol: str
    planted: float
    value: float
    std: float
    z: float | None
    inside: bool | None


@dataclass(frozen=True)
class Score:
    """What one trial says about the residual loop.

    ``declared``: an effect is stated, by name or as one of a group; ``confident``: and nothing is
    said to remain. ``right_id``: every planted
    effect is named; ``right_or_group``: or stands in a group with a named one; ``right_family``:
    or its family is named. ``wrong_name``: something is named and nothing of a planted family;
    ``extra`` are the names that are neither planted nor in a group with a planted one.
    ``by_finding``: a finding on the coefficients says it. ``visible`` is None with nothing planted,
    and true where there is no diagnosis: a failure is not excused. So is ``asked``: the log
    has all columns that what is planted needs to be looked for.
    ``off_s``: how far outside of the planted time a named event or step lies. ``chance``: see
    `least_chance`.
    """

    key: str
    kind: str
    label: str
    vehicle: str
    verdict: str
    named: tuple[str, ...]
    visible: bool | None
    asked: bool | None
    declared: bool
    confident: bool
    right_id: bool
    right_or_group: bool
    right_family: bool
    wrong_name: bool
    by_finding: bool
    extra: tuple[str, ...] = ()
    sizes: tuple[Size, ...] = ()
    off_s: float | None = None
    held_out: dict[str, tuple[float, float]] = field(default_factory=dict)
    surely_up: tuple[str, ...] = ()
    seconds: dict[str, float] = field(default_factory=dict)
    peak_mb: float = 0.0
    why: str = ""
    chance: float = 1.0


def least_chance(diagnosis: Row, own: Iterable[str] = ()) -> float:
    """Least ``p`` of the candidates that are large enough; 1 where there is none.

    What the vehicle has of itself (`own`) is left out: the others would be false names.
    """
    return min((c["p"] for c in _large_enough(diagnosis, own)), default=1.0)


def most_strength(diagnosis: Row, own: Iterable[str] = ()) -> float:
    """Largest ``strength`` of the same candidates; -1, the least, where there is none."""
    told = (c.get("strength") for c in _large_enough(diagnosis, own))
    return max((strength for strength in told if strength is not None), default=-1.0)


def _large_enough(diagnosis: Row, own: Iterable[str]) -> list[Row]:
    return [
        c
        for c in diagnosis.get("candidates", [])
        if c.get("p") is not None and c["id"] not in own
        if (c.get("refusal") or {}).get("code") != "small"
    ]


def uniformity(chances: Sequence[float]) -> dict[str, Any]:
    """Whether chances of trials with nothing to find are uniform.

    ``away`` is how far the share of trials below some chance is from that chance at most
    (Kolmogorov and Smirnov), ``excess`` the same to the side that would be a false alarm; ``p`` and
    ``p of excess`` are how often that much is chance.
    """
    if not chances:
        none = dict.fromkeys(("away", "p", "excess", "p of excess"), "-")
        return {"n": 0, "below 0.05": "-", **none}
    found = kstest(chances, "uniform")
    above = kstest(chances, "uniform", alternative="greater")
    return {
        "n": len(chances),
        "below 0.05": sum(c < 0.05 for c in chances),
        "away": float(found.statistic),
        "p": float(found.pvalue),
        "excess": float(above.statistic),
        "p of excess": float(above.pvalue),
    }


def score(outcome: Row) -> Score:
    """Score of one trial."""
    diagnosis, comparison = outcome.get("diagnosis") or {}, outcome.get("comparison") or {}
    final = comparison if comparison.get("verdict") else diagnosis
    planted = outcome["truth"]["planted"]
    effects = final.get("effects", [])
    named = tuple(e["id"] for e in effects)
    groups = [set(g) for g in final.get("ambiguous", [])]
    ids = list(outcome["case"]["planted"])
    by_finding = any(_finding_says(name, diagnosis, comparison) for name in ids)
    family = bool(planted) and all(_family_named(p, effects, groups) for p in planted)
    return Score(
        key=outcome["case"]["key"],
        kind=outcome["case"]["kind"],
        label="+".join(ids) or "none",
        vehicle=outcome["case"]["vehicle"],
        verdict=final.get("verdict", "failed"),
        named=named,
        visible=_all_visible(planted, diagnosis, outcome.get("identifying_s")) if ids else None,
        asked=_all_asked(planted, diagnosis) if ids else None,
        declared=final.get("verdict") in (*CONFIDENT, "partly_explained") and bool(named),
        confident=final.get("verdict") in CONFIDENT and bool(named),
        right_id=bool(ids) and set(ids) <= set(named),
        right_or_group=bool(ids) and all(_in_group(i, named, groups) for i in ids),
        right_family=family,
        wrong_name=bool(named) and not any(_family_named(p, effects, groups) for p in planted),
        by_finding=by_finding,
        chance=least_chance(diagnosis),
        extra=tuple(n for n in named if not any(_in_group(n, [i], groups) for i in ids)),
        sizes=tuple(sizes(planted, effects)),
        off_s=time_off(planted, effects),
        held_out=errors(comparison),
        surely_up=surely_up(comparison),
        seconds=dict(outcome.get("seconds", {})),
        peak_mb=outcome.get("peak_mb", 0.0),
        why=reason(ids, outcome.get("error"), diagnosis),
    )


def _in_group(name: str, named: Iterable[str], groups: Iterable[set[str]]) -> bool:
    """Whether an id is named, or stands in a group with a named one."""
    told = set(named)
    return name in told or any(name in g and g & told for g in groups)


def _family_named(planted: Row, effects: list[Row], groups: list[set[str]]) -> bool:
    families = {e["family"] for e in effects}
    return planted["family"] in families or _in_group(
        planted["id"], [e["id"] for e in effects], groups
    )


def _finding_says(name: str, *artifacts: Row) -> bool:
    codes = [f["code"] for a in artifacts for f in a.get("findings", [])]
    return name in FINDING_OF and any(FINDING_OF[name] in code for code in codes)


def _all_visible(planted: Iterable[Row], diagnosis: Row, spans: Spans) -> bool:
    return not diagnosis or all(
        is_visible(p, diagnosis.get("sees", [])) and happened_in(p, spans) for p in planted
    )


def _all_asked(planted: Iterable[Row], diagnosis: Row) -> bool:
    """Whether the log has the columns that effects of the library need, as the program says."""
    missing = set(diagnosis.get("missing", []))
    effects = [BY_ID[p["id"]] for p in planted if p["id"] in BY_ID]
    return all(e.by_rate or missing.isdisjoint(e.needs) for e in effects)


def happened_in(planted: Row, spans: Spans) -> bool:
    """Whether an event fell into a maneuver that identifies; other effects always act."""
    if planted["id"] != EVENT or not spans:
        return True
    first, last = min(planted["time_s"]), max(planted["time_s"])
    return any(first < end and last > start for start, end in spans)


def is_visible(planted: Row, sees: Iterable[Row]) -> bool:
    """Whether the planted size is above the one that the program says it would see.

    Of several parameters one is enough, but a push has to show in sway and in yaw, and of what
    flows all parameters count together; of a limit the smaller is the stronger.
    """
    rows = [row for row in sees if row["id"] == planted["id"]]
    if not rows:
        return planted["id"] in SEARCHED
    if planted["id"] in FLOWS:
        return _of_stated(planted, rows) >= 1.0
    seen = [_is_above(planted, row) for row in rows if row["visible"]]
    return all(seen) and bool(seen) if planted["id"] in TOGETHER else any(seen)


def _of_stated(planted: Row, rows: Iterable[Row]) -> float:
    """Planted sizes over the stated ones, root of the sum of squares, as their gains add up."""
    size = planted["parameters"]
    return hypot(*(size.get(r["symbol"], 0.0) / r["size"] for r in rows if r["visible"]))


def _is_above(planted: Row, row: Row) -> bool:
    size = planted["parameters"].get(row["symbol"])
    if size is None:
        return True
    if _is_limit(planted["id"], row["symbol"]):
        return bool(abs(size) <= row["size"])
    return bool(abs(size) >= row["size"])


def _is_limit(name: str, symbol: str) -> bool:
    known = name in BY_ID and any(p.symbol == symbol for p in BY_ID[name].parameters)
    return known and parameter_of(f"{name}.{symbol}").form != "plain"


def sizes(planted: Iterable[Row], effects: Iterable[Row]) -> Iterable[Size]:
    """Named sizes of the planted effects, where both are parameters of one form."""
    stated = {e["id"]: {p["symbol"]: p for p in e["parameters"]} for e in effects}
    for effect in planted:
        for symbol, truth in effect["parameters"].items() if effect["exact"] else ():
            if symbol in stated.get(effect["id"], {}):
                yield compared(symbol, truth, stated[effect["id"]][symbol])


def compared(symbol: str, truth: float, stated: Row) -> Size:
    """One size: error over the claimed deviation, and whether the 95 % interval holds it."""
    value, std = stated["value"], stated["std"]
    low, high = stated.get("low"), stated.get("high")
    if stated.get("bound"):  # open to one side
        low, high = (-inf if low is None else low), (inf if high is None else high)
    off = truth - value
    if symbol == "direction_deg":
        off = (off + 180.0) % 360.0 - 180.0
    if low is None or high is None:
        low, high = value - NORMAL_95 * std, value + NORMAL_95 * std
    known = std > 0.0 or high > low
    return Size(
        symbol,
        truth,
        value,
        std,
        -off / std if std > 0.0 else None,
        bool(low <= value + off <= high) if known else None,
    )


def time_off(planted: Iterable[Row], effects: Iterable[Row]) -> float | None:
    """Seconds between the stated time of an effect and its planted one, or from its span."""
    stated = {e["id"]: e.get("time_s") for e in effects}
    for effect in planted:
        time, span = stated.get(effect["id"]), effect["time_s"]
        if time is not None and len(span):
            return float(max(span[0] - time, time - span[-1], 0.0))
    return None


def errors(comparison: Row) -> dict[str, tuple[float, float]]:
    """Held-out RMSE before and after, by channel."""
    held_out = comparison.get("held_out", {})
    before, after = held_out.get("before", {}), held_out.get("after", {})
    return {c: (before[c]["rmse"], after[c]["rmse"]) for c in before if c in after}


def surely_up(comparison: Row) -> tuple[str, ...]:
    """Channels whose held-out error rose, by the interval that the program gives itself."""
    difference = comparison.get("held_out", {}).get("difference", {})
    return tuple(channel for channel, d in difference.items() if d["low"] > 0.0)


def reason(planted: list[str], error: str | None, diagnosis: Row) -> str:
    """Why the planted effects were not accepted, and what gained most, as the program puts it."""
    if error:
        return error
    tried = {c["id"]: c for c in diagnosis.get("candidates", [])}
    most = sorted(tried, key=lambda name: -tried[name]["gain"])[:1]
    said = [
        f"{name} ({tried[name]['gain']:.0f} nats): {tried[name]['rejected'] or 'accepted'}"
        for name in dict.fromkeys([*planted, *most])
        if name in tried
    ]
    return "; ".join(said) or diagnosis.get("statement", "")
