"""Steps that are too long for a vehicle are told."""

import numpy as np
import pytest

from auvident.engines.prediction import at_effects, simulated
from auvident.engines.setup import active_states
from auvident.physics.dynamics import simulate_states
from auvident.stages.identify.step_length import _change, step_findings
from tests.engines.chain import setup_of

LIVELY = 8.0  # times the yaw damping and rudder power of the sample: fast, and as far round


def lively(setup) -> np.ndarray:
    p = setup.start.copy()
    for symbol in ("N_ur", "N_uud", "N_r|r|"):
        p[setup.structure.index(symbol)] *= LIVELY
    return p


@pytest.mark.parametrize(
    ("trial", "plane"), [("harbour_trial", "horizontal"), ("dive_trial", "vertical")]
)
def test_the_samples_are_slow_enough(trial, plane) -> None:
    setup = setup_of(trial, plane)
    assert step_findings(setup, setup.start) == []


def test_a_lively_vehicle_is_told_with_what_to_do() -> None:
    setup = setup_of()
    (found,) = step_findings(setup, lively(setup))
    assert found.code == "steps-too-long"
    assert found.where == "r_radps"
    assert found.value > found.threshold
    assert "--rate 20" in found.remedy


def test_half_the_step_leaves_a_sixteenth_of_the_error() -> None:
    """Fourth order: what half the step changes is 15/16 of the error."""
    setup = setup_of()
    p, active = lively(setup), active_states("coupled", "horizontal")
    record = next(r for kind, r in setup.records.values() if kind == "zigzag")
    acting, times = at_effects(setup.frame, p, record), 16
    given = np.repeat(acting.given, times, axis=0)[: 1 - times]  # no state is given here
    exact = simulate_states(
        acting.start,
        np.repeat(acting.inputs, times, axis=0)[: 1 - times],
        given,
        setup.dt_s / times,
        p,
        active,
        setup.structure.equations,
    )[::times]
    error = np.sqrt(np.mean((simulated(setup.frame, p, acting, active) - exact) ** 2, axis=0))
    # higher orders count where the step is so long
    np.testing.assert_allclose(_change(setup, p, record, active)[:3], 15 / 16 * error[:3], rtol=0.1)
    assert error[2] > setup.sensor_std[2]


def test_a_motion_that_runs_away_is_no_fault_of_the_step() -> None:
    setup = setup_of()
    p = setup.start.copy()
    p[setup.structure.index("X_uu")] = 60.0
    assert step_findings(setup, p) == []
