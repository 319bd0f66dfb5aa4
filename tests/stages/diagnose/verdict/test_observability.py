"""Sizes that are stated to be seen."""

from dataclasses import replace

import numpy as np
import pytest

from auvident.schema.planes import HORIZONTAL, VERTICAL
from auvident.stages.diagnose.score.first_order import Joint, joint_about
from auvident.stages.diagnose.score.left_out import t_value
from auvident.stages.diagnose.select.candidates import Tried
from auvident.stages.diagnose.select.records import Account
from auvident.stages.diagnose.select.rule import Refusal
from auvident.stages.diagnose.select.rules import LEAST_T
from auvident.stages.diagnose.verdict import observability
from auvident.stages.diagnose.verdict.observability import MARGIN_LEFT_OUT, _by_left_out
from tests.stages.diagnose.loop_chain import small_case, small_fit

MANEUVERS = 12
BLOCKS = np.full(MANEUVERS, 4.0)


def reached(information: np.ndarray, size: float) -> float:
    """How often an effect of some size reaches `LEAST_T`, with gains drawn block by block."""
    rng = np.random.default_rng(1)
    mean = 0.5 * size**2 * np.repeat(information / BLOCKS, 4)
    gains = mean + np.sqrt(2.0 * mean) * rng.normal(size=(2000, mean.size))
    return float(np.mean([t_value(g) >= LEAST_T for g in gains]))


@pytest.mark.parametrize("shares", [np.ones(MANEUVERS), np.arange(1.0, MANEUVERS + 1.0)])
def test_an_effect_of_the_stated_size_reaches_the_rule_half_of_the_time(shares):
    size = _by_left_out(shares, BLOCKS)
    assert 0.35 < reached(shares, size) < 0.65
    assert reached(shares, MARGIN_LEFT_OUT * size) > 0.94


def test_what_shows_in_one_maneuver_alone_is_seen_at_no_size():
    alone = np.zeros(MANEUVERS)
    alone[0] = 1.0
    assert _by_left_out(alone, BLOCKS) == np.inf


def test_a_force_that_lays_no_fin_matters_at_no_size(monkeypatch):
    """As that of a propeller that stands still: nothing is divided by it."""
    about = joint_about(small_case(), small_fit(), ("propeller_side_force",))
    assert about is not None
    with np.errstate(divide="raise"):
        every = observability._practical(about, "propeller_side_force")
        monkeypatch.setattr(observability, "in_parts", lambda *_: np.array([[2.0, 0.0]] * 2))
        none = observability._practical(about, "propeller_side_force")
    assert np.all(np.isfinite(every)) and none[1] > 1e6 * none[0] > 0.0


def test_a_push_is_stated_in_the_channels_of_the_plane():
    rows = observability.detectable_push((0.04, 0.02), VERTICAL)
    assert [(r.symbol, r.unit, r.visible) for r in rows] == [
        ("w_mps", "m/s", True),
        ("q_degps", "deg/s", True),
    ]
    sizes = [r.size / observability.UNFORESEEN for r in rows]
    assert sizes == pytest.approx([0.04, np.degrees(0.02)])


def test_without_a_second_maneuver_no_push_is_seen():
    rows = observability.detectable_push(None, HORIZONTAL)
    assert [r.symbol for r in rows] == ["v_mps", "r_degps"]
    assert not any(r.visible for r in rows) and all(np.isfinite(r.size) and r.why for r in rows)


def told(refusal: Refusal | None, delay_s: float) -> tuple[Tried, Joint]:
    """A late rudder as it came out of a fit, and what became of it."""
    about = joint_about(small_case(), small_fit(), ("rudder_delay",))
    assert about is not None
    p = about.fitted.parameters.copy()
    p[about.case.positions("rudder_delay")] = delay_s
    account = Account("rudder_delay", 100.0, 0.0, 1, 9.0, {}, (), False, True, 100.0, 5)
    return Tried(replace(about.fitted, parameters=p), account, refusal), about


@pytest.mark.parametrize(("code", "raised"), [("evidence", True), ("of-best", False)])
def test_no_size_is_stated_at_which_the_effect_was_tried_and_refused(code, raised):
    tried, about = told(Refusal(code, "too weak"), 5.0)
    every = [observability.detectable(about, about, ("rudder_delay",), f) for f in ((), (tried,))]
    (before,), (after,) = every
    assert before.size < 5.0
    expected = observability.UNFORESEEN * 5.0 if raised else before.size
    assert after.size == pytest.approx(expected)


def test_an_effect_that_was_accepted_keeps_the_size_of_the_rules():
    tried, about = told(None, 5.0)
    assert not observability._shown_in_vain(about, (tried,))
