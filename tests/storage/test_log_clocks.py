"""Time columns of Parquet logs: integer counts, instants, and counts of no known unit."""

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from log_world import wide_table
from pyarrow import parquet

from auvident.errors import InputError
from auvident.storage.log_inspect import inspect_log
from auvident.storage.logs import read_trials

START_NS = 1_714_557_600_123_456_789  # an instant with all nine digits
PER_SECOND = {"ns": 10**9, "us": 10**6, "ms": 10**3}


def stamps_ns() -> np.ndarray:
    """Ticks of the wide table with odd nanoseconds between them."""
    n = len(wide_table())
    return START_NS + np.arange(n) * 100_000_000 + np.arange(n) % 7


def write(path, column: pa.Array, name: str = "timestamp"):
    """The wide table with another time column."""
    table = pa.Table.from_pandas(wide_table().drop(columns="time_s"), preserve_index=False)
    parquet.write_table(table.append_column(name, column), path)
    return path


def times(path) -> tuple[np.ndarray, str]:
    (trial,) = read_trials([path])
    return trial.sensors["gyro"].time_s, trial.origin


@pytest.mark.parametrize("unit", ["ns", "us", "ms"])
@pytest.mark.parametrize("kind", [pa.int64(), pa.uint64()])
def test_integer_epochs_keep_every_digit(tmp_path, unit, kind):
    counts = stamps_ns() // (10**9 // PER_SECOND[unit])
    found, origin = times(write(tmp_path / "run.parquet", pa.array(counts, kind)))
    assert origin == "2024-05-01T10:00:00Z"
    whole = START_NS // 10**9 * PER_SECOND[unit]
    np.testing.assert_array_equal(found, (counts - whole) / PER_SECOND[unit])


@pytest.mark.parametrize("zone", [None, "UTC", "Europe/Berlin"])
@pytest.mark.parametrize("unit", ["ns", "us", "ms"])
def test_arrow_instants_keep_every_digit(tmp_path, unit, zone):
    counts = stamps_ns() // (10**9 // PER_SECOND[unit])
    column = pa.array(counts, pa.int64()).cast(pa.timestamp(unit, zone))
    found, origin = times(write(tmp_path / "run.parquet", column))
    assert origin == "2024-05-01T10:00:00Z"
    whole = START_NS // 10**9 * PER_SECOND[unit]
    np.testing.assert_array_equal(found, (counts - whole) / PER_SECOND[unit])


@pytest.mark.parametrize("kind", [pa.int64(), pa.timestamp("ns"), pa.timestamp("ns", "UTC")])
def test_rows_without_a_stamp_are_counted(tmp_path, kind):
    stamps = [None if k in (5, 6) else int(t) for k, t in enumerate(stamps_ns())]
    column = pa.array(stamps, pa.int64()).cast(kind)
    (trial,) = read_trials([write(tmp_path / "run.parquet", column)])
    gyro = trial.sensors["gyro"]
    assert gyro.dropped == {"no_time": 2}
    assert gyro.dropped_rows == {"no_time": (6, 7)}
    kept = np.delete(stamps_ns(), (5, 6))
    np.testing.assert_array_equal(gyro.time_s, (kept - START_NS // 10**9 * 10**9) / 1e9)


def test_sensors_of_one_trial_share_the_origin_to_the_nanosecond(tmp_path):
    folder = tmp_path / "run"
    folder.mkdir()
    later = 3_000_000_001  # the DVL starts so many nanoseconds after the others
    for sensor, columns in (
        ("dvl", ["u_mps", "v_mps"]),
        ("gyro", ["r_radps"]),
        ("rudder", ["rudder_deg"]),
        ("rpm", ["rpm"]),
    ):
        shift = later if sensor == "dvl" else 0
        table = wide_table()[columns].assign(timestamp=stamps_ns() + shift)
        table.to_parquet(folder / f"{sensor}.parquet")
    (trial,) = read_trials([folder])
    ahead = trial.sensors["dvl"].time_s - trial.sensors["gyro"].time_s
    np.testing.assert_allclose(ahead, later / 1e9, rtol=0, atol=1e-12)


def test_a_named_unit_holds_for_counts_since_switch_on(tmp_path):
    counts = pa.array(np.arange(len(wide_table())) * 100_000 + 7_000_000_000_000_000, pa.int64())
    found, origin = times(write(tmp_path / "run.parquet", counts, "time_us"))
    np.testing.assert_allclose(np.diff(found), 0.1, rtol=1e-6)
    assert origin.startswith("2191-")


@pytest.mark.parametrize("first", [0, 123_456_789, 7_200_000_000])
def test_counts_of_no_plain_unit_are_refused(tmp_path, first):
    """Microseconds since switch-on, as autopilots log them, are neither seconds nor an epoch."""
    counts = pa.array(np.arange(len(wide_table())) * 100_000 + first, pa.int64())
    path = write(tmp_path / "run.parquet", counts)
    with pytest.raises(InputError) as caught:
        read_trials([path])
    assert caught.value.exit_code == 3
    for word in (str(path), "column timestamp", "time_us", "time_unit"):
        assert word in str(caught.value)


def test_whole_seconds_are_seconds(tmp_path):
    counts = pa.array(np.arange(len(wide_table())) + 1_714_557_600, pa.int64())
    found, origin = times(write(tmp_path / "run.parquet", counts))
    np.testing.assert_array_equal(found, np.arange(len(wide_table())))
    assert origin == "2024-05-01T10:00:00Z"


def test_large_integers_in_a_channel_are_numbers(tmp_path):
    table = wide_table().astype({"rpm": "int64"})
    table.loc[3, "rpm"] = 2**60 + 1
    table.to_parquet(tmp_path / "run.parquet")
    (trial,) = read_trials([tmp_path / "run.parquet"])
    assert trial.sensors["rpm"].values["rpm"][3] == float(2**60)


def test_inspect_shows_the_clock_of_integer_stamps(tmp_path):
    table = wide_table().drop(columns="time_s")
    table["timestamp"] = stamps_ns()
    table["utc"] = pd.to_datetime(stamps_ns())
    table.to_parquet(tmp_path / "run.parquet")
    (file,) = inspect_log(tmp_path / "run.parquet").files
    assert file.rate_hz == pytest.approx(10.0, rel=1e-6)
    assert file.rows == len(table)


@pytest.mark.parametrize("name", ["time_ns", "timestamp_ns"])
@pytest.mark.parametrize("kind", [pa.int64(), pa.uint64()])
def test_nanoseconds_since_switch_on(tmp_path, kind, name):
    counts = stamps_ns() - START_NS + 5_000_000_000_000
    found, origin = times(write(tmp_path / "run.parquet", pa.array(counts, kind), name))
    assert origin == ""
    np.testing.assert_allclose(found, counts / 1e9, rtol=1e-15)


def test_durations(tmp_path):
    column = pa.array(stamps_ns() - START_NS, pa.duration("ns"))
    found, origin = times(write(tmp_path / "run.parquet", column))
    assert origin == ""
    np.testing.assert_array_equal(found, (stamps_ns() - START_NS) / 1e9)


@pytest.mark.filterwarnings("ignore:overflow:RuntimeWarning")
@pytest.mark.parametrize(
    "times", [["0", "5e-324", "1e-323"], ["-1.7e308", "1.7e308"], ["0", "1e308", "1.7e308"]]
)
def test_inspect_shows_stamps_that_make_no_rate(tmp_path, times):
    rows = "".join(f"{time},1.5\n" for time in times)
    (tmp_path / "rpm.csv").write_text("time_s,rpm\n" + rows)
    (file,) = inspect_log(tmp_path).files
    assert file.rate_hz is None or file.rate_hz < 1e-300


@pytest.mark.parametrize("filler", [0, -1, 2**63 - 1, -(2**63) + 5])
def test_a_stamp_of_a_clock_that_was_not_set_is_missing(tmp_path, filler):
    stamps = stamps_ns()
    stamps[5] = filler
    (trial,) = read_trials([write(tmp_path / "run.parquet", pa.array(stamps, pa.int64()))])
    gyro = trial.sensors["gyro"]
    assert gyro.dropped == {"no_time": 1}
    assert trial.origin == "2024-05-01T10:00:00Z"
    kept = np.delete(stamps_ns(), 5)
    np.testing.assert_array_equal(gyro.time_s, (kept - START_NS // 10**9 * 10**9) / 1e9)


def test_the_largest_unsigned_number_is_no_time(tmp_path):
    stamps = stamps_ns().astype(np.uint64)
    stamps[5] = 2**64 - 1
    (trial,) = read_trials([write(tmp_path / "run.parquet", pa.array(stamps, pa.uint64()))])
    assert trial.sensors["gyro"].dropped == {"no_time": 1}
    kept = np.delete(stamps_ns(), 5)
    expected = (kept - START_NS // 10**9 * 10**9) / 1e9
    np.testing.assert_array_equal(trial.sensors["gyro"].time_s, expected)


@pytest.mark.parametrize("first", [0, START_NS])
def test_nanoseconds_in_a_column_of_seconds_are_refused(tmp_path, first):
    column = pa.array(stamps_ns() - START_NS + first, pa.int64())
    path = write(tmp_path / "run.parquet", column, "time_s")
    with pytest.raises(InputError) as caught:
        read_trials([path])
    for word in (str(path), "column time_s", "finer unit", "time_ns"):
        assert word in str(caught.value)


@pytest.mark.parametrize(("per_second", "step"), [(1.0, "128 s"), (1e3, "131 s")])
def test_an_epoch_of_single_precision_is_told_by_its_steps(tmp_path, per_second, step):
    seconds = (stamps_ns() / 1e9 * per_second).astype(np.float32)
    path = write(tmp_path / "run.parquet", pa.array(seconds, pa.float32()))
    with pytest.raises(InputError, match=f"floats of 32 bits.* {step} apart") as caught:
        read_trials([path])
    assert "64 bits" in caught.value.remedy


def test_seconds_of_single_precision_are_read_where_they_suffice(tmp_path):
    seconds = np.repeat(np.arange(0.0, 30.0), 10).astype(np.float32)  # a clock of whole seconds
    path = write(tmp_path / "run.parquet", pa.array(seconds, pa.float32()), "time_s")
    np.testing.assert_array_equal(times(path)[0], seconds)
