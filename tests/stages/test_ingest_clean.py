"""Cleaning: flaws go and are counted, maneuvers stay."""

import re
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ingest_world import calm, changed, maneuvers, sensor, vehicle

from auvident.errors import InputError
from auvident.schema.channels import BY_COLUMN
from auvident.stages.ingest import ingest
from auvident.stages.ingest.clean import internal_sign
from auvident.stages.ingest.held_copies import keep_one_of_held
from auvident.stages.ingest.order import order_rows
from auvident.stages.ingest.outliers import find_outliers, noise_std

TICKS = np.arange(100) * 0.1


def test_a_log_of_fins_ahead_of_the_origin_is_refused():
    """The other sign would be told by it: a positive angle of them turns to starboard."""
    fins = {"kind": "rudder", "count": 2, "exposed_span_m": 0.1, "root_chord_m": 0.1}
    for station, ahead in ((-0.8, False), (0.5, True)):
        own = vehicle(fin=[{**fins, "tip_chord_m": 0.1, "x_m": station}])
        assert internal_sign(BY_COLUMN["elevator_rad"], own) == 1
        if ahead:
            with pytest.raises(InputError, match="rudder stands"):
                internal_sign(BY_COLUMN["rudder_rad"], own)
        else:
            assert internal_sign(BY_COLUMN["rudder_rad"], own) == 1


def ordered(time):
    return order_rows(sensor("gyro", time, r_radps=np.arange(len(time))))


@pytest.mark.parametrize(
    ("rows", "stamps"),
    [
        ([50], [3.0]),  # too early
        ([50], [4.2e12]),  # far ahead
        ([50], [5.15]),  # a little ahead
        ([50, 51], [5.1, 5.0]),  # swapped
        ([50, 51, 52], [900.0, 901.0, 902.0]),
        ([99], [4.2e12]),  # the last row
        ([0], [700.0]),
        ([20, 70], [1.0, 0.5]),
    ],
)
def test_glitches_are_dropped_and_nothing_else(rows, stamps):
    time = TICKS.copy()
    time[rows] = stamps
    found = ordered(time)
    assert set(found.backward) <= set(rows)
    assert np.all(np.diff(time[found.keep]) > 0)
    assert found.keep.size >= 100 - len(rows)


@pytest.mark.parametrize("rows", [[31], [35, 36], [35, 37], [38, 39], [35, 65, 66]])
def test_a_step_back_of_stamps_in_whole_seconds_is_a_glitch(rows):
    """The stamp that returns is equal to the one before: nothing stays back."""
    time = np.floor(TICKS)
    time[rows] -= 1.0
    found = ordered(time)
    assert found.backward.size == len(rows) and np.all(np.diff(time[found.keep]) >= 0)


@pytest.mark.parametrize("back_s", [2.0, 5.0])
def test_a_clock_in_whole_seconds_that_is_set_back_is_refused(back_s):
    with pytest.raises(InputError, match="time goes backward and stays there"):
        ordered(np.floor(np.concatenate((TICKS, TICKS + 10.0 - back_s))))


@pytest.mark.parametrize(
    ("time", "row"),
    [
        (np.concatenate((TICKS, TICKS)), 102),  # the clock starts again
        (np.concatenate((TICKS, TICKS + 5)), 102),
        (np.concatenate((TICKS, TICKS + 9.65)), 102),  # set back by 0.35 s
    ],
)
def test_time_that_stays_back_is_refused(time, row):
    with pytest.raises(InputError) as caught:
        ordered(time)
    assert caught.value.exit_code == 3
    for word in ("time goes backward", "gyro.csv", f"row {row}", "time_s", "9.900 s"):
        assert word in str(caught.value)


def test_time_that_jumps_ahead_for_good_is_refused():
    with pytest.raises(InputError, match=r"row 102.*\n?.*jumps"):
        ordered(np.concatenate((TICKS, TICKS + 1.7e9)))


def test_rows_written_twice_are_dropped():
    time = np.concatenate((TICKS[:60], TICKS[40:]))
    raw = sensor("gyro", time, r_radps=np.sin(time))
    found = order_rows(raw)
    np.testing.assert_array_equal(time[found.keep], TICKS)


@settings(max_examples=50, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_scattered_glitches_never_break_the_order(seed):
    rng = np.random.default_rng(seed)
    time = TICKS.copy()
    bad = rng.choice(np.arange(5, 95, 5), 6, replace=False)
    time[bad] += rng.uniform(-4, 4, 6)
    found = ordered(time)
    assert np.all(np.diff(time[found.keep]) >= 0)
    good = np.setdiff1d(np.arange(100), bad)
    assert np.isin(good, found.keep).mean() > 0.94  # a glitch costs itself, rarely a neighbour


def test_repeated_stamps_first_sample_last_command():
    raw = calm()
    for name in ("gyro", "rudder"):
        time = raw.sensors[name].time_s.copy()
        time[30] = time[29]
        raw = changed(raw, name, time_s=time)
    trial, quality = ingest(raw, vehicle())
    counts = {c.column: c.dropped for s in quality.sensors for c in s.channels}
    assert counts["r_radps"]["repeated_time"].count == 1
    assert counts["r_radps"]["repeated_time"].first_times_s == (raw.sensors["gyro"].time_s[29],)
    assert counts["r_radps"]["repeated_time"].first_rows == (32,)  # row 2 is sample 0
    assert counts["rudder_rad"]["repeated_time"].count == 1
    values = raw.sensors["gyro"].values["r_radps"]
    assert trial.table["r_radps"][29] == values[29]
    assert trial.table["r_radps"][30] == pytest.approx((values[29] + values[31]) / 2)


@pytest.mark.parametrize("noise", [0.0, 0.005])
def test_outliers_go_and_the_rest_stays(noise):
    rng = np.random.default_rng(7)
    t = np.arange(0, 200, 0.2)
    clean = np.interp(t, [0, 50, 51, 80, 82, 200], [0, 0, 0.4, 0.4, -0.4, -0.4])
    values = clean + noise * rng.normal(size=t.size)
    planted = np.array([20, 100, 101, 300, 500, 700])
    values[planted] += np.array([1, -1, -1.2, 0.6, -0.8, 1.5])
    np.testing.assert_array_equal(np.flatnonzero(find_outliers(values)), planted)


def test_onsets_survive():
    """Steps, ramps, peaks and a servo's response, sampled so that a step lies between rows."""
    t = np.arange(0, 60, 0.2)
    shapes = (
        np.where(t > 20.1, 0.3, 0.0),
        np.clip(t - 20.1, 0, 1.0),
        np.maximum(0, 1 - np.abs(t - 20.1)),
        np.where(t > 20.1, 1 - np.exp(-(t - 20.1) / 0.3), 0.0),
        np.round(0.02 * np.sin(t) + 0.001, 2),  # a coarse digit that toggles
    )
    for k, clean in enumerate(shapes):
        assert not find_outliers(clean).any(), k
        noisy = clean + 1e-3 * np.random.default_rng(k).normal(size=t.size)
        assert not find_outliers(noisy).any(), k


def test_outliers_of_noise_are_rare():
    noise = np.random.default_rng(0).normal(size=200_000)
    assert find_outliers(noise).sum() <= 2  # six sigmas and three times the steps nearby


def test_noise_is_seen_through_motion():
    t = np.arange(0, 300, 0.1)
    values = np.sin(0.5 * t) + 0.01 * np.random.default_rng(1).normal(size=t.size)
    assert noise_std(values) == pytest.approx(0.01, rel=0.1)  # 3000 samples: 2 %


def test_held_copies_are_thinned_and_true_samples_are_not():
    rng = np.random.default_rng(0)
    slow = rng.normal(size=60)
    t = np.arange(300) * 0.02
    held = sensor("dvl", t, u_mps=np.repeat(slow, 5), v_mps=np.repeat(slow, 5))
    np.testing.assert_array_equal(
        np.flatnonzero(keep_one_of_held(held, np.arange(300))), np.arange(0, 300, 5)
    )
    uneven = np.repeat(slow, np.tile([2, 3], 30))  # 4 Hz in a log of 10 Hz
    kept = keep_one_of_held(sensor("dvl", np.arange(150) * 0.1, u_mps=uneven), np.arange(150))
    assert kept.sum() == 60
    assert keep_one_of_held(sensor("dvl", t, u_mps=rng.normal(size=300)), np.arange(300)) is None


def test_a_drop_out_filled_with_copies_becomes_a_gap():
    raw = calm(duration_s=100)
    noise = 0.005 * np.random.default_rng(1).normal(size=(2, 1000))
    values = {"u_mps": 1.5 + noise[0], "v_mps": noise[1]}
    for x in values.values():
        x[500:530] = x[500]
    stuck = changed(raw, "dvl", values=values)
    _, quality = ingest(stuck, vehicle(), max_gap_s=1.0)
    assert [(r.t_start_s, r.t_end_s) for r in quality.records] == [(0.0, 50.0), (53.0, 99.9)]
    assert quality.sensors[0].dropped["held_copy"].count == 29
    assert "held_copies" in [f.code for f in quality.findings]
    rest = {"u_mps": np.full(1000, 1.5), "v_mps": np.zeros(1000)}  # no noise: nothing is stuck
    _, quality = ingest(changed(raw, "dvl", values=rest), vehicle())
    assert len(quality.records) == 1


def test_implausible_values_are_dropped_and_a_wrong_unit_is_refused():
    raw = calm()
    v = raw.sensors["dvl"].values["v_mps"].copy()
    v[[20, 21]] = 400.0
    dvl = raw.sensors["dvl"].values | {"v_mps": v}
    _, quality = ingest(changed(raw, "dvl", values=dvl), vehicle())
    (channel,) = [c for s in quality.sensors for c in s.channels if c.column == "v_mps"]
    assert channel.dropped["implausible"].count == 2
    rudder = raw.sensors["rudder"].values["rudder_rad"] * 300  # degrees in a _rad column
    with pytest.raises(InputError) as caught:
        ingest(changed(raw, "rudder", values={"rudder_rad": rudder}), vehicle())
    for word in ("rudder.csv", "rudder_rad", "degrees in a _rad column"):
        assert word in str(caught.value)


def test_counts_of_a_servo_that_a_map_calls_degrees_are_told_with_scale_and_offset():
    """It was told to be degrees in a _rad column, which there is not."""
    raw = calm()
    counts = np.deg2rad(2048.0 + 11.4 * np.rad2deg(raw.sensors["rudder"].values["rudder_rad"]))
    named = {"rudder_rad": "servo_counts"}
    with pytest.raises(InputError) as caught:
        ingest(changed(raw, "rudder", values={"rudder_rad": counts}, columns=named), vehicle())
    told = str(caught.value)
    assert "or another quantity (counts" in told and "degrees)" in told
    offered = "\n".join(re.findall(r"^    (.*)", told, re.MULTILINE))
    assert tomllib.loads(offered) == {
        "rudder": {"rudder": {"column": "servo_counts", "unit": "deg"}}
    }
    assert "add scale and offset to that line" in told
    assert "_rad column" not in told


def test_nan_only_channel_is_refused():
    raw = calm()
    nothing = np.full(200, np.nan)
    with pytest.raises(InputError) as caught:
        ingest(changed(raw, "gyro", values={"r_radps": nothing}), vehicle())
    assert caught.value.exit_code == 3
    for word in ("gyro.csv", "r_radps", "no usable sample"):
        assert word in str(caught.value)


def test_heading_is_unwrapped_before_it_is_resampled():
    raw = maneuvers(noise=0.0)
    trial, _ = ingest(raw, vehicle())
    heading = trial.table["heading_rad"].to_numpy()
    assert np.abs(np.diff(heading)).max() < 0.1
    shift = changed(
        raw,
        "attitude",
        values={
            "heading_rad": np.mod(raw.sensors["attitude"].values["heading_rad"] + 3.0, 2 * np.pi)
        },
    )
    other, _ = ingest(shift, vehicle())
    turned = other.table["heading_rad"].to_numpy() - heading
    np.testing.assert_allclose(turned - turned[0], 0.0, atol=1e-9)


def test_empty_cells_of_one_channel_leave_the_other():
    raw = calm()
    u = raw.sensors["dvl"].values["u_mps"].copy()
    u[50] = np.nan
    values = raw.sensors["dvl"].values | {"u_mps": u}
    trial, quality = ingest(changed(raw, "dvl", values=values), vehicle())
    assert np.isfinite(trial.table["u_mps"]).all()
    assert trial.table["v_mps"][50] == raw.sensors["dvl"].values["v_mps"][50]
    assert not trial.table["dvl_sampled"][50]
    (u_quality, v_quality) = quality.sensors[0].channels
    assert u_quality.dropped["empty"].count == 1
    assert v_quality.dropped == {}


def test_signs_of_the_controls_become_internal():
    raw = calm()
    port, _ = ingest(raw, vehicle())
    starboard, _ = ingest(raw, vehicle(signs={"rudder_positive_turns": "starboard"}))
    np.testing.assert_array_equal(port.table["rudder_rad"], -starboard.table["rudder_rad"])
    logged = raw.sensors["rudder"].values["rudder_rad"]
    np.testing.assert_array_equal(port.table["rudder_rad"], logged[: len(port.table)])


def test_missing_channel_is_refused():
    raw = calm()
    with pytest.raises(InputError, match="no rpm"):
        ingest(
            replace(raw, sensors={k: s for k, s in raw.sensors.items() if k != "rpm"}), vehicle()
        )


def test_rows_that_are_all_hours_apart_tell_of_their_unit():
    with pytest.raises(InputError, match="time jumps") as caught:
        ordered(1e6 * TICKS)
    assert 'time_unit = "us"' in str(caught.value)
    apart = np.where(TICKS < 5.0, TICKS, TICKS + 1e6)
    with pytest.raises(InputError, match="Split the log there"):
        ordered(apart)
