"""What a search does with candidates: in valleys of their own, and from round to round."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvident.errors import NumericsError
from auvident.stages.diagnose.fit.fits import Fitted, log_gain
from auvident.stages.diagnose.score.first_order import Score
from auvident.stages.diagnose.score.left_out import FitsWithout
from auvident.stages.diagnose.select import held_back, refitting, search
from auvident.stages.diagnose.select.candidates import Traced, Tried
from auvident.stages.diagnose.select.healthy import strength
from auvident.stages.diagnose.select.rule import Refusal
from auvident.stages.diagnose.select.rules import STUCK
from auvident.stages.diagnose.select.screen import Screen
from auvident.stages.diagnose.select.search import Search
from auvident.stages.diagnose.select.starts import Begin
from auvident.stages.diagnose.select.together import Pair
from tests.stages.diagnose.select.test_rules import GOOD

PLACES = {"a": [2], "b": [3], "c": [4]}  # behind two coefficients
SEEN_AS_ONE = ("gyro_bias.bias_degps", "gyro_scale.fraction")


@dataclass(frozen=True)
class Places:
    """As much of a case as is asked for."""

    checks = (SimpleNamespace(names=SEEN_AS_ONE, one_of=SEEN_AS_ONE),)

    def positions(self, effect: str) -> list[int]:
        return PLACES[effect]


CASE: Any = Places()


def fitted(likelihood: float, *values: float, effects: tuple[str, ...] = ()) -> Fitted:
    return Fitted(
        np.array(values),
        np.arange(0),
        (),
        likelihood,
        effects=effects,
        residuals=(),
        rms=np.ones(3),
    )


BEFORE = fitted(0.0, 1.0, 1.0, 0.0, 0.0, 0.0)
FOUND = {
    "a": fitted(700.0, 5.0, 6.0, 2.0, 0.0, 0.0, effects=("a",)),
    "b": fitted(400.0, 1.1, 1.2, 0.0, 3.0, 0.0, effects=("b",)),
    "c": fitted(30.0, 1.0, 1.1, 0.0, 0.0, 4.0, effects=("c",)),
}


def unstuck(monkeypatch: pytest.MonkeyPatch, polished: float) -> tuple[dict, list[Any]]:
    """Candidates as they leave, and where their fits began; each of them gains 50."""
    starts: list[Any] = []

    def again(case, effects, start, like) -> Fitted:
        starts.append((effects, start[0].tolist()))
        gained = FOUND[effects[-1]].log_likelihood + 50.0
        return fitted(gained, *start[0], effects=effects)

    def model(case, effects, start, colours, **_) -> Fitted:
        assert start.tolist() == [5.0, 6.0, 0.0, 0.0, 0.0]  # where the best lies, without it
        return fitted(polished, 4.0, 5.0, 0.0, 0.0, 0.0)

    monkeypatch.setattr(refitting, "refit", again)
    monkeypatch.setattr(refitting, "fit_with", model)
    return refitting.unstuck(CASE, BEFORE, dict(FOUND))[1], starts


def test_a_rival_is_fitted_from_where_the_best_candidate_lies(monkeypatch) -> None:
    found, starts = unstuck(monkeypatch, polished=STUCK - 1.0)
    # the coefficients of the best, its own effect off, the size that the rival had
    assert starts == [(("b",), [5.0, 6.0, 0.0, 3.0, 0.0])]
    assert found["b"].log_likelihood == 450.0
    assert found["a"] is FOUND["a"] and found["c"] is FOUND["c"]


def test_beside_a_model_that_was_stuck_all_that_lead_are_fitted_again(monkeypatch) -> None:
    found, starts = unstuck(monkeypatch, polished=STUCK + 1.0)
    assert [effects for effects, _ in starts] == [("b",), ("c",)]
    assert found["c"].log_likelihood == 80.0


@pytest.mark.parametrize("gained", [None, -3.0, 3.0])
@pytest.mark.parametrize("unseen", [True, False])
def test_only_a_limit_that_is_reached_is_dropped_where_it_explains_nothing(
    monkeypatch, gained, unseen
) -> None:
    found = None if gained is None else fitted(gained, *[0.0] * 5, effects=("a",))
    monkeypatch.setattr(refitting, "refit", lambda *_: found)
    monkeypatch.setattr(refitting, "nested", lambda case, before, fit: fit)
    monkeypatch.setattr(refitting, "holding", lambda case, before, effects: BEFORE)
    begin = Begin(BEFORE.parameters, 10.0, unseen)
    begun = refitting.begun(CASE, BEFORE, {"a": [begin]}, np.inf)
    dropped = unseen and gained != 3.0
    assert begun.get("a") is (None if dropped else found or BEFORE)


def test_a_worse_fit_is_not_taken(monkeypatch) -> None:
    close = {**FOUND, "b": fitted(690.0, 1.1, 1.2, 0.0, 3.0, 0.0, effects=("b",))}

    def worse(case, effects, start, like) -> Fitted:
        return fitted(1.0, *start[0], effects=effects)

    monkeypatch.setattr(refitting, "refit", worse)
    monkeypatch.setattr(refitting, "fit_with", lambda *_, **__: fitted(-1.0, *[0.0] * 5))
    before, found = refitting.unstuck(CASE, BEFORE, close)
    assert before is BEFORE and found["b"] is close["b"]


def test_the_short_list_is_fitted_to_the_end_and_held_against_the_polished_model(
    monkeypatch,
) -> None:
    """Each step of it shows in what is told of the candidates."""
    gained = {"end": 40.0, "nested": 3.0}  # of every fit, by each of these steps

    def more(fit: Fitted, step: str) -> Fitted:
        return replace(fit, log_likelihood=fit.log_likelihood + gained[step])

    polished = fitted(100.0, 1.0, 1.0, 0.0, 0.0, 0.0)
    score = Score(20.0, BEFORE.parameters)
    joint: Any = SimpleNamespace(half=100.0)
    screened = Screen(joint, dict.fromkeys(FOUND, score), tuple(FOUND))
    monkeypatch.setattr(refitting, "first_steps", lambda *_: FOUND)
    monkeypatch.setattr(refitting, "to_the_end", lambda case, fit, afresh: more(fit, "end"))
    monkeypatch.setattr(refitting, "unstuck", lambda case, before, found: (polished, found))
    monkeypatch.setattr(refitting, "nested", lambda case, before, fit: more(fit, "nested"))
    monkeypatch.setattr(refitting, "steady", lambda effect: ())
    monkeypatch.setattr(Screen, "by_others", lambda self, gains: dict.fromkeys(gains, 600.0))
    told: dict[str, tuple[float, ...]] = {}

    def account_of(case, before, fit, others, settled, promise):
        told[fit.effects[-1]] = (log_gain(before, fit), others, settled, promise)
        return replace(GOOD, id=fit.effects[-1], gain=log_gain(before, fit))

    monkeypatch.setattr(refitting, "account_of", account_of)
    before, tried = refitting.refitted(CASE, BEFORE, screened)
    assert before is polished and [t.id for t in tried] == ["a", "b", "c"]
    assert told == {
        "a": (643.0, 600.0, True, 700.0),
        "b": (343.0, 600.0, True, 400.0),
        "c": (-67.0, 600.0, False, 30.0),  # hopeless, and not finished
    }


# --- from round to round -------------------------------------------------------------------

HIGHER = "sway_cross_flow"  # a term of higher order
Round = dict[str, dict[str, Any]]  # by candidate what its account has


TIMED = np.full(3, 1.25)  # residual of a model whose times were looked for
CONTAINED = {"rudder_offset": ["hull_asymmetry"]}
LOST = ("gyro_scale", "roll_coupling")  # for the first of these the second is put in


def seen_together(
    case: Any, candidates: Any, current: Fitted, unclaimed: Any
) -> tuple[Fitted, list[str]]:
    """An exchange of one effect for another; the others stay."""
    swapped = tuple(LOST[1] if e == LOST[0] else e for e in current.effects)
    return replace(current, effects=swapped), ["swapped"] * (swapped != current.effects)


def traced(
    monkeypatch: pytest.MonkeyPatch,
    *rounds: Round,
    wanting: bool = False,
    far: float = 0.0,
    screening: Callable[..., Screen] = lambda *_: Screen(None, {}, ()),  # type: ignore[arg-type]
) -> Traced:
    """A search in which each round finds what it is told, and nothing more after the last.

    `far` is what a current gains from the estimate, which the next round is told of.
    """
    left = list(rounds)

    def estimates(case: Any, before: Fitted, candidates: Any) -> dict[str, Fitted]:
        return {"current": fitted(far, *[0.0] * 5, effects=(*before.effects, "current"))}

    def refits(
        case: Any, before: Fitted, screened: Any, told: Any, fits: Any
    ) -> tuple[Fitted, list[Tried]]:
        found = [
            Tried(fit, replace(GOOD, id=c, gain=fit.log_likelihood)) for c, fit in fits.items()
        ]
        for name, update in (left.pop(0) if left else {}).items():
            own = fitted(before.log_likelihood, *[0.0] * 5, effects=(*before.effects, name))
            account = replace(GOOD, id=name, helped=None, rms=(1.0, 1.0, 1.0), **update)
            found.append(Tried(own, account))
        return before, found

    monkeypatch.setattr(search, "started", lambda case, fit: case)
    monkeypatch.setattr(search, "with_best_times", lambda case, fit, c: replace(fit, rms=TIMED))
    monkeypatch.setattr(search, "screen", screening)
    monkeypatch.setattr(search, "refitted", refits)
    monkeypatch.setattr(search, "containing", lambda joint, c, effect: CONTAINED.get(effect, []))
    monkeypatch.setattr(search, "reconsider", seen_together)
    monkeypatch.setattr(FitsWithout, "of", lambda *_: None)
    for name in ("seen_with", "noise_floor"):
        monkeypatch.setattr(held_back, name, lambda *_: None)
    for name in ("check_cost", "log_gain"):
        monkeypatch.setattr(held_back, name, lambda *_: 0.0)
    monkeypatch.setattr(held_back, "helped", lambda *_: GOOD.helped)
    monkeypatch.setattr(search, "from_estimates", estimates)
    own = Search(CASE, ("a", "b", "c"), wanting=lambda model: wanting)
    return own.trace(BEFORE)


def refusals(found: Traced, number: int = 0) -> dict[str, str]:
    return {t.id: t.refusal.code if t.refusal else "" for t in found.rounds[number].tried}


def test_what_is_accepted_joins_the_model_until_nothing_is(monkeypatch) -> None:
    found = traced(monkeypatch, {"current": {}}, {"gyro_bias": {}})
    assert found.named == found.final.effects == ("current", "gyro_bias")
    assert found.steps == ("current added: 800 nats", "gyro_bias added: 800 nats")
    assert [r.accepted for r in found.rounds] == ["current", "gyro_bias", None]
    helped = found.rounds[0].tried[0].account.helped
    assert helped is not None and helped.strength == strength(GOOD.helped)


def test_what_was_found_stands_where_the_model_with_it_is_none_to_search_from(monkeypatch) -> None:
    def lost(*with_: str) -> Callable[..., Screen]:
        def screening(case: Any, before: Fitted, candidates: Any) -> Screen:
            if before.effects == with_:
                raise NumericsError("a prediction diverges")
            return Screen(None, {}, ())  # type: ignore[arg-type]

        return screening

    found = traced(monkeypatch, {"current": {}}, {"gyro_bias": {}}, screening=lost("current"))
    assert found.named == found.final.effects == ("current",)
    told = "no further search: with these effects a prediction diverges"
    assert found.steps == ("current added: 800 nats", told)
    assert len(found.rounds) == 1
    with pytest.raises(NumericsError, match="a prediction diverges"):
        traced(monkeypatch, {"current": {}}, screening=lost())


def test_effects_are_seen_together_after_each_that_is_accepted(monkeypatch) -> None:
    found = traced(monkeypatch, {LOST[0]: {}}, {"current": {}})
    assert found.final.effects == (LOST[1], "current")
    assert found.steps == (f"{LOST[0]} added: 800 nats", "swapped", "current added: 800 nats")


def test_times_are_looked_for_before_anything_else(monkeypatch) -> None:
    found = traced(monkeypatch, {"current": {}})
    assert [r.before.rms is TIMED for r in found.rounds] == [True, True]
    assert found.baseline is BEFORE


def test_a_size_that_is_impossible_is_not_accepted(monkeypatch) -> None:
    found = traced(monkeypatch, {"current": {"impossible": True}})
    assert (found.named, refusals(found)) == ((), {"current": "impossible"})


def test_the_simpler_one_is_accepted_in_place_of_the_best(monkeypatch) -> None:
    pair = {"current": {}, "gyro_bias": {"gain": 790.0, "parameters": 1}}
    found = traced(monkeypatch, pair)
    assert found.named == ("gyro_bias",)
    assert refusals(found) == {"current": "simpler", "gyro_bias": ""}


def test_what_explains_the_data_as_well_stands_beside_what_is_accepted(monkeypatch) -> None:
    found = traced(monkeypatch, {"current": {}, "gyro_bias": {"gain": 790.0}})
    assert found.rounds[0].alike == ("current", "gyro_bias")
    assert traced(monkeypatch, {"current": {}}).rounds[0].alike == ()
    # sensors do not tell these two apart, and the motion by 4 of 30 nats
    first, second = {"gain": 30.0, "by_others": 30.0}, {"gain": 26.0, "by_others": 30.0}
    found = traced(monkeypatch, {"gyro_bias": first, "gyro_scale": second})
    assert found.rounds[0].alike == ("gyro_bias", "gyro_scale")
    found = traced(monkeypatch, {"gyro_bias": first, "current": second})
    assert found.rounds[0].alike == ()
    special = traced(monkeypatch, {"rudder_offset": {}})
    assert special.rounds[0].alike == ("rudder_offset", "hull_asymmetry")


def test_what_is_small_and_hides_others_is_taken_along(monkeypatch) -> None:
    first = {HIGHER: {"size": 0.5}, "current": {"gain": 300.0}}
    found = traced(monkeypatch, first, {"current": {}})
    assert found.final.effects == (HIGHER, "current")
    assert (found.unclaimed, found.named) == ((HIGHER,), ("current",))
    assert found.steps[0] == (
        f"{HIGHER} adjusted along as a nuisance parameter: 800 nats, too small to matter"
    )


def test_a_term_of_higher_order_behind_another_is_not_claimed(monkeypatch) -> None:
    found = traced(monkeypatch, {"current": {}}, {HIGHER: {}})
    assert (found.unclaimed, found.named) == ((HIGHER,), ("current",))
    assert traced(monkeypatch, {HIGHER: {}}).named == (HIGHER,)


def test_a_model_that_leaves_much_has_its_candidates_fitted_from_the_estimate(monkeypatch) -> None:
    """A rudder that turned twice as well to one side was stuck at 7 nats of 575 (seed 6182)."""
    found = traced(monkeypatch, {}, wanting=True, far=575.0)
    assert found.named == ("current",)
    assert found.steps == ("current added: 575 nats",)
    assert traced(monkeypatch, {}, wanting=False, far=575.0).named == ()
    assert traced(monkeypatch, {}, wanting=True, far=19.0).named == ()  # no better than the model


def test_where_none_is_accepted_two_that_hide_each_other_may_be(monkeypatch) -> None:
    """The rounds that found them stand for the one in which none was."""
    weak = {"current": {}, "gyro_bias": {}}

    def pair_of(case, done, one_round, without):
        if done.before.effects:
            return None
        first, second = done.tried
        both = replace(second.fitted, effects=(first.id, second.id), log_likelihood=900.0)
        behind = replace(done, before=first.fitted, tried=(Tried(both, second.account),))
        named = replace(done, accepted=first.id)
        return Pair(named, replace(behind, accepted=second.id))

    monkeypatch.setattr(search, "together", pair_of)
    monkeypatch.setattr(
        search, "judged_with", lambda case, before, tried, *_: [refused(t) for t in tried]
    )
    found = traced(monkeypatch, weak)
    assert found.named == found.final.effects == ("current", "gyro_bias")
    assert found.steps == ("current and gyro_bias added together: 900 nats",)
    assert [r.accepted for r in found.rounds] == ["current", "gyro_bias", None]


def refused(tried: Tried) -> Tried:
    return replace(tried, refusal=Refusal("evidence", "evidence too weak"))
