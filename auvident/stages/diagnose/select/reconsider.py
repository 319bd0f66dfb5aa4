"""Effects that were accepted one after another, seen together: exchange them, take some out.

A search that adds one effect at a time may take for one what are two. A drift angle and a turn,
both in proportion to the speed, are what an asymmetric hull does, and a rudder offset together
with a misaligned DVL does the same: neither of these two gains as much alone. Turns, and a
position log, tell them apart. On development seeds (1004 to 1943) the right one of the two
explanations was the better by 22 to 680 nats in 21 of 22 trials with asymmetries and such pairs;
in the other the pair had no misalignment of practical size.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

from auvident.parallel import each
from auvident.schema.effects import EFFECTS, parts_of
from auvident.schema.likeness import partners
from auvident.stages.diagnose.fit.case import Case
from auvident.stages.diagnose.fit.fits import Fitted, log_gain
from auvident.stages.diagnose.fit.refits import (
    afresh_too,
    apart,
    from_both,
    prior_cost,
    refit,
    without,
)
from auvident.stages.diagnose.score.first_order import joint_about, score, score_from
from auvident.stages.diagnose.select import rules
from auvident.stages.diagnose.select.candidates import impossible, size_of, steady
from auvident.stages.diagnose.select.records import Exchanged, Replacing
from auvident.stages.diagnose.select.rule import passes
from auvident.stages.diagnose.select.starts import at_typical_size, is_limit


@dataclass(frozen=True)
class Exchange:
    """Effects to take out of a model, and those to put in their place."""

    out: tuple[str, ...]
    into: tuple[str, ...]

    def __str__(self) -> str:
        return f"{' and '.join(self.out)} replaced by {' and '.join(self.into)}"


@dataclass(frozen=True)
class Less:
    """A model without some of its effects: each fit is made once, whoever asks for it.

    Attributes
    ----------
    case : Case
    current : Fitted
    made : dict
        Fits by the effects that are out.
    """

    case: Case
    current: Fitted
    made: dict[tuple[str, ...], Fitted | None] = field(default_factory=dict)

    def fit(self, out: tuple[str, ...]) -> Fitted | None:
        """The model without these; None where it runs away."""
        start = without(self.case, self.current.parameters, out)
        return from_both(self.case, apart(self.current, out), start, self.current)

    def at_once(self, outs: Sequence[tuple[str, ...]]) -> None:
        """Make several of them, side by side."""
        missing = [out for out in dict.fromkeys(outs) if out not in self.made]
        self.made.update(zip(missing, each(self.fit, missing), strict=True))

    def of(self, out: tuple[str, ...]) -> Fitted | None:
        """As `fit`, if it was not made before."""
        self.at_once([out])
        return self.made[out]


def reconsider(
    case: Case, candidates: Sequence[str], current: Fitted, unclaimed: Sequence[str]
) -> tuple[Fitted, list[str]]:
    """Exchange effects for what looks like them; take out those that are no longer worth it.

    Parameters
    ----------
    case : Case
    candidates : sequence of str
        Effects that can be tested.
    current : Fitted
        With the effect accepted last at the end.
    unclaimed : sequence of str
        Effects that were taken along without a claim; they stay.

    Returns
    -------
    Fitted
    list of str
        What was done, for people.
    """
    newest, done, less = current.effects[-1:], list[Exchange](), Less(case, current)
    while passes(len(done), rules.EXCHANGE_ON):
        settled = [effect for exchange in done for effect in exchange.into]
        wanted = exchanges(less.current, candidates, (*unclaimed, *settled), () if done else newest)
        found = _exchanged(less, list(wanted))
        if found is None:
            break
        done.append(found[0])
        less = Less(case, found[1])
    last = () if done else newest
    there = apart(less.current, (*unclaimed, *last))
    current, removed = _removed(less, there, last)
    return current, [*map(str, done), *removed]


def exchanges(
    current: Fitted, candidates: Sequence[str], staying: Sequence[str], newest: Sequence[str]
) -> Iterator[Exchange]:
    """Exchanges to try; the newest effect has just been held against its partners."""
    there = apart(current, staying)
    for effect in (e for e in there if e not in newest):
        for other in partners(effect):
            if other not in current.effects and other in candidates:
                yield Exchange((effect,), (other,))
    for whole, parts in ((e.id, parts) for e in EFFECTS for parts in parts_of(e.id)):
        absent = tuple(e for e in parts if e not in current.effects)
        if whole in there and absent and set(parts) <= set(candidates):
            yield Exchange((whole,), absent)
        elif set(parts) <= set(there) and whole in candidates:
            yield Exchange(parts, (whole,))


def _removed(
    less: Less, effects: Sequence[str], newest: tuple[str, ...]
) -> tuple[Fitted, list[str]]:
    """Take out those of some effects that are worth little beside the others.

    Or the newest, where it makes one of them worth little and is no better in its place.
    """
    steps = list[str]()
    if not passes(len(less.current.effects), rules.RECONSIDER):
        return less.current, steps
    for effect in effects:
        rest = less.of((effect,))
        if rest is None or passes(log_gain(rest, less.current), rules.STAY):
            continue
        if newest and not _takes_over(less, rest, Exchange((effect,), newest)):
            before = less.of(newest)
            assert before is not None  # the search came from there
            return before, [*steps, f"{newest[0]} removed: {effect} alone does as much"]
        gain = log_gain(rest, less.current)
        steps.append(f"{effect} removed: it contributes only {gain:.0f} nats")
        less = Less(less.case, rest)
    return less.current, steps


def _takes_over(less: Less, after: Fitted, exchange: Exchange) -> bool:
    """Whether the newest effect may put out one of fewer parameters that it has made worth little.

    As if the two had been exchanged: a DVL misalignment of 922 nats was followed by a side force
    of 45 more, beside which it was worth 32, and the wrong one stayed (population, seed 6076).
    """
    case, before = less.case, less.of(exchange.into)
    more = len(case.positions(*exchange.into)) > len(case.positions(*exchange.out))
    return not more or before is None or _pays(Less(case, before), after, exchange)


def _exchanged(less: Less, wanted: Sequence[Exchange]) -> tuple[Exchange, Fitted] | None:
    """The best exchange that is worth it, with its fit."""
    case = less.case
    less.at_once([exchange.out for exchange in wanted if not _marked(exchange)])
    found = [
        (exchange, fitted)
        for exchange, fitted in zip(wanted, each(lambda e: _fit(less, e), wanted), strict=True)
        if fitted is not None and _pays(less, fitted, exchange)
    ]
    return max(found, key=lambda f: worth(case, f[1]), default=None)


def _marked(exchange: Exchange) -> bool:
    """Whether coefficients fitted without the new effects take them up; see `steady`."""
    return any(steady(effect) for effect in exchange.into)


def _fit(less: Less, exchange: Exchange) -> Fitted | None:
    """The model with effects exchanged; None where it runs away, or is not worth a fit.

    A fit from the estimate is made where that from the model lets one hope for enough.
    """
    case, current, out = less.case, less.current, exchange.out
    effects, start = (*apart(current, out), *exchange.into), without(case, current.parameters, out)
    rest = None if _marked(exchange) else less.of(out)
    if rest is None:
        return from_both(case, effects, start, current)
    of_out, unseen = log_gain(rest, current), any(is_limit(e) for e in exchange.into)
    if not passes(Replacing(_promise(case, rest, exchange.into), of_out, unseen), rules.REPLACE):
        return None
    near = refit(case, effects, [start], current)
    if near is not None and not passes(Replacing(log_gain(rest, near), of_out), rules.REPLACE):
        return near
    return afresh_too(case, effects, start, near)


def _promise(case: Case, rest: Fitted, into: Sequence[str]) -> float:
    """What effects would gain to first order [nats]; infinite where the simulation runs away."""
    joint = joint_about(case, rest, into)
    if joint is None:
        return math.inf
    there = at_typical_size(case, rest, into[0]) if len(into) == 1 else None
    typical = None if there is None else score_from(joint, into[0], there)
    return max(s.gain for s in (score(joint, into), typical) if s is not None)


def _pays(less: Less, after: Fitted, exchange: Exchange) -> bool:
    """Whether an exchange gains enough, with effects of practical and plausible size.

    More parameters have to gain as much as tells them from what they replace: a rudder offset
    of 722 nats at its true size gave way to an asymmetric hull, of which it is a part.
    """
    case, before, p = less.case, less.current, after.parameters
    added = len(case.positions(*exchange.into)) - len(case.positions(*exchange.out))
    exchanged = Exchanged(
        size=min(size_of(case, e, after) for e in exchange.into),
        impossible=any(impossible(case, e, p) for e in exchange.into),
        gain=worth(case, after) - worth(case, before),
        fewer=added < 0,
    )
    if added <= 0 or not passes(exchanged, rules.EXCHANGE):
        return passes(exchanged, rules.EXCHANGE)
    rest = less.of(exchange.out)
    of_out = math.inf if rest is None else worth(case, before) - worth(case, rest)
    share = exchanged.gain / of_out if of_out > 0.0 else math.inf
    return passes(replace(exchanged, share=share), rules.EXCHANGE)


def worth(case: Case, fitted: Fitted) -> float:
    """Logarithm of likelihood and prior of the effects, up to a constant [nats]."""
    return fitted.log_likelihood - prior_cost(case, fitted)
