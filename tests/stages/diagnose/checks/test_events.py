"""The search for one-off events, on residuals of a linear vehicle that is pushed."""

import math
from dataclasses import replace

import numpy as np
import pytest

from auvident.schema.planes import VERTICAL
from auvident.stages.diagnose.checks.events import (
    BIN,
    PAIR_THRESHOLD,
    THRESHOLD,
    Event,
    find_events,
    smallest_push,
)
from auvident.stages.diagnose.checks.waves import Residual

NOISE = np.array([0.005, 0.005, 0.0009, 0.005])
# sway and yaw answer to a force within seconds: d(v, r)/dt = A (v, r) + B force
A = np.array([[-0.6, -0.5], [-0.3, -0.9]])
HELMS_S = np.arange(8.0, 80.0, 9.0)


def answer(force: np.ndarray, dt: float = 0.1) -> np.ndarray:
    """u, v, r and heading (n, 4) after side force and moment (n, 2) in m/s^2 and rad/s^2."""
    state, out = np.zeros(4), np.zeros((len(force), 4))
    for k, push in enumerate(force):
        state[1:3] += dt * (A @ state[1:3] + push)
        state[0] += dt * (-0.15 * state[0] - 0.3 * abs(push[0]) * 0.2)
        state[3] += dt * state[2]
        out[k] = state
    return out


def half_sine(t: np.ndarray, start: float, length: float) -> np.ndarray:
    phase = (t - start) / length
    return np.where((phase >= 0) & (phase <= 1), np.sin(math.pi * phase), 0.0)


def pieces_of(
    seed: int,
    *,
    push: dict[int, tuple[float, float]] | None = None,
    helm: float = 0.0,
    start: float = 0.0,
    thrust: int = -1,
) -> list[Residual]:
    """Eight maneuvers; `push` = {maneuver: (start, size)}, `helm` an error after each helm."""
    rng, pieces = np.random.default_rng(seed), []
    for number in range(8):
        t = np.arange(0.0, 85.0, 0.1)
        force = 0.002 * rng.normal(size=(len(t), 2)) * math.sqrt(10.0)
        for k, at in enumerate(HELMS_S if helm else []):
            sign = helm * (-1) ** k * rng.uniform(0.8, 1.2)
            force += sign * half_sine(t, at, 1.5)[:, None] * [0.02, 0.05]
        if push and number in push:
            begin, size = push[number]
            force += size * half_sine(t, begin, 3.0)[:, None] * [0.05, 0.05]
        values = answer(force)
        values[:, 1:3] += start * np.exp(-t / 2.0)[:, None] * [0.1, 0.1] * rng.normal(size=2)
        if number == thrust:
            values[:, 0] -= 0.2 * (1.0 - np.exp(-np.maximum(t - 40.0, 0.0) / 8.0))
        values += NOISE * rng.normal(size=values.shape)
        values[::2, :2] = np.nan
        gap = rng.integers(100, 700)
        if push and number in push and abs(t[gap] - push[number][0]) < 5.0:
            gap += 100 if gap < 400 else -100  # nobody finds a push that no reading has seen
        values[gap : gap + 20, :2] = np.nan
        stamps = t + 100.0 * number
        pieces.append(Residual(f"m{number}", stamps, values, np.full(len(t), 1.5), 0.0 * t))
    return pieces


def found(seed: int, **what: object) -> list[Event]:
    return find_events(pieces_of(seed, **what), NOISE)  # type: ignore[arg-type]


# of size 1, at 10 and 37 s, half of 60 seeds stay below the six times that an event needs
@pytest.mark.parametrize(("at", "size"), [(10.0, 1.5), (37.0, 1.5), (70.0, 1.5)])
def test_a_push_is_found_in_its_place(at: float, size: float) -> None:
    early = 0
    for seed in range(1, 9):
        (event,) = found(seed, push={3: (at, size)}, helm=0.4)
        assert event.maneuver == "m3"
        begin, end = event.time_s - 300.0, event.time_s - 300.0 + event.duration_s
        assert begin <= at + BIN and at - begin < 4.0  # it grows from nothing in its first bin
        assert min(at + 3.0, 84.0) <= end < at + 20.0
        assert {"v", "r"} & set(event.channels)
        early += begin <= at + 0.5
    assert early >= 5  # of 8; 56 of 60 seeds where it is least


def test_a_push_is_as_long_as_the_vehicle_is_slow() -> None:
    """Four times slower, all rates a quarter: on a bulk carrier's model a push lasts 12 s."""
    what = {"push": {3: (37.0, 1.5)}, "helm": 0.4}
    (event,) = found(1, **what)
    slow = [
        replace(p, time_s=4.0 * p.time_s, values=p.values * [1.0, 1.0, 0.25, 1.0])
        for p in pieces_of(1, **what)  # type: ignore[arg-type]
    ]
    (longer,) = find_events(slow, NOISE[:3] * [1.0, 1.0, 0.25], hull_time_s=4.0)
    assert longer.time_s == pytest.approx(4.0 * event.time_s)
    assert longer.duration_s == pytest.approx(4.0 * event.duration_s)
    assert longer.ratio == pytest.approx(event.ratio)
    assert (event.resolution_s, longer.resolution_s) == (1.0, 4.0)


def test_heading_that_a_push_leaves_behind_is_told() -> None:
    force = half_sine(np.arange(0.0, 85.0, 0.1), 40.0, 3.0)[:, None] * [0.05, 0.05]
    turned = answer(force)[-1, 3]
    (event,) = found(2, push={5: (40.0, 1.0)})
    assert event.angle_rad == pytest.approx(turned, abs=0.03)


def test_in_the_vertical_plane_the_channels_have_its_names() -> None:
    pieces = [
        replace(p, heading_rad=3.0 + p.heading_rad, angle_rad=0.0 * p.heading_rad)
        for p in pieces_of(2, push={5: (40.0, 1.0)})
    ]
    (event,) = find_events(pieces, NOISE, VERTICAL)
    assert set(event.channels) <= {"u", "w", "q"} and {"w", "q"} & set(event.channels)
    assert event.maneuver == "m5"


@pytest.mark.parametrize(
    "what", [{}, {"helm": 1.0}, {"start": 1.0}, {"thrust": 4}, {"helm": 0.3, "start": 0.5}]
)
def test_nothing_is_found_in_what_repeats_or_starts_or_stays(what: dict[str, float]) -> None:
    assert not [e for seed in range(12) for e in found(seed, **what)]


def test_two_events_are_found_when_they_are_clear() -> None:
    events = found(4, push={2: (30.0, 3.0), 6: (50.0, -3.0)})
    assert {e.maneuver for e in events} == {"m2", "m6"}


def test_of_two_bad_places_each_has_to_stand_out_more_than_one_alone() -> None:
    """Pushes of which each, alone, is an event: twelve times the rest, where two need sixteen."""
    (alone,) = found(1, push={2: (30.0, 1.0)})
    assert THRESHOLD < alone.ratio < PAIR_THRESHOLD
    assert found(1, push={2: (30.0, 1.0), 6: (50.0, -1.0)}) == []


def shaken(seed: int, first: float, last: float) -> list[Residual]:
    """Nothing but one maneuver in which sway and yaw jump from side to side for some time [s]."""
    pieces, t = pieces_of(seed), np.arange(0.0, 85.0, 0.1)
    values, during = pieces[3].values.copy(), (t >= first) & (t < last)
    values[during, 1:3] += 0.1 * np.sign(np.sin(0.5 * math.pi * t[during]))[:, None]
    pieces[3] = replace(pieces[3], values=values)
    return pieces


def test_what_lasts_longer_than_a_vehicle_answers_a_push_is_none() -> None:
    assert find_events(shaken(1, 30.0, 34.0), NOISE)
    assert find_events(shaken(1, 30.0, 60.0), NOISE) == []


def test_what_reaches_back_to_the_start_is_the_start_state() -> None:
    assert find_events(shaken(1, 20.0, 27.0), NOISE)
    assert find_events(shaken(1, 0.0, 7.0), NOISE) == []


def test_a_push_below_the_noise_of_the_sensors_is_none() -> None:
    pieces = pieces_of(5, push={3: (30.0, 1.0)})
    assert find_events(pieces, NOISE)
    assert not find_events(pieces, 100.0 * NOISE)


def test_a_prediction_that_runs_away_is_no_event() -> None:
    """Its residual grows beyond what the vehicle did, or ends in nothing."""
    pieces = pieces_of(6, helm=0.5)
    for number, last in ((2, 850), (5, 400)):
        values = pieces[number].values.copy()
        grown = np.exp((np.arange(850) - 400.0) / 15.0)
        values[:, 1:3] += 0.01 * np.minimum(grown, 100.0)[:, None]
        values[last:] = np.nan
        pieces[number] = replace(pieces[number], values=values)
    assert find_events(pieces, NOISE) == []


def test_one_maneuver_alone_tells_nothing() -> None:
    assert find_events(pieces_of(6, push={0: (30.0, 2.0)})[:1], NOISE) == []
    assert find_events([], NOISE) == []


def test_the_smallest_push_is_one_that_is_found() -> None:
    """Changes of v and r within L/U as large as is said stand out, half as large ones do not."""
    quiet = pieces_of(7, helm=0.4)
    sway, yaw = smallest_push(quiet, NOISE) or (0.0, 0.0)
    for size, count in ((1.25, 1), (0.5, 0)):
        for number, at in ((1, 300), (4, 505), (6, 700)):
            pushed = list(quiet)
            values = quiet[number].values.copy()
            fading = np.exp(-np.arange(850 - at) / 20.0)[:, None]
            values[at:, 1:3] += size * fading * [sway, -yaw]
            pushed[number] = replace(quiet[number], values=values)
            assert len(find_events(pushed, NOISE)) == count


def test_a_push_has_to_be_louder_than_the_sensors_and_than_what_repeats() -> None:
    small, loud = (smallest_push(pieces_of(8, helm=h), NOISE) for h in (0.2, 1.0))
    deaf = smallest_push(pieces_of(8, helm=0.2), 10.0 * NOISE)
    assert small and loud and deaf
    assert np.all(np.array(small) < loud)
    assert deaf == pytest.approx(tuple(math.sqrt(8.0) * 2.0 * 10.0 * NOISE[1:3]))
    assert smallest_push(pieces_of(8)[:1], NOISE) is None
