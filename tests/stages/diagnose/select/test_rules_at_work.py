"""Every rule at work: where it is taken out of its table, the search does something else."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from auvident.schema.effects import BY_ID
from auvident.stages.diagnose.fit.fits import Fitted
from auvident.stages.diagnose.score.first_order import Score
from auvident.stages.diagnose.score.left_out import Helped
from auvident.stages.diagnose.select import (
    candidates,
    held_back,
    reconsider,
    refitting,
    rules,
    search,
    starts,
)
from auvident.stages.diagnose.select.candidates import Round, Tried
from auvident.stages.diagnose.select.decisions import (
    hidden_among,
    judge,
    left_to_the_motion,
    nuisance_of,
    shown_together,
    simplest,
    told_apart_from,
)
from auvident.stages.diagnose.select.reconsider import Exchange
from auvident.stages.diagnose.select.records import Account
from auvident.stages.diagnose.select.rule import Refusal
from auvident.stages.diagnose.select.screen import Screen, apart, short_list
from auvident.stages.diagnose.select.search import Search
from tests.stages.diagnose.select.test_rules import FAILING, GOOD, MEETING, TABLES

# effects that look like no other and show in no straight run
ALONE = (
    "current",
    "rudder_asymmetry",
    "dvl_scale",
    "dvl_lever_arm",
    "gyro_bias",
    "gyro_scale",
    "sway_cross_flow",
    "yaw_cross_flow",
)
STEADY = ("rudder_offset", "dvl_misalignment")
Patch = pytest.MonkeyPatch


@dataclass(frozen=True)
class Places:
    """As much of a case as is asked for: one parameter for each effect."""

    records: tuple[None, ...] = (None, None)
    channels: tuple[str, ...] = ("u", "v", "r")

    def positions(self, *effects: str) -> list[int]:
        return [(*ALONE, *STEADY, "hull_asymmetry").index(effect) for effect in effects]


@dataclass(frozen=True)
class Counted(Places):
    """The same, with as many parameters as the table of effects has."""

    def positions(self, *effects: str) -> list[int]:
        return [0 for effect in effects for _ in BY_ID[effect].names("horizontal")]


CASE: Any = Places()
COUNTED: Any = Counted()
N = 11


def fitted(likelihood: float, *effects: str, free: int = 0, rms: float = 1.0) -> Fitted:
    p, channels = np.zeros(N), np.full(3, rms)
    return Fitted(p, np.arange(free), (), likelihood, effects=effects, residuals=(), rms=channels)


BEFORE = fitted(0.0)


# --- scenarios: what the program does, to be told apart with and without a rule -----------------


def listed(gains: dict[str, float], quick: dict[str, float]) -> Callable[[Patch], Any]:
    return lambda patch: short_list(gains, quick)


def finished(
    promise: dict[str, float], gain: dict[str, float], by_others: float = 1000.0
) -> Callable[[Patch], Any]:
    """Which of some candidates are fitted to the end, and which of them afresh as well."""

    def run(patch: Patch) -> dict[str, bool]:
        afresh: dict[str, bool] = {}

        def to_the_end(case: Any, fit: Fitted, second: bool) -> Fitted:
            afresh[fit.effects[-1]] = second
            return fit

        patch.setattr(refitting, "to_the_end", to_the_end)
        found = {c: fitted(gain.get(c, 0.0), c) for c in promise}
        refitting.finish(CASE, BEFORE, found, promise, dict.fromkeys(promise, by_others))
        return afresh

    return run


def began(
    scored: dict[str, tuple[float, float]], shares: dict[frozenset[str], float] | None = None
) -> Callable[[Patch], Any]:
    """Which of some candidates with a first-order gain and a size are worth first steps."""

    def run(patch: Patch) -> list[str]:
        patch.setattr(refitting, "size_of", lambda case, c, p: scored[c][1])
        patch.setattr(starts, "at_typical_size", lambda *_: None)
        patch.setattr(
            refitting, "refit", lambda case, effects, *_: fitted(scored[effects[-1]][0], *effects)
        )
        scores = {c: Score(gain, BEFORE.parameters) for c, (gain, _) in scored.items()}
        joint: Any = SimpleNamespace(half=1.0)
        screened = Screen(joint, scores, tuple(scores), {}, shares or {})
        return list(refitting.first_steps(CASE, BEFORE, screened))

    return run


def again(gains: dict[str, float], moved: float) -> Callable[[Patch], Any]:
    """Which candidates are fitted again from where the best one lies."""

    def run(patch: Patch) -> list[str]:
        done: list[str] = []

        def refit(case: Any, effects: Any, starts: Any, like: Fitted) -> None:
            done.append(effects[-1])

        patch.setattr(refitting, "refit", refit)
        patch.setattr(refitting, "fit_with", lambda *_, **__: fitted(moved))
        refitting.unstuck(CASE, BEFORE, {c: fitted(gain, c) for c, gain in gains.items()})
        return done

    return run


def judged(**update: Any) -> Callable[[Patch], Any]:
    """Whether a candidate is accepted."""
    account = replace(GOOD, **update)
    helped = account.helped or GOOD.helped
    assert helped is not None
    return lambda patch: judge([account], lambda _: helped)[0][1] is None


def accepted_of(other: Account) -> Callable[[Patch], Any]:
    """Which of two is accepted, the first having come through."""
    pair = [(GOOD, None), (other, rules.ANOTHER)]
    return lambda patch: [a.id for a, refusal in simplest(pair) if refusal is None]


def contained(further: int, likeness: float) -> Callable[[Patch], Any]:
    """What contains a rudder offset."""
    case = SimpleNamespace(
        positions=lambda effect: [0] * (1 + further if effect == "hull_asymmetry" else 1)
    )
    joint: Any = SimpleNamespace(case=case)

    def run(patch: Patch) -> list[str]:
        patch.setattr(search, "cosine", lambda *_: likeness)
        return search.containing(joint, ("hull_asymmetry",), STEADY[0])

    return run


def taken(
    code: str = "small",
    t: float = 4.0,
    hidden: float = 150.0,
    rms: float = 1.0,
    unclaimed: int = 0,
) -> Callable[[Patch], Any]:
    """What is taken along."""
    assert GOOD.helped is not None
    first = replace(GOOD, id="a", helped=replace(GOOD.helped, t=t), rms=(rms, rms, rms))
    pair = [(first, Refusal(code, "")), (replace(GOOD, id="b", gain=hidden), rules.ANOTHER)]
    return lambda patch: nuisance_of(pair, (1.0, 1.0, 1.0), unclaimed)


def hidden(t: float = 1.0, **update: Any) -> Callable[[Patch], Any]:
    """Whether another effect is looked for behind a candidate that was refused."""
    assert GOOD.helped is not None
    account = replace(GOOD, helped=replace(GOOD.helped, t=t))
    return lambda patch: hidden_among([(replace(account, **update), Refusal("evidence", ""))])


def beside(**update: Any) -> Callable[[Patch], Any]:
    """Whether two effects are accepted that do enough together."""
    assert GOOD.helped is not None
    both, own = GOOD.helped, replace(GOOD, **update)
    return lambda patch: shown_together(GOOD, both, lambda: own)


def new_search(*effects: str) -> Search:
    return Search(CASE, effects)


def left_behind(near: float, gain: float) -> Callable[[Patch], Any]:
    """Which fits from the estimate are looked into, beside one from the model that gains less."""

    def run(patch: Patch) -> list[str]:
        own = replace(new_search("current"), wanting=lambda model: True)
        fits = {"current": fitted(gain, "current")}
        patch.setattr(search, "from_estimates", lambda *_: fits)
        tried = Tried(fitted(near, "current"), replace(GOOD, id="current", gain=near))
        return list(own._afresh(Round(BEFORE, None, (tried,), {})))  # type: ignore[arg-type]

    return run


def claimed(gain: float, *before: str) -> Callable[[Patch], Any]:
    """What stays without a claim, of a term of higher order that is accepted."""

    def run(patch: Patch) -> list[str]:
        own, effect = new_search(), "sway_cross_flow"
        patch.setattr(search, "reconsider", lambda case, c, current, unclaimed: (current, []))
        patch.setattr(search, "weak_of", lambda *_: None)
        tried = Tried(fitted(gain, *before, effect), replace(GOOD, id=effect, gain=gain))
        rounds = [
            Round(fitted(0.0, *before), None, (tried,), {}, (), effect),  # type: ignore[arg-type]
            Round(tried.fitted, None, (), {}),  # type: ignore[arg-type]
        ]
        patch.setattr(own, "one_round", lambda current: rounds.pop(0))
        own.trace(fitted(0.0, *before))
        return own.unclaimed

    return run


def named(patch: Patch) -> int:
    """How many effects are accepted where there are six."""
    own = new_search()
    patch.setattr(search, "reconsider", lambda case, c, current, unclaimed: (current, []))

    def one_round(before: Fitted) -> Round:
        there = before.effects
        if len(there) == 6:
            return Round(before, None, (), {})  # type: ignore[arg-type]
        new = ALONE[len(there)]
        tried = Tried(fitted(1e3, *there, new), replace(GOOD, id=new, gain=1e3))
        return Round(before, None, (tried,), {}, (), new)  # type: ignore[arg-type]

    patch.setattr(own, "one_round", one_round)
    return len(own.trace(BEFORE).final.effects)


def exchanges_made(patch: Patch) -> int:
    """How many exchanges are made where five could be."""
    left = [(Exchange(("a",), ("b",)), BEFORE)] * 5
    patch.setattr(reconsider, "_exchanged", lambda *_: left.pop() if left else None)
    return len(reconsider.reconsider(CASE, (), BEFORE, ())[1])


def exchanged(
    size: float = 1.0,
    wrong: bool = False,
    gain: float = 20.0,
    of: str = "propeller_side_force",
    into: str = "hull_asymmetry",
) -> Callable[[Patch], Any]:
    """Whether one effect, worth 700 nats, is exchanged for another."""

    def run(patch: Patch) -> tuple[str, ...]:
        before, after = fitted(0.0, of, "current"), fitted(gain, "current", into)
        patch.setattr(reconsider, "size_of", lambda *_: size)
        patch.setattr(reconsider, "impossible", lambda *_: wrong)
        patch.setattr(reconsider, "prior_cost", lambda *_: 0.0)
        patch.setattr(reconsider, "without", lambda *_: None)
        fits = {after.effects: after, ("current",): fitted(-700.0, "current")}
        patch.setattr(reconsider, "from_both", lambda case, effects, *_: fits.get(effects))
        return reconsider.reconsider(COUNTED, (into,), before, ("current",))[0].effects

    return run


@pytest.mark.parametrize(
    ("scored", "begun"),
    [
        ({"current": (6.0, 2.0), "gyro_bias": (5.0, 2.0)}, []),  # a round without hope
        ({"rudder_lag": (60.0, 1.5), "current": (50.0, 2.0), "dvl_delay": (1.0, 0.1)}, [0, 1]),
        ({"rudder_lag": (60.0, 0.5), "current": (50.0, 2.0), "dvl_delay": (1.0, 0.1)}, [0, 1, 2]),
        ({"current": (400.0, 2.0), "gyro_bias": (300.0, 2.0), STEADY[0]: (1.0, 0.1)}, [0, 1, 2]),
    ],
)
def test_what_first_order_may_not_see_is_begun(scored, begun, monkeypatch) -> None:
    """What looks like an effect too small to be named, or shows in a straight run."""
    names = list(scored)
    assert began(scored)(monkeypatch) == [names[k] for k in begun]


@pytest.mark.parametrize(
    ("into", "promise", "near", "afresh"),
    [
        ("rudder_lag", 34.0, 34.0, True),
        ("rudder_lag", 34.0, 33.0, False),  # its own fit has said more than the first order
        ("rudder_stall", 0.0, 34.0, True),  # of a limit the first order says nothing
        ("rudder_stall", 0.0, 0.0, False),
        ("rudder_offset", 0.0, 0.0, True),  # the coefficients may have taken it up
    ],
)
def test_a_second_start_is_for_what_may_explain_as_much(
    into, promise, near, afresh, monkeypatch
) -> None:
    asked: list[str] = []
    monkeypatch.setattr(reconsider, "_promise", lambda *_: promise)
    monkeypatch.setattr(reconsider, "without", lambda *_: None)
    monkeypatch.setattr(reconsider, "refit", lambda *_: fitted(near, into))
    for name in ("afresh_too", "from_both"):
        monkeypatch.setattr(reconsider, name, lambda *_: asked.append(into) or fitted(near, into))
    less = reconsider.Less(CASE, fitted(100.0, "gyro_delay"), {("gyro_delay",): fitted(0.0)})
    assert reconsider._fit(less, Exchange(("gyro_delay",), (into,))) is not None
    assert bool(asked) == afresh


def replaced(promise: float) -> Callable[[Patch], Any]:
    """Whether a rudder that is late is fitted in place of a slow gyro that gains 100."""

    def run(patch: Patch) -> bool:
        current, rest = fitted(100.0, "gyro_delay"), fitted(0.0)
        after, tried = fitted(99.0, "rudder_lag"), list[Fitted]()
        patch.setattr(reconsider, "_promise", lambda *_: promise)
        patch.setattr(reconsider, "without", lambda *_: None)
        patch.setattr(reconsider, "refit", lambda *_: tried.append(after))
        patch.setattr(reconsider, "afresh_too", lambda *_: after)
        less = reconsider.Less(CASE, current, {("gyro_delay",): rest})
        return reconsider._fit(less, Exchange(("gyro_delay",), ("rudder_lag",))) is not None

    return run


def removed(worth: float) -> Callable[[Patch], Any]:
    """What is left of two effects, the older of which is worth so much beside the newer."""

    def run(patch: Patch) -> tuple[str, ...]:
        less = fitted(100.0 - worth, "gyro_bias")
        patch.setattr(reconsider, "without", lambda *_: None)
        patch.setattr(reconsider, "from_both", lambda *_: less)
        before = fitted(100.0, "current", "gyro_bias")
        return reconsider.reconsider(CASE, (), before, ())[0].effects

    return run


@pytest.mark.parametrize(
    ("older", "newer", "ahead", "left"),
    [
        ("dvl_misalignment", "propeller_side_force", 13.0, "dvl_misalignment"),
        ("dvl_misalignment", "propeller_side_force", 600.0, "propeller_side_force"),
        ("hull_asymmetry", "propeller_side_force", 13.0, "propeller_side_force"),
    ],
)
def test_what_has_more_parameters_puts_nothing_out_for_little(
    older, newer, ahead, left, monkeypatch
) -> None:
    """Of two of which both together gain little more than either: which one stays?"""
    both = fitted(900.0 + ahead + 30.0, older, newer)
    fits = {
        (newer,): fitted(900.0 + ahead, newer),
        (older,): fitted(900.0, older),
        (): fitted(0.0),
    }
    monkeypatch.setattr(reconsider, "size_of", lambda *_: 2.0)
    monkeypatch.setattr(reconsider, "impossible", lambda *_: False)
    monkeypatch.setattr(reconsider, "prior_cost", lambda *_: 0.0)
    monkeypatch.setattr(reconsider, "without", lambda *_: None)
    monkeypatch.setattr(reconsider, "from_both", lambda case, effects, *_: fits[tuple(effects)])
    found, steps = reconsider.reconsider(COUNTED, (), both, ())
    assert found.effects == (left,) and len(steps) == 1 and "removed" in steps[0]


def test_what_is_taken_out_at_once_is_not_tried_again(monkeypatch) -> None:
    class Asked(Exception):
        pass

    def screened(case: object, before: Fitted, candidates: list[str]) -> None:
        raise Asked(*candidates)

    own = new_search("current", "gyro_bias")
    monkeypatch.setattr(search, "reconsider", lambda case, c, current, unclaimed: (BEFORE, []))
    monkeypatch.setattr(search, "with_best_times", lambda case, before, c: before)
    monkeypatch.setattr(search, "started", lambda case, before: case)
    monkeypatch.setattr(search, "screen", screened)
    tried = Tried(fitted(1e3, "current"), replace(GOOD, id="current", gain=1e3))
    own._after(Round(BEFORE, None, (tried,), {}, (), "current"))  # type: ignore[arg-type]
    with pytest.raises(Asked) as asked:
        own.one_round(BEFORE)
    assert own.put_back == ["current"] and "current" in own.candidates
    assert asked.value.args == tuple(c for c in own.candidates if c != "current")


def lone(worth: float) -> Callable[[Patch], Any]:
    """What is left of a single effect, as after an exchange."""

    def run(patch: Patch) -> tuple[str, ...]:
        done = [(Exchange(("a",), ("current",)), fitted(100.0, "current"))]
        patch.setattr(reconsider, "_exchanged", lambda *_: done.pop() if done else None)
        patch.setattr(reconsider, "without", lambda *_: None)
        less = fitted(100.0 - worth)
        patch.setattr(reconsider, "from_both", lambda *_: less)
        return reconsider.reconsider(CASE, (), fitted(90.0, "a"), ())[0].effects

    return run


def reconciled(gained: float) -> Callable[[Patch], Any]:
    """Channels that count, and what the sensors add to maneuvers left out."""

    def run(patch: Patch) -> Any:
        costs = iter([50.0, 50.0 - gained] * 2)
        for module in (candidates, held_back):
            patch.setattr(module, "check_cost", lambda *_: next(costs))
        falls = candidates.falls_of(CASE, BEFORE, BEFORE)
        found = held_back.with_sensors(CASE, BEFORE, fitted(1.0, "current"), Helped(1.0, 0.5))
        return set(falls), found.gain

    return run


def shown(without: float, with_it: float) -> Callable[[Patch], Any]:
    """Whether sensors that disagree by so much show an effect."""

    def run(patch: Patch) -> bool:
        costs = iter((without, with_it))
        patch.setattr(candidates, "without", lambda *_: None)
        patch.setattr(candidates, "check_cost", lambda *_: next(costs))
        return candidates.by_sensors(CASE, "current", np.zeros(1))

    return run


EIGHT = {name: 50.0 - k for k, name in enumerate(ALONE)}
FIVE = {name: 100.0 - k for k, name in enumerate(ALONE[:5])}
LATE, FALLING = ("rudder_lag", "rudder_stall"), ("thrust_sag", "thrust_step")
SCENARIOS: dict[str, dict[str, Callable[[Patch], Any]]] = {
    "SCREEN": {"worth": listed({"current": 7.0}, {}), "place": listed(EIGHT, {})},
    "SCREEN_FAST": {
        "worth": listed({}, {"current": 7.0}),
        "place": listed({}, dict(list(EIGHT.items())[:5])),
    },
    "SCREEN_APART": {
        "gain": lambda patch: apart({"linear_drag": 19.0}, {"linear_drag": 0.0}),
        "apart": lambda patch: apart({"linear_drag": 50.0}, {"linear_drag": 101.0}),
    },
    "BEGIN": {
        "gain": began({"current": (6.0, 0.5), "gyro_bias": (12.0, 0.5)}),
        "of-best": began(
            {"current": (400.0, 2.0), "gyro_bias": (300.0, 2.0), "gyro_scale": (39.0, 2.0)}
        ),
    },
    "ACCOMPANY": {
        "place": listed({LATE[0]: 50.0, LATE[1]: 40.0, FALLING[0]: 30.0, FALLING[1]: 1.0}, {})
    },
    "LEAD": {"place": again(FIVE, 50.0)},
    "FINISH": {
        "place": finished(FIVE, {}),
        "hopeless": finished({"current": 100.0, "gyro_bias": 29.0}, {}),
    },
    "FINISH_ANYWAY": {
        "steady": finished({STEADY[0]: 100.0, STEADY[1]: 20.0}, {}),
        "rival": finished({"current": 1000.0, "gyro_bias": 200.0}, {"gyro_bias": 90.0}),
        "apart": finished({"current": 1000.0, "gyro_bias": 200.0}, {}, by_others=50.0),
    },
    "AFRESH": {
        "worth-a-start": finished({"current": 29.0}, {}),
        "place": finished(dict(list(FIVE.items())[:3]), {}),
    },
    "LEFT_BEHIND": {"stuck": left_behind(7.0, 26.0)},
    "AGAIN": {
        "stuck": again({"current": 200.0, "gyro_bias": 60.0}, 30.0),
        "rival": again({"current": 200.0, "gyro_bias": 150.0}, 0.0),
    },
    "RULES": {code: judged(**update) for code, update in FAILING["RULES"][1].items()},
    "RULES_LEFT_OUT": {
        code: judged(**update) for code, update in FAILING["RULES_LEFT_OUT"][1].items()
    },
    "RULES_BESIDE": {code: beside(**update) for code, update in FAILING["RULES_BESIDE"][1].items()},
    "HIDDEN": {
        "tried": hidden(helped=None),
        "small": hidden(size=0.9),
        "helps": hidden(t=-0.1),
        "explained": hidden(falls={"v": 0.1}),
    },
    "SENSORS": {"reconciled": reconciled(11.0)},
    "BY_SENSORS": {"reconciled": shown(42.0, 3.0), "share": shown(1000.0, 210.0)},
    "SIMPLER": {
        code: accepted_of(update["other"]) for code, update in FAILING["SIMPLER"][1].items()
    },
    "ALIKE": {
        code: lambda patch, other=update["other"]: told_apart_from(GOOD, [GOOD, other])
        for code, update in FAILING["ALIKE"][1].items()
    },
    "ALIKE_OF_KIND": {
        code: lambda patch, beside=update: told_apart_from(
            (dead := replace(GOOD, id="rudder_deadband")), [dead, beside["other"]]
        )
        for code, update in FAILING["ALIKE_OF_KIND"][1].items()
    },
    "ALIKE_TO_SENSORS": {
        code: lambda patch, other=update["other"]: left_to_the_motion(GOOD, [other])
        for code, update in FAILING["ALIKE_TO_SENSORS"][1].items()
    },
    "CONTAIN": {"further": contained(0, 0.99), "cosine": contained(1, 0.97)},
    "TAKE_ALONG": {
        "unclaimed": taken(unclaimed=2),
        "small": taken(code="impossible"),
        "hides": taken(hidden=19.0),
        "rms": taken(rms=1.2),
        "evidence": taken(t=2.4),
    },
    "CLAIM": {"first": claimed(400.0, "current"), "gain": claimed(200.0)},
    "GO_ON": {"named": named},
    "EXCHANGE_ON": {"done": exchanges_made},
    "REPLACE": {"worth": replaced(promise=33.0)},
    "EXCHANGE": {
        "small": exchanged(size=0.9),
        "impossible": exchanged(wrong=True),
        "swap": exchanged(gain=14.0),
        "fewer": exchanged(gain=-5.0, of="hull_asymmetry", into="rudder_offset"),
        "more": exchanged(of="rudder_offset"),
    },
    "RECONSIDER": {"others": lone(30.0)},
    "STAY": {"removal": removed(30.0)},
}
ROWS = [(name, code) for name, own in SCENARIOS.items() for code in own]


def test_what_no_other_may_explain_is_begun_whatever_the_best_gains(monkeypatch) -> None:
    scored = {"current": (400.0, 2.0), "gyro_bias": (300.0, 2.0), "linear_drag": (25.0, 2.0)}
    shares = {frozenset({c, "linear_drag"}): 0.2 for c in ("current", "gyro_bias")}
    assert began(scored)(monkeypatch) == ["current", "gyro_bias"]
    assert began(scored, shares)(monkeypatch) == ["current", "gyro_bias"]  # 25 of 80 nats
    shares = dict.fromkeys(shares, 0.0)
    assert began(scored, shares)(monkeypatch) == ["current", "gyro_bias", "linear_drag"]


def test_every_rule_has_its_scenario() -> None:
    there = {(name, rule.code) for name, table in TABLES.items() for rule in table}
    assert set(ROWS) == there
    assert set(TABLES) == {*FAILING, *MEETING}


@pytest.mark.parametrize(("name", "code"), ROWS, ids=[f"{n}-{c}" for n, c in ROWS])
def test_without_a_rule_the_search_does_something_else(name, code, monkeypatch) -> None:
    run = SCENARIOS[name][code]
    with monkeypatch.context() as patch:
        with_it = run(patch)
    left = tuple(rule for rule in TABLES[name] if rule.code != code)
    with monkeypatch.context() as patch:
        patch.setattr(rules, name, left)
        assert run(patch) != with_it
