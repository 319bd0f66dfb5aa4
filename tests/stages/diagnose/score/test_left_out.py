"""Maneuvers left out in turn take no part in their own prediction."""

import warnings
from dataclasses import replace
from functools import cache
from itertools import product
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from auvident.constants import INDEPENDENT_S
from auvident.engines.free_run import OutputError, RecordResidual, residual_of, white_error
from auvident.engines.map_fit import map_fit
from auvident.engines.records import Record
from auvident.stages.diagnose.fit.case import Case
from auvident.stages.diagnose.fit.fits import TOLERANCE, output_error, prior_of, started
from auvident.stages.diagnose.score import left_out as module
from auvident.stages.diagnose.score.left_out import (
    STEPS,
    FitsWithout,
    Helped,
    LeftOut,
    explained_share,
    helped,
    leave_out,
    noise_floor,
    seen_with,
    t_value,
    telling,
)
from auvident.stages.diagnose.select.records import Account
from auvident.stages.diagnose.select.rules import RULES_LEFT_OUT
from tests.stages.diagnose.loop_chain import small_case, small_fit

POISONED = 2


def unhelpful(found: Helped) -> str:
    """Why the rules refuse what helps like this; empty where they do not."""
    account = Account("current", 1.0, 1.0, 1, 1.0, {}, (), False, True, 1.0, 5, found)
    refusals = [rule(account) for rule in RULES_LEFT_OUT if rule.code == "share-helped"]
    return "".join(refusal.text for refusal in refusals if refusal)


@cache
def left_out() -> LeftOut:
    return leave_out(small_case(), small_fit(), small_fit().colours)


def poisoned(case: Case, number: int) -> Case:
    """The case with garbage in the readings of one maneuver."""
    record = case.records[number]
    garbage = record.measured + np.random.default_rng(0).normal(size=record.measured.shape)
    records = list(case.records)
    records[number] = replace(record, measured=garbage)
    return replace(case, records=tuple(records))


def test_what_is_left_out_is_not_looked_at() -> None:
    found = leave_out(poisoned(small_case(), POISONED), small_fit(), small_fit().colours)
    expected = left_out()
    np.testing.assert_array_equal(found.parameters[POISONED], expected.parameters[POISONED])
    for k, p in enumerate(found.parameters):
        if k != POISONED:
            assert not np.array_equal(p, expected.parameters[k])  # and the others do look at it
    assert found.blocks[POISONED].sum() > 10.0 * expected.blocks[POISONED].sum()


def test_a_maneuver_in_which_every_fit_runs_away_costs_infinitely_more(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    case, fitted = small_case(), small_fit()
    lost, true = case.records[POISONED], module.residual_of

    def residual(
        output: OutputError, parameters: npt.NDArray[Any], record: Record
    ) -> RecordResidual | None:
        return None if record.id == lost.id else true(output, parameters, record)

    monkeypatch.setattr(module, "residual_of", residual)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = seen_with(case, fitted, left_out().parameters, fitted.colours)
    others = np.arange(len(case.records)) != POISONED
    assert np.isposinf(found.excess[POISONED]) and np.isfinite(found.excess[others]).all()


def test_every_fit_moves_and_every_maneuver_is_scored() -> None:
    case, found = small_case(), left_out()
    assert found.parameters.shape == (len(case.records), len(case.names))
    assert (np.abs(found.parameters - small_fit().parameters).max(axis=1) > 0.0).all()
    for record, blocks in zip(case.records, found.blocks, strict=True):
        seconds = len(record.time_s) * case.setup.dt_s
        assert len(blocks) == int(np.ceil(seconds / INDEPENDENT_S - 1e-9))
        assert np.isfinite(blocks).all()


def test_a_fit_to_others_knows_nothing_that_a_fit_without_the_rest_does_not() -> None:
    """What all fits find where they begin is found once; it changes no digit."""
    fitted, out = small_fit(), POISONED
    case = started(small_case(), fitted)
    rest = replace(case, records=(*case.records[:out], *case.records[out + 1 :]))
    free, prior = case.setup.free(fitted.free), prior_of(case, fitted.free, ())
    output = output_error(rest, fitted.colours)
    again = map_fit(output, free, prior, fitted.parameters, STEPS, TOLERANCE)[0]
    np.testing.assert_array_equal(left_out().parameters[out], again)


def test_a_maneuver_left_out_is_predicted_worse_than_one_fitted() -> None:
    """A look ahead would show here: squared innovations exceed those of the fit to all."""
    case, fitted = small_case(), small_fit()
    own, output = 0.0, output_error(case, fitted.colours)
    for record in case.records:
        found = residual_of(output, output.at(fitted.parameters), record)
        assert found is not None
        own += float(np.sum(white_error(found.error, fitted.colours, case.setup.dt_s) ** 2))
    assert sum(float(b.sum()) for b in left_out().blocks) > own


def test_fits_without_maneuvers_are_made_once_for_each_model(monkeypatch) -> None:
    case, fitted = small_case(), small_fit()
    monkeypatch.setattr(module, "fits_without", lambda case, fitted: fitted.parameters.copy())
    fits = FitsWithout()
    first, p = fits.of(case, fitted), fitted.parameters.copy()
    p[case.position("thrust_step.time_s")] += 10.0  # of a step that the model does not have
    assert fits.of(case, replace(fitted, parameters=p)) is first
    for other in (
        replace(fitted, effects=(*fitted.effects, "thrust_step")),
        replace(fitted, parameters=1.01 * fitted.parameters),
        replace(fitted, colours=fitted.colours[::-1]),
    ):
        assert fits.of(case, other) is not first


# --- comparison ----------------------------------------------------------------------------


def made(*blocks: list[float], excess: list[float] | None = None) -> LeftOut:
    own = [np.array(b) for b in blocks]
    power = np.ones((len(blocks), 3))
    return LeftOut(np.zeros((len(blocks), 1)), own, power, np.array(excess or [0.0] * len(blocks)))


def test_the_gain_is_half_the_fall_of_the_squares() -> None:
    before, after = made([40.0, 20.0], [30.0]), made([30.0, 22.0], [34.0])
    found = helped(before, after)
    assert found.gain == pytest.approx(0.5 * (10.0 - 2.0 - 4.0))
    assert found.share == 0.5


def test_maneuvers_that_hardly_change_do_not_decide() -> None:
    large = [90.0] * 4
    before = made(large, large, [50.0], [50.0], [50.0])
    found = helped(before, made([40.0] * 4, [30.0] * 4, [52.0], [54.0], [51.0]))
    assert (found.share, found.deciding) == (0.4, 1.0)
    assert unhelpful(found) == ""
    worse = helped(before, made([40.0] * 4, [30.0] * 4, [90.0], [90.0], [51.0]))
    assert (worse.share, worse.deciding) == (0.4, 0.5)
    assert "40 %" in unhelpful(worse)
    same = helped(before, before)
    assert (same.share, same.deciding) == (0.0, 0.0) and unhelpful(same)


LOST = [900.0] * 4, [40.0] * 4, [50.0]  # the first is predicted badly, whatever the model


def test_a_maneuver_that_no_fit_to_the_others_predicts_says_nothing() -> None:
    before, after = made(*LOST, excess=[500.0, 30.0, 9.0]), made(*LOST, excess=[400.0, 2.0, 9.0])
    np.testing.assert_array_equal(telling(before, after, 100.0), [False, True, True])
    for gain in (5.0, 1.0):  # one or none would
        np.testing.assert_array_equal(telling(before, after, gain), [True] * 3)
    # one that is lost with the effect alone is the effect's doing, and counts
    np.testing.assert_array_equal(telling(made(*LOST), after, 100.0), [True] * 3)


def test_what_says_nothing_has_no_part_in_what_an_effect_helps() -> None:
    before = made(*LOST, excess=[500.0, 30.0, 9.0])
    after = made([990.0] * 4, [20.0] * 4, [48.0], excess=[680.0, 2.0, 8.0])
    rest = helped(made(*LOST[1:]), made([20.0] * 4, [48.0]))
    assert helped(before, after, 100.0) == rest
    assert rest.t > 2.0 > helped(before, after).t


def test_the_excess_is_what_leaving_a_maneuver_out_costs() -> None:
    case, fitted, found = small_case(), small_fit(), left_out()
    at_all = np.tile(fitted.parameters, (len(found.parameters), 1))
    own = seen_with(case, fitted, at_all, fitted.colours)
    np.testing.assert_array_equal(own.excess, 0.0)
    sums = [[b.sum() for b in seen.blocks] for seen in (found, own)]
    np.testing.assert_allclose(found.excess, 0.5 * np.subtract(*sums), rtol=1e-9)
    assert (found.excess > 1.0).all()  # [nats] the turns, which are two alike, cost least


def test_a_prediction_that_runs_away_is_bad_but_finite() -> None:
    found = helped(made([10.0, 10.0]), made([8.0, np.inf]))
    assert np.isfinite(found.gain) and found.gain < 0.0
    both = helped(made([np.inf]), made([np.inf]))
    assert both.gain == 0.0


def test_readings_that_a_model_cannot_predict_count_one_each() -> None:
    """To no model's gain: else one that a delay leaves without its first rows would look better."""
    case, fitted = small_case(), small_fit()
    output, record = output_error(case, fitted.colours), case.records[0]
    found = residual_of(output, output.at(fitted.parameters), record)
    assert found is not None
    rows = np.flatnonzero(np.isfinite(record.measured[:, 2]))[:50]
    error = found.error.copy()
    error[rows, 2] = np.nan
    rest = white_error(error, fitted.colours, case.setup.dt_s)[:, :3]
    blocks = module._blocks(output, replace(found, error=error), record)
    assert blocks.sum() == pytest.approx(np.sum(rest**2) + 50.0)


# --- in standard errors, and as a share --------------------------------------------------------


def test_standard_errors_are_those_of_signs_by_chance() -> None:
    gains = np.array([3.0, -1.0, 2.0, 5.0])
    signs = np.array(list(product((-1.0, 1.0), repeat=4)))
    assert t_value(gains) == pytest.approx(gains.sum() / (signs @ gains).std())
    assert t_value(0.1 * gains) == pytest.approx(t_value(gains))  # whatever a nat is worth
    assert t_value(np.ones(9)) == pytest.approx(3.0)  # at most
    assert t_value(np.zeros(3)) == 0.0


def test_the_share_explained_is_that_above_the_noise_in_the_best_channel() -> None:
    floor = np.array([[2.0, 9.8, 1.0]])
    before, after = np.array([[10.0, 10.0, 5.0]]), np.array([[6.0, 0.0, 6.0]])
    # the second channel has nothing but noise, the third gets worse
    assert explained_share(before, after, floor) == pytest.approx(4.0 / 8.0)
    assert explained_share(after, before, floor) == pytest.approx(1.0 / 5.0)


def test_a_prediction_that_runs_away_shows_no_share() -> None:
    floor = np.array([[2.0, 9.8, 1.0], [2.0, 9.8, 1.0]])
    before, after = np.array([[10.0, 10.0, 5.0], [np.inf] * 3]), np.full((2, 3), 6.0)
    assert explained_share(before, after, floor) == pytest.approx(4.0 / 8.0)  # of the first alone
    both = np.array([[6.0, 0.0, 6.0], [np.inf] * 3])
    assert explained_share(before, both, floor) == pytest.approx(4.0 / 8.0)
    assert explained_share(np.full((2, 3), np.inf), after, floor) == 0.0
    assert explained_share(np.full((2, 3), 10.0), both, floor) == 0.0  # it was the effect's doing


def test_the_floor_is_the_noise_of_the_sensors_as_stated_or_as_seen() -> None:
    case, colours = small_case(), small_fit().colours
    pairs = list(zip(colours, case.setup.sensor_std[:3], strict=True))
    quiet, loud = ([replace(c, white=f * std) for c, std in pairs] for f in (0.5, 2.0))
    readings = [np.isfinite(r.measured[:, :3]).sum(axis=0) for r in case.records]
    stated = np.array(readings) * case.setup.sensor_std[:3] ** 2
    np.testing.assert_allclose(noise_floor(case, tuple(loud)), stated)
    np.testing.assert_allclose(noise_floor(case, tuple(quiet)), 0.25 * stated)


def test_other_colours_need_no_other_fits() -> None:
    case, fitted, found = small_case(), small_fit(), left_out()
    again = seen_with(case, fitted, found.parameters, fitted.colours)
    np.testing.assert_array_equal(again.power, found.power)
    wider = tuple(replace(c, white=2.0 * c.white, slow=2.0 * c.slow) for c in fitted.colours)
    other = seen_with(case, fitted, found.parameters, wider)
    for one, two in zip(other.blocks, found.blocks, strict=True):
        np.testing.assert_allclose(4.0 * one, two, rtol=0.05)  # but for the starts
