"""What no vehicle does and no sensor measures goes, is counted by reason, and nothing else goes."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from auvident.errors import InputError
from auvident.schema.channels import BY_COLUMN, NEEDED
from auvident.schema.logs import DEG, RawTrial
from auvident.schema.vehicle import Vehicle
from auvident.stages.ingest import ingest
from auvident.stages.ingest.clean import CleanSensor, clean_sensor, clean_trial
from auvident.stages.ingest.fill_values import find_fills
from auvident.stages.ingest.pace import Pace, pace_of
from auvident.storage.logs import read_trials
from auvident.storage.vehicle_file import load_vehicle

SAMPLES = Path(__file__).parents[2] / "sample_logs"
TRIALS = {"harbour_trial": "remus100", "bay_trial": "tern180", "dive_trial": "remus100"}
REASONS = {"fill_value", "overflow", "saturated", "stuck", "spike"}
Plant = Callable[[np.ndarray, np.ndarray, np.random.Generator], np.ndarray]


@cache
def logged(name: str) -> tuple[RawTrial, Vehicle]:
    (raw,) = read_trials([SAMPLES / name])
    return raw, load_vehicle(SAMPLES / f"{TRIALS[name]}.toml")


def kept(sensors: dict[str, CleanSensor]) -> dict[str, np.ndarray]:
    """Rows of the log of which a sample is left, by channel."""
    return {
        c: sensor.raw.rows[np.isin(sensor.raw.time_s, s.time_s)]
        for sensor in sensors.values()
        for c, s in sensor.series.items()
    }


@cache
def kept_as_logged(name: str) -> dict[str, np.ndarray]:
    raw, vehicle = logged(name)
    return kept(clean_trial(raw, vehicle, NEEDED))


def reasons(sensors: dict[str, CleanSensor], column: str) -> dict[str, int]:
    found = [s.series[column].dropped for s in sensors.values() if column in s.series]
    return {why: d.count for why, d in found[0].items()}


def with_values(raw: RawTrial, changed: dict[str, np.ndarray]) -> RawTrial:
    sensors = {
        name: replace(s, values={c: changed.get(c, x) for c, x in s.values.items()})
        for name, s in raw.sensors.items()
    }
    return replace(raw, sensors=sensors)


def under_way(raw: RawTrial, time: np.ndarray) -> np.ndarray:
    dvl = raw.sensors["dvl"]
    known = np.isfinite(dvl.values["u_mps"])
    return np.interp(time, dvl.time_s[known], dvl.values["u_mps"][known]) > 0.8


def runs_in(where: np.ndarray, share: float, rows: int, rng: np.random.Generator) -> np.ndarray:
    """Runs of so many rows that begin in some places, until they are a share of all."""
    chosen = np.zeros(where.size, dtype=bool)
    while chosen.sum() < share * where.size:
        first = rng.choice(np.flatnonzero(where))
        chosen[first : first + rows] = True
    return chosen


def spread_spikes(size: float) -> Plant:
    def plant(x: np.ndarray, bad: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        off = rng.choice([-1.0, 1.0], x.size) * rng.uniform(0.6, 1.0, x.size) * size
        return np.where(bad, x + off, x)

    return plant


def number(value: float) -> Plant:
    return lambda x, bad, rng: np.where(bad, value, x)


# columns, share of the rows, rows in a run, what is written, reason, share that has to go
PLANTED = {
    "zeros of a lost bottom": (("u_mps", "v_mps"), 0.03, 1, number(0.0), "fill_value", 0.99),
    "zeros in a fifth of the rows": (("u_mps", "v_mps"), 0.2, 1, number(0.0), "fill_value", 0.95),
    "zeros in long runs": (("u_mps", "v_mps"), 0.03, 20, number(0.0), "fill_value", 0.97),
    "overflow of two bytes": (("u_mps",), 0.01, 3, number(-32.768), "fill_value", 1.0),
    "minus 9.999": (("u_mps",), 0.01, 2, number(-9.999), "fill_value", 1.0),
    "largest float": (("u_mps",), 0.01, 2, number(1.79e308), "fill_value", 1.0),
    "overflow of the gyro": (("r_radps",), 0.01, 2, number(-32.768 * DEG), "fill_value", 1.0),
    "heading of 9999": (("heading_rad",), 0.01, 2, number(9999 * DEG), "fill_value", 1.0),
    "depth of zero": (("depth_m",), 0.02, 3, number(0.0), "fill_value", 0.85),
    "one spike in ten": (("u_mps", "v_mps"), 0.1, 1, spread_spikes(1.2), "spike", 0.9),
    "bursts of four": (("u_mps", "v_mps"), 0.03, 4, spread_spikes(1.2), "spike", 0.9),
    "bursts of the gyro": (("r_radps",), 0.03, 4, spread_spikes(0.5), "spike", 0.94),
}


@pytest.mark.parametrize("name", TRIALS)
def test_nothing_goes_from_a_log_without_such_flaws(name):
    raw, vehicle = logged(name)
    sensors = clean_trial(raw, vehicle, NEEDED)
    for column in kept(sensors):
        assert not REASONS & set(reasons(sensors, column)), column


@pytest.mark.parametrize("kind", PLANTED)
@pytest.mark.parametrize("name", ["harbour_trial", "bay_trial"])
def test_what_is_planted_goes_and_the_rest_stays(name, kind):
    columns, share, rows, plant, reason, power = PLANTED[kind]
    raw, vehicle = logged(name)
    (sensor,) = (s for s in raw.sensors.values() if columns[0] in s.values)
    rng = np.random.default_rng(5)
    bad = runs_in(under_way(raw, sensor.time_s), share, rows, rng)
    values = {c: plant(sensor.values[c], bad, rng) for c in columns}
    sensors = clean_trial(with_values(raw, values), vehicle, NEEDED)
    left, before = kept(sensors), kept_as_logged(name)
    planted = sensor.rows[bad]
    for column in columns:
        assert reason in reasons(sensors, column)
        assert np.isin(planted, left[column]).mean() <= 1.0 - power + 1e-9
    for column, good in before.items():
        good = np.setdiff1d(good, planted) if column in sensor.values else good
        stays = 0.99 if reason == "spike" and column in columns else 0.999  # good beside wild ones
        assert np.isin(good, left[column]).mean() >= stays, column


@pytest.mark.parametrize("name", ["harbour_trial", "dive_trial"])
def test_zeros_in_all_columns_are_no_copies_of_each_other(name):
    raw, vehicle = logged(name)
    dvl, rng = raw.sensors["dvl"], np.random.default_rng(4)
    bad = runs_in(under_way(raw, dvl.time_s), 0.03, 16, rng)
    zeros = {c: np.where(bad, 0.0, x) for c, x in dvl.values.items()}
    sensors = clean_trial(with_values(raw, zeros), vehicle, NEEDED)
    left, before = kept(sensors), kept_as_logged(name)
    for column in zeros:
        assert reasons(sensors, column)["fill_value"] >= 0.98 * bad.sum()
        assert np.isin(dvl.rows[bad], left[column]).mean() <= 0.02
        assert np.isin(np.setdiff1d(before[column], dvl.rows[bad]), left[column]).mean() >= 0.999


def clipped(raw: RawTrial, column: str, share: float) -> tuple[RawTrial, np.ndarray]:
    """A trial with one channel cut off above a quantile of it; True where it was beyond."""
    (x,) = (s.values[column] for s in raw.sensors.values() if column in s.values)
    level = np.nanquantile(np.abs(x), share)
    return with_values(raw, {column: np.clip(x, -level, level)}), np.abs(x) >= level


@pytest.mark.parametrize(
    ("name", "column"),
    [("harbour_trial", "r_radps"), ("bay_trial", "v_mps"), ("dive_trial", "q_radps")],
)
def test_a_sensor_at_the_end_of_its_range_measures_nothing(name, column):
    raw, vehicle = logged(name)
    cut, beyond = clipped(raw, column, 0.9)
    sensors = clean_trial(cut, vehicle, NEEDED)
    (sensor,) = (s for s in sensors.values() if column in s.raw.values)
    usable = np.isin(sensor.raw.rows, kept_as_logged(name)[column])
    left = np.isin(sensor.raw.time_s, sensor.series[column].time_s)
    assert not (left & beyond).any()
    assert (left & usable & ~beyond).sum() >= 0.999 * (usable & ~beyond).sum()
    assert reasons(sensors, column)["saturated"] >= (beyond & usable).sum()


@pytest.mark.parametrize("share", [0.98, 0.7])
@pytest.mark.parametrize(
    ("name", "column"), [("harbour_trial", "r_radps"), ("bay_trial", "r_radps")]
)
def test_what_overflows_is_no_reading(name, column, share):
    """The range of a gyro is passed in the hardest turns alone, or in most of them."""
    raw, vehicle = logged(name)
    x = raw.sensors["gyro"].values[column]
    end = share * np.nanmax(np.abs(x))
    wrapped = with_values(raw, {column: (x + end) % (2.0 * end) - end})
    sensors = clean_trial(wrapped, vehicle, NEEDED)
    left, before = kept(sensors), kept_as_logged(name)
    beyond = raw.sensors["gyro"].rows[np.abs(x) > end]
    assert reasons(sensors, column)["overflow"] >= np.isin(beyond, before[column]).sum() > 0
    assert not np.isin(beyond, left[column]).any()
    assert np.isin(np.setdiff1d(before[column], beyond), left[column]).mean() >= 0.999


@pytest.mark.parametrize(
    ("name", "column"),
    [("harbour_trial", "v_mps"), ("bay_trial", "r_radps"), ("dive_trial", "u_mps")],
)
def test_one_stuck_column_is_a_gap_of_that_column(name, column):
    raw, vehicle = logged(name)
    (sensor,) = (s for s in raw.sensors.values() if column in s.values)
    x, t = sensor.values[column].copy(), sensor.time_s
    first = np.flatnonzero(under_way(raw, t) & np.isfinite(x) & (t > t[0] + 300.0))[0]
    stuck = (t > t[first]) & (t < t[first] + 40.0)
    x[stuck] = x[first]
    sensors = clean_trial(with_values(raw, {column: x}), vehicle, NEEDED)
    left, before = kept(sensors), kept_as_logged(name)
    assert reasons(sensors, column)["stuck"] == pytest.approx(stuck.sum(), abs=0.02 * stuck.sum())
    assert not np.isin(sensor.rows[stuck], left[column]).any()
    for other, good in before.items():
        good = np.setdiff1d(good, sensor.rows[stuck]) if other == column else good
        assert np.isin(good, left[other]).all(), other


def test_a_command_that_is_held_is_not_stuck_but_a_measured_fin_may_be():
    raw, vehicle = logged("harbour_trial")
    rudder, rng = raw.sensors["rudder"], np.random.default_rng(3)
    measured = rudder.values["rudder_rad"] + 0.1 * DEG * rng.normal(size=rudder.time_s.size)
    sensors = clean_trial(with_values(raw, {"rudder_rad": measured}), vehicle, NEEDED)
    assert not REASONS & set(reasons(sensors, "rudder_rad"))
    measured[4000:4800] = measured[4000]
    sensors = clean_trial(with_values(raw, {"rudder_rad": measured}), vehicle, NEEDED)
    assert reasons(sensors, "rudder_rad")["stuck"] == 799


@pytest.mark.parametrize(("name", "digits"), [("harbour_trial", 1), ("bay_trial", 2)])
def test_coarse_and_smoothed_channels_are_left_alone(name, digits):
    raw, vehicle = logged(name)
    coarse = {
        c: np.round(x, digits)
        for s in raw.sensors.values()
        for c, x in s.values.items()
        if c.endswith(("_mps", "_radps"))
    }
    width = 15
    smooth = {c: np.round(np.convolve(x, np.ones(width) / width, "same"), 4)
              for c, x in coarse.items() if c.endswith("_radps")}  # fmt: skip
    for values in (coarse, smooth):
        sensors = clean_trial(with_values(raw, values), vehicle, NEEDED)
        for column in kept(sensors):
            assert not {"saturated", "stuck", "spike"} & set(reasons(sensors, column)), column


@pytest.mark.parametrize("name", ["bay_trial"])
def test_a_propeller_that_stands_still_for_a_row_is_a_drop_out(name):
    raw, vehicle = logged(name)
    rpm = raw.sensors["rpm"].values["rpm"].copy()
    running = np.convolve(rpm > 300.0, np.ones(3), "same") == 3
    bad = np.random.default_rng(1).choice(np.flatnonzero(running), 20, replace=False)
    rpm[bad] = 0.0
    sensors = clean_trial(with_values(raw, {"rpm": rpm}), vehicle, NEEDED)
    assert reasons(sensors, "rpm")["fill_value"] >= 18  # two side by side are no single row
    rpm = raw.sensors["rpm"].values["rpm"].copy()
    rpm[3000:3050] = 0.0  # 5 s: a stop
    sensors = clean_trial(with_values(raw, {"rpm": rpm}), vehicle, NEEDED)
    assert "fill_value" not in reasons(sensors, "rpm")


@pytest.mark.parametrize("written", [-9999.0, -999.0, 9999.0])
@pytest.mark.parametrize(("first", "rows"), [((3000, 5000, 7000, 9000), 1), ((3000,), 300)])
@pytest.mark.parametrize("name", ["harbour_trial", "bay_trial"])
def test_a_propeller_rate_that_loggers_write_for_none_is_no_rate(name, first, rows, written):
    """Single rows and half a minute of them."""
    raw, vehicle = logged(name)
    rpm = raw.sensors["rpm"].values["rpm"].copy()
    bad = np.add.outer(first, np.arange(rows)).ravel()
    rpm[bad] = written
    sensors = clean_trial(with_values(raw, {"rpm": rpm}), vehicle, NEEDED)
    left, numbers = kept(sensors)["rpm"], raw.sensors["rpm"].rows
    before = np.setdiff1d(kept_as_logged(name)["rpm"], numbers[bad])
    assert "fill_value" in reasons(sensors, "rpm")
    np.testing.assert_array_equal(left, before)


def test_a_propeller_that_turns_astern_at_999_or_counts_in_decimals_turns():
    raw, vehicle = logged("bay_trial")
    rpm = raw.sensors["rpm"].values["rpm"]
    astern, little = rpm.copy(), rpm.copy()
    astern[3000:3200], astern[5000:5050] = -999.0, -400.0
    little[3000:3200] = -0.999
    for turning in (astern, little):
        sensors = clean_trial(with_values(raw, {"rpm": turning}), vehicle, NEEDED)
        assert "fill_value" not in reasons(sensors, "rpm")


@pytest.mark.parametrize("name", ["harbour_trial", "bay_trial"])
def test_a_fin_that_is_at_no_fin_angle_for_a_row_has_spikes(name):
    raw, vehicle = logged(name)
    rudder = raw.sensors["rudder"]
    angle, rng = rudder.values["rudder_rad"].copy(), np.random.default_rng(1)
    bad = rng.choice(angle.size // 3, angle.size // 100, replace=False) * 3 + 1
    angle[bad] += 6.0 * np.nanstd(angle) * rng.choice([-1.0, 1.0], bad.size)
    usual = np.nanmax(np.abs(rudder.values["rudder_rad"]))
    far = np.count_nonzero(np.abs(angle[bad]) > 1.3 * usual)
    sensors = clean_trial(with_values(raw, {"rudder_rad": angle}), vehicle, NEEDED)
    assert reasons(sensors, "rudder_rad")["spike"] >= 0.97 * far  # one may stand in a step
    assert far >= 0.6 * bad.size
    good = np.setdiff1d(kept_as_logged(name)["rudder_rad"], rudder.rows[bad])
    assert np.isin(good, kept(sensors)["rudder_rad"]).all()


@pytest.mark.parametrize("name", ["harbour_trial", "bay_trial"])
def test_commands_that_are_given_and_taken_back_are_no_spikes(name):
    raw, vehicle = logged(name)
    angle = raw.sensors["rudder"].values["rudder_rad"].copy()
    most = np.nanmax(np.abs(angle))
    inside, few = angle.copy(), angle.copy()
    inside[300:2000:40] = most  # pulses within the range that it has otherwise
    few[300:2000:300] = 2.0 * most  # beyond it, but few
    for pulses in (inside, few):
        sensors = clean_trial(with_values(raw, {"rudder_rad": pulses}), vehicle, NEEDED)
        assert "spike" not in reasons(sensors, "rudder_rad")


@pytest.mark.parametrize("turned", [False, True])
def test_a_spike_while_at_rest_makes_no_fill_values_of_its_zeros(turned):
    t = np.arange(0.0, 400.0, 0.2)
    u = np.round(np.clip((t - 60.0) * 0.05, 0.0, 1.2), 1)  # at rest for a minute, coarse digits
    u[100] = 0.9
    u = u[::-1] if turned else u
    pace = Pace(length_m=1.5, speed_mps=1.2)
    assert not find_fills(t, u, BY_COLUMN["u_mps"], pace).any()
    lost = u.copy()
    lost[1000:1010] = lost[1200:1210] = 0.0
    assert find_fills(t, lost, BY_COLUMN["u_mps"], pace)[1000:1010].all()


def held_fixes(raw: RawTrial, rate_hz: float, digits: int) -> RawTrial:
    """The trial with each fix copied into the rows of a faster log until the next."""
    fixes = raw.sensors["position"]
    time = np.arange(fixes.time_s.min(), fixes.time_s.max(), 1.0 / rate_hz)
    last = np.searchsorted(np.maximum.accumulate(fixes.time_s), time, side="right") - 1
    values = {c: np.round(x[last], digits) for c, x in fixes.values.items()}
    held = replace(fixes, time_s=time, values=values, rows=np.arange(time.size) + 2)
    return replace(raw, sensors={**raw.sensors, "position": held})


@pytest.mark.parametrize("digits", [1, 2])
@pytest.mark.parametrize("rate_hz", [5.0, 10.0, 50.0])
@pytest.mark.parametrize("name", TRIALS)
def test_a_place_to_which_the_vehicle_returns_is_none_of_no_value(name, rate_hz, digits):
    """Copies are no recurrence: 121 rows of 1 Hz fixes at 10 Hz went, each of two of them alike."""
    raw, vehicle = logged(name)
    sensors = clean_trial(held_fixes(raw, rate_hz, digits), vehicle, NEEDED)
    for column in ("north_m", "east_m"):
        assert not REASONS & set(reasons(sensors, column)), column


@pytest.mark.parametrize("written", [0.0, -9999.0, 1234.5])
def test_a_fix_that_stands_for_none_is_found_among_copies(written):
    raw, vehicle = logged("bay_trial")
    north = raw.sensors["position"].values["north_m"].copy()
    north[[200, 400, 600, 800]] = written
    held = held_fixes(with_values(raw, {"north_m": north}), 10.0, 2)
    planted = np.count_nonzero(held.sensors["position"].values["north_m"] == written)
    sensors = clean_trial(held, vehicle, NEEDED)
    assert reasons(sensors, "north_m")["fill_value"] == planted >= 39
    assert "fill_value" not in reasons(sensors, "east_m")


def test_ticks_are_those_of_any_channel_and_no_copy_where_that_is_all_of_them():
    raw, vehicle = logged("bay_trial")
    gyro, dvl = raw.sensors["gyro"], raw.sensors["dvl"]
    time, size = dvl.time_s[:500], {"time_s": dvl.time_s[:500], "rows": dvl.rows[:500]}
    u, v = 1.0 + 0.1 * np.sin(time), 0.1 * np.cos(time)
    u[100], v[200] = np.nan, np.nan
    pace = pace_of({"gyro": gyro}, vehicle)
    found = clean_sensor(replace(dvl, values={"u_mps": u, "v_mps": v}, **size), vehicle, pace)
    assert found.time_s is found.raw.time_s
    v[100] = np.nan
    found = clean_sensor(replace(dvl, values={"u_mps": u, "v_mps": v}, **size), vehicle, pace)
    np.testing.assert_array_equal(found.time_s, np.delete(time, 100))


def test_what_was_left_out_is_told_with_its_first_row():
    raw, vehicle = logged("harbour_trial")
    cut, _ = clipped(raw, "r_radps", 0.8)
    _, quality = ingest(cut, vehicle)
    (found,) = [f for f in quality.findings if f.code == "saturated"]
    (channel,) = [c for s in quality.sensors for c in s.channels if c.column == "r_radps"]
    dropped = channel.dropped["saturated"]
    assert f"{dropped.count} samples of r_degps" in found.message
    assert f"row {dropped.first_rows[0]}" in found.message
    assert found.remedy
    assert len(dropped.first_times_s) == len(dropped.first_rows) == 5


def test_a_channel_that_lost_a_third_says_so_first():
    raw, vehicle = logged("harbour_trial")
    rng = np.random.default_rng(2)
    u = raw.sensors["dvl"].values["u_mps"]
    fast = under_way(raw, raw.sensors["dvl"].time_s)
    lost = runs_in(fast, 0.4, 7, rng) & fast
    _, quality = ingest(with_values(raw, {"u_mps": np.where(lost, 0.0, u)}), vehicle)
    assert quality.findings[0].code == "much_left_out"
    assert "fill_value" in quality.findings[0].message
    lost = runs_in(fast, 0.75, 7, rng) & fast
    with pytest.raises(InputError) as caught:
        ingest(with_values(raw, {"u_mps": np.where(lost, 0.0, u)}), vehicle)
    assert caught.value.exit_code == 3
    for word in ("u_mps", "are left", "fill_value", "dvl.csv", "row"):
        assert word in str(caught.value)
