"""Which model a refinement takes: maneuvers left out in turn decide; a failure is an attempt."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from auvident.engines.carried import Carried
from auvident.errors import NumericsError
from auvident.schema.artifacts import (
    IdentifiedModel,
    LeftOutError,
    LeftOutManeuver,
    LeftOutSummary,
)
from auvident.schema.diagnosis import Attempt
from auvident.stages.refine import choose
from auvident.stages.refine.attempts import FLAT, TriedModel, best_of, findings_of
from auvident.stages.refine.claims import claims_of
from auvident.stages.refine.left_out import LeftOutChange, left_out_change
from tests.engines.chain import sample
from tests.stages.test_refine import NONE, carried_effects, claimed, model, predicted

CHANNELS = ("u", "v", "r")
SAMPLES = (100, 200, 300, 400)
BOTH = ("current", "rudder_backlash")


def summary(*errors: dict[str, float]) -> LeftOutSummary:
    """Errors of maneuvers of different lengths; an empty one is lost."""
    rows = (
        LeftOutManeuver(
            id=f"turn-{k}",
            channels={c: LeftOutError(rmse=e, samples=SAMPLES[k]) for c, e in own.items()},
        )
        for k, own in enumerate(errors)
    )
    return LeftOutSummary(maneuvers=tuple(rows), spread={}, model_error={})


def alike(count: int = 4, **errors: float) -> LeftOutSummary:
    return summary(*(dict.fromkeys(CHANNELS, 1.0) | errors for _ in range(count)))


def changed(u: float, v: float, r: float, se: float = 0.01, balance_se: float = 0.01):
    logs = {c: math.log(x) for c, x in zip(CHANNELS, (u, v, r), strict=True)}
    balance = sum(logs.values()) / 3.0
    return LeftOutChange(logs, dict.fromkeys(CHANNELS, se), balance, balance_se)


# --- errors --------------------------------------------------------------------------------


def test_ratios_are_pooled_over_maneuvers_and_the_error_is_that_of_a_jackknife() -> None:
    before = [{"u": 0.1}, {"u": 0.2}, {"u": 0.3}, {"u": 0.1}]
    after = [{"u": 0.1}, {"u": 0.1}, {"u": 0.2}, {"u": 0.2}]
    found = left_out_change(summary(*before), summary(*after))
    assert found is not None

    def ratio(kept: list[int]) -> float:
        n = np.array(SAMPLES)[kept]
        old, new = (np.array([m["u"] for m in ms])[kept] for ms in (before, after))
        return float(np.sqrt((n @ new**2) / (n @ old**2)))

    whole = [0, 1, 2, 3]
    assert found.ratios == {"u": pytest.approx(ratio(whole))}
    without = np.array([math.log(ratio([k for k in whole if k != f])) for f in whole])
    error = math.sqrt(3.0 / 4.0 * np.sum((without - without.mean()) ** 2))
    assert found.standard_errors == {"u": pytest.approx(error)}
    logs = np.log([1.0, 0.5, 2.0 / 3.0, 2.0])  # one vote each
    assert found.balance == pytest.approx(logs.mean())
    assert found.balance_se == pytest.approx(logs.std(ddof=1) / 2.0)


def test_one_maneuver_that_is_lost_without_it_does_not_outvote_the_others() -> None:
    """As the only run with steps of thrust: without it nothing tells the speed."""
    others = [dict.fromkeys(CHANNELS, 0.1)] * 3
    found = left_out_change(
        summary(*others, dict.fromkeys(CHANNELS, 1.0)),
        summary(*[dict.fromkeys(CHANNELS, 0.03)] * 3, dict.fromkeys(CHANNELS, 1.3)),
    )
    assert found is not None and found.ratios["u"] > 1.2
    assert found.balance < 0.0 and found.falls and not found.is_larger


def test_a_channel_that_a_maneuver_lacks_has_no_part_in_its_vote() -> None:
    found = left_out_change(
        summary({"u": 1.0, "v": 1.0}, {"u": 1.0, "v": 1.0}, {"u": 1.0}),
        summary({"u": 0.5, "v": 2.0}, {"u": 0.5, "v": 2.0}, {"u": 0.5}),
    )
    assert found is not None and found.balance == pytest.approx(math.log(0.5) / 3.0)


def test_the_balance_is_the_mean_over_channels_and_alike_maneuvers_have_no_error() -> None:
    found = left_out_change(alike(), alike(u=0.5, r=1.5))
    assert found is not None
    assert found.ratios == pytest.approx({"u": 0.5, "v": 1.0, "r": 1.5})
    assert found.balance == pytest.approx((math.log(0.5) + math.log(1.5)) / 3.0)
    assert found.balance_se == pytest.approx(0.0, abs=1e-12)


def test_maneuvers_are_paired_and_fewer_than_three_pairs_say_nothing() -> None:
    few, lost = alike(2), summary(*[{"u": 1.0}] * 3, {})
    assert left_out_change(alike(), None) is None and left_out_change(None, alike()) is None
    assert left_out_change(few, alike()) is None
    masked = left_out_change(alike(), alike(r=2.0), {"turn-0"})
    assert masked is not None and masked.ratios["r"] == pytest.approx(2.0)
    assert left_out_change(alike(), alike(), {"turn-0", "turn-1"}) is None
    away = left_out_change(alike(), lost)
    assert away is not None and away.ran_away
    assert best_of([TriedModel(("current",), {"u": 0.5}, away)]) is None
    rescued = {"u": FLAT}  # the model before runs away in the very maneuvers that identify
    assert best_of([TriedModel(("current",), rescued, away)]) == 0
    gone = left_out_change(alike(), summary({"u": 1.0}, {}, {}, {}))
    assert gone is not None and gone.ran_away and not gone.ratios
    assert best_of([TriedModel(("current",), {"u": 0.5}, gone)]) is None
    back = left_out_change(lost, alike())
    assert back is not None and not back.ran_away


# --- which one is larger -------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "larger"),
    [
        (changed(0.9, 1.0, 1.0), False),
        (changed(1.05, 1.0, 1.0), True),  # the mean rises ...
        (changed(1.02, 1.0, 1.0), True),  # ... or here, by chance or not
        (changed(0.5, 1.0, 1.8), False),  # a rise by 80 %, outweighed
        (changed(0.5, 1.0, 1.8, balance_se=0.1), True),  # as well by chance
        (changed(0.5, 1.0, 1.8, se=0.7, balance_se=0.1), False),  # as is the rise
        (changed(0.93, 1.0, 1.07, balance_se=0.1), False),  # no tenth
    ],
)
def test_a_larger_error_is_a_mean_that_rises_or_a_rise_that_nothing_outweighs(change, larger):
    assert change.is_larger == larger


def test_left_out_errors_decide_over_those_of_the_fit() -> None:
    """A current of 26 times the noise of the DVL: r rose by 23 % in the fit, u and v fell."""
    rose = {"u": 0.05, "v": 0.04, "r": 1.23}
    assert best_of([TriedModel(("current",), rose)]) is None
    assert best_of([TriedModel(("current",), rose, changed(0.1, 0.15, 0.9))]) == 0
    fell = dict.fromkeys(CHANNELS, 0.5)
    assert best_of([TriedModel(("current",), fell, changed(1.2, 1.1, 1.0))]) is None
    assert (
        best_of([TriedModel(("current",), fell | {"u": math.inf}, changed(0.1, 0.1, 0.1))]) is None
    )


def test_where_left_out_errors_do_not_tell_those_of_the_fit_decide() -> None:
    by_chance = changed(0.9, 1.1, 0.9, se=0.6, balance_se=0.6)
    fell = {"u": 0.92, "v": 0.86, "r": 0.76}
    assert best_of([TriedModel(("current",), fell, by_chance)]) == 0
    assert best_of([TriedModel(("current",), fell | {"r": 1.3}, by_chance)]) is None


# --- attempts ------------------------------------------------------------------------------


def with_left_out(left_out: LeftOutSummary) -> IdentifiedModel:
    return model().model_copy(update={"left_out": left_out})


def refined(
    *outcomes: LeftOutSummary | None,
    found: tuple[str, ...] = ("current",),
    small: Carried | None = None,
):
    """Attempts that end with these left-out errors (None: they fail), and what was asked for."""
    asked: list[Carried] = []

    def again(carried: Carried):
        asked.append(carried)
        left_out = outcomes[len(asked) - 1]
        if left_out is None:
            raise NumericsError("the covariance is not positive definite", "zigzag-1 at 12.0 s")
        return SimpleNamespace(model=with_left_out(left_out)), SimpleNamespace(
            simulation=predicted(0)
        )

    before = SimpleNamespace(simulation=predicted(0))
    carried = carried_effects(*found) if found else None
    return (*choose(carried, with_left_out(alike()), before, again, small), asked)


def test_a_channel_that_rises_is_kept_by_the_next_attempt() -> None:
    rising = [alike(u=0.3, r=1.3), alike(u=0.5, r=1.2), alike(u=0.4, r=1.3)]
    made, rows, asked = refined(*rising, alike(u=0.6, v=0.9))
    assert [row.keeps for row in rows] == [(), (), (), (), ("r",)]
    assert [row.own_starts for row in rows] == [False, False, False, True, False]
    assert made is not None and made.carried == asked[3] and rows[4].taken
    # it starts from the best of them, and u and v count as if they were as far off as before
    assert asked[3].start == asked[0].start
    assert asked[3].least_noise == pytest.approx({"u_mps": 0.03, "v_mps": 0.02})
    assert rows[4].left_out == pytest.approx({"u": 0.6, "v": 0.9, "r": 1.0})
    assert rows[4].balance == pytest.approx(math.log(0.54) / 3.0) and rows[4].balance_se is not None


def test_with_fitted_starts_no_channel_may_rise_and_then_that_is_taken() -> None:
    made, rows, asked = refined(alike(u=0.3, r=1.3), alike(u=0.5, r=1.2), alike(u=0.6))
    assert made is not None and made.carried == asked[2] and asked[2].own_starts
    assert [row.taken for row in rows] == [False, False, False, True]


def test_the_best_is_taken_where_no_attempt_keeps_the_channel() -> None:
    made, rows, _ = refined(*[alike(u=u, r=1.3) for u in (0.3, 0.2, 0.4, 0.5)])
    assert made is not None and [row.taken for row in rows] == [False, False, True, False, False]
    (finding,) = findings_of(rows)
    assert finding.code == "error-rises" and "left out in turn, by 30 %" in finding.message


@pytest.mark.parametrize(("alone", "taken"), [(0.4, ("current",)), (0.8, BOTH)])
def test_what_makes_one_maneuver_much_worse_has_to_be_better_than_less(alone, taken) -> None:
    """The only straight run told how large a false backlash was: r seven times as large there."""
    others = [dict.fromkeys(CHANNELS, 0.4)] * 3
    spoilt = summary({"u": 0.4, "v": 0.4, "r": 14.0}, *others)
    less = alike(**dict.fromkeys(CHANNELS, alone))
    made, rows, asked = refined(spoilt, less, found=BOTH)
    assert [row.effects for row in rows] == [(), BOTH, ("current",)]
    assert rows[1].left_out["r"] > 2.0 and rows[1].balance < 0.0
    assert made is not None and made.carried.effects == taken and len(asked) == 2


def test_channels_that_count_less_have_at_least_that_noise() -> None:
    setup = sample("harbour_trial").setup(carried=Carried(least_noise={"u_mps": 0.5}))
    plain = sample("harbour_trial").setup()
    assert setup.sensor_std[0] == 0.5
    np.testing.assert_array_equal(setup.sensor_std[1:], plain.sensor_std[1:])


def test_an_attempt_that_fails_leaves_the_others_and_the_model_before() -> None:
    made, rows, asked = refined(None, alike(u=0.5))
    assert made is not None and made.carried == asked[1]
    assert rows[1].failed == "the covariance is not positive definite (zigzag-1 at 12.0 s)"
    assert [row.taken for row in rows] == [False, False, True]
    (finding,) = findings_of(rows)
    assert (finding.code, finding.where) == ("attempt-failed", "current")
    made, rows, _ = refined(None, None, None)
    assert made is None and [row.taken for row in rows] == [True, False, False, False]
    assert [f.code for f in findings_of(rows)] == 3 * ["attempt-failed"]


# --- small effects alone -------------------------------------------------------------------

SMALL = Carried(start={"rudder_lag.lag_s": 0.1}, prior_std={"rudder_lag.lag_s": 0.1})


def with_small(*outcomes: LeftOutSummary | None, found: tuple[str, ...] = ()):
    return refined(*outcomes, found=found, small=SMALL)


def test_small_effects_alone_are_tried_where_nothing_was_found() -> None:
    made, rows, asked = with_small(alike(u=0.5))
    assert made is not None and asked == [SMALL]
    assert [(row.taken, row.unclaimed) for row in rows] == [(False, False), (True, True)]
    (finding,) = findings_of(rows)
    assert finding.code == "identified-again" and "each left out in turn u -50 %" in finding.message


def test_small_effects_that_cost_a_channel_are_tried_with_fitted_starts_or_left() -> None:
    made, rows, asked = with_small(alike(u=0.9, r=1.6), alike(u=0.5))
    assert made is not None and [c.own_starts for c in asked] == [False, True] and rows[2].taken
    made, rows, _ = with_small(alike(u=0.9, r=1.6), None)
    assert made is None and [row.taken for row in rows] == [True, False, False]
    assert "small effects alone" in findings_of(rows)[0].where


def test_small_effects_alone_follow_what_was_found_and_is_refused() -> None:
    refused = [alike(u=1.2)] * 4
    made, rows, asked = with_small(*refused, alike(u=0.5), found=("current",))
    assert made is not None and asked[4] == SMALL
    assert [row.unclaimed for row in rows] == [False] * 5 + [True]
    made, rows, asked = with_small(alike(u=0.5), found=("current",))
    assert made is not None and len(asked) == 1 and rows[1].taken  # no need to


def test_small_effects_that_are_refused_say_nothing_of_an_effect() -> None:
    small = Attempt(effects=(), unclaimed=True, left_out={"u": 1.4})
    before = Attempt(effects=(), taken=True)
    rest = NONE, model(), [before, small], 1.5, 0.1
    assert claims_of(*rest)["statement"] == claims_of(*rest[:2], [], *rest[3:])["statement"]


# --- what is said --------------------------------------------------------------------------


def test_a_person_is_told_why_the_old_model_stays() -> None:
    left_out = Attempt(effects=("rudder_offset",), left_out={"u": 0.9, "r": 1.4}, ratios={"r": 0.5})
    failed = Attempt(effects=("rudder_offset",), failed="the covariance is singular")
    said = claimed(1.3, 0.05, (Attempt(effects=(), taken=True), left_out, failed))
    assert "each left out in turn" in said.statement and "u -10 %, r +40 %" in said.statement
    assert said.statement.endswith("The identified model is kept.") and not said.effects
    said = claimed(1.3, 0.05, (Attempt(effects=(), taken=True), failed))
    assert "could not be identified (the covariance is singular)" in said.statement
