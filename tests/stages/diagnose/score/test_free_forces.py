"""Forces without physics: what they bring to maneuvers left out of their fit."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from auvident.engines.records import Record
from auvident.physics.terms import FREE_FORCE
from auvident.stages.diagnose.fit.case import Case
from auvident.stages.diagnose.fit.fits import fit_with
from auvident.stages.diagnose.score import free_forces as forces
from auvident.stages.diagnose.score.left_out import FitsWithout
from auvident.stages.diagnose.verdict.evidence import FREE_HELPS
from tests.stages.diagnose.loop_chain import small_case, small_fit


def test_only_what_explains_much_is_left_out() -> None:
    """It costs a fit for each maneuver, and changes no verdict for the others."""
    found = forces.free_forces(small_case(), small_fit(), FitsWithout())
    assert [f.helps for f in found] == [None] * forces.REFITTED
    assert all(f.gain < forces.FREE_GAIN or f.falls.max() < forces.FREE_FALL for f in found)


def test_a_force_that_is_there_helps_them() -> None:
    """The readings of the sway velocity follow the yaw rate of a while ago as well."""
    before = small_fit()
    pairs = zip(small_case().records, before.residuals, strict=True)
    moved = [pushed(record, residual.states) for record, residual in pairs]
    case = replace(small_case(), records=tuple(moved))
    after = fit_with(case, (), before.parameters, before.colours)
    assert after is not None
    tried = [f for f in forces.free_forces(case, after, FitsWithout()) if f.helps is not None]
    best = max(tried, key=lambda f: f.helps)
    assert best.gain > forces.FREE_GAIN
    assert best.falls.max() > forces.FREE_FALL
    assert best.helps > FREE_HELPS
    without = forces.free_forces(case, after)
    (untried,) = (f for f in without if (f.regressor, f.axis) == (best.regressor, best.axis))
    assert (untried.gain, untried.helps) == (best.gain, None)


def pushed(record: Record, states: np.ndarray) -> Record:
    """With what a force would leave that comes 4 s behind the yaw rate, 0.7 m/s at its most."""
    behind = forces.lagged(states[:, 2], forces.SLOW_S, 0.1)
    measured = record.measured.copy()
    measured[:, 1] += 0.7 * behind / np.abs(behind).max()
    return replace(record, measured=measured)


def test_a_force_is_never_worse_than_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its first-order size may be far off, and a few steps do not bring it back."""
    exact = forces.scores_of_forms

    def far_off(case: Case, *rest: Any) -> Any:
        own, scores = case.positions(FREE_FORCE), exact(case, *rest)
        for score in scores:
            score.parameters[own] += 300.0 * case.setup.prior_std[own]
        return scores

    monkeypatch.setattr(forces, "scores_of_forms", far_off)
    found = forces.free_forces(small_case(), small_fit())
    assert [f.gain >= 0.0 for f in found] == [True] * forces.REFITTED
