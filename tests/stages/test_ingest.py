"""The ingest stage as a whole: one clock, records, quality, signs and clocks of the sensors."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ingest_world import LENGTH_M, calm, changed, maneuvers, sensor, trial, vehicle, with_sensor

from auvident.constants import BRIDGED_S
from auvident.errors import InputError, UsageError
from auvident.schema.channels import BY_COLUMN, CHANNELS
from auvident.schema.logs import Quality, RawTrial
from auvident.stages.ingest import ingest
from tests.processor_time import least_of_three


def codes(quality):
    return [finding.code for finding in quality.findings]


def moved(raw: RawTrial, name: str, seconds: float) -> RawTrial:
    return changed(raw, name, time_s=raw.sensors[name].time_s + seconds)


def test_the_table_of_a_plain_trial():
    raw = calm()
    result, quality = ingest(raw, vehicle())
    table = result.table
    assert list(table.columns) == [
        "time_s",
        "u_mps",
        "v_mps",
        "r_radps",
        "rudder_rad",
        "rpm",
        "dvl_sampled",
        "gyro_sampled",
        "rudder_sampled",
        "rpm_sampled",
        "record",
    ]
    np.testing.assert_array_equal(table["time_s"], np.arange(200) / 10)
    np.testing.assert_array_equal(table["u_mps"], raw.sensors["dvl"].values["u_mps"])
    assert table["dvl_sampled"].dtype == bool
    assert (table["record"] == 0).all()
    assert quality.records[0].samples == 200
    assert quality.t_end_s == 19.9


def test_quality_is_finite_json_and_reads_back():
    _, quality = ingest(maneuvers(duration_s=60), vehicle())
    whole = Quality(vehicle="x", rate_hz=10.0, trials=(quality,))
    text = whole.model_dump_json(by_alias=True)
    json.loads(text, parse_constant=lambda word: pytest.fail(word))
    assert Quality.model_validate_json(text) == whole
    (dvl,) = [s for s in quality.sensors if s.sensor == "dvl"]
    assert dvl.rate_hz == pytest.approx(5.0)
    assert dvl.channels[0].interpolated_share == pytest.approx(0.5, abs=0.02)
    assert dvl.channels[1].noise_std == pytest.approx(0.005, rel=0.25)  # 300 samples: 8 %


def test_absent_channels_are_stated():
    _, quality = ingest(calm(), vehicle())
    present = {"u_mps", "v_mps", "r_radps", "rudder_rad", "rpm"}
    assert set(quality.absent) == {c.column for c in CHANNELS} - present
    assert "channels_absent" in codes(quality)


@settings(max_examples=10, deadline=None)
@given(order=st.permutations(["dvl", "gyro", "rudder", "rpm", "attitude"]))
def test_order_of_sensors_does_not_matter(order):
    raw = maneuvers(duration_s=30)
    shuffled = trial(*(raw.sensors[name] for name in order))
    first, second = ingest(raw, vehicle())[0], ingest(shuffled, vehicle())[0]
    assert first.table.equals(second.table)


@pytest.mark.parametrize("origin", [0.0, -50.0, 12345.6, 1.7e9])
def test_origin_of_the_time_does_not_matter(origin):
    raw = maneuvers(duration_s=30)
    other = replace(
        raw, sensors={k: replace(s, time_s=s.time_s + origin) for k, s in raw.sensors.items()}
    )
    first, second = ingest(raw, vehicle())[0].table, ingest(other, vehicle())[0].table
    np.testing.assert_allclose(second["time_s"] - origin, first["time_s"], atol=1e-6)
    # stamps of 1.7e9 s resolve 0.24 us, in which the channels here change by less than 1e-6
    for column in ("u_mps", "v_mps", "r_radps", "rudder_rad"):
        np.testing.assert_allclose(second[column], first[column], atol=3e-6)


def test_only_the_overlap_is_used_and_late_sensors_are_named():
    raw = moved(calm(duration_s=60), "gyro", 12.03)
    result, quality = ingest(raw, vehicle())
    assert result.table["time_s"].iloc[0] == 12.1  # a round tick
    assert result.table["time_s"].iloc[-1] == 59.9
    late = [f for f in quality.findings if f.code == "sensor_starts_late"]
    assert [f.where for f in late] == ["gyro.csv"]
    assert late[0].value == pytest.approx(12.03)
    assert late[0].threshold == 10.0


@pytest.mark.parametrize("seconds", [60.0, -60.0])
def test_a_sensor_that_starts_and_stops_off_all_others_has_another_clock(seconds):
    raw = moved(calm(duration_s=300), "gyro", seconds)
    _, quality = ingest(raw, vehicle())
    (found,) = [f for f in quality.findings if f.code == "sensor_shifted"]
    assert found.where == "gyro.csv" and found.value == pytest.approx(seconds, abs=1.0)
    assert f"time_offset_s = {-seconds:.1f}" in found.remedy
    for shorter in (moved(calm(duration_s=300), "gyro", 12.0), calm(duration_s=300)):
        _, quality = ingest(shorter, vehicle())
        assert "sensor_shifted" not in {f.code for f in quality.findings}


def test_sensors_that_never_overlap_are_refused():
    with pytest.raises(InputError) as caught:
        ingest(moved(calm(), "rpm", 500.0), vehicle())
    assert caught.value.exit_code == 3
    for word in (
        "never overlap",
        "rpm.csv 500.000 to 519.900 s",
        "dvl.csv 0.000 to 19.900 s",
        "time_offset_s",
    ):
        assert word in str(caught.value)


def test_an_optional_sensor_outside_the_trial_is_named_and_left_out():
    depth = sensor("depth", np.arange(500.0, 520.0), depth_m=np.full(20, 3.0))
    result, quality = ingest(with_sensor(calm(), depth), vehicle())
    assert "depth_m" not in result.table
    assert "depth_m" in quality.absent
    (found,) = [f for f in quality.findings if f.code == "channel_unusable"]
    assert found.where == "depth.csv"


def test_gaps_split_the_record():
    raw = calm(duration_s=40)
    dvl = raw.sensors["dvl"]
    keep = ~((dvl.time_s > 10.05) & (dvl.time_s < 16.95)) & ~(abs(dvl.time_s - 30.0) < 0.25)
    cut = replace(
        dvl,
        time_s=dvl.time_s[keep],
        rows=dvl.rows[keep],
        values={c: x[keep] for c, x in dvl.values.items()},
    )
    result, quality = ingest(with_sensor(raw, cut), vehicle())
    table = result.table
    assert [r.record for r in quality.records] == [0, 1]
    assert quality.records[0].t_end_s == 10.0
    assert quality.records[1].t_start_s == 17.0
    inside = (table["time_s"] > 10.05) & (table["time_s"] < 16.95)
    assert (table["record"][inside] == -1).all()
    assert table["u_mps"][inside].isna().all()
    assert table["r_radps"].notna().all()
    bridged = (table["time_s"] > 29.75) & (table["time_s"] < 30.25)
    assert table["u_mps"][bridged].notna().all()
    assert not table["dvl_sampled"][bridged].any()
    (channel, _) = quality.sensors[0].channels
    assert (channel.gaps, channel.gap_limit_s) == (1, BRIDGED_S)
    assert channel.longest_gap_s == pytest.approx(7.0)


def test_commands_written_on_change_are_held_and_this_is_said():
    raw = calm(duration_s=60)
    rpm = sensor("rpm", [0.0], rpm=[1200.0])
    rudder = sensor(
        "rudder",
        [0.0, 10.0, 10.1, 10.2, 30.0, 30.1, 30.2, 55.0],
        rudder_rad=[0, 0.1, 0.2, 0.3, 0.2, 0.1, 0.0, 0.1],
    )
    result, quality = ingest(with_sensor(with_sensor(raw, rpm), rudder), vehicle())
    assert (result.table["rpm"] == 1200.0).all()
    assert result.table["rudder_rad"][250] == 0.3
    assert quality.t_end_s == 59.9
    held = [f for f in quality.findings if f.code == "input_logged_on_change"]
    assert len(held) == 2
    assert held[0].value == pytest.approx(24.8)


def test_steps_by_hand_that_are_taken_for_polled_are_said_with_the_remedy():
    raw = calm(duration_s=700)
    times = np.cumsum([1, 20, 60, 35, 80, 25, 45, 90, 30, 70, 40, 55, 28, 66])
    rpm = sensor("rpm", times.astype(float), rpm=np.resize([600.0, 1200.0, 900.0], times.size))
    _, quality = ingest(with_sensor(raw, rpm), vehicle())
    (said,) = [f for f in quality.findings if f.code == "input_seems_on_change"]
    assert "on_change = true in [rpm] of a map" in said.remedy
    assert not [f for f in quality.findings if f.code == "jitter"]
    told = with_sensor(raw, replace(rpm, on_change=True))
    codes = [f.code for f in ingest(told, vehicle())[1].findings]
    assert "input_seems_on_change" not in codes
    assert "input_logged_on_change" in codes


@pytest.mark.parametrize("kept_s", [1000.0, 10_000_000.0])
def test_stamps_that_a_spreadsheet_cut_are_told_so(kept_s):
    """Milliseconds since 1970 in six digits: they were put down to another unit or clock."""
    raw = calm()
    cut = {
        name: replace(s, time_s=1.7e9 + 900.0 + kept_s * np.floor(s.time_s / min(kept_s, 30.0)))
        for name, s in raw.sensors.items()
    }
    with pytest.raises(InputError) as caught:
        ingest(replace(raw, sensors=cut), vehicle())
    assert "with all digits of its times" in (caught.value.remedy or "")


def test_a_slow_clock_is_refused_with_the_likely_cause():
    raw = calm()
    with pytest.raises(InputError, match="milliseconds"):
        ingest(
            replace(
                raw, sensors={k: replace(s, time_s=s.time_s * 1e3) for k, s in raw.sensors.items()}
            ),
            vehicle(),
        )


@pytest.mark.parametrize("options", [{"rate_hz": 0}, {"rate_hz": np.nan}, {"max_gap_s": -1}])
def test_options_out_of_range(options):
    with pytest.raises(UsageError):
        ingest(calm(), vehicle(), **options)


# --- signs and clocks ---------------------------------------------------------------------


@pytest.mark.parametrize("duration", [50, 150])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_right_rudder_sign_is_accepted_and_the_wrong_one_refused(seed, duration):
    raw = maneuvers(seed, duration_s=duration)
    _, quality = ingest(raw, vehicle())
    assert quality.checks["rudder_sign"]["response_1pm2"] < 0
    assert "rudder_sign_unverified" not in codes(quality)
    with pytest.raises(InputError) as caught:
        ingest(raw, vehicle(signs={"rudder_positive_turns": "starboard"}))
    assert caught.value.exit_code == 3
    for word in (
        "contradicts [signs] rudder_positive_turns = 'starboard'",
        "rudder.csv",
        "rudder_rad",
        "standard deviations",
    ):
        assert word in str(caught.value)


def test_a_sign_that_the_vehicle_file_does_not_state_is_told_to_be_assumed():
    """The message quoted a key that the file does not have."""
    raw = maneuvers(1, duration_s=150)
    raw = changed(raw, "rudder", values={"rudder_rad": -raw.sensors["rudder"].values["rudder_rad"]})
    unsaid = "'port' (not stated in the vehicle file; port is assumed): a positive"
    for signs in ({}, {"signs": {}}, {"signs": {"elevator_positive_pitches": "down"}}):
        with pytest.raises(InputError) as caught:
            ingest(raw, vehicle(**signs))
        assert unsaid in caught.value.problem
    with pytest.raises(InputError) as caught:
        ingest(raw, vehicle(signs={"rudder_positive_turns": "port"}))
    assert "= 'port': a positive" in caught.value.problem


@pytest.mark.parametrize("moves", [False, True])
def test_rudder_sign_without_evidence_is_a_note(moves):
    rng = np.random.default_rng(4)
    raw = calm(duration_s=200)
    helm = 0.02 * rng.normal(size=2000) if moves else np.zeros(2000)  # nothing to do with r
    raw = changed(raw, "rudder", values={"rudder_rad": helm})
    for way in ("port", "starboard"):
        _, quality = ingest(raw, vehicle(signs={"rudder_positive_turns": way}))
        assert "rudder_sign_unverified" in codes(quality)
        assert ("rudder_never_moves" in codes(quality)) != moves


def test_a_helm_that_answers_to_waves_is_no_rudder_of_the_other_sign():
    """Waves turn the hull, the helm follows the yaw rate: positive correlation, yet right sign."""
    rng = np.random.default_rng(2)
    h, t = 0.05, np.arange(0, 300, 0.05)
    wave = 0.05 * np.sin(2 * np.pi * t / 5 + 2 * np.cumsum(rng.normal(0, 0.02, t.size)))
    r, helm = np.zeros(t.size), np.zeros(t.size)
    for k in range(t.size - 1):
        helm[k] = 0.5 * r[max(k - 6, 0)]
        r[k + 1] = r[k] + h * (-1.2 * r[k] - 1.0 * helm[k] + wave[k])
    raw = trial(
        sensor("dvl", t, u_mps=1.5 + 0.01 * np.sin(t), v_mps=-0.3 * r),
        sensor("gyro", t, r_radps=r),
        sensor("rudder", t, rudder_rad=helm),
        sensor("rpm", t, rpm=900.0 + 0 * t),
    )
    ingest(raw, vehicle())


@pytest.mark.parametrize(
    ("lag", "outcome"),
    # A hull unlike those of the population passes for L/U at most, here 1.3 s; 0.3 s is usual.
    [
        (-2.0, "contradicts"),
        (-0.8, "untested"),
        (0.0, "agrees"),
        (0.8, "untested"),
        (2.0, "contradicts"),
    ],
)
def test_lag_of_the_dvl_is_found(lag, outcome):
    _, quality = ingest(moved(maneuvers(), "dvl", lag), vehicle())
    (found,) = [a for a in quality.alignment if a.second == "dvl"]
    # The servo of 0.1 s and the smoothing blur the sway equation by about a grid step.
    assert found.lag_s == pytest.approx(lag, abs=0.15)
    assert ("dvl_lags_gyro" in codes(quality)) == (outcome == "contradicts")
    (check,) = [c for c in quality.checks_made if c.name == "clock_dvl"]
    assert check.outcome == outcome
    side = "late" if lag > 0.0 else "early"
    told = f"stamps of the dvl are {abs(found.lag_s):.2f} s {side}"
    assert (told in check.message) == (lag != 0.0)
    assert ("a hull that answers otherwise" in check.message) == (outcome == "untested")


@pytest.mark.parametrize("lag", [-0.5, 0.0, 0.27])
def test_lag_of_the_heading_is_found_below_the_step(lag):
    _, quality = ingest(moved(maneuvers(), "attitude", lag), vehicle())
    (found,) = [a for a in quality.alignment if a.second == "attitude"]
    assert found.lag_s == pytest.approx(lag, abs=max(0.01, 4 * found.std_s))
    assert found.std_s < 0.02


@pytest.mark.parametrize(("lag", "named"), [(-1.2, True), (-0.8, False), (1.0, True)])
def test_lag_of_the_gyro_behind_the_rudder_is_found(lag, named):
    _, quality = ingest(moved(maneuvers(), "rudder", -lag), vehicle())
    (found,) = [a for a in quality.alignment if a.first == "rudder"]
    assert found.lag_s == pytest.approx(lag + 0.1, abs=0.15)  # with the servo's 0.1 s
    assert ("gyro_lags_rudder" in codes(quality)) == named
    (check,) = [c for c in quality.checks_made if c.name == "clock_rudder"]
    told = f"stamps of the rudder are {abs(found.lag_s):.2f} s late"
    assert named or (check.outcome == "untested" and told in check.message)


@pytest.mark.parametrize(
    ("factor", "words"), [(-1.0, "opposite signs"), (np.degrees(1), "units"), (1.3, "")]
)
def test_heading_that_contradicts_the_gyro(factor, words):
    raw = maneuvers()
    heading = np.unwrap(raw.sensors["attitude"].values["heading_rad"]) * factor
    raw = changed(raw, "attitude", values={"heading_rad": heading})
    if words:
        with pytest.raises(InputError, match=words):
            ingest(raw, vehicle())
    else:
        assert "heading_gyro_gain" in codes(ingest(raw, vehicle())[1])


# --- units that look possible -------------------------------------------------------------


def scaled(raw: RawTrial, **factors: float) -> RawTrial:
    for column, factor in factors.items():
        own = raw.sensors[BY_COLUMN[column].sensor]
        values = own.values | {column: own.values[column] * factor}
        raw = changed(raw, own.sensor, values=values)
    return raw


@pytest.mark.parametrize(
    ("factors", "code"),
    [
        ({"rpm": 1 / 60}, "advance_ratio"),
        ({"rpm": 10.0}, "advance_ratio"),
        ({"rudder_rad": np.radians(1)}, "rudder_unit"),
        ({"r_radps": 6.0}, "yaw_rate_unit"),
        ({"r_radps": np.radians(1)}, "yaw_rate_unit"),
        ({"u_mps": -1.0}, "surge_sign"),
        ({"v_mps": -1.0}, "sway_sign"),
    ],
)
def test_units_and_signs_that_do_not_fit_each_other(factors, code):
    raw = maneuvers(duration_s=150)
    raw = trial(*(s for k, s in raw.sensors.items() if k != "attitude"))
    assert code not in codes(ingest(raw, vehicle())[1])
    _, quality = ingest(scaled(raw, **factors), vehicle())
    (found,) = [f for f in quality.findings if f.code == code]
    assert found.value is not None
    assert found.threshold is not None
    assert found.where == "trial run"


def test_speed_in_knots_shows_in_the_track():
    raw = maneuvers(duration_s=200)
    t = np.arange(0.0, 199.0, 1.0)
    fixes = sensor("position", t, north_m=1.5 * t, east_m=0.1 * np.sin(t))
    raw = with_sensor(calm(duration_s=200), fixes)
    assert "speed_position_ratio" not in codes(ingest(raw, vehicle())[1])
    _, quality = ingest(scaled(raw, u_mps=1 / 0.5144), vehicle())
    assert "speed_position_ratio" in codes(quality)


def test_stuck_sensor_and_coarse_stamps_are_noted():
    raw = calm(duration_s=60)
    values = raw.sensors["dvl"].values | {"v_mps": np.zeros(600)}
    raw = changed(raw, "dvl", values=values)
    raw = changed(raw, "gyro", time_s=np.floor(raw.sensors["gyro"].time_s * 5) / 5)
    _, quality = ingest(raw, vehicle())
    assert {"constant_channel", "coarse_time"} <= set(codes(quality))


@pytest.mark.parametrize(("steps", "found"), [(200, False), (20, True)])
def test_a_channel_of_few_digits_is_noted(steps, found):
    raw = maneuvers(duration_s=200)
    values = raw.sensors["gyro"].values
    step = np.ptp(values["r_radps"]) / steps
    coarse = values | {"r_radps": np.round(values["r_radps"] / step) * step}
    _, quality = ingest(changed(raw, "gyro", values=coarse), vehicle())
    told = [f for f in quality.findings if f.code == "coarse_channel"]
    assert bool(told) == found
    for finding in told:
        assert finding.value == pytest.approx(1 / steps, rel=0.1)
        assert "r_radps comes in steps" in finding.message


def test_a_jitter_that_no_motion_shows_is_no_finding():
    rng = np.random.default_rng(2)
    for period, jitter, found in ((0.01, 0.003, False), (0.1, 0.04, True)):
        t = np.arange(0.0, 60.0, period)
        stamps = np.sort(t + jitter * rng.standard_normal(t.size))
        gyro = sensor("gyro", stamps, r_radps=1e-3 * np.sin(t) + 1e-5 * rng.standard_normal(t.size))
        _, quality = ingest(with_sensor(calm(duration_s=60), gyro), vehicle())
        assert ("jitter" in codes(quality)) == found


def test_every_finding_says_where_and_all_numbers_are_finite():
    _, quality = ingest(moved(maneuvers(), "dvl", 0.8), vehicle())
    assert quality.findings
    for finding in quality.findings:
        assert finding.message
        assert finding.where
    assert LENGTH_M > 0


def test_twenty_five_minutes_with_a_fast_gyro_take_less_than_a_second():
    raw = maneuvers(duration_s=100)
    times = 15
    long = {}
    for name, s in raw.sensors.items():
        t = np.concatenate([s.time_s + 100.0 * k for k in range(times)])
        long[name] = replace(
            s,
            time_s=t,
            rows=np.arange(2, t.size + 2),
            rows_read=t.size,
            values={c: np.tile(x, times) for c, x in s.values.items()},
        )
    trial = replace(raw, sensors=long)
    result, _ = ingest(trial, vehicle())
    assert len(result.table) == pytest.approx(15_000, abs=20)
    assert least_of_three(lambda: ingest(trial, vehicle())) < 3.0  # takes 0.3 s
