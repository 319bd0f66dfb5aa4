"""Effects that were accepted one after another, seen together: exchange them, take some out.

A search that adds one effect at a time may take for one what are two. A drift angle and a turn,
both in proportion to the speed, are what an asymmetric hull does, and a rudder offset together
with a misaligned DVL does the same: neither of these two gains as much alone. Turns, and a
position log, tell them apart. On development seeds (1004 to 1943) the right one of the two
explanations was the better by 22 to 680 nats in 21 of 22 trials with asymmetries and such pairs;
in the other the pair had no misalignment of practical size.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from auvident.parallel import each
from auvident.schema.effects import EFFECTS, parts_of
from auvident.schema.likeness import partners
from auvident.stages.diagnose.fit.case import Case
from auvident.stages.diagnose.fit.fits import Fitted, log_gain
from auvident.stages.diagnose.fit.refits import apart, from_both, prior_cost, without
from auvident.stages.diagnose.select import rules
from auvident.stages.diagnose.select.candidates import impossible, size_of
from auvident.stages.diagnose.select.records import Exchanged
from auvident.stages.diagnose.select.rule import passes


@dataclass(frozen=True)
class Exchange:
    """Effects to take out of a model, and those to put in their place."""

    out: tuple[str, ...]
    into: tuple[str, ...]

    def __str__(self) -> str:
        return f"{' and '.join(self.out)} replaced by {' and '.join(self.into)}"


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
    newest, done = current.effects[-1:], list[Exchange]()
    while passes(len(done), rules.EXCHANGE_ON):
        settled = [effect for exchange in done for effect in exchange.into]
        wanted = exchanges(current, candidates, (*unclaimed, *settled), () if done else newest)
        found = _exchanged(case, current, list(wanted))
        if found is None:
            break
        done.append(found[0])
        current = found[1]
    there = apart(current, unclaimed if done else (*unclaimed, *newest))
    current, removed = _removed(case, current, there)
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


def _removed(case: Case, current: Fitted, effects: Sequence[str]) -> tuple[Fitted, list[str]]:
    """Take out those of some effects that are worth little beside the others."""
    steps = list[str]()
    if not passes(len(current.effects), rules.RECONSIDER):
        return current, steps
    for effect in effects:
        rest = apart(current, (effect,))
        less = from_both(case, rest, without(case, current.parameters, (effect,)), current)
        if less is not None and not passes(log_gain(less, current), rules.STAY):
            steps.append(
                f"{effect} removed: it contributes only {log_gain(less, current):.0f} nats"
            )
            current = less
    return current, steps


def _exchanged(
    case: Case, current: Fitted, wanted: Sequence[Exchange]
) -> tuple[Exchange, Fitted] | None:
    """The best exchange that is worth it, with its fit."""

    def fit(exchange: Exchange) -> Fitted | None:
        effects = (*apart(current, exchange.out), *exchange.into)
        return from_both(case, effects, without(case, current.parameters, exchange.out), current)

    found = [
        (exchange, fitted)
        for exchange, fitted in zip(wanted, each(fit, wanted), strict=True)
        if fitted is not None and _pays(case, current, fitted, exchange)
    ]
    return max(found, key=lambda f: worth(case, f[1]), default=None)


def _pays(case: Case, before: Fitted, after: Fitted, exchange: Exchange) -> bool:
    """Whether an exchange gains enough, with effects of practical and plausible size."""
    p = after.parameters
    exchanged = Exchanged(
        size=min(size_of(case, e, p) for e in exchange.into),
        impossible=any(impossible(case, e, p) for e in exchange.into),
        gain=worth(case, after) - worth(case, before),
        fewer=len(after.free) < len(before.free),
    )
    return passes(exchanged, rules.EXCHANGE)


def worth(case: Case, fitted: Fitted) -> float:
    """Logarithm of likelihood and prior of the effects, up to a constant [nats]."""
    return fitted.log_likelihood - prior_cost(case, fitted)
