"""Every rule of the search on records made by hand, and that each of them is needed."""

import ast
import inspect
from dataclasses import replace

import pytest

from auvident.stages.diagnose.score.left_out import Helped
from auvident.stages.diagnose.select import rules
from auvident.stages.diagnose.select.rules import (
    ANOTHER,
    LEAST_GAIN,
    MOST_QUIET,
    RULES,
    RULES_LEFT_OUT,
    Account,
    Refusal,
    judge,
    nuisance_of,
    refusal_of,
    simplest,
    told_apart_from,
)

GOOD = Account(
    id="current",
    gain=800.0,
    best_gain=800.0,
    parameters=2,
    size=3.0,
    falls={"u": 0.5, "v": 0.1, "r": 0.0},
    rms=(0.01, 0.02, 0.002),
    at_bound=False,
    settled=True,
    promise=850.0,
    maneuvers=8,
    helped=Helped(500.0, 0.9, 300.0, 0.9, 0.003),
)
# what makes the good one fail one rule and no other
FAILING = {
    "unsettled": {"settled": False},
    "gain": {"gain": 99.0, "best_gain": 99.0},
    "of-best": {"best_gain": 1700.0},
    "small": {"size": 0.9},
    "no-fall": {"falls": {"u": 0.19, "v": 0.0, "r": -0.1}},
    "bound": {"at_bound": True},
    "maneuvers": {"maneuvers": 1},
    "share-helped": {"helped": Helped(500.0, 0.5, 300.0, 0.4)},
    "by-chance": {"helped": Helped(500.0, 0.65, -1.0, 0.65)},
}
EVERY = (*RULES, *RULES_LEFT_OUT)


def test_what_is_right_in_every_respect_is_accepted() -> None:
    assert refusal_of(GOOD, EVERY) is None


@pytest.mark.parametrize("rule", EVERY, ids=lambda r: r.code)
def test_each_rule_refuses_by_itself_and_without_it_nothing_does(rule) -> None:
    account = replace(GOOD, **FAILING[rule.code])
    found = refusal_of(account, EVERY)
    assert found is not None and found.code == rule.code
    assert found.threshold == rule.least and not found.evidence >= rule.least
    assert "{" not in found.text and len(rule.asks) > 5
    assert refusal_of(account, [r for r in EVERY if r is not rule]) is None


def test_the_rules_have_codes_of_their_own_and_each_has_its_test() -> None:
    assert [r.code for r in EVERY] == list(FAILING)


def test_a_rule_tells_its_evidence() -> None:
    weak = refusal_of(replace(GOOD, gain=44.4, best_gain=44.4), RULES)
    assert weak == Refusal("gain", "evidence too weak (44 nats, 100 needed)", 44.4, LEAST_GAIN)
    few = refusal_of(replace(GOOD, **FAILING["share-helped"]), RULES_LEFT_OUT)
    assert few is not None and few.text == "improves only 50 % of the maneuvers left out"


def test_one_bad_place_does_not_count_where_most_maneuvers_are_helped() -> None:
    assert refusal_of(replace(GOOD, helped=Helped(500.0, 0.75, -1.0)), EVERY) is None


# --- candidates in their order -------------------------------------------------------------


def other(name: str, **update) -> Account:
    return replace(GOOD, id=name, helped=None, **update)


def codes(judged) -> dict[str, str]:
    return {a.id: refusal.code if refusal else "" for a, refusal in judged}


def test_the_first_that_passes_is_accepted_and_no_later_one_is_tried() -> None:
    asked = []

    def leave_out(account: Account) -> Helped:
        asked.append(account.id)
        return Helped(1.0, 0.2 if account.id == "a" else 0.9, 1.0)

    found = judge([other("a"), other("b", gain=700.0), other("c", gain=600.0)], leave_out)
    assert codes(found) == {"a": "share-helped", "b": "", "c": ANOTHER.code}
    assert asked == ["a", "b"]
    assert [a.helped is not None for a, _ in found] == [True, True, False]


def test_what_a_rule_refuses_is_not_left_out_in_turn() -> None:
    def never(account: Account) -> Helped:
        raise AssertionError(account)

    assert codes(judge([other("a", size=0.1)], never)) == {"a": "small"}
    assert judge([], never) == []


@pytest.mark.parametrize(
    ("gain", "parameters", "size", "chosen"),
    [
        (770.0, 1, 3.0, "b"),  # 4 % less with one parameter less
        (760.0, 1, 3.0, "a"),  # 5 % less
        (770.0, 2, 3.0, "a"),  # no simpler
        (770.0, 1, 0.9, "a"),  # too small itself
    ],
)
def test_the_simpler_of_two_that_gain_alike_is_accepted(gain, parameters, size, chosen) -> None:
    pair = [(other("a"), None), (other("b", gain=gain, parameters=parameters, size=size), ANOTHER)]
    found = codes(simplest(pair))
    assert [name for name, code in found.items() if not code] == [chosen]
    if chosen == "b":
        assert found["a"] == "simpler"


def test_nothing_is_simpler_than_nothing() -> None:
    judged = [(other("a", size=0.1), Refusal("small", ""))]
    assert simplest(judged) == judged


@pytest.mark.parametrize(
    ("update", "alike"),
    [
        ({"gain": 710.0}, ("b",)),
        ({"gain": 700.0}, ()),  # 12 % of 800 are 96
        ({"gain": 790.0, "size": 0.9}, ()),
        ({"gain": 790.0, "rms": (0.01, 0.02, 0.0024)}, ()),  # 20 % more of r
        ({"gain": 790.0, "rms": (0.01, 0.02, 0.0022)}, ("b",)),
    ],
)
def test_what_explains_the_data_as_well_is_not_told_apart(update, alike) -> None:
    assert told_apart_from(GOOD, [GOOD, other("b", **update)]) == alike


def test_little_gain_leaves_room_of_some_nats() -> None:
    few = replace(GOOD, gain=60.0)
    assert told_apart_from(few, [other("b", gain=49.0)]) == ("b",)
    assert told_apart_from(few, [other("b", gain=47.0)]) == ()


SMALL = Refusal("small", "too small to matter in practice")


@pytest.mark.parametrize(
    ("refusal", "update", "second", "quiet", "taken"),
    [
        (SMALL, {}, 150.0, 0, "a"),
        (Refusal("no-fall", ""), {}, 150.0, MOST_QUIET - 1, "a"),
        (SMALL, {}, 150.0, MOST_QUIET, None),  # enough of them
        (SMALL, {}, 90.0, 0, None),  # it hides nothing
        (SMALL, {"gain": 90.0}, 150.0, 0, None),  # too little to hide anything
        (SMALL, {"rms": (0.01, 0.02, 0.003)}, 150.0, 0, None),  # one channel pays for it
        (Refusal("bound", ""), {}, 150.0, 0, None),
        (ANOTHER, {}, 150.0, 0, None),
    ],
)
def test_what_hides_others_is_taken_along_where_it_is_small(
    refusal, update, second, quiet, taken
) -> None:
    judged = [(other("a", **update), refusal), (other("b", gain=second), ANOTHER)]
    assert nuisance_of(judged, GOOD.rms, quiet) == taken


def test_of_nothing_nothing_is_taken_along() -> None:
    assert nuisance_of([], GOOD.rms, 0) is None


@pytest.mark.parametrize("name", [n for n in dir(rules) if n.isupper()])
def test_every_threshold_is_used(name) -> None:
    tree = ast.parse(inspect.getsource(rules))
    read = {n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Load)}
    assert name in read
