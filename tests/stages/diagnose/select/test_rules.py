"""Every rule of the search on records made by hand, and that each of them is needed."""

import ast
import inspect
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from auvident.stages.diagnose.score.left_out import Helped
from auvident.stages.diagnose.select import decisions, rules, screen
from auvident.stages.diagnose.select.decisions import (
    judge,
    nuisance_of,
    simplest,
    told_apart_from,
)
from auvident.stages.diagnose.select.records import (
    Accepted,
    Account,
    Afresh,
    Apart,
    Begun,
    Beside,
    Containing,
    Exchanged,
    Hiding,
    Nuisance,
    Reconciled,
    Replacing,
    Rival,
    Screened,
    Start,
)
from auvident.stages.diagnose.select.rule import Refusal, Rule, passes, passes_any, refusal_of
from auvident.stages.diagnose.select.rules import (
    ANOTHER,
    LEAST_GAIN,
    MOST_UNCLAIMED,
    RULES,
    RULES_LEFT_OUT,
)

GOOD = Account(
    id="current",
    gain=800.0,
    by_others=800.0,
    parameters=2,
    size=3.0,
    falls={"u": 0.5, "v": 0.1, "r": 0.0},
    rms=(0.01, 0.02, 0.002),
    impossible=False,
    settled=True,
    promise=850.0,
    maneuvers=8,
    helped=Helped(500.0, 0.9, 0.9, 4.0, 0.6),
)


def left_out(**changes: float) -> Helped:
    """What helps maneuvers left out, changed in some respect."""
    assert GOOD.helped is not None
    return replace(GOOD.helped, **changes)


SIMPLE = replace(GOOD, id="simple", gain=790.0, parameters=1, helped=None)
BACKLASH = replace(GOOD, id="rudder_backlash", gain=400.0, parameters=1, helped=None)
BEHIND = Begun("a", 5, 10.0, 100.0, 60.0, 10.0, 100.0, False)
# a record that meets every rule of a table, and what makes it fail one rule and no other
FAILING: dict[str, tuple[Any, dict[str, Any]]] = {
    "SCREEN": (Screened("a", 8.0, 6), {"worth": {"gain": 7.9}, "place": {"place": 7}}),
    "SCREEN_FAST": (Screened("a", 8.0, 3), {"worth": {"gain": 7.9}, "place": {"place": 4}}),
    "SCREEN_APART": (
        Apart(20.0, 40.0),
        {"gain": {"gain": 19.0, "by_others": 0.0}, "apart": {"by_others": 41.0}},
    ),
    "BEGIN": (
        Start(20.0 / 3.0 + 0.01, 60.0, False),
        {
            "gain": {"promise": 6.6, "gained": 0.0},
            "of-best": {"promise": 7.0, "gained": 71.0},
        },
    ),
    "ACCOMPANY": (Screened("a", 0.0, 1), {"place": {"place": 2}}),
    "LEAD": (3, {"place": 4}),
    "FINISH": (
        replace(BEHIND, place=3, promise=30.0),
        {"place": {"place": 4}, "hopeless": {"promise": 29.0}},
    ),
    "AFRESH": (
        replace(BEHIND, place=1, best_promise=30.0),
        {"worth-a-start": {"best_promise": 29.0}, "place": {"place": 2}},
    ),
    "RULES": (
        GOOD,
        {
            "unsettled": {"settled": False},
            "gain": {"gain": 19.0, "by_others": 19.0},
            "of-best": {"by_others": 1700.0},
            "small": {"id": "rudder_lag", "size": 0.9},  # of water that helps as much any matters
            "impossible": {"impossible": True},
            "maneuvers": {"maneuvers": 1},
        },
    ),
    "RULES_LEFT_OUT": (
        GOOD,
        {
            "share-helped": {"helped": left_out(share=0.5, deciding=0.4)},
            "evidence": {"helped": left_out(t=1.9)},
            "explained": {"helped": left_out(explained=rules.LEAST_EXPLAINED - 0.01)},
        },
    ),
    "RULES_BESIDE": (
        replace(GOOD, helped=left_out(t=1.5)),
        {
            "share-helped": {"helped": left_out(t=1.5, share=0.5, deciding=0.4)},
            "evidence": {"helped": left_out(t=1.4)},
            "explained": {"helped": left_out(t=1.5, explained=rules.LEAST_EXPLAINED - 0.01)},
        },
    ),
    "SENSORS": (12.0, {"reconciled": 11.9}),
    "BY_SENSORS": (
        Reconciled(40.0, 0.8),
        {"reconciled": {"gain": 39.9}, "share": {"share": 0.79}},
    ),
    "SIMPLER": (
        Beside(GOOD, SIMPLE),
        {
            "fewer": {"other": replace(SIMPLE, parameters=2)},
            "gain": {"other": replace(SIMPLE, gain=767.0)},
            "sound": {"other": replace(SIMPLE, impossible=True)},
        },
    ),
    "ALIKE": (
        Beside(GOOD, replace(SIMPLE, gain=705.0)),
        {
            "gain": {"other": replace(SIMPLE, gain=703.0)},
            "small": {"other": replace(SIMPLE, size=0.9)},
            "rms": {"other": replace(SIMPLE, rms=(0.01, 0.02, 0.0024))},
        },
    ),
    "ALIKE_OF_KIND": (
        Beside(replace(GOOD, id="rudder_deadband"), BACKLASH),
        {
            "gain": {"other": replace(BACKLASH, gain=266.0)},
            "small": {"other": replace(BACKLASH, size=0.9)},
            "rms": {"other": replace(BACKLASH, rms=(0.009, 0.019, 0.00201))},
        },
    ),
    "ALIKE_TO_SENSORS": (
        Beside(GOOD, replace(SIMPLE, gain=785.0)),
        {
            "swap": {"other": replace(SIMPLE, gain=784.9)},
            "small": {"other": replace(SIMPLE, size=0.9)},
            "rms": {"other": replace(SIMPLE, rms=(0.01, 0.02, 0.0024))},
        },
    ),
    "LEFT_BEHIND": (Afresh(60.0, 40.0), {"stuck": {"near": 41.0}}),
    "CONTAIN": (Containing(1, 0.98), {"further": {"further": 0}, "cosine": {"cosine": 0.97}}),
    "TAKE_ALONG": (
        Nuisance("small", 4.0, 150.0, 1.1, 1),
        {
            "unclaimed": {"unclaimed": 2},
            "small": {"refused_as": "impossible"},
            "hides": {"hidden_gain": 19.0},
            "rms": {"rms_ratio": 1.2},
            "evidence": {"t": 2.4},
        },
    ),
    "HIDDEN": (
        Hiding(True, 1.0, 0.0, rules.LEAST_EXPLAINED),
        {
            "tried": {"tried": False},
            "small": {"large": 0.9},
            "helps": {"t": -0.1},
            "explained": {"explained": rules.LEAST_EXPLAINED - 0.01},
        },
    ),
    "CLAIM": (
        Accepted(True, 300.0, 0),
        {"first": {"before": 1}, "gain": {"gain": 299.0}},
    ),
    "GO_ON": (3, {"named": 4}),
    "EXCHANGE_ON": (1, {"done": 2}),
    "REPLACE": (Replacing(34.0, 100.0), {"worth": {"promise": 33.0}}),
    "EXCHANGE": (
        Exchanged(1.0, False, 15.0, False),
        {
            "small": {"size": 0.9},
            "impossible": {"impossible": True},
            "swap": {"gain": 14.0},
            "fewer": {"gain": -5.0, "fewer": True},
            "more": {"share": 0.11},
        },
    ),
    "RECONSIDER": (2, {"others": 1}),
    "STAY": (40.0, {"removal": 39.0}),
}
# a record that meets no rule of a table, and what makes it meet one and no other
MEETING: dict[str, tuple[Any, dict[str, Any]]] = {
    "FINISH_ANYWAY": (
        BEHIND,
        {
            "steady": {"beside_steady": True},
            "rival": {"gain": 50.0},
            "apart": {"promise": 30.0},
        },
    ),
    "AGAIN": (Rival(40.0, 100.0, 10.0), {"stuck": {"moved": 20.0}, "rival": {"gain": 50.0}}),
}
TABLES = {
    name: table
    for name, table in vars(rules).items()
    if isinstance(table, tuple) and table and isinstance(table[0], Rule)
}


def changed(record: Any, update: Any) -> Any:
    return replace(record, **update) if isinstance(update, dict) else update


def every(tables: dict[str, tuple[Any, dict[str, Any]]]) -> Any:
    rows = [(name, rule) for name in tables for rule in TABLES[name]]
    return pytest.mark.parametrize(
        ("name", "rule"), rows, ids=[f"{name}-{rule.code}" for name, rule in rows]
    )


def test_every_rule_of_every_table_has_its_test() -> None:
    both = {**FAILING, **MEETING}
    assert {name: [r.code for r in table] for name, table in TABLES.items()} == {
        name: list(own) for name, (_, own) in both.items()
    }


@pytest.mark.parametrize("name", FAILING)
def test_what_is_right_in_every_respect_passes(name) -> None:
    assert refusal_of(FAILING[name][0], TABLES[name]) is None


@every(FAILING)
def test_each_rule_refuses_by_itself_and_without_it_nothing_does(name, rule) -> None:
    good, failing = FAILING[name]
    record = changed(good, failing[rule.code])
    found = refusal_of(record, TABLES[name])
    assert found is not None and found.code == rule.code
    assert found.threshold == rule.threshold and rule(record) == found
    assert "{" not in found.text and len(rule.asks) > 5
    assert refusal_of(record, [r for r in TABLES[name] if r is not rule]) is None


@every(MEETING)
def test_each_exception_holds_by_itself_and_without_it_nothing_does(name, rule) -> None:
    none, meeting = MEETING[name]
    assert not passes_any(none, TABLES[name])
    record = changed(none, meeting[rule.code])
    assert passes_any(record, TABLES[name])
    assert not passes_any(record, [r for r in TABLES[name] if r is not rule])


def test_of_nothing_there_is_no_share() -> None:
    nothing = replace(BEHIND, place=0, promise=0.0, best_promise=0.0)
    assert passes(nothing, rules.FINISH)  # none is better
    # behind a model that has overtaken all of them there is no rival
    assert not passes_any(Rival(-5.0, -5.0, 0.0), rules.AGAIN)


def test_of_what_first_order_says_nothing_a_fit_always_begins() -> None:
    nothing = Start(-np.inf, 1000.0, False)
    assert not passes(nothing, rules.BEGIN)
    assert passes(replace(nothing, unseen=True), rules.BEGIN)


def test_a_rule_tells_its_evidence() -> None:
    weak = refusal_of(replace(GOOD, gain=4.4, by_others=4.4), RULES)
    assert weak == Refusal("gain", "evidence too weak (4 nats)", 4.4, LEAST_GAIN)
    few = refusal_of(replace(GOOD, helped=left_out(share=0.5, deciding=0.4)), RULES_LEFT_OUT)
    assert few is not None and few.text == "helps only 50 % of the maneuvers left out"
    chance = refusal_of(replace(GOOD, helped=left_out(t=1.2)), RULES_LEFT_OUT)
    assert chance is not None
    assert chance.text == (
        "evidence too weak: helps the maneuvers left out by 1.2 standard errors, 2.5 needed"
    )


def test_a_number_that_is_none_meets_no_rule() -> None:
    assert refusal_of(replace(GOOD, gain=float("nan")), RULES) is not None
    assert not passes(float("nan"), rules.STAY)


def test_one_bad_place_does_not_count_where_nearly_everything_is_explained() -> None:
    for explained, refused in ((0.79, True), (0.8, False)):
        few = replace(GOOD, helped=left_out(t=0.7, explained=explained))
        assert (refusal_of(few, RULES_LEFT_OUT) is not None) == refused


def test_where_half_is_explained_fewer_standard_errors_do() -> None:
    for t, explained, refused in ((2.0, 0.5, False), (1.9, 0.5, True), (2.4, 0.49, True)):
        short = replace(GOOD, helped=left_out(t=t, explained=explained))
        assert (refusal_of(short, RULES_LEFT_OUT) is not None) == refused


def test_what_a_nat_is_worth_decides_nothing() -> None:
    """A short log of a noisy sensor: all nats are a tenth, what they say is the same."""
    for scale in (1.0, 0.1):
        few = replace(GOOD, gain=scale * GOOD.gain, by_others=scale * GOOD.by_others)
        few = replace(few, helped=left_out(gain=scale * 500.0))
        assert refusal_of(few, (*RULES, *RULES_LEFT_OUT)) is None


# --- candidates in their order -------------------------------------------------------------


def other(name: str, **update) -> Account:
    return replace(GOOD, id=name, helped=None, **update)


def codes(judged) -> dict[str, str]:
    return {a.id: refusal.code if refusal else "" for a, refusal in judged}


def test_the_first_that_passes_is_accepted_and_no_later_one_is_tried() -> None:
    asked = []

    def leave_out(account: Account) -> Helped:
        asked.append(account.id)
        return left_out(share=0.2, deciding=0.0) if account.id == "a" else left_out()

    found = judge([other("a"), other("b", gain=700.0), other("c", gain=600.0)], leave_out)
    assert codes(found) == {"a": "share-helped", "b": "", "c": ANOTHER.code}
    assert asked == ["a", "b"]
    assert [a.helped is not None for a, _ in found] == [True, True, False]


def test_what_a_rule_refuses_is_not_left_out_in_turn() -> None:
    def never(account: Account) -> Helped:
        raise AssertionError(account)

    assert codes(judge([other("a", impossible=True)], never)) == {"a": "impossible"}
    assert judge([], never) == []


def test_the_best_one_is_left_out_although_small_as_it_may_hide_others() -> None:
    pair = [other("a", size=0.1), other("b", size=0.1)]
    (first, refusal), (second, _) = judge(pair, lambda _: left_out())
    assert refusal is not None and refusal.code == "small"
    assert (first.helped is not None, second.helped is not None) == (True, False)


@pytest.mark.parametrize(
    ("effect", "fall", "refused"),
    [("current", 0.5, ""), ("current", 0.49, "small"), ("rudder_lag", 0.9, "small")],
)
def test_water_that_makes_good_half_of_an_error_matters_however_slow(effect, fall, refused) -> None:
    slow = replace(other(effect, size=0.4), falls={"u": fall, "v": 0.1, "r": -0.1})
    assert codes(judge([slow], lambda _: left_out())) == {effect: refused}


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


def test_only_what_looks_alike_is_not_told_apart_by_errors_alone() -> None:
    """A dead band of 192 nats beside a backlash of 102 that leaves less in every channel."""
    dead = replace(GOOD, id="rudder_deadband")
    assert told_apart_from(dead, [dead, BACKLASH]) == ("rudder_backlash",)
    assert told_apart_from(dead, [dead, replace(BACKLASH, id="cubic_damping")]) == ()


SMALL = Refusal("small", "too small to matter in practice")


@pytest.mark.parametrize(
    ("refusal", "update", "second", "unclaimed", "taken"),
    [
        (SMALL, {}, 150.0, 0, "a"),
        (Refusal("explained", ""), {}, 150.0, MOST_UNCLAIMED - 1, "a"),
        (SMALL, {}, 150.0, MOST_UNCLAIMED, None),  # enough of them
        (SMALL, {}, 19.0, 0, None),  # it hides nothing
        (SMALL, {"helped": None}, 150.0, 0, None),  # never tried
        (SMALL, {"helped": left_out(t=2.0)}, 150.0, 0, None),  # it may be chance
        (SMALL, {"rms": (0.01, 0.02, 0.003)}, 150.0, 0, None),  # one channel pays for it
        (Refusal("impossible", ""), {}, 150.0, 0, None),
        (ANOTHER, {}, 150.0, 0, None),
    ],
)
def test_what_hides_others_is_taken_along_where_it_is_small(
    refusal, update, second, unclaimed, taken
) -> None:
    first = replace(GOOD, **{"id": "a", **update})
    judged = [(first, refusal), (other("b", gain=second), ANOTHER)]
    assert nuisance_of(judged, GOOD.rms, unclaimed) == taken


def test_of_nothing_nothing_is_taken_along() -> None:
    assert nuisance_of([], GOOD.rms, 0) is None


@pytest.mark.parametrize("name", [n for n in dir(rules) if n.isupper() and n not in TABLES])
def test_every_threshold_is_used(name) -> None:
    read: set[str] = set()
    for module in (rules, decisions, screen):
        nodes = list(ast.walk(ast.parse(inspect.getsource(module))))
        read |= {n.id for n in nodes if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Load)}
        read |= {n.attr for n in nodes if isinstance(n, ast.Attribute)}
    assert name in read
