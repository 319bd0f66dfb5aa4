"""Leave one maneuver out by one Newton step, against leaving it out."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from auvident.engines import estimator, jackknife
from auvident.engines.estimator import run_stage, task_about
from auvident.engines.jackknife import (
    Scatter,
    _fitted_without,
    centred,
    expected_variance,
    information_by_maneuver,
    jackknife_covariance,
    largest_by_chance,
    left_out_courses,
    moves_without,
    noise_claim,
    scatter_of,
    structural_covariance,
)
from auvident.engines.noise import white
from auvident.engines.setup import Setup
from auvident.estimation.output_error import fit
from auvident.estimation.pooling import for_few
from auvident.schema.plan import Tuning
from auvident.stages.identify.result import widening
from tests.engines.test_estimator import linear_setup, stage

EVERY = {"maneuvers": ("straight", "turn", "zigzag"), "method": "output_error"}


@pytest.fixture(autouse=True)
def steady_noise(monkeypatch):
    monkeypatch.setattr(estimator, "effective_noise", lambda output, p, std: 20.0 * std)
    monkeypatch.setattr(estimator, "coloured_noise", lambda output, p, std: white(20.0 * std))


def left_out(setup: Setup, name: str) -> Setup:
    return replace(setup, records={k: v for k, v in setup.records.items() if k != name})


@pytest.mark.parametrize("tuning", [{}, {"all": Tuning(prior=0.3)}])
def test_a_newton_step_without_a_maneuver_of_a_linear_problem_is_leaving_it_out(tuning) -> None:
    setup, how = linear_setup(**tuning), stage(**EVERY)
    whole = run_stage(setup, setup.prior, how)
    whole = run_stage(setup, whole.parameters, how)  # to the bottom: the moves suppose it
    moves = moves_without(*information_by_maneuver(setup, whole, how))
    assert set(moves) == set(setup.records)
    for name, move in moves.items():
        rest = left_out(setup, name)
        without = run_stage(rest, whole.parameters, how)
        without = run_stage(rest, without.parameters, how)
        scale = setup.prior_std[whole.free]
        moved = (without.parameters - whole.parameters)[whole.free] / scale
        posterior = np.sqrt(np.diag(whole.covariance))
        # exact for a linear problem but for where the two fits stop (1e-5 of the cost)
        np.testing.assert_allclose(move / posterior, moved / posterior, atol=0.02)
    largest = max(
        np.abs(move / np.sqrt(np.diag(whole.covariance))).max() for move in moves.values()
    )
    assert largest > 0.5  # some maneuver does matter


def test_a_fit_without_a_maneuver_comes_back_from_a_step_that_goes_too_far() -> None:
    setup, how = linear_setup(), stage(**EVERY)
    whole = run_stage(setup, setup.prior, how)
    parts, task = information_by_maneuver(setup, whole, how), task_about(setup, whole, how)
    every, room = sum(parts[0].values()), task.prior_about(whole.parameters)
    spread = np.sqrt(np.diag(whole.covariance))
    for name, move in moves_without(*parts).items():
        for start in (move, 30.0 * move):
            found = _fitted_without(name, task, whole.parameters, room, start, every)
            np.testing.assert_allclose(found / spread, move / spread, atol=0.02)


def test_where_the_others_run_away_the_step_remains(monkeypatch) -> None:
    setup, how = linear_setup(), stage(**EVERY)
    whole = run_stage(setup, setup.prior, how)
    parts, task = information_by_maneuver(setup, whole, how), task_about(setup, whole, how)
    every, room = sum(parts[0].values()), task.prior_about(whole.parameters)
    name, move = next(iter(moves_without(*parts).items()))
    lost = np.inf, np.zeros(len(move)), np.zeros((len(move), len(move)))
    monkeypatch.setattr(jackknife, "likelihood", lambda *a: lost)
    assert _fitted_without(name, task, whole.parameters, room, move, every) is move


def test_a_long_step_is_replaced_by_a_fit(monkeypatch) -> None:
    """With no step short enough the courses of a linear problem are those of the fits: the same."""
    setup, how = linear_setup(), stage(**EVERY)
    whole = run_stage(setup, setup.prior, how)
    parts = information_by_maneuver(setup, whole, how)
    by_step = left_out_courses(setup, whole, how, *parts, 2.0)[0]
    fits = []
    monkeypatch.setattr(jackknife, "LONG_STEP", -1.0)
    monkeypatch.setattr(jackknife, "fit", lambda *a: fits.append(1) or fit(*a))
    by_fit = left_out_courses(setup, whole, how, *parts, 2.0)[0]
    assert len(fits) == len(setup.records)
    for name, course in by_step.items():
        for symbol, error in course.error.items():
            np.testing.assert_allclose(by_fit[name].error[symbol], error, rtol=0.02, atol=1e-4)


def test_courses_of_a_hull_that_may_fall_are_known_less_well(monkeypatch) -> None:
    setup, how = linear_setup(), stage(**EVERY)
    whole = run_stage(setup, setup.prior, how)
    parts = information_by_maneuver(setup, whole, how)
    kept, none = left_out_courses(setup, whole, how, *parts, 2.0)
    monkeypatch.setattr(jackknife, "hardly_keeps_course", lambda *a: True)
    falls, pushes = left_out_courses(setup, whole, how, *parts, 2.0)
    assert none is None and pushes is not None and pushes.length_m == 2.0
    assert kept.keys() == falls.keys()
    for name, course in falls.items():
        for symbol, variance in course.variance.items():
            assert (variance >= kept[name].variance[symbol]).all()
            np.testing.assert_array_equal(course.error[symbol], kept[name].error[symbol])
    assert any((c.variance["r"] > kept[name].variance["r"]).any() for name, c in falls.items())


def test_a_maneuver_left_out_has_as_many_pushes_as_hull_lengths(monkeypatch) -> None:
    """Hulls of a tenth of the length are pushed ten times as often, each time by less."""
    setup, how = linear_setup(), stage(**EVERY)
    whole = run_stage(setup, setup.prior, how)
    parts = information_by_maneuver(setup, whole, how)
    monkeypatch.setattr(jackknife, "hardly_keeps_course", lambda *a: True)
    long, short = (left_out_courses(setup, whole, how, *parts, m)[1] for m in (2.0, 0.2))
    counts = np.array(
        [[len(p.rows(r, setup.dt_s)) for p in (long, short)] for _, r in setup.records.values()]
    )
    ratio = np.sqrt((counts[:, 0] + 1.0) / (counts[:, 1] + 1.0))
    smaller = short.std[1:3] / long.std[1:3]
    assert (ratio.min() - 1e-9 <= smaller).all() and (smaller <= ratio.max() + 1e-9).all()
    assert (smaller < 0.5).all()


def test_scatter_of_the_moves_by_hand() -> None:
    moves = {"a": np.array([1.0, 0.0]), "b": np.array([-1.0, 0.0]), "c": np.array([3.0, 6.0])}
    # means 1 and 2; (F - 1)/F of the sums of squares 0 + 4 + 4, 4 + 4 + 16, product 0 + 4 + 8
    expected = 2 / 3 * np.array([[8.0, 12.0], [12.0, 24.0]])
    np.testing.assert_allclose(jackknife_covariance(moves), expected, rtol=1e-12)


def test_jackknife_of_a_mean_is_its_standard_error() -> None:
    """Leaving x_i out of a mean moves it by (mean - x_i) / (n - 1): the classic identity."""
    x = np.random.default_rng(0).normal(size=12)
    moves = {str(i): np.array([(x.mean() - v) / (len(x) - 1)]) for i, v in enumerate(x)}
    assert jackknife_covariance(moves)[0, 0] == pytest.approx(x.var(ddof=1) / len(x), rel=1e-12)


def test_two_maneuvers_say_nothing_about_scatter() -> None:
    assert jackknife_covariance({"a": np.ones(2), "b": np.zeros(2)}) is None


def drawn(
    rng: np.random.Generator, apart: float = 0.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Jackknife variances of a linear problem of eight unequal maneuvers, expected, freedom.

    The coefficients are drawn from the prior; those of each maneuver lie `apart` from them.
    """
    n, prior = 3, np.diag([1.0, 4.0, 1.0])
    slopes = [rng.normal(size=(20, n)) * rng.uniform(0.1, 2.0, size=n) for _ in range(8)]
    truth = rng.normal(size=n) / np.sqrt(np.diag(prior))
    own = [truth + apart * rng.normal(size=n) for _ in slopes]
    reads = [j @ t + rng.normal(size=20) for j, t in zip(slopes, own, strict=True)]
    whole = prior + sum(j.T @ j for j in slopes)
    best = np.linalg.solve(whole, sum(j.T @ y for j, y in zip(slopes, reads, strict=True)))
    pairs = list(zip(slopes, reads, strict=True))
    gradients = {str(i): j.T @ (j @ best - y) for i, (j, y) in enumerate(pairs)}
    curvatures = {str(i): j.T @ j for i, j in enumerate(slopes)}
    moves = moves_without(centred(gradients, curvatures), curvatures, prior)
    expected, freedom = expected_variance([j.T @ j for j in slopes], prior)
    return np.diag(jackknife_covariance(moves)), expected, freedom


def test_the_scatter_of_noise_alone_has_the_expected_mean_and_is_rarely_beyond_chance() -> None:
    rng = np.random.default_rng(11)
    found = [drawn(rng) for _ in range(1500)]
    ratio = np.array([variance / expected for variance, expected, _ in found])
    beyond = np.array([v > e * largest_by_chance(f) for v, e, f in found])
    assert ratio.mean() == pytest.approx(1.0, abs=0.07)
    assert 0.02 < beyond.mean() < 0.08


def test_maneuvers_of_different_vehicles_scatter_beyond_chance() -> None:
    rng = np.random.default_rng(12)
    found = [drawn(rng, apart=1.0) for _ in range(200)]
    beyond = np.array([v > e * largest_by_chance(f) for v, e, f in found])
    assert beyond.mean() > 0.8


def straight_and_others(
    rng: np.random.Generator, prior_off: float, inflated: float = 1.0
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray], np.ndarray]:
    """Gradients and curvatures of a linear problem in which one maneuver alone informs the first
    parameter; its prior is so many standard deviations off, the noise so much larger than taken.
    """
    truth, prior = np.array([prior_off, 0.3, -0.4]), np.eye(3)
    gradients, curvatures, parts = {}, {}, {}
    for name in ("straight", "turn", "zigzag", "turn-2"):
        slopes = rng.normal(size=(200, 3))
        slopes[:, 0] *= 1.0 if name == "straight" else 0.0
        parts[name] = slopes, slopes @ truth + inflated * rng.normal(size=200)
        curvatures[name] = slopes.T @ slopes
    whole = prior + sum(curvatures.values())
    best = np.linalg.solve(whole, sum(j.T @ y for j, y in parts.values()))
    for name, (j, y) in parts.items():
        gradients[name] = j.T @ (j @ best - y)
    return gradients, curvatures, prior


def test_centred_gradients_add_up_to_zero() -> None:
    gradients, curvatures, _ = straight_and_others(np.random.default_rng(3), 4.0)
    assert abs(sum(gradients.values())[0]) > 3.0  # the pull of the prior
    total = sum(centred(gradients, curvatures).values())
    np.testing.assert_allclose(total, 0.0, atol=1e-9)
    # as well where the data do not see a direction at all
    for j in curvatures.values():
        j[2] = j[:, 2] = 0.0
    blind = {name: np.where([True, True, False], g, 0.0) for name, g in gradients.items()}
    np.testing.assert_allclose(sum(centred(blind, curvatures).values()), 0.0, atol=1e-9)


@pytest.mark.parametrize("prior_off", [0.0, 2.6, 10.0])
def test_one_maneuver_that_disagrees_with_the_prior_disagrees_with_no_other(prior_off) -> None:
    """What a single straight run says of the drag is no scatter between maneuvers."""
    parts = straight_and_others(np.random.default_rng(5), prior_off)
    posterior = np.linalg.inv(parts[2] + sum(parts[1].values()))
    scatter = scatter_of(*parts)
    assert scatter is not None
    # what is left is how the other two, which all of them inform, move it along
    assert scatter.std[0] < 0.1 * np.sqrt(posterior[0, 0])
    assert widening(posterior, scatter)[0] == 1.0
    # without centring the prior's distance would have been taken for scatter
    raw = jackknife_covariance(moves_without(*parts))
    if prior_off > 2.0:
        assert np.sqrt(raw[0, 0]) > 10.0 * np.sqrt(posterior[0, 0])


def test_the_claim_of_noise_is_right_on_average_and_sees_noise_twice_as_large() -> None:
    rng = np.random.default_rng(7)
    for inflated, expected in ((1.0, 1.0), (2.0, 4.0)):
        found = [noise_claim(*straight_and_others(rng, 1.0, inflated)[:2]) for _ in range(300)]
        assert np.mean([f.ratio for f in found]) == pytest.approx(expected, rel=0.08)
        # four maneuvers of two parameters, one of them of three; less the three of the whole
        assert found[0].freedom == pytest.approx(2 * 3 + 3 - 3, rel=1e-6)


def test_two_maneuvers_claim_nothing() -> None:
    gradients, curvatures, _ = straight_and_others(np.random.default_rng(1), 0.0)
    two = ("straight", "turn")
    assert noise_claim({n: gradients[n] for n in two}, {n: curvatures[n] for n in two}) is None


def test_the_limit_of_chance_is_that_of_chi_square() -> None:
    freedom = np.array([1.0, 2.0, 4.0, 10.0, 40.0])
    np.testing.assert_allclose(
        largest_by_chance(freedom), chi2.ppf(0.95, freedom) / freedom, rtol=0.03
    )


@pytest.mark.parametrize("count", [6, 8, 12])
def test_what_few_maneuvers_tell_of_a_variance_is_widened_to_student_s_t(count) -> None:
    """Every maneuver alone pulls the mean of them elsewhere; moves are those of leaving one out."""
    rng, squares, inverses = np.random.default_rng(count), [], []
    for _ in range(4000):
        own = rng.standard_normal(count)
        without = {
            str(i): np.array([(own.sum() - x) / (count - 1) - own.mean()])
            for i, x in enumerate(own)
        }
        claimed = for_few(jackknife_covariance(without), count)[0, 0]
        squares.append(own.mean() ** 2 / claimed)
        inverses.append(1.0 / claimed)
    # the fourth moment of t is infinite at few degrees: the mean of few is known less well
    assert np.mean(squares) == pytest.approx(1.0, rel=0.15)
    assert np.mean(inverses) == pytest.approx(count, rel=0.1)


PULLS = {"turn-1": 1.0, "turn-2": 1.0, "zigzag-1": -1.0, "zigzag-2": -1.0}


def test_what_pulls_a_kind_of_maneuvers_alike_shows_beside_another_kind() -> None:
    """Curvatures of 1: moves of g/3 without a maneuver, of 2 g/2 without a kind."""
    gradients = {name: np.array([g]) for name, g in PULLS.items()}
    curvatures = dict.fromkeys(PULLS, np.eye(1))
    kinds = {name: name.split("-")[0] for name in PULLS}
    found = structural_covariance(gradients, curvatures, np.zeros((1, 1)), kinds)
    between_maneuvers, between_kinds = 3 / 4 * 4 * (1 / 3) ** 2, 1 / 2 * (1.0 + 1.0)
    assert found == pytest.approx(np.array([[between_maneuvers + between_kinds]]))
    alike = structural_covariance(
        gradients, curvatures, np.zeros((1, 1)), dict.fromkeys(PULLS, "turn")
    )
    assert alike == pytest.approx(for_few(np.array([[between_maneuvers]]), 4))


def test_two_maneuvers_of_two_kinds_tell_nothing_of_what_the_equations_lack() -> None:
    parts = {"turn": np.ones(1), "zigzag": -np.ones(1)}
    curvatures = dict.fromkeys(parts, np.eye(1))
    assert structural_covariance(parts, curvatures, np.eye(1), {k: k for k in parts}) is None


def test_three_maneuvers_count_as_four() -> None:
    assert for_few(1.0, 3) == for_few(1.0, 4) == 3.0


def test_only_a_scatter_beyond_chance_widens_and_never_beyond_the_prior() -> None:
    covariance = np.diag([0.04, 0.04, 0.04, 0.04])
    scatter = Scatter(np.array([0.6, 0.6, 5.0, 0.1]), np.array([True, False, True, True]))
    np.testing.assert_allclose(widening(covariance, scatter), [3.0, 1.0, 5.0, 1.0], rtol=1e-12)
    np.testing.assert_array_equal(widening(covariance, None), np.ones(4))


def test_the_scatter_of_a_steady_moment_always_counts() -> None:
    covariance, scatter = np.full((2, 2), 0.0), Scatter(np.full(2, 0.2), np.zeros(2, dtype=bool))
    np.fill_diagonal(covariance, 0.1**2)
    steady = np.array([False, True])
    np.testing.assert_allclose(widening(covariance, scatter, steady), [1.0, 2.0], rtol=1e-12)
