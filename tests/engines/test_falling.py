"""How far a hull may leave its predicted course that hardly keeps one."""

from dataclasses import replace

import numpy as np
import pytest

from auvident.engines.carried import frame_of, free_behind, vector_behind
from auvident.engines.falling import (
    MEMBERS,
    MORE_GROWTH,
    Pushed,
    PushesAlong,
    fallen_models,
    growth_of_push,
    hardly_keeps_course,
    pushes_of,
    simulated_pushed,
)
from auvident.engines.prediction import Frame, at_effects, simulated
from auvident.engines.predictive import band_of, parameter_variance
from auvident.engines.records import Record
from auvident.physics.dynamics import ALL_STATES
from tests.engines.chain import identified, setup_of

LENGTH_M = identified("harbour_trial").model.length_m
NO_PUSH = PushesAlong(np.zeros(4), LENGTH_M)


def harbour(kind: str = "zigzag") -> tuple[Frame, np.ndarray, Record]:
    model, setup = identified("harbour_trial").model, setup_of("harbour_trial")
    record = next(r for what, r in setup.records.values() if what == kind)
    return frame_of(model, setup.dt_s), vector_behind(model), record


def unstable() -> tuple[Frame, np.ndarray]:
    """The hull of `harbour_trial` with so much more Munk moment that it does not keep a course."""
    frame, p, _ = harbour()
    p[frame.structure.index("N_uv")] *= 10.0
    assert hardly_keeps_course(frame.structure, p, LENGTH_M)
    return frame, p


def amidships(record: Record) -> Record:
    """A minute straight ahead with the fin amidships at the speed and rpm of a record."""
    rows = np.zeros(600, dtype=int)
    inputs = record.inputs[rows].copy()
    inputs[:, 0] = 0.0
    start = np.array([record.start[0], 0.0, 0.0, 0.0])
    given = np.tile(start, (600, 1))
    time = np.arange(600) * (record.time_s[1] - record.time_s[0])
    measured = np.full((600, 4), np.nan)
    return Record("ahead", time, inputs, given, measured, start, None)


def test_a_stable_hull_keeps_its_course_and_one_with_more_munk_moment_does_not() -> None:
    frame, p, _ = harbour()
    assert not hardly_keeps_course(frame.structure, p, LENGTH_M)
    unstable()


def test_a_push_grows_as_the_simulation_of_it_does() -> None:
    frame, p = unstable()
    record, rows = amidships(harbour()[2]), np.array([0])
    acting = at_effects(frame, p, record)
    push = np.array([[0.0, 0.0, 1.0e-7, 0.0]])
    without = simulated_pushed(frame, p, acting, Pushed.none(rows))
    left = simulated_pushed(frame, p, acting, Pushed(rows, push, np.zeros(4)))
    rate = growth_per_length(frame, left, without)
    assert rate == pytest.approx(growth_of_push(frame.structure, p, LENGTH_M), rel=0.02)


def growth_per_length(frame: Frame, left: np.ndarray, without: np.ndarray) -> float:
    """Rate at which a yaw rate leaves that of another course [1/hull length]."""
    away = np.abs(left - without)[:, 2]
    lengths = np.cumsum(without[:, 0]) * frame.dt_s / LENGTH_M
    part = (lengths > 4.0) & (lengths < 8.0)  # the quicker motion has died away
    return float(np.polyfit(lengths[part], np.log(away[part]), 1)[0])


@pytest.mark.parametrize("more", [-0.05, 0.05])
def test_what_a_model_is_off_grows_by_so_much_more(more: float) -> None:
    frame, p = unstable()
    record = amidships(harbour()[2])
    acting, rows = at_effects(frame, p, record), NO_PUSH.rows(record, frame.dt_s)
    without = simulated_pushed(frame, p, acting, Pushed.none(rows))
    by = np.zeros((len(rows), 4))
    by[0, 2] = 1.0e-7
    rates = [
        growth_per_length(
            frame,
            simulated_pushed(frame, p, acting, Pushed(rows, by, share * np.ones(4)), without),
            without,
        )
        for share in (0.0, more)
    ]
    assert rates[1] - rates[0] == pytest.approx(np.log1p(more), rel=0.1)


def test_a_course_that_was_not_pushed_does_not_leave_itself() -> None:
    frame, p = unstable()
    record = amidships(harbour()[2])
    acting, rows = at_effects(frame, p, record), NO_PUSH.rows(record, frame.dt_s)
    without = simulated_pushed(frame, p, acting, Pushed.none(rows))
    still = Pushed(rows, np.zeros((len(rows), 4)), np.ones(4))
    np.testing.assert_array_equal(simulated_pushed(frame, p, acting, still, without), without)


def test_only_the_states_that_are_pushed_grow_more() -> None:
    rng = np.random.default_rng(4)
    drawn = [PushesAlong(np.zeros(6), 2.0, (2, 4)).drawn(np.arange(3), rng) for _ in range(2000)]
    more = np.array([one.more for one in drawn])
    assert not more[:, [0, 1, 3, 5]].any()
    np.testing.assert_array_equal(more[:, 2], more[:, 4])
    assert np.mean(more[:, 2]) == pytest.approx(MORE_GROWTH[0], abs=0.003)
    assert np.std(more[:, 2]) == pytest.approx(MORE_GROWTH[1], rel=0.1)


def test_without_a_push_the_simulation_is_the_usual_one() -> None:
    frame, p, record = harbour()
    acting, rows = at_effects(frame, p, record), NO_PUSH.rows(record, frame.dt_s)
    pushed = simulated_pushed(frame, p, acting, Pushed.none(rows))
    np.testing.assert_allclose(
        pushed, simulated(frame, p, acting, ALL_STATES), rtol=1e-12, atol=1e-12
    )


def test_a_hull_is_pushed_at_its_start_and_once_each_length() -> None:
    frame, _, record = harbour()
    rows = NO_PUSH.rows(record, frame.dt_s)
    assert rows[0] == 0 and rows[-1] < len(record) - 1
    metres = np.diff(rows) * frame.dt_s * record.start[0]
    np.testing.assert_allclose(metres, LENGTH_M, atol=frame.dt_s * record.start[0])


def test_pushes_add_up_to_what_most_maneuvers_left_out_were_off() -> None:
    """Of seven pushes the first acts all the way, the last at the end: four in the mean."""
    off = [{"v": 16e-4, "r": 144e-6}, {"v": 16e-4, "r": 144e-6}, {"v": 4.0, "r": 1.0}, {"r": -1.0}]
    one, seven = (pushes_of([(by, n) for by in off], "horizontal", 2.0).std for n in (1, 7))
    np.testing.assert_allclose(one, [0.0, 0.04, 0.012, 0.0], rtol=1e-12)
    np.testing.assert_allclose(seven, one / 2.0, rtol=1e-12)
    assert not pushes_of([], "horizontal", 2.0).std.any()
    assert not pushes_of([({"v": -1.0}, 3)], "horizontal", 2.0).std.any()


def test_pushes_of_a_hull_that_forgets_none_are_the_steps_of_its_errors() -> None:
    """Errors that are random walks, told as those of maneuvers left out, give their steps."""
    rng, steps = np.random.default_rng(3), 30
    walks = np.cumsum(rng.normal(0.0, 0.02, (400, steps)), axis=1)
    left = [({"r": float(np.mean(walk**2))}, steps) for walk in walks]
    found = pushes_of(left, "horizontal", 2.0).std[2]
    # of what is skewed the median lies below the mean: 0.58 of it (20,000 walks), 0.76 of the root
    assert found == pytest.approx(0.76 * 0.02, rel=0.15)  # 400 walks: 5 %


def test_models_drawn_spread_as_the_covariance_says_where_the_course_is_kept() -> None:
    frame, p, record = harbour()
    free, covariance = free_behind(identified("harbour_trial").model)
    linear = parameter_variance(frame, p, record, free, covariance)
    found = fallen_models(frame, p, record, free, covariance, NO_PUSH)
    drawn = found.variance
    assert found.ran_away == 0
    assert set(drawn) == set(linear)
    for name, variance in drawn.items():  # 64 draws: 18 % of the mean square
        assert np.mean(variance) == pytest.approx(np.mean(linear[name]), rel=0.5), name


def test_a_hull_that_may_fall_to_either_side_is_off_by_the_way_to_the_other() -> None:
    """It turns one way in the prediction; of those pushed, about half turn the other way."""
    frame, p = unstable()
    record = amidships(harbour()[2])
    record = replace(record, start=np.array([record.start[0], 0.0, 1.0e-4, 0.0]))
    free, covariance = free_behind(identified("harbour_trial").model)
    turning = simulated(frame, p, at_effects(frame, p, record), ALL_STATES)[-1, 2]
    assert abs(turning) > 0.3
    pushes = PushesAlong(np.array([0.0, 1.0e-3, 1.0e-3, 0.0]), LENGTH_M)
    found = fallen_models(frame, p, record, free, 1.0e-6 * covariance, pushes).variance
    other = 2.0 * abs(turning)
    assert 0.3 < found["r"][-1] / other**2 < 0.7  # 64 coins: 0.5 +- 0.06
    assert found["r"][0] < 1.0e-5


def test_models_that_run_away_are_counted_and_the_spread_is_that_of_the_others() -> None:
    """With a hundred times the covariance most diverge, and the others spread no further."""
    frame, p = unstable()
    record = amidships(harbour()[2])
    free, covariance = free_behind(identified("harbour_trial").model)
    pushes = PushesAlong(np.array([0.0, 1.0e-3, 1.0e-3, 0.0]), LENGTH_M)
    with np.errstate(all="ignore"):
        found = fallen_models(frame, p, record, free, 100.0 * covariance, pushes)
    assert 0.3 * MEMBERS < found.ran_away < MEMBERS
    assert all(np.isfinite(variance).all() for variance in found.variance.values())


def test_the_band_of_a_hull_that_may_fall_reaches_the_other_side() -> None:
    model, (_, _, record) = identified("harbour_trial").model, harbour("straight")
    dt_s = setup_of("harbour_trial").dt_s
    assert model.left_out is not None and model.left_out.push == {}
    told = model.left_out.model_copy(update={"push": {"v": 0.01, "r": 0.01}})
    usual, pushed = (
        band_of(m, record, dt_s).half_width
        for m in (model, model.model_copy(update={"left_out": told}))
    )
    assert all((pushed[name] >= usual[name]).all() for name in usual)
    assert pushed["r"].mean() > usual["r"].mean()
