"""Maneuvers predicted again with other coefficients than those of their model."""

from dataclasses import replace

import numpy as np
import pytest

from auvident.engines.carried import prior_behind
from auvident.engines.replay import Replay, _eliminated, replay_of
from auvident.schema.artifacts import IdentifiedModel
from auvident.stages.identify import replay_in
from tests.bench.pool import trials_of_one, world_of
from tests.session import once

SEED, PART = 2, 3


@once
def model_text() -> str:
    """The model of a trial."""
    return trials_of_one(SEED, 1, PART)[1][0].model.model_dump_json(by_alias=True)


def model() -> IdentifiedModel:
    return IdentifiedModel.model_validate_json(model_text())


def replay() -> Replay:
    found = replay_in([world().trial], world().maneuvers, model())
    assert found is not None
    return found


def world():
    return world_of(trials_of_one(SEED, 0, PART)[0], 1000 * SEED, PART)


def coefficients() -> tuple[dict[str, float], np.ndarray]:
    """Those that the model estimated, and their units."""
    found, told = model(), model().covariance
    scale = dict(zip(told["symbols"], told["scale"], strict=True))
    own = {s: v for s, v in found.values().items() if s in scale}
    return own, np.array([scale[s] for s in own])


def moved(values: dict[str, float], by: np.ndarray) -> dict[str, float]:
    return dict(zip(values, np.array(list(values.values())) + by, strict=True))


def test_its_gradient_is_the_slope_of_its_cost() -> None:
    """With what is the trial's own at its best before and after the step."""
    values, scale = coefficients()
    information = replay().about(values, scale).information
    for k in (-1, -4, -8):
        direction = np.linalg.eigh(information)[1][:, k]
        std = scale * direction / np.sqrt(direction @ information @ direction)
        found, low, high = (replay().about(moved(values, s * std), scale) for s in (2.0, 1.9, 2.1))
        slope = (high.cost - low.cost) / 0.2
        along = found.gradient @ direction / np.sqrt(direction @ information @ direction)
        assert along == pytest.approx(slope, rel=0.05, abs=0.05)


def test_its_information_is_the_curvature_of_its_cost() -> None:
    values, scale = coefficients()
    here = replay().about(values, scale)
    direction = np.linalg.eigh(here.information)[1][:, -2]
    step = 0.5 / np.sqrt(direction @ here.information @ direction)
    there = replay().about(moved(values, step * direction * scale), scale)
    rise = (there.gradient - here.gradient) @ direction / step
    assert rise == pytest.approx(direction @ here.information @ direction, rel=0.2)


def test_at_its_own_coefficients_the_prior_outweighs_what_the_maneuvers_ask_for() -> None:
    """The model is the most probable one, or its mean: less than a standard deviation off."""
    values, scale = coefficients()
    found, before = replay().about(values, scale), prior_behind(model())
    away = (np.array(list(values.values())) - [before[s] for s in values]) / scale
    covariance = np.linalg.inv(found.information + np.eye(len(scale)))
    step = covariance @ (found.gradient + away)
    assert np.abs(step / np.sqrt(np.diag(covariance))).max() < 1.0


def test_what_is_the_trials_own_takes_from_what_is_told() -> None:
    """What else is not known for certain leaves less to know of the others."""
    values, scale = coefficients()
    own = list(values).index("N_uud")
    rest = {s: v for s, v in values.items() if s != "N_uud"}
    free = replay().about(rest, np.delete(scale, own))
    given = replay().about(values, scale)
    known = np.delete(np.delete(given.information, own, 0), own, 1)
    taken = np.linalg.eigvalsh(known - free.information)
    assert taken.min() > -1e-6 * taken.max()
    assert taken[-1] > 1.0
    assert taken[:-1] == pytest.approx(0.0, abs=1e-3 * taken[-1])  # one parameter, one direction
    assert free.values["N_uud"] == pytest.approx(values["N_uud"], abs=scale[own])


def test_what_lies_at_its_bound_and_is_pulled_beyond_stays_there() -> None:
    """A lag cannot be less than none: what asks for that tells nothing of the others."""
    information, away = np.array([[4.0, 1.0], [1.0, 2.0]]), np.zeros(1)
    lies, nowhere = np.array([True]), np.array([False])
    for slope, stays in ((0.6, True), (-0.6, False)):
        gradient = np.array([0.5, slope])
        found = _eliminated(gradient, information, away, 1, (lies, nowhere))
        if stays:
            assert found == (gradient[:1], information[:1, :1])
        else:
            assert found[0] == pytest.approx(0.5 - slope / 3.0)
            assert found[1] == pytest.approx(4.0 - 1.0 / 3.0)
        mirrored = _eliminated(-gradient, information, away, 1, (nowhere, lies))
        assert mirrored[0] == pytest.approx(-found[0])


def test_an_effect_that_the_model_lacks_is_told_about() -> None:
    values, scale = coefficients()
    found = replay().about({**values, "rudder_lag.lag_s": 0.2}, np.array([*scale, 0.1]))
    assert found.information[-1, -1] > 1.0
    assert found.gradient[-1] > 0.0  # less of it would be better: there is none


def test_where_it_runs_away_nothing_is_told() -> None:
    values, scale = coefficients()
    assert replay().about({**values, "N_r|r|": 1e6, "N_ur": 1e6}, scale) is None


def test_only_maneuvers_that_the_model_was_fitted_to_are_its_own() -> None:
    found, own = model(), replay()
    assert replay_of(found, own.records[1:], own.dt_s) is None
    fewer = own.records[0].measured.copy()
    fewer[5] = np.nan
    changed = (replace(own.records[0], measured=fewer), *own.records[1:])
    assert replay_of(found, changed, own.dt_s) is None
    assert replay_of(found, own.records, own.dt_s) is not None


def test_a_filter_does_not_tell_what_a_prediction_does() -> None:
    (trial,) = trials_of_one(SEED, 1, PART, "together")[1]
    assert trial.replay() is None
