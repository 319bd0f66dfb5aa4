"""What the residual loop found, in words that the console and the HTML report share."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from auvident.constants import NORMAL_95
from auvident.report.numbers import TERMINAL
from auvident.schema.confirmed import holds_nothing
from auvident.schema.diagnosis import (
    Attempt,
    Bound,
    Candidate,
    CoefficientComparison,
    Comparison,
    Detectable,
    EffectFound,
    Lookalikes,
    ParameterValue,
    ResidualRow,
)
from auvident.schema.effects import FAMILIES
from auvident.schema.loop_statements import TOGETHER, follows, is_limit, largest_fall, seen_last

number, with_unit = TERMINAL.number, TERMINAL.quantity
MOVED = 2.0  # standard deviations before, from which on a coefficient is said to have moved
TOO_SMALL = "too small compared with the noise"
SIDES: dict[Bound, str] = {"at least": "≥", "at most": "≤"}
VERDICTS = {
    "none_found": "nothing found",
    "effect_found": "effect found",
    "ambiguous": "effects that cannot be told apart",
    "partly_explained": "effects found, and an unexplained residual",
    "unexplained": "a residual that no listed effect explains",
}
# what an unknown force that follows angle, rate or time lets one think of, by plane
SUGGESTS: dict[str, str] = {
    "horizontal": "A force that follows the heading suggests a current or a wave, one that follows "
    "r damping or a sensor, one that follows time a change of the vehicle.",
    "vertical": "A force that follows the pitch suggests weight and buoyancy, one that follows "
    "q damping or a sensor, one that follows time a change of the vehicle.",
}


@dataclass(frozen=True)
class PooledResidual:
    """Residual of a channel over all identifying maneuvers, and the noise of its sensor."""

    channel: str
    unit: str
    rms: float
    rms_after: float
    noise_std: float
    correlation_time_s: float

    @property
    def ratio(self) -> float | None:
        """Residual over noise; None where the noise is not known."""
        return self.rms / self.noise_std if self.noise_std > 0.0 else None


def listed(names: Sequence[str]) -> str:
    """``u, v and r``."""
    return " and ".join(x for x in (", ".join(names[:-1]), *names[-1:]) if x)


def interval(p: ParameterValue) -> tuple[float, float]:
    """The 95 % interval: as stated, else from the standard deviation."""
    half = NORMAL_95 * (p.std or 0.0)
    low = p.value - half if p.low is None else p.low
    high = p.value + half if p.high is None else p.high
    return low, high


def std_of(p: ParameterValue) -> float:
    """Standard deviation: as stated, else from the interval."""
    low, high = interval(p)
    return p.std or (high - low) / (2.0 * NORMAL_95)


def interval_text(p: ParameterValue) -> str:
    """The 95 % interval, ``0.11 to 0.13``, of an open one its end; empty if not worked out."""
    if p.bound:
        told = [number(end) for end in (p.low, p.high) if end is not None]
        return f"{SIDES[p.bound]} {told[0]}" if told else ""
    if not p.std and (p.low is None or p.high is None):
        return ""
    return TERMINAL.interval(*interval(p))


def interval_of(effect: str, p: ParameterValue) -> str:
    """The interval of a parameter of an effect; says so where it holds no effect at all."""
    text = interval_text(p)
    return f"{text}, not confirmed" if text and holds_nothing(effect, p) else text


def size(effect: str, p: ParameterValue) -> str:
    """A parameter with its interval, if it has one: ``lag_s 0.38 s (0.33 to 0.43)``."""
    bounds = f" ({interval_of(effect, p)})" if interval_text(p) else ""
    side = f"{SIDES[p.bound]} " if p.bound else ""
    # a time of the log has as many digits as the log is long
    told = f"{p.value:.1f} {p.unit}" if p.symbol == "time_s" else with_unit(p.value, p.unit)
    return f"{p.symbol} {side}{told}{bounds}"


def sizes(effect: str, parameters: Iterable[ParameterValue]) -> str:
    """Parameters of an effect with their intervals."""
    return ", ".join(size(effect, p) for p in parameters)


def place(effect: EffectFound) -> str:
    """Where and when an effect of one time acted; empty for one that acts always."""
    pieces = [effect.maneuver or ""]
    stated = any(p.symbol == "time_s" and p.low is not None for p in effect.parameters)
    if effect.time_s is not None and not stated:  # the words have the interval
        pieces.append(f"at {effect.time_s:.1f} s")
    if effect.duration_s is not None:
        pieces.append(f"for {effect.duration_s:.1f} s")
    return " ".join(piece for piece in pieces if piece)


def detectable_text(rows: Sequence[Detectable]) -> str:
    """Smallest size of one effect that would show in all its parameters of a unit."""
    pieces = [
        f"{'≤' if is_limit(row) else '≥'} {with_unit(row.size, row.unit, 2)}"
        for row in seen_last(rows)
    ]
    effect = rows[0].id
    return f"{effect} {(' and ' if effect in TOGETHER else ', ').join(pieces)}"


def visible_by_family(sees: Sequence[Detectable]) -> dict[str, list[str]]:
    """Effects that would show, each with its smallest sizes, by family."""
    found: dict[str, dict[str, list[Detectable]]] = {}
    for row in (row for row in sees if row.visible):
        found.setdefault(row.family, {}).setdefault(row.id, []).append(row)
    return {
        family: [detectable_text(rows) for rows in found[family].values()]
        for family in (*FAMILIES, *(f for f in found if f not in FAMILIES))
        if family in found
    }


def blind_by_reason(sees: Sequence[Detectable]) -> dict[str, list[str]]:
    """Effects, or single parameters of effects, that would not show, by the reason."""
    reasons: dict[str, set[str]] = {}
    for row in sees:
        reasons.setdefault(row.id, set()).add("" if row.visible else row.why or TOO_SMALL)
    found: dict[str, list[str]] = {}
    for row in (row for row in sees if not row.visible):
        name = row.id if len(reasons[row.id]) == 1 else f"{row.id}.{row.symbol}"
        names = found.setdefault(row.why or TOO_SMALL, [])
        if name not in names:
            names.append(name)
    return found


def alike(lookalikes: Sequence[Lookalikes]) -> list[Lookalikes]:
    """Pairs of effects that look alike; all pairs among several effects as one row."""
    found: dict[str, list[Lookalikes]] = {}
    for pair in lookalikes:
        found.setdefault(pair.separate_by, []).append(pair)
    rows = []
    for separate_by, pairs in found.items():
        ids = tuple(dict.fromkeys(i for pair in pairs for i in pair.ids))
        if len(pairs) < len(ids) * (len(ids) - 1) // 2:
            rows += pairs
            continue
        cosine = min(pair.cosine for pair in pairs)
        rows.append(Lookalikes(ids=ids, cosine=cosine, separate_by=separate_by))
    return rows


def ranked(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Candidates, accepted ones first, then by what they gained."""
    return sorted(candidates, key=lambda c: (bool(c.rejected), -c.gain))


def pooled(rows: Sequence[ResidualRow]) -> list[PooledResidual]:
    """Residual by channel: root mean square over the maneuvers, median correlation time."""
    found = []
    for channel in dict.fromkeys(row.channel for row in rows):
        same = [row for row in rows if row.channel == channel]
        times = sorted(row.correlation_time_s for row in same)
        found.append(
            PooledResidual(
                channel,
                same[0].unit,
                _rms(r.rms for r in same),
                _rms(r.rms_after for r in same),
                _rms(r.noise_std for r in same),
                times[len(times) // 2],
            )
        )
    return found


def _rms(values: Iterable[float]) -> float:
    squares = [value**2 for value in values]
    return math.sqrt(sum(squares) / len(squares))


def moves(c: CoefficientComparison) -> float:
    """Change of a coefficient in standard deviations that it had before."""
    return (c.after - c.before) / c.before_std if c.before_std > 0.0 else 0.0


def moved(coefficients: Sequence[CoefficientComparison]) -> list[CoefficientComparison]:
    """Coefficients that changed by more than `MOVED` of their standard deviations, most first."""
    found = [c for c in coefficients if abs(moves(c)) > MOVED]
    return sorted(found, key=lambda c: -abs(moves(c)))


def correlates(unexplained: Mapping[str, object]) -> list[str]:
    """What an unexplained residual follows, strongest first, whatever form it came in."""
    rows = unexplained.get("correlates") or ()
    assert isinstance(rows, list | tuple)
    return [_correlate(row) for row in rows]


def attempt_words(attempt: Attempt) -> tuple[str, str]:
    """A model that was tried beside the one before: its effects, and what became of it."""
    name = "small effects alone" if attempt.unclaimed else " + ".join(attempt.effects)
    if attempt.keeps:
        name += f" (for the sake of {', '.join(attempt.keeps)})"
    if attempt.own_starts:
        name += " (with fitted starts)"
    ends = {"adopted": attempt.taken, "failed": attempt.failed, "diverges": attempt.ran_away}
    return name, next((words for words, so in ends.items() if so), "")


def force(found: Comparison) -> str:
    """What came of a force without a name; empty where none was asked for."""
    return found.unexplained_force.statement if found.unexplained_force else ""


def unexplained_lines(unexplained: Mapping[str, object]) -> tuple[str, ...]:
    """What is left: what it follows, the effect that comes nearest, where it is."""
    lines = [f"{line[0].upper()}{line[1:]}." for line in correlates(unexplained)]
    if unexplained.get("nearest"):
        nearest = plain(unexplained["nearest"])
        lines.append(f"Closest of the listed effects, not confirmed: {nearest}.")
    if unexplained.get("channels"):
        lines.append(f"Affected channels: {plain(unexplained['channels'])}.")
    return tuple(lines)


def plain(found: object) -> str:
    """Names out of whatever container they stand in."""
    if isinstance(found, Mapping):
        name = found.get("id")
        return str(name) if name else ", ".join(f"{k} {plain(v)}" for k, v in found.items())
    if isinstance(found, list | tuple):
        return ", ".join(plain(item) for item in found)
    return number(found) if isinstance(found, float) else str(found)


def _correlate(row: object) -> str:
    if not isinstance(row, Mapping) or "regressor" not in row:
        return plain(row)
    gain = row.get("gain")
    if not isinstance(gain, int | float):
        return follows(row)
    fall = number(100.0 * max(largest_fall(row), 0.0), 2)
    return f"{follows(row)} ({number(float(gain))} nats, {fall} % off the residual)"
