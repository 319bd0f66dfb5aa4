"""Which effects the model lacks: screen, refit, test, repeat; then remove and swap.

A named effect is accepted when it is large enough to matter, makes the residual of some channel
clearly smaller, and helps maneuvers that were left out; likelihood alone accepts nothing, since
any model is wrong in small ways that a long record shows. Held-out maneuvers take no part.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.special import chdtrc

from auvident.errors import NumericsError
from auvident.schema.effects import BY_ID
from auvident.schema.likeness import partners
from auvident.stages.diagnose import thrust_time
from auvident.stages.diagnose.candidates import (
    Round,
    Traced,
    Tried,
    at_bound,
    ranked,
    scores_of,
    size_of,
    steady,
    unhelpful,
    worth,
)
from auvident.stages.diagnose.case import CHANNELS, Case
from auvident.stages.diagnose.fits import (
    Fitted,
    check_cost,
    first_colours,
    fit_with,
    log_gain,
    residual_of,
)
from auvident.stages.diagnose.joint import (
    Joint,
    cosine,
    joint_about,
    score,
    score_from,
)
from auvident.stages.diagnose.leftout import Helped, LeftOut, helped, leave_out
from auvident.stages.diagnose.reconsider import reconsider
from auvident.stages.diagnose.refits import (
    best_of,
    from_estimate,
    holding,
    nested,
    refit,
    settled,
)

Array = npt.NDArray[Any]

MOST_EFFECTS = 4
SCREENED, SCREENED_FAST, REFITTED = 7, 4, 4  # of the short lists, and refitted to the end
FAST_GAIN = np.array([0.1, 0.1, 0.1, 0.0])  # observer gain of the screen for what is fast
LEAST_GAIN = 100.0  # [nats]
HOPELESS = 0.3  # a candidate with less than this share of the best one's gain is not finished
OF_BEST = 0.5  # a candidate must gain this share of the best one's
# Of the rms of some channel. Planted effects made it fall by 0.29 and more, what a model of a
# healthy vehicle lacks by 0.14 at most (50 generated trials, seeds 1000 to 1049).
LEAST_FALL = 0.2
CHECK_GAIN = 12.0  # [nats] a sensor check that is reconciled counts as a channel
SIMPLER = 0.04  # an effect with fewer parameters may gain this share less
ALIKE = 0.12  # effects that gain all but this share of the best are not told apart
ALIKE_LEAST = 12.0  # [nats] nor those within this
RMS_ALIKE = 1.15  # ... and leave no residual larger by more
CONTAINS = 0.98  # cosine from which on an effect is a special case of another with more parameters
MOST_QUIET = 2  # effects taken along without a claim
SMALL = "smaller than of practical interest"
NO_FALL = f"no residual falls by {100 * LEAST_FALL:.0f} %"
# [nats] from which on a term of higher order that comes first is claimed
CLAIMED_FROM = 300.0
LEAST_RECORDS = 2  # maneuvers without which none can be left out
# [nats] by which a model has to be the better one, for others to be fitted again: where it was not
# stuck it came out better by 0 to 10 (seed 1601), where it was by 615
STUCK = 20.0
WORTH_A_START = 30.0  # [nats] to be fitted from a second start as well
SECOND_STARTS = 2  # so many of the best are fitted from the analytical estimate as well


@dataclass
class Search:
    """State of a search: the case, the candidates, the random numbers, and what happened."""

    case: Case
    candidates: tuple[str, ...]
    rng: np.random.Generator
    steps: list[str] = field(default_factory=list)
    quiet: list[str] = field(default_factory=list)

    def baseline(self) -> Fitted:
        """Best fit without any effect, from the identified model and from the estimate."""
        case, found = self.case, []
        for start in (case.identified, case.setup.prior):
            p = case.at_rest(start)
            fitted = fit_with(case, (), p, first_colours(case, p), rounds=3, steps=12)
            found += [fitted] if fitted is not None else []
        if not found:
            raise NumericsError(
                "the prediction runs away in a maneuver that identifies, with the identified "
                "coefficients and with the estimate", self._where(),
                "Hold that maneuver out, or look at its log.",
            )  # fmt: skip
        return max(found, key=lambda f: f.log_likelihood)

    def _where(self) -> str:
        """Maneuvers in which the identified model runs away."""
        case, found = self.case, []
        colours = first_colours(case, case.identified)
        for record in case.records:
            if residual_of(case, case.identified, record, colours) is None:
                found.append(record.id)
        return ", ".join(found)

    def trace(self, baseline: Fitted) -> Traced:
        """Search until nothing more is accepted."""
        current, rounds = baseline, []
        while len(current.effects) - len(self.quiet) < MOST_EFFECTS:
            done, current = self.one_round(current)
            rounds.append(done)
            if done.accepted is None:
                weak = self._weak(done)
                if weak is None:
                    break
                self.quiet.append(weak.id)
                self.steps.append(
                    f"{weak.id} taken along: {weak.gain:.0f} nats, too small to matter"
                )
                current = weak.fitted
            else:
                current, steps = reconsider(self.case, self.candidates, current, self.quiet)
                self.steps += steps
        return Traced(
            self.case, baseline, current, tuple(rounds), tuple(self.steps), tuple(self.quiet)
        )

    def _weak(self, done: Round) -> Tried | None:
        """An effect that every model is short of a little and that hides others behind it."""
        first = done.tried[0] if done.tried else None
        if first is None or first.gain < LEAST_GAIN or len(self.quiet) >= MOST_QUIET:
            return None
        hidden = any(t.gain > LEAST_GAIN for t in done.tried[1:])
        worse = np.any(first.fitted.rms > RMS_ALIKE * done.before.rms)
        quiet = hidden and not worse and first.refused in (SMALL, NO_FALL)
        return first if quiet else None

    def one_round(self, before: Fitted) -> tuple[Round, Fitted]:
        """Screen, refit and test; the model with the accepted effect, or as it was."""
        if thrust_time.STEP in self.candidates:
            before = thrust_time.with_best_time(self.case, before)
        joint = joint_about(self.case, before, self.candidates)
        assert joint is not None  # the fit itself ran through
        fast = joint_about(self.case, before, self.candidates, FAST_GAIN)
        open_ids = [c for c in self.candidates if c not in before.effects]
        scores = {c: self._score(joint, c) for c in open_ids}
        quick = {c: score(fast, (c,)).gain for c in open_ids} if fast else {}
        short = worth(scores_of(scores))[:SCREENED] + worth(quick)[:SCREENED_FAST]
        like = [c for first in short[:2] for c in partners(first)]
        like += [c for any_ in short for c in steady(any_)]
        short += [c for c in like if c in open_ids]
        tried, before = self._tried(before, list(dict.fromkeys(short)), scores)
        judged, accepted = self._judge(before, tried)
        screened = {c: s[0] for c, s in scores.items()}
        alike = self._alike(joint, accepted, judged) if accepted else ()
        name = accepted.id if accepted else None
        done = Round(before, joint, tuple(judged), screened, alike, name)
        if accepted is None:
            return done, before
        self.steps.append(f"{accepted.id} added: {accepted.gain:.0f} nats")
        if BY_ID[accepted.id].higher_order and (before.effects or accepted.gain < CLAIMED_FROM):
            self.quiet.append(accepted.id)
        return done, accepted.fitted

    def _score(self, joint: Joint, candidate: str) -> tuple[float, Array]:
        usual = self._at_usual_size(joint.fitted, candidate)
        found = score(joint, (candidate,)) if usual is None else score_from(joint, candidate, usual)
        return found.gain, found.parameters

    def _tried(
        self, before: Fitted, short: list[str], scores: dict[str, tuple[float, Array]]
    ) -> tuple[list[Tried], Fitted]:
        """Refits of the short list, the best of them to the end and from a second start."""
        found = {c: self._first_refit(before, c, scores[c][1]) for c in short}
        # a fit that is not there yet may still become what the first-order step promises
        promise = {c: max(log_gain(before, f), scores[c][0]) for c, f in found.items()}
        order = ranked(promise)
        alike = [c for leading in order[:REFITTED] for c in steady(leading)]
        finished: set[str] = set()
        for number, c in enumerate(order):
            hopeless = number >= REFITTED or promise[c] < HOPELESS * promise[order[0]]
            rival = log_gain(before, found[c]) > OF_BEST * _best_gain(before, found, finished)
            if c in alike or not hopeless or rival:
                afresh = c in alike or number < SECOND_STARTS
                found[c] = self._last_refit(found[c], afresh and promise[order[0]] > WORTH_A_START)
                finished.add(c)
        before, found = self._unstuck(before, found)
        found = {c: nested(self.case, before, f) for c, f in found.items()}
        tried = [
            Tried(c, f, log_gain(before, f), self._falls(before, f), settled=c in finished,
                  promise=promise[c])
            for c, f in found.items()
        ]  # fmt: skip
        return sorted(tried, key=lambda t: -t.gain), before

    def _first_refit(self, before: Fitted, candidate: str, scored: Array) -> Fitted:
        """A few steps from where the first-order step leads, and from the usual size."""
        effects, usual = (*before.effects, candidate), self._at_usual_size(before, candidate)
        starts = [scored] if usual is None else [scored, usual]
        found = refit(self.case, effects, starts, before, 1, 5)
        return nested(self.case, before, found or holding(self.case, before, effects))

    def _last_refit(self, fitted: Fitted, afresh: bool) -> Fitted:
        """To the end, and if asked for from the analytical estimate as well."""
        options: list[Fitted | None] = [settled(self.case, fitted)]
        if afresh:
            options.append(from_estimate(self.case, fitted.effects, fitted.parameters))
        return best_of(options) or fitted

    def _at_usual_size(self, before: Fitted, candidate: str) -> Array | None:
        """The model with an effect at its usual size, for those that act in no straight line.

        What the sensors say about each other is the size where they say something.
        """
        p, known = before.parameters.copy(), {
            name: float(mean) for c in self.case.checks
            for name, mean in zip(c.names, c.mean, strict=True)
        }  # fmt: skip
        positions = self.case.positions(candidate)
        names = [self.case.names[i] for i in positions]
        if not BY_ID[candidate].curved and not any(name in known for name in names):
            return None
        for i, name in zip(positions, names, strict=True):
            p[i] = known.get(name, float(self.case.setup.prior_std[i]))
        return p

    def _polished(self, before: Fitted, found: dict[str, Fitted]) -> Fitted:
        """The model without the candidate, from where the best candidate lies: was it stuck?"""
        best = ranked(_likelihoods(found))[:1]
        for c in best:
            start = found[c].parameters.copy()
            own = self.case.positions(c)
            start[own] = before.parameters[own]
            again = fit_with(self.case, before.effects, start, before.colours, rounds=2, steps=6)
            if again is not None and again.log_likelihood > before.log_likelihood:
                before = again
        return before

    def _unstuck(
        self, before: Fitted, found: dict[str, Fitted]
    ) -> tuple[Fitted, dict[str, Fitted]]:
        """The model polished, and the best candidate's rivals fitted from where it lies.

        A candidate that has left a valley that the model was stuck in leads all others by it: at
        the trial of seed 1601 by 615 nats, three times what the planted effect gained there.
        """
        polished, order = self._polished(before, found), ranked(_likelihoods(found))
        if not order:
            return polished, found
        first, better = found[order[0]], dict(found)
        stuck = log_gain(before, polished) > STUCK
        for c in order[1:REFITTED]:
            rival = log_gain(polished, found[c]) > OF_BEST * log_gain(polished, first)
            if stuck or rival:
                start = first.parameters.copy()
                for own, kept in ((order[0], before), (c, found[c])):
                    at = self.case.positions(own)
                    start[at] = kept.parameters[at]
                again = refit(self.case, found[c].effects, [start], first)
                better[c] = best_of([found[c], again]) or found[c]
        return polished, better

    def _falls(self, before: Fitted, after: Fitted) -> dict[str, float]:
        falls = 1.0 - after.rms / before.rms
        found = {name: float(fall) for name, fall in zip(CHANNELS, falls, strict=True)}
        gained = check_cost(self.case, before.parameters) - check_cost(self.case, after.parameters)
        if gained > CHECK_GAIN:
            found["sensors"] = 1.0 - float(np.sqrt(
                check_cost(self.case, after.parameters) / check_cost(self.case, before.parameters)
            ))  # fmt: skip
        return found

    def _judge(self, before: Fitted, tried: list[Tried]) -> tuple[list[Tried], Tried | None]:
        """Test the candidates in the order of their gain; the first that passes is accepted."""
        judged: list[Tried] = []
        accepted, reference = None, None
        least = max([LEAST_GAIN, *(OF_BEST * t.gain for t in tried[:1])])
        for t in tried:
            refused = self._refusal(before, t, least)
            if not refused and len(self.case.records) < LEAST_RECORDS:
                refused = "there is no other maneuver to try it on"
            if not refused and accepted is None:
                reference = reference or leave_out(self.case, before, t.fitted.colours)
                own = leave_out(self.case, t.fitted, t.fitted.colours)
                t = replace(t, helped=self._helped(before, reference, own, t))
                refused = unhelpful(t.helped)
            elif not refused:
                refused = "another gains more"
            t = replace(t, refused=refused)
            if not refused:
                accepted = t
            judged.append(t)
        simpler = self._simpler(judged, accepted)
        if simpler is not None and accepted is not None and simpler.id != accepted.id:
            judged = [
                replace(t, refused="") if t.id == simpler.id
                else replace(t, refused=f"{simpler.id} does as well with less")
                if t.id == accepted.id else t
                for t in judged
            ]  # fmt: skip
            accepted = simpler
        return judged, accepted

    def _helped(self, before: Fitted, reference: LeftOut, own: LeftOut, t: Tried) -> Helped:
        """What an effect brings to maneuvers left out; p is that of one among all candidates."""
        found = helped(reference, own, self.rng)
        checked = check_cost(self.case, before.parameters) - check_cost(
            self.case, t.fitted.parameters
        )
        if checked > CHECK_GAIN:  # what the sensors say needs no maneuver
            by_sensors = float(chdtrc(len(self.case.positions(t.id)), 2.0 * checked))
            found = Helped(
                found.gain + checked, max(found.share, 1.0), found.low + checked,
                p=2.0 * min(by_sensors, found.p),
            )  # fmt: skip
        return replace(found, p=min(1.0, len(self.candidates) * found.p))

    def _refusal(self, before: Fitted, t: Tried, least: float) -> str:
        if not t.settled:
            return f"promises {t.promise:.0f} nats, too few beside the best to be fitted to the end"
        if t.gain < LEAST_GAIN:
            return f"gains {t.gain:.0f} nats, less than {LEAST_GAIN:.0f}"
        if t.gain < least:
            return "gains less than half of the best one"
        if size_of(self.case, t.id, t.fitted.parameters) < 1.0:
            return SMALL
        if max(t.falls.values()) < LEAST_FALL:
            return NO_FALL
        if at_bound(self.case, t.id, t.fitted.parameters):
            return "at the bound of what is plausible"
        return ""

    def _simpler(self, judged: list[Tried], accepted: Tried | None) -> Tried | None:
        """A candidate with fewer parameters that gains nearly as much."""
        if accepted is None:
            return None
        own = len(self.case.positions(accepted.id))
        least = accepted.gain - max(SIMPLER * accepted.gain, 4.0)
        for t in judged:
            fewer = len(self.case.positions(t.id)) < own
            if fewer and t.gain >= least and not self._refusal(t.fitted, t, 0.0):
                return t
        return None

    def _alike(self, joint: Joint, accepted: Tried, judged: list[Tried]) -> tuple[str, ...]:
        """Candidates that explain the data as well as the accepted one."""
        least = accepted.gain - max(ALIKE * accepted.gain, ALIKE_LEAST)
        others = [
            t.id for t in judged
            if t.id != accepted.id and t.gain >= least
            and size_of(self.case, t.id, t.fitted.parameters) >= 1.0
            and np.all(t.fitted.rms <= RMS_ALIKE * accepted.fitted.rms)
        ]  # fmt: skip
        others += [c for c in self._containing(joint, accepted.id) if c not in others]
        return (accepted.id, *others) if others else ()

    def _containing(self, joint: Joint, effect: str) -> list[str]:
        """Effects of which one is a special case, so that they fit whatever it fits."""
        own = self.case.positions(effect)
        return [
            c for c in partners(effect)
            if c in self.candidates and len(self.case.positions(c)) > len(own)
            and cosine(joint, own, self.case.positions(c)) > CONTAINS
        ]  # fmt: skip


def _best_gain(before: Fitted, found: dict[str, Fitted], among: set[str]) -> float:
    """Largest gain of some candidates [nats]; what is worth no refit where there is none."""
    return max([LEAST_GAIN, *(log_gain(before, found[c]) for c in among)])


def _likelihoods(found: dict[str, Fitted]) -> dict[str, float]:
    return {c: f.log_likelihood for c, f in found.items()}
