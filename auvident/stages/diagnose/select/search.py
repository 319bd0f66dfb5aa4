"""Which effects the model lacks: screen, refit, judge, repeat; then exchange and take out.

What is refitted, accepted, taken along, or cannot be told apart, is decided by `rules`. Held-out
maneuvers take no part.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from auvident.errors import NumericsError
from auvident.schema.effects import BY_ID
from auvident.schema.likeness import partners
from auvident.stages.diagnose.fit.case import Case
from auvident.stages.diagnose.fit.fits import Fitted, log_gain, started
from auvident.stages.diagnose.score.first_order import Joint, cosine
from auvident.stages.diagnose.score.left_out import FitsWithout
from auvident.stages.diagnose.select import rules
from auvident.stages.diagnose.select.candidates import Round, Traced, Tried
from auvident.stages.diagnose.select.decisions import (
    left_to_the_motion,
    nuisance_of,
    told_apart_from,
)
from auvident.stages.diagnose.select.held_back import judged_with
from auvident.stages.diagnose.select.instants import with_best_times
from auvident.stages.diagnose.select.reconsider import reconsider
from auvident.stages.diagnose.select.records import Accepted, Afresh, Containing
from auvident.stages.diagnose.select.refitting import NO_FITS, Fits, from_estimates, refitted
from auvident.stages.diagnose.select.rule import passes
from auvident.stages.diagnose.select.screen import screen
from auvident.stages.diagnose.select.telling import Telling
from auvident.stages.diagnose.select.together import Pair, together


@dataclass
class Search:
    """State of a search: the case, the candidates, and what happened."""

    case: Case
    candidates: tuple[str, ...]
    steps: list[str] = field(default_factory=list)
    unclaimed: list[str] = field(default_factory=list)
    put_back: list[str] = field(default_factory=list)  # accepted, and taken out at once
    told: Telling = field(default_factory=Telling)
    without: FitsWithout = field(default_factory=FitsWithout)
    wanting: Callable[[Fitted], bool] = lambda fitted: False  # whether what a model leaves matters

    def trace(self, baseline: Fitted) -> Traced:
        """Search until nothing more is accepted.

        Raises
        ------
        NumericsError
            A prediction diverges close to the model without any effect. Close to one with effects
            the search ends, and these stand.
        """
        current, rounds = baseline, list[Round]()
        while passes(len(current.effects) - len(self.unclaimed), rules.GO_ON):
            try:
                rounds.append(self.one_round(current))
            except NumericsError as error:
                if not rounds:
                    raise
                self.steps.append(f"no further search: with these effects {error.problem}")
                break
            following = self._after(rounds[-1])
            if following is None:
                pair = self._together(rounds[-1])
                if pair is not None:
                    rounds[-1:] = [pair.first, pair.second]
                    following = self._reconsidered(pair.fitted)
            if following is None and (fits := self._afresh(rounds[-1])):
                rounds[-1] = self.one_round(rounds[-1].before, fits)
                following = self._after(rounds[-1])
            if following is None:
                current = rounds[-1].before
                break
            current = following
        steps, unclaimed = tuple(self.steps), tuple(self.unclaimed)
        return Traced(self.case, baseline, current, tuple(rounds), steps, unclaimed, self.without)

    def one_round(self, before: Fitted, fits: Mapping[str, Fitted] = NO_FITS) -> Round:
        """Screen, refit and judge; with fits of some candidates that are there already."""
        self.told.begin(len(self.candidates))
        self.case = started(self.case, before)
        candidates = [c for c in self.candidates if c not in self.put_back]
        before = with_best_times(self.case, before, candidates)
        screened = screen(self.case, before, candidates)
        before, tried = refitted(self.case, before, screened, self.told, fits)
        judged = judged_with(self.case, before, tried, self.told, self.without)
        accepted = next((t for t in judged if t.refusal is None), None)
        alike = alike_of(self.case, screened.joint, candidates, accepted, judged)
        name = accepted.id if accepted else None
        return Round(before, screened.joint, tuple(judged), screened.gains, alike, name)

    def _after(self, done: Round) -> Fitted | None:
        """The model that the search goes on with; None where there is nothing to go on with."""
        accepted = next((t for t in done.tried if t.id == done.accepted), None)
        if accepted is not None:
            self._note(accepted, done.before)
            return self._reconsidered(accepted.fitted)
        weak = weak_of(done, len(self.unclaimed))
        if weak is None:
            return None
        self.unclaimed.append(weak.id)
        self.steps.append(
            f"{weak.id} adjusted along as a nuisance parameter: {weak.gain:.0f} nats, "
            "too small to matter"
        )
        return weak.fitted

    def _together(self, done: Round) -> Pair | None:
        """Two effects that hide each other, written down."""
        pair = together(self.case, done, self.one_round, self.without)
        if pair is not None:
            gain = log_gain(done.before, pair.fitted)
            self.steps.append(f"{' and '.join(pair.effects)} added together: {gain:.0f} nats")
        return pair

    def _afresh(self, done: Round) -> Fits:
        """Fits of candidates from the estimate that leave behind what they came to in a round.

        A model that lacks much may have been bent so far that nothing shows in a small step from
        it: of a rudder that turns twice as well to one side as to the other 7 nats, where 575 come
        from the estimate (even seed 6182).
        """
        if not self.wanting(done.before):
            return {}
        gained = {t.id: max(t.gain, 0.0) for t in done.tried}
        absent = [c for c in self.candidates if c not in (*done.before.effects, *self.put_back)]
        fits = from_estimates(self.case, done.before, absent)
        return {
            c: f
            for c, f in fits.items()
            if passes(Afresh(log_gain(done.before, f), gained.get(c, 0.0)), rules.LEFT_BEHIND)
        }

    def _note(self, accepted: Tried, before: Fitted) -> None:
        """Write down what was added, and whether it is claimed."""
        self.steps.append(f"{accepted.id} added: {accepted.gain:.0f} nats")
        higher_order = BY_ID[accepted.id].higher_order
        if not passes(Accepted(higher_order, accepted.gain, len(before.effects)), rules.CLAIM):
            self.unclaimed.append(accepted.id)

    def _reconsidered(self, current: Fitted) -> Fitted:
        """The model with the effects seen together."""
        newest = current.effects[-1]
        current, steps = reconsider(self.case, self.candidates, current, self.unclaimed)
        self.steps += steps
        if newest not in current.effects:
            self.put_back.append(newest)
        return current


def weak_of(done: Round, unclaimed: int) -> Tried | None:
    """An effect that every vehicle has a little of and that stands before others."""
    judged = [(t.account, t.refusal) for t in done.tried]
    name = nuisance_of(judged, done.before.rms.tolist(), unclaimed)
    return next((t for t in done.tried if t.id == name), None)


def alike_of(
    case: Case,
    joint: Joint,
    candidates: Sequence[str],
    accepted: Tried | None,
    judged: Sequence[Tried],
) -> tuple[str, ...]:
    """The accepted effect with those that explain the data as well; empty without any."""
    if accepted is None:
        return ()
    others = list(told_apart_from(accepted.account, [t.account for t in judged]))
    rivals = [t.account for t in judged if as_one_to_sensors(case, accepted.id, t.id)]
    others += [c for c in left_to_the_motion(accepted.account, rivals) if c not in others]
    others += [c for c in containing(joint, candidates, accepted.id) if c not in others]
    return (accepted.id, *others) if others else ()


def as_one_to_sensors(case: Case, effect: str, other: str) -> bool:
    """Whether sensors held against each other cannot tell two effects apart."""
    ones = [
        {name.partition(".")[0] for name in check.one_of if name in check.names}
        for check in case.checks
    ]
    return effect != other and any({effect, other} <= one for one in ones)


def containing(joint: Joint, candidates: Sequence[str], effect: str) -> list[str]:
    """Effects of which one is a special case, so that they fit whatever it fits."""
    own, found = joint.case.positions(effect), []
    for other in (c for c in partners(effect) if c in candidates):
        positions = joint.case.positions(other)
        further = len(positions) - len(own)
        if passes(Containing(further, cosine(joint, own, positions)), rules.CONTAIN):
            found.append(other)
    return found
