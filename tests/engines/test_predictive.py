"""The predictive band: its slopes by differences, its factor on drawn errors."""

import numpy as np
import pytest

from auvident.engines.carried import frame_of, free_behind, predicted_course, vector_behind
from auvident.engines.predictive import (
    TRACK_GROWTH,
    LeftOutCourse,
    drifting,
    errors_of,
    left_out_course,
    model_error,
    parameter_variance,
)
from auvident.physics.dynamics import ALL_STATES
from auvident.physics.maneuvers import track_of
from tests.engines.chain import identified, setup_of


@pytest.mark.parametrize("symbol", ["X_uu", "Y_uv", "N_uud", "Y_rdot"])
def test_variance_by_one_parameter_is_the_squared_change_of_the_prediction(symbol) -> None:
    model, setup = identified("harbour_trial").model, setup_of("harbour_trial")
    frame, (free, _) = frame_of(model, setup.dt_s), free_behind(model)
    p, k = vector_behind(model), model.covariance["symbols"].index(symbol)
    record = next(r for kind, r in setup.records.values() if kind == "zigzag")
    unit = np.zeros(len(free.positions))
    unit[k] = 1.0
    found = parameter_variance(frame, p, record, free, np.outer(unit, unit))
    step = 1.0e-4  # the third derivative adds its square, the rounding 1e-12
    there, back = (
        predicted_course(frame, free.moved(p, s * step * unit), record, ALL_STATES)
        for s in (1.0, -1.0)
    )
    slopes = (there.readings - back.readings) / (2.0 * step)
    for c, name in enumerate(("u", "v", "r", "heading")):
        scale = np.abs(slopes[:, c]).max() ** 2
        np.testing.assert_allclose(found[name], slopes[:, c] ** 2, atol=1e-6 * scale)
    tracks = [track_of(record.time_s, course.over_ground) for course in (there, back)]
    squared = np.sum(((tracks[0] - tracks[1]) / (2.0 * step)) ** 2, axis=1)
    # trapezoids of slopes, not slopes of trapezoids
    np.testing.assert_allclose(found["track"], squared, atol=1e-4 * squared.max())


def course(rng: np.random.Generator, std: float, spread: float, n: int = 400) -> LeftOutCourse:
    """Errors of four channels and a track: model and sensor noise, known variance by parameters."""
    elapsed = np.arange(n) * 0.1
    drift = rng.normal(0.0, std) * (1.0 + elapsed) ** TRACK_GROWTH
    white = rng.normal(0.0, np.hypot(std, spread), (4, n))
    names = ("u", "v", "r", "heading")
    error = {name: np.abs(white[i]) for i, name in enumerate(names)} | {"track": np.abs(drift)}
    variance = {name: np.full(n, spread**2) for name in names} | {"track": np.zeros(n)}
    return LeftOutCourse("made", elapsed, error, variance, {})


def test_what_is_left_of_a_course_beyond_coefficients_and_noise() -> None:
    """Of squares 4, 16 and one reading that is not there: 10 - 1 - 3^2 = 0."""
    error, variance = {"v": np.array([2.0, np.nan, 4.0])}, {"v": np.array([0.5, 9.0, 1.5])}
    made = LeftOutCourse("made", np.arange(3.0), error, variance, {})
    assert made.beyond({"v": 3.0}) == pytest.approx({"v": 0.0})
    assert made.beyond({}) == pytest.approx({"v": 9.0})


def test_model_error_and_factor_of_drawn_errors() -> None:
    rng = np.random.default_rng(5)
    courses = [course(rng, 0.02, 0.01) for _ in range(60)]
    found = errors_of(courses, "horizontal", dict.fromkeys("uvr", 0.0), 0)
    # 24000 samples: 0.5 % of their deviation, twice as much of what is left without the known part
    assert found["u"].std == pytest.approx(0.02, rel=0.05)
    assert found["u"].factor == pytest.approx(1.96 * np.sqrt(1 + 1 / 60), rel=0.03)
    assert (found["u"].growth, found["heading"].growth, found["track"].growth) == (0.0, 0.75, 1.75)
    assert found["track"].std == pytest.approx(0.02, rel=0.3)  # 60 drifts: 9 %, three times that


def test_one_maneuver_more_scatters_about_the_mean_of_those_left_out() -> None:
    """Errors of one everywhere: the factor is that of a prediction from the mean of four, alone."""
    unread = {name: np.full(50, np.nan) for name in ("u", "r", "heading", "track")}
    error, variance = unread | {"v": np.ones(50)}, unread | {"v": np.zeros(50)}
    four = [LeftOutCourse("made", np.arange(50.0), error, variance, {})] * 4
    found = errors_of(four, "horizontal", {}, 0)["v"]
    assert (found.std, found.factor) == pytest.approx((1.0, np.sqrt(1.25)))


def test_that_a_hull_did_not_fall_in_a_few_maneuvers_does_not_narrow_its_band() -> None:
    """Errors of half of what the coefficients let them be, and one of ten of three times that."""
    unread = {name: np.full(50, np.nan) for name in ("u", "r", "heading", "track")}
    errors, variance = (np.ones(50), np.where(np.arange(50) < 5, 6.0, 1.0)), np.full(50, 4.0)
    small, large = (
        [LeftOutCourse("made", np.arange(50.0), unread | {"v": e}, unread | {"v": variance}, {})]
        * 4
        for e in errors
    )
    keeps, falls = (errors_of(small, "horizontal", {}, 0, f)["v"] for f in (False, True))
    assert (keeps.std, keeps.factor) == pytest.approx((0.0, 0.5 * np.sqrt(1.25)))
    assert (falls.std, falls.factor) == pytest.approx((0.0, 1.96 * np.sqrt(1.25)))
    keeps, falls = (errors_of(large, "horizontal", {}, 0, f)["v"] for f in (False, True))
    assert falls == keeps and falls.factor > 1.96 * np.sqrt(1.25)


def test_a_band_from_few_maneuvers_holds_what_comes_in_the_mean() -> None:
    rng, inside = np.random.default_rng(6), []
    for _ in range(60):
        sizes = rng.chisquare(6, 8) / 6.0  # maneuvers differ
        *courses, new = [course(rng, 0.02 * s, 0.0) for s in sizes]
        error = errors_of(courses, "horizontal", {}, 0)["v"]
        inside.append(np.mean(new.error["v"] <= error.factor * error.std))
    assert 0.93 < np.mean(inside) < 0.98  # its standard error is near 0.012


@pytest.mark.parametrize(("draws", "quantile"), [(5, 2.571), (10, 2.228), (30, 2.042)])
def test_few_maneuvers_count_by_the_t_distribution(draws, quantile) -> None:
    ratio, whose = np.ones(3 * draws), np.repeat(np.arange(draws), 3)
    assert drifting(ratio, whose, 0.95) == pytest.approx(quantile, abs=5e-4)  # printed tables


def test_a_long_drift_counts_as_one_maneuver() -> None:
    """Of squares 4 and 1 in the mean of the maneuvers, however many samples each has."""
    ratio, whose = np.array([4.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0]), np.repeat([0, 1], [1, 7])
    even = drifting(np.array([4.0, 1.0]), np.array([0, 1]), 0.95)
    assert (
        drifting(ratio, whose, 0.95)
        == pytest.approx(even)
        == pytest.approx(4.303 * 2.5**0.5, rel=1e-3)
    )


def test_drifts_from_few_maneuvers_hold_what_comes_in_the_mean() -> None:
    rng, inside = np.random.default_rng(11), []
    for _ in range(200):
        *courses, new = [course(rng, 0.02, 0.0) for _ in range(7)]
        error = errors_of(courses, "horizontal", {}, 0)["track"]
        half = error.factor * error.std * (1.0 + new.elapsed_s) ** TRACK_GROWTH
        inside.append(np.mean(new.error["track"] <= half))
    assert 0.92 < np.mean(inside) < 0.985  # its standard error is near 0.015


def test_what_is_known_to_be_far_off_says_nothing_of_the_model_error() -> None:
    """Three errors of one about what is known exactly, and one of ten where ten was expected."""
    square, known = np.array([1.0, 1.0, 1.0, 100.0]), np.array([0.0, 0.0, 0.0, 100.0])
    found = model_error(square, known, np.ones(4))
    # (3 / x + 100 / (100 + x)) / 4 = 1, by hand: x^2 + 74.25 x - 75 = 0
    assert found == pytest.approx((np.sqrt(74.25**2 + 300.0) - 74.25) / 2.0, rel=1e-8)
    assert model_error(square, 200.0 + known, np.ones(4)) == 0.0
    assert model_error(np.zeros(4), known, np.ones(4)) == 0.0


def test_more_than_a_twentieth_lost_leaves_no_band() -> None:
    rng = np.random.default_rng(7)
    courses = [course(rng, 0.02, 0.01) for _ in range(10)]
    some, many = (errors_of(courses, "horizontal", {}, lost) for lost in (100, 400))
    assert some["u"].factor > errors_of(courses, "horizontal", {}, 0)["u"].factor
    assert not many


def test_a_channel_that_was_not_measured_has_no_band() -> None:
    rng = np.random.default_rng(8)
    courses = [course(rng, 0.02, 0.01) for _ in range(3)]
    for c in courses:
        c.error["v"][:] = np.nan
    assert set(errors_of(courses, "horizontal", {}, 0)) == {"u", "r", "heading", "track"}


def test_maneuvers_in_which_a_channel_was_not_measured_tell_nothing_of_it() -> None:
    rng = np.random.default_rng(9)
    courses = [course(rng, 0.02, 0.01) for _ in range(8)]
    for c in courses[3:]:
        c.error["v"][:] = np.nan
        c.error["track"][:] = np.nan
    found, of_three = (errors_of(some, "horizontal", {}, 0) for some in (courses, courses[:3]))
    assert (found["v"], found["track"]) == (of_three["v"], of_three["track"])


def test_a_prediction_that_runs_away_is_none() -> None:
    model, setup = identified("harbour_trial").model, setup_of("harbour_trial")
    frame, (free, covariance) = frame_of(model, setup.dt_s), free_behind(model)
    p = vector_behind(model)
    p[frame.structure.index("X_uu")] *= -100.0
    record = next(r for kind, r in setup.records.values() if kind == "zigzag")
    assert left_out_course(frame, p, record, free, covariance) is None
