"""Two effects that hide each other: each helps where the other is known, neither alone.

While one of two faults is missing, predictions of maneuvers left out are off by it, and a right
candidate for the other helps them no more than chance would. A rudder 2.8 deg off its zero and a
DVL 0.6 s late (population, seed 182) were both fitted at their right sizes, and refused with 1.3
and 1.0 of the 2.5 standard errors that are asked for.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial

from auvident.stages.diagnose.fit.case import Case
from auvident.stages.diagnose.fit.fits import Fitted, log_gain
from auvident.stages.diagnose.fit.refits import apart, from_both, without
from auvident.stages.diagnose.score.left_out import FitsWithout
from auvident.stages.diagnose.select.candidates import Round, Tried, account_of
from auvident.stages.diagnose.select.decisions import hidden_among, shown_together
from auvident.stages.diagnose.select.held_back import left_out_with
from auvident.stages.diagnose.select.records import Account

Search = Callable[[Fitted], Round]


@dataclass(frozen=True)
class Pair:
    """Two effects accepted together, in the rounds that say so of each."""

    first: Round
    second: Round

    @property
    def effects(self) -> tuple[str, str]:
        """The two."""
        assert self.first.accepted and self.second.accepted
        return self.first.accepted, self.second.accepted

    @property
    def fitted(self) -> Fitted:
        """The model with both."""
        return next(t.fitted for t in self.second.tried if t.id == self.second.accepted)


def together(
    case: Case,
    done: Round,
    search: Search,
    without: FitsWithout,
) -> Pair | None:
    """Two effects that pass the rules together, and each beside the other; None without such.

    Parameters
    ----------
    case : Case
    done : Round
        In which none was accepted.
    search : callable
        One round of the search from a model.
    without : FitsWithout
        Fits of other rounds.
    """
    tried = {t.id: t for t in done.tried}
    judged = [(t.account, t.refusal) for t in done.tried]
    for first in (tried[name] for name in hidden_among(judged)):
        second = search(first.fitted)
        accepted = next((t for t in second.tried if t.id == second.accepted), None)
        if accepted is None:
            continue
        pair = accepted.fitted
        both = left_out_with(case, done.before, pair, without)
        own = cache(partial(beside, case, first, pair, without))
        if shown_together(first.account, both, own):
            return Pair(_accepting(done, first, own()), second)
    return None


def beside(
    case: Case,
    first: Tried,
    pair: Fitted,
    fits: FitsWithout,
) -> Account:
    """What is known of the first effect of a pair, beside the model with the second alone."""
    rest = apart(pair, (first.id,))
    alone = from_both(case, rest, without(case, pair.parameters, (first.id,)), pair)
    if alone is None:  # without it there is no model at all
        return first.account
    last = replace(pair, effects=(*rest, first.id))
    gain = log_gain(alone, last)
    account = account_of(case, alone, last, 0.0, True, gain)
    return replace(account, helped=left_out_with(case, alone, last, fits))


def _accepting(done: Round, first: Tried, found: Account) -> Round:
    """The round with a candidate accepted for what it does beside another."""
    named = Tried(first.fitted, replace(first.account, helped=found.helped))
    tried = tuple(named if t is first else t for t in done.tried)
    return replace(done, tried=tried, accepted=first.id)
