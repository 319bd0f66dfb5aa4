"""The screen: what each effect would bring to first order, and which are worth a refit."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from auvident.parallel import each
from auvident.schema.likeness import partners
from auvident.stages.diagnose.fit.case import Case
from auvident.stages.diagnose.fit.fits import Fitted
from auvident.stages.diagnose.score.first_order import (
    Joint,
    Score,
    cosine,
    joint_about,
    score,
    score_from,
)
from auvident.stages.diagnose.select import rules
from auvident.stages.diagnose.select.candidates import ranked, steady
from auvident.stages.diagnose.select.records import Screened
from auvident.stages.diagnose.select.rule import Rule, passes
from auvident.stages.diagnose.select.starts import at_typical_size, is_limit

FAST_GAIN = np.array([0.1, 0.1, 0.1, 0.0])  # observer gain of the screen for what is fast


@dataclass(frozen=True)
class Screen:
    """First-order scores of all candidates about a model, and the short list, best first."""

    joint: Joint
    scores: dict[str, Score]
    short: tuple[str, ...]
    typical: dict[str, Score] = field(default_factory=dict)  # from a size that is not none

    @property
    def gains(self) -> dict[str, float]:
        """To first order [nats], by candidate."""
        return {c: s.gain for c, s in self.scores.items()}

    def by_others(self, gains: Mapping[str, float]) -> dict[str, float]:
        """Of what each candidate gains, the most that it would as the by-product of another.

        An effect that is there lets another gain its own gain times the square of their cosine. Of
        a limit no signature is known, so that it may stand for anything.

        Parameters
        ----------
        gains : mapping of str to float
            By candidate [nats].
        """
        case = self.joint.case

        def share(one: str, other: str) -> float:
            if is_limit(one) or is_limit(other):
                return 1.0
            return cosine(self.joint, case.positions(one), case.positions(other)) ** 2

        pairs = {frozenset(p): share(*p) for p in combinations(gains, 2)}
        return {
            c: max((pairs[frozenset((c, o))] * gains[o] for o in gains if o != c), default=0.0)
            for c in gains
        }

    @property
    def ceiling(self) -> float:
        """Half the squared error at which the start of a fit is lost."""
        return rules.LOST * self.joint.half


def screen(case: Case, before: Fitted, candidates: Sequence[str]) -> Screen:
    """Score the candidates that a model does not have."""
    joint = joint_about(case, before, candidates)
    assert joint is not None  # the fit itself ran through
    fast = joint_about(case, before, candidates, FAST_GAIN)
    absent = [c for c in candidates if c not in before.effects]
    pairs = dict(zip(absent, each(lambda c: _scores(joint, c), absent), strict=True))
    scores = {c: max(pair, key=lambda s: s.gain) for c, pair in pairs.items()}
    typical = {c: pair[1] for c, pair in pairs.items() if len(pair) > 1}
    quick = {c: score(fast, (c,)).gain for c in absent} if fast else {}
    gains = {c: s.gain for c, s in scores.items()}
    limits = filter(is_limit, absent)  # of which a score knows nothing
    short = tuple(dict.fromkeys([*short_list(gains, quick), *limits]))
    return Screen(joint, scores, short, typical)


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
