"""The screen: what each effect would bring to first order, and which are worth a refit."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from auvident.errors import NumericsError
from auvident.parallel import each
from auvident.schema.likeness import partners
from auvident.stages.diagnose.fit.case import Case
from auvident.stages.diagnose.fit.fits import Fitted
from auvident.stages.diagnose.score.first_order import (
    Joint,
    Score,
    cosines,
    joint_about,
    score,
    score_from,
)
from auvident.stages.diagnose.select import rules
from auvident.stages.diagnose.select.candidates import ranked, steady
from auvident.stages.diagnose.select.records import Apart, Screened
from auvident.stages.diagnose.select.rule import Rule, passes
from auvident.stages.diagnose.select.starts import at_typical_size, is_limit

Shares = Mapping[frozenset[str], float]

FAST_GAIN = np.array([0.1, 0.1, 0.1, 0.0])  # observer gain of the screen for what is fast


@dataclass(frozen=True)
class Screen:
    """First-order scores of all candidates about a model, and the short list, best first.

    ``shares``: of what one candidate gains, the share that another would gain as its by-product.
    """

    joint: Joint
    scores: dict[str, Score]
    short: tuple[str, ...]
    typical: dict[str, Score] = field(default_factory=dict)  # from a size that is not none
    shares: Shares = field(default_factory=dict)

    @property
    def gains(self) -> dict[str, float]:
        """To first order [nats], by candidate."""
        return {c: s.gain for c, s in self.scores.items()}

    def by_others(self, gains: Mapping[str, float]) -> dict[str, float]:
        """Of what each candidate gains, the most that it would as the by-product of another."""
        return by_others(self.shares, gains)

    @property
    def apart(self) -> list[str]:
        """Candidates of which no other may explain what they gain to first order."""
        return apart(self.gains, self.by_others(self.gains))

    @property
    def ceiling(self) -> float:
        """Half the squared error at which the start of a fit is lost."""
        return rules.LOST * self.joint.half


def screen(case: Case, before: Fitted, candidates: Sequence[str]) -> Screen:
    """Score the candidates that a model does not have.

    Raises
    ------
    NumericsError
        If the simulation runs away close to the fitted model.
    """
    joint = joint_about(case, before, candidates)
    if joint is None:
        raise NumericsError(
            "a prediction diverges as soon as the fitted model is changed a little",
            ", ".join(record.id for record in case.records),
            "Look at what `auvident ingest` says of the channels: one that never changes (a v that "
            "is filled up with zeros) bends the model until it does.",
        )
    fast = joint_about(case, before, candidates, FAST_GAIN)
    absent = [c for c in candidates if c not in before.effects]
    pairs = dict(zip(absent, each(lambda c: _scores(joint, c), absent), strict=True))
    scores = {c: max(pair, key=lambda s: s.gain) for c, pair in pairs.items()}
    typical = {c: pair[1] for c, pair in pairs.items() if len(pair) > 1}
    quick = {c: score(fast, (c,)).gain for c in absent} if fast else {}
    gains = {c: s.gain for c, s in scores.items()}
    limits = filter(is_limit, absent)  # of which a score knows nothing
    shares = shares_of(joint, absent)
    short = [*short_list(gains, quick), *apart(gains, by_others(shares, gains)), *limits]
    return Screen(joint, scores, tuple(dict.fromkeys(short)), typical, shares)


def shares_of(joint: Joint, candidates: Sequence[str]) -> Shares:
    """Of what one candidate gains, the share that another would gain as its by-product.

    The square of the cosine of their signatures. Of a limit none is known: it may stand for
    anything.
    """
    return {
        pair: 1.0 if any(is_limit(c) for c in pair) else value**2
        for pair, value in cosines(joint, candidates).items()
    }


def by_others(shares: Shares, gains: Mapping[str, float]) -> dict[str, float]:
    """Of what each candidate gains, the most that it would as the by-product of another [nats]."""

    def of(candidate: str, other: str) -> float:
        return shares.get(frozenset((candidate, other)), 1.0) * gains[other]

    return {c: max((of(c, o) for o in gains if o != c), default=0.0) for c in gains}


def apart(gains: Mapping[str, float], others: Mapping[str, float]) -> list[str]:
    """Candidates of which no other may explain what they gain."""
    return [c for c in gains if passes(Apart(gains[c], others[c]), rules.SCREEN_APART)]


def _scores(joint: Joint, candidate: str) -> list[Score]:
    """From nothing, and for some from a typical size."""
    there = at_typical_size(joint.case, joint.fitted, candidate)
    typical = None if there is None else score_from(joint, candidate, there)
    here = score(joint, (candidate,))
    return [here] if typical is None else [here, typical]


def short_list(gains: dict[str, float], quick: dict[str, float]) -> tuple[str, ...]:
    """Candidates to be refitted, with those that look like the best of them.

    Parameters
    ----------
    gains, quick : dict of str to float
        To first order [nats], by candidate: as they are, and of what is fast.
    """
    short = [*_listed(gains, rules.SCREEN), *_listed(quick, rules.SCREEN_FAST)]
    leading = [c for k, c in enumerate(short) if passes(Screened(c, 0.0, k), rules.ACCOMPANY)]
    like = [other for c in leading for other in partners(c)]
    like += [other for c in short for other in steady(c)]
    return tuple(dict.fromkeys([*short, *(c for c in like if c in gains)]))


def _listed(gains: dict[str, float], asked: Sequence[Rule[Screened]]) -> list[str]:
    """Candidates that a list takes, best first."""
    places = enumerate(ranked(gains))
    return [c for place, c in places if passes(Screened(c, gains[c], place), asked)]
