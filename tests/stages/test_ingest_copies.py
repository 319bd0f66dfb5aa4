"""One trial given twice, in whatever form, is noticed; two trials never pass for one."""

from dataclasses import replace

import numpy as np
import pytest
from ingest_world import calm, maneuvers, sensor
from scipy import signal

from auvident.errors import InputError
from auvident.schema.logs import DEG, RawTrial
from auvident.stages.ingest import copies
from auvident.stages.ingest.copies import fingerprint, refuse_copy, without_copies

CHANNELS = {"dvl": ("u_mps", "v_mps"), "gyro": ("r_radps",)}


@pytest.fixture(scope="module")
def raw() -> RawTrial:
    return maneuvers(seed=1, duration_s=300.0)


def renamed(trial: RawTrial, name: str = "other") -> RawTrial:
    return replace(trial, name=name)


def each(trial: RawTrial, change) -> RawTrial:
    """Every sensor changed by a function of it."""
    return renamed(replace(trial, sensors={k: change(s) for k, s in trial.sensors.items()}))


def rows(s, keep):
    values = {c: x[keep] for c, x in s.values.items()}
    return replace(s, time_s=s.time_s[keep], values=values, rows=s.rows[keep])


def later(s, by_s):
    return replace(s, time_s=s.time_s + by_s)


def on_ticks(trial: RawTrial, ticks, how) -> RawTrial:
    """All channels on one clock, as a wide file has them."""
    sensors = {}
    for name, s in trial.sensors.items():
        values = {c: how(ticks, s.time_s, x) for c, x in s.values.items()}
        sensors[name] = sensor(name, ticks, **values)
    return RawTrial("wide", sensors)


def held(ticks, time, x):
    return x[np.clip(np.searchsorted(time, ticks, side="right") - 1, 0, None)]


def sparse(ticks, time, x):
    """The value in the first row at or after its time, empty cells between."""
    found = np.full(ticks.size, np.nan)
    place = np.searchsorted(ticks, time)
    found[place[place < ticks.size]] = x[place < ticks.size]
    return found


def rounded(trial: RawTrial, digits: int, per_unit: float = 1.0) -> RawTrial:
    return each(
        trial,
        lambda s: replace(
            s, values={c: np.round(x * per_unit, digits) / per_unit for c, x in s.values.items()}
        ),
    )


FORMS = {
    "another name": renamed,
    "a shifted clock": lambda t: each(t, lambda s: later(s, 1234.567)),
    "a clock of 1970": lambda t: each(t, lambda s: later(s, 1.7e9)),
    "the first half": lambda t: each(t, lambda s: rows(s, s.time_s < 150.0)),
    "a minute of it, later": lambda t: each(
        t, lambda s: later(rows(s, (s.time_s > 100) & (s.time_s < 160)), -100.0)
    ),
    "held on a fast clock": lambda t: on_ticks(t, np.arange(0.5, 299, 0.02), held),
    "held on a clock of 10 Hz": lambda t: on_ticks(t, np.arange(0.5, 299, 0.1), held),
    "with empty cells": lambda t: on_ticks(t, np.arange(0.5, 299, 0.01), sparse),
    "interpolated at 10 Hz": lambda t: on_ticks(t, np.arange(0.5, 299, 0.1), np.interp),
    "with four digits": lambda t: rounded(t, 4),
    "with four digits, later": lambda t: each(rounded(t, 4), lambda s: later(s, 77.0)),
    "in degrees with three digits": lambda t: rounded(t, 3, 1.0 / DEG),
    "in single precision": lambda t: each(
        t,
        lambda s: replace(
            s, values={c: x.astype(np.float32).astype(float) for c, x in s.values.items()}
        ),
    ),
    "with a tenth of its rows lost": lambda t: each(
        t, lambda s: rows(s, np.arange(s.time_s.size) % 100 > 9)
    ),
}


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("turned", [False, True])
def test_a_copy_is_refused_in_every_form(raw, form, turned):
    pair = [raw, FORMS[form](raw)]
    first, second = pair[::-1] if turned else pair
    with pytest.raises(InputError) as caught:
        refuse_copy(fingerprint(second), [fingerprint(first)])
    error = caught.value
    assert error.exit_code == 3
    assert error.remedy
    for word in (first.name, second.name):
        assert word in f"{error.where} {error.problem}"


def test_a_smooth_copy_is_refused(raw):
    """Simulated logs have no noise."""
    smooth = maneuvers(noise=0.0, duration_s=200.0)
    for other in (renamed(smooth), FORMS["a shifted clock"](smooth)):
        with pytest.raises(InputError):
            refuse_copy(fingerprint(other), [fingerprint(smooth)])


def coarse(trial: RawTrial) -> RawTrial:
    """Readings with few digits: 0.1 deg/s and 1 cm/s."""
    steps = {"r_radps": 0.1 * DEG, "u_mps": 0.01, "v_mps": 0.01}
    return replace(
        trial,
        sensors={
            k: replace(
                s,
                values={
                    c: np.round(x / steps[c]) * steps[c] if c in steps else x
                    for c, x in s.values.items()
                },
            )
            for k, s in trial.sensors.items()
        },
    )


@pytest.mark.parametrize("noise", [1.0, 0.1, 0.02])
@pytest.mark.parametrize("form", [lambda t: t, coarse, lambda t: rounded(t, 3)])
def test_the_same_maneuvers_sailed_again_are_another_trial(noise, form):
    """Same motion to the last digit, only the noise of the sensors and their ticks differ."""
    first = fingerprint(form(maneuvers(seed=1, duration_s=300.0, noise=noise)))
    for seed in (2, 3, 4):
        second = form(maneuvers(seed=seed, duration_s=300.0, noise=noise))
        refuse_copy(fingerprint(renamed(second)), [first])


@pytest.mark.parametrize(("noise", "form"), [(1.0, lambda t: t), (0.1, lambda t: t), (1.0, coarse)])
def test_the_same_maneuvers_on_the_same_ticks_are_another_trial(noise, form):
    def noisy(seed: int) -> RawTrial:
        rng = np.random.default_rng(seed)
        smooth = maneuvers(noise=0.0, duration_s=300.0)
        stds = {"u_mps": 0.005, "v_mps": 0.005, "r_radps": 0.002}
        return form(
            each(
                smooth,
                lambda s: replace(
                    s,
                    values={
                        c: x + noise * stds.get(c, 0.0) * rng.standard_normal(x.size)
                        for c, x in s.values.items()
                    },
                ),
            )
        )

    first = fingerprint(noisy(1))
    for seed in (2, 3, 4):
        refuse_copy(fingerprint(noisy(seed)), [first])


def test_straight_runs_at_one_speed_are_other_trials():
    def straight(seed: int, step: float) -> RawTrial:
        rng = np.random.default_rng(seed)
        t = np.arange(2000) / 10.0
        u, v, r = (
            step * np.round(x / step)
            for x in (
                1.5 + 0.004 * rng.standard_normal(t.size),
                0.004 * rng.standard_normal(t.size),
                0.002 * rng.standard_normal(t.size),
            )
        )
        return calm(
            duration_s=200.0,
            dvl=sensor("dvl", t, u_mps=u, v_mps=v),
            gyro=sensor("gyro", t, r_radps=r),
        )

    for step in (1e-9, 1e-3, 5e-3, 2e-2):
        first = fingerprint(straight(1, step))
        for seed in range(2, 8):
            refuse_copy(fingerprint(straight(seed, step)), [first])


def test_a_few_seconds_in_common_are_no_copy(raw):
    """Recorders that roll over keep the last seconds in both files."""
    first = each(raw, lambda s: rows(s, s.time_s < 155.0))
    second = each(raw, lambda s: rows(s, s.time_s > 150.0))
    refuse_copy(fingerprint(renamed(second)), [fingerprint(first)])


@pytest.mark.parametrize("by_s", [0.0, 5000.0])
def test_what_two_trials_share_is_used_once_and_said(raw, by_s):
    first = each(raw, lambda s: rows(s, s.time_s < 190.0))
    second = each(raw, lambda s: later(rows(s, s.time_s > 150.0), by_s))
    left, parts = without_copies(second, fingerprint(second), [fingerprint(first)])
    assert not parts
    (finding,) = left.findings
    assert finding.code == "trials_overlap"
    assert finding.value == pytest.approx(40.0, abs=1.0)
    for name, s in left.sensors.items():
        assert s.time_s.min() == pytest.approx(190.5 + by_s, abs=0.7)
        assert s.time_s.size + s.dropped["in_another_trial"] == second.sensors[name].time_s.size


@pytest.mark.parametrize("form", ["the first half", "a minute of it, later"])
def test_of_two_recordings_the_longer_one_is_kept(raw, form):
    part, whole = FORMS[form](raw), renamed(raw, "whole")
    assert without_copies(whole, fingerprint(whole), [fingerprint(part)], {part.name})[1] == (
        part.name,
    )
    with pytest.raises(InputError, match="contains the readings"):
        without_copies(part, fingerprint(part), [fingerprint(whole)], {whole.name})
    with pytest.raises(InputError, match="contains the readings"):
        without_copies(whole, fingerprint(whole), [fingerprint(part)])


def mean_over(step_s: float, by_s: float):
    """The gyro averaged to another rate, on a clock of its own."""

    def change(trial: RawTrial) -> RawTrial:
        gyro = trial.sensors["gyro"]
        place = np.floor(gyro.time_s / step_s).astype(int)
        ticks, place = np.unique(place, return_inverse=True)
        r = np.bincount(place, gyro.values["r_radps"]) / np.bincount(place)
        slow = sensor("gyro", (ticks + 0.5) * step_s + by_s, r_radps=r)
        return renamed(replace(trial, sensors={"gyro": slow}))

    return change


def decimated(trial: RawTrial, by_s: float = 77.77) -> RawTrial:
    """The gyro through the filter of a library, every fifth value."""
    gyro = trial.sensors["gyro"]
    ticks = np.arange(0.5, 299.0, 0.02)
    r = signal.decimate(np.interp(ticks, gyro.time_s, gyro.values["r_radps"]), 5)
    return renamed(RawTrial("slow", {"gyro": sensor("gyro", ticks[::5] + by_s, r_radps=r)}))


RESAMPLED = {
    "averaged to 10 Hz": mean_over(0.1, 0.0),
    "averaged to 10 Hz, later": mean_over(0.1, 1234.567),
    "averaged to 5 Hz, earlier": mean_over(0.2, -4321.012),
    "interpolated, later": lambda t: each(
        on_ticks(t, np.arange(0.5, 299, 0.1), np.interp), lambda s: later(s, 55.513)
    ),
    "every fifth reading, later": lambda t: each(
        t, lambda s: later(rows(s, np.arange(s.time_s.size) % 5 == 0), 1000.003)
    ),
    "decimated, later": decimated,
}


@pytest.mark.parametrize("form", RESAMPLED)
@pytest.mark.parametrize("turned", [False, True])
def test_a_resampled_copy_is_refused(raw, form, turned):
    pair = [raw, RESAMPLED[form](raw)]
    first, second = pair[::-1] if turned else pair
    with pytest.raises(InputError, match="contains the readings"):
        refuse_copy(fingerprint(second), [fingerprint(first)])


@pytest.mark.parametrize("noise", [1.0, 0.1, 0.02])
@pytest.mark.parametrize("form", ["averaged to 10 Hz, later", "decimated, later"])
def test_another_flight_of_the_same_program_is_no_resampled_copy(raw, noise, form):
    first = fingerprint(maneuvers(seed=1, duration_s=300.0, noise=noise))
    for seed in (2, 3, 4):
        second = RESAMPLED[form](maneuvers(seed=seed, duration_s=300.0, noise=noise))
        refuse_copy(fingerprint(second), [first])


@pytest.mark.parametrize("turned", [False, True])
def test_stamps_of_whole_seconds_are_compared(raw, turned):
    """Most stamps repeat: the median of their steps is no period."""
    coarse, fine = each(raw, in_whole_seconds), maneuvers(seed=2, duration_s=300.0)
    for other in (fine, each(fine, in_whole_seconds)):
        old, new = (other, coarse) if turned else (coarse, other)
        refuse_copy(fingerprint(new), [fingerprint(renamed(old, "first"))])
    with pytest.raises(InputError, match="contains the readings of trial first"):
        refuse_copy(fingerprint(coarse), [fingerprint(renamed(coarse, "first"))])


def test_stamps_that_never_advance_are_compared(raw):
    stopped = each(raw, lambda s: replace(s, time_s=np.zeros(s.time_s.size)))
    refuse_copy(fingerprint(stopped), [fingerprint(renamed(maneuvers(seed=2), "first"))])


def in_whole_seconds(s):
    return replace(s, time_s=np.floor(s.time_s))


def test_a_long_log_is_compared_by_some_of_its_runs(raw, monkeypatch):
    monkeypatch.setattr(copies, "MOST_RUNS", 2000)
    monkeypatch.setattr(copies, "MOST_READINGS", 4000)
    monkeypatch.setattr(copies, "PIECE", 400)
    first = fingerprint(raw)
    assert first.readings["r_radps"].thinned == 8
    assert first.readings["r_radps"].time_s.size == 4000
    for form in ("another name", "a shifted clock", "the first half"):
        with pytest.raises(InputError):
            refuse_copy(fingerprint(FORMS[form](raw)), [first])
    refuse_copy(fingerprint(renamed(maneuvers(seed=2, duration_s=300.0))), [first])


def test_readings_that_never_change_say_nothing():
    t, none = np.arange(200) / 10, np.zeros(200)
    gyro, dvl = sensor("gyro", t, r_radps=none), sensor("dvl", t, u_mps=none + 1.5, v_mps=none)
    still = calm(gyro=gyro, dvl=dvl)
    refuse_copy(fingerprint(renamed(still)), [fingerprint(still)])
