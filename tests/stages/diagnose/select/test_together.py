"""Two effects that hide each other: when a second one is looked for, and when both are accepted."""

from dataclasses import replace
from typing import Any

import pytest

from auvident.stages.diagnose.fit.fits import Fitted
from auvident.stages.diagnose.score.left_out import FitsWithout
from auvident.stages.diagnose.select import rules, together
from auvident.stages.diagnose.select.candidates import Round, Tried
from auvident.stages.diagnose.select.records import Account
from auvident.stages.diagnose.select.rule import Refusal
from tests.stages.diagnose.select.test_rules import GOOD, left_out
from tests.stages.diagnose.select.test_search import BEFORE

WEAK = Refusal("evidence", "evidence too weak")
ALONE = {"t": 1.0, "share": 0.7, "deciding": 0.7}  # what helps, within chance


def tried(name: str, refusal: Refusal | None = WEAK, **changes: Any) -> Tried:
    effects = (*changes.pop("beside", ()), name)
    fitted = replace(BEFORE, log_likelihood=500.0, effects=effects)
    account = replace(GOOD, id=name, helped=left_out(**ALONE))
    return Tried(fitted, replace(account, **changes), refusal)


def a_round(*candidates: Tried) -> Round:
    accepted = next((t.id for t in candidates if t.refusal is None), None)
    return Round(BEFORE, None, candidates, {}, accepted=accepted)  # type: ignore[arg-type]


class World:
    """What a search finds behind each candidate, and what was left out says of it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, **says: dict[str, float]) -> None:
        self.searched: list[str] = []
        self.says = says

        def helped(case: Any, before: Fitted, after: Fitted, *_: Any) -> Any:
            both = len(after.effects) - len(before.effects) == 2
            return left_out(**self.says["both" if both else after.effects[-1]])

        def account(case: Any, before: Fitted, fitted: Fitted, *_: Any) -> Account:
            return replace(GOOD, id=fitted.effects[-1], helped=None)

        monkeypatch.setattr(together, "left_out_with", helped)
        monkeypatch.setattr(together, "account_of", account)
        monkeypatch.setattr(together, "without", lambda case, p, effects: p)
        monkeypatch.setattr(
            together, "from_both", lambda case, effects, *_: replace(BEFORE, effects=effects)
        )

    def found(self, done: Round, second: Tried | None) -> together.Pair | None:
        """The pair of a round, where a search from any candidate accepts this second one."""

        def search(before: Fitted) -> Round:
            self.searched.append(before.effects[-1])
            return a_round(*([second] if second else []))

        return together.together(None, done, search, FitsWithout())  # type: ignore[arg-type]


SECOND = tried("b", None, beside=("a",), helped=left_out())


def test_two_that_help_together_and_each_beside_the_other_are_accepted(monkeypatch) -> None:
    world = World(
        monkeypatch,
        both={"t": 2.8},
        a={
            "t": 1.9,
        },
    )
    pair = world.found(a_round(tried("a"), tried("c")), SECOND)
    assert pair is not None and pair.effects == ("a", "b")
    assert pair.fitted is SECOND.fitted
    named = pair.first.tried[0]
    # the round tells what the first one does beside the second
    assert (named.refusal, named.account.helped) == (None, left_out(t=1.9))
    assert pair.first.tried[1].refusal is WEAK


@pytest.mark.parametrize(
    ("says", "second"),
    [
        ({"both": {"t": 1.9}, "a": {"t": 1.9}}, SECOND),  # together within chance
        ({"both": {"t": 2.8}, "a": {"t": 1.4}}, SECOND),  # the first does nothing beside it
        ({"both": {"t": 2.8}, "a": {"t": 1.9, "explained": 0.2}}, SECOND),
        ({"both": {"t": 2.8, "explained": 0.2}, "a": {"t": 1.9}}, SECOND),
        ({"both": {"t": 2.8}, "a": {"t": 1.9}}, None),  # nothing is found behind it
    ],
)
def test_a_pair_of_which_something_is_not_shown_is_none(monkeypatch, says, second) -> None:
    assert World(monkeypatch, **says).found(a_round(tried("a")), second) is None


def test_without_the_first_there_may_be_no_model(monkeypatch) -> None:
    world = World(monkeypatch, both={"t": 2.8})
    monkeypatch.setattr(together, "from_both", lambda *_: None)
    assert world.found(a_round(tried("a")), SECOND) is None  # its evidence alone is too weak
    sure = tried("a", helped=left_out(t=1.6))
    pair = world.found(a_round(sure), SECOND)
    assert pair is not None and pair.effects == ("a", "b")


@pytest.mark.parametrize(
    "changes",
    [
        {"size": 0.9},
        {"helped": left_out(t=-0.1)},  # what was left out is predicted worse
        {"falls": {"u": 0.1, "v": 0.15}},  # ... and 28 % of the power of v are little
        {"helped": None},  # refused before anything was left out
    ],
)
def test_nothing_is_looked_for_behind_what_hides_nothing(monkeypatch, changes) -> None:
    world = World(monkeypatch, both={}, a={})
    assert world.found(a_round(tried("a", **changes)), SECOND) is None
    assert world.searched == []


def test_only_the_leading_ones_are_tried(monkeypatch) -> None:
    world = World(monkeypatch, both={"t": 0.0}, a={}, c={}, d={})
    assert world.found(a_round(*map(tried, "acd")), SECOND) is None
    assert world.searched == list("acd")[: rules.MOST_HIDDEN]
