"""The comparison of totals with a plant of another structure."""

import numpy as np
import pytest

from tests.bench.population_trial import SAMPLES  # noqa: F401 (puts the generator on the path)
from tests.bench.totals import STEP_S, motion_of, states_of, summary, true_rates


def record(n: int = 400) -> np.ndarray:
    """Half of it ahead at two speeds, half turning to either side, at last against the rudder."""
    from seatrial.simulate import RECORD_COLUMNS, REVS, RUDDER

    rows = np.zeros((n, RECORD_COLUMNS))
    quarter = n // 4
    rows[:, 0], rows[:, REVS] = 1.5, 20.0
    rows[:quarter, 0], rows[:quarter, REVS] = 1.0, 12.0
    for first, sign in ((2 * quarter, 1.0), (3 * quarter, -1.0)):
        part = slice(first, first + quarter)
        rows[part, 1], rows[part, 5], rows[part, RUDDER] = -0.1 * sign, 0.2 * sign, 0.26 * sign
        rows[part.stop - 5 : part.stop, 5] = 0.15 * sign
        rows[part.stop - 5 : part.stop, RUDDER] = -0.26 * sign
    return rows


def test_states_are_those_that_were_flown() -> None:
    found = {name: motion for name, motion, _ in states_of(record())}
    assert found["ahead, slow"][0] == pytest.approx([1.0, 0.0, 0.0])
    assert found["ahead, fast"][2] == pytest.approx(20.0)
    assert found["turning to port"][0] == pytest.approx([1.5, 0.1, -0.2])
    assert found["rudder against the turn to port"][0] == pytest.approx([1.5, 0.1, -0.15])
    assert found["rudder against the turn to port"][1] == pytest.approx(0.26)
    assert found["rudder put over to starboard"][1] == pytest.approx(0.26)


def test_rates_of_the_plant_are_what_a_calm_level_run_begins_with() -> None:
    from seatrial.plant import PlantEffects, rk4_step, workspace
    from seatrial.population import draw

    body = draw(2, True, ()).vehicle.body
    level = body._replace(mass=body.mass.copy(), mass_inverse=body.mass_inverse.copy())
    level.mass[2:5, :2] = level.mass[:2, 2:5] = level.mass[2:5, 5] = level.mass[5, 2:5] = 0.0
    level.mass_inverse[:] = np.linalg.inv(level.mass)
    state, speed, revs = np.zeros(15), np.array([1.2, -0.05, 0.1]), 15.0
    state[[0, 1, 5]], state[8] = speed, 200.0
    rk4_step(state, 1e-6, 0.1, 0.0, revs, 1.0, np.zeros(6), level, PlantEffects(), workspace())
    began = (state[[0, 1, 5]] - speed) / 1e-6
    np.testing.assert_allclose(true_rates(level, speed, 0.1, revs), began, rtol=1e-4, atol=1e-6)


def test_summary_keeps_what_the_data_told() -> None:
    row = {"total": "u' ahead", "error": 2.0, "std": 2.0, "fitted_std": 1.0, "prior_std": 10.0}
    helm = {**row, "total": "r' rudder put over"}
    unseen = {**row, "fitted_std": 9.0}
    (every, flown, put_over, *_) = summary([{"rows": [row, helm, unseen]}])
    assert (every["n"], flown["n"], put_over["n"]) == (2, 1, 1)
    assert flown["mean square"] == 1.0 and flown["mean square (readings alone)"] == 4.0
    assert flown["95 % covers"] == "100.0 %" and flown["95 % covers (readings alone)"] == "0.0 %"


def test_motion_is_the_mean_of_the_rows() -> None:
    state, rudder, revs = motion_of(record())
    assert (state[1], state[2], rudder) == pytest.approx((0.0, 0.0, 0.0))
    assert revs == pytest.approx(18.0) and STEP_S < 1e-3
