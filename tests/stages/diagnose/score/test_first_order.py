"""The screen of all effects against explicit Newton steps."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from auvident.engines.free_run import normal_equations
from auvident.schema.effects import in_plane
from auvident.stages.diagnose.fit.case import Case
from auvident.stages.diagnose.fit.fits import fit_with, log_gain, output_error, prior_of
from auvident.stages.diagnose.fit.refits import best_of, from_estimate
from auvident.stages.diagnose.score.first_order import (
    Blocks,
    Form,
    Joint,
    cosine,
    excess_variance,
    information_by_record,
    joint_about,
    score,
    scores_of_forms,
    unabsorbed,
)
from tests.stages.diagnose.loop_chain import small_case, small_fit

EFFECTS = tuple(e.id for e in in_plane("horizontal"))
TRIED = (
    "current",
    "rudder_offset",
    "rudder_lag",
    "gyro_bias",
    "hull_asymmetry",
    "rudder_backlash",
    "dvl_lever_arm",
    "thrust_sag",
    "dvl_delay",
    "linear_drag",
)


@cache
def joint() -> Joint:
    found = joint_about(small_case(), small_fit(), EFFECTS)
    assert found is not None
    return found


def by_hand(effect: str) -> tuple[np.ndarray, ...]:
    """Gradient and curvature of the log posterior with an effect free, from its parts."""
    case, fitted = small_case(), small_fit()
    free = case.with_baseline((effect,))
    prior, moving = prior_of(case, free, case.positions(effect)), case.setup.free(free)
    theta = fitted.parameters[free] / moving.scale
    gradient, curvature = prior.information @ (theta - prior.mean), prior.information.copy()
    for record in case.records:
        output = output_error(case, fitted.colours)
        parts = normal_equations(output, fitted.parameters, record, moving)
        assert parts is not None
        gradient, curvature = gradient + parts[1], curvature + parts[2]
    return free, theta, gradient, curvature, prior.low, prior.high


@pytest.mark.parametrize("effect", TRIED)
def test_score_is_a_newton_step_within_bounds(effect) -> None:
    """Nothing but the conditions of a least value is asked: of the slope at the end of the step."""
    free, theta, gradient, curvature, low, high = by_hand(effect)
    found, case = score(joint(), (effect,)), small_case()
    step = found.parameters[free] / case.setup.prior_std[free] - theta
    gain = -(gradient @ step + 0.5 * step @ curvature @ step)
    # two ways to eliminate the start differ by rounding, brought up by the condition (1e6)
    assert found.gain == pytest.approx(gain, rel=1e-6)
    there, slope = theta + step, gradient + curvature @ step
    size = np.sqrt(np.diag(curvature))
    at_low, at_high = there <= low + 1e-9, there >= high - 1e-9
    assert ((there >= low - 1e-9) & (there <= high + 1e-9)).all()
    assert (np.abs(slope / size)[~at_low & ~at_high] < 1e-5).all()
    assert (slope[at_low & ~at_high] > -1e-5 * size[at_low & ~at_high]).all()
    assert (slope[at_high & ~at_low] < 1e-5 * size[at_high & ~at_low]).all()
    rest = np.setdiff1d(np.arange(len(found.parameters)), free)
    np.testing.assert_array_equal(found.parameters[rest], small_fit().parameters[rest])


def test_a_model_with_more_freedom_gains_no_less() -> None:
    alone = score(joint(), ("rudder_offset",)).gain
    both = score(joint(), ("rudder_offset", "gyro_bias")).gain
    nothing = score(joint(), ()).gain
    # a fit that has not quite ended has a little to gain without any effect
    assert both >= alone - 1e-6
    assert alone >= nothing - 1e-6
    assert 0.0 <= nothing < 20.0


def turned(case: Case, yaw: float) -> Case:
    """The case as a DVL turned by `yaw` to starboard would have logged it."""
    c, s = np.cos(yaw), np.sin(yaw)
    turn = np.eye(4)
    turn[:2, :2] = [[c, -s], [s, c]]  # rows times this: (u c + v s, v c - u s)
    records = []
    for r in case.records:
        assert r.source is not None
        source = replace(r.source, bridged=r.source.bridged @ turn, start=r.source.start @ turn)
        measured = np.where(np.isfinite(r.measured), source.bridged, np.nan)
        records.append(
            replace(r, measured=measured, given=r.given @ turn, start=r.start @ turn, source=source)
        )
    return replace(case, records=tuple(records))


def test_a_planted_effect_is_found_to_first_order() -> None:
    case, yaw = turned(small_case(), 0.02), "dvl_misalignment.yaw_deg"
    # from two starts, as the search does: without the effect there is more than one valley
    own = small_fit().parameters
    before = best_of([fit_with(case, (), own, small_fit().colours), from_estimate(case, (), own)])
    assert before is not None
    about = joint_about(case, before, EFFECTS)
    assert about is not None
    gains = {e: score(about, (e,)).gain for e in EFFECTS}
    assert max(gains, key=lambda e: gains[e]) == "dvl_misalignment"
    found = score(about, ("dvl_misalignment",)).parameters[case.position(yaw)]
    without = score(joint(), ("dvl_misalignment",)).parameters[case.position(yaw)]
    # it enters almost linearly; the coefficients have moved a little to take it up
    assert found - without == pytest.approx(0.02, rel=0.1)
    after = fit_with(case, ("dvl_misalignment",), before.parameters, before.colours)
    assert after is not None
    assert log_gain(before, after) > 60.0
    assert after.parameters[case.position(yaw)] - without == pytest.approx(0.02, rel=0.05)


# --- likeness ------------------------------------------------------------------------------


@pytest.mark.parametrize("effect", TRIED)
def test_an_effect_is_like_itself(effect) -> None:
    own = small_case().positions(effect)
    # the root of a curvature that is singular because both are the same
    assert cosine(joint(), own, own) == pytest.approx(1.0, abs=1e-6)


def test_likeness_is_symmetric_and_below_one_for_different_effects() -> None:
    case = small_case()
    for a, b in (
        ("current", "gyro_bias"),
        ("rudder_offset", "thrust_sag"),
        ("rudder_lag", "dvl_lever_arm"),
    ):
        one = cosine(joint(), case.positions(a), case.positions(b))
        other = cosine(joint(), case.positions(b), case.positions(a))
        assert one == pytest.approx(other, abs=1e-9)
        assert one < 0.9


def test_an_offset_is_a_special_case_of_an_asymmetric_hull() -> None:
    """Both are a side force and moment that go with the square of the speed."""
    case = small_case()
    assert cosine(joint(), case.positions("rudder_offset"), case.positions("hull_asymmetry")) > 0.95


def test_what_coefficients_take_up_is_not_kept() -> None:
    """A scale of the DVL is in every coefficient: without a position nothing shows it."""
    case = small_case()
    scale = unabsorbed(joint(), case.positions("dvl_scale"))
    bias = unabsorbed(joint(), case.positions("gyro_bias"))
    assert scale.kept[0] < 0.1
    assert bias.kept[0] > 0.3
    assert ((bias.kept >= 0.0) & (bias.kept <= 1.0)).all()
    assert bias.rms.shape == (1, 3)


def test_the_information_of_the_maneuvers_adds_up():
    left = unabsorbed(joint(), small_case().positions("gyro_bias"))
    found = information_by_record(joint(), left)
    assert found.shape == (1, len(small_case().records))
    # less what the prior of the others holds while they adjust: 5 % at most
    assert 0.95 * left.information[0, 0] < found.sum() <= left.information[0, 0] * (1.0 + 1e-9)


def drawn_blocks(about: Joint, excess: float, count: int, seed: int = 3) -> Joint:
    """Blocks of equal information whose gradients scatter by it, or by more."""
    n = len(about.free)
    own = np.eye(n) * 4.0
    drawn = np.random.default_rng(seed).normal(0.0, np.sqrt(4.0 * excess), (count, n))
    blocks = Blocks(np.zeros(count, np.int64), drawn, np.repeat(own[None], count, axis=0))
    return replace(about, blocks=blocks)


@pytest.mark.parametrize("excess", [1.0, 9.0])
def test_scores_that_scatter_more_than_they_should_are_told(excess):
    about = drawn_blocks(joint(), excess, 4000)
    left = unabsorbed(about, small_case().positions("gyro_bias"))
    assert excess_variance(about, left) == pytest.approx([excess], rel=0.1)


def test_the_scatter_of_few_blocks_counts_without_what_the_estimate_takes_of_it():
    about, at = joint(), small_case().positions("gyro_bias")
    left = unabsorbed(about, at)
    found = [excess_variance(drawn_blocks(about, 1.0, 3, seed), left)[0] for seed in range(300)]
    assert np.mean(found) == pytest.approx(1.0, abs=0.2)  # its standard error is 0.06


def test_an_effect_that_is_there_is_no_excess():
    """What all blocks say alike is the effect's size, not its scatter."""
    about = drawn_blocks(joint(), 1.0, 4000)
    left = unabsorbed(about, small_case().positions("gyro_bias"))
    pull = 50.0 * np.einsum("bij,j->bi", about.blocks.curvature, left.along[:, 0])
    there = replace(about, blocks=replace(about.blocks, gradient=about.blocks.gradient - pull))
    assert excess_variance(there, left) == pytest.approx(excess_variance(about, left))


def test_the_blocks_of_a_screen_add_up_to_it():
    found = joint()
    assert len(found.blocks.record) == len(found.blocks.gradient) > len(small_case().records)
    assert set(found.blocks.record) == set(range(len(small_case().records)))
    # but for what the prior of the starts takes, which is of the whole record
    scale = np.sqrt(np.diag(found.curvature))
    off = (found.blocks.curvature.sum(axis=0) - found.curvature) / np.outer(scale, scale)
    assert np.abs(off).max() < 0.02


# --- forms of an absent effect -------------------------------------------------------------


def test_forms_of_an_absent_effect_gain_what_a_whole_screen_says() -> None:
    case, fitted, form = small_case(), small_fit(), "thrust_step.time_s"
    vectors = []
    for time in (60.0, 200.0, 410.0):
        p = fitted.parameters.copy()
        p[case.position(form)] = time
        vectors.append(p)
    forms = [Form(p, case.records) for p in vectors]
    found = [s.gain for s in scores_of_forms(case, fitted, "thrust_step", forms) or ()]
    for p, gain in zip(vectors, found, strict=True):
        whole = joint_about(case, replace(fitted, parameters=p), ("thrust_step",))
        assert whole is not None
        assert gain == pytest.approx(score(whole, ("thrust_step",)).gain, rel=1e-6)
    assert np.ptp(found) > 0.1
