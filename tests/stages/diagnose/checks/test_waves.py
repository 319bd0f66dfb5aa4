"""The search for swell, on residuals made of noise and of waves in closed form."""

import math

import numpy as np
import pytest

from auvident.schema.planes import VERTICAL
from auvident.stages.diagnose.checks.waves import (
    LEAST_BINS,
    Residual,
    Wave,
    find_wave,
    threshold_of,
)
from tests.processor_time import least_of_three

GRAVITY = 9.81
NOISE = np.array([0.005, 0.005, 0.001, 0.005])


def piece_of(
    rng: np.random.Generator,
    number: int,
    *,
    omega: float = 0.0,
    direction: float = 0.0,
    size: float = 0.0,
    duration_s: float = 90.0,
    vertical: bool = False,
    every: int = 1,
) -> Residual:
    """A turn, a zigzag or a straight run with coloured noise and, possibly, a wave on it."""
    t = rng.uniform(0.0, 900.0) + np.arange(0.0, duration_s, 0.1)
    swing = (np.sin(0.25 * t), 0.08 * t, np.zeros(len(t)))[number % 3]
    heading, u = rng.uniform(-math.pi, math.pi) + swing, np.full(len(t), rng.uniform(1.2, 1.8))
    noise = NOISE * rng.normal(size=(len(t), 4))
    for k in range(1, len(t)):  # turbulence: an AR(1) of 3 s
        noise[k] = 0.967 * noise[k - 1] + 0.256 * noise[k]
    ahead = np.cumsum(u * np.cos(heading - direction)) * 0.1
    phase = omega * t - omega**2 / GRAVITY * ahead + rng.uniform(0, 2 * math.pi)
    bearing = direction - heading
    own = [np.ones(len(t)), np.cos(bearing)] if vertical else [np.sin(bearing), np.sin(2 * bearing)]
    weights = np.column_stack([np.cos(bearing), *own, 0 * bearing])
    values = noise + size * NOISE * weights * np.sin(phase)[:, None]
    values[::2, :2] = np.nan  # a DVL at half the rate
    values[rng.integers(0, len(t) - 30) :][:25, :2] = np.nan  # and a drop-out
    kept = slice(None, None, every)
    return Residual(f"m{number}", t[kept], values[kept], u[kept], heading[kept])


def searched(seed: int, count: int = 9, **wave: float) -> Wave:
    rng = np.random.default_rng(seed)
    found = find_wave([piece_of(rng, k, **wave) for k in range(count)])
    assert found is not None
    return found


@pytest.mark.parametrize("omega, direction", [(0.7, 0.5), (1.0, 3.0), (1.4, 5.5)])
def test_a_wave_is_found_where_it_is(omega: float, direction: float) -> None:
    wave = searched(3, omega=omega, direction=direction, size=1.5)
    assert wave.found
    assert wave.frequency_radps == pytest.approx(omega, abs=0.015)
    apart = math.remainder(wave.direction_rad - direction, 2.0 * math.pi)
    assert abs(apart) < math.radians(6.0)
    assert wave.power_ratio == pytest.approx(np.mean(list(wave.by_channel.values())))


def test_a_wave_is_found_in_heave_and_pitch() -> None:
    rng = np.random.default_rng(4)
    planted = {"omega": 0.9, "direction": 2.0, "size": 1.5}
    pieces = [piece_of(rng, k, vertical=True, **planted) for k in range(9)]  # type: ignore[arg-type]
    wave = find_wave(pieces, plane=VERTICAL)
    assert wave is not None and wave.found and set(wave.by_channel) == {"u", "w", "q"}
    assert wave.frequency_radps == pytest.approx(0.9, abs=0.015)
    assert abs(math.remainder(wave.direction_rad - 2.0, 2.0 * math.pi)) < math.radians(6.0)


def test_coloured_noise_is_no_wave() -> None:
    ratios = [searched(seed).power_ratio for seed in range(8)]
    assert max(ratios) < 0.5 * threshold_of(9)


def test_few_maneuvers_must_show_it_more_clearly() -> None:
    assert threshold_of(1) > 2.0 * threshold_of(8)
    single = [searched(seed, count=1) for seed in range(20)]
    assert not any(wave.found for wave in single)


def test_repeated_response_to_the_rudder_is_no_wave() -> None:
    """A decaying error after every helm at unequal intervals, in all channels."""
    rng = np.random.default_rng(5)
    pieces = []
    for k in range(9):
        piece = piece_of(rng, k)
        values = piece.values.copy()
        for helm in np.cumsum(rng.uniform(6.0, 12.0, 8)):
            since = piece.time_s - piece.time_s[0] - helm
            values += np.where(since > 0, np.exp(-since), 0.0)[:, None] * 5.0 * NOISE
        pieces.append(
            Residual(piece.maneuver, piece.time_s, values, piece.u_mps, piece.heading_rad)
        )
    wave = find_wave(pieces)
    assert wave is not None and not wave.found


def test_one_channel_alone_can_be_searched() -> None:
    rng = np.random.default_rng(2)
    # of size 1 its power in one channel alone is about the threshold
    pieces = [piece_of(rng, k, omega=0.9, direction=1.0, size=1.5) for k in range(9)]
    wave = find_wave(pieces, ("u",))
    assert wave is not None and wave.channel == "u" and wave.found


@pytest.mark.parametrize("every", [5, 10, 12])
def test_a_wave_is_found_in_a_log_slower_than_the_bins(every: int) -> None:
    """At 2 Hz every fifth bin of 0.4 s would be empty: no way made good, no power, no number."""
    rng = np.random.default_rng(3)
    planted = {"omega": 0.7, "direction": 0.5, "size": 3.0}  # fewer readings, more noise
    pieces = [piece_of(rng, k, every=every, **planted) for k in range(9)]  # type: ignore[arg-type]
    wave = find_wave(pieces, ("r",))
    assert wave is not None and wave.found
    assert wave.frequency_radps == pytest.approx(0.7, abs=0.015)
    clean = find_wave([piece_of(rng, k, every=every) for k in range(9)])
    assert clean is not None and not clean.found and math.isfinite(clean.power_ratio)


def test_a_log_too_slow_for_any_wave_shows_none() -> None:
    rng = np.random.default_rng(3)
    pieces = [piece_of(rng, k, omega=0.7, size=1.5, duration_s=250.0, every=40) for k in range(9)]
    assert find_wave(pieces) is None


def test_too_short_pieces_give_nothing() -> None:
    rng = np.random.default_rng(0)
    assert find_wave([]) is None
    assert find_wave([piece_of(rng, 0, duration_s=0.4 * LEAST_BINS - 2.0)]) is None


def test_twelve_maneuvers_of_two_minutes_take_seconds_at_most() -> None:
    rng = np.random.default_rng(1)
    pieces = [piece_of(rng, k, duration_s=125.0) for k in range(12)]
    assert least_of_three(lambda: find_wave(pieces)) < 3.0
