"""Logs of commands that are written only on change, or may be."""

import numpy as np

from auvident.schema.holding import hold_rule, seems_on_change

RNG = np.random.default_rng(3)
GYRO_S = np.arange(0.0, 1200.0, 0.02)


def stepped_by_hand(count: int = 30) -> tuple[np.ndarray, np.ndarray]:
    time = np.cumsum(RNG.uniform(8.0, 90.0, count))
    return time, np.resize([0.0, 600.0, 900.0, 1200.0], count)


def moved_and_held() -> tuple[np.ndarray, np.ndarray]:
    """Rows at 20 Hz while an autopilot moves the rudder, none while it is held."""
    time = np.arange(0.0, 600.0, 0.05)
    kept = np.ones(time.size, dtype=bool)
    for start, length in zip(
        range(20, 600, 60), (31, 12, 44, 7, 20, 26, 9, 38, 15, 11), strict=True
    ):
        kept &= (time < start) | (time > start + length)
    return time[kept], np.sin(time[kept])


def test_rows_at_hand_steps_seem_on_change():
    time, values = stepped_by_hand()
    assert hold_rule(time, values, None).rule == "polled"
    assert seems_on_change(time, values, GYRO_S)


def test_an_autopilot_that_moves_and_holds_seems_on_change_unless_all_sensors_are_silent():
    time, values = moved_and_held()
    assert seems_on_change(time, values)
    assert seems_on_change(time, values, GYRO_S)
    assert not seems_on_change(time, values, time)


def test_polled_commands_do_not():
    time = np.arange(0.0, 600.0, 0.1)
    noisy = RNG.normal(size=time.size)
    held = np.repeat([0.0, 10.0, -10.0], time.size // 3)
    few = np.delete(noisy, slice(1000, 1200)), np.delete(time, slice(1000, 1200))
    assert not seems_on_change(time, noisy)
    assert not seems_on_change(time, held)
    assert not seems_on_change(few[1], few[0])  # a drop-out of 20 s
    slow = np.arange(0.0, 600.0, 3.0) + RNG.normal(0.0, 0.2, 200)
    assert not seems_on_change(slow, noisy[:200])  # polled at a third of a hertz, with jitter
    assert not seems_on_change(time[::7][:6], noisy[:6])
