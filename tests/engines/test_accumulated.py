"""What a record adds to the likelihood in one go, against the whitened rows written down."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from auvident.engines.free_run import (
    OutputError,
    best_start,
    innovations,
    lost_readings,
    normal_equations,
)
from auvident.engines.prediction import Free
from auvident.engines.records import Record
from auvident.estimation.coloured import Colour
from tests.engines import test_prediction as horizontal
from tests.engines import test_vertical_effects as vertical
from tests.engines.effects_world import COURSE, FREELY, World

COLOURS = (
    Colour(0.01, 0.03, 1.0),
    Colour(0.02, 0.05, 2.0),
    Colour(0.003, 0.004, 0.6),
    Colour(0.02, 0.0, 1.0),
)
LATERAL = np.array([False, True, True, False])
# every effect of servo, propeller and sensors at work and free; late sensors among them
WORLDS = {"horizontal": horizontal, "vertical": vertical}


def noisy(record: Record) -> Record:
    """Readings with noise, and with gaps of one channel and of all."""
    rng = np.random.default_rng(4)
    measured = record.measured + 0.02 * rng.normal(size=record.measured.shape)
    measured[20:35, 1] = measured[60:63] = np.nan
    return replace(record, measured=measured)


def written_down(output: OutputError, p: Any, record: Record, free: Free) -> Any:
    """The same from the array of all white rows."""
    found, k = innovations(output, output.at(p, free), record), len(output.channels)
    assert found is not None
    gram = found.white.T @ found.white
    g, h = gram[1:, 0], gram[1:, 1:]
    start = best_start(output, h[:k, :k], np.column_stack([g[:k], h[:k, k:]]))
    lost = lost_readings(record, found.seen, output.channels)
    half = 0.5 * (float(gram[0, 0]) - float(g[:k] @ start[:, 0]) + lost)
    return half, g[k:] - h[k:, :k] @ start[:, 0], h[k:, k:] - h[k:, :k] @ start[:, 1:], lost


@pytest.mark.parametrize("active", [COURSE, FREELY, LATERAL], ids=["course", "freely", "lateral"])
@pytest.mark.parametrize("plane", WORLDS)
def test_products_are_those_of_the_white_rows(plane, active) -> None:
    world: World = WORLDS[plane].WORLD
    record, free = noisy(WORLDS[plane].TRUTH), WORLDS[plane].FREE
    output = OutputError(world.frame, (record,), active, COLOURS)
    found = normal_equations(output, world.p, record, free)
    half, gradient, curvature, lost = written_down(output, world.p, record, free)
    assert lost > 0  # of the late sensors
    assert found is not None
    size = np.sqrt(np.diag(curvature))
    size = np.maximum(size, 1e-6 * size.max())  # an inactive channel's effects show nowhere
    # the same sums in another order; the start that is taken out is nearly all of some slopes
    assert found[0] == pytest.approx(half, rel=1e-11)
    np.testing.assert_allclose(found[1], gradient, atol=1e-9 * np.sqrt(2 * half) * size.max())
    np.testing.assert_allclose(
        found[2] / np.outer(size, size), curvature / np.outer(size, size), atol=1e-9
    )


def test_an_observer_gain_is_heeded() -> None:
    world, record, free = horizontal.WORLD, noisy(horizontal.TRUTH), horizontal.FREE
    gain = np.array([0.1, 0.1, 0.1, 0.0])
    output = OutputError(world.frame, (record,), COURSE, COLOURS, gain=gain)
    found = normal_equations(output, world.p, record, free)
    assert found is not None
    assert found[0] == pytest.approx(written_down(output, world.p, record, free)[0], rel=1e-11)
    free_running = normal_equations(replace(output, gain=None), world.p, record, free)
    assert free_running is not None
    assert np.trace(found[2]) < 0.9 * np.trace(free_running[2])


@pytest.mark.parametrize("value", [60.0, np.nan])
def test_a_motion_that_runs_away_adds_nothing(value) -> None:
    world, record, free = horizontal.WORLD, horizontal.TRUTH, horizontal.FREE
    p = world.p.copy()
    p[world.index("X_uu")] = value
    output = OutputError(world.frame, (record,), COURSE, COLOURS)
    assert normal_equations(output, p, record, free) is None


def test_a_motion_nearly_lost_adds_nothing() -> None:
    """It stays below the speed that stops it, but its slopes are beyond any use."""
    world, record, free = horizontal.WORLD, horizontal.TRUTH, horizontal.FREE
    exact = tuple(Colour(1e-13, 0.0, 1.0) for _ in range(4))
    output = OutputError(world.frame, (record,), COURSE, exact)
    assert innovations(output, output.at(world.p, free), record) is not None
    assert normal_equations(output, world.p, record, free) is None


def test_no_memory_is_shared_between_results() -> None:
    world, record, free = horizontal.WORLD, noisy(horizontal.TRUTH), horizontal.FREE
    output = OutputError(world.frame, (record,), COURSE, COLOURS)
    first = normal_equations(output, world.p, record, free)
    assert first is not None
    kept = [np.copy(part) for part in first]
    normal_equations(output, 1.01 * world.p, record, free)
    for part, before in zip(first, kept, strict=True):
        np.testing.assert_array_equal(part, before)
