"""The fit of the free-running prediction: rounds, bounds, and what moves along."""

from dataclasses import replace

import numpy as np
import pytest

from auvident.engines.estimator import Task, task_of
from auvident.engines.map_fit import FitRound, NoisePolicy, Prior, map_rounds
from auvident.engines.noise import Noise, white
from tests.engines.chain import setup_of
from tests.engines.test_estimator import linear_setup, stage

NOISE = 20.0  # [std of the sensor] about what the sample's residual counts for


def linear_task() -> Task:
    """A stage of the linear problem, with noise of some size."""
    task = task_of(linear_setup(), stage())
    noise = white(NOISE * task.setup.sensor_std)
    return replace(task, output=replace(task.output, colours=noise))


def rounds_of(task: Task, low=-np.inf, high=np.inf, **policy) -> list[FitRound]:
    """Rounds from the prior, within bounds, counted from zero; the noise stays as it is."""
    held = NoisePolicy(lambda output, p: Noise(output.colours), **({"rounds": 4} | policy))
    scale, n = task.free.scale, len(task.positions)
    mean = task.setup.prior[task.positions] / scale
    prior = Prior(mean, np.eye(n), np.full(n, low) / scale, np.full(n, high) / scale)
    return list(map_rounds(task.output, task.free, lambda _: prior, task.setup.prior, held))


def test_what_follows_moves_as_far_as_what_it_follows() -> None:
    setup = setup_of()
    leader, follower = (setup.structure.index(s) for s in ("Y_rdot", "N_vdot"))
    free = setup.free(np.array([setup.structure.index("Y_uv"), leader]))
    away = free.moved(setup.prior, np.array([0.5, -2.0])) - setup.prior
    assert away[leader] == pytest.approx(-2.0 * setup.prior_std[leader], rel=1e-12)
    assert away[follower] == pytest.approx(away[leader], rel=1e-12)
    assert sorted(np.flatnonzero(away)) == sorted([*free.positions, follower])


def test_a_fit_that_ends_at_a_bound_lies_on_it() -> None:
    task = linear_task()
    best = rounds_of(task)[-1].parameters[task.positions]
    moved = best - task.setup.prior[task.positions]
    half = task.setup.prior[task.positions] + 0.5 * moved  # no farther than half of the way
    low = np.where(moved < 0.0, half, -np.inf)
    high = np.where(moved > 0.0, half, np.inf)
    found = rounds_of(task, low, high)[-1].parameters[task.positions]
    np.testing.assert_array_less(low, found + 1e-12 * task.free.scale)
    np.testing.assert_array_less(found - 1e-12 * task.free.scale, high)
    assert np.isclose(found, half, rtol=1e-12).any()


def test_a_start_beyond_a_bound_is_put_on_it() -> None:
    task = linear_task()
    above = task.setup.prior[task.positions] + 0.1 * task.free.scale
    (found,) = rounds_of(task, above, rounds=1, steps=0)
    np.testing.assert_allclose(found.parameters[task.positions], above, rtol=1e-12)


@pytest.mark.parametrize(("settled", "expected"), [(0.03, 1), (None, 4)])
def test_rounds_end_when_the_noise_settles_or_are_all_run(settled, expected) -> None:
    task = linear_task()
    assert len(rounds_of(task, settled=settled)) == expected


def test_each_round_has_the_noise_that_the_last_one_left() -> None:
    task, given = linear_task(), []

    def update(output, p) -> Noise:
        given.append(output.colours[0].white)
        return Noise(tuple(replace(c, white=2.0 * c.white) for c in output.colours))

    policy = NoisePolicy(update, rounds=3, settled=0.03)
    start = task.setup.prior
    found = list(map_rounds(task.output, task.free, task.prior_about, start, policy))
    assert len(found) == 3
    assert given == pytest.approx(given[0] * np.array([1.0, 2.0, 4.0]))
    # the noisier the readings, the nearer the prior
    far = [np.linalg.norm((r.parameters - start)[task.positions] / task.free.scale) for r in found]
    assert far == sorted(far, reverse=True)
