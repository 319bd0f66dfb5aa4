"""The likelihood of the free-running prediction with coloured noise, against the dense Gaussian."""

from dataclasses import replace

import numpy as np
import pytest

from auvident.engines.estimator import run_stage
from auvident.engines.free_run import (
    OutputError,
    likelihood,
    normal_equations,
    predicted,
    residual_of,
    well_started,
)
from auvident.engines.noise import coloured_noise, white
from auvident.engines.setup import Setup, active_states
from auvident.errors import NumericsError
from auvident.estimation.coloured import TIMES_S, Colour
from tests.engines.chain import cut, plan_named, setup_of
from tests.estimation.test_coloured import dense, series

LATERAL = active_states("lateral", "horizontal")
COUPLED = active_states("coupled", "horizontal")
FIXED_START = 1.0e-9  # [std of the noise] a start this certain does not move


def noisy(setup: Setup, colours) -> Setup:
    """Every reading is the prediction of the prior plus noise of the colours of u, v and r."""
    records = {}
    for number, (key, (kind, record)) in enumerate(setup.records.items()):
        read = predicted(setup.frame, setup.prior, record, COUPLED)
        for c, colour in enumerate(colours):
            read[:, c] += series(len(read), colour, 10 * number + c)
        read[np.isnan(record.measured)] = np.nan
        records[key] = (kind, replace(record, measured=read))
    return replace(setup, records=records)


def output_of(setup: Setup) -> OutputError:
    """The likelihood of all records with the noise of the sensors."""
    records = tuple(record for _, record in setup.records.values())
    return OutputError(setup.frame, records, COUPLED, white(setup.sensor_std))


@pytest.mark.parametrize("active", [LATERAL, COUPLED], ids=["lateral", "coupled"])
def test_errors_count_as_the_dense_gaussian_says(active) -> None:
    setup = setup_of()
    assert setup.dt_s == pytest.approx(0.1)  # that of `dense`
    record = cut(next(iter(setup.records.values()))[1], 120)
    colours = (
        Colour(0.01, 0.03, 1.0),
        Colour(0.02, 0.05, 2.0),
        Colour(0.003, 0.004, 0.6),
        Colour(1.0, 0.0, 1.0),
    )
    error = predicted(setup.frame, setup.prior, record, active) - record.measured
    expected = 0.0
    for c in np.flatnonzero(active):
        seen = np.isfinite(record.measured[:, c])
        covariance = dense(120, colours[c])[np.ix_(seen, seen)]
        expected += 0.5 * float(error[seen, c] @ np.linalg.solve(covariance, error[seen, c]))
    output = OutputError(setup.frame, (record,), active, colours, FIXED_START)
    found = normal_equations(output, setup.prior, record, output.no_parameter)
    assert found is not None
    # the start moves by 1e-9 of a standard deviation of the noise
    assert found[0] == pytest.approx(expected, rel=1e-6)


def test_with_a_known_start_the_gradient_is_the_slope_of_the_cost() -> None:
    setup = setup_of()
    record = cut(next(iter(setup.records.values()))[1], 150)
    colours = tuple(Colour(s, 3.0 * s, 1.0) for s in setup.sensor_std)
    free = np.array([setup.structure.index(s) for s in ("X_uu", "Y_uv", "N_uud")])
    moving = setup.free(free)
    output = OutputError(setup.frame, (record,), COUPLED, colours, FIXED_START)

    def parts(theta):
        return normal_equations(output, moving.moved(setup.prior, theta), record, moving)

    step = 1e-4
    found = [(parts(step * e)[0] - parts(-step * e)[0]) / (2 * step) for e in np.eye(3)]
    # second order in the step, rounding of costs of some 1e4 over it, kinks of |v| and |r|
    np.testing.assert_allclose(found, parts(np.zeros(3))[1], rtol=1e-4)


def free_start(setup):
    """A record whose start is free, with what moves in it, and an error of the model."""
    record = cut(next(iter(setup.records.values()))[1], 150)
    record = replace(record, start=record.start + np.array([0.02, 0.02, 0.01, 0.0]))
    colours = tuple(Colour(s, 3.0 * s, 1.0) for s in setup.sensor_std)
    moving = setup.free(np.array([setup.structure.index(s) for s in ("X_uu", "Y_uv", "N_uud")]))
    return OutputError(setup.frame, (record,), COUPLED, colours), moving


def test_with_a_free_start_the_gradient_is_the_slope_where_the_start_has_been_moved() -> None:
    setup = setup_of()
    output, moving = free_start(setup)

    def off(begun) -> float:
        def half(theta):
            return likelihood(begun, moving.moved(setup.prior, theta), moving)

        step = 1e-4
        slopes = [(half(step * e)[0] - half(-step * e)[0]) / (2 * step) for e in np.eye(3)]
        _, gradient, curvature = half(np.zeros(3))
        return float(np.abs((gradient - slopes) / np.sqrt(np.diag(curvature))).max())

    moved = well_started(well_started(output, setup.prior), setup.prior)
    assert off(output) > 0.05  # in standard deviations
    assert off(moved) < 1e-3


def test_a_start_that_has_been_moved_is_still_expected_where_it_was() -> None:
    setup = setup_of()
    output, moving = free_start(setup)
    once = well_started(output, setup.prior)
    twice = well_started(once, setup.prior)
    before, here, there = (likelihood(o, setup.prior, moving)[0] for o in (output, once, twice))
    np.testing.assert_allclose(
        once.records[0].moved, once.records[0].start - output.records[0].start
    )
    assert np.abs(once.records[0].moved[:3]).max() > 0.005  # most of what was added comes off again
    # the motion bends a little on the way, and no more does the cost change
    assert abs(here - before) < 0.05 * before
    assert abs(there - here) < 0.02 * abs(here - before) + 1e-6 * here


def test_a_record_that_runs_away_keeps_its_start() -> None:
    setup = setup_of()
    output, _ = free_start(setup)
    p = setup.prior.copy()
    p[setup.structure.index("X_uu")] = 60.0
    assert well_started(output, p).records[0] is output.records[0]


def test_what_is_far_from_being_predicted_keeps_its_start() -> None:
    setup = setup_of()
    output, _ = free_start(setup)
    assert np.abs(well_started(output, setup.prior).records[0].moved).max() > 0.0
    finer = tuple(replace(c, white=c.white / 50.0, slow=c.slow / 50.0) for c in output.colours)
    sharp = well_started(replace(output, colours=finer), setup.prior)
    np.testing.assert_array_equal(sharp.records[0].start, output.records[0].start)


def test_a_start_that_predicts_worse_is_not_taken() -> None:
    setup = setup_of()
    output, _ = free_start(setup)
    record = output.records[0]
    left = residual_of(output, output.at(setup.prior), record)
    assert left is not None
    for wrong in (-50.0, 50.0):  # further than any line leads
        misled = replace(left, away=wrong * left.away)
        kept = well_started(output, setup.prior, [misled])
        np.testing.assert_array_equal(kept.records[0].start, record.start)


def test_the_noise_of_a_residual_is_found() -> None:
    sensor = setup_of().sensor_std
    truth = tuple(
        Colour(2.0 * sensor[c], 8.0 * sensor[c], time) for c, time in enumerate((0.6, 2.0, 1.0))
    )
    setup = noisy(setup_of(), truth)
    found = coloured_noise(output_of(setup), setup.prior, setup.sensor_std)
    for here, there in zip(found[:3], truth, strict=True):
        place = TIMES_S.index(there.time_s)
        assert here.time_s in TIMES_S[place - 1 : place + 2]
        # on the grid of times and ratios; see test_coloured
        rates = [c.slow / np.sqrt(c.time_s) for c in (here, there)]
        assert rates[0] == pytest.approx(rates[1], rel=0.3)
    assert found[3] == Colour(float(sensor[3]), 0.0, 1.0)  # the heading has no part in it


def test_no_channel_is_better_than_its_sensor() -> None:
    exact = noisy(setup_of(), tuple(Colour(1e-9, 0.0, 1.0) for _ in range(3)))
    found = coloured_noise(output_of(exact), exact.prior, exact.sensor_std)
    assert [c.white for c in found] == exact.sensor_std.tolist()


def test_a_prediction_that_ran_away_has_no_noise() -> None:
    setup = setup_of()
    p = setup.prior.copy()
    p[setup.structure.index("X_uu")] = 60.0
    with pytest.raises(NumericsError, match="diverges"):
        coloured_noise(output_of(setup), p, setup.sensor_std)


def test_a_refinement_weighs_by_the_noise_that_it_leaves() -> None:
    """Coefficients from readings with coloured noise, within what the fit claims of them."""
    sensor = setup_of().sensor_std
    truth = tuple(Colour(sensor[c], 5.0 * sensor[c], 2.0) for c in range(3))
    setup = noisy(setup_of(), truth)
    stage = plan_named("coloured").stage[-1]
    outcome = run_stage(setup, setup.prior, stage)
    assert all(c.slow > 2.0 * c.white for c in outcome.colours[:3])
    away = (outcome.parameters - setup.prior)[outcome.free] / setup.prior_std[outcome.free]
    distance = float(away @ np.linalg.solve(outcome.covariance, away)) / len(away)
    # chi-square with some 15 seen coefficients over 22; the prior is the truth in the others
    assert 0.1 < distance < 2.0
