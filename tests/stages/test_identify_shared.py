"""What the planes share: the posterior of one is the prior of the other, with its correlations."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from auvident.engines.carried import claimed_covariance
from auvident.engines.setup import Correlated, Setup
from auvident.schema.artifacts import IdentifiedModel
from auvident.stages.identify.shared import SURGE, Shared, shared_of
from tests.engines.chain import identified, sample

SHARED = ("X_udot", "X_uu", "T_nn", "T_nu")


@cache
def horizontal() -> IdentifiedModel:
    return identified("harbour_trial", "horizontal", "ekf").model


def prepared(shared: Shared | None) -> Setup:
    return sample("dive_trial").setup("vertical", shared=shared)


def vertical(shared: Shared, **changes) -> IdentifiedModel:
    return sample("dive_trial").identify("vertical", shared=shared, **changes).model


def test_the_coefficients_of_both_planes_come_with_their_joint_covariance() -> None:
    model, shared = horizontal(), shared_of(horizontal())
    assert shared.joint.names == SHARED
    at = [model.covariance["symbols"].index(s) for s in SHARED]
    covariance = claimed_covariance(model)[np.ix_(at, at)]
    spread = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(shared.joint.correlation, covariance / np.outer(spread, spread))
    rows = {c.symbol: c for c in model.coefficients}
    for symbol, std in zip(SHARED, spread, strict=True):
        assert shared.values[symbol] == rows[symbol].value
        assert shared.stds[symbol] == min(std, rows[symbol].prior_std)
    # drag and thrust are known together: each alone would be no prior at all
    assert np.linalg.cond(shared.joint.correlation) > 10.0


def test_each_plane_has_its_own_drag_of_deflected_fins() -> None:
    rows = {c.symbol: c for c in vertical(shared_of(horizontal())).coefficients}
    assert rows["X_uudd"].shared_with is None
    assert rows["X_uu"].shared_with == "horizontal"


def test_the_prior_of_the_other_plane_is_that_posterior() -> None:
    shared = shared_of(horizontal())
    setup = prepared(shared)
    at = np.array([setup.structure.index(s) for s in ("Z_uw", *SHARED[::-1])])
    scale = setup.prior_std[at]
    covariance = setup.prior_covariance(at, np.ones(len(at))) * np.outer(scale, scale)
    expected = shared.joint.correlation * np.outer(*[list(shared.stds.values())] * 2)
    np.testing.assert_allclose(covariance[1:, 1:], expected[::-1, ::-1])
    np.testing.assert_array_equal(covariance[0, 1:], 0.0)
    np.testing.assert_allclose(setup.prior[at[1:]], [shared.values[s] for s in SHARED[::-1]])
    factors = np.linspace(0.5, 2.0, len(at))
    product = setup.prior_covariance(at, factors) @ setup.prior_information(at, factors)
    np.testing.assert_allclose(product, np.eye(len(at)), atol=1e-9)


def test_a_prior_of_independent_parameters_is_what_it_was() -> None:
    setup, factors = prepared(None), np.array([1.0, 3.0])
    at = np.array([0, 1])
    np.testing.assert_array_equal(setup.prior_covariance(at, factors), np.diag([1.0, 9.0]))
    np.testing.assert_array_equal(setup.prior_information(at, factors), np.diag([1.0, 1.0 / 9.0]))


def test_readings_of_the_speed_count_in_one_plane_only() -> None:
    both = replace(shared_of(horizontal()), counted=frozenset({"dive_trial-straight-1"}))
    alone, after = prepared(None).records, prepared(both).records
    assert alone.keys() == after.keys()
    for name, (_, record) in after.items():
        before = alone[name][1]
        if name in both.counted:
            assert np.isfinite(before.measured[:, SURGE]).any()
            assert not np.isfinite(record.measured[:, SURGE]).any()
            np.testing.assert_array_equal(record.measured[:, 1:], before.measured[:, 1:])
            np.testing.assert_array_equal(record.start, before.start)
        else:
            assert record is before or np.array_equal(
                record.measured, before.measured, equal_nan=True
            )


def test_both_engines_take_the_joint_prior() -> None:
    shared, found = shared_of(horizontal()), sample("dive_trial").maneuvers
    few = [m for m in found.maneuvers if m.kind == "zigzag" and m.role == "identify"][:2]
    changes = {"maneuvers": found.model_copy(update={"maneuvers": tuple(few)})}
    compiled = vertical(shared, **changes)
    reference = vertical(shared, engine="filterpy", **changes)
    for a, b in zip(compiled.coefficients, reference.coefficients, strict=True):
        assert a.value == pytest.approx(b.value, rel=1e-6, abs=1e-6 * a.prior_std)
        assert a.std == pytest.approx(b.std, rel=1e-6)


def test_planes_that_contradict_each_other_are_named() -> None:
    shared = shared_of(horizontal())
    agreed = vertical(shared)
    assert "planes-disagree" not in {f.code for f in agreed.findings}
    away = {**shared.values, "T_nn": 1.5 * shared.values["T_nn"]}
    certain = {s: 0.05 * abs(v) for s, v in shared.values.items()}
    alone = Correlated(SHARED, np.eye(len(SHARED)))
    apart = vertical(replace(shared, values=away, stds=certain, joint=alone))
    told = {f.where: f for f in apart.findings if f.code == "planes-disagree"}
    assert "T_nn" in told
    assert "the vertical maneuvers contradict the horizontal ones" in told["T_nn"].message
    assert {c.symbol for c in apart.coefficients if c.shared_with} == set(SHARED)
