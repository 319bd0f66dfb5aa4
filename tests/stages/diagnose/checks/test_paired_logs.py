"""Windows fitted to each other: what the logs do not tell within reach stays unknown."""

import numpy as np
import pytest

from auvident.stages.diagnose.checks.paired_logs import Stretch, fit_windows

WINDOWS, ROWS = 12, 40


def stretch_of(rng: np.random.Generator) -> Stretch:
    """A reference that scatters about zero."""
    window = np.repeat(np.arange(WINDOWS), ROWS)
    signals = {"reference_m": rng.normal(0.0, 1.0, len(window))}
    return Stretch(0.1, signals, np.arange(len(window)), window, window)


def seen_from(size: float, late: float):
    """A signal of the parameter x, of a size at zero, that grows from a delay `late` on."""

    def predict(stretch: Stretch, x: np.ndarray) -> np.ndarray:
        phase = np.sin(np.arange(len(stretch.rows)) * 0.7)
        shown = size * x[0] + max(abs(x[0]) - late, 0.0) * 3.0
        return (stretch.signals["reference_m"] - shown * phase)[:, None]

    return predict


@pytest.mark.parametrize("seed", range(4))
def test_a_delay_that_hardly_shows_is_unknown_within_its_reach(seed: int) -> None:
    """To first order it is told to 7 s; the slopes beyond 1 s would claim 0.03 s."""
    stretch = stretch_of(np.random.default_rng(seed))
    found = fit_windows([stretch], seen_from(0.01, 1.0), np.array([1.0]), np.array([2.5]))
    assert found is not None
    (x,), ((variance,),) = found[:2]
    assert abs(x) <= 2.5
    assert np.sqrt(variance) >= 2.5


def test_what_is_told_is_as_without_a_reach() -> None:
    stretch, prior = stretch_of(np.random.default_rng(5)), np.array([1.0])
    free, within = (
        fit_windows([stretch], seen_from(1.0, 9.0), prior, *reach)
        for reach in ((), (np.array([2.5]),))
    )
    assert free is not None
    assert within is not None
    np.testing.assert_array_equal(free[0], within[0])
    np.testing.assert_array_equal(free[1], within[1])
