"""The short list refitted: a few steps for all, the best to the end, rivals from where it lies."""

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from auvident.parallel import each
from auvident.schema.likeness import alike
from auvident.stages.diagnose.fit.case import Case
from auvident.stages.diagnose.fit.fits import Fitted, fit_with, log_gain
from auvident.stages.diagnose.fit.refits import (
    best_of,
    from_estimate,
    holding,
    nested,
    refit,
    settled,
)
from auvident.stages.diagnose.select import rules
from auvident.stages.diagnose.select.candidates import (
    Tried,
    account_of,
    ranked,
    size_of,
    steady,
)
from auvident.stages.diagnose.select.records import Begun, Rival, Screened, Start
from auvident.stages.diagnose.select.rule import passes, passes_any
from auvident.stages.diagnose.select.screen import Screen
from auvident.stages.diagnose.select.starts import Begin, starts_of
from auvident.stages.diagnose.select.telling import COMPARE, FIT, SETTLE, Telling

Array = npt.NDArray[Any]
Fits = dict[str, Fitted]
NO_FITS: Mapping[str, Fitted] = {}


def refitted(
    case: Case,
    before: Fitted,
    screened: Screen,
    told: Telling | None = None,
    fits: Mapping[str, Fitted] = NO_FITS,
) -> tuple[Fitted, list[Tried]]:
    """The model, fitted again where it was stuck, and the short list, largest gain first.

    With the fits of other candidates that are there already, each if it is the better one.
    """
    told = told or Telling()
    told.enter(FIT)

    found = first_steps(case, before, screened, partial(told.one_of, len(screened.short)))
    found |= {c: best_of([found.get(c), f]) or f for c, f in fits.items()}
    # a fit that is not there yet may still become what the first-order step promises
    promise = {c: max(log_gain(before, f), screened.scores[c].gain) for c, f in found.items()}
    told.enter(SETTLE)
    finished = finish(case, before, found, promise, screened.by_others(promise), told.next)
    told.enter(COMPARE)
    before, found = unstuck(case, before, {**found, **finished})
    found = side_by_side(lambda c: nested(case, before, found[c]), tuple(found))
    found, finished = leader_finished(case, found, finished)
    gains = {c: log_gain(before, f) for c, f in found.items()}
    others = screened.by_others(gains)
    tried = [
        Tried(f, account_of(case, before, f, others[c], c in finished, promise[c]))
        for c, f in found.items()
    ]
    return before, sorted(tried, key=lambda t: -t.gain)


def side_by_side(fit: Callable[[str], Fitted], candidates: Sequence[str]) -> Fits:
    """A fit of each candidate, several at a time."""
    return dict(zip(candidates, each(fit, candidates), strict=True))


def from_estimates(case: Case, before: Fitted, candidates: Sequence[str]) -> Fits:
    """Candidates beside a model, each fitted from the analytical estimate; without what ran away.

    They begin at no size: from the estimate that is no worse than any other.
    """

    def begin(c: str) -> Fitted | None:
        return from_estimate(case, (*before.effects, c), before.parameters)

    found = zip(candidates, each(begin, candidates), strict=True)
    return {c: f for c, f in found if f is not None}


def first_steps(
    case: Case, before: Fitted, screened: Screen, tell: Callable[[str], None] = lambda c: None
) -> Fits:
    """A few steps of what leads, then of what may gain enough beside it."""
    order = ranked({c: screened.scores[c].gain for c in screened.short})
    lead = [c for place, c in enumerate(order) if passes(Screened(c, 0.0, place), rules.ACCOMPANY)]
    rest = [c for c in screened.short if c not in lead]

    def begin(candidates: Sequence[str], gained: float, marked: Collection[str]) -> Fits:
        starts = starts_worth(case, before, screened, candidates, gained, marked)
        return begun(case, before, starts, screened.ceiling, tell)

    worth = [c for c in lead if passes(Start(screened.scores[c].gain, 0.0, False), rules.BEGIN)]
    found = begin(lead, 0.0, worth)  # from wherever one may begin
    # what is too small to matter may be taken along, and then the others have another round
    sizes = {c: size_of(case, c, f) for c, f in found.items()}
    large = [log_gain(before, found[c]) for c, size in sizes.items() if size >= rules.LEAST_SIZE]
    behind = {c for small, size in sizes.items() if size < rules.LEAST_SIZE for c in alike(small)}
    marked = behind | {c for c in rest if steady(c)} | set(screened.apart)
    found |= begin(rest, max(large, default=0.0), marked)
    return {c: found[c] for c in screened.short if c in found}


def starts_worth(
    case: Case,
    before: Fitted,
    screened: Screen,
    candidates: Sequence[str],
    gained: float,
    marked: Collection[str] = (),
) -> dict[str, list[Begin]]:
    """Where the first steps of some candidates begin, of those that are worth them.

    Parameters
    ----------
    gained : float
        By others [nats].
    marked : collection of str
        Candidates that are begun whatever they promise.
    """
    found = {}
    for c in candidates:
        asked = starts_of(case, before, c, screened.scores[c], screened.typical.get(c))
        found[c] = [
            b
            for b in asked
            if passes(Start(b.promise, gained, b.unseen or c in marked), rules.BEGIN)
        ]
    return {c: starts for c, starts in found.items() if starts}


def begun(
    case: Case,
    before: Fitted,
    starts: Mapping[str, Sequence[Begin]],
    ceiling: float,
    tell: Callable[[str], None] = lambda candidate: None,
) -> Fits:
    """A few steps from the starts of some candidates, and the best fit of each.

    All starts are equals, so that no thread is left alone with those of one candidate. One that
    was begun as a limit that is reached only, and explains nothing, is left out.
    """
    every = [(c, begin) for c, own in starts.items() for begin in own]

    def steps(start: tuple[str, Begin]) -> Fitted | None:
        c, begin = start
        fitted = refit(case, (*before.effects, c), [begin.parameters], before, 1, 5, ceiling)
        if begin is starts[c][-1]:
            tell(c)
        return fitted

    fits = list(zip(every, each(steps, every), strict=True))
    best = {c: best_of([f for (of, _), f in fits if of == c]) for c in starts}
    kept = [
        c
        for c, f in best.items()
        if (f is not None and log_gain(before, f) > 0.0) or not all(b.unseen for b in starts[c])
    ]

    def whole(c: str) -> Fitted:
        return nested(case, before, best[c] or holding(case, before, (*before.effects, c)))

    return side_by_side(whole, kept)


def finish(
    case: Case,
    before: Fitted,
    found: Fits,
    promise: dict[str, float],
    by_others: Mapping[str, float],
    tell: Callable[[str], None] = lambda candidate: None,
) -> Fits:
    """Those that are fitted to the end, the most promising first; each is told when it begins.

    What has to be finished whatever comes of the others is finished side by side.
    """
    order, finished = ranked(promise), Fits()
    beside = _beside_steady(promise)

    def asked(place: int) -> Begun:
        c = order[place]
        best = max([rules.LEAST_GAIN, *(log_gain(before, f) for f in finished.values())])
        gain, first = log_gain(before, found[c]), promise[order[0]]
        return Begun(c, place, promise[c], first, by_others[c], gain, best, c in beside)

    def ended(places: Sequence[int]) -> Fits:
        afresh = {order[place]: passes(asked(place), rules.AFRESH) for place in places}
        for c in afresh:
            tell(c)
        return side_by_side(lambda c: to_the_end(case, found[c], afresh[c]), tuple(afresh))

    places = range(len(order))
    finished |= ended([place for place in places if passes(asked(place), rules.FINISH)])
    for place in (k for k in places if order[k] not in finished):
        if passes_any(asked(place), rules.FINISH_ANYWAY):
            finished |= ended([place])
    return finished


def _beside_steady(promise: dict[str, float]) -> set[str]:
    """Effects that show in a straight run as one of the leading ones does."""
    leading = (c for place, c in enumerate(ranked(promise)) if passes(place, rules.LEAD))
    return {other for c in leading for other in steady(c)}


def to_the_end(case: Case, fitted: Fitted, afresh: bool) -> Fitted:
    """Until it gains no more, and if asked for from the analytical estimate as well."""
    ways: list[Callable[[], Fitted | None]] = [partial(settled, case, fitted)]
    if afresh:
        ways.append(partial(from_estimate, case, fitted.effects, fitted.parameters))
    return best_of(each(lambda way: way(), ways)) or fitted


def unstuck(case: Case, before: Fitted, found: Fits) -> tuple[Fitted, Fits]:
    """The model fitted again, and the best candidate's rivals, from where the best one lies.

    A candidate that has left a valley that the model was stuck in leads all others by it: at
    the trial of seed 1601 by 615 nats, three times what the planted effect gained there.
    """
    order = ranked({c: f.log_likelihood for c, f in found.items()})
    if not order:
        return before, found
    leader, better = order[0], dict(found)
    first = found[leader]
    polished = _polished(case, before, first, leader)
    moved, best_gain = log_gain(before, polished), log_gain(polished, first)
    rivals = [
        c
        for place, c in enumerate(order[1:], start=1)
        if passes(place, rules.LEAD)
        and passes_any(Rival(log_gain(polished, found[c]), best_gain, moved), rules.AGAIN)
    ]
    better |= side_by_side(lambda c: _from_leader(case, before, first, leader, found[c], c), rivals)
    return polished, better


def leader_finished(case: Case, found: Fits, finished: Fits) -> tuple[Fits, Fits]:
    """The best candidate fitted to the end, whatever it promised.

    What another had promised may have been that the model was stuck: beside the model fitted
    again, one that was not finished for it may be the best there is.
    """
    found, finished = dict(found), dict(finished)
    while found:
        leader = ranked({c: f.log_likelihood for c, f in found.items()})[0]
        if leader in finished:
            break
        found[leader] = finished[leader] = settled(case, found[leader])
    return found, finished


def _polished(case: Case, before: Fitted, first: Fitted, leader: str) -> Fitted:
    """The model without the candidate, from where the best candidate lies: was it stuck?"""
    start = _with_sizes_of(case, first.parameters, before, (leader,))
    again = fit_with(case, before.effects, start, before.colours, rounds=2, steps=6)
    return best_of([before, again]) or before


def _from_leader(
    case: Case, before: Fitted, first: Fitted, leader: str, fitted: Fitted, candidate: str
) -> Fitted:
    """A candidate fitted with the coefficients of the leader, and its own size."""
    start = _with_sizes_of(case, first.parameters, before, (leader,))
    start = _with_sizes_of(case, start, fitted, (candidate,))
    return best_of([fitted, refit(case, fitted.effects, [start], first)]) or fitted


def _with_sizes_of(case: Case, p: Array, fitted: Fitted, effects: Sequence[str]) -> Array:
    """Parameters with the sizes of some effects taken from a fit."""
    sized = p.copy()
    own = np.array([i for effect in effects for i in case.positions(effect)], dtype=np.int64)
    sized[own] = fitted.parameters[own]
    return sized
